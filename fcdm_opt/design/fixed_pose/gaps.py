# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Compiled: signed distances of part pairs from their contact lines, what they are over a cell of poses, matrix games.

At a pose each part pair has its *rows* (n, a, b, c), one a facet direction of the Minkowski difference, see
`fcdm_opt.curve.kernels`: rows first[p] to first[p + 1] are those of pair p. At scales (x, y) the differences of points
of both parts are {v : n_i.v >= c_i - a_i x - b_i y}. Its point nearest to zero is as far away as the parts are apart;
where zero is inside, the largest of these right sides is minus the depth.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt.compiling import kernel, step
from fcdm_opt.curve.kernels import facet_rows
from fcdm_opt.tolerances import DEFAULT

SHIFTED, TRACKED, DIRECTED = range(3)  # kinds of witnesses, see `cell_bound`
_INF = np.inf
_ROUNDING = 64.0 * 2.0**-53  # of a right side, relative to the lengths that enter: it takes five operations
_ALIKE = DEFAULT.nominal  # heights of vertices that differ by less, relative to the part, are a facet's
_FLAT = 2.0**-40  # directions whose determinant is below this do not fix a point: rounding would
_ROUNDS = 64  # planes that take turns in holding the nearest point: each round moves it further out


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
            wider = np.empty((2 * (count + len(own)), 6))
            wider[:count] = rows[:count]
            rows = wider
        rows[count : count + len(own)] = own
        count += len(own)
        first[p + 1] = count
    return rows[:count], first


# ------------------------------------------------------------------------------------------------ one part pair's gap


@step
def _along(rows, k, v):
    return rows[k, 0] * v[0] + rows[k, 1] * v[1] + rows[k, 2] * v[2]


@step
def _level(rows, k, x, y, shift):
    """Return the right side of a row, of bodies whose seeds are further apart by `shift`."""
    return rows[k, 5] - rows[k, 3] * x - rows[k, 4] * y + _along(rows, k, shift)


@step
def _held_by(rows, held, levels, mask):
    """Return (whether there is one, the point nearest to zero on some of four planes)."""
    i = j = l = -1  # noqa: E741
    for m in range(4):
        if mask >> m & 1:
            if i < 0:
                i = m
            elif j < 0:
                j = m
            else:
                l = m  # noqa: E741
    p = rows[held[i], 0], rows[held[i], 1], rows[held[i], 2]
    if j < 0:
        return True, (levels[i] * p[0], levels[i] * p[1], levels[i] * p[2])
    q = rows[held[j], 0], rows[held[j], 1], rows[held[j], 2]
    w = p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]
    if l < 0:
        square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
        if not square > _FLAT:
            return False, (0.0, 0.0, 0.0)
        r, own = w, 0.0
    else:
        r, own = (rows[held[l], 0], rows[held[l], 1], rows[held[l], 2]), levels[l]
    u = q[1] * r[2] - q[2] * r[1], q[2] * r[0] - q[0] * r[2], q[0] * r[1] - q[1] * r[0]
    t = r[1] * p[2] - r[2] * p[1], r[2] * p[0] - r[0] * p[2], r[0] * p[1] - r[1] * p[0]
    volume = u[0] * p[0] + u[1] * p[1] + u[2] * p[2]
    if not abs(volume) > _FLAT:
        return False, (0.0, 0.0, 0.0)
    a, b, c = levels[i] / volume, levels[j] / volume, own / volume
    return True, (
        a * u[0] + b * t[0] + c * w[0],
        a * u[1] + b * t[1] + c * w[1],
        a * u[2] + b * t[2] + c * w[2],
    )


