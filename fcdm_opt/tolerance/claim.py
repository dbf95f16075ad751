"""A claimed contact, re-examined from explicit vertices: part of the judge, independent of the curve and the solver.

A contact line is fitted to the separation of two claimed vertices at three scale pairs; whether a contact is real is
told by a common point of the two claimed elements and by a plane through it that keeps the two parts apart.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.collision import Direction, ScaledPair, face_corners
from fcdm_opt.geometry.elements import Element
from fcdm_opt.tolerances import DEFAULT

_Place = tuple[int, tuple[int, ...]]  # a part, and vertex rows of it


class _Host(NamedTuple):
    """The part pair that carries a claim: vertices of both parts and of both elements, from the seeds; the normal."""

    one: Array
    two: Array
    first: Array
    second: Array
    direction: Direction


class Claim:
    """One claimed feature, on the part pair that carries it best.

    Parameters
    ----------
    feature : Feature
    movable, static : Body
        As drawn.
    scaled : ScaledPair
        The same two bodies; asked for a contact normal where the feature alone gives none (vertex on vertex).
    rho : (2,) array
        Scales at which the feature is claimed.
    transform : (4, 4) array
        Pose change of body 1 there.

    Notes
    -----
    Points are handled relative to the static seed: x = o + rho_1 R (v - s_1) on body 1, y = rho_2 (v - s_2) on body 2.
    """

    def __init__(
        self, feature: Feature, movable: Body, static: Body, scaled: ScaledPair, rho: Array, transform: Array
    ) -> None:
        self.feature = feature
        self._bodies = movable, static
        self._seeds = movable.seed, static.seed
        self._host: _Host | None = None
        self._hosts = hosts = [
            host
            for first, second in product(_carriers(movable, feature.one), _carriers(static, feature.two))
            if (host := self._hosted(first, second, scaled, rho, transform)) is not None
        ]
        least = np.inf
        for host in hosts:
            error = self._error(host, rho[None], transform[None])[0]
            if error < least or self._host is None:
                least, self._host = error, host

    def _hosted(self, first: _Place, second: _Place, scaled: ScaledPair, rho: Array, transform: Array) -> _Host | None:
        """Return the claim on one part pair; None where it has no normal."""
        (i, rows), (j, others) = first, second
        parts = self._bodies[0].parts[i], self._bodies[1].parts[j]
        one, two = (part.vertices - seed for part, seed in zip(parts, self._seeds, strict=True))
        direction: Direction | None = None
        if self.feature.two.kind == "F":
            direction = Direction((), face_corners(parts[1], parts[1].loops.index(others)), -1)
        elif self.feature.one.kind == "F":
            direction = Direction(face_corners(parts[0], parts[0].loops.index(rows)), (), 1)
        elif self.feature.kind == "E1E2":
            n = _normals(Direction(rows, others, 1), one, two, transform[None])[0]
            if not np.isnan(n).any():
                heights = (one - one[rows[0]]) @ transform[:3, :3].T @ n
                direction = Direction(rows, others, 1 if heights.max() <= -heights.min() else -1)
        if direction is None:
            direction = scaled.best_direction(rho, transform, (i, j))
        if direction is None:
            return None
        return _Host(one, two, one[list(rows)], two[list(others)], direction)

    def lines(self, poses: Array) -> Array:
        """Return (a, b, c) of the contact line at each pose, (k, 3).

        The separation of two claimed vertices along the normal is affine in the scales, c - a rho_1 - b rho_2:
        three scale pairs give it.
        """
        if self._host is None:
            return np.full((len(poses), 3), np.nan)
        one, two, first, second, direction = self._host
        n = _normals(direction, one, two, poses)

        def separation(rho_1: float, rho_2: float) -> Array:
            scales = np.tile([rho_1, rho_2], (len(poses), 1))
            x, y = self._placed(first[:1], second[:1], scales, poses)
            return np.einsum("ki,ki->k", n, y[:, 0] - x[:, 0])

        base, wider, longer = separation(1.0, 1.0), separation(2.0, 1.0), separation(1.0, 2.0)
        return np.column_stack([base - wider, base - longer, 3 * base - wider - longer])

    def error(self, pairs: Array, poses: Array) -> Array:
        """Return how far the claim is from being a real contact at each scale pair and pose, (k,), lengths.

        The largest of: distance between the two elements, distance of their common point from either, and how far
        either part reaches across the plane through it; least over the part pairs that have such elements, as a face
        may be spread over several. Infinite where none has.
        """
        errors = [self._error(host, pairs, poses) for host in self._hosts]
        return np.min([np.full(len(poses), np.inf), *errors], axis=0)

    def flush(self, pairs: Array, poses: Array) -> Array:
        """Return how flush the claimed elements are at each scale pair and pose, (k, 3), lengths.

        How far their vertices are from one plane, or of two edges from one line; the length of what they share, and
        its width, of the part pair in which that is widest.
        """
        found = np.tile([np.inf, 0.0, 0.0], (len(poses), 1))
        for host in self._hosts:
            normals = _normals(host.direction, host.one, host.two, poses)
            placed = self._placed(host.first, host.second, pairs, poses)
            for k, (n, x, y) in enumerate(zip(normals, *placed, strict=True)):
                off, shared = _off_common_plane(x, y, n), extent(x, y, n)
                found[k] = min(found[k, 0], off), *max(tuple(found[k, 1:]), shared, key=lambda pair: pair[::-1])
        return found

    def _error(self, host: _Host, pairs: Array, poses: Array) -> Array:
        one, two, first, second, direction = host
        n = _normals(direction, one, two, poses)
        x, y = self._placed(first, second, pairs, poses)
        witness, distance = _witness(x, y, direction)
        all_x, all_y = self._placed(one, two, pairs, poses)
        level = np.einsum("ki,ki->k", n, witness)
        beyond = np.einsum("ki,kmi->km", n, all_x).max(axis=1) - level
        before = level - np.einsum("ki,kmi->km", n, all_y).min(axis=1)
        return np.where(np.isnan(level), np.inf, np.max([distance, beyond, before], axis=0))

    def _placed(self, one: Array, two: Array, pairs: Array, poses: Array) -> tuple[Array, Array]:
        """Scale, move and shift points of both bodies, (k, m, 3) each."""
        R = poses[:, :3, :3]
        offset = R @ self._seeds[0] + poses[:, :3, 3] - self._seeds[1]
        return (
            offset[:, None] + pairs[:, 0, None, None] * np.einsum("kij,mj->kmi", R, one),
            pairs[:, 1, None, None] * two[None],
        )


def _off_common_plane(x: Array, y: Array, n: Array) -> float:
    """Return how far vertices are from one plane along its normal, or those of two edges from one line."""
    if len(x) == len(y) == 2:
        longer, other = sorted((x, y), key=lambda ends: float(np.linalg.norm(ends[1] - ends[0])), reverse=True)
        along = (longer[1] - longer[0]) / np.linalg.norm(longer[1] - longer[0])
        return float(np.linalg.norm(np.cross(other - longer[0], along), axis=1).max())
    return float(np.ptp(np.concatenate([x, y]) @ n))


def extent(x: Array, y: Array, n: Array) -> tuple[float, float]:
    """Return length and width of what two segments or convex polygons of one plane share, seen along its normal.

    Its corners are the corners of either that the other holds, and where their sides cross.
    """
    sides = [np.roll(own, -1, axis=0) - own for own in (x, y)]
    across = np.cross(sides[0][:, None], sides[1][None]) @ n
    lengths = [np.linalg.norm(own, axis=1) for own in sides]
    across = np.where(np.abs(across) > DEFAULT.tie * np.outer(*lengths), across, np.nan)  # parallel sides cross nowhere
    between = y[None] - x[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.cross(between, sides[1][None]) @ n / across
        t = np.cross(between, sides[0][:, None]) @ n / across
    i, j = np.nonzero((s >= 0) & (s <= 1) & (t >= 0) & (t <= 1))
    slack = DEFAULT.touch * min(float(own.max()) for own in lengths)
    held = x[_outside(y, x, n) <= slack], y[_outside(x, y, n) <= slack]
    points = np.concatenate([*held, x[i] + s[i, j, None] * sides[0][i]])
    if not len(points):
        return 0.0, 0.0
    apart = points[:, None] - points[None]
    far = np.linalg.norm(apart, axis=2)
    first, second = np.unravel_index(far.argmax(), far.shape)
    length = float(far[first, second])
    if length == 0.0:
        return 0.0, 0.0
    return length, float(np.ptp(np.cross(apart[first, second] / length, points - points[0]) @ n))


def _outside(element: Array, points: Array, n: Array) -> Array:
    """Return how far points of the plane are outside a segment or a convex polygon, <= 0 inside."""
    if len(element) == 2:
        side = element[1] - element[0]
        length = np.linalg.norm(side)
        t = np.clip((points - element[0]) @ side / length, 0.0, length)
        return np.asarray(np.linalg.norm(points - element[0] - t[:, None] * side / length, axis=1))
    outward = np.cross(np.roll(element, -1, axis=0) - element, n)
    outward *= np.sign(((element - element.mean(axis=0)) * outward).sum(axis=1, keepdims=True))
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    return np.asarray(((points[:, None] - element) * outward).sum(axis=2).max(axis=1))


def _carriers(body: Body, element: Element) -> list[_Place]:
    """Return (part, vertex rows) wherever a part of the body has the element; face rows in loop order."""
    return [(k, own) for k, part in enumerate(body.parts) for own in part.carriers(element)]


def _normals(direction: Direction, one: Array, two: Array, poses: Array) -> Array:
    """Return the unit contact normals, (k, 3), body 1 to body 2; nan where two edges are parallel."""
    R = poses[:, :3, :3]
    first, second = one[list(direction.one)] @ np.swapaxes(R, 1, 2), two[list(direction.two)]
    if len(direction.one) == 3:
        u, v = first[:, 1] - first[:, 0], first[:, 2] - first[:, 0]
    elif len(direction.two) == 3:
        u, v = (np.tile(second[k] - second[0], (len(poses), 1)) for k in (1, 2))
    else:
        u, v = first[:, 1] - first[:, 0], np.tile(second[1] - second[0], (len(poses), 1))
    n = direction.sign * np.cross(u, v)
    length = np.linalg.norm(n, axis=1)
    parallel = ~(length > DEFAULT.tie * np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1))
    return np.where(parallel, np.nan, 1.0)[:, None] * n / np.where(parallel, 1.0, length)[:, None]


def _witness(x: Array, y: Array, direction: Direction) -> tuple[Array, Array]:
    """Return the common point of two elements, (k, 3), and how far it is from either, (k,)."""
    if x.shape[1] == 1:
        return x[:, 0], _distance_to(y, x[:, 0])
    if y.shape[1] == 1:
        return y[:, 0], _distance_to(x, y[:, 0])
    if len(direction.one) == len(direction.two) == 2 and x.shape[1] == y.shape[1] == 2:
        u, v, w = x[:, 1] - x[:, 0], y[:, 1] - y[:, 0], y[:, 0] - x[:, 0]
        n = np.cross(u, v)
        t = np.einsum("ki,ki->k", np.cross(w, v), n) / np.einsum("ki,ki->k", n, n)
        point = x[:, 0] + t[:, None] * u
        return point, np.maximum(_distance_to(x, point), _distance_to(y, point))
    return _common_point(x, y)


def _distance_to(element: Array, points: Array) -> Array:
    """Bound how far points are from a vertex, a segment or a planar convex polygon in loop order, (k,).

    Largest of the distances from its plane or line and from the lines of its sides: at a corner the true distance
    may be larger, by a factor that the corner's angle bounds; zero means inside.
    """
    if element.shape[1] == 1:
        return np.linalg.norm(points - element[:, 0], axis=1)
    if element.shape[1] == 2:
        u = element[:, 1] - element[:, 0]
        t = np.clip(np.einsum("ki,ki->k", points - element[:, 0], u) / np.einsum("ki,ki->k", u, u), 0.0, 1.0)
        return np.linalg.norm(points - element[:, 0] - t[:, None] * u, axis=1)
    sides = np.roll(element, -1, axis=1) - element
    normal = np.cross(element - element[:, :1], sides).sum(axis=1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    outward = np.cross(sides, normal[:, None])
    outward /= np.linalg.norm(outward, axis=2)[:, :, None]
    outside = np.einsum("kmi,kmi->km", points[:, None] - element, outward).max(axis=1)
    height = np.abs(np.einsum("ki,ki->k", points - element.mean(axis=1), normal))
    return np.maximum(np.maximum(outside, 0.0), height)


def _common_point(x: Array, y: Array) -> tuple[Array, Array]:
    """Return a point nearest to the convex hulls of x and of y, for flush contacts: non-negative least squares."""
    from scipy.optimize import nnls

    points, distances = np.full((len(x), 3), np.nan), np.full(len(x), np.nan)
    for k, (first, second) in enumerate(zip(x, y, strict=True)):
        centre = first.mean(axis=0)
        unit = np.abs(np.vstack([first, second]) - centre).max()
        if not (np.isfinite(unit) and unit > 0):
            continue
        count, others = len(first), len(second)
        left = np.vstack([np.ones(count), np.zeros(count), (first - centre).T / unit])
        right = np.vstack([np.zeros(others), np.ones(others), (centre - second).T / unit])
        weights, _ = nnls(np.hstack([left, right]), np.array([1.0, 1.0, 0.0, 0.0, 0.0]))
        p = weights[:count] @ first / weights[:count].sum()
        points[k] = p
        distances[k] = np.linalg.norm(p - weights[count:] @ second / weights[count:].sum())
    return points, distances
