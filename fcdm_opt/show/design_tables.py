"""What the command line prints of studies, what-ifs, maps, yields and poses."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from fcdm_opt.show.printing import CELL_WIDTH, console, print_rows, print_text, wrapped
from fcdm_opt.show.texts import amount_text, asked_text, bound_line, motion_text, numbers, outcome_text, units_text

if TYPE_CHECKING:
    from fcdm_opt.design.compensation.assembly_yield import AssemblyYield
    from fcdm_opt.design.compensation.compensation_map import CompensationMap
    from fcdm_opt.design.fixed_pose.best_pose import BestPose
    from fcdm_opt.design.fixed_pose.clearances import Clearances
    from fcdm_opt.design.study.results import StudyResult
    from fcdm_opt.design.whatif.budget import Budgets
    from fcdm_opt.design.whatif.compare import Comparison
    from fcdm_opt.design.whatif.conflicts import Conflicts
    from fcdm_opt.design.whatif.drop import Costs, Dropped
    from fcdm_opt.design.whatif.whatif import WhatIf
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.problem.solution import Solution


def print_case(file: str, problem: Problem) -> None:
    """Print which case is asked about, and once what its numbers are in."""
    console().print(f"{file}: {problem.name} ({asked_text(problem)}, goal {problem.goal})", style="bold")
    if problem.unit:
        console().print(units_text(problem.unit))


def print_study(result: StudyResult) -> None:
    """Print how many points ended how, and the yield where a budget is given."""
    console().print(f"{result}\n")


def print_lines(result: BestPose | CompensationMap | Conflicts) -> None:
    """Print what the result itself says in words: regions of a map, clashes and their cures, the pose for all sizes."""
    for line in str(result).splitlines():
        print_text(line, indent="   ")
    print_text()


def print_advice(solution: Solution) -> None:
    """Print why a motion will not do, and what to do."""
    print_text(solution.advice, indent="   ")
    print_text()


def print_whatif(answer: WhatIf) -> None:
    """Print both answers, what the derivatives foretold, and what else changed."""
    rows = [_solved("before", answer.before), _solved("after", answer.after)]
    foretold = amount_text(answer.predicted_amount)
    rows.append({**dict.fromkeys(rows[0], ""), "": "foretold", "amount": foretold})
    print_rows(rows, numbers=("amount",))
    for reason in answer.prediction.reasons:
        print_text(f"foretold: {reason}", indent="   ")
    for what in answer.differences:
        if what.name in ("features", "active", "status"):
            print_text(f"{what.name}: {_words(what.before)} -> {_words(what.after)}", indent="   ")
    print_text()


def print_budgets(budgets: Budgets) -> None:
    """Print the largest tolerance of each requirement, and what ends it."""
    limit = "its own limits" if budgets.limit is None else f"an amount of {budgets.limit:g}"
    console().print(f"Largest tolerance such that it and all smaller ones can be made good within {limit}:")
    rows = [
        {
            "requirement": budget.requirement,
            "tolerance": f"{100 * budget.tolerance:.7g} %",
            "amount there": amount_text(budget.amount),
            "above it": budget.end.value,
            "smaller ones": "proved" if budget.proved else f"sampled, {budget.points} points",
        }
        for budget in budgets.values()
    ]
    print_rows(rows, numbers=("tolerance", "amount there"))
    for budget in budgets.values():
        print_text(f"{budget.requirement}: {budget.reason}", indent="   ")
    print_text()


def print_costs(costs: Costs) -> None:
    """Print what each constraint costs."""
    amount = amount_text(costs.solution.amount, costs.solution.problem.amount_unit)
    console().print(f"as asked: amount {amount}, {motion_text(costs.solution)}")
    rows = [_dropped("drop", row) for row in costs.rows] + [_dropped("ask for", row) for row in costs.goals]
    if rows:
        foretold = any(row["foretold"] for row in rows)
        kept = [{name: cell for name, cell in row.items() if name != "foretold" or foretold} for row in rows]
        print_rows(kept, numbers=("least amount then", "saved", "foretold"))
        more = '; "foretold": what its multiplier (first derivative) says is saved' if foretold else ""
        print_text(f"One change at a time, all else as asked; below 0 saved: the motion gets larger{more}.", "   ")
    else:
        console().print("Nothing to drop: no constraint but the goal itself.")
    print_text()


def print_comparison(comparison: Comparison) -> None:
    """Print the families of motions, the cheapest first."""
    console().print(str(comparison))
    rows = [
        {
            "family": row.name,
            "amount": amount_text(row.amount),
            "proved at least": "" if row.solution is None else bound_line(row.solution),
            "motion": "-" if row.solution is None else motion_text(row.solution, unit=False),
            "pair made": row.solution.pair_state if row.solution is not None and row.solution.status.found else "",
            "outcome": "the question does not hold" if row.solution is None else outcome_text(row.solution),
        }
        for row in comparison.table
    ]
    print_rows(rows, numbers=("amount", "proved at least"))
    for row in comparison.table:
        if row.note:
            print_text(f"{row.name}: {row.note}", indent="   ")
    print_text()


def print_yield(result: AssemblyYield) -> None:
    """Print the share of pairs that pass, and which body's tolerance contributes how much."""
    print_text(str(result), indent="   ")
    rows = [
        {
            "body": share.body,
            "of the variance alone": f"{share.first_order:.2%}",
            "with the other": f"{share.total:.2%}",
            "yield without its scatter": f"{share.share_without:.3%}",
        }
        for share in result.contributions
    ]
    print_rows(rows, numbers=tuple(rows[0])[1:])
    print_text()


def print_clearances(clearances: Clearances, *, where: str = "") -> None:
    """Print the range of the gap over all sizes at a pose, and how it is spread."""
    print_text(f"{where}: {clearances}" if where else str(clearances), indent="   ")
    ends = (("least", clearances.least), ("largest", clearances.most))
    rows = [
        {"end": name, "gap": f"{end.gap:+.6g}", "at sizes": numbers(end.rho), "between": end.feature}
        for name, end in ends
    ]
    print_rows(rows, numbers=("gap",))
    print_text()


def _solved(name: str, solution: Solution) -> dict[str, str]:
    return {
        "": name,
        "asked": asked_text(solution.problem),
        "amount": amount_text(solution.amount),
        "motion": motion_text(solution, unit=False),
        "pair made": solution.pair_state,
        "outcome": outcome_text(solution),
    }


def _dropped(word: str, row: Dropped) -> dict[str, str]:
    nothing = row.saving == 0.0
    return {
        "change": wrapped(f"{word} {row.name}", 3 * CELL_WIDTH),
        "least amount then": amount_text(row.amount),
        "saved": "nothing" if nothing else f"{row.saving:.5g}" if math.isfinite(row.saving) else "",
        "foretold": f"{row.estimate:.5g}" if math.isfinite(row.estimate) and not nothing else "",
        "outcome": "verified" if math.isfinite(row.amount) else outcome_text(row.solution),
    }


def _words(value: Any) -> str:
    return ", ".join(map(str, value)) or "none" if isinstance(value, list | tuple) else str(value)
