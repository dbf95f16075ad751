"""All numba kernels, in one file (the disk cache does not follow imports between files).

They take a part's packed arrays (`ConvexPart.packed`: vertices relative to the seed, face normals; adjacency) and a
pose, (12,): the rotation R of body 1, row by row, then d = s_2 - s_1 with the moved seed. World frame throughout.

A *site* (kind, i, j) is a facet of the Minkowski difference: F1V2 = face i of part 1 with vertex j of part 2,
V1F2 = vertex i with face j, E1E2 = edge i with edge j. A *row* is (n, a, b, c): unit direction from body 1 to body 2
and the contact line a rho_1 + b rho_2 = c.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

F1V2, V1F2, E1E2, AXIS = 0, 1, 2, 3
WALKED, UNDECIDED = 0, 1
_INF = np.inf
_CROSSING = 1e-3  # lines that cross at a larger angle give their switching point better than the step that found it
_DRIFT = 1e-9  # step and crossing further apart than this: something is wrong, leave it to the path without topology


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile with the options all kernels share.

    Cached, as compiling takes seconds; no fastmath, as NaN and the order of sums matter; no bounds checks; "numpy"
    division, so that x / 0 is infinite, which the comparisons below rely on.
    """
    try:
        return numba.njit(cache=True, error_model="numpy", nogil=True)(function)
    except RuntimeError:  # nowhere to write a cache: compile anew in every process
        return numba.njit(error_model="numpy", nogil=True)(function)


@kernel
def _dot(u, x):
    return u[0] * x[0] + u[1] * x[1] + u[2] * x[2]


@kernel
def _cross(u, x, out):
    out[0] = u[1] * x[2] - u[2] * x[1]
    out[1] = u[2] * x[0] - u[0] * x[2]
    out[2] = u[0] * x[1] - u[1] * x[0]


@kernel
def rotated(reals, pose):
    """Return the rows of body 1 turned by R, (n + f, 3)."""
    out = np.empty_like(reals)
    for k in range(len(reals)):
        for i in range(3):
            out[k, i] = pose[3 * i] * reals[k, 0] + pose[3 * i + 1] * reals[k, 1] + pose[3 * i + 2] * reals[k, 2]
    return out


@kernel
def _support(X, count, n, sign):
    """Return the largest sign * n.x over the vertices, where, and the second largest."""
    best, where, second = -_INF, -1, -_INF
    for k in range(count):
        value = sign * _dot(n, X[k])
        if value > best:
            second, best, where = best, value, k
        elif value > second:
            second = value
    return best, where, second


@kernel
def _face_level(X, ints, face, n, sign):
    """Return the largest sign * n.x over a face's vertices."""
    best = -_INF
    start, stop = ints[ints[6] + face], ints[ints[6] + face + 1]
    for entry in range(start, stop):
        edge = ints[3] + 4 * ints[ints[7] + entry]
        best = max(best, sign * _dot(n, X[ints[edge]]), sign * _dot(n, X[ints[edge + 1]]))
    return best


@kernel
def site_row(X, ints1, Y, ints2, d, site, row):
    """Fill `row` = (n, a, b, c) of a site; return False where two edges are parallel."""
    kind, i, j = site[0], site[1], site[2]
    n = row[:3]
    if kind == F1V2:
        n[:] = X[ints1[0] + i]
        row[3], row[4] = _face_level(X, ints1, i, n, 1.0), -_dot(n, Y[j])
    elif kind == V1F2:
        n[:] = -Y[ints2[0] + j]
        row[3], row[4] = _dot(n, X[i]), _face_level(Y, ints2, j, n, -1.0)
    else:
        e, g = ints1[3] + 4 * i, ints2[3] + 4 * j
        along, across = X[ints1[e + 1]] - X[ints1[e]], Y[ints2[g + 1]] - Y[ints2[g]]
        _cross(along, across, n)
        length = np.sqrt(_dot(n, n))
        if length == 0.0:
            return False
        outside = X[ints1[0] + ints1[e + 2]] + X[ints1[0] + ints1[e + 3]]
        outside -= Y[ints2[0] + ints2[g + 2]] + Y[ints2[0] + ints2[g + 3]]
        n *= (1.0 if _dot(n, outside) > 0 else -1.0) / length
        row[3], row[4] = _dot(n, X[ints1[e]]), -_dot(n, Y[ints2[g]])
    row[5] = _dot(n, d)
    return True


