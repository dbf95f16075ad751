"""What the cards of an answer, of its certificate and of a coherent range say."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

from fcdm_opt.along.followed import KINDS
from fcdm_opt.geometry.units import floored
from fcdm_opt.problem.problem import TRACKING
from fcdm_opt.show.notebook.card import Card
from fcdm_opt.show.notebook.problem_card import card_title, scales_picture
from fcdm_opt.show.texts import counted, in_unit, number, numbers, parameter_units
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.along.coherent_range import CoherentRange
    from fcdm_opt.problem.solution import Certificate, Solution

CHECKS_SHOWN = 30
"""Checks that a certificate's card lists."""


def mood_of(solution: Solution) -> str:
    """Return the mood of a card about an answer."""
    return "bad" if not solution.usable else "mind" if solution.status.name == "PAIR_OVERLAPS" else "good"


def solution_card(solution: Solution) -> Card:
    """Return the card of an answer: the advice, the motion, how small it is, and what it does to the pair made."""
    problem, after = solution.problem, solution.rho
    length, amount = problem.unit or "length", problem.amount_unit or "length"
    named = zip(solution.parameters.items(), parameter_units(problem), problem.weights, strict=False)
    motion = []
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
        card_title("Solution", problem),
        said=solution.advice,
        facts=facts,
        lists={"contact": [feature.label for feature in solution.features]},
        state=solution.status.name,
        mood=mood_of(solution),
        picture=scales_picture(problem, solution),
    )


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
