"""Stage 1 for goals that put the tracked contact on the target pair: motions in which its lines are linear."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from fcdm_opt.curve.kernels import E1E2
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.seats import Bools, held
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.motion.motions import Screw
from fcdm_opt.problem.solution import Status
from fcdm_opt.tolerances import DEFAULT

MOST_PARAMETERS = 6  # of which every choice of those at a limit is looked at


def shift(task: Task) -> Answer | None:
    """Stage 1 for "at" and "seat": the least motion that brings all lines to the target pair, in closed form.

    Exact where each line's gap at the target pair is linear in the parameters: for translations, and for turns about
    the one normal of all lines, which change none. The least solution is a lower bound for all motions, and the answer
    where it meets everything else; where there is no other solution, no motion does.
    """
    if task.goal not in ("at", "seat"):
        return None
    stage = "1: contact lines linear in the motion"
    slack = DEFAULT.touch * task.size
    normals, gaps = task.line_gaps(task.rest)
    if not _fits(task, slack):
        return Answer(Status.INFEASIBLE, None, "1: no place fits all flush contacts at the target pair", np.inf)
    if task.coherent and _must_tilt(task):
        return Answer(Status.INFEASIBLE, None, "1: the limits ask for a turn that opens a flush contact", np.inf)
    moving = (task.limits != 0).any(axis=1)
    if moving.sum() > MOST_PARAMETERS or not _linear(task, normals, moving):
        return None
    rates = np.where(moving, normals @ _seed_rates(task), 0.0)
    rates[np.abs(rates) <= DEFAULT.tie] = 0.0
    found = list(_candidates(task, rates, gaps, moving))
    misses = [miss for miss, _ in found]
    if not found or min(misses) > slack:
        return Answer(Status.INFEASIBLE, None, stage, np.inf)
    q = min((q for miss, q in found if miss <= DEFAULT.cut * task.size), key=task.amount, default=None)
    if q is None:
        return None
    if task.meets(q, DEFAULT.requirement):
        at_limit = bool(((q == task.limits[:, 0]) | (q == task.limits[:, 1]))[moving].any())
        active = ("a limit",) if at_limit else ("the tracked contact at the target pair",)
        kept = [line.parts for line in (*task.tracked, *task.besides)]
        counts = task.modelled(kept, variables=int(moving.sum()), constraints=len(kept), features=len(kept))
        return Answer(Status.SOLVED, q, stage, task.amount(q), active, counts)
    if np.linalg.matrix_rank(rates[:, moving], DEFAULT.nominal) < moving.sum():
        return None  # there are others, larger
    left = task.coherent and replace(task, coherent=False).meets(q, DEFAULT.requirement)
    return Answer(Status.LEFT_COHERENT_RANGE if left else Status.INFEASIBLE, None, stage, np.inf)


def _fits(task: Task, slack: float) -> bool:
    """Tell whether faces that stay flush can all lie on one another at the target pair, wherever body 1 may be.

    A motion that keeps them aligned changes each gap by n . t, t the displacement of the seed; so two walls that face
    each other stay as far apart as they are.
    """
    normals, gaps = task.face_gaps
    return len(gaps) == 0 or bool(np.abs(normals @ _least_square(normals, gaps) - gaps).max() <= slack)


def _must_tilt(task: Task) -> bool:
    """Tell whether a parameter that may not leave zero has limits that exclude zero."""
    low, high = task.limits.T
    return bool(((low > 0) | (high < 0))[held(task.seats, task.motion, task.movable, task.static)].any())


def _linear(task: Task, normals: Array, moving: Bools) -> bool:
    """Tell whether every line's gap is linear in the parameters that may move."""
    steps = [step for step in task.motion.steps for _ in step.own_parameters]
    if any(not step.bounded and some for step, some in zip(steps, moving, strict=True)):
        return False  # of the user's own: anything
    turning = moving & task.spins.any(axis=1)
    along = np.abs(np.cross(normals[:, None], task.spins[turning])).max(initial=0.0) <= DEFAULT.tie
    if turning.any() and not (along and all(line.kind != E1E2 for line in (*task.tracked, *task.besides))):
        return False
    between = any(isinstance(step, Screw) and step.axis == "seeds" and moving[k] for k, step in enumerate(steps))
    return not between or moving.sum() == 1  # its axis follows what the others do


def _seed_rates(task: Task) -> Array:
    """Return how fast each parameter moves the seed at rest, (3, k)."""
    rates = task.motion.kinematics(task.movable.seed, task.static.seed).rates(task.rest)[1]
    return np.asarray((rates @ np.append(task.movable.seed, 1.0))[:, :3].T)


def _candidates(task: Task, rates: Array, gaps: Array, moving: Bools) -> Iterator[tuple[float, Array]]:
    """Yield (miss, q) for the least q in each choice of parameters held at a limit, where it keeps the other limits.

    The least q of all is among those with no miss: it is the least of its own choice.
    """
    low, high = task.limits.T
    room = DEFAULT.line * task.size / task.weights
    choices = [
        [None, *(x for x in {a: None, b: None} if np.isfinite(x))] if some else [0.0]
        for a, b, some in zip(low.tolist(), high.tolist(), moving, strict=True)
    ]
    for choice in sorted(product(*choices), key=lambda choice: sum(x is not None for x in choice)):
        free = np.array([x is None for x in choice])
        q = np.array([x or 0.0 for x in choice])
        q[free] = _least_square(rates[:, free] / task.weights[free], gaps - rates @ q) / task.weights[free]
        if (q >= low - room).all() and (q <= high + room).all():
            q = np.clip(q, low, high)
            miss = float(np.abs(rates @ q - gaps).max())
            yield miss, q
            if not moving[~free].any() and miss <= DEFAULT.cut * task.size:
                return


def _least_square(rows: Array, values: Array) -> Array:
    """Return the smallest of the vectors that come nearest to rows . x = values."""
    return np.asarray(np.linalg.lstsq(rows, values, rcond=DEFAULT.nominal)[0])
