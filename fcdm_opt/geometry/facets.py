"""The facets of bodies as triangles, and which convex parts of two bodies have some that are near each other."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.compiling import kernel, step
from fcdm_opt.geometry.arrays import SMALLEST, Array, Flags, Ints
from fcdm_opt.geometry.bodies import Body, cached_per_body
from fcdm_opt.geometry.crossings import not_separated, overlapping
from fcdm_opt.geometry.measures import unit_normals
from fcdm_opt.geometry.polygons import fans
from fcdm_opt.tolerances import DEFAULT


class Facets:
    """The facets of a body's parts: of parts that are its surface alone the bases, of others all."""

    points: Array  # from the seed, (n, 3)
    triangles: Ints  # rows of the points, counter-clockwise seen from outside, (t, 3)
    owners: Ints  # the part that each is of, (t,)

    def __init__(self, body: Body) -> None:
        loops = [part.loops for part in body.parts]
        if body.is_surface:
            pyramids = len(loops) - (len(body.exact.pieces) if body.exact is not None else 0)
            loops = [own[:1] for own in loops[:pyramids]] + loops[pyramids:]
        starts = np.cumsum([0, *(len(part.vertices) for part in body.parts)])
        self.points = np.concatenate([part.vertices for part in body.parts]) - body.seed
        self.triangles = np.concatenate([start + fans(own) for start, own in zip(starts.tolist(), loops, strict=False)])
        self.owners = np.repeat(np.arange(len(loops)), [sum(len(loop) - 2 for loop in own) for own in loops])


facets_of = cached_per_body(Facets)


class NearFacets(NamedTuple):
    """Pairs of facets that may be within a distance of each other."""

    parts: Ints  # the part of either body that they are of, (k, 2)
    # (k, 2): how far the second is before the plane of the first, and the first before that of the second, at least;
    # negative where it reaches through the plane
    heights: Array
    corners: Array  # of both triangles, (k, 2, 3, 3)

    def some(self, rows: Flags) -> NearFacets:
        """Return some of the pairs."""
        return NearFacets(self.parts[rows], self.heights[rows], self.corners[rows])

    def furthest(
        self, shifts: Array, fastest: float, slack: float, enough: float = math.inf, along: Array | None = None
    ) -> Array:
        """Return how much is needed at least to bring facets together, (k,): over all planes between the two.

        Exact for shifts along one line: facets of the triangles' difference are parallel to one of them, or to a side
        of each.

        - `shifts` (m, 3): how far the first facet is displaced by a unit of each way to move it; none where it turns,
          too.
        - `fastest`: how far a unit displaces it at most, where there are no `shifts`.
        - `slack`: length up to which facets count as touching.
        - `enough`: of pairs that need as much it is not asked how much more.
        - `along` (3,), optional: the one line of all shifts: facets that it leads past each other need more than any
          amount.
        """
        line = np.zeros(3) if along is None else along
        return least_needed(self.corners, shifts, fastest, slack, enough, line, DEFAULT.tie)


def near_facets(
    one: Facets, points: Array, two: Facets, others: Array, band: float, *, along: Array | float = 1.0,
    crossing: bool = False,
) -> NearFacets:  # fmt: skip
    """Return the pairs of facets of two bodies that are not told apart by a distance.

    - `points`, `others` (n, 3): their points where they are, in one frame.
    - `band`: the distance. Facets that are further apart by boxes, or across the plane of one of them, are not near,
      nor are those that lie behind one of the planes by more.
    - `along` (3,), optional: how much of it counts along each axis of the frame, for boxes.
    - `crossing`: return those alone that meet, or come as near to it as rounding, and reach behind both planes by more.
    """
    corners = points[one.triangles], others[two.triangles]
    with np.errstate(invalid="ignore"):  # facets without area are left out: others hold their corners
        normals = [unit_normals(own) for own in corners]
    count = len(corners[0])
    low = np.concatenate([corners[0].min(axis=1) - band * along, corners[1].min(axis=1)])
    high = np.concatenate([corners[0].max(axis=1) + band * along, corners[1].max(axis=1)])
    found = [NearFacets(np.empty((0, 2), np.int64), np.empty((0, 2)), np.empty((0, 2, 3, 3)))]
    for first, second in overlapping(low, high, np.repeat([0, 1], [count, len(corners[1])])):
        pacing.check()
        i, j = np.minimum(first, second), np.maximum(first, second) - count
        heights = facing(*corners, *normals, i, j, band)
        close = np.isfinite(heights[:, 0])
        i, j, heights = i[close], j[close], heights[close]
        if crossing:
            deep = np.flatnonzero(heights.max(axis=1) < -band)
            deep = deep[not_separated(corners[0][i[deep]], corners[1][j[deep]])]
            i, j, heights = i[deep], j[deep], heights[deep]
        both = np.stack([corners[0][i], corners[1][j]], axis=1)
        found.append(NearFacets(np.column_stack([one.owners[i], two.owners[j]]), heights, both))
    return NearFacets(*(np.concatenate(own) for own in zip(*found, strict=True)))


