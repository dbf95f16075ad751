"""Where, along a line in the plane of sizes, one active set gives way to another."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import count
from typing import NamedTuple

import numpy as np

from fcdm_opt.design.compensation.active_sets import ActiveSet
from fcdm_opt.design.compensation.sampling import Asking, Sample
from fcdm_opt.geometry.arrays import Array

NARROW = 1e-5  # of the box: brackets are closed to this, then both sides' continuations are intersected; nearer, two
# contacts are told apart neither by the features, 1e-9 of the size, nor always by the judge
FINEST = 1e-4  # times that, where they do not meet
MOST_STEPS = 60
MOST_POINTS = 4  # of each side that are continued: cubics
SPREAD = 4.0  # times its last correction: how far to both sides of a predicted crossing it is looked for

Point = tuple[float, Array]


class Changeover(NamedTuple):
    """A place on the boundary of two regions.

    Attributes
    ----------
    at : float
        Position along the line.
    sets : two ActiveSets
    values : two arrays
        Both sides' amount and parameters there.
    sides : two lists
        Points of either side, nearest last; what continues them.
    """

    at: float
    sets: tuple[ActiveSet, ActiveSet]
    values: tuple[Array, Array]
    sides: tuple[list[Point], list[Point]]

    def continued(self, t: float) -> tuple[Array, Array]:
        """Return what both sides continue to at a position."""
        return continued(self.sides[0], t), continued(self.sides[1], t)


def continued(points: Sequence[Point], t: float) -> Array:
    """Return the polynomial through the last points of one side at t (Neville)."""
    last = points[-MOST_POINTS:]
    places, values = [own for own, _ in last], [own for _, own in last]
    for step in range(1, len(last)):
        for k in range(len(last) - step):
            low, high = places[k], places[k + step]
            values[k] = ((t - low) * values[k + 1] - (t - high) * values[k]) / (high - low)
    return values[0]


def changeover(start: Array, end: Array, known: Iterable[tuple[float, Sample]], walls: Array) -> Asking[Changeover]:
    """Find where the active set that holds at the start ends.

    The bracket is narrowed about the place where both sides' continuations agree, by halves where they do not say.
    Of several boundaries on the line one is found.

    Parameters
    ----------
    start, end : (2,) arrays
        Places.
    known : of (position, Sample)
        What is known on the line: at least its ends, with different active sets.
    walls : (k, 2) array
        Limits of the parameters: where one is reached a motion may cease to exist.
    """
    line = sorted(known, key=lambda one: one[0])
    first = line[0][1].held
    switch = next((k for k, (_, sample) in enumerate(line) if sample.held != first), len(line) - 1)
    sets = first, line[switch][1].held
    sides: tuple[list[Point], list[Point]] = ([(t, sample.values) for t, sample in line[:switch]], [])
    for t, sample in reversed(line[switch:]):
        if sample.held == sets[1]:
            sides[1].append((t, sample.values))
        else:
            sides[1].clear()
    narrow = NARROW / max(float(np.linalg.norm(end - start)), NARROW)
    last = strip = None
    for step in count():
        low, high = sides[0][-1][0], sides[1][-1][0]
        width = high - low
        if step > MOST_STEPS or width <= FINEST * narrow or (width <= narrow and _meeting(sides, walls) is not None):
            break
        guess = _meeting(sides, walls) if min(len(side) for side in sides) > 1 or step > 1 else None
        looks = [low + width / 3, high - width / 3]
        if guess is not None:
            off = SPREAD * abs(guess - last) if last is not None else width / 8
            off = min(max(off, narrow / 3), width / 8)
            looks = [guess - off, guess + off]
            last = guess
        looks = [t for t in looks if low < t < high]
        samples = yield [start + t * (end - start) for t in looks]
        sets, strip = _narrowed(sides, sets, list(zip(looks, samples, strict=True)), narrow)
        if strip is None and sides[1][-1][0] - sides[0][-1][0] > width / 2 and guess is not None:
            middle = (sides[0][-1][0] + sides[1][-1][0]) / 2
            samples = yield [start + middle * (end - start)]
            sets, strip = _narrowed(sides, sets, [(middle, samples[0])], narrow)
        if strip is not None:
            break
    at = _meeting(sides, walls) if strip is None else strip
    at = (sides[0][-1][0] + sides[1][-1][0]) / 2 if at is None else at
    # continued from the nearest points by no more than they are off
    values = continued(sides[0][-2:], at), continued(sides[1][-2:], at)
    return Changeover(float(at), sets, values, sides)


def _narrowed(
    sides: tuple[list[Point], list[Point]],
    sets: tuple[ActiveSet, ActiveSet],
    points: list[tuple[float, Sample]],
    narrow: float,
) -> tuple[tuple[ActiveSet, ActiveSet], float | None]:
    """Sort new points to the sides; a third active set between them takes the place of the second.

    Also return where it is but the strip in which both hold within rounding: the search is over.
    """
    for t, sample in points:
        low, high = sides[0][-1][0], sides[1][-1][0]
        if not low < t < high:
            continue
        if sample.held in sets:
            sides[sets.index(sample.held)].append((t, sample.values))
        elif min(t - low, high - t) < 2.0 * narrow:
            return sets, t
        else:
            sides[1][:] = [(t, sample.values)]
            sets = sets[0], sample.held
    return sets, None


def _meeting(sides: tuple[list[Point], list[Point]], walls: Array) -> float | None:
    """Return where the continuations of both sides agree in the bracket, by what differs most; None if they do not.

    A side without a motion has none: the other one then meets its walls.
    """
    from scipy.optimize import brentq

    low, high = sides[0][-1][0], sides[1][-1][0]
    moving = [side for side in sides if np.isfinite(side[-1][1][0])]
    if not moving:
        return None

    def off(t: float) -> Array:
        values = [continued(side, t) for side in moving]
        return values[0] - values[1] if len(values) == 2 else np.subtract(values[0][1:, None], walls).ravel()

    at_low, at_high = off(low), off(high)
    with np.errstate(invalid="ignore"):
        changes = np.where(at_low * at_high <= 0, np.abs(at_high - at_low), -1.0)
    changes[~np.isfinite(changes)] = -1.0
    k = int(np.argmax(changes))
    return float(brentq(lambda t: off(t)[k], low, high, xtol=1e-15, rtol=1e-14)) if changes[k] > 0 else None
