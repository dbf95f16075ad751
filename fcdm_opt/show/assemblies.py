"""Assemblies: the table of what moves how far, and the parts in space after their motions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.judge.placed_parts import gone_through
from fcdm_opt.problem.assembled import AssemblySolution
from fcdm_opt.show import Figure
from fcdm_opt.show.printing import CELL_WIDTH, print_rows, print_text, wrapped
from fcdm_opt.show.scene import parts_figure
from fcdm_opt.show.solved import SolvedCase
from fcdm_opt.show.tables import UNPROVED, failed_text, print_solutions, verdict_cell
from fcdm_opt.show.texts import CLOSED, NOTHING, amount_text, bound_line, bound_text
from fcdm_opt.show.verdict import deed_text

NUMBERS = ("scale", "amount", "total", "proved\nat least")


def print_answers(rows: Sequence[SolvedCase]) -> None:
    """Print one table for the cases of a file: of assemblies a row a moving part, and what is to be said of each."""
    if not isinstance(rows[0].solution, AssemblySolution):  # a file is of one kind
        return print_solutions(rows)
    lines = [cells for row in rows for cells in _cells(row.solution)]
    print_rows(lines, numbers=NUMBERS, optional=("weight",))
    for row in rows:
        solution, name = row.solution, row.solution.assembly.name
        if row.unproved:
            print_text(f"{name}: {UNPROVED}: {row.unproved}", indent="   ")
        if solution.status.name != "SOLVED":
            print_text(f"{name}: {solution.advice}{failed_text(solution)}", indent="   ")
        for told in (*solution.stages, *solution.active) if not solution.usable else solution.stages:
            print_text(f"{name}: {told}", indent="   ")
        for told in filter(None, (solution.doubt, *through(solution))):
            print_text(f"{name}: {told}", indent="   ")
    print_text()


def motion_texts(solution: AssemblySolution) -> dict[str, str]:
    """Return the motions as parameters, by part: "TX 0.0125 + TZ 0.055"; rounding left out."""
    motions = solution.assembly.motions
    return {part: motions[part].describe(kept) if kept else "-" for part, kept in _kept(solution).items()}


def _kept(solution: AssemblySolution) -> dict[str, list[float]]:
    """Return the values of each part's motion, 0 for rounding."""
    assembly, found = solution.assembly, dict[str, list[float]]()
    for part, motion in assembly.motions.items():
        weights = assembly.weights[part] * motion.weights(assembly.lengths[part])
        q = np.array([*solution.parameters.get(part, {}).values()])
        found[part] = [x if abs(w * x) > NOTHING * solution.amount else 0.0 for w, x in zip(weights, q, strict=False)]
    return found


def assembly_verdict(solution: AssemblySolution) -> str:
    """Return in a sentence what to move, and whether less would do."""
    if not solution.status.found:
        return solution.advice
    if solution.status.name == "OUTSIDE_FIT":
        return "does not fit: the only motions found take a part out of the place it is drawn in"
    if not solution.usable:
        return "not to be used: motions were found, but the judge refused them"
    assembly = solution.assembly
    moved = list[str]()
    for part, kept in _kept(solution).items():
        motion = assembly.motions[part]
        deeds = zip(motion.by_step(kept), motion.deeds(kept, unit=assembly.unit), strict=True) if any(kept) else ()
        moved += [deed_text(part, done)] if (done := [deed for own, deed in deeds if any(own)]) else []
    if not moved:
        return "leave all parts where they are: every contact is closed"
    proved = "smallest possible together (proved)" if solution.gap < CLOSED else bound_line(solution)
    least = solution.doubt or proved
    return "; ".join([*moved[:-1], f"{moved[-1]}: then every contact is closed", least, *through(solution)])


def through(solution: AssemblySolution) -> list[str]:
    """Return in words what parts go through on their straight way."""
    told = pacing.in_time(gone_through, solution, late=list[tuple[str, str]]()) if solution.usable else []
    return [f"straight there {one} goes through {other}, and no other way is looked for" for one, other in told]


def _cells(solution: AssemblySolution) -> list[dict[str, str]]:
    assembly, told = solution.assembly, motion_texts(solution)
    verdict = "-" if not solution.status.found else verdict_cell(solution)
    first = {
        "case": wrapped(assembly.name, CELL_WIDTH),
        "total": amount_text(solution.amount),
        "proved\nat least": bound_text(solution),
        "verified": verdict,
    }
    rows = list[dict[str, str]]()
    for part, motion in told.items():
        weight = assembly.weights[part]
        own = {
            "part": wrapped(part, CELL_WIDTH),
            "follows": wrapped(assembly.follows[part], CELL_WIDTH),
            "scale": f"{assembly.scales[part]:g}",
            "weight": f"{weight:g}" if weight != 1.0 else "",
            "motion found": motion.replace(" + ", " +\n").replace(", ", ",\n"),
            "amount": amount_text(solution.amounts.get(part)),
        }
        shown = first if not rows else dict.fromkeys(first, "")
        rows.append(
            {"case": shown["case"], **own, **{key: shown[key] for key in ("total", "proved\nat least", "verified")}}
        )
    return rows


def assembly_figure(solution: AssemblySolution, *, title: str = "") -> Figure:
    """Draw the parts as made, after their motions; as drawn where none were found."""
    assembly, bodies = solution.assembly, list[Body]()
    for part, body in assembly.bodies_made.items():
        made = body.scaled(assembly.scales[part])
        pose: Any = solution.transforms.get(part)
        bodies.append(made if pose is None else made.moved(pose))
    bodies += [keep_out.body for keep_out in assembly.keep_out]
    names = [f"{part}, fixed" if part in assembly.fixed else part for part in assembly.parts]
    names += [f"{keep_out.name}, keep-out" for keep_out in assembly.keep_out]
    found = f"amount {amount_text(solution.amount, assembly.unit)}" if solution.status.found else "no motions found"
    return parts_figure(bodies, names, unit=assembly.unit, title=title, caption=found)
