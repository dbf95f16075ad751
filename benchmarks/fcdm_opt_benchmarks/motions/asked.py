"""What a problem asks of a motion, as numbers: e = 0 and g >= 0, in typical amounts, for searches that know no more.

They are: that the tracked pair is where the goal wants it, that the tracked features are the contact at some points of
the way, the state of the parts made, and keep-outs; limits are bounds of the parameters. With a collision library in
place of the toolkit's own gaps: `AskedOfCoal`.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.model.seats import independent, tilts
from fcdm_opt.model.task import Task
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.coal_shapes import coal_hull, coal_requests

WAY = (0.25, 0.5, 0.75, 1.0)  # positions on the way at which a rival looks at the tracked contact
DIFFERENCE = 1e-7  # of typical amounts, for derivatives: half the digits of the conditions
CORRECTIONS = 8  # Newton steps that bring a motion onto its conditions
ACCEPTED = 1e-7  # typical amounts by which conditions may be missed where a motion is handed to the judge
FAR = 1e3  # typical amounts: stands for conditions that cannot be computed
Kept = MutableMapping[ConvexPart, tuple[Any, Array]]


class Asked:
    """What a problem asks of a motion, as numbers; counts the poses that are looked at: `queries`.

    Parameters
    ----------
    task : Task
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        self.queries = 0
        self.scales = task.unit / task.weights  # a typical amount in each parameter
        self._last: tuple[bytes, tuple[Array, Array]] | None = None
        self._last_slopes: tuple[bytes, Array] | None = None
        self._rows: list[int] | None = None

    @property
    def bounds(self) -> Array:
        """Limits in typical amounts, (k, 2)."""
        return self.task.limits / self.scales[:, None]

    def amount(self, z: Array) -> float:
        """Return half the square of the amount of a motion, given in typical amounts: it is smooth at rest."""
        return 0.5 * (float(z @ z) if self.task.weighted else (self.task.amount(z * self.scales) / self.task.unit) ** 2)

    def conditions(self, z: Array) -> tuple[Array, Array]:
        """Return (e, g) of a motion: e = 0 and g >= 0 are asked."""
        key = np.ascontiguousarray(z).tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, self._conditions(z * self.scales)
        return self._last[1]

    def missed(self, z: Array) -> Array:
        """Return by how much each condition is missed, none negative."""
        e, g = self.conditions(z)
        return np.concatenate([np.abs(e), np.maximum(-g, 0.0)])

    def stacked(self, z: Array) -> Array:
        """Return all conditions in one row."""
        return np.concatenate(self.conditions(z))

    def slopes(self, z: Array, *, central: bool = False) -> Array:
        """Return derivatives of `stacked`, (rows, k), by forward or central differences."""
        steps = DIFFERENCE * np.eye(len(z))
        if central:
            return np.column_stack([(self.stacked(z + d) - self.stacked(z - d)) / (2.0 * DIFFERENCE) for d in steps])
        key = np.ascontiguousarray(z).tobytes()
        if self._last_slopes is None or self._last_slopes[0] != key:
            here = self.stacked(z)
            made = np.column_stack([(self.stacked(z + d) - here) / DIFFERENCE for d in steps])
            self._last_slopes = key, made
        return self._last_slopes[1]

    def restored(self, z: Array) -> Array | None:
        """Return a motion on the conditions near one that nearly meets them, None where it does not come near."""
        for _ in range(CORRECTIONS):
            missed = self.missed(z)
            if not missed.max(initial=0.0) > DEFAULT.solver:
                break
            e, _ = self.conditions(z)
            rows = np.append(np.ones(len(e), dtype=bool), missed[len(e) :] > 0)
            values, slopes = self.stacked(z)[rows], self.slopes(z)[rows]
            if not (np.isfinite(values).all() and np.isfinite(slopes).all()):
                return None
            z = np.clip(z - np.linalg.lstsq(slopes, values, rcond=None)[0], *self.bounds.T)
        return z * self.scales if self.missed(z).max(initial=0.0) <= ACCEPTED else None

    # ------------------------------------------------------------------------------------------------- conditions

    def _conditions(self, q: Array) -> tuple[Array, Array]:
        nothing: tuple[list[Array], list[Array]] = ([], [])
        tracked = self._tracked(q) if self.task.tracked else nothing
        made = self._parts_made(q) if np.isfinite(self.task.needs).any() else nothing
        e, g = (np.concatenate([np.empty(0), *one, *two]) for one, two in zip(tracked, made, strict=True))
        return np.nan_to_num(e, nan=FAR), np.nan_to_num(g, nan=-FAR)

    def reaches(self, q: Array) -> bool:
        """Tell whether the tracked pair, or else the gap of the parts made, is where it should be: a first sieve."""
        task = self.task
        self.queries += 1
        if not task.tracked:
            return min(task.misses(q)) >= 0
        return bool(((task.tracked_contact(q)[0] - task.target) * task.signs >= 0).all())

    def _tracked(self, q: Array) -> tuple[list[Array], list[Array]]:
        task = self.task
        if task.goal == "seat":
            return [self._seated(q)], self._real(q)
        if len(task.tracked) == 1:
            self.queries += 1
            return [task.line_gaps(q)[1] / task.unit], self._real(q)
        self.queries += 1
        off = (task.tracked_contact(q)[0] / task.target - 1.0) * (task.size / task.unit)
        return ([], [off * task.signs, *self._real(q)]) if task.goal == "beyond" else ([off], self._real(q))

    def _seated(self, q: Array) -> Array:
        """Return misalignments and gaps of flush contacts, without those that depend on others."""
        if self._rows is None:
            self._rows = []
            beside = np.linspace(0.5, 1.0, len(q)) * (self.task.limits != 0).any(axis=1) * self.scales * DIFFERENCE**0.5
            steps = np.diag(DIFFERENCE * self.scales)
            rates = [(self._seats(beside + d) - self._seats(beside - d)) / (2.0 * DIFFERENCE) for d in steps]
            self._rows = independent(np.column_stack(rates))
        return self._seats(q)[self._rows]

    def _seats(self, q: Array) -> Array:
        task = self.task
        self.queries += 1
        R = task.transform(q)[:3, :3]
        turns = [turn for seat in task.seats for turn in seat.turns]
        tilted = tilts(task.seats, task.spins) @ q if task.coherent else np.array([m @ R @ p for m, p in turns])
        return np.concatenate([tilted * task.size, task.line_gaps(q)[1]]) / task.unit

    def _real(self, q: Array) -> list[Array]:
        """Return what makes the tracked features the contact: nothing sticks out, touching, nothing else overlaps."""
        return [self._real_at(q, s) for s in (WAY if self.task.coherent else WAY[-1:])]

    def _real_at(self, q: Array, s: float) -> Array:
        task = self.task
        self.queries += 1
        rho, pose, tracked = task.tracked_contact(q, s)
        row = np.full(2 * len(tracked) + 2, -FAR)
        if not (np.isfinite(rho).all() and rho.min() > 0 and np.isfinite(pose).all()):
            return row
        R, separation = pose[:9].reshape(3, 3), -np.inf
        for k, (feature, inner) in enumerate(zip(tracked, self._inner, strict=True)):
            one, two = task.movable.parts[feature.parts[0]], task.static.parts[feature.parts[1]]
            first, second = (one.vertices - one.seed) @ (feature.normal @ R), (two.vertices - two.seed) @ feature.normal
            row[2 * k] = rho[0] * (feature.line[0] - first[inner[0]].max(initial=-np.inf))
            row[2 * k + 1] = rho[1] * (feature.line[1] + second[inner[1]].min(initial=np.inf))
        pairs = {feature.parts for feature in tracked}
        for i, j in pairs:
            sites, facets = kernels.facet_rows(*task.movable.parts[i].packed, *task.static.parts[j].packed, pose)
            own = np.logical_or.reduce([(sites == other.site).all(1) for other in tracked if other.parts == (i, j)])
            separations = facets[:, 5] - facets[:, 3:5] @ rho
            separation = max(separation, separations[~own].max(initial=-np.inf))
        gaps = np.full((len(task.movable.parts), len(task.static.parts)), np.inf)
        if len(pairs) < gaps.size:
            gaps = kernels.near_gaps(*task.movable.packed, *task.static.packed, pose, rho, 0.0)
            gaps[tuple(np.transpose(list(pairs)))] = np.inf
        row[-2:] = -separation, gaps.min()
        return np.minimum((row + self._slack) / task.unit, FAR)

    @cached_property
    def _slack(self) -> float:
        """Length by which a contact may be missed on the way, as in the solver."""
        return DEFAULT.cut * self.task.size

    @cached_property
    def _inner(self) -> list[tuple[Any, Any]]:
        """Of each tracked feature, which vertices of both parts are not in its plane at rest."""
        task = self.task
        found = []
        _, pose, tracked = task.tracked_contact(task.rest)
        R = pose[:9].reshape(3, 3)
        for feature in tracked:
            one, two = task.movable.parts[feature.parts[0]], task.static.parts[feature.parts[1]]
            first = feature.line[0] - (one.vertices - one.seed) @ (feature.normal @ R)
            second = feature.line[1] + (two.vertices - two.seed) @ feature.normal
            found.append((first > self._slack, second > self._slack))
        return found

    def _parts_made(self, q: Array) -> tuple[list[Array], list[Array]]:
        """Return what is asked of the pair made, and of keep-outs."""
        task = self.task
        self.queries += 1
        gaps = self.gaps(q)
        count = len(task.static.parts)
        others = (gaps - task.needs)[:, count:].min(axis=0, initial=FAR * task.unit) / task.unit
        own = np.array([gaps[:, :count].min()]) / task.unit
        if task.must_touch:
            return [own], [others]
        return [], [own - task.need / task.unit if task.must_clear else np.empty(0), others]

    def gaps(self, q: Array) -> Array:
        """Return signed gaps of all part pairs, (parts of 1, obstacles)."""
        return self.task.pair_gaps(q)


