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
# how a walk ended: done, left to exact arithmetic, no room for the answer, no overlap at any scale pair
WALKED, UNDECIDED, CROWDED, EMPTY = 0, 1, 2, 4
CONTACT, OVERLAPPING = 5, 3  # in a box: the curve passes it; it does not, and the bodies overlap (WALKED: are apart)
FAR, AXIS_1, AXIS_2 = 0, 1, 2  # how a chain ends: at infinity, where rho_1 = 0, where rho_2 = 0
_INF = np.inf
UNIT = 2.0**-53
# Error bounds of the walk's sign tests, in units of 2^-53 times the product of the lengths that enter. One operation
# each: a vertex less the seed 1, d 12 (`_set_pose`), cross product 2.8, turning by R 5.2 or by its cofactors 11.2 (they
# are computed), dot product 3.
TRIPLE = 64.0 * UNIT  # triple products of vertices and d: 1 + 1 + 12 + 2.8 + 11.2 + 3 = 31 at most, doubled
SPOKE = 72.0 * UNIT  # face normals times ways between vertices: 2 (11.2 + 3 + 1) + 2 = 32.4 and twice the face's own
FINE = 2e-14  # no line has a direction known less well: edges are crossed in twice the precision, faces left to exact
SLIGHT = 1e-2  # lines shorter than this, relative to the sizes, and corners of shorter edges lose digits
TRIALS = 100  # steps of the search for a direction that separates at every scale
LOST = 2.0**-40  # an offset that cancels to less than this is known to too few digits
# Places in a frame, see `_set_frame`.
R, D, COFACTORS, D_OWN = 0, 9, 12, 21
RADIUS_1, RADIUS_2, OFFSET_BOUND, APEX_BOUND_1, APEX_BOUND_2, RAY_BOUND_1, RAY_BOUND_2, SPOKE_BOUND = range(24, 32)
SIZE, FRAME = 32, 33


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
def _entry(values, k):
    """Return three numbers of a flat array."""
    return values[k], values[k + 1], values[k + 2]


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
    e0, f0 = _fine_dot(_entry(frame, R), high, low)
    e1, f1 = _fine_dot(_entry(frame, R + 3), high, low)
    e2, f2 = _fine_dot(_entry(frame, R + 6), high, low)
    across, rest = _fine_difference(reals2, ints2, u, v)
    e, f = (e0, e1, e2), (f0, f1, f2)
    return (
        _fine_cross_entry(e, f, across, rest, 1, 2),
        _fine_cross_entry(e, f, across, rest, 2, 0),
        _fine_cross_entry(e, f, across, rest, 0, 1),
    )


@step
def _set_pose(transform, seed1, seed2, pose):
    """Fill the pose (R row by row, d = s_2 - moved s_1) of a 4 x 4 transform; tell if d is right to 12 roundings."""
    size = 0.0
    for i in range(3):
        row = transform[i, 0], transform[i, 1], transform[i, 2]
        pose[3 * i], pose[3 * i + 1], pose[3 * i + 2] = row
        pose[9 + i] = seed2[i] - transform[i, 3] - _dot(row, seed1)
        size += np.abs(seed1[i]) + np.abs(seed2[i]) + np.abs(transform[i, 3])
    if size <= 2.0 * (np.abs(pose[9]) + np.abs(pose[10]) + np.abs(pose[11])):
        return True
    for i in range(3):  # most of it cancels: far from the origin
        row = transform[i, 0], transform[i, 1], transform[i, 2]
        high, low = _fine_dot(row, (seed1[0], seed1[1], seed1[2]), (0.0, 0.0, 0.0))
        s, e = _two_sum(seed2[i], -transform[i, 3])
        t, f = _two_sum(s, -high)
        pose[9 + i] = t + (e + f - low)
    return np.abs(pose[9]) + np.abs(pose[10]) + np.abs(pose[11]) > LOST * size


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


@step
def _side(ints, h):
    """Return origin, end, face on the left and next half-edge of a half-edge."""
    k = np.uintp(ints[3] + 4 * h)
    one, two, three = np.uintp(1), np.uintp(2), np.uintp(3)
    return ints[k], ints[k + one], ints[k + two], ints[k + three]


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
    """Fill `frame`: R (9), d (3), cofactors of R (9), R^T d (3), both radii, then error bounds, and the size.

    Of triple products: a vertex of each part with d (OFFSET); two vertices of part 1 (2) with one of the other part
    (APEX) and with d (RAY). SPOKE_BOUND, per unit of radius, is that of a face normal times the way between two
    vertices, and `planarity`. Normals turn by the cofactors, so that R need not be orthogonal to the last digit.
    """
    for k in range(12):
        frame[k] = pose[k]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        c = _cross((pose[3 * j], pose[3 * j + 1], pose[3 * j + 2]), (pose[3 * k], pose[3 * k + 1], pose[3 * k + 2]))
        frame[12 + 3 * i], frame[13 + 3 * i], frame[14 + 3 * i] = c
    frame[21], frame[22], frame[23] = _turned_back(pose, 0, _entry(pose, 9))
    r1, r2 = reals1[ints1[0] + ints1[1], 0], reals2[ints2[0] + ints2[1], 0]
    length = _length(_entry(pose, 9))
    frame[RADIUS_1], frame[RADIUS_2] = r1, r2
    frame[OFFSET_BOUND] = TRIPLE * r1 * r2 * length
    frame[APEX_BOUND_1], frame[APEX_BOUND_2] = TRIPLE * r1 * r1 * r2, TRIPLE * r1 * r2 * r2
    frame[RAY_BOUND_1], frame[RAY_BOUND_2] = TRIPLE * r1 * r1 * length, TRIPLE * r2 * r2 * length
    frame[SPOKE_BOUND] = SPOKE + planarity
    frame[SIZE] = max(r1, r2, length)


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
    """Return the vertex extreme along n, and by how much it surpasses its highest neighbour."""
    return _climbed(reals, ints, ints[ints[6] + _cell(ints, n)], n)


