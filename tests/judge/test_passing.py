"""Motions through the other solid: told of whole solids, however they are cut, for two parts and for assemblies."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold, OpType
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.judge.certificate import verify_assembly
from fcdm_opt.judge.passing import passes
from fcdm_opt.problem.fit import verdict
from fcdm_opt.problem.solution import Status

CASES = Path(__file__).parents[1] / "cases"
UP = fo.Translation("z")


def triangles(solid: Manifold) -> tuple[np.ndarray, np.ndarray]:
    mesh = solid.to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64)


def made(solid: Manifold, decomposition: Any = "auto", **more: Any) -> fo.Body:
    return fo.Body.from_mesh(*triangles(solid), decomposition=decomposition, **more)


def drawn(name: str, **more: Any) -> fo.Body:
    return fo.Body.from_file(CASES / f"{name}.off", unit="mm", **more)


def cylinder(radius: float, low: float, high: float, sides: int = 64, turn: float = 0.0, top: Any = None) -> Any:
    solid = Manifold.cylinder(high - low, radius, radius if top is None else top, sides)
    return solid.rotate([0.0, 0.0, turn]).translate([0.0, 0.0, low])


def box(low: Any, high: Any) -> np.ndarray:
    return np.array([*product(*zip(low, high, strict=True))], float)


# ------------------------------------------------------------------------------------------------------ whole solids


@pytest.mark.parametrize("seed", range(2))
def test_what_passes_is_what_the_swept_solid_meets(seed: int) -> None:
    """A convex solid sweeps the hull of both ends; clear of the other at either, it passes where that meets it."""
    random = np.random.default_rng(seed)
    told, went = 0, 0
    while told < 60:
        other = Manifold.batch_boolean(
            [
                Manifold.cube([*random.uniform(0.05, 2.0, 3)])
                .rotate([*random.uniform(0, 90, 3)])
                .translate([*random.uniform(-1, 1, 3)])
                for _ in range(4)
            ],
            OpType.Add,
        )
        start = Manifold.sphere(random.choice([0.05, 0.3, 1.0]), 8).rotate([*random.uniform(0, 90, 3)])
        place = random.normal(size=3) * random.choice([0.7, 2.0])
        way = random.normal(size=3) - random.choice([0.3, 2.0]) * place
        start = start.translate([*place])
        end = start.translate([*way])
        if (start ^ other).volume() > 0.0 or (end ^ other).volume() > 0.0:
            continue
        swept = Manifold.batch_hull([start, end])
        common = (swept ^ other).volume()
        if 0.0 < common < 1e-6:
            continue  # grazes
        corners = [points[rows] for points, rows in (triangles(own) for own in (start, other))]
        found = passes((corners[0], corners[0] + way), (corners[1], corners[1]), way, 1e-6)
        assert found == (common > 0.0), (seed, told, common)
        told, went = told + 1, went + found
    assert 10 < went < 50, went


@pytest.mark.parametrize("decomposition", ["surface", "auto"])
def test_a_comb_kept_as_a_surface_was_moved_through_its_slots(decomposition: str) -> None:
    """Three teeth, together .005 too wide: the next slots are no place for them."""
    bodies = (drawn(name, decomposition=decomposition) for name in ("comb", "comb_slots"))
    solution = fo.solve(fo.Problem(*bodies, target=(1.0, 1.0), goal="clear", motion=UP))
    assert solution.parameters["TZ"] == pytest.approx(-3.99, abs=1e-9)
    assert solution.status is Status.OUTSIDE_FIT
    assert solution.advice.startswith("Does not fit: ")


@pytest.mark.slow
def test_pins_moved_within_their_holes_were_said_to_go_through_slivers_of_the_cut() -> None:
    bodies = (drawn(name) for name in ("pattern_pins", "pattern_plate"))
    motion = fo.Translation("x") >> fo.Translation("y")
    solution = fo.solve(fo.Problem(*bodies, target=(1.0, 1.0), goal="clear", motion=motion))
    assert solution.usable
    assert list(solution.parameters.values()) == pytest.approx([-0.33698, 0.18383], abs=1e-5)


@pytest.mark.slow
def test_a_nut_was_moved_one_thread_further_through_its_bolt() -> None:
    problem = fo.Problem(drawn("thread_nut"), drawn("thread_bolt"), target=(0.99, 1.0), goal="clear", motion=UP)
    solution = fo.solve(problem, effort="quick")
    assert solution.parameters["TZ"] == pytest.approx(1.73075, abs=1e-4)
    assert solution.status is Status.OUTSIDE_FIT


@pytest.mark.slow
@pytest.mark.parametrize("decomposition", ["surface", "auto"])
def test_a_countersunk_screw_may_rise_in_its_countersink(decomposition: str) -> None:
    """A cone of 90 degrees, larger by 2 %, rises by what its radius grows, and stays in the bore."""
    head = cylinder(3.0, -3.0, 0.0, 16, top=6.0) + cylinder(3.0, -20.0, -3.0, 16)
    sink = cylinder(3.3, -3.0, 0.1, 16, top=6.4) + cylinder(3.3, -7.0, -3.0, 16)
    plate = Manifold.cube([30.0, 30.0, 6.0]).translate([-15.0, -15.0, -6.0]) - sink
    screw, hole = (made(solid, decomposition, seed=np.zeros(3)) for solid in (head, plate))
    for motion in (UP,) if decomposition == "surface" else (UP, fo.Translation("x") >> UP):
        solution = fo.solve(fo.Problem(screw, hole, target=(1.06, 1.0), goal="clear", motion=motion))
        assert solution.usable
        assert 0.0 < solution.amount < 1.0
        assert solution.transform is not None
        at = [*solution.transform[:3, 3]]
        assert (head.scale([1.06] * 3).translate(at) ^ plate).volume() < 1e-6
        assert (head.scale([1.06] * 3).translate([0.95 * x for x in at]) ^ plate).volume() > 1e-4


@pytest.mark.sampled(1)
@pytest.mark.parametrize("decomposition", ["surface", "exact"])
def test_a_split_joint_kept_as_surfaces_was_drawn_through_itself(decomposition: str) -> None:
    """Round knobs in round sockets, as jigsaw pieces have: larger than these they go nowhere in the plane."""

    def knob(radius: float, neck: float) -> Manifold:
        bar = Manifold.cube([2.0 * neck, 6.0, 5.0]).translate([-neck, 0.0, 0.0])
        return cylinder(radius, 0.0, 5.0, 24).translate([0.0, 6.0, 0.0]) + bar

    lower = Manifold.cube([30.0, 10.0, 5.0]).translate([-15.0, -10.0, 0.0]) + knob(4.0, 2.0)
    upper = Manifold.cube([30.0, 20.0, 5.0]).translate([-15.0, 0.05, 0.0]) - knob(4.1, 2.1)
    one, two = (made(solid, decomposition, seed=(0.0, 0.0, 2.5)) for solid in (lower, upper))
    asked = {"goal": "clear", "motion": fo.Translation("y")}
    far = fo.solve(fo.Problem(one, two, target=(1.06, 1.0), **asked))
    assert far.transform is not None
    assert far.transform[1, 3] < -1.0
    assert far.status is Status.OUTSIDE_FIT
    near = fo.solve(fo.Problem(one, two, target=(1.01, 1.0), **asked))
    assert near.usable
    assert near.amount < 0.2


@pytest.mark.parametrize("decomposition", ["surface", "exact"])
def test_a_block_made_too_wide_was_lifted_out_of_a_channel_kept_as_a_surface(decomposition: str) -> None:
    """Of the channel only some parts are modelled as made, which were not told apart from others than those drawn."""
    solid = Manifold.cube([20.0, 20.0, 13.0]) - Manifold.cube([10.0, 22.0, 9.0]).translate([5.0, -1.0, 4.0])
    block, width = box((5, 0, 4.05), (15, 20, 13.05)), fo.Size("width", "movable", faces="+x", tolerance=0.2)
    asked = {"sizes": [width], "goal": "touch", "motion": fo.Translation("x") >> UP}
    channel = made(solid, decomposition, name="channel")
    for wider, status, lift in ((0.1, Status.OUTSIDE_FIT, 8.95), (-0.1, Status.ALREADY_SATISFIED, 0.0)):
        problem = fo.Problem(fo.Body.convex(block, name="block"), channel, made={"width": wider}, **asked)
        solution = fo.solve(problem)
        assert solution.status is status
        assert solution.parameters["TZ"] == pytest.approx(lift, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("radius", "turn", "sides"), [(10.0, 180.0 / 32.0, 32), (10.05, 0.0, 32), (10.05, 0.0, 24), (9.99, 0.0, 24)]
)
def test_a_shaft_that_overlaps_its_bore_by_a_hair_was_drawn_out_of_it(radius: float, turn: float, sides: int) -> None:
    plate = Manifold.cube([50.0, 50.0, 25.0]).translate([-25.0, -25.0, 0.0]) - cylinder(10.0, -1.0, 26.0, sides)
    shaft, bore = made(cylinder(radius, -5.0, 25.0, 32, turn), name="shaft"), made(plate, name="plate")
    asked = {"tolerance": 0.02, "goal": "clear", "motion": UP}
    for requirement in "B" if radius != 10.05 else "D":
        solution = fo.solve(fo.Problem(shaft, bore, requirement=requirement, **asked), effort="quick")
        assert abs(solution.parameters["TZ"]) > 20.0
        assert solution.status is Status.OUTSIDE_FIT
        assert "shaft" in solution.advice


# ------------------------------------------------------------------------------------------------- judged, assemblies


def peg_and_plate() -> tuple[fo.Body, fo.Body]:
    """A peg in a hole through a plate, .05 wider all round, .5 above the plate's lower side."""
    w = 1.05
    walls = [((-5, -5, 0), (-w, 5, 2)), ((w, -5, 0), (5, 5, 2)), ((-w, -5, 0), (w, -w, 2)), ((-w, w, 0), (w, 5, 2))]
    plate = fo.Body.from_parts([box(*wall) for wall in walls], seed=(0, 0, 1), name="plate")
    return fo.Body.convex(box((-1, -1, 0.5), (1, 1, 4)), seed="box", name="peg"), plate


