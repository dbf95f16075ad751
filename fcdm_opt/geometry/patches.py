"""The true faces of bodies with round ones: patches of planes, cylinders, cones, spheres and tori, and their edges.

A patch is a surface and the triangles that stand for it. Where two bodies come nearest on their true faces follows from
the signed distance of a surface, which is known in closed form: the points of one feature (a patch, an edge between
two, a corner) where the distance to a patch of the other body is least, found by Newton's method from the triangles
that are near each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array, Flags, Ints, distinct_rows, groups_of
from fcdm_opt.geometry.bodies import Body, cached_of_whole
from fcdm_opt.geometry.crossings import overlapping_between
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.facet_errors import deviation_of, round_surfaces
from fcdm_opt.geometry.measures import cross, dots, norms, unit_normals, units
from fcdm_opt.geometry.naming import rows_of_element
from fcdm_opt.geometry.patch_kernels import (
    RIM_SLACK,
    beyond_chords,
    is_outside,
    least_to_edges,
    lowest,
    nearest,
    nearest_on_edges,
    onto_each,
)
from fcdm_opt.geometry.polygons import Sides, distances
from fcdm_opt.geometry.tessellation import Swept, numbers_of, surfaces_of_triangles
from fcdm_opt.tolerances import DEFAULT

STARTS = 24  # places from which the nearest points of two faces are looked for
NEAR_BY = 0.05  # of the size: so far nearest points may move from one pose to another, where they are followed
DIGITS = 10.0  # times the rounding of a file: by so much its digits may leave points off their faces


class Patch(NamedTuple):
    """A face of the true solid."""

    surface: Swept  # in the body's frame as drawn
    # 1 where the material is on the side that the surface bends to, or below a plane; -1 else, as of a bore
    side: float

    def gaps(self, points: Array) -> tuple[Array, Array]:
        """Return how far points (n, 3) are off the face, outside positive, and the outward normals there."""
        off, normals = self.surface.misses(points)
        return self.side * off, self.side * normals

    def bends(self, points: Array) -> Array:
        """Return the second derivatives of the gaps, (n, 3, 3)."""
        return self.side * self.surface.bends(points)

    @property
    def concave(self) -> bool:
        """Whether it is about a convex space: of a bore, a conical hole, or a socket of a ball."""
        surface = self.surface
        return self.side < 0.0 and not surface.flat and (surface.line is not None or surface.ring == 0.0)

    def placed(self, transform: Array, scale: float) -> Patch:
        """Return it moved and scaled, see `Swept.placed`."""
        return Patch(self.surface.placed(transform, scale), self.side)


class Rim(NamedTuple):
    """The bent edges of a plane patch with another one, which leave their chords."""

    ends: Array  # of the chords, (m, 2, 3)
    bows: Array  # from their middles to the edge, (m, 3)
    short: Flags  # whether triangles of the plane end short of the edge, at the chord; else they go on beyond it


class TrueFaces:
    """The patches of a body, with the triangles that stand for them, and the edges and corners between them."""

    patches: tuple[Patch, ...]
    corners: Array  # triangles, wound outwards, as drawn, (t, 3, 3)
    owners: Ints  # the patch of each, (t,)
    sorted: Ints  # triangles by patch, (t,)
    rows: Ints  # the row of `Body.faces` of each, (t,)
    is_round: Flags  # of each patch, (p,)
    first_rows: Ints  # the first of the rows of `Body.faces` that each patch stands for, (p,)
    edges: Array  # ends of the convex edges between two patches, (m, 2, 3)
    edge_patches: Ints  # these patches, (m, 2)
    reentrant: frozenset[tuple[int, int]]  # patches that meet at concave edges alone, the smaller number first
    tips: Array  # corners, in which edges of several kinds meet, (v, 3)

    def __init__(self, body: Body) -> None:
        self.body = body
        self.corners, self.rows = body.face_triangles
        rounds, normals = round_surfaces(body), unit_normals(self.corners)
        surfaces, self.owners = surfaces_of_triangles(self.corners, self.rows, rounds)
        self.is_round = np.arange(len(surfaces)) < len(rounds)
        self.sorted = np.argsort(self.owners, kind="stable")
        self._triangles = [np.flatnonzero(self.owners == k) for k in range(len(surfaces))]
        self.first_rows = np.array([self.rows[own].min() for own in self._triangles])
        patches = list[Patch]()
        for k, surface in enumerate(surfaces):
            own = self.owners == k
            looks = surface.misses(self.corners[own].mean(axis=1))[1] if self.is_round[k] else normals[own]
            patches.append(Patch(surface, 1.0 if (looks * normals[own]).sum() > 0.0 else -1.0))
        self.patches = tuple(patches)
        self._join(normals)

    def _join(self, normals: Array) -> None:
        """Find the convex edges between patches."""
        links = Sides.around(distinct_rows(self.corners.reshape(-1, 3))[1], 3).links
        links = np.take_along_axis(links, (links % 3 * len(self.corners) + links // 3).argsort(axis=1), axis=1)
        one, two = links[np.diff(self.owners[links // 3], axis=1)[:, 0] != 0].T
        start, end = (self.corners[one // 3, (one + step) % 3] for step in (0, 1))
        self.every_edge = np.stack([start, end], axis=1)
        self.every_pair_of_patches = np.column_stack([self.owners[one // 3], self.owners[two // 3]])
        far = self.corners[two // 3, (two + 2) % 3]
        convex = ((far - start) * normals[one // 3]).sum(axis=1) < DEFAULT.nominal * self.body.size
        sharp = ~self._smooth(start)
        concave, convex = sharp & ~convex, sharp & convex
        both = np.sort(self.every_pair_of_patches, axis=1)
        self.reentrant = frozenset(map(tuple, both[concave].tolist())) - frozenset(map(tuple, both[~concave].tolist()))
        self._folds = np.array([tuple(pair) in self.reentrant for pair in both.tolist()], bool)
        self.edges, self.edge_patches = self.every_edge[convex], self.every_pair_of_patches[convex]
        tips, spot = distinct_rows(self.edges.reshape(-1, 3))
        kinds = np.repeat(np.unique(np.sort(self.edge_patches, axis=1), axis=0, return_inverse=True)[1].reshape(-1), 2)
        meet = np.unique(np.column_stack([spot, kinds]), axis=0)[:, 0]
        self.tips = self.edges.reshape(-1, 3)[tips[np.bincount(meet, minlength=len(tips)) > 1]]
        room = DIGITS * self.body.rounding
        for k, tip in enumerate(self.tips):
            own = np.unique(self.owners[(norms(self.corners - tip) == 0.0).any(axis=1)])
            at = self.onto(own.tolist(), tip)
            self.tips[k] = at if norms(at - tip) <= room else tip

    @property
    def slack(self) -> float:
        """How far points may be off the faces that they are on, for rounding and the digits of the body's file."""
        return max(DEFAULT.tie * self.body.size, DIGITS * self.body.rounding)

    def moved(self, patches: Sequence[Patch], corners: Array) -> TrueFaces:
        """Return the same faces elsewhere: each patch, and the triangles that stand for them."""
        other = copy(self)
        other.patches, other.corners = tuple(patches), corners
        for known in ("_boxes", "off_triangles", "_bows", "rims", "chords", "numbers", "packed"):
            other.__dict__.pop(known, None)
        other._join(unit_normals(corners))
        return other

    def _smooth(self, points: Array) -> Flags:
        """Tell over which edges, by a point of each, one patch goes on in the other, as a fillet does."""
        found = np.zeros(len(points), bool)
        pairs, same = np.unique(self.every_pair_of_patches, axis=0, return_inverse=True)
        for pair, own in zip(pairs, groups_of(same.reshape(-1)) if len(pairs) else (), strict=True):
            one, two = (self.patches[k].gaps(points[own])[1] for k in pair.tolist())
            found[own] = norms(cross(one, two)) < DEFAULT.sharp
        return found

    def _distances(self, k: int, points: Array) -> Array:
        """Return how far the triangles of a patch are from points, (n, 3), (t, n)."""
        return distances(points, self.corners[self._triangles[k]])

    def face_of(self, k: int) -> Element:
        """Return the first face of the body that stands for a patch."""
        return Element("F", self.body.faces[int(self.first_rows[k])])

    def element_at(self, patches: Sequence[int], point: Array) -> Element:
        """Return the face of the body that stands for a patch; where several meet the edge or vertex nearest there."""
        if len(patches) == 1:
            return self.face_of(patches[0])
        own = self.every_edge[np.isin(self.every_pair_of_patches, patches).all(axis=1)]
        ends = own[distances(point[None], own)[:, 0].argmin()] if len(patches) == 2 and len(own) else point[None]
        every = self.body.vertices
        return Element("VE"[len(ends) - 1], tuple(sorted(int(norms(every - x).argmin()) + 1 for x in ends)))

    def has_points(self, k: int, points: Array) -> Flags:
        """Tell which points of a surface, (n, 3), are on the patch, its edge counted: as far as triangles leave it."""
        near = DEFAULT.nominal * self.body.size + self.off_triangles
        return np.asarray(self._distances(k, points).min(axis=0) <= near)

    def look_along(self, patches: Sequence[int], point: Array, n: Array) -> bool:
        """Tell whether a point, (3,), is on all patches, and a direction between their normals there."""
        normals = np.array([self.patches[k].gaps(point[None])[1][0] for k in patches])
        between = np.linalg.lstsq(normals.T, n)[0].min() >= -DEFAULT.tie
        return bool(between) and all(self.has_points(k, point[None])[0] for k in patches)

    @cached_property
    def _boxes(self) -> Array:
        """The ends of a box about each patch, (2, patches, 3), in which `has_points` finds points."""
        ends = np.full((2, len(self.patches), 3), [[[np.inf]], [[-np.inf]]])
        np.minimum.at(ends[0], self.owners, self.corners.min(axis=1))
        np.maximum.at(ends[1], self.owners, self.corners.max(axis=1))
        beyond = DEFAULT.nominal * self.body.size + self.off_triangles
        return ends + np.array([-beyond, beyond])[:, None, None]

    @cached_property
    def off_triangles(self) -> float:
        """How far faces leave their triangles at most, or round edges of them their chords: those of a cone by more."""
        found = max(deviation_of(self.body))
        for k in np.flatnonzero(self.is_round).tolist():
            surface = self.patches[k].surface
            off = self.every_edge[(self.every_pair_of_patches == k).any(axis=1)] - surface.origin
            across = off - (off @ surface.axis)[..., None] * surface.axis
            found = max(found, float((norms(across).mean(axis=1) - norms(across.mean(axis=1))).max(initial=0.0)))
        return found

    @cached_property
    def _bows(self) -> Array:
        """From the middle of each chord between two patches to the edge that it stands for, (m, 3)."""
        middles = self.every_edge.mean(axis=1)
        return onto_each(middles, self.numbers, self.every_pair_of_patches) - middles

    @cached_property
    def rims(self) -> dict[tuple[int, int], Rim]:
        """The bent edges of plane patches, by these and the patch beyond."""
        pairs, edges, surfaces = self.every_pair_of_patches, self.every_edge, [own.surface for own in self.patches]
        both, ends = np.concatenate([pairs, pairs[:, ::-1]]), np.concatenate([edges, edges[:, ::-1]])
        flat = np.array([own.flat for own in surfaces])
        rows = np.flatnonzero(flat[both[:, 0]] & ~flat[both[:, 1]])
        both, ends = both[rows], ends[rows]
        bows = np.concatenate([self._bows, self._bows])[rows]
        inward = cross(np.array([own.axis for own in surfaces])[both[:, 0]], ends[:, 1] - ends[:, 0])
        bent = norms(bows) > self.slack  # straight edges are no rim, as of the flat of a D-shaped bore
        short, found = (bows * inward).sum(axis=1) < 0.0, dict[tuple[int, int], Rim]()
        for k, other in np.unique(both[bent], axis=0).tolist():
            own = bent & (both == (k, other)).all(axis=1)
            found[k, other] = Rim(ends[own], bows[own], short[own])
        return found

    @cached_property
    def chords(self) -> tuple[Array, Ints, Array, Flags]:
        """The chords of all rims, the patches of each, its bow, and whether triangles end there: see `Rim`."""
        of = np.repeat(
            np.array([*self.rims], np.int64).reshape(-1, 2), [len(own.ends) for own in self.rims.values()], 0
        )
        ends, bows, short = np.zeros((len(of), 2, 3)), np.zeros((len(of), 3)), np.zeros(len(of), bool)
        for own, rim in self.rims.items():
            rows = (of == own).all(axis=1)
            ends[rows], bows[rows], short[rows] = rim
        return ends, of, bows, short

    @cached_property
    def numbers(self) -> Array:
        """The patches as compiled code takes them, (p, 11): see `patch_kernels`."""
        found = numbers_of([own.surface for own in self.patches])
        found[:, -1] = [own.side for own in self.patches]
        return found

    @cached_property
    def packed(self) -> tuple[Any, ...]:
        """All of it as drawn as compiled code takes it: see `patch_kernels`."""
        return _Placed(self, 1.0, np.eye(4)).packed

    @property
    def holes(self) -> list[tuple[int, int]]:
        """The plane patches that holes open in, with the holes' patches."""
        return [(k, other) for k, other in self.rims if self.patches[other].concave]

    def in_hole(self, plane: int, hole: int, corners: Array, near: float) -> Flags:
        """Tell which pieces of a plane face, (n, m, 3), are between a chord of a hole's rim and the rim, (n,)."""
        # nothing is there. `near`: how far beyond the rim corners may be
        own = np.flatnonzero((self.chords[1] == (plane, hole)).all(axis=1))
        beyond = beyond_chords(self.packed, corners.reshape(-1, 3), own, near)
        whole = np.asarray(beyond.reshape(*corners.shape[:2], len(own)).all(axis=1))
        return np.asarray(whole.any(axis=1))

    def at(self, point: Array, near: float = 0.0) -> list[int]:
        """Return the patches that meet at a point of a face, or `near` one, the round ones first."""
        return self.at_each(point[None], near)[0]

    def at_each(self, points: Array, near: float = 0.0) -> list[list[int]]:
        """Return those of each of several points, (n, 3)."""
        near, (low, high) = max(DEFAULT.tie * self.body.size, near), self._boxes
        around = (low - near <= points[:, None]) & (points[:, None] <= high + near)
        found = [list[int]() for _ in points]
        for k, (patch, within) in enumerate(zip(self.patches, around.all(axis=2).T, strict=True)):
            rows = np.flatnonzero(within)
            rows = rows[np.abs(patch.gaps(points[rows])[0]) <= near] if len(rows) else rows
            for row in rows[self.has_points(k, points[rows])].tolist() if len(rows) else ():
                found[row].append(k)
        return found

    def of_revolution(self, point: Array, axis: Array) -> Flags:
        """Tell which surfaces of the patches any turn about an axis, a unit vector, through a point leaves, (p,)."""
        near, found = self.slack, list[bool]()
        for surface in (own.surface for own in self.patches):
            off = surface.origin - point
            centred = surface.flat or norms(off - (off @ axis) * axis) <= near
            aligned = norms(cross(surface.axis, axis)) * self.body.size <= near
            found.append(bool(centred and (aligned or (surface.line is None and not surface.ring))))
        return np.array(found)

    def room(self, near: Sequence[int], point: Array) -> float:
        """Return how far true edges are from a point of some patches, but for concave ones and those between two."""
        # what is behind a surface there is in the material beyond concave edges too
        own = np.isin(self.every_pair_of_patches, near)
        counted = ~(own.all(axis=1) | (own.any(axis=1) & self._folds))
        edges = self.every_edge[counted], self.every_pair_of_patches[counted], self._bows[counted]
        return float(least_to_edges(point, *edges, self.numbers, DEFAULT.tie * self.body.size))

    def onto(self, patches: Sequence[int], point: Array) -> Array:
        """Return a point moved onto the surfaces of patches."""
        at = point.copy()
        for _ in range(3):
            off, normal = zip(*(self.patches[k].gaps(at[None]) for k in patches), strict=True)
            at -= np.linalg.lstsq(np.concatenate(normal), np.concatenate(off), rcond=DEFAULT.sharp)[0]
            if np.abs(off).max() <= DEFAULT.tie * self.body.size:
                break
        return at

    def goes_round(self, k: int) -> bool:
        """Tell whether a cylinder's face goes all round its axis: it ends at edges across that alone."""
        edges = self.every_edge[(self.every_pair_of_patches == k).any(axis=1)]
        along = (edges[:, 1] - edges[:, 0]) @ self.patches[k].surface.axis
        return bool(np.abs(along).max(initial=0.0) <= self.slack)

    def patch_of(self, row: int) -> int:
        """Return the patch that a row of `Body.faces` stands for."""
        return int(self.owners[np.flatnonzero(self.rows == row)[0]])

    def row_at(self, k: int, point: Array) -> int:
        """Return the row of the body's face that stands for a patch at a point."""
        return int(self.rows[self._triangles[k][self._distances(k, point[None]).argmin()]])

    def depth(self, point: Array, direction: Array) -> float:
        """Return how far it is from a point of the surface, through the material, to the other side of the solid."""
        met, far = _lines(point[None], direction[None], self.corners)
        near = DEFAULT.nominal * self.body.size + 2.0 * max(deviation_of(self.body))
        return float(far[met & (far > near)].min(initial=np.inf))


