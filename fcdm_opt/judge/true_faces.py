"""The judge's look at round faces: on points of these, by equations of its own, and finer where they come nearest.

What is solved for bodies of facets must hold for the faces that these stand for. Points are taken on the triangles of
either body near the other, brought onto the face that a triangle stands for, which ends where its surface meets the
next one, and measured against the faces of the other body; about the nearest the grid is made finer until it tells no
more.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array, Flags, Ints, distinct_rows
from fcdm_opt.geometry.facet_errors import deviation_of
from fcdm_opt.geometry.patches import TrueFaces
from fcdm_opt.geometry.polygons import Sides
from fcdm_opt.geometry.tessellation import Swept
from fcdm_opt.judge.face_kernels import SLACK, deepest_of_two, heights, points_of_edges, room_of
from fcdm_opt.tolerances import DEFAULT

BENT = 1e-12  # of a chord: an edge that leaves it by less is straight
BOWED = 1.5  # times what an edge leaves its chord at three places: it does nowhere by more


def gap_of_true_faces(
    faces: Sequence[TrueFaces],
    scales: Sequence[float] | Array,
    transform: Array,
    band: float,
    without: Collection[tuple[int, int]] = (),
) -> float:
    """Return the gap of bodies on their true faces, minus their depth; infinite where it is more than the band.

    At scales, (2,), body 1 moved by a 4x4 transform. Points further off a surface than `band` are not looked at: deeper
    ones are on the other side of a solid. Surfaces `without`, of body 1 and of body 2, by number in `true_faces`, are
    not looked at together. Nor are others where they touch at an edge of the contact of two such: the sides of a lid,
    on its box.
    """
    pose = np.asarray(transform, np.float64).tobytes()
    return _gap(tuple(faces), tuple(map(float, scales)), pose, band, frozenset(without))


@lru_cache(maxsize=4)  # facets and parts that are exact at points often lead to one motion
def _gap(faces: tuple[TrueFaces, ...], scales: tuple[float, ...], pose: bytes, band: float, without: Any) -> float:
    poses = np.frombuffer(pose).reshape(4, 4), np.eye(4)
    one, two = (_There(*own) for own in zip(faces, scales, poses, strict=True))
    bodies = [own.body for own in faces]
    room = DEFAULT.touch * max(own.size for own in bodies) + max(own.rounding for own in bodies)
    closed = np.array(sorted(without), np.int64).reshape(-1, 2)
    deepest = _deepest(one, two, band, closed, room, -np.inf)
    return -_deepest(two, one, band, np.ascontiguousarray(closed[:, ::-1]), room, deepest)


class _Surfaces(NamedTuple):
    """Surfaces of revolution, see `Swept`: of all faces of a body, or one for each point."""

    numbers: Array  # (..., 10): see `face_kernels`

    @classmethod
    def of(cls, swept: Sequence[Swept]) -> _Surfaces:
        """Return them as arrays."""
        each = [[*own.origin, *own.axis, *(own.line or (np.nan, np.nan)), own.ring, own.radius] for own in swept]
        return cls(np.array(each, float).reshape(-1, 10))

    def placed(self, pose: Array, scale: float, seed: Array) -> _Surfaces:
        """Return them scaled about a seed, then moved by a 4x4 transform."""
        made, turn = self.numbers.copy(), pose[:3, :3].T
        made[:, :3] = (seed + scale * (made[:, :3] - seed)) @ turn + pose[:3, 3]
        made[:, 3:6] = made[:, 3:6] @ turn
        made[:, 8:] *= scale
        return _Surfaces(made)

    @property
    def axis(self) -> Array:
        """Unit directions of the axes, (..., 3)."""
        return self.numbers[..., 3:6]

    @property
    def line(self) -> Array:
        """The lines that they are swept by, (..., 2); nan where it is by a circle."""
        return self.numbers[..., 6:8]

    @property
    def ring(self) -> Array:
        """Rings of the circles that they are swept by, (...)."""
        return self.numbers[..., 8]

    def of_each(self, which: Ints | int) -> _Surfaces:
        """Return those of some numbers."""
        return _Surfaces(self.numbers[which])

    def height(self, points: Array) -> tuple[Array, Array]:
        """Return how far points are off a surface, and the directions there: from the nearest point of its profile."""
        numbers = self.numbers
        if numbers.ndim > 1:
            shape = np.broadcast_shapes(numbers.shape[:-1], points.shape[:-1])
            numbers, points = np.broadcast_to(numbers, (*shape, 10)), np.broadcast_to(points, (*shape, 3))
        off, directions = heights(_rows(numbers, 10), _rows(points, 3))
        return off.reshape(points.shape[:-1]), directions.reshape(points.shape)


def _rows(numbers: Array, columns: int) -> Array:
    return np.ascontiguousarray(numbers).reshape(-1, columns)


class _There:
    """A body's triangles and surfaces where they are."""

    def __init__(self, faces: TrueFaces, scale: float, pose: Array) -> None:
        self.owners, self.is_round = faces.owners, faces.is_round
        seed = faces.body.seed

        def there(points: Array) -> Array:
            return np.asarray((seed + scale * (points - seed)) @ pose[:3, :3].T + pose[:3, 3])

        self.corners = there(faces.corners)
        self.neighbours = _neighbours(faces.corners, faces.owners)
        ends = np.stack([self.corners, np.roll(self.corners, -1, axis=1)], axis=2)
        self.edges = ends[self.neighbours != self.owners[:, None]]  # chords, each off its edge by no more than a facet
        self.bow = scale * max(deviation_of(faces.body))
        self.surfaces = _Surfaces.of([own.surface for own in faces.patches]).placed(pose, scale, seed)
        self.sides = np.array([own.side for own in faces.patches])
        self._find_bent_edges()

    def may_bend(self, k: int | Ints, others: Ints) -> Flags:
        """Tell with which faces it may have bent edges."""
        return np.asarray((others != k) & (self.is_round[k] | self.is_round[others]))

    def off_triangles(self, k: int, along: Array | None) -> float:
        """Return how far points of a face may be off its triangles, along a direction where one is given."""
        own = slice(*self.bent_begin[k : k + 2])
        bow, axis = self.bow if self.is_round[k] else 0.0, self.surfaces.axis[k]
        if along is None:
            return bow + float(self.bent_room[own].max(initial=0.0))
        if self.surfaces.line[k, 0] == 1.0:  # points of a cylinder are off square to its axis
            bow *= float(np.linalg.norm(np.cross(axis, along)))
        return bow + BOWED * float(np.abs(self.bent_off[:, own] @ along).max(initial=0.0))

    def _find_bent_edges(self) -> None:
        """Find the edges of faces that leave their chords, and how far."""
        which, s = np.nonzero(self.may_bend(self.owners[:, None], self.neighbours))
        order = np.argsort(self.owners[which], kind="stable")
        which, s = which[order], s[order]
        own, others = self.owners[which], self.neighbours[which, s]
        ends = np.stack([self.corners[which, each] for each in (s, (s + 1) % 3)], axis=1)
        start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
        off = np.zeros((3, len(start), 3))
        for i, share in enumerate((0.25, 0.5, 0.75)):
            surfaces = self.surfaces.of_each(own), self.surfaces.of_each(others)
            off[i] = _on_edge(*surfaces, start, ends[:, 1], np.full((len(start), 1), share)) - start - share * along
        bow = np.linalg.norm(off, axis=2).max(axis=0)
        bent = bow > BENT * np.linalg.norm(along, axis=1)
        self.bent_others, self.bent_chords, self.bent_off = others[bent], ends[bent], off[:, bent]
        self.bent_room = BOWED * bow[bent]
        self.bent_begin = np.searchsorted(own[bent], np.arange(len(self.sides) + 1))

    @cached_property
    def packed(self) -> tuple[Any, ...]:
        """All of it as compiled code takes it: see `face_kernels`."""
        order = np.argsort(self.owners, kind="stable")
        begins = np.searchsorted(self.owners[order], np.arange(len(self.sides) + 1))
        faces = self.surfaces.numbers, self.sides, self.is_round, self.corners, self.neighbours, order, begins
        bent = self.bent_others, self.bent_chords, self.bent_room, self.bent_begin
        return *faces, room_of(self.corners), self.edges, *bent, np.array([self.bow])


