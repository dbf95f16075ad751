"""Where rays of the scale plane meet the decision curve, by one growth distance each, and its breakpoints from few.

With both seeds inside their parts the curve is one decreasing chain, the lower left boundary of the convex set of
overlapping scale pairs. A ray from (0, 0) meets it once. What is found there, a contact line, bounds it everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fcdm_opt.compiling import kernel
from fcdm_opt.curve.kernels import _cross, _dot
from fcdm_opt.errors import FcdmError
from fcdm_opt.geometry.arrays import Array, Ints

ROUNDING = 1e-12  # relative: scale pairs, and lines, that differ by less are equal to a method that works in floats
STEPS = 10_000  # of a simplex method on three rows: hulls of 10,000 vertices take less than a hundred
DEPTH = 200  # of a search between two lines: few steps deep even where a curve has a thousand segments


class RayTouch(NamedTuple):
    """Where a ray meets the curve: the scale pair, and a contact line (a, b, c) there.

    `pairs`: three vertex pairs (i, j), (3, 2), where they are known: the offset d is a sum, with weights that are not
    negative, of the three scaled differences of those vertices.
    """

    point: Array
    line: Array
    pairs: Ints | None = None


@kernel
def grown(
    P: Array, Q: Array, d: tuple[float, float, float], rho: tuple[float, float], inner: float, slack: float, pairs: Ints
) -> tuple[float, float, float, float, int]:
    """Return (s, a, b, c, steps) of `growth_distance`; `pairs` is where to start, -1 for nowhere, and what is found.

    No steps where it did not end.
    """
    x, y = rho
    columns = np.empty((3, 3))
    known = pairs[0, 0] >= 0
    for k in range(3):
        for axis in range(3):
            columns[k, axis] = x * P[pairs[k, 0], axis] - y * Q[pairs[k, 1], axis] if known else 0.0
    for step in range(1, STEPS):
        u = (columns[0, 0], columns[0, 1], columns[0, 2])
        v = (columns[1, 0], columns[1, 1], columns[1, 2])
        w = (columns[2, 0], columns[2, 1], columns[2, 2])
        vw, wu, uv = _cross(v, w), _cross(w, u), _cross(u, v)
        det = _dot(u, vw)
        p, q, r = _dot(d, vw) / det, _dot(d, wu) / det, _dot(d, uv) / det
        if step == 1:
            sizes = np.sqrt(_dot(u, u) * _dot(v, v) * _dot(w, w))
            if not (abs(det) > ROUNDING * sizes and min(p, q, r) >= 0):  # nothing to start from
                for k in range(3):  # three vectors well inside, which are never the best
                    pairs[k] = -1
                    for axis in range(3):
                        columns[k, axis] = 0.0
                    columns[k, k] = inner if d[k] >= 0 else -inner
                continue
        if not abs(det) > 0:
            break
        n = ((vw[0] + wu[0] + uv[0]) / det, (vw[1] + wu[1] + uv[1]) / det, (vw[2] + wu[2] + uv[2]) / det)
        i, j, a, b = 0, 0, -np.inf, -np.inf
        for k in range(len(P)):
            height = P[k, 0] * n[0] + P[k, 1] * n[1] + P[k, 2] * n[2]
            if height > a:
                i, a = k, height
        for k in range(len(Q)):
            height = -(Q[k, 0] * n[0] + Q[k, 1] * n[1] + Q[k, 2] * n[2])
            if height > b:
                j, b = k, height
        same = False  # the best column is a basic one: what it seems to gain is rounding
        for k in range(3):
            same = same or (pairs[k, 0] == i and pairs[k, 1] == j)
        if same or x * a + y * b <= 1 + slack:
            return p + q + r, a, b, _dot(n, d), step
        entering = (x * P[i, 0] - y * Q[j, 0], x * P[i, 1] - y * Q[j, 1], x * P[i, 2] - y * Q[j, 2])
        change = (_dot(entering, vw) / det, _dot(entering, wu) / det, _dot(entering, uv) / det)
        least, leaving = np.inf, -1
        rising = ROUNDING * max(abs(change[0]), abs(change[1]), abs(change[2]))
        for k, weight in enumerate((p, q, r)):
            if change[k] > rising and weight < least * change[k]:
                least, leaving = weight / change[k], k
        if leaving < 0:
            break
        pairs[leaving, 0], pairs[leaving, 1] = i, j
        for axis in range(3):
            columns[leaving, axis] = entering[axis]
    return 0.0, 0.0, 0.0, 0.0, 0


def growth_distance(
    P: Array, Q: Array, d: Array, rho: Array, inner: float, start: Ints | None = None, slack: float = ROUNDING
) -> RayTouch:
    """Return where the ray through `rho` meets the curve; on the diagonal, the growth distance of Ong and Gilbert.

    The primal simplex method on three rows: the least s with d in s (rho_1 P - rho_2 Q) is min sum x s.t.
    sum x_k c_k = d, x >= 0, over all differences c = rho_1 p_i - rho_2 q_j. The dual is a direction n, and the best
    column for it is the pair of vertices extreme in n and -n, so that a step costs one pass over the vertices of both
    parts.

    Parameters
    ----------
    P, Q : (n, 3) arrays
        Vertices about the seeds, world axes.
    d : (3,) array
        Way between the seeds.
    rho : (2,) array
    inner : float
        Less than the radius of a ball about 0 in rho_1 P - rho_2 Q.
    start : (3, 2) int array, optional
        Vertex pairs of a neighbouring answer, tried first.
    slack : float
        Relative: what a better column may still gain.
    """
    pairs = np.full((3, 2), -1) if start is None else start.copy()
    x, y = rho.tolist()
    s, a, b, c, steps = grown(P, Q, tuple(d.tolist()), (x, y), inner, slack, pairs)
    if not steps:
        raise FcdmError("the simplex method of a growth distance did not end")
    return RayTouch(s * rho, np.array([a, b, c]), pairs)


def breakpoints(touch: Callable[[Array, RayTouch | None], RayTouch], box: Array, slack: float) -> Array:
    """Return the curve in a box from its lines: where those of two rays cross, a third ray asks for what is there.

    It either meets the crossing, a breakpoint, or a line that neither of them knew: twice the number of segments, less
    one, is all it takes.

    Parameters
    ----------
    touch : callable
        (scale pair, a neighbouring touch or None) -> what is met along the ray through the pair.
    box : (2, 2) array
    slack : float
        Relative: a point that lies no further beyond the crossing of two lines is that crossing.

    Returns
    -------
    (k, 2) array
        Breakpoints and ends by increasing rho_1.
    """

    def between(left: RayTouch, right: RayTouch, depth: int = DEPTH) -> list[Array]:
        (a, b, c), (e, f, g) = left.line.tolist(), right.line.tolist()
        det = a * f - b * e
        if abs(det) <= slack * np.hypot(a, b) * np.hypot(e, f):
            return []
        if not depth:
            raise FcdmError("the lines along the curve do not settle")
        corner = np.array([c * f - b * g, a * g - c * e]) / det
        if not corner.min() > 0:
            raise FcdmError("the lines of two rays do not cross between them")
        found = touch(corner, left)
        if found.point @ found.point <= (1 + slack) ** 2 * (corner @ corner):
            return [corner]
        return [*between(left, found, depth - 1), *between(found, right, depth - 1)]

    left = touch(np.array([box[0, 0], box[1, 1]]), None)
    right = touch(np.array([box[0, 1], box[1, 0]]), None)
    return clipped([left.point, *between(left, right), right.point], box)


def clipped(polyline: Sequence[Array], box: Array) -> Array:
    """Return the part of a falling polyline inside a box; stretches along its lower borders belong to no curve."""
    points: list[list[float]] = []
    limits = box.tolist()
    for start, end in pairwise([point.tolist() for point in polyline]):
        lo, hi = 0.0, 1.0
        for x, y, (low, high) in zip(start, end, limits, strict=True):
            if x == y:
                lo, hi = (lo, hi) if low < x < high else (1.0, 0.0)
                continue
            s, t = (low - x) / (y - x), (high - x) / (y - x)
            lo, hi = max(lo, min(s, t)), min(hi, max(s, t))
        if hi > lo:
            first, last = (
                [x + share * (y - x) for x, y in zip(start, end, strict=True)] if share not in (0.0, 1.0) else own
                for share, own in ((lo, start), (hi, end))
            )
            points += [last] if points else [first, last]
    return np.array(points).reshape(-1, 2)
