"""Stage 4, first: descent over contact rows, compiled; what it does not model or find is left to the program.

In weighted coordinates the amount is a distance, so that each step is a least distance problem over linearised rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.contact import distinct
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.model.task import Answer, Parts, Task
from fcdm_opt.motion.instructions import PoseInstructions, pose_instructions
from fcdm_opt.problem.problem import MOST_TURNED
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages import compiled
from fcdm_opt.tolerances import DEFAULT

ROOM = 160  # rows of one descent
ROUNDS = 30  # of adding rows
START_DISTANCE = 3.0  # starts away from rest, in typical amounts
CHOICES, MOST_APART = 12, 24  # ways apart of a pair that are tried, and pairs kept apart
EAGER = 0.7  # ways whose promise times this is no better than what is known are not tried
STAGE = "4: descent over contact rows"


class Separator(NamedTuple):
    """A site, (kind, i, j, part of 1, part of 2), and the orientation of its normal where it is of edges."""

    site: tuple[int, ...]
    orientation: float

    @property
    def parts(self) -> Parts:
        """The part pair."""
        return self.site[3], self.site[4]


class Settled(NamedTuple):
    """A least motion: z, its length, what stops it, the sites that keep pairs apart; and what was modelled."""

    z: Array
    amount: float
    active: tuple[str, ...]
    chosen: list[Separator]
    rows: int
    features: int
    parts: set[Parts]


@dataclass(frozen=True, eq=False)
class Descent:
    """A task in the arrays that the kernels take; z = weights * q / unit."""

    task: Task
    motion: PoseInstructions

    @cached_property
    def scale(self) -> Array:
        """Parameter per z, (k,)."""
        return self.task.unit / self.task.weights

    @cached_property
    def scene(self) -> tuple[Any, ...]:
        """What every kernel takes first."""
        task = self.task
        motion = self.motion.scaled(self.scale, task.movable.seed, task.static.seed)
        tracked = np.array([(*feature.site, *feature.parts) for feature in task.tracked], dtype=np.int64).reshape(-1, 5)
        signs = np.array([feature.sign for feature in task.tracked])
        # where a contact is tracked, the state of the target pair is left to other stages
        pairs = np.array([task.nominal, task.target, (-np.inf if task.tracked else task.need, 0.0)])
        points = (DEFAULT.path_points - 1, task.coherent, DEFAULT.path_turn, MOST_TURNED, DEFAULT.cut * task.size)
        path = np.array([*points, *self.task.motion.turning], dtype=np.float64)
        return motion, task.movable.packed, task.static.packed, tracked, signs, pairs, path

    @cached_property
    def steepest(self) -> Array:
        """Longest step in each z: angles and shares of the size."""
        return np.where(self.task.motion.turning, 1.0, self.task.size) * compiled.STEEPEST / self.scale

    @cached_property
    def rows(self) -> tuple[Ints, Array, int]:
        """The rows of limits and goal, with room for more, and how many there are."""
        task, table, numbers = self.task, np.zeros((ROOM, compiled.ROW), dtype=np.int64), np.zeros((ROOM, 3))
        made: list[tuple[dict[int, int], float, float]] = []
        for k, side in np.argwhere(np.isfinite(task.limits)).tolist():
            level = float(task.limits[k, side] / self.scale[k])
            made.append(({compiled.TYPE: compiled.ROW_BOUND, compiled.V: k}, (1.0, -1.0)[side], level))
        if len(task.tracked) == 1:
            made.append(({compiled.TYPE: compiled.ROW_LINE, compiled.EQUAL: 1}, 1.0, 0.0))
        elif task.tracked:
            for body in (0, 1):
                own = {compiled.TYPE: compiled.ROW_TARGET, compiled.BODY: body, compiled.EQUAL: int(task.goal == "at")}
                made.append((own, float(task.signs[body] or 1.0), 0.0))
        for k, (entries, orientation, level) in enumerate(made):
            for column, value in entries.items():
                table[k, column] = value
            numbers[k] = 1.0, orientation, level
        return table, numbers, len(made)

    def settle(
        self, starts: Array, enough: float, chosen: Sequence[Separator] = (), closing: Parts | None = None
    ) -> Settled | None:
        """Return the least motion found from several starts, (n, k), each on its own.

        Only what is smaller than `enough` is of interest. The sites `chosen` keep their part pairs apart; the pair
        `closing` must not stay apart.
        """
        best: Settled | None = None
        for start in starts:
            if best is not None and pacing.over():
                break
            best = self._settled_from(start, min(enough, self._below(best)), chosen, closing) or best
        return best

    def _settled_from(
        self, start: Array, enough: float, chosen: Sequence[Separator], closing: Parts | None
    ) -> Settled | None:
        """Return the same from one start: rows are added for what each solution violates."""
        rows, base = (self.rows[0].copy(), self.rows[1].copy()), self.rows[2]
        count, made = base, len(chosen)
        sites = np.zeros((MOST_APART, 5), dtype=np.int64), np.zeros(MOST_APART)
        for k, feature in enumerate(chosen):
            sites[0][k], sites[1][k] = feature
        pair, slack = np.array((-1, -1) if closing is None else closing), 0.1 * DEFAULT.cut * self.task.unit
        z, duals = start.copy(), np.zeros(ROOM)
        for turn in range(ROUNDS):
            pacing.check()
            begins = turn == 0 and (made > 0 or closing is not None)
            if not begins:
                ended = compiled.descend(self.scene, rows, count, self.steepest, z, duals, enough)
                if ended != compiled.FOUND or not float(np.linalg.norm(z)) < enough:
                    return None
            went, count, made = compiled.grow(self.scene, rows, base, count, sites, made, pair, z, slack, duals, begins)
            if went == compiled.FOUND:
                sited = zip(sites[0][:made].tolist(), sites[1][:made].tolist(), strict=True)
                held = [Separator(tuple(site), orientation) for site, orientation in sited]
                return self._settled(z, rows[0][:count], rows[1][:count, compiled.ORIENTATION], duals, held, closing)
            if went != compiled.GOES_ON:
                return None
        return None

    def _settled(
        self, z: Array, ints: Ints, orientations: Array, duals: Array, held: list[Separator], closing: Parts | None
    ) -> Settled:
        kept = {feature.parts for feature in self.task.tracked} | ({closing} if closing is not None else set())
        rows = zip(ints, orientations, duals, strict=False)
        active = tuple(dict.fromkeys(self._named(row, orientation) for row, orientation, dual in rows if dual != 0))
        kinds = ints[:, compiled.TYPE]
        sited = ints[(kinds == compiled.ROW_SEPARATION) | (kinds == compiled.ROW_GAP), compiled.KIND : compiled.P2 + 1]
        behind = ints[kinds == compiled.ROW_DEPTH, compiled.KIND : compiled.V + 1]
        features = {*map(tuple, sited.tolist()), *map(tuple, behind.tolist())}
        kept |= {feature.parts for feature in held} | {(one, two) for *_, one, two in sited.tolist()}
        count = int((kinds != compiled.ROW_BOUND).sum())
        return Settled(z, float(np.linalg.norm(z)), active, held, count, len(features) + len(self.task.tracked), kept)

    def _named(self, row: Ints, orientation: float) -> str:
        task, kind, parts = self.task, row[compiled.TYPE], (int(row[compiled.P1]), int(row[compiled.P2]))
        if kind == compiled.ROW_TARGET:
            return f"rho_{row[compiled.BODY] + 1} reaches its target"
        if kind == compiled.ROW_LINE:
            return "target on the moved segment"
        if kind == compiled.ROW_BOUND:
            return "a limit"
        if kind == compiled.ROW_DEPTH:
            body = int(row[compiled.BODY])
            return f"a vertex of body {body}, part {parts[body - 1] + 1}, behind the tracked feature"
        pair = task.named(parts)
        if kind == compiled.ROW_SEPARATION:
            return f"{pair} stays {'apart' if orientation > 0 else 'in contact'} on the way"
        return f"{pair} stays apart" if orientation > 0 else f"{pair} closes"

    @cached_property
    def starts(self) -> Array:
        """The allowed motion nearest to rest, and starts along each parameter, (1 + 2 k, k)."""
        turns = np.minimum(START_DISTANCE, 1.0 / self.scale)
        steps = np.diag(np.where(self.task.motion.turning, turns, START_DISTANCE))
        first = self.task.start / self.scale
        low, high = self.task.limits.T / self.scale
        return np.clip(first + np.vstack([np.zeros((1, len(steps))), steps, -steps]), low, high)

    def separating_features(self, z: Array, parts: Parts) -> list[tuple[float, Separator]]:
        """Return (amount to first order, site) of the ways in which a part pair can come apart."""
        sites, orientations, normals, gaps, steep = compiled.separating_features(self.scene, z, *parts)
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            amounts = np.nan_to_num((self.task.need - gaps) / steep, nan=np.inf)
        order = np.argsort(amounts, kind="stable")
        kept = order[distinct(normals[order], CHOICES)].tolist()
        own = [Separator((*sites[k].tolist(), *parts), float(orientations[k])) for k in kept]
        return list(zip(amounts[kept].tolist(), own, strict=True))

    def _combined(self, low: dict[Parts, list[tuple[float, Separator]]]) -> Iterator[tuple[float, list[Separator]]]:
        """Yield (promise, sites) of the choices of one way for each pair: the first of all, or one other."""
        first = [options[0] for options in low.values()]
        tries = [first]
        for place, options in enumerate(low.values()):
            tries += [[*first[:place], option, *first[place + 1 :]] for option in options[1:]]
        made = [(max((amount for amount, _ in own), default=0.0), [feature for _, feature in own]) for own in tries]
        yield from sorted(made, key=lambda own: own[0])

    def least_free(self) -> Settled | None:
        """Return the least motion found that undoes overlaps, or closes a gap."""
        task, starts = self.task, self.starts
        gaps = task.pair_gaps(task.start)
        order = sorted(np.ndindex(gaps.shape), key=lambda parts: float(gaps[parts]))
        low = {parts: self.separating_features(starts[0], parts) for parts in order if gaps[parts] < task.need}
        if len(low) > MOST_APART // 2:
            return None
        best: Settled | None = None
        if low or not task.must_touch:
            for first in (starts[:1], starts):
                for promise, chosen in self._combined(low) if best is None else ():
                    if best is not None and promise * EAGER >= best.amount:
                        break
                    best = self.settle(first, self._below(best), chosen) or best
        else:
            rate = task.search_rate * task.unit
            for parts in order[:CHOICES]:
                if best is not None and gaps[parts] / rate >= best.amount:
                    break
                best = self.settle(starts, self._below(best), (), parts) or best
        return best

    def _below(self, best: Settled | None) -> float:
        return np.inf if best is None else best.amount * (1.0 - DEFAULT.nominal)


def descent(task: Task) -> Answer | None:
    """Stage 4 by descent; None where it models something else or finds nothing."""
    if task.goal == "seat" or any(task.flush) or not task.weighted or (task.need > 0 and task.tracked):
        return None
    if task.keep_out:
        return _kept_clear(task)
    program = pose_instructions(task.motion)
    if program is None:
        return None
    own = Descent(task, program)
    best = own.settle(own.starts, np.inf) if task.tracked else own.least_free()  # whatever the target pair's state
    if best is None:
        return None
    q = np.clip(best.z * own.scale, task.limits[:, 0], task.limits[:, 1])
    if not task.meets(q, DEFAULT.requirement, path=False):  # the path has been looked at
        return None
    if task.need > 0 and not _along_facets(task, q):
        return None
    counts = task.modelled(best.parts, variables=len(q), constraints=best.rows, features=best.features)
    return Answer(Status.SOLVED, q, STAGE, min(task.displacement_bound, task.amount(q)), best.active, counts)


def _kept_clear(task: Task) -> Answer | None:
    answer = descent(replace(task, keep_out=()))
    if answer is None or answer.q is None or not task.meets(answer.q, DEFAULT.requirement, path=False):
        return None
    totals = {name: count for name, count in task.modelled().items() if name.endswith("_total")}
    return replace(answer, modelled={**(answer.modelled or {}), **totals})


def _along_facets(task: Task, q: Array) -> bool:
    """Tell whether the nearest pairs are as near as along facets: of corners' distances other motions are least."""
    gaps = task.pair_gaps(q)
    slack = DEFAULT.requirement * task.size
    tight = [(i, j) for i, j in np.ndindex(gaps.shape) if gaps[i, j] < task.need + slack]
    return bool((task.pair_gaps(q, {parts: task.direction_between(parts, q) for parts in tight}) - gaps <= slack).all())
