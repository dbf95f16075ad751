"""Whole solids: containment, nesting and depth, whatever convex parts a body is kept as."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import fcdm_opt as fo
from fcdm_opt.drafting.draft import draft, state_text
from fcdm_opt.drafting.situation import Situation
from fcdm_opt.geometry.measures import winding_numbers
from fcdm_opt.geometry.solids import PlacedSolids, contains, located
from fcdm_opt.show.sections import Touching

CASES = Path(__file__).parents[1] / "cases"
ONES = np.ones(2)


def ball(radius, subdivisions, name="ball", centre=(0, 0, 0)):
    """A ball with a thorn at -x, kept as its surface."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    points = np.array(mesh.vertices)
    points[points[:, 0].argmin()] *= 1.3
    body = fo.Body.from_mesh(
        points + centre, np.array(mesh.faces), decomposition="surface", seed=np.array(centre, float), name=name
    )
    assert body.is_surface
    return body


def box(half, centre=(0, 0, 0), name="box", sides=0):
    """A box; of so many sides along each edge and kept as its surface where these are told."""
    mesh = trimesh.creation.box(extents=2.0 * np.broadcast_to(half, 3))
    for _ in range(sides):
        mesh = mesh.subdivide()
    vertices = np.array(mesh.vertices) + centre
    kept = {"decomposition": "surface"} if sides else {}
    return fo.Body.from_mesh(vertices, np.array(mesh.faces), seed=centre, name=name, **kept)


def frame(half, inner, name="frame", **kept):
    """A square ring along z: a box with a square hole, not convex."""
    whole = trimesh.creation.box(extents=2.0 * np.array(half))
    made = whole.difference(trimesh.creation.box(extents=2.0 * np.array(inner)), engine="manifold")
    return fo.Body.from_mesh(np.array(made.vertices), np.array(made.faces), name=name, **kept)


def shifted(*by):
    pose = np.eye(4)
    pose[:3, 3] = by
    return pose


def test_points_are_located_exactly_on_edges_walls_and_corners():
    rng = np.random.default_rng(1)
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=10)
    points, corners = np.round(rng.uniform(-11, 11, (1500, 3)), 0), np.round(np.array(mesh.vertices), 1)[mesh.faces]
    found = located(points, corners)
    assert (found.winding == np.round(winding_numbers(points, corners)))[~found.on].all()
    assert located(corners[:, 0], corners).on.all()
    cube = np.array(trimesh.creation.box(extents=[2, 2, 2]).triangles)  # walls along z, points above their edges
    grid = np.stack(np.meshgrid(*[np.linspace(-2, 2, 9)] * 3), axis=-1).reshape(-1, 3)
    reach = np.abs(grid).max(axis=1)
    at = located(grid, cube)
    assert (at.on == (reach == 1)).all()
    assert (at.inside == (reach < 1)).all()


def test_a_point_by_one_digit_off_a_slanted_face_is_on_its_side():
    body = fo.Body.convex([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], seed=(0, 0, 0))
    third = np.array([0.25, 0.25, 0.5])  # on x + y + z = 1 exactly
    points = np.array([third, np.nextafter(third, 0), np.nextafter(third, 1)])
    assert contains(body, points).tolist() == [False, True, False]


@pytest.mark.parametrize("subdivisions", [1, 2])
@pytest.mark.parametrize("place", [(0, 0, 0), (0, 0, 3), (2, 1, 4)])
def test_a_cube_in_the_middle_of_a_surface_body_is_inside(subdivisions, place):
    big, cube = ball(10, subdivisions), box(1)
    pair = PlacedSolids(cube, big, ONES, shifted(*place))
    assert pair.nested == 1
    assert pair.distance > 0
    assert PlacedSolids(big, cube, ONES, shifted(*-np.array(place))).nested == 1
    assert PlacedSolids(cube, big, ONES, shifted(0, 0, 12)).nested == 0


@pytest.mark.slow
@pytest.mark.parametrize("refined", [1, 3])
def test_depth_of_surface_bodies_does_not_fall_with_refinement(refined):
    """A box .5 wide of sides 4 stands 1.5 deep in one of 20; in the middle of it 10 + 2 deep."""
    block, peg = box(10, sides=refined), box((2, 2, 4), sides=refined)
    assert PlacedSolids(peg, block, ONES, shifted(0, 0, 12.5)).depth == pytest.approx(1.5, rel=1e-6)
    assert PlacedSolids(peg, block, ONES, shifted(0, 0, 14)).depth == 0
    assert PlacedSolids(peg, block, ONES, shifted(1, 0, 0)).depth == pytest.approx(11, rel=1e-6)
    assert PlacedSolids(peg, block, np.array([0.5, 2.0]), shifted(0, 0, 21)).depth == pytest.approx(1, rel=1e-6)


