"""The main path: from a problem to a verified solution. Start reading here."""

from __future__ import annotations

import math
from dataclasses import replace
from time import perf_counter
from typing import NamedTuple

from fcdm_opt.curve.contact import meetings
from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError, UnsolvedError
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.judge.certificate import verify
from fcdm_opt.judge.engagement import inside_fit
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.arguments import is_real
from fcdm_opt.problem.evidence import Evidence
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import EFFORTS, Solution, Status
from fcdm_opt.stages.another_amount import another_amount, nearest_weighted
from fcdm_opt.stages.branching import (
    GAP,
    SHOWN_GAP,
    SHOWN_SHARE,
    confirmed,
    proved,
)
from fcdm_opt.stages.order import STAGES
from fcdm_opt.stages.rounding import in_steps


def solve(
    problem: Problem,
    *,
    model: str = "auto",
    certify: bool = False,
    effort: str = "proved",
    seconds: float | None = None,
    throw: bool = False,
) -> Solution:
    """Find the smallest motion that meets a problem's requirement, and have it judged.

    Parameters
    ----------
    problem : Problem
    model : "auto" or a key of `STAGES`
        "auto" takes the first stage that settles the case; a stage's name forces it.
    certify : bool
        Prove until `Solution.lower_bound` is within 1e-4 of the amount, or the time given is over, and keep what
        proves it as `Solution.evidence`.
    effort : "proved" or "quick"
        "proved": without `certify` too the least motion is looked for everywhere, and bounded: of one and two
        parameters within 1 % of the amount, of more as near as some seconds of work bring it, see `Solution.gap`.
        "quick": the first motion that the stages find, for thousands of questions; its bound is what they know.
        A forced `model` is quick.
    seconds : float, optional
        Wall time of the proof. Without, it ends after a number of looks that does not depend on the machine, with
        `certify` about a minute's.
    throw : bool
        Raise `UnsolvedError` where the solution is not usable.

    Raises
    ------
    InputError
        For arguments that are not known, and a forced stage that does not settle the problem.
    UnsolvedError
        With `throw`, where no motion was found or the judge rejected it.
    """
    how = _How(model, certify, effort, seconds)
    _check(problem, how)
    if pairs := problem.feature_pairs:
        share = None if seconds is None else seconds / len(pairs)
        return _least_of([problem.changed(features=pair) for pair in pairs], how._replace(seconds=share), throw)
    start = perf_counter()
    task = Task.of(problem)
    answer = _answered(task, model)
    found, building = perf_counter(), task.building
    answer, evidence = _proved(task, answer, how)
    answer = in_steps(task, answer, lambda other: _answered(other, model))
    evidence = evidence if certify and problem.amount == "weighted" else None  # the checker knows no other amount
    solution = replace(reported(problem, task, answer), evidence=evidence)
    proved, more = perf_counter(), task.building - building
    certificate = verify(solution)
    times = {
        "build": building + more,
        "solve": found - start - building,
        "prove": proved - found - more,
        "verify": perf_counter() - proved,
    }
    solution = inside_fit(solution.with_certificate(certificate, times))
    if throw and not solution.usable:
        raise UnsolvedError(solution)
    return solution


class _How(NamedTuple):
    """How a problem is to be solved: `solve`'s arguments."""

    model: str
    certify: bool
    effort: str
    seconds: float | None


def _proved(task: Task, answer: Answer, how: _How) -> tuple[Answer, Evidence | None]:
    """Return the answer, or a better one, with the bound that is asked for."""
    if how.certify:
        return proved(task, answer, gap=GAP, seconds=how.seconds)
    if how.model != "auto":
        return answer, None
    if how.effort == "quick":
        return confirmed(task, answer), None
    return proved(task, answer, gap=SHOWN_GAP, seconds=how.seconds, share=SHOWN_SHARE)


def _least_of(problems: list[Problem], how: _How, throw: bool) -> Solution:
    """Return the least of the solutions that track two of several features each; its problem names them."""
    solutions = [solve(problem, **how._asdict()) for problem in problems]
    best = min(solutions, key=lambda solution: (not solution.usable, not solution.status.found, solution.amount))
    if throw and not best.usable:
        raise UnsolvedError(best)
    return replace(best, lower_bound=min(solution.lower_bound for solution in solutions))


def _check(problem: Problem, how: _How) -> None:
    if not isinstance(problem, Problem):
        raise InputError("expected a Problem", key="problem", found=type(problem).__name__)
    for key, value, known in (("model", how.model, ("auto", *STAGES)), ("effort", how.effort, EFFORTS)):
        if value not in known:
            raise InputError(f"unknown {key}", key=key, found=value, allowed=", ".join(known))
    if not isinstance(how.certify, bool):
        raise InputError("not a truth value", key="certify", found=how.certify, allowed="True or False")
    if how.certify and how.effort == "quick":
        raise InputError("a quick search proves nothing", key="effort", found="quick", allowed='"proved" with certify')
    if how.seconds is not None and not (is_real(how.seconds) and 0.0 < how.seconds < math.inf):
        raise InputError("not a time", key="seconds", found=how.seconds, allowed="a number > 0, or None")


def _answered(task: Task, model: str) -> Answer:
    """Return the answer of the first stage that settles the task, or of the one that is forced."""
    if not task.weighted and model != "full":  # the other stages make the weighted amount least
        nearest = nearest_weighted(task)
        weighted = _answered(nearest, model)
        return another_amount(task, confirmed(nearest, weighted) if model == "auto" else weighted)
    last: Answer | None = None
    for name, stage in STAGES.items():
        if model != name and (model != "auto" or name == "full"):
            continue
        answer = stage(task)
        if answer is None:
            continue
        if answer.settles:
            return answer
        last = answer if last is None else replace(answer, lower_bound=max(answer.lower_bound, last.lower_bound))
    if last is not None:
        return last
    raise InputError(
        "this stage does not settle the problem", key="model", found=model, allowed='"auto", or "nlp" for any problem'
    )


def reported(problem: Problem, task: Task, answer: Answer) -> Solution:
    """Return the answer as a solution: parameters by name, tracked pair, features, state of the target pair."""
    q = task.rest if answer.q is None else answer.q
    gap, slack = task.gap(q), problem.contact_slack
    state = "touching" if abs(gap) <= slack else "apart" if gap > 0 else "overlapping"
    common = Solution(
        problem=problem,
        status=answer.status,
        lower_bound=answer.lower_bound,
        pair=problem.target,
        pair_gap=gap,
        pair_state=state,
        stage=answer.stage,
        active=answer.active,
        modelled=answer.modelled or task.modelled(),
    )
    if answer.q is None:
        return common
    names = [parameter.name for parameter in task.motion.parameters]
    return replace(
        common,
        status=Status.PAIR_OVERLAPS if state == "overlapping" else answer.status,
        parameters=dict(zip(names, q.tolist(), strict=True)),
        transform=frozen(task.transform(q)),
        amount=task.amount(q),
        rho=frozen(task.tracked_contact(q)[0]) if task.tracked else problem.target,
        features=problem.tracked_features if task.tracked else _touching_features(task, q, slack),
    )


def _touching_features(task: Task, q: Array, slack: float) -> tuple[Feature, ...]:
    """Return how the target pair touches: one feature a touching part pair, each once; none where it is apart."""
    found = meetings(task.movable, task.static, task.pose(q), task.target, slack)
    return tuple(dict.fromkeys(meeting.contact.feature for meeting in found))
