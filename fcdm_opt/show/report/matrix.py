"""The four requirements of one question as a 2 x 2 table, as in Tables 1 and 2 of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fcdm_opt.errors import InputError
from fcdm_opt.problem.problem import SIGNS, Problem
from fcdm_opt.problem.solution import Solution
from fcdm_opt.show.plain import plain
from fcdm_opt.show.solved import SolvedCase, solved_again
from fcdm_opt.show.texts import bound_line, motion_text, tolerance_text


def matrices(problems: Sequence[Problem], cases: Sequence[SolvedCase], *, first: int = 0) -> list[dict[str, Any]]:
    """Return the tables of a file's cases.

    Cases of the same bodies, nominal sizes, tolerances, goal, pair state and clearance that differ in the requirement
    share a table; keep-outs and path must be the same too, the motion need not. A requirement that the file does not
    ask for is solved with the motion of the table's first case. Without a requirement a case has no table.

    Parameters
    ----------
    problems : sequence of Problem
        As asked, one a case.
    cases : sequence of SolvedCase
    first : int
        Number of the first case in the report.
    """
    tables: list[tuple[Any, Problem, dict[str, tuple[int, Solution]]]] = []
    for number, (problem, case) in enumerate(zip(problems, cases, strict=True), first):
        if problem.requirement is None:
            continue
        question, letter = _question(problem), problem.requirement
        cells = next((cells for asked, _, cells in tables if asked == question and letter not in cells), None)
        if cells is None:
            cells = {}
            tables.append((question, problem, cells))
        cells[letter] = number, case.solution
    return [_listed(problem, cells) for _, problem, cells in tables]


def _question(problem: Problem) -> tuple[Any, ...]:
    """Return what cases of one table share."""
    assert problem.tolerance is not None
    return (
        id(problem.movable),
        id(problem.static),
        tuple(problem.nominal_pair.tolist()),
        tuple(problem.tolerance.ravel().tolist()),
        problem.goal,
        problem.pair,
        problem.clearance,
        problem.path,
        tuple(id(keep_out) for keep_out in problem.keep_out),
    )


def _listed(first: Problem, known: dict[str, tuple[int, Solution]]) -> dict[str, Any]:
    names = [solution.problem.name for _, solution in known.values()]
    cells = {letter: _cell(*known[letter]) if letter in known else _missing(first, letter) for letter in SIGNS}
    return {"title": f"cases {', '.join(names)}", "tolerance": tolerance_text(first), "cells": cells}


def _missing(first: Problem, letter: str) -> dict[str, Any]:
    """Return the cell of a requirement that the file does not ask for."""
    note = f"not a case of the file: solved for this table as case {first.name} is"
    try:
        solution = solved_again(first, requirement=letter, name="", published=None, published_text="")
    except InputError as reason:
        nothing = {
            **dict.fromkeys(("amount", "bound", "published")),
            **{"motion": "-", "bound_text": "", "pair_state": "unknown", "status": "", "verified": False},
        }
        return {"case": None, **nothing, "from_file": False, "note": f"{note}; {reason}"}
    return _cell(None, solution, note=note)


def _cell(case: int | None, solution: Solution, *, note: str = "") -> dict[str, Any]:
    return {
        "case": case,
        "motion": motion_text(solution),
        "amount": plain(solution.amount),
        "amount_unit": solution.problem.amount_unit,
        "doubt": solution.doubt,
        "bound": plain(solution.lower_bound),
        "bound_text": bound_line(solution),
        "published": solution.problem.published_text or None,
        "pair_state": solution.pair_state,
        "status": solution.status.name,
        "verified": solution.usable,
        "from_file": case is not None,
        "note": note,
    }
