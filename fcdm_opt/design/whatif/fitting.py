"""How much of the deviation from nominal can be made good where all of it cannot, and where anything ends to hold."""

from __future__ import annotations

from collections.abc import Callable

from fcdm_opt.errors import InputError
from fcdm_opt.problem.problem import Problem
from fcdm_opt.solver import solve

ACCURACY = 1e-4  # relative, of the tolerance: more digits than are shown


def narrowed(
    holds: Callable[[float], bool], low: float, high: float, done: Callable[[float, float], bool]
) -> tuple[float, float]:
    """Return a narrower bracket of a place where something ends to hold, by bisection until `done` says so.

    It is known to hold at `low`, and not to at `high`.
    """
    while not done(low, high):
        middle = (low + high) / 2.0
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high


def deviating(problem: Problem, share: float) -> Problem:
    """Return a problem with a share of its deviation from nominal: of its tolerance, or of its target's."""
    if problem.tolerance is not None:
        return problem.changed(tolerance=(share * problem.tolerance).tolist())
    nominal = problem.nominal_pair
    return problem.changed(target=(nominal + share * (problem.target - nominal)).tolist())


def fits_up_to(problem: Problem) -> float | None:
    """Return the largest tolerance at which a problem without a usable solution has one, by bisection.

    One crossing is taken for granted, see `budget` for a proof.

    Parameters
    ----------
    problem : Problem
        One whose solution is not usable. Its motion, goal, limits and keep-outs stay.

    Returns
    -------
    float or None
        The largest of the problem's tolerances at that size, the others in proportion; 0 where none will do. None where
        the problem asks for a target and not for tolerances.
    """
    if problem.tolerance is None or problem.requirement is None:
        return None

    def fits(share: float) -> bool:
        try:
            return solve(deviating(problem, share), effort="quick").usable
        except InputError:  # the goal does not hold at these sizes
            return False

    def told(low: float, high: float) -> bool:
        return high - low <= ACCURACY * high or high <= ACCURACY

    share, _ = narrowed(fits, 0.0, 1.0, told)
    return share * float(problem.tolerance.max())
