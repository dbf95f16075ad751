"""The stages of the solver. Each takes a `Task` and returns an `Answer`, or None where the case is not its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.coherence import Fault, contact_faults
from fcdm_opt.geometry.bodies import Array
from fcdm_opt.tolerance import program, rays
from fcdm_opt.tolerance.bounds import displacement_bound, displacement_rate
from fcdm_opt.tolerance.equations import feature_points
from fcdm_opt.tolerance.program import Row
from fcdm_opt.tolerance.solution import Status
from fcdm_opt.tolerance.task import Answer, Task
from fcdm_opt.tolerances import DEFAULT

PATH_POINTS = 33
ROUNDS = 40  # of adding violated constraints, for one choice of features
REACH = 3.0  # starts away from rest, in typical amounts
PROBES = 5  # improvements by probing, at most
PROBE_FRACTIONS = (0.98, 0.7, 0.4)
PROBE_SHARES = (0.5, 1.0, 2.0)
CHOICES = 12  # features tried for a pair that must come apart, and pairs tried that might close
Parts = tuple[int, int]


def satisfied(task: Task) -> Answer | None:
    """Stage 0: nothing to do."""
    rest = np.zeros(len(task.weights))
    if not _rest_allowed(task) or not _meets(task, rest, DEFAULT.line, {}):
        return None
    return Answer(Status.ALREADY_SATISFIED, rest, "0: met without motion")


def straight(task: Task) -> Answer | None:
    """Stage 1 for "touch" and "clear" along one translation: exact, and smallest by construction.

    Directions and supports do not change, so each part pair overlaps in an open interval of the parameter; the parts
    touch at the ends of the intervals' union. A clearance is left to stage 4: the distance of corners is not linear.
    """
    if task.tracked or task.need > 0 or [kind for _, kind in task.motion.parameters] != ["translation"]:
        return None
    along = task.transform(np.ones(1))[:3, 3] - task.transform(np.zeros(1))[:3, 3]
    pose = task.pose(np.zeros(1))
    blocked = []
    for parts in np.ndindex(len(task.movable.parts), len(task.static.parts)):
        _, rows = _facets(task, parts, pose)
        separations, rate = rows[:, 5] - rows[:, 3:5] @ task.target, rows[:, :3] @ along
        level = np.abs(rate) <= DEFAULT.tie
        if (separations[level] < 0).all():
            at = separations[~level] / rate[~level]
            blocked.append((at[rate[~level] > 0].max(initial=-np.inf), at[rate[~level] < 0].min(initial=np.inf)))
    ends = [end for interval in blocked if interval[0] < interval[1] for end in interval]
    _, must_touch = _demands(task)
    low, high = task.limits[0]
    candidates = ends if must_touch else [*ends, min(max(0.0, low), high)]
    clear = [
        end for end in candidates
        if low <= end <= high and np.isfinite(end)
        and not any(a + DEFAULT.line * abs(a) < end < b - DEFAULT.line * abs(b) for a, b in blocked)
    ]
    stage = "1: one translation, intervals of overlap"
    if not clear:
        return Answer(Status.INFEASIBLE, None, stage, float("inf"))
    q = np.array([min(clear, key=abs)])
    amount = task.amount(q)
    return Answer(Status.SOLVED, q, stage, amount, ("the first contact on the way",), {"part_pairs_kept": len(blocked)})


def one_parameter(task: Task) -> Answer | None:
    """Stage 2 for "touch" and "clear" along one parameter: safe steps both ways to the first contact, then its root."""
    if task.tracked or task.need > 0 or len(task.weights) != 1 or not _rest_allowed(task):
        return None
    stage = "2: one parameter, safe steps to the first contact"
    ways = [sign / task.weights for sign in (1.0, -1.0)]
    ends = [rays.reach(task, way) for way in ways]
    first = rays.first_contact(task, ways[0], ends[0])
    second = rays.first_contact(task, ways[1], min(ends[1], first.amount))
    amount, way = min(((first.amount, 0), (second.amount, 1)))
    bound = max(min(first.clear_to, second.clear_to), displacement_bound(task))
    if not np.isfinite(amount):
        whole = task.motion.weights(0.0)[0] == 0 or np.isfinite(task.limits).all()
        proved = whole and first.clear_to >= ends[0] and second.clear_to >= ends[1]
        return Answer(Status.INFEASIBLE if proved else Status.NOT_FOUND, None, stage, bound)
    return Answer(Status.SOLVED, amount * ways[way], stage, min(bound, amount), ("the first contact on the way",),
                  {"part_pairs_kept": task.part_pairs})


def nonlinear(task: Task) -> Answer:
    """Stage 4: the nonlinear program, with constraints of other features added only when a solution violates them.

    Several starts, and every choice of feature that may matter; the least verified outcome wins.
    """
    best: _Found | None = None
    goal_alone = False
    # IPOPT only where SQP finds nothing and no ray of motions can be searched instead
    for method in ("sqpmethod", "ipopt") if task.tracked else ("sqpmethod",):
        for model in sorted(_choices(task, np.zeros(len(task.weights))), key=lambda model: model.promise):
            if best is not None and model.promise >= best.amount:
                break
            best = _better(best, _least(task, model, _starts(task), best, method))
            goal_alone = goal_alone or model.goal_reached
        if best is not None:
            break
    if best is None and not task.tracked and _rest_allowed(task):
        best = _on_a_ray(task)
    for _ in range(PROBES):
        q = _nearer(task, best) if best is not None else None
        if q is None:
            break
        for model in _choices(task, q):
            best = _better(best, _least(task, model, [q], best, "sqpmethod"))
    bound = displacement_bound(task)
    if best is None:
        status = Status.LEFT_COHERENT_RANGE if goal_alone and task.coherent else Status.NOT_FOUND
        return Answer(status, None, "4: nonlinear program, no start succeeded", bound)
    return Answer(Status.SOLVED, best.q, "4: nonlinear program", bound, best.active, best.modelled)


def _rest_allowed(task: Task) -> bool:
    """Tell whether no motion at all lies within the limits."""
    return bool(((task.limits[:, 0] <= 0) & (task.limits[:, 1] >= 0)).all())


def _better(one: _Found | None, two: _Found | None) -> _Found | None:
    return min((found for found in (one, two) if found is not None), key=lambda found: found.amount, default=None)


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
    must not stay apart; `promise` estimates the least amount from what the features need at rest.
    """

    task: Task
    closing: Parts | None = None
    rows: list[Row] = field(default_factory=list)
    planes: dict[Parts, Array] = field(default_factory=dict)
    known: set[tuple[object, ...]] = field(default_factory=set)
    promise: float = 0.0
    goal_reached: bool = False

    def __post_init__(self) -> None:
        if self.task.tracked:
            self.rows += program.goal_rows(self.task)

    def add_plane(self, parts: Parts, q: Array, normal: Array) -> None:
        """Keep a part pair apart along a direction that is free to turn; rows for its vertices follow when needed."""
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

    def hold_vertices(self, parts: Parts, q: Array, normal: Array) -> bool:
        """Add rows for the vertices that reach furthest along a pair's separating direction; tell whether any is new."""
        heights = self._heights(parts, q, normal)
        block = list(self.planes).index(parts)
        foremost = (int(np.argmax(heights[0])), int(np.argmin(heights[1])))
        return any([self._hold(parts, block, body, vertex) for body, vertex in zip((1, 2), foremost, strict=True)])

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

    def add_closing(self, q: Array, slack: float) -> bool:
        """Add the direction in which the closing pair is furthest apart, if by more than `slack`; tell whether it is
        new."""
        assert self.closing is not None
        task, pose = self.task, self.task.pose(q)
        sites, rows = _facets(task, self.closing, pose)
        separations = rows[:, 5] - rows[:, 3:5] @ task.target
        worst = int(np.argmax(separations))
        site = (int(sites[worst, 0]), int(sites[worst, 1]), int(sites[worst, 2]))
        if separations[worst] <= slack or ("closing", site) in self.known:
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


