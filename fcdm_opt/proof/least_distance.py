"""Compiled: least distance programs, by active sets, and the nearest points of two hulls as one of them."""

from __future__ import annotations

import math

import numpy as np

from fcdm_opt.compiling import kernel, step
from fcdm_opt.curve.kernels import _at, _cross, _dot, _entry, _length, _minus

STEPS = 80  # of the search for nearest points
NEWTON = 60  # steps to a distance: each halves what is left where they do worst, at a graze
NEAR = 1e-14  # its relative accuracy, of squares
ROUNDING = 256 * 2.0**-53  # of the heights that enter
FINE = 1e-15  # of the ends between which a distance is sought: a step that ends the search
FLAT = 1e-12  # determinants relative to their size below which a simplex has lost a dimension


@step
def inner(x, y):
    """Return x . y, of any length."""
    total = 0.0
    for m in range(len(x)):
        total += x[m] * y[m]
    return total


@step
def norm(x):
    """Return the length of x."""
    return math.sqrt(inner(x, x))


@step
def add(x, factor, y):
    """Add a multiple of y to x."""
    for m in range(len(x)):
        x[m] += factor * y[m]


@step
def _fill(x, factor, y):
    """Fill x with a multiple of y."""
    for m in range(len(x)):
        x[m] = factor * y[m]


@step
def _project(x, basis, count, shares):
    """Take from x its shares along the first orthonormal rows of a basis, twice over."""
    for b in range(count):
        shares[b] = 0.0
    for _again in range(2):
        for b in range(count):
            share = inner(basis[b], x)
            shares[b] += share
            add(x, -share, basis[b])


@kernel
def nearest(G, h, equal, count, x, duals):
    """Fill x with the least vector that keeps G x >= h, or = h; tell if there is one. Dual method of Goldfarb, Idnani.

    `duals` are the rows' shares in x; where there is none, the shares in which rows add up to what cannot be.

    Rows must be of length about one. The active rows' orthonormal basis is made anew from where it changes.
    """
    k = len(x)
    active, settled = np.empty(k + 1, np.int64), np.zeros(count, np.bool_)  # settled: or implied by the active rows
    basis, R = np.empty((k + 1, k)), np.zeros((k + 1, k + 1))
    z, r, along, multipliers = np.empty(k), np.empty(k + 1), np.empty(k + 1), np.zeros(k + 1)
    used = known = 0
    for m in range(k):
        x[m] = 0.0
    for c in range(count):
        duals[c] = 0.0
    for _ in range(20 * (k + count)):
        worst, pick, flip = -1e-14, -1, 1.0
        for c in range(count):
            if settled[c]:
                continue
            value = inner(G[c], x) - h[c]
            if equal[c]:  # before all others
                pick, flip = c, (-1.0 if value > 0.0 else 1.0)
                worst = -abs(value)
                break
            if value < worst * (1.0 + abs(h[c])):
                worst, pick, flip = value, c, 1.0
        if pick < 0:
            for a in range(used):
                duals[active[a]] = multipliers[a]
            return True
        own, short = 0.0, worst
        while True:
            for a in range(known, used):
                _fill(basis[a], 1.0, G[active[a]])
                _project(basis[a], basis, a, R[a])
                R[a, a] = norm(basis[a])
                _fill(basis[a], 1.0 / R[a, a], basis[a])
            known = used
            _fill(z, flip, G[pick])
            _project(z, basis, used, along)
            for a in range(used - 1, -1, -1):
                total = along[a]
                for b in range(a + 1, used):
                    total -= R[b, a] * r[b]
                r[a] = total / R[a, a]
            square = inner(z, z)
            free = square > 1e-18
            if not free and short > -1e-11:
                settled[pick] = True  # follows from those before it
                break
            if equal[pick] and not free:
                return False
            ratio, drop = np.inf, -1
            for a in range(used):
                if not equal[active[a]] and r[a] > 1e-14 and multipliers[a] / r[a] < ratio:
                    ratio, drop = multipliers[a] / r[a], a
            full = -short / square if free else np.inf
            t = min(ratio, full)
            if not t < np.inf:
                duals[pick] = 1.0
                for a in range(used):
                    duals[active[a]] = -r[a]
                return False
            if free:
                add(x, t, z)
            add(multipliers[:used], -t, r)
            own += t
            if free and full <= ratio:
                active[used], multipliers[used], settled[pick] = pick, own, True
                if flip < 0.0:  # an equality met from above: its row enters as it is
                    multipliers[used] = -own
                used += 1
                break
            settled[active[drop]] = False
            for a in range(drop, used - 1):
                active[a], multipliers[a] = active[a + 1], multipliers[a + 1]
            used, known = used - 1, drop
            short = flip * (inner(G[pick], x) - h[pick])
    return False


@step
def _lowest(points, n):
    """Return the point that is lowest along a direction, and its height."""
    vertex, least = 0, math.inf
    for v in range(len(points)):
        height = n[0] * points[v, 0] + n[1] * points[v, 1] + n[2] * points[v, 2]
        if height < least:
            vertex, least = v, height
    return vertex, least


