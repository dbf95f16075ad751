"""Decision curves in the plane of scales, before and after a motion, and what of that plane a picture shows.

The family of curves over a coherent range is as in Figs. 2, 6 and 7 of the paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.curve.decision_curve import DEFAULT_BOX, DecisionCurve, decision_curve
from fcdm_opt.curve.segments import Segment
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.solution import Solution
from fcdm_opt.show import BLACK, BLUE, DARK, GREEN, GREY, PAGE, PURPLE, VERMILLION, Figure, styled
from fcdm_opt.show.lettering import Names, Sheet, clipped
from fcdm_opt.show.verdict import range_texts

if TYPE_CHECKING:
    from fcdm_opt.along.coherent_range import CoherentRange

ALONG = (0.4, 0.6, 0.25, 0.75, 0.5)  # where along a segment its name stands, the best place first
MARGIN, LEAST_EXTENT = 0.3, 0.05
"""Room around what must be seen, as a share of its extent; the extent is at least this share of rho."""

AROUND = 2.0  # how far the wider panel goes, in widths of the other, of problems whose sizes no box of scales tells
MOST_NAMED = 200  # segments that are named: of more none could be told from the others


@styled
def decision_curve_figure(curve: DecisionCurve, *, title: str = "", caption: str = "", tables: bool = True) -> Figure:
    """Draw a decision curve in its box; with `tables` its segments' features and switching points are listed there."""
    sheet = Sheet.of(PAGE if tables else 3.95, 3.7, title=title, caption=caption)
    axes = sheet.axes(0.5, 0.38, 3.3, 3.25)
    plane(axes, curve.box)
    draw_curve(axes, curve, BLUE, "-", "decision curve")
    names = Names(axes, pieces(curve))
    name_curve(names, axes, curve, BLUE, sides=(1.0, -1.0))
    name_sides(names, curve)
    if tables:
        sheet.list(3.95, 3.63, PAGE - 3.95 - 0.1, listed(curve))
    return sheet.figure


def listed(curve: DecisionCurve) -> list[str]:
    """Return what a curve's pieces are, line by line; details are indented."""
    if not (curve.segments or curve.switching_points):
        return [f"no contact in the box: {curve.status}"]
    lines = [f"S{s.index}  {s.feature.label}{'  (snug)' if s.snug else ''}" for s in curve.segments]
    for point in curve.switching_points:
        lines.append(f"SW{point.index}  ({point.rho[0]:.6f}, {point.rho[1]:.6f})")
        lines += [f"        {feature.label}" for feature in point.contact_features]
    return lines


@styled
def before_after_figure(
    problem: Problem, solution: Solution | None = None, *, title: str = "", caption: str = ""
) -> Figure:
    """Draw the decision curve before and after the motion: the whole box, and the tolerance box enlarged.

    Star: tracked point before; diamond: target pair (the parts made); circle: tracked point after; as in Figs. 6 and
    7 of the paper. Without a solution, and where it has no motion, only the curve before is drawn.
    """
    before, after = problem.curve, None
    pose, rho = (None, None) if solution is None else (solution.transform, solution.rho)
    if pose is not None:
        after = decision_curve(*problem.active, box=problem.box, transform=pose)
    sheet = Sheet.of(PAGE, 3.6, title=title, caption=caption)
    whole, zoom = (sheet.axes(left, 0.75, 2.62, 2.62) for left in (0.48, 3.88))
    limits = window(problem, solution)
    box = whole_box(problem, limits)
    name = "whole box" if _has_box(problem) else "around the parts made"
    scales = "made" if problem.made else "drawn"
    plane(whole, box, scales)
    plane(zoom, limits, scales)
    outward = -1.0 if rho is not None and before.gap(rho) > 0 else 1.0  # names keep clear of `after`
    for axes, size, seen in ((whole, 0.6, box), (zoom, 0.85, limits)):
        draw_tolerance(axes, problem)
        curve = reaching(before, seen)
        draw_curve(axes, curve, BLUE, "-", "decision curve before")
        lines = [pieces(curve)]
        if after is not None:
            moved = reaching(after, seen)
            draw_curve(axes, moved, VERMILLION, (0, (5, 1.5)), "after the motion")
            lines.append(pieces(moved))
        draw_points(axes, problem, rho, size)
        names = Names(axes, np.concatenate(lines))
        for point in marked(problem, solution):
            names.keep(point, 14.0 * size)
        name_curve(names, axes, before, BLUE, sides=(-outward, -outward))
        if after is not None and axes is zoom:
            name_curve(names, axes, after, VERMILLION, sides=(outward, outward), mark="'")
    (low_1, high_1), (low_2, high_2) = limits
    whole.plot([low_1, high_1, high_1, low_1, low_1], [low_2, low_2, high_2, high_2, low_2], color=GREY, linewidth=0.8)
    whole.set_title(name)
    zoom.set_title("enlarged: the frame on the left")
    sheet.legend(*zoom.get_legend_handles_labels(), bottom=0.0)
    return sheet.figure


