"""Stage 4, next: motions with two parameters along a coherent path, direction by direction.

Where the contact ends before the least motion of its kind, the least coherent one stands at the end of a window of
directions, of which local searches see one side. Looked at ray by ray it is an ordinary minimum, see `fan`.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerance.bounds import displacement_bound
from fcdm_opt.tolerance.proof.columns import farthest
from fcdm_opt.tolerance.solution import Status
from fcdm_opt.tolerance.stages import fan, rays
from fcdm_opt.tolerance.stages.descent import Descent
from fcdm_opt.tolerance.stages.tape import tape
from fcdm_opt.tolerance.task import Answer, Task
from fcdm_opt.tolerances import DEFAULT

STAGE = "4: directions of a coherent path, one after the other"
RAYS, RAYS_OF_MANY = 240, 96  # directions looked at first; of bodies of many parts, which take longer
MANY = 4  # part pairs, from which on every look is at all of them
WINDOWS = 12  # of the directions that miss the requirement by the least, looked into for windows too narrow to be seen
TURN, SHARE, FIRST = 0.05, 1 / 32, 1e-5  # longest step along a ray, radians and of the size; and the first, in units
FINE = 1e-14  # radians: of the direction found
WITHIN = 0.5  # of the slack of faults: what is found is to be coherent to whoever computes it otherwise
BESIDE = 1e-6  # radians: where it is asked what ends the window


def suits(task: Task) -> bool:
    """Tell whether a task's motions are such a fan: two parameters, coherent, and no flush contact to keep."""
    line = len(task.tracked) == 1 and task.goal in ("beyond", "at")
    two = len(task.tracked) == 2 and task.goal == "beyond"
    fan_like = task.coherent and len(task.weights) == 2 and task.weighted and (line or two)
    return fan_like and not any(task.flush) and tape(task.motion) is not None


def polar(task: Task) -> Answer | None:
    """Return the least motion over all directions, None where there is none or it does not meet what is asked besides.

    What is asked besides, of the target pair or by keep-outs, does not make motions less: where the least motion
    without meets it, it is the least.
    """
    if not suits(task):
        return None
    found = _least(replace(task, pair="any", keep_out=()))
    if found is None:
        return None
    q, sides = found
    if not task.meets(q, DEFAULT.requirement):
        return None
    counts = task.modelled({own.parts for own in task.tracked}, variables=2, constraints=2, features=len(task.tracked))
    bound = min(displacement_bound(task), task.amount(q))
    return Answer(Status.SOLVED, q, STAGE, bound, _active(task, q, sides), counts)


def _least(task: Task) -> tuple[Array, tuple[Array, ...]] | None:
    """Return the least motion, and those beside it, in directions a little to both sides."""
    program = tape(task.motion)
    assert program is not None
    own = Descent(task, program, False)
    *scene, path = own.scene
    path[4] *= WITHIN
    turns = np.where(own.turning, rays.TURNS, np.inf)
    limits = np.clip(task.limits, -turns[:, None], turns[:, None]) / own.scale[:, None]
    steps = np.array([FIRST, *(np.where(own.turning, TURN, SHARE * task.size) / own.scale)])
    given = (*scene, path, task.signs.astype(np.float64), np.ascontiguousarray(limits), steps)
    count = RAYS if task.part_pairs <= MANY else RAYS_OF_MANY
    cap, width = farthest(task) / task.unit, 2.0 * math.pi / count
    merits = fan.fan(*given, count, cap)
    lowest = np.flatnonzero((merits <= np.roll(merits, 1)) & (merits <= np.roll(merits, -1)))
    best, at = np.inf, 0.0
    for k in lowest[np.argsort(merits[lowest], kind="stable")][:WINDOWS].tolist():
        merit, angle = fan.least(*given, (k - 1) * width, (k + 1) * width, min(cap, best), FINE)
        if merit < min(best, fan.FAR):
            best, at = merit, angle
    if not best < fan.FAR:
        return None

    def motion(angle: float) -> Array:
        made: Array = best * np.array([math.cos(angle), math.sin(angle)]) * own.scale
        return made

    return np.clip(motion(at), *task.limits.T), (motion(at - BESIDE), motion(at + BESIDE))


def _active(task: Task, q: Array, sides: tuple[Array, ...]) -> tuple[str, ...]:
    """Return what the motion meets exactly, and what is wrong with the contact on the way in directions beside."""
    names = ["target on the moved segment"] if len(task.tracked) == 1 else []
    if len(task.tracked) == 2:
        off = np.abs(task.tracked_contact(q)[0] / task.target - 1.0) <= DEFAULT.requirement
        names += [f"rho_{k + 1} reaches its target" for k in range(2) if off[k] and task.signs[k] != 0]
    for side in sides:
        for _, _, fault in task.path_faults(side):
            if fault is None:
                names.append("the tracked contact ends on the way")
            elif fault.kind == "unsupported":
                part = fault.parts[fault.body - 1] + 1
                names.append(f"a vertex of body {fault.body}, part {part}, behind the tracked feature")
            else:
                state = "apart" if fault.kind == "overlapping" else "in contact"
                names.append(f"{task.named(fault.parts)} stays {state} on the way")
    if not np.all((q > task.limits[:, 0]) & (q < task.limits[:, 1])):
        names.append("a limit")
    return tuple(dict.fromkeys(names))
