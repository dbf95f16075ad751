"""Hard programs and motions of the stability map: truths by another way, verdicts on planted answers, ours right."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest

from fcdm_opt.geometry.collision import ScaledPair
from fcdm_opt.model.task import Task
from fcdm_opt.problem.problem import Problem
from fcdm_opt_benchmarks.stability import motions, programs
from fcdm_opt_benchmarks.stability.case import WRONG_BEYOND, HardCase

SEED = 0
SAMPLES = 30
FEW = 1e-5  # relative: ten times what may be wrong
MODULES = {"program": programs, "motion": motions}


@cache
def cases(question: str, quick: bool = True) -> tuple[HardCase, ...]:
    return tuple(MODULES[question].cases(quick, SEED))


def named(question: str, quick: bool = True) -> Any:
    return pytest.mark.parametrize("case", cases(question, quick), ids=lambda case: f"{case.family}: {case.name}")


@cache
def answers(question: str) -> dict[tuple[str, str], Any]:
    """Ours to all of the quick form, as JSON brings them; solved once."""
    solve = MODULES[question].METHODS["solve"]
    return {(case.family, case.name): json.loads(json.dumps(solve(case.data))) for case in cases(question)}


def ours(case: HardCase) -> Any:
    return answers(case.question)[case.family, case.name]


# ----------------------------------------------------------------------------------------------------------- the lists


@pytest.mark.parametrize("question", MODULES)
def test_cases_are_plain_and_keep_their_names(question):
    own = cases(question, False)
    names = [(case.family, case.name) for case in own]
    assert len(set(names)) == len(names)
    assert [(case.family, case.name) for case in MODULES[question].cases(False, SEED + 1)] == names
    assert all(case.question == question and case.truth["source"] for case in own)
    for case in own:
        assert json.loads(json.dumps([case.data, case.truth], allow_nan=False)) == [case.data, case.truth]
    assert {case.family for case in cases(question)} == {case.family for case in own}
    assert len(own) / 12 <= len(cases(question)) <= len(own) / 3


def test_only_what_is_drawn_by_lot_depends_on_the_seed():
    families = {case.family for one, two in zip(cases("motion", False), motions.cases(False, 1), strict=True)
                for case in [one] if one.data != two.data}  # fmt: skip
    assert families == {"unions", "turned frames"}


# ------------------------------------------------------------------------------------------------ truths of programs


def stated(case: HardCase, x: Any, m: Any = math) -> tuple[float, list[float]]:
    """f(x), and by how much x misses each condition."""
    f, e, g = programs.PROGRAMS[case.data["program"]].rows(x, case.data["numbers"], m)
    ends = zip(x, case.data["low"], case.data["high"], strict=True)
    off = [
        max((-math.inf if low is None else low) - y, y - (math.inf if high is None else high)) for y, low, high in ends
    ]
    return f, [*(abs(row) for row in e), *(max(0.0, -row) for row in g), *(max(0.0, y) for y in off)]


@named("program", False)
def test_the_least_x_meets_the_formulas_and_a_smaller_one_does_not(case):
    """Drawn from what is smaller than the truth, or within the bounds; Fractions where it is a matter of 1e-8."""
    best, size = case.truth.get("x", []), len(case.data["start"])
    for x in best:
        at = [own if any(x) else 1e-9 for own in x]
        assert max(stated(case, at)[1]) <= 1e-13 * max(1.0, case.data["numbers"].get("c", 0.0) ** 2)
    values = [stated(case, x)[0] if any(x) else 0.0 for x in best]
    assert all(value == pytest.approx(values[0], rel=1e-12) for value in values)
    if case.data["program"] in ("slot", "blend") and not best:
        numbers, high = case.data["numbers"], [Fraction(x) for x in case.data["high"] if x is not None]
        assert sum(high) < 1 if "p" in numbers else numbers["more"] > 0
        return
    rng = np.random.default_rng(5)
    reach = math.dist(best[0], [0.0] * size) if best else 9.0
    for _ in range(200):
        x = rng.normal(size=size)
        x *= reach * (1 - WRONG_BEYOND) * rng.uniform(0, 1) ** (1 / size) / np.linalg.norm(x)
        low, high = (np.array([end if y is None else y for y in own], dtype=float)
                     for own, end in ((case.data["low"], -np.inf), (case.data["high"], np.inf)))  # fmt: skip
        if case.data["program"] == "blend":  # along the line
            x = np.array([best[0][0] + (y := rng.normal()), best[0][1] - y]) if best else x
        x = np.clip(x, low, high).tolist()
        f, missed = stated(case, x)
        assert max(missed) > 0 or (best and f >= values[0] - 1e-9 * abs(values[0]))


def test_a_scan_of_the_equations_finds_no_smaller_root():
    """From 0 outwards within the bounds: signs change first at the truth, or, at a pole, with |tan| above 1e3."""
    for case in cases("program", False):
        if case.data["program"] not in ("tangent", "cosine"):
            continue
        low, high = (end if own[0] is None else own[0] for own, end in ((case.data["low"], -9), (case.data["high"], 9)))
        t = np.linspace(low, high, 100_001)
        _, (residual,), _ = programs.PROGRAMS[case.data["program"]].rows([t], case.data["numbers"], np)
        changes = (np.sign(residual[1:]) != np.sign(residual[:-1])) & (np.abs(residual[1:]) < 1e3)
        found = np.abs(t[:-1][changes])
        if "none" in case.truth:
            assert not found.size
        elif case.truth["x"] != [[0.0]]:
            assert found.min() == pytest.approx(abs(case.truth["x"][0][0]), abs=3 * (high - low) / 100_000)


# ------------------------------------------------------------------------------------------------- truths of motions


def region(problem: Problem, least: float, rng: np.random.Generator) -> np.ndarray:
    """Motions within the limits whose amount is smaller than the least."""
    k = len(problem.weights)
    away = rng.normal(size=(SAMPLES * 20, k))
    away *= (rng.uniform(0, 1, (len(away), 1)) ** (1 / k)) / np.linalg.norm(away, axis=1)[:, None]
    q = np.vstack([np.zeros(k), away * least * (1 - 1e-3) / problem.weights])
    q = np.clip(q, *problem.limits.T)
    return q[np.linalg.norm(q * problem.weights, axis=1) < least * (1 - 1e-4)][:SAMPLES]


UNASKED = (  # goals, amounts and keep-outs of which a distance does not tell
    "beyond the coherent range",
    "flush contacts",
    "keep-outs",
    "largest displacement",
    "requirement already met",
    "several contacts at once",
    "tolerance 0 to 100 %",
)


@pytest.mark.sampled(13)
@pytest.mark.parametrize("family", [family for family in motions.FAMILIES if family not in UNASKED])
def test_smaller_motions_do_not_do_by_another_librarys_distances(family):
    """The pair does not come to touch anywhere: its distance keeps its sign; nor is it clear."""
    rng, asked = np.random.default_rng(3), 0
    for case in [case for case in cases("motion", False) if case.family == family][::4]:
        data = case.data["problem"]["case"][0]
        if (
            "refused" in case.truth
            or data["goal"] not in ("touch", "clear")
            or "amount" in data
            or "keep_out" in case.data["problem"]
        ):
            continue
        problem = Problem.from_dict(case.data["problem"])
        pair = ScaledPair(problem.movable, problem.static)
        least = case.truth.get("amount", 3.0 * float(problem.weights.max()))
        room = max(problem.contact_slack, 1e-12 * np.abs(problem.movable.vertices).max())
        seeds = problem.movable.seed, problem.static.seed
        poses = [problem.motion.transform(q, *seeds) for q in region(problem, least, rng)]
        gaps = np.array([pair.signed_distance(problem.target, pose) for pose in poses])
        asked += len(gaps)
        if problem.goal == "clear":
            assert (gaps < problem.clearance + room).all()
        else:
            assert (gaps > -room).all() or (gaps < room).all()
    assert asked > 10


# -------------------------------------------------------------------------------------------------------- ours is right


@pytest.mark.sampled(1)  # `stability --quick` asks all of them
@named("program")
def test_ours_is_right_on_programs(case):
    assert programs.judged(case, ours(case)).outcome == "right"


def test_bodies_may_grow_to_twice_their_size():
    """A tolerance of 100 % is refused since, so that a case of the full form was no question any more."""
    case = next(own for own in cases("program", False) if own.name == "an equation eight times, 1 away")
    assert programs.judged(case, programs.METHODS["solve"](case.data)).outcome == "right"


@pytest.mark.sampled(3)  # `stability --quick` asks 83 of them
@named("motion")
def test_ours_is_right_on_motions_or_says_that_it_found_none(case):
    verdict = motions.judged(case, ours(case))
    assert verdict.outcome == "right" or ("none" in case.truth and verdict.outcome == "flagged"), verdict


# ------------------------------------------------------------------------------------------------------ planted answers


def verdicts(case: HardCase, answers: Mapping[str, Any]) -> dict[str, str]:
    judge = MODULES[case.question].judged
    return {name: judge(case, answer).outcome for name, answer in answers.items()}


@pytest.mark.sampled(19)
@named("program")
def test_planted_answers_to_programs_are_seen_through(case):
    best = case.truth.get("x")
    if best is None:
        wrong = {"an x": {"x": case.data["start"]}}
        right = {"none": {"none": "infeasible"}}
    else:
        x = np.array(best[-1])
        off = FEW * max(float(np.linalg.norm(x)), programs.FLOOR)
        wrong = {"none": {"none": "infeasible"}, "beside": {"x": (x + off).tolist()}, "nan": {"x": [math.nan] * len(x)}}
        right = {"truth": {"x": x.tolist()}, "hardly off": {"x": (x + off / 100).tolist()}}
    assert set(verdicts(case, wrong).values()) == {"wrong"}
    assert set(verdicts(case, right).values()) == {"right"}
    assert verdicts(case, {"flag": {"flag": "no convergence"}}) == {"flag": "flagged"}


@pytest.mark.sampled(42)
@named("motion")
def test_planted_answers_to_motions_are_seen_through(case):
    """Larger, smaller, none, one too many, a bound too high; with the solver's motion to start from."""
    assert verdicts(case, {"flag": {"flag": "no convergence"}}) == {"flag": "flagged"}
    if "refused" in case.truth:
        assert verdicts(case, {"q": {"q": [0.0]}, "none": {"none": "no"}, "refused": {"refused": "bad"}}) == {
            "q": "wrong", "none": "wrong", "refused": "right"}  # fmt: skip
        return
    if "none" in case.truth:
        k = len(Problem.from_dict(case.data["problem"]).weights)
        assert verdicts(case, {"q": {"q": [0.0] * k}, "none": {"none": "no"}}) == {"q": "wrong", "none": "right"}
        return
    answer = ours(case)
    q, least = np.array(answer["q"]), case.truth["amount"]
    planted = {"none": {"none": "no"}, "nan": {"q": [math.nan] * len(q)}}
    planted |= {
        "bound": {**answer, "bound": least * (1 + 1e-8) + 1e-6},
        "flagged bound": {"flag": "", "bound": 9 + 9 * least},
    }
    if least > 1e-3:  # what is smaller is within what counts as touching
        planted |= {"larger": {"q": ((1 + FEW) * q).tolist()}, "smaller": {"q": ((1 - FEW) * q).tolist()}}
    if least == 0:
        planted["needless"] = {"q": [1e-3] * len(q)}
    assert set(verdicts(case, planted).values()) == {"wrong"}, planted


