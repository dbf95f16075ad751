"""Compiled bounds over cells of rotations, translations being free: see `turns`, which cuts the cells.

A cell is a box of the scaled angles eta = w theta, centre c and half-widths h, three of each, unused ones zero. A
`turn` is, flat, the rotation R at the centre, row by row, then the rows omega_k: dR/d eta_k x = omega_k x (R x).
A body is a tuple (points, normals, edges, ends, places): points of body 1 at the scale made about the moved seed at
rest, of body 2 the offset to them from there; normals, and how far they may be wrong, point from body 1 to body 2;
edges are unit vectors, then the middle of the arc of normals and how far its ends are from it; ends are a point, the
face on the left, the one on the right; places are the first rows of each part. M takes translations y, in which the
amount is a length, to the world's.

What bounds rest on. Along a segment of angles delta, R is a product of rotations about fixed axes each at a constant
rate, or the exponential of A + s B, with skew A and B. Either way the second derivative of R x is at most r^2 |x|, r
the sum of |delta_k| (product rule), or |delta| (twice the integral of exp B exp B exp over 0 < s < s' < 1, each factor
exp orthogonal). So x . R y is its linearisation to within r^2 |x| |y| / 2, r the cell's radius. What is not linear in R
is a quotient N / D of two such numbers, bounded by a linear one again in `_quotient`.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt.compiling import kernel, step
from fcdm_opt.curve.kernels import _at, _cross, _dot, _entry, _length, _minus, _times, _turned, _turned_back
from fcdm_opt.proof.cells import _plus
from fcdm_opt.proof.least_distance import _lowest, nearest, nearest_points
from fcdm_opt.stages.compiled import _place

FACE_1, FACE_2, EDGES, EDGES_BACK = range(4)  # directions along which parts may come apart
NEWTON, CLOSE = 20, 1e-9  # steps to the best value of one of them, and how near is enough
FEW = 16  # directions of a pair that are all looked at closely
HOPE = 0.5  # change of depth over a cell, relative to what turning moves points, below which a bound is tried
SERIES = 0.1  # squares of angles below which series are used
PIECES = 3  # of an arc of directions
PARALLEL = 1e-7  # sines below which edges give no direction
ROUNDING = 256 * 2.0**-53  # of lengths that enter: no value is the sum of more than 64 products, each rounded thrice
NONE = 0.0, 0.0, 0.0
_INF = np.inf


@step
def _spread(g, h):
    return abs(g[0]) * h[0] + abs(g[1]) * h[1] + abs(g[2]) * h[2]


@step
def _clipped(x, low, high):
    return min(max(x, low), high)


@kernel
def set_turn(kind, eta, turn):
    """Fill `turn`: R, and the axial vectors of its derivatives times its transpose."""
    motion, places, vector, weights = kind
    if vector:  # in closed form: a search turns to a million cells
        _set_vector_turn((eta[0] / weights[0], eta[1] / weights[1], eta[2] / weights[2]), weights, turn)
        return
    count = len(motion[3])
    z, q, flat = np.zeros(count), np.empty(count), np.empty(12 * (count + 1))
    for k in range(len(places)):
        z[places[k]] = eta[k]
    _place(motion, z, 1.0, q, flat, True)
    turn[:9], turn[9:] = flat[:9], 0.0
    for k in range(len(places)):
        for i in range(3):
            one, two = 3 * ((i + 1) % 3), 3 * ((i + 2) % 3)
            for j in range(3):
                turn[9 + 3 * k + i] += flat[12 + 12 * places[k] + two + j] * flat[one + j]


@step
def _set_vector_turn(theta, weights, turn):
    p = _dot(theta, theta)
    if p < SERIES:
        s = 1.0 - p / 6.0 * (1.0 - p / 20.0 * (1.0 - p / 42.0 * (1.0 - p / 72.0 * (1.0 - p / 110.0))))
        v = 0.5 - p / 24.0 * (1.0 - p / 30.0 * (1.0 - p / 56.0 * (1.0 - p / 90.0 * (1.0 - p / 132.0))))
        u = 1.0 / 6.0 - p / 120.0 * (1.0 - p / 42.0 * (1.0 - p / 72.0 * (1.0 - p / 110.0 * (1.0 - p / 156.0))))
    else:
        r = np.sqrt(p)
        s, v, u = np.sin(r) / r, 2.0 * np.sin(0.5 * r) ** 2 / p, (r - np.sin(r)) / (p * r)
    for i in range(3):
        for j in range(3):
            square = theta[i] * theta[j] - (p if i == j else 0.0)
            skew = 0.0 if i == j else (theta[3 - i - j] if (i - j) % 3 == 1 else -theta[3 - i - j])
            one = 1.0 if i == j else 0.0
            turn[3 * i + j] = one + s * skew + v * square
            turn[9 + 3 * j + i] = (one + v * skew + u * square) / weights[j]


@step
def _radius(kind, h):
    """Return the r of a cell."""
    vector, weights = kind[2], kind[3]
    a, b, c = h[0] / weights[0], h[1] / weights[1], h[2] / weights[2]
    return np.sqrt(a * a + b * b + c * c) if vector else a + b + c


@step
def _quotient(N, gN, D, gD, eD, h):
    """Return a linear lower bound (l, g) of max(0, N) / D over a cell, from those of N below and D + e above.

    With D' = D + e and t = N / D': N / D = t + k / D' - k g_D / (D' D), k = (g_N - t g_D) delta. Where D may vanish
    there is none: -inf.
    """
    top = D + eD
    wide = _spread(gD, h)
    if not top - wide > PARALLEL * top:
        return -_INF, gN
    t = N / top
    k = _minus(gN, _times(t, gD))
    return t - _spread(k, h) * wide / (top * (top - wide)), _times(1.0 / top, k)


@step
def _stretch(metric, x, dx0, dx1, dx2, error, spectral, radius):
    """Return (D, g, e): |M' x| with x linear in the cell to within `error`.

    |a + b| <= |a| + a.b / |a| + b.b / 2 |a|, since the square of the right side less that of the left is one.
    """
    a = _turned_back(metric, 0, x)
    D = _length(a)
    if not D > 0.0:
        return 0.0, (0.0, 0.0, 0.0), _INF
    u = _times(1.0 / D, _turned(metric, 0, a))
    return D, (_dot(u, dx0), _dot(u, dx1), _dot(u, dx2)), spectral * error + (spectral * radius) ** 2 / (2.0 * D)


@step
def _multiplier(level, g, G, low, high):
    """Return the m >= 0 at which level + g.eta - m, eta = -(G + m g) within its limits, falls to zero (Newton)."""
    m, floor, ceiling = 0.0, 0.0, _INF
    for _ in range(NEWTON):
        rest, steep = level - m, 1.0
        for k in range(3):
            x = -G[k] - m * g[k]
            rest += g[k] * _clipped(x, low[k], high[k])
            if low[k] < x < high[k]:
                steep += g[k] * g[k]
        if rest <= 0.0 and m == 0.0:
            return 0.0
        if abs(rest) <= CLOSE * m:
            return m
        if rest > 0.0:
            floor = m
        else:
            ceiling = m
        m += rest / steep
        if not floor < m < ceiling:
            m = 0.5 * (floor + ceiling)
    return m


@kernel
def _share(levels, slopes, count, c, low, high, size, multipliers):
    """Fill the multipliers of the least (s, eta) above all levels in the cell, as a least distance program."""
    G, b, z = np.zeros((count + 6, 4)), np.empty(count + 6), np.empty(4)
    duals = np.empty(count + 6)
    for v in range(count):
        g = _at(slopes, v)
        steep = np.sqrt(1.0 + _dot(g, g))
        G[v, 0], G[v, 1], G[v, 2], G[v, 3] = 1.0 / steep, -g[0] / steep, -g[1] / steep, -g[2] / steep
        b[v] = (levels[v] - _dot(g, c)) / (steep * size)
    for k in range(3):
        G[count + k, 1 + k], b[count + k] = 1.0, low[k] / size
        G[count + 3 + k, 1 + k], b[count + 3 + k] = -1.0, -high[k] / size
    nearest(G, b, np.zeros(count + 6, np.bool_), count + 6, z, duals)
    for v in range(count):
        multipliers[v] = max(duals[v], 0.0) * size * G[v, 0]


@kernel
def least(levels, slopes, count, c, h, multipliers):
    """Return a lower bound of sqrt(max(0, l_v + g_v delta)^2 + |c + delta|^2), v the largest, over a cell, and where.

    The dual: for multipliers m >= 0, with S = sum m_v and G = sum m_v g_v, the least over s >= 0 and the cell of
    (s^2 + |eta|^2) / 2 + sum m_v (l_v + g_v delta - s). Every m gives a bound, however it was found.
    """
    low, high = _minus(c, h), _plus(c, h)
    eta = _clipped(0.0, low[0], high[0]), _clipped(0.0, low[1], high[1]), _clipped(0.0, low[2], high[2])
    base = 0.5 * _dot(eta, eta)
    top = 0.0
    for v in range(count):
        top = max(top, levels[v] - _spread(_at(slopes, v), h))
    used, peak = 0, 0.0
    for v in range(count):
        most = levels[v] + _spread(_at(slopes, v), h)
        peak = max(peak, most)
        if most >= top and most > 0.0:
            levels[used], multipliers[used] = levels[v], 0.0
            slopes[used, 0], slopes[used, 1], slopes[used, 2] = slopes[v, 0], slopes[v, 1], slopes[v, 2]
            used += 1
    if used == 0:
        return np.sqrt(2.0 * base), eta
    if used == 1:
        multipliers[0] = _multiplier(levels[0] - _dot(_at(slopes, 0), c), _at(slopes, 0), (0.0, 0.0, 0.0), low, high)
    else:
        _share(levels, slopes, used, c, low, high, peak, multipliers)
    S, L, G = 0.0, 0.0, (0.0, 0.0, 0.0)
    for v in range(used):
        m = multipliers[v]
        S, L, G = S + m, L + m * levels[v], _plus(G, _times(m, _at(slopes, v)))
    eta = _clipped(-G[0], low[0], high[0]), _clipped(-G[1], low[1], high[1]), _clipped(-G[2], low[2], high[2])
    value = L - 0.5 * S * S + 0.5 * _dot(eta, eta) + _dot(G, _minus(eta, c))
    return np.sqrt(2.0 * max(base, value)), eta


# ------------------------------------------------------------------------------------- directions that parts leave by


@kernel
def _part(body, k):
    """Return points, normals, edges and ends of a part."""
    points, normals, edges, ends, places = body
    p, f, m = places[k, 0], places[k, 1], places[k, 2]
    q, g, o = places[k + 1, 0], places[k + 1, 1], places[k + 1, 2]
    return points[p:q], normals[f:g], edges[m:o], ends[m:o]


@kernel
def _cannot_cross(part1, part2, turn, site, radius):
    """Tell whether the arcs of two edges' normals have no direction in common anywhere in a cell.

    Arc 1 runs from A to B along E = A x B, arc 2 from C to D along F = C x D: they cross along E x F where D.E > 0 >
    C.E and A.F > 0 > B.F, along F x E where all four signs are the other ones. In the cell E, A, B turn by its radius.
    """
    kind, i, j = site
    sign = 1.0 if kind == EDGES else -1.0
    x, y, z = part1[2][i, 3], part1[2][i, 4], part1[2][i, 5]
    apart = _minus(_turned(turn, 0, (x, y, z)), (part2[2][j, 3], part2[2][j, 4], part2[2][j, 5]))
    if _length(apart) > part1[2][i, 6] + part2[2][j, 6] + radius:
        return True
    E, F = _turned(turn, 0, _at(part1[2], i)), _at(part2[2], j)
    before, after = part2[3][j, 1], part2[3][j, 2]
    error = radius + ROUNDING
    if sign * _dot(_at(part2[1], after), E) < -error - part2[1][after, 3]:
        return True
    if sign * _dot(_at(part2[1], before), E) > error + part2[1][before, 3]:
        return True
    own = _turned_back(turn, 0, F)
    before, after = part1[3][i, 1], part1[3][i, 2]
    if sign * _dot(_at(part1[1], before), own) < -error - part1[1][before, 3]:
        return True
    return sign * _dot(_at(part1[1], after), own) > error + part1[1][after, 3]


@step
def _direction(part1, part2, turn, site):
    """Return (sign, n, E, F): a direction at the centre, not of unit length, of edges sign E x F."""
    kind, i, j = site
    if kind == FACE_1:
        return 0.0, _turned(turn, 0, _at(part1[1], i)), NONE, NONE
    if kind == FACE_2:
        return 0.0, _at(part2[1], j), NONE, NONE
    sign, E, F = 1.0 if kind == EDGES else -1.0, _turned(turn, 0, _at(part1[2], i)), _at(part2[2], j)
    return sign, _times(sign, _cross(E, F)), E, F


@step
def _height(kind, along, turn, half, x, p):
    """Return (value, slopes, error) of n . (x - p) over a cell, x a point of body 1 turned, p one of body 2."""
    sign, n, E, F = along
    value = _dot(n, _minus(x, p))
    if kind == FACE_1:
        return value, _turned(turn, 9, _cross(p, n)), half * _length(p) * _length(n)
    if kind == FACE_2:
        return value, _turned(turn, 9, _cross(x, n)), half * _length(x) * _length(n)
    one, two = _cross(x, E), _cross(F, p)  # n . R x = sign F . R (x x e)
    slopes = _times(sign, _turned(turn, 9, _minus(_cross(one, F), _cross(E, two))))
    return value, slopes, half * (_length(one) + _length(two))


@step
def _size(kind, along, turn, metric, spectral, bent, radius):
    """Return (D, g, e) of |M' n| over a cell, see `_stretch`; constant where n does not turn, or M only turns it."""
    sign, n, E, F = along
    if kind == FACE_2 or (kind == FACE_1 and not bent):
        return _length(_turned_back(metric, 0, n)), NONE, 0.0
    if kind == FACE_1:
        a, b, c = _cross(_entry(turn, 9), n), _cross(_entry(turn, 12), n), _cross(_entry(turn, 15), n)
        length = _length(n)
    else:
        a = _times(sign, _cross(_cross(_entry(turn, 9), E), F))
        b = _times(sign, _cross(_cross(_entry(turn, 12), E), F))
        c = _times(sign, _cross(_cross(_entry(turn, 15), E), F))
        length = 1.0
    return _stretch(metric, n, a, b, c, 0.5 * radius * radius * length, spectral, radius * length)