def test_how_deep_parts_overlap_was_worked_out_to_tell_that_they_do_not_touch(monkeypatch):
    lid, ring = box((2, 2, 1)), frame((3, 3, 1), (1, 1, 2), decomposition="surface")
    assert ring.is_surface
    for high, asked in ((1.5, False), (2.0, True), (2.5, False)):
        curve = fo.decision_curve(lid, ring, transform=shifted(0, 0, high))
        with monkeypatch.context() as patched:
            patched.setattr(PlacedSolids, "depth", property(lambda _: pytest.fail("worked out")))
            assert (curve.locate((1.0, 1.0)) is not None) == asked
        assert float(curve.gap((1.0, 1.0))) == pytest.approx(high - 2.0, abs=1e-9)


@pytest.mark.slow
def test_depth_of_balls_converges_to_the_closed_form():
    """Radii less the distance of their centres, that of one inside the other too."""
    for subdivisions, off in ((1, 0.28), (2, 0.07)):
        big, small = ball(10, subdivisions), ball(3, subdivisions)
        for place in ((0, 0, 12), (0, 3, 6), (0, 4, 0)):
            depth = PlacedSolids(small, big, ONES, shifted(*place)).depth
            exact = 13 - np.linalg.norm(place)
            assert exact - 13 * off <= depth <= exact + 1e-9


def test_depth_of_a_peg_tight_all_round_is_that_of_its_walls():
    """20.04 in 20, square: .02 on either side; pushed by .01 to one side .03 deep there."""
    peg = box((10.02, 10.02, 20), sides=1)
    for kept in ("exact", "surface"):
        ring = frame((30, 30, 10), (10, 10, 11), decomposition=kept)
        assert PlacedSolids(peg, ring, ONES, np.eye(4)).depth == pytest.approx(0.02, rel=1e-6)
        assert PlacedSolids(peg, ring, ONES, shifted(0.01, 0, 0)).depth == pytest.approx(0.03, rel=1e-6)
        small = box(9.0)
        inside = PlacedSolids(small, ring, ONES, np.eye(4))
        assert inside.nested == 0
        assert inside.depth == 0


# ------------------------------------------------------------------------------------------- what asks whole solids


@pytest.mark.slow
def test_the_gap_of_a_cube_in_the_middle_of_a_surface_body_was_positive():
    big, cube = ball(10, 1), box(1)
    for one, two in ((cube, big), (big, cube)):
        curve = fo.decision_curve(one, two)
        assert curve.gap((1, 1)) == pytest.approx(-11, rel=0.1)
        assert curve.status == "overlapping"
        assert curve.distance((1, 1)) == 0
        assert fo.decision_curve(one, two, transform=shifted(0, 0, 15)).gap((1, 1)) == pytest.approx(4, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("goal", "up", "turned", "subdivisions"), [("clear", 0, False, 1), ("touch", 0, True, 1), ("clear", 3, True, 1)]
)
def test_a_cube_in_the_middle_of_a_surface_body_was_clear_of_it(goal, up, turned, subdivisions):
    """Out along z: 10 and half of the cube less what it is up already; the vertex at the pole is one of the mesh."""
    bodies = box(1, (0, 0, up)), ball(10, subdivisions)
    asked = fo.Problem(*bodies[:: -1 if turned else 1], target=(1, 1), goal=goal, motion=fo.Translation("z"))
    solution = fo.solve(asked)
    assert solution.certificate.passed
    assert solution.amount == pytest.approx(11 - up, rel=1e-9)
    assert solution.problem.keep_out == ()
    assert solution.problem.movable is asked.movable


def test_a_surface_body_was_moved_over_a_keep_out_into_its_middle():
    """A ball of 10 onto a plate at -29 would hold a cube at -20; below it goes its top is at -31."""
    about = fo.KeepOut(box(1, (0, 0, -20)), name="cube")
    asked = {"target": (1, 1), "motion": fo.Translation("z"), "keep_out": [about]}
    found = fo.solve(fo.Problem(ball(10, 2), box((5, 5, 1), (0, 0, -30)), goal="touch", **asked))
    assert found.certificate.passed
    assert found.parameters["TZ"] == pytest.approx(-41, rel=1e-9)


