"""Compiled code of the judge's look at round faces: heights over surfaces of revolution, edges, and what is on a face.

A surface is ten numbers: a point of its axis, the axis, a and b of the line a r - b z = radius that it is swept by (r
away from the axis, z along it; a is nan of one that is swept by a circle), the ring of that circle, and the radius.
Points come with one surface for all of them, or with one each.
"""

import math

import numpy as np

from fcdm_opt.compiling import kernel, step
from fcdm_opt.geometry.judging import _cross, _dot, _minus, _plus

TIMES_ONTO = 8  # that points are brought onto two surfaces
ROUNDING = 1e-12  # of areas, and of a chord how far off surfaces a point counts as on them
SLIVER = 1e-9  # of the square of its longest side: the area of a triangle that is none
SMOOTH = 1e-9  # square of the angle at which a surface goes on in the next one
ROUND = 1e-6  # of a chord: by so much its ends differ in height and radius about an axis that it is round of
LEAST = 2.2250738585072014e-308


@step
def _about(s, p):
    """Return how far a point is along the axis, and where across it."""
    axis = s[3], s[4], s[5]
    local = p[0] - s[0], p[1] - s[1], p[2] - s[2]
    z = _dot(local, axis)
    return z, _plus(local, -z, axis)


@kernel
def _height(s, p):
    """Return how far a point is off a surface, and the direction there: from the nearest point of its profile."""
    z, across = _about(s, p)
    r = math.sqrt(_dot(across, across))
    one = 1.0 / r if r > 0.0 else 0.0
    x, y = s[6], -s[7]
    height = x * r + y * z - s[9]
    if math.isnan(x):
        x, y = r - s[8], z
        extent = math.sqrt(x * x + y * y)
        height = extent - s[9]
        safe = extent if extent > 0.0 else 1.0
        x, y = x / safe, y / safe
    x = x * one
    return height, (x * across[0] + y * s[3], x * across[1] + y * s[4], x * across[2] + y * s[5])


@kernel
def heights(surfaces, points):
    """Return how far points (n, 3) are off surfaces (1 or n, 10), and the directions there, (n, 3)."""
    off, directions, one = np.empty(len(points)), np.empty(points.shape), len(surfaces) == 1
    for i in range(len(points)):
        off[i], direction = _height(surfaces[0 if one else i], (points[i, 0], points[i, 1], points[i, 2]))
        directions[i, 0], directions[i, 1], directions[i, 2] = direction
    return off, directions


@kernel
def edge_point(one, two, start, end, share):
    """Return the point of the curve where two surfaces meet that is at a right angle off a share of a chord."""
    along = _minus(end, start)
    point, half = _plus(start, share, along), share - 0.5
    length = math.sqrt(_dot(along, along))
    middle = 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]), 0.5 * (start[2] + end[2])
    for turn in range(2):  # about an axis of which they are round: where they go on in each other no more is told
        s = one if turn == 0 else two
        z0, far0 = _about(s, start)
        _, far1 = _about(s, middle)
        z2, far2 = _about(s, end)
        r0, r1, r2 = math.sqrt(_dot(far0, far0)), math.sqrt(_dot(far1, far1)), math.sqrt(_dot(far2, far2))
        square = r0 * r0 - half * half * length * length
        flat = s[6] == 0.0 and s[7] == -1.0
        if max(abs(z0 - z2), abs(r0 - r2)) <= ROUND * length and square > 0.0 and r1 > ROUND * r0 and not flat:
            bowed = _plus(_plus(middle, half, along), math.sqrt(square) / r1 - 1.0, far1)
            off = max(abs(_height(one, bowed)[0]), abs(_height(two, bowed)[0]))
            if off < max(abs(_height(one, point)[0]), abs(_height(two, point)[0])):
                point = bowed
    safe = max(length, LEAST)
    along = along[0] / safe, along[1] / safe, along[2] / safe
    for _ in range(TIMES_ONTO):
        h1, d1 = _height(one, point)
        h2, d2 = _height(two, point)
        if max(abs(h1), abs(h2)) <= ROUNDING * length:
            break
        d1, d2 = _plus(d1, -_dot(d1, along), along), _plus(d2, -_dot(d2, along), along)
        a, b, c = _dot(d1, d1), _dot(d1, d2), _dot(d2, d2)
        whole = max(a + c, LEAST)
        det = a * c - b * b
        if det <= SMOOTH * whole * whole:  # then as of one surface
            u, v = (a * h1 + b * h2) / (whole * whole), (b * h1 + c * h2) / (whole * whole)
        else:
            u, v = (c * h1 - b * h2) / det, (a * h2 - b * h1) / det
        point = _plus(_plus(point, -u, d1), -v, d2)
    return point


@kernel
def points_of_edges(one, two, start, end, shares):
    """Return points of the curves where surfaces meet, each at a right angle off a share (n,) of its chord, (n, 3)."""
    points, same, same_two = np.empty(start.shape), len(one) == 1, len(two) == 1
    for i in range(len(start)):
        ends = (start[i, 0], start[i, 1], start[i, 2]), (end[i, 0], end[i, 1], end[i, 2])
        point = edge_point(one[0 if same else i], two[0 if same_two else i], ends[0], ends[1], shares[i])
        points[i, 0], points[i, 1], points[i, 2] = point
    return points


