"""Motions for the true faces of round parts: facets are made exact where the parts meet.

Both parts are taken within the true ones, which ask for no more than these, and the motion that they need is found.
Where the true faces overlap after it, the parts are made exact at those points, and it is found anew, until they
overlap nowhere: then it is right for the true ones too. This is the exchange method for infinitely many constraints
(Hettich and Kortanek, Semi-infinite programming, SIAM Review 35, 1993): each point of a round face is one, and few
matter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.facet_errors import bounding_bodies, deviation_of, round_surfaces
from fcdm_opt.geometry.measures import norms
from fcdm_opt.geometry.patches import NearestPoints, nearest_on_faces, true_faces
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.tolerances import DEFAULT

ROUNDS = 30  # of making parts exact where they overlap
PATIENCE = 6  # rounds in which the deepest overlap becomes less than half of what it was, or it is given up
SEVERAL = 8  # points at a time
TIGHT = 0.003  # of what counts as touching: by so much true faces may overlap
FAR = 0.05  # of the size: nearer points of a time are one

Points = dict[str, list[list[float]]]


def points_of_true_faces(
    problem: Problem, solve: Callable[[Problem], Solution], refused: Callable[[Solution], bool]
) -> Points | None:
    """Return the points at which a problem's parts are to be exact, see `Problem.exact_at`; those it has among them.

    None where all faces are plane, where what they are is not known, or no motion is found so.

    Parameters
    ----------
    problem : Problem
    solve : callable
        Solves the same question about other parts.
    refused : callable
        Tells whether a motion found so is no answer, as it leaves the fit.
    """
    known, problem = problem.exact_at or {}, problem.of_facets
    if not _asks(problem):
        return None
    points: Points = {role: [[*point] for point in known.get(role, ())] for role in ("movable", "static")}
    need = problem.clearance if "clear" in (problem.goal, problem.pair) else 0.0
    slack = problem.contact_slack
    if not known:
        _add(points, [own for own in _nearest(problem, np.eye(4), need + slack) if abs(own.gap - need) <= slack])
    deepest = np.inf
    for count in range(ROUNDS):
        current = solve(problem.with_exact_points(points))
        if current.transform is None:  # what parts within the true ones cannot do, these cannot
            return points if current.status is Status.INFEASIBLE and problem.goal == "clear" else None
        if refused(current):
            return points if problem.goal == "clear" else None
        nearest = _nearest(problem, current.transform, need - TIGHT * slack)
        new = [own for own in nearest if own.gap < -slack or not _there(own, points, problem)]
        worst = [own for own in new if own.gap < need - TIGHT * slack]
        _add(points, worst or new[:1])  # where they are nearest their gap is told
        if not worst:
            return points
        if count % PATIENCE == PATIENCE - 1:
            if not need - worst[0].gap < 0.5 * deepest:
                break
            deepest = need - worst[0].gap
    return points if worst[0].gap >= need - slack else None


def exact_where(problem: Problem, poses: Callable[[Problem], Iterable[Array]]) -> Problem:
    """Return the same question with parts that are exact where their round faces are nearest at poses.

    The question itself where all faces are plane, where what they are is not known, or it comes to no end.

    Parameters
    ----------
    problem : Problem
    poses : callable
        Of the movable part, (4, 4), which may follow from the parts: they are asked for anew, until at none of them
        true faces overlap where the parts are not exact.
    """
    if not _asks(problem):
        return problem
    known, facets = problem.exact_at or {}, problem.of_facets
    points: Points = {role: [[*point] for point in known.get(role, ())] for role in ("movable", "static")}
    slack = facets.contact_slack
    for count in range(ROUNDS):
        current = facets.with_exact_points(points)
        near = [own for transform in poses(current) for own in _nearest(facets, transform, slack)]
        new = [own for own in near if (own.gap < -TIGHT * slack or not count) and not _there(own, points, facets)]
        if not new:
            return current
        _add(points, new)
    return problem


def _add(points: Points, found: Sequence[NearestPoints]) -> None:
    for own in found:
        for role, point in zip(points, own.points.tolist(), strict=True):
            points[role].append(point)


def _asks(problem: Problem) -> bool:
    """Tell whether round faces matter, and a goal is about the bodies, not about one contact."""
    if problem.goal not in ("touch", "clear") or problem.contacts or problem.keep_out:
        return False
    bodies = problem.movable, problem.static
    return any(map(round_surfaces, bodies)) and all(bounding_bodies(own) is not None for own in bodies)


def _nearest(problem: Problem, transform: Array, least: float) -> list[NearestPoints]:
    """Return where true faces are nearer than so much after a motion, the worst first, a few; or the nearest place."""
    bodies = problem.movable, problem.static
    band = max(least, 0.0) + DEFAULT.snap * problem.size
    band += sum(sum(deviation_of(own)) * float(scale) for own, scale in zip(bodies, problem.target, strict=True))
    chosen = list[NearestPoints]()
    for own in nearest_on_faces([*map(true_faces, bodies)], problem.target, transform, band):
        if (chosen and own.gap >= least) or len(chosen) == SEVERAL:
            break
        if not any(_same(own, other, problem) for other in chosen):
            chosen.append(own)
    return chosen


def _there(own: NearestPoints, points: Points, problem: Problem) -> bool:
    """Tell whether parts are exact there."""
    near = DEFAULT.nominal * problem.size
    return all(
        bool(len(there)) and float(norms(np.array(there) - point).min()) <= near
        for there, point in zip(points.values(), own.points, strict=True)
    )


def _same(one: NearestPoints, two: NearestPoints, problem: Problem) -> bool:
    """Tell whether two points show the same: near each other, or on one line of contact of parts that only shift."""
    if norms(one.points[0] - two.points[0]) <= FAR * problem.size:
        return True
    alike = abs(one.gap - two.gap) <= problem.contact_slack and one.normal @ two.normal > 1.0 - DEFAULT.nominal
    return problem.motion.shifts and bool(alike)
