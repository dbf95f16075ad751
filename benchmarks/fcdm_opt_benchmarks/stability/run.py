"""Every case asked of every method that it applies to, each method in a process of its own.

A module of cases exports

    cases(quick, seed)      list of `HardCase`
    METHODS                 name -> function from `HardCase.data` to an answer; both plain JSON
    OURS                    names of those that are the toolkit's own
    applies(name, case)     whether a method can be asked
    judged(case, answer)    its `Grade`

A method that hangs is ended and a new process gets the next case; so it is where one dies. Loading libraries does not
count: a process is first asked what the method is known to answer. Ours go first and are asked all; of the others the
method that has used the least time goes next, and cases of a family at which a method hung come last: what the budget
does not suffice for is what most time was already given to, and it is listed as not run.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from importlib import import_module
from itertools import chain, zip_longest
from threading import Lock
from time import monotonic
from typing import Any

from fcdm_opt_benchmarks.record import Row
from fcdm_opt_benchmarks.stability.case import Grade, HardCase
from fcdm_opt_benchmarks.stability.process import CrashedError, HungError, Process

MODULES = tuple(f"{__package__}.{name}" for name in ("contacts", "bodies", "programs", "motions"))
LIMITS = {True: 40.0, False: 60.0}
"""Seconds a case, quick or not."""

BUDGETS = {True: 20.0, False: 1500.0}
"""Seconds in all, quick or not, after which no case is begun of a method that is not ours."""

SHARE, SHORTEST = 1.0, 4.0
"""A rival lets those go on that have used less after so much of an equal part of the budget, or these seconds."""

NOT_RUN = "not run"


@dataclass(frozen=True)
class Result:
    """What came of one case and one method.

    Attributes
    ----------
    case : HardCase
    module, method : str
        The method is `METHODS[method]` of the module.
    ours : bool
        Whether it is the toolkit's own.
    verdict : Grade or None
        None where it was not run.
    answer : object
        What the method gave, None where it gave nothing.
    seconds : float
        That the answer took; of one that hung or died, that was waited for it.
    skipped : str
        Why it was not run.
    """

    case: HardCase
    module: str
    method: str
    ours: bool
    verdict: Grade | None
    answer: Any = None
    seconds: float = 0.0
    skipped: str = ""

    @property
    def outcome(self) -> str:
        """That of the verdict, or "not run"."""
        return NOT_RUN if self.verdict is None else self.verdict.outcome

    @property
    def reason(self) -> str:
        """That of the verdict, or why it was not run."""
        return self.skipped if self.verdict is None else self.verdict.reason

    @property
    def row(self) -> Row:
        """Plain columns: question, family, name, method, ours, outcome, error (relative, or None), reason, seconds."""
        error = None if self.verdict is None else self.verdict.error
        return {
            "question": self.case.question,
            "family": self.case.family,
            "name": self.case.name,
            "method": self.method,
            "ours": self.ours,
            "outcome": self.outcome,
            "error": error,
            "reason": self.reason,
            "seconds": self.seconds,
        }


def stability(
    quick: bool,
    seed: int,
    *,
    jobs: int | None = None,
    limit: float | None = None,
    budget: float | None = None,
    progress: Callable[[int, int], None] | None = None,
    modules: Sequence[str] = MODULES,
    ours: bool = False,
) -> list[Result]:
    """Ask all methods all cases.

    Parameters
    ----------
    quick : bool
        About an eighth of the cases, of every family some, and shorter limits.
    seed : int
        Of what is drawn at random.
    jobs : int, optional
        Processes at a time; default one a core.
    limit, budget : float, optional
        Seconds a case, and in all; defaults `LIMITS` and `BUDGETS`.
    progress : callable, optional
        Called with the number of answers so far and in all.
    modules : sequence of str
        Dotted names of modules of cases.
    ours : bool
        Ask our own methods alone.

    Returns
    -------
    list of Result
        One for each case and method that applies to it, in the order of modules, cases and methods.
    """
    start = monotonic()
    queues, places = [], dict[tuple[str, str, str, str], int]()
    for name in modules:
        home = import_module(name)
        found = home.cases(quick, seed)
        methods = [method for method in home.METHODS if method in home.OURS or not ours]
        asked = {method: [case for case in found if home.applies(method, case)] for method in methods}
        queues += [_Queue(name, method, method in home.OURS, _mixed(own)) for method, own in asked.items() if own]
        for case in found:
            for method in methods:
                places.setdefault((name, case.family, case.name, method), len(places))
    limit = LIMITS[quick] if limit is None else limit
    _Lanes(queues, limit, progress).run(jobs or _cores(), BUDGETS[quick] if budget is None else budget, start)
    results = [result for queue in queues for result in queue.results]
    return sorted(results, key=lambda own: places[own.module, own.case.family, own.case.name, own.method])


def asked_alone(module: str, method: str, case: HardCase, *, limit: float) -> Result:
    """Ask one method one case, in a process of its own.

    Parameters
    ----------
    module, method : str
        The method is `METHODS[method]` of the module.
    case : HardCase
    limit : float
        Seconds.
    """
    queue = _Queue(module, method, method in import_module(module).OURS, [case])
    _Lanes([queue], limit, None).run(1, math.inf, monotonic())
    return queue.results[0]


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _mixed(cases: Sequence[HardCase]) -> list[HardCase]:
    """Return cases so that families take turns."""
    families = dict[str, list[HardCase]]()
    for case in cases:
        families.setdefault(case.family, []).append(case)
    return [case for case in chain.from_iterable(zip_longest(*families.values())) if case is not None]


# -------------------------------------------------------------------------------------------------------------- queues


@dataclass
class _Queue:
    """What a method still has to answer, and what it has answered."""

    module: str
    method: str
    ours: bool
    pending: list[HardCase]
    results: list[Result] = field(default_factory=list)
    used: float = 0.0
    lanes: int = 0
    hung: Counter[str] = field(default_factory=Counter)
    easy: Mapping[str, Any] | None = None  # what was answered soonest
    soonest: float = math.inf
    alone: bool = False  # the next case: a process died at it that had answered others

    def answered(self, case: HardCase, reply: Row) -> None:
        seconds = reply["seconds"]
        if seconds < self.soonest:
            self.easy, self.soonest = case.data, seconds
        verdict = _verdict(import_module(self.module), case, reply)
        self.done(case, verdict, answer=reply.get("answer"), seconds=seconds)

    def done(self, case: HardCase, verdict: Grade | None, **details: Any) -> None:
        self.results.append(Result(case, self.module, self.method, self.ours, verdict, **details))


class _Lanes:
    """Threads that each hold one process at a time."""

    def __init__(self, queues: Sequence[_Queue], limit: float, progress: Callable[[int, int], None] | None) -> None:
        self._queues, self._limit, self._progress = queues, limit, progress
        self._lock = Lock()
        self._total = sum(len(queue.pending) for queue in queues)
        self._ends, self._turn = {True: math.inf, False: math.inf}, math.inf  # of ours, and of the others

    def run(self, jobs: int, budget: float, start: float) -> None:
        """Work until nothing is left, or the budget, which counts from a time on, is used up."""
        self._ends[False] = start + budget
        self._turn = max(SHORTEST, SHARE * jobs * budget / max(1, len(self._queues)))
        with ThreadPoolExecutor(jobs) as pool:
            lanes = [pool.submit(self._lane) for _ in range(jobs)]
            try:
                for lane in lanes:
                    lane.result()
            finally:
                self._ends = {True: -math.inf, False: -math.inf}  # an error, or Ctrl-C: the lanes stop
        for queue in self._queues:
            for case in queue.pending:
                queue.done(case, None, skipped=f"the time in all, {budget:g} s, was used up")

    def _lane(self) -> None:
        while (queue := self._next()) is not None:
            start = monotonic()
            try:
                self._slice(queue)
            finally:
                with self._lock:
                    queue.used += monotonic() - start
                    queue.lanes -= 1

    def _next(self) -> _Queue | None:
        with self._lock:
            left = [queue for queue in self._queues if queue.pending and monotonic() < self._ends[queue.ours]]
            if not left:
                return None
            queue = min(left, key=lambda own: (not own.ours, own.lanes, own.used))
            queue.lanes += 1
            return queue

    def _case(self, queue: _Queue) -> HardCase | None:
        with self._lock:
            return queue.pending.pop(0) if queue.pending else None

    def _slice(self, queue: _Queue) -> None:
        """Work on a queue with one process, for a while, or until that process is of no more use."""
        try:
            process = self._started(queue)
        except (HungError, CrashedError) as reason:
            while (case := self._case(queue)) is not None:
                queue.done(case, None, skipped=f"does not start: {reason}")
            self._tell()
            return
        turn = math.inf if queue.ours else monotonic() + self._turn
        with process:
            while monotonic() < min(self._ends[queue.ours], turn) and (case := self._case(queue)) is not None:
                start, alone = monotonic(), not process.warm
                try:
                    reply = process.ask(case.data)
                except CrashedError as reason:
                    if not alone:  # what came before may have done it
                        with self._lock:
                            queue.pending.insert(0, case)
                            queue.alone = True
                    else:
                        queue.done(case, Grade("crashed", None, str(reason)), seconds=monotonic() - start)
                        self._tell()
                    return
                except HungError as reason:
                    queue.done(case, Grade("hung", None, str(reason)), seconds=monotonic() - start)
                    with self._lock:
                        queue.hung[case.family] += 1
                        queue.pending.sort(key=lambda own: queue.hung[own.family])
                    self._tell()
                    return
                if "missing" in reply:
                    queue.done(case, None, skipped=f"not installed: {reply['missing']}")
                else:
                    queue.answered(case, reply)
                self._tell()

    def _started(self, queue: _Queue) -> Process:
        with self._lock:
            alone, queue.alone = queue.alone, False
        if queue.easy is not None and not alone:
            try:
                return Process(queue.module, queue.method, self._limit, easy=queue.easy)
            except (HungError, CrashedError):
                pass
        return Process(queue.module, queue.method, self._limit)

    def _tell(self) -> None:
        if self._progress is not None:
            with self._lock:
                self._progress(sum(len(queue.results) for queue in self._queues), self._total)


def _verdict(home: Any, case: HardCase, reply: Row) -> Grade:
    if "crash" in reply:
        return Grade("crashed", None, reply["crash"])
    if "flag" in reply:
        return Grade("flagged", None, reply["flag"])
    answer = reply["answer"]
    if isinstance(answer, dict) and "flag" in answer:
        return Grade("flagged", None, str(answer["flag"]))
    try:
        verdict: Grade = home.judged(case, answer)
    except Exception as reason:  # an answer of another kind than was asked for, given without a word
        return Grade("wrong", None, f"not an answer: {type(reason).__name__}: {reason}")
    if verdict.outcome == "right" and verdict.error is not None and not math.isfinite(verdict.error):
        return Grade("wrong", None, verdict.reason or "not a number")  # no comparison with nan is true
    return verdict
