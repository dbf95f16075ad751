"""The yield of a fit: how large the motions are, and which body's tolerance it hangs on."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.show import BLACK, BLUE, GREY, ORANGE, VERMILLION, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fcdm_opt.design.compensation.assembly_yield import AssemblyYield

HIGHEST, WIDEST = 1.18, 1.25
"""How far the axes go, relative to the highest bar and to a share of 1: room for the words there."""


def yield_figure(found: AssemblyYield, *, title: str = "", caption: str = "") -> Figure:
    """Draw how the amounts of all pairs are spread about the budget, and what either body's tolerance contributes.

    Parameters
    ----------
    found : AssemblyYield
    title, caption : str
        Text above and below the picture; the default caption tells the share and what fails otherwise.
    """
    figure = new_figure(9.0, 4.6)
    _draw_amounts(figure.add_axes((0.075, 0.2, 0.46, 0.66)), found)
    _draw_indices(figure.add_axes((0.71, 0.565, 0.275, 0.26)), found)
    _draw_shares(figure.add_axes((0.71, 0.2, 0.275, 0.21)), found)
    figure.text(0.075, 0.93, title, fontsize=10)
    figure.text(0.075, 0.035, caption or str(found), fontsize=8.5)
    return figure


def _draw_amounts(axes: Any, found: AssemblyYield) -> None:
    """Draw the histogram of the amount, with the budget and quantiles."""
    edges, heights = found.amounts, found.counts / found.count
    within = (edges[:-1] + edges[1:]) / 2.0 <= found.budget
    below = "within the budget" if math.isfinite(found.budget) else "pairs with a motion"
    for chosen, colour, name in ((within, BLUE, below), (~within, VERMILLION, "beyond the budget")):
        if (heights[chosen] > 0.0).any():
            axes.bar(
                edges[:-1][chosen], heights[chosen], np.diff(edges)[chosen], align="edge", color=colour, label=name
            )
    highest = max(float(heights.max()), 1.0 / found.count)
    axes.set_ylim(0.0, HIGHEST * highest)
    if math.isfinite(found.budget):
        axes.axvline(found.budget, color=BLACK, linewidth=1.2, label=f"budget {found.budget:.6g}")
    for share, amount in found.quantiles.items():
        if math.isfinite(amount):
            axes.axvline(amount, color=GREY, linewidth=0.7, linestyle=":")
            axes.annotate(
                f"{share:.4g}".lstrip("0"),
                (amount, HIGHEST * highest),
                xytext=(-1.5, -2),
                textcoords="offset points",
                ha="right",
                va="top",
                rotation=90,
                fontsize=7,
                color=GREY,
            )
    axes.set_xlabel("amount of the motion (length units)", fontsize=9)
    axes.set_ylabel("share of all pairs in a bin", fontsize=9)
    axes.tick_params(labelsize=8)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8, loc="best")
    if not heights.any():
        axes.text(0.5, 0.5, "no pair has a motion", transform=axes.transAxes, ha="center", fontsize=9, color=GREY)


def _draw_indices(axes: Any, found: AssemblyYield) -> None:
    """Draw first-order and total indices of both bodies."""
    for row, own in enumerate(found.contributions):
        bars = ((own.first_order, own.first_order_error, BLUE), (own.total, own.total_error, ORANGE))
        for offset, (value, error, colour) in zip((-0.2, 0.2), bars, strict=True):
            if math.isfinite(value):
                axes.barh(row + offset, value, 0.38, xerr=error, color=colour, error_kw={"linewidth": 0.8})
                _number(axes, row + offset, value + error, f"{value:.3f}")
            else:
                _number(axes, row + offset, 0.0, "none")
    axes.set_title("share of the amount's variance", fontsize=9, loc="left", pad=15)
    for place, name, colour in ((0.0, "by itself", BLUE), (0.3, "with what both do together", ORANGE)):
        axes.text(place, 1.04, name, color=colour, fontsize=7.5, transform=axes.transAxes)
    _rows(axes, [own.body for own in found.contributions])


def _draw_shares(axes: Any, found: AssemblyYield) -> None:
    """Draw the yield as it is, and with one body's size held at its median."""
    shares = [found.share, *(own.share_without for own in found.contributions)]
    low, high = found.interval
    for row, (share, end) in enumerate(zip(shares, (high, *shares[1:]), strict=True)):
        axes.barh(row, share, 0.6, color=GREY if row else BLACK)
        _number(axes, row, end, f"{share:.2%}")
    axes.plot([low, high], [0, 0], color=ORANGE, linewidth=2.5, solid_capstyle="butt")
    axes.set_title("pairs that pass", fontsize=9, loc="left")
    _rows(axes, ["as it is", *(f"{own.body} at its median" for own in found.contributions)])


def _number(axes: Any, row: float, end: float, text: str) -> None:
    """Write a number behind its bar."""
    axes.text(max(end, 0.0) + 0.02, row, text, va="center", fontsize=7.5)


def _rows(axes: Any, names: list[str]) -> None:
    """Name the bars, from the top."""
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlim(0.0, WIDEST)
    axes.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0])
    axes.tick_params(labelsize=8)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
