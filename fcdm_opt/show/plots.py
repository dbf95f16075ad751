"""Decision curves in the plane of scales, before and after a motion."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.show import BLACK, BLUE, GREEN, GREY, PURPLE, VERMILLION, new_figure
from fcdm_opt.tolerance.problem import TRACKING, Problem

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.tolerance.solution import Solution

LISTED = 24
"""Longest list of features that is written beside a curve."""

LABEL_DISTANCE, LABEL_PLACE = 9.0, 0.4
"""Points between a curve and the names on it, and where along a segment its name stands."""

CHARACTER = (5.2, 10.0)
"""Width and height of a character in a name, in points."""


MARGIN, LEAST_EXTENT = 0.3, 0.05
"""Room around what the enlarged panel must show, as a share of its extent; the extent is at least this share of rho."""


def decision_curve_figure(curve: DecisionCurve, *, title: str = "", caption: str = "") -> Figure:
    """Draw a decision curve in its box, with its segments' features and its switching points listed beside it.

    Parameters
    ----------
    curve : DecisionCurve
    title, caption : str
        Text above and below the picture.
    """
    figure = new_figure(9.0, 5.6)
    axes = figure.add_axes((0.08, 0.15, 0.52, 0.75))
    plane(axes, curve.box)
    _draw_curve(axes, curve, BLUE, "-", "decision curve")
    _name_pieces(axes, curve, BLUE, sides=(1.0, -1.0))
    for corner, align in ((0, ("left", "bottom")), (1, ("right", "top"))):
        rho = np.asarray(curve.box)[:, corner]
        shift = 6 - 12 * corner
        axes.annotate(
            "apart" if curve.gap(rho) > 0 else "overlapping",
            tuple(rho),
            xytext=(shift, shift),
            textcoords="offset points",
            ha=align[0],
            va=align[1],
            fontsize=9,
            style="italic",
            color=GREY,
        )
    lines = [f"S{segment.index}  {segment.feature.label}" for segment in curve.segments]
    for point in curve.switching_points:
        lines.append(f"SW{point.index}  ({point.rho[0]:.6f}, {point.rho[1]:.6f})")
        lines += [f"        {feature.label}" for feature in point.contact_features]
    if len(lines) > LISTED:
        lines = [*lines[:LISTED], f"and {len(lines) - LISTED} more"]
    if not curve.segments:
        lines = [f"no contact in the box: {curve.status}"]
    figure.text(0.63, 0.9, "\n".join(lines), va="top", fontsize=7.5, linespacing=1.6)
    _words(figure, title, caption)
    return figure


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
    figure = new_figure(11.0, 6.4)
    whole, zoom = (figure.add_axes((left, 0.24, 0.41, 0.65)) for left in (0.065, 0.56))
    window = _window(problem, solution)
    plane(whole, problem.box)
    plane(zoom, window)
    outward = -1.0 if solution.rho is not None and before.gap(solution.rho) > 0 else 1.0  # names keep clear of `after`
    for axes, size, seen in ((whole, 0.7, problem.box), (zoom, 1.0, window)):
        _draw_tolerance(axes, problem)
        _draw_curve(axes, _reaching(before, seen), BLUE, "-", "decision curve before")
        if after is not None:
            _draw_curve(axes, _reaching(after, seen), VERMILLION, (0, (5, 1.5)), "after the motion")
        _draw_points(axes, problem, solution, size)
        _name_pieces(axes, before, BLUE, sides=(-outward, -outward))
    if after is not None:
        _name_pieces(zoom, after, VERMILLION, sides=(outward, outward), mark="'")
    (low_1, high_1), (low_2, high_2) = window
    whole.plot([low_1, high_1, high_1, low_1, low_1], [low_2, low_2, high_2, high_2, low_2], color=GREY, linewidth=0.8)
    whole.set_title("whole box", fontsize=9)
    zoom.set_title("enlarged: the frame on the left", fontsize=9)
    handles, labels = zoom.get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", bbox_to_anchor=(0.5, 0.065), ncols=4, frameon=False, fontsize=9)
    _words(figure, title, caption)
    return figure


# --------------------------------------------------------------------------------------------------- parts of a picture


def plane(axes: Any, box: ArrayLike) -> None:
    """Set axes up as the plane of scales over a box."""
    (low_1, high_1), (low_2, high_2) = np.asarray(box, dtype=float)
    axes.set(xlim=(low_1, high_1), ylim=(low_2, high_2))
    axes.set_xlabel(r"$\rho_1$  (scale of body 1, movable)", fontsize=9)
    axes.set_ylabel(r"$\rho_2$  (scale of body 2, static)", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.ticklabel_format(useOffset=False)
    axes.grid(color=GREY, alpha=0.2, linewidth=0.6)
    axes.set_axisbelow(True)


def _reaching(curve: DecisionCurve, window: ArrayLike) -> DecisionCurve:
    """Return the curve listed over its box and a window, which may reach beyond it."""
    box, seen = np.asarray(curve.box), np.asarray(window, dtype=float)
    low, high = np.minimum(box[:, 0], seen[:, 0]), np.maximum(box[:, 1], seen[:, 1])
    if (low == box[:, 0]).all() and (high == box[:, 1]).all():
        return curve
    (a, b), (c, d) = np.column_stack([low, high]).tolist()
    return replace(curve, box=((a, b), (c, d)))


def _draw_curve(axes: Any, curve: DecisionCurve, colour: str, style: Any, label: str) -> None:
    snug = [segment for segment in curve.segments if segment.snug]
    for k, segment in enumerate(snug):
        axes.plot(
            *np.column_stack([segment.start, segment.end]),
            color=PURPLE,
            linewidth=5.0,
            alpha=0.5,
            zorder=2.5,
            label="snug fit" if k == 0 else None,
        )
    for k, segment in enumerate(curve.segments):
        axes.plot(
            *np.column_stack([segment.start, segment.end]),
            color=colour,
            linestyle=style,
            linewidth=1.6,
            label=label if k == 0 else None,
            zorder=3,
        )
    if curve.switching_points:
        axes.plot(
            *np.array([point.rho for point in curve.switching_points]).T,
            linestyle="none",
            marker="o",
            markersize=3.5,
            color=colour,
            zorder=3.5,
        )


def _name_pieces(axes: Any, curve: DecisionCurve, colour: str, *, sides: tuple[float, float], mark: str = "") -> None:
    """Write S1, S2, ... and SW1, SW2, ... beside the curve, each kind on its side: 1 upper right, -1 lower left."""
    window = np.array([axes.get_xlim(), axes.get_ylim()])
    page = axes.bbox.size * 72.0 / axes.figure.dpi
    points_per_unit = page / np.ptp(window, axis=1)

    def name(text: str, rho: Array, normal: Array, shift: float) -> None:
        across = normal / points_per_unit
        across = np.array([1.5, 1.0]) * across / np.linalg.norm(across) * (1.0 if across.sum() >= 0 else -1.0)
        place = (rho - window[:, 0]) * points_per_unit
        tries = [place + sign * shift * across for sign in (1.0, -1.0)]
        half = np.array(CHARACTER) * [len(text), 1] / 2
        kept = [spot for spot in tries if np.all((spot > half) & (spot < page - half))]
        axes.annotate(
            text,
            rho,
            xytext=tuple((kept or tries)[0] - place),
            textcoords="offset points",
            color=colour,
            fontsize=8,
            ha="center",
            va="center",
            zorder=6,
            bbox={"boxstyle": "square,pad=0.05", "facecolor": "white", "edgecolor": "none", "alpha": 0.7},
        )

    for segment in curve.segments:
        inside = clipped(segment.start, segment.end, window)
        if inside is not None:
            spot = inside[0] + LABEL_PLACE * (inside[1] - inside[0])
            name(f"S{segment.index}{mark}", spot, segment.line[:2], sides[0] * LABEL_DISTANCE)
    for point in curve.switching_points:
        if np.all((window[:, 0] <= point.rho) & (point.rho <= window[:, 1])):
            name(f"SW{point.index}{mark}", point.rho, points_per_unit, 1.5 * sides[1] * LABEL_DISTANCE)


def _draw_tolerance(axes: Any, problem: Problem) -> None:
    """Shadow of the tolerances around the nominal pair, and the quadrant that goal "beyond" asks for."""
    from matplotlib.patches import Rectangle

    if problem.tolerance is not None:
        low, high = _tolerance_box(problem)
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


def _draw_points(axes: Any, problem: Problem, solution: Solution, size: float) -> None:
    common = {"linestyle": "none", "zorder": 5, "markeredgewidth": 1.6 * size}
    hollow = {**common, "markerfacecolor": "none"}
    tracked = problem.goal in TRACKING  # else the pair made is all there is to follow
    axes.plot(
        *problem.nominal_pair,
        marker="*",
        markersize=9 * size,
        color=BLACK,
        label="tracked point before" if tracked else "nominal pair",
        **common,
    )
    axes.plot(
        *problem.target,
        marker="D",
        markersize=7 * size,
        markeredgecolor=GREEN,
        label="target pair (parts made)",
        **hollow,
    )
    if tracked and solution.rho is not None:
        axes.plot(
            *solution.rho,
            marker="o",
            markersize=12 * size,
            markeredgecolor=VERMILLION,
            label="tracked point after",
            **hollow,
        )


def _words(figure: Figure, title: str, caption: str) -> None:
    figure.suptitle(title, fontsize=11, y=0.975)
    figure.text(0.5, 0.02, caption, ha="center", va="bottom", fontsize=8.5)


# -------------------------------------------------------------------------------------------------------------- windows


def _tolerance_box(problem: Problem) -> Array:
    """Corners (2, 2) of the tolerance box around the nominal pair, lower then upper; without tolerances the pair."""
    minus, plus = np.zeros((2, 2)) if problem.tolerance is None else np.transpose(problem.tolerance)
    return np.array([problem.nominal_pair * (1.0 - minus), problem.nominal_pair * (1.0 + plus)])


def _window(problem: Problem, solution: Solution) -> Array:
    """Limits (2, 2) of the enlarged panel: tolerance box and marked points, with a margin; never empty."""
    points = [problem.nominal_pair, problem.target, *_tolerance_box(problem)]
    if solution.rho is not None:
        points.append(solution.rho)
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
