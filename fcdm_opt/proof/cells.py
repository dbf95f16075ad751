"""Compiled tests of cells of motions: what holds, or cannot hold, at every motion of a cell.

A cell comes as the enclosure of its relative pose, (12, k + 2): rows of `Enclosure.data` for the rotation of body 1,
row by row, then for d = s_2 - s_1 with the moved seed. Sums and products of such rows, here `enclosures`, keep what is
linear in the cell's k variables and bound the rest. Body 1 is given about its seed, body 2 and what else stays about
s_2. A test that fails says nothing: the cell is to be split.

A *feature* is a row: kind, sign, then three vectors and the part pair: the unit normal of the face in its own body's
axes, or the direction of edge 1; the direction of edge 2; a point of element 1; a point of element 2.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt.compiling import kernel, often, step
from fcdm_opt.curve.kernels import (
    E1E2,
    F1V2,
    V1F2,
    _at,
    _cross,
    _dot,
    _entry,
    _length,
    _minus,
    _plus,
    _times,
    _turned,
    _turned_back,
)
from fcdm_opt.proof.least_distance import _lowest, nearest_points
from fcdm_opt.tolerances import DEFAULT

OPEN, SHORT, LOOSE, LEFT, APART, MEETS, OUTSIDE, COSTLY, NEAR = range(9)  # as `evidence.Reason`
FEATURE = 16  # numbers of a feature
KIND, SIGN, FIRST, SECOND, ONE, TWO, PARTS = 0, 1, 2, 5, 8, 11, 14  # places in it
PARALLEL = DEFAULT.line  # sine of the angle of two edges up to which they give no direction
STEEP = 1e-3  # and above which rounding turns it by less than matters


# ---------------------------------------------------------------------------------------------- enclosures as rows


@kernel
def _low(x):
    """Return the lower bound of an enclosure."""
    total = x[0]
    for i in range(1, len(x)):
        total -= abs(x[i])
    return total


@kernel
def _high(x):
    """Return the upper bound of an enclosure."""
    total = x[0]
    for i in range(1, len(x)):
        total += abs(x[i])
    return total


@kernel
def _add(out, factor, x):
    """Add a multiple of an enclosure."""
    last = len(out) - 1
    for i in range(last):
        out[i] += factor * x[i]
    out[last] += abs(factor) * x[last]


@kernel
def _add_product(out, factor, x, y):
    """Add a multiple of the product of two enclosures."""
    last = len(out) - 1
    spread_x = spread_y = 0.0
    for i in range(1, last + 1):
        spread_x += abs(x[i])
        spread_y += abs(y[i])
    out[0] += factor * x[0] * y[0]
    for i in range(1, last):
        out[i] += factor * (x[0] * y[i] + y[0] * x[i])
    out[last] += abs(factor) * (abs(x[0]) * y[last] + abs(y[0]) * x[last] + spread_x * spread_y)


@kernel
def _turn(T, u, out):
    """Set three enclosures to R u."""
    out[:] = 0.0
    for i in range(3):
        for j in range(3):
            _add(out[i], u[j], T[3 * i + j])


@kernel
def _turn_back(T, u, out):
    """Set three enclosures to R' u."""
    out[:] = 0.0
    for i in range(3):
        for j in range(3):
            _add(out[j], u[i], T[3 * i + j])


@kernel
def _along(x, u, out):
    """Set an enclosure to the product of three with a fixed vector."""
    out[:] = 0.0
    for i in range(3):
        _add(out, u[i], x[i])


@kernel
def _product(x, y, out):
    """Set an enclosure to the dot product of three with three."""
    out[:] = 0.0
    for i in range(3):
        _add_product(out, 1.0, x[i], y[i])


@kernel
def _normal(T, feature, out):
    """Set three enclosures to a feature's normal, of body 1 to body 2; of edges it is not of unit length."""
    kind = int(feature[KIND])
    if kind == F1V2:
        _turn(T, feature[FIRST:SECOND], out)
    elif kind == E1E2:
        edge = np.zeros((3, T.shape[1]))
        _turn(T, feature[FIRST:SECOND], edge)
        out[:] = 0.0
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            _add(out[i], feature[SIGN] * feature[SECOND + k], edge[j])
            _add(out[i], -feature[SIGN] * feature[SECOND + j], edge[k])
    else:
        out[:] = 0.0
        for i in range(3):
            out[i, 0] = feature[FIRST + i]


