"""Pictures: written the same every time, saying what they should, nothing off the page."""

from __future__ import annotations

import re
import subprocess
import sys
from base64 import b64decode
from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from matplotlib.collections import PathCollection
from matplotlib.colors import to_hex, to_rgb
from matplotlib.text import Text
from ordinary import problems, solved
from picture_checks import check_texts, shown
from PIL import Image
from solids import box as cuboid

import fcdm_opt as fo
from fcdm_opt.curve.decision_curve import DEFAULT_BOX, decision_curve
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.exact_points import exact_at
from fcdm_opt.geometry.primitives import Cylinder
from fcdm_opt.motion.motions import Translation
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.show import GREEN, INKS, MIDDLE, bare_pixels, inline_svg, new_figure, save
from fcdm_opt.show.album import drawn_scene, solution_figure
from fcdm_opt.show.assemblies import assembly_figure, parts_of
from fcdm_opt.show.lettering import Sheet, clipped, fitted
from fcdm_opt.show.plots import before_after_figure, decision_curve_figure
from fcdm_opt.show.raster import Raster
from fcdm_opt.show.scene import (
    COLOURS,
    MOST_NAMED,
    MOVES,
    ShownBodies,
    _cut_open,
    _joined,
    body_figure,
    contacts_of,
    numbered_contacts,
    own_polygons,
    page_directions,
    scene_figure,
    scene_pieces,
    sharp_edges,
    view_of,
)
from fcdm_opt.show.sections import CORNER, Cut, Touching, change_at, draw_section, free_corner, section, section_plane
from fcdm_opt.show.stacks import faces_figure
from fcdm_opt.show.tables import print_yield
from fcdm_opt.show.texts import described

TITLE = "Example (reconstruction)"


def published(example: int, name: str) -> Solution:
    """The paper's motion as a solution: pictures need no solver."""
    asked = problems(f"example{example}")[name]
    assert asked.published is not None
    transform = asked.motion.transform(asked.published, asked.movable.seed, asked.static.seed)
    moved = decision_curve(asked.movable, asked.static, box=asked.box, transform=transform)
    point = moved.switching_points[asked.nominal - 1]
    return Solution(
        problem=asked,
        status=Status.SOLVED,
        transform=transform,
        rho=point.rho,
        pair=asked.target,
        features=point.contact_features,
    )


def draw(kind: str, example: int, name: str) -> Any:
    asked, solution = problems(f"example{example}")[name], published(example, name)
    if kind == "curve":
        return decision_curve_figure(asked.curve, title=TITLE, caption="a caption")
    if kind == "before and after":
        return before_after_figure(asked, solution, title=TITLE, caption="a caption")
    moved = decision_curve(asked.movable, asked.static, transform=solution.transform)
    placed = {"rho": solution.rho, "transform": solution.transform, "banner": asked.published_text}
    shown = ShownBodies.of(asked.movable, asked.static, **placed)
    return scene_figure(shown, contacts=contacts_of(moved, solution.rho, shown), title=TITLE, caption="a caption")


KINDS = pytest.mark.parametrize("kind", ["curve", "before and after", "scene"])


def texts(figure: Any) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text) if text.get_visible() and text.get_text()]


# ---------------------------------------------------------------------------------------------------------------- files


@pytest.mark.slow
@KINDS
def test_the_same_picture_gives_the_same_bytes(kind: str, tmp_path: Path) -> None:
    first, second = (save(draw(kind, 1, "B"), tmp_path / part / "picture") for part in ("one", "two"))
    for one, two in zip(first, second, strict=True):
        assert one.read_bytes() == two.read_bytes()
    png, svg = first
    assert (png.name, svg.name) == ("picture.png", "picture.svg")
    assert TITLE in svg.read_text()
    assert "a caption" in svg.read_text()
    assert "<dc:date>" not in svg.read_text()


