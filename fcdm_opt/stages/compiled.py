"""Compiled least motions: contact rows with gradients, coherence along a path, and the descent over them.

The kernels of the descent share:

    scene       what does not change: the motion's pose and rates as the instructions of a CasADi function, see
                `motion.instructions`; (reals, ints, places) of the parts of body 1, and of body 2, packed together;
                sites of the tracked features, (n, 5), and their orientations; nominal pair, target pair, and what the
                target pair's gap is to be; and how the path is looked at: positions, whether all are or the end alone,
                radians between two, most radians, slack, then for each parameter whether it turns
    rows        the constraints: `ROW` integers and three numbers of each, see below

Variables are z = weights * q / unit, so that the amount is unit |z| and every step of order one. A row says that its
value is not negative, or zero where it is an equality:

    ROW_TARGET      rho of body 1 or 2 less its target, of the tracked pair after the motion
    ROW_LINE        the target's height over the one tracked line (an equality)
    ROW_SEPARATION  the tracked pair's separation along a feature, at path position s
    ROW_DEPTH       how far a vertex lies behind the plane of a tracked feature, at path position s
    ROW_GAP         separation of two vertices at the target pair along a feature's normal, less what is needed
    ROW_BOUND       a parameter's distance from a limit
"""

from __future__ import annotations

import math

import numpy as np

from fcdm_opt.compiling import kernel, light, often
from fcdm_opt.curve.kernels import (
    E1E2,
    F1V2,
    _at,
    _cross,
    _dot,
    _entry,
    _length,
    _minus,
    _times,
    _turned,
    _turned_back,
    _widest,
    facet_rows,
    pair_bounds,
)
from fcdm_opt.motion import instructions as codes
from fcdm_opt.proof.least_distance import _lowest, add, inner, nearest, norm

ROW_TARGET, ROW_LINE, ROW_SEPARATION, ROW_DEPTH, ROW_GAP, ROW_BOUND = range(6)
TYPE, KIND, ONE, TWO, P1, P2, BODY, V, W, EQUAL = range(10)
ROW = 10  # integers of a row; its numbers are the path position s, the side, and the level or edges' orientation
POSITION, ORIENTATION, SIGN = range(3)
FOUND, NOWHERE, STUCK, BROKEN, GOES_ON = range(5)  # how a descent ended
STEPS, HALVINGS, PATIENCE = 40, 8, 4
STEEPEST = 0.6  # radians, or share of the bodies' size: longest step
EXACT = 1e-13  # of the unit: steps and violations that are rounding
NEAR_EXACT = 1e-10  # where rounding stops a descent
HOPELESS = 1e-3  # violation, in units, up to which a larger amount than is known ends a descent
SPREAD = 1e-6  # step of the second differences, in units
LEAST_CURVE = 0.05  # least eigenvalue kept of the Lagrangian's Hessian
FAR = 1e9  # amounts of motions are below this, in units; merits of directions without any above
GROWTH = 0.3  # relative: how much further the next step along a ray is, up to the longest
FINER = 4.0  # times the points of a path that others look at: nothing is gained from what lies between those
ROOT_HALVINGS = 100  # of a stretch at whose end the requirement is met
CROSSING = 3e-7  # sine of the angle between two tracked lines, below which their pair is hardly known
ROUNDING = 4e-15  # of lines, relative: over that sine, what a pair is to be beyond its target by, to be so for anyone
PARALLEL = 1e-15  # of a direction: it leaves a parameter as it is
_TINY = 1e-300


# ------------------------------------------------------------------------------------------------------- the motion


@light
@kernel
def group_to_meet(normals, levels, alternatives, groups, kept, y, slack, rather_few):
    """Return the group of conditions normals . y >= levels to meet next, and by how much y misses it; see `Choices`.

    Of those missed by more than `slack` it is the one missed by most, where that is wanted of the fewest alternatives.
    A group is missed by as much as the best of its alternatives is, of those that `kept` names by that one, and an
    alternative by as much as the worst of its rows.
    """
    chosen, fewest, most = 0, len(alternatives), -np.inf
    for g in range(len(groups)):
        first, last = groups[g], groups[g + 1] if g + 1 < len(groups) else len(alternatives)
        if kept[g] >= 0:
            first, last = kept[g], kept[g] + 1
        best = np.inf
        if rather_few and last - first > fewest:
            continue
        fewer = rather_few and last - first < fewest
        for a in range(first, last):
            end = alternatives[a + 1] if a + 1 < len(alternatives) else len(levels)
            missed = -np.inf
            for row in range(alternatives[a], end):
                short = levels[row]
                for k in range(len(y)):
                    short -= normals[row, k] * y[k]
                missed = max(missed, short)
                if missed >= best:
                    break  # no better than another
            best = min(best, missed)
            if best <= (slack if fewer else max(most, slack)):
                break  # it is not the one
        if best > slack and (fewer or best > most):
            chosen, fewest, most = g, last - first, best
    return chosen, most


@light
@kernel
def furthest_rows(normals, levels, alternatives, first, last, y):
    """Return of each of the alternatives from one to another the row that y misses by most."""
    rows = np.empty(last - first, np.int64)
    for a in range(first, last):
        end = alternatives[a + 1] if a + 1 < len(alternatives) else len(levels)
        most = -np.inf
        for row in range(alternatives[a], end):
            short = levels[row] - inner(normals[row], y)
            if short > most:
                most, rows[a - first] = short, row
    return rows