@kernel
def _height_1(T, feature, point, out):
    """Set an enclosure to the height n . R x of a point of body 1 over a feature's normal."""
    kind = int(feature[KIND])
    out[:] = 0.0
    if kind == F1V2:
        for i in range(3):
            out[0] += feature[FIRST + i] * point[i]
        return
    turned = np.zeros((3, T.shape[1]))
    if kind == E1E2:  # n . R x = (R e_1 x e_2) . R x = e_2 . R (x x e_1)
        moment = _cross(_entry(point, 0), _entry(feature, FIRST))
        _turn_back(T, feature[SECOND:ONE], turned)
        for i in range(3):
            _add(out, feature[SIGN] * moment[i], turned[i])
    else:
        _turn_back(T, feature[FIRST:SECOND], turned)
        for i in range(3):
            _add(out, point[i], turned[i])


@kernel
def _line(T, feature, n, a, b, c):
    """Set enclosures to a feature's normal and contact line."""
    _normal(T, feature, n)
    _height_1(T, feature, feature[ONE:TWO], a)
    _along(n, feature[TWO:PARTS], b)
    for i in range(len(b) - 1):
        b[i] = -b[i]
    _product(n, T[9:12], c)


# ------------------------------------------------------------------------------------------------- tracked features


@kernel
def _set_lines(T, features, target, lines):
    """Set the contact line (a, b, c) of each feature, and its gap at the target pair."""
    n = np.zeros((3, T.shape[1]))
    for k in range(len(features)):
        a, b, c, gap = lines[k, 0], lines[k, 1], lines[k, 2], lines[k, 3]
        _line(T, features[k], n, a, b, c)
        gap[:] = 0.0
        _add(gap, 1.0, c)
        _add(gap, -target[0], a)
        _add(gap, -target[1], b)


@kernel
def _set_crossing(lines, determinant, excess):
    """Set the determinant D of two lines, and D times how far beyond the target pair they cross."""
    # with the gaps g, g' there, D (rho_1 - rho_t1) is g b' - g' b, and so on
    determinant[:], excess[:] = 0.0, 0.0
    for k in range(2):
        sign = 1.0 - 2.0 * k
        _add_product(determinant, sign, lines[k, 0], lines[1 - k, 1])
        _add_product(excess[0], sign, lines[k, 3], lines[1 - k, 1])
        _add_product(excess[1], sign, lines[k, 0], lines[1 - k, 3])


@often
@kernel
def goal_cells(T, features, target, signs, margin, codes, witness):
    """Tell where the tracked contact cannot be where the goal wants it."""
    # with `signs` it is to lie beyond the target pair. Without (zeros) every line is to pass through the target pair
    m = T.shape[2]
    lines, determinant, excess = np.zeros((len(features), 4, m)), np.zeros(m), np.zeros((2, m))
    for cell in range(len(T)):
        if codes[cell]:
            continue
        _set_lines(T[cell], features, target, lines)
        if signs[0] == 0.0:
            for k in range(len(features)):
                if _low(lines[k, 3]) > margin or _high(lines[k, 3]) < -margin:
                    codes[cell], witness[cell, 0] = SHORT, k
                    break
            continue
        _set_crossing(lines, determinant, excess)
        side = 1.0 if _low(determinant) > 0.0 else -1.0 if _high(determinant) < 0.0 else 0.0
        if side == 0.0:  # the lines may be parallel: the scales tend to infinity, but not both in the ways asked for
            steep = np.sqrt((lines[0, 0, 0] ** 2 + lines[0, 1, 0] ** 2) * (lines[1, 0, 0] ** 2 + lines[1, 1, 0] ** 2))
            if _opposed(excess[0], excess[1], signs[0] * signs[1], margin * steep):
                codes[cell], witness[cell, 0] = SHORT, 2
                continue
            for i in range(2):  # now the determinant times the scales, which are positive
                _add(excess[i], target[i], determinant)
            if _opposed(excess[0], excess[1], 1.0, margin * steep):
                codes[cell], witness[cell, 0] = SHORT, 3
            continue
        for i in range(2):
            most = _high(excess[i]) if side * signs[i] > 0 else -_low(excess[i])
            if most < -margin * abs(determinant[0]):
                codes[cell], witness[cell, 0] = SHORT, i
                break