@pytest.mark.slow
def test_drawing_leaves_the_global_plotting_state_alone() -> None:
    code = """if True:
        import sys, tempfile, matplotlib
        from fcdm_opt.geometry.bodies import Body
        from fcdm_opt.show import GREY, save
        from fcdm_opt.show.scene import ShownBodies, scene_figure
        state = lambda: {key: matplotlib.rcParams[key] for key in matplotlib.rcParams if key != "backend"}
        before = state()
        body = Body.convex([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        with tempfile.TemporaryDirectory() as directory:
            save(scene_figure(ShownBodies.of(body, body)), directory + "/picture")
        print("matplotlib.pyplot" in sys.modules, state() == before)
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


@pytest.mark.sampled(9)
@KINDS
@pytest.mark.parametrize(("example", "name"), [(1, "A"), (1, "B"), (1, "C"), (1, "D"), (2, "A"), (2, "B")])
def test_no_text_runs_off_the_page_or_into_another(kind: str, example: int, name: str) -> None:
    check_texts(draw(kind, example, name), least=6)


def test_the_check_sees_texts_off_the_page_upon_another_or_too_small() -> None:
    for x, y, size in ((0.99, 0.5, 8.0), (0.48, 0.51, 8.0), (0.2, 0.2, 4.0)):
        sheet = Sheet.of(3.0, 2.0, title="a title", caption="a caption")
        sheet.figure.text(0.5, 0.5, "words")
        check_texts(sheet.figure, least=3)
        sheet.figure.text(x, y, "more words", fontsize=size)
        with pytest.raises(AssertionError, match="words"):
            check_texts(sheet.figure, least=3)


def test_long_titles_and_captions_are_wrapped_onto_the_page() -> None:
    asked = problems("example1")["A"]
    long = "a title that is much longer than the page is wide, " * 5
    figure = decision_curve_figure(asked.curve, title=long, caption="x" * 300 + " " + long)
    check_texts(figure, least=6)
    told = " ".join(" ".join(text.get_text() for text in shown(figure)).split())
    assert long.strip() in told
    assert told.replace(" ", "").count("x" * 300) == 1


def test_lines_break_at_spaces_then_commas_then_anywhere() -> None:
    figure = Sheet.of(3.0, 1.0).figure
    assert fitted(figure, "one two", 8.0, 2.0) == ["one two"]
    assert fitted(figure, "one two", 8.0, 0.3) == ["one", "two"]
    long = "clearance not met: parts as made, moved to where all else is met"  # bold, it was cut off on both sides
    for weight in ("normal", "bold"):
        for line in fitted(figure, long, 8.0, 2.0, weight=weight):
            shown = figure.text(0.0, 0.0, line, fontsize=8.0, weight=weight)
            assert shown.get_window_extent().width <= 2.0 * figure.dpi + 1.0
    assert fitted(figure, "  aaaa,bbbb", 8.0, 0.45, hang="  ") == ["  aaaa,", "    bbbb"]
    assert fitted(figure, "a\n\nb", 8.0, 2.0) == ["a", "", "b"]
    assert "".join(fitted(figure, "abcdefghijklmnop", 8.0, 0.3)) == "abcdefghijklmnop"


def test_a_list_without_room_says_how_much_is_left_out() -> None:
    sheet = Sheet.of(3.0, 0.7)
    sheet.list(0.1, 0.65, 2.5, [f"line {k}" for k in range(20)])
    last = shown(sheet.figure)[0].get_text().splitlines()
    assert last[-1] == f"... and {20 - (len(last) - 1)} more"
    assert last[:-1] == [f"line {k}" for k in range(len(last) - 1)]


@pytest.mark.parametrize("name", ["lid", "bracket", "keyway"])
def test_names_keep_apart_in_other_problems(name: str) -> None:
    asked = next(iter(problems(name).values()))
    check_texts(decision_curve_figure(asked.curve, title=name, caption="a caption"))
    keep_out = [own.body.scaled(own.ends[1]) for own in asked.keep_out]
    shown = ShownBodies.of(asked.movable, asked.static, keep_out=keep_out)
    check_texts(scene_figure(shown, title=name, caption="a caption"))


# --------------------------------------------------------------------------------------------------------------- curves


def test_the_curve_is_drawn_with_the_labels_of_the_paper(tmp_path: Path) -> None:
    svg = save(draw("curve", 1, "B"), tmp_path / "curve")[1].read_text()
    for label in ("S1  V1F2(P1V6; P2V2,V3,V5)", "SW3  (1.273451, 1.214536)"):
        assert label in svg
    for name in ("S5", "SW4", "apart", "overlapping"):
        assert f">{name}<" in svg
    assert ">S6<" not in svg
    two_contacts = "\n".join(texts(draw("curve", 2, "B")))
    for label in ("V1F2(P1V5; P2V4,V5,V10,V11)", "V1F2(P1V4; P2V3,V4,V9,V10)", "V1E2(P1V4; P2V9,V10)"):
        assert label in two_contacts


def test_a_box_without_contact_says_so() -> None:
    asked = problems("example1")["A"]
    apart = decision_curve(asked.movable, asked.static, box=((0.8, 0.85), (0.8, 0.85)))
    assert "no contact in the box: apart" in texts(decision_curve_figure(apart))


def test_before_and_after_shows_both_curves_and_the_three_points() -> None:
    asked, solution = problems("example1")["C"], published(1, "C")
    figure = before_after_figure(asked, solution)
    whole, zoom = figure.axes
    points = {line.get_label(): line.get_xydata()[0] for line in zoom.lines if line.get_linestyle() == "None"}
    np.testing.assert_array_equal(points["tracked point before"], asked.nominal_pair)
    np.testing.assert_array_equal(points["target pair (parts made)"], asked.target)
    np.testing.assert_array_equal(points["tracked point after"], solution.rho)
    told = texts(figure)
    assert {"SW3", "SW3'", "S3", "S3'", "decision curve before", "after the motion", "tolerance"} <= set(told)
    low, high = np.transpose([zoom.get_xlim(), zoom.get_ylim()])
    for point in (asked.target, solution.rho, 0.98 * asked.nominal_pair, 1.02 * asked.nominal_pair):
        assert np.all((low < point) & (point < high))
    assert whole.get_xlim() == (0.8, 3.0)


def test_without_a_motion_only_the_curve_before_is_drawn() -> None:
    asked = problems("example1")["C"]
    told = texts(before_after_figure(asked, Solution(problem=asked, status=Status.NOT_FOUND, pair=asked.target)))
    assert "decision curve before" in told
    assert "after the motion" not in told
    assert "tracked point after" not in told


def test_clipping_a_straight_piece() -> None:
    window = ((0.0, 1.0), (0.0, 1.0))
    lines = [((-1, -1), (2, 2)), ((0.5, 2), (0.5, -1)), ((0.2, 0.3), (0.4, 0.1)), ((0, 2), (2, 1.1)), ((2, 0), (2, 1))]
    parts, inside = clipped(lines, window)
    expected = [[[0, 0], [1, 1]], [[0.5, 1], [0.5, 0]], [[0.2, 0.3], [0.4, 0.1]]]
    np.testing.assert_allclose(parts, expected, atol=1e-15)
    assert inside.tolist() == [True, True, True, False, False]
    assert not len(clipped(np.zeros((0, 2, 2)), window)[0])
    random = np.random.default_rng(5)
    kept = 0
    for start, end in random.uniform(-2, 3, (200, 2, 2)):
        (piece,) = parts if len(parts := clipped([start, end], window)[0]) else (None,)
        if piece is None:  # then a dense sample stays outside too
            sample = start + np.linspace(0, 1, 501)[:, None] * (end - start)
            assert not np.any(np.all((sample > 0) & (sample < 1), axis=1))
            continue
        kept += 1
        along = (piece - start) @ (end - start) / ((end - start) @ (end - start))
        np.testing.assert_allclose(start + along[:, None] * (end - start), piece, atol=1e-12)
        assert -1e-12 < along[0] < along[1] < 1 + 1e-12
        assert np.all((piece > -1e-12) & (piece < 1 + 1e-12))
    assert kept > 40


# --------------------------------------------------------------------------------------------------------------- scenes


def test_true_edges_leave_out_what_a_cut_makes_on_a_face() -> None:
    cube = Body.convex([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    edges = sharp_edges(cube)
    assert len(edges) == 12
    np.testing.assert_allclose([np.linalg.norm(b - a) for a, b in edges], 1.0)
    ell = problems("example2")["A"].static  # a prism over a hexagon, cut along 1-4-10-7
    assert len(sharp_edges(ell)) == 18
    found = {tuple(sorted(int(np.linalg.norm(ell.vertices - end, axis=1).argmin()) + 1 for end in ends))
             for ends in sharp_edges(ell)}  # fmt: skip
    assert not {(1, 4), (7, 10)} & found
    assert (4, 10) in found  # the reflex edge


def box(at: Sequence[float], size: float) -> Body:
    corners = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    return Body.convex(np.array(corners) * size / 2.0 + at)


def seen(body: Body, behind: Body | None = None) -> float:
    """Length on the page of the edges that are seen, of all that are there."""
    page = page_directions(30.0, -50.0)
    raster = Raster(page, np.array([-3.0, -3.0]), np.array([3.0, 3.0]), 600)
    for each in (body, behind) if behind is not None else (body,):
        raster.fill(own_polygons(each), "#0072B2", 0)
    pieces = raster.visible(sharp_edges(body))
    whole = np.diff(sharp_edges(body) @ page, axis=1)
    return sum(float(np.linalg.norm(b - a)) for a, b in pieces) / float(np.linalg.norm(whole, axis=2).sum())


def test_hidden_edges_are_not_drawn() -> None:
    """Edges along one axis have one length on the page, and of the four of each a convex cube hides one."""
    cube = box((0.0, 0.0, 0.0), 1.0)
    assert seen(cube) == pytest.approx(0.75, abs=0.02)
    page = page_directions(30.0, -50.0)
    toward = np.cross(page[:, 0], page[:, 1])
    assert seen(cube, box(20.0 * toward, 5.0)) == pytest.approx(0.0, abs=0.02)  # a larger one stands before it
    assert seen(cube, box(-20.0 * toward, 5.0)) == pytest.approx(0.75, abs=0.02)


@pytest.mark.parametrize("kept", ["exact", "surface"])
def test_cuts_within_a_solid_were_drawn_as_edges(kept: str) -> None:
    """A tray is cut inside its walls: these lines showed as dots on its faces."""
    x = (0.0, 1.0, 9.0, 10.0)
    blocks = [trimesh.creation.box(bounds=ends) for ends in (((0, 0, 0), (10, 10, 5)), ((1, 1, 1), (9, 9, 6)))]
    edges = sharp_edges(Body.from_mesh(trimesh.boolean.difference(blocks), decomposition=kept))
    assert len(edges) == 24
    assert np.isin(edges[..., :2], x).all()


def test_dashes_went_round_no_curve() -> None:
    """Each facet's edge began them anew: a ring was drawn in full."""
    angles = 2.0 * np.pi * np.arange(25) / 24
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    pieces = np.stack([ring[:-1], ring[1:]], axis=1)[np.random.default_rng(0).permutation(24)]
    (line,) = _joined(pieces, 2.0)
    assert len(line) == 25


def test_round_surfaces_have_no_edges_but_at_their_ends() -> None:
    angles = 2.0 * np.pi * np.arange(24) / 24
    ends = [np.column_stack([np.cos(angles), np.sin(angles), np.full(24, z)]) for z in (0.0, 1.0)]
    pin = Body.convex(np.vstack(ends))
    edges = sharp_edges(pin)
    assert len(edges) == 48
    assert (edges[:, 0, 2] == edges[:, 1, 2]).all()
    assert len(sharp_edges(box((0.0, 0.0, 0.0), 1.0))) == 12


def test_eight_parts_have_colours_of_their_own_and_none_has_that_of_contacts() -> None:
    """The seventh part had the colour of the first, the sixth that of contacts.

    As Machado, Oliveira and Fernandes (2009) simulate colour vision without one kind of cones; distances in CIELAB.
    """
    seen = {
        "all cones": np.eye(3),
        "no long": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
        "no middle": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
        "no short": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
    }
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    given = np.array([to_rgb(own) for own in (*COLOURS, GREEN)])
    linear = np.where(given <= 0.04045, given / 12.92, ((given + 0.055) / 1.055) ** 2.4)
    assert len(COLOURS) == 8
    for cones, matrix in seen.items():
        x, y, z = np.cbrt((np.clip(linear @ np.transpose(matrix), 0.0, 1.0) @ xyz.T) / xyz.sum(axis=1)).T
        lab = np.column_stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])
        apart = np.linalg.norm(lab[:, None] - lab, axis=2) + 100.0 * np.eye(len(lab))
        assert apart.min() > (30.0 if cones == "all cones" else 15.0), cones
        assert lab[:-1, 0].min() > 35.0, cones  # seen on a dark page, too


