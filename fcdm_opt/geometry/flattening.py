"""Plane faces made plane again, where the few digits of a file bent them.

A slanted face of four or more corners is plane only as far as the digits go that its file holds, 7 in single
precision: taken as it is, it has folds of 1e-8, and its solid is not convex where it was drawn so. Corners are moved,
by no more than those digits leave open, onto the planes of their faces; one of up to three faces is then on them all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array, Flags, Ints, distinct_rows, groups_of
from fcdm_opt.geometry.measures import cross, norms, units
from fcdm_opt.geometry.polygons import Polygon, Sides, by_size, components, coplanar
from fcdm_opt.tolerances import DEFAULT

PLAIN = 3  # rounds in which points are moved onto planes as they are: enough where at most three meet at a point
ROUNDS = 12  # with those in which planes move, too; each squares what is left
MOST_REFLEX, NEAREST = 1000, 4  # reflex edges that sections are looked for through, and others that each is tried with
DAMPING = 1e-10  # of these: planes may say the same of a point


def flattened(vertices: Array, faces: Sequence[Polygon], slack: float, *, joined: bool) -> Array:
    """Return vertices with faces plane to double precision; equal points stay equal, and plane faces as they are.

    - `vertices` (n, 3).
    - `faces`: rows of `vertices`. One of four or more corners is drawn as plane, and made so if it is within `slack`.
    - `slack`: length by which rounding moved the vertices at most.
    - `joined`: whether triangles that lie in one plane within `slack` are one face, too.
    """
    first, same = distinct_rows(vertices)
    distinct = vertices[first]
    groups, triangles = list[Ints](), np.empty((0, 3), np.int64)
    for _, corners in by_size(faces):
        if corners.shape[1] == 3:
            triangles = same[corners]
        else:
            groups += list(map(np.unique, same[corners]))
    if joined:
        groups += _connected(distinct, triangles, slack) + sections(distinct, triangles, slack)
    groups = _coplanar_groups(distinct, [own for own in groups if len(own) > 3], slack)
    return settled(distinct, Incidences.of(groups), slack)[same] if groups else vertices


@dataclass(frozen=True, eq=False)
class Incidences:
    """Which points lie on which planes."""

    corner: Ints  # the number of a point, and of a plane that it lies on, ascending, (k,)
    plane: Ints
    fixing: Flags  # whether the point is one of those that the plane is fitted to, (k,)
    # points that stay where they are, and with them the planes that are fitted to these alone, (n,)
    held: Flags | None = None
    # (3, 1 or 2): orthonormal directions that span the normals which a plane may have; all others may have any
    spans: Mapping[int, Array] = field(default_factory=dict)

    @classmethod
    def of(cls, groups: Sequence[Ints]) -> Incidences:
        """Return those of groups of points that lie in one plane each."""
        corner, plane = np.concatenate(groups), np.repeat(np.arange(len(groups)), [len(own) for own in groups])
        return cls(corner, plane, np.ones(len(corner), bool))

    def fitted(self, points: Array) -> tuple[Array, Array]:
        """Return unit normals and levels of the planes, each nearest to the points that it is fitted to."""
        groups = np.split(self.corner[self.fixing], np.cumsum(np.bincount(self.plane[self.fixing]))[:-1])
        normals, levels, _ = _fitted(points, groups)
        for k, span in self.spans.items():
            middle = points[groups[k]].mean(axis=0)
            normals[k] = span @ np.linalg.svd((points[groups[k]] - middle) @ span)[2][-1]
            levels[k] = normals[k] @ middle
        return normals, levels


def settled(points: Array, lies: Incidences, slack: float) -> Array:
    """Return points moved onto their planes, by no more than what the slack explains; what is plane stays as it is."""
    # where at most three planes meet at each point these need not change; where more do, planes and points are moved
    # together, as little as they can be (Newton's method, least squares of least norm)
    place, enough = points.copy(), DEFAULT.normal * float(np.abs(points).max())
    free = np.ones(len(points), bool) if lies.held is None else ~lies.held
    normals, levels = lies.fitted(place)
    for step in range(ROUNDS):
        pacing.check()
        heights = (normals[lies.plane] * place[lies.corner]).sum(axis=1) - levels[lies.plane]
        off = (np.abs(heights) > enough) & free[lies.corner]
        if not off.any():
            break
        if step < PLAIN:
            bent = np.zeros(len(place), bool)
            bent[lies.corner[off]] = True
            rows = bent[lies.corner]
            place = onto_planes(place, lies.corner[rows], normals[lies.plane[rows]], -heights[rows])
        else:
            place = _both_moved(place, lies, normals, heights, free & np.isin(np.arange(len(place)), lies.corner[off]))
        normals, levels = lies.fitted(place)
    far = norms(place - points) > slack / DEFAULT.sharp
    place[far] = points[far]
    return place


def _both_moved(place: Array, lies: Incidences, normals: Array, heights: Array, bent: Flags) -> Array:
    """Return points after a step of Newton's method towards their planes, which are moved and turned with them."""
    from scipy.sparse import block_array, coo_array, eye_array
    from scipy.sparse.linalg import splu

    moving = np.zeros(len(place), bool)  # all corners of planes that a bent one lies on
    moving[lies.corner[np.isin(lies.plane, lies.plane[bent[lies.corner]])]] = True
    if lies.held is not None:
        moving &= ~lies.held
    rows = np.flatnonzero(np.isin(lies.plane, lies.plane[moving[lies.corner]]))
    corner, (planes, own) = lies.corner[rows], np.unique(lies.plane[rows], return_inverse=True)
    count, normal = np.bincount(own), normals[planes]
    middle = np.stack([np.bincount(own, x) for x in place[corner].T], axis=1) / count[:, None]
    spokes = place[corner] - middle[own]
    extent = np.sqrt(np.bincount(own, (spokes**2).sum(axis=1)) / count)
    one = units(cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)]))
    turns = np.stack([one, cross(normal, one)], axis=1) / extent[:, None, None]
    for k, plane in enumerate(planes.tolist()):
        if plane in lies.spans:
            turns[k] = turns[k] @ lies.spans[plane] @ lies.spans[plane].T
    still = np.zeros(len(place), bool) if lies.held is None else lies.held
    fixed = np.bincount(own, lies.fixing[rows] & ~still[corner]) == 0
    tilts = np.concatenate([(turns[own] * spokes[:, None]).sum(axis=2), np.ones((len(rows), 1))], axis=1)
    entries = np.concatenate([normal[own] * moving[corner, None], tilts * ~fixed[own, None]], axis=1)
    many = int(moving.sum())
    first = 3 * np.stack([np.where(moving, np.cumsum(moving) - 1, 0)[corner], many + own], axis=1)
    at = np.repeat(np.arange(len(rows)), 6), (first[:, :, None] + np.arange(3)).ravel()
    matrix = coo_array((entries.ravel(), at), shape=(len(rows), 3 * (many + len(planes)))).tocsr()
    identity, damped = eye_array(matrix.shape[1]), -DAMPING * eye_array(len(rows))
    both = block_array([[identity, matrix.T], [matrix, damped]]).tocsc()
    solved = splu(both, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    found = solved.solve(np.concatenate([np.zeros(matrix.shape[1]), -heights[rows]]))
    moved = place.copy()
    moved[moving] += found[: 3 * many].reshape(-1, 3)
    return moved


def onto_planes(points: Array, corner: Ints, normals: Array, misses: Array) -> Array:
    """Return points moved the shortest way onto all their planes, but for directions that these hardly fix.

    `points` (n, 3). `corner` (k,): the point that lies on a plane; several times the same one on several. `normals`,
    `misses` (k, 3) and (k,): of that plane, and how far it is from the point.
    """
    moved, own = np.unique(corner, return_inverse=True)
    grams, pulls = np.zeros((len(moved), 3, 3)), np.zeros((len(moved), 3))
    np.add.at(grams, own, normals[:, :, None] * normals[:, None])
    np.add.at(pulls, own, misses[:, None] * normals)
    squares, axes = np.linalg.eigh(grams)  # of singular values
    fixed = squares > DEFAULT.sharp**2 * squares[:, 2:]
    steps = (pulls[:, None] @ axes)[:, 0] * fixed / np.where(fixed, squares, 1.0)
    place = points.copy()
    place[moved] += (axes @ steps[:, :, None])[:, :, 0]
    return place


def _fitted(points: Array, groups: Sequence[Ints]) -> tuple[Array, Array, Array]:
    """Return unit normals and levels of the planes nearest to groups of points, and how far the points are off."""
    normals, levels, off = np.empty((len(groups), 3)), np.empty(len(groups)), np.empty(len(groups))
    for places, corners in by_size(groups):
        middle = points[corners].mean(axis=1)
        local = points[corners] - middle[:, None]
        normals[places] = np.linalg.svd(local, full_matrices=False)[2][:, 2]
        levels[places] = (normals[places] * middle).sum(axis=1)
        off[places] = np.abs((local * normals[places, None]).sum(axis=2)).max(axis=1)
    return normals, levels, off


def _coplanar_groups(points: Array, groups: list[Ints], slack: float) -> list[Ints]:
    """Leave out groups of points that lie in no plane within the slack, join those that lie in one; largest first."""
    groups = sorted(groups, key=lambda own: -float(np.ptp(points[own], axis=0).max()))
    normals, levels, off = _fitted(points, groups)
    near = np.flatnonzero(off <= 4 * slack)
    if not near.size:
        return []
    bend = 4 * float(off[near].max())  # exact files keep the finest steps
    normals, levels, groups = normals[near], levels[near], [groups[k] for k in near]
    joined = coplanar(points, groups, normals, levels, bend)
    return [np.unique(np.concatenate([groups[k] for k in own.tolist()])) for own in joined]


def _connected(points: Array, triangles: Ints, slack: float) -> list[Ints]:
    """Return the corners of each group of triangles that lie in one plane and are connected by edges of two."""
    if not len(triangles):
        return []
    sides = Sides.around(triangles.ravel(), 3)
    _, c, d = sides.sections(points, sides.pairs)
    # how far the lower triangle's corner is off the plane of the higher one, on the other side of the edge
    folds = norms(cross(c, d)) / np.maximum(np.maximum(norms(c), norms(d)), np.finfo(float).tiny)
    flat = (folds <= 4 * slack) & ((c * d).sum(axis=1) <= 0)
    return [np.unique(triangles[own]) for own in groups_of(components(sides.face[sides.pairs[flat]], len(triangles)))]


def sections(points: Array, triangles: Ints, slack: float) -> list[Ints]:
    """Return the corners of reflex edges that lie in one plane, a face's or not: there the solid is cut into parts."""
    if not len(triangles):
        return []
    sides = Sides.around(triangles.ravel(), 3)
    along, c, d = sides.sections(points, sides.pairs)
    reflex = (cross(c, d) * along).sum(axis=1) > 4 * slack * np.maximum(norms(c), norms(d))
    edges = np.column_stack([sides.origin, sides.end])[sides.pairs[reflex, 0]]
    if not 1 < len(edges) <= MOST_REFLEX:
        return []
    corners, groups = np.unique(edges), list[Ints]()
    free, (a, b) = np.ones((len(edges), len(edges)), bool), points[edges.T]
    distances = norms(a + b - (a + b)[:, None])
    for one, near in enumerate(np.argsort(distances, axis=1, kind="stable")[:, 1 : 1 + NEAREST].tolist()):
        for two in near:
            spokes = points[edges[[one, two]].ravel()] - a[one]
            normals = cross(spokes[1], spokes[2:])
            normal = normals[norms(normals).argmax()]
            size = float(norms(normal))
            if not free[one, two] or size <= slack * float(np.abs(spokes).max()):
                continue
            heights = np.abs((points[corners] - a[one]) @ normal) / size
            if np.abs(spokes @ normal).max() <= 4 * slack * size:
                own = corners[heights <= 4 * slack]
                on = np.isin(edges, own).all(axis=1)
                free[np.ix_(on, on)] = False
                groups.append(own)
    return groups
