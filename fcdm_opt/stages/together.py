"""Several contacts at once: the least motion that closes all of them, and what to say where none does.

The gap of each contact is one equation, and flush contacts of motions that turn have those of their alignment besides.
In weighted coordinates z the least motion of the linearised equations is a least distance problem in their null space,
with alternatives where part pairs would overlap. While nothing turns, that is exact; else it is Newton's method. So are
several tasks with the same parameters, one for each two parts of an assembly, met at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from fcdm_opt.curve.kernels import E1E2, F1V2, V1F2
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.bounds import displacement_bound
from fcdm_opt.model.equations import FeaturePoints, feature_points
from fcdm_opt.model.seats import Bools
from fcdm_opt.model.task import Answer, Parts, Task, lines_of
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Status
from fcdm_opt.proof.uniqueness import equations_at, least_about, least_amount, unique, widest_unique
from fcdm_opt.stages.best_first import Choices, Rows, nearest
from fcdm_opt.tolerances import DEFAULT

STEPS, FEW_STEPS, LEAST_STEP = 40, 6, 1e-14  # of Newton's method, and the last, in sizes
CONTRACTED = 1e-9  # step, in sizes, below which an equation that is not met will not be
MOST_NODES, FARTHEST = 2000, 1e6
EVERY, NEAREST_WAYS = 1_000_000, 8  # ways apart of a pair that are tried where it would overlap on a motion that turns
BOXES = (64.0, 16.0, 4.0, 2.0, 1.0)  # half widths in which no motion is sought, in amounts
ENOUGH = 1e-6  # relative gap with which a bound is left
MOST_EXPLAINED = 10  # contacts among which those are sought that exclude each other
LINEAR, NEWTON = "1: several contacts, linear in the motion", "2: several contacts, by Newton's method"


def together(task: Task) -> Answer | None:
    """Answer a task that restores several contacts at once; None for any other.

    Exact where nothing turns: fewer independent contacts than parameters leave a family, of which the least motion is
    taken, as many one motion; more are impossible unless they agree, and it is said which exclude each other.
    """
    if not task.joints:
        return None
    if task.goal == FIT:
        return _fitted(task)
    own = System.of(task)
    z, none = least([own])
    if z is not None:
        return _answered(own, z)
    stage, told = LINEAR if task.motion.shifts else NEWTON, _Told(own).sentences()
    if none:
        return Answer(Status.INFEASIBLE, None, stage, np.inf, told, last=True)
    return Answer(Status.NOT_FOUND, None, stage, displacement_bound(task), told, last=True)


def _answered(own: System, z: Array) -> Answer:
    """Return a motion that restores all contacts as the answer."""
    task, q = own.task, own.q(z)
    exact = task.motion.shifts
    count = len(task.joints)
    active = (f"{count} contacts at once" if count > 1 else "the contact", *own.at_limits(q))
    pairs = {feature.parts for feature in own.features}
    counts = task.modelled(pairs, variables=int(own.moving.sum()), constraints=own.count, features=len(own.features))
    bound = np.inf if exact else displacement_bound(task)
    return task.answer(q, LINEAR if exact else NEWTON, bound, active, counts)


def all_at_once(problems: Sequence[Problem], tasks: Sequence[Task], *, known: float, prove: bool) -> Answer:
    """Answer several tasks that share their parameters and their size: contacts of an assembly that share motions.

    Exact where nothing turns; else with the best bound found: `known` beforehand, that no other motions restore the
    contacts, or multipliers.

    Parameters
    ----------
    problems, tasks : sequences of Problem and Task
        Alike.
    known : float
        A lower bound of the amount.
    prove : bool
        Look for a bound where motions turn.
    """
    systems = [System.of(task) for task in tasks]
    exact = all(task.motion.shifts for task in tasks)
    stage = LINEAR if exact else NEWTON
    z, none = least(systems)
    if z is None:
        status = Status.INFEASIBLE if none else Status.NOT_FOUND
        return Answer(status, None, stage, np.inf if none else known, ("no motions close all contacts together",))
    q = systems[0].q(z)
    amount = float(np.linalg.norm(tasks[0].weights * q))
    bound = amount if exact else known
    joined = [problem for problem in problems if problem.contacts]
    if prove and bound < amount and joined:
        bound = max(bound, min(widest_unique(joined, q), amount))
        if bound < amount:
            bound = max(bound, _by_multipliers(joined, q))
    count = sum(len(task.joints) for task in tasks)
    active = (f"{count} contacts at once", *systems[0].at_limits(q)) if count else systems[0].at_limits(q)
    status = Status.SOLVED if q.any() else Status.ALREADY_SATISFIED
    return Answer(status, q, stage, min(bound, amount), active, amount=amount)


def alone(problem: Problem, task: Task, answer: Answer) -> Answer:
    """Return an answer about several contacts and a motion that turns with what interval arithmetic proves of it.

    How far a motion is the only one, and that none of a smaller amount does; without a motion, that none does at all
    unless it is larger.
    """
    if problem.goal == FIT or (answer.q is None and problem.motion.shifts):
        return answer
    if problem.motion.shifts:  # what holds in one box holds in all
        only = bool(unique((problem,), answer.motion, np.array([problem.size]))[0])
        return replace(answer, unique=np.inf if only else 0.0)
    if answer.q is not None:
        answer = replace(answer, unique=widest_unique((problem,), answer.q))
    if answer.q is not None and not answer.q.any():
        return answer
    bound = min(answer.unique, answer.amount)  # the box holds every motion of a smaller weighted amount
    if bound < answer.amount:
        bound = max(bound, _bounded(problem, task, answer))
    bound = min(bound, answer.amount)
    if answer.q is not None or bound <= answer.lower_bound:
        return replace(answer, lower_bound=max(bound, answer.lower_bound))
    farthest = float(np.linalg.norm(task.weights * np.abs(task.limits).max(axis=1)))
    if farthest <= bound:
        return replace(answer, status=Status.INFEASIBLE, lower_bound=np.inf)
    told = f"below the amount {bound:.4g} no motion closes all and lets nothing overlap"
    return replace(answer, lower_bound=bound, active=(*answer.active, told))


def _bounded(problem: Problem, task: Task, answer: Answer) -> float:
    """Return the amount below which no motion restores the contacts, by multipliers at the motion nearest to that."""
    y = task.weights * (answer.q if answer.q is not None else task.start)
    if answer.q is None:
        for _ in range(FEW_STEPS):  # to the least squares of the equations
            values, slopes = equations_at((problem,), y)
            step = np.linalg.lstsq(slopes, values, rcond=DEFAULT.nominal)[0]
            y = y - step
            if not np.abs(step).max(initial=0.0) > CONTRACTED * task.size:
                break
        if not len(values):
            return 0.0
        if np.abs(task.line_gaps(y / task.weights)[1]).max() <= DEFAULT.touch * task.size:
            return widest_unique((problem,), y / task.weights)  # the one motion that closes all is no answer
        half = max(float(np.linalg.norm(y)), task.unit) * np.array(BOXES)
        return least_amount((problem,), values, half)
    return _by_multipliers((problem,), answer.q)


def _by_multipliers(problems: Sequence[Problem], q: Array) -> float:
    """Return a bound by the multipliers that balance a motion: near it, or as far as they hold all around."""
    bound, y = least_about(problems, q), problems[0].weights * q
    amount = float(np.linalg.norm(y))
    if bound >= (1.0 - ENOUGH) * amount:
        return bound
    values, slopes = equations_at(problems, y)
    if not len(values):
        return 0.0
    way = np.asarray(np.linalg.lstsq(slopes.T, y, rcond=DEFAULT.nominal)[0])
    return max(bound, least_amount(problems, way, np.array([amount])))


@dataclass(frozen=True, eq=False)
class System:
    """The equations of some contacts; z = weights * q / size.

    Attributes
    ----------
    task : Task
    features : tuple of FeaturePoints
        Those of the task's joints, or others to be worked out alike.
    """

    task: Task
    features: tuple[FeaturePoints, ...]

    @classmethod
    def of(cls, task: Task, group: Sequence[int] | None = None) -> System:
        """Return the equations of all of a task's joints, or of some, as if there were no others."""
        if group is None:
            return cls(task, task.besides)
        joints = tuple(task.joints[k] for k in group)
        lines = tuple(line for joint in joints for line in lines_of(task.movable, task.static, joint))
        return cls(replace(task, joints=joints, besides=lines), lines)

    def q(self, z: Array) -> Array:
        """Return the motion parameters."""
        task = self.task
        return np.clip(z * task.size / task.weights, *task.limits.T)

    @cached_property
    def moving(self) -> Bools:
        """Which parameters are free to change, (k,)."""
        return self.task.limits[:, 0] < self.task.limits[:, 1]

    @cached_property
    def turns(self) -> list[tuple[Array, Array]]:
        """Directions that must stay aligned, see `Flush.turns`; of the seats that these contacts are of."""
        if self.task.motion.shifts:
            return []
        own = {feature.parts for feature in self.features}
        return [turn for seat in self.task.seats if seat.parts in own for turn in seat.turns]

    @property
    def count(self) -> int:
        """How many equations there are."""
        return len(self.features) + len(self.turns)

    def linearised(self, q: Array) -> tuple[Array, Array]:
        """Return the gaps in sizes, then how far flush contacts are from aligned, and their derivatives by z."""
        task = self.task
        if not self.count:
            return np.empty(0), np.empty((0, len(task.weights)))
        T, rates = task.motion.kinematics(task.movable.seed, task.static.seed).rates(q)
        gaps, slopes = replace(task, besides=self.features).line_gaps(q)[1], []
        normals = replace(task, besides=self.features).line_gaps(q)[0]
        for feature, n, gap in zip(self.features, normals, gaps, strict=True):
            slopes.append(-(rates @ np.append(_touched(task, feature, T, n, float(gap)), 1.0))[:, :3] @ n)
        values = [*(gaps / task.size), *(m @ T[:3, :3] @ p for m, p in self.turns)]
        slopes += [task.size * (rates[:, :3, :3] @ p) @ m for m, p in self.turns]
        return np.array(values), np.where(self.moving, np.array(slopes) / task.weights, 0.0)

    def limits(self) -> Rows:
        """Return the limits as rows over z."""
        task = self.task
        normals = np.vstack([np.eye(len(task.weights)), -np.eye(len(task.weights))])
        levels = np.concatenate([task.limits[:, 0], -task.limits[:, 1]]) * np.tile(task.weights, 2) / task.size
        return Rows(normals[np.isfinite(levels)], levels[np.isfinite(levels)])

    def _rows(self, parts: Parts, q: Array, most: int) -> Rows:
        """Return gap >= 0 along facet directions of a part pair as rows over z, the widest first."""
        task = self.task
        sites, rows, gaps = task.separations(parts, task.pose(q))
        order = np.argsort(-gaps)[:most]
        if task.motion.shifts:
            rates = task.motion.kinematics(task.movable.seed, task.static.seed).rates(q)[1][:, :3, 3]
            slopes = np.where(self.moving, -(rows[order, :3] @ rates.T) / task.weights, 0.0)
        else:
            R, pairs = task.transform(q)[:3, :3], zip(sites[order].tolist(), rows[order, :3], strict=True)
            features = [feature_points(task.movable, task.static, tuple(site), parts, n, R) for site, n in pairs]
            slopes = System(task, tuple(features)).linearised(q)[1][: len(order)]
        return Rows(slopes, slopes @ (q * task.weights / task.size) - gaps[order] / task.size)

    def meets(self, q: Array, slack: float) -> bool:
        """Tell whether a motion closes these contacts, and does what the task asks besides."""
        return replace(self.task, besides=self.features).meets(q, slack)

    def blocked(self, q: Array) -> set[Parts]:
        """Return the pairs with the static body that are too near; while nothing turns all that may be."""
        task, own = self.task, {feature.parts for feature in self.features}
        if not task.must_clear:
            return set()
        bad = task.pair_gaps(q)[:, : len(task.static.parts)] < task.need - DEFAULT.cut * task.size
        return {(i, j) for i, j in np.ndindex(bad.shape) if (bad[i, j] or task.motion.shifts) and (i, j) not in own}

    def ways_apart(self, parts: Parts, q: Array) -> list[Rows]:
        """Return the ways in which a pair may come apart as far as is needed, the widest first."""
        rows = self._rows(parts, q, EVERY if self.task.motion.shifts else NEAREST_WAYS)
        levels = rows.levels + self.task.need / self.task.size
        return [Rows(rows.normals[k : k + 1], levels[k : k + 1]) for k in range(len(levels))]

    def closings(self, q: Array) -> list[list[Rows]]:
        """Return for each contact the part pairs that may carry it, each with what keeps its elements on each other.

        Where no contact is listed and the pair is to touch, any pair may.
        """
        task = self.task
        hosts = [joint.hosts for joint in task.joints] or [tuple(np.ndindex(task.pair_gaps(q).shape))] * task.must_touch
        most = EVERY if task.motion.shifts else NEAREST_WAYS
        return [
            [Rows(-rows.normals, -rows.levels) for parts in own for rows in (self._rows(parts, q, most),)]
            for own in hosts
        ]

    def at_limits(self, q: Array) -> tuple[str, ...]:
        """Return "a limit" where a parameter is at one."""
        low, high = self.task.limits.T
        return ("a limit",) if bool(((q == low) | (q == high))[self.moving].any()) else ()


