"""How a decision curve is drawn on a notebook's card: what `cards.plane` takes."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

from fcdm_opt.show.notebook.pictures import Line, Mark, Point, plane
from fcdm_opt.show.notebook.words import Html, card, counted, listing, numbers, rows

if TYPE_CHECKING:
    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.curve.segments import Segment

TIPPED = 24
"""Most segments, or switching points, that are marks of their own; of more only the lines are drawn."""


def curve_lines(curve: DecisionCurve, style: str, name: str) -> list[Line]:
    """Return the lines of a curve, those of a snug fit with a wide one below."""
    wide = [Line((own.start, own.end), "snug", "", "snug fit") for own in curve.segments if own.snug]
    if len(curve.segments) <= TIPPED:
        return [*wide, *(Line((own.start, own.end), style, _tip(own), name) for own in curve.segments)]
    wide = [
        Line([run[0].start, *(own.end for own in run)], "snug", "", "snug fit")
        for branch in curve.branches
        for snug, group in groupby(branch.segments, lambda own: own.snug)
        if snug and (run := list(group))
    ]
    whole = [[branch.segments[0].start, *(own.end for own in branch.segments)] for branch in curve.branches]
    return [*wide, *(Line(points, style, "", name) for points in whole)]


def switching_points(curve: DecisionCurve) -> list[Point]:
    """Return the switching points as marks, none where they are too many to tell apart."""
    points = curve.switching_points
    if len(points) > TIPPED:
        return []
    return [Point(own.rho, "switch", f"SW{own.index} ({numbers(own.rho)}): {own.label}") for own in points]


def curve_card(curve: DecisionCurve) -> Html:
    """Return the card of a decision curve: its picture in the box, and its features."""
    segments, points = curve.segments, curve.switching_points
    (low_1, high_1), (low_2, high_2) = curve.box
    marks: list[Mark] = [*curve_lines(curve, "before", ""), *switching_points(curve)]
    counts = [counted(len(curve.branches), "chain"), counted(len(segments), "segment")]
    facts = rows(
        [
            ("bodies", f"{curve.movable.name} (movable), {curve.static.name} (static)"),
            ("box of scales", f"[{numbers((low_1, high_1))}] x [{numbers((low_2, high_2))}]"),
            ("curve", ", ".join([*counts, counted(len(points), "switching point")]) if marks else "none in the box"),
        ]
    )
    features = listing("contact along it", [_tip(own) for own in segments])
    changes = listing("contact changes at", [f"SW{own.index} ({numbers(own.rho)}), {own.kind}" for own in points])
    told = f"decision curve, {counted(len(segments), 'segment')}"
    picture = plane(marks, curve.box, told=told) if marks else None
    return card("Decision curve", facts, features, changes, state=curve.status, picture=picture)


def _tip(segment: Segment) -> str:
    snug = ", snug" if segment.snug else ""
    return f"S{segment.index} {segment.feature.label}, {segment.configuration}{snug}"