@kernel
def facet_rows(reals1, ints1, reals2, ints2, pose, slack):
    """Return sites and rows of all facet directions of the Minkowski difference, with true supports.

    Every direction gives a valid constraint, so those accepted within `slack` do no harm; parallel edges give none
    of their own.
    """
    X, d = rotated(reals1, pose), pose[9:]
    Y = reals2
    n1, f1, m1, n2, f2, m2 = ints1[0], ints1[1], ints1[2], ints2[0], ints2[1], ints2[2]
    capacity = f1 + f2 + m1 + m2
    sites, rows = np.empty((capacity, 3), np.int64), np.empty((capacity, 6))
    count = 0
    for i in range(f1):
        n = X[n1 + i]
        level, where, _ = _support(Y, n2, n, -1.0)
        sites[count] = F1V2, i, where
        rows[count, :3], rows[count, 4] = n, level
        count += 1
    for j in range(f2):
        n = Y[n2 + j]
        _, where, _ = _support(X, n1, n, -1.0)
        sites[count] = V1F2, where, j
        rows[count, :3] = -n
        rows[count, 4] = _support(Y, n2, n, 1.0)[0]
        count += 1
    n = np.empty(3)
    for i in range(m1):
        e = ints1[3] + 4 * i
        along = X[ints1[e + 1]] - X[ints1[e]]
        left, right = X[n1 + ints1[e + 2]], X[n1 + ints1[e + 3]]
        long = np.sqrt(_dot(along, along))
        for j in range(m2):
            g = ints2[3] + 4 * j
            left2, right2 = Y[n2 + ints2[g + 2]], Y[n2 + ints2[g + 3]]
            p, q = _dot(left2, along), _dot(right2, along)
            if (p > slack * long and q > slack * long) or (p < -slack * long and q < -slack * long):
                continue
            across = Y[ints2[g + 1]] - Y[ints2[g]]
            wide = np.sqrt(_dot(across, across))
            p, q = _dot(left, across), _dot(right, across)
            if (p > slack * wide and q > slack * wide) or (p < -slack * wide and q < -slack * wide):
                continue
            _cross(along, across, n)
            length = np.sqrt(_dot(n, n))
            if length <= slack * long * wide:
                continue
            outside, inside = _dot(n, left) + _dot(n, right), _dot(n, left2) + _dot(n, right2)
            if outside * inside > 0:  # the arcs lie on opposite hemispheres
                continue
            if count == capacity:
                capacity *= 2
                sites_, rows_ = np.empty((capacity, 3), np.int64), np.empty((capacity, 6))
                sites_[:count], rows_[:count] = sites, rows
                sites, rows = sites_, rows_
            sites[count] = E1E2, i, j
            turn = (1.0 if outside - inside > 0 else -1.0) / length
            for k in range(3):
                rows[count, k] = n[k] * turn
            rows[count, 4] = _support(Y, n2, rows[count, :3], -1.0)[0]
            count += 1
    for k in range(count):
        rows[k, 3] = _support(X, n1, rows[k, :3], 1.0)[0]
        rows[k, 5] = _dot(rows[k, :3], d)
    return sites[:count], rows[:count]


@kernel
def least_separation(reals1, ints1, reals2, ints2, pose, rho, slack):
    """Return the largest separation over facet directions, max of c - a rho_1 - b rho_2.

    Minus the penetration depth where the parts overlap, a lower bound of the distance where they are apart.
    """
    rows = facet_rows(reals1, ints1, reals2, ints2, pose, slack)[1]
    best = -_INF
    for k in range(len(rows)):
        best = max(best, rows[k, 5] - rows[k, 3] * rho[0] - rows[k, 4] * rho[1])
    return best


