"""Problems that solver or judge once got wrong; truth from closed forms, or from a witness that the judge passes."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
import pytest
from cases import box_shape, shape, union
from ordinary import problems

import fcdm_opt as fo
from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.collision import ScaledPair
from fcdm_opt.judge.certificate import verify
from fcdm_opt.model.task import Task
from fcdm_opt.motion.motions import Motion, Rotation, Screw, Translation
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.solver import solve

X, Y, Z = Translation("x"), Translation("y"), Translation("z")
SIX = X >> Y >> Z >> Rotation("x") >> Rotation("y") >> Rotation("z")


def box(centre: Any, half: Any) -> Body:
    middle, reach = np.array(centre, dtype=float), np.broadcast_to(half, 3)
    return box_shape(middle - reach, middle + reach, centre).body()


CUBE = box((0, 0, 0), 0.5)
PLATE = box((1.25, 0, 0), (0.25, 2, 2))  # 1 <= x <= 3/2: the cube before it is 1/2 away


def problem(movable: Body = CUBE, static: Body = PLATE, **arguments: Any) -> Problem:
    return Problem(movable, static, **{"target": (1, 1), "motion": X, "goal": "touch", **arguments})


def case(file: str, name: str, **changes: Any) -> Problem:
    found = problems(file)[name]
    return found.changed(published=None, **changes) if changes else found


def moved(solution: Solution, q: Any, **changes: Any) -> Solution:
    """The same claim at other parameters, with their transform and amount."""
    asked, names = solution.problem, [parameter.name for parameter in solution.problem.motion.parameters]
    amount = float(np.linalg.norm(asked.weights * q))
    return replace(
        solution, parameters=dict(zip(names, map(float, q), strict=True)), lower_bound=0.0,
        transform=asked.motion.transform(q, asked.movable.seed, asked.static.seed),
        amount=amount, amount_low=amount, amount_high=amount, **changes,
    )  # fmt: skip


# ------------------------------------------------------------------------------------------ right answers, rejected


def test_corner_on_corner_was_rejected() -> None:
    """Corners 2 apart in each coordinate: three faces each, more than two features."""
    solution = solve(problem(CUBE, box((3, 3, 3), 0.5), motion=X >> Y >> Z))
    assert solution.amount == pytest.approx(2 * math.sqrt(3), rel=1e-9)
    assert solution.usable, solution.certificate


@pytest.mark.parametrize("seed", [1, 7])
def test_hulls_with_six_parameters_were_rejected(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, two = Body.convex(rng.normal(size=(8, 3))), Body.convex(rng.normal(size=(8, 3)) + np.array([6, 1, 1]))
    solution = solve(problem(one, two, motion=SIX))
    assert solution.usable, solution.certificate


@pytest.mark.parametrize("places", [((-1, -1), (1, -1), (0, 1)), tuple(product((-1, 1), repeat=2))], ids=len)
def test_three_and_four_legs_on_a_plate_were_rejected(places: tuple[tuple[int, int], ...]) -> None:
    """Feet at z = 3/2, plate at z = 1/2."""
    legs = [box_shape((x - 0.2, y - 0.2, 1.5), (x + 0.2, y + 0.2, 2.5)) for x, y in places]
    solution = solve(problem(union(*legs, seed=(0, 0, 2)).body(), box((0, 0, 0), (2, 2, 0.5)), motion=Z))
    assert solution.parameters["TZ"] == pytest.approx(-1.0)
    assert solution.usable, solution.certificate


@pytest.mark.parametrize("size", [1e-8, 1e-9])
def test_no_answer_for_a_small_static_body_could_pass(size: float) -> None:
    solution = solve(problem(box((2, 0, 0), 0.5), box((0, 0, 0), size / 2)))
    assert solution.usable, solution.certificate


def test_a_tiny_target_scale_was_rejected() -> None:
    solution = solve(problem(target=(1e-6, 1)))
    assert solution.usable, solution.certificate


def test_far_from_the_origin_features_were_invented() -> None:
    one = np.array([[0, 0, 0], [1, 0.1, 0], [0.2, 1.1, 0.05], [0.1, 0.2, 1.2], [0.9, 0.8, 0.7]]) + 1e6
    two = np.array([[2, 0.1, 0.1], [3.1, 0, 0], [2.5, 1.2, 0.3], [2.4, 0.3, 1.3], [3, 1.1, 1]]) + 1e6
    solution = solve(problem(Body.convex(one), Body.convex(two), motion=X >> Rotation("z")))
    assert solution.usable, solution.certificate


# ---------------------------------------------------------------------------------------- possible, called impossible


@pytest.mark.parametrize("place", [(5, 1, 0), (5, 1, 1)])
def test_sliding_flush_into_touch_was_infeasible(place: tuple[int, int, int]) -> None:
    """From TX = 4 to 6 the face y = 1/2 lies on the other cube's (or edge on edge): the distance is zero."""
    asked = problem(CUBE, box(place, 0.5))
    pose = asked.motion.transform([4.5], asked.movable.seed, asked.static.seed)
    assert ScaledPair(asked.movable, asked.static).signed_distance((1, 1), pose) == 0.0
    solution = solve(asked)
    assert solution.status is not Status.INFEASIBLE
    assert solution.amount == pytest.approx(4.0)


