"""Exact truth for decision curves: enumeration in integers, sharing nothing with the package.

A pair of convex parts P (seed s1) and Q (seed s2) overlaps at r > 0 iff a r1 + b r2 > c for the outward normal n of
every facet of the Minkowski difference, with a = max n.(x - s1), b = max -n.(y - s2), c = n.(s2 - s1). All input is
taken as rational and multiplied by one denominator; points of the quadrant are homogeneous integer triples
(x, y, w) ~ (x / w, y / w), so that w = 0 is infinity and unbounded chains need no special case.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations
from math import gcd, isqrt, lcm
from typing import Any, NamedTuple

Vec = tuple[int, int, int]
Point = tuple[Fraction, Fraction]
Box = tuple[tuple[Any, Any], tuple[Any, Any]]
AXES: tuple[Vec, ...] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


def dot(u: Sequence[Any], v: Sequence[Any]) -> Any:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def cross(u: Sequence[Any], v: Sequence[Any]) -> tuple[Any, Any, Any]:
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


def minus(u: Sequence[Any], v: Sequence[Any]) -> tuple[Any, Any, Any]:
    return (u[0] - v[0], u[1] - v[1], u[2] - v[2])


def primitive(v: Vec) -> Vec:
    """Shortest integer vector of the same direction."""
    g = gcd(*v)
    return (v[0] // g, v[1] // g, v[2] // g) if g > 1 else v


def rational(rows: Iterable[Any]) -> list[tuple[Fraction, ...]]:
    """Rows of numbers (integers, floats as they are, decimal strings) as fractions."""
    exact = (int, str, Fraction)
    return [tuple(Fraction(x) if isinstance(x, exact) else Fraction(float(x)) for x in row) for row in rows]


def homogeneous(r: Sequence[Any]) -> Vec:
    """A scale pair as an integer triple with w > 0."""
    ((x, y),) = rational([r])
    w = lcm(x.denominator, y.denominator)
    return (int(x * w), int(y * w), w)


def plane_point(u: Vec) -> Point:
    """A homogeneous triple with w > 0 as a scale pair."""
    return (Fraction(u[0], u[2]), Fraction(u[1], u[2]))


# --------------------------------------------------------------------------------------------------------- polyhedra


@dataclass(frozen=True)
class Hull:
    """Exact convex hull: extreme points by 0-based row of the input, facets (outward normal -> rows), edges."""

    vertices: dict[int, Vec]
    facets: dict[Vec, frozenset[int]]
    edges: tuple[tuple[int, int], ...]

    def support(self, n: Vec) -> tuple[int, frozenset[int]]:
        """Largest n.x and the rows of the extreme points that attain it."""
        heights = {row: dot(n, x) for row, x in self.vertices.items()}
        top = max(heights.values())
        return top, frozenset(row for row, height in heights.items() if height == top)


def hull(points: dict[int, Vec]) -> Hull:
    """Hull by all triples of points; coplanar facets are one, of equal points the first counts."""
    first: dict[Vec, int] = {}
    for row in sorted(points):
        first.setdefault(points[row], row)
    kept = {row: x for x, row in first.items()}
    facets: dict[Vec, frozenset[int]] = {}
    for i, j, k in combinations(kept, 3):
        n = primitive(cross(minus(kept[j], kept[i]), minus(kept[k], kept[i])))
        level = dot(n, kept[i])
        heights = {row: dot(n, x) - level for row, x in kept.items()}
        low, high = min(heights.values()), max(heights.values())
        if n == (0, 0, 0) or low < 0 < high:
            continue
        if low == high:
            raise ValueError("the points are coplanar")
        facets[n if high == 0 else minus((0, 0, 0), n)] = frozenset(r for r, height in heights.items() if height == 0)
    if not facets:
        raise ValueError("the points are collinear")
    corners = {row for row in kept if sum(row in face for face in facets.values()) >= 3}
    facets = {n: face & corners for n, face in facets.items()}
    edges = {tuple(sorted(f & g)) for f, g in combinations(facets.values(), 2) if len(f & g) == 2}
    return Hull({row: kept[row] for row in sorted(corners)}, facets, tuple(sorted(edges)))


# ------------------------------------------------------------------------------------------- a pair of convex parts


class Facet(NamedTuple):
    """Facet of the Minkowski difference: normal, contact line (a, b, c), supporting rows of both parts."""

    normal: Vec
    line: Vec
    one: frozenset[int]
    two: frozenset[int]

    def value(self, u: Vec) -> int:
        """a x + b y - c w: > 0 on the overlapping side."""
        return self.line[0] * u[0] + self.line[1] * u[1] - self.line[2] * u[2]


class Piece(NamedTuple):
    """Stretch of a curve: homogeneous ends, the facets tight along it, their common supports as 1-based labels."""

    start: Vec
    end: Vec
    facets: tuple[Facet, ...]
    one: tuple[int, ...]
    two: tuple[int, ...]

    @property
    def label(self) -> str:
        return feature_label(self.one, self.two)


def feature_label(one: tuple[int, ...], two: tuple[int, ...]) -> str:
    """The paper's label of a contact between the vertices `one` of body 1 and `two` of body 2."""
    kinds = ["VEF"[min(len(element), 3) - 1] for element in (one, two)]
    texts = [",".join(f"V{v}" for v in element) for element in (one, two)]
    return f"{kinds[0]}1{kinds[1]}2(P1{texts[0]}; P2{texts[1]})"


