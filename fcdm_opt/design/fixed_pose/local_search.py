"""A pose that is as good as those about it: linear programs in a trust region that shrinks."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from fcdm_opt.design.fixed_pose.scene import NEAR
from fcdm_opt.design.fixed_pose.worst import DIFFERENCE, FAR, Off, Worst, least_motion
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerances import DEFAULT

STEPS = 80  # linear programs at most
END = 1e-11  # the least trust region, in sizes of the bodies
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

    natural, size = worst.natural, worst.scene.size
    here, trust, far = found_at(worst, q), np.inf if worst.is_program else NEAR * size, 0.0
    for _ in range(STEPS):
        if here.off.value <= END * size or trust < END * size:
            break  # inside a window, or at a gap of nothing for all sizes
        values, slopes, kept = worst.linear(here.q, far)
        if not here.off.clear:
            values, slopes, kept = values[kept], slopes[kept], np.zeros(kept.sum(), bool)  # off the keep-outs first
        A = np.column_stack([slopes / natural, kept - 1.0])
        steps = _trusted(worst, here.q, trust)
        bounds = [*(steps * natural[:, None]).tolist(), (None, None)]
        step = linprog([0.0] * len(q) + [1.0], A_ub=A, b_ub=-values, bounds=bounds, method="highs")
        if step.status != 0 and trust <= size:
            break
        if step.status != 0:  # what is kept clear of is linear about here alone
            trust = NEAR * size
            continue
        gain = (here.off.value if here.off.clear else here.off.value - FAR * size) - float(step.x[-1])
        if here.off.clear and gain <= END * size:
            if far or worst.is_program:
                break
            far = trust  # the largest gap may be that of a wall beside which the part slides: until others are nearer
            continue
        # of all motions that do as much by these slopes the least: turns, say, cost nothing but to second order; of
        # steps to where it is clear the least, so that a start stays on its side
        base = here.q * here.off.clear
        least = least_motion(values - np.where(kept, 0.0, step.x[-1]), slopes, base, worst.weights, steps)
        tried = found_at(worst, here.q + step.x[:-1] / natural if least is None else here.q - base + least)
        gained = here.off.value - tried.off.value
        if gained > 0.1 * max(gain, 0.0) and gained > 0.0:
            here, trust, far = tried, trust * (2.0 if gained > 0.5 * gain else 1.0), 0.0
        else:
            trust = min(trust, size) * 0.25
            far = min(far, trust)
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
        values, slopes, _ = worst.linear(best.q)
        steps, made = _trusted(worst, best.q, trust), None
        for _ in range(CORRECTIONS):
            q = least_motion(values, slopes, best.q, worst.weights, steps)
            tried = None if q is None else found_at(worst, q)
            if tried is None or tried.off.value <= slack:
                made = tried
                break
            moved = np.abs(slopes @ (tried.q - best.q)) > DEFAULT.tie * worst.scene.size  # others are not off by it
            values = values + tried.off.excess * moved
        if made is not None and made.amount < best.amount * (1.0 - DEFAULT.line):
            best, trust = made, 2.0 * trust
        else:
            best, trust = _rested(worst, best, slack), 0.25 * trust
    return best


def least_moved(worst: Worst, found: Found, nearby: Found) -> Found:
    """Return, among poses whose worst gap is no further off than that of `found`, one that moves the part little.

    What has no effect on the worst gap is so left at rest: a slide along a groove, a turn about the axis of a round.
    The one found is as good as those about it, and off by more than nothing; `nearby` is near rest, a start where it
    is as good.
    """
    slack, off = DEFAULT.tie * worst.scene.size, found.off.value
    wider, keep_out = off + slack, worst.keep_out
    if worst.kept_first:
        wider, keep_out = slack, tuple(replace(own, low=own.low - wider) for own in keep_out)
    window = replace(worst, low=worst.low - wider, high=worst.high + wider, keep_out=keep_out)
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


def stepped(worst: Worst, found: Found, steps: Array, slack: float, *, amounts: bool) -> Found:
    """Return the best of the poses about one whose parameters are whole numbers of steps (0: any)."""
    made = steps > 0.0
    unit, own = np.where(made, steps, 1.0), found.q
    ends = [np.unique([round_(x / u) * u for round_ in (np.floor, np.ceil, np.round)]) if on else [x]
            for x, u, on in zip(own, unit, made, strict=True)]  # fmt: skip
    poses = [np.array(q) + 0.0 for q in product(*ends)]
    low, high = worst.limits.T + np.array([[-1.0], [1.0]]) * DEFAULT.nominal * unit
    tried = [Found(q, worst.off(q), worst.amount(q)) for q in poses if (q >= low).all() and (q <= high).all()]
    inside = [own for own in tried if own.off.value <= slack] if amounts else []
    if inside:
        return min(inside, key=lambda own: own.amount)
    return min(tried, key=lambda own: (own.off.value, own.amount), default=found)


def _rested(worst: Worst, start: Found, slack: float) -> Found:
    """Return a pose in the window with every parameter of `start` put to rest that can be, the dearest first."""
    best = start
    for k in np.argsort(-worst.weights * np.abs(start.q)):
        tried = found_at(worst, np.where(np.arange(len(start.q)) == k, 0.0, best.q))
        if tried.off.value <= slack and tried.amount < best.amount:
            best = tried
    return best


def _trusted(worst: Worst, q: Array, trust: float) -> Array:
    """Return the steps from q that stay in a trust region and in the limits, (k, 2)."""
    far = trust / worst.natural
    return np.column_stack([np.maximum(worst.limits[:, 0] - q, -far), np.minimum(worst.limits[:, 1] - q, far)])
