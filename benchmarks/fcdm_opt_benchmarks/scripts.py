"""What the scripts beside this package share: work timed in turns, work in pieces, and what they print and write."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from fcdm_opt.plain import finite
from fcdm_opt_benchmarks.record import machine, versions
from fcdm_opt_benchmarks.timing import timed

Work = Callable[[], Any]


def parser(document: str | None, out: str, seed: int = 3, rounds: int = 7) -> argparse.ArgumentParser:
    """Return the options that scripts share, with the first line of their text."""
    made = argparse.ArgumentParser(description=(document or "").split("\n")[0])
    made.add_argument("--out", type=Path, default=Path(out), help="folder (%(default)s)")
    made.add_argument("--seed", type=int, default=seed, help="of all that is drawn by lot (%(default)s)")
    made.add_argument("--rounds", type=int, default=rounds, help="timed calls (%(default)s)")
    return made


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


def written(text: str, folder: Path, name: str, **data: Any) -> None:
    """Print a text, and write it and the data, with machine and versions, as NAME.md and NAME.json."""
    print(text)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.md").write_text(text + "\n", encoding="utf-8")
    record = finite({**data, "machine": machine(), "versions": versions()})
    (folder / f"{name}.json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
