"""Times of methods that answer the same questions in turns, so that a drifting machine hurts all alike.

What is timed is one call for a few questions, divided by their number. No question is asked twice of a method, so that
nothing it remembers helps it. What depends on the subject alone is its set-up and timed for itself; a method that puts
its set-up off until the first question is found out, since that answer then takes longer than all later ones.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from fcdm_opt.errors import FcdmError
from fcdm_opt_benchmarks.method import Ask, Failure, Method

LATE = 4.0
"""A first answer that takes this many times the slowest later one, and `NOTICEABLE` seconds more, held set-up."""
NOTICEABLE = 1e-4
SLOW = 3.0
"""A first answer may take this many times a method's patience before it is the only one."""
LEAST = 1e-9
"""Seconds that an answer is taken to last at least, where their number a call is chosen."""
YARDSTICK = 60
"""Unknowns of the linear system that is solved once a round, to see whether the machine drifts."""


@dataclass(frozen=True)
class TimedScene:
    """A subject and the questions about it.

    Attributes
    ----------
    name : str
    labels : mapping
        What tells it from other scenes: columns of the table.
    subject : object
        What methods may prepare for.
    question : callable
        k -> question k; every method gets the same ones, in order, each of them made anew.
    """

    name: str
    labels: Mapping[str, Any]
    subject: Any
    question: Callable[[int], Any]


@dataclass(frozen=True)
class TimingPlan:
    """How long to measure.

    Attributes
    ----------
    rounds : int
        Timed calls a method at most.
    call : float
        Seconds that one call should last; fast methods get more questions a call.
    most : int
        Questions a call at most.
    patience : float
        Seconds for one method in one scene, after which it sits out the rounds that are left; a method whose first
        answer takes `SLOW` times longer is not asked again.
    longest : float
        Seconds of a first answer beyond which a method and setting is left out of later scenes, which is said.
    """

    rounds: int
    call: float
    most: int
    patience: float
    longest: float = float("inf")

    @property
    def questions(self) -> int:
        """So many are asked of a method at most: the first, those of pacing, in calls that double, and the rounds'."""
        return 1 + (self.rounds + 3) * self.most


@dataclass(eq=False)
class Timing:
    """What one method at one setting took and gave in a scene.

    Attributes
    ----------
    method : Method
    setting : str
    refused : str or None
        Why it was not asked.
    setup, first : float
        Seconds of its set-up, and of its first answer.
    seconds : list of float
        Of each timed call, a question.
    answers : list
        To questions 0, 1, ...
    """

    method: Method
    setting: str
    refused: str | None = None
    setup: float = 0.0
    first: float = 0.0
    seconds: list[float] = field(default_factory=list)
    answers: list[Any] = field(default_factory=list)

    @property
    def quartiles(self) -> tuple[float, float, float]:
        """First quartile, median and third quartile of the seconds an answer; its first one where it is the only."""
        low, median, high = np.percentile(self.seconds or [self.first], (25, 50, 75))
        return float(low), float(median), float(high)

    @property
    def times(self) -> dict[str, float]:
        """Median and quartiles as columns of a table, and the number of timed calls."""
        return {**dict(zip(("low", "seconds", "high"), self.quartiles, strict=True)), "rounds": len(self.seconds)}

    @property
    def late_setup(self) -> float:
        """Seconds of set-up that were put off until the first question."""
        if not self.seconds or self.first < LATE * max(self.seconds) or self.first < max(self.seconds) + NOTICEABLE:
            return 0.0
        return self.first - self.quartiles[1]


@dataclass(eq=False)
class _Asked:
    """A method in the course of a scene."""

    measured: Timing
    ask: Ask
    spent: float
    pace: float

    def paced(self, scene: TimedScene, plan: TimingPlan) -> None:
        """Ask until a call is as long as planned: of few questions, what a call costs by itself counts for too much."""
        count = 1
        while self.pace * count < plan.call / 2 and count < plan.most and self.spent < plan.patience:
            count = self._call(scene, plan)

    def round(self, scene: TimedScene, plan: TimingPlan) -> None:
        """Ask the next questions, and time the call."""
        self._call(scene, plan)
        self.measured.seconds.append(self.pace)

    def _call(self, scene: TimedScene, plan: TimingPlan) -> int:
        """Ask the next questions; learn the pace, and return their number."""
        answers = self.measured.answers
        count, done = int(np.clip(plan.call / self.pace, 1, plan.most)), len(answers)
        took, found = timed(self.ask, [scene.question(k) for k in range(done, done + count)])
        self.spent += took
        self.pace = max(took / count, LEAST)
        answers += found
        return count