def whole_box(problem: Problem, limits: Array) -> Any:
    """Return a problem's box, or scales around limits, (2, 2), where it has none."""
    if _has_box(problem):
        return problem.box
    middle, far = limits.mean(axis=1), AROUND * np.ptp(limits, axis=1)
    return np.column_stack([np.maximum(middle - far, limits[:, 0] / 2.0), middle + far])


def _has_box(problem: Problem) -> bool:
    """Tell whether a box of scales says something: not the usual one, where sizes by name are made."""
    return not (problem.sizes and np.array_equal(problem.box, DEFAULT_BOX))


def plane(axes: Any, box: ArrayLike, scaled: str = "drawn") -> None:
    """Set axes up as the plane of scales over a box, of parts as "drawn" or as "made"."""
    (low_1, high_1), (low_2, high_2) = np.asarray(box, dtype=float)
    axes.set(xlim=(low_1, high_1), ylim=(low_2, high_2))
    axes.set_xlabel(r"$\rho_1$, size of the movable part (1 = as " + scaled + ")")
    axes.set_ylabel(r"$\rho_2$, size of the static part (1 = as " + scaled + ")")
    axes.locator_params(nbins=6)
    axes.grid(visible=True)


def draw_curve(axes: Any, curve: DecisionCurve, colour: str, style: Any, label: str) -> None:
    """Draw a curve with its switching points; what fits snugly stands out."""
    ends, snug = pieces(curve), np.array([segment.snug for segment in curve.segments], dtype=bool)
    wide = {"color": PURPLE, "linewidth": 4.0, "alpha": 0.5, "zorder": 2.5, "label": "snug fit"}
    thin = {"color": colour, "linestyle": style, "linewidth": 1.3, "zorder": 3, "label": label}
    for some, look in ((ends[snug], wide), (ends, thin)):
        if len(some):
            axes.plot(*path(some).T, **look)
    corners = np.array([point.rho for point in curve.switching_points]).reshape(-1, 2)
    axes.plot(*corners.T, marker="o", markersize=3.0, color=colour, linestyle="none", zorder=3.5)


def name_curve(
    names: Names, axes: Any, curve: DecisionCurve, colour: str, *, sides: tuple[float, float], mark: str = ""
) -> None:
    """Write SW1, SW2, ... and S1, S2, ... beside the curve, each kind on its side: 1 upper right, -1 lower left."""
    if len(curve.segments) > MOST_NAMED:
        return
    limits = np.array([axes.get_xlim(), axes.get_ylim()])
    per_unit = axes.bbox.size / np.ptp(limits, axis=1)
    for point in curve.switching_points:
        names.put(f"SW{point.index}{mark}", point.rho, sides[1] * np.ones(2), colour=colour)
    for segment in curve.segments:
        parts, _ = clipped([segment.start, segment.end], limits)
        for start, end in parts:
            spots = start + np.outer(ALONG, end - start)
            across = segment.line[:2] / per_unit
            side = sides[0] if across.sum() >= 0 else -sides[0]
            names.put(f"S{segment.index}{mark}", spots, side * across, colour=colour)


def name_sides(names: Names, curve: DecisionCurve) -> None:
    """Write in two corners of the box whether the bodies are apart or overlap there."""
    for corner, inwards in ((0, 1.0), (1, -1.0)):
        rho = np.asarray(curve.box)[:, corner]
        gap = curve.gap(rho)
        word = "apart" if gap > 0 else "overlapping" if gap < 0 else "touching"
        names.put(word, rho, (inwards, inwards), colour=DARK)


def draw_tolerance(axes: Any, problem: Problem) -> None:
    """Shadow of the tolerances around the nominal pair, and the quadrant that goal "beyond" asks for."""
    from matplotlib.patches import Rectangle

    areas = []
    if problem.tolerance is not None:
        areas.append((*tolerance_box(problem), {"facecolor": GREY, "alpha": 0.3, "zorder": 1, "label": "tolerance"}))
    if problem.goal == "beyond":
        limits = np.array([axes.get_xlim(), axes.get_ylim()])
        far = np.where(problem.signs > 0, limits[:, 1], limits[:, 0])
        name = f"required by {problem.requirement}" if problem.requirement else "required"
        areas.append((problem.target, far, {"facecolor": GREEN, "alpha": 0.1, "zorder": 0, "label": name}))
    for corner, opposite, look in areas:
        axes.add_patch(Rectangle(tuple(corner), *(opposite - corner), edgecolor="none", **look))


def draw_points(axes: Any, problem: Problem, rho: Array | None, size: float) -> None:
    """Mark the tracked point before and after, and the target pair; sizes relative to that of a large panel."""
    tracked = problem.goal in TRACKING  # else the pair made is all there is to follow
    points = [
        (problem.nominal_pair, "*", 7, {"color": BLACK}, "tracked point before" if tracked else "nominal pair"),
        (problem.target, "D", 8.5, {"color": GREEN, "markerfacecolor": "none"}, "target pair (parts made)"),
    ]
    if tracked and rho is not None:
        points.append((rho, "o", 13, {"color": VERMILLION, "markerfacecolor": "none"}, "tracked point after"))
    for place, marker, extent, look, label in points:
        axes.plot(*place, marker=marker, markersize=extent * size, markeredgewidth=1.3 * size, linestyle="none",
                  zorder=5, label=label, **look)  # fmt: skip


