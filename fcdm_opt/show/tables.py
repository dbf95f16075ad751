"""What the command line prints: tables of curves and solutions, readable on a terminal and through a pipe."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from fcdm_opt.show.printing import CELL_WIDTH, console, print_head, print_rows, print_text, wrapped
from fcdm_opt.show.remarks import remarks
from fcdm_opt.show.texts import NOTHING, advised, amount_text, asked_text, bound_text, motion_text

if TYPE_CHECKING:
    from fcdm_opt.along.coherent_range import CoherentRange
    from fcdm_opt.along.contact_times import ContactTimes
    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.problem.solution import Solution
    from fcdm_opt.show.solved import SolvedCase

NUMBERS = ("published\namount", "found\namount", "proved\nat least", "new/old\npair", 'least\n"touch"')
SHARES = ("build", "solve", "prove", "verify", "check")  # of the time that a case takes
DOUBT_WIDTH = 12  # characters, of what is said below an amount


def slope(segment: Any) -> float:
    """Return d rho_2 / d rho_1 of a segment, infinite for a vertical one."""
    a, b, _ = segment.line
    return float(-a / b) if b else math.inf


def print_curves(
    name: str, title: str, note: str, curves: Sequence[tuple[DecisionCurve, list[str]]], *, unit: str = ""
) -> None:
    """Print the curve of each pair of bodies, with the cases that share it."""
    print_head(name, title, note, unit=unit)
    for curve, names in curves:
        (low_1, high_1), (low_2, high_2) = curve.box
        text = (
            f"{curve.movable.name}, movable, and {curve.static.name}, static; cases {', '.join(names)}: "
            f"{curve.status} in the box [{low_1:g}, {high_1:g}] x [{low_2:g}, {high_2:g}]"
        )
        print_text(text)
        proved, settled = curve.paths["float"], curve.paths["exact"]
        print_text(f"part pairs: {proved} proved in floats, {settled} settled in rational numbers")
        print_text()
        segments = [
            {
                "segment": f"S{s.index}" + (" (snug)" if s.snug else ""),
                "feature": _label(s.feature),
                **{name: f"{x:.6f}" for name, x in zip("abc", s.line, strict=True)},
                "from": _point(s.start),
                "to": _point(s.end),
                "slope": f"{slope(s):.6f}" if s.line[1] else "vertical",
            }
            for s in curve.segments
        ]
        if segments:
            print_rows(segments, numbers=("a", "b", "c", "slope"))
            print_text()
        points = [
            {
                "switching point": f"SW{p.index}",
                "rho": _point(p.rho),
                "kind": p.kind,
                "contact": "\n".join(map(_label, p.contact_features)),
                "at": "\n".join(map(_point, p.contacts)),
            }
            for p in curve.switching_points
        ]
        if points:
            print_rows(points)
            print_text()


def _label(feature: Any) -> str:
    """Return a feature's label, on two lines where faces with many vertices make it long."""
    label: str = feature.label
    return label if len(label) <= 2 * CELL_WIDTH else label.replace("; ", ";\n  ")


def _point(values: Iterable[float]) -> str:
    return ", ".join(f"{x:.6f}" for x in values)


def print_solutions(name: str, title: str, note: str, rows: Sequence[SolvedCase]) -> None:
    """Print one table for the cases of a file, the advice where a case needs some, and where the time went."""
    print_head(name, title, note, unit=rows[0].solution.problem.unit)
    lines = [_cells(row) for row in rows]
    columns = [column for column in lines[0] if any(line[column] for line in lines)]
    kept = [{column: line[column] for column in columns} for line in lines]
    print_rows(kept, numbers=NUMBERS)
    print_text()
    for row in rows:
        solution = row.solution
        if solution.status.name != "SOLVED":
            failed = solution.certificate.failed if solution.certificate and solution.status.found else ()
            checks = f" Failed: {', '.join(check.name for check in failed)}." if failed else ""
            print_text(f"{solution.problem.name}: {advised(row)}{checks}", indent="   ")
        for remark in remarks(solution):
            print_text(f"{solution.problem.name}: {remark}", indent="   ")
    asked = [row.solution.problem for row in rows]
    bodies = [
        body for each in asked for body in (each.movable, each.static, *(keep_out.body for keep_out in each.keep_out))
    ]
    for text in dict.fromkeys(f"{body.name}: {note}" for body in bodies for note in body.notes if note):
        print_text(text, indent="   ")
    stages = {name: sum(row.solution.seconds.get(name, 0.0) for row in rows) for name in SHARES}
    total = sum(stages.values())
    shares = ", ".join(f"{name} {1e3 * t:.0f} ms ({t / total:.0%})" for name, t in stages.items() if total and t)
    console().print(f"time of {len(rows)} case{'s' * (len(rows) > 1)}: {shares or 'not measured'}\n")