@kernel
def exact_depth(part1, part2, turned1, turn, site, metric):
    """Return (depth, n, |M' n|): how far to go back along a direction, over |M' n|; infinite for parallel edges."""
    n = _direction(part1, part2, turn, site)[1]
    if not _length(n) > PARALLEL:
        return _INF, n, 1.0
    size = _length(_turned_back(metric, 0, n))
    return (-_lowest(turned1, _times(-1.0, n))[1] - _lowest(part2[0], n)[1]) / size, n, size


@step
def _fill(levels, slopes, k, level, g):
    levels[k], slopes[k, 0], slopes[k, 1], slopes[k, 2] = level, g[0], g[1], g[2]


@kernel
def _direction_terms(part1, part2, turned1, turn, site, metric, spectral, bent, more, pad, radius, h, levels, slopes):
    """Fill linear lower bounds over a cell, the largest of which bounds depth / |M' n| + more; return their number.

    Each is of two vertices, one of them that which the direction's own feature has.
    """
    kind, i, j = site
    points2, half, count = part2[0], 0.5 * radius * radius, 0
    along = _direction(part1, part2, turn, site)
    n, error = along[1], 0.0
    v, w = 0, 0
    if kind == FACE_1:
        v, error = _lowest(turned1, _times(-1.0, n))[0], part1[1][i, 3]
    elif kind == FACE_2:
        w, error = _lowest(points2, n)[0], part2[1][j, 3]
    else:
        v, w = part1[3][i, 0], part2[3][j, 0]
    D, gD, eD = _size(kind, along, turn, metric, spectral, bent, radius)
    if not D + eD - _spread(gD, h) > PARALLEL * D:
        return 0
    rounding = pad * (1.0 + error / ROUNDING)
    for k in range(len(turned1) + len(points2)):
        if (kind == FACE_1 and k < len(turned1)) or (kind == FACE_2 and k >= len(turned1)):
            continue
        x = _at(turned1, k if k < len(turned1) else v)
        p = _at(points2, w if k < len(turned1) else k - len(turned1))
        height, g, bent_by = _height(kind, along, turn, half, x, p)
        value, g = _quotient(height - bent_by - rounding, g, D, gD, eD, h)
        _fill(levels, slopes, count, value + more, g)
        count += 1
    return count


