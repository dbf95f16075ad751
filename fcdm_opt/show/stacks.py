"""Faces by name, and stack-ups: tables, and pictures of contributions, of the gap's spread and of slices of sizes."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fcdm_opt.curve.true_sizes import widened
from fcdm_opt.design.sizes import not_counted
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body, solids_notes
from fcdm_opt.geometry.facet_errors import round_surfaces, rounding_line
from fcdm_opt.geometry.naming import names_of_rows
from fcdm_opt.geometry.round_recognition import Label, radius_text, round_faces
from fcdm_opt.geometry.size import direction, direction_level
from fcdm_opt.geometry.tessellation import true_areas
from fcdm_opt.geometry.units import measured, signed
from fcdm_opt.problem.scene import Scene
from fcdm_opt.show import BLACK, BLUE, DARK, GREY, NOTE, PAGE, VERMILLION, Figure, styled
from fcdm_opt.show.lettering import Sheet, literal
from fcdm_opt.show.printing import print_rows, print_text, wrapped
from fcdm_opt.show.scene import COLOURS, ShownBodies, draw_directions, draw_numbered
from fcdm_opt.show.texts import numbers, shortened
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.design.stack.allocation import Allocation
    from fcdm_opt.design.stack.spread import GapYield
    from fcdm_opt.design.stack.stack_up import RootSumSquare, SizeShare, StackUp

MOST_LISTED = 200  # faces of a body that are printed
MOST_BARS, FINE, WIDER, CORNERS, LONGEST, SIZE = 12, 161, 1.5, 8, 64, 22
BEYOND = "* beyond the worst case, which holds for all pairs within their tolerances"
DRAWN, SCALED, DRAWN_ZERO, RARE = "as drawn", "as scaled", 2e-3, 5e-5
"""Sizes that get a bar, points a side of a slice, how much wider than the tolerances a slice is, corners of a face that
are listed, letters of a name and of a line of one; what a mean over pairs drawn is zero below, of the largest; and the
share of pairs that is printed as none."""

SIDES = {(27.0, -55.0): "from the front, above", (-27.0, 125.0): "from the back, below"}
"""Degrees from which faces are shown, so that all of them are seen that nothing hides."""

OTHER_SIDES = {(27.0, 125.0): "from the back, above", (-27.0, -55.0): "from the front, below"}
"""Those from which a body is shown too, where something hides faces of it."""

HAIR = 3.0  # points that a bar of a histogram is wide at least
HEIGHTS, HEAD, FOOT, SIDE, NAME = (1.6, 3.4), 0.3, 0.3, 0.3, 24
"""Inches: least and most that a body may be high there, above it, below all, and beside it; letters of its name."""


class ListedFace(NamedTuple):
    """A face of a body: label, name, outward normal and plane in words, area, numbers of its corners.

    The area, length units squared, is that of what a facet stands for, and None where only the parts are known, whose
    cuts may go on in a face's plane.
    """

    face: str
    name: str
    normal: str
    plane: str
    area: float | None
    vertices: tuple[int, ...]


FacesByRole = Mapping[str, tuple[ListedFace, ...]]


def listed_faces(body: Body) -> tuple[ListedFace, ...]:
    """Return the faces of a body."""
    normals, points = body.face_planes
    areas: list[float | None] = [None] * len(body.faces)
    if body.triangles or len(body.parts) == 1:
        corners, rows = body.face_triangles
        areas = np.bincount(rows, true_areas(corners, rows, round_surfaces(body)), len(areas)).tolist()
    names = names_of_rows(body)
    return tuple(
        ListedFace(f"F{k + 1}", names[k], direction(normals[k]), direction_level(normals[k], points[k]), areas[k], face)
        for k, face in enumerate(body.faces)
    )


def print_faces(body: Body, role: str) -> None:
    """Print the faces of a body, as sizes name them; the facets of a cylinder, or of a torus, as one."""
    print_text(f"{role}: body '{body.name}'" if body.name != role else f"body '{role}'")
    for text in filter(None, [*solids_notes((body,)), rounding_line((body,))]):
        print_text(text)
    rows, round_places, whole = [], _round_places(body), body.full_body or body
    rings = [own for own in whole.surfaces or () if own[0].ring]
    tori = {
        whole.faces[row]: f"torus radius {radius_text(surface.radius)}{f' no. {k}' * (len(rings) > 1)}"
        for k, (surface, own_rows) in enumerate(rings, 1)
        for row in own_rows
    }
    listed = [{**own._asdict(), "name": tori.get(own.vertices, own.name)} for own in listed_faces(body)]
    listed.sort(key=lambda own: (1, own["name"]) if " radius " in own["name"] else (0, f"{int(own['face'][1:]):9}"))
    for name, own in groupby(listed, key=lambda face: face["name"]):  # facets of a round face after the plane faces
        face, *others = own
        covered = "" if face["area"] is None else f"{sum(one['area'] for one in (face, *others)):.6g}"
        if others:
            axis, plane = round_places.get(tuple(sorted(face["vertices"])), ("", "round its ring"))
            plane = f"{plane}, {len(others) + 1} facets"
            rows.append({"face": face["face"], "name": name, "normal": axis, "plane": plane, "area": covered})
            continue
        corners = [f"V{v}" for v in face["vertices"][:CORNERS]] + ["..."] * (len(face["vertices"]) > CORNERS)
        shown = "" if name.startswith("face ") else name
        rows.append({**face, "name": shown, "area": covered, "vertices": ",".join(corners)})
    of_facets = body.surfaces is None and any(row["plane"].endswith(" facets") for row in rows if row["area"])
    notes = ["area of a round face: that of its facets"] * of_facets
    print_rows(rows[:MOST_LISTED], numbers=("area",), optional=("area",), notes=notes)
    if len(rows) > MOST_LISTED:
        print_text(f"... and {len(rows) - MOST_LISTED} more: --json lists all")


def _round_places(body: Body) -> dict[Label, tuple[str, str]]:
    """Return axis and centre of the round face that a facet is of, in words: the centre is halfway along the axis."""
    found: dict[Label, tuple[str, str]] = {}
    for own in round_faces(body):
        corners = body.vertices[np.unique([v - 1 for face in own.faces for v in face])]
        origin, axis = own.surface.origin, own.surface.axis
        axis = axis if axis[np.abs(axis).argmax()] > 0.0 else -axis
        along = (corners - origin) @ axis
        ball = own.surface.line is None
        centre = origin if ball else origin + (along.min() + along.max()) / 2.0 * axis
        centre = np.where(np.abs(centre) <= DEFAULT.nominal * body.size, 0.0, centre)
        axis_text = "" if ball else f"axis {direction(axis).removeprefix('+')}"
        found |= dict.fromkeys(own.faces, (axis_text, f"centre ({numbers(centre.tolist())})"))
    return found


def print_stack(stack: StackUp, share: GapYield | None = None) -> None:
    """Print which gap it is, worst case, statistics, the share within limits, of pairs drawn now if not given, rows."""
    share = share or stack.yield_()
    worst, spread = stack.worst(), stack.root_sum_square()
    noise = noise_of(stack.touching.bodies)
    at = [_deciding_sizes(stack, own) for own in (worst.at_least, worst.at_largest)]
    drawn = max(noise, 3.0 * share.deviation / math.sqrt(share.count))  # what drawing leaves of a mean of 0
    sigma = f"sigma {signed(share.deviation, least=noise).lstrip('+')}"
    one = "root sum square" + " of one contact" * (len({row.told for row in stack.rows}) > 1)
    rows = [
        ("worst case, least gap", worst.least, _sizes(at[0]) or DRAWN),
        ("worst case, largest gap", worst.largest, _sizes(at[1]) or DRAWN),
        ("99.73 % of pairs drawn, least gap", share.low, f"mean {signed(share.mean, least=drawn)}"),
        ("99.73 % of pairs drawn, largest gap", share.high, sigma),
        (
            f"{one}, mean - 3 sigma",
            spread.low,
            f"mean {signed(spread.mean, least=noise)}, sigma {signed(spread.deviation, least=noise).lstrip('+')}",
        ),
        (f"{one}, mean + 3 sigma", spread.high, stack.deciding_contact),
    ]
    of_faces = stack.loop is not None and stack.loop.pair.faces is not None
    if stack.parts or of_faces:
        what, others = ((stack.deciding_contact,), "all") if of_faces else (stack.parts, "all other")
        print_text(f"gap of {' and '.join(what)} at rest, {others} contacts closed")
    beyond = [not worst.least - noise <= gap <= worst.largest + noise for _, gap, _ in rows]
    print_rows([
        {"": what, "gap": signed(gap, least=noise) + " *" * past, "at": wrapped(at, LONGEST)}
        for past, (what, gap, at) in zip(beyond, rows, strict=True)
    ], numbers=("gap",), notes=[BEYOND] * any(beyond))  # fmt: skip
    _print_yield(stack, share, usual=not any(beyond))
    contributions = contributions_of(stack)
    differs, varies = any(own.worst for own in contributions), any(own.variance for own in contributions)
    print_rows([
        {
            "size": own.size, "half tolerance": f"{own.half:.4g}", "mean gap per unit": gap_per_unit(stack, own),
            "of the worst case": f"{own.worst:.2%}" if differs else "none",
            "of the variance": f"{own.variance:.1%}" if varies else "none",
        }
        for own in contributions
    ], numbers=("half tolerance", "mean gap per unit", "of the worst case", "of the variance"))  # fmt: skip
    for note in stack_notes(stack):
        print_text(note)
        print_text()
    contacts, head = stack.contacts, DRAWN if all(own.at_scale is None for own in stack.touching.bodies) else SCALED
    print_rows([
        {
            "no.": str(k) * (len(contacts) > 1), "contact": shortened(contact, LONGEST),
            head: signed(float(stack.of_contact(k).gap({})), least=noise),
            "gap per unit of each size": wrapped(_rates(stack, contact) or "no size moves it", LONGEST),
        }
        for k, contact in enumerate(contacts, 1)
    ], numbers=(head,), optional=("no.",))  # fmt: skip


def _rates(stack: StackUp, contact: str) -> str:
    """Return what rows of a contact change a unit of each size as text, from where to where by their directions."""
    own = np.array([[*row.coefficients.values()] for row in stack.rows if row.told == contact])
    ends = zip(stack.names, own.min(axis=0).tolist(), own.max(axis=0).tolist(), strict=True)
    moved = ((name, signed(low), signed(high)) for name, low, high in ends if max(-low, high) > DEFAULT.tie)
    return ", ".join(f"{name} {' to '.join(dict.fromkeys(rates))}" for name, *rates in moved)


def noise_of(bodies: Sequence[Body]) -> float:
    """Return up to which length one is but rounding: of floats, or of files in single precision."""
    return max(max(DEFAULT.tie * own.size, min(2.0 * own.rounding, DEFAULT.drawn * own.size)) for own in bodies)


def _deciding_sizes(stack: StackUp, values: Mapping[str, float]) -> dict[str, float]:
    """Return the sizes that a worst case depends on: others move no contact, or are in their tolerance's middle."""
    moved = {size for row in stack.rows for size, off in row.coefficients.items() if off}
    ends = dict(zip(stack.names, stack.touching.box.tolist(), strict=True))
    return {
        size: off
        for size, off in values.items()
        if size in moved and not (off == sum(ends[size]) / 2.0 and np.ptp(ends[size]) > 0.0)
    }


