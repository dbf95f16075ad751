"""The cards of what-ifs, yields, maps, poses for all sizes, and studies."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.design.compensation.assembly_yield import OTHERS
from fcdm_opt.design.fixed_pose.best_pose import NONE, UNDECIDED
from fcdm_opt.design.fixed_pose.clearances import gaps_text
from fcdm_opt.design.study.results import PENDING
from fcdm_opt.show.notebook.pictures import Line, Point, plane
from fcdm_opt.show.notebook.words import Html, card, counted, number, numbers, rows, sentence, table

if TYPE_CHECKING:
    from fcdm_opt.design.compensation.assembly_yield import AssemblyYield
    from fcdm_opt.design.compensation.compensation_map import CompensationMap
    from fcdm_opt.design.fixed_pose.best_pose import BestPose
    from fcdm_opt.design.fixed_pose.clearances import Clearances
    from fcdm_opt.design.study.results import Share, StudyResult
    from fcdm_opt.design.whatif.whatif import WhatIf


def whatif_card(answer: WhatIf) -> Html:
    """Return the card: the amounts, and what else of the answer changed."""
    before, after = answer.before, answer.after
    told = number(answer.predicted_amount)
    if np.isnan(answer.predicted_amount):
        told = "; ".join(answer.prediction.reasons) or "no amount before"
    facts = rows(
        [
            ("changed", ", ".join(answer.changed) or "nothing"),
            ("amount", f"{number(before.amount)} to {number(after.amount)}", after.problem.amount_unit or "length"),
            ("foretold", told),
            ("status before", before.status.name if before.status is not after.status else ""),
        ]
    )
    kinds = {f"parameters.{name}": kind for own in (before, after) for name, kind in own.problem.motion.parameters}
    lines = [(own.name, *(_shown(value, kinds.get(own.name, "")) for value in own[1:])) for own in answer.differences]
    shown = table(("of the answer", "before", "after"), lines)
    mood = "bad" if not after.usable else "good" if after.status.name != "PAIR_OVERLAPS" else "mind"
    return card("What if", sentence(after.advice), facts, shown, state=after.status.name, mood=mood)


def yield_card(found: AssemblyYield) -> Html:
    """Return the card: the share with its interval, quantiles, and which body's tolerance matters."""
    (low, high), sure = found.interval, f"{100.0 * found.confidence:.6g} % sure"
    facts = rows(
        [
            ("pairs that pass", f"{found.share:.4%}", f"{sure}: {low:.4%} to {high:.4%}"),
            ("pairs looked at", str(found.count)),
            ("budget", number(found.budget) if math.isfinite(found.budget) else "", found.unit or "length"),
            *((what, f"{share:.4%}") for what in OTHERS if (share := getattr(found, what))),
        ]
    )
    shares = table(("of all pairs", "amount at most"), [(f"{u:g}", number(x)) for u, x in found.quantiles.items()])
    lines = [(own.body, number(own.total, 3), f"{own.share_without:.2%}") for own in found.contributions]
    bodies = table(("body", "share of the variance", "would pass at its median size"), lines)
    return card("Assembly yield", facts, shares, bodies, state=f"{found.share:.2%} pass")


def map_card(own_map: CompensationMap) -> Html:
    """Return the card: its regions, their boundaries over the box, and its error."""
    length = own_map.unit or "length"
    facts = rows(
        [
            (
                "triangles",
                str(len(own_map.table)),
                f"from {counted(own_map.solved, 'solve')} in {own_map.seconds:.1f} s",
            ),
            ("error at most", number(own_map.reached, 3), f"{length}, asked for {number(own_map.error, 3)}"),
        ]
    )
    amounts = [" to ".join(map(number, own.amounts)) for own in own_map.regions]
    lines = [
        (k, f"{own.share:.1%}", amount if own.kind == "motion" else "-", own)
        for k, (own, amount) in enumerate(zip(own_map.regions, amounts, strict=True), 1)
    ]
    shown = table(("region", "of the box", "amount", "held by"), lines)
    looks = {False: ("before", "", "boundary"), True: ("after", "", "boundary with a jump")}
    marks = [Line(own.points, *looks[own.jumps]) for own in own_map.boundaries]
    nominal = Point(own_map.nominal, "nominal", "", "nominal pair")
    told = f"{counted(len(own_map.regions), 'region')} over the box of sizes"
    picture = plane([*marks, nominal], own_map.box, told=told)
    state, mood = "as accurate as asked", "good"
    if not own_map.reached <= own_map.error:
        state, mood = "less accurate than asked", "mind"
    return card("Compensation map", facts, shown, state=state, mood=mood, picture=picture)


