"""Whether a solid goes through another one on a straight way: seen along it, by the chords of lines in either solid.

On a line along the way a solid is some chords, whether it is kept as its surface or as convex parts, however these are
cut. Where the middle of a chord of the first solid is before that of one of the second, and behind it after the way,
one went through the other. Both solids may change on the way, as by their sizes: each facet's corners go straight on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.geometry.crossings import overlapping
from fcdm_opt.tolerances import DEFAULT

MOST_LINES = 2048  # that are looked at: where facets seen along the way have most in common, and a choice of others
BATCH_SIZE = 1 << 16  # pairs of boxes up to which all are compared
AROUND = np.array([(np.cos(turn), np.sin(turn)) for turn in 0.1 + np.arange(6) * np.pi / 3.0])
"""Lines about one, at a distance of 1."""
NEXT, LAST = [1, 2, 0], [2, 0, 1]  # the corners of a triangle after each, and before it
UNEVEN = np.sqrt(np.arange(2.0, 17.0))  # weights of points that a line is put between: on no line of symmetry


def passes(one: tuple[Array, Array], two: tuple[Array, Array], way: Array, slack: float) -> bool:
    """Tell whether on lines along a way some of the second solid is ahead of the first before, and behind it after.

    Lines lie half-way between before and after. Where what meets on one is displaced across the way, as sizes change,
    all lines round about as far away as that are to tell the same.

    `one` and `two` are the corners, (t, 3, 3), of each solid's facets, counter-clockwise seen from outside, before and
    after; `way`, (3,), how the first is displaced against the second where they meet. Facets within `slack` touch.
    """
    length, frame = float(np.linalg.norm(way)), _frame(way)
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


def _frame(way: Array) -> Array:
    """Return a right-angled frame whose last column is along a way."""
    ahead = way / np.linalg.norm(way)
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
        line, row = _meeting([lines, self.flat.min(axis=1)], [lines, self.flat.max(axis=1)])
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
    rows, low, high = list[Ints](), list[Array](), list[Array]()
    for own, sign, spare in ((one, 1.0, length), (two, -1.0, 0.0)):
        facing = np.flatnonzero(sign * own.areas > slack * slack)
        heights, flat = own.corners[facing, ..., 2].reshape(-1, 6), own.flat[facing]
        low.append(np.column_stack([flat.min(axis=1), heights.min(axis=1) - spare]))
        high.append(np.column_stack([flat.max(axis=1), heights.max(axis=1) - slack]))
        rows.append(facing)
    i, j = _meeting(low, high)
    wide = (np.minimum(high[0][i], high[1][j]) - np.maximum(low[0][i], low[1][j]))[:, :2].min(axis=1)
    order = np.argsort(-wide, kind="stable")[: int((wide > slack).sum())]
    if len(order) > MOST_LINES:
        half = MOST_LINES // 2
        order = order[np.append(np.arange(half), np.linspace(half, len(order) - 1, half).astype(np.int64))]
    return np.column_stack([rows[0][i[order]], rows[1][j[order]]])


def _meeting(low: list[Array], high: list[Array]) -> tuple[Ints, Ints]:
    """Return which boxes of a first list meet which of a second: rows of both."""
    if len(low[0]) * len(low[1]) <= BATCH_SIZE:
        meet = np.ones((len(low[0]), len(low[1])), np.bool_)
        for a, b, c, d in zip(low[0].T, high[0].T, low[1].T, high[1].T, strict=True):
            meet &= (a[:, None] <= d) & (b[:, None] >= c)
        i, j = np.nonzero(meet)
        return i, j
    kinds, found = np.repeat([0, 1], [*map(len, low)]), [np.empty((0, 2), np.int64)]
    found += [np.column_stack(own) for own in overlapping(np.concatenate(low), np.concatenate(high), kinds)]
    both = np.sort(np.concatenate(found), axis=1)
    return both[:, 0], both[:, 1] - len(low[0])


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
