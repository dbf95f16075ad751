"""Amounts other than the weighted one: the same motions, from the smallest weighted one on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.model.bounds import displacement_bound
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages.relaxation import Found, Relaxation, choices
from fcdm_opt.tolerances import DEFAULT

LEAST_SHARE = 1e-2  # of the largest weight, for parameters that an amount ignores near rest
MOST_ASIDE = 0.1  # of the shortest shift, that a motion may miss
FIRST_CHOICES = 4  # of features at rest, tried from several starts
MOST_BESIDE = 6  # starts on all sides of the best known motion
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
    best = Found(weighted.q, task.amount(weighted.q), weighted.active, weighted.modelled or {})
    least, direct = displacement_bound(task), _direct(task)
    for q in direct:
        if task.amount(q) < best.amount and task.meets(q, DEFAULT.requirement):
            best = Found(q, task.amount(q), ("the nearest points",), weighted.modelled or {})
    best = _improved(task, best, [*direct, task.start], least)
    word = "displacement" if task.amount_kind == "displacement" else "the amount given"
    status = weighted.status if not best.q.any() else Status.SOLVED
    bound = min(least, best.amount)  # the two differ by rounding at most
    return Answer(
        status, best.q, f"{weighted.stage}; then 4: nonlinear program, {word}", bound, best.active, best.modelled
    )


def _improved(task: Task, best: Found, starts: list[Array], least: float) -> Found:
    """Return the least motion that the nonlinear program finds with the features at the best so far, and those at rest.

    Parameters
    ----------
    task : Task
    best : Found
    starts : list of (k,) arrays
        Motions to start from besides the best.
    least : float
        Amount that no motion stays below.
    """

    def tried(relaxations: Iterable[Relaxation], starts: list[Array]) -> None:
        nonlocal best
        for relaxation in relaxations:
            if best.amount <= least * (1.0 + DEFAULT.nominal):
                return
            found = relaxation.smallest([best.q, *starts], "sqpmethod") or relaxation.smallest([best.q], "ipopt")
            if found is not None and found.amount < best.amount * (1.0 - DEFAULT.nominal):  # whole turns change nothing
                best = found

    beside = [np.clip(best.q + s * x, *task.limits.T) for x in np.diag(task.steps) for s in (1.0, -1.0)]
    for turn in range(ROUNDS):
        before = best.amount
        tried(choices(task, best.q, near=True), starts if turn == 0 else [])
        if turn == 0:
            promising = sorted(choices(task, task.start), key=lambda choice: choice.promise)
            tried(promising[:FIRST_CHOICES], [*starts, *(beside if len(beside) <= MOST_BESIDE else [])])
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
    rates = task.motion.kinematics(task.movable.seed, task.static.seed).rates(task.rest)[1]
    shifts = rates[:, :3, :3] @ task.movable.seed + rates[:, :3, 3]
    turns = task.size * np.array([[W[2, 1], W[0, 2], W[1, 0]] for W in rates])
    wanted = np.concatenate([(gap - max(task.needs[j], 0.0)) * way, np.zeros(3)])
    effects = np.hstack([shifts, turns]).T
    q = np.linalg.lstsq(effects, wanted, rcond=DEFAULT.nominal)[0]
    if np.linalg.norm(effects @ q - wanted) > MOST_ASIDE * np.linalg.norm(wanted):
        return []
    return [np.asarray(np.clip(q, *task.limits.T))]
