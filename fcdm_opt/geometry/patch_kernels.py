"""Compiled code of true faces: gaps to surfaces of revolution, and where features of two bodies come nearest on them.

A patch is eleven numbers: a point of its axis, the axis, a and b of the line a r - b z = radius that it is swept by (r
away from the axis, z along it; a is nan of one that is swept by a circle), the ring of that circle, the radius, and 1
where the material is below, -1 where it is above, as of a bore.

A body is a tuple of arrays: its patches, (p, 11); triangles sorted by patch, (t, 3, 3), and where those of each begin,
(p + 1,); its convex edges, (m, 2, 3), and their patches, (m, 2); edges of any kind, (e, 2, 3); chords of bent edges of
plane patches, (c, 2, 3), the plane patch and the patch beyond, (c, 2), from their middles to the edge, (c, 3), and
whether triangles end at the chord, (c,). And its lengths: how near points count as one, half of how far triangles leave
faces or round edges their chords, and how far faces leave their facets.
"""

import math

import numpy as np

from fcdm_opt.compiling import kernel, step
from fcdm_opt.geometry.vectors import _cross, _dot, _minus, _plus
from fcdm_opt.tolerances import DEFAULT

ONTO = 8  # steps of Newton's method onto one or two surfaces
ONTO_ROUNDING = 1e-14  # of the size of coordinates
STEPS = 60  # of Newton's method to where a gap is least
NEARING = 6  # steps to the nearest point of an edge
FEWER = 12  # times that a step is halved at most
LEAST_BEND = 1e-9  # of a length over that of the piece looked at: a direction that is bent by less counts as straight
STRAYED = 2.0  # sizes of the piece looked at, from where a search began: where the gap only falls, as along an axis
ROUNDED = 1e-15  # of a length over that of the piece looked at: by how much a gap is off by rounding
LEVEL = 1e-13  # slope of the gap along a face under which it is least
BOWED = 1.5  # times what the middle of a chord leaves its edge, any point of it does at most
RIM_SLACK = 1e-7  # of a triangle's sides: how far beside it a point may be that it stands for
TANGENT = 1e-9  # square of the angle at which two surfaces that share an edge are smooth there
TIE, PARALLEL, BETWEEN = DEFAULT.tie, DEFAULT.nominal, DEFAULT.sharp
TINY = 2.2250738585072014e-308


@step
def _vector(points, i):
    return points[i, 0], points[i, 1], points[i, 2]


@step
def _times(s, v):
    return s * v[0], s * v[1], s * v[2]


@step
def _length(v):
    return math.sqrt(_dot(v, v))


@step
def _about(s, p):
    """Return how far a point is along the axis, where across it, and how far across."""
    axis = s[3], s[4], s[5]
    local = p[0] - s[0], p[1] - s[1], p[2] - s[2]
    along = _dot(local, axis)
    across = _plus(local, -along, axis)
    return along, across, _length(across)


@kernel
def gap_at(s, p):
    """Return how far a point is off a patch, outside positive, and the outward normal there."""
    along, across, far = _about(s, p)
    out = _times(1.0 / max(far, TINY), across)
    a, b, off = s[6], -s[7], 0.0
    if math.isnan(a):
        tube = far - s[8]
        long = math.sqrt(tube * tube + along * along)
        a, b, off = tube / max(long, TINY), along / max(long, TINY), long - s[9]
    else:
        off = a * far + b * along - s[9]
    return s[10] * off, _times(s[10], _plus(_times(a, out), b, (s[3], s[4], s[5])))


@kernel
def bend_at(s, p, u, v):
    """Return the second derivative of the gap along two directions."""
    along, across, far = _about(s, p)
    axis, out = (s[3], s[4], s[5]), _times(1.0 / max(far, TINY), across)
    around, rate, flat = _cross(axis, out), 1.0 / max(far, TINY), 0.0
    if math.isnan(s[6]):
        tube = far - s[8]
        long = max(math.sqrt(tube * tube + along * along), TINY)
        turned = _cross(_plus(_times(tube / long, out), along / long, axis), around)
        flat = _dot(turned, u) * _dot(turned, v) / long
        rate *= tube / long
    else:
        rate *= s[6]
    return s[10] * (flat + rate * _dot(around, u) * _dot(around, v))