def test_a_motion_that_does_not_do_is_wrong_although_its_amount_is_right():
    """The other way, or about the other side of the plate."""
    case = next(case for case in cases("motion", False) if case.name == "touch, x at 1")
    (q,) = motions.METHODS["solve"](case.data)["q"]
    verdict = motions.judged(case, {"q": [-q]})
    assert (verdict.outcome, verdict.error) == ("wrong", pytest.approx(0))
    assert "conditions" in verdict.reason


def test_a_right_answer_is_wrong_where_a_smaller_motion_is_planted_as_the_truth():
    case = next(case for case in cases("motion") if case.family == "two optima of equal amount")
    answer = ours(case)
    planted = replace(case, truth={**case.truth, "amount": (1 - FEW) * case.truth["amount"]})
    assert [motions.judged(own, answer).outcome for own in (case, planted)] == ["right", "wrong"]


# ------------------------------------------------------------------------------------------------------------ methods


@pytest.mark.slow
def test_every_rival_is_asked_what_it_can_express():
    from fcdm_opt_benchmarks.motions import RIVALS

    assert set(RIVALS) < set(motions.METHODS)
    asked = {name: sum(motions.applies(name, case) for case in cases("motion")) for name in motions.METHODS}
    bad = sum("refused" in case.truth for case in cases("motion"))
    several = sum(case.family == "several contacts at once" for case in cases("motion"))
    assert asked["solve"] == asked["SLSQP"] + bad + several == len(cases("motion"))
    assert 10 < asked["grid"] < asked["coal in the loop"] < asked["SLSQP"]
    linear = [case for case in cases("program") if programs.applies("HiGHS", case)]
    assert 0 < len(linear) < len(cases("program"))
    assert not any(programs.PROGRAMS[case.data["program"]].quadratic for case in cases("program") if case not in linear)


