"""Stage 1: motions in which everything that is asked is linear. While nothing tilts, contact lines and separations are.

"shift" is for the goals that bring tracked contacts to the target pair, a least squares problem, or beyond it, a least
distance. "straight" and
"translations" are for "touch" and "clear". The separation of a part pair along each of its facet directions is linear
in the parameters then, and the pair is apart where one of them is positive. Along one translation each pair overlaps in
an interval, and is nearer than a clearance in a longer one. Along several this is a branching over half-spaces, best
first, with a least distance problem in each node: the first node in which no pair overlaps is the smallest motion of
all; where none is left, there is no motion. What a clearance forbids is convex too: polytopes within it grow where a
motion comes too near.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from itertools import islice, product
from typing import Literal

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.kernels import E1E2
from fcdm_opt.geometry.arrays import Array, distinct_rows
from fcdm_opt.model.seats import Bools, held
from fcdm_opt.model.task import Answer, Parts, Task
from fcdm_opt.problem.solution import Status
from fcdm_opt.proof.least_distance import nearer_than
from fcdm_opt.stages.best_first import Choices, Rows, nearest, nearest_on
from fcdm_opt.stages.contact_system import System, among_others
from fcdm_opt.stages.forbidden_shifts import SHARPENED, ForbiddenShifts, placed
from fcdm_opt.stages.rays import ON_THE_WAY, meeting, steady_way
from fcdm_opt.stages.relaxation import choices
from fcdm_opt.tolerances import DEFAULT

# Nodes looked at, and times as many as the most directions of one of several pairs, before the task is left to stage 4.
# A single pair is done after one node for any number of directions: they are tried the nearest first.
MOST_NODES, MOST_WAYS = 2000, 500_000
BATCH_SIZE = 16  # pairs of many that are taken up together
LINES = "1: contact lines linear in the motion"
NOWHERE = 1e-9  # half-spaces exclude each other where their least motion is longer than its inverse, in sizes


# ----------------------------------------------------------------------------------------------------- tracked contacts


def shift(task: Task) -> Answer | None:
    """Stage 1 for "at", "seat" and "beyond": the least motion that brings all lines to the target pair, in closed form.

    Exact where each line's gap at the target pair is linear in the parameters: for translations, and for turns about
    the one normal of all lines, which change none. The least solution is a lower bound for all motions, and the answer
    where it meets everything else; where there is no other solution, no motion does. Nor does any where faces that must
    stay flush cannot all lie on one another at the target pair: a motion that keeps them aligned changes each gap by
    n . t, t the displacement of the seed, so two walls that face each other stay as far apart as they are.
    """
    if task.goal not in ("at", "seat", "beyond"):
        return None
    slack = DEFAULT.touch * task.size
    normals, gaps = task.face_gaps
    if len(gaps) and np.abs(normals @ np.linalg.lstsq(normals, gaps, rcond=DEFAULT.nominal)[0] - gaps).max() > slack:
        return _impossible("1: no place fits all flush contacts at the target pair")
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
    left = task.coherent and replace(task, coherent=False).meets(q, DEFAULT.requirement)
    return Answer(Status.LEFT_COHERENT_RANGE if left else Status.INFEASIBLE, None, LINES, np.inf)


def _beyond(task: Task, rates: Array, gaps: Array) -> Answer | None:
    """Return the least motion for which the lines meet beyond the target pair, if it meets everything else."""
    # `gaps` are in sizes, `rates` by z, see `System`
    met, _, tracked = task.tracked_contact(task.rest)
    if not np.isfinite(met).all():
        return None
    # how the scale pair at which they meet follows the lines' gaps: in proportion
    ways = task.size * task.signs[:, None] * np.linalg.pinv(np.array([line.line[:2] for line in tracked]))
    own, normals, levels = System(task, ()), -ways @ rates, -ways @ gaps

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
    moving = (task.limits != 0).any(axis=1)
    at_limit = bool(((q == task.limits[:, 0]) | (q == task.limits[:, 1]))[moving].any())
    active = ("a limit",) if at_limit else ("the tracked contact at the target pair",)
    kept = [line.parts for line in (*task.tracked, *task.untracked)]
    counts = task.modelled(kept, variables=int(moving.sum()), constraints=len(kept), features=len(kept))
    return task.answer(q, LINES, np.inf, active, counts)


def _linear(task: Task, normals: Array, moving: Bools) -> bool:
    """Tell whether every line's gap is linear in the parameters that may move."""
    steps = task.motion.owners
    if any(not step.bounded and some for step, some in zip(steps, moving, strict=True)):
        return False  # of the user's own: anything
    turning = moving & task.spins.any(axis=1)
    if turning.any():
        along = np.abs(np.cross(normals[:, None], task.spins[turning])).max(initial=0.0) <= DEFAULT.tie
        if not (along and all(line.kind != E1E2 for line in (*task.tracked, *task.untracked))):
            return False
    between = (task.motion.along_seeds & moving).any()
    return not between or moving.sum() == 1  # its axis follows what the others do


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
    slack, along = DEFAULT.line * task.size, task.motion.ways(task.movable.seed, task.static.seed)[0]
    pairs = meeting(task, steady_way(task, np.ones(1)))
    needs, others = task.needs[pairs[:, 1]], pairs[:, 1] >= len(task.static.parts)
    low, high, beside, features = task.spans(pairs, along).T
    met = (beside <= slack) & (low <= high + slack)
    normals = dict[int, Array]()  # before and beyond what a clearance blocks
    for k in np.flatnonzero(met & (needs > 0.0)).tolist():
        pacing.check()
        normals[k], (i, j) = np.zeros((2, 3)), pairs[k].tolist()
        low[k], high[k], distance = nearer_than(needs[k], *placed(task, (i, j)), along, low[k], high[k], normals[k])
        beside[k] = max(beside[k], distance - needs[k])
    met &= low <= high + slack
    blocked = np.flatnonzero(met & (beside < -slack) & (low < high - slack))
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
    least = float(places[free[0]])
    stops = others & met & (np.minimum(np.abs(low - least), np.abs(high - least)) <= slack)
    for place in places[: free[0]].tolist() if others.any() else ():
        in_the_way = blocked[(lows < place) & (place < highs)]
        stops[in_the_way] |= others[in_the_way].all()
    q = np.array([least])
    sides = {k: int(2.0 * least > low[k] + high[k]) for k in blocked.tolist() if k in normals}
    ways = {tuple(pairs[k].tolist()): normals[k][side] for k, side in sides.items()}
    if task.needs.max() > 0 and not task.meets(q, DEFAULT.line, ways):
        return None
    names = tuple(dict.fromkeys(task.named(parts) for parts in map(tuple, pairs[stops].tolist())))
    near = met & (np.maximum(low, -high) <= abs(least) + slack)
    kept = [(i, j) for i, j in pairs[near].tolist()]
    counts = task.modelled(kept, variables=1, constraints=len(kept), features=int(features[near].sum()))
    return task.answer(q, stage, np.inf, names or ON_THE_WAY, counts)


