"""The kernels of the decision curve.

They take a part's packed arrays (`packing`: vertices relative to the seed, face normals with error bounds, half-edges)
and a pose, (12,): the rotation R of body 1, row by row, then d = s_2 - s_1 with the moved seed. Body 1 stays in its own
axes: directions are turned to it, never its vertices.

A *site* (kind, i, j) is a facet of the Minkowski difference: F1V2 = face i of part 1 with vertex j of part 2,
V1F2 = vertex i with face j, E1E2 = edge i with edge j. A *row* is (n, a, b, c): unit direction from body 1 to body 2
in world axes, and the contact line a rho_1 + b rho_2 = c.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt.compiling import kernel, light, often, step

F1V2, V1F2, E1E2 = 0, 1, 2
# how a walk ended: done, left to exact arithmetic, no room for the answer, no overlap at any scale pair
WALKED, UNDECIDED, CROWDED, EMPTY = 0, 1, 2, 4
CONTACT, OVERLAPPING = 5, 3  # in a box: the curve passes it; it does not, and the bodies overlap (WALKED: are apart)
FAR, AXIS_1, AXIS_2, CLOSED = 0, 1, 2, 3  # how a chain ends: at infinity, where rho_1 = 0 or rho_2 = 0, at its start
# walked by way of a pose beside, as signs tie; no overlap at any scale pair, to rounding
TIED, GRAZING = 7, 8
ADRIFT = 6  # no chain starts on an axis, and no direction is known that separates the parts at every scale pair
_INF = np.inf
UNIT = 2.0**-53
# Error bounds of the walk's sign tests, in units of 2^-53 times the product of the lengths that enter. One operation
# each: a vertex less the seed 1, d 12 (`_set_pose`), cross product 2.8, turning by R 5.2 or by its cofactors 11.2 (they
# are computed), dot product 3.
TRIPLE = 64.0 * UNIT  # triple products of vertices and d: 1 + 1 + 12 + 2.8 + 11.2 + 3 = 31 at most, doubled
SPOKE = 72.0 * UNIT  # face normals times ways between vertices: 2 (11.2 + 3 + 1) + 2 = 32.4 and twice the face's own
ROUNDED = 8.0 * UNIT  # products of two vertices with a unit direction, 3 roundings each, differ by more or may be equal
FINE = 1e-12  # no line has a direction known less well (`planarity`): edges are crossed in twice the precision
SLIGHT = 1e-2  # lines shorter than this, relative to the sizes, and corners of shorter edges lose digits
TRIALS = 100  # steps of the search for a direction that separates at every scale
SAME = 1e-13  # rows of directions that differ by less are as good as each other: lines are right to this
LOST = 2.0**-40  # an offset that cancels to less than this is known to too few digits
# Places in a frame, see `_set_frame`.
R, D, COFACTORS, D_OWN = 0, 9, 12, 21
RADIUS_1, RADIUS_2, OFFSET_BOUND, APEX_BOUND_1, APEX_BOUND_2, RAY_BOUND_1, RAY_BOUND_2, SPOKE_BOUND = range(24, 32)
SIZE, FRAME = 32, 33


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
def _plus(u, x):
    return u[0] + x[0], u[1] + x[1], u[2] + x[2]


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


@light
@kernel
def relative_pose(transform, seed1, seed2):
    """Return the pose, (12,), of a 4 x 4 transform of body 1: R row by row, then d = s_2 - moved s_1."""
    pose = np.empty(12)
    _set_pose(transform, seed1, seed2, pose)
    return pose


ORIGIN, END, FACE, NEXT = range(4)


@step
def _half_edge(ints, h, entry):
    """Return the origin, end, face on the left or next half-edge of a half-edge."""
    return ints[np.uintp(ints[3] + 4 * h + entry)]


@step
def _side(ints, h):
    """Return all four of these."""
    return _half_edge(ints, h, ORIGIN), _half_edge(ints, h, END), _half_edge(ints, h, FACE), _half_edge(ints, h, NEXT)


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
            other = _half_edge(ints, h, END)
            height = _dot(n, _at(reals, other))
            if height > best:
                best, where = height, other
            h = _half_edge(ints, h ^ 1, NEXT)
            if h == first:
                break
        if not best > here:
            return vertex, here - best
        vertex, here = where, best


@step
def _extreme(reals, ints, n, bound):
    """Return the vertex extreme along n to rounding, and whether it is so by more than `bound` for certain."""
    # where no neighbour is further on by more than rounding a vertex across a tiny edge still may lead to one that is,
    # and so may one where the half-edges are not those of the exact hull: all are looked at
    vertex, margin = _summit(reals, ints, n)
    if margin > bound and reals[ints[0] + ints[1], 1] > 0.0:
        return vertex, True
    return _surpassing(reals, ints, vertex, n), False


@kernel
def _surpassing(reals, ints, vertex, n):
    """Return the vertex most extreme along n, or the given one where none surpasses it by more than rounding."""
    height = _dot(n, _at(reals, vertex)) + ROUNDED * reals[ints[0] + ints[1], 0]
    for k in range(ints[0]):
        other = _dot(n, _at(reals, k))
        if other > height:
            vertex, height = k, other
    return vertex


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
def _exit_face(reals, ints, ray):
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
            other = _half_edge(ints, h, FACE)
            slope = _dot(ray, _at(reals, count + other))
            if slope > steepest:
                face, steepest = other, slope
            h = _half_edge(ints, h ^ 1, NEXT)
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
        face = _half_edge(ints, across ^ 1, FACE)
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
    out = _exit_face(reals, ints, ray)
    if out < 0:
        return (0 if out == -1 else 2), -1, -1
    if reals[ints[0] + ints[1], 2] > 0.0:
        return 1, -1, out
    side = _seed_side(reals, ints, out)
    if side != 1:
        return (0 if side == -1 else 2), -1, -1
    into = _exit_face(reals, ints, _times(-1.0, ray))
    side = _seed_side(reals, ints, into) if into >= 0 else 0
    if side == 0:
        return 2, -1, -1
    return 1, (into if side == -1 else -1), out


@step
def _seed_side(reals, ints, face):
    """Return 1 where the seed lies behind the plane of a face, -1 where before it, 0 where it cannot tell."""
    level = _dot(_at(reals, ints[0] + face), _at(reals, _half_edge(ints, ints[ints[5] + face], ORIGIN)))
    least = (2.0 * reals[ints[0] + face, 3] + SPOKE) * reals[ints[0] + ints[1], 0]
    return 1 if level > least else (-1 if level < -least else 0)


@step
def _face_row(reals1, ints1, reals2, ints2, frame, kind, face, apex):
    """Return the row (n, a, b, c) of a face and a vertex."""
    if kind == F1V2:
        m = _at(reals1, ints1[0] + face)
        n = _turned(frame, COFACTORS, m)
        height = _dot(m, _at(reals1, _half_edge(ints1, ints1[np.uintp(ints1[5] + face)], ORIGIN)))
        # cofactors times m, R times x: their product is m.x times the determinant
        first = _dot(_entry(frame, R), _entry(frame, COFACTORS)) * height
        second = -_dot(n, _at(reals2, apex))
    else:
        m = _at(reals2, ints2[0] + face)
        n = _times(-1.0, m)
        first = _dot(_turned_back(frame, R, n), _at(reals1, apex))
        second = _dot(m, _at(reals2, _half_edge(ints2, ints2[np.uintp(ints2[5] + face)], ORIGIN)))
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
    if not lost < SAME * length:
        n = _fine_cross(reals1, ints1, reals2, ints2, frame, a, b, u, v)
        length = _length(n)
    scale = 1.0 / length
    n = _times(scale, n)
    return n, _dot(_turned_back(frame, R, n), x), -_dot(n, y), _dot(n, _entry(frame, D))


@step
def _track(reals1, reals2, frame, forward, kind, apex):
    """Return the normal q of the plane in which the contact point moves, in axes of the body whose edges it meets."""
    # rho_1 x = d + rho_2 apex keeps it in the plane of d and the apex: it stays on q.x = 0. Seen from outside the face,
    # q points to the left of its way, so it leaves over the side that runs, counter-clockwise, from q.x < 0 to q.x > 0
    if kind == F1V2:
        q = _cross(_at(reals2, apex), _entry(frame, D))
        return _times(forward, _turned_back(frame, R, q))
    return _times(forward, _cross(_turned(frame, R, _at(reals1, apex)), _entry(frame, D)))


@step
def _exit_of(reals, ints, face, q, bound):
    """Return the half-edge of a face over which the contact point leaves it, and q.x at its ends; -1: cannot tell."""
    first = h = ints[np.uintp(ints[5] + face)]
    before = _dot(q, _at(reals, _half_edge(ints, h, ORIGIN)))
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
    """Tell whether two edges form a facet with n along (half-edge 1) x (half-edge 2): their arcs cross for certain."""
    # `slack`: bound of spokes per unit of radius
    a, b, left, _ = _side(ints1, h1)
    u, v, over, _ = _side(ints2, h2)
    right, under = _half_edge(ints1, h1 ^ 1, FACE), _half_edge(ints2, h2 ^ 1, FACE)
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
        spoke = _minus(_at(reals, _half_edge(ints, h, END)), here)
        after = _dot(target, spoke)
        least = min(least, after)
        if after < -bound and h >> 1 != skip:
            before = _dot(start, spoke)
            at = before / (before - after) if before > 0.0 else 0.0
            if at < nearest:
                nearest, found = at, h
        h = _half_edge(ints, h ^ 1, NEXT)
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
    """Return how a chain ends on its last site: AXIS_1, AXIS_2, FAR, or -1 where it cannot tell."""
    # a face and an apex: along the line either the apex' scale falls to 0, which brings the contact to where the seed
    # ray of its body meets the face, or both scales grow, which brings it to where the apex' own ray does. If that ray
    # is inside the face's cone about its seed, no side of the face is met before
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
    """Return (kind, i, j) of the site beyond a corner, kind -1: cannot tell; E1E2: half-edges, n along i x j."""
    # the contact has come to an edge (half-edge h, the face of the last site on its left) and a vertex: next is the
    # first crossing on the edge's arc with that of an edge at the vertex, or the face at the arc's end
    if meets == F1V2:
        face = _half_edge(ints1, h ^ 1, FACE)
        target = _turned(frame, COFACTORS, _at(reals1, ints1[0] + face))
        bound = frame[RADIUS_2] * (2.0 * reals1[ints1[0] + face, 3] + frame[SPOKE_BOUND])
        state, g = _beyond(reals2, ints2, vertex, n, target, skip, bound)
        kind, i, j = (F1V2, face, vertex) if state == 1 else (E1E2, h, g)
    else:
        face = _half_edge(ints2, h ^ 1, FACE)
        target = _turned_back(frame, R, _at(reals2, ints2[0] + face))
        bound = frame[RADIUS_1] * (2.0 * reals2[ints2[0] + face, 3] + frame[SPOKE_BOUND])
        start = _times(-1.0, _turned_back(frame, R, n))
        state, g = _beyond(reals1, ints1, vertex, start, target, skip, bound)
        kind, i, j = (V1F2, vertex, face) if state == 1 else (E1E2, g, h)
    if state < 0 or (state == 0 and not _cross_surely(reals1, ints1, reals2, ints2, frame, i, j, frame[SPOKE_BOUND])):
        kind = -1
    return kind, i, j


@step
def _walk_chain(reals1, ints1, reals2, ints2, frame, forward, kind, face, apex, round_trip, sites, rows, points):
    """Walk one chain from the axis on which a face and a vertex touch: points[0] is filled by this function.

    With `round_trip` the chain starts on the face and vertex somewhere off the axes, and must come back to them or run
    to infinity.

    Forward (+1) is along (b, -a), with the overlap region on the left; -1 is backward. Fills `sites`, `rows` and
    `points`, whose last row is a direction where the chain runs to infinity. Return (state, segments, end).
    """
    i, j = (face, apex) if kind == F1V2 else (apex, face)  # E1E2: half-edges, n along i x j
    first, first_i, first_j = kind, i, j
    meets = kind  # how an E1E2 is entered: a vertex of part 2 came upon the edge of part 1, or the other way round
    for k in range(len(sites)):
        sites[k, 0], sites[k, 1], sites[k, 2], sites[k, 3] = kind, i, j, -1
        # the half-edge over which the contact point leaves, and the vertex of the other part that it then lies on
        if kind == F1V2:
            n, one, two, level = _face_row(reals1, ints1, reals2, ints2, frame, F1V2, i, j)
            fine = reals1[ints1[0] + i, 3] < FINE
            q = _track(reals1, reals2, frame, forward, F1V2, j)
            h, before, after = _exit_of(reals1, ints1, i, q, frame[OFFSET_BOUND])
            meets, vertex, skip = F1V2, j, -1
        elif kind == V1F2:
            n, one, two, level = _face_row(reals1, ints1, reals2, ints2, frame, V1F2, j, i)
            fine = reals2[ints2[0] + j, 3] < FINE
            q = _track(reals1, reals2, frame, forward, V1F2, i)
            h, before, after = _exit_of(reals2, ints2, j, q, frame[OFFSET_BOUND])
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
            if end < 0 or (round_trip and end != FAR):
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
        if round_trip and kind == first and i == first_i and j == first_j:
            points[0, 0], points[0, 1] = x1, x2
            return WALKED, k + 1, CLOSED
        if round_trip and k > ints1[2] * ints2[2]:
            return UNDECIDED, 0, FAR
    return CROWDED, 0, FAR


@step
def _walk(reals1, ints1, reals2, ints2, frame, kind0, face0, sites, rows, points, chains):
    """Walk all chains that start on an axis; return (state, segments, chains). See `walk`."""
    # where kind0 >= 0, F1V2 or V1F2, the one chain that face0 is on instead: closed, or from infinity to infinity
    if not (reals1[ints1[0] + ints1[1], 1] > 0.0 and reals2[ints2[0] + ints2[1], 1] > 0.0):
        return UNDECIDED, 0, 0
    # s_1 in part 2 where rho_1 = 0, s_2 in part 1 where rho_2 = 0. The region is convex and holds no line, so that its
    # boundary is one curve: if it meets an axis at all, each of its chains has an end on one.
    hit1, in1, out1 = 0, -1, -1
    if kind0 < 0:
        hit1, in1, out1 = _seed_ray(reals2, ints2, _times(-1.0, _entry(frame, D)))
    if hit1 == 2:
        return UNDECIDED, 0, 0
    hit2, in2, out2 = 0, -1, -1
    low_joined = far1_joined = far2_joined = False  # ends on an axis that an earlier chain has reached
    used, made, ahead = 0, 0, 0
    for start in range(6):
        if kind0 < 0 and start == 1 and not (low_joined and reals1[ints1[0] + ints1[1], 2] > 0.0):
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
        elif start == 3:  # s_2 enters part 1
            wanted, kind, face, forward = in2 >= 0 and not far2_joined, F1V2, in2, 1.0
        elif start == 4:
            wanted, kind, face, forward = kind0 >= 0, kind0, face0, 1.0
        else:  # where that has run to infinity, the other way
            wanted, kind, face, forward = ahead > 0, kind0, face0, -1.0
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
            reals1, ints1, reals2, ints2, frame, forward, kind, face, apex, start >= 4,
            sites[used + ahead :], rows[used + ahead :], points[used + made + ahead + (1 if ahead else 0) :],
        )  # fmt: skip
        if state != WALKED:
            return state, 0, 0
        if start == 4 and end == FAR:
            ahead = count
            continue
        if start == 5:
            _join_chains(sites[used:], rows[used:], points[used + made :], ahead, count)
            forward, count = 1.0, ahead + count - 1
        if end == CLOSED:
            _start_lowest(sites[used:], rows[used:], points[used + made :], count)
        chains[made, 0], chains[made, 1], chains[made, 2], chains[made, 3] = used, count, int(forward), end == FAR
        if start == 5:
            chains[made, 3] = 3
        low_joined = low_joined or (start == 0 and end == AXIS_2)
        far1_joined = far1_joined or (start == 0 and end == AXIS_1)
        far2_joined = far2_joined or (start > 0 and end == AXIS_2)
        used += count
        made += 1
    if made == 0:
        n = _times(1.0 / _length(_entry(frame, D)), _entry(frame, D))
        return (EMPTY if _excluded(reals1, ints1, reals2, ints2, frame, n) else ADRIFT), 0, 0
    return WALKED, used, made


@step
def _join_chains(sites, rows, points, ahead, back):
    """Join the two ways from one segment to infinity, the second backward and stored behind the first."""
    last = ahead + back - 1
    for m in range(last, ahead, -1):  # what is met before a segment backward is met after it
        for entry in range(3, 6):
            sites[m, entry] = sites[m - 1, entry]
    for m in range(ahead, last):  # both have the segment that they start on
        for entry in range(6):
            sites[m, entry], rows[m, entry] = sites[m + 1, entry], rows[m + 1, entry]
    for m in range(last + 1):  # they start at no known point of it
        skipped = 1 if m < ahead else 2
        points[m, 0], points[m, 1] = points[m + skipped, 0], points[m + skipped, 1]
    _reverse(rows, ahead)
    _reverse(rows, last)
    _reverse(sites, ahead)
    _reverse(sites, last)
    _reverse(points, ahead)
    _reverse(points, last + 1)


@step
def _reverse(table, count):
    """Reverse the order of the first rows."""
    for m in range(count // 2):
        for entry in range(table.shape[1]):
            other = count - 1 - m
            table[m, entry], table[other, entry] = table[other, entry], table[m, entry]


@step
def _start_lowest(sites, rows, points, count):
    """Turn a closed chain so that it starts at its point of least rho_1, then rho_2."""
    best = 0
    for k in range(count):
        if points[k, 0] < points[best, 0] or (points[k, 0] == points[best, 0] and points[k, 1] < points[best, 1]):
            best = k
    for _ in range(best):
        for k in range(count - 1):
            for entry in range(6):
                sites[k, entry], sites[k + 1, entry] = sites[k + 1, entry], sites[k, entry]
                rows[k, entry], rows[k + 1, entry] = rows[k + 1, entry], rows[k, entry]
        for k in range(count):
            points[k, 0], points[k, 1] = points[k + 1, 0], points[k + 1, 1]
        points[count, 0], points[count, 1] = points[0, 0], points[0, 1]


@kernel
def _landfall(reals1, ints1, reals2, ints2, pose, frame):
    """Return (state, kind, face): where to start a walk round a region that no seed ray leads to.

    ADRIFT and a face that, with a vertex, is on its boundary as far as floats can tell; EMPTY where a combination of
    facet directions separates the parts at every scale pair for certain; UNDECIDED.
    """
    sites, rows = facet_rows(reals1, ints1, reals2, ints2, pose)
    # what the half-planes leave of a wide triangle; owner: the row on which the side from a corner to the next lies
    corners, owner = np.empty((len(rows) + 8, 2)), np.full(len(rows) + 8, -1, np.int64)
    more, others = np.empty((len(rows) + 8, 2)), np.empty(len(rows) + 8, np.int64)
    corners[0, 0], corners[0, 1] = 0.0, 0.0
    corners[1, 0], corners[1, 1] = _HORIZON, 0.0
    corners[2, 0], corners[2, 1] = 0.0, _HORIZON
    owner[0], owner[1], owner[2], count = _RHO_2, -1, _RHO_1, 3
    for k in range(len(rows)):
        a, b, c = rows[k, 3], rows[k, 4], rows[k, 5]
        made = 0
        for m in range(count):
            p, q = corners[m], corners[(m + 1) % count]
            before, after = a * p[0] + b * p[1] - c, a * q[0] + b * q[1] - c
            if before >= 0.0:
                more[made, 0], more[made, 1], others[made] = p[0], p[1], owner[m]
                made += 1
            if (before >= 0.0) != (after >= 0.0):
                share = before / (before - after)
                more[made, 0], more[made, 1] = p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])
                others[made] = k if before >= 0.0 else owner[m]
                made += 1
        corners, more, owner, others, before_count, count = more, corners, others, owner, count, made
        if count == 0:
            sure = _conflict(reals1, ints1, reals2, ints2, frame, rows, k, more, others, before_count)
            return (EMPTY if sure else UNDECIDED), -1, -1
    best, kind, face = 0.0, -1, -1
    for m in range(count):
        k = owner[m]
        if k >= 0 and sites[k, 0] != E1E2:
            p, q = corners[m], corners[(m + 1) % count]
            length = np.abs(q[0] - p[0]) + np.abs(q[1] - p[1])
            if length > best:
                best, kind, face = length, sites[k, 0], sites[k, 1 if sites[k, 0] == F1V2 else 2]
    return (ADRIFT if kind >= 0 else UNDECIDED), kind, face


_HORIZON, _RHO_1, _RHO_2 = 1e6, -2, -3  # scales beyond which no walk round a region is tried; the axes as owners


@step
def _conflict(reals1, ints1, reals2, ints2, frame, rows, last, corners, owner, count):
    """Tell whether row `last`, which leaves nothing of a polygon, excludes it and each other scale pair for certain."""
    # at the corner that it misses least, its gradient is balanced by those of the rows that meet there: their
    # directions, so weighted, add up to one that separates the parts at all positive scales
    a, b, c = rows[last, 3], rows[last, 4], rows[last, 5]
    best, m = -_INF, 0
    for k in range(count):
        value = a * corners[k, 0] + b * corners[k, 1] - c
        if value > best:
            best, m = value, k
    one, two = owner[m], owner[m - 1 if m else count - 1]
    if one == -1 or two == -1:
        return False
    slight = -_HINT * (frame[RADIUS_1] + frame[RADIUS_2])
    p, q = _gradient(rows, one), _gradient(rows, two)
    det = p[0] * q[1] - p[1] * q[0]
    n = _at(rows, last)
    if one >= 0:
        n = _minus(n, _times(-((slight - a) * q[1] - (slight - b) * q[0]) / det, _at(rows, one)))
    if two >= 0:
        n = _minus(n, _times(-((slight - b) * p[0] - (slight - a) * p[1]) / det, _at(rows, two)))
    length = _length(n)
    return 0.0 < length < _INF and _excluded(reals1, ints1, reals2, ints2, frame, _times(1.0 / length, n))


_HINT = 1e-12  # of the radii: what the balance is tipped by, so that no rounding makes a support positive


@step
def _gradient(rows, owner):
    if owner >= 0:
        return rows[owner, 3], rows[owner, 4]
    return (1.0, 0.0) if owner == _RHO_1 else (0.0, 1.0)


@step
def _excluded(reals1, ints1, reals2, ints2, frame, n):
    """Search, from n on, a direction with a < 0, b < 0 and c > 0 for certain: it separates the parts at any scales."""
    # the perceptron's rule: turn away from whatever lies farthest ahead
    d = _entry(frame, D)
    length = _length(d)
    for _ in range(TRIALS):
        n = _times(1.0 / _length(n), n)
        inward = _turned_back(frame, R, n)
        i, _ = _extreme(reals1, ints1, inward, frame[RADIUS_1] * SPOKE)
        j, _ = _extreme(reals2, ints2, _times(-1.0, n), frame[RADIUS_2] * SPOKE)
        x, y = _at(reals1, i), _at(reals2, j)
        first, second, third = _dot(inward, x), -_dot(n, y), -_dot(n, d)
        if first < -frame[RADIUS_1] * SPOKE and second < -frame[RADIUS_2] * SPOKE and third < -length * SPOKE:
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


@light
@kernel
def walk(reals1, ints1, reals2, ints2, transform, seed1, seed2, planarity):
    """Walk the overlay of the two Gauss maps along the boundary of the pair's overlap region in the open quadrant.

    Chains start where the seed ray of either body enters or leaves the other part. Return (state, sites, rows, points,
    chains): sites (k, 6) = kind, i, j, then the contact at the corner after it, as walked: F1V2 where edge i of part 1
    meets vertex j of part 2, V1F2 where edge i of part 2 meets vertex j of part 1, -1 where there is no corner;
    chains (k, 4) = first segment, segments, direction (+1 walked with the overlap region on the left, -1 on the
    right), 1 where it runs to infinity, and 2 more where it comes from there; chain c has points from its first
    segment + c on, one more than segments.

    Where no seed ray hits, the boundary is empty, a closed polygon (its last point is its first), or runs from infinity
    to infinity. State EMPTY: some direction separates the parts at every scale pair. UNDECIDED: a sign within its error
    bound, two features within `planarity`, a line or direction known to too few digits, or no such direction and no
    chain was found.
    """
    room, frame = 32, np.empty(FRAME)
    while True:
        sites, rows, points, chains = _space(room)
        state, used, made = walk_into(
            reals1, ints1, reals2, ints2, transform, seed1, seed2, planarity, sites, rows, points, chains, frame
        )
        if state != CROWDED:
            return state, sites[:used], rows[:used], points[: used + made], chains[:made]
        room *= 4


@kernel
def _space(room):
    """Return sites, rows, points and chains for a walk of so many segments."""
    return np.empty((room, 6), np.int64), np.empty((room, 6)), np.empty((room + 4, 2)), np.empty((4, 4), np.int64)


@kernel
def walk_into(reals1, ints1, reals2, ints2, transform, seed1, seed2, planarity, sites, rows, points, chains, frame):
    """Fill the arrays that `walk` returns; return (state, segments, chains): CROWDED where there is too little room."""
    kind, face = -1, -1
    known = _set_pose(transform, seed1, seed2, frame)
    _set_frame(reals1, ints1, reals2, ints2, frame, planarity, frame)
    while True:
        state, used, made = _walk(reals1, ints1, reals2, ints2, frame, kind, face, sites, rows, points, chains)
        if state == ADRIFT:
            state, kind, face = _landfall(reals1, ints1, reals2, ints2, frame[:12].copy(), frame)
            if state == ADRIFT:
                continue
        if state == UNDECIDED and known:
            return _walk_tied(reals1, ints1, reals2, ints2, frame, planarity, sites, rows, points, chains)
        return (state if known or state == CROWDED else UNDECIDED), used, made


# ----------------------------------------------------------------------------------------------------- where signs tie
#
# Parts that are drawn aligned have signs of exactly zero: parallel faces, a seed in one plane with an edge. Their walk
# is made beside: at a pose that is turned and moved by a little, from seeds that are, where nothing ties. What it meets
# is at the true pose still extreme, if only weakly, or else is left out; and where two of the lines that are left meet,
# the parts must touch. Half-planes that hold everywhere and corners that touch are a boundary, to rounding, whatever
# led there.

_ASIDE = np.array(
    [
        [3.1e-8, 7.3e-8, -5.9e-8, 4.7e-8, -2.3e-8, 6.7e-8],
        [-6.1e-7, 2.9e-7, 4.3e-7, -3.7e-7, 5.3e-7, 1.9e-7],
    ]
)  # turns, and moves relative to the offset, that nothing that is drawn is aligned with
_WITHIN = 1e-2  # relative to scales: how far within a boundary it is looked for overlap
_INWARD = 1e-8  # of the way to a part's middle: how far a seed is moved that is not inside
_SURE = 1e-9  # of the sizes: overlap by this much is no rounding, scales that differ by more are far from each other
_TIE, _NEARLY = 1e-14, 1e-10  # heights that differ by less, of the radius, are the same; by less than this, nearly so
_THIN = 1e-13  # stretches shorter than this, relative to their scales, are points; lines turned by less are one


@kernel
def _walk_tied(reals1, ints1, reals2, ints2, frame, planarity, sites, rows, points, chains):
    """Do what `_walk` does where signs tie, by way of a pose beside; the state is TIED in place of WALKED."""
    # GRAZING: a direction of a face keeps the parts apart, or just touching, at all scale pairs to within `planarity`
    inside1, inside2 = reals1[ints1[0] + ints1[1], 2] > 0.0, reals2[ints2[0] + ints2[1], 2] > 0.0
    if not _length(_entry(frame, D)) > _SURE * max(frame[RADIUS_1], frame[RADIUS_2]):
        return UNDECIDED, 0, 0  # the seeds are one but for rounding
    if not (inside1 or inside2) and _grazes(reals1, ints1, reals2, ints2, frame, planarity):
        return GRAZING, 0, 0
    shifted, witness = np.empty(FRAME), np.empty(6)
    moved1 = reals1 if inside1 else _moved_inward(reals1, ints1)
    moved2 = reals2 if inside2 else _moved_inward(reals2, ints2)
    for trial in range(len(_ASIDE)):
        _set_aside(frame, _ASIDE[trial], shifted)
        _set_frame(moved1, ints1, moved2, ints2, shifted, planarity, shifted)
        state, kind, face = ADRIFT, -1, -1
        for _ in range(2):
            state, _, made = _walk(moved1, ints1, moved2, ints2, shifted, kind, face, sites, rows, points, chains)
            if state != ADRIFT:
                break
            state, kind, face = _landfall(moved1, ints1, moved2, ints2, shifted[:12].copy(), shifted)
            if state != ADRIFT:
                break
        if state == CROWDED:
            return CROWDED, 0, 0
        if state == EMPTY:
            n = _times(1.0 / _length(_entry(frame, D)), _entry(frame, D))
            if _excluded(reals1, ints1, reals2, ints2, frame, n):
                return EMPTY, 0, 0
        witness[:] = 0.0
        total, chain = 0, 0
        while state == WALKED and chain < made:
            first, count = chains[chain, 0], chains[chain, 1]
            kept, chains[chain, 3] = _brought_back(
                reals1, ints1, reals2, ints2, frame, 1.0 * chains[chain, 2], chains[chain, 3],
                sites[first : first + count], rows[first : first + count],
                points[first + chain : first + chain + count + 1], witness,
            )  # fmt: skip
            for k in range(kept + 1 if total < first else 0):  # up to where the chain before it ends now
                points[total + chain + k, 0] = points[first + chain + k, 0]
                points[total + chain + k, 1] = points[first + chain + k, 1]
                for entry in range(6 if k < kept else 0):
                    sites[total + k, entry], rows[total + k, entry] = sites[first + k, entry], rows[first + k, entry]
            chains[chain, 0], chains[chain, 1] = total, kept
            total += kept
            chain += 1
            if kept == 0:
                state = UNDECIDED
        if state != WALKED:
            continue
        if inside1 or inside2 or _overlap_within(reals1, ints1, reals2, ints2, frame, rows[:total], witness):
            return TIED, total, made
    return UNDECIDED, 0, 0


@step
def _grazes(reals1, ints1, reals2, ints2, frame, planarity):
    """Tell whether the direction of some face has a <= 0, b <= 0 and c >= 0 to within `planarity` of the sizes."""
    length = _length(_entry(frame, D))
    for k in range(ints1[1] + ints2[1]):
        if k < ints1[1]:
            kind, face = F1V2, k
            if not _seed_height(reals1, ints1, face) <= planarity * frame[RADIUS_1]:
                continue
            apex, _ = _summit(reals2, ints2, _times(-1.0, _turned(frame, COFACTORS, _at(reals1, ints1[0] + face))))
        else:
            kind, face = V1F2, k - ints1[1]
            if not _seed_height(reals2, ints2, face) <= planarity * frame[RADIUS_2]:
                continue
            apex, _ = _summit(reals1, ints1, _turned_back(frame, R, _times(-1.0, _at(reals2, ints2[0] + face))))
        _, one, two, level = _face_row(reals1, ints1, reals2, ints2, frame, kind, face, apex)
        if one <= planarity * frame[RADIUS_1] and two <= planarity * frame[RADIUS_2] and level >= -planarity * length:
            return True
    return False


@step
def _seed_height(reals, ints, face):
    """Return how far the plane of a face is from the seed, negative where the seed is before it."""
    return _dot(_at(reals, ints[0] + face), _at(reals, _half_edge(ints, ints[np.uintp(ints[5] + face)], ORIGIN)))


@kernel
def _moved_inward(reals, ints):
    """Return a part's reals with its seed moved by a little towards the mean of its vertices."""
    moved, count = reals.copy(), ints[0]
    for axis in range(3):
        shift = 0.0
        for k in range(count):
            shift += reals[k, axis] / count
        for k in range(count):
            moved[k, axis] -= _INWARD * shift
    return moved


