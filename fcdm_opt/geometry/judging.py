"""The judge's numba kernels: explicit vertices, each scaled and moved, over many scale pairs and poses at once.

They share nothing with the kernels of the decision curve. Points are handled relative to the static seed:
x = o + rho_1 R (v - s_1) on body 1, y = rho_2 (v - s_2) on body 2, with o = R s_1 + t - s_2.

A *frame* is one row of numbers for a scale pair and a pose, in units in which the larger body reaches about 1:
rho_1, rho_2, the unit's length, o, and R row by row. All of it is nan where scales or pose are none.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from fcdm_opt.tolerances import DEFAULT

UNIT, OFFSET, TURN, FRAME = 2, 3, 6, 15  # places in a frame, after the scales; its length
PARALLEL, TIE, NEAR = DEFAULT.line, DEFAULT.tie, DEFAULT.side
ROOM = 8.0  # two bodies of unit reach and their offset are no further apart and no deeper in each other than this
ROUNDING = 4.0 * np.finfo(np.float64).eps  # of a difference of points or a sum of their products, times their reach
_INF = np.inf


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile with the options all kernels share: cached, no fastmath (nan matters), "numpy" division."""
    try:
        return numba.njit(cache=True, error_model="numpy", nogil=True)(function)
    except RuntimeError:  # nowhere to write a cache: compile anew in every process
        return numba.njit(error_model="numpy", nogil=True)(function)


