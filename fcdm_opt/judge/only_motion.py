"""Whether a motion that restores several contacts is the only one in a box of motions: the judge's own proof.

The contacts are written anew as equations between the corners of the claimed elements, as made and as moved. Where a
square of their derivatives, times its inverse at the motion, is nearer to the unit matrix than 1 all over the box, no
two motions of the box meet the equations. The derivatives are bounded piece by piece of the box, in intervals.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.problem.problem import Problem
from fcdm_opt.proof.intervals import Interval, IntervalFunction

PIECES = 5000  # of a box, at most
NEAR = 1.0 - 1e-9  # how near to the unit matrix; what rounding does to the corners is far less
LEAST = 1e-7  # share of its length that a row of derivatives adds to those taken before it


@np.errstate(all="ignore")  # what has no bound is infinite or nan, and passes no comparison
def only_motion(problem: Problem, q: Array, half: float) -> bool:
    """Tell whether it is proved that no motion but this one restores a problem's contacts in a box.

    Parameters
    ----------
    problem : Problem
        With `contacts`.
    q : (k,) array
        The motion, which is to lie in the box.
    half : float
        The box: |weight x parameter| <= half. Infinite only of motions that turn nothing.
    """
    import casadi

    low, high = problem.limits.T
    moving = np.flatnonzero(low < high)
    reach = half / problem.weights[moving]
    if not problem.contacts or not len(moving) or not (np.abs(q[moving]) <= reach).all():
        return False
    if np.isinf(half):  # derivatives that are the same everywhere
        if not problem.motion.shifts:
            return False
        reach = np.abs(q[moving]) + problem.size / problem.weights[moving]
    smooth = all(step.smooth for step in problem.motion.steps)
    origin = problem.movable.seed if smooth else np.zeros(3)  # near what turns, intervals are narrow
    variables = casadi.SX.sym("q", len(q))
    seeds = (casadi.SX(body.seed - origin) for body in (problem.movable, problem.static))
    T = problem.motion.seen_from(origin).symbolic(variables, *seeds)
    rows = [row for feature in problem.contacts for row in _equations(problem, feature, T, origin)]
    slopes = casadi.jacobian(casadi.vertcat(*rows), variables)[:, moving.tolist()]
    here = casadi.Function("slopes", [variables], [slopes])(q).full() * reach
    chosen = _independent(here)
    if len(chosen) < len(moving):
        return False
    inverse, count = np.linalg.inv(here[chosen]), 1
    bounds = IntervalFunction(casadi.Function("bounds", [variables], [casadi.densify(slopes[chosen, :].T)]))
    while count ** len(moving) <= PIECES:
        over, jumps = _over_box(bounds, q, moving, reach, count)
        if jumps and not smooth:  # of smooth motions only the way of writing them changes
            return False
        off = Interval(inverse, np.zeros(inverse.shape)).contracted(over) - Interval(np.eye(len(inverse)))
        if off.size.sum(axis=1).max() < NEAR:  # nan is not
            return True
        count *= 2
    return False


def _over_box(bounds: IntervalFunction, q: Array, moving: Ints, reach: Array, count: int) -> tuple[Interval, bool]:
    """Return what holds the derivatives over a box, cut into `count` pieces each way, and whether they may jump."""
    ends = np.linspace(-1.0, 1.0, count + 1)
    places = np.stack(np.meshgrid(*[np.arange(count)] * len(moving), indexing="ij"), axis=-1).reshape(-1, len(moving))
    values = [Interval(np.full(len(places), x)) for x in q]
    for k, own in enumerate(moving.tolist()):
        values[own] = Interval.between(ends[places[:, k]] * reach[k], ends[places[:, k] + 1] * reach[k])
    (found,), jumps = bounds(values)
    sides = [np.min(x.low) for x in found], [np.max(x.high) for x in found]
    low, high = (np.reshape(side, (len(moving), len(moving))) * reach for side in sides)
    return Interval.between(low, high), bool(np.any(jumps))


def _independent(slopes: Array) -> list[int]:
    """Return as many rows as there are columns, each the one that is least dependent on those before it; or fewer."""
    left, chosen = slopes / np.maximum(np.linalg.norm(slopes, axis=1), 1e-300)[:, None], list[int]()
    for _ in range(slopes.shape[1]):
        lengths = np.linalg.norm(left, axis=1)
        best = int(lengths.argmax())
        if not lengths[best] > LEAST:
            break
        chosen.append(best)
        way = left[best] / lengths[best]
        left = left - np.outer(left @ way, way)
    return chosen


def equations(problem: Problem, T: Any, origin: Array) -> list[Any]:
    """Return what is 0 where all contacts are closed by a motion T, in CasADi, seen from an origin."""
    return [row for feature in problem.contacts for row in _equations(problem, feature, T, origin)]


def _equations(problem: Problem, feature: Feature, T: Any, origin: Array) -> Iterator[Any]:
    """Yield what is 0 where a contact is closed, of corners as made, seen from an origin: those of body 1 are moved."""
    import casadi

    R, t = T[:3, :3], T[:3, 3]
    one, two = (
        [body.seed - origin + rho * (body.vertices[label - 1] - body.seed) for label in element.vertices]
        for body, element, rho in (
            (problem.movable, feature.one, problem.target[0]),
            (problem.static, feature.two, problem.target[1]),
        )
    )
    kinds, flush = feature.one.kind + feature.two.kind, any(feature == own.touching for own in problem.nominal_seats)
    if kinds == "EE" and not flush:
        yield casadi.dot(casadi.cross(R @ (one[1] - one[0]), two[1] - two[0]), R @ one[0] + t - two[0])
    elif kinds[1] == "F" or (kinds[1] == "E" and kinds[0] != "F"):  # in the axes of body 2
        points = [R @ p + t for p in (one if kinds != "FF" else [one[k] for k in _triangle(one)])]
        yield from _off(kinds[1], two, points)
    elif kinds[0] != "V":  # in those of body 1
        yield from _off(kinds[0], one, [R.T @ (p - t) for p in two])
    else:
        yield from casadi.vertsplit(R @ one[0] + t - two[0])


def _off(kind: str, corners: Sequence[Array], points: Sequence[Any]) -> Iterator[Any]:
    """Yield how far points are off the plane of a face, or off the line of an edge."""
    import casadi

    a, b, c = (corners[k] for k in _triangle(corners)) if kind == "F" else (*corners[:2], corners[0])
    for p in points:
        if kind == "F":
            yield casadi.dot(np.cross(b - a, c - a), p - a)
        else:
            yield from casadi.vertsplit(casadi.cross(casadi.SX(b - a), p - a))


def _triangle(corners: Sequence[Array]) -> tuple[int, int, int]:
    """Return which three corners of a face span a large triangle."""
    arms = np.array(corners) - corners[0]
    last = int(np.linalg.norm(arms, axis=1).argmax())
    return 0, last, int(np.linalg.norm(np.cross(arms, arms[last]), axis=1).argmax())
