"""All that a report shows, as plain data that JSON holds: from problem files to solved cases with their frames."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

from fcdm_opt import pacing, process_pool
from fcdm_opt.errors import InputError
from fcdm_opt.model.mesh_error import facets_known
from fcdm_opt.problem.problem import SIGNS, Problem
from fcdm_opt.problem.syntax import contents
from fcdm_opt.show.report.cases import ANSWERED, answered, case_report
from fcdm_opt.show.report.families import frames_of
from fcdm_opt.show.scene import shifts_of, view_of
from fcdm_opt.show.solved import solved_case
from fcdm_opt.show.stacks import commented_out_sizes
from fcdm_opt.show.texts import tolerance_text
from fcdm_opt.show.verdict import fit_text
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT, meanings

PACKAGES = ("fcdm_opt", "casadi", "coal", "numpy", "scipy", "numba", "python-flint")  # whose versions a report names
SHARED = ("nominal", "tolerance", "goal", "pair", "clearance", "path")
"""What cases of one table have in common, besides bodies and keep-outs."""

SOLVED = 0.6  # share of a case's time, where that is limited; the rest is for its pictures
DRAWN = 0.6  # share of what is left then for what may be left out; the rest is for what is drawn in any case
AMPLE = 4.0  # seconds: with less of a time limit left there is no frame but the answer's own
SIDE_SECONDS = 1.0  # seconds for a requirement that the file does not ask for

LOADED = "casadi", "matplotlib.backends.backend_agg", "matplotlib.figure", "scipy.optimize"
"""What every case needs: loaded before processes copy this one, as what cases of the same bodies share is known."""


def gather(
    files: Iterable[Any],
    *,
    certify: bool = True,
    say: Callable[[str], None] | None = None,
    refuse: Callable[[Exception], object] | None = None,
    frames: float | None = None,
) -> dict[str, Any]:
    """Solve all cases of problem files and return what a report shows of them.

    `files` are problem files as read: their `path`, `title`, `note` and `problems`, and an `error` or None. With
    `certify` it is proved how small a motion can be at all, and the proof checked; of large meshes the solver's bound
    stands. `say` gets a line for each case, `refuse` what is wrong with one; `frames` is the share of the frames of a
    family that each slider gets, at least three; default `frames_of` the problem.

    Returns lists, dicts, texts and finite numbers: the same files give the same data but for date and times.
    """
    files = list(files)
    asked = [problem for file in files for problem in file.problems]
    workers = process_pool.cores(len(asked))

    def case(number: int) -> dict[str, Any]:
        problem, part = asked[number], min(1.0, workers / (len(asked) - number))
        with pacing.working_on(f"case {problem.name}"), pacing.sharing(part):
            if number >= workers:  # those before are drawn whatever the time is
                pacing.check()
            with pacing.sharing(SOLVED):
                proved = certify and not problem.partial  # of large meshes the checker takes long
                solved = solved_case(problem, certify=proved)
            pacing.at("drawing")
            share = frames_of(problem, len(asked)) if frames is None else frames
            share = share if pacing.remaining() > AMPLE else -1.0
            with pacing.sharing(DRAWN), pacing.telling(), pacing.part_of("drawing"):
                return case_report(problem, solved, name=f"case-{number}", frames=share)

    for name in LOADED:
        import_module(name)
    for problem in asked:
        with suppress(Exception), pacing.telling():  # what fails is told of the case, which asks anew
            facets_known(problem)
            fit_text(problem)
            view_of(problem.curve, tuple(problem.nominal_pair.tolist()), shifts_of(problem))
    pacing.at("solving and drawing the cases before it")
    listed, known, cases, interrupted = answered_in_turn(files, case, say, refuse)
    tables = list[dict[str, Any]]()
    for number, numbers in enumerate(file["cases"] for file in listed):
        for place in numbers:
            cases[place]["file"] = number
        own = [known[place] for place in numbers]
        found = [] if interrupted else matrices(own, cases, min(numbers, default=0))
        tables += [{"file": number, **table} for table in found]
    one = listed[0] if len(listed) == 1 else {"title": f"Tolerance problems: {len(listed)} files", "note": ""}
    return {
        "title": one["title"] or one["file"],
        "note": one["note"],
        "made": made(),
        "tolerances": [[name, getattr(DEFAULT, name), meaning] for name, meaning in meanings().items()],
        "files": listed,
        "matrices": tables,
        "cases": cases,
        "interrupted": interrupted,
    }


def answered_in_turn(
    files: Sequence[Any],
    answer: Callable[[int], Any],
    say: Callable[[str], None] | None = None,
    refuse: Callable[[Exception], object] | None = None,
) -> tuple[list[dict[str, Any]], list[Any], list[Any], bool]:
    """Return heads of files, the questions with an answer, the answers, and whether that was interrupted.

    `answer` gives that of a question by its number in all files. A head has the numbers of its file's "cases" among
    the answers, and as its "error" why others are missing, with "failures", the kinds of that: "input", "internal", or
    "late", the time or an interrupt. Raises `KeyboardInterrupt` where there is no answer yet.
    """
    count = sum(len(file.problems) for file in files)
    answers, heads, known, found = process_pool.each(answer, range(count)), list[dict[str, Any]](), [], list[Any]()
    interrupted = False
    for file in files:
        errors, first, failures = [file.error] if file.error else [], len(found), {"input"} if file.error else set()
        for problem in file.problems:
            try:
                if interrupted:
                    raise KeyboardInterrupt
                if say:
                    say(f"{file.path.name}: case {problem.name}")
                with pacing.working_on(f"case {problem.name}"):
                    pacing.at("solving and drawing", len(found), count)
                    found.append(next(answers)())
                known.append(problem)
            except (Exception, KeyboardInterrupt) as reason:
                interrupted = interrupted or isinstance(reason, KeyboardInterrupt)
                if interrupted and not found:
                    raise
                late = "late", InputError("left out: interrupted")
                kind, error = late if isinstance(reason, KeyboardInterrupt) else pacing.failure(reason)
                failures.add(kind)
                met = error.within(file=file.path.name, key=f"case {problem.name!r}")
                errors.append(str(met))
                if refuse:
                    refuse(met.with_traceback(error.__traceback__))
        heads.append({**head(file), "cases": list(range(first, len(found)))})
        if errors:
            heads[-1] |= {"error": "\n".join(errors), "failures": sorted(failures)}
    return heads, known, found, interrupted


def matrices(problems: Sequence[Problem], cases: Sequence[dict[str, Any]], first: int) -> list[dict[str, Any]]:
    """Return the tables of a file's problems, whose cases in the report are those from number `first` on.

    Cases of the same bodies, nominal sizes, tolerances, goal, pair state and clearance that differ in the requirement
    share a table; keep-outs and path must be the same too, the motion need not. A requirement that the file does not
    ask for is solved with the motion of the table's first case. Without a requirement a case has no table.
    """
    tables: list[tuple[Any, Problem, dict[str, int]]] = []
    for number, problem in enumerate(problems, first):
        if problem.requirement is None:
            continue
        data = problem.to_dict()
        case = data["case"][0] | {"goal": problem.goal, "pair": problem.pair}  # by default, too
        question = data["bodies"], data.get("keep_out"), [case.get(key) for key in SHARED]
        letter = problem.requirement
        cells = next((cells for other, _, cells in tables if other == question and letter not in cells), None)
        if cells is None:
            cells = {}
            tables.append((question, problem, cells))
        cells[letter] = number
    return [
        {
            "title": f"cases {', '.join(cases[number]['name'] for number in known.values())}",
            "tolerance": tolerance_text(leading),
            "cells": {
                letter: _cell(known[letter], cases[known[letter]], problems[known[letter] - first].published_text)
                if letter in known
                else _missing(leading, letter)
                for letter in SIGNS
            },
        }
        for _, leading, known in tables
    ]


def _missing(leading: Problem, letter: str) -> dict[str, Any]:
    """Return the cell of a requirement that the file does not ask for."""
    note = f"not a case of the file: solved for this table as case {leading.name} is"
    empty = {"case": None, "amount": None, "status": "", "published": None}
    if pacing.over():
        return {**empty, "note": pacing.stopped()}
    try:
        asked = leading.changed(requirement=letter, name="", published=None, published_text="")
        solution = solve(asked, effort="quick", time=SIDE_SECONDS)
    except (InputError, pacing.TimeOverError) as reason:
        return {**empty, "note": f"{note}; {reason}"}
    return _cell(None, answered(solution), "", note=f"{note}; {solution.stopped}" if solution.stopped else note)


def _cell(case: int | None, answer: dict[str, Any], published: str, *, note: str = "") -> dict[str, Any]:
    return {"case": case, **{key: answer[key] for key in ANSWERED}, "published": published or None, "note": note}


def _digest(path: Path) -> str | None:
    """Return the SHA-256 of a file's bytes, None where it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return None


def _meshes(path: Path) -> list[str]:
    """Return the mesh files that a file of a problem or an assembly names, in order; none where it cannot be read."""
    data = contents(path)
    bodies = data.get("bodies", {})
    bodies = [*bodies.values()] if isinstance(bodies, dict) else []
    tables = [*bodies, *data.get("part", ()), *data.get("keep_out", ())]
    named = [table["file"] for table in tables if isinstance(table, dict) and isinstance(table.get("file"), str)]
    return list(dict.fromkeys(named))


def head(file: Any) -> dict[str, Any]:
    """Return what a report says of a file as read: name, title, note, SHA-256, its meshes, what is wrong with it."""
    entry = {"file": file.path.name, "title": file.title, "note": file.note, "sha256": _digest(file.path)}
    entry["meshes"] = [{"file": name, "sha256": _digest(file.path.parent / name)} for name in _meshes(file.path)]
    entry["sizes_left"] = commented_out_sizes(file.path)
    return {**entry, "error": file.error} if file.error else entry


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
