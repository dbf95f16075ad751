# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Compiled: signed distances of part pairs from their contact lines, and what they are over a cell of poses.

At a pose each part pair has its *rows* (n, level, rates), one a facet direction of the Minkowski difference: rows
first[p] to first[p + 1] are those of pair p. At sizes s the differences of points of both parts are
{v : n_i.v >= level_i + rates_i.s}. Its point nearest to zero is as far away as the parts are apart; where zero is
inside, the largest of these right sides is minus the depth. Of bodies that are apart, a gap `along_rows` is the largest
right side, too. The scales (x, y) of both bodies are sizes with the rates (-a, -b), see `fcdm_opt.curve.kernels`.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt.compiling import kernel, often, step
from fcdm_opt.curve.games import game
from fcdm_opt.curve.kernels import (
    _at,
    _dot,
    _entry,
    _length,
    _longer,
    _minus,
    _times,
    _turned,
    _turned_back,
    facet_rows,
)  # fmt: skip
from fcdm_opt.proof.least_distance import _lowest, nearest, nearest_points
from fcdm_opt.tolerances import DEFAULT

SHIFTED, TRACKED, DIRECTED = range(3)  # kinds of witnesses, see `cell_bound`
OTHER, MET, BACK = 0.0, 1.0, 2.0  # kinds of rows, see `pair_gap`
_INF = np.inf
_ALIKE = DEFAULT.nominal  # heights of vertices that differ by less, relative to the part, are a facet's


@often
@kernel
def pair_rows(reals1, ints1, places1, reals2, ints2, places2, pose, pairs):
    """Return the rows of part pairs (i, j), one pair after the other, and where each one's begin."""
    first, count = np.zeros(len(pairs) + 1, np.int64), 0
    rows = np.empty((64 * len(pairs), 6))
    for p in range(len(pairs)):
        i, j = pairs[p, 0], pairs[p, 1]
        own = facet_rows(
            reals1[places1[i, 0] : places1[i + 1, 0]],
            ints1[places1[i, 1] : places1[i + 1, 1]],
            reals2[places2[j, 0] : places2[j + 1, 0]],
            ints2[places2[j, 1] : places2[j + 1, 1]],
            pose,
        )[1]
        if count + len(own) > len(rows):
            rows = _longer(rows, 2 * (count + len(own)))
        for row in own:
            rows[count, :3] = row[:3]
            rows[count, 3], rows[count, 4], rows[count, 5] = row[5], -row[3], -row[4]
            count += 1
        first[p + 1] = count
    return rows[:count], first


@step
def _level(rows, k, sizes, shift):
    """Return the right side of a row, of bodies whose seeds are further apart by `shift`."""
    level = rows[k, 3]
    for j in range(len(sizes)):
        level += rows[k, 4 + j] * sizes[j]
    return level + _dot(_at(rows, k), shift)


@kernel
def pair_gap(rows, start, end, along_rows, sizes, shift, enough, direction):
    """Return a part pair's signed distance, and write the direction that has it; no less than `enough` is asked.

    With a column after the sizes' the first of its rows may be `MET`: of pieces that overlap by all but `BACK` ones it
    is the largest along these.
    """
    # of parts that are apart it is the length of the least vector on the inner side of all planes
    best, widest, before, met = -_INF, start, -_INF, start
    kinds = rows.shape[1] > 4 + len(sizes) and rows[start, 4 + len(sizes)] == MET
    for k in range(start, end):
        level = _level(rows, k, sizes, shift)
        if level > best:
            best, widest = level, k
            if best >= enough and not kinds:
                break
        if kinds and rows[k, 4 + len(sizes)] != BACK:
            before = max(before, level)
        if kinds and rows[k, 4 + len(sizes)] == MET and level > _level(rows, met, sizes, shift):
            met = k
    if kinds and before <= 0.0:
        best, widest = _level(rows, met, sizes, shift), met
    direction[0], direction[1], direction[2] = rows[widest, 0], rows[widest, 1], rows[widest, 2]
    if along_rows or best <= 0.0 or best >= enough:
        return best
    count = end - start
    G, h, v = np.empty((count, 3)), np.empty(count), np.empty(3)
    for k in range(count):
        G[k, 0], G[k, 1], G[k, 2] = _at(rows, start + k)
        h[k] = _level(rows, start + k, sizes, shift) / best
    nearest(G, h, np.zeros(count, np.bool_), count, v, np.empty(count))
    length = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if not length > 1.0:
        return best
    direction[0], direction[1], direction[2] = v[0] / length, v[1] / length, v[2] / length
    return best * length


