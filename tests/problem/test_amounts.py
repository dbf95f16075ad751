"""Amounts other than the weighted one, and motions in whole steps: closed forms, oracles, and what is refused."""

from __future__ import annotations

import json
import math
import pickle
from dataclasses import replace
from itertools import product
from typing import Any

import casadi
import numpy as np
import pytest
from cases import box_shape, shape

import fcdm_opt as fo
from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.judge.certificate import verify
from fcdm_opt.model.task import Task
from fcdm_opt.motion.motions import Free, Rotation, Screw, Translation
from fcdm_opt.motion.own_motion import OwnMotion
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.proof.exclusion import Exclusion
from fcdm_opt.solver import solve
from fcdm_opt_benchmarks.motions import answered, judged

X, Y, Z = (Translation(axis) for axis in "xyz")
HALF = box_shape(("-0.5", "-0.5", "-0.5"), ("0.5", "0.5", "0.5")).body("cube")
PLATE = box_shape((1, -2, -2), ("1.5", 2, 2)).body("plate")  # the cube at scale r is 1 - r / 2 away from it


def sym(name: str) -> casadi.SX:
    return casadi.SX.sym(name)


def problem(**arguments: Any) -> Problem:
    return Problem(HALF, PLATE, **{"motion": X >> Rotation("z"), "goal": "touch", "target": (1.0, 1.0), **arguments})


def hulls(seed: int, away: float = 4.5) -> tuple[Body, Body]:
    rng = np.random.default_rng(seed)
    return Body.convex(rng.normal(size=(12, 3))), Body.convex(rng.normal(size=(12, 3)) + np.array([away, 0.5, 0.2]))


def usable(asked: Problem) -> Solution:
    solution = solve(asked)
    assert solution.usable, (solution.status, solution.certificate)
    return solution


# -------------------------------------------------------------------------------------------------------- displacement


@pytest.mark.parametrize("seed", range(4))
def test_displacement_of_parts_apart_is_their_distance(seed):
    """No vertex moves less than the distance that is closed, and a shift along the nearest points moves none more."""
    one, two = hulls(seed, away=6.0)
    distance = float(decision_curve(one, two).distance((1.0, 1.0)))
    for motion in (X >> Y >> Z, Free()):
        solution = usable(Problem(one, two, target=(1.0, 1.0), goal="touch", motion=motion, amount="displacement"))
        assert solution.amount == pytest.approx(distance, rel=1e-8)
        assert solution.lower_bound == pytest.approx(distance, rel=1e-8)


def test_displacement_of_one_translation_is_its_length_whatever_its_weight():
    solution = usable(problem(motion=X, amount="displacement", weights={"TX": 7.0}))
    assert solution.amount == solution.lower_bound == pytest.approx(0.5, rel=1e-12)
    assert solution.stage.startswith("1")


def test_displacement_of_a_rotation_is_twice_the_radius_times_the_sine_of_half_the_angle():
    """A square prism of half side 1/2 turned about its axis reaches the plate where its corner does."""
    plate = box_shape(("0.65", -2, -2), (1, 2, 2)).body("plate")
    asked = Problem(HALF, plate, target=(1.0, 1.0), goal="touch", motion=Rotation("z"), amount="displacement")
    angle, radius = math.acos(0.65 * math.sqrt(2)), math.sqrt(0.5)
    turned = math.pi / 4 - angle
    solution = usable(asked)
    assert abs(solution.parameters["RZ"]) == pytest.approx(turned, rel=1e-8)
    assert solution.amount == pytest.approx(2 * radius * math.sin(turned / 2), rel=1e-8)
    assert 0 < solution.lower_bound <= solution.amount


