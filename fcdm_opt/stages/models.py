"""Stage 4, last: the nonlinear program from many starts, for whatever is asked."""

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
ALTERED = 2  # pairs that came up in one program and are kept apart in other directions, among keep-outs
PATIENCE = 16  # programs in a row that better nothing, among keep-outs
FALLBACK_CHOICES = 3  # choices of features tried then
SCAN_POINTS, HALVINGS = 200, 45  # of a direction, and of the step that first meets the goal
LARGE = 0.5  # of the size: displacements beyond this are large
PROBES = 5  # improvements by probing, at most
PROBE_FRACTIONS = (0.98, 0.7, 0.4)


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

    Several starts, and every choice of features that may matter; then probes nearer to rest, which start it again
    where they find the contact on their side. All starts are fixed: the same task gives the same answer.
    """
    best, reached = _first_found(task)
    if task.tracked:
        best = best or _scanned(task)
    elif task.allows(task.rest):
        best = _on_a_ray(task, best)
    elif best is None:
        best = _scanned(task, task.start)
    q = best.q if best is not None and best.active == ON_THE_WAY else None
    for _ in range(PROBES):
        q = _nearer(task, best) if q is None and best is not None else q
        if q is None:
            break
        for relaxation in choices(task, q, near=True):
            best = _better(best, relaxation.smallest([q], "sqpmethod", _enough(task, best)))
        q = None
    stage, bound = "4: nonlinear program", displacement_bound(task)
    if best is None:
        status = Status.LEFT_COHERENT_RANGE if reached and task.coherent else Status.NOT_FOUND
        return Answer(status, None, f"{stage}, no start succeeded", bound)
    return replace(best, stage=stage, lower_bound=min(bound, best.amount))  # the two differ by rounding at most


def _better(one: Answer | None, two: Answer | None) -> Answer | None:
    return min((found for found in (one, two) if found is not None), key=lambda found: found.amount, default=None)


def _enough(task: Task, best: Answer | None) -> float:
    """Return the amount at which to give up; none for tracked features, where a later round may find a nearer start."""
    return np.inf if best is None or task.tracked else best.amount


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
        idle = 0  # programs since the last that was better
        for relaxation in sorted(choices(task, task.start), key=lambda choice: choice.promise)[:most]:
            if best is not None and (relaxation.promise >= best.amount or (task.keep_out and idle > PATIENCE)):
                break
            queue = [(relaxation, starts, ALTERED if task.keep_out else 1)]
            while queue and not (task.keep_out and idle > PATIENCE):
                program, own, further = queue.pop(0)
                found = program.smallest(own, method, _enough(task, best))
                idle = 0 if found is not None and _better(best, found) is found else idle + 1
                best = _better(best, found)
                if further:
                    queue += [(other, starts[:1], further - 1) for other in program.alternatives()]
            reached = reached or relaxation.reached
        if best is not None:
            break
    return best, reached


def _on_a_ray(task: Task, best: Answer | None) -> Answer | None:
    """Return the least first contact along fixed directions, if it is less than the best known.

    Along the axes always, as a start may have passed the contact by; along the others where nothing is known, or the
    best known motion is as large as the bodies.
    """
    large = best is None or best.amount * search_rate(task) > LARGE * task.size
    for direction in rays.directions(task, rays.FINE) if large else rays.directions(task, ()):
        limit = min(rays.reach(task, direction), best.amount if best else np.inf)
        contact = rays.first_contact(task, direction, limit)
        if contact.amount < limit and task.meets(contact.amount * direction, DEFAULT.requirement):
            q = contact.amount * direction
            best = task.answer(q, active=ON_THE_WAY, modelled=task.modelled_by_gaps(q))
    return best


def _scanned(task: Task, start: Array | float = 0.0) -> Answer | None:
    """Return the first motion along fixed directions that meets the goal, by small steps; a rule of search."""
    best = None
    for direction in rays.directions(task):
        end = min(rays.reach(task, direction), best.amount if best else np.inf)
        step, before = min(end / SCAN_POINTS, LARGE * task.size / search_rate(task)), 0.0
        for amount in np.arange(1, SCAN_POINTS + 1) * step:
            if amount >= end:
                break
            q = start + amount * direction
            if not task.allows(q):
                break
            if task.meets(q, DEFAULT.line, path=False) and task.meets(q, DEFAULT.line):
                low, high = before, float(amount)
                for _ in range(HALVINGS):
                    middle = (low + high) / 2.0
                    met = task.meets(start + middle * direction, DEFAULT.line)
                    low, high = (low, middle) if met else (middle, high)
                q = start + high * direction
                active = ("the goal along a fixed direction",)
                best = _better(best, task.answer(q, active=active, modelled=task.modelled_by_gaps(q)))
                break
            before = float(amount)
    return best


def _nearer(task: Task, best: Answer) -> Array | None:
    """Return a motion smaller than the best known that meets the goal or nearly so, None if the probes find none.

    Probes stand at fixed fractions of the best amount in fixed directions: where one is on the other side of the
    contact than rest, the contact lies on its ray.
    """
    rest = 0.0 if task.tracked else task.misses(task.rest)[0]
    for fraction in PROBE_FRACTIONS:
        for q in fraction * best.amount * rays.directions(task):
            if not task.allows(q):
                continue
            if task.tracked:
                if task.meets(q, DEFAULT.line):
                    return q
            elif task.misses(q)[0] * rest < 0:
                return rays.shortened(task, q)
    return None