@often
@kernel
def least_gap(rows, first, along_rows, sizes, shift, likely, direction):
    """Return the least signed distance of the part pairs, and which has it: the likeliest is asked first."""
    own = np.empty(3)
    best, owner = pair_gap(rows, first[likely], first[likely + 1], along_rows, sizes, shift, _INF, direction), likely
    for p in range(len(first) - 1):
        if p != likely:
            gap = pair_gap(rows, first[p], first[p + 1], along_rows, sizes, shift, best, own)
            if gap < best:
                best, owner = gap, p
                direction[0], direction[1], direction[2] = own[0], own[1], own[2]
    return best, owner


@often
@kernel
def gaps(rows, first, along_rows, sizes):
    """Return the signed gap of two bodies at sizes (m, k), the part pair that has each, and its direction, (m, 3)."""
    found, owners, directions = np.empty(len(sizes)), np.zeros(len(sizes), np.int64), np.empty((len(sizes), 3))
    owner = 0
    for k in range(len(sizes)):
        found[k], owner = least_gap(rows, first, along_rows, sizes[k], (0.0, 0.0, 0.0), owner, directions[k])
        owners[k] = owner
    return found, owners, directions


@often
@kernel
def gaps_of_pairs(rows, first, along_rows, sizes):
    """Return the signed distance of every part pair at sizes (m, k), (pairs, m)."""
    found, direction = np.empty((len(first) - 1, len(sizes))), np.empty(3)
    for p in range(len(first) - 1):
        for k in range(len(sizes)):
            still = (0.0, 0.0, 0.0)
            found[p, k] = pair_gap(rows, first[p], first[p + 1], along_rows, sizes[k], still, _INF, direction)
    return found


@step
def _offset(pose, scale, x):
    """Return the way from a point of body 1 to the seed of body 2."""
    return _minus(_entry(pose, 9), _times(scale, _turned(pose, 0, x)))


@step
def _lost(errors, scale, n, x):
    """Return what the linear part of a pose leaves out of the way from a point, along a direction."""
    a, b, c = errors[9], errors[10], errors[11]
    u, v, w = _turned(errors, 0, (abs(x[0]), abs(x[1]), abs(x[2])))
    return abs(n[0]) * (a + scale * u) + abs(n[1]) * (b + scale * v) + abs(n[2]) * (c + scale * w)


@kernel
def _corner_poses(S):
    """Return the linear part of the pose in each corner, variable c being 1 where bit c is set, else -1; then S[0]."""
    k = len(S) - 2
    poses = np.empty(((1 << k) + 1, 12))
    for corner in range(len(poses)):
        for i in range(12):
            poses[corner, i] = S[0, i]
            for c in range(k if corner < len(poses) - 1 else 0):
                poses[corner, i] += S[1 + c, i] if corner >> c & 1 else -S[1 + c, i]
    return poses


@kernel
def _moved_points(points, S, poses, scale, shifts, off):
    """Fill how the way from body 1 to body 2 changes: common shift in each corner, what is off it; return the error.

    For points of body 1 about its seed, at a scale, of which each vertex makes the way d - scale R x. The common shift
    is that of their mean; off it, by each of the cell's variables, no vertex is by more.
    """
    k, error, mean = len(S) - 2, _length(_entry(S[len(S) - 1], 9)), (0.0, 0.0, 0.0)
    if len(points):
        error, mean = 0.0, (points[:, 0].mean(), points[:, 1].mean(), points[:, 2].mean())
    for v in range(len(points)):
        x = _at(points, v)
        for c in range(k):
            off[c] = max(off[c], scale * _length(_turned(S[1 + c], 0, _minus(x, mean))))
        a, b, c = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
        lost = _lost(S[k + 1], scale, a, x), _lost(S[k + 1], scale, b, x), _lost(S[k + 1], scale, c, x)
        error = max(error, _length(lost))
    for corner in range(len(poses)):
        shift = _minus(_offset(poses[corner], scale, mean), _offset(S[0], scale, mean))
        shifts[corner, 0], shifts[corner, 1], shifts[corner, 2] = shift
    return error