@kernel
def pair_gap(rows, start, end, x, y, shift, enough, way):
    """Return the signed distance of a part pair, and write the direction that has it; no less than `enough` is asked.

    From the widest facet direction on, the plane that the point nearest to zero lies furthest behind joins those that
    hold it, three at most: the nearest point on them moves out until it lies behind none.
    """
    best, widest = -_INF, start
    for k in range(start, end):
        level = _level(rows, k, x, y, shift)
        if level > best:
            best, widest = level, k
            if best >= enough:
                break
    way[0], way[1], way[2] = rows[widest, 0], rows[widest, 1], rows[widest, 2]
    if best <= 0.0 or best >= enough:
        return best
    held, levels, count = np.empty(4, np.int64), np.empty(4), 1
    held[0], levels[0] = widest, best
    v = best * rows[widest, 0], best * rows[widest, 1], best * rows[widest, 2]
    length = best
    for _ in range(_ROUNDS):
        most, worst = 0.0, -1
        for k in range(start, end):
            # what rounding leaves of a plane through the point is not behind it
            size = abs(rows[k, 5]) + abs(rows[k, 3]) * x + abs(rows[k, 4]) * y + length
            behind = _level(rows, k, x, y, shift) - _along(rows, k, v)
            if behind > most and behind > _ROUNDING * size:
                most, worst = behind, k
        if worst < 0:
            break
        held[count], levels[count] = worst, _level(rows, worst, x, y, shift)
        count += 1
        nearest, chosen, point = _INF, 0, v
        for mask in range(1 << (count - 1), 1 << count):  # those with the new one
            if count == 4 and mask == 15:
                continue
            there, candidate = _held_by(rows, held, levels, mask)
            if not there:
                continue
            square = candidate[0] ** 2 + candidate[1] ** 2 + candidate[2] ** 2
            if square >= nearest:
                continue
            inside = True
            for m in range(count):
                if not mask >> m & 1:
                    slack = _ROUNDING * (abs(levels[m]) + np.sqrt(square))
                    inside = inside and _along(rows, held[m], candidate) >= levels[m] - slack
            if inside:
                nearest, chosen, point = square, mask, candidate
        if chosen == 0 or not np.sqrt(nearest) > length:
            break  # rounding decides: what is known is a lower bound, and right to it
        length, v, kept = np.sqrt(nearest), point, 0
        for m in range(count):
            if chosen >> m & 1:
                held[kept], levels[kept] = held[m], levels[m]
                kept += 1
        count = kept
        if length >= enough:
            break
    way[0], way[1], way[2] = v[0] / length, v[1] / length, v[2] / length
    return length


@kernel
def least_gap(rows, first, x, y, shift, likely, way):
    """Return the least signed distance of the part pairs, and which has it: the likeliest is asked first."""
    own = np.empty(3)
    best, owner = pair_gap(rows, first[likely], first[likely + 1], x, y, shift, _INF, way), likely
    for p in range(len(first) - 1):
        if p != likely:
            gap = pair_gap(rows, first[p], first[p + 1], x, y, shift, best, own)
            if gap < best:
                best, owner = gap, p
                way[:] = own
    return best, owner


@kernel
def gaps(rows, first, sizes):
    """Return the signed gap of two bodies at size pairs (m, 2), and the part pair that has each."""
    found, owners = np.empty(len(sizes)), np.zeros(len(sizes), np.int64)
    way, owner, still = np.empty(3), 0, (0.0, 0.0, 0.0)
    for k in range(len(sizes)):
        found[k], owner = least_gap(rows, first, sizes[k, 0], sizes[k, 1], still, owner, way)
        owners[k] = owner
    return found, owners


@kernel
def gaps_of_pairs(rows, first, sizes):
    """Return the signed distance of every part pair at size pairs, (pairs, m), and its directions, (pairs, m, 3)."""
    found, ways = np.empty((len(first) - 1, len(sizes))), np.empty((len(first) - 1, len(sizes), 3))
    for p in range(len(first) - 1):
        for k in range(len(sizes)):
            x, y = sizes[k, 0], sizes[k, 1]
            found[p, k] = pair_gap(rows, first[p], first[p + 1], x, y, (0.0, 0.0, 0.0), _INF, ways[p, k])
    return found, ways


# ------------------------------------------------------------------------------------------------------ matrix games


