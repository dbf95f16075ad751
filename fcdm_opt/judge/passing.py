"""Whether a solid goes through another one: by planes between convex parts, else by chords of lines along the way.

Where convex parts stay divided by planes along a motion, or only come apart, none goes through another.

On a line along the way a solid is some chords, whether it is kept as its surface or as convex parts, however these are
cut. Where the middle of a chord of the first solid is before that of one of the second, and behind it after the way,
one went through the other. Both solids may change on the way, as by their sizes: each facet's corners go straight on.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.crossings import overlapping_between
from fcdm_opt.geometry.solids import kept_as_surface
from fcdm_opt.tolerances import DEFAULT

MOST_LINES = 2048  # that are looked at: where facets seen along the way have most in common, and a choice of others
AROUND = np.array([(np.cos(turn), np.sin(turn)) for turn in 0.1 + np.arange(6) * np.pi / 3.0])
"""Lines about one, at a distance of 1."""
NEXT, LAST = [1, 2, 0], [2, 0, 1]  # the corners of a triangle after each, and before it
UNEVEN = np.sqrt(np.arange(2.0, 17.0))  # weights of points that a line is put between: on no line of symmetry


def passes(one: tuple[Array, Array], two: tuple[Array, Array], shift: Array, slack: float) -> bool:
    """Tell whether on lines along a way some of the second solid is ahead of the first before, and behind it after.

    Lines lie half-way between before and after. Where what meets on one is displaced across the way, as sizes change,
    all lines round about as far away as that are to tell the same.

    `one` and `two` are the corners, (t, 3, 3), of each solid's facets, counter-clockwise seen from outside, before and
    after; `shift`, (3,), how the first is displaced against the second where they meet. Facets within `slack` touch.
    """
    length, frame = float(np.linalg.norm(shift)), _frame(shift)
    first, second = (_Seen.along(*own, frame) for own in (one, two))
    pairs = _crossed(first, second, length, slack)
    if not len(pairs):
        return False
    lines, radii = _lines(first, second, pairs, length)
    if not (len(lines) and (past := _past(first, second, lines, slack)).any()):
        return False
    lines, radii = lines[past], radii[past]
    around = _past(first, second, (lines[:, None] + radii[:, None, None] * AROUND).reshape(-1, 2), slack)
    return bool((around.reshape(-1, len(AROUND)).all(axis=1) | (radii <= slack)).any())


def past_after(one: Array, two: Array, ahead: Array, slack: float) -> float:
    """Return how far the first solid goes along a unit vector until it is past some of the second; else infinite."""
    # solids as of `passes`, at rest, (t, 3, 3); `slack` as there
    length = float(np.ptp(np.concatenate([one, two]).reshape(-1, 3), axis=0).sum())  # beyond all of it
    first, second = (_Seen.along(*own, _frame(ahead)) for own in ((one, one + length * ahead), (two, two)))
    pairs = _crossed(first, second, length, slack)
    if not len(pairs):
        return np.inf
    apart = -_between(first, second, _lines(first, second, pairs, length)[0], slack)[1][:, 0]
    return float(apart[apart > slack].min(initial=np.inf))


def _frame(shift: Array) -> Array:
    """Return a right-angled frame whose last column is along a way."""
    ahead = shift / np.linalg.norm(shift)
    across = np.linalg.svd(ahead[None])[2][1]
    return np.column_stack([across, np.cross(ahead, across), ahead])


class _Seen(NamedTuple):
    """Facets as seen along a way, half-way between before and after."""

    corners: Array  # before and after, the way along the last axis, (t, 2, 3, 3)
    flat: Array  # half-way, across the way, (t, 3, 2)
    areas: Array  # twice those, negative where a facet looks back, (t,)

    @classmethod
    def along(cls, before: Array, after: Array, frame: Array) -> _Seen:
        """Return facets, (t, 3, 3) each, as seen along the last column of a rotation."""
        corners = np.stack([before @ frame, after @ frame], axis=1)
        flat = corners[..., :2].mean(axis=1)
        (a, b), (c, d) = (flat[:, 1] - flat[:, 0]).T, (flat[:, 2] - flat[:, 0]).T
        return cls(corners, flat, a * d - b * c)

    def shares(self, rows: Ints, points: Array) -> Array:
        """Return which shares of a facet's corners make up points across the way, (k, m, 3), of points (k, m, 2)."""
        x, y = np.moveaxis(self.flat[rows][:, None] - points[:, :, None], -1, 0)
        doubled = x[..., NEXT] * y[..., LAST] - y[..., NEXT] * x[..., LAST]
        return doubled / self.areas[rows][:, None, None]

    def heights(self, rows: Ints, shares: Array) -> Array:
        """Return how far along the way such points are before and after, (k, m, 2)."""
        return np.einsum("kms,kes->kme", shares, self.corners[rows, ..., 2])

    def across(self, rows: Ints, shares: Array) -> Array:
        """Return how far one such point each, of shares (k, 3), is displaced across the way, (k, 2)."""
        return np.einsum("ks,ksx->kx", shares, self.corners[rows, 1, :, :2] - self.corners[rows, 0, :, :2])

    def chords(self, lines: Array, slack: float) -> tuple[Ints, Array]:
        """Return where lines along the way are inside: of which line, (k,), in order, and the middles, (k, 2)."""
        # before and after. Convex parts side by side are one. None of a line through an edge that facets do not tell
        # apart
        line, row = overlapping_between(lines, lines, self.flat.min(axis=1), self.flat.max(axis=1)).T
        row, line = (own[np.abs(self.areas[row]) > slack * slack] for own in (row, line))
        shares = self.shares(row, lines[line][:, None])
        inside = shares.min(axis=(1, 2)) >= 0.0
        row, line = row[inside], line[inside]
        heights, sign = self.heights(row, shares[inside])[:, 0], -np.sign(self.areas[row])
        closed = np.bincount(line, sign, len(lines))[line] == 0.0
        line, heights, sign = line[closed], heights[closed], sign[closed]
        order = np.lexsort((heights.sum(axis=1) / 2.0 - slack * sign, line))
        line, heights, sign = line[order], heights[order], sign[order]
        depth = np.cumsum(sign)
        starts, ends = (sign > 0.0) & (depth == 1.0), (sign < 0.0) & (depth == 0.0)
        return line[starts], (heights[starts] + heights[ends]) / 2.0


