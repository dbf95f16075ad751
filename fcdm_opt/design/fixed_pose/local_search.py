"""A pose that is as good as those about it: linear programs in a trust region that shrinks."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fcdm_opt.design.fixed_pose.scene import NEAR
from fcdm_opt.design.fixed_pose.worst import FAR, Off, Worst
from fcdm_opt.geometry.arrays import Array, Flags
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
    """Return what a pose is worth; parameters beyond the limits are taken to them."""
    q = np.clip(q, *worst.limits.T)
    return Found(q, worst.off(q), worst.amount(q))


def better(worst: Worst, q: Array) -> Found:
    """Return a pose near q whose worst gap is off by less, or q itself."""
    from scipy.optimize import linprog

    natural, size = _natural(worst), worst.scene.size
    here, trust = found_at(worst, q), NEAR * size
    for _ in range(STEPS):
        if here.off.value <= 0.0 or trust < END * size:
            break  # inside a window, or at a gap of nothing for all sizes
        values, slopes, kept = _linear(worst, here.q)
        if not here.off.clear:
            values, slopes, kept = values[kept], slopes[kept], np.zeros(kept.sum(), bool)  # off the keep-outs first
        A = np.column_stack([slopes / natural, kept - 1.0])
        bounds = [*(_trusted(worst, here.q, trust) * natural[:, None]).tolist(), (None, None)]
        step = linprog([0.0] * len(q) + [1.0], A_ub=A, b_ub=-values, bounds=bounds, method="highs")
        if step.status != 0:
            break
        gain = (here.off.value if here.off.clear else here.off.value - FAR * size) - float(step.x[-1])
        tried = found_at(worst, here.q + step.x[:-1] / natural)
        gained = here.off.value - tried.off.value
        if gained > 0.1 * max(gain, 0.0) and gained > 0.0:
            here, trust = tried, trust * (2.0 if gained > 0.5 * gain else 1.0)
        else:
            trust *= 0.25
    return here


def smaller(worst: Worst, start: Found, slack: float) -> Found:
    """Return a pose in the window of a smaller amount than that of `start`, which is in it, or `start`."""
    best, trust = start, 4.0 * NEAR * worst.scene.size
    at_rest = found_at(worst, np.zeros(len(start.q)))
    if at_rest.off.value <= slack:
        return at_rest
    for _ in range(STEPS):
        if trust < END * worst.scene.size:
            break
        values, slopes, _ = _linear(worst, best.q)
        steps, made = _trusted(worst, best.q, trust), None
        for _ in range(CORRECTIONS):
            q = nearest(values, slopes, best.q, worst.problem.weights, steps)
            tried = None if q is None else found_at(worst, q)
            if tried is None or tried.off.value <= slack:
                made = tried
                break
            values = values + tried.off.excess
        if made is not None and made.amount < best.amount * (1.0 - DEFAULT.line):
            best, trust = made, 2.0 * trust
        else:
            trust *= 0.25
    return best


def least_moved(worst: Worst, found: Found, nearby: Found) -> Found:
    """Return, among poses whose worst gap is no further off than that of `found`, one that moves the part little.

    What has no effect on the worst gap is so left at rest: a slide along a groove, a turn about the axis of a round.

    Parameters
    ----------
    worst : Worst
    found : Found
        As good as those about it; its worst gap is off by more than nothing.
    nearby : Found
        A pose near rest, taken as the start where it is as good.
    """
    slack, off = DEFAULT.tie * worst.scene.size, found.off.value
    window = replace(worst, low=worst.low - off - slack, high=worst.high + off + slack)
    starts = [found_at(window, own.q) for own in (found, nearby)]
    tried = [_rested(window, start, slack) for start in starts if start.off.value <= slack]
    if not tried or not found.off.clear:
        return found
    best = _rested(window, smaller(window, min(tried, key=lambda own: own.amount), slack), slack)
    # a little further from rest, where its worst gap is off by no more than it has to be
    here, short = found_at(worst, best.q), worst.off(best.q * (1.0 - DIFFERENCE))
    rate = (short.value - here.off.value) / DIFFERENCE
    if rate > 0.0 and here.off.value > off:
        further = found_at(worst, best.q * (1.0 + (here.off.value - off) / rate))
        here = min(here, further, key=lambda own: own.off.value)
    return here if here.amount < found.amount or here.off.value < off else found


def _rested(worst: Worst, start: Found, slack: float) -> Found:
    """Return a pose in the window with every parameter of `start` put to rest that can be, the dearest first."""
    best = start
    for k in np.argsort(-worst.problem.weights * np.abs(start.q)):
        tried = found_at(worst, np.where(np.arange(len(start.q)) == k, 0.0, best.q))
        if tried.off.value <= slack and tried.amount < best.amount:
            best = tried
    return best


def _natural(worst: Worst) -> Array:
    """Return what makes lengths of turns: how far they move the movable body."""
    return worst.problem.motion.weights(worst.scene.movable.size / 2.0)


def _trusted(worst: Worst, q: Array, trust: float) -> Array:
    """Return the steps from q that stay in a trust region and in the limits, (k, 2)."""
    far = trust / _natural(worst)
    return np.column_stack([np.maximum(worst.limits[:, 0] - q, -far), np.minimum(worst.limits[:, 1] - q, far)])


def _linear(worst: Worst, q: Array) -> tuple[Array, Array, Flags]:
    """Return functions of which none may exceed 0 in the window, values (f,) and slopes (f, k), and which keep clear.

    They are of the part pairs' gaps at the active sizes, by central differences; one-sided at a limit. The largest of
    those that do not keep clear of keep-outs is how far the worst gap is off.
    """
    scene, sizes = worst.scene, worst.active
    pairs = scene.rows(worst.pose(q), NEAR * scene.size).pairs
    centre = scene.of_pairs(worst.pose(q), pairs, sizes)
    slopes = np.zeros((*centre.shape, len(q)))
    for k, step in enumerate((DIFFERENCE * scene.size / _natural(worst)).tolist()):
        ends = np.tile(q, (2, 1))
        ends[:, k] = np.clip([q[k] + step, q[k] - step], *worst.limits[k])
        if ends[0, k] > ends[1, k]:
            above, below = (scene.of_pairs(worst.pose(at), pairs, sizes) for at in ends)
            with np.errstate(invalid="ignore"):
                slopes[..., k] = (above - below) / (ends[0, k] - ends[1, k])
    owners, columns = centre.argmin(axis=0), np.arange(len(sizes))
    values = np.append(worst.low - centre, centre[owners, columns] - worst.high)
    rates = np.concatenate([-slopes.reshape(-1, len(q)), slopes[owners, columns]])
    known = np.isfinite(values) & np.isfinite(rates).all(axis=1)
    others = [_linear(own, q)[:2] for own in worst.keep_out]
    values, rates = (np.concatenate(own) for own in zip((values[known], rates[known]), *others, strict=True))
    return values, rates, np.arange(len(values)) >= known.sum()


def nearest(values: Array, slopes: Array, q: Array, weights: Array, steps: Array) -> Array | None:
    """Return the motion of the least amount, steps from q, at which no function exceeds 0; None if there is none."""
    identity = np.eye(len(q))
    G = np.vstack([-slopes, identity, -identity]) / weights
    h = np.concatenate([values - slopes @ q, q + steps[:, 0], -(q + steps[:, 1])])
    used = np.isfinite(h)
    found = least_vector(G[used], h[used])
    return None if found is None else found / weights