@step
def _set_aside(frame, aside, pose):
    """Fill the pose of a frame, turned and moved by a little."""
    turn, length = (aside[0], aside[1], aside[2]), _length(_entry(frame, D))
    for i in range(3):
        column = frame[R + i], frame[R + 3 + i], frame[R + 6 + i]
        more = _cross(turn, column)
        again = _cross(turn, more)
        for j in range(3):
            pose[3 * j + i] = column[j] + more[j] + 0.5 * again[j]
        pose[9 + i] = frame[D + i] + aside[3 + i] * length


@step
def _leads_outside(row, sense, x, y):
    """Tell whether a line leads from a scale pair, by its way on or back, on to none in the open quadrant."""
    if min(x, y) < -_SURE * max(np.abs(x), np.abs(y)):
        return True
    inward = sense * row[4] if np.abs(x) < np.abs(y) else -sense * row[3]
    return np.abs(min(x, y)) <= _THIN * max(x, y) and inward <= 0.0


@kernel
def _brought_back(reals1, ints1, reals2, ints2, frame, forward, endless, sites, rows, points, witness):
    """Bring a chain from beside to the true pose, in place; return (segments left, 0 where unsure, endless).

    Adds up in `witness` scale pairs, one for each but directions, and where the parts touch there.
    """
    count = len(sites)
    closed = endless == 0 and points[0, 0] == points[count, 0] and points[0, 1] == points[count, 1]
    kept, starts = np.empty(count, np.int64), np.zeros((count + 1, 2))
    low, made, far = 0, 0, np.zeros(2, np.int64)
    for k in range(count):
        extreme = _true_row(reals1, ints1, reals2, ints2, frame, sites[k], rows[k])
        if extreme < 0:
            return 0, endless
        turned, x, y = 1, 0.0, 0.0
        while extreme > 0 and made > 0:
            turned, x, y = _meeting(rows[kept[made - 1]], rows[k], forward)
            if turned < 0:
                return 0, endless
            if turned == 0 or turned == 3 or (closed and made == 1 and turned == 1):
                break
            if turned == 1 and made > 1 and _goes_on(rows[kept[made - 1]], forward, starts[made - 1], x, y):
                break
            if turned == 1 and made == 1 and not _leads_outside(rows[kept[0]], -forward, x, y):
                break
            turned, made = 1, made - 1  # it is passed in a point, if at all
        if extreme > 0 and turned == 1:
            kept[made], starts[made, 0], starts[made, 1] = k, x, y
            made += 1
        elif extreme > 0 and turned == 0 and _tells_more(sites, points, k, kept[made - 1]):
            kept[made - 1] = k
    if closed:
        while made - low >= 3:
            last, first = kept[made - 1], kept[low]
            turned, x, y = _meeting(rows[last], rows[first], forward)
            if turned < 0:
                return 0, endless
            if turned == 0:  # the chain began within it
                if _tells_more(sites, points, last, first):
                    kept[low] = last
                made -= 1
                starts[low, 0], starts[low, 1] = starts[made, 0], starts[made, 1]
                break
            starts[low, 0], starts[low, 1] = x, y
            if turned == 2:
                made -= 1
            elif turned == 3:
                low += 1
            elif not _goes_on(rows[last], forward, starts[made - 1], x, y):
                made -= 1
            elif not _goes_on(rows[first], forward, starts[low], starts[low + 1, 0], starts[low + 1, 1]):
                low += 1
            else:
                break
        if made - low < 3:
            return 0, endless
        starts[made, 0], starts[made, 1] = starts[low, 0], starts[low, 1]
    else:
        while made > 1 and _leads_outside(rows[kept[made - 1]], forward, starts[made - 1, 0], starts[made - 1, 1]):
            made -= 1
        if made == 0:
            return 0, endless
        for at in range(2):
            k = kept[(made - 1) * at]
            corner = starts[made - 1 if at == 1 and made > 1 else 1]
            if made == 1:  # the foot of the origin on the line
                square = rows[k, 3] * rows[k, 3] + rows[k, 4] * rows[k, 4]
                corner[0], corner[1] = rows[k, 3] * rows[k, 5] / square, rows[k, 4] * rows[k, 5] / square
            far[at], x, y = _end_of(rows[k], forward if at == 1 else -forward, corner)
            met, p = _ends_at(reals1, ints1, reals2, ints2, frame, sites[k], x, y, far[at] > 0)
            while not met and (k < count - 1 if at == 1 else k > 0):  # what was left out may touch there
                k += 2 * at - 1
                met, p = _ends_at(reals1, ints1, reals2, ints2, frame, sites[k], x, y, far[at] > 0)
            if not met:
                return 0, endless
            starts[made * at, 0], starts[made * at, 1] = x, y
            _add(witness, x, y, 1.0 - far[at], p)
    for m in range(low + (0 if closed else 1), made):  # where it turns into segment m
        before, own, x, y = kept[made - 1 if m == low else m - 1], kept[m], starts[m, 0], starts[m, 1]
        if not min(x, y) > _SURE * max(x, y) or not max(x, y) < np.inf:
            return 0, endless
        k, met = before, False
        while not met and k != own:
            met, p = _touches(reals1, ints1, reals2, ints2, frame, sites[k], x, y)
            if met:
                _add(witness, x, y, 1.0, p)
                for entry in range(3, 6):
                    sites[before, entry] = sites[k, entry]
            k = k + 1 if k + 1 < count else 0
        if not met:
            return 0, endless
    for m in range(low, made):
        for entry in range(6):
            sites[m - low, entry], rows[m - low, entry] = sites[kept[m], entry], rows[kept[m], entry]
        points[m - low, 0], points[m - low, 1] = starts[m, 0], starts[m, 1]
    points[made - low, 0], points[made - low, 1] = starts[made, 0], starts[made, 1]
    if closed:
        _start_lowest(sites, rows, points, made - low)
    return made - low, far[1] + 2 * far[0]


