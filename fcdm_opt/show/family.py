"""The family of decision curves over a coherent range, as in Figs. 2, 6 and 7 of the paper."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.curve.segments import Segment
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.show import BLACK, BLUE, GREEN, GREY, PAGE, VERMILLION, Figure, styled
from fcdm_opt.show.lettering import Names, Sheet
from fcdm_opt.show.plots import ALONG, path, pieces, plane
from fcdm_opt.show.verdict import range_texts

if TYPE_CHECKING:
    from fcdm_opt.along.coherent_range import CoherentRange

CURVES = 5  # curves drawn on either side of the one at rest
FINE = 40  # steps on either side in which the swept area and the tracked point's track are drawn
POWERS = -10, 50
"""Of 2, from and to which multiples of a range's natural step are tried for where the tracked point leaves the box."""

DOUBLE = 2.6  # points across a double line
SCALES = "\u03c1\u2081", "\u03c1\u2082"  # names of both scales: rho with an index
INSIDE = 1.0 - 2.0**-20  # share of a range that is drawn: just at its end the tracked lines may be parallel


@styled
def family_figure(coherent: CoherentRange, *, title: str = "") -> Figure:
    """Draw the decision curves over a coherent range, and the tracked scale pair against the motion.

    Left: the family, from the lower end (blue) over rest (black) to the upper end (vermillion); what the tracked
    features' segments sweep is shaded, and its two border curves are double lines. Right: the tracked pair's scales.
    Where the range leads out of the box of scales, it is drawn as far as the tracked pair stays in it.
    """
    sheet = Sheet.of(PAGE, 3.75, title=title, caption="\n".join(range_texts(coherent)))
    left, right = (sheet.axes(x, 0.9, 2.62, 2.62) for x in (0.48, 3.88))
    ends = [drawn_end(coherent, sign) for sign in (-1.0, 1.0)]
    draw_family(left, coherent, ends)
    _draw_scales(right, coherent, ends)
    left.set_title("decision curves over the range")
    right.set_title("scales of the tracked point")
    one, two = (axes.get_legend_handles_labels() for axes in (left, right))
    sheet.legend(one[0] + two[0], one[1] + two[1], bottom=0.0)
    return sheet.figure


def drawn_end(coherent: CoherentRange, sign: float) -> float:
    """Return up to which x a side of the range is drawn: its end, or where the tracked point leaves the box."""
    from scipy.optimize import bisect

    low, high = np.asarray(coherent.problem.box, dtype=float).T

    def seen(x: float) -> bool:
        rho = coherent.rho(x)
        return bool(((rho >= low) & (rho <= high)).all())

    end = abs(coherent.high if sign > 0 else coherent.low) * INSIDE
    if end == 0.0 or not seen(0.0):
        return 0.0
    near = far = 0.0
    for power in range(*POWERS):
        far = min(end, coherent.natural_step * 2.0**power)
        if far == end or not seen(sign * far):
            break
        near = far
    return sign * (far if seen(sign * far) else bisect(lambda x: seen(sign * x) - 0.5, near, far, xtol=1e-12 * far))


def _is_end(coherent: CoherentRange, x: float) -> bool:
    return x in (coherent.low * INSIDE, coherent.high * INSIDE)