@step
def _climbed(reals, ints, vertex, n):
    """Climb from a vertex to the one extreme along n; return it and by how much it surpasses its highest neighbour."""
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
    """Return (state, face in, face out): where a ray from the seed enters a part, -1 from a seed inside, and leaves it.

    State 0: missed, 1: hit, 2: cannot tell.
    """
    out = _left_through(reals, ints, ray)
    if out < 0:
        return (0 if out == -1 else 2), -1, -1
    if reals[ints[0] + ints[1], 2] > 0.0:
        return 1, -1, out
    side = _seed_side(reals, ints, out)
    if side != 1:
        return (0 if side == -1 else 2), -1, -1
    into = _left_through(reals, ints, _times(-1.0, ray))
    side = _seed_side(reals, ints, into) if into >= 0 else 0
    if side == 0:
        return 2, -1, -1
    return 1, (into if side == -1 else -1), out


@step
def _seed_side(reals, ints, face):
    """Return 1 where the seed lies behind the plane of a face, -1 where before it, 0 where it cannot tell."""
    level = _dot(_at(reals, ints[0] + face), _at(reals, _side(ints, ints[ints[5] + face])[0]))
    least = (2.0 * reals[ints[0] + face, 3] + SPOKE) * reals[ints[0] + ints[1], 0]
    return 1 if level > least else (-1 if level < -least else 0)


@step
def _face_row(reals1, ints1, reals2, ints2, frame, kind, face, apex):
    """Return the row (n, a, b, c) of a face and a vertex."""
    if kind == F1V2:
        m = _at(reals1, ints1[0] + face)
        n = _turned(frame, COFACTORS, m)
        height = _dot(m, _at(reals1, _side(ints1, ints1[np.uintp(ints1[5] + face)])[0]))
        # cofactors times m, R times x: their product is m.x times the determinant
        first = _dot(_entry(frame, R), _entry(frame, COFACTORS)) * height
        second = -_dot(n, _at(reals2, apex))
    else:
        m = _at(reals2, ints2[0] + face)
        n = _times(-1.0, m)
        first = _dot(_turned_back(frame, R, n), _at(reals1, apex))
        second = _dot(m, _at(reals2, _side(ints2, ints2[np.uintp(ints2[5] + face)])[0]))
    scale = 1.0 / _length(n)
    level = scale * _dot(n, _entry(frame, D))
    return _times(scale, n), scale * first, scale * second, level


@step
def _edge_row(reals1, ints1, reals2, ints2, frame, h1, h2):
    """Return the row (n, a, b, c) of two edges whose arcs cross, n along (half-edge 1) x (half-edge 2)."""
    a, b, _, _ = _side(ints1, h1)
    u, v, _, _ = _side(ints2, h2)
    x, y = _at(reals1, a), _at(reals2, u)
    e, g = _turned(frame, R, _minus(_at(reals1, b), x)), _minus(_at(reals2, v), y)
    n = _cross(e, g)
    length, long, wide = _length(n), _length(e), _length(g)
    lost = 8.0 * UNIT * (long * wide + frame[RADIUS_1] * wide + frame[RADIUS_2] * long)
    if not lost < FINE * length:
        n = _fine_cross(reals1, ints1, reals2, ints2, frame, a, b, u, v)
        length = _length(n)
    scale = 1.0 / length
    n = _times(scale, n)
    return n, _dot(_turned_back(frame, R, n), x), -_dot(n, y), _dot(n, _entry(frame, D))


