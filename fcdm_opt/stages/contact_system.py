"""Several contacts at once: the least motion that closes all of them, and what to say where none does.

The gap of each contact is one equation, and flush contacts of motions that turn have those of their alignment besides.
In weighted coordinates z the least motion of the linearised equations is a least distance problem in their null space,
with alternatives where part pairs would overlap. While nothing turns, that is exact; else it is Newton's method. So are
several tasks with the same parameters, one for each two parts of an assembly, met at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from itertools import combinations, product
from operator import rshift
from typing import Any

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.contact import NARROWEST, facing, supporting_contact
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.flush import Flush
from fcdm_opt.geometry.arrays import Array, Flags, distinct_rows
from fcdm_opt.geometry.facet_errors import is_plane_there
from fcdm_opt.geometry.measures import norms
from fcdm_opt.geometry.units import gap_text, measured
from fcdm_opt.model.equations import FeaturePoints
from fcdm_opt.model.seats import held
from fcdm_opt.model.task import Answer, Parts, Task, lines_of
from fcdm_opt.motion.motions import Rotation, Translation
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.evidence import Multipliers
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import Status
from fcdm_opt.proof.checker import least_outside
from fcdm_opt.proof.exclusion import Exclusion
from fcdm_opt.proof.uniqueness import equations_at, excluded, least_amount, widest_unique
from fcdm_opt.stages.best_first import FARTHEST, Choices, Rows, nearest_on
from fcdm_opt.stages.forbidden_shifts import POLISHED, SHARPENED, ForbiddenShifts
from fcdm_opt.stages.relaxation import choices as choices_of_features
from fcdm_opt.stages.separating_directions import Linearised
from fcdm_opt.tolerances import DEFAULT

STEPS, FEW_STEPS, LEAST_STEP = 40, 6, 1e-14  # of Newton's method, and the last, in sizes
RESTORED = 8  # last steps, of a motion that turns, to one that does, however large
CONTRACTED = 1e-9  # step, in sizes, below which an equation that is not met will not be
EVERY, NEAREST_DIRECTIONS = 1_000_000, 8  # of a pair that would overlap on a motion that turns: so many are tried
MINOR = 1e-3  # share of a motion beside the largest gap, where that is to be least
AROUND = 4.0  # times the amount so far: how far off what may come too near is looked for
WIDEST_STEP, SHORT_STEP = 0.25, 1e-3  # in sizes: in which a turn is linearised at first, and up to which all are taken
TO_AND_FRO = 0.5  # of a step, from which on the next is turned back
SETTLED = 1e-6  # step to and fro about a least gap, in sizes: the gap is known to the square of it
OVERLAID = 2.0  # times the width that flush faces must share, where the least motion leaves no more than a border
OVERLAP_COUNTS = 10.0  # times what a gap does, in comparing motions on the way
SHARES = (0.3, 0.6, 0.8, 0.9, 0.95, 0.99, 1 - 1e-4, 1 - 1e-6, 1 - 1e-9)  # of an amount, to be proved
BOXES = (1.0, 2.0, 4.0, 16.0, 64.0)  # below which no motion is sought, in amounts
MARGIN = 0.99  # of a proved amount: how much of it another proof is to show
MOST_BOXED, WIDER = 4, 1e-9  # parameters of which boxes are tried; how much wider than all motions may be
MOST_PAIRS = 2000  # of convex parts; with more, why there is no motion takes longer than it is worth
LEAST_SHORT = 1e-5  # relative, to which it is narrowed in how much parts overlap at least
MOST_VIOLATED = 3  # conditions that are told to be violated
MOST_EXPLAINED = 10  # contacts among which those are sought that exclude each other
LINEAR, NEWTON = "1: linear equations of the contacts", "2: equations of the contacts, by Newton's method"
TRANSLATIONS = "1: translations, best first over separating directions"
UNSEATED = "1: no place fits all flush contacts at the target pair"
DIGITS = 12  # to which rows of vertices that touch at once are told apart
BATCH_SIZE = 16  # part pairs of many that are taken up together, the nearest first


def contact_system(task: Task) -> Answer | None:
    """Answer a task that restores several contacts at once; None for any other.

    Exact where nothing turns: fewer independent contacts than parameters leave a family, of which the least motion is
    taken, as many one motion; more are impossible unless they agree, and it is said which exclude each other.
    """
    if not task.joints:
        return None
    if task.goal != FIT and task.seats_disagree:
        return Answer(Status.INFEASIBLE, None, UNSEATED, np.inf, _Texts([System.of(task)], [""]).sentences(), last=True)
    if (found := _by_shifts(task)) is not None:
        return found
    if task.goal == FIT:
        return _fitted(task)
    own = System.of(task)
    z, bound = least([own])
    if z is not None:
        return _answered(own, z, bound)
    turning = np.asarray(task.spins.any(axis=1))
    at_rest = (task.start[turning] == 0.0).all()
    if turning.any() and at_rest and task.weighted and np.isfinite(bound):  # a larger one rather than none
        found = _held(task, turning)
        if found is not None and found.q is not None:
            return replace(found, amount=task.amount(found.q), lower_bound=task.displacement_bound, stage=NEWTON)
    stage, sentences = LINEAR if task.motion.shifts else NEWTON, _Texts([own], [""]).sentences()
    status, bound = (Status.INFEASIBLE, np.inf) if np.isinf(bound) else (Status.NOT_FOUND, task.displacement_bound)
    return Answer(status, None, stage, bound, sentences, last=True)


def _of_shifts(task: Task) -> tuple[Task | None, Flags]:
    """Return the task with the shifts alone of its parameters that may change, and which do; None where some turn."""
    moving = (task.limits != 0).any(axis=1)
    directions = [own for own, some in zip(task.motion.shift_directions, moving, strict=True) if some]
    if not directions or any(own is None for own in directions):
        return None, moving
    motion = reduce(rshift, (Translation(tuple(own.tolist())) for own in directions if own is not None))
    weights, limits = task.weights[moving], task.limits[moving]
    return replace(task, motion=motion, weights=weights, limits=limits, resolution=None), moving


def _by_shifts(task: Task) -> Answer | None:
    """Answer a task whose one turn would tilt a face that stays flush: exact, as of shifts; None for any other."""
    turning, whole = task.spins.any(axis=1) & (task.limits != 0).any(axis=1), [own for own in task.seats if own.whole]
    applies = turning.sum() == 1 and isinstance(task.motion.owners[turning.argmax()], Rotation) and task.weighted
    if not (applies and whole and (task.start[turning] == 0.0).all()):
        return None
    answer = _held(task, turning & held(whole, task.motion, task.movable, task.static))
    if answer is not None and answer.q is None:  # its parameters have other names
        return replace(answer, active=_Texts([System.of(task)], [""]).sentences())
    return answer


def _held(task: Task, still: Flags) -> Answer | None:
    """Return the answer where some parameters stay at zero and the others shift; None where any turns or may not."""
    task = replace(task, limits=np.where(still[:, None], 0.0, task.limits))
    shifted, moving = _of_shifts(task)
    answer = None if shifted is None else contact_system(shifted)
    if answer is None or answer.q is None:
        return answer
    q = task.rest
    q[moving] = answer.q
    return replace(answer, q=q)


def violated(question: Scene) -> tuple[str, ...]:
    """Return what stands in the way of a motion that closes several contacts of two parts; () for what else is asked.

    Empty too where the contacts exclude each other.
    """
    asked = _restored(question)
    return () if asked is None or asked.conflicts else asked.violated


def excluding_contacts(question: Scene) -> list[tuple[int, ...]]:
    """Return the least sets of contacts of two parts, by place, that no motion closes together, whatever else it does.

    None of more contacts than these are sought among.
    """
    asked = _restored(question)
    return [] if asked is None or len(asked.systems[0].task.joints) > MOST_EXPLAINED else asked.conflicts


def _restored(question: Scene) -> _Texts | None:
    """Return what is known of contacts of two parts that are restored together; None where others are asked for."""
    if not (isinstance(question, Problem) and question.contacts and question.goal != FIT):
        return None
    return _Texts([System.of(Task.of(question))], [""])


def translations(task: Task) -> Answer | None:
    """Return the least of several translations that undoes all overlaps, keeps clearances, and touches if asked; exact.

    The shifts that bring two parts nearer than a clearance are a convex set, see `ForbiddenShifts`.
    """
    best = among_others(task) if task.goal in ("touch", "clear") and len(task.weights) > 1 else None
    if best is None or best.q is None or (task.pair_gaps(best.q) >= task.needs - DEFAULT.cut * task.size).all():
        return best
    for relaxation in choices_of_features(task, best.q, near=True):  # off corners the amount is exact, where it is less
        polished = relaxation.smallest([best.q])
        if polished is not None and polished.amount <= best.lower_bound * (1.0 + DEFAULT.nominal):
            amount = polished.amount
            best = replace(best, q=polished.q, amount=amount, lower_bound=min(best.lower_bound, amount))
    return best


def among_others(task: Task) -> Answer | None:
    """Return the least shift that brings tracked lines to the target pair, if any, and keeps other parts apart; exact.

    None where that is not sure, and where parameters that may change turn.
    """
    shifted, moving = _of_shifts(task)
    if task.goal == "beyond" or shifted is None:
        return None
    if task.goal == "touch" and not task.keep_out and task.gap(task.rest) <= 0.0 and task.allows(task.rest):
        shifted = replace(shifted, goal="clear", pair="any", clearance=0.0)  # it touches as soon as nothing overlaps
    own = System(shifted, (*task.tracked, *task.untracked))
    z, bound = least([own])
    if z is None:
        return Answer(Status.INFEASIBLE, None, own.stage, np.inf) if np.isinf(bound) else None
    q = task.rest
    q[moving] = own.q(z)
    answer = _answered(own, z, bound)
    exact = bound >= np.linalg.norm(z) * (1.0 - DEFAULT.nominal) or not own.features
    return replace(answer, q=q) if exact and task.meets(q, DEFAULT.requirement) else None


def _answered(own: System, z: Array, bound: float) -> Answer:
    """Return a motion that restores all contacts as the answer; see `least`."""
    task, q, slack = own.task, own.q(z), DEFAULT.active * own.task.size
    counted = np.array([not own.features or obstacle.keep_out >= 0 for obstacle in task.obstacles])
    near = np.argwhere((task.pair_gaps(q) - task.needs <= slack) & (task.needs > 0.0) & counted).tolist()
    gaps = task.pair_gaps(q, {(i, j): task.direction_between((i, j), q) for i, j in near})
    stopped = [(i, j) for i, j in np.argwhere((np.abs(gaps - task.needs) <= slack) & counted).tolist()]
    stopped = stopped if own.features else own.deciding(stopped, z)
    names, count = dict.fromkeys(map(task.named, stopped)), len(task.joints)
    first = f"{count} contacts at once" if count > 1 else "the contact"
    active = (first, *(f"{name} stays apart" for name in names)) if own.features else tuple(names)
    pairs = {feature.parts for feature in own.features} | {*stopped}
    counts = task.modelled(pairs, variables=int(own.moving.sum()), constraints=own.count, features=len(own.features))
    counts = counts if own.features else task.modelled_by_gaps(q, stopped)
    bound = np.inf if bound >= np.linalg.norm(z) else max(bound * task.size, task.displacement_bound)
    return task.answer(q, own.stage, bound, (*active, *own.at_limits(q)), counts)


def all_at_once(
    problems: Sequence[Problem], tasks: Sequence[Task], names: Sequence[str], *, known: float, prove: bool
) -> Answer:
    """Answer several tasks that share their parameters and their size: contacts of an assembly that share motions.

    Exact where nothing turns; else with the best bound found: `known` beforehand, that no other motions restore the
    contacts, or multipliers, which are looked for to `prove` it. Problems, tasks and `names`, in what is told, are
    alike.
    """
    systems, asked = [System.of(replace(task, amount_kind="weighted")) for task in tasks], tasks[0]
    stage = LINEAR if all(task.motion.shifts for task in tasks) else NEWTON
    z, least_z = least(systems)
    bound = max(known, least_z * systems[0].task.size)
    if z is None:
        status = Status.INFEASIBLE if np.isinf(bound) else Status.NOT_FOUND
        return Answer(status, None, stage, bound, _Texts(systems, names).sentences())
    q = systems[0].q(z)
    amount = systems[0].task.amount(q)
    joined = [problem for problem in problems if problem.contacts]
    bound = amount if least_z >= np.linalg.norm(z) else min(bound, amount)
    if prove and bound < amount and joined:
        bound = max(bound, least_restoring(joined, q, amount))
    if not asked.weighted:
        other, _ = least([System.of(task) for task in tasks])
        q = min((systems[0].q(x) for x in (z, other) if x is not None), key=asked.amount)
        amount, beyond = asked.amount(q), MARGIN * bound / np.sqrt(len(asked.weights))  # so far a parameter has to move
        bound = _bound_of_own(asked, amount, max(widest_unique(joined, q) if prove and joined else 0.0, beyond))
    count = sum(len(task.joints) for task in tasks)
    active = (f"{count} contacts at once", *systems[0].at_limits(q)) if count else systems[0].at_limits(q)
    status = Status.SOLVED if q.any() else Status.ALREADY_SATISFIED
    return Answer(status, q, stage, min(bound, amount), active, amount=amount)


def least_restoring(problems: Sequence[Problem], q: Array, amount: float) -> float:
    """Return what motions that restore the contacts come to at least, as far as is shown, of one that does."""
    bound = min(widest_unique(problems, q), amount)
    return bound if bound >= amount else max(bound, least_amount(problems, amount * np.array(SHARES)))


def check_uniqueness(problem: Problem, task: Task, answer: Answer) -> Answer:
    """Return an answer about several contacts and a motion that turns with what interval arithmetic proves of it.

    How far a motion is the only one, and that none of a smaller amount does; without a motion, that none does at all
    unless it is larger.
    """
    none, fit = answer.q is None, problem.goal == FIT
    if not task.weighted:  # what boxes of motions hold says nothing of other amounts, but of all there are
        plain = replace(task, amount_kind="weighted")
        found = replace(answer, amount=np.inf if none else plain.amount(answer.motion), lower_bound=0.0)
        found = answer if np.isinf(answer.lower_bound) else check_uniqueness(problem, plain, found)
        if found.status is Status.INFEASIBLE:
            return found
        bound = max(answer.lower_bound, 0.0 if none else _bound_of_own(task, answer.amount, found.unique))
        return replace(answer, unique=found.unique, lower_bound=bound)
    if (none and fit) or ((none or fit) and problem.motion.shifts):
        return answer
    if fit and not task.restores(answer.motion, DEFAULT.requirement * task.size):
        return answer  # only where all can be closed does the least gap ask for the same
    if answer.q is not None:
        answer = replace(answer, unique=widest_unique((problem,), answer.q))
    if problem.motion.shifts or (answer.q is not None and not answer.q.any()):
        return answer
    bound = min(answer.unique, answer.amount)  # the box holds every motion of a smaller weighted amount
    if bound < answer.amount:
        bound = max(bound, _bounded(problem, task, answer))
    bound = min(bound, answer.amount)
    if answer.q is not None or bound <= answer.lower_bound:
        return replace(answer, lower_bound=max(bound, answer.lower_bound))
    if _farthest(task) <= bound:
        return replace(answer, status=Status.INFEASIBLE, lower_bound=np.inf)
    with suppress(pacing.TimeOverError):
        if len(task.weights) <= MOST_BOXED and _excluded(problem, task):
            return replace(answer, status=Status.INFEASIBLE, lower_bound=np.inf)
    text = f"below the amount {measured(bound, task.length_unit, 4)} no motion closes all and lets nothing overlap"
    return replace(answer, lower_bound=bound, active=(*answer.active, text))


def _bound_of_own(task: Task, amount: float, half: float) -> float:
    """Return a bound of another amount than the weighted one, of a motion that is the only one in a box."""
    own = task.amount_kind
    if half >= _farthest(task) or not isinstance(own, OwnAmount):
        return amount if half >= _farthest(task) else 0.0
    return min(amount, max(least_outside(own, task.weights, half), 0.0))


def _farthest(task: Task) -> float:
    """Return the largest weighted amount that the limits allow."""
    return float(np.linalg.norm(task.weights * np.abs(task.limits).max(axis=1)))


def proof_of(problem: Problem, task: Task, answer: Answer) -> Multipliers | None:
    """Return what shows the bound of an answer about several contacts: a box about its motion, or boxes without any."""
    if not (task.weighted and answer.lower_bound > 0.0):
        return None
    ends = np.clip(task.limits.T * task.weights, -answer.lower_bound, answer.lower_bound)
    if answer.q is not None:
        return Multipliers(boxes=ends[None], motions=(task.weights * answer.q)[None])
    if problem.goal == FIT or len(task.weights) > MOST_BOXED:
        return None
    found = excluded(problem, *ends) if np.isfinite(answer.lower_bound) else _excluded(problem, task)
    return None if found is None else Multipliers(boxes=found[0], motions=found[1])


def _excluded(problem: Problem, task: Task) -> tuple[Array, Array] | None:
    """Return boxes in all that motions may be in, and motions at which equations disagree all over them, if they do."""
    low, high = Exclusion(task).domain.T * task.weights
    return excluded(problem, low - WIDER * np.abs(low), high + WIDER * np.abs(high))


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
        return least_amount((problem,), max(float(np.linalg.norm(y)), task.unit) * np.array(BOXES))
    return least_amount((problem,), answer.amount * np.array(SHARES))


@dataclass(frozen=True, eq=False)
class System:
    """The equations of some contacts; z = weights * q / size."""

    # the features are those of the task's joints, or of its tracked contact, or others to be worked out alike
    task: Task
    features: tuple[FeaturePoints, ...]

    @classmethod
    def of(cls, task: Task, group: Sequence[int] | None = None) -> System:
        """Return the equations of all of a task's joints, or of some, as if there were no others."""
        if group is None:
            return cls(task, task.untracked)
        joints = tuple(task.joints[k] for k in group)
        lines = tuple(line for joint in joints for line in lines_of(task.movable, task.static, joint))
        return cls(replace(task, joints=joints, untracked=lines), lines)

    def only(self, group: Sequence[int]) -> System:
        """Return the same with some of the contacts; without any the parts are only to be clear of each other."""
        return System.of(self.task if group else replace(self.task, goal="clear", pair="clear"), group)

    def q(self, z: Array) -> Array:
        """Return the motion parameters."""
        task = self.task
        return np.clip(z * task.size / task.weights, *task.limits.T)

    @cached_property
    def moving(self) -> Flags:
        """Which parameters are free to change, (k,)."""
        return self.task.limits[:, 0] < self.task.limits[:, 1]

    @cached_property
    def turns(self) -> list[tuple[Array, Array]]:
        """Directions that must stay aligned, see `Flush.turns`; of the seats that these contacts are of."""
        if self.task.motion.shifts:
            return []
        own = {feature.parts for feature in self.features}
        return [turn for flush in self.task.seats if flush.parts in own for turn in flush.turns]

    @property
    def stage(self) -> str:
        """The stage that these equations are."""
        return (LINEAR if self.features else TRANSLATIONS) if self.task.motion.shifts else NEWTON

    @cached_property
    def touching(self) -> list[tuple[float, Parts]]:
        """The pairs one of which is to touch where no contact is named, and no z is less that makes them; in order."""
        task = self.task
        if self.features or not task.must_touch:
            return []
        gaps = task.pair_gaps(task.rest)[:, : len(task.static.parts)]
        shifts = task.rates(task.rest)[1][:, :3, 3] / task.weights[:, None]
        fastest = float(np.linalg.norm(shifts, 2)) if task.motion.shifts else np.inf
        order = np.argsort(gaps, axis=None, kind="stable").tolist()
        return [(float(gaps.flat[k]) / fastest / task.size, divmod(k, gaps.shape[1])) for k in order]

    @property
    def count(self) -> int:
        """How many equations there are."""
        return len(self.features) + len(self.turns)

    def linearised(self, q: Array) -> tuple[Array, Array]:
        """Return the gaps in sizes, then how far flush contacts are from aligned, and their derivatives by z."""
        task = self.task
        if not self.count:
            return np.empty(0), np.empty((0, len(task.weights)))
        lines, (T, rates) = replace(task, tracked=(), untracked=self.features), task.rates(q)
        normals, gaps = lines.line_gaps(q)
        values = [*(gaps / task.size), *(m @ T[:3, :3] @ p for m, p in self.turns)]
        slopes = [*lines.line_rates(q, normals), *(task.size * (rates[:, :3, :3] @ p) @ m for m, p in self.turns)]
        return np.array(values), self._by_z(np.array(slopes))

    def _by_z(self, rates: Array) -> Array:
        """Return derivatives of lengths over the size by z, from those of the lengths by q."""
        return np.where(self.moving, rates / self.task.weights, 0.0)

    def misfit(self, z: Array) -> float:
        """Return the largest gap of a motion, in sizes, where all fit; what overlaps or is not aligned counts more."""
        values, count = self.linearised(self.q(z))[0], len(self.features)
        gaps, aligned = values[:count], np.abs(values[count:]).max(initial=0.0)
        return float(max(gaps.max(), 0.0) + OVERLAP_COUNTS * (max(-gaps.min(), 0.0) + aligned))

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
        slopes = self._by_z(task.gap_rates(parts, q, sites[order], rows[order, :3]))
        return Rows(slopes, slopes @ (q * task.weights / task.size) - gaps[order] / task.size)

    def meets(self, q: Array, slack: float) -> bool:
        """Tell whether a motion closes these contacts, and does what the task asks besides."""
        return replace(self.task, untracked=self.features).meets(q, slack)

    def blocked(self, q: Array, most: int = 0) -> set[Parts]:
        """Return the pairs that are too near; while nothing turns all that may be, without those of these contacts.

        Of many pairs without contacts `most`, or a few, that overlap most.
        """
        task, own = self.task, {feature.parts for feature in self.features}
        gaps = task.pair_gaps(q)
        bad = gaps < task.needs - DEFAULT.cut * task.size
        if task.motion.shifts and (own or task.part_pairs <= BATCH_SIZE):
            asked = np.isfinite(task.needs)
            return {(i, j) for i, j in np.ndindex(bad.shape) if asked[j] and (i, j) not in own}
        count = min(int(bad.sum()), max(most, BATCH_SIZE) if task.motion.shifts else bad.size)
        worst = np.argsort(np.where(bad, gaps, np.inf), axis=None, kind="stable")[:count]
        return {divmod(k, bad.shape[1]) for k in worst.tolist()}

    def separating_directions(self, pairs: Sequence[Parts], q: Array, clearances: ForbiddenShifts) -> Choices:
        """Return the ways in which each of some pairs may come apart as far as is needed, the widest first."""
        # while nothing turns, as far as `clearances` tell so far: not at all before a pair joins them
        task, y = self.task, self.task.weights * q
        if not pairs or not task.motion.shifts:
            around = AROUND * max(float(np.linalg.norm(y)), task.unit)
            scene = Linearised.of(task, y, around) if pairs else None
            return Choices.of([self._turned_apart(scene, parts, y) for parts in pairs], len(y))
        pose, walls = task.pose(q), clearances.walls
        rounded = Choices.of_single_rows([wall for parts in pairs if (wall := walls.get(parts))], len(y))
        pairs = [parts for parts in pairs if not walls.get(parts)]
        if not pairs:
            return rounded
        rows, gaps = zip(*(task.separations(parts, pose)[1:] for parts in pairs), strict=True)
        sizes = list(map(len, gaps))
        needs = [task.needs[j] if (i, j) in walls else min(task.needs[j], 0.0) for i, j in pairs]
        short = np.concatenate(gaps) - np.repeat(needs, sizes)
        order = np.lexsort((-short, np.repeat(np.arange(len(pairs)), sizes)))
        slopes = self._by_z(-np.concatenate(rows)[order, :3] @ task.rates(q)[1][:, :3, 3].T)
        apart = Rows(slopes, (slopes @ y - short[order]) / task.size)
        return Choices(apart, np.arange(len(order)), np.cumsum([0, *sizes])[:-1]).and_also(rounded)

    def _turned_apart(self, scene: Linearised | None, parts: Parts, y: Array) -> list[Rows]:
        """Return the ways in which a pair may come apart by motions that turn; one that never holds where none is."""
        need, size = float(self.task.needs[parts[1]]), self.task.size
        directions = sorted(scene.separating(parts) or () if scene else (), key=lambda own: -float(own[1].min()))
        rates = [(np.where(self.moving, J, 0.0), gaps) for J, gaps in directions[:NEAREST_DIRECTIONS]]
        never = Rows(np.zeros((1, len(y))), np.array([np.inf]))
        return [Rows(J, (need - gaps + J @ y) / size) for J, gaps in rates] or [never]

    def sooner(self, length: float) -> int:
        """Return how many of the pairs one of which is to touch are looked at: all that a z of that length may make."""
        return max(BATCH_SIZE, sum(own < length for own, _ in self.touching))

    def deciding(self, pairs: Sequence[Parts], z: Array) -> list[Parts]:
        """Return which of some pairs that are as near as they may be make z the least, or all: multipliers tell."""
        from scipy.optimize import nnls

        each = [self._rows(parts, self.q(z), EVERY) for parts in pairs]
        gaps = [rows.normals @ z - rows.levels for rows in each]
        tight = [rows.normals[own >= own[0] - DEFAULT.active] for rows, own in zip(each, gaps, strict=True)]
        owners = np.repeat(np.arange(len(pairs)), [*map(len, tight)])
        every = np.concatenate([np.empty((0, len(z))), *tight])
        used = nnls(np.vstack([every, -every]).T, z)[0].reshape(2, -1).sum(axis=0) > 0.0 if len(every) else owners > 0
        return [parts for k, parts in enumerate(pairs) if used[owners == k].any()] or [*pairs]

    def closings(self, q: Array, length: float, *, shared: float) -> Choices:
        """Return for each contact the part pairs that may carry it, each with what keeps its elements on each other.

        Flush ones by `shared` times the width that they must share. Where no contact is listed and the pair is to
        touch, any may that is touched `sooner` than by z of a length.
        """
        task = self.task
        carriers: list[tuple[Feature | None, Any]] = [(joint.feature, joint.carriers) for joint in task.joints]
        if self.touching:
            carriers = [(None, [parts for _, parts in self.touching[: self.sooner(length)]])]
        if not task.motion.shifts:
            return Choices.of([self._turned_onto(own, q) for _, own in carriers], len(task.weights))
        groups = [
            [
                Rows(-rows.normals, self._over(feature, parts, q, shared) - rows.levels)
                for parts in own for rows in (self._rows(parts, q, EVERY),)
            ] for feature, own in carriers
        ] + [[self._facing(own, q, shared)] for own in task.seats if own.whole]  # fmt: skip
        return Choices.of(groups, len(task.weights))

    def _turned_onto(self, carriers: Sequence[Parts], q: Array) -> list[Rows]:
        """Return how one of some pairs may touch by motions that turn: along its widest directions by any vertex."""
        task, y, found = self.task, self.task.weights * q, list[Rows]()
        scene, tie = Linearised.of(task, y, AROUND * max(float(np.linalg.norm(y)), task.unit)), DEFAULT.tie * task.size
        for parts in carriers:
            each = sorted(scene.directions(parts) if scene else (), key=lambda own: -own[1].min())[:NEAREST_DIRECTIONS]
            rows = [np.column_stack([np.where(self.moving, -J, 0.0), gaps]) for J, gaps in each]  # no gap is to be left
            rows = [own[own[:, -1] <= own[:, -1].min() + tie] for own in rows]
            widest = max((own[:, -1].min() for own in rows), default=0.0)
            rows = [own if own[:, -1].min() >= widest - tie else own[:1] for own in rows]
            choices = map(np.array, product(*(own[distinct_rows(own.round(DIGITS))[0]] for own in rows)))
            found += [Rows(x[:, :-1], (x[:, -1] + x[:, :-1] @ y) / task.size) for x in choices if len(x)]
        rest = (self._rows(parts, q, NEAREST_DIRECTIONS) for parts in carriers) if not found else ()
        return found or [Rows(-own.normals, -own.levels) for own in rest]

    def _facing(self, flush: Flush, q: Array, shared: float) -> Rows:
        """Return that the hulls of two whole faces meet in their plane, as they do wherever parts of them touch."""
        from scipy.spatial import ConvexHull

        task, sides, elements = self.task, np.array([m for m, _ in flush.turns]), flush.touching
        X = task.movable.placed_vertices(task.target[0], task.transform(q))[np.array(elements.one.vertices) - 1]
        Y = task.static.placed_vertices(task.target[1], np.eye(4))[np.array(elements.two.vertices) - 1]
        planes = ConvexHull((Y[:, None] - X).reshape(-1, 3) @ sides.T).equations  # of the shifts after which they do
        slopes = self._by_z(-planes[:, :2] @ sides @ task.rates(q)[1][:, :3, 3].T)
        return Rows(slopes, slopes @ (q * task.weights / task.size) + (planes[:, 2] + shared * flush.least) / task.size)

    def _over(self, feature: Feature | None, parts: Parts, q: Array, shared: float) -> Array:
        """Return how wide what a part pair shares of flush faces is to be, in sizes, along each of its `_rows`."""
        # an edge may lie on the border of a face
        rows, gaps = self.task.separations(parts, self.task.pose(q))[1:]
        normals, over = rows[np.argsort(-gaps), :3], np.zeros(len(gaps))
        for each in self.task.seats:
            if each.touching == feature and (each.dimension > 1 or shared > NARROWEST):
                across = norms(normals - np.outer(normals @ each.normal, each.normal))  # aslant as much less is enough
                width = shared * each.least / self.task.size
                over = np.where(across > DEFAULT.sharp, np.maximum(over, across * width), over)
        return over

    def without(self, kind: str) -> System:
        """Return the same without "clearances", "limits", or "shares": what elements in contact must have in common."""
        limits = np.where(self.moving[:, None], [-np.inf, np.inf], self.task.limits)
        free: dict[str, dict[str, Any]] = {"clearances": {"pair": "any", "keep_out": ()}, "limits": {"limits": limits}}
        free["shares"] = {"joints": (), "seats": ()}  # their planes and lines meet all the same
        return replace(self, task=replace(self.task, **free[kind]))

    def nearer(self, short: float) -> System:
        """Return the same where the bodies are to be clear of each other but for a share of their size."""
        task = self.task
        return replace(self, task=replace(task, goal="clear", pair="any", clearance=task.need - short * task.size))

    def overlaps(self, q: Array) -> list[str]:
        """Return what a motion leaves too near, and by how much: the worst of the bodies, and of each keep-out."""
        task, found = self.task, dict[int, str]()
        gaps, pose, unit = task.pair_gaps(q), task.pose(q), task.length_unit
        short = np.where(gaps < task.needs - DEFAULT.cut * task.size, gaps - task.needs, 0.0)
        for i, j in np.transpose(np.unravel_index(short.argsort(axis=None), short.shape)).tolist():
            other, name, gap = task.obstacles[j], task.named((i, j)), float(gaps[i, j])
            if not short[i, j] < 0.0:
                break
            if other.keep_out >= 0:  # of an assembly each part may be too near to it
                name = f"{task.movable.name or 'body 1'} and {name}"
            else:
                one, two, normal = task.movable.parts[i], task.static.parts[j], task.direction_between((i, j), q)
                normal = normal / np.linalg.norm(normal)
                contact = facing(one, two, pose, supporting_contact(one, two, normal, pose), task.target, normal, gap)
                name = contact.feature.in_words(task.movable, task.static)
                sides = zip((task.movable, task.static), (contact.feature.one, contact.feature.two), strict=True)
                of_facets = not all(own.exact is not None or is_plane_there(own, element) for own, element in sides)
                name += " (of their facets)" * of_facets
            slack = LEAST_SHORT * task.size if other.need > 0.0 else 0.0
            found.setdefault(other.keep_out, f"{name} {gap_text(gap, slack, unit, other.need)}")
        return [*found.values()]

    def past_limits(self, q: Array) -> list[str]:
        """Return which parameters of a motion are past their limits, and by how much."""
        task, found = self.task, list[str]()
        each = zip(task.motion.parameters, q.tolist(), task.limits.tolist(), strict=True)
        for (name, kind), value, (low, high) in each:
            end = min(max(value, low), high)
            if abs(value - end) > DEFAULT.tie * (task.size if kind == "translation" else 1.0):
                end, past = (_parameter(x, kind, task.length_unit) for x in (end, abs(value - end)))
                found.append(f"{name} passes its limit {end} by {past}")
        return found

    def lost(self, q: Array) -> list[str]:
        """Return which contacts a motion leaves without what their elements share, and how far these are apart."""
        task, pose, slack, found = self.task, self.task.pose(q), DEFAULT.cut * self.task.size, list[str]()
        flush = {own.touching: own for own in task.seats}
        for joint in task.joints:
            gap = min((float(task.separations(parts, pose)[2].max()) for parts in joint.carriers), key=abs)
            plane, name = flush.get(joint.feature), joint.feature.in_words(task.movable, task.static)
            if plane is not None and not plane.holds(pose, task.target, slack):
                gap = max(gap, -plane.overlap(pose, task.target).depth)
                found.append(f"{name} lose each other, by {measured(max(gap, 0.0), task.length_unit, 4)}")
            elif gap > slack:
                found.append(f"{name} lose each other, by {measured(gap, task.length_unit, 4)}")
        return found

    def at_limits(self, q: Array) -> tuple[str, ...]:
        """Return "a limit" where a parameter is at one."""
        low, high = self.task.limits.T
        return ("a limit",) if bool(((q == low) | (q == high))[self.moving].any()) else ()


