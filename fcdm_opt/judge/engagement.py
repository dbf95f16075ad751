"""Whether a motion leaves the fit: the parts were drawn engaged, and after the motion they are not.

A *fit* is more than a contact: a peg in its hole, a nut in its rail, a hook on its bar. As drawn no shift leads away
from all parts of the other body at once. A box that stands on a slab, or in a corner, is none: it may be moved away as
far as one likes. A motion leaves the fit in one of two ways.

- It goes *through* the other body: a part that bars the way as drawn lies behind after the motion. The way is straight
  on, along the displacement of each convex part's centre; what counts is where on that line two parts overlap.
- It comes *off* the other body: the contact that was asked for is sought where nothing holds the part any more. As
  drawn it reaches into the other's hull, deeper than the sizes change; after the motion nothing of that hull is on its
  way out. Drawing a part out on an open way is no re-positioning either.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.decision_curve import relative_pose
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.problem.fit import REST, holds
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.tolerances import DEFAULT

GROWTH = 2.0
"""Parts that reach into each other by less than this times what the sizes change may be taken apart by that alone."""
LEFT = 0.1
"""Parts that reach into each other by less than this share of what they do as drawn are held no more."""


def inside_fit(solution: Solution) -> Solution:
    """Return a judged solution, with status OUTSIDE_FIT where its motion leaves the fit; refused ones as they are."""
    problem, T = solution.problem, solution.transform
    convex = len(problem.movable.parts) == len(problem.static.parts) == 1  # then neither holds the other
    if not solution.usable or T is None or convex or not solution.amount > 0.0:
        return solution
    left = (_goes_through(problem, solution.pair, T) or _comes_off(problem, solution.pair, T)) and holds(problem)
    return replace(solution, status=Status.OUTSIDE_FIT) if left else solution


def passage(problem: Problem, way: Array) -> tuple[float, float]:
    """Return how far body 1 may be shifted against and along a way, as drawn, before it leaves the fit; see above.

    Infinite where the parts are no fit, or touch it no deeper than sizes may change.
    """
    if problem.movable.hollow or problem.static.hollow or not holds(problem):
        return -np.inf, np.inf
    drawn, slack = relative_pose(problem.movable, problem.static, REST), DEFAULT.side * problem.size
    length = float(np.linalg.norm(way))
    ends = [-np.inf, np.inf]
    for one in problem.movable.parts:
        for two in problem.static.parts:
            barred = _barred(one, two, drawn, problem.nominal_pair, way / length, slack)
            if barred is not None:
                middle = sum(barred) / 2.0 / length
                side = int(middle > 0.0)
                ends[side] = min(ends[side], middle, key=abs)
    points, others = problem.movable.vertices, problem.static.vertices
    largest = [
        (max(map(abs, own.tolerance or (0.0,))), 1.0 if own.is_length else problem.size) for own in problem.sizes
    ]
    change = sum(most * unit for most, unit in largest)
    for side, sign in enumerate((-1.0, 1.0)):
        deep = _depth(points, others, sign * way / length)
        if deep > GROWTH * change:
            ends[side] = min(ends[side], sign * (1.0 - LEFT) * deep / length, key=abs)
    return ends[0], ends[1]


def _goes_through(problem: Problem, pair: Array, T: Array) -> bool:
    """Tell whether a part that bars the way as drawn lies behind after the motion."""
    if problem.movable.hollow or problem.static.hollow:
        return False  # parts that are surface alone are passed without passing the solid
    drawn, made = (relative_pose(problem.movable, problem.static, pose) for pose in (REST, T))
    slack = DEFAULT.side * problem.size
    for one, two, way in _on_the_way(problem, pair, T):
        length = float(np.linalg.norm(way))
        before = _barred(one, two, drawn, problem.nominal_pair, way / length, slack)
        if before is not None and 0.0 < sum(before) / 2.0 < length:
            after = _barred(one, two, made, pair, way / length, slack)
            if after is not None and sum(after) < 0.0:
                return True
    return False


def _on_the_way(problem: Problem, pair: Array, T: Array) -> Iterator[tuple[ConvexPart, ConvexPart, Array]]:
    """Yield the part pairs whose boxes meet on the motion, with the displacement of the first part's centre.

    Against the other's, which moves as its size changes.
    """
    sizes = np.array([problem.nominal_pair, pair])
    obstacles = [np.vstack([_placed(two, rho) for rho in sizes[:, 1]]) for two in problem.static.parts]
    low, high = (np.array([end(points, axis=0) for points in obstacles]) for end in (np.min, np.max))
    for one in problem.movable.parts:
        rest = np.vstack([_placed(one, rho) for rho in sizes[:, 0]])
        end = rest @ T[:3, :3].T + T[:3, 3]
        way = (end - rest).mean(axis=0)
        if not np.linalg.norm(way) > DEFAULT.side * problem.size:
            continue
        swept = np.vstack([rest, end])
        for j in np.nonzero(((low < swept.max(axis=0)) & (high > swept.min(axis=0))).all(axis=1))[0]:
            two = problem.static.parts[j]
            past = way - (_placed(two, sizes[1, 1]) - _placed(two, sizes[0, 1])).mean(axis=0)
            if np.linalg.norm(past) > DEFAULT.side * problem.size:
                yield one, two, past


def _comes_off(problem: Problem, pair: Array, T: Array) -> bool:
    """Tell whether body 1 reaches into the other's hull as drawn, deeper than the sizes change, and then no more."""
    bodies = problem.movable, problem.static
    start, others = (body.placed_vertices(rho, REST) for body, rho in zip(bodies, pair, strict=True))
    end = problem.movable.placed_vertices(pair[0], T)
    way = (end - start).mean(axis=0)
    length = float(np.linalg.norm(way))
    if not length > DEFAULT.side * problem.size:
        return False
    ahead = way / length
    drawn = [body.placed_vertices(rho, REST) for body, rho in zip(bodies, problem.nominal_pair, strict=True)]
    change = sum(float(np.abs((now - was) @ ahead).max()) for now, was in zip((start, others), drawn, strict=True))
    if not length > GROWTH * change:
        return False
    deep = _depth(drawn[0], drawn[1], ahead)
    return deep > GROWTH * change and _depth(end, others, ahead) <= LEFT * deep


