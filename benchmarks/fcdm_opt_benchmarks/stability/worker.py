"""One method in a process of its own: `python -m fcdm_opt_benchmarks.stability.worker MODULE METHOD LIMIT`.

It reads cases as JSON, one a line, and writes as many lines: first `{"ready": true}`, then for each case one of

    {"answer": {...}, "seconds": s}    what the method gave
    {"flag": text, "seconds": s}       what it raised
    {"crash": text, "seconds": s}      the memory ran out
    {"missing": text}                  a library that the method needs is not installed, and how to install it

Whatever libraries print stays out of that: they find no standard input, and their standard output leads nowhere.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib import import_module
from time import perf_counter
from typing import Any

from fcdm_opt_benchmarks.library import package

MEMORY = 6 << 30
"""Bytes of address space: a greedy method dies alone."""

PATIENCE = 30.0
"""Seconds beyond twice a case's limit after which a worker ends by itself: nobody is there any more to stop it."""

LONGEST = 500  # characters of a message


def main(module: str, method: str, limit: float) -> None:
    """Answer cases until there are no more.

    Parameters
    ----------
    module : str
        Dotted name of a module with `METHODS`.
    method : str
        Key of them.
    limit : float
        Seconds that a case may take: the parent's to watch, see `PATIENCE`.
    """
    cases = os.fdopen(os.dup(0), encoding="utf-8")
    replies = os.fdopen(os.dup(1), "w", encoding="utf-8")
    null = os.open(os.devnull, os.O_RDWR)
    os.dup2(null, 0)
    os.dup2(null, 1)
    for kind, most in ((resource.RLIMIT_AS, MEMORY), (resource.RLIMIT_CORE, 0)):
        with suppress(ValueError, OSError):  # not every system has them
            resource.setrlimit(kind, (most, most))
    # the system's own end of a process: it works inside of libraries too
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, 2 * limit + 2 * PATIENCE)

    def write(reply: Mapping[str, Any]) -> None:
        replies.write(json.dumps(reply, default=_plain) + "\n")
        replies.flush()

    answer = import_module(module).METHODS[method]
    write({"ready": True})
    for line in cases:
        signal.setitimer(signal.ITIMER_REAL, 2 * limit + PATIENCE)
        write(_reply(answer, json.loads(line)))
        signal.setitimer(signal.ITIMER_REAL, 0)


def _reply(answer: Callable[[Any], Any], data: Any) -> dict[str, Any]:
    start = perf_counter()
    try:
        reply = {"answer": answer(data)}
        json.dumps(reply, default=_plain)
    except ModuleNotFoundError as reason:
        if (reason.name or "").partition(".")[0].startswith("fcdm_opt"):
            raise
        return {"missing": f"{reason}: pip install {package(reason.name or str(reason))}"}
    except MemoryError as reason:
        reply = {"crash": f"MemoryError: {reason}"[:LONGEST]}
    except Exception as reason:  # a library may raise anything: in its words it says that it has no answer
        reply = {"flag": f"{type(reason).__name__}: {' '.join(str(reason).split())}"[:LONGEST]}
    return {**reply, "seconds": perf_counter() - start}


def _plain(value: Any) -> Any:
    """Return what JSON has for an array or a number of numpy's."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"an answer of a kind that cannot be sent: {type(value).__name__}")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]))
