"""All numba kernels, in one file (the disk cache does not follow imports between files).

They take a part's packed arrays (`packing`: vertices relative to the seed, face normals with error bounds, half-edges)
and a pose, (12,): the rotation R of body 1, row by row, then d = s_2 - s_1 with the moved seed. Body 1 stays in its own
axes: directions are turned to it, never its vertices.

A *site* (kind, i, j) is a facet of the Minkowski difference: F1V2 = face i of part 1 with vertex j of part 2,
V1F2 = vertex i with face j, E1E2 = edge i with edge j. A *row* is (n, a, b, c): unit direction from body 1 to body 2
in world axes, and the contact line a rho_1 + b rho_2 = c.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba.core import event

F1V2, V1F2, E1E2 = 0, 1, 2
WALKED, UNDECIDED, CROWDED = 0, 1, 2  # how a walk ended: done, left to exact arithmetic, no room for the answer
FAR, AXIS_1, AXIS_2 = 0, 1, 2  # how a chain ends: at infinity, where rho_1 = 0, where rho_2 = 0
_INF = np.inf
UNIT = 2.0**-53
# Error bounds of the walk's sign tests, in units of 2^-53 and of the product of the sizes that enter; each counts the
# rounding of the input (1 a vertex, 2 for d), of products and sums, and of turning by R, and is then rounded up.
TRIPLE = 64.0 * UNIT  # a triple product of vertices, d, or both: below 30
SPOKE = 72.0 * UNIT  # a face normal times the way between two vertices, besides twice the normal's own error: below 40
FINE = 2e-14  # edges whose cross product may be off by more are crossed in twice the precision


class _Announcement(event.Listener):
    """Says once that kernels are being compiled; those found in the cache are not."""

    said = False

    def on_start(self, event: Any) -> None:
        if not self.said and event.data["dispatcher"].py_func.__module__ == __name__:
            self.said = True
            logging.getLogger("fcdm_opt").warning("compiling the numerical kernels: half a minute, once")

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Announcement())


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile with the options all kernels share.

    Cached, as compiling takes seconds; no fastmath, as NaN and the order of sums matter; no bounds checks; "numpy"
    division, so that nothing tests for zero twice.
    """
    try:
        return numba.njit(cache=True, error_model="numpy", nogil=True)(function)
    except RuntimeError:  # nowhere to write a cache: compile anew in every process
        return numba.njit(error_model="numpy", nogil=True)(function)