true_faces = cached_of_whole(TrueFaces)


def patches_of_element(body: Body, element: Element) -> frozenset[int]:
    """Return the true faces, by number, that a face, an edge or a corner of a body is of."""
    faces = true_faces(body if body.exact is None else body.exact.facets)
    return frozenset(map(faces.patch_of, rows_of_element(body, element)))


class NearestPoints(NamedTuple):
    """Where two bodies come nearest, or overlap most, on their true faces."""

    gap: float  # negative where they overlap there
    points: Array  # the point of either body, as drawn, (2, 3)
    normal: Array  # unit normal of one of the faces there, from body 1 to body 2, (3,)
    other: int = 0  # which of several is body 2


class _Placed:
    """True faces of a body where it is, at its scale."""

    def __init__(self, faces: TrueFaces, scale: float, transform: Array) -> None:
        seed, turn = faces.body.seed, transform[:3, :3]
        self.faces, self.scale, self.turn, self.seed = faces, scale, turn, seed
        self.centre = turn @ seed + transform[:3, 3]
        self.corners, self.edges, self.tips = map(self.there, (faces.corners, faces.edges, faces.tips))

    @cached_property
    def patches(self) -> list[Patch]:
        """The patches there."""
        rigid = np.eye(4)
        rigid[:3, :3], rigid[:3, 3] = self.turn, self.centre / self.scale - self.turn @ self.seed
        return [own.placed(rigid, self.scale) for own in self.faces.patches]

    @cached_property
    def packed(self) -> tuple[Any, ...]:
        """All of it there as compiled code takes it: see `patch_kernels`."""
        faces, made, near = self.faces, self.faces.numbers.copy(), DEFAULT.tie * self.faces.body.size
        made[:, :3], made[:, 3:6], made[:, 8:10] = (
            self.there(made[:, :3]),
            made[:, 3:6] @ self.turn.T,
            self.scale * made[:, 8:10],
        )
        off = self.scale * np.array([2.0 * faces.off_triangles, max(deviation_of(faces.body))]) + near
        lengths = np.array([near, *off, 2.0 * RIM_SLACK * self.scale * faces.body.size])
        begins = np.searchsorted(faces.owners[faces.sorted], np.arange(len(made) + 1))
        ends, of, bows, short = faces.chords
        chords = self.there(ends), of, self.scale * bows @ self.turn.T, short
        whole = self.there(faces.every_edge)
        return made, self.corners[faces.sorted], begins, self.edges, faces.edge_patches, whole, *chords, lengths

    def there(self, points: Array) -> Array:
        """Return points as drawn where they are."""
        return self.centre + self.scale * (points - self.seed) @ self.turn.T

    def drawn(self, points: Array) -> Array:
        """Return points as drawn that are there."""
        return self.seed + (points - self.centre) @ self.turn / self.scale


