"""What facets of round faces leave open: the least amounts of bodies that the true ones lie between.

"clear" asks more of larger bodies, and so does "touch" where they overlap; where they are apart, larger bodies touch
sooner. So the amount for the true bodies is between those for bodies within and about them. The other goals follow one
contact: of plane faces, their edges and corners it is the same for all of these.

How far a motion goes at least until parts that are apart touch, on their true faces: of one parameter, where it turns,
the part goes on from each pose by what its distance is at least over its largest speed: nothing is touched before. Of
several each pair of pieces of faces shows by itself what brings it together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facet_errors import all_recognised, bounding_bodies, deviation_of, facet_errors, is_plane_there
from fcdm_opt.geometry.measures import norms
from fcdm_opt.geometry.patches import true_faces
from fcdm_opt.geometry.true_distance import MOST, FacesApart, PoseDerivatives
from fcdm_opt.model.task import Task
from fcdm_opt.model.true_faces import where_nearest
from fcdm_opt.problem.contacts_restored import is_of_plane_faces, restoring_motion, touching_again
from fcdm_opt.problem.fit import between_planes, misfit, true_widths
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import IMPOSSIBLE, SURE, Solution, Status
from fcdm_opt.tolerances import DEFAULT

SHORTEST = 20.0
"""Seconds that either of the other searches may take at least; else as long as the one about the bodies as given. Of a
search that this ends nothing is told: it would depend on the machine."""

NEARLY = 0.94  # of the amount: bodies about the true ones show no more, mostly

REFUSED = (*IMPOSSIBLE, Status.NOT_FOUND)
"""What may be said of bodies only because their facets stick out of round faces."""


class _Scene(NamedTuple):
    """The bodies of a problem, all of them within the true ones, or all about them."""

    movable: Body
    static: Body
    keep_outs: tuple[Body, ...]


def facets_known(problem: Problem) -> None:
    """Work out what the facets of a problem's bodies leave open, which is kept: it is told however late it is."""
    for body in problem.bodies:
        facet_errors(body)


def with_mesh_error(
    solution: Solution, solve: Callable[[Problem, str], Solution] | None, *, certify: bool = False, quick: bool = False
) -> Solution:
    """Return a solution with the amounts that its bodies' facets leave open, see `Solution.amount_low`.

    They are worked out when they are read, as that takes solves; at once where a time is given.

    - `solve`: solves the same question about other bodies, with an effort as in `fcdm_opt.solve`; None: it is told
      where that is not needed, as contacts are of plane faces.
    - `certify`: go on for longer where a bound of parts that are apart takes long.
    - `quick`: only tell that parts do not fit whatever their mesh is.
    """
    if quick and solution.usable:
        return solution
    ends: Any = partial(_ends, solution, solve, certify, quick)
    low, high = ends() if pacing.limited() else (ends, ends)
    return solution.changed(amount_low=low, amount_high=high)


def _ends(
    solution: Solution, solve: Callable[[Problem, str], Solution] | None, certify: bool, quick: bool
) -> tuple[float, float]:
    if quick and not too_wide(solution.problem):
        return math.nan, math.nan
    found = _with_ends(solution, solve, certify)
    return found.amount_low, found.amount_high