def least(systems: Sequence[System]) -> tuple[Array | None, bool]:
    """Return the least z that meets the tasks of all systems, which share their parameters and their size.

    Without one, whether none does: of motions that turn Newton's method may have missed one, and never tells.
    """
    first, exact = systems[0].task, all(own.task.motion.shifts for own in systems)
    z, blocked = first.start * first.weights / first.size, set[tuple[int, Parts]]()
    touching = [own for own in systems if own.task.must_touch and not own.task.joints]
    moving = systems[0].moving
    for _ in range(STEPS):
        q = systems[0].q(z)
        values, slopes = _linearised(systems, q)
        closing = systems if exact and blocked else touching
        groups = [
            *(systems[k].ways_apart(parts, q) for k, parts in sorted(blocked)),
            *(group for own in closing for group in own.closings(first.start if exact else q)),
        ]
        found, complete = _nearest(slopes, slopes @ z - values, systems[0].limits(), groups)
        if found is None:
            return None, exact and complete
        step, z = float(np.abs(found - z).max()), found
        if step > CONTRACTED and not exact:
            continue
        q = systems[0].q(z)
        if np.abs(_linearised(systems, q)[0]).max(initial=0.0) > DEFAULT.line:
            if step <= LEAST_STEP or exact:
                return None, False
            continue
        if all(own.meets(q, DEFAULT.requirement) for own in systems):
            return (z if exact or blocked or touching else _polished(systems, z)), False
        if exact and not touching and np.linalg.matrix_rank(slopes[:, moving], DEFAULT.nominal) == moving.sum():
            return None, not all(own.meets(q, DEFAULT.line) for own in systems)
        more = {(k, parts) for k, own in enumerate(systems) for parts in own.blocked(q)} - blocked
        if not more:
            return None, False
        blocked |= more
    return None, False