def _lines(points: Array, directions: Array, corners: Array) -> tuple[Flags, Array]:
    """Tell which lines through points (n, 3) meet triangles (t, 3, 3), and how far along: both (n, t)."""
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    start = points[:, None] - corners[:, 0]
    across = cross(directions[:, None], two[None])
    turned = cross(start, np.broadcast_to(one, start.shape))
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / (across * one).sum(axis=2)
        u, v = (start * across).sum(axis=2) * inverse, (turned * directions[:, None]).sum(axis=2) * inverse
        far = (turned * two).sum(axis=2) * inverse
        return (u >= -RIM_SLACK) & (v >= -RIM_SLACK) & (u + v <= 1.0 + RIM_SLACK), far


def nearest_on_faces(
    faces: Sequence[TrueFaces], scales: Sequence[float] | Array, transform: Array, band: float
) -> list[NearestPoints]:
    """Return where bodies come nearest on their true faces, where a round one takes part.

    `scales` (2,). `transform` (4, 4): pose change of body 1. `band`: pairs of triangles up to this distance are looked
    at.
    """
    placed = _Placed(faces[0], scales[0], transform), _Placed(faces[1], scales[1], np.eye(4))
    found = list[NearestPoints]()
    for k, (own, other) in enumerate((placed, placed[::-1])):
        for gap, normal, point, foot in _nearest(own, other, band, both=k == 0):
            found += [
                NearestPoints(float(g), np.stack([own.drawn(x), other.drawn(y)][:: 1 - 2 * k]), (2 * k - 1) * n)
                for g, n, x, y in zip(gap, normal, point, foot, strict=True)
            ]
    return sorted([*found, *_crossing_edges(*placed, band)], key=lambda own: own.gap)


