"""Clearances along one translation: against closed forms of boxes, the collision library and the march of the ray."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ordinary import box, corners
from strategies import generators, runs

import fcdm_opt as fo
from fcdm_opt.geometry.collision import ScaledPair
from fcdm_opt.model.task import Task
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages.order import STAGES

Box = tuple[np.ndarray, np.ndarray]


def random_box(rng: np.random.Generator) -> Box:
    low = rng.integers(-6, 6, 3).astype(float)
    return low, low + rng.integers(1, 6, 3)


def distance(one: Box, two: Box) -> float:
    """Of two boxes; 0 where they meet."""
    return math.hypot(*np.maximum(0.0, np.maximum(two[0] - one[1], one[0] - two[1])).tolist())


def least_clear(moving: Box, others: list[tuple[Box, float]], axis: int, limits: tuple[float, float]) -> float | None:
    """The least shift of all that end at a clearance of some box, or at a limit, or do not move."""
    unit = np.eye(3)[axis]
    places = {0.0, *limits}
    for (low, high), clearance in others:
        flat = [np.where(unit > 0, 0.0, end) for end in (moving[0], moving[1], low, high)]
        aside = distance((flat[0], flat[1]), (flat[2], flat[3]))  # in the other two axes
        ahead = math.sqrt(max(clearance**2 - aside**2, 0.0))
        places |= {(low - moving[1])[axis] - ahead, (high - moving[0])[axis] + ahead}
    for t in sorted(places, key=abs):
        moved = moving[0] + t * unit, moving[1] + t * unit
        overlaps = any((moved[0] < high - 1e-9).all() and (moved[1] > low + 1e-9).all() for (low, high), _ in others)
        near = any(distance(moved, other) < clearance - 1e-9 for other, clearance in others)
        if limits[0] <= t <= limits[1] and not overlaps and not near:
            return t
    return None


@runs(40)
@given(generators, st.sampled_from("xyz"), st.sampled_from([0.5, 1.0, math.sqrt(2.0), 5.0]), st.booleans())
def test_the_least_shift_of_boxes_that_keeps_clearances_is_found(rng, axis, clearance, limited):
    """Whole numbers: boxes slide by flush, or at just their clearance, faces, edges and corners ahead of each other."""
    moving, fixed = random_box(rng), [random_box(rng) for _ in range(int(rng.integers(1, 4)))]
    kept = [(random_box(rng), float(rng.choice([0.0, 1.0, 2.5]))) for _ in range(int(rng.integers(0, 3)))]
    limits = (-4.0, 3.0) if limited else (-99.0, 99.0)
    least = least_clear(moving, [*((own, clearance) for own in fixed), *kept], "xyz".index(axis), limits)
    solution = fo.solve(
        fo.Problem(
            fo.Body.convex(corners(*moving), name="block"),
            fo.Body.from_parts([corners(*own) for own in fixed], seed=(0, 0, 0), name="stop"),
            target=(1.0, 1.0),
            goal="clear",
            clearance=clearance,
            motion=fo.Translation(axis),
            limits={f"T{axis.upper()}": limits},
            keep_out=[fo.KeepOut(box(*own, f"post {k}"), clearance=need) for k, (own, need) in enumerate(kept)],
        )
    )
    if least is None:
        assert solution.status is Status.INFEASIBLE
        return
    assert solution.verified, solution.certificate
    assert solution.amount == pytest.approx(abs(least), abs=1e-9)
    assert solution.stage.startswith(("0:", "1:"))
    assert solution.lower_bound == solution.amount


def ellipsoids(rng: np.random.Generator, count: int) -> tuple[fo.Body, fo.Body]:
    points = rng.normal(size=(2, count, 3))
    one, two = points / np.linalg.norm(points, axis=2, keepdims=True) * rng.uniform(0.5, 1.5, (2, 1, 3))
    return fo.Body.convex(one, name="one"), fo.Body.convex(two + rng.uniform(-0.4, 0.4, 3), name="two")


def asked(one: fo.Body, two: fo.Body, clearance: float, axis: Any, **arguments: Any) -> fo.Problem:
    given = {"target": (1.05, 0.97), "goal": "clear", "clearance": clearance, "motion": fo.Translation(axis)}
    return fo.Problem(one, two, **given | arguments)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("count", "clearance"), [(8, 1e-6), (8, 0.05), (8, 1.0), (60, 1e-6), (60, 1.0), (400, 0.05)]
)
def test_hulls_are_too_near_up_to_the_least_shift_and_as_far_as_asked_there(count, clearance):
    rng = np.random.default_rng([count, int(1e6 * clearance)])
    one, two = ellipsoids(rng, count)
    axis = rng.normal(size=3)
    solution = fo.solve(asked(one, two, clearance, axis))
    assert solution.stage.startswith("1:")
    assert solution.lower_bound == solution.amount > 0.0
    shifts = np.append(np.linspace(-1.0, 1.0, 41)[1:-1], [1.0 - 1e-6, 1e-6 - 1.0, 1.0]) * solution.parameters["T"]
    transforms = np.tile(np.eye(4), (len(shifts), 1, 1))
    transforms[:, :3, 3] = shifts[:, None] * axis / np.linalg.norm(axis)
    found = ScaledPair(one, two).signed_distances([(1.05, 0.97)] * len(shifts), transforms)
    assert (found[:-1] < clearance).all()
    assert found[-1] == pytest.approx(clearance, abs=1e-10)


@pytest.mark.slow
def test_a_common_motion_and_swapped_bodies_change_no_clearance():
    rng = np.random.default_rng(7)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn * np.sign(np.linalg.det(turn)), (3.0, -40.0, 900.0)
    for _ in range(2):
        one, two = ellipsoids(rng, 30)
        least = fo.solve(asked(one, two, 0.1, "z"))
        moved = fo.solve(asked(one.moved(T), two.moved(T), 0.1, T[:3, 2]))
        swapped = fo.solve(asked(two, one, 0.1, "z", target=(0.97, 1.05)))
        assert moved.parameters["T"] == pytest.approx(least.parameters["TZ"], abs=1e-9)
        assert swapped.parameters["TZ"] == pytest.approx(-least.parameters["TZ"], abs=1e-9)


@pytest.mark.slow
def test_unions_among_keep_outs_keep_clearances_as_the_march_finds_them():
    rng = np.random.default_rng(3)
    for _ in range(12):
        movable, static = (
            fo.Body.from_parts([rng.normal(size=(9, 3)) + 1.5 * rng.normal(size=3) for _ in range(4)], seed=(0, 0, 0))
            for _ in range(2)
        )
        post = fo.KeepOut(fo.Body.convex(rng.normal([0, 0, 3], size=(9, 3)), name="post"), clearance=0.2)
        task = Task.of(asked(movable, static, 0.1, "z", keep_out=[post]))
        exact, marched = STAGES["straight"](task), STAGES["one parameter"](task)
        assert exact is not None
        assert marched is not None
        assert exact.amount == pytest.approx(marched.amount, abs=1e-9)
        assert exact.lower_bound == exact.amount >= marched.lower_bound - 1e-9


# ------------------------------------------------------------------------------ of contacts, where several are restored

X, Y, Z = (fo.Translation(axis) for axis in "xyz")


@pytest.mark.parametrize("limits", [(-25.0, 25.0), (-20.3, 20.3), (-20.1, 20.1)])
def test_a_part_carried_past_a_corner_was_kept_off_by_its_faces(limits):
    """A roof over two blocks as they rise: 20.5 sideways was taken for the least, and 20.3 for too little room.

    Where the top of the upper block ends .05 below the roof's, its edge is .5 away once it is sqrt(.5^2 - .45^2) past.
    """
    parts = [
        box((-30, -30, -10), (30, 30, 0), "base"),
        box((-15, -15, 0), (15, 15, 20), "block"),
        box((-10, -10, 20), (10, 10, 32), "top"),
    ]
    made = {"base height": 0.3, "block height": 0.1, "top height": 0.15}
    sizes = [fo.Size(name, name.split()[0], faces=["+z"], tolerance=0.5) for name in made]
    roof = fo.KeepOut(box((-10, -10, 33), (10, 10, 40), "roof"), clearance=0.5)
    asked = fo.Assembly(
        parts, [("block", "base"), ("top", "block")], sizes, {"block": Z >> X, "top": Z},
        made=made, limits={"block": {"TX": limits}}, keep_out=[roof],
    )  # fmt: skip
    solution, aside = fo.solve(asked), 20.0 + math.sqrt(0.5**2 - 0.45**2)
    if limits[1] < aside:
        assert solution.status is Status.INFEASIBLE
        return
    assert solution.usable
    assert solution.amount == pytest.approx(math.hypot(0.3, 0.1, aside), rel=1e-9)
    assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-9)


@pytest.mark.parametrize("goal", ["seat", "fit", "an assembly"])
@pytest.mark.parametrize(
    ("off", "least"),
    [([(0.1, 0.1)], 0.3 - math.hypot(0.1, 0.1)), ([(0.1, 0.15), (0.1, -0.15)], math.sqrt(0.0675) - 0.1)],
)
def test_corners_of_keep_outs_are_passed_as_near_as_is_asked(goal, off, least):
    """A block slides on a floor, away from the corner of a post so far off, or back from those of two."""
    posts = list[fo.KeepOut]()
    for k, (x, y) in enumerate(off):
        low, high = ((y + 1.0, 3.0) if y > 0.0 else (-3.0, y - 1.0))
        posts.append(fo.KeepOut(box((1.0 + x, low, 0.2), (3.0, high, 3.0), f"post {k}"), clearance=0.3))
    parts = [box((-1, -1, 0), (1, 1, 1), "block"), box((-9, -9, -1), (9, 9, 0), "floor")]
    if goal == "an assembly":
        asked = fo.Assembly(parts, [("block", "floor")], motions={"block": X >> Y >> Z}, keep_out=posts)
    else:
        given = {"target": (1.0, 1.0), "nominal": "drawn", "contacts": "all", "goal": goal}
        asked = fo.Problem(*parts, **given, motion=X >> Y >> Z, keep_out=posts)
    solution = fo.solve(asked)
    assert solution.usable, solution.certificate
    assert solution.amount == pytest.approx(least, rel=1e-8)
    assert solution.lower_bound == pytest.approx(least, rel=1e-8)


def test_corners_of_two_parts_that_both_move_keep_their_distance():
    """Each makes way by half of it; a cap of a ball, which polytopes within only come near to."""
    off, clearance = np.array([0.02, 0.1, 0.15]), 0.4
    parts = [box((-9, -9, -9), (9, 9, -8), "base"), box((0, 0, 0), (1, 1, 1), "one"), box(1.0 + off, 2.0 + off, "two")]
    contacts = [{"parts": ("one", "base"), "goal": "clear"}]
    contacts += [{"parts": ("one", "two"), "goal": "clear", "clearance": clearance}]
    follows = {"one": "base", "two": "base"}
    solution = fo.solve(fo.Assembly(parts, contacts, motions=dict.fromkeys(follows, X >> Y >> Z), follows=follows))
    least = (clearance - float(np.linalg.norm(off))) / math.sqrt(2.0)
    assert solution.usable
    assert solution.amount == pytest.approx(least, rel=1e-9)
    assert least * (1.0 - 1e-6) <= solution.lower_bound <= least * (1.0 + 1e-9)


def test_a_block_that_may_turn_either_way_past_a_corner_went_to_and_fro_between_the_two():
    """No motion was found. Turned by an angle it is away from the post's corner along a line: the least over angles."""
    post = fo.KeepOut(box((1.1, 1.1, 0.2), (3.0, 3.0, 3.0), "post"), clearance=0.3)
    parts = [box((-1, -1, 0), (1, 1, 1), "block", seed=(0, 0, 0)), box((-9, -9, -1), (9, 9, 0), "floor")]
    solution = fo.solve(
        fo.Problem(
            *parts, target=(1.0, 1.0), nominal="drawn", goal="seat", contacts="all",
            motion=X >> Y >> Z >> fo.Rotation("z"), keep_out=[post],
        )
    )  # fmt: skip
    angles = np.linspace(0.0, 0.2, 200_001)
    seen = 1.1 * np.array([np.cos(angles) + np.sin(angles), np.cos(angles) - np.sin(angles)])  # from the block
    shifts, length = 0.3 - np.hypot(*np.maximum(seen - 1.0, 0.0)), math.hypot(2, 2, 1) / 2.0
    assert solution.usable
    assert solution.amount == pytest.approx(np.hypot(shifts, length * angles).min(), rel=1e-7)


