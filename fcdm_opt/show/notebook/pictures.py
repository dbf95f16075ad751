"""Lines, points and boxes of a card, in a plane."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

from fcdm_opt.show.notebook.words import Html, cleaned

Window = Iterable[Iterable[float]]  # (low, high) of rho_1 and of rho_2


class Scales(Protocol):
    """Two numbers, as a sequence or an array."""

    def __getitem__(self, k: int, /) -> Any:
        """Return the first or the second."""


STROKES = {
    "before": 'stroke="#0072B2" stroke-width="2"',
    "after": 'stroke="#D55E00" stroke-width="2" stroke-dasharray="7 3"',
    "snug": 'stroke="#CC79A7" stroke-width="6" stroke-opacity="0.6"',
    "front": 'stroke="currentColor" stroke-width="1.2"',
    "back": 'stroke="currentColor" stroke-width="0.7" stroke-opacity="0.35"',
}
"""How lines look, by what they are; told apart by dashes or width too."""

AREAS = {
    "tolerance": 'fill="#7F7F7F" fill-opacity="0.3" stroke="#7F7F7F"',
    "required": 'fill="#009E73" fill-opacity="0.2"',
}

SHAPES = {
    "switch": '<circle cx="{x}" cy="{y}" r="2.6" fill="#0072B2"/>',
    "nominal": '<path d="M{x} {y}m0 -7l2 4.5 5 .3-3.8 3 1.3 4.7-4.5-2.6-4.5 2.6 1.3-4.7-3.8-3 5-.3z"/>',
    "target": '<path d="M{x} {y}m0 -6l6 6-6 6-6-6z" fill="none" stroke="#009E73" stroke-width="1.8"/>',
    "after": '<circle cx="{x}" cy="{y}" r="8" fill="none" stroke="#D55E00" stroke-width="1.8"/>',
    "seed": '<path d="M{x} {y}m-5 0h10m-5-5v10" fill="none" stroke="#D55E00" stroke-width="1.8"/>',
}
"""How points look, as in the pictures of `show.plots`."""

POINTS, TICKS, DIGIT = 1200, 4, 5.8  # corners of all lines of a picture; ticks an axis, about; pixels a digit


class Line(NamedTuple):
    """A chain of scale pairs. `style` is a key of `STROKES`; `tip` shows under the pointer, `name` in the legend."""

    points: Iterable[Scales]
    style: str
    tip: str = ""
    name: str = ""


class Point(NamedTuple):
    """A scale pair. `shape` is a key of `SHAPES`."""

    at: Scales
    shape: str
    tip: str = ""
    name: str = ""


class Area(NamedTuple):
    """A box of scale pairs, which may be endless. `style` is a key of `AREAS`."""

    box: Window
    style: str
    tip: str = ""
    name: str = ""


Mark = Line | Point | Area


# -------------------------------------------------------------------------------------------------------------- picture


def plane(marks: Iterable[Mark], window: Window, *, told: str) -> Html:
    """Return a picture of lines, points and boxes in the plane of scales, in the order given, with axes and a legend.

    Parameters
    ----------
    marks : iterable of Line, Point, Area
        What is outside the window is cut off. Too many corners are thinned out to what can be seen.
    window : ((low, high), (low, high))
        Of rho_1 and rho_2; nothing is drawn of one that is empty or endless.
    told : str
        What the picture shows, for who cannot see it.
    """
    (left, right), (low, high) = ends = [[float(end) for end in side] for side in window]
    if not all(math.isfinite(b - a) and b > a for a, b in ends):
        return Html("")
    across, up = _ticks(left, right), _ticks(low, high)
    edge = 26.0 + DIGIT * max((len(text) for _, text in up), default=1)
    sheet = _Sheet((left, right, low, high), (edge, edge + 260.0, 240.0, 6.0))
    made = [
        *(_mark_x(sheet.x(at), sheet.bottom, text) for at, text in across),
        *(_mark_y(sheet.y(at), sheet.left, text) for at, text in up),
        f'<rect x="{sheet.left:.1f}" y="6" width="260" height="234" fill="none" stroke="currentColor" '
        'stroke-opacity="0.45"/>',
        f'<text x="{edge + 130:.1f}" y="268" text-anchor="middle">scale of body 1 (movable)</text>',
        '<text x="12" y="123" text-anchor="middle" transform="rotate(-90 12 123)">scale of body 2 (static)</text>',
    ]
    listed = list(marks)
    made += sheet.drawn(listed)
    named = list({mark.name: mark for mark in reversed(listed) if mark.name}.values())[::-1]
    for k, mark in enumerate(named):
        made.append(_legend(mark, edge, 288.0 + 18.0 * k))
    return _svg(made, edge + 284.0, 280.0 + 18.0 * len(named), told)


def drawing(marks: Iterable[Mark], window: Window, *, told: str) -> Html:
    """Return a picture of lines and points in a plane with equal units and without axes, for instance of a solid."""
    (left, right), (low, high) = ends = [[float(end) for end in side] for side in window]
    width, height = (b - a for a, b in ends)
    unit = 220.0 / max(width, height, 1e-300)
    if not all(math.isfinite(b - a) and b > a for a, b in ends):
        return Html("")
    sheet = _Sheet((left, right, low, high), (8.0, 8.0 + unit * width, 8.0 + unit * height, 8.0))
    return _svg(sheet.drawn(list(marks)), 16.0 + unit * width, 16.0 + unit * height, told)


class _Sheet:
    """Where the plane lies on the picture: the window (left, right, low, high) and its sides in pixels."""

    def __init__(self, window: tuple[float, float, float, float], pixels: tuple[float, float, float, float]) -> None:
        self.window = window
        self.left, self.right, self.bottom, self.top = pixels

    def x(self, at: float) -> float:
        """Return the pixel of rho_1."""
        low, high = self.window[:2]
        return self.left + (at - low) / (high - low) * (self.right - self.left)

    def y(self, at: float) -> float:
        """Return the pixel of rho_2, counted from the top."""
        low, high = self.window[2:]
        return self.bottom - (at - low) / (high - low) * (self.bottom - self.top)

    def drawn(self, marks: Sequence[Mark]) -> list[str]:
        """Return the pieces of the picture, one a mark that is to be seen."""
        chains = _thinned([self._chains(mark.points) if isinstance(mark, Line) else [] for mark in marks])
        made: list[str] = []
        last = ""
        for mark, own in zip(marks, chains, strict=True):
            if isinstance(mark, Line):
                if own:
                    way = "".join("M" + "L".join(f"{x:g} {y:g}" for x, y in chain) for chain in own)
                    look = "" if mark.tip else f'" fill="none" {STROKES[mark.style]}/>'
                    if look and look == last:  # one path for all lines that look the same
                        made[-1] = made[-1].removesuffix(look) + way + look
                    else:
                        made.append(_path(way, mark))
                    last = look
                continue
            last = ""
            if isinstance(mark, Area):
                made.append(self._area(mark))
            elif self._within(mark.at):
                x, y = self.x(float(mark.at[0])), self.y(float(mark.at[1]))
                made.append(_tipped(SHAPES[mark.shape].format(x=f"{x:.1f}", y=f"{y:.1f}"), mark.tip))
        return made

    def _within(self, at: Scales) -> bool:
        left, right, low, high = self.window
        return left <= at[0] <= right and low <= at[1] <= high

    def _area(self, area: Area) -> str:
        left, right, low, high = self.window
        (a, b), (c, d) = area.box
        a, b, c, d = max(float(a), left), min(float(b), right), max(float(c), low), min(float(d), high)
        if not (a <= b and c <= d):
            return ""
        place = f'x="{self.x(a):.1f}" y="{self.y(d):.1f}"'
        size = f'width="{self.x(b) - self.x(a):.1f}" height="{self.y(c) - self.y(d):.1f}"'
        return _tipped(f"<rect {place} {size} {AREAS[area.style]}/>", area.tip)

    def _chains(self, points: Iterable[Scales]) -> list[list[tuple[float, float]]]:
        """Return what is seen of a chain of scale pairs, in pixels: several chains where it leaves the window."""
        chains: list[list[tuple[float, float]]] = []
        for one, two in pairwise((float(p[0]), float(p[1])) for p in points):
            inside = _clipped(one, two, self.window)
            if inside is None:
                continue
            ends = [(round(self.x(x), 1), round(self.y(y), 1)) for x, y in inside]
            if chains and chains[-1][-1] == ends[0]:
                chains[-1] += ends[1:] if ends[1] != ends[0] else []
            else:
                chains.append(ends)
        return chains


def _clipped(
    one: tuple[float, float], two: tuple[float, float], window: tuple[float, float, float, float]
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Return the ends of a straight piece inside a window; None where it passes outside or is not finite."""
    enter, leave = 0.0, 1.0
    steps = [b - a for a, b in zip(one, two, strict=True)]
    if not all(map(math.isfinite, (*one, *steps))):
        return None
    for start, step, low, high in zip(one, steps, window[::2], window[1::2], strict=True):
        if step == 0.0:
            if not low <= start <= high:
                return None
            continue
        first, last = sorted(((low - start) / step, (high - start) / step))
        enter, leave = max(enter, first), min(leave, last)
    if enter > leave:
        return None
    ends = [tuple(p + share * s for p, s in zip(one, steps, strict=True)) for share in (enter, leave)]
    return (ends[0][0], ends[0][1]), (ends[1][0], ends[1][1])


