"""The smallest motion in hard cases: what our solver and the rival searches say, and what that is worth."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any

import numpy as np

from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks import motions as measured
from fcdm_opt_benchmarks.stability.case import WRONG_BEYOND, Grade, HardCase
from fcdm_opt_benchmarks.stability.motion_bodies import Truth
from fcdm_opt_benchmarks.stability.motion_families import FAMILIES, REFUSED

MOST = 2  # members of a family in the quick form
Answer = dict[str, Any]


def cases(quick: bool, seed: int) -> list[HardCase]:
    """Return the cases.

    Parameters
    ----------
    quick : bool
        About a tenth of them, of every family.
    seed : int
        Draws the boxes and frames that are drawn by lot; families and names are the same for all.
    """
    made = []
    for k, (family, (members, source)) in enumerate(FAMILIES.items()):
        own = list(members(np.random.default_rng([seed, k])))
        if quick:
            own = own[:: max(8, math.ceil(len(own) / MOST))]
        made += [
            HardCase(family, name, "motion", {"problem": asked}, _truth(truth, source)) for name, asked, truth in own
        ]
    return made


def _truth(truth: Truth, source: str) -> dict[str, Any]:
    if truth == REFUSED:
        return {"refused": True, "source": "the question is bad"}
    return {"none": True, "source": source} if truth is None else {"amount": truth, "source": source}


# ------------------------------------------------------------------------------------------------------- the methods


def _solved(data: Mapping[str, Any], **keywords: Any) -> Answer:
    """Return what our solver says; a motion that its judge rejects is flagged by the solver itself."""
    from fcdm_opt.errors import InputError
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.problem.solution import Status
    from fcdm_opt.solver import solve

    try:
        problem = Problem.from_dict(data["problem"])
    except InputError as reason:
        return {"refused": str(reason)}
    solution = solve(problem, **keywords)
    said = f"{solution.status.name}: {solution.status.value}"
    bound = {"bound": solution.lower_bound} if math.isfinite(solution.lower_bound) else {}
    if solution.usable:
        return {"q": list(solution.parameters.values()), **bound}
    return {"none": said} if solution.status is Status.INFEASIBLE else {"flag": said, **bound}


def _rival(name: str, data: Mapping[str, Any]) -> Answer:
    """Return the motion that a rival believes in; its finding none is no claim that there is none."""
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt_benchmarks.method import MotionAnswer

    answer = measured.answered(name, Problem.from_dict(data["problem"]))
    return {"q": answer.q.tolist()} if isinstance(answer, MotionAnswer) else {"flag": answer.reason}


OURS = ("solve", "solve, certified")
METHODS: dict[str, Callable[[Mapping[str, Any]], Answer]] = {
    "solve": _solved,
    "solve, certified": partial(_solved, certify=True),
    "full model, judged": partial(_solved, model="full"),  # the yardstick: one start, nothing proved
    **{name: partial(_rival, name) for name in measured.RIVALS},
}


def applies(name: str, case: HardCase) -> bool:
    """Tell whether a method takes the case: a rival where it can express it, and where the question is not bad."""
    if name not in measured.RIVALS:
        return name in OURS or "refused" not in case.truth
    return "refused" not in case.truth and _refusals(json.dumps(case.data["problem"]))[name] is None


@cache
def _refusals(text: str) -> dict[str, str | None]:
    """Return for each rival why it cannot express a problem, or None."""
    from fcdm_opt.problem.problem import Problem

    problem = Problem.from_dict(json.loads(text))
    return {method.name: method.refuses(problem) for method in measured.METHODS}


# --------------------------------------------------------------------------------------------------------- the verdict


def judged(case: HardCase, answer: Mapping[str, Any]) -> Grade:
    """Return what an answer is worth.

    Wrong is a motion larger than the least by more than `WRONG_BEYOND`, one that misses the conditions by more than
    that, any where there is none, the claim that there is none where there is one, and a bound above the least amount.
    """
    truth = case.truth
    if "refused" in truth or "refused" in answer:
        return _refusal(truth, answer)
    least = truth.get("amount", math.inf)
    if answer.get("bound", 0.0) > least * (1.0 + DEFAULT.requirement) + DEFAULT.line * _size(case):
        return Grade("wrong", answer["bound"] / least - 1.0 if least else None, "a lower bound above the least amount")
    if "flag" in answer:
        return Grade("flagged", reason=str(answer["flag"]))
    if "none" in answer:
        if "none" in truth:
            return Grade("right", reason=str(answer["none"]))
        return Grade("wrong", reason=f"called impossible ({answer['none']}), but {least} will do")
    if "none" in truth:
        return Grade("wrong", reason=f"{answer['q']}, where no motion will do")
    return _motion(case, answer["q"], least)


def _refusal(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> Grade:
    if "refused" in truth and "refused" in answer:
        return Grade("right", reason=str(answer["refused"]))
    said = answer.get("flag", answer.get("refused"))
    return Grade("wrong" if said is None else "flagged", reason="a bad question, answered" if said is None else said)


def _size(case: HardCase) -> float:
    """Return the larger box diagonal of the bodies."""
    rows = [np.array(body["vertices"]) for body in case.data["problem"]["bodies"].values()]
    return max(float(np.linalg.norm(np.ptp(own, axis=0))) for own in rows)


def _motion(case: HardCase, q: list[float], least: float) -> Grade:
    """Compare a motion with the least amount, and have the judge look at its conditions."""
    from fcdm_opt.model.task import Task
    from fcdm_opt.problem.problem import Problem

    if not np.isfinite(q).all():
        return Grade("wrong", reason=f"a motion of {q}")
    problem = Problem.from_dict(case.data["problem"])
    task = Task.of(problem)
    amount = task.amount(np.array(q))
    more, T = amount - least, task.transform(np.array(q))
    moved = problem.movable.vertices @ (T[:3, :3] - np.eye(3)).T + T[:3, 3]
    error = abs(more) / least if least else None
    # within the slack bodies touch: an amount is not larger where it is so by less than that displaces
    slack = problem.contact_slack if least else WRONG_BEYOND * problem.size
    if more > WRONG_BEYOND * least and more / amount * np.linalg.norm(moved, axis=1).max() > slack:
        return Grade("wrong", error, f"not the least: {amount:.9g}, where {least:.9g} will do")
    examined = measured.judged(problem, q)
    assert examined.certificate is not None
    failed = [check for check in examined.certificate.failed if task.tracked or check.name not in _touching(examined)]
    if more >= -WRONG_BEYOND * least:
        failed = [check for check in failed if not abs(check.value - check.limit) <= _allowed(check.name, problem.size)]
    if failed:
        said = "; ".join(f"{check.name} {check.value:.3g} against {check.limit:.3g}" for check in failed)
        return Grade("wrong", error, f"misses its conditions: {said}")
    return Grade("right", error)


def _touching(solution: Any) -> set[str]:
    """Return the checks of how a pair touches: nobody was asked for that where no feature is tracked."""
    return {"features", "apart below", "overlapping above", "snug", "sides",
            *(f"contact {k}" for k in range(1, len(solution.features) + 1))}  # fmt: skip


def _allowed(name: str, size: float) -> float:
    """Return by how much a check may fail: relative to the bodies' size, or of what compares scales."""
    return WRONG_BEYOND * (1.0 if name in ("requirement", "rigid transform") else size)
