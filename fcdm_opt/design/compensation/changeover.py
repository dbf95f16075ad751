"""Where, along a line through the sizes, one active set gives way to another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import KroghInterpolator
from scipy.optimize import brentq

from fcdm_opt.design.compensation.sampling import ActiveSet, Asking, Sample
from fcdm_opt.geometry.arrays import Array

NARROW = 1e-5  # of the box: brackets are closed to this, then both sides' continuations are intersected; nearer, two
# contacts are told apart neither by the features, 1e-9 of the size, nor always by the judge
FINEST = 1e-4  # times that, where they do not meet
MOST_ROUNDS = 60
MOST_POINTS = 4  # of each side that are continued: cubics
CLOSER = 30.0  # how much narrower a bracket becomes about a predicted crossing

Point = tuple[float, Array]


class Changeover(NamedTuple):
    """A place on the boundary of two regions: its position along the line, and the active sets of both.

    `values` are both sides' amount and parameters there; `sides` are points of either side, nearest last, which
    continue them.
    """

    at: float
    sets: tuple[ActiveSet, ActiveSet]
    values: tuple[Array, Array]
    sides: tuple[list[Point], list[Point]]

    def continued(self, t: float) -> tuple[Array, Array]:
        """Return what both sides continue to at a position."""
        return _curve(self.sides[0])(t), _curve(self.sides[1])(t)


def _curve(points: Sequence[Point]) -> KroghInterpolator:
    """Return the polynomial through the last points of one side."""
    places, values = zip(*points[-MOST_POINTS:], strict=True)
    return KroghInterpolator(places, values)


def changeover(start: Array, end: Array, ends: Sequence[Sample], walls: Array) -> Asking[Changeover]:
    """Find where, between two places with different active sets, that of the first ends.

    The bracket is narrowed about the place where both sides' continuations agree, by thirds where they do not say.
    Of several boundaries on the line one is found. Where parameters reach their limits, `walls`, (k, 2), a motion may
    cease to exist.
    """
    sets = [sample.held for sample in ends]
    sides: tuple[list[Point], list[Point]] = ([(0.0, ends[0].values)], [(1.0, ends[1].values)])
    narrow = NARROW / max(float(np.linalg.norm(end - start)), NARROW)
    strip, missed, known = None, True, None
    for _ in range(MOST_ROUNDS):
        low, high = sides[0][-1][0], sides[1][-1][0]
        at, width = _meeting(sides, walls), high - low
        if strip is not None or width <= FINEST * narrow or (width <= narrow and at is not None):
            break
        off = width / 3 if at is None or missed else max(width / CLOSER, narrow / 3)
        if at is not None and known is not None and abs(at - known) <= narrow / 4:  # foreseen twice alike
            off = min(off, narrow)
        known = at
        middle = (low + high) / 2 if at is None or missed else at
        looks = [t for t in (middle - off / 2, middle + off / 2) if low < t < high]
        samples = yield [start + t * (end - start) for t in looks]
        points = list(zip(looks, samples, strict=True))
        for t, sample in points:
            if sample.held not in sets:  # a region, or but the strip in which both sides hold within rounding
                around = t - 2.0 * narrow, t + 2.0 * narrow
                beside = yield [start + place * (end - start) for place in around]
                if all(near.held != sample.held for near in beside):
                    points, strip = list(zip(around, beside, strict=True)), t
                    break
        for t, (held, values) in points:
            if not sides[0][-1][0] < t < sides[1][-1][0]:
                continue
            if held in sets:
                sides[sets.index(held)].append((t, values))
            else:  # a third one takes the place of the second
                sides[1][:], sets[1] = [(t, values)], held
        missed = sides[1][-1][0] - sides[0][-1][0] > width / 2
    at = strip if strip is not None else at if at is not None else (low + high) / 2
    # continued from the nearest points by no more than they are off
    one, two = (_curve(side[-2:])(at) for side in sides)
    return Changeover(float(at), (sets[0], sets[1]), (one, two), sides)


def _meeting(sides: tuple[list[Point], list[Point]], walls: Array) -> float | None:
    """Return where the continuations of both sides agree in the bracket, by what differs most; None if they do not."""
    # a side without a motion has none: the other one then meets its walls
    low, high = sides[0][-1][0], sides[1][-1][0]
    curves = [_curve(side) for side in sides if np.isfinite(side[-1][1][0])]
    if not curves:
        return None

    def off(t: float) -> Array:
        values = [curve(t) for curve in curves]
        return values[0] - values[1] if len(values) == 2 else np.subtract(values[0][1:, None], walls).ravel()

    ends = np.array([off(low), off(high)])
    with np.errstate(invalid="ignore"):
        differ = np.abs(ends[1] - ends[0])
        ends[np.abs(ends) <= FINEST * NARROW / (high - low) * differ] = 0.0  # they agree at an end, but for rounding
        changes = np.where(ends[0] * ends[1] <= 0, differ, -1.0)
    changes[~np.isfinite(changes)] = -1.0
    k = int(np.argmax(changes))
    if changes[k] > 0 and not ends[:, k].all():
        return high if ends[1, k] == 0.0 else low
    return float(brentq(lambda t: off(t)[k], low, high, xtol=1e-15, rtol=1e-14)) if changes[k] > 0 else None