def _with_ends(solution: Solution, solve: Callable[[Problem, str], Solution] | None, certify: bool) -> Solution:
    problem = solution.problem
    if problem.exact_at is not None:
        return _at_exact_points(solution, solve, certify)
    if not solution.usable and solution.status not in REFUSED:
        return solution
    if all(own is not None and not own.any() for own in [facet_errors(body) for body in problem.bodies]):
        return _between(solution, solution.amount, solution.amount) if solution.usable else solution
    if not solution.usable and (too_wide(problem) or cannot_be_restored(problem)):
        return replace(solution, amount_low=math.inf, amount_high=math.inf)
    if not _comparable(problem) and not (solution.usable and _of_plane_faces(problem, solution)):
        return solution
    with suppress(pacing.TimeOverError):
        pacing.check()
        found = [bounding_bodies(body) for body in problem.bodies]
        if any(own is None for own in found):
            return solution
        inner, outer = (_Scene(one, two, tuple(more)) for one, two, *more in zip(*filter(None, found), strict=True))
        if solve is None and (_comparable(problem) or not solution.usable):
            return solution
        seconds = max(SHORTEST, sum(solution.seconds.values()))
        if solve is not None and not solution.usable:
            with pacing.within(seconds, share=1.0):
                return _of_smaller(solution, solve(_about(problem, inner), "quick"))
        if solve is not None and _comparable(problem):
            ends = [_least_of(_about(problem, own), solve, seconds) for own in (inner, outer)]
            pacing.check()  # what was cut short would be told as open
            return _bracketed(solution, *ends)
        if problem.keep_out and solve is None:
            return solution
        free = solve(problem.changed(keep_out=()), "quick") if problem.keep_out and solve else solution
        if _same(problem, free.amount, solution.amount) and _stays_clear(solution, outer):
            return _between(solution, solution.amount, solution.amount)
    return solution


def _at_exact_points(solution: Solution, solve: Callable[[Problem, str], Solution] | None, certify: bool) -> Solution:
    """Return a solution whose parts are exact where they meet, and elsewhere within the true ones."""
    # the motion is right for the true ones. Where larger bodies ask for more, no smaller one is; where parts are apart
    # and larger ones touch sooner, bodies about the true ones tell what is least
    problem, amount = solution.problem, solution.amount
    if not solution.usable:
        impossible = problem.goal == "clear" and solution.status in IMPOSSIBLE  # for larger ones too
        return replace(solution, amount_low=math.inf, amount_high=math.inf) if impossible else solution
    if problem.reformulated is not problem:
        return _between(solution, solution.lower_bound, amount)
    if problem.goal == "clear" or not amount > 0.0 or _gap_at_rest(problem) <= problem.contact_slack:
        return _between(solution, _least(solution, amount), amount)
    low = 0.0
    one, two = (bounding_bodies(body) for body in problem.of_facets.bodies[:2])
    if solve is None or one is None or two is None:
        return solution
    with suppress(pacing.TimeOverError):
        low, whole = apart_until(problem.of_facets, amount, longer=certify) or (0.0, False)
        if whole or low > NEARLY * amount:
            return _between(solution, min(low, _least(solution, amount)), amount)
        outer = _about(problem.of_facets, _Scene(one[1], two[1], ()))
        if _gap_at_rest(outer) >= 0.0:  # else they ask for another motion, which takes them apart
            low = max(low, _least(_least_of(outer, solve, max(SHORTEST, sum(solution.seconds.values()))), amount))
    return _between(solution, low, amount)


def cannot_be_restored(problem: Problem) -> bool:
    """Tell whether no shift closes the gaps of true faces that touch as drawn, or the only one makes others overlap."""
    found, asked = None if touching_again(problem) is None else restoring_motion([problem]), problem.of_facets
    if found is None or found.q is None:
        return found is not None and found.bound == math.inf
    pose = asked.motion.transform(found.q, asked.movable.seed, asked.static.seed)
    return found.only and _is_clear(asked, asked.target, pose) is False


def _comparable(problem: Problem) -> bool:
    """Tell whether larger bodies make a question harder, or easier, whatever faces they meet with."""
    if problem.amount == "displacement" and not problem.motion.shifts:
        return False  # of corners, and these differ
    if problem.goal == "clear":
        return problem.pair != "touch"
    plain = problem.amount in ("weighted", "displacement") and problem.resolution is None and not problem.keep_out
    return problem.goal == "touch" and plain


def _about(problem: Problem, scene: _Scene, **asked: Any) -> Problem:
    """Return the question about other bodies, which are as made, with other arguments."""
    keep_out = tuple(
        KeepOut(body, own.scale, clearance=own.clearance, name=own.name)
        for own, body in zip(problem.keep_out, scene.keep_outs, strict=True)
    )
    return Problem(
        **{
            **problem.request,
            **dict.fromkeys(("requirement", "tolerance", "made", "features", "contacts", "published")),
            "movable": scene.movable,
            "static": scene.static,
            "keep_out": keep_out,
            "sizes": (),
            "target": tuple(problem.target.tolist()),
            "nominal": tuple(problem.nominal_pair.tolist()),
            "length": problem.length,
            "goal": problem.goal,
            "pair": problem.pair,
            **asked,
        }
    )


