"""What the judge works out: explicit vertices, each scaled and moved, over many scale pairs and poses at once.

It shares nothing with the decision curve and its kernels. Points are handled relative to the static seed:
x = o + rho_1 R (v - s_1) on body 1, y = rho_2 (v - s_2) on body 2, with o = R s_1 + t - s_2.

A *frame* is one row of numbers for a scale pair and a pose, in units in which the larger body reaches about 1:
rho_1, rho_2, the unit's length, o, and R row by row. All of it is nan where scales or pose are none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.compiling import kernel, light, step
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.geometry.vectors import _cross, _dot, _minus, _plus
from fcdm_opt.tolerances import DEFAULT

UNIT, OFFSET, TURN, FRAME = 2, 3, 6, 15  # places in a frame, after the scales; its length
TIE, PARALLEL, SIDE, TOUCH, SAME = DEFAULT.tie, DEFAULT.line, DEFAULT.side, DEFAULT.touch, DEFAULT.planarity
NEXT, LAST = [1, 2, 0], [2, 0, 1]  # axes after each axis, of a cross product
ROOM = 8.0  # two bodies of unit reach and their offset are no further apart and no deeper in each other than this
ROUNDING = 4.0 * np.finfo(np.float64).eps  # of a difference of points or a sum of their products, times their reach
FEW = 1000  # part pairs asked first
APART = 1e-3  # of the extent of two flush elements: further apart, how far is not asked; no check allows it
FLUSH = 1e-4  # of the size of elements that lie on each other: corners of faces in files are off their planes by less


# ------------------------------------------------------------------------------------------------------- whole bodies


class Solid(NamedTuple):
    """One part, from the seed."""

    points: Array  # (n, 3)
    planes: Array  # (unit normal, level, how far the normal may be off) of each face, (f, 5)
    edges: Array  # from their origins to their ends, (m, 3)
    edge_faces: Ints  # the vertex that each edge leaves, and the faces on its two sides, (m, 3)
    ball: Array  # centre and radius of a sphere about all points, (4,)

    @classmethod
    def of(cls, part: ConvexPart) -> Solid:
        """Return the solid of a part."""
        points = part.vertices - part.seed
        middle = points.mean(axis=0)
        ball = np.append(middle, _lengths(points - middle).max())
        edges = points[part.edges[:, 1]] - points[part.edges[:, 0]]
        return cls(points, _planes(points, part.loops), edges, part.edges[:, [0, 2, 3]], ball)

    @property
    def even(self) -> Array:
        """An affine image of the points, with equal extents: orthonormal columns, of the same orientation."""
        even, turn = np.linalg.qr(self.points - self.ball[:3])
        return even * np.sign(np.diag(turn))


def _planes(points: Array, loops: Sequence[tuple[int, ...]]) -> Array:
    """Return (unit normal, level, doubt) of each face, (f, 5), from the fan of triangles about its first corner."""
    sizes = np.array([len(loop) for loop in loops])
    corners = np.array(list(chain.from_iterable(loops)))
    starts = np.cumsum(sizes) - sizes
    first, inner = np.repeat(starts, sizes - 2), np.ones(len(corners), bool)
    inner[starts], inner[starts + sizes - 1] = False, False
    second = np.flatnonzero(inner)
    u, v = points[corners[second]] - points[corners[first]], points[corners[second + 1]] - points[corners[first]]
    fans = np.cumsum(sizes - 2) - (sizes - 2)
    n = np.add.reduceat(u[:, NEXT] * v[:, LAST] - u[:, LAST] * v[:, NEXT], fans)
    around, length = np.add.reduceat(_lengths(u) + _lengths(v), fans), _lengths(n)
    n /= length[:, None]
    doubt = ROUNDING * _lengths(points).max() * around / length
    level = np.maximum.reduceat(_dots(np.repeat(n, sizes, axis=0), points[corners]), starts)
    for k in np.flatnonzero(doubt > DEFAULT.tie).tolist():  # a sliver's plane may leave other vertices outside
        level[k] = (points @ n[k]).max()
    return np.column_stack([n, level, doubt])


@light
@kernel
def framed(pairs, transforms, seeds, reaches):
    """Return the frame of each scale pair and pose, (k, 15); the unit is a power of two, so nothing is rounded."""
    frames = np.full((len(pairs), FRAME), np.nan)
    for k in range(len(pairs)):
        one, two, T, frame = pairs[k, 0], pairs[k, 1], transforms[k], frames[k]
        if not (one > 0.0 and two > 0.0 and np.isfinite(one + two + T.sum())):
            continue
        unit = 2.0 ** np.ceil(np.log2(max(one * reaches[0], two * reaches[1])))
        frame[0], frame[1], frame[UNIT] = one / unit, two / unit, unit
        offset = _offset(seeds, T)
        for i in range(3):
            frame[OFFSET + i] = offset[i] / unit
            for j in range(3):
                frame[TURN + 3 * i + j] = T[i, j]
    return frames


def placed(points: Array, frames: Array, moving: bool) -> Array:
    """Return a body's points, (n, 3) from its seed, in each frame, (k, n, 3)."""
    if not moving:
        return frames[:, 1, None, None] * points
    return frames[:, None, OFFSET:TURN] + frames[:, 0, None, None] * (points @ frames[:, TURN:].reshape(-1, 3, 3).mT)


