"""What the claims of a proof come to: functions of the pose of body 1 and of given vertices and directions.

They take R and d = s_2 - moved s_1, body 1 about its moved seed in its own axes and body 2 about s_2. Along a direction
n = R u (normal to a face of body 1), u (of body 2) or R u x w (to two edges), heights of points are written such that
they are linear in R. Nothing is normalised and nothing divided.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from fcdm_opt.curve.kernels import F1V2, V1F2
from fcdm_opt.proof.mean_value import Expression


def _one(kind: int, R: Any, u: Any, w: Any, x: Any) -> Any:
    """Return n . R x along a direction: n = R u (a face of body 1), u (of body 2) or R u x w (two edges)."""
    import casadi

    if kind == F1V2:
        return casadi.dot(u, x)
    if kind == V1F2:
        return casadi.dot(u, R @ x)
    return casadi.dot(w, R @ casadi.cross(x, u))  # (R u x w) . R x = w . (R x x R u)


def _two(kind: int, R: Any, u: Any, w: Any, y: Any) -> Any:
    """Return n . y along a direction, see `_one`."""
    import casadi

    if kind == F1V2:
        return casadi.dot(R @ u, y)
    return casadi.dot(u, y) if kind == V1F2 else casadi.dot(R @ u, casadi.cross(w, y))


@cache
def separation(kind: int) -> Expression:
    """Given (u, w, x, y): n . (d + y - R x), how far y is from x along a direction."""
    return Expression.of(
        12, lambda R, d, p: _two(kind, R, p[:3], p[3:6], d + p[9:]) - _one(kind, R, p[:3], p[3:6], p[6:9])
    )


@cache
def height(kind: int, body: int) -> Expression:
    """Given (u, w, x): n . R x, or -n . x for a point of body 2: how far a point reaches towards the other body."""
    if body == 0:
        return Expression.of(9, lambda R, d, p: _one(kind, R, p[:3], p[3:6], p[6:]))
    return Expression.of(9, lambda R, d, p: -_two(kind, R, p[:3], p[3:6], p[6:]))


def _tracked_pair(kinds: tuple[int, ...], R: Any, d: Any, p: Any) -> tuple[Any, Any, Any, Any, Any]:
    """Return (D, D rho_1, D rho_2, D (rho_1 - rho_t1), D (rho_2 - rho_t2)) of the tracked scale pair.

    kinds (0,) or (1,): a vertex of one body on an edge of body 1 or 2, rho_1 R x = d + rho_2 y + t u; given the target
    pair, u, x, y. Else those of two features, whose contact lines cross; given the target pair and, for each, u, w, x,
    y. Multiplied by the determinant D, as by Cramer's rule, nothing is divided.
    """
    import casadi

    cross, dot, target = casadi.cross, casadi.dot, (p[0], p[1])
    if len(kinds) == 1:
        u, x, y = p[2:5], p[5:8], p[8:11]
        turned = R @ x
        if kinds[0] == 1:
            crossed = cross(y, u)
            across, determinant = cross(turned, u), dot(turned, crossed)
        else:
            crossed, across = cross(y, R @ u), R @ cross(x, u)
            determinant = -dot(y, across)
        first = dot(d, crossed)
        return (determinant, first, dot(d, across), first - target[0] * determinant, dot(d + target[1] * y, across))
    rows = []
    for kind, q in zip(kinds, (p[2:14], p[14:26]), strict=True):
        u, w, x, y = q[:3], q[3:6], q[6:9], q[9:]
        a, b, c = _one(kind, R, u, w, x), -_two(kind, R, u, w, y), _two(kind, R, u, w, d)
        rows.append((a, b, c, _two(kind, R, u, w, d + target[1] * y) - target[0] * a))
    (a, b, c, g), (e, f, h, i) = rows
    return a * f - e * b, c * f - h * b, a * h - e * c, g * f - i * b, a * i - e * g


@cache
def crossing(kinds: tuple[int, ...]) -> Expression:
    """Given what `_tracked_pair` takes: the tracked scale pair, times D and as it returns it."""
    return Expression.of(_taken(kinds), lambda R, d, p: _tracked_pair(kinds, R, d, p))


@cache
def gap_at_crossing(kinds: tuple[int, ...], kind: int) -> Expression:
    """Given what `_tracked_pair` takes, then (u, w, x, y): D n . (d + rho_2 y - rho_1 R x) at the tracked pair."""
    taken = _taken(kinds)

    def build(R: Any, d: Any, p: Any) -> Any:
        determinant, first, second, _, _ = _tracked_pair(kinds, R, d, p[:taken])
        u, w, x, y = (p[taken + 3 * k : taken + 3 * k + 3] for k in range(4))
        return determinant * _two(kind, R, u, w, d) - first * _one(kind, R, u, w, x) + second * _two(kind, R, u, w, y)

    return Expression.of(taken + 12, build)


def _taken(kinds: tuple[int, ...]) -> int:
    return 11 if len(kinds) == 1 else 26


@cache
def depth(body: int) -> Expression:
    """Given (n, level, start, along, place): how deep a point of an edge is below a plane of the other body.

    The edge of body 1, in its axes about its moved seed, the plane about s_2; or the other way round. `place` is one
    more variable, and the second value its coefficient.
    """

    def build(R: Any, d: Any, p: Any) -> Any:
        import casadi

        n, level, start, along, place = p[:3], p[3], p[4:7], p[7:10], p[10]
        if body == 0:
            rate = casadi.dot(n, R @ along)
            return (level - casadi.dot(n, R @ start - d) - place * rate, -rate)
        rate = casadi.dot(R @ n, along)
        return (level - casadi.dot(R @ n, start + d) - place * rate, -rate)

    return Expression.of(11, build)


@cache
def nearness() -> Expression:
    """Given (x, y, need): need^2 - |d + y - R x|^2."""

    def build(R: Any, d: Any, p: Any) -> Any:
        import casadi

        return p[6] * p[6] - casadi.sumsqr(d + p[3:6] - R @ p[:3])

    return Expression.of(7, build)
