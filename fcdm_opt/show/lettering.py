"""Words on a picture: title, caption and lists that stay on the page, names that keep clear of each other."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.show import DARK, NOTE, TITLE, Figure, new_figure

SPACING, DESCENT, ASCENT = 1.2, 0.24, 0.76
"""Distance of lines, and how far letters of the font reach below and above the line, in sizes of their text."""

LEADING = (SPACING - DESCENT) / ASCENT  # the same distance as matplotlib counts it: to the descent above, in ascents
EDGE = 0.08  # inches that words keep from the edge of the page
DISTANCES, ANGLES = (7.0, 10.0, 14.0, 20.0, 28.0), (0, 180, 35, -35, 145, -145, 70, -70, 110, -110)
"""Where a name may stand: points from what it names, and degrees from the wanted direction; the nearest first."""

LEADER = 12.0  # points from which on a line leads from a name to what it names
INDENT = "     "  # of what belongs to the line above it
CLEAR = 1.0  # points between a name and anything else
BADGE: dict[str, Any] = {"facecolor": "#F7F7F5", "linewidth": 0.5}  # light in any scheme


@dataclass(frozen=True)
class Sheet:
    """A figure with a title above and a caption below an area that is measured in inches from its lower left corner.

    `size`, (width, height), is that of the area, `foot` the height of what is below it.
    """

    figure: Figure
    size: tuple[float, float]
    foot: float

    @classmethod
    def of(cls, width: float, height: float, *, title: str = "", caption: str = "") -> Sheet:
        """Return an empty sheet, as much higher than the area as title and caption need."""
        figure = new_figure(width, height)
        room = width - 2.0 * EDGE
        head, foot = (
            fitted(figure, text, size, room) if text else [] for text, size in ((title, TITLE), (caption, NOTE))
        )
        above, below = (
            2.0 * EDGE + len(lines) * SPACING * size / 72.0 if lines else EDGE
            for lines, size in ((head, TITLE), (foot, NOTE))
        )
        whole = height + above + below
        figure.set_figheight(whole)
        if head:
            figure.text(0.5, 1.0 - EDGE / whole, literal("\n".join(head)), ha="center", va="top", fontsize=TITLE)
        if foot:
            look: Any = {"ha": "center", "va": "bottom", "fontsize": NOTE, "color": DARK, "linespacing": LEADING}
            figure.text(0.5, EDGE / whole, literal("\n".join(foot)), **look)
        return cls(figure, (width, height), below)

    def place(self, left: float, bottom: float, width: float, height: float) -> tuple[float, float, float, float]:
        """Return a rectangle of the area as shares of the figure."""
        whole = self.figure.get_figwidth(), self.figure.get_figheight()
        return left / whole[0], (self.foot + bottom) / whole[1], width / whole[0], height / whole[1]

    def axes(self, left: float, bottom: float, width: float, height: float) -> Any:
        """Add axes."""
        return self.figure.add_axes(self.place(left, bottom, width, height))

    def list(self, left: float, top: float, width: float, lines: Iterable[str]) -> None:
        """Write lines, wrapped, downwards as far as there is room; say how many are left."""
        made: list[str] = []
        room = int(top * 72.0 / (SPACING * NOTE))
        entries = [fitted(self.figure, line, NOTE, width, hang="" if line[:1] == " " else INDENT) for line in lines]
        for k, entry in enumerate(entries):
            more = 0 if k == len(entries) - 1 else 1
            if len(made) + len(entry) + more > room:
                made.append(f"... and {len(entries) - k} more")
                break
            made += entry
        x, y, *_ = self.place(left, top, 0.0, 0.0)
        self.figure.text(x, y, literal("\n".join(made)), va="top", fontsize=NOTE, linespacing=LEADING)

    def legend(self, handles: Sequence[Any], labels: Sequence[str], *, bottom: float, most: int = 4) -> float:
        """Put a legend in as few rows as fit across the page above `bottom`; return its height in inches."""
        if not handles:
            return 0.0
        x, y, *_ = self.place(self.size[0] / 2, bottom, 0.0, 0.0)
        labels = [*map(literal, labels)]
        for columns in range(min(most, len(labels)), 0, -1):
            legend = self.figure.legend(
                handles, labels, loc="lower center", bbox_to_anchor=(x, y), ncols=columns, borderaxespad=0.0,
                handlelength=2.6, columnspacing=1.6, fontsize=NOTE,
            )  # fmt: skip
            extent = legend.get_window_extent(self.figure.canvas.get_renderer())  # type: ignore[attr-defined]
            if columns == 1 or extent.width <= (self.size[0] - 2.0 * EDGE) * self.figure.dpi:
                break
            legend.remove()
        return float(extent.height / self.figure.dpi)


def literal(text: str) -> str:
    """Return a text such that a picture shows it as it is: between two dollar signs stands no formula."""
    return text.replace("$", r"\$")


def rounded_down(size: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is no more than a length or an angle."""
    power = 10.0 ** math.floor(math.log10(size))
    return float(f"{max(k for k in (1, 2, 5) if k * power <= size) * power:.3g}")


