"""Compiled: what is on the boundary of a union of overlap regions, as stretches of lines, joined to chains.

`limits` are (tie, line, nominal) of `Tolerances` and the least scale that lines are compared at.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt.compiling import kernel, light
from fcdm_opt.curve.kernels import _longer


@light
@kernel
def interval(lines, base, travel, limits):
    """Return what `inside` does, from the lines of a region with a boundary; limits as `_LIMITS`."""
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


@kernel
def visible(lines, line_starts, pieces, piece_starts, parts, cells, members, shares, limits):
    """Return what is on the boundary of a union: (owner, spans, chains, alone).

    owner (m, 4): region, piece of it, 1 where it is snug, 1 where another piece was dropped for it; spans (m, 2): its
    stretch; chain c is rows chains[c] to chains[c + 1]. alone (k, 3): region, piece of it and where on it a point is
    that no open region holds, off all stretches; once for each piece that passes there.
    """
    region_of = np.empty(len(pieces), np.int64)
    for region in range(len(piece_starts) - 1):
        region_of[piece_starts[region] : piece_starts[region + 1]] = region
    found, used = np.empty((64, 3)), 0
    points, marked = np.empty((16, 2)), 0
    most = 2 * len(members) + 2  # one that grazes leaves a point besides
    left, room = np.empty((most, 2)), np.empty((most, 2))
    for cell in range(len(cells)):
        for m in range(shares[cell], shares[cell + 1]):
            own = members[m]
            for piece in range(piece_starts[own], piece_starts[own + 1]):
                base, travel = (pieces[piece, 0], pieces[piece, 1]), (pieces[piece, 2], pieces[piece, 3])
                left[0, 0], left[0, 1] = _within(base, travel, pieces[piece, 4], pieces[piece, 5], cells[cell])
                count = 1 if left[0, 0] < left[0, 1] else 0
                scale = max(np.abs(base[0]) + np.abs(base[1]), limits[3])
                for k in range(shares[cell], shares[cell + 1]):
                    other = members[k]
                    if count == 0:
                        break
                    if other != own and line_starts[other] < line_starts[other + 1]:  # not an empty one
                        lo, hi = interval(lines[line_starts[other] : line_starts[other + 1]], base, travel, limits)
                        count = _take_out(left, room, count, lo, hi, limits[1], scale, True)
                for k in range(count):
                    if left[k, 0] == left[k, 1]:
                        if marked == len(points):
                            points = _longer(points, 2 * len(points))
                        points[marked, 0], points[marked, 1] = piece, left[k, 0]
                        marked += 1
                        continue
                    if used == len(found):
                        found = _longer(found, 2 * len(found))
                    found[used, 0], found[used, 1], found[used, 2] = piece, left[k, 0], left[k, 1]
                    used += 1
    kept = _without_repeats(_merged(found[:used]), pieces, limits)
    order, chains = _chained(kept, pieces, region_of, parts, limits[2])
    owner, spans = np.empty((len(order), 4), np.int64), np.empty((len(order), 2))
    for k in range(len(order)):
        piece = int(kept[order[k], 0])
        own = region_of[piece]
        owner[k, 0], owner[k, 1] = own, piece - piece_starts[own]
        owner[k, 2], owner[k, 3] = int(kept[order[k], 3]), int(kept[order[k], 4])
        spans[k, 0], spans[k, 1] = kept[order[k], 1], kept[order[k], 2]
    return owner, spans, chains, _alone(points[:marked], kept, pieces, region_of, piece_starts, limits)


@kernel
def _alone(points, kept, pieces, region_of, piece_starts, limits):
    """Return which points of pieces lie on none of the stretches, (k, 3), see `visible`."""
    made, count = np.empty((len(points), 3)), 0
    for k in range(len(points)):
        piece, s = int(points[k, 0]), points[k, 1]
        x, y = pieces[piece, 0] + s * pieces[piece, 2], pieces[piece, 1] + s * pieces[piece, 3]
        near, free = limits[2] * (np.abs(x) + np.abs(y)), True
        for m in range(len(kept)):
            other = int(kept[m, 0])
            u, v = x - pieces[other, 0], y - pieces[other, 1]
            along = u * pieces[other, 2] + v * pieces[other, 3]
            place = min(max(along, kept[m, 1]), kept[m, 2])
            if np.hypot(u - place * pieces[other, 2], v - place * pieces[other, 3]) <= near:
                free = False
                break
        if free:
            own = region_of[piece]
            made[count, 0], made[count, 1], made[count, 2] = own, piece - piece_starts[own], s
            count += 1
    return made[:count]


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


@kernel
def _take_out(spans, room, count, lo, hi, sliver, scale, points):
    """Take an open interval out of closed ones; return how many are left.

    Slivers within rounding are dropped, or with `points` kept as intervals that end where they start.
    """
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


@kernel
def _merged(found):
    """Return stretches by piece and start, those joined that cells have parted."""
    order = np.argsort(found[:, 1], kind="mergesort")
    order = order[np.argsort(found[order, 0], kind="mergesort")]
    made, count = np.empty((len(found), 3)), 0
    for k in order:
        if count and made[count - 1, 0] == found[k, 0] and found[k, 1] <= made[count - 1, 2]:
            made[count - 1, 2] = max(made[count - 1, 2], found[k, 2])
        else:
            made[count] = found[k]
            count += 1
    return made[:count]


@kernel
def _without_repeats(spans, pieces, limits):
    """Keep one of the stretches that coincide, (k, 5): piece, lo, hi, then 1 or 0.

    1 where overlap on both sides makes it snug, and where another was dropped for it or part of it.
    """
    kept, count = np.zeros((4 * len(spans) + 4, 5)), 0
    rest, room, some = np.empty((len(spans) + 4, 2)), np.empty((len(spans) + 4, 2)), np.empty((2, 2))
    for k in range(len(spans)):
        piece = int(spans[k, 0])
        scale = max(np.abs(pieces[piece, 0]) + np.abs(pieces[piece, 1]), limits[3])
        rest[0, 0], rest[0, 1] = spans[k, 1], spans[k, 2]
        left, before = 1, count
        for known in range(before):
            other = int(kept[known, 0])
            if other < 0 or not _collinear(pieces, piece, other, limits):
                continue
            same = 1.0 if pieces[piece, 2] * pieces[other, 2] + pieces[piece, 3] * pieces[other, 3] > 0.0 else -1.0
            lo, hi = kept[known, 1], kept[known, 2]
            if same < 0.0:
                lo, hi = -hi, -lo
            touched = False
            for r in range(left):
                some[0] = rest[r]
                touched |= _take_out(some, room, 1, lo, hi, limits[1], scale, False) != 1 or (some[0] != rest[r]).any()
            if not touched:
                continue
            if same < 0.0:
                begin, stop = max(kept[known, 1], -spans[k, 2]), min(kept[known, 2], -spans[k, 1])
                some[0, 0], some[0, 1] = kept[known, 1], kept[known, 2]
                outside = _take_out(some, room, 1, begin, stop, limits[1], scale, False)
                if count + outside + 1 > len(kept):
                    kept = _longer(kept, 2 * len(kept))
                for r in range(outside):
                    kept[count, 0], kept[count, 1], kept[count, 2] = other, some[r, 0], some[r, 1]
                    kept[count, 3], kept[count, 4] = kept[known, 3], kept[known, 4]
                    count += 1
                kept[count, 0], kept[count, 1], kept[count, 2], kept[count, 3] = other, begin, stop, 1.0
                kept[count, 4] = kept[known, 4]
                count += 1
                kept[known, 0] = -1.0
            else:
                kept[known, 4] = 1.0
            left = _take_out(rest, room, left, lo, hi, limits[1], scale, False)
        while count + left > len(kept):
            kept = _longer(kept, 2 * len(kept))
        for r in range(left):
            kept[count, 0], kept[count, 1], kept[count, 2], kept[count, 3] = piece, rest[r, 0], rest[r, 1], 0.0
            kept[count, 4] = 0.0
            count += 1
    return kept[:count][kept[:count, 0] >= 0.0]


@kernel
def _collinear(pieces, one, two, limits):
    """Tell whether two pieces lie on one line."""
    if np.abs(pieces[one, 2] * pieces[two, 3] - pieces[one, 3] * pieces[two, 2]) > limits[2]:
        return False
    apart = np.abs(pieces[one, 0] - pieces[two, 0]) + np.abs(pieces[one, 1] - pieces[two, 1])
    return apart <= limits[2] * max(np.abs(pieces[one, 0]) + np.abs(pieces[one, 1]), limits[3])


@kernel
def _chained(kept, pieces, region_of, parts, near):
    """Join stretches where one ends and another starts, snug ones apart; return their order and where chains start."""
    count = len(kept)
    order, chains = np.empty(count, np.int64), np.empty(count + 1, np.int64)
    free, row = np.ones(count, np.bool_), np.empty(count, np.int64)
    used, made = 0, 0
    for first in range(count):
        if not free[first]:
            continue
        free[first] = False
        row[0], length = first, 1
        for forward in (True, False):
            while True:
                tip = row[length - 1] if forward else row[0]
                place = _end(kept, pieces, tip, forward)
                found, akin = -1, False
                for k in range(count):
                    if not free[k] or kept[k, 3] != kept[first, 3]:
                        continue
                    if not _same_pair(_end(kept, pieces, k, not forward), place, near):
                        continue
                    one, two = region_of[int(kept[k, 0])], region_of[int(kept[tip, 0])]
                    kin = parts[one, 0] == parts[two, 0] and parts[one, 1] == parts[two, 1]
                    if found < 0 or (kin and not akin):
                        found, akin = k, kin
                if found < 0:
                    break
                free[found] = False
                if forward:
                    row[length] = found
                else:
                    for k in range(length, 0, -1):
                        row[k] = row[k - 1]
                    row[0] = found
                length += 1
        chains[made] = used
        made += 1
        order[used : used + length] = row[:length]
        used += length
    chains[made] = used
    return order, chains[: made + 1]


@kernel
def _end(kept, pieces, k, last):
    """Return the scale pair at the end or start of a stretch."""
    piece = int(kept[k, 0])
    s = kept[k, 2] if last else kept[k, 1]
    x = pieces[piece, 0] + (s * pieces[piece, 2] if pieces[piece, 2] != 0.0 else 0.0)
    y = pieces[piece, 1] + (s * pieces[piece, 3] if pieces[piece, 3] != 0.0 else 0.0)
    return x, y


@kernel
def _same_pair(p, q, near):
    size = np.abs(p[0]) + np.abs(p[1]) + np.abs(q[0]) + np.abs(q[1])
    return size < np.inf and np.abs(p[0] - q[0]) + np.abs(p[1] - q[1]) < near * size