def followed(
    faces: Sequence[TrueFaces], scales: Sequence[float] | Array, transform: Array, known: NearestPoints
) -> NearestPoints | None:
    """Return where faces that are nearest at known points are so at another pose near by; arguments as above.

    None of corners, and of edges that cross.
    """
    both = _Placed(faces[0], scales[0], transform), _Placed(faces[1], scales[1], np.eye(4))
    met = [own.at(point) for own, point in zip(faces, known.points, strict=True)]
    k = int(len(met[1]) > len(met[0]))
    if not 0 < len(met[k]) < 3 or len(met[1 - k]) != 1:
        return None
    own, other, (against,) = both[k], both[1 - k], met[1 - k]
    on, extent = np.array([[*met[k], -1][:2]]), NEAR_BY * own.scale * own.faces.body.size
    start = own.there(known.points[k][None])
    x = lowest(start, on, np.array([against]), np.array([extent]), own.packed[0], other.packed[0])
    gap, normal = other.patches[against].gaps(x)
    points = np.stack([own.drawn(x[0]), other.drawn(x[0] - gap[0] * normal[0])][:: 1 - 2 * k])
    return known._replace(gap=float(gap[0]), points=points, normal=(2 * k - 1) * normal[0])


def line_of_contact(
    faces: Sequence[TrueFaces], scales: Sequence[float] | Array, transform: Array, point: Array
) -> Array | None:
    """Return the ends, (2, 3), of the straight line on which true faces touch through a point, a cylinder on a plane.

    None where they touch in a point there. Arguments as `nearest_on_faces` takes them; the point is of both bodies.
    """
    both = _Placed(faces[0], scales[0], transform), _Placed(faces[1], scales[1], np.eye(4))
    size = max(own.scale * own.faces.body.size for own in both)
    near = max(DEFAULT.tie * size, *(DIGITS * own.scale * own.faces.body.rounding for own in both))
    for pair in product(*(own.faces.at(own.drawn(point), near) for own in both)):
        patches = [own.patches[k] for own, k in zip(both, pair, strict=True)]
        if all(own.surface.flat for own in patches):  # they touch all over, or at an edge that is another one's
            continue
        normals = [own.gaps(point[None])[1][0] for own in patches]
        for along in [own.surface.ruling(point) for own in patches]:
            ends = point + size * np.outer((1.0, -1.0), along)
            if normals[0] @ normals[1] < 0.0 and max(np.abs(own.gaps(ends)[0]).max() for own in patches) <= near:
                triangles = (own.corners[own.faces.owners == k] for own, k in zip(both, pair, strict=True))
                spans = [_covered(*own, point, along, near) for own in zip(triangles, normals, strict=True)]
                low, high = max(own[0] for own in spans), min(own[1] for own in spans)
                if high - low > near:
                    return np.asarray(point + np.outer((low, high), along))
    return None