def measured(
    scene: TimedScene,
    methods: Sequence[Method],
    plan: TimingPlan,
    rng: np.random.Generator,
    yardstick: list[float],
    left_out: Mapping[tuple[str, str], str] | None = None,
) -> list[Timing]:
    """Ask all methods at all their settings about a scene, in turns.

    Parameters
    ----------
    scene : TimedScene
    methods : sequence of Method
        Warm: each has been set up and asked once, about another scene (see `warmed`).
    plan : TimingPlan
    rng : Generator
        Draws the order of each round.
    yardstick : list of float
        Gets the seconds that one and the same piece of work takes, once a round.
    left_out : mapping, optional
        (method, setting) -> why it is not asked.
    """
    found, asked = [], []
    for method in methods:
        reason = method.refuses(scene.subject)
        for setting, value in method.settings.items():
            own = Timing(method, setting, reason or (left_out or {}).get((method.name, setting)))
            found.append(own)
            if own.refused is None and (started := _started(own, scene, value)) is not None:
                asked.append(started)
    for each in asked:
        each.paced(scene, plan)
    for _ in range(plan.rounds):
        yardstick.append(_yardstick())
        for k in rng.permutation(len(asked)):
            if asked[k].spent < plan.patience * (1.0 if asked[k].measured.seconds else SLOW):
                asked[k].round(scene, plan)
    return found


def warmed(scenes: Sequence[TimedScene], methods: Sequence[Method]) -> None:
    """Set up every method, at one setting, for the scenes it takes, and ask: libraries load and kernels compile."""
    for scene in scenes:
        for method in methods:
            if method.refuses(scene.subject) is None:
                ask = _prepared(method, scene.subject, next(iter(method.settings.values())))
                if not isinstance(ask, FcdmError):
                    answered(ask, [scene.question(0)])


def _started(own: Timing, scene: TimedScene, value: Any) -> _Asked | None:
    own.setup, ask = timed(_prepared, own.method, scene.subject, value)
    if isinstance(ask, FcdmError):
        own.refused = str(ask)
        return None
    own.first, answers = timed(answered, ask, [scene.question(0)])
    own.answers += answers
    return _Asked(own, lambda questions: answered(ask, questions), own.first, max(own.first, LEAST))


def _prepared(method: Method, subject: Any, value: Any) -> Ask | FcdmError:
    """Return the prepared method; our own error where it takes no such subject, or its library is not installed."""
    try:
        return method.prepare(subject, value)
    except FcdmError as reason:
        return reason
    except Exception as reason:  # whatever a rival library raises: it fails, the others go on
        failure = Failure(f"{type(reason).__name__}: {reason}")
        return lambda questions: [failure] * len(questions)


def answered(ask: Ask, questions: Sequence[Any]) -> list[Any]:
    """Return a method's answers, a `Failure` for each where the call raises or gives another number of them."""
    try:
        answers = list(ask(questions))
    except Exception as reason:
        return [Failure(f"{type(reason).__name__}: {reason}")] * len(questions)
    if len(answers) != len(questions):
        return [Failure(f"{len(answers)} answers to {len(questions)} questions")] * len(questions)
    return answers


def timed(work: Callable[..., Any], *arguments: Any) -> tuple[float, Any]:
    """Return seconds and what was made; the garbage collector waits."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        start = perf_counter()
        made = work(*arguments)
        return perf_counter() - start, made
    finally:
        if collecting:
            gc.enable()


def _yardstick() -> float:
    matrix = np.eye(YARDSTICK) + np.arange(YARDSTICK**2, dtype=np.float64).reshape(YARDSTICK, YARDSTICK) / YARDSTICK**2
    np.linalg.solve(matrix, matrix)
    start = perf_counter()
    for _ in range(4):
        np.linalg.solve(matrix, matrix)
    return perf_counter() - start