def _crossed(one: _Seen, two: _Seen, length: float, slack: float) -> Ints:
    """Return which facets that look ahead may cross ones of the second that look back, (k, 2), widest first."""
    # those that cross are ahead before, or behind by no more than the length of the way, and behind after it
    rows, boxes = list[Ints](), list[Array]()
    for own, sign, raised in ((one, 1.0, length), (two, -1.0, 0.0)):
        facing = np.flatnonzero(sign * own.areas > slack * slack)
        heights, flat = own.corners[facing, ..., 2].reshape(-1, 6), own.flat[facing]
        boxes.append(np.column_stack([flat.min(axis=1), heights.min(axis=1) - raised]))
        boxes.append(np.column_stack([flat.max(axis=1), heights.max(axis=1) - slack]))
        rows.append(facing)
    low, high, under, over = boxes
    i, j = overlapping_between(low, high, under, over).T
    wide = (np.minimum(high[i], over[j]) - np.maximum(low[i], under[j]))[:, :2].min(axis=1)
    order = np.argsort(-wide, kind="stable")[: int((wide > slack).sum())]
    if len(order) > MOST_LINES:
        half = MOST_LINES // 2
        order = order[np.append(np.arange(half), np.linspace(half, len(order) - 1, half).astype(np.int64))]
    return np.column_stack([rows[0][i[order]], rows[1][j[order]]])


def _lines(one: _Seen, two: _Seen, pairs: Ints, length: float) -> tuple[Array, Array]:
    """Return a line through what each pair of facets shares as seen along the way, (k, 2), and its slack, (k,)."""
    # where the second is ahead of the first before, or behind by no more than the length, and behind it after; none for
    # pairs without such a place. The slack is half of how far what meets there is displaced across the way
    i, j = pairs.T
    corners = one.flat[i][:, :, None], two.flat[j][:, None]
    sides = corners[0][:, NEXT] - corners[0], corners[1][:, :, NEXT] - corners[1]
    (ux, uy), (vx, vy), (dx, dy) = (np.moveaxis(own, -1, 0) for own in (*sides, corners[1] - corners[0]))
    with np.errstate(all="ignore"):  # sides in parallel do not cross
        place = np.clip(np.nan_to_num((dx * vy - dy * vx) / (ux * vy - uy * vx)), -1.0, 2.0)
    crossings = (corners[0] + place[..., None] * sides[0]).reshape(-1, 9, 2)
    points = np.concatenate([one.flat[i], two.flat[j], crossings], axis=1)
    shares = one.shares(i, points), two.shares(j, points)
    common = np.minimum(*(own.min(axis=2) for own in shares)) >= -DEFAULT.nominal
    ahead, behind = np.moveaxis(two.heights(j, shares[1]) - one.heights(i, shares[0]), -1, 0)
    asked = common & (ahead > -length) & (behind < 0.0)
    rows = np.flatnonzero(asked.any(axis=1))
    i, j, points = i[rows], j[rows], points[rows]
    # well inside of what is asked, or of what is common where that is all of it
    weights = [own[rows] * UNEVEN for own in (asked, common)]
    near, all_ = ((own[..., None] * points).sum(axis=1) / own.sum(axis=1)[:, None] for own in weights)
    lines = 0.9 * near + 0.1 * all_
    moved = (own.across(k, own.shares(k, lines[:, None])[:, 0]) for own, k in ((one, i), (two, j)))
    return lines, np.linalg.norm(next(moved) - next(moved), axis=1) / 2.0


def _past(one: _Seen, two: _Seen, lines: Array, slack: float) -> Flags:
    """Tell on which lines the middle of a chord of the first is before that of one of the second, then behind it."""
    line, between = _between(one, two, lines, slack)
    found = np.zeros(len(lines), np.bool_)
    found[line[(between[:, 0] < -slack) & (between[:, 1] > slack)]] = True
    return found


