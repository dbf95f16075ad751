"""Stage 4, last: programs that leave out what may not matter, and grow by what their solutions violate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.coherence import Fault
from fcdm_opt.curve.contact import distinct
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.model.equations import feature_points
from fcdm_opt.model.task import Answer, Parts, Task
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages import program, rays
from fcdm_opt.stages.program import INF, Outcome, Row
from fcdm_opt.tolerances import DEFAULT

ROUNDS = 40  # of adding violated constraints
CHOICES = 12  # directions tried for a pair that must come apart, and pairs tried that might close
VARIANTS = 40  # choices for several overlapping pairs, at most
PLANES = 120  # separating planes of all variants together: a program with a hundred takes seconds
KEPT = 6  # starts of the first round that later rounds keep
KEPT_SHARED = 2.0  # times the least that flush contacts share, kept where they would slide off
START_DISTANCE = 3.0  # starts away from rest, in typical amounts
HELD = 3  # vertices of either part that a new separating plane holds at once


def nonlinear(task: Task) -> Answer:
    """Stage 4: the nonlinear program."""
    # where contacts must stay flush, which few turns let them, first without turns, and then with turns from there
    turning = task.spins.any(axis=1) & (task.limits[:, 0] <= 0) & (task.limits[:, 1] >= 0)
    still = frozen(np.where(turning[:, None], 0.0, task.limits))
    if not any(task.flush) or not turning.any() or (still == 0).all() or (still == task.limits).all():
        return _program(task)
    answer = _program(replace(task, limits=still))
    if answer.q is None:
        return _program(task)
    best = answer
    starts = [answer.q, *(answer.q + sign * x for x in np.diag(task.steps)[turning] for sign in (1.0, -1.0))]
    for relaxation in choices(task, answer.q, near=True):
        best = _better(best, relaxation.smallest([np.clip(q, *task.limits.T) for q in starts])) or best
    return replace(best, stage=answer.stage, lower_bound=min(task.displacement_bound, best.amount))


def _program(task: Task) -> Answer:
    """Return what the nonlinear program finds; constraints of other features come in when a solution violates them.

    Several starts, and every choice of features that may matter; then the first contact on a ray. All starts are fixed:
    the same task gives the same answer.
    """
    near = np.where(task.motion.turning, np.minimum(START_DISTANCE * task.steps, 1.0), START_DISTANCE * task.steps)
    starts = [task.start, *(task.start + sign * row for row in np.diag(near) for sign in (1.0, -1.0))]
    starts = [np.clip(start, *task.limits.T) for start in starts]
    best, reached = None, False  # whether any reached what is asked but for coherence
    for relaxation in sorted(choices(task, task.start), key=lambda choice: choice.promise):
        if best is not None and relaxation.promise >= best.amount:
            break
        # of tracked features a later round may find a nearer start
        best = _better(best, relaxation.smallest(starts, np.inf if best is None or task.tracked else best.amount))
        reached = reached or relaxation.reached
    contact = rays.on_a_ray(task, best) if not task.tracked and task.allows(task.rest) else None
    if contact is not None:
        best = contact
        for relaxation in choices(task, contact.motion, near=True):
            best = _better(best, relaxation.smallest([contact.motion], best.amount)) or best
    stage, bound = "4: nonlinear program", task.displacement_bound
    if best is None:
        status = Status.LEFT_COHERENT_RANGE if reached and task.coherent else Status.NOT_FOUND
        return Answer(status, None, f"{stage}, no start succeeded", bound)
    return replace(best, stage=stage, lower_bound=min(bound, best.amount))  # the two differ by rounding at most


def _better(one: Answer | None, two: Answer | None) -> Answer | None:
    return min((found for found in (one, two) if found is not None), key=lambda found: found.amount, default=None)


@dataclass(eq=False)
class Relaxation:
    """The constraints of one choice of features, and the part pair that must not stay apart, if any: `closing`.

    Choices are tried in the order of their `promise`, what they need at rest, to first order. Some solution `reached`
    it that met everything but the coherence of the path.
    """

    task: Task
    closing: Parts | None = None
    promise: float = 0.0
    reached: bool = False
    _rows: list[Row] = field(default_factory=list)
    _planes: dict[Parts, Array] = field(default_factory=dict)
    _known: set[tuple[object, ...]] = field(default_factory=set)
    _features: set[tuple[object, ...]] = field(default_factory=set)
    _met: set[Parts] = field(default_factory=set)
    _incoherent: bool = False

    def __post_init__(self) -> None:
        if self.task.tracked or self.task.joints:
            self._rows += program.goal_rows(self.task)

    def smallest(self, starts: list[Array], enough: float = np.inf, method: str = "sqpmethod") -> Answer | None:
        """Return the smallest motion, adding what solutions violate; None if there is none.

        Each round starts from `starts`, (k,) each, in later rounds from the first few and the latest solution. It is
        given up once the amount is no smaller than `enough`: more constraints only add to it. `method` is a CasADi
        plugin, "sqpmethod" or "ipopt".
        """
        task, outcome = self.task, self._solved(starts, method)
        for _ in range(ROUNDS):
            pacing.check()
            if outcome is None or task.amount(outcome.q) >= enough * (1.0 - DEFAULT.cut):
                return None
            q, normals = outcome.q, dict(zip(self._planes, outcome.normals, strict=True))
            self.reached = self.reached or task.meets(q, DEFAULT.requirement, normals, path=False)
            if not self._grown(q, normals):
                break
            outcome = self._solved([*starts[:KEPT], q], method)
        if outcome is None:
            return None
        if self._incoherent or not task.meets(q, DEFAULT.requirement, normals, path=False):
            return None
        active = tuple(dict.fromkeys(self._rows[k].name for k in outcome.active))
        return task.answer(q, active=active, modelled=self._modelled)

    def _solved(self, starts: list[Array], method: str) -> Outcome | None:
        """Return the least feasible outcome over the starts."""
        planes = np.array(list(self._planes.values())).reshape(-1, 4)
        task = self.task
        found = [program.minimise(task, self._rows, start, planes, method) for start in starts]
        stuck = task.tracked and not any(found)
        cornered = any(task.needs[j] > 0 for _, j in self._planes)  # a distance between corners
        if self._planes and (stuck or cornered):  # where SQP may find nothing, or stop short of the least
            found.append(program.minimise(task, self._rows, starts[0], planes, "ipopt"))
        return min((own for own in found if own is not None), key=lambda own: task.amount(own.q), default=None)

    def _grown(self, q: Array, normals: dict[Parts, Array]) -> bool:
        """Add the constraints that a motion violates; tell whether any is new."""
        task = self.task
        faults = task.path_faults(q) if task.tracked else []
        self._incoherent = bool(faults)
        added = [self._forbid(*fault) for fault in faults]
        if np.isfinite(task.needs).any():
            short = task.needs - task.pair_gaps(q, normals)
            for i, j in np.argwhere(task.without_joints(short > DEFAULT.cut * task.unit)).tolist():
                parts = i, j
                if parts in normals:
                    own, other = self._heights(parts, q, normals[parts])  # foremost along what parts the pair
                    added += [self._hold(parts, 1, int(own.argmax())), self._hold(parts, 2, int(other.argmin()))]
                else:
                    _, rows, separations = task.separations(parts, task.pose(q))
                    self.add_plane(parts, q, rows[int(np.argmax(separations)), :3])
                    added.append(True)
        if self.closing is not None:
            added.append(self.close(q, DEFAULT.cut * task.unit))
        return any(added)

    @property
    def _modelled(self) -> dict[str, int]:
        task = self.task
        lines = (*task.tracked, *task.untracked)
        kept = {*self._planes, *self._met, *(line.parts for line in lines)}
        kept |= {self.closing} if self.closing is not None else set()
        largest = len(task.made_vertices) if task.amount_kind == "displacement" else 0
        return task.modelled(
            kept,
            variables=len(task.weights) + 3 * len(self._planes) + min(largest, 1),
            constraints=len(self._rows) + largest,
            features=len(lines) + len(self._features),
        )

    def _is_new(self, *key: object) -> bool:
        new = key not in self._known
        self._known.add(key)
        return new

    def _forbid(self, s: float, pose: Array, fault: Fault | None) -> bool:
        """Forbid a fault of the tracked contact at path position s."""
        if fault is None:
            return self._keep_flush(s, pose)
        if not self._is_new(s, *fault.key):
            return False
        self._features.add(fault.key)
        self._met.add(fault.parts)
        task, rotation = self.task, pose[:9].reshape(3, 3)
        feature = feature_points(task.movable, task.static, fault.site, fault.parts, fault.normal, rotation)
        scale = feature.steepness(rotation)
        name = fault.kept(task.named(fault.parts))
        if fault.kind == "unsupported":
            part = (task.movable, task.static)[fault.body - 1].parts[fault.parts[fault.body - 1]]
            vertex = part.vertices[fault.vertex]
            self._rows.append(program.support_row(task, s, feature, scale, fault.body, vertex, name))
        else:
            apart = fault.kind == "overlapping"  # on the touching, or apart, side of the feature's contact line
            values = np.concatenate([[s], feature.values, [scale * task.unit]])
            self._rows.append(Row(("line", feature.kind), values, *((0.0, INF) if apart else (-INF, 0.0)), name))
        return True

    def _keep_flush(self, s: float, pose: Array) -> bool:
        """Keep flush contacts that a motion opens at path position s: faces over one another, or else nothing turns."""
        # the last is more than is needed, where a turn opens them to second order only
        task, added = self.task, False
        for flush in task.seats if s == 1.0 else ():
            if flush.misfit(pose, task.target) <= DEFAULT.cut * task.size:
                overlap, least = flush.overlap(pose, task.target), KEPT_SHARED * flush.least
                if overlap.depth < least and self._is_new("shared", *overlap.one, *overlap.two):
                    values = np.concatenate([overlap.direction / task.unit, overlap.one, overlap.two])
                    name = "flush contacts stay on one another"
                    self._rows.append(Row(("over",), values, least / task.unit, INF, name))
                    added = True
        moving = (task.limits != 0).any(axis=1)
        turning = np.flatnonzero(moving & task.spins.any(axis=1))
        if task.seats and not added and 0 < len(turning) < moving.sum() and self._is_new("still"):
            self._rows = [row for row in self._rows if row.template[0] not in ("turned", "aligned")]
            for k in turning:
                values = np.eye(len(task.weights))[k] / task.steps
                self._rows.append(Row(("turned",), values, 0.0, 0.0, "flush contacts stay aligned"))
            added = True
        return added

    def close(self, q: Array, slack: float) -> bool:
        """Close the closing pair along the direction in which it is furthest apart, if by more than `slack`."""
        assert self.closing is not None
        task, pose = self.task, self.task.pose(q)
        sites, rows, separations = task.separations(self.closing, pose)
        worst = int(np.argmax(separations))
        kind, i, j = (int(x) for x in sites[worst])
        if separations[worst] <= slack or not self._is_new("closing", kind, i, j):
            return False
        self._features.add((kind, i, j))
        rotation = pose[:9].reshape(3, 3)
        feature = feature_points(task.movable, task.static, (kind, i, j), self.closing, rows[worst, :3], rotation)
        values = np.append(feature.values, feature.steepness(rotation) * task.unit)
        self._rows.append(Row(("target", feature.kind), values, -INF, 0.0, f"{task.named(self.closing)} closes"))
        return True

    def add_plane(self, parts: Parts, q: Array, normal: Array) -> None:
        """Keep a part pair apart along a direction, as it is at a motion; it is free to turn."""
        heights = self._heights(parts, q, normal)
        self._planes[parts] = np.append(normal, heights[0].max() / self.task.unit)
        for body, order in ((1, np.argsort(-heights[0], kind="stable")), (2, np.argsort(heights[1], kind="stable"))):
            for vertex in order[:HELD]:
                self._hold(parts, body, int(vertex))

    def _hold(self, parts: Parts, body: int, vertex: int) -> bool:
        """Keep a vertex on its body's side of the pair's separating plane."""
        if not self._is_new("plane", parts, body, vertex):
            return False
        self._features.add((parts, body, vertex))
        task, block = self.task, list(self._planes).index(parts)
        if body == 1:
            need, point = 0.0, task.movable.parts[parts[0]].vertices[vertex]
        else:
            obstacle = task.obstacles[parts[1]]
            need, point = obstacle.need, obstacle.placed(task.static.seed)[vertex]
        self._rows.append(program.plane_row(task, block, body, point, need, f"{task.named(parts)} stays apart"))
        return True

    def _heights(self, parts: Parts, q: Array, normal: Array) -> tuple[Array, Array]:
        """Return n.(x - s_2) of both parts' vertices at the scales made."""
        pose, task = self.task.pose(q), self.task
        one = task.movable.parts[parts[0]]
        own = normal @ pose[:9].reshape(3, 3)
        first = task.target[0] * (one.vertices - one.seed) @ own - normal @ pose[9:]
        return first, task.obstacles[parts[1]].placed(task.static.seed) @ normal


