"""The surface of a solid as convex parts: a pyramid under each of its faces, as deep as the solid lets it be.

All of the surface belongs to them and nothing beyond it, so two solids touch where their pyramids do; what they leave
out is inside the solid. Their number grows with that of the faces, not with that of the reflex edges' cuts.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from fcdm_opt.compiling import kernel, step
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.crossings import overlapping
from fcdm_opt.geometry.hull import Hull, convex_faces, flat_groups
from fcdm_opt.geometry.measures import norms, unit_normals
from fcdm_opt.geometry.polygons import Sides
from fcdm_opt.geometry.surface import Surface
from fcdm_opt.tolerances import DEFAULT

ROUNDING = 4.0 * DEFAULT.planarity  # of heights, in units of the solid's size
SHARE = 0.5  # of its longest side that a pyramid is deep at first
INSIDE = 15.0 / 16.0  # of the depth that just fits: an apex on a face across would be touched as a corner of it
SHALLOWEST = 2.0**-40  # of the size: below this none is believed


class Pyramids(NamedTuple):
    """Pyramids under the faces of a surface."""

    points: Array  # the mesh's vertices, then the apexes, (n + k, 3)
    # of each pyramid: the corners of its base, counter-clockwise seen from outside the solid, and the apex last
    hulls: list[Hull]
    surface: Surface  # true faces and edges
    owners: Ints  # the face of the surface that each base is on, (k,)


def pyramids(vertices: Array, triangles: Ints, name: str, faces: Ints | None = None) -> Pyramids:
    """Return the pyramids under a closed outward surface, (t, 3); `InputError` where it is thinner than rounding."""
    # `faces` (t,): of each triangle, where they are not those in one plane
    local, sides = _local(vertices, triangles)[0], Sides.around(triangles.ravel(), 3)
    groups, corners, sizes, _ = convex_faces(local, triangles, sides)
    starts = np.concatenate([[0], np.cumsum(sizes)])
    points = np.vstack([vertices, apexes(vertices, triangles, groups, corners, sizes, name)])
    surface = Surface.of(vertices, triangles, flat_groups(local, triangles, sides) if faces is None else faces)
    hulls = [
        Hull(np.append(corners[start:end], len(vertices) + k), *pyramid_shape(end - start))
        for k, (start, end) in enumerate(zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True))
    ]
    owners = np.empty(len(sizes), np.int64)
    owners[groups] = surface.owners
    return Pyramids(points, hulls, surface, owners)


def _local(vertices: Array, triangles: Ints) -> tuple[Array, Array, float]:
    """Return the vertices from one of those used, relative to their extent; that one, and the extent."""
    used = np.unique(triangles)
    origin, size = vertices[used[0]], float(np.ptp(vertices[used], axis=0).max())
    return (vertices - origin) / size, origin, size


def apexes(vertices: Array, triangles: Ints, groups: Ints, corners: Ints, sizes: Ints, name: str) -> Array:
    """Return the apexes of pyramids under a closed surface, (k, 3): as deep as the solid lets them be, and inside it.

    - `vertices` (n, 3).
    - `triangles` (t, 3): outward.
    - `groups` (t,): the base that each triangle is of.
    - `corners`, `sizes`: rows of the corners of all bases, one after the other, and how many each has.
    - `name`: of the body.

    Raises `InputError` where none fits under a face, as the solid there is thinner than rounding.
    """
    local, origin, size = _local(vertices, triangles)
    starts = np.concatenate([[0], np.cumsum(sizes)])
    middles = np.add.reduceat(local[corners], starts[:-1]) / sizes[:, None]
    normals = np.empty((len(sizes), 3))
    for count in np.unique(sizes):
        own = np.flatnonzero(sizes == count)
        normals[own] = unit_normals(local[corners[starts[own][:, None] + np.arange(count)]])
    after = np.arange(1, len(corners) + 1)
    after[starts[1:] - 1] = starts[:-1]
    longest = np.maximum.reduceat(norms(local[corners[after]] - local[corners]), starts[:-1])
    depths = SHARE * longest
    tips = middles - depths[:, None] * normals
    low = np.minimum(np.minimum.reduceat(local[corners], starts[:-1]), tips)
    high = np.maximum(np.maximum.reduceat(local[corners], starts[:-1]), tips)
    first, others = _near(low, high, local[triangles], groups)
    fit(local[corners], starts, middles, normals, local[triangles], first, others, depths)
    thin = np.flatnonzero(depths < SHALLOWEST)
    if thin.size:
        found = (vertices[corners[starts[thin[0]]]]).tolist()
        raise InputError("the solid is thinner than rounding under a face", key=f"body '{name}'", found=found)
    return np.asarray(origin + size * (middles - INSIDE * depths[:, None] * normals))


def _near(low: Array, high: Array, corners: Array, groups: Ints) -> tuple[Ints, Ints]:
    """Return for each box the triangles of other groups that may reach into it: where its own start, and all rows."""
    count = len(low)
    boxes = np.concatenate([low, corners.min(axis=1)]), np.concatenate([high, corners.max(axis=1)])
    found = [np.empty((2, 0), np.int64)]
    for one, two in overlapping(boxes[0] - ROUNDING, boxes[1] + ROUNDING, np.arange(len(boxes[0]))):
        box, row = np.minimum(one, two), np.maximum(one, two) - count
        own = (box < count) & (row >= 0)
        own[own] = groups[row[own]] != box[own]
        found.append(np.stack([box[own], row[own]]))
    box, row = np.concatenate(found, axis=1)
    order = np.argsort(box, kind="stable")
    return np.searchsorted(box[order], np.arange(count + 1)), row[order]


@cache
def pyramid_shape(count: int) -> tuple[tuple[tuple[int, ...], ...], Ints]:
    """Return loops and edges of a pyramid over so many corners; the base is face 0, side k at the base's edge k."""
    around = list(range(count))
    loops = (tuple(around), *(((k + 1) % count, k, count) for k in around))
    base = [(k, (k + 1) % count, 0, 1 + k) for k in around]
    sides = [(k, count, 1 + k, 1 + (k - 1) % count) for k in around]
    return loops, np.array(base + sides, np.int64)