def draw_family(axes: Any, coherent: CoherentRange, ends: list[float]) -> None:
    """Draw the family of curves up to both ends, what the tracked segments sweep, and the track."""
    from matplotlib.collections import PolyCollection

    plane(axes, coherent.problem.box)
    low, high = ends
    track = np.unique(np.concatenate([np.linspace(low, 0.0, FINE + 1), np.linspace(0.0, high, FINE + 1)]))
    swept = [_own(coherent, x) for x in track]
    cells = [
        [before.start, before.end, after.end, after.start]
        for one, two in pairwise(swept)
        for before, after in ((one[f], two[f]) for f in coherent.features if f in one and f in two)
    ]
    if cells:
        axes.add_collection(PolyCollection(cells, facecolor="#DDEFE8", edgecolor="#DDEFE8", linewidth=0.5, zorder=0.5))
    for end, colour in ((low, BLUE), (high, VERMILLION)):
        for x in np.linspace(0.0, end, CURVES + 1)[1:-1]:
            draw_at(axes, coherent, x, colour, 0.6, 0.45)
        if end:
            name = "low" if end < 0 else "high"
            at = "end" if _is_end(coherent, end) else "leaves the box"
            draw_at(axes, coherent, end, colour, DOUBLE, 1.0, f"x = {end:.4g} ({name}, {at})")
    draw_at(axes, coherent, 0.0, BLACK, 1.3, 1.0, "at rest")
    names = Names(axes, np.concatenate([pieces(coherent.curve(x)) for x in (low, 0.0, high)]))
    names.keep(coherent.rho(0.0), 10.0)
    for x, colour, name in ((low, BLUE, "low"), (high, VERMILLION, "high")):
        spots = np.array([s.start + share * (s.end - s.start) for s in coherent.curve(x).segments for share in ALONG])
        if x and len(spots):  # where it is furthest from the curve at rest, on the outer side
            gaps = np.array([coherent.curve(0.0).gap(spot) for spot in spots])
            order = np.argsort(-np.abs(gaps))
            names.put(name, spots[order], -np.sign(gaps[order[0]] or -1.0) * np.ones(2), colour=colour)
    pairs = np.array([coherent.rho(x) for x in track])
    axes.plot(*pairs.T, color=GREEN, linewidth=1.6, zorder=4, label="track of the tracked point")
    star = {"marker": "*", "markersize": 8, "linestyle": "none", "zorder": 5, "label": "tracked point"}
    axes.plot(*coherent.rho(0.0), color=BLACK, **star)


def _own(coherent: CoherentRange, x: float) -> dict[Any, Segment]:
    """Return the tracked features' segments at x, those at the tracked point."""
    rho = coherent.rho(x)
    listed = [segment for segment in coherent.curve(x).segments if segment.feature in coherent.features]
    listed.sort(key=lambda segment: -float(np.abs(segment.nearest(rho) - rho).max()))
    return {segment.feature: segment for segment in listed}  # of one feature the nearest, as the last


def draw_at(
    axes: Any, coherent: CoherentRange, x: float, colour: str, width: float, alpha: float, label: str | None = None
) -> None:
    """Draw the curve at x in points of width; of width `DOUBLE` as a double line."""
    ends = pieces(coherent.curve(x))
    if not len(ends):
        return
    axes.plot(*path(ends).T, color=colour, linewidth=width, alpha=alpha, solid_capstyle="butt", solid_joinstyle="miter",
              zorder=3, label=label, path_effects=_double(colour) if width == DOUBLE else None)  # fmt: skip


def _double(colour: str) -> list[Any]:
    from matplotlib.patheffects import Stroke

    return [Stroke(linewidth=DOUBLE, foreground=colour), Stroke(linewidth=DOUBLE / 2.4, foreground="white")]


def _draw_scales(axes: Any, coherent: CoherentRange, ends: list[float]) -> None:
    low, high = ends
    xs = np.linspace(low, high, 4 * FINE + 1) if high > low else np.zeros(1)
    pairs: Array = np.array([coherent.rho(x) for x in xs])
    for column, colour, style in ((0, BLUE, "-"), (1, VERMILLION, "--")):
        axes.plot(xs, pairs[:, column], color=colour, linestyle=style, linewidth=1.3, label=SCALES[column])
    for x, colour in ((low, BLUE), (high, VERMILLION)):
        if x and _is_end(coherent, x):
            axes.axvline(x, color=colour, linewidth=DOUBLE, path_effects=_double(colour))
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    along = coherent.problem.motion.describe(coherent.direction, unit=coherent.problem.unit)
    axes.set_xlabel(f"x, multiples of {along}")
    axes.set_ylabel(r"scales $\rho_1$, $\rho_2$  (1 = as drawn)")
    axes.locator_params(nbins=6)
    axes.grid(visible=True)
    axes.margins(x=0.06, y=0.08)
