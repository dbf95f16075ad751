"""What a notebook shows of a result: a small card of words and numbers, and a picture of the package beside them.

A card is one piece of HTML that depends on nothing: no script, no style sheet, no identifier, nothing from outside.
Notebook viewers drop all of these; what is left even without inline styles can still be read. Words take the colour of
the page, light or dark, and no state is told by colour alone. Equal results give equal bytes. What a card says is
gathered here as plain values; the template `card.html` escapes them.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fcdm_opt.design.compensation.table import simplices
from fcdm_opt.geometry.facet_errors import deviation_of
from fcdm_opt.problem.problem import TRACKING
from fcdm_opt.show import Figure, bare_pixels
from fcdm_opt.show.assemblies import assembly_figure, assembly_instruction, assembly_verdict, part_texts, verdict_of
from fcdm_opt.show.maps import map_figure
from fcdm_opt.show.plots import before_after_figure, decision_curve_figure
from fcdm_opt.show.rendering import rendered
from fcdm_opt.show.scene import body_figure
from fcdm_opt.show.texts import (
    bound_text,
    counted,
    in_unit,
    limits_texts,
    number,
    numbers,
    outcome_text,
    parameter_units,
    proved_least,
    share_text,
    study_facts,
)
from fcdm_opt.show.verdict import held_text, instruction, verdict_text
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.along.coherent_range import CoherentRange
    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.design.cases import SolvedCases
    from fcdm_opt.design.compensation.assembly_yield import AssemblyYield
    from fcdm_opt.design.compensation.compensation_map import CompensationMap
    from fcdm_opt.design.fixed_pose.best_pose import BestPose
    from fcdm_opt.design.fixed_pose.clearances import Clearances
    from fcdm_opt.design.study.results import StudyResult
    from fcdm_opt.design.whatif.whatif import WhatIf
    from fcdm_opt.geometry.bodies import Body
    from fcdm_opt.lazy_import import NotebookRepr
    from fcdm_opt.problem.assembled import AssemblySolution
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.problem.scene import Scene
    from fcdm_opt.problem.solution import Bounded, Certificate, Solution

Fact = tuple[str, ...]  # name, value, and a unit or remark where there is one
Rows = tuple[Sequence[str], Sequence[Sequence[object]]]

LISTED, CHECKS_SHOWN = 12, 30  # lines of a list or table, and checks of a certificate, that are shown
DOTS = 100  # dots per inch of a card's picture


class Card(NamedTuple):
    """A card, from its top to its bottom; texts are plain.

    Below its title is a sentence, `summary`, then facts, (name, value) or (name, value, unit), of which those without a
    value are left out, tables, (heads, lines), and lists of lines by name; of each table and list `most` lines are
    shown, and how many more there are is said. `state` is in a badge beside the title, with a sign before it that tells
    the mood: "good", "bad", "mind" or "". Facts that are `struck` the judge refused. The picture is beside all that, or
    below it where the page is narrow; `caption` is what it shows, for who cannot see it.
    """

    title: str
    summary: str = ""
    facts: Sequence[Fact] = ()
    tables: Sequence[Rows] = ()
    lists: Mapping[str, Sequence[str]] = {}
    state: str = ""
    mood: str = ""
    picture: Figure | None = None
    caption: str = ""
    struck: Sequence[str] = ()
    most: int = LISTED

    @property
    def html(self) -> str:
        """The card as one line of HTML."""
        data = {**self._asdict(), "facts": [fact for fact in self.facts if fact[1]]}
        if self.picture is not None:
            across = int(DOTS * self.picture.get_figwidth())
            data["picture"] = b64encode(bare_pixels(self.picture, across=across)).decode()
        return "".join(map(str.strip, rendered("card.html", card=data).split("\n")))


# --------------------------------------------------------------------------------------------------------------- bodies


def body_card(body: Body) -> Card:
    """Return the card of a body: what it is made of, its seed, and its faces and edges."""
    facts = [
        ("corners", str(len(body.corners))),
        ("faces", str(len(body.faces))),
        ("convex parts", str(len(body.parts))),
        ("seed", f"({numbers(body.seed)})"),
        ("extent", " x ".join(map(number, np.ptp(body.vertices, axis=0).tolist())), body.unit or "length units"),
        ("off the solid", numbers(off, 3) if any(off := deviation_of(body)) else "", "outward, inward at most"),
    ]
    text = f"{counted(len(body.faces), 'face')} of the body; the cross is its seed"
    lists = {"how it was made": body.notes}
    return Card(f"Body: {body.name}", facts=facts, lists=lists, picture=body_figure(body), caption=text)


# --------------------------------------------------------------------------------------------------------------- curves


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
    text = f"decision curve, {counted(len(segments), 'segment')}"
    picture = decision_curve_figure(curve, tables=False) if segments and np.isfinite(curve.box).all() else None
    return Card("Decision curve", facts=facts, lists=lists, state=curve.status, picture=picture, caption=text)


# ------------------------------------------------------------------------------------------------- problems and answers


def problem_card(problem: Problem) -> Card:
    """Return the card of a problem: what is asked, and the curve with what it is about."""
    names = problem.motion.names
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
        lists={"limits": limits_texts(problem), "tracked contact": [own.label for own in problem.tracked_features]},
        state="to be solved",
        picture=before_after_figure(problem),
        caption="decision curve, nominal pair and pair made",
    )


def solution_card(solution: Solution) -> Card:
    """Return the card of an answer: the advice, the motion, how small it is, and what it does to the pair made."""
    problem, after, motion = solution.problem, solution.rho, list[Fact]()
    named = zip(solution.parameters.items(), parameter_units(problem), problem.weights, strict=False)
    for (name, q), unit, weight in named:
        small = abs(weight * q) <= DEFAULT.tie * solution.amount  # rounding
        motion.append((f"motion {name}", number(0.0 if small else in_unit(q, unit)), unit))
    made = [
        ("pair made", f"({numbers(solution.pair)})"),
        ("its state after", solution.pair_state, f"gap {number(solution.pair_gap)} {problem.unit or 'length'}"),
        ("tracked contact at", f"({numbers(after)})" if after is not None and problem.goal in TRACKING else ""),
    ]
    advice = f". {solution.advice}" * (solution.status.name not in ("SOLVED", "ALREADY_SATISFIED"))
    return _answer_card(
        solution,
        f"{verdict_text(solution)}{advice}",
        motion=motion,
        made=made,
        lists={"contact": [feature.described(problem.movable, problem.static) for feature in solution.features]},
        picture=before_after_figure(problem, solution),
        caption="decision curve before and after the motion, nominal pair and pair made",
    )


def cases_card(cases: SolvedCases) -> Card:
    """Return the card of several answers: a line for each case."""
    lines = [
        (name, outcome_text(solution), number(solution.amount), solution.amount_unit or "length",
         _bound(solution, "")[0], getattr(solution, "pair_state", "-"), _instruction(solution))
        for name, solution in cases.items()
    ]  # fmt: skip
    usable = sum(solution.usable for solution in cases.values())
    return Card(
        counted(len(cases), "case"),
        tables=[(("case", "status", "amount", "unit", "proved at least", "pair made", "motion"), lines)],
        state=f"{usable} of {len(cases)} usable",
        mood="good" if usable == len(cases) else "bad",
        most=CHECKS_SHOWN,
    )


def assembly_card(solution: AssemblySolution) -> Card:
    """Return the card of an answer about several parts: what moves how far, how small that is, and the parts then."""
    return _answer_card(
        solution,
        assembly_verdict(solution),
        tables=[(("part", "relative to", "made", "motion", "amount"), part_texts(solution))],
        lists={"settled by": solution.stages},
        picture=assembly_figure(solution),
        caption="the parts after their motions" if solution.usable else "the parts as made",
    )


def _answer_card(
    solution: Bounded, verdict: str, *, motion: Sequence[Fact] = (), made: Sequence[Fact] = (), **more: Any
) -> Card:
    """Return the card of an answer; facts about a motion that the judge refused are struck out."""
    unit, known = solution.amount_unit or "length", ("pair made", "verified", "settled by", "time")
    facts: list[Fact] = [
        *motion,
        ("amount", number(solution.amount), f"{unit}, {solution.doubt}" if solution.doubt else unit),
        ("proved at least", *_bound(solution, unit)),
        *made,
        ("verified", _verdict(solution)),
        ("settled by", getattr(solution, "stage", "")),
        ("time", number(sum(solution.seconds.values()), 3) if solution.seconds else "", "s"),
    ]
    struck = [name for name, *_ in facts if solution.status.name == "NOT_VERIFIED" and name not in known]
    return Card(
        _title("Solution", solution.question),
        summary=f"{verdict[:1].upper()}{verdict[1:]}",
        facts=facts,
        state=solution.status.words,
        mood=mood_of(solution),
        struck=struck,
        **more,
    )


def mood_of(solution: Bounded) -> str:
    """Return the mood of a card about an answer."""
    return "bad" if not solution.usable else "mind" if solution.status.name == "PAIR_OVERLAPS" else "good"


def _title(what: str, problem: Scene) -> str:
    return f"{what}: {problem.name}" if problem.name else what


def _instruction(solution: Any) -> str:
    """Return what to move how far, of two parts or several; why nothing where that is not known."""
    if not solution.usable:
        return verdict_of(solution)
    return (assembly_instruction if hasattr(solution, "assembly") else instruction)(solution)


def _bound(solution: Bounded, unit: str) -> tuple[str, str]:
    """Return the lower bound, to as many digits as the amount, and how far below the amount it is."""
    text = bound_text(solution).split("\n")[0]
    if not solution.lower_bound > 0.0:
        return "0", "(nothing is proved)" if solution.amount else unit
    if text == "-" or math.isinf(solution.lower_bound):
        return text, ""
    near = "of the mesh" if solution.left_by_mesh else "exact"
    gap = near if proved_least(solution) else f"relative gap {number(solution.gap, 2)}"
    return text, f"{unit}, {gap}" if math.isfinite(solution.gap) else unit


def _verdict(solution: Bounded) -> str:
    certificate = solution.certificate
    if certificate is None or not solution.status.found:
        return "" if certificate is None else "no motion to verify"
    if solution.status.name == "OUTSIDE_FIT":
        return f"no: {outcome_text(solution)}"
    if certificate.passed:
        return f"yes, {counted(len(certificate.checks), 'check')} passed"
    return f"no: {', '.join(check.name for check in certificate.failed) or 'no checks'}"


def certificate_card(certificate: Certificate) -> Card:
    """Return the card: every check, those that failed first."""
    words = {True: "\u2713 passed", False: "\u2717 failed"}
    lines = [
        (words[bool(check.passed)], check.name, *(number(x, least=0.0) for x in (check.value, check.limit)), check.note)
        for check in sorted(certificate.checks, key=lambda check: bool(check.passed))
    ]
    held = len(certificate.checks) - len(certificate.failed)
    return Card(
        "Certificate",
        summary=f"{held} of {counted(len(certificate.checks), 'check')} passed",
        tables=[(("result", "check", "value", "limit", "note"), lines)],
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


# -------------------------------------------------------------------------------------------------------------- what if


def whatif_card(answer: WhatIf) -> Card:
    """Return the card: the amounts, and what else of the answer changed."""
    before, after = answer.before, answer.after
    text = number(answer.predicted_amount)
    if np.isnan(answer.predicted_amount):
        text = "; ".join(answer.prediction.reasons) or "no amount before"
    facts = [
        ("changed", ", ".join(answer.changed) or "nothing"),
        ("amount", f"{number(before.amount)} to {number(after.amount)}", after.problem.amount_unit or "length"),
        ("predicted", text),
        ("status before", before.status.words if before.status is not after.status else ""),
    ]
    kinds = {f"parameters.{name}": kind for each in (before, after) for name, kind in each.problem.motion.parameters}
    lines = list[tuple[str, ...]]()
    for name, *ends in answer.differences:
        both, held = zip(ends, (before, after), strict=True), name in ("features", "active")
        texts = (held_text(x or (), own.question) if held else _shown(x, kinds.get(name, "")) for x, own in both)
        lines.append((name, *texts))
    tables = [(("of the answer", "before", "after"), lines)]
    state, mood = after.status.words, mood_of(after)
    return Card("What if", summary=after.advice, facts=facts, tables=tables, state=state, mood=mood)


def yield_card(result: AssemblyYield) -> Card:
    """Return the card: the share with its interval, quantiles, and which body's tolerance matters."""
    from fcdm_opt.design.compensation.assembly_yield import OTHERS

    (low, high), sure = result.interval, f"{100.0 * result.confidence:.6g} % confidence"
    facts = [
        ("pairs that pass", share_text(result.share, 4), f"{sure}: {low:.4%} to {high:.4%}"),
        ("pairs within the map's ends", f"{1.0 - result.outside:.4%}", f"of {result.count}, which count"),
        ("budget", number(result.budget) if math.isfinite(result.budget) else "", result.unit or "length"),
        *((what, f"{share:.4%}") for what in OTHERS if (share := getattr(result, what))),
    ]
    bodies = [(body.body, number(body.total, 3), share_text(body.share_without)) for body in result.contributions]
    tables: list[Rows] = [
        (("of all pairs", "amount at most"), [(f"{u:g}", number(x)) for u, x in result.quantiles.items()]),
        (("size", "share of the amount's variance", "would pass at its median size"), bodies),
    ]
    state = f"{share_text(result.share)}{' pass' * (result.share >= 0.0)}"
    return Card("Assembly yield", facts=facts, tables=tables, state=state)


