"""The smallest motion of convex pairs of 12 vertices, solved and verified, beside the rival methods' search for it.

    python benchmarks/bench_motions.py [--out DIR] [--seed 3] [--cases 10] [--rounds 7] [--certify]

Cases are drawn as for `compare_motions.py`, with the weighted amount; those without an answer of ours are left out. All
methods are warm: every one has run once on the case. In each round they run one after the other; a method that takes
longer than a second runs only once. Ours includes the verification, a rival's time does not. The best rival of a case
is the fastest whose motion the judge accepts and that is as small as ours, to 1e-6.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import fcdm_opt as fo
from fcdm_opt.show import new_figure, save
from fcdm_opt_benchmarks.method import Failure
from fcdm_opt_benchmarks.motions import RIVALS, answered, judged
from fcdm_opt_benchmarks.motions.cases import DrawnCase, draw
from fcdm_opt_benchmarks.record import Row, table
from fcdm_opt_benchmarks.scripts import describe, in_turns, parser, written

SAME = 1e-6  # relative: amounts that count as equal
PATIENCE = 1.0  # seconds beyond which a method runs once
MOST_DRAWN = 2000
RATIO = 20.0  # at least this much faster than the best rival


class Group(NamedTuple):
    """Cases of one kind, and what is asked of our median time, milliseconds; with `certify` of the time with proof."""

    name: str
    takes: Callable[[DrawnCase], bool]
    asked: float
    certify: bool = False


GROUPS = (
    Group("1 parameter", lambda case: case.labels["parameters"] == 1, 1.0),
    Group("2 parameters", lambda case: case.labels["parameters"] == 2, 3.0),
    Group("Free()", lambda case: case.motion == "free", 15.0),
    Group("2 parameters, certified", lambda case: case.labels["parameters"] == 2, 60.0, certify=True),
)


def measured(case: DrawnCase, group: Group, rounds: int) -> Row | None:
    """Time one case, medians in milliseconds; None where we have no answer to it, or it is met without motion.

    `rivals`: of those that are judged right, time and amount; `best`: the fastest that is as small as ours, and `ratio`
    its time over ours.
    """
    problem, verify = case.problem, list[float]()

    def own() -> fo.Solution:
        solution = fo.solve(problem, certify=group.certify)
        verify.append(1e3 * solution.seconds["verify"])
        return solution

    solution = own()
    if not solution.usable or not solution.amount > 0:
        return None
    works: dict[str, Callable[[], Any]] = {"": own}
    amounts = {}
    for name in () if group.certify else RIVALS:
        answer = answered(name, problem)
        if not isinstance(answer, Failure) and (judgement := judged(problem, answer.q)).usable:
            amounts[name], works[name] = judgement.amount, partial(answered, name, problem)
    times = {name: 1e3 * float(np.median(own)) for name, own in in_turns(works, rounds, PATIENCE).items()}
    least = [name for name, amount in amounts.items() if amount <= solution.amount * (1 + SAME)]
    best = min(least, key=times.__getitem__, default=None)
    return {
        "group": group.name,
        "command": case.command,
        "motion": case.motion,
        "goal": problem.goal,
        "stage": solution.stage,
        "amount": solution.amount,
        "gap": solution.gap,
        "ours": times[""],
        "verify": float(np.median(verify)),
        "rivals": {name: (times[name], amount) for name, amount in amounts.items()},
        "as small": least,
        "best": best,
        "ratio": math.nan if best is None else times[best] / times[""],
    }


def rows_of(group: Group, seed: int, count: int, rounds: int) -> list[Row]:
    """Measure some cases of a group."""
    rows: list[Row] = []
    for number in range(MOST_DRAWN):
        if len(rows) == count:
            break
        case = draw(seed, "convex", number)
        if case.problem.amount == "weighted" and group.takes(case):
            row = measured(case, group, rounds)
            rows += [] if row is None else [row]
    return rows


def _median(rows: Sequence[Row], key: str) -> str:
    values = [row[key] for row in rows if not math.isnan(row[key])]
    return f"{np.median(values):.3g}" if values else ""


def text(rows: Sequence[Row]) -> str:
    """Tell the results in Markdown."""
    summary, goals, each = [], [], []
    for group in GROUPS:
        mine = [row for row in rows if row["group"] == group.name]
        if not mine:
            continue
        ours, ratios = np.median([row["ours"] for row in mine]), _median(mine, "ratio")
        worst, fast = max(row["ours"] for row in mine), "met" if ours <= group.asked else "NOT met"
        enough = ratios and ("met" if float(ratios) >= RATIO else "NOT met")
        summary.append(
            [group.name, str(len(mine)), f"{ours:.3g}", f"{worst:.3g}", f"{group.asked:g}", fast, ratios, enough]
        )
        for goal in sorted({row["goal"] for row in mine}):
            own = [row for row in mine if row["goal"] == goal]
            goals.append([group.name, goal, str(len(own)), *(_median(own, key) for key in ("ours", "verify", "ratio"))])
    for row in rows:
        best, ratio = ("", "") if row["best"] is None else (row["rivals"][row["best"]][0], f"{row['ratio']:.3g}")
        numbers = [f"{row['amount']:.6g}", f"{row['gap']:.2g}", f"{row['ours']:.3g}", f"{row['verify']:.3g}"]
        rival = "" if row["best"] is None else f"{row['best']}: {best:.3g}"
        each.append([row["group"], row["motion"], row["goal"], row["stage"], *numbers, rival, ratio])
    load = ", ".join(f"{own:.2g}" for own in os.getloadavg())
    times = ["median ms", "of it verify ms", "best rival's time / ours, median"]
    head = ["", "cases", "median ms", "most ms", "asked ms", "", times[-1], f"at least {RATIO:g}"]
    heads = ["", "motion", "goal", "stage", "amount", "gap", "ours ms", "of it verify ms", "best rival, ms", "ratio"]
    about = f"{describe()} Load of the machine over 1, 5 and 15 minutes at the end: {load}."
    tables = [table(head, summary), table(["", "goal", "cases", *times], goals), _rivals(rows), table(heads, each)]
    return "\n\n".join([about, *tables])


def _rivals(rows: Sequence[Row]) -> str:
    """Tell for each rival and group its median time, and in how many cases it is as small as ours."""
    groups = [group.name for group in GROUPS if not group.certify]
    lines = []
    for name in RIVALS:
        line = [name]
        for group in groups:
            mine = [row for row in rows if row["group"] == group]
            found = [row["rivals"][name][0] for row in mine if name in row["rivals"]]
            same = sum(name in row["as small"] for row in mine)
            line += [f"{np.median(found):.3g}" if found else "", f"{same} of {len(mine)}"]
        lines.append(line)
    return table([""] + [word for group in groups for word in (f"{group}, ms", "as small")], lines)


def figure(rows: Sequence[Row]) -> Any:
    """Draw our time and every rival's of each case, by group; hollow where the rival's motion is larger than ours."""
    made = new_figure(9, 5)
    axes = made.subplots()
    places = {group: k for k, group in enumerate(dict.fromkeys(row["group"] for row in rows))}
    names = [name for name in RIVALS if any(name in row["rivals"] for row in rows)]
    width = 0.8 / (len(names) + 1)
    for k, name in enumerate(["", *names]):
        mine = [row for row in rows if not name or name in row["rivals"]]
        x = np.array([places[row["group"]] for row in mine]) + (k - len(names) / 2) * width
        times = [row["rivals"][name][0] if name else row["ours"] for row in mine]
        colour = f"C{k % 10}"
        fill = [colour if not name or name in row["as small"] else "none" for row in mine]
        axes.scatter(x, times, s=14, facecolors=fill, edgecolors=colour, label=name or "ours, verified")
    for group in GROUPS:
        if group.name in places:
            place = places[group.name]
            axes.hlines(group.asked, place - 0.45, place + 0.45, "black", "dashed", lw=0.8)
    axes.set(yscale="log", ylabel="time, ms")
    axes.set_xticks(list(places.values()), list(places))
    axes.set_title(
        "Smallest motion: median time of each case; dashed what is asked, hollow a larger motion", fontsize=10
    )
    axes.legend(fontsize=8, ncols=2)
    return made


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark from the command line."""
    options = parser(__doc__, "out/benchmarks")
    options.add_argument("--cases", type=int, default=10, help="of each group (%(default)s)")
    options.add_argument("--certify", action="store_true", help="with the group that is solved with proof")
    given = options.parse_args(arguments)
    rows: list[Row] = []
    for group in GROUPS:
        if given.certify or not group.certify:
            rows += rows_of(group, given.seed, given.cases, given.rounds)
    written(text(rows), given.out, "motions", seed=given.seed, rows=rows)
    save(figure(rows), Path(given.out) / "motions")
    return 0


if __name__ == "__main__":
    sys.exit(main())