@kernel
def run(table, constants, work, q, seeds, flat, count):
    """Run a motion's first instructions: fill `flat` with the pose (12,), then its derivatives by each parameter."""
    for k in range(count):
        op, out, a, b = table[k, 0], table[k, 1], table[k, 2], table[k, 3]
        if op == codes.CONST:
            work[out] = constants[k]
        elif op == codes.INPUT:
            work[out] = q[b] if a == 0 else seeds[b]
        elif op == codes.OUTPUT:
            flat[out] = work[a]
        elif op == codes.ADD:
            work[out] = work[a] + work[b]
        elif op == codes.SUB:
            work[out] = work[a] - work[b]
        elif op == codes.MUL:
            work[out] = work[a] * work[b]
        elif op == codes.DIV:
            work[out] = work[a] / work[b]
        elif op == codes.NEG:
            work[out] = -work[a]
        elif op == codes.SQ:
            work[out] = work[a] * work[a]
        elif op == codes.TWICE:
            work[out] = 2.0 * work[a]
        elif op == codes.SIN:
            work[out] = math.sin(work[a])
        elif op == codes.COS:
            work[out] = math.cos(work[a])
        elif op == codes.SQRT:
            work[out] = math.sqrt(work[a]) if work[a] >= 0.0 else math.nan
        elif op == codes.INV:
            work[out] = 1.0 / work[a]
        elif op == codes.ASSIGN:
            work[out] = work[a]
        elif op == codes.LT:
            work[out] = 1.0 if work[a] < work[b] else 0.0
        elif op == codes.LE:
            work[out] = 1.0 if work[a] <= work[b] else 0.0
        elif op == codes.NOT:
            work[out] = 0.0 if work[a] != 0.0 else 1.0
        elif op == codes.IF_ELSE_ZERO:
            work[out] = work[b] if work[a] != 0.0 else 0.0
        elif op == codes.FABS:
            work[out] = abs(work[a])
        elif op == codes.FMIN:
            work[out] = min(work[a], work[b])
        elif op == codes.FMAX:
            work[out] = max(work[a], work[b])
        elif op == codes.EXP:
            work[out] = math.exp(work[a])
        elif op == codes.LOG:
            work[out] = math.log(work[a])
        elif op == codes.POW:
            work[out] = work[a] ** work[b]
        elif op == codes.TAN:
            work[out] = math.tan(work[a])
        elif op == codes.ATAN2:
            work[out] = math.atan2(work[a], work[b])
        elif op == codes.EQ:
            work[out] = 1.0 if work[a] == work[b] else 0.0
        elif op == codes.AND:
            work[out] = 1.0 if work[a] != 0.0 and work[b] != 0.0 else 0.0
        elif op == codes.OR:
            work[out] = 1.0 if work[a] != 0.0 or work[b] != 0.0 else 0.0
        elif op == codes.NE:
            work[out] = 1.0 if work[a] != work[b] else 0.0
        elif op == codes.SIGN:
            work[out] = (1.0 if work[a] > 0.0 else 0.0) - (1.0 if work[a] < 0.0 else 0.0)


@kernel
def _place(motion, z, s, q, flat, rates):
    """Fill `flat` with the pose at path position s and, if asked for, its derivatives by z."""
    table, constants, work, scale, seeds, short = motion
    k = len(scale)
    for m in range(k):
        q[m] = s * z[m] * scale[m]
    run(table, constants, work, q, seeds, flat, len(table) if rates else short)
    for m in range(k if rates else 0):
        for e in range(12):
            flat[12 + 12 * m + e] *= s * scale[m]


# ---------------------------------------------------------------------------------------------------- contact rows


@kernel
def _part(parts, p):
    reals, ints, places = parts
    return reals[places[p, 0] : places[p + 1, 0]], ints[places[p, 1] : places[p + 1, 1]]


@kernel
def _edge(part, k):
    """Return the first vertex of an edge, and the way to its other one."""
    reals, ints = part
    h = ints[3] + 8 * k
    return ints[h], _minus(_at(reals, ints[h + 1]), _at(reals, ints[h]))


@kernel
def _corner(part, face):
    """Return a vertex of a face."""
    ints = part[1]
    return ints[ints[3] + 4 * ints[ints[5] + face]]


@kernel
def _own_vertices(one, two, site):
    """Return a vertex of either part on the elements that a site names."""
    kind, i, j = site[0], site[1], site[2]
    if kind == F1V2:
        return _corner(one, i), j
    if kind == E1E2:
        return _edge(one, i)[0], _edge(two, j)[0]
    return i, _corner(two, j)


@kernel
def _line(parts1, parts2, site, sign, flat, out):
    """Fill `out`, (k + 1, 6), with a feature's (n, a, b, c) and their derivatives; nan where edges are parallel.

    The direction n is R e, e normal of a face of body 1, f, of one of body 2, or R e x f of edges over its length.
    """
    kind = site[0]
    one, two = _part(parts1, site[3]), _part(parts2, site[4])
    v, w = _own_vertices(one, two, site)
    e = f = n = u = 0.0, 0.0, 0.0
    if kind == E1E2:
        e, f = _times(sign, _edge(one, site[1])[1]), _edge(two, site[2])[1]
    elif kind == F1V2:
        e = _at(one[0], one[1][0] + site[1])
    else:
        f = _times(-1.0, _at(two[0], two[1][0] + site[2]))
    x, y, steep = _at(one[0], v), _at(two[0], w), 1.0
    for m in range(len(out)):
        at = 12 * m
        if kind == E1E2:
            u = _cross(_turned(flat, at, e), f)
            steep = _length(u) if m == 0 else steep
            u = _times(1.0 / steep, u)
            u = _minus(u, _times(_dot(n, u), n))
        else:
            u = _turned(flat, at, e) if kind == F1V2 else _times(1.0 if m == 0 else 0.0, f)
        out[m, 0], out[m, 1], out[m, 2] = u
        out[m, 3] = _dot(u, _turned(flat, 0, x))
        out[m, 4] = -_dot(u, y)
        out[m, 5] = _dot(u, _entry(flat, 9))
        if m == 0:
            n = u
        else:
            out[m, 3] += _dot(n, _turned(flat, at, x))
            out[m, 5] += _dot(n, _entry(flat, at + 9))


