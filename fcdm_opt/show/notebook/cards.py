"""What a card holds, and what stands on those of bodies, curves, problems, and answers."""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fcdm_opt.geometry.units import floored
from fcdm_opt.problem.problem import TRACKING
from fcdm_opt.show import pixels
from fcdm_opt.show.plots import before_after_figure, decision_curve_figure
from fcdm_opt.show.rendering import rendered
from fcdm_opt.show.scene import body_figure
from fcdm_opt.show.texts import counted, in_unit, number, numbers, parameter_units
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fcdm_opt.along.coherent_range import CoherentRange
    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.geometry.bodies import Body
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.problem.solution import Certificate, Solution

Fact = tuple[str, ...]  # name, value, and a unit or remark where there is one
Rows = tuple[Sequence[str], Sequence[Sequence[object]]]

LISTED, CHECKS_SHOWN = 12, 30
"""Lines of a list or table, and checks of a certificate, that are shown."""

DOTS = 100
"""Dots per inch of a card's picture."""


class Card(NamedTuple):
    """A card, from its top to its bottom; texts are plain.

    Attributes
    ----------
    title : str
    said : str
        A sentence below it.
    facts : sequence of (name, value) or (name, value, unit)
        Those without a value are left out.
    tables : sequence of (heads, lines)
    lists : dict
        Lines by the name of their list.
    state : str
        In a badge beside the title, with a sign before it that tells the mood.
    mood : {"good", "bad", "mind", ""}
    picture : matplotlib Figure, optional
        Beside all that, or below it where the page is narrow.
    told : str
        What the picture shows, for who cannot see it.
    most : int
        Lines of a list or table that are shown; how many more there are is said.
    """

    title: str
    said: str = ""
    facts: Sequence[Fact] = ()
    tables: Sequence[Rows] = ()
    lists: Mapping[str, Sequence[str]] = {}
    state: str = ""
    mood: str = ""
    picture: Figure | None = None
    told: str = ""
    most: int = LISTED

    @property
    def html(self) -> str:
        """The card as one line of HTML."""
        data = {**self._asdict(), "facts": [fact for fact in self.facts if fact[1]]}
        if self.picture is not None:
            data["picture"] = b64encode(pixels(self.picture, across=int(DOTS * self.picture.get_figwidth()))).decode()
        return "".join(map(str.strip, rendered("card.html", card=data).split("\n")))


# -------------------------------------------------------------------------------------------------------------- bodies


def body_card(body: Body) -> Card:
    """Return the card of a body: what it is made of, its seed, and its faces and edges."""
    facts = [
        ("corners", str(len(body.corners))),
        ("faces", str(len(body.faces))),
        ("convex parts", str(len(body.parts))),
        ("seed", f"({numbers(body.seed)})"),
        ("extent", " x ".join(map(number, np.ptp(body.vertices, axis=0).tolist())), "length"),
        ("off the solid", numbers(body.deviation, 3) if any(body.deviation) else "", "outward, inward at most"),
    ]
    told = f"{counted(len(body.faces), 'face')} of the body; the cross is its seed"
    lists = {"how it was made": body.notes}
    return Card(f"Body: {body.name}", facts=facts, lists=lists, picture=body_figure(body), told=told)


# -------------------------------------------------------------------------------------------------------------- curves


def curve_card(curve: DecisionCurve) -> Card:
    """Return the card of a decision curve: its picture in the box, and its features."""
    segments, points = curve.segments, curve.switching_points
    counts = [counted(len(curve.branches), "chain"), counted(len(segments), "segment")]
    facts = [
        ("bodies", f"{curve.movable.name} (movable), {curve.static.name} (static)"),
        ("box of scales", " x ".join(f"[{numbers(side)}]" for side in curve.box)),
        ("curve", ", ".join([*counts, counted(len(points), "switching point")]) if segments else "none in the box"),
    ]
    lists = {
        "contact along it": [
            f"S{each.index} {each.feature.label}, {each.configuration}{', snug' if each.snug else ''}"
            for each in segments
        ],
        "contact changes at": [f"SW{point.index} ({numbers(point.rho)}), {point.kind}" for point in points],
    }
    told = f"decision curve, {counted(len(segments), 'segment')}"
    picture = decision_curve_figure(curve, beside=False) if segments and np.isfinite(curve.box).all() else None
    return Card("Decision curve", facts=facts, lists=lists, state=curve.status, picture=picture, told=told)


# ----------------------------------------------------------------------------------------------- problems and answers


def problem_card(problem: Problem) -> Card:
    """Return the card of a problem: what is asked, and the curve with what it is about."""
    names = [name for name, _ in problem.motion.parameters]
    limits = [
        f"{name} from {number(in_unit(low, unit))} to {number(in_unit(high, unit))} {unit}"
        for name, unit, (low, high) in zip(names, parameter_units(problem), problem.limits.tolist(), strict=True)
        if math.isfinite(low) or math.isfinite(high)
    ]
    asked = f"requirement {problem.requirement}" if problem.requirement else "explicit target"
    bodies = [
        f"{body.name}, {counted(len(body.corners), 'corner')}, {counted(len(body.parts), 'part')}"
        for body in (problem.movable, problem.static)
    ]
    facts = [
        *zip(("movable", "static"), bodies, strict=True),
        ("keep-outs", ", ".join(keep_out.name for keep_out in problem.keep_out)),
        ("motion", ", ".join(names)),
        ("goal", f'"{problem.goal}"'),
        ("made at", f"({numbers(problem.target)})", f"from ({numbers(problem.nominal_pair)}), {asked}"),
        ("clearance", number(problem.clearance) if problem.clearance else "", problem.unit or "length"),
        ("pair made must", {"clear": "be clear", "touch": "touch"}.get(problem.pair, "")),
    ]
    return Card(
        _title("Problem", problem),
        facts=facts,
        lists={"limits": limits, "tracked contact": [feature.label for feature in problem.tracked_features]},
        state="to be solved",
        picture=before_after_figure(problem),
        told="decision curve, nominal pair and pair made",
    )


