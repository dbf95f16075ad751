"""Compiled code of the judge's look at round faces: heights over surfaces of revolution, edges, and what is on a face.

A surface is ten numbers: a point of its axis, the axis, a and b of the line a r - b z = radius that it is swept by (r
away from the axis, z along it; a is nan of one that is swept by a circle), the ring of that circle, and the radius.
Points come with one surface for all of them, or with one each.

A body is a tuple of arrays: its surfaces, (p, 10), their sides, 1 where the material is below, (p,), and which are
round, (p,); triangles, (t, 3, 3), and the surfaces beyond their sides, (t, 3); the triangles of each surface, (t,),
where these begin, (p + 1,), and how far the surface may be off each, negative for slivers, (t,); chords between
surfaces, (m, 2, 3); bent edges of each surface: the surface beyond, (b,), the ends of their chords, (b, 2, 3), how far
they leave these at most, (b,), and where they begin, (p + 1,); and how far faces leave their facets, (1,).
"""

import math

import numpy as np

from fcdm_opt.compiling import kernel, step
from fcdm_opt.geometry.vectors import _cross, _dot, _minus, _plus

TIMES_ONTO = 8  # that points are brought onto two surfaces
ROUNDING = 1e-12  # of areas, and of a chord how far off surfaces a point counts as on them
SLIVER = 1e-9  # of the square of its longest side: the area of a triangle that is none
SMOOTH = 1e-9  # square of the angle at which a surface goes on in the next one
ROUND = 1e-6  # of a chord: by so much its ends differ in height and radius about an axis that it is round of
LEAST = 2.2250738585072014e-308
GRID, MANY = 6, 48  # points along a side of a triangle, half as many of many triangles
FINER, TIMES = 0.35, 24  # of a grid about the nearest points, and how often
AROUND = -1.0, -0.5, 0.0, 0.5, 1.0  # of its width: the next, which is less wide, leaves none between
FEWEST, FEWEST_OF_DEEPEST = 6, 12  # times at least, of faces that are not and that are the deepest known
NEARLY = 1e-3  # of the band: by so much less deep points may yet be the deepest
SLACK = 1e-9  # of the band: nearer to a rim a point is on it
KEPT, LATE, OF_EACH = 16, 4, 2  # points about which it is made finer, of each two surfaces, and of each triangle


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


@step
def _vector(points, i):
    return points[i, 0], points[i, 1], points[i, 2]


@kernel
def off_segments(p, segments):
    """Return how far a point is from the nearest of segments (m, 2, 3); infinite where there are none."""
    least = math.inf
    for m in range(len(segments)):
        start = _vector(segments[m], 0)
        along, local = _minus(_vector(segments[m], 1), start), _minus(p, start)
        square = _dot(along, along)
        share = min(max(_dot(local, along) / square, 0.0), 1.0) if square > 0.0 else 0.0
        off = _plus(local, -share, along)
        least = min(least, _dot(off, off))
    return math.sqrt(least)


@kernel
def room_of(triangles):
    """Return more than surfaces leave their triangles, (n, 3, 3); negative of slivers: their neighbours tell."""
    found = np.empty(len(triangles))
    for t in range(len(triangles)):
        one, two, three = _vector(triangles[t], 0), _vector(triangles[t], 1), _vector(triangles[t], 2)
        extent = 0.0
        for x in range(3):
            extent = max(extent, max(one[x], two[x], three[x]) - min(one[x], two[x], three[x]))
        first, second, third = _minus(two, one), _minus(three, two), _minus(one, three)
        longest, normal = max(_dot(first, first), _dot(second, second), _dot(third, third)), _cross(first, second)
        found[t] = 0.25 * extent if math.sqrt(_dot(normal, normal)) > SLIVER * longest else -1.0
    return found


