"""Compiled: least distance programs, by active sets, and the nearest points of two hulls as one of them."""

from __future__ import annotations

import math

import numpy as np

from fcdm_opt.compiling import kernel, step

ROOM = 64  # pairs of points that may come to hold the nearest ones
NEAR = 1e-14  # relative: of a distance that is known


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


@kernel
def _project(x, basis, count, shares):
    """Take from x its shares along the first orthonormal rows of a basis, twice over."""
    shares[:count] = 0.0
    for _again in range(2):
        for b in range(count):
            share = inner(basis[b], x)
            shares[b] += share
            add(x, -share, basis[b])


@kernel
def nearest(G, h, equal, count, x, duals):
    """Fill x with the least vector that keeps G x >= h, or = h; tell if there is one. Dual method of Goldfarb, Idnani.

    `duals` are the rows' shares in x; where there is none, the shares in which rows add up to what cannot be.

    Rows must be of length about one. The active rows' orthonormal basis is made anew at each change: they are few.
    """
    k = len(x)
    active = np.empty(k + 1, np.int64)
    multipliers = np.zeros(k + 1)
    basis, R = np.empty((k + 1, k)), np.zeros((k + 1, k + 1))
    z, r, along = np.empty(k), np.empty(k + 1), np.empty(k + 1)
    implied = np.zeros(count, np.bool_)
    used = 0
    x[:] = 0.0
    duals[:count] = 0.0
    for _ in range(20 * (k + count)):
        worst, pick, flip = -1e-14, -1, 1.0
        for c in range(count):
            if implied[c]:
                continue
            value = inner(G[c], x) - h[c]
            held = False
            for a in range(used):
                held = held or active[a] == c
            if held:
                continue
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
            for a in range(used):
                basis[a] = G[active[a]]
                _project(basis[a], basis, a, R[a])
                R[a, a] = norm(basis[a])
                basis[a] /= R[a, a]
            z[:] = flip * G[pick]
            _project(z, basis, used, along)
            for a in range(used - 1, -1, -1):
                total = along[a]
                for b in range(a + 1, used):
                    total -= R[b, a] * r[b]
                r[a] = total / R[a, a]
            square = inner(z, z)
            free = square > 1e-18
            if not free and short > -1e-11:
                implied[pick] = True  # follows from those before it
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
                active[used], multipliers[used] = pick, own
                if flip < 0.0:  # an equality met from above: its row enters as it is
                    multipliers[used] = -own
                used += 1
                break
            for a in range(drop, used - 1):
                active[a], multipliers[a] = active[a + 1], multipliers[a + 1]
            used -= 1
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
    """Return the least of points2 - points1 over the hulls of (n1, 3) and (n2, 3), and how much of each, (n1, n2).

    Zero where they meet, with shares of a point of both. With z the differences of points, it is x / |x|^2 of the least
    x with z . x >= 1; the multipliers, scaled, are the shares of the points. Rows enter as they are violated.
    """
    G, h, x, duals, equal = np.empty((ROOM, 3)), np.empty(ROOM), np.zeros(3), np.zeros(ROOM), np.zeros(ROOM, np.bool_)
    pairs, shares = np.empty((ROOM, 2), np.int64), np.zeros((len(points1), len(points2)))
    i, j, unit, apart, known = 0, 0, 0.0, True, False
    for count in range(ROOM):
        length = 0.0
        for m in range(3):
            G[count, m] = points2[j, m] - points1[i, m]
            length += G[count, m] ** 2
        length = math.sqrt(length)
        if not length > 0.0:
            shares[i, j] = 1.0
            return (0.0, 0.0, 0.0), shares
        unit = length if count == 0 else unit
        G[count] /= length
        h[count], pairs[count, 0], pairs[count, 1] = unit / length, i, j
        apart = nearest(G, h, equal, count + 1, x, duals)
        i, ahead = _lowest(points1, (-x[0], -x[1], -x[2]))
        j, behind = _lowest(points2, (x[0], x[1], x[2]))
        for c in range(count + 1):
            known = known or (pairs[c, 0] == i and pairs[c, 1] == j)
        if not apart or known or ahead + behind >= unit * (1.0 - NEAR):
            break
    for c in range(count + 1):
        shares[pairs[c, 0], pairs[c, 1]] = max(duals[c], 0.0) * h[c]
    total = shares.sum()
    if total > 0.0:
        shares /= total
    else:
        shares[i, j] = 1.0
    over = unit / (x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) if apart else 0.0
    return (over * x[0], over * x[1], over * x[2]), shares
