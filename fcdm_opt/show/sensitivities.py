"""What the least amount depends on, each datum changed by a comparable step."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.errors import counted
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.naming import element_text, is_round
from fcdm_opt.geometry.units import measured
from fcdm_opt.model.true_faces import on_true_faces
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Sensitivity, Solution
from fcdm_opt.show import BLACK, DARK, GREY, NOTE, PAGE, Figure, styled
from fcdm_opt.show.lettering import Sheet, literal, rounded_down
from fcdm_opt.show.printing import wrapped
from fcdm_opt.show.texts import shortened
from fcdm_opt.show.verdict import name_of

STEP = 0.01
"""Relative step of every datum: 1 %; of lengths and angles a round number that is no more, see `rounded_down`."""

NEGLIGIBLE = 1e-9  # of the largest bar: smaller ones are rounding, and left out
SHIFTED, MOVED = "planes of faces, shifted outwards", "corners and seeds, moved in the direction that costs most"
"""What is done to data of the bodies' shape."""

BY_NAME = NAMED, HALF = "sizes by name", "sizes by name, each by half its tolerance"
WHOLE = OVERALL, TOLERANCES = "overall sizes as made, all else as it is", "tolerances, shares of the size"
"""What is done to sizes: those by name that have a tolerance have a step of their own each."""

MOST, LEAST = 16, 4  # bars of a picture; at least so many of them of the bodies' shape
NAMES, STEPS, BELOW, ROW = 2.15, 0.65, 0.42, 0.165
"""Inches for the names of the bars, for their steps, for the axis below, and for a bar."""

ROOM, HATCH, LETTERS, LINE, LISTED = 1.36, "////", 36, 0.7, 240
"""How far the axis goes, largest bar 1; hatch of what lowers the amount; letters in a line of a name; what
one line more takes, in bars; letters of a list of names."""


class Bar(NamedTuple):
    """How much the amount changes, to first order, with a step of one datum.

    `name` is the datum, such as "size of lid", `value` the change of the amount, in its own units, nan where it has no
    derivative by this datum, and `unit` the step, such as "+1 %". `note` tells what kind of data it is, and what is
    done to them: a picture has those of one kind under it.
    """

    name: str
    value: float
    unit: str
    note: str


