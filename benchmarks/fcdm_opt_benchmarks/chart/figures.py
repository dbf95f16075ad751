"""Speed against accuracy, drawn: time an answer on one axis, its error against the exact reference on the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.show import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILLION, new_figure
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
EXACT, FAILED = 1e-18, 1e4
"""Errors at which exact answers, and failed ones, are drawn."""
BAND, LINES = (1e1, 1e7), 6
"""Errors between which failed answers are drawn, and in how many lines."""
TITLES = {
    "contact": "one contact: the scale at which body 2 touches",
    "curve": "the whole decision curve",
    "motion": "the smallest motion (ours with its verification)",
}
TASK_WORDS = {"contact": "one contact", "curve": "the whole curve", "motion": "smallest motion"}
STRONGEST, FINE = 5, 1e-6
"""How many rivals a panel names, and the relative error within which the fastest comes first."""
PALETTE = (BLUE, GREEN, PURPLE, BLACK, SKY)
LETTER, LINE = 0.016, 0.047
"""Width of a letter and height of a line, as shares of a small panel's."""
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
        own = [row for row in rows if row[column] == size]
        _panel(axes, own, styles)
        _failures(axes, own, styles)
        axes.set_title(f"{size} {column if size != 1 else column.removesuffix('s')}", fontsize=9)
    panels[0].set_ylabel("relative error against the exact reference")
    panels[len(panels) // 2].set_xlabel("seconds an answer")
    _legend(figure, styles, columns=5)
    figure.suptitle(f"Speed against accuracy: {TITLES[task]}", fontsize=11, y=0.985)
    figure.text(0.5, 0.005, _caption(run), ha="center", va="bottom", fontsize=6.5, color=GREY)
    figure.subplots_adjust(left=0.75 / width, right=0.985, top=0.9, bottom=0.3, wspace=0.06)
    return figure


def scene_class(row: Row) -> str:
    """Return the class of a scene: hulls in general position or aligned, or a kind of ordinary parts."""
    shape = row.get("shape")
    if row.get("motion") == "of the data set":
        return str(shape)
    return "aligned hulls" if shape == "aligned" else "general position"


def panels_of(run: BenchRun) -> list[tuple[str, str, list[Row]]]:
    """Return (task, class of scenes, rows) of each panel, in order."""
    rows = run.tables["chart"]
    found = dict.fromkeys((row["task"], scene_class(row)) for row in rows)
    order = sorted(found, key=lambda own: list(TITLES).index(own[0]))
    return [(task, kind, [row for row in rows if (row["task"], scene_class(row)) == (task, kind)])
            for task, kind in order]  # fmt: skip


def strongest(rows: Sequence[Row]) -> list[str]:
    """Return a panel's rivals in order: who is within `FINE` in most scenes, to a tenth, then who is fastest."""
    scenes = {row["scene"] for row in rows}

    def rank(method: str) -> tuple[float, float]:
        mine = [
            row for row in rows if row["method"] == method and row["outcome"] == "answered" and row["error"] <= FINE
        ]
        best = [
            min(row["seconds"] for row in mine if row["scene"] == scene) for scene in {row["scene"] for row in mine}
        ]
        return -round(len(best) / len(scenes), 1), float(np.median(best)) if best else float("inf")

    rivals = dict.fromkeys(row["method"] for row in rows if row["family"] != "ours" and row["outcome"] != "not asked")
    return sorted(rivals, key=rank)


def overview_figure(run: BenchRun) -> Figure:
    """Draw a small panel for each task and class of scenes: ours, and the strongest rivals, named beside a point."""
    shown = panels_of(run)
    columns = min(3, len(shown))
    lines = -(-len(shown) // columns)
    figure = new_figure(10.0, 0.9 + 2.9 * lines)
    panels = figure.subplots(lines, columns, sharey=True, squeeze=False).ravel()
    every = [row[key] for _, _, own in shown for row in own for key in ("low", "high") if row.get(key)]
    for axes, (task, kind, rows) in zip(panels, shown, strict=False):
        named = strongest(rows)[:STRONGEST]
        styles = dict.fromkeys(strongest(rows)[STRONGEST:], (GREY, ".", ""))
        styles |= {method: (PALETTE[k], MARKS[k + 1], "--") for k, method in enumerate(named)}
        styles |= {row["method"]: (VERMILLION, "o", "-") for row in rows if row["family"] == "ours"}
        _panel(axes, rows, styles)
        axes.set_xlim(min(every) / 3, 30 * max(every))  # room for names
        _failures(axes, rows, styles)
        _named_beside(axes, rows, {method: style[0] for method, style in styles.items() if style[2]})
        scenes = len({row["scene"] for row in rows})
        axes.set_title(f"{TASK_WORDS[task]}: {kind} ({scenes} scene{'s' * (scenes > 1)})", fontsize=7.5)
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    for axes in panels[::columns]:
        axes.set_ylabel("relative error", fontsize=8)
    for axes in panels[max(0, len(shown) - columns) : len(shown)]:
        axes.set_xlabel("seconds an answer", fontsize=8)
    told = "Left and below is better. Red: ours, with its verification. Grey: further rivals."
    figure.text(0.5, 0.005, f"{told}\n{_caption(run)}", ha="center", va="bottom", fontsize=6.5, color=GREY)
    height = 0.9 + 2.9 * lines
    figure.subplots_adjust(left=0.075, right=0.99, top=1 - 0.3 / height, bottom=0.75 / height, wspace=0.05, hspace=0.32)
    return figure


def _named_beside(axes: Any, rows: Sequence[Row], colours: Mapping[str, str]) -> None:
    """Write each method's name near its fastest point, where it covers no name and, if it can be, no point."""
    spots: dict[str, list[tuple[float, float]]] = {}
    for method in colours:
        mine = [row for row in rows if row["method"] == method]
        found = (_spot([row for row in mine if row["setting"] == setting]) for setting in dict.fromkeys(
            row["setting"] for row in mine))  # fmt: skip
        places = [(spot[1], min(spot[3], FAILED) if np.isfinite(spot[3]) else FAILED) for spot in found if spot]
        spots[method] = sorted((float(np.log10(x)), float(np.log10(y))) for x, y in places)
    wide, high = (float(np.ptp(np.log10(ends))) for ends in (axes.get_xlim(), axes.get_ylim()))
    letter, line, ends = LETTER * wide, LINE * high, np.log10(axes.get_ylim())
    marks = [(x, x, y) for own in spots.values() for x, y in own]
    taken: list[tuple[float, float, float]] = []
    for method, own in sorted(spots.items(), key=lambda item: item[1]):
        if not own:
            continue
        x, y = own[0]
        end = x + letter * len(method)
        steps = [line * k for n in range(1, 12) for k in (n, -n) if ends[0] < y + line * k < ends[1]]

        def covered(step: float, x: float = x, y: float = y, end: float = end) -> list[bool]:
            """Tell whether names, and whether points, would be covered."""
            return [any(low <= end and x <= up and abs(y + step - at) < line for low, up, at in those)
                    for those in (taken, marks)]  # fmt: skip

        step = min(steps, key=covered)
        taken.append((x, end, y + step))
        axes.annotate(method, (10**x, 10 ** (y + step)), fontsize=6, color=colours[method], va="center")
        if abs(step) > 1.5 * line:  # which point it is, is not seen otherwise
            axes.plot([10**x] * 2, [10**y, 10 ** (y + step)], color=colours[method], lw=0.4, alpha=0.7)


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
        mine = [row for row in rows if row["method"] == method]
        spots = [spot for setting in dict.fromkeys(row["setting"] for row in mine)
                 if (spot := _spot([row for row in mine if row["setting"] == setting]))]  # fmt: skip
        answered = np.array([spot[:6] for spot in spots if np.isfinite(spot[3])], dtype=np.float64)
        size, width = (6.5, 1.6) if line == "-" else (4.5, 0.9)
        if len(answered):
            low, x, high, error, error_low, error_high = answered.T
            axes.errorbar(x, error, xerr=[x - low, high - x], yerr=[error - error_low, error_high - error], fmt="none",
                          ecolor=colour, elinewidth=0.5, alpha=0.5)  # fmt: skip
            axes.plot(x, error, color=colour, marker=mark, ls=line, ms=size, lw=width, mfc=colour, mec="white", mew=0.5)
    axes.axhspan(BAND[0], BAND[1], color=GREY, alpha=0.08, lw=0)
    axes.axhline(EXACT, color=GREY, lw=0.6, ls=":")
    axes.set_ylim(EXACT / 10, BAND[1])
    ticks = [10.0**k for k in range(-16, 1, 4)]
    axes.set_yticks([EXACT, *ticks, FAILED], ["exact", *(f"$10^{{{k}}}$" for k in range(-16, 1, 4)), "failed,\n%"])
    axes.minorticks_off()
    axes.tick_params(labelsize=7.5)
    axes.grid(visible=True, alpha=0.25, lw=0.5)


def _failures(axes: Any, rows: Sequence[Row], styles: Mapping[str, tuple[str, str, str]]) -> None:
    """Mark in the band on top what failed, with its share in per cent beside it: in lines, none on another.

    A method's settings that failed alike, and took about as long, share a mark; further rivals, and marks for which no
    line has room, are without number, in the lowest line.
    """
    (left, right), (low, high) = np.log10(axes.get_xlim()), np.log10(BAND)
    wide = LETTER * (right - left)
    found = set[tuple[float, str, str, str]]()
    for method, (colour, mark, joined) in styles.items():
        mine = [row for row in rows if row["method"] == method]
        for setting in dict.fromkeys(row["setting"] for row in mine):
            spot = _spot([row for row in mine if row["setting"] == setting])
            if spot and spot[6]:
                place = round(float(np.log10(spot[1])) / wide) * wide
                found.add((place, colour, mark, f"{100 * spot[6] / spot[7]:.0f}" if joined else ""))
    ends = [-np.inf] * LINES
    for x, colour, mark, share in sorted(found):
        line = next((k for k in range(LINES - 1) if share and ends[k] <= x - wide), None)
        at = 10**x, 10 ** (high - (high - low) * ((LINES - 1 if line is None else line) + 0.5) / LINES)
        axes.plot(*at, color=colour, marker=mark, ms=3.5, mfc="none", mew=0.7, ls="none")
        if line is not None:
            ends[line] = x + wide * (1.5 + len(share))
            axes.annotate(share, at, xytext=(3, 0), textcoords="offset points", va="center", fontsize=5, color=colour)


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
