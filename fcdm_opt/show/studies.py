"""What a study found: the amount over what was varied."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.show import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILLION, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fcdm_opt.design.study.results import StudyResult

COLOURS, DASHES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, BLACK), ("-", "--", "-.", ":", (0, (5, 1, 1, 1)))
GAPS = "xv^s*PD"
"""Markers of points without a usable motion, one a status."""

AMOUNT = "amount (length units)"
UNITS = {"deg": "degrees", "rad": "radians", "mm": "mm"}
"""Units that stand at the end of a key, and how they are told."""

COLUMNS = 4  # of the legend

FEW, PANELS, NAME = 6, 6, 28
"""Values of a second axis that are lines of one picture rather than a field; panels of a figure; letters of a name."""

DECADES, EVEN = 1.5, 1e-6
"""Amounts over this many powers of ten get a logarithmic axis, and so do grids whose ratios differ by at most this."""

HEAD, FOOT, LINE = 0.65, 0.85, 0.2
"""Inches above the panels, below them, and for each line of the legend."""


class _Axis(NamedTuple):
    """What a study varied: its label, its values, and the dimension of the results that it is."""

    label: str
    values: Sequence[Any]
    place: int

    @property
    def numeric(self) -> bool:
        return len(self.values) > 1 and all(type(value) in (int, float) for value in self.values)


def study_figure(result: StudyResult, *, title: str = "", caption: str = "") -> Figure:
    """Draw the amount over what a study varied.

    Over one numeric axis: a line for each other value, a panel for each case where there is more besides. Over two
    numeric axes with many values: a field for each. For draws, and where nothing is a number: the share of points whose
    amount is at most so much. Points without a usable motion are marked by status.

    Parameters
    ----------
    result : StudyResult
    title, caption : str
        Text above and below the picture; by default the study's title, and how its points ended.
    """
    axes = [_Axis(label, values, place) for place, (label, values) in enumerate(result.axes.items())]
    numeric = sorted((axis for axis in axes if axis.numeric), key=lambda axis: -len(axis.values))
    data = _Data.of(result)
    if "draw" in result.axes or not numeric:
        figure = _shares(data, [axis for axis in axes if axis.label == "case"], result)
    elif len(numeric) > 1 and len(numeric[1].values) > FEW:
        figure = _fields(data, numeric[0], numeric[1], [axis for axis in axes if axis not in numeric[:2]])
    else:
        figure = _lines(data, numeric[0], [axis for axis in axes if axis is not numeric[0]])
    counts = ", ".join(f"{count} {_words(status)}" for status, count in result.counts.items())
    figure.suptitle(title or result.definition.get("title", ""), fontsize=11, y=0.975)
    figure.text(0.5, 0.02, caption or f"{len(result.points)} points: {counts}", ha="center", va="bottom", fontsize=8.5)
    return figure


class _Data(NamedTuple):
    """Amounts (nan without a usable motion) and statuses, over the axes of the study."""

    amounts: Array
    statuses: Array

    @classmethod
    def of(cls, result: StudyResult) -> _Data:
        shape = [len(values) for values in result.axes.values()]
        rows = result.rows()
        amounts = [row["amount"] if row["usable"] else math.nan for row in rows]
        return cls(
            np.array(amounts, dtype=float).reshape(shape),
            np.array([row["status"] for row in rows], dtype=object).reshape(shape),
        )

    def at(self, axes: Sequence[_Axis], places: Sequence[int]) -> _Data:
        """Return what is left where some axes have a given value."""
        chosen = dict(zip((axis.place for axis in axes), places, strict=True))
        index = tuple(chosen.get(place, slice(None)) for place in range(self.amounts.ndim))
        return _Data(self.amounts[index], self.statuses[index])


# ----------------------------------------------------------------------------------------------------- kinds of figures


def _lines(data: _Data, along: _Axis, others: Sequence[_Axis]) -> Figure:
    """Draw the amount along one axis: the first of several other axes makes panels, the rest makes lines."""
    panels, lines = (others[:1], others[1:]) if len(others) > 1 and len(others[0].values) <= PANELS else ([], others)
    figure, spots = _panels(panels, AMOUNT)
    markers = _markers(data)
    for place, axes in spots:
        own = data.at(panels, place)
        left = [axis._replace(place=axis.place - len(panels)) for axis in lines]
        for k, (at, name) in enumerate(_combinations(left)):
            part = own.at(left, at)
            colour = COLOURS[k % len(COLOURS)]
            style = DASHES[(k + k // len(COLOURS)) % len(DASHES)]
            axes.plot(along.values, part.amounts, color=colour, linestyle=style, marker=".", markersize=4, label=name)
            for status, marker in markers.items():
                where = [x for x, own_status in zip(along.values, part.statuses, strict=True) if own_status == status]
                if where:
                    height = [0.02 + 0.03 * (k % 10)] * len(where)  # beside each other, not upon
                    over = axes.get_xaxis_transform()
                    axes.plot(where, height, marker, color=colour, markersize=4, transform=over, clip_on=False)
        if _geometric(along.values):
            axes.set_xscale("log")
        axes.set_xlabel(_told(along.label), fontsize=9)
        axes.margins(x=0.02)
    spots[0][1].set_ylim(bottom=0.0)  # all panels share it: when all lines are drawn
    _legend(figure, spots[0][1], markers)
    return figure


def _fields(data: _Data, along: _Axis, across: _Axis, others: Sequence[_Axis]) -> Figure:
    """Draw the amount over two axes as a field, one for each value of the other axes."""
    from matplotlib.colors import Normalize

    figure, spots = _panels(others, _told(across.label), most=PANELS)
    markers = _markers(data)
    known = data.amounts[np.isfinite(data.amounts)]
    scale = Normalize(0.0, float(known.max()) if known.size else 1.0)
    for place, axes in spots:
        part = data.at(others, place)
        turned = along.place < across.place
        amounts, statuses = (values.T if turned else values for values in part)
        image = axes.pcolormesh(along.values, across.values, amounts, norm=scale, cmap="cividis", shading="nearest")
        for status, marker in markers.items():
            rows, columns = np.nonzero(statuses == status)
            axes.plot(
                np.asarray(along.values)[columns], np.asarray(across.values)[rows],
                marker, color=VERMILLION, markersize=4, linestyle="none",
            )  # fmt: skip
        axes.set_xlabel(_told(along.label), fontsize=9)
        axes.grid(False)
    _legend(figure, spots[0][1], markers)
    figure.colorbar(image, ax=[axes for _, axes in spots], pad=0.02).set_label(AMOUNT, fontsize=9)
    return figure


def _shares(data: _Data, cases: Sequence[_Axis], result: StudyResult) -> Figure:
    """Draw the share of points whose amount is at most so much, a line a case, with the budget."""
    figure, spots = _panels([], "share of points with at most this amount")
    (_, axes), *_ = spots
    for k, (at, name) in enumerate(_combinations(cases)):
        part = data.at(cases, at)
        known = np.sort(part.amounts[np.isfinite(part.amounts)])
        of = int(np.count_nonzero(part.statuses != "PENDING"))
        if known.size:
            share = np.arange(1, known.size + 1) / of
            axes.step(
                [known[0], *known], [0.0, *share], where="post",
                color=COLOURS[k % len(COLOURS)], linestyle=DASHES[(k + k // len(COLOURS)) % len(DASHES)],
                label=name or "points worked out",
            )  # fmt: skip
    found = result.assembly_yield
    if found is not None:
        low, high = found.interval
        text = f"budget {found.budget:g}: {found.share:.1%} within ({low:.1%} to {high:.1%})"
        axes.axvline(found.budget, color=GREY, linestyle=(0, (2, 2)), linewidth=1.2, label=text)
    known = data.amounts[np.isfinite(data.amounts)]
    if known.size and known.min() > 0.0 and math.log10(known.max() / known.min()) > DECADES:
        axes.set_xscale("log")
    axes.set(ylim=(0.0, 1.02))
    axes.set_xlabel(AMOUNT, fontsize=9)
    _legend(figure, axes, {})
    return figure


# ---------------------------------------------------------------------------------------------------- parts of a figure


def _panels(axes: Sequence[_Axis], label: str, *, most: int = PANELS) -> tuple[Figure, list[tuple[list[int], Any]]]:
    """Return a figure with a panel for each combination of values, and their places."""
    spots = list(_combinations(axes))[:most]
    columns = min(len(spots), 3 if len(spots) > 4 else 2)
    rows = math.ceil(len(spots) / columns)
    figure = new_figure(8.0 if columns == 1 else 4.4 * columns + 1.0, 5.4 if rows == 1 else 3.0 * rows + 1.6)
    made = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for spare in made[len(spots) :]:
        spare.set_visible(False)
    for k, ((_, name), panel) in enumerate(zip(spots, made, strict=False)):
        panel.set_title(name, fontsize=9)
        panel.tick_params(labelsize=8)
        panel.grid(color=GREY, alpha=0.2, linewidth=0.6)
        panel.set_axisbelow(True)
        if k % columns == 0:
            panel.set_ylabel(label, fontsize=9)
    return figure, [(place, panel) for (place, _), panel in zip(spots, made, strict=False)]


def _combinations(axes: Sequence[_Axis]) -> Iterator[tuple[list[int], str]]:
    """Yield the places of every combination of values, and its name; one without a name where there are no axes."""
    for place in product(*(range(len(axis.values)) for axis in axes)):
        told = [_value(axis, axis.values[k]) for axis, k in zip(axes, place, strict=True)]
        yield list(place), ", ".join(told)


def _value(axis: _Axis, value: Any) -> str:
    if type(value) in (int, float):
        return f"{axis.label} = {value:g}"
    text = value if isinstance(value, str) else ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)
    text = text if axis.label == "case" or isinstance(value, str) else f"{axis.label}: {text}"
    return text if len(text) <= NAME else f"{text[: NAME - 3]}..."


def _told(label: str) -> str:
    """Return the label of an axis with its unit: a key says its own, scales and tolerances have none."""
    last = label.replace("]", "").split("_")[-1]
    return f"{label}  ({UNITS[last]})" if last in UNITS and "_" in label else label


def _words(status: str) -> str:
    return status.replace("_", " ").lower()


def _markers(data: _Data) -> dict[str, str]:
    """Return a marker for each status that leaves gaps."""
    gaps = sorted(set(data.statuses[np.isnan(data.amounts)].tolist()))
    return {status: GAPS[k % len(GAPS)] for k, status in enumerate(gaps)}


def _legend(figure: Figure, axes: Any, markers: Mapping[str, str]) -> None:
    from matplotlib.lines import Line2D

    handles, labels = axes.get_legend_handles_labels()
    named = [(handle, label) for handle, label in zip(handles, labels, strict=True) if label]
    named += [
        (Line2D([], [], color=GREY, marker=marker, linestyle="none", markersize=5), _words(status))
        for status, marker in markers.items()
    ]
    lines = math.ceil(len(named) / COLUMNS)
    height = figure.get_figheight()
    bottom = (FOOT + LINE * lines) / height
    figure.subplots_adjust(left=0.09, right=0.97, top=1.0 - HEAD / height, bottom=bottom, hspace=0.25, wspace=0.08)
    if named:
        handles, labels = zip(*named, strict=True)
        place = (0.5, 1.6 * LINE / height)
        figure.legend(
            handles, labels, loc="lower center", bbox_to_anchor=place, ncols=COLUMNS, frameon=False, fontsize=8
        )


def _geometric(values: Sequence[float]) -> bool:
    """Tell whether a grid is even on a logarithmic axis."""
    if min(values) <= 0.0 or len(values) < 3:
        return False
    steps = np.diff(np.log(np.asarray(values, dtype=float)))
    return bool(np.ptp(steps) <= EVEN * np.abs(steps).max())
