"""Motions in whole steps of the machine, near the smallest motion of all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import product
from operator import itemgetter

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.units import measured
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.solution import Status
from fcdm_opt.tolerances import DEFAULT

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