@step
def _weights(n, m, g, h):
    """Return x and y with which x n + y m has products g and h with n and m, the least; as if of one where smooth."""
    a, b, c = _dot(n, n), _dot(n, m), _dot(m, m)
    whole, det = a + c, a * c - b * b
    if det <= TANGENT * whole * whole:
        return (a * g + b * h) / (whole * whole), (b * g + c * h) / (whole * whole)
    return (c * g - b * h) / det, (a * h - b * g) / det


@kernel
def onto_point(one, two, single, p):
    """Return a point moved the nearest way onto one or two patches."""
    for _ in range(ONTO):
        g, n = gap_at(one, p)
        h, x, y = 0.0, g, 0.0
        if not single:
            h, m = gap_at(two, p)
            x, y = _weights(n, m, g, h)
            p = _plus(p, -y, m)
        p = _plus(p, -x, n)
        if max(abs(g), abs(h)) < ONTO_ROUNDING * max(abs(p[0]), abs(p[1]), abs(p[2])):
            break
    return p


@kernel
def onto_each(points, patches, which):
    """Return points (n, 3) moved the nearest way onto one or two patches each, by their numbers, (n, 1) or (n, 2)."""
    found = np.empty(points.shape)
    for i in range(len(points)):
        last = which.shape[1] - 1
        p = onto_point(patches[which[i, 0]], patches[which[i, last]], last == 0, _vector(points, i))
        found[i, 0], found[i, 1], found[i, 2] = p
    return found


@kernel
def gaps_of_each(points, patches, which):
    """Return how far points (n, 3) are off some patches each, by numbers (n, m), and the normals, (n, m, 3).

    Zeros where the number is -1.
    """
    gaps, normals = np.zeros(which.shape), np.zeros((*which.shape, 3))
    for i in range(len(points)):
        for k in range(which.shape[1]):
            if which[i, k] >= 0:
                gaps[i, k], normal = gap_at(patches[which[i, k]], _vector(points, i))
                normals[i, k, 0], normals[i, k, 1], normals[i, k, 2] = normal
    return gaps, normals


@step
def _are_parallel(one, two):
    return _length(_cross((one[3], one[4], one[5]), (two[3], two[4], two[5]))) <= PARALLEL


@kernel
def _turned_to(p, one, next_to, single, two):
    """Return a point of a cylinder, its rim or a sphere turned to where a parallel one, or another sphere, is nearest.

    Others stay, and those of concentric ones.
    """
    if math.isnan(one[6]) != math.isnan(two[6]):
        return p
    centre, away = (one[0], one[1], one[2]), (one[0] - two[0], one[1] - two[1], one[2] - two[2])
    if math.isnan(one[6]):
        suited = single and one[8] == 0.0 and two[8] == 0.0
    else:
        axis, other = (one[3], one[4], one[5]), (two[3], two[4], two[5])
        centre = _plus(centre, _dot(_minus(p, centre), axis), axis)
        away = _plus(away, -_dot(away, other), other)
        suited = one[7] == 0.0 and two[7] == 0.0 and _are_parallel(one, two)
        suited = suited and (single or (next_to[6] == 0.0 and _are_parallel(one, next_to)))
    far = _length(away)
    return _plus(centre, -one[9] * two[10] / far, away) if suited and far > TIE * one[9] else p