def _linearised(systems: Sequence[System], q: Array) -> tuple[Array, Array]:
    """Return values and derivatives of all systems, see `System.linearised`."""
    values, slopes = zip(*(own.linearised(q) for own in systems), strict=True)
    return np.concatenate(values), np.concatenate(slopes)


def _polished(systems: Sequence[System], z: Array) -> Array:
    """Return z after a last step of Newton's method."""
    values, slopes = _linearised(systems, systems[0].q(z))
    return np.asarray(z - np.linalg.lstsq(slopes, values, rcond=DEFAULT.nominal)[0])


def _touched(task: Task, feature: FeaturePoints, T: Array, n: Array, gap: float) -> Array:
    """Return the point of body 1, as made and at rest, at which a contact is or would be."""
    own, other, rho = task.movable.seed, task.static.seed, task.target
    points = feature.points.T
    if feature.kind == V1F2:
        return own + rho[0] * (points[0] - own)
    if feature.kind == F1V2:
        place = other + rho[1] * (points[3] - other) - gap * n
    else:
        assert feature.kind == E1E2
        first = (own + rho[0] * (points[:2] - own)) @ T[:3, :3].T + T[:3, 3]
        second = other + rho[1] * (points[2:] - other)
        ways = np.column_stack([first[1] - first[0], second[0] - second[1]])
        place = first[0] + np.linalg.lstsq(ways, second[0] - first[0], rcond=None)[0][0] * ways[:, 0]
    return np.asarray((place - T[:3, 3]) @ T[:3, :3])


