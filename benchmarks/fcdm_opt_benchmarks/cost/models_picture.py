"""What the models cost, drawn: a line a scene, and a mark for each model in four panels."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from fcdm_opt.show import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILLION, new_figure
from fcdm_opt_benchmarks.record import BenchRun, Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLES = {
    "auto": ("o", VERMILLION, 60),
    "satisfied": ("*", BLUE, 26),
    "shift": ("P", BLUE, 24),
    "straight": ("s", BLUE, 18),
    "translations": ("D", BLUE, 18),
    "one parameter": ("^", GREEN, 24),
    "rotations": ("v", GREEN, 24),
    "descent": ("<", PURPLE, 24),
    "ways apart": ("h", PURPLE, 26),
    "directions": ("d", PURPLE, 22),
    "nlp": (">", PURPLE, 24),
    "branch and bound": ("p", ORANGE, 26),
    "together": ("H", ORANGE, 26),
    "full": ("X", BLACK, 34),
}
"""Mark, colour and size of a model; what is exact and cheap in blue, the search along few parameters in green."""

OUTCOMES = ("settled", "refused", "over", "crashed", "no motion")
LINE, HEAD, FOOT = 0.19, 0.45, 1.35  # inches: of a scene, above and below all of them
LEFT, RIGHT = 0.185, 0.99
MOST_TICKS = 5  # decades that are all marked


def models_figure(run: BenchRun) -> Figure:
    """Draw the table "models" of a run.

    Parameters
    ----------
    run : BenchRun
        Of command "bench".
    """
    rows = run.tables["models"]
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    places = {scene: k for k, scene in enumerate(scenes)}
    height = HEAD + FOOT + LINE * len(scenes)
    figure = new_figure(9.0, height)
    panels = figure.subplots(1, 4, sharey=True, width_ratios=(1.1, 1.1, 0.8, 1.0))
    figure.subplots_adjust(LEFT, FOOT / height, RIGHT, 1.0 - HEAD / height, wspace=0.12)
    texts = "unknowns + constraints", "seconds of a solve", "part pairs kept of all", "features kept of all"
    for axes, text, value in zip(panels, texts, (_size, _seconds, _pairs, _features), strict=True):
        _marks(axes, rows, places, value)
        axes.set_xlabel(text, fontsize=8.5)
        axes.tick_params(labelsize=6.5)
        axes.grid(axis="x", color=GREY, alpha=0.25, linewidth=0.6)
        for k in range(0, len(scenes), 2):
            axes.axhspan(k - 0.5, k + 0.5, color=GREY, alpha=0.08, linewidth=0)
    _over(panels[1], rows, places)
    panels[0].set_yticks(range(len(scenes)), scenes, fontsize=7.5)
    panels[0].set_ylim(len(scenes) - 0.5, -0.5)
    _words(figure, run, height)
    return figure


def _seconds(row: Row) -> float:
    return float(row["seconds"])


def _pairs(row: Row) -> float:
    return float(row["part_pairs"] / row["part_pairs_total"])


def _features(row: Row) -> float:
    return float(row["features"] / row["features_total"])


def _size(row: Row) -> float:
    return float(row["variables"] + row["constraints"])


def _marks(axes: Any, rows: Sequence[Row], places: dict[str, int], value: Callable[[Row], float]) -> None:
    """Draw what is settled, hollow where the judge did not pass it; logarithmic, with room for 0."""
    settled = [row for row in rows if row["outcome"] == "settled"]
    for model, (mark, colour, area) in STYLES.items():
        drawn = [row for row in settled if row["model"] == model]
        axes.scatter(
            [value(row) for row in drawn],
            [places[row["scene"]] for row in drawn],
            marker=mark,
            s=area,
            facecolors=[colour if row["verified"] else "none" for row in drawn],
            edgecolors=colour if model != "auto" else BLACK,
            linewidths=0.6,
            alpha=0.85,
            zorder=2 if model == "auto" else 3,
        )
    least = min((value(row) for row in settled if value(row) > 0), default=1.0)
    most = max((value(row) for row in settled), default=1.0) or 1.0
    if any(value(row) == 0 for row in settled):
        axes.set_xscale("symlog", linthresh=10.0 ** math.floor(math.log10(least)))
    else:
        axes.set_xscale("log")
    decades = range(math.floor(math.log10(least)), math.ceil(math.log10(most)) + 1)
    every = 1 + len(decades) // MOST_TICKS
    zero = [0.0] if axes.get_xscale() == "symlog" else []
    axes.set_xticks(zero + [10.0**k for k in decades[::-every] if zero == [] or k > decades[0]])
    axes.minorticks_off()


def _over(axes: Any, rows: Sequence[Row], places: dict[str, int]) -> None:
    """Draw an arrow from the limit on for what ran over it, and one for what crashed."""
    over = [row for row in rows if row["outcome"] in ("over", "crashed")]
    for row in over:
        start, place = row["seconds"], float(places[row["scene"]])
        others = [own["model"] for own in over if own["scene"] == row["scene"]]
        place += 0.3 * (others.index(row["model"]) - (len(others) - 1) / 2.0) if len(others) > 1 else 0.0
        axes.annotate(
            "",
            (3.0 * start, place),
            xytext=(start, place),
            arrowprops={"arrowstyle": "-|>", "color": STYLES[row["model"]][1], "linewidth": 1.2, "mutation_scale": 7},
        )
    if over:
        axes.set_xlim(None, 3.5 * max(row["seconds"] for row in over))


def _words(figure: Figure, run: BenchRun, height: float) -> None:
    """Write title, who is who, and what is not drawn."""
    from matplotlib.lines import Line2D

    rows = run.tables["models"]
    there = {row["model"] for row in rows if row["outcome"] == "settled"}
    handles = [
        Line2D([], [], linestyle="none", marker=mark, color=colour, markersize=math.sqrt(area), label=_named(model))
        for model, (mark, colour, area) in STYLES.items()
        if model in there
    ]
    figure.legend(
        handles=handles, loc="upper center", bbox_to_anchor=(0.5, (FOOT - 0.48) / height), ncols=5, frameon=False,
        fontsize=8, handletextpad=0.1, columnspacing=1.5,
    )  # fmt: skip
    figure.suptitle("What the models cost: the solver's choice, each stage forced, and everything in one program",
                    fontsize=11, y=1.0 - 0.12 / height)  # fmt: skip
    count = {word: sum(row["outcome"] == word for row in rows) for word in OUTCOMES}
    said = (
        f"Drawn: {count['settled']} solves; hollow: not passed by the judge; arrows: {count['over']} over the "
        f"limit and {count['crashed']} that crashed. "
        f"Not drawn: {count['refused']} forced stages that do not settle\nthe scene, {count['no motion']} that find no "
        f"motion. {run.caption}"
    )
    figure.text(0.5, 0.06 / height, said, ha="center", va="bottom", fontsize=7, color=GREY, linespacing=1.4)


def _named(model: str) -> str:
    return {"auto": "auto: the solver's choice", "full": "full model", "nlp": "nonlinear program"}.get(model, model)
