"""Sizes of faces, axes and features: parts as made, and the sizes at which two of them touch."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import fcdm_opt as fo
from fcdm_opt.curve.touching_sizes import TouchingSizes, least_of
from fcdm_opt.drafting.draft import widths
from fcdm_opt.geometry import elements
from fcdm_opt.geometry.facet_errors import deviation_of, round_surfaces
from fcdm_opt.geometry.naming import names_of_rows
from fcdm_opt.geometry.resizing import Resizing, fit_for_sizes, resized
from fcdm_opt.show.stacks import stack_notes
from fcdm_opt_benchmarks.references import sizes as exact

PROBLEMS = Path(__file__).parents[2] / "problems"
X = fo.Translation("x")


def box(low: Any, high: Any, name: str = "body") -> fo.Body:
    """An aligned box."""
    return fo.Body.convex(list(product(*zip(low, high, strict=True))), name=name)


def volume(body: fo.Body) -> float:
    """The volume of a union of parts, by a mesh library."""
    return float(trimesh.boolean.union([trimesh.convex.convex_hull(part.vertices) for part in body.parts]).volume)


def slot() -> fo.Body:
    """The block with a slot of the shipped problem."""
    return fo.load_problems(PROBLEMS / "slot_and_key.toml")[0].request["static"]


# ------------------------------------------------------------------------------------------------------- parts as made


def test_a_width_between_two_faces_moves_each_by_half() -> None:
    made = resized(box((0, 0, 0), (4, 2, 1)), {fo.Size("w", "movable", faces=["+x", "-x"], each=0.5): 0.25})
    assert made.vertices[:, 0].min() == -0.125
    assert made.vertices[:, 0].max() == 4.125
    assert np.ptp(made.vertices[:, 1:], axis=0).tolist() == [2.0, 1.0]


def test_the_name_of_a_cylinder_means_all_of_its_facets() -> None:
    angles = 2.0 * np.pi * np.arange(12) / 12
    ring = np.column_stack([5.0 * np.cos(angles), 5.0 * np.sin(angles)])
    pin = fo.Body.convex(np.vstack([np.column_stack([ring, np.full(12, z)]) for z in (0.0, 3.0)]))
    around = {"around": (0, 0, 1), "axis": "z", "radius": 5.0}
    by_name, by_axis = (fo.Size("d", "movable", faces=faces, each=0.5) for faces in ("cylinder radius 5", around))
    assert np.array_equal(by_name.offsets(pin), by_axis.offsets(pin))
    assert int((by_name.offsets(pin) == 0.5).sum()) == 12
    assert fo.Size("h", "movable", faces="top").offsets(pin).sum() == 1.0
    made = resized(pin, {by_name: 0.2})
    apothem = 5.0 * math.cos(math.pi / 12)  # a facet moves out by 0.1, so all of the outline grows by one factor
    assert np.linalg.norm(made.vertices[:, :2], axis=1) == pytest.approx(5.0 * (apothem + 0.1) / apothem)


def test_a_scale_through_every_axis_is_the_uniform_one_and_that_of_the_body() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        body = fo.Body.convex(rng.normal(size=(9, 3)), seed=rng.normal(size=3))
        p = rng.uniform(-0.2, 0.2)
        each = {fo.Size(axis, "movable", scale=axis): p for axis in "xyz"}
        whole = resized(body, {fo.Size("all", "movable", scale="xyz"): p}).vertices
        assert np.array_equal(resized(body, each).vertices, whole)
        assert np.abs(body.scaled(1.0 + p).vertices - whole).max() <= 4 * np.spacing(np.abs(whole).max())


def test_thousands_of_random_axes_stretch_as_rationals_do() -> None:
    from fractions import Fraction

    rng = np.random.default_rng(4)
    body = box((-1, -2, -3), (1, 2, 3))
    worst = 0.0
    for _ in range(2000):
        axis, p = rng.normal(size=3), rng.uniform(-0.1, 0.1)
        size = fo.Size("s", "movable", scale=axis)
        u = list(map(Fraction, axis.tolist()))
        square = sum(x * x for x in u)
        point = list(map(Fraction, body.vertices[0].tolist()))
        along = sum(x * y for x, y in zip(u, point, strict=True)) / square  # the seed is the origin
        true = [float(x + Fraction(p) * along * y) for x, y in zip(point, u, strict=True)]
        worst = max(worst, float(np.abs(body.vertices[0] + p * size.directions() @ body.vertices[0] - true).max()))
    assert worst <= 4 * np.spacing(4.0)


def test_faces_offset_by_their_share_of_the_scale_are_the_scaled_body() -> None:
    rng = np.random.default_rng(5)
    for _ in range(30):
        body = fo.Body.convex(rng.normal(size=(10, 3)))
        normals, points = body.face_planes
        heights = ((points - body.seed) * normals).sum(axis=1)
        faces = [f"F{k + 1}" for k in range(len(normals))]
        made = resized(body, {fo.Size("s", "movable", faces=faces, each=heights): 0.05})
        corners = [label - 1 for label in body.corners]
        assert np.abs((made.vertices - body.scaled(1.05).vertices)[corners]).max() < 1e-13
        assert made.faces == body.faces


def test_a_slot_gets_wider_and_deeper_with_its_cuts() -> None:
    body = slot()  # 30 x 20 x 30 less 10.125 x 8 x 30
    walls = [{"through": (-5.0625, 16, 15)}, {"through": (5.0625, 16, 15)}]
    made = resized(
        body,
        {
            fo.Size("w", "static", faces=walls, each=-0.5): 0.5,
            fo.Size("u", "static", faces=walls, along="x"): 0.25,
            fo.Size("d", "static", faces={"through": (0, 12, 15)}, each=-1.0): 1.0,
            fo.Size("h", "static", faces=["F5", "F9"], each=1.0): 2.0,
        },
    )
    assert volume(made) == pytest.approx(30 * 22 * 30 - 10.625 * 11 * 30, rel=1e-12)
    assert made.faces == body.faces  # labels are kept
    left = made.vertices[[label - 1 for label in made.faces[7]]]
    assert left[:, 0].tolist() == [-5.0625 - 0.25 + 0.25] * 4


def test_the_tolerance_that_init_writes_for_all_cases_kept_sizes_from_being_asked_about(tmp_path: Path) -> None:
    cube, table = (str([list(map(float, p)) for p in product((-1, 1), (-1, 1), z)]) for z in ((0, 2), (-2, 0)))
    path = tmp_path / "p.toml"
    path.write_text(
        f"[bodies.movable]\nvertices = {cube}\n[bodies.static]\nvertices = {table}\n"
        '[[size]]\nname = "feet"\nbody = "movable"\nfaces = "-z"\ntolerance = 0.1\n'
        '[defaults]\ntolerance = 0.02\ngoal = "touch"\nmotion = [{ translation = "z" }]\n'
        '[[case]]\nname = "A"\nrequirement = "A"\n[[case]]\nname = "feet"\nmade = "worst"\n'
    )
    scaled, sized = fo.load_problems(path)
    assert scaled.requirement == "A"
    assert (sized.requirement, sized.target.tolist(), sized.made) == (None, [1.0, 1.0], {"feet": 0.1})
    from fcdm_opt.design.question import Question

    question = Question.read(path)[1]  # as what-if and studies take it
    assert question.changed({"made": "low"}).problem().made == {"feet": -0.1}
    assert question.changed({"made.feet": 0.05}).problem().made == {"feet": 0.05}


@pytest.mark.parametrize("goal", ["at", "seat"])
def test_what_stands_on_a_table_made_higher_was_refused_for_want_of_a_contact(goal: str) -> None:
    """The parts made lie on no contact of the curve: those that are drawn are restored."""
    cube, table = box((-1, -1, 0), (1, 1, 2), "cube"), box((-3, -3, -1), (3, 3, 0), "table")
    feet = fo.Size("feet", "movable", faces="-z", tolerance=0.1)
    problem = fo.Problem(cube, table, sizes=[feet], made={"feet": 0.0625}, goal=goal, motion=fo.Translation("z"))
    solution = fo.solve(problem)
    assert solution.usable
    assert solution.parameters["TZ"] == pytest.approx(0.0625, abs=1e-15)
    assert [feature.kind for feature in solution.features] == ["F1F2"]


def bored(radius: float, sections: int) -> fo.Body:
    """A plate with a round hole, partitioned by the planes of its own facets."""
    plate, pin = trimesh.creation.box((60, 40, 10)), trimesh.creation.cylinder(radius, 30, sections=sections)
    mesh = trimesh.boolean.difference([plate, pin])
    return fo.Body.from_mesh(mesh.vertices, mesh.faces, name="plate")


def turned(name: str, *profile: tuple[float, float]) -> fo.Body:
    mesh = trimesh.creation.revolve(np.array(profile), sections=12)
    mesh.merge_vertices()
    return fo.Body.from_mesh(mesh, name=name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("goal", "faces", "up"),
    [("at", ["F3", "F5"], 0.5), ("seat", ["F1", "F5"], 0.0), ("touch", ["cylinder radius 9"], 0.0),
     ("seat", ["F3", "F5"], 0.5)],
)  # fmt: skip
def test_a_flange_on_a_ring_was_refused_for_contacts_whose_corners_had_one_name(
    goal: str, faces: Any, up: float
) -> None:
    """The ring's cuts cross edges in corners that are no corners of it: those of one edge are called alike."""
    bush = turned("bush", (0, -1), (5, -1), (5, 8), (9, 8), (9, 11), (0, 11))
    ring = turned("ring", (5.1, 0), (20, 0), (20, 8), (5.1, 8), (5.1, 0))
    size = fo.Size("size", "movable", faces=faces, each=0.5, tolerance=0.05)
    for made, value in ({"size": -0.03}, -0.03), ("worst", 0.05):
        asked = {"sizes": [size], "made": made, "goal": goal, "motion": fo.Translation("z")}
        solution = fo.solve(fo.Problem(bush, ring, **asked))
        assert solution.certificate.passed
        assert solution.parameters["TZ"] == pytest.approx(up * value, abs=1e-12)


