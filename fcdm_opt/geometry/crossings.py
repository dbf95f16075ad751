"""Where triangles of one surface cross or overlap, other than at the corners and edges that they share.

Boxes find pairs that may meet; a plane between two triangles, off them by more than rounding, proves that they do not;
the few pairs left are intersected in rational numbers. Triangles with one corner in common are cones there: arcs on a
sphere about it. Two that share a side meet beyond it only where folded flat. A single point in common is a touch, no
crossing: around it the surface stays on one side.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from fcdm_opt.compiling import kernel
from fcdm_opt.geometry.arrays import SMALLEST, Array, Ints, equal_pairs
from fcdm_opt.geometry.measures import cross, dots, following, norms
from fcdm_opt.geometry.polygons import Sides, clipped

ROUNDING = 16 * float(np.finfo(float).eps)  # of inner products of differences, relative to the lengths
BLOCK = 1 << 18  # pairs looked at together
FEW_PAIRS = 1 << 18  # of boxes, up to which all are compared
CELLS = 1 << 16  # along each axis, of the curve that boxes are ordered along
SEVERAL, EMPTY = -1, -2  # in place of the group of a node's boxes: there are several, there is none


class Crossing(NamedTuple):
    """Two triangles that meet where they should not, and a point that both have."""

    one: int
    two: int
    place: tuple[float, float, float]


def first_crossing(points: Array, triangles: Ints, slack: float) -> Crossing | None:
    """Return a pair of triangles that cross or overlap by more than `slack`, or None.

    `points` (n, 3). `triangles` (t, 3): of some height each, and no two with the same corners. `slack`: length up to
    which what two triangles have in common counts as a point.
    """
    unclear = (pairs for find in (_folded, _crossing_cones, _crossing_apart) for pairs in find(points, triangles))
    for one, two in unclear:
        for i, j in zip(one.tolist(), two.tolist(), strict=True):
            place = _meeting(points[triangles[i]], points[triangles[j]], slack)
            if place is not None:
                return Crossing(i, j, place)
    return None


def _folded(points: Array, triangles: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Yield neighbours across an edge that may lie on each other."""
    sides = Sides.around(triangles.ravel(), 3)
    for one, two in equal_pairs(sides.edge):
        _, c, d = sides.sections(points, np.column_stack([one, two]))
        high, deep = norms(c), norms(d)
        longest = norms(points[triangles] - points[np.roll(triangles, 1, axis=1)]).max(axis=1)
        slope = ROUNDING * (longest[one // 3] / high + longest[two // 3] / deep)
        cosine, sine = (c * d).sum(axis=1) / (high * deep), norms(cross(c, d)) / (high * deep)
        doubtful = ~((cosine < -slope) | (sine > slope))
        yield one[doubtful] // 3, two[doubtful] // 3


def _crossing_cones(points: Array, triangles: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Yield triangles with one common corner that may meet beyond it."""
    apex = triangles.ravel()
    sides = triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
    rays = points[sides] - points[apex][:, None]
    rays /= norms(rays)[:, :, None]
    bulge = 1 - norms(rays.sum(axis=1)) / 2 + ROUNDING  # of the arc over its chord
    place = np.zeros((len(apex), 3))
    place[:, 0] = 4.0 * apex  # arcs about different points are far apart
    pad = bulge[:, None] + ROUNDING * 4.0 * len(points)
    for one, two in overlapping(place + rays.min(axis=1) - pad, place + rays.max(axis=1) + pad, np.arange(len(apex))):
        shared = (apex[one] != apex[two]) | (sides[one][:, :, None] == sides[two][:, None, :]).any(axis=(1, 2))
        one, two = one[~shared], two[~shared]
        open_ = np.ones(len(one), bool)
        corners = np.concatenate([rays[one], -rays[two]], axis=1)  # a plane between: all four on one side of it
        for count in (1, 2, 3):
            for chosen in combinations(range(4), count):
                rows = np.flatnonzero(open_)
                four = corners[rows]
                if count == 3:
                    a, b, c = (four[:, k] for k in chosen)
                    normal = cross(b - a, c - a)
                    normal *= np.sign((normal * a).sum(axis=1))[:, None]
                else:
                    normal = four[:, chosen].sum(axis=1)
                least = dots(four, normal[:, None]).min(axis=1)
                open_[rows[least > ROUNDING * norms(normal)]] = False
        yield one[open_] // 3, two[open_] // 3


def _crossing_apart(points: Array, triangles: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Yield triangles without a common corner that may meet."""
    corners = points[triangles] - points[triangles[0, 0]]
    edges = (following(corners) - corners).reshape(-1, 3)
    frame = np.linalg.eigh(edges.T @ edges)[1]  # slender triangles lie along it
    both = np.concatenate([corners, corners @ frame], axis=2)
    pad = ROUNDING * np.abs(corners).max()
    fans = np.take_along_axis(triangles, np.bincount(triangles.ravel())[triangles].argmax(axis=1)[:, None], axis=1)
    for one, two in overlapping(both.min(axis=1) - pad, both.max(axis=1) + pad, fans.ravel()):
        for column in triangles.T:
            for other in triangles.T:
                apart = column[one] != other[two]
                one, two = one[apart], two[apart]
        kept = not_separated(points[triangles[one]], points[triangles[two]])
        yield one[kept], two[kept]


def not_separated(one: Array, two: Array) -> Ints:
    """Return the pairs of triangles, (m, 3, 3), that no plane across an axis keeps apart by more than rounding."""
    # across a triangle, along a side of both, or through a side and across its triangle
    one, two = one - one[:, :1], two - one[:, :1]
    extent = np.sqrt(np.maximum(dots(one, one).max(axis=1), dots(two, two).max(axis=1)))
    directions = np.concatenate([following(own) - own for own in (one, two)], axis=1)
    normals = np.stack([cross(directions[:, 0], directions[:, 1]), cross(directions[:, 3], directions[:, 4])], axis=1)
    directions, candidates = np.concatenate([directions, normals], axis=1), np.arange(len(one))
    sides = product(range(3), range(3, 6))
    for i, j in ((0, 1), (3, 4), *sides, (6, 0), (6, 1), (6, 2), (7, 3), (7, 4), (7, 5)):
        axis = cross(directions[candidates, i], directions[candidates, j])
        heights = ([dots(own[candidates, k], axis) for k in range(3)] for own in (one, two))
        (low, high), (under, over) = ((reduce(np.minimum, own), reduce(np.maximum, own)) for own in heights)
        gap = np.maximum(under - high, low - over)
        candidates = candidates[~(gap > ROUNDING * extent[candidates] * norms(axis))]
    return candidates


def overlapping(low: Array, high: Array, groups: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Yield all pairs of overlapping boxes of different groups, a block at a time: down a balanced tree of boxes."""
    depth = max(1, len(low) - 1).bit_length()
    leaves, order = 1 << depth, _along_curve(low + high)
    lows, highs = np.full((2 * leaves, low.shape[1]), np.inf), np.full((2 * leaves, low.shape[1]), -np.inf)
    group = np.full(2 * leaves, EMPTY)
    own = slice(leaves, leaves + len(low))
    lows[own], highs[own], group[own] = low[order], high[order], groups[order]
    for level in reversed(range(depth)):
        nodes = slice(1 << level, 2 << level)
        first, second = slice(2 << level, 4 << level, 2), slice((2 << level) + 1, 4 << level, 2)
        lows[nodes], highs[nodes] = np.minimum(lows[first], lows[second]), np.maximum(highs[first], highs[second])
        same = (group[first] == group[second]) | (group[second] == EMPTY)
        group[nodes] = np.where(same, group[first], SEVERAL)
    stack, count = np.empty((4 * depth + 4, 2), np.int64), 1
    stack[0] = 1
    while count:
        found = np.empty((BLOCK, 2), np.int64)
        count, got = overlaps(lows, highs, group, stack, count, found)
        pairs = order[found[:got] - leaves]
        yield pairs[:, 0], pairs[:, 1]


def overlapping_between(low: Array, high: Array, under: Array, over: Array) -> Ints:
    """Return the pairs of a box of one set, (n, k), and one of another, (m, k), that overlap: rows of both, (p, 2)."""
    if len(low) * len(under) <= FEW_PAIRS:
        axes = zip(low.T[..., None], high.T[..., None], under.T, over.T, strict=True)
        return np.argwhere(reduce(np.logical_and, ((a <= d) & (b >= c) for a, b, c, d in axes)))
    groups, count = np.repeat([0, 1], [len(low), len(under)]), len(low)
    found = overlapping(np.concatenate([low, under]), np.concatenate([high, over]), groups)
    pairs = [np.column_stack([np.minimum(i, j), np.maximum(i, j) - count]) for i, j in found]
    return np.concatenate([np.zeros((0, 2), np.int64), *pairs])


def _along_curve(places: Array) -> Ints:
    """Return the order of places along a curve that keeps near ones together (Morton's), by their first coordinates."""
    spread = places - places.min(axis=0)
    cells = np.minimum(spread / max(float(spread.max()), SMALLEST) * CELLS, CELLS - 1).astype(np.uint64)[:, :3]
    code = np.zeros(len(cells), np.uint64)
    for bit in range(CELLS.bit_length() - 1):
        for axis, own in enumerate(cells.T):
            code |= (own >> np.uint64(bit) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return np.argsort(code, kind="stable")


@kernel
def overlaps(lows, highs, group, stack, count, found):
    """Fill in pairs of leaves whose boxes overlap, from the pairs of nodes that are left; return how many are of each.

    Node 1 is the root and node k has the halves 2 k and 2 k + 1. `group` is the one group of a node's leaves.
    """
    leaves, got = len(lows) // 2, 0
    while count > 0 and got < len(found):
        count -= 1
        i, j = stack[count, 0], stack[count, 1]
        if group[i] == group[j] and group[i] != SEVERAL:
            continue
        if i != j:
            apart = False
            for axis in range(lows.shape[1]):
                apart = apart or lows[i, axis] > highs[j, axis] or lows[j, axis] > highs[i, axis]
            if apart:
                continue
            if i >= leaves:
                found[got, 0], found[got, 1] = i, j
                got += 1
                continue
        for m in range(2):
            for n in range(m if i == j else 0, 2):
                stack[count, 0], stack[count, 1] = 2 * i + m, 2 * j + n
                count += 1
    return count, got


def _meeting(one: Array, two: Array, slack: float) -> tuple[float, float, float] | None:
    """Return a point at which two triangles meet beyond what they share, None if there is none off it by `slack`."""
    from flint import fmpq

    rational = [np.array([[fmpq(*x.as_integer_ratio()) for x in row] for row in own.tolist()]) for own in (one, two)]
    first, second = ([tuple(row) for row in own] for own in rational)
    shared = [point for point in first if point in second]
    polygon, other = rational
    ahead = following(other) - other
    normal = cross(ahead[0], ahead[1])
    inwards = np.concatenate([[normal, -normal], cross(normal[None], ahead)])
    for inward, origin in zip(inwards, other[[0, 0, 0, 1, 2]], strict=True):
        polygon = clipped(polygon, (polygon - origin) @ inward)
    common = list(dict.fromkeys(map(tuple, polygon)))
    found = [point for point in common if point not in shared]
    if not found:
        return None
    zero = [*shared, *found][0]
    local = np.array([[float(x - o) for x, o in zip(point, zero, strict=True)] for point in common])
    if len(shared) == 2:
        along = np.array([float(x - o) for x, o in zip(shared[1], zero, strict=True)])
        local = np.cross(local, along / norms(along))
    if norms(local).max() <= slack:
        return None
    x, y, z = (float(sum(values) / len(found)) for values in zip(*found, strict=True))
    return x, y, z