@step
def _track(reals1, reals2, frame, forward, kind, apex):
    """Return the normal q of the plane in which the contact point moves, in the axes of the body whose edges it meets.

    rho_1 x = d + rho_2 apex keeps it in the plane of d and the apex: it stays on q.x = 0. Seen from outside the face, q
    points to the left of its way, so it leaves over the side that runs, counter-clockwise, from q.x < 0 to q.x > 0.
    """
    if kind == F1V2:
        q = _cross(_at(reals2, apex), _entry(frame, D))
        return _times(forward, _turned_back(frame, R, q))
    return _times(forward, _cross(_turned(frame, R, _at(reals1, apex)), _entry(frame, D)))


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
        w = _turned(frame, COFACTORS, _cross(_at(reals1, a), _at(reals1, b)))
        det, bound, other = -_dot(w, _at(reals2, apex)), frame[APEX_BOUND_1], frame[RAY_BOUND_1]
    else:
        a, b, _, _ = _side(ints2, h)
        w = _cross(_at(reals2, a), _at(reals2, b))
        det, bound, other = _dot(w, _turned(frame, R, _at(reals1, apex))), frame[APEX_BOUND_2], frame[RAY_BOUND_2]
    top = _dot(w, _entry(frame, D))
    if forward * det < -bound and forward * top < -other:
        if forward * det > -SLIGHT / TRIPLE * bound or forward * top > -SLIGHT / TRIPLE * other:
            det, top, span = _fine_corner(reals1, ints1, reals2, ints2, frame, forward, kind, a, b, apex)
        else:
            span = after - before
        own, opposite = -forward * span / det, top / det
        if kind == F1V2:
            return 1, own, opposite
        return 1, opposite, own
    return (0 if forward * det > bound or forward * top > other else -1), 0.0, 0.0


@step
def _fine_corner(reals1, ints1, reals2, ints2, frame, forward, kind, a, b, apex):
    """Return determinant, numerator and span of q.x of `_corner`, with the edge from the vertices as they are."""
    if kind == F1V2:
        edge, _ = _fine_difference(reals1, ints1, a, b)
        w = _turned(frame, COFACTORS, _cross(_at(reals1, a), edge))
        det = -_dot(w, _at(reals2, apex))
    else:
        edge, _ = _fine_difference(reals2, ints2, a, b)
        w = _cross(_at(reals2, a), edge)
        det = _dot(w, _turned(frame, R, _at(reals1, apex)))
    span = _dot(_track(reals1, reals2, frame, forward, kind, apex), edge)
    return det, _dot(w, _entry(frame, D)), span


@step
def _cross_surely(reals1, ints1, reals2, ints2, frame, h1, h2, slack):
    """Tell whether two edges form a facet with n along (half-edge 1) x (half-edge 2): their arcs cross for certain.

    `slack`: bound of spokes per unit of radius.
    """
    a, b, left, _ = _side(ints1, h1)
    u, v, over, _ = _side(ints2, h2)
    right, under = _side(ints1, h1 ^ 1)[2], _side(ints2, h2 ^ 1)[2]
    f1, f2 = ints1[0], ints2[0]
    across = _turned_back(frame, COFACTORS, _minus(_at(reals2, v), _at(reals2, u)))
    along = _turned(frame, R, _minus(_at(reals1, b), _at(reals1, a)))
    r1, r2 = frame[RADIUS_1], frame[RADIUS_2]
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
    whose arc is met first, -1 where it cannot tell. Directions point into the part: those of the cone have a positive
    product with the ways to all neighbours.
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
    x, z = _turned(frame, R, _at(reals1, a)), _turned(frame, R, _at(reals1, b))
    one, two = _cross(x, z), _cross(_at(reals2, u), _at(reals2, v))
    p, q = _dot(z, two), -_dot(x, two)
    r, s = -_dot(one, _at(reals2, v)), _dot(one, _at(reals2, u))
    least, most = min(p, q), max(p, q)
    low, high = min(r, s), max(r, s)
    bound, other = frame[APEX_BOUND_2], frame[APEX_BOUND_1]
    return (least > bound and low > other) or (most < -bound and high < -other)


@step
def _edge_exit(reals1, ints1, reals2, ints2, frame, forward, i, j, entered):
    """Return (meets, half-edge, vertex, q.x before, after, skipped edge): how the contact point leaves two edges.

    The contact point is a point of the square of both edges, on the curve on which a bilinear function vanishes; its
    values at the corners are q.x of `_track`. Where two neighbouring corners differ in sign, the curve crosses the side
    between them: there an end of one edge meets the other edge.

        v  low2 ----- high2      The curve enters over side u (a vertex of part 2 has come upon the edge of part 1) or
           |            |        over side a, and leaves over the other side with a change of sign. Where all four
        u  low ------ high       change it has two branches, and the products of opposite corners tell round which
           a            b        corner the one goes that enters.
    """
    a, b, _, _ = _side(ints1, i)
    u, v, _, _ = _side(ints2, j)
    x, z = _at(reals1, a), _at(reals1, b)
    q = _track(reals1, reals2, frame, forward, F1V2, u)
    low, high = _dot(q, x), _dot(q, z)
    q = _track(reals1, reals2, frame, forward, F1V2, v)
    low2, high2 = _dot(q, x), _dot(q, z)
    if entered == F1V2:
        across = low2 < 0.0 and high2 > 0.0
        near = low2 > 0.0 and (high2 > 0.0 or low * high2 < high * low2)
    else:
        across = high > 0.0 and high2 < 0.0
        near = high < 0.0 and (high2 < 0.0 or low * high2 < high * low2)
    if across == (entered == F1V2):  # a vertex of part 2 on the edge of part 1
        if near:
            return F1V2, i ^ 1, u, high, low, j >> 1
        return F1V2, i, v, low2, high2, j >> 1
    if near:
        return V1F2, j ^ 1, a, -low2, -low, i >> 1
    return V1F2, j, b, -high, -high2, i >> 1