def solution_card(solution: Solution) -> Card:
    """Return the card of an answer: the advice, the motion, how small it is, and what it does to the pair made."""
    problem, after = solution.problem, solution.rho
    length, amount = problem.unit or "length", problem.amount_unit or "length"
    motion = []
    named = zip(solution.parameters.items(), parameter_units(problem), problem.weights, strict=False)
    for (name, q), unit, weight in named:
        small = abs(weight * q) <= DEFAULT.tie * solution.amount  # rounding
        motion.append((f"motion {name}", number(0.0 if small else in_unit(q, unit)), unit))
    facts = [
        *motion,
        ("amount", number(solution.amount), f"{amount}, {solution.doubt}" if solution.doubt else amount),
        ("proved at least", *_bound(solution, amount)),
        ("pair made", f"({numbers(solution.pair)})"),
        ("its state after", solution.pair_state, f"gap {number(solution.pair_gap)} {length}"),
        ("tracked contact at", f"({numbers(after)})" if after is not None and problem.goal in TRACKING else ""),
        ("verified", _verdict(solution)),
        ("settled by", solution.stage),
        ("time", number(sum(solution.seconds.values()), 3) if solution.seconds else "", "s"),
    ]
    return Card(
        _title("Solution", problem),
        said=solution.advice,
        facts=facts,
        lists={"contact": [feature.label for feature in solution.features]},
        state=solution.status.name,
        mood=mood_of(solution),
        picture=before_after_figure(problem, solution),
        told="decision curve before and after the motion, nominal pair and pair made",
    )


def mood_of(solution: Solution) -> str:
    """Return the mood of a card about an answer."""
    return "bad" if not solution.usable else "mind" if solution.status.name == "PAIR_OVERLAPS" else "good"


def _title(what: str, problem: Problem) -> str:
    return f"{what}: {problem.name}" if problem.name else what


def _bound(solution: Solution, unit: str) -> tuple[str, str]:
    """Return the lower bound and how far below the amount it is."""
    if not solution.lower_bound > 0.0:
        return "0", "(nothing is proved)" if solution.amount else unit
    if math.isinf(solution.lower_bound):
        return "impossible", ""
    gap = "exact" if abs(solution.gap) <= DEFAULT.nominal else f"relative gap {number(solution.gap, 2)}"
    return floored(solution.lower_bound, 6), f"{unit}, {gap}" if math.isfinite(solution.gap) else unit


def _verdict(solution: Solution) -> str:
    certificate = solution.certificate
    if certificate is None or not solution.status.found:
        return "" if certificate is None else "no motion to verify"
    if solution.status.name == "OUTSIDE_FIT":
        return "no: outside the fit"
    if certificate.passed:
        return f"yes, {counted(len(certificate.checks), 'check')} passed"
    return f"no: {', '.join(check.name for check in certificate.failed) or 'no checks'}"


def certificate_card(certificate: Certificate) -> Card:
    """Return the card: every check, those that failed first."""
    words = {True: "\u2713 passed", False: "\u2717 failed"}
    lines = [
        (words[bool(check.passed)], check.name, number(check.value), number(check.limit), check.note)
        for check in sorted(certificate.checks, key=lambda check: bool(check.passed))
    ]
    held = len(certificate.checks) - len(certificate.failed)
    return Card(
        "Certificate",
        said=f"{held} of {counted(len(certificate.checks), 'check')} passed",
        tables=[(("check", "of", "value", "limit", "note"), lines)],
        state="passed" if certificate.passed else "not passed",
        mood="good" if certificate.passed else "bad",
        most=CHECKS_SHOWN,
    )


def range_card(coherent: CoherentRange) -> Card:
    """Return the card: the interval, the motion at both ends, and what ends it there."""
    from fcdm_opt.along.followed import KINDS

    describe = partial(coherent.problem.motion.describe, unit=coherent.problem.unit)
    ends = [
        (
            side,
            number(event.x, 9),
            describe(event.x * coherent.direction) if math.isfinite(event.x) else "-",
            event.what or KINDS[event.kind],
            "; ".join(feature.label for feature in event.successors),
        )
        for side, event in zip(("low", "high"), coherent.events, strict=True)
    ]
    facts = [
        ("from, to", f"{number(coherent.low, 9)}, {number(coherent.high, 9)}"),
        ("in multiples of", describe(coherent.direction)),
        ("contact", " & ".join(feature.label for feature in coherent.features)),
    ]
    return Card(
        "Coherent range",
        facts=facts,
        tables=[(("end", "x", "motion there", "what ends it", "takes over"), ends)],
        state="proved" if coherent.proved else "not all proved",
        mood="good" if coherent.proved else "mind",
    )