def _meets(task: Task, q: Array, slack: float, normals: dict[Parts, Array]) -> bool:
    """Tell whether a motion meets goal, pair state and coherence to within a relative slack."""
    if task.tracked:
        rho, _, _ = task.tracked_contact(q)
        excess = (rho - task.target) * task.signs if task.goal == "beyond" else -np.abs(rho - task.target)
        if not (excess >= -slack * task.target).all() or _path_faults(task, q):
            return False
    must_clear, must_touch = _demands(task)
    gap = task.gap(q, normals) if must_clear else 0.0
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


def _choices(task: Task, q: Array) -> Iterator[_Model]:
    """Yield the models to try near a motion: which pair closes, and along which direction each overlapping pair comes
    apart."""
    must_clear, must_touch = _demands(task)
    rest = np.zeros(len(q))
    gaps = task.pair_gaps(rest) if must_clear else np.zeros((1, 1))
    near = task.pair_gaps(q) if must_clear and q.any() else gaps
    pairs = sorted(np.ndindex(gaps.shape), key=lambda parts: near[parts])
    closes = must_touch and (bool(task.tracked) or gaps.min() > 0)
    low = {parts: _ways_apart(task, parts, q) for parts in pairs if must_clear and gaps[parts] < task.need}
    firsts = dict.fromkeys(low, 0)
    variants = [firsts, *({**firsts, parts: k} for parts in low for k in range(1, min(CHOICES, len(low[parts]))))]
    if q.any():  # near a motion that is known to do, its own features are the choice
        pairs, variants = pairs[:1], variants[:1]
    for closing in pairs[:CHOICES] if closes else [None]:
        for variant in variants:
            model = _Model(task, closing)
            if closing:
                model.add_closing(q, -task.size)
                model.promise = max(float(gaps[closing]), 0.0) / displacement_rate(task)
            for parts, choice in variant.items():
                amount, normal = low[parts][choice]
                model.add_plane(parts, q, normal)
                model.promise = max(model.promise, amount)
            yield model