def contributions_of(stack: StackUp) -> list[SizeShare]:
    """Return what each size contributes, a mean over pairs drawn as 0 where it is nothing but what drawing leaves."""
    least = DRAWN_ZERO * max((abs(x) for row in stack.rows for x in row.coefficients.values()), default=0.0)
    return [own if abs(own.coefficient) > least else replace(own, coefficient=0.0) for own in stack.contributions]


def gap_per_unit(stack: StackUp, own: SizeShare) -> str:
    """Return the mean gap a unit of a size as text; from where to where its contacts have it if they cancel out."""
    every = [row.coefficients.get(own.size, 0.0) for row in stack.rows] if own.worst and not own.coefficient else []
    ends = (min(every), max(every)) if every else (own.coefficient,)
    return " to ".join(dict.fromkeys(signed(x, 3) for x in ends))


def stack_notes(stack: StackUp) -> list[str]:
    """Return what a stack-up leaves out or takes as given, a sentence each.

    Contacts that are always closed, motions that only weights decide, keep-outs, sizes at which a face vanishes.
    """
    factor, face, where = stack.touching.vanishing
    at = _sizes({name: factor * x for name, x in where.items()})
    at = at or f"{factor:.2%} of the tolerances of {' and '.join(where)}"
    beyond = f"at {at} {face} vanishes: parts made beyond are refused, rows go on without it"
    free = (
        f"closed contacts leave {' and '.join(stack.weighted)} free together, and the gap depends on them: it is that "
        "of the least motions, by their weights"
    )
    kept = f"it is the gap of the two bodies: keep-outs ({', '.join(stack.keep_out)}) have no part in it"
    closed = f"motions close this contact, as the others: gaps of {' and '.join(stack.parts)} are what they make up for"
    restored = stack.loop is not None and stack.loop.is_restored
    notes = {closed: restored, free: bool(stack.weighted), kept: bool(stack.keep_out), beyond: factor < 1.0}
    but = "and not counted" + ", though with them no pair is within the limits" * stack.is_outside_limits_when_closed
    fits = (
        f"{name} is a fit, as drawn line to line: its play is {signed(low)} to {measured(signed(high), stack.unit)} a "
        "side, and the gap is that of parts in its middle"
        for name, (low, high) in stack.fits.items()
    )
    return [*not_counted(stack.standing, but), *fits, *(note for note, holds in notes.items() if holds)]


