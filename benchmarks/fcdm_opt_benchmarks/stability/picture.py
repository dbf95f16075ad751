"""The stability map as a picture: families of cases against methods, one panel a question.

A cell's colour is the worst that came of its cases, and its number how many came out so badly, of how many; the strip
below it shows the shares of all outcomes. Where a method does not apply the cell is blank.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any, NamedTuple

from fcdm_opt.show import BLACK, BLUE, GREY, VERMILLION, new_figure
from fcdm_opt_benchmarks.stability.run import NOT_RUN, Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PALE = "#D6EBE3"  # of the palette's green


class Look(NamedTuple):
    """How an outcome is drawn: colour of the cell, colour of its text, and the letter before its number."""

    fill: str
    text: str
    mark: str
    words: str


LOOKS = {
    "right": Look(PALE, BLACK, "", "right"),
    NOT_RUN: Look("#FFFFFF", GREY, "?", "not run"),
    "flagged": Look("#F6E3A1", BLACK, "f", "flagged: it says itself that it has no answer"),
    "hung": Look(BLUE, "#FFFFFF", "h", "hung: no answer within the limit"),
    "crashed": Look(BLACK, "#FFFFFF", "c", "crashed"),
    "wrong": Look(VERMILLION, "#FFFFFF", "w", "silently wrong"),
}
"""From good to bad."""

WORST = tuple(reversed(LOOKS))
KEY = (
    "Number: cases, or those with the worst outcome of all that were asked; strip: shares of the outcomes; "
    "blank: the method is not for that. Left of the black line: ours."
)
QUESTIONS = {
    "contact": "Which scale makes the pair touch?",
    "body": "What solid is it?",
    "program": "What is the optimum?",
    "motion": "What is the smallest motion?",
}
WIDTH = 9.0  # inches
LABELS, RIGHT = 2.5, 0.1  # inches left of the cells; right of the last method's name
ROW, GAP, FOOT, LINE = 0.21, 0.25, 0.85, 0.14  # inches: a row, space above a panel, the legend, a line below that
CHARACTER, SLOPE = 0.058, 55  # inches of a method's name; its slope in degrees
NARROW, TEXT, SMALL_TEXT = 0.45, 6.5, 5.4  # inches of a cell whose text is small; points
LONGEST_LINE = 150  # characters of the caption
STRIP = 0.2  # of a cell's height
WIDEST = 0.95  # inches of a cell


class OutcomeGrid(NamedTuple):
    """What came of one question: counts of outcomes by family and method."""

    question: str
    families: tuple[str, ...]
    methods: tuple[str, ...]
    ours: int  # of the methods, the first
    counts: dict[tuple[str, str], Counter[str]]


def grids(results: Sequence[Result]) -> list[OutcomeGrid]:
    """Return one grid a question: families in order, methods ours first, then library by library.

    A library is told by the first word of its methods' names.
    """
    made = []
    for question in dict.fromkeys(result.case.question for result in results):
        own = [result for result in results if result.case.question == question]
        counts = dict[tuple[str, str], Counter[str]]()
        for result in own:
            counts.setdefault((result.case.family, result.method), Counter())[result.outcome] += 1
        methods = {result.method: result.ours for result in own}
        libraries = list(dict.fromkeys(library(method) for method in methods))
        order = sorted(methods, key=lambda method: (not methods[method], libraries.index(library(method))))
        families = tuple(dict.fromkeys(result.case.family for result in own))
        made.append(OutcomeGrid(question, families, tuple(order), sum(methods.values()), counts))
    return made


def library(method: str) -> str:
    """Return whose method it is: the first word of its name."""
    return method.split()[0].rstrip(",")


def stability_figure(results: Sequence[Result], *, title: str = "", caption: str = "") -> Figure:
    """Draw the map.

    Parameters
    ----------
    results : sequence of Result
    title, caption : str
        Text above and below.
    """
    from matplotlib.patches import Patch

    panels = grids(results)
    above = 0.4 if title else 0.1
    heads = [GAP + CHARACTER * math.sin(math.radians(SLOPE)) * max(map(len, panel.methods)) for panel in panels]
    lines = [KEY, *wrap(caption, LONGEST_LINE)]
    foot = FOOT + LINE * len(lines)
    height = above + sum(heads) + sum(ROW * len(panel.families) for panel in panels) + foot
    figure = new_figure(WIDTH, height)
    top = height - above
    for panel, head in zip(panels, heads, strict=True):
        top -= head
        tall = ROW * len(panel.families)
        over = RIGHT + CHARACTER * math.cos(math.radians(SLOPE)) * len(panel.methods[-1])  # of the last name
        count = len(panel.methods)
        cell = min(WIDEST, (WIDTH - LABELS - over) / (count - 0.5), (WIDTH - LABELS - RIGHT) / count)
        area = (LABELS / WIDTH, (top - tall) / height, cell * len(panel.methods) / WIDTH, tall / height)
        _draw(figure.add_axes(area), panel, SMALL_TEXT if cell < NARROW else TEXT)
        top -= tall
    handles = [
        Patch(facecolor=look.fill, edgecolor=GREY, linewidth=0.5, label=f"{look.mark}  {look.words}".strip())
        for look in LOOKS.values()
    ]
    place = (0.01, (foot - FOOT + 0.15) / height)
    figure.legend(handles=handles, loc="lower left", bbox_to_anchor=place, ncols=3, frameon=False, fontsize=8)
    if title:
        figure.text(0.02, 1 - 0.12 / height, title, va="top", fontsize=11)
    figure.text(0.02, 0.1 / height, "\n".join(lines), va="bottom", fontsize=7, linespacing=1.3)
    return figure


def _draw(axes: Any, panel: OutcomeGrid, points: float) -> None:
    from matplotlib.patches import Rectangle

    wide, tall = len(panel.methods), len(panel.families)
    axes.set_xlim(0, wide)
    axes.set_ylim(tall, 0)
    for y, family in enumerate(panel.families):
        for x, method in enumerate(panel.methods):
            counts = panel.counts.get((family, method))
            if not counts:
                continue
            worst = next(name for name in WORST if counts[name])
            look, total = LOOKS[worst], counts.total()
            axes.add_patch(Rectangle((x, y), 1, 1, facecolor=look.fill, edgecolor="white", linewidth=0.8))
            start = float(x)
            for name in WORST:
                share = counts[name] / total
                if share and worst != "right":
                    axes.add_patch(Rectangle((start, y + 1 - STRIP), share, STRIP, facecolor=LOOKS[name].fill))
                start += share
            text = f"{total}" if worst == "right" else f"{look.mark} {counts[worst]}/{total}"
            middle = 0.5 if worst == "right" else 0.5 - STRIP / 2
            weight = "bold" if worst == "wrong" else "normal"
            style = {"ha": "center", "va": "center", "fontsize": points, "color": look.text, "weight": weight}
            axes.text(x + 0.5, y + middle, text, **style)
    axes.axvline(panel.ours, color=BLACK, linewidth=1.2)
    for x in range(panel.ours + 1, wide):
        if library(panel.methods[x]) != library(panel.methods[x - 1]):
            axes.axvline(x, color=GREY, linewidth=0.8)
    axes.set_yticks([y + 0.5 for y in range(tall)], panel.families, fontsize=7.5)
    axes.set_xticks([x + 0.5 for x in range(wide)], panel.methods, fontsize=7.5, rotation=SLOPE, ha="left")
    axes.tick_params(length=0, pad=3, top=False, labeltop=True, bottom=False, labelbottom=False)
    for k, label in enumerate(axes.get_xticklabels()):
        label.set_rotation_mode("anchor")
        label.set_weight("bold" if k < panel.ours else "normal")
    for side in axes.spines.values():
        side.set_visible(False)
    axes.annotate(
        QUESTIONS.get(panel.question, panel.question),
        (0, 1),
        xycoords="axes fraction",
        xytext=(-LABELS * 72 + 8, 14),
        textcoords="offset points",
        fontsize=8.5,
        weight="bold",
        ha="left",
    )
