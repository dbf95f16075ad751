"""What is to be said of two parts as drawn: how they lie, and what is likely to be wrong."""

from __future__ import annotations

import math

import numpy as np

from fcdm_opt.drafting import writing
from fcdm_opt.drafting.choice import ANY_SHIFT, NOISE
from fcdm_opt.drafting.situation import DRAWN, WIDE, Situation
from fcdm_opt.problem.problem import Problem
from fcdm_opt.solver import solve

UNLIKE = 50.0  # ratio of two sizes at which units are likely to be mixed up
FAR = 5.0  # sizes between the parts at which they are likely to be drawn in different frames
MEANT = 1e-3  # share of the size that a gap is below by accident of drawing


def remarks(situation: Situation, unit: str) -> list[str]:
    """Return what is likely to be wrong with the drawing."""
    one, two = situation.movable, situation.static
    found = []
    ratio = max(one.size, two.size) / min(one.size, two.size)
    if ratio > UNLIKE:
        found.append(f"one part is {ratio:.3g} times as large as the other: is one mesh in another unit? (file_unit)")
    if situation.gap > FAR * situation.size:
        found.append(f"the parts are {situation.gap / situation.size:.3g} sizes apart: are both drawn in one frame?")
    if nearly(situation):
        found.append(f"the parts nearly touch ({situation.gap:+.3g} {unit}). {_remedy(situation, unit)}")
    if any(any(body.deviation) for body in (one, two)):
        out, short = (max(ends) for ends in zip(one.deviation, two.deviation, strict=True))
        found.append(f"the parts were approximated: up to {out:.3g} {unit} too large, {short:.3g} {unit} too small")
    return found


def nearly(situation: Situation) -> bool:
    """Tell whether the parts are likely to have been meant to touch."""
    return situation.state != "touching" and abs(situation.gap) <= MEANT * situation.size


def state(situation: Situation, unit: str) -> str:
    """Return how the parts lie, in a sentence."""
    union = len(situation.movable.parts) > 1 or len(situation.static.parts) > 1
    deepest = ", at the deepest pair of convex parts" if union else ""
    words = {
        "touching": "the parts touch",
        "apart": f"the parts are {situation.gap:.6g} {unit} apart",
        "overlapping": f"the parts overlap by {-situation.gap:.6g} {unit}{deepest}",
    }
    text = words[situation.state]
    if situation.state == "touching":
        near = situation.nearest
        return text + (f": {writing.short(near.features)}" if near is not None else "")
    if math.isfinite(situation.growth):
        return f"{text}; both made {situation.growth:.6g} times as large, they would touch"
    low, high = WIDE[0]
    return f"{text}; both made {low:g} to {high:g} times as large, they never just touch"


def _remedy(situation: Situation, unit: str) -> str:
    """Return what to do where a contact is meant that is not drawn: move the drawing, the shortest way."""
    problem = Problem(situation.movable, situation.static, target=DRAWN, goal="touch", motion=ANY_SHIFT)
    solution = solve(problem, effort="quick")
    if not solution.usable or solution.transform is None:
        return f"If they are meant to, move the movable part by {abs(situation.gap):.6g} {unit} in the drawing"
    shift = solution.transform[:3, 3]
    by = writing.point(np.where(np.abs(shift) <= NOISE * situation.size, 0.0, shift), 6)
    return (
        f"If they are meant to touch as drawn, move the movable part in the drawing (CAD) by {by} {unit}: "
        f"the shortest way, {float(np.linalg.norm(shift)):.6g} {unit} along the contact normal"
    )
