"""The exact decision curve of one pair of convex parts: rational arithmetic on the float inputs as they are.

    curve = exact_curve(one, two, transform)      # two ConvexPart, a 4x4 array taken as given
    curve.status, curve.chains, curve.proof       # chains of ExactPiece and ExactCorner, overlap on the left
    curve.side(rho), curve.judge(rho)             # which side of the curve a scale pair lies on, with its proof
    proves(one, two, transform, rho, verdict)     # the check of such a proof, from nothing but the vertices

Only the vertices are used: no hull, no normals, no kernels. With p_i = R (v_i - s_1), q_j = w_j - s_2 and d the offset
of the seeds, the closed parts meet at (rho_1, rho_2) iff non-negative weights give

    sum lambda_i p_i - sum mu_j q_j = tau d,    rho_1 = sum lambda / tau,    rho_2 = sum mu / tau.

So the pairs that meet are a projective image of a polygon: the shadow z = (sum lambda, sum mu, tau) of the polytope of
all weights, normalised by one more row, k.z = 1; tau = 0 is infinity. The polygon is traversed once, from one vertex
both ways, by the shadow vertex method: a basis is four columns, a pivot one step along an edge (or none, in a
degenerate basis; a lexicographic rule then keeps it from cycling). Each edge comes with its dual solution, a direction
n with

    a - n.p_i >= 0,    b + n.q_j >= 0    for all vertices, and c = n.d:

its contact line, proved against every vertex: columns whose floating-point value is larger than its error bound are
fine, the others are worked out exactly. Lengths of part 1, of part 2 and of d are integers in units of their own, three
powers of two, which scales rho but not the polygon's topology.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
from flint import fmpq, fmpq_mat, fmpz

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import ConvexPart

Vector = tuple[fmpz, ...]
ZERO, ONE = fmpz(0), fmpz(1)
# Bound of the rounding error of a column's floating-point value, relative to the sum of the absolute coefficients: the
# column's own entries (6 units of 2^-53), coefficients (2), products and sums (7), rounded up.
ROUNDING = 32 * 2.0**-53
SMALL = 2.0**-500  # numbers from here to its inverse are far from underflow and overflow
FEW = 16  # columns are worked out exactly without a look at their floats
ROOT_BITS = 128  # square roots are taken to this many bits more than an integer

# --------------------------------------------------------------------------------------------------- what is computed


@dataclass(frozen=True, eq=False)
class ExactCorner:
    """A switching point: where two pieces of a chain meet.

    Attributes
    ----------
    point : (3,) tuple of fmpz
        Homogeneous, coprime: rho = (x / w, y / w).
    one, two : tuple of int
        Vertices of the smallest faces of both parts that touch there.
    """

    point: Vector
    one: tuple[int, ...]
    two: tuple[int, ...]

    @property
    def exact_rho(self) -> tuple[fmpq, fmpq]:
        """The scale pair as rationals."""
        return fmpq(self.point[0], self.point[2]), fmpq(self.point[1], self.point[2])

    @cached_property
    def rho(self) -> Array:
        """The scale pair, correctly rounded, (2,)."""
        return _rounded_point(self.point)


@dataclass(frozen=True, eq=False)
class ExactPiece:
    """A straight stretch of the boundary, in the open quadrant.

    Attributes
    ----------
    exact_normal : (3,) tuple of fmpz
        Direction from body 1 to body 2, world frame, coprime integers.
    exact_line : (3,) tuple of fmpq
        (a, b, c) of that direction, not normalised; overlap on the side of (a, b).
    exact_start, exact_end : (3,) tuples of fmpz
        Homogeneous ends (x, y, w), coprime, overlap on the left; w = 0: at infinity in the direction (x, y).
    one, two : tuple of int
        Vertices of the smallest faces that touch along the whole piece.
    tight_one, tight_two : tuple of int
        All vertices that the direction supports.
    """

    exact_normal: Vector
    exact_line: tuple[fmpq, fmpq, fmpq]
    exact_start: Vector
    exact_end: Vector
    one: tuple[int, ...]
    two: tuple[int, ...]
    tight_one: tuple[int, ...]
    tight_two: tuple[int, ...]

    @cached_property
    def _length(self) -> tuple[fmpz, int]:
        """Length of the direction, as an integer and the power of two it was multiplied by."""
        square = sum((x * x for x in self.exact_normal), ZERO)
        return (square << 2 * ROOT_BITS).isqrt(), ROOT_BITS

    @cached_property
    def normal(self) -> Array:
        """Unit direction, (3,)."""
        length, shift = self._length
        return frozen([_quotient(x << shift, length) for x in self.exact_normal])

    @cached_property
    def line(self) -> Array:
        """(a, b, c) of the unit direction, in lengths, (3,)."""
        length, shift = self._length
        return frozen([_quotient(x.p << shift, x.q * length) for x in self.exact_line])

    @cached_property
    def start(self) -> Array:
        """First scale pair, correctly rounded, (2,); the unit direction to it where `starts_far`."""
        return _rounded_point(self.exact_start)

    @cached_property
    def end(self) -> Array:
        """Last scale pair, correctly rounded, (2,); the unit direction to it where `ends_far`."""
        return _rounded_point(self.exact_end)

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
    """Consecutive pieces, overlap on the left.

    Attributes
    ----------
    pieces : tuple of ExactPiece
    corners : tuple of ExactCorner
        After each piece that another one follows; of a closed chain after the last piece too.
    closed : bool
        Whether it is a closed polygon; otherwise it starts and ends on an axis or at infinity.
    """

    pieces: tuple[ExactPiece, ...]
    corners: tuple[ExactCorner, ...]
    closed: bool


@dataclass(frozen=True, eq=False)
class Verdict:
    """Which side of the curve a scale pair lies on, and why; `proves` checks it.

    Attributes
    ----------
    side : int
        1 apart, 0 touching, -1 overlapping.
    direction : (3,) tuple of fmpz, or None
        Unless overlapping: a direction from body 1 to body 2 along which the separation is positive, or 0.
    one, two : dict
        Unless apart: vertices of both parts -> positive weights, adding up to the scale pair, that give one common
        point s_i + sum of weights times (vertex - s_i). Where the parts overlap, the vertices' differences span space,
        which makes it an inner point.
    """

    side: int
    direction: Vector | None
    one: dict[int, fmpq]
    two: dict[int, fmpq]


@dataclass(frozen=True, eq=False)
class ExactCurve:
    """The overlap region of one pair of convex parts in the open quadrant, and the chains that bound it.

    Attributes
    ----------
    status : "bounded", "empty" or "full"
        Whether the region has a boundary, is empty (the parts may touch but never overlap), or is the whole quadrant.
    chains : tuple of ExactChain
    proof : (3,) tuple of fmpz, or None
        Where empty: a direction n with a <= 0, b <= 0 and c >= 0, which no scale pair overcomes.
    """

    status: Literal["bounded", "empty", "full"]
    chains: tuple[ExactChain, ...]
    proof: Vector | None
    _shadow: _Shadow = field(repr=False)

    @property
    def pieces(self) -> list[ExactPiece]:
        """All pieces, chain by chain."""
        return [piece for chain in self.chains for piece in chain.pieces]

    def side(self, rho: Sequence[float | fmpq | fmpz]) -> int:
        """Return 1 where the parts are apart, 0 where they touch, -1 where they overlap.

        Parameters
        ----------
        rho : two numbers
            A scale pair, both positive: floats as they are, or rationals.
        """
        point = _rational_pair(rho)
        if self.status == "empty":
            return int(any(value < 0 for value, _ in self._shadow.values(point)))
        if self.status == "full":
            return -1
        widest = max(piece.separation(point) for piece in self.pieces)
        return (widest > 0) - (widest < 0)

    def judge(self, rho: Sequence[float | fmpq | fmpz]) -> Verdict:
        """Return the side of a scale pair with its proof."""
        point, side = _rational_pair(rho), self.side(rho)
        values = self._shadow.values(point)
        if side < 0:
            return Verdict(side, None, *self._shadow.witness(point))
        _, direction = min(values, key=lambda found: found[0])
        return Verdict(side, direction, {}, {}) if side > 0 else Verdict(side, direction, *self._shadow.witness(point))

    def separation(self, rho: Sequence[float | fmpq | fmpz]) -> float:
        """Return the largest separation along the curve's own lines, in lengths, rounded once.

        Its sign is right: positive apart, 0 touching, negative overlapping. -inf where there is no line.
        """
        point = _rational_pair(rho)
        if self.status == "empty":
            least, direction = min(self._shadow.values(point), key=lambda found: found[0])
            return self._shadow.separation(direction, point) if least < 0 else 0.0
        best = -math.inf
        for piece in self.pieces:
            value, (length, shift) = piece.separation(point), piece._length
            best = max(best, _quotient(value.p << shift, value.q * length))
        return best


def exact_curve(one: ConvexPart, two: ConvexPart, transform: Array | None = None) -> ExactCurve:
    """Return the exact decision curve of two convex parts.

    Parameters
    ----------
    one, two : ConvexPart
        Of body 1 and body 2; only their vertices and seeds are used.
    transform : (4, 4) array, optional
        Pose change of body 1, taken as given: rational, not exactly orthogonal. Identity unless given.

    Returns
    -------
    ExactCurve

    Notes
    -----
    Bodies that never overlap have a direction n with a <= 0, b <= 0, c >= 0, one direction for all scale pairs: the
    cone of all p_i, -q_j, -d is then not all of space (Gordan). So emptiness needs no pair of lines.
    """
    shadow = _Shadow(_Columns(one, two, np.eye(4) if transform is None else transform))
    if shadow.excluding is not None:
        return ExactCurve("empty", (), shadow.excluding, shadow)
    edges = shadow.edges
    inner = [all(x or y for x, y in zip(edge.start.point, edge.end.point, strict=True)) for edge in edges]
    if not any(inner):
        return ExactCurve("full", (), None, shadow)
    breaks = [k + 1 for k, edge in enumerate(edges) if not all(edge.end.point)]  # on an axis or at infinity
    if not breaks:
        return ExactCurve("bounded", (_chain(shadow, edges, closed=True),), None, shadow)
    # start behind an interruption, so that no chain is torn at the seam of the outline
    chains = [
        [k % len(edges) for k in range(start, stop) if inner[k % len(edges)]]
        for start, stop in zip(breaks, [*breaks[1:], breaks[0] + len(edges)], strict=True)
    ]
    made = [_chain(shadow, [edges[k] for k in chain], closed=False) for chain in chains if chain]
    return ExactCurve("bounded", tuple(made), None, shadow)


def _chain(shadow: _Shadow, edges: Sequence[_Edge], closed: bool) -> ExactChain:
    corners = edges if closed else edges[:-1]
    return ExactChain(
        tuple(shadow.piece(edge) for edge in edges), tuple(shadow.corner(edge.end) for edge in corners), closed
    )


def proves(
    one: ConvexPart, two: ConvexPart, transform: Array | None, rho: Sequence[float | fmpq | fmpz], verdict: Verdict
) -> bool:
    """Check a verdict from scratch: rational arithmetic on the vertices, none of what computed it.

    Parameters
    ----------
    one, two : ConvexPart
    transform : (4, 4) array, or None
    rho : two numbers
    verdict : Verdict
    """
    P, Q, offset = _relative(one, two, np.eye(4) if transform is None else transform)
    r1, r2 = _rational_pair(rho)
    n = verdict.direction
    if verdict.side >= 0:
        if n is None or not any(n):
            return False
        height = r1 * max(_dot(n, p) for p in P) + r2 * max(-_dot(n, q) for q in Q)
        reach = _dot(n, offset) - height
        if not (reach > 0 if verdict.side > 0 else reach == 0):
            return False
    if verdict.side > 0:
        return True
    weights = [*verdict.one.values(), *verdict.two.values()]
    if not all(weight > 0 for weight in weights):
        return False
    if sum(verdict.one.values(), fmpq(0)) != r1 or sum(verdict.two.values(), fmpq(0)) != r2:
        return False
    for axis in range(3):
        left = sum((weight * P[i][axis] for i, weight in verdict.one.items()), fmpq(0))
        right = sum((weight * Q[j][axis] for j, weight in verdict.two.items()), offset[axis])
        if left != right:
            return False
    if verdict.side == 0:
        return True
    spans = [[rows[k] for k in own] for rows, own in ((P, verdict.one), (Q, verdict.two))]
    return _rank([_minus(row, rows[0]) for rows in spans for row in rows[1:]]) == 3


# ------------------------------------------------------------------------------------------------------ exact columns


class _Columns:
    """The columns (p_i, k_1), (-q_j, k_2), (-d, k_3) as integers when asked for, and all of them as floats.

    Attributes
    ----------
    units : three int
        Exponents of the powers of two that lengths of part 1, part 2 and d are counted in.
    reach : three int
        k is two to these powers: at least as large as any entry of such a column.
    floats : (6, N) array
        Columns divided by their k, and three rows that say of which kind they are.
    """

    def __init__(self, one: ConvexPart, two: ConvexPart, transform: Array) -> None:
        R, shift = transform[:3, :3], transform[:3, 3]
        self._parts = (one, two)
        self.counts = (len(one.vertices), len(two.vertices))
        self.total = sum(self.counts) + 1
        turn, drawn, own = _unit(R), _unit(one.vertices, one.seed), _unit(two.vertices, two.seed)
        self._drawn = drawn
        self._turn = [[_whole(x, turn) for x in row] for row in R.tolist()]
        self._seeds = [[_whole(x, unit) for x in part.seed.tolist()] for part, unit in ((one, drawn), (two, own))]
        whole = min(turn + drawn, own, _unit(shift))
        moved = [_dot(row, self._seeds[0]) << (turn + drawn - whole) for row in self._turn]
        offset = [
            (s << (own - whole)) - m - _whole(t, whole)
            for s, m, t in zip(self._seeds[1], moved, shift.tolist(), strict=True)
        ]
        self.units = (turn + drawn, own, whole)
        X, Y = (one.vertices - one.seed), (two.vertices - two.seed)
        spans = [float((np.abs(X) @ np.abs(R).T).max()), float(np.abs(Y).max())]
        tops = [math.frexp(span)[1] for span in spans]
        width = max(x.height_bits() for x in offset)
        self.reach = (tops[0] - self.units[0], tops[1] - self.units[1], width)
        self.k = tuple(ONE << bits for bits in self.reach)
        self.floats = np.zeros((6, self.total))
        n = self.counts[0]
        self.floats[:3, :n] = np.ldexp(R @ X.T, -tops[0])
        self.floats[:3, n:-1] = np.ldexp(-Y.T, -tops[1])
        self.floats[:3, -1] = [-_quotient(x, self.k[2]) for x in offset]
        self.floats[3, :n] = self.floats[4, n:-1] = self.floats[5, -1] = 1.0
        self._known: dict[int, Vector] = {self.total - 1: (*(-x for x in offset), self.k[2])}

    def kind(self, j: int) -> int:
        """Return what a column stands for: 0 a vertex of part 1, 1 a vertex of part 2, 2 the offset."""
        return 0 if j < self.counts[0] else 1 if j < self.total - 1 else 2

    def exact(self, j: int) -> Vector:
        """Return a column as four integers."""
        known = self._known.get(j)
        if known is None:
            kind = self.kind(j)
            part = self._parts[kind]
            row, unit = (j, self._drawn) if kind == 0 else (j - self.counts[0], self.units[1])
            x, y, z = (
                _whole(a, unit) - s for a, s in zip(part.vertices[row].tolist(), self._seeds[kind], strict=True)
            )
            if kind == 0:
                known = (*(u * x + v * y + w * z for u, v, w in self._turn), self.k[0])
            else:
                known = (-x, -y, -z, self.k[1])
            self._known[j] = known
        return known

    def normalised(self, values: Sequence[fmpz], shifts: Sequence[int]) -> Array:
        """Return values times powers of two as floats, the largest made 1."""
        try:
            rounded = [math.ldexp(x, s) for x, s in zip(map(float, values), shifts, strict=True)]
            largest = max(max(rounded), -min(rounded))
        except OverflowError:
            largest = math.inf
        if not SMALL < largest < 1 / SMALL:
            if not any(values):
                return np.zeros(len(values))
            top = max(x.height_bits() + s for x, s in zip(values, shifts, strict=True) if x)
            wide = [max(0, x.height_bits() - 64) for x in values]
            rounded = [math.ldexp(float(x >> w), w + s - top) for x, w, s in zip(values, wide, shifts, strict=True)]
            largest = max(max(rounded), -min(rounded))
        return np.array(rounded) / largest

    def entering(self, n: Vector, levels: Vector, known: Sequence[int]) -> int | None:
        """Return a column with level - n.c < 0, one of the lowest; None if there is none, proved for every column.

        Parameters
        ----------
        n : (3,) tuple of fmpz
        levels : (3,) tuple of fmpz
            Of each kind.
        known : sequence of int
            Columns where it is 0 by construction.
        """
        p, q, r = self.reach
        coefficients = self.normalised((-n[0], -n[1], -n[2], *levels), (0, 0, 0, -p, -q, -r))
        values = coefficients @ self.floats
        error = ROUNDING * float(np.abs(coefficients).sum())
        least = int(values.argmin())
        if values[least] < -error:
            return least
        if not any(n):
            return None if min(levels) >= 0 else least
        doubtful = (values <= error).nonzero()[0].tolist()
        return next(
            (j for j in doubtful if j not in known and levels[self.kind(j)] < _dot(n, self.exact(j))), None
        )


# ------------------------------------------------------------------------------------------------------- the polygon


@dataclass(frozen=True, eq=False, slots=True)
class _Basis:
    """Four independent columns with their kinds, and the adjugate and determinant (> 0) of their matrix."""

    columns: tuple[int, ...]
    kinds: tuple[int, ...]
    rows: tuple[Vector, ...]
    det: fmpz

    def replaced(self, place: int, column: int, kind: int, y: Vector) -> _Basis:
        """Return the basis with a column in another's place; y: adjugate times that column."""
        pivot, (a, b, c, d), det = y[place], self.rows[place], self.det
        rows: list[Vector] = [
            ((pivot * p - f * a) // det, (pivot * q - f * b) // det, (pivot * r - f * c) // det,
             (pivot * s - f * d) // det)
            for (p, q, r, s), f in zip(self.rows, y, strict=True)
        ]  # fmt: skip
        rows[place] = self.rows[place]
        columns, kinds = list(self.columns), list(self.kinds)
        columns[place], kinds[place] = column, kind
        return _Basis(tuple(columns), tuple(kinds), tuple(rows), pivot)

    def products(self, column: Vector) -> Vector:
        """Return the adjugate times a column."""
        a, b, c, d = column
        return tuple([p * a + q * b + r * c + s * d for p, q, r, s in self.rows])

    @property
    def carrying(self) -> list[int]:
        """Columns with a positive weight."""
        return [j for j, row in zip(self.columns, self.rows, strict=True) if row[3]]

    @property
    def point(self) -> list[fmpz]:
        """z, times the determinant."""
        z = [ZERO, ZERO, ZERO]
        for kind, row in zip(self.kinds, self.rows, strict=True):
            z[kind] += row[3]
        return z

    def sums(self, kind: int) -> Vector:
        """Sum of the adjugate's rows over the columns of one kind."""
        rows = [row for row, own in zip(self.rows, self.kinds, strict=True) if own == kind]
        if len(rows) == 1:
            return rows[0]
        return tuple([sum(entries, ZERO) for entries in zip(*rows, strict=True)]) if rows else (ZERO,) * 4


@dataclass(frozen=True, eq=False)
class _Vertex:
    """A vertex of the polygon, coprime, in own units; a basis there, and columns that include all it may use."""

    point: Vector
    basis: _Basis
    tight: Sequence[int]


@dataclass(frozen=True, eq=False)
class _Edge:
    """An edge of the polygon, counter-clockwise: its ends, its dual (n, levels), tight columns, and bases met."""

    start: _Vertex
    end: _Vertex
    n: Vector
    levels: Vector
    tight: Sequence[int]
    bases: list[_Basis]


class _Shadow:
    """The polygon of all z = (sum lambda, sum mu, tau) that weights can give.

    Attributes
    ----------
    excluding : (3,) tuple of fmpz, or None
        A direction with a <= 0, b <= 0 and c >= 0, if there is one.
    edges : list of _Edge
        Counter-clockwise; there and back for a polygon that is a segment, none for a point.
    """

    def __init__(self, columns: _Columns) -> None:
        self.columns = columns
        self.excluding: Vector | None = None
        self._crossing: tuple[_Basis, int, Vector, int | None] | None = None
        self._base: _Basis | None = None
        self.pivots = 0
        self._enter()

    @cached_property
    def edges(self) -> list[_Edge]:
        """The polygon's edges of positive length, counter-clockwise."""
        return self._traverse()

    # ---- getting in

    def _enter(self) -> None:
        """Find a basis with non-negative weights, and whether there is an excluding direction.

        The column A = -(c_1 + c_2 + c_3) of three independent columns makes a first basis. Its weight is brought down:
        at 0 the other weights are a solution, and below 0 there is no excluding direction n, as n.c <= 0 for all
        columns leaves n.A > 0. So A stays in the basis with a weight of either sign, until that is settled.
        """
        columns = self.columns
        chosen = self._chosen = self._independent()
        c1, c2, c3 = (columns.exact(j)[:3] for j in chosen)
        k1, k2, k3 = (columns.exact(j)[3] for j in chosen)
        m1, m2, m3 = _cross(c2, c3), _cross(c3, c1), _cross(c1, c2)
        volume = _dot(c1, m1)
        k = k1 + k2 + k3  # of A too
        last = (*(-(k1 * x + k2 * y + k3 * z) for x, y, z in zip(m1, m2, m3, strict=True)), volume)
        rows = [tuple([2 * k * u + v for u, v in zip((*m, ZERO), last, strict=True)]) for m in (m1, m2, m3)]
        basis = _Basis((*chosen, -1), (0, 0, 0, -1), (*rows, last), 2 * k * volume)
        artificial = (*(-(x + y + z) for x, y, z in zip(c1, c2, c3, strict=True)), k)
        origin = [*(columns.exact(j) for j in chosen), artificial]
        while True:
            row = basis.rows[3]
            n = row[:3]
            entering = columns.entering(n, tuple([-row[3] * x for x in columns.k]), basis.columns)
            if entering is None:
                self.excluding = n
                return
            y = basis.products(columns.exact(entering))
            place = self._leaving(basis, y, origin, 3)
            excess = ZERO if place is None else basis.rows[3][3] * y[place] - basis.rows[place][3] * y[3]
            if excess <= 0:  # A reaches 0 no later than any other weight
                self._base = basis.replaced(3, entering, columns.kind(entering), y)
            if place is None or excess < 0:
                self._crossing = basis, entering, y, place
                return
            basis = basis.replaced(place, entering, columns.kind(entering), y)
            self.pivots += 1

    def _independent(self) -> tuple[int, int, int]:
        """Return three linearly independent vertices of part 1, positively oriented."""
        columns, n = self.columns, self.columns.counts[0]
        X = columns.floats[:3, :n].T
        i = int((X**2).sum(axis=1).argmax())
        normals = np.cross(X, X[i])
        j = int((normals**2).sum(axis=1).argmax())
        k = int(np.abs(X @ normals[j]).argmax())
        volume = _dot(columns.exact(i)[:3], _cross(columns.exact(j)[:3], columns.exact(k)[:3]))
        if not volume:
            i = next(i for i in range(n) if any(columns.exact(i)[:3]))
            c = columns.exact(i)[:3]
            j = next(j for j in range(n) if any(_cross(c, columns.exact(j)[:3])))
            m = _cross(c, columns.exact(j)[:3])
            k = next(k for k in range(n) if _dot(m, columns.exact(k)[:3]))
            volume = _dot(m, columns.exact(k)[:3])
        return (i, j, k) if volume > 0 else (i, k, j)

    @cached_property
    def _inner(self) -> dict[int, fmpz]:
        """Positive weights of columns that span space, if there are: a step on which the weight of A falls below 0."""
        if self._crossing is None:
            return {}
        basis, entering, y, place = self._crossing
        least = fmpq(basis.rows[3][3], y[3])
        step = least + 1 if place is None else (least + fmpq(basis.rows[place][3], y[place])) / 2
        found = {entering: step * basis.det}
        for j, row, u in zip(basis.columns, basis.rows, y, strict=True):
            weight = row[3] - step * u
            for column, own in ((i, -weight) for i in self._chosen) if j < 0 else ((j, weight),):
                found[column] = found.get(column, fmpq(0)) + own
        common = ONE
        for weight in found.values():
            common = common.lcm(weight.q)
        return {j: (weight * common).p for j, weight in found.items() if weight > 0}

    def _leaving(self, basis: _Basis, y: Vector, origin: Sequence[Vector], count: int) -> int | None:
        """Return the place of the weight that reaches 0 first; ties by the lexicographic rule, None if there is none.

        Parameters
        ----------
        basis : _Basis
        y : (4,) tuple of fmpz
            Adjugate times the entering column.
        origin : list of four columns
            Of the first basis: the right-hand side is perturbed by powers of an infinitely small number times these.
        count : int
            Places that may leave.
        """
        best = None
        for i in range(count):
            if not y[i] > 0:
                continue
            if best is None:
                best = i
                continue
            p, q = basis.rows[i], basis.rows[best]
            order = p[3] * y[best] - q[3] * y[i]
            if not order:
                for column in origin:
                    order = _dot4(p, column) * y[best] - _dot4(q, column) * y[i]
                    if order:
                        break
            if order < 0:
                best = i
        return best

    # ---- going round

    def _dual(self, basis: _Basis, weights: Sequence[fmpz]) -> tuple[Vector, Vector]:
        """Return (n, levels) times the determinant: what a column costs the objective weights . z is level - n.c."""
        h = [ZERO] * 4
        for kind, weight in enumerate(weights):
            if weight and kind in basis.kinds:
                h = [u + weight * v for u, v in zip(h, basis.sums(kind), strict=True)]
        levels = [h[3] * k - weight * basis.det for k, weight in zip(self.columns.k, weights, strict=True)]
        return (-h[0], -h[1], -h[2]), tuple(levels)

    def _best(self, weights: Sequence[fmpz]) -> _Basis:
        """Return a basis that maximises weights . z."""
        assert self._base is not None
        basis = self._base
        origin = [self.columns.exact(j) for j in basis.columns]
        while (entering := self.columns.entering(*self._dual(basis, weights), basis.columns)) is not None:
            basis = self._pivoted(basis, entering, origin)
        return basis

    def _pivoted(self, basis: _Basis, entering: int, origin: Sequence[Vector]) -> _Basis:
        y = basis.products(self.columns.exact(entering))
        place = self._leaving(basis, y, origin, 4)
        assert place is not None  # k.z = 1 bounds all weights
        self.pivots += 1
        return basis.replaced(place, entering, self.columns.kind(entering), y)

    def _traverse(self) -> list[_Edge]:
        """Go round the polygon, counter-clockwise and, from the same vertex, clockwise.

        Both ways end where only one part has a weight: its seed lies inside it. Between two such vertices the polygon's
        edge is the side tau = 0 of the triangle z >= 0, and need not be walked. Without one the first way goes round.
        """
        if self._base is None:
            return []
        start = self._best((ZERO, ZERO, ONE))
        origin = [self.columns.exact(j) for j in start.columns]
        found = _Walk(self, start, origin, (0, 1), None).edges
        if not found or found[0].start.point == found[-1].end.point:
            return found
        back = _Walk(self, found[0].start.basis, origin, (1, 0), found[0].start).edges
        here, there = found[-1].end, back[-1].end
        if here.point != there.point:
            levels = (ZERO, ZERO, ONE)
            found.append(_Edge(here, there, (ZERO, ZERO, ZERO), levels, (), [here.basis]))
        return found + [
            _Edge(edge.end, edge.start, edge.n, edge.levels, edge.tight, edge.bases[::-1]) for edge in back[::-1]
        ]

    # ---- what touches

    def piece(self, edge: _Edge) -> ExactPiece:
        """Return an edge as a piece of the curve."""
        e1, e2, e3 = self.columns.units
        content = edge.n[0].gcd(edge.n[1]).gcd(edge.n[2])
        normal = tuple([x // content for x in edge.n])
        a, b, c = (x // content for x in edge.levels)
        touching = self._split(self._touching(edge.bases, edge.tight))
        return ExactPiece(
            normal,
            (_scaled(a, e1), _scaled(b, e2), _scaled(-c, e3)),
            self._homogeneous(edge.start.point),
            self._homogeneous(edge.end.point),
            *touching,
            *self._split(edge.tight),
        )

    def corner(self, vertex: _Vertex) -> ExactCorner:
        """Return a vertex as a switching point."""
        h = [vertex.basis.sums(kind) for kind in range(3)]
        columns = self.columns
        fixed = [  # columns that leave z as it is
            j
            for j in vertex.tight
            if j in vertex.basis.columns
            or all(
                _dot4(row, columns.exact(j)) == (vertex.basis.det if columns.kind(j) == kind else 0)
                for kind, row in enumerate(h)
            )
        ]
        return ExactCorner(self._homogeneous(vertex.point), *self._split(self._touching([vertex.basis], fixed)))

    def _homogeneous(self, z: Vector) -> Vector:
        """Return a point in own units as scale pair."""
        top = max(self.columns.units)
        return _coprime([x << (top - unit) for x, unit in zip(z, self.columns.units, strict=True)])

    def _split(self, columns: Iterable[int]) -> tuple[tuple[int, ...], tuple[int, ...]]:
        n, end = self.columns.counts[0], self.columns.total - 1
        found = sorted(columns)
        return tuple([j for j in found if j < n]), tuple([j - n for j in found if n <= j < end])

    def _touching(self, bases: Sequence[_Basis], tight: Sequence[int]) -> set[int]:
        """Return the columns that carry weight in some solution that uses tight columns only."""
        carrying = {j for basis in bases for j in basis.carrying}
        while True:
            carrying = self._filled(carrying, tight)
            rest = [j for j in tight if j not in carrying and j != self.columns.total - 1]
            more = self._loaded(bases[-1], rest, tight) if rest else set()
            if not more:
                return carrying
            carrying |= more

    def _filled(self, carrying: set[int], tight: Sequence[int]) -> set[int]:
        """Add the rest of a face of which the columns span all: a point inside a face is a mean of all its vertices."""
        filled = set(carrying)
        for kind in (0, 1):
            face = [j for j in tight if self.columns.kind(j) == kind]
            own = [j for j in face if j in carrying]
            if own and len(own) < len(face):
                spans = [
                    _rank([_minus(self.columns.exact(j)[:3], self.columns.exact(some[0])[:3]) for j in some[1:]])
                    for some in (own, face)
                ]
                if spans[0] == spans[1]:
                    filled |= set(face)
        return filled

    def _loaded(self, basis: _Basis, rest: list[int], tight: Sequence[int]) -> set[int]:
        """Return the columns of a solution that puts weight on `rest`, none if there is no such solution."""
        columns = self.columns
        origin = [columns.exact(j) for j in basis.columns]
        wanted = set(rest)
        while True:
            h = [ZERO] * 4
            for j, row in zip(basis.columns, basis.rows, strict=True):
                if j in wanted:
                    h = [u + v for u, v in zip(h, row, strict=True)]
            gains = [
                ((basis.det if j in wanted else ZERO) - _dot4(h, columns.exact(j)), j)
                for j in tight
                if j not in basis.columns
            ]
            gain, entering = max(gains, default=(ZERO, -1))
            if not gain > 0:
                return set()
            basis = self._pivoted(basis, entering, origin)
            carrying = set(basis.carrying)
            if carrying & wanted:
                return carrying

    # ---- questions about one scale pair

    def _own(self, rho: tuple[fmpq, fmpq]) -> Vector:
        """Return a scale pair as a point in own units."""
        top = max(self.columns.units)
        low = [unit - top for unit in self.columns.units]
        common = rho[0].q.lcm(rho[1].q)
        z = ((rho[0] * common).p, (rho[1] * common).p, common)
        least = min(low)
        return _coprime([x << (shift - least) for x, shift in zip(z, low, strict=True)])

    def values(self, rho: tuple[fmpq, fmpq]) -> list[tuple[fmpz, Vector]]:
        """Return (level . z, n) of half-planes whose intersection is the polygon, as far as this scale pair shows."""
        z = self._own(rho)
        found = [(_dot(edge.levels, z), edge.n) for edge in self.edges if any(edge.n)]
        if self.excluding is not None:
            found.append((_dot(self._levels(self.excluding), z), self.excluding))
        if self._base is not None and (not self.edges or len(self.edges) == 2):
            # a point or a segment: the direction from it to the scale pair, in the plane k.z = 1
            found += [self._towards(z, point) for point in self._ends]
        return found

    @cached_property
    def _ends(self) -> list[Vector]:
        """Return the vertices of the polygon."""
        if self.edges:
            return [edge.start.point for edge in self.edges]
        return [] if self._base is None else [_coprime(self._base.point)]

    def _towards(self, z: Vector, point: Vector) -> tuple[fmpz, Vector]:
        k = self.columns.k
        own, other = _dot(k, z), _dot(k, point)
        weights = tuple([u * other * x - v * own * x for u, v, x in zip(z, point, k, strict=True)])
        n = self._dual(self._best(weights), weights)[0]
        return _dot(self._levels(n), z), n

    def _levels(self, n: Vector) -> Vector:
        """Return the line of a direction in own units, (a, b, -c): exact, by looking at all columns."""
        columns = self.columns
        coefficients = columns.normalised((*n, ZERO, ZERO, ZERO), (0,) * 6)
        heights = coefficients @ columns.floats
        error = 2 * ROUNDING * float(np.abs(coefficients).sum())
        first, last = columns.counts[0], columns.total - 1
        levels = []
        for low, high in ((0, first), (first, last), (last, last + 1)):
            top = heights[low:high].max() - error
            near = (heights[low:high] >= top).nonzero()[0] + low
            levels.append(max(_dot(n, columns.exact(j)) for j in near.tolist()))
        return tuple(levels)

    def separation(self, n: Vector, rho: tuple[fmpq, fmpq]) -> float:
        """Return the separation along a direction, in lengths."""
        a, b, c = (_scaled(x, unit) for x, unit in zip(self._levels(n), self.columns.units, strict=True))
        value = -c - a * rho[0] - b * rho[1]
        length = (sum((x * x for x in n), ZERO) << 2 * ROOT_BITS).isqrt()
        return _quotient(value.p << ROOT_BITS, value.q * length)

    def witness(self, rho: tuple[fmpq, fmpq]) -> tuple[dict[int, fmpq], dict[int, fmpq]]:
        """Return weights of both parts' vertices that give a common point at a scale pair of the polygon.

        Solutions at vertices of the polygon are mixed; where it has an inside, with solutions that together span
        space, as far as the scale pair is inside.
        """
        z = self._own(rho)
        corners = [(edge.start.point, edge.start.basis) for edge in self.edges]
        mixed: dict[int, fmpq] = {}
        rest = tuple([fmpq(x) for x in z])
        if len(corners) > 2:
            spanning = corners[:: max(1, len(corners) // 3)][:3]
            centre: dict[int, fmpz] = dict(self._inner)
            for _, basis in spanning:
                for j, row in zip(basis.columns, basis.rows, strict=True):
                    centre[j] = centre.get(j, ZERO) + row[3]
            middle = [ZERO, ZERO, ZERO]
            for j, load in centre.items():
                middle[self.columns.kind(j)] += load
            share = min(fmpq(_dot(edge.levels, z), _dot(edge.levels, middle)) for edge in self.edges)
            rest = tuple([x - share * y for x, y in zip(rest, middle, strict=True)])
            mixed = {j: share * load for j, load in centre.items() if share > 0 and load > 0}
        if not self.edges and self._base is not None:
            corners = [(_coprime(self._base.point), self._base)]
        for basis, weight in self._mixture(corners, rest):
            for j, row in zip(basis.columns, basis.rows, strict=True):
                if row[3]:
                    mixed[j] = mixed.get(j, fmpq(0)) + weight * row[3]
        tau = mixed.pop(self.columns.total - 1)
        e1, e2, e3 = self.columns.units
        n = self.columns.counts[0]
        one = {j: weight / tau * _scaled(ONE, e3 - e1) for j, weight in mixed.items() if j < n}
        two = {j - n: weight / tau * _scaled(ONE, e3 - e2) for j, weight in mixed.items() if j >= n}
        return one, two

    def _mixture(
        self, corners: list[tuple[Vector, _Basis]], z: tuple[fmpq, ...]
    ) -> list[tuple[_Basis, fmpq]]:
        """Return non-negative multiples of bases' solutions that add up to a point of the polygon's boundary."""
        if not any(z):
            return []
        pairs = [(corner, corners[(k + 1) % len(corners)]) for k, corner in enumerate(corners)]
        for (u, first), (v, second) in pairs:
            found = _combination(u, v, z)
            if found is not None:
                return [
                    (basis, weight * fmpq(sum(point, ZERO)) / fmpq(sum(basis.point, ZERO)))
                    for basis, point, weight in ((first, u, found[0]), (second, v, found[1]))
                    if weight
                ]
        raise AssertionError("the scale pair is not on the polygon's boundary")


class _Walk:
    """A walk along the polygon's boundary, counter-clockwise for axes (0, 1), clockwise for (1, 0).

    In the plane of (z_1, z_2), or (z_2, z_1), the basis is always optimal for the outward normal of the direction of
    travel t: no column moves z to the right of t. The next direction is that of the column least far to the left.

    Attributes
    ----------
    edges : list of _Edge
        In the order walked, `start` and `end` too: all round, or until only one part has a weight.
    """

    def __init__(
        self, shadow: _Shadow, basis: _Basis, origin: Sequence[Vector], axes: tuple[int, int], start: _Vertex | None
    ) -> None:
        self.shadow, self.columns, self.axes = shadow, shadow.columns, axes
        self.edges: list[_Edge] = []
        x, y = axes
        t = (self.columns.k[y], -self.columns.k[x])
        first: tuple[fmpz, fmpz] | None = None
        tight: Sequence[int] = ()
        bases: list[_Basis] = []
        turned = False
        while True:
            entering = self._onward(basis, t, tight) if bases else None
            if entering is None:
                turn = self._turn(basis, t)
                if turn is None:  # the polygon is a point
                    return
                entering, g, ahead = turn
                if bases:
                    self._close(_Vertex(_coprime(basis.point), basis, ahead), t, tight, bases)
                if bases or start or _cross2(t, g) or _dot2(t, g) < 0:
                    if first is None:
                        first = g
                        self._start = start or _Vertex(_coprime(basis.point), basis, ahead)
                    side, along = _cross2(first, g), _dot2(first, g)
                    turned = turned or side < 0 or (not side and along < 0)
                    if turned and (side > 0 or (not side and along > 0)):
                        return
                    t, tight, bases = g, ahead, [basis]
            basis = shadow._pivoted(basis, entering, origin)
            if bases:
                bases.append(basis)
                if len({kind for kind, row in zip(basis.kinds, basis.rows, strict=True) if row[3]}) == 1:
                    corner = _Vertex(_coprime(basis.point), basis, ())
                    if corner.point[2] == 0 and corner.point != self._start.point:
                        self._close(corner, t, tight, bases)
                        return

    def _close(self, end: _Vertex, t: tuple[fmpz, fmpz], tight: Sequence[int], bases: list[_Basis]) -> None:
        """Finish an edge; none if it has no length."""
        if end.point != self._start.point:
            self.edges.append(_Edge(self._start, end, *self._normal(bases[0], t), tight, bases))
            self._start = end

    def _normal(self, basis: _Basis, g: tuple[fmpz, fmpz]) -> tuple[Vector, Vector]:
        """Return the dual (n, levels) of a direction; it is a multiple of the determinant."""
        weights = [ZERO, ZERO, ZERO]
        weights[self.axes[0]], weights[self.axes[1]] = g[1], -g[0]
        n, levels = self.shadow._dual(basis, weights)
        det = basis.det
        return tuple([x // det for x in n]), tuple([x // det for x in levels])

    def _shift(self, basis: _Basis, sums: tuple[Vector, Vector], j: int) -> tuple[fmpz, fmpz]:
        """Return how z changes along both axes as column j enters, times the determinant."""
        kind, column = self.columns.kind(j), self.columns.exact(j)
        x, y = -_dot4(sums[0], column), -_dot4(sums[1], column)
        return (x + basis.det if kind == self.axes[0] else x), (y + basis.det if kind == self.axes[1] else y)

    def _steps(
        self, basis: _Basis, sums: tuple[Vector, Vector], t: tuple[fmpz, fmpz]
    ) -> tuple[Array, float, float, float]:
        """Return coefficients of all columns' shifts along t and to the left of it, their error bound, and t."""
        reach, det = self.columns.reach, basis.det
        (first, second), (a, b, c, d), (e, f, g, h) = self.axes, *sums
        p, q = reach[first], reach[second]
        k = self.columns.k
        values = [-a, -b, -c, *(-d * x for x in k), -e, -f, -g, *(-h * x for x in k)]
        values[3 + first] += det
        values[9 + second] += det
        shifts = [p, p, p, *(p - r for r in reach), q, q, q, *(q - r for r in reach)]
        rows = self.columns.normalised(values, shifts).reshape(2, 6)
        tx, ty = self.columns.normalised(t, (p, q)).tolist()
        turned = np.array([[tx, ty], [-ty, tx]]) @ rows
        return turned, ROUNDING * float(np.abs(rows).sum()), tx, ty

    def _onward(self, basis: _Basis, t: tuple[fmpz, fmpz], tight: Sequence[int]) -> int | None:
        """Return a column that moves z further along the edge, None if there is none."""
        sums = basis.sums(self.axes[0]), basis.sums(self.axes[1])
        rest = tight
        if len(tight) > FEW:
            coefficients, error, _, _ = self._steps(basis, sums, t)
            own = np.array(tight)
            along = (coefficients[0] @ self.columns.floats)[own]
            furthest = int(along.argmax())
            if along[furthest] > error:
                return int(own[furthest])
            rest = own[along >= -error].tolist()
        best, found = ZERO, None
        for j in rest:
            if j not in basis.columns:
                along = _dot2(t, self._shift(basis, sums, j))
                if along > best:
                    best, found = along, j
        return found

    def _turn(self, basis: _Basis, t: tuple[fmpz, fmpz]) -> tuple[int, tuple[fmpz, fmpz], Sequence[int]] | None:
        """Return the entering column of the next direction, that direction, and all columns that do not leave it.

        None where no column moves z at all.
        """
        columns = self.columns
        sums = basis.sums(self.axes[0]), basis.sums(self.axes[1])
        coefficients, error, tx, ty = self._steps(basis, sums, t)
        along, across = coefficients @ columns.floats
        slope = along / np.maximum(across, error)
        slope[list(basis.columns)] = -np.inf
        entering = int(slope.argmax())
        if abs(along[entering]) + abs(across[entering]) <= 2 * error:  # hardly moves: others first
            slope[np.abs(along) + np.abs(across) <= 2 * error] = -np.inf
            entering = int(slope.argmax())
            if slope[entering] == -np.inf:
                moving = (j for j in range(columns.total) if any(self._shift(basis, sums, j)))
                entering = next(moving, -1)
                if entering < 0:
                    return None
        while True:
            g = self._shift(basis, sums, entering)
            gx, gy = columns.normalised(g, [columns.reach[axis] for axis in self.axes]).tolist()
            left = (tx * gx + ty * gy) * across - (tx * gy - ty * gx) * along
            least = int(left.argmin())
            if left[least] < -6 * error:
                entering = least
                continue
            tight = [*basis.columns, entering]
            doubtful = [j for j in (left <= 6 * error).nonzero()[0].tolist() if j not in tight]
            if not doubtful:
                break
            n, levels = self._normal(basis, g)
            if not any(n):  # a side of the triangle: its line says of all columns of a kind the same
                tight = [j for j in range(columns.total) if not levels[columns.kind(j)]]
                break
            sharper = entering
            for j in doubtful:  # one pass finds the least turn of all: what a sharper one leaves behind stays behind
                value = levels[columns.kind(j)] - _dot(n, columns.exact(j))
                if value < 0:
                    sharper = j
                    n, levels = self._normal(basis, self._shift(basis, sums, j))
                elif not value:
                    tight.append(j)
            if sharper == entering:
                break
            entering = sharper
        if not _cross2(t, g) and _dot2(t, g) < 0:  # straight back: only if nothing goes straight on
            for j in tight:
                own = self._shift(basis, sums, j)
                if _dot2(t, own) > 0:
                    return j, own, tight
        return entering, g, tight


# --------------------------------------------------------------------------------------------------------- arithmetic


def _dot(u: Sequence[Any], v: Sequence[Any]) -> Any:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _dot4(u: Sequence[fmpz], v: Sequence[fmpz]) -> fmpz:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2] + u[3] * v[3]


def _cross(u: Sequence[fmpz], v: Sequence[fmpz]) -> Vector:
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def _cross2(u: Sequence[fmpz], v: Sequence[fmpz]) -> fmpz:
    return u[0] * v[1] - u[1] * v[0]


def _dot2(u: Sequence[fmpz], v: Sequence[fmpz]) -> fmpz:
    return u[0] * v[0] + u[1] * v[1]


def _minus(u: Sequence[Any], v: Sequence[Any]) -> tuple[Any, Any, Any]:
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


def _coprime(values: Sequence[fmpz]) -> Vector:
    content = ZERO
    for x in values:
        content = content.gcd(x)
    return tuple(values) if content == 1 else tuple([x // content for x in values])


def _rank(rows: Sequence[Sequence[fmpz | fmpq]]) -> int:
    return fmpq_mat([list(row) for row in rows]).rank() if rows else 0


def _combination(u: Vector, v: Vector, z: tuple[fmpq, ...]) -> tuple[fmpq, fmpq] | None:
    """Return non-negative factors of two homogeneous points that give a third, None if there are none."""
    normal = _cross(u, v)
    if not any(normal):
        k = next(k for k in range(3) if u[k])
        factor = z[k] / u[k]
        return (factor, fmpq(0)) if all(factor * x == y for x, y in zip(u, z, strict=True)) else None
    if normal[0] * z[0] + normal[1] * z[1] + normal[2] * z[2] != 0:
        return None
    i = next(i for i in range(3) if normal[i])
    j, k = (i + 1) % 3, (i + 2) % 3
    p = (z[j] * v[k] - z[k] * v[j]) / normal[i]
    q = (u[j] * z[k] - u[k] * z[j]) / normal[i]
    return (p, q) if p >= 0 and q >= 0 else None


def _unit(*arrays: Array) -> int:
    """Return the exponent of the largest power of two that all entries are multiples of; 0 where all are zero."""
    entries = np.concatenate([array.ravel() for array in arrays])
    mantissa, exponent = np.frexp(entries[entries != 0])
    if not mantissa.size:
        return 0
    whole = np.ldexp(mantissa, 53).astype(np.int64)
    lowest = np.frexp((whole & -whole).astype(np.float64))[1] - 1
    return int((exponent - 53 + lowest).min())


def _whole(x: float, unit: int) -> fmpz:
    """Return x / 2^unit, an integer."""
    top, bottom = x.as_integer_ratio()
    shift = 1 - unit - bottom.bit_length()
    return fmpz(top << shift if shift >= 0 else top >> -shift)


def _scaled(x: fmpz, exponent: int) -> fmpq:
    """Return x times a power of two."""
    return fmpq(x << exponent) if exponent >= 0 else fmpq(x, ONE << -exponent)


def _quotient(top: fmpz, bottom: fmpz) -> float:
    """Return a quotient of integers, correctly rounded; infinite where it is too large."""
    try:
        return int(top) / int(bottom)
    except OverflowError:
        return math.copysign(math.inf, top * bottom)


def _rounded_point(point: Vector) -> Array:
    """Return a homogeneous point as scale pair; at infinity its unit direction."""
    x, y, w = point
    if w:
        return frozen([_quotient(x, w), _quotient(y, w)])
    length = ((x * x + y * y) << 2 * ROOT_BITS).isqrt()
    return frozen([_quotient(x << ROOT_BITS, length), _quotient(y << ROOT_BITS, length)])


def _rational(x: float | fmpq | fmpz) -> fmpq:
    return x if isinstance(x, fmpq) else fmpq(x) if isinstance(x, fmpz) else fmpq(*float(x).as_integer_ratio())


def _rational_pair(rho: Sequence[float | fmpq | fmpz]) -> tuple[fmpq, fmpq]:
    try:
        x, y = (_rational(value) for value in rho)
    except (TypeError, ValueError, OverflowError) as reason:
        raise InputError("a scale pair is two finite numbers", key="rho", found=rho) from reason
    if not (x > 0 and y > 0):
        raise InputError("scales are positive", key="rho", found=rho)
    return x, y


def _relative(
    one: ConvexPart, two: ConvexPart, transform: Array
) -> tuple[list[tuple[fmpq, ...]], list[tuple[fmpq, ...]], tuple[fmpq, ...]]:
    """Return all p_i, q_j and d as rationals, the plain way."""
    T = [[_rational(x) for x in row] for row in transform.tolist()]
    (V, W), (s, e) = (
        [[tuple(_rational(x) for x in row) for row in rows.tolist()] for rows in (one.vertices, two.vertices)],
        [tuple(_rational(x) for x in part.seed.tolist()) for part in (one, two)],
    )
    local = [tuple(x - y for x, y in zip(v, s, strict=True)) for v in V]
    P = [tuple(sum((T[i][k] * v[k] for k in range(3)), fmpq(0)) for i in range(3)) for v in local]
    Q = [tuple(x - y for x, y in zip(w, e, strict=True)) for w in W]
    moved = [sum((T[i][k] * s[k] for k in range(3)), T[i][3]) for i in range(3)]
    return P, Q, tuple(x - y for x, y in zip(e, moved, strict=True))