@kernel
def _opposed(x, y, sign, margin):
    """Tell whether x and sign * y have different signs all over a cell."""
    if sign < 0.0:
        return (_low(x) > margin and _low(y) > margin) or (_high(x) < -margin and _high(y) < -margin)
    return (_low(x) > margin and _high(y) < -margin) or (_high(x) < -margin and _low(y) > margin)


@often
@kernel
def support_cells(T, features, one, starts1, two, starts2, least, margin, codes, witness):
    """Tell where a vertex reaches beyond the plane of a tracked feature, at every scale pair of at least `least`."""
    # `one` and `two` have the vertices of both bodies, part by part from `starts1` and `starts2`
    m = T.shape[2]
    n, level, height = np.zeros((3, m)), np.zeros(m), np.zeros(m)
    for cell in range(len(T)):
        if codes[cell]:
            continue
        R = T[cell, :9, 0]
        for k in range(len(features)):
            feature = features[k]
            _normal(T[cell], feature, n)
            direction = -n[0, 0], -n[1, 0], -n[2, 0]
            for body in range(2):
                points, starts = (one, starts1) if body == 0 else (two, starts2)
                part = int(feature[PARTS + body])
                first, last = starts[part], starts[part + 1]
                # the vertex that is furthest beyond at the centre
                own = _turned_back(R, 0, direction) if body == 0 else _times(-1.0, direction)
                vertex, lowest = _lowest(points[first:last], own)
                if not lowest < _dot(own, _entry(feature, ONE if body == 0 else TWO)):
                    continue
                vertex += first
                if body == 0:
                    _height_1(T[cell], feature, feature[ONE:TWO], level)
                    _height_1(T[cell], feature, points[vertex], height)
                    _add(height, -1.0, level)
                else:
                    _along(n, feature[TWO:PARTS] - points[vertex], height)
                if _low(height) * least[body] > margin:
                    codes[cell] = LOOSE
                    witness[cell, 0], witness[cell, 1] = k, body + 1
                    witness[cell, 2] = vertex - first
                    break
            if codes[cell] != OPEN:
                break


@often
@kernel
def left_cells(T, features, target, first, second, margin, codes, witness):
    """Tell where another direction keeps the tracked part pair apart at the tracked scale pair."""
    # the direction is the one along which the polyhedra, given at scale 1 about the seeds, are furthest apart at the
    # tracked scales of the cell's centre
    m = T.shape[2]
    lines, determinant, excess = np.zeros((2, 4, m)), np.zeros(m), np.zeros((2, m))
    n, site, other, rest, height = np.zeros((3, m)), np.zeros(FEATURE), np.zeros((3, m)), np.zeros(m), np.zeros(m)
    for i in range(PARTS, FEATURE):
        site[i] = features[0, i]
    for cell in range(len(T)):
        if codes[cell]:
            continue
        _set_lines(T[cell], features, target, lines)
        _set_crossing(lines, determinant, excess)
        least, most = max(_low(determinant), -_high(determinant)), max(_high(determinant), -_low(determinant))
        x, y = target[0] + excess[0, 0] / determinant[0], target[1] + excess[1, 0] / determinant[0]
        if not (least > 0.0 and x > 0.0 and y > 0.0):
            continue
        R, d = T[cell, :9, 0].copy(), T[cell, 9:12, 0].copy()
        one, two = (
            (x * first[0], first[1], x * first[2], first[3]),
            (y * second[0], second[1], y * second[2], second[3]),
        )
        if not best_site(R, d, one, two, True, site) > 0.0:
            continue
        site[ONE:TWO] /= x
        site[TWO:PARTS] /= y
        # |D| times the gap that is left at the tracked pair, along the site's direction
        side = 1.0 if determinant[0] > 0 else -1.0
        _line(T[cell], site, n, other[0], other[1], other[2])
        gap, rest[:] = other[2], 0.0
        _add(gap, -target[0], other[0])
        _add(gap, -target[1], other[1])
        _add_product(rest, side, determinant, gap)
        # vertices that reach further than the site's own, where it is a facet no more
        further = 0.0
        for body in range(2):
            _add_product(rest, -side, excess[body], other[body])
            above = _excess(T[cell], site, n, body, first[0] if body == 0 else second[0], np.inf, height)
            beyond = max(_high(excess[body]) if side > 0.0 else -_low(excess[body]), 0.0)
            further += above * (target[body] + beyond / least)
        if _low(rest) - most * further > margin * most:
            codes[cell] = LEFT
            witness[cell] = site


