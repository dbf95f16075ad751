"""How a contact changes with the data: with the motion, scales, seeds, vertices and face planes; to first order.

The separation of two elements is n . (y - x) of the points x and y with which they meet. It changes by n . (dy - dx),
whatever n does: dn multiplies y - x, which is zero, or along n itself where a clearance is kept. So all that is needed
is how points move that are carried by a vertex, by the line of an edge, or by the plane of a face.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array, Flags
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.elements import Element
from fcdm_opt.model.task import Task
from fcdm_opt.motion.motions import Motion
from fcdm_opt.tolerances import DEFAULT

MOVABLE, STATIC, KEPT_OUT = 0, 1, 2  # numbers of the bodies; keep-outs from KEPT_OUT on


class Term(NamedTuple):
    """A point of a body that enters a constraint with a weight, world frame."""

    body: int
    point: Array  # as drawn
    element: Element  # carries it
    weight: Array
    scale: float  # the body's
    flush: bool = False  # moving a single vertex of the element would break the contact


@dataclass(frozen=True, eq=False)
class Rate:
    """First derivatives of one number: what a constraint keeps not negative, or zero where it pushes both ways."""

    name: str
    slope: Array  # (k,), by the motion's parameters
    scales: Array  # (2,), by the scale pair at which it is taken
    data: Array  # (n,), by all else, in the order of a `Layout`; finite
    broken: Flags  # (n,), entries of `data` that do not exist
    free: bool = False  # pushes both ways

    def times(self, factor: float) -> Rate:
        """Return the rate of a multiple."""
        return replace(self, slope=factor * self.slope, scales=factor * self.scales, data=factor * self.data)

    def plus(self, others: Sequence[Rate], shares: Array) -> Rate:
        """Return the rate of a sum with multiples of others, (n,)."""
        slope, scales, data = (
            getattr(self, key) + shares @ [getattr(own, key) for own in others] for key in ("slope", "scales", "data")
        )
        used = [own.broken for own, share in zip(others, shares, strict=True) if share]
        return replace(self, slope=slope, scales=scales, data=data, broken=np.any([self.broken, *used], axis=0))

    def along(self, pair: Array, lines: Sequence[Rate]) -> Rate:
        """Return the rate where the scale pair follows two lines: it changes by `pair`, (2, 2), times their changes."""
        return replace(self.plus(lines, self.scales @ pair), scales=np.zeros(2))


@dataclass(frozen=True, eq=False)
class Layout:
    """Places of the data in one vector: target pair, limits, clearances, then seed, vertices, faces of each body."""

    bodies: tuple[Body, ...]  # movable, static, keep-outs
    parameters: int  # of the motion
    target = slice(0, 2)

    @classmethod
    def of(cls, task: Task) -> Layout:
        """Return the layout of a task."""
        return cls((task.movable, task.static, *(own.body for own in task.keep_out)), len(task.weights))

    @property
    def limits(self) -> slice:
        """Lower and upper limit of each parameter, 2 k."""
        return slice(2, 2 + 2 * self.parameters)

    @property
    def clearances(self) -> slice:
        """That of the target pair, then those of the keep-outs."""
        return slice(self.limits.stop, self.limits.stop + len(self.bodies) - 1)

    @cached_property
    def _starts(self) -> list[list[int]]:
        """Seed, first vertex, first face and end of each body."""
        sizes = [size for body in self.bodies for size in (3, 3 * len(body.vertices), len(body.faces))]
        starts = np.cumsum([self.clearances.stop, *sizes]).tolist()
        return [starts[k : k + 4] for k in range(0, len(sizes), 3)]

    @property
    def size(self) -> int:
        """Length of the vector."""
        return self._starts[-1][-1]

    def seed(self, body: int) -> slice:
        """Seed of a body, 3."""
        return slice(*self._starts[body][:2])

    def vertices(self, body: int) -> slice:
        """Vertices of a body, row by row."""
        return slice(*self._starts[body][1:3])

    def faces(self, body: int) -> slice:
        """Outward shifts of a body's face planes."""
        return slice(*self._starts[body][2:])

    @cached_property
    def parting(self) -> Flags:
        """Which entries are shifts of faces that part a vertex, one of more than three faces, (n,)."""
        made = np.zeros(self.size, dtype=bool)
        for k, body in enumerate(self.bodies):
            made[self.faces(k)] = [any(len(body.faces_with((label,))) > 3 for label in face) for face in body.faces]
        return made

    def rate(self, name: str = "", slope: Array | None = None, *, free: bool = False) -> Rate:
        """Return a rate that depends on no data."""
        slope = np.zeros(self.parameters) if slope is None else slope
        return Rate(name, slope, np.zeros(2), np.zeros(self.size), np.zeros(self.size, dtype=bool), free)

    def carry(self, data: Array, broken: Flags, term: Term, pull: Array) -> None:
        """Add to a rate's `data` what moving a term's vertices and planes does, and mark what is broken."""
        # a displacement of the point, as drawn, is multiplied with `pull`, (3,)
        vertices = data[self.vertices(term.body)].reshape(-1, 3)
        lost = broken[self.vertices(term.body)].reshape(-1, 3)
        body, (kind, labels) = self.bodies[term.body], term.element
        rows = np.array(labels) - 1
        if term.flush or len(rows) > 3:  # it turns the plane of other vertices, or parts it
            lost[rows] = True
        else:
            corners = body.vertices[rows]
            shares = np.linalg.lstsq((corners[1:] - corners[0]).T, term.point - corners[0])[0]
            vertices[rows] += np.append(1.0 - shares.sum(), shares)[:, None] * pull
        # the faces that carry the element, and how fast each moves it; nan where it would come apart
        faces = [tuple(sorted(labels))] if kind == "F" else body.faces_with(labels)
        own = [body.face_rows[face] for face in faces if face in body.face_rows]
        planes, shifts = body.face_planes[0][own], np.full((len(own), 3), np.nan)
        enough = len(own) == {"F": 1, "E": 2, "V": 3}[kind]
        if enough and np.linalg.svd(planes, compute_uv=False)[-1] > DEFAULT.nominal:  # a plane not known is 0
            shifts = np.linalg.pinv(planes).T
        chosen, lost_shifts = np.array(own, dtype=np.int64), np.isnan(shifts).any(axis=1)
        data[self.faces(term.body)][chosen] += np.where(lost_shifts, 0.0, shifts @ pull)
        broken[self.faces(term.body)][chosen] |= lost_shifts