@kernel
def _pair(lines, count, nominal, target, s, rho):
    """Fill `rho`, (k + 1, 2), with the tracked scale pair and its derivatives; tell if it exists."""
    k = len(rho) - 1
    a, b, c = lines[0, 0, 3], lines[0, 0, 4], lines[0, 0, 5]
    if count == 2:
        d, e, f = lines[1, 0, 3], lines[1, 0, 4], lines[1, 0, 5]
        det = a * e - b * d
        if not abs(det) > 1e-9 * math.sqrt((a * a + b * b) * (d * d + e * e)):
            return False
        x, y = (c * e - b * f) / det, (a * f - c * d) / det
        rho[0, 0], rho[0, 1] = x, y
        for m in range(1, k + 1):
            u = lines[0, m, 5] - lines[0, m, 3] * x - lines[0, m, 4] * y
            v = lines[1, m, 5] - lines[1, m, 3] * x - lines[1, m, 4] * y
            rho[m, 0], rho[m, 1] = (u * e - b * v) / det, (a * v - u * d) / det
        return True
    x, y = nominal[0] + s * (target[0] - nominal[0]), nominal[1] + s * (target[1] - nominal[1])
    square = a * a + b * b
    excess = (c - a * x - b * y) / square
    rho[0, 0], rho[0, 1] = x + excess * a, y + excess * b
    for m in range(1, k + 1):
        u, v, w = lines[0, m, 3], lines[0, m, 4], lines[0, m, 5]
        change = (w - u * x - v * y) / square - excess * 2.0 * (a * u + b * v) / square
        rho[m, 0], rho[m, 1] = change * a + excess * u, change * b + excess * v
    return square > 0.0


@kernel
def _tracked(scene, flat, s, lines, rho):
    """Fill the lines of the tracked features at a pose and, at path position s, their pair; tell if it exists."""
    _, parts1, parts2, tracked, signs, pairs, _ = scene
    for t in range(len(tracked)):
        _line(parts1, parts2, tracked[t], signs[t], flat, lines[t])
    return len(tracked) == 0 or _pair(lines, len(tracked), pairs[0], pairs[1], s, rho)


@kernel
def evaluate(scene, rows, count, only, z, g, G):
    """Fill values g and gradients G of the rows (of those with `only` positive); tell if all exist."""
    # rows of features say that level + n . (d - x R v + y w) is not negative, n being the feature's direction
    motion, parts1, parts2, _, _, pairs, _ = scene
    ints, reals = rows
    k, target = len(z), pairs[1]
    flat, q = np.empty(12 * (k + 1)), np.empty(k)
    lines, own, rho = np.empty((2, k + 1, 6)), np.empty((k + 1, 6)), np.empty((k + 1, 2))
    offset, here = np.empty(3), -1.0
    for r in range(count):
        if only[r] <= 0.0:
            continue
        kind, s, orientation = ints[r, TYPE], reals[r, POSITION], reals[r, ORIENTATION]
        if kind == ROW_BOUND:
            for m in range(k):
                G[r, m] = orientation if m == ints[r, V] else 0.0
            g[r] = orientation * (z[ints[r, V]] - reals[r, SIGN])
            continue
        if s != here:
            _place(motion, z, s, q, flat, True)
            here = s
            if not _tracked(scene, flat, s, lines, rho):
                return False
        n, body, x, y, e = lines[0], ints[r, BODY], 0.0, 0.0, 0.0
        v, w = ints[r, V], ints[r, W]
        one, two = _part(parts1, ints[r, P1])[0], _part(parts2, ints[r, P2])[0]
        if kind == ROW_DEPTH:
            n = lines[ints[r, ONE]]
            if body == 1:
                x, w = 1.0, 0
            else:
                y, w, v = 1.0, v, 0
        elif kind in (ROW_SEPARATION, ROW_GAP):
            _line(parts1, parts2, ints[r, KIND : P2 + 1], reals[r, SIGN], flat, own)
            n = own
            if kind == ROW_GAP:
                x, y, e = target[0], target[1], 1.0
        for m in range(k + 1):
            value = 0.0
            if kind == ROW_TARGET:
                value = rho[m, body] - (target[body] if m == 0 else 0.0)
            elif kind == ROW_LINE:
                value = n[m, 3] * target[0] + n[m, 4] * target[1] - n[m, 5]
            elif kind == ROW_SEPARATION:
                value = n[m, 5] - n[m, 3] * rho[0, 0] - n[m, 4] * rho[0, 1]
                value -= n[0, 3] * rho[m, 0] + n[0, 4] * rho[m, 1] if m > 0 else 0.0
            else:
                value = n[m, 2 + body] if kind == ROW_DEPTH else -pairs[2, 0] if m == 0 else 0.0
                u = _turned(flat, 12 * m, _at(one, v))
                for c in range(3):
                    moved = e * flat[12 * m + 9 + c] - x * u[c]
                    if m == 0:
                        offset[c] = moved + y * two[w, c]
                    else:
                        value += n[0, c] * moved
                    value += n[m, c] * offset[c]
            if m == 0:
                g[r] = orientation * value
            else:
                G[r, m - 1] = orientation * value
    return True


# ------------------------------------------------------------------------------------------------------- active set


@light
@kernel
def arranged(G, h, walls, levels, centre):
    """Return rows G x >= h, with room for one more, and further ones, walls, over x - centre, all of length one.

    Normals and levels of both, (m + 1, k), (m + 1,), (n, k), (n,); walls of no direction have an infinite level.
    """
    count, k = len(h), len(centre)
    rows, sides, own, bounds = np.empty((count + 1, k)), np.empty(count + 1), np.empty((len(levels), k)), levels.copy()
    for r in range(count + len(levels)):
        n, level = (G[r], h[r]) if r < count else (walls[r - count], levels[r - count])
        length = norm(n)
        level = (level - inner(n, centre)) / length if length > 0.0 else np.inf
        if r < count:
            rows[r], sides[r] = n / length, level
        else:
            own[r - count], bounds[r - count] = n / length, level
    return rows, sides, own, bounds