@step
def _tells_more(sites, points, one, two):
    """Tell which of two pieces of a line it is named by: one on a face, else the longer one beside."""
    if (sites[one, 0] == E1E2) != (sites[two, 0] == E1E2):
        return sites[two, 0] == E1E2
    first = abs(points[one + 1, 0] - points[one, 0]) + abs(points[one + 1, 1] - points[one, 1])
    return first > abs(points[two + 1, 0] - points[two, 0]) + abs(points[two + 1, 1] - points[two, 1])


@step
def _add(witness, x, y, weight, p):
    witness[0] += x
    witness[1] += y
    witness[2] += weight
    for axis in range(3):
        witness[3 + axis] += p[axis]


@step
def _true_row(reals1, ints1, reals2, ints2, frame, site, row):
    """Replace the row of a site beside by that at the true pose.

    Return 1 where its features are extreme there, 0 where they are not, -1 where something is nearly a tie.
    """
    kind, i, j = site[0], site[1], site[2]
    extreme = -1
    if kind != E1E2:
        face, apex = (i, j) if kind == F1V2 else (j, i)
        n, one, two, level = _face_row(reals1, ints1, reals2, ints2, frame, kind, face, apex)
        doubt = reals1[ints1[0] + face, 3] if kind == F1V2 else reals2[ints2[0] + face, 3]
        if doubt < FINE:
            if kind == F1V2:
                extreme = _extreme_at(reals2, ints2, apex, _times(-1.0, n))
            else:
                extreme = _extreme_at(reals1, ints1, apex, _turned_back(frame, R, n))
    else:
        n, one, two, level = _edge_row(reals1, ints1, reals2, ints2, frame, 2 * i, 2 * j)
        a, b, left, _ = _side(ints1, 2 * i)
        u, v, over, _ = _side(ints2, 2 * j)
        right, under = _half_edge(ints1, 2 * i + 1, FACE), _half_edge(ints2, 2 * j + 1, FACE)
        along, edge = _turned(frame, R, _minus(_at(reals1, b), _at(reals1, a))), _minus(_at(reals2, v), _at(reals2, u))
        sine = _length(_cross(along, edge)) / (_length(along) * _length(edge))
        if sine <= _TIE:  # any direction across them that both parts support
            along = _times(1.0 / _length(along), along)
            n = _entry(row, 0)
            n = _minus(n, _times(_dot(n, along), along))
        elif _dot(n, _entry(row, 0)) < 0.0:
            n = _times(-1.0, n)
        for trial in range(0 if _TIE < sine < _NEARLY else 5 if sine <= _TIE else 1):
            if trial == 1:
                n = _turned(frame, COFACTORS, _at(reals1, ints1[0] + left))
            elif trial == 2:
                n = _turned(frame, COFACTORS, _at(reals1, ints1[0] + right))
            elif trial == 3:
                n = _times(-1.0, _at(reals2, ints2[0] + over))
            elif trial == 4:
                n = _times(-1.0, _at(reals2, ints2[0] + under))
            n = _times(1.0 / _length(n), n)
            inward, back = _turned_back(frame, R, n), _times(-1.0, n)
            extreme = min(
                min(_extreme_at(reals1, ints1, a, inward), _extreme_at(reals1, ints1, b, inward)),
                min(_extreme_at(reals2, ints2, u, back), _extreme_at(reals2, ints2, v, back)),
            )
            if extreme == 1:
                break
        inward = _turned_back(frame, R, n)
        one, two, level = _dot(inward, _at(reals1, a)), -_dot(n, _at(reals2, u)), _dot(n, _entry(frame, D))
    row[0], row[1], row[2] = n
    row[3], unsure1 = _snapped(one, frame[RADIUS_1])
    row[4], unsure2 = _snapped(two, frame[RADIUS_2])
    row[5], unsure3 = _snapped(level, _length(_entry(frame, D)))
    return -1 if unsure1 or unsure2 or unsure3 or (row[3] == 0.0 and row[4] == 0.0) else extreme


