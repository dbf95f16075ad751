"""The two examples of the FCDM paper, from their problem files to judged answers, with exact rationals as witness."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from cases import EXAMPLE_1, EXAMPLE_2
from contact_truth import exact_gap, exact_meeting, exact_of
from ordinary import problems

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.bodies import Array
from fcdm_opt.judge.certificate import verify
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT

EXAMPLES = ("example1", "example2")
CASES = [(file, letter) for file in EXAMPLES for letter in "ABCD"]
EVERY_CASE = pytest.mark.parametrize(("file", "letter"), CASES)
NOMINAL = {  # the segments that meet at SW3 of Example 1, at SW1 of Example 2, as published
    "example1": ("F1V2(P1V1,V3,V4,V6; P2V2)", "E1E2(P1V1,V4; P2V2,V1)"),
    "example2": ("V1F2(P1V5; P2V4,V5,V10,V11)", "V1F2(P1V4; P2V4,V3,V9,V10)"),
}
SIGNS = {"A": (1, 1), "B": (1, -1), "C": (-1, 1), "D": (-1, -1)}


@cache
def solution(file: str, letter: str) -> Solution:
    return solve(problems(file)[letter])


def tracked(file: str) -> tuple[Feature, ...]:
    return tuple(map(Feature.from_label, NOMINAL[file]))


def weighted(problem: Problem, q: Array) -> float:
    """Amount of a motion with the default weights, from the numbers of the problem file's own words."""
    size = np.ptp(problem.movable.vertices, axis=0)
    length = float(np.linalg.norm(size)) / 2
    if len(q) == 1:  # along y; or a screw of one length unit a degree, whose parameter is an angle
        pitch = 180 / np.pi
        return abs(q[0]) * (np.hypot(pitch, length) if "screw" in problem.motion.parameters[0].name else 1.0)
    return float(np.hypot(q[0], length * q[1]))


def state_of(problem: Problem, transform: Array) -> tuple[str, float]:
    """State of the pair made by exact arithmetic on the pose as given, within the stated tolerance."""
    gap = exact_gap(problem, transform)
    if abs(gap) <= DEFAULT.touch * problem.static.size:
        return "touching", gap
    return ("apart" if gap > 0 else "overlapping"), gap


def meets(letter: str, nominal: Array, rho: Array, slack: float) -> bool:
    """The paper's requirement, as it prints it: both scales at least two per cent off, each its way."""
    return all(
        new >= (1.02 - slack) * old if sign > 0 else new <= (0.98 + slack) * old
        for sign, new, old in zip(SIGNS[letter], rho, nominal, strict=True)
    )


# --------------------------------------------------------------------------------------------------- decision curves


def test_example_1_has_the_published_segments_and_switching_points():
    curve = problems("example1")["A"].curve
    assert [segment.feature for segment in curve.segments] == [Feature.from_label(label) for label in EXAMPLE_1.labels]
    assert curve.segments[0].feature.label == "V1F2(P1V6; P2V2,V3,V5)"
    assert len(curve.segments) == 5
    assert [point.index for point in curve.switching_points] == [1, 2, 3, 4]
    third = curve.switching_points[2]
    np.testing.assert_allclose(third.rho, [1.273451, 1.214536], rtol=0, atol=5e-7)
    assert set(third.features) == set(tracked("example1"))


def test_example_2_has_the_published_segments_and_switching_points():
    curve = problems("example2")["A"].curve
    assert [segment.feature for segment in curve.segments] == [Feature.from_label(label) for label in EXAMPLE_2.labels]
    assert len(curve.segments) == 3
    first, second = curve.switching_points
    np.testing.assert_allclose(first.rho, [2.378003, 2.140897], rtol=0, atol=5e-7)
    assert len(first.contacts) == 2
    assert set(first.contact_features) == set(tracked("example2"))
    np.testing.assert_allclose(second.rho, [2.811014, 1.179500], rtol=0, atol=5e-7)
    assert second.kind == "V1E2"
    assert second.contact_features == (Feature.from_label("V1E2(P1V4; P2V9,V10)"),)


@pytest.mark.parametrize("file", EXAMPLES)
def test_all_files_of_an_example_ask_about_the_same_contact(file):
    asked = [*problems(file).values(), *problems(f"{file}_touch").values()]
    assert [problem.name for problem in asked] == ["A", "B", "C", "D"] * 2
    assert {problem.goal for problem in asked[:4]} == {"beyond"}
    assert {problem.goal for problem in asked[4:]} == {"touch"}
    exact = exact_meeting(asked[0], tracked(file), np.eye(4))
    for problem in asked:
        np.testing.assert_allclose(problem.nominal_pair, [float(x) for x in exact], rtol=1e-12)
        np.testing.assert_allclose(
            problem.target, problem.nominal_pair * (1 + 0.02 * np.array(SIGNS[problem.name])), rtol=1e-15
        )


# --------------------------------------------------------------------------------------------------- published motions


def as_claim(file: str, letter: str, share: float = 1.0) -> Solution:
    """A share of the published motion as a solution, everything else worked out in rationals."""
    problem = problems(file)[letter]
    q = share * np.array(problem.published)
    transform = problem.motion.transform(q, problem.movable.seed, problem.static.seed)
    state, gap = state_of(problem, transform)
    return Solution(
        problem=problem,
        status=Status.PAIR_OVERLAPS if state == "overlapping" else Status.SOLVED,
        parameters=dict(zip((p.name for p in problem.motion.parameters), q.tolist(), strict=True)),
        transform=transform,
        amount=weighted(problem, q),
        rho=np.array([float(x) for x in exact_meeting(problem, tracked(file), transform)]),
        features=tracked(file),
        pair=problem.target,
        pair_gap=gap,
        pair_state=state,
    )


