"""The parent's end of a worker: asks it one case at a time, and ends it where it hangs."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from tempfile import TemporaryFile
from time import monotonic
from typing import Any

import psutil

WORKER = "fcdm_opt_benchmarks.stability.worker"
START = 60.0
"""Seconds within which a worker must be ready."""

GRACE = 20.0
"""Seconds beyond the limit for a case that finds a process cold: libraries are loaded, kernels perhaps compiled."""

LAST_WORDS = 2000  # bytes of a dead worker's messages that are looked at
BLOCK = 1 << 16


class HungError(Exception):
    """No answer within the limit."""


class CrashedError(Exception):
    """The worker died; says by which signal and with what last words."""


class Process:
    """A worker; use it in a `with` block, which ends it.

    Parameters
    ----------
    module, method : str
        See `worker.main`.
    limit : float
        Seconds a case.
    easy : mapping, optional
        Data that the method is known to answer: asked first, the reply is dropped, so that the process is warm.

    Raises
    ------
    HungError, CrashedError
        Where it does not even start.
    """

    def __init__(self, module: str, method: str, limit: float, *, easy: Mapping[str, Any] | None = None) -> None:
        self.warm = False  # it has answered
        self._limit = limit
        self._words = TemporaryFile()  # noqa: SIM115
        self._buffer = b""
        command = [sys.executable, "-m", WORKER, module, method, repr(limit)]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._words,
            env=_environment(),
            start_new_session=True,  # what it starts ends with it
        )
        try:
            self._reply(START)
            if easy is not None:
                self.ask(easy)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *reason: object) -> None:
        self.close()

    def ask(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """Return the worker's reply to one case, see `worker`; after an error the process is of no more use.

        Parameters
        ----------
        data : mapping
            `HardCase.data`.

        Raises
        ------
        HungError, CrashedError
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(data).encode() + b"\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise CrashedError(self._end()) from None
        reply = self._reply(self._limit if self.warm else self._limit + GRACE)
        self.warm = True
        return reply

    def close(self) -> None:
        """End the worker and all that it started."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._words):
            with suppress(BrokenPipeError):
                if stream is not None:
                    stream.close()

    def _reply(self, seconds: float) -> dict[str, Any]:
        assert self._process.stdout is not None
        file, end, patience = self._process.stdout.fileno(), monotonic() + seconds, seconds / 2
        worked = self._worked()
        while b"\n" not in self._buffer:
            left = end - monotonic()
            if left <= 0 or not select.select([file], [], [], left)[0]:
                owed = min(patience, seconds - (self._worked() - worked))  # other programs had the machine meanwhile
                if owed <= 0:
                    raise HungError(f"no answer within {seconds:g} s")
                end, patience = monotonic() + owed, 0.0
                continue
            block = os.read(file, BLOCK)
            if not block:
                raise CrashedError(self._end())
            self._buffer += block
        line, _, self._buffer = self._buffer.partition(b"\n")
        reply: dict[str, Any] = json.loads(line)
        return reply

    def _worked(self) -> float:
        """Return the seconds that the worker has had of a processor."""
        return sum(psutil.Process(self._process.pid).cpu_times()[:2])

    def _end(self) -> str:
        """Say how the worker died."""
        try:
            code = self._process.wait(timeout=self._limit)
        except subprocess.TimeoutExpired:
            return "closed its output without an answer"
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        self._words.seek(0, os.SEEK_END)
        self._words.seek(max(0, self._words.tell() - LAST_WORDS))
        words = [line for line in self._words.read().decode(errors="replace").splitlines() if line.strip()]
        return f"{how}: {words[-1].strip()}" if words else how


def _environment() -> dict[str, str]:
    """Return the environment of workers: one thread each, as several run at a time, and the parent's module path."""
    own = {key: value for key, value in os.environ.items() if key != "PYTHONFAULTHANDLER"}
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return own | threads | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
