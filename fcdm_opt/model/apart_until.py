"""How far a motion goes at least until parts that are apart touch, on their true faces.

Of one parameter, where it turns, the part goes on from each pose by what its distance is at least over its largest
speed: nothing is touched before. Of several each pair of pieces of faces shows by itself what brings it together.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facet_errors import deviation_of
from fcdm_opt.geometry.measures import norms
from fcdm_opt.geometry.patches import true_faces
from fcdm_opt.geometry.true_distance import MOST, FacesApart, PoseDerivatives
from fcdm_opt.problem.problem import Problem

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
    step = DIFFERENCE * end
    rate = (pose(step) - pose(-step)) / (2.0 * step)
    speeds = norms(bodies[0].vertices @ rate[:3, :3].T + rate[:3, 3])
    speed = (1.0 + MARGIN) * (speeds.max() + norms(rate[:3, :3]).max() * np.sqrt(3.0) * deviation_of(bodies[0])[1])
    found, near, whole = end, NEAR * end, True
    for side, limit in ((1.0, high), (-1.0, -low)):
        apart, x = FacesApart(faces, pairs), 0.0
        for _ in range(STEPS):
            free = apart.least(pose(side * x), small=SLOW * near * speed) if x < min(end - near, limit) else 0.0
            if not free > 0.0:
                break
            x += free / speed
            pacing.check()
        found, whole = min(found, end if x >= limit else x), whole and apart.remaining >= 0
        if not found > 0.0:
            return None
    return min(found * float(problem.weights[0]), amount), whole


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