@step
def _snapped(value, size):
    """Return a number that is 0 where it is so to rounding, and whether it is nearly so."""
    small = np.abs(value)
    return (0.0 if small <= _TIE * size else value), _TIE * size < small <= _NEARLY * size


@step
def _extreme_at(reals, ints, vertex, n):
    """Return 1 where a vertex is extreme along n, 0 where others are further on, -1 where one is nearly as far on."""
    here, radius, found = _at(reals, vertex), reals[ints[0] + ints[1], 0], 1
    first = h = ints[np.uintp(ints[4] + vertex)]
    while True:
        rise = _dot(n, _minus(_at(reals, _half_edge(ints, h, END)), here))
        if _TIE * radius < np.abs(rise) < _NEARLY * radius:
            return -1
        if rise > 0.0 and not rise <= _TIE * radius:
            found = 0
        h = _half_edge(ints, h ^ 1, NEXT)
        if h == first:
            return found


@step
def _meeting(before, after, forward):
    """Return (1, x, y): where two lines meet that follow each other.

    0 where they are one, 2 where the second leaves less, 3 where the first does, -1 where they turn the wrong way.
    """
    a, b, c = before[3], before[4], before[5]
    p, q, r = after[3], after[4], after[5]
    first, second, det = np.sqrt(a * a + b * b), np.sqrt(p * p + q * q), a * q - p * b
    turned = forward * det / (first * second)
    if turned > _THIN:
        return 1, (c * q - r * b) / det, (a * r - p * c) / det
    if not (turned > -_THIN and a * p + b * q > 0.0):
        return -1, 0.0, 0.0
    c, r = c / first, r / second
    if np.abs(r - c) <= _THIN * (np.abs(c) + np.abs(r)):
        return 0, 0.0, 0.0
    return (2 if r > c else 3), 0.0, 0.0


