"""Distance and overlap of two bodies at given scales, by a collision library and by explicit vertices.

The judge's view of a pair: it uses neither contact equations nor the kernels of the decision curve. Two independent
ways: `distances` asks coal (GJK and EPA); `separations` projects every vertex on every direction that can separate.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.tolerances import DEFAULT

# Above this many edge pairs `separations` would cost more than everything else the judge does: nan, coal stands alone.
EXHAUSTIVE = 250_000


class Direction(NamedTuple):
    """A direction that may separate two parts, named by vertex indices of the parts as `ConvexPart` numbers them.

    A face of part 1 or part 2 is three of its corners and nothing of the other part; a pair of edges is two and two.
    The direction is `sign` times the cross product of the first two sides named.
    """

    one: tuple[int, ...]
    two: tuple[int, ...]
    sign: int


class ScaledPair:
    """Two bodies of convex parts, body 1 scaled and moved, body 2 scaled; hulls are built once.

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
    asked once more with the way between the parts as initial guess; if that fails too, the answer is nan.
    """

    def __init__(self, movable: Body, static: Body) -> None:
        import coal

        self._coal = coal
        reach = [max(float(np.abs(p.vertices - p.seed).max()) for p in body.parts) for body in (movable, static)]
        self._reach = np.array(reach)
        self._seeds = movable.seed, static.seed
        self._hulls = [[_Hull(part) for part in body.parts] for body in (movable, static)]
        self._transforms = coal.Transform3s(), coal.Transform3s()
        self._result = coal.DistanceResult()
        self._request = self._settings()
        self._factors: tuple[float, float] | None = None
        self._unit = 1.0

    def _settings(self) -> Any:
        request = self._coal.DistanceRequest()
        request.gjk_tolerance = request.epa_tolerance = DEFAULT.judge_gjk
        return request

    def signed_distance(self, rho: ArrayLike, transform: Array) -> float:
        """Return the least signed distance over the part pairs.

        Parameters
        ----------
        rho : (2,)
            Scales, both positive.
        transform : (4, 4) array
            Pose change of body 1, world frame.

        Returns
        -------
        float
            Length units: the Euclidean distance if apart, minus the penetration depth of the deepest part pair if
            overlapping; nan if coal cannot tell.
        """
        R, offset = self._place(rho, transform)
        return self._least(lambda one, two: self._asked(one, two, R, offset), R, offset)

    def distances(self, rho: ArrayLike, transform: Array) -> Array:
        """Return the signed distance of every part pair, (parts 1, parts 2); see `signed_distance`."""
        R, offset = self._place(rho, transform)
        values = [[self._asked(one, two, R, offset) for two in self._hulls[1]] for one in self._hulls[0]]
        return np.array(values) * self._unit

    def separation(self, rho: ArrayLike, transform: Array) -> float:
        """Return the least of `separations`, of pairs that the spheres about them leave in doubt; nan as there."""
        R, offset = self._place(rho, transform)
        scales = self._scales()
        return self._least(lambda one, two: np.fmax.reduce(_gaps(one, two, scales, R, offset)[0]), R, offset)

    def _least(self, value: Callable[[_Hull, _Hull], float], R: Array, offset: Array) -> float:
        """Return the least value over the part pairs, nearest spheres first, as long as any can be less."""
        scales = self._scales()
        (one, radius), (two, other) = (
            (scale * np.array([hull.middle for hull in hulls]), scale * np.array([hull.radius for hull in hulls]))
            for scale, hulls in zip(scales, self._hulls, strict=True)
        )
        way = two[None] - (offset + one @ R.T)[:, None]
        bounds = np.linalg.norm(way, axis=2) - radius[:, None] - other[None]
        least = np.inf
        for pair in np.argsort(bounds, axis=None):
            i, j = np.unravel_index(pair, bounds.shape)
            if bounds[i, j] > least:
                break
            found = float(value(self._hulls[0][i], self._hulls[1][j]))
            if np.isnan(found):
                return found
            least = min(least, found)
        return least * self._unit

    def _asked(self, one: _Hull, two: _Hull, R: Array, offset: Array) -> float:
        """Return coal's signed distance of two hulls, asked again with a hint where it cannot be believed; units."""
        found = self._distance(one, two, self._request, R, offset)
        if np.isnan(found):
            again = self._settings()
            again.gjk_initial_guess = self._coal.GJKInitialGuess.CachedGuess
            again.cached_gjk_guess = -_towards(one, two, self._scales(), R, offset)
            found = self._distance(one, two, again, R, offset)
        return found

    def separations(self, rho: ArrayLike, transform: Array) -> Array:
        """Return each part pair's largest separation over face normals and edge x edge directions, (parts 1, parts 2).

        Positive exactly where the parts are apart, and then at most their distance; minus the penetration depth
        otherwise. Computed from explicit vertices; nan for pairs of very large parts.
        """
        R, offset = self._place(rho, transform)
        pairs = product(*self._hulls)
        values = [np.fmax.reduce(_gaps(one, two, self._scales(), R, offset)[0]) for one, two in pairs]
        return np.reshape(values, [len(hulls) for hulls in self._hulls]) * self._unit

    def exact_separation(self, rho: ArrayLike, transform: Array) -> float:
        """Return the least of `separations`, in rational arithmetic on the numbers as given, rounded at the end.

        Only directions that come near the largest separation in floats are worked out again; the transform is taken
        as it is, rational and not exactly orthogonal.
        """
        R, offset = self._place(rho, transform)
        least = np.inf
        T = [[Fraction(float(x)) for x in row] for row in transform]
        scales = [Fraction(float(x)) for x in np.asarray(rho)]
        seeds = [[Fraction(float(x)) for x in seed] for seed in self._seeds]
        for one, two in product(*self._hulls):
            places = _best_directions(one, two, self._scales(), R, offset)
            if not places:
                return float("nan")
            first = [_moved(T, _scaled(x, seeds[0], scales[0])) for x in one.part.vertices.tolist()]
            second = [_scaled(x, seeds[1], scales[1]) for x in two.part.vertices.tolist()]
            least = min(least, max(_exact_gap(first, second, place) for place in places))
        return least

    def gradients(self, rho: ArrayLike, transform: Array, slack: float) -> Array:
        """Return how fast the separation of touching parts falls as the scales grow, (k, 2).

        One row for each face normal and edge x edge direction along which a part pair that touches, to within `slack`,
        is no more than `slack` away from touching.
        """
        R, offset = self._place(rho, transform)
        found = [np.empty((0, 2))]
        for one, two in product(*self._hulls):
            gaps, n = _gaps(one, two, self._scales(), R, offset)
            if abs(np.fmax.reduce(gaps)) * self._unit <= slack:
                tight = n[gaps * self._unit >= -slack]
                found.append(np.column_stack([(one.base @ R.T @ tight.T).max(0), -(two.base @ tight.T).min(0)]))
        return np.vstack(found)

    def best_direction(self, rho: ArrayLike, transform: Array, parts: tuple[int, int]) -> Direction | None:
        """Return a direction in which two parts are farthest apart, or overlap least; None for very large parts."""
        R, offset = self._place(rho, transform)
        one, two = (hulls[k] for hulls, k in zip(self._hulls, parts, strict=True))
        return next(iter(_best_directions(one, two, self._scales(), R, offset)), None)

    def _place(self, rho: ArrayLike, transform: Array) -> tuple[Array, Array]:
        """Write the scaled points and the pose of body 1; return its rotation and offset in units."""
        scales = np.asarray(rho, dtype=np.float64)
        factors = float(scales[0]), float(scales[1])
        if factors != self._factors:
            self._unit = float(2.0 ** np.ceil(np.log2((scales * self._reach).max())))  # a power of two: no rounding
            for hulls, factor in zip(self._hulls, factors, strict=True):
                for hull in hulls:
                    np.multiply(hull.base, factor / self._unit, out=hull.points)
            self._factors = factors
        R = transform[:3, :3]
        offset = (R @ self._seeds[0] + transform[:3, 3] - self._seeds[1]) / self._unit
        self._transforms[0].setRotation(R)
        self._transforms[0].setTranslation(offset)
        return R, offset

    def _scales(self) -> tuple[float, float]:
        assert self._factors is not None
        return self._factors[0] / self._unit, self._factors[1] / self._unit

    def _distance(self, one: _Hull, two: _Hull, request: Any, R: Array, offset: Array) -> float:
        result = self._result
        result.clear()
        value = self._coal.distance(one.shape, self._transforms[0], two.shape, self._transforms[1], request, result)
        if not abs(value) <= np.abs(offset).sum() + 8.0:  # two bodies of unit reach: larger, or nan, is coal's failure
            return float("nan")
        if abs(value) <= DEFAULT.side:
            scales, first, second = self._scales(), result.getNearestPoint1(), result.getNearestPoint2()
            error = max(
                one.outside((first - offset) @ R, scales[0]),
                two.outside(second, scales[1]),
                abs(float(np.linalg.norm(second - first)) - abs(value)),
            )
            if not error <= DEFAULT.tie:
                return float("nan")
        return float(value)