def least(systems: Sequence[System], *, shared: float = 0.0) -> tuple[Array | None, float]:
    """Return the least z that meets the tasks of all systems, which share their parameters and their size.

    Where that would leave flush faces no more than a border, the least that leaves them `shared` times what they must
    share.

    None where there is none; and a length below which there is none, infinite where there is none at all. Of motions
    that turn, whose least Newton's method may have missed, it is 0, and where parts too large for more were kept a
    distance apart along facets: corners may pass one another nearer.
    """
    first, exact = systems[0].task, all(own.task.motion.shifts for own in systems)
    z, gaps_only = first.start * first.weights / first.size, exact and not any(own.features for own in systems)
    blocked = {(k, parts) for k, own in enumerate(systems) for parts in own.blocked(first.start) if gaps_only}
    touching, length = [own for own in systems if own.touching], 0.0
    clearances = [ForbiddenShifts(own.task) for own in systems]
    moving, trusted, last, bound = systems[0].moving, np.inf, np.zeros(len(z)), 0.0
    carried = exact and shared > 0.0  # whether elements in contact are kept on each other
    for remaining in reversed(range(SHARPENED if exact else 2 * STEPS)):
        pacing.check()
        q = systems[0].q(z)
        values, slopes = _linearised(systems, q)
        sure = exact and not any(None in own.walls.values() for own in clearances)
        only = exact and np.linalg.matrix_rank(slopes[:, moving], DEFAULT.nominal) == moving.sum()
        if only and not blocked:  # what no motion is left to part needs no way apart
            found, complete = nearest_on(slopes, slopes @ z - values, systems[0].limits(), Choices.of([], len(z)))
        else:
            closing = systems if carried else touching
            choices = Choices.of([], len(z)).and_also(
                *(
                    own.separating_directions([parts for j, parts in sorted(blocked) if j == k], q, clearances[k])
                    for k, own in enumerate(systems)
                ),
                *(own.closings(first.start if exact else q, length, shared=shared) for own in closing),
            )
            near = systems[0].limits()
            if trusted < FARTHEST:
                near = near.and_also(np.vstack([np.eye(len(z)), -np.eye(len(z))]), np.append(z, -z) - trusted)
            # of turns that the last steps are for, the nearest to what was found so far that does at all
            about, directions = (z, np.eye(len(z))) if not exact and remaining < RESTORED else _model(first, z)
            levels = slopes @ (z - about) - values
            found, complete = nearest_on(
                slopes @ directions, levels, near.about(about, directions), choices.about(about, directions)
            )
            found = None if found is None else about + directions @ found
        if found is None and trusted < FARTHEST:
            trusted *= 4.0
            continue
        reached = np.inf if found is None else float(np.linalg.norm(found))
        if any(own.sooner(length) < min(own.sooner(reached), len(own.touching)) for own in touching):
            length = reached
            continue
        if found is None:
            return None, np.inf if sure and complete and remaining >= POLISHED else bound
        if not exact and (found - z) @ last < -TO_AND_FRO * last @ last < 0.0:  # to and fro, also between two motions
            trusted = min(trusted, float(np.abs(found - z).max())) / 2.0
        last = found - z
        step, z = float(np.abs(found - z).max()), found
        bound = float(np.linalg.norm(z)) if sure and remaining >= POLISHED else bound
        if step > CONTRACTED and not (exact and first.weighted):
            continue
        q = systems[0].q(z)
        if np.abs(_linearised(systems, q)[0]).max(initial=0.0) > DEFAULT.line:
            if step <= LEAST_STEP or exact:
                return None, 0.0
            continue
        if exact and blocked and remaining and (remaining >= POLISHED or step > CONTRACTED):
            kept = [{parts for j, parts in blocked if j == k} for k in range(len(systems))]
            if sum(own.further(q, kept[k], slopes, remaining) for k, own in enumerate(clearances)):
                continue
        if all(own.meets(q, DEFAULT.requirement) for own in systems):
            if not (exact or blocked or touching):  # a last step of Newton's method
                values, slopes = _linearised(systems, q)
                z = np.asarray(z - np.linalg.lstsq(slopes, values, rcond=DEFAULT.nominal)[0])
            return z, bound
        if only:
            return None, bound if all(own.meets(q, DEFAULT.line) for own in systems) else np.inf
        more = {(k, parts) for k, own in enumerate(systems) for parts in own.blocked(q, len(blocked))} - blocked
        if not more and exact and not (carried or gaps_only):
            carried = True
            continue
        if not more:
            unseated = (System(replace(own.task, seats=()), own.features) for own in systems)
            if exact and not shared and all(own.meets(q, DEFAULT.requirement) for own in unseated):
                found, _ = least(systems, shared=OVERLAID)
                if found is None:  # of less than that there may be some
                    bound = max(bound, least(systems, shared=NARROWEST)[1])
                return found, bound
            return None, bound
        blocked, carried, trusted, last = blocked | more, exact, np.inf, np.zeros(len(z))
    return None, bound


