"""Least motions at single places in the box of sizes, each solved and judged once, and what holds them."""

from __future__ import annotations

import json
import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from time import time
from typing import Any, NamedTuple, TypeVar

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.along.holding import Holding
from fcdm_opt.curve.features import Feature, is_within
from fcdm_opt.design.sizes import box_over, chosen_sizes
from fcdm_opt.errors import InputError, expected
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.task import Task
from fcdm_opt.plain import plain
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.assembly_file import scene_of
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import SCALES, Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import IMPOSSIBLE, Bounded, Status
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT

REFINED = 0.5  # share of budget and time after which no edge is split for its error alone
CHUNK = 16  # places that a process is handed at once

Made = tuple[float, ...]
Result = TypeVar("Result")


@dataclass(frozen=True, order=True)
class ActiveSet:
    """What holds a motion: sizes that share it make a region of the map."""

    # "motion", "already satisfied", "no motion", "no motion found" (nor proved impossible), "outside the fit",
    # "not verified" or "undecided": where a map was cut off before it told which of the others holds
    kind: str
    # labels of the features that are in contact after the motion, or as near as they may be
    features: tuple[str, ...] = ()
    active: tuple[str, ...] = ()  # limits that are reached, and what else holds the motion besides the features

    def __str__(self) -> str:
        return "; ".join((*self.features, *self.active)) or self.kind

    def is_part_of(self, other: ActiveSet) -> bool:
        """Tell whether another set holds by all that this one does, and more."""
        own, its = ({*each.features, *each.active} for each in (self, other))
        return self.kind == other.kind and own < its


SATISFIED, NOTHING, REJECTED = ActiveSet("already satisfied"), ActiveSet("no motion"), ActiveSet("not verified")
OUTSIDE, UNDECIDED, NONE_FOUND = map(ActiveSet, ("outside the fit", "undecided", "no motion found"))
MOTIONLESS = {NOTHING, NONE_FOUND, REJECTED, OUTSIDE}


class Sample(NamedTuple):
    """A least motion: `held` by an active set; `values`, (1 + k,), are its amount and parameters, nan without one."""

    held: ActiveSet
    values: Array


Asking = Generator[list[Array], list[Sample], Result]
"""A search that yields places, gets the samples there, and returns its result: many such are run side by side."""


def asked(scene: Scene, made: Sequence[float] | Array, over: Sequence[str] = SCALES) -> Scene:
    """Return the question for some scales, or deviations of sizes, all others as they are made."""
    return scene.with_sizes(dict(zip(over, map(float, made), strict=True)))


def sample_at(scene: Scene, made: Made, over: Sequence[str] = SCALES) -> Sample:
    """Return the least motion for some sizes."""
    solution = solve(asked(scene, made, over), effort="quick")
    values = [solution.amount, *solution.coordinates.values()] if solution.usable else [math.nan]
    return Sample(active_set(solution), np.resize(values, 1 + len(scene.coordinates)))


@lru_cache(maxsize=1)
def _read(text: str) -> Scene:
    return scene_of(json.loads(text))


def sample_of(text: str, made: Made, over: Sequence[str], end: float) -> Sample | None:
    """Return the sample of a scene in plain data, None where it is not there by `end`: what a worker process does."""
    remaining = end - time()
    if remaining <= 0.0:
        return None
    with pacing.within(remaining if math.isfinite(remaining) else None, share=1.0):
        return sample_within(_read(text), made, over)


def sample_within(scene: Scene, made: Made, over: Sequence[str]) -> Sample | None:
    """Return the sample at some sizes, None where the time given is over before it is there."""
    try:
        return None if pacing.over() else sample_at(scene, made, over)
    except pacing.TimeOverError:
        return None