def test_pieces_of_a_face_with_a_hole_lost_its_name_at_other_sizes() -> None:
    body = bored(8.0, 24)
    made = resized(body, {fo.Size("d", "static", faces="bore radius 8", each=-0.5): -0.02})
    named = [(made, part, k) for part in made.parts for k in np.flatnonzero(np.abs(part.normals[:, 2]) > 0.5).tolist()]
    assert len(named) >= 48
    assert all(own.owns(part.elements["F"][k]) for own, part, k in named)
    apothem = 8.0 * math.cos(math.pi / 24)
    hole = 24 * math.tan(math.pi / 24) * (apothem - 0.01) ** 2
    assert volume(made) == pytest.approx(10 * (60 * 40 - hole), rel=1e-6)  # the library has single precision


def test_a_slot_that_closes_is_refused_with_its_walls() -> None:
    mesh = trimesh.boolean.difference([
        trimesh.creation.box(bounds=[[0, 0, 0], [3, 1, 2]]), trimesh.creation.box(bounds=[[1, -1, 1], [2, 2, 3]]),
    ])  # fmt: skip
    body = fo.Body.from_mesh(mesh.vertices, mesh.faces)
    walls = [{"through": (x, 0.5, 1.5)} for x in (1.0, 2.0)]
    size = fo.Size("w", "static", faces=walls, each=1.0)
    assert volume(resized(body, {size: 0.49})) == pytest.approx(6.0 - 0.02, rel=1e-6)
    with pytest.raises(fo.InputError, match=r"otherwise than as drawn: faces back, top no\. 2; found 'w = 0.51'"):
        resized(body, {size: 0.51})


def test_a_pin_made_too_thick_is_told_not_to_fit() -> None:
    """It was moved out through the wall, and refused for want of a name there."""
    angles = 2.0 * np.pi * np.arange(24) / 24
    ring = 7.98 * np.column_stack([np.cos(angles), np.sin(angles)])
    pin = fo.Body.convex(np.vstack([np.column_stack([ring, np.full(24, z)]) for z in (-4.0, 4.0)]), name="pin")
    size = fo.Size("d", "movable", faces="cylinder radius 7.98", each=0.5)
    shift = X >> fo.Translation("y")
    problem = fo.Problem(pin, bored(8.0, 24), sizes=[size], made={"d": 0.1}, goal="clear", motion=shift)
    solution = fo.solve(problem)
    assert not solution.usable
    assert "not fit: pin 16.060 in plate 16.000" in str(solution)  # 7.98 x 2 + .1, not the widths across flats


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dovetail", "lid"])
def test_shipped_solids_change_their_volume_by_a_face_s_area(name: str) -> None:
    """By a first-order formula: dV / dp of a face is its area; of all faces at once too."""
    problem = fo.load_problems(PROBLEMS / f"{name}.toml")[0]
    tried = 0
    for body in (problem.movable, problem.static):
        for k, triangles in enumerate(body.triangles):
            size = fo.Size("f", "static", faces=f"F{k + 1}")
            try:
                one, two = (volume(resized(body, {size: p})) for p in (-0.1, 0.1))  # the library has single precision
            except fo.InputError as reason:
                assert "plane" in str(reason)  # noqa: PT017 - a cut that runs along two faces, or none
                continue
            area = sum(np.linalg.norm(np.cross(b - a, c - a)) / 2 for a, b, c in body.vertices[np.array(triangles)])
            assert (two - one) / 0.2 == pytest.approx(area, rel=2e-3)
            tried += 1
    assert tried >= 6


def test_where_a_face_vanishes_is_told_with_the_face() -> None:
    body = fo.Body.convex([(0, 0, 0), (4, 0, 0), (4, 2, 0), (0, 2, 0), (1, 0, 1), (3, 0, 1), (3, 2, 1), (1, 2, 1)])
    size = fo.Size("height", "movable", faces="+z", tolerance=0.5)
    assert resized(body, {size: 0.9}).vertices[:, 2].max() == pytest.approx(1.9)
    with pytest.raises(fo.InputError, match=r"vanishes.*face top|face top.*vanishes"):
        resized(body, {size: 1.1})  # the sides meet at a height of 2
    factor, where = Resizing.of(body, [size]).valid_up_to(np.array([-0.5]), np.array([0.5]))
    assert factor == pytest.approx(2.0)
    assert "face top" in where


def test_a_stack_says_from_where_on_parts_as_made_are_refused() -> None:
    rng = np.random.default_rng(3)
    far = fo.Body.convex(rng.normal(size=(8, 3)) + np.array([9.0, 0.0, 0.0]))
    slab, width = box((0, 0, 0), (0.2, 1, 1)), fo.Size("width", "movable", faces=["+x", "-x"], each=0.5, tolerance=0.5)
    assert TouchingSizes.of(slab, far, [replace(width, tolerance=0.1)]).vanishing[0] == pytest.approx(2.0)
    for _ in range(7):
        one = fo.Body.convex(rng.normal(size=(9, 3)))
        sizes = []
        for k in range(3):
            names = [f"F{face + 1}" for face in rng.choice(len(one.face_planes[0]), 2, replace=False)]
            sizes.append(fo.Size(f"{k}", "movable", faces=names, each=rng.uniform(-1, 1, 2), tolerance=0.3))
        factor, face, end = TouchingSizes.of(one, far, sizes).vanishing
        at = np.array([end[size.name] for size in sizes])
        for p in (factor * 0.9999 * at, *rng.uniform(-0.2999 * factor, 0.2999 * factor, (5, 3))):
            resized(one, dict(zip(sizes, p, strict=True)))
        with pytest.raises(fo.InputError, match="vanishes"):
            resized(one, dict(zip(sizes, factor * 1.0001 * at, strict=True)))
        assert face.startswith("face F")


def test_a_part_that_ends_in_a_body_cut_anew_was_said_to_be_refused() -> None:
    """A shaft with a keyway: .5 off its radius cuts some of its parts away, and it is made all the same."""
    key = fo.Box((8, 30, 6), centre=(14, 0, 12))
    shaft = fo.cut(fo.Cylinder(15, 40, base=(0, -20, 0), axis="y"), key, name="shaft")
    hub = fo.cut(fo.Box((60, 18, 60)), fo.Cylinder(15.01, 40, base=(0, -20, 0), axis="y"), name="hub")
    size = fo.Size("journal", "movable", faces="cylinder radius 15", each=0.5, tolerance=(-1.0, 0.0))
    assert resized(shaft, {size: -1.0}).vertices[:, 2].min() == pytest.approx(-14.5, abs=0.02)
    stack = fo.stack_up(fo.Problem(shaft, hub, sizes=[size], goal="clear", motion=fo.Translation("x")))
    assert Resizing.of(stack.touching.bodies[0], [size]).valid_up_to(np.array([-1.0]), np.zeros(1))[0] < 1.0
    assert not [note for note in stack_notes(stack) if "vanishes" in note]


def test_where_a_face_vanishes_was_no_sentence_and_named_no_size() -> None:
    """The sides of a roof cut off at a height of 1 meet at 2."""
    roof = fo.Body.convex([(0, 0, 0), (4, 0, 0), (4, 2, 0), (0, 2, 0), (1, 0, 1), (3, 0, 1), (3, 2, 1), (1, 2, 1)])
    size, far = fo.Size("height", "movable", faces="+z", tolerance=(0.0, 1.5)), box((9, 0, 0), (10, 1, 1))
    stack = fo.stack_up(fo.Problem(roof, far, sizes=[size], goal="clear", motion=fo.Translation("x")))
    (told,) = (note for note in stack_notes(stack) if "vanishes" in note)
    assert told.startswith("at height +1 face ")