@EVERY_CASE
def test_published_motions_meet_their_requirements_and_pass_the_judge(file, letter):
    claim = as_claim(file, letter)
    assert meets(letter, claim.problem.nominal_pair, claim.rho, 0.0)
    certificate = verify(claim)
    assert certificate.passed, certificate.failed


@EVERY_CASE
def test_published_motions_cut_short_do_not_pass(file, letter):
    """They lie on the border of their requirements, nearly: a tenth less is too little."""
    claim = as_claim(file, letter, 0.9)
    assert not meets(letter, claim.problem.nominal_pair, claim.rho, 0.0)
    assert {check.name for check in verify(claim).failed} == {"requirement"}


# ------------------------------------------------------------------------------------------------------- solved cases


@EVERY_CASE
def test_every_case_is_solved_and_judged_right(file, letter):
    found = solution(file, letter)
    assert found.status in (Status.SOLVED, Status.PAIR_OVERLAPS)
    assert found.usable, found.certificate
    assert set(found.features) == set(tracked(file))
    assert found.amount == pytest.approx(weighted(found.problem, np.array(list(found.parameters.values()))), rel=1e-12)


@EVERY_CASE
def test_found_motions_meet_the_requirement_in_exact_arithmetic(file, letter):
    found = solution(file, letter)
    rho = [float(x) for x in exact_meeting(found.problem, tracked(file), found.transform)]
    assert meets(letter, found.problem.nominal_pair, np.array(rho), DEFAULT.requirement)
    np.testing.assert_allclose(found.rho, rho, rtol=1e-10)


@EVERY_CASE
def test_found_motions_keep_the_tracked_contact_all_the_way_in_exact_arithmetic(file, letter):
    found = solution(file, letter)
    problem, q = found.problem, np.array(list(found.parameters.values()))
    for s in np.linspace(0, 1, 9):
        transform = problem.motion.transform(s * q, problem.movable.seed, problem.static.seed)
        rho = [float(x) for x in exact_meeting(problem, tracked(file), transform)]
        truth = exact_of(problem.movable, problem.static, transform)
        limit = DEFAULT.touch * problem.static.size
        assert abs(truth.gap(rho)) <= limit
        assert truth.side([x * (1 - 1e-6) for x in rho]) > 0
        assert truth.side([x * (1 + 1e-6) for x in rho]) < 0


@EVERY_CASE
def test_amounts_do_not_exceed_the_published_ones(file, letter):
    found = solution(file, letter)
    published = weighted(found.problem, np.array(found.problem.published))
    assert found.amount <= published
    assert found.lower_bound <= found.amount


def test_example_1_b_takes_less_than_a_quarter_of_the_published_motion():
    found = solution("example1", "B")
    assert found.amount < 0.25 * weighted(found.problem, np.array(found.problem.published))


@EVERY_CASE
@pytest.mark.parametrize("goal", ["beyond", "touch"])
def test_the_state_of_the_pair_made_is_that_of_exact_arithmetic(file, letter, goal):
    found = solution(file if goal == "beyond" else f"{file}_touch", letter)
    state, gap = state_of(found.problem, found.transform)
    assert found.pair_state == state
    assert found.pair_gap == pytest.approx(gap, abs=1e-12 * found.problem.static.size)
    assert (found.status is Status.PAIR_OVERLAPS) == (state == "overlapping")
    np.testing.assert_array_equal(found.pair, found.problem.target)


@EVERY_CASE
def test_touch_variants_make_the_pair_touch(file, letter):
    found = solution(f"{file}_touch", letter)
    assert found.status is Status.SOLVED
    assert found.usable, found.certificate
    assert state_of(found.problem, found.transform)[0] == "touching"
    assert found.lower_bound <= found.amount


@EVERY_CASE
def test_touch_needs_no_more_than_beyond_where_the_pair_made_closes_or_opens_on_the_way(file, letter):
    """If the pair's gap changes sign from rest to the "beyond" motion, it touches somewhere on that ray."""
    beyond, touch = solution(file, letter), solution(f"{file}_touch", letter)
    rest, end = exact_gap(beyond.problem, np.eye(4)), state_of(beyond.problem, beyond.transform)
    if end[0] == "touching" or rest * end[1] < 0:
        assert touch.amount <= beyond.amount * (1 + 1e-9)
    else:  # example 2 C: one wall is overlapped by as much at rest as along the whole way in y
        assert (file, letter) == ("example2", "C")


def test_touch_comparison_covers_seven_of_eight_cases_and_halves_the_motion_of_example_1_b():
    smaller = [solution(f"{file}_touch", letter).amount / solution(file, letter).amount for file, letter in CASES]
    assert sum(ratio <= 1 + 1e-9 for ratio in smaller) >= 7
    assert solution("example1_touch", "B").amount < 0.5 * solution("example1", "B").amount


def test_single_translations_of_example_2_are_least_in_closed_form():
    """Only the floor's line moves with y, by a known rate: its crossing with the wall's line is linear in y."""
    for letter in "BC":
        problem = problems("example2")[letter]
        ends = []
        for y in (0.0, 1.0):
            transform = np.eye(4)
            transform[1, 3] = y
            ends.append(exact_meeting(problem, tracked("example2"), transform))
        needed = []
        for k in range(2):
            start, rate = float(ends[0][k]), float(ends[1][k] - ends[0][k])
            needed.append((problem.target[k] - start) / rate)
        assert len({np.sign(y) for y in needed}) == 1
        least = max(needed, key=abs)
        assert solution("example2", letter).parameters["TY"] == pytest.approx(least, rel=1e-9)
