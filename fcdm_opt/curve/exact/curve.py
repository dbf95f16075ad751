"""The curve of one pair of convex parts, piece by piece, exact and rounded: the shadow of a linear program's solutions.

The weights of the linear program (see `program`) fill a polytope; z = (sum lambda, sum mu, tau) maps it to a polygon
in the plane k.z = 1, its shadow. The scale pairs that meet are a projective image of it; its edges are contact lines.

Between two points of the outline either the line through them is an edge, or the simplex method finds a point of the
outline beyond it. An edge is proved against all columns by its dual solution, a contact line.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from flint import fmpq, fmpz

from fcdm_opt.curve.exact.program import Basis, Program, phase_one
from fcdm_opt.curve.exact.rationals import (
    ONE,
    ZERO,
    Number,
    Vector,
    affine_rank,
    coprime,
    cross,
    dot,
    dot4,
    length,
    over_length,
    quotient,
    scale_pair,
)
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import ConvexPart

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
        others = (Vertex.of(one.basis.maximised(axis)) for axis in _AXES[1:])
        two = next((other for other in others if other.point != one.point), None)
        if two is None:  # all entries of z are largest there
            return []
        edges: list[Edge] = []
        for edge in self._boundary(one, two) + self._boundary(two, one):
            whole = edges[-1].before(edge) if edges else None
            edges[-1:] = [whole] if whole else [*edges[-1:], edge]
        whole = edges[-1].before(edges[0])
        return [whole, *edges[1:-1]] if whole else edges

    def _boundary(self, here: Vertex, last: Vertex) -> list[Edge]:
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


@dataclass(frozen=True, eq=False)
class ExactCorner:
    """A switching point: where two pieces of a chain meet."""

    edge: Edge = field(repr=False)  # of the shadow, the one that ends there

    @cached_property
    def point(self) -> Vector:
        """Homogeneous, coprime: rho = (x / w, y / w)."""
        return self.edge.basis.program.homogeneous(self.edge.end.point)

    @cached_property
    def touching(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Vertices of the smallest faces of both parts that touch there."""
        return self.edge.basis.program.vertices(touching_at_end(self.edge))

    @cached_property
    def rho(self) -> Array:
        """The scale pair, correctly rounded, (2,)."""
        return _rounded(self.point)