def common(facets: Sequence[Facet]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """1-based labels of the smallest faces that touch where all these facets are tight."""
    one = frozenset.intersection(*(facet.one for facet in facets))
    two = frozenset.intersection(*(facet.two for facet in facets))
    return tuple(sorted(row + 1 for row in one)), tuple(sorted(row + 1 for row in two))


def clipped(rays: list[Vec], line: Vec) -> list[Vec]:
    """Part of a convex cone of homogeneous points (in cyclic order) with line . u >= 0."""
    kept: list[Vec] = []
    values = [dot(line, u) for u in rays]
    for k, (u, p) in enumerate(zip(rays, values, strict=True)):
        v, q = rays[(k + 1) % len(rays)], values[(k + 1) % len(rays)]
        if p >= 0:
            kept.append(u)
        if p * q < 0:
            s, t = abs(q), abs(p)
            kept.append(primitive((s * u[0] + t * v[0], s * u[1] + t * v[1], s * u[2] + t * v[2])))
    return list(dict.fromkeys(kept))


def box_lines(box: Box) -> list[Vec]:
    """The four half-planes of a box as homogeneous lines."""
    lines = []
    for axis, (low, high) in enumerate(rational(box)):
        for sign, bound in ((1, low), (-1, high)):
            line = [0, 0, -sign * bound.numerator]
            line[axis] = sign * bound.denominator
            lines.append((line[0], line[1], line[2]))
    return lines


@dataclass(frozen=True, eq=False)
class Pair:
    """Two convex parts: all points times `unit`, relative to nothing; seeds likewise."""

    one: Hull
    two: Hull
    seeds: tuple[Vec, Vec]
    unit: int

    @cached_property
    def facets(self) -> tuple[Facet, ...]:
        """Facets of the Minkowski difference, each once."""
        directions = set(self.one.facets) | {minus((0, 0, 0), n) for n in self.two.facets}
        spans = [[minus(h.vertices[j], h.vertices[i]) for i, j in h.edges] for h in (self.one, self.two)]
        for e in spans[0]:
            for f in spans[1]:
                n = primitive(cross(e, f))
                directions |= {n, minus((0, 0, 0), n)}
        directions.discard((0, 0, 0))
        d = minus(self.seeds[1], self.seeds[0])
        found = []
        for n in sorted(directions):
            top, rows = self.one.support(n)
            bottom, others = self.two.support(minus((0, 0, 0), n))
            if self._flat(rows, others):
                continue
            a, b = top - dot(n, self.seeds[0]), bottom + dot(n, self.seeds[1])
            found.append(Facet(n, (a, b, dot(n, d)), rows, others))
        return tuple(found)

    def _flat(self, rows: frozenset[int], others: frozenset[int]) -> bool:
        """Whether the sum of two supports is no facet: neither is a face, nor are they two crossing edges."""
        if max(len(rows), len(others)) >= 3:
            return False
        if len(rows) < 2 or len(others) < 2:
            return True
        e, f = (minus(*(h.vertices[row] for row in support)) for h, support in ((self.one, rows), (self.two, others)))
        return cross(e, f) == (0, 0, 0)

    @cached_property
    def region(self) -> tuple[Vec, ...]:
        """Corners of the closed overlap region in the quadrant, in cyclic order; empty if it has no inside."""
        rays: list[Vec] = [(0, 0, 1), (1, 0, 0), (0, 1, 0)]
        for facet in self.facets:
            rays = clipped(rays, (facet.line[0], facet.line[1], -facet.line[2]))
        middle = (sum(u[0] for u in rays), sum(u[1] for u in rays), sum(u[2] for u in rays))
        return tuple(rays) if min(middle) > 0 and all(facet.value(middle) > 0 for facet in self.facets) else ()

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The boundary of the overlap region in the open quadrant, one piece a contact feature."""
        made = []
        for k, u in enumerate(self.region):
            v = self.region[(k + 1) % len(self.region)]
            tight = tuple(facet for facet in self.facets if facet.value(u) == 0 == facet.value(v))
            if not any(u[axis] == 0 == v[axis] for axis in range(3)):
                made.append(Piece(u, v, tight, *common(tight)))
        return tuple(made)

    def corners(self, box: Box) -> list[tuple[Point, str]]:
        """Switching points inside a box, with the label of the contact there."""
        ends = [{piece.start, piece.end} for piece in self.pieces]
        return [
            (plane_point(u), feature_label(*common([facet for facet in self.facets if facet.value(u) == 0])))
            for u in self.region
            if sum(u in pair for pair in ends) == 2 and all(dot(line, u) > 0 for line in box_lines(box))
        ]

    def side(self, r: Sequence[Any]) -> int:
        """Sign of the gap: 1 apart, 0 touching, -1 overlapping."""
        u = homogeneous(r)
        least = min(facet.value(u) for facet in self.facets)
        return (least < 0) - (least > 0)

    def gap(self, r: Sequence[Any]) -> float:
        """Largest separation over facet directions, rounded once at the end."""
        u = homogeneous(r)
        depths = (Fraction(-f.value(u), u[2] * self.unit) / root(dot(f.normal, f.normal)) for f in self.facets)
        return float(max(depths))

    def distance(self, r: Sequence[Any]) -> float:
        """Euclidean distance of the scaled parts, 0 unless apart.

        The nearest point of P - Q to the offset lies inside a facet, where the facet's separation is the distance, or
        on an edge, and every edge is an edge of one part less a vertex of the other.
        """
        if self.side(r) <= 0:
            return 0.0
        ((r1, r2),) = rational([r])
        d = minus(self.seeds[1], self.seeds[0])
        heights = [r1 * f.line[0] + r2 * f.line[1] for f in self.facets]
        for facet, height in zip(self.facets, heights, strict=True):
            n, over = facet.normal, facet.line[2] - height
            foot = tuple(x - over * y / dot(n, n) for x, y in zip(d, n, strict=True))
            if over > 0 and all(dot(f.normal, foot) <= h for f, h in zip(self.facets, heights, strict=True)):
                return float(over / self.unit / root(dot(n, n)))
        ones = {k: tuple(r1 * x for x in minus(v, self.seeds[0])) for k, v in self.one.vertices.items()}
        twos = {k: tuple(r2 * x for x in minus(v, self.seeds[1])) for k, v in self.two.vertices.items()}
        segments = [(minus(ones[i], y), minus(ones[j], y)) for i, j in self.one.edges for y in twos.values()]
        segments += [(minus(x, twos[i]), minus(x, twos[j])) for i, j in self.two.edges for x in ones.values()]
        return float(root(min(_squared(d, p, q) for p, q in segments)) / self.unit)

    def interval(self, r1: Any) -> tuple[Fraction, Fraction | None] | None:
        """Open interval of r2 > 0 in which the parts overlap; None if empty, None above if unbounded."""
        ((x,),) = rational([[r1]])
        low, high = Fraction(0), None
        for facet in self.facets:
            a, b, c = facet.line
            if b > 0:
                low = max(low, (c - a * x) / b)
            elif b < 0:
                high = (c - a * x) / b if high is None else min(high, (c - a * x) / b)
            elif a * x <= c:
                return None
        return (low, high) if high is None or low < high else None


def root(x: Any) -> Fraction:
    """Square root to 60 digits."""
    x = Fraction(x)
    shift = 400
    return Fraction(isqrt((x.numerator << shift) // x.denominator), 1 << (shift // 2))


def _squared(d: Any, p: Any, q: Any) -> Fraction:
    """Squared distance of the point d from the segment p q."""
    e, f = minus(q, p), minus(d, p)
    t = min(Fraction(1), max(Fraction(0), Fraction(dot(e, f)) / dot(e, e)))
    rest = tuple(x - t * y for x, y in zip(f, e, strict=True))
    return Fraction(dot(rest, rest))


# ---------------------------------------------------------------------------------------------------- unions of parts


@dataclass(frozen=True, eq=False)
class ExactCurve:
    """Decision curve of two unions of convex parts: all their pairs, by part numbers."""

    pairs: dict[tuple[int, int], Pair]

    @property
    def pair(self) -> Pair:
        """The only pair of two convex bodies."""
        (pair,) = self.pairs.values()
        return pair

    @property
    def degenerate(self) -> bool:
        """Whether a pair touches without ever overlapping, so that its contact set is no curve."""
        for pair in self.pairs.values():
            rays: list[Vec] = [(0, 0, 1), (1, 0, 0), (0, 1, 0)]
            for facet in pair.facets:
                rays = clipped(rays, (facet.line[0], facet.line[1], -facet.line[2]))
            if not pair.region and rays and min(sum(u[k] for u in rays) for k in range(3)) > 0:
                return True
        return False

    def side(self, r: Sequence[Any]) -> int:
        """Sign of the gap: 1 apart, 0 touching, -1 overlapping."""
        return min(pair.side(r) for pair in self.pairs.values())

    def overlaps(self, r: Sequence[Any]) -> bool:
        return self.side(r) < 0

    def touches(self, r: Sequence[Any]) -> bool:
        return self.side(r) == 0

    def apart(self, r: Sequence[Any]) -> bool:
        return self.side(r) > 0

    def gap(self, r: Sequence[Any]) -> float:
        return min(pair.gap(r) for pair in self.pairs.values())

    def distance(self, r: Sequence[Any]) -> float:
        return min(pair.distance(r) for pair in self.pairs.values())

    def crossings(self, r1: Any, box: Box | None = None) -> list[Fraction]:
        """All contact scales r2 > 0 (in the box) on a vertical line, least first; snug contacts too."""
        intervals = [found for pair in self.pairs.values() if (found := pair.interval(r1)) is not None]
        ends = {end for interval in intervals for end in interval if end}
        low, high = rational(box)[1] if box is not None else (0, None)
        return sorted(
            end
            for end in ends
            if not any(bottom < end and (top is None or end < top) for bottom, top in intervals)
            and low <= end
            and (high is None or end <= high)
        )

    def pieces(self, box: Box) -> list[tuple[tuple[int, int], Piece]]:
        """Stretches of all pairs' boundaries in the box outside every pair's open overlap region."""
        made = []
        for key, pair in self.pairs.items():
            others = [other for name, other in self.pairs.items() if name != key and other.region]
            for piece in pair.pieces:
                ends = [piece.start, piece.end]
                for line in box_lines(box):
                    ends = clipped(ends, line)
                if len(ends) == 2:
                    made += [
                        (key, piece._replace(start=_between(ends[0], ends[1], s), end=_between(ends[0], ends[1], t)))
                        for s, t in _outside(ends[0], ends[1], others)
                    ]
        return made

    def status(self, box: Box) -> str:
        """As the curve's own status."""
        if self.pieces(box):
            return "contact"
        (x0, x1), (y0, y1) = rational(box)
        return "overlapping" if self.overlaps(((x0 + x1) / 2, (y0 + y1) / 2)) else "apart"


def _between(u: Vec, v: Vec, t: Fraction) -> Vec:
    p, q = t.denominator - t.numerator, t.numerator
    return primitive((p * u[0] + q * v[0], p * u[1] + q * v[1], p * u[2] + q * v[2]))


def _outside(u: Vec, v: Vec, others: list[Pair]) -> list[tuple[Fraction, Fraction]]:
    """Parameters of the stretches of the segment u v outside the open regions."""
    covered = []
    for pair in others:
        low, high = Fraction(0), Fraction(1)
        inside = True
        for facet in pair.facets:
            p, q = facet.value(u), facet.value(v)
            if p <= 0 and q <= 0:
                inside = False
                break
            if p < 0 or q < 0:
                t = Fraction(p, p - q)
                low, high = (max(low, t), high) if p < 0 else (low, min(high, t))
        if inside and low < high:
            covered.append((low, high))
    free, at = [], Fraction(0)
    for low, high in sorted(covered):
        if low > at:
            free.append((at, low))
        at = max(at, high)
    return [*free, (at, Fraction(1))] if at < 1 else free


def exact_curve(
    one: Any, seed1: Any, two: Any, seed2: Any, *, parts1: Any = None, parts2: Any = None, pose: Any = None
) -> ExactCurve:
    """Exact curve of two bodies: (n, 3) vertices, seed, index lists of the convex parts; `pose` moves body 1."""
    points = [rational(one), rational(two)]
    seeds = rational([seed1, seed2])
    if pose is not None:
        T = rational(pose)
        points[0] = [_moved(T, x) for x in points[0]]
        seeds[0] = _moved(T, seeds[0])
    unit = lcm(*(x.denominator for row in (*points[0], *points[1], *seeds) for x in row))
    whole = [[_scaled(row, unit) for row in rows] for rows in points]
    given = [[range(len(rows))] if own is None else own for rows, own in zip(whole, (parts1, parts2), strict=True)]
    hulls = [[hull({k: rows[k] for k in part}) for part in own] for rows, own in zip(whole, given, strict=True)]
    s1, s2 = (_scaled(seed, unit) for seed in seeds)
    return ExactCurve(
        {(i, j): Pair(p, q, (s1, s2), unit) for i, p in enumerate(hulls[0]) for j, q in enumerate(hulls[1])}
    )


def _scaled(x: tuple[Fraction, ...], unit: int) -> Vec:
    return (int(x[0] * unit), int(x[1] * unit), int(x[2] * unit))


def _moved(T: list[tuple[Fraction, ...]], x: tuple[Fraction, ...]) -> tuple[Fraction, ...]:
    return tuple(dot(T[i], x) + T[i][3] for i in range(3))
