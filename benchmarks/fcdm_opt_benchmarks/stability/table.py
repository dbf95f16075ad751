"""The stability map in words: Markdown tables, ours that were flagged and why, and what was silently wrong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from fcdm_opt_benchmarks.record import table
from fcdm_opt_benchmarks.stability.failures import FOLDER, file_name
from fcdm_opt_benchmarks.stability.picture import LOOKS, QUESTIONS, WORST, OutcomeGrid, grids
from fcdm_opt_benchmarks.stability.run import NOT_RUN, Result

ORDER = tuple(LOOKS)
LONGEST = 160  # characters of a reason
BAD = ("wrong", "crashed", "hung")


def write_tables(results: Sequence[Result], path: Path, *, about: str = "") -> Path:
    """Write everything of this module to a Markdown file.

    Parameters
    ----------
    results : sequence of Result
    path : path
        Of the file; failures are named relative to its folder, as `failures.save` saves them.
    about : str
        Put first.
    """
    parts = ["# Where methods fail", about, summary(results)]
    parts += [f"## {QUESTIONS.get(grid.question, grid.question)}\n\n{grid_table(grid)}" for grid in grids(results)]
    parts += [
        "## Ours that are not right\n\n" + listed(result for result in results if result.ours),
        "## Others that are wrong, crash or hang\n\n" + examples(results),
        "## Not run\n\n" + not_run(results),
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n\n".join(part for part in parts if part) + "\n", encoding="utf-8")
    return path


def summary(results: Sequence[Result]) -> str:
    """Return a table of methods by question: how many of each outcome."""
    rows = []
    for grid in grids(results):
        for k, method in enumerate(grid.methods):
            total = sum((own for (_, name), own in grid.counts.items() if name == method), Counter[str]())
            name = f"**{method}**" if k < grid.ours else method
            rows.append([grid.question, name, *(str(total[outcome] or "") for outcome in ORDER)])
    return table(["question", "method", *ORDER], rows, left=None)


def grid_table(grid: OutcomeGrid) -> str:
    """Return one question's families by methods: the worst outcome, of how many."""
    rows = []
    for family in grid.families:
        cells = [family]
        for method in grid.methods:
            counts = grid.counts.get((family, method))
            if not counts:
                cells.append("")
                continue
            worst = next(name for name in WORST if counts[name])
            cells.append(f"{counts.total()}" if worst == "right" else f"{worst} {counts[worst]}/{counts.total()}")
        rows.append(cells)
    names = [f"**{name}**" if k < grid.ours else name for k, name in enumerate(grid.methods)]
    return table(["family", *names], rows, left=None)


def listed(results: Iterable[Result]) -> str:
    """Return a table of all results that are not right, each with its reason and file."""
    order = {outcome: k for k, outcome in enumerate(WORST)}
    bad = sorted((own for own in results if own.outcome != "right"), key=lambda own: order[own.outcome])
    rows = [[own.outcome, own.method, own.case.family, own.case.name, _short(own.reason), _link(own)] for own in bad]
    return table(["outcome", "method", "family", "case", "reason", "file"], rows, left=None) if rows else "None."


def examples(results: Sequence[Result]) -> str:
    """Return a table of what is wrong, crashed or hung by method and family: how many, and one of them."""
    groups = dict[tuple[str, str, str, str], list[Result]]()
    for own in results:
        if own.outcome in BAD and not own.ours:
            groups.setdefault((own.case.question, own.method, own.outcome, own.case.family), []).append(own)
    rows = []
    for (_, method, outcome, family), group in sorted(groups.items()):
        worst = max(group, key=lambda one: (one.verdict and one.verdict.error) or 0.0)
        example = f"{worst.case.name}: {_short(worst.reason)}"
        rows.append([method, family, outcome, str(len(group)), example, _link(worst)])
    return table(["method", "family", "outcome", "cases", "for example", "file"], rows, left=None) if rows else "None."


def not_run(results: Sequence[Result]) -> str:
    """Return how many cases were not run, by method and reason."""
    counts = Counter((own.case.question, own.method, own.reason) for own in results if own.outcome == NOT_RUN)
    rows = [[question, method, str(count), reason] for (question, method, reason), count in sorted(counts.items())]
    return table(["question", "method", "cases", "reason"], rows, left=None) if rows else "None: every case was run."


def _link(result: Result) -> str:
    if result.outcome == NOT_RUN:
        return ""
    name = file_name(result)
    return f"[{name[-13:-5]}]({FOLDER}/{name})"


def _short(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= LONGEST else line[: LONGEST - 3] + "..."