@kernel
def facing(ones, others, normals, opposite, i, j, band):
    """Return how far triangles are before each other's planes at least, (k, 2): nan where one is beyond the band."""
    found = np.full((len(i), 2), np.nan)
    for k in range(len(i)):
        low, high = _across(others[j[k]], ones[i[k], 0], normals[i[k]])
        if low <= band and high >= -band:
            back, far = _across(ones[i[k]], others[j[k], 0], opposite[j[k]])
            if back <= band and far >= -band:
                found[k, 0], found[k, 1] = low, back
    return found


@step
def _across(corners, origin, normal):
    """Return from where to where corners are before a plane."""
    low, high = np.inf, -np.inf
    for k in range(3):
        height = 0.0
        for axis in range(3):
            height += (corners[k, axis] - origin[axis]) * normal[axis]
        low, high = min(low, height), max(high, height)
    return low, high


@kernel
def least_needed(corners, shifts, fastest, slack, enough, line, tie):
    """Return how much is needed to bring pairs of triangles together, (k,), see `NearFacets.furthest`."""
    found, sides, axis, origin = np.empty(len(corners)), np.empty((2, 3, 3)), np.empty(3), np.zeros(3)
    longest = np.empty(2)
    for pair in range(len(corners)):
        for own in range(2):
            longest[own] = 0.0
            for k in range(3):
                for x in range(3):
                    sides[own, k, x] = corners[pair, own, (k + 1) % 3, x] - corners[pair, own, k, x]
                longest[own] = max(longest[own], np.sqrt((sides[own, k] ** 2).sum()))
        flat = tie * longest[0] * longest[1]
        forward, back = 0.0, 0.0  # by what is needed, and the other way where one line leads both ways
        for k in range(17 if line.any() else 11):
            if k < 2:
                _crossed(sides[k, 0], sides[k, 1], axis)
            elif k < 11:
                _crossed(sides[0, (k - 2) // 3], sides[1, (k - 2) % 3], axis)
            else:
                _crossed(sides[(k - 11) // 3, (k - 11) % 3], line, axis)
            length = np.sqrt((axis**2).sum())
            if not length > flat:
                continue
            low1, high1 = _across(corners[pair, 0], origin, axis)
            low2, high2 = _across(corners[pair, 1], origin, axis)
            ahead, behind = (low2 - high1) / length, (low1 - high2) / length
            gap = max(ahead, behind)
            if not gap > slack:
                continue
            sense = (1.0 if ahead > behind else -1.0) / length
            speed, square = fastest, 0.0
            for m in range(len(shifts)):
                speed = sense * (shifts[m] * axis).sum()
                square += speed * speed
            if len(shifts) == 1:
                back = max(back, gap / max(-speed, SMALLEST))
            elif len(shifts) > 1:
                speed = np.sqrt(square)
            forward = max(forward, gap / max(speed, SMALLEST))
            if (min(forward, back) if len(shifts) == 1 else forward) >= enough:
                break
        found[pair] = min(forward, back) if len(shifts) == 1 else forward
    return found


@step
def _crossed(u, v, out):
    out[0] = u[1] * v[2] - u[2] * v[1]
    out[1] = u[2] * v[0] - u[0] * v[2]
    out[2] = u[0] * v[1] - u[1] * v[0]


def surface_distance(points: Array, triangles: Ints, others: Array, facing: Ints) -> float:
    """Return the distance of two surfaces by the collision library; 0 where they meet, infinite where one has no facet.

    `points`, `others` (n, 3). `triangles`, `facing` (t, 3): rows of the first, and of the second.
    """
    return nearest_of_surfaces(points, triangles, others, facing)[0]


def nearest_of_surfaces(points: Array, triangles: Ints, others: Array, facing: Ints) -> tuple[float, Array]:
    """Return the same, and where the two surfaces are that far apart, a point of each, (2, 3)."""
    import coal
    from scipy.spatial import cKDTree

    if not (len(triangles) and len(facing)):
        return math.inf, np.full((2, 3), np.nan)
    # only facets are of use that are no further from the other surface's box than any two corners are
    corners, opposite = points[triangles], others[facing]
    near = cKDTree(opposite[:, 0]).query(corners[:, 0])[0].min()
    near += DEFAULT.nominal * (near + np.abs(opposite).max())  # rounding must leave the nearest
    for _ in range(2):
        low, high = opposite.min(axis=(0, 1)) - near, opposite.max(axis=(0, 1)) + near
        own = ((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1)
        triangles, facing, corners, opposite = facing, triangles[own], opposite, corners[own]
        points, others = others, points
    here, result = coal.Transform3s(), coal.DistanceResult()
    one, two = _tree(points, triangles), _tree(others, facing)
    apart = float(coal.distance(one, here, two, here, coal.DistanceRequest(True), result))
    return max(0.0, apart), np.array([result.getNearestPoint1(), result.getNearestPoint2()])


def _tree(points: Array, triangles: Ints) -> Any:
    """Return the bounding volumes of triangles, as the collision library takes them."""
    import coal

    used, rows = np.unique(triangles, return_inverse=True)
    tree = coal.BVHModelOBBRSS()
    tree.beginModel(len(triangles), len(used))
    tree.addVertices(points[used])
    tree.addTriangles(rows.reshape(-1, 3))
    tree.endModel()
    return tree
