"""Stage 1: motions in which everything that is asked is linear. While nothing tilts, contact lines and separations are.

"shift" is for the goals that bring tracked contacts to the target pair, a least squares problem, or beyond it, a least
distance. "straight" is for "touch" and "clear" along one translation, in which each part pair overlaps in an interval,
and is nearer than a clearance in a longer one. Of several translations see `contact_system.translations`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.kernels import E1E2
from fcdm_opt.geometry.arrays import Array, Flags
from fcdm_opt.model.seats import held
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.solution import Status
from fcdm_opt.proof.least_distance import nearer_than
from fcdm_opt.stages.best_first import Choices, nearest_on
from fcdm_opt.stages.contact_system import UNSEATED, System, among_others
from fcdm_opt.stages.forbidden_shifts import placed
from fcdm_opt.stages.rays import NEAREST_CONTACT, meeting, steady_motion
from fcdm_opt.tolerances import DEFAULT

LINES = "1: contact lines linear in the motion"


# ----------------------------------------------------------------------------------------------------- tracked contacts


def shift(task: Task) -> Answer | None:
    """Stage 1 for "at", "seat" and "beyond": the least motion that brings all lines to the target pair, in closed form.

    Exact where each line's gap at the target pair is linear in the parameters: for translations, and for turns about
    the one normal of all lines, which change none. The least solution is a lower bound for all motions, and the answer
    where it meets everything else; where there is no other solution, no motion does. Nor does any where
    `Task.seats_disagree`.
    """
    if task.goal not in ("at", "seat", "beyond"):
        return None
    if task.seats_disagree:
        return _impossible(UNSEATED)
    excludes_zero = (task.limits[:, 0] > 0) | (task.limits[:, 1] < 0)
    asked = task.coherent and excludes_zero.any()
    if asked and (excludes_zero & held(task.seats, task.motion, task.movable, task.static)).any():
        return _impossible("1: the limits ask for a turn that opens a flush contact")
    normals, gaps = task.line_gaps(task.rest)
    moving = (task.limits != 0).any(axis=1)
    if not _linear(task, normals, moving):
        return None
    rates = np.where(moving, -task.line_rates(task.rest, normals), 0.0)
    rates[np.abs(rates) <= DEFAULT.tie] = 0.0
    if task.goal == "beyond":
        return _beyond(task, rates / task.weights, gaps / task.size)
    own = System(task, ())
    z, sure = nearest_on(rates / task.weights, gaps / task.size, own.limits(), Choices.of([], len(moving)))
    if z is None:
        return _impossible(LINES) if sure else None
    q = own.q(z)
    if np.abs(rates @ q - gaps).max() > DEFAULT.cut * task.size:
        return None
    if task.meets(q, DEFAULT.requirement):
        return _on_lines(task, q)
    if np.linalg.matrix_rank(rates[:, moving], DEFAULT.nominal) < moving.sum():
        return among_others(task)
    outside = task.coherent and replace(task, coherent=False).meets(q, DEFAULT.requirement)
    return Answer(Status.LEFT_COHERENT_RANGE if outside else Status.INFEASIBLE, None, LINES, np.inf)


def _beyond(task: Task, rates: Array, gaps: Array) -> Answer | None:
    """Return the least motion for which the lines meet beyond the target pair, if it meets everything else."""
    # `gaps` are in sizes, `rates` by z, see `System`
    met, _, tracked = task.tracked_contact(task.rest)
    if not np.isfinite(met).all():
        return None
    # how the scale pair at which they meet follows the lines' gaps: in proportion
    inverse = task.size * task.signs[:, None] * np.linalg.pinv(np.array([line.line[:2] for line in tracked]))
    own, normals, levels = System(task, ()), -inverse @ rates, -inverse @ gaps

    def least(slack: float) -> tuple[Array | None, bool]:
        rows = own.limits().and_also(normals, levels - slack)
        return nearest_on(rates[:0], gaps[:0], rows, Choices.of([], len(rates.T)))

    z, _ = least(0.0)
    if z is None:
        z, sure = least(DEFAULT.touch)
        return _impossible(LINES) if z is None and sure else None
    q = own.q(z)
    return _on_lines(task, q) if task.meets(q, DEFAULT.requirement) else None


def _on_lines(task: Task, q: Array) -> Answer:
    """Return the least motion that the tracked lines allow as the answer."""
    own = System(task, ())
    active = own.at_limits(q) or ("the tracked contact at the target pair",)
    kept = [line.parts for line in (*task.tracked, *task.untracked)]
    counts = task.modelled(kept, variables=int(own.moving.sum()), constraints=len(kept), features=len(kept))
    return task.answer(q, LINES, np.inf, active, counts)


def _linear(task: Task, normals: Array, moving: Flags) -> bool:
    """Tell whether every line's gap is linear in the parameters that may move."""
    if any(not step.bounded and some for step, some in zip(task.motion.owners, moving, strict=True)):
        return False  # of the user's own: anything
    turning = moving & task.spins.any(axis=1)
    if turning.any():
        along = np.abs(np.cross(normals[:, None], task.spins[turning])).max(initial=0.0) <= DEFAULT.tie
        if not (along and all(line.kind != E1E2 for line in (*task.tracked, *task.untracked))):
            return False
    return not (task.motion.along_seeds & moving).any() or moving.sum() == 1  # its axis follows what the others do


