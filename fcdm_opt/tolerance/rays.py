"""First contact of the target pair along a ray of motions, by conservative advancement.

The signed distance changes by no more than the largest displacement of a vertex, so from a gap g the pair cannot pass
its needed gap within an amount |g - need| / rate: steps of that size miss no contact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerance.bounds import displacement_rate
from fcdm_opt.tolerance.task import Parts, Task
from fcdm_opt.tolerances import DEFAULT

STEPS = 2000  # safe steps along one ray, at most
TURNS = 2.0 * math.pi  # no motion needs to turn further
SHARES = (0.5, 1.0, 2.0)  # of one parameter in another, in the directions between axes


class Contact(NamedTuple):
    """The first contact along a ray.

    Attributes
    ----------
    amount : float
        Where the needed gap is reached; infinite if it is not.
    clear_to : float
        Proved: not reached before this amount.
    """

    amount: float
    clear_to: float


def directions(task: Task) -> Array:
    """Return fixed directions in the parameters, per unit of amount: the axes both ways, and between each two."""
    k = len(task.weights)
    axes = np.vstack([np.eye(k), -np.eye(k)])
    between = [one + share * two for one in axes for two in axes if abs(one @ two) < 1 for share in SHARES]
    rays = np.array([*axes, *between])
    return rays / np.linalg.norm(rays, axis=1)[:, None] / task.weights


def shortened(task: Task, q: Array, normals: Mapping[Parts, Array] | None = None) -> Array:
    """Return the stretch of the ray to q at whose end the target pair has just the gap it needs; q if there is none."""
    from scipy.optimize import brentq

    def miss(s: float) -> float:
        return task.gap(s * q, normals) - task.need

    end = miss(1.0)
    if abs(end) <= DEFAULT.cut * task.unit or miss(0.0) * end >= 0:
        return q
    shorter = q * brentq(miss, 0.0, 1.0, xtol=DEFAULT.line, rtol=4 * np.finfo(float).eps)
    return shorter if task.allows(shorter) else q


def reach(task: Task, direction: Array) -> float:
    """Return how far a ray (parameters per unit amount) runs: to a limit, a whole turn, or away from each other."""
    away = 2.0 * (task.size + float(np.linalg.norm(task.movable.seed - task.static.seed))) * task.target.max()
    ends = [math.inf]
    for (_, kind), slope, (low, high) in zip(task.motion.parameters, direction, task.limits, strict=True):
        if slope != 0:
            ends.append((high if slope > 0 else low) / slope)
            ends.append((TURNS if kind == "rotation" else away + abs(task.need)) / abs(slope))
    return max(min(ends), 0.0)


def first_contact(task: Task, direction: Array, limit: float) -> Contact:
    """Return where along a ray the target pair first has just the gap it needs.

    Parameters
    ----------
    task : Task
        With goal "touch" or "clear".
    direction : (k,) array
        Parameters per unit of amount.
    limit : float
        Amount to go to.
    """
    from scipy.optimize import brentq

    rate = displacement_rate(task)

    def miss(amount: float) -> float:
        return task.gap(amount * direction) - task.need

    here, value = 0.0, miss(0.0)
    side = math.copysign(1.0, value)
    floor = DEFAULT.march * task.size / rate
    proved = 0.0
    sure = True
    for _ in range(STEPS):
        step = abs(value) / rate
        proved = here if sure else proved
        sure = sure and step >= floor
        ahead = min(here + max(step, floor), limit)
        if ahead <= here:
            return Contact(math.inf, limit if sure else proved)
        there = miss(ahead)
        if there * side <= 0:
            root = brentq(miss, here, ahead, xtol=DEFAULT.line * ahead, rtol=4 * np.finfo(float).eps)
            return Contact(float(root), proved)
        here, value = ahead, there
    return Contact(math.inf, proved)