def test_a_fit_that_a_keep_out_holds_open_was_refused_by_the_judge():
    """A block on a floor, over a rib .05 high that is to be .05 away: open by .1, and a motion of more is refused."""
    rib = fo.KeepOut(box((-0.5, -0.5, 0.02), (0.5, 0.5, 0.05), "rib"), clearance=0.05)
    parts = [box((-1, -1, 0), (1, 1, 1), "block"), box((-9, -9, -1), (9, 9, 0), "floor")]
    given = {"target": (1.0, 1.0), "nominal": "drawn", "contacts": "all", "goal": "fit", "motion": Z}
    solution = fo.solve(fo.Problem(*parts, **given, keep_out=[rib]))
    assert solution.usable, solution.certificate
    assert solution.amount == pytest.approx(0.1)
    T = np.array(solution.transform)
    T[2, 3] += 0.05
    amount = dict.fromkeys(("amount", "amount_low", "amount_high"), solution.amount + 0.05)
    worse = replace(solution, transform=T, parameters={"TZ": 0.15}, pair_gap=0.15, **amount)
    assert "largest gap least" in {check.name for check in fo.verify(worse).failed}


@pytest.mark.parametrize("weights", [{}, {"TX": 2.0, "TZ": 0.5}])
def test_a_clearance_in_a_corner_by_three_shifts_had_no_proof(weights: dict[str, float]) -> None:
    """A cube grown by s, c clear of three walls: s + c along each, whatever the weights; a larger claim fails."""
    cube = fo.Box((2, 2, 2), centre=(1, 1, 1))
    walls = [fo.Box((5, 5, 1), centre=(2, 2, -0.5)), fo.Box((1, 5, 4), centre=(-0.5, 2, 1))]
    walls += [fo.Box((5, 1, 4), centre=(2, -0.5, 1))]
    asked = {"goal": "clear", "clearance": 0.1, "motion": X >> Y >> Z, "weights": weights}
    found = fo.solve(fo.Problem(cube, fo.joined(*walls), target=(1.02, 1.0), **asked))
    assert list(found.parameters.values()) == pytest.approx([0.12, 0.12, 0.12], abs=1e-9)
    assert fo.verify(found, proof=True).passed
    assert not fo.verify(replace(found, lower_bound=1.0001 * found.amount), proof=True).passed