def _impossible(stage: str) -> Answer:
    return Answer(Status.INFEASIBLE, None, stage, np.inf)


# ------------------------------------------------------------------------------------------------------ one translation


def straight(task: Task) -> Answer | None:
    """Stage 1 for "touch" and "clear" along one translation: exact, and smallest by construction.

    Directions and supports do not change, so each part pair is nearer than its clearance in an open interval of the
    parameter, along which the distance is convex; without one it overlaps there and touches at its ends. One that
    slides by at just its clearance, flush as it may be, has it all along.
    """
    if task.tracked or len(task.weights) != 1 or not task.motion.shifts:
        return None
    slack, along = DEFAULT.line * task.size, task.motion.shift_vectors(task.movable.seed, task.static.seed)[0]
    pairs = meeting(task, steady_motion(task, np.ones(1)))
    needs, others = task.needs[pairs[:, 1]], pairs[:, 1] >= len(task.static.parts)
    low, high, apart, features = task.spans(pairs, along).T
    met = (apart <= slack) & (low <= high + slack)
    normals = dict[int, Array]()  # before and beyond what a clearance blocks
    for k in np.flatnonzero(met & (needs > 0.0)).tolist():
        pacing.check()
        normals[k], (i, j) = np.zeros((2, 3)), pairs[k].tolist()
        low[k], high[k], distance = nearer_than(needs[k], *placed(task, (i, j)), along, low[k], high[k], normals[k])
        apart[k] = max(apart[k], distance - needs[k])
    met &= low <= high + slack
    blocked = np.flatnonzero(met & (apart < -slack) & (low < high - slack))
    places = np.clip([0.0, *low[met], *high[met]], *task.limits[0])
    if task.must_touch:
        own = met & ~others
        places = places[_within(places, low[own] - slack, high[own] + slack, "right")]
    places = places[np.argsort(np.abs(places), kind="stable")]
    stage = "1: one translation, intervals of overlap"
    lows, highs = low[blocked] + slack, high[blocked] - slack
    free = np.flatnonzero(~_within(places, lows, highs, "left"))
    if not free.size:
        return _impossible(stage)
    allowed = places[free]
    opposite = allowed[np.abs(allowed + allowed[0]) <= slack]
    least = float(min([allowed[0], *opposite[:1]]))  # of two as long, one either way, rounding would choose either
    stops = others & met & (np.minimum(np.abs(low - least), np.abs(high - least)) <= slack)
    for place in places[: free[0]].tolist() if others.any() else ():
        obstructing = blocked[(lows < place) & (place < highs)]
        stops[obstructing] |= others[obstructing].all()
    q = np.array([least])
    sides = {k: int(2.0 * least > low[k] + high[k]) for k in blocked.tolist() if k in normals}
    directions = {tuple(pairs[k].tolist()): normals[k][side] for k, side in sides.items()}
    if task.needs.max() > 0 and not task.meets(q, DEFAULT.line, directions):
        return None
    names = tuple(dict.fromkeys(task.named(parts) for parts in map(tuple, pairs[stops].tolist())))
    near = met & (np.maximum(low, -high) <= abs(least) + slack)
    kept = [(i, j) for i, j in pairs[near].tolist()]
    counts = task.modelled(kept, variables=1, constraints=len(kept), features=int(features[near].sum()))
    return task.answer(q, stage, np.inf, names or NEAREST_CONTACT, counts)


def _within(places: Array, lows: Array, highs: Array, side: Literal["left", "right"]) -> Flags:
    """Tell which places lie in some interval: "left" strictly inside, "right" on its ends too."""
    order = np.argsort(lows, kind="stable")
    before = np.searchsorted(lows[order], places, side)  # so many begin before
    ends = np.append(-np.inf, np.maximum.accumulate(highs[order]))[before]
    return np.asarray(ends > places if side == "left" else ends >= places)