def _nearest(slopes: Array, levels: Array, limits: Rows, groups: Sequence[list[Rows]]) -> tuple[Array | None, bool]:
    """Return the least z with slopes . z = levels, within limits, that meets an alternative of each group.

    None where there is none: the equations disagree, or nothing of what they leave meets the rest; and whether that is
    so, or the search was left.
    """
    centre = np.asarray(np.linalg.lstsq(slopes, levels, rcond=DEFAULT.nominal)[0], dtype=np.float64)
    if np.abs(slopes @ centre - levels).max(initial=0.0) > DEFAULT.touch:
        return None, True
    _, sizes, ways = np.linalg.svd(slopes)
    free = ways[int((sizes > DEFAULT.nominal * sizes.max(initial=0.0)).sum()) :]  # rows span the null space
    kept = []
    for group in groups:
        possible = [rows for rows in (_seen(rows, centre, free) for rows in group) if rows is not None]
        if not possible:
            return None, True
        if all(len(rows.levels) for rows in possible):
            kept.append(possible)
    start = _seen(limits, centre, free)
    if start is None:
        return None, True
    if not len(free) or (not kept and not (start.levels > 0.0).any()):
        return centre, True
    start = start.and_also(-np.eye(1, len(free)), np.array([-FARTHEST]))
    choices = Choices.of(kept, len(free))
    least = nearest(choices, [start], np.zeros(len(free)), slack=DEFAULT.cut, nodes=MOST_NODES, most=FARTHEST)
    return (None, least.complete) if least.y is None else (centre + least.y @ free, True)


