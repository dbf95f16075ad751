"""All that a report shows, as plain data that JSON holds: from problem files to solved cases with their frames."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from fcdm_opt import pacing
from fcdm_opt.errors import InputError
from fcdm_opt.problem.problem import SIGNS, Problem
from fcdm_opt.problem.solution import Solution
from fcdm_opt.problem.syntax import parsed
from fcdm_opt.show.report.cases import answered, case_report
from fcdm_opt.show.solved import solved_case
from fcdm_opt.show.texts import tolerance_text
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT, meanings

PACKAGES = ("fcdm_opt", "casadi", "coal", "numpy", "scipy", "numba", "python-flint")
"""Whose versions a report names."""

SHARED = ("nominal", "tolerance", "goal", "pair", "clearance", "path")
"""What cases of one table have in common, besides bodies and keep-outs."""

SOLVED = 0.6  # share of a case's time, where that is limited; the rest is for its pictures
FAMILIES, PROOFS, PROOF = 1.5, 4.0, 1.5
"""Seconds that the frames of all cases, and their proofs, may take by default, and the proof of one case: a page is
wanted while one waits."""
KEPT = 0.2  # of those for frames, kept back for each case that is still to come
BESIDE = 1.0  # seconds for a requirement that the file does not ask for


def gather(
    files: Iterable[Any],
    *,
    certify: bool = True,
    say: Callable[[str], None] | None = None,
    seconds: float | None = None,
) -> dict[str, Any]:
    """Solve all cases of problem files and return what a report shows of them.

    Parameters
    ----------
    files : iterable
        Problem files as read: their `path`, `title`, `note` and `problems`, and an `error` or None.
    certify : bool
        Prove how small a motion can be at all.
    say : callable, optional
        Gets a line for each case, and what is wrong with one.
    seconds : float, optional
        About how long the frames of one case may take; default what others leave of `FAMILIES`. A family has three
        frames at least, and says where there are fewer than it could have.

    Returns
    -------
    dict
        Lists, dicts, texts and finite numbers. The same files give the same data but for date and times, and for how
        many frames the time allowed.
    """
    listed, tables, cases = list[dict[str, Any]](), list[dict[str, Any]](), list[dict[str, Any]]()
    files = list(files)
    count = waiting = sum(len(file.problems) for file in files)
    spare = FAMILIES
    for number, file in enumerate(files):
        meshes = [{"file": name, "sha256": _digest(file.path.parent / name)} for name in _meshes(file.path)]
        errors = [file.error] if file.error else []
        answers = list[tuple[int, Problem, Solution]]()
        for problem in file.problems:
            if say:
                say(f"{file.path.name}: case {problem.name}")
            try:
                with pacing.working_on(f"case {problem.name}"), pacing.sharing(1.0 / waiting):
                    with pacing.sharing(SOLVED):
                        case = solved_case(problem, certify=certify, seconds=min(PROOFS / count, PROOF))
                    pacing.at("drawing")
                    given = max(spare - KEPT * (waiting - 1), FAMILIES / count) if seconds is None else seconds
                    with pacing.unlimited():
                        data, taken = case_report(problem, case, seconds=min(given, pacing.left()))
                    spare -= taken
            except InputError as reason:
                errors.append(str(reason.within(file=file.path.name, key=f"case {problem.name!r}")))
                if say:
                    say(f"error: {errors[-1]}")
                waiting -= 1
                continue
            waiting -= 1
            answers.append((len(cases), problem, case.solution))
            cases.append({"file": number, **data})
        tables += [{"file": number, **table} for table in matrices(answers)]
        listed.append({**head(file), "meshes": meshes, "cases": [number for number, *_ in answers]})
        if errors:
            listed[-1]["error"] = "; ".join(errors)
    return {
        **_title(listed),
        "made": made(),
        "tolerances": [[name, getattr(DEFAULT, name), meaning] for name, meaning in meanings().items()],
        "files": listed,
        "matrices": tables,
        "cases": cases,
    }


def matrices(answers: Sequence[tuple[int, Problem, Solution]]) -> list[dict[str, Any]]:
    """Return the tables of a file's cases: the number of each in the report, the question and the answer.

    Cases of the same bodies, nominal sizes, tolerances, goal, pair state and clearance that differ in the requirement
    share a table; keep-outs and path must be the same too, the motion need not. A requirement that the file does not
    ask for is solved with the motion of the table's first case. Without a requirement a case has no table.
    """
    tables: list[tuple[Any, Problem, dict[str, tuple[int, Solution]]]] = []
    for number, problem, solution in answers:
        if problem.requirement is None:
            continue
        told = problem.to_dict()
        question = told["bodies"], told.get("keep_out"), [told["case"][0].get(key) for key in SHARED]
        letter = problem.requirement
        cells = next((cells for other, _, cells in tables if other == question and letter not in cells), None)
        if cells is None:
            cells = {}
            tables.append((question, problem, cells))
        cells[letter] = number, solution
    return [
        {
            "title": f"cases {', '.join(solution.problem.name for _, solution in known.values())}",
            "tolerance": tolerance_text(first),
            "cells": {
                letter: _cell(*known[letter]) if letter in known else _missing(first, letter) for letter in SIGNS
            },
        }
        for _, first, known in tables
    ]


def _missing(first: Problem, letter: str) -> dict[str, Any]:
    """Return the cell of a requirement that the file does not ask for."""
    note = f"not a case of the file: solved for this table as case {first.name} is"
    try:
        asked = first.changed(requirement=letter, name="", published=None, published_text="")
        solution = solve(asked, effort="quick", time=BESIDE)
    except InputError as reason:
        return {"case": None, "amount": None, "status": "", "published": None, "note": f"{note}; {reason}"}
    return _cell(None, solution, note=f"{note}; {solution.stopped}" if solution.stopped else note)


def _cell(case: int | None, solution: Solution, *, note: str = "") -> dict[str, Any]:
    return {"case": case, **answered(solution), "published": solution.problem.published_text or None, "note": note}


def _title(files: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Return title and note of the report: those of its file, if it is one."""
    if len(files) == 1:
        return {"title": files[0]["title"] or files[0]["file"], "note": files[0]["note"]}
    return {"title": f"Tolerance problems: {len(files)} files", "note": ""}


def _digest(path: Path) -> str | None:
    """Return the SHA-256 of a file's bytes, None where it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return None


def _meshes(path: Path) -> list[str]:
    """Return the mesh files that a problem file names, in order; none where it cannot be read."""
    try:
        contents = parsed(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return []
    bodies = contents.get("bodies", {})
    tables = [*(bodies.values() if isinstance(bodies, dict) else ()), *contents.get("keep_out", ())]
    named = [table["file"] for table in tables if isinstance(table, dict) and isinstance(table.get("file"), str)]
    return list(dict.fromkeys(named))


def head(file: Any) -> dict[str, Any]:
    """Return what a report says of a file as read: name, title, note, SHA-256, and what is wrong with it."""
    told = {"file": file.path.name, "title": file.title, "note": file.note, "sha256": _digest(file.path)}
    return {**told, "error": file.error} if file.error else told


def made() -> dict[str, str]:
    """Return when a report was made, and with what."""
    import platform

    versions = {"date": datetime.now(UTC).isoformat(timespec="seconds"), "python": platform.python_version()}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return versions