def step(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile into every kernel that calls it; nothing is allocated there, so arrays need no counting of references."""
    options: dict[str, Any] = {"error_model": "numpy", "nogil": True, "_nrt": False}
    return numba.njit(**options)(function)


# ------------------------------------------------------------------------------------------------- vectors as tuples


@step
def _at(points, k):
    return points[k, 0], points[k, 1], points[k, 2]


@step
def _dot(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@step
def _cross(u, v):
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@step
def _minus(u, v):
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


@step
def _plus(u, s, v):
    """Return u + s v."""
    return u[0] + s * v[0], u[1] + s * v[1], u[2] + s * v[2]


@step
def _turned(R, v):
    """Return R v for the rotation in the first three columns."""
    return (
        R[0, 0] * v[0] + R[0, 1] * v[1] + R[0, 2] * v[2],
        R[1, 0] * v[0] + R[1, 1] * v[1] + R[1, 2] * v[2],
        R[2, 0] * v[0] + R[2, 1] * v[1] + R[2, 2] * v[2],
    )


@step
def _larger(a, b):
    """Return the larger one, nan if either is."""
    return b if b > a or b != b else a


# ------------------------------------------------------------------------------------------------------- whole bodies


@kernel
def solid(vertices, seed, corners, starts, edges):
    """Return what a part is made of, from the seed, and its points with equal extents along all directions.

    Faces are `corners` from their `starts` on, edges (origin, end, ...). Points (n, 3); (unit normal, level, how far
    the normal may be off) of each face; edges as vectors; the ball about all: centre and radius; and an affine image of
    the points whose coordinates are orthonormal columns, of the same orientation.
    """
    count, reach = len(vertices), 0.0
    points, planes, sides = np.empty((count, 3)), np.empty((len(starts) - 1, 5)), np.empty((len(edges), 3))
    ball, even = np.zeros(4), np.empty((count, 3))
    for m in range(count):
        for j in range(3):
            points[m, j] = vertices[m, j] - seed[j]
            ball[j] += points[m, j] / count
        reach = max(reach, np.sqrt(_dot(_at(points, m), _at(points, m))))
    for m in range(count):
        for j in range(3):
            even[m, j] = points[m, j] - ball[j]
        ball[3] = max(ball[3], np.sqrt(even[m, 0] ** 2 + even[m, 1] ** 2 + even[m, 2] ** 2))
    for m in range(len(starts) - 1):
        base, n, around = _at(points, corners[starts[m]]), (0.0, 0.0, 0.0), 0.0
        for k in range(starts[m] + 1, starts[m + 1] - 1):
            u, v = _minus(_at(points, corners[k]), base), _minus(_at(points, corners[k + 1]), base)
            n = _plus(n, 1.0, _cross(u, v))
            around += np.sqrt(_dot(u, u)) + np.sqrt(_dot(v, v))
        length, level = np.sqrt(_dot(n, n)), -_INF
        n = (n[0] / length, n[1] / length, n[2] / length)
        doubt = ROUNDING * reach * around / length
        for k in range(starts[m], starts[m + 1]):
            level = max(level, _dot(n, _at(points, corners[k])))
        for k in range(count if doubt > TIE else 0):  # a sliver's plane may leave other vertices outside
            level = max(level, _dot(n, _at(points, k)))
        planes[m, 0], planes[m, 1], planes[m, 2], planes[m, 3], planes[m, 4] = n[0], n[1], n[2], level, doubt
    for m in range(len(edges)):
        sides[m, 0], sides[m, 1], sides[m, 2] = _minus(_at(points, edges[m, 1]), _at(points, edges[m, 0]))
    for j in range(3):  # Gram and Schmidt, twice: thin parts too come out orthonormal
        for i in range(2 * j):
            along = 0.0
            for m in range(count):
                along += even[m, i % j] * even[m, j]
            for m in range(count):
                even[m, j] -= along * even[m, i % j]
        square = 0.0
        for m in range(count):
            square += even[m, j] ** 2
        for m in range(count):
            even[m, j] /= np.sqrt(square)
    return points, planes, sides, ball, even


@kernel
def framed(pairs, transforms, seeds, reaches):
    """Return the frame of each scale pair and pose, (k, 15); the unit is a power of two, so nothing is rounded."""
    frames = np.full((len(pairs), FRAME), np.nan)
    for k in range(len(pairs)):
        one, two, T, frame = pairs[k, 0], pairs[k, 1], transforms[k], frames[k]
        total = one + two
        for i in range(4):
            for j in range(4):
                total += T[i, j]
        if not (np.isfinite(total) and one > 0.0 and two > 0.0):
            continue
        unit = 2.0 ** np.ceil(np.log2(max(one * reaches[0], two * reaches[1])))
        frame[0], frame[1], frame[UNIT] = one / unit, two / unit, unit
        moved = _turned(T, _at(seeds, 0))
        for i in range(3):
            frame[OFFSET + i] = (moved[i] + T[i, 3] - seeds[1, i]) / unit
            for j in range(3):
                frame[TURN + 3 * i + j] = T[i, j]
    return frames


@kernel
def placed(points, frames, moving):
    """Return a body's points, (n, 3) from its seed, in each frame, (k, n, 3)."""
    found = np.empty((len(frames), len(points), 3))
    for k in range(len(frames)):
        frame, rows = frames[k], found[k]
        R = frame[TURN:].reshape(3, 3)
        for m in range(len(points)):
            if moving:
                x = _turned(R, _at(points, m))
                for i in range(3):
                    rows[m, i] = frame[OFFSET + i] + frame[0] * x[i]
            else:
                for i in range(3):
                    rows[m, i] = frame[1] * points[m, i]
    return found


@step
def _outside(planes, scale, p):
    """Return how far p is outside the scaled planes of a part, (normal, level) each; negative inside."""
    found = -_INF
    for m in range(len(planes)):
        found = _larger(found, _dot(_at(planes, m), p) - scale * planes[m, 3])
    return found


@kernel
def believed(planes, others, frames, values, firsts, seconds):
    """Tell which signed distances can be: near touch their witnesses must lie in the parts and be that far apart."""
    found = np.zeros(len(frames), np.bool_)
    for k in range(len(frames)):
        frame, value = frames[k], abs(values[k])
        offset = (frame[OFFSET], frame[OFFSET + 1], frame[OFFSET + 2])
        if not value <= abs(offset[0]) + abs(offset[1]) + abs(offset[2]) + ROOM:
            continue
        if value <= NEAR:
            R, p, q = frame[TURN:].reshape(3, 3), _minus(_at(firsts, k), offset), _at(seconds, k)
            own = (
                R[0, 0] * p[0] + R[1, 0] * p[1] + R[2, 0] * p[2],
                R[0, 1] * p[0] + R[1, 1] * p[1] + R[2, 1] * p[2],
                R[0, 2] * p[0] + R[1, 2] * p[1] + R[2, 2] * p[2],
            )
            way = _minus(q, _at(firsts, k))
            error = _larger(_outside(planes, frame[0], own), _outside(others, frame[1], q))
            if not _larger(error, abs(np.sqrt(_dot(way, way)) - value)) <= TIE:
                continue
        found[k] = True
    return found


# A packed body: its parts' vertices from the seed (n, 3), planes (f, 5), edges (m, 3), where each part's begin in them
# (parts + 1, 3), balls about the parts (parts, 4): centre and radius, and of each edge (m, 3) the vertex of its part
# that it leaves and the faces of its part on its two sides.


@kernel
def nearness(one, two, frames):
    """Return lower bounds of the signed distances of all part pairs, (k, parts 1, parts 2), in units.

    How far the spheres about the parts are apart; where they meet, the largest gap along the parts' face normals.
    """
    count, others = len(one[3]) - 1, len(two[3]) - 1
    found = np.empty((len(frames), count, others))
    X, Y = np.empty_like(one[0]), np.empty_like(two[0])
    planes, none, edges = np.empty((len(one[1]), 3)), np.empty((0, 3)), np.empty((0, 2), np.int32)
    for k in range(len(frames)):
        _place(one, two, frames[k], X, Y, planes, none)
        for i in range(count):
            for j in range(others):
                bound = _ball_gap(one, two, i, j, frames[k])
                if bound <= 0.0:
                    bound = max(bound, _largest(one, two, i, j, X, Y, planes, none, edges))
                found[k, i, j] = bound
    return found


@kernel
def least_gaps(one, two, most, frames):
    """Return the least over the part pairs of the largest gap along any direction that can separate most, (k,), units.

    These are all face normals and the edge x edge directions that are normals of facets of the parts' difference; nan
    where a part pair that may be the nearest has more than `most` pairs of edges. Pairs whose spheres are further apart
    than the least so far are passed over.
    """
    found, count, others = np.empty(len(frames)), len(one[3]) - 1, len(two[3]) - 1
    X, Y = np.empty_like(one[0]), np.empty_like(two[0])
    planes, sides, hands = np.empty((len(one[1]), 3)), np.empty((len(one[2]), 3)), np.empty(len(two[1]), np.int8)
    edges, kept, last = np.empty((min(most, len(one[2]) * len(two[2])), 2), np.int32), 0, -1
    for k in range(len(frames)):
        _place(one, two, frames[k], X, Y, planes, sides)
        for i in range(TURN, FRAME):
            if k > 0 and frames[k, i] != frames[k - 1, i]:
                last = -1
        least = unknown = _INF
        nearest, start = _INF, 0
        for pair in range(count * others):
            bound = _ball_gap(one, two, pair // others, pair % others, frames[k])
            if bound < nearest:
                nearest, start = bound, pair
        for step in range(count * others):
            pair = (start + step) % (count * others)
            i, j = pair // others, pair % others
            bound = _ball_gap(one, two, i, j, frames[k])
            if (one[3][i + 1, 2] - one[3][i, 2]) * (two[3][j + 1, 2] - two[3][j, 2]) > most:
                unknown = min(unknown, bound)
            elif bound <= least:
                if pair != last:  # which edges make facets depends on the rotation alone
                    kept, last = _facets(one, two, i, j, planes, sides, hands, edges), pair
                least = min(least, _largest(one, two, i, j, X, Y, planes, sides, edges[:kept]))
        known = frames[k, UNIT] == frames[k, UNIT] and unknown > least
        found[k] = least if known else np.nan
    return found


@step
def _place(one, two, frame, X, Y, planes, sides):
    """Write the points of both bodies and, of body 1, the face normals and edges, turned."""
    R = frame[TURN:].reshape(3, 3)
    offset = (frame[OFFSET], frame[OFFSET + 1], frame[OFFSET + 2])
    for m in range(len(X)):
        X[m, 0], X[m, 1], X[m, 2] = _plus(offset, frame[0], _turned(R, _at(one[0], m)))
    for m in range(len(Y)):
        for i in range(3):
            Y[m, i] = frame[1] * two[0][m, i]
    for m in range(len(planes)):
        planes[m, 0], planes[m, 1], planes[m, 2] = _turned(R, _at(one[1], m))
    for m in range(len(sides)):
        sides[m, 0], sides[m, 1], sides[m, 2] = _turned(R, _at(one[2], m))


@step
def _ball_gap(one, two, i, j, frame):
    R, balls, others = frame[TURN:].reshape(3, 3), one[4], two[4]
    x = _plus((frame[OFFSET], frame[OFFSET + 1], frame[OFFSET + 2]), frame[0], _turned(R, _at(balls, i)))
    way = _plus(x, -frame[1], _at(others, j))
    return np.sqrt(_dot(way, way)) - frame[0] * balls[i, 3] - frame[1] * others[j, 3]


@step
def _largest(one, two, i, j, X, Y, planes, sides, edges):
    """Return the largest gap of two parts over their face normals and the directions of pairs of `edges`.

    Every vertex is projected on every direction that is not worse by two of them already: first by the extreme ones of
    the direction before.
    """
    X = X[one[3][i, 0] : one[3][i + 1, 0]]
    Y = Y[two[3][j, 0] : two[3][j + 1, 0]]
    best, far, near = -_INF, 0, 0
    for m in range(one[3][i, 1], one[3][i + 1, 1]):
        best, far, near = _wider(best, far, near, _at(planes, m), X, Y)
    for m in range(two[3][j, 1], two[3][j + 1, 1]):
        n = _at(two[1], m)
        best, far, near = _wider(best, far, near, (-n[0], -n[1], -n[2]), X, Y)
    for k in range(len(edges)):
        m, other = edges[k, 0], edges[k, 1]
        n = _cross(_at(sides, m), _at(two[2], other))
        length = np.sqrt(_dot(n, n))
        n = (n[0] / length, n[1] / length, n[2] / length)
        between = _dot(n, _minus(_at(Y, two[5][other, 0]), _at(X, one[5][m, 0])))  # no gap along n is wider
        if between > best:
            best, far, near = _wider(best, far, near, n, X, Y)
        if -between > best:
            best, far, near = _wider(best, far, near, (-n[0], -n[1], -n[2]), X, Y)
    return best


@step
def _facets(one, two, i, j, planes, sides, hands, edges):
    """Write pairs of edges of two parts into `edges` that may make a facet of their difference; return how many.

    They do only where the arcs between the normals of the faces beside them cross: where the faces of either lie on
    different sides of the other. Others are left out, unless rounding may have chosen the side; and parallel ones.
    `hands`, one a face of body 2, is written over.
    """
    first, second, kept = one[3][i, 1], two[3][j, 1], 0
    reaches = ROUNDING * _reach(one[4][i]), ROUNDING * _reach(two[4][j])
    for m in range(one[3][i, 2], one[3][i + 1, 2]):
        u, a, b = _at(sides, m), first + one[5][m, 1], first + one[5][m, 2]
        own, p, q, off = np.sqrt(_dot(u, u)), _at(planes, a), _at(planes, b), TIE + max(one[1][a, 4], one[1][b, 4])
        for face in range(second, two[3][j + 1, 1]):
            height, doubt = _dot(u, _at(two[1], face)), own * (TIE + two[1][face, 4]) + reaches[0]
            hands[face] = (height > doubt) - (height < -doubt)
        for other in range(two[3][j, 2], two[3][j + 1, 2]):
            if hands[second + two[5][other, 1]] * hands[second + two[5][other, 2]] > 0:
                continue
            v = _at(two[2], other)
            length = np.sqrt(_dot(v, v))
            if _one_sided(_dot(v, p), _dot(v, q), length * off + reaches[1]):
                continue
            n = _cross(u, v)
            if np.sqrt(_dot(n, n)) > PARALLEL * own * length:
                edges[kept] = m, other
                kept += 1
    return kept


@step
def _reach(ball):
    return np.sqrt(ball[0] ** 2 + ball[1] ** 2 + ball[2] ** 2) + ball[3]


@step
def _one_sided(a, b, doubt):
    """Tell whether two heights have the same sign beyond doubt."""
    return (a > doubt and b > doubt) or (a < -doubt and b < -doubt)


@step
def _wider(best, i, j, n, X, Y):
    """Return the larger of the best gap and that along n, and points i, j that came near the extremes along it."""
    if _dot(n, _minus(_at(Y, j), _at(X, i))) <= best:
        return best, i, j
    high, low = -_INF, _INF
    for m in range(len(X)):
        level = _dot(n, _at(X, m))
        if level > high:
            high, i = level, m
    for m in range(len(Y)):
        level = _dot(n, _at(Y, m))
        if level < low:
            low, j = level, m
            if low - high <= best:
                break
    return max(best, low - high), i, j


# ----------------------------------------------------------------------------------------------------- claimed contacts
# A host: vertices of the part of body 1 and of body 2, from the seeds; rows of both elements; the direction, as rows of
# either part, 3 and none, none and 3, or 2 and 2, and its sign.


@step
def _normal(one, two, across, along, sign, T):
    """Return the unit contact normal; nan where two edges are parallel."""
    if len(across) == 3:
        base = _at(one, across[0])
        u, v = _turned(T, _minus(_at(one, across[1]), base)), _turned(T, _minus(_at(one, across[2]), base))
    elif len(along) == 3:
        base = _at(two, along[0])
        u, v = _minus(_at(two, along[1]), base), _minus(_at(two, along[2]), base)
    else:
        u = _turned(T, _minus(_at(one, across[1]), _at(one, across[0])))
        v = _minus(_at(two, along[1]), _at(two, along[0]))
    n = _cross(u, v)
    length = np.sqrt(_dot(n, n))
    if not length > TIE * np.sqrt(_dot(u, u)) * np.sqrt(_dot(v, v)):
        return np.nan, np.nan, np.nan
    return sign * n[0] / length, sign * n[1] / length, sign * n[2] / length


@kernel
def edge_sign(one, two, across, along, T):
    """Return the sign of edge 1 x edge 2 that leads out of part 1: the side on which less of it lies; 0 if parallel."""
    n = _normal(one, two, across, along, 1, T)
    if n[0] != n[0]:
        return 0
    low, high, base = _INF, -_INF, _at(one, across[0])
    for m in range(len(one)):
        height = _dot(n, _turned(T, _minus(_at(one, m), base)))
        low, high = min(low, height), max(high, height)
    return 1 if high <= -low else -1


@kernel
def contact_rows(one, two, first, second, across, along, sign, seeds, poses):
    """Return (n, a, b, c) at each pose, (k, 6): the unit normal and the contact line.

    The separation of two claimed vertices along the normal is affine in the scales, c - a rho_1 - b rho_2: three scale
    pairs give it.
    """
    rows = np.empty((len(poses), 6))
    for k in range(len(poses)):
        T = poses[k]
        n = _normal(one, two, across, along, sign, T)
        x, y, seed = _turned(T, _at(one, first[0])), _at(two, second[0]), _turned(T, _at(seeds, 0))
        offset = (seed[0] + T[0, 3] - seeds[1, 0], seed[1] + T[1, 3] - seeds[1, 1], seed[2] + T[2, 3] - seeds[1, 2])
        zero = (0.0, 0.0, 0.0)
        base = _dot(n, _minus(_plus(zero, 1.0, y), _plus(offset, 1.0, x)))
        wider = _dot(n, _minus(_plus(zero, 1.0, y), _plus(offset, 2.0, x)))
        longer = _dot(n, _minus(_plus(zero, 2.0, y), _plus(offset, 1.0, x)))
        rows[k, 0], rows[k, 1], rows[k, 2] = n
        rows[k, 3], rows[k, 4], rows[k, 5] = base - wider, base - longer, 3.0 * base - wider - longer
    return rows


@kernel
def contact_errors(one, two, first, second, across, along, sign, seeds, pairs, poses):
    """Return how far the claim is from being a real contact at each scale pair and pose, (k,), lengths.

    The largest of: distance of a common point from either element, and how far either part reaches across the plane
    through it; infinite where there is none.
    """
    errors = np.empty(len(poses))
    X, Y = np.empty_like(one), np.empty_like(two)
    for k in range(len(poses)):
        T = poses[k]
        n = _normal(one, two, across, along, sign, T)
        seed = _turned(T, _at(seeds, 0))
        offset = (seed[0] + T[0, 3] - seeds[1, 0], seed[1] + T[1, 3] - seeds[1, 1], seed[2] + T[2, 3] - seeds[1, 2])
        for m in range(len(one)):
            X[m, 0], X[m, 1], X[m, 2] = _plus(offset, pairs[k, 0], _turned(T, _at(one, m)))
        for m in range(len(two)):
            for i in range(3):
                Y[m, i] = pairs[k, 1] * two[m, i]
        if len(first) == 1:
            point = _at(X, first[0])
            error = _off(Y, second, point)
        elif len(second) == 1:
            point = _at(Y, second[0])
            error = _off(X, first, point)
        elif len(first) == len(second) == len(across) == len(along) == 2:
            point = _crossing(_at(X, first[0]), _at(X, first[1]), _at(Y, second[0]), _at(Y, second[1]))
            error = _larger(_off(X, first, point), _off(Y, second, point))
        else:
            error, point = _shared(X, first, Y, second)
        level = _dot(n, point)
        for m in range(len(X)):
            error = _larger(error, _dot(n, _at(X, m)) - level)
        for m in range(len(Y)):
            error = _larger(error, level - _dot(n, _at(Y, m)))
        errors[k] = error if error == error else _INF
    return errors


@step
def _crossing(a, b, c, d):
    """Return the point of the line a b that is nearest to the line c d."""
    u, v = _minus(b, a), _minus(d, c)
    n = _cross(u, v)
    return _plus(a, _dot(_cross(_minus(c, a), v), n) / _dot(n, n), u)


@step
def _shared(X, first, Y, second):
    """Return a point of two flush elements and its distances from both together: a corner of what they share.

    That is a corner of one of them, or a place where their sides cross.
    """
    way = _minus(_at(X, first[1]), _at(X, first[0]))
    enough = PARALLEL * np.sqrt(_dot(way, way))
    best, point = _INF, _at(X, first[0])
    for m in range(len(first) + len(second)):
        corner = _at(X, first[m]) if m < len(first) else _at(Y, second[m - len(first)])
        off = _off(Y, second, corner) if m < len(first) else _off(X, first, corner)
        if off < best:
            best, point = off, corner
        if best <= enough:
            return best, point
    for m in range(len(first) if len(first) > 2 else 1):
        a, b = _at(X, first[m]), _at(X, first[(m + 1) % len(first)])
        for other in range(len(second) if len(second) > 2 else 1):
            corner = _crossing(a, b, _at(Y, second[other]), _at(Y, second[(other + 1) % len(second)]))
            off = _off(X, first, corner) + _off(Y, second, corner)
            if off < best:
                best, point = off, corner
            if best <= enough:
                return best, point
    return best, point


@step
def _off(points, rows, p):
    """Return how far p is from a vertex, a segment or a planar convex polygon in loop order."""
    base = _at(points, rows[0])
    if len(rows) == 1:
        way = _minus(p, base)
        return np.sqrt(_dot(way, way))
    if len(rows) == 2:
        return _off_segment(base, _at(points, rows[1]), p)
    count = len(rows)
    middle, normal = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for m in range(count):
        corner, following = _at(points, rows[m]), _at(points, rows[(m + 1) % count])
        middle = _plus(middle, 1.0, corner)
        normal = _plus(normal, 1.0, _cross(_minus(corner, base), _minus(following, corner)))
    length = np.sqrt(_dot(normal, normal))
    normal = (normal[0] / length, normal[1] / length, normal[2] / length)
    height = abs(_dot(_minus(p, (middle[0] / count, middle[1] / count, middle[2] / count)), normal))
    outside, nearest = 0.0, _INF
    for m in range(count):
        corner, following = _at(points, rows[m]), _at(points, rows[(m + 1) % count])
        outward = _cross(_minus(following, corner), normal)
        outside = _larger(outside, _dot(_minus(p, corner), outward) / np.sqrt(_dot(outward, outward)))
        nearest = min(nearest, _off_segment(corner, following, p))
    return _larger(height, outside) if outside == 0.0 else _larger(height, _larger(outside, nearest))


@step
def _off_segment(a, b, p):
    u, w = _minus(b, a), _minus(p, a)
    t = _dot(w, u) / _dot(u, u)
    way = _minus(w, _plus((0.0, 0.0, 0.0), min(max(t, 0.0), 1.0), u))
    return np.sqrt(_dot(way, way))
