"""Lower bounds of the motion amount that hold whatever the solver did."""

from __future__ import annotations

import numpy as np

from fcdm_opt.tolerance.task import Task


def displacement_rate(task: Task) -> float:
    """Return the most that a vertex of body 1, re-scaled, can move per unit of weighted amount."""
    seed = task.movable.seed
    used = np.concatenate([part.vertices for part in task.movable.parts])
    reaches = task.motion.reaches(seed + task.target[0] * (used - seed), seed)
    return float(np.linalg.norm(reaches / task.weights))


def displacement_bound(task: Task) -> float:
    """Return a lower bound of the weighted amount for "touch" and "clear" (design: bounds known to hold).

    The signed distance of the target pair changes by no more than the largest displacement of a vertex, and parameter
    k displaces none by more than its reach d_k per unit, so need <= sum d_k |q_k| <= |w q| sqrt(sum (d_k / w_k)^2).
    The gap over facet directions never exceeds the distance, so it may stand for it. 0 for other goals.
    """
    if task.goal not in ("touch", "clear"):
        return 0.0
    gap = task.gap(np.zeros(len(task.weights)))
    need = abs(gap) if task.goal == "touch" else max(0.0, task.need - gap)
    if task.goal == "clear" and gap > 0:
        return 0.0  # facet directions understate the distance: the need may be less
    return need / displacement_rate(task)