@step
def _goes_on(row, forward, start, x, y):
    """Tell whether a line leads from one scale pair on to another that is not the same."""
    ahead = forward * ((x - start[0]) * row[4] - (y - start[1]) * row[3])
    size = np.abs(x) + np.abs(y) + np.abs(start[0]) + np.abs(start[1])
    return ahead > _THIN * size * np.sqrt(row[3] * row[3] + row[4] * row[4])


@step
def _end_of(row, forward, start):
    """Return (1, u, v): the direction in which a line leads on without end; (0, x, y): where it meets an axis."""
    steep = np.sqrt(row[3] * row[3] + row[4] * row[4])
    u, v = forward * row[4] / steep, -forward * row[3] / steep
    one, two = (-start[0] / u if u < 0.0 else np.inf), (-start[1] / v if v < 0.0 else np.inf)
    if one == np.inf and two == np.inf:
        return 1, u, v
    if one < two:
        return 0, 0.0, row[5] / row[4]
    return 0, row[5] / row[3], 0.0


@step
def _touches(reals1, ints1, reals2, ints2, frame, site, x, y):
    """Return (whether, where) the edge and the vertex at the end of a segment touch at a scale pair."""
    d = _entry(frame, D)
    if site[3] < 0:
        return False, d
    if site[3] == F1V2:
        a, b, _, _ = _side(ints1, 2 * site[4])
        p = _plus(_times(y, _at(reals2, site[5])), d)
        u, v = _times(x, _turned(frame, R, _at(reals1, a))), _times(x, _turned(frame, R, _at(reals1, b)))
    else:
        a, b, _, _ = _side(ints2, 2 * site[4])
        p = _times(x, _turned(frame, R, _at(reals1, site[5])))
        u, v = _plus(_times(y, _at(reals2, a)), d), _plus(_times(y, _at(reals2, b)), d)
    size = np.abs(x) * frame[RADIUS_1] + np.abs(y) * frame[RADIUS_2] + _length(d)
    return _length(_minus(p, _foot(u, v, p))) <= FINE * size, p


@step
def _ends_at(reals1, ints1, reals2, ints2, frame, site, x, y, far):
    """Return (whether, where) the parts touch where a chain ends with a site, on an axis or far away in a direction."""
    kind, i, j = site[0], site[1], site[2]
    d = _entry(frame, D) if not far else (0.0, 0.0, 0.0)
    if y == 0.0:
        return x > 0.0 and _reached(reals1, ints1, x, _turned_back(frame, R, d)), d
    if x == 0.0:
        return y > 0.0 and _reached(reals2, ints2, y, _times(-1.0, d)), (0.0, 0.0, 0.0)
    if kind == F1V2:
        p = _times(y, _at(reals2, j))
        return _reached(reals1, ints1, x, _turned_back(frame, R, p)), p
    if kind == V1F2:
        p = _times(x, _turned(frame, R, _at(reals1, i)))
        return _reached(reals2, ints2, y, p), p
    a, b, _, _ = _side(ints1, 2 * i)
    u, v, _, _ = _side(ints2, 2 * j)
    p, q = _times(x, _turned(frame, R, _at(reals1, a))), _times(x, _turned(frame, R, _at(reals1, b)))
    apart, p = _apart(p, q, _times(y, _at(reals2, u)), _times(y, _at(reals2, v)))
    return apart <= FINE * frame[SIZE], p


@step
def _apart(p, q, r, s):
    """Return how far two segments are apart, and where on the first of them."""
    across = _cross(_minus(q, p), _minus(s, r))
    square = _dot(across, across)
    share = _dot(_cross(_minus(r, p), _minus(s, r)), across) / square if square > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    inside = _plus(_times(1.0 - share, p), _times(share, q))
    best, where = _length(_minus(inside, _foot(r, s, inside))), inside
    for end in (r, s):
        foot = _foot(p, q, end)
        if _length(_minus(end, foot)) < best:
            best, where = _length(_minus(end, foot)), foot
    for end in (p, q):
        apart = _length(_minus(end, _foot(r, s, end)))
        if apart < best:
            best, where = apart, end
    return best, where


@step
def _foot(p, q, x):
    """Return the point of a segment that is nearest to a point."""
    edge = _minus(q, p)
    share = min(max(_dot(_minus(x, p), edge) / _dot(edge, edge), 0.0), 1.0)
    return _plus(p, _times(share, edge))


@step
def _reached(reals, ints, scale, point):
    """Tell whether a part, scaled, has a point, from its seed and in its axes."""
    return _depth(reals, ints, scale, point) >= -FINE * (scale * reals[ints[0] + ints[1], 0] + _length(point))


@step
def _depth(reals, ints, scale, point):
    """Return how deep a point is inside a part, scaled, from its seed and in its axes; negative outside."""
    least = np.inf
    for face in range(ints[1]):
        least = min(least, scale * _seed_height(reals, ints, face) - _dot(_at(reals, ints[0] + face), point))
    return least


@kernel
def _overlap_within(reals1, ints1, reals2, ints2, frame, rows, witness):
    """Tell whether the parts surely overlap within a boundary: both may also lie on either side of a plane."""
    x, y, p = witness[0], witness[1], _entry(witness, 3)
    d = _times(witness[2], _entry(frame, D))
    least = _SURE * (x * frame[RADIUS_1] + y * frame[RADIUS_2] + _length(d))
    if (
        _depth(reals1, ints1, x, _turned_back(frame, R, p)) > least and _depth(reals2, ints2, y, _minus(p, d)) > least
    ):  # a mean of points that they share is inside both
        return True
    rho = np.array([x / witness[2], y / witness[2]])
    share = _WITHIN * max(rho[0], rho[1]) / len(rows)
    for k in range(len(rows)):
        a, b = rows[k, 3], rows[k, 4]
        for body in range(2):
            rho[body] += share * rows[k, 3 + body] / np.sqrt(a * a + b * b)
    if min(rho[0], rho[1]) <= 0.0:
        return False
    return -least_separation(reals1, ints1, reals2, ints2, frame[:12].copy(), rho) > least / witness[2]


@step
def clip(start, end, endless, line, box, least):
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
    if not hi > lo:
        return False, 0.0, 0.0, 0.0, 0.0
    x, y = start[0], start[1]
    u, v = end[0], end[1]
    if endless and hi_border < 0:
        u, v = x + _far(end[0]), y + _far(end[1])
    if lo_border >= 0:
        x, y = _on_border(line, box, lo_border)
    if hi_border >= 0:
        u, v = _on_border(line, box, hi_border)
    # relative to what is left: what is cut off may be far away
    size = max(np.abs(x) + np.abs(y), np.abs(u) + np.abs(v))
    return size == _INF or np.abs(u - x) + np.abs(v - y) > least * size, x, y, u, v


@step
def _clipped(points, place, k, count, endless, line, box, least):
    """Return what `clip` returns of segment k of a chain whose points begin at a place."""
    start, end = points[place + k], points[place + k + 1]
    if endless & 2 and k == 0:
        inside, u, v, x, y = clip(end, start, True, line, box, least)
        return inside, x, y, u, v
    return clip(start, end, endless & 1 and k == count - 1, line, box, least)


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