@kernel
def _bound_along_arc(part1, part2, turned1, turn, site, metric, more, pad, radius, c, h, scratch):
    """Return a lower bound for two edges that may be parallel somewhere in a cell.

    Their direction lies on arc 2, so between some a and b that cut it into pieces: it is s a + t b with s, t >= 0, and
    the depth along it is at least s L_a + t L_b, L the heights of a point of body 1 over edge 2. |M' n| is convex, so
    that depth / |M' n| is at least the smaller of both quotients. What arc 1 does not reach in the cell is cut off:
    f.n >= -e of a unit n asks for s (f.a + e) + t (f.b + e) >= 0, as s + t >= 1.
    """
    levels, slopes, shares = scratch
    _, i, j = site
    half = 0.5 * radius * radius
    E, A, B = _turned(turn, 0, _at(part1[2], i)), part1[3][i, 1], part1[3][i, 2]
    error = radius + ROUNDING + part1[1][A, 3] + part1[1][B, 3]
    inside = _cross(E, _turned(turn, 0, _at(part1[1], A))), _cross(_turned(turn, 0, _at(part1[1], B)), E)
    C, D = part2[3][j, 1], part2[3][j, 2]
    first, last = _at(part2[1], C), _at(part2[1], D)
    if max(_dot(first, E), _dot(last, E)) < -error or min(_dot(first, E), _dot(last, E)) > error:
        return _INF
    for side in inside:
        f, g = _dot(first, side) + error, _dot(last, side) + error
        if f < 0.0 and g < 0.0:
            return _INF
        if f < 0.0:
            first = _plus(first, _times(f / (f - g), _minus(last, first)))
        elif g < 0.0:
            last = _plus(last, _times(g / (g - f), _minus(first, last)))
    rounding = pad * (1.0 + (part2[1][C, 3] + part2[1][D, 3]) / ROUNDING)
    p, best = _at(part2[0], part2[3][j, 0]), _INF
    for piece in range(PIECES):
        a = _plus(first, _times(piece / PIECES, _minus(last, first)))
        b = _plus(first, _times((piece + 1) / PIECES, _minus(last, first)))
        over_a, over_b = 1.0 / _length(_turned_back(metric, 0, a)), 1.0 / _length(_turned_back(metric, 0, b))
        v, ahead = 0, -_INF
        for k in range(len(turned1)):
            x = _minus(_at(turned1, k), p)
            value = min(_dot(a, x) * over_a, _dot(b, x) * over_b)
            if value > ahead:
                v, ahead = k, value
        x = _at(turned1, v)
        for n, over in ((a, over_a), (b, over_b)):
            value = _dot(n, _minus(x, p)) - half * _length(x) - rounding
            _fill(levels, slopes, 0, value * over + more, _times(over, _turned(turn, 9, _cross(x, n))))
            best = min(best, least(levels, slopes, 1, c, h, shares)[0])
    return best