@light
@kernel
def next_nearest(rows, sides, walls, bounds, order, first, found, lengths):
    """Return a wall whose least x, under the rows, is the shortest that is left, -1 for none, and how many are done.

    `found` is filled with the x of those done, and `lengths` with these; it is infinite where there is none, or was
    returned. Walls are looked at in an order of lower bounds, and only those that can be next.
    """
    last, best = len(sides) - 1, -1
    equal, x, duals = np.zeros(last + 1, np.bool_), np.empty(rows.shape[1]), np.empty(last + 1)
    for k in order[:first]:
        if lengths[k] < np.inf and (best < 0 or lengths[k] < lengths[best]):
            best = k
    while first < len(order) and bounds[order[first]] < np.inf:
        k = order[first]
        if best >= 0 and lengths[best] <= max(bounds[k], 0.0):
            break
        rows[last], sides[last] = walls[k], bounds[k]
        if nearest(rows, sides, equal, last + 1, x, duals):
            found[k], lengths[k] = x, norm(x)
            if best < 0 or lengths[k] < lengths[best]:
                best = k
        first += 1
    return best, first


@kernel
def _factored(H, L, least):
    """Fill L with the Cholesky factor of H; tell if all squares of its diagonal are above `least`."""
    for a in range(len(H)):
        for b in range(a + 1):
            total = H[a, b] - inner(L[a, :b], L[b])
            if a > b:
                L[a, b] = total / L[b, b]
            elif total > least:
                L[a, a] = math.sqrt(total)
            else:
                return False
    return True


@kernel
def _forward(L, b, x):
    """Fill x with the solution of L x = b."""
    for a in range(len(b)):
        x[a] = (b[a] - inner(x[:a], L[a])) / L[a, a]


@kernel
def _backward(L, x):
    """Replace x by the solution of L' y = x."""
    for a in range(len(x) - 1, -1, -1):
        for m in range(a + 1, len(x)):
            x[a] -= L[m, a] * x[m]
        x[a] /= L[a, a]


@kernel
def newton(H, G, h, equal, count, z, step, duals):
    """Fill `step` with the least of p'Hp / 2 + z'p that keeps h + G p >= 0, or = 0; tell if there is one."""
    k = len(z)
    L, low = np.zeros((k, k)), np.empty(k)
    if not _factored(H, L, LEAST_CURVE):
        return False
    _forward(L, z, low)
    turned, levels, lengths = np.empty((count, k)), np.empty(count), np.empty(count)
    for c in range(count):
        _forward(L, G[c], turned[c])
        lengths[c] = max(norm(turned[c]), _TINY)
        levels[c] = (inner(turned[c], low) - h[c]) / lengths[c]
        turned[c] /= lengths[c]
    if not nearest(turned, levels, equal, count, step, duals):
        return False
    for c in range(count):
        duals[c] /= lengths[c]
    add(step, -1.0, low)
    _backward(L, step)
    return True


@kernel
def _relaxed(G, h, equal, count, z, step):
    """Fill `step` with one that violates linearised rows as little as possible, in squares, where none keeps them."""
    k = len(z)
    A, L, b = np.zeros((k, k)), np.zeros((k, k)), np.empty(k)
    for m in range(k):
        A[m, m], b[m] = 1e-6, -1e-6 * z[m]
    for c in range(count):
        if equal[c] or h[c] < 0.0:
            add(b, -h[c], G[c])
            for m in range(k):
                add(A[m], G[c, m], G[c])
    _factored(A, L, 0.0)
    _forward(L, b, step)
    _backward(L, step)


# ---------------------------------------------------------------------------------------------------------- descent


@kernel
def normalised(scene, rows, count, all_rows, z, g, G, lengths):
    """Fill values and gradients of all rows at z, over the gradients' lengths; tell if they are finite."""
    if not evaluate(scene, rows, count, all_rows, z, g, G):
        return False
    finite = True
    for c in range(count):
        length = norm(G[c])
        finite = finite and length < np.inf and abs(g[c]) < np.inf
        lengths[c] = max(length, 1e-9)
        g[c] /= lengths[c]
        G[c] /= lengths[c]
    return finite


@kernel
def _violation(g, equal, count):
    total, most = 0.0, 0.0
    for c in range(count):
        short = abs(g[c]) if equal[c] else max(-g[c], 0.0)
        total, most = total + short, max(most, short)
    return total, most


@kernel
def _curvature(scene, rows, count, z, duals, G, lengths, g2, G2, H):
    """Subtract from H the second differences of the rows that count, by their multipliers; tell if there are any."""
    k, ints, only, shifted = len(z), rows[0], np.zeros(count), np.empty(len(z))
    for c in range(count):
        only[c] = 1.0 if duals[c] != 0.0 and ints[c, TYPE] != ROW_BOUND else 0.0
    for m in range(k):
        shifted[:] = z
        shifted[m] += SPREAD
        if not evaluate(scene, rows, count, only, shifted, g2, G2):
            return False
        for c in range(count):
            if only[c] > 0.0:
                for other in range(k):
                    H[m, other] -= duals[c] * (G2[c, other] / lengths[c] - G[c, other]) / SPREAD
    H[:] = 0.5 * (H + H.T)
    return True


@kernel
def _blend(H, share):
    """Replace H by a share of it, the rest the unit matrix."""
    for m in range(len(H)):
        for n in range(len(H)):
            H[m, n] = share * H[m, n] if share > 0.0 else 0.0
        H[m, m] += 1.0 - share