@light
@kernel
def believed(planes, faces, frames, values, firsts, seconds):
    """Tell which signed distances can be, (k,): near touch their witnesses must lie in the parts and be that far apart.

    `planes` and `faces` are those of the two parts; nan is not believed.
    """
    found = np.zeros(len(frames), np.bool_)
    for k in range(len(frames)):
        frame, p, q, size = frames[k], firsts[k], seconds[k], abs(values[k])
        offset = (frame[OFFSET], frame[OFFSET + 1], frame[OFFSET + 2])
        found[k] = size <= abs(offset[0]) + abs(offset[1]) + abs(offset[2]) + ROOM
        if found[k] and size <= SIDE:
            apart, inward = _minus(q, p), _turned(frame[TURN:].reshape(3, 3).T, _minus(p, offset))
            known = abs(np.sqrt(_dot(apart, apart)) - size) <= TIE
            for m in range(len(planes)):
                known = known and _dot(inward, planes[m]) - frame[0] * planes[m, 3] <= TIE
            for m in range(len(faces)):
                known = known and _dot(q, faces[m]) - frame[1] * faces[m, 3] <= TIE
            found[k] = known
    return found


@np.errstate(all="ignore")
def nearness(ones: Sequence[Solid], twos: Sequence[Solid], frames: Array) -> Array:
    """Return lower bounds of the signed distances of all part pairs, (k, parts 1, parts 2), in units."""
    # how far the spheres about the parts are apart; where they meet, the largest gap along the parts' face normals
    found = _ball_gaps(ones, twos, frames)
    for i, j in np.argwhere((found <= 0.0).any(axis=0)).tolist():
        at = np.flatnonzero(found[:, i, j] <= 0.0)
        found[at, i, j] = np.maximum(found[at, i, j], widest(ones[i], twos[j], frames[at], edged=False))
    return found


