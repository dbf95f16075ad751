"""A pose that is as good as those about it: linear programs in a trust region that shrinks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcdm_opt.design.fixed_pose import gaps as kernels
from fcdm_opt.design.fixed_pose.worst import Off, Worst
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.measures import least_vector
from fcdm_opt.tolerances import DEFAULT

STEPS = 80  # linear programs at most
START, DIFFERENCE, END = 0.1, 1e-6, 1e-11  # trust region and finite differences, in sizes of the bodies
CORRECTIONS = 4  # of a step that leaves the window by its curvature


class Found(NamedTuple):
    """A pose, how far its worst gap is off, and its amount."""

    q: Array
    off: Off
    amount: float


def found_at(worst: Worst, q: Array) -> Found:
    """Return what a pose is worth."""
    return Found(q, worst.off(q), worst.amount(q))


class Linear(NamedTuple):
    """Functions whose largest is how far the worst gap is off: values (f,) and slopes (f, k)."""

    values: Array
    slopes: Array


def better(worst: Worst, limits: Array, q: Array) -> Found:
    """Return a pose near q whose worst gap is off by less, or q itself."""
    from scipy.optimize import linprog

    natural = worst.problem.motion.weights(worst.problem.movable.size / 2.0)
    here, trust = np.clip(q, *limits.T), START * worst.scene.size
    off = worst.off(here)
    model = _linear(worst, limits, here, natural)
    cost = np.append(np.zeros(len(here)), 1.0)
    for _ in range(STEPS):
        if off.value <= 0.0:
            break  # inside a window, or at a gap of nothing for all sizes
        box = _trusted(limits, here, natural, trust)
        A = np.column_stack([model.slopes / natural, -np.ones(len(model.values))])
        bounds = [*((low * n, high * n) for (low, high), n in zip(box, natural, strict=True)), (None, None)]
        found = linprog(cost, A_ub=A, b_ub=-model.values, bounds=bounds, method="highs")
        if found.status != 0:
            break
        gain = off.value - float(found.x[-1])
        step = np.clip(here + found.x[:-1] / natural, *limits.T)
        tried = worst.off(step)
        if tried.value < off.value - 0.1 * max(gain, 0.0) and tried.value < off.value:
            trust *= 2.0 if off.value - tried.value > 0.5 * gain else 1.0
            here, off = step, tried
        else:
            trust *= 0.25
            if trust < END * worst.scene.size:
                break
        model = _linear(worst, limits, here, natural)
    return Found(here, off, worst.amount(here))


def smaller(worst: Worst, limits: Array, start: Found, slack: float) -> Found:
    """Return a pose in the window of a smaller amount than that of `start`, which is in it, or `start`."""
    weights, natural = worst.problem.weights, worst.problem.motion.weights(worst.problem.movable.size / 2.0)
    best, trust = start, 4.0 * START * worst.scene.size
    rest = np.clip(np.zeros(len(start.q)), *limits.T)
    at_rest = found_at(worst, rest)
    if at_rest.off.value <= slack:
        return at_rest
    for _ in range(STEPS):
        model = _linear(worst, limits, best.q, natural)
        box = _trusted(limits, best.q, natural, trust)
        tighter, made = 0.0, None
        for _ in range(CORRECTIONS):
            q = nearest(model, best.q, weights, box, tighter)
            if q is None:
                break
            tried = found_at(worst, np.clip(q, *limits.T))
            if tried.off.value <= slack:
                made = tried
                break
            tighter += tried.off.value
        if made is not None and made.amount < best.amount * (1.0 - DEFAULT.line):
            best, trust = made, 2.0 * trust
        else:
            trust *= 0.25
            if trust < END * worst.scene.size:
                break
    return best


def least_moved(worst: Worst, limits: Array, found: Found, nearby: Found) -> Found:
    """Return, among poses whose worst gap is no further off than that of `found`, one that moves the part little.

    What has no effect on the worst gap is so left at rest: a slide along a groove, a turn about the axis of a round.

    Parameters
    ----------
    worst : Worst
    limits : (k, 2) array
    found : Found
        As good as those about it; its worst gap is off by more than nothing.
    nearby : Found
        A pose near rest, taken as the start where it is as good.
    """
    slack = DEFAULT.tie * worst.scene.size
    found = _without_needless(worst, limits, found, slack)
    off = found.off.value
    window = Worst(worst.problem, worst.scene, worst.low - off - slack, worst.high + off + slack, worst.active)
    starts = [found_at(window, own.q) for own in (found, nearby)]
    tried = [_rested(window, limits, start, slack) for start in starts if start.off.value <= slack]
    if not tried:
        return found
    best = min(tried, key=lambda own: own.amount)
    best = _rested(window, limits, smaller(window, limits, best, slack), slack)
    best = _given_back(worst, limits, best, off)
    return best if best.amount < found.amount or best.off.value < off else found


def _given_back(worst: Worst, limits: Array, found: Found, off: float) -> Found:
    """Return the pose a little further from rest, where its worst gap is off by no more than it has to be."""
    here, short = worst.off(found.q), worst.off(found.q * (1.0 - DIFFERENCE))
    rate = (short.value - here.value) / DIFFERENCE
    if rate > 0.0 and here.value > off:
        further = found_at(worst, np.clip(found.q * (1.0 + (here.value - off) / rate), *limits.T))
        if further.off.value < here.value:
            return further
    return Found(found.q, here, found.amount)


def _without_needless(worst: Worst, limits: Array, found: Found, slack: float) -> Found:
    """Return a pose as good as those about it with parameters at rest that it is no worse without, the least first.

    Linear programs leave traces where a parameter is of no effect to first order: too small to be of use.
    """
    kept, rest = limits.copy(), np.clip(np.zeros(len(limits)), *limits.T)
    for k in np.argsort(worst.problem.weights * np.abs(found.q)):
        if found.q[k] == rest[k]:
            continue
        fixed, q = kept.copy(), found.q.copy()
        fixed[k] = q[k] = rest[k]
        tried = better(worst, fixed, q)
        gain = found.off.value - tried.off.value
        if gain > slack or (gain >= -slack and tried.amount < found.amount):
            found, kept = tried, fixed
    return found


def _rested(worst: Worst, limits: Array, start: Found, slack: float) -> Found:
    """Return a pose in the window with every parameter of `start` put to rest that can be, the dearest first."""
    best, rest = start, np.clip(np.zeros(len(start.q)), *limits.T)
    for k in np.argsort(-worst.problem.weights * np.abs(start.q)):
        q = best.q.copy()
        q[k] = rest[k]
        tried = found_at(worst, q)
        if tried.off.value <= slack and tried.amount < best.amount:
            best = tried
    return best


def _trusted(limits: Array, q: Array, natural: Array, trust: float) -> Array:
    """Return the steps from q that stay in a trust region and in the limits, (k, 2)."""
    return np.column_stack(
        [np.maximum(limits[:, 0] - q, -trust / natural), np.minimum(limits[:, 1] - q, trust / natural)]
    )


def _linear(worst: Worst, limits: Array, q: Array, natural: Array) -> Linear:
    """Return the part pairs' gaps at the active sizes by central differences; one-sided at a limit."""
    scene, sizes = worst.scene, worst.active
    lines = scene.lines(worst.pose(q), START * scene.size)

    def values(at: Array) -> Array:
        rows, first = kernels.pair_rows(*scene.packed, worst.pose(at), lines.pairs)
        found: Array = kernels.gaps_of_pairs(rows, first, sizes)[0]
        return found

    centre = values(q)
    slopes = np.zeros((*centre.shape, len(q)))
    for k in range(len(q)):
        ends = []
        for sign in (1.0, -1.0):
            at = q.copy()
            at[k] = np.clip(q[k] + sign * DIFFERENCE * scene.size / natural[k], *limits[k])
            ends.append(at)
        width = ends[0][k] - ends[1][k]
        if width > 0:
            slopes[..., k] = (values(ends[0]) - values(ends[1])) / width
    made, rates = [], []
    if np.isfinite(worst.low):
        made.append((worst.low - centre).ravel())
        rates.append(-slopes.reshape(-1, len(q)))
    if np.isfinite(worst.high):
        owners, columns = centre.argmin(axis=0), np.arange(len(sizes))
        made.append(centre[owners, columns] - worst.high)
        rates.append(slopes[owners, columns])
    return Linear(np.concatenate(made), np.concatenate(rates))


def nearest(model: Linear, q: Array, weights: Array, box: Array, tighter: float) -> Array | None:
    """Return the motion of the least amount at which no linear function exceeds 0; None if there is none."""
    identity = np.eye(len(q))
    G = np.vstack([-model.slopes, identity, -identity]) / weights
    h = np.concatenate([model.values + tighter - model.slopes @ q, q + box[:, 0], -(q + box[:, 1])])
    used = np.isfinite(h)
    found = least_vector(G[used], h[used])
    return None if found is None else found / weights