def _neighbours(corners: Array, owners: Ints) -> Ints:
    """Return the surface on the other side of each side of triangles, from a corner to the next, (t, 3)."""
    one, two = Sides.around(distinct_rows(corners.reshape(-1, 3))[1], 3).links.T
    found = np.repeat(owners, 3)
    found[one], found[two] = owners[two // 3], owners[one // 3]
    return found.reshape(-1, 3)


def _on_edge(one: _Surfaces, two: _Surfaces, start: Array, end: Array, share: Array) -> Array:
    """Return points of the curve where surfaces meet, each at a right angle off a share (n, 1) of its chord."""
    # the surfaces are those of all, or one for each chord
    return points_of_edges(_rows(one.numbers, 10), _rows(two.numbers, 10), start, end, share.ravel())


def _deepest(own: _There, other: _There, band: float, closed: Ints, room: float, known: float) -> float:
    """Return how deep points of one body lie in the other at most, or what is known where that is no less."""
    skipped = set(map(tuple, closed.tolist()))
    pairs = list[tuple[float, int, int, Ints]]()
    low, high = own.corners.min(axis=1), own.corners.max(axis=1)
    for k in np.unique(other.owners).tolist():
        theirs = other.corners[other.owners == k]
        ends = theirs.reshape(-1, 3).min(axis=0) - band, theirs.reshape(-1, 3).max(axis=0) + band
        near = ((high >= ends[0]) & (low <= ends[1])).all(axis=1)
        for j in np.unique(own.owners[near]).tolist():
            if (j, k) not in skipped:
                triangles = np.flatnonzero(near & (own.owners == j))
                pairs.append((_at_most(own, j, triangles, other, k), j, k, triangles))
    for most, j, k, triangles in sorted(pairs, key=lambda pair: abs(pair[0])):  # those that touch show most of others
        if most > known + SLACK * band:
            known = max(known, deepest_of_two(own.packed, j, triangles, other.packed, k, band, known, closed, room))
    return known


def _at_most(own: _There, j: int, triangles: Ints, other: _There, k: int) -> float:
    """Return a bound of how deep points of a face lie behind another surface."""
    # the height over a plane, a cylinder, a cone or a sphere is convex: over a triangle it is at most what it is at the
    # corners, and at least what its tangent plane at the middle is there
    surface, corners = other.surfaces.of_each(k), own.corners[triangles]
    if np.isnan(surface.line[0]) and surface.ring > 0.0:
        return np.inf
    if other.sides[k] < 0.0:
        most = float(surface.height(corners)[0].max())
    else:
        middle = corners.mean(axis=1)
        height, direction = surface.height(middle)
        most = -float((height[:, None] + np.einsum("tki,ti->tk", corners - middle[:, None], direction)).min())
    return most + own.off_triangles(j, None if other.is_round[k] else surface.axis)