@pytest.mark.parametrize("axis", ["x", "z"])
def test_a_status_outside_the_fit_was_relabelled_and_passed(axis: str) -> None:
    asked = {"goal": "touch", "motion": fo.Translation(axis)}
    for target, status in (((1.1, 1.0), "OUTSIDE_FIT"), ((1.02, 1.0), "SOLVED")):
        solution = fo.solve(fo.Problem(*peg_and_plate(), target=target, **asked))
        if axis == "z" and status == "SOLVED":
            continue  # nothing to touch in the hole
        assert solution.status.name == status
        assert fo.verify(solution).passed
        for name in {"SOLVED", "OUTSIDE_FIT", "PAIR_OVERLAPS", "ALREADY_SATISFIED"} - {status}:
            forged = replace(solution, status=Status[name])
            certificate = fo.verify(forged)
            assert [check.name for check in certificate.failed] == ["status"]
            assert not forged.with_certificate(certificate, {}).usable


def assembly(scale: float, goal: str, axis: str) -> fo.Assembly:
    peg, plate = peg_and_plate()
    contact = {"parts": ["peg", "plate"], "goal": goal}
    motions = {"peg": fo.Translation(axis)}
    return fo.Assembly({"peg": peg, "plate": plate}, [contact], motions=motions, scales={"peg": scale})


