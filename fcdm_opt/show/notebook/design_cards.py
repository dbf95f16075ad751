"""What the cards of what-ifs, yields, maps, poses for all sizes, and studies say."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.design.compensation.assembly_yield import OTHERS
from fcdm_opt.design.fixed_pose.best_pose import NONE, UNDECIDED
from fcdm_opt.design.fixed_pose.clearances import gaps_text
from fcdm_opt.design.study.results import PENDING
from fcdm_opt.show.notebook.card import Card
from fcdm_opt.show.notebook.pictures import Mark, plane
from fcdm_opt.show.notebook.solution_card import mood_of
from fcdm_opt.show.texts import counted, number, numbers

if TYPE_CHECKING:
    from fcdm_opt.design.compensation.assembly_yield import AssemblyYield
    from fcdm_opt.design.compensation.compensation_map import CompensationMap
    from fcdm_opt.design.fixed_pose.best_pose import BestPose
    from fcdm_opt.design.fixed_pose.clearances import Clearances
    from fcdm_opt.design.study.results import StudyResult
    from fcdm_opt.design.whatif.whatif import WhatIf


def whatif_card(answer: WhatIf) -> Card:
    """Return the card: the amounts, and what else of the answer changed."""
    before, after = answer.before, answer.after
    told = number(answer.predicted_amount)
    if np.isnan(answer.predicted_amount):
        told = "; ".join(answer.prediction.reasons) or "no amount before"
    facts = [
        ("changed", ", ".join(answer.changed) or "nothing"),
        ("amount", f"{number(before.amount)} to {number(after.amount)}", after.problem.amount_unit or "length"),
        ("foretold", told),
        ("status before", before.status.name if before.status is not after.status else ""),
    ]
    kinds = {f"parameters.{name}": kind for own in (before, after) for name, kind in own.problem.motion.parameters}
    lines = [(own.name, *(_shown(value, kinds.get(own.name, "")) for value in own[1:])) for own in answer.differences]
    tables = [(("of the answer", "before", "after"), lines)]
    state, mood = after.status.name, mood_of(after)
    return Card("What if", said=after.advice, facts=facts, tables=tables, state=state, mood=mood)


def yield_card(found: AssemblyYield) -> Card:
    """Return the card: the share with its interval, quantiles, and which body's tolerance matters."""
    (low, high), sure = found.interval, f"{100.0 * found.confidence:.6g} % sure"
    facts = [
        ("pairs that pass", f"{found.share:.4%}", f"{sure}: {low:.4%} to {high:.4%}"),
        ("pairs looked at", str(found.count)),
        ("budget", number(found.budget) if math.isfinite(found.budget) else "", found.unit or "length"),
        *((what, f"{share:.4%}") for what in OTHERS if (share := getattr(found, what))),
    ]
    bodies = [(own.body, number(own.total, 3), f"{own.share_without:.2%}") for own in found.contributions]
    tables = [
        (("of all pairs", "amount at most"), [(f"{u:g}", number(x)) for u, x in found.quantiles.items()]),
        (("body", "share of the variance", "would pass at its median size"), bodies),
    ]
    return Card("Assembly yield", facts=facts, tables=tables, state=f"{found.share:.2%} pass")


def map_card(found: CompensationMap) -> Card:
    """Return the card: its regions, their boundaries over the box, and its error."""
    solves = f"from {counted(found.solved, 'solve')} in {found.seconds:.1f} s"
    length = found.unit or "length"
    lines = [
        (k, f"{own.share:.1%}", " to ".join(map(number, own.amounts)) if own.kind == "motion" else "-", own)
        for k, own in enumerate(found.regions, 1)
    ]
    looks = {False: ("before", "boundary"), True: ("after", "boundary with a jump")}
    marks = [Mark(style, own.points, "", name) for own in found.boundaries for style, name in [looks[own.jumps]]]
    nominal = Mark("nominal", found.nominal, "", "nominal pair")
    told = f"{counted(len(found.regions), 'region')} over the box of sizes"
    exact = found.reached <= found.error
    return Card(
        "Compensation map",
        facts=[
            ("triangles", str(len(found.table)), solves),
            ("error at most", number(found.reached, 3), f"{length}, asked for {number(found.error, 3)}"),
        ],
        tables=[(("region", "of the box", "amount", "held by"), lines)],
        state="as accurate as asked" if exact else "less accurate than asked",
        mood="good" if exact else "mind",
        picture=plane([*marks, nominal], found.box, told=told),
    )


def best_pose_card(best: BestPose) -> Card:
    """Return the card: the pose, the range of its gaps, and what is proved."""
    length = best.unit or "length"
    facts = [
        ("pose", best.motion, ""),
        ("amount", number(best.amount), length),
        ("gaps", gaps_text(best.least.gap, best.most.gap, best.unit), "of all sizes"),
        ("worst gap", number(best.worst_gap), f"{length}, clearance or interference"),
        ("what is made small", number(best.value), f"{length}, proved at least {number(best.lower_bound)}"),
        ("confirmed", "yes" if best.passed else "no", counted(len(best.checks), "check")),
    ]
    mood = "bad" if best.status in (NONE, UNDECIDED) or not best.passed else "good" if best.certified else "mind"
    return Card("Best pose for all sizes", facts=facts, state=best.status, mood=mood)


def clearances_card(found: Clearances) -> Card:
    """Return the card: the range of the gap with what it is taken at, and the share that overlaps."""
    low, high = found.interference_interval
    facts = [
        ("gap", f"{number(found.least.gap)} to {number(found.most.gap)}", found.unit or "length"),
        ("interference", f"{found.interference:.3%}", f"of {found.source}; 95 % sure: {low:.3%} to {high:.3%}"),
    ]
    named = (("least", found.least), ("largest", found.most))
    ends = [(name, number(end.gap), numbers(end.rho), end.feature) for name, end in named]
    quantiles = [(f"{share:.5g}", number(gap)) for share, gap in found.quantiles.tolist()]
    tables = [
        (("gap", found.unit or "length", "at the sizes", "between"), ends),
        (("of all pairs", "gap at most"), quantiles),
    ]
    state, mood = ("never overlapping", "good") if found.least.gap >= 0.0 else ("overlapping at some sizes", "mind")
    return Card("Clearances at one pose", facts=facts, tables=tables, state=state, mood=mood)


def study_card(study: StudyResult) -> Card:
    """Return the card: how many points have which status, amounts, yield and time."""
    amounts = sorted(row["amount"] for key, _ in study.points if (row := study.answer(key)) and row["usable"])
    length = study.unit or "length"
    varied = "; ".join(f"{label}: {counted(len(values), 'value')}" for label, values in study.axes.items())
    facts = [("points", str(len(study.points)), varied)]
    if amounts:
        ends = (("least", 0), ("middle", len(amounts) // 2), ("largest", -1))
        facts += [(f"{name} amount", number(amounts[k]), length) for name, k in ends]
    if (share := study.assembly_yield) is not None:
        low, high = share.interval
        sure = f"{share.confidence:.0%} interval {low:.2%} to {high:.2%}"
        told = f"within {number(share.budget)} ({share.within} of {share.of}; {sure})"
        facts.append(("yield", f"{share.share:.2%}", told))
    if study.seconds:
        facts.append(("working time", number(study.seconds.get("point"), 3), "s"))
    return Card(
        f"Study: {study.definition.get('title') or 'without title'}",
        facts=facts,
        tables=[(("status", "points"), list(study.counts.items()))],
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