@step
def _chain_end(reals1, ints1, reals2, ints2, frame, forward, kind, i, j, one, two):
    """Return how a chain ends on its last site: AXIS_1, AXIS_2, FAR, or -1 where it cannot tell.

    A face and an apex: along the line either the apex' scale falls to 0, which brings the contact to where the seed ray
    of its body meets the face, or both scales grow, which brings it to where the apex' own ray does. If that ray is
    inside the face's cone about its seed, no side of the face is met before.
    """
    if kind == E1E2:
        return FAR if _runs_away(reals1, ints1, reals2, ints2, frame, i, j) else -1
    if kind == F1V2:
        sign, falls = _seed_side(reals1, ints1, i), forward * one > 0.0
        ray = _entry(frame, D_OWN) if falls else _turned_back(frame, R, _at(reals2, j))
        bound = max(frame[APEX_BOUND_1], frame[RAY_BOUND_1])
        if sign != 0 and _all_around(reals1, ints1, i, sign, ray, bound):
            return AXIS_2 if falls else FAR
    else:
        sign, falls = _seed_side(reals2, ints2, j), forward * two < 0.0
        ray = _times(-1.0, _entry(frame, D)) if falls else _turned(frame, R, _at(reals1, i))
        bound = max(frame[APEX_BOUND_2], frame[RAY_BOUND_2])
        if sign != 0 and _all_around(reals2, ints2, j, sign, ray, bound):
            return AXIS_1 if falls else FAR
    return -1


@step
def _next_site(reals1, ints1, reals2, ints2, frame, meets, h, vertex, skip, n):
    """Return (kind, i, j) of the site beyond a corner, kind -1 where it cannot tell; E1E2: half-edges, n along i x j.

    The contact has come to an edge (half-edge h, the face of the last site on its left) and a vertex: next is the first
    crossing on the edge's arc with that of an edge at the vertex, or the face at the arc's end.
    """
    if meets == F1V2:
        face = _side(ints1, h ^ 1)[2]
        target = _turned(frame, COFACTORS, _at(reals1, ints1[0] + face))
        bound = frame[RADIUS_2] * (2.0 * reals1[ints1[0] + face, 3] + frame[SPOKE_BOUND])
        state, g = _beyond(reals2, ints2, vertex, n, target, skip, bound)
        kind, i, j = (F1V2, face, vertex) if state == 1 else (E1E2, h, g)
    else:
        face = _side(ints2, h ^ 1)[2]
        target = _turned_back(frame, R, _at(reals2, ints2[0] + face))
        bound = frame[RADIUS_1] * (2.0 * reals2[ints2[0] + face, 3] + frame[SPOKE_BOUND])
        start = _times(-1.0, _turned_back(frame, R, n))
        state, g = _beyond(reals1, ints1, vertex, start, target, skip, bound)
        kind, i, j = (V1F2, vertex, face) if state == 1 else (E1E2, g, h)
    if state < 0 or (
        state == 0 and not _cross_surely(reals1, ints1, reals2, ints2, frame, i, j, frame[SPOKE_BOUND])
    ):
        kind = -1
    return kind, i, j


