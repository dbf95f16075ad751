"""Closed surfaces that overlap, touch or are folded, as exports have them, made the surface of one solid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array, Ints, distinct_rows
from fcdm_opt.geometry.crossings import overlapping
from fcdm_opt.geometry.measures import volume_and_centroid
from fcdm_opt.geometry.polygons import distances
from fcdm_opt.tolerances import DEFAULT


class JoinedShells(NamedTuple):
    """The surface of one solid, of surfaces that were none."""

    points: Array  # (n, 3)
    # None where the solids only touch, along lines and at points: their surfaces are that of the union, (t, 3)
    triangles: Ints | None
    off: float  # how far the surface may be from those given
    remark: str  # what was done, with the volume in common


def union_of_shells(points: Array, triangles: Ints, shells: Ints) -> JoinedShells | None:
    """Return what closed surfaces bound together, by manifold3d; None for a single one, and where one is no solid.

    `points` (n, 3). `triangles` (t, 3): of all surfaces. `shells` (t,): which surface each triangle is of. Those wound
    the other way than most, and inside the others, are cavities.
    """
    from manifold3d import Error, Manifold, Mesh64, OpType

    own = [triangles[shells == k] for k in np.unique(shells)]
    if len(own) < 2:
        return None
    volumes = np.array([volume_and_centroid(points[some])[0] for some in own])
    inwards = volumes < 0 if volumes.sum() > 0 else volumes > 0
    solids = []
    for some, volume in zip(own, volumes, strict=True):
        rows, place = np.unique(some, return_inverse=True)
        faces = place.reshape(-1, 3)[:, :: 1 if volume > 0 else -1]
        solids.append(Manifold(Mesh64(np.ascontiguousarray(points[rows]), np.ascontiguousarray(faces, np.uint64))))
        if solids[-1].status() != Error.NoError or solids[-1].is_empty():
            return None
    whole = Manifold.batch_boolean(
        [solid for solid, inward in zip(solids, inwards, strict=True) if not inward], OpType.Add
    )
    cavities = list[Manifold]()
    for solid in (solid for solid, inward in zip(solids, inwards, strict=True) if inward):
        if (whole ^ solid).volume() >= solid.volume() * (1.0 - DEFAULT.nominal):
            cavities.append(solid)
        else:
            whole += solid  # drawn the wrong way round
    if cavities:
        whole -= Manifold.batch_boolean(cavities, OpType.Add)
    if whole.status() != Error.NoError or whole.is_empty():
        return None
    mesh = whole.to_mesh64()
    before, after = float(np.abs(volumes).sum()), float(whole.volume())
    if len(whole.decompose()) == len(own) and abs(after - before) <= DEFAULT.nominal * before:
        return JoinedShells(points, None, 0.0, "")
    remark = (
        f"{len(own)} closed surfaces made one solid, {abs(round(1.0 - after / before, 9)):.3g} of their volumes common"
    )
    made = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64)
    return JoinedShells(*made, float(whole.get_tolerance()), remark)


def simplified(points: Array, triangles: Ints, off: float, most: float) -> JoinedShells | None:
    """Return a closed surface without what is finer than `off`, by manifold3d; None if it moves by more than `most`."""
    # coordinates rounded to a file's digits leave slivers that are folded over their neighbours or pierce them: these
    # fall away with their shortest edges
    from manifold3d import Error, Manifold, Mesh64

    given = Manifold(Mesh64(np.ascontiguousarray(points), np.ascontiguousarray(triangles, np.uint64)))
    solid = given.simplify(off)
    if given.status() != Error.NoError or solid.is_empty():
        return None
    mesh = solid.to_mesh64()
    places, made = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64)
    # corners that fell away and edges that are new: how far either surface is from the other, nearly
    both = np.concatenate([points, places])
    first, rows = distinct_rows(both)
    every = both[first]
    old, new = rows[: len(points)][triangles], rows[len(points) :][made]
    fallen = every[np.setdiff1d(old, new)]
    added = np.setdiff1d(_edges(new, len(every)), _edges(old, len(every)))
    a, b = every[added // len(every)], every[added % len(every)]
    beside = np.concatenate([(1.0 - share) * a + share * b for share in (0.25, 0.5, 0.75)])
    far = max(_farthest(fallen, every[new], most), _farthest(beside, every[old], most))
    if far > most:
        return None
    remark = (
        f"{len(triangles)} triangles made {len(made)}, some being folded or pierced by others: the surface moved by "
        f"{far / np.ptp(points, axis=0).max():.2g} of its size"
    )
    return JoinedShells(places, made, far, remark)


def _farthest(points: Array, surface: Array, most: float) -> float:
    """Return how far the farthest of some points is from triangles, (t, 3, 3); infinite beyond `most`."""
    near = np.full(len(points), np.inf)
    low = np.concatenate([points - most, surface.min(axis=1)])
    high = np.concatenate([points + most, surface.max(axis=1)])
    for one, two in overlapping(low, high, np.repeat([0, 1], [len(points), len(surface)])):
        own, other = np.minimum(one, two), np.maximum(one, two) - len(points)
        np.minimum.at(near, own, distances(points[own][:, None], surface[other])[:, 0])
    return float(np.where(near <= most, near, np.inf).max(initial=0.0))


def _edges(triangles: Ints, count: int) -> Ints:
    """Return the edges of triangles of `count` points, as numbers: the lower row times the count, and the other."""
    ends = np.sort(np.stack([triangles, np.roll(triangles, 1, axis=1)]), axis=0)
    return np.unique(ends[0] * count + ends[1])
