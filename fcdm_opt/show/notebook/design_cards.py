"""What the cards of what-ifs, yields, maps, poses for all sizes, and studies say."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.design.compensation.assembly_yield import OTHERS
from fcdm_opt.design.fixed_pose.best_pose import NONE, UNDECIDED
from fcdm_opt.design.fixed_pose.clearances import gaps_text
from fcdm_opt.design.study.results import PENDING
from fcdm_opt.show.maps import map_figure
from fcdm_opt.show.notebook.cards import Card, Rows, mood_of
from fcdm_opt.show.texts import counted, number, numbers, study_facts

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
    kinds = {f"parameters.{name}": kind for each in (before, after) for name, kind in each.problem.motion.parameters}
    lines = [
        (each.name, *(_shown(value, kinds.get(each.name, "")) for value in each[1:])) for each in answer.differences
    ]
    tables = [(("of the answer", "before", "after"), lines)]
    state, mood = after.status.name, mood_of(after)
    return Card("What if", said=after.advice, facts=facts, tables=tables, state=state, mood=mood)


def yield_card(result: AssemblyYield) -> Card:
    """Return the card: the share with its interval, quantiles, and which body's tolerance matters."""
    (low, high), sure = result.interval, f"{100.0 * result.confidence:.6g} % sure"
    facts = [
        ("pairs that pass", f"{result.share:.4%}", f"{sure}: {low:.4%} to {high:.4%}"),
        ("pairs looked at", str(result.count)),
        ("budget", number(result.budget) if math.isfinite(result.budget) else "", result.unit or "length"),
        *((what, f"{share:.4%}") for what in OTHERS if (share := getattr(result, what))),
    ]
    bodies = [(body.body, number(body.total, 3), f"{body.share_without:.2%}") for body in result.contributions]
    tables: list[Rows] = [
        (("of all pairs", "amount at most"), [(f"{u:g}", number(x)) for u, x in result.quantiles.items()]),
        (("body", "share of the variance", "would pass at its median size"), bodies),
    ]
    return Card("Assembly yield", facts=facts, tables=tables, state=f"{result.share:.2%} pass")


def map_card(sizes: CompensationMap) -> Card:
    """Return the card: its regions, their boundaries over the box, and its error."""
    solves = f"from {counted(sizes.solved, 'solve')} in {sizes.seconds:.1f} s"
    length = sizes.unit or "length"
    lines = [
        (k, f"{region.share:.1%}", " to ".join(map(number, region.amounts)) if region.kind == "motion" else "-", region)
        for k, region in enumerate(sizes.regions, 1)
    ]
    exact = sizes.reached <= sizes.error
    return Card(
        "Compensation map",
        facts=[
            ("triangles", str(len(sizes.table)), solves),
            ("error at most", number(sizes.reached, 3), f"{length}, asked for {number(sizes.error, 3)}"),
        ],
        tables=[(("region", "of the box", "amount", "held by"), lines)],
        state="as accurate as asked" if exact else "less accurate than asked",
        mood="good" if exact else "mind",
        picture=map_figure(sizes),
        told=f"{counted(len(sizes.regions), 'region')} over the box of sizes",
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


def clearances_card(clearances: Clearances) -> Card:
    """Return the card: the range of the gap with what it is taken at, and the share that overlaps."""
    sure = "95 % sure: {:.3%} to {:.3%}".format(*clearances.interference_interval)
    facts = [
        ("gap", f"{number(clearances.least.gap)} to {number(clearances.most.gap)}", clearances.unit or "length"),
        ("interference", f"{clearances.interference:.3%}", f"of {clearances.source}; {sure}"),
    ]
    named = (("least", clearances.least), ("largest", clearances.most))
    ends = [(name, number(end.gap), numbers(end.rho), end.feature) for name, end in named]
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