class _Hull:
    """One part as coal sees it: points relative to the seed, in coal's own order."""

    def __init__(self, part: ConvexPart) -> None:
        import coal

        self.part = part
        # coal's Qhull breaks down on thin parts (a slab of 1e-9 ends the process). A hull's faces do not change under
        # affine maps: build it with equal extents, then put the true points in place.
        centred = part.vertices - part.vertices.mean(axis=0)
        _, stretch, axes = np.linalg.svd(centred, full_matrices=False)
        axes[2] *= np.sign(np.linalg.det(axes))
        even = centred @ (axes.T / stretch)
        vectors = coal.StdVec_Vec3s()
        vectors.extend(list(even))
        self.shape = coal.Convex.convexHull(vectors, True, "Qt")
        self.points = self.shape.points()
        rows = {tuple(point): k for k, point in enumerate(even.tolist())}
        self.base = (part.vertices - part.seed)[[rows[tuple(point)] for point in self.points.tolist()]]
        self.middle = self.base.mean(axis=0)
        self.radius = float(np.linalg.norm(self.base - self.middle, axis=1).max())
        self.offsets = (self.base @ part.normals.T).max(axis=0)
        self.edges = part.vertices[part.edges[:, 1]] - part.vertices[part.edges[:, 0]]

    def outside(self, point: Array, scale: float) -> float:
        """How far a point (body frame, from the seed) lies outside the scaled part's planes; negative inside."""
        return float((self.part.normals @ point - scale * self.offsets).max())