def best_pose_card(best: BestPose) -> Html:
    """Return the card: the pose, the range of its gaps, and what is proved."""
    length = best.unit or "length"
    facts = rows(
        [
            ("pose", best.motion, ""),
            ("amount", number(best.amount), length),
            ("gaps", gaps_text(best.least.gap, best.most.gap, best.unit), "of all sizes"),
            ("worst gap", number(best.worst_gap), f"{length}, clearance or interference"),
            ("what is made small", number(best.value), f"{length}, proved at least {number(best.lower_bound)}"),
            ("confirmed", "yes" if best.passed else "no", counted(len(best.checks), "check")),
        ]
    )
    mood = "bad" if best.status in (NONE, UNDECIDED) or not best.passed else "good" if best.certified else "mind"
    return card("Best pose for all sizes", facts, state=best.status, mood=mood)


def clearances_card(found: Clearances) -> Html:
    """Return the card: the range of the gap with what it is taken at, and the share that overlaps."""
    low, high = found.interference_interval
    facts = rows(
        [
            ("gap", f"{number(found.least.gap)} to {number(found.most.gap)}", found.unit or "length"),
            ("interference", f"{found.interference:.3%}", f"of {found.source}; 95 % sure: {low:.3%} to {high:.3%}"),
        ]
    )
    ends = [
        (name, number(own.gap), numbers(own.rho), own.feature)
        for name, own in (("least", found.least), ("largest", found.most))
    ]
    shown = table(("gap", found.unit or "length", "at the sizes", "between"), ends)
    quantiles = [(f"{share:.5g}", number(gap)) for share, gap in found.quantiles.tolist()]
    shares = table(("of all pairs", "gap at most"), quantiles)
    state, mood = ("never overlapping", "good") if found.least.gap >= 0.0 else ("overlapping at some sizes", "mind")
    return card("Clearances at one pose", facts, shown, shares, state=state, mood=mood)


def study_card(study: StudyResult) -> Html:
    """Return the card: how many points have which status, amounts, yield and time."""
    amounts = sorted(row["amount"] for key, _ in study.points if (row := study.answer(key)) and row["usable"])
    length = study.unit or "length"
    varied = "; ".join(f"{label}: {counted(len(values), 'value')}" for label, values in study.axes.items())
    share = study.assembly_yield
    facts = rows(
        [
            ("points", str(len(study.points)), varied),
            ("least amount", number(amounts[0]) if amounts else "", length),
            ("middle amount", number(amounts[len(amounts) // 2]) if amounts else "", length),
            ("largest amount", number(amounts[-1]) if amounts else "", length),
            *([] if share is None else [("yield", f"{share.share:.2%}", _yield_told(share))]),
            ("working time", number(study.seconds.get("point"), 3) if study.seconds else "", "s"),
        ]
    )
    counts = table(("status", "points"), [(status, count) for status, count in study.counts.items()])
    state, mood = ("complete", "good") if study.complete else (f"{study.counts[PENDING]} not worked out yet", "mind")
    return card(f"Study: {study.definition.get('title') or 'without title'}", facts, counts, state=state, mood=mood)


def _shown(value: Any, kind: str = "") -> str:
    """Return a plain value as a card shows it, rotations in degrees."""
    if kind == "rotation" and value is not None:
        return f"{number(np.degrees(value))} deg"
    if isinstance(value, list):
        return "; ".join(map(_shown, value))
    return number(value) if value is None or type(value) is float else str(value)


def _yield_told(share: Share) -> str:
    low, high = share.interval
    sure = f"{share.confidence:.0%} interval {low:.2%} to {high:.2%}"
    return f"within {number(share.budget)} ({share.within} of {share.of}; {sure})"