def _seen(rows: Rows, centre: Array, free: Array) -> Rows | None:
    """Return rows over z as rows over the null space, without those that always hold; None where one never does."""
    normals, levels = rows.normals @ free.T, rows.levels - rows.normals @ centre
    flat = np.linalg.norm(normals, axis=1) <= DEFAULT.nominal
    if (levels[flat] > DEFAULT.touch).any():
        return None
    return Rows(normals[~flat], levels[~flat])


# ------------------------------------------------------------------------------------------ where not all can be closed


@dataclass(frozen=True, eq=False)
class _Told:
    """What keeps contacts from being restored together, and which of them can be."""

    own: System

    def sentences(self) -> tuple[str, ...]:
        """Return which contacts exclude each other, by number, and which carry without the others."""
        count = len(self.own.task.joints)
        if count > MOST_EXPLAINED:
            return (f"{count} contacts: too many to tell which exclude each other",)
        told = [
            f"contacts {_listed(group)} exclude each other"
            if len(group) > 1
            else f"contact {group[0] + 1} cannot be closed"
            for group in self.conflicts
        ]
        if not told:
            which = "all contacts" if count > 1 else "the contact"
            return (f"where {which} would be closed parts overlap, or a contact is beyond the edges of its faces",)
        return (*told, *self._carried())

    @cached_property
    def conflicts(self) -> list[tuple[int, ...]]:
        """The least sets of contacts that no motion closes together, whatever else it does."""
        found: list[tuple[int, ...]] = []
        count, most = len(self.own.task.joints), int(self.own.moving.sum()) + 1
        for size in range(1, min(count, most) + 1):
            for group in combinations(range(count), size):
                if not any(set(known) <= set(group) for known in found) and not self._agree(group):
                    found.append(group)
        return found

    def _agree(self, group: tuple[int, ...]) -> bool:
        """Tell whether the equations of some contacts alone have a solution."""
        own, task = System.of(self.own.task, group), self.own.task
        z = np.zeros(len(task.weights))
        for _ in range(STEPS):
            values, slopes = own.linearised(z * task.size / task.weights)
            step = np.linalg.lstsq(slopes, values, rcond=DEFAULT.nominal)[0]
            z = z - step
            if np.abs(step).max() <= LEAST_STEP * 10 or task.motion.shifts:
                break
        return bool(np.abs(own.linearised(z * task.size / task.weights)[0]).max() <= DEFAULT.touch)

    def _carried(self) -> Iterator[str]:
        """Yield which contacts can be closed together while the others are open, and by how much."""
        task = self.own.task
        count, told = len(task.joints), 0
        for size in range(count - 1, 0, -1):
            for group in combinations(range(count), size):
                if any(set(known) <= set(group) for known in self.conflicts):
                    continue
                some = System.of(task, group)
                z, _ = least([some])
                if z is None:
                    continue
                left = {
                    k: System.of(task, (k,)).task.line_gaps(some.q(z))[1].max() for k in range(count) if k not in group
                }
                if min(left.values()) < -DEFAULT.touch * task.size:
                    continue  # past it, not above it
                told += 1
                others = ", ".join(f"{k + 1} open by {x:.4g}" for k, x in left.items())
                yield f"{_listed(group)} can carry, with {others}"
            if told:
                return


