"""The compensation map: how much motion the sizes made need, and what holds it where; and the yield of a fit."""

from __future__ import annotations

import math
from itertools import combinations, pairwise, product
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.units import measured, number_text
from fcdm_opt.problem.problem import SCALES, SIGNS
from fcdm_opt.show import BLACK, BLUE, DARK, GREY, NOTE, ORANGE, PAGE, VERMILLION, Figure, styled
from fcdm_opt.show.grids import units_over
from fcdm_opt.show.lettering import INDENT, Sheet, fitted, literal
from fcdm_opt.show.plots import plane
from fcdm_opt.show.printing import wrapped
from fcdm_opt.show.texts import NOTHING, share_text
from fcdm_opt.show.verdict import labels_in_words
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.design.compensation.assembly_yield import AssemblyYield
    from fcdm_opt.design.compensation.compensation_map import CompensationMap, MapRegion
    from fcdm_opt.problem.scene import Scene

FINE, SHADES, LEVELS, TICKS, LISTED, SHARE = 240, 48, 10, 6, 12, 0.004
"""Points a side at which a map is drawn, shades and contours of the amount, ticks at their colours, regions that are
listed, and the share of the box below which one gets no number in the picture."""

WIDTH, MARK = 0.65, 9.0
"""Of a digit, relative to its height; and how far an amount on a contour line keeps from what is marked, points."""

MARGIN, BOTTOM, SIDE, GAP = 0.72, 0.38, 2.75, 0.18
"""Where the axes are, in inches from the lower left, how long a side of them all is, and what panels are apart."""

UPRIGHT = 0.4  # inches more below panels: there is no room for their numbers side by side
HIGHEST, WIDEST, NAMED = 1.18, 1.25, 22
"""How far the axes go, relative to the highest bar and to a share of 1: room for the words there; and letters beside
bars."""

STAR = {"marker": "*", "markersize": 9, "markerfacecolor": "white", "markeredgecolor": BLACK, "zorder": 6}
NUMBER: dict[str, Any] = {
    "ha": "center", "va": "center", "fontsize": NOTE, "zorder": 5,
    "bbox": {"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": BLACK, "linewidth": 0.8},
}  # fmt: skip

LOW = 0.2  # of the largest amount: of a least one above it colours begin there, else at 0
PLAIN = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"}
"""Behind words that lines go through."""

INDICES = (("by itself", BLUE, None), ("with all others", VERMILLION, "////"))
"""Kinds of shares of the variance: name, colour and hatch."""


@styled
def map_figure(sizes: CompensationMap, problem: Scene | None = None, *, title: str = "") -> Figure:
    """Draw the amount over the box of sizes with the boundaries of its regions; list what holds the motion in each.

    Over one size it is a curve. Over more than two each pair of them has a panel, a slice in which all others are as
    drawn, or nominal; in the middle of the box where that is outside it. Boundaries at which the motion jumps are
    double lines; where there is no motion, or none is known, the plane is hatched. Star: nominal pair, or as drawn; A
    to D: the corners of the box that the requirements of these letters ask for. With the `problem` that the map is of
    contacts are told by names of faces, not by labels.
    """
    kind = {1: "sizes", 2: "pairs"}.get(len(sizes.box), "sets of sizes")
    below = "; ".join([*_signs(sizes), f"{sizes.solved} {kind} solved and judged, largest error {sizes.error_text}"])
    several = len(sizes.box) > 2
    sheet = Sheet.of(PAGE, 3.2 + UPRIGHT * several, title=title, caption=below)
    named = zip(sizes.over, _units_at(sizes), strict=True)
    labels = [literal(name if several else f"{name} ({what})") for name, what in named]
    _draw_curve(sheet, sizes, labels[0]) if len(labels) == 1 else _draw_panels(sheet, sizes, labels)
    lines = []
    for number, region in enumerate(sizes.regions[:LISTED], 1):
        least, largest = region.amounts
        low, high = number_text(least, 4), number_text(largest, 4)
        upto = measured(high, sizes.unit)
        amount = "" if np.isnan(least) else f", amount {upto}" if low == high else f", amount {low} to {upto}"
        lines.append(f"{number}  {100 * region.share:.3g} % of the box{amount}")
        lines.append(f"{INDENT}{region if problem is None else labels_in_words(str(region), problem)}")
    if len(sizes.regions) > LISTED:
        lines.append(f"and {len(sizes.regions) - LISTED} more")
    sheet.list(4.42, sheet.size[1] - 0.07, PAGE - 4.42 - 0.1, lines)
    return sheet.figure