def _between(one: _Seen, two: _Seen, lines: Array, slack: float) -> tuple[Ints, Array]:
    """Return for each two chords on a line the line, (k,), and how far ahead the first's middle is, (k, 2)."""
    (line, middles), (other, centres) = (own.chords(lines, slack) for own in (one, two))
    first, last = (np.searchsorted(other, line, side=side) for side in ("left", "right"))
    counts = last - first
    i = np.repeat(np.arange(len(line)), counts)
    j = np.arange(len(i)) - np.repeat(np.cumsum(counts) - counts - first, counts)
    return line[i], middles[i] - centres[j]


MOST_PAIRS = 256  # pairs of convex parts up to which planes between them are looked for

Sizes = list[tuple[Body, Body, float, float]]  # of both bodies: as drawn, as made, and at which scale each


class _HalfSpaces(NamedTuple):
    """Convex parts about a body's seed: corners, (n, 3), facets' normals and levels, (f, 3), (f,); the parts' first."""

    seed: Array
    points: Array
    normals: Array
    levels: Array
    corners: Ints
    facets: Ints

    def is_like(self, other: _HalfSpaces) -> bool:
        """Tell whether another body has as many corners and facets, and these look alike."""
        same = self.points.shape == other.points.shape and np.array_equal(self.facets, other.facets)
        same = same and np.array_equal(self.seed, other.seed) and self.normals.shape == other.normals.shape
        return same and np.abs(self.normals - other.normals).max() <= DEFAULT.tie


@lru_cache(maxsize=16)
def _half_spaces(body: Body) -> _HalfSpaces:
    normals, points = np.concatenate([part.normals for part in body.parts]), [part.vertices for part in body.parts]
    levels = np.concatenate([part.levels for part in body.parts]) - normals @ body.seed
    firsts = (np.cumsum([0, *own[:-1]]) for own in ([*map(len, points)], [len(part.loops) for part in body.parts]))
    return _HalfSpaces(body.seed, np.concatenate(points) - body.seed, normals, levels, *firsts)


def stay_divided(sizes: Sizes, shares: Array, poses: Array, slack: float) -> bool:
    """Tell whether every two convex parts have the plane of a facet between them at both ends of each step.

    Seen from the body that the facet is of, the other one's corners are taken to go straight on in a step, as `passes`
    takes them, and sizes move planes and corners in proportion: a plane that is between two parts at both ends is so
    all along. Of parts that overlap at first it is enough that they do so less and less, until they are apart, along
    the facet's normal on which they are the least deep in each other: they go back where they came from.

    `shares`, (s,), are of the way, at the ends of the steps, `poses`, (s, 4, 4), of body 1 there; `slack` is a length
    by which a corner may be beyond a plane.
    """
    (drawn, made, *_), (other, others, *_) = sizes
    if kept_as_surface(drawn, other) or len(made.parts) * len(others.parts) > MOST_PAIRS:
        return False
    was, now = ([_half_spaces(own) for own in both] for both in ((drawn, other), (made, others)))
    if not all(x is y or x.is_like(y) for x, y in zip(was, now, strict=True)):
        return False
    both = [
        ((1.0 - shares)[:, None] * before, x, shares[:, None] * after, y)
        for (_, _, before, after), x, y in zip(sizes, was, now, strict=True)
    ]
    corners = [a[..., None] * x.points + b[..., None] * y.points for a, x, b, y in both]
    levels = [a * x.levels + b * y.levels for a, x, b, y in both]
    (one, two), turns = now, poses[:, :3, :3]
    offsets = (turns @ one.seed + poses[:, :3, 3] - two.seed)[:, None]
    seen = corners[0] @ turns.transpose(0, 2, 1) + offsets, (corners[1] - offsets) @ turns  # each from the other body
    gaps = [
        np.minimum.reduceat(points @ own.normals.T - heights[:, None], its.corners, axis=1)
        for points, its, own, heights in zip(seen, (one, two), (two, one), levels[::-1], strict=True)
    ]
    widest = [np.maximum.reduceat(own[0], its.facets, axis=1) for own, its in zip(gaps, (two, one), strict=True)]
    start = np.maximum(widest[0], widest[1].T) - slack
    divided = [
        _divided(own, its.facets, first, slack)
        for own, its, first in zip(gaps, (two, one), (start, start.T), strict=True)
    ]
    return bool((divided[0] | divided[1].transpose(0, 2, 1)).all())


def _divided(gaps: Array, facets: Ints, start: Array, slack: float) -> Flags:
    """Tell of gaps of parts to planes, (s, k, f), which of another one's is between two parts in each step."""
    # or else is one to which the gap is `start`, (k, l), at first, grows in every step, and is none at last
    above = gaps >= -slack
    parting = (gaps[1:] >= gaps[:-1] - slack).all(axis=0) & above[-1]
    first = np.repeat(start, np.diff(facets, append=gaps.shape[2]), axis=1)
    return np.logical_or.reduceat((above[1:] & above[:-1]) | (parting & (gaps[0] >= first)), facets, axis=2)
