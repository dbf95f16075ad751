"""Amounts other than the weighted one: the same motions, from the smallest weighted one on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.model.bounds import displacement_bound
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages.relaxation import choices
from fcdm_opt.tolerances import DEFAULT

LEAST_SHARE = 1e-2  # of the largest weight, for parameters that an amount ignores near rest
FIRST_CHOICES = 4  # of features at rest, tried from two starts
MOST_ASIDE = 0.1  # of the shortest shift, that a motion may miss
ROUNDS = 5  # of choosing features anew at the best motion so far


def nearest_weighted(task: Task) -> Task:
    """Return the same task with a weighted amount: the one most like the task's own near rest."""
    weights = task.weights
    if isinstance(task.amount_kind, OwnAmount):
        own = task.amount_kind.weights_at_rest
        known = np.isfinite(own) & (own > 0)
        if known.any():
            weights = frozen(np.maximum(np.where(known, own, 0.0), LEAST_SHARE * own[known].max()))
    return replace(task, amount_kind="weighted", weights=weights)


def another_amount(task: Task, weighted: Answer) -> Answer:
    """Return the least motion by the task's own amount, found from the least by the weighted one.

    That is of the task `nearest_weighted`. Whether there is a motion does not depend on the amount. That the
    nonlinear program finds the least is not proved; the lower bound is that of the displacement, or 0.
    """
    if weighted.q is None:
        bound = weighted.lower_bound if weighted.status is Status.INFEASIBLE else displacement_bound(task)
        return replace(weighted, lower_bound=bound)
    if not weighted.q.any() and task.amount(task.rest) == 0.0:
        return weighted
    best = task.answer(weighted.q, active=weighted.active, modelled=weighted.modelled)
    least, direct = displacement_bound(task), _direct(task)
    for q in direct:
        if task.amount(q) < best.amount and task.meets(q, DEFAULT.requirement):
            best = task.answer(q, active=("the nearest points",), modelled=weighted.modelled)
    best = _improved(task, best, [*direct, task.start], least)
    word = "displacement" if task.amount_kind == "displacement" else "the amount given"
    status = weighted.status if not best.motion.any() else Status.SOLVED
    stage = f"{weighted.stage}; then 4: nonlinear program, {word}"
    return replace(best, status=status, stage=stage, lower_bound=min(least, best.amount))  # but for rounding


def _improved(task: Task, best: Answer, further: list[Array], least: float) -> Answer:
    """Return the least motion that the nonlinear program finds with features at the best so far, and at rest."""
    # it starts at first from `further` motions too. No motion stays below the amount `least`
    for turn in range(ROUNDS):
        before, first = best.amount, turn == 0
        promising = sorted(choices(task, task.start), key=lambda choice: choice.promise) if first else []
        for relaxation in (*choices(task, best.motion, near=True), *promising[:FIRST_CHOICES]):
            if best.amount <= least * (1.0 + DEFAULT.nominal):
                return best
            starts = [best.motion, *further] if first else [best.motion]
            found = relaxation.smallest(starts, "sqpmethod") or relaxation.smallest(starts[:1], "ipopt")
            if found is not None and found.amount < best.amount * (1.0 - DEFAULT.nominal):  # whole turns change nothing
                best = found
        if best.amount >= before * (1.0 - DEFAULT.nominal):
            break
    return best


def _direct(task: Task) -> list[Array]:
    """Return the motion that, to first order, shifts body 1 the shortest way to the gap that the nearest pair needs.

    None where the goal asks for no gap, or the motion cannot shift that way.
    """
    if not np.isfinite(task.needs).any():
        return []
    gaps = task.pair_gaps(task.rest)
    i, j = np.unravel_index(int((gaps - task.needs).argmin()), gaps.shape)
    parts = int(i), int(j)
    _, rows, separations = task.separations(parts, task.pose(task.rest))
    way, gap = rows[separations.argmax(), :3], float(separations.max())
    if gap > 0:
        way = task.way_between(parts, task.rest)
        way, gap = way / np.linalg.norm(way), float(task.pair_gaps(task.rest, {parts: way})[parts])
    rates = task.rates(task.rest)[1]
    shifts = rates[:, :3, :3] @ task.movable.seed + rates[:, :3, 3]
    turns = task.size * np.array([[W[2, 1], W[0, 2], W[1, 0]] for W in rates])
    wanted = np.concatenate([(gap - max(task.needs[j], 0.0)) * way, np.zeros(3)])
    effects = np.hstack([shifts, turns]).T
    q = np.linalg.lstsq(effects, wanted, rcond=DEFAULT.nominal)[0]
    if np.linalg.norm(effects @ q - wanted) > MOST_ASIDE * np.linalg.norm(wanted):
        return []
    return [np.asarray(np.clip(q, *task.limits.T))]
