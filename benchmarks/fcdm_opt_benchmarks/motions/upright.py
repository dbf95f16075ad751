"""The least shift of prisms that stand on z, exactly: their faces are parallel, so that contacts are flush.

The shifts at which two convex parts overlap are the inside of a convex polyhedron, body 2 less body 1. Of two upright
prisms it is one too: over the sum of two polygons, whose sides are theirs. All is rational but a root at the end.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cmp_to_key
from typing import Any

import numpy as np
from flint import arb, ctx, fmpq

from fcdm_opt.curve.exact.rationals import rational
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.task import Task
from fcdm_opt.problem.problem import Problem
from fcdm_opt_benchmarks.motions.jets import BITS

Flat = tuple[fmpq, fmpq]
GOALS = ("touch", "clear")


def least_shift(problem: Problem) -> float | None:
    """Return the least shift, nearest float, 0 where none is needed; None where the problem is no such, or has none.

    Parameters
    ----------
    problem : Problem
        Goal "touch" or "clear" without clearance, of two convex parts that are prisms along z, by one translation or
        by three along the axes, unit weights, no limits, no keep-outs.
    """
    task = Task.of(problem)
    bodies = problem.movable, problem.static
    if not problem.motion.shifts or problem.goal not in GOALS or problem.clearance or problem.keep_out:
        return None
    if any(len(body.parts) > 1 for body in bodies) or np.isfinite(problem.limits).any() or (task.weights != 1).any():
        return None
    ways = np.array([task.transform(step)[:3, 3] for step in np.eye(len(task.weights))])
    prisms = [_prism(body.vertices, body.seed, scale) for body, scale in zip(bodies, task.target, strict=True)]
    if None in prisms or not (len(ways) == 1 or np.array_equal(ways, np.eye(3))):
        return None
    (one, (low, high)), (two, (bottom, top)) = (own for own in prisms if own is not None)
    sides = _sum_of(two, [(-x, -y) for x, y in reversed(one)])
    rows = [(*normal, fmpq(0), reach) for normal, reach in sides]
    rows += [(fmpq(0), fmpq(0), fmpq(1), top - low), (fmpq(0), fmpq(0), fmpq(-1), high - bottom)]
    apart = any(row[3] < 0 for row in rows)
    if apart and problem.goal == "clear":
        return 0.0
    if len(ways) == 1:
        squared = _along(rows, [rational(x) for x in ways[0].tolist()], apart)
    elif apart:
        above = max(bottom - high, low - top, fmpq(0))
        squared = above * above + _squared_distance(sides)
    else:
        squared = min(row[3] ** 2 / sum(x * x for x in row[:3]) for row in rows)
    if squared is None:
        return None
    with ctx.workprec(BITS):
        return float(arb(squared).sqrt().mid())


def _prism(vertices: Array, seed: Array, scale: float) -> tuple[list[Flat], tuple[fmpq, fmpq]] | None:
    """Return the scaled prism's outline, counter-clockwise, and its ends in z; None where it is none."""
    factor, centre = rational(float(scale)), [rational(x) for x in seed.tolist()]
    points = {
        tuple(s + factor * (rational(x) - s) for x, s in zip(row, centre, strict=True)) for row in vertices.tolist()
    }
    outline, heights = _hull((x, y) for x, y, _ in points), sorted({z for *_, z in points})
    if len(heights) != 2 or len(points) != 2 * len(outline):
        return None
    return outline, (heights[0], heights[1])


def _hull(points: Iterable[Flat]) -> list[Flat]:
    """Return the corners of a hull, counter-clockwise, by Andrew's chain."""
    ordered = sorted(set(points))
    halves = []
    for run in (ordered, ordered[::-1]):
        half: list[Flat] = []
        for point in run:
            while len(half) > 1 and _turn(half[-2], half[-1], point) <= 0:
                half.pop()
            half.append(point)
        halves += half[:-1]
    return halves


def _turn(a: Flat, b: Flat, c: Flat) -> Any:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _sum_of(one: list[Flat], two: list[Flat]) -> list[tuple[Flat, fmpq]]:
    """Return outward normals of the sum of two polygons in counter-clockwise order, each with how far it reaches."""
    normals = []
    for outline in (one, two):
        ends = [*outline[1:], outline[0]]
        normals += [(q[1] - p[1], p[0] - q[0]) for p, q in zip(outline, ends, strict=True)]
    normals.sort(key=cmp_to_key(_before))
    kept = [own for k, own in enumerate(normals) if k == 0 or _before(normals[k - 1], own)]
    reaches = [[max(n[0] * x + n[1] * y for x, y in own) for own in (one, two)] for n in kept]
    return [(n, here + there) for n, (here, there) in zip(kept, reaches, strict=True)]


def _before(one: Flat, two: Flat) -> int:
    """Compare two directions by their angle from the x axis, in [0, 2 pi)."""
    halves = [y < 0 or (y == 0 and x < 0) for x, y in (one, two)]
    if halves[0] != halves[1]:
        return 1 if halves[0] else -1
    turn = one[0] * two[1] - one[1] * two[0]
    return -1 if turn > 0 else int(turn < 0)


def _squared_distance(sides: list[tuple[Flat, fmpq]]) -> fmpq:
    """Return the squared distance of the origin from a polygon of given sides, 0 inside."""
    if all(reach >= 0 for _, reach in sides):
        return fmpq(0)
    corners = [_corner(own, after) for own, after in zip(sides, [*sides[1:], sides[0]], strict=True)]
    return min(_to_segment(p, q) for p, q in zip(corners, [*corners[1:], corners[0]], strict=True))


def _corner(one: tuple[Flat, fmpq], two: tuple[Flat, fmpq]) -> Flat:
    ((a, b), r), ((c, d), s) = one, two
    det = a * d - b * c
    return (r * d - s * b) / det, (a * s - c * r) / det


def _to_segment(p: Flat, q: Flat) -> fmpq:
    """Return the squared distance of the origin from a segment."""
    d = q[0] - p[0], q[1] - p[1]
    share = min(max(-(p[0] * d[0] + p[1] * d[1]) / (d[0] ** 2 + d[1] ** 2), fmpq(0)), fmpq(1))
    x, y = p[0] + share * d[0], p[1] + share * d[1]
    return x * x + y * y


def _along(rows: Sequence[tuple[fmpq, ...]], way: list[fmpq], apart: bool) -> fmpq | None:
    """Return the square of the least t at which t times a way is on the border of a polyhedron, None: it misses it."""
    slopes = [(sum(n * u for n, u in zip(row[:3], way, strict=True)), row[3]) for row in rows]
    if any(slope == 0 and reach < 0 for slope, reach in slopes):
        return None
    first = max(reach / slope for slope, reach in slopes if slope < 0)
    last = min(reach / slope for slope, reach in slopes if slope > 0)
    if first > last:
        return None
    return min(first * first, last * last) if apart else min(-first, last) ** 2
