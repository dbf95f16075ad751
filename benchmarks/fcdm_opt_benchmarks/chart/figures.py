"""Speed against accuracy, drawn: time an answer on one axis, its error against the exact reference on the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple
from zlib import crc32

import numpy as np

from fcdm_opt.show import BLACK, BLUE, GREEN, GREY, NOTE, ORANGE, PAGE, PURPLE, VERMILLION, styled
from fcdm_opt.show.lettering import Names, Sheet
from fcdm_opt_benchmarks.record import BenchRun, Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {
    "ours": VERMILLION, "coal": BLUE, "growth distance": BLACK, "HiGHS": GREEN, "Clarabel": PURPLE, "CasADi": ORANGE,
    "scipy": "#56B4E9", "Drake": "#882255", "SCIP": "#8B8000", "codac": "#332288", "the paper's": GREY,
}  # fmt: skip
"""Colour of each family of methods, in every panel of every picture."""
ADDED = "#E7298A"
"""Colour of rivals of other families, as of the user's own: they are named in each panel."""
MARKS = {
    "kernel": "s", "decision_curves": "D", "decision_curve": "o", "exact path": "^", "fcdm_opt": "o",
    "coal bisection": "v", "coal distance + Newton": "s", "coal in the loop": "^",
    "growth simplex + Newton": "s", "growth distances": "D",
    "HiGHS, warm": "s", "HiGHS, cold": "^", "scipy linprog": "v", "Clarabel": "s", "Clarabel (cvxpy)": "^",
    "CasADi clp": "s", "CasADi ipqp": "^", "CasADi IPOPT": "v", "IPOPT, full model": "D",
    "SLSQP": "s", "SLSQP, multistart": "D", "trust-constr": "^", "COBYQA": "v", "Nelder-Mead": "P",
    "differential evolution": "X", "Drake, SNOPT": "s", "SCIP": "s", "codac, proved": "s", "grid": "s",
}  # fmt: skip
"""Marker of each method, likewise; others have one by their name."""
SPARE = "<>*hpd8"
EXACT = 1e-18
"""Error at which exact answers are drawn."""
BAND = (1e1, 1e7)
"""Errors between which the share of failed answers is drawn, from none to all."""
TITLES = {
    "contact": "one contact: the scale at which body 2 touches",
    "curve": "the whole decision curve",
    "motion": "the smallest motion (ours with its verification)",
}
TASK_WORDS = {"contact": "one contact", "curve": "the whole curve", "motion": "smallest motion"}
NAMED, FINE = 3, 1e-6
"""How many rivals are named in a panel, and the relative error within which the fastest comes first."""
GROUPS = {"contact": "vertices", "curve": "vertices", "motion": "parameters"}
"""The column that tells the panels of a task apart."""
ACROSS, HIGH, LEFT, BESIDE, ABOVE, BELOW = 3, 1.75, 0.66, 0.1, 0.36, 0.3
"""Panels beside one another; inches: height of a panel, left of the first, between two, above each and below."""


class Look(NamedTuple):
    """How a method is drawn, everywhere."""

    colour: str
    mark: str
    ours: bool

    @classmethod
    def of(cls, method: str, family: str) -> Look:
        """Return the look of a method."""
        return cls(COLOURS.get(family, ADDED), MARKS.get(method, SPARE[crc32(method.encode()) % len(SPARE)]),
                   family == "ours")  # fmt: skip

    @property
    def point(self) -> dict[str, Any]:
        """Return the look of its points."""
        size = 5.5 if self.ours else 3.5
        return {"color": self.colour, "marker": self.mark, "ms": size, "mec": "white", "mew": 0.4}


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


def chart_figure(run: BenchRun, task: str) -> Figure:
    """Draw one task: a panel for each size, and who is who.

    Parameters
    ----------
    run : BenchRun
        Of command "bench".
    task : "contact", "curve" or "motion"
    """
    rows, column = [row for row in run.tables["chart"] if row["task"] == task], GROUPS[task]
    sizes = sorted({row[column] for row in rows})
    panels = [
        (f"{size} {column if size != 1 else column.removesuffix('s')}", [row for row in rows if row[column] == size])
        for size in sizes
    ]
    return _figure(run, panels, f"Speed against accuracy: {TITLES[task]}")


def overview_figure(run: BenchRun) -> Figure:
    """Draw a small panel for each task and class of scenes."""
    panels = []
    for task, kind, rows in panels_of(run):
        scenes = len({row["scene"] for row in rows})
        panels.append((f"{TASK_WORDS[task]}, {scenes} scene{'s' * (scenes > 1)}\n{kind}", rows))
    return _figure(run, panels, "")