@light
@kernel
def state_in_box(rows, points, chains, box, least, sure):
    """Return CONTACT where a walked curve passes a box; else WALKED where the bodies are apart in it, or OVERLAPPING.

    UNDECIDED where the box's middle is within `sure` of a line, relatively.
    """
    for chain in range(len(chains)):
        first, count, endless = chains[chain, 0], chains[chain, 1], chains[chain, 3]
        for k in range(count):
            if _clipped(points, first + chain, k, count, endless, rows[first + k, 3:], box, least)[0]:
                return CONTACT
    if len(chains) == 0:
        return WALKED
    return _state_at(rows, len(rows), 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3]), sure)


@kernel
def walk_many(reals1, ints1, reals2, ints2, transforms, seeds, box, planarity, least, sure):
    """Walk the curves of one pair at many 4 x 4 transforms of body 1, and clip them to a box.

    Box: (low, high) of rho_1, then of rho_2; stretches shorter than `least` relative to their scales are dropped.
    Return (states, ties, counts, sites, rows, ends): states, whether signs tie, segments of each curve inside the box,
    and for all curves one after the other each segment's site, row and both ends (2, 2), with the overlap region on its
    left, chains in the order of their first scale pairs. State WALKED: the curve passes the box, or the bodies are
    apart at its middle; OVERLAPPING: they overlap there; UNDECIDED: as `walk`, or within `sure` of a line, relatively.
    """
    total = len(transforms)
    states, ties, counts = np.empty(total, np.int64), np.zeros(total, np.int64), np.zeros(total, np.int64)
    room, frame, seed1, seed2 = 32, np.empty(FRAME), seeds[0], seeds[1]
    sites, rows, points, chains = _space(room)
    capacity, kept = 4 * total + room, 0
    all_sites, all_rows = np.empty((capacity, 3), np.int64), np.empty((capacity, 6))
    ends = np.empty((capacity, 2, 2))
    item = 0
    while item < total:
        state, used, made = walk_into(
            reals1, ints1, reals2, ints2, transforms[item], seed1, seed2, planarity, sites, rows, points, chains, frame
        )
        if state == CROWDED:
            room *= 4
            sites, rows, points, chains = _space(room)
            continue
        if kept + used > capacity:
            capacity = 2 * capacity + used
            all_sites = _longer(all_sites, capacity)
            all_rows, ends = _longer(all_rows, capacity), _longer(ends, capacity)
        counts[item] = 0
        if state in (TIED, GRAZING):
            ties[item] = 1
        if state in (WALKED, TIED):
            state = WALKED
            counts[item] = _append(sites, rows, points, chains, made, box, least, all_sites, all_rows, ends, kept)
            if counts[item] == 0:
                state = _state_at(rows, used, 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3]), sure)
        kept += counts[item]
        states[item] = state if state in (UNDECIDED, OVERLAPPING) else WALKED
        item += 1
    return states, ties, counts, all_sites[:kept], all_rows[:kept], ends[:kept]


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
        back = _hanging(rows, points, first, first + best, count, box, least) if endless == 0 else 0
        for index in range(-back, count - back):
            k = index % count if forward > 0 else count - 1 - index
            inside, x, y, u, v = _clipped(points, first + best, k, count, endless, rows[first + k, 3:], box, least)
            if not inside:
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
def _hanging(rows, points, first, place, count, box, least):
    """Return how many of the last segments of a closed chain lead without a gap in the box to the first one."""
    start, end = points[place], points[place + count]
    if start[0] != end[0] or start[1] != end[1]:
        return 0
    for back in range(count):
        here, before = (count - back) % count, count - back - 1
        _, x, y, _, _ = clip(points[place + here], points[place + here + 1], False, rows[first + here, 3:], box, least)
        meets, _, _, u, v = clip(
            points[place + before], points[place + before + 1], False, rows[first + before, 3:], box, least
        )
        if not meets or x != u or y != v:
            return back
    return 0


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
    p, q = _first_pair(points, chains, one), _first_pair(points, chains, two)
    return p[0] < q[0] or (p[0] == q[0] and p[1] < q[1])


@step
def _first_pair(points, chains, chain):
    """Return the first scale pair of a chain, walked with the overlap region on the left; it may be at infinity."""
    first, count, endless = chains[chain, 0] + chain, chains[chain, 1], chains[chain, 3]
    last = first + count
    k, following, far = (first, first + 1, endless & 2) if chains[chain, 2] > 0 else (last, last - 1, endless & 1)
    x, y = points[k, 0], points[k, 1]
    if far > 0:
        x, y = (points[following, 0] if x == 0.0 else np.inf), (points[following, 1] if y == 0.0 else np.inf)
    return x, y


# ----------------------------------------------------------------------------------------------- all facet directions


@light
@kernel
def facet_rows(reals1, ints1, reals2, ints2, pose):
    """Return sites and rows of all facet directions of the Minkowski difference.

    a and b are the parts' supports, so that every row is a constraint that holds. Each edge's arc of the Gauss map is
    followed through the cells of the other part's vertices. Where a sign on its way is within its error bound, all
    pairs of the edge are listed whose arcs may meet, but for those that meet in the direction of a face (`SAME`).
    """
    frame = np.empty(FRAME)
    _set_frame(reals1, ints1, reals2, ints2, pose, 0.0, frame)
    n1, f1, n2, f2 = ints1[0], ints1[1], ints2[0], ints2[1]
    capacity = f1 + f2 + 2 * (ints1[2] + ints2[2])
    sites, rows = np.empty((capacity, 3), np.int64), np.empty((capacity, 6))
    sure, unsure = np.empty(f1, np.bool_), np.empty(ints1[2], np.int64)
    count = f1 + f2
    for i in range(f1):
        n = _turned(frame, COFACTORS, _at(reals1, n1 + i))
        bound = frame[RADIUS_2] * (2.0 * reals1[n1 + i, 3] + SPOKE)
        apex, sure[i] = _extreme(reals2, ints2, _times(-1.0, n), bound)
        n, one, two, level = _face_row(reals1, ints1, reals2, ints2, frame, F1V2, i, apex)
        if not reals1[n1 + i, 3] < SAME:  # bent: not all corners are extreme
            one = _height(reals1, 0, ints1[0], _turned_back(frame, R, n))
        _list(sites, rows, i, F1V2, i, apex, (n, one, two, level))
    for j in range(f2):
        n = _turned_back(frame, R, _times(-1.0, _at(reals2, n2 + j)))
        apex, _ = _extreme(reals1, ints1, n, frame[RADIUS_1] * SPOKE)
        n, one, two, level = _face_row(reals1, ints1, reals2, ints2, frame, V1F2, j, apex)
        if not reals2[n2 + j, 3] < SAME:
            two = _height(reals2, 0, ints2[0], _times(-1.0, n))
        _list(sites, rows, f1 + j, V1F2, apex, j, (n, one, two, level))
    exact, doubtful = reals1[n1 + f1, 1] > 0.0 and reals2[n2 + f2, 1] > 0.0, 0
    for edge in range(ints1[2]):
        # from the normal of the face on the edge's left to that on its right
        h, first = 2 * edge, count
        left, right = _half_edge(ints1, h, FACE), _half_edge(ints1, h + 1, FACE)
        vertex, skip, state = sites[left, 2], -1, 0
        n = _turned(frame, COFACTORS, _at(reals1, n1 + left))
        target = _turned(frame, COFACTORS, _at(reals1, n1 + right))
        bound = frame[RADIUS_2] * (2.0 * reals1[n1 + right, 3] + SPOKE)
        while exact and sure[left]:
            state, g = _beyond(reals2, ints2, vertex, n, target, skip, bound)
            if g < 0 or not _cross_surely(reals1, ints1, reals2, ints2, frame, h, g, SPOKE):
                break
            if count == len(sites):
                sites, rows = _longer(sites, 2 * count), _longer(rows, 2 * count)
            n, _, _, level = _edge_row(reals1, ints1, reals2, ints2, frame, h, g)
            inward = _turned_back(frame, R, n)
            a, _ = _climbed(reals1, ints1, _half_edge(ints1, h, ORIGIN), inward)
            b, _ = _climbed(reals2, ints2, vertex, _times(-1.0, n))
            row = n, _dot(inward, _at(reals1, a)), -_dot(n, _at(reals2, b)), level
            _list(sites, rows, count, E1E2, edge, g >> 1, row)
            count += 1
            vertex, skip = _half_edge(ints2, g, END), g >> 1
        if state != 1:
            count, unsure[doubtful] = first, edge
            doubtful += 1
    if doubtful > 0:
        return _with_doubtful(reals1, ints1, reals2, ints2, frame, sites, rows, count, unsure[:doubtful])
    return sites[:count], rows[:count]


