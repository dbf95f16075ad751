"""The stages of the solver. Each takes a `Task` and returns an `Answer`, or None where the case is not its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.coherence import Fault, contact_faults
from fcdm_opt.geometry.bodies import Array
from fcdm_opt.tolerance import program
from fcdm_opt.tolerance.bounds import displacement_bound
from fcdm_opt.tolerance.equations import feature_points
from fcdm_opt.tolerance.program import Row
from fcdm_opt.tolerance.solution import Status
from fcdm_opt.tolerance.task import Answer, Task
from fcdm_opt.tolerances import DEFAULT

PATH_POINTS = 33
ROUNDS = 40  # of adding violated constraints, for one choice of features
CHOICES = 10  # features tried for a pair that must come apart, and pairs tried that might close
Parts = tuple[int, int]


def satisfied(task: Task) -> Answer | None:
    """Stage 0: nothing to do."""
    rest = np.zeros(len(task.weights))
    if ((task.limits[:, 0] > 0) | (task.limits[:, 1] < 0)).any() or not _meets(task, rest, DEFAULT.line):
        return None
    return Answer(Status.ALREADY_SATISFIED, rest, "0: met without motion")


def nonlinear(task: Task) -> Answer:
    """Stage 4: the nonlinear program, with constraints of other features added only when a solution violates them.

    Several starts, and every choice of feature that may matter; the least verified outcome wins.
    """
    best: _Found | None = None
    goal_alone = False
    for model in _choices(task):
        found = _least(task, model, best)
        goal_alone = goal_alone or model.goal_reached
        if found is not None and (best is None or found.amount < best.amount):
            best = found
    bound = displacement_bound(task)
    if best is None:
        status = Status.LEFT_COHERENT_RANGE if goal_alone and task.coherent else Status.NOT_FOUND
        return Answer(status, None, "4: nonlinear program, no start succeeded", bound)
    return Answer(Status.SOLVED, best.q, "4: nonlinear program", bound, best.active, best.modelled)


@dataclass(frozen=True, eq=False)
class _Found:
    """A motion that meets everything."""

    q: Array
    amount: float
    active: tuple[str, ...]
    modelled: dict[str, int]


@dataclass(eq=False)
class _Model:
    """The constraints of one choice of features, growing as solutions violate what was left out.

    `planes` holds for each part pair that must stay apart the separating plane to start from; `closing` the pair that
    must not stay apart.
    """

    task: Task
    closing: Parts | None = None
    rows: list[Row] = field(default_factory=list)
    planes: dict[Parts, Array] = field(default_factory=dict)
    known: set[tuple[object, ...]] = field(default_factory=set)
    goal_reached: bool = False

    def __post_init__(self) -> None:
        if self.task.tracked:
            self.rows += program.goal_rows(self.task)

    def add_plane(self, parts: Parts, q: Array, normal: Array) -> None:
        """Keep a part pair apart along a direction that is free to turn; rows for its vertices follow when needed."""
        self.rows.append(program.unit_row(len(self.planes)))
        block = len(self.planes)
        self.planes[parts] = np.append(normal, 0.0)
        heights = self._heights(parts, q, normal)
        self.planes[parts][3] = heights[0].max() / self.task.unit
        for body in (1, 2):
            order = np.argsort(heights[body - 1] * (-1 if body == 1 else 1), kind="stable")
            for vertex in order[:3]:
                self._hold(parts, block, body, int(vertex))

    def _heights(self, parts: Parts, q: Array, normal: Array) -> tuple[Array, Array]:
        """Return n.(x - s_2) of both parts' vertices at the target pair."""
        pose = self.task.pose(q)
        X = self.task.movable.parts[parts[0]].packed[0][: len(self.task.movable.parts[parts[0]].vertices)]
        Y = self.task.static.parts[parts[1]].packed[0][: len(self.task.static.parts[parts[1]].vertices)]
        turned = normal @ pose[:9].reshape(3, 3)
        return self.task.target[0] * X @ turned - normal @ pose[9:], self.task.target[1] * Y @ normal

    def _hold(self, parts: Parts, block: int, body: int, vertex: int) -> bool:
        key = ("plane", parts, body, vertex)
        if key in self.known:
            return False
        self.known.add(key)
        part = (self.task.movable, self.task.static)[body - 1].parts[parts[body - 1]]
        name = f"part pair {parts[0] + 1}, {parts[1] + 1} stays apart"
        self.rows.append(program.plane_row(self.task, block, body, part.vertices[vertex], name))
        return True

    def hold_vertices(self, parts: Parts, q: Array, plane: Array) -> bool:
        """Add rows for the vertices that stick out furthest beyond a pair's plane; tell whether any did."""
        heights = self._heights(parts, q, plane[:3])
        level, slack = plane[3] * self.task.unit, DEFAULT.cut * self.task.unit
        out = (heights[0] - level, level + self.task.need - heights[1])
        block = list(self.planes).index(parts)
        return any(
            [self._hold(parts, block, body, int(np.argmax(over))) for body, over in ((1, out[0]), (2, out[1]))
             if over.max() > slack]
        )

    def add_fault(self, s: float, pose: Array, fault: Fault) -> bool:
        """Add the row that forbids a fault of the tracked contact at path position s; tell whether it is new."""
        key = (fault.kind, fault.parts, fault.site, fault.body, fault.vertex, round(s * (PATH_POINTS - 1)))
        if key in self.known:
            return False
        self.known.add(key)
        task, rotation = self.task, pose[:9].reshape(3, 3)
        feature = feature_points(task.movable, task.static, fault.site, fault.parts, fault.normal, rotation)
        scale = feature.steepness(rotation)
        if fault.kind == "unsupported":
            part = (task.movable, task.static)[fault.body - 1].parts[fault.parts[fault.body - 1]]
            label = part.elements["V"][fault.vertex].vertices
            name = f"P{fault.body}V{label[0]} stays behind the tracked feature"
            vertex = part.vertices[fault.vertex]
            self.rows.append(program.support_row(task, s, feature, scale, fault.body, vertex, name))
        else:
            apart = fault.kind == "overlapping"
            what = "stays apart" if apart else "stays in contact"
            name = f"part pair {fault.parts[0] + 1}, {fault.parts[1] + 1} {what} on the way"
            self.rows.append(program.line_row(task, s, feature, scale, apart, name))
        return True

    def add_closing(self, q: Array) -> bool:
        """Add the direction in which the closing pair is furthest apart; tell whether it is new."""
        assert self.closing is not None
        task, pose = self.task, self.task.pose(q)
        sites, rows = _facets(task, self.closing, pose)
        separations = rows[:, 5] - rows[:, 3:5] @ task.target
        worst = int(np.argmax(separations))
        site = (int(sites[worst, 0]), int(sites[worst, 1]), int(sites[worst, 2]))
        if separations[worst] <= DEFAULT.cut * task.unit or ("closing", site) in self.known:
            return False
        self.known.add(("closing", site))
        rotation = pose[:9].reshape(3, 3)
        feature = feature_points(task.movable, task.static, site, self.closing, rows[worst, :3], rotation)
        name = f"part pair {self.closing[0] + 1}, {self.closing[1] + 1} closes"
        self.rows.append(program.target_row(task, feature, feature.steepness(rotation), name))
        return True