@styled
def _figure(run: BenchRun, panels: Sequence[tuple[str, list[Row]]], title: str) -> Figure:
    """Draw panels, each with its title; one legend for all."""
    from matplotlib.lines import Line2D

    every = [row for _, rows in panels for row in rows]
    met = dict.fromkeys((row["method"], row["family"]) for row in every if row["outcome"] != "not asked")
    looks = {method: Look.of(method, family) for method, family in sorted(met, key=_in_order)}
    lines = -(-len(panels) // ACROSS)
    key = 0.145 * (-(-len(looks) // 4)) + 0.1
    step = ABOVE + HIGH
    told = (
        "Left and below is better. Ours: large marks in vermilion, with their verification. A line joins a method's "
        "settings, from loose to tight; places are medians over the scenes, bars quartiles of ours. Top: share of "
        f"answers that failed. {run.caption}"
    )
    sheet = Sheet.of(PAGE, lines * step + BELOW + key + 0.1, title=title, caption=told)
    wide = (PAGE - LEFT - 0.1 - (ACROSS - 1) * BESIDE) / ACROSS
    ends = [row[end] for row in every for end in ("low", "high") if row.get(end)]
    seconds = (min(ends, default=1e-6) / 3, 10 * max(ends, default=1.0))
    for k, (name, rows) in enumerate(panels):
        line, column = divmod(k, ACROSS)
        bottom = key + 0.1 + BELOW + (lines - 1 - line) * step
        axes = sheet.axes(LEFT + column * (wide + BESIDE), bottom, wide, HIGH)
        _panel(axes, rows, looks, seconds)
        axes.set_title(name, fontsize=NOTE + 0.5, pad=3.0)
        axes.tick_params(labelleft=column == 0, labelbottom=k + ACROSS >= len(panels))
        if column == 0:
            axes.set_ylabel("relative error", labelpad=1.0)
        if k + ACROSS >= len(panels):
            axes.set_xlabel("seconds an answer", labelpad=1.0)
    handles = [Line2D([], [], ls="-" if look.ours else "--", lw=0.9, **look.point) for look in looks.values()]
    names = [f"ours: {method}" if look.ours else method for method, look in looks.items()]
    sheet.legend(handles, names, bottom=0.05)
    return sheet.figure


def _in_order(method: tuple[str, str]) -> tuple[int, int, str]:
    """Return where a method stands in a legend: as the tables of looks have them."""
    places = {name: k for table in (COLOURS, MARKS) for k, name in enumerate(table)}
    name, family = method
    return places.get(family, len(COLOURS)), places.get(name, len(MARKS)), name


def _panel(axes: Any, rows: Sequence[Row], looks: dict[str, Look], seconds: tuple[float, float]) -> None:
    """Draw each method's settings, the share of its answers that failed, and the names of the strongest."""
    axes.set(xscale="log", yscale="log", xlim=seconds, ylim=(EXACT / 1e4, BAND[1]))
    axes.axhspan(*BAND, color=GREY, alpha=0.12, lw=0)
    axes.axhline(EXACT, color=GREY, lw=0.6, ls=":")
    ticks = {EXACT: "exact", **{10.0**k: f"$10^{{{k}}}$" for k in range(-16, 1, 4)}, _failed(0.0): "0 % fail",
             _failed(1.0): "100 %"}  # fmt: skip
    axes.set_yticks(list(ticks), list(ticks.values()))
    axes.minorticks_off()
    axes.grid(visible=True)
    ours = [row["method"] for row in rows if row["family"] == "ours"]
    every, known = strongest(rows), {row["method"] for row in rows if row["family"] in COLOURS}
    rivals, added = every[:NAMED], [method for method in every if method not in known][:NAMED]
    named = dict.fromkeys([*rivals[:1], *ours, *added, *rivals])  # in this order, as there may not be room for all
    names, places = Names(axes), dict[str, list[tuple[float, float]]]()
    for method, look in reversed(looks.items()):  # ours above all others
        mine = [row for row in rows if row["method"] == method]
        spots = [spot for setting in dict.fromkeys(row["setting"] for row in mine)
                 if (spot := _spot([row for row in mine if row["setting"] == setting]))]  # fmt: skip
        answered = np.array([spot[:6] for spot in spots if np.isfinite(spot[3])], dtype=np.float64).reshape(-1, 6)
        low, x, high, error, error_low, error_high = answered.T
        if look.ours:
            axes.errorbar(x, error, xerr=[x - low, high - x], yerr=[error - error_low, error_high - error], fmt="none",
                          ecolor=look.colour, elinewidth=0.5, alpha=0.6)  # fmt: skip
        faint = {} if method in named else {"alpha": 0.85}
        if len(x):
            axes.plot(x, error, ls="-" if look.ours else "--", lw=0.6, **look.point, **faint)
        failed = [(spot[1], _failed(spot[6] / spot[7])) for spot in spots if spot[6]]
        for place in failed:
            axes.plot(*place, ls="none", **{**look.point, "mfc": "none", "mec": look.colour})
        places[method] = [*sorted(zip(x.tolist(), error.tolist(), strict=True)), *failed]
        for place in places[method]:
            names.keep(place, 3.0)
    for method in named:
        if places.get(method):
            names.put(method, places[method], (-1.0, -0.3), colour=looks[method].colour)


def _failed(share: float) -> float:
    """Return where a share of failed answers is drawn in its band."""
    low, high = np.log10(BAND)
    return float(10.0 ** (low + (high - low) * (0.12 + 0.76 * share)))


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