def step(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile into every kernel that calls it: handing over six arrays costs more than most steps of the walk."""
    # nothing is allocated here, so arrays need no counting of references, which would take half of the time
    options: dict[str, Any] = {"error_model": "numpy", "nogil": True, "forceinline": True, "_nrt": False}
    return numba.njit(**options)(function)


# ------------------------------------------------------------------------------------------------- vectors as tuples


@step
def _at(rows, k):
    row = np.uintp(k)  # unsigned: no test for negative indices
    return rows[row, 0], rows[row, 1], rows[row, 2]


@step
def _dot(u, x):
    return u[0] * x[0] + u[1] * x[1] + u[2] * x[2]


@step
def _cross(u, x):
    return u[1] * x[2] - u[2] * x[1], u[2] * x[0] - u[0] * x[2], u[0] * x[1] - u[1] * x[0]


@step
def _minus(u, x):
    return u[0] - x[0], u[1] - x[1], u[2] - x[2]


@step
def _times(s, x):
    return s * x[0], s * x[1], s * x[2]


@step
def _length(x):
    return np.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])


@step
def _turned(M, k, x):
    """Return M x for the 3 x 3 matrix that starts at entry k."""
    return (
        M[k] * x[0] + M[k + 1] * x[1] + M[k + 2] * x[2],
        M[k + 3] * x[0] + M[k + 4] * x[1] + M[k + 5] * x[2],
        M[k + 6] * x[0] + M[k + 7] * x[1] + M[k + 8] * x[2],
    )


@step
def _turned_back(M, k, x):
    """Return the transpose of the 3 x 3 matrix that starts at entry k, times x."""
    return (
        M[k] * x[0] + M[k + 3] * x[1] + M[k + 6] * x[2],
        M[k + 1] * x[0] + M[k + 4] * x[1] + M[k + 7] * x[2],
        M[k + 2] * x[0] + M[k + 5] * x[1] + M[k + 8] * x[2],
    )


# --------------------------------------------------------------------------- twice the precision: sums of two floats


@step
def _two_sum(a, b):
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


@step
def _two_product(a, b):
    p = a * b
    s = 134217729.0 * a
    high = s - (s - a)
    t = 134217729.0 * b
    top = t - (t - b)
    return p, ((high * top - p) + high * (b - top) + (a - high) * top) + (a - high) * (b - top)


@kernel
def _fine_dot(u, high, low):
    """Return u . (high + low) as a sum of two floats."""
    p, e = _two_product(u[0], high[0])
    q, f = _two_product(u[1], high[1])
    r, g = _two_product(u[2], high[2])
    s, h = _two_sum(p, q)
    t, i = _two_sum(s, r)
    return _two_sum(t, h + i + e + f + g + u[0] * low[0] + u[1] * low[1] + u[2] * low[2])


@kernel
def _fine_difference(reals, ints, a, b):
    """Return vertex b less vertex a, with what rounding took from them, as two tuples."""
    x, y = _at(reals, a), _at(reals, b)
    more = ints[0] + ints[1] + 1
    p, q = _at(reals, more + a), _at(reals, more + b)
    s0, e0 = _two_sum(y[0], -x[0])
    s1, e1 = _two_sum(y[1], -x[1])
    s2, e2 = _two_sum(y[2], -x[2])
    return (s0, s1, s2), (e0 + (q[0] - p[0]), e1 + (q[1] - p[1]), e2 + (q[2] - p[2]))


@kernel
def _fine_cross_entry(u, p, x, q, i, j):
    """Return entry u_i x_j - u_j x_i of the cross product of u + p and x + q, rounded once."""
    s, e = _two_product(u[i], x[j])
    t, f = _two_product(u[j], x[i])
    w, g = _two_sum(s, -t)
    return w + (g + (e - f) + (u[i] * q[j] + p[i] * x[j]) - (u[j] * q[i] + p[j] * x[i]))


@kernel
def _fine_cross(reals1, ints1, reals2, ints2, frame, a, b, u, v):
    """Return the cross product of two edges in world axes, from the vertices as they are."""
    high, low = _fine_difference(reals1, ints1, a, b)
    e0, f0 = _fine_dot((frame[0], frame[1], frame[2]), high, low)
    e1, f1 = _fine_dot((frame[3], frame[4], frame[5]), high, low)
    e2, f2 = _fine_dot((frame[6], frame[7], frame[8]), high, low)
    across, rest = _fine_difference(reals2, ints2, u, v)
    e, f = (e0, e1, e2), (f0, f1, f2)
    return (
        _fine_cross_entry(e, f, across, rest, 1, 2),
        _fine_cross_entry(e, f, across, rest, 2, 0),
        _fine_cross_entry(e, f, across, rest, 0, 1),
    )


@step
def _set_pose(transform, seed1, seed2, pose):
    """Fill the pose (R row by row, d = s_2 - moved s_1) of a 4 x 4 transform; d is right to a few roundings."""
    size = 0.0
    for i in range(3):
        row = transform[i, 0], transform[i, 1], transform[i, 2]
        pose[3 * i], pose[3 * i + 1], pose[3 * i + 2] = row
        pose[9 + i] = seed2[i] - transform[i, 3] - _dot(row, seed1)
        size += np.abs(seed1[i]) + np.abs(seed2[i]) + np.abs(transform[i, 3])
    if size <= 8.0 * (np.abs(pose[9]) + np.abs(pose[10]) + np.abs(pose[11])):
        return
    for i in range(3):  # most of it cancels: far from the origin
        row = transform[i, 0], transform[i, 1], transform[i, 2]
        high, low = _fine_dot(row, (seed1[0], seed1[1], seed1[2]), (0.0, 0.0, 0.0))
        s, e = _two_sum(seed2[i], -transform[i, 3])
        t, f = _two_sum(s, -high)
        pose[9 + i] = t + (e + f - low)


@kernel
def relative_pose(transform, seed1, seed2):
    """Return the pose, (12,), of a 4 x 4 transform of body 1: R row by row, then d = s_2 - moved s_1."""
    pose = np.empty(12)
    _set_pose(transform, seed1, seed2, pose)
    return pose


@kernel
def first_not_rigid(transforms, tolerance):
    """Return the index of the first 4 x 4 matrix that is no rigid motion, -1 if there is none."""
    for item in range(len(transforms)):
        T = transforms[item]
        error = np.abs(T[3, 0]) + np.abs(T[3, 1]) + np.abs(T[3, 2]) + np.abs(T[3, 3] - 1.0)
        for i in range(3):
            for j in range(i, 3):
                product = T[i, 0] * T[j, 0] + T[i, 1] * T[j, 1] + T[i, 2] * T[j, 2]
                error = max(error, np.abs(product - (1.0 if i == j else 0.0)))
        volume = _dot(_cross((T[0, 0], T[0, 1], T[0, 2]), (T[1, 0], T[1, 1], T[1, 2])), (T[2, 0], T[2, 1], T[2, 2]))
        finite = np.abs(T[0, 3]) + np.abs(T[1, 3]) + np.abs(T[2, 3]) < _INF
        if not (error <= tolerance and volume > 0.0 and finite):
            return item
    return -1


# ------------------------------------------------------------------------------------------- a feature that is tracked


@kernel
def _rotated(reals, count, pose):
    """Return the first rows of body 1 turned by R, (count, 3)."""
    out = np.empty((count, 3))
    for k in range(count):
        out[k, 0], out[k, 1], out[k, 2] = _turned(pose, 0, _at(reals, k))
    return out


@step
def _side(ints, h):
    """Return origin, end, face on the left and next half-edge of a half-edge."""
    k = np.uintp(ints[3] + 4 * h)
    one, two, three = np.uintp(1), np.uintp(2), np.uintp(3)
    return ints[k], ints[k + one], ints[k + two], ints[k + three]


@kernel
def _face_level(X, ints, face, n, sign):
    """Return the largest sign * n.x over a face's vertices."""
    best = -_INF
    first = h = ints[ints[5] + face]
    while True:
        vertex, _, _, h = _side(ints, h)
        best = max(best, sign * (n[0] * X[vertex, 0] + n[1] * X[vertex, 1] + n[2] * X[vertex, 2]))
        if h == first:
            return best


@kernel
def _site_row(X, ints1, Y, ints2, d, site, row):
    """Fill `row` = (n, a, b, c) of a site, X in world axes; return False where two edges are parallel."""
    kind, i, j = site[0], site[1], site[2]
    n = row[:3]
    if kind == F1V2:
        n[:] = X[ints1[0] + i, :3]
        row[3], row[4] = _face_level(X, ints1, i, n, 1.0), -_dot(n, Y[j])
    elif kind == V1F2:
        n[:] = -Y[ints2[0] + j, :3]
        row[3], row[4] = _dot(n, X[i]), _face_level(Y, ints2, j, n, -1.0)
    else:
        a, b, left, _ = _side(ints1, 2 * i)
        u, v, other, _ = _side(ints2, 2 * j)
        right, beyond = _side(ints1, 2 * i + 1)[2], _side(ints2, 2 * j + 1)[2]
        across = _cross(X[b] - X[a], Y[v] - Y[u])
        length = _length(across)
        if length == 0.0:
            return False
        outside = X[ints1[0] + left] + X[ints1[0] + right] - Y[ints2[0] + other, :3] - Y[ints2[0] + beyond, :3]
        turn = (1.0 if _dot(across, outside) > 0 else -1.0) / length
        n[0], n[1], n[2] = _times(turn, across)
        row[3], row[4] = _dot(n, X[a]), -_dot(n, Y[u])
    row[5] = _dot(n, d)
    return True


@kernel
def tracked_row(reals1, ints1, reals2, ints2, pose, site, sign):
    """Return the row of a site at a pose; parallel edges give nan.

    `sign` orients an edge pair's normal as +-(edge 1 x edge 2), so that it does not jump where the pair stops being a
    facet.
    """
    row = np.full(6, np.nan)
    X = _rotated(reals1, ints1[0] + ints1[1], pose)
    if _site_row(X, ints1, reals2, ints2, pose[9:], site, row) and site[0] == E1E2:
        a, b, _, _ = _side(ints1, 2 * site[1])
        u, v, _, _ = _side(ints2, 2 * site[2])
        n = _cross(X[b] - X[a], _minus(_at(reals2, v), _at(reals2, u)))
        if sign * _dot(n, row) < 0:
            row *= -1.0
    return row


# ---------------------------------------------------------------------------------------- the walk (design section 3)
#
# The boundary of a pair's overlap region is a chain of facets of the Minkowski difference, each next to the one before
# it. What is walked is proved as it is walked, by signs of products alone, each beyond its error bound:
#
#   a site is a facet    a face and the vertex whose neighbours all lie behind it (`_summit`, `_beyond_*`); two edges
#                        whose faces' arcs cross (`_cross_surely`);
#   a corner is real     an edge (a, b) and a vertex p touch: the three weights that write d as a combination of a, b
#                        and p are positive (`_corner`).
#
# Facets give half-planes that hold everywhere, real corners lie on two of them: the chain between is the boundary.


@step
def _set_frame(reals1, ints1, reals2, ints2, pose, planarity, frame):
    """Fill `frame`: R (9), d (3), cofactors of R (9), R^T d (3), then bounds and sizes.

    24, 25: radii of the parts. 26: bound of d-triple products. 27, 28: bounds of triple products of an edge of part 1
    (2) with a vertex of the other part, and 29, 30 with d. 31: bound of spokes per unit of radius. Normals turn by the
    cofactors, so that R need not be orthogonal to the last digit.
    """
    for k in range(12):
        frame[k] = pose[k]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        c = _cross((pose[3 * j], pose[3 * j + 1], pose[3 * j + 2]), (pose[3 * k], pose[3 * k + 1], pose[3 * k + 2]))
        frame[12 + 3 * i], frame[13 + 3 * i], frame[14 + 3 * i] = c
    frame[21], frame[22], frame[23] = _turned_back(pose, 0, (pose[9], pose[10], pose[11]))
    r1, r2 = reals1[ints1[0] + ints1[1], 0], reals2[ints2[0] + ints2[1], 0]
    length = _length((pose[9], pose[10], pose[11]))
    frame[24], frame[25] = r1, r2
    frame[26] = TRIPLE * r1 * r2 * length
    frame[27], frame[28] = TRIPLE * r1 * r1 * r2, TRIPLE * r1 * r2 * r2
    frame[29], frame[30] = TRIPLE * r1 * r1 * length, TRIPLE * r2 * r2 * length
    frame[31] = SPOKE + planarity


@step
def _cell(ints, n):
    """Return the cell of a part's direction grids in which n lies."""
    cells = ints[8]
    axis = 0
    if np.abs(n[1]) > np.abs(n[0]):
        axis = 1
    if np.abs(n[2]) > np.abs(n[axis]):
        axis = 2
    if axis == 0:
        w, u, v = n[0], n[1], n[2]
    elif axis == 1:
        w, u, v = n[1], n[2], n[0]
    else:
        w, u, v = n[2], n[0], n[1]
    size = np.abs(w)
    if not size > 0.0:
        return 0
    half = 0.5 * cells
    i, j = min(int((u / size + 1.0) * half), cells - 1), min(int((v / size + 1.0) * half), cells - 1)
    return ((2 * axis + (0 if w > 0.0 else 1)) * cells + i) * cells + j


@step
def _summit(reals, ints, n):
    """Climb to the vertex extreme along n; return it and by how much it surpasses its highest neighbour."""
    vertex = ints[ints[6] + _cell(ints, n)]
    here = _dot(n, _at(reals, vertex))
    while True:
        best, where = -_INF, vertex
        first = h = ints[np.uintp(ints[4] + vertex)]
        while True:
            other = _side(ints, h)[1]
            height = _dot(n, _at(reals, other))
            if height > best:
                best, where = height, other
            h = _side(ints, h ^ 1)[3]
            if h == first:
                break
        if not best > here:
            return vertex, here - best
        vertex, here = where, best


@step
def _all_around(reals, ints, face, sign, ray, bound):
    """Tell whether a ray surely passes through the cone of a face about the seed (sign -1: its opposite does)."""
    first = h = ints[np.uintp(ints[5] + face)]
    while True:
        a, b, _, h = _side(ints, h)
        if not sign * _dot(_cross(_at(reals, a), _at(reals, b)), ray) > bound:
            return False
        if h == first:
            return True


@step
def _left_through(reals, ints, ray):
    """Return the face that the line of a ray from the seed leaves the part through; -1: it misses, -2: cannot tell."""
    count, inside = ints[0], reals[ints[0] + ints[1], 2] > 0.0
    radius, length = reals[ints[0] + ints[1], 0], _length(ray)
    bound = TRIPLE * radius * radius * length
    if inside:
        face = ints[ints[7] + _cell(ints, ray)]
    else:  # any face about the farthest vertex that looks along the ray
        vertex, _ = _summit(reals, ints, ray)
        face, steepest = -2, 0.0
        first = h = ints[np.uintp(ints[4] + vertex)]
        while True:
            other = _side(ints, h)[2]
            slope = _dot(ray, _at(reals, count + other))
            if slope > steepest:
                face, steepest = other, slope
            h = _side(ints, h ^ 1)[3]
            if h == first:
                break
    for _ in range(ints[1]):
        if face < 0:
            return face
        worst, across = _INF, 0
        first = h = ints[np.uintp(ints[5] + face)]
        while True:
            a, b, _, following = _side(ints, h)
            side = _dot(_cross(_at(reals, a), _at(reals, b)), ray)
            if side < worst:
                worst, across = side, h
            h = following
            if h == first:
                break
        if worst > bound:
            return face
        if not worst < -bound:
            return -2
        face = _side(ints, across ^ 1)[2]
        if not inside:  # beyond the outline there is nothing
            slope = _dot(ray, _at(reals, count + face))
            least = (2.0 * reals[count + face, 3] + SPOKE) * length
            if not slope > least:
                face = -1 if slope < -least else -2
    return -2


@step
def _seed_ray(reals, ints, ray):
    """Return (state, t_in, face_in, t_out, face_out): the part of t ray, t > 0, inside a convex part.

    State 0: missed, 1: hit, 2: cannot tell. t_in = 0 where the seed is inside.
    """
    count = ints[0]
    out = _left_through(reals, ints, ray)
    if out < 0:
        return (0 if out == -1 else 2), 0.0, -1, 0.0, -1
    n = _at(reals, count + out)
    level = _dot(n, _at(reals, _side(ints, ints[ints[5] + out])[0]))
    t_out = level / _dot(n, ray)
    if reals[count + ints[1], 2] > 0.0:
        return 1, 0.0, -1, t_out, out
    least = (2.0 * reals[count + out, 3] + SPOKE) * reals[count + ints[1], 0]
    if level < -least:
        return 0, 0.0, -1, 0.0, -1
    into = _left_through(reals, ints, _times(-1.0, ray))
    if not level > least or into < 0:
        return 2, 0.0, -1, 0.0, -1
    n = _at(reals, count + into)
    level = _dot(n, _at(reals, _side(ints, ints[ints[5] + into])[0]))
    least = (2.0 * reals[count + into, 3] + SPOKE) * reals[count + ints[1], 0]
    if not np.abs(level) > least:
        return 2, 0.0, -1, 0.0, -1
    return 1, max(level / _dot(n, ray), 0.0), into, t_out, out


@step
def _face_row(reals1, ints1, reals2, ints2, frame, kind, face, apex):
    """Return the row (n, a, b, c) of a face and a vertex."""
    if kind == F1V2:
        m = _at(reals1, ints1[0] + face)
        n = _turned(frame, 12, m)
        height = _dot(m, _at(reals1, _side(ints1, ints1[np.uintp(ints1[5] + face)])[0]))
        # cofactors times m, R times x: their product is m.x times the determinant
        first = _dot((frame[0], frame[1], frame[2]), (frame[12], frame[13], frame[14])) * height
        second = -_dot(n, _at(reals2, apex))
    else:
        m = _at(reals2, ints2[0] + face)
        n = _times(-1.0, m)
        first = _dot(_turned_back(frame, 0, n), _at(reals1, apex))
        second = _dot(m, _at(reals2, _side(ints2, ints2[np.uintp(ints2[5] + face)])[0]))
    scale = 1.0 / _length(n)
    level = scale * _dot(n, (frame[9], frame[10], frame[11]))
    return _times(scale, n), scale * first, scale * second, level


@step
def _edge_row(reals1, ints1, reals2, ints2, frame, h1, h2):
    """Return the row (n, a, b, c) of two edges whose arcs cross, n along (half-edge 1) x (half-edge 2)."""
    a, b, _, _ = _side(ints1, h1)
    u, v, _, _ = _side(ints2, h2)
    x, y = _at(reals1, a), _at(reals2, u)
    e, g = _turned(frame, 0, _minus(_at(reals1, b), x)), _minus(_at(reals2, v), y)
    n = _cross(e, g)
    length, long, wide = _length(n), _length(e), _length(g)
    lost = 8.0 * UNIT * (long * wide + frame[24] * wide + frame[25] * long)
    if not lost < FINE * length:
        n = _fine_cross(reals1, ints1, reals2, ints2, frame, a, b, u, v)
        length = _length(n)
    scale = 1.0 / length
    n = _times(scale, n)
    return n, _dot(_turned_back(frame, 0, n), x), -_dot(n, y), _dot(n, (frame[9], frame[10], frame[11]))


@step
def _track(reals1, reals2, frame, forward, kind, apex):
    """Return q, in the axes of the body whose edges are met: the contact moves from q.x < 0 to q.x > 0.

    Face or edge, apex and d stay in one plane, so the contact point runs along the plane's trace.
    """
    if kind == F1V2:
        q = _cross(_at(reals2, apex), (frame[9], frame[10], frame[11]))
        return _times(forward, _turned_back(frame, 0, q))
    return _times(forward, _cross(_turned(frame, 0, _at(reals1, apex)), (frame[9], frame[10], frame[11])))


@step
def _way_out(reals, ints, face, q, bound):
    """Return the half-edge of a face over which the contact point leaves it, and q.x at its ends; -1: cannot tell."""
    first = h = ints[np.uintp(ints[5] + face)]
    before = _dot(q, _at(reals, _side(ints, h)[0]))
    while True:
        _, b, _, following = _side(ints, h)
        after = _dot(q, _at(reals, b))
        if before < -bound and after > bound:
            return h, before, after
        before, h = after, following
        if h == first:
            return -1, 0.0, 0.0


@step
def _corner(reals1, ints1, reals2, ints2, frame, forward, kind, h, apex, before, after):
    """Return (state, rho_1, rho_2) where an edge meets a vertex.

    State 1: they touch for certain; 0: surely at no pair of positive scales; -1: cannot tell. Kind F1V2: half-edge of
    part 1 and vertex of part 2, V1F2 the other way round; `before` < 0 < `after`: q.x at its ends, see `_track`.
    """
    if kind == F1V2:
        a, b, _, _ = _side(ints1, h)
        w = _turned(frame, 12, _cross(_at(reals1, a), _at(reals1, b)))
        det, bound, other = -_dot(w, _at(reals2, apex)), frame[27], frame[29]
    else:
        a, b, _, _ = _side(ints2, h)
        w = _cross(_at(reals2, a), _at(reals2, b))
        det, bound, other = _dot(w, _turned(frame, 0, _at(reals1, apex))), frame[28], frame[30]
    top = _dot(w, (frame[9], frame[10], frame[11]))
    if forward * det < -bound and forward * top < -other:
        own, opposite = -forward * (after - before) / det, top / det
        if kind == F1V2:
            return 1, own, opposite
        return 1, opposite, own
    return (0 if forward * det > bound or forward * top > other else -1), 0.0, 0.0


@step
def _cross_surely(reals1, ints1, reals2, ints2, frame, h1, h2):
    """Tell whether two edges form a facet with n along (half-edge 1) x (half-edge 2): their arcs cross for certain."""
    a, b, left, _ = _side(ints1, h1)
    u, v, over, _ = _side(ints2, h2)
    right, under = _side(ints1, h1 ^ 1)[2], _side(ints2, h2 ^ 1)[2]
    f1, f2 = ints1[0], ints2[0]
    across = _turned_back(frame, 12, _minus(_at(reals2, v), _at(reals2, u)))
    along = _turned(frame, 0, _minus(_at(reals1, b), _at(reals1, a)))
    r1, r2, slack = frame[24], frame[25], frame[31]
    return (
        _dot(across, _at(reals1, f1 + left)) > r2 * (2.0 * reals1[f1 + left, 3] + slack)
        and _dot(across, _at(reals1, f1 + right)) < -r2 * (2.0 * reals1[f1 + right, 3] + slack)
        and _dot(along, _at(reals2, f2 + over)) > r1 * (2.0 * reals2[f2 + over, 3] + slack)
        and _dot(along, _at(reals2, f2 + under)) < -r1 * (2.0 * reals2[f2 + under, 3] + slack)
    )


@step
def _beyond(reals, ints, vertex, start, target, skip, bound):
    """Follow an arc of directions from `start` to `target` out of the normal cone of a vertex.

    Return (state, half-edge): 1 and -1 where the target is in the cone for certain, 0 and the half-edge from the vertex
    whose arc is met first, -1 where it cannot tell. In the cone all ways to a neighbour have a positive product.
    """
    here = _at(reals, vertex)
    least, nearest, found = _INF, _INF, -1
    first = h = ints[np.uintp(ints[4] + vertex)]
    while True:
        spoke = _minus(_at(reals, _side(ints, h)[1]), here)
        after = _dot(target, spoke)
        least = min(least, after)
        if after < -bound and h >> 1 != skip:
            before = _dot(start, spoke)
            at = before / (before - after) if before > 0.0 else 0.0
            if at < nearest:
                nearest, found = at, h
        h = _side(ints, h ^ 1)[3]
        if h == first:
            break
    if found >= 0:
        return 0, found
    return (1 if least > bound else -1), -1


@step
def _runs_away(reals1, ints1, reals2, ints2, frame, h1, h2):
    """Tell whether two edges touch out to infinity for certain: a positive combination of their ends vanishes."""
    a, b, _, _ = _side(ints1, h1)
    u, v, _, _ = _side(ints2, h2)
    x, z = _turned(frame, 0, _at(reals1, a)), _turned(frame, 0, _at(reals1, b))
    one, two = _cross(x, z), _cross(_at(reals2, u), _at(reals2, v))
    p, q = _dot(z, two), -_dot(x, two)
    r, s = -_dot(one, _at(reals2, v)), _dot(one, _at(reals2, u))
    least, most = min(p, q), max(p, q)
    low, high = min(r, s), max(r, s)
    return (least > frame[28] and low > frame[27]) or (most < -frame[28] and high < -frame[27])


@step
def _walk_chain(reals1, ints1, reals2, ints2, frame, forward, kind, face, apex, sites, rows, points):
    """Walk one chain from the axis on which a face and a vertex touch: points[0] is filled by this function.

    Forward (+1) is along (b, -a), with the overlap region on the left; -1 is backward. Fills `sites`, `rows` and
    `points`, whose last row is a direction where the chain runs to infinity. Return (state, segments, end).
    """
    d = frame[9], frame[10], frame[11]
    i, j = (face, apex) if kind == F1V2 else (apex, face)  # E1E2: half-edges, n along i x j
    entered = kind  # how an E1E2 was entered: a vertex of part 2 on its edge of part 1, or the other way round
    for k in range(len(sites)):
        if kind == E1E2:
            sites[k, 0], sites[k, 1], sites[k, 2], sites[k, 3] = E1E2, i >> 1, j >> 1, -1
            n, one, two, level = _edge_row(reals1, ints1, reals2, ints2, frame, i, j)
        else:
            sites[k, 0], sites[k, 1], sites[k, 2], sites[k, 3] = kind, i, j, -1
            if kind == F1V2:
                n, one, two, level = _face_row(reals1, ints1, reals2, ints2, frame, F1V2, i, j)
            else:
                n, one, two, level = _face_row(reals1, ints1, reals2, ints2, frame, V1F2, j, i)
        rows[k, 0], rows[k, 1], rows[k, 2] = n
        rows[k, 3], rows[k, 4], rows[k, 5] = one, two, level
        if k == 0:
            points[0, 0] = level / one if kind == F1V2 else 0.0
            points[0, 1] = level / two if kind == V1F2 else 0.0
        # the half-edge over which the contact point leaves, and the vertex of the other part that it then lies on
        if kind == F1V2:
            meets, vertex, skip = F1V2, j, -1
            h, before, after = _way_out(reals1, ints1, i, _track(reals1, reals2, frame, forward, F1V2, j), frame[26])
        elif kind == V1F2:
            meets, vertex, skip = V1F2, i, -1
            h, before, after = _way_out(reals2, ints2, j, _track(reals1, reals2, frame, forward, V1F2, i), frame[26])
        else:
            a, b, _, _ = _side(ints1, i)
            u, v, _, _ = _side(ints2, j)
            x, z = _at(reals1, a), _at(reals1, b)
            q = _track(reals1, reals2, frame, forward, F1V2, u)
            low, high = _dot(q, x), _dot(q, z)
            q = _track(reals1, reals2, frame, forward, F1V2, v)
            low2, high2 = _dot(q, x), _dot(q, z)
            # where the sign of a product changes between two ends of the square of both edges, the contact point
            # crosses its border; four changes: the products of opposite ends tell which go together
            if entered == F1V2:
                if high2 > 0.0:
                    to_edge, start_side = (True, False) if low2 < 0.0 else (False, True)
                elif low2 > 0.0:
                    to_edge, start_side = False, low * high2 < high * low2
                else:
                    to_edge, start_side = False, False
                meets = F1V2 if to_edge else V1F2
            else:
                if high2 < 0.0:
                    to_edge, start_side = (True, False) if high > 0.0 else (False, True)
                elif high < 0.0:
                    to_edge, start_side = False, low * high2 < high * low2
                else:
                    to_edge, start_side = False, False
                meets = V1F2 if to_edge else F1V2
            if meets == F1V2:
                skip = j >> 1
                if start_side:
                    h, vertex, before, after = i ^ 1, u, high, low
                else:
                    h, vertex, before, after = i, v, low2, high2
            else:
                skip = i >> 1
                if start_side:
                    h, vertex, before, after = j ^ 1, a, -low2, -low
                else:
                    h, vertex, before, after = j, b, -high, -high2
            if not (before < -frame[26] and after > frame[26]):
                h = -1
        real = -1
        if h >= 0:
            real, x1, x2 = _corner(
                reals1, ints1, reals2, ints2, frame, forward, meets, h, vertex, before, after
            )
        if real < 0:
            return UNDECIDED, 0, FAR
        if real == 0:  # the contact never gets there: the chain ends before, on an axis or at infinity
            if kind == E1E2:
                if not _runs_away(reals1, ints1, reals2, ints2, frame, i, j):
                    return UNDECIDED, 0, FAR
            else:
                near = one if kind == F1V2 else -two
                sign = 1.0 if (near > 0.0) == (kind == F1V2) else -1.0
                if kind == F1V2:
                    ray = (frame[21], frame[22], frame[23])
                    if forward * near < 0.0:
                        ray = _turned_back(frame, 0, _at(reals2, j))
                    reached = _all_around(reals1, ints1, i, sign, ray, max(frame[27], frame[29]))
                else:
                    ray = _times(-1.0, d)
                    if forward * near < 0.0:
                        ray = _turned(frame, 0, _at(reals1, i))
                    reached = _all_around(reals2, ints2, j, sign, ray, max(frame[28], frame[30]))
                if not reached:
                    return UNDECIDED, 0, FAR
                if forward * near > 0.0:
                    points[k + 1, 0] = level / one if kind == F1V2 else 0.0
                    points[k + 1, 1] = level / two if kind == V1F2 else 0.0
                    return WALKED, k + 1, (AXIS_2 if kind == F1V2 else AXIS_1)
            steep = np.sqrt(one * one + two * two)
            points[k + 1, 0], points[k + 1, 1] = forward * two / steep, -forward * one / steep
            return WALKED, k + 1, FAR
        points[k + 1, 0], points[k + 1, 1] = x1, x2
        sites[k, 3], sites[k, 4], sites[k, 5] = meets, h >> 1, vertex
        if meets == F1V2:
            beyond = _side(ints1, h ^ 1)[2]
            target = _turned(frame, 12, _at(reals1, ints1[0] + beyond))
            bound = frame[25] * (2.0 * reals1[ints1[0] + beyond, 3] + frame[31])
            state, g = _beyond(reals2, ints2, vertex, n, target, skip, bound)
            kind, i, j = (F1V2, beyond, vertex) if state == 1 else (E1E2, h, g)
        else:
            beyond = _side(ints2, h ^ 1)[2]
            target = _turned_back(frame, 0, _at(reals2, ints2[0] + beyond))
            bound = frame[24] * (2.0 * reals2[ints2[0] + beyond, 3] + frame[31])
            start = _times(-1.0, _turned_back(frame, 0, n))
            state, g = _beyond(reals1, ints1, vertex, start, target, skip, bound)
            kind, i, j = (V1F2, vertex, beyond) if state == 1 else (E1E2, g, h)
        entered = meets
        if state < 0 or (state == 0 and not _cross_surely(reals1, ints1, reals2, ints2, frame, i, j)):
            return UNDECIDED, 0, FAR
    return CROWDED, 0, FAR


@step
def _walk(reals1, ints1, reals2, ints2, frame, sites, rows, points, chains):
    """Walk all chains that start on an axis; return (state, segments, chains). See `walk`."""
    if not (reals1[ints1[0] + ints1[1], 1] > 0.0 and reals2[ints2[0] + ints2[1], 1] > 0.0):
        return UNDECIDED, 0, 0
    d1, back = (frame[21], frame[22], frame[23]), (-frame[9], -frame[10], -frame[11])
    hit1, in1, face_in1, _, face_out1 = _seed_ray(reals2, ints2, back)  # rho_1 = 0: where s_1 lies in part 2
    if hit1 == 2:
        return UNDECIDED, 0, 0
    hit2, in2, face_in2, face_out2 = 0, 0.0, -1, -1
    low_joined = far1_joined = far2_joined = False  # ends on an axis that an earlier chain has reached
    used, made = 0, 0
    for start in range(4):
        if start == 1 and not (low_joined and reals1[ints1[0] + ints1[1], 2] > 0.0):
            # rho_2 = 0: where s_2 lies in part 1; known already where the first chain came from there
            hit2, in2, face_in2, _, face_out2 = _seed_ray(reals1, ints1, d1)
            if hit2 == 2:
                return UNDECIDED, 0, 0
        if start == 0:
            wanted, kind, face, forward = hit1 == 1, V1F2, face_out1, 1.0
        elif start == 1:
            wanted, kind, face, forward = hit2 == 1 and not low_joined, F1V2, face_out2, -1.0
        elif start == 2:
            wanted, kind, face, forward = hit1 == 1 and in1 > 0.0 and not far1_joined, V1F2, face_in1, -1.0
        else:
            wanted, kind, face, forward = hit2 == 1 and in2 > 0.0 and not far2_joined, F1V2, face_in2, 1.0
        if not wanted:
            continue
        if kind == V1F2:
            apex, margin = _summit(reals1, ints1, _turned_back(frame, 0, _times(-1.0, _at(reals2, ints2[0] + face))))
            sure = margin > frame[24] * (2.0 * reals2[ints2[0] + face, 3] + frame[31])
        else:
            apex, margin = _summit(reals2, ints2, _times(-1.0, _turned(frame, 12, _at(reals1, ints1[0] + face))))
            sure = margin > frame[25] * (2.0 * reals1[ints1[0] + face, 3] + frame[31])
        if not sure:
            return UNDECIDED, 0, 0
        state, count, end = _walk_chain(
            reals1, ints1, reals2, ints2, frame, forward, kind, face, apex,
            sites[used:], rows[used:], points[used + made :],
        )  # fmt: skip
        if state != WALKED:
            return state, 0, 0
        chains[made, 0], chains[made, 1], chains[made, 2], chains[made, 3] = used, count, int(forward), end == FAR
        low_joined = low_joined or (start == 0 and end == AXIS_2)
        far1_joined = far1_joined or (start == 0 and end == AXIS_1)
        far2_joined = far2_joined or (start > 0 and end == AXIS_2)
        used += count
        made += 1
    return (WALKED if made > 0 else UNDECIDED), used, made


@kernel
def walk(reals1, ints1, reals2, ints2, pose, planarity):
    """Walk the overlay of the two Gauss maps along the boundary of the pair's overlap region in the open quadrant.

    Chains start where the seed ray of either body enters or leaves the other part. Return (state, sites, rows, points,
    chains): sites (k, 6) = kind, i, j, then the contact at the corner after it, as walked: F1V2 where edge i of part 1
    meets vertex j of part 2, V1F2 where edge i of part 2 meets vertex j of part 1, -1 where there is no corner;
    chains (k, 4) = first segment, segments, direction (+1 walked with the overlap region on the left, -1 on the
    right), whether it runs to infinity; chain c has points from its first segment + c on, one more than segments.

    State UNDECIDED: a sign within its error bound, two features within `planarity`, or no seed ray hits (then the
    boundary is empty, a closed polygon, or runs from infinity to infinity).
    """
    frame = np.empty(32)
    _set_frame(reals1, ints1, reals2, ints2, pose, planarity, frame)
    chains = np.empty((4, 4), np.int64)
    capacity = 32
    while True:
        sites, rows, points = np.empty((capacity, 6), np.int64), np.empty((capacity, 6)), np.empty((capacity + 4, 2))
        state, used, made = _walk(reals1, ints1, reals2, ints2, frame, sites, rows, points, chains)
        if state != CROWDED:
            return state, sites[:used], rows[:used], points[: used + made], chains[:made]
        capacity *= 4


@step
def _clip(start, end, endless, box):
    """Return (lo, hi): the stretch start + t (end - start), 0 <= t <= 1, inside a box; lo >= hi if there is none.

    Where it is endless, `end` is the direction from `start`, and t has no limit.
    """
    lo, hi = 0.0, (_INF if endless else 1.0)
    if not endless:  # most are inside, or on the far side of one border
        if (
            min(start[0], end[0]) >= box[0]
            and max(start[0], end[0]) <= box[1]
            and min(start[1], end[1]) >= box[2]
            and max(start[1], end[1]) <= box[3]
        ):
            return lo, hi
        if (
            max(start[0], end[0]) < box[0]
            or min(start[0], end[0]) > box[1]
            or max(start[1], end[1]) < box[2]
            or min(start[1], end[1]) > box[3]
        ):
            return 0.0, 0.0
    for axis in range(2):
        step = end[axis] if endless else end[axis] - start[axis]
        low, high = box[2 * axis] - start[axis], box[2 * axis + 1] - start[axis]
        if step == 0.0:
            if low > 0.0 or high < 0.0:
                return 0.0, 0.0
        elif step > 0.0:
            lo, hi = max(lo, low / step), min(hi, high / step)
        else:
            lo, hi = max(lo, high / step), min(hi, low / step)
    return lo, hi


@kernel
def walk_many(reals1, ints1, reals2, ints2, transforms, seeds, box, planarity, least):
    """Walk the curves of one pair at many 4 x 4 transforms of body 1, and clip them to a box.

    Box: (low, high) of rho_1, then of rho_2; stretches shorter than `least` relative to their scales are dropped.
    Return (states, counts, sites, rows, ends): states of `walk`, segments of each curve inside the box, and for all
    curves one after the other each segment's site, row and both ends (2, 2), with the overlap region on its left,
    chains in the order of their first scale pairs. States of curves without a segment in the box: WALKED where the
    bodies are apart in its middle, CROWDED where they overlap.
    """
    total = len(transforms)
    states, counts = np.empty(total, np.int64), np.zeros(total, np.int64)
    frame, pose, chains = np.empty(32), np.empty(12), np.empty((4, 4), np.int64)
    room = 32
    sites, rows, points = np.empty((room, 6), np.int64), np.empty((room, 6)), np.empty((room + 4, 2))
    capacity, kept = 4 * total + room, 0
    all_sites, all_rows = np.empty((capacity, 3), np.int64), np.empty((capacity, 6))
    ends = np.empty((capacity, 2, 2))
    item = 0
    while item < total:
        _place(transforms, item, seeds, pose)
        _set_frame(reals1, ints1, reals2, ints2, pose, planarity, frame)
        state, used, made = _walk(reals1, ints1, reals2, ints2, frame, sites, rows, points, chains)
        if state == CROWDED:
            room *= 4
            sites, rows, points = np.empty((room, 6), np.int64), np.empty((room, 6)), np.empty((room + 4, 2))
            continue
        if kept + used > capacity:
            more = 2 * capacity + used
            more_sites, more_rows = np.empty((more, 3), np.int64), np.empty((more, 6))
            more_ends = np.empty((more, 2, 2))
            more_sites[:kept], more_rows[:kept], more_ends[:kept] = all_sites[:kept], all_rows[:kept], ends[:kept]
            all_sites, all_rows, ends, capacity = more_sites, more_rows, more_ends, more
        counts[item] = 0
        if state == WALKED:
            counts[item] = _append(sites, rows, points, chains, made, box, least, all_sites, all_rows, ends, kept)
            if counts[item] == 0 and _overlaps(rows, used, 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3])):
                state = CROWDED
        kept += counts[item]
        states[item] = state
        item += 1
    return states, counts, all_sites[:kept], all_rows[:kept], ends[:kept]


