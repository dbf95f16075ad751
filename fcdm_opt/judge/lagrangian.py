"""Lower bounds of |y| over boxes by the Lagrangian |y|^2 / 2 - l . F(y), where what is asked leaves l . F(y) <= 0."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.proof.intervals import Interval

ROUNDED = 1.0 - 2.0**-44  # more than the rounding of the sums taken in floats here


def lagrangian_bounds(
    low: Array, high: Array, y: Array, value: Interval, slope: Sequence[Interval], bend: Sequence[Sequence[Interval]]
) -> Array:
    """Return amounts below which the Lagrangian leaves no motion in boxes, (n,); infinite where there is none in one.

    Of l . F: its value and slopes at motions y, (n, k), which may lie outside, k of them, and its bends, k x k, over
    the boxes and the ways to them.
    """
    k = low.shape[1]
    below, above = (low - y).T / ROUNDED, (high - y).T / ROUNDED
    sides = np.array([[own.size for own in row] for row in bend])
    total = Interval(0.5) * sum((Interval(y[:, j]).square() for j in range(k)), Interval(0.0)) - value
    level = np.array(total.low)
    for j in range(k):  # second derivatives are no less than `least` by Gershgorin's discs
        rest = sides[j].sum(axis=0) - sides[j, j]
        least = (1.0 - bend[j][j].high - rest / ROUNDED) * ROUNDED
        steep = Interval(y[:, j]) - slope[j]
        ahead = _lowest(steep.low, np.maximum(below[j], 0.0), above[j], least)
        level = level + np.minimum(ahead, _lowest(-steep.high, np.maximum(-above[j], 0.0), -below[j], least))
    amounts = np.sqrt(np.maximum(2.0 * level, 0.0)) * ROUNDED
    largest = np.sqrt((np.maximum(-low, high) ** 2).sum(axis=1)) / ROUNDED
    return np.where(np.isnan(amounts), 0.0, np.where(amounts > largest, np.inf, amounts))


def _lowest(rate: Array, start: Array, end: Array, bend: Array) -> Array:
    """Return lower bounds of rate d + bend d^2 / 2 for d from `start` to `end`, infinite where that is not ahead."""
    turn = np.clip(np.where(bend > 0.0, -rate / bend, start), start, np.maximum(end, start))
    found = [(rate * d, 0.5 * bend * d * d) for d in (start, end, turn)]
    values = [one + two - (1.0 - ROUNDED) * (np.abs(one) + np.abs(two)) for one, two in found]
    return np.where(end >= start, np.min(values, axis=0), np.inf)
