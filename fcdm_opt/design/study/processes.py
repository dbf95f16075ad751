"""Processes that work points out, one at a time: where one is lost, it is known with which point.

joblib ends all its workers where one is lost, and Dask blames all that the lost one had been given. So whatever worker
of theirs has a point has it worked out in a process below itself. That is started without multiprocessing, and so
without loky: Dask's workers may have no children of theirs.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

from fcdm_opt.design.study.point import WORKER_LOST, Asked, Row, load, row
from fcdm_opt.errors import FcdmError
from fcdm_opt.threads import SINGLE

Work = Callable[[Asked], Row]

TRIES = 2  # how often a point is asked for whose process is lost: anything else may have ended it
IDLE = 60.0  # seconds without work after which a process ends: those of Dask's workers outlast a run
DEATH_SIGNAL = 1  # prctl's PR_SET_PDEATHSIG: the signal that Linux sends when the parent ends


class Processes(AbstractContextManager["Processes"]):
    """A process for each thread that asks; used in a `with` block.

    They end with this process, however that ends; on other systems than Linux, when they have done what they are at.
    `load` is what a process does first, without a time limit.
    """

    def __init__(self, load: Callable[[], None] = load) -> None:
        self._load = load
        self._of_thread = threading.local()
        self._started: list[_Process] = []
        self._loaded = self._closed = False
        self._starting, self._loading = threading.Lock(), threading.Lock()

    def __exit__(self, *reason: object) -> None:
        self.close()

    def answer(self, work: Work, limit: float | None, asked: Asked) -> Row:
        """Return the row that `work`, a function of a module, makes of a point within `limit` seconds.

        What it raises is raised here, and `FcdmError` where no process starts.
        """
        for _ in range(TRIES):
            process = getattr(self._of_thread, "process", None)
            if process is None or not process.lives:
                process = self._of_thread.process = self._start()
            answer: Row | None = process.ask(work, asked, limit=limit)
            if answer is not None:
                return answer
        reasons = "a crash, or no memory left" + (f", or more than {limit:g} s" if limit else "")
        return row(asked[0], WORKER_LOST, f"The process that worked on it ended, twice: {reasons}.")

    def close(self) -> None:
        """End all processes at once; no other one starts."""
        with self._starting:
            self._closed = True
            for process in self._started:
                process.end()

    def _start(self) -> _Process:
        with self._starting:
            if self._closed:
                raise FcdmError("the run has ended")
            process = _Process()
            self._started = [*(own for own in self._started if own.lives), process]
        with self._loading:  # one compiles, if that is to be done, and the others find it done
            first = not self._loaded
            if first:
                self._warm(process)
            self._loaded = True
        if not first:
            self._warm(process)
        return process

    def _warm(self, process: _Process) -> None:
        if process.ask(self._load) is None:
            raise FcdmError("the worker processes do not start, or end while they load this package")


class _Process:
    """A process that does one thing after the other."""

    def __init__(self) -> None:
        self._pipe, there = Pipe()
        with there:
            code = f"from {__name__} import _serve; _serve({there.fileno()}, {os.getpid()})"
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", code],
                env={**os.environ, **SINGLE, "PYTHONPATH": os.pathsep.join(sys.path)},
                pass_fds=[there.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,  # what libraries print would flood a terminal
            )

    @property
    def lives(self) -> bool:
        return self._process.poll() is None

    def ask(self, work: Callable[..., Any], *given: Any, limit: float | None = None) -> Any:
        """Return what a function gives, True for None; None where the process was lost, or took longer: it is ended."""
        # what the function raises is raised here
        try:
            self._pipe.send((work, given))
            answer = self._pipe.recv() if self._pipe.poll(limit) else None
        except (EOFError, OSError):
            answer = None
        if answer is None:
            self.end()
        if isinstance(answer, BaseException):
            raise answer
        return answer

    def end(self) -> None:
        self._process.kill()
        self._process.wait()


def _serve(handle: int, parent: int) -> None:
    """Do what is asked for, until there is nobody who asks. Keyboard interrupts are the parent's."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(DEATH_SIGNAL, signal.SIGKILL)  # inside compiled code too
    if os.getppid() != parent:
        return
    pipe = Connection(handle)
    with suppress(EOFError, OSError):
        while pipe.poll(IDLE):
            work, given = pipe.recv()
            try:
                answer = work(*given)
            except Exception as reason:
                answer = reason
            pipe.send(True if answer is None else answer)
