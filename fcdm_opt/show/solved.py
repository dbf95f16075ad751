"""Cases as tables and reports show them: solved, proof checked, and beside them what else is known."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.design.whatif.fitting import fits_up_to
from fcdm_opt.judge.certificate import verify, without_evidence
from fcdm_opt.model.task import Task
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.fit import misfit
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Effort, Solution, Status
from fcdm_opt.solver import solve

FITTED = 6000  # looks at the time while the tolerance at which parts fit is sought for; of large meshes it takes longer


@dataclass(frozen=True)
class SolvedCase:
    """A case after solving it, with what a table sets beside it.

    `published_amount` is that of the reference motion that the file gives, `touch_amount` the least amount for goal
    "touch" with the same motions, beside goal "beyond". `fits_up_to` is the tolerance up to which parts made that do
    not go together do (the largest, where there are several), see `fcdm_opt.design.whatif.fitting`; None elsewhere, of
    large meshes, and where no tolerances are asked for. `unproved` is why a bound that was to be certified carries no
    evidence, in words; "" where it does, or was not to be.
    """

    solution: Any
    published_amount: float | None = None
    touch_amount: float | None = None
    fits_up_to: float | None = None
    unproved: str = ""

    @property
    def extras(self) -> dict[str, float | None]:
        """What is set beside the solution of a problem; nothing beside that of an assembly."""
        names = ("published_amount", "touch_amount", "fits_up_to")
        return {name: getattr(self, name) for name in names if isinstance(self.solution, Solution)}


def solved_case(
    problem: Problem | Assembly, *, certify: bool, effort: Effort = "proved", seconds: float | None = None
) -> SolvedCase:
    """Solve a case, have its proof checked, and beside goal "beyond" ask for contact alone with the same motions.

    What the enclosing time limit leaves no time for is left out, see `Solution.stopped`. Raises `InputError` as `solve`
    does.
    """
    solution: Any = solve(problem, certify=certify, effort=effort, seconds=seconds, time=math.inf)
    shown = solution.status.found or (isinstance(problem, Problem) and solution.status is Status.INFEASIBLE)
    unproved = without_evidence(solution) if certify and shown else ""
    shown = shown or (isinstance(solution, Solution) and solution.evidence is not None)
    if certify and shown and solution.amount != 0.0 and not unproved and not pacing.over():
        pacing.at(f"checking the proof for {problem.name}")
        start = perf_counter()
        with suppress(pacing.TimeOverError), pacing.judging():
            certificate = verify(solution, proof=True)
            solution = solution.with_certificate(certificate, {**solution.seconds, "check": perf_counter() - start})
    if isinstance(problem, Assembly):
        return SolvedCase(solution, unproved=unproved)
    published = None
    if problem.published is not None:
        published = Task.of(problem).amount(np.array(problem.published))
    touch = None
    if problem.goal == "beyond":
        with suppress(pacing.TimeOverError):
            answer = solve(problem.changed(goal="touch", pair="any", clearance=0.0), effort=effort, seconds=seconds)
            touch = answer.amount if answer.usable else None
    fits = None
    with suppress(pacing.TimeOverError), pacing.looking(FITTED):
        pacing.check()
        if not problem.partial and (
            solution.status is Status.OUTSIDE_FIT or (not solution.status.found and misfit(problem) is not None)
        ):
            fits = fits_up_to(problem)
    return SolvedCase(solution, published, touch, fits, unproved)
