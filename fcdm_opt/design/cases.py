"""Several questions answered at once, and all answers in one table."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from fcdm_opt.errors import InputError, expected
from fcdm_opt.lazy_import import NotebookRepr, extra
from fcdm_opt.moved_files import to_csv
from fcdm_opt.plain import finite
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.problem import SIGNS, Problem
from fcdm_opt.problem.solution import Bounded, Solution
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from pandas import DataFrame

COLUMNS = (
    "case", "requirement", "goal", "status", "usable", "amount", "lower_bound", "gap", "amount_low",
    "amount_high", "rho_1", "rho_2", "pair_state", "pair_gap", "unit",
)  # fmt: skip
"""Of a table of cases, before the motion's parameters (angles in degrees) and the verdict."""
OF_ANSWER = ("case", "status", "usable", "amount", "lower_bound")
OF_ALL = ("usable", "amount", "lower_bound", "gap", "amount_low", "amount_high")


class SolvedCases(dict[str, Any], NotebookRepr):
    """Solutions by the name of their case, in order; `print` shows their verdicts, `to_frame` gives one table."""

    def __str__(self) -> str:
        return "\n".join(str(solution).splitlines()[0] for solution in self.values())

    def __repr__(self) -> str:
        usable = sum(solution.usable for solution in self.values())
        return f"SolvedCases({', '.join(self)}: {usable} of {len(self)} usable)"

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each case: numbers, texts and None, with one column for each parameter of any motion."""
        return case_rows(self.items())

    def to_frame(self, *, full: bool = False) -> DataFrame:
        """Return the rows as a pandas table (extra `tables`); numbers that are not there are nan.

        With case, status, bounds and motions alone, which fit a screen; `full`: with all columns.
        """
        pandas, rows = extra("pandas", "tables", key="table"), self.rows()
        columns = [*rows[0]] if rows else [*COLUMNS]
        omitted = () if full else (*COLUMNS, "verdict")
        return pandas.DataFrame(rows, columns=[own for own in columns if own in OF_ANSWER or own not in omitted])

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write these rows as CSV, which Excel opens as a table."""
        write_cases(path, self.items())


def solve_all(
    problem: Problem | Assembly | Iterable[Problem | Assembly], *, requirement: str | None = None, **how: Any
) -> SolvedCases:
    """Solve several questions, each by itself.

    Parameters
    ----------
    problem : Problem or Assembly, or several
        As `load_problems` and `load_assemblies` return them.
    requirement : "all", or letters such as "AD", optional
        Ask each problem for these requirements in place of its own: the cases are named by their letters.
    **how
        Arguments of `solve`.

    Raises
    ------
    InputError
        As `solve` does, and for a requirement that is none.
    """
    problems: list[Any] = list(problem) if isinstance(problem, Iterable) else [problem]
    for each in problems:
        expected(each, Problem if requirement else (Problem, Assembly), "problem")
    letters = "".join(SIGNS) if requirement == "all" else requirement
    if letters is not None:
        if not isinstance(letters, str) or not letters or set(letters) - set(SIGNS):
            allowed = f'"all", or some of {", ".join(SIGNS)}'
            raise InputError("no such requirement", key="requirement", found=requirement, allowed=allowed)
        single = len(problems) == 1
        problems = [
            each.changed(requirement=letter, target=None, name=letter if single else f"{each.name} {letter}".strip())
            for each in problems
            for letter in letters
        ]
    solved: dict[str, Bounded] = {}
    for number, each in enumerate(problems, 1):
        name = each.name or str(number)
        solved[name if name not in solved else f"{name} ({number})"] = solve(each, **how)
    return SolvedCases(solved)


def case_rows(cases: Iterable[tuple[str, Bounded]]) -> list[dict[str, Any]]:
    """Return a row for each named solution, all with the same columns; of an assembly parameters as PART.NAME."""
    # the columns that one pair of bodies has are empty there
    rows = []
    for name, solution in cases:
        row: dict[str, Any] = {"case": name, "status": solution.status.name, "unit": solution.question.unit}
        row |= {key: getattr(solution, key) for key in OF_ALL}
        if isinstance(solution, Solution):
            problem, (row["rho_1"], row["rho_2"]) = solution.problem, solution.pair.tolist()
            row |= {"requirement": problem.requirement, "goal": problem.goal, "pair_state": solution.pair_state}
            rounding = abs(solution.pair_gap) <= DEFAULT.weld * problem.size
            row |= {"pair_gap": 0.0 if rounding else solution.pair_gap}
        for own, x in zip(solution.question.coordinates, solution.coordinates.values(), strict=False):
            row |= {f"{own.name}_deg": math.degrees(x)} if own.kind == "rotation" else {own.name: x}
        row["verdict"] = str(solution).splitlines()[0].removeprefix(f"{solution.question.name}: ")
        rows.append(row)
    more = dict.fromkeys(key for row in rows for key in row if key not in (*COLUMNS, "verdict"))
    return [{key: row.get(key) for key in (*COLUMNS, *more, "verdict")} for row in rows]


def write_cases(path: str | os.PathLike[str], cases: Iterable[tuple[str, Bounded]]) -> None:
    """Write a row for each named solution as CSV; what there is none of is left empty."""
    rows = case_rows(cases)
    to_csv(path, [list(rows[0]) if rows else list(COLUMNS), *([*map(finite, row.values())] for row in rows)])