@step
def _place(transforms, item, seeds, pose):
    """Fill the pose of one of many transforms."""
    _set_pose(transforms[item], seeds[0], seeds[1], pose)


@step
def _append(sites, rows, points, chains, made, box, least, all_sites, all_rows, ends, kept):
    """Append the part of a walked curve inside a box from place `kept` on; return the number of segments."""
    before = kept
    done = 0
    for _ in range(made):
        best = -1  # the chain that starts first among those not listed yet
        for chain in range(made):
            if not done >> chain & 1 and (best < 0 or _starts_before(points, chains, chain, best)):
                best = chain
        done |= 1 << best
        first, count, forward, endless = chains[best, 0], chains[best, 1], chains[best, 2], chains[best, 3]
        for index in range(count):
            k = index if forward > 0 else count - 1 - index
            start, end = points[first + best + k], points[first + best + k + 1]
            away = endless > 0 and k == count - 1
            lo, hi = _clip(start, end, away, box)
            size = np.abs(start[0]) + np.abs(start[1])
            length = 1.0
            if not away:
                size = max(size, np.abs(end[0]) + np.abs(end[1]))
                length = np.abs(end[0] - start[0]) + np.abs(end[1] - start[1])
            if not (hi - lo) * length > least * size:
                continue
            for entry in range(6):
                all_rows[kept, entry] = rows[first + k, entry]
            for entry in range(3):
                all_sites[kept, entry] = sites[first + k, entry]
            for side in range(2):
                t = lo if (side == 0) == (forward > 0) else hi
                for axis in range(2):
                    if t == 0.0:
                        ends[kept, side, axis] = start[axis]
                    elif away:
                        ends[kept, side, axis] = start[axis] + t * end[axis] if end[axis] != 0.0 else start[axis]
                    elif t == 1.0:
                        ends[kept, side, axis] = end[axis]
                    else:
                        ends[kept, side, axis] = start[axis] + t * (end[axis] - start[axis])
            kept += 1
    return kept - before


