"""How many amounts there are of each size, in bounded memory."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array, frozen

BINS = 2**17
"""Bins that quantiles are read from: they are exact to four times the largest amount over this."""

SHOWN = 2**7
"""Bins that a result keeps."""

_LEAST = -900  # exponent of two, far below any amount and far above where floats lose digits


class Amounts:
    """A histogram whose bins are widened, two to one, until what comes fits: no order of what comes changes it."""

    def __init__(self) -> None:
        # width of a bin, a power of two; the bins go from -BINS / 2 to BINS / 2 times this
        self._width, self._largest = 0.0, -math.inf
        self._bins = np.zeros(BINS, np.int64)

    def add(self, amounts: Array) -> None:
        """Count amounts."""
        if not amounts.size:
            return
        self._largest = max(self._largest, float(amounts.max()))
        size = max(self._largest, -float(amounts.min()))
        if size > 0.0:
            wanted = math.ldexp(2.0 / BINS, max(math.frexp(size)[1], _LEAST))
            while 0.0 < self._width < wanted:
                half = self._bins.reshape(-1, 2).sum(axis=1)
                self._bins[:] = 0
                self._bins[BINS // 4 : -BINS // 4] = half
                self._width *= 2.0
            self._width = max(self._width, wanted)
            amounts = amounts / self._width
        np.add.at(self._bins, np.floor(amounts).astype(np.int64) + BINS // 2, 1)

    def quantile(self, share: float) -> float:
        """Return the upper edge of the bin in which a share of the amounts is reached."""
        reached = np.cumsum(self._bins)
        if not reached[-1]:
            return math.nan
        place = int(np.searchsorted(reached, math.ceil(share * int(reached[-1]))))
        return min((place + 1 - BINS // 2) * self._width, self._largest)

    def shown(self) -> dict[str, Any]:
        """Return the edges of some bins that hold all amounts, and what is in them."""
        filled = np.flatnonzero(self._bins)
        if not filled.size or not self._width:  # nothing, or zeros only
            return {"amounts": frozen([0.0, 1.0]), "counts": frozen([self._bins.sum()], np.int64)}
        first, last = int(filled[0]), int(filled[-1]) + 1
        each = math.ceil((last - first) / SHOWN)
        starts = np.arange(first, last, each)
        edges = (np.append(starts, starts[-1] + each) - BINS // 2) * self._width
        return {"amounts": frozen(edges), "counts": frozen(np.add.reduceat(self._bins[:last], starts), np.int64)}