def test_least_displacement_is_no_larger_than_that_of_the_least_weighted_motion():
    one, two = hulls(0, away=3.0)
    for motion in (X >> Rotation("z"), Screw() >> Y):
        for goal in ("touch", "clear"):
            asked = Problem(one, two, target=(1.3, 1.2), goal=goal, motion=motion)
            weighted, moved = usable(asked), usable(asked.changed(amount="displacement"))
            ends = one.placed_vertices(1.3, weighted.transform) - one.placed_vertices(1.3, np.eye(4))
            assert moved.amount <= np.linalg.norm(ends, axis=1).max() * (1 + 1e-9)
            assert moved.lower_bound <= moved.amount


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_no_smaller_displacement_of_a_free_motion_is_found_from_rest(seed):
    """The least weighted motion may lie in another valley."""
    one, two = hulls(seed, away=3.0)
    segments = decision_curve(one, two, box=((0.5, 2.5), (0.5, 2.5))).segments
    longest = max(segments, key=lambda segment: float(np.linalg.norm(segment.end - segment.start)))
    nominal = (longest.start + longest.end) / 2
    target = nominal * np.array([1.03, 0.99])
    asked = Problem(
        one, two, nominal=tuple(nominal), target=target, goal="at", path="free", motion=Free(), amount="displacement"
    )
    rival = judged(asked, answered("SLSQP", asked).q)
    assert rival.usable
    assert usable(asked).amount <= rival.amount * (1 + 1e-7)


@pytest.mark.parametrize(
    "motion",
    [
        X >> Translation((1, 0.3, 0)),
        Rotation("z", (0.2, -1.0, 0.0)),
        Z >> Rotation((1, 1, 0)),
        Rotation("y", "origin") >> X,
        Screw(),
        Screw(((0.3, 0, 0), (0, 1, 1)), 0.4),
    ],
)
def test_motions_within_a_displacement_are_within_the_domain_of_its_proof(motion):
    """Or whole turns away from one that is."""
    one, two = hulls(1)
    asked = Problem(one, two, target=(1.2, 1.1), goal="clear", clearance=9.0, motion=motion, amount="displacement")
    task, upper = Task.of(asked), 0.6
    task = replace(task, amount_kind="displacement")
    low, high = Exclusion(task, upper).domain.T
    assert (high < 10).all()
    rng = np.random.default_rng(0)
    count, turning = len(low), np.array([kind == "rotation" for _, kind in motion.parameters])
    inside = 0
    for q in rng.uniform(-1, 1, (1000, count)) * np.where(turning, 1.0, 1.5) * rng.choice([0.3, 1.0, 4.0], (1000, 1)):
        if task.amount(q) <= upper:
            inside += 1
            turned = np.where(
                turning & (len(q) == 2 or motion.steps[0].closed), np.remainder(q + np.pi, 2 * np.pi) - np.pi, q
            )
            assert ((turned >= low - 1e-9) & (turned <= high + 1e-9)).all()
    assert inside > 12


def test_the_judge_rejects_a_wrong_displacement():
    solution = usable(problem(amount="displacement"))
    wrong = verify(replace(solution, amount=solution.amount * (1 - 1e-6)))
    assert "amount" in [check.name for check in wrong.failed]


# ---------------------------------------------------------------------------------------------------- one of one's own


def test_an_own_amount_that_is_the_weighted_one_gives_the_same():
    one, two = hulls(0, away=3.0)
    motion = X >> Rotation("z", (0, 1, 0))
    asked = Problem(one, two, target=(1.3, 1.2), goal="touch", motion=motion, weights={"TX": 2.0, "RZ": 0.7})
    expected = usable(asked)
    norm = casadi.sqrt((2 * sym("TX")) ** 2 + (0.7 * sym("RZ")) ** 2)
    q = casadi.SX.sym("any", 2)
    for amount in (norm, casadi.Function("f", [q], [casadi.norm_2(casadi.DM([2.0, 0.7]) * q)])):
        solution = usable(asked.changed(amount=amount))
        assert solution.amount == pytest.approx(expected.amount, rel=1e-7)
        assert expected.amount * 0.99 * (1.0 - 1e-6) <= solution.lower_bound <= expected.amount * (1.0 + 1e-9)
    square = usable(asked.changed(amount=norm**2))
    assert square.amount == pytest.approx(expected.amount**2, rel=1e-7)


def test_an_own_amount_may_be_cheap_in_a_parameter_that_others_find_dear():
    """Turning costs nothing: the shift that is left is what the corner of the turned cube does not reach."""
    solution = usable(problem(amount=casadi.fabs(sym("TX")), limits={"RZ": (-1, 1)}))
    assert solution.amount == pytest.approx(1 - math.sqrt(0.5), rel=1e-6)
    assert abs(solution.parameters["RZ"]) == pytest.approx(math.pi / 4, abs=1e-3)