def _thinned(marks: list[list[list[tuple[float, float]]]]) -> list[list[list[tuple[float, float]]]]:
    """Return chains with no more corners than `POINTS`: near ones are left out, then the shortest chains."""
    step = 0.5
    while sum(len(chain) for own in marks for chain in own) > POINTS and step < 32.0:
        marks = [[_sparse(chain, step) for chain in own] for own in marks]
        step *= 2.0
    if sum(len(chain) for own in marks for chain in own) <= POINTS:
        return marks
    longest = sorted((-_length(chain), k, i) for k, own in enumerate(marks) for i, chain in enumerate(own))
    kept: set[tuple[int, int]] = set()
    left = POINTS
    for _, k, i in longest:
        left -= len(marks[k][i])
        if left < 0:
            break
        kept.add((k, i))
    return [[chain for i, chain in enumerate(own) if (k, i) in kept] for k, own in enumerate(marks)]


def _sparse(chain: list[tuple[float, float]], step: float) -> list[tuple[float, float]]:
    """Return a chain without the corners that are near the one before, its ends apart."""
    kept = chain[:1]
    for corner in chain[1:-1]:
        if math.dist(corner, kept[-1]) >= step:
            kept.append(corner)
    return [*kept, chain[-1]]


def _length(chain: list[tuple[float, float]]) -> float:
    return sum(math.dist(*ends) for ends in pairwise(chain))


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


