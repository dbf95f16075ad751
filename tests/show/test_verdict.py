"""The verdict in words: what to do, what then touches, whether less would do; faces and steps in words."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from itertools import product
from pathlib import Path
from time import perf_counter
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

import fcdm_opt as fo
from fcdm_opt import pacing
from fcdm_opt.design.whatif import fitting
from fcdm_opt.design.whatif.fitting import barred_text
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.naming import element_text
from fcdm_opt.problem import fit
from fcdm_opt.show.assemblies import assembly_verdict, print_answers
from fcdm_opt.show.printing import printed
from fcdm_opt.show.remarks import remarks
from fcdm_opt.show.solved import SolvedCase
from fcdm_opt.show.tables import print_solutions, verdict_cell
from fcdm_opt.show.texts import advised, parameter_texts, telling
from fcdm_opt.show.verdict import (
    _without_clearance,
    answer_text,
    fit_text,
    labels_in_words,
    motion_text,
    refusal_text,
    sure_text,
    verdict_text,
)

PROBLEMS = Path(__file__).parents[2] / "problems"


def solved(stem: str, name: str) -> fo.Solution:
    problem = next(each for each in fo.load_problems(PROBLEMS / f"{stem}.toml") if each.name == name)
    return fo.solve(problem)


def cube(name: str, size: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> fo.Body:
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size / 2.0
    return fo.Body.convex(corners + at, name=name)


VERDICTS = {
    ("nut", "shifted against a flat"): (
        "move nut 0.25 mm along +x: then its face 10 (facing +x) lies on the left face (facing -x) of key; "
        "smallest possible (proved)"
    ),
    (
        "dovetail",
        "rail made larger",
    ): "move slide 0.08 mm along +z: then it just clears rail; smallest possible (proved)",
    ("dovetail", "room to slide"): (
        "move slide 0.25 mm along +z: then it is 0.25 mm clear of rail; smallest possible (proved)"
    ),
    ("bracket", "past the ribs"): (
        "move bracket 1.5 mm along -x and 2 mm along -z: then its bottom face (facing -z) lies on the top face "
        "(facing +z) of plate; smallest possible (proved)"
    ),
    ("boxes", "already clear"): "leave cube where it is: it is 0.5 clear of plate; nothing to do",
    ("nut", "nut made too small"): (
        "does not fit: key 20.00 mm in nut 19.89 mm, between face 2 (facing -x) and face 10 (facing +x) of nut"
    ),
    ("bracket_stuck", "shift within the ribs"): (  # (32 - 2 * 15.9) / 2 on both sides, at TX = (14 - 18) / 2
        "impossible with this motion and these limits (proved): at the nearest pose found (TX -2 mm + TZ -1.64 mm) "
        "right face of bracket, face 3 (facing -x) of ribs are 0.1 mm apart, a clearance of 0.5 mm is required; left "
        "face of bracket, face 10 (facing +x) of ribs are 0.1 mm apart, a clearance of 0.5 mm is required; in the way, "
        "bottom face of bracket, top face of plate touch"
    ),
}


@pytest.mark.parametrize(("stem", "name"), VERDICTS)
def test_verdicts_are_what_the_files_closed_forms_say(stem: str, name: str) -> None:
    assert verdict_text(solved(stem, name)) == VERDICTS[stem, name]


def test_impossible_named_no_depth_and_no_faces() -> None:
    """A cube, 2 % larger, is .01 in its table, 2 % smaller; its lift is limited; a stop keeps it 1 off a post."""

    def told(movable: fo.Body, static: fo.Body, motion: str, **more: Any) -> str:
        solution = fo.solve(fo.Problem(movable, static, motion=fo.Translation(motion), unit="mm", **more))
        assert solution.status is fo.Status.INFEASIBLE
        return verdict_text(solution).partition(": at the ")[2]

    block, table = cube("cube", 2.0, (0, 0, 1)), cube("table", 6.0, (0, 0, -3))
    made = {"requirement": "B", "tolerance": (0.02, 0.01 / 3)}
    assert told(block, table, "x", goal="seat", **made) == (
        "nearest pose found (TX 0 mm) bottom face of cube, top face of table overlap by 0.01 mm"
    )
    lifted = {"goal": "touch", "limits": {"TZ": (0.03, 0.1)}} | made
    assert told(block, table, "z", **lifted) == (
        "nearest pose found (TZ 0.03 mm, TZ at the limit) bottom face of cube, top face of table are 0.02 mm apart"
    )
    stop = fo.KeepOut(cube("stop", 0.5, (2.25, 0, 1)), name="stop")
    post = {"goal": "touch", "target": (1.0, 1.0), "limits": {"TX": (0, 4)}, "keep_out": [stop]}
    assert told(block, cube("post", 2.0, (4.0, 0, 1)), "x", **post) == (
        "nearest pose found (TX 1 mm) right face of cube, left face of post are 1 mm apart; in the way, right face of "
        "cube, left face of stop touch"
    )


def test_what_overlaps_after_the_motion_is_said() -> None:
    solution = solved("example2", "C")
    assert solution.pair_state == "overlapping"
    assert f"but the parts made overlap by {-solution.pair_gap:.4g}" in verdict_text(solution)
    assert str(solution).startswith("C: move Polyhedron 1 (reconstruction) 0.01922 along +y: then its corner 5 touches")
    assert len(str(solution).splitlines()) == 2


@pytest.mark.parametrize(
    ("motion", "q", "deeds"),
    [
        (fo.Translation("z"), [-0.25], [("move", "0.25 mm along -z")]),
        (fo.Translation((3.0, 4.0, 0.0)), [0.5], [("move", "0.5 mm along (0.6, 0.8, 0)")]),
        (fo.Rotation("-z"), [math.pi / 6], [("turn", "30 deg about -z through its seed")]),
        (fo.Rotation("z", centre="origin"), [-math.pi / 6], [("turn", "30 deg about -z through the origin")]),
        (fo.Screw("seeds", 1.0), [-0.5], [("screw", "-28.65 deg about and -0.5 mm along the line from seed to seed")]),
        (fo.Screw("seeds", math.inf), [-0.5], [("move", "0.5 mm along the line from seed to seed, backwards")]),
        (fo.Screw(((0, 0, 1), (1, 0, 0)), 0.0), [math.pi], [("turn", "180 deg about +x through (0, 0, 1)")]),
        (
            fo.Free(),
            [0, 3, 4, 0, 0, -math.pi],
            [("move", "5 mm along (0, 0.6, 0.8), turned 180 deg about -z through its seed")],
        ),
        (
            fo.Translation("x") >> fo.Rotation("y"),
            [1.0, 0.0],
            [("move", "1 mm along +x"), ("move", "0 mm along +y")],
        ),
    ],
)
def test_steps_in_words(motion: fo.Motion, q: list[float], deeds: list[tuple[str, str]]) -> None:
    assert motion.describe_steps(q, unit="mm") == deeds


def test_shifts_in_a_row_are_told_together() -> None:
    one, two = cube("one", 2.0), cube("two", 4.0, (3.5, 0.0, 0.0))
    motion = fo.Translation((0, 1, 0)) >> fo.Translation("z") >> fo.Rotation("x") >> fo.Translation("x")
    problem = fo.Problem(one, two, target=(1.0, 1.0), goal="touch", motion=motion, unit="mm")
    names = [parameter.name for parameter in motion.parameters]
    values = dict(zip(names, (3.0, 4.0, math.pi / 2, 1.0), strict=True))
    moved = replace(fo.solve(problem), parameters=values)
    told = "3 mm along +y and 4 mm along +z, then {}90 deg about +x through its seed, then {}1 mm along +x"
    assert motion_text(moved) == told.format("", "")
    assert f"move one {told.format('turn it ', 'move it ')}" in verdict_text(moved)


def test_parts_made_at_their_worst_were_told_to_be_as_drawn() -> None:
    """Of a block that may only be lower, the worst for a gap below it is the one drawn."""
    block, table = fo.Box((1, 1, 1), centre=(0, 0, 0.5)), fo.Box((4, 4, 1), centre=(0, 0, -0.5))
    height = fo.Size("height", "movable", faces=["+z", "-z"], each=0.5, tolerance=(-0.1, 0.0))
    rows = ("worst", "made worst, which is as drawn"), ("loosest", "made height -0.1"), ({}, "made as drawn")
    for made, told in rows:
        problem = fo.Problem(block, table, sizes=[height], made=made, goal="touch", motion=fo.Translation("z"))
        assert f"{told}, goal touch" in str(fo.solve(problem))


def test_what_only_rounding_made_is_shown_as_0() -> None:
    one, two = cube("one", 2.0), cube("two", 4.0, (3.5, 0.0, 0.0))
    problem = fo.Problem(one, two, target=(1.0, 1.0), goal="touch", motion=fo.Free(), unit="mm")
    values = dict.fromkeys(("TX", "TY", "TZ", "RX", "RY", "RZ"), -1.8e-15) | {"TX": 0.5}
    assert parameter_texts(problem, values) == ["0.5 mm", "0 mm", "0 mm", "0 deg", "0 deg", "0 deg"]


def test_every_face_edge_and_corner_has_words() -> None:
    body = cube("block", 2.0)
    words = {element_text(body, Element("F", face)) for face in body.faces}
    sides = [("left", "-x"), ("right", "+x"), ("front", "-y"), ("back", "+y"), ("bottom", "-z"), ("top", "+z")]
    assert words == {f"{name} face (facing {axis})" for name, axis in sides}
    assert element_text(body, Element("V", (3,))) == "corner 3"
    edge = tuple(sorted(set(body.faces[0]) & set(body.faces[2])))  # corners that two faces share
    assert element_text(body, Element("E", edge)).startswith("edge between ")


@pytest.mark.parametrize("off", [0.0, 0.5, -0.5])
def test_gaps_over_the_whole_tolerance(off: float) -> None:
    """Two cubes of 2 and 4, 1 % each: the gap goes from off - .03 to off + .03."""
    one, two = cube("one", 2.0), cube("two", 4.0, (3.0 + off, 0.0, 0.0))
    problem = fo.Problem(one, two, tolerance=0.01, requirement="A", goal="clear", motion=fo.Translation("x"), unit="mm")
    words = {True: "apart", False: "overlapping"}
    ends = [f"{abs(off + s * 0.03):.4g} mm {words[off + s * 0.03 > 0]}" for s in (-1.0, 1.0)]
    assert fit_text(problem) == f"unmoved, over the whole tolerance: from {ends[0]} to {ends[1]}"
    cases = [
        SolvedCase(fo.solve(problem.changed(name=name, tolerance=own))) for name, own in (("one", 0.01), ("two", 0))
    ]
    told = " ".join(printed(print_solutions, cases).split())  # it was not told of which case
    assert f"one: {fit_text(problem)}" in told
    assert f"two: unmoved, over the whole tolerance: from {abs(off):.4g} mm" in told


@pytest.mark.sampled(1)
@pytest.mark.parametrize(("radius", "kind"), [(9.9, "transition"), (9.6, "clearance"), (10.4, "interference")])
def test_a_fit_was_called_after_an_overlap_at_the_shoulder(radius: float, kind: str) -> None:
    """A hub of bore 20 on a shaft's shoulder, 1 % each: diameters differ by 20 (1 -+ .01) - 2 r (1 +- .01)."""
    hub = fo.cut(fo.Cylinder(20, 25), fo.Cylinder(10, 30, base=(0, 0, -1)), name="hub")
    shaft = fo.joined(fo.Cylinder(15, 10, base=(0, 0, -10)), fo.Cylinder(radius, 40, base=(0, 0, -10)), name="shaft")
    motion = fo.Translation("z")
    problem = fo.Problem(hub, shaft, tolerance=0.01, requirement="B", goal="clear", motion=motion, unit="mm")
    play = [20.0 * (1.0 + s * 0.01) - 2.0 * radius * (1.0 - s * 0.01) for s in (-1.0, 1.0)]
    ends = " to ".join(f"{abs(own):.4g} mm {'clearance' if own > 0.0 else 'interference'}" for own in play)
    gaps, fit = fit_text(problem).split("; ")
    assert "fit" not in gaps
    assert fit == f"cylinder of radius {radius:g} in bore of radius 10: {kind} fit, from {ends} in diameter"


