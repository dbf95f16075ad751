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
from flint import fmpq, fmpz

from fcdm_opt.curve.program import Program
from fcdm_opt.curve.rationals import ONE, ZERO, Vector, cross, dot, dot4

ARTIFICIAL = -1  # number and kind of the column that phase one adds


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
        a, b, c = (self.sum(kind) for kind in range(3))
        return a, b, c

    def sum(self, kind: int) -> Vector:
        rows = [row for row, own in zip(self.rows, self.kinds, strict=True) if own == kind]
        if len(rows) == 1:
            return rows[0]
        return tuple([sum(entries, ZERO) for entries in zip(*rows, strict=True)]) if rows else (ZERO,) * 4