@lru_cache(maxsize=64)
def _pose_rates(motion: Motion) -> Any:
    """Return a CasADi function (q, seeds) -> (transform, its derivatives by q and the seeds), column by column."""
    import casadi

    q, seeds = casadi.SX.sym("q", len(motion.parameters)), casadi.SX.sym("seeds", 6)
    flat = casadi.vec(casadi.densify(motion.symbolic(q, seeds[:3], seeds[3:])).T)
    rates = casadi.densify(casadi.jacobian(flat, casadi.vertcat(q, seeds)))
    return casadi.Function("pose_rates", [q, seeds], [flat, rates], ["q", "seeds"], ["pose", "rates"])


@dataclass(frozen=True, eq=False)
class MovedScene:
    """Body 1 at a point of a motion's path, and how its pose changes."""

    task: Task
    layout: Layout
    pose: Array  # (12,), relative to the static body, see `kernels`
    transform: Array  # (4, 4)
    by_motion: Array  # (k, 4, 4), by the parameters of the whole motion
    by_seeds: Array  # (6, 4, 4), by s_1 and s_2 as drawn

    @classmethod
    def at(cls, task: Task, layout: Layout, q: Array, s: float = 1.0) -> MovedScene:
        """Return the scene at position s of the straight path to q."""
        seeds = np.concatenate([task.movable.seed, task.static.seed])
        flat, rates = (np.array(x) for x in _pose_rates(task.motion)(s * q, seeds))
        rates = rates.T.reshape(-1, 4, 4)
        k = len(q)
        return cls(task, layout, task.pose(s * q), flat.reshape(4, 4), s * rates[:k], rates[k:])

    def placed(self, body: int, part: ConvexPart, vertices: Any, scale: float) -> Array:
        """Return where vertices of a part of body 1 or 2 are at a scale, relative to s_2."""
        arms = scale * (part.vertices[vertices] - part.seed)
        return arms @ self.pose[:9].reshape(3, 3).T - self.pose[9:] if body == MOVABLE else arms

    def drawn(self, body: int, place: Array, scale: float) -> Array:
        """Return where a point of body 1 or 2 is drawn that is at `place` at a scale, relative to s_2."""
        if body == STATIC:
            return np.asarray(self.task.static.seed + place / scale)
        return np.asarray(self.task.movable.seed + (place + self.pose[9:]) @ self.pose[:9].reshape(3, 3) / scale)

    def rate(self, name: str, terms: Sequence[Term]) -> Rate:
        """Return the rate of a sum of weights . points."""
        layout, rotation = self.layout, self.transform[:3, :3]
        made = layout.rate(name)
        for term in terms:
            seed = layout.bodies[term.body].seed
            arm, weight, pull = term.point - seed, term.weight, term.scale * term.weight
            if term.body == MOVABLE:
                place = np.append(seed + term.scale * arm, 1.0)
                made.slope[:] += (self.by_motion @ place)[:, :3] @ weight
                by_seeds = (self.by_seeds @ place)[:, :3] @ weight
                made.data[layout.seed(MOVABLE)] += by_seeds[:3]
                made.data[layout.seed(STATIC)] += by_seeds[3:]
                weight, pull = weight @ rotation, pull @ rotation
            made.data[layout.seed(term.body)] += (1.0 - term.scale) * weight
            if term.body in (MOVABLE, STATIC):
                made.scales[term.body] += weight @ arm
            layout.carry(made.data, made.broken, term, pull)
        return made