@step
def _walk_chain(reals1, ints1, reals2, ints2, frame, forward, kind, face, apex, sites, rows, points):
    """Walk one chain from the axis on which a face and a vertex touch: points[0] is filled by this function.

    Forward (+1) is along (b, -a), with the overlap region on the left; -1 is backward. Fills `sites`, `rows` and
    `points`, whose last row is a direction where the chain runs to infinity. Return (state, segments, end).
    """
    i, j = (face, apex) if kind == F1V2 else (apex, face)  # E1E2: half-edges, n along i x j
    meets = kind  # how an E1E2 is entered: a vertex of part 2 came upon the edge of part 1, or the other way round
    for k in range(len(sites)):
        sites[k, 0], sites[k, 1], sites[k, 2], sites[k, 3] = kind, i, j, -1
        # the half-edge over which the contact point leaves, and the vertex of the other part that it then lies on
        if kind == F1V2:
            n, one, two, level = _face_row(reals1, ints1, reals2, ints2, frame, F1V2, i, j)
            fine = reals1[ints1[0] + i, 3] < FINE
            q = _track(reals1, reals2, frame, forward, F1V2, j)
            h, before, after = _way_out(reals1, ints1, i, q, frame[OFFSET_BOUND])
            meets, vertex, skip = F1V2, j, -1
        elif kind == V1F2:
            n, one, two, level = _face_row(reals1, ints1, reals2, ints2, frame, V1F2, j, i)
            fine = reals2[ints2[0] + j, 3] < FINE
            q = _track(reals1, reals2, frame, forward, V1F2, i)
            h, before, after = _way_out(reals2, ints2, j, q, frame[OFFSET_BOUND])
            meets, vertex, skip = V1F2, i, -1
        else:
            sites[k, 1], sites[k, 2] = i >> 1, j >> 1
            fine = True
            n, one, two, level = _edge_row(reals1, ints1, reals2, ints2, frame, i, j)
            meets, h, vertex, before, after, skip = _edge_exit(
                reals1, ints1, reals2, ints2, frame, forward, i, j, meets
            )
            if not (before < -frame[OFFSET_BOUND] and after > frame[OFFSET_BOUND]):
                h = -1
        rows[k, 0], rows[k, 1], rows[k, 2] = n
        rows[k, 3], rows[k, 4], rows[k, 5] = one, two, level
        if k == 0:
            points[0, 0] = level / one if kind == F1V2 else 0.0
            points[0, 1] = level / two if kind == V1F2 else 0.0
        fine = fine and max(np.abs(one), np.abs(two), np.abs(level)) > SLIGHT * frame[SIZE]
        real = -1
        if h >= 0:
            real, x1, x2 = _corner(reals1, ints1, reals2, ints2, frame, forward, meets, h, vertex, before, after)
        if real < 0 or not fine:
            return UNDECIDED, 0, FAR
        if real == 0:  # the contact never gets there: the chain ends before, on an axis or at infinity
            end = _chain_end(reals1, ints1, reals2, ints2, frame, forward, kind, i, j, one, two)
            if end < 0:
                return UNDECIDED, 0, FAR
            if end == FAR:
                steep = np.sqrt(one * one + two * two)
                points[k + 1, 0], points[k + 1, 1] = forward * two / steep, -forward * one / steep
            else:
                points[k + 1, 0] = level / one if end == AXIS_2 else 0.0
                points[k + 1, 1] = level / two if end == AXIS_1 else 0.0
            return WALKED, k + 1, end
        points[k + 1, 0], points[k + 1, 1] = x1, x2
        sites[k, 3], sites[k, 4], sites[k, 5] = meets, h >> 1, vertex
        kind, i, j = _next_site(reals1, ints1, reals2, ints2, frame, meets, h, vertex, skip, n)
        if kind < 0:
            return UNDECIDED, 0, FAR
    return CROWDED, 0, FAR


@step
def _walk(reals1, ints1, reals2, ints2, frame, sites, rows, points, chains):
    """Walk all chains that start on an axis; return (state, segments, chains). See `walk`."""
    if not (reals1[ints1[0] + ints1[1], 1] > 0.0 and reals2[ints2[0] + ints2[1], 1] > 0.0):
        return UNDECIDED, 0, 0
    # s_1 in part 2 where rho_1 = 0, s_2 in part 1 where rho_2 = 0. The region is convex and holds no line, so that its
    # boundary is one curve: if it meets an axis at all, each of its chains has an end on one.
    hit1, in1, out1 = _seed_ray(reals2, ints2, _times(-1.0, _entry(frame, D)))
    if hit1 == 2:
        return UNDECIDED, 0, 0
    hit2, in2, out2 = 0, -1, -1
    low_joined = far1_joined = far2_joined = False  # ends on an axis that an earlier chain has reached
    used, made = 0, 0
    for start in range(4):
        if start == 1 and not (low_joined and reals1[ints1[0] + ints1[1], 2] > 0.0):
            # known already where the first chain ended on this axis and s_2 cannot enter part 1
            hit2, in2, out2 = _seed_ray(reals1, ints1, _entry(frame, D_OWN))
            if hit2 == 2:
                return UNDECIDED, 0, 0
        if start == 0:  # s_1 leaves part 2
            wanted, kind, face, forward = hit1 == 1, V1F2, out1, 1.0
        elif start == 1:  # s_2 leaves part 1
            wanted, kind, face, forward = hit2 == 1 and not low_joined, F1V2, out2, -1.0
        elif start == 2:  # s_1 enters part 2
            wanted, kind, face, forward = in1 >= 0 and not far1_joined, V1F2, in1, -1.0
        else:  # s_2 enters part 1
            wanted, kind, face, forward = in2 >= 0 and not far2_joined, F1V2, in2, 1.0
        if not wanted:
            continue
        if kind == V1F2:
            apex, margin = _summit(reals1, ints1, _turned_back(frame, R, _times(-1.0, _at(reals2, ints2[0] + face))))
            sure = margin > frame[RADIUS_1] * (2.0 * reals2[ints2[0] + face, 3] + frame[SPOKE_BOUND])
        else:
            apex, margin = _summit(reals2, ints2, _times(-1.0, _turned(frame, COFACTORS, _at(reals1, ints1[0] + face))))
            sure = margin > frame[RADIUS_2] * (2.0 * reals1[ints1[0] + face, 3] + frame[SPOKE_BOUND])
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
    if made == 0:
        return (EMPTY if _excluded(reals1, ints1, reals2, ints2, frame) else UNDECIDED), 0, 0
    return WALKED, used, made


