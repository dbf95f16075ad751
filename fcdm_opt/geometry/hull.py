"""The hull of one convex part: face loops and edges, coplanar facets merged.

Qhull gives triangles. A corner within `Tolerances.planarity` of the hull of the others is dropped and the hull made
again; then triangles that lie in one plane are joined, and the outlines of the groups are the faces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import SMALLEST, Array, Flags, Ints, distinct_rows
from fcdm_opt.geometry.measures import cross, following, nearest_mixture, norms, units
from fcdm_opt.geometry.polygons import Sides, components
from fcdm_opt.tolerances import DEFAULT


class Hull(NamedTuple):
    """Combinatorics of a convex part."""

    used: Ints  # (n,): rows of the body's vertices that are extreme, in the order given; indices below count these
    # vertices of each face, counter-clockwise seen from outside, the first given first
    loops: tuple[tuple[int, ...], ...]
    edges: Ints  # `origin, end, left face, right face` of each edge, (m, 4)


def convex_hull(points: Array, rows: Ints, key: str) -> Hull:
    """Return the hull of points, coplanar facets merged.

    `points` (n, 3). `rows` (n,): their rows among the body's vertices. `key`: names body and part in errors. Raises
    `InputError` for points that do not span a volume; names the vertices that show it.
    """
    if len(points) < 4:
        raise InputError("a convex part needs at least 4 vertices", key=key, found=len(points))
    centred = points - points[0]  # exact far from the origin, where a mean is not
    centred -= centred.mean(axis=0)
    size = np.abs(centred).max()
    if size <= SMALLEST:
        raise _flat(points, rows, key, "no extent")
    local = centred / size
    _, stretch, axes = np.linalg.svd(local, full_matrices=False)
    if stretch[2] <= DEFAULT.flatness * stretch[0]:
        raise _flat(points, rows, key, f"thickness ratio {stretch[2] / stretch[0]:.2g}")
    # hulls are affinely invariant: equal extents keep Qhull from calling thin parts flat
    frame = axes.T * (stretch[0] / stretch)
    triangles, normals = _triangulated(local, np.arange(len(points)), frame, key)
    if np.bincount(triangles.ravel(), minlength=len(points)).min() == 0:
        first, same = distinct_rows(points)
        triangles = first[same][triangles]
    while (dropped := _needless(local, triangles, normals)).size:
        triangles, normals = _triangulated(local, np.setdiff1d(triangles, dropped), frame, key)
    corners, sizes = _faces(local, triangles, key)
    used = np.flatnonzero(np.bincount(corners))
    place = np.zeros(len(points), np.int64)
    place[used] = np.arange(len(used))
    corners = place[corners]
    return Hull(rows[used], _tuples(corners, sizes), _edges(corners, sizes, key))


def _flat(points: Array, rows: Ints, key: str, found: str) -> InputError:
    """Say why points span no volume: too few are distinct, or the line or plane that they lie in."""
    first, same = distinct_rows(points)
    owners = first[same]
    distinct, names = np.unique(owners), rows + 1
    again = np.flatnonzero(owners != np.arange(len(points)))
    if len(distinct) < 4 and again.size:
        count = f"only {len(distinct)} distinct points are left" if len(distinct) > 1 else "all points coincide"
        what = f"{count}: vertex {names[again[0]]} repeats vertex {names[owners[again[0]]]}"
        return InputError(what, key=key, found=points[again[0]].tolist(), allowed="4 or more points not in one plane")
    spokes = points - points[0]
    lengths = np.linalg.norm(spokes, axis=1)
    if lengths.max() <= SMALLEST:
        return InputError("all points coincide up to rounding", key=key, found=found)
    second = int(lengths.argmax())
    along = spokes[second] / lengths[second]
    off = np.linalg.norm(spokes - (spokes @ along)[:, None] * along, axis=1)
    third = int(off.argmax())
    if off[third] <= DEFAULT.flatness * lengths[second]:
        what = f"the points lie on one line, through vertices {names[0]} and {names[second]}"
    else:
        one, two = sorted((second, third))
        what = f"the points lie in one plane, through vertices {names[0]}, {names[one]} and {names[two]}"
    return InputError(what, key=key, found=found)


def _triangulated(local: Array, kept: Ints, frame: Array, key: str) -> tuple[Ints, Array]:
    """Return Qhull's triangles, counter-clockwise seen from outside, and the outward unit normals of their facets."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(local[kept] @ frame, qhull_options="Qt")
    except (QhullError, ValueError) as reason:
        apart = kept[_apart(local[kept])]
        if 4 <= len(apart) < len(kept):
            return _triangulated(local, apart, frame, key)
        raise InputError(f"no convex hull: {str(reason).splitlines()[0]}", key=key) from reason
    normals = units(hull.equations[:, :3] @ frame.T)
    triangles = kept[hull.simplices]
    a, b, c = local[triangles.T]
    turned = (cross(b - a, c - a) * normals).sum(axis=1) < 0
    triangles[turned] = triangles[turned, ::-1]
    return triangles, normals


