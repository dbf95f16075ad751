"""The compensation map: how much motion each pair of sizes needs, and what holds it where."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.geometry.units import measured
from fcdm_opt.problem.problem import SIGNS
from fcdm_opt.show import BLACK, GREY, NOTE, PAGE, VERMILLION, styled
from fcdm_opt.show.lettering import Sheet
from fcdm_opt.show.plots import plane

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fcdm_opt.design.compensation.compensation_map import CompensationMap

FINE = 240
"""Points a side at which the map is drawn."""

LEVELS = 12
"""Contours of the amount."""

LISTED = 12
"""Regions that are listed."""

SHARE = 0.004
"""Of the box: regions that are smaller get no number in the picture."""


@styled
def map_figure(sizes: CompensationMap, *, title: str = "", caption: str = "") -> Figure:
    """Draw the amount over the box of sizes with the boundaries of its regions; list what holds the motion in each.

    Boundaries at which the motion jumps are double lines; where there is no motion the plane is hatched. Star: nominal
    pair; A to D: the corners of the box that the requirements of these letters ask for.

    Parameters
    ----------
    sizes : CompensationMap
    title, caption : str
        Text above and below the picture.
    """
    sheet = Sheet.of(PAGE, 3.2, title=title, caption=caption)
    axes, bar = sheet.axes(0.5, 0.38, 2.75, 2.75), sheet.axes(3.33, 0.38, 0.09, 2.75)
    box = np.asarray(sizes.box)
    margin = 0.04 * np.ptp(box, axis=1)
    plane(axes, box + np.outer(margin, [-1.0, 1.0]))
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
        amount = "" if np.isnan(least) else f", amount {least:.4g} to {largest:.4g}"
        lines.append(f"{number}  {100 * region.share:.3g} % of the box{amount}")
        lines.append(f"     {region}")
    if len(sizes.regions) > LISTED:
        lines.append(f"and {len(sizes.regions) - LISTED} more")
    error = measured(f"{sizes.reached:.2g}", sizes.unit)
    lines += ["", f"error at most {error}; {sizes.solved} pairs solved and judged"]
    sheet.list(4.25, 3.13, PAGE - 4.25 - 0.1, lines)
    return sheet.figure


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
    for name, signs in SIGNS.items():
        corner = np.where(np.asarray(signs) > 0, box[:, 1], box[:, 0])
        axes.plot(*corner, marker="D", markersize=4.5, markerfacecolor="white", markeredgecolor=VERMILLION, zorder=6)
        shift = -9 * np.sign(corner - box.mean(axis=1))
        axes.annotate(name, tuple(corner), xytext=tuple(shift), textcoords="offset points", ha="center", va="center",
                      color=BLACK, zorder=6, bbox={"boxstyle": "square,pad=0.12", "facecolor": "white",
                                                   "edgecolor": "none", "alpha": 0.8})  # fmt: skip
    if ((box[:, 0] <= sizes.nominal) & (sizes.nominal <= box[:, 1])).all():
        axes.plot(*sizes.nominal, marker="*", markersize=9, markerfacecolor="white", markeredgecolor=BLACK, zorder=6)