def _units_at(sizes: CompensationMap) -> list[str]:
    """Return what the numbers at an axis are, for each size."""
    units = (f", {unit}" if unit else "" for unit in units_over(sizes))
    return ["1 as drawn" if scale else f"off drawn{unit}" for unit, scale in zip(units, sizes.scaled, strict=True)]


def _signs(sizes: CompensationMap) -> list[str]:
    """Return what stands for what in the picture, of that which is there."""
    scales, box = sizes.over == SCALES, np.asarray(sizes.box)
    top, constant = max((own.amounts[1] for own in sizes.regions), default=0.0), _constant(sizes)
    numbers = " or ".join(dict.fromkeys(_units_at(sizes)))
    plane, several, inside = len(box) == 2, len(box) > 2, _within(sizes.nominal, box)
    signs = {
        f"each panel: two sizes ({numbers}), all others {'as at the star' if inside else 'in the middle'}": several,
        f"one amount everywhere: {measured(top, sizes.unit, 4)}": constant,
        "thin lines: equal amounts": len(box) > 1 and top > 0.0 and not constant,
        f"star: {'nominal sizes' if scales else 'as drawn'}": inside,
        "diamonds A to D: corners that these requirements ask for": scales,
        "double line: the motion jumps there": plane and any(own.jumps for own in sizes.boundaries),
        "thick line: another contact, or limit, holds the motion": any(
            not (plane and own.jumps) for own in sizes.boundaries
        ),
        "hatched: no motion, or none known": any(np.isnan(own.amounts[0]) for own in sizes.regions),
    }
    return [text for text, there in signs.items() if there]


def _constant(sizes: CompensationMap) -> bool:
    """Tell whether all sizes with a motion need the same amount, to the digits that are shown."""
    return len({number_text(end, 4) for own in sizes.regions for end in own.amounts if np.isfinite(end)}) == 1


def _within(point: Any, box: Any) -> bool:
    return bool(((box[:, 0] <= point) & (point <= box[:, 1])).all())


def _draw_curve(sheet: Sheet, sizes: CompensationMap, label: str) -> None:
    """Draw the amount over one size; a number stands above the middle of each region."""
    axes, (low, high) = sheet.axes(MARGIN, BOTTOM, SIDE, SIDE), np.asarray(sizes.box)[0]
    ends = np.unique([low, high, *(x for own in sizes.boundaries for x in own.points.ravel())])
    places = np.unique([np.linspace(a, b, FINE) for a, b in pairwise(ends)])
    amount = sizes.at(places).amount
    top, nothing = _top(np.nanmax(amount, initial=0.0)), np.isnan(amount)
    axes.fill_between(places, 0.0, HIGHEST * top, where=nothing, facecolor="white", edgecolor=GREY, hatch="//")
    axes.plot(places, amount, color=BLUE)
    for boundary in sizes.boundaries:
        axes.axvline(float(boundary.points[0, 0]), color=BLACK, linewidth=1.0)
    for number, region in _numbered(sizes):
        axes.text(float(region.place[0]), 0.5 * (1.0 + HIGHEST) * top, str(number), **NUMBER)
    if _within(sizes.nominal, np.asarray(sizes.box)):
        axes.plot(*sizes.nominal, sizes.at(*sizes.nominal).amount, clip_on=False, **STAR)
    axes.set(xlim=(low, high), ylim=(0.0, HIGHEST * top), xlabel=label)
    axes.set_ylabel(f"amount of the smallest motion ({sizes.unit or 'length units'})")