# ------------------------------------------------------------------------------------------------------ part pairs


@kernel
def _gap_bound(part2, turned1, turn, x, pairs, metric, inverse, spectral, bent, pad, radius, c, h, enough, scratch):
    """Return a lower bound over a cell for a pair to touch, and where; x is the way between nearest points, in y.

    Along any direction n that may move with body 1, |y| >= separation / |M' n|. Taken are the n at the centre, fixed,
    or attached to body 1, or kept across an edge of each. `pairs` are the points that have a share in x.
    """
    levels, slopes, shares = scratch
    points2, half = part2[0], 0.5 * radius * radius
    n = _turned_back(inverse, 0, _times(1.0 / _length(x), x))  # |M' n| = 1
    i, j, corners1 = _ends(pairs, 0)
    u, w, corners2 = _ends(pairs, 1)
    near, far = _lowest(points2, n)[0], _lowest(turned1, _times(-1.0, n))[0]
    best, where = -1.0, c
    for kind in range(3):
        if best >= enough or (kind != FACE_1 and corners1 > 1 and corners2 == 1):
            continue
        if (kind != FACE_2 and corners1 == 1 and corners2 > 1) or (kind == EDGES and corners1 == 1):
            continue
        along = 0.0, n, NONE, NONE
        if kind == EDGES:
            E, F = _minus(_at(turned1, j), _at(turned1, i)), _minus(_at(points2, w), _at(points2, u))
            E, F = _times(1.0 / _length(E), E), _times(1.0 / _length(F), F)
            sign = 1.0 if _dot(_cross(E, F), n) > 0.0 else -1.0
            along = sign, _times(sign, _cross(E, F)), E, F
        D, gD, eD = _size(kind, along, turn, metric, spectral, bent, radius)
        if not D + eD - _spread(gD, h) > PARALLEL * D:
            continue
        bound, at, rounding = _INF, c, pad * _length(along[1])
        for k in range(len(turned1)):
            if kind == FACE_1 and k != far:
                continue
            for other in range(len(points2)):
                if kind == FACE_2 and other != near:
                    continue
                height, g, bent_by = _height(kind, along, turn, half, _at(turned1, k), _at(points2, other))
                value, g = _quotient(-height - bent_by - rounding, _times(-1.0, g), D, gD, eD, h)
                if _unlike(value, g, c, h, bound):
                    continue
                _fill(levels, slopes, 0, value, g)
                found, here = least(levels, slopes, 1, c, h, shares)
                if found < bound:
                    bound, at = found, here
        if bound > best:
            best, where = bound, at
    return best, where