@often
@kernel
def descend(scene, rows, count, steepest, z, duals, enough):
    """Move z to the least vector that keeps the rows, from where it is; return how it ended.

    Each step solves the least distance problem of the linearised rows, from the second on with the Lagrangian's
    Hessian by differences of gradients; a step is shortened until violation or amount fall.
    """
    k = len(z)
    g, G, lengths = np.empty(count), np.empty((count, k)), np.empty(count)
    g2, G2, lengths2 = np.empty(count), np.empty((count, k)), np.empty(count)
    all_rows, equal = np.ones(count), rows[0][:count, EQUAL] > 0
    H, step, trial = np.zeros((k, k)), np.empty(k), np.empty(k)
    duals[:count] = 0.0
    if not normalised(scene, rows, count, all_rows, z, g, G, lengths):
        return BROKEN
    last, idle, least, price = np.inf, 0, np.inf, 0.0
    for turn in range(STEPS):
        total, most = _violation(g, equal, count)
        idle = 0 if most < 0.8 * least else idle + 1
        least = min(least, most)
        _blend(H, 0.0)
        curved = turn > 0 and norm(duals[:count]) > 0.0
        if curved and not _curvature(scene, rows, count, z, duals, G, lengths, g2, G2, H):
            return BROKEN
        done = newton(H, G, g, equal, count, z, step, duals)
        for _ in range(4 if turn > 0 else 0):
            if done:
                break
            _blend(H, 0.3)  # towards the plain least distance problem
            done = newton(H, G, g, equal, count, z, step, duals)
        if not done:
            if idle >= PATIENCE:
                return NOWHERE
            duals[:count] = 0.0
            _relaxed(G, g, equal, count, z, step)
        longest, far, size = np.abs(step / steepest).max(), np.abs(step).max(), np.abs(z).max()
        if not far < np.inf:
            return BROKEN
        if done and far <= EXACT * (1.0 + size) * 10.0 and most <= EXACT * 100.0:
            return FOUND
        if longest > 1.0:
            step /= longest
        for c in range(count):
            price = max(price, 2.0 * abs(duals[c]))
        here, t, accepted = 0.5 * norm(z) ** 2 + price * total, 1.0, False
        amount = now = peak = 0.0
        for _ in range(HALVINGS):
            trial[:] = z + t * step
            amount = 0.5 * norm(trial) ** 2
            if normalised(scene, rows, count, all_rows, trial, g2, G2, lengths2):
                now, peak = _violation(g2, equal, count)
                accepted = amount + price * now <= here - 1e-4 * t * max(here - amount, 0.0) or peak <= 0.5 * most
                accepted = accepted or (far * t <= 1e-3 and peak <= max(most, 1e-4))
                if accepted:
                    break
            t *= 0.4
        if not accepted:
            return FOUND if done and far <= NEAR_EXACT and most <= NEAR_EXACT else STUCK
        z[:] = trial
        g, g2, G, G2, lengths, lengths2 = g2, g, G2, G, lengths2, lengths
        if done and far <= NEAR_EXACT and far >= 0.3 * last and peak <= NEAR_EXACT:
            return FOUND  # rounding
        last = far
        if done and turn > 1 and peak < HOPELESS and math.sqrt(2.0 * amount) > enough * (1.0 + 10.0 * HOPELESS):
            return STUCK
    return STUCK


# -------------------------------------------------------------------------------------------------------- coherence


@kernel
def _inside(part, rho, x, slack):
    """Tell whether a point, in a part's axes relative to its seed, lies in the part at a scale."""
    reals, ints = part
    for f in range(ints[1]):
        m = _at(reals, ints[0] + f)
        if not _dot(m, x) <= rho * _dot(m, _at(reals, _corner(part, f))) + slack:
            return False
    return True


@kernel
def _shared(parts1, parts2, site, flat, x, y, slack):
    """Tell whether the vertex or crossing of edges that a feature names lies in both parts at a scale pair."""
    one, two, d = _part(parts1, site[3]), _part(parts2, site[4]), _entry(flat, 9)
    v, w = _own_vertices(one, two, site)
    moved, p = _minus(_turned(flat, 0, _times(x, _at(one[0], v))), d), _times(y, _at(two[0], w))  # relative to s_2
    if site[0] == E1E2:
        b, c = _turned(flat, 0, _times(x, _edge(one, site[1])[1])), _times(y, _edge(two, site[2])[1])
        s, bb, bc = _minus(moved, p), _dot(b, b), _dot(b, c)
        det = bb * _dot(c, c) - bc * bc
        u = min(max((bb * _dot(c, s) - bc * _dot(b, s)) / det, 0.0), 1.0) if det > 0.0 else 0.5
        p = _minus(p, _times(-u, c))
    elif site[0] != F1V2:
        p = moved
    own = _turned_back(flat, 0, _minus(p, _times(-1.0, d)))
    return _inside(two, y, p, slack) and _inside(one, x, own, slack)


@kernel
def _orientation(parts1, parts2, site, p1, p2, flat, n):
    """Return the sign with which a site's normal is n; of edges that of edge 1 x edge 2."""
    if site[0] != E1E2:
        return 1.0
    e, f = _edge(_part(parts1, p1), site[1])[1], _edge(_part(parts2, p2), site[2])[1]
    return 1.0 if _dot(n, _cross(_turned(flat, 0, e), f)) > 0.0 else -1.0


