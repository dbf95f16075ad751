"""What the judge works out: explicit vertices, each scaled and moved, over many scale pairs and poses at once.

It shares nothing with the decision curve and its kernels. Points are handled relative to the static seed:
x = o + rho_1 R (v - s_1) on body 1, y = rho_2 (v - s_2) on body 2, with o = R s_1 + t - s_2.

A *frame* is one row of numbers for a scale pair and a pose, in units in which the larger body reaches about 1:
rho_1, rho_2, the unit's length, o, and R row by row. All of it is nan where scales or pose are none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.tolerances import DEFAULT

UNIT, OFFSET, TURN, FRAME = 2, 3, 6, 15  # places in a frame, after the scales; its length
ROOM = 8.0  # two bodies of unit reach and their offset are no further apart and no deeper in each other than this
ROUNDING = 4.0 * np.finfo(np.float64).eps  # of a difference of points or a sum of their products, times their reach
CHUNK = 1 << 19  # numbers that are worked on at once
HOPEFUL = 64  # directions that are tried at once, of many


# ------------------------------------------------------------------------------------------------------- whole bodies


class Solid(NamedTuple):
    """One part, from the seed.

    Attributes
    ----------
    points : (n, 3) array
    planes : (f, 5) array
        (unit normal, level, how far the normal may be off) of each face.
    edges : (m, 3) array
        From their origins to their ends.
    beside : (m, 3) array of int
        The vertex that each edge leaves, and the faces on its two sides.
    ball : (4,) array
        Centre and radius of a sphere about all points.
    """

    points: Array
    planes: Array
    edges: Array
    beside: Ints
    ball: Array

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

    @property
    def reach(self) -> float:
        """No point is further from the seed."""
        return float(_lengths(self.ball[:3]) + self.ball[3])


def _planes(points: Array, loops: Sequence[tuple[int, ...]]) -> Array:
    """Return (unit normal, level, doubt) of each face, (f, 5), from the fan of triangles about its first corner."""
    sizes = np.array([len(loop) for loop in loops])
    corners = np.concatenate([np.array(loop) for loop in loops])
    starts = np.cumsum(sizes) - sizes
    first, inner = np.repeat(starts, sizes - 2), np.ones(len(corners), bool)
    inner[starts], inner[starts + sizes - 1] = False, False
    second = np.flatnonzero(inner)
    u, v = points[corners[second]] - points[corners[first]], points[corners[second + 1]] - points[corners[first]]
    fans = np.cumsum(sizes - 2) - (sizes - 2)
    n = np.add.reduceat(np.cross(u, v), fans)
    around, length = np.add.reduceat(_lengths(u) + _lengths(v), fans), _lengths(n)
    n /= length[:, None]
    doubt = ROUNDING * _lengths(points).max() * around / length
    level = np.maximum.reduceat(_dots(np.repeat(n, sizes, axis=0), points[corners]), starts)
    for k in np.flatnonzero(doubt > DEFAULT.tie).tolist():  # a sliver's plane may leave other vertices outside
        level[k] = (points @ n[k]).max()
    return np.column_stack([n, level, doubt])


@np.errstate(all="ignore")
def framed(pairs: Array, transforms: Array, seeds: Array, reaches: Array) -> Array:
    """Return the frame of each scale pair and pose, (k, 15); the unit is a power of two, so nothing is rounded."""
    known = np.isfinite(pairs.sum(axis=1) + transforms.sum(axis=(1, 2))) & (pairs > 0.0).all(axis=1)
    if not known.all():
        frames = np.full((len(pairs), FRAME), np.nan)
        frames[known] = framed(pairs[known], transforms[known], seeds, reaches)
        return frames
    frames, R = np.empty((len(pairs), FRAME)), transforms[:, :3, :3]
    unit = np.exp2(np.ceil(np.log2((pairs * reaches).max(axis=1))))[:, None]
    frames[:, :UNIT], frames[:, UNIT:OFFSET] = pairs / unit, unit
    frames[:, OFFSET:TURN] = (R @ seeds[0] + transforms[:, :3, 3] - seeds[1]) / unit
    frames[:, TURN:] = R.reshape(-1, 9)
    return frames


def placed(points: Array, frames: Array, moving: bool) -> Array:
    """Return a body's points, (n, 3) from its seed, in each frame, (k, n, 3)."""
    if not moving:
        return frames[:, 1, None, None] * points
    return frames[:, None, OFFSET:TURN] + frames[:, 0, None, None] * (points @ _turns(frames).mT)