@kernel
def _lowest(one, next_to, single, two, start, extent):
    """Return the point of a patch, or of the curve between two, where the gap to another is least, from some start."""
    p = onto_point(one, next_to, single, start)
    p = _turned_to(p, one, next_to, single, two)
    if not single:
        p = _turned_to(p, next_to, one, single, two)
    gap, pulled = gap_at(two, p)
    begun, trial = p, p
    for _ in range(STEPS):
        n, m = gap_at(one, p)[1], gap_at(next_to, p)[1]
        x, y = _dot(n, pulled), 0.0
        side = _cross(n, m)
        if single or _length(side) <= TINY:  # any direction along the face
            side = (0.0, n[2], -n[1]) if abs(n[0]) <= 0.6 else (-n[2], 0.0, n[0])
        u = _times(1.0 / _length(side), side)
        v = _cross(n, u)
        if not single:
            x, y = _weights(n, m, x, _dot(m, pulled))
        a, b, c = bend_at(two, p, u, u), 0.0, 0.0
        a -= x * bend_at(one, p, u, u)
        if single:
            b = bend_at(two, p, u, v) - x * bend_at(one, p, u, v)
            c = bend_at(two, p, v, v) - x * bend_at(one, p, v, v)
            angle = 0.5 * math.atan2(2.0 * b, a - c)  # to the directions in which it bends most and least
            cos, sin = math.cos(angle), math.sin(angle)
            u, v = _plus(_times(cos, u), sin, v), _plus(_times(cos, v), -sin, u)
            a, c, b = a * cos * cos + c * sin * sin, a * sin * sin + c * cos * cos, 2.0 * b * sin * cos
            a, c = a + b, c - b
        else:
            a -= y * bend_at(next_to, p, u, u)
            v = (0.0, 0.0, 0.0)
        g, h = _dot(u, pulled), _dot(v, pulled)
        if max(abs(g), abs(h)) <= LEVEL or _length(_minus(p, begun)) > STRAYED * extent:
            break
        s, t = g / max(abs(a), LEAST_BEND / extent), h / max(abs(c), LEAST_BEND / extent)
        fewer = min(1.0, 0.5 * extent / max(abs(s), abs(t), TINY))
        move = _plus(_times(-fewer * s, u), -fewer * t, v)
        last = fewer * (g * s + h * t) <= ROUNDED * extent  # after it gaps are the same but for rounding
        less, share = False, 1.0
        for _ in range(FEWER):
            trial = onto_point(one, next_to, single, _plus(p, share, move))
            its, normal = gap_at(two, trial)
            less = its < gap
            if less or last:
                p, gap, pulled = trial, its, normal
                break
            share *= 0.5
        if last or not less:
            break
    return p


@kernel
def lowest(points, on, against, extents, patches, others):
    """Return points of a patch, or of the curve between two, where the gap to another is least, (n, 3).

    From a start, by Newton's method, with steps that are halved until the gap is no larger; each point moves by itself.

    `points` (n, 3). `on` (n, 2): the numbers of its patches among `patches` (p, 11); the second may be -1, and both of
    corners, which stay. `against` (n,): that of the other among `others`. `extents` (n,): of the feature: so far, times
    a few, points may move.
    """
    found = points.copy()
    for i in range(len(points)):
        j, k = on[i, 0], on[i, 1]
        if j >= 0:
            p = _lowest(patches[j], patches[k], k < 0, others[against[i]], _vector(points, i), extents[i])
            found[i, 0], found[i, 1], found[i, 2] = p
    return found


@kernel
def is_beyond(body, c, p, near):
    """Tell whether a point of a plane is between a chord of its rim and the rim, or near that."""
    patches, ends, of, bows = body[0], body[6], body[7], body[8]
    start, bow = _vector(ends[c], 0), _vector(bows, c)
    along = _minus(_vector(ends[c], 1), start)
    high, wide = _length(bow), _length(along)
    out, local = _times(1.0 / max(high, TINY), bow), _minus(p, _plus(start, 0.5, along))
    height, aside = _dot(local, out), abs(_dot(local, along)) / max(wide, TINY)
    strip = abs(near) + body[10][3]  # which triangles are taken to go on for
    if not (-strip <= height <= BOWED * high + abs(near) and 2.0 * aside <= wide + 2.0 * abs(near)):
        return False
    at = onto_point(patches[of[c, 0]], patches[of[c, 1]], False, p)
    return _dot(_minus(at, p), out) >= -near


@kernel
def beyond_chords(body, points, chords, near):
    """Tell which points of a plane, (n, 3), are between which chords of its rim, (m,), and the rim, or near, (n, m)."""
    found = np.empty((len(points), len(chords)), np.bool_)
    for i in range(len(points)):
        for k in range(len(chords)):
            found[i, k] = is_beyond(body, chords[k], _vector(points, i), near)
    return found


@kernel
def covers(body, k, p):
    """Tell whether a point is over, or below, the piece of a patch that its triangles stand for."""
    patches, corners, starts = body[0], body[1], body[2]
    gap, normal = gap_at(patches[k], p)
    found, room = False, body[10][1]
    for t in range(starts[k], starts[k + 1]):
        origin = _vector(corners[t], 0)
        one, two = _minus(_vector(corners[t], 1), origin), _minus(_vector(corners[t], 2), origin)
        local, across = _minus(p, origin), _cross(normal, two)
        det = _dot(across, one)
        if det == 0.0:
            continue
        u, turned = _dot(local, across) / det, _cross(local, one)
        v = _dot(turned, normal) / det
        within = u >= -RIM_SLACK and v >= -RIM_SLACK and u + v <= 1.0 + RIM_SLACK
        if within and abs(_dot(turned, two) / det + gap) <= room:  # not the far side of a cylinder
            found = True
            break
    of, short, near = body[7], body[9], body[10][0]
    foot = _plus(p, -gap, normal)
    for c in range(len(of)):
        if of[c, 0] == k and short[c] and not found:
            found = is_beyond(body, c, foot, near)
    for c in range(len(of)):
        if of[c, 0] == k and found and not short[c]:
            found = not is_beyond(body, c, foot, -near)
    return found