@step
def _excluded(reals1, ints1, reals2, ints2, frame):
    """Search a direction with a < 0, b < 0 and c > 0 for certain: it separates the parts at every scale pair.

    The perceptron's rule: turn away from whatever lies farthest ahead.
    """
    d = _entry(frame, D)
    length = _length(d)
    n = _times(1.0 / length, d)
    for _ in range(TRIALS):
        unit = 1.0 / _length(n)
        inward = _turned_back(frame, R, n)
        i, _ = _summit(reals1, ints1, inward)
        j, _ = _summit(reals2, ints2, _times(-1.0, n))
        x, y = _at(reals1, i), _at(reals2, j)
        first, second, third = _dot(inward, x) * unit, -_dot(n, y) * unit, -_dot(n, d) * unit
        if (
            first < -frame[RADIUS_1] * SPOKE
            and second < -frame[RADIUS_2] * SPOKE
            and third < -length * SPOKE
        ):
            return True
        first, second, third = first / _length(x), second / _length(y), third / length
        if first >= second and first >= third:
            n = _minus(n, _times(1.0 / _length(x), _turned(frame, R, x)))
        elif second >= third:
            n = _minus(n, _times(-1.0 / _length(y), y))
        else:
            n = _minus(n, _times(-1.0 / length, d))
        if not _length(n) > 0.0:
            return False
    return False


@kernel
def walk(reals1, ints1, reals2, ints2, transform, seed1, seed2, planarity):
    """Walk the overlay of the two Gauss maps along the boundary of the pair's overlap region in the open quadrant.

    Chains start where the seed ray of either body enters or leaves the other part. Return (state, sites, rows, points,
    chains): sites (k, 6) = kind, i, j, then the contact at the corner after it, as walked: F1V2 where edge i of part 1
    meets vertex j of part 2, V1F2 where edge i of part 2 meets vertex j of part 1, -1 where there is no corner;
    chains (k, 4) = first segment, segments, direction (+1 walked with the overlap region on the left, -1 on the
    right), whether it runs to infinity; chain c has points from its first segment + c on, one more than segments.

    State EMPTY: no seed ray hits, and some direction separates the parts at every scale pair. UNDECIDED: a sign within
    its error bound, two features within `planarity`, a line or direction known to too few digits, or no seed ray hits
    and no such direction was found (then the boundary is empty, a closed polygon, or runs from infinity to infinity).
    """
    frame, pose, chains = np.empty(FRAME), np.empty(12), np.empty((4, 4), np.int64)
    known = _set_pose(transform, seed1, seed2, pose)
    _set_frame(reals1, ints1, reals2, ints2, pose, planarity, frame)
    capacity = 32
    while True:
        sites, rows, points = np.empty((capacity, 6), np.int64), np.empty((capacity, 6)), np.empty((capacity + 4, 2))
        state, used, made = _walk(reals1, ints1, reals2, ints2, frame, sites, rows, points, chains)
        if state != CROWDED:
            if not known:
                state = UNDECIDED
            return state, sites[:used], rows[:used], points[: used + made], chains[:made]
        capacity *= 4


@step
def _clip(start, end, endless, line, box, least):
    """Return (whether anything is left, x, y of its start, x, y of its end): what a box leaves of a stretch of a line.

    From `start` to `end`, or without end in the direction `end` where it is endless; stretches shorter than `least`
    relative to their scale pairs are dropped. Ends on a border are exactly there, and on the line a x + b y = c.
    """
    lo, hi, lo_border, hi_border = 0.0, (_INF if endless else 1.0), -1, -1
    inside = not endless and (
        min(start[0], end[0]) >= box[0]
        and max(start[0], end[0]) <= box[1]
        and min(start[1], end[1]) >= box[2]
        and max(start[1], end[1]) <= box[3]
    )
    for axis in range(0 if inside else 2):
        step = end[axis] if endless else end[axis] - start[axis]
        low, high = box[2 * axis] - start[axis], box[2 * axis + 1] - start[axis]
        if step == 0.0 or line[1 - axis] == 0.0:  # along the other axis
            if low > 0.0 or high < 0.0:
                return False, 0.0, 0.0, 0.0, 0.0
            continue
        first, second = (2 * axis, 2 * axis + 1) if step > 0.0 else (2 * axis + 1, 2 * axis)
        into, out = (low / step, high / step) if step > 0.0 else (high / step, low / step)
        if into > lo:
            lo, lo_border = into, first
        if out < hi:
            hi, hi_border = out, second
    size = np.abs(start[0]) + np.abs(start[1])
    length = 1.0
    if not endless:
        size = max(size, np.abs(end[0]) + np.abs(end[1]))
        length = np.abs(end[0] - start[0]) + np.abs(end[1] - start[1])
    if not (hi - lo) * length > least * size:
        return False, 0.0, 0.0, 0.0, 0.0
    x, y = start[0], start[1]
    u, v = end[0], end[1]
    if endless and hi_border < 0:
        u, v = x + _far(end[0]), y + _far(end[1])
    if lo_border >= 0:
        x, y = _on_border(line, box, lo_border)
    if hi_border >= 0:
        u, v = _on_border(line, box, hi_border)
    return True, x, y, u, v


