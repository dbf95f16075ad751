"""Where, along a line in the plane of sizes, one way of holding the motion gives way to another."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from itertools import count
from typing import NamedTuple

import numpy as np

from fcdm_opt.design.compensation.answers import Node
from fcdm_opt.design.compensation.ways import Way
from fcdm_opt.geometry.arrays import Array

NARROW = 1e-5  # of the box: brackets are closed to this, then both sides' continuations are intersected; nearer, two
# contacts are told apart neither by the features, 1e-9 of the size, nor always by the judge
FINEST = 1e-4  # times that, where they do not meet
MOST_STEPS = 60
MOST_POINTS = 4  # of each side that are continued: cubics
SPREAD = 4.0  # times its last correction: how far to both sides of a predicted crossing it is looked for

Search = Generator[list[Array], list[Node], "Crossing"]
Point = tuple[float, Array]


class Crossing(NamedTuple):
    """A place on the boundary of two regions.

    Attributes
    ----------
    at : float
        Position along the line.
    ways : two Ways
    values : two arrays
        Both sides' amount and parameters there.
    sides : two lists
        Points of either side, nearest last; what continues them.
    """

    at: float
    ways: tuple[Way, Way]
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


def crossing(start: Array, end: Array, nodes: Iterable[tuple[float, Node]], walls: Array) -> Search:
    """Find where the way that holds at the start ends: yields places to be solved, gets nodes, returns a `Crossing`.

    The bracket is narrowed about the place where both sides' continuations agree, by halves where they do not say.
    Of several boundaries on the line one is found.

    Parameters
    ----------
    start, end : (2,) arrays
        Places.
    nodes : of (position, Node)
        What is known on the line: at least its ends, of different ways.
    walls : (k, 2) array
        Limits of the parameters: where one is reached a motion may cease to exist.
    """
    known = sorted(nodes, key=lambda own: own[0])
    sides: tuple[list[Point], list[Point]] = ([], [])
    ways = known[0][1].way, known[-1][1].way
    switch = next((k for k, (_, node) in enumerate(known) if node.way != ways[0]), len(known) - 1)
    ways = ways[0], known[switch][1].way
    sides[0].extend((t, node.values) for t, node in known[:switch])
    for t, node in reversed(known[switch:]):
        if node.way == ways[1]:
            sides[1].append((t, node.values))
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
        asked = [low + width / 3, high - width / 3]
        if guess is not None:
            off = SPREAD * abs(guess - last) if last is not None else width / 8
            off = min(max(off, narrow / 3), width / 8)
            asked = [guess - off, guess + off]
            last = guess
        asked = [t for t in asked if low < t < high]
        found = yield [start + t * (end - start) for t in asked]
        here, strip = _narrowed(sides, ways, list(zip(asked, found, strict=True)), narrow)
        if strip is None and sides[1][-1][0] - sides[0][-1][0] > width / 2 and guess is not None:
            middle = (sides[0][-1][0] + sides[1][-1][0]) / 2
            found = yield [start + middle * (end - start)]
            here, strip = _narrowed(sides, here, [(middle, found[0])], narrow)
        ways = here
        if strip is not None:
            break
    at = _meeting(sides, walls) if strip is None else strip
    at = (sides[0][-1][0] + sides[1][-1][0]) / 2 if at is None else at
    values = _beside(sides[0], at), _beside(sides[1], at)
    return Crossing(float(at), ways, values, sides)


def _beside(points: list[Point], at: float) -> Array:
    """Return a side's values on the boundary: continued from the nearest point by no more than it is off."""
    return continued(points[-2:], at) if len(points) > 1 else points[-1][1]


def _narrowed(
    sides: tuple[list[Point], list[Point]], ways: tuple[Way, Way], found: list[tuple[float, Node]], narrow: float
) -> tuple[tuple[Way, Way], float | None]:
    """Sort new points to the sides; a third way between them takes the place of the second.

    Also return where it is but the strip in which both ways hold within rounding: the search is over.
    """
    for t, node in found:
        low, high = sides[0][-1][0], sides[1][-1][0]
        if not low < t < high:
            continue
        if node.way == ways[0]:
            sides[0].append((t, node.values))
        elif node.way == ways[1]:
            sides[1].append((t, node.values))
        elif min(t - low, high - t) < 2.0 * narrow:
            return ways, t
        else:
            sides[1][:] = [(t, node.values)]
            ways = ways[0], node.way
    return ways, None


def _meeting(sides: tuple[list[Point], list[Point]], walls: Array) -> float | None:
    """Return where the continuations of both sides agree in the bracket, by what differs most; None if they do not."""
    low, high = sides[0][-1][0], sides[1][-1][0]
    first, second = (np.isfinite(side[-1][1][0]) for side in sides)
    if first and second:
        ends = [continued(sides[0], t) - continued(sides[1], t) for t in (low, high)]

        def off(t: float) -> Array:
            return continued(sides[0], t) - continued(sides[1], t)

    elif first or second:
        own = sides[0] if first else sides[1]

        def off(t: float) -> Array:
            return np.subtract(continued(own, t)[1:, None], walls).ravel()

        ends = [off(low), off(high)]
    else:
        return None
    return _root(off, low, high, *ends)


def _root(off: Callable[[float], Array], low: float, high: float, at_low: Array, at_high: Array) -> float | None:
    with np.errstate(invalid="ignore"):
        changes = np.where(at_low * at_high <= 0, np.abs(at_high - at_low), -1.0)
    changes[~np.isfinite(changes)] = -1.0
    k = int(np.argmax(changes))
    if changes[k] <= 0:
        return None
    from scipy.optimize import brentq

    return float(brentq(lambda t: off(t)[k], low, high, xtol=1e-15, rtol=1e-14))
