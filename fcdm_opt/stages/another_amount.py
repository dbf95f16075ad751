"""Amounts other than the weighted one: the same motions, from the smallest weighted one on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcdm_opt.geometry.arrays import frozen
from fcdm_opt.model.bounds import displacement_bound
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages.relaxation import choices
from fcdm_opt.tolerances import DEFAULT

LEAST_SHARE = 1e-2  # of the largest weight, for parameters that an amount ignores near rest
FIRST_CHOICES = 4  # of features at rest, tried from two starts
ROUNDS = 5  # of choosing features anew at the best motion so far


def nearest_weighted(task: Task) -> Task:
    """Return the same task with a weighted amount: the one most like the task's own near rest."""
    weights = task.weights
    if isinstance(task.amount_kind, OwnAmount):
        own = task.amount_kind.weights_at_rest
        known = np.isfinite(own) & (own > 0)
        if known.any():
            least = LEAST_SHARE * own[known].max()
            weights = frozen(np.maximum(np.where(known, own, 0.0), least))
    return replace(task, amount_kind="weighted", weights=weights)


def another_amount(task: Task, weighted: Answer) -> Answer:
    """Return the least motion by the task's own amount, found from the least by the weighted one.

    Whether there is a motion does not depend on the amount. That the nonlinear program finds the least is not proved;
    the lower bound is that of the displacement, or 0.

    Parameters
    ----------
    task : Task
    weighted : Answer
        To `nearest_weighted`.
    """
    if weighted.q is None:
        bound = weighted.lower_bound if weighted.status is Status.INFEASIBLE else displacement_bound(task)
        return replace(weighted, lower_bound=bound)
    if not weighted.q.any() and task.amount(task.rest) == 0.0:
        return weighted
    best = task.answer(weighted.q, active=weighted.active, modelled=weighted.modelled)
    least = displacement_bound(task)
    best = _improved(task, best, least)
    word = "displacement" if task.amount_kind == "displacement" else "the amount given"
    status = weighted.status if not best.motion.any() else Status.SOLVED
    stage = f"{weighted.stage}; then 4: nonlinear program, {word}"
    return replace(best, status=status, stage=stage, lower_bound=min(least, best.amount))  # but for rounding


def _improved(task: Task, best: Answer, least: float) -> Answer:
    """Return the least motion that the nonlinear program finds with the features at the best so far, and those at rest.

    No motion stays below the amount `least`.
    """
    for turn in range(ROUNDS):
        before, first = best.amount, turn == 0
        promising = sorted(choices(task, task.start), key=lambda choice: choice.promise) if first else []
        for relaxation in (*choices(task, best.motion, near=True), *promising[:FIRST_CHOICES]):
            if best.amount <= least * (1.0 + DEFAULT.nominal):
                return best
            starts = [best.motion, task.start] if first else [best.motion]
            found = relaxation.smallest(starts, "sqpmethod") or relaxation.smallest(starts[:1], "ipopt")
            if found is not None and found.amount < best.amount * (1.0 - DEFAULT.nominal):  # whole turns change nothing
                best = found
        if best.amount >= before * (1.0 - DEFAULT.nominal):
            break
    return best
