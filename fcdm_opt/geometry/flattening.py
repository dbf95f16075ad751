"""Plane faces made plane again, where the few digits of a file bent them.

A slanted face of four or more corners is plane only as far as the digits go that its file holds, 7 in single
precision: taken as it is, it has folds of 1e-8, and its solid is not convex where it was drawn so. Corners are moved,
by no more than those digits leave open, onto the planes of their faces; one of up to three faces is then on them all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fcdm_opt.geometry.arrays import Array, Ints, distinct_rows
from fcdm_opt.geometry.measures import cross, norms
from fcdm_opt.geometry.polygons import Polygon, Sides, by_size, components, coplanar
from fcdm_opt.tolerances import DEFAULT

ROUNDS = 100  # two are enough unless more than three faces meet at a corner


def flattened(vertices: Array, faces: Sequence[Polygon], slack: float, *, joined: bool) -> Array:
    """Return vertices with faces plane to double precision; equal points stay equal, and plane faces as they are.

    Parameters
    ----------
    vertices : (n, 3) array
    faces : sequence of tuples of int
        Rows of `vertices`. One of four or more corners is drawn as plane, and made so if it is within `slack`.
    slack : float
        Length by which rounding moved the vertices at most.
    joined : bool
        Whether triangles that lie in one plane within `slack` are one face, too.
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
        groups += _connected(distinct, triangles, slack)
    groups = _together(distinct, [own for own in groups if len(own) > 3], slack)
    if not groups:
        return vertices
    place = distinct.copy()
    corner, owner = np.concatenate(groups), np.repeat(np.arange(len(groups)), [len(own) for own in groups])
    enough = DEFAULT.normal * float(np.abs(distinct).max())
    normals, levels, _ = _fitted(place, groups)
    for _ in range(ROUNDS):
        misses = levels[owner] - (normals[owner] * place[corner]).sum(axis=1)
        bent = np.zeros(len(place), bool)
        bent[corner[np.abs(misses) > enough]] = True
        rows = bent[corner]  # what is plane stays, while faces beside it are worked on
        if not rows.any():
            break
        place = onto_planes(place, corner[rows], normals[owner[rows]], misses[rows])
        again = np.unique(owner[rows])
        normals[again], levels[again], _ = _fitted(place, [groups[k] for k in again.tolist()])
    far = norms(place - distinct) > slack / DEFAULT.sharp
    place[far] = distinct[far]
    return place[same]


def onto_planes(points: Array, corner: Ints, normals: Array, misses: Array) -> Array:
    """Return points moved the shortest way onto all their planes, but for directions that these hardly fix.

    Parameters
    ----------
    points : (n, 3) array
    corner : (k,) int array
        The point that lies on a plane; several times the same one on several.
    normals, misses : (k, 3) and (k,) arrays
        Of that plane, and how far it is from the point.
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


def _together(points: Array, groups: list[Ints], slack: float) -> list[Ints]:
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
    group = components(sides.face[sides.pairs[flat]], len(triangles))
    order = np.argsort(group, kind="stable")
    return [np.unique(triangles[own]) for own in np.split(order, np.flatnonzero(np.diff(group[order])) + 1)]
