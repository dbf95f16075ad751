"""Growth of time, drawn: a panel for vertices, parts and parameters, with fitted exponents."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.show import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILLION, new_figure
from fcdm_opt_benchmarks.record import BenchRun

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AXES = ("vertices", "parts", "parameters")
TITLES = {
    "vertices": "a decision curve, by\nvertices of either hull",
    "parts": "a union's decision curve, by\nparts of either body",
    "parameters": "the smallest motion, by\nparameters of the motion",
}
OURS, OTHERS = (VERMILLION, BLACK, ORANGE), (BLUE, GREEN, PURPLE, GREY)
MARKS = "osD^vP"
MOST_TICKS = 8  # numbers that are written, else powers of ten
UNSURE = 0.3  # standard error of an exponent that says nothing


def growth_figure(run: BenchRun) -> Figure:
    """Draw the table "growth" of a run.

    Parameters
    ----------
    run : BenchRun
        Of command "bench".
    """
    from fcdm_opt_benchmarks.cost.growth import exponents

    rows = [row for row in run.tables["growth"] if row.get("seconds") is not None]
    fits = {(fit["axis"], fit["method"]): fit for fit in exponents(rows)}
    figure = new_figure(9.5, 5.4)
    panels = figure.subplots(1, len(AXES))
    for axes, name in zip(panels, AXES, strict=True):
        own = [row for row in rows if row["axis"] == name]
        ours, others = cycle(OURS), cycle(OTHERS)
        for k, method in enumerate(dict.fromkeys(row["method"] for row in own)):
            mine = sorted((row for row in own if row["method"] == method), key=lambda row: row["x"])
            colour = next(ours if mine[0]["family"] == "ours" else others)
            _line(axes, mine, colour, MARKS[k % len(MARKS)], _label(method, fits.get((name, method))))
        axes.set(xscale="log", yscale="log")
        axes.set_title(TITLES[name], fontsize=9)
        axes.set_xlabel(name, fontsize=8.5)
        axes.tick_params(labelsize=7.5)
        axes.grid(color=GREY, alpha=0.25, linewidth=0.6)
        axes.minorticks_off()
        numbers = sorted({row["x"] for row in own})
        if len(numbers) <= MOST_TICKS:
            axes.set_xticks(numbers, [f"{x:g}" for x in numbers])
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17), fontsize=7.5, frameon=False, handlelength=1.5)
    panels[0].set_ylabel("seconds an answer", fontsize=8.5)
    figure.suptitle("Growth of time", fontsize=11, y=0.985)
    told = "Medians, bars: quartiles; exponents where their standard error is below 0.3. Hollow: some answers failed."
    figure.text(0.5, 0.008, f"{told}\n{run.caption}", ha="center", va="bottom", fontsize=7, color=GREY)
    figure.subplots_adjust(left=0.07, right=0.99, top=0.85, bottom=0.4, wspace=0.2)
    return figure


def _label(method: str, fit: Any) -> str:
    if fit is None or fit["error"] > UNSURE:
        return f"{method}:  no exponent" if fit else method
    return f"{method}:  exponent {fit['exponent']:.2f} ± {fit['error']:.2f}"


def _line(axes: Any, rows: list[Any], colour: str, mark: str, label: str) -> None:
    """Draw one method: medians with quartiles, joined; hollow where answers failed."""
    x, y, low, high = (np.array([row[key] for row in rows]) for key in ("x", "seconds", "low", "high"))
    axes.errorbar(x, y, [y - low, high - y], color=colour, linewidth=1.1, elinewidth=0.8, capsize=1.5)
    axes.plot([], [], color=colour, marker=mark, markersize=4, linewidth=1.1, label=label)
    for row in rows:
        fill = "white" if row.get("failed") else colour
        axes.plot(row["x"], row["seconds"], marker=mark, markersize=4, color=colour, markerfacecolor=fill)