@kernel
def _note(faults, count, kind, s, orientation, sign, site, p1, p2, body, v, amount):
    """Note a fault, or a worse one of the same kind; return how many are known."""
    ints, reals, excess = faults
    at = count
    for r in range(count):
        same = ints[r, TYPE] == kind and ints[r, P1] == p1 and ints[r, P2] == p2
        same = same and reals[r, ORIENTATION] == orientation and ints[r, BODY] == body and ints[r, V] == v
        if same and ints[r, KIND] == site[0] and ints[r, ONE] == site[1] and ints[r, TWO] == site[2]:
            if not amount > excess[r]:
                return count
            at = r
    if at == len(ints):
        return count
    ints[at] = 0
    ints[at, TYPE], ints[at, KIND], ints[at, ONE], ints[at, TWO] = kind, site[0], site[1], site[2]
    ints[at, P1], ints[at, P2], ints[at, BODY], ints[at, V] = p1, p2, body, v
    reals[at, POSITION], reals[at, ORIENTATION], reals[at, SIGN], excess[at] = s, orientation, sign, amount
    return max(count, at + 1)


@kernel
def path_faults(scene, z, first, faults):
    """Fill `faults`, rows that forbid what is wrong with the tracked contact along the path; return how many.

    The worst fault of each kind, as `Task.path_faults`; -1 where the tracked pair does not exist. With `first` what is
    met first.
    """
    motion, parts1, parts2, tracked, _, _, path = scene
    k, count, turned, slack = len(z), 0, 0.0, path[4]
    for m in range(k):
        turned += abs(z[m] * motion[3][m]) * path[5 + m]
    points = max(int(path[0]), int(np.ceil(min(turned, path[3]) / path[2])))
    flat, q, lines, rho = np.empty(12 * (k + 1)), np.empty(k), np.empty((2, 1, 6)), np.empty((1, 2))
    for point in range(points if path[1] > 0.0 else 1):
        s = 1.0 - point / points
        _place(motion, z, s, q, flat, False)
        if not _tracked(scene, flat, s, lines, rho):
            return -1
        x, y = rho[0, 0], rho[0, 1]
        if not (x > 0.0 and y > 0.0 and x < np.inf and y < np.inf):
            return -1
        for t in range(len(tracked)):
            line, p1, p2 = lines[t, 0], tracked[t, 3], tracked[t, 4]
            n = _entry(line, 0)
            v, high = _highest(_part(parts1, p1), _turned_back(flat, 0, n))
            w, low = _highest(_part(parts2, p2), _times(-1.0, n))
            site = (tracked[t, 0], t, tracked[t, 2])
            for body in (1, 2):
                vertex, over = (v, (high - line[3]) * x) if body == 1 else (w, (low - line[4]) * y)
                if not over <= slack:
                    count = _note(faults, count, ROW_DEPTH, s, 1.0, 0.0, site, p1, p2, body, vertex, over)
        met = False
        if len(parts1[2]) * len(parts2[2]) <= 4:
            for t in range(len(tracked)):
                met = met or _shared(parts1, parts2, tracked[t], flat, x, y, 0.01 * slack)
        if not met:
            count = _others(scene, lines, flat, x, y, s, faults, count)
        if first and count:
            return count
    return count


@kernel
def _highest(part, n):
    """Return the vertex of a part that reaches furthest along n, and its height."""
    vertex, least = _lowest(part[0][: part[1][0]], _times(-1.0, n))
    return vertex, -least


@kernel
def _others(scene, lines, flat, x, y, s, faults, count):
    """Note other part pairs that overlap, and tracked ones that are apart."""
    # the latter not where the contact has moved over a seam in the same plane
    _, parts1, parts2, tracked, _, _, path = scene
    pose, slack = flat[:12].copy(), path[4]
    flats, known = np.empty((64, 3)), 0
    bounds = pair_bounds(*parts1, *parts2, pose, np.array([x, y]))
    for turn in range(2):  # first all others, which tell of seams
        for p1 in range(bounds.shape[0]):
            for p2 in range(bounds.shape[1]):
                touching = False
                for t in range(len(tracked)):
                    touching = touching or (tracked[t, 3] == p1 and tracked[t, 4] == p2)
                if touching != (turn == 1) or not (touching or bounds[p1, p2] <= slack):
                    continue
                sites, rows = facet_rows(*_part(parts1, p1), *_part(parts2, p2), pose)
                best, widest = _widest(rows, x, y)
                orientation, wrong = (-1.0, widest > slack) if touching else (1.0, not -widest <= slack)
                if touching and wrong and known > 0:
                    excused = True
                    for t in range(len(tracked)):
                        if tracked[t, 3] == p1 and tracked[t, 4] == p2:
                            same = False
                            for m in range(known):
                                same = same or _dot(lines[t, 0], flats[m]) > 1.0 - 1e-9
                            excused = excused and same
                    wrong = not excused
                if wrong:
                    sign = _orientation(parts1, parts2, sites[best], p1, p2, flat, rows[best])
                    site = _at(sites, best)
                    count = _note(faults, count, ROW_SEPARATION, s, orientation, sign, site, p1, p2, 0, 0, abs(widest))
                elif not touching and widest <= slack:
                    for r in range(len(rows)):
                        if rows[r, 5] - rows[r, 3] * x - rows[r, 4] * y >= -slack and known < len(flats):
                            flats[known] = rows[r, :3]
                            known += 1
    return count


# ------------------------------------------------------------------------------------------------- touch and clear


@light
@kernel
def separating_features(scene, z, p1, p2):
    """Return the sites of a part pair at z, edges' orientations, normals, separations, and slopes by z."""
    motion, parts1, parts2, _, _, pairs, _ = scene
    k, site = len(z), np.array([0, 0, 0, p1, p2])
    flat, q, line = np.empty(12 * (k + 1)), np.empty(k), np.empty((k + 1, 6))
    _place(motion, z, 1.0, q, flat, True)
    sites, rows = facet_rows(*_part(parts1, p1), *_part(parts2, p2), flat[:12])
    orientations, gaps, steep = np.empty(len(sites)), np.empty(len(sites)), np.empty(len(sites))
    x, y = pairs[1, 0], pairs[1, 1]
    for r in range(len(sites)):
        orientations[r] = _orientation(parts1, parts2, sites[r], p1, p2, flat, rows[r])
        gaps[r] = rows[r, 5] - rows[r, 3] * x - rows[r, 4] * y
        site[:3] = sites[r]
        _line(parts1, parts2, site, orientations[r], flat, line)
        square = 0.0
        for m in range(1, k + 1):
            slope = line[m, 5] - line[m, 3] * x - line[m, 4] * y
            square += slope * slope
        steep[r] = math.sqrt(square)
    return sites, orientations, rows[:, :3].copy(), gaps, steep


