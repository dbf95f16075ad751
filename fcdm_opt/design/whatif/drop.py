"""What each constraint costs: the least motion without it, and with another goal."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, ClassVar

from fcdm_opt.design.whatif.constraints import Constraint, PlainMotion, constraints, excesses, scene_of, without
from fcdm_opt.errors import InputError, known_arguments
from fcdm_opt.geometry.units import measured, number_text
from fcdm_opt.plain import Plain
from fcdm_opt.problem.problem import GOALS, Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import Bounded, Status
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT


@dataclass(frozen=True, eq=False, kw_only=True)
class Dropped(PlainMotion):
    """The question without one constraint, or with another goal."""

    plain_names: ClassVar[tuple[str, ...]] = ("name", "amount", "saving", "excess", "rate", "estimate")

    name: str  # the constraint's name as `constraints` has it, or `goal "touch"`
    solution: Bounded = field(repr=False)  # of the question so changed
    amount: float  # its least amount; nan where none was found
    # how much smaller that is; 0 where dropping the constraint changes nothing to within `Tolerances.tied`. Of another
    # goal negative where that asks for more
    saving: float
    # by how much the motion without the constraint passes it, in its unit; infinite where there is no amount, nan
    # without a motion, or for a goal
    excess: float = math.nan
    # what the amount falls by, to first order, per unit by which the constraint is relaxed (see `Sensitivity`); nan
    # where it does not exist
    rate: float = math.nan
    # the saving that `rate` gives over `excess`; nan where either does not exist. Where the amount is a convex function
    # of the relaxation the saving is no larger
    estimate: float = math.nan

    @property
    def status(self) -> Status:
        """How the solve ended."""
        return self.solution.status

    def __str__(self) -> str:
        if math.isnan(self.amount):
            return f"{self.name}: {self.status.words}"
        if self.saving == 0.0:
            return f"{self.name}: costs nothing"
        more = "" if math.isnan(self.estimate) else f" (its multiplier predicted {number_text(self.estimate)})"
        word = "saves" if self.saving > 0 else "adds"
        unit = self.solution.amount_unit
        saved, amount = (measured(x, unit) for x in (abs(self.saving), self.amount))
        return f"{self.name}: {word} {saved}, amount {amount}{more}"


@dataclass(frozen=True, eq=False, kw_only=True)
class Costs(Plain):
    """Which constraint of a solvable problem costs how much."""

    plain_names: ClassVar[tuple[str, ...]] = ("amount", "rows", "goals", "free", "solves", "seconds")

    solution: Bounded = field(repr=False)  # with all constraints
    rows: tuple[Dropped, ...]  # one for each constraint, the largest saving first
    # of each other goal that a problem of two parts can have, the largest saving first, those without a motion last
    goals: tuple[Dropped, ...]
    solves: int
    seconds: float

    @property
    def amount(self) -> float:
        """Least amount with all constraints."""
        return self.solution.amount

    @property
    def free(self) -> tuple[str, ...]:
        """The constraints that cost nothing."""
        return tuple(row.name for row in self.rows if row.saving == 0.0)

    def __str__(self) -> str:
        amount = measured(self.solution.amount, self.solution.amount_unit)
        lines = [f"amount {amount}", *(f"without {row}" for row in self.rows if row.saving != 0.0)]
        lines += [f"cost nothing: {', '.join(self.free)}"] if self.free else []
        return "\n".join([*lines, *(f"with {row}" for row in self.goals)])


@known_arguments
def drop(problem: Scene | Bounded) -> Costs:
    """Find out which constraint of a problem or an assembly costs how much.

    Parameters
    ----------
    problem : Problem or Assembly, or a solution of one
        One that can be solved; a solution is taken as it is.

    Raises
    ------
    InputError
        For a problem that has no motion: `conflicts` tells why.
    """
    start = perf_counter()
    known = isinstance(problem, Bounded)
    solution: Any = problem if isinstance(problem, Bounded) else solve(scene_of(problem), effort="quick")
    if not solution.usable:
        what = "the problem has no motion that could become smaller"
        allowed = "a problem with a motion that the judge passes; `conflicts` tells what clashes where there is none"
        raise InputError(what, key="problem", found=solution.status.words, allowed=allowed)
    asked = solution.question
    rows = [_without(solution, one) for one in constraints(asked)]
    goals = list(_other_goals(solution.problem, solution.amount)) if isinstance(asked, Problem) else []
    return Costs(
        solution=solution,
        rows=tuple(sorted(rows, key=lambda row: -row.saving)),
        goals=tuple(sorted(goals, key=lambda row: (math.isnan(row.saving), -row.saving))),
        solves=len(rows) + len(goals) + (not known),
        seconds=perf_counter() - start,
    )


def _without(solution: Any, constraint: Constraint) -> Dropped:
    """Return what a constraint costs."""
    # the motion found with it does without it, too: where the solver finds none as small, dropping it saves nothing
    problem, name, rate = solution.question, constraint.name, constraint.rate(solution.sensitivity)
    without_it = solve(without(problem, [name]), effort="quick")
    if not (without_it.usable and without_it.amount < solution.amount * (1.0 - DEFAULT.tied)):
        return Dropped(name=name, solution=without_it, amount=solution.amount, saving=0.0, excess=0.0, rate=rate)
    passed = excesses(problem, without_it)
    # without a keep-out its clearance is passed, too
    excess = max(passed[one.name] for one in constraints(problem) if name in (one.name, one.includes))
    return Dropped(
        name=name,
        solution=without_it,
        amount=without_it.amount,
        saving=solution.amount - without_it.amount,
        excess=excess,
        rate=rate,
        estimate=rate * excess if math.isfinite(excess) else math.nan,
    )


def _other_goals(problem: Problem, least: float) -> Iterator[Dropped]:
    """Yield the problem with each other goal that makes a question; a clearance goes where nothing asks for it."""
    for goal in GOALS:
        if goal == problem.goal:
            continue
        clearance = problem.clearance if "clear" in (goal, problem.pair) and goal != "touch" else 0.0
        try:
            other = problem.changed(goal=goal, clearance=clearance, features=None)
        except InputError:  # no switching point, nothing flush
            continue
        answer = solve(other, effort="quick")
        amount = answer.amount if answer.usable else math.nan
        saving = least - amount
        tied = abs(saving) <= DEFAULT.tied * max(amount, least)
        yield Dropped(name=f'goal "{goal}"', solution=answer, amount=amount, saving=0.0 if tied else saving)