def _least_of(problem: Problem, solve: Callable[[Problem, str], Solution], seconds: float) -> Solution:
    """Return the least motion, searched for further where the first one found is not known to be the least."""
    with pacing.within(seconds, share=1.0):
        first = solve(problem, "quick")
        sure = first.gap <= SURE if first.usable else first.status is not Status.NOT_FOUND
        if sure or pacing.over():
            return first
        second = solve(problem, "proved")
        return first if second.stopped and first.usable else second


def _of_smaller(solution: Solution, inner: Solution) -> Solution:
    """Return a refused solution with what bodies within the true ones need: the true ones need that at least."""
    # infinitely much where these are refused alike
    if solution.problem.goal == "touch" and _gap_at_rest(inner.problem) > 0.0:
        return solution
    if not inner.usable and inner.status is not solution.status:
        return solution
    return replace(solution, amount_low=inner.lower_bound if inner.usable else math.inf, amount_high=math.inf)


def _bracketed(solution: Solution, inner: Solution, outer: Solution) -> Solution:
    """Return a solution between those of bodies within and about the true ones."""
    if any(own.stopped and not own.usable for own in (inner, outer)):
        return solution
    states = [_gap_at_rest(own.problem) for own in (inner, outer)]
    slack = solution.problem.contact_slack
    if solution.problem.goal == "clear" or states[0] <= slack:  # the larger, the farther
        return _between(solution, _least(inner, solution.amount), _most(outer))
    if states[1] >= -slack:
        return _between(solution, _least(outer, solution.amount), _most(inner))
    return _between(solution, 0.0, max(_most(inner), _most(outer)))  # apart, touching or overlapping as drawn


def _gap_at_rest(problem: Problem) -> float:
    curve = decision_curve(*problem.active, box=problem.box)
    return curve.near_gap(problem.target, problem.contact_slack, settled=True)


def _least(solution: Solution, amount: float) -> float:
    """Return what no smaller amount than this does; what was found where that is proved least, as is told."""
    found = solution.usable and not solution.stopped and solution.amount <= amount
    if found and (solution.gap <= SURE or _same(solution.problem, solution.amount, amount)):
        return solution.amount
    return solution.lower_bound if math.isfinite(solution.lower_bound) else 0.0


def _most(solution: Solution) -> float:
    return solution.amount if solution.usable else math.inf


def _between(solution: Solution, low: float, high: float) -> Solution:
    """Return a solution with what is left open, none where it is rounding; what was found is always within."""
    amount, problem, rounding = solution.amount, solution.problem, DEFAULT.nominal * solution.problem.size
    low = amount if _same(problem, low, amount) else max(low - rounding, 0.0)
    high = amount if _same(problem, high, amount) else high + rounding
    return replace(solution, amount_low=min(low, amount), amount_high=max(high, amount))


def _same(problem: Problem, one: float, two: float) -> bool:
    return math.isclose(one, two, rel_tol=DEFAULT.nominal, abs_tol=DEFAULT.nominal * problem.size)


def _of_plane_faces(problem: Problem, solution: Solution) -> bool:
    """Tell whether contacts are of faces that are plane in truth, and of edges and corners between such alone."""
    features = problem.contacts or solution.features
    sides = ((problem.movable, [own.one for own in features]), (problem.static, [own.two for own in features]))
    return bool(features) and all(is_plane_there(body, element) for body, elements in sides for element in elements)


def too_wide(problem: Problem) -> bool:
    """Tell whether widths do not go together between faces as they are in truth: that is so whatever the mesh is."""
    found = misfit(problem)
    return found is not None and (true_widths(problem, found) is not None or between_planes(problem, found))


