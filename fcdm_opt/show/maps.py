"""The compensation map: how much motion each pair of sizes needs, and what holds it where."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.show import BLACK, GREY, VERMILLION, new_figure
from fcdm_opt.show.plots import plane

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fcdm_opt.design.compensation.compensation_map import CompensationMap

FINE = 240
"""Points a side at which the map is drawn."""

LEVELS = 12
"""Contours of the amount."""

LISTED, WIDTH = 12, 62
"""Regions that are listed, and characters of a line there."""

SHARE = 0.004
"""Of the box: regions that are smaller get no number in the picture."""


def map_figure(found: CompensationMap, *, title: str = "", caption: str = "") -> Figure:
    """Draw the amount over the box of sizes with the boundaries of its regions; list what holds the motion in each.

    Boundaries at which the motion jumps are double lines; where there is no motion the plane is hatched. Star: nominal
    pair; A to D: the corners of the box that the requirements of these letters ask for.

    Parameters
    ----------
    found : CompensationMap
    title, caption : str
        Text above and below the picture.
    """
    figure = new_figure(11.0, 6.0)
    axes = figure.add_axes((0.07, 0.14, 0.46, 0.74))
    bar = figure.add_axes((0.545, 0.14, 0.015, 0.74))
    box = np.asarray(found.box)
    margin = 0.04 * np.ptp(box, axis=1)
    plane(axes, box + np.outer(margin, [-1.0, 1.0]))
    axes.grid(visible=False)
    _fill(figure, axes, bar, found)
    for boundary in found.boundaries:
        line = boundary.points.T
        if boundary.jumps:
            axes.plot(*line, color=BLACK, linewidth=4.0, zorder=3, solid_capstyle="butt")
            axes.plot(*line, color="white", linewidth=2.0, zorder=3.1, solid_capstyle="butt")
        else:
            axes.plot(*line, color=BLACK, linewidth=1.3, zorder=3)
    _number(axes, found)
    _mark(axes, found)
    lines = []
    for number, region in enumerate(found.regions[:LISTED], 1):
        least, largest = region.amounts
        amount = "" if np.isnan(least) else f", amount {least:.4g} to {largest:.4g}"
        lines.append(f"{number}  {100 * region.share:.3g} % of the box{amount}")
        lines += textwrap.wrap(str(region), WIDTH, initial_indent="     ", subsequent_indent="     ")
    if len(found.regions) > LISTED:
        lines.append(f"and {len(found.regions) - LISTED} more")
    lines += ["", f"error at most {found.reached:.2g}; {found.solved} pairs solved and judged"]
    figure.text(0.66, 0.885, "\n".join(lines), va="top", fontsize=7.5, linespacing=1.5)
    figure.suptitle(title, fontsize=11, y=0.975)
    figure.text(0.5, 0.02, caption, ha="center", va="bottom", fontsize=8.5)
    return figure


def _fill(figure: Figure, axes: Any, bar: Any, found: CompensationMap) -> None:
    """Fill the box by amount, with contour lines."""
    from matplotlib.patches import Rectangle

    box = np.asarray(found.box)
    sides = [np.linspace(low, high, FINE) for low, high in box]
    grid = np.meshgrid(*sides)
    amount = np.ma.masked_invalid(found.at(*grid).amount)
    low, high = box[:, 0], box[:, 1]
    axes.add_patch(Rectangle(tuple(low), *(high - low), facecolor="white", edgecolor=GREY, hatch="//", zorder=0.5))
    if amount.count() == 0:
        bar.set_visible(False)
        return
    top = max(float(amount.max()), np.finfo(float).tiny)
    filled = axes.contourf(*grid, amount, levels=np.linspace(0.0, top, 4 * LEVELS + 1), cmap="cividis", zorder=1)
    axes.contour(*grid, amount, levels=np.linspace(0.0, top, LEVELS + 1)[1:-1], colors="white", linewidths=0.5,
                 alpha=0.7, zorder=2)  # fmt: skip
    figure.colorbar(filled, cax=bar, format="%.3g")
    bar.set_ylabel("amount of the smallest motion (length units)", fontsize=8)
    bar.tick_params(labelsize=7)


def _number(axes: Any, found: CompensationMap) -> None:
    for number, region in enumerate(found.regions[:LISTED], 1):
        if region.share >= SHARE:
            axes.text(
                *region.place, str(number), ha="center", va="center", fontsize=9, zorder=5,
                bbox={"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": BLACK, "linewidth": 0.8},
            )  # fmt: skip


def _mark(axes: Any, found: CompensationMap) -> None:
    """Mark the nominal pair and the corners that the requirements ask for."""
    box = np.asarray(found.box)
    corners: dict[str, Array] = {
        name: np.array([box[0, one], box[1, two]])
        for name, one, two in (("A", 1, 1), ("B", 1, 0), ("C", 0, 1), ("D", 0, 0))
    }
    for name, corner in corners.items():
        axes.plot(*corner, marker="D", markersize=6, markerfacecolor="white", markeredgecolor=VERMILLION, zorder=6)
        shift = 8 * np.sign(corner - box.mean(axis=1))
        axes.annotate(name, tuple(corner), xytext=tuple(shift), textcoords="offset points", ha="center", va="center",
                      fontsize=9, color=VERMILLION, zorder=6, annotation_clip=False)  # fmt: skip
    if ((box[:, 0] <= found.nominal) & (found.nominal <= box[:, 1])).all():
        axes.plot(*found.nominal, marker="*", markersize=12, markerfacecolor="white", markeredgecolor=BLACK, zorder=6)