@step
def _off_segment(p, segment):
    """Return the square of how far a point is from a segment."""
    start = _vector(segment, 0)
    along, local = _minus(_vector(segment, 1), start), _minus(p, start)
    square = _dot(along, along)
    share = min(max(_dot(local, along) / square, 0.0), 1.0) if square > 0.0 else 0.0
    off = _plus(local, -share, along)
    return _dot(off, off)


@kernel
def least_to_edges(point, edges, of, bows, patches, near):
    """Return how far a point is from the nearest of true edges, of chords (m, 2, 3), infinite where there are none.

    `of` (m, 2): the patches of each. `bows` (m, 3): from the middles of chords to the edges, shorter than `near` of
    straight ones.
    """
    p, least = (point[0], point[1], point[2]), math.inf
    for bent in (False, True):  # straight ones first: bent ones that are farther need no search
        for e in range(len(edges)):
            bow = _vector(bows, e)
            far = math.sqrt(_off_segment(p, edges[e])) - _length(bow)
            if (_length(bow) > near) != bent or far >= least:
                continue
            if not bent:
                least = far
                continue
            start, end = _vector(edges[e], 0), _vector(edges[e], 1)
            at, chord = _plus(_plus(start, 0.5, _minus(end, start)), 1.0, bow), _minus(end, start)
            one, two = patches[of[e, 0]], patches[of[e, 1]]
            for _ in range(NEARING):  # from there along the arc, which may end before
                along = _cross(gap_at(one, at)[1], gap_at(two, at)[1])
                along = along if _length(along) > BETWEEN else chord
                along = _times(1.0 / max(_length(along), TINY), along)
                step = _dot(along, _minus(p, at))
                at = onto_point(one, two, False, _plus(at, step, along))
                if abs(step) <= near:
                    break
            least = min(least, max(_length(_minus(at, p)), far))
    return least


@kernel
def is_outside_at(body, j, k, p, gap):
    """Tell whether a point at a gap from one or two patches is behind them, and nearer another one or an edge."""
    patches, edges, off = body[0], body[5], body[10][2]
    if gap >= 0.0:
        return False
    for i in range(len(patches)):
        if i != j and i != k and abs(gap_at(patches[i], p)[0]) < -gap and covers(body, i, p):
            return True
    if gap < -2.0 * off:
        least = (-gap - off) ** 2
        for e in range(len(edges)):
            if _off_segment(p, edges[e]) < least:
                return True
    return False


@kernel
def is_outside(body, which, points, gaps):
    """Tell which points (n, 3) are behind one or two patches each, (n, 2), by gaps (n,), and nearer elsewhere.

    There another patch or an edge tells how far out they are.
    """
    found = np.empty(len(points), np.bool_)
    for i in range(len(points)):
        found[i] = is_outside_at(body, which[i, 0], which[i, 1], _vector(points, i), gaps[i])
    return found


@kernel
def _is_on_edge(body, j, k, p):
    """Tell whether a point of the curve between two patches is on an edge of the body."""
    edges, of = body[3], body[4]
    for e in range(len(edges)):
        if of[e, 0] == j and of[e, 1] == k:
            start = _vector(edges[e], 0)
            along, local = _minus(_vector(edges[e], 1), start), _minus(p, start)
            square = _dot(along, along)
            share = _dot(local, along) / square
            off = _plus(local, -share, along)
            if -RIM_SLACK < share < 1.0 + RIM_SLACK and _dot(off, off) <= square:
                return True
    return False


@kernel
def _is_next_to_rim(body, plane, p):
    """Tell whether a point of a plane is as near a bent edge of it as twice what faces leave their facets."""
    ends, of, near = body[6], body[7], body[10][1]
    found = False
    for c in range(len(ends)):
        found = found or (of[c, 0] == plane and _off_segment(p, ends[c]) <= near * near)
    return found