def test_a_slot_whose_walls_meet_is_refused() -> None:
    walls = [{"through": (-5.0625, 16, 15)}, {"through": (5.0625, 16, 15)}]
    size = fo.Size("w", "static", faces=walls, each=-0.5)
    with pytest.raises(fo.InputError, match="changes its shape"):
        resized(slot(), {size: -10.2})


REFUSED = {
    "several": ({"faces": "-x"}, "several faces.*F6.*F10"),
    "none": ({"faces": "F99"}, "no such face.*F1 to F10"),
    "word": ({"faces": "lid"}, "no face is named like this.*through"),
    "name": ({"faces": "bore radius 8"}, "no face of body 'slot' has this name.*front, right, back no. 1"),
    "each": ({"faces": ["F1", "F2"]}, "how far does each face move.*0.5 of a width .*, 1 of faces of one level"),
    "unit": ({"scale": "xyz", "tolerance": "0.1 mm"}, "a scale has no unit.*a share: 0.003"),
    "both": ({"faces": "F1", "scale": "x"}, "faces or a scale"),
    "empty": ({"faces": "F1", "tolerance": (0.1, -0.1)}, "low <= high"),
    "across": ({"faces": "F2", "along": "x"}, "no face is moved"),
    "same": ({"faces": ["F2", "F2"], "each": 0.5}, "F2 is meant twice"),
    "no list": ({"faces": 3}, "no faces"),
    "truth": ({"faces": "F1", "tolerance": True}, "unusable numbers"),
    "nothing": ({"faces": "F1", "each": 0.0}, "each: no face is moved"),
    "radius": ({"faces": {"around": (0, 0, 0), "axis": "z", "radius": -1.0}}, "no radius"),
    "nowhere": ({"faces": {"through": (90, 0, 0)}}, "no face of body 'slot' goes through"),
    "spread": ({"faces": "F1", "distribution": {"normal": 3}}, "unusable distribution"),
    "coplanar": ({"faces": "F2", "distribution": {"weibull": {}}, "tolerance": 0.1}, "unusable distribution"),
}


def test_a_face_that_is_not_there_is_refused_whatever_is_made() -> None:
    size = fo.Size("odd", "static", faces="F99")
    with pytest.raises(fo.InputError, match="F1 to F10"):
        fo.Problem(box((-5, 13, 2), (5, 20, 28)), slot(), sizes=[size], motion=X, goal="touch")


@pytest.mark.sampled(8)
@pytest.mark.parametrize("key", REFUSED)
def test_what_no_size_is_is_refused_with_what_is_allowed(key: str) -> None:
    arguments, said = REFUSED[key]

    def asked() -> object:
        size = fo.Size("odd", "static", **{"tolerance": 0.1, **arguments})
        problem = fo.Problem(box((-5, 13, 2), (5, 20, 28)), slot(), sizes=[size], motion=X, goal="touch")
        return fo.stack_up(problem).contributions

    with pytest.raises(fo.InputError, match=said):
        asked()


def test_all_facets_of_a_cylinder_are_one_selector() -> None:
    count, radius = 24, 5.0
    ring = [
        (radius * math.cos(2 * math.pi * k / count), radius * math.sin(2 * math.pi * k / count)) for k in range(count)
    ]
    body = fo.Body.convex([(x, y, z) for x, y in ring for z in (0.0, 3.0)])
    around = {"around": (0, 0, 1), "axis": "z", "radius": radius}
    made = resized(body, {fo.Size("diameter", "movable", faces=[around], each=0.5): 0.2})
    grown = radius + 0.1 / math.cos(math.pi / count)
    assert np.hypot(*made.vertices[:, :2].T) == pytest.approx(np.full(2 * count, grown), rel=1e-14)


# -------------------------------------------------------------------------------------------------- touching at a pose


def test_signs_of_gaps_are_those_of_rationals() -> None:
    wrong = unproved = together = 0
    for gap, meet in exact.cases(200, seed=11):
        unproved += meet is None
        together += meet is True
        wrong += meet is not None and (gap <= 0.0) != meet
    assert wrong == 0
    assert unproved <= 4
    assert 40 < together < 160


def test_theleast_of_the_largest_row_is_that_of_a_linear_program() -> None:
    from scipy.optimize import linprog

    rng = np.random.default_rng(12)
    for count, size in product((1, 2, 5, 20, 40), (1, 2, 5, 24)):
        for scale in (1e-6, 1.0, 1e6):
            rows = rng.normal(size=(count, 1 + size)) * np.array([0.1 * scale, *[1.0] * size])
            middle = scale * rng.normal(size=size)
            box = np.column_stack([middle - scale * rng.random(size), middle + scale * rng.random(size)])
            value, place = least_of(rows, box)
            left = np.column_stack([rows[:, 1:], -np.ones(count)])
            bounds = [*(box / scale).tolist(), (None, None)]
            known = linprog([*[0.0] * size, 1.0], left, -rows[:, 0] / scale, bounds=bounds).fun * scale
            assert value == pytest.approx(known, abs=1e-7 * scale)
            assert (rows[:, 0] + rows[:, 1:] @ place).max() == pytest.approx(value, abs=1e-11 * scale)
            assert (least_of(rows, box, sign=True)[0] < 0.0) == (value < 0.0)


def test_the_gap_of_parts_made_is_that_of_the_rows() -> None:
    rng = np.random.default_rng(6)
    seen = 0
    for _ in range(12):
        bodies = [fo.Body.convex(rng.normal(size=(8, 3)) + k * rng.normal(size=3)) for k in (0, 1)]
        sizes = [
            fo.Size(f"{role}{k}", role, faces=f"F{k + 1}", tolerance=0.02)
            for role, body in zip(("movable", "static"), bodies, strict=True)
            for k in range(len(body.faces))
        ]
        sizes += [fo.Size("m", "movable", scale="xyz", tolerance=0.02)]
        problem = fo.Problem(*bodies, sizes=sizes, motion=X, goal="touch")
        stack = fo.stack_up(problem)
        for p in rng.uniform(-0.02, 0.02, (4, len(sizes))):
            named = dict(zip(stack.names, p.tolist(), strict=True))
            try:
                made = problem.changed(made=named)
            except fo.InputError:
                continue  # a face as small as its tolerance
            gap = fo.decision_curve(made.movable, made.static).gap((1.0, 1.0))
            seen += 1
            if gap < 0:  # apart, rows of corners that split may tell more of the distance
                assert stack.gap(named) == pytest.approx(gap, abs=1e-12)
            else:
                distance = fo.decision_curve(made.movable, made.static).distance((1.0, 1.0))
                assert gap - 1e-12 <= stack.gap(named) <= distance + 1e-9
    assert seen >= 30


def uniform(role: str, body: fo.Body, *, faces: bool) -> fo.Size:
    """A uniform scale, as one or as every face moved outward by its height over the seed."""
    if not faces:
        return fo.Size(role, role, scale="xyz", tolerance=0.2)
    normals, points = body.face_planes
    heights = (normals * (points - body.seed)).sum(axis=1)
    names = [f"F{k + 1}" for k in range(len(normals))]
    return fo.Size(role, role, faces=names, each=heights.tolist(), tolerance=0.2)


