"""A claimed contact, re-examined from explicit vertices: part of the judge, independent of the curve and the solver.

A contact line is fitted to the separation of two claimed vertices at three scale pairs; whether a contact is real is
told by a common point of the two claimed elements and by a plane through it that keeps the two parts apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry import judging
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.collision import Direction, PerPair, ScaledPair, face_corners

UNKNOWN = 0  # the sign of a direction that depends on the pose


class _Carrier(NamedTuple):
    """A part pair that carries a claim: as `judging` takes it, and the parts' numbers."""

    one: Array  # vertices of both parts from the seeds
    two: Array
    first: Ints  # rows of both elements
    second: Ints
    across: Ints  # rows of the direction in either
    along: Ints
    sign: int  # of the direction
    parts: tuple[int, int]

    def towards(self, direction: Direction) -> _Carrier:
        across, along = (np.array(rows, dtype=np.int64) for rows in direction[:2])
        return self._replace(across=across, along=along, sign=direction.sign)


Proof = tuple[tuple[int, int], Array]  # the numbers of two parts, and a claim's errors on them at each pose


def least_errors(proofs: list[Proof], count: int) -> Array:
    """Return the least errors of all proofs at each pose, (count,); infinite without any."""
    return np.min([np.full(count, np.inf), *(errors for _, errors in proofs)], axis=0)


class Carriers:
    """The part pairs of two bodies that carry a feature; looked for once."""

    def __init__(self, movable: Body, static: Body) -> None:
        self.seeds = np.array([movable.seed, static.seed])
        self._parts = movable.parts, static.parts
        self._arms = [[part.vertices - body.seed for part in body.parts] for body in (movable, static)]
        self._found: dict[Feature, tuple[_Carrier, ...]] = {}

    def of(self, feature: Feature) -> tuple[_Carrier, ...]:
        """Return the part pairs; their directions have no sign where that takes a pose."""
        found = self._found.get(feature)
        if found is None:
            pacing.check()
            found = self._found[feature] = tuple(self._carriers(feature))
        return found

    def _carriers(self, feature: Feature) -> Iterator[_Carrier]:
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
            bare = _Carrier(self._arms[0][i], self._arms[1][j], first, second, first, second, UNKNOWN, (i, j))
            yield bare.towards(direction)


carriers = PerPair(Carriers)  # of two bodies, the same at every call: for one thread


class Claim:
    """One claimed feature, on the part pair that carries it best.

    At the scales `rho`, (2,), at which it is claimed, and the pose change of body 1 there, (4, 4). Of the two bodies,
    `scaled` is asked for a contact normal where the feature alone gives none (vertex on vertex).
    """

    def __init__(self, feature: Feature, carried: Carriers, scaled: ScaledPair, rho: Array, transform: Array) -> None:
        self.feature = feature
        self._seeds = carried.seeds
        self._carriers = [self._signed(carrier, scaled, rho, transform) for carrier in carried.of(feature)]
        if len(self._carriers) < 2 and feature.kind != "E1E2":
            return
        least = self._best_first(rho, transform)
        if feature.kind == "E1E2" and not least <= judging.TOUCH * scaled.reaches.min():
            # edges that are nearly parallel cross in any direction
            self._carriers = [self._separated(carrier, scaled, rho, transform) for carrier in self._carriers]
            self._best_first(rho, transform)

    def _best_first(self, rho: Array, transform: Array) -> float:
        """Put the part pair with the least error first, and return that; infinite without any."""
        errors = [self._errors(carrier, rho[None], transform[None])[0] for carrier in self._carriers]
        if not errors:
            return np.inf
        self._carriers.insert(0, self._carriers.pop(int(np.argmin(errors))))
        return float(min(errors))

    def _signed(self, carrier: _Carrier, scaled: ScaledPair, rho: Array, transform: Array) -> _Carrier:
        """Return the carrier with its contact normal at this pose."""
        if carrier.sign != UNKNOWN:
            return carrier
        if self.feature.kind == "E1E2":
            sign = judging.edge_sign(carrier.one, carrier.two, carrier.across, carrier.along, transform)
            if sign != UNKNOWN:
                return carrier._replace(sign=sign)
        return self._separated(carrier, scaled, rho, transform)

    @staticmethod
    def _separated(carrier: _Carrier, scaled: ScaledPair, rho: Array, transform: Array) -> _Carrier:
        """Return the carrier with the direction at its elements in which its parts are farthest apart as normal."""
        return carrier.towards(scaled.best_direction(rho, transform, carrier.parts, (carrier.first, carrier.second)))

    @property
    def parts(self) -> tuple[int, int] | None:
        """The numbers of the two parts that carry the claim best; None where none do."""
        return self._carriers[0].parts if self._carriers else None

    def lines(self, poses: Array) -> Array:
        """Return (a, b, c) of the contact line at each pose, (k, 3); nan where there is none."""
        return self.rows(poses)[:, 3:]

    def rows(self, poses: Array) -> Array:
        """Return the contact's normal, from body 1 to body 2, and (a, b, c) at each pose, (k, 6); nan without one."""
        if not self._carriers:
            return np.full((len(poses), 6), np.nan)
        return judging.contact_rows(*self._carriers[0][:-1], self._seeds, poses)

    def errors(self, pairs: Array, poses: Array) -> Array:
        """Return how far the claim is from being a real contact at each scale pair and pose, (k,), lengths."""
        # the largest of: distance of a common point from either of the two elements, and how far either part reaches
        # across the plane through it; least over the part pairs that have such elements, as a face may be spread over
        # several. Infinite where none has
        return least_errors(self.proofs(pairs, poses), len(poses))

    def proofs(self, pairs: Array, poses: Array) -> list[Proof]:
        """Return the `errors` on each part pair that has such elements: the parts' numbers, and (k,)."""
        # where an error is small that part pair touches, and no deeper than twice the error: the common point is as
        # near to both parts, and the plane through it keeps all vertices of the two parts apart
        return [(carrier.parts, self._errors(carrier, pairs, poses)) for carrier in self._carriers]

    def flush(self, pairs: Array, poses: Array) -> Array:
        """Return how flush the claimed elements are at each scale pair and pose, (k, 3), lengths."""
        # how far their vertices are from one plane, or of two edges from one line; the length of what they share, and
        # its width, of the part pair in which that is widest
        found = np.tile([np.inf, 0.0, 0.0], (len(poses), 1))
        for carrier in self._carriers:
            own = judging.contact_flushness(*carrier[:-1], self._seeds, pairs, poses)
            wider = (own[:, 2] > found[:, 2]) | ((own[:, 2] == found[:, 2]) & (own[:, 1] > found[:, 1]))
            found[:, 0] = np.fmin(found[:, 0], own[:, 0])
            found[wider, 1:] = own[wider, 1:]
        return found

    def _errors(self, carrier: _Carrier, pairs: Array, poses: Array) -> Array:
        pacing.check()
        return judging.contact_errors(*carrier[:-1], self._seeds, pairs, poses)