@pytest.mark.parametrize("goal", ["touch", "clear"])
@pytest.mark.parametrize("axis", ["x", "z"])
def test_a_part_of_an_assembly_was_drawn_out_of_its_place_as_a_success(goal: str, axis: str) -> None:
    solution = fo.solve_assembly(assembly(1.1, goal, axis))
    assert solution.status is Status.OUTSIDE_FIT
    assert not solution.usable
    assert solution.advice.startswith("peg leaves the place in which it is drawn in plate. ")
    assert verify_assembly(solution).passed
    forged = replace(solution, status=Status.SOLVED)
    assert "status" in [check.name for check in verify_assembly(forged).failed]


def test_a_motion_of_an_assembly_within_its_fit_is_not_said_to_leave_it() -> None:
    solution = fo.solve_assembly(assembly(1.02, "touch", "x"))
    assert abs(solution.parameters["peg"]["TX"]) == pytest.approx(1.05 - 1.02, abs=1e-9)
    assert solution.status is Status.SOLVED
    assert verify_assembly(solution).passed
    forged = replace(solution, status=Status.OUTSIDE_FIT)
    assert [check.name for check in verify_assembly(forged).failed] == ["status"]


def test_a_part_that_goes_through_one_it_has_no_contact_with_is_told() -> None:
    """The peg stands in the plate's hole, and is to touch a block beside the plate."""
    peg, plate = peg_and_plate()
    block = fo.Body.convex(box((9, -1, 0), (10, 1, 4)), name="block")
    parts = {"peg": peg, "plate": plate, "block": block}
    asked = fo.Assembly(parts, [{"parts": ["peg", "block"], "goal": "touch"}], motions={"peg": fo.Translation("x")})
    solution = fo.solve_assembly(asked)
    assert solution.status is Status.OUTSIDE_FIT
    assert solution.advice.startswith("peg leaves the place in which it is drawn in plate. ")