def pairs_of_bodies(kind: str, rng: Any) -> tuple[fo.Body, fo.Body]:
    way = rng.normal(size=3)
    if kind == "hulls":
        away = 3.0 * way / np.linalg.norm(way)
        return fo.Body.convex(rng.normal(size=(10, 3))), fo.Body.convex(rng.normal(size=(10, 3)) + away)
    one, two, off = rng.uniform(0.5, 2.0, 3), rng.uniform(0.5, 2.0, 3), rng.uniform(-0.4, 0.4, 3)
    axis = int(rng.integers(3))
    off[axis] = (one[axis] + two[axis]) / 2.0 * rng.uniform(0.95, 1.05)
    if kind == "aligned boxes":
        return box(-one / 2, one / 2), box(off - two / 2, off + two / 2)
    off[2] = 0.5 + one[2] / 2.0
    turn = Rotation.from_rotvec([0.0, 0.0, way[0]]).as_matrix()
    corners = [[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
    peg = fo.Body.convex(np.array(corners) * one @ turn.T + off)
    return peg, fo.Body.from_parts([np.array(corners) * [3, 3, 1], np.array(corners) * [1, 3, 3] + [2, 0, 0]])


@pytest.mark.sampled(3)
@pytest.mark.parametrize("faces", [False, True])
@pytest.mark.parametrize("kind", ["hulls", "aligned boxes", "a turned box on two others"])
def test_rows_of_two_uniform_scales_are_the_lines_of_the_decision_curve(kind: str, faces: bool) -> None:
    """Equal to the last bit, where rows of a scale of their own were up to four, of faces up to nine units off."""
    rng = np.random.default_rng(7)
    checked = 0
    for _ in range(30):
        one, two = pairs_of_bodies(kind, rng)
        sizes = [uniform(role, body, faces=faces) for role, body in (("movable", one), ("static", two))]
        transform = np.eye(4)
        if kind == "hulls":
            transform[:3, :3] = Rotation.from_rotvec(rng.normal(size=3) * 0.02).as_matrix()
        touching = TouchingSizes.of(one, two, sizes, transform=transform)
        rows = np.concatenate([pair.values for pair in touching.pairs])
        curve = fo.decision_curve(one, two, box=((0.81, 1.19), (0.81, 1.19)), transform=transform)
        for a, b, c in (segment.line for segment in curve.segments):
            assert (rows == [c - a - b, -a, -b]).all(axis=1).any()
            checked += 1
    assert checked >= 10


def test_a_pose_moves_the_movable_body() -> None:
    one, two = box((0, 0, 0), (1, 1, 1)), box((3, -5, -5), (4, 5, 5))
    size = fo.Size("w", "movable", faces="+y", tolerance=0.1)
    problem = fo.Problem(one, two, sizes=[size], motion=X, goal="touch")
    turned = np.array([[0.0, 1, 0, 0.5], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])  # +y becomes +x
    (row,) = fo.stack_up(problem, pose=turned).rows
    assert (row.gap, row.coefficients) == (pytest.approx(1.5), {"w": pytest.approx(-1.0)})


# ------------------------------------------------------------------------------------------------------------- problems


def test_parts_made_are_solved_judged_and_told_again() -> None:
    one, two = box((0, 0, 0), (4, 2, 1), "peg"), box((4, 0, 0), (6, 2, 1), "wall")
    sizes = [
        fo.Size("a", "movable", faces="+x", tolerance=0.05),
        fo.Size("b", "static", faces="-x", tolerance=(-0.02, 0.1)),
        fo.Size("c", "movable", scale="x", tolerance=0.01),
    ]
    problem = fo.Problem(one, two, sizes=sizes, made={"a": 0.03, "b": 0.01}, motion=X, goal="touch")
    solution = fo.solve(problem)
    assert solution.certificate.passed
    assert solution.parameters["TX"] == pytest.approx(-0.04, abs=1e-12)
    again = fo.Problem.from_dict(problem.to_dict())
    assert np.array_equal(again.movable.vertices, problem.movable.vertices)
    assert again.made == {"a": 0.03, "b": 0.01, "c": 0.0}
    assert fo.verify(fo.Solution.from_dict(solution.to_dict())).passed
    corners = {"worst": -0.17, "loosest": 0.09, "low": 0.09, "high": -0.17, "middle": -0.04}
    for corner, shift in corners.items():
        assert fo.solve(problem.changed(made=corner)).parameters["TX"] == pytest.approx(shift, abs=1e-12)
    with pytest.raises(fo.InputError, match=r"no such size.*a, b, c"):
        problem.changed(made={"d": 0.1})
    assert np.array_equal(problem.changed(made=None).movable.vertices, one.vertices)


def test_the_loosest_sizes_were_a_ten_millionth_off_the_ends_of_their_tolerances() -> None:
    """A T-nut in its slot, drawn in digits of single precision: its flange has a little less play than its neck."""
    width, chamber, ledge = np.float32([5.1, 9.2, 13.3]).tolist()
    nut = fo.Body.from_parts(
        [box((-9, 20, 5.3), (9, 40, ledge)).vertices, box((-5, 20, ledge), (5, 40, 24)).vertices],
        seed=(0, 30, 14),
        name="nut",
    )
    walls = [box((-20, 0, 0), (-chamber, 60, 25)).vertices, box((chamber, 0, 0), (20, 60, 25)).vertices]
    lips = [box((-20, 0, ledge), (-width, 60, 25)).vertices, box((width, 0, ledge), (20, 60, 25)).vertices]
    slot = fo.Body.from_parts([*walls, *lips, box((-20, 0, 0), (20, 60, 5)).vertices], seed=(0, 30, 12), name="slot")
    sizes = [
        fo.Size("neck", "movable", faces=[{"through": (x, 30, 20)} for x in (-5, 5)], each=0.5, tolerance=(-0.1, 0)),
        fo.Size(
            "mouth",
            "static",
            faces=[{"through": (x, 30, 20)} for x in (-width, width)],
            each=-0.5,
            tolerance=(0, 0.2),
        ),
        fo.Size("flange", "movable", faces=[{"through": (x, 30, 9)} for x in (-9, 9)], each=0.5, tolerance=(-0.1, 0)),
    ]
    problem = fo.Problem(nut, slot, sizes=sizes, made="loosest", motion=X, goal="touch")
    assert problem.made == {"neck": -0.1, "mouth": 0.2, "flange": -0.1}


def test_loosest_sizes_of_a_further_contact_were_as_drawn() -> None:
    """A strip in its slot is loosest line to line, and then as far off its floor as that goes; "worst" did the like."""
    strip = box((-10, -6, -4), (10, 6, 4), "strip")
    walls = [box((-20, -20, -9), (20, -6, 3)).vertices, box((-20, 6, -9), (20, 20, 3)).vertices]
    bed = fo.Body.from_parts([*walls, box((-20, -20, -9), (20, 20, -4)).vertices], seed=(0, 0, 0), name="bed")
    sides = [{"through": (0, y, 0)} for y in (-6, 6)]
    sizes = [
        fo.Size("strip width", "movable", faces=["+y", "-y"], each=0.5, tolerance=(0.018, 0.029)),
        fo.Size("slot width", "static", faces=sides, each=-0.5, tolerance=(0.0, 0.018)),
        fo.Size("strip height", "movable", faces="-z", tolerance=0.02),
        fo.Size("slot depth", "static", faces=[{"through": (0, 0, -4)}], each=-1, tolerance=(0.0, 0.03)),
    ]
    asked = fo.Problem(strip, bed, sizes=sizes, made="loosest", motion=fo.Translation("z"), goal="clear")
    assert [*asked.made.values()] == [0.018, 0.018, -0.02, 0.03]
    assert [*asked.changed(made="worst").made.values()] == [0.029, 0.0, 0.02, 0.0]


def test_a_file_with_sizes_answers_its_closed_forms() -> None:
    for problem in fo.load_problems(PROBLEMS / "slot_and_key.toml")[:2]:
        solution = fo.solve(problem)
        assert solution.certificate.passed
        assert list(solution.parameters.values()) == pytest.approx(list(problem.published), abs=1e-12)


def test_what_if_takes_other_sizes() -> None:
    problem = fo.load_problems(PROBLEMS / "slot_and_key.toml")[1]
    answer = fo.whatif(problem, made={"key_foot": 0.02, "slot_depth": 0.0})
    assert answer.after.parameters["TY"] == pytest.approx(-0.105, abs=1e-12)


def test_derivatives_by_sizes_are_those_of_the_closed_forms() -> None:
    """Amounts: 0.125 + slot_depth - key_foot; 0.0625 + (slot_width - key_width) / 2 - slot_position."""
    told = {
        "as drawn": {"key_foot": -1.0, "slot_depth": 1.0},
        "low foot, deep slot": {"key_foot": -1.0, "slot_depth": 1.0},
        "to a side, at the least gap": {"key_width": -0.5, "slot_width": 0.5, "slot_position": -1.0},
    }
    for problem in fo.load_problems(PROBLEMS / "slot_and_key.toml"):
        found = fo.solve(problem).sensitivity
        assert found.exists
        assert found.sizes == pytest.approx({name: told[problem.name].get(name, 0.0) for name in found.sizes}, abs=1e-9)


@pytest.mark.slow
def test_derivatives_by_sizes_are_those_of_differences() -> None:
    """Random hulls that are scaled, and whose faces are moved besides: corners of three faces, so that all exist."""
    from scipy.spatial import HalfspaceIntersection

    rng = np.random.default_rng(8)
    tried = 0
    for _ in range(4):
        bodies = []
        for k in range(2):
            normals = np.vstack([rng.normal(size=(4, 3)), [[1, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]]])
            normals /= np.linalg.norm(normals, axis=1)[:, None]
            planes = np.column_stack([normals, -rng.uniform(0.8, 1.3, size=8)])
            points = HalfspaceIntersection(planes, np.zeros(3)).intersections
            bodies.append(fo.Body.convex(points + np.array([0, 0, 3.5 * k])))
        sizes = [fo.Size("all", "movable", scale="xyz")]
        for role, body in zip(("movable", "static"), bodies, strict=True):
            sizes += [fo.Size(f"{role}{k}", role, faces=f"F{k + 1}") for k in range(len(body.faces))]
        values = {size.name: x for size, x in zip(sizes, rng.uniform(-0.003, 0.003, 17).tolist(), strict=False)}
        motion = fo.Translation("z") >> fo.Translation("x")
        problem = fo.Problem(*bodies, sizes=sizes, made=values, motion=motion, goal="touch")
        solution = fo.solve(problem)
        found = solution.sensitivity
        if not found.exists:
            continue
        for name, x in values.items():
            ends = [fo.solve(problem.changed(made={**values, name: x + step})).amount for step in (1e-6, -1e-6)]
            assert found.sizes[name] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-5)
            tried += 1
    assert tried >= 17 * 2


def test_faces_are_chosen_on_the_part_as_drawn_when_it_is_scaled_too() -> None:
    """The point of a selector lies on the face as drawn, and no more on that of the scaled part."""
    peg, wall = box((0, 0, 0), (4, 2, 1), "peg"), box((4.5, 0, 0), (6, 2, 1), "wall")
    sizes = [fo.Size("s", "movable", scale="x"), fo.Size("a", "movable", faces={"through": (4, 1, 0.5)})]
    problem = fo.Problem(peg, wall, sizes=sizes, made={"s": 0.05, "a": 0.02}, motion=X, goal="touch")
    solution = fo.solve(problem)
    assert solution.parameters["TX"] == pytest.approx(0.5 - 0.1 - 0.02, abs=1e-12)
    assert solution.sensitivity.sizes == pytest.approx({"s": -2.0, "a": -1.0})


def test_points_of_a_map_do_not_make_the_same_body_anew() -> None:
    """One of two sizes changes: the other body, and which faces a size means, are what they were."""
    body, size = box((0, 0, 0), (4, 2, 1)), fo.Size("w", "movable", faces=["+x", "-x"], each=0.5)
    assert resized(body, {size: 0.25}) is resized(body, {size: 0.25})
    assert resized(body, {size: 0.25}) is not resized(body, {size: 0.26})
    assert size.offsets(body) is size.offsets(body)
    assert not size.offsets(body).flags.writeable


@pytest.mark.slow
def test_a_shaft_with_chamfer_and_keyway_that_was_made_smaller_did_not_fit_its_hub() -> None:
    """Facets that move split the corners of the chamfer's rim: what its faces are was not known then."""
    whole = fo.joined(fo.Cylinder(15.0, 39.0, base=(0, 0, -19.5)), fo.Cone(14.0, 15.0, 1.0, base=(0, 0, -20.5)))
    shaft = fo.cut(whole, fo.Box((8, 8, 14), centre=(0, 15, 0)), name="shaft")
    hub = fo.cut(fo.Box((50, 50, 20)), fo.Cylinder(15.0, 30.0, base=(0, 0, -15)), name="hub")
    size = fo.Size("shaft", "movable", faces=["cylinder radius 15"], each=0.5, tolerance=(-0.02, -0.007))
    made = {"shaft": -0.007}
    problem = fo.Problem(shaft, hub, sizes=[size], made=made, goal="touch", motion=fo.Translation("x"))
    solution = fo.solve(problem)
    assert solution.usable
    assert solution.amount == pytest.approx(0.0035, rel=1e-9)
    assert solution.amount_low == pytest.approx(0.0035, rel=1e-4)
    x, y, z = problem.movable.vertices[[label - 1 for label in problem.movable.corners]].T
    rim = np.hypot(x, y)[np.abs(z + 19.5 + 0.0035) < 1e-9]
    assert rim == pytest.approx(np.full(32, 14.9965), rel=1e-12)


def test_a_bearing_seat_was_refused_at_another_diameter_as_it_is_cut_at_its_shoulder() -> None:
    """The cut's corners go with the cylinder: the parts of the one drawn are those of the one made."""
    seat = fo.joined(fo.Cylinder(6.0, 4.0, facets=16), fo.Cylinder(4.0, 9.0, facets=16), name="seat")
    size = fo.Size("diameter", "static", faces=["cylinder radius 4"], each=0.5)
    made = resized(seat, {size: -0.02})
    assert made.faces == seat.faces
    radii = np.hypot(*made.vertices[[label - 1 for label in made.corners], :2].T)
    assert np.unique(radii.round(12)).tolist() == [3.99, 6.0]
    assert volume(made) == pytest.approx(8.0 * math.sin(math.pi / 8.0) * (36.0 * 4.0 + 3.99**2 * 5.0), rel=1e-7)


@pytest.mark.slow
def test_a_bush_with_chamfers_had_cuts_between_its_parts_among_its_faces() -> None:
    """Made at other sizes, its answers were those of facets, 0.012058, and a map of the fit was undecided."""
    (drawn,) = fo.load_problems(Path(__file__).parents[2] / "problems" / "round" / "bush.toml")
    problem = drawn.changed(target=None, made={"bush": -0.0135, "bore": 0.0105})
    assert len(problem.movable.corners) == len(drawn.movable.corners)
    assert max(deviation_of(problem.movable)) < 0.06
    solution = fo.solve(problem, effort="quick")
    assert solution.usable
    assert solution.amount == pytest.approx((0.0105 + 0.0135) / 2.0, rel=1e-9)


def test_a_fillet_stayed_where_it_was_when_the_shaft_that_it_ends_got_thinner() -> None:
    """It keeps its radius and stays tangent: its ring gets as much smaller, so that a plane at 45 degrees is as far."""
    rounded = fo.joined(
        fo.Cylinder(5.0, 10.0, facets=16), fo.Torus(4.0, 1.0, centre=(0, 0, 10), facets=16),
        fo.Cylinder(4.0, 11.0, facets=16), name="shaft",
    )  # fmt: skip
    ramp = fo.Body.convex([(x, y, z) for y in (-9, 9) for x, z in ((2, 14), (14, 2), (14, 14))], name="ramp")
    size = fo.Size("diameter", "movable", faces=["cylinder radius 5"], each=0.5, tolerance=(-0.1, 0.1))
    problem = fo.Problem(rounded, ramp, sizes=[size], made={"diameter": -0.02}, goal="touch", motion=X)
    (ring,) = (surface.ring for surface, _ in round_surfaces(problem.movable) if surface.ring)
    assert ring == pytest.approx(3.99, rel=1e-12)
    assert problem.movable.faces == rounded.faces
    solution = fo.solve(problem)
    assert solution.usable
    assert solution.amount == pytest.approx(16.0 - (3.99 + 10.0) - math.sqrt(2.0), rel=1e-9)
    assert solution.amount_low == pytest.approx(solution.amount, rel=1e-4)
    assert solution.sensitivity.sizes["diameter"] == pytest.approx(-0.5, rel=1e-6)


def feather(width: float, name: str) -> list[fo.Body]:
    """What a feather key of form A is joined of: a box, and two cylinders that end it."""
    ends = [fo.Cylinder(width / 2.0, 7.0, base=(x, 0, -3.5), facets=16) for x in (-16, 16)]
    return [fo.Box((32, width, 7), name=name), *ends]


@pytest.mark.parametrize("width", [pytest.param(-0.036, marks=pytest.mark.slow), 0.036])
def test_the_ends_of_a_feather_key_stayed_as_wide_when_its_flats_moved(width: float) -> None:
    """They are tangent to both flats: their radius goes with them, in a pocket too, whose gap is half of both."""
    key = fo.joined(*feather(8.0, "key"), name="key")
    pocket = fo.cut(fo.Box((60, 24, 6)), *feather(8.06, "room"), name="pocket")
    walls = [{"through": (0, y, 0)} for y in (-4.03, 4.03)]
    sizes = [
        fo.Size("b", "movable", faces=["+y", "-y"], each=0.5, tolerance=sorted([0.0, width])),
        fo.Size("room", "static", faces=walls, each=-0.5, tolerance=(-0.01, 0.0)),
    ]
    problem = fo.Problem(key, pocket, sizes=sizes, made={"b": width, "room": -0.01}, motion=fo.Translation("y"))
    for body, radius in ((problem.movable, 4.0 + width / 2.0), (problem.static, 4.025)):
        for surface, _ in round_surfaces(body):
            assert (abs(surface.origin[0]), surface.origin[1]) == pytest.approx((16.0, 0.0), abs=1e-9)
            assert surface.radius == pytest.approx(radius, abs=1e-9)
    assert np.abs(problem.movable.vertices[:, 0]).max() == pytest.approx(20.0 + width / 2.0, abs=1e-9)
    assert fo.solve(problem).amount == pytest.approx(4.025 - (4.0 + width / 2.0), rel=1e-6)
    worst = fo.stack_up(problem).worst()
    assert worst.least == pytest.approx(4.025 - (4.0 + max(width, 0.0) / 2.0), rel=1e-6)
    assert worst.largest == pytest.approx(4.03 - (4.0 + min(width, 0.0) / 2.0), rel=1e-6)


def test_round_ends_with_a_size_of_their_own_do_not_follow_their_flats_besides() -> None:
    """Both .036 narrower, by two sizes: the gap along x is that of the ends, 4.03 - 3.982, once."""
    key = fo.joined(*feather(8.0, "key"), name="key")
    pocket = fo.cut(fo.Box((60, 24, 6)), *feather(8.06, "room"), name="pocket")
    faces = {"flats": ["+y", "-y"], "ends": ["cylinder radius 4 no. 1", "cylinder radius 4 no. 2"]}
    sizes = [fo.Size(name, "movable", faces=own, each=0.5, tolerance=0.05) for name, own in faces.items()]
    asked = fo.Problem(key, pocket, sizes=sizes, made=dict.fromkeys(faces, -0.036), motion=fo.Translation("x"))
    assert [surface.radius for surface, _ in round_surfaces(asked.movable)] == pytest.approx([3.982, 3.982], abs=1e-9)
    assert fo.solve(asked).amount == pytest.approx(0.048, rel=1e-6)


def test_the_round_end_between_two_flats_goes_with_the_one_that_moves() -> None:
    size = fo.Size("b", "movable", faces="+y")
    made = resized(fo.joined(*feather(8.0, "key"), name="key"), {size: 0.036})
    assert [surface.origin[1] for surface, _ in round_surfaces(made)] == pytest.approx([0.018, 0.018], abs=1e-9)
    assert np.abs(made.vertices[:, 0]).max() == pytest.approx(20.018, abs=1e-9)


ARC, ROD = fo.Cylinder(4.0, 10.0, base=(0, 0, -5), facets=16), fo.Box((30, 8, 10), centre=(15, 0, 0))
ROUND_AT_ONE_END = {
    "tongue": (fo.joined(ARC, ROD, name="tongue"), ["+y", "-y"], 0.5),
    "open slot": (fo.cut(fo.Box((40, 30, 6)), ARC, ROD, name="open slot"), None, -0.5),
    "keyhole": (
        fo.cut(fo.Box((60, 30, 6)), ARC, fo.Box((16, 8, 10), centre=(8, 0, 0)),
               fo.Cylinder(8.0, 10.0, base=(16, 0, -5), facets=24), name="keyhole"), None, -0.5,
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", ROUND_AT_ONE_END)
def test_one_round_end_stayed_as_wide_when_its_flats_moved(kind: str) -> None:
    """The gap along x to a pin or cradle of radius 3 or 5 about the same axis: 1, and half of what the width is off."""
    body, walls, each = ROUND_AT_ONE_END[kind]
    faces = walls or [{"through": (5, y, 0)} for y in (-4, 4)]
    size = fo.Size("width", "movable", faces=faces, each=each, tolerance=0.1)
    other = fo.Cylinder(3.0, 20.0, base=(0, 0, -10), facets=16, name="pin")
    if each > 0.0:
        room = fo.Cylinder(5.0, 20.0, base=(0, 0, -10), facets=16), fo.Box((20, 10, 20), centre=(10, 0, 0))
        other = fo.cut(fo.Box((20, 30, 8), centre=(-9, 0, 0)), *room, name="cradle")
    limits = {"TX": (0.0, 3.0)} if each < 0.0 else {"TX": (-3.0, 0.0)}
    problem = fo.Problem(
        body, other, sizes=[size], made={"width": 0.1}, goal="touch", motion=fo.Translation("x"), limits=limits
    )
    radii = sorted(surface.radius for surface, _ in round_surfaces(problem.movable))
    assert radii == pytest.approx([4.05, 8.0][: 1 + (kind == "keyhole")], abs=1e-9)
    assert size.dimensions(body, {size: 0.1}) == pytest.approx({"": 8.1})
    assert fo.solve(problem).amount == pytest.approx(1.0 - each * 0.1, rel=1e-6)


def test_the_hemisphere_at_the_end_of_a_pin_stayed_as_wide_when_the_pin_became_thicker() -> None:
    """Of radius 4.05 it ends at 14.05."""
    pin = fo.joined(fo.Cylinder(4.0, 10.0, facets=16), fo.Sphere(4.0, centre=(0, 0, 10), facets=16), name="pin")
    made = resized(pin, {fo.Size("diameter", "movable", faces="cylinder radius 4", each=0.5): 0.1})
    assert [surface.radius for surface, _ in round_surfaces(made)] == pytest.approx([4.05, 4.05], abs=1e-9)
    assert made.vertices[:, 2].max() == pytest.approx(14.05, abs=1e-9)


def test_the_ends_of_a_feather_key_were_offered_as_sizes_of_their_own() -> None:
    """They go with the flats; a bore through the key goes with none."""
    key = fo.cut(fo.joined(*feather(8.0, "key"), name="key"), fo.Cylinder(2.0, 9.0, base=(0, 0, -4.5), facets=16))
    offered = {what.rsplit(",", 1)[0]: each for _, _, what, each in widths(key)}
    assert offered == {
        "diameter 4 of room": -0.5, "-y and +y, 8 of material": 0.5, "-z and +z, 7 of material": 0.5,
    }  # fmt: skip


@pytest.mark.parametrize("change", [-0.1, 0.1])
def test_a_fillet_of_another_radius_was_not_tangent_to_its_planes(change: float) -> None:
    """Its axis is as much further from both: a chamfer of 1 in the corner is stopped by (r - m)^2 + (r - 1 - m)^2."""
    fillet = fo.cut(fo.Box((3, 3, 10), centre=(1.5, 1.5, 0)), fo.Cylinder(3.0, 12.0, base=(3, 3, -6), facets=64))
    walls = [fo.Box((12, 2, 10), centre=(4, -1, 0)), fo.Box((2, 12, 10), centre=(-1, 4, 0))]
    angle = fo.joined(fillet, *walls, name="angle")
    profile = [(0, 1), (1, 0), (5, 0), (5, 5), (0, 5)]
    block = fo.Body.convex([(x, y, z) for x, y in profile for z in (-4, 4)], name="block")
    size = fo.Size("fil", "static", faces="bore radius 3", each=-1.0, tolerance=0.1)
    motion = fo.Translation((1, 1, 0))
    problem = fo.Problem(block, angle, sizes=[size], made={"fil": change}, goal="clear", motion=motion)
    ((surface, _),) = round_surfaces(problem.static)
    assert (surface.radius, *surface.origin[:2]) == pytest.approx([3.0 + change] * 3, abs=1e-9)
    r = 3.0 + change
    move = (2.0 * r - 1.0 - math.sqrt((2.0 * r - 1.0) ** 2 - 2.0 * (r - 1.0) ** 2)) / 2.0
    assert fo.solve(problem).amount == pytest.approx(move * math.sqrt(2.0), rel=1e-6)


def length(size: fo.Size, body: fo.Body) -> float:
    """What a size measures as drawn."""
    (found,) = size.dimensions(body).values()
    return found


@pytest.mark.parametrize("angle", [0.0, math.pi / 24, 0.05, 0.1])
def test_a_point_of_a_bore_means_the_bore(angle: float) -> None:
    """On the seam of two facets, within one, and on the true bore beyond it; a point of the rim is of two faces."""
    plate = fo.cut(fo.Box((40, 40, 6), centre=(0, 0, 3)), fo.Cylinder(10.0, 8.0, base=(0, 0, -1), facets=24))
    whole = fo.Size("d", "static", faces="bore radius 10", each=-0.5).offsets(plate)
    for radius in (
        10.0,
        10.0 * math.cos(math.pi / 24) / math.cos(abs(math.remainder(angle - math.pi / 24, math.pi / 12))),
    ):
        place = radius * math.cos(angle), radius * math.sin(angle), 3.0
        assert np.array_equal(fo.Size("d", "static", faces={"through": place}, each=-0.5).offsets(plate), whole)
    with pytest.raises(fo.FcdmError, match="several faces"):
        fo.Size("d", "static", faces={"through": (10.0, 0.0, 6.0)}).offsets(plate)
    with pytest.raises(fo.FcdmError, match="no face"):
        fo.Size("d", "static", faces={"through": (9.8, 0.0, 3.0)}).offsets(plate)


def spun(body: fo.Body, angle: float) -> fo.Body:
    """A body turned about y, so that other points of a circle are corners."""
    turned = np.eye(4)
    turned[:3, :3] = Rotation.from_rotvec([0, angle, 0]).as_matrix()
    return body.moved(turned)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("facets", [24, 25])
@pytest.mark.parametrize("angle", [0.0, math.pi / 24, 0.05])
def test_a_height_was_measured_to_a_facet_of_a_round_crown(facets: int, angle: float) -> None:
    """A cylinder of radius 5 cut off at 3: 2 from its crown, 8 with the crown cut off; a cradle's floor of 8 - 5."""
    rod = spun(fo.Cylinder(5.0, 6.0, axis="y", facets=facets), angle)
    ball = spun(fo.Sphere(5.0, facets=facets), angle)
    below, above = (fo.Box((20, 20, 20), centre=(0, 3, 3 + off)) for off in (-10, 10))
    cradle = fo.cut(fo.Box((8, 6, 8), centre=(0, 3, -4)), spun(fo.Cylinder(5.0, 8.0, base=(0, -1, 0), axis="y"), angle))
    plate = fo.cut(fo.Box((40, 6, 20), centre=(0, 3, 0)), rod)
    for body, face, name, height in (
        (fo.cut(rod, below), "-z", "cylinder radius 5", 2.0),
        (fo.cut(rod, above), "+z", "cylinder radius 5", 8.0),
        (fo.cut(ball, below), "-z", "sphere radius 5", 2.0),
        (cradle, "-z", "bore radius 5", 3.0),
        (plate, "-z", "face top", 20.0),  # not to its bore
    ):
        assert fo.Size("h", "movable", faces=face).dimensions(body) == pytest.approx({name: height}, rel=1e-6)
    rocker, faces = fo.cut(rod, below), "cylinder radius 5"
    lifted, wider = fo.Size("crown", "movable", faces=faces, along="-z"), fo.Size("r", "movable", faces=faces)
    foot = fo.Size("h", "movable", faces="-z")
    assert foot.dimensions(rocker, {lifted: -0.1, wider: 0.05, foot: 0.2}) == pytest.approx({faces: 2.35})
    assert length(fo.Size("h", "movable", scale="z"), rod) == pytest.approx(10.0)


def test_a_round_end_is_no_other_end_of_the_flats_that_it_joins() -> None:
    """A feather key of 8: from one flat to the other, and of flats and ends together 8 as well."""
    key = fo.joined(*feather(8.0, "key"), name="key")
    assert fo.Size("b", "movable", faces="+y").dimensions(key) == {"face front": 8.0}
    ends = [name for name in names_of_rows(key) if " radius " in name]
    every = fo.Size("b", "movable", faces=["+y", "-y", *dict.fromkeys(ends)], each=0.5)
    assert every.dimensions(key) == pytest.approx({"": 8.0})


def test_the_height_of_a_channel_was_measured_to_the_underside_of_its_rail() -> None:
    """Across the room that a face looks into, or through the material behind it: not to just any face of its kind."""
    rail = fo.cut(
        fo.Box((40, 60, 20), centre=(0, 0, 10)),
        fo.Box((20, 80, 6.2), centre=(0, 0, 8.1)),
        fo.Box((8, 80, 20), centre=(0, 0, 20)),
    )
    lips = [{"through": (x, 0, 11.2)} for x in (-7, 7)]
    assert length(fo.Size("channel", "static", faces=lips, each=[-1, -1]), rail) == pytest.approx(6.2)
    assert length(fo.Size("lips", "static", faces=lips, each=[1, 1]), rail) == pytest.approx(8.8)
    tray = fo.cut(fo.Box((60, 38, 20), centre=(0, 0, 10)), fo.Box((56, 36, 20), centre=(0, 0, 12)))
    wall = {"through": (0, 18, 10)}
    assert length(fo.Size("width within", "static", faces=wall, each=-1), tray) == pytest.approx(36.0)
    assert length(fo.Size("wall", "static", faces=wall, each=1), tray) == pytest.approx(1.0)


def test_a_tongue_measured_as_much_as_the_part_that_it_stands_on() -> None:
    """6 high and wide, on a block of 10: not 16, to the far side of the block; and along other axes alike."""
    ends = (-8, 8, 0, 20, 0, 10), (-3, 3, 0, 20, -6, 0)
    block, tongue = ([*product(own[:2], own[2:4], own[4:])] for own in ends)
    places = (0, 10, -6), (3, 10, -3), (8, 10, 5), (0, 10, 10)
    for turned in (np.eye(3), np.eye(3)[[1, 2, 0]]):
        part = fo.Body.from_parts([np.array(own) @ turned.T for own in (block, tongue)])
        faces = [{"through": tuple(turned @ place)} for place in places]
        found = [length(fo.Size("own", "movable", faces=face), part) for face in faces]
        assert found == pytest.approx([6.0, 6.0, 16.0, 10.0])
    aslant = [(x, y, z) for y in (0, 20) for x, z in ((3, 0), (3, -6), (-1, -6), (-3, 0))]
    side = fo.Size("side", "movable", faces={"through": (3, 10, -3)})
    assert not side.dimensions(fo.Body.from_parts([block, aslant]))  # no face across: its place alone
    socket = fo.cut(fo.Box((16, 20, 10)), fo.Box((6, 30, 8), centre=(0, 0, 5)))
    depth, thickness = (fo.Size("floor", "static", faces={"through": (0, 0, 1)}, each=each) for each in (-1, 1))
    assert (length(depth, socket), length(thickness, socket)) == pytest.approx((4.0, 6.0))


def test_the_height_of_a_tray_was_measured_from_its_floor() -> None:
    """A rim at 12 about a floor at 2: what moves the rim alone is the height of 12, not the depth of 10."""
    tray = fo.cut(fo.Box((30, 60, 12), centre=(0, 0, 6)), fo.Box((26, 56, 20), centre=(0, 0, 12)))
    height = fo.Size("height", "movable", faces={"through": (14, 0, 12)}, each=1)
    assert height.dimensions(tray) == pytest.approx({"face bottom": 12.0})


@pytest.mark.parametrize("goal", ["seat", "at", "touch"])
def test_a_stop_on_a_round_rod_lost_its_contact_at_another_diameter(goal: Any) -> None:
    # corners of a rod that is taken as round go with its cylinder: facets are not where their planes would be alone
    angles = 2.0 * np.pi * np.arange(64) / 64
    ring = 5.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    rod = fo.Body.convex(np.vstack([np.column_stack([ring, np.full(64, z)]) for z in (-15.0, 15.0)])).rounded()
    stop = box((-15, -6, -7), (-5, 6, 7))
    size = fo.Size("diameter", "static", faces=["cylinder radius 5"], each=0.5)
    asked = fo.Problem(stop, rod, sizes=[size], made={"diameter": -0.05}, goal=goal, motion=X)
    assert fo.solve(asked).parameters["TX"] == pytest.approx(0.025, abs=1e-14)


def test_the_loosest_slide_was_as_drawn_where_what_no_size_moves_lies_closer(tmp_path: Path) -> None:
    """A slide with 0.1 to floor and lips, as always, has most play to its sides where it is least and they are far."""
    walls = [box((-15, -20, -6), (-5.1, 20, 6)).vertices, box((5.1, -20, -6), (15, 20, 6)).vertices]
    rail = fo.Body.from_parts([*walls, box((-15, -20, -6), (15, 20, -2.1)).vertices], seed=(0, 0, 0), name="rail")
    slide = box((-5, -15, -2), (5, 15, 2), "slide")
    sizes = [
        fo.Size("slide", "movable", faces=["+x", "-x"], each=0.5, tolerance=0.05),
        fo.Size(
            "channel", "static", faces=[{"through": (x, 0, 0)} for x in (-5.1, 5.1)], each=-0.5, tolerance=(-0.02, 0.06)
        ),
    ]
    problem = fo.Problem(slide, rail, sizes=sizes, made="loosest", motion=X, goal="touch")
    assert problem.made == {"slide": -0.05, "channel": 0.06}
    assert fo.solve(problem).amount == pytest.approx(0.155, rel=1e-9)
    assert fo.stack_up(problem).worst().largest == pytest.approx(0.1, rel=1e-9)
    # one of the sizes of a corner is changed, the other stays
    from fcdm_opt.design.question import Question

    changed = Question.of(problem.changed(made="loosest")).changed({"made.channel": 0.01}).problem()
    assert changed.made == {"slide": -0.05, "channel": 0.01}


def test_where_elements_lie_was_looked_for_anew_at_each_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plate whose two holes' cuts meet: it was cut again at each diameter of one of them, .7 s, of which .2 s that.

    Its volume is that of prisms, and all that a part's elements are said to lie on is where they are.
    """
    located, own = list[int](), elements._located
    monkeypatch.setattr(elements, "_located", lambda *given: located.append(1) or own(*given))
    tools = [fo.Cylinder(5, 10, base=(x, 0, -2), facets=32) for x in (-20, 20)]
    plate = fo.cut(fo.Box((80, 40, 6), centre=(0, 0, 3)), *tools, name="plate")
    hole = fo.Size("hole", "movable", faces={"around": (-20, 0, 3), "axis": "z", "radius": 5}, each=0.5)
    thick = fo.Size("thick", "movable", faces="+z")
    plate = fit_for_sizes(plate, (hole, thick))
    size, known = plate.size, len(located)
    for k, (wider, higher) in enumerate(((0.02, 0.0), (-0.04, 0.0), (0.03, 0.01))):
        made = resized(plate, {hole.of_body("static"): wider, thick: higher})
        assert made is resized(plate, {hole: wider, thick: higher})
        assert made.faces == plate.faces
        radii = 5.0 - 0.5 * wider, 5.0
        area = 80.0 * 40.0 - 16.0 * math.sin(math.pi / 16.0) * float(np.square(radii).sum())
        told = sum(part.volume_and_centroid[0] for part in made.parts)
        assert told == pytest.approx(area * (6.0 + higher), rel=1e-12), k
        normals, points = made.face_planes
        for part, owners in zip(made.parts, made.facet_faces, strict=True):
            for f, rows in enumerate(owners):
                for row in rows:
                    assert (
                        np.abs((part.vertices[list(part.loops[f])] - points[row]) @ normals[row]).max() < 1e-12 * size
                    )
            for place, (own_row, drawn) in enumerate(zip(part.vertices, part.elements["V"], strict=True)):
                if drawn.kind == "V":
                    assert np.array_equal(made.vertices[drawn.vertices[0] - 1], own_row), place
        for part in made.parts:
            for span in part.elements.spans.values():
                known_points = {tuple(point) for point in made.vertices.tolist()}
                assert {tuple(point) for each in span.regions for point in each.reshape(-1, 3).tolist()} <= known_points
    assert len(located) == known


def test_parts_that_were_cut_again_at_another_diameter_changed_their_numbers() -> None:
    """A base with a spigot and two pins: what is told of a pair of its parts is of the same ones at all sizes."""
    pins = [fo.Cylinder(4.0, 12.0, base=(x, 0, -6)) for x in (-30, 30)]
    base = fo.joined(fo.Cylinder(50.0, 10.0, base=(0, 0, -10)), fo.Cylinder(20.0, 8.0, base=(0, 0, -6)), *pins)
    for number in (1, 2):
        size = fo.Size("pin", "static", faces=f"cylinder radius 4 no. {number}", each=0.5)
        for off in (-0.05, 0.05):
            made = resized(base, {size: off})
            assert len(made.parts) == len(base.parts)
            for part, drawn in zip(made.parts, base.parts, strict=True):
                assert np.abs(part.vertices.mean(axis=0) - drawn.vertices.mean(axis=0)).max() < 0.1


def test_the_worst_sizes_left_those_of_other_contacts_as_drawn() -> None:
    """A block against two walls is longer by 0.1 about its middle, and one wall stands out by 0.03: 0.05 and 0.03."""
    block, walls = (
        fo.Box((20, 10, 10), centre=(10, 5, 5), name="block"),
        fo.joined(fo.Box((5, 40, 10), centre=(-2.5, 0, 5)), fo.Box((40, 5, 10), centre=(20, -2.5, 5)), name="walls"),
    )
    for low, at in (-0.03, 0.03), (0.0, 0.03), (0.01, 0.03), (-0.03, -0.01):
        sizes = [
            fo.Size("length", "movable", faces=["+x", "-x"], each=0.5, tolerance=0.1),
            fo.Size("wall", "static", faces={"through": (30, 0, 5)}, tolerance=(low, at)),
        ]
        both = fo.Translation("x") >> fo.Translation("y")
        asked = fo.Problem(block, walls, motion=both, sizes=sizes, made="worst", goal="at", contacts="all")
        assert asked.made == pytest.approx({"length": 0.1, "wall": at})
        assert fo.solve(asked).amount == pytest.approx(math.hypot(0.05, at))
        parts, named = {"block": block, "walls": walls}, {"movable": "block", "static": "walls"}
        own = [replace(size, body=named[size.body]) for size in sizes]
        assembly = fo.Assembly(parts, [("block", "walls")], motions={"block": both}, sizes=own, made="worst")
        assert assembly.made == asked.made


@pytest.mark.parametrize("letters", ["H7", "g6", "20 H7", "20h6", "H7/g6", "20 H7/p6", "\u230020 JS7", "20,5 js6"])
def test_letters_of_a_fit_say_what_to_write(letters: str) -> None:
    with pytest.raises(
        fo.FcdmError, match=r"letters of a fit .* at 20 mm \[0.0, 0.021\] of H7, \[-0.020, -0.007\] of g6"
    ):
        fo.Size("bore", "static", faces="bore radius 10", each=-0.5, tolerance=letters)


def test_a_face_with_two_walls_opposite_was_measured_to_the_nearer_one() -> None:
    """A channel of 30: of the face x = 30 the wall of 5 is as much its size as the whole length is."""
    feet = (0, 30, 0, 10, 0, 5), (0, 5, 0, 10, 5, 15), (25, 30, 0, 10, 5, 15)
    channel = fo.Body.from_parts([list(product(own[:2], own[2:4], own[4:])) for own in feet])
    face = {"through": (30, 5, 7)}
    assert not fo.Size("place", "movable", faces=[face], tolerance=0.1).dimensions(channel)
    block = fo.Body.convex(list(product((0, 30), (0, 10), (0, 5))))
    found = fo.Size("length", "movable", faces=["+x"], tolerance=0.1).dimensions(block)
    assert found == pytest.approx({"face left": 30.0}, abs=1e-12)


def test_a_size_of_a_moved_body_is_told_to_name_labels() -> None:
    """Turned by a degree no face looks along x; the label of one that did moves as it does as drawn."""
    turn = np.eye(4)
    turn[:2, :2] = [[math.cos(0.02), -math.sin(0.02)], [math.sin(0.02), math.cos(0.02)]]
    body = fo.Box((10, 8, 6), name="block")
    label = f"F{int(body.face_planes[0][:, 0].argmax()) + 1}"
    with pytest.raises(fo.InputError, match="looks that way: of one moved name labels"):
        fo.Size("length", "movable", faces="+x").offsets(body.moved(turn))
    size = fo.Size("length", "movable", faces=label)
    assert size.offsets(body.moved(turn)).tolist() == size.offsets(body).tolist()


@pytest.mark.parametrize(
    ("made", "widths"),
    [
        ("worst", {"block": 0.0, "foot": 0.1, "channel": -0.3}),
        ("loosest", {"block": -0.5, "foot": -0.1, "channel": 0.8}),
    ],
)
def test_sizes_of_a_contact_that_is_never_the_nearest_were_as_drawn(made: str, widths: dict[str, float]) -> None:
    """A block on its floor, within 0.1, with 1 to either wall: these are nowhere the nearest, and take a side along."""
    walls = [box((-21, -10, -20), (-1, 130, 30)).vertices, box((51, -10, -20), (71, 130, 30)).vertices]
    channel = fo.Body.from_parts([*walls, box((-1, -10, -20), (51, 130, 0)).vertices], seed=(25, 60, 0), name="channel")
    sides = [{"through": (x, 60, 15)} for x in (-1, 51)]
    sizes = [
        fo.Size("block", "movable", faces=["+x", "-x"], each=0.5, tolerance=(-0.5, 0.0)),
        fo.Size("foot", "movable", faces="-z", tolerance=0.1),
        fo.Size("channel", "static", faces=sides, each=-0.5, tolerance=(-0.3, 0.8)),
    ]
    both = fo.Translation("x") >> fo.Translation("z")
    block = box((0, 0, 0), (50, 120, 40), "block")
    asked = fo.Problem(
        block, channel, sizes=sizes, made=made, motion=both, goal="clear", clearance=0.9, limits={"TZ": (0, 5)}
    )
    assert asked.made == pytest.approx(widths)
    # 0.85 to the walls at the worst sizes, which no lift makes 0.9; at the loosest 0.1 below the block, and 0.8 to go
    found = fo.solve(asked)
    assert not found.usable if made == "worst" else found.amount == pytest.approx(0.8, abs=1e-12)
    parts, named = {"block": block, "channel": channel}, {"movable": "block", "static": "channel"}
    own = [replace(size, body=named[size.body]) for size in sizes]
    assembly = fo.Assembly(parts, [("block", "channel")], motions={"block": both}, sizes=own, made=made)
    assert assembly.made == pytest.approx(widths)


def test_a_side_that_is_spelled_wrong_is_told_the_one_meant() -> None:
    with pytest.raises(fo.InputError, match=r"no face is named like this, did you mean 'left'\?"):
        fo.Size("width", "movable", faces="lft", tolerance=0.1)
