"""The linear program whose solutions are the common points of two scaled parts: its columns, and their pricing.

With p_i = R (v_i - s_1), q_j = w_j - s_2 and d the offset of the seeds, the closed parts meet at (rho_1, rho_2) iff
non-negative weights give

    sum lambda_i p_i - sum mu_j q_j - tau d = 0,    rho_1 = sum lambda / tau,    rho_2 = sum mu / tau.

Each weight has a column of this program: (p_i, k_1), (-q_j, k_2), (-d, k_3). With z = (sum lambda, sum mu, tau), the
fourth row, k.z = 1, normalises the weights; tau = 0 is infinity. A dual solution is a direction n with three levels,
one of each kind of column, so that n.c <= level for the first three entries c of all columns. It gives a half-plane,
level_1 z_1 + level_2 z_2 + level_3 z_3 >= 0, that holds wherever the parts meet: the contact line (a, b, -c) of n.

Pricing looks for a column that n.c <= level fails for. Floats decide where a value is larger than its error bound,
integers elsewhere: a line is proved against every column, mostly at the cost of one product of floats.

Lengths of part 1, of part 2 and of d are integers in units of their own, three powers of two. This scales rho, not the
polygon's topology, and k_1, k_2, k_3 are powers of two that bound the entries of such columns.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from flint import fmpq

from fcdm_opt.curve.exact.rationals import (
    ONE,
    ZERO,
    Vector,
    common_unit,
    coprime,
    dot,
    multiple,
    normalised,
    quotient,
    scaled,
)
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import ConvexPart

# Bound of the rounding error of a column's floating-point value, relative to the sum of the absolute coefficients: the
# column's own entries (6 units of 2^-53), coefficients (2), products and sums (7), rounded up.
ROUNDING = 32 * 2.0**-53


class Program:
    """The columns of two convex parts: as integers when asked for, and all of them as floats.

    Columns are numbered: the vertices of part 1, those of part 2, the offset.

    Parameters
    ----------
    one, two : ConvexPart
    transform : (4, 4) array
        Pose change of body 1, taken as given.

    Attributes
    ----------
    counts : two int
        Vertices of part 1 and of part 2.
    total : int
        Number of columns.
    units : three int
        Exponents of the powers of two that lengths of part 1, part 2 and d are counted in.
    reach : three int
        k is two to these powers: at least as large as any entry of such a column.
    k : (3,) tuple of fmpz
    floats : (6, N) array
        The first three rows divided by k, and three rows that say of which kind a column is.
    """

    def __init__(self, one: ConvexPart, two: ConvexPart, transform: Array) -> None:
        R, shift = transform[:3, :3], transform[:3, 3]
        self._parts = (one, two)
        self.counts = (len(one.vertices), len(two.vertices))
        self.total = sum(self.counts) + 1
        turn, drawn, own = common_unit(R), common_unit(one.vertices, one.seed), common_unit(two.vertices, two.seed)
        self._drawn = drawn
        self._turn = [[multiple(x, turn) for x in row] for row in R.tolist()]
        self._seeds = [[multiple(x, unit) for x in part.seed.tolist()] for part, unit in ((one, drawn), (two, own))]
        least = min(turn + drawn, own, common_unit(shift))
        moved = [dot(row, self._seeds[0]) << (turn + drawn - least) for row in self._turn]
        offset = [
            (s << (own - least)) - m - multiple(t, least)
            for s, m, t in zip(self._seeds[1], moved, shift.tolist(), strict=True)
        ]
        self.units = (turn + drawn, own, least)
        X, Y = one.vertices - one.seed, two.vertices - two.seed
        spans = [float((np.abs(X) @ np.abs(R).T).max()), float(np.abs(Y).max())]
        tops = [math.frexp(span)[1] for span in spans]
        width = max(x.height_bits() for x in offset)
        self.reach = (tops[0] - self.units[0], tops[1] - self.units[1], width)
        self.k = tuple([ONE << bits for bits in self.reach])
        self.floats = np.zeros((6, self.total))
        n = self.counts[0]
        self.floats[:3, :n] = np.ldexp(R @ X.T, -tops[0])
        self.floats[:3, n:-1] = np.ldexp(-Y.T, -tops[1])
        self.floats[:3, -1] = [-quotient(x, self.k[2]) for x in offset]
        self.floats[3, :n] = self.floats[4, n:-1] = self.floats[5, -1] = 1.0
        self._known: dict[int, Vector] = {self.total - 1: (*(-x for x in offset), self.k[2])}

    def kind(self, j: int) -> int:
        """Return what a column stands for: 0 a vertex of part 1, 1 a vertex of part 2, 2 the offset."""
        return 0 if j < self.counts[0] else 1 if j < self.total - 1 else 2

    def column(self, j: int) -> Vector:
        """Return a column as four integers."""
        known = self._known.get(j)
        if known is None:
            known = self._known[j] = self._moved(j) if j < self.counts[0] else self._opposed(j - self.counts[0])
        return known

    def _moved(self, i: int) -> Vector:
        """Return (p_i, k_1)."""
        (x, y, z), (r, s, t), unit = self._parts[0].vertices[i].tolist(), self._seeds[0], self._drawn
        local = multiple(x, unit) - r, multiple(y, unit) - s, multiple(z, unit) - t
        a, b, c = self._turn
        return dot(a, local), dot(b, local), dot(c, local), self.k[0]

    def _opposed(self, j: int) -> Vector:
        """Return (-q_j, k_2)."""
        (x, y, z), (r, s, t), unit = self._parts[1].vertices[j].tolist(), self._seeds[1], self.units[1]
        return r - multiple(x, unit), s - multiple(y, unit), t - multiple(z, unit), self.k[1]

    # ---- pricing

    def price(self, n: Vector, levels: Vector, basic: Sequence[int]) -> int | None:
        """Return a column with level - n.c < 0, one of the lowest; None if there is none, proved for every column.

        Parameters
        ----------
        n : (3,) tuple of fmpz
        levels : (3,) tuple of fmpz
            Of each kind.
        basic : sequence of int
            Columns where it is 0 by construction.
        """
        values, error = self._slacks(n, levels)
        least = int(values.argmin())
        if values[least] < -error:
            return least
        if not any(n):
            return None if min(levels) >= 0 else least
        doubtful = (values <= error).nonzero()[0].tolist()
        return next((j for j in doubtful if j not in basic and levels[self.kind(j)] < dot(n, self.column(j))), None)

    def tight(self, n: Vector, levels: Vector) -> list[int]:
        """Return the columns with level = n.c, where none is below: see `price`."""
        values, error = self._slacks(n, levels)
        doubtful = (values <= error).nonzero()[0].tolist()
        return [j for j in doubtful if levels[self.kind(j)] == dot(n, self.column(j))]

    def _slacks(self, n: Vector, levels: Vector) -> tuple[Array, float]:
        """Return level - n.c of all columns up to a factor, and a bound of its error."""
        p, q, r = self.reach
        coefficients = normalised((-n[0], -n[1], -n[2], *levels), (0, 0, 0, -p, -q, -r))
        return np.array(coefficients) @ self.floats, ROUNDING * sum(map(abs, coefficients))

    def levels(self, n: Vector) -> Vector:
        """Return the lowest levels of a direction, (a, b, -c) in own units: its line."""
        coefficients = normalised((*n, ZERO, ZERO, ZERO), (0,) * 6)
        heights = np.array(coefficients) @ self.floats
        error = 2 * ROUNDING * sum(map(abs, coefficients))  # of a difference of two
        first, last = self.counts[0], self.total - 1
        levels = []
        for low, high in ((0, first), (first, last), (last, last + 1)):
            top = heights[low:high].max() - error
            near = (heights[low:high] >= top).nonzero()[0] + low
            levels.append(max(dot(n, self.column(j)) for j in near.tolist()))
        return tuple(levels)

    # ---- own units, and those of the bodies

    def line(self, levels: Vector) -> tuple[fmpq, fmpq, fmpq]:
        """Return levels as the line (a, b, c), in lengths."""
        a, b, c = (scaled(x, unit) for x, unit in zip(levels, self.units, strict=True))
        return a, b, -c

    def point(self, rho: tuple[fmpq, fmpq]) -> Vector:
        """Return a scale pair as a point z in own units, coprime."""
        common, least = rho[0].q.lcm(rho[1].q), min(self.units)
        z = ((rho[0] * common).p, (rho[1] * common).p, common)
        return coprime([x << (unit - least) for x, unit in zip(z, self.units, strict=True)])

    def homogeneous(self, z: Vector) -> Vector:
        """Return a point z as homogeneous scale pair (x, y, w), coprime."""
        top = max(self.units)
        return coprime([x << (top - unit) for x, unit in zip(z, self.units, strict=True)])

    def vertices(self, columns: Iterable[int]) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the vertices of part 1 and of part 2 that columns stand for, in ascending order."""
        n, end = self.counts[0], self.total - 1
        found = sorted(columns)
        return tuple([j for j in found if j < n]), tuple([j - n for j in found if n <= j < end])
