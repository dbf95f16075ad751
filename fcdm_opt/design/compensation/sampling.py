"""Least motions at single pairs of sizes, each solved and judged once."""

from __future__ import annotations

import json
import math
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import chain, pairwise
from time import perf_counter
from typing import Any, NamedTuple, TypeVar

import numpy as np

from fcdm_opt.design.compensation.active_sets import ActiveSet, active_set
from fcdm_opt.design.sizes import size_box, tolerance_box
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.judge.certificate import verify
from fcdm_opt.judge.engagement import inside_fit
from fcdm_opt.model.reported import reported
from fcdm_opt.model.task import Task
from fcdm_opt.problem.problem import Problem
from fcdm_opt.solver import solve
from fcdm_opt.stages.order import STAGES
from fcdm_opt.tolerances import DEFAULT

QUICK = ("satisfied", "shift", "straight", "one parameter", "rotations", "descent", "translations")  # dearest last
CHUNK = 16  # pairs that a process is handed at once

Pair = tuple[float, float]
Result = TypeVar("Result")


class Sample(NamedTuple):
    """A least motion: `held` by an active set; `values`, (1 + k,), are its amount and parameters, nan without one."""

    held: ActiveSet
    values: Array


Asking = Generator[list[Array], list[Sample], Result]
"""A search that yields places, gets the samples there, and returns its result: many such are run side by side."""


def asked(problem: Problem, pair: Sequence[float] | Array) -> Problem:
    """Return the problem for one pair of sizes."""
    return problem.changed(target=(float(pair[0]), float(pair[1])), requirement=None, tolerance=None, goal=problem.goal)


def sample_at(problem: Problem, pair: Pair, *, careful: bool = False) -> Sample:
    """Return the least motion for one pair of sizes: by local searches where they do, or as `solve` finds it."""
    one, solution = asked(problem, pair), None
    if not careful and problem.amount == "weighted" and not problem.feature_pairs:
        task = Task.of(one)
        tried = (STAGES[name](task) for name in QUICK)
        answer = next((answer for answer in tried if answer is not None and answer.settles), None)
        if answer is not None:
            solution = reported(one, task, answer)
            solution = inside_fit(solution.with_certificate(verify(solution), {}))
    if solution is None or (solution.status.found and not solution.usable):
        solution = solve(one, effort="quick")
    values = [solution.amount, *solution.parameters.values()] if solution.usable else [math.nan]
    return Sample(active_set(solution), np.resize(values, 1 + len(problem.weights)))


@lru_cache(maxsize=1)
def _read(text: str) -> Problem:
    return Problem.from_dict(json.loads(text))


def samples_at(text: str, pairs: Iterable[Pair], careful: bool) -> list[Sample]:
    """Return the samples of a problem in plain data: what a worker process does."""
    return [sample_at(_read(text), pair, careful=careful) for pair in pairs]


@dataclass(eq=False)
class Sampler:
    """Finds least motions, in `jobs` processes, and remembers them.

    Places are relative to the box: (0, 0) is its lower, (1, 1) its upper corner. After as many samples as `budget`, or
    as many `seconds`, it is `spent`. Local searches are asked first, unless it is `careful`: see `agree`.
    """

    problem: Problem
    box: Array
    budget: int
    jobs: int = 1
    seconds: float = math.inf
    known: dict[Pair, Sample] = field(default_factory=dict)
    careful: bool = False
    _start: float = field(default_factory=perf_counter)

    @property
    def spent(self) -> bool:
        """Whether the budget or the time is used up."""
        return self.effort >= 1.0

    @property
    def effort(self) -> float:
        """The share of the budget, or of the time, that is used up."""
        return max(len(self.known) / self.budget, (perf_counter() - self._start) / self.seconds)

    def pair(self, place: Any) -> Array:
        """Return the sizes at a place, or at several, (..., 2)."""
        place = np.asarray(place, dtype=float)
        return np.asarray(self.box[:, 0] * (1.0 - place) + self.box[:, 1] * place)

    def samples(self, places: Sequence[Array]) -> list[Sample]:
        """Return the samples at some places."""
        pairs = [(float(x), float(y)) for x, y in self.pair(np.reshape(places, (-1, 2)))]
        missing = [pair for pair in dict.fromkeys(pairs) if pair not in self.known]
        self.known.update(zip(missing, self._solved(missing), strict=True))
        return [self.known[pair] for pair in pairs]

    def agree(self, places: Array) -> bool:
        """Tell whether `solve` finds no less at some places; if it does, forget all, and take it everywhere."""
        before, self.careful = self.samples(list(places)), True
        after = self._solved([(float(x), float(y)) for x, y in self.pair(places)])
        for one, two in zip(before, after, strict=True):
            less = one.values[0] - two.values[0] > DEFAULT.touch * self.problem.size
            if less or np.isnan(one.values[0]) != np.isnan(two.values[0]):
                self.known.clear()
                return False
        return True

    def _solved(self, pairs: list[Pair]) -> Iterable[Sample]:
        if self.jobs == 1 or len(pairs) < 2 * self.jobs:
            return [sample_at(self.problem, pair, careful=self.careful) for pair in pairs]
        from joblib import Parallel, delayed

        count = min(len(pairs), max(self.jobs, len(pairs) // CHUNK))
        ends = np.linspace(0, len(pairs), count + 1).astype(int)
        with Parallel(n_jobs=self.jobs, inner_max_num_threads=1, backend="loky") as run:
            chunks = (delayed(samples_at)(self._plain, pairs[a:b], self.careful) for a, b in pairwise(ends))
            return chain.from_iterable(run(chunks))

    @cached_property
    def _plain(self) -> str:
        return json.dumps(self.problem.to_dict())


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
