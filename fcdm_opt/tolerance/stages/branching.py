"""Stage 5 and certificates: the least motion by branch and bound, with the proof that nothing smaller will do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerance.evidence import Evidence
from fcdm_opt.tolerance.proof.columns import prove
from fcdm_opt.tolerance.solution import Status
from fcdm_opt.tolerance.stages import rays
from fcdm_opt.tolerance.stages.relaxation import choices
from fcdm_opt.tolerance.stages.turns import least_over_turns
from fcdm_opt.tolerance.task import Answer, Task
from fcdm_opt.tolerances import DEFAULT

STAGE = "5: branch and bound over all motions"
MOST_PARAMETERS = 2  # for which the search is complete in a moment
GAP, FINE_GAP = 1e-4, 1e-8  # of a certificate; of the stage, which is to find the least motion by itself
CELLS = {1: 20_000, 2: 100_000, 3: 200_000}  # looked at, at most
SECONDS = 20.0  # for the search over rotations
CELLS_MORE = 60_000  # the same, for more parameters
NUDGES = (0.0, 1e-6, 1e-4, 1e-2)  # relative: how far beyond a motion its ray is searched


def branch_and_bound(task: Task) -> Answer | None:
    """Find the least motion with one or two parameters, or prove that there is none."""
    if len(task.weights) > MOST_PARAMETERS:
        return None
    if task.allows(task.rest) and task.meets(task.rest, DEFAULT.line):
        return Answer(Status.ALREADY_SATISFIED, task.rest, STAGE, modelled=task.modelled(()))
    return bounded(task, Answer(Status.NOT_FOUND, None, ""), gap=FINE_GAP)[0]


def certified(task: Task, answer: Answer) -> tuple[Answer, Evidence | None]:
    """Return an answer with a lower bound that is proved, and what proves it; a better motion if one comes up."""
    if answer.q is not None and task.amount(answer.q) == 0.0:
        return answer, None
    k = len(task.weights)
    turned = least_over_turns(task, upper=answer, gap=GAP, seconds=SECONDS) if k > MOST_PARAMETERS else None
    if turned is not None:
        better = (
            turned.q is not None and turned.upper < _amount(task, answer) and task.meets(turned.q, DEFAULT.requirement)
        )
        if better:
            answer = Answer(
                Status.SOLVED,
                turned.q,
                "5: branch and bound over rotations",
                turned.lower,
                ("the contact",),
                task.modelled(()),
            )
        answer = replace(answer, lower_bound=min(max(turned.lower, answer.lower_bound), _amount(task, answer)))
        if turned.closed:
            return answer, None
    return bounded(task, answer, gap=GAP)


def _amount(task: Task, answer: Answer) -> float:
    """Return the amount of an answer, infinite where it has no motion."""
    return np.inf if answer.q is None else task.amount(answer.q)


def bounded(task: Task, answer: Answer, *, gap: float) -> tuple[Answer, Evidence | None]:
    """Return an answer with a bound by `prove`, better or settled where that is so.

    Parameters
    ----------
    task : Task
    answer : Answer
        What is known: a motion, or none yet.
    gap : float
        Relative gap between bound and amount that is enough.
    """
    k = len(task.weights)
    upper = _amount(task, answer)
    try:
        proof = prove(task, upper, gap=gap, most=CELLS.get(k, CELLS_MORE), search=lambda q: near(task, q))
    except NotImplementedError:  # a motion or amount of the user's own that cannot be enclosed
        return answer, None
    found = answer.q if proof.q is None else proof.q
    bound = max(proof.lower_bound, answer.lower_bound)
    if found is None:
        status = answer.status
        if not np.isfinite(bound) and status is Status.NOT_FOUND:
            status = Status.INFEASIBLE
        stage = STAGE if status is Status.INFEASIBLE or not answer.stage else answer.stage
        return replace(answer, status=status, lower_bound=bound, stage=stage), proof.evidence
    amount = task.amount(found)
    if proof.q is None:
        return replace(answer, lower_bound=min(bound, amount)), proof.evidence
    active = ("the tracked contact",) if task.tracked else ("the contact",)
    better = Answer(Status.SOLVED, found, STAGE, min(bound, amount), active, task.modelled(()))
    return better, proof.evidence


def near(task: Task, q: Array) -> Array | None:
    """Return the least motion that a local search from a motion finds."""
    found: list[Array] = []
    for nudge in NUDGES:
        at = np.clip(q * (1.0 + nudge), *task.limits.T)
        if not task.tracked:
            at = rays.shortened(task, at)
        if task.meets(at, DEFAULT.requirement):
            found.append(at)
            break
    for relaxation in choices(task, q, near=True):
        better = relaxation.smallest([q], "sqpmethod")
        if better is not None and task.meets(better.q, DEFAULT.requirement):
            found.append(better.q)
    return min(found, key=task.amount, default=None)