def _cells(row: SolvedCase) -> dict[str, str]:
    """Return the table's cells for one case; a column that is empty for every case is left out."""
    solution, problem = row.solution, row.solution.problem
    ratio = () if solution.rho is None else solution.rho / problem.nominal_pair
    gap = 0.0 if abs(solution.pair_gap) <= NOTHING * problem.size else solution.pair_gap  # rounding
    off = f"\n{gap:+.3g}" if math.isfinite(gap) else ""
    judged = solution.status.found and solution.certificate is not None
    motion = motion_text(solution, unit=False)  # said once above the table
    return {
        "case": wrapped(problem.name, CELL_WIDTH),
        "require-\nment": wrapped(asked_text(problem), CELL_WIDTH),
        "goal": problem.goal,
        "motion found": motion.replace(" + ", " +\n").replace(", ", ",\n").replace("Screw ", "Screw\n"),
        "published\namount": "" if row.published_amount is None else amount_text(row.published_amount),
        "found\namount": amount_text(solution.amount)
        + (f"\n{wrapped(solution.doubt, DOUBT_WIDTH)}" if solution.doubt else ""),
        "proved\nat least": bound_text(solution),
        "new/old\npair": "\n".join(f"{x:.6f}" for x in ratio) or "-",
        "pair made": solution.pair_state + off,
        'least\n"touch"': amount_text(row.touch_amount) if problem.goal == "beyond" else "",
        "verified": _verdict(solution) if judged else "-",
    }


def _verdict(solution: Solution) -> str:
    return "outside\nthe fit" if solution.status.name == "OUTSIDE_FIT" else "yes" if solution.usable else "no"


def print_ranges(name: str, title: str, note: str, rows: Sequence[tuple[CoherentRange, ContactTimes]]) -> None:
    """Print the coherent range of each case, with the events at both ends, and when the pair made touches."""
    print_head(name, title, note, unit=rows[0][0].problem.unit)
    lines = []
    for coherent, _ in rows:
        problem = coherent.problem
        for end, event in zip(("low", "high"), coherent.events, strict=True):
            at = problem.motion.describe(event.x * coherent.direction) if math.isfinite(event.x) else "-"
            lines.append(
                {
                    "case": wrapped(problem.name, CELL_WIDTH) if end == "low" else "",
                    "end": end,
                    "x": f"{event.x:.12g}",
                    "motion there": at.replace(" + ", " +\n"),
                    "event": event.kind + ("\n(grazing)" if event.grazing else ""),
                    "off by\nat most": f"{event.error:.1g}" if event.error else "",
                    "no longer the contact": "\n".join(map(_label, event.features)),
                    "takes over": "\n".join(map(_label, event.successors)),
                }
            )
    print_rows(lines, numbers=("x",))
    print_text()
    for coherent, times in rows:
        problem = coherent.problem
        tracked = " & ".join(feature.label for feature in coherent.features)
        along = problem.motion.describe(coherent.direction, unit=problem.unit)
        print_text(f"{problem.name}: x in multiples of {along}; {tracked}")
        for end, event in zip(("low", "high"), coherent.events, strict=True):
            print_text(f"   {end}: {event.what}", indent="      ")
        if not coherent.proved:
            print_text("   a condition touches zero at rest: what is near there is not proved")
        states = ", ".join(f"{span.state} {span.low:.9g} to {span.high:.9g}" for span in times.spans)
        print_text(f"   pair made ({times.pair[0]:.6g}, {times.pair[1]:.6g}): {states}", indent="      ")
    print_text()
