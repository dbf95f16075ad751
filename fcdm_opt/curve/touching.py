"""Which elements of two touching parts touch, and what they share, compiled.

Parts that touch along a direction share what their supports share in its plane. Where a line of it keeps the
supports apart, they share what lies on it; where a point of the line does, that point.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt.compiling import kernel, light, step
from fcdm_opt.curve.kernels import (
    FACE,
    NEXT,
    ORIGIN,
    _at,
    _cross,
    _dot,
    _entry,
    _half_edge,
    _length,
    _minus,
    _plus,
    _times,
    _turned,
    _turned_back,
)  # fmt: skip


@light
@kernel
def touching_vertices(reals1, ints1, reals2, ints2, pose, rho, normal, slack):
    """Return the vertices of the smallest elements of either part that hold all that two touching parts share."""
    # parts in packed arrays, see `kernels`; scale pair rho at which they touch; unit normal from 1 to 2. Heights and
    # places that differ by less than `slack`, relative to the sizes, are the same
    n, d = _entry(normal, 0), _entry(pose, 9)
    own1 = support(reals1, ints1, _turned_back(pose, 0, n), slack)
    own2 = support(reals2, ints2, _times(-1.0, n), slack)
    X, Y = np.empty((len(own1), 3)), np.empty((len(own2), 3))
    for k in range(len(own1)):
        X[k, 0], X[k, 1], X[k, 2] = _minus(_times(rho[0], _turned(pose, 0, _at(reals1, own1[k]))), d)
    for k in range(len(own2)):
        Y[k, 0], Y[k, 1], Y[k, 2] = _times(rho[1], _at(reals2, own2[k]))
    near = slack * (_length(d) + rho[0] * reals1[ints1[0] + ints1[1], 0] + rho[1] * reals2[ints2[0] + ints2[1], 0])
    while True:
        # the way from 1 to 2 along which what is left of them is farthest apart, if some of it is left behind
        widest, u, most, least = -near, n, 0.0, 0.0
        for side in range(2):
            corners = X if side == 0 else Y
            count = len(corners)
            for k in range(count if count > 2 else 4 if count == 2 else 0):
                edge = _minus(_at(corners, (k + 1) % count), _at(corners, k % count))
                # both run round so that this points from 1 to 2; across and along a segment either way is tried
                w = _cross(edge, n) if count > 2 or k < 2 else edge
                w = _times(1.0 / _length(w), w)
                highest, lowest = _highest(X, w), -_highest(Y, _times(-1.0, w))
                if lowest - highest >= widest and (
                    _count(X, w, highest - near) < len(X) or _count(Y, _times(-1.0, w), -lowest - near) < len(Y)
                ):
                    widest, u, most, least = lowest - highest, w, highest, lowest
        if u == n:
            return own1, own2
        own1, X = _kept(own1, X, u, most - near)
        own2, Y = _kept(own2, Y, _times(-1.0, u), -least - near)


@kernel
def support(reals, ints, n, slack):
    """Return the vertices of a part's vertex, edge or face whose heights along n are within a slack of the largest."""
    # a face's in their order around it; where these are on several faces, those of the face with most of them
    heights, top = np.empty(ints[0]), -np.inf
    for k in range(ints[0]):
        heights[k] = _dot(n, _at(reals, k))
        top = max(top, heights[k])
    least, some, count = top - slack * reals[ints[0] + ints[1], 0], 0, 0
    for k in range(ints[0]):
        if heights[k] >= least:
            some, count = k, count + 1
    if count < 3:
        found = np.empty(count, np.int64)
        count = 0
        for k in range(ints[0]):
            if heights[k] >= least:
                found[count] = k
                count += 1
        return found
    best, face = 0, -1
    first = h = ints[ints[4] + some]
    while True:
        around = _half_edge(ints, h, FACE)
        g, held, size = h, 0, 0
        while True:
            held, size = held + int(heights[_half_edge(ints, g, ORIGIN)] >= least), size + 1
            g = _half_edge(ints, g, NEXT)
            if g == h:
                break
        if held > best:
            best, face, count = held, around, size
        h = _half_edge(ints, h ^ 1, NEXT)
        if h == first:
            break
    found = np.empty(count, np.int64)
    h = ints[ints[5] + face]
    for k in range(count):
        found[k] = _half_edge(ints, h, ORIGIN)
        h = _half_edge(ints, h, NEXT)
    return found


@step
def _highest(corners, w):
    """Return the largest height of some points along a direction."""
    best = -np.inf
    for k in range(len(corners)):
        best = max(best, _dot(w, _at(corners, k)))
    return best


@step
def _count(corners, w, least):
    """Return how many points are no lower than that."""
    count = 0
    for k in range(len(corners)):
        count += int(_dot(w, _at(corners, k)) >= least)
    return count


@kernel
def _kept(own, corners, w, least):
    """Return the vertices, and their places, that are no lower than that."""
    count = _count(corners, w, least)
    kept, places, made = np.empty(count, np.int64), np.empty((count, 3)), 0
    for k in range(len(corners)):
        if _dot(w, _at(corners, k)) >= least:
            kept[made] = own[k]
            for axis in range(3):
                places[made, axis] = corners[k, axis]
            made += 1
    return kept, places


@light
@kernel
def clipped(shape, polygon, slack):
    """Return the part of a segment or convex polygon inside a polygon of the same plane, in the sense of the latter."""
    # places that differ by less than `slack`, relative to the largest coordinate, are the same
    near = slack * max(np.abs(shape).max(), np.abs(polygon).max())
    normal, corner = (0.0, 0.0, 0.0), _at(polygon, 0)
    for k in range(1, len(polygon) - 1):
        spokes = _cross(_minus(_at(polygon, k), corner), _minus(_at(polygon, k + 1), corner))
        normal = _plus(normal, spokes)
    heights = np.empty(len(shape) + len(polygon))
    own, kept = np.empty((len(heights), 3)), np.empty((len(heights), 3))
    count = len(shape)
    for k in range(count):
        own[k] = shape[k]
    for side in range(len(polygon)):
        corner = _at(polygon, side)
        inward = _cross(normal, _minus(_at(polygon, (side + 1) % len(polygon)), corner))
        inward = _times(1.0 / _length(inward), inward)
        for k in range(count):
            heights[k] = _dot(inward, _minus(_at(own, k), corner))
        made = 0
        for k in range(count):
            after = (k + 1) % count
            if heights[k] >= -near:
                kept[made] = own[k]
                made += 1
            low, high = min(heights[k], heights[after]), max(heights[k], heights[after])
            if low < -near and high > near and (k < after or count > 2):
                share = heights[k] / (heights[k] - heights[after])
                kept[made] = own[k] + share * (own[after] - own[k])
                made += 1
        own, kept, count = kept, own, made
    return own[:count].copy()
