"""Rotations searched, translations exact: bounds against random search and descent, closed forms, invariance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar, nnls
from strategies import random_rotation

import fcdm_opt as fo
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages import turns as turns_module
from fcdm_opt.stages.turns import least_over_turns, turns

X, Y, Z = (fo.Translation(axis) for axis in "xyz")
MOTIONS = [
    fo.Free(),
    X >> Y >> Z >> fo.Rotation("z"),
    fo.Rotation((1, 2, 3)) >> Z >> Y >> fo.Rotation("x") >> X,
    fo.Translation((1, 0.3, 0)) >> Y >> fo.Rotation("x") >> fo.Rotation("y") >> fo.Rotation("z") >> fo.Translation("z"),
]
BOX = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def hull(rng: np.random.Generator, count: int) -> np.ndarray:
    points = rng.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None] * rng.uniform(0.7, 1.3, 3)


def pair(seed: int, apart: bool) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    way = rng.normal(size=3)
    distance = rng.uniform(2.3, 4) if apart else rng.uniform(0.3, 1.5)
    one, two = (hull(rng, int(rng.integers(4, 13))) for _ in range(2))
    return one, two + distance * way / np.linalg.norm(way)


def task_of(one: Any, two: Any, motion: Any = None, goal: str = "touch", **more: Any) -> Task:
    bodies = [own if isinstance(own, fo.Body) else fo.Body.convex(own, name="body") for own in (one, two)]
    pairs = {"nominal": (1.0, 1.0), "target": (1.0, 1.0)}
    return Task.of(fo.Problem(*bodies, motion=motion or fo.Free(), goal=goal, **pairs, **more))


def turned_places(task: Task) -> tuple[list[int], list[int]]:
    kinds = [kind for _, kind in task.motion.parameters]
    return [k for k, kind in enumerate(kinds) if kind == "translation"], [
        k for k, kind in enumerate(kinds) if kind == "rotation"
    ]


def amount_at(task: Task, theta: np.ndarray, apart: bool) -> float:
    """The least amount at fixed angles, by facet directions and non-negative least squares."""
    shifts, spins = turned_places(task)
    q = task.rest.copy()
    q[spins] = theta
    still = task.transform(q)[:3, 3]
    moves = np.array([task.transform(q + np.eye(len(q))[k])[:3, 3] - still for k in shifts]).T / task.weights[shifts]
    turning = float(np.linalg.norm(task.weights[spins] * theta))
    _, rows, gaps = task.separations((0, 0), task.pose(q))
    ways, gaps = rows[:, :3] @ moves, gaps - task.need
    if gaps.max() <= 0:
        return float(np.hypot((-gaps / np.linalg.norm(ways, axis=1)).min(), turning))
    if not apart:
        return turning
    system, goal = np.vstack([ways.T, gaps / gaps.max()]), np.array([0, 0, 0, 1.0])
    rest = system @ nnls(system, goal)[0] - goal
    return float(np.hypot(np.linalg.norm(rest[:3] / rest[3]) * gaps.max(), turning))


@pytest.mark.sampled(5)
@pytest.mark.parametrize("motion", range(len(MOTIONS)))
@pytest.mark.parametrize("apart", [True, False])
def test_no_search_finds_less_than_the_bound(motion, apart):
    searched = 0
    for seed in range(6):
        rng = np.random.default_rng([seed, motion])
        chosen = MOTIONS[motion]
        weights = {p.name: float(rng.uniform(0.3, 3)) for p in chosen.parameters} if seed % 3 == 0 else None
        task = task_of(*pair(seed, apart), chosen, weights=weights)
        if (task.gap(task.rest) > 0) != apart:
            continue
        bound = least_over_turns(task, upper=None, gap=1e-3)
        assert bound.closed
        assert bound.lower <= bound.upper <= bound.lower * (1 + 1.1e-3)
        assert bound.upper == pytest.approx(task.amount(bound.q), rel=1e-12)
        assert task.meets(bound.q, 1e-9)
        spins = turned_places(task)[1]
        scale = bound.upper / task.weights[spins]
        starts = [rng.normal(size=len(spins)) * scale * rng.uniform(0, 1) for _ in range(12)]
        amounts = [amount_at(task, theta, apart) for theta in starts]
        best = starts[int(np.argmin(amounts))]
        options = {"maxiter": 60, "xatol": 1e-7, "fatol": 1e-9}
        found = minimize(lambda x: amount_at(task, x, apart), best, method="Nelder-Mead", options=options)  # noqa: B023
        assert bound.lower <= min(found.fun, *amounts) * (1 + 1e-12)
        searched += 1
    assert searched >= 4


@pytest.mark.slow
@pytest.mark.parametrize("apart", [True, False])
def test_one_rotation_agrees_with_a_fine_grid(apart):
    answered = 0
    for seed in range(20):
        task = task_of(*pair(100 + seed, apart), X >> Y >> Z >> fo.Rotation((1, seed, 2)))
        if (task.gap(task.rest) > 0) != apart:
            continue
        answer = turns(task)
        assert answer is not None
        assert answer.status is Status.SOLVED
        amount = task.amount(answer.q)
        end = amount / task.weights[3] * 1.01
        angles = np.linspace(-end, end, 200)
        values = [amount_at(task, np.array([x]), apart) for x in angles]
        k = int(np.argmin(values))
        near = (angles[max(k - 1, 0)], angles[min(k + 1, 199)])
        found = minimize_scalar(
            lambda x: amount_at(task, np.array([x]), apart),  # noqa: B023
            bounds=near,
            method="bounded",
            options={"xatol": 1e-12},
        )
        assert amount == pytest.approx(min(found.fun, *values), rel=1e-7)
        assert answer.lower_bound <= min(found.fun, *values) * (1 + 1e-12)
        assert answer.lower_bound >= amount * (1 - 1e-7)
        answered += 1
    assert answered >= 12


@pytest.mark.parametrize("apart", [True, False])
def test_heavy_rotations_leave_the_signed_distance(apart):
    for seed in range(8):
        task = task_of(*pair(200 + seed, apart), length=1e6)
        still = amount_at(task, np.zeros(3), task.gap(task.rest) > 0)
        bound = least_over_turns(task, upper=None, gap=1e-6)
        assert bound.upper == pytest.approx(still, rel=1e-6)
        assert bound.lower == pytest.approx(still, rel=2e-6)


def test_a_box_that_faces_a_plane_only_moves_to_it():
    floor = BOX * [20, 20, 1] - [0, 0, 2.5]
    task = task_of(BOX, floor, length=100.0)
    bound = least_over_turns(task, upper=None, gap=1e-4)
    assert bound.lower <= 0.5 * (1 + 1e-12)
    # the corner sqrt(2) from the axis goes down by turning: amount .5 / sqrt(1 + 2 / L^2) to first order
    assert bound.upper == pytest.approx(0.5 / np.sqrt(1 + 2e-4), rel=2e-4)


def test_cheap_rotations_turn_a_corner_down():
    floor = BOX * [20, 20, 1] - [0, 0, 2.2]
    length = 1e-3
    task = task_of(BOX, floor, length=length)
    bound = least_over_turns(task, upper=None, gap=1e-3)
    # z of a corner turned by a about a horizontal axis: -(cos a + r sin a), r <= sqrt 2, is to be -1.2; no shift
    angle = np.arccos(1.2 / np.sqrt(3)) - np.arccos(1 / np.sqrt(3))
    assert bound.upper == pytest.approx(length * abs(angle), rel=2e-3)


def test_a_box_that_overlaps_a_plane_goes_back_by_its_depth():
    floor = BOX * [20, 20, 1] - [0, 0, 1.7]
    bound = least_over_turns(task_of(BOX, floor), upper=None, gap=1e-4)
    assert bound.lower <= 0.3 * (1 + 1e-12)
    assert bound.upper == pytest.approx(0.3, rel=1e-12)
    assert bound.closed


@pytest.mark.parametrize("offset", [0.3, 0.0, -0.2])
def test_clearance_over_a_plane(offset):
    floor = BOX * [20, 20, 1] - [0, 0, 2 + offset]
    bound = least_over_turns(task_of(BOX, floor, goal="clear", clearance=0.5), upper=None, gap=1e-4)
    assert bound.lower <= (0.5 - offset) * (1 + 1e-12)
    assert bound.lower >= (0.5 - offset) * (1 - 2e-4)


@pytest.mark.parametrize("distance", [1.4, 1.7])
def test_clearance_is_never_bounded_above_what_a_motion_takes(distance):
    bounded = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        one, two = hull(rng, 8), hull(rng, 9) + np.array([distance, 0, 0])
        task = task_of(one, two, goal="clear", clearance=0.4)
        if task.meets(task.rest, 0.0):
            continue
        bounded += 1
        bound = least_over_turns(task, upper=None, gap=1e-2)
        assert bound.lower > 0
        spins = turned_places(task)[1]
        met = 0
        for _ in range(300):
            q = task.rest.copy()
            q[spins] = rng.normal(size=3) * 0.3 * rng.uniform()
            q[0] = -rng.uniform(0, 1.5)
            if task.meets(q, 1e-12):
                met += 1
                assert bound.lower <= task.amount(q)
        assert met > 10
    assert bounded >= 5


@pytest.mark.parametrize("apart", [True, False])
def test_moving_and_scaling_the_scene_changes_nothing_else(apart):
    for seed in range(6):
        one, two = pair(300 + seed, apart)
        rng = np.random.default_rng(seed)
        R, shift, scale = random_rotation(rng), rng.normal(size=3) * 3, float(rng.uniform(0.1, 10))
        gap, length = 1e-4, 0.8
        first = least_over_turns(task_of(one, two, length=length), upper=None, gap=gap)
        second = least_over_turns(
            task_of(scale * one @ R.T + shift, scale * two @ R.T + shift, length=scale * length),
            upper=None,
            gap=gap,
        )
        # cells lie differently: both intervals hold the same number
        assert first.lower <= second.upper / scale * (1 + 1e-9)
        assert second.lower / scale <= first.upper * (1 + 1e-9)


def test_of_unions_the_nearest_parts_touch():
    one, two = pair(400, True)
    alone = least_over_turns(task_of(one, two), upper=None, gap=1e-4)
    seed = one.mean(axis=0)
    union = fo.Body.from_parts([two + np.array([0, 0, 30.0]), two], seed=two.mean(axis=0), name="two")
    body = fo.Body.convex(one, seed=seed, name="one")
    alone = least_over_turns(task_of(body, two), upper=None, gap=1e-4)
    both = least_over_turns(task_of(body, union), upper=None, gap=1e-4)
    assert both.lower <= alone.upper
    assert alone.lower <= both.upper


def test_overlapping_unions_are_bounded_by_their_deepest_pair_and_closed_by_the_known_motion():
    floor = fo.Body.from_parts([BOX * [2, 20, 1] - [x, 0, 1.7] for x in (-2, 2)], seed=(0, 0, -2), name="floor")
    task = task_of(BOX, floor)
    known = Answer(Status.SOLVED, np.array([0, 0, 0.3, 0, 0, 0]), "known")
    bound = least_over_turns(task, upper=known, gap=0.1)
    assert bound.q is None
    assert bound.upper == pytest.approx(0.3, rel=1e-12)
    assert 0 < bound.lower <= 0.3


def test_limits_on_rotations_bound_the_search():
    one, two = pair(402, False)
    free = least_over_turns(task_of(one, two), upper=None, gap=1e-4)
    names = [parameter.name for parameter in fo.Free().parameters[3:]]
    locked = task_of(one, two, limits=dict.fromkeys(names, (0.0, 0.0)))
    still = least_over_turns(locked, upper=None, gap=1e-4)
    assert still.upper == pytest.approx(amount_at(locked, np.zeros(3), False), rel=1e-9)
    assert still.lower >= free.lower


def test_a_search_that_is_cut_short_still_bounds(monkeypatch):
    task = task_of(*pair(7, False))
    whole = least_over_turns(task, upper=None, gap=1e-3)
    monkeypatch.setattr(turns_module, "MOST_CELLS", 60)
    short = least_over_turns(task, upper=None, gap=1e-3)
    assert not short.closed
    assert 0 <= short.lower <= whole.upper
    assert short.upper >= whole.lower


def test_other_motions_and_goals_are_left_alone():
    one, two = pair(1, True)
    assert least_over_turns(task_of(one, two, X >> Y >> fo.Rotation("z")), upper=None, gap=0.1) is None
    about = X >> Y >> Z >> fo.Rotation("z", centre="origin")
    assert least_over_turns(task_of(one, two, about), upper=None, gap=0.1) is None
    assert turns(task_of(one, two)) is None


@pytest.mark.parametrize("yaw", [0.0, 30.0, 45.0, 133.0])
def test_the_amount_of_a_correction_depended_on_how_the_scene_is_turned(yaw: float) -> None:
    """The corner of a post, sqrt(8) from its axis, meets a wall at 2.5 after 45 degrees less acos(2.5 / sqrt(8)).

    Angles count by half the diagonal of its box as drawn, sqrt(16 + 16 + 100) / 2; in a scene at 45 degrees that was
    sqrt(32 + 32 + 100) / 2, a tenth more.
    """
    post, wall = fo.Box((4, 4, 10), name="post"), fo.Box((2, 20, 20), centre=(3.5, 0, 0), name="wall")
    drawn = fo.Problem(post, wall, motion=fo.Rotation("z"), target=(1, 1), goal="touch")
    c, s, turn = np.cos(np.radians(yaw)), np.sin(np.radians(yaw)), np.pi / 4 - np.arccos(2.5 / np.sqrt(8))
    pose = [[c, -s, 0, 5], [s, c, 0, -3], [0, 0, 1, 1], [0, 0, 0, 1]]
    asked = drawn.changed(movable=post.moved(pose), static=wall.moved(pose))
    found = fo.solve(asked)
    assert found.amount == pytest.approx(np.sqrt(33) * turn, rel=1e-9)
    assert fo.Solution.from_dict(found.to_dict()).problem.length == pytest.approx(np.sqrt(33), rel=1e-12)
    assert asked.changed(length=1.0).length == 1.0
    assert drawn.changed(movable=fo.Box((4, 4, 2))).length == pytest.approx(3.0, rel=1e-12)


def test_a_flush_contact_is_restored_from_a_pose_sensed_by_the_answer_as_drawn() -> None:
    """As the refusal of goal "seat" says: the lid, sensed turned and .3 above, is to lie where its drawing has it."""
    lid, box = fo.Box((4, 4, 1), centre=(0, 0, 3.5), name="lid"), fo.Box((6, 6, 6), name="box")
    drawn = fo.Problem(lid, box, motion=fo.Free(), target=(1, 1), goal="seat")
    c, s = np.cos(0.1), np.sin(0.1)
    sensed = np.array([[c, 0, s, 0.2], [0, 1, 0, 0], [-s, 0, c, 0.3], [0, 0, 0, 1]])
    with pytest.raises(fo.InputError, match=r"correct by transform @ inv\(sensed\)"):
        drawn.changed(movable=lid.moved(sensed))
    correction = fo.solve(drawn).transform @ np.linalg.inv(sensed)
    assert lid.moved(sensed).moved(correction).vertices[:, 2].min() == pytest.approx(3.0, abs=1e-12)
