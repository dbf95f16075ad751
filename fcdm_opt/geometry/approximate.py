"""CoACD's approximate convex decomposition (Wei et al. 2022), and how far it is off."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags, Ints, frozen
from fcdm_opt.geometry.hull import Hull, convex_hull
from fcdm_opt.geometry.measures import norms
from fcdm_opt.geometry.polygons import distances, fans, normals_of
from fcdm_opt.lazy_import import extra
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.geometry.mesh import Mesh

SEED = 0
FINEST = 5e-3  # of the size: bounds of the deviation are not made better than this, or than
SHARE = 0.1  # of themselves
SPACING, NEAREST = 1e-2, 4  # of samples of a surface, of the size; how many of their triangles are looked at
MOST_PIECES, MOST_LOOKS = 200_000, 3e8  # of triangles, and those times the surface's: then a coarser bound is taken
BLOCK = 1 << 22  # products of points and planes worked out at a time


def approximate(mesh: Mesh) -> tuple[Array, tuple[Ints, ...], tuple[float, float]]:
    """Return convex parts that are about the solid inside a mesh; raises `InputError` where CoACD is not installed.

    Points, (m, 3), the mesh's vertices first; their rows whose hulls the parts are; and two upper bounds: of the
    distance of any point on a part's surface from the solid, and of the distance of any point on the mesh from the
    parts. Where these are not the truth they are at most `FINEST` of the size, or larger by `SHARE` of themselves;
    larger still for meshes of very many triangles.
    """
    coacd = extra("coacd", "coacd", key=f"body '{mesh.name}': decomposition", found="coacd")
    used = np.unique(mesh.triangles)
    origin, size = mesh.vertices[used[0]], float(np.ptp(mesh.vertices[used], axis=0).max())
    local = (mesh.vertices - origin) / size
    place = np.zeros(len(local), np.int64)
    place[used] = np.arange(len(used))
    coacd.set_log_level("off")
    made = coacd.run_coacd(coacd.Mesh(local[used], place[mesh.triangles]), preprocess_mode="off", seed=SEED)
    points, rows = _numbered(local, used, [np.asarray(corners, dtype=np.float64) for corners, _ in made])
    parts, hulls = list[Ints](), list[Hull]()
    for own in rows:
        try:
            hulls.append(convex_hull(points[own], own, mesh.name))
        except InputError:  # flat: what is missing then is measured
            continue
        parts.append(frozen(np.sort(hulls[-1].used), np.int64))
    if not parts:
        raise InputError("CoACD found no parts", key=f"body '{mesh.name}': decomposition", found="coacd")
    out, short = _deviation(local, mesh.triangles, mesh, (origin, size), points, hulls)
    return np.vstack([mesh.vertices, origin + size * points[len(local) :]]), tuple(parts), (size * out, size * short)


def _numbered(local: Array, used: Ints, groups: list[Array]) -> tuple[Array, list[Ints]]:
    """Return the mesh's points and the groups' new ones, and each group's rows; a point next to a vertex is that."""
    from scipy.spatial import cKDTree

    tree = cKDTree(local[used])
    number: dict[tuple[float, ...], int] = {}
    rows = []
    for group in groups:
        off, near = tree.query(group)
        own = [
            int(used[k]) if distance <= DEFAULT.nominal else number.setdefault(tuple(point), len(local) + len(number))
            for point, distance, k in zip(group.tolist(), off, near, strict=True)
        ]
        rows.append(np.unique(own))
    return np.vstack([local, np.array(list(number)).reshape(-1, 3)]), rows


def _deviation(
    local: Array, triangles: Ints, mesh: Mesh, frame: tuple[Array, float], points: Array, hulls: list[Hull]
) -> tuple[float, float]:
    origin, size = frame
    planes = []
    for hull in hulls:
        normals = normals_of(points[hull.used], hull.loops)
        bases = points[hull.used[[loop[0] for loop in hull.loops]]]
        planes.append((normals, (normals * bases).sum(axis=1)))

    def inside_a_part(asked: Array) -> Flags:
        found = np.zeros(len(asked), bool)
        for normals, levels in planes:
            step = max(1, BLOCK // len(levels))
            for k in range(0, len(asked), step):
                found[k : k + step] |= (asked[k : k + step] @ normals.T <= levels).all(axis=1)
        return found

    surface, others = local[triangles], np.vstack([points[hull.used[fans(hull.loops)]] for hull in hulls])
    out = _farthest(others, surface, lambda asked: mesh.contains(origin + size * asked))
    return out, _farthest(surface, others, inside_a_part)


def _farthest(triangles: Array, surface: Array, contains: Callable[[Array], Flags]) -> float:
    """Return an upper bound of the distance of points of triangles from what a surface encloses."""
    # the distance from one triangle is convex: no point of another triangle is further from it than a corner of that.
    # Nor is one further away than its centre and its radius together. Triangles whose bound is not yet good are cut
    # into four
    from scipy.spatial import cKDTree

    samples, owners = _samples(surface)
    tree = cKDTree(samples)
    known, closed, work = 0.0, 0.0, 0
    while len(triangles):
        work += len(triangles)
        centres = triangles.mean(axis=1)
        off, nearest = tree.query(centres, NEAREST)
        bounds = distances(triangles[:, None], surface[owners[nearest]]).max(axis=2).min(axis=1)
        if work > min(MOST_PIECES, MOST_LOOKS / len(surface)):  # what is known so far holds for them all
            return max(closed, float(bounds.max()))
        left = np.flatnonzero(bounds > max(FINEST, (1 + SHARE) * known))
        within, radii = contains(centres[left]), norms(triangles[left] - centres[left, None]).max(axis=1)
        # exactly: of all triangles that may be nearer than the nearest sample
        found = tree.query_ball_point(centres[left], off[left, 0] + SPACING)
        there = np.array(
            [
                distances(x[None, None], surface[np.unique(owners[own])]).min()
                for x, own in zip(centres[left], found, strict=True)
            ]
        )
        bounds[left] = np.minimum(bounds[left], np.where(within, 0.0, there) + radii)
        bounds[left[within & (there > radii)]] = 0.0  # inside as a whole
        known = max(known, float(there[~within].max(initial=0.0)))
        good = bounds <= max(FINEST, (1 + SHARE) * known)
        closed = max(closed, float(bounds[good].max(initial=0.0)))
        triangles = _quartered(triangles[~good])
    return closed


def _samples(triangles: Array) -> tuple[Array, Ints]:
    """Return points of triangles of which one is within `SPACING` of each of theirs, and the triangle each is of."""
    found, owners, own = [], [], np.arange(len(triangles))
    while len(triangles):
        centres = triangles.mean(axis=1)
        small = norms(triangles - centres[:, None]).max(axis=1) <= SPACING
        found.append(centres[small])
        owners.append(own[small])
        triangles, own = _quartered(triangles[~small]), np.tile(own[~small], 4)
    return np.vstack(found), np.concatenate(owners)


def _quartered(triangles: Array) -> Array:
    a, b, c = triangles.transpose(1, 0, 2)
    d, e, f = (b + c) / 2, (c + a) / 2, (a + b) / 2
    return np.vstack([np.stack(own, axis=1) for own in ((a, f, e), (f, b, d), (e, d, c), (d, e, f))])
