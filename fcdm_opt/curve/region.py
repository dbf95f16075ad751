"""The overlap region of one pair of convex parts: a convex region of the quadrant, and the chains that bound it.

The walk over the Gauss maps (`kernels.walk`) proves each step by signs beyond their error bounds. Where a sign is
within its bound, where features lie within `planarity` of each other, or where the walk has nowhere to start, the pair
is settled in rational arithmetic (`exact`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import (
    Contact,
    contact_at,
    contact_between,
    feature_of_site,
    site_corners,
    supporting_contact,
)
from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array, Ints, frozen
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.curve.exact import ExactChain, ExactCurve, ExactPiece


@dataclass(frozen=True, eq=False)
class Piece:
    """A stretch of a boundary line: scale pairs `base + s travel` for lo <= s <= hi (either may be infinite)."""

    contact: Contact  # what touches along it
    # facet of the Minkowski difference: kind, index in part 1, index in part 2 (see `kernels`)
    site: tuple[int, int, int]
    parts: tuple[int, int]  # the part pair (i, j), 0-based
    normal: Array  # (3,): unit direction from body 1 to body 2, world frame
    line: Array  # (3,): (a, b, c): a rho_1 + b rho_2 = c, in lengths; overlap on the side of (a, b)
    # base, travel: (2,): a point of the line, and the unit direction along it with the overlap region on the left
    base: Array
    travel: Array
    lo: float  # lo, hi: range of s
    hi: float
    # first, last: (2,) or None: the scale pairs at lo and hi where they are known better than from s
    first: Array | None = None
    last: Array | None = None
    corner: Contact | None = None  # what touches at its end, where the pair's boundary goes on
    snug: bool = False  # overlap on both sides

    @property
    def feature(self) -> Feature:
        """The bodies' elements that touch along it."""
        return self.contact.feature

    def cut(self, lo: float, hi: float) -> Piece:
        """Return a stretch of it."""
        piece = self if lo == self.lo else replace(self, lo=lo, first=None)
        return piece if hi == self.hi else replace(piece, hi=hi, last=None, corner=None)

    def at(self, s: float) -> Array:
        """Return the scale pair at parameter s."""
        return self.base + s * self.travel

    @property
    def start(self) -> Array:
        """First scale pair, or a far point where the piece comes from infinity (entries may be infinite)."""
        return self.end_at(self.lo)

    @property
    def end(self) -> Array:
        """Last scale pair."""
        return self.end_at(self.hi)

    def end_at(self, s: float) -> Array:
        """Return the scale pair at s, which may be infinite."""
        if s == self.lo and self.first is not None:
            return self.first
        if s == self.hi and self.last is not None:
            return self.last
        if np.isfinite(s):
            return self.at(s)
        return np.array([x if t == 0 else t * s for x, t in zip(self.base, self.travel, strict=True)])

    def parameter(self, rho: Array) -> float:
        """Return s of the point of the line nearest to `rho`."""
        return float((rho - self.base) @ self.travel)


