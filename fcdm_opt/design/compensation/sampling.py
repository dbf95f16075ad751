"""Least motions at single pairs of sizes: searched everywhere, or only near what is known around; always judged."""

from __future__ import annotations

import json
import math
from collections.abc import Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import chain, pairwise
from time import perf_counter
from typing import Any, NamedTuple, TypeVar

import numpy as np

from fcdm_opt.design.compensation.active_sets import MOTIONLESS, NOTHING, ActiveSet, active_set
from fcdm_opt.design.sizes import size_box, tolerance_box
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.judge.certificate import verify
from fcdm_opt.judge.engagement import inside_fit
from fcdm_opt.model.reported import reported
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.problem import Problem
from fcdm_opt.solver import solve
from fcdm_opt.stages.branching import near
from fcdm_opt.stages.order import STAGES
from fcdm_opt.tolerances import DEFAULT

QUICK = ("satisfied", "shift", "straight", "one parameter", "rotations", "descent", "translations")  # dearest last
CONTINUED = "continued from motions around"
AROUND = 2e-5  # of the box: an active set that does not hold so far off a place is a strip between two regions
CIRCLE = tuple((math.cos(0.3 + 0.4 * math.pi * k), math.sin(0.3 + 0.4 * math.pi * k)) for k in range(5))
FEWEST = 2  # of these directions in which the active set of a region holds
CHUNK = 16  # pairs that a process is handed at once
BEYOND = 4.0  # times the distance of the nearest: active sets whose motions are continued
HINTS = 3  # active sets, nearest first, whose motions are continued to a place

Key = tuple[float, float]
Result = TypeVar("Result")


class Sample(NamedTuple):
    """A least motion: `held` by an active set; `values`, (1 + k,), are its amount and parameters, nan without one."""

    held: ActiveSet
    values: Array


Asking = Generator[list[Array], list[Sample], Result]
"""A search that yields places, gets the samples there, and returns its result: many such are run side by side."""


class Wanted(NamedTuple):
    """A pair of sizes, and how its least motion is to be found.

    Attributes
    ----------
    pair : (float, float)
    everywhere : bool
        Whether all motions are looked at, as `solve` does; otherwise local searches have to do.
    hints : tuple of tuple of float
        Motions known around, one of each active set.
    nothing : bool
        Whether there is none at the nearest pair known: none is then taken for granted where none is found.
    all_hints : bool
        Whether hints are followed even where a stage of the solver has an answer.
    """

    pair: tuple[float, float]
    everywhere: bool = True
    hints: tuple[tuple[float, ...], ...] = ()
    nothing: bool = False
    all_hints: bool = False


def asked(problem: Problem, pair: Sequence[float] | Array) -> Problem:
    """Return the problem for one pair of sizes."""
    return problem.changed(target=(float(pair[0]), float(pair[1])), requirement=None, tolerance=None, goal=problem.goal)


def sample_at(problem: Problem, wanted: Wanted) -> Sample:
    """Return the least motion for one pair of sizes, judged."""
    one = asked(problem, wanted.pair)
    solution = None
    if not wanted.everywhere and problem.amount == "weighted" and not problem.feature_pairs:
        task = Task.of(one)
        answer = _near_by(task, wanted)
        if answer is None and wanted.nothing:
            return Sample(NOTHING, np.full(1 + len(problem.weights), np.nan))
        if answer is not None:
            solution = reported(one, task, answer)
            solution = inside_fit(solution.with_certificate(verify(solution), {}))
    if solution is None or (solution.status.found and not solution.usable):
        solution = solve(one, effort="quick")
    if not solution.usable:
        return Sample(active_set(solution), np.full(1 + len(problem.weights), np.nan))
    return Sample(active_set(solution), np.array([solution.amount, *solution.parameters.values()]))


def _near_by(task: Task, wanted: Wanted) -> Answer | None:
    """Return what the quick stages find, or the least that is found near the hints."""
    tried = (STAGES[name](task) for name in QUICK)
    best = next((answer for answer in tried if answer is not None and answer.settles), None)
    if best is not None and not wanted.all_hints:
        return best
    least = task.amount(best.q) if best is not None and best.q is not None else np.inf
    for hint in wanted.hints:
        descended = near(task, np.array(hint))
        if descended is not None and descended.amount < least:
            least = descended.amount
            best = replace(descended, stage=CONTINUED)
    return best