@kernel
def fit(corners, starts, middles, normals, triangles, first, others, depths):
    """Halve depths until no triangle of those near a pyramid reaches into it."""
    for k in range(len(depths)):
        base = corners[starts[k] : starts[k + 1]]
        apex = np.empty(3)
        for m in range(first[k], first[k + 1]):
            triangle = triangles[others[m]]
            while depths[k] >= SHALLOWEST:
                for x in range(3):
                    apex[x] = middles[k, x] - depths[k] * normals[k, x]
                if _outside(base, apex, normals[k], triangle):
                    break
                depths[k] *= 0.5


@step
def _outside(base, apex, normal, triangle):
    """Tell whether a plane keeps a triangle from reaching into a pyramid."""
    if _apart(base, apex, triangle, normal[0], normal[1], normal[2]):
        return True
    count = len(base)
    a = triangle[1, 0] - triangle[0, 0], triangle[1, 1] - triangle[0, 1], triangle[1, 2] - triangle[0, 2]
    b = triangle[2, 0] - triangle[0, 0], triangle[2, 1] - triangle[0, 1], triangle[2, 2] - triangle[0, 2]
    c = triangle[2, 0] - triangle[1, 0], triangle[2, 1] - triangle[1, 1], triangle[2, 2] - triangle[1, 2]
    n = _product(a, b)
    if _apart(base, apex, triangle, n[0], n[1], n[2]) or _apart(base, apex, triangle, -n[0], -n[1], -n[2]):
        return True
    for k in range(count):
        p, q = base[k], base[(k + 1) % count]
        u = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        v = apex[0] - p[0], apex[1] - p[1], apex[2] - p[2]
        n = _product(v, u)
        if _apart(base, apex, triangle, n[0], n[1], n[2]):
            return True
        for side in range(3):
            edge = a if side == 0 else (b if side == 1 else c)
            n = _product(u, edge)
            if _apart(base, apex, triangle, n[0], n[1], n[2]) or _apart(base, apex, triangle, -n[0], -n[1], -n[2]):
                return True
            n = _product(v, edge)
            if _apart(base, apex, triangle, n[0], n[1], n[2]) or _apart(base, apex, triangle, -n[0], -n[1], -n[2]):
                return True
    return False


@step
def _product(u, v):
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@step
def _apart(base, apex, triangle, x, y, z):
    """Tell whether a triangle is not below the highest point of a pyramid along a direction."""
    length = np.sqrt(x * x + y * y + z * z)
    if not length > 0.0:
        return False
    high = x * apex[0] + y * apex[1] + z * apex[2]
    for k in range(len(base)):
        high = max(high, x * base[k, 0] + y * base[k, 1] + z * base[k, 2])
    for k in range(3):
        if x * triangle[k, 0] + y * triangle[k, 1] + z * triangle[k, 2] < high - ROUNDING * length:
            return False
    return True