@dataclass(frozen=True, eq=False)
class Region:
    """Where one pair of convex parts overlaps, in the open quadrant rho > 0.

    Build it with `pair_region`; pieces and the exact curve are worked out when asked for.
    """

    one: ConvexPart
    two: ConvexPart
    transform: Array  # (4, 4): pose change of body 1
    parts: tuple[int, int]  # indices of the parts in their bodies, kept in the pieces
    state: int  # how the walk ended, see `kernels`
    _walked: tuple[Ints, Array, Array, Ints] | None

    @property
    def path(self) -> Literal["float", "exact"]:
        """Whether the walk proved the whole boundary, or rational arithmetic settles it."""
        return "exact" if self.state == kernels.UNDECIDED else "float"

    @property
    def is_tied(self) -> bool:
        """Whether signs tie, as of aligned parts, and the walk was made beside: it is right to rounding."""
        return self.state in (kernels.TIED, kernels.GRAZING)

    @cached_property
    def pose(self) -> Array:
        """R, row by row, and d = s_2 - s_1 (moved), (12,)."""
        return kernels.relative_pose(self.transform, self.one.seed, self.two.seed)

    @cached_property
    def exact(self) -> ExactCurve:
        """The pair's curve in rational arithmetic, with proofs."""
        from fcdm_opt.curve.exact import exact_curve

        pacing.check()
        return exact_curve(self.one, self.two, self.transform)

    @cached_property
    def status(self) -> Literal["bounded", "empty", "full"]:
        """Whether the region has a boundary, is empty, or is the whole quadrant."""
        if self._walked:
            return "bounded" if len(self._walked[3]) else "empty"
        return "empty" if self.state == kernels.GRAZING or self.clear else self.exact.status

    @cached_property
    def clear(self) -> bool:
        """Whether a facet direction keeps the parts apart, or just touching, at all scales to within `planarity`."""
        # such as faces in one plane through both seeds: which parts overlap by rounding, or at scales of 1e12, is no
        # boundary
        if self._walked or self.state == kernels.GRAZING:
            return self.status == "empty"
        sizes = np.array([*self._circumradii, np.linalg.norm(self.pose[9:])])
        return bool((self.facet_rows[:, 3:] * [1.0, 1.0, -1.0] <= DEFAULT.planarity * sizes).all(axis=1).any())

    @cached_property
    def facet_rows(self) -> Array:
        """Normals and contact lines of all facet directions, (k, 6)."""
        return kernels.facet_rows(*self.one.packed, *self.two.packed, self.pose)[1]

    @property
    def _circumradii(self) -> Array:
        """Largest distance of a vertex from the seed of either part, (2,)."""
        return np.array([self.one.circumradius, self.two.circumradius])

    @property
    def surely_empty(self) -> bool:
        """Whether the walk found that the parts never overlap."""
        return self._walked is not None and not len(self._walked[3])

    @property
    def rows(self) -> Array:
        """Normals and contact lines that hold, (k, 6): the boundary's as walked, or of all facet directions."""
        return self.facet_rows if self._walked is None or self.surely_empty else self._walked[1]

    @cached_property
    def lines(self) -> Array:
        """Contact lines (a, b, c) of the boundary, (k, 3): the region is where a rho_1 + b rho_2 > c for all."""
        if self._walked:
            return self._walked[1][:, 3:]
        if self.clear:
            return np.empty((0, 3))
        return np.array([piece.line for piece in self.exact.pieces]).reshape(-1, 3)

    @cached_property
    def unit_lines(self) -> Array:
        """The same lines with (a, b) of unit length."""
        return self.lines / np.hypot(self.lines[:, 0], self.lines[:, 1])[:, None]

    @cached_property
    def chains(self) -> tuple[tuple[Piece, ...], ...]:
        """The boundary, overlap on the left."""
        if self._walked:
            spans = self._walked[3][:, :2].tolist()
            return tuple(tuple(map(self._walked_piece, range(first, first + count))) for first, count in spans)
        return () if self.clear else tuple(map(self._from_exact, self.exact.chains))

    @cached_property
    def table(self) -> Array:
        """Base, travel, lo and hi of all `pieces`, (k, 6)."""
        if self._walked:
            return _table(*self._walked[1:])
        exact = () if self.clear else self.exact.pieces  # what touches on them is asked of few
        return np.array([_numbers(*_row_and_ends(piece)) for piece in exact]).reshape(-1, 6)

    def state_in(self, limits: Array) -> int:
        """Return CONTACT, WALKED (apart) or OVERLAPPING in a box, UNDECIDED where floats cannot tell; see `kernels`."""
        if self._walked is None:
            return kernels.UNDECIDED
        _, rows, points, chains = self._walked
        return kernels.state_in_box(rows, points, chains, limits, DEFAULT.point, DEFAULT.sign)

    @cached_property
    def pieces(self) -> list[Piece]:
        """All pieces, chain by chain."""
        return [piece for chain in self.chains for piece in chain]

    def sides(self, pairs: Array) -> Ints:
        """Return 1 where the scaled parts are apart, 0 where they touch, -1 where they overlap, (n,); always right."""
        # scale pairs, (n, 2), are all positive
        if self.surely_empty:
            return np.ones(len(pairs), np.int64)
        lines = self.lines
        values = lines[:, 2] - pairs @ lines[:, :2].T
        near = DEFAULT.sign * (float(np.linalg.norm(self.pose[9:])) + pairs @ self._circumradii)[:, None]
        found = np.asarray((values > near).any(axis=1), np.int64)
        found[(values < -near).all(axis=1)] = 0 if self.status == "empty" else -1
        for k in np.flatnonzero(found == 0):
            found[k] = self.exact.side(pairs[k].tolist())
        return found

    def piece(self, number: int) -> Piece:
        """Return one of `pieces`, without making the others."""
        return self._walked_piece(number) if self._walked else self.pieces[number]

    def _walked_piece(self, number: int) -> Piece:
        assert self._walked is not None
        sites, rows, points, chains = self._walked
        chain = int(np.searchsorted(chains[:, 0], number, side="right")) - 1
        first, count, forward, endless = chains[chain].tolist()
        k = number if forward > 0 else 2 * first + count - 1 - number  # as walked
        start, end = points[k + chain], points[k + chain + 1]
        come, go = endless & 2 and k == first, endless & 1 and k + 1 == first + count
        ends = (None if come else start, None if go else end)[::forward]
        if self.state == kernels.TIED:
            return self._tied_piece(number, sites[k], rows[k], ends)
        # the corner at the piece's end: after it as walked, or before it
        before = k if forward > 0 else k - 1
        closed = not endless and (points[first + chain] == points[first + chain + count]).all()
        corner = self._corner(sites[before]) if closed or first <= before < first + count - 1 else None
        site, row = tuple(sites[k, :3].tolist()), rows[k]
        contact = Contact(feature_of_site(self.one, self.two, site), *site_corners(self.one, self.two, site))
        return _piece(contact, site, row, self.parts, self.table[number], ends, corner)

    def _tied_piece(self, number: int, site: Ints, row: Array, ends: tuple[Array | None, ...]) -> Piece:
        first, last = ends
        # the middle, or a point as far on as the other end where one is at infinity
        if first is not None and last is not None:
            middle = 0.5 * (first + last)
        else:
            known = first if last is None else last
            assert known is not None
            middle = known + np.abs(known).max() * np.abs(self.table[number, 2:4])
        contact = self._touching(row[:3], middle)
        corner = None if last is None or not last.min() > 0 else self._touching(row[:3], last)
        return _piece(contact, tuple(site[:3].tolist()), row, self.parts, self.table[number], ends, corner)

    def _touching(self, normal: Array, rho: Array) -> Contact:
        return contact_at(self.one, self.two, normal, self.pose, rho, DEFAULT.planarity)

    def _corner(self, site: Ints) -> Contact:
        kind, edge, vertex = site[3:].tolist()
        one, two = self.one, self.two
        if kind == kernels.F1V2:
            feature = Feature(one.elements["E"][edge], two.elements["V"][vertex])
            return Contact(feature, tuple(one.edges[edge, :2].tolist()), (vertex,))
        feature = Feature(one.elements["V"][vertex], two.elements["E"][edge])
        return Contact(feature, (vertex,), tuple(two.edges[edge, :2].tolist()))

    def _from_exact(self, chain: ExactChain) -> tuple[Piece, ...]:
        one, two = self.one, self.two
        rounded = [self._rounded(piece) for piece in chain.pieces]
        pieces = []
        for k, (exact, (contact, flush)) in enumerate(zip(chain.pieces, rounded, strict=True)):
            corner = None
            if k < len(chain.corners):
                own = chain.corners[k]
                corner = contact_between(one, two, self.pose, *own.touching)
                if flush or rounded[(k + 1) % len(rounded)][1]:
                    corner = self._flush(corner, own.rho)
            row, *ends = _row_and_ends(exact)
            piece = _piece(contact, self._site(exact, contact), row, self.parts, _numbers(row, *ends), ends, corner)
            pieces.append(piece)
        return tuple(pieces)

    def _rounded(self, piece: ExactPiece) -> tuple[Contact, bool]:
        """Return what touches along an exact piece, and whether `planarity` makes more of it than exact numbers do."""
        one, two = self.one, self.two
        strict = contact_between(one, two, self.pose, *piece.touching)
        for part, direction, tight in (
            (one, piece.normal @ self.pose[:9].reshape(3, 3), piece.tight[0]),
            (two, -piece.normal, piece.tight[1]),
        ):
            local = part.vertices - part.seed
            heights = local @ direction
            near = heights >= heights.max() - DEFAULT.planarity * np.abs(local).max()
            if near.sum() > len(tight):
                # the middle, or a point as far on as (1, 1) where one end is at infinity
                share = 1.0 if piece.starts_far or piece.ends_far else 0.5
                return self._flush(strict, share * (piece.start + piece.end)), True
        return strict, False

    def _flush(self, strict: Contact, rho: Array) -> Contact:
        """Return the contact at a scale pair on the curve, features within `planarity` taken as one."""
        # of two faces within `planarity` of each other it stays the one that exact numbers name
        rows = self.facet_rows
        slack = DEFAULT.planarity * (np.linalg.norm(self.pose[9:]) + rho @ self._circumradii)
        tight = np.abs(rows[:, 5] - rows[:, 3:5] @ rho) <= slack
        if not tight.any():
            return strict
        normal, first = rows[tight, :3].sum(axis=0), rows[tight, :3][0]
        # between all directions; opposite ones cancel where there is contact on both sides
        normal = normal / length if (length := np.linalg.norm(normal)) > DEFAULT.nominal else first
        found = supporting_contact(self.one, self.two, normal, self.pose, DEFAULT.planarity)
        own = (
            exact if min(len(exact), len(own)) > 2 else own
            for own, exact in ((found.one, strict.one), (found.two, strict.two))
        )
        return contact_between(self.one, self.two, self.pose, *own)

    def _site(self, piece: ExactPiece, contact: Contact) -> tuple[int, int, int]:
        """Return a facet of the Minkowski difference that an exact piece lies on, from what its direction supports."""
        one, two, (tight1, tight2) = self.one, self.two, piece.tight
        # two corners of a face that is drawn not quite planar may support it along no edge of its outline
        edges = [_edge(part, tight) if len(tight) == 2 else -1 for part, tight in ((one, tight1), (two, tight2))]
        if min(edges) >= 0:
            return kernels.E1E2, edges[0], edges[1]
        if len(tight1) > 2 or (len(tight1) == 2 and edges[0] < 0):
            return kernels.F1V2, _face(one, tight1), next((v for v in contact.two if v in tight2), tight2[0])
        return kernels.V1F2, next((v for v in contact.one if v in tight1), tight1[0]), _face(two, tight2)