def _model(task: Task, z: Array) -> tuple[Array, Array]:
    """Return a point, (k,), and directions, (k, k), along which the amount is like a squared length near a motion.

    To the second order, of an amount of the user's own; where that bends down or not at all it is to bend a little up.
    """
    if not isinstance(task.amount_kind, OwnAmount):
        return np.zeros(len(z)), np.eye(len(z))
    scale = task.size / task.weights
    both = task.amount_kind.derivatives(z * scale)
    bends, directions = np.linalg.eigh(np.nan_to_num(both[:, :-1] * np.outer(scale, scale)))
    most = np.abs(bends).max()
    if not most > 0.0:
        return np.zeros(len(z)), np.eye(len(z))
    bends = np.maximum(np.abs(bends), DEFAULT.snap * most)
    return z - directions @ (directions.T @ np.nan_to_num(scale * both[:, -1]) / bends), directions / np.sqrt(bends)


def _linearised(systems: Sequence[System], q: Array) -> tuple[Array, Array]:
    """Return values and derivatives of all systems, see `System.linearised`."""
    values, slopes = zip(*(own.linearised(q) for own in systems), strict=True)
    return np.concatenate(values), np.concatenate(slopes)


# ------------------------------------------------------------------------------------------ where not all can be closed


@dataclass(frozen=True, eq=False)
class _Texts:
    """What keeps contacts from being restored together, and which of them can be; `names` are of the systems."""

    systems: Sequence[System]
    names: Sequence[str]

    @cached_property
    def _joints(self) -> list[tuple[int, int]]:
        """System and place there of each contact."""
        return [(k, j) for k, own in enumerate(self.systems) for j in range(len(own.task.joints))]

    def _named(self, group: Sequence[int]) -> str:
        """Return contacts by number, with their system's name."""
        texts = list[str]()
        for c in group:
            k, j = self._joints[c]
            number = str(j + 1) if len(self.systems[k].task.joints) > 1 or not self.names[k] else ""
            texts.append(f"{self.names[k]} {number}".strip())
        return ", ".join(texts)

    def _some(self, group: Sequence[int]) -> list[System]:
        """Return all systems with some contacts, as if there were no others."""
        kept = [[j for i, j in (self._joints[c] for c in group) if i == k] for k in range(len(self.systems))]
        return [own.only(some) if own.task.joints else own for own, some in zip(self.systems, kept, strict=True)]

    def sentences(self) -> tuple[str, ...]:
        """Return which contacts exclude each other, by number, and which carry without the others."""
        count = len(self._joints)
        if count > MOST_EXPLAINED:
            return (f"{count} contacts: too many to tell which exclude each other",)
        sentences = [
            f"contacts {self._named(group)} exclude each other"
            if len(group) > 1
            else f"contact {self._named(group)} cannot be closed"
            for group in self.conflicts
        ]
        if sentences:
            return (*sentences, *self._carried())
        return self.violated or ("no motion is found that closes all contacts",) * (count > 0)

    @property
    def violated(self) -> tuple[str, ...]:
        """What closing all contacts would violate; () where that takes long, or is not found."""
        wide = sum(own.task.part_pairs for own in self.systems) > MOST_PAIRS
        return () if wide else pacing.in_time(self._violated, late=())

    def _violated(self) -> tuple[str, ...]:
        """Return what closing all contacts would violate: as few as do of clearances, limits, and what faces share."""
        count, first = len(self._joints), self.systems[0].task
        kinds = ("clearances", "limits", "shares")
        for dropped in (group for size in (1, 2, 3) for group in combinations(kinds, size)):
            some = [own for own in self.systems if own.features or kinds[0] not in dropped]
            z = least([reduce(System.without, dropped, own) for own in some])[0] if some else None
            if z is None:
                continue
            q = np.where(np.abs(z) <= DEFAULT.tie, 0.0, z * first.size / first.weights)
            found = [text for own in self.systems for text in own.overlaps(q)] * (kinds[0] in dropped)
            found += self.systems[0].past_limits(q) * (kinds[1] in dropped)
            found += [text for own in self.systems for text in own.lost(q)] * (kinds[2] in dropped)
            moved = zip(first.motion.parameters, q.tolist(), strict=True)
            where = ", ".join(f"{name} {_parameter(x, kind, first.length_unit)}" for (name, kind), x in moved if x)
            where = f" ({where})" * bool(where)
            text = f"{where} {'; '.join(found[:MOST_VIOLATED])}"
            if found and count:
                return (f"with {'all contacts' if count > 1 else 'the contact'} closed{text}",)
            if found:
                return (*self._too_near(), f"with limits set aside{text}")
        return () if count else self._too_near()

    def _too_near(self) -> tuple[str, ...]:
        """Return which parts overlap by how much where they do least, or are how much nearer than they are to be."""
        tasks, found, low = [own.task for own in self.systems], tuple[str, ...](), 0.0
        high = max(float((own.needs - own.pair_gaps(own.start)).max()) for own in tasks) / tasks[0].size  # at rest
        short = high
        while high - low > LEAST_SHORT * high:
            z = least([own.nearer(short) for own in self.systems])[0]
            if z is None:
                low = short
            else:
                high, q = short, self.systems[0].q(z)
                found = tuple(text for own in self.systems for text in own.overlaps(q))[:MOST_VIOLATED]
            short = 0.5 * (low + high)
            if not found:
                break
        return found

    @cached_property
    def conflicts(self) -> list[tuple[int, ...]]:
        """The least sets of contacts that no motion closes together, whatever else it does."""
        found: list[tuple[int, ...]] = []
        count, most = len(self._joints), int(self.systems[0].moving.sum()) + 1
        for size in range(1, min(count, most) + 1):
            for group in combinations(range(count), size):
                if not any(set(known) <= set(group) for known in found) and not self._agree(group):
                    found.append(group)
        return found

    def _agree(self, group: tuple[int, ...]) -> bool:
        """Tell whether the equations of some contacts alone have a solution."""
        some, task = self._some(group), self.systems[0].task
        shifts = all(own.task.motion.shifts for own in some)
        z = np.zeros(len(task.weights))
        for _ in range(STEPS):
            values, slopes = _linearised(some, z * task.size / task.weights)
            step = np.linalg.lstsq(slopes, values, rcond=DEFAULT.nominal)[0]
            z = z - step
            if np.abs(step).max() <= LEAST_STEP * 10 or shifts:
                break
        return bool(np.abs(_linearised(some, z * task.size / task.weights)[0]).max() <= DEFAULT.touch)

    def _carried(self) -> Iterator[str]:
        """Yield which contacts can be closed together while the others are open, and by how much."""
        count, named = len(self._joints), 0
        for size in range(count - 1, 0, -1):
            for group in combinations(range(count), size):
                if any(set(known) <= set(group) for known in self.conflicts):
                    continue
                z, _ = least(self._some(group))
                if z is None:
                    continue
                opened = {c: self._opened(c, z) for c in range(count) if c not in group}
                slack, unit = DEFAULT.touch * self.systems[0].task.size, self.systems[0].task.length_unit
                if min(opened.values()) < -slack:
                    continue  # past it, not above it
                named += 1
                others = ", ".join(
                    f"{self._named([c])} {f'open by {measured(x, unit, 4)}' if x > slack else 'not flush'}"
                    for c, x in opened.items()
                )
                yield f"{self._named(group)} can carry, with {others}"
            if named:
                return

    def _opened(self, contact: int, z: Array) -> float:
        """Return how far a contact is open after a motion."""
        k, j = self._joints[contact]
        alone = System.of(self.systems[k].task, (j,))
        return float(alone.task.line_gaps(alone.q(z))[1].max())