def test_what_is_said_above_a_scene_stays_on_its_page() -> None:
    """Bold words were measured as thin: "impossible: parts as made, moved to where all else is met" lost its ends."""
    one, two = box((0.0, 0.0, 0.0), 1.0), box((1.0, 0.0, 0.0), 1.0)
    shown = ShownBodies.of(one, two, view=(20.0, -70.0))
    plain = scene_pieces(shown).scene
    for count in (1, 20, 40, 57, 75, 200):
        reason = replace(shown, banner=" ".join(["impossible"] * (1 + count // 11)))
        for figure in (scene_figure(reason), scene_pieces(reason).scene):
            check_texts(figure, least=3)
        (words,) = [text for text in figure.findobj(Text) if text.get_text().startswith("impossible")]
        frame = words.get_bbox_patch().get_window_extent()
        assert frame.y0 >= figure.axes[0].bbox.y1  # upon no body
        assert figure.bbox.height > plain.bbox.height


def test_a_motion_too_small_to_be_seen_is_drawn_larger_and_says_how_much() -> None:
    one, two = box((0.0, 0.0, 0.0), 1.0), box((1.0, 0.0, 0.0), 1.0)
    motion = np.eye(4)
    motion[0, 3] = -0.001
    shown = ShownBodies.of(one, two, transform=motion, view=(20.0, -70.0))
    before, times = shown.before
    np.testing.assert_allclose(
        before[0].vertices - shown.bodies[0].vertices, [[times * 0.001, 0.0, 0.0]] * 8, atol=1e-12
    )
    assert times > 10.0
    figure = scene_figure(replace(shown, banner="0.001 along -x"))
    words = [" ".join(text.split()) for text in texts(figure)]
    assert f"before the motion: the same part, drawn {times:g} times as far off" in words
    motion[0, 3] = -1.0
    assert ShownBodies.of(one, two, transform=motion, view=(20.0, -70.0)).before[1] == 1.0
    for degrees, drawn in ((16.5, 1.0), (2.0, 14.0)):  # what is seen is as it is: it was 1.7 times as far
        assert ShownBodies.of(one, two, transform=turned(degrees), view=(20.0, -70.0)).before[1] <= drawn
    slab, part = (
        Body.convex(cuboid(*ends)) for ends in (((-1.2, -1.2, -0.25), (1.2, 1.2, 0.6)), ((-1, -1, 0), (1, 1, 1)))
    )
    rise = placed((0, 0, 0.001))
    times = ShownBodies.of(part.moved(np.linalg.inv(rise)), slab, transform=rise).before[1]
    assert 100.0 < times <= 250.0  # .25 above the bottom of what it stands in, from below which it seemed to come


def test_a_section_is_what_a_plane_cuts_out() -> None:
    plane = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    (square,) = section(box((0.0, 0.0, 0.0), 2.0), np.array([0.0, 0.0, 0.25]), np.array([0.0, 0.0, 1.0]), plane)
    assert sorted(map(tuple, square.tolist())) == [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]
    assert section(box((0.0, 0.0, 9.0), 2.0), np.zeros(3), np.array([0.0, 0.0, 1.0]), plane) == []


def test_facets_of_round_faces_were_drawn_with_edges_and_corners() -> None:
    """Twelve facets a turn meet at 30 degrees; points at which a body is exact stood out of it as small pyramids."""
    pin = Cylinder(2.0, 3.0, facets=12)
    assert len(sharp_edges(pin)) == 24  # of both ends, none between facets
    across = np.array([0.0, 0.0, 1.0]), np.eye(3)[:, :2]
    (circle,) = section(pin, np.array([0.0, 0.0, 1.0]), *across)
    assert len(circle) > 100
    assert np.linalg.norm(circle, axis=1) == pytest.approx([2.0] * len(circle), abs=1e-12)
    exact = exact_at(pin, np.array([[2.0 * np.cos(0.3), 2.0 * np.sin(0.3), 1.0]]))
    assert exact is not None
    assert len(exact.parts) == 2
    assert len(ShownBodies.of(exact, exact).bodies[0].parts) == 1


def peg_in_a_blind_hole() -> tuple[Body, Body]:
    """A peg of 2 x 2 x 3 on the bottom of a hole of 3 x 3 x 2 in a block of 6 x 6 x 3."""
    corners = ((-1, -1, 0), (1, 1, 3)), ((-3, -3, -1), (3, 3, 2)), ((-1.5, -1.5, 0), (1.5, 1.5, 3))
    peg, block, hole = (trimesh.creation.box(bounds=ends) for ends in corners)
    return Body.from_mesh(peg), Body.from_mesh(trimesh.boolean.difference([block, hole]))


def volume(polygons: Sequence[Any]) -> float:
    """What closed polygons enclose, by the divergence theorem."""
    fans = ((own[0], own[k], own[k + 1]) for own in polygons for k in range(1, len(own) - 1))
    return sum(float(np.linalg.det(np.array(fan))) for fan in fans) / 6.0


def test_what_touches_inside_a_part_looked_as_if_it_lay_on_the_outside() -> None:
    """The block hides all of the peg's foot; cut through the middle, half of each is left, and nothing hides it."""
    peg, block = bodies = peg_in_a_blind_hole()
    foot = Touching((np.array([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)]),), np.eye(3)[2])
    shown, page = ShownBodies.of(peg, block, view=(32.0, -55.0)), page_directions(32.0, -55.0)
    assert "cut open at the contact; thin lines: what is cut away" in texts(scene_figure(shown, contacts=[foot]))
    with pytest.MonkeyPatch.context() as patch:  # a report ended with an error where a section meets none of many
        patch.setattr(Cut, "met", lambda *_: [])
        assert "in contact" in texts(scene_figure(shown, contacts=[foot] * (MOST_NAMED + 1)))
    whole = Raster(page, np.full(2, -6.0), np.full(2, 6.0), 600)
    opened, (cut, _) = whole.empty(), Cut.through([foot], bodies, page)
    assert cut is not None
    np.testing.assert_allclose(cut.facing, [0.0, -1.0, 0.0], atol=1e-12)
    (line,) = cut.met(foot.pieces)
    np.testing.assert_allclose(np.sort(line, axis=0), [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], atol=1e-4)
    for body, size in zip(bodies, (2 * 2 * 3, 6 * 6 * 3 - 3 * 3 * 2), strict=True):
        left, edges, section = _cut_open(body, cut)
        assert volume([*left, *section]) == pytest.approx(size / 2.0, rel=1e-4)
        assert min(own[:, 1].min() for own in (*left, *edges, *section)) == pytest.approx(0.0, abs=1e-4)
        whole.fill(own_polygons(body), "#0072B2", 0)
        opened.fill([*left, *section], "#0072B2", 0)
    assert whole.share_seen(line) == 0.0
    assert opened.share_seen(line) > 0.9


def test_of_two_contacts_the_cut_met_only_the_one_of_many_pieces() -> None:
    """A foot of 40 strips along y, and a line at y = 0.5 on a wall: the plane goes through both, and both are drawn."""
    strips = [
        (np.array([(-1, y, 0), (1, y, 0), (1, y + 0.05, 0), (-1, y + 0.05, 0.0)]),) for y in np.arange(-1, 1, 0.05)
    ]
    contacts = [Touching(own, np.eye(3)[2], number=1, text="foot") for own in strips]
    line = np.array([(1.0, 0.5, 0.0), (1.0, 0.5, 1.0)])
    contacts.append(Touching((line,), np.eye(3)[0], number=2, text="wall"))
    peg, block = bodies = peg_in_a_blind_hole()
    cut, share = Cut.through(contacts, bodies, page_directions(32.0, -55.0))
    assert cut is not None
    assert share == 1.0
    assert np.ptp(cut.heights(line)) == 0.0 or cut.met([line])
    figure = scene_figure(ShownBodies.of(peg, block, view=(32.0, -55.0)), contacts=contacts)
    assert {"1", "2"} <= set(texts(figure))
    assert "intended contact" not in texts(figure)  # of parts that are to be apart it was none


def test_faces_of_bodies_exact_at_points_share_all_of_what_those_drawn_do() -> None:
    """A pipe of 24 sides, radii 2 and 4, flush on a plate: of the bodies within the true ones strips were left out."""
    mesh = trimesh.creation.annulus(2.0, 4.0, 3.0, sections=24)
    pipe = Body.from_mesh(mesh.apply_translation((0, 0, 1.5))).rounded()
    exact = exact_at(pipe, np.array([[2.0, 0.0, 0.0]]))
    assert exact is not None
    plate = Body.from_mesh(trimesh.creation.box(bounds=((-9, -9, -1), (9, 9, 0))))
    contacts = contacts_of(decision_curve(exact, plate), (1.0, 1.0), ShownBodies.of(exact, plate))
    across = [np.cross(own[1] - own[0], own[2] - own[0]) for each in contacts for own in each.pieces]
    area = 12 * np.sin(np.pi / 12) * (4**2 - 2**2)
    assert np.linalg.norm(across, axis=1).sum() / 2.0 == pytest.approx(area, rel=1e-6)
    assert {each.text for each in contacts} == {""}  # it is the only one


def test_walls_between_the_parts_of_a_solid_were_drawn() -> None:
    """A rail of blocks side by side: its surface is that of one solid, and so is its section, in whatever look."""
    ends = ((0, 3), (0, 1)), ((0, 1), (1, 3)), ((2, 3), (1, 3))
    rail = Body.from_parts([[*product(x, (0, 5), z)] for x, z in ends], seed=(1.5, 2.5, 0.5))
    across = [np.cross(own[1] - own[0], own[2] - own[0]) / 2.0 for own in own_polygons(rail)]
    assert np.linalg.norm(across, axis=1).sum() == pytest.approx(2 * 7.0 + 5 * 16.0)
    assert len(sharp_edges(rail)) == 24
    (outline,) = section(rail, np.array([0.0, 2.0, 0.0]), np.eye(3)[1], np.eye(3)[:, [0, 2]])
    assert len(outline) == 8


def test_the_cut_through_an_overlap_lay_in_the_bottom_of_a_part() -> None:
    """What was left of the part was a face in the plane of its section: both showed as rays."""
    plate, pin = box((0.0, 0.0, 0.0), 2.0), box((1.5, 0.0, -1.0), 2.0)
    deep = np.array([(0.5, 0.0, -1.0), (1.0, 0.0, -1.0)])
    overlap = Touching((np.vstack([deep, deep[::-1] + np.eye(3)[1]]),), np.eye(3)[0], deep)
    cut, _ = Cut.through([overlap], (pin, plate), page_directions(80.0, -55.0))
    assert cut is not None
    assert all(np.ptp((-body.vertices @ cut.facing).clip(-cut.point @ cut.facing)) > 0.15 for body in (pin, plate))
    assert abs(cut.facing[1]) == 1.0


def test_the_report_began_with_a_look_that_hides_the_contact() -> None:
    peg, block = peg_in_a_blind_hole()
    foot = Touching((np.array([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)]),), np.eye(3)[2])
    pieces = scene_pieces(ShownBodies.of(peg, block, view=(32.0, -55.0)), contacts=[foot])
    assert pieces.cut
    assert not scene_pieces(ShownBodies.of(peg, box((9.0, 0.0, 0.0), 1.0), view=(32.0, -55.0)), contacts=[foot]).cut


def test_the_contact_is_looked_at_from_where_it_is_seen() -> None:
    """A cube on a plate, beside a tower that hides it from one side."""
    plate = box((0.0, 0.0, -5.0), 10.0)
    tower = Body.from_parts([plate.vertices, box((-3.0, 0.0, 4.0), 4.0).vertices * [1, 2, 2] - [0, 0, 4]])
    cube = box((0.5, 0.0, 0.5), 1.0)
    view = view_of(decision_curve(cube, tower), (1.0, 1.0))
    page = page_directions(*view)
    assert np.cross(page[:, 0], page[:, 1])[0] > 0.0
    assert "in contact" in texts(draw("scene", 2, "A"))


def test_a_key_behind_its_shaft_was_not_to_be_seen() -> None:
    """It stands out of a pocket in the back and touches a wall: nothing of that is seen from the front."""
    key = Body.convex(cuboid((-4, 11.1, -12.4), (4, 18, 12.4)))
    walls = [((-15, -9, -12.5), (-4.1, 15, 12.5)), ((4, -9, -12.5), (15, 15, 12.5)), ((-4.1, -9, -12.5), (4, 11, 12.5))]
    ends = [((-15, -9, -30), (15, 15, -12.5)), ((-15, -9, 12.5), (15, 15, 30))]
    shaft = Body.from_parts([cuboid(*own) for own in (*walls, *ends)])
    view = view_of(decision_curve(key, shaft), (1.0, 1.0), ((1.0, 0.0, 0.0),))
    page = page_directions(*view)
    assert np.cross(page[:, 0], page[:, 1])[1] > 0.0


@pytest.mark.parametrize("view", [(18.0, -70.0), (32.0, -20.0), (18.0, 110.0), (50.0, -55.0)])
@pytest.mark.parametrize("way", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)])
def test_an_inset_stood_on_its_head_beside_its_scene(view: tuple[float, float], way: Any) -> None:
    """Whichever way a part moves in the scene, it moves in the inset, as right, left, up or down; z stays up."""
    step, page = np.array(way), page_directions(*view)
    facing, plane = section_plane(step, 0.1 * step, page)
    assert facing @ np.cross(page[:, 0], page[:, 1]) > 0.0  # seen from the scene's side
    np.testing.assert_allclose(np.cross(plane[:, 0], plane[:, 1]), facing, atol=1e-12)
    np.testing.assert_allclose(sorted(np.abs(step @ plane)), [0.0, 1.0], atol=1e-12)
    assert (step @ plane) @ (step @ page) > 0.0
    if abs(facing[2]) < 0.5:
        np.testing.assert_allclose(plane[:, 1], [0.0, 0.0, 1.0], atol=1e-12)