def test_an_amount_that_is_not_least_at_rest_is_made_less_where_the_parts_are_clear():
    away = (sym("TX") + 0.25) ** 2
    solution = usable(problem(goal="clear", amount=away))
    assert solution.status is Status.SOLVED
    assert solution.parameters["TX"] == pytest.approx(-0.25, abs=1e-4)
    assert solution.amount == pytest.approx(0, abs=1e-8)


BAD = [
    (sym("TZ"), "TZ", "TX, RZ"),
    (casadi.SX.sym("TX", 2), "TX_0", "TX, RZ"),
    (casadi.vertcat(sym("TX"), sym("RZ")), "shape", "a scalar"),
    (1 / sym("TX"), "inf", "at rest"),
    (sym("TX"), "negative", ">= 0"),
    (lambda q: q, "function", '"weighted"'),
    (casadi.Function("f", [], [1.0]), "inputs", "2 parameters"),
]


@pytest.mark.parametrize(("amount", "found", "allowed"), BAD)
def test_an_amount_that_is_none_is_refused(amount, found, allowed):
    with pytest.raises(InputError, match="amount") as caught:
        problem(amount=amount)
    assert found in str(caught.value)
    assert allowed in str(caught.value)


def test_an_amount_stays_with_its_motion():
    asked = problem(amount=sym("TX") ** 2)
    with pytest.raises(InputError, match="another motion's parameters"):
        asked.changed(motion=Y >> Rotation("z"))


def test_own_amounts_and_motions_are_kept_bit_for_bit():
    motion = OwnMotion(slope, [("s", "translation")], name="slope") >> Rotation("z")
    asked = problem(motion=motion, amount=sym("s") ** 2 + casadi.cos(sym("RZ")), resolution={"s": 0.1, "RZ": 0.01})
    text = json.dumps(asked.to_dict(), allow_nan=False)
    for again in (Problem.from_dict(json.loads(text)), pickle.loads(pickle.dumps(asked))):
        assert json.dumps(again.to_dict(), allow_nan=False) == text
        assert (again.motion, again.amount) == (asked.motion, asked.amount)
        assert hash(again.motion) == hash(asked.motion)
        assert again.amount([0.3, 0.2]) == asked.amount([0.3, 0.2]) == 0.09 + math.cos(0.2)


# -------------------------------------------------------------------------------------------------------- own motions


def slope(q):
    """Along x, and up half as much."""
    T = casadi.SX.eye(4)
    T[0, 3], T[2, 3] = q[0], q[0] / 2
    return T


def quick(q):
    """Turns about z by 3 radians a unit."""
    c, s = casadi.cos(3 * q[0]), casadi.sin(3 * q[0])
    T = casadi.SX.eye(4)
    T[0, 0], T[0, 1], T[1, 0], T[1, 1] = c, -s, s, c
    return T


@pytest.mark.parametrize("goal", ["touch", "clear"])
def test_an_own_motion_is_found_like_the_one_of_the_package_that_it_is(goal):
    asked = problem(target=(1.0, 1.0) if goal == "touch" else (2.5, 1.0), goal=goal)
    for own, same, shrink in (
        (OwnMotion(slope, [("s", "translation")]), Translation((2, 0, 1)), 2 / math.sqrt(5)),
        (OwnMotion(slope, [("s", "translation")]) >> Rotation("y"), Translation((2, 0, 1)) >> Rotation("y"), None),
    ):
        mine, theirs = (usable(asked.changed(motion=motion)) for motion in (own, same))
        assert mine.lower_bound <= mine.amount
        if shrink:
            assert mine.amount == pytest.approx(theirs.amount * shrink, rel=1e-8)
        else:  # a unit of it is longer
            assert mine.amount <= theirs.amount * (1 + 1e-9)


def test_an_own_rotation_reaches_the_plate_or_ends_without_a_motion():
    plate = box_shape(("0.65", -2, -2), (1, 2, 2)).body("plate")
    motion = OwnMotion(quick, [("turn", "rotation")])
    solution = usable(Problem(HALF, plate, target=(1.0, 1.0), goal="touch", motion=motion))
    assert abs(solution.parameters["turn"]) == pytest.approx(
        (math.pi / 4 - math.acos(0.65 * math.sqrt(2))) / 3, rel=1e-8
    )
    assert solution.lower_bound <= solution.amount
    never = solve(Problem(HALF, PLATE, target=(0.5, 1.0), goal="touch", motion=motion))
    assert never.status in (Status.NOT_FOUND, Status.INFEASIBLE)