@kernel
def _with_doubtful(reals1, ints1, reals2, ints2, frame, sites, rows, count, edges):
    """Return sites and rows, and of some edges of part 1 all with edges of part 2 whose arcs may cross theirs."""
    f1, f2, r1, r2 = ints1[0], ints2[0], frame[RADIUS_1], frame[RADIUS_2]
    # of each edge of part 2 its way, its length, and the normal of its arc's plane seen from part 1
    lines, across, lengths = np.empty((ints2[2], 3)), np.empty((ints2[2], 3)), np.empty(ints2[2])
    for other in range(ints2[2]):
        u, v, _, _ = _side(ints2, 2 * other)
        line = _minus(_at(reals2, v), _at(reals2, u))
        lines[other, 0], lines[other, 1], lines[other, 2] = line
        across[other, 0], across[other, 1], across[other, 2] = _turned_back(frame, COFACTORS, line)
        lengths[other] = _length(line)
    for edge in edges:
        h = 2 * edge
        a, b, left, _ = _side(ints1, h)
        right = _half_edge(ints1, h + 1, FACE)
        along = _turned(frame, R, _minus(_at(reals1, b), _at(reals1, a)))
        length = _length(along)
        before, after = _at(reals1, f1 + left), _at(reals1, f1 + right)
        slack, slack2 = r2 * (2.0 * reals1[f1 + left, 3] + SPOKE), r2 * (2.0 * reals1[f1 + right, 3] + SPOKE)
        for other in range(ints2[2]):
            # where each arc's ends lie beside the other's plane, and how far that may be wrong
            p, q = _dot(_at(across, other), before), _dot(_at(across, other), after)
            if (p > slack and q > slack2) or (p < -slack and q < -slack2):
                continue
            over, under = _half_edge(ints2, 2 * other, FACE), _half_edge(ints2, 2 * other + 1, FACE)
            bound, bound2 = r1 * (2.0 * reals2[f2 + over, 3] + SPOKE), r1 * (2.0 * reals2[f2 + under, 3] + SPOKE)
            s, t = _dot(along, _at(reals2, f2 + over)), _dot(along, _at(reals2, f2 + under))
            if (s > bound and t > bound2) or (s < -bound and t < -bound2):
                continue
            # a product over the length of this one is the sine of the angle from the face's direction to theirs
            near = SAME * _length(_cross(along, _at(lines, other)))
            one, two = near / length, near / lengths[other]
            if not near > 0.0 or (
                np.abs(p) + slack <= one or np.abs(q) + slack2 <= one
                or np.abs(s) + bound <= two or np.abs(t) + bound2 <= two
            ):  # fmt: skip
                continue
            # edges of two faces that are parallel meet in the direction of these, however short they are
            angle, shared = near / (length * lengths[other]), False
            for face, faced in ((left, over), (left, under), (right, over), (right, under)):
                lean = _length(_plus(_turned(frame, COFACTORS, _at(reals1, f1 + face)), _at(reals2, f2 + faced)))
                shared = shared or lean + 2.0 * (reals1[f1 + face, 3] + reals2[f2 + faced, 3]) + SPOKE <= angle
            if shared:
                continue
            for turn in range(2):
                sign = 1.0 - 2.0 * turn
                if sign * p < -slack or sign * q > slack2 or sign * s < -bound or sign * t > bound2:
                    continue
                listed, row = _supporting_row(reals1, ints1, reals2, ints2, frame, h, 2 * other + turn)
                if listed:
                    if count == len(sites):
                        sites, rows = _longer(sites, 2 * count), _longer(rows, 2 * count)
                    _list(sites, rows, count, E1E2, edge, other, row)
                    count += 1
    return sites[:count], rows[:count]


@kernel
def _supporting_row(reals1, ints1, reals2, ints2, frame, h1, h2):
    """Return (whether both are extreme along their common normal, row) of two edges: whether their arcs cross."""
    n, _, _, level = _edge_row(reals1, ints1, reals2, ints2, frame, h1, h2)
    inward, back = _turned_back(frame, R, n), _times(-1.0, n)
    one = _dot(inward, _at(reals1, _half_edge(ints1, h1, ORIGIN)))
    two = _dot(back, _at(reals2, _half_edge(ints2, h2, ORIGIN)))
    most1, most2 = one + FINE * frame[RADIUS_1], two + FINE * frame[RADIUS_2]
    for side in range(2):  # the faces' next corners settle most
        following1, following2 = _half_edge(ints1, h1 ^ side, NEXT), _half_edge(ints2, h2 ^ side, NEXT)
        corner1, corner2 = _half_edge(ints1, following1, END), _half_edge(ints2, following2, END)
        if not (_dot(inward, _at(reals1, corner1)) <= most1 and _dot(back, _at(reals2, corner2)) <= most2):
            return False, (n, one, two, level)
    one, two = _height(reals1, 0, ints1[0], inward), _height(reals2, 0, ints2[0], back)
    return one <= most1 and two <= most2, (n, one, two, level)


@step
def _height(reals, first, count, n):
    """Return the largest product of n with so many vertices from one on."""
    height = -_INF
    for k in range(first, first + count):
        height = max(height, _dot(n, _at(reals, k)))
    return height


@step
def _list(sites, rows, k, kind, i, j, row):
    sites[k, 0], sites[k, 1], sites[k, 2] = kind, i, j
    rows[k, 0], rows[k, 1], rows[k, 2] = row[0]
    rows[k, 3], rows[k, 4], rows[k, 5] = row[1], row[2], row[3]


@light
@kernel
def least_separation(reals1, ints1, reals2, ints2, pose, rho):
    """Return the largest separation over facet directions, max of c - a rho_1 - b rho_2."""
    # minus the penetration depth where the parts overlap, a lower bound of the distance where they are apart
    return _widest(facet_rows(reals1, ints1, reals2, ints2, pose)[1], rho[0], rho[1])[1]


@kernel
def _widest(rows, x, y):
    """Return the row with the largest separation, and that."""
    best, widest = 0, -np.inf
    for r in range(len(rows)):
        wide = rows[r, 5] - rows[r, 3] * x - rows[r, 4] * y
        if wide > widest:
            best, widest = r, wide
    return best, widest


@light
@kernel
def separation(reals1, ints1, reals2, ints2, pose, rho, n):
    """Return the separation c - a rho_1 - b rho_2 along one unit direction from body 1 to body 2."""
    direction = n[0], n[1], n[2]
    inward = _turned_back(pose, 0, direction)
    first, _ = _extreme(reals1, ints1, inward, reals1[ints1[0] + ints1[1], 0] * SPOKE)
    second, _ = _extreme(reals2, ints2, _times(-1.0, direction), reals2[ints2[0] + ints2[1], 0] * SPOKE)
    level = _dot(direction, _entry(pose, 9))
    return level - _dot(inward, _at(reals1, first)) * rho[0] + _dot(direction, _at(reals2, second)) * rho[1]


# ------------------------------------------------------------------------------------------- a feature that is tracked


@light
@kernel
def tracked_row(reals1, ints1, reals2, ints2, pose, site, sign):
    """Return the row of a site at a pose; parallel edges give nan."""
    # `sign` orients an edge pair's normal as +-(edge 1 x edge 2), so that it does not jump where the pair stops being a
    # facet
    frame, row = np.empty(FRAME), np.full(6, np.nan)
    _set_frame(reals1, ints1, reals2, ints2, pose, 0.0, frame)
    kind, i, j = site[0], site[1], site[2]
    if kind == E1E2:
        a, b, _, _ = _side(ints1, 2 * i)
        u, v, _, _ = _side(ints2, 2 * j)
        along = _turned(frame, R, _minus(_at(reals1, b), _at(reals1, a)))
        if not _length(_cross(along, _minus(_at(reals2, v), _at(reals2, u)))) > 0.0:
            return row
        n, one, two, level = _edge_row(reals1, ints1, reals2, ints2, frame, 2 * i + (0 if sign > 0 else 1), 2 * j)
    else:
        face, apex = (i, j) if kind == F1V2 else (j, i)
        n, one, two, level = _face_row(reals1, ints1, reals2, ints2, frame, kind, face, apex)
    row[0], row[1], row[2] = n
    row[3], row[4], row[5] = one, two, level
    return row


# ------------------------------------------------------------------------------------------------ part pairs of unions


@kernel
def _pair(reals1, ints1, places1, reals2, ints2, places2, i, j):
    """Return the packed arrays of two of several parts."""
    return (
        reals1[places1[i, 0] : places1[i + 1, 0]],
        ints1[places1[i, 1] : places1[i + 1, 1]],
        reals2[places2[j, 0] : places2[j + 1, 0]],
        ints2[places2[j, 1] : places2[j + 1, 1]],
    )


@light
@kernel
def least_gaps(reals1, ints1, places1, reals2, ints2, places2, transform, seed1, seed2, rho):
    """Return the signed gap of two unions at scale pairs (k, 2), and the part pair that has it, (k, 2)."""
    # the least over the pairs of what `near_gaps` tells
    pose, n2 = relative_pose(transform, seed1, seed2), len(places2) - 1
    least, owners = np.full(len(rho), _INF), np.zeros((len(rho), 2), np.int64)
    for k in range(len(rho)):
        gaps = near_gaps(reals1, ints1, places1, reals2, ints2, places2, pose, rho[k], -_INF)
        for code in range(gaps.size):
            i, j = code // n2, code % n2
            if gaps[i, j] < least[k]:
                least[k], owners[k, 0], owners[k, 1] = gaps[i, j], i, j
    return least, owners


@light
@kernel
def pair_bounds(reals1, ints1, places1, reals2, ints2, places2, pose, rho):
    """Return lower bounds of all part pairs' signed gaps at a scale pair, (parts 1, parts 2), from a few directions."""
    d, bounds = _entry(pose, 9), np.full((len(places1) - 1, len(places2) - 1), -_INF)
    heights = np.empty(bounds.shape[1])
    for k in range(_DIRECTIONS - 1):
        u = _direction(k)
        inward, back, level = _turned_back(pose, 0, u), _times(-1.0, u), _dot(u, d)
        for j in range(bounds.shape[1]):
            heights[j] = _height(reals2, places2[j, 0], ints2[places2[j, 1]], back) * rho[1]
        for i in range(len(bounds)):
            own = level - _height(reals1, places1[i, 0], ints1[places1[i, 1]], inward) * rho[0]
            for j in range(bounds.shape[1]):
                bounds[i, j] = max(bounds[i, j], own - heights[j])
    middles1, middles2 = _middles(reals1, ints1, places1), _middles(reals2, ints2, places2)
    for i in range(len(bounds)):
        middle = _times(rho[0], _turned(pose, 0, _at(middles1, i)))
        for j in range(bounds.shape[1]):
            n = _between(d, middle, _times(-rho[1], _at(middles2, j)))
            own = _dot(n, d) - _height(reals1, places1[i, 0], ints1[places1[i, 1]], _turned_back(pose, 0, n)) * rho[0]
            other = _height(reals2, places2[j, 0], ints2[places2[j, 1]], _times(-1.0, n)) * rho[1]
            bounds[i, j] = max(bounds[i, j], own - other)
    return bounds


@often
@kernel
def near_gaps(reals1, ints1, places1, reals2, ints2, places2, pose, rho, enough):
    """Return the signed gap of every part pair at a scale pair, (parts 1, parts 2), as exact as it is needed."""
    # the largest separation over its facet directions, in unions over those of `pair_bounds` too, for pairs that may
    # have the least of all, or less than `enough`; of others a lower bound that is at least as much
    gaps, best = pair_bounds(reals1, ints1, places1, reals2, ints2, places2, pose, rho), _INF
    n2, least = len(places2) - 1, np.argmin(gaps)
    for turn in range(-1, gaps.size):  # the likeliest first
        code = least if turn < 0 else turn
        i, j = code // n2, code % n2
        if turn == least or gaps[i, j] >= max(best, enough):
            continue
        own1, table1, own2, table2 = _pair(reals1, ints1, places1, reals2, ints2, places2, i, j)
        apart = least_separation(own1, table1, own2, table2, pose, rho)
        gaps[i, j] = apart if gaps.size == 1 else max(gaps[i, j], apart)
        best = min(best, gaps[i, j])
    return gaps


