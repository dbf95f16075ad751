"""Decision curves in the plane of scales, before and after a motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.show import BLACK, BLUE, DARK, GREEN, GREY, PAGE, PURPLE, TEXT, VERMILLION, styled
from fcdm_opt.show.lettering import Names, Sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.problem.solution import Solution

ALONG = (0.4, 0.6, 0.25, 0.75, 0.5)
"""Where along a segment its name stands, the best place first."""

MARGIN, LEAST_EXTENT = 0.3, 0.05
"""Room around what the enlarged panel must show, as a share of its extent; the extent is at least this share of rho."""


@styled
def decision_curve_figure(curve: DecisionCurve, *, title: str = "", caption: str = "") -> Figure:
    """Draw a decision curve in its box, with its segments' features and its switching points listed beside it.

    Parameters
    ----------
    curve : DecisionCurve
    title, caption : str
        Text above and below the picture.
    """
    sheet = Sheet.of(PAGE, 3.7, title=title, caption=caption)
    axes = sheet.axes(0.5, 0.38, 3.3, 3.25)
    plane(axes, curve.box)
    draw_curve(axes, curve, BLUE, "-", "decision curve")
    names = Names(axes, pieces(curve))
    name_curve(names, axes, curve, BLUE, sides=(1.0, -1.0))
    name_sides(names, axes, curve)
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
def before_after_figure(problem: Problem, solution: Solution, *, title: str = "", caption: str = "") -> Figure:
    """Draw the decision curve before and after the motion: the whole box, and the tolerance box enlarged.

    Star: tracked point before; diamond: target pair (the parts made); circle: tracked point after; as in Figs. 6 and
    7 of the paper.

    Parameters
    ----------
    problem : Problem
    solution : Solution
        May be one without a motion; then only the curve before is drawn.
    title, caption : str
        Text above and below the picture.
    """
    from fcdm_opt.curve.decision_curve import decision_curve

    before, after = problem.curve, None
    if solution.transform is not None:
        after = decision_curve(problem.movable, problem.static, box=problem.box, transform=solution.transform)
    sheet = Sheet.of(PAGE, 3.6, title=title, caption=caption)
    whole, zoom = (sheet.axes(left, 0.75, 2.62, 2.62) for left in (0.48, 3.88))
    limits = window(problem, solution)
    plane(whole, problem.box)
    plane(zoom, limits)
    outward = -1.0 if solution.rho is not None and before.gap(solution.rho) > 0 else 1.0  # names keep clear of `after`
    for axes, size, seen in ((whole, 0.6, problem.box), (zoom, 0.85, limits)):
        draw_tolerance(axes, problem)
        own = reaching(before, seen)
        draw_curve(axes, own, BLUE, "-", "decision curve before")
        lines = [pieces(own)]
        if after is not None:
            moved = reaching(after, seen)
            draw_curve(axes, moved, VERMILLION, (0, (5, 1.5)), "after the motion")
            lines.append(pieces(moved))
        draw_points(axes, problem, solution, size)
        names = Names(axes, np.concatenate(lines))
        for point in marked(problem, solution):
            names.keep(point, 14.0 * size)
        name_curve(names, axes, before, BLUE, sides=(-outward, -outward))
        if after is not None and axes is zoom:
            name_curve(names, axes, after, VERMILLION, sides=(outward, outward), mark="'")
    (low_1, high_1), (low_2, high_2) = limits
    whole.plot([low_1, high_1, high_1, low_1, low_1], [low_2, low_2, high_2, high_2, low_2], color=GREY, linewidth=0.8)
    whole.set_title("whole box")
    zoom.set_title("enlarged: the frame on the left")
    sheet.legend(*zoom.get_legend_handles_labels(), bottom=0.0)
    return sheet.figure


# --------------------------------------------------------------------------------------------------- parts of a picture


def plane(axes: Any, box: ArrayLike) -> None:
    """Set axes up as the plane of scales over a box."""
    (low_1, high_1), (low_2, high_2) = np.asarray(box, dtype=float)
    axes.set(xlim=(low_1, high_1), ylim=(low_2, high_2))
    axes.set_xlabel(r"$\rho_1$  (scale of body 1, movable; 1 = as drawn)")
    axes.set_ylabel(r"$\rho_2$  (scale of body 2, static; 1 = as drawn)")
    axes.locator_params(nbins=6)
    axes.grid(visible=True)


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


def draw_curve(axes: Any, curve: DecisionCurve, colour: str, style: Any, label: str) -> None:
    """Draw a curve with its switching points; what fits snugly stands out."""
    snug = [segment for segment in curve.segments if segment.snug]
    for k, segment in enumerate(snug):
        axes.plot(
            *np.column_stack([segment.start, segment.end]),
            color=PURPLE,
            linewidth=4.0,
            alpha=0.5,
            zorder=2.5,
            label="snug fit" if k == 0 else None,
        )
    for k, segment in enumerate(curve.segments):
        axes.plot(
            *np.column_stack([segment.start, segment.end]),
            color=colour,
            linestyle=style,
            linewidth=1.3,
            label=label if k == 0 else None,
            zorder=3,
        )
    if curve.switching_points:
        axes.plot(
            *np.array([point.rho for point in curve.switching_points]).T,
            linestyle="none",
            marker="o",
            markersize=3.0,
            color=colour,
            zorder=3.5,
        )


def name_curve(
    names: Names, axes: Any, curve: DecisionCurve, colour: str, *, sides: tuple[float, float], mark: str = ""
) -> None:
    """Write SW1, SW2, ... and S1, S2, ... beside the curve, each kind on its side: 1 upper right, -1 lower left."""
    limits = np.array([axes.get_xlim(), axes.get_ylim()])
    per_unit = axes.bbox.size / np.ptp(limits, axis=1)
    for point in curve.switching_points:
        names.put(f"SW{point.index}{mark}", point.rho, sides[1] * np.ones(2), colour=colour)
    for segment in curve.segments:
        inside = clipped(segment.start, segment.end, limits)
        if inside is not None:
            spots = inside[0] + np.outer(ALONG, inside[1] - inside[0])
            across = segment.line[:2] / per_unit
            side = sides[0] if across.sum() >= 0 else -sides[0]
            names.put(f"S{segment.index}{mark}", spots, side * across, colour=colour)


def name_sides(names: Names, axes: Any, curve: DecisionCurve) -> None:
    """Write in two corners of the box whether the bodies are apart or overlap there."""
    for corner, inwards in ((0, 1.0), (1, -1.0)):
        rho = np.asarray(curve.box)[:, corner]
        gap = curve.gap(rho)
        word = "apart" if gap > 0 else "overlapping" if gap < 0 else "touching"
        names.put(word, rho, (inwards, inwards), colour=DARK, size=TEXT, lead=False)


def draw_tolerance(axes: Any, problem: Problem) -> None:
    """Shadow of the tolerances around the nominal pair, and the quadrant that goal "beyond" asks for."""
    from matplotlib.patches import Rectangle

    if problem.tolerance is not None:
        low, high = tolerance_box(problem)
        axes.add_patch(
            Rectangle(
                tuple(low), *(high - low), facecolor=GREY, alpha=0.3, edgecolor="none", zorder=1, label="tolerance"
            )
        )
    if problem.goal == "beyond":
        far = np.where(
            problem.signs > 0, [axes.get_xlim()[1], axes.get_ylim()[1]], [axes.get_xlim()[0], axes.get_ylim()[0]]
        )
        corner = problem.target
        axes.add_patch(
            Rectangle(
                tuple(corner),
                *(far - corner),
                facecolor=GREEN,
                alpha=0.1,
                edgecolor="none",
                zorder=0,
                label=f"required{f' by {problem.requirement}' if problem.requirement else ''}",
            )
        )


def draw_points(axes: Any, problem: Problem, solution: Solution, size: float) -> None:
    """Mark the tracked point before and after, and the target pair; sizes relative to that of a large panel."""
    common = {"linestyle": "none", "zorder": 5, "markeredgewidth": 1.3 * size}
    hollow = {**common, "markerfacecolor": "none"}
    tracked = problem.goal in TRACKING  # else the pair made is all there is to follow
    axes.plot(
        *problem.nominal_pair,
        marker="*",
        markersize=7 * size,
        color=BLACK,
        label="tracked point before" if tracked else "nominal pair",
        **common,
    )
    axes.plot(
        *problem.target,
        marker="D",
        markersize=8.5 * size,
        markeredgecolor=GREEN,
        label="target pair (parts made)",
        **hollow,
    )
    if tracked and solution.rho is not None:
        axes.plot(
            *solution.rho,
            marker="o",
            markersize=13 * size,
            markeredgecolor=VERMILLION,
            label="tracked point after",
            **hollow,
        )


def marked(problem: Problem, solution: Solution) -> list[Array]:
    """Return the points that are marked: nominal pair, target, and the tracked point after the motion."""
    return [problem.nominal_pair, problem.target, *([] if solution.rho is None else [solution.rho])]


# -------------------------------------------------------------------------------------------------------------- windows


def tolerance_box(problem: Problem) -> Array:
    """Corners (2, 2) of the tolerance box around the nominal pair, lower then upper; without tolerances the pair."""
    minus, plus = np.zeros((2, 2)) if problem.tolerance is None else np.transpose(problem.tolerance)
    return np.array([problem.nominal_pair * (1.0 - minus), problem.nominal_pair * (1.0 + plus)])


def window(problem: Problem, solution: Solution, more: Sequence[Array] = ()) -> Array:
    """Limits (2, 2) of the enlarged panel: tolerance box, marked points and `more`, with a margin; never empty."""
    points = [*marked(problem, solution), *tolerance_box(problem), *more]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    extent = np.maximum(high - low, LEAST_EXTENT * high)
    margin = MARGIN * np.maximum(extent, extent.max() / 2)
    return np.column_stack([np.maximum(low - margin, 0.0), high + margin])


def clipped(start: ArrayLike, end: ArrayLike, window: ArrayLike) -> Array | None:
    """Return the end points (2, 2) of the part of a straight piece inside a window, None if it passes outside."""
    p, q = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    enter, leave = 0.0, 1.0
    for k, (low, high) in enumerate(np.asarray(window, dtype=float)):
        step = q[k] - p[k]
        if step == 0.0:
            if not low <= p[k] <= high:
                return None
            continue
        first, last = sorted(((low - p[k]) / step, (high - p[k]) / step))
        enter, leave = max(enter, first), min(leave, last)
    return None if enter >= leave else np.array([p + enter * (q - p), p + leave * (q - p)])