def _ways_apart(task: Task, parts: Parts, q: Array) -> list[tuple[float, Array]]:
    """Return (amount, direction) for the ways in which a part pair can come apart near a motion, by the further amount
    they need to first order."""
    _, rows = _facets(task, parts, task.pose(q))
    short = task.need - (rows[:, 5] - rows[:, 3:5] @ task.target)
    part, seed = task.movable.parts[parts[0]], task.movable.seed
    scaled = seed + task.target[0] * (part.vertices - seed)
    foremost = scaled[np.argmax(rows[:, :3] @ task.transform(q)[:3, :3] @ (scaled - seed).T, axis=1)]
    rates = np.zeros((len(rows), len(q)))
    for k, step in enumerate(np.eye(len(q)) * DEFAULT.least_unit * task.size / task.weights):
        velocity = (task.transform(q + step) - task.transform(q - step)) / 2.0
        rates[:, k] = ((foremost @ velocity[:3, :3].T + velocity[:3, 3]) * rows[:, :3]).sum(axis=1) / step[k]
    steepness = np.linalg.norm(rates / task.weights, axis=1)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        amounts = np.nan_to_num(short / steepness, nan=np.inf)
    order = np.argsort(amounts, kind="stable")
    return [(float(amounts[k]), rows[k, :3]) for k in order]


def _directions(task: Task) -> Array:
    """Return fixed directions in the parameters, per unit of amount: the axes both ways and between each two."""
    k = len(task.weights)
    axes = np.vstack([np.eye(k), -np.eye(k)])
    between = [one + share * two for one in axes for two in axes if abs(one @ two) < 1 for share in PROBE_SHARES]
    directions = np.array([*axes, *between])
    return directions / np.linalg.norm(directions, axis=1)[:, None] / task.weights


def _on_a_ray(task: Task) -> _Found | None:
    """Return the least first contact along the fixed directions."""
    best = None
    for direction in _directions(task):
        limit = min(rays.reach(task, direction), best.amount if best else np.inf)
        contact = rays.first_contact(task, direction, limit)
        if contact.amount < limit:
            best = _Found(contact.amount * direction, contact.amount, ("the first contact on the way",), {})
    return best