@kernel
def to_segments(points, segments):
    """Return how far points (n, 3) are from the nearest of segments (m, 2, 3), (n,); infinite where there are none."""
    found = np.full(len(points), math.inf)
    for i in range(len(points)):
        point, least = (points[i, 0], points[i, 1], points[i, 2]), math.inf
        for m in range(len(segments)):
            start = segments[m, 0, 0], segments[m, 0, 1], segments[m, 0, 2]
            along = _minus((segments[m, 1, 0], segments[m, 1, 1], segments[m, 1, 2]), start)
            local, square = _minus(point, start), _dot(along, along)
            share = min(max(_dot(local, along) / square, 0.0), 1.0) if square > 0.0 else 0.0
            off = _plus(local, -share, along)
            least = min(least, _dot(off, off))
        found[i] = math.sqrt(least)
    return found


@kernel
def is_over(foot, direction, triangles, room):
    """Tell whether a point of a surface has one of its triangles below or above it."""
    for t in range(len(triangles)):
        if not room[t] >= 0.0:
            continue
        near = True
        for x in range(3):
            a, b, c = triangles[t, 0, x], triangles[t, 1, x], triangles[t, 2, x]
            near = near and min(a, b, c) - room[t] <= foot[x] <= max(a, b, c) + room[t]
        if not near:
            continue
        one = _minus((triangles[t, 0, 0], triangles[t, 0, 1], triangles[t, 0, 2]), foot)
        two = _minus((triangles[t, 1, 0], triangles[t, 1, 1], triangles[t, 1, 2]), foot)
        three = _minus((triangles[t, 2, 0], triangles[t, 2, 1], triangles[t, 2, 2]), foot)
        least = ROUNDING * max(_dot(one, one), _dot(two, two), _dot(three, three))
        low = 0.0  # all turn one sense about a point that they are below: those of the far side of a bore the other
        for side in (
            _dot(_cross(one, two), direction),
            _dot(_cross(two, three), direction),
            _dot(_cross(three, one), direction),
        ):
            if abs(side) > least:
                low = min(low, side)
        if low == 0.0:
            return True
    return False


@kernel
def on_face(surface, side, feet, triangles, over, others, start, end, room, slack):
    """Tell which points of a surface (n, 3) are on a face: on its triangles, but where an edge leaves its chord.

    Of the face: its surface, (1, 10), its side, its triangles, (t, 3, 3), the surfaces `others`, (e, 10), that it has
    its bent edges with, the chords of these from `start` to `end`, (e, 3), and how far they leave them at most, `room`,
    (e,). `over` tells whether the points are known to be over the triangles; nearer than `slack` to an edge a point is
    on it.
    """
    found, wide = np.empty(len(feet), np.bool_), np.empty(len(triangles))
    for t in range(len(triangles)):  # a surface leaves its triangle by less than this; of slivers their neighbours tell
        one = triangles[t, 0, 0], triangles[t, 0, 1], triangles[t, 0, 2]
        two = triangles[t, 1, 0], triangles[t, 1, 1], triangles[t, 1, 2]
        three = triangles[t, 2, 0], triangles[t, 2, 1], triangles[t, 2, 2]
        extent = 0.0
        for x in range(3):
            extent = max(extent, max(one[x], two[x], three[x]) - min(one[x], two[x], three[x]))
        first, second, third = _minus(two, one), _minus(three, two), _minus(one, three)
        longest, normal = max(_dot(first, first), _dot(second, second), _dot(third, third)), _cross(first, second)
        wide[t] = 0.25 * extent if math.sqrt(_dot(normal, normal)) > SLIVER * longest else -1.0
    for i in range(len(feet)):
        foot = feet[i, 0], feet[i, 1], feet[i, 2]
        direction = _height(surface[0], foot)[1]
        normal = side * direction[0], side * direction[1], side * direction[2]
        found[i] = over or is_over(foot, normal, triangles, wide)
        within, beyond = False, False
        for e in range(len(start)):
            near, margin = True, room[e] + slack
            for x in range(3):
                low, high = min(start[e, x], end[e, x]), max(start[e, x], end[e, x])
                near = near and low - margin <= foot[x] <= high + margin
            if not near:
                continue
            ends = (start[e, 0], start[e, 1], start[e, 2]), (end[e, 0], end[e, 1], end[e, 2])
            along, local = _minus(ends[1], ends[0]), _minus(foot, ends[0])
            square = _dot(along, along)
            share = _dot(local, along) / square
            if not 0.0 <= share <= 1.0:
                continue
            out, length = _cross(along, normal), math.sqrt(square)
            curve = _minus(edge_point(surface[0], others[e], ends[0], ends[1], share), ends[0])
            off = _dot(_plus(local, -share, along), out) / length
            bow = _dot(_plus(curve, -share, along), out) / length
            if -slack <= off <= bow + slack:
                within = True  # on the chord itself triangles tell either
            elif bow + slack < off <= slack:
                beyond = True
        found[i] = (found[i] or within) and not beyond
    return found