@lru_cache(maxsize=1)
def _read(text: str) -> Problem:
    return Problem.from_dict(json.loads(text))


def samples_at(text: str, several: Iterable[Wanted]) -> list[Sample]:
    """Return the samples of a problem in plain data: what a worker process does."""
    return [sample_at(_read(text), wanted) for wanted in several]


@dataclass(eq=False)
class Sampler:
    """Finds least motions and remembers them.

    Some are proved: all motions are looked at. Others are what local searches find from motions known around, which
    is a hundred times cheaper, and as good unless an active set comes up that no proved sample around has: hence
    `agree`.

    Attributes
    ----------
    problem : Problem
    box : (2, 2) array
        Places are relative to it: (0, 0) is its lower, (1, 1) its upper corner.
    budget : int
        Number of samples after which `spent` is true.
    jobs : int
        Processes.
    seconds : float
        Time after which `spent` is true.
    known, moved : dict
        Place -> sample as solved; and as taken where its own active set holds in but a strip.
    proved : set
        Places of samples that are proved.
    solved_in_all : int
        How many pairs of sizes were solved, those forgotten included.
    """

    problem: Problem
    box: Array
    budget: int
    jobs: int = 1
    seconds: float = math.inf
    known: dict[Key, Sample] = field(default_factory=dict)
    moved: dict[Key, Sample] = field(default_factory=dict)
    proved: set[Key] = field(default_factory=set)
    solved_in_all: int = 0
    _wide: set[ActiveSet] = field(default_factory=set)
    _start: float = field(default_factory=perf_counter)
    _doubt: int = 0

    @property
    def spent(self) -> bool:
        """Whether the budget or the time is used up."""
        return self.effort >= 1.0

    @property
    def effort(self) -> float:
        """The share of the budget, or of the time, that is used up."""
        return max(self.solved_in_all / self.budget, (perf_counter() - self._start) / self.seconds)

    def pair(self, place: Any) -> Array:
        """Return the sizes at a place, or at several, (..., 2)."""
        place = np.asarray(place, dtype=float)
        return np.asarray(self.box[:, 0] * (1.0 - place) + self.box[:, 1] * place)

    def samples(self, places: Sequence[Array], *, proved: bool = False) -> list[Sample]:
        """Return the samples at some places."""
        samples = self._remembered(_keys(places), proved)
        return [
            sample if sample.held in self._wide else self._beside(place, sample)
            for place, sample in zip(places, samples, strict=True)
        ]

    def agree(self, places: Sequence[Array]) -> bool:
        """Tell whether samples hold when they are proved; if not, forget all that are not, and be more careful."""
        before, after = (
            np.array([sample.values[0] for sample in self._remembered(_keys(places), proved)])
            for proved in (False, True)
        )
        lost = np.isnan(before) != np.isnan(after)
        if not lost.any() and not (before - after > DEFAULT.touch * self.problem.size).any():
            return True
        self._doubt += 1
        self.known = {key: self.known[key] for key in self.proved}
        self.moved.clear()
        self._wide.clear()
        return False

    def _remembered(self, keys: list[Key], proved: bool = False) -> list[Sample]:
        known = self.proved if proved else self.known
        missing = [key for key in dict.fromkeys(keys) if key not in known]
        everywhere = proved or self._doubt > 1
        self.known.update(zip(missing, self._solved(self._wanted(missing, everywhere)), strict=True))
        if everywhere:
            self.proved.update(missing)
        self.solved_in_all += len(missing)
        return [self.known[key] for key in keys]

    def _wanted(self, keys: Sequence[Key], everywhere: bool) -> list[Wanted]:
        """Return what is asked at some places, with what is known around; the same however many processes answer."""
        pairs = [(float(pair[0]), float(pair[1])) for pair in self.pair(np.reshape(keys, (-1, 2)))]
        if everywhere or not keys or not self.known:
            return [Wanted(pair) for pair in pairs]
        from scipy.spatial.distance import cdist

        places, samples = np.array(list(self.known)), list(self.known.values())
        rows: dict[ActiveSet, list[int]] = {}
        for row, sample in enumerate(samples):
            rows.setdefault(sample.held, []).append(row)
        apart = [cdist(keys, places[some], "cityblock") for some in rows.values()]  # of each active set, for every key
        off = np.array([some.min(axis=1) for some in apart])
        nearest = [np.array(own)[some.argmin(axis=1)] for own, some in zip(rows.values(), apart, strict=True)]
        sets, wanted = list(rows), []
        for k, pair in enumerate(pairs):
            order = np.argsort(off[:, k], kind="stable").tolist()
            reach = np.inf if self._doubt else BEYOND * off[order[0], k]
            close = [own for own in order if sets[own].kind not in MOTIONLESS and off[own, k] <= reach]
            hints = tuple(tuple(samples[nearest[own][k]].values[1:].tolist()) for own in close[:HINTS])
            wanted.append(Wanted(pair, False, hints, sets[order[0]] == NOTHING, bool(self._doubt)))
        return wanted

    def _beside(self, place: Array, sample: Sample) -> Sample:
        """Return the sample itself if its active set holds around it, else that of a region beside, continued to it.

        On a boundary of two regions both active sets hold at once, in a strip as wide as rounding: that is no region.
        """
        (key,) = _keys([place])
        if key not in self.moved:
            ring = [(key[0] + AROUND * c, key[1] + AROUND * s) for c, s in CIRCLE]
            near = self._remembered(ring)
            if sum(one.held == sample.held for one in near) >= FEWEST:
                self._wide.add(sample.held)
                return sample
            self.moved[key] = sample
            for k in sorted(range(len(ring)), key=lambda k: (near[k].held not in self._wide, k)):
                (far,) = self._remembered([(2 * ring[k][0] - key[0], 2 * ring[k][1] - key[1])])
                if far.held == near[k].held:
                    self.moved[key] = Sample(far.held, 2 * near[k].values - far.values)
                    break
        return self.moved[key]

    def _solved(self, wanted: list[Wanted]) -> Iterator[Sample]:
        if self.jobs == 1 or len(wanted) < 2 * self.jobs:
            yield from (sample_at(self.problem, one) for one in wanted)
            return
        from joblib import Parallel, delayed

        count = min(len(wanted), max(self.jobs, len(wanted) // CHUNK))
        ends = np.linspace(0, len(wanted), count + 1).astype(int)
        with Parallel(n_jobs=self.jobs, return_as="generator", inner_max_num_threads=1, backend="loky") as run:
            chunks = (delayed(samples_at)(self._plain, wanted[a:b]) for a, b in pairwise(ends))
            yield from chain.from_iterable(run(chunks))

    @cached_property
    def _plain(self) -> str:
        return json.dumps(self.problem.to_dict())


def _keys(places: Iterable[Array]) -> list[Key]:
    return [(float(place[0]), float(place[1])) for place in places]


def covered(problem: Problem, box: Any) -> Array:
    """Return the box of sizes that a map covers, (2, 2); raises `InputError` for what has no map.

    Parameters
    ----------
    problem : Problem
    box : ((low_1, high_1), (low_2, high_2)) or None
        None: what the problem's tolerance leaves open.
    """
    if not isinstance(problem, Problem):
        raise InputError("expected a Problem", key="problem", found=type(problem).__name__)
    if problem.goal == "beyond":
        raise InputError(
            "the amount of this goal jumps wherever the deviation changes sign, so it has no map",
            key="goal",
            found="beyond",
            allowed='"touch", "clear", "at" or "seat"',
        )
    if problem.resolution is not None:
        raise InputError(
            "a motion in whole steps jumps from pair to pair, so it has no map",
            key="resolution",
            found=problem.resolution.tolist(),
            allowed="a problem without resolution",
        )
    made = tolerance_box(problem) if box is None else size_box(box, "box")
    if (np.ptp(made, axis=1) <= DEFAULT.snap * made[:, 1]).any():
        raise InputError(
            "a box this narrow has no map", key="box", found=made.tolist(), allowed="low < high, for both sizes"
        )
    return made