# -------------------------------------------------------------------------------------- two polyhedra at fixed scales


@step
def _set_site(site, kind, sign, vectors):
    """Set a feature but for its parts: both directions and both points."""
    site[KIND], site[SIGN] = kind, sign
    for k in range(4):
        for j in range(3):
            site[FIRST + 3 * k + j] = vectors[k][j]


@kernel
def best_site(R, d, first, second, edged, site):
    """Set `site` to the facet direction along which two polyhedra are furthest apart; return their separation there.

    Each is (vertices, outward normals, their levels, edges as origin, end, left and right face); the first is turned by
    R, and away by d. Faces first; edge pairs whose Gauss arcs cross too where `edged`.
    """
    (one, normals1, levels1, edges1), (two, normals2, levels2, edges2) = first, second
    best, offset, none = -np.inf, _entry(d, 0), (0.0, 0.0, 0.0)
    for i in range(len(normals1)):
        own = _at(normals1, i)
        n = _turned(R, 0, own)
        vertex, least = _lowest(two, n)
        gap = _dot(n, offset) + least - levels1[i]
        if gap > best:
            best = gap
            _set_site(site, F1V2, 1.0, (own, none, _times(levels1[i], own), _at(two, vertex)))
    for i in range(len(normals2)):
        own = _at(normals2, i)
        vertex, least = _lowest(one, _turned_back(R, 0, own))
        gap = least - _dot(own, offset) - levels2[i]
        if gap > best:
            best = gap
            _set_site(site, V1F2, 1.0, (_times(-1.0, own), none, _at(one, vertex), _times(levels2[i], own)))
    for e in range(len(edges1) if edged else 0):
        x = _at(one, edges1[e, 0])
        edge = _minus(_at(one, edges1[e, 1]), x)
        u = _turned(R, 0, edge)
        left, right = _turned(R, 0, _at(normals1, edges1[e, 2])), _turned(R, 0, _at(normals1, edges1[e, 3]))
        for f in range(len(edges2)):
            y = _at(two, edges2[f, 0])
            w = _minus(_at(two, edges2[f, 1]), y)
            if not _dot(w, left) * _dot(w, right) < 0.0:
                continue
            before, after = _at(normals2, edges2[f, 2]), _at(normals2, edges2[f, 3])
            n = _cross(u, w)
            across, own = _length(n), _length(u) * _length(w)
            if not _dot(u, before) * _dot(u, after) < 0.0 or not across > PARALLEL * own:
                continue
            up = _dot(n, _plus(left, right))
            if not up * _dot(n, _plus(before, after)) < 0.0:  # the arcs' circles cross on the far side
                continue
            sign = 1.0 if up > 0.0 else -1.0
            gap = sign * _dot(n, _minus(_plus(offset, y), _turned(R, 0, x))) / across
            if gap > best and not across > STEEP * own:  # of edges almost parallel rounding turns the direction
                n = _times(sign / across, n)
                gap = _dot(n, offset) + _lowest(two, n)[1] + _lowest(one, _turned_back(R, 0, _times(-1.0, n)))[1]
            if gap > best:
                best = gap
                _set_site(site, E1E2, sign, (_times(1.0 / _length(edge), edge), _times(1.0 / _length(w), w), x, y))
    return best


@kernel
def _excess(T, site, n, body, points, room, height):
    """Return how much further than its own point vertices of a body reach along a site's direction; of `room` enough.

    `n` is the direction over the cell, `height` is overwritten.
    """
    most = 0.0
    for v in range(len(points)):
        if body == 0:
            _height_1(T, site, points[v] - site[ONE:TWO], height)
        else:
            _along(n, site[TWO:PARTS] - points[v], height)
        most = max(most, _high(height))
        if most >= room:
            break
    return most