def test_results_say_what_they_are_on_one_line() -> None:
    solution = solved("boxes", "close the gap")
    body = repr(solution.problem.movable)
    assert body == "Body('cube': 8 corners, 6 faces, convex parts: 1, seed (0, 0, 0), extent 1 x 1 x 1)"
    told = repr(solution.problem)
    assert told.startswith("Problem('close the gap': 'cube' against 'plate', goal 'touch', explicit target")
    assert repr(solution).startswith("Solution('close the gap': SOLVED, TX 0.5, amount 0.5, proved at least 0.5")
    assert "\n" not in body + told + repr(solution)


def test_arguments_of_a_wrong_kind_are_bad_input() -> None:
    problem = fo.load_problems(PROBLEMS / "boxes.toml")[0]
    wrong = [
        lambda: fo.load_problems(3),
        lambda: fo.verify(problem),
        lambda: fo.coherent_range(3),
        lambda: fo.stack_up("problem"),
        lambda: fo.run_study(3, "out"),
        lambda: fo.Body.from_file(3, unit="mm"),
        lambda: fo.Body.from_file("part.stl", unit=["mm"]),
        lambda: fo.Body.convex(problem.movable.vertices, name=3),
        lambda: fo.Body.from_mesh(problem.movable.vertices),
        lambda: problem.changed(sizes=3),
    ]
    for call in wrong:
        with pytest.raises(fo.InputError):
            call()


