"""Lines, signs and boxes in a plane, in pixels, as the template `picture.html` draws them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.show.scales import clipped

LINES = ("before", "after", "snug", "front", "back")
AREAS = ("tolerance", "required")
SIGNS = ("switch", "nominal", "target", "tracked", "seed")
"""Styles of marks: what a style looks like says the template; told apart by dashes, width or shape too."""

POINTS, TICKS, DIGIT = 1200, 4, 5.8  # corners of all lines of a picture; ticks an axis, about; pixels a digit
STEP = 1.5  # pixels between corners, at least
SIDE = 260.0, 234.0  # pixels of the plane of scales

Chain = list[list[float]]


class Mark(NamedTuple):
    """What a picture shows at a place.

    Attributes
    ----------
    style : str
        Of `LINES`, `AREAS` or `SIGNS`.
    at : array
        Corners (n, 2) of a line, limits (2, 2) of an area, which may be endless, or the place (2,) of a sign.
    tip, name : str
        Shown under the pointer, and in the legend.
    """

    style: str
    at: Any
    tip: str = ""
    name: str = ""

    @property
    def kind(self) -> str:
        """One of "line", "area", "sign"."""
        return "line" if self.style in LINES else "area" if self.style in AREAS else "sign"


class Picture(NamedTuple):
    """A picture in pixels, as the template draws it.

    Attributes
    ----------
    size : (width, height)
    told : str
        What it shows, for who cannot see it.
    marks : sequence of Mark
        Lines as the path's text, areas as (x, y, width, height).
    axes : dict or None
        Left side, and ticks "across" and "up", each with its text.
    legend : sequence of (Mark, x, y)
    """

    size: tuple[float, float]
    told: str
    marks: Sequence[Mark]
    axes: dict[str, Any] | None = None
    legend: Sequence[tuple[Mark, float, float]] = ()


def plane(marks: Sequence[Mark], window: ArrayLike, *, told: str) -> Picture | None:
    """Return a picture of lines, signs and boxes in the plane of scales, in the order given, with axes and a legend.

    Parameters
    ----------
    marks : sequence of Mark
        What is outside the window is cut off. Too many corners are thinned out to what can be seen.
    window : (2, 2) array
        Limits of rho_1 and rho_2; there is no picture of one that is empty or endless.
    told : str
        What the picture shows, for who cannot see it.
    """
    limits = np.asarray(window, dtype=float)
    if not _spans(limits):
        return None
    across, up = (_ticks(*side) for side in limits.tolist())
    left = round(26.0 + DIGIT * max((len(text) for _, text in up), default=1), 1)
    place = _Placing(limits, (left, 6.0), SIDE)
    axes = {
        "left": left,
        "across": [(place.of((at, 0.0))[0], text) for at, text in across],
        "up": [(place.of((0.0, at))[1], text) for at, text in up],
    }
    named = list({mark.name: mark for mark in reversed(marks) if mark.name}.values())[::-1]
    legend = [(mark, round(left + 12.0, 1), 288.0 + 18.0 * k) for k, mark in enumerate(named)]
    return Picture((left + SIDE[0] + 24.0, 280.0 + 18.0 * len(named)), told, place.drawn(marks), axes, legend)


def drawing(marks: Sequence[Mark], window: ArrayLike, *, told: str) -> Picture | None:
    """Return a picture of lines and signs in a plane with equal units and without axes, for instance of a solid."""
    limits = np.asarray(window, dtype=float)
    if not _spans(limits):
        return None
    extent = np.ptp(limits, axis=1)
    width, height = (220.0 / extent.max() * extent).tolist()
    return Picture((16.0 + width, 16.0 + height), told, _Placing(limits, (8.0, 8.0), (width, height)).drawn(marks))


def _spans(limits: Array) -> bool:
    return bool(np.isfinite(limits).all() and (limits[:, 1] > limits[:, 0]).all())


class _Placing:
    """Where a plane lies on a picture: its limits (2, 2), and corner and size of its frame in pixels."""

    def __init__(self, limits: Array, corner: tuple[float, float], size: tuple[float, float]) -> None:
        self.limits = limits
        self._start = np.array([corner[0], corner[1] + size[1]])
        self._scale = np.array([size[0], -size[1]]) / (limits[:, 1] - limits[:, 0])

    def of(self, places: ArrayLike) -> Any:
        """Return places (..., 2) in pixels, to a tenth."""
        return (self._start + (np.asarray(places, dtype=float) - self.limits[:, 0]) * self._scale).round(1).tolist()

    def drawn(self, marks: Sequence[Mark]) -> list[Mark]:
        """Return the marks that are to be seen, in pixels; lines that follow each other and look the same are one."""
        chains = _longest([self._chains(mark.at) if mark.kind == "line" else [] for mark in marks])
        made: list[Mark] = []
        joins = ""
        for mark, seen in zip(marks, chains, strict=True):
            at: Any = None
            if mark.kind == "line":
                at = "".join("M" + "L".join(f"{x:g} {y:g}" for x, y in chain) for chain in seen)
                if at and not mark.tip and mark.style == joins:
                    made[-1] = made[-1]._replace(at=made[-1].at + at)
                    continue
            elif mark.kind == "area":
                at = self._area(mark.at)
            elif ((self.limits[:, 0] <= mark.at) & (mark.at <= self.limits[:, 1])).all():
                at = self.of(mark.at)
            if at:
                joins = mark.style if mark.kind == "line" and not mark.tip else ""
                made.append(mark._replace(at=at))
        return made

    def _area(self, box: ArrayLike) -> tuple[float, ...] | None:
        (a, b), (c, d) = np.clip(np.asarray(box, dtype=float), self.limits[:, :1], self.limits[:, 1:])
        (left, top), (right, bottom) = self.of((a, d)), self.of((b, c))
        return (left, top, round(right - left, 1), round(bottom - top, 1))

    def _chains(self, corners: ArrayLike) -> list[Chain]:
        """Return what is seen of a line, in pixels: several chains where it leaves the window."""
        points = np.asarray(corners, dtype=float).reshape(-1, 2)
        chains: list[Chain] = []
        for start, end in self.of(clipped(np.stack([points[:-1], points[1:]], axis=1), self.limits)[0]):
            if not chains or chains[-1][-1] != start:
                chains.append([start, end])
            elif math.dist(*chains[-1][-2:]) < STEP and len(chains[-1]) > 2:
                chains[-1][-1] = end  # the corner before is too near to be told apart
            else:
                chains[-1].append(end)
        return chains


def _longest(marks: list[list[Chain]]) -> list[list[Chain]]:
    """Return the longest chains with no more corners than `POINTS`."""
    chains = [(k, i, chain) for k, line in enumerate(marks) for i, chain in enumerate(line)]
    chains.sort(key=lambda item: -sum(math.dist(*ends) for ends in pairwise(item[2])))
    fitting = np.cumsum([len(chain) for *_, chain in chains]) <= POINTS
    kept = {(k, i) for (k, i, _), fits in zip(chains, fitting, strict=True) if fits}
    return [[chain for i, chain in enumerate(line) if (k, i) in kept] for k, line in enumerate(marks)]


def _ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Return round numbers in a range with their texts."""
    rough = (high - low) / TICKS
    power = math.floor(math.log10(rough))
    step = min((k * 10.0**power for k in (1.0, 2.0, 5.0, 10.0)), key=lambda step: abs(math.log(step / rough)))
    if not (step > 0.0 and high + step > high):  # narrower than digits tell apart
        return []
    places = max(0, -math.floor(math.log10(step) + 1e-9))
    first, last = math.ceil(low / step), math.floor(high / step)
    return [(k * step, f"{k * step:.{places}f}") for k in range(first, min(last, first + 2 * TICKS) + 1)]