def pair_region(one: ConvexPart, two: ConvexPart, transform: Array, parts: tuple[int, int] = (0, 0)) -> Region:
    """Return the overlap region of parts of body 1 and 2, `parts` in these, body 1 moved by a 4x4 transform."""
    state, *walked = kernels.walk(*one.packed, *two.packed, transform, one.seed, two.seed, DEFAULT.planarity)
    known = state not in (kernels.UNDECIDED, kernels.GRAZING)
    return Region(one, two, transform, parts, state, tuple(walked) if known else None)


def _piece(
    contact: Contact,
    site: tuple[int, int, int],
    row: Array,
    parts: tuple[int, int],
    numbers: Array,
    ends: Sequence[Array | None],
    corner: Contact | None,
) -> Piece:
    """Make a piece of its row, its numbers as in `Region.table` and its ends; an end of None is at infinity."""
    lo, hi = numbers[4:].tolist()
    first, last = (None if end is None else frozen(end) for end in ends)
    base, travel, normal, line = (frozen(x) for x in (numbers[:2], numbers[2:4], row[:3], row[3:]))
    return Piece(contact, site, parts, normal, line, base, travel, lo, hi, first, last, corner)


def _table(rows: Array, points: Array, chains: Ints) -> Array:
    """Return base, travel, lo and hi of a walk's pieces, chain by chain with the overlap on the left."""
    tables = [np.empty((0, 6))]
    for chain, (first, count, forward, endless) in enumerate(chains.tolist()):
        lines, ends = rows[first : first + count, 3:], points[first + chain : first + chain + count + 1]
        steep = np.sqrt((lines[:, :2] ** 2).sum(axis=1))[:, None]
        base, travel = lines[:, 2:] / steep * lines[:, :2] / steep, lines[:, 1::-1] / steep * [1.0, -1.0]
        span = [((end - base) * travel).sum(axis=1) for end in (ends[:-1], ends[1:])]
        if endless & 1:
            span[1][-1] = math.inf * forward
        if endless & 2:
            span[0][0] = -math.inf * forward
        tables.append(np.column_stack([base, travel, *span[::forward]])[::forward])
    return np.concatenate(tables)


