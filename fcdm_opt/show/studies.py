"""What a study found: the amount over what was varied."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.units import measured
from fcdm_opt.show import BLACK, BLUE, DARK, GREEN, ORANGE, PAGE, PURPLE, VERMILLION, Figure, styled
from fcdm_opt.show.lettering import Sheet, literal
from fcdm_opt.show.texts import listed, shortened, status_text

if TYPE_CHECKING:
    from fcdm_opt.design.study.results import StudyResult

COLOURS, DASHES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, BLACK), ("-", "--", "-.", ":", (0, (5, 1, 1, 1)))
SPOTS, GAPS = ".od^sv<", "xv^s*PD"
"""Markers of points with a usable motion, one a line, and of those without, one a status."""

UNITS = {"deg": "degrees", "rad": "radians", "mm": "mm"}  # units that stand at the end of a key, and how they are told
PLAIN_NUMBERS = {"tolerance": "relative; 0.01 = 1 %", "target": "scale; 1 = as drawn", "nominal": "scale; 1 = as drawn"}
"""Keys of numbers without unit, and what these are."""

COLUMNS = 4  # of the legend

FEW, PANELS, NAME = 6, 6, 28
"""Values of a second axis that are lines of one picture rather than a field; panels of a figure; letters of a name."""

DECADES, EVEN = 1.5, 1e-6
"""Amounts over this many powers of ten get a logarithmic axis, and so do grids whose ratios differ by at most this."""

LEFT, RIGHT, ABOVE, BELOW, ACROSS, BAR = 0.55, 0.15, 0.22, 0.4, 0.12, 0.8
"""Inches beside the panels, above each for its name, below each for its label, between two of them, and beside them for
a scale of colours."""

WIDE, HIGH, ONE = 4.8, 1.5, 2.7
"""Inches: width of a panel that stands alone, least height of one of several, and that of one."""

KEY, LETTERS, KEY_MARK = 0.15, 112, 9
"""Inches that a line of the legend is high; letters that fit into it, and what goes with each key counts as so many."""

POINTS = "points worked out"


class _StudyAxis(NamedTuple):
    """What a study varied: its label, its values, and the dimension of the results that it is."""

    label: str
    values: Sequence[Any]
    place: int

    @property
    def numeric(self) -> bool:
        return len(self.values) > 1 and all(type(value) in (int, float) for value in self.values)


@styled
def study_figure(result: StudyResult) -> Figure:
    """Draw the amount over what a study varied.

    Over one numeric axis: a line for each other value, a panel for each case where there is more besides. Over two
    numeric axes with many values: a field for each. For draws, and where nothing is a number: the share of points whose
    amount is at most so much, a line for each other value. Points without a usable motion are marked by status.
    Above it stands the study's title, below it how its points ended.
    """
    axes = [_StudyAxis(label, values, place) for place, (label, values) in enumerate(result.axes.items())]
    numeric = sorted((axis for axis in axes if axis.numeric), key=lambda axis: -len(axis.values))
    data = _StudyAmounts.of(result)
    counts = ", ".join(f"{count} {status_text(status)}" for status, count in result.counts.items())
    title = result.definition.get("title") or f"Amount over {listed([axis_text(axis.label) for axis in axes])}"
    words = title, f"{len(result.points)} points: {counts}"
    if "draw" in result.axes or not numeric:
        drawn = [axis for axis in axes if len(axis.values) <= FEW and axis.label != "draw" and "draw" in result.axes]
        return _shares(data, drawn or [axis for axis in axes if axis.label == "case"], result, words)
    if len(numeric) > 1 and len(numeric[1].values) > FEW:
        return _fields(data, numeric[0], numeric[1], [axis for axis in axes if axis not in numeric[:2]], words)
    return _lines(data, numeric[0], [axis for axis in axes if axis is not numeric[0]], words)


class _StudyAmounts(NamedTuple):
    """Amounts (nan without a usable motion) and statuses, over the axes of the study; label of an axis of amounts."""

    amounts: Array
    statuses: Array
    amount: str

    @classmethod
    def of(cls, result: StudyResult) -> _StudyAmounts:
        shape = [len(values) for values in result.axes.values()]
        rows = result.rows()
        return cls(
            np.array([row["amount"] if row["usable"] else math.nan for row in rows], dtype=float).reshape(shape),
            np.array([row["status"] for row in rows], dtype=object).reshape(shape),
            f"amount ({result.unit or 'length units'})",
        )

    def at(self, axes: Sequence[_StudyAxis], places: Sequence[int]) -> _StudyAmounts:
        """Return what is left where some axes have a given value."""
        chosen = dict(zip((axis.place for axis in axes), places, strict=True))
        index = tuple(chosen.get(place, slice(None)) for place in range(self.amounts.ndim))
        return self._replace(amounts=self.amounts[index], statuses=self.statuses[index])


def _lines(data: _StudyAmounts, along: _StudyAxis, others: Sequence[_StudyAxis], words: tuple[str, str]) -> Figure:
    """Draw the amount along one axis: the first of several other axes makes panels, the rest makes lines."""
    panels, lines = (others[:1], others[1:]) if len(others) > 1 and len(others[0].values) <= PANELS else ([], others)
    markers = _markers(data)
    keys = [*(name for _, name in _combinations(lines)), *map(status_text, markers)]
    sheet, spots = _panels(panels, (axis_text(along.label), data.amount), words, keys)
    for place, axes in spots:
        for k, (at, name) in enumerate(_combinations(lines)):
            part = data.at([*panels, *lines], [*place, *at])
            axes.plot(along.values, part.amounts, marker=SPOTS[k % len(SPOTS)], markersize=2.8, label=name, **_look(k))
            for status, marker in markers.items():
                where = np.asarray(along.values)[part.statuses == status]
                height = np.full(len(where), 0.02 + 0.03 * (k % 10))  # beside each other, not upon
                if len(where):
                    axes.plot(where, height, marker, color=_look(k)["color"], markersize=4,
                              transform=axes.get_xaxis_transform(), clip_on=False)  # fmt: skip
        if _geometric(along.values):
            axes.set_xscale("log")
        axes.margins(x=0.02)
    highest = max(axes.get_ylim()[1] for _, axes in spots)
    for _, axes in spots:
        axes.set_ylim(0.0, highest)
    return _keyed(sheet, spots[0][1], markers)


def _fields(
    data: _StudyAmounts, along: _StudyAxis, across: _StudyAxis, others: Sequence[_StudyAxis], words: tuple[str, str]
) -> Figure:
    """Draw the amount over two axes as a field, one for each value of the other axes."""
    from matplotlib.colors import Normalize

    markers = _markers(data)
    labels = axis_text(along.label), axis_text(across.label)
    sheet, spots = _panels(others, labels, words, [*map(status_text, markers)], margin=BAR)
    known = data.amounts[np.isfinite(data.amounts)]
    scale = Normalize(0.0, float(known.max()) if known.size else 1.0)
    for place, axes in spots:
        part = data.at(others, place)
        turned = along.place < across.place
        amounts, statuses = (values.T if turned else values for values in part[:2])
        image = axes.pcolormesh(along.values, across.values, amounts, norm=scale, cmap="cividis", shading="nearest")
        for status, marker in markers.items():
            rows, columns = np.nonzero(statuses == status)
            axes.plot(
                np.asarray(along.values)[columns], np.asarray(across.values)[rows],
                marker, color=VERMILLION, markersize=4, linestyle="none",
            )  # fmt: skip
        axes.grid(visible=False)
    places = [axes.get_position() for _, axes in spots]
    bottom, top = min(place.y0 for place in places), max(place.y1 for place in places)
    right = max(place.x1 for place in places)
    bar = sheet.figure.add_axes((right + 0.12 / PAGE, bottom, 0.09 / PAGE, top - bottom))
    sheet.figure.colorbar(image, cax=bar).set_label(data.amount)
    return _keyed(sheet, spots[0][1], markers)


def _shares(data: _StudyAmounts, cases: Sequence[_StudyAxis], result: StudyResult, words: tuple[str, str]) -> Figure:
    """Draw the share of points whose amount is at most so much, a line for each other value, with the budget."""
    label, within = "", result.assembly_yield
    if within is not None:
        ends = " ({:.1%} to {:.1%})".format(*within.interval) if within.interval else ""
        budget = measured(f"{within.budget:g}", result.unit)
        label = f"budget {budget}: {within.share:.1%} within{ends}"
    keys = [*(name or POINTS for _, name in _combinations(cases)), *filter(None, [label])]
    sheet, ((_, axes), *_) = _panels([], (data.amount, "share of points with at most this amount"), words, keys)
    for k, (at, name) in enumerate(_combinations(cases)):
        part = data.at(cases, at)
        known = np.sort(part.amounts[np.isfinite(part.amounts)])
        if known.size:
            share = np.arange(1, known.size + 1) / int(np.count_nonzero(part.statuses != "PENDING"))
            axes.step([known[0], *known], [0.0, *share], where="post", label=name or POINTS, **_look(k))
    if within is not None:
        axes.axvline(within.budget, color=DARK, linestyle=(0, (2, 2)), linewidth=1.0, label=label)
    known = data.amounts[np.isfinite(data.amounts)]
    if known.size and known.min() > 0.0 and math.log10(known.max() / known.min()) > DECADES:
        axes.set_xscale("log")
    axes.set(ylim=(0.0, 1.02))
    return _keyed(sheet, axes, {})


def _look(k: int) -> dict[str, Any]:
    """Return colour and dashes of the k-th line."""
    return {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[(k + k // len(COLOURS)) % len(DASHES)]}


def _panels(
    axes: Sequence[_StudyAxis],
    labels: tuple[str, str],
    words: tuple[str, str],
    keys: Sequence[str],
    *,
    margin: float = 0.0,
) -> tuple[Sheet, list[tuple[list[int], Any]]]:
    """Return a sheet with a panel for each combination of values, and their places; room below for keys.

    What is across and up, `labels`, stands at the lowest panels and the first ones; ticks keep off the next panel's.
    """
    from matplotlib.ticker import MaxNLocator

    spots = list(_combinations(axes))[:PANELS]
    columns = min(len(spots), 3 if len(spots) > 4 else 2)
    rows = math.ceil(len(spots) / columns)
    width = (PAGE - LEFT - RIGHT - margin - ACROSS * (columns - 1)) / columns
    width, height = (min(WIDE, width), ONE) if columns == 1 else (width, max(HIGH, 0.75 * width))
    across = min(COLUMNS, max(1, int(LETTERS / (max(map(len, keys), default=0) + KEY_MARK))))
    foot = KEY * math.ceil(len([key for key in keys if key]) / across) + 0.05
    step = height + (ABOVE if axes else 0.08)
    sheet = Sheet.of(PAGE, foot + BELOW + rows * step, title=words[0], caption=words[1])
    left = LEFT if columns > 1 else (PAGE - width - margin) / 2 + 0.1
    made: list[tuple[list[int], Any]] = []
    for k, (place, name) in enumerate(spots):
        row, column = divmod(k, columns)
        panel = sheet.axes(left + column * (width + ACROSS), foot + BELOW + (rows - 1 - row) * step, width, height)
        panel.set_title(literal(name))
        panel.grid(visible=True)
        lowest = k + columns >= len(spots)
        panel.set_ylabel(literal(labels[1]) if column == 0 else "")
        panel.set_xlabel(literal(labels[0]) if lowest else "")
        panel.tick_params(labelleft=column == 0, labelbottom=lowest)
        if columns > 1:
            panel.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10], prune="both"))
        made.append((place, panel))
    return sheet, made


def _combinations(axes: Sequence[_StudyAxis]) -> Iterator[tuple[list[int], str]]:
    """Yield the places of every combination of values, and its name; one without a name where there are no axes."""
    for place in product(*(range(len(axis.values)) for axis in axes)):
        texts = [_value(axis, axis.values[k]) for axis, k in zip(axes, place, strict=True)]
        yield list(place), ", ".join(texts)


def _value(axis: _StudyAxis, value: Any) -> str:
    if type(value) in (int, float):
        return f"{axis.label} = {value:g}"
    text = ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)
    named = f"case {text}" if axis.label == "case" else text if isinstance(value, str) else f"{axis.label}: {text}"
    return shortened(named, NAME)


def axis_text(label: str) -> str:
    """Return the label of an axis with its unit, which a key says at its end, or with what it is relative to."""
    last = label.replace("]", "").split("_")[-1]
    if last in UNITS and "_" in label:
        return f"{label}  ({UNITS[last]})"
    plain = PLAIN_NUMBERS.get(label.split("[")[0].split(".")[0])
    return f"{label}  ({plain})" if plain else label


def _markers(data: _StudyAmounts) -> dict[str, str]:
    """Return a marker for each status that leaves gaps."""
    gaps = sorted(set(data.statuses[np.isnan(data.amounts)].tolist()))
    return {status: GAPS[k % len(GAPS)] for k, status in enumerate(gaps)}


def _keyed(sheet: Sheet, axes: Any, markers: Mapping[str, str]) -> Figure:
    """Return the figure with its legend: what one panel shows, and a marker for each status."""
    from matplotlib.lines import Line2D

    handles, labels = axes.get_legend_handles_labels()
    named = [(handle, label) for handle, label in zip(handles, labels, strict=True) if label]
    for status, marker in markers.items():
        named.append((Line2D([], [], color=DARK, marker=marker, linestyle="none", markersize=3.5), status_text(status)))
    sheet.legend(*([each[k] for each in named] for k in (0, 1)), bottom=0.02, most=COLUMNS)
    return sheet.figure


def _geometric(values: Sequence[float]) -> bool:
    """Tell whether a grid is even on a logarithmic axis."""
    if min(values) <= 0.0 or len(values) < 3:
        return False
    steps = np.diff(np.log(np.asarray(values, dtype=float)))
    return bool(np.ptp(steps) <= EVEN * np.abs(steps).max())
