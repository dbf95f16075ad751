"""How an answer is drawn on a notebook's card: beside its problem, with the curve after the motion."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

from fcdm_opt.along.coherent_range import KINDS
from fcdm_opt.geometry.units import floored
from fcdm_opt.problem.problem import TRACKING
from fcdm_opt.show.notebook.problem_card import card_title, in_unit, scales_picture
from fcdm_opt.show.notebook.words import Html, card, counted, listing, number, numbers, rows, sentence, table
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.along.coherent_range import CoherentRange
    from fcdm_opt.problem.solution import Certificate, Solution

CHECKS_SHOWN = 30
"""Checks that a certificate's card lists."""


def solution_card(solution: Solution) -> Html:
    """Return the card of an answer: the advice, the motion, how small it is, and what it does to the pair made."""
    problem, status = solution.problem, solution.status.name
    mood = "bad" if not solution.usable else "mind" if status == "PAIR_OVERLAPS" else "good"
    motion, after = [], solution.rho
    length, amount = problem.unit or "length", problem.amount_unit or "length"
    for (name, kind), q, weight in zip(
        problem.motion.parameters, solution.parameters.values(), problem.weights, strict=False
    ):
        unit = "deg" if kind == "rotation" else length
        small = abs(weight * q) <= DEFAULT.tie * solution.amount  # rounding
        motion.append((f"motion {name}", number(0.0 if small else in_unit(q, unit)), unit))
    contact = listing("contact", [own.label for own in solution.features])
    facts = rows(
        [
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
    )
    picture = scales_picture(problem, solution.transform, solution.rho)
    title = card_title("Solution", problem)
    return card(title, sentence(solution.advice), facts, contact, state=status, mood=mood, picture=picture)


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


def certificate_card(certificate: Certificate) -> Html:
    """Return the card: every check, those that failed first."""
    words = {True: "\u2713 passed", False: "\u2717 failed"}
    lines = [
        (words[bool(own.passed)], own.name, number(own.value), number(own.limit), own.note)
        for own in sorted(certificate.checks, key=lambda own: bool(own.passed))
    ]
    told = f"{len(certificate.checks) - len(certificate.failed)} of {counted(len(certificate.checks), 'check')} passed"
    shown = table(("check", "of", "value", "limit", "note"), lines, most=CHECKS_SHOWN)
    state, mood = ("passed", "good") if certificate.passed else ("not passed", "bad")
    return card("Certificate", sentence(told), shown, state=state, mood=mood)


def range_card(found: CoherentRange) -> Html:
    """Return the card: the interval, the motion at both ends, and what ends it there."""
    describe = partial(found.problem.motion.describe, unit=found.problem.unit)
    ends = [
        (
            side,
            number(own.x, 9),
            describe(own.x * found.direction) if math.isfinite(own.x) else "-",
            own.what or KINDS[own.kind],
            "; ".join(new.label for new in own.successors),
        )
        for side, own in zip(("low", "high"), found.events, strict=True)
    ]
    facts = rows(
        [
            ("from, to", f"{number(found.low, 9)}, {number(found.high, 9)}"),
            ("in multiples of", describe(found.direction)),
            ("contact", " & ".join(own.label for own in found.features)),
        ]
    )
    shown = table(("end", "x", "motion there", "what ends it", "takes over"), ends)
    state, mood = ("proved", "good") if found.proved else ("not all proved", "mind")
    return card("Coherent range", facts, shown, state=state, mood=mood)
