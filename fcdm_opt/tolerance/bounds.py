"""Lower bounds of the motion amount that hold whatever the solver did."""

from __future__ import annotations

import numpy as np

from fcdm_opt.tolerance.task import Task
from fcdm_opt.tolerances import DEFAULT


def displacement_rate(task: Task) -> float:
    """Return the most that a vertex of body 1, re-scaled, can move per unit of weighted amount."""
    seed = task.movable.seed
    used = np.concatenate([part.vertices for part in task.movable.parts])
    reaches = task.motion.reaches(seed + task.target[0] * (used - seed), seed)
    return float(np.linalg.norm(reaches / task.weights))


def displacement_bound(task: Task) -> float:
    """Return a lower bound of the weighted amount (design: bounds known to hold).

    The signed distance of a part pair changes by no more than the largest displacement of a vertex, and parameter k
    displaces none by more than its reach d_k per unit, so need <= sum d_k |q_k| <= |w q| sqrt(sum (d_k / w_k)^2). The
    gap over facet directions is the signed distance where a pair overlaps, and never exceeds it: it may stand for it
    where a gap is to be closed or an overlap undone, not where a gap is to be widened. 0 where nothing asks for either.
    """
    if not np.isfinite(task.needs).any():
        return _tracked_need(task) / displacement_rate(task)
    gaps = task.pair_gaps(task.rest)
    needs = [_tracked_need(task), *(task.needs - gaps)[gaps <= 0]]
    if task.goal == "touch":
        needs.append(task.contact_gap(gaps))
    return float(max(needs)) / displacement_rate(task)


def _tracked_need(task: Task) -> float:
    """Return how far a vertex of body 1 moves at least where the tracked contact comes to the target pair.

    The point that touches in the end belongs to the contact's elements, and is at rest its line's gap away from the
    other body's. Of faces that stay flush every point moves alike along each normal: so as to close all gaps at once.
    """
    if task.goal not in ("at", "seat"):
        return 0.0
    normals, gaps = task.face_gaps
    together = np.linalg.lstsq(normals, gaps, rcond=DEFAULT.nominal)[0] if len(gaps) else np.zeros(3)
    return max(float(np.linalg.norm(together)), float(np.abs(task.line_gaps(task.rest)[1]).max()))