def _facets(task: Task, parts: Parts, pose: Array) -> tuple[Array, Array]:
    one, two = task.movable.parts[parts[0]], task.static.parts[parts[1]]
    sites, rows = kernels.facet_rows(*one.packed, *two.packed, pose, DEFAULT.tie)
    return sites, rows


def _demands(task: Task) -> tuple[bool, bool]:
    """Return whether the target pair must be apart (by `need`) and whether it must touch."""
    return (
        task.goal in ("touch", "clear") or task.pair in ("touch", "clear"),
        task.goal == "touch" or task.pair == "touch",
    )


def _meets(task: Task, q: Array, slack: float) -> bool:
    """Tell whether a motion meets goal, pair state and coherence to within a relative slack."""
    if task.tracked:
        rho, _, _ = task.tracked_contact(q)
        excess = (rho - task.target) * task.signs if task.goal == "beyond" else -np.abs(rho - task.target)
        if not (excess >= -slack * task.target).all() or _path_faults(task, q):
            return False
    must_clear, must_touch = _demands(task)
    gap = task.gap(q) if must_clear else 0.0
    short, loose = gap < task.need - slack * task.size, abs(gap) > slack * task.size
    return not (must_clear and short) and not (must_touch and loose)


def _path_faults(task: Task, q: Array) -> list[tuple[float, Array, Fault]]:
    """Return the worst fault of each kind along the path (or at its end only), with path position and pose."""
    worst: dict[tuple[object, ...], tuple[float, Array, Fault]] = {}
    slack = DEFAULT.cut * task.size
    for s in np.linspace(1.0, 0.0, PATH_POINTS)[: PATH_POINTS - 1 if task.coherent else 1]:
        rho, pose, tracked = task.tracked_contact(q, s)
        if not (np.isfinite(rho).all() and rho.min() > 0):
            continue
        for fault in contact_faults(task.movable, task.static, pose, rho, tracked, slack):
            key = (fault.kind, fault.parts, fault.site, fault.body, fault.vertex)
            if key not in worst or fault.excess > worst[key][2].excess:
                worst[key] = (float(s), pose, fault)
    return list(worst.values())


