"""The curve of one pair of convex parts, piece by piece, exact and rounded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from flint import fmpq, fmpz

from fcdm_opt.curve.exact.program import Program
from fcdm_opt.curve.exact.rationals import Number, Vector, length, over_length, quotient, scale_pair
from fcdm_opt.curve.exact.shadow import Edge, Shadow, touching_along, touching_at_end
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import ConvexPart


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
