"""What a decision curve's card says, and its lines in the plane of scales."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from fcdm_opt.show.notebook.card import Card
from fcdm_opt.show.notebook.pictures import Mark, plane
from fcdm_opt.show.texts import counted, numbers

if TYPE_CHECKING:
    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.curve.segments import Segment

TIPPED = 24
"""Most segments, or switching points, that are marks of their own; of more only the lines are drawn."""


def curve_lines(curve: DecisionCurve, style: str, name: str) -> list[Mark]:
    """Return the lines of a curve, those of a snug fit with a wide one below."""
    if len(curve.segments) <= TIPPED:
        runs = [[segment] for segment in curve.segments if segment.snug]
        lines = [Mark(style, (segment.start, segment.end), _tip(segment), name) for segment in curve.segments]
    else:
        runs = [
            list(run) for branch in curve.branches for snug, run in groupby(branch.segments, attrgetter("snug")) if snug
        ]
        lines = [Mark(style, _corners(branch.segments), "", name) for branch in curve.branches]
    return [*(Mark("snug", _corners(run), "", "snug fit") for run in runs), *lines]


def switching_points(curve: DecisionCurve) -> list[Mark]:
    """Return the switching points as marks, none where they are too many to tell apart."""
    points = curve.switching_points
    if len(points) > TIPPED:
        return []
    return [Mark("switch", point.rho, f"SW{point.index} ({numbers(point.rho)}): {point.label}") for point in points]


def curve_card(curve: DecisionCurve) -> Card:
    """Return the card of a decision curve: its picture in the box, and its features."""
    segments, points = curve.segments, curve.switching_points
    marks = [*curve_lines(curve, "before", ""), *switching_points(curve)]
    counts = [counted(len(curve.branches), "chain"), counted(len(segments), "segment")]
    facts = [
        ("bodies", f"{curve.movable.name} (movable), {curve.static.name} (static)"),
        ("box of scales", " x ".join(f"[{numbers(side)}]" for side in curve.box)),
        ("curve", ", ".join([*counts, counted(len(points), "switching point")]) if marks else "none in the box"),
    ]
    lists = {
        "contact along it": [_tip(segment) for segment in segments],
        "contact changes at": [f"SW{point.index} ({numbers(point.rho)}), {point.kind}" for point in points],
    }
    told = f"decision curve, {counted(len(segments), 'segment')}"
    picture = plane(marks, curve.box, told=told) if marks else None
    return Card("Decision curve", facts=facts, lists=lists, state=curve.status, picture=picture)


def _corners(run: Sequence[Segment]) -> list[Any]:
    return [run[0].start, *(segment.end for segment in run)]


def _tip(segment: Segment) -> str:
    snug = ", snug" if segment.snug else ""
    return f"S{segment.index} {segment.feature.label}, {segment.configuration}{snug}"
