"""Compiled: which triangle of a table a size pair is in, and the quadratic interpolation there.

The box is cut into `side` by `side` equal buckets; bucket b lists the triangles that meet it, members[starts[b]] to
members[starts[b + 1]], in increasing order, so that the first that holds a point is the lowest. A *frame* (8,) of a
triangle holds its first corner, the gradients of the second and third barycentric coordinate, and by how much a
coordinate may be below zero for a point that is in the triangle but for rounding, and on a seam.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt.compiling import kernel, step

LOW_1, LOW_2, HIGH_1, HIGH_2, RIM = range(5)  # places in `bounds`: the box, and how far outside it is still inside
CHUNK = 512  # pairs: what is known of them between two loops stays in the innermost cache


@step
def _clear_of(x, y, u, v, w, z, slack):
    """Tell whether a rectangle [x, u] x [y, v] lies beyond an edge, given as its inner normal and offset, w."""
    # the corner of the rectangle that is furthest inside
    inside = w[0] * (u if w[0] > 0.0 else x) + w[1] * (v if w[1] > 0.0 else y) - z
    return inside < -slack * np.sqrt(w[0] * w[0] + w[1] * w[1])


@step
def _meets(corners, t, x, y, u, v, slack):
    """Tell whether a triangle may meet a rectangle; where it says no, they are apart by `slack`."""
    ax, ay, bx, by, cx, cy = (
        corners[t, 0, 0],
        corners[t, 0, 1],
        corners[t, 1, 0],
        corners[t, 1, 1],
        corners[t, 2, 0],
        corners[t, 2, 1],
    )
    turn = 1.0 if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > 0.0 else -1.0
    # relative to the first corner, so that no digits are lost
    x, y, u, v = x - ax, y - ay, u - ax, v - ay
    for px, py, qx, qy in (
        (0.0, 0.0, bx - ax, by - ay),
        (bx - ax, by - ay, cx - ax, cy - ay),
        (cx - ax, cy - ay, 0.0, 0.0),
    ):
        normal = (turn * (py - qy), turn * (qx - px))
        if _clear_of(x, y, u, v, normal, normal[0] * px + normal[1] * py, slack):
            return False
    return True


@kernel
def buckets(corners, bounds, side):
    """Return (starts, members) of the buckets: which triangles meet which."""
    low_1, low_2 = bounds[LOW_1], bounds[LOW_2]
    width_1, width_2 = (bounds[HIGH_1] - low_1) / side, (bounds[HIGH_2] - low_2) / side
    slack = 2.0 * bounds[RIM]
    counts = np.zeros(side * side + 1, np.int64)
    members = np.empty(0, np.int64)
    for filling in range(2):
        for t in range(len(corners)):
            x, u = corners[t, :, 0].min() - slack, corners[t, :, 0].max() + slack
            y, v = corners[t, :, 1].min() - slack, corners[t, :, 1].max() + slack
            first_1 = max(0, int(np.floor((x - low_1) / width_1)))
            first_2 = max(0, int(np.floor((y - low_2) / width_2)))
            last_1 = min(side - 1, int(np.floor((u - low_1) / width_1)))
            last_2 = min(side - 1, int(np.floor((v - low_2) / width_2)))
            for i in range(first_1, last_1 + 1):
                for j in range(first_2, last_2 + 1):
                    left, lower = low_1 + i * width_1, low_2 + j * width_2
                    if _meets(corners, t, left, lower, left + width_1, lower + width_2, slack):
                        b = i * side + j
                        if filling:
                            members[counts[b]] = t
                            counts[b] += 1
                        else:
                            counts[b + 1] += 1
        if not filling:
            counts = np.cumsum(counts)
            members = np.empty(counts[-1], np.int64)
    starts = np.zeros_like(counts)
    starts[1:] = counts[:-1]  # filling has moved every start to the next
    return starts, members


@step
def _search(x, y, bucket, slack, starts, members, frames):
    """Return the first triangle of a bucket that holds a point, -1 for none, and two barycentric coordinates."""
    for place in range(starts[bucket], starts[bucket + np.uintp(1)]):
        m = members[np.uintp(place)]
        frame = np.uintp(m)
        dx, dy = x - frames[frame, 0], y - frames[frame, 1]
        s = frames[frame, 2] * dx + frames[frame, 3] * dy
        t = frames[frame, 4] * dx + frames[frame, 5] * dy
        if min(s, t, 1.0 - s - t) >= -frames[frame, slack]:
            return m, s, t
    return -1, np.nan, np.nan


@kernel
def locate(rho_1, rho_2, bounds, side, starts, members, frames, triangles, weights):
    """Fill in which triangles size pairs are in, -1 for none, and their barycentric coordinates there."""
    low_1, low_2, high_1, high_2, rim = bounds[LOW_1], bounds[LOW_2], bounds[HIGH_1], bounds[HIGH_2], bounds[RIM]
    scale_1, scale_2 = side / (high_1 - low_1), side / (high_2 - low_2)
    for k in range(len(rho_1)):
        x, y = rho_1[k], rho_2[k]
        m, s, t = -1, np.nan, np.nan
        if low_1 - rim <= x <= high_1 + rim and low_2 - rim <= y <= high_2 + rim:  # nan is not
            x, y = min(max(x, low_1), high_1), min(max(y, low_2), high_2)
            i, j = min(int((x - low_1) * scale_1), side - 1), min(int((y - low_2) * scale_2), side - 1)
            m, s, t = _search(x, y, np.uintp(i * side + j), 6, starts, members, frames)
            if m < 0:
                m, s, t = _search(x, y, np.uintp(i * side + j), 7, starts, members, frames)
        triangles[k], weights[k, 0], weights[k, 1] = m, s, t


@kernel
def _interpolate(triangles, weights, values, errors, regions, amount, parameters, error, region):
    """Fill in what a table says at points of its triangles."""
    for k in range(len(triangles)):
        if triangles[k] < 0:
            amount[k] = error[k, 0] = error[k, 1] = np.nan
            region[k] = -1
            for c in range(parameters.shape[1]):
                parameters[k, c] = np.nan
            continue
        m, s, t = np.uintp(triangles[k]), weights[k, 0], weights[k, 1]
        r = 1.0 - s - t
        # the six functions that are 1 at one node and 0 at the others
        n_1, n_2, n_3 = r * (2.0 * r - 1.0), s * (2.0 * s - 1.0), t * (2.0 * t - 1.0)
        n_4, n_5, n_6 = 4.0 * r * s, 4.0 * s * t, 4.0 * t * r
        for c in range(values.shape[2]):
            value = (
                n_1 * values[m, 0, c]
                + n_2 * values[m, 1, c]
                + n_3 * values[m, 2, c]
                + n_4 * values[m, 3, c]
                + n_5 * values[m, 4, c]
                + n_6 * values[m, 5, c]
            )
            if c:
                parameters[k, c - 1] = value
            else:
                amount[k] = value
        error[k, 0], error[k, 1] = errors[m, 0], errors[m, 1]
        region[k] = regions[m]


@kernel
def look_up(
    rho_1, rho_2, bounds, side, starts, members, frames, values, errors, regions, amount, parameters, error, region
):
    """Fill in what a table says at size pairs; nan and region -1 where a pair is in no triangle.

    All pairs of a chunk are located before any is interpolated: the processor then looks ahead over several of them.
    """
    triangles, weights = np.empty(CHUNK, np.int64), np.empty((CHUNK, 2))
    for begin in range(0, len(rho_1), CHUNK):
        end = min(begin + CHUNK, len(rho_1))
        some, places = triangles[: end - begin], weights[: end - begin]
        locate(rho_1[begin:end], rho_2[begin:end], bounds, side, starts, members, frames, some, places)
        _interpolate(
            some,
            places,
            values,
            errors,
            regions,
            amount[begin:end],
            parameters[begin:end],
            error[begin:end],
            region[begin:end],
        )
