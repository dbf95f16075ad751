"""Solutions that the judge passes, where any of several models has one."""

from __future__ import annotations

from contextlib import suppress

from fcdm_opt.errors import InputError
from fcdm_opt.tolerance.problem import Problem
from fcdm_opt.tolerance.solution import Solution, Status
from fcdm_opt.tolerance.solver import solve

OTHERS = ("descent", "nlp")  # asked where the judge rejects the motion of the first model that settles the case


def solved(problem: Problem, *, certify: bool = False) -> Solution:
    """Return the solution of a problem; where the judge rejects it, that of another model that he passes."""
    solution = solve(problem, certify=certify)
    for model in OTHERS if solution.status is Status.NOT_VERIFIED else ():
        with suppress(InputError):  # the stage does not settle the problem
            other = solve(problem, model=model, certify=certify)
            if other.usable:
                return other
    return solution