@often
@kernel
def cell_bound(one, starts1, two, starts2, counted, rows, first, near, along_rows, S, sizes, low, high):
    """Return a lower bound of how far the worst gap is off the window, over a cell of poses, and what proves it.

    Three kinds of witnesses, each a concave function of the cell's variables but for a constant error, so that a
    mixture of them is least in a corner of the cell:

    - `SHIFTED`, a part pair at a size pair: its gap falls short of `low`. Its signed distance at the centre's rotation
      is a convex function of a shift, and no vertex is off that shift by more than `moved_points` tells.
    - `TRACKED`, the same of parts that overlap all over the cell. The facets of their Minkowski difference, with the
      vertices that they have at the centre, remain a closed surface as these move. As long as none comes as near to
      zero zero as a depth, it winds about the ball of this radius, which so lies in the hull of the moved vertices: the
      parts overlap by as much. A facet is no nearer than its vertices are along a fixed direction, its normal at
      the centre.
    - `DIRECTED`, a direction for each part pair at a size pair: all gaps exceed `high`. Along a fixed direction the gap
      is the least of what the pairs of vertices make of it.

    Over a cell without turns (`still`) a gap along a direction changes by what the shift has along it, so that rows
    alone tell all of the pairs in `near`; without vertices there are no others, and no turns.

    `one` and `two`, (n, 3), are the vertices of both bodies about their seeds, part by part from `starts1`, `starts2`,
    where `sizes`, (m, s), are their scales. Flags, (parts 1, parts 2), tell which part pairs are `counted`. `rows` and
    `first` are at the cell's centre, of the part pairs in `near`, (p, 2), that may have the least gap; with
    `along_rows` the gap of parts that are apart is measured along rows, too. `S`, (k + 2, 12), encloses the relative
    pose: centre, slopes, errors.

    Return the bound over the cell; how far the worst of these gaps is off at its centre; the shares of the witnesses in
    the mixture, (w,); their kinds, (w, 3): kind, part pair (its place in `near`; -1 for a direction each) and size
    pair; directions, (m, pairs, 3), of all part pairs i * parts 2 + j; and how much each variable adds to what is lost
    between centre and bound, (k,).
    """
    k, m = len(S) - 2, len(sizes)
    corners, n1, n2 = 1 << k, len(starts1) - 1, len(starts2) - 1
    poses, here, still = _corner_poses(S), (0.0, 0.0, 0.0), not S[1:, :9].any()
    chosen, count = np.empty((corners + 1, 2), np.int64), 0
    directions, value, scratch = np.empty((m, n1 * n2, 3)), -_INF, np.empty(3)
    shifts, offs, errors = np.empty((m, corners + 1, 3)), np.zeros((m, k)), np.zeros(m)
    worst, of_corner = np.full(corners + 1, -_INF), np.zeros((corners + 1, 2), np.int64)
    likely = 0
    for s in range(m):
        errors[s] = _moved_points(one, S, poses, sizes[s, 0], shifts[s], offs[s])
        gap, likely = least_gap(rows, first, along_rows, sizes[s], here, likely, scratch)
        value = max(value, max(gap - high, low - gap))
        for corner in range(corners + 1 if low > -_INF else 0):
            gap, likely = least_gap(rows, first, along_rows, sizes[s], _at(shifts[s], corner), likely, scratch)
            if low - gap > worst[corner]:
                worst[corner], of_corner[corner, 0], of_corner[corner, 1] = low - gap, likely, s
    for corner in range(corners + 1 if low > -_INF else 0):
        known = False
        for w in range(count):
            known = known or (chosen[w, 0] == of_corner[corner, 0] and chosen[w, 1] == of_corner[corner, 1])
        if not known:
            chosen[count] = of_corner[corner]
            count += 1
    more = m if high < _INF else 0
    W, kinds = np.empty((2 * count + more, corners)), np.empty((2 * count + more, 3), np.int64)
    used = count
    for w in range(count):
        p, s = chosen[w, 0], chosen[w, 1]
        kinds[w, 0], kinds[w, 1], kinds[w, 2] = SHIFTED, p, s
        loss = offs[s].sum() + errors[s]
        for corner in range(corners):
            shift = _at(shifts[s], corner)
            gap = pair_gap(rows, first[p], first[p + 1], along_rows, sizes[s], shift, _INF, scratch)
            W[w, corner] = low - gap - loss
        if still:
            continue
        own = one[starts1[near[p, 0]] : starts1[near[p, 0] + 1]]
        if _set_tracked(W[used], S, poses, own, rows, first[p], first[p + 1], sizes[s, 0], sizes[s, 1], low):
            kinds[used, 0], kinds[used, 1], kinds[used, 2] = TRACKED, p, s
            used += 1
    for s in range(more):
        directions[s], W[used] = np.nan, _INF
        kinds[used, 0], kinds[used, 1], kinds[used, 2] = DIRECTED, -1, s
        for p in range(len(near)):
            gap = pair_gap(rows, first[p], first[p + 1], along_rows, sizes[s], here, _INF, scratch)
            if n1:
                directions[s, near[p, 0] * n2 + near[p, 1]] = scratch
            for corner in range(corners if still else 0):
                along = _dot(_at(shifts[s], corner), _entry(scratch, 0))
                W[used, corner] = min(W[used, corner], gap + along - errors[s] - high)
        for code in range(n1 * n2):
            i, j = code // n2, code % n2
            x, y, known = sizes[s, 0], sizes[s, 1], not np.isnan(directions[s, code, 0])
            if not counted[i, j]:
                directions[s, code] = 0.0
                continue
            if known and still:
                continue
            own, other = one[starts1[i] : starts1[i + 1]], two[starts2[j] : starts2[j + 1]]
            if not known:
                _set_far_direction(S[0], own, other, x, y, directions[s, code])
            _narrow(W[used], S, poses, own, other, x, y, _at(directions[s], code), high)
        used += 1
    W, kinds = W[:used], kinds[:used]
    shares = game(W)
    mixed = np.zeros(corners)
    for w in range(len(shares)):
        mixed += shares[w] * W[w]
    scores = np.zeros(k)
    for c in range(k):
        for corner in range(corners):
            scores[c] += abs(mixed[corner] - mixed[corner ^ (1 << c)]) / (2.0 * corners)
        for w in range(count):
            scores[c] += shares[w] * offs[kinds[w, 2], c]
    return mixed.min(), value, shares, kinds, directions, scores


