"""Stage 4, next: motions with two parameters that keep a tracked contact, direction by direction.

Where the contact ends before the least motion of its kind, the least coherent one stands at the end of a window of
directions, of which local searches see one side. Looked at ray by ray it is an ordinary minimum, see
`compiled.merits`. Where the path is free it is an answer too, and no ray tells of a contact that comes back: others are
left to branch and bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.motion.instructions import pose_instructions
from fcdm_opt.problem.solution import Status
from fcdm_opt.proof.columns import farthest
from fcdm_opt.stages import compiled, rays
from fcdm_opt.stages.descent import Descent
from fcdm_opt.tolerances import DEFAULT

STAGE = "4: directions, one after the other, while the contact lasts"
RAYS, RAYS_OF_MANY = 240, 96  # directions looked at first; of bodies of many parts, which take longer
COARSE = 12  # one in so many is looked at before, so that the others need not be followed far
MANY = 4  # part pairs, from which on every look is at all of them
WINDOWS = 12  # of the directions that miss the requirement by the least, looked into for windows too narrow to be seen
TURN, SHARE, FIRST = 0.05, 1 / 32, 1e-5  # longest step along a ray, radians and of the size; and the first, in units
ROUGH = 10  # halvings of the step at which a contact is lost, in directions that are not looked into
GOLDEN = (3.0 - math.sqrt(5.0)) / 2.0
HOPELESS, PATIENCE = 4.0, 3  # times what two directions differ by, that both miss: so often in a row
FINE = 1e-14  # radians: of the direction
WITHIN = 0.5  # of the slack of faults: what is found is to be coherent to whoever computes it otherwise
BEFORE_END = 1e-4  # radians: where it is asked what ends the window, which stops short of parallel lines


def suits(task: Task) -> bool:
    """Tell whether a task's motions are a fan of rays: two parameters, a switching point, and none that stays flush."""
    fan = len(task.weights) == len(task.tracked) == 2 and task.goal == "beyond" and task.weighted
    return fan and not any(task.flush) and pose_instructions(task.motion) is not None


def least_direction(task: Task) -> Answer | None:
    """Return the least motion over all directions, None where there is none or it does not meet what is asked besides.

    What is asked besides, of the target pair or by keep-outs, does not make motions less: where the least motion
    without meets it, it is the least.
    """
    if not suits(task):
        return None
    least = _least(replace(task, pair="any", keep_out=()))
    if least is None:
        return None
    q, sides = least
    if not task.meets(q, DEFAULT.requirement):
        return None
    counts = task.modelled({own.parts for own in task.tracked}, variables=2, constraints=2, features=len(task.tracked))
    bound = min(task.displacement_bound, task.amount(q))
    return Answer(Status.SOLVED, q, STAGE, bound, _active(task, q, sides), counts)


def _least(task: Task) -> tuple[Array, tuple[Array, ...]] | None:
    """Return the least motion, and those beside it, in directions a little to both sides."""
    program = pose_instructions(task.motion)
    assert program is not None
    own = Descent(task, program)
    *scene, path = own.scene
    path = path.copy()
    path[4] *= WITHIN
    turns = np.where(task.motion.turning, rays.TURNS, np.inf)
    limits = np.clip(task.limits, -turns[:, None], turns[:, None]) / own.scale[:, None]
    steps = np.array([FIRST, *(np.where(task.motion.turning, TURN, SHARE * task.size) / own.scale)])
    given = ((*scene, path), task.signs.astype(np.float64), np.ascontiguousarray(limits), steps)
    count = RAYS if task.part_pairs <= MANY else RAYS_OF_MANY
    cap, width = farthest(task) / task.unit, 2.0 * math.pi / count

    def objectives_of(angles: Array, halvings: int = compiled.ROOT_HALVINGS) -> Array:
        pacing.check()
        return compiled.objectives(*given, np.ascontiguousarray(angles), cap, halvings)

    angles: Array = np.arange(count, dtype=np.float64) * width
    cap = min(cap, float(objectives_of(angles[::COARSE], ROUGH).min()))
    objectives = objectives_of(angles, ROUGH)
    lowest = np.flatnonzero((objectives <= np.roll(objectives, 1)) & (objectives <= np.roll(objectives, -1)))
    best, at = np.inf, 0.0
    for k in lowest[np.argsort(objectives[lowest], kind="stable")][:WINDOWS].tolist():
        objective, angle = _narrowed(objectives_of, (k - 1) * width, (k + 1) * width)
        if objective < min(best, compiled.FAR):
            best, at, cap = objective, angle, objective
    if not best < compiled.FAR:
        return None

    def motion(angle: float) -> Array:
        return best * np.array([math.cos(angle), math.sin(angle)]) * own.scale

    return np.clip(motion(at), *task.limits.T), (motion(at - BEFORE_END), motion(at + BEFORE_END))


def _narrowed(objectives_of: Callable[[Array], Array], low: float, high: float) -> tuple[float, float]:
    """Return (merit, angle) where the merit is least between two directions, by golden section.

    A window too narrow to have been seen is entered where what is missing becomes nothing; that none opens shows where
    directions differ by less than they miss.
    """
    one, two = low + GOLDEN * (high - low), high - GOLDEN * (high - low)
    first, second = objectives_of(np.array([one, two])).tolist()
    misses = 0
    while high - low > FINE:
        misses = misses + 1 if min(first, second) - compiled.FAR > HOPELESS * abs(first - second) else 0
        if misses > PATIENCE:
            break
        if first <= second:
            high, two, second = two, one, first
            one = low + GOLDEN * (high - low)
            first = float(objectives_of(np.array([one]))[0])
        else:
            low, one, first = one, two, second
            two = high - GOLDEN * (high - low)
            second = float(objectives_of(np.array([two]))[0])
    return min((first, one), (second, two))


def _active(task: Task, q: Array, sides: tuple[Array, ...]) -> tuple[str, ...]:
    """Return what the motion meets exactly, and what is wrong with the contact on the way in directions beside."""
    reached = np.abs(task.tracked_contact(q)[0] / task.target - 1.0) <= DEFAULT.active
    names = [f"rho_{k + 1} reaches its target" for k in range(2) if reached[k] and task.signs[k] != 0]
    for side in sides:
        for _, _, fault in task.path_faults(side):
            ends = "the tracked contact ends on the way"
            names.append(ends if fault is None else fault.kept(task.named(fault.parts)))
    if not np.all((q > task.limits[:, 0]) & (q < task.limits[:, 1])):
        names.append("a limit")
    return tuple(dict.fromkeys(names))
