"""Corners of a triangulated hull that are none: within `Tolerances.planarity` of the hull of the others."""

from __future__ import annotations

import numpy as np

from fcdm_opt.geometry.arrays import SMALLEST, Array, Ints
from fcdm_opt.geometry.measures import units
from fcdm_opt.tolerances import DEFAULT


def needless(local: Array, triangles: Ints, normals: Array) -> Ints:
    """Return corners within `planarity` of the hull of the others, no two of them neighbours; late ones first."""
    count = len(local)
    origin, end = triangles.T.ravel(), triangles[:, [1, 2, 0]].T.ravel()
    sums = units(np.column_stack([np.bincount(origin, np.tile(n, 3), count) for n in normals.T]))
    # one plane across the mean normal proves nearly every corner: of all other points a neighbour is the highest
    steps = local[origin] - local[end]
    margin = np.full(count, np.inf)
    np.minimum.at(margin, origin, (sums[origin] * steps).sum(axis=1))
    np.minimum.at(margin, end, -(sums[end] * steps).sum(axis=1))
    doubtful = np.flatnonzero(margin <= DEFAULT.planarity)
    if not doubtful.size:
        return doubtful
    both = np.concatenate([np.column_stack([origin, end]), np.column_stack([end, origin])])
    both = both[np.argsort(both[:, 0], kind="stable")]
    first = np.searchsorted(both[:, 0], np.arange(count + 1))
    dropped = np.zeros(count, bool)
    for vertex in doubtful[::-1]:
        around = np.unique(both[first[vertex] : first[vertex + 1], 1])
        if not dropped[around].any() and _near_hull(local[around] - local[vertex]):
            dropped[vertex] = True
    return np.flatnonzero(dropped)


def _near_hull(points: Array) -> bool:
    """Tell whether the origin lies within `planarity` of the hull of points.

    Wolfe's least-norm point, left as soon as a point of the hull is near enough or a plane keeps the hull away.
    """
    first = int((points**2).sum(axis=1).argmin())
    chosen, weights, nearest = [first], np.ones(1), points[first]
    tried = np.arange(len(points)) == first
    for _ in range(4 * len(points)):
        if np.linalg.norm(weights @ points[chosen]) <= DEFAULT.planarity:
            return True
        length = max(np.sqrt(nearest @ nearest), SMALLEST)
        heights = points @ nearest / length
        lowest = int(np.where(tried, np.inf, heights).argmin())
        if heights.min() > DEFAULT.planarity or tried[lowest] or heights[lowest] >= length:
            return False
        members, *place = _least_norm(points, [*chosen, lowest], np.append(weights, 0.0))
        tried[lowest] = True
        if lowest in members:  # else rounding chose a point that is no help
            chosen, (weights, nearest) = members, place
            tried[:] = False
            tried[chosen] = True
    return False


def _least_norm(points: Array, chosen: list[int], weights: Array) -> tuple[list[int], Array, Array]:
    """Return the members, weights and place of the least-norm point of a corral's hull, from weights in it."""
    while True:
        corral = points[chosen]
        spans = (corral[1:] - corral[0]).T
        tail = np.linalg.lstsq(spans, -corral[0])[0]
        aim = np.concatenate([[1 - tail.sum()], tail])
        if aim.min() > 0:
            break
        step = np.where(aim <= 0, weights / np.maximum(weights - aim, SMALLEST), np.inf)
        weights = weights + step.min() * (aim - weights)
        gone = int(step.argmin())
        chosen, weights = [*chosen[:gone], *chosen[gone + 1 :]], np.delete(weights, gone)
    nearest, basis = corral[0], np.linalg.qr(spans)[0]
    for _ in range(2):  # again: what rounding left along the corral would tilt a short vector
        nearest = nearest - basis @ (basis.T @ nearest)
    return chosen, aim, nearest
