"""Verdicts on one scale pair of an exact curve, and their check, which shares nothing but the arithmetic with it.

Two scaled parts are apart if a direction separates them strictly; they touch if a direction separates them and they
have a common point; they overlap if some point is inside both. A common point is given by weights of the vertices. With
weights that are all positive it is inside the hull of their vertices, relative to what that hull spans; so where the
spans of both parts together are space, the parts cannot be separated, and their interiors meet.

Inside the polygon of scale pairs that meet one solution is enough, a mixture of those at its vertices, with a few
weights of vertices that span space mixed in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq, fmpz

from fcdm_opt.curve.exact import ExactCurve
from fcdm_opt.curve.exact.curve import Shadow, Vertex
from fcdm_opt.curve.exact.program import ARTIFICIAL, Basis, Start, independent
from fcdm_opt.curve.exact.rationals import (
    ONE,
    ZERO,
    Number,
    Vector,
    cross,
    dot,
    minus,
    rank,
    rational,
    scale_pair,
    scaled,
)
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


def judged(curve: ExactCurve, rho: Sequence[Number]) -> Verdict:
    """Return the side of the curve that a scale pair lies on, with its proof."""
    point, side = scale_pair(rho), curve.side(rho)
    direction = curve.widest(point)[1] if side >= 0 else None
    return Verdict(side, direction, *(witness(curve.shadow, point) if side <= 0 else ({}, {})))


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


# ---------------------------------------------------------------------------------------------- what touches, at a pair


def witness(shadow: Shadow, rho: tuple[fmpq, fmpq]) -> tuple[dict[int, fmpq], dict[int, fmpq]]:
    """Return weights of both parts' vertices that give a common point at a scale pair of the polygon.

    Parameters
    ----------
    shadow : Shadow
    rho : two fmpq

    Returns
    -------
    one, two : dict
        Vertices -> positive weights, adding up to the scale pair; of vertices that span space if it is inside.
    """
    program, vertices = shadow.program, shadow.vertices
    z: Sequence[fmpz | fmpq] = program.point(rho)
    mixed: dict[int, fmpq] = {}
    if len(vertices) > 2:
        centre = _centre(shadow)
        middle = [ZERO, ZERO, ZERO]
        for j, load in centre.items():
            middle[program.kind(j)] += load
        # as much of the centre as leaves the rest on the polygon's boundary
        share = min(fmpq(dot(edge.levels, z), dot(edge.levels, middle)) for edge in shadow.edges)
        z = [x - share * y for x, y in zip(z, middle, strict=True)]
        mixed = {j: share * load for j, load in centre.items() if share > 0 and load > 0}
    for basis, factor in _mixture(vertices, z):
        for j, load in basis.weights.items():
            if load:
                mixed[j] = mixed.get(j, fmpq(0)) + factor * load
    tau = mixed.pop(program.total - 1)
    e1, e2, e3 = program.units
    n = program.counts[0]
    one = {j: load / tau * scaled(ONE, e3 - e1) for j, load in mixed.items() if j < n}
    two = {j - n: load / tau * scaled(ONE, e3 - e2) for j, load in mixed.items() if j >= n}
    return one, two


def _centre(shadow: Shadow) -> dict[int, fmpz]:
    """Return the weights of a point inside the polygon, of columns that span space."""
    vertices = shadow.vertices
    centre = _inner(shadow.start)
    for vertex in vertices[:: max(1, len(vertices) // 3)][:3]:
        for j, load in vertex.basis.weights.items():
            centre[j] = centre.get(j, ZERO) + load
    return centre


def _mixture(vertices: Sequence[Vertex], z: Sequence[fmpz | fmpq]) -> list[tuple[Basis, fmpq]]:
    """Return non-negative multiples of vertices' solutions that add up to a point of the polygon's boundary."""
    if not any(z):
        return []
    for k, first in enumerate(vertices):
        second = vertices[(k + 1) % len(vertices)]
        factors = _combination(first.point, second.point, z)
        if factors is not None:
            return [
                (vertex.basis, factor * fmpq(sum(vertex.point, ZERO)) / fmpq(sum(vertex.basis.point, ZERO)))
                for vertex, factor in zip((first, second), factors, strict=True)
                if factor
            ]
    raise AssertionError("the scale pair is not on the polygon's boundary")


def _combination(u: Vector, v: Vector, z: Sequence[fmpz | fmpq]) -> tuple[fmpq, fmpq] | None:
    """Return non-negative factors of two homogeneous points that give a third, None if there are none."""
    normal = cross(u, v)
    if not any(normal):
        k = next(k for k in range(3) if u[k])
        factor = fmpq(z[k]) / u[k]
        return (factor, fmpq(0)) if all(factor * x == y for x, y in zip(u, z, strict=True)) else None
    if dot(normal, z):
        return None
    i = next(i for i in range(3) if normal[i])
    j, k = (i + 1) % 3, (i + 2) % 3
    p = fmpq(z[j] * v[k] - z[k] * v[j]) / normal[i]
    q = fmpq(u[j] * z[k] - u[k] * z[j]) / normal[i]
    return (p, q) if p >= 0 and q >= 0 else None


def _inner(start: Start) -> dict[int, fmpz]:
    """Positive weights of columns that together span space, without a fourth row; none if excluded."""
    if start.crossing is None:
        return {}
    basis, entering = start.crossing
    y = basis.products(entering)
    place, least = basis.leaving(y, 3), fmpq(basis.rows[3][3], y[3])
    # a step on which the weight of A falls below 0, and those of the others stay above
    step = least + 1 if place is None else (least + fmpq(basis.rows[place][3], y[place])) / 2
    found = {entering: step * basis.det}
    chosen = independent(basis.program)
    for j, row, u in zip(basis.basic, basis.rows, y, strict=True):
        weight = row[3] - step * u
        for column, own in ((i, -weight) for i in chosen) if j == ARTIFICIAL else ((j, weight),):
            found[column] = found.get(column, fmpq(0)) + own
    common = ONE
    for weight in found.values():
        common = common.lcm(weight.q)
    return {j: (weight * common).p for j, weight in found.items() if weight > 0}
