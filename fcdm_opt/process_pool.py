"""Pieces of work that need nothing of one another, each in a process of its own: as many at a time as there are cores.

Such a process is a copy of this one as it stands: what was read is there, and only what comes out of the work is sent.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from multiprocessing.connection import Connection, wait
from multiprocessing.pool import ExceptionWithTraceback  # type: ignore[attr-defined]  # shown with what led to it
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, TypeVar

from fcdm_opt import pacing
from fcdm_opt.errors import FcdmError

Item = TypeVar("Item")
Result = TypeVar("Result")
Outcome = tuple[bool, Any]  # whether work was done, and its result or what it raised

WORTH = 100_000  # bytes of a file from which on reading it is worth a process

_allowed: list[bool] = []


def allow() -> None:
    """Let this process be copied: it is a command's own, and nobody else's threads and locks are in it."""
    _allowed.append(sys.platform == "linux")


def cores(most: int) -> int:
    """Return how many of so many pieces of work go on at a time; 1 where this process is not to be copied."""
    return max(1, min(len(os.sched_getaffinity(0)), most)) if any(_allowed) else 1


def each(work: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Callable[[], Result]]:
    """Yield for each item, in order, what returns the work's result, or raises what it raised.

    Results are sent as `pickle` does. Whoever takes no more ends the work that still goes on.
    """
    if cores(len(items)) == 1:
        yield from (partial(work, item) for item in items)
        return
    waiting, known = list(enumerate(items))[::-1], dict[int, Outcome]()
    running: dict[Any, tuple[int, BaseProcess]] = {}
    try:
        for number in range(len(items)):
            while number not in known:
                while waiting and len(running) < cores(len(items)):
                    place, item = waiting.pop()
                    end, process = _begun(work, item)
                    running[end] = place, process
                for ready in wait(running):
                    place, process = running.pop(ready)
                    known[place] = _received(ready, process)
            yield partial(_result, known.pop(number))
    finally:
        for _, process in running.values():
            process.terminate()
            process.join()


def both(work: Callable[[Item], Result], items: tuple[Item, Item], files: Iterable[Path]) -> tuple[Result, Result]:
    """Return the work's results of two items, that of the smaller file from a process beside; raises the first's error.

    A process is worth it where both files are large.
    """
    sizes = [path.stat().st_size if path.is_file() else 0 for path in files]
    small = int(sizes[1] < sizes[0])
    if cores(2) == 1 or sizes[small] < WORTH:
        return work(items[0]), work(items[1])
    end, process = _begun(work, items[small])
    try:
        outcomes = [_tried(work, items[1 - small]), _received(end, process)]
    finally:
        process.terminate()
        process.join()
    one, two = (_result(own) for own in outcomes[:: -1 if small == 0 else 1])
    return one, two


def _begun(work: Callable[[Any], Any], item: Any) -> tuple[Any, BaseProcess]:
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_worked, args=(work, item, theirs), daemon=True)
    process.start()
    theirs.close()
    return ours, process


def _received(end: Any, process: BaseProcess) -> Outcome:
    try:
        found: Outcome = end.recv()
    except EOFError:  # it ended without a word
        process.join()
        return False, FcdmError(f"a process ended with code {process.exitcode}")
    process.join()
    return found


def _worked(work: Callable[[Any], Any], item: Any, out: Connection) -> None:
    """Do a piece of work in this process, which ends with it; the other one is told of interrupts, and ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.disable()  # looking through all that was copied would copy it once more
    threading.Thread(target=_end_with_the_other, daemon=True).start()
    pacing.unheard()
    done, found = _tried(work, item)
    out.send((done, found if done else ExceptionWithTraceback(found, found.__traceback__)))


def _tried(work: Callable[[Any], Any], item: Any) -> Outcome:
    try:
        return True, work(item)
    except Exception as reason:
        return False, reason


def _end_with_the_other() -> None:
    other = multiprocessing.parent_process()
    assert other is not None
    wait([other.sentinel])
    os._exit(1)


def _result(outcome: Outcome) -> Any:
    done, found = outcome
    if not done:
        raise found
    return found
