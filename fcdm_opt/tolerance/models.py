"""The stages of the solver, least first: each answers a `Task`, or returns None where the task is not its own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerance import rays
from fcdm_opt.tolerance.bounds import displacement_bound
from fcdm_opt.tolerance.relaxation import Found, choices
from fcdm_opt.tolerance.solution import Status
from fcdm_opt.tolerance.task import Answer, Task
from fcdm_opt.tolerances import DEFAULT

REACH = 3.0  # starts away from rest, in typical amounts
PROBES = 5  # improvements by probing, at most
PROBE_FRACTIONS = (0.98, 0.7, 0.4)
ON_THE_WAY = ("the first contact on the way",)


def satisfied(task: Task) -> Answer | None:
    """Stage 0: nothing to do."""
    if not task.allows(task.rest) or not task.meets(task.rest, DEFAULT.line):
        return None
    return Answer(Status.ALREADY_SATISFIED, task.rest, "0: met without motion")


def straight(task: Task) -> Answer | None:
    """Stage 1 for "touch" and "clear" along one translation: exact, and smallest by construction.

    Directions and supports do not change, so each part pair overlaps in an open interval of the parameter; the parts
    touch at the ends of the intervals' union. A clearance is left to stage 4: the distance of corners is not linear.
    """
    if task.tracked or task.need > 0 or [kind for _, kind in task.motion.parameters] != ["translation"]:
        return None
    along = (task.transform(np.ones(1)) - task.transform(task.rest))[:3, 3]
    blocked = []
    for parts in np.ndindex(len(task.movable.parts), len(task.static.parts)):
        _, rows, separations = task.separations(parts, task.pose(task.rest))
        rate = rows[:, :3] @ along
        level = np.abs(rate) <= DEFAULT.tie
        at = separations[~level] / rate[~level]
        ends = at[rate[~level] > 0].max(initial=-np.inf), at[rate[~level] < 0].min(initial=np.inf)
        if (separations[level] < 0).all() and ends[0] < ends[1]:
            blocked.append(ends)
    low, high = task.limits[0]
    candidates = [end for ends in blocked for end in ends] + ([] if task.must_touch else [min(max(0.0, low), high)])
    free = [
        x
        for x in candidates
        if low <= x <= high
        and np.isfinite(x)
        and not any(a + DEFAULT.line * abs(a) < x < b - DEFAULT.line * abs(b) for a, b in blocked)
    ]
    stage = "1: one translation, intervals of overlap"
    if not free:
        return Answer(Status.INFEASIBLE, None, stage, np.inf)
    q = np.array([min(free, key=abs)])
    return Answer(Status.SOLVED, q, stage, task.amount(q), ON_THE_WAY, _pairs_modelled(task))


def one_parameter(task: Task) -> Answer | None:
    """Stage 2 for "touch" and "clear" along one parameter: safe steps both ways to the first contact, then its root."""
    if task.tracked or task.need > 0 or len(task.weights) != 1 or not task.allows(task.rest):
        return None
    stage = "2: one parameter, safe steps to the first contact"
    ways = [sign / task.weights for sign in (1.0, -1.0)]
    ends = [rays.reach(task, way) for way in ways]
    first = rays.first_contact(task, ways[0], ends[0])
    second = rays.first_contact(task, ways[1], min(ends[1], first.amount))
    amount, way = min((first.amount, 0), (second.amount, 1))
    bound = max(min(first.clear_to, second.clear_to), displacement_bound(task))
    if not np.isfinite(amount):
        whole = task.motion.weights(0.0)[0] == 0 or np.isfinite(task.limits).all()  # a full turn is all there is
        proved = whole and first.clear_to >= ends[0] and second.clear_to >= ends[1]
        return Answer(Status.INFEASIBLE if proved else Status.NOT_FOUND, None, stage, bound)
    q = amount * ways[way]
    return Answer(Status.SOLVED, q, stage, min(bound, amount), ON_THE_WAY, _pairs_modelled(task))


def nonlinear(task: Task) -> Answer:
    """Stage 4: the nonlinear program, with constraints of other features added only when a solution violates them.

    Several starts, and every choice of features that may matter; then probes nearer to rest, which start it again
    where they find the contact on their side. All starts are fixed: the same task gives the same answer.
    """
    best, goal_reached = _first_found(task)
    if best is None and not task.tracked and task.allows(task.rest):
        best = _on_a_ray(task)
    for _ in range(PROBES):
        q = _nearer(task, best) if best is not None else None
        if q is None:
            break
        for relaxation in choices(task, q):
            best = _better(best, relaxation.smallest([q], "sqpmethod", _enough(task, best)))
    stage, bound = "4: nonlinear program", displacement_bound(task)
    if best is None:
        status = Status.LEFT_COHERENT_RANGE if goal_reached and task.coherent else Status.NOT_FOUND
        return Answer(status, None, f"{stage}, no start succeeded", bound)
    return Answer(Status.SOLVED, best.q, stage, min(bound, best.amount), best.active, best.modelled)


STAGES: tuple[Callable[[Task], Answer | None], ...] = (satisfied, straight, one_parameter, nonlinear)


def _pairs_modelled(task: Task) -> dict[str, int]:
    return {"part_pairs_kept": task.part_pairs, "part_pairs_total": task.part_pairs}


def _better(one: Found | None, two: Found | None) -> Found | None:
    return min((found for found in (one, two) if found is not None), key=lambda found: found.amount, default=None)


def _enough(task: Task, best: Found | None) -> float:
    """Return the amount at which to give up; none for tracked features, whose constraints may be dropped again."""
    return np.inf if best is None or task.tracked else best.amount


def _first_found(task: Task) -> tuple[Found | None, bool]:
    """Return the best over all choices of features and starts, and whether any reached the goal at all.

    IPOPT is asked only where SQP finds nothing and no ray of motions can be searched instead.
    """
    step = REACH * task.unit / task.weights
    starts = [task.rest, *(sign * row for row in np.diag(step) for sign in (1.0, -1.0))]
    best, goal_reached = None, False
    for method in ("sqpmethod", "ipopt") if task.tracked else ("sqpmethod",):
        for relaxation in sorted(choices(task, task.rest), key=lambda choice: choice.promise):
            if best is not None and relaxation.promise >= best.amount:
                break
            best = _better(best, relaxation.smallest(starts, method, _enough(task, best)))
            goal_reached = goal_reached or relaxation.goal_reached
        if best is not None:
            break
    return best, goal_reached


def _on_a_ray(task: Task) -> Found | None:
    """Return the least first contact along fixed directions."""
    best = None
    for direction in rays.directions(task):
        limit = min(rays.reach(task, direction), best.amount if best else np.inf)
        contact = rays.first_contact(task, direction, limit)
        if contact.amount < limit:
            best = Found(contact.amount * direction, contact.amount, ON_THE_WAY, _pairs_modelled(task))
    return best


def _nearer(task: Task, best: Found) -> Array | None:
    """Return a motion smaller than the best known that meets the goal or nearly so, None if the probes find none.

    Probes stand at fixed fractions of the best amount in fixed directions: where one is on the other side of the
    contact than rest, the contact lies on its ray.
    """
    rest = 0.0 if task.tracked else task.gap(task.rest) - task.need
    for fraction in PROBE_FRACTIONS:
        for q in fraction * best.amount * rays.directions(task):
            if not task.allows(q):
                continue
            if task.tracked:
                if task.meets(q, DEFAULT.line):
                    return q
            elif (task.gap(q) - task.need) * rest < 0:
                return rays.shortened(task, q)
    return None