# -------------------------------------------------------------------------------------------------------- whole steps


def test_a_clear_pair_is_rounded_away_from_the_other():
    """The cube at 2.5 is 0.25 too far."""
    exact = usable(problem(motion=X, goal="clear", target=(2.5, 1.0)))
    assert exact.parameters["TX"] == pytest.approx(-0.25, rel=1e-12)
    solution = usable(problem(motion=X, goal="clear", target=(2.5, 1.0), resolution=0.1))
    assert solution.parameters["TX"] == pytest.approx(-0.3, rel=1e-12)
    assert (solution.pair_state, solution.status) == ("apart", Status.SOLVED)
    assert solution.pair_gap == pytest.approx(0.05, rel=1e-9)
    assert solution.lower_bound == pytest.approx(0.25, rel=1e-9)


def test_touch_in_whole_steps_is_the_nearest_that_does_not_overlap_and_says_how_far_off():
    solution = usable(problem(motion=X, resolution=0.3))
    assert solution.parameters["TX"] == pytest.approx(0.3)
    assert (solution.pair_state, solution.features) == ("apart", ())
    assert solution.pair_gap == pytest.approx(0.2, rel=1e-9)
    assert solution.lower_bound == 0.0
    lucky = usable(problem(motion=X, resolution=0.25))
    assert (lucky.parameters["TX"], lucky.pair_state) == (0.5, "touching")


def test_no_motion_in_whole_steps_within_the_limits_is_said():
    asked = problem(motion=X, goal="clear", target=(2.5, 1.0), limits={"TX": (-0.28, 0.28)})
    usable(asked)
    solution = solve(asked.changed(resolution=0.1))
    assert solution.status is Status.NOT_IN_STEPS
    assert "resolution" in solution.status.value
    assert not solution.parameters
    assert "TX -0.2, misses it by 0.05" in solution.explained


@pytest.mark.parametrize("off", [0.01, 0.02, 0.03])
def test_faces_that_whole_steps_leave_open_were_a_motion_that_the_judge_refused(off: float) -> None:
    """A block shorter by `off` below and beside lies flush at (-off, -off) alone; steps are of 0.03."""
    corner = fo.joined(fo.Box((40, 10, 4), centre=(10, 0, -2)), fo.Box((4, 10, 20), centre=(-2, 0, 10)))
    sizes = [fo.Size(name, "movable", faces=[f"-{name}"]) for name in "xz"]
    asked = Problem(
        fo.Box((10, 10, 10), centre=(5, 0, 5)), corner, sizes=sizes, made={"x": -off, "z": -off},
        goal="seat", motion=X >> Translation("z"), resolution=0.03,
    )  # fmt: skip
    found = solve(asked)
    if off == 0.03:
        assert found.usable
        assert [*found.parameters.values()] == pytest.approx([-0.03, -0.03])
    else:
        assert found.status is Status.NOT_IN_STEPS
        assert f"in whole steps, TX 0 + TZ 0, misses it by {off:g}" in found.advice
        assert str(found).count("misses it by") <= 1
    assert usable(asked.changed(goal="at")).pair_gap == pytest.approx(off % 0.03)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_no_smaller_motion_in_whole_steps_is_clear(seed):
    """Every smaller grid motion is tried with the oracle's gap."""
    one, two = hulls(seed, away=1.5)
    step, target = 0.07, (1.2, 1.2)
    solution = usable(Problem(one, two, target=target, goal="clear", motion=X >> Y, resolution=step))
    q = np.array(list(solution.parameters.values()))
    np.testing.assert_allclose(q / step, np.round(q / step), atol=1e-9)
    most = math.ceil(solution.amount / step)
    smaller = [np.array(k) * step for k in product(range(-most, most + 1), repeat=2)]
    smaller = [p for p in smaller if np.linalg.norm(p) < solution.amount - 1e-9]
    curve_of = [decision_curve(one.moved(_shift(*p)), two) for p in smaller]
    assert len(smaller) > 10
    assert max(float(curve.gap(target)) for curve in curve_of) < 0


def _shift(x: float, y: float) -> np.ndarray:
    T = np.eye(4)
    T[:2, 3] = x, y
    return T