@kernel
def separation(reals1, ints1, reals2, ints2, pose, rho, n):
    """Return the separation c - a rho_1 - b rho_2 along one unit direction from body 1 to body 2."""
    a = _support(rotated(reals1, pose), ints1[0], n, 1.0)[0]
    return _dot(n, pose[9:]) - a * rho[0] - _support(reals2, ints2[0], n, -1.0)[0] * rho[1]


# ---------------------------------------------------------------------------------------- the walk (design section 3)


@kernel
def _seed_ray(Y, ints, ray, tie):
    """Return (state, t_in, face_in, t_out, face_out): the part of t ray, t > 0, inside a convex part.

    State 0: missed, 1: hit, 2: too close to an edge or to grazing to tell. t_in = 0 where the seed is inside.
    """
    count, size = ints[0], 0.0
    for k in range(count):
        size = max(size, np.abs(Y[k]).max())
    length = np.sqrt(_dot(ray, ray))
    t_in, face_in, t_out, face_out = -_INF, -1, _INF, -1
    second_in, second_out = -_INF, _INF
    for face in range(ints[1]):
        n = Y[count + face]
        level, slope = _face_level(Y, ints, face, n, 1.0), _dot(n, ray)
        if np.abs(slope) <= tie * length:
            if np.abs(level) <= tie * size:
                return 2, 0.0, -1, 0.0, -1
            if level < 0:
                return 0, 0.0, -1, 0.0, -1
        elif slope > 0:
            t = level / slope
            if t < t_out:
                second_out, t_out, face_out = t_out, t, face
            elif t < second_out:
                second_out = t
        else:
            t = level / slope
            if t > t_in:
                second_in, t_in, face_in = t_in, t, face
            elif t > second_in:
                second_in = t
    close = tie * size / length
    if t_out < -close or t_out < t_in - close:
        return 0, 0.0, -1, 0.0, -1
    if t_out < close or np.abs(t_in) < close or t_out < t_in + close or second_out < t_out + close:
        return 2, 0.0, -1, 0.0, -1
    if t_in < 0:
        return 1, 0.0, -1, t_out, face_out
    if second_in > t_in - close:
        return 2, 0.0, -1, 0.0, -1
    return 1, t_in, face_in, t_out, face_out


@kernel
def _leave(value, slope, scale, candidate, best, tie):
    """Update the first constraint to reach zero: best = (parameter, candidate, runner-up parameter)."""
    at, who, second = best
    if slope >= -tie * scale:
        return best
    parameter = max(value, 0.0) / -slope
    if parameter < at:
        return parameter, candidate, at
    if parameter < second:
        return at, who, parameter
    return best


@kernel
def _exit(X, ints1, Y, ints2, d, site, rho, travel, tie):
    """Return (parameter, candidate, runner-up): where the contact point leaves its feature.

    The contact point's coordinates in face or edges, times the scale, are linear in rho. Candidate: an edge of the
    face (F1V2, V1F2); 0 to 3: ends 0, 1 of edge i, ends 0, 1 of edge j (E1E2); -1, -2: rho_1, rho_2 reach zero.
    """
    best = (_INF, -9, _INF)
    best = _leave(rho[0], travel[0], 1.0, -1, best, tie)
    best = _leave(rho[1], travel[1], 1.0, -2, best, tie)
    kind, i, j = site[0], site[1], site[2]
    if kind == E1E2:
        e, g = ints1[3] + 4 * i, ints2[3] + 4 * j
        v, w = X[ints1[e]], Y[ints2[g]]
        along, across = X[ints1[e + 1]] - v, Y[ints2[g + 1]] - w
        normal, by_across, by_along = np.empty(3), np.empty(3), np.empty(3)
        _cross(along, across, normal)
        square = _dot(normal, normal)
        _cross(across, normal, by_across)
        _cross(along, normal, by_along)
        for end in range(4):
            # A = r . (across x normal) / square for r = d + rho_2 w - rho_1 v, and B likewise
            by = by_across if end < 2 else by_along
            c0, c1, c2 = _dot(d, by) / square, -_dot(v, by) / square, _dot(w, by) / square
            if end == 1:
                c0, c1, c2 = -c0, 1.0 - c1, -c2
            elif end == 3:
                c0, c1, c2 = -c0, -c1, 1.0 - c2
            value, slope = c0 + c1 * rho[0] + c2 * rho[1], c1 * travel[0] + c2 * travel[1]
            best = _leave(value, slope, np.abs(c1) + np.abs(c2), end, best, tie)
        return best
    inward = np.empty(3)
    if kind == F1V2:
        A, ints, face, sign, apex, own, other = X, ints1, i, 1.0, Y[j], 0, 1
    else:
        A, ints, face, sign, apex, own, other = Y, ints2, j, -1.0, X[i], 1, 0
    normal = A[ints[0] + face]
    start, stop = ints[ints[6] + face], ints[ints[6] + face + 1]
    for entry in range(start, stop):
        edge = ints[ints[7] + entry]
        e = ints[3] + 4 * edge
        direction = A[ints[e + 1]] - A[ints[e]]
        if ints[e + 2] != face:
            direction = -direction
        _cross(normal, direction, inward)
        inward /= np.sqrt(_dot(direction, direction))
        c_own, c_other = -_dot(inward, A[ints[e]]), _dot(inward, apex)
        value = sign * _dot(inward, d) + c_own * rho[own] + c_other * rho[other]
        slope = c_own * travel[own] + c_other * travel[other]
        best = _leave(value, slope, np.abs(c_own) + np.abs(c_other), edge, best, tie)
    return best