@kernel
def _is_over(body, k, foot, direction):
    """Tell whether a point of a surface has one of its triangles below or above it."""
    triangles, order, begins, room = body[3], body[5], body[6], body[7]
    for place in range(begins[k], begins[k + 1]):
        t = order[place]
        near = room[t] >= 0.0
        for x in range(3):
            a, b, c = triangles[t, 0, x], triangles[t, 1, x], triangles[t, 2, x]
            near = near and min(a, b, c) - room[t] <= foot[x] <= max(a, b, c) + room[t]
        if not near:
            continue
        one, two, three = _vector(triangles[t], 0), _vector(triangles[t], 1), _vector(triangles[t], 2)
        one, two, three = _minus(one, foot), _minus(two, foot), _minus(three, foot)
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
def is_on_face(body, k, foot, over, slack):
    """Tell whether a point of a surface is on the face: on its triangles, but where an edge leaves its chord.

    `over` tells whether it is known to be over the triangles; nearer than `slack` to an edge a point is on it.
    """
    surfaces, others, chords, room, begins = body[0], body[9], body[10], body[11], body[12]
    normal = _height(surfaces[k], foot)[1]
    normal = body[1][k] * normal[0], body[1][k] * normal[1], body[1][k] * normal[2]
    within, beyond = over or _is_over(body, k, foot, normal), False
    for e in range(begins[k], begins[k + 1]):
        start, end, near, margin = _vector(chords[e], 0), _vector(chords[e], 1), True, room[e] + slack
        for x in range(3):
            near = near and min(start[x], end[x]) - margin <= foot[x] <= max(start[x], end[x]) + margin
        if not near:
            continue
        along, local = _minus(end, start), _minus(foot, start)
        square = _dot(along, along)
        share = _dot(local, along) / square
        if not 0.0 <= share <= 1.0:
            continue
        out, length = _cross(along, normal), math.sqrt(square)
        curve = _minus(edge_point(surfaces[k], surfaces[others[e]], start, end, share), start)
        off = _dot(_plus(local, -share, along), out) / length
        bow = _dot(_plus(curve, -share, along), out) / length
        if -slack <= off <= bow + slack:
            within = True  # on the chord itself triangles tell either
        elif bow + slack < off <= slack:
            beyond = True
    return within and not beyond


@kernel
def _point(body, k, t, shares):
    """Return the point of a face by a triangle of it and shares of its corners: of a side it is on the edge there."""
    surfaces, round_ones, neighbours = body[0], body[2], body[4]
    corners = _vector(body[3][t], 0), _vector(body[3][t], 1), _vector(body[3][t], 2)
    p, on_edge, edge = (0.0, 0.0, 0.0), False, (0.0, 0.0, 0.0)
    for s in range(3):
        p = _plus(p, shares[s], corners[s])
    for s in range(3):
        u, v, other = shares[s], shares[(s + 1) % 3], neighbours[t, s]
        if u + v > 0.0 and other != k and (round_ones[k] or round_ones[other]):
            start, end, along = corners[s], corners[(s + 1) % 3], v / (u + v)
            curve = edge_point(surfaces[k], surfaces[other], start, end, along)
            p = _plus(p, u + v, _minus(curve, _plus(start, along, _minus(end, start))))
            if shares[(s + 2) % 3] == 0.0:
                on_edge, edge = True, curve
    if on_edge:
        return edge
    for _ in range(3 if round_ones[k] else 0):
        height, direction = _height(surfaces[k], p)
        p = _plus(p, -height, direction)
    return p


@kernel
def _is_nearer(body, k, p, depth, slack):
    """Tell whether a point is less deep behind another face or an edge than behind this one, or before a face."""
    surfaces, sides, bow = body[0], body[1], body[13][0]
    for m in range(len(surfaces)):
        if m != k:
            height, direction = _height(surfaces[m], p)
            off = sides[m] * height
            if slack - depth < off <= depth and is_on_face(body, m, _plus(p, -height, direction), False, slack):
                return True
    # where faces end at a concave edge
    return depth > 2.0 * bow + slack and off_segments(p, body[8]) < depth - bow - slack


@kernel
def _is_closed(own, other, closed, room, p, foot):
    """Tell whether a point of one body is on a face that does not count, and its foot on the one it stands on there."""
    for c in range(len(closed)):
        i, j = closed[c, 0], closed[c, 1]
        if abs(_height(own[0][i], p)[0]) <= room and abs(_height(other[0][j], foot)[0]) <= room:
            on = is_on_face(own, i, p, False, room) or off_segments(p, own[8]) <= room
            if on and (is_on_face(other, j, foot, False, room) or off_segments(foot, other[8]) <= room):
                return True
    return False


@kernel
def _chosen(depth, looked_at, which, most):
    """Return the rows that are deepest of those looked at, few of each triangle, and how many there are."""
    # what is largest on a grid may not be it between
    rows, count = np.empty(most, np.int64), 0
    while count < most:
        best = -1
        for i in range(len(depth)):
            if looked_at[i] and (best < 0 or depth[i] > depth[best]):
                alike = 0
                for c in range(count):
                    alike += which[rows[c]] == which[i]
                if alike < OF_EACH:
                    best = i
                else:
                    looked_at[i] = False
        if best < 0:
            break
        rows[count], looked_at[best] = best, False
        count += 1
    return rows, count