@kernel
def _gap_row(rows, count, orientation, site, sign, p1, p2, v, w):
    """Add a row that two vertices are apart, or not, along a site's normal; return how many rows there are."""
    ints, reals = rows
    if count == len(ints):
        return count
    ints[count] = 0
    ints[count, TYPE], ints[count, KIND], ints[count, ONE], ints[count, TWO] = ROW_GAP, site[0], site[1], site[2]
    ints[count, P1], ints[count, P2], ints[count, V], ints[count, W] = p1, p2, v, w
    reals[count, POSITION], reals[count, ORIENTATION], reals[count, SIGN] = 1.0, orientation, sign
    return count if _is_known(rows, count, ints[count], reals[count]) else count + 1


@kernel
def _is_known(rows, count, ints, reals):
    """Tell whether a row is among the first ones."""
    known = False
    for r in range(count):
        known = known or (np.all(rows[0][r] == ints) and np.all(rows[1][r] == reals))
    return known


@kernel
def _foremost(parts1, parts2, p1, p2, flat, x, y, n):
    """Return the vertices of a part pair that reach furthest along n, and the separation there."""
    n = _entry(n, 0)
    v, first = _highest(_part(parts1, p1), _turned_back(flat, 0, n))
    w, second = _highest(_part(parts2, p2), _times(-1.0, n))
    return v, w, _dot(n, _entry(flat, 9)) - x * first - y * second


@light
@kernel
def grow(scene, rows, base, count, sites, made, closing, z, slack, duals, begins):
    """Add rows for what z violates; return (how it went on, rows, chosen sites).

    Each of the first `made` sites is to keep its part pair apart; pairs that come up are kept apart along the best of
    theirs. Rows that let `closing` meet and no longer bound its separation are dropped. `sites` are two arrays: sites,
    (n, 5), and their orientations, (n,); `begins` says to add rows of chosen sites and of `closing` first.
    """
    motion, parts1, parts2, tracked, _, pairs, _ = scene
    (ints, reals), (chosen, orientations), k = rows, sites, len(z)
    flat, q, line = np.empty(12 * (k + 1)), np.empty(k), np.empty((1, 6))
    x, y, need = pairs[1, 0], pairs[1, 1], pairs[2, 0]
    pose, changed, faulty = flat[:12], begins, False
    if len(tracked) and not begins:
        wrong = (np.zeros((32, ROW), np.int64), np.zeros((32, 3)), np.zeros(32))
        faults = path_faults(scene, z, False, wrong)
        if faults < 0:
            return BROKEN, count, made
        faulty = faults > 0
        for f in range(faults):
            if count < len(ints) and not _is_known(rows, count, wrong[0][f], wrong[1][f]):
                ints[count], reals[count], duals[count] = wrong[0][f], wrong[1][f], 0.0
                count += 1
                changed = True
    if need > -np.inf:
        _place(motion, z, 1.0, q, flat, False)
        for c in range(made):
            p1, p2 = chosen[c, 3], chosen[c, 4]
            _line(parts1, parts2, chosen[c], orientations[c], pose, line)
            v, w, gap = _foremost(parts1, parts2, p1, p2, flat, x, y, line[0])
            if gap < need - slack or begins:
                before = count
                count = _gap_row(rows, count, 1.0, chosen[c], orientations[c], p1, p2, v, w)
                changed = changed or count > before
        bounds = pair_bounds(*parts1, *parts2, pose, pairs[1])
        for p1 in range(0 if begins else bounds.shape[0]):
            for p2 in range(bounds.shape[1]):
                known = bounds[p1, p2] >= need
                for c in range(made):
                    known = known or (chosen[c, 3] == p1 and chosen[c, 4] == p2)
                if known or made == len(chosen):
                    continue
                facets, lines = facet_rows(*_part(parts1, p1), *_part(parts2, p2), pose)
                best, widest = _widest(lines, x, y)
                if widest < need - slack:
                    chosen[made, :3], chosen[made, 3], chosen[made, 4] = facets[best], p1, p2
                    orientations[made] = _orientation(parts1, parts2, facets[best], p1, p2, flat, lines[best])
                    v, w, _ = _foremost(parts1, parts2, p1, p2, flat, x, y, lines[best])
                    count = _gap_row(rows, count, 1.0, chosen[made], orientations[made], p1, p2, v, w)
                    made += 1
                    changed = True
    if closing[0] >= 0:
        p1, p2 = closing[0], closing[1]
        kept = base
        for r in range(base, count):
            stale = False
            if ints[r, TYPE] == ROW_GAP and reals[r, ORIENTATION] < 0.0:
                _line(parts1, parts2, ints[r, KIND : P2 + 1], reals[r, SIGN], pose, line)
                gap = _foremost(parts1, parts2, p1, p2, flat, x, y, line[0])[2]
                one, two = _at(_part(parts1, p1)[0], ints[r, V]), _at(_part(parts2, p2)[0], ints[r, W])
                offset = _minus(_times(x, _turned(flat, 0, one)), _times(y, two))
                stale = not _dot(line[0], _minus(_entry(flat, 9), offset)) <= gap + slack
                changed = changed or (stale and duals[r] > 0.0)
            if not stale:
                ints[kept], reals[kept], duals[kept] = ints[r], reals[r], duals[r]
                kept += 1
        count = kept
        facets, lines = facet_rows(*_part(parts1, p1), *_part(parts2, p2), pose)
        widest = _widest(lines, x, y)[1]
        for r in range(len(lines)):
            wide = lines[r, 5] - lines[r, 3] * x - lines[r, 4] * y
            if wide > slack and wide >= 0.5 * widest:
                v, w = _own_vertices(_part(parts1, p1), _part(parts2, p2), facets[r])
                sign = _orientation(parts1, parts2, facets[r], p1, p2, flat, lines[r])
                count = _gap_row(rows, count, -1.0, facets[r], sign, p1, p2, v, w)
        changed = changed or widest > slack
    return (GOES_ON if changed else NOWHERE if faulty else FOUND), count, made