@kernel
def apart(T, site, one, two, margin, n, height):
    """Tell whether a site's direction keeps two polyhedra apart over a whole cell."""
    back, gap = np.zeros(T.shape[1]), np.zeros(T.shape[1])
    _line(T, site, n, height, back, gap)
    _add(gap, -1.0, height)
    _add(gap, -1.0, back)
    room = _low(gap) - margin
    for body in range(2):
        room -= _excess(T, site, n, body, one if body == 0 else two, room, height) if room > 0.0 else 0.0
    return room > 0.0


@kernel
def inside(R, d, body, ends, normals, levels, slack, p, u):
    """Set p + [0, 1] u to an edge of a body in the axes of the other; return from where to where it is inside that.

    Within a slack; where it is nowhere, the end is returned first.
    """
    _placed(R, d, body, ends[0], p)
    _placed(R, d, body, ends[1], u)
    start, edge = _entry(p, 0), _minus(_entry(u, 0), _entry(p, 0))
    u[0], u[1], u[2] = edge
    low, high = 0.0, 1.0
    for i in range(len(normals)):
        normal = _at(normals, i)
        rate, room = _dot(normal, edge), levels[i] - _dot(normal, start) + slack
        if rate > 0.0:
            high = min(high, room / rate)
        elif rate < 0.0:
            low = max(low, room / rate)
        elif room < 0.0:
            high = -1.0
        if high < low:
            break
    return low, high


@kernel
def _set_excess(T, body, start, along, normals, levels, excess, rates):
    """Set how far a point start + place along of a body is beyond each face of the other: excess + place rates."""
    turned = np.zeros((3, T.shape[1]))
    for i in range(len(normals)):
        if body == 0:  # n . (R x - d)
            _turn_back(T, normals[i], turned)
            _along(turned, start, excess[i])
            for j in range(3):
                _add(excess[i], -normals[i, j], T[9 + j])
        else:  # R n . (y + d)
            _turn(T, normals[i], turned)
            _product(turned, T[9:12], excess[i])
            for j in range(3):
                _add(excess[i], start[j], turned[j])
        _along(turned, along, rates[i])
        excess[i, 0] -= levels[i]


@kernel
def _moving(excess, rates, place):
    """Let a place on an edge move with the middle of what is inside, each end as the face that cuts it."""
    # it is held where it would leave its edge
    m = len(place)
    for sense in range(2):
        edge_place, face = float(sense), -1
        for i in range(len(excess)):
            rate = rates[i, 0]
            cut = -excess[i, 0] / rate if rate != 0.0 else 0.0
            if (sense == 0 and rate < 0.0 and cut > edge_place) or (sense == 1 and rate > 0.0 and cut < edge_place):
                edge_place, face = cut, i
        if face >= 0:
            for j in range(1, m - 1):
                place[j] -= 0.5 * (excess[face, j] + edge_place * rates[face, j]) / rates[face, 0]
    if _low(place) < 0.0 or _high(place) > 1.0:
        place[1:] = 0.0


@kernel
def _stays(excess, rates, place, margin):
    """Tell whether a point stays inside all faces."""
    for i in range(len(excess)):
        _add_product(excess[i], 1.0, place, rates[i])
        if not _high(excess[i]) < -margin:
            return False
    return True