@dataclass(frozen=True, eq=False)
class ExactPiece:
    """A straight stretch of the boundary, in the open quadrant."""

    exact_normal: Vector  # (3,): direction from body 1 to body 2, world frame, coprime integers
    # (3,): (a, b, c) of that direction, not normalised; overlap on the side of (a, b)
    exact_line: tuple[fmpq, fmpq, fmpq]
    # exact_start, exact_end: (3,): homogeneous ends (x, y, w), coprime, overlap on the left; w = 0: at infinity in the
    # direction (x, y)
    exact_start: Vector
    exact_end: Vector
    edge: Edge = field(repr=False)  # of the shadow

    @cached_property
    def touching(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Vertices of the smallest faces of both parts that touch along the whole piece."""
        return self.edge.basis.program.vertices(touching_along(self.edge))

    @cached_property
    def tight(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """All vertices of both parts that the direction supports."""
        return self.edge.basis.program.vertices(self.edge.tight)

    @cached_property
    def _length(self) -> fmpz:
        return length(self.exact_normal)

    @cached_property
    def normal(self) -> Array:
        """Unit direction, (3,)."""
        return frozen([over_length(x, self._length) for x in self.exact_normal])

    @cached_property
    def line(self) -> Array:
        """(a, b, c) of the unit direction, in lengths, (3,)."""
        return frozen([over_length(x, self._length) for x in self.exact_line])

    @cached_property
    def start(self) -> Array:
        """First scale pair, correctly rounded, (2,); the unit direction to it where `starts_far`."""
        return _rounded(self.exact_start)

    @cached_property
    def end(self) -> Array:
        """Last scale pair, correctly rounded, (2,); the unit direction to it where `ends_far`."""
        return _rounded(self.exact_end)

    @property
    def starts_far(self) -> bool:
        """Whether the piece comes from infinity."""
        return not self.exact_start[2]

    @property
    def ends_far(self) -> bool:
        """Whether the piece goes to infinity."""
        return not self.exact_end[2]

    def separation(self, rho: tuple[fmpq, fmpq]) -> fmpq:
        """Return c - a rho_1 - b rho_2, times the length of `exact_normal`."""
        a, b, c = self.exact_line
        return c - a * rho[0] - b * rho[1]


@dataclass(frozen=True, eq=False)
class ExactChain:
    """Consecutive pieces, overlap on the left."""

    pieces: tuple[ExactPiece, ...]
    # after each piece that another one follows; of a closed chain after the last piece too
    corners: tuple[ExactCorner, ...]
    closed: bool  # whether it is a closed polygon; otherwise it starts and ends on an axis or at infinity


@dataclass(frozen=True, eq=False)
class ExactCurve:
    """The overlap region of one pair of convex parts in the open quadrant, and the chains that bound it."""

    # whether the region has a boundary, is empty (the parts may touch but never overlap), or is the whole quadrant
    status: Literal["bounded", "empty", "full"]
    chains: tuple[ExactChain, ...]
    proof: Vector | None  # where empty: a direction n with a <= 0, b <= 0 and c >= 0, which no scale pair overcomes
    shadow: Shadow = field(repr=False)  # the region as the shadow of a linear program

    @property
    def pieces(self) -> list[ExactPiece]:
        """All pieces, chain by chain."""
        return [piece for chain in self.chains for piece in chain.pieces]

    def side(self, rho: Sequence[Number]) -> int:
        """Return 1 where the parts are apart, 0 where they touch, -1 where they overlap, at a positive scale pair."""
        # that is of floats as they are, or of rationals
        point = scale_pair(rho)
        if self.status == "empty":
            return int(self.widest(point)[0] < 0)
        if self.status == "full":
            return -1
        widest = max(piece.separation(point) for piece in self.pieces)
        return (widest > 0) - (widest < 0)

    def separation(self, rho: Sequence[Number]) -> float:
        """Return the largest separation along the curve's own lines, in lengths, rounded once."""
        # its sign is right: positive apart, 0 touching, negative overlapping. -inf where there is no line
        point = scale_pair(rho)
        if self.status != "empty":
            values = [over_length(piece.separation(point), piece._length) for piece in self.pieces]
            return max(values, default=-math.inf)
        least, n = self.widest(point)
        if least >= 0:
            return 0.0
        program = self.shadow.program
        a, b, c = program.line(program.levels(n))
        return over_length(c - a * point[0] - b * point[1], length(n))

    def widest(self, point: tuple[fmpq, fmpq]) -> tuple[fmpz, Vector]:
        """Return the half-plane that a scale pair is least inside of, its value and its direction."""
        return min(self.shadow.half_planes(self.shadow.program.point(point)), key=lambda found: found[0])


def exact_curve(one: ConvexPart, two: ConvexPart, transform: Array | None = None) -> ExactCurve:
    """Return the exact decision curve of two convex parts, of which only vertices and seeds are used.

    The transform of body 1, (4, 4), is taken as given: rational, not exactly orthogonal; by default it is the identity.

    Bodies that never overlap have a direction n with a <= 0, b <= 0, c >= 0, one direction for all scale pairs: the
    cone of all p_i, -q_j, -d is then not all of space (Gordan). So emptiness needs no pair of lines.
    """
    shadow = Shadow(Program(one, two, np.eye(4) if transform is None else transform))
    if shadow.start.excluding is not None:
        return ExactCurve("empty", (), shadow.start.excluding, shadow)
    edges = shadow.edges
    # not on an axis, at infinity, nor a stand-in between two ends of the walk
    inner = [
        any(edge.n) and all(x or y for x, y in zip(edge.start.point, edge.end.point, strict=True)) for edge in edges
    ]
    if not any(inner):
        return ExactCurve("full", (), None, shadow)
    breaks = [k + 1 for k, edge in enumerate(edges) if not all(edge.end.point)]  # on an axis or at infinity
    if not breaks:
        places = [tuple(fmpq(x, edge.start.point[2]) for x in edge.start.point[:2]) for edge in edges]
        first = places.index(min(places))
        return ExactCurve("bounded", (_chain(shadow, edges[first:] + edges[:first], closed=True),), None, shadow)
    # start behind an interruption, so that no chain is torn at the seam of the outline
    chains = [
        [k % len(edges) for k in range(start, stop) if inner[k % len(edges)]]
        for start, stop in zip(breaks, [*breaks[1:], breaks[0] + len(edges)], strict=True)
    ]
    made = [_chain(shadow, [edges[k] for k in chain], closed=False) for chain in chains if chain]
    return ExactCurve("bounded", tuple(made), None, shadow)


def _chain(shadow: Shadow, edges: Sequence[Edge], closed: bool) -> ExactChain:
    pieces = tuple([_piece(shadow.program, edge) for edge in edges])
    return ExactChain(pieces, tuple(map(ExactCorner, edges if closed else edges[:-1])), closed)


def _piece(program: Program, edge: Edge) -> ExactPiece:
    content = edge.n[0].gcd(edge.n[1]).gcd(edge.n[2])
    n, levels = (tuple([x // content for x in own]) for own in (edge.n, edge.levels))
    start, end = map(program.homogeneous, (edge.start.point, edge.end.point))
    return ExactPiece(n, program.line(levels), start, end, edge)


def _rounded(point: Vector) -> Array:
    """Return a homogeneous point as scale pair; at infinity its unit direction."""
    x, y, w = point
    if w:
        return frozen([quotient(x, w), quotient(y, w)])
    size = length((x, y))
    return frozen([over_length(x, size), over_length(y, size)])