def _within(places: Array, lows: Array, highs: Array, side: Literal["left", "right"]) -> Bools:
    """Tell which places lie in some interval: "left" strictly inside, "right" on its ends too."""
    order = np.argsort(lows, kind="stable")
    before = np.searchsorted(lows[order], places, side)  # so many begin before
    ends = np.append(-np.inf, np.maximum.accumulate(highs[order]))[before]
    return np.asarray(ends > places if side == "left" else ends >= places)


# ------------------------------------------------------------------------------------------------- several translations


def translations(task: Task) -> Answer | None:
    """Find the smallest shift that undoes all overlaps, keeps clearances, and touches where that is asked; exact.

    The shifts that bring two parts nearer than a clearance fill their Minkowski difference and what is nearer to it:
    a convex set. A polytope within it forbids no more than it does, the difference itself to begin with. Where the
    least shift outside all polytopes still brings parts too near, the point of the set's border ahead of it joins the
    polytope, and it is sought anew. Of many pairs few decide: one is looked at once it overlaps after the least shift,
    and as the one to touch once its gap is less than that shift.
    """
    if task.tracked or len(task.weights) < 2 or not task.motion.shifts:
        return None
    shifts, limits = task.motion.ways(task.movable.seed, task.static.seed), System(task, ()).limits()
    later = _touching(task, shifts)
    first = product(range(len(task.movable.parts)), range(len(task.obstacles))) if task.part_pairs <= BATCH_SIZE else ()
    lines = {parts: _lines(task, parts, shifts) for parts in first}
    walls = {}
    for parts, own in lines.items():
        flat = np.linalg.norm(own.normals, axis=1) <= DEFAULT.tie
        if np.isfinite(task.needs[parts[1]]) and not (own.levels[flat] >= -DEFAULT.cut).any():  # some may overlap
            walls[parts] = _wall(own)
    closings = dict[Parts, Rows]() if later else None
    clearances = ForbiddenShifts(task)
    stage, curved, sharpened = "1: translations, best first over separating directions", False, 0
    while sharpened < SHARPENED:
        pacing.check()
        least = _least(task, limits, walls, closings)
        if least is None:
            return None
        x, pairs, constraints = least
        length = np.inf if x is None else float(np.linalg.norm(x))
        sooner = [parts for bound, parts in later[: max(BATCH_SIZE, len(closings or ()))] if bound < length]
        if closings is not None and sooner:
            later = later[len(sooner) :]
            rows = {parts: _closing(lines.get(parts) or _lines(task, parts, shifts)) for parts in sooner}
            closings |= {parts: own for parts, own in rows.items() if own is not None}
            continue
        if x is None:
            return _impossible(stage)
        q = x * task.size / task.weights
        new = {parts: _wall(_lines(task, parts, shifts)) for parts in _overlapping(task, q, walls)}
        if new:
            walls |= new
            continue
        known, sharpened = {*clearances.points}, sharpened + 1
        grown = clearances.grow(q) if task.needs.max() > 0.0 else set()
        curved = curved or bool(grown & known)  # not at a facet moved out, where all is exact
        for parts in grown:
            wall = clearances.walls[parts]
            if wall is None:
                return None
            walls[parts] = wall
        if not grown:
            break
    q = np.clip(q, *task.limits.T)
    if not task.meets(q, DEFAULT.requirement):
        return None
    names = tuple(dict.fromkeys(task.named(parts) for parts in pairs))
    ways = sum(max(len(own[parts].levels) for own in (walls, closings or {}) if parts in own) for parts in pairs)
    counts = task.modelled(pairs, variables=len(q), constraints=constraints, features=ways)
    best = task.answer(q, stage, np.inf, names, counts)
    for relaxation in choices(task, q, near=True) if curved else ():  # the amount is exact; where it is, not as much
        polished = relaxation.smallest([q], "sqpmethod")
        if polished is not None and polished.amount <= best.lower_bound * (1.0 + DEFAULT.nominal):
            amount = polished.amount
            best = replace(best, q=polished.q, amount=amount, lower_bound=min(best.lower_bound, amount))
    return best