@styled
def sensitivities_figure(solution: Solution, *, title: str = "", caption: str = "") -> Figure:
    """Draw what the least amount depends on: a bar for a step of each datum; lower amounts are hatched.

    Where derivatives do not exist, or hold on one side only, the caption says why.
    """
    derivatives, problem = solution.sensitivity, solution.problem
    every = bars(derivatives, problem)
    unknown = [bar.name for bar in every if not math.isfinite(bar.value)]
    every = [bar for bar in every if math.isfinite(bar.value)]
    few = [bar for bar in every if bar.note not in (SHIFTED, MOVED)]
    shape = sorted((bar for bar in every if bar not in few), key=lambda bar: -abs(bar.value))
    shown = [*few, *shape[: max(MOST - len(few), LEAST)]]
    groups = dict[str, list[Bar]]()
    for bar in shown:
        groups.setdefault(wrapped(bar.note, LETTERS), []).append(bar)
    rows = list[str | Bar]()
    for heading, own in groups.items():
        rows += [heading, *own]
    notes = [caption] if caption else []
    if len(shown) < len(every):
        notes.append(f"{len(every) - len(shown)} smaller ones of faces, vertices and seeds are not shown")
    missing = sum(map(math.isnan, derivatives.faces.values()))
    if every and missing:
        notes.append(
            f"no derivative by the shift of {counted(missing, 'face')}, as it would part a corner that matters"
        )
    if unknown:
        notes.append(shortened(f"no derivative by: {', '.join(unknown)}", LISTED))
    if not derivatives.exists:
        notes.append("derivatives are missing, one-sided or not unique: " + "; ".join(derivatives.reasons))
    words = [wrapped(row.name, LETTERS) if isinstance(row, Bar) else row for row in rows]
    places = np.cumsum([0.0, *(1.0 + LINE * text.count("\n") for text in words)])
    middles, end = (places[1:] + places[:-1]) / 2.0, max(places[-1], 2.0)
    sheet = Sheet.of(PAGE, BELOW + ROW * end, title=title, caption="\n".join(notes))
    axes = sheet.axes(NAMES, BELOW, PAGE - NAMES - STEPS, sheet.size[1] - BELOW)
    axes.set(ylim=(end, 0.0))
    unit = problem.amount_unit or "length units"
    axes.set_xlabel(f"change of the amount ({unit}) with the step on the right, to first order")
    axes.set_yticks(middles, [literal(text) if text != row else "" for text, row in zip(words, rows, strict=True)])
    axes.tick_params(axis="y", length=0)
    axes.spines[["top", "right", "left"]].set_visible(False)
    if not shown:
        text = "nothing nearby changes the amount" if derivatives.exists else "no derivatives"
        axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=DARK)
        axes.set_xticks([])
        return sheet.figure
    axes.grid(visible=True, axis="x")
    axes.axvline(0.0, color=BLACK, linewidth=0.6)
    largest = max(abs(bar.value) for bar in shown) or 1.0
    axes.set_xlim(-ROOM * largest if any(bar.value < 0.0 for bar in shown) else -0.02 * largest, ROOM * largest)
    style: Any = {"textcoords": "offset points", "fontsize": NOTE, "va": "center"}
    for row, item in zip(middles.tolist(), rows, strict=True):
        if isinstance(item, str):
            axes.annotate(literal(item), (0.02, row), xycoords=("figure fraction", "data"), xytext=(0.0, 0.0),
                          fontweight="bold", annotation_clip=False, **style)  # fmt: skip
            continue
        bar, less = item, item.value < 0.0
        axes.barh(row, bar.value, 0.62, color=GREY if less else DARK, hatch=HATCH if less else None,
                  edgecolor="white", linewidth=0.0)  # fmt: skip
        axes.annotate(f"{bar.value:+.3g}" if bar.value else "0", (bar.value, row), xytext=(-3.0 if less else 3.0, 0.0),
                      ha="right" if less else "left", color=DARK, **style)  # fmt: skip
        axes.annotate(bar.unit, (1.0, row), xycoords=("axes fraction", "data"), xytext=(6.0, 0.0),
                      annotation_clip=False, **style)  # fmt: skip
    return sheet.figure


def _name_of(problem: Problem, label: str) -> str:
    """Return in words what a label of a `Sensitivity` stands for: "top face of lid", "corner 3 of box", "lid"."""
    key, *numbers = label.split("V")
    key = key.strip()
    if key in ("P1", "P2"):
        body, name = (problem.movable, problem.static)[key == "P2"], name_of(problem, int(key == "P2"))
    else:
        body, name = next((own.body, own.name) for own in problem.keep_out if repr(own.name) in key)
    corners = tuple(int(number.strip(",")) for number in numbers)
    if len(corners) < 2:
        return f"corner {corners[0]} of {name}" if corners else name
    return f"{element_text(body, Element('F', corners)).partition(' (facing')[0]} of {name}"


def bars(sensitivity: Sensitivity, problem: Problem) -> list[Bar]:
    """Return how the amount changes with each datum that matters, all for steps of about the same relative size.

    Scales, tolerances and weights change by 1 %, lengths by about 1 % of `problem.length`, angles by what moves a point
    at that distance about as far, sizes by name by half their tolerance where they have one. Sizes of both bodies come
    first and always, then what else matters, by kind; the seed and, where a face cannot be shifted without breaking a
    corner, the vertices count in the direction that costs most. Faces and vertices by which the amount has no
    derivative are left out. Empty where no derivative exists, as without a motion, and where nothing matters, as where
    none is needed.
    """
    every = list(_all(sensitivity, problem))
    largest = max((abs(bar.value) for bar in every if math.isfinite(bar.value)), default=0.0)
    if largest == 0.0:
        return []
    every = [bar._replace(value=0.0) if abs(bar.value) <= NEGLIGIBLE * largest else bar for bar in every]
    return [bar for k, bar in enumerate(every) if k < 2 or bar.value]


