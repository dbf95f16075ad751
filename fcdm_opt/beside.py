"""Pieces of work that need nothing of one another, each in a process of its own: as many at a time as there are cores.

Such a process is a copy of this one as it stands: what was read is there, and only what comes out of the work is sent.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection, wait
from multiprocessing.pool import ExceptionWithTraceback  # type: ignore[attr-defined]  # shown with what led to it
from typing import Any, TypeVar

from fcdm_opt import pacing
from fcdm_opt.errors import FcdmError

Item = TypeVar("Item")
Result = TypeVar("Result")


def cores(most: int) -> int:
    """Return how many of so many pieces of work go on at a time; 1 where a process cannot be copied safely."""
    return max(1, min(len(os.sched_getaffinity(0)), most)) if sys.platform == "linux" else 1


def each(work: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Callable[[], Result]]:
    """Yield for each item, in order, what returns the work's result, or raises what it raised.

    Results are sent as `pickle` does. Whoever takes no more ends the work that still goes on.
    """
    if cores(len(items)) == 1:
        yield from (partial(work, item) for item in items)
        return
    context, waiting = multiprocessing.get_context("fork"), list(enumerate(items))[::-1]
    running: dict[Any, tuple[int, multiprocessing.context.ForkProcess]] = {}
    known: dict[int, tuple[bool, Any]] = {}
    try:
        for number in range(len(items)):
            while number not in known:
                while waiting and len(running) < cores(len(items)):
                    place, item = waiting.pop()
                    ours, theirs = context.Pipe(duplex=False)
                    process = context.Process(target=_worked, args=(work, item, theirs), daemon=True)
                    process.start()
                    theirs.close()
                    running[ours] = place, process
                for ready in wait(running):
                    place, process = running.pop(ready)
                    with suppress(EOFError):  # it ended without a word
                        known[place] = ready.recv()  # type: ignore[union-attr,call-arg,assignment]
                    process.join()
                    known.setdefault(place, (False, FcdmError(f"a process ended with code {process.exitcode}")))
            yield partial(_told, *known.pop(number))
    finally:
        for _, process in running.values():
            process.terminate()
            process.join()


def _worked(work: Callable[[Any], Any], item: Any, out: Connection) -> None:
    """Do a piece of work in this process, which ends with it; the other one is told of interrupts, and ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_other, daemon=True).start()
    pacing.unheard()
    try:
        told = True, work(item)
    except Exception as reason:
        told = False, ExceptionWithTraceback(reason, reason.__traceback__)
    out.send(told)


def _end_with_the_other() -> None:
    other = multiprocessing.parent_process()
    assert other is not None
    wait([other.sentinel])
    os._exit(1)


def _told(done: bool, found: Any) -> Any:
    if not done:
        raise found
    return found