@step
def _ends(pairs, body):
    """Return the first and the last of a body's points in some pairs, and how many there are."""
    one, two, count = pairs[0, body], pairs[0, body], 0
    for k in range(len(pairs)):
        new = True
        for other in range(k):
            new = new and pairs[other, body] != pairs[k, body]
        count += new
        one, two = min(one, pairs[k, body]), max(two, pairs[k, body])
    return one, two, count


@step
def _unlike(value, g, c, h, bound):
    """Tell at a glance that a term is not the least: its bound, less what turning takes, is above the least known."""
    low = value - _spread(g, h)
    if low <= 0.0:
        return False
    a, b, d = max(abs(c[0]) - h[0], 0.0), max(abs(c[1]) - h[1], 0.0), max(abs(c[2]) - h[2], 0.0)
    return low * low + a * a + b * b + d * d >= bound * bound


@kernel
def _mapped(points, M):
    """Return points times a matrix, the first nine numbers of M: turned, or where the amount is a length, (n, 3)."""
    found = np.empty((len(points), 3))
    for k in range(len(points)):
        found[k, 0], found[k, 1], found[k, 2] = _turned(M, 0, _at(points, k))
    return found


@step
def _keep(best, eta, y):
    """Take a motion as the best known where it is smaller."""
    amount = np.sqrt(_dot(eta, eta) + _dot(y, y))
    if amount < best[0]:
        best[0] = amount
        for k in range(3):
            best[1 + k], best[4 + k] = eta[k], y[k]