def test_a_small_gap_was_magnified_no_more_than_a_large_one_beside_it() -> None:
    """A block that goes .05 along x to a wall and .005 up to a floor: ten times as much is magnified of the floor."""
    block, corner, pose = box((0.0, 0.0, 1.0), 2.0), box((0.0, 0.0, -1.0), 2.0), np.eye(4)
    pose[:3, 3] = 0.05, 0.0, 0.005
    places = ((0.0, 0.0, 0.0), np.eye(3)[2], 1), ((-1.0, 0.0, 1.0), np.eye(3)[0], 2)
    contacts = [Touching((np.array([place]),), normal, number=k) for place, normal, k in places]
    shown = ShownBodies.of(block.moved(np.linalg.inv(pose)), corner, transform=pose, view=(32.0, -55.0))
    times = [
        float(text.partition("\u00d7 ")[2])
        for own in scene_pieces(shown, contacts=contacts).insets for text in texts(own) if "\u00d7" in text
    ]  # fmt: skip
    assert times[0] / times[1] == pytest.approx(10.0, rel=0.1)  # two digits are shown


@pytest.mark.parametrize(
    ("normal", "step", "facing"),
    [
        ((1.0, 0.0, 0.0), (0.2, -0.05, 0.005), (0.0, 0.0, 1.0)),  # of a wall: level
        ((0.0, 0.0, 1.0), (0.2, -0.05, 0.005), (0.0, -1.0, 0.0)),
        ((0.6, 0.0, 0.8), (0.1, 0.0, 0.3), (0.0, -1.0, 0.0)),  # of a slope: across it
        ((0.6, 0.48, 0.64), (0.0, 0.8, -0.6), (-0.8, 0.36, 0.48)),  # neither is across an axis
    ],
)
def test_a_wall_along_an_axis_was_cut_askew(normal: Any, step: Any, facing: Any) -> None:
    """Cut along axes of the world wherever one lies across the normal."""
    found, plane = section_plane(np.array(normal), np.array(step), page_directions(32.0, -55.0))
    np.testing.assert_allclose(np.abs(found), np.abs(facing), atol=1e-12)
    np.testing.assert_allclose(plane.T @ found, 0.0, atol=1e-12)


