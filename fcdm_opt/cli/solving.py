"""`curve`, `solve`, `range`: questions about the cases of problem files."""

from __future__ import annotations

import math
from collections.abc import Iterable
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fcdm_opt.cli.common import (
    BAD_INPUT,
    NO_MOTION,
    NOT_VERIFIED,
    SOLVED,
    AsJson,
    Cases,
    Files,
    Out,
    album_in,
    finish,
    opened_files,
    say,
)
from fcdm_opt.errors import InputError

if TYPE_CHECKING:
    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.show.tables import SolvedCase
    from fcdm_opt.tolerance.problem import Problem
    from fcdm_opt.tolerance.ranges.coherent_range import CoherentRange
    from fcdm_opt.tolerance.ranges.contact_times import ContactTimes
    from fcdm_opt.tolerance.solution import Solution


def curve_command(files: Files, as_json: AsJson = False, out: Out = None, case: Cases = None) -> None:
    """Print the decision curve of each pair of bodies: segments, switching points, status."""
    from fcdm_opt.show.tables import print_curves

    opened = opened_files(files, case or ())
    document, codes = [], [BAD_INPUT for file in opened if file.error]
    pictures = album_in(out)
    for file in opened:
        found = _distinct_curves(file.problems)
        document.append({**file.head(), "curves": [{"cases": names, **_curve_data(curve)} for curve, names in found]})
        if not as_json and not file.error:
            print_curves(file.path.name, file.title, file.note, found)
        if pictures:
            for number, (curve, _) in enumerate(found, 1):
                suffix = f"-pair{number}" if len(found) > 1 else ""
                pictures.add_curve(f"{file.path.stem}{suffix}", file.name, curve)
    codes += [BAD_INPUT] if pictures and pictures.failed else []
    finish(document if as_json else None, codes)


def solve_command(
    files: Files,
    certify: Annotated[
        bool, typer.Option("--certify", help="Prove how small a motion can be at all, and have the proof checked.")
    ] = False,
    as_json: AsJson = False,
    out: Out = None,
    case: Cases = None,
) -> None:
    """Find the smallest motion of each case, verify it, and print one table a file."""
    from rich.progress import track

    from fcdm_opt.show.tables import console, print_solutions

    opened = opened_files(files, case or ())
    document, codes = [], [BAD_INPUT for file in opened if file.error]
    pictures = album_in(out)
    for file in opened:
        rows, cases = [], []
        notes = console(stderr=True)
        for problem in track(
            file.problems, file.path.name, console=notes, transient=True, disable=not notes.is_terminal
        ):
            try:
                row = _solved(problem, certify)
            except InputError as reason:
                error = str(reason.within(file=file.path, key=f"case {problem.name!r}"))
                say(f"error: {error}")
                codes.append(BAD_INPUT)
                cases.append({"problem": problem.to_dict(), "error": error})
                continue
            rows.append(row)
            cases.append(_case_data(row))
            codes.append(_code(row.solution))
            if pictures:
                pictures.add_solution(file.path.stem, file.name, row.solution)
        document.append({**file.head(), "cases": cases})
        if rows and not as_json:
            print_solutions(file.path.name, file.title, file.note, rows)
    codes += [BAD_INPUT] if pictures and pictures.failed else []
    finish(document if as_json else None, codes)


def range_command(
    files: Files,
    direction: Annotated[
        str | None,
        typer.Option(
            "--direction",
            metavar="NAME=VALUE,...",
            help="Motion that x multiplies, for instance TZ=1,RZ_deg=2; default: the only parameter, or the published "
            "motion.",
        ),
    ] = None,
    as_json: AsJson = False,
    out: Out = None,
    case: Cases = None,
) -> None:
    """Print how far the tracked features stay the contact along a motion, and what ends that on both sides."""
    from fcdm_opt.show.tables import print_ranges

    opened = opened_files(files, case or ())
    document, codes = [], [BAD_INPUT for file in opened if file.error]
    pictures = album_in(out)
    for file in opened:
        rows: list[tuple[CoherentRange, ContactTimes]] = []
        cases: list[dict[str, Any]] = []
        for problem in file.problems:
            try:
                row = _ranged(problem, direction)
            except InputError as reason:
                error = str(reason.within(file=file.path, key=f"case {problem.name!r}"))
                say(f"error: {error}")
                codes.append(BAD_INPUT)
                cases.append({"name": problem.name, "error": error})
                continue
            rows.append(row)
            cases.append({"name": problem.name, **row[0].to_dict(), "contact_times": row[1].to_dict()})
            if pictures:
                pictures.add_range(file.path.stem, file.name, row[0])
        document.append({**file.head(), "cases": cases})
        if rows and not as_json:
            print_ranges(file.path.name, file.title, file.note, rows)
    codes += [BAD_INPUT] if pictures and pictures.failed else []
    finish(document if as_json else None, codes)


