"""A claimed contact, re-examined from explicit vertices: part of the judge, independent of the curve and the solver.

A contact line is fitted to the separation of two claimed vertices at three scale pairs; whether a contact is real is
told by a common point of the two claimed elements and by a plane through it that keeps the two parts apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.collision import Direction, PerPair, ScaledPair, face_corners
from fcdm_opt.tolerances import DEFAULT

UNKNOWN = 0  # the sign of a direction that depends on the pose


class _Host(NamedTuple):
    """A part pair that carries a claim: as `judging` takes it, and the parts' numbers.

    Vertices of both parts from the seeds, rows of both elements, rows of the direction in either, its sign.
    """

    one: Array
    two: Array
    first: Ints
    second: Ints
    across: Ints
    along: Ints
    sign: int
    parts: tuple[int, int]

    def towards(self, direction: Direction) -> _Host:
        across, along = (np.array(rows, dtype=np.int64) for rows in direction[:2])
        return self._replace(across=across, along=along, sign=direction.sign)


Proof = tuple[tuple[int, int], Array]  # the numbers of two parts, and a claim's errors on them at each pose


def least_errors(proofs: list[Proof], count: int) -> Array:
    """Return the least errors of all proofs at each pose, (count,); infinite without any."""
    if len(proofs) == 1:
        return proofs[0][1]
    return np.min([np.full(count, np.inf), *(errors for _, errors in proofs)], axis=0)


class Carriers:
    """The part pairs of two bodies that carry a feature; looked for once."""

    def __init__(self, movable: Body, static: Body) -> None:
        self.seeds = np.array([movable.seed, static.seed])
        self._parts = movable.parts, static.parts
        self._arms = [[part.vertices - body.seed for part in body.parts] for body in (movable, static)]
        self._found: dict[Feature, tuple[_Host, ...]] = {}

    def of(self, feature: Feature) -> tuple[_Host, ...]:
        """Return the part pairs; their directions have no sign where that takes a pose."""
        found = self._found.get(feature)
        if found is None:
            found = self._found[feature] = tuple(self._hosts(feature))
        return found

    def _hosts(self, feature: Feature) -> Iterator[_Host]:
        own = (
            [(k, rows) for k, part in enumerate(parts) for rows in part.carriers(element)]
            for parts, element in zip(self._parts, (feature.one, feature.two), strict=True)
        )
        for (i, rows), (j, others) in product(*own):
            one, two = self._parts[0][i], self._parts[1][j]
            direction = Direction(rows, others, UNKNOWN)
            if feature.two.kind == "F":
                direction = Direction((), face_corners(two, two.loops.index(others)), -1)
            elif feature.one.kind == "F":
                direction = Direction(face_corners(one, one.loops.index(rows)), (), 1)
            first, second = (np.array(own, dtype=np.int64) for own in (rows, others))
            bare = _Host(self._arms[0][i], self._arms[1][j], first, second, first, second, UNKNOWN, (i, j))
            yield bare.towards(direction)


carriers = PerPair(Carriers)  # of two bodies, the same at every call: for one thread


class Claim:
    """One claimed feature, on the part pair that carries it best.

    Parameters
    ----------
    feature : Feature
    carried : Carriers
        Of the two bodies.
    scaled : ScaledPair
        The same two bodies; asked for a contact normal where the feature alone gives none (vertex on vertex).
    rho : (2,) array
        Scales at which the feature is claimed.
    transform : (4, 4) array
        Pose change of body 1 there.
    """

    def __init__(self, feature: Feature, carried: Carriers, scaled: ScaledPair, rho: Array, transform: Array) -> None:
        from fcdm_opt.geometry import judging

        self.feature = feature
        self._kernels: Any = judging
        self._seeds = carried.seeds
        found = (self._signed(host, scaled, rho, transform) for host in carried.of(feature))
        hosts = [host for host in found if host is not None]
        if len(hosts) > 1:  # the best first
            errors = [self._errors(host, rho[None], transform[None])[0] for host in hosts]
            best = int(np.argmin(errors))
            hosts = [hosts[best], *hosts[:best], *hosts[best + 1 :]]
        self._hosts = hosts

    def _signed(self, host: _Host, scaled: ScaledPair, rho: Array, transform: Array) -> _Host | None:
        """Return the host with its contact normal at this pose; None where it has none."""
        if host.sign != UNKNOWN:
            return host
        if self.feature.kind == "E1E2":
            sign = self._kernels.edge_sign(host.one, host.two, host.across, host.along, transform)
            if sign != UNKNOWN:
                return host._replace(sign=sign)
        direction = scaled.best_direction(rho, transform, host.parts)
        return None if direction is None else host.towards(direction)

    def lines(self, poses: Array) -> Array:
        """Return (a, b, c) of the contact line at each pose, (k, 3); nan where there is none."""
        return self._rows(self._hosts[0], poses)[:, 3:] if self._hosts else np.full((len(poses), 3), np.nan)

    def errors(self, pairs: Array, poses: Array) -> Array:
        """Return how far the claim is from being a real contact at each scale pair and pose, (k,), lengths.

        The largest of: distance of a common point from either of the two elements, and how far either part reaches
        across the plane through it; least over the part pairs that have such elements, as a face may be spread over
        several. Infinite where none has.
        """
        return least_errors(self.proofs(pairs, poses), len(poses))

    def proofs(self, pairs: Array, poses: Array) -> list[Proof]:
        """Return the `errors` on each part pair that has such elements: the parts' numbers, and (k,).

        Where an error is small that part pair touches, and no deeper than twice the error: the common point is as near
        to both parts, and the plane through it keeps all vertices of the two parts apart.
        """
        return [(host.parts, self._errors(host, pairs, poses)) for host in self._hosts]

    def flush(self, pairs: Array, poses: Array) -> Array:
        """Return how flush the claimed elements are at each scale pair and pose, (k, 3), lengths.

        How far their vertices are from one plane, or of two edges from one line; the length of what they share, and
        its width, of the part pair in which that is widest.
        """
        found = np.tile([np.inf, 0.0, 0.0], (len(poses), 1))
        for host in self._hosts:
            normals = self._rows(host, poses)[:, :3]
            placed = self._placed(host.one[host.first], host.two[host.second], pairs, poses)
            for k, (n, x, y) in enumerate(zip(normals, *placed, strict=True)):
                off, shared = _off_common_plane(x, y, n), extent(x, y, n)
                found[k] = min(found[k, 0], off), *max(tuple(found[k, 1:]), shared, key=lambda pair: pair[::-1])
        return found

    def _rows(self, host: _Host, poses: Array) -> Array:
        rows: Array = self._kernels.contact_rows(*host[:-1], self._seeds, poses)
        return rows

    def _errors(self, host: _Host, pairs: Array, poses: Array) -> Array:
        errors: Array = self._kernels.contact_errors(*host[:-1], self._seeds, pairs, poses)
        return errors

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