def _parameter(value: float, kind: str, unit: str) -> str:
    """Return the value of a parameter in words: a length, or an angle in degrees."""
    return measured(value, unit, 4) if kind == "translation" else f"{np.degrees(value):.4g} deg"


# ----------------------------------------------------------------------------------------------------------- goal "fit"


def _fitted(task: Task) -> Answer:
    """Return the least motion of those that leave nothing overlapping and make the largest gap least.

    A linear program where nothing turns, exact; else one after the other. What would overlap besides the contacts is
    kept apart in one of its ways: that of the least gap, and of no bound unless all are closed.
    """
    own, exact, count = System.of(task), task.motion.shifts, len(task.joints)
    z, stage = np.clip(task.rest, *task.limits.T) * task.weights / task.size, LINEAR if exact else NEWTON
    failed = Answer(Status.NOT_FOUND, None, stage, 0.0, last=True)
    none = replace(failed, status=Status.INFEASIBLE, lower_bound=np.inf) if exact else failed
    blocked, trusted, last = set[Parts](), np.inf if exact else WIDEST_STEP, np.zeros(len(z))
    clearances = ForbiddenShifts(task)
    misfit = np.inf if exact else own.misfit(z)
    for remaining in reversed(range(SHARPENED if exact else 2 * STEPS)):
        values, slopes = own.linearised(own.q(z))
        count = len(own.features)
        gaps, rates = values[:count] - slopes[:count] @ z, slopes[:count]
        aligned = slopes[count:], slopes[count:] @ z - values[count:]
        choices, near = own.separating_directions(sorted(blocked), own.q(z), clearances), own.limits()
        if not exact:
            near = near.and_also(np.vstack([np.eye(len(z)), -np.eye(len(z))]), np.append(z, -z) - trusted)
        kept = near
        if blocked:
            choice, complete = _choice_of_least_gap(gaps, rates, aligned, kept, choices)
            if choice is None:
                return none if complete else failed
            kept = kept.and_also(choice.normals, choice.levels)
        fun = _least_gap(gaps, rates, aligned, kept)
        if fun is None and not exact and trusted < FARTHEST:  # so far what overlaps cannot be undone
            trusted *= 4.0
            continue
        if fun is None:
            return replace(none, active=_overlapping(task, gaps, rates))
        largest = max(fun, 0.0) + DEFAULT.tie
        rows = near.and_also(np.vstack([rates, -rates]), np.concatenate([-gaps, gaps - largest]))
        found, _ = nearest_on(*aligned, rows, choices)
        if found is None:
            return failed
        step = float(np.abs(found - z).max())
        if not exact and step > SHORT_STEP and own.misfit(found) > misfit:
            trusted = step / 4.0
            continue
        turned = not exact and (found - z) @ last < -TO_AND_FRO * last @ last < 0.0  # to and fro about the least gap
        trusted = min(trusted, step / 2.0) if turned else trusted
        last, z, misfit = found - z, found, np.inf if exact else own.misfit(found)
        if turned and step <= SETTLED:
            step = 0.0
        if not exact and step > CONTRACTED:
            continue
        if exact and remaining and clearances.further(own.q(z), blocked, aligned[0], remaining):
            continue
        more = own.blocked(own.q(z)) - blocked
        if task.meets(own.q(z), DEFAULT.requirement) or not more:
            break
        blocked, misfit = blocked | more, np.inf  # what keeps clear of more may fit less
    q = own.q(z)
    if not task.meets(q, DEFAULT.requirement):
        return replace(failed, active=(*own.overlaps(q)[:MOST_VIOLATED], "parts overlap besides these contacts"))
    opened = np.maximum(task.line_gaps(q)[1], 0.0)
    most = float(opened.max())
    at = ", ".join(str(k + 1) for k in np.flatnonzero(opened >= most - DEFAULT.touch * task.size).tolist())
    closed = most <= DEFAULT.touch * task.size  # rounding
    active = ("no contact is left open" if closed else f"the largest gap is of contact {at}",)
    counts = task.modelled({own.parts for own in own.features}, variables=len(z), constraints=2 * count, features=count)
    known = exact and remaining >= POLISHED and (not blocked or largest <= 2.0 * DEFAULT.tie)
    return task.answer(q, stage, np.inf if known else 0.0, active, counts)