# ------------------------------------------------------------------------------------------------- direction search
# A path is the straight ray to its motion, so that motions with two parameters are a fan of rays: each direction, an
# angle in weighted coordinates, has the least amount at which the requirement is met before coherence ends. What is
# asked of a ray is its *objective*: that amount, or, where there is none, `FAR` plus what is missing at best. Over the
# directions it is least at the least motion, whether that is a smooth minimum, or where the contact ends just as it is
# beyond.


@kernel
def beyond(scene, orientations, z, room):
    """Return by how much the tracked pair is beyond its target, relative; -inf where there is none."""
    q, flat, lines, rho, _ = room  # so that nothing is allocated
    _place(scene[0], z, 1.0, q, flat, False)
    exists, pairs = _tracked(scene, flat, 1.0, lines, rho), scene[5]
    a, b, d, e = lines[0, 0, 3], lines[0, 0, 4], lines[1, 0, 3], lines[1, 0, 4]
    parallel = not abs(a * e - b * d) > CROSSING * math.sqrt((a * a + b * b) * (d * d + e * e))
    if parallel or not exists:
        return -np.inf
    least = np.inf
    noise = ROUNDING * math.sqrt((a * a + b * b) * (d * d + e * e)) / abs(a * e - b * d)
    for body in range(2):
        if orientations[body] != 0.0:
            least = min(least, orientations[body] * (rho[0, body] - pairs[1, body]) / pairs[1, body] - noise)
    return least


@kernel
def _lost(scene, path, orientations, z, room):
    """Tell whether the contact is not real at a motion, or its two lines all but parallel."""
    motion, parts1, parts2, tracked, signs, pairs, _ = scene
    if path_faults((motion, parts1, parts2, tracked, signs, pairs, path), z, True, room[4]):
        return True
    return beyond(scene, orientations, z, room) == -np.inf


@kernel
def objectives(scene, orientations, limits, steps, angles, cap, halvings):
    """Return the merits of several directions, see above; amounts beyond `cap` or the least so far are not told apart.

    `orientations`, (2,), are signs of "beyond" for each body, 0 where it does not matter; `limits`, (2, 2), of each z;
    `steps`, (3,), the first step along a ray, and the largest of each z; `angles`, (n,), those of the directions, in
    radians; `halvings` those of a stretch at whose end the contact is lost.
    """
    path, objectives = scene[6], np.full(len(angles), 2.0 * FAR)
    direction, z = np.empty(2), np.empty(2)
    faults = (np.zeros((4, ROW), np.int64), np.zeros((4, 3)), np.zeros(4))
    room = np.empty(2), np.empty(12 * 3), np.empty((2, 1, 6)), np.empty((1, 2)), faults
    looks = np.empty((3, len(path)))
    looks[:] = path
    looks[0, 1] = 0.0  # the end of a path alone; then all of it, and more of it
    looks[2, 0], looks[2, 2] = FINER * path[0], path[2] / FINER
    for n in range(len(angles)):
        direction[0], direction[1] = math.cos(angles[n]), math.sin(angles[n])
        start, end, longest = 0.0, cap, np.inf
        for k in range(2):
            if abs(direction[k]) > PARALLEL:
                one, two = limits[k, 0] / direction[k], limits[k, 1] / direction[k]
                start, end = max(start, min(one, two)), min(end, max(one, two))
                longest = min(longest, steps[1 + k] / abs(direction[k]))
            elif limits[k, 0] > 0.0 or limits[k, 1] < 0.0:
                end = -np.inf
        before, best, lost = 0.0, -np.inf, not start <= end
        while before < end and not lost:
            ahead = min(before + max(steps[0], min(longest, GROWTH * before)), end)
            if before < start < ahead:
                ahead = start
            z[0], z[1] = ahead * direction[0], ahead * direction[1]
            lost = _lost(scene, looks[0], orientations, z, room)
            low, high = before, ahead
            for _ in range(halvings if lost else 0):
                middle = 0.5 * (low + high)
                if not low < middle < high:
                    break
                z[0], z[1] = middle * direction[0], middle * direction[1]
                if _lost(scene, looks[0], orientations, z, room):
                    high = middle
                else:
                    low = middle
            ahead = low if lost else ahead
            z[0], z[1] = ahead * direction[0], ahead * direction[1]
            value = beyond(scene, orientations, z, room)
            if ahead >= start and ahead > 0.0:
                best = max(best, value)
                if value >= 0.0:
                    low, high = before, ahead
                    for _ in range(ROOT_HALVINGS if low >= start else 0):
                        middle = 0.5 * (low + high)
                        if not low < middle < high:
                            break
                        z[0], z[1] = middle * direction[0], middle * direction[1]
                        if beyond(scene, orientations, z, room) >= 0.0:
                            high = middle
                        else:
                            low = middle
                    z[0], z[1] = high * direction[0], high * direction[1]
                    lost_soon = _lost(scene, looks[1], orientations, z, room)
                    if not (lost_soon or _lost(scene, looks[2], orientations, z, room)):
                        objectives[n], cap = high, min(cap, high)
                    lost = True
            before = ahead
        if objectives[n] >= FAR:
            objectives[n] = FAR * (1.0 + min(-best, 1.0))
    return objectives