def open_amounts(asked: Sequence[Problem], q: Array | None) -> tuple[float, float]:
    """Return between which amounts the least is that true parts need, of several questions about the same shifts.

    nan where that is not known: it is where contacts of plane faces are restored, and all others are to be clear. `q`:
    the least motion of the meshes, (k,), None where there is none; infinite where true parts have none either.
    """
    flat, first = [own for own in asked if is_of_plane_faces(own)], asked[0]
    known = all((own in flat or own.goal == "clear") and not own.keep_out for own in asked)
    found = restoring_motion(flat) if flat and known else None
    if found is None or found.q is None:
        return (math.nan, math.nan) if found is None else (math.inf, math.inf)
    least = found.q if q is None else q
    poses = (own.motion.transform(least, own.movable.seed, own.static.seed) for own in asked)
    clear = [_is_clear(own, own.target, pose, own.clearance) for own, pose in zip(asked, poses, strict=True)]
    if q is None and found.only and False in clear:
        return math.inf, math.inf
    if q is None or not all(clear):
        return math.nan, math.nan
    high = float(np.linalg.norm(first.weights * q))
    high = 0.0 if _same(first, 0.0, high) else high
    return high if _same(first, found.bound, high) else min(found.bound, high), high


def _is_clear(problem: Problem, rho: Array, transform: Array, clearance: float = 0.0) -> bool | None:
    """Tell whether true faces leave a clearance after a motion, where a round one is; None where not all are known."""
    near, slack = (problem.movable, problem.static), problem.contact_slack
    if not all(map(all_recognised, near)):
        return None
    return all(own.gap >= clearance - slack for own in where_nearest(*near, rho.tolist(), transform, clearance + slack))


def leaves_gap_open(solution: Solution) -> bool:
    """Tell whether bodies within the true ones, or about them, have another gap after a motion that leaves one."""
    # not where faces that facets stand for are elsewhere
    if not solution.usable or solution.pair_state == "touching":
        return False
    problem, pose = solution.problem, solution.transform
    with suppress(pacing.TimeOverError):
        found = [own for own in map(bounding_bodies, problem.bodies[:2]) if own is not None]
        if len(found) == 2 and not problem.partial:
            curves = (decision_curve(*own, box=problem.box, transform=pose) for own in zip(*found, strict=True))
            gaps = [float(own.gap(problem.target)) for own in curves]
            return not max(abs(gap - solution.pair_gap) for gap in gaps) <= problem.contact_slack
    return True


def _stays_clear(solution: Solution, outer: _Scene) -> bool:
    """Tell whether true parts overlap no more than the tracked contact lets them, after the motion."""
    # by their true faces where all are recognised, else by bodies about them
    problem, slack = solution.problem, solution.problem.contact_slack
    rho = solution.pair if problem.contacts else solution.rho
    if rho is None or solution.transform is None or problem.partial:
        return False
    if outer.keep_outs:
        kept = Task.of(_about(problem, outer, goal="clear", pair="any"))
        q, bodies = np.array([*solution.parameters.values()]), len(kept.static.parts)
        if not (kept.pair_gaps(q) >= kept.needs - slack)[:, bodies:].all():
            return False
    if (clear := _is_clear(problem, rho, solution.transform)) is not None:
        return clear
    curve = decision_curve(outer.movable, outer.static, box=problem.box, transform=solution.transform)
    return float(curve.gap(rho)) >= -slack


NEAR = 5e-5  # of the motion: so near to the touch it ends
ROUGHLY = (0.05, 0.01)  # of one that turns: faces that are near all over are told apart so far
STEPS = 60
SLOW = 0.2  # of the largest speed: with which parts near each other at the touch, mostly, so that no more is left open
STRAIGHT = 1e-9  # of the size: what poses of one screw motion may differ by, in rounding
DIFFERENCE = 1e-4  # of the motion, or radians: a central difference, by which rates are known to better than MARGIN
MARGIN = 1e-6
MOST_TURNED = 0.5  # radians, up to which motions are told by how they begin