class AskedOfCoal(Asked):
    """The same conditions, with gaps from a collision library: distances, and minus penetration depths.

    The library is asked as its users do: one shape a part, at the scale made, and a call a part pair.

    Parameters
    ----------
    task : Task
    tolerance : float
        Of the library's iterations, relative.
    """

    def __init__(self, task: Task, tolerance: float) -> None:
        import coal

        super().__init__(task)
        self._ask, self._here, self._there = coal.distance, coal.Transform3s(), coal.Transform3s()
        self._result, (self._request, _) = coal.DistanceResult(), coal_requests(tolerance)
        self._first = [_shape(part, float(task.target[0]), _KEPT[0]) for part in task.movable.parts]
        self._second = [_shape(own.part, own.scale, _KEPT[1] if own.keep_out < 0 else {}) for own in task.obstacles]
        self._motion = task.motion.kinematics(task.movable.seed, task.static.seed)

    def gaps(self, q: Array) -> Array:
        """Return coal's signed distances of all part pairs."""
        self._place(self._motion.transform(q))
        return np.array([[self._distance(one, two) for two in self._second] for one in self._first])

    def nearest(self, q: Array) -> tuple[float, Array]:
        """Return the signed distance of the only part pair, and how fast it grows with each parameter, (k,).

        That is the speed, along the normal, of the point of body 1 that is nearest to body 2, or deepest in it.
        """
        self.queries += 1
        T, rates = self._motion.rates(q)
        self._place(T)
        gap = self._distance(self._first[0], self._second[0])
        point = self._result.getNearestPoint1()
        back = T[:3, :3].T @ (point - T[:3, 3])
        return gap, -(rates[:, :3, :3] @ back + rates[:, :3, 3]) @ self._result.normal

    def _place(self, T: Array) -> None:
        self._here.setRotation(T[:3, :3])
        self._here.setTranslation(T[:3, 3])

    def _distance(self, one: Any, two: Any) -> float:
        self._result.clear()
        return float(self._ask(one, self._here, two, self._there, self._request, self._result))


_KEPT: tuple[Kept, Kept] = (WeakKeyDictionary(), WeakKeyDictionary())
"""Hulls of parts of body 1 and of body 2: they depend on the bodies alone, as what the toolkit keeps of them does."""


def _shape(part: ConvexPart, scale: float, kept: Kept) -> Any:
    """Return a part at a scale as a convex shape of coal: its hull is built once, its points are set."""
    if part not in kept:
        shape = coal_hull(part.vertices)
        kept[part] = shape, shape.points() - part.seed
    shape, base = kept[part]
    shape.points()[:] = part.seed + scale * base
    return shape