@pytest.mark.slow
def test_a_keep_out_kept_as_a_surface_was_clear_of_a_part_in_its_middle():
    """Clear of a plate 9 below by staying: upwards out of a ball of 8 about the part, 9; onto the plate within another
    ball no way leads."""
    plate, part = box((5, 5, 1), (0, 0, -30)), box(1, (0, 0, -20))
    asked = {"target": (1, 1), "motion": fo.Translation("z")}
    about = fo.KeepOut(ball(8, 1, centre=(0, 0, -20)), name="ball")
    out = fo.solve(fo.Problem(part, plate, goal="clear", keep_out=[about], **asked))
    assert out.usable
    assert out.amount == pytest.approx(9, rel=1e-9)
    below = fo.KeepOut(ball(8, 1, centre=(0, 0, -35)), name="ball")
    assert fo.solve(fo.Problem(part, plate, goal="touch", keep_out=[below], **asked)).status.name == "INFEASIBLE"
    grows = fo.KeepOut(ball(8, 1, centre=(0, 0, -20)), (0.9, 1.1), clearance=0.5, name="ball")
    out = fo.solve(fo.Problem(part, plate, goal="clear", keep_out=[grows], **asked))
    assert out.usable
    assert out.amount == pytest.approx(8.8 + 1 + 0.5, rel=0.02)


def test_the_judge_refuses_a_motion_into_the_middle_of_a_keep_out_or_partner():
    plate, part = box((5, 5, 1), (0, 0, -30)), box(1, (0, 0, -20))
    asked = {"target": (1, 1), "goal": "touch", "motion": fo.Translation("z")}
    free = fo.solve(fo.Problem(part, plate, **asked))
    assert free.usable
    barred = fo.Problem(part, plate, keep_out=[fo.KeepOut(ball(8, 2, centre=(0, 0, -25)), name="ball")], **asked)
    failed = {check.name: check for check in fo.verify(replace(free, problem=barred)).failed}
    assert failed["keep-out 'ball': clearance"].value < -3
    cube, big = box(1), ball(10, 2)
    apart = fo.solve(fo.Problem(cube.moved(shifted(0, 0, 20)), big, target=(1, 1), goal="clear", motion=fo.Free()))
    inside = fo.Problem(cube, big, target=(1, 1), goal="clear", motion=fo.Free())
    failed = {check.name for check in fo.verify(replace(apart, problem=inside)).failed}
    assert {"pair state", "inside", "clearance"} <= failed


@pytest.mark.slow
def test_a_third_part_of_an_assembly_in_the_middle_of_a_surface_body_was_let_pass():
    parts = {"plate": box((5, 5, 1), (0, 0, -30)), "part": box(1, (0, 0, -20))}
    asked = {"contacts": [{"parts": ("part", "plate"), "goal": "touch"}], "motions": {"part": fo.Translation("z")}}
    alone = fo.solve_assembly(fo.Assembly(parts, **asked))
    assert alone.usable
    assert alone.amount == pytest.approx(8)
    for third in (ball(6, 3, "ball", (0, 0, -35)), box(6, (0, 0, -35), "ball", sides=2)):
        found = fo.solve_assembly(fo.Assembly({**parts, "ball": third.moved(shifted(0, 0, 7))}, **asked))
        assert not found.usable
        if found.certificate is not None and found.status.found:
            assert any(check.value < -1 for check in found.certificate.failed)


def read(name, **kept):
    return fo.Body.from_file(CASES / name, unit="mm", **kept)


