"""How much of the deviation from nominal can be made good where all of it cannot, and where anything ends to hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from fcdm_opt.errors import InputError
from fcdm_opt.problem.fit import misfit
from fcdm_opt.problem.problem import Problem
from fcdm_opt.solver import solve

ACCURACY = 1e-4  # relative, of the tolerance: more digits than are shown
Guesses = Callable[[float, float], Iterable[float]]


def narrowed(
    holds: Callable[[float], bool],
    low: float,
    high: float,
    done: Callable[[float, float], bool],
    guesses: Guesses = lambda low, high: (),
) -> tuple[float, float]:
    """Return a narrower bracket of a place where something ends to hold, by guesses and a bisection in turns.

    Parameters
    ----------
    holds : callable
        Whether it holds at a place.
    low, high : float
        Where it is known to hold, and not to.
    done : callable
        Whether a bracket is narrow enough.
    guesses : callable
        Places worth a look in a bracket; those outside it are passed over.
    """
    while not done(low, high):
        for guess in (*guesses(low, high), None):
            place = (low + high) / 2.0 if guess is None else guess
            if low < place < high and not done(low, high):
                low, high = (place, high) if holds(place) else (low, place)
    return low, high


def deviating(problem: Problem, share: float) -> Problem:
    """Return a problem with a share of its deviation from nominal: of its tolerance, or of its target's."""
    if problem.tolerance is not None:
        return problem.changed(tolerance=(share * problem.tolerance).tolist())
    nominal = problem.nominal_pair
    return problem.changed(target=(nominal + share * (problem.target - nominal)).tolist())


def fits_up_to(problem: Problem) -> float | None:
    """Return the largest tolerance at which a problem without a usable solution has one, by bisection.

    One crossing is taken for granted, see `budget` for a proof. Where two widths of the parts tell at which share they
    are equal, that is tried first: most often it is the answer, after two solves.

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
    widths = misfit(problem)
    guesses = () if widths is None else (widths.share * (1.0 - ACCURACY / 2), widths.share * (1.0 + ACCURACY / 2))

    def fits(share: float) -> bool:
        try:
            return solve(deviating(problem, share), effort="quick").usable
        except InputError:  # the goal does not hold at these sizes
            return False

    def told(low: float, high: float) -> bool:
        return high - low <= ACCURACY * high or high <= ACCURACY

    share, _ = narrowed(fits, 0.0, 1.0, told, lambda low, high: guesses)
    return share * float(problem.tolerance.max())