def choices(task: Task, q: Array, *, near: bool = False) -> Iterator[Relaxation]:
    """Yield the programs to try from a motion on.

    Which pair closes, and along which direction each overlapping pair comes apart: all that may matter, or with `near`
    only what is there at the motion, which is known to do.
    """
    if not np.isfinite(np.append(task.pose(task.start), task.pose(q))).all():
        return  # a screw has lost its axis there
    asks = bool(np.isfinite(task.needs).any())
    gaps = task.pair_gaps(task.start) if asks else np.zeros((1, 1))
    there = task.pair_gaps(q) if asks else gaps
    everything = sorted(np.ndindex(gaps.shape), key=lambda parts: there[parts])
    apart = task.must_touch and (bool(task.tracked) or task.contact_gap(gaps) > 0)
    closes = apart or (task.must_touch and bool(task.keep_out))  # which may move the part away from a contact
    short = task.without_joints(gaps < task.needs) if asks else gaps < 0.0
    low = {parts: _separating_directions(task, parts, q) for parts in everything if short[parts]}
    pairs = [parts for parts in everything if parts[1] < len(task.static.parts)]
    variants = [dict.fromkeys(low, 0)]
    if near:
        pairs = pairs[:1]
    else:
        variants += [{**variants[0], parts: k} for parts in low for k in range(1, len(low[parts]))]
    # a pair that must touch besides may do so already where it is only kept from overlapping
    asked: list[Parts | None] = [*([None] if task.tracked or not apart else []), *(pairs[:CHOICES] if closes else [])]
    asked = [None] if task.joints else asked  # which are all that must close
    for closing in asked:
        for variant in variants[: int(np.clip(PLANES // max(len(low), 1), 1, VARIANTS))]:
            relaxation = Relaxation(task, closing)
            if closing is not None:
                relaxation.close(q, -np.inf)
                relaxation.promise = max(float(gaps[closing]), 0.0) / task.displacement_rate
            for parts, choice in variant.items():
                amount, normal = low[parts][choice]
                relaxation.add_plane(parts, q, normal)
                relaxation.promise = max(relaxation.promise, amount)
            yield relaxation


def _separating_directions(task: Task, parts: Parts, q: Array) -> list[tuple[float, Array]]:
    """Return (amount, direction) for the ways in which a part pair can come apart near a motion, least first."""
    # the amount is what a way still needs, to first order
    sites, rows, separations = task.separations(parts, task.pose(q))
    steepness = np.linalg.norm(task.gap_rates(parts, q, sites, rows[:, :3]) / task.weights, axis=1)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        amounts = np.nan_to_num((task.needs[parts[1]] - separations) / steepness, nan=np.inf)
    order = np.argsort(amounts, kind="stable")
    kept = order[distinct(rows[order, :3], CHOICES)]  # parallel faces and edges list a direction more than once
    return [(float(amounts[k]), rows[k, :3]) for k in kept]