@pytest.mark.slow
def test_the_gap_of_surface_bodies_was_that_of_the_parts_modelled():
    """An arm 50.08 x .9985 above a table at 50; gears 379.749 um apart by a collision library on the raw meshes."""
    arm = read("arm.off", seed=(0, 0, 10), decomposition="surface")
    table = read("arm_table.off", seed=(0, 0, -10), decomposition="surface")
    asked = {"goal": "clear", "motion": fo.Translation("z")}
    found = fo.solve(fo.Problem(arm, table, target=(1, 0.9985), **asked))
    assert found.usable
    assert found.pair_gap == pytest.approx(50.08 * 0.9985 - 50, abs=1e-9)
    pinion, wheel = (read(f"{name}_b0.stl") for name in ("pinion", "wheel"))
    asked["motion"] = fo.Translation("x")
    found = fo.solve(fo.Problem(pinion, wheel, tolerance=0.02, requirement="D", **asked))
    assert found.usable
    assert found.pair_gap == pytest.approx(0.379749, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("finer", [False, True])
def test_depth_of_an_overlap_with_a_scan_halved_with_each_refinement(finer):
    """Cubes of 2, one of them scanned with a noise of 4e-4, 1.5 deep along x as drawn."""
    movable, static = read("scan_box.stl"), read("scan3.stl")
    if finer:
        mesh = trimesh.load(CASES / "scan3.stl").subdivide()
        rough = np.random.default_rng(0).normal(0.0, 1e-4, (len(mesh.vertices), 3))
        static = fo.Body.from_mesh(np.array(mesh.vertices) + rough, np.array(mesh.faces), name="scan4")
    assert static.is_surface
    situation = Situation(movable, static, "mm")
    assert situation.state == "overlapping"
    assert situation.gap == pytest.approx(-1.5, abs=1e-3)
    assert "overlap by 1.5 mm" in state_text(situation, "mm")


@pytest.mark.slow
def test_an_overlap_of_parts_of_many_triangles_was_said_to_touch():
    """Blocks on each other with waves of 1e-3, one of them with a bar below that reaches .02 into the other."""
    steps = np.linspace(-10, 10, 21)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    count = len(steps)
    grid = np.arange(count * count).reshape(count, count)
    quads = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=-1).reshape(-1, 4)
    lower = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    rim = np.concatenate([grid[:, 0], grid[-1, 1:], grid[-2::-1, -1], grid[0, -2:0:-1]])

    def block(heights, far):
        """Between a surface z = heights and the plane z = far."""
        points = np.concatenate([np.stack([x, y, heights], axis=-1).reshape(-1, 3), [[0, 0, far]]])
        below = np.stack([x.ravel()[rim], y.ravel()[rim], np.full(len(rim), far)], axis=1)
        first, after = len(points) + np.arange(len(rim)), len(points) + np.roll(np.arange(len(rim)), -1)
        ahead = np.roll(rim, -1)
        sides = np.concatenate([np.stack([rim, first, ahead], axis=1), np.stack([ahead, first, after], axis=1)])
        cap = np.stack([np.full(len(rim), count * count), after, first], axis=1)
        faces = np.concatenate([lower, sides, cap])
        return np.concatenate([points, below]), faces if far < heights.min() else faces[:, ::-1]

    waves = 1e-3 * np.cos(3.0 * x) * np.cos(2.0 * y)
    for deep in (0.0, 0.02):
        bar = np.where((np.abs(x) <= 1) & (np.abs(y) <= 1), -deep, 0.0)
        made = [fo.Body.from_mesh(*block(waves, -5.0), name="low"), fo.Body.from_mesh(*block(waves + bar, 5.0))]
        situation = Situation(made[1], made[0], "mm")
        assert situation.state == ("overlapping" if deep else "touching")
        if deep:
            assert situation.gap == pytest.approx(-deep, abs=2e-4)


@pytest.mark.slow
def test_init_moved_a_pin_that_is_tight_all_round(tmp_path, monkeypatch):
    """20.02 in 20, as finely meshed: no small shift does, and after one of .01 the overlap is twice as large."""
    pin = trimesh.creation.cylinder(radius=10.01, height=40, sections=32)
    plate = trimesh.creation.box(extents=[40, 40, 10]).difference(
        trimesh.creation.cylinder(radius=10.0, height=30, sections=32), engine="manifold"
    )
    for name, mesh in (("pin", pin), ("plate", plate)):
        mesh.export(tmp_path / f"{name}.stl")
    monkeypatch.setattr("fcdm_opt.drafting.choice.SHORT", 0.5)  # for what does not fit: nothing is found of it
    made = draft(tmp_path / "pin.stl", tmp_path / "plate.stl", file=tmp_path / "p.toml")
    assert "overlap by" in " ".join(made.summary)
    assert "mend the sizes in the drawing" in made.text
    assert "move the movable part by" not in made.text
    assert "move the movable part in the drawing (CAD)" not in made.text


