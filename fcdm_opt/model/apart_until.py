"""How far a motion goes at least until parts that are apart touch, on their true faces: of one parameter, or a shift.

Where it turns, the part goes on from each pose by what its distance is at least over its largest speed: nothing is
touched before.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.facet_errors import deviation_of
from fcdm_opt.geometry.measures import norms
from fcdm_opt.geometry.patches import true_faces
from fcdm_opt.geometry.true_distance import MOST, FacesApart
from fcdm_opt.problem.problem import Problem

NEAR = 5e-5  # of the motion: so near to the touch it ends
STEPS = 60
SLOW = 0.2  # of the largest speed: with which parts near each other at the touch, mostly, so that no more is left open
STRAIGHT = 1e-9  # of the size: what poses of one screw motion may differ by, in rounding
DIFFERENCE = 1e-4  # of the motion: a central difference, by which speeds are known to better than MARGIN
MARGIN = 1e-6


def apart_until(problem: Problem, amount: float, *, longer: bool = False) -> tuple[float, bool] | None:
    """Return an amount below which no motion makes parts touch, and whether it is as near to the least as is asked.

    It is not where that would take long, as of faces that are near all over: the amount is less than it might be then.
    None where motions turn and have several parameters, or are no translation, rotation or screw.

    Parameters
    ----------
    problem : Problem
        Whose parts are apart.
    amount : float
        Of a motion with which they touch.
    longer : bool
        Look at ten times as many pieces of faces.
    """
    shifts = problem.motion.shifts
    if (len(problem.motion.names) != 1 and not shifts) or problem.amount != "weighted" or not amount > 0.0:
        return None
    bodies = [body.scaled(scale) for body, scale in zip(problem.bodies[:2], problem.target.tolist(), strict=True)]
    faces = [true_faces(body) for body in bodies]
    pairs = MOST * (10 if longer else 1)
    if shifts:
        _, rates = problem.motion.kinematics(bodies[0].seed, bodies[1].seed).rates(np.zeros(len(problem.weights)))
        low = FacesApart(faces, pairs).least_shift(rates[:, :3, 3].T / problem.weights, amount, amount * (1.0 - NEAR))
        return low, low >= amount * (1.0 - NEAR)
    end = amount / float(problem.weights[0])

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
    for side in (1.0, -1.0):
        apart, x = FacesApart(faces, pairs), 0.0
        for _ in range(STEPS):
            free = apart.least(pose(side * x), small=SLOW * near * speed) if x < end - near else 0.0
            if not free > 0.0:
                break
            x += free / speed
            pacing.check()
        found, whole = min(found, x), whole and apart.remaining >= 0
        if not found > 0.0:
            return None
    return min(found * float(problem.weights[0]), amount), whole
