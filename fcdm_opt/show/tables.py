"""What the command line prints: tables of curves and solutions, readable on a terminal and through a pipe."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.tolerance.problem import Problem
    from fcdm_opt.tolerance.solution import Solution

PIPED_WIDTH, TEXT_WIDTH, CELL_WIDTH = 200, 110, 16
"""Columns of a table that is not printed on a terminal (more than any needs: nothing is folded), of text, of a name."""


@dataclass(frozen=True)
class SolvedCase:
    """A case after solving it, with what its row sets beside it.

    Attributes
    ----------
    solution : Solution
    published_amount : float or None
        Amount of the reference motion that the file gives.
    touch_amount : float or None
        Least amount for goal "touch" with the same motions, beside goal "beyond".
    """

    solution: Solution
    published_amount: float | None
    touch_amount: float | None


def slope(segment: Any) -> float:
    """Return d rho_2 / d rho_1 of a segment, infinite for a vertical one."""
    a, b, _ = segment.line
    return float(-a / b) if b else math.inf


def _signs(problem: Problem) -> str:
    return "(" + ",".join("+" if sign > 0 else "-" if sign < 0 else "0" for sign in problem.signs) + ")"


def motion_text(solution: Solution) -> str:
    """Return the motion found in words."""
    values = list(solution.parameters.values())
    return solution.problem.motion.describe(values) if values else "-"


def asked_text(problem: Problem) -> str:
    """Return requirement and signs, or the target."""
    if problem.requirement:
        return f"{problem.requirement} {_signs(problem)}"
    return f"target {problem.target[0]:.6g}, {problem.target[1]:.6g}"



def console(*, stderr: bool = False) -> Any:
    """Return a rich console; wide enough for everything where it is not a terminal."""
    from rich.console import Console

    terminal = (sys.stderr if stderr else sys.stdout).isatty()
    return Console(
        stderr=stderr, width=None if terminal else PIPED_WIDTH, markup=False, highlight=False, emoji=False,
        soft_wrap=not terminal,
    )


def _table(*columns: str, numbers: Sequence[str] = ()) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False, collapse_padding=True, show_edge=False)
    for column in columns:
        table.add_column(column, overflow="fold", justify="right" if column in numbers else "left", vertical="top")
    return table


def _print_table(out: Any, table: Table) -> None:
    """Print a table, closer set where the terminal is too narrow for it."""
    if out.measure(table, options=out.options.update(width=PIPED_WIDTH)).maximum > out.width:
        table.padding = 0
    out.print(table)


def _print_text(out: Any, text: str, indent: str = "") -> None:
    out.print(_wrapped(text, min(TEXT_WIDTH, out.width), indent))


def _print_head(out: Any, name: str, title: str, note: str) -> None:
    out.print(f"{name}: {title}" if title else name, style="bold")
    if note:
        _print_text(out, note)
    out.print()


def _wrapped(text: str, width: int, indent: str = "") -> str:
    from textwrap import fill

    return fill(" ".join(text.split()), width, subsequent_indent=indent)


def print_curves(name: str, title: str, note: str, curves: Sequence[tuple[DecisionCurve, list[str]]]) -> None:
    """Print the curve of each pair of bodies, with the cases that share it."""
    out = console()
    _print_head(out, name, title, note)
    for curve, names in curves:
        (low_1, high_1), (low_2, high_2) = curve.box
        text = (
            f"{curve.movable.name}, movable, and {curve.static.name}, static; cases {', '.join(names)}: "
            f"{curve.status} in the box [{low_1:g}, {high_1:g}] x [{low_2:g}, {high_2:g}]"
        )
        _print_text(out, text)
        out.print()
        if not curve.segments:
            continue
        segments = _table("segment", "feature", "a", "b", "c", "from", "to", "slope", numbers=("a", "b", "c", "slope"))
        for s in curve.segments:
            segments.add_row(
                f"S{s.index}" + (" (snug)" if s.snug else ""), _label(s.feature), *(f"{x:.6f}" for x in s.line),
                _point(s.start), _point(s.end), f"{slope(s):.6f}" if s.line[1] else "vertical",
            )
        _print_table(out, segments)
        out.print()
        if curve.switching_points:
            points = _table("switching point", "rho", "kind", "contact", "at")
            for p in curve.switching_points:
                points.add_row(
                    f"SW{p.index}", _point(p.rho), p.kind, "\n".join(map(_label, p.contact_features)),
                    "\n".join(map(_point, p.contacts)),
                )
            _print_table(out, points)
            out.print()


def _label(feature: Any) -> str:
    """Return a feature's label, on two lines where faces with many vertices make it long."""
    label: str = feature.label
    return label if len(label) <= 2 * CELL_WIDTH else label.replace("; ", ";\n  ")


def _point(values: Iterable[float]) -> str:
    return ", ".join(f"{x:.6f}" for x in values)


def print_solutions(name: str, title: str, note: str, rows: Sequence[SolvedCase]) -> None:
    """Print one table for the cases of a file, the advice where a case needs some, and where the time went."""
    out = console()
    _print_head(out, name, title, note)
    lines = [_cells(row) for row in rows]
    columns = [column for column in lines[0] if any(line[column] for line in lines)]
    table = _table(*columns, numbers=("published\namount", "found\namount", "new/old\npair", 'least\n"touch"'))
    for line in lines:
        table.add_row(*(line[column] for column in columns))
    _print_table(out, table)
    out.print()
    for row in rows:
        solution = row.solution
        if solution.status.name != "SOLVED":
            failed = solution.certificate.failed if solution.certificate and solution.status.found else ()
            checks = f" Failed: {', '.join(check.name for check in failed)}." if failed else ""
            _print_text(out, f"{solution.problem.name}: {solution.status.value}{checks}", indent="   ")
    stages = {name: sum(row.solution.seconds.get(name, 0.0) for row in rows) for name in ("build", "solve", "verify")}
    total = sum(stages.values())
    shares = ", ".join(f"{name} {1e3 * t:.0f} ms ({t / total:.0%})" for name, t in stages.items() if total)
    out.print(f"time of {len(rows)} case{'s' * (len(rows) > 1)}: {shares or 'not measured'}\n")


def _cells(row: SolvedCase) -> dict[str, str]:
    """Return the table's cells for one case; a column that is empty for every case is left out."""
    solution, problem = row.solution, row.solution.problem
    ratio = () if solution.rho is None else solution.rho / problem.nominal_pair
    gap = f"\n{solution.pair_gap:+.3g}" if math.isfinite(solution.pair_gap) else ""
    judged = solution.status.found and solution.certificate is not None
    return {
        "case": _wrapped(problem.name, CELL_WIDTH),
        "require-\nment": _wrapped(asked_text(problem), CELL_WIDTH),
        "goal": problem.goal,
        "motion found": motion_text(solution).replace(" + ", " +\n").replace(", ", ",\n").replace("Screw ", "Screw\n"),
        "published\namount": "" if row.published_amount is None else amount_text(row.published_amount),
        "found\namount": amount_text(solution.amount),
        "new/old\npair": "\n".join(f"{x:.6f}" for x in ratio) or "-",
        "pair made": solution.pair_state + gap,
        'least\n"touch"': amount_text(row.touch_amount) if problem.goal == "beyond" else "",
        "verified": ("yes" if solution.usable else "no") if judged else "-",
    }


def amount_text(amount: float | None) -> str:
    """Return an amount to five digits."""
    return "-" if amount is None or not math.isfinite(amount) else f"{amount:.5g}"