@kernel
def _first_neighbour(B, ints, vertex, skip, start, target, sign, tie):
    """Follow the arc of directions from `start` to `target` through the normal cone of a vertex.

    Inside the cone sign * n.(x - vertex) <= 0 for all neighbours x. Return (state, edge): the first edge whose arc is
    crossed, -1 if none is; state 1 where a tie does not let us tell.
    """
    first, second, found = _INF, _INF, -1
    for entry in range(ints[ints[4] + vertex], ints[ints[4] + vertex + 1]):
        edge = ints[ints[5] + entry]
        if edge == skip:
            continue
        e = ints[3] + 4 * edge
        other = ints[e] if ints[e + 1] == vertex else ints[e + 1]
        spoke = B[other] - B[vertex]
        length = np.sqrt(_dot(spoke, spoke))
        before, after = sign * _dot(start, spoke) / length, sign * _dot(target, spoke) / length
        if before >= -tie:
            return 1, -1
        if after >= -tie:
            at = 1.0 if after <= tie else before / (before - after)  # 1: the arc ends on the cone's border
            if at < first:
                second, first, found = first, at, edge
            elif at < second:
                second = at
    if second - first <= tie or (found >= 0 and first >= 1.0 - tie):
        return 1, -1
    return 0, found


@kernel
def _next_site(X, ints1, Y, ints2, site, row, leaving, following, tie):
    """Fill `following` with the site beyond the switching point; return False on a tie."""
    kind, i, j = site[0], site[1], site[2]
    n = row[:3]
    if kind == E1E2:
        e, g = ints1[3] + 4 * i, ints2[3] + 4 * j
        if leaving < 2:  # the contact sits at an end of edge i: follow the arc of edge j
            vertex, away = ints1[e + leaving], ints1[e + 1 - leaving]
            spoke = X[vertex] - X[away]
            face = ints2[g + 2]
            if -_dot(Y[ints2[0] + face], spoke) < 0:
                face = ints2[g + 3]
            state, edge = _first_neighbour(X, ints1, vertex, i, n, -Y[ints2[0] + face], 1.0, tie)
            following[:] = (E1E2, edge, j) if edge >= 0 else (V1F2, vertex, face)
        else:
            vertex, away = ints2[g + leaving - 2], ints2[g + 3 - leaving]
            spoke = Y[vertex] - Y[away]
            face = ints1[e + 2]
            if _dot(X[ints1[0] + face], spoke) > 0:
                face = ints1[e + 3]
            state, edge = _first_neighbour(Y, ints2, vertex, j, n, X[ints1[0] + face], -1.0, tie)
            following[:] = (E1E2, i, edge) if edge >= 0 else (F1V2, face, vertex)
    elif kind == F1V2:
        e = ints1[3] + 4 * leaving
        face = ints1[e + 3] if ints1[e + 2] == i else ints1[e + 2]
        state, edge = _first_neighbour(Y, ints2, j, -1, n, X[ints1[0] + face], -1.0, tie)
        following[:] = (E1E2, leaving, edge) if edge >= 0 else (F1V2, face, j)
    else:
        g = ints2[3] + 4 * leaving
        face = ints2[g + 3] if ints2[g + 2] == j else ints2[g + 2]
        state, edge = _first_neighbour(X, ints1, i, -1, n, -Y[ints2[0] + face], 1.0, tie)
        following[:] = (E1E2, edge, leaving) if edge >= 0 else (V1F2, i, face)
    return state == 0