@kernel
def _set_far_direction(pose, one, two, x, y, direction):
    """Write the direction along which two parts are furthest apart, any where they are not."""
    moved = np.empty_like(one)
    for v in range(len(one)):
        moved[v, 0], moved[v, 1], moved[v, 2] = _times(-1.0, _offset(pose, x, _at(one, v)))
    between = nearest_points(moved, y * two)[0]
    n = _times(1.0 / _length(between), between) if _length(between) > 0.0 else (1.0, 0.0, 0.0)
    direction[0], direction[1], direction[2] = n


@kernel
def _set_tracked(values, S, poses, one, rows, start, end, x, y, low):
    """Write, in each corner, `low` and how deep two parts overlap at least by the facets they have at the centre.

    Return whether that is anywhere more than nothing: else the facets need not remain about zero.
    """
    values[:] = _INF
    extent = 0.0
    for v in range(len(one)):
        extent = max(extent, abs(one[v, 0]) + abs(one[v, 1]) + abs(one[v, 2]))
    for f in range(start, end):
        n = _at(rows, f)
        own = _turned_back(S[0], 0, _times(-1.0, n))
        deepest = _lowest(one, own)[1] + _ALIKE * extent
        for v in range(len(one)):
            if _dot(own, _at(one, v)) > deepest:
                continue
            level = -rows[f, 5] * y - _lost(S[len(S) - 1], x, n, _at(one, v))
            for corner in range(len(values)):
                values[corner] = min(values[corner], low + level - _dot(n, _offset(poses[corner], x, _at(one, v))))
        if rows[f, 3] + rows[f, 4] * x + rows[f, 5] * y >= 0.0 or not values.min() > low:
            return False
    return True


@kernel
def _narrow(values, S, poses, one, two, x, y, n, high):
    """Lower, in each corner, values to the gap of a part pair along a direction, less errors and `high`."""
    error = 0.0
    for v in range(len(one)):
        error = max(error, _lost(S[len(S) - 1], x, n, _at(one, v)))
    level = y * _lowest(two, n)[1] - error - high
    for corner in range(len(values)):
        back = _turned_back(poses[corner], 0, _times(-1.0, n))
        gap = _dot(n, _entry(poses[corner], 9)) + x * _lowest(one, back)[1] + level
        values[corner] = min(values[corner], gap)
