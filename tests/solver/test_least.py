"""Reference amounts against closed forms and exact curves; what does not hold the motion is refused."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import flint
import numpy as np
import pytest
from cases import CUBE, Shape, box_shape, shape

from fcdm_opt.curve.exact import exact_curve
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.model.task import Task
from fcdm_opt.motion.motions import Free, Motion, Rotation, Screw, Translation
from fcdm_opt.problem.problem import Problem
from fcdm_opt.solver import solve
from fcdm_opt_benchmarks.method import Failure
from fcdm_opt_benchmarks.motions.cases import QUICK, chart_cases
from fcdm_opt_benchmarks.motions.held import Held, holders
from fcdm_opt_benchmarks.motions.jets import BITS, Jet, series
from fcdm_opt_benchmarks.motions.least import Least, least_amount, refined

WIDE = ((0.5, 5.0), (0.5, 5.0))
X = Translation("x")
# 1 <= x <= 3/2, seed in its middle: a tip of reach 1/2 towards x meets it where rho_1 / 2 + rho_2 / 4 = 5/4
PLATE = box_shape((1, -2, -2), ("1.5", 2, 2))
TIP = shape([("0.5", 0, 0), ("-0.5", 0, 0), (0, "0.5", 0), (0, "-0.5", 0), (0, 0, "0.5"), (0, 0, "-0.5")], (0, 0, 0))
APART, OVERLAPPING = (1.2, 1.1), (2.2, 1.1)
EXACT = 1e-14


def problem(one: Shape, two: Shape, **arguments: Any) -> Problem:
    return Problem(one.body("one"), two.body("two"), **{"box": WIDE, "goal": "touch", "motion": X, **arguments})


def hulls(seed: int) -> tuple[Body, Body]:
    rng = np.random.default_rng(seed)
    middles = ((0.0, 0.0, 0.0), (3.0, 0.0, 0.0))
    return tuple(Body.convex(rng.normal(size=(9, 3)) + middle, seed=middle) for middle in middles)  # type: ignore[return-value]


def gap(target: tuple[float, float]) -> Fraction:
    """Of tip and plate, at the floats that the scales are."""
    return Fraction(5, 4) - Fraction(target[0]) / 2 - Fraction(target[1]) / 4


def least(asked: Problem) -> Least:
    found = least_amount(asked)
    assert isinstance(found, Least), found
    assert found.lower <= found.amount
    assert solve(asked).amount == pytest.approx(found.amount, rel=1e-9)
    return found


# ------------------------------------------------------------------------------------------------------ closed forms


@pytest.mark.parametrize("target", [APART, OVERLAPPING])
@pytest.mark.parametrize("motion", [X, Translation("x") >> Translation("y") >> Translation("z"), Free()])
def test_a_tip_is_shifted_by_its_gap(motion: Motion, target: tuple[float, float]) -> None:
    """Turning a tip about its seed does not help, to first order."""
    found = least(problem(TIP, PLATE, target=target, motion=motion))
    assert found.amount == pytest.approx(abs(float(gap(target))), rel=EXACT)


def test_two_directions_share_the_way() -> None:
    slanted = Translation((1.0, 1.0, 0.0))
    found = least(problem(TIP, PLATE, target=APART, motion=X >> slanted))
    assert found.amount == pytest.approx(float(gap(APART)) / math.hypot(1.0, slanted.direction[0]), rel=EXACT)


@pytest.mark.parametrize("goal", ["touch", "clear"])
def test_a_tip_is_turned_away(goal: str) -> None:
    """Its reach falls with the cosine: rho_1 cos(t) / 2 + rho_2 / 4 = 5/4."""
    asked = problem(TIP, PLATE, target=OVERLAPPING, goal=goal, motion=Rotation("z"))
    cosine = (Fraction(5, 4) - Fraction(OVERLAPPING[1]) / 4) / (Fraction(OVERLAPPING[0]) / 2)
    angle = flint.arb(flint.fmpq(cosine.numerator, cosine.denominator)).acos()
    assert least(asked).amount == pytest.approx(float(angle * float(asked.weights[0])), rel=EXACT)


def test_a_clearance_is_kept() -> None:
    asked = problem(TIP, PLATE, target=OVERLAPPING, goal="clear", clearance=0.05)
    assert least(asked).amount == pytest.approx(float(Fraction(0.05) - gap(OVERLAPPING)), rel=EXACT)


def test_a_screw_brings_a_tip_as_far_as_its_pitch() -> None:
    """Its axis leads through both seeds and the tip: the turn does nothing to the contact."""
    asked = problem(TIP, PLATE, target=APART, motion=Screw("seeds", 0.5))
    angle = float(gap(APART) / Fraction(1, 2))
    assert least(asked).amount == pytest.approx(angle * float(asked.weights[0]), rel=EXACT)


def test_at_a_pair_inside_a_segment() -> None:
    asked = problem(TIP, PLATE, nominal=(2.0, 1.0), target=(2.1, 1.0), goal="at")
    assert least(asked).amount == pytest.approx(abs(float(gap((2.1, 1.0)))), rel=EXACT)


@pytest.mark.parametrize("seed", range(3))
def test_moving_apart_enlarges_the_curve(seed: int) -> None:
    """By 1 + e for a shift by -e d: the scale that is to grow most says how far."""
    one, two = hulls(seed)
    asked = Problem(one, two, nominal=1, tolerance=(0.02, 0.01), requirement="A", box=WIDE, motion=X)
    nominal = exact_corner(one, two, asked.nominal_pair)
    away = Fraction(float(asked.target[0])) / nominal - 1
    assert least(asked).amount == pytest.approx(float(3 * away), rel=EXACT)


def exact_corner(one: Body, two: Body, near: np.ndarray) -> Fraction:
    """Return rho_1 of the corner of the exact curve that is nearest."""
    curve = exact_curve(one.parts[0], two.parts[0], np.eye(4))
    places = [corner.point for chain in curve.chains for corner in chain.corners]
    corners = [(flint.fmpq(x, w), flint.fmpq(y, w)) for x, y, w in places]
    best = min(corners, key=lambda rho: max(abs(float(rho[k]) / near[k] - 1.0) for k in range(2)))
    assert abs(float(best[0]) / near[0] - 1.0) < 1e-12
    return Fraction(int(best[0].p), int(best[0].q))


# -------------------------------------------------------------------------------------------------- the exact curve


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("letter", ["A", "D"])
def test_the_target_pair_changes_sides_there(seed: int, letter: str) -> None:
    """Of the exact curve: what is a little less than the amount does not do, and a little more does."""
    one, two = hulls(seed)
    asked = Problem(
        one, two, nominal=1, tolerance=0.02, requirement=letter, box=WIDE, motion=Screw("seeds", 1.0), goal="touch"
    )
    solution, amount = solve(asked), least(asked).amount
    (q,) = solution.parameters.values()
    sides = []
    for factor in (1 - 1e-13, 1 + 1e-13):
        turned = math.copysign(amount / float(asked.weights[0]) * factor, q)
        T = asked.motion.transform([turned], one.seed, two.seed)
        sides.append(exact_curve(one.parts[0], two.parts[0], T).side(tuple(map(float, asked.target))))
    assert set(sides) == {-1, 1}


# ---------------------------------------------------------------------------------------------------------- refusals


def planted(one: Body, two: Body, **arguments: Any) -> tuple[Task, np.ndarray, Held, float]:
    asked = Problem(one, two, nominal=1, tolerance=0.02, box=WIDE, **{"requirement": "A", "goal": "touch", **arguments})
    solution = solve(asked)
    task, q = Task.of(asked), np.array(list(solution.parameters.values()))
    held = next(held for held in holders(task, q) if isinstance(refined(task, held, q, 0.0), Least))
    return task, q, held, solution.amount


@pytest.mark.parametrize("letter", ["A", "D"])
@pytest.mark.parametrize("motion", [Rotation((1, 2, 3)), X >> Rotation("z"), Free()])
def test_a_wrong_contact_is_refused(motion: Motion, letter: str) -> None:
    one, two = hulls(1)
    task, q, held, amount = planted(one, two, motion=motion, requirement=letter)
    contact = held.contacts[0]
    others = [v for v in range(len(task.static.parts[0].vertices)) if v not in contact.two]
    for other in others:
        wrong = contact._replace(two=(other, *contact.two[1:]))
        if len(wrong.two) <= 2:
            assert isinstance(refined(task, held._replace(contacts=(wrong,)), q, 0.0), Failure)
    opposite = {"meet": "part", "part": "meet"}[held.asks]
    assert isinstance(refined(task, held._replace(asks=opposite), q, 0.0), Failure)
    found = refined(task, held, q, amount * 1.001)
    assert isinstance(found, Failure)
    assert "bound" in found.reason
    assert isinstance(refined(task, held, q * 1.001, 0.0), Failure)
    assert isinstance(refined(task, held._replace(contacts=()), q, 0.0), Failure)


def test_one_of_two_contacts_is_not_enough() -> None:
    """An edge is met by a corner: either contact line alone would let the other be crossed."""
    for seed in range(20):
        one, two = hulls(seed)
        asked = Problem(one, two, target=(0.5, 0.5), box=WIDE, motion=Free(), goal="touch")
        q = np.array(list(solve(asked).parameters.values()))
        task = Task.of(asked)
        found = [held for held in holders(task, q) if isinstance(refined(task, held, q, 0.0), Least)]
        if found and len(found[0].contacts) == 2:
            for contact in found[0].contacts:
                assert isinstance(refined(task, Held((contact,), "meet"), q, 0.0), Failure)
            return
    pytest.fail("no such contact among the seeds")


def test_upright_prisms_have_a_rational_reference() -> None:
    assert least(problem(CUBE, CUBE.shifted((3, 0, 0)), target=(1.1, 1.0))).amount == pytest.approx(0.9, rel=1e-15)


def test_what_is_not_modelled_is_refused() -> None:
    limited = problem(TIP, PLATE, target=APART, motion=X >> Translation((1, 1, 0)), limits={"TX": (-0.1, 0.1)})
    for asked in (limited, problem(TIP, PLATE, target=APART, amount="displacement", motion=X >> Rotation("z"))):
        assert isinstance(least_amount(asked), Failure)
    assert least_amount(problem(TIP, PLATE, target=APART, goal="clear")) == Least(0.0, 0.0, "met without motion")
    assert isinstance(least_amount(problem(TIP, PLATE, target=APART, limits={"TX": (-0.1, 0.1)})), Failure)


# ------------------------------------------------------------------------------------------------------------ numbers


@pytest.mark.parametrize("square", [0.0, 0.3, 1.0, 2.5, 39.0])
def test_series_hold_the_functions(square: float) -> None:
    r = math.sqrt(square)
    expected = (math.sin(r) / r, (1 - math.cos(r)) / square) if square else (1.0, 0.5)
    with flint.ctx.workprec(BITS):
        for first, own in zip((1, 2), expected, strict=True):
            value, slope, bend = series(flint.arb(square), first)
            assert float(value) == pytest.approx(own, rel=1e-13, abs=1e-15)
            assert max(float(x.rad()) for x in (value, slope, bend)) < 1e-40


def test_derivatives_of_jets() -> None:
    """f = sin(x) sqrt(y) / (1 + sinc(x^2 y)), by differences of its values in many digits."""

    def value(x: Any, y: Any) -> Any:
        return x.sin() * y.sqrt() / (1.0 + (x * x * y).sinc() - 0.25 * (y - x).versine())

    point = (0.7, 1.3)
    with flint.ctx.workprec(300):
        step = flint.arb(2) ** -60

        def at(i: int, j: int) -> Any:
            return value(*Jet.variables([flint.arb(point[0]) + i * step, flint.arb(point[1]) + j * step])).value

        made = value(*Jet.variables([flint.arb(p) for p in point]))
        slopes = [(at(1, 0) - at(-1, 0)) / (2 * step), (at(0, 1) - at(0, -1)) / (2 * step)]
        cross = (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * step * step)
        twice = (at(1, 0) - 2 * at(0, 0) + at(-1, 0)) / (step * step)
        pairs = [
            (made.slope[0, 0], slopes[0]),
            (made.slope[1, 0], slopes[1]),
            (made.bend[0, 1], cross),
            (made.bend[0, 0], twice),
        ]
        for own, other in pairs:
            assert abs(float(own - other)) <= 1e-15 * abs(float(other))


# ---------------------------------------------------------------------------------------------------------- the chart


@pytest.mark.slow
def test_the_quick_chart_is_solved_and_asked_anew() -> None:
    cases = chart_cases(True, 0)
    assert len({case.name for case in cases}) == len(QUICK) + 3
    classes = {"unions as drawn", "curved meshes", "sizes of faces, several contacts"}
    assert {case.labels["shape"] for case in cases} > classes
    assert {case.labels["parameters"] for case in cases} == {1, 2, 3, 6}
    for case in cases:
        first, second = case.question(0), case.question(1)
        assert len({id(own) for own in (first, second, case.problem)}) == 3
        solution = solve(first)
        assert solution.usable
        assert solution.amount == pytest.approx(case.least.amount, rel=1e-9)
        assert case.least.lower <= case.least.amount
        assert case.labels["gap"] < 1e-3