def _covered(corners: Array, normal: Array, point: Array, along: Array, near: float) -> tuple[float, float]:
    """Return from where to where a line through a point is on a face that looks along a normal, by its triangles."""
    arms = corners[unit_normals(corners) @ normal > 0.0] - point
    here, aside = arms @ along, arms @ cross(normal, along)
    aside[np.abs(aside) <= near] = 0.0
    there, beyond = (np.roll(own, -1, axis=1) for own in (here, aside))
    rise = np.where(aside * beyond < 0.0, aside - beyond, np.nan)
    met = np.hstack([np.where(aside == 0.0, here, np.nan), here + aside / rise * (there - here)])
    met = met[~np.isnan(met).all(axis=1)]
    low = high = -np.inf  # a stretch ends where as many pieces have ended as begun
    for start, end in zip(*np.sort([np.nanmin(met, axis=1), np.nanmax(met, axis=1)]).tolist(), strict=True):
        if high >= -near and start > high + near:
            break
        low, high = (start if start > high + near else low), max(high, end)
    return low, high


def _nearest(own: _Placed, other: _Placed, band: float, *, both: bool) -> Iterator[tuple[Array, Array, Array, Array]]:
    """Yield where features of one body come nearest to patches of the other."""
    faces = own.faces
    features = (
        (own.corners, faces.owners[:, None]),
        (own.edges, faces.edge_patches),
        (own.tips[:, None], np.empty((len(own.tips), 0), np.int64)),
    )
    for points, of in features:
        if not len(points):
            continue
        near = _near(points, of, own, other, band, both=both)
        keys, which = np.unique(np.column_stack([of[near[:, 0]], near[:, 1]]), axis=0, return_inverse=True)
        if not len(keys):
            continue
        pieces = [points[near[own, 0]] for own in groups_of(which.reshape(-1))]
        starts = [_starts(each, other, key[-1]) for each, key in zip(pieces, keys.tolist(), strict=True)]
        extents = np.array([float(norms(np.ptp(each, axis=(0, 1)))) for each in pieces])
        key = np.repeat(np.arange(len(keys)), [*map(len, starts)])
        on = np.column_stack([keys[:, :-1], np.full((len(keys), 3 - keys.shape[1]), -1)])
        patches, others = own.packed[0], other.packed[0]
        x = lowest(np.concatenate(starts), on[key], keys[key, -1], extents[key], patches, others)
        for k in np.flatnonzero(_level(keys, patches, others)).tolist():
            # gaps are alike along it: what of a rim is over the plane may be where it is deepest in a hole there
            holes = [hole for plane, hole in other.faces.rims if plane == keys[k, -1]]
            deepest = (keys[:, :-1] == keys[k, :-1]).all(axis=1) & np.isin(keys[:, -1], holes)
            more = np.flatnonzero(deepest[key[: sum(map(len, starts))]])
            x, key = np.concatenate([x, x[more]]), np.concatenate([key, np.full(len(more), k)])
        kept, *each = nearest(x, on[key], keys[key, -1], own.packed, other.packed, other.faces.is_round, band)
        gap, normal, foot = (known[kept] for known in each)
        x, key, tight = x[kept], key[kept], DEFAULT.nominal * faces.body.size
        for rows in groups_of(np.unique(key, return_inverse=True)[1]) if len(key) else ():
            chosen = list[int]()
            for j in rows[np.argsort(gap[rows], kind="stable")].tolist():
                if all(norms(x[j] - x[i]) > tight for i in chosen):
                    chosen.append(j)
            yield gap[chosen], normal[chosen], x[chosen], foot[chosen]