def _mark_x(x: float, bottom: float, text: str) -> str:
    way = f'<path d="M{x:.1f} {bottom:g}v4" stroke="currentColor"/>'
    return f'{way}<text x="{x:.1f}" y="{bottom + 14:g}" text-anchor="middle">{text}</text>'


def _mark_y(y: float, left: float, text: str) -> str:
    way = f'<path d="M{left:.1f} {y:.1f}h-4" stroke="currentColor"/>'
    return f'{way}<text x="{left - 6:.1f}" y="{y + 3.5:.1f}" text-anchor="end">{text}</text>'


def _legend(mark: Mark, left: float, y: float) -> str:
    x = left + 12.0
    if isinstance(mark, Line):
        sample = f'<path d="M{x - 12:.1f} {y:g}h24" fill="none" {STROKES[mark.style]}/>'
    elif isinstance(mark, Area):
        sample = f'<rect x="{x - 12:.1f}" y="{y - 5:g}" width="24" height="10" {AREAS[mark.style]}/>'
    else:
        sample = SHAPES[mark.shape].format(x=f"{x:.1f}", y=f"{y:g}")
    return f'{sample}<text x="{x + 20:.1f}" y="{y + 3.5:g}">{cleaned(mark.name, 44)}</text>'


def _path(way: str, line: Line) -> str:
    path = f'<path d="{way}" fill="none" {STROKES[line.style]}/>'
    if line.tip:  # a wide line that is not seen, but found by the pointer
        path += f'<path d="{way}" fill="none" stroke="#7F7F7F" stroke-opacity="0" stroke-width="11"/>'
    return _tipped(path, line.tip)


def _tipped(shape: str, tip: str) -> str:
    return f"<g><title>{cleaned(tip)}</title>{shape}</g>" if tip else shape


def _svg(pieces: Iterable[str], width: float, height: float, told: str) -> Html:
    return Html(
        f'<svg width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}" role="img" '
        f'aria-label="{cleaned(told)}" style="max-width:100%;height:auto" font-family="sans-serif" font-size="10.5" '
        f'fill="currentColor">{"".join(pieces)}</svg>'
    )