def _listed(group: Sequence[int]) -> str:
    return ", ".join(str(k + 1) for k in group)


# ----------------------------------------------------------------------------------------------------------- goal "fit"


def _fitted(task: Task) -> Answer:
    """Return the least motion of those that leave no contact overlapping and make the largest gap least.

    A linear program where nothing turns, exact; else one after the other.
    """
    from scipy.optimize import linprog

    own = System.of(task)
    exact, count = task.motion.shifts, len(own.features)
    z, stage = np.clip(task.rest, *task.limits.T) * task.weights / task.size, LINEAR if exact else NEWTON
    failed = Answer(Status.NOT_FOUND, None, stage, 0.0, last=True)
    low, high = (side * task.weights / task.size for side in task.limits.T)
    for _ in range(1 if exact else STEPS):
        values, slopes = own.linearised(own.q(z))
        gaps, rates = values[:count] - slopes[:count] @ z, slopes[:count]
        aligned = {"A_eq": np.column_stack([slopes[count:], np.zeros(own.count - count)])} if own.turns else {}
        if own.turns:
            aligned["b_eq"] = slopes[count:] @ z - values[count:]
        ones = np.ones((count, 1))
        program = linprog(
            np.append(np.zeros(len(z)), 1.0),
            A_ub=np.vstack([np.column_stack([-rates, 0.0 * ones]), np.column_stack([rates, -ones])]),
            b_ub=np.concatenate([gaps, -gaps]),
            bounds=[*zip(low, high, strict=True), (0.0, None)],
            method="highs",
            **aligned,
        )
        if program.status != 0:
            return replace(failed, status=Status.INFEASIBLE, lower_bound=np.inf) if exact else failed
        largest = max(float(program.fun), 0.0) + DEFAULT.tie
        rows = own.limits().and_also(np.vstack([rates, -rates]), np.concatenate([-gaps, gaps - largest]))
        flat = np.linalg.norm(rows.normals, axis=1) > DEFAULT.tie
        rows = Rows(rows.normals[flat], rows.levels[flat])
        found, _ = _nearest(slopes[count:], slopes[count:] @ z - values[count:], rows, ())
        found = program.x[:-1] if found is None else found
        step, z = float(np.abs(found - z).max()), found
        if step <= CONTRACTED:
            break
    q = own.q(z)
    if not task.meets(q, DEFAULT.requirement):
        return replace(failed, active=("parts overlap besides these contacts",))
    opened = np.maximum(task.line_gaps(q)[1], 0.0)
    most = float(opened.max())
    at = np.flatnonzero(opened >= most - DEFAULT.line * task.size)
    closed = most <= DEFAULT.touch * task.size  # rounding
    active = ("no contact is left open" if closed else f"largest gap {most:.6g}, of contact {_listed(at.tolist())}",)
    counts = task.modelled({own.parts for own in own.features}, variables=len(z), constraints=2 * count, features=count)
    return task.answer(q, stage, np.inf if exact else 0.0, active, counts)
