"""Stage 4, last: the nonlinear program from several starts, for whatever is asked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.model.bounds import displacement_bound, search_rate
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages import rays
from fcdm_opt.stages.rays import ON_THE_WAY
from fcdm_opt.stages.relaxation import choices
from fcdm_opt.tolerances import DEFAULT

REACH = 3.0  # starts away from rest, in typical amounts
WIDE_REACH, WIDE_FRACTIONS = 50.0, (1.0, 0.3, 0.1)  # the same, where those find nothing
FALLBACK_CHOICES = 3  # choices of features tried then
LARGE = 0.5  # of the size: displacements beyond this are large


def nonlinear(task: Task) -> Answer:
    """Stage 4: the nonlinear program.

    Where contacts must stay flush, which few turns let them, first without turns, and then with turns from there.
    """
    turning = task.spins.any(axis=1) & (task.limits[:, 0] <= 0) & (task.limits[:, 1] >= 0)
    still = frozen(np.where(turning[:, None], 0.0, task.limits))
    if not any(task.flush) or not turning.any() or (still == 0).all() or (still == task.limits).all():
        return _program(task)
    answer = _program(replace(task, limits=still))
    if answer.q is None:
        return _program(task)
    best = answer
    starts = [answer.q, *(answer.q + sign * x for x in np.diag(task.steps)[turning] for sign in (1.0, -1.0))]
    for relaxation in choices(task, answer.q, near=True):
        best = _better(best, relaxation.smallest([np.clip(q, *task.limits.T) for q in starts], "sqpmethod")) or best
    return replace(best, stage=answer.stage, lower_bound=min(displacement_bound(task), best.amount))


def _program(task: Task) -> Answer:
    """Return what the nonlinear program finds; constraints of other features come in when a solution violates them.

    Several starts, and every choice of features that may matter; then the first contact on a ray. All starts are fixed:
    the same task gives the same answer.
    """
    best, reached = _first_found(task)
    contact = _on_a_ray(task, best) if not task.tracked and task.allows(task.rest) else None
    if contact is not None:
        best = contact
        for relaxation in choices(task, contact.motion, near=True):
            best = _better(best, relaxation.smallest([contact.motion], "sqpmethod", best.amount)) or best
    stage, bound = "4: nonlinear program", displacement_bound(task)
    if best is None:
        status = Status.LEFT_COHERENT_RANGE if reached and task.coherent else Status.NOT_FOUND
        return Answer(status, None, f"{stage}, no start succeeded", bound)
    return replace(best, stage=stage, lower_bound=min(bound, best.amount))  # the two differ by rounding at most


def _better(one: Answer | None, two: Answer | None) -> Answer | None:
    return min((found for found in (one, two) if found is not None), key=lambda found: found.amount, default=None)


def _first_found(task: Task) -> tuple[Answer | None, bool]:
    """Return the best over all choices of features and starts, and whether any reached it but for coherence.

    Where SQP finds nothing for tracked features, wider starts are tried, and then IPOPT; without, rays are searched.
    """
    turning = np.array([kind == "rotation" for _, kind in task.motion.parameters])
    near, wide = (np.where(turning, np.minimum(x * task.steps, 1.0), x * task.steps) for x in (REACH, WIDE_REACH))
    near_starts = [task.start, *(task.start + sign * row for row in np.diag(near) for sign in (1.0, -1.0))]
    near_starts = [np.clip(start, task.limits[:, 0], task.limits[:, 1]) for start in near_starts]
    wide_starts = [x * direction * wide for x in WIDE_FRACTIONS for direction in rays.directions(task) * task.weights]
    tries: list[tuple[str, list[Array], int | None]] = [("sqpmethod", near_starts, None)]
    if task.tracked:
        tries += [("sqpmethod", wide_starts, FALLBACK_CHOICES), ("ipopt", [task.start], FALLBACK_CHOICES)]
    best, reached = None, False
    for method, starts, most in tries:
        for relaxation in sorted(choices(task, task.start), key=lambda choice: choice.promise)[:most]:
            if best is not None and relaxation.promise >= best.amount:
                break
            # of tracked features a later round may find a nearer start
            enough = np.inf if best is None or task.tracked else best.amount
            best = _better(best, relaxation.smallest(starts, method, enough))
            reached = reached or relaxation.reached
        if best is not None:
            break
    return best, reached


def _on_a_ray(task: Task, known: Answer | None) -> Answer | None:
    """Return the least first contact along fixed directions; None if it is not less than the best known.

    Along the axes always, as a start may have passed the contact by; along the others where nothing is known, or the
    best known motion is as large as the bodies.
    """
    large = known is None or known.amount * search_rate(task) > LARGE * task.size
    contact = None
    for direction in rays.directions(task, rays.FINE) if large else rays.directions(task, ()):
        least = contact or known
        limit = min(rays.reach(task, direction), np.inf if least is None else least.amount)
        amount = rays.first_contact(task, direction, limit).amount
        if amount < limit and task.meets(q := amount * direction, DEFAULT.requirement):
            contact = task.answer(q, active=ON_THE_WAY, modelled=task.modelled_by_gaps(q))
    return contact