@dataclass(eq=False)
class Sampler:
    """Finds least motions, in `jobs` processes, and remembers them.

    Places are relative to the box: (0, ..., 0) is its lower, (1, ..., 1) its upper corner. After as many samples
    as `budget`, or when of the time given (`pacing.within`) as little is left as finishing takes, it is `spent`.
    """

    scene: Scene
    box: Array
    budget: int
    jobs: int = 1
    over: Sequence[str] = SCALES
    known: dict[Made, Sample] = field(default_factory=dict)
    _given: float = field(default_factory=pacing.remaining)

    @cached_property
    def weights(self) -> tuple[float, ...]:
        """Weights of the parameters in the amount, nothing for an amount that is not the weighted one."""
        return tuple(own.weight for own in self.scene.coordinates) if self.scene.amount == "weighted" else ()

    @property
    def late(self) -> bool:
        """Whether the time that refining may take is used up."""
        return self._time >= 1.0

    @property
    def spent(self) -> bool:
        """Whether the budget or the time is used up."""
        return self.effort >= 1.0

    @property
    def effort(self) -> float:
        """The share of the budget, or of the time, that is used up."""
        return max(len(self.known) / self.budget, self._time)

    @property
    def short(self) -> str:
        """Which of budget and time is the shorter, in words; with some left what it is kept for."""
        late = self._time >= len(self.known) / self.budget
        given = f"{pacing.SEARCHED:.0%} of the time given, {pacing.given():.3g} s," if late else f"{self.budget} solves"
        short = f"{given} {'is short' if late else 'are too few'}"
        return short if self.spent else f"half of {given} is for boundaries of regions alone"

    @property
    def rough(self) -> bool:
        """Whether so little is left that simplices are finished as they are."""
        return self.effort >= REFINED

    @property
    def _time(self) -> float:
        if self._given == math.inf:
            return 0.0
        return (1.0 - pacing.remaining() / self._given) / pacing.SEARCHED if self._given > 0.0 else 1.0

    def made(self, place: Any) -> Array:
        """Return the sizes at a place, or at several, (..., k)."""
        place = np.asarray(place, dtype=float)
        return np.asarray(self.box[:, 0] * (1.0 - place) + self.box[:, 1] * place)

    def scales(self, place: Array) -> dict[str, float]:
        """Return the scales of all parts at a place, by the names that the scene has for parts."""
        return self.scene.scales_at(dict(zip(self.over, self.made(place).tolist(), strict=True)))

    def samples(self, places: Sequence[Array], *, last: bool = False) -> list[Sample | None]:
        """Return the samples at some places; None where the time for refining, with `last` all, is too short."""
        asked = [tuple(own) for own in self.made(np.reshape(places, (-1, len(self.over)))).tolist()]
        missing = [own for own in dict.fromkeys(asked) if own not in self.known]
        solved = zip(missing, self._solved(missing, last), strict=True)
        self.known.update({own: sample for own, sample in solved if sample is not None})
        return [self.known.get(own) for own in asked]

    def _solved(self, missing: list[Made], last: bool) -> list[Sample | None]:
        remaining = pacing.remaining()
        if not last and remaining < math.inf:
            remaining -= (1.0 - pacing.SEARCHED) * self._given
        if remaining <= 0.0:
            return [None] * len(missing)
        if self.jobs == 1 or len(missing) < 2 * self.jobs:
            with pacing.within(remaining if remaining < math.inf else None, share=1.0):
                return [self._sample(own, len(missing) - k) for k, own in enumerate(missing)]
        from joblib import Parallel, delayed

        run = Parallel(self.jobs, backend="loky", batch_size=CHUNK, inner_max_num_threads=1)
        end = time() + remaining  # the wall clock is that of the other processes too
        return run(delayed(sample_of)(self._plain, own, self.over, end) for own in missing)

    def _sample(self, made: Made, waiting: int) -> Sample | None:
        """Return the sample at some sizes, None where it takes all the time, of the first ones its share."""
        share = 1.0 if self.known else 1.0 / waiting
        with pacing.part_of(f"mapping, {len(self.known)} sizes solved"), pacing.sharing(share):
            return sample_within(self.scene, made, self.over)

    @cached_property
    def _plain(self) -> str:
        return json.dumps(self.scene.to_dict())