def test_an_apex_on_the_face_across_was_touched_as_a_corner_of_it() -> None:
    """The pyramid under a face of 2 x 4 is 2 deep: just what this plate is thick. Motions to there were refused."""
    ends = ((0, -1, -2), (2, 3, 0)), ((5, 0, 0), (6, 1, 1))
    mesh = trimesh.util.concatenate([trimesh.creation.box(bounds=own) for own in ends])
    plate = fo.Body.from_mesh(mesh.vertices, mesh.faces, decomposition="surface")
    apexes = plate.vertices[16:]
    assert len(apexes) == 12
    assert contains(plate, apexes).all()


def test_the_depth_of_a_crescent_was_a_third_too_small() -> None:
    """A pin off the middle of a hole .006 tighter: at least as far as they are apart and as their radii differ."""
    tight, off = 0.9942636558182489, np.array([0.0214822, 0.0274614, 0.0])
    pin = trimesh.creation.cylinder(radius=1.0, height=8.0, sections=34)
    hole = trimesh.creation.annulus(r_min=tight, r_max=2.0, height=8.6, sections=34)
    one, two = (
        fo.Body.from_mesh(np.array(mesh.vertices) + way, np.array(mesh.faces), decomposition="surface", seed=(0, 0, 0))
        for mesh, way in ((pin, off), (hole, 0.0))
    )
    least = 1.0 - tight + np.linalg.norm(off)
    assert 0.99 * least < PlacedSolids(one, two, ONES, np.eye(4)).depth < 1.05 * least


def test_of_parts_flush_and_overlapping_slivers_of_the_flush_faces_were_drawn(tmp_path):
    """A pin .06 aside in its bore, of single precision: .045 deep, 4 high; flush faces had slivers 25 long besides."""

    def pin(radius, low, high, x):
        made = trimesh.creation.cylinder(radius, height=high - low, sections=48)
        return made.apply_translation((x, 0, (low + high) / 2))

    def block(low, high, x, y):
        return trimesh.creation.box(bounds=[(-x, -y, low), (x, y, high)])

    rim = block(26, 30, 31.95, 21.95).difference(block(25, 30, 28, 18))
    lid = block(30, 36, 50, 30).union(rim).difference(pin(3.0, 28, 38, -41)).difference(pin(3.0, 28, 38, 41))
    case = block(0, 30, 50, 30).difference(block(3, 31, 32, 22)).union(pin(2.985, 20, 34, -41))
    case = case.union(pin(2.985, 20, 34, 41.06))
    bodies = list[fo.Body]()
    for name, mesh in (("lid", lid), ("case", case)):
        mesh.export(tmp_path / f"{name}.stl")
        bodies.append(fo.Body.from_file(tmp_path / f"{name}.stl", unit="mm"))
    overlap = Touching.overlap(*bodies)
    corners = np.vstack(overlap.pieces)
    assert (np.abs(corners - (41.03, 0, 32)).max(axis=0) < (3.1, 3.1, 2.0 + 1e-6)).all()
    assert np.ptp(corners[:, 2]) == pytest.approx(4.0, abs=1e-6)
    assert 0.9 * 0.0448 < np.linalg.norm(np.diff(overlap.across, axis=0)) < 0.0451
    assert (np.abs(overlap.across[:, 2] - 32.0) < 1.9).all()  # on no end face: a cut there showed one part alone


def test_overlap_of_a_dowel_was_drawn_all_along_the_flush_face_beside_it():
    """A dowel .05 aside in its bore, .03 deep: rounding left a sheet of the flush faces in one piece with that."""
    dowel = trimesh.creation.cylinder(3.99, sections=48, segment=((0, 0, -7), (0, 0, 3)))
    plate = trimesh.creation.box(bounds=((-30, -12, 0), (30, 12, 6)))
    hole = trimesh.creation.cylinder(4.01, sections=48, segment=((0, 0.05, -20), (0, 0.05, 20)))
    base = trimesh.creation.box(bounds=((-50, -25, -12), (50, 25, 0)))
    bodies = [
        fo.Body.from_mesh(np.array(mesh.vertices), np.array(mesh.faces))
        for mesh in (plate.union(dowel), base.difference(hole))
    ]
    for tilt in (0.0, 0.3):  # about x: the sheet may lie aslant
        turn = trimesh.transformations.rotation_matrix(tilt, (1, 0, 0))
        overlap = Touching.overlap(*(body.moved(turn) for body in bodies))
        assert np.ptp(np.vstack(overlap.pieces)[:, 0]) < 2 * 3.99
        assert 0.8 * 0.03 < np.linalg.norm(np.diff(overlap.across, axis=0)) < 0.0301