@kernel
def meets(T, one, two, margin, witness):
    """Tell whether two polyhedra overlap over a whole cell: a point on an edge of one stays inside the other."""
    # the point moves along its edge linearly in the cell's variables, as the edge's part inside does at the centre.
    # `witness`, from place 2: the body whose edge it is, where that begins, its place along it at the centre, slopes of
    # that; last, where it ends. Or a point between what is inside of the edges moves with body 1, 3 in place of the
    # body, and stays inside the other: aligned boxes overlap so, as all that their edges share lies on faces
    m, R, d, solids = T.shape[1], T[:9, 0], T[9:12, 0], (one, two)
    best, best_body, best_edge, best_place, best_end = margin, 0, -1, 0.0, 0
    p, u, x, count = np.empty(3), np.empty(3), np.zeros(3), 0
    for body in range(2):
        points, _, _, edges = solids[body]
        _, normals, levels, _ = solids[1 - body]
        for e in range(len(edges)):
            start, end = points[edges[e, 0]], points[edges[e, 1]]
            low, high = inside(R, d, body, (start, end), normals, levels, margin, p, u)
            if high < low:
                continue
            middle, count = 0.5 * (low + high), count + 1
            for j in range(3):
                x[j] += p[j] + middle * u[j] if body == 1 else start[j] + middle * (end[j] - start[j])
            for sort in range(3):  # the ends of what is inside, and its middle
                place = low if sort == 0 else high if sort == 1 else middle
                if (sort == 0 and low > 0.0) or (sort == 1 and high < 1.0):
                    continue
                slack = np.inf
                for i in range(len(normals)):
                    slack = min(slack, levels[i] - _dot(_at(normals, i), p) - place * _dot(_at(normals, i), u))
                if slack > best:
                    best, best_body, best_edge, best_place, best_end = slack, body, e, place, sort
    place = np.zeros(m)
    if best_edge >= 0:
        points, _, _, edges = solids[best_body]
        _, normals, levels, _ = solids[1 - best_body]
        start, end = points[edges[best_edge, 0]], points[edges[best_edge, 1]]
        excess, rates = np.zeros((len(normals), m)), np.zeros((len(normals), m))
        _set_excess(T, best_body, start, end - start, normals, levels, excess, rates)
        place[0] = best_place
        if best_end == 2:
            _moving(excess, rates, place)
        if _stays(excess, rates, place, margin):
            witness[2], witness[3], witness[-1] = best_body + 1, edges[best_edge, 0], edges[best_edge, 1] + 1
            for k in range(m - 1):
                witness[4 + k] = place[k]
            return True
    if count == 0:
        return False
    x /= count
    for i in range(len(one[1])):
        if _dot(_at(one[1], i), x) > one[2][i] - margin:
            return False
    excess, rates = np.zeros((len(two[1]), m)), np.zeros((len(two[1]), m))
    _set_excess(T, 0, x, np.zeros(3), two[1], two[2], excess, rates)
    if not _stays(excess, rates, np.zeros(m), margin):
        return False
    witness[2], witness[3], witness[4:7] = 3.0, 0.0, x
    return True


@kernel
def _placed(R, d, body, x, out):
    """Set `out` to a point in the axes of the other body: of body 1 in world axes about s_2, of body 2 as R'(y + d)."""
    if body == 0:
        out[0], out[1], out[2] = _minus(_turned(R, 0, x), d)
    else:
        out[0], out[1], out[2] = _turned_back(R, 0, _plus(x, d))


# --------------------------------------------------------------------------------------------------------- distances


@kernel
def set_nearest(R, d, one, two, x, y):
    """Set x, about the moved seed in body 1's axes, and y, about s_2, to the nearest points of two polyhedra.

    Return their distance; where the polyhedra overlap, 0 for a point of both.
    """
    moved = np.empty((len(one), 3))
    for v in range(len(one)):
        _placed(R, d, 0, one[v], moved[v])
    offset, pairs, shares = nearest_points(moved, two)
    x[:], y[:] = 0.0, 0.0
    for k in range(len(shares)):
        x += shares[k] * one[pairs[k, 0]]
        y += shares[k] * two[pairs[k, 1]]
    return _length(offset)


@kernel
def nearer(T, one, two, need, margin, witness):
    """Tell whether two points of two polyhedra are nearer than `need` over a whole cell."""
    # `witness`, from place 2: the point of body 1 about its moved seed, in its own axes, and that of the other about
    # s_2
    m = T.shape[1]
    x, y, offsets, square = np.empty(3), np.empty(3), np.zeros((3, m)), np.zeros(m)
    if not set_nearest(T[:9, 0].copy(), T[9:12, 0].copy(), one, two, x, y) < need:
        return False
    _turn(T, x, offsets)
    for j in range(3):
        _add(offsets[j], -1.0, T[9 + j])
        offsets[j, 0] -= y[j]
    _product(offsets, offsets, square)
    if not _high(square) < (need - margin) ** 2:
        return False
    witness[2:5], witness[5:8] = x, y
    return True


# ----------------------------------------------------------------------------------------------------- all part pairs


@kernel
def _part(solids, i):
    """Return a polyhedron of a packed list of them."""
    vertices, normals, levels, edges, starts, _ = solids
    v, f, e = starts[i]
    end_v, end_f, end_e = starts[i + 1]
    return vertices[v:end_v], normals[f:end_f], levels[f:end_f], edges[e:end_e]