@step
def _overlaps(rows, used, x, y):
    """Tell whether a scale pair lies inside all half-planes of a boundary."""
    inside = True
    for k in range(used):
        inside = inside and rows[k, 3] * x + rows[k, 4] * y >= rows[k, 5]
    return inside


@step
def _starts_before(points, chains, one, two):
    """Order chains by the first scale pair of each, walked with the overlap region on the left."""
    first, count, forward, endless = chains[one, 0], chains[one, 1], chains[one, 2], chains[one, 3]
    p = points[first + one + (0 if forward > 0 else count)]
    far1 = endless > 0 and forward < 0
    first, count, forward, endless = chains[two, 0], chains[two, 1], chains[two, 2], chains[two, 3]
    q = points[first + two + (0 if forward > 0 else count)]
    far2 = endless > 0 and forward < 0
    if far1 != far2:
        return far2
    return p[0] < q[0] or (p[0] == q[0] and p[1] < q[1])


# ----------------------------------------------------------------------------------------------- all facet directions


@kernel
def facet_rows(reals1, ints1, reals2, ints2, pose):
    """Return sites and rows of all facet directions of the Minkowski difference, with true supports.

    Every direction gives a valid constraint. Two arcs of the Gauss maps that meet within rounding may or may not be
    listed: their direction is then that of a face, or of neighbours listed anyway.
    """
    frame = np.empty(32)
    _set_frame(reals1, ints1, reals2, ints2, pose, 0.0, frame)
    n1, f1, n2, f2 = ints1[0], ints1[1], ints2[0], ints2[1]
    capacity = f1 + f2 + 2 * (ints1[2] + ints2[2])
    sites, rows = np.empty((capacity, 3), np.int64), np.empty((capacity, 6))
    count = f1 + f2
    for i in range(f1):
        apex, _ = _summit(reals2, ints2, _times(-1.0, _turned(frame, 12, _at(reals1, n1 + i))))
        _list(sites, rows, i, F1V2, i, apex, _face_row(reals1, ints1, reals2, ints2, frame, F1V2, i, apex))
    for j in range(f2):
        apex, _ = _summit(reals1, ints1, _turned_back(frame, 0, _times(-1.0, _at(reals2, n2 + j))))
        _list(sites, rows, f1 + j, V1F2, apex, j, _face_row(reals1, ints1, reals2, ints2, frame, V1F2, j, apex))
    for edge in range(ints1[2]):
        # follow the arc of the edge, from the normal of the face on its left to that on its right, through the cells
        # of the other part's vertices
        h = 2 * edge
        left, right = _side(ints1, h)[2], _side(ints1, h + 1)[2]
        vertex, skip = sites[left, 2], -1
        n, target = _turned(frame, 12, _at(reals1, n1 + left)), _turned(frame, 12, _at(reals1, n1 + right))
        for _ in range(ints2[2]):
            _, g = _beyond(reals2, ints2, vertex, n, target, skip, frame[25] * SPOKE)
            if g < 0:
                break
            a, b, _, _ = _side(ints1, h)
            along = _turned(frame, 0, _minus(_at(reals1, b), _at(reals1, a)))
            nearer = _dot(along, _at(reals2, n2 + _side(ints2, g)[2]))
            farther = _dot(along, _at(reals2, n2 + _side(ints2, g ^ 1)[2]))
            if nearer > 0.0 and farther < 0.0:
                if count == capacity:
                    capacity *= 2
                    more_sites, more_rows = np.empty((capacity, 3), np.int64), np.empty((capacity, 6))
                    for k in range(count):
                        for entry in range(6):
                            more_rows[k, entry] = rows[k, entry]
                        for entry in range(3):
                            more_sites[k, entry] = sites[k, entry]
                    sites, rows = more_sites, more_rows
                row = _edge_row(reals1, ints1, reals2, ints2, frame, h, g)
                n = row[0]
                _list(sites, rows, count, E1E2, edge, g >> 1, row)
                count += 1
            vertex, skip = _side(ints2, g)[1], g >> 1
    return sites[:count], rows[:count]