@light
@kernel
def spans(reals1, ints1, places1, reals2, ints2, places2, pose, rho, pairs, along, need, level):
    """Return between which shifts along a way part pairs, (k, 2), are nearer than a need along all facet directions.

    (k, 4): from where, to where, by how much they are apart more than that all along, and how many directions there
    are. Directions that the way changes by no more than `level` are those all along.
    """
    found = np.empty((len(pairs), 4))
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        own1, table1, own2, table2 = _pair(reals1, ints1, places1, reals2, ints2, places2, i, j)
        rows = facet_rows(own1, table1, own2, table2, pose)[1]
        low, high, most = -_INF, _INF, -_INF
        for m in range(len(rows)):
            excess = rows[m, 5] - rows[m, 3] * rho[0] - rows[m, 4] * rho[1] - need
            rate = _dot(_at(rows, m), _entry(along, 0))
            if np.abs(rate) <= level:
                most = max(most, excess)
            elif rate > 0.0:
                low = max(low, excess / rate)
            else:
                high = min(high, excess / rate)
        found[k, 0], found[k, 1], found[k, 2], found[k, 3] = low, high, most, len(rows)
    return found


@light
@kernel
def widest_rows(reals1, ints1, places1, reals2, ints2, places2, pose, rho, pairs):
    """Return of part pairs, (k, 2), the row of the facet direction of their largest separation, (k, 6)."""
    widest = np.empty((len(pairs), 6))
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        own1, table1, own2, table2 = _pair(reals1, ints1, places1, reals2, ints2, places2, i, j)
        _, rows = facet_rows(own1, table1, own2, table2, pose)
        widest[k] = rows[np.argmax(rows[:, 5] - rows[:, 3] * rho[0] - rows[:, 4] * rho[1])]
    return widest


@light
@kernel
def heights(reals, ints, places, parts, directions):
    """Return how far parts, (k,), reach from the seed along a direction each, (k, 3), in the body's axes."""
    found = np.empty(len(parts))
    for k in range(len(parts)):
        first = places[parts[k]]
        found[k] = _height(reals, first[0], ints[first[1]], _at(directions, k))
    return found


_DIRECTIONS = 15  # of the quick test: both ways along the axes and along the diagonals of a cube, and another
_DIAGONAL = 1.0 / np.sqrt(3.0)


@step
def _direction(number):
    """Return one of the directions; 2 k and 2 k + 1 are opposite."""
    sign = 1.0 if number & 1 == 0 else -1.0
    axis = number >> 1
    if axis < 3:
        return (sign if axis == 0 else 0.0), (sign if axis == 1 else 0.0), (sign if axis == 2 else 0.0)
    s = sign * _DIAGONAL
    return s, (-s if axis - 3 & 1 else s), (-s if axis - 3 & 2 else s)


@light
@kernel
def quick_lines(reals1, ints1, places1, reals2, ints2, places2, pose, x, y):
    """Return contact lines (a, b, c) of all part pairs in a few directions, (pairs x ways, 3), largest |a| and |b|."""
    # the last is from the middle of the one part to that of the other at a scale pair
    n1, n2, d = len(places1) - 1, len(places2) - 1, _entry(pose, 9)
    lines, most1, most2 = np.empty((n1 * n2 * _DIRECTIONS, 3)), 0.0, 0.0
    middles1, middles2 = _middles(reals1, ints1, places1), _middles(reals2, ints2, places2)
    for number in range(_DIRECTIONS - 1):
        u = _direction(number)
        inward, back, level = _turned_back(pose, 0, u), _times(-1.0, u), _dot(u, d)
        for i in range(n1):
            a = _height(reals1, places1[i, 0], ints1[places1[i, 1]], inward)
            most1 = max(most1, np.abs(a))
            for j in range(n2):
                lines[(i * n2 + j) * _DIRECTIONS + number, 0] = a
        for j in range(n2):
            b = _height(reals2, places2[j, 0], ints2[places2[j, 1]], back)
            most2 = max(most2, np.abs(b))
            for i in range(n1):
                k = (i * n2 + j) * _DIRECTIONS + number
                lines[k, 1], lines[k, 2] = b, level
    for i in range(n1):
        middle = _times(x, _turned(pose, 0, _at(middles1, i)))
        for j in range(n2):
            n, k = _between(d, middle, _times(-y, _at(middles2, j))), (i * n2 + j) * _DIRECTIONS + _DIRECTIONS - 1
            lines[k, 0] = _height(reals1, places1[i, 0], ints1[places1[i, 1]], _turned_back(pose, 0, n))
            lines[k, 1] = _height(reals2, places2[j, 0], ints2[places2[j, 1]], _times(-1.0, n))
            lines[k, 2] = _dot(n, d)
    return lines, most1, most2


@step
def _between(d, middle, other):
    """Return the unit direction from one part's middle to that of another, less `d`; any where they coincide."""
    n = _minus(_minus(d, middle), other)
    length = _length(n)
    return _times(1.0 / length, n) if length > 0.0 else (1.0, 0.0, 0.0)


@kernel
def _middles(reals, ints, places):
    """Return the mean of each part's vertices."""
    middles = np.zeros((len(places) - 1, 3))
    for part in range(len(middles)):
        first, n = places[part, 0], ints[places[part, 1]]
        for k in range(first, first + n):
            for axis in range(3):
                middles[part, axis] += reals[k, axis] / n
    return middles


@kernel
def _longer(values, room):
    """Return an array with more rows, the first as they were."""
    more = np.empty((room,) + values.shape[1:], values.dtype)  # noqa: RUF005 -- compiled code cannot unpack
    more[: len(values)] = values
    return more


# ---------------------------------------------------------------------------------- what regions leave of each other


@light
@kernel
def interval(lines, base, travel, limits):
    """Return where base + s travel lies inside a region with a boundary, from its lines; limits as `stretches`."""
    lo, hi = -np.inf, np.inf
    for k in range(len(lines)):
        a, b, c = lines[k, 0], lines[k, 1], lines[k, 2]
        value, slope = a * base[0] + b * base[1] - c, a * travel[0] + b * travel[1]
        if np.abs(slope) <= limits[0]:
            if value <= limits[1] * (np.abs(base[0]) + np.abs(base[1]) + np.abs(c)):
                return 0.0, 0.0
        elif slope > 0.0:
            lo = max(lo, -value / slope)
        else:
            hi = min(hi, -value / slope)
    return lo, hi


@light
@kernel
def stretches(lines, line_starts, pieces, piece_starts, cells, members, shares, limits):
    """Return which stretches of the pieces are on the boundary of a union of regions, (k, 3): piece, lo, hi.

    For each cell (m, 4) with members[shares[c]:shares[c + 1]], regions that have lines and pieces from their starts on.
    limits are (tie, line, nominal) of `Tolerances` and the least scale that lines are compared at. Where lo = hi it is
    a point that no open region holds.
    """
    found, used = np.empty((64, 3)), 0
    most = 2 * len(members) + 2  # one that grazes leaves a point besides
    rest, room = np.empty((most, 2)), np.empty((most, 2))
    for cell in range(len(cells)):
        for m in range(shares[cell], shares[cell + 1]):
            own = members[m]
            for piece in range(piece_starts[own], piece_starts[own + 1]):
                base, travel = (pieces[piece, 0], pieces[piece, 1]), (pieces[piece, 2], pieces[piece, 3])
                rest[0, 0], rest[0, 1] = _within(base, travel, pieces[piece, 4], pieces[piece, 5], cells[cell])
                count = 1 if rest[0, 0] < rest[0, 1] else 0
                scale = max(np.abs(base[0]) + np.abs(base[1]), limits[3])
                for k in range(shares[cell], shares[cell + 1]):
                    other = members[k]
                    if count == 0:
                        break
                    if other != own and line_starts[other] < line_starts[other + 1]:  # not an empty one
                        lo, hi = interval(lines[line_starts[other] : line_starts[other + 1]], base, travel, limits)
                        count = take_out(rest, room, count, lo, hi, limits[1], scale, True)
                if used + count > len(found):
                    found = _longer(found, 2 * len(found) + count)
                for k in range(count):
                    found[used, 0], found[used, 1], found[used, 2] = piece, rest[k, 0], rest[k, 1]
                    used += 1
    return found[:used]


@kernel
def _within(base, travel, lo, hi, cell):
    """Return the stretch of a line inside a cell, of what lies from lo to hi; reversed where there is none."""
    for axis in range(2):
        low, high = cell[2 * axis], cell[2 * axis + 1]
        if travel[axis] == 0.0:
            if base[axis] < low or base[axis] > high:
                return 1.0, 0.0
        elif travel[axis] > 0.0:
            lo, hi = max(lo, (low - base[axis]) / travel[axis]), min(hi, (high - base[axis]) / travel[axis])
        else:
            lo, hi = max(lo, (high - base[axis]) / travel[axis]), min(hi, (low - base[axis]) / travel[axis])
    return lo, hi


@light
@kernel
def take_out(spans, room, count, lo, hi, sliver, scale, points):
    """Take an open interval out of closed ones; return how many are left."""
    # slivers within rounding are dropped, or with `points` kept as intervals that end where they start
    if hi <= lo:
        return count
    made = 0
    for k in range(count):
        for side in range(2):
            p, q = (spans[k, 0], min(spans[k, 1], lo)) if side == 0 else (max(spans[k, 0], hi), spans[k, 1])
            near = sliver * (scale + min(np.abs(p), np.abs(q)))
            if p < q and q - p > near:  # two infinite ends: none left
                room[made, 0], room[made, 1] = p, q
                made += 1
            elif points and np.abs(q - p) <= near < np.inf:
                room[made, 0], room[made, 1] = p, p
                made += 1
                if spans[k, 0] == spans[k, 1]:
                    break
    spans[:made] = room[:made]
    return made