@kernel
def game(W):
    """Return shares of the rows, >= 0 and together 1, whose mixture has the largest least entry, by the simplex method.

    Entries are shifted to lie above 0; then the shares are the multipliers of max sum y, W y <= 1, y >= 0. Stopped
    early they are still shares: whoever uses them looks at the mixture itself.
    """
    m, n = W.shape
    low, high = W.min(), W.max()
    spread = high - low
    shares = np.zeros(m)
    if m == 1 or not 0.0 < spread < _INF:
        shares[0] = 1.0
        return shares
    table, basis = np.zeros((m + 1, n + m + 1)), np.empty(m, np.int64)
    for k in range(m):
        for c in range(n):
            table[k, c] = (W[k, c] - low) / spread + 1.0
        table[k, n + k], table[k, n + m], basis[k] = 1.0, 1.0, n + k
    table[m, :n] = -1.0
    for turn in range(8 * (m + n)):
        column, steepest = -1, -_ROUNDING
        for c in range(n + m):
            if table[m, c] < steepest:
                column, steepest = c, table[m, c]
                if turn > 2 * (m + n):
                    break  # the first one: then nothing goes round in circles
        if column < 0:
            break
        row, ratio = -1, _INF
        for k in range(m):
            if table[k, column] > _ROUNDING and table[k, n + m] / table[k, column] < ratio:
                row, ratio = k, table[k, n + m] / table[k, column]
        if row < 0:
            break
        table[row] /= table[row, column]
        for k in range(m + 1):
            if k != row and table[k, column] != 0.0:
                table[k] -= table[k, column] * table[row]
        basis[row] = column
    for k in range(m):
        shares[k] = max(table[m, n + k], 0.0)
    total = shares.sum()
    if not 0.0 < total < _INF:
        shares[:] = 0.0
        shares[0] = 1.0
        return shares
    return shares / total


# ------------------------------------------------------------------------------------------------ over a cell of poses


@kernel
def moved_points(points, T, scale):
    """Return how the way from body 1 to body 2 changes over a cell: common shift (3, k), what is off it (k,), error.

    For points of body 1 about its seed, at a scale, of which each vertex makes the way d - scale R x. The common shift
    is that of their mean; off it, by each of the cell's variables, no vertex is by more.
    """
    k = T.shape[1] - 2
    mean = np.zeros(3)
    for v in range(len(points)):
        for j in range(3):
            mean[j] += points[v, j] / len(points)
    shift, off, error = np.zeros((3, k)), np.zeros(k), 0.0
    for c in range(k):
        for i in range(3):
            shift[i, c] = T[9 + i, 1 + c]
            for j in range(3):
                shift[i, c] -= scale * mean[j] * T[3 * i + j, 1 + c]
        for v in range(len(points)):
            square = 0.0
            for i in range(3):
                turn = 0.0
                for j in range(3):
                    turn += (points[v, j] - mean[j]) * T[3 * i + j, 1 + c]
                square += turn * turn
            off[c] = max(off[c], scale * np.sqrt(square))
    for v in range(len(points)):
        square = 0.0
        for i in range(3):
            own = T[9 + i, k + 1]
            for j in range(3):
                own += scale * abs(points[v, j]) * T[3 * i + j, k + 1]
            square += own * own
        error = max(error, np.sqrt(square))
    return shift, off, error


