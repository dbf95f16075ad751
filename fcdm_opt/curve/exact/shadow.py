"""The polygon of all scale pairs at which two parts meet, traversed by the shadow vertex method.

The weights of the linear program (see `program`) fill a polytope; z = (sum lambda, sum mu, tau) maps it to a polygon
in the plane k.z = 1, its shadow. The scale pairs that meet are a projective image of it; its edges are contact lines.

The polygon is traversed once, from one vertex both ways. At each vertex the simplex method holds a basis that is
optimal for the direction of travel. The next edge is the least turn that any column makes possible; its dual solution
is the contact line, proved against all columns. Along an edge the basis is pivoted by columns that do not leave the
line, the one that leads furthest first, until none leads further: only these are priced, not all columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from flint import fmpz

from fcdm_opt.curve.exact.program import ROUNDING, Program
from fcdm_opt.curve.exact.rationals import ONE, ZERO, Vector, coprime, cross2, dot, dot2, dot4, normalised
from fcdm_opt.curve.exact.simplex import Basis, phase_one
from fcdm_opt.geometry.arrays import Array

Step = tuple[fmpz, fmpz]
FEW = 16  # columns are worked out exactly without a look at all columns' floats: that costs as much
# A turn (t.g) across - (t x g) along has coefficients below 2 and entries with an error e each: 4 e, and 2 e more for
# the rounding of the coefficients.
TURN_ERROR = 6


@dataclass(frozen=True, eq=False)
class Vertex:
    """A vertex of the polygon.

    Attributes
    ----------
    point : (3,) tuple of fmpz
        z, coprime, in own units.
    basis : Basis
    tight : sequence of int
        Columns that include all that any solution at this vertex may use.
    """

    point: Vector
    basis: Basis
    tight: Sequence[int]


@dataclass(frozen=True, eq=False)
class Edge:
    """An edge of the polygon, counter-clockwise.

    Attributes
    ----------
    start, end : Vertex
    n, levels : (3,) tuples of fmpz
        Its dual solution: the polygon is where levels . z >= 0. n = 0 on a side of the triangle z >= 0.
    tight : sequence of int
        Columns with n.c = level.
    bases : sequence of Basis
        Met on the way from one end to the other.
    """

    start: Vertex
    end: Vertex
    n: Vector
    levels: Vector
    tight: Sequence[int]
    bases: Sequence[Basis]

    @property
    def reverse(self) -> Edge:
        """The same edge, from its end to its start."""
        return Edge(self.end, self.start, self.n, self.levels, self.tight, self.bases[::-1])


class Shadow:
    """The polygon of all z = (sum lambda, sum mu, tau) that weights can give.

    Attributes
    ----------
    program : Program
    start : Start
        What phase one found.
    """

    def __init__(self, program: Program) -> None:
        self.program = program
        self.start = phase_one(program)

    @cached_property
    def edges(self) -> list[Edge]:
        """The polygon's edges, counter-clockwise; there and back for a segment, none for a point or nothing.

        Both ways round end where only one part has a weight: its seed lies inside it. Between two such vertices the
        polygon's edge is the side tau = 0 of the triangle z >= 0, and need not be walked. Without one the first way
        goes all round.
        """
        if self.start.basis is None:
            return []
        lowest = self.start.basis.maximised((ZERO, ZERO, ONE)).restarted()
        found = _Walk(self.program, (0, 1)).edges(lowest)
        if not found or found[0].start.point == found[-1].end.point:
            return found
        back = _Walk(self.program, (1, 0)).edges(found[0].start.basis, found[0].start)
        if not back:  # the first way went round all that there is
            return found
        here, there = found[-1].end, back[-1].end
        if here.point != there.point:
            found.append(Edge(here, there, (ZERO, ZERO, ZERO), (ZERO, ZERO, ONE), (), (here.basis,)))
        return found + [edge.reverse for edge in reversed(back)]

    @cached_property
    def vertices(self) -> list[Vertex]:
        """The polygon's vertices, counter-clockwise; one for a point, none for nothing."""
        if self.edges or self.start.basis is None:
            return [edge.start for edge in self.edges]
        return [Vertex(coprime(self.start.basis.point), self.start.basis, ())]

    def half_planes(self, z: Vector) -> list[tuple[fmpz, Vector]]:
        """Return (levels . z, n) of half-planes: z is in the polygon iff none of them is negative."""
        found = [(dot(edge.levels, z), edge.n) for edge in self.edges if any(edge.n)]
        if self.start.excluding is not None:
            found.append(self._half_plane(self.start.excluding, z))
        if len(self.vertices) < 3:  # a segment's edges do not end it, a point has none
            found += [self._half_plane(self._towards(vertex.point, z), z) for vertex in self.vertices]
        return found

    def _half_plane(self, n: Vector, z: Vector) -> tuple[fmpz, Vector]:
        return dot(self.program.levels(n), z), n

    def _towards(self, point: Vector, z: Vector) -> Vector:
        """Return the n of the line that is normal to the way from a vertex to z, in the plane k.z = 1."""
        assert self.start.basis is not None
        k = self.program.k
        own, other = dot(k, z), dot(k, point)
        objective = [u * other * x - v * own * x for u, v, x in zip(z, point, k, strict=True)]
        return self.start.basis.maximised(objective).dual(objective)[0]


