"""First contact of the target pair along a ray of motions, by conservative advancement.

Along a ray that turns body 1 steadily about a line, steps of second order miss no contact, see `steady`. Along others
the signed distance changes by no more than the largest displacement of a vertex, so from a gap g the pair cannot pass
its needed gap within an amount |g - need| / rate: of that rate no bound is used, and such steps are a rule of search.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array, Ints, crossed, frozen
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages import steady
from fcdm_opt.tolerances import DEFAULT

STEPS, FEWEST = 2000, 100  # safe steps along one ray, at most; where many rays are tried
TRIED = 400_000  # steps of a part pair each along many rays, beyond which none takes more than the fewest
TURNS = 2.0 * math.pi  # no motion needs to turn further, from rest or where limits let it begin
NEAREST_CONTACT = ("the nearest contact on the way",)
WORK = 2e7  # pairs of edges looked at between two looks at the clock
ACROSS = 16  # directions across a shift, in which part pairs that it leads past each other are told
FEW = 16  # part pairs that are all looked at
LARGE = 0.5  # of the size: displacements beyond this are large
FINE = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 5.0, 10.0, 20.0)


class FirstContact(NamedTuple):
    """The first contact along a ray: where the needed gap is reached, infinite if it is not."""

    # it is proved not to be reached before `clear_to`, 0 where nothing is proved
    amount: float
    clear_to: float


def one_parameter(task: Task) -> Answer | None:
    """Stage 2 for "touch" and "clear" along one parameter: safe steps both ways to the first contact, then its root."""
    if task.tracked or len(task.weights) != 1:
        return None
    steady = is_steady(task, np.ones(1))
    if not steady and task.needs.max() > 0:
        return None
    stage = "2: one parameter, safe steps to the first contact"
    directions = [sign / task.weights for sign in (1.0, -1.0)]
    ends = [range_end(task, direction) for direction in directions]
    # limits may exclude rest: then one way starts at the nearer limit, and the other ends before it begins
    starts = [max(0.0, task.weights[0] * x) for x in (task.limits[0, 0], -task.limits[0, 1])]
    for sense, start, end in zip(directions, starts, ends, strict=True):
        if 0 < start <= end and task.meets(start * sense, DEFAULT.line):
            q = start * sense
            return task.answer(q, stage, start, ("a limit",), task.modelled_by_gaps(q))
    amount, nearer, clear = np.inf, 0, [0.0, 0.0]
    for k in (0, 1) if not steady or leads_nearer(task, directions[0]) else (1, 0):
        contact = first_contact(task, directions[k], min(ends[k], amount), starts[k])
        clear[k] = np.inf if contact.clear_to >= ends[k] else contact.clear_to
        amount, nearer = min((amount, nearer), (contact.amount, k))
    if not np.isfinite(amount):  # proved where both ways are clear to their ends
        if min(clear) < np.inf and (task.keep_out or task.need > 0):
            return None
        return Answer(Status.INFEASIBLE if min(clear) == np.inf else Status.NOT_FOUND, None, stage, min(clear))
    bound = max(min(clear), 0.0 if steady else task.displacement_bound)
    q = amount * directions[nearer]
    if steady and not task.meets(q, DEFAULT.requirement):
        return None
    near = task.pair_gaps(q) - task.needs <= DEFAULT.requirement * task.size
    others = [parts for parts in np.ndindex(near.shape) if near[parts] and task.obstacles[parts[1]].keep_out >= 0]
    stops = tuple(dict.fromkeys(map(task.named, others)))
    return task.answer(q, stage, bound, stops or NEAREST_CONTACT, task.modelled_by_gaps(q))


def first_contact(task: Task, direction: Array, limit: float, start: float = 0.0, most: int = STEPS) -> FirstContact:
    """Return where along a ray the target pair first has just the gap it needs, from an amount to a limit.

    The direction is in parameters per unit of amount, the goal "touch" or "clear". A contact that a keep-out forbids
    is passed by: the way is then searched on from there. `most` are steps where body 1 does not move steadily.
    """
    pacing.check()
    if not is_steady(task, direction):
        return _searched(task, direction, limit, start, most)
    motion, (movable, others, needs) = steady_motion(task, direction), _solids(task)
    pairs = meeting(task, motion, start, limit)
    floor, finest = (share * task.size / _speed(motion, movable[0]) for share in (DEFAULT.march, DEFAULT.line))
    until, now, state = np.full(len(pairs), -np.inf), np.full(6, -1.0), np.array([start, 0.0, 1.0, 0.0, 0.0])
    solids = movable, others, task.static.seed - task.movable.seed, needs, pairs, len(task.static.parts)
    steps = task.must_touch, limit, floor, finest, STEPS, DEFAULT.line, DEFAULT.line * task.size, WORK
    while not steady.first(motion, *solids, *steps, until, now, state):
        pacing.check()
    return FirstContact(float(state[0]), float(state[1]))


def meeting(task: Task, motion: Array, start: float = -math.inf, end: float = math.inf) -> Ints:
    """Return which part pairs may come as near as they need on a stretch of a steady way, (k, 2).

    By the extents of what they sweep: along the way's line, and across it in several directions or, where body 1
    turns, from the nearest to the farthest from the line. `motion`: see `steady`. Few pairs are all returned: that they
    stay apart takes no longer to see on the way.
    """
    asked = task.needs > -np.inf
    if task.part_pairs <= FEW:
        return np.ascontiguousarray(np.argwhere(np.repeat(asked[None], len(task.movable.parts), axis=0)))
    n, centre, (turn, shift, _) = motion
    first = np.cross(n, np.eye(3)[np.abs(n).argmin()])
    angles = np.arange(ACROSS) * np.pi / ACROSS
    directions = np.outer(np.cos(angles), first) + np.outer(np.sin(angles), np.cross(n, first))
    directions = np.vstack([n, directions / np.linalg.norm(first)])
    low, high = [], []
    for (points, _, _, places), seed in zip(_solids(task)[:2], (task.movable.seed, task.static.seed), strict=True):
        heights, starts = directions @ (points + (seed - task.movable.seed - centre)).T, places[:-1, 0]
        least, most = (extreme.reduceat(heights, starts, axis=1) for extreme in (np.minimum, np.maximum))
        if turn != 0.0:
            farthest = np.sqrt(np.maximum.reduceat(heights[1] ** 2 + heights[1 + ACROSS // 2] ** 2, starts))
            nearest = np.maximum(least[1:], -most[1:]).max(axis=0)
            least, most = np.array([least[0], nearest]), np.array([most[0], farthest])
        low.append(least)
        high.append(most)
    if shift != 0.0:
        low[0][0] += min(start * shift, end * shift)
        high[0][0] += max(start * shift, end * shift)
    room = np.maximum(task.needs, 0.0) + DEFAULT.cut * task.size
    near = (low[0][0][:, None] <= high[1][0] + room) & (low[1][0] - room <= high[0][0][:, None])
    one, two = np.nonzero(near & asked)
    for least, most, low_2, high_2 in zip(low[0][1:], high[0][1:], low[1][1:], high[1][1:], strict=True):
        near = (least[one] <= (high_2 + room)[two]) & ((low_2 - room)[two] <= most[one])
        one, two = one[near], two[near]
    return np.column_stack([one, two])


def _searched(task: Task, direction: Array, limit: float, start: float, most: int) -> FirstContact:
    """Return the first contact by steps of first order, which along one parameter of known reach prove as much."""
    from scipy.optimize import brentq

    rate, slack = task.search_rate, DEFAULT.line * task.size

    def miss(amount: float) -> float:
        return task.misses(amount * direction)[0]

    here, (value, clear) = start, task.misses(start * direction)
    side = math.copysign(1.0, value)
    floor = DEFAULT.march * task.size / rate
    proved, sure = 0.0, len(direction) == 1 and task.bounded
    for _ in range(most):
        pacing.check()
        if here >= limit:
            return FirstContact(math.inf, limit if sure else proved)
        step = max(abs(value), -clear) / rate
        forbidden = -clear > abs(value) and step >= floor
        proved = here if sure else proved
        sure = sure and step >= floor
        ahead = min(here + max(step, floor), limit)
        there, cleared = task.misses(ahead * direction)
        if forbidden:  # all the way: contacts there do not count
            side = math.copysign(1.0, there)
        elif there * side <= 0 and there * value <= 0:
            if there != 0:
                ahead = float(brentq(miss, here, ahead, xtol=DEFAULT.line * ahead, rtol=4 * np.finfo(float).eps))
                there, cleared = task.misses(ahead * direction)
            if cleared >= -slack:
                return FirstContact(ahead, proved)
            side = -side
        here, value, clear = ahead, there, cleared
    return FirstContact(math.inf, proved)


def on_a_ray(task: Task, known: Answer | None) -> Answer | None:
    """Return the least first contact along fixed directions; None if it is not less than the best known.

    Along the axes always, as a start may have passed the contact by; along the others where nothing is known, or the
    best known motion is as large as the bodies.
    """
    large = known is None or known.amount * task.search_rate > LARGE * task.size
    contact, tried = None, directions(task, FINE) if large else directions(task, ())
    most = min(max(TRIED // (task.part_pairs * len(tried)), FEWEST), STEPS)
    for direction in tried:
        least = contact or known
        limit = min(range_end(task, direction), np.inf if least is None else least.amount)
        amount = first_contact(task, direction, limit, most=most).amount
        if amount < limit and task.meets(q := amount * direction, DEFAULT.requirement):
            contact = task.answer(q, active=NEAREST_CONTACT, modelled=task.modelled_by_gaps(q))
    return contact


def is_steady(task: Task, direction: Array) -> bool:
    """Tell whether body 1 moves steadily along a ray: by one parameter, or by shifts alone."""
    if len(direction) == 1:
        return task.bounded
    each = zip(task.motion.owners, task.motion.shift_directions, direction.tolist(), strict=True)
    moving = [(step, own) for step, own, slope in each if slope != 0]
    return all(own is not None for _, own in moving) or (len(moving) == 1 and moving[0][0].bounded)


def steady_motion(task: Task, direction: Array) -> Array:
    """Return the line, a point on it about the moved seed, turn and shift per unit of amount, (3, 3)."""
    seed, rates = task.movable.seed, _rates(task)
    rate = (direction @ rates.reshape(len(rates), 16)).reshape(4, 4)
    w, v = np.array([rate[2, 1], rate[0, 2], rate[1, 0]]), rate[:3, :3] @ seed + rate[:3, 3]
    turn = math.sqrt(w @ w)
    if turn == 0.0:
        shift = math.sqrt(v @ v)
        return np.array([v / shift, np.zeros(3), (0.0, shift, 0.0)])
    return np.array([w / turn, crossed(w, v) / turn**2, (turn, v @ w / turn, 0.0)])


@lru_cache(maxsize=4)
def _rates(task: Task) -> Array:
    """Return the derivatives of the transform at rest, (k, 4, 4)."""
    return task.rates(task.rest)[1]


@lru_cache(maxsize=4)
def _solids(task: Task) -> tuple[Any, Any, Array]:
    """Return body 1 at the scale made, the obstacles about s_2, and the gap that each needs."""
    movable = [_solid(part, float(task.target[0]), np.zeros(3)) for part in task.movable.parts]
    others = [_solid(own.part, own.scale, own.part.seed - task.static.seed) for own in task.obstacles]
    return stacked(movable), stacked(others), np.array(task.needs)


def _speed(motion: Array, points: Array) -> float:
    """Return how fast the fastest of some points moves."""
    axis, centre, (turn, shift, _) = motion
    arms = points - centre
    arms = arms - np.outer(arms @ axis, axis)
    return math.hypot(turn * math.sqrt((arms * arms).sum(axis=1).max()), shift)


def leads_nearer(task: Task, direction: Array) -> bool:
    """Tell whether a steady ray seems to lead to the first contact sooner than the way back; either may."""
    gaps = task.pair_gaps(task.rest)
    i, j = divmod(int(gaps.argmin()), gaps.shape[1])
    sites, rows, separations = task.separations((i, j), task.pose(task.rest))
    widest = np.array([int(separations.argmax())])
    nearing = task.gap_rates((i, j), task.rest, sites[widest], rows[widest, :3])[0] @ direction < 0.0
    return bool(nearing != (float(gaps[i, j]) < task.obstacles[j].need))


def _solid(part: ConvexPart, scale: float, offset: Array) -> tuple[Array, Array, Ints]:
    """Return points, normals with levels and edges of a part at a scale, about a point `offset` from its seed."""
    reals, ints = part.packed
    n, f = int(ints[0]), int(ints[1])
    points, faces = scale * reals[:n, :3] + offset, reals[n : n + f].copy()
    faces[:, 3] = (faces[:, :3] @ points.T).max(axis=1)
    return points, faces, part.edges


def stacked(tables: Sequence[tuple[Array | Ints, ...]]) -> tuple[Any, ...]:
    """Return the tables of several parts one after the other, and the first row of each in the first three."""
    places = np.cumsum([(0, 0, 0), *([len(table) for table in each[:3]] for each in tables)], axis=0)
    return (*(np.ascontiguousarray(np.concatenate(each)) for each in zip(*tables, strict=True)), places)


def directions(task: Task, shares: tuple[float, ...]) -> Array:
    """Return fixed directions in the parameters, per unit of amount: the axes both ways, and between two by shares."""
    return _units(len(task.weights), shares) / task.weights


@lru_cache(maxsize=64)
def _units(k: int, shares: tuple[float, ...]) -> Array:
    axes = np.vstack([np.eye(k), -np.eye(k)])
    between = [one + share * two for one, two in combinations(axes, 2) if one @ two == 0 for share in shares]
    rays = np.array([*axes, *between])
    return frozen(rays / np.linalg.norm(rays, axis=1)[:, None])


def range_end(task: Task, direction: Array) -> float:
    """Return how far a ray (parameters per unit amount) runs: to a limit, a whole turn, or out of each other's way."""
    away, motion = _away(task), task.motion
    ends = [math.inf]
    each = zip(motion.owners, motion.parameters, direction, task.limits, strict=True)
    for step, (_, kind), slope, (low, high) in each:
        if slope != 0:
            first, last = ((low, high) if slope > 0 else (high, low)) / np.array(slope)
            ends.append(last)
            if kind == "translation":
                ends.append(away / abs(slope))
            elif step.closed or not step.bounded or len(direction) > 1:
                ends.append(TURNS / abs(slope) + max(first, 0.0))  # limits may exclude rest
            else:  # a screw: what it shifts in a radian
                ends.append(away / step.own_weights(0.0)[0] / abs(slope))
    return max(min(ends), 0.0)


@lru_cache(maxsize=4)
def _away(task: Task) -> float:
    """Return how far a shift leads at most until the parts are out of each other's way."""
    seed = task.movable.seed
    own = task.target[0] * max(_circumradius(part, seed) for part in task.movable.parts)
    others = [o for o in task.obstacles if o.keep_out < 0 or not task.must_touch]  # no contact beyond the partner
    return float(own + max(max(o.need, 0.0) + _circumradius(o.part, seed, o.scale) for o in others))


def _circumradius(part: ConvexPart, point: Array, scale: float = 1.0) -> float:
    """Return the distance of a part's farthest vertex, at a scale, from a point."""
    return float(np.linalg.norm(part.seed + scale * (part.vertices - part.seed) - point, axis=1).max())
