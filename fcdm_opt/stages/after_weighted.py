"""From the smallest weighted motion on: the smallest by another amount, and motions in whole machine steps near it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import product
from operator import itemgetter

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.units import measured
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
        bound = weighted.lower_bound if weighted.status is Status.INFEASIBLE else task.displacement_bound
        return replace(weighted, lower_bound=bound)
    if not weighted.q.any() and task.amount(task.rest) == 0.0:
        return weighted
    best = task.answer(weighted.q, active=weighted.active, modelled=weighted.modelled)
    least, direct = task.displacement_bound, _direct(task)
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
            found = relaxation.smallest(starts) or relaxation.smallest(starts[:1], method="ipopt")
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
    normal, gap = rows[separations.argmax(), :3], float(separations.max())
    if gap > 0:
        normal = task.direction_between(parts, task.rest)
        normal, gap = normal / np.linalg.norm(normal), float(task.pair_gaps(task.rest, {parts: normal})[parts])
    rates = task.rates(task.rest)[1]
    shifts = rates[:, :3, :3] @ task.movable.seed + rates[:, :3, 3]
    turns = task.size * np.array([[W[2, 1], W[0, 2], W[1, 0]] for W in rates])
    wanted = np.concatenate([(gap - max(task.needs[j], 0.0)) * normal, np.zeros(3)])
    effects = np.hstack([shifts, turns]).T
    q = np.linalg.lstsq(effects, wanted, rcond=DEFAULT.nominal)[0]
    if np.linalg.norm(effects @ q - wanted) > MOST_ASIDE * np.linalg.norm(wanted):
        return []
    return [np.asarray(np.clip(q, *task.limits.T))]


MOST_WIDE = 4  # parameters up to which two steps to either side are tried, beyond them one
MOST_LISTED, MOST_TRIED = 50_000, 2000  # motions in whole steps that are smaller than the one found
MOST_SOLVED = 64  # neighbours for which the other parameters are solved anew


def in_steps(task: Task, answer: Answer, solve: Callable[[Task], Answer]) -> Answer:
    """Return the answer in whole steps of the task's `resolution`; as it is where there is none, or no motion.

    Tried are whole steps around the smallest motion; parameters without a step are solved anew for each. The least
    amount that meets the requirement wins, and where motions in whole steps are not too many, all are tried that are
    smaller than it and not below the smallest of all.

    A goal that is an equation ("at", "seat", and pairs that must touch) is met to within what the steps leave open,
    see `Motion.play`: of the motions in which the target pair does not overlap the one nearest to it wins, and its
    gap is reported as it is. No lower bound is known then. Goal "seat" must be met, as faces are flush or not. Where
    none does, the nearest one is told.
    """
    if task.resolution is None or answer.q is None:
        return answer
    stage = f"{answer.stage}; then whole steps"
    rounded = task.resolution > 0
    near, best = [*_near(task, answer.q)], None
    if rounded.all():
        ranked = sorted(near, key=lambda q: (task.miss(q) if task.is_equation else 0.0, task.amount(q)))
        best = next(filter(task.meets_in_steps, ranked), None)
        if not task.is_equation and task.weighted:
            between = _between(task, task.amount(answer.q), None if best is None else task.amount(best))
            best = next(filter(task.meets_in_steps, between), best)
    else:
        for q in sorted(near, key=task.amount)[:MOST_SOLVED]:
            if pacing.over():
                break
            found = solve(replace(task, limits=np.where(rounded[:, None], q[:, None], task.limits), resolution=None))
            if found.q is not None and (best is None or task.amount(found.q) < task.amount(best)):
                best = found.q
    if best is None:
        status = Status.NOT_FOUND if pacing.over() else Status.NOT_IN_STEPS
        return Answer(status, None, f"{stage}, none near", answer.lower_bound, _nearest(task, near))
    bound = 0.0 if task.is_equation and rounded.all() else min(answer.lower_bound, task.amount(best))
    status = answer.status if np.array_equal(best, answer.q) else Status.SOLVED
    return Answer(status, best, stage, bound, (*answer.active, "whole steps"), answer.modelled)


def _nearest(task: Task, near: Sequence[Array]) -> tuple[str, ...]:
    """Return which of some motions misses the requirement least, in words; of an equation one without overlap first."""
    found, unit = [(False, -task.misses(q)[0], q) for q in near], task.length_unit
    if task.is_equation:
        found = [(task.gap(q) < -DEFAULT.touch * task.size, task.miss(q), q) for q in near]
    _, short, q = min(found, key=itemgetter(0, 1), default=(False, 0.0, task.rest))
    motion, known = task.motion.describe(q, unit=unit), 0.0 < short < np.inf
    return (f"the nearest in whole steps, {motion}, misses it by {measured(short, unit, 4)}",) * known


def _between(task: Task, low: float, high: float | None) -> Array:
    """Return all allowed motions in whole steps with amounts from `low` to below `high`, least first; none if many."""
    assert task.resolution is not None
    if high is None:
        return np.empty((0, len(task.weights)))
    most = np.floor(high / (task.weights * task.resolution) + DEFAULT.nominal)
    if np.prod(2.0 * most + 1.0) > MOST_LISTED:
        return np.empty((0, len(task.weights)))
    motions = np.array(list(product(*(range(-int(m), int(m) + 1) for m in most)))) * task.resolution
    amounts = np.linalg.norm(motions * task.weights, axis=1)
    inside = (amounts >= low * (1.0 - DEFAULT.requirement)) & (amounts < high * (1.0 - DEFAULT.requirement))
    inside &= (motions >= task.limits[:, 0]).all(axis=1) & (motions <= task.limits[:, 1]).all(axis=1)
    found: Array = motions[inside][np.argsort(amounts[inside], kind="stable")]
    return found[:MOST_TRIED]


def _near(task: Task, q: Array) -> Iterator[Array]:
    """Yield allowed motions in whole steps around q; parameters without a step stay."""
    assert task.resolution is not None
    steps = np.where(task.resolution > 0, task.resolution, 1.0)
    below = np.floor(q / steps + DEFAULT.nominal)
    some = np.flatnonzero(task.resolution > 0)
    offsets = (0, 1, -1, 2) if len(some) <= MOST_WIDE else (0, 1)
    for choice in product(offsets, repeat=len(some)):
        near = q.copy()
        near[some] = (below[some] + choice) * steps[some]
        if task.allows(near):
            yield near
