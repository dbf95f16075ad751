"""By how much the parts made do not go together, and which faces block: the best pose that a local search finds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from itertools import chain

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.design.fixed_pose.local_search import better, found_at, least_moved
from fcdm_opt.design.fixed_pose.worst import Worst
from fcdm_opt.design.sizes import Sizes
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.naming import element_text
from fcdm_opt.geometry.patches import NearestPoints, true_faces
from fcdm_opt.geometry.units import gap_text
from fcdm_opt.judge.engagement import goes_through
from fcdm_opt.model.task import Task, lines_of
from fcdm_opt.model.true_faces import Exchange
from fcdm_opt.problem.contacts_restored import flat_contacts, restoring_motion, touching_again
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import Problem
from fcdm_opt.stages.contact_system import System

MOST_NAMED = 3  # contacts that are told, those that are worst first
MOST_PAIRS = 2000  # of parts: with more the search takes longer than what it tells is worth
MORE = 1.01  # times what lacks where keep-outs are kept that has to lack where they are not
SHARE, SHRINK, STEPS = 0.1, 0.25, 24  # of the size, of a step that does not help, and steps
NEAR = 1e-6  # of the size of the bodies: what a local search leaves


@lru_cache(maxsize=16)
def nearest_pose(problem: Problem) -> tuple[Array, list[str]]:
    """Return the best pose found, parameters of the motion, (k,), and in words what lacks there; [] if not known.

    Asked of what has no solution. The search is local: a pose at which less lacks is not excluded. Of goals "touch"
    and "clear" asked are the gap of the parts made and those of keep-outs, of others the contact as drawn.
    """
    if problem.partial or len(problem.movable.parts) * len(problem.static.parts) > MOST_PAIRS:
        return np.zeros(len(problem.limits)), []
    missed = _untouched if problem.goal in ("touch", "clear") else _contact_missed
    q, lacking = (missed if touching_again(problem) is None else _unrestored)(problem)
    lacking = list(dict.fromkeys(lacking))  # of several parts that one plane is on
    if any(goes_through(problem, tuple(q.tolist()), own) for own in (None, *problem.keep_out)):
        lacking = []
    return np.clip(np.where(np.abs(q) <= NEAR * problem.size / problem.weights, 0.0, q), *problem.limits.T), lacking


def nearest_miss(problem: Problem) -> str:
    """Return in words what still lacks at the best pose found, and between what; "" where that is not known."""
    q, lacking = nearest_pose(problem)
    if not lacking:
        return ""
    (low, high), near = problem.limits.T, NEAR * problem.size / problem.weights
    held = [name for name, end in zip(problem.motion.names, np.fmin(q - low, high - q) <= near, strict=True) if end]
    limit = f", {' and '.join(held)} at the limit" if held else ""
    where = problem.motion.describe(q.tolist(), unit=problem.unit, digits=4)
    more = f"; {len(lacking) - MOST_NAMED} more" if len(lacking) > MOST_NAMED else ""
    return f"at the nearest pose found ({where}{limit}) {'; '.join(lacking[:MOST_NAMED])}{more}"


def _untouched(problem: Problem) -> tuple[Array, list[str]]:
    """Return the pose with the best worst gap, and the gaps that are not what they have to be there, worst first."""
    low, high = (problem.clearance, np.inf) if problem.goal == "clear" else (0.0, 0.0)
    target, rest = np.array([problem.target]), np.zeros(len(problem.limits))
    if (round_ones := Exchange.of(problem)) is not None:
        plain = problem.motion.shifts and not problem.keep_out
        return _of_true_faces(problem.of_facets, round_ones) if plain else (rest, [])
    try:
        worst = Worst.of(problem, Sizes(frozen(np.repeat(target.T, 2, axis=1)), pairs=frozen(target)), low, high)
    except InputError:  # keep-outs of which only the surface is known
        return rest, []
    far = SHARE * problem.size / problem.weights
    turn = far * problem.motion.turning  # where faces lie on each other none is near
    starts = [np.clip(own, *problem.limits.T) for own in (rest, turn, -turn)[: 3 if turn.any() else 1]]
    asked = [(worst, own, 1.0) for own in starts]
    if worst.keep_out:  # beyond one there may be room, too
        ends = np.where(np.isfinite(problem.limits), problem.limits / 2.0, np.column_stack([-far, far]))
        starts += [np.where(np.arange(len(rest)) == k, end, rest) for k in range(len(rest)) for end in ends[k]]
        asked += [(replace(worst, kept_first=True), own, MORE) for own in starts]
    each = ((_lacking(worst, least_moved(own, better(own, q), found_at(own, q)).q), more) for own, q, more in asked)
    (_, q, gaps), _ = min(each, key=lambda own: own[0][0] * own[1])
    slack = max(problem.contact_slack, NEAR * worst.scene.size)
    missed = [text for miss, text in gaps if miss > slack]
    return q, missed + [f"in the way, {text}" for miss, text in gaps if abs(miss) <= slack] * bool(missed)


def _lacking(worst: Worst, q: Array) -> tuple[float, Array, list[tuple[float, str]]]:
    """Return what lacks at a pose, the sum of what each body lacks most, the pose, and every gap, worst first."""
    bodies = [list(_gaps(own, q)) for own in (worst, *worst.keep_out)]
    lack = sum(max([miss for miss, _ in gaps] + [0.0]) for gaps in bodies)
    return lack, q, sorted(chain.from_iterable(bodies), key=lambda own: -own[0])


def _of_true_faces(problem: Problem, asked: Exchange) -> tuple[Array, list[str]]:
    """Return the same of shifts of parts with round faces that overlap as drawn, whose facets tell other gaps.

    By linear programs for the largest least gap, within steps that become smaller where one does not help.
    """
    from scipy.optimize import linprog

    (low, high), q = problem.limits.T, np.zeros(len(problem.limits))
    shifts, q = -problem.motion.shift_vectors(problem.movable.seed, problem.static.seed), np.clip(q, low, high)

    def at(values: Array) -> list[NearestPoints]:
        pose = problem.motion.transform(values, problem.movable.seed, problem.static.seed)
        return asked.nearest(pose, SHARE * problem.size)

    radius = SHARE * problem.size
    near = at(q)
    for _ in range(STEPS):
        if not near or near[0].gap > -problem.contact_slack:
            return q, []
        slopes = np.array([shifts @ own.normal for own in near])
        gaps = np.array([own.gap for own in near]) - slopes @ q
        ends = np.column_stack([np.maximum(q - radius, low), np.minimum(q + radius, high)])
        found = linprog(
            np.append(np.zeros(len(q)), -1.0), np.column_stack([-slopes, np.ones(len(gaps))]), gaps,
            bounds=[*ends.tolist(), (None, None)],
        )  # fmt: skip
        ahead = found.x[:-1] if found.status == 0 else q
        there = at(ahead)
        if not there or there[0].gap > near[0].gap:
            q, near = ahead, there
        else:
            radius *= SHRINK
    return q, _overlapping(problem, asked, q)


def _overlapping(problem: Problem, asked: Exchange, q: Array) -> list[str]:
    """Return in words which true faces are nearest after a motion, where they are nearer than is asked."""
    pose = problem.motion.transform(q, problem.movable.seed, problem.static.seed)
    each = [own for own in asked.nearest(pose, SHARE * problem.size)[:1] if own.gap < -problem.contact_slack]
    facets = problem.of_facets
    needs, found = [asked.need, *(own.clearance for own in facets.keep_out)], list[str]()
    for own in each:
        names = _between(facets.movable, facets.static, own)
        names += f" and keep-out {facets.keep_out[own.other - 1].body.name}" if own.other else ""
        found.append(f"{names} {gap_text(own.gap + needs[own.other], 0.0, problem.unit, needs[own.other])}")
    return found


def _between(movable: Body, static: Body, met: NearestPoints) -> str:
    """Return the true faces that are nearest to each other, in words: of keep-outs that of the movable body."""
    each = zip(map(true_faces, (movable, static)), met.points, strict=False)
    faces = [found.face_of(next(iter(found.at(point)))) for found, point in each]
    return element_text(movable, faces[0]) if len(faces) == 1 else Feature(*faces).in_words(movable, static)


def _unrestored(problem: Problem) -> tuple[Array, list[str]]:
    """Return the shift at which contacts of true faces as drawn lack least, and what lacks there, worst first."""
    found, asked = restoring_motion([problem]), problem.of_facets
    if found is not None and found.q is not None:  # others overlap there
        return found.q, _overlapping(problem, Exchange(asked), found.q)
    if found is None or found.nearest is None:
        return np.zeros(len(problem.limits)), []
    movable, static = asked.bodies_made.values()
    names = [_between(movable, static, own) for own in found.points[0]]
    names += [own.in_words(movable, static) for own in flat_contacts(asked)]
    gaps = sorted(zip(found.remaining[0].tolist(), names, strict=True), key=lambda own: -abs(own[0]))
    missed = [f"{name} {gap_text(gap, 0.0, problem.unit)}" for gap, name in gaps if abs(gap) > NEAR * problem.size]
    return found.nearest, missed


def _gaps(worst: Worst, q: Array) -> Iterator[tuple[float, str]]:
    """Yield by how much each part pair that can be is off its window at parameters, and its gap in words."""
    unit, slack = worst.problem.unit, NEAR * worst.scene.size
    scene, sizes = worst.scene, worst.scene.sizes.box[:, 0]
    at = scene.rows(worst.pose(q))
    gaps = at.of_pairs(sizes[None])[:, 0]
    open_ = worst.high == 0.0 < gaps.min()  # that are to touch: else what overlaps lacks alone
    for k in np.argsort(gaps)[: 1 if open_ else None].tolist():
        gap, one = float(gaps[k]), at.only(np.array([k]))
        between = scene.feature(one, one.at(sizes)).in_words(scene.movable, scene.static)
        yield gap if open_ else worst.low - gap, f"{between} {gap_text(gap, slack, unit, worst.low)}"


def _contact_missed(problem: Problem) -> tuple[Array, list[str]]:
    """Return the pose at which the contact as drawn lacks least, and what lacks there."""
    from scipy.optimize import least_squares

    task, (low, high) = Task.of(problem), problem.limits.T
    q, free = np.clip(np.zeros(len(low)), low, high), low < high

    def off(values: Array) -> Array:
        pose = q.copy()
        pose[free] = values
        if problem.goal != "beyond":
            gaps = task.line_gaps(pose)[1]
            return np.minimum(gaps, 0.0) if problem.goal == FIT else gaps
        short = np.minimum((task.tracked_contact(pose)[0] - problem.target) * task.signs, 0.0)
        return np.where(np.isfinite(short), short, -1.0) * task.size

    if free.any():
        scales = np.maximum(NEAR, 1.0 / problem.weights[free])
        q[free] = least_squares(off, q[free], bounds=(low[free], high[free]), x_scale=scales).x
    if np.abs(off(q[free])).max() <= NEAR * task.size:  # what else overlaps there
        apart = problem.changed(goal="clear", clearance=0.0, pair="any", contacts=None, features=None, path=None)
        return q, System.of(Task.of(apart)).overlaps(q) if task.tracked and problem.goal != "beyond" else []
    if problem.goal == "beyond":
        reached = " and ".join(f"{size:.6g}" for size in task.tracked_contact(q)[0].tolist())
        asked = " and ".join(f"{size:.6g}" for size in problem.target.tolist())
        return q, [f"the contact drawn holds up to sizes {reached}, of {asked} asked"]
    bodies, each = (problem.movable, problem.static), off(q[free]).tolist()
    owners: list[tuple[Feature, ...]] = [(joint.feature,) for joint in task.joints for _ in lines_of(*bodies, joint)]
    worst = dict[tuple[Feature, ...], float]()
    for owner, gap in zip(owners or [problem.tracked_features] * len(each), each, strict=True):
        worst[owner] = max(worst.get(owner, 0.0), gap, key=abs)
    return q, [
        f"{'; '.join(dict.fromkeys(own.in_words(*bodies) for own in owner))} {gap_text(gap, 0.0, problem.unit)}"
        for owner, gap in sorted(worst.items(), key=lambda own: -abs(own[1])) if abs(gap) > NEAR * task.size
    ]  # fmt: skip