def _apart(points: Array) -> Ints:
    """Return points further than about `planarity` from each other, of clusters the first: Qhull may fail on them."""
    from scipy.spatial import cKDTree

    first = np.unique(np.round(2 * points / DEFAULT.planarity), axis=0, return_index=True)[1]
    first.sort()
    dropped = np.zeros(len(first), bool)
    for one, two in sorted(cKDTree(points[first]).query_pairs(DEFAULT.planarity)):
        dropped[two] |= not dropped[one]
    return first[~dropped]


def _closed(corners: Ints, sizes: Ints, key: str) -> Sides:
    """Return the sides of polygons, corners one after another; raise unless they close to a surface."""
    sides = Sides.around(corners, sizes)
    if (sides.counts != 2).any() or sides.unequal.size:
        raise InputError("the hull of the points is not a closed surface", key=key)
    return sides


def _faces(local: Array, triangles: Ints, key: str) -> tuple[Ints, Ints]:
    """Join triangles in one plane; return the faces' corners one after another, and how many each has."""
    # the face of the largest triangle comes first
    sides = _closed(triangles.ravel(), np.full(len(triangles), 3), key)
    _, corners, counts, whole = convex_faces(local, triangles, sides)
    if not whole:
        raise InputError("the hull of the points is not a closed surface", key=key)
    return corners, counts


def flat_groups(local: Array, triangles: Ints, sides: Sides) -> Ints:
    """Return for each triangle of a surface the first of those that lie in one plane with it, one beside the other."""
    # `local` are its corners in units of its size
    along, c, d = sides.sections(local, sides.pairs)
    fold = np.abs((along * cross(c, d)).sum(axis=1))  # both within `planarity` of the plane of one of them
    joined = (fold <= DEFAULT.planarity * np.maximum(norms(c), norms(d))) & ((c * d).sum(axis=1) < 0)
    flat = sides.pairs[joined] // 3
    first, group = np.unique(components(flat, len(triangles)), return_index=True, return_inverse=True)[1:]
    group = first[group]
    bent = _bent(local[triangles], _areas(local[triangles]), group)
    group[bent] = np.flatnonzero(bent)
    return group


def convex_faces(local: Array, triangles: Ints, sides: Sides) -> tuple[Ints, Ints, Ints, bool]:
    """Join triangles of a surface in one plane where that gives a convex polygon, that of the largest triangle first.

    The polygon that each triangle is of, (t,), the polygons' corners one after another, how many each has, and whether
    every polygon's outline is one.
    """
    group, areas = flat_groups(local, triangles, sides), _areas(local[triangles])
    order = np.argsort(-np.sqrt((areas**2).sum(axis=1)), kind="stable")
    rank = np.empty(len(triangles), np.int64)
    rank[order] = np.arange(len(order))
    if (group == np.arange(len(group))).all():
        turn = (triangles.argmin(axis=1)[:, None] + np.arange(3)) % 3
        return rank, np.take_along_axis(triangles, turn, axis=1)[order].ravel(), np.full(len(triangles), 3), True
    while True:
        lead = np.full(len(triangles), len(triangles))
        np.minimum.at(lead, group, rank)
        _, face = np.unique(lead[group], return_inverse=True)
        corners, counts, wrong = _loops(local, sides, face, areas)
        split: Flags = wrong[face].astype(bool) & (np.bincount(face)[face] > 1)
        if not split.any():
            return face, corners, counts, not wrong.any()
        group[split] = np.flatnonzero(split)