@kernel
def _is_support(X, n1, Y, n2, row, tie, size):
    """Tell whether a and b are the supports of both parts in direction n."""
    return (
        _support(X, n1, row[:3], 1.0)[0] <= row[3] + tie * size
        and _support(Y, n2, row[:3], -1.0)[0] <= row[4] + tie * size
    )


@kernel
def _walk_chain(X, ints1, Y, ints2, d, forward, tie, size, sites, rows, points):
    """Walk one chain from an axis: sites[0] at the scale pair points[0]. Return (segments, how it ended).

    Forward (+1) is along (b, -a), with the overlap region on the left; -1 is backward. Fills `sites`, `rows` and
    `points`, whose last row is a direction where the chain runs to infinity. Ends: -1, -2 where rho_1, rho_2 reaches
    zero, 0 at infinity; 0 segments where a tie does not let us tell.
    """
    travel = np.empty(2)
    for k in range(len(sites)):
        row, here = rows[k], points[k]
        if not site_row(X, ints1, Y, ints2, d, sites[k], row):
            return 0, 0
        steep = np.hypot(row[3], row[4])
        if steep <= tie * size or not _is_support(X, ints1[0], Y, ints2[0], row, tie, size):
            return 0, 0
        if k > 0:
            before = rows[k - 1]
            det = before[3] * row[4] - before[4] * row[3]
            if np.abs(det) > _CROSSING * np.hypot(before[3], before[4]) * steep:
                x = (before[5] * row[4] - before[4] * row[5]) / det
                y = (before[3] * row[5] - before[5] * row[3]) / det
                if np.abs(x - here[0]) + np.abs(y - here[1]) > _DRIFT * (np.abs(x) + np.abs(y)):
                    return 0, 0
                here[0], here[1] = x, y
        travel[0], travel[1] = forward * row[4] / steep, -forward * row[3] / steep
        scale = np.abs(here[0]) + np.abs(here[1])
        at, leaving, second = _exit(X, ints1, Y, ints2, d, sites[k], here, travel, tie)
        if at == _INF:
            points[k + 1] = travel
            return k + 1, 0
        if second - at <= tie * scale or at <= tie * scale:
            return 0, 0
        points[k + 1, 0] = here[0] + at * travel[0]
        points[k + 1, 1] = here[1] + at * travel[1]
        if leaving < 0:
            points[k + 1, -1 - leaving] = 0.0
            return k + 1, leaving
        if k + 1 == len(sites) or not _next_site(X, ints1, Y, ints2, sites[k], row, leaving, sites[k + 1], tie):
            return 0, 0
    return 0, 0


@kernel
def _start_on_axis(X, ints1, Y, ints2, axis, face, site, tie, size):
    """Fill the site of a chain that starts where one body is the point at its seed; return False on a tie.

    Axis 0: rho_1 = 0, the seed of body 1 lies on a face of part 2 and the vertex of part 1 extreme along its normal
    touches it; axis 1 likewise with the bodies exchanged.
    """
    if axis == 0:
        best, vertex, second = _support(X, ints1[0], Y[ints2[0] + face], -1.0)
        site[:] = (V1F2, vertex, face)
    else:
        best, vertex, second = _support(Y, ints2[0], X[ints1[0] + face], -1.0)
        site[:] = (F1V2, face, vertex)
    return best - second > tie * size


