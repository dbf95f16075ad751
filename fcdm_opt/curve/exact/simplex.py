"""The simplex method on four rows: bases, the pivot, and phase one.

A basis is four independent columns of the program. It is held as the adjugate and the determinant of their matrix, so
all of it stays integer (Edmonds: what a pivot divides by divides exactly). The right-hand side is (0, 0, 0, 1): the
weights of a basis are the last entries of the adjugate's rows, over the determinant.

A pivot is one step along an edge of the polytope of weights, or none where weights are zero. So that such bases do not
follow each other in a circle, ties of the ratio test are broken by the lexicographic rule: the right-hand side is
thought of as perturbed by powers of an infinitely small number times the columns of the basis it started from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from flint import fmpz

from fcdm_opt.curve.exact.program import Program
from fcdm_opt.curve.exact.rationals import ZERO, Vector, cross, dot, dot4

ARTIFICIAL = -1  # number and kind of the column that phase one adds
NOTHING: Vector = (ZERO, ZERO, ZERO, ZERO)


@dataclass(frozen=True, eq=False)
class Basis:
    """Four independent columns, and the inverse of their matrix.

    Attributes
    ----------
    program : Program
    origin : four columns
        Of the first basis: they perturb the right-hand side.
    basic : four int
        Its columns, and in `kinds` what they stand for.
    rows : four Vector
        Adjugate of the columns' matrix.
    det : fmpz
        Determinant, positive.
    """

    program: Program
    origin: tuple[Vector, ...]
    basic: tuple[int, ...]
    kinds: tuple[int, ...]
    rows: tuple[Vector, ...]
    det: fmpz

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
        """Return the place of the weight that reaches 0 first; ties by the lexicographic rule, None if there is none.

        Parameters
        ----------
        y : (4,) tuple of fmpz
            `products` of the entering column.
        places : int
            So many, the first ones, may leave.
        """
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
    """What phase one finds.

    Attributes
    ----------
    basis : Basis, or None
        One with non-negative weights; None where there is none: no scale pair meets.
    excluding : (3,) tuple of fmpz, or None
        A direction n with n.c <= 0 for the first three entries of all columns, so a <= 0, b <= 0 and c >= 0.
    crossing : (Basis, int), or None
        Unless `excluding`: a basis and an entering column that bring the weight of A below 0.
    """

    basis: Basis | None
    excluding: Vector | None
    crossing: tuple[Basis, int] | None


def phase_one(program: Program) -> Start:
    """Return a basis with non-negative weights, and whether there is an excluding direction.

    The artificial column A = -(c_1 + c_2 + c_3) of three independent columns makes a first basis. Its weight is brought
    down: at 0 the other weights are a solution, and below 0 there is no excluding direction n, as n.c <= 0 for all
    columns leaves n.A > 0. So A stays in the basis with a weight of either sign, until that is settled.
    """
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
