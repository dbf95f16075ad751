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

from fcdm_opt.curve.kernels import kernel
from fcdm_opt.tolerance.stages.compiled import ROW, _five, _line, _pair, _place, path_faults

KERNELS = "f1e2"  # hashes of curve/kernels.py and compiled.py, to be renewed with them, see `compiled.KERNELS`
FAR = 1e9  # amounts of motions are below this, in units; that of a ray without any is above
GROWTH = 0.25  # relative: how much further the next step along a ray is, up to the longest
FINER = 4.0  # times the points of a path that others look at: nothing is gained from what lies between those
HALVINGS = 100  # of a stretch at whose end the requirement is met, or the contact lost
HOPELESS = 1e-9  # radians: no window has been seen at this width
GOLDEN = 0.3819660112501051  # (3 - sqrt(5)) / 2


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
    if not _pair(lines, 2, pairs[0], pairs[1], 1.0, rho):
        return -np.inf
    least = np.inf
    for body in range(2):
        if hands[body] != 0.0:
            least = min(least, hands[body] * (rho[0, body] - pairs[1, body]) / pairs[1, body])
    return least


@kernel
def ray(motion, parts1, parts2, tracked, signs, pairs, path, hands, limits, steps, angle, cap):
    """Return the merit of a direction, see above; amounts of `cap` and more do not interest.

    Parameters
    ----------
    hands : (2,) array
        Signs of "beyond" for each body, 0 where it does not matter.
    limits : (2, 2) array
        Of each z.
    steps : (3,) array
        First step along a ray, and the largest of each z.
    angle : float
        Of the direction, radians.
    """
    way = np.array([math.cos(angle), math.sin(angle)])
    start, end, longest = 0.0, cap, np.inf
    for k in range(2):
        if abs(way[k]) > 1e-15:
            one, two = limits[k, 0] / way[k], limits[k, 1] / way[k]
            start, end = max(start, min(one, two)), min(end, max(one, two))
            longest = min(longest, steps[1 + k] / abs(way[k]))
        elif limits[k, 0] > 0.0 or limits[k, 1] < 0.0:
            return np.inf
    if not start <= end:
        return np.inf
    z, q, flat = np.empty(2), np.empty(2), np.empty(36)
    lines, rho = np.empty((2, 1, 6)), np.empty((1, 2))
    ints, reals, excess = np.zeros((4, ROW), np.int64), np.zeros((4, 3)), np.zeros(4)
    here, finer = path.copy(), path.copy()
    here[1] = 0.0  # only the end of a path, not all of it
    finer[0], finer[2] = FINER * path[0], path[2] / FINER
    crossed = len(tracked) == 1
    z[:] = 0.0
    before, was, best = 0.0, _value(motion, parts1, parts2, tracked, signs, pairs, hands, z, q, flat, lines, rho), -np.inf
    while before < end:
        ahead = min(before + max(steps[0], min(longest, GROWTH * before)), end)
        if before < start < ahead:
            ahead = start
        for k in range(2):
            z[k] = ahead * way[k]
        lost = False
        if not crossed and path_faults(motion, parts1, parts2, tracked, signs, pairs, z, here, True, ints, reals, excess):
            lost, low, high = True, before, ahead
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                if not low < middle < high:
                    break
                for k in range(2):
                    z[k] = middle * way[k]
                if path_faults(motion, parts1, parts2, tracked, signs, pairs, z, here, True, ints, reals, excess):
                    high = middle
                else:
                    low = middle
            ahead = low
            for k in range(2):
                z[k] = ahead * way[k]
        value = _value(motion, parts1, parts2, tracked, signs, pairs, hands, z, q, flat, lines, rho)
        if ahead >= start:
            best = max(best, -abs(value) if crossed else value)
            met = was * value <= 0.0 if crossed else value >= 0.0
            if met and ahead > 0.0:
                low, high = before, ahead
                for _ in range(HALVINGS if low >= start else 0):
                    middle = 0.5 * (low + high)
                    if not low < middle < high:
                        break
                    for k in range(2):
                        z[k] = middle * way[k]
                    there = _value(motion, parts1, parts2, tracked, signs, pairs, hands, z, q, flat, lines, rho)
                    if (was * there <= 0.0) if crossed else (there >= 0.0):
                        high = middle
                    else:
                        low = middle
                for k in range(2):
                    z[k] = high * way[k]
                wrong = path_faults(motion, parts1, parts2, tracked, signs, pairs, z, path, True, ints, reals, excess)
                if wrong == 0:
                    wrong = path_faults(
                        motion, parts1, parts2, tracked, signs, pairs, z, finer, True, ints, reals, excess
                    )
                if wrong == 0:
                    return high
                if not crossed:
                    return FAR * 2.0
        if lost:
            break
        before, was = ahead, value
    return FAR * (1.0 + min(-best, 1.0))


@kernel
def fan(motion, parts1, parts2, tracked, signs, pairs, path, hands, limits, steps, count, cap):
    """Return the merits of `count` directions all around; amounts beyond the least so far are not told apart."""
    scene = (motion, parts1, parts2, tracked, signs, pairs, path, hands, limits, steps)
    merits = np.empty(count)
    for k in range(count):
        merits[k] = ray(*scene, 2.0 * math.pi * k / count, cap)
        cap = min(cap, merits[k])
    return merits


@kernel
def least(motion, parts1, parts2, tracked, signs, pairs, path, hands, limits, steps, low, high, cap, fine):
    """Return (merit, direction) of the least merit between two directions, by golden section, to within `fine`.

    A window too narrow to have been seen is entered where what is missing becomes nothing.
    """
    scene = (motion, parts1, parts2, tracked, signs, pairs, path, hands, limits, steps)
    one, two = low + GOLDEN * (high - low), high - GOLDEN * (high - low)
    first, second = ray(*scene, one, cap), ray(*scene, two, cap)
    best, at = np.inf, one
    while high - low > fine:
        if first < best:
            best, at = first, one
        if second < best:
            best, at = second, two
        if high - low < HOPELESS and best >= FAR:
            break
        if first <= second:
            high, two, second = two, one, first
            one = low + GOLDEN * (high - low)
            first = ray(*scene, one, cap)
        else:
            low, one, first = one, two, second
            two = high - GOLDEN * (high - low)
            second = ray(*scene, two, cap)
    return best, at