@kernel
def walk(reals1, ints1, reals2, ints2, pose, tie):
    """Walk the overlay of the two Gauss maps along the boundary of the pair's overlap region in the open quadrant.

    Chains start where the seed ray of either body enters or leaves the other part. Return (state, sites, rows,
    points, chains): chains (k, 4) = first segment, segments, direction (+1 walked with the overlap region on the
    left, -1 on the right), whether it runs to infinity; chain c has points from its first segment + c on, one more
    than segments. State UNDECIDED: a tie, or no seed ray hits (then the boundary is empty, a closed polygon, or runs
    from infinity to infinity).
    """
    d, Y = pose[9:], reals2
    X = rotated(reals1, pose)
    size = 0.0
    for k in range(ints1[0]):
        size = max(size, np.abs(X[k]).max())
    for k in range(ints2[0]):
        size = max(size, np.abs(Y[k]).max())
    capacity = 64 + 2 * (ints1[2] + ints2[2])
    sites, rows = np.empty((capacity, 3), np.int64), np.empty((capacity, 6))
    points, chains = np.empty((capacity + 4, 2)), np.empty((4, 4), np.int64)
    used, made = 0, 0
    state = UNDECIDED
    hit1, in1, face_in1, out1, face_out1 = _seed_ray(Y, ints2, -d, tie)  # rho_1 = 0: where s_1 lies in part 2
    hit2, in2, face_in2, out2, face_out2 = _seed_ray(X, ints1, d, tie)  # rho_2 = 0: where s_2 lies in part 1
    if hit1 != 2 and hit2 != 2 and (hit1 == 1 or hit2 == 1):
        state = WALKED
        low_joined = far1_joined = far2_joined = False  # ends on an axis that an earlier chain has reached
        for start in range(4):
            # where, on which axis, at which face, walked forward or backward, unless already reached from the other end
            if start == 0:
                wanted, axis, at, face, forward = hit1 == 1, 0, out1, face_out1, 1.0
            elif start == 1:
                wanted, axis, at, face, forward = hit2 == 1 and not low_joined, 1, out2, face_out2, -1.0
            elif start == 2:
                wanted, axis, at, face, forward = hit1 == 1 and in1 > 0 and not far1_joined, 0, in1, face_in1, -1.0
            else:
                wanted, axis, at, face, forward = hit2 == 1 and in2 > 0 and not far2_joined, 1, in2, face_in2, 1.0
            if not wanted:
                continue
            points[used + made, axis], points[used + made, 1 - axis] = 0.0, 1.0 / at
            if used == capacity or not _start_on_axis(X, ints1, Y, ints2, axis, face, sites[used], tie, size):
                state = UNDECIDED
                break
            count, end = _walk_chain(
                X, ints1, Y, ints2, d, forward, tie, size, sites[used:], rows[used:], points[used + made :]
            )
            if count == 0:
                state = UNDECIDED
                break
            chains[made, 0], chains[made, 1], chains[made, 2], chains[made, 3] = used, count, int(forward), end == 0
            low_joined = low_joined or (start == 0 and end == -2)
            far1_joined = far1_joined or (start == 0 and end == -1)
            far2_joined = far2_joined or (start > 0 and end == -2)
            used += count
            made += 1
    return state, sites[:used], rows[:used], points[: used + made], chains[:made]


# ------------------------------------------------------------------------------------------- a feature that is tracked


@kernel
def tracked_row(reals1, ints1, reals2, ints2, pose, site, sign):
    """Return the row of a site at a pose; parallel edges give nan.

    `sign` orients an edge pair's normal as +-(edge 1 x edge 2), so that it does not jump where the pair stops being a
    facet.
    """
    row = np.full(6, np.nan)
    X, d = rotated(reals1, pose), pose[9:]
    if site_row(X, ints1, reals2, ints2, d, site, row) and site[0] == E1E2:
        e, g = ints1[3] + 4 * site[1], ints2[3] + 4 * site[2]
        n = np.empty(3)
        _cross(X[ints1[e + 1]] - X[ints1[e]], reals2[ints2[g + 1]] - reals2[ints2[g]], n)
        if sign * _dot(n, row[:3]) < 0:
            row *= -1.0
    return row
