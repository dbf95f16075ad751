"""Where chunks of a study are worked out: in this process, or in processes of their own on this machine.

An engine is whatever meets `Engine`; the one for many machines is in `dask_engine`.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from itertools import islice
from types import TracebackType
from typing import Any, Protocol, Self

from fcdm_opt.design.study.point import Outcome, Payload, Row, evaluate, load
from fcdm_opt.errors import FcdmError

Work = Callable[[Payload], list[Row]]
Load = Callable[[bool], bool]

SINGLE = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
"""Environment of workers: one thread each, as there is one for every core."""

LOOK = 0.5
"""Seconds between two looks of a worker whether its parent is still there."""

PATIENCE = 20.0
"""Seconds that further workers wait, where no kernel is compiled yet, for the first one's first answer."""

DEATH_SIGNAL = 1  # prctl's PR_SET_PDEATHSIG: the signal that Linux sends when the parent ends


class Engine(Protocol):
    """Works out chunks; used in a `with` block."""

    @property
    def workers(self) -> int:
        """How many chunks are worked out at a time."""

    def __enter__(self) -> Self:
        """Get ready."""

    def __exit__(
        self, kind: type[BaseException] | None, reason: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the workers, at once where there is a reason."""

    def run(self, chunks: Iterable[Payload]) -> Iterator[Outcome]:
        """Yield each chunk with its rows, in any order; None where its worker was lost.

        Chunks are taken from the iterator as workers become free, as their size follows what is measured meanwhile.
        May be called again when all are done.
        """


class OwnProcess:
    """Works out one chunk after the other in this process: nothing to start, and easy to debug.

    What would end a worker ends the run; no time limit is possible.

    Parameters
    ----------
    work : callable
        Rows from a payload.
    """

    workers = 1

    def __init__(self, *, work: Work = evaluate) -> None:
        self._work = work

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, reason: BaseException | None, trace: TracebackType | None
    ) -> None:
        pass

    def run(self, chunks: Iterable[Payload]) -> Iterator[Outcome]:
        """Yield each chunk with its rows, see `Engine`."""
        for payload in chunks:
            yield payload, self._work(payload)


class LocalEngine:
    """Works out chunks in processes of this machine, kept by joblib's loky.

    Every worker is a pool of its own with one process: where one dies, it is known which chunk it held, and the others
    go on. Workers end with the process that started them, however that ends.

    Parameters
    ----------
    jobs : int
        How many processes at most: there are no more than chunks.
    work : callable
        Rows from a payload; a function of a module, which workers import.
    load : callable
        What a worker does first, with False; with True before it works under a time limit. Tells whether the worker
        can go to work without compiling what another one compiles just now.
    """

    def __init__(self, jobs: int, *, work: Work = evaluate, load: Load = load) -> None:
        self._jobs, self._work, self._load = jobs, work, load
        self._pool: list[_Worker] = []

    @property
    def workers(self) -> int:
        """How many processes at most."""
        return self._jobs

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, reason: BaseException | None, trace: TracebackType | None
    ) -> None:
        for worker in self._pool:
            worker.end(at_once=reason is not None)
        self._pool = []

    def run(self, chunks: Iterable[Payload]) -> Iterator[Outcome]:
        """Yield each chunk with its rows, see `Engine`; nothing is started where there is none."""
        source = iter(chunks)
        ahead = deque(islice(source, self._jobs))  # one for each worker, then one while they are busy
        if not ahead:
            return
        fresh = not self._pool
        self._pool += [_Worker(self._work, self._load) for _ in range(len(ahead) - len(self._pool))]
        idle = self._pool[:1] if fresh else list(self._pool)
        later = {worker.started: worker for worker in self._pool[len(idle) :]}
        under_way: dict[Future[Any], tuple[_Worker, Payload]] = {}
        outcomes: list[Outcome] = []
        loading: set[Future[Any]] = set(later)
        while True:
            while idle and ahead:
                worker, payload = idle.pop(), ahead.popleft()
                under_way[worker.ask(payload)] = worker, payload
                ahead.extend(islice(source, 0 if ahead else 1))
            yield from outcomes
            if not under_way:
                return
            outcomes = []
            done = wait([*under_way, *loading], PATIENCE if later else None, FIRST_COMPLETED).done
            for started in done & loading:
                loading.remove(started)
                if started.exception() is None and started.result():
                    idle.append(later.pop(started))
            for future in done & under_way.keys():
                worker, payload = under_way.pop(future)
                outcomes.append((payload, worker.answer(future)))
                idle.append(worker)
            if outcomes or not done:  # the others find compiled what the first one has compiled
                idle += later.values()
                later, loading = {}, set()


class _Worker:
    """One process, and another one in its place after it was lost."""

    def __init__(self, work: Work, load: Load) -> None:
        self._work, self._load = work, load
        self._start()

    def _start(self) -> None:
        from joblib.externals.loky import ProcessPoolExecutor

        # joblib would say on the terminal that it looked for a dead worker's children in vain
        warnings.filterwarnings("ignore", message="Failed to kill subprocesses")
        self._pool = ProcessPoolExecutor(max_workers=1, env=SINGLE, initializer=_enter, initargs=(os.getpid(),))
        self.started: Future[Any] = self._pool.submit(self._load, False)
        self._warm = False

    def ask(self, payload: Payload) -> Future[list[Row]]:
        """Have a chunk worked out; one at a time."""
        if payload["time_limit"] is not None and not self._warm:
            self._pool.submit(self._load, True)
        future: Future[list[Row]] = self._pool.submit(self._work, payload)
        return future

    def answer(self, future: Future[list[Row]]) -> list[Row] | None:
        """Return the rows, None where the process was lost; it is replaced then.

        Raises
        ------
        FcdmError
            Where no process starts.
        """
        from joblib.externals.loky.process_executor import BrokenProcessPool

        try:
            rows = future.result()
        except BrokenProcessPool as reason:
            if self.started.exception() is not None:
                raise FcdmError(f"the worker processes do not start: {reason}") from reason
            self.end(at_once=True)
            self._start()
            return None
        self._warm = True
        return rows

    def end(self, *, at_once: bool) -> None:
        """End the process: after its work, or at once."""
        self._pool.shutdown(wait=False, kill_workers=at_once)


def _enter(parent: int) -> None:
    """Make a new process a worker: quiet, single-minded, and gone when its parent is.

    Keyboard interrupts are the parent's. What libraries print leads nowhere: a terminal would be flooded.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(DEATH_SIGNAL, signal.SIGKILL)  # inside compiled code too
    if os.getppid() != parent:
        os._exit(1)
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    null = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(null, stream)
    os.close(null)


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(LOOK)
    os._exit(1)