def _solved(problem: Problem, certify: bool) -> SolvedCase:
    """Solve a case, and beside goal "beyond" the assembly question with the same motions."""
    from fcdm_opt.show.tables import SolvedCase
    from fcdm_opt.tolerance.certificate import verify
    from fcdm_opt.tolerance.solver import solve

    solution = solve(problem, certify=certify)
    if solution.evidence is not None:
        start = perf_counter()
        certificate = verify(solution, proof=True)
        seconds = {**solution.seconds, "check": perf_counter() - start}
        solution = solution.with_certificate(certificate, seconds)
    published = None
    if problem.published is not None:
        published = math.hypot(*(w * q for w, q in zip(problem.weights, problem.published, strict=True)))
    touch = None
    if problem.goal == "beyond":
        answer = solve(problem.changed(goal="touch", pair="any", clearance=0.0))
        touch = answer.amount if answer.usable else None
    return SolvedCase(solution, published, touch, certify)


def _ranged(problem: Problem, direction: str | None) -> tuple[CoherentRange, ContactTimes]:
    """Return the coherent range of a case, and when its pair made touches."""
    from fcdm_opt.tolerance.ranges.coherent_range import coherent_range
    from fcdm_opt.tolerance.ranges.contact_times import contact_times

    along: Any = problem.published if direction is None and len(problem.motion.parameters) > 1 else None
    if direction is not None:
        along = _direction(direction)
    return coherent_range(problem, along), contact_times(problem, along)


def _direction(text: str) -> dict[str, float]:
    """Read a direction: NAME=VALUE,..., lengths and radians, degrees where a name ends in _deg."""
    found: dict[str, float] = {}
    for item in text.split(","):
        name, _, value = (part.strip() for part in item.partition("="))
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not name or not math.isfinite(number):
            allowed = "NAME=VALUE,... as TZ=1,RZ_deg=2"
            raise InputError("not a direction", key="--direction", found=item, allowed=allowed)
        short = name.removesuffix("_deg")
        if short in found:
            raise InputError("a parameter is given twice", key="--direction", found=item)
        found[short] = number if short == name else math.radians(number)
    return found


def _code(solution: Solution) -> int:
    if not solution.status.found:
        return NO_MOTION
    return SOLVED if solution.usable else NOT_VERIFIED


def _case_data(case: SolvedCase) -> dict[str, Any]:
    extras = {"published_amount": case.published_amount, "touch_amount": case.touch_amount}
    return {"name": case.solution.problem.name, **case.solution.to_dict(), **extras}


def _distinct_curves(problems: Iterable[Problem]) -> list[tuple[DecisionCurve, list[str]]]:
    """Return the decision curve of each pair of bodies in a box, with the cases that share it."""
    found: dict[Any, tuple[DecisionCurve, list[str]]] = {}
    for problem in problems:
        key = (problem.movable, problem.static, problem.box)
        found.setdefault(key, (problem.curve, []))[1].append(problem.name)
    return list(found.values())


def _curve_data(curve: DecisionCurve) -> dict[str, Any]:
    from fcdm_opt.show.tables import slope

    return {
        "movable": curve.movable.name,
        "static": curve.static.name,
        "box": curve.box,
        "status": curve.status,
        "paths": curve.paths,
        "segments": [
            {
                "index": s.index,
                "feature": s.feature.label,
                "configuration": s.configuration,
                "line": s.line,
                "start": s.start,
                "end": s.end,
                "slope": slope(s),
                "parts": s.parts,
                "snug": s.snug,
            }
            for s in curve.segments
        ],
        "switching_points": [
            {
                "index": p.index,
                "rho": p.rho,
                "kind": p.kind,
                "configurations": list(p.configurations),
                "label": p.label,
                "contacts": p.contacts,
                "contact_sets": list(p.contact_sets),
            }
            for p in curve.switching_points
        ],
    }
