"""How far answers are from exact references, and whether they name what touches."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.method import ContactAnswer, CurveAnswer, Touching
from fcdm_opt_benchmarks.references.exact import ExactContact, ExactStretches, Point, as_float, as_rational


def contact_error(answer: ContactAnswer, reference: ExactContact) -> float:
    """Return the relative error of a scale of body 2; infinite for no number."""
    value = float(answer.rho2)
    if not math.isfinite(value):
        return math.inf
    if value == as_float(reference.rho2):
        return 0.0
    return as_float(abs(as_rational(value) - reference.rho2) / reference.rho2)


def curve_error(answer: CurveAnswer, reference: ExactStretches) -> float:
    """Return the largest distance between two curves in a box, along rays from (0, 0), relative to the exact one's.

    Between breakpoints of either the distance changes monotonically along the angle, so the breakpoints of both are
    looked at. An exact stretch in the box that the answer has nothing to set against counts with the way along its ray
    that leads out of the box: little where the two curves leave the box a little earlier or later, much where a piece
    of the answer is missing. Infinite where a point is no scale pair.
    """
    rows = np.asarray(answer.points, dtype=np.float64).reshape(-1, 2)
    if not (np.isfinite(rows).all() and (rows > 0).all()):
        return math.inf
    if np.array_equal(rows, reference.rounded):
        return 0.0
    points = [(as_rational(x), as_rational(y)) for x, y in rows.tolist()]
    excesses = [reference.excess(point) for point in points]
    worst = max([abs(x) for x in excesses], default=as_rational(0.0))
    chords = _Chords(points)
    for point in reference.points:
        found = chords.ratios(point)
        worst = max([worst, *(abs(ratio - 1) for ratio in found)])
    for point in _uncovered(points, excesses, reference):
        worst = max(worst, _depth(point, reference.box))
    return as_float(worst)


class _Chords:
    """A polyline, to be met by rays."""

    def __init__(self, points: Sequence[Point]) -> None:
        self.points = points

    def covering(self, point: Point) -> Iterator[int]:
        """Yield the pieces that the ray of a scale pair meets."""
        sides = [_cross(own, point) for own in self.points]
        for k in range(len(sides) - 1):
            if min(sides[k], sides[k + 1]) <= 0 <= max(sides[k], sides[k + 1]):
                yield k

    def ratios(self, point: Point) -> list[Any]:
        """Return where the ray of a scale pair meets the polyline, in units of it."""
        found = []
        for k in self.covering(point):
            start, end = self.points[k], self.points[k + 1]
            travel = end[0] - start[0], end[1] - start[1]
            across = _cross(point, travel)
            if across != 0:
                found.append(_cross(start, travel) / across)
            else:  # the piece lies along the ray
                found += [own[0] / point[0] for own in (start, end)]
        return found


def _uncovered(points: Sequence[Point], excesses: Sequence[Any], reference: ExactStretches) -> Iterator[Point]:
    """Yield exact points in the box that rays meet but no piece of the answer does, the middles of stretches too."""
    slopes = [x / y for x, y in points] if len(points) > 1 else []
    first, last = (min(slopes), max(slopes)) if slopes else (None, None)
    for own in reference.stretches:
        corners = [own.start, own.end]
        if slopes:  # where the answer ends
            for k in (slopes.index(first), slopes.index(last)):
                x, y = points[k]
                if own.start[0] / own.start[1] < slopes[k] < own.end[0] / own.end[1]:
                    corners.append((x / (1 + excesses[k]), y / (1 + excesses[k])))
        corners.sort(key=lambda point: point[0] / point[1])
        for p, q in pairwise(corners):
            middle = (p[0] + q[0]) / 2, (p[1] + q[1]) / 2
            if first is None or not first <= middle[0] / middle[1] <= last:
                yield from (p, middle, q)


def _depth(point: Point, box: Array) -> Any:
    """Return the shortest relative way out of a box along the ray of a scale pair in it."""
    ways = [(as_rational(low) / x, as_rational(high) / x) for x, (low, high) in zip(point, box.tolist(), strict=True)]
    return max(as_rational(0.0), min(1 - max(low for low, _ in ways), min(high for _, high in ways) - 1))


def _cross(p: Point, q: Point) -> Any:
    return p[0] * q[1] - p[1] * q[0]


def touching_right(answer: ContactAnswer | CurveAnswer, reference: ExactContact | ExactStretches) -> bool | None:
    """Tell whether an answer names what touches; None where it does not say.

    Along a curve its pieces are asked at their middles, and the exact ones too, so that none is left out or made up. A
    ray on which two lines are nearer to each other than `Tolerances.line` may have either.
    """
    if answer.touching is None:
        return None
    if isinstance(reference, ExactContact):
        return answer.touching == reference.touching
    assert isinstance(answer, CurveAnswer)
    points = [(as_rational(x), as_rational(y)) for x, y in np.asarray(answer.points).tolist()]
    if len(answer.touching) != max(0, len(points) - 1):
        return False
    chords = _Chords(points)
    asked = [(point, [name]) for point, name in zip(_middles(points), answer.touching, strict=True)]
    for own in reference.stretches:
        names = [answer.touching[k] for k in chords.covering(own.middle)]
        asked += [(own.middle, names)] if names else []
    return all(any(name in _names(reference, point) for name in names) for point, names in asked)


def _middles(points: Sequence[Point]) -> list[Point]:
    return [((p[0] + q[0]) / 2, (p[1] + q[1]) / 2) for p, q in pairwise(points)]


def _names(reference: ExactStretches, point: Point) -> set[Touching]:
    """Return what touches where the ray of a scale pair meets the curve, and what nearly does."""
    k, near = reference.number(point), as_rational(DEFAULT.line)
    excess = reference.excess(point)
    around = range(max(0, k - 1), min(len(reference.whole), k + 2))
    return {reference.whole[j].touching for j in around if abs(reference.excess(point, j) - excess) <= near}
