"""A claimed contact, re-examined from explicit vertices: part of the judge, independent of the curve and the solver.

A contact line is fitted to the separation of two claimed vertices at three scale pairs; whether a contact is real is
told by a common point of the two claimed elements and by a plane through it that keeps the two parts apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry import judging
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
        self.feature = feature
        self._seeds = carried.seeds
        hosts = [self._signed(host, scaled, rho, transform) for host in carried.of(feature)]
        if len(hosts) > 1:  # the best first
            errors = [self._errors(host, rho[None], transform[None])[0] for host in hosts]
            best = int(np.argmin(errors))
            hosts = [hosts[best], *hosts[:best], *hosts[best + 1 :]]
        self._hosts = hosts

    def _signed(self, host: _Host, scaled: ScaledPair, rho: Array, transform: Array) -> _Host:
        """Return the host with its contact normal at this pose."""
        if host.sign != UNKNOWN:
            return host
        if self.feature.kind == "E1E2":
            sign = judging.edge_sign(host.one, host.two, host.across, host.along, transform)
            if sign != UNKNOWN:
                return host._replace(sign=sign)
        return host.towards(scaled.best_direction(rho, transform, host.parts, (host.first, host.second)))

    @property
    def parts(self) -> tuple[int, int] | None:
        """The numbers of the two parts that carry the claim best; None where none do."""
        return self._hosts[0].parts if self._hosts else None

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
            shared = extents(*placed, normals)
            wider = (shared[:, 1] > found[:, 2]) | ((shared[:, 1] == found[:, 2]) & (shared[:, 0] > found[:, 1]))
            found[:, 0] = np.minimum(found[:, 0], _off_common_planes(*placed, normals))
            found[wider, 1:] = shared[wider]
        return found

    def _rows(self, host: _Host, poses: Array) -> Array:
        return judging.contact_rows(*host[:-1], self._seeds, poses)

    def _errors(self, host: _Host, pairs: Array, poses: Array) -> Array:
        return judging.contact_errors(*host[:-1], self._seeds, pairs, poses)

    def _placed(self, one: Array, two: Array, pairs: Array, poses: Array) -> tuple[Array, Array]:
        """Scale, move and shift points of both bodies, (k, m, 3) each."""
        R = poses[:, :3, :3]
        offset = R @ self._seeds[0] + poses[:, :3, 3] - self._seeds[1]
        return (
            offset[:, None] + pairs[:, 0, None, None] * np.einsum("kij,mj->kmi", R, one),
            pairs[:, 1, None, None] * two[None],
        )


def _off_common_planes(x: Array, y: Array, n: Array) -> Array:
    """Return how far vertices are from one plane along its normal, or those of two edges from one line, (k,)."""
    if x.shape[1] == y.shape[1] == 2:
        lengths = [np.linalg.norm(own[:, 1] - own[:, 0], axis=1) for own in (x, y)]
        first = (lengths[0] >= lengths[1])[:, None, None]
        longer, other = np.where(first, x, y), np.where(first, y, x)
        along = (longer[:, 1] - longer[:, 0]) / np.maximum(*lengths)[:, None]
        return np.asarray(np.linalg.norm(np.cross(other - longer[:, :1], along[:, None]), axis=2).max(axis=1))
    heights = np.concatenate([x, y], axis=1) @ n[:, :, None]
    return np.asarray(np.ptp(heights[..., 0], axis=1))


def extents(x: Array, y: Array, n: Array) -> Array:
    """Return length and width, (k, 2), of what two segments or convex polygons share, each time seen along a normal.

    What they share is bounded by what each has of the other's sides.

    Parameters
    ----------
    x, y : (k, m, 3), (k, l, 3) arrays
        Their vertices in order.
    n : (k, 3) array
        Unit normals.
    """
    x, y = (own - x[:, :1] for own in (x, y))
    across = np.cross(n, np.eye(3)[np.abs(n).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1)[:, None]
    axes = np.stack([across, np.cross(n, across)], axis=2)
    x, y = x @ axes, y @ axes
    sizes = [np.linalg.norm(np.roll(own, -1, axis=1) - own, axis=2).max(axis=1) for own in (x, y)]
    slack = DEFAULT.touch * np.minimum(*sizes)
    points, known = (np.concatenate(own, axis=1) for own in zip(_cut(x, y, slack), _cut(y, x, slack), strict=True))
    points = np.where(known[..., None], points, points[np.arange(len(x)), known.argmax(axis=1)][:, None])
    far = np.linalg.norm(points[:, :, None] - points[:, None], axis=3)
    first, second = np.divmod(far.reshape(len(x), -1).argmax(axis=1), points.shape[1])
    rows = np.arange(len(x))
    length = far[rows, first, second]
    some = known.any(axis=1) & (length > 0.0)
    along = (points[rows, first] - points[rows, second])[some, None] / length[some, None, None]
    offsets = _crossed(along, points[some] - points[some, :1])
    shared = np.zeros((len(x), 2))
    shared[some] = np.column_stack([length[some], np.ptp(offsets, axis=1)])
    return shared


def _cut(x: Array, y: Array, slack: Array) -> tuple[Array, Array]:
    """Return both ends of what an element has of each side of another, (k, 2 l, 2), and which are ends of something.

    Each side y + t u is cut by the half-planes of the element that it leaves by more than the slack, (k,).
    """
    sides = np.roll(x, -1, axis=1) - x
    outward = np.stack([sides[..., 1], -sides[..., 0]], axis=2)
    if x.shape[1] == 2:  # a segment: between its ends too
        outward, starts = np.concatenate([outward, sides], axis=1), np.concatenate([x, x[:, ::-1]], axis=1)
    else:
        outward *= np.sign(((x - x.mean(axis=1, keepdims=True)) * outward).sum(axis=2, keepdims=True))
        starts = x
    outward /= np.linalg.norm(outward, axis=2, keepdims=True)
    u = np.roll(y, -1, axis=1) - y
    room, rate = (starts * outward).sum(axis=2)[:, None] - y @ outward.mT, u @ outward.mT
    cut = np.minimum(room, room - rate) < -slack[:, None, None]
    at = room / np.where(rate == 0.0, 1.0, rate)
    low = np.where(cut & (rate < 0.0), at, 0.0).max(axis=2)
    high = np.where(cut & (rate > 0.0), at, 1.0).min(axis=2)
    known = ((high - low) * np.linalg.norm(u, axis=2) >= -slack[:, None]) & ~(cut & (rate == 0.0)).any(axis=2)
    low, high = np.clip(low, 0.0, 1.0), np.clip(high, 0.0, 1.0)
    ends = [y + share[..., None] * u for share in (low, high)]
    return np.concatenate(ends, axis=1), np.tile(known, 2)


def _crossed(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