def _all(derivatives: Sensitivity, problem: Problem) -> Iterator[Bar]:
    shift, turn = rounded_down(STEP * problem.length), rounded_down(math.degrees(STEP))
    length, percent = measured(f"+{shift:.3g}", problem.unit), f"+{STEP:.0%}".replace("%", " %")
    names = [name_of(problem, k) for k in (0, 1)]
    for body, value, size in zip(names, derivatives.target.tolist(), problem.target.tolist(), strict=True):
        yield Bar(f"overall size of {body}", STEP * size * value, percent, OVERALL)
    if derivatives.nominal.any():
        for body, value, size in zip(names, derivatives.nominal.tolist(), problem.nominal_pair.tolist(), strict=True):
            yield Bar(f"nominal size of {body}", STEP * size * value, percent, "nominal and made sizes alike")
    if derivatives.tolerance is not None:
        for body, row in zip(names, derivatives.tolerance.tolist(), strict=True):
            for sign, value in zip("-+", row, strict=True):
                yield Bar(f"tolerance {sign} of {body}", STEP * value, f"+{STEP:g}", TOLERANCES)
    labels = {name: _in_words(name, kind) for name, kind in problem.motion.parameters}
    for (name, kind), (low, high) in zip(problem.motion.parameters, problem.limits.tolist(), strict=True):
        rotates = kind != "translation"
        step, unit = (math.radians(turn), f"+{turn:g} deg") if rotates else (shift, length)
        for side, value in zip(("lower", "upper"), derivatives.limits[name], strict=True):
            if side == "lower" or low != high:  # equal limits are one datum
                yield Bar(f"{side} limit of the {labels[name]}", step * value, unit, "limits of the motion, raised")
    yield Bar("clearance", shift * derivatives.clearance, length, "clearances asked for")
    for name, value in derivatives.keep_out.items():
        yield Bar(f"clearance from {name}", shift * value, length, "clearances asked for")
    for own in problem.sizes:
        step, unit, note = (shift, length, NAMED) if own.is_length else (STEP, percent, NAMED)
        if own.tolerance is not None and own.half > 0.0:
            step, note = own.half, HALF
            unit = measured(f"+{step:.4g}", problem.unit) if own.is_length else f"+{step:.3%}".replace("%", " %")
        yield Bar(f"{own.name} of {names[own.body == 'static']}", step * derivatives.sizes[own.name], unit, note)
    for name, weight in problem.motion.by_name(problem.weights).items():
        change = STEP * weight * derivatives.weights[name]
        yield Bar(f"weight of the {labels[name]}", change, percent, "weights in the amount")
    of_faces = dict[str, float]()  # of a round face as facets that of all of these together
    for label, value in derivatives.faces.items():
        name = _name_of(problem, label)
        of_faces[name] = of_faces.get(name, 0.0) + value
    if any(map(is_round, of_faces)) and on_true_faces(problem):  # facets do not say how true faces move: sizes do
        of_faces = {name: value for name, value in of_faces.items() if not is_round(name)}
    for name, value in _largest(of_faces):
        yield Bar(name, shift * value, length, SHIFTED)
    if np.isnan(list(derivatives.faces.values())).any():
        for label, value in _largest({name: float(np.linalg.norm(x)) for name, x in derivatives.vertices.items()}):
            yield Bar(_name_of(problem, label), shift * value, length, MOVED)
    for label, value in _largest({name: float(np.linalg.norm(x)) for name, x in derivatives.seeds.items()}):
        yield Bar(f"seed of {_name_of(problem, label)}", shift * value, length, MOVED)


def _in_words(name: str, kind: str) -> str:
    """Return a parameter of a motion in words: "shift along x" for TX, "turn about z no. 2" for RZ_2."""
    known = re.fullmatch(r"[TR](-?[XYZ])(?:_(\d+))?", name)
    does, line = ("shift", "along") if kind == "translation" else ("turn", "about")
    return f"{does} {line} {known[1].lower()}{f' no. {known[2]}' * bool(known[2])}" if known else f"{does} {name}"


def _largest(values: Mapping[str, float]) -> list[tuple[str, float]]:
    """Return names and values, the largest first, without those that have no derivative."""
    return sorted(((name, x) for name, x in values.items() if math.isfinite(x)), key=lambda item: -abs(item[1]))
