"""The main path: from a problem to a verified solution. Start reading here."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.region import support_feature
from fcdm_opt.errors import InputError, UnsolvedError
from fcdm_opt.geometry.bodies import Array, frozen
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
    exact = (models.satisfied, models.straight, models.one_parameter) if model == "auto" else ()
    answer = next(filter(None, (stage(task) for stage in exact)), None) or models.nonlinear(task)
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
    rest = np.zeros(len(task.weights))
    q = rest if answer.q is None else answer.q
    gap = task.gap(q)
    slack = DEFAULT.touch * task.size
    state = "touching" if abs(gap) <= slack else "apart" if gap > 0 else "overlapping"
    if answer.q is None:
        return Solution(problem=problem, status=answer.status, lower_bound=answer.lower_bound, pair=problem.target,
                        pair_gap=gap, pair_state=state, stage=answer.stage)
    status = Status.PAIR_OVERLAPS if state == "overlapping" and answer.status.found else answer.status
    names = [parameter.name for parameter in task.motion.parameters]
    return Solution(
        problem=problem,
        status=status,
        parameters=dict(zip(names, q.tolist(), strict=True)),
        transform=frozen(task.transform(q)),
        amount=task.amount(q),
        lower_bound=answer.lower_bound,
        rho=frozen(task.tracked_contact(q)[0]) if task.tracked else problem.target,
        features=_tracked_features(problem) if task.tracked else _touching_features(task, q),
        pair=problem.target,
        pair_gap=gap,
        pair_state=state,
        active=answer.active,
        modelled=answer.modelled or {},
        stage=answer.stage,
    )


def _tracked_features(problem: Problem) -> tuple[Feature, ...]:
    contact = problem.nominal_contact
    features = getattr(contact, "features", None)
    return tuple(features) if features else (contact.feature,)


def _touching_features(task: Task, q: Array) -> tuple[Feature, ...]:
    """Return the features by which the target pair touches, each once; none where it is apart."""
    pose = task.pose(q)
    found = []
    for i, one in enumerate(task.movable.parts):
        for j, two in enumerate(task.static.parts):
            _, rows = kernels.facet_rows(*one.packed, *two.packed, pose, DEFAULT.tie)
            separations = rows[:, 5] - rows[:, 3:5] @ task.target
            if abs(separations.max()) <= DEFAULT.touch * task.size:
                near = np.flatnonzero(separations >= -DEFAULT.touch * task.size)
                found += [support_feature(one, two, rows[k, :3], pose) for k in near]
    return tuple(dict.fromkeys(found))