def test_a_whole_mesh_is_taken() -> None:
    import trimesh

    body = fo.Body.from_mesh(trimesh.creation.box((1.0, 2.0, 3.0)), name="block")
    assert (body.name, len(body.faces)) == ("block", 6)
    assert np.ptp(body.vertices, axis=0).tolist() == [1.0, 2.0, 3.0]


def test_walls_that_leave_too_little_room_are_named() -> None:
    """Blocks on both sides of a cube of 2, of 1 % tolerance each: 2.02 in 1.98 at requirement B."""
    boxes = [cube("", 2.0, (x, 0.0, 0.0)).vertices for x in (-2.0, 2.0)]
    slot = fo.Body.from_parts(boxes, seed=np.zeros(3), name="slot")
    motion = fo.Translation("x")
    problem = fo.Problem(
        cube("key", 2.0), slot, tolerance=0.01, requirement="B", goal="clear", motion=motion, unit="mm"
    )
    told = verdict_text(fo.solve(problem))
    assert told.startswith("does not fit: key 2.020 mm in slot 1.980 mm, between face ")
    assert "(facing +x) and face " in told
    assert "(facing -x)" in told


def test_parts_in_different_frames_are_warned_of() -> None:
    """Between boxes of 2 and 4 there are 170 - 3 = 167: more than twice the size of the larger, 4 sqrt(3)."""
    from fcdm_opt.show.remarks import remarks

    one, two = cube("one", 2.0), cube("two", 4.0, (170.0, 0.0, 0.0))
    far = fo.Problem(one, two, target=(1.0, 1.0), goal="clear", motion=fo.Translation("x"), unit="mm")
    assert "as drawn the parts are 167 mm apart: are both drawn in one frame?" in remarks(fo.solve(far))


