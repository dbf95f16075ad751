"""Speed against accuracy, drawn: time an answer on one axis, its error against the exact reference on the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.show import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILLION, new_figure
from fcdm_opt.show.lettering import Names
from fcdm_opt_benchmarks.record import BenchRun, Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SKY = "#56B4E9"  # of the same palette
COLOURS = {
    "ours": VERMILLION,
    "coal": BLUE,
    "HiGHS": GREEN,
    "Clarabel": PURPLE,
    "CasADi": ORANGE,
    "scipy": GREY,
    "growth distance": BLACK,
    "the paper's": SKY,
}
MARKS = "osD^vPX*<>hdp8"
EXACT, FAILED = 1e-18, 1e2
"""Errors at which exact answers, and failed ones, are drawn."""
METHODS_SHOWN, OURS_SHOWN = 6, 1
"""Methods of a task in the overview, and those of ours among them."""
TITLES = {
    "contact": "one contact: the scale at which body 2 touches",
    "curve": "the whole decision curve",
    "motion": "the smallest motion (ours with its verification)",
}
GROUPS = {"contact": "vertices", "curve": "vertices", "motion": "parameters"}
"""The column that tells the panels of a task apart."""


def chart_figure(run: BenchRun, task: str) -> Figure:
    """Draw one task: a panel for each size, and who is who.

    Parameters
    ----------
    run : BenchRun
        Of command "bench".
    task : "contact", "curve" or "motion"
    """
    rows = [row for row in run.tables["chart"] if row["task"] == task]
    column = GROUPS[task]
    sizes = sorted({row[column] for row in rows})
    width = 2.4 + 2.6 * len(sizes)
    figure = new_figure(width, 6.0)
    panels = figure.subplots(1, len(sizes), sharey=True, squeeze=False)[0]
    every = _styles(run.tables["chart"])
    named = {row["method"] for row in rows}
    styles = {method: style for method, style in every.items() if method in named}
    for axes, size in zip(panels, sizes, strict=True):
        _panel(axes, [row for row in rows if row[column] == size], styles)
        axes.set_title(f"{size} {column if size != 1 else column.removesuffix('s')}", fontsize=9)
    panels[0].set_ylabel("relative error against the exact reference")
    panels[len(panels) // 2].set_xlabel("seconds an answer")
    _legend(figure, styles, columns=5)
    figure.suptitle(f"Speed against accuracy: {TITLES[task]}", fontsize=11, y=0.985)
    figure.text(0.5, 0.005, _caption(run), ha="center", va="bottom", fontsize=6.5, color=GREY)
    figure.subplots_adjust(left=0.75 / width, right=0.985, top=0.9, bottom=0.3, wspace=0.06)
    return figure


def overview_figure(run: BenchRun) -> Figure:
    """Draw all three tasks side by side, each over all its scenes: ours in colour, the rivals nearest to it grey.

    Medians of the medians; a method's name stands beside it. `chart_figure` has all methods of a task.
    """
    figure = new_figure(9.0, 3.4)
    panels = figure.subplots(1, len(TITLES), sharey=True)
    figure.subplots_adjust(left=0.085, right=0.99, top=0.9, bottom=0.2, wspace=0.06)
    for axes, (task, title) in zip(panels, TITLES.items(), strict=True):
        rows = [row for row in run.tables["chart"] if row["task"] == task]
        chosen = _nearest(rows)
        styles = {
            name: (COLOURS["ours"] if ours else GREY, "o" if ours else MARKS[k], "-" if ours else "--")
            for k, (name, ours) in enumerate(chosen.items())
        }
        _panel(axes, rows, styles)
        axes.set_title(title, fontsize=8.5)
        names = Names(axes)
        for name, (colour, *_) in styles.items():
            spots = [spot for setting in _settings(rows, name) if (spot := _spot(_of(rows, name, setting)))]
            places = [(spot[1], spot[3] if np.isfinite(spot[3]) else FAILED) for spot in spots]
            names.put(f"ours: {name}" if chosen[name] else name, places, (0.3, 1.0), colour=colour)
    panels[0].set_ylabel("relative error")
    panels[1].set_xlabel("seconds an answer: left and below is better")
    figure.text(0.5, 0.01, run.caption, ha="center", va="bottom", fontsize=6.5, color=GREY)
    return figure


def _nearest(rows: Sequence[Row]) -> dict[str, bool]:
    """Return at most six methods, and whether each is ours: ours first, then the soonest of each rival family."""
    soonest: dict[tuple[str, str], float] = {}
    for row in rows:
        if row["outcome"] == "answered":
            soonest.setdefault((row["method"], row["family"]), float("inf"))
    for method, family in soonest:
        times = [row["seconds"] for row in rows if row["method"] == method and row["outcome"] == "answered"]
        soonest[method, family] = float(np.median(times))
    ordered = sorted(soonest, key=lambda own: (own[1] != "ours", soonest[own]))
    ours, families, chosen = 0, set[str](), dict[str, bool]()
    for method, family in ordered:
        if family == "ours" and ours < OURS_SHOWN:
            ours += 1
            chosen[method] = True
        elif family != "ours" and family not in families and len(chosen) < METHODS_SHOWN:
            families.add(family)
            chosen[method] = False
    return chosen


def _settings(rows: Sequence[Row], method: str) -> list[str]:
    return list(dict.fromkeys(row["setting"] for row in rows if row["method"] == method))


def _of(rows: Sequence[Row], method: str, setting: str) -> list[Row]:
    return [row for row in rows if row["method"] == method and row["setting"] == setting]


def _caption(run: BenchRun) -> str:
    told = "A line joins a method's settings; medians and quartiles of what it was asked. Top: answers failed, in %."
    return f"{told} {run.caption}"


def _styles(rows: Sequence[Row]) -> dict[str, tuple[str, str, str]]:
    """Return colour, marker and line of each method: one colour a family, ours first."""
    spare = [SKY, GREY]
    families = list(dict.fromkeys(row["family"] for row in rows))
    colours = {family: COLOURS.get(family) or spare[k % len(spare)] for k, family in enumerate(families)}
    methods = dict.fromkeys((row["method"], row["family"]) for row in rows)
    ordered = sorted(methods, key=lambda own: (own[1] != "ours", families.index(own[1])))
    count: dict[str, int] = {}
    styles = {}
    for method, family in ordered:
        k = count[family] = count.get(family, -1) + 1
        styles[method] = colours[family], MARKS[k % len(MARKS)], "-" if family == "ours" else "--"
    return styles


def _panel(axes: Any, rows: Sequence[Row], styles: dict[str, tuple[str, str, str]]) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    for method, (colour, mark, line) in styles.items():
        spots = [spot for setting in _settings(rows, method) if (spot := _spot(_of(rows, method, setting)))]
        answered = np.array([spot[:6] for spot in spots if np.isfinite(spot[3])], dtype=np.float64)
        size, width = (6.5, 1.6) if line == "-" else (4.5, 0.9)
        if len(answered):
            low, x, high, error, error_low, error_high = answered.T
            axes.errorbar(x, error, xerr=[x - low, high - x], yerr=[error - error_low, error_high - error], fmt="none",
                          ecolor=colour, elinewidth=0.5, alpha=0.5)  # fmt: skip
            axes.plot(x, error, color=colour, marker=mark, ls=line, ms=size, lw=width, mfc=colour, mec="white", mew=0.5)
        for x, failed, asked in ((spot[1], *spot[6:]) for spot in spots if spot[6]):
            axes.plot(x, FAILED, color=colour, marker=mark, ms=4.5, mfc="none", ls="none")
            axes.annotate(f"{100 * failed / asked:.0f}", (x, FAILED), xytext=(0, 4), textcoords="offset points",
                          ha="center", fontsize=5, color=colour)  # fmt: skip
    axes.axhspan(10, 1e4, color=GREY, alpha=0.08, lw=0)
    axes.axhline(EXACT, color=GREY, lw=0.6, ls=":")
    axes.set_ylim(EXACT / 10, 1e4)
    ticks = [10.0**k for k in range(-16, 1, 4)]
    axes.set_yticks([EXACT, *ticks, FAILED], ["exact", *(f"$10^{{{k}}}$" for k in range(-16, 1, 4)), "failed,\n%"])
    axes.minorticks_off()
    axes.tick_params(labelsize=7.5)
    axes.grid(visible=True, alpha=0.25, lw=0.5)


def _spot(rows: Sequence[Row]) -> tuple[float, ...] | None:
    """Return a setting's place: time and error with quartiles over its scenes, answers that failed, and all asked."""
    rows = [row for row in rows if row["outcome"] != "not asked"]
    if not rows:
        return None
    times = [row["seconds"] for row in rows if row.get("error") is not None] or [row["seconds"] for row in rows]
    failed, asked = sum(row["failed"] for row in rows), sum(row["asked"] for row in rows)
    errors = [max(row["error"], EXACT) for row in rows if row.get("error") is not None]
    if len(rows) == 1:
        spread = [rows[0][key] for key in ("low", "seconds", "high")]
        own = [max(rows[0].get(key) or 0.0, EXACT) for key in ("error", "error_low", "error_high")]
    else:
        spread = np.percentile(times, (25, 50, 75)).tolist()
        own = np.percentile(errors, (50, 25, 75)).tolist() if errors else []
    return (*spread, *(own if errors else [float("nan")] * 3), failed, asked)


def _legend(figure: Figure, styles: dict[str, tuple[str, str, str]], columns: int) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D(
            [],
            [],
            color=colour,
            marker=mark,
            ls=line,
            ms=6 if line == "-" else 4.5,
            mec="white",
            mew=0.5,
            label=f"ours: {method}" if line == "-" else method,
        )
        for method, (colour, mark, line) in styles.items()
    ]
    figure.legend(
        handles=handles, loc="lower center", ncols=columns, fontsize=7.5, frameon=False, bbox_to_anchor=(0.5, 0.03)
    )
