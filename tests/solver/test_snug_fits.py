"""Fits without play, and what a nominal pair may be moved by: the sizes made are always those asked for."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from strategies import random_rotation

from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.curve.segments import SwitchingPoint
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.judge.certificate import verify
from fcdm_opt.motion.motions import Translation
from fcdm_opt.problem.nominal import NominalContact
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Status
from fcdm_opt.solver import solve

SHIFT = Translation("x") >> Translation("y") >> Translation("z")
SIGN = {"A": 1.0, "D": -1.0}

# Seeds of the peg and of the hole between which (1, 1) is on no segment: around it the peg meets a wall, the opposite
# one or, with its head, the rim, each with another line.
ALONE = [
    ((0, 0, 0), (1, 1, 1)),
    ((0, 0, 0), (2, 0, 0)),
    ((0.5, 0.3, 1), (1, 1, 1)),
    ((0.5, 0.3, 1), (2, 0, 0)),
    ((0.5, 0.3, 1), (0, 0, 0)),
    ((0.5, 0.3, 1), (0, 0, 1.5)),
]
OTHERS = [((0, 0, 2), (1, 1, 1)), ((0, 0, 0), (0, 0, 1.5)), ((0, 0, 4), (1, 0, 3)), ((0, 0, 2), (2, 0, 0))]


def block(low: tuple[float, ...], high: tuple[float, ...]) -> np.ndarray:
    return np.array(list(itertools.product(*zip(low, high, strict=True))), dtype=float)


def peg(seed: tuple[float, ...], *, head: bool = True) -> Body:
    """A square peg of width 2, with a head of width 4 from height 3 on."""
    parts = [block((-1, -1, 0), (1, 1, 4)), block((-2, -2, 3), (2, 2, 4))]
    return Body.from_parts(parts if head else parts[:1], seed=seed, name="peg")


def hole(seed: tuple[float, ...]) -> Body:
    """Four walls of height 3 about a square of width 2."""
    walls = [((1, -3), (3, 3)), ((-3, -3), (-1, 3)), ((-1, 1), (1, 3)), ((-1, -3), (1, -1))]
    return Body.from_parts([block((*low, 0), (*high, 3)) for low, high in walls], seed=seed, name="hole")


def fit(seeds: tuple[tuple[float, ...], ...], **arguments: object) -> Problem:
    head = arguments.pop("head", True)
    given = {"nominal": "drawn", "tolerance": 0.01, "requirement": "D", "motion": SHIFT, **arguments}
    return Problem(peg(seeds[0], head=bool(head)), hole(seeds[1]), **given)


def least(seeds: tuple[tuple[float, ...], ...], requirement: str, *, head: bool, seated: bool) -> float:
    """Closed form: parts that both change by the same share fit again where the peg is moved by -share (b - a).

    Across, walls on both sides ask for just that; upwards the head asks for no less, and seated for just that.
    """
    way = -0.01 * SIGN[requirement] * (np.array(seeds[1]) - np.array(seeds[0]))
    if not head:
        way[2] = 0.0
    elif not seated:
        way[2] = max(way[2], 0.0)
    return float(np.linalg.norm(way))


ASKED = [
    ("at", "D", "coherent"), ("at", "A", "free"), ("seat", "D", "free"), ("seat", "A", "coherent"),
    (None, "D", "coherent"), ("touch", "D", "coherent"),
]  # fmt: skip


@pytest.mark.sampled(6)
@pytest.mark.parametrize(
    ("seeds", "goal", "requirement", "path"),
    [(seeds, *ASKED[(k + step) % 6]) for k, seeds in enumerate(ALONE) for step in (0, 1, 3)],
)
def test_a_fit_without_play_drawn_never_becomes_other_sizes(
    seeds: tuple[tuple[float, ...], ...], goal: str | None, requirement: str, path: str
) -> None:
    """A peg in its hole came out half as large, verified."""
    asked = 1.0 + 0.01 * SIGN[requirement]
    problem = fit(seeds, goal=goal, requirement=requirement, path=path)
    assert problem.goal == (goal or "seat")
    assert problem.snapped is None
    np.testing.assert_allclose(problem.target, asked, rtol=1e-14)
    solution = solve(problem)
    assert solution.usable, solution.certificate
    np.testing.assert_allclose(solution.pair, asked, rtol=1e-14)
    expected = least(seeds, requirement, head=True, seated=problem.goal == "seat")
    assert solution.amount == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.sampled(6)
@pytest.mark.parametrize("seeds", OTHERS)
@pytest.mark.parametrize("head", [True, False])
@pytest.mark.parametrize("goal", ["at", "seat", "touch"])
def test_a_fit_without_play_on_a_segment_or_its_end_is_verified_at_the_sizes_asked(
    seeds: tuple[tuple[float, ...], ...], head: bool, goal: str
) -> None:
    """The judge saw no free side of one wall where the opposite one is as near."""
    solution = solve(fit(seeds, head=head, goal=goal))
    assert solution.usable, solution.certificate
    np.testing.assert_allclose(solution.pair, 0.99, rtol=1e-14)
    bounds = [least(seeds, "D", head=head, seated=seated) for seated in (False, True)]
    if goal == "at":  # keeps one contact, or two of different lines
        assert bounds[0] - 1e-12 <= solution.amount <= bounds[1] + 1e-12
    else:
        assert solution.amount == pytest.approx(bounds[goal == "seat"], rel=1e-9, abs=1e-12)


def around(curve: DecisionCurve) -> np.ndarray:
    angles = np.linspace(0.0, 2.0 * np.pi, 97)
    return np.asarray(curve.gap(1.0 + 1e-3 * np.column_stack([np.cos(angles), np.sin(angles)])))


@pytest.mark.parametrize("seeds", ALONE)
def test_a_point_of_contact_on_no_segment_is_on_the_curve(seeds: tuple[tuple[float, ...], ...]) -> None:
    curve = decision_curve(peg(seeds[0]), hole(seeds[1]))
    assert (around(curve) < 0).all()
    point = curve.locate((1.0, 1.0))
    assert isinstance(point, SwitchingPoint)
    assert point.alone
    assert point.index == len(curve.switching_points)
    np.testing.assert_allclose(point.rho, 1.0, rtol=4e-15)
    assert set(point.configurations) == {"F-F"}
    assert len(point.contact_features) == 5  # four walls and the rim, which is one face of the body
    np.testing.assert_allclose(point.lines[:, :2].sum(axis=1), point.lines[:, 2], atol=1e-14)
    np.testing.assert_array_equal(curve.nearest((1.0 + 1e-4, 1.0 - 1e-4)), point.rho)
    assert curve.status == "contact"
    small = decision_curve(peg(seeds[0]), hole(seeds[1]), box=((0.9, 1.1), (0.95, 1.05)))
    assert (small.segments, small.status) == ((), "contact")
    assert [own.alone for own in small.switching_points] == [True]


def test_a_point_alone_is_found_wherever_the_parts_lie_and_however_they_are_listed() -> None:
    """With seeds and corners that are rounded its lines meet only nearly."""
    rng = np.random.default_rng(17)
    for seeds in ALONE[::2]:
        one, two = peg(seeds[0]), hole(seeds[1])
        turn, shift = random_rotation(rng), rng.normal(size=3)
        bodies = [
            Body.from_parts([part.vertices @ turn.T + shift for part in parts], seed=turn @ body.seed + shift)
            for body, parts in ((one, one.parts[::-1]), (two, [two.parts[k] for k in (2, 0, 3, 1)]))
        ]
        point = decision_curve(*bodies).locate((1.0, 1.0))
        assert isinstance(point, SwitchingPoint)
        assert point.alone
        assert len(point.contact_features) == 5


def test_a_hole_with_play_or_too_small_has_no_point_alone() -> None:
    for width in (0.999, 1.001):
        walls = [part.vertices.copy() for part in hole((1, 1, 1)).parts]
        for wall in walls:
            wall[:, :2] = np.where(np.abs(wall[:, :2]) == 1.0, width * wall[:, :2], wall[:, :2])
        curve = decision_curve(peg((0, 0, 0)), Body.from_parts(walls, seed=(1, 1, 1)))
        assert not any(point.alone for point in curve.switching_points)


def test_a_nominal_pair_is_not_moved_by_more_than_snap_of_either_scale() -> None:
    """The gap alone said nothing: with a seed near the contact, sizes change it but little."""
    wall = Body.convex(block((1, -1, -1), (2, 1, 1)), seed=(1.5, 0, 0))
    gap, reach = 1e-7, 1e-3
    one = Body.convex(block((0, -1, -1), (1 - gap, 1, 1)), seed=(1 - gap - reach, 0, 0))
    near = Body.convex(block((1, -1, -1), (2, 1, 1)), seed=(1 + reach, 0, 0))
    shift = Translation("x") >> Translation("y")
    arguments = {"tolerance": 0.01, "requirement": "D", "motion": shift, "goal": "at"}
    with pytest.raises(InputError, match="not on the decision curve"):  # sizes off by 5e-5 each would touch
        Problem(one, near, **arguments)
    assert Problem(one, near, **arguments, snap=6e-5).snapped is not None
    closed = Problem(one, wall, **arguments, snap=1e-6 + 1e-4 * 2.1)
    assert np.abs(closed.snapped.pair - 1.0).max() <= closed.snap
    with pytest.raises(InputError, match="not on the decision curve"):
        Problem(peg((0, 0, 0)), hole((1, 1, 1)), nominal=(1.0, 1.0 + 1e-4), **arguments)


def test_a_switching_point_is_meant_by_what_is_near_it_in_each_scale() -> None:
    """Of a body drawn ten million times as large the scales were moved by half a per cent: near in the other's."""
    drawn = 1e7
    cube = block((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    gable = np.array([[0.7, -0.3, 0.1], [0.7, 0.3, 0.2], [1.5, -0.5, -0.4], [1.5, 0.5, -0.4], [1.5, 0, 0.6]])
    two = Body.convex(gable, seed=(1.2, 0.05, 0.02))
    box = ((0.2 / drawn, 3.0 / drawn), (0.2, 3.0))
    one = Body.convex(drawn * cube, seed=(0, 0, 0))
    point = decision_curve(one, two, box=box).switching_points[0].rho
    arguments = {"tolerance": 0.01, "requirement": "D", "motion": Translation("x"), "goal": "touch", "box": box}
    for off in (5e-3, 1e-6):
        asked = point * [1.0 + off, 1.0]
        problem = Problem(one, two, nominal=tuple(asked), **arguments)
        np.testing.assert_allclose(problem.target, 0.99 * asked, rtol=1e-12)


@pytest.mark.parametrize("goal", ["at", "seat"])
def test_the_judge_refuses_sizes_that_were_not_asked_for(goal: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the nominal pair was once moved to whatever point of the curve was nearest."""
    wall = Body.convex(block((1, -1, -1), (2, 1, 1)), seed=(1.25, 0, 0))
    one = Body.convex(block((0, -1, -1), (1 - 4e-6, 1, 1)), seed=(0.5, 0, 0))
    monkeypatch.setattr(NominalContact, "_within_snap", lambda *_: True)
    shift = Translation("x") >> Translation("y")
    problem = Problem(one, wall, nominal="drawn", snap=2e-6, tolerance=0.01, requirement="B", goal=goal, motion=shift)
    assert np.abs(problem.snapped.pair - 1.0).max() > 3e-6
    solution = solve(problem)
    assert solution.status is Status.NOT_VERIFIED
    assert [check.name for check in verify(solution).checks if not check.passed] == ["sizes asked", "status"]


@pytest.mark.parametrize(("tolerance", "letter", "made"), [
    (0.01, "A", (1.01, 1.01)), ((0.01, 0.02), "B", (1.01, 0.98)), (((0.01, 0.03), (0.02, 0.04)), "C", (0.99, 1.04)),
    (((0.01, 0.03), (0.02, 0.04)), "A", (1.03, 1.04)), ([[0.01, 0.03], [0.02, 0.04]], "D", (0.99, 0.98)),
])  # fmt: skip
def test_the_judge_works_out_the_sizes_from_tolerance_and_letter(
    tolerance: object, letter: str, made: tuple[float, float]
) -> None:
    wall = Body.convex(block((1, -1, -1), (2, 1, 1)), seed=(1.25, 0, 0))
    one = Body.convex(block((0, -1, -1), (1, 1, 1)), seed=(0.5, 0, 0))
    problem = Problem(one, wall, tolerance=tolerance, requirement=letter, goal="touch", motion=Translation("x"))
    solution = solve(problem)
    assert solution.usable, solution.certificate
    np.testing.assert_allclose(solution.pair, made, rtol=1e-15)
    for other in (problem.changed(tolerance=0.5), problem.changed(requirement="ABCD"["BADC".index(letter)])):
        object.__setattr__(problem, "request", other.request)
        failed = [check.name for check in verify(solution).checks if not check.passed]
        assert failed == ["sizes asked"]