def test_labels_in_a_text_are_names_of_faces() -> None:
    """The key of a map and the table of a pose had F1F2(P1V1,...), of a keep-out's corners too."""
    cube = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    one, two, post = (
        fo.Body.convex(cube + shift, name=name) for name, shift in (("lid", 0.0), ("box", 4.0), ("post", 9.0))
    )
    asked = fo.Problem(one, two, target=(1, 1), goal="touch", motion=fo.Translation("x"), keep_out=[fo.KeepOut(post)])
    faces = "V1F2(P1V8; P2V1,V2,V3,V4)"
    assert labels_in_words(f"{faces}; closes a gap", asked) == "corner 8 of lid, left face of box; closes a gap"
    assert labels_in_words(f"keep-out 'post' {faces}", asked) == "corner 8 of lid, left face of post"


@pytest.mark.parametrize("goal", ["touch", "clear"])
def test_a_press_fit_of_cylinders_was_told_by_the_widths_of_facets_and_took_three_searches(goal: Any) -> None:
    """A pin of 8.002 in a bore of 7.984: the bore is the plate's, and no mesh leaves open whether they fit."""
    bore = fo.Cylinder(3.992, 12.0, base=(0, 0, -1), facets=16)
    plate = fo.cut(fo.Box((16, 16, 10), centre=(0, 0, 5)), bore, name="plate")
    pin = fo.Cylinder(4.001, 12.0, base=(0, 0, -1), facets=16, name="pin")
    solution = fo.solve(fo.Problem(pin, plate, motion=fo.Translation("x"), target=(1, 1), goal=goal, unit="mm"))
    words = "does not fit: pin 8.002 mm in plate 7.984 mm, across the bore of radius 3.992 of plate"
    assert verdict_text(solution) == words
    assert (solution.usable, solution.amount_low, solution.problem.exact_at) == (False, math.inf, None)


def test_a_keep_out_that_leaves_no_room_for_a_clearance_is_named_of_assemblies_too() -> None:
    """A peg against one wall, with 0.1 to the keep-out, is to have 0.15: no motion leaves that, it said."""
    hole = fo.Box((10.4, 12, 8), centre=(0, 0, 3))
    plate = fo.cut(fo.Box((30, 30, 6), centre=(0, 0, 3)), hole, name="plate")
    peg = fo.Box((10, 10, 10), centre=(-0.2, 0, 5), name="peg")
    stops = [fo.KeepOut(fo.Box((4, 4, 4), centre=(6.9, y, 8), name=name)) for y, name in ((0, "stop"), (40, "far"))]
    given: Any = {"goal": "clear", "clearance": 0.15}
    asked = fo.Problem(peg, plate, target=(1, 1), motion=fo.Translation("x"), keep_out=stops, unit="mm", **given)
    words = "in the way: keep-out stop, without which there is a motion"
    told = verdict_text(fo.solve(asked))
    assert told.startswith("fits, clearance not met: no such motion leaves 0.15 mm in the place it is drawn in; ")
    assert told.endswith(words)
    joined = {"parts": ("peg", "plate"), **given}
    both = fo.Assembly([plate, peg], [joined], motions={"peg": fo.Translation("x")}, keep_out=stops)
    either = words.replace("stop,", "stop or contact peg - plate (clear by 0.15),")
    assert str(fo.solve(both)).endswith(either)
    tight = fo.solve(both.changed(limits={"peg": {"TX": (-1, 1)}}))
    assert str(tight).endswith(f"choose another motion. I{either[1:]}.")
    free = fo.solve(both.changed(keep_out=stops[1:]))
    assert str(free).startswith("move peg 0.15 along +x: then every contact is kept apart as asked; ")


def test_a_clearance_of_an_assembly_that_cannot_be_kept_was_not_named() -> None:
    """A block on its base, 0.5 below a camera, is 0.4 higher: 0.1 of the 0.3 asked for is there."""
    boxes = {"base": ((20, 20, 2), -1), "block": ((10, 10, 10), 5), "camera": ((6, 6, 4), 12.5)}
    parts = [fo.Box(edges, centre=(0, 0, z), name=name) for name, (edges, z) in boxes.items()]
    contacts = [("block", "base"), {"parts": ("block", "camera"), "goal": "clear", "clearance": 0.3}]
    taller = {"sizes": [fo.Size("height", "block", faces=["+z"], tolerance=0.5)], "made": {"height": 0.4}}
    both = fo.Assembly(parts, contacts, motions={"block": fo.Translation("z")}, unit="mm", **taller)
    told = "In the way: contact block - camera (clear by 0.3 mm), without which there is a motion; at most "
    assert str(fo.solve(both)).endswith(told + "0.1 mm can be kept.")
    (cure,) = (one for one in fo.conflicts(both).relaxations if one.cures)
    assert (cure.name, cure.value) == ("contact block - camera", pytest.approx(0.1, rel=1e-6))