def commented_out_sizes(path: Path) -> str:
    """Return in words how many tables of sizes a file has as comments, as `init` writes them; "" where it has none."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError):
        return ""
    count = len(re.findall(r"^\s*#\s*\[\[size\]\]", text, re.MULTILINE))
    words = ("1 is there", "its lines") if count == 1 else (f"{count} are there", "the lines of those that count")
    return f"{words[0]}, commented out; take the # away before {words[1]}" if count else ""


def another_decides(spread: RootSumSquare) -> str:
    """Return that another contact than the one of the worst case decides in some pairs drawn; "" where none does."""
    if spread.elsewhere < RARE:
        return ""
    return (
        "root sum square takes one contact, that of the worst case, as normal; in "
        f"{spread.elsewhere:.2%} of the pairs drawn another one decides, and the gap is that: trust the pairs drawn"
    )


def _print_yield(stack: StackUp, share: GapYield, *, usual: bool) -> None:
    """Print how many of the pairs drawn are within the limits; by root sum square where `usual`, in the worst case."""
    worst, spread, unit = stack.worst(), stack.root_sum_square(), stack.unit
    limited = bool(np.isfinite(stack.limits).any())
    if limited:
        of = "of all but closed contacts, " * stack.is_outside_limits_when_closed
        print_text(of + share.share_text + f", {spread.share:.4%} by root sum square" * usual)
    if stack.known_to:
        low, high = f"{share.share_low:.4%}", f"{share.share_high:.4%}"
        shares = f"{low if low == high else f'between {low} and {high}'}, and " * limited
        ends = f"{signed(worst.least_low)} to {measured(signed(worst.largest_high), unit)}"
        print_text(f"of the true parts {shares}worst cases from {ends}")
    least, most = share.interval
    room = RARE + (most - least) / 2.0  # beyond twice that interval chance alone goes once in 10^4 times
    if note := another_decides(spread):
        print_text(note)
    elif usual and not least - room <= spread.share <= most + room:
        print_text("root sum square takes the gap as normal, which it is not: trust the pairs drawn")
    print_text()


def print_allocation(found: Allocation) -> None:
    """Print the cheapest tolerances."""
    rows = [{"size": name, "low": signed(a, 6), "high": signed(b, 6)} for name, (a, b) in found.tolerances.items()]
    note = f"cost {found.cost:.6g}; worst case from {signed(found.least, 6)} to {signed(found.largest, 6)}"
    print_rows(rows, numbers=("low", "high"), notes=[f"cheapest tolerances: {note}"])


def write_stack(stack: StackUp, path: Path) -> None:
    """Write the rows, and below them half tolerances and contributions, as CSV."""
    by_name = {own.size: own for own in stack.contributions}
    with path.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow(["row", "gap as drawn", *stack.names])
        table.writerows([row.contact, row.gap, *row.coefficients.values()] for row in stack.rows)
        words = {"half": "half tolerance", "worst": "share of worst case", "variance": "share of variance"}
        for what, word in words.items():
            table.writerow([word, "", *(getattr(by_name[name], what) for name in stack.names)])


@styled
def stack_figure(stack: StackUp, share: GapYield, *, title: str = "") -> Figure:
    """Draw what each size contributes, and how the gap is spread about its limits."""
    sheet = Sheet.of(PAGE, 2.9, title=title)
    bars, gaps = sheet.axes(1.3, 0.45, 1.9, 2.2), sheet.axes(4.0, 0.45, 2.6, 2.2)
    shown = stack.contributions[:MOST_BARS]
    rows = np.arange(len(shown))
    for up, of, color in ((-0.2, "worst", BLUE), (0.2, "variance", GREY)):
        shares = [100.0 * getattr(own, of) for own in shown]
        drawn = bars.barh(rows + up, shares, 0.38, color=color, label=f"{of} case" if of == "worst" else of)
        bars.bar_label(drawn, fmt="%.3g", padding=2.0, fontsize=NOTE)
    bars.margins(x=0.16)  # room for the numbers
    bars.set_yticks(range(len(shown)), [literal(wrapped(own.size, SIZE)) for own in shown])
    bars.set(ylim=(len(shown) - 0.5, -0.5), xlabel="share of each size (%)")
    _legend(bars)
    _draw_gaps(gaps, stack, share)
    return sheet.figure


@styled
def gap_figure(stack: StackUp, share: GapYield) -> Figure:
    """Draw how the gap is spread about its limits, for a page that has what sizes contribute in a table."""
    sheet = Sheet.of(2.35, 1.36)
    _draw_gaps(sheet.axes(0.5, 0.36, 1.78, 0.7), stack, share, columns=2)
    return sheet.figure


def _draw_gaps(gaps: Any, stack: StackUp, share: GapYield, *, columns: int = 4) -> None:
    """Draw how many of the pairs drawn have which gap, and its limits; what is what in so many columns."""
    edges, heights = np.asarray(share.edges), np.asarray(share.counts) / max(1, int(np.sum(share.counts)))
    middles, (low, high) = (edges[:-1] + edges[1:]) / 2.0, share.limits
    within = (middles >= low) & (middles <= high)
    inside = "within" if np.isfinite(share.limits).any() else "drawn"
    worst = stack.worst()
    seen = [x for x in (worst.least, worst.largest, *share.limits) if np.isfinite(x)]
    room = 0.05 * max(max(seen) - min(seen), float(edges[1] - edges[0]))
    gaps.set_xlim(min(seen) - room, max(seen) + room)
    # bars as wide as bins, and wide enough to be seen where all pairs have one gap, before the line of a worst case
    points = 72.0 * gaps.get_position().width * gaps.figure.get_figwidth()
    wide = max(float(edges[1] - edges[0]), HAIR * float(np.ptp(gaps.get_xlim())) / points)
    for chosen, colour, name in ((within, BLUE, inside), (~within, VERMILLION, "outside")):
        if (heights[chosen] > 0.0).any():
            gaps.bar(middles[chosen], heights[chosen], wide, color=colour, label=name, zorder=3)
    for ends, name, style in (
        ([limit for limit in share.limits if np.isfinite(limit)], "limits", {"color": BLACK, "linewidth": 1.2}),
        ((worst.least, worst.largest), "worst case", {"color": DARK, "linewidth": 0.8, "linestyle": ":"}),
    ):
        for k, end in enumerate(ends):
            gaps.axvline(end, label=None if k else name, **style)
    gaps.set(xlabel=f"gap ({stack.unit or 'length units'})", ylabel="share of pairs in a bin")
    _legend(gaps, columns)


def _legend(axes: Any, columns: int = 4) -> None:
    """Tell what is what above the axes, where it covers nothing."""
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.0, handlelength=1.2,
        columnspacing=0.8, handletextpad=0.4, frameon=False,
    )  # fmt: skip


@styled
def slice_figure(stack: StackUp, names: Sequence[str], *, title: str = "") -> Figure:
    """Draw the gap over two sizes, all others as drawn: where the parts touch, its limits, and the tolerances.

    Raises `InputError` where `names` are not two sizes of the stack-up.
    """
    from matplotlib.patches import Rectangle

    if len(set(names)) != 2 or not set(names) <= set(stack.names):
        allowed = f"two of {', '.join(stack.names)}"
        raise InputError("not two sizes of this stack-up", key="slice", found=list(names), allowed=allowed)
    places = [stack.names.index(name) for name in names]
    box = stack.touching.box[places]
    wide = min(WIDER, stack.touching.reach[0])
    spread = wide * np.maximum(np.ptp(box, axis=1), np.finfo(float).tiny) / 2.0
    ends = np.minimum(box[:, 0], box.mean(axis=1) - spread), np.maximum(box[:, 1], box.mean(axis=1) + spread)
    sides = [np.linspace(low, high, FINE) for low, high in zip(*ends, strict=True)]
    p = np.zeros((FINE, FINE, len(stack.names)))
    p[..., places[0]], p[..., places[1]] = np.meshgrid(*sides)
    seen = list(stack.touching.sizes)  # the rows are complete within their box alone
    for own, low, high in zip(places, *(end.tolist() for end in ends), strict=True):
        seen[own] = replace(seen[own], tolerance=(low, high))
    gap = widened(stack.touching, seen, least=False).gap(p)
    lines = [(0.0, "line: touching", "solid", 1.6), *((x, "dashed: limits", "dashed", 1.0) for x in stack.limits if x)]
    lines = [line for line in lines if gap.min() < line[0] < gap.max()]
    signs = dict.fromkeys([*(line[1] for line in lines), "box: tolerances"])
    sheet = Sheet.of(PAGE, 3.3, title=title, caption="; ".join(signs))
    axes, bar = sheet.axes(0.8, 0.45, 4.8, 2.7), sheet.axes(5.75, 0.45, 0.1, 2.7)
    most = max(float(np.abs(gap).max()), float(np.finfo(float).tiny))
    mesh = axes.pcolormesh(*sides, gap, cmap="RdBu", vmin=-most, vmax=most, shading="gouraud", rasterized=True)
    sheet.figure.colorbar(mesh, cax=bar, label=f"gap ({stack.unit or 'length units'})")
    for level, _, style, width in lines:
        axes.contour(*sides, gap, levels=[level], colors=BLACK, linewidths=width, linestyles=style)
    (left, bottom), (wide, high) = box[:, 0].tolist(), np.ptp(box, axis=1).tolist()
    axes.add_patch(Rectangle((left, bottom), wide, high, fill=False, edgecolor=DARK, linewidth=1.0))
    kinds = [stack.sizes[k].is_length for k in places]
    axes.set(**{
        f"{side}label": literal(f"{name} ({(stack.unit or 'length units') if length else 'share'})")
        for side, name, length in zip("xy", names, kinds, strict=True)
    })  # fmt: skip
    return sheet.figure


@styled
def faces_figure(problem: Scene, *, title: str = "") -> Figure:
    """Draw all bodies as drawn, with a number at each face that can be seen: from two opposite sides, or from four.

    Facets of one round face have one number, that of the first.
    """
    sheet, hidden = _faces_sheet(problem, [SIDES] * len(problem.drawn), title)
    if any(hidden):
        each = [{**SIDES, **OTHER_SIDES} if unseen else SIDES for unseen in hidden]
        sheet, hidden = _faces_sheet(problem, each, title)
    lines = [
        f"of {shortened(body.name or role, NAME)} {shortened(_ranges(unseen), LONGEST)}"
        for (role, body), unseen in zip(problem.drawn.items(), hidden, strict=True)
        if unseen
    ]
    if lines:
        sheet.list(0.1, FOOT, PAGE - 0.2, [f"hidden, or no room for the number: {'; '.join(lines)}"])
    return sheet.figure


def _faces_sheet(
    problem: Scene, sides: Sequence[Mapping[tuple[float, float], str]], title: str
) -> tuple[Sheet, list[list[int]]]:
    """Return a sheet with each body from its sides, two a line, and which numbers of each have no place on it."""
    bodies, wide = [*problem.drawn.values()], PAGE / 2.0
    numbers, rows = [_numbers(body) for body in bodies], []
    for k, (role, body) in enumerate(problem.drawn.items()):
        colour = {"movable": BLUE, "static": VERMILLION}.get(role, COLOURS[k % len(COLOURS)])
        drawn = [(body, colour, "")]
        shown = [(k, ShownBodies(drawn, body.vertices, view), side) for view, side in sides[k].items()]
        rows += [shown[first : first + 2] for first in range(0, len(shown), 2)]
    heights = [float(np.clip(max(own.slenderness for _, own, _ in row) * wide, *HEIGHTS)) + HEAD for row in rows]
    sheet, seen = Sheet.of(PAGE, sum(heights) + FOOT, title=title), [set[str]() for _ in bodies]
    low = FOOT + sum(heights)
    for row, high in zip(rows, heights, strict=True):
        low -= high
        for column, (k, own, side) in enumerate(row):
            area = (column * wide + SIDE, low, wide - SIDE, high - HEAD)
            role = [*problem.drawn][k]
            name = ": ".join(dict.fromkeys((role, shortened(bodies[k].name, NAME))))
            axes, numbered = draw_numbered(sheet, area, own, numbers[k])
            seen[k] |= numbered
            axes.set_title(literal(f"{name}, {side}"), pad=2.0)
            draw_directions(sheet, axes, own, (area[0] - SIDE, area[1]), problem.unit)
    each = zip(numbers, seen, strict=True)
    return sheet, [[int(own[1:]) for own in dict.fromkeys(of.values()) if own not in known] for of, known in each]


def _numbers(body: Body) -> dict[Label, str]:
    """Return the number of each face, as the table lists them: facets of a round face have that of the first."""
    first: dict[str, str] = {}
    names = names_of_rows(body)
    return {
        tuple(sorted(face)): first.setdefault(name, f"F{k}") if " radius " in name else f"F{k}"
        for k, (face, name) in enumerate(zip(body.faces, names, strict=True), 1)
    }


def _ranges(numbers: Sequence[int]) -> str:
    """Return numbers of faces in words: F3, F5 to F9."""
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return ", ".join(f"F{run[0]}" if len(run) == 1 else f"F{run[0]} to F{run[-1]}" for run in runs)


def _sizes(values: Any) -> str:
    return ", ".join(f"{name} {signed(x)}" for name, x in values.items() if x)
