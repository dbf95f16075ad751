"""Compiled: where along rays of motions a tracked contact first meets its requirement, and where it stops being real.

A path is the straight ray to its motion, so that motions with two parameters are a fan of rays: each direction, an
angle in weighted coordinates, has the least amount at which the requirement is met before coherence ends. What is asked
of a ray is its *merit*: that amount, or, where there is none, `FAR` plus what is missing at best. Over the directions
it is least at the least motion, whether that is a smooth minimum, or where the contact ends just as it is beyond.

Kernels take the `scene` of `Descent`; z = weights * q / unit.
"""

from __future__ import annotations

import math

import numpy as np

from fcdm_opt.compiling import kernel
from fcdm_opt.stages.compiled import ROW, _five, _line, _pair, _place, path_faults

FAR = 1e9  # amounts of motions are below this, in units; that of a ray without any is above
GROWTH = 0.3  # relative: how much further the next step along a ray is, up to the longest
FINER = 4.0  # times the points of a path that others look at: nothing is gained from what lies between those
HALVINGS = 100  # of a stretch at whose end the requirement is met
CROSSING = 3e-7  # sine of the angle between two tracked lines, below which their pair is hardly known
ROUNDING = 4e-15  # of lines, relative: over that sine, what a pair is to be beyond its target by, to be so for anyone
PARALLEL = 1e-15  # of a direction: it leaves a parameter as it is


@kernel
def _value(motion, parts1, parts2, tracked, signs, pairs, hands, z, q, flat, lines, rho):
    """Return by how much the tracked pair is beyond its target, relative; -inf where there is none.

    Of one tracked feature, which meets its target exactly, the target's height over its line.
    """
    _place(motion, z, 1.0, q, flat, False)
    for t in range(len(tracked)):
        _line(parts1, parts2, *_five(tracked[t]), signs[t], flat, lines[t])
    if len(tracked) == 1:
        return lines[0, 0, 3] * pairs[1, 0] + lines[0, 0, 4] * pairs[1, 1] - lines[0, 0, 5]
    a, b, d, e = lines[0, 0, 3], lines[0, 0, 4], lines[1, 0, 3], lines[1, 0, 4]
    parallel = not abs(a * e - b * d) > CROSSING * math.sqrt((a * a + b * b) * (d * d + e * e))
    if parallel or not _pair(lines, 2, pairs[0], pairs[1], 1.0, rho):
        return -np.inf
    least = np.inf
    noise = ROUNDING * math.sqrt((a * a + b * b) * (d * d + e * e)) / abs(a * e - b * d)
    for body in range(2):
        if hands[body] != 0.0:
            least = min(least, hands[body] * (rho[0, body] - pairs[1, body]) / pairs[1, body] - noise)
    return least


@kernel
def _lost(motion, parts1, parts2, tracked, signs, pairs, path, hands, z, work):
    """Tell whether the contact is not real at a motion, or its two lines all but parallel."""
    q, flat, lines, rho, ints, reals, excess = work  # room, so that nothing is allocated
    if path_faults(motion, parts1, parts2, tracked, signs, pairs, z, path, True, ints, reals, excess):
        return True
    return _value(motion, parts1, parts2, tracked, signs, pairs, hands, z, q, flat, lines, rho) == -np.inf


@kernel
def fan(motion, parts1, parts2, tracked, signs, pairs, path, hands, limits, steps, angles, cap, halvings):
    """Return the merits of several directions, see above; amounts beyond `cap` or the least so far are not told apart.

    Parameters
    ----------
    hands : (2,) array
        Signs of "beyond" for each body, 0 where it does not matter.
    limits : (2, 2) array
        Of each z.
    steps : (3,) array
        First step along a ray, and the largest of each z.
    angles : (n,) array
        Of the directions, radians.
    halvings : int
        Of a stretch at whose end the contact is lost.
    """
    scene = (motion, parts1, parts2, tracked, signs, pairs)
    merits, crossed = np.full(len(angles), 2.0 * FAR), len(tracked) == 1
    way, z, q, flat = np.empty(2), np.empty(2), np.empty(2), np.empty(36)
    lines, rho = np.empty((2, 1, 6)), np.empty((1, 2))
    work = (q, flat, lines, rho, np.zeros((4, ROW), np.int64), np.zeros((4, 3)), np.zeros(4))
    looks = np.empty((3, len(path)))
    looks[:] = path
    looks[0, 1] = 0.0  # the end of a path alone; then all of it, and more of it
    looks[2, 0], looks[2, 2] = FINER * path[0], path[2] / FINER
    for n in range(len(angles)):
        way[0], way[1] = math.cos(angles[n]), math.sin(angles[n])
        start, end, longest = 0.0, cap, np.inf
        for k in range(2):
            if abs(way[k]) > PARALLEL:
                one, two = limits[k, 0] / way[k], limits[k, 1] / way[k]
                start, end = max(start, min(one, two)), min(end, max(one, two))
                longest = min(longest, steps[1 + k] / abs(way[k]))
            elif limits[k, 0] > 0.0 or limits[k, 1] < 0.0:
                end = -np.inf
        z[:] = 0.0
        was = _value(*scene, hands, z, q, flat, lines, rho)
        before, best, lost = 0.0, -np.inf, not start <= end
        while before < end and not lost:
            ahead = min(before + max(steps[0], min(longest, GROWTH * before)), end)
            if before < start < ahead:
                ahead = start
            z[:] = ahead * way
            lost = not crossed and _lost(*scene, looks[0], hands, z, work)
            low, high = before, ahead
            for _ in range(halvings if lost else 0):
                middle = 0.5 * (low + high)
                if not low < middle < high:
                    break
                z[:] = middle * way
                if _lost(*scene, looks[0], hands, z, work):
                    high = middle
                else:
                    low = middle
            ahead = low if lost else ahead
            z[:] = ahead * way
            value = _value(*scene, hands, z, q, flat, lines, rho)
            if ahead >= start and ahead > 0.0:
                best = max(best, -abs(value) if crossed else value)
                if was * value <= 0.0 if crossed else value >= 0.0:
                    low, high = before, ahead
                    for _ in range(HALVINGS if low >= start else 0):
                        middle = 0.5 * (low + high)
                        if not low < middle < high:
                            break
                        z[:] = middle * way
                        there = _value(*scene, hands, z, q, flat, lines, rho)
                        if was * there <= 0.0 if crossed else there >= 0.0:
                            high = middle
                        else:
                            low = middle
                    z[:] = high * way
                    if not (_lost(*scene, looks[1], hands, z, work) or _lost(*scene, looks[2], hands, z, work)):
                        merits[n], lost = high, True
                        cap = min(cap, high)
                    lost = lost or not crossed
            before, was = ahead, value
        if merits[n] >= FAR:
            merits[n] = FAR * (1.0 + min(-best, 1.0))
    return merits