def map_card(sizes: CompensationMap) -> Card:
    """Return the card: its regions, their boundaries over the box, and its error."""
    solves = f"from {counted(sizes.solved, 'solve')} in {sizes.seconds:.1f} s"
    lines = [
        (k, f"{region.share:.1%}", " to ".join(map(number, region.amounts)) if region.kind == "motion" else "-", region)
        for k, region in enumerate(sizes.regions, 1)
    ]
    exact = sizes.reached <= sizes.error
    return Card(
        "Compensation map",
        facts=[("cells", simplices(len(sizes.table), len(sizes.over)), solves), ("largest error", sizes.error_text)],
        tables=[(("region", "of the box", "amount", "held by"), lines)],
        state="as accurate as asked" if exact else "less accurate than asked",
        mood="good" if exact else "mind",
        picture=map_figure(sizes),
        caption=f"{counted(len(sizes.regions), 'region')} over the box of sizes",
    )


def best_pose_card(best: BestPose) -> Card:
    """Return the card: the pose, the range of its gaps, and what is proved."""
    from fcdm_opt.design.fixed_pose.best_pose import NONE, UNDECIDED
    from fcdm_opt.design.fixed_pose.clearances import gaps_text

    length = best.unit or "length"
    facts = [
        ("pose", best.motion, ""),
        ("amount", number(best.amount), length),
        ("gaps", gaps_text(best.least.gap, best.most.gap, best.unit), "of all sizes"),
        ("worst gap", number(best.worst_gap), f"{length}, clearance or interference"),
        ("what is made small", number(best.value), f"{length}, proved at least {number(best.lower_bound)}"),
        ("confirmed", "yes" if best.passed else "no", counted(len(best.checks), "check")),
    ]
    facts += [("outside the fit", "yes", "limits would keep the part in")] * best.leaves_fit
    refused = best.status in (NONE, UNDECIDED) or not best.passed or best.leaves_fit
    mood = "bad" if refused else "good" if best.certified else "mind"
    return Card(
        "Best pose for all sizes",
        summary=best.refusal,
        facts=facts,
        state=best.status,
        mood=mood,
        struck=[name for name, *_ in facts if best.refusal and name != "confirmed"],
    )