class _Stretch(NamedTuple):
    """The edge that is being walked: the column it began with, its direction, dual and tight columns."""

    entering: int
    direction: Step
    n: Vector
    levels: Vector
    tight: Sequence[int]


class _Walk:
    """Walks along the polygon's boundary, counter-clockwise for axes (0, 1), clockwise for (1, 0).

    In the plane of (z_1, z_2), or (z_2, z_1), the basis is always optimal for the outward normal of the direction of
    travel t: no column moves z to the right of t. The next direction is that of the column least far to the left.
    """

    def __init__(self, program: Program, axes: tuple[int, int]) -> None:
        self.program, self.axes = program, axes

    def edges(self, basis: Basis, start: Vertex | None = None) -> list[Edge]:
        """Return the edges in the order walked, `start` and `end` too: all round, or until only one part has a weight.

        Parameters
        ----------
        basis : Basis
            One that maximises tau.
        start : Vertex, optional
            Where to start, if it is the basis' own; otherwise the end of the edge of largest tau, if there is one.
        """
        x, y = self.axes
        level = (self.program.k[y], -self.program.k[x])  # k_1 z_1 + k_2 z_2 stays as it is, and so does tau
        stretch = self._turn(basis, level)
        while stretch and not start and not cross2(level, stretch.direction) and dot2(level, stretch.direction) > 0:
            basis = basis.pivoted(stretch.entering)
            stretch = self._turn(basis, level)
        if stretch is None:
            return []
        start = start or Vertex(coprime(basis.point), basis, stretch.tight)
        found: list[Edge] = []
        first, half = stretch.direction, False  # half a round is behind
        while True:
            bases, alone = self._along(basis, stretch, start)
            basis = bases[-1]
            ahead = None if alone else self._turn(basis, stretch.direction)
            end = Vertex(coprime(basis.point), basis, ahead.tight if ahead else ())
            if end.point != start.point:
                found.append(Edge(start, end, stretch.n, stretch.levels, stretch.tight, bases))
                start = end
            if ahead is None:
                return found
            side, forth = cross2(first, ahead.direction), dot2(first, ahead.direction)
            half = half or side < 0 or (not side and forth < 0)
            if half and (side > 0 or (not side and forth > 0)):
                return found
            stretch = ahead

    def _along(self, basis: Basis, stretch: _Stretch, start: Vertex) -> tuple[list[Basis], bool]:
        """Return the bases met from one end of an edge to the other, and whether only one part has a weight there."""
        bases = [basis]
        entering: int | None = stretch.entering
        while entering is not None:
            basis = basis.pivoted(entering)
            bases.append(basis)
            z = basis.point
            if not z[2] and not (z[0] and z[1]) and coprime(z) != start.point:
                return bases, True
            entering = self._onward(basis, stretch)
        return bases, False

    # ---- how columns move z, along both axes and times the determinant

    def _step(self, basis: Basis, j: int) -> Step:
        """Return how z moves as column j enters."""
        first, second = self.axes
        kind, column = self.program.kind(j), self.program.column(j)
        x, y = -dot4(basis.sums[first], column), -dot4(basis.sums[second], column)
        return (x + basis.det if kind == first else x), (y + basis.det if kind == second else y)

    def _steps(self, basis: Basis, t: Step) -> tuple[Array, float, float, float]:
        """Return all columns' steps along t and to the left of it, (2, N), their error bound, and t, as floats."""
        (first, second), reach, k = self.axes, self.program.reach, self.program.k
        (a, b, c, d), (e, f, g, h) = basis.sums[first], basis.sums[second]
        p, q = reach[first], reach[second]
        values = [-a, -b, -c, *(-d * x for x in k), -e, -f, -g, *(-h * x for x in k)]
        values[3 + first] += basis.det
        values[9 + second] += basis.det
        shifts = [p, p, p, *(p - r for r in reach), q, q, q, *(q - r for r in reach)]
        rows = normalised(values, shifts)
        tx, ty = normalised(t, (p, q))
        turned = np.array([[tx, ty], [-ty, tx]]) @ np.array([rows[:6], rows[6:]])
        return self.program.values(turned), ROUNDING * sum(map(abs, rows)), tx, ty

    def _dual(self, basis: Basis, g: Step) -> tuple[Vector, Vector]:
        """Return the dual (n, levels) of a direction that a column's step has; it is a multiple of the determinant."""
        objective = [ZERO, ZERO, ZERO]
        objective[self.axes[0]], objective[self.axes[1]] = g[1], -g[0]
        n, levels = basis.dual(objective)
        det = basis.det
        return tuple([x // det for x in n]), tuple([x // det for x in levels])

    # ---- the next column

    def _onward(self, basis: Basis, stretch: _Stretch) -> int | None:
        """Return a column that moves z further along the edge, None if there is none."""
        t, rest = stretch.direction, stretch.tight
        if len(rest) > FEW:
            steps, error, _, _ = self._steps(basis, t)
            own = np.array(rest)
            along = steps[0][own]
            furthest = int(along.argmax())
            if along[furthest] > error:
                return int(own[furthest])
            rest = own[along >= -error].tolist()
        best, found = ZERO, None
        for j in rest:
            if j not in basis.basic:
                reached = dot2(t, self._step(basis, j))
                if reached > best:
                    best, found = reached, j
        return found

    def _turn(self, basis: Basis, t: Step) -> _Stretch | None:
        """Return the edge behind this vertex; None where no column moves z at all, the polygon being a point."""
        steps, error, tx, ty = self._steps(basis, t)
        along, across = steps
        entering = self._forward(basis, along, across, error)
        while entering is not None:
            g = self._step(basis, entering)
            gx, gy = normalised(g, [self.program.reach[axis] for axis in self.axes])
            left = (tx * gx + ty * gy) * across - (tx * gy - ty * gx) * along  # of g
            least = int(left.argmin())
            if left[least] < -TURN_ERROR * error:
                entering = least
                continue
            doubtful = (left <= TURN_ERROR * error).nonzero()[0].tolist()
            sharper, stretch = self._checked(basis, entering, g, doubtful)
            if sharper is None:
                return self._straight(basis, t, stretch)
            entering = sharper
        return None

    def _forward(self, basis: Basis, along: Array, across: Array, error: float) -> int | None:
        """Return a column that turns little, by its floats; None where no column moves z."""
        slope = along / np.maximum(across, error)
        slope[list(basis.basic)] = -np.inf
        entering = int(slope.argmax())
        if abs(along[entering]) + abs(across[entering]) > 2 * error:
            return entering
        slope[np.abs(along) + np.abs(across) <= 2 * error] = -np.inf  # hardly moves, if at all: others first
        entering = int(slope.argmax())
        if slope[entering] > -np.inf:
            return entering
        return next((j for j in range(self.program.total) if any(self._step(basis, j))), None)

    def _checked(self, basis: Basis, entering: int, g: Step, doubtful: Sequence[int]) -> tuple[int | None, _Stretch]:
        """Check a direction against doubtful columns: return one that turns less, the least of all, or the edge."""
        kind, column = self.program.kind, self.program.column
        n, levels = own = self._dual(basis, g)
        if not any(n):  # a side of the triangle z >= 0: its line says of all columns of a kind the same
            tight = [j for j in range(self.program.total) if not levels[kind(j)]]
            return None, _Stretch(entering, g, n, levels, tight)
        tight = [*basis.basic, entering]
        sharper = None
        for j in doubtful:  # one pass finds the least turn of all: what a sharper one leaves behind stays behind
            if j in tight[:5]:
                continue
            value = levels[kind(j)] - dot(n, column(j))
            if value < 0:
                sharper = j
                n, levels = self._dual(basis, self._step(basis, j))
            elif not value:
                tight.append(j)
        return sharper, _Stretch(entering, g, *own, tight)

    def _straight(self, basis: Basis, t: Step, stretch: _Stretch) -> _Stretch:
        """Return the edge, or, where it goes straight back, the one straight on along the same line, if any."""
        if cross2(t, stretch.direction) or dot2(t, stretch.direction) > 0:
            return stretch
        for j in stretch.tight:
            g = self._step(basis, j)
            if dot2(t, g) > 0:
                return _Stretch(j, g, *self._dual(basis, g), stretch.tight)
        return stretch