def _nearer(task: Task, best: _Found) -> Array | None:
    """Return a motion smaller than the best known that meets the goal or nearly so, None if the probes find none.

    Probes stand on spheres of fixed fractions of the best amount, in fixed directions: where one is on the other side
    of the contact than rest, the contact lies on its ray.
    """
    directions, k = _directions(task), len(task.weights)
    rest = task.gap(np.zeros(k)) - task.need if not task.tracked else 0.0
    for fraction in PROBE_FRACTIONS:
        for direction in directions:
            q = fraction * best.amount * direction
            if (q < task.limits[:, 0]).any() or (q > task.limits[:, 1]).any():
                continue
            if not task.tracked:
                if (task.gap(q) - task.need) * rest < 0:
                    return _shortened(task, q, {})
            elif _meets(task, q, DEFAULT.line, {}):
                return q
    return None


def _starts(task: Task) -> list[Array]:
    """Return rest, and steps of three typical amounts either way along each parameter."""
    step = REACH * task.unit / task.weights
    return [np.zeros(len(step)), *(sign * step * row for row in np.eye(len(step)) for sign in (1.0, -1.0))]


def _least(task: Task, model: _Model, starts: list[Array], best: _Found | None, method: str) -> _Found | None:
    """Return the smallest motion of a model, adding what its solutions violate; None if there is none.

    Without tracked features a model that is already worse than the best known is given up: rows only add to it.
    """
    must_clear, _ = _demands(task)
    normals: dict[Parts, Array] = {}
    for _ in range(ROUNDS):
        outcome = _solved(task, model, starts, method)
        if outcome is None:
            return None
        model.goal_reached = True
        q = outcome.q
        if best is not None and task.amount(q) >= best.amount * (1.0 - DEFAULT.cut) and not task.tracked:
            return None
        added = [model.add_fault(*fault) for fault in (_path_faults(task, q) if task.tracked else [])]
        if must_clear:
            normals = dict(zip(model.planes, outcome.normals, strict=True))
            gaps = task.pair_gaps(q, normals)
            for parts in np.ndindex(gaps.shape):
                if gaps[parts] >= task.need - DEFAULT.cut * task.unit:
                    continue
                if parts in model.planes:
                    added.append(model.hold_vertices(parts, q, normals[parts]))
                else:
                    _, rows = _facets(task, parts, task.pose(q))
                    normal = rows[int(np.argmax(rows[:, 5] - rows[:, 3:5] @ task.target)), :3]
                    model.add_plane(parts, q, normal)
                    added.append(True)
        if model.closing is not None:
            added.append(model.add_closing(q, DEFAULT.cut * task.unit))
        if not any(added):
            break
        starts = [*starts[:1], q, *starts[2:]] if len(starts) > 1 else [*starts, q]
    q = _shortened(task, q, normals) if not task.tracked else q
    if not _meets(task, q, DEFAULT.requirement, normals):
        return None
    names = tuple(dict.fromkeys(model.rows[k].name for k in outcome.active))
    modelled = {
        "rows": len(model.rows),
        "part_pairs_kept": len({*model.planes, *(f.parts for f in task.tracked), *([model.closing] if model.closing
                                                                                    else [])}),
        "part_pairs_total": task.part_pairs,
        "directions_total": sum(
            len(_facets(task, parts, task.pose(q))[0])
            for parts in np.ndindex(len(task.movable.parts), len(task.static.parts))
        ),
    }
    return _Found(q, task.amount(q), names, modelled)


def _solved(task: Task, model: _Model, starts: list[Array], method: str) -> program.Outcome | None:
    """Return the least feasible outcome over the starts."""
    planes = np.array(list(model.planes.values())).reshape(-1, 4)
    outcomes = [program.minimise(task, model.rows, start, planes, method) for start in starts]
    return min(
        (outcome for outcome in outcomes if outcome.feasible), key=lambda found: task.amount(found.q), default=None
    )


def _shortened(task: Task, q: Array, normals: dict[Parts, Array]) -> Array:
    """Return the shortest stretch of the ray at whose end the target pair has the gap it needs."""
    from scipy.optimize import brentq

    def miss(s: float) -> float:
        return task.gap(s * q, normals) - task.need

    start, end = miss(0.0), miss(1.0)
    if abs(end) <= DEFAULT.cut * task.unit or start * end >= 0 or not task.limits[:, 0].max() <= 0 <= task.limits[
        :, 1
    ].min():
        return q
    s = brentq(miss, 0.0, 1.0, xtol=DEFAULT.line, rtol=4 * np.finfo(float).eps)
    return q * float(s)
