"""The polygon of all scale pairs at which two parts meet: the shadow of a linear program's solutions.

The weights of the linear program (see `program`) fill a polytope; z = (sum lambda, sum mu, tau) maps it to a polygon
in the plane k.z = 1, its shadow. The scale pairs that meet are a projective image of it; its edges are contact lines.

Between two points of the outline either the line through them is an edge, or the simplex method finds a point of the
outline beyond it. An edge is proved against all columns by its dual solution, a contact line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from flint import fmpz

from fcdm_opt.curve.exact.program import Basis, Program, phase_one
from fcdm_opt.curve.exact.rationals import ONE, ZERO, Vector, affine_rank, coprime, cross, dot, dot4

_AXES = ((ONE, ZERO, ZERO), (ZERO, ONE, ZERO), (ZERO, ZERO, ONE))


class Vertex(NamedTuple):
    """A vertex of the polygon: z, coprime, in own units, and a basis that gives it."""

    point: Vector
    basis: Basis

    @classmethod
    def of(cls, basis: Basis) -> Vertex:
        """Return the point of a basis."""
        return cls(coprime(basis.point), basis)


@dataclass(frozen=True, eq=False)
class Edge:
    """An edge of the polygon, counter-clockwise."""

    start: Vertex
    end: Vertex
    basis: Basis  # of columns that are all tight
    # n, levels: (3,): its dual solution: the polygon is where levels . z >= 0. n = 0 on a side of the triangle z >= 0
    n: Vector
    levels: Vector

    @cached_property
    def tight(self) -> list[int]:
        """Columns with n.c = level: all that any solution along the edge may use."""
        return self.basis.program.tight(self.n, self.levels)

    def before(self, other: Edge) -> Edge | None:
        """Return this edge and the one that follows it as one, None unless they are on one line."""
        if any(cross(self.levels, other.levels)) or dot(self.levels, other.levels) < 0:
            return None
        return Edge(self.start, other.end, self.basis, self.n, self.levels)


class Shadow:
    """The polygon of all z = (sum lambda, sum mu, tau) that weights can give; `start` is what phase one found."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self.start = phase_one(program)

    @cached_property
    def edges(self) -> list[Edge]:
        """The polygon's edges, counter-clockwise; there and back for a segment, none for a point or nothing."""
        if self.start.basis is None:
            return []
        one = Vertex.of(self.start.basis.maximised(_AXES[0]))
        others = (Vertex.of(one.basis.maximised(way)) for way in _AXES[1:])
        two = next((other for other in others if other.point != one.point), None)
        if two is None:  # all entries of z are largest there
            return []
        edges: list[Edge] = []
        for edge in self._outline(one, two) + self._outline(two, one):
            whole = edges[-1].before(edge) if edges else None
            edges[-1:] = [whole] if whole else [*edges[-1:], edge]
        whole = edges[-1].before(edges[0])
        return [whole, *edges[1:-1]] if whole else edges

    def _outline(self, here: Vertex, last: Vertex) -> list[Edge]:
        """Return the edges from one point of the outline to another, counter-clockwise, some in several stretches."""
        edges, ahead = [], [last]
        while ahead:
            line = coprime(cross(here.point, ahead[-1].point))
            if line in _AXES:  # a side of the triangle z >= 0
                edges.append(Edge(here, ahead[-1], here.basis, (ZERO, ZERO, ZERO), line))
                here = ahead.pop()
                continue
            basis = here.basis.maximised([-x for x in line])
            beyond = Vertex.of(basis)
            if dot(line, beyond.point) < 0:
                ahead.append(beyond)
                continue
            n, levels = basis.dual([-x for x in line])
            dual = coprime((*n, *levels))
            edges.append(Edge(here, ahead[-1], basis, dual[:3], dual[3:]))
            here = ahead.pop()
        return edges

    @cached_property
    def vertices(self) -> list[Vertex]:
        """The polygon's vertices, counter-clockwise; one for a point, none for nothing."""
        if self.edges or self.start.basis is None:
            return [edge.start for edge in self.edges]
        return [Vertex.of(self.start.basis)]

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
        objective: Sequence[fmpz] = [u * other * x - v * own * x for u, v, x in zip(z, point, k, strict=True)]
        return self.start.basis.maximised(objective).dual(objective)[0]


# ------------------------------------------------------------------------------------------------------ what can touch
#
# Along an edge, or at a corner, the linear program has many solutions. A vertex of a part belongs to the smallest face
# that touches there iff some solution puts weight on it (strict complementarity). So solutions that do are looked for,
# among the columns that the contact line is tight at.


def touching_along(edge: Edge) -> set[int]:
    """Return the columns that carry weight in some solution along an edge."""
    return _touching([edge.start.basis, edge.end.basis, edge.basis], edge.tight)


def touching_at_end(edge: Edge) -> set[int]:
    """Return the columns that carry weight in some solution at the vertex in which an edge ends."""
    basis = edge.end.basis
    kind, column = basis.program.kind, basis.program.column
    fixed = [  # columns that leave z as it is
        j
        for j in edge.tight
        if j in basis.basic
        or all(dot4(row, column(j)) == (basis.det if kind(j) == own else 0) for own, row in enumerate(basis.sums))
    ]
    return _touching([basis], fixed)


def _touching(bases: Sequence[Basis], tight: Sequence[int]) -> set[int]:
    """Return the columns that carry weight in some solution that uses tight columns only; those of the last are."""
    last = bases[-1].program.total - 1
    carrying = {j for basis in bases for j in basis.carrying}
    while True:
        carrying |= _filled(bases[-1], carrying, tight)
        rest = [j for j in tight if j not in carrying and j != last]
        more = _loaded(bases[-1], set(rest), tight) if rest else set()
        if not more:
            return carrying
        carrying |= more


def _filled(basis: Basis, carrying: set[int], tight: Sequence[int]) -> set[int]:
    """Return the faces that columns of theirs span all of: a point inside a face is a mean of all its vertices."""
    filled: set[int] = set()
    column = basis.program.column
    for kind in (0, 1):
        face = [j for j in tight if basis.program.kind(j) == kind]
        own = [j for j in face if j in carrying]
        if own and len(own) < len(face):
            spans = [affine_rank([column(j)[:3] for j in some]) for some in (own, face)]
            if spans[0] == spans[1]:
                filled.update(face)
    return filled


def _loaded(basis: Basis, wanted: set[int], tight: Sequence[int]) -> set[int]:
    """Return the columns of a solution that puts weight on one of `wanted`, none if there is no such solution."""
    column, basis = basis.program.column, basis.restarted()
    while True:
        h = [ZERO] * 4
        for j, row in zip(basis.basic, basis.rows, strict=True):
            if j in wanted:
                h = [u + v for u, v in zip(h, row, strict=True)]
        gains = [((basis.det if j in wanted else ZERO) - dot4(h, column(j)), j) for j in tight if j not in basis.basic]
        gain, entering = max(gains, default=(ZERO, -1))
        if not gain > 0:
            return set()
        basis = basis.pivoted(entering)
        carrying = set(basis.carrying)
        if carrying & wanted:
            return carrying
