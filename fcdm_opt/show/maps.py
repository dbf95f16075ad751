"""The compensation map: how much motion each pair of sizes needs, and what holds it where; and the yield of a fit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.geometry.units import measured
from fcdm_opt.problem.problem import SCALES, SIGNS
from fcdm_opt.show import BLACK, BLUE, DARK, GREY, NOTE, ORANGE, PAGE, VERMILLION, Figure, styled
from fcdm_opt.show.grids import units_over
from fcdm_opt.show.lettering import Sheet, literal
from fcdm_opt.show.plots import plane
from fcdm_opt.show.printing import wrapped
from fcdm_opt.show.texts import share_text
from fcdm_opt.show.verdict import labels_in_words

if TYPE_CHECKING:
    from fcdm_opt.design.compensation.assembly_yield import AssemblyYield
    from fcdm_opt.design.compensation.compensation_map import CompensationMap
    from fcdm_opt.problem.scene import Scene

FINE, LEVELS, LISTED, SHARE = 240, 12, 12, 0.004
"""Points a side at which a map is drawn, contours of the amount, regions that are listed, and the share of the box
below which one gets no number in the picture."""

HIGHEST, WIDEST, NAMED = 1.18, 1.25, 22
"""How far the axes go, relative to the highest bar and to a share of 1: room for the words there; and letters beside
bars."""

INDICES = (("by itself", BLUE, None), ("with the other body", VERMILLION, "////"))
"""Kinds of shares of the variance: name, colour and hatch."""


@styled
def map_figure(sizes: CompensationMap, problem: Scene | None = None, *, title: str = "", caption: str = "") -> Figure:
    """Draw the amount over the box of sizes with the boundaries of its regions; list what holds the motion in each.

    Boundaries at which the motion jumps are double lines; where there is no motion, or none is known, the plane is
    hatched. Star: nominal pair, or as drawn; A to D: the corners of the box that the requirements of these letters
    ask for.

    Parameters
    ----------
    sizes : CompensationMap
    problem : Problem or Assembly, optional
        What the map is of: then contacts are told by names of faces, not by labels.
    title, caption : str
        Text above and below the picture.
    """
    sheet = Sheet.of(PAGE, 3.2, title=title, caption=caption)
    axes, bar = sheet.axes(0.72, 0.38, 2.75, 2.75), sheet.axes(3.55, 0.38, 0.09, 2.75)
    box = np.asarray(sizes.box)
    margin = 0.04 * np.ptp(box, axis=1)
    plane(axes, box + np.outer(margin, [-1.0, 1.0]))
    if sizes.over != SCALES:
        named = zip(sizes.over, units_over(sizes), sizes.scaled, strict=True)
        told = [
            literal(f"{name} (1 as drawn)" if scale else f"{name} (off drawn{f', {unit}' if unit else ''})")
            for name, unit, scale in named
        ]
        axes.set(xlabel=told[0], ylabel=told[1])
    axes.grid(visible=False)
    _fill(sheet.figure, axes, bar, sizes)
    for boundary in sizes.boundaries:
        for colour, width in ((BLACK, 3.2), ("white", 1.6)) if boundary.jumps else ((BLACK, 1.0),):
            axes.plot(*boundary.points.T, color=colour, linewidth=width, zorder=3, solid_capstyle="butt")
    _mark(axes, sizes)
    lines = []
    for number, region in enumerate(sizes.regions[:LISTED], 1):
        if region.share >= SHARE:
            axes.text(
                *region.place, str(number), ha="center", va="center", fontsize=NOTE, zorder=5,
                bbox={"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": BLACK, "linewidth": 0.8},
            )  # fmt: skip
        least, largest = region.amounts
        amount = "" if np.isnan(least) else f", amount {least:.4g} to {measured(f'{largest:.4g}', sizes.unit)}"
        lines.append(f"{number}  {100 * region.share:.3g} % of the box{amount}")
        lines.append(f"     {region if problem is None else labels_in_words(str(region), problem)}")
    if len(sizes.regions) > LISTED:
        lines.append(f"and {len(sizes.regions) - LISTED} more")
    lines += ["", *_signs(sizes), f"{sizes.solved} pairs solved and judged", f"largest error: {sizes.error_text}"]
    sheet.list(4.42, 3.13, PAGE - 4.42 - 0.1, lines)
    return sheet.figure


def _signs(sizes: CompensationMap) -> list[str]:
    """Return what stands for what in the picture, of that which is there."""
    scales, box = sizes.over == SCALES, np.asarray(sizes.box)
    signs = {
        "thin white lines: equal amounts": any(np.isfinite(region.amounts[0]) for region in sizes.regions),
        f"star: {'nominal sizes' if scales else 'as drawn'}": _within(sizes.nominal, box),
        "diamonds A to D: corners that these requirements ask for": scales,
        "white line between black ones: the motion jumps there": any(boundary.jumps for boundary in sizes.boundaries),
        "black line: another contact, or limit, holds the motion": any(not own.jumps for own in sizes.boundaries),
        "hatched: no motion, or none known": any(np.isnan(region.amounts[0]) for region in sizes.regions),
    }
    return [told for told, there in signs.items() if there]


def _within(point: Any, box: Any) -> bool:
    return bool(((box[:, 0] <= point) & (point <= box[:, 1])).all())


def _fill(figure: Figure, axes: Any, bar: Any, sizes: CompensationMap) -> None:
    """Fill the box by amount, with contour lines."""
    from matplotlib.patches import Rectangle
    from matplotlib.ticker import MaxNLocator

    box = np.asarray(sizes.box)
    sides = [np.linspace(low, high, FINE) for low, high in box]
    grid = np.meshgrid(*sides)
    amount = np.ma.masked_invalid(sizes.at(*grid).amount)
    low, high = box[:, 0], box[:, 1]
    axes.add_patch(Rectangle(tuple(low), *(high - low), facecolor="white", edgecolor=GREY, hatch="//", zorder=0.5))
    if amount.count() == 0:
        bar.set_visible(False)
        return
    top = max(float(amount.max()), np.finfo(float).tiny)
    filled = axes.contourf(*grid, amount, levels=np.linspace(0.0, top, 4 * LEVELS + 1), cmap="cividis", zorder=1)
    axes.contour(*grid, amount, levels=np.linspace(0.0, top, LEVELS + 1)[1:-1], colors="white", linewidths=0.5,
                 alpha=0.7, zorder=2)  # fmt: skip
    figure.colorbar(filled, cax=bar, format="%.3g", ticks=MaxNLocator(6))
    bar.set_ylabel(f"amount of the smallest motion ({sizes.unit or 'length units'})")


def _mark(axes: Any, sizes: CompensationMap) -> None:
    """Mark the nominal pair and the corners that the requirements ask for."""
    box = np.asarray(sizes.box)
    for name, signs in SIGNS.items() if sizes.over == SCALES else ():
        corner = np.where(np.asarray(signs) > 0, box[:, 1], box[:, 0])
        axes.plot(*corner, marker="D", markersize=4.5, markerfacecolor="white", markeredgecolor=VERMILLION, zorder=6)
        shift = -9 * np.sign(corner - box.mean(axis=1))
        axes.annotate(name, tuple(corner), xytext=tuple(shift), textcoords="offset points", ha="center", va="center",
                      color=BLACK, zorder=6, bbox={"boxstyle": "square,pad=0.12", "facecolor": "white",
                                                   "edgecolor": "none", "alpha": 0.8})  # fmt: skip
    if _within(sizes.nominal, box):
        axes.plot(*sizes.nominal, marker="*", markersize=9, markerfacecolor="white", markeredgecolor=BLACK, zorder=6)


@styled
def yield_figure(result: AssemblyYield, *, title: str = "", caption: str = "") -> Figure:
    """Draw how the amounts of all pairs are spread about the budget, and what either body's tolerance contributes.

    Parameters
    ----------
    result : AssemblyYield
    title, caption : str
        Text above and below the picture; the default caption tells the share and what fails otherwise.
    """
    sheet = Sheet.of(PAGE, 2.95, title=title, caption=caption or str(result))
    amounts = sheet.axes(0.55, 0.65, 3.0, 2.2)
    _draw_amounts(amounts, result)
    _draw_indices(sheet.axes(4.75, 1.85, 1.8, 0.72), result)
    _draw_shares(sheet.axes(4.75, 0.4, 1.8, 0.85), result)
    handles, labels = amounts.get_legend_handles_labels()
    if handles:
        x, y, *_ = sheet.place(2.05, 0.0, 0.0, 0.0)
        sheet.figure.legend(handles, labels, loc="lower center", bbox_to_anchor=(x, y), ncols=3, borderaxespad=0.2,
                            handlelength=1.6, columnspacing=1.2)  # fmt: skip
    return sheet.figure


def _draw_amounts(axes: Any, result: AssemblyYield) -> None:
    """Draw the histogram of the amount, with the budget and quantiles."""
    edges, heights = result.amounts, result.counts / result.count
    within = (edges[:-1] + edges[1:]) / 2.0 <= result.budget
    below = "within the budget" if math.isfinite(result.budget) else "pairs with a motion"
    for chosen, colour, name in ((within, BLUE, below), (~within, VERMILLION, "beyond the budget")):
        if (heights[chosen] > 0.0).any():
            wide = np.diff(edges)[chosen]
            axes.bar(edges[:-1][chosen], heights[chosen], wide, align="edge", color=colour, label=name)
    highest = max(float(heights.max()), 1.0 / result.count)
    axes.set_ylim(0.0, HIGHEST * highest)
    if math.isfinite(result.budget):
        budget = measured(f"{result.budget:.6g}", result.unit)
        axes.axvline(result.budget, color=BLACK, linewidth=1.2, label=f"budget {budget}")
    for share, amount in result.quantiles.items():
        if math.isfinite(amount):
            axes.axvline(amount, color=GREY, linewidth=0.6, linestyle=":")
            axes.annotate(f"{share:.4g}".lstrip("0"), (amount, HIGHEST * highest), xytext=(-1.5, -2),
                          textcoords="offset points", ha="right", va="top", rotation=90, fontsize=NOTE,
                          color=DARK)  # fmt: skip
    axes.set_xlabel(f"amount of the motion ({result.unit or 'length units'})")
    axes.set_ylabel("share of all pairs in a bin")
    if not heights.any():
        axes.text(0.5, 0.5, "no pair has a motion", transform=axes.transAxes, ha="center", color=DARK)


def _draw_indices(axes: Any, result: AssemblyYield) -> None:
    """Draw first-order and total indices of both bodies."""
    from matplotlib.patches import Patch

    for row, share in enumerate(result.contributions):
        bars = (share.first_order, share.first_order_error), (share.total, share.total_error)
        for offset, (value, error), (_, colour, hatch) in zip((-0.2, 0.2), bars, INDICES, strict=True):
            known = math.isfinite(value)
            if known:
                axes.barh(row + offset, value, 0.38, xerr=error, color=colour, hatch=hatch, edgecolor="white",
                          linewidth=0.0, error_kw={"linewidth": 0.8})  # fmt: skip
            _number(axes, row + offset, value + error if known else 0.0, f"{value:.3f}" if known else "none")
    axes.set_title("share of the amount's variance", loc="left", pad=14)
    keys = [Patch(facecolor=colour, hatch=hatch, edgecolor="white", label=name) for name, colour, hatch in INDICES]
    axes.legend(handles=keys, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.0, borderpad=0.2,
                handlelength=1.6, columnspacing=1.0)  # fmt: skip
    _rows(axes, [share.body for share in result.contributions])


def _draw_shares(axes: Any, result: AssemblyYield) -> None:
    """Draw the yield as it is, and with one body's size held at its median."""
    shares = [result.share, *(body.share_without for body in result.contributions)]
    low, high = result.interval
    for row, (share, end) in enumerate(zip(shares, (high, *shares[1:]), strict=True)):
        axes.barh(row, share, 0.6, color=GREY if row else BLACK)
        _number(axes, row, np.nan_to_num(end), share_text(share))
    axes.plot([low, high], [0, 0], color=ORANGE, linewidth=2.5, solid_capstyle="butt")
    axes.set_title("pairs that pass", loc="left")
    _rows(axes, ["as it is", *(f"{body.body} at its median" for body in result.contributions)])


def _number(axes: Any, row: float, end: float, text: str) -> None:
    """Write a number behind its bar."""
    axes.text(max(end, 0.0) + 0.02, row, text, va="center", fontsize=NOTE)


def _rows(axes: Any, names: list[str]) -> None:
    """Name the bars, from the top."""
    axes.set_yticks(range(len(names)), [literal(wrapped(name, NAMED)) for name in names])
    axes.set(ylim=(len(names) - 0.5, -0.5), xlim=(0.0, WIDEST), xticks=[0.0, 0.25, 0.5, 0.75, 1.0])
    axes.spines[["top", "right"]].set_visible(False)