def marked(problem: Problem, solution: Solution | None) -> list[Array]:
    """Return the points that are marked: nominal pair, target, and the tracked point after the motion."""
    after = None if solution is None else solution.rho
    return [problem.nominal_pair, problem.target, *([] if after is None else [after])]


def tolerance_box(problem: Problem) -> Array:
    """Corners (2, 2) of the tolerance box around the nominal pair, lower then upper; without tolerances the pair."""
    minus, plus = np.zeros((2, 2)) if problem.tolerance is None else np.transpose(problem.tolerance)
    return np.array([problem.nominal_pair * (1.0 - minus), problem.nominal_pair * (1.0 + plus)])


def window(problem: Problem, solution: Solution | None, more: Sequence[Array] = ()) -> Array:
    """Limits (2, 2) of an enlarged picture: tolerance box, marked points and `more`, with a margin; never empty."""
    points = [*marked(problem, solution), *tolerance_box(problem), *more]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    extent = np.maximum(high - low, LEAST_EXTENT * high)
    margin = MARGIN * np.maximum(extent, extent.max() / 2)
    return np.column_stack([np.maximum(low - margin, low / 2.0), high + margin])


def reaching(curve: DecisionCurve, window: ArrayLike) -> DecisionCurve:
    """Return the curve listed over its box and a window, which may reach beyond it."""
    box, seen = np.asarray(curve.box), np.asarray(window, dtype=float)
    low, high = np.minimum(box[:, 0], seen[:, 0]), np.maximum(box[:, 1], seen[:, 1])
    if (low == box[:, 0]).all() and (high == box[:, 1]).all():
        return curve
    (a, b), (c, d) = np.column_stack([low, high]).tolist()
    return replace(curve, box=((a, b), (c, d)))


def pieces(curve: DecisionCurve) -> Array:
    """Return the ends of a curve's segments, (n, 2, 2)."""
    return np.array([[segment.start, segment.end] for segment in curve.segments]).reshape(-1, 2, 2)


def path(ends: Array) -> Array:
    """Return straight pieces (n, 2, 2) as one path (m, 2) that a picture draws: nan parts what does not go on."""
    joins = np.abs(ends[1:, 0] - ends[:-1, 1]).max(axis=1, initial=0.0) == 0.0
    corners = []
    for (start, end), goes_on in zip(ends, [False, *joins], strict=True):
        corners += [end] if goes_on else [(np.nan, np.nan), start, end]
    return np.array(corners[1:], dtype=float).reshape(-1, 2)


CURVES = 5  # curves drawn on either side of the one at rest
FINE = 40  # steps on either side in which the swept area and the tracked point's track are drawn
POWERS = -10, 50
"""Of 2, from and to which multiples of a range's natural step are tried for where the tracked point leaves the box."""

DOUBLE = 2.6  # points across a double line
SCALES = "\u03c1\u2081", "\u03c1\u2082"  # names of both scales: rho with an index
OPEN, FARTHEST_END = 2.0, 20.0
"""Times as far as to its nearer end a range of sizes by name is drawn, or as the motion asked about where this end is
more than so many times as far."""

INSIDE = 1.0 - 2.0**-20  # share of a range that is drawn: just at its end the tracked lines may be parallel


@styled
def family_figure(coherent: CoherentRange, *, title: str = "") -> Figure:
    """Draw the decision curves over a coherent range, and the tracked scale pair against the motion.

    Left: the family, from the lower end (blue) over rest (black) to the upper end (vermillion); what the tracked
    features' segments sweep is shaded, and its two border curves are double lines. Right: the tracked pair's scales.
    Where the range leads out of the box of scales, it is drawn as far as the tracked pair stays in it; of sizes by
    name no further than `OPEN` times as far as to the nearer end, or as the motion asked about where that is far.
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

    end, other = (abs(own) * INSIDE for own in (coherent.high, coherent.low)[:: 1 if sign > 0 else -1])
    if not _has_box(coherent.problem):
        nearer = min(end, other)
        end = min(end, OPEN * (nearer if 1.0 < nearer <= FARTHEST_END else 1.0))
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

    low, high = ends
    spots = np.array([coherent.rho(x) for x in (low, 0.0, high)])
    extent = max(float(np.ptp(spots, axis=0).max()), LEAST_EXTENT / CURVES) * np.array([-0.5, 0.5])
    seen = whole_box(coherent.problem, (spots.min(axis=0) + spots.max(axis=0))[:, None] / 2.0 + extent)
    plane(axes, seen)
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
            goes_on = "leaves the box" if _has_box(coherent.problem) else "goes on"
            at = "end" if _is_end(coherent, end) else goes_on
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
