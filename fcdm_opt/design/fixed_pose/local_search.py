"""A pose that is as good as those about it: linear programs in a trust region that shrinks."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fcdm_opt.design.fixed_pose.scene import NEAR
from fcdm_opt.design.fixed_pose.worst import Off, Worst
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.measures import least_vector
from fcdm_opt.tolerances import DEFAULT

STEPS = 80  # linear programs at most
DIFFERENCE, END = 1e-6, 1e-11  # finite differences and the least trust region, in sizes of the bodies
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

    natural, size = _natural(worst), worst.scene.size
    here, trust = found_at(worst, np.clip(q, *limits.T)), NEAR * size
    cost = np.append(np.zeros(len(q)), 1.0)
    for _ in range(STEPS):
        if here.off.value <= 0.0 or trust < END * size:
            break  # inside a window, or at a gap of nothing for all sizes
        model = _linear(worst, limits, here.q, natural)
        A = np.column_stack([model.slopes / natural, -np.ones(len(model.values))])
        bounds = [*(_trusted(limits, here.q, natural, trust) * natural[:, None]).tolist(), (None, None)]
        step = linprog(cost, A_ub=A, b_ub=-model.values, bounds=bounds, method="highs")
        if step.status != 0:
            break
        gain = here.off.value - float(step.x[-1])
        tried = found_at(worst, np.clip(here.q + step.x[:-1] / natural, *limits.T))
        gained = here.off.value - tried.off.value
        if gained > 0.1 * max(gain, 0.0) and gained > 0.0:
            trust *= 2.0 if gained > 0.5 * gain else 1.0
            here = tried
        else:
            trust *= 0.25
    return here


def smaller(worst: Worst, limits: Array, start: Found, slack: float) -> Found:
    """Return a pose in the window of a smaller amount than that of `start`, which is in it, or `start`."""
    weights, natural = worst.problem.weights, _natural(worst)
    best, trust = start, 4.0 * NEAR * worst.scene.size
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
    window = replace(worst, low=worst.low - off - slack, high=worst.high + off + slack)
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


def _natural(worst: Worst) -> Array:
    """Return what makes lengths of turns: how far they move the movable body."""
    return worst.problem.motion.weights(worst.scene.movable.size / 2.0)


def _linear(worst: Worst, limits: Array, q: Array, natural: Array) -> Linear:
    """Return the part pairs' gaps at the active sizes by central differences; one-sided at a limit."""
    scene, sizes = worst.scene, worst.active
    pairs = scene.rows(worst.pose(q), NEAR * scene.size).pairs
    centre = scene.of_pairs(worst.pose(q), pairs, sizes)
    slopes = np.zeros((*centre.shape, len(q)))
    for k in range(len(q)):
        steps = np.array([1.0, -1.0]) * DIFFERENCE * scene.size / natural[k]
        ends = np.tile(q, (2, 1))
        ends[:, k] = np.clip(q[k] + steps, *limits[k])
        if ends[0, k] > ends[1, k]:
            above, below = (scene.of_pairs(worst.pose(at), pairs, sizes) for at in ends)
            slopes[..., k] = (above - below) / (ends[0, k] - ends[1, k])
    made, rates = [np.empty(0)], [np.empty((0, len(q)))]
    if np.isfinite(worst.low):
        made.append((worst.low - centre).ravel())
        rates.append(-slopes.reshape(-1, len(q)))
    if np.isfinite(worst.high):
        owners, columns = centre.argmin(axis=0), np.arange(len(sizes))
        made.append(centre[owners, columns] - worst.high)
        rates.append(slopes[owners, columns])
    values, slopes = np.concatenate(made), np.concatenate(rates)
    known = np.isfinite(values) & np.isfinite(slopes).all(axis=1)
    return Linear(values[known], slopes[known])


def nearest(model: Linear, q: Array, weights: Array, box: Array, tighter: float) -> Array | None:
    """Return the motion of the least amount at which no linear function exceeds 0; None if there is none."""
    identity = np.eye(len(q))
    G = np.vstack([-model.slopes, identity, -identity]) / weights
    h = np.concatenate([model.values + tighter - model.slopes @ q, q + box[:, 0], -(q + box[:, 1])])
    used = np.isfinite(h)
    found = least_vector(G[used], h[used])
    return None if found is None else found / weights