def test_a_cut_through_a_corner_showed_one_part_alone() -> None:
    """A tip at the origin, above which its part is: level, as wall and motion lie, a plane meets nothing of it."""
    tip = Body.convex([(0.0, 0.0, 0.0), (2.0, -0.5, 1.0), (2.0, 0.5, 1.0), (2.0, 0.0, 2.0)])
    contact = Touching((np.zeros((1, 3)),), np.eye(3)[0])
    solids = [(tip, "#0072B2"), (box((-1.0, 0.0, 0.0), 2.0), "#D55E00")]
    page, sheet = page_directions(32.0, -55.0), Sheet.of(2.0, 2.0)
    facing = draw_section(sheet, (0.0, 0.0), solids, contact, placed((0.05, 0.05, 0.0)), page, 1.0, "")
    np.testing.assert_allclose(facing, [0.0, -1.0, 0.0], atol=1e-12)
    assert {to_hex(own.get_facecolor()[:3]) for own in sheet.figure.axes[0].patches} >= {"#0072b2", "#d55e00"}


def test_an_oblique_cut_did_not_say_how_it_lies() -> None:
    """A slope whose normal is across no axis: the section is named by its own normal, on which that is 0."""
    normal = np.array([0.48, 0.6, 0.64])
    contact = Touching((np.zeros((1, 3)),), normal)
    shown = ShownBodies.of(box((0.0, 0.0, 1.0), 2.0), box((0.0, 0.0, -1.0), 2.0), view=(32.0, -55.0))
    shown = replace(shown, moves=(placed(np.array([0.0, 0.8, -0.6]) * 0.1 + 0.05 * normal),))
    (told,) = [text for own in scene_pieces(shown, contacts=[contact]).insets for text in texts(own) if "seen" in text]
    values = np.array([float(own) for own in re.findall(r"-?[\d.]+", told)])
    assert values.shape == (3,)
    assert values @ normal == pytest.approx(0.0, abs=0.01)
    assert values @ values == pytest.approx(1.0, abs=0.02)


def placed(shift: Any) -> Any:
    pose = np.eye(4)
    pose[:3, 3] = shift
    return pose


def clamped(wide: float, across: float = 30.0) -> fo.AssemblySolution:
    """A block .4 wider than drawn between a wall and a jaw, `across` from that wall in a base; a cap lies on it."""
    blocks = [[(-40, -20, -10), (40, 20, 0)], [(-40, -20, 0), (-20, 20, 20)]]
    blocks += [[(across - 20.0, -20, 0), (40, 20, 20)]] * (across < 40.0)
    base = Body.from_parts([[*product(*zip(*ends, strict=True))] for ends in blocks])
    block, cap, jaw = (
        Body.convex([*product(*ends)])
        for ends in (((-20, 10), (-10, 10), (0, 15)), ((-15, 5), (-8, 8), (15, 20)), ((10, 25), (-20, 20), (0, 20)))
    )
    jaws = {"jaw": jaw} if across >= 40.0 else {}
    contacts = [("block", "base"), ("cap", "block"), *(("jaw", other) for other in ("block", "base") if jaws)]
    width = fo.Size("width", "block", faces=["+x", "-x"], each=[0.5, 0.5], tolerance=1.0)
    motion = Translation("x") >> Translation("z")
    found = fo.solve(
        fo.Assembly(
            {"base": base, "block": block, "cap": cap, **jaws}, contacts, [width],
            dict.fromkeys(("block", "cap", *jaws), motion), made={"width": wide}, unit="mm",
        )
    )  # fmt: skip
    assert isinstance(found, fo.AssemblySolution)
    return found


def test_a_contact_of_a_vise_had_no_number_and_no_cut() -> None:
    """The block touches base and wall, both of one part, and cap and jaw, which is on the base: five places."""
    solution = clamped(0.4, across=60.0)
    told = texts(assembly_figure(solution))
    assert [told.count(str(number)) for number in range(1, 7)] == [1, 1, 1, 1, 1, 0]
    words = numbered_contacts(*reversed(parts_of(solution)))
    assert [own[0] for own in words] == ["1", "2", "3", "4", "5"]
    cuts = {text.split()[1].rstrip(",") for text in told if text.startswith("contact ")}
    assert len(cuts) == 4
    assert all((own[0] in cuts) != own.endswith(("as in cut 1)", "in the scene alone)")) for own in words)