def _level(keys: Ints, patches: Array, others: Array) -> Flags:
    """Tell of which features, by their patches and that of the other body, one patch is a plane parallel to that."""
    flat, theirs = patches[:, 6] == 0.0, others[keys[:, -1]]
    found = np.zeros(len(keys), bool)
    for own in keys[:, :-1].T:
        found |= flat[own] & (norms(cross(patches[own, 3:6], theirs[:, 3:6])) <= DEFAULT.nominal)
    return np.asarray(found & (theirs[:, 6] == 0.0))


def _starts(pieces: Array, other: _Placed, against: int) -> Array:
    """Return places on pieces of a feature from which its nearest points to a patch are looked for."""
    start = pieces.mean(axis=1)
    if pieces.shape[1] == 2:  # in the middle of what of an edge is over the patch: along a straight one gaps are alike
        along = pieces[:, 1] - pieces[:, 0]
        off = other.corners[other.faces.owners == against].reshape(-1, 1, 3) - pieces[:, 0]
        shares = np.clip((off * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
        start = pieces[:, 0] + (shares.min(axis=0) + shares.max(axis=0))[:, None] / 2.0 * along
    if len(start) > STARTS:  # the nearest, and some everywhere
        order = np.argsort(other.patches[against].gaps(start)[0], kind="stable")
        spread = np.linspace(0, len(start) - 1, STARTS // 2).astype(int)
        start = start[np.unique(np.concatenate([order[: STARTS // 2], spread]))]
    return start


def _near(points: Array, of: Ints, own: _Placed, other: _Placed, band: float, *, both: bool) -> Ints:
    """Return which features, by their pieces (n, k, 3), may be within a band of which patches, (m, 2)."""
    # those with a round face alone: of two round patches once, and none of a plane, which has its nearest points at its
    # edges
    faces, others = own.faces, other.faces
    low, high = other.corners.min(axis=1) - band, other.corners.max(axis=1) + band
    near = overlapping_between(points.min(axis=1), points.max(axis=1), low, high)
    near = np.unique(np.column_stack([near[:, 0], others.owners[near[:, 1]]]), axis=0)
    round_ = faces.is_round[of[near[:, 0]]].any(axis=1) | others.is_round[near[:, 1]]
    if of.shape[1] == 0:  # corners that may be next to a rim, where parts within the true ones lack some of the plane
        round_ |= np.isin(near[:, 1], [plane for plane, _ in others.rims])
    if of.shape[1] == 1:
        round_ &= faces.is_round[of[near[:, 0], 0]]
        if not both:
            round_ &= ~others.is_round[near[:, 1]]
    return near[round_]


def _crossing_edges(one: _Placed, two: _Placed, band: float) -> Iterator[NearestPoints]:
    """Yield where convex edges of two bodies cross, one of a round face at least, along the normal of both."""
    both = one, two
    low, high = one.edges.min(axis=1) - band, one.edges.max(axis=1) + band
    near = overlapping_between(low, high, two.edges.min(axis=1), two.edges.max(axis=1))
    of = np.array([own.faces.edge_patches[rows] for own, rows in zip(both, near.T, strict=True)])
    of[1] += len(one.faces.patches)
    start, chords = np.array([own.edges[rows] for own, rows in zip(both, near.T, strict=True)]).transpose(2, 0, 1, 3)
    round_ = np.concatenate([own.faces.is_round for own in both])[of].any(axis=(0, 2))
    start, chords, of = start[:, round_], (chords - start)[:, round_], of[:, round_]
    patches = np.concatenate([own.packed[0] for own in both])
    at, normals, aims = nearest_on_edges(start + chords / 2.0, chords, patches, of)
    start, chords, of, at, normals = (own[:, aims] for own in (start, chords, of, at, normals))
    off, across = at[1] - at[0], cross(normals[:, :, 0], normals[:, :, 1])
    normal = units(cross(*across))
    # it is between those of the faces at either edge, and none of them: these tell their gap
    looks = np.array([normal, -normal])
    between = np.array([dots(cross(looks, normals[:, :, 1]), across), dots(cross(normals[:, :, 0], looks), across)])
    side = np.sign(between[0, 0])
    gaps, share = side * dots(off, normal), dots(at - start, chords) / dots(chords, chords)
    kept = (side * between > DEFAULT.nominal * dots(across, across)).all(axis=(0, 1)) & (np.abs(gaps) <= band)
    kept &= ((share > -RIM_SLACK) & (share < 1.0 + RIM_SLACK)).all(axis=0)
    kept &= norms(off - (side * gaps)[:, None] * normal) <= DEFAULT.nominal * one.faces.body.size
    of[1] -= len(one.faces.patches)
    for k in np.flatnonzero(kept).tolist():
        behind = zip(both, of[:, [k]], at[::-1, [k]], strict=True)
        if not any(is_outside(own.packed, pair, x, gaps[[k]])[0] for own, pair, x in behind):
            points = np.array([own.drawn(x) for own, x in zip(both, at[:, k], strict=True)])
            yield NearestPoints(float(gaps[k]), points, side[k] * normal[k])
