"""The facets of bodies as triangles, and which convex parts of two bodies have some that are near each other."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from fcdm_opt.geometry.arrays import SMALLEST, Array, Flags, Ints, distinct_rows
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.crossings import not_separated, overlapping
from fcdm_opt.geometry.measures import cross, norms, unit_normals
from fcdm_opt.geometry.polygons import components, fans
from fcdm_opt.tolerances import DEFAULT

CORNERS = 8  # of each closed surface that are listed


class Facets:
    """The facets of a body's parts: of parts that are its surface alone the bases, of others all.

    Attributes
    ----------
    points : (n, 3) array
        From the seed.
    triangles : (t, 3) int array
        Rows of the points, counter-clockwise seen from outside.
    owners : (t,) int array
        The part that each is of.
    """

    def __init__(self, body: Body) -> None:
        loops = [part.loops[:1] if body.hollow else part.loops for part in body.parts]
        starts = np.cumsum([0, *(len(part.vertices) for part in body.parts)])
        self.points = np.concatenate([part.vertices for part in body.parts]) - body.seed
        self.triangles = np.concatenate([start + fans(own) for start, own in zip(starts.tolist(), loops, strict=False)])
        self.owners = np.repeat(np.arange(len(loops)), [sum(len(loop) - 2 for loop in own) for own in loops])

    @cached_property
    def shells(self) -> list[Ints]:
        """Rows of some corners of each closed surface, those at its ends along the axes too."""
        used = np.unique(self.triangles)
        same = distinct_rows(self.points[used])[1]
        place = np.zeros(len(self.points), np.int64)
        place[used] = same
        corners = place[self.triangles]
        group = components(np.concatenate([corners[:, :2], corners[:, 1:]]), int(same.max()) + 1)[same]
        found = []
        for own in (used[group == k] for k in range(group.max() + 1)):
            ends = [place(self.points[own], axis=0) for place in (np.argmin, np.argmax)]
            found.append(np.unique(np.concatenate([own[:: max(1, len(own) // CORNERS)], own[np.concatenate(ends)]])))
        return found


_KNOWN: WeakKeyDictionary[Body, Facets] = WeakKeyDictionary()


def facets_of(body: Body) -> Facets:
    """Return the facets of a body, worked out once."""
    found = _KNOWN.get(body)
    if found is None:
        found = _KNOWN[body] = Facets(body)
    return found


class NearFacets(NamedTuple):
    """Pairs of facets that may be within a distance of each other.

    Attributes
    ----------
    parts : (k, 2) int array
        The part of either body that they are of.
    heights : (k, 2) array
        How far the second is before the plane of the first, and the first before that of the second, at least;
        negative where it reaches through the plane.
    corners : (k, 2, 3, 3) array
        Of both triangles.
    """

    parts: Ints
    heights: Array
    corners: Array

    def some(self, rows: Flags) -> NearFacets:
        """Return some of the pairs."""
        return NearFacets(self.parts[rows], self.heights[rows], self.corners[rows])

    def furthest(
        self, rates: Callable[[Array], Array], slack: float, enough: float = math.inf, along: Array | None = None
    ) -> Array:
        """Return how much is needed at least to bring facets together, (k,): over all planes between the two.

        Exact for shifts along one line: facets of the triangles' difference are parallel to one of them, or to a side
        of each.

        Parameters
        ----------
        rates : callable
            Tells how fast the first facet moves along unit vectors, (m, 3), in each of some ways to move, (m, ways).
        slack : float
            Length up to which facets count as touching.
        enough : float
            Of pairs that need as much it is not asked how much more.
        along : (3,) array, optional
            The one line of all shifts: facets that it leads past each other need more than any amount.
        """
        one, two = self.corners[:, 0], self.corners[:, 1]
        sides = [np.roll(own, -1, axis=1) - own for own in (one, two)]
        axes = [cross(own[:, 0], own[:, 1]) for own in sides]
        axes += [cross(sides[0][:, i], sides[1][:, j]) for i, j in np.ndindex(3, 3)]
        if along is not None:
            axes += [cross(own[:, k], np.tile(along, (len(own), 1))) for own in sides for k in range(3)]
        flat = DEFAULT.tie * norms(sides[0]).max(axis=1) * norms(sides[1]).max(axis=1)
        needed, left = np.zeros((len(one), rates(np.empty((0, 3))).shape[1])), np.arange(len(one))
        for axis in axes:
            n = axis[left]
            lengths = norms(n)
            n = n / np.where(lengths > 0.0, lengths, 1.0)[:, None]
            here, there = ((own[left] * n[:, None]).sum(axis=2) for own in (one, two))
            ahead, behind = there.min(axis=1) - here.max(axis=1), here.min(axis=1) - there.max(axis=1)
            gap = np.maximum(ahead, behind)
            apart = (gap > slack) & (lengths > flat[left])
            fast = np.maximum(rates(np.where((ahead > behind)[:, None], n, -n)[apart]), SMALLEST)
            needed[left[apart]] = np.maximum(needed[left[apart]], gap[apart, None] / fast)
            left = left[needed[left].min(axis=1) < enough]
        return np.asarray(needed.min(axis=1))


def near_facets(
    one: Facets, points: Array, two: Facets, others: Array, band: float, *, crossing: bool = False
) -> NearFacets:
    """Return the pairs of facets of two bodies that are not told apart by a distance.

    Parameters
    ----------
    one, two : Facets
    points, others : (n, 3) arrays
        Their points where they are, in one frame.
    band : float
        The distance. Facets that are further apart by boxes, or across the plane of one of them, are not near, nor
        are those that lie behind one of the planes by more.
    crossing : bool
        Return those alone that meet, or come as near to it as rounding, and reach behind both planes by more.
    """
    corners = points[one.triangles], others[two.triangles]
    with np.errstate(invalid="ignore"):  # facets without area are left out: others hold their corners
        normals = [unit_normals(own) for own in corners]
    count = len(corners[0])
    low = np.concatenate([corners[0].min(axis=1) - band, corners[1].min(axis=1)])
    high = np.concatenate([corners[0].max(axis=1) + band, corners[1].max(axis=1)])
    found = [NearFacets(np.empty((0, 2), np.int64), np.empty((0, 2)), np.empty((0, 2, 3, 3)))]
    for first, second in overlapping(low, high, np.repeat([0, 1], [count, len(corners[1])])):
        rows = np.column_stack([np.minimum(first, second), np.maximum(first, second) - count])
        heights = np.empty((2, len(rows)))
        for own in (0, 1):  # the other across its plane
            at, other = rows[:, own], rows[:, 1 - own]
            away = corners[1 - own][other] - corners[own][at][:, :1]
            levels = (away * normals[own][at][:, None]).sum(axis=2)
            heights[own, : len(rows)] = levels.min(axis=1)
            close = (levels.min(axis=1) <= band) & (levels.max(axis=1) >= -band)
            rows, heights = rows[close], heights[:, close]
        if crossing:
            deep = heights.max(axis=0) < -band
            rows, heights = rows[deep], heights[:, deep]
            left = not_separated(corners[0][rows[:, 0]], corners[1][rows[:, 1]])
            rows, heights = rows[left], heights[:, left]
        i, j = rows.T
        both = np.stack([corners[0][i], corners[1][j]], axis=1)
        found.append(NearFacets(np.column_stack([one.owners[i], two.owners[j]]), heights.T, both))
    return NearFacets(*(np.concatenate(own) for own in zip(*found, strict=True)))


def surface_distance(points: Array, triangles: Ints, others: Array, facing: Ints) -> float:
    """Return the distance of two surfaces by the collision library; 0 where they meet, infinite where one has no facet.

    Parameters
    ----------
    points, others : (n, 3) arrays
    triangles, facing : (t, 3) int arrays
        Rows of the first, and of the second.
    """
    import coal
    from scipy.spatial import cKDTree

    if not (len(triangles) and len(facing)):
        return math.inf
    # only facets are of use that are no further from the other surface's box than any two corners are
    corners, opposite = points[triangles], others[facing]
    near = cKDTree(opposite[:, 0]).query(corners[:, 0])[0].min()
    for _ in range(2):
        low, high = opposite.min(axis=(0, 1)) - near, opposite.max(axis=(0, 1)) + near
        own = ((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1)
        triangles, facing, corners, opposite = facing, triangles[own], opposite, corners[own]
        points, others = others, points
    here, result = coal.Transform3s(), coal.DistanceResult()
    one, two = _tree(points, triangles), _tree(others, facing)
    return max(0.0, float(coal.distance(one, here, two, here, coal.DistanceRequest(), result)))


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