def test_contacts_that_nothing_changes_were_magnified_before_the_one_that_a_size_opens() -> None:
    """Four posts on a base, a cap on each; the last post is .1 higher: of eight contacts the last alone was open."""
    base = fo.Box((60, 20, 4), centre=(0, 0, -2), name="base")
    places = dict(enumerate((-24, -8, 8, 24), 1))
    posts = [fo.Box((4, 4, 10), centre=(x, 0, 5), name=f"post {k}") for k, x in places.items()]
    caps = [fo.Box((6, 6, 2), centre=(x, 0, 11), name=f"cap {k}") for k, x in places.items()]
    contacts = [*((post.name, "base") for post in posts), *((f"cap {k}", f"post {k}") for k in places)]
    motions = {own.name: Translation("z") for own in (*posts, *caps)}
    sizes = {"sizes": [fo.Size("height", "post 4", faces=["+z"], tolerance=0.2)], "made": {"height": 0.1}}
    shown, met = parts_of(fo.solve(fo.Assembly([base, *posts, *caps], contacts, motions=motions, **sizes)))
    told = " ".join(text for own in scene_pieces(shown, contacts=met).insets for text in texts(own))
    assert re.findall(r"contact (\d)", told) == ["1", "2", "3", "8"]
    (last,) = (own for own in met if own.number == 8)
    assert change_at([body for body, _ in shown.met(last)[0]], *shown.met(last)[1:])[1] == pytest.approx(0.1)
    pose, angle = np.eye(4), np.radians(0.1)  # a lid on a tip, which turns 2 above it and goes on touching
    pose[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    pose[:3, 3] = np.array([0, 0, 2]) - pose[:3, :3] @ (0, 0, 2)
    normal = pose[:3, :3] @ (0, 0, 1)
    pose[:3, 3] -= (pose[:3, 3] @ normal) * normal
    step, closed = change_at([box((0, 0, 0), 9.0)] * 2, Touching((np.zeros((1, 3)),), normal), pose)
    assert np.linalg.norm(step) == pytest.approx(2 * np.sin(angle), rel=1e-3)
    assert closed == 0.0


def test_parts_that_do_not_fit_were_drawn_as_if_they_did() -> None:
    """30.4 in a slot of 30: no arrow, words, and on both sides .2 of the block in the base."""
    solution = clamped(0.4)
    assert not solution.usable
    shown, overlaps = parts_of(solution)
    assert shown.moves == ()
    assert [own.kind for own in overlaps] == ["overlap"]
    assert overlaps[0].across is not None
    assert np.abs(np.diff(overlaps[0].across, axis=0)) == pytest.approx(np.array([[0.2, 0.0, 0.0]]), abs=1e-9)
    figure = assembly_figure(solution)
    assert {"does not fit: parts as made, not moved", "where they overlap"} <= set(texts(figure))
    assert not [own for axes in figure.axes for own in axes.texts if getattr(own, "arrowprops", None) is MOVES]
    refused = published(1, "B")
    refused = Solution(**{**vars(refused), "status": Status.NOT_VERIFIED})
    told = texts(solution_figure(refused))
    assert "not verified: parts as made, not moved" in told
    assert not [text for text in told if text.startswith("before")]


def test_a_refused_case_magnified_what_its_motion_would_cure() -> None:
    """A block .05 in its wall goes .05 aside, .01 into a clamp .04 away; one .4 higher is .1 below a camera, not .3."""
    wall = fo.Box((4, 20, 10), centre=(-7, 0, 0), name="wall")
    block = fo.Box((10, 10, 10), centre=(0, 0, 0), name="block")
    clamp = fo.KeepOut(fo.Box((4, 4, 4), centre=(7.04, 0, 0), name="clamp"))
    thick = [fo.Size("thick", "static", faces=["+x"], tolerance=0.1)]
    asked: Any = {"goal": "at", "motion": Translation("x"), "made": {"thick": 0.05}, "unit": "mm"}
    refused = fo.solve(fo.Problem(block, wall, sizes=thick, keep_out=[clamp], **asked))
    shown, (found,) = (drawn_scene(refused)[0][key] for key in ("shown", "contacts"))
    assert (shown.moves, found.kind, found.pair) == ((), "overlap", (0, 2))
    assert found.long == pytest.approx(0.01, abs=1e-9)
    assert shown.banner.endswith(": parts as made, moved to where all else is met")
    limited = fo.solve(fo.Problem(block, wall, sizes=thick, limits={"TX": (-0.02, 0.02)}, **asked))
    shown, (found,) = (drawn_scene(limited)[0][key] for key in ("shown", "contacts"))
    assert (found.kind, shown.banner.rpartition(", ")[2]) == ("overlap", "at the nearest pose found")
    assert found.long == pytest.approx(0.03, abs=1e-6)
    boxes = {"base": ((20, 20, 2), -1), "block": ((10, 10, 10), 5), "camera": ((6, 6, 4), 12.5)}
    parts = [fo.Box(edges, centre=(0, 0, z), name=name) for name, (edges, z) in boxes.items()]
    taller = {"sizes": [fo.Size("height", "block", faces=["+z"], tolerance=0.5)], "made": {"height": 0.4}}
    contacts = [("block", "base"), {"parts": ("block", "camera"), "goal": "clear", "clearance": 0.3}]
    both = fo.solve(fo.Assembly(parts, contacts, motions={"block": Translation("z")}, unit="mm", **taller))
    _, (found,) = parts_of(both)
    assert (found.kind, found.pair) == ("gap", (1, 2))
    assert found.long == pytest.approx(0.1, abs=1e-9)


def test_overlaps_of_facets_were_drawn_of_round_parts_that_have_a_play() -> None:
    """A pin of 20 in a bore of 20.02, whose facets stand out of either; of 20.6 it is .29 in the bore all around."""
    bored = fo.cut(fo.Box((40.0, 40.0, 10.0)), fo.Cylinder(10.01, 20.0))
    loose, tight = (fo.Cylinder(radius, 12.0).moved(turned(7.0)) for radius in (10.0, 10.3))
    assert Touching.overlap(loose, bored) is None
    found = Touching.overlap(tight, bored)
    assert found is not None
    assert found.across is not None
    assert 0.2 < np.linalg.norm(np.diff(found.across, axis=0)) < 0.4  # of facets


def turned(degrees: float) -> Any:
    pose, angle = np.eye(4), np.radians(degrees)
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return pose


def test_a_contact_that_a_cut_takes_away_lost_its_number() -> None:
    """Of three that are hidden two are in the plane of the cut, and one is before it: a ring with its number."""
    one, two = box((0.0, 0.0, 1.0), 2.0), box((0.0, 0.0, -1.0), 2.0)
    spots = ((-0.5, 0.0), 1), ((0.5, 0.0), 2), ((0.0, -0.8), 3)
    contacts = [Touching((np.array([[*place, 0.0]]),), np.eye(3)[2], number=number) for place, number in spots]
    told = texts(scene_figure(ShownBodies.of(one, two, view=(20.0, -70.0)), contacts=contacts))
    assert any(text.startswith("cut open") for text in told)
    assert {"1", "2", "3"} <= set(told)
    assert any("cut away" in text for text in told if text.startswith("dashes"))


def test_facets_of_one_face_had_an_inset_each() -> None:
    """Both were named contact 1: of faces that are apart each has its own."""
    one, two = box((0.0, 0.0, 1.0), 2.0), box((0.0, 0.0, -1.0), 2.0)
    facets = [Touching((np.eye(3)[k][None],), np.eye(3)[k], number=1) for k in range(2)]
    for numbers, count in (((1, 1), 1), ((1, 0), 1), ((1, 2), 2)):  # 0: told with another
        contacts = [own._replace(number=number) for own, number in zip(facets, numbers, strict=True)]
        assert len(scene_pieces(ShownBodies.of(one, two, view=(32.0, -55.0)), contacts=contacts).insets) == count


def test_a_play_was_nowhere_magnified() -> None:
    """A cube of 2 above a larger one by .025: what is nearest of that is 2 by 2, the gap .025 along z."""
    cube, table = box((0.5, 0.0, 0.0), 2.0), box((0.0, 0.0, -4.025), 6.0)
    gap = Touching.gap(decision_curve(cube, table), np.ones(2), cube, table)
    assert gap is not None
    assert gap.kind == "gap"
    np.testing.assert_allclose(np.abs(gap.normal), [0.0, 0.0, 1.0], atol=1e-12)
    assert gap.across is not None
    np.testing.assert_allclose(gap.across[1] - gap.across[0], [0.0, 0.0, -0.025], atol=1e-12)
    np.testing.assert_allclose(np.ptp(gap.pieces[0], axis=0), [2.0, 2.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(gap.middle, [0.5, 0.0, -1.0125], atol=1e-12)
    pieces = scene_pieces(ShownBodies.of(cube, table, view=(32.0, -55.0)), contacts=[gap])
    (title,) = [text for text in texts(pieces.insets[0]) if text.startswith("gap")]
    assert title.startswith("gap, cut open, \u00d7 ")
    assert "where the gap is least" in [text for *_, text in pieces.key]
    far = box((0.0, 0.0, 9.0), 2.0)
    assert Touching.gap(decision_curve(far, table), np.ones(2), far, table) is None  # which is seen as it is


def test_points_that_a_part_hides_stood_on_its_face_as_if_it_touched_there() -> None:
    """A point on the far side of a cube: a ring; the same point on the near side is filled."""
    one, two = box((0.0, 0.0, 0.0), 2.0), box((0.0, 5.0, 0.0), 2.0)
    shown = ShownBodies.of(one, two, view=(20.0, -70.0))
    filled = []
    for place in (-1.0, 1.0):
        point = Touching((np.array([[0.0, place, 0.0]]),), np.array([0.0, 1.0, 0.0]))
        other = Touching((np.array([[-0.5, -1.0, 0.0]]),), np.array([0.0, 1.0, 0.0]))  # seen: nothing is cut open
        figure = scene_figure(shown, contacts=[point, other, other])
        drawn = figure.axes[0].findobj(PathCollection)
        marks = [own for own in drawn if len(own.get_offsets()) and own.get_sizes()[0] < 40]
        filled.append([bool(len(own.get_facecolor())) for own in marks])
        assert any(text.startswith("dashes") or "rings" in text for text in texts(figure)) == (place > 0.0)
    assert filled == [[True, True, True], [False, True, True]]


def test_numbers_of_contacts_were_white_on_light_faces_in_the_dark() -> None:
    """They have a ground of their own, and neither follows the page's colours."""
    one, two = box((0.0, 0.0, 1.0), 2.0), box((0.0, 0.0, -1.0), 2.0)
    spots = [Touching((np.array([[x, -1.0, 0.0]]),), np.eye(3)[2], number=k) for k, x in ((1, -0.5), (2, 0.5))]
    pieces = scene_pieces(ShownBodies.of(one, two, view=(32.0, -55.0)), contacts=spots)
    for number in ("1", "2"):
        (mark,) = [own for own in pieces.scene.findobj(Text) if own.get_text() == number]
        patch = mark.get_bbox_patch()
        assert patch is not None
        colours = {to_hex(own).upper() for own in (mark.get_color(), patch.get_facecolor())}
        assert not colours & {*INKS}


def test_before_stood_in_a_white_box_in_the_dark() -> None:
    """Words of a picture and the ground that they have follow the page's colours, both."""
    one, two, pose = box((0.0, 0.0, 1.0), 2.0), box((0.0, 0.0, -1.0), 2.0), np.eye(4)
    pose[0, 3] = 0.5
    pieces = scene_pieces(ShownBodies.of(one, two, transform=pose, view=(32.0, -55.0)))
    (name,) = [own for own in pieces.scene.findobj(Text) if own.get_text() == "before"]
    assert {to_hex(own).upper() for own in (name.get_color(), name.get_bbox_patch().get_facecolor())} <= {*INKS}


def test_what_is_open_was_not_magnified_where_four_contacts_are_closed() -> None:
    """Four posts sink by .1 onto a base that is lower; the beam over the last is .4 from it then."""
    posts = [fo.Box((4, 4, 10), centre=(8 * k, 0, 5), name=f"post {k}") for k in range(1, 5)]
    base = fo.Box((60, 20, 4), centre=(0, 0, -2), name="base")
    beam = fo.Box((10, 10, 4), centre=(32, 0, 12.3), name="beam")
    clear = {"parts": ("post 4", "beam"), "goal": "clear"}
    motions = {own.name: Translation("z") for own in posts}
    sizes = {"sizes": [fo.Size("top", "base", faces=["+z"], tolerance=0.2)], "made": {"top": -0.1}}
    contacts = [*((own.name, "base") for own in posts), clear]
    shown, met = parts_of(fo.solve(fo.Assembly([base, beam, *posts], contacts, motions=motions, **sizes)))
    assert [(own.number, own.kind, own.long) for own in met][-1] == (5, "gap", pytest.approx(0.4))
    told = " ".join(text for own in scene_pieces(shown, contacts=met).insets for text in texts(own))
    assert re.findall(r"(contact|gap) (\d)", told)[-1] == ("gap", "5")


def test_where_a_keep_out_decides_was_neither_drawn_nor_magnified() -> None:
    """A cube is .1 too far down a slope of 45 degrees, and .02 from a wall: .02 along x, .08 along z, at both."""
    cube = fo.Body.convex(cuboid([-1.0] * 3, [1.0] * 3), name="cube")
    slope = np.array([[x, y, z] for x, z in ((-5.0, -5.0), (3.1, -5.0), (-5.0, 3.1)) for y in (-3.0, 3.0)])
    wall = fo.KeepOut(fo.Box((2, 6, 6), centre=(2.02, 0, 0), name="wall"))
    motion = Translation("x") >> Translation("z")
    asked = fo.Problem(
        cube, fo.Body.convex(slope, name="slope"), motion=motion, goal="clear", keep_out=(wall,), target=(1, 1)
    )
    solution = fo.solve(asked)
    assert [*solution.parameters.values()] == pytest.approx([0.02, 0.08])
    drawn, _ = drawn_scene(solution)
    assert {own.pair: (own.number, own.text) for own in drawn["contacts"]} == {
        (0, 1): (1, "cube - slope"), (0, 2): (2, "cube - wall")
    }  # fmt: skip
    assert drawn["contacts"][-1].middle[0] == pytest.approx(1.02)
    told = " ".join(text for own in scene_pieces(**drawn).insets for text in texts(own))
    assert re.findall(r"contact (\d)", told) == ["1", "2"]


def test_contacts_of_a_picture_were_counted_otherwise_than_in_the_file() -> None:
    """A rail of scale 1.003 on its base, as both have their seeds there, had no contact; a clip at it was the first."""
    base = fo.Box((100, 20, 10), centre=(0, 0, -5), name="base").with_seed((0, 0, 0))
    rail = fo.Box((40, 20, 10), centre=(0, 0, 5), name="rail").with_seed((0, 0, 0))
    clip = fo.Box((10, 20, 10), centre=(25, 0, 5), name="clip")
    motions = {"rail": Translation("z"), "clip": Translation("x") >> Translation("z")}
    between = [("rail", "base"), ("clip", "rail"), ("clip", "base")]
    solution = fo.solve(fo.Assembly([base, rail, clip], between, motions=motions, scales={"rail": 1.003}))
    assert solution.parameters["clip"]["TX"] == pytest.approx(0.06)
    _, met = parts_of(solution)
    assert {own.number: own.text for own in met} == {1: "rail - base", 2: "clip - rail", 3: "clip - base"}
    pair = decision_curve(rail, base)  # the face lies in z = 0 at any scale
    (corners,) = pair.contact_sets((1.003, 1.0))
    np.testing.assert_allclose(np.ptp(corners, axis=0), [1.003 * 40.0, 20.0, 0.0], atol=1e-9)


def test_parts_of_an_assembly_had_no_old_places() -> None:
    """In dashes of their colours, all as many times as far off; what is fixed has none."""
    bodies, pose = [box((x, 0.0, 0.0), 4.0) for x in (0.0, 10.0)], np.eye(4)
    pose[2, 3] = 0.01
    shown = ShownBodies.of_parts(bodies, ["up", "fixed"], [pose, None])
    before, times = shown.before
    assert [*before] == [0]
    np.testing.assert_allclose(before[0].vertices - bodies[0].vertices, [[0.0, 0.0, -0.01 * times]] * 8, atol=1e-12)
    label = " ".join(" ".join(texts(scene_figure(shown))).split())
    assert f"before the motion: the same parts, drawn {times:g} times as far off" in label


@pytest.mark.parametrize("turn", [5.0, 41.0, 80.0, 131.0])
def test_an_inset_of_a_round_wall_leaned(turn: float) -> None:
    """A section along a shaft that goes down its bore: the wall stood askew, but along axes of the world."""
    normal = np.array([np.cos(np.radians(turn)), np.sin(np.radians(turn)), 0.0])
    facing, plane = section_plane(normal, np.array([0.0, 0.0, -1.0]), page_directions(18.0, -70.0))
    np.testing.assert_allclose(plane[:, 1], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(np.cross(plane[:, 0], plane[:, 1]), facing, atol=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_parts_were_seen_from_behind(axis: int) -> None:
    """A contact that is seen as well from the front is seen from there, x to the right."""
    shift = 2.0 * np.eye(3)[axis]
    view = view_of(decision_curve(box(tuple(shift), 2.0), box((0.0, 0.0, 0.0), 2.0)), (1.0, 1.0))
    page = page_directions(*view)
    assert np.cross(page[:, 0], page[:, 1])[1] < 0.0
    assert page[0, 0] > 0.0


def test_outlines_were_dark_pixels() -> None:
    """They were ragged: now they are lines, those of round faces too, and a box has but its three shades."""
    turns = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    ring = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(48)])
    (lines,) = body_figure(Body.convex(np.vstack([ring, np.add(ring, (0.0, 0.0, 3.0))]))).axes[0].collections[:1]
    sides = [own for own in lines.get_segments() if np.ptp(own[:, 1]) > 2.0]
    assert len(sides) == 2
    image = body_figure(box((0.0, 0.0, 0.0), 2.0)).axes[0].images[0].get_array()
    assert len(np.unique(image[image[..., 3] > 0], axis=0)) == 3


@pytest.mark.parametrize("apart", [2.0, 5.0])
def test_a_motion_was_seen_end_on(apart: float) -> None:
    """A contact, or a gap, across x and a motion along y: both are seen in more than half of their length."""
    curve = decision_curve(box((apart, 0.0, 0.0), 2.0), box((0.0, 0.0, 0.0), 2.0))
    page = page_directions(*view_of(curve, (1.0, 1.0), ((0.0, 1.0, 0.0),)))
    assert (np.linalg.norm(page[:2], axis=1) > 0.6).all()


def test_a_picture_in_a_page_stood_on_a_white_plate() -> None:
    """It has no ground, its words have the page's colours, and pictures beside it share no identifier."""
    one, two = (inline_svg(draw("scene", 1, "A"), name) for name in ("one", "two"))
    assert "#ffffff" not in one.lower()
    assert "var(--quiet)" in one
    ids = [set(re.findall(r' id="([^"]+)"', svg)) for svg in (one, two)]
    assert ids[0]
    assert not ids[0] & ids[1]
    assert {own[1:] for own in re.findall(r'href="(#[^"]+)"', one)} <= ids[0]


def test_the_bar_of_an_inset_lay_on_the_contact() -> None:
    shares = np.linspace(-1.0, 1.0, 401)
    for turn in np.linspace(0.0, np.pi, 25):
        way = 3.0 * np.array([np.cos(turn), np.sin(turn)])
        left, foot = free_corner(2.0, np.array([[-way, way]]))
        points, far = shares[:, None] * way, (left + 2.0 * CORNER, foot + 0.5)
        assert -2.0 < left < far[0] < 2.0
        assert not ((points >= (left, foot)) & (points <= far)).all(axis=1).any()

    across = [[[-2.0, y], [2.0, y]] for y in (-1.5, 1.5)]  # a slab on a slab: edges in all four corners
    left, foot = free_corner(2.0, np.array([[[0.0, -2.0], [0.0, 2.0]], *across]))
    assert max(left, -left - 2.0 * CORNER) > 0.0
    assert -1.5 < foot < foot + 0.5 < 1.5


def test_numbers_of_faces_stood_across_their_edges():
    """In the middle of what is seen of a face: a square of 4 x 4, of which one of 2 x 4 before it leaves 2 x 4."""
    page = np.eye(3)[:, :2]
    raster = Raster(page, np.zeros(2), np.full(2, 6.0), 300)
    square = [np.array([(x, y, z) for x, y in ((1, 1), (1 + wide, 1), (1 + wide, 5), (1, 5))], float)
              for wide, z in ((4, 0.0), (2, 1.0))]  # fmt: skip
    for owner, own in enumerate(square):
        raster.fill([own], "#0072B2", owner)
    found = raster.roomiest()
    for owner, x in ((0, 4.0), (1, 2.0)):
        place, room = found[owner]
        assert place == pytest.approx((x, 3.0), abs=2 * raster.pixel)
        assert room == pytest.approx(1.0, abs=3 * raster.pixel)


def test_pictures_of_cards_stood_on_a_white_plate_in_dark_notebooks():
    """No ground, and words and axes in a grey that is 4 : 1 against white and against a notebook's dark page."""
    figure = new_figure(2.0, 2.0)
    axes = figure.add_axes((0.2, 0.2, 0.7, 0.7))
    axes.set_title("words")
    image = np.asarray(Image.open(BytesIO(bare_pixels(figure, across=200))).convert("RGBA"))
    inked = image[image[..., 3] > 250]
    assert len(inked) > 300
    assert (image[..., 3] == 0).mean() > 0.8
    assert (inked[:, :3] == int(MIDDLE[1:3], 16)).all()
    light = [((shade / 255.0 + 0.055) / 1.055) ** 2.4 + 0.05 for shade in (255, int(MIDDLE[1:3], 16), 17)]
    assert min(light[0] / light[1], light[1] / light[2]) > 4.0


def test_pictures_for_dark_pages_stand_light_on_dark(tmp_path: Path) -> None:
    """Words are 7 : 1 against the ground, in PNG and SVG alike; pictures in an SVG are turned, too."""
    figure = new_figure(2.0, 2.0)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(np.full((2, 2, 3), 255, np.uint8), extent=(0.0, 0.5, 0.0, 1.0))
    axes.text(0.75, 0.5, "words")
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    png, svg = save(figure, tmp_path / "dark", dark=True)
    inked = np.asarray(Image.open(png).convert("L"), float)
    assert np.median(inked) == inked.min() < 25.0
    assert inked.max() > 200.0
    text = svg.read_text(encoding="utf-8")
    assert '<svg fill="#ebebeb"' in text
    assert "#ffffff" not in text
    held = re.search(r"data:image/png;base64,([A-Za-z0-9+/=]+)", text)
    assert held is not None
    assert np.asarray(Image.open(BytesIO(b64decode(held[1]))).convert("L")).max() < 25.0


def test_contacts_were_numbered_that_nothing_told() -> None:
    """The sentence names three of six, so that numbers 4 to 6 stood in the picture alone."""
    told = " ".join(texts(solution_figure(solved("locating", "A"), caption="then{sizes}")))
    assert re.findall(r"[:;]\s(\d)\u00a0(\w+) face of\s+block", told) == [
        ("1", "bottom"), ("2", "bottom"), ("3", "bottom"), ("4", "front"), ("5", "front"), ("6", "left")
    ]  # fmt: skip
    assert {"1", "2", "3", "4", "5", "6"} <= set(texts(solution_figure(solved("locating", "A"))))


def test_parts_made_were_said_to_be_shown_at_the_sizes_drawn() -> None:
    made, drawn = (solved("slot_and_key", name) for name in ("low foot, deep slot", "as drawn"))
    assert "(shown at the sizes made)" in " ".join(texts(solution_figure(made, caption="then{sizes}")))
    assert "(shown at the sizes drawn)" in " ".join(texts(solution_figure(drawn, caption="then{sizes}")))
    scales = [text for text in texts(before_after_figure(made.problem, made)) if "size of the" in text]
    assert all("(1 = as made)" in text for text in scales)


def test_the_box_of_a_problem_with_sizes_was_one_of_scales_that_nobody_gave() -> None:
    """.8 to 3: the panel goes about the parts made, twice as far to each side as the other is wide."""
    solution = solved("slot_and_key", "as drawn")
    asked = solution.problem.changed(box=DEFAULT_BOX)
    wide, near = before_after_figure(asked, solution).axes[:2]
    assert wide.get_xlim() == pytest.approx(np.array([-2.0, 2.0]) * np.ptp(near.get_xlim()) + np.mean(near.get_xlim()))


def test_motions_of_assemblies_were_told_with_steps_of_zero_and_drawn_without_arrows() -> None:
    motion = Translation("x") >> Translation("z")
    assert described(motion, [-0.03, 0.0], "") == "TX -0.03"
    assert described(motion, [0.0, 0.0], "mm") == "TX 0 mm"
    bodies = [box((x, 0.0, 0.0), 4.0) for x in (0.0, 10.0, 20.0)]
    poses = [np.eye(4), None, np.eye(4)]
    poses[0][2, 3], poses[2][0, 3] = 1e-3, 2.0
    figure = scene_figure(ShownBodies.of_parts(bodies, ["up", "fixed", "along x"], poses))
    arrows = [own for own in figure.axes[0].texts if own.arrowprops is MOVES]
    steps = np.array([np.subtract(own.xy, own.xyann) for own in arrows])
    assert len(steps) == 2
    assert np.linalg.norm(steps, axis=1) == pytest.approx([np.linalg.norm(steps[0])] * 2)  # however far they go
    assert steps[0] == pytest.approx([0.0, np.linalg.norm(steps[0])], abs=1e-9)


def test_a_cut_took_all_of_a_part_but_a_sliver() -> None:
    """A small cube on a large one near its back: cut from front to back, not across, which leaves 5 of 100."""
    large, small = box((0.0, 0.0, 0.0), 10.0), box((0.0, 4.5, 5.5), 1.0)
    corners = [(x, y, 5.0) for x, y in ((-0.5, 4.0), (0.5, 4.0), (0.5, 5.0), (-0.5, 5.0))]
    page = page_directions(32.0, -55.0)
    cut, share = Cut.through([Touching((np.array(corners),), np.eye(3)[2])], (small, large), page)
    assert cut is not None
    assert share == 1.0
    np.testing.assert_allclose(np.abs(cut.facing), [1.0, 0.0, 0.0], atol=1e-12)
    assert cut.facing @ np.cross(*page.T) > 0.0  # towards the reader


@pytest.mark.parametrize("name", ["boxes", "locating"])
def test_contacts_that_are_seen_are_not_cut_open(name: str) -> None:
    solution = solved(name, next(iter(problems(name))))
    assert not [text for text in texts(solution_figure(solution)) if text.startswith("cut open")]


def test_a_part_in_a_corner_was_seen_from_behind_the_walls() -> None:
    """Its contacts are hidden from everywhere: it is seen past the wall in front, from +x."""
    walls = ([*product(*((-3, -2) if k == axis else (-3, 3) for k in range(3)))] for axis in range(3))
    corner = Body.from_parts([*walls], seed=(-2, -2, -2))
    ball = Body.convex(trimesh.creation.icosphere(subdivisions=2, radius=2.0).vertices, seed=(0, 0, 0))
    curve = decision_curve(ball, corner)
    toward = np.cross(*page_directions(*view_of(curve, (1.0, 1.0))).T)
    assert toward[0] > 0.8, toward


def test_a_share_of_no_variance_stood_beside_a_yield_that_changes(capsys: pytest.CaptureFixture[str]) -> None:
    """A size may decide alone whether there is a motion: amounts, where there are some, do not vary with it."""
    own = SimpleNamespace(body="nut", first_order=0.0, total=0.0, share_without=0.986)
    for impossible, told in ((0.014, True), (0.0, False)):
        print_yield(SimpleNamespace(contributions=[own], impossible=impossible))
        printed = " ".join(capsys.readouterr().out.split())
        assert " size of the amount's variance alone" in printed
        assert ("which pairs have no motion, and so no amount, shows in the yields alone" in printed) == told


def test_walls_that_are_hidden_from_two_sides_had_no_number() -> None:
    """A floor between two walls: what the near walls hide is seen from the other sides."""
    tray = fo.cut(fo.Box((60, 40, 12), centre=(0, 0, 6)), fo.Box((56, 36, 12), centre=(0, 0, 8)), name="tray")
    block = fo.Box((4, 4, 4), centre=(0, 0, 4), name="block")
    figure = faces_figure(fo.Problem(block, tray, motion=fo.Translation("z"), target=(1, 1), goal="touch"))
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert [title for title in titles if title.startswith("static")] == [
        f"static: tray, from the {side}" for side in ("front, above", "back, below", "back, above", "front, below")
    ]
    assert len([title for title in titles if title.startswith("movable")]) == 2
    shown = {text.get_text() for text in figure.findobj(Text)}
    assert {f"F{k}" for k in range(1, len(tray.faces) + 1)} <= shown
    assert not [text for text in shown if "hidden" in text]
