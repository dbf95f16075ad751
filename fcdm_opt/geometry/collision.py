"""Distance and overlap of two bodies at given scales, by a collision library and by explicit vertices.

The judge's view of a pair: it uses neither contact equations nor the kernels of the decision curve. Two independent
ways: `signed_distances` asks coal (GJK and EPA); `least_separations` projects every vertex on every direction that can
separate. Both take many scale pairs and poses at once.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from copy import copy
from fractions import Fraction
from itertools import product
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fcdm_opt import pacing
from fcdm_opt.geometry import judging
from fcdm_opt.geometry.arrays import Array, Flags, Ints, exactly
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.measures import least_vector, nearest_mixture
from fcdm_opt.tolerances import DEFAULT

# Above this many edge pairs `least_separations` costs more than all else that the judge does: nan, coal stands alone.
EXHAUSTIVE = 250_000
BLOCK = 4096  # directions that are looked at together: what they take stays in the processor's memory
MOST_PAIRS = 4096  # part pairs whose separations along face normals are looked at
MOST = 200  # vertices taken up in the search for the nearest points; a few for each face that holds them

Rows = tuple[Any, Any]  # which faces or edges of part 1, and of part 2
ALL: Rows = slice(None), slice(None)


class Direction(NamedTuple):
    """A direction that may separate two parts, named by vertex indices of the parts as `ConvexPart` numbers them.

    A face of part 1 or part 2 is three of its corners and nothing of the other part; a pair of edges is two and two.
    The direction is `sign` times the cross product of the first two sides named.
    """

    one: tuple[int, ...]
    two: tuple[int, ...]
    sign: int


class PerPair(threading.local):
    """What is worked out once for two bodies: kept as long as both are, for each thread its own.

    `build`: makes it from body 1 and body 2; it must not hold the bodies themselves, or they would never go.
    """

    def __init__(self, build: Callable[[Body, Body], Any]) -> None:
        self._build = build
        self._made: WeakKeyDictionary[Body, WeakKeyDictionary[Body, Any]] = WeakKeyDictionary()

    def __call__(self, movable: Body, static: Body) -> Any:
        """Return what belongs to these two bodies."""
        own = self._made.get(movable)
        if own is None:
            own = self._made.setdefault(movable, WeakKeyDictionary())
        found = own.get(static)
        if found is None:
            found = own[static] = self._build(movable, static)
        return found


class ScaledPair:
    """Two bodies of convex parts, body 1 scaled and moved, body 2 scaled; hulls are built once.

    Not for several threads at once, see `scaled_pair`.

    Parameters
    ----------
    movable, static : Body
        As drawn. Coordinates are handled relative to the static seed, so far-away bodies lose nothing more.

    Notes
    -----
    coal is asked on bodies of about unit size. What is known of its answers (measured in the tests): on pairs in
    general position they are right to rounding, at touch too. Between parallel edges that are less than about 1e-4 of
    the size apart it often reports 0; and some settings return +-1.8e308. Every answer near touch is therefore
    confirmed by its witness points, which must lie in the hulls and be that far apart. Where they are not, coal is
    asked once more with the way between the parts as initial guess; if that fails too, the answer is nan. coal takes no
    hull whose vertices have more than 255 neighbours, such as a cone of many sides: its distances are worked out from
    explicit vertices, nan for pairs of very large parts.
    """

    def __init__(self, movable: Body, static: Body) -> None:
        import coal

        self._coal = coal
        self._seeds = np.array([movable.seed, static.seed])
        self._hulls = [[_Hull(part) for part in body.parts] for body in (movable, static)]
        self.reaches = np.array([max(float(np.abs(own.points).max()) for own in hulls) for hulls in self._hulls])
        self._solids = [hull.solid for hull in self._hulls[0]], [hull.solid for hull in self._hulls[1]]
        self._here, self._result, self._request = coal.Transform3s(), coal.DistanceResult(), self._settings()

    def _settings(self) -> Any:
        request = self._coal.DistanceRequest()
        request.gjk_tolerance = request.epa_tolerance = DEFAULT.judge_gjk
        return request

    @property
    def count(self) -> int:
        """Number of part pairs."""
        return len(self._hulls[0]) * len(self._hulls[1])

    def between(self, i: int, j: int) -> ScaledPair:
        """Return the same of part i of body 1 and part j of body 2 alone."""
        if self.count == 1:
            return self
        single = copy(self)
        single._hulls = [[self._hulls[0][i]], [self._hulls[1][j]]]
        single._solids = [self._solids[0][i]], [self._solids[1][j]]
        return single

    def direction(self, rho: ArrayLike, transform: Array) -> Array:
        """Return the unit direction from the first part of body 1 to that of body 2 in which they are nearest."""
        return _towards(self._hulls[0][0], self._hulls[1][0], self._frame(rho, transform))

    def touching(self, rho: ArrayLike, transform: Array, slack: float) -> list[tuple[int, int]]:
        """Return the part pairs that are no further apart, or deeper in each other, than a length at a scale pair."""
        frames = self._framed(np.asarray(rho)[None], transform[None])
        least, (first, second) = slack / frames[0, judging.UNIT], self._hulls
        near = np.argwhere(judging.nearness(*self._solids, frames)[0] <= least).tolist()
        return [(i, j) for i, j in near if abs(self._asked(first[i], second[j], frames)[0]) <= least]

    def signed_distance(self, rho: ArrayLike, transform: Array) -> float:
        """Return the signed distance at one scale pair and pose, see `signed_distances`."""
        return float(self.signed_distances(np.asarray(rho)[None], transform[None])[0])

    def signed_distances(self, pairs: ArrayLike, transforms: Array, *, settled: Flags | None = None) -> Array:
        """Return the least signed distance over the part pairs, (k,), length units.

        The Euclidean distance if apart, minus the penetration depth of the deepest part pair if overlapping; infinite
        where all part pairs are settled; nan if coal cannot tell, and where scales or pose are none.

        - `pairs` (k, 2): scales, all positive.
        - `transforms` (k, 4, 4): pose changes of body 1, world frame.
        - `settled` (k, parts 1, parts 2), optional: part pairs that are not asked about.
        """
        frames = self._framed(pairs, transforms)
        return self._least(frames, settled) * frames[:, judging.UNIT]

    def distances_and_separations(self, pairs: ArrayLike, transforms: Array) -> tuple[Array, Array]:
        """Return `signed_distances` and `least_separations`, (k,) each; arguments as there."""
        frames = self._framed(pairs, transforms)
        unit = frames[:, judging.UNIT]
        return self._least(frames, None) * unit, judging.least_gaps(*self._solids, EXHAUSTIVE, frames) * unit

    def least_separations(self, pairs: ArrayLike, transforms: Array) -> Array:
        """Return the least of the part pairs' largest separations over face normals and edge x edge directions, (k,).

        Of part pairs that the spheres about them leave in doubt, from explicit vertices: positive exactly where they
        are apart, and then at most their distance, minus the penetration depth otherwise; nan for very large parts.

        `pairs` (k, 2): scales, all positive. `transforms` (k, 4, 4): pose changes of body 1, world frame.
        """
        frames = self._framed(pairs, transforms)
        return judging.least_gaps(*self._solids, EXHAUSTIVE, frames) * frames[:, judging.UNIT]

    def lower_bounds(self, pairs: ArrayLike, transforms: Array) -> Array:
        """Return bounds below `least_separations`, (k,), more cheaply: by spheres about the parts, else by faces."""
        frames = self._framed(pairs, transforms)
        return judging.nearness(*self._solids, frames).min(axis=(1, 2)) * frames[:, judging.UNIT]

    def separation_by_faces(self, rho: ArrayLike, transform: Array, enough: float) -> float:
        """Return the least over the part pairs of the largest gap along a face normal of either, length."""
        # once a pair has no more than `enough`, that; 0 for more than `MOST_PAIRS` pairs, which take long
        if self.count > MOST_PAIRS:
            return 0.0
        frame, least = self._framed(np.asarray(rho)[None], transform[None]), np.inf
        for one, two in product(*self._solids):
            least = min(least, float(judging.widest(one, two, frame, edged=False)[0] * frame[0, judging.UNIT]))
            if least <= enough:
                break
        return least

    def _least(self, frames: Array, settled: Flags | None) -> Array:
        """Return coal's least signed distance over the part pairs in each frame, the nearest asked first; units."""
        # asked as long as any can be less; nan stays
        first, second = self._hulls
        known, single = ~np.isnan(frames[:, 0]), len(first) == len(second) == 1
        if single and settled is None and known.all():
            return self._asked(first[0], second[0], frames)
        if single:
            bounds = np.where(known[:, None], -np.inf, np.nan)
        else:
            bounds = judging.nearness(*self._solids, frames).reshape(len(frames), -1)
        if settled is not None:
            bounds[settled.reshape(bounds.shape)] = np.nan
        least = np.where(known, np.inf, np.nan)
        for pair, at in judging.nearest_first(bounds, least):
            values = self._asked(first[pair // len(second)], second[pair % len(second)], frames[at])
            least[at] = np.minimum(least[at], values)
        return least

    def _asked(self, one: _Hull, two: _Hull, frames: Array) -> Array:
        """Return coal's signed distance of two hulls, asked again with a hint where it cannot be believed; units."""
        pacing.check()
        if one.shape is None or two.shape is None:
            return np.array([_explicit(one, two, _Frame.of(frame)) for frame in frames])
        found, believed = self._distances(one, two, frames, self._request)
        for k in () if believed.all() else np.flatnonzero(~believed).tolist():
            found[k] = np.nan
            if not np.isnan(frames[k, 0]):
                again = self._settings()
                again.gjk_initial_guess = self._coal.GJKInitialGuess.CachedGuess
                again.cached_gjk_guess = -_towards(one, two, _Frame.of(frames[k]))
                value, sure = self._distances(one, two, frames[k : k + 1], again)
                found[k] = value[0] if sure[0] else np.nan
        return found

    def _distances(self, one: _Hull, two: _Hull, frames: Array, request: Any) -> tuple[Array, Flags]:
        """Return coal's signed distance of two hulls in each frame, (k,), units, and which can be believed."""
        X, Y = judging.placed(one.order, frames, True), judging.placed(two.order, frames, False)
        here, result, points, others = self._here, self._result, one.placed, two.placed
        ask, shape, other = self._coal.distance, one.shape, two.shape
        count = len(frames)
        values, witnesses, opposite = np.empty(count), np.empty((count, 3)), np.empty((count, 3))
        for k in range(count):
            points[:], others[:] = X[k], Y[k]
            result.clear()
            values[k] = ask(shape, here, other, here, request, result)
            witnesses[k], opposite[k] = result.getNearestPoint1(), result.getNearestPoint2()
        return values, judging.believed(one.solid.planes, two.solid.planes, frames, values, witnesses, opposite)

    def exact_separation(self, rho: ArrayLike, transform: Array) -> float:
        """Return what `least_separations` does, in rational arithmetic on the numbers as given, rounded at the end."""
        # only directions that come near the largest separation in floats are worked out again; the transform is taken
        # as it is, rational and not exactly orthogonal
        frame = self._frame(rho, transform)
        least = np.full(1, np.inf)
        T, (here, there), (rho_1, rho_2) = exactly(transform), exactly(self._seeds), exactly(np.asarray(rho))
        bounds = judging.nearness(*self._solids, self._framed(np.asarray(rho)[None], transform[None]))
        for pair, _ in judging.nearest_first(bounds.reshape(1, -1) - DEFAULT.tie, least):
            one, two = self._hulls[0][pair // len(self._hulls[1])], self._hulls[1][pair % len(self._hulls[1])]
            places = _best_directions(one, two, frame)
            if not places:
                return float("nan")
            first = (here + rho_1 * (exactly(one.part.vertices) - here)) @ T[:3, :3].T + T[:3, 3]
            second = there + rho_2 * (exactly(two.part.vertices) - there)
            least[0] = min(least[0], max(_exact_gap(first, second, place) for place in places) / frame.unit)
        return float(least[0] * frame.unit)

    def gradients(self, rho: ArrayLike, transform: Array, slack: float) -> Array:
        """Return how fast the separation of touching parts falls as the scales grow, (k, 2)."""
        # one row for each face normal and edge x edge direction along which a part pair that touches, to within
        # `slack`, is no more than `slack` away from touching
        frame = self._frame(rho, transform)
        found = [np.empty((0, 2))]
        for one, two in product(*self._hulls):
            pacing.check()
            gaps, n = _gaps(one, two, frame)
            if abs(np.fmax.reduce(gaps)) * frame.unit <= slack:
                tight = n[gaps * frame.unit >= -slack]
                found.append(
                    np.column_stack([(one.points @ frame.R.T @ tight.T).max(0), -(two.points @ tight.T).min(0)])
                )
        return np.vstack(found)

    def best_direction(
        self, rho: ArrayLike, transform: Array, parts: tuple[int, int], elements: tuple[Ints, Ints]
    ) -> Direction:
        """Return a direction in which two parts that touch with some elements are farthest apart, or overlap least."""
        # among the normals of the faces at the elements' vertices, and of pairs of edges there: between these lies
        # every direction that keeps parts apart which touch so. Faces come first
        one, two = (hulls[k] for hulls, k in zip(self._hulls, parts, strict=True))
        frame = self._frame(rho, transform)
        first, second = (_edges_at(hull.part, rows) for hull, rows in zip((one, two), elements, strict=True))
        own, others = np.unique(one.part.edges[first, 2:]), np.unique(two.part.edges[second, 2:])
        gaps = _gaps_along(_directions(one, two, frame.R, (own, others), (first, second)), one, two, frame)
        k = int(np.flatnonzero(gaps >= np.nanmax(gaps) - DEFAULT.tie)[0])
        return _named(one, two, k, (own, others), (first, second))

    def _framed(self, pairs: ArrayLike, transforms: Array) -> Array:
        rows, poses = np.array(pairs, dtype=np.float64), np.array(transforms, dtype=np.float64, order="C")
        return judging.framed(rows, poses, self._seeds, self.reaches)

    def _frame(self, rho: ArrayLike, transform: Array) -> _Frame:
        return _Frame.of(self._framed(np.asarray(rho)[None], transform[None])[0])


scaled_pair = PerPair(ScaledPair)  # of two bodies, the same at every call: for one thread


class _Frame(NamedTuple):
    """A row of `judging.framed` by name."""

    scales: tuple[float, float]
    unit: float
    offset: Array
    R: Array
    row: Array

    @classmethod
    def of(cls, row: Array) -> _Frame:
        return cls((float(row[0]), float(row[1])), float(row[2]), row[3:6], row[6:].reshape(3, 3), row)


class _Hull:
    """One part as a solid, and coal's.

    `placed` are coal's own points, to be overwritten, and `order` the part's points in their order. `shape` is None
    where coal takes no such hull.
    """

    def __init__(self, part: ConvexPart) -> None:
        self.part, self.solid = part, judging.Solid.of(part)
        self.points, self.edges, even = self.solid.points, self.solid.edges, self.solid.even
        # coal's Qhull breaks down on thin parts (a slab of 1e-9 ends the process). A hull's faces do not change under
        # affine maps: build it with equal extents, then put the true points in place.
        self.shape = _shaped(even, part.loops)
        if self.shape is None:
            return
        self.placed = self.shape.points()
        rows = {tuple(point): k for k, point in enumerate(even.tolist())}
        self.order = self.points[[rows[tuple(point)] for point in self.placed.tolist()]]


def _shaped(points: Array, loops: tuple[tuple[int, ...], ...]) -> Any:
    """Return coal's hull of points; None where a vertex has more neighbours than coal can count."""
    import coal

    vectors = coal.StdVec_Vec3s()
    vectors.extend(list(points))
    try:
        return coal.Convex.convexHull(vectors, True, "Qt")
    except RuntimeError:  # Qhull cuts a face into a fan about one vertex
        triangles = coal.StdVec_Triangle()
        triangles.extend([coal.Triangle(*corners) for loop in loops for corners in _ears(loop)])
    try:
        return coal.Convex(vectors, triangles)
    except RuntimeError:
        return None


def _ears(loop: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """Yield triangles of a face, of which few meet in any corner: every second one is cut off, round by round."""
    while len(loop) > 2:
        yield from zip(loop[0::2], loop[1::2], (*loop[2::2], loop[0]), strict=False)
        loop = loop[::2]


def _directions(one: _Hull, two: _Hull, R: Array, faces: Rows = ALL, edges: Rows = ALL) -> Array:
    """Return all directions that can separate most, (k, 3), unit, body 1 to body 2; edge pairs come last, twice."""
    # those of some faces and edges of either part alone, where these are given
    first, second = one.edges[edges[0]], two.edges[edges[1]]
    crosses = np.cross((first @ R.T)[:, None], second[None]).reshape(-1, 3)
    lengths = np.linalg.norm(crosses, axis=1)
    sines = lengths / np.outer(np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1)).ravel()
    crosses = np.where((sines > DEFAULT.line)[:, None], crosses, np.nan)
    crosses /= np.where(lengths > 0, lengths, 1.0)[:, None]
    return np.vstack([one.part.normals[faces[0]] @ R.T, -two.part.normals[faces[1]], crosses, -crosses])


def _gaps(one: _Hull, two: _Hull, frame: _Frame) -> tuple[Array, Array]:
    """Return the gap along each direction that can separate most, and the directions."""
    if len(one.edges) * len(two.edges) > EXHAUSTIVE:
        return np.full(1, np.nan), np.eye(3)[:1]
    n = _directions(one, two, frame.R)
    return _gaps_along(n, one, two, frame), n


def _gaps_along(n: Array, one: _Hull, two: _Hull, frame: _Frame) -> Array:
    first = frame.offset + frame.scales[0] * one.points @ frame.R.T
    gaps = [
        frame.scales[1] * (two.points @ some.T).min(axis=0) - (first @ some.T).max(axis=0)
        for some in np.split(n, range(BLOCK, len(n), BLOCK))
    ]
    return np.concatenate(gaps)


def _towards(one: _Hull, two: _Hull, frame: _Frame) -> Array:
    """Return about the shortest way from part 1 to part 2: GJK that starts there has nothing left to get wrong."""
    # all differences y - x of points of the two parts are {v : n_i.v >= gap_i}. Its point nearest to zero, over the
    # directions with a gap at the vertices that are nearest, is a least distance problem. Of parts that overlap, the
    # direction in which they do so least; of very large ones that of the seeds
    places = _nearest(one, two, frame)
    first, second = (_edges_at(hull.part, rows) for hull, rows in zip((one, two), places, strict=True))
    faces = np.unique(one.part.edges[first, 2:]), np.unique(two.part.edges[second, 2:])
    n = _directions(one, two, frame.R, faces, (first, second))
    gaps = _gaps_along(n, one, two, frame)
    apart = np.flatnonzero(gaps > 0)
    if not apart.size:
        if len(one.edges) * len(two.edges) > EXHAUSTIVE:
            return -frame.offset
        return np.asarray(judging.widest_gaps(*one.solid[:4], *two.solid[:4], frame.row[None], True)[0, 1:])
    direction = least_vector(n[apart], gaps[apart])
    return n[apart[gaps[apart].argmax()]] if direction is None else direction / np.linalg.norm(direction)


def _nearest(one: _Hull, two: _Hull, frame: _Frame) -> tuple[Ints, Ints]:
    """Return vertices of both parts whose hulls hold the points that are nearest to each other."""
    # Wolfe's method, of the hull of all differences y - x: of the vertices that hold its point nearest to zero and the
    # one that lies furthest back along it, that point is found anew
    X, Y = frame.offset + frame.scales[0] * one.points @ frame.R.T, frame.scales[1] * two.points
    offset, held = Y[0] - X[0], np.zeros((1, 2), dtype=np.int64)
    for _ in range(MOST):
        furthest = (X @ offset).argmax(), (Y @ offset).argmin()
        if offset @ offset - offset @ (Y[furthest[1]] - X[furthest[0]]) <= DEFAULT.judge_gjk * np.sqrt(offset @ offset):
            break
        held = np.vstack([held, furthest])
        differences = Y[held[:, 1]] - X[held[:, 0]]
        shares = nearest_mixture(differences)
        held, offset = held[shares > 0.0], shares @ differences
    return np.unique(held[:, 0]), np.unique(held[:, 1])


def _explicit(one: _Hull, two: _Hull, frame: _Frame) -> float:
    """Return the signed distance of two hulls from their vertices, in units; nan for very large parts that overlap."""
    gap = float(_gaps_along(_towards(one, two, frame)[None], one, two, frame)[0])
    return gap if gap > 0.0 or len(one.edges) * len(two.edges) <= EXHAUSTIVE else float("nan")


def _best_directions(one: _Hull, two: _Hull, frame: _Frame) -> list[Direction]:
    """Return the directions whose gap may be the largest, faces first; none for very large parts."""
    gaps, _ = _gaps(one, two, frame)
    if np.isnan(gaps).all():
        return []
    rows = [(np.arange(len(hull.part.loops)), np.arange(len(hull.edges))) for hull in (one, two)]
    faces, edges = zip(*rows, strict=True)
    return [_named(one, two, k, faces, edges) for k in np.flatnonzero(gaps >= np.nanmax(gaps) - DEFAULT.tie).tolist()]


def _named(one: _Hull, two: _Hull, k: int, faces: Rows, edges: Rows) -> Direction:
    """Return a direction by its place in what `_directions` returns of some faces and edges."""
    first, second = len(faces[0]), len(faces[0]) + len(faces[1])
    if k < first:
        return Direction(face_corners(one.part, int(faces[0][k])), (), 1)
    if k < second:
        return Direction((), face_corners(two.part, int(faces[1][k - first])), -1)
    turn, place = divmod(k - second, len(edges[0]) * len(edges[1]))
    i, j = divmod(place, len(edges[1]))
    own, other = one.part.edges[edges[0][i], :2], two.part.edges[edges[1][j], :2]
    return Direction(tuple(own.tolist()), tuple(other.tolist()), -1 if turn else 1)


def _edges_at(part: ConvexPart, rows: Ints) -> Ints:
    return np.flatnonzero(np.isin(part.edges[:, :2], rows).any(axis=1))


def face_corners(part: ConvexPart, face: int) -> tuple[int, int, int]:
    """Return three corners of a face, counter-clockwise seen from outside, that span a large triangle."""
    first, *rest = part.loops[face]
    if len(rest) == 2:
        return first, rest[0], rest[1]
    spokes = part.vertices[rest] - part.vertices[first]
    k = int(np.argmax(np.linalg.norm(np.cross(spokes[:-1], spokes[1:]), axis=1)))
    return first, rest[k], rest[k + 1]


# ---------------------------------------------------------------------------------------------------- exact arithmetic


def _exact_gap(first: NDArray[np.object_], second: NDArray[np.object_], direction: Direction) -> float:
    one, two, sign = direction
    if one and two:
        u, v = first[one[1]] - first[one[0]], second[two[1]] - second[two[0]]
    else:
        a, b, c = first[list(one)] if one else second[list(two)]
        u, v = b - a, c - a
    n = sign * np.cross(u, v)
    return float(((second @ n).min() - (first @ n).max()) / Fraction(float(np.linalg.norm(n.astype(float)))))