def _draw_panels(sheet: Sheet, sizes: CompensationMap, labels: list[str]) -> None:
    """Draw the amount over two sizes, or a slice for each two of more."""
    box, last = np.asarray(sizes.box), len(labels) - 1
    middle = np.asarray(sizes.nominal) if _within(sizes.nominal, box) else box.mean(axis=1)
    side, foot = (SIDE - (last - 1) * GAP) / last, BOTTOM + UPRIGHT * (last > 1)
    panels = []
    for pair in combinations(range(last + 1), 2):
        ends, (i, j) = box[list(pair)], pair
        axes = sheet.axes(MARGIN + i * (side + GAP), foot + (last - j) * (side + GAP), side, side)
        plane(axes, ends + np.outer(0.04 * np.ptp(ends, axis=1), [-1.0, 1.0]))
        axes.grid(visible=False)
        if sizes.over != SCALES:
            lines = [fitted(sheet.figure, labels[k], NOTE, side) if last > 1 else [labels[k]] for k in pair]
            x, y = ("\n".join(own if len(own) < 3 else [own[0], f"{own[1]} ..."]) for own in lines)
            axes.set(xlabel=x if j == last else "", ylabel=y if i == 0 else "")
        if last > 1:
            axes.locator_params(nbins=3 if last < 4 else 2)
            axes.tick_params(labelbottom=j == last, labelleft=i == 0)
            axes.tick_params("x", labelrotation=90)
            for axis in (axes.xaxis, axes.yaxis):
                axis.labelpad = 1.5
                axis.label.set_fontsize(NOTE)
        grid = np.meshgrid(*(np.linspace(low, high, FINE // last) for low, high in ends))
        points = sizes.at(*(grid[pair.index(k)] if k in pair else middle[k] for k in range(last + 1)))
        panels.append((axes, pair, grid, np.ma.masked_invalid(points.amount), points.region))
    each = [amount for *_, amount, _ in panels if amount.count()]
    top = _top(max((float(amount.max()) for amount in each), default=0.0))
    least = min((float(amount.min()) for amount in each), default=0.0)
    scale = least if LOW * top < least and not _constant(sizes) else 0.0, top
    filled = None
    for axes, pair, grid, amount, region in panels:
        marked = [np.asarray(sizes.nominal), *(own.place for _, own in _numbered(sizes))] if last == 1 else None
        filled = _fill(axes, box[list(pair)], grid, amount, scale, marked) or filled
        if last > 1:
            for number in range(len(sizes.regions)):
                if 0 < np.count_nonzero(region == number) < region.size:
                    axes.contour(*grid, region == number, levels=[0.5], colors=BLACK, linewidths=1.0, zorder=3)
            _mark(axes, sizes, pair)
    if last == 1:
        axes = panels[0][0]
        for boundary in sizes.boundaries:
            for colour, width in ((BLACK, 3.2), ("white", 1.6)) if boundary.jumps else ((BLACK, 1.0),):
                axes.plot(*boundary.points.T, color=colour, linewidth=width, zorder=3, solid_capstyle="butt")
        _mark(axes, sizes, (0, 1))
        for number, own in _numbered(sizes):
            axes.text(*own.place, str(number), **NUMBER)
    if filled is None or _constant(sizes):
        return
    bar = sheet.axes(MARGIN + SIDE + 0.08, foot, 0.09, SIDE)
    sheet.figure.colorbar(filled, cax=bar, format="%.3g", ticks=_levels(*scale, TICKS))
    bar.set_ylabel(f"amount of the smallest motion ({sizes.unit or 'length units'})")


def _levels(least: float, top: float, count: int) -> Array:
    """Return round amounts from the least to the largest, `count` of them at most but for both ends."""
    from matplotlib.ticker import MaxNLocator

    values = np.asarray(MaxNLocator(count).tick_values(least, top))
    return values[(values >= least * (1.0 - DEFAULT.cut)) & (values <= top * (1.0 + DEFAULT.cut))]


def _top(largest: float) -> float:
    """Return up to where amounts have an axis: the largest, and 1 where all are 0, as no axis ends where it begins."""
    return float(largest) if largest > NOTHING else 1.0


def _numbered(sizes: CompensationMap) -> list[tuple[int, MapRegion]]:
    """Return the regions that get a number in the picture, with it."""
    return [(k, own) for k, own in enumerate(sizes.regions[:LISTED], 1) if own.share >= SHARE]


def _fill(axes: Any, box: Any, grid: Any, amount: Any, ends: tuple[float, float], marked: list[Array] | None) -> Any:
    """Fill a box of two sizes by amount, with contour lines; return what colours stand for, None without any.

    `ends` are the least and the largest amount that has a colour.

    Where it is known which places are marked, each piece of a line has its amount written on it, where it is farthest
    from these, the edges, and amounts written before, if it covers none of these.
    """
    from matplotlib.patches import Rectangle
    from matplotlib.patheffects import withStroke

    low, high = box[:, 0], box[:, 1]
    axes.add_patch(Rectangle(tuple(low), *(high - low), facecolor="white", edgecolor=GREY, hatch="//", zorder=0.5))
    if amount.count() == 0:
        return None
    filled = axes.contourf(*grid, amount, levels=np.linspace(*ends, SHADES + 1), cmap="cividis", zorder=1)
    levels = [x for x in _levels(*ends, LEVELS) if x]
    lines = axes.contour(*grid, amount, levels=levels, colors="white", linewidths=0.5, alpha=0.8, zorder=2)
    if marked is None:
        return filled
    point = 1.0 / (72.0 * SIDE)
    taken = [((place - low) / (high - low), MARK * point) for place in (*marked, *product(*box))]
    given = len(taken)
    for level, own in zip(lines.levels, lines.get_paths(), strict=True):
        half = (0.5 * WIDTH * len(f"{level:.3g}") + 1.0) * NOTE * point  # however it is turned
        first = np.flatnonzero(own.codes == own.MOVETO) if len(own.vertices) else ()
        for piece in np.split(own.vertices, first)[1:]:
            spots = (piece - low) / (high - low)
            room = np.min([np.linalg.norm(spots - place, axis=1) - size for place, size in taken], axis=0)
            room = np.minimum(room, 2.0 * np.minimum(spots, 1.0 - spots).min(axis=1))
            if room.max() >= half:
                taken.append((spots[room.argmax()], half))
    places = [tuple(low + spot * (high - low)) for spot, _ in taken[given:]]
    for text in axes.clabel(lines, fmt="%.3g", fontsize=NOTE, inline_spacing=2, manual=places) if places else ():
        text.set(color=BLACK, alpha=1.0, path_effects=[withStroke(linewidth=1.6, foreground="white")])
    return filled


def _mark(axes: Any, sizes: CompensationMap, pair: tuple[int, int]) -> None:
    """Mark the nominal sizes and the corners that the requirements ask for."""
    box = np.asarray(sizes.box)
    for name, signs in SIGNS.items() if sizes.over == SCALES else ():
        corner = np.where(np.asarray(signs) > 0, box[:, 1], box[:, 0])
        axes.plot(*corner, marker="D", markersize=4.5, markerfacecolor="white", markeredgecolor=VERMILLION, zorder=6)
        shift = -9 * np.sign(corner - box.mean(axis=1))
        axes.annotate(name, tuple(corner), xytext=tuple(shift), textcoords="offset points", ha="center", va="center",
                      color=BLACK, zorder=6, bbox={"boxstyle": "square,pad=0.12", "facecolor": "white",
                                                   "edgecolor": "none", "alpha": 0.8})  # fmt: skip
    if _within(sizes.nominal, box):
        axes.plot(*np.asarray(sizes.nominal)[list(pair)], **STAR)


@styled
def yield_figure(result: AssemblyYield, *, title: str = "") -> Figure:
    """Draw how the amounts of all pairs are spread about the budget, and what each size's tolerance contributes."""
    more = 0.3 * max(len(result.contributions) - 2, 0)  # room for further sizes
    sheet = Sheet.of(PAGE, 2.95 + 2.0 * more, title=title, caption=str(result))
    amounts = sheet.axes(0.55, 0.65, 3.0, 2.2 + 2.0 * more)
    _draw_amounts(amounts, result)
    _draw_indices(sheet.axes(4.75, 1.85 + more, 1.8, 0.72 + more), result)
    _draw_shares(sheet.axes(4.75, 0.4, 1.8, 0.85 + more), result)
    handles, labels = amounts.get_legend_handles_labels()
    if handles:
        x, y, *_ = sheet.place(2.05, 0.0, 0.0, 0.0)
        sheet.figure.legend(handles, labels, loc="lower center", bbox_to_anchor=(x, y), ncols=3, borderaxespad=0.2,
                            handlelength=1.6, columnspacing=1.2)  # fmt: skip
    return sheet.figure


def _draw_amounts(axes: Any, result: AssemblyYield) -> None:
    """Draw the histogram of the amount, with the budget and quantiles."""
    edges, heights = result.amounts, result.counts / result.count
    within = (edges[:-1] + edges[1:]) / 2.0 <= result.budget
    below = "within the budget" if math.isfinite(result.budget) else "pairs with a motion"
    for chosen, colour, name in ((within, BLUE, below), (~within, VERMILLION, "beyond the budget")):
        if (heights[chosen] > 0.0).any():
            wide = np.diff(edges)[chosen]
            axes.bar(edges[:-1][chosen], heights[chosen], wide, align="edge", color=colour, label=name)
    highest = max(float(heights.max()), 1.0 / result.count)
    axes.set_ylim(0.0, HIGHEST * highest)
    if math.isfinite(result.budget):
        budget = measured(result.budget, result.unit)
        axes.axvline(result.budget, color=BLACK, linewidth=1.2, label=f"budget {budget}")
    for share, amount in result.quantiles.items():
        if math.isfinite(amount):
            axes.axvline(amount, color=GREY, linewidth=0.6, linestyle=":")
            axes.annotate(f"{share:.4g}".lstrip("0"), (amount, HIGHEST * highest), xytext=(-1.5, -2),
                          textcoords="offset points", ha="right", va="top", rotation=90, fontsize=NOTE,
                          color=DARK, zorder=5, bbox=PLAIN)  # fmt: skip
    axes.set_xlim(max(axes.get_xlim()[0], 0.0))
    axes.set_xlabel(f"amount of the motion ({result.unit or 'length units'})")
    axes.set_ylabel("share of all pairs in a bin")
    if not heights.any():
        axes.text(0.5, 0.5, "no pair has a motion", transform=axes.transAxes, ha="center", color=DARK)


def _draw_indices(axes: Any, result: AssemblyYield) -> None:
    """Draw first-order and total indices of each size."""
    from matplotlib.patches import Patch

    for row, share in enumerate(result.contributions):
        bars = (share.first_order, share.first_order_error), (share.total, share.total_error)
        for offset, (value, error), (_, colour, hatch) in zip((-0.2, 0.2), bars, INDICES, strict=True):
            known = math.isfinite(value)
            if known:
                axes.barh(row + offset, value, 0.38, xerr=error, color=colour, hatch=hatch, edgecolor="white",
                          linewidth=0.0, error_kw={"linewidth": 0.8})  # fmt: skip
            _number(axes, row + offset, value + error if known else 0.0, f"{value:.3f}" if known else "none")
    axes.set_title("share of the amount's variance", loc="left", pad=14)
    keys = [Patch(facecolor=colour, hatch=hatch, edgecolor="white", label=name) for name, colour, hatch in INDICES]
    axes.legend(handles=keys, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.0, borderpad=0.2,
                handlelength=1.6, columnspacing=1.0)  # fmt: skip
    _rows(axes, [share.body for share in result.contributions])


def _draw_shares(axes: Any, result: AssemblyYield) -> None:
    """Draw the yield as it is, and with one size held at its median."""
    shares = [result.share, *(body.share_without for body in result.contributions)]
    low, high = result.interval
    for row, (share, end) in enumerate(zip(shares, (high, *shares[1:]), strict=True)):
        axes.barh(row, share, 0.6, color=GREY if row else BLACK)
        _number(axes, row, np.nan_to_num(end), share_text(share))
    axes.plot([low, high], [0, 0], color=ORANGE, linewidth=2.5, solid_capstyle="butt")
    axes.set_title("pairs that pass", loc="left")
    _rows(axes, ["as it is", *(f"{body.body} at its median" for body in result.contributions)])


def _number(axes: Any, row: float, end: float, text: str) -> None:
    axes.text(max(end, 0.0) + 0.02, row, text, va="center", fontsize=NOTE)


def _rows(axes: Any, names: list[str]) -> None:
    """Name the bars, from the top."""
    axes.set_yticks(range(len(names)), [literal(wrapped(name, NAMED)) for name in names])
    axes.set(ylim=(len(names) - 0.5, -0.5), xlim=(0.0, WIDEST), xticks=[0.0, 0.25, 0.5, 0.75, 1.0])
    axes.spines[["top", "right"]].set_visible(False)