@kernel
def least_gap(one, two, pairs, turn, inverse):
    """Return the least way between the parts of some pairs; zero where any two meet."""
    best, x = _INF, NONE
    last, scaled1 = -1, np.empty((0, 3))
    for k in range(len(pairs)):
        if pairs[k, 0] != last:
            last = pairs[k, 0]
            scaled1 = _mapped(_mapped(_part(one, last)[0], turn), inverse)
        site, _, _ = nearest_points(scaled1, _mapped(_part(two, pairs[k, 1])[0], inverse))
        if _length(site) < best:
            best, x = _length(site), site
    return x


@kernel
def _try_gap(one, two, pairs, kind, eta, inverse, best):
    """Try the motion that closes the least gap at some angles; where parts overlap there, the ray to it meets one."""
    low, high, middle, x, turn = 0.0, 1.0, 1.0, (0.0, 0.0, 0.0), np.empty(18)
    if _length(eta) >= best[0]:
        return
    for _ in range(50):
        set_turn(kind, _times(middle, eta), turn)
        y = least_gap(one, two, pairs, turn, inverse)
        if _length(y) > 0.0:
            low, x = middle, y
        else:
            high = middle
        if low == 1.0:
            break
        middle = 0.5 * (low + high)
    _keep(best, _times(low, eta), x)