@pytest.mark.slow
def test_a_draft_of_a_shaft_that_overlaps_its_bore_by_a_hair_named_no_width_and_did_not_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """64 corners in a bore of 48 of the same radius: taken as round they are line to line."""
    plate = Manifold.cube([50.0, 50.0, 25.0]).translate([-25.0, -25.0, 0.0]) - cylinder(10.0, -1.0, 26.0, 48)
    for name, solid in (("shaft", cylinder(10.0, -5.0, 25.0)), ("plate", plate)):
        points, rows = triangles(solid)
        lines = [f"OFF\n{len(points)} {len(rows)} 0", *(" ".join(map(repr, own)) for own in points.tolist())]
        lines += [f"3 {a} {b} {c}" for a, b, c in rows.tolist()]
        (tmp_path / f"{name}.off").write_text("\n".join(lines) + "\n")
    args = [str(tmp_path / "shaft.off"), str(tmp_path / "plate.off"), "--out", str(tmp_path / "fit.toml")]
    monkeypatch.setattr("fcdm_opt.drafting.choice.SHORT", 0.5)  # for what does not fit: nothing is found of it
    found = CliRunner().invoke(app, ["init", *args, "--unit", "mm"])
    words = " ".join(found.output.split())
    assert "Does not fit: shaft 20.40 mm in plate 19.60 mm, across the bore of radius 10 of plate" in words
    assert "move the movable part in the drawing" not in words
    assert "3 of 4 cases solved and verified" in words
    assert words.count("Does not fit: shaft") == 1


def test_a_box_drawn_a_hair_into_a_floor_of_tiles_may_be_lifted_by_that() -> None:
    """Tiles side by side look as if they held the box between them."""
    edges = (-5.0, -0.99, 0.99, 5.0)
    tiles = [box((a, -5.0, -1.0), (b, 5.0, 0.0)) for a, b in pairwise(edges)]
    floor = fo.Body.from_parts(tiles, seed=(0.0, 0.0, -0.5), name="floor")
    block = fo.Body.convex(box((-1.0, -1.0, -0.01), (1.0, 1.0, 2.0)), name="block")
    for goal in ("touch", "clear"):
        solution = fo.solve(fo.Problem(block, floor, target=(1.0, 1.0), goal=goal, motion=UP))
        assert solution.parameters["TZ"] == pytest.approx(0.01, abs=1e-9)
        assert solution.usable
        far = fo.solve(fo.Problem(block, floor, target=(1.0, 1.0), goal="clear", clearance=3.0, motion=UP))
        assert far.usable
        assert not verdict(far.problem)


# --------------------------------------------------------------------------------------- parts that overlap as drawn


def test_a_plug_drawn_too_deep_in_its_funnel_was_said_to_go_through_it() -> None:
    """Walls of slope .4 : 1, the plug .2 too wide there and .3 off centre: it comes to the middle, and .2 / .4 up."""
    tip, rim = (box((-r, -r, z), (r, r, z))[::2] for r, z in ((2.0, -3.0), (12.0, 22.0)))
    bore = fo.Body.convex(np.concatenate([tip, rim]))
    funnel = fo.cut(fo.Box((30, 30, 22), centre=(0, 0, 11)), bore, name="funnel")
    tip, rim = (box((0.3 - r, -r, z), (0.3 + r, r, z))[::2] for r, z in ((2.0, -3.5), (10.0, 16.5)))
    plug = fo.Body.convex(np.concatenate([tip, rim]))
    motion = fo.Translation("x") >> UP
    solution = fo.solve(fo.Problem(plug, funnel, target=(1.0, 1.0), goal="clear", motion=motion))
    assert list(solution.parameters.values()) == pytest.approx([-0.3, 0.5], abs=1e-9)
    assert solution.status is Status.SOLVED


@pytest.mark.parametrize("cuts", [(), (0.0,), (-0.2, 0.1)])
@pytest.mark.parametrize("deep", [0.0, 0.4])
def test_a_peg_goes_through_a_slab_however_deep_it_is_drawn_in_it(cuts: tuple[float, ...], deep: float) -> None:
    """Out below by all of 50, and out above by `deep`; a cut of the slab that the peg is less deep in is no wall."""
    ends = pairwise((-9.0, *cuts, 9.0))
    slab = fo.Body.from_parts([box((low, -9.0, -20.0), (high, 9.0, 0.0)) for low, high in ends], name="slab")
    peg = fo.Body.convex(box((-0.3, -0.3, -deep), (0.3, 0.3, 30.0)))
    for limits, way in (((-60.0, -1e-3), -50.0), ((-60.0, 60.0), deep)):
        asked = fo.Problem(peg, slab, target=(1.0, 1.0), goal="clear", motion=UP, limits={"TZ": limits})
        solution = fo.solve(asked)
        assert solution.parameters["TZ"] == pytest.approx(way, abs=1e-9)
        assert (solution.status is Status.OUTSIDE_FIT) == (way < 0.0)
