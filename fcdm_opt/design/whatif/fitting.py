"""Up to which tolerance a question that has no answer inside the fit has one."""

from __future__ import annotations

from fcdm_opt.errors import InputError
from fcdm_opt.problem.fit import misfit
from fcdm_opt.problem.problem import Problem
from fcdm_opt.solver import solve

ACCURACY = 1e-4  # relative, of the tolerance: more digits than are shown


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
    low, high = 0.0, 1.0
    widths = misfit(problem)
    tried = [] if widths is None else [widths.share * (1.0 - ACCURACY / 2), widths.share * (1.0 + ACCURACY / 2)]
    for share in tried:
        if low < share < high:
            low, high = (share, high) if _fits(problem, share) else (low, share)
    while high - low > ACCURACY * high and high > ACCURACY:
        share = (low + high) / 2
        low, high = (share, high) if _fits(problem, share) else (low, share)
    return low * float(problem.tolerance.max())


def _fits(problem: Problem, share: float) -> bool:
    table = tuple(map(tuple, (share * problem.tolerance).tolist()))
    try:
        return solve(problem.changed(tolerance=table, goal=problem.goal), effort="quick").usable
    except InputError:  # the goal does not hold at these sizes
        return False