def clearances_card(clearances: Clearances) -> Card:
    """Return the card: the range of the gap with what it is taken at, and the share that overlaps."""
    sure = "{:.3%} to {:.3%} with 95 % confidence".format(*clearances.interference_interval)
    facts = [
        ("gap", f"{number(clearances.least.gap)} to {number(clearances.most.gap)}", clearances.unit or "length"),
        ("interference", f"{clearances.interference:.3%}", f"of {clearances.source}; {sure}"),
    ]
    named = (("least", clearances.least), ("largest", clearances.most))
    ends = [(name, number(end.gap), end.sizes_text, end.feature) for name, end in named]
    quantiles = [(f"{share:.5g}", number(gap)) for share, gap in clearances.quantiles.tolist()]
    tables: list[Rows] = [
        (("gap", clearances.unit or "length", "at the sizes", "between"), ends),
        (("of all pairs", "gap at most"), quantiles),
    ]
    clear = clearances.least.gap >= 0.0
    return Card(
        "Clearances at one pose",
        facts=facts,
        tables=tables,
        state="never overlapping" if clear else "overlapping at some sizes",
        mood="good" if clear else "mind",
    )


def study_card(study: StudyResult) -> Card:
    """Return the card: what was varied, how many points have which status, amounts, yield and time."""
    from fcdm_opt.design.study.results import PENDING

    varied = "; ".join(f"{label}: {counted(len(values), 'value')}" for label, values in study.axes.items())
    return Card(
        f"Study: {study.definition.get('title') or 'without title'}",
        facts=[("varied", varied), *study_facts(study)],
        state="complete" if study.complete else f"{study.counts[PENDING]} not worked out yet",
        mood="good" if study.complete else "mind",
    )


def _shown(value: Any, kind: str = "") -> str:
    """Return a plain value as a card shows it, rotations in degrees."""
    if kind == "rotation" and value is not None:
        return f"{number(np.degrees(value))} deg"
    if isinstance(value, list):
        return "; ".join(map(_shown, value))
    return number(value) if value is None or type(value) is float else str(value)


# ----------------------------------------------------------------------------------------------------- which card is it

CARDS: dict[str, Callable[[Any], Card]] = {
    "Body": body_card,
    "DecisionCurve": curve_card,
    "Problem": problem_card,
    "Solution": solution_card,
    "AssemblySolution": assembly_card,
    "SolvedCases": cases_card,
    "Certificate": certificate_card,
    "CoherentRange": range_card,
    "WhatIf": whatif_card,
    "AssemblyYield": yield_card,
    "CompensationMap": map_card,
    "BestPose": best_pose_card,
    "Clearances": clearances_card,
    "StudyResult": study_card,
}
"""The function that says what stands on each class's card."""


def card_of(result: NotebookRepr) -> str:
    """Return the card of a result."""
    return next(CARDS[base.__name__] for base in type(result).__mro__ if base.__name__ in CARDS)(result).html