@kernel
def nearest(points, on, against, own, other, round_ones, band):
    """Tell which of the lowest points of features are where two bodies come nearest, on both of them, (n,).

    `points` (n, 3), `on` (n, 2) and `against` (n,) as of `lowest`. `own`, `other`: the bodies. `round_ones` (p,): which
    patches of the other are round. `band`: the largest gap. Gaps (n,), normals and feet on the other, (n, 3), as well.
    """
    kept, gaps, normals, feet = np.zeros(len(points), np.bool_), np.empty(len(points)), points.copy(), points.copy()
    for i in range(len(points)):
        p, j, k, to = _vector(points, i), on[i, 0], on[i, 1], against[i]
        gap, normal = gap_at(other[0][to], p)
        foot = _plus(p, -gap, normal)
        gaps[i], (normals[i, 0], normals[i, 1], normals[i, 2]) = gap, normal
        feet[i, 0], feet[i, 1], feet[i, 2] = foot
        if not abs(gap) <= band:
            continue
        if j >= 0 and not (covers(own, j, p) if k < 0 else _is_on_edge(own, j, k, p)):
            continue
        if not covers(other, to, foot):
            continue
        if (j >= 0 and k < 0) or (j >= 0 and not round_ones[to]):  # nearest between the normals of its faces
            n = gap_at(own[0][j], p)[1]
            x, y = _dot(n, normal), -1.0
            if k >= 0:
                m = gap_at(own[0][k], p)[1]
                x, y = _weights(n, m, x, _dot(m, normal))
            if not (x < BETWEEN and y < BETWEEN):
                continue
        elif not round_ones[to] and not _is_next_to_rim(other, to, foot):
            continue
        kept[i] = not is_outside_at(other, to, to, p, gap)
    return kept, gaps, normals, feet


@step
def _to_nearest(at, along, second, other):
    """Return where two straight lines, through points along directions, are nearest, in multiples of these."""
    off, product = _minus(second, at), _dot(along, other)
    a, b, c, d = _dot(along, along), _dot(other, other), _dot(off, along), _dot(off, other)
    whole = max(a * b - product * product, TINY)  # far away for parallel ones
    return (b * c - product * d) / whole, (product * c - a * d) / whole


@kernel
def nearest_on_edges(start, chords, patches, of):
    """Return points of edges of two bodies, (2, n, 3), where these are nearest, with their faces' normals.

    Points go to where the tangents of their edges are nearest, and back onto these: Newton's method, but for what the
    gap bends.

    `start` (2, n, 3): the middles of `chords`. `of` (2, n, 2): the patches of each edge. Normals (2, n, 2, 3). And
    whether chords are nearest no further off them than a half beyond their ends, (n,): of others nothing is told.
    """
    found, normals, aims = np.zeros(start.shape), np.zeros((*of.shape, 3)), np.zeros(start.shape[1], np.bool_)
    for i in range(start.shape[1]):
        p, q = _vector(start[0], i), _vector(start[1], i)
        u, v = _vector(chords[0], i), _vector(chords[1], i)
        x, y = _to_nearest(p, u, q, v)
        aims[i] = abs(x) <= 1.0 and abs(y) <= 1.0
        if not aims[i]:
            continue
        first, second = _length(u), _length(v)
        one, two, three, four = of[0, i, 0], of[0, i, 1], of[1, i, 0], of[1, i, 1]
        for _ in range(STEPS):
            x, y = _to_nearest(p, u, q, v)
            x, y = min(max(x, -1.0), 1.0), min(max(y, -1.0), 1.0)
            moved = max(abs(x) * _length(u), abs(y) * _length(v))
            p = onto_point(patches[one], patches[two], False, _plus(p, x, u))
            q = onto_point(patches[three], patches[four], False, _plus(q, y, v))
            u = _cross(gap_at(patches[one], p)[1], gap_at(patches[two], p)[1])
            v = _cross(gap_at(patches[three], q)[1], gap_at(patches[four], q)[1])
            u, v = _times(first / max(_length(u), TINY), u), _times(second / max(_length(v), TINY), v)
            if moved <= LEVEL * max(first, second):
                break
        found[0, i, 0], found[0, i, 1], found[0, i, 2] = p
        found[1, i, 0], found[1, i, 1], found[1, i, 2] = q
        for k in range(2):
            normals[0, i, k, 0], normals[0, i, k, 1], normals[0, i, k, 2] = gap_at(patches[of[0, i, k]], p)[1]
            normals[1, i, k, 0], normals[1, i, k, 1], normals[1, i, k, 2] = gap_at(patches[of[1, i, k]], q)[1]
    return found, normals, aims