@step
def _list(sites, rows, k, kind, i, j, row):
    sites[k, 0], sites[k, 1], sites[k, 2] = kind, i, j
    rows[k, 0], rows[k, 1], rows[k, 2] = row[0]
    rows[k, 3], rows[k, 4], rows[k, 5] = row[1], row[2], row[3]


@kernel
def least_separation(reals1, ints1, reals2, ints2, pose, rho):
    """Return the largest separation over facet directions, max of c - a rho_1 - b rho_2.

    Minus the penetration depth where the parts overlap, a lower bound of the distance where they are apart.
    """
    rows = facet_rows(reals1, ints1, reals2, ints2, pose)[1]
    best = -_INF
    for k in range(len(rows)):
        best = max(best, rows[k, 5] - rows[k, 3] * rho[0] - rows[k, 4] * rho[1])
    return best


@kernel
def separation(reals1, ints1, reals2, ints2, pose, rho, n):
    """Return the separation c - a rho_1 - b rho_2 along one unit direction from body 1 to body 2."""
    direction = n[0], n[1], n[2]
    inward = _turned_back(pose, 0, direction)
    first, _ = _summit(reals1, ints1, inward)
    second, _ = _summit(reals2, ints2, _times(-1.0, direction))
    level = _dot(direction, (pose[9], pose[10], pose[11]))
    return level - _dot(inward, _at(reals1, first)) * rho[0] + _dot(direction, _at(reals2, second)) * rho[1]