@kernel
def nearest_points(points1, points2):
    """Return the least of points2 - points1 over the hulls of (n1, 3) and (n2, 3), and how much of which points.

    The latter as pairs, (m, 2), and shares, (m,); zero where the hulls meet, with shares in a point of both. Wolfe's
    method, on at most four pairs of points.
    """
    pairs, simplex, weights, own = np.zeros((5, 2), np.int64), np.empty((5, 3)), np.empty(5), np.empty(5)
    count, square = 1, 0.0
    x = points2[0, 0] - points1[0, 0], points2[0, 1] - points1[0, 1], points2[0, 2] - points1[0, 2]
    simplex[0, 0], simplex[0, 1], simplex[0, 2] = x
    weights[0] = 1.0
    for _ in range(STEPS):
        i, ahead = _lowest(points1, (-x[0], -x[1], -x[2]))
        j, behind = _lowest(points2, x)
        square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
        met = square - (behind + ahead) <= NEAR * square + ROUNDING * (abs(behind) + abs(ahead))
        for k in range(count):
            met = met or (pairs[k, 0] == i and pairs[k, 1] == j)
        if met:
            break
        pairs[count, 0], pairs[count, 1], weights[count] = i, j, 0.0
        for m in range(3):
            simplex[count, m] = points2[j, m] - points1[i, m]
        count += 1
        while count > 1:
            if not _lightest(simplex, count, own):
                count, met = count - 1, True
                break
            part, out = 1.0, -1
            for k in range(count):
                if own[k] <= 0.0:
                    ratio = weights[k] / (weights[k] - own[k]) if weights[k] > 0.0 else 0.0
                    if out < 0 or ratio < part:
                        part, out = ratio, k
            for k in range(count):
                weights[k] += part * (own[k] - weights[k])
            if out < 0:
                break
            count -= 1
            for k in range(out, count):
                weights[k], pairs[k, 0], pairs[k, 1] = weights[k + 1], pairs[k + 1, 0], pairs[k + 1, 1]
                for m in range(3):
                    simplex[k, m] = simplex[k + 1, m]
        x = (0.0, 0.0, 0.0)
        if count == 4 and not met:
            break
        for k in range(count):
            x = x[0] + weights[k] * simplex[k, 0], x[1] + weights[k] * simplex[k, 1], x[2] + weights[k] * simplex[k, 2]
        if met:
            break
    return x, pairs[:count], weights[:count]


@kernel
def nearer_than(need, points1, points2, direction, low, high, normals):
    """Return from where to where a hull that shifts along a way is nearer to another than `need`, and how near midway.

    It is not up to `low`, nor from `high` on. Infinite, with the end first, where it never is. `normals`, (2, 3), are
    set to directions that keep the hulls apart so far before and beyond.
    """
    moved = np.empty(points1.shape)
    first = _approach(points1, points2, direction, 1.0, need, low, high, moved, normals[0])
    last = -_approach(points1, points2, direction, -1.0, need, -high, -low, moved, normals[1])
    if not first < last:
        return first, last, need
    return first, last, _length(_between(points1, points2, direction, 0.5 * (first + last), moved))


@kernel
def _between(points1, points2, direction, shift, moved):
    """Return the way between the nearest points after a shift."""
    for v in range(len(points1)):
        for m in range(3):
            moved[v, m] = points1[v, m] + shift * direction[m]
    return nearest_points(moved, points2)[0]


@kernel
def _approach(points1, points2, direction, sign, need, start, end, moved, n):
    """Return how far along a way, or back, two hulls shift from `start` until they are only `need` apart.

    Infinite where that is not before `end`. Newton's method: the distance is convex along the way, so that no step goes
    too far; n is set to the direction that proves it.
    """
    here = start
    for _ in range(NEWTON):
        x = _between(points1, points2, direction, sign * here, moved)
        distance = _length(x)
        if not distance > 0.0:
            return here
        u = x[0] / distance, x[1] / distance, x[2] / distance
        room = _lowest(points2, u)[1] + _lowest(moved, (-u[0], -u[1], -u[2]))[1] - need
        closing = sign * _dot(u, _entry(direction, 0))
        n[0], n[1], n[2] = u
        if not closing > 0.0 or here + room / closing >= end:
            return math.inf
        here += max(room / closing, 0.0)
        if room <= FINE * closing * (abs(start) + abs(end)):
            break
    return here


@step
def _lightest(simplex, count, own):
    """Fill the shares of a simplex' points in the point of its affine hull nearest to zero; tell if it has them."""
    z = _at(simplex, 0)
    a = _minus(_at(simplex, 1), z)
    b = _minus(_at(simplex, 2), z) if count > 2 else a
    if count == 2:
        square = _dot(a, a)
        if not square > 0.0:
            return False
        own[1] = -_dot(a, z) / square
    elif count == 3:
        n = _cross(a, b)
        square = _dot(n, n)
        if not square > FLAT * _dot(a, a) * _dot(b, b):
            return False
        own[1], own[2] = -_dot(_cross(z, b), n) / square, -_dot(_cross(a, z), n) / square
    else:
        d = _minus(_at(simplex, 3), z)
        n = _cross(a, b)
        volume = _dot(n, d)
        if not volume * volume > FLAT * _dot(a, a) * _dot(b, b) * _dot(d, d):
            return False
        own[1], own[2], own[3] = -_dot(_cross(z, b), d) / volume, -_dot(_cross(a, z), d) / volume, -_dot(n, z) / volume
    own[0] = 1.0
    for k in range(1, count):
        own[0] -= own[k]
    return True
