"""Sobol indices: which share of the amount's variance is due to which size."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.design.compensation.table import MapPoints
from fcdm_opt.geometry.arrays import Array


class SizeMap(Protocol):
    """What a yield is worked out from: a `Table`, a `CompensationMap`, or anything else that answers alike."""

    def at(self, rho1: ArrayLike, rho2: ArrayLike, /) -> MapPoints:
        """Return the motions for size pairs."""


class SwappedPairs:
    """Sobol indices from amounts of pairs (x, y), (x', y), (x, y'), (x', y').

    With f, g, h, k for their amounts, the means of u = (f - g)^2 + (h - k)^2, v = (f - h)^2 + (g - k)^2 and
    w = (f - g - h + k)^2 are four times the variance due to x with what both do together, due to y likewise, and what
    both do together alone; u + v - w = (f - k)^2 + (g - h)^2 is four times all of it.
    """

    def __init__(self, sizes_map: SizeMap) -> None:
        self._map = sizes_map
        self._count, self._sums, self._squares = 0, np.zeros(3), np.zeros((3, 3))

    def add(self, pairs: Array, amounts: Array) -> None:
        """Add pairs, two by two, of which the amounts are known."""
        even = len(pairs) // 2 * 2
        first, second = pairs[0:even:2], pairs[1:even:2]
        f, k = amounts[0:even:2], amounts[1:even:2]
        g = self._map.at(second[:, 0], first[:, 1]).amount
        h = self._map.at(first[:, 0], second[:, 1]).amount
        terms = np.array([(f - g) ** 2 + (h - k) ** 2, (f - h) ** 2 + (g - k) ** 2, (f - g - h + k) ** 2])
        known = np.isfinite(terms).all(axis=0)
        terms = terms if known.all() else terms[:, known]
        self._count += terms.shape[1]
        self._sums += terms.sum(axis=1)
        self._squares += terms @ terms.T

    def indices(self) -> list[dict[str, float]]:
        """Return first-order and total index of both sizes, with their standard errors."""
        u, v, w = self._sums
        whole = u + v - w
        if self._count < 2 or not whole > 0.0:
            return [dict.fromkeys(("first_order", "first_order_error", "total", "total_error"), math.nan)] * 2
        spread = self._squares - np.outer(self._sums, self._sums) / self._count  # of the sums
        found = []
        for own in ((1.0, 0.0), (0.0, 1.0)):
            own_index = {}
            for name, both in (("first_order", -1.0), ("total", 0.0)):
                taken = np.array([*own, both])
                index = float(taken @ self._sums / whole)
                slope = (taken - index * np.array([1.0, 1.0, -1.0])) / whole
                own_index[name] = index
                own_index[f"{name}_error"] = math.sqrt(max(0.0, float(slope @ spread @ slope)))
            found.append(own_index)
        return found