@kernel
def deepest_of_two(own, j, triangles, other, k, band, known, closed, room):
    """Return how deep points of a face lie behind another; closely only where it is deeper than what is known.

    Of plane faces without points at the edge of a contact that does not count; minus infinity without others.

    `own`, `other`: the bodies; `j`, `k`: the faces of these. `triangles`: those of the face looked at. `closed` (c, 2):
    faces of both that do not count together, within `room`.
    """
    grid = GRID if len(triangles) <= MANY else GRID // 2
    each, count = grid * (grid + 1) // 2, 0
    which, shares = np.empty(each * len(triangles), np.int64), np.empty((each * len(triangles), 3))
    longest = 0.0
    for t in triangles:
        for s in range(3):
            side = _minus(_vector(own[3][t], s), _vector(own[3][t], (s + 1) % 3))
            longest = max(longest, math.sqrt(_dot(side, side)))
        for u in range(grid):
            for v in range(grid - u):
                which[count], shares[count, 1], shares[count, 2] = t, u / (grid - 1), v / (grid - 1)
                shares[count, 0] = (grid - 1 - u - v) / (grid - 1)
                count += 1
    side, deepest, width, slack = other[1][k], -math.inf, 1.0, SLACK * band
    counted = len(closed) == 0 or (own[2][j] and other[2][k])
    for turn in range(TIMES):
        depth, inside, between = np.empty(len(which)), np.zeros(len(which), np.bool_), np.zeros(len(which), np.bool_)
        points, feet = np.empty((len(which), 3)), np.empty((len(which), 3))
        apart = longest * width * (0.5 if turn else 1.0 / (grid - 1))
        some_inside, some_between, extent = False, False, 0.0
        for i in range(len(which)):
            p = _point(own, j, which[i], shares[i])
            height, direction = _height(other[0][k], p)
            points[i, 0], points[i, 1], points[i, 2] = p
            feet[i, 0], feet[i, 1], feet[i, 2] = _plus(p, -height, direction)
            depth[i], inside[i] = -side * height, abs(height) <= band
            between[i] = band < side * height <= band + apart
            some_inside, some_between = some_inside or inside[i], some_between or between[i]
            extent = max(extent, abs(p[0]), abs(p[1]), abs(p[2]))
        width *= FINER
        most, before = LATE if turn >= FEWEST else KEPT, deepest
        if some_inside or not some_between:  # else, of wide triangles, points that come as near lie between those taken
            some_inside, outermost = False, True
            for i in range(len(which)):
                if not inside[i]:
                    continue
                p, foot = _vector(points, i), _vector(feet, i)
                # sides of triangles from a bent edge may cut across its bow
                on = is_on_face(other, k, foot, False, slack) and is_on_face(own, j, p, True, slack)
                on = on and not _is_nearer(other, k, p, depth[i], slack)
                if on and not counted and known < depth[i] < -room:
                    on = not _is_closed(own, other, closed, room, p, foot)
                inside[i] = on
                if on:
                    some_inside, deepest = True, max(deepest, depth[i])
            if not some_inside:
                break
            if not counted and turn == FEWEST - 1 and deepest >= -room:  # when points beside these are not as deep
                for i in range(len(which)):
                    if inside[i] and depth[i] >= -room:
                        at = _vector(points, i), _vector(feet, i)
                        outermost = outermost and _is_closed(own, other, closed, room, at[0], at[1])
                counted = deepest > room or not outermost
            fewest = FEWEST if deepest < known - NEARLY * band else FEWEST_OF_DEEPEST
            if turn >= fewest and deepest - before <= 1e-12 * extent:
                break
            between = inside
        else:
            most = KEPT
        rows, count = _chosen(depth, between, which, most)
        finer, moved = np.empty(25 * count, np.int64), np.empty((25 * count, 3))
        for c in range(count):
            for m in range(25):
                u, v = width * AROUND[m // 5], width * AROUND[m % 5]
                own_shares, place = shares[rows[c]], 25 * c + m
                one = min(max(own_shares[0] - u - v, 0.0), 1.0)
                two, three = min(max(own_shares[1] + u, 0.0), 1.0), min(max(own_shares[2] + v, 0.0), 1.0)
                whole = one + two + three
                finer[place] = which[rows[c]]
                moved[place, 0], moved[place, 1], moved[place, 2] = one / whole, two / whole, three / whole
        which, shares = finer, moved
    return deepest if counted or deepest < -room else -math.inf