def _row_and_ends(piece: ExactPiece) -> tuple[Array, Array | None, Array | None]:
    ends = None if piece.starts_far else piece.start, None if piece.ends_far else piece.end
    return np.concatenate([piece.normal, piece.line]), *ends


def _numbers(row: Array, start: Array | None, end: Array | None) -> Array:
    """Return base, travel, lo and hi of a piece between two ends, see `Region.table`; None is infinity."""
    points = np.array([np.zeros(2) if x is None else x for x in (start, end)])
    return _table(row[None], points, np.array([[0, 1, 1, (end is None) + 2 * (start is None)]]))[0]


def _face(part: ConvexPart, vertices: Sequence[int]) -> int:
    sides = part.half_edges
    return int(np.bincount(sides[np.isin(sides[:, 0], vertices), 1]).argmax())


def _edge(part: ConvexPart, ends: Sequence[int]) -> int:
    """Return the edge between two vertices, -1 if there is none."""
    found = np.flatnonzero(np.isin(part.edges[:, :2], ends).all(axis=1))
    return int(found[0]) if found.size else -1


def same_pair(p: Array, q: Array) -> bool:
    """Tell whether two finite scale pairs, not both zero, are equal up to rounding."""
    (a, b), (c, d) = p.tolist(), q.tolist()  # plain floats: numpy takes longer for four numbers
    size = abs(a) + abs(b) + abs(c) + abs(d)
    return size < math.inf and abs(a - c) + abs(b - d) < DEFAULT.nominal * size