def _directions(one: _Hull, two: _Hull, R: Array) -> Array:
    """Return all directions that can separate most, (k, 3), unit, body 1 to body 2; edge pairs come last, twice."""
    crosses = np.cross((one.edges @ R.T)[:, None], two.edges[None]).reshape(-1, 3)
    lengths = np.linalg.norm(crosses, axis=1)
    sines = lengths / np.outer(np.linalg.norm(one.edges, axis=1), np.linalg.norm(two.edges, axis=1)).ravel()
    crosses = np.where((sines > DEFAULT.line)[:, None], crosses, np.nan)
    crosses /= np.where(lengths > 0, lengths, 1.0)[:, None]
    return np.vstack([one.part.normals @ R.T, -two.part.normals, crosses, -crosses])


def _gaps(one: _Hull, two: _Hull, scales: tuple[float, float], R: Array, offset: Array) -> tuple[Array, Array]:
    if len(one.edges) * len(two.edges) > EXHAUSTIVE:
        return np.full(1, np.nan), np.eye(3)[:1]
    n = _directions(one, two, R)
    first = offset + scales[0] * one.base @ R.T
    return scales[1] * (two.base @ n.T).min(axis=0) - (first @ n.T).max(axis=0), n


def _towards(one: _Hull, two: _Hull, scales: tuple[float, float], R: Array, offset: Array) -> Array:
    """Return about the shortest way from part 1 to part 2: GJK that starts there has nothing left to get wrong.

    All differences y - x of points of the two parts are {v : n_i.v >= gap_i}. Its point nearest to zero, over the
    directions with a gap, is a least distance problem, solved through non-negative least squares.
    """
    from scipy.optimize import nnls

    gaps, n = _gaps(one, two, scales, R, offset)
    if np.isnan(gaps).all():
        return -offset
    best = int(np.nanargmax(gaps))
    apart = np.flatnonzero(gaps > 0)
    if not apart.size:
        return n[best]
    system = np.vstack([n[apart].T, gaps[apart] / gaps[best]])
    weights, _ = nnls(system, np.array([0.0, 0.0, 0.0, 1.0]))
    way = system[:3] @ weights
    length = float(np.linalg.norm(way))
    return way / length if length > 0 else n[best]


