"""Meshes: closed surfaces of solids, checked before anything is built on them.

What is wrong in one way only is repaired and reported; anything else is refused with what is wrong and where.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import (
    SMALLEST,
    Array,
    Ints,
    checked_corners,
    distinct_rows,
    frozen,
    groups_of,
    numbers,
    row_lists,
)
from fcdm_opt.geometry.closing import Faces, JoinedShells, closed, reverse, simplified, union_of_shells
from fcdm_opt.geometry.crossings import first_crossing
from fcdm_opt.geometry.measures import cross, exact_volume, norms, volume_and_centroid, winding_numbers
from fcdm_opt.geometry.polygons import Polygon, Sides, components, fans, normals_of, triangulated
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from flint import fmpq

SEVERAL = ", taken as one body"  # in notes of bodies that are several
FOLDS = 0.001, 0.1, 1.0  # of `Tolerances.fold`: how much of a folded surface falls away, tried in turn


@dataclass(frozen=True, eq=False)
class Mesh:
    """The closed surface of a solid; make one with `checked_mesh`."""

    # distinct points, numbered as given: a point given again is left out, one that no face uses keeps its number:
    # (n, 3)
    vertices: Array
    # rows of `vertices` of each face, counter-clockwise seen from outside, in the order given. A face may be any planar
    # polygon without holes
    faces: tuple[Polygon, ...]
    # (t, 3): triangles of the faces, without new vertices; every edge is run along both ways equally often
    triangles: Ints
    triangle_faces: Ints  # the face that each triangle is from, (t,)
    repairs: tuple[str, ...]  # what was wrong in one way only, and was put right
    name: str  # used in messages
    moved: float = 0.0  # largest distance of a point from the vertex that it was made one with

    @cached_property
    def _volume_and_centroid(self) -> tuple[float, Array, float]:
        return volume_and_centroid(self.vertices[self.triangles])

    @property
    def volume(self) -> float:
        """Volume, by signed tetrahedra about the mean corner of the triangles."""
        return self._volume_and_centroid[0]

    @property
    def centroid(self) -> Array:
        """Centroid of the volume, (3,)."""
        return frozen(self._volume_and_centroid[1])

    @cached_property
    def exact_volume(self) -> fmpq:
        """Volume of the solid that the triangles with their float corners enclose, exactly."""
        return exact_volume(self.vertices[self.triangles])

    def contains(self, points: ArrayLike) -> Any:
        """Tell which points, (..., 3), lie inside: the surface winds round them. Nearer to it than rounding, either."""
        asked = numbers(points, "points")
        inside = winding_numbers(asked.reshape(-1, 3), self.vertices[self.triangles]) > 0.5
        return inside.reshape(asked.shape[:-1])


def checked_mesh(vertices: ArrayLike, faces: Iterable[Sequence[int]] | ArrayLike, *, name: str = "body") -> Mesh:
    """Return the closed surface of a solid from vertices and faces.

    With every certain repair in `repairs`: copies of faces, faces without area or with nothing between them left out;
    vertices on the edge of a face made corners of it; windings made consistent and outward; seams of up to
    `Tolerances.seam` of the size closed; closed surfaces that overlap or touch made one; folds and slivers finer than
    `Tolerances.fold` of the size left out.

    - `vertices` (n, 3): points nearer than `Tolerances.weld` of the mesh's size are one, the first given.
    - `faces`, (t, 3) or rows of `vertices`: of each face, 0-based, in order around it: three or more. Polygons must be
      planar and may be non-convex.
    - `name`: used in messages.

    Raises `InputError` for a surface that is open, that crosses itself, or of which it is not certain what is inside;
    names faces and vertices (1-based) and a place.
    """
    return _checked(vertices, faces, name, remake=True)


def _checked(vertices: ArrayLike, faces: Any, name: str, *, remake: bool) -> Mesh:
    """Return what `checked_mesh` does; a surface that crosses itself is refused if it was made anew before."""
    key = f"body '{name}'"
    points = checked_corners(numbers(vertices, f"{key}: vertices"), key) + 0.0  # no negative zeros
    polygons = _polygons(faces, len(points), key)
    # powers of two change no digit; sizes near 1 keep all products far from what floats cannot hold
    used = points[np.unique([v for polygon in polygons for v in polygon])]
    size = float(np.abs(used - used[0]).max())
    if size <= SMALLEST:
        raise InputError("all points of the faces coincide up to rounding", key=key, found=used[0].tolist())
    unit = int(np.frexp(size)[1])
    scaled = np.ldexp(points, -unit)
    surface, kept, owners, slack = _closed_up(scaled, polygons, unit, float(np.ldexp(size, -unit)), key)
    triangles, owner = triangulated(surface.points, surface.polygons, surface.numbers, slack, key)
    crossing = first_crossing(surface.points, triangles, slack)
    if crossing is not None:
        anew = _made_anew(surface, triangles, _shells(surface)[owner], slack)
        if anew is not None:
            made = _first_solid(anew, surface, name) if remake else None
            if made is None:
                one, two = sorted(surface.numbers[owner[k]] for k in (crossing.one, crossing.two))
                what = f"faces {one + 1} and {two + 1} cross, overlap, or touch along a line that is no edge of both"
                raise InputError(f"{what}, at {surface.at(np.array(crossing.place))}", key=key)
            return made
    turned, remarks = _outward(surface, triangles, owner, slack, key)
    loops = tuple(reverse(own) if turn else own for own, turn in zip(surface.polygons, turned, strict=True))
    triangles = np.where(turned[owner][:, None], triangles[:, ::-1], triangles)
    return Mesh(
        vertices=frozen(points[kept]),
        faces=loops,
        triangles=frozen(triangles, np.int64),
        triangle_faces=frozen(owner, np.int64),
        repairs=surface.repairs + remarks,
        name=name,
        moved=float(norms(points - points[kept][owners]).max()),
    )


def _made_anew(surface: Faces, triangles: Ints, shell: Ints, slack: float) -> Iterable[JoinedShells | None] | None:
    """Return what a surface that crosses itself may be replaced with, in turn; None where solids only touch."""
    joined = union_of_shells(surface.points, triangles, shell)
    own = [triangles[shell == k] for k in np.unique(shell)]
    if joined is not None and not any(first_crossing(surface.points, some, slack) for some in own):
        return None if joined.triangles is None else [joined]
    finest = DEFAULT.fold * float(np.ptp(surface.points, axis=0).max())
    return (simplified(surface.points, triangles, share * finest, 2.0 * finest) for share in FOLDS)


def _first_solid(surfaces: Iterable[JoinedShells | None], given: Faces, name: str) -> Mesh | None:
    """Return the mesh of the first of some surfaces that bounds a solid, with what was done; None where none does."""
    for surface in surfaces:
        if surface is None or surface.triangles is None:
            continue
        try:
            made = _checked(np.ldexp(surface.points, given.unit), surface.triangles, name, remake=False)
        except InputError:
            continue
        repairs = (*given.repairs, surface.remark, *made.repairs)
        return replace(made, repairs=repairs, moved=made.moved + float(np.ldexp(surface.off, given.unit)))
    return None


def _closed_up(
    points: Array, polygons: list[Polygon], unit: int, size: float, key: str
) -> tuple[Faces, Ints, Ints, float]:
    """Return a closed surface, the points kept, the place among them of each point, and the slack of welding."""
    # where it is open, points a little further from each other are made one: meshes come with seams of a millionth
    rounding = 4 * float(np.spacing(np.abs(points).max()))
    refused: InputError | None = None
    for weld in (DEFAULT.weld, DEFAULT.seam):
        slack = max(weld * size, rounding)
        kept, owners, repairs = _welded(points, slack, max(weld, rounding / size))
        try:
            drawn = Faces(points[kept], unit, *_shortened(polygons, owners, key), repairs)
            return closed(drawn, slack, key), kept, owners, slack
        except InputError as reason:
            refused = refused or reason
    assert refused is not None
    raise refused


# ---------------------------------------------------------------------------------------------------- input checks


def _polygons(faces: Any, count: int, key: str) -> list[Polygon]:
    if isinstance(faces, np.ndarray) and faces.dtype.kind in "iu" and faces.ndim == 2:
        faces = faces.tolist()
    polygons = list(map(tuple, row_lists(faces, count, key, "face", repeats=True)))
    if not polygons:
        raise InputError("a solid needs faces", key=f"{key}: faces", found=0)
    for k, own in enumerate(polygons):
        if len(own) < 3:
            raise InputError("a face needs at least 3 corners", key=f"{key}: face {k + 1}", found=len(own))
    return polygons


def _welded(points: Array, slack: float, share: float) -> tuple[Ints, Ints, tuple[str, ...]]:
    """Return the rows of distinct points, the place among them of each point, and a remark on unequal ones made one."""
    from scipy.spatial import cKDTree

    distinct, owners = _ranked(points)
    pairs = cKDTree(points[distinct] - points[0]).query_pairs(slack, output_type="ndarray")
    if not len(pairs):
        return distinct, owners, ()
    least, group = _ranked(components(pairs, len(distinct))[:, None])
    remark = f"made one with others nearer than {share:.1g} of the size: {len(distinct) - len(least)} vertices"
    return distinct[least], group[owners], (remark,)


def _ranked(rows: Array | Ints) -> tuple[Ints, Ints]:
    """Return the first places of distinct rows, ascending, and which of these each row is equal to."""
    first, same = distinct_rows(rows)
    return np.sort(first), np.argsort(np.argsort(first))[same]


def _shortened(polygons: list[Polygon], owners: Ints, key: str) -> tuple[tuple[Polygon, ...], tuple[int, ...]]:
    """Return polygons of distinct points, and their numbers: sides of no length are left out."""
    short, place = [], owners.tolist()
    for k, polygon in enumerate(polygons):
        own = tuple(place[v] for v in polygon)
        if 2 < len(set(own)) < len(own):
            own = tuple(v for i, v in enumerate(own) if v != own[i - 1])
            if len(set(own)) < len(own):
                again = next(v for i, v in enumerate(own) if v in own[:i])
                what = f"the outline comes back to vertex {again + 1}"
                raise InputError(what, key=f"{key}: face {k + 1}", found=tuple(v + 1 for v in own))
        short.append(own)
    return tuple(short), tuple(range(len(short)))


# ------------------------------------------------------------------------------------------------------------ shells


def _outward(surface: Faces, triangles: Ints, owner: Ints, slack: float, key: str) -> tuple[Array, tuple[str, ...]]:
    """Return which faces must be turned for the surface to be wound outwards, and remarks."""
    shell = _shells(surface)
    corners = [surface.points[triangles[shell[owner] == k]] for k in range(shell.max() + 1)]
    signs = []
    for k, own in enumerate(corners):
        volume, _, rounding = volume_and_centroid(own)
        if abs(volume) <= rounding:
            volume = float(exact_volume(own))
        area = norms(cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0])).sum() / 2
        if abs(volume) <= slack * area:
            faces = surface.named(np.flatnonzero(shell == k).tolist())
            raise InputError(f"a surface encloses no volume: {faces}", key=key)
        signs.append(int(np.sign(volume)))
    lows, highs = (np.array([f(own, axis=(0, 1)) for own in corners]) for f in (np.min, np.max))
    depth, around = np.zeros(len(corners), np.int64), {}
    for k in range(len(corners)):
        boxes = np.flatnonzero((lows <= lows[k]).all(axis=1) & (highs >= highs[k]).all(axis=1))
        around[k] = [j for j in boxes.tolist() if j != k and _is_inside(corners[k], corners[j])]
        depth[k] = len(around[k])
    turned = np.zeros(len(corners), bool)
    for k in np.argsort(depth, kind="stable").tolist():
        if not around[k]:
            turned[k] = signs[k] < 0
            continue
        parent = max(around[k], key=lambda j: depth[j])
        if signs[k] == signs[parent]:
            inner, outer = (surface.named(np.flatnonzero(shell == j).tolist()) for j in (k, parent))
            what = f"one closed surface lies inside another and is wound the same way: {inner}, inside {outer}"
            raise InputError(what, key=key, allowed="a cavity is wound the other way, two solids must not overlap")
        turned[k] = turned[parent]
    if not turned.any():
        return np.zeros(len(surface.polygons), bool), ()
    wrong = turned[shell]
    return wrong, (f"turned, being wound inwards: {surface.named(np.flatnonzero(wrong).tolist())}",)


def _shells(surface: Faces) -> Ints:
    """Return for each face the number of its closed surface: those that edges of two faces connect, if closed."""
    # others, cut open by edges of more faces, go on there with the face across the material: solids may lie face on
    # face
    sides = Sides.of(surface.polygons)
    plain, links = sides.counts[sides.edge[sides.links[:, 0]]] == 2, sides.face[sides.links]
    group = components(links[plain], len(surface.polygons))
    senses = np.where(sides.origin < sides.end, 1, -1)
    own = np.unique(group[sides.face] * (sides.edge.max() + 1) + sides.edge, return_inverse=True)[1]
    open_ = np.zeros(group.max() + 1, bool)
    open_[group[sides.face[np.bincount(own, senses)[own] != 0]]] = True
    if not open_.any():
        return group
    normals = normals_of(surface.points, surface.polygons)
    inwards = volume_and_centroid(surface.points[fans(surface.polygons)])[0] < 0
    several = np.flatnonzero(sides.counts > 2).tolist()
    wedges = [sides.wedges(surface.points, normals, own, inwards=inwards) for own in several]
    paired = np.array([pair for own in wedges for pair in own]).reshape(-1, 2)
    return components(np.concatenate([links[plain], paired[open_[group[paired]].all(axis=1)]]), len(surface.polygons))


def solids(points: Array, polygons: Sequence[Polygon]) -> list[Ints]:
    """Return the numbers of the faces of each closed surface with its cavities; none where some are open."""
    first, same = _ranked(points)
    place = same.tolist()
    every = [tuple(place[v] for v in own) for own in polygons]
    kept = [k for k, own in enumerate(every) if len(set(own)) == len(own)]
    welded = Faces(points[first], 0, tuple(every[k] for k in kept), tuple(kept))
    if not kept or Sides.of(welded.polygons).odd.size or Sides.of(welded.polygons).unequal.size:
        return []
    group, numbers = _shells(welded), np.array(kept)
    triangles = [fans([welded.polygons[k] for k in own.tolist()]) for own in groups_of(group)]
    corners = [welded.points[own] for own in triangles]
    volumes = np.array([volume_and_centroid(own)[0] for own in corners])
    cavity = volumes * np.sign(volumes[np.abs(volumes).argmax()]) < 0
    owner = np.arange(len(corners))
    for k in np.flatnonzero(cavity).tolist():
        around = [j for j in np.flatnonzero(~cavity).tolist() if _is_inside(corners[k], corners[j])]
        owner[k] = min(around, key=lambda j: abs(volumes[j]), default=k)
    return [numbers[np.isin(group, np.flatnonzero(owner == k))] for k in np.unique(owner).tolist()]


def _is_inside(inner: Array, outer: Array) -> bool:
    """Tell whether one closed surface lies inside another that it does not cross, by its large triangles' middles."""
    sizes = np.ptp(inner, axis=1).max(axis=1)
    turns = np.abs(winding_numbers(inner[np.argsort(-sizes)[:8]].mean(axis=1), outer))
    return bool(turns[np.abs(turns - np.round(turns)).argmin()] > 0.5)