def least_gaps(ones: Sequence[Solid], twos: Sequence[Solid], most: int, frames: Array) -> Array:
    """Return the least over part pairs of the largest gap along any direction that can separate most, (k,), units."""
    # these are all face normals and the edge x edge directions that are normals of facets of the parts' difference; nan
    # where a part pair that may be the nearest has more than `most` pairs of edges. Pairs whose spheres are further
    # apart than the least so far are passed over
    if len(ones) == len(twos) == 1 and len(ones[0].edges) * len(twos[0].edges) <= most:
        return widest(ones[0], twos[0], frames, edged=True)
    with np.errstate(all="ignore"):
        bounds = _ball_gaps(ones, twos, frames).reshape(len(frames), -1)
    least, unknown = np.where(np.isnan(frames[:, UNIT]), np.nan, np.inf), np.full(len(frames), np.inf)
    for pair, at in nearest_first(bounds, least):
        one, two = ones[pair // len(twos)], twos[pair % len(twos)]
        if len(one.edges) * len(two.edges) > most:
            unknown[at] = np.fmin(unknown[at], bounds[at, pair])
        else:
            least[at] = np.minimum(least[at], widest(one, two, frames[at], edged=True))
    return np.where(unknown > least, least, np.nan)


def nearest_first(bounds: Array, least: Array) -> Iterator[tuple[int, Ints]]:
    """Yield part pairs by lower bounds of their gaps, (k, pairs), and the frames in which one may be below `least`."""
    # as long as there are any: whoever asks lowers `least`, (k,), meanwhile. nan is below nothing
    lowest = np.fmin.reduce(bounds, axis=0, initial=np.inf)
    first = np.argpartition(lowest, FEW)[:FEW] if len(lowest) > FEW else np.arange(len(lowest))
    for rest in (False, True):  # of millions few are left after these
        rows = np.flatnonzero(lowest <= np.fmax.reduce(least, initial=-np.inf)) if rest else first
        rows = np.setdiff1d(rows, first, assume_unique=True) if rest else rows
        for pair in rows[np.argsort(lowest[rows], kind="stable")].tolist():
            if not lowest[pair] <= np.fmax.reduce(least, initial=-np.inf):
                return
            at = np.flatnonzero(bounds[:, pair] <= least)
            if at.size:
                yield pair, at


def _ball_gaps(ones: Sequence[Solid], twos: Sequence[Solid], frames: Array) -> Array:
    balls, others = (np.array([solid.ball for solid in solids]) for solids in (ones, twos))
    x, y = placed(balls[:, :3], frames, True), placed(others[:, :3], frames, False)
    apart = _lengths(x[:, :, None] - y[:, None])
    return np.asarray(apart - (frames[:, :1] * balls[:, 3])[:, :, None] - (frames[:, 1:2] * others[:, 3])[:, None])


def widest(one: Solid, two: Solid, frames: Array, *, edged: bool) -> Array:
    """Return the largest gap of two parts over their face normals, and pairs of edges if asked, in each frame, (k,)."""
    pacing.check()
    return np.asarray(widest_gaps(*one[:4], *two[:4], frames, edged)[:, 0])


@light
@kernel
def widest_gaps(points, planes, edges, edge_faces, others, faces, sides, neighbours, frames, edged):
    """Return the largest gap of two solids, as `Solid` has them, over directions that can separate most, and where.

    The gap and its unit direction, (k, 4).

    Pairs of edges make a facet of the parts' difference only where the arcs between the normals of the faces beside
    them cross: where the faces of either lie on different sides of the other. Others are left out, unless rounding may
    have chosen the side; and parallel ones.
    """
    found, x, y = np.full((len(frames), 4), np.nan), np.empty((len(points), 3)), np.empty((len(others), 3))
    normals, hands = np.empty((len(planes), 3)), np.empty(len(faces), np.int8)
    room, rooms = ROUNDING * _circumradius(points), ROUNDING * _circumradius(others)
    for k in range(len(frames)):
        frame = frames[k]
        if np.isnan(frame[UNIT]):
            continue
        direction = found[k, 1:]
        R, offset = frame[TURN:].reshape(3, 3), (frame[OFFSET], frame[OFFSET + 1], frame[OFFSET + 2])
        for m in range(len(points)):
            x[m, 0], x[m, 1], x[m, 2] = _plus(offset, frame[0], _turned(R, points[m]))
        for m in range(len(others)):
            y[m, 0], y[m, 1], y[m, 2] = _plus((0.0, 0.0, 0.0), frame[1], others[m])
        best, far, near = -np.inf, 0, 0
        for m in range(len(planes)):
            n = normals[m, 0], normals[m, 1], normals[m, 2] = _turned(R, planes[m])
            best, far, near = _wider(best, far, near, n, x, y, direction)
        for m in range(len(faces)):
            best, far, near = _wider(best, far, near, (-faces[m, 0], -faces[m, 1], -faces[m, 2]), x, y, direction)
        for i in range(len(edges) if edged else 0):
            u, a, b = _turned(R, edges[i]), edge_faces[i, 1], edge_faces[i, 2]
            own, off = np.sqrt(_dot(u, u)), TIE + max(planes[a, 4], planes[b, 4])
            along_a, along_b = abs(_dot(u, normals[a])) <= SAME * own, abs(_dot(u, normals[b])) <= SAME * own
            for m in range(len(faces)):
                height, doubt = _dot(u, faces[m]), own * (TIE + faces[m, 4]) + room
                hands[m] = int(height > doubt) - int(height < -doubt)
            for j in range(len(sides)):
                if hands[neighbours[j, 1]] * hands[neighbours[j, 2]] > 0:
                    continue
                v = sides[j]
                p, q, length = _dot(v, normals[a]), _dot(v, normals[b]), np.sqrt(_dot(v, v))
                doubt = length * off + rooms
                if (p > doubt and q > doubt) or (p < -doubt and q < -doubt):
                    continue
                n = _cross(u, v)
                size = np.sqrt(_dot(n, n))
                if (along_a and abs(p) * own <= SAME * size) or (along_b and abs(q) * own <= SAME * size):
                    continue  # the normal of a face beside, which has been asked: of aligned parts nearly all pairs
                if size > PARALLEL * own * length:
                    n = (n[0] / size, n[1] / size, n[2] / size)
                    best, far, near = _wider(best, far, near, n, x, y, direction)
                    best, far, near = _wider(best, far, near, (-n[0], -n[1], -n[2]), x, y, direction)
        found[k, 0] = best
    return found


@step
def _wider(best, i, j, n, x, y, direction):
    """Return the larger of the best gap of points y from x and that along n, and points that came near the extremes.

    A better one is put into `direction`. Two points of either part, those of the last direction first, rule
    most directions out.
    """
    most = _dot(n, y[j])
    if most - _dot(n, x[i]) <= best:
        return best, i, j
    high, low = -np.inf, np.inf
    for m in range(len(x)):
        level = _dot(n, x[m])
        if level > high:
            high, i = level, m
            if most - high <= best:  # of a ball beside what it touches, nearly all normals soon are out
                return best, i, j
    for m in range(len(y)):
        level = _dot(n, y[m])
        if level < low:
            low, j = level, m
            if low - high <= best:
                return best, i, j
    direction[0], direction[1], direction[2] = n
    return low - high, i, j


@step
def _circumradius(points):
    """Return how far points are from the seed."""
    square = 0.0
    for m in range(len(points)):
        square = max(square, _dot(points[m], points[m]))
    return np.sqrt(square)


# ----------------------------------------------------------------------------------------------------- claimed contacts
# A carrier: vertices of the parts of body 1 and 2, from the seeds; rows of both elements; the direction, as rows of
# either part, 3 and none, none and 3, or 2 and 2, and its sign.


@light
@kernel
def edge_sign(one, two, across, along, T):
    """Return the sign of edge 1 x edge 2 that leads out of part 1: the side on which less of it lies; 0 if parallel."""
    n = _normal(one, two, across, along, 1, T)
    if np.isnan(n[0]):
        return 0
    low, high, base = np.inf, -np.inf, one[across[0]]
    for m in range(len(one)):
        height = _dot(n, _turned(T, _minus(one[m], base)))
        low, high = min(low, height), max(high, height)
    return 1 if high <= -low else -1


@light
@kernel
def contact_rows(one, two, first, second, across, along, sign, seeds, poses):
    """Return (n, a, b, c) at each pose, (k, 6): the unit normal and the contact line.

    The separation of two claimed vertices along the normal is affine in the scales, c - a rho_1 - b rho_2: three scale
    pairs give it.
    """
    rows = np.empty((len(poses), 6))
    for k in range(len(poses)):
        n, offset = _normal(one, two, across, along, sign, poses[k]), _offset(seeds, poses[k])
        x, y = _turned(poses[k], one[first[0]]), two[second[0]]
        base = _dot(n, _minus(y, _plus(offset, 1.0, x)))
        wider = _dot(n, _minus(y, _plus(offset, 2.0, x)))
        longer = _dot(n, _minus(_plus(y, 1.0, y), _plus(offset, 1.0, x)))
        rows[k, 0], rows[k, 1], rows[k, 2] = n
        rows[k, 3], rows[k, 4], rows[k, 5] = base - wider, base - longer, 3.0 * base - wider - longer
    return rows


@light
@kernel
def contact_errors(one, two, first, second, across, along, sign, seeds, pairs, poses):
    """Return how far the claim is from being a real contact at each scale pair and pose, (k,), lengths.

    The largest of: distance of a common point from either element, and how far either part reaches across the plane
    through it; infinite where there is none. Of elements that are to be flush also how far their corners are off it,
    where they are aslant; of those that are well apart at least this, the distance of their boxes: most parts that a
    wide face is cut into are.
    """
    errors, x, y = np.empty(len(poses)), np.empty((len(one), 3)), np.empty((len(two), 3))
    for k in range(len(poses)):
        n, offset = _normal(one, two, across, along, sign, poses[k]), _offset(seeds, poses[k])
        for m in range(len(one)):
            x[m, 0], x[m, 1], x[m, 2] = _plus(offset, pairs[k, 0], _turned(poses[k], one[m]))
        for m in range(len(two)):
            y[m, 0], y[m, 1], y[m, 2] = _plus((0.0, 0.0, 0.0), pairs[k, 1], two[m])
        if len(first) == 1:
            point = _plus(x[first[0]], 0.0, x[first[0]])
            error = _off(y, second, point)
        elif len(second) == 1:
            point = _plus(y[second[0]], 0.0, y[second[0]])
            error = _off(x, first, point)
        elif len(first) == len(second) == len(across) == len(along) == 2:
            point = _crossing(x[first[0]], x[first[1]], y[second[0]], y[second[1]])
            error = _larger(_off(x, first, point), _off(y, second, point))
        else:
            error, size = _apart(x, first, y, second)
            if error > APART * size:
                errors[k] = error
                continue
            error, point = _shared(x, first, y, second)
            for m in range(len(first)):
                slope = abs(_dot(n, _minus(x[first[m]], point)))
                error = _larger(error, slope) if slope > FLUSH * size else error
            for m in range(len(second)):
                slope = abs(_dot(n, _minus(y[second[m]], point)))
                error = _larger(error, slope) if slope > FLUSH * size else error
        level = _dot(n, point)
        for m in range(len(x)):
            error = _larger(error, _dot(n, x[m]) - level)
        for m in range(len(y)):
            error = _larger(error, level - _dot(n, y[m]))
        errors[k] = np.inf if np.isnan(error) else error
    return errors


@light
@kernel
def contact_flushness(one, two, first, second, across, along, sign, seeds, pairs, poses):
    """Return how flush the claimed elements are at each scale pair and pose, (k, 3), lengths.

    How far their vertices are from one plane along the normal, or of two edges from one line; length and width of what
    the elements, seen along the normal, share: it is bounded by what each has of the other's sides.
    """
    found, x, y = np.empty((len(poses), 3)), np.empty((len(first), 3)), np.empty((len(second), 3))
    p, q = np.empty((len(first), 2)), np.empty((len(second), 2))
    corners = np.empty((2 * len(first) + 2 * len(second), 2))
    for k in range(len(poses)):
        n, offset = _normal(one, two, across, along, sign, poses[k]), _offset(seeds, poses[k])
        low, high = np.inf, -np.inf
        for m in range(len(first)):
            x[m, 0], x[m, 1], x[m, 2] = _plus(offset, pairs[k, 0], _turned(poses[k], one[first[m]]))
            low, high = min(low, _dot(n, x[m])), max(high, _dot(n, x[m]))
        for m in range(len(second)):
            y[m, 0], y[m, 1], y[m, 2] = _plus((0.0, 0.0, 0.0), pairs[k, 1], two[second[m]])
            low, high = min(low, _dot(n, y[m])), max(high, _dot(n, y[m]))
        found[k, 0] = high - low
        if len(first) == len(second) == 2:
            u, v = _minus(x[1], x[0]), _minus(y[1], y[0])
            found[k, 0] = _off_line(x, y) if _dot(u, u) >= _dot(v, v) else _off_line(y, x)
        least = 0
        for axis in range(1, 3):
            least = axis if np.abs(n[axis]) < np.abs(n[least]) else least
        u = _cross(n, (1.0 if least == 0 else 0.0, 1.0 if least == 1 else 0.0, 1.0 if least == 2 else 0.0))
        size = np.sqrt(_dot(u, u))
        u = (u[0] / size, u[1] / size, u[2] / size)
        v = _cross(n, u)
        for m in range(len(first)):
            spoke = _minus(x[m], x[0])
            p[m, 0], p[m, 1] = _dot(u, spoke), _dot(v, spoke)
        for m in range(len(second)):
            spoke = _minus(y[m], x[0])
            q[m, 0], q[m, 1] = _dot(u, spoke), _dot(v, spoke)
        slack = TOUCH * min(_longest_side(p), _longest_side(q))
        count = _sides_within(q, p, slack, corners, _sides_within(p, q, slack, corners, 0))
        found[k, 1], found[k, 2] = _extents(corners, count)
    return found


@step
def _off_line(longer, other):
    """Return how far two points are from the line through two others."""
    u, square = _minus(longer[1], longer[0]), 0.0
    for m in range(2):
        away = _cross(_minus(other[m], longer[0]), u)
        square = max(square, _dot(away, away))
    return np.sqrt(square / _dot(u, u))


@step
def _longest_side(points):
    """Return the length of the longest side of a polygon."""
    square = 0.0
    for m in range(len(points)):
        e, f = points[m, 0] - points[m - 1, 0], points[m, 1] - points[m - 1, 1]
        square = max(square, e * e + f * f)
    return np.sqrt(square)


@step
def _sides_within(x, y, slack, corners, count):
    """Append both ends of what an element x has of each side of another, and return how many are there then."""
    # each side of y is cut by the half-planes of x that it leaves by more than the slack; a segment's are those beyond
    # its ends too
    last, middle_e, middle_f = len(x) - 1, 0.0, 0.0
    for m in range(len(x)):
        middle_e, middle_f = middle_e + x[m, 0] / len(x), middle_f + x[m, 1] / len(x)
    for j in range(len(y)):
        after = j + 1 if j + 1 < len(y) else 0
        e, f = y[after, 0] - y[j, 0], y[after, 1] - y[j, 1]
        low, high, outside = 0.0, 1.0, False
        for i in range(len(x) if last > 1 else 4):
            start = i if last > 1 else i % 2
            end = start + 1 if start < last else 0
            g, h = x[end, 0] - x[start, 0], x[end, 1] - x[start, 1]
            if i > last:  # beyond the end of a segment
                start = end
            else:
                g, h = h, -g
                if last > 1 and (x[start, 0] - middle_e) * g + (x[start, 1] - middle_f) * h < 0.0:
                    g, h = -g, -h
            size = np.sqrt(g * g + h * h)
            room = ((x[start, 0] - y[j, 0]) * g + (x[start, 1] - y[j, 1]) * h) / size
            rate = (e * g + f * h) / size
            if min(room, room - rate) < -slack:
                if rate < 0.0:
                    low = max(low, room / rate)
                elif rate > 0.0:
                    high = min(high, room / rate)
                else:
                    outside = True
        if not outside and (high - low) * np.sqrt(e * e + f * f) >= -slack:
            low, high = min(max(low, 0.0), 1.0), min(max(high, 0.0), 1.0)
            corners[count, 0], corners[count, 1] = y[j, 0] + low * e, y[j, 1] + low * f
            corners[count + 1, 0], corners[count + 1, 1] = y[j, 0] + high * e, y[j, 1] + high * f
            count += 2
    return count


@step
def _extents(corners, count):
    """Return the largest distance of so many points of the plane, and their width across that direction."""
    square, e, f = 0.0, 0.0, 0.0
    for i in range(count):
        for j in range(i):
            g, h = corners[j, 0] - corners[i, 0], corners[j, 1] - corners[i, 1]
            if g * g + h * h > square:
                square, e, f = g * g + h * h, g, h
    length, low, high = np.sqrt(square), 0.0, 0.0
    for i in range(1, count if length > 0.0 else 0):
        across = (e * (corners[i, 1] - corners[0, 1]) - f * (corners[i, 0] - corners[0, 0])) / length
        low, high = min(low, across), max(high, across)
    return length, high - low


@step
def _normal(one, two, across, along, sign, T):
    """Return the unit contact normal at a pose; nan where two edges are parallel."""
    if len(across) == 3:
        u, v = _minus(one[across[1]], one[across[0]]), _minus(one[across[2]], one[across[0]])
        u, v = _turned(T, u), _turned(T, v)
    elif len(along) == 3:
        u, v = _minus(two[along[1]], two[along[0]]), _minus(two[along[2]], two[along[0]])
    else:
        u = _turned(T, _minus(one[across[1]], one[across[0]]))
        v = _minus(two[along[1]], two[along[0]])
    n = _cross(u, v)
    length = np.sqrt(_dot(n, n))
    if not length > TIE * np.sqrt(_dot(u, u)) * np.sqrt(_dot(v, v)):
        return np.nan, np.nan, np.nan
    return sign * n[0] / length, sign * n[1] / length, sign * n[2] / length


@step
def _offset(seeds, T):
    seed = _turned(T, seeds[0])
    return seed[0] + T[0, 3] - seeds[1, 0], seed[1] + T[1, 3] - seeds[1, 1], seed[2] + T[2, 3] - seeds[1, 2]


@step
def _crossing(a, b, c, d):
    """Return the point of the line a b that is nearest to the line c d."""
    u, v = _minus(b, a), _minus(d, c)
    n = _cross(u, v)
    return _plus(a, _dot(_cross(_minus(c, a), v), n) / _dot(n, n), u)


@step
def _apart(x, first, y, second):
    """Return how far the boxes of two elements are apart, and the extent of both together."""
    square, size = 0.0, 0.0
    for axis in range(3):
        low, high, least, most = np.inf, -np.inf, np.inf, -np.inf
        for m in first:
            low, high = min(low, x[m, axis]), max(high, x[m, axis])
        for m in second:
            least, most = min(least, y[m, axis]), max(most, y[m, axis])
        gap = max(0.0, least - high, low - most)
        square += gap * gap
        size = max(size, max(high, most) - min(low, least))
    return np.sqrt(square), size


@step
def _shared(x, first, y, second):
    """Return a point of two flush elements, and its distances from both together, these first."""
    # a corner of what they share: of one of them, or where their sides cross
    edge = _minus(x[first[1]], x[first[0]])
    best, point, enough = np.inf, _plus(edge, -1.0, edge), PARALLEL * np.sqrt(_dot(edge, edge))
    for m in range(len(first) + len(second)):
        corner = x[first[m]] if m < len(first) else y[second[m - len(first)]]
        off = _off(y, second, corner) if m < len(first) else _off(x, first, corner)
        if off < best:
            best, point = off, _plus(corner, 0.0, corner)
        if best <= enough:
            return best, point
    for m in range(len(first) if len(first) > 2 else 1):
        a, b = x[first[m]], x[first[(m + 1) % len(first)]]
        for other in range(len(second) if len(second) > 2 else 1):
            crossing = _crossing(a, b, y[second[other]], y[second[(other + 1) % len(second)]])
            off = _off(x, first, crossing) + _off(y, second, crossing)
            if off < best:
                best, point = off, crossing
            if best <= enough:
                return best, point
    return best, point


@step
def _off(points, rows, p):
    """Return how far p is from a vertex, a segment or a planar convex polygon in loop order."""
    count, base = len(rows), points[rows[0]]
    if count <= 2:
        return _off_segment(base, points[rows[count - 1]], p)
    middle, normal = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for m in range(count):
        corner, following = points[rows[m]], points[rows[(m + 1) % count]]
        middle = _plus(middle, 1.0 / count, corner)
        normal = _plus(normal, 1.0, _cross(_minus(corner, base), _minus(following, corner)))
    length = np.sqrt(_dot(normal, normal))
    height, outside, nearest = abs(_dot(_minus(p, middle), normal)) / length, 0.0, np.inf
    for m in range(count):
        corner, following = points[rows[m]], points[rows[(m + 1) % count]]
        outward = _cross(_minus(following, corner), normal)
        outside = _larger(outside, _dot(_minus(p, corner), outward) / np.sqrt(_dot(outward, outward)))
        nearest = min(nearest, _off_segment(corner, following, p))
    return _larger(height, outside) if outside == 0.0 else _larger(height, _larger(outside, nearest))


@step
def _off_segment(a, b, p):
    """Return how far p is from a segment, which may be a point."""
    u, w = _minus(b, a), _minus(p, a)
    square = _dot(u, u)
    offset = _plus(w, -min(max(_dot(w, u) / square, 0.0), 1.0) if square > 0.0 else 0.0, u)
    return np.sqrt(_dot(offset, offset))


@step
def _larger(a, b):
    """Return the larger one, nan if either is."""
    return b if b > a or np.isnan(b) else a


# ------------------------------------------------------------------------------------------------------------- vectors


def _dots(u: Array, v: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", u, v))


def _lengths(u: Array) -> Array:
    return np.asarray(np.sqrt(_dots(u, u)))


@step
def _turned(R, v):
    """Return R v for the rotation in the first three columns."""
    return _dot(R[0], v), _dot(R[1], v), _dot(R[2], v)