def test_left_coherent_range_was_claimed_while_a_coherent_motion_exists() -> None:
    """The witness passes the judge, so an answer must be found, and one at least as small."""
    asked = case("example1", "A", motion=Z >> Rotation("z"))
    q = np.array([0.07231981, -0.37914262])
    found, task = solve(asked), Task.of(asked)
    gap = task.gap(q)
    status, state = (Status.SOLVED, "apart") if gap > 0 else (Status.PAIR_OVERLAPS, "overlapping")
    witness = moved(replace(found, status=status, rho=task.tracked_contact(q)[0], pair_gap=gap, pair_state=state,
                            features=asked.nominal_contact.features), q)  # fmt: skip
    assert verify(witness).passed
    assert found.status.found
    assert found.amount <= witness.amount


@pytest.mark.parametrize("path", ["coherent", "free"])
def test_a_rotation_about_the_seeds_was_not_found(path: str) -> None:
    """The one parameter, at the angle given here, meets the task."""
    asked = case("example2", "A", motion=Screw("seeds", 0.0), path=path)
    assert Task.of(asked).meets(np.array([0.75393062]), 1e-12)
    assert solve(asked).status.found


@pytest.mark.parametrize(("axis", "limits"), [("z", (-1.0, -0.1)), ("z", (-0.3, -0.29)), ("-z", (0.1, 1.0))])
def test_a_rotation_within_limits_that_exclude_rest_was_not_found(axis: str, limits: tuple[float, float]) -> None:
    """A square of half-width 4/5 turned by t reaches 4/5 (cos t + sin t), so sin 2 t = (5/4)^2 - 1 at x = 1."""
    motion = Rotation(axis)
    solution = solve(problem(target=(1.6, 1), motion=motion, limits={motion.parameters[0].name: limits}))
    assert solution.status is Status.SOLVED
    (angle,) = solution.parameters.values()
    assert abs(angle) == pytest.approx(math.asin(1.25**2 - 1) / 2)


def test_a_root_within_limits_that_exclude_rest_was_not_found() -> None:
    """The distances at both sides of the root, from the other library, have two signs."""
    rng = np.random.default_rng(3)
    one = Body.convex(rng.normal(size=(8, 3)) * 0.5)
    two = Body.convex(rng.normal(size=(8, 3)) * 0.5 + np.array([1.2, 0.3, 0]))
    asked = problem(one, two, motion=Rotation("y"), limits={"RY": (-2, -0.2)})
    low, high = (ScaledPair(one, two).signed_distance((1, 1), asked.motion.transform([angle], one.seed, two.seed))
                 for angle in (-1.4511, -1.4512))  # fmt: skip
    assert low * high < 0
    assert solve(asked).verified


@pytest.mark.parametrize("motion", [X >> Rotation("y") >> Rotation("z"), SIX], ids=["three", "six"])
def test_more_parameters_made_the_least_motion_larger(motion: Motion) -> None:
    """Along x alone corner (1, 0, 0) meets corner (10, 0, 0)."""
    one = shape([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], ("0.25", "0.25", "0.25")).body()
    two = shape([(10, 0, 0), (11, 0, 0), (10, 1, 0), (10, "0.2", 1)], ("10.25", "0.3", "0.25")).body()
    assert solve(problem(one, two, motion=motion)).amount <= 9.0 + 1e-9


# --------------------------------------------------------------------------------------------- wrong claims, passed


def test_a_thin_fin_on_the_way_was_missed() -> None:
    """A cube tracked on a ramp of slope 1/10 moves by -.1 * .5 * 1.1 / .1; its probe meets a fin.

    Both together are thinner than a step between 33 points on the way, and the fin is half-way between two of them.
    """
    q = -0.55
    ramp = shape([(x, y, Fraction(x, 10) + z) for x in (-5, 5) for y in (-2, 2) for z in (-2, 0)], (0, 0, -1))
    probe = box_shape(("-0.002", "-0.2", "2.8"), ("0.002", "0.2", "3.2"))
    at = Fraction("-0.55") * 31 / 64
    fin = box_shape((at - Fraction("0.001"), -1, 2), (at + Fraction("0.001"), 1, 4))
    cube = box_shape(("-0.5", "-0.5", "0.05"), ("0.5", "0.5", "1.05"))
    asked = Problem(union(cube, probe, seed=cube.seed).body(), union(ramp, fin, seed=ramp.seed).body(), nominal=(1, 1),
                    target=(1.1, 1), goal="at", motion=X)  # fmt: skip
    task, pair = Task.of(asked), ScaledPair(asked.movable, asked.static)
    least = min(
        pair.signed_distance(task.tracked_contact(np.array([q]), share)[0], task.transform(np.array([share * q])))
        for share in np.linspace(0.47, 0.5, 301)
    )
    assert least < -1e-3
    assert not solve(asked).usable


