"""Where true faces overlap along a ray of motions while parts within them, or their facets, are apart.

Solids as drawn that are farther apart than their facets fall short of the true faces have true faces that are apart.
Elsewhere the gap of the true faces and its slope are worked out at places, and between two of these where the tangents
leave room for an overlap: the gap of convex bodies that shift is convex, no less than its tangents.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.along.conditions import Ray
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.facet_errors import deviation_of
from fcdm_opt.geometry.patches import true_faces
from fcdm_opt.geometry.solids import PlacedSolids
from fcdm_opt.model.true_faces import Exchange
from fcdm_opt.problem.active_parts import moving_at_most
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

STEPS = 20_000  # along a ray, at most
DRAWN = 128  # steps in which solids as drawn are looked at, at most, but for finer ones where they are near
PLACES = 4  # at which true faces are looked at at first, on a stretch on which they may touch
FINER = 1.0 / 32.0  # of such a stretch: no nearer are places between which the gap is neither convex nor concave
MOST = 200  # of these in all
FINEST = 1e-3  # of such a stretch: no nearer are places between which tangents leave room

Stretch = tuple[Literal["apart", "overlapping"], float, float]


def nearer_than(
    problem: Problem, along: Array, pair: Array, clearance: float, ends: tuple[float, float], least: float
) -> list[Stretch] | None:
    """Return when two solids are "apart" by a clearance, and when nearer, after motions x * along between two ends.

    None where it is not known how fast the motion moves corners: it is no sooner than these move by what lacks of the
    clearance or is left of it. By no less than `least`, a length: what lasts as short may be missed.
    """
    from scipy.optimize import brentq

    fastest, slack = 2.0 * moving_at_most(problem, along, pair)(0.0, 1.0)[1], problem.contact_slack
    if not 0.0 < fastest < math.inf:
        return None

    def excess(x: float) -> float:
        pose = problem.motion.transform(x * along, problem.movable.seed, problem.static.seed)
        solids = PlacedSolids(problem.movable, problem.static, pair, pose)
        return (0.0 if solids.nested else solids.distance) - clearance

    found, (x, end) = list[Stretch](), ends
    start, here, step = x, excess(x), least
    state: Literal["apart", "overlapping"] = "overlapping" if here < -slack else "apart"
    for _ in range(STEPS):
        if x >= end:
            break
        pacing.check()
        step = 2.0 * step if abs(here) <= slack else least
        ahead = min(x + max(abs(here), step) / fastest, end)
        there = excess(ahead)
        if (there < -slack) != (state == "overlapping"):
            at = x if abs(here) < abs(there) else ahead  # one of which is at the clearance, to rounding
            if here * there < 0.0:
                at = float(brentq(excess, x, ahead))
            found.append((state, start, at))
            start, state = at, "apart" if state == "overlapping" else "overlapping"
        x, here = ahead, there
    return [*found, (state, start, x)]


def apart_beyond(problem: Problem, along: Array, pair: Array, clearance: float = 0.0) -> float:
    """Return from which motion x * along on two bodies that a motion only shifts are farther apart than a clearance."""
    extents = [
        scale * max(float(np.linalg.norm(part.vertices - body.seed, axis=1).max()) for part in body.parts)
        for body, scale in zip((problem.movable, problem.static), pair, strict=True)
    ]
    far = sum(extents) + float(np.linalg.norm(problem.static.seed - problem.movable.seed)) + clearance
    moving = Ray.of(problem.motion, along, problem.movable.seed, problem.static.seed).natural_step[1]
    return far / moving if moving > 0 else 1.0


class TrueOverlaps(NamedTuple):
    """Stretches on which true faces overlap along a ray; whether all places were looked at that leave room for it."""

    stretches: list[tuple[float, float]]
    complete: bool
    proved: bool  # whether no other stretch can have been missed


def true_overlaps(bodies: Problem, along: Array, apart: Sequence[tuple[float, float]]) -> TrueOverlaps:
    """Return where true faces overlap along a ray, of stretches on which parts within the true ones are apart.

    `bodies`: see `coherent_range.of_bodies`. `apart`: stretches (low, high) of x, in increasing order.
    """
    asked = Exchange.of(bodies)
    if asked is None or not apart:
        return TrueOverlaps([], complete=asked is not None, proved=not apart)
    drawn, pair, overlaps = asked.facets, bodies.target, list[tuple[float, float]]()
    short = sum(x * deviation_of(body)[1] for x, body in zip(pair.tolist(), drawn.bodies, strict=False))
    far = apart_beyond(drawn, along, pair, short) if math.inf in map(abs, (apart[0][0], apart[-1][1])) else math.inf
    apart = [(max(low, -far), min(high, far)) for low, high in apart]
    fastest = 2.0 * moving_at_most(drawn, along, pair)(0.0, 1.0)[1]
    step = max(short, fastest * sum(high - low for low, high in apart) / DRAWN)
    looked = _Looked(asked, along, short + step)
    for ends in apart:
        near = nearer_than(drawn, along, pair, short + step, ends, step)
        if near is None:
            return TrueOverlaps([], complete=False, proved=False)
        for state, low, high in near:
            if state == "overlapping" and high - low > FINEST * DEFAULT.march * (ends[1] - ends[0]):
                overlaps += looked.overlaps(low, high)
    two, holes = drawn.bodies[:2], any(own.concave for body in drawn.bodies[:2] for own in true_faces(body).patches)
    convex = drawn.motion.shifts and not holes and all(len(own.parts) == 1 and not own.is_surface for own in two)
    complete = len(looked.known) < MOST
    return TrueOverlaps(overlaps, complete, complete and (convex or not looked.known))


class _Looked:
    """The gap of true faces and its slope, at places along a ray."""

    def __init__(self, asked: Exchange, along: Array, band: float) -> None:
        self._asked, self._along, self._band = asked, along, band
        self._slack = asked.facets.contact_slack
        self.known = dict[float, tuple[float, float]]()

    def at(self, x: float) -> tuple[float, float]:
        """Return the gap at x, the band where true faces are farther apart, and its slope."""
        if x not in self.known:
            pacing.check()
            self.known[x] = self._asked.gap_and_slope(x * self._along, self._along, self._band)
        return self.known[x]

    def overlaps(self, low: float, high: float) -> list[tuple[float, float]]:
        """Return where true faces overlap from low to high."""
        from scipy.optimize import brentq

        places = [*map(float, np.linspace(low, high, PLACES + 1))]
        stretches, seen = [*pairwise(places)], {*places}
        while stretches and len(self.known) < MOST:
            one, two = stretches.pop()
            if two - one > self._least(one, two) * (high - low):
                middle = (one + two) / 2.0
                stretches += [(one, middle), (middle, two)]
                seen.add(middle)
        ends = list[float]()
        for one, two in pairwise(sorted(seen)):
            deep = [self.at(x)[0] < -self._slack for x in (one, two)]
            if deep[0] and one == low:
                ends.append(one)
            if deep[0] != deep[1]:
                # others that slide on each other meanwhile hide the root: from where the overlap is seen back to it
                level = 0.0 if max(self.at(one)[0], self.at(two)[0]) > 0.0 else -self._slack
                root = float(brentq(lambda x, level=level: self.at(x)[0] - level, one, two))
                gap, slope = self.at(root)
                ends.append(min(max(root - gap / slope, one), two) if level and slope else root)
            if deep[1] and two == high:
                ends.append(two)
        return [*zip(ends[::2], ends[1::2], strict=True)]

    def _least(self, one: float, two: float) -> float:
        """Return how near places must be, as a share of the stretch, to tell the gap between two; 1 where these do."""
        (gap, slope), (other, its_slope) = self.at(one), self.at(two)
        secant = (other - gap) / (two - one)
        if min(gap, other) < -self._slack or slope >= secant >= its_slope:  # concave: least at an end
            return 1.0
        if not slope <= secant <= its_slope:
            return FINER
        if not slope < 0.0 < its_slope:
            return 1.0
        meet = (other - its_slope * (two - one) - gap) / (slope - its_slope)
        return FINEST if gap + slope * meet < -self._slack else 1.0
