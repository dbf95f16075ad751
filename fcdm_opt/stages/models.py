"""The stages of the solver, least first: each answers a `Task`, or returns None where the task is not its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.model.bounds import displacement_bound, search_rate
from fcdm_opt.model.task import Answer, Parts, Task
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages import rays
from fcdm_opt.stages.relaxation import Found, choices
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
ON_THE_WAY = ("the nearest contact on the way",)


def satisfied(task: Task) -> Answer | None:
    """Stage 0: nothing to do."""
    if not task.allows(task.rest) or not task.meets(task.rest, DEFAULT.line):
        return None
    return Answer(Status.ALREADY_SATISFIED, task.rest, "0: met without motion", modelled=task.modelled())


def straight(task: Task) -> Answer | None:
    """Stage 1 for "touch" and "clear" along one translation: exact, and smallest by construction.

    Directions and supports do not change, so each part pair overlaps in an open interval of the parameter and touches
    at its ends; one that slides by flush touches all along and never overlaps. Where a clearance forbids the motion
    that undoes all overlaps, the task is left to stage 4: the distance of corners is not linear.
    """
    if task.tracked or len(task.weights) != 1 or not task.motion.shifts:
        return None
    along = (task.transform(np.ones(1)) - task.transform(task.rest))[:3, 3]
    slack = DEFAULT.line * task.size
    blocked: dict[Parts, tuple[float, float]] = {}
    flush: dict[Parts, tuple[float, float]] = {}
    for parts in np.ndindex(len(task.movable.parts), len(task.opponents)):
        _, rows, separations = task.separations(parts, task.pose(task.rest))
        rate = rows[:, :3] @ along
        level = np.abs(rate) <= DEFAULT.tie
        at = separations[~level] / rate[~level]
        ends = at[rate[~level] > 0].max(initial=-np.inf), at[rate[~level] < 0].min(initial=np.inf)
        beside = separations[level].max(initial=-np.inf)
        if beside <= slack and ends[0] <= ends[1] + slack:
            (flush if beside >= -slack or ends[0] >= ends[1] - slack else blocked)[parts] = ends
    met = {**blocked, **flush}
    partner = [ends for parts, ends in met.items() if task.opponents[parts[1]].keep_out < 0]
    low, high = task.limits[0]
    nearest = min(max(0.0, low), high)
    candidates = [nearest, *(min(max(end, low), high) for ends in met.values() for end in ends)]
    ways = {
        x: {parts for parts, (a, b) in blocked.items() if a + slack < x < b - slack}
        for x in sorted(candidates, key=abs)
        if not task.must_touch or any(a - slack <= x <= b + slack for a, b in partner)
    }
    stage = "1: one translation, intervals of overlap"
    least = next((x for x, in_the_way in ways.items() if not in_the_way), None)
    if least is None:
        return Answer(Status.INFEASIBLE, None, stage, np.inf)
    q = np.array([least])
    if task.needs.max() > 0 and not task.meets(q, DEFAULT.line):
        return None
    others = {parts for parts in met if task.opponents[parts[1]].keep_out >= 0}
    stop = {parts for parts in others if np.abs(np.array(met[parts]) - least).min() <= slack}
    stop.update(*(found for x, found in ways.items() if abs(x) < abs(least) and found <= others))
    names = tuple(dict.fromkeys(task.named(parts) for parts in sorted(stop)))
    near = [parts for parts, (a, b) in met.items() if max(a, -b, 0.0) <= abs(least) + slack]
    return Answer(Status.SOLVED, q, stage, task.amount(q), names or ON_THE_WAY, task.modelled_by_gaps(q, near))


def one_parameter(task: Task) -> Answer | None:
    """Stage 2 for "touch" and "clear" along one parameter: safe steps both ways to the first contact, then its root."""
    if task.tracked or len(task.weights) != 1:
        return None
    answer = _one_way(task, True) if rays.is_steady(task, np.ones(1)) else None
    return answer or _one_way(task, False)


def _one_way(task: Task, steady: bool) -> Answer | None:
    """Return the answer by steps of second order, or by plain ones; None where they prove and find nothing."""
    if not steady and task.need > 0:
        return None
    if not steady and task.needs.max() > 0:  # the answer without clearances, where it keeps them
        if satisfied(task.bare):
            return None
        answer = one_parameter(task.bare)
        keeps = answer is not None and (answer.q is None or task.meets(answer.q, DEFAULT.line))
        return answer if keeps and answer is not None and answer.status is not Status.NOT_FOUND else None
    stage = "2: one parameter, safe steps to the first contact"
    ways = [sign / task.weights for sign in (1.0, -1.0)]
    ends = [rays.reach(task, way) for way in ways]
    # limits may exclude rest: then one way starts at the nearer limit, and the other ends before it begins
    starts = [max(0.0, task.weights[0] * x) for x in (task.limits[0, 0], -task.limits[0, 1])]
    for sense, start, end in zip(ways, starts, ends, strict=True):
        if 0 < start <= end and task.meets(start * sense, DEFAULT.line):
            q = start * sense
            return Answer(Status.SOLVED, q, stage, start, ("a limit",), task.modelled_by_gaps(q))

    def contact(way: int, end: float) -> rays.FirstContact:
        return rays.first_contact(task, ways[way], end, starts[way], plain=not steady)

    lead = 0 if not steady or rays.leads_nearer(task, ways[0]) else 1
    first = contact(lead, ends[lead])
    second = contact(1 - lead, min(ends[1 - lead], first.amount))
    found = (first, second) if lead == 0 else (second, first)
    amount, nearer = min((found[0].amount, 0), (found[1].amount, 1))
    clear = [np.inf if way.clear_to >= end else way.clear_to for way, end in zip(found, ends, strict=True)]
    if not np.isfinite(amount):  # proved where both ways are clear to their ends
        if min(clear) < np.inf and (task.keep_out or task.need > 0 or steady):
            return None
        return Answer(Status.INFEASIBLE if min(clear) == np.inf else Status.NOT_FOUND, None, stage, min(clear))
    known = 0.0 if steady else displacement_bound(task)
    bound = min(max(min(clear), known), amount)  # the two differ by rounding at most
    q = amount * ways[nearer]
    if steady and not task.meets(q, DEFAULT.requirement):
        return None
    return Answer(Status.SOLVED, q, stage, bound, _stops(task, q) or ON_THE_WAY, task.modelled_by_gaps(q))


def _stops(task: Task, q: Array) -> tuple[str, ...]:
    """Return the keep-outs that a motion takes the part to."""
    near = task.pair_gaps(q) - task.needs <= DEFAULT.requirement * task.size
    others = [parts for parts in np.ndindex(near.shape) if near[parts] and task.opponents[parts[1]].keep_out >= 0]
    return tuple(dict.fromkeys(map(task.named, others)))


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
    best = Found(answer.q, task.amount(answer.q), answer.active, answer.modelled or {})
    starts = [answer.q, *(answer.q + sign * x for x in np.diag(task.steps)[turning] for sign in (1.0, -1.0))]
    for relaxation in choices(task, answer.q, near=True):
        best = _better(best, relaxation.smallest([np.clip(q, *task.limits.T) for q in starts], "sqpmethod")) or best
    bound = min(displacement_bound(task), best.amount)
    return Answer(Status.SOLVED, best.q, answer.stage, bound, best.active, best.modelled)


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
    bound = min(bound, best.amount)  # the two differ by rounding at most
    return Answer(Status.SOLVED, best.q, stage, bound, best.active, best.modelled)


def _better(one: Found | None, two: Found | None) -> Found | None:
    return min((found for found in (one, two) if found is not None), key=lambda found: found.amount, default=None)


def _enough(task: Task, best: Found | None) -> float:
    """Return the amount at which to give up; none for tracked features, where a later round may find a nearer start."""
    return np.inf if best is None or task.tracked else best.amount


def _first_found(task: Task) -> tuple[Found | None, bool]:
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


def _on_a_ray(task: Task, best: Found | None) -> Found | None:
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
            best = Found(q, contact.amount, ON_THE_WAY, task.modelled_by_gaps(q))
    return best


def _scanned(task: Task, start: Array | float = 0.0) -> Found | None:
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
                found = Found(q, task.amount(q), ("the goal along a fixed direction",), task.modelled_by_gaps(q))
                best = _better(best, found)
                break
            before = float(amount)
    return best


def _nearer(task: Task, best: Found) -> Array | None:
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
