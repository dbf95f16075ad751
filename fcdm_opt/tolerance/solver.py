"""The main path: from a problem to a verified solution. Start reading here."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from fcdm_opt.curve.decision_curve import Segment
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.region import support_feature
from fcdm_opt.errors import InputError, UnsolvedError
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.tolerance import models
from fcdm_opt.tolerance.certificate import verify
from fcdm_opt.tolerance.problem import Problem
from fcdm_opt.tolerance.solution import Solution, Status
from fcdm_opt.tolerance.task import Answer, Task
from fcdm_opt.tolerances import DEFAULT

MODELS = ("auto", "nlp")


def solve(problem: Problem, *, model: str = "auto", certify: bool = False, throw: bool = False) -> Solution:
    """Find the smallest motion that meets a problem's requirement, and have it judged.

    Parameters
    ----------
    problem : Problem
    model : "auto" or "nlp"
        "auto" takes the first stage that settles the case; "nlp" forces the nonlinear program.
    certify : bool
        Proof by branch and bound; not available in this version.
    throw : bool
        Raise `UnsolvedError` where the solution is not usable.

    Raises
    ------
    InputError
        For arguments that are not known.
    UnsolvedError
        With `throw`, where no motion was found or the judge rejected it.
    """
    _check(problem, model, certify)
    start = perf_counter()
    task = Task.of(problem)
    built = perf_counter()
    stages = models.STAGES if model == "auto" else (models.nonlinear,)
    answer = next(answer for stage in stages if (answer := stage(task)) is not None)
    solution = _report(problem, task, answer)
    solved = perf_counter()
    certificate = verify(solution)
    seconds = {"build": built - start, "solve": solved - built, "verify": perf_counter() - solved}
    solution = solution.with_certificate(certificate, seconds)
    if throw and not solution.usable:
        raise UnsolvedError(solution)
    return solution


def _check(problem: Problem, model: str, certify: bool) -> None:
    if not isinstance(problem, Problem):
        raise InputError("expected a Problem", key="problem", found=type(problem).__name__)
    if model not in MODELS:
        raise InputError("unknown model", key="model", found=model, allowed=", ".join(MODELS))
    if certify:
        raise InputError("not available in this version", key="certify", found=certify, allowed="False")


def _report(problem: Problem, task: Task, answer: Answer) -> Solution:
    """Return the answer as a solution: parameters by name, tracked pair, features, state of the target pair."""
    q = task.rest if answer.q is None else answer.q
    gap, slack = task.gap(q), DEFAULT.touch * task.size
    state = "touching" if abs(gap) <= slack else "apart" if gap > 0 else "overlapping"
    common = Solution(
        problem=problem, status=answer.status, lower_bound=answer.lower_bound, pair=problem.target, pair_gap=gap,
        pair_state=state, stage=answer.stage, active=answer.active, modelled=answer.modelled or {},
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
        features=_tracked_features(problem) if task.tracked else _touching_features(task, q),
    )


def _tracked_features(problem: Problem) -> tuple[Feature, ...]:
    contact = problem.nominal_contact
    if isinstance(contact, Segment):
        return (contact.feature,)
    return contact.features if contact is not None else ()


def _touching_features(task: Task, q: Array) -> tuple[Feature, ...]:
    """Return the features by which the target pair touches, each once; none where it is apart."""
    pose, slack = task.pose(q), DEFAULT.touch * task.size
    found = []
    for i, j in np.ndindex(len(task.movable.parts), len(task.static.parts)):
        _, rows, separations = task.separations((i, j), pose)
        if abs(separations.max()) <= slack:
            one, two = task.movable.parts[i], task.static.parts[j]
            near = rows[separations >= -slack, :3]
            found += [support_feature(one, two, normal, pose) for normal in near]
    return tuple(dict.fromkeys(found))