@kernel
def _try_depth(part1, part2, site, kind, eta, metric, more, best):
    """Try the motion that goes back along a direction at some angles."""
    turn = np.empty(18)
    set_turn(kind, eta, turn)
    depth, n, size = exact_depth(part1, part2, _mapped(part1[0], turn), turn, site, metric)
    if depth + more < _INF:
        _keep(best, eta, _times(-max(depth + more, 0.0) / size, _turned_back(metric, 0, n)))


@kernel
def advance(one, two, apart, kind, space, numbers, touching, nodes, ranges, pool, best, gap):
    """Look at every cell of a generation; return the halves of those left, (bound, c, h), and their directions.

    `touching` are pairs of which one must touch, all of them apart at rest; `apart` are pairs each of which must be
    kept apart, now overlapping or too near. `ranges`, first and end in `pool`, are of a cell's directions: those in
    which a pair may come apart at an amount below the best. `best` is that amount with angles and translations.
    """
    metric, inverse = space
    bent, spectral, more, pad, extent, plain = numbers
    many = len(one[0]) + len(two[0])
    scratch, turn = (np.empty(many), np.empty((many, 3)), np.empty(many)), np.empty(18)
    levels, slopes, shares = scratch
    remaining, remaining_ranges, count = np.empty((2 * len(nodes), 7)), np.empty((2 * len(nodes), 2), np.int64), 0
    made, used = np.empty((max(len(pool), 64), 4), np.int64), 0
    for item in range(len(nodes)):
        cut = (1.0 - gap) * best[0]
        bound, c, h = nodes[item, 0], _entry(nodes[item], 1), _entry(nodes[item], 4)
        if bound >= cut:
            continue
        set_turn(kind, c, turn)
        radius = _radius(kind, h)
        base = np.sqrt(
            max(abs(c[0]) - h[0], 0.0) ** 2 + max(abs(c[1]) - h[1], 0.0) ** 2 + max(abs(c[2]) - h[2], 0.0) ** 2
        )
        bound = max(bound, base)
        # one of these pairs must touch
        if len(touching) and bound < cut:
            lowest, place, last = _INF, c, -1
            turned1, scaled1 = np.empty((0, 3)), np.empty((0, 3))
            for k in range(len(touching)):
                part1, part2 = _part(one, touching[k, 0]), _part(two, touching[k, 1])
                if touching[k, 0] != last:
                    last = touching[k, 0]
                    turned1 = _mapped(part1[0], turn)
                    scaled1 = _mapped(turned1, inverse)
                x, pairs, _ = nearest_points(scaled1, _mapped(part2[0], inverse))
                found, where = base, c
                if _length(x) > 0.0:
                    found, where = _gap_bound(
                        part2, turned1, turn, x, pairs, metric, inverse, spectral, bent, pad, radius, c, h, cut, scratch
                    )
                if found < lowest:
                    lowest, place = found, where
            bound = max(bound, lowest)
            for eta in (c, place):
                if plain and bound < cut:
                    _try_gap(one, two, touching, kind, eta, inverse, best)
                    cut = (1.0 - gap) * best[0]
        # each of these pairs must come apart
        first, entry, end = used, ranges[item, 0], ranges[item, 1]
        crowded = end - entry > FEW * len(apart)
        for k in range(len(apart)):
            if bound >= cut:
                break
            part1, part2 = _part(one, apart[k, 0]), _part(two, apart[k, 1])
            turned1 = _mapped(part1[0], turn)
            lowest, place, leave, shallow, out = _INF, c, (FACE_1, 0, 0), _INF, (FACE_1, 0, 0)
            while entry < end:
                site = pool[entry, 1], pool[entry, 2], pool[entry, 3]
                if pool[entry, 0] != k:
                    break
                entry += 1
                if used == len(made):
                    made = np.concatenate((made, np.empty((used, 4), np.int64)))
                made[used] = pool[entry - 1]
                if site[0] >= EDGES and _cannot_cross(part1, part2, turn, site, radius):
                    continue
                depth, _, _ = exact_depth(part1, part2, turned1, turn, site, metric)
                if depth < shallow:
                    shallow, out = depth, site
                # no bound would leave it out, or hardly one: later, in halves
                if crowded and max(depth + more - HOPE * radius * extent, 0.0) ** 2 + base * base < cut * cut:
                    used += 1
                    if lowest > base:
                        lowest, place, leave = base, c, site
                    continue
                terms = _direction_terms(
                    part1, part2, turned1, turn, site, metric, spectral, bent, more, pad, radius, h, levels, slopes
                )
                found, where = least(levels, slopes, terms, c, h, shares)
                if site[0] >= EDGES and found < cut:
                    arc = _bound_along_arc(part1, part2, turned1, turn, site, metric, more, pad, radius, c, h, scratch)
                    found = max(found, arc)
                if found < cut:
                    used += 1
                if found < lowest:
                    lowest, place, leave = found, where, site
            if more > 0.0 and shallow < radius * extent:
                lowest = min(lowest, _near_bound(part2, turned1, turn, inverse, more, radius, extent, c, h, scratch))
            bound = max(bound, lowest)
            if plain:
                if shallow < _INF and (more == 0.0 or shallow > 0.0):
                    _try_depth(part1, part2, out, kind, c, metric, more, best)
                cut = (1.0 - gap) * best[0]
                if bound < cut:
                    _try_depth(part1, part2, leave, kind, place, metric, more, best)
                    cut = (1.0 - gap) * best[0]
        if bound >= cut:
            used = first
            continue
        axis = 0
        for k in range(1, 3):
            if h[k] / kind[3][k] > h[axis] / kind[3][axis]:
                axis = k
        for side in (-0.5, 0.5):
            remaining[count, 0] = bound
            for k in range(3):
                remaining[count, 1 + k], remaining[count, 4 + k] = c[k], h[k]
            remaining[count, 1 + axis] += side * h[axis]
            remaining[count, 4 + axis] *= 0.5
            remaining_ranges[count, 0], remaining_ranges[count, 1] = first, used
            count += 1
    return remaining[:count], remaining_ranges[:count], made[:used]


@kernel
def _near_bound(part2, turned1, turn, inverse, more, radius, extent, c, h, scratch):
    """Return a lower bound over a cell for parts that are apart, but by less than they must be.

    Two points of them are at most |a + b| apart, a their way at the centre and b what turning adds: see `_stretch`.
    """
    levels, slopes, shares = scratch
    x, pairs, weights = nearest_points(_mapped(turned1, inverse), _mapped(part2[0], inverse))
    distance, g = _length(x), (0.0, 0.0, 0.0)
    level = more - distance - radius * extent
    if distance > 0.0:
        n = _turned_back(inverse, 0, _times(1.0 / distance, x))
        point = (0.0, 0.0, 0.0)
        for k in range(len(weights)):
            point = _plus(point, _times(weights[k], _at(turned1, pairs[k, 0])))
        finer = more - distance - 0.5 * radius * radius * extent - (radius * extent) ** 2 / (2.0 * distance)
        if finer > level:
            level, g = finer, _turned(turn, 9, _cross(point, n))
    _fill(levels, slopes, 0, level, g)
    return least(levels, slopes, 1, c, h, shares)[0]