def _areas(corners: Array) -> Array:
    """Return twice the area vectors of triangles, (t, 3, 3)."""
    # from the longest side and the height on it, so that even a sliver's lies across its length
    sides = following(corners) - corners
    lengths = (sides**2).sum(axis=2)
    longest, rows = lengths.argmax(axis=1), np.arange(len(corners))
    side, other = sides[rows, longest], sides[rows, longest - 2]
    across: Array = other - ((other * side).sum(axis=1) / lengths[rows, longest])[:, None] * side
    return cross(side, across)


def _bent(corners: Array, areas: Array, group: Ints) -> Flags:
    """Tell which triangles are of a group with a corner further than `planarity` from its mean plane: smooth ones."""
    count = len(group)
    normals = units(np.column_stack([np.bincount(group, x, count) for x in areas.T]))
    heights = (corners * normals[group][:, None]).sum(axis=2)
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(low, group, heights.min(axis=1))
    np.maximum.at(high, group, heights.max(axis=1))
    return (high - low > 2 * DEFAULT.planarity)[group]


def _loops(local: Array, sides: Sides, face: Ints, areas: Array) -> tuple[Ints, Ints, Array]:
    """Return the outlines of groups of triangles (corners, counts), and which of them are no convex polygon."""
    twin = np.full(len(sides.origin), -1, np.int64)
    twin[sides.pairs[:, 0]], twin[sides.pairs[:, 1]] = sides.pairs[:, 1], sides.pairs[:, 0]
    own = face[sides.face]
    rim = np.flatnonzero((own != own[twin]) | (twin < 0))
    count = int(face.max()) + 1
    rim = rim[np.lexsort((sides.origin[rim], own[rim]))]
    own, origin, end = own[rim], sides.origin[rim], sides.end[rim]
    wrong = np.zeros(count, bool)
    wrong[own[np.bincount(origin)[origin] < 3]] = True  # a corner between two faces only: they are bent there
    name = own * len(local) + origin
    wrong[own[1:][name[1:] == name[:-1]]] = True  # an outline that meets itself
    after = np.searchsorted(name, own * len(local) + end)
    # steps from the first side of each face, by doubling; what never gets there is a second outline
    starts = np.concatenate([[True], own[1:] != own[:-1]])
    before = np.arange(len(rim))
    before[after] = np.arange(len(rim))
    before[starts] = np.flatnonzero(starts)
    steps = (~starts).astype(np.int64)
    sizes = np.bincount(own, minlength=count)
    for _ in range(int(sizes.max()).bit_length()):
        steps += steps[before]
        before = before[before]
    wrong[own[~starts[before]]] = True
    normals = np.column_stack([np.bincount(face, x, count) for x in areas.T])
    turns = cross(local[end] - local[origin], local[end[after]] - local[end])
    wrong[own[(turns * normals[own]).sum(axis=1) <= 0]] = True
    return origin[np.lexsort((steps, own))], sizes, wrong


def _edges(corners: Ints, sizes: Ints, key: str) -> Ints:
    """Return `origin, end, left face, right face` of each edge, by left face and place in its loop."""
    sides = _closed(corners, sizes, key)
    if int(corners.max()) + 1 - len(sides.pairs) + len(sizes) != 2:
        raise InputError("the hull of the points is not a closed surface", key=key)
    up, down = sides.pairs[np.argsort(sides.pairs[:, 0])].T
    return np.column_stack([sides.origin[up], sides.end[up], sides.face[up], sides.face[down]])


def _tuples(corners: Ints, sizes: Ints) -> tuple[tuple[int, ...], ...]:
    if (sizes == 3).all():
        return tuple(map(tuple, corners.reshape(-1, 3).tolist()))
    flat, ends = corners.tolist(), np.cumsum(sizes).tolist()
    return tuple(tuple(flat[end - size : end]) for end, size in zip(ends, sizes.tolist(), strict=True))


def _needless(local: Array, triangles: Ints, normals: Array) -> Ints:
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
        if not dropped[around].any():  # it is no corner where it lies within `planarity` of the hull of those around
            spokes = local[around] - local[vertex]
            nearest = nearest_mixture(spokes / norms(spokes).max()) @ spokes
            dropped[vertex] = norms(nearest) <= DEFAULT.planarity
    return np.flatnonzero(dropped)