@pytest.mark.parametrize("method", [name for name in programs.METHODS if name not in programs.OURS])
def test_general_solvers_solve_a_plain_program_and_see_that_another_has_no_solution(method):
    plain = next(case for case in cases("program", False) if case.name == "P = 2, 4, l = 0, x within None, None")
    assert programs.judged(plain, programs.METHODS[method](plain.data)).outcome == "right"
    never = next(case for case in cases("program", False) if case.name == "x + y = 1 within 0.3, 0.5")
    assert programs.judged(never, programs.METHODS[method](never.data)).outcome in ("right", "flagged")


def test_known_failures_are_found_again():
    """Of the list: IPOPT on the tangent's wrong root or at a stationary start, HiGHS by 5e-8, Clarabel's 3e-5."""
    found = {}
    for method, name in (("IPOPT", "c = 5"), ("IPOPT", "c = 0.9"), ("HiGHS", "x <= 1 and x >= 1 + 5e-08"),
                         ("Clarabel", "P = 2, 4, l = -2, x >= 0 and y >= 0"), ("IPOPT", "y = 0.5 from 0")):  # fmt: skip
        case = next(case for case in cases("program", False) if case.name == name)
        found[name] = programs.judged(case, programs.METHODS[method](case.data)).outcome
    assert list(found.values()) == ["wrong", "flagged", "wrong", "wrong", "flagged"], found


def test_the_solvers_first_stage_settles_what_is_already_met():
    for case in cases("motion"):
        if case.family == "requirement already met":
            assert Task.of(Problem.from_dict(case.data["problem"])).met_at_rest
