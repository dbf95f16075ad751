"""The linear program whose solutions are the common points of two scaled parts, and the simplex method on it.

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
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from flint import fmpq, fmpz

from fcdm_opt.curve.exact.rationals import (
    ONE,
    ZERO,
    Vector,
    common_unit,
    coprime,
    cross,
    dot,
    dot4,
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
ARTIFICIAL = -1  # number and kind of the column that phase one adds
NOTHING: Vector = (ZERO, ZERO, ZERO, ZERO)


class Program:
    """The columns of two convex parts: as integers when asked for, and all of them as floats.

    Columns are numbered: the vertices of part 1, those of part 2, the offset; `counts` are of the vertices, `total` is
    of all. The transform of body 1, (4, 4), is taken as given.

    `units` are the exponents of the powers of two that lengths of part 1, part 2 and d are counted in; k, (3,), is two
    to the powers `powers`: at least as large as any entry of such a column. `floats`, (6, total), are the first three
    rows divided by k, and three rows that say of which kind a column is.
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
        self.powers = (tops[0] - self.units[0], tops[1] - self.units[1], width)
        self.k = tuple([ONE << bits for bits in self.powers])
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

    def values(self, coefficients: Sequence[float] | Sequence[Sequence[float]]) -> Array:
        """Return coefficients times all columns' floats, one value or row of values a column."""
        return np.array(coefficients) @ self.floats

    def price(self, n: Vector, levels: Vector, basic: Sequence[int]) -> int | None:
        """Return a column with level - n.c < 0, one of the lowest; None if there is none, proved for every column.

        `levels` are of each kind; `basic` are columns where it is 0 by construction.
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
        return [j for j in (values <= error).nonzero()[0].tolist() if levels[self.kind(j)] == dot(n, self.column(j))]

    def _slacks(self, n: Vector, levels: Vector) -> tuple[Array, float]:
        """Return level - n.c of all columns up to a factor, and a bound of its error."""
        p, q, r = self.powers
        coefficients = normalised((-n[0], -n[1], -n[2], *levels), (0, 0, 0, -p, -q, -r))
        return self.values(coefficients), ROUNDING * sum(map(abs, coefficients))

    def levels(self, n: Vector) -> Vector:
        """Return the lowest levels of a direction, (a, b, -c) in own units: its line."""
        coefficients = normalised((*n, ZERO, ZERO, ZERO), (0,) * 6)
        heights = self.values(coefficients)
        error = 2 * ROUNDING * sum(map(abs, coefficients))  # of a difference of two
        first, last = self.counts[0], self.total - 1
        levels = []
        for low, high in ((0, first), (first, last), (last, last + 1)):
            near = (heights[low:high] >= heights[low:high].max() - error).nonzero()[0] + low
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


# --------------------------------------------------------------------------------------------------- the simplex method
#
# A basis is four independent columns of the program. It is held as the adjugate and the determinant of their matrix, so
# all of it stays integer (Edmonds: what a pivot divides by divides exactly). The right-hand side is (0, 0, 0, 1): the
# weights of a basis are the last entries of the adjugate's rows, over the determinant.
#
# A pivot is one step along an edge of the polytope of weights, or none where weights are zero. So that such bases do
# not follow each other in a circle, ties of the ratio test are broken by the lexicographic rule: the right-hand side is
# thought of as perturbed by powers of an infinitely small number times the columns of the basis it started from.


@dataclass(frozen=True, eq=False)
class Basis:
    """Four independent columns, and the inverse of their matrix."""

    program: Program
    origin: tuple[Vector, ...]  # of the first basis: they perturb the right-hand side
    basic: tuple[int, ...]  # its columns, and in `kinds` what they stand for
    kinds: tuple[int, ...]
    rows: tuple[Vector, ...]  # adjugate of the columns' matrix
    det: fmpz  # determinant, positive

    @property
    def carrying(self) -> list[int]:
        """Columns with a positive weight."""
        return [j for j, row in zip(self.basic, self.rows, strict=True) if row[3]]

    @property
    def weights(self) -> dict[int, fmpz]:
        """Columns with their weights, times the determinant."""
        return {j: row[3] for j, row in zip(self.basic, self.rows, strict=True)}

    @property
    def point(self) -> Vector:
        """z, times the determinant."""
        return tuple([row[3] for row in self.sums])

    @cached_property
    def sums(self) -> tuple[Vector, Vector, Vector]:
        """Sums of the adjugate's rows over the columns of each kind."""
        found = [NOTHING, NOTHING, NOTHING]
        for kind, row in zip(self.kinds, self.rows, strict=True):
            own = found[kind]
            found[kind] = row if own is NOTHING else tuple([x + y for x, y in zip(own, row, strict=True)])
        return found[0], found[1], found[2]

    def restarted(self) -> Basis:
        """Return the same basis as the first of a path of pivots."""
        return replace(self, origin=tuple([self.program.column(j) for j in self.basic]))

    def products(self, j: int) -> Vector:
        """Return the adjugate times a column: how much of each basic one it stands for, times the determinant."""
        a, b, c, d = self.program.column(j)
        return tuple([p * a + q * b + r * c + s * d for p, q, r, s in self.rows])

    def leaving(self, y: Vector, places: int = 4) -> int | None:
        """Return the place of the weight that reaches 0 first; ties by the lexicographic rule, None for no place."""
        # `y`, (4,), are the `products` of the entering column. The first `places` weights may leave
        best = None
        for i in range(places):
            if not y[i] > 0:
                continue
            if best is None:
                best = i
                continue
            p, q = self.rows[i], self.rows[best]
            order = p[3] * y[best] - q[3] * y[i]
            if not order:
                for column in self.origin:
                    order = dot4(p, column) * y[best] - dot4(q, column) * y[i]
                    if order:
                        break
            if order < 0:
                best = i
        return best

    def replaced(self, place: int, entering: int, y: Vector) -> Basis:
        """Return the basis with a column in another's place; y: its `products`."""
        pivot, (a, b, c, d), det = y[place], self.rows[place], self.det
        rows: list[Vector] = [
            ((pivot * p - f * a) // det, (pivot * q - f * b) // det, (pivot * r - f * c) // det,
             (pivot * s - f * d) // det)
            for (p, q, r, s), f in zip(self.rows, y, strict=True)
        ]  # fmt: skip
        rows[place] = self.rows[place]
        basic, kinds = list(self.basic), list(self.kinds)
        basic[place], kinds[place] = entering, self.program.kind(entering)
        return Basis(self.program, self.origin, tuple(basic), tuple(kinds), tuple(rows), pivot)

    def pivoted(self, entering: int) -> Basis:
        """Return the next basis, with one more column and one less."""
        y = self.products(entering)
        place = self.leaving(y)
        assert place is not None  # k.z = 1 bounds all weights
        return self.replaced(place, entering, y)

    def dual(self, objective: Sequence[fmpz]) -> tuple[Vector, Vector]:
        """Return (n, levels) times the determinant: what a column costs the objective . z is level - n.c."""
        h: Sequence[fmpz] = NOTHING
        for own, factor in zip(self.sums, objective, strict=True):
            if factor and own is not NOTHING:
                h = [u + factor * v for u, v in zip(h, own, strict=True)]
        det, last = self.det, h[3]
        levels = tuple([last * k - factor * det for k, factor in zip(self.program.k, objective, strict=True)])
        return (-h[0], -h[1], -h[2]), levels

    def maximised(self, objective: Sequence[fmpz]) -> Basis:
        """Return a basis that maximises objective . z."""
        basis = self
        while (entering := self.program.price(*basis.dual(objective), basis.basic)) is not None:
            basis = basis.pivoted(entering)
        return basis


# ----------------------------------------------------------------------------------------------------------- phase one


@dataclass(frozen=True, eq=False)
class Start:
    """What phase one finds."""

    basis: Basis | None  # one with non-negative weights; None where there is none: no scale pair meets
    # a direction n with n.c <= 0 for the first three entries of all columns, so a <= 0, b <= 0 and c >= 0
    excluding: Vector | None
    # unless `excluding`: a basis and an entering column that bring the weight of A below 0
    crossing: tuple[Basis, int] | None


def phase_one(program: Program) -> Start:
    """Return a basis with non-negative weights, and whether there is an excluding direction."""
    # the artificial column A = -(c_1 + c_2 + c_3) of three independent columns makes a first basis. Its weight is
    # brought down: at 0 the other weights are a solution, and below 0 there is no excluding direction n, as n.c <= 0
    # for all columns leaves n.A > 0. So A stays in the basis with a weight of either sign, until that is settled
    basis, feasible = _artificial(program), None
    while True:
        row = basis.rows[3]
        entering = program.price(row[:3], tuple([-row[3] * x for x in program.k]), basis.basic)
        if entering is None:
            return Start(feasible, row[:3], None)
        y = basis.products(entering)
        place = basis.leaving(y, 3)
        excess = ZERO if place is None else row[3] * y[place] - basis.rows[place][3] * y[3]
        if excess <= 0:  # A reaches 0 no later than any other weight
            feasible = basis.replaced(3, entering, y).restarted()
        if place is None or excess < 0:
            return Start(feasible, None, (basis, entering))
        basis = basis.replaced(place, entering, y)


def _artificial(program: Program) -> Basis:
    """Return the basis of three independent columns and A, with weights 1, 1, 1, 1 over their sum."""
    chosen = independent(program)
    columns = [program.column(j) for j in chosen]
    c1, c2, c3 = columns
    m1, m2, m3 = cross(c2, c3), cross(c3, c1), cross(c1, c2)
    volume, k = dot(c1, m1), c1[3] + c2[3] + c3[3]  # k is A's own fourth entry too
    last = (*(-(c1[3] * x + c2[3] * y + c3[3] * z) for x, y, z in zip(m1, m2, m3, strict=True)), volume)
    rows = [tuple([2 * k * u + v for u, v in zip((*m, ZERO), last, strict=True)]) for m in (m1, m2, m3)]
    artificial = (-(c1[0] + c2[0] + c3[0]), -(c1[1] + c2[1] + c3[1]), -(c1[2] + c2[2] + c3[2]), k)
    return Basis(
        program, (*columns, artificial), (*chosen, ARTIFICIAL), (0, 0, 0, ARTIFICIAL), (*rows, last), 2 * k * volume
    )


def independent(program: Program) -> tuple[int, int, int]:
    """Return three linearly independent vertices of part 1, positively oriented."""
    n, column = program.counts[0], program.column
    X = program.floats[:3, :n].T
    i = int((X**2).sum(axis=1).argmax())
    normals = np.cross(X, X[i])
    j = int((normals**2).sum(axis=1).argmax())
    k = int(np.abs(X @ normals[j]).argmax())
    volume = dot(column(i), cross(column(j), column(k)))
    if not volume:  # too thin for floats
        i = next(i for i in range(n) if any(column(i)[:3]))
        j = next(j for j in range(n) if any(cross(column(i), column(j))))
        normal = cross(column(i), column(j))
        k = next(k for k in range(n) if dot(normal, column(k)))
        volume = dot(normal, column(k))
    return (i, j, k) if volume > 0 else (i, k, j)
