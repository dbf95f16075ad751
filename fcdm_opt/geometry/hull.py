"""The hull of one convex part: face loops and edges, coplanar facets merged."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.tolerances import DEFAULT

SMALLEST = 1e-50  # extent of a part: its volume stays above what floats can hold


class Hull(NamedTuple):
    """Combinatorics of a convex part.

    Attributes
    ----------
    used : list of int
        Rows of the body's vertices that are extreme; indices below count these.
    loops : list of tuples of int
        Vertices of each face, counter-clockwise seen from outside.
    edges : list of tuples of int
        `origin, end, left face, right face` of each edge.
    """

    used: list[int]
    loops: list[tuple[int, ...]]
    edges: list[tuple[int, int, int, int]]


def unit_normal(polygon: Array) -> Array:
    """Return the unit normal of a (nearly) planar polygon, by Newell's sum about its first vertex."""
    spokes = polygon[1:] - polygon[0]
    total = np.cross(spokes[:-1], spokes[1:]).sum(axis=0)
    return total / np.linalg.norm(total)


def convex_hull(points: Array, rows: list[int], key: str) -> Hull:
    """Return the hull of points, coplanar facets merged.

    Parameters
    ----------
    points : (n, 3) array
    rows : list of int
        Their rows among the body's vertices.
    key : str
        Names body and part in errors.
    """
    from scipy.spatial import ConvexHull, QhullError

    if len(points) < 4:
        raise InputError("a convex part needs at least 4 vertices", key=key, found=len(points))
    centred = points - points.mean(axis=0)
    size = np.abs(centred).max()
    if size <= SMALLEST:
        raise InputError("all points coincide", key=key, found=points[0].tolist())
    _, stretch, axes = np.linalg.svd(centred / size, full_matrices=False)
    if stretch[2] <= DEFAULT.flatness * stretch[0]:
        raise InputError("the points lie in one plane", key=key, found=f"thickness ratio {stretch[2] / stretch[0]:.2g}")
    axes[2] *= np.sign(np.linalg.det(axes))  # no mirror: it would turn the facets inside out
    try:  # hulls are affinely invariant: equal extents keep Qhull from calling thin parts flat
        hull = ConvexHull(centred / size @ (axes.T / stretch), qhull_options="Qt")
    except QhullError as reason:
        raise InputError(f"no convex hull: {str(reason).splitlines()[0]}", key=key) from reason
    triangles = [
        tuple(row if normal @ np.cross(*(hull.points[row[1:]] - hull.points[row[0]])) > 0 else row[::-1])
        for row, normal in zip(hull.simplices, hull.equations[:, :3], strict=True)
    ]
    loops = _merged_faces(centred / size, triangles, hull.neighbors)
    edges = _edges(loops)
    if edges is None:  # merging met a borderline case: the triangles of the hull are always consistent
        loops = [tuple(int(v) for v in triangle) for triangle in triangles]
        edges = _edges(loops)
        if edges is None:
            raise InputError("the hull of the points is not a closed surface", key=key)
    used = sorted({vertex for loop in loops for vertex in loop})
    place = {vertex: k for k, vertex in enumerate(used)}
    loops = [tuple(place[vertex] for vertex in loop) for loop in loops]
    edges = [(place[a], place[b], left, right) for a, b, left, right in edges]
    return Hull([rows[vertex] for vertex in used], loops, edges)


def _merged_faces(points: Array, triangles: list[tuple[Any, ...]], neighbours: Ints) -> list[tuple[int, ...]]:
    """Group triangles coplanar within `planarity`, largest first, and return each group's outline."""
    corners = points[np.array(triangles)]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(areas, axis=1)
    group = np.full(len(triangles), -1)
    loops = []
    for start in np.argsort(-sizes, kind="stable"):
        if group[start] >= 0:
            continue
        normal = areas[start] / sizes[start] if sizes[start] > 0 else areas[start]
        heights = np.abs((points - corners[start, 0]) @ normal)
        group[start], stack, members = start, [start], {int(v) for v in triangles[start]}
        while stack:
            for other in neighbours[stack.pop()]:
                if group[other] < 0 and heights[list(triangles[other])].max() <= DEFAULT.planarity:
                    group[other] = start
                    members.update(int(v) for v in triangles[other])
                    stack.append(other)
        loops.append(_outline(points, sorted(members), normal))
    return [loop for loop in loops if len(loop) >= 3]


def _outline(points: Array, members: list[int], normal: Array) -> tuple[int, ...]:
    """Return the strictly convex outline of coplanar points, counter-clockwise about `normal` (monotone chain)."""
    if len(members) == 3:
        a, b, c = members
        turn = np.cross(points[b] - points[a], points[c] - points[a]) @ normal
        return (a, b, c) if turn > 0 else (a, c, b) if turn < 0 else ()
    u = np.linalg.svd(normal[None])[2][1]
    plane = points[members] @ np.column_stack([u, np.cross(normal, u)])
    order = [members[k] for k in np.lexsort((plane[:, 1], plane[:, 0]))]
    flat = dict(zip(members, plane, strict=True))

    def chain(sequence: list[int]) -> list[int]:
        kept: list[int] = []
        for vertex in sequence:
            while len(kept) > 1:
                p, q = flat[kept[-1]] - flat[kept[-2]], flat[vertex] - flat[kept[-2]]
                if p[0] * q[1] - p[1] * q[0] > DEFAULT.planarity * np.hypot(*q):
                    break
                kept.pop()
            kept.append(vertex)
        return kept[:-1]

    return tuple(chain(order) + chain(order[::-1]))


def _edges(loops: list[tuple[int, ...]]) -> list[tuple[int, int, int, int]] | None:
    """Pair the half-edges of face loops; None unless they close to a sphere."""
    left = {(a, b): f for f, loop in enumerate(loops) for a, b in zip(loop, loop[1:] + loop[:1], strict=True)}
    if len(left) != sum(map(len, loops)) or any((b, a) not in left for a, b in left):
        return None
    edges = [(a, b, f, left[b, a]) for (a, b), f in left.items() if a < b]
    vertices = {vertex for loop in loops for vertex in loop}
    return edges if len(vertices) - len(edges) + len(loops) == 2 else None
