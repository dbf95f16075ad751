"""An answer in the user's terms: the way back from a task to its problem."""

from __future__ import annotations

from typing import Any

import numpy as np

from fcdm_opt.curve.contact import touching_features
from fcdm_opt.geometry.arrays import frozen
from fcdm_opt.geometry.solids import PlacedSolids, kept_as_surface
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.evidence import ProofData
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import MadeState, Solution, Status

ROUNDING, MUCH = 8 * float(np.finfo(float).eps), 1e3  # of lengths, relative to the size; times that an amount is none


def reported(
    problem: Problem, task: Task, answer: Answer, evidence: ProofData | None = None, stopped: str = ""
) -> Solution:
    """Return the answer as a solution: parameters by name, tracked pair, features, state of the target pair."""
    q = task.rest if answer.q is None else answer.q
    noise = ROUNDING * task.size
    if task.amount(q) > MUCH * noise:  # what the digits of coordinates cannot tell from no motion is none
        q = np.where(np.abs(problem.weights * q) <= noise, 0.0, q)
    gap, slack = task.gap(q), problem.contact_slack
    near = gap <= slack
    if kept_as_surface(*problem.active):  # the parts looked at are not all that may be near, or inside the other
        gap = PlacedSolids(*problem.active, problem.target, task.transform(q)).gap(gap, slack)
    elif not near:
        gap = task.contact_gap(task.distances(q))
    gap = 0.0 if abs(gap) <= noise else gap
    state: MadeState = "touching" if abs(gap) <= slack else "apart" if gap > 0 else "overlapping"
    moved: dict[str, Any] = {}
    if answer.q is not None:
        features = () if task.joints and problem.resolution is not None else problem.tracked_features
        if not features and near:
            features = touching_features(task.movable, task.static, task.pose(q), task.target, slack)
        moved = {
            "parameters": task.motion.by_name(q),
            "transform": frozen(task.transform(q) + 0.0),  # without -0
            "amount": task.amount(q),
            "rho": frozen(task.tracked_contact(q)[0]) if task.tracked else problem.target,
            "features": features,
        }
    return Solution(
        problem=problem.asked,
        status=Status.PAIR_OVERLAPS if moved and state == "overlapping" else answer.status,
        lower_bound=answer.lower_bound,
        pair=problem.target,
        pair_gap=gap,
        pair_state=state,
        stage=answer.stage,
        active=answer.active,
        modelled=answer.modelled or task.modelled(),
        evidence=evidence,
        stopped=stopped,
        unique_within=answer.unique if moved else 0.0,
        **moved,
    )