@step
def _far(direction):
    """Return where a coordinate ends up in a direction."""
    return 0.0 if direction == 0.0 else (_INF if direction > 0.0 else -_INF)


@step
def _on_border(line, box, border):
    """Return the point of a line on one of a box's borders."""
    if border < 2:
        return box[border], (line[2] - line[0] * box[border]) / line[1]
    return (line[2] - line[1] * box[border]) / line[0], box[border]


@kernel
def state_in_box(rows, points, chains, box, least, sure):
    """Return CONTACT where a walked curve passes a box; else WALKED where the bodies are apart in it, or OVERLAPPING.

    UNDECIDED where the box's middle is within `sure` of a line, relatively.
    """
    used = len(rows)
    for chain in range(len(chains)):
        first, count, endless = chains[chain, 0], chains[chain, 1], chains[chain, 3]
        for k in range(count):
            start, end = points[first + chain + k], points[first + chain + k + 1]
            if _clip(start, end, endless > 0 and k == count - 1, rows[first + k, 3:], box, least)[0]:
                return CONTACT
    if len(chains) == 0:
        return WALKED
    return _state_at(rows, used, 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3]), sure)


@kernel
def clip(start, end, endless, line, box, least):
    """Return what `_clip` does, for callers from Python."""
    return _clip(start, end, endless, line, box, least)


@kernel
def walk_many(reals1, ints1, reals2, ints2, transforms, seeds, box, planarity, least, sure):
    """Walk the curves of one pair at many 4 x 4 transforms of body 1, and clip them to a box.

    Box: (low, high) of rho_1, then of rho_2; stretches shorter than `least` relative to their scales are dropped.
    Return (states, counts, sites, rows, ends): states of `walk`, segments of each curve inside the box, and for all
    curves one after the other each segment's site, row and both ends (2, 2), with the overlap region on its left,
    chains in the order of their first scale pairs. Of a curve without a segment in the box the state tells the bodies'
    at its middle: WALKED where they are apart, OVERLAPPING, or UNDECIDED within `sure` of a line, relatively.
    """
    total = len(transforms)
    states, counts = np.empty(total, np.int64), np.zeros(total, np.int64)
    frame, pose, chains = np.empty(FRAME), np.empty(12), np.empty((4, 4), np.int64)
    room = 32
    sites, rows, points = np.empty((room, 6), np.int64), np.empty((room, 6)), np.empty((room + 4, 2))
    capacity, kept = 4 * total + room, 0
    all_sites, all_rows = np.empty((capacity, 3), np.int64), np.empty((capacity, 6))
    ends = np.empty((capacity, 2, 2))
    item = 0
    while item < total:
        known = _place(transforms, item, seeds, pose)
        _set_frame(reals1, ints1, reals2, ints2, pose, planarity, frame)
        state, used, made = _walk(reals1, ints1, reals2, ints2, frame, sites, rows, points, chains)
        if state == CROWDED:
            room *= 4
            sites, rows, points = np.empty((room, 6), np.int64), np.empty((room, 6)), np.empty((room + 4, 2))
            continue
        if not known:
            state = UNDECIDED
        if kept + used > capacity:
            more = 2 * capacity + used
            more_sites, more_rows = np.empty((more, 3), np.int64), np.empty((more, 6))
            more_ends = np.empty((more, 2, 2))
            more_sites[:kept], more_rows[:kept], more_ends[:kept] = all_sites[:kept], all_rows[:kept], ends[:kept]
            all_sites, all_rows, ends, capacity = more_sites, more_rows, more_ends, more
        counts[item] = 0
        if state == WALKED:
            counts[item] = _append(sites, rows, points, chains, made, box, least, all_sites, all_rows, ends, kept)
            if counts[item] == 0:
                state = _state_at(rows, used, 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3]), sure)
        kept += counts[item]
        states[item] = state
        item += 1
    return states, counts, all_sites[:kept], all_rows[:kept], ends[:kept]


@step
def _place(transforms, item, seeds, pose):
    """Fill the pose of one of many transforms; tell whether it is known well."""
    return _set_pose(transforms[item], seeds[0], seeds[1], pose)


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
            left, x, y, u, v = _clip(start, end, away, rows[first + k, 3:], box, least)
            if not left:
                continue
            for entry in range(6):
                all_rows[kept, entry] = rows[first + k, entry]
            for entry in range(3):
                all_sites[kept, entry] = sites[first + k, entry]
            side = 0 if forward > 0 else 1
            ends[kept, side, 0], ends[kept, side, 1] = x, y
            ends[kept, 1 - side, 0], ends[kept, 1 - side, 1] = u, v
            kept += 1
    return kept - before