def test_the_clearance_that_can_be_kept_is_told_to_its_last_digit() -> None:
    """A plate 29.86 above another is to be 29.9 away: 29.8 was told, and 0.0399999 as what lacks."""
    boxes = {"base": ((20, 20, 2), -1), "block": ((10, 10, 10), 5), "roof": ((20, 20, 4), 41.86)}
    parts = [fo.Box(edges, centre=(0, 0, z), name=name) for name, (edges, z) in boxes.items()]
    contacts = [("block", "base"), {"parts": ("block", "roof"), "goal": "clear", "clearance": 29.9}]
    both = fo.Assembly(parts, contacts, motions={"block": fo.Translation("z")}, unit="mm")
    assert str(fo.solve(both)).endswith("; at most 29.86 mm can be kept.")
    (cure,) = (one for one in fo.conflicts(both).relaxations if one.cures)
    assert str(cure).startswith("contact block - roof: by 0.04 mm to 29.86 mm, amount ")


def _slide_below_a_roof() -> fo.Problem:
    """A slide 10 high in a slot 10.08 high, on its floor, 5 aside of either wall and 0.1 clear as asked."""
    rail = fo.cut(fo.Box((60, 30, 20), centre=(0, 0, 0), name="rail"), fo.Box((80, 20, 10.08), centre=(0, 0, 0.04)))
    slide = fo.Box((40, 10, 10), centre=(0, 0, 0), name="slide")
    asked: Any = {"motion": fo.Translation("y"), "target": (1, 1), "goal": "clear", "clearance": 0.1, "unit": "mm"}
    return fo.Problem(slide, rail, **asked)


def test_the_shift_that_opens_a_closed_contact_is_asked_about_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """A shift along x, which opens nothing, took 40 of 51 s; up, half of the play of .08 is left."""
    asked, solve = list[fo.Problem](), fitting.solve

    def counted(problem: fo.Problem, **how: Any) -> Any:
        asked.append(problem)
        return solve(problem, **how)

    monkeypatch.setattr(fitting, "solve", counted)
    told = advised(SolvedCase(fo.solve(_slide_below_a_roof())))
    up = "Allow a shift along +z, which opens the contact that stays closed, and choose a smaller clearance"
    assert told in (f"{up}, at most 0.04 mm.", f"{up}, such as 0.04 mm.")
    first = next(own for own in asked if len(own.motion.parameters) > 1)
    assert (first.motion.names, first.clearance) == (("TY", "TZ"), pytest.approx(0.04, rel=1e-9))


def test_advice_ends_in_time_and_proposes_nothing_that_was_not_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    def endless(*_: Any, **__: Any) -> Any:
        while True:
            pacing.check()

    solution = fo.solve(_slide_below_a_roof().changed(clearance=0.11))  # what was worked out above is kept
    monkeypatch.setattr(fitting, "solve", endless)
    monkeypatch.setattr(pacing, "ADVISED", (0.3, 0.3))
    start = perf_counter()
    told = f"{verdict_text(solution)} {advised(SolvedCase(solution))}"
    assert told.endswith("; there was no time to try which of these would do.")
    assert "Allow" not in told
    assert perf_counter() - start < 10.0