@np.errstate(all="ignore")
def believed(one: Solid, two: Solid, frames: Array, values: Array, firsts: Array, seconds: Array) -> Flags:
    """Tell which signed distances can be: near touch their witnesses must lie in the parts and be that far apart."""
    size = np.abs(values)
    found = size <= np.abs(frames[:, OFFSET:TURN]).sum(axis=1) + ROOM
    near = np.flatnonzero(found & (size <= DEFAULT.side))
    if near.size:
        frames, p, q = frames[near], firsts[near], seconds[near]
        inward = ((p - frames[:, OFFSET:TURN])[:, None] @ _turns(frames))[:, 0]
        out = (inward @ one.planes[:, :3].T - frames[:, :1] * one.planes[:, 3]).max(axis=1)
        outside = (q @ two.planes[:, :3].T - frames[:, 1:2] * two.planes[:, 3]).max(axis=1)
        error = np.maximum(np.maximum(out, outside), np.abs(_lengths(q - p) - size[near]))
        found[near] = error <= DEFAULT.tie
    return found


@np.errstate(all="ignore")
def nearness(ones: Sequence[Solid], twos: Sequence[Solid], frames: Array) -> Array:
    """Return lower bounds of the signed distances of all part pairs, (k, parts 1, parts 2), in units.

    How far the spheres about the parts are apart; where they meet, the largest gap along the parts' face normals.
    """
    found = _ball_gaps(ones, twos, frames)
    for i, j in np.argwhere((found <= 0.0).any(axis=0)).tolist():
        at = np.flatnonzero(found[:, i, j] <= 0.0)
        found[at, i, j] = np.maximum(found[at, i, j], _face_gaps(ones[i], twos[j], frames[at]))
    return found