@step
def _state_at(rows, used, x, y, sure):
    """Return OVERLAPPING, WALKED (apart) or UNDECIDED at a scale pair: inside all half-planes of a boundary or not."""
    state = OVERLAPPING
    for k in range(used):
        one, two, level = rows[k, 3] * x, rows[k, 4] * y, rows[k, 5]
        near = sure * (np.abs(one) + np.abs(two) + np.abs(level))
        if one + two - level < -near:
            return WALKED
        if not one + two - level > near:
            state = UNDECIDED
    return state


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
    """Return sites and rows of all facet directions of the Minkowski difference.

    a and b are the parts' supports, so that every row is a constraint that holds. Arcs of the Gauss maps that may or
    may not meet are left out: they would meet in the direction of a face, or beside one that is listed.
    """
    frame = np.empty(FRAME)
    _set_frame(reals1, ints1, reals2, ints2, pose, 0.0, frame)
    n1, f1, n2, f2 = ints1[0], ints1[1], ints2[0], ints2[1]
    capacity = f1 + f2 + 2 * (ints1[2] + ints2[2])
    sites, rows = np.empty((capacity, 3), np.int64), np.empty((capacity, 6))
    count = f1 + f2
    for i in range(f1):
        apex, _ = _summit(reals2, ints2, _times(-1.0, _turned(frame, COFACTORS, _at(reals1, n1 + i))))
        _list(sites, rows, i, F1V2, i, apex, _face_row(reals1, ints1, reals2, ints2, frame, F1V2, i, apex))
    for j in range(f2):
        apex, _ = _summit(reals1, ints1, _turned_back(frame, R, _times(-1.0, _at(reals2, n2 + j))))
        _list(sites, rows, f1 + j, V1F2, apex, j, _face_row(reals1, ints1, reals2, ints2, frame, V1F2, j, apex))
    for edge in range(ints1[2]):
        # follow the arc of the edge, from the normal of the face on its left to that on its right, through the cells
        # of the other part's vertices
        h = 2 * edge
        left, right = _side(ints1, h)[2], _side(ints1, h + 1)[2]
        vertex, skip = sites[left, 2], -1
        n = _turned(frame, COFACTORS, _at(reals1, n1 + left))
        target = _turned(frame, COFACTORS, _at(reals1, n1 + right))
        for _ in range(ints2[2]):
            _, g = _beyond(reals2, ints2, vertex, n, target, skip, frame[RADIUS_2] * SPOKE)
            if g < 0:
                break
            if _cross_surely(reals1, ints1, reals2, ints2, frame, h, g, SPOKE):
                if count == capacity:
                    capacity *= 2
                    more_sites, more_rows = np.empty((capacity, 3), np.int64), np.empty((capacity, 6))
                    for k in range(count):
                        for entry in range(6):
                            more_rows[k, entry] = rows[k, entry]
                        for entry in range(3):
                            more_sites[k, entry] = sites[k, entry]
                    sites, rows = more_sites, more_rows
                n, _, _, level = _edge_row(reals1, ints1, reals2, ints2, frame, h, g)
                inward = _turned_back(frame, R, n)
                first, _ = _climbed(reals1, ints1, _side(ints1, h)[0], inward)
                second, _ = _climbed(reals2, ints2, vertex, _times(-1.0, n))
                one, two = _dot(inward, _at(reals1, first)), -_dot(n, _at(reals2, second))
                _list(sites, rows, count, E1E2, edge, g >> 1, (n, one, two, level))
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
    level = _dot(direction, _entry(pose, 9))
    return level - _dot(inward, _at(reals1, first)) * rho[0] + _dot(direction, _at(reals2, second)) * rho[1]


# ------------------------------------------------------------------------------------------- a feature that is tracked


@kernel
def tracked_row(reals1, ints1, reals2, ints2, pose, site, sign):
    """Return the row of a site at a pose; parallel edges give nan.

    `sign` orients an edge pair's normal as +-(edge 1 x edge 2), so that it does not jump where the pair stops being a
    facet.
    """
    frame, row = np.empty(FRAME), np.full(6, np.nan)
    _set_frame(reals1, ints1, reals2, ints2, pose, 0.0, frame)
    _track_row(reals1, ints1, reals2, ints2, frame, site[0], site[1], site[2], sign, row)
    return row


@step
def _track_row(reals1, ints1, reals2, ints2, frame, kind, i, j, sign, row):
    if kind == F1V2:
        n, one, two, level = _face_row(reals1, ints1, reals2, ints2, frame, F1V2, i, j)
    elif kind == V1F2:
        n, one, two, level = _face_row(reals1, ints1, reals2, ints2, frame, V1F2, j, i)
    else:
        a, b, _, _ = _side(ints1, 2 * i)
        u, v, _, _ = _side(ints2, 2 * j)
        along = _turned(frame, R, _minus(_at(reals1, b), _at(reals1, a)))
        if not _length(_cross(along, _minus(_at(reals2, v), _at(reals2, u)))) > 0.0:
            return
        n, one, two, level = _edge_row(reals1, ints1, reals2, ints2, frame, 2 * i + (0 if sign > 0 else 1), 2 * j)
    row[0], row[1], row[2] = n
    row[3], row[4], row[5] = one, two, level