def fitted(
    figure: Figure, text: str, size: float, width: float, *, hang: str = "", weight: str = "normal"
) -> list[str]:
    """Return a text in lines no wider than so many inches, the further ones indented by `hang` more.

    Lines break at spaces that are not no-break spaces, words that are too long behind commas, or anywhere.
    """
    from matplotlib.font_manager import FontProperties

    renderer: Any = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    font = FontProperties(size=size, weight=weight)

    def fits(line: str) -> bool:
        extent = renderer.get_text_width_height_descent(line.rstrip() or " ", font, ismath=False)[0]
        return bool(extent <= width * figure.dpi)

    lines: list[str] = []
    for given in text.split("\n"):
        indent = given[: len(given) - len(given.lstrip())]
        line = indent
        for word in re.findall(r"[\S\u00a0]+[^\S\u00a0]*", given):
            pieces = [word] if fits(indent + word) else re.findall(r"[^,;]*[,;]+\s*|[^,;]+", word)
            for piece in pieces if all(fits(indent + piece) for piece in pieces) else list(word):
                if line.strip() and not fits(line + piece):
                    lines.append(line.rstrip())
                    line = indent + hang
                line += piece
        lines.append(line.rstrip())
    return lines


class Names:
    """Names beside what they name in one panel: each keeps clear of the others, and of lines where it can.

    The axes have their place and limits; `lines`, (n, 2, 2), are ends of straight pieces that names should not cross.
    """

    def __init__(self, axes: Any, lines: ArrayLike = ()) -> None:
        self._axes = axes
        self._dot = axes.figure.dpi / 72.0
        self._lines = self._page(np.asarray(lines, dtype=float).reshape(-1, 2)).reshape(-1, 2, 2)
        self._taken: list[Array] = []

    def keep(self, point: ArrayLike, size: float) -> None:
        """Keep names clear of a marker of so many points."""
        middle, half = self._page(np.asarray(point, dtype=float)), size / 2.0 * self._dot
        self._taken.append(np.array([middle - half, middle + half]))

    def put(
        self, text: str, anchors: ArrayLike, away: ArrayLike, *, colour: str, upon: bool = False, badge: bool = False
    ) -> float | None:
        """Write a name beside the first of several points, (n, 2), where there is room; leave it out else.

        Points are the best first; the name stands in the direction `away`, (2,), on the page if it can, and a line of
        its colour leads to one that stands far off. With `upon` it stands upon the first point where it covers no other
        and no line, if there is one; else a line leads to it however near it stands, from a dot at the point. A `badge`
        is a ground of its own, to be read on any body: of a number a light one on any page, of words the page's.
        Returns how far its middle is from that point, in points of the page; None where it is left out.
        """
        spots = self._page(np.asarray(anchors, dtype=float).reshape(-1, 2))
        within = self._axes.bbox
        spots = spots[((spots >= within.min - 0.5) & (spots <= within.max + 0.5)).all(axis=1)]  # half a pixel
        if not len(spots):
            return None
        look: dict[str, Any] = {"color": colour, "fontsize": NOTE, "ha": "center", "va": "center", "zorder": 6}
        rim = (
            {"boxstyle": "circle,pad=0.15", "edgecolor": colour}
            if len(text) == 1
            else {"facecolor": "#FFFFFF", "edgecolor": "none", "pad": 1}  # follows the page's scheme, as its words do
        )
        look["bbox"] = {**BADGE, **rim} if badge else None
        label = self._axes.annotate(literal(text), (0, 0), xycoords="figure pixels", **look)
        half = label.get_window_extent(self._axes.figure.canvas.get_renderer()).size / 2.0 + CLEAR * self._dot
        label.remove()
        unit = np.asarray(away, dtype=float) / np.linalg.norm(away)
        free = [spot for spot in spots if upon and not self._covers(spot, half) and not self._crosses(spot, half)]
        spot, middle = (free[0], free[0]) if free else self._free(spots, unit, half)
        if middle is None:
            return None
        self._taken.append(np.array([middle - half, middle + half]))
        led = upon and not free
        shift = (middle - spot) / self._dot  # in points from the named point: stays in place at any resolution
        arrow = {"arrowstyle": "-", "color": colour, "linewidth": 0.4, "shrinkA": 1.0, "shrinkB": 1.0}
        self._axes.annotate(
            literal(text), tuple(self._axes.transData.inverted().transform(spot)), xytext=tuple(shift),
            textcoords="offset points", annotation_clip=False, **look,
            arrowprops=arrow if led or np.linalg.norm(shift) - min(half) / self._dot > LEADER else None,
        )  # fmt: skip
        if led:
            here = self._axes.transData.inverted().transform(spot)
            self._axes.plot(*here, ".", color=colour, markersize=2.0, zorder=6)
        return float(np.linalg.norm(shift))

    def _free(self, spots: Array, unit: Array, half: Array) -> tuple[Array, Array | None]:
        """Return the point to name and the middle of the first free place, best one clear of lines."""
        low, high = self._axes.bbox.min + half, self._axes.bbox.max - half
        for strict, distance, turn in product((True, False), DISTANCES, np.radians(ANGLES)):
            direction = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ unit
            # the nearest edge of the name is so far off, whichever way it stands
            off = distance * self._dot * 0.5 + float(np.abs(half * direction).sum())
            for spot in spots:
                middle = spot + off * direction
                within = bool((middle >= low).all() and (middle <= high).all()) and not self._covers(middle, half)
                if within and not (strict and self._crosses(middle, half)):
                    return spot, middle
        return spots[0], None

    def _covers(self, middle: Array, half: Array) -> bool:
        """Tell whether a name with its middle there would stand on what is known."""
        low, high = middle - half, middle + half
        return any((low < other[1]).all() and (other[0] < high).all() for other in self._taken)

    def _crosses(self, middle: Array, half: Array) -> bool:
        """Tell whether a line would pass through a name with its middle there."""
        return bool(clipped(self._lines, np.array([middle - half, middle + half]).T)[1].any())

    def _page(self, points: Array) -> Array:
        return np.asarray(self._axes.transData.transform(points))