def _barred(
    one: ConvexPart, two: ConvexPart, pose: Array, rho: Array, ahead: Array, slack: float
) -> tuple[float, float] | None:
    """Return from where to where two parts overlap when the first is shifted along a unit vector, None for nowhere.

    Exact: along each facet direction of the Minkowski difference their separation is linear in the shift.
    """
    _, rows = kernels.facet_rows(*one.packed, *two.packed, pose)
    gaps = rows[:, 5] - rows[:, 3] * rho[0] - rows[:, 4] * rho[1] + slack
    speeds = rows[:, :3] @ ahead
    along = np.abs(speeds) <= DEFAULT.tie
    if (gaps[along] >= 0.0).any():
        return None
    ends, closing = gaps[~along] / speeds[~along], speeds[~along] > 0.0
    first, last = float(ends[closing].max(initial=-np.inf)), float(ends[~closing].min(initial=np.inf))
    return (first, last) if first < last else None


def _placed(part: ConvexPart, rho: float) -> Array:
    """Return the corners of a part scaled about the body's seed, at rest, (n, 3)."""
    placed: Array = part.seed + rho * (part.vertices - part.seed)
    return placed


def _depth(points: Array, others: Array, ahead: Array) -> float:
    """Return how far points must be shifted along a unit vector to leave the hull of others; 0 where it is not met.

    The largest t >= 0 such that the hulls of points + t ahead and others meet: a linear program in their weights.
    """
    from scipy.optimize import linprog

    n, m = len(points), len(others)
    meet = np.hstack([points.T, -others.T, ahead[:, None]])
    sums = np.zeros((2, n + m + 1))
    sums[0, :n] = sums[1, n:-1] = 1.0
    furthest, equal = np.append(np.zeros(n + m), -1.0), np.vstack([meet, sums])
    result = linprog(furthest, A_eq=equal, b_eq=[0.0, 0.0, 0.0, 1.0, 1.0], method="highs")
    return float(result.x[-1]) if result.status == 0 else 0.0