@kernel
def cell_bound(one, starts1, two, starts2, rows, first, near, T, sizes, low, high):
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

    Parameters
    ----------
    one, two : (n, 3) arrays
        Vertices of both bodies about their seeds, part by part from `starts1`, `starts2`.
    rows, first, near
        At the cell's centre, of the part pairs in `near`, (p, 2), that may have the least gap.
    T : (12, k + 2) array
        Enclosure of the relative pose.
    sizes : (m, 2) array

    Returns
    -------
    bound, value : floats
        Over the cell; and how far the worst of these gaps is off at its centre.
    shares : (w,) array
        Of the witnesses in the mixture.
    kinds : (w, 3) ints
        Kind, part pair (its place in `near`; -1 for a direction each) and size pair.
    ways : (m, pairs, 3) array
        Directions, of all part pairs i * parts 2 + j.
    scores : (k,) array
        How much each variable adds to what is lost between centre and bound.
    """
    k, m = T.shape[1] - 2, len(sizes)
    corners, n1, n2 = 1 << k, len(starts1) - 1, len(starts2) - 1
    still = (0.0, 0.0, 0.0)
    chosen, count = np.empty((corners + 1, 2), np.int64), 0
    ways, value, scratch = np.empty((m, n1 * n2, 3)), -_INF, np.empty(3)
    shifts, offs, errors = np.empty((m, 3, k)), np.zeros((m, k)), np.zeros(m)
    worst, of_corner = np.full(corners + 1, -_INF), np.zeros((corners + 1, 2), np.int64)
    likely = 0
    for s in range(m):
        x, y = sizes[s, 0], sizes[s, 1]
        shifts[s], offs[s], errors[s] = moved_points(one, T, x)
        gap, likely = least_gap(rows, first, x, y, still, likely, scratch)
        value = max(value, max(gap - high, low - gap))
        if low == -_INF:
            continue
        for corner in range(corners + 1):
            shift = still
            if corner < corners:
                shift = _corner(shifts[s], corner)
                gap, likely = least_gap(rows, first, x, y, shift, likely, scratch)
            if low - gap > worst[corner]:
                worst[corner], of_corner[corner, 0], of_corner[corner, 1] = low - gap, likely, s
    if low > -_INF:
        for corner in range(corners + 1):
            known = False
            for w in range(count):
                known = known or (chosen[w, 0] == of_corner[corner, 0] and chosen[w, 1] == of_corner[corner, 1])
            if not known:
                chosen[count] = of_corner[corner]
                count += 1
    more = m if high < _INF else 0
    W, kinds = np.empty((2 * count + more, corners)), np.empty((2 * count + more, 3), np.int64)
    used, values = count, np.empty(corners)
    for w in range(count):
        p, s = chosen[w, 0], chosen[w, 1]
        kinds[w, 0], kinds[w, 1], kinds[w, 2] = SHIFTED, p, s
        loss = offs[s].sum() + errors[s]
        for corner in range(corners):
            shift = _corner(shifts[s], corner)
            gap = pair_gap(rows, first[p], first[p + 1], sizes[s, 0], sizes[s, 1], shift, _INF, scratch)
            W[w, corner] = low - gap - loss
        own = one[starts1[near[p, 0]] : starts1[near[p, 0] + 1]]
        if _set_tracked(values, T, own, rows, first[p], first[p + 1], sizes[s, 0], sizes[s, 1]):
            for corner in range(corners):
                W[used, corner] = low + values[corner]
            kinds[used, 0], kinds[used, 1], kinds[used, 2] = TRACKED, p, s
            used += 1
    for s in range(more):
        x, y = sizes[s, 0], sizes[s, 1]
        ways[s] = np.nan
        for p in range(len(near)):
            code = near[p, 0] * n2 + near[p, 1]
            pair_gap(rows, first[p], first[p + 1], x, y, still, _INF, ways[s, code])
        for code in range(n1 * n2):
            if np.isnan(ways[s, code, 0]):
                i, j = code // n2, code % n2
                own, other = one[starts1[i] : starts1[i + 1]], two[starts2[j] : starts2[j + 1]]
                _set_far_way(T, own, other, x, y, ways[s, code])
        kinds[used, 0], kinds[used, 1], kinds[used, 2] = DIRECTED, -1, s
        _set_directed(W[used], T, one, starts1, two, starts2, x, y, ways[s], high)
        used += 1
    W, kinds = W[:used], kinds[:used]
    shares = game(W)
    mixed = np.zeros(corners)
    for w in range(len(shares)):
        for corner in range(corners):
            mixed[corner] += shares[w] * W[w, corner]
    scores = np.zeros(k)
    for c in range(k):
        for corner in range(corners):
            scores[c] += abs(mixed[corner] - mixed[corner ^ (1 << c)]) / (2.0 * corners)
        for w in range(count):
            scores[c] += shares[w] * offs[kinds[w, 2], c]
    return mixed.min(), value, shares, kinds, ways, scores


@step
def _corner(shift, corner):
    """Return the shift in a corner of the cell: variable c is 1 where bit c is set, else -1."""
    x = y = z = 0.0
    for c in range(shift.shape[1]):
        sign = 1.0 if corner >> c & 1 else -1.0
        x += sign * shift[0, c]
        y += sign * shift[1, c]
        z += sign * shift[2, c]
    return x, y, z


@kernel
def _set_far_way(T, one, two, x, y, way):
    """Write a direction along which two parts are far apart at the cell's centre.

    The best of those along the axes, along the diagonals of a cube, and between the middles of both parts.
    """
    best, n, middle = -_INF, np.empty(3), np.empty(3)
    for i in range(3):
        middle[i] = T[9 + i, 0] + y * two[:, i].mean()
        for j in range(3):
            middle[i] -= x * T[3 * i + j, 0] * one[:, j].mean()
    way[0], way[1], way[2] = 1.0, 0.0, 0.0
    for code in range(27):
        a, b, c = code // 9 - 1, code // 3 % 3 - 1, code % 3 - 1
        nonzero = abs(a) + abs(b) + abs(c)
        if nonzero == 2:
            continue
        n[0], n[1], n[2] = float(a), float(b), float(c)
        if nonzero == 0:
            n[:] = middle
        length = np.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
        if not length > 0.0:
            continue
        n /= length
        high = low = 0.0
        for v in range(len(one)):
            height = 0.0
            for j in range(3):
                height += (n[0] * T[j, 0] + n[1] * T[3 + j, 0] + n[2] * T[6 + j, 0]) * one[v, j]
            high = height if v == 0 else max(high, height)
        for v in range(len(two)):
            height = n[0] * two[v, 0] + n[1] * two[v, 1] + n[2] * two[v, 2]
            low = height if v == 0 else min(low, height)
        gap = n[0] * T[9, 0] + n[1] * T[10, 0] + n[2] * T[11, 0] + y * low - x * high
        if gap > best:
            best = gap
            way[:] = n


@kernel
def _set_tracked(values, T, one, rows, start, end, x, y):
    """Write, in each corner, how deep two parts overlap at least by the facets they have at the centre.

    Return whether that is anywhere more than nothing: else the facets need not remain about zero.
    """
    k = T.shape[1] - 2
    values[:] = _INF
    heights, turned = np.empty(len(one)), np.empty(3)
    for f in range(start, end):
        if rows[f, 5] - rows[f, 3] * x - rows[f, 4] * y >= 0.0:
            return False
        for b in range(3):
            turned[b] = rows[f, 0] * T[b, 0] + rows[f, 1] * T[3 + b, 0] + rows[f, 2] * T[6 + b, 0]
        top, reach = -_INF, 0.0
        for v in range(len(one)):
            heights[v] = turned[0] * one[v, 0] + turned[1] * one[v, 1] + turned[2] * one[v, 2]
            top = max(top, heights[v])
            reach = max(reach, abs(one[v, 0]) + abs(one[v, 1]) + abs(one[v, 2]))
        for v in range(len(one)):
            if heights[v] < top - _ALIKE * reach:
                continue
            error = 0.0
            for a in range(3):
                entry = T[9 + a, k + 1]
                for b in range(3):
                    entry += x * abs(one[v, b]) * T[3 * a + b, k + 1]
                error += abs(rows[f, a]) * entry
            centre = x * heights[v] + rows[f, 4] * y - error
            for a in range(3):
                centre -= rows[f, a] * T[9 + a, 0]
            slopes = np.empty(k)
            for c in range(k):
                slopes[c] = 0.0
                for a in range(3):
                    entry = -T[9 + a, 1 + c]
                    for b in range(3):
                        entry += x * one[v, b] * T[3 * a + b, 1 + c]
                    slopes[c] += rows[f, a] * entry
            for corner in range(len(values)):
                depth = centre
                for c in range(k):
                    depth += slopes[c] if corner >> c & 1 else -slopes[c]
                values[corner] = min(values[corner], depth)
        for corner in range(len(values)):
            if not values[corner] > 0.0:
                return False
    return True


@kernel
def _set_directed(values, T, one, starts1, two, starts2, x, y, ways, high):
    """Write, in each corner, the least over the part pairs of the gap along its direction, less errors and `high`."""
    k, n2 = T.shape[1] - 2, len(starts2) - 1
    values[:] = _INF
    for code in range(len(ways)):
        i, j, n = code // n2, code % n2, ways[code]
        nearest = _INF
        for v in range(starts2[j], starts2[j + 1]):
            nearest = min(nearest, y * (n[0] * two[v, 0] + n[1] * two[v, 1] + n[2] * two[v, 2]))
        error = 0.0
        for v in range(starts1[i], starts1[i + 1]):
            own = 0.0
            for a in range(3):
                entry = T[9 + a, k + 1]
                for b in range(3):
                    entry += x * abs(one[v, b]) * T[3 * a + b, k + 1]
                own += abs(n[a]) * entry
            error = max(error, own)
        for corner in range(len(values)):
            least = _INF
            for v in range(starts1[i], starts1[i + 1]):
                total = 0.0
                for c in range(k + 1):
                    sign = 1.0 if c == 0 or corner >> (c - 1) & 1 else -1.0
                    entry = 0.0
                    for a in range(3):
                        own = T[9 + a, c]
                        for b in range(3):
                            own -= x * one[v, b] * T[3 * a + b, c]
                        entry += n[a] * own
                    total += sign * entry
                least = min(least, total)
            values[corner] = min(values[corner], least + nearest - error - high)
