"""Verdicts on one scale pair, and their check, which shares nothing but the arithmetic with what found them.

Two scaled parts are apart if a direction separates them strictly; they touch if a direction separates them and they
have a common point; they overlap if some point is inside both. A common point is given by weights of the vertices. With
weights that are all positive it is inside the hull of their vertices, relative to what that hull spans; so where the
spans of both parts together are space, the parts cannot be separated, and their interiors meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq

from fcdm_opt.curve.exact.rationals import Number, Vector, dot, minus, rank, rational, scale_pair
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import ConvexPart

Point = tuple[fmpq, ...]


@dataclass(frozen=True, eq=False)
class Verdict:
    """Which side of the curve a scale pair lies on, and why; `proves` checks it.

    Attributes
    ----------
    side : int
        1 apart, 0 touching, -1 overlapping.
    direction : (3,) tuple of fmpz, or None
        Unless overlapping: a direction from body 1 to body 2 along which the separation is positive, or 0.
    one, two : dict
        Unless apart: vertices of both parts -> positive weights, adding up to the scale pair, that give one common
        point s_i + sum of weights times (vertex - s_i). Where the parts overlap, the vertices' differences span space,
        which makes it an inner point.
    """

    side: int
    direction: Vector | None
    one: dict[int, fmpq]
    two: dict[int, fmpq]


def proves(one: ConvexPart, two: ConvexPart, transform: Array | None, rho: Sequence[Number], verdict: Verdict) -> bool:
    """Check a verdict from scratch: rational arithmetic on the vertices, none of what computed it.

    Parameters
    ----------
    one, two : ConvexPart
    transform : (4, 4) array, or None
    rho : two numbers
    verdict : Verdict
    """
    P, Q, offset = _relative(one, two, np.eye(4) if transform is None else transform)
    pair, n = scale_pair(rho), verdict.direction
    if verdict.side >= 0:
        if n is None or not any(n):
            return False
        reach = dot(n, offset) - pair[0] * max(dot(n, p) for p in P) - pair[1] * max(-dot(n, q) for q in Q)
        if not (reach > 0 if verdict.side > 0 else reach == 0):
            return False
    return verdict.side > 0 or _meet(P, Q, offset, pair, verdict)


def _meet(P: list[Point], Q: list[Point], offset: Point, pair: tuple[fmpq, fmpq], verdict: Verdict) -> bool:
    """Check the common point: outer or inner as the verdict says."""
    one, two = verdict.one, verdict.two
    if not all(weight > 0 for weight in [*one.values(), *two.values()]):
        return False
    if (sum(one.values(), fmpq(0)), sum(two.values(), fmpq(0))) != pair:
        return False
    for axis in range(3):
        left = sum((weight * P[i][axis] for i, weight in one.items()), fmpq(0))
        right = sum((weight * Q[j][axis] for j, weight in two.items()), offset[axis])
        if left != right:
            return False
    if verdict.side == 0:
        return True
    spans = [[rows[k] for k in own] for rows, own in ((P, one), (Q, two))]
    return rank([minus(row, rows[0]) for rows in spans for row in rows[1:]]) == 3


def _relative(one: ConvexPart, two: ConvexPart, transform: Array) -> tuple[list[Point], list[Point], Point]:
    """Return all p_i, q_j and d as rationals, the plain way."""
    T = [[rational(x) for x in row] for row in transform.tolist()]
    (V, W), (s, e) = (
        [[tuple(rational(x) for x in row) for row in rows.tolist()] for rows in (one.vertices, two.vertices)],
        [tuple(rational(x) for x in part.seed.tolist()) for part in (one, two)],
    )
    P: list[Point] = [tuple([dot(row, minus(v, s)) for row in T[:3]]) for v in V]
    Q: list[Point] = [minus(w, e) for w in W]
    return P, Q, minus(e, [dot(row, s) + row[3] for row in T[:3]])
