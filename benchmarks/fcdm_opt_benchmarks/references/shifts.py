"""Least shifts of unions of convex parts, and contact scales of hulls, exact in whole numbers: nothing of `fcdm_opt`.

With no turn two convex parts P + t and Q overlap inside one open polyhedron of shifts t: those with n.t < max n.q -
min n.p for every facet normal n of the Minkowski difference Q - P. These normals are the outward ones of Q's faces,
the inward ones of P's, and cross products of edges, both supporting. A least shift is the point nearest to rest on a
plane of these polyhedra, or where two or three of them meet; of all such points the nearest one that does what is
asked is the least.

Coordinates are decimals as they are written (`Fraction`), so amounts are square roots of rationals of a few digits.
Hulls come from a float library and are then proved: all corners lie behind every face, exactly, and the faces close
the surface.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np

Whole = Any
"""Arrays of whole numbers of any length (dtype object)."""
NEAR = 1e-9
"""Relative: floats that differ by less are left to whole numbers."""


class Shift(NamedTuple):
    """A least shift: parameters, and the square of its length."""

    q: tuple[Fraction, ...]
    square: Fraction


class Planes(NamedTuple):
    """The open polyhedron n.t < b of shifts at which two parts overlap."""

    normals: list[tuple[Fraction, ...]]
    bounds: list[Fraction]


def fractions(rows: Any) -> list[tuple[Fraction, ...]]:
    """Return coordinates as the decimals that they are printed as."""
    return [tuple(Fraction(repr(float(x))) for x in row) for row in np.asarray(rows, dtype=np.float64).tolist()]


def made(rows: Any, seed: Any, scale: float) -> list[tuple[Fraction, ...]]:
    """Return corners as made: seed + scale (x - seed)."""
    (centre,), rho = fractions([seed]), Fraction(repr(float(scale)))
    return [tuple(s + rho * (x - s) for x, s in zip(row, centre, strict=True)) for row in fractions(rows)]


# ------------------------------------------------------------------------------------------------------------- hulls


class Hull(NamedTuple):
    """Corners in whole numbers, outward normals of faces, and edges as pairs of corners."""

    corners: Whole
    normals: Whole
    edges: list[tuple[int, int]]


def hull(corners: Whole) -> Hull:
    """Return a proved hull; raise `ValueError` where floats do not see the faces as they are."""
    from scipy.spatial import ConvexHull

    found = ConvexHull(corners.astype(np.float64))
    middle = corners.sum(axis=0)
    normals, sides = [], dict[tuple[int, int], list[int]]()
    for k, (i, j, m) in enumerate(found.simplices.tolist()):
        n = np.cross(corners[j] - corners[i], corners[m] - corners[i])
        n = n if n @ (len(corners) * corners[i] - middle) > 0 else -n
        n //= math.gcd(*n.tolist()) or 1
        if not n.any() or (corners @ n > n @ corners[i]).any():
            raise ValueError("the hull is not seen exactly")
        normals.append(n)
        for edge in combinations(sorted((i, j, m)), 2):
            sides.setdefault(edge, []).append(k)
    if any(len(own) != 2 for own in sides.values()):
        raise ValueError("the hull is not closed")
    edges = [edge for edge, (one, two) in sides.items() if (normals[one] != normals[two]).any()]
    return Hull(corners, np.array(sorted({tuple(n) for n in normals}), dtype=object), edges)


def difference(one: Sequence[Any], two: Sequence[Any]) -> Planes:
    """Return the facets of the Minkowski difference of two hulls of rational corners."""
    scale = math.lcm(*(x.denominator for row in (*one, *two) for x in row))
    P, Q = (hull(np.array([[int(x * scale) for x in row] for row in own], dtype=object)) for own in (one, two))
    normals = {tuple(n) for n in Q.normals} | {tuple(-n) for n in P.normals} | set(_crossing(P, Q))
    bounds = [
        Fraction(max(Q.corners @ np.array(n, object)) - min(P.corners @ np.array(n, object)), scale)
        for n in sorted(normals)
    ]
    return Planes([tuple(map(Fraction, n)) for n in sorted(normals)], bounds)


def _crossing(P: Hull, Q: Hull) -> Iterator[tuple[int, ...]]:
    """Yield normals of pairs of edges that support both hulls: from P to Q, and both are lowest and highest there."""
    p, q = P.corners.astype(np.float64), Q.corners.astype(np.float64)
    e, f = (np.array([own.corners[j] - own.corners[i] for i, j in own.edges], object) for own in (P, Q))
    crosses = np.cross(e[:, None].astype(np.float64), f[None].astype(np.float64))
    lengths = np.linalg.norm(crosses, axis=2)
    size = max(float(np.ptp(p, axis=0).max()), float(np.ptp(q, axis=0).max()))
    for sign in (1, -1):
        n = sign * crosses / np.where(lengths > 0, lengths, 1.0)[..., None]
        first = np.array([p[i] for i, _ in P.edges])
        second = np.array([q[i] for i, _ in Q.edges])
        low = np.einsum("abk,ak->ab", n, first) - (n @ p.T).min(axis=2)
        high = (n @ q.T).max(axis=2) - np.einsum("abk,bk->ab", n, second)
        for a, b in zip(*np.nonzero((lengths > 0) & (low <= NEAR * size) & (high <= NEAR * size)), strict=True):
            normal = sign * np.cross(e[a], f[b])
            at, over = P.corners @ normal, Q.corners @ normal
            if normal.any() and at[P.edges[a][0]] == min(at) and over[Q.edges[b][0]] == max(over):
                yield tuple(normal // math.gcd(*normal.tolist()))


# ------------------------------------------------------------------------------------------------------------ shifts


class Asked(NamedTuple):
    """What is asked of shifts q, t = axes.T q.

    Attributes
    ----------
    pairs : list of Planes
        Part pairs; after the shift none overlaps.
    touching : list of lists of int
        Of each list one pair at least touches: all pairs in one list for "touch", none for "clear".
    axes : list of directions
    limits : list of (low, high) or None
        Of each parameter.
    """

    pairs: list[Planes]
    touching: list[list[int]]
    axes: list[tuple[Fraction, ...]]
    limits: list[Any]


def least_shift(asked: Asked) -> Shift | None:
    """Return the least shift, None where none does what is asked."""
    count = len(asked.axes)
    rows, bounds = _in_parameters(asked)
    own = [(tuple(row), bound) for pair in zip(rows, bounds, strict=True) for row, bound in zip(*pair, strict=True)]
    own += [
        (tuple(Fraction(int(j == k)) for j in range(count)), end)
        for k, ends in enumerate(asked.limits)
        for end in ends or ()
        if end is not None
    ]
    planes = sorted({_primitive(row, bound) for row, bound in own if any(row)})
    N, c = (np.array([[float(x) for x in row] for row, _ in planes]), np.array([float(b) for _, b in planes]))
    norms = np.linalg.norm(N, axis=1)
    N, c = N / norms[:, None], c / norms
    points: list[Any] = [np.zeros((1, count))]
    sets: list[Any] = [((),)]
    for size in range(1, count + 1):
        chosen = np.array(list(combinations(range(len(planes)), size)))
        gram = np.einsum("sik,sjk->sij", N[chosen], N[chosen])
        good = np.linalg.det(gram) > NEAR
        chosen, gram = chosen[good], gram[good]
        points.append(np.einsum("sik,si->sk", N[chosen], np.linalg.solve(gram, c[chosen][..., None])[..., 0]))
        sets.append(tuple(map(tuple, chosen.tolist())))
    every, which = np.vstack(points), [own for group in sets for own in group]
    lengths = np.linalg.norm(every, axis=1)
    reach = float(np.abs(c).max(initial=1.0))
    fine = _nearly(asked, rows, bounds, every, NEAR * reach)
    best: Shift | None = None
    for k in np.argsort(lengths, kind="stable"):
        if best is not None and lengths[k] > math.sqrt(best.square) + NEAR * reach:
            break
        if not fine[k]:
            continue
        q = _projected([planes[i] for i in which[k]], count)
        square = sum((x * x for x in q), Fraction(0))
        if (best is None or square < best.square) and does(asked, rows, bounds, q):
            best = Shift(q, square)
    return best


def does(asked: Asked, rows: Any, bounds: Any, q: Sequence[Fraction]) -> bool:
    """Tell whether a shift does what is asked, exactly."""
    for ends, x in zip(asked.limits, q, strict=True):
        if ends is not None and not ((ends[0] is None or ends[0] <= x) and (ends[1] is None or x <= ends[1])):
            return False
    most = [max(_dot(row, q) - b for row, b in zip(*own, strict=True)) for own in zip(rows, bounds, strict=True)]
    return min(most) >= 0 and all(any(most[k] == 0 for k in group) for group in asked.touching)


def _in_parameters(asked: Asked) -> tuple[list[list[tuple[Fraction, ...]]], list[list[Fraction]]]:
    rows = [[tuple(_dot(n, axis) for axis in asked.axes) for n in own.normals] for own in asked.pairs]
    return rows, [own.bounds for own in asked.pairs]


def _nearly(asked: Asked, rows: Any, bounds: Any, points: Any, room: float) -> Any:
    """Tell in floats which points may do."""
    fine = np.ones(len(points), dtype=bool)
    for k, ends in enumerate(asked.limits):
        low, high = (
            math.copysign(math.inf, s) if end is None else float(end)
            for s, end in zip((-1, 1), ends or (None, None), strict=True)
        )
        fine &= (points[:, k] >= low - room) & (points[:, k] <= high + room)
    most = np.full((len(asked.pairs), len(points)), -np.inf)
    for k, (own, bound) in enumerate(zip(rows, bounds, strict=True)):
        n, b = np.array([[float(x) for x in row] for row in own]), np.array([float(x) for x in bound])
        scale = np.maximum(np.linalg.norm(n, axis=1), 1e-300)
        still = np.array([not any(row) for row in own])
        scale[still] = np.abs(b[still]) + 1.0
        most[k] = ((points @ n.T - b) / scale).max(axis=1)
    fine &= most.min(axis=0) >= -room
    for group in asked.touching:
        fine &= (np.abs(most[group]) <= room).any(axis=0)
    return fine


def _projected(planes: Sequence[Any], count: int) -> tuple[Fraction, ...]:
    """Return the point of some planes that is nearest to zero."""
    if not planes:
        return (Fraction(0),) * count
    gram = [[_dot(one, two) for two, _ in planes] for one, _ in planes]
    forces = _solved(gram, [bound for _, bound in planes])
    return tuple(
        sum((f * row[k] for f, (row, _) in zip(forces, planes, strict=True)), Fraction(0)) for k in range(count)
    )


def _solved(matrix: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """Solve a small positive definite system by elimination."""
    rows = [[*row, end] for row, end in zip(matrix, right, strict=True)]
    for k, pivot in enumerate(rows):
        for other in rows:
            if other is not pivot and other[k]:
                share = other[k] / pivot[k]
                other[:] = [x - share * y for x, y in zip(other, pivot, strict=True)]
    return [row[-1] / row[k] for k, row in enumerate(rows)]


def _primitive(row: tuple[Fraction, ...], bound: Fraction) -> tuple[tuple[Fraction, ...], Fraction]:
    """Return a plane with whole numbers without a common divisor: equal planes are equal then."""
    scale = Fraction(math.lcm(*(x.denominator for x in row)))
    scale /= math.gcd(*(int(x * scale) for x in row))
    return tuple(x * scale for x in row), bound * scale


def _dot(one: Sequence[Fraction], two: Sequence[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(one, two, strict=True)), Fraction(0))


# ------------------------------------------------------------------------------------------------------------ scales


def contact_scale(one: Any, two: Any, seeds: Any, rho1: float) -> Fraction:
    """Return the scale of hull 2 at which it touches hull 1 of a scale: the largest root of their contact lines.

    Parameters
    ----------
    one, two : (n, 3) floats
        Corners as drawn; the seeds lie inside.
    seeds : two points
    rho1 : float
    """
    (s1, s2), rho = fractions(seeds), Fraction(repr(float(rho1)))
    spokes = [
        [tuple(x - s for x, s in zip(row, seed, strict=True)) for row in fractions(own)]
        for own, seed in ((one, s1), (two, s2))
    ]
    d = tuple(b - a for a, b in zip(s1, s2, strict=True))
    found = []
    for n in difference(*spokes).normals:
        inward = tuple(-x for x in n)  # from body 1 to body 2
        a, b = (max(_dot(way, x) for x in own) for way, own in ((inward, spokes[0]), (n, spokes[1])))
        found.append((_dot(inward, d) - a * rho) / b)
    return max(found)


def asked_of(
    ones: Sequence[Any], twos: Sequence[Any], axes: Any, goal: str, limits: Any = None, pairs: Any = None
) -> Asked:
    """Return what is asked of two unions of parts as made.

    Parameters
    ----------
    ones, twos : lists of corners in rationals
    axes : (k, 3) floats
        Unit vectors.
    goal : "touch", "clear" or "locate"
    limits : list of (low, high) or None, optional
    pairs : list of (i, j), optional
        Of "locate": parts that touch.
    """
    places = list(product(range(len(ones)), range(len(twos))))
    every = [difference(ones[i], twos[j]) for i, j in places]
    groups = {"touch": [list(range(len(every)))], "clear": []}
    touching = groups[goal] if goal in groups else [[places.index((i, j))] for i, j in pairs]
    ends = [
        None if own is None else tuple(None if x is None else Fraction(repr(float(x))) for x in own)
        for own in (limits or [None] * len(axes))
    ]
    return Asked(every, touching, fractions(axes), ends)