def apart_until(problem: Problem, amount: float, *, longer: bool = False) -> tuple[float, bool] | None:
    """Return an amount below which no motion makes parts touch, and whether it is as near to the least as is asked.

    It is not where that would take long, as of faces that are near all over: the amount is less than it might be then.
    None where motions of several parameters turn far, or are no translations, rotations and screws about given lines.

    `problem`: whose parts are apart. `amount`: of a motion with which they touch. `longer`: look at ten times as many
    pieces of faces.
    """
    if problem.amount != "weighted" or not amount > 0.0:
        return None
    bodies = [body.scaled(scale) for body, scale in zip(problem.bodies[:2], problem.target.tolist(), strict=True)]
    faces = [true_faces(body) for body in bodies]
    pairs = MOST * (10 if longer else 1)
    if len(problem.motion.names) != 1 or problem.motion.shifts:
        rates = _rates(problem, bodies)
        if rates is None or not rates.spin * amount <= MOST_TURNED:
            return None
        apart, low = FacesApart(faces, pairs // 2 if rates.spin else pairs), 0.0
        for goal in (amount * (1.0 - near) for near in (*(ROUGHLY if rates.spin else ()), NEAR)):
            low = max(low, apart.least_amount(rates, amount, goal))
            if low < goal:
                break
        return low, low >= amount * (1.0 - NEAR)
    end, (low, high) = amount / float(problem.weights[0]), problem.limits[0].tolist()

    def pose(q: float) -> Array:
        return problem.motion.transform(np.array([q]), bodies[0].seed, bodies[1].seed)

    twice = pose(end / 2.0) @ pose(end / 2.0)
    if np.abs(twice - pose(end)).max() > STRAIGHT * problem.size or np.abs(pose(0.0) - np.eye(4)).max() > 0.0:
        return None
    rate = problem.motion.kinematics(bodies[0].seed, bodies[1].seed).rates(np.zeros(1))[1][0, :3]
    speeds = norms(bodies[0].vertices @ rate[:, :3].T + rate[:, 3])
    speed = (1.0 + MARGIN) * (speeds.max() + norms(rate[:, :3]).max() * np.sqrt(3.0) * deviation_of(bodies[0])[1])
    found, near, whole, axis = end, NEAR * end, True, _axis_of(rate, problem.size)
    for side, limit in ((1.0, high), (-1.0, -low)):
        apart, x = FacesApart(faces, pairs, axis), 0.0
        for _ in range(STEPS):
            if x >= min(end - near, limit):
                break
            free = apart.least(pose(side * x), small=SLOW * near * speed, most=(end - x) * speed)
            if not free > 0.0:
                break
            x += free / speed
            pacing.check()
        found, whole = min(found, end if x >= limit else x), whole and apart.remaining >= 0
        if not found > 0.0:
            return None
    return min(found * float(problem.weights[0]), amount), whole


def _axis_of(rate: Array, size: float) -> Array | None:
    """Return a point and the direction of the axis that a motion of a rate, (3, 4), turns about, (2, 3), if any."""
    spin, speed = np.array([rate[2, 1], rate[0, 2], rate[1, 0]]), rate[:, 3]
    turned = float(np.linalg.norm(spin))
    if not turned or abs(float(spin @ speed)) > DEFAULT.tie * size * turned**2:
        return None
    return np.stack([np.cross(spin, speed) / turned**2, spin / turned])


def _rates(problem: Problem, bodies: list[Body]) -> PoseDerivatives | None:
    """Return how the motion begins, None where its steps are not all shifts, turns and screws about given lines."""
    motion = problem.motion
    if motion.along_seeds.any() or any(step.own_fixed_points is None for step in motion.steps):
        return None
    kinematics, count = motion.kinematics(bodies[0].seed, bodies[1].seed), len(motion.names)

    def at(q: Array) -> Array:
        return kinematics.rates(q)[1][:, :3] / problem.weights[:, None, None]

    first, second = at(np.zeros(count)), np.zeros((count, count, 3, 4))
    rates = PoseDerivatives(first, second, problem.limits * problem.weights[:, None])
    if rates.spin:
        step = DIFFERENCE / rates.spin
        for k, ahead in enumerate(np.diag(step / problem.weights)):
            second[k] = (at(ahead) - at(-ahead)) / (2.0 * step)
    return rates
