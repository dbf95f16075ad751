"""Closed surfaces from drawn faces: every edge is run along both ways equally often.

What is repaired is what can be read in one way only: faces that are there twice, or twice and opposed (a fin); a corner
that lies on the edge of the face beside it (a T-junction); faces that are wound against all others around them.
Closed surfaces that overlap, touch or are folded, as exports have them, are made the surface of one solid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags, Ints, distinct_rows
from fcdm_opt.geometry.crossings import overlapping_between
from fcdm_opt.geometry.measures import norms, volume_and_centroid
from fcdm_opt.geometry.polygons import Polygon, Sides, between, by_size, components, distances, widths
from fcdm_opt.tolerances import DEFAULT

SHOWN = 3  # places that a message names


@dataclass(frozen=True, eq=False)
class Faces:
    """Polygons on their way to a closed surface."""

    points: Array  # scaled by a power of two to a size near 1, (n, 3)
    unit: int  # that power: a point as given is 2^unit times the one here
    polygons: tuple[Polygon, ...]  # rows of `points`
    numbers: tuple[int, ...]  # their places among the faces as given
    repairs: tuple[str, ...] = ()  # what was repaired so far

    def kept(self, places: Sequence[int], *repairs: str) -> Faces:
        """Return these faces only, with a remark on why the others were left out."""
        polygons, numbers = tuple(self.polygons[k] for k in places), tuple(self.numbers[k] for k in places)
        return replace(self, polygons=polygons, numbers=numbers, repairs=self.repairs + repairs)

    def named(self, places: Sequence[int]) -> str:
        """Return a few of the faces by their 1-based numbers, and how many more there are."""
        return listed([f"{self.numbers[k] + 1}" for k in places], "face", "faces")

    def at(self, point: Array) -> str:
        """Return a place in coordinates as given."""
        return f"({', '.join(f'{x:.6g}' for x in np.ldexp(point, self.unit).tolist())})"

    def vertex(self, row: int) -> str:
        """Return a vertex with its label and its place."""
        return f"vertex {row + 1} {self.at(self.points[row])}"


def listed(names: Sequence[str], one: str, many: str) -> str:
    """Return "face 3", "faces 3, 5 and 7" or "1200 faces, the first 3, 5 and 7"."""
    if len(names) == 1:
        return f"{one} {names[0]}"
    few = ", ".join(names[: SHOWN - 1]) + f" and {names[SHOWN - 1]}" if len(names) >= SHOWN else " and ".join(names)
    return f"{many} {few}" if len(names) <= SHOWN else f"{len(names)} {many}, the first {few}"


def closed(faces: Faces, slack: float, key: str) -> Faces:
    """Return faces that make a closed, consistently wound surface.

    `slack`: length below which points count as one. `key`: names the body in messages. Raises `InputError` where no
    certain repair closes the surface; names edges and faces.
    """
    faces = _with_area(faces, slack)
    readings = list[Faces]()
    for fins in (True, False):
        readings.append(_joined(_distinct(faces, fins=fins), slack))
        if readings[-1].polygons and not Sides.of(readings[-1].polygons).odd.size:
            return _wound(readings[-1], key)
    raise _open(readings[0], faces, key)


def _with_area(faces: Faces, slack: float) -> Faces:
    """Leave out faces that lie on a line."""
    flat = np.zeros(len(faces.polygons), bool)
    for places, corners in by_size(faces.polygons):
        flat[places] = widths(faces.points[corners]) <= slack
    if not flat.any():
        return faces
    gone, kept = (np.flatnonzero(own).tolist() for own in (flat, ~flat))
    return faces.kept(kept, f"left out as having no area: {faces.named(gone)}")


def _distinct(faces: Faces, *, fins: bool) -> Faces:
    """Leave out copies, faces with the same corners; with `fins` both where they are opposed, else all but one."""
    groups: dict[Polygon, tuple[list[int], list[int]]] = {}
    for place, polygon in enumerate(faces.polygons):
        least = polygon.index(min(polygon))
        turned = polygon[least:] + polygon[:least]
        back = turned[:1] + turned[:0:-1]
        groups.setdefault(min(turned, back), ([], []))[turned > back].append(place)
    if len(groups) == len(faces.polygons):
        return faces
    kept, opposed, copies = [], list[int](), list[int]()
    for one, two in groups.values():
        if fins and len(one) == len(two):
            opposed += sorted(one + two)
            continue
        first, *more = one + two if len(one) > len(two) or (len(one) == len(two) and one < two) else two + one
        kept.append(first)
        copies += more
    remarks = []
    if opposed:
        remarks.append(f"left out as covering each other, with nothing between: {faces.named(opposed)}")
    if copies:
        remarks.append(f"left out as repeating others: {faces.named(sorted(copies))}")
    return faces.kept(sorted(kept), *remarks)


def _joined(faces: Faces, slack: float) -> Faces:
    """Make vertices at which the surface is open corners of the faces on whose open edges they lie."""
    sides = Sides.of(faces.polygons)
    open_ = sides.odd
    if not open_.size:
        return faces
    from scipy.spatial import cKDTree

    points = faces.points
    ends = np.unique([sides.origin[open_], sides.end[open_]])
    _, first = np.unique(sides.edge[open_], return_index=True)
    first = open_[first]
    a, b = points[sides.origin[first]], points[sides.end[first]]
    halves = (b - a) / 2
    near = cKDTree(points[ends] - points[0]).query_ball_point(a - points[0] + halves, norms(halves) + slack)
    on: dict[tuple[int, int], list[int]] = {}
    for k, own in enumerate(near):
        origin, end = int(sides.origin[first[k]]), int(sides.end[first[k]])
        row = between(points, (origin, end), ends[own], 2 * slack)
        if row:
            on[origin, end], on[end, origin] = row, row[::-1]
    if not on:
        return faces
    polygons, changed = list(faces.polygons), []
    for place in np.unique(sides.face[open_]).tolist():
        polygon = polygons[place]
        longer = []
        for k, end in enumerate(polygon):
            longer += [v for v in on.get((polygon[k - 1], end), ()) if v not in polygon]
            longer.append(end)
        if len(longer) > len(polygon):
            polygons[place] = tuple(longer)
            changed.append(place)
    remark = f"given the vertices that lie on their edges as corners: {faces.named(changed)}"
    return replace(faces, polygons=tuple(polygons), repairs=(*faces.repairs, remark))


def _open(faces: Faces, given: Faces, key: str) -> InputError:
    sides = Sides.of(faces.polygons)
    counts = sides.counts
    if not faces.polygons:
        return InputError("no surface is left", key=key, found="; ".join(faces.repairs) or "no faces")
    open_ = sides.odd
    _, first = np.unique(sides.edge[open_], return_index=True)
    first = np.sort(open_[first])
    places = []
    for side in first[:SHOWN].tolist():
        own = faces.named(np.unique(sides.face[sides.edge == sides.edge[side]]).tolist())
        places.append(f"from {faces.vertex(int(sides.origin[side]))} to {faces.vertex(int(sides.end[side]))} of {own}")
    many = int((counts[sides.edge[first]] > 1).sum())
    edges = "1 edge" if len(first) == 1 else f"{len(first)} edges"
    what = f"the surface is not closed: {edges} with a face on one side only"
    if many:
        what = f"the surface is not closed: {edges} with an odd number of faces, {many} of them with three or more"
    remarks = faces.repairs[len(given.repairs) :]
    tried = f" (tried: {'; '.join(remarks)})" if remarks else ""
    return InputError(f"{what}: {'; '.join(places)}{'; ...' if len(first) > SHOWN else ''}{tried}", key=key)


def _wound(faces: Faces, key: str) -> Faces:
    """Turn faces that are wound against those around them."""
    sides = Sides.of(faces.polygons)
    if not sides.unequal.size:
        return faces
    turned = _against(sides, len(faces.polygons), faces, key)
    polygons = tuple(
        reverse(polygon) if turn else polygon for polygon, turn in zip(faces.polygons, turned, strict=True)
    )
    wrong = Sides.of(polygons).unequal
    if wrong.size:
        side = int(wrong[0])
        a, b = faces.vertex(int(sides.origin[side])), faces.vertex(int(sides.end[side]))
        where = faces.named(np.unique(sides.face[sides.edge == sides.edge[side]]).tolist())
        what = f"the faces cannot be told apart into inside and outside at the edge from {a} to {b} of {where}"
        raise InputError(what, key=key, allowed="as many faces one way round along an edge as the other way")
    remark = f"turned to the winding of those around them: {faces.named(np.flatnonzero(turned).tolist())}"
    return replace(faces, polygons=polygons, repairs=(*faces.repairs, remark))


def _against(sides: Sides, count: int, faces: Faces, key: str) -> Flags:
    """Return which faces are wound against most of those that they are connected with by edges of two faces."""
    (one, two), first = sides.face[sides.pairs].T, sides.origin[sides.pairs]
    turn = count * (first[:, 0] == first[:, 1])
    # every face twice, as it is and turned: what fits together hangs together
    links = np.concatenate([np.column_stack([one, two + turn]), np.column_stack([one + count, two + count - turn])])
    patch, back = components(links, 2 * count).reshape(2, count)
    if (wrong := np.flatnonzero(patch == back)).size:
        what = f"the surface has one side only: no winding fits {faces.named(wrong.tolist())}"
        raise InputError(what, key=key)
    turned, least = patch > back, np.minimum(patch, back)
    return turned ^ (2 * np.bincount(least, turned)[least] > np.bincount(least)[least])


def reverse(polygon: Polygon) -> Polygon:
    """Return a polygon wound the other way, its first corner first."""
    return polygon[:1] + polygon[:0:-1]


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
    samples = np.concatenate([(1.0 - share) * a + share * b for share in (0.25, 0.5, 0.75)])
    far = max(_farthest(fallen, every[new], most), _farthest(samples, every[old], most))
    if far > most:
        return None
    remark = (
        f"{len(triangles)} triangles made {len(made)}, some being folded or pierced by others: the surface moved by "
        f"{far / np.ptp(points, axis=0).max():.2g} of its size"
    )
    return JoinedShells(places, made, far, remark)


def _farthest(points: Array, surface: Array, most: float) -> float:
    """Return how far the farthest of some points is from triangles, (t, 3, 3); infinite beyond `most`."""
    pairs = overlapping_between(points - most, points + most, surface.min(axis=1), surface.max(axis=1))
    near, (own, other) = np.full(len(points), np.inf), pairs.T
    np.minimum.at(near, own, distances(points[own][:, None], surface[other])[:, 0])
    return float(np.where(near <= most, near, np.inf).max(initial=0.0))


def _edges(triangles: Ints, count: int) -> Ints:
    """Return the edges of triangles of `count` points, as numbers: the lower row times the count, and the other."""
    ends = np.sort(np.stack([triangles, np.roll(triangles, 1, axis=1)]), axis=0)
    return np.unique(ends[0] * count + ends[1])