def test_parameters_without_a_step_are_solved_anew():
    """With x in steps of 0.4 the cube is 0.1 short of the plate, and turns the rest of the way."""
    asked = problem(motion=X >> Rotation("z"), resolution={"TX": 0.4}, limits={"RZ": (-0.5, 0.5)})
    solution = usable(asked)
    assert solution.parameters["TX"] == pytest.approx(0.4)
    turned = math.pi / 4 - math.acos(0.6 * math.sqrt(2))
    assert abs(solution.parameters["RZ"]) == pytest.approx(turned, rel=1e-8)
    assert solution.pair_state == "touching"


def test_the_judge_rejects_a_motion_between_the_steps():
    asked = problem(motion=X, goal="clear", target=(2.5, 1.0))
    claimed = replace(solve(asked), problem=asked.changed(resolution=0.1))
    assert [check.name for check in verify(claimed).failed] == ["whole steps"]


def test_at_and_beyond_in_whole_steps_track_their_point():
    tip = shape(
        [("0.5", 0, 0), ("-0.5", 0, 0), (0, "0.5", 0), (0, "-0.5", 0), (0, 0, "0.5"), (0, 0, "-0.5")], (0, 0, 0)
    )
    asked = Problem(
        tip.body("tip"), PLATE, nominal=(2.0, 1.0), target=(2.1, 1.0), goal="at", motion=X >> Y, resolution=0.03
    )
    solution = usable(asked)  # 0.05 back: 0.06 does not overlap, 0.03 does
    assert list(solution.parameters.values()) == pytest.approx([-0.06, 0.0], abs=1e-12)
    assert solution.pair_gap == pytest.approx(0.01, rel=1e-8)


# ------------------------------------------------------------------------------------------------------------- locked


def test_limits_that_are_one_value_lock_a_parameter():
    solution = usable(problem(motion=X >> X >> Y, limits={"TX": (0.2, 0.2), "TY": (0.1, 0.1)}))
    assert list(solution.parameters.values()) == pytest.approx([0.2, 0.3, 0.1], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("amount", ["weighted", "displacement"])
def test_free_with_all_but_one_parameter_locked_is_that_parameter(amount):
    for name, motion in (("TX", X), ("RZ", Rotation("z"))):
        plate = PLATE if name == "TX" else box_shape(("0.65", -2, -2), (1, 2, 2)).body("plate")
        locked = {p.name: (0.0, 0.0) for p in Free().parameters if p.name != name}
        asked = Problem(HALF, plate, target=(1.0, 1.0), goal="touch", motion=motion, amount=amount)
        one, six = usable(asked), usable(asked.changed(motion=Free(), limits=locked))
        assert six.amount == pytest.approx(one.amount, rel=1e-7)
        assert [six.parameters[key] for key in locked] == [0.0] * 5


@pytest.mark.parametrize(
    ("motion", "amount", "least"),
    [
        (X >> Z, sym("TX") ** 2 + 2 * sym("TZ") ** 2, 0.035**2 + 2 * 0.015**2),
        (X >> Z, casadi.fabs(sym("TX")) + 2 * casadi.fabs(sym("TZ")), 0.035 + 2 * 0.015),
        (X >> Z >> Rotation("y"), sym("TX") ** 2 + sym("TZ") ** 2 + sym("RY") ** 2, 0.035**2 + 0.015**2),
        (X >> Z >> Rotation("y"), sym("TX") ** 2, 0.0),  # any turn is free, and a whole one restores the contacts again
    ],
)
def test_the_bound_of_an_own_amount_was_0_or_in_units_of_another_one(motion, amount, least):
    """A block in a corner, which one motion restores; beyond the boxes that hold no other one nothing costs less."""
    block = Body.convex([*product((-1, 1), (-1, 1), (0, 1))], seed=(0, 0, 3 / 7), name="block")
    parts = [[*product((-9, 9), (-9, 9), (-1, 0))], [*product((-9, -1), (-9, 9), (0, 5))]]
    corner = Body.from_parts(parts, seed=(0, 0, 0), name="corner")
    asked = {"nominal": "drawn", "goal": "at", "contacts": "all", "path": "free", "target": (1.035, 1.0)}
    solution = solve(Problem(block, corner, **asked, motion=motion, amount=amount), certify=True)
    assert solution.usable
    assert solution.amount == pytest.approx(0.035**2 if least == 0.0 else least, rel=1e-9)
    assert solution.lower_bound == pytest.approx(least, rel=1e-9)
    assert verify(solution, proof=True).passed