def clipped(lines: ArrayLike, window: ArrayLike) -> tuple[Array, Any]:
    """Return the parts inside a window of straight pieces (n, 2, 2) that pass through it, and which these are.

    The window, (2, 2), has low and high of both scales; pieces that are not finite are outside. Parts are (k, 2, 2),
    and a flag for each piece, (n,), tells which.
    """
    whole = np.asarray(lines, dtype=float).reshape(-1, 2, 2)
    low, high = np.asarray(window, dtype=float).T
    start = whole[:, 0]
    with np.errstate(all="ignore"):
        step = whole[:, 1] - start
        ends = np.sort((np.array([low, high]) - start[:, None]) / step[:, None], axis=1)  # (n, low or high, axis)
    still = step == 0.0
    within = (low <= start) & (start <= high)
    enter = np.where(still, np.where(within, -np.inf, np.inf), ends[:, 0]).max(axis=1, initial=0.0)
    leave = np.where(still, np.where(within, np.inf, -np.inf), ends[:, 1]).min(axis=1, initial=1.0)
    inside = np.isfinite(start + step).all(axis=1) & (enter < leave)
    shares, kept = np.array([enter, leave]).T[inside], whole[inside]
    return kept[:, :1] + shares[:, :, None] * (kept[:, 1:] - kept[:, :1]), inside
