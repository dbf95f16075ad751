"""Lower bounds of the motion amount that hold whatever the solver did."""

from __future__ import annotations

import numpy as np

from fcdm_opt.model.task import Task
from fcdm_opt.tolerances import DEFAULT

SAMPLED = (0.0, 1.0, 10.0)  # `Task.steps` away from rest at which the rate of an unknown motion is looked at
MARGIN = 2.0  # on what is found there


def search_rate(task: Task) -> float:
    """Return `Task.displacement_rate`, or what a few samples suggest where that is infinite: for searches, no proof."""
    rate = task.displacement_rate
    if np.isfinite(rate):
        return rate
    rates = np.array([task.rates(x * sign * task.steps)[1] for x in SAMPLED for sign in (1.0, -1.0)])
    speeds = np.linalg.norm(task.made_vertices @ rates[:, :, :3, :3].mT + rates[:, :, None, :3, 3], axis=3)
    found = np.linalg.norm(speeds / task.weights[:, None], axis=1)
    return MARGIN * float(np.max(found[np.isfinite(found)], initial=0.0)) or 1.0


def displacement_bound(task: Task) -> float:
    """Return a lower bound of the amount (design: bounds known to hold); 0 for one of the user's own."""
    # the signed distance of a part pair changes by no more than the largest displacement of a vertex, and parameter k
    # displaces none by more than its reach d_k per unit, so need <= sum d_k |q_k| <= |w q| sqrt(sum (d_k / w_k)^2). The
    # gap over facet directions is the signed distance where a pair overlaps, and never exceeds it: it may stand for it
    # where a gap is to be closed or an overlap undone, not where a gap is to be widened. 0 where nothing asks for
    # either
    if task.amount_kind == "displacement":
        return _least_displacement(task)
    return _least_displacement(task) / task.displacement_rate if task.weighted else 0.0


def _least_displacement(task: Task) -> float:
    """Return a lower bound of the largest displacement of a vertex."""
    if not np.isfinite(task.needs).any():
        return _tracked_need(task)
    gaps = task.pair_gaps(task.rest)
    needs = [_tracked_need(task), *(task.needs - gaps)[gaps <= 0]]
    if task.goal == "touch":
        needs.append(task.contact_gap(task.distances(task.rest) if task.amount_kind == "displacement" else gaps))
    return float(max(needs))


def _tracked_need(task: Task) -> float:
    """Return how far a vertex of body 1 moves at least where the tracked contact comes to the target pair."""
    # the point that touches in the end belongs to the contact's elements, and is at rest its line's gap away from the
    # other body's. Of faces that stay flush every point moves alike along each normal: so as to close all gaps at once
    if task.goal not in ("at", "seat"):
        return 0.0
    normals, gaps = task.face_gaps
    together = np.linalg.lstsq(normals, gaps, rcond=DEFAULT.nominal)[0] if len(gaps) else np.zeros(3)
    return max(float(np.linalg.norm(together)), float(np.abs(task.line_gaps(task.rest)[1]).max()))