def _choices(task: Task) -> Iterator[_Model]:
    """Yield the models to try: which pair closes, and along which direction each overlapping pair comes apart."""
    must_clear, must_touch = _demands(task)
    rest = np.zeros(len(task.weights))
    gaps = task.pair_gaps(rest) if must_clear else np.zeros((1, 1))
    pairs = sorted(np.ndindex(gaps.shape), key=lambda parts: gaps[parts])
    closes = must_touch and (bool(task.tracked) or gaps.min() > 0)
    low = [parts for parts in pairs if must_clear and gaps[parts] < task.need]
    for closing in pairs[:CHOICES] if closes else [None]:
        for varied in range(max(len(low), 1)):
            for choice in range(CHOICES if low else 1):
                if varied and not choice:
                    continue  # the best of each pair was the first model
                model = _Model(task, closing)
                for k, parts in enumerate(low):
                    _, rows = _facets(task, parts, task.pose(rest))
                    separations = rows[:, 5] - rows[:, 3:5] @ task.target
                    order = np.argsort(-separations, kind="stable")
                    rank = choice if k == varied else 0
                    if rank < len(order):
                        model.add_plane(parts, rest, rows[order[rank], :3])
                yield model


def _starts(task: Task) -> list[Array]:
    """Return rest, and steps of three typical amounts either way along each parameter."""
    step = 3.0 * task.unit / task.weights
    return [np.zeros(len(step)), *(sign * step * row for row in np.eye(len(step)) for sign in (1.0, -1.0))]


def _least(task: Task, model: _Model, best: _Found | None) -> _Found | None:
    """Return the smallest motion of a model, adding what its solutions violate; None if there is none.

    Without tracked features a model that is already worse than the best known is given up: rows only add to it.
    """
    starts = _starts(task) if task.tracked or not model.planes else [np.zeros(len(task.weights))]
    must_clear, _ = _demands(task)
    for _ in range(ROUNDS):
        outcome = _solved(task, model, starts)
        if outcome is None:
            return None
        model.goal_reached = True
        q = outcome.q
        if best is not None and task.amount(q) >= best.amount * (1.0 - DEFAULT.cut) and not task.tracked:
            return None
        added = [model.add_fault(*fault) for fault in (_path_faults(task, q) if task.tracked else [])]
        if must_clear:
            gaps = task.pair_gaps(q)
            for parts in np.ndindex(gaps.shape):
                if gaps[parts] >= task.need - DEFAULT.cut * task.unit:
                    continue
                if parts in model.planes:
                    plane = outcome.planes[:, list(model.planes).index(parts)]
                    added.append(model.hold_vertices(parts, q, plane))
                else:
                    _, rows = _facets(task, parts, task.pose(q))
                    normal = rows[int(np.argmax(rows[:, 5] - rows[:, 3:5] @ task.target)), :3]
                    model.add_plane(parts, q, normal)
                    added.append(True)
        if model.closing is not None:
            added.append(model.add_closing(q))
        if not any(added):
            break
        starts = [*starts[:1], q, *starts[2:]] if len(starts) > 1 else [*starts, q]
    q = _shortened(task, q) if not task.tracked else q
    if not _meets(task, q, DEFAULT.requirement):
        return None
    names = tuple(dict.fromkeys(model.rows[k].name for k in outcome.active))
    modelled = {
        "rows": len(model.rows),
        "part_pairs_kept": len({*model.planes, *(f.parts for f in task.tracked), *([model.closing] if model.closing
                                                                                    else [])}),
        "part_pairs_total": len(task.movable.parts) * len(task.static.parts),
        "directions_total": sum(
            len(_facets(task, parts, task.pose(q))[0])
            for parts in np.ndindex(len(task.movable.parts), len(task.static.parts))
        ),
    }
    return _Found(q, task.amount(q), names, modelled)


def _solved(task: Task, model: _Model, starts: list[Array]) -> program.Outcome | None:
    """Return the least feasible outcome over the starts; IPOPT is asked where SQP finds none."""
    planes = np.array(list(model.planes.values())).T if model.planes else np.zeros((4, 0))
    for method in ("sqpmethod", "ipopt"):
        outcomes = [program.minimise(task, model.rows, start, planes, method) for start in starts]
        feasible = [outcome for outcome in outcomes if outcome.feasible]
        if feasible:
            return min(feasible, key=lambda outcome: task.amount(outcome.q))
    return None


def _shortened(task: Task, q: Array) -> Array:
    """Return the shortest stretch of the ray at whose end the target pair has the gap it needs."""
    from scipy.optimize import brentq

    def miss(s: float) -> float:
        return task.gap(s * q) - task.need

    start, end = miss(0.0), miss(1.0)
    if abs(end) <= DEFAULT.cut * task.unit or start * end >= 0 or not task.limits[:, 0].max() <= 0 <= task.limits[
        :, 1
    ].min():
        return q
    s = brentq(miss, 0.0, 1.0, xtol=DEFAULT.line, rtol=4 * np.finfo(float).eps)
    return q * float(s)