def test_a_key_that_is_turned_in_its_socket_was_told_not_to_fit_by_its_corners() -> None:
    """10 square, 3 degrees off, is 10 (cos + sin) = 10.51 across its socket of 10.2, and lies in the floor."""
    socket = fo.cut(fo.Box((20, 20, 10), centre=(0, 0, 0)), fo.Box((10.2, 10.2, 10), centre=(0, 0, 5)), name="socket")
    turned, angle = np.eye(4), math.radians(3)
    turned[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    key = fo.Box((10, 10, 20), centre=(0, 0, 9.5), name="key").moved(turned)
    asked = fo.Problem(key, socket, target=(1, 1), goal="clear", motion=fo.Rotation("z"), length=10, unit="mm")
    assert "overlap by 0.5 mm" in verdict_text(fo.solve(asked))
    slid = verdict_text(fo.solve(asked.changed(motion=fo.Translation("x"), length=None)))
    assert slid.startswith("does not fit: key 10.51 mm in socket 10.20 mm, ")


def test_a_pin_that_is_tilted_was_told_not_to_fit_by_what_it_is_across_its_bore() -> None:
    """10 in 10.1, 1 degree off: a turn brings it in line; a shift does not, and then what it is across is told."""
    plate = fo.cut(fo.Box((30, 30, 20), centre=(0, 0, 10)), fo.Cylinder(5.05, 22, base=(0, 0, -1)), name="plate")
    turned, angle = np.eye(4), math.radians(1)
    turned[np.ix_((0, 2), (0, 2))] = [[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]]
    pin = fo.Cylinder(5.0, 30, base=(0, 0, -5), name="pin").moved(turned)
    asked = fo.Problem(pin, plate, target=(1, 1), goal="clear", motion=fo.Translation("x"), unit="mm")
    assert verdict_text(fo.solve(asked)).startswith("does not fit: pin ")
    free = asked.changed(motion=fo.Translation("x") >> fo.Rotation("y", centre="seed"), length=10)
    assert not fit.verdict(free)


def test_a_keep_out_was_said_to_overlap_without_the_part_that_does() -> None:
    """Two blocks of 4 on each other, the lower made 0.2 taller: 0.05 of the upper one is then in the stop at 8.15."""
    boxes = [fo.Box((9, 9, 2), centre=(0, 0, -1), name="base")]
    boxes += [fo.Box((4, 4, 4), centre=(0, 0, 4 * k + 2), name=name) for k, name in enumerate(("lower", "upper"))]
    stop = fo.KeepOut(fo.Box((9, 9, 2), centre=(0, 0, 9.15), name="stop"))
    height = fo.Size("height", "lower", faces="+z", tolerance=0.3)
    motions = dict.fromkeys(("lower", "upper"), fo.Translation("z"))
    pairs = [("lower", "base"), ("upper", "lower")]
    asked = fo.Assembly(boxes, pairs, [height], motions, made={"height": 0.2}, keep_out=[stop], unit="mm")
    solution = fo.solve(asked)
    assert "upper and keep-out 'stop' overlap by 0.05 mm" in str(solution)
    met = fo.solve(asked.changed(keep_out=[], name="taller"))
    told = printed(print_answers, [SolvedCase(met)])
    assert "asked amount" not in " ".join(told.split())  # which the table has
    assert told.startswith(
        "taller: move upper 0.2 mm along +z relative to lower, which carries it: then every contact is"
    )


def test_a_pin_and_its_bore_were_told_by_radii_that_do_not_give_their_play() -> None:
    """3.994 in 4.008 is no .0145."""
    bore = fo.Cylinder(4.008, 12.0, base=(0, 0, -1), facets=16)
    plate = fo.cut(fo.Box((16, 16, 10), centre=(0, 0, 5)), bore, name="plate")
    pin = fo.Cylinder(3.9935, 12.0, base=(0, 0, -1), facets=16, name="pin")
    solution = fo.solve(fo.Problem(pin, plate, motion=fo.Translation("x"), target=(1, 1), goal="touch", unit="mm"))
    assert verdict_text(solution).startswith("move pin 0.0145 mm along ")
    assert "its cylinder of radius 3.9935 touches the bore of radius 4.008 of plate" in verdict_text(solution)
    four, all_of_them = (fo.Size("d", "movable", faces=f"cylinder radius {r}") for r in ("3.994", "3.9935"))
    assert (four.offsets(pin) == all_of_them.offsets(pin)).all()  # a file may have fewer


def test_a_shift_of_3e_13_mm_stood_beside_one_of_25_micrometres() -> None:
    """Parameters below the last digit told of the others are none in words; data have them."""
    problem = fo.Problem(cube("key", 2.0), cube("wall", 2.0), target=(1, 1), goal="touch", unit="mm",
                         motion=fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z"))  # fmt: skip
    assert telling(problem, [-3.393e-07, -3.049e-13, 0.02528]) == [0.0, 0.0, 0.02528]
    assert telling(problem, [2e-6, 0.0, 0.02528]) == [2e-6, 0.0, 0.02528]


def test_advice_began_in_the_midst_of_a_name_with_a_number() -> None:
    advice = (
        "Does not fit: lid 93.3 mm in base 89.7 mm, across the cylinder of radius 4 no. 3 of base. Choose other sizes."
    )
    case: Any = SimpleNamespace(solution=SimpleNamespace(advice=advice, left_by_mesh=""), fits_up_to=None)
    assert advised(case) == "Choose other sizes."


@pytest.mark.slow
def test_a_clearance_that_a_closed_contact_leaves_no_room_for_was_told_as_no_fit() -> None:
    """The slide has 0.05 to either wall, and lies on the floor whatever is done along y."""
    rail = fo.cut(fo.Box((60, 30, 20), centre=(0, 0, 10), name="rail"), fo.Box((80, 10.1, 20), centre=(0, 0, 15)))
    slide = fo.Box((40, 10, 25), centre=(0, 0, 17.5), name="slide")
    problem = fo.Problem(slide, rail, motion=fo.Translation("y"), target=(1, 1), goal="clear", clearance=0.02)
    solution = fo.solve(problem)
    told = str(solution)
    assert told.startswith(
        "fits, clearance not met: no such motion leaves 0.02 in the place it is drawn in; without one, its bottom"
    )
    assert told.count("clearance not met") == 2  # verdict and row: "outside the fit" contradicts "fits"
    assert refusal_text(solution) == "clearance not met: parts as made, not moved"
    assert (verdict_cell(solution), barred_text(solution)) == ("clearance\nnot met", "clearance not met")
    assert "no: clearance not met" in solution._repr_html_()
    up = "Allow a shift along +z, which opens the contact that stays closed"  # 0.05 to either wall stays
    assert advised(SolvedCase(solution)) == f"{up}."
    wide = fo.solve(problem.changed(clearance=0.08))
    assert advised(SolvedCase(wide)) == f"{up}, and choose a smaller clearance, at most 0.05."
    lifted = fo.solve(problem.changed(clearance=0.08, motion=problem.motion >> fo.Translation("z")))
    assert advised(SolvedCase(lifted)) == "Choose a smaller clearance, at most 0.05."
    between = {"parts": ("slide", "rail"), "goal": "clear", "clearance": 0.02}
    both = fo.solve(fo.Assembly([slide, rail], [between], motions={"slide": fo.Translation("y")}))
    assert assembly_verdict(both).startswith("fits, clearance not met: no such motions leave it")
    assert (verdict_cell(both), barred_text(both)) == ("clearance\nnot met", "clearance not met")


def test_what_lies_on_what_without_a_clearance_was_looked_up_among_the_faces_of_other_bodies(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Bodies that are cut anew for the question without a clearance have faces of other numbers."""
    pin = fo.Box((2, 2, 8), centre=(0, 0, -4), name="pin")
    rail = fo.cut(fo.Box((60, 30, 20), centre=(0, 0, 10)), fo.Box((80, 10, 20), centre=(0, 0, 15)), name="rail")
    pins = [fo.Box((2, 2, 8), centre=(x, 0, 32)) for x in (-9, 0, 9)]
    slide = fo.joined(fo.Box((40, 10, 25), centre=(0, 0, 17.5)), *pins)
    bare = fo.solve(fo.Problem(slide, rail, motion=fo.Translation("y"), target=(1, 1), goal="clear"))
    asked = fo.Problem(pin, rail, motion=fo.Translation("y"), target=(1, 1), goal="clear", clearance=0.02)
    monkeypatch.setattr(fitting, "without_clearance", lambda _: bare)
    told = _without_clearance(asked, "")
    assert told.endswith("and its bottom face (facing -z) lies on face 8 (facing +z) of rail")


def test_a_face_in_single_precision_was_told_as_one_of_its_edges(tmp_path: Path) -> None:
    """A hexagonal peg pushed against the wall of its hole, parallel but for the digits of the file."""
    plate = Manifold.cube([60, 60, 20], True) - Manifold.cylinder(40, 10, 10, 6).translate([0, 0, -20])
    bodies = []
    for name, solid in (("peg", Manifold.cylinder(30, 9.8, 9.8, 6)), ("plate", plate)):
        mesh = solid.to_mesh()
        points, rows = np.asarray(mesh.vert_properties, np.float32)[:, :3], np.asarray(mesh.tri_verts)
        trimesh.Trimesh(points, rows, process=False).export(tmp_path / f"{name}.stl")
        bodies.append(fo.Body.from_file(tmp_path / f"{name}.stl", unit="mm"))
    along = fo.Translation((-np.cos(np.pi / 6), -0.5, 0.0))
    asked = {"tolerance": 0.02, "requirement": "A", "goal": "touch", "motion": along}
    words = verdict_text(fo.solve(fo.Problem(*bodies, **asked), effort="quick"))
    sides = r"then its face \d+ \(facing ([+-])x and \1y\) lies on face \d+ \(facing ([+-])x and \2y\) of plate;"
    told = re.search(sides, words)  # either way is as long
    assert told is not None
    assert {*told.groups()} == {"+", "-"}


def test_a_face_that_lies_along_a_bar_was_told_as_two_of_its_edges() -> None:
    bar = fo.Cylinder(7.0, 30.0, base=(0, 0, -15), name="bar", unit="mm")
    finger = fo.Box((90, 6, 12), centre=(-15, 19, 0), name="finger", unit="mm")
    for one, two, words in (
        (finger, bar, "then its front face (facing -y) touches the cylinder of radius 7 of bar;"),
        (bar, finger, "then its cylinder of radius 7 touches the front face (facing -y) of finger;"),
    ):
        motion = fo.Rotation("z", (-60, 20, 0))
        assert words in verdict_text(fo.solve(fo.Problem(one, two, target=(1, 1), goal="touch", motion=motion)))


def test_what_a_file_s_digits_leave_open_was_told_as_a_motion() -> None:
    """A jaw in single precision, 3.6e-8 off its rod by rounding, was to be moved by that."""
    asked = {"target": (1, 1), "goal": "touch", "motion": fo.Translation("z")}
    wall = cube("wall", 2.0, (0.0, 0.0, -3.0))
    jaws = cube("jaw", 2.0), replace(cube("jaw", 2.0), rounding=1e-7)
    exact, single = (fo.solve(fo.Problem(jaw, wall, **asked)) for jaw in jaws)
    assert telling(exact.problem, [3.6e-8]) == [3.6e-8]
    assert telling(single.problem, [3.6e-8]) == [0.0]
    moved = replace(single, parameters={"TZ": 3.6e-8}, amount=3.6e-8)
    assert verdict_text(moved).startswith("leave jaw where it is")
    assert verdict_text(moved).endswith("nothing to do")
    assert "amount 0, proved at least 0; " in answer_text(moved)  # "amount 3.6e-08" stood beside it
    assert "amount 3.6e-08" in answer_text(replace(exact, parameters={"TZ": 3.6e-8}, amount=3.6e-8))


def test_the_clearance_asked_for_stood_in_no_table() -> None:
    asked = {"target": (1, 1), "motion": fo.Translation("x"), "goal": "clear", "clearance": 1.25, "unit": "mm"}
    problem = fo.Problem(cube("key", 2.0), cube("wall", 2.0, (3.0, 0.0, 0.0)), **asked)
    assert "goal clear by 1.25 mm: TX -0.25 mm" in str(fo.solve(problem))


@pytest.mark.parametrize("facets", [32, pytest.param(128, marks=pytest.mark.slow)])
def test_what_blocks_a_round_pin_is_told_of_its_true_face(facets: int) -> None:
    """Its facets told TY -.075, and .004, where .05 off by the limit of .02 leaves .03 - .01 of overlap at TY -.02."""
    pin = fo.Cylinder(4, 20, base=(0.05, 0.02, 0), name="pin", unit="mm", facets=facets)
    bore = fo.Cylinder(4.01, 30, base=(0, 0, -5), facets=facets)
    plate = fo.cut(fo.Box((20, 20, 10), centre=(0, 0, 10), name="plate", unit="mm"), bore)
    motion, limits = fo.Translation("x") >> fo.Translation("y"), {"TX": (-0.02, 0.02), "TY": (-1, 1)}
    for goal in ("clear", "touch"):
        asked = fo.Problem(pin, plate, target=(1, 1), goal=goal, motion=motion, limits=limits)
        told = str(fo.solve(asked))
        assert "TX -0.02 mm + TY -0.02 mm, TX at the limit" in told
        assert "overlap by 0.02 mm" in told


@pytest.mark.parametrize(("letter", "sides"), [("A", (1, 1)), ("D", (-1, -1))])
def test_beyond_was_said_to_hold_for_all_sizes_up_to_those_asked(letter: str, sides: tuple[int, int]) -> None:
    """Both features touch at one pair of scales, which is the target's or beyond it."""
    problem = next(own for own in fo.load_problems(PROBLEMS / "example1.toml") if own.name == letter)
    text = str(fo.solve(problem, effort="quick")).replace("\n", " ")
    found = re.search(r"at scales ([\d.]+) and ([\d.]+), those asked or beyond", text)
    assert found is not None, text
    assert (sides * (np.array(found.groups(), float) - problem.target) >= -1e-5).all()


def test_the_nearest_pose_of_a_block_that_turns_is_not_that_on_its_face() -> None:
    """As it turns by a on its edge it gains sin a - (1 - cos a): it was told as far off as it is at rest."""
    crate = fo.Body.convex([*product((-1, 1), (-1, 1), (0, 2))])
    floor = fo.Body.convex([*product((-5, 5), (-5, 5), (-1, 0))])
    asked = {"goal": "touch", "motion": fo.Rotation("x")}
    limited = fo.solve(fo.Problem(crate, floor, target=(0.9, 1), limits={"RX": (-0.1, 0.1)}, **asked))
    assert f"{1 - 0.9 * (math.cos(0.1) + math.sin(0.1)):.4g} apart" in limited.reason
    free = fo.solve(fo.Problem(crate, floor, target=(0.6, 1), **asked))
    assert f"{1 - 0.6 * math.sqrt(2):.4g} apart" in free.reason


@pytest.mark.parametrize(
    ("motion", "slides"),
    [
        (fo.Rotation("z"), True),
        (fo.Rotation("-z", centre=(3, 0, 0)), True),
        (fo.Translation("x") >> fo.Rotation("z"), True),
        (fo.Translation("x"), True),
        (fo.Rotation("x"), False),
        (fo.Translation("z") >> fo.Rotation("z"), False),
        (fo.Rotation((0, 1, 1)), False),
    ],
)
def test_a_turn_on_a_floor_was_not_said_to_slide(motion: fo.Motion, slides: bool) -> None:
    """About the floor's normal a block only slides on it, as it does along it."""
    block, floor = fo.Box((10, 8, 6), centre=(0, 0, 3)), fo.Box((40, 40, 4), centre=(0, 0, -2))
    told = sure_text(fo.solve(fo.Problem(block, floor, motion=motion, goal="touch", target=(1, 1))))
    assert told.startswith("nothing to do")
    assert ("range and pose tell the play there" in told) == slides


def test_of_a_motion_that_is_refused_the_gap_to_a_keep_out_was_told() -> None:
    """A block .1 into the end of its channel, .06 before a post: .04 lack there, and past the end it is 3.96 clear."""
    block, end = fo.Box((2, 2, 2), name="block"), fo.Box((2, 6, 2), centre=(1.9, 0, 0))
    bars = [fo.Box((5, 1.95, 2), centre=(-1.6, y, 0)) for y in (2.025, -2.025)]
    post = fo.Box((2, 2, 2), centre=(-2.06, 0, 0), name="post")
    given: Any = {"motion": fo.Translation("x") >> fo.Translation("y"), "target": (1, 1), "goal": "clear"}
    solution = fo.solve(fo.Problem(block, fo.joined(end, *bars, name="channel"), keep_out=[post], **given))
    assert solution.status is fo.Status.OUTSIDE_FIT
    assert not [told for told in remarks(solution) if "post" in told]
    told = verdict_text(solution)
    assert "at the nearest pose found (TX -0.06" in told
    assert "overlap by 0.04; in the way, left face of block, right face of post touch; " in told
    assert told.endswith("in the way: keep-out post, without which there is a motion")
