"""The judge's look at round faces: on points of these, by equations of its own, and finer where they come nearest.

What is solved for bodies of facets must hold for the faces that these stand for. Points are taken on the triangles of
either body near the other, brought onto the face that a triangle stands for, which ends where its surface meets the
next one, and measured against the faces of the other body; about the nearest the grid is made finer until it tells no
more.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array, Flags, Ints, distinct_rows
from fcdm_opt.geometry.facet_errors import deviation_of
from fcdm_opt.geometry.patches import TrueFaces
from fcdm_opt.geometry.polygons import Sides
from fcdm_opt.geometry.tessellation import Swept
from fcdm_opt.judge.face_kernels import heights, on_face, points_of_edges, to_segments
from fcdm_opt.tolerances import DEFAULT

GRID, MANY = 6, 48  # points along a side of a triangle, half as many of many triangles
FINER, TIMES = 0.35, 24  # of a grid about the nearest points, and how often
AROUND = -1.0, -0.5, 0.0, 0.5, 1.0  # of its width: the next, which is less wide, leaves none between
FEWEST, FEWEST_OF_DEEPEST = 6, 12  # times at least, of faces that are not and that are the deepest known
NEARLY = 1e-3  # of the band: by so much less deep points may yet be the deepest
SLACK = 1e-9  # of the band: nearer to a rim a point is on it
BENT = 1e-12  # of a chord: an edge that leaves it by less is straight
BOWED = 1.5  # times what an edge leaves its chord at three places: it does nowhere by more
KEPT, LATE, OF_EACH = 16, 4, 2  # points about which it is made finer, of each two surfaces, and of each triangle


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
    deepest = _deepest(one, two, band, _Closed(room, without), -np.inf)
    return -_deepest(two, one, band, _Closed(room, {(j, i) for i, j in without}), deepest)


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


class _BentEdges(NamedTuple):
    """Edges of a face that leave their chords: the face beyond, their ends, how far off they are and where to."""

    others: Ints
    start: Array
    end: Array
    room: Array
    off: Array


class _Closed(NamedTuple):
    """Faces of two bodies that are not looked at together, and how far off a face a point counts as on it."""

    room: float
    faces: Collection[tuple[int, int]]

    def has(self, own: _There, other: _There, points: Array, feet: Array) -> Flags:
        """Tell which points of one body are on such a face, and their feet on the one that it stands on."""
        found = np.zeros(len(points), bool)
        for i, j in self.faces:
            sides = (own, i, points), (other, j, feet)
            off = np.abs([there.surfaces.of_each(k).height(at)[0] for there, k, at in sides])
            rows = np.flatnonzero((off.max(axis=0) <= self.room) & ~found)
            found[rows] = np.all([there.has_near(k, at[rows], self.room) for there, k, at in sides], axis=0)
        return found


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
        self._known = dict[int, _BentEdges]()
        self.surfaces = _Surfaces.of([own.surface for own in faces.patches]).placed(pose, scale, seed)
        self.sides = np.array([own.side for own in faces.patches])

    def points(self, k: int, which: Ints, shares: Array) -> Array:
        """Return points of a face by triangles of it and shares of their corners: those of sides are on its edges."""
        corners = self.corners[which]
        points = np.einsum("nk,nki->ni", shares, corners)
        on_edges, edges = np.zeros(len(points), bool), points.copy()
        next_ = np.roll(np.arange(3), -1)
        whole, others = shares + shares[:, next_], self.neighbours[which]
        rows, s = np.nonzero((whole > 0.0) & self.may_bend(k, others))
        start, end = corners[rows, s], corners[rows, next_[s]]
        along = (shares[rows, next_[s]] / whole[rows, s])[:, None]
        curve = _on_edge(self.surfaces.of_each(k), self.surfaces.of_each(others[rows, s]), start, end, along)
        np.add.at(points, rows, whole[rows, s, None] * (curve - start - along * (end - start)))
        ends = shares[rows, next_[next_[s]]] == 0.0
        on_edges[rows[ends]], edges[rows[ends]] = True, curve[ends]
        if self.is_round[k]:
            for _ in range(3):
                height, directions = self.surfaces.of_each(k).height(points)
                points = points - height[:, None] * directions
        return np.where(on_edges[:, None], edges, points)

    def may_bend(self, k: int, others: Ints) -> Flags:
        """Tell with which faces it may have bent edges."""
        return np.asarray((others != k) & (self.is_round[k] | self.is_round[others]))

    def has(self, k: int, feet: Array, slack: float, *, over: bool = False) -> Flags:
        """Tell which points of a surface are on the face: on its triangles, but where an edge leaves its chord."""
        # with `over` they are known to be over its triangles
        if not len(feet):
            return np.zeros(0, bool)
        m, start, end, room, _ = self._bent_edges(k)
        numbers, triangles = self.surfaces.numbers, self.corners[self.owners == k]
        return on_face(
            numbers[k : k + 1], self.sides[k], feet, triangles, over, numbers[m], start, end, room.ravel(), slack
        )

    def has_near(self, k: int, feet: Array, slack: float) -> Flags:
        """Tell which points of a surface are on the face, or no further off an edge than a slack."""
        return self.has(k, feet, slack) | (to_segments(feet, self.edges) <= slack)

    def off_triangles(self, k: int, along: Array | None) -> float:
        """Return how far points of a face may be off its triangles, along a direction where one is given."""
        edges, bow, axis = self._bent_edges(k), self.bow if self.is_round[k] else 0.0, self.surfaces.axis[k]
        if along is None:
            return bow + float(edges.room.max(initial=0.0))
        if self.surfaces.line[k, 0] == 1.0:  # points of a cylinder are off square to its axis
            bow *= float(np.linalg.norm(np.cross(axis, along)))
        return bow + BOWED * float(np.abs(edges.off @ along).max(initial=0.0))

    def _bent_edges(self, k: int) -> _BentEdges:
        """Return the edges of a face that leave their chords."""
        if k not in self._known:
            which, s = np.nonzero((self.owners == k)[:, None] & self.may_bend(k, self.neighbours))
            others = self.neighbours[which, s]
            start, end = (self.corners[which, own] for own in (s, (s + 1) % 3))
            off = np.zeros((3, len(start), 3))
            for i, share in enumerate((0.25, 0.5, 0.75)):
                shares = np.full((len(start), 1), share)
                curve = _on_edge(self.surfaces.of_each(k), self.surfaces.of_each(others), start, end, shares)
                off[i] = curve - start - share * (end - start)
            bow = np.linalg.norm(off, axis=2).max(axis=0)
            bent = bow > BENT * np.linalg.norm(end - start, axis=1)
            self._known[k] = _BentEdges(others[bent], start[bent], end[bent], BOWED * bow[bent, None], off[:, bent])
        return self._known[k]

    def nearer(self, points: Array, k: int, depth: Array, slack: float) -> Flags:
        """Tell which points are less deep behind another face or an edge than behind this one, or before a face."""
        found = np.zeros(len(points), bool)
        height, directions = self.surfaces.height(points[:, None])
        off = self.sides * height
        near = (off > slack - depth[:, None]) & (off <= depth[:, None])
        near[:, k] = False
        for m in np.flatnonzero(near.any(axis=0)).tolist():
            rows = np.flatnonzero(near[:, m] & ~found)
            found[rows] = self.has(m, points[rows] - height[rows, m, None] * directions[rows, m], slack)
        rows = np.flatnonzero(~found & (depth > 2.0 * self.bow + slack))  # where faces end at a concave edge
        found[rows] = to_segments(points[rows], self.edges) < depth[rows] - self.bow - slack
        return found


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


def _deepest(own: _There, other: _There, band: float, without: _Closed, known: float) -> float:
    """Return how deep points of one body lie in the other at most, or what is known where that is no less."""
    pairs = list[tuple[float, int, int, Ints]]()
    low, high = own.corners.min(axis=1), own.corners.max(axis=1)
    for k in np.unique(other.owners).tolist():
        theirs = other.corners[other.owners == k]
        ends = theirs.reshape(-1, 3).min(axis=0) - band, theirs.reshape(-1, 3).max(axis=0) + band
        near = ((high >= ends[0]) & (low <= ends[1])).all(axis=1)
        for j in np.unique(own.owners[near]).tolist():
            if (j, k) not in without.faces:
                triangles = np.flatnonzero(near & (own.owners == j))
                pairs.append((_at_most(own, j, triangles, other, k), j, k, triangles))
    for most, j, k, triangles in sorted(pairs, key=lambda pair: abs(pair[0])):  # those that touch show most of others
        if most > known + SLACK * band:
            known = max(known, _of_two(own, j, triangles, other, k, band, known, without))
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


def _of_two(
    own: _There, j: int, triangles: Ints, other: _There, k: int, band: float, known: float, without: _Closed
) -> float:
    """Return how deep points of a face lie behind another; closely only where it is deeper than what is known."""
    # of plane faces without points at the edge of a contact that does not count; minus infinity without others
    grid = GRID if len(triangles) <= MANY else GRID // 2
    steps = np.arange(grid) / (grid - 1)
    shares = np.array([(max(1.0 - u - v, 0.0), u, v) for u in steps for v in steps if u + v <= 1.0 + 1e-9])
    shares[shares < 1e-9] = 0.0
    surface, side = other.surfaces.of_each(k), other.sides[k]
    which, shares = np.repeat(triangles, len(shares)), np.tile(shares, (len(triangles), 1))
    deepest, width, slack = -np.inf, 1.0, SLACK * band
    sides = own.corners[triangles] - np.roll(own.corners[triangles], 1, axis=1)
    longest = float(np.linalg.norm(sides, axis=2).max())
    counted = not without.faces or (own.is_round[j] and other.is_round[k])
    for turn in range(TIMES):
        points = own.points(j, which, shares)
        height, directions = surface.height(points)
        depth = -side * height
        inside = np.abs(height) <= band
        apart = longest * width * (0.5 if turn else 1.0 / (grid - 1))
        between = np.flatnonzero((height * side > band) & (height * side <= band + apart))
        if not inside.any() and len(between):  # of wide triangles, points that come as near lie between those taken
            width *= FINER
            which, shares = _finer(between[np.argsort(-depth[between])], which, shares, width)
            continue
        rows = np.flatnonzero(inside)
        inside[rows] = other.has(k, points[rows] - height[rows, None] * directions[rows], slack)
        rows = np.flatnonzero(inside)  # sides of triangles from a bent edge may cut across its bow
        inside[rows] = own.has(j, points[rows], slack, over=True)
        rows = np.flatnonzero(inside)
        inside[rows] = ~other.nearer(points[rows], k, depth[rows], slack)
        feet = points - height[:, None] * directions
        rows = np.flatnonzero(inside & (depth > known) & (depth < -without.room) & (not counted))
        inside[rows] = ~without.has(own, other, points[rows], feet[rows])
        if not inside.any():
            break
        before, deepest = deepest, max(deepest, float(depth[inside].max()))
        if not counted and turn == FEWEST - 1 and deepest >= -without.room:  # when points beside these are not as deep
            rows = np.flatnonzero(inside & (depth >= -without.room))
            counted = deepest > without.room or not without.has(own, other, points[rows], feet[rows]).all()
        fewest = FEWEST if deepest < known - NEARLY * band else FEWEST_OF_DEEPEST
        if turn >= fewest and deepest - before <= 1e-12 * float(np.abs(points).max()):
            break
        width *= FINER
        order, most = np.flatnonzero(inside)[np.argsort(-depth[inside])], LATE if turn >= FEWEST else KEPT
        which, shares = _finer(order, which, shares, width, most)
    return deepest if counted or deepest < -without.room else -np.inf


def _finer(order: Ints, which: Ints, shares: Array, width: float, most: int = KEPT) -> tuple[Ints, Array]:
    """Return triangles and shares of their corners on a finer grid about the first points of an order."""
    best = _best(order, which, most)
    moves = width * np.array([(u, v) for u in AROUND for v in AROUND])
    moves = np.column_stack([-moves.sum(axis=1), moves])
    shares = np.clip(shares[best][:, None] + moves, 0.0, 1.0).reshape(-1, 3)
    return np.repeat(which[best], len(moves)), shares / shares.sum(axis=1, keepdims=True)


def _best(order: Ints, which: Ints, most: int) -> Ints:
    """Return the first rows of an order, few of each triangle: what is largest on a grid may not be it between."""
    kept, count = list[int](), dict[int, int]()
    for row, triangle in zip(order.tolist(), which[order].tolist(), strict=True):
        if count.get(triangle, 0) < OF_EACH:
            count[triangle] = count.get(triangle, 0) + 1
            kept.append(row)
            if len(kept) == most:
                break
    return np.array(kept)
