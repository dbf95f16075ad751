"""The stability map of one run: results, what is written of them, and what is wrong with ours.

Table "cases", one row for each case and method: question, family, name, method, ours, outcome ("right", "flagged",
"wrong", "hung", "crashed" or "not run"), error (relative, null without a number), reason, seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter

from fcdm_opt.show import save as save_figure
from fcdm_opt_benchmarks.record import BenchRun, Watch
from fcdm_opt_benchmarks.stability.failures import save
from fcdm_opt_benchmarks.stability.picture import stability_figure
from fcdm_opt_benchmarks.stability.run import BUDGETS, LIMITS, NOT_RUN, Result, stability
from fcdm_opt_benchmarks.stability.table import listed, summary, write_tables

FAULTS = ("wrong", "hung", "crashed")
STEP = 500  # answers between two lines that tell how far it is


@dataclass(frozen=True)
class StabilityRun:
    """All results of a run, and its record."""

    run: BenchRun
    results: Sequence[Result]

    @property
    def faults(self) -> list[Result]:
        """Ours that are silently wrong, hung or crashed."""
        return [own for own in self.results if own.ours and own.outcome in FAULTS]

    @property
    def text(self) -> str:
        """How many of each outcome by method, and every answer of ours that is not right, with the reason."""
        ours = listed(own for own in self.results if own.ours)
        count = f"Ours silently wrong, hung or crashed: {len(self.faults)}."
        return "\n\n".join([summary(self.results), "Ours that are not right:", ours, count])

    def write(self, folder: Path) -> list[Path]:
        """Write stability.json, stability.md, the map, and every failing input; return the files but the last."""
        made = [folder / "stability.json", write_tables(self.results, folder / "stability.md", about=self.run.about)]
        self.run.write(made[0])
        figure = stability_figure(self.results, title="Where methods fail", caption=self.run.caption)
        made += save_figure(figure, folder / "stability", small=True)
        save(self.results, folder)
        return made


def grid(*, quick: bool, seed: int, ours: bool = False, say: Callable[[str], None] = lambda text: None) -> StabilityRun:
    """Ask all methods all cases.

    Parameters
    ----------
    quick : bool
        The short form.
    seed : int
        Of what is drawn at random.
    ours : bool
        Ask our own methods alone.
    say : callable
        Is told how far it is.
    """
    started, start, watch = datetime.now(UTC), perf_counter(), Watch()

    def progress(done: int, count: int) -> None:
        if done % STEP == 0 or done == count:
            say(f"{done} of {count} answers")

    results = stability(quick, seed, ours=ours, progress=progress)
    settings = {"limit": LIMITS[quick], "budget": BUDGETS[quick]}
    settings["not_run"] = sum(own.outcome == NOT_RUN for own in results)
    seconds = perf_counter() - start
    tables = {"cases": [own.row for own in results]}
    return StabilityRun(
        BenchRun("stability", quick, seed, settings, started.isoformat(), seconds, watch.load(), tables), results
    )