def covered(scene: Scene, box: Any, over: Any = None) -> tuple[tuple[str, ...], Array]:
    """Return which sizes a map is over, see `chosen_sizes`, and the box of them that it covers.

    Without a `box`, (k, 2), it is what the tolerances leave open. Raises `InputError` for what has no map.
    """
    expected(scene, (Problem, Assembly), "problem")
    if any(problem.goal == "beyond" for problem in scene.relations.values()):
        what = "the amount of this goal jumps wherever the deviation changes sign, so it has no map"
        raise InputError(what, key="goal", found="beyond", allowed='"touch", "clear", "at" or "seat"')
    if scene.resolution is not None and len(scene.resolution):
        what = "a motion in whole steps jumps from size to size, so it has no map"
        raise InputError(what, key="resolution", found=plain(scene.resolution), allowed="a problem without resolution")
    names = chosen_sizes(scene, over)
    made = box_over(scene, names, box)
    if (np.ptp(made, axis=1) <= DEFAULT.snap * np.abs(made).max(axis=1)).any():
        allowed = "low < high, for each size"
        raise InputError("a box this narrow has no map", key="box", found=made.tolist(), allowed=allowed)
    return names, made


def active_set(solution: Bounded) -> ActiveSet:
    """Return what holds the motion of a solution, read off the geometry: the same whichever stage found it."""
    if solution.status is Status.OUTSIDE_FIT:
        return OUTSIDE
    if not solution.usable:
        return REJECTED if solution.status.found else NOTHING if solution.status in IMPOSSIBLE else NONE_FOUND
    if solution.amount == 0.0:
        return SATISFIED
    scene, q = solution.question, np.array([*solution.coordinates.values()])
    features, sides, limits, held = list[str](), list[str](), list[str](), list[str]()
    slack = DEFAULT.touch * scene.size
    for x, own in zip(q.tolist(), scene.coordinates, strict=True):
        for limit, which in zip(own.limits, ("lower", "upper"), strict=True):
            limits += [f"{which} limit of {own.name}"] * (abs(x - limit) * own.weight <= slack)
    kinked = scene.amount != "weighted"  # the weighted amount is known by its motion
    for pair, problem in scene.relations.items():
        head = "" if problem is scene else f"{' - '.join(pair)}: "
        holding = Holding(task := Task.of(problem), q, problem.limits)
        known = problem.tracked_features if task.tracked or (task.joints and task.goal != FIT) else ()
        features += [f"{head}{label}" for label in _met(holding, known)]
        sides += [f"{head}{side}" for side in _side(task)] if kinked else []
        if task.tracked:
            names = {rate.name for group in holding.groups() for rates in group for rate in rates}
            held += sorted(f"{head}{name}" for name in names if "limit of" not in name)
    return ActiveSet("motion", tuple(sorted(features)), (*sides, *limits, *held))


def _side(task: Task) -> Iterator[str]:
    """Yield which side of contact the pair is on at rest: the amount, not the motion, has a kink where it touches."""
    if task.must_touch:
        yield "closes a gap" if task.gap(task.rest) > 0 else "removes an overlap"
    elif task.tracked:
        gaps = task.line_gaps(task.rest)[1]
        if len(gaps) == 1:
            yield "closes a gap" if gaps[0] > 0 else "removes an overlap"


def _met(holding: Holding, known: Sequence[Feature]) -> list[str]:
    """Return all known features, and of part pairs as near as they may be those that are no part of a flush one."""
    task, found = holding.task, {-1: [("", feature) for feature in known]}
    for parts, feature in holding.near_features() if np.isfinite(task.needs).any() else ():
        keep_out = task.obstacles[parts[1]].keep_out
        found.setdefault(keep_out, []).append(("" if keep_out < 0 else f"{task.named(parts)} ", feature))
    labels = [
        f"{prefix}{feature.label}"
        for each in found.values()
        for prefix, feature in each
        if feature in known
        or not any(is_within(feature, other) for _, other in each if other.kind == "F1F2" and other != feature)
    ]
    return list(dict.fromkeys(labels))
