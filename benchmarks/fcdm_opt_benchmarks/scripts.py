"""What the scripts beside this package share: work timed in turns, work in pieces, and where it ran."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from fcdm_opt_benchmarks.record import machine, versions
from fcdm_opt_benchmarks.timing import timed

Work = Callable[[], Any]


def in_turns(works: Mapping[str, Work], rounds: int, patience: float = float("inf")) -> dict[str, list[float]]:
    """Return the seconds of each piece of work, timed in turns after one that does not count.

    What takes longer than `patience` seconds is timed once.
    """
    times: dict[str, list[float]] = {name: [] for name in works}
    for turn in range(rounds + 1):
        for name, work in works.items():
            if turn < 2 or times[name][0] <= patience:
                seconds, _ = timed(work)
                times[name] += [seconds] if turn else []
    return times


def in_pieces(work: Callable[..., Any], pieces: Sequence[Iterable[Any]], jobs: int) -> Iterator[Any]:
    """Yield what `work(*piece)` makes of every piece, in order, from several processes; a terminal is told how many."""
    from joblib import Parallel, delayed

    results = Parallel(n_jobs=jobs, return_as="generator")(delayed(work)(*piece) for piece in pieces)
    for done, result in enumerate(results, 1):
        if sys.stderr.isatty():
            print(f"\r{done} of {len(pieces)}", end="", file=sys.stderr, flush=True)
        yield result


def chunks(count: int, size: int) -> list[range]:
    """Return the numbers below `count` in pieces."""
    return [range(k, min(k + size, count)) for k in range(0, count, size)]


def describe() -> str:
    """Tell machine and versions in one sentence."""
    own = machine()
    packages = ", ".join(f"{name} {number}" for name, number in versions().items())
    return f"{own['processor']}, {own['cores']} cores, {own['system']}; {packages}."