def _best_directions(one: _Hull, two: _Hull, scales: tuple[float, float], R: Array, offset: Array) -> list[Direction]:
    """Return the directions whose gap may be the largest, faces first; none for very large parts."""
    gaps, _ = _gaps(one, two, scales, R, offset)
    if np.isnan(gaps).all():
        return []
    faces, others, edges = one.part.loops, two.part.loops, len(two.edges)
    found = []
    for k in np.flatnonzero(gaps >= np.nanmax(gaps) - DEFAULT.tie).tolist():
        if k < len(faces):
            found.append(Direction(face_corners(one.part, k), (), 1))
        elif k < len(faces) + len(others):
            found.append(Direction((), face_corners(two.part, k - len(faces)), -1))
        else:
            turn, place = divmod(k - len(faces) - len(others), len(one.edges) * edges)
            first, second = one.part.edges[place // edges, :2], two.part.edges[place % edges, :2]
            found.append(Direction(tuple(first.tolist()), tuple(second.tolist()), -1 if turn else 1))
    return found


def face_corners(part: ConvexPart, face: int) -> tuple[int, int, int]:
    """Return three corners of a face, counter-clockwise seen from outside, that span a large triangle."""
    first, *rest = part.loops[face]
    spokes = part.vertices[rest] - part.vertices[first]
    k = int(np.argmax(np.linalg.norm(np.cross(spokes[:-1], spokes[1:]), axis=1)))
    return first, rest[k], rest[k + 1]


# ---------------------------------------------------------------------------------------------------- exact arithmetic

Rational = list[Fraction]


def _exact_gap(first: list[Rational], second: list[Rational], direction: Direction) -> float:
    one, two, sign = direction
    if one and two:
        n = _cross(_minus(first[one[1]], first[one[0]]), _minus(second[two[1]], second[two[0]]))
    else:
        a, b, c = (first[k] for k in one) if one else (second[k] for k in two)
        n = _cross(_minus(b, a), _minus(c, a))
    n = [sign * x for x in n]
    gap = min(_dot(n, y) for y in second) - max(_dot(n, x) for x in first)
    return float(gap / Fraction(float(np.linalg.norm([float(x) for x in n]))))


def _scaled(point: list[float], seed: Rational, rho: Fraction) -> Rational:
    return [s + rho * (Fraction(x) - s) for x, s in zip(point, seed, strict=True)]


def _moved(T: list[Rational], x: Rational) -> Rational:
    return [T[i][0] * x[0] + T[i][1] * x[1] + T[i][2] * x[2] + T[i][3] for i in range(3)]


def _minus(a: Rational, b: Rational) -> Rational:
    return [x - y for x, y in zip(a, b, strict=True)]


def _dot(a: Rational, b: Rational) -> Fraction:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Rational, b: Rational) -> Rational:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
