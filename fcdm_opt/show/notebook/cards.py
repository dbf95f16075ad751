"""What a card holds, and what stands on those of bodies, curves, problems, and answers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import groupby
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.geometry.units import floored
from fcdm_opt.problem.problem import TRACKING
from fcdm_opt.show.notebook.pictures import Mark, Picture, drawing, plane
from fcdm_opt.show.rendering import rendered
from fcdm_opt.show.scales import tolerance_box, window
from fcdm_opt.show.scene import page_directions
from fcdm_opt.show.texts import counted, in_unit, number, numbers, parameter_units
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.along.coherent_range import CoherentRange
    from fcdm_opt.curve.segments import Segment
    from fcdm_opt.geometry.bodies import Body
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.problem.solution import Certificate, Solution

Fact = tuple[str, ...]  # name, value, and a unit or remark where there is one
Rows = tuple[Sequence[str], Sequence[Sequence[object]]]

LISTED, CHECKS_SHOWN, TIPPED, EDGES = 12, 30, 24, 400
"""Lines of a list or table, and checks of a certificate, that are shown; segments, or switching points, that are marks
of their own; edges of a body, of which else only the outline is drawn."""

VIEW = 27.0, -54.0
"""Elevation and azimuth in degrees that a body is seen from; no symmetric view, in which edges of a cube meet."""

MARGIN = 0.04
"""Room about a body's picture, as a share of its size."""


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
    picture : Picture, optional
        Beside all that, or below it where the page is narrow.
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
    picture: Picture | None = None
    most: int = LISTED

    @property
    def html(self) -> str:
        """The card as one line of HTML."""
        card = self._replace(facts=[fact for fact in self.facts if fact[1]])
        return "".join(map(str.strip, rendered("card.html", card=card).split("\n")))


# -------------------------------------------------------------------------------------------------------------- bodies


def body_card(body: Body) -> Card:
    """Return the card of a body: what it is made of, its seed, and its edges, those at the back of their part thin."""
    facts = [
        ("corners", str(len(body.corners))),
        ("faces", str(len(body.faces))),
        ("convex parts", str(len(body.parts))),
        ("seed", f"({numbers(body.seed)})"),
        ("extent", " x ".join(map(number, np.ptp(body.vertices, axis=0).tolist())), "length"),
        ("off the solid", numbers(body.deviation, 3) if any(body.deviation) else "", "outward, inward at most"),
    ]
    page = page_directions(*VIEW)
    eye = np.cross(*page.T)
    lines: list[Mark] = []
    many = sum(len(part.edges) for part in body.parts) > EDGES
    for part in body.parts:
        flat, seen = part.vertices @ page, part.normals @ eye > 0.0
        for element, (origin, end, one, two) in zip(part.elements["E"], part.edges.tolist(), strict=True):
            if element.kind == "E" and not (many and seen[one] == seen[two]):  # else a cut between parts runs here
                lines.append(Mark("front" if seen[one] or seen[two] else "back", (flat[origin], flat[end])))
    lines.sort(key=lambda line: line.style)
    corners, room = np.vstack([body.vertices, body.seed]) @ page, MARGIN * body.size
    limits = np.column_stack([corners.min(axis=0) - room, corners.max(axis=0) + room])
    told = f"{counted(len(lines), 'edge')} of the body, seen from above; the cross is its seed"
    picture = drawing([*lines, Mark("seed", corners[-1], "seed")], limits, told=told)
    return Card(f"Body: {body.name}", facts=facts, lists={"how it was made": body.notes}, picture=picture)


# -------------------------------------------------------------------------------------------------------------- curves


def curve_card(curve: DecisionCurve) -> Card:
    """Return the card of a decision curve: its picture in the box, and its features."""
    segments, points = curve.segments, curve.switching_points
    marks = [*_lines(curve, "before", ""), *_switching(curve)]
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


def _lines(curve: DecisionCurve, style: str, name: str) -> list[Mark]:
    """Return the lines of a curve, those of a snug fit with a wide one below."""
    if len(curve.segments) <= TIPPED:
        runs = [[segment] for segment in curve.segments if segment.snug]
        lines = [Mark(style, (segment.start, segment.end), _tip(segment), name) for segment in curve.segments]
    else:
        chains = [branch.segments for branch in curve.branches]
        runs = [list(run) for chain in chains for snug, run in groupby(chain, attrgetter("snug")) if snug]
        lines = [Mark(style, _corners(chain), "", name) for chain in chains]
    return [*(Mark("snug", _corners(run), "", "snug fit") for run in runs), *lines]


def _switching(curve: DecisionCurve) -> list[Mark]:
    """Return the switching points as marks, none where they are too many to tell apart."""
    points = curve.switching_points if len(curve.switching_points) <= TIPPED else ()
    return [Mark("switch", point.rho, f"SW{point.index} ({numbers(point.rho)}): {point.label}") for point in points]


def _corners(run: Sequence[Segment]) -> list[Any]:
    return [run[0].start, *(segment.end for segment in run)]


def _tip(segment: Segment) -> str:
    return f"S{segment.index} {segment.feature.label}, {segment.configuration}{', snug' if segment.snug else ''}"


# ----------------------------------------------------------------------------------------------- problems and answers


def problem_card(problem: Problem) -> Card:
    """Return the card of a problem: what is asked, and the plane of scales about it."""
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
        picture=_scales(problem),
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
        picture=_scales(problem, solution),
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


def _scales(problem: Problem, solution: Solution | None = None) -> Picture | None:
    """Return the curve about the nominal pair, tolerances, and the pair made; after a motion, the curve then too.

    Star: nominal pair; diamond: the pair made; circle: the tracked point after the motion.
    """
    nominal, made, tracking = problem.nominal_pair, problem.target, problem.goal in TRACKING
    pose, rho = (None, None) if solution is None else (solution.transform, solution.rho)
    signs = [
        Mark("nominal", nominal, f"nominal pair ({numbers(nominal)})", "nominal pair"),
        Mark("target", made, f"pair made ({numbers(made)})", "pair made"),
    ]
    if tracking and rho is not None:
        signs.append(Mark("tracked", rho, f"tracked contact after ({numbers(rho)})", "tracked contact after"))
    areas = []
    if problem.tolerance is not None:
        areas.append(Mark("tolerance", tolerance_box(problem).T, "", "tolerance"))
    if problem.goal == "beyond":
        far = np.where(problem.signs > 0, np.inf, -np.inf)
        areas.append(Mark("required", np.sort(np.column_stack([made, far]), axis=1), "", "required"))
    limits = window(problem, solution if tracking else None)
    curve = partial(decision_curve, problem.movable, problem.static, box=tuple(map(tuple, limits.tolist())))
    before = curve()
    lines = [*_lines(before, "before", "curve as drawn"), *_switching(before)]
    if pose is not None:
        lines += _lines(curve(transform=pose), "after", "curve after the motion")
    told = f"decision curve{'' if pose is None else ' before and after the motion'}, nominal pair and pair made"
    return plane([*areas, *lines, *signs], limits, told=told)


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
    from fcdm_opt.along.coherent_range import KINDS

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
