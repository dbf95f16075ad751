"""The smallest motion of convex pairs of 12 vertices, solved and verified, beside the rival methods' search for it.

    python benchmarks/bench_motions.py [--out DIR] [--seed 3] [--cases 10] [--rounds 7] [--certify]

Cases are drawn as for `compare_motions.py`, with the weighted amount; those without an answer of ours are left out. All
methods are warm: every one has run once on the case. In each round they run one after the other; a method that takes
longer than a second runs only once. Ours includes the verification, a rival's time does not. The best rival of a case
is the fastest whose motion the judge accepts and that is as small as ours, to 1e-6.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import fcdm_opt as fo
from fcdm_opt_benchmarks.method import Failure
from fcdm_opt_benchmarks.motions import RIVALS, answered, judged
from fcdm_opt_benchmarks.motions.cases import DrawnCase, draw
from report import describe, machine, table, versions

SAME = 1e-6  # relative: amounts that count as equal
PATIENCE = 1.0  # seconds beyond which a method runs once
MOST_DRAWN = 2000
RATIO = 20.0  # at least this much faster than the best rival


@dataclass(frozen=True)
class Group:
    """Cases of one kind, and what is asked of our median time, milliseconds; with `certify` of the time with proof."""

    name: str
    takes: Callable[[DrawnCase], bool]
    target: float
    certify: bool = False


GROUPS = (
    Group("1 parameter", lambda case: case.labels["parameters"] == 1, 1.0),
    Group("2 parameters", lambda case: case.labels["parameters"] == 2, 3.0),
    Group("Free()", lambda case: case.motion == "free", 15.0),
    Group("2 parameters, certified", lambda case: case.labels["parameters"] == 2, 60.0, certify=True),
)


@dataclass(frozen=True)
class Row:
    """One case: medians over the rounds, milliseconds; `rivals` of those that are judged right, with their amounts."""

    group: str
    command: str
    motion: str
    goal: str
    stage: str
    amount: float
    gap: float | None
    ours: float
    verify: float
    rivals: dict[str, tuple[float, float]]

    @property
    def best(self) -> str | None:
        """The fastest rival whose motion is as small as ours."""
        same = {name: ms for name, (ms, amount) in self.rivals.items() if amount <= self.amount * (1 + SAME)}
        return min(same, key=same.__getitem__, default=None)

    @property
    def ratio(self) -> float:
        """Its time over ours; nan where there is none."""
        return math.nan if self.best is None else self.rivals[self.best][0] / self.ours


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """Return milliseconds, and what was made."""
    start = perf_counter()
    made = work()
    return 1e3 * (perf_counter() - start), made


def measure(case: DrawnCase, group: Group, rounds: int) -> Row | None:
    """Time one case; None where we have no answer to it, or it is met without motion."""
    problem = case.problem

    def own() -> fo.Solution:
        return fo.solve(problem, certify=True) if group.certify else fo.solve(problem)

    solution = own()
    if not solution.usable or not solution.amount > 0:
        return None
    works: dict[str, Callable[[], Any]] = {"": own}
    amounts = {}
    times: dict[str, list[float]] = {"": []}
    for name in RIVALS if not group.certify else ():
        work = partial(answered, name, problem)
        took, answer = timed(work)
        if not isinstance(answer, Failure) and (judgement := judged(problem, answer.q)).usable:
            amounts[name], times[name] = judgement.amount, [took] if took > 1e3 * PATIENCE else []
            if took <= 1e3 * PATIENCE:
                works[name] = work
    verify = []
    for _ in range(rounds):
        for name, work in works.items():
            took, made = timed(work)
            times[name].append(took)
            if not name:
                verify.append(1e3 * made.seconds["verify"])
    rivals = {name: (float(np.median(times[name])), amount) for name, amount in amounts.items()}
    return Row(
        group.name,
        case.command,
        case.motion,
        problem.goal,
        solution.stage,
        solution.amount,
        getattr(solution, "gap", None),
        float(np.median(times[""])),
        float(np.median(verify)),
        rivals,
    )


def cases(group: Group, seed: int, count: int, rounds: int) -> list[Row]:
    """Measure some cases of a group."""
    rows: list[Row] = []
    for number in range(MOST_DRAWN):
        if len(rows) == count:
            break
        case = draw(seed, "convex", number)
        if (
            case.problem.amount == "weighted"
            and group.takes(case)
            and (row := measure(case, group, rounds)) is not None
        ):
            rows.append(row)
    return rows


def text(rows: Sequence[Row]) -> str:
    """Tell the results in Markdown."""
    lines, summary = [], []
    for row in rows:
        best = "" if row.best is None else f"{row.best}: {row.rivals[row.best][0]:.3g}"
        gap = "" if row.gap is None else f"{row.gap:.2g}"
        numbers = [gap, f"{row.ours:.3g}", f"{row.verify:.3g}", best, "" if row.best is None else f"{row.ratio:.3g}"]
        lines.append([row.group, row.motion, row.goal, row.stage, f"{row.amount:.6g}", *numbers])
    for group in GROUPS:
        mine = [row for row in rows if row.group == group.name]
        if not mine:
            continue
        ours, ratios = float(np.median([row.ours for row in mine])), [row.ratio for row in mine if row.best is not None]
        ratio = f"{np.median(ratios):.3g}" if ratios else ""
        worst = max(row.ours for row in mine)
        enough = "" if not ratios else "met" if np.median(ratios) >= RATIO else "NOT met"
        summary.append(
            [
                *(group.name, str(len(mine)), f"{ours:.3g}", f"{worst:.3g}", f"{group.target:g}"),
                *("met" if ours <= group.target else "NOT met", ratio, enough),
            ]
        )
    load = ", ".join(f"{own:.2g}" for own in os.getloadavg())
    head = [
        "",
        "cases",
        "median ms",
        "most ms",
        "asked ms",
        "",
        "best rival's time / ours, median",
        f"at least {RATIO:g}",
    ]
    each = ["", "motion", "goal", "stage", "amount", "gap", "ours ms", "of it verify ms", "best rival, ms", "ratio"]
    about = f"{describe()} Load of the machine over 1, 5 and 15 minutes at the end: {load}."
    return "\n\n".join([about, table(head, summary), _goals(rows), _rivals(rows), table(each, lines)])


def _goals(rows: Sequence[Row]) -> str:
    """Tell the medians by goal within each group."""
    lines = []
    for group in GROUPS:
        for goal in dict.fromkeys(sorted(row.goal for row in rows if row.group == group.name)):
            mine = [row for row in rows if row.group == group.name and row.goal == goal]
            ratios = [row.ratio for row in mine if row.best is not None]
            times = [f"{np.median([getattr(row, name) for row in mine]):.3g}" for name in ("ours", "verify")]
            ratio = f"{np.median(ratios):.3g}" if ratios else ""
            lines.append([group.name, goal, str(len(mine)), *times, ratio])
    return table(["", "goal", "cases", "median ms", "of it verify ms", "best rival's time / ours, median"], lines)


def plot(rows: Sequence[Row], path: Path) -> None:
    """Draw our time and every rival's of each case, by group; hollow where the rival's motion is larger than ours."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 5), layout="constrained")
    places = {group.name: k for k, group in enumerate(GROUPS) if any(row.group == group.name for row in rows)}
    names = [name for name in RIVALS if any(name in row.rivals for row in rows)]
    width = 0.8 / (len(names) + 1)
    for k, name in enumerate(["", *names]):
        at = (k - len(names) / 2) * width
        mine = [row for row in rows if not name or name in row.rivals]
        x = np.array([places[row.group] + at for row in mine])
        times = np.array([row.rivals[name][0] if name else row.ours for row in mine])
        small = np.array([not name or row.rivals[name][1] <= row.amount * (1 + SAME) for row in mine], dtype=bool)
        drawn = axes.scatter(x[small], times[small], s=14, label=name or "ours, verified")
        axes.scatter(x[~small], times[~small], s=14, facecolors="none", edgecolors=drawn.get_facecolor())
    for group in GROUPS:
        if group.name in places:
            axes.hlines(group.target, places[group.name] - 0.45, places[group.name] + 0.45, "black", "dashed", lw=0.8)
    axes.set_yscale("log")
    axes.set_ylabel("time, ms")
    axes.set_xticks(list(places.values()), list(places))
    axes.set_title(
        "Smallest motion: median time of each case; dashed what is asked, hollow a larger motion", fontsize=10
    )
    axes.legend(fontsize=8, ncols=2)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def _rivals(rows: Sequence[Row]) -> str:
    """Tell for each rival and group its median time, and in how many cases it is as small as ours."""
    groups = [group.name for group in GROUPS if not group.certify]
    lines = []
    for name in RIVALS:
        line = [name]
        for group in groups:
            mine = [row for row in rows if row.group == group]
            found = [row.rivals[name] for row in mine if name in row.rivals]
            same = sum(row.rivals[name][1] <= row.amount * (1 + SAME) for row in mine if name in row.rivals)
            line += [f"{np.median([ms for ms, _ in found]):.3g}" if found else "", f"{same} of {len(mine)}"]
        lines.append(line)
    head = [""] + [word for group in groups for word in (f"{group}, ms", "as small")]
    return table(head, lines)


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks"))
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--cases", type=int, default=10, help="of each group (%(default)s)")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--certify", action="store_true", help="with the group that is solved with proof")
    given = parser.parse_args(arguments)
    rows: list[Row] = []
    for group in GROUPS:
        if given.certify or not group.certify:
            rows += cases(group, given.seed, given.cases, given.rounds)
    told = text(rows)
    print(told)
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "motions.md").write_text(told + "\n")
    data = {"seed": given.seed, "machine": machine(), "versions": versions(), "rows": [asdict(row) for row in rows]}
    plot(rows, given.out / "motions.png")
    (given.out / "motions.json").write_text(json.dumps(data, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