def _overlapping(task: Task, q: Array, known: Collection[Parts]) -> list[Parts]:
    """Return the part pairs that overlap most after a motion, but for known ones."""
    gaps = np.where(np.isfinite(task.needs), task.pair_gaps(q), np.inf)
    codes = np.flatnonzero(gaps < -DEFAULT.cut * task.size)
    codes = codes[np.argsort(gaps.ravel()[codes], kind="stable")]
    pairs = (divmod(code, gaps.shape[1]) for code in codes.tolist())
    return list(islice((parts for parts in pairs if parts not in known), BATCH_SIZE))


def _wall(lines: Rows) -> Rows:
    """Return a pair's ways apart, clearances left out."""
    moved = np.linalg.norm(lines.normals, axis=1) > DEFAULT.tie
    return Rows(-lines.normals[moved], -lines.levels[moved])


def _touching(task: Task, shifts: Array) -> list[tuple[float, Parts]]:
    """Return the pairs that may be the one to touch, and no x is less that makes them; the nearest first."""
    # none where one does in any case: what overlaps at rest touches as soon as it does not
    gaps = task.pair_gaps(task.rest)[:, : len(task.static.parts)]
    if not task.must_touch or (gaps.min() <= 0.0 and task.allows(task.rest) and not task.keep_out):
        return []
    fastest = float(np.linalg.norm(shifts / task.weights[:, None], 2))
    order = np.argsort(gaps, axis=None, kind="stable").tolist()
    bounds = (gaps.ravel()[order] / fastest / task.size).tolist()
    return [(bound, divmod(code, gaps.shape[1])) for bound, code in zip(bounds, order, strict=True)]


def _closing(lines: Rows) -> Rows | None:
    """Return the rows under which a pair does not stay apart; None where it always does."""
    flat = np.linalg.norm(lines.normals, axis=1) <= DEFAULT.tie
    return Rows(lines.normals[~flat], lines.levels[~flat]) if (lines.levels[flat] <= DEFAULT.cut).all() else None


def _lines(task: Task, parts: Parts, shifts: Array) -> Rows:
    """Return a pair's directions as rows over the scaled parameters, and separations at rest, in sizes.

    Where there are several pairs each direction once: all ways of one pair are combined with those of the others.
    """
    _, rows, separations = task.separations(parts, task.pose(task.rest))
    lines = np.column_stack([rows[:, :3] @ shifts.T / task.weights, separations / task.size])
    if task.part_pairs > 1:
        lines = lines[distinct_rows(np.round(lines / DEFAULT.tie))[0]]
    return Rows(lines[:, :-1], lines[:, -1])


def _least(
    task: Task, limits: Rows, walls: dict[Parts, Rows], closings: dict[Parts, Rows] | None
) -> tuple[Array | None, list[Parts], int] | None:
    """Return the least x that no wall forbids, or None; the pairs that decide, and the rows besides the limits.

    At it one of `closings`, if given, is met. None alone where too many nodes were looked at.
    """
    if closings is not None and not closings:
        return None, [], 0
    count, pairs = len(task.weights), [*walls, *(closings or ())]
    everywhere = limits.and_also(-np.eye(1, count), np.array([-1.0 / NOWHERE]))
    choices = Choices.of_single_rows(list(walls.values()), count)
    if closings and all(len(own.levels) for own in closings.values()):  # without rows one is met in any case
        choices = choices.and_also(Choices.of([[*closings.values()]], count))
    ways = max((len(wall.levels) for wall in walls.values()), default=1) if task.part_pairs > 1 else 1
    nodes = min(MOST_NODES, MOST_WAYS // ways)
    least = nearest(choices, everywhere, np.zeros(count), slack=DEFAULT.cut, nodes=nodes, most=1.0 / NOWHERE)
    if least.y is None:
        return (None, [], 0) if least.complete else None
    # of the last group each alternative is a pair, of a wall's its directions are
    first = len(choices.alternatives) - len(closings or ())
    decide = {pairs[group if group < len(walls) else group + way - first] for group, way in least.chosen.items()}
    return least.y, sorted(decide), len(least.rows.levels) - len(everywhere.levels)