@np.errstate(all="ignore")
def least_gaps(ones: Sequence[Solid], twos: Sequence[Solid], most: int, frames: Array) -> Array:
    """Return the least over the part pairs of the largest gap along any direction that can separate most, (k,), units.

    These are all face normals and the edge x edge directions that are normals of facets of the parts' difference; nan
    where a part pair that may be the nearest has more than `most` pairs of edges. Pairs whose spheres are further apart
    than the least so far are passed over.
    """
    bounds = _ball_gaps(ones, twos, frames).reshape(len(frames), -1)
    least, unknown = np.full(len(frames), np.inf), np.full(len(frames), np.inf)
    for pair in np.argsort(np.fmin.reduce(bounds, axis=0, initial=np.inf)).tolist():
        one, two = ones[pair // len(twos)], twos[pair % len(twos)]
        if len(one.edges) * len(two.edges) > most:
            unknown = np.fmin(unknown, bounds[:, pair])
            continue
        at = np.flatnonzero(bounds[:, pair] <= least)
        share = max(1, CHUNK // (len(one.edges) * len(two.edges)))
        for some in (at[k : k + share] for k in range(0, len(at), share)):
            gaps = _edge_gaps(one, two, frames[some], _face_gaps(one, two, frames[some]))
            least[some] = np.minimum(least[some], gaps)
    return np.where(np.isnan(frames[:, UNIT]) | ~(unknown > least), np.nan, least)


def _ball_gaps(ones: Sequence[Solid], twos: Sequence[Solid], frames: Array) -> Array:
    balls, others = (np.array([solid.ball for solid in solids]) for solids in (ones, twos))
    x, y = placed(balls[:, :3], frames, True), placed(others[:, :3], frames, False)
    apart = _lengths(x[:, :, None] - y[:, None])
    return np.asarray(apart - (frames[:, :1] * balls[:, 3])[:, :, None] - (frames[:, 1:2] * others[:, 3])[:, None])


def _face_gaps(one: Solid, two: Solid, frames: Array) -> Array:
    """Return the largest gap of two parts over their face normals in each frame, (k,)."""
    x, y, turn = placed(one.points, frames, True), placed(two.points, frames, False), _turns(frames).mT
    if len(frames) * (len(one.planes) + len(two.planes)) * (len(one.points) + len(two.points)) > CHUNK:
        normals = (np.concatenate([one.planes[:, :3] @ turn[k], -two.planes[:, :3]]) for k in range(len(frames)))
        return np.array([_largest(*each) for each in zip(normals, x, y, strict=True)])
    n, m = (one.planes[:, :3] @ turn).mT, two.planes[:, :3].T
    return np.asarray(
        np.maximum(
            ((y @ n).min(axis=1) - (x @ n).max(axis=1)).max(axis=1),
            ((x @ m).min(axis=1) - (y @ m).max(axis=1)).max(axis=1),
        )
    )


def _largest(n: Array, x: Array, y: Array) -> float:
    """Return the largest gap of points y from points x along some directions.

    The most hopeful first; those that two points of either part rule out are passed over.
    """
    best, way = -np.inf, y.mean(axis=0) - x.mean(axis=0)
    while len(n):
        hope = n @ (y[(y @ way).argmin()] - x[(x @ way).argmax()])
        n, hope = n[hope > best], hope[hope > best]
        n = n[hope.argsort()]
        n, tried = n[:-HOPEFUL], n[-HOPEFUL:]
        gaps = (y @ tried.T).min(axis=0) - (x @ tried.T).max(axis=0) if len(tried) else np.array([-np.inf])
        if gaps.max() > best:
            best, way = float(gaps.max()), tried[gaps.argmax()]
    return best


def _edge_gaps(one: Solid, two: Solid, frames: Array, best: Array) -> Array:
    """Return the larger of the best gaps so far and those along the directions of pairs of edges, in each frame, (k,).

    Pairs of edges make a facet of the parts' difference only where the arcs between the normals of the faces beside
    them cross: where the faces of either lie on different sides of the other. Others are left out, unless rounding may
    have chosen the side; and parallel ones.
    """
    turn = _turns(frames).mT
    sides, planes, lengths, others = (
        one.edges @ turn,
        one.planes[:, :3] @ turn,
        _lengths(one.edges),
        _lengths(two.edges),
    )
    heights = sides @ two.planes[:, :3].T
    doubt = lengths[:, None] * (DEFAULT.tie + two.planes[:, 4]) + ROUNDING * one.reach
    hands = (heights > doubt).astype(np.int8) - (heights < -doubt)
    apart = hands[..., two.beside[:, 1]] * hands[..., two.beside[:, 2]] > 0
    heights, off = planes @ two.edges.T, DEFAULT.tie + one.planes[one.beside[:, 1:], 4].max(axis=1)
    p, q = heights[:, one.beside[:, 1]], heights[:, one.beside[:, 2]]
    doubt = off[:, None] * others + ROUNDING * two.reach
    apart |= ((p > doubt) & (q > doubt)) | ((p < -doubt) & (q < -doubt))
    k, first, second = np.nonzero(~apart)
    n = _crosses(sides[k, first], two.edges[second])
    length = _lengths(n)
    kept = length > DEFAULT.line * lengths[first] * others[second]
    k, first, second, n = k[kept], first[kept], second[kept], n[kept] / length[kept, None]
    x, y = placed(one.points, frames, True), placed(two.points, frames, False)
    between = _dots(n, y[k, two.beside[second, 0]] - x[k, one.beside[first, 0]])  # no gap along n is wider
    there, back = between > best[k], -between > best[k]
    k, n = np.concatenate([k[there], k[back]]), np.concatenate([n[there], -n[back]])
    share = max(1, CHUNK // (3 * (len(one.points) + len(two.points))))
    for start in range(0, len(k), share):
        here, way = k[start : start + share], n[start : start + share, :, None]
        np.maximum.at(best, here, ((y[here] @ way).min(axis=1) - (x[here] @ way).max(axis=1))[:, 0])
    return best


# ----------------------------------------------------------------------------------------------------- claimed contacts
# A host: vertices of the part of body 1 and of body 2, from the seeds; rows of both elements; the direction, as rows of
# either part, 3 and none, none and 3, or 2 and 2, and its sign.


def _normals(one: Array, two: Array, across: Ints, along: Ints, sign: int, R: Array) -> Array:
    """Return the unit contact normal under each rotation, (k, 3); nan where two edges are parallel."""
    if len(across) == 3:
        u, v = ((one[row] - one[across[0]]) @ R.mT for row in across[1:])
    elif len(along) == 3:
        u, v = two[along[1:]] - two[along[0]]
    else:
        u, v = (one[across[1]] - one[across[0]]) @ R.mT, two[along[1]] - two[along[0]]
    n = np.broadcast_to(_crosses(u, v), (len(R), 3))
    length = _lengths(n)
    length = np.where(length > DEFAULT.tie * _lengths(u) * _lengths(v), length, np.nan)
    return np.asarray(sign * n / length[:, None])


@np.errstate(all="ignore")
def edge_sign(one: Array, two: Array, across: Ints, along: Ints, T: Array) -> int:
    """Return the sign of edge 1 x edge 2 that leads out of part 1: the side on which less of it lies; 0 if parallel."""
    n = _normals(one, two, across, along, 1, T[None, :3, :3])[0]
    if np.isnan(n[0]):
        return 0
    heights = (one - one[across[0]]) @ (n @ T[:3, :3])
    return 1 if heights.max() <= -heights.min() else -1


@np.errstate(all="ignore")
def contact_rows(
    one: Array, two: Array, first: Ints, second: Ints, across: Ints, along: Ints, sign: int, seeds: Array, poses: Array
) -> Array:
    """Return (n, a, b, c) at each pose, (k, 6): the unit normal and the contact line.

    The separation of two claimed vertices along the normal is affine in the scales, c - a rho_1 - b rho_2: three scale
    pairs give it.
    """
    n = _normals(one, two, across, along, sign, poses[:, :3, :3])
    x, y, offset = one[first[0]] @ poses[:, :3, :3].mT, two[second[0]], _offsets(seeds, poses)
    base, wider, longer = (_dots(n, q * y - (offset + p * x)) for p, q in ((1.0, 1.0), (2.0, 1.0), (1.0, 2.0)))
    return np.column_stack([n, base - wider, base - longer, 3.0 * base - wider - longer])


@np.errstate(all="ignore")
def contact_errors(
    one: Array, two: Array, first: Ints, second: Ints, across: Ints, along: Ints, sign: int, seeds: Array,
    pairs: Array, poses: Array,
) -> Array:  # fmt: skip
    """Return how far the claim is from being a real contact at each scale pair and pose, (k,), lengths.

    The largest of: distance of a common point from either element, and how far either part reaches across the plane
    through it; infinite where there is none.
    """
    R = poses[:, :3, :3]
    n = _normals(one, two, across, along, sign, R)[:, :, None]
    x = _offsets(seeds, poses)[:, None] + pairs[:, 0, None, None] * (one @ R.mT)
    y = pairs[:, 1, None, None] * two
    p, q = x[:, first], y[:, second]
    if len(first) == 1:
        point, error = p[:, 0], _off(q, p)[:, 0]
    elif len(second) == 1:
        point, error = q[:, 0], _off(p, q)[:, 0]
    elif len(first) == len(second) == len(across) == len(along) == 2:
        points = _crossings(p[:, 0], p[:, 1], q[:, 0], q[:, 1])[:, None]
        point, error = points[:, 0], np.maximum(_off(p, points), _off(q, points))[:, 0]
    else:
        point, error = _shared(p, q)
    level = (point[:, None] @ n)[:, 0, 0]
    reach = np.maximum((x @ n).max(axis=(1, 2)) - level, level - (y @ n).min(axis=(1, 2)))
    return np.nan_to_num(np.maximum(error, reach), nan=np.inf, posinf=np.inf)


def _offsets(seeds: Array, poses: Array) -> Array:
    return np.asarray(seeds[0] @ poses[:, :3, :3].mT + poses[:, :3, 3] - seeds[1])


def _crossings(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Return the point of each line a b that is nearest to the line c d, (..., 3)."""
    u, v = b - a, d - c
    n = _crosses(u, v)
    return np.asarray(a + (_dots(_crosses(c - a, v), n) / _dots(n, n))[..., None] * u)


def _shared(p: Array, q: Array) -> tuple[Array, Array]:
    """Return a point of each two flush elements, (k, 3), and its distances from both together, (k,).

    A corner of what they share: of one of them, or where their sides cross.
    """
    points = np.concatenate([p, q], axis=1)
    off = np.concatenate([_off(q, p), _off(p, q)], axis=1)
    if (off.min(axis=1) > DEFAULT.line * _lengths(p[:, 1] - p[:, 0])).any():
        ends = (np.stack([own, np.roll(own, -1, axis=1)]) for own in (p, q))
        (a, b), (c, d) = (own if own.shape[2] > 2 else own[:, :, :1] for own in ends)
        crossings = _crossings(a[:, :, None], b[:, :, None], c[:, None], d[:, None]).reshape(len(p), -1, 3)
        points = np.concatenate([points, crossings], axis=1)
        off = np.concatenate([off, _off(p, crossings) + _off(q, crossings)], axis=1)
    off = np.where(np.isnan(off), np.inf, off)
    best = off.argmin(axis=1)
    rows = np.arange(len(p))
    return points[rows, best], off[rows, best]


def _off(element: Array, points: Array) -> Array:
    """Return how far points, (k, m, 3), are from a vertex, a segment or a planar convex polygon, (k, l, 3)."""
    if element.shape[1] == 1:
        return _lengths(points - element)
    ends = np.roll(element, -1, axis=1)
    if element.shape[1] == 2:
        return _off_segments(element[:, :1], ends[:, :1], points)
    base = element[:, :1]
    normal = _crosses(element - base, ends - base).sum(axis=1)
    normal /= _lengths(normal)[:, None]
    height = np.abs(((points - element.mean(axis=1, keepdims=True)) @ normal[:, :, None])[..., 0])
    outward = _crosses(ends - element, normal[:, None])
    outward /= _lengths(outward)[..., None]
    outside = (points @ outward.mT - _dots(element, outward)[:, None]).max(axis=2)
    beyond = outside > 0.0
    if beyond.any():
        nearest = _off_segments(element[:, None], ends[:, None], points[:, :, None]).min(axis=2)
        height = np.where(beyond, np.maximum(height, np.maximum(outside, nearest)), height)
    return np.where(np.isnan(outside), np.nan, height)


def _off_segments(a: Array, b: Array, p: Array) -> Array:
    u, w = b - a, p - a
    t = np.clip(_dots(w, u) / _dots(u, u), 0.0, 1.0)
    return _lengths(w - t[..., None] * u)


# ------------------------------------------------------------------------------------------------------------- vectors


def _turns(frames: Array) -> Array:
    return frames[:, TURN:].reshape(-1, 3, 3)


def _dots(u: Array, v: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", u, v))


def _lengths(u: Array) -> Array:
    return np.asarray(np.sqrt(_dots(u, u)))


def _crosses(u: Array, v: Array) -> Array:
    """Return cross products, in a third of the time that numpy's takes."""
    u, v = np.broadcast_arrays(u, v)
    n = np.empty(u.shape)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        n[..., i] = u[..., j] * v[..., k] - u[..., k] * v[..., j]
    return n