def _least_gap(gaps: Array, rates: Array, aligned: tuple[Array, Array], rows: Rows) -> float | None:
    """Return the least largest gap, in sizes, of motions z that meet all rows and let no gap be negative."""
    from scipy.optimize import linprog

    ones = np.ones((len(gaps), 1))
    program = linprog(
        np.append(np.zeros(rates.shape[1]), 1.0),
        A_ub=np.vstack([np.hstack([-rates, 0.0 * ones]), np.hstack([rates, -ones]), _widened(-rows.normals)]),
        b_ub=np.concatenate([gaps, -gaps, -rows.levels]),
        A_eq=_widened(aligned[0]),
        b_eq=aligned[1],
        bounds=[*[(None, None)] * rates.shape[1], (0.0, None)],
        method="highs",
    )
    return float(program.fun) if program.status == 0 else None


def _choice_of_least_gap(
    gaps: Array, rates: Array, aligned: tuple[Array, Array], rows: Rows, choices: Choices
) -> tuple[Rows | None, bool]:
    """Return the way of each group that is met where the largest gap is least, motions counting little.

    None where there is none, and whether that is so.
    """
    ones = np.ones((len(gaps), 1))
    of_gaps = np.vstack([np.hstack([rates / MINOR, 0.0 * ones]), np.hstack([-rates / MINOR, ones])])

    def lifted(given: Rows) -> Rows:
        return Rows(_widened(given.normals / MINOR), given.levels)

    every = lifted(rows).and_also(of_gaps, np.concatenate([-gaps, gaps]))
    widened = choices._replace(rows=lifted(choices.rows))
    y, complete = nearest_on(_widened(aligned[0] / MINOR), aligned[1], every, widened)
    if y is None:
        return None, complete
    missed = choices.of_rows(choices.rows.levels - choices.rows.normals @ (y[:-1] / MINOR))[0]
    order = np.lexsort((missed, choices.group_of_alternatives))  # of each group the one that is missed least first
    return choices.only(np.isin(np.arange(len(missed)), order[choices.groups])).rows, True


def _widened(rows: Array) -> Array:
    """Return rows over z as rows over z and the largest gap."""
    return np.hstack([rows, np.zeros((len(rows), 1))])


def _overlapping(task: Task, gaps: Array, rates: Array) -> tuple[str, ...]:
    """Return which contacts overlap whatever the motion, and by how much."""
    flat = (np.linalg.norm(rates, axis=1) <= DEFAULT.tie) & (gaps < -DEFAULT.touch)
    texts = (
        f"contact {k + 1} overlaps by {measured(-gaps[k] * task.size, task.length_unit, 4)} whatever the motion"
        for k in np.flatnonzero(flat).tolist()
    )
    return tuple(texts) or ("some contact always overlaps",)