def test_hidden_whole_turns_passed_the_judge() -> None:
    """64 pi more: each of 33 points on the way sees whole turns and no motion."""
    solution = solve(case("example2", "A"))
    q = np.array(list(solution.parameters.values()))
    assert verify(solution).passed
    assert not verify(moved(solution, q + np.array([0, 64 * math.pi]))).passed


@pytest.mark.parametrize(("size", "share"), [(1e-3, 1e-6), (1e-9, 1.0)])
def test_an_error_of_the_size_of_the_movable_body_passed_the_judge(size: float, share: float) -> None:
    solution = solve(problem(box((0, 0, 0), size / 2), box((2, 0, 0), 1)))
    q = [solution.parameters["TX"] + share * size]
    assert verify(solution).passed
    assert not verify(moved(solution, q, pair_gap=-share * size)).passed


def test_features_of_a_pair_that_does_not_touch_were_not_judged() -> None:
    solution = solve(problem(goal="clear", target=(2, 2), clearance=0.125))
    assert not verify(replace(solution, features=(Feature.from_label("V1F2(P1V1; P2V1,V2,V3,V4)"),))).passed


def test_one_feature_named_twice_passed_as_two() -> None:
    solution = solve(problem())
    assert not verify(replace(solution, features=solution.features * 2)).passed


@pytest.mark.parametrize(
    "wrong",
    [{"rho": np.ones(3)}, {"rho": np.array(1.0)}, {"transform": np.eye(3)}, {"pair": np.ones(3)}, {"pair": np.ones(1)},
     {"parameters": {"TX": None}}, {"amount": None}, {"features": ("x",)}],
)  # fmt: skip
def test_the_judge_raised_on_malformed_claims(wrong: dict[str, Any]) -> None:
    assert not verify(replace(solve(problem()), **wrong)).passed


@pytest.mark.parametrize(
    ("key", "value"),
    [("parameters", "x"), ("transform", "x"), ("amount", "x"), ("rho", ["a", "b"]), ("features", [1]), ("pair", "x"),
     ("pair_gap", "x"), ("modelled", "x"), ("seconds", [[1]]), ("lower_bound", "x")],
)  # fmt: skip
def test_a_damaged_solution_file_raised_another_error(key: str, value: Any) -> None:
    data = solve(problem()).to_dict()
    with pytest.raises(InputError):
        Solution.from_dict({**data, key: value})


# ------------------------------------------------------------------------------------------------------ odd numbers


def concentric() -> list[Body]:
    """Two boxes about the origin, seeds at their centroids as computed."""
    signs = np.array(list(product((-1.0, 1.0), repeat=3)))
    return [Body.convex(signs * half) for half in (0.5, (0.1, 0.1, 3))]


def test_seeds_that_coincide_up_to_rounding_were_a_screw_axis() -> None:
    """Both centroids are the origin but for rounding."""
    cube, thin = concentric()
    with pytest.raises(InputError):
        problem(cube, thin, motion=Screw())


def test_seeds_apart_far_from_the_origin_were_refused() -> None:
    """1e-4 apart, bodies of size 1: five orders above what coincides."""
    asked = problem(box((1e6, 0, 0), 0.5), box((1e6 + 1e-4, 0, 0), (0.01, 0.01, 3)), motion=Screw())
    assert asked.weights.size == 2


def test_concentric_bodies_warned() -> None:
    """They overlap at every scale pair."""
    assert decision_curve(*concentric()).status == "overlapping"


def test_an_axis_whose_length_overflows_made_a_problem_impossible() -> None:
    """Along (1, 0, 1), 1/2 to go in x."""
    solution = solve(problem(motion=Translation((1.7e308, 0.0, 1.7e308))))
    assert solution.status is Status.SOLVED
    assert solution.amount == pytest.approx(math.sqrt(0.5))


@pytest.mark.parametrize(
    "changes",
    [{"motion": Rotation("x"), "length": 1e300}, {"target": (1e154, 1.0)}, {"target": (1e300, 1.0)},
     {"weights": {"TX": 1e300}}, {"goal": "clear", "clearance": 1e300}],
)  # fmt: skip
def test_extreme_numbers_overflowed(changes: dict[str, Any]) -> None:
    """Refused or answered, and what is answered is judged; a warning is an error here."""
    try:
        solution = solve(problem(**changes))
    except InputError:
        return
    assert solution.usable or not solution.status.found


def test_a_fit_of_contacts_that_are_not_there_was_an_index_error() -> None:
    """At scales (1.2, 0.91) a block and its base are apart: no contact is there whose gaps could be made small."""
    block, base = fo.Box((10, 10, 10), centre=(0, 0, 15)), fo.Box((20, 20, 20))
    asked = {"motion": fo.Translation("z"), "target": (1.21, 0.92), "contacts": "all", "goal": "fit"}
    with pytest.raises(fo.InputError, match=r"box and box overlap by 0\.1 there: .* the nominal pair is not on the"):
        fo.Problem(block, base, nominal=(1.2, 0.91), **asked)
    assert fo.solve(fo.Problem(block, base, nominal=(1.2, 0.9), **asked)).amount == pytest.approx(0.25)