@kernel
def _near_balls(T, balls1, balls2, near, gaps, pairs):
    """List the pairs whose balls are nearer than they may be at the centre of a cell, the nearest first; count them."""
    R, d, count = T[:9, 0], T[9:12, 0], 0
    centre = np.empty(3)
    for i in range(len(balls1)):
        _placed(R, d, 0, balls1[i], centre)
        for j in range(len(balls2)):
            offset = _minus(_entry(centre, 0), _at(balls2, j))
            square, enough = _dot(offset, offset), balls1[i, 3] + balls2[j, 3] + near[j]
            if square < enough * enough:
                gaps[count], pairs[count] = np.sqrt(square) - enough, i * len(balls2) + j
                count += 1
    apart = count // 2
    while apart > 0:  # Shell's way to sort, which is compiled in a tenth of the time of NumPy's
        for k in range(apart, count):
            gap, pair, m = gaps[k], pairs[k], k
            while m >= apart and gaps[m - apart] > gap:
                gaps[m], pairs[m] = gaps[m - apart], pairs[m - apart]
                m -= apart
            gaps[m], pairs[m] = gap, pair
        apart //= 2
    return count


@kernel
def _too_near(T, movable, obstacles, pair, asked, near, margin, witness):
    """Return why all motions of a cell bring a part too near to an obstacle, as far as a pair of them tells."""
    i, j = pair // len(asked), pair % len(asked)
    one, two = _part(movable, i), _part(obstacles, j)
    witness[0], witness[1] = i, j
    if asked[j] and meets(T, one, two, margin, witness):
        return MEETS
    return NEAR if near[j] > 0.0 and nearer(T, one[0], two[0], near[j], margin, witness) else OPEN


@kernel
def _stay_apart(T, movable, obstacles, pair, margin, site, n, height):
    """Tell whether a pair of parts stays apart over a whole cell, by which site."""
    R, d = T[:9, 0].copy(), T[9:12, 0].copy()
    one, two = _part(movable, pair[0]), _part(obstacles, pair[1])
    for edged in (False, True):
        gap = best_site(R, d, one, two, edged, site)
        if gap > margin and apart(T, site, one[0], two[0], margin, n, height):
            site[PARTS], site[PARTS + 1] = pair
            return True
    return False


@often
@kernel
def pair_cells(T, movable, obstacles, partners, asked, near, margin, tries, codes, witness):
    """Tell where a part overlaps an obstacle or is too near, and where all pairs that ought to touch stay apart.

    Cells come in runs of `tries`, of which the first that is excluded is enough. `movable` and `obstacles` are packed,
    the first `partners` obstacles are those of which one ought to be touched; `asked` tells which may not be
    overlapped, `near` how near they may be. Pairs whose balls are apart at a cell's centre cannot overlap all over it;
    the pair that excluded the cell before is tried first.
    """
    balls1, balls2 = movable[5], obstacles[5]
    most = len(balls1) * len(balls2)
    gaps, pairs, close = np.empty(most), np.empty(most, np.int64), np.zeros(most, np.bool_)
    n, height, last = np.zeros((3, T.shape[2])), np.zeros(T.shape[2]), 0
    for cell in range(len(T)):
        if cell % tries == 0:
            done = False
        done = done or codes[cell] != OPEN
        if done:
            continue
        count = _near_balls(T[cell], balls1, balls2, near, gaps, pairs)
        for k in range(-1, count):
            pair = last if k < 0 else pairs[k]
            if k >= 0 and pair == last:
                continue
            codes[cell] = _too_near(T[cell], movable, obstacles, pair, asked, near, margin, witness[cell, 0])
            if codes[cell] != OPEN:
                last, done = pair, True
                break
        if done or partners == 0:
            continue
        close[:], done = False, True
        for k in range(count + most):
            pair = pairs[k] if k < count else k - count
            i, j = pair // len(balls2), pair % len(balls2)
            if close[pair] or j >= partners:
                continue
            close[pair] = True
            site = witness[cell, i * partners + j]
            if not _stay_apart(T[cell], movable, obstacles, (i, j), margin, site, n, height):
                done = False
                break
        if done:
            codes[cell] = APART
