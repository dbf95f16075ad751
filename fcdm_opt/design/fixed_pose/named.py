"""One pose for all sizes by name: turns by a local search, shifts by the rows of a stack-up, with proof.

A shift of the movable body is one size more: the gap is affine in it along each row. So over cells of shifts bounds
follow from the rows alone. At given sizes p the gap of a part pair is a convex function of the shift, and no less than
each of its rows; so by how much it falls short of the window is at least a concave function, and so is by how much the
least of one row a pair is beyond it. Any mixture of such functions is least in a corner of the cell, see `games.game`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import count, product
from typing import NamedTuple

import numpy as np

from fcdm_opt.curve.games import game
from fcdm_opt.curve.touching_sizes import TouchingSizes
from fcdm_opt.design.fixed_pose.local_search import Linear, nearest
from fcdm_opt.geometry.arrays import Array, Flags
from fcdm_opt.judge.engagement import passage
from fcdm_opt.motion.motions import Free, Translation
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

ROUNDS = 30  # of linear programs about a pose, and of cuts that bring one into the window
TURNS = 400  # poses that a search over turns looks at
MOST_SEEN = 24  # sizes at which cells are looked at: the latest extremes
TINY = float(np.finfo(float).tiny)
WIDE = 1.0  # share that a cell's width has in the choice of what to halve, where the least amount is looked for
RAW = 1e-3  # of a cell's width, besides what it costs the bound, in the choice of what to halve


class GapRange(NamedTuple):
    """The least and the largest gap over all sizes, each with sizes at which it is taken, and how far they are off."""

    least: tuple[float, Array]
    most: tuple[float, Array]
    off: float


class NamedPose(NamedTuple):
    """A pose, the range of its gaps, what no pose has less of, and how many cells were looked at for that."""

    q: Array
    range: GapRange
    touching: TouchingSizes
    bound: float
    cells: int


@dataclass(eq=False)
class Shifts:
    """The worst gap of all sizes over shifts q of the movable body: off(q) = max(most(q) - high, low - least(q)).

    Attributes
    ----------
    touching : TouchingSizes
        With shifts as sizes behind the others.
    low, high : float
        The window.
    near : float
        Length that is nothing.
    seen : list of (int, array)
        Part pair and sizes at which its gap was the least anywhere, and sizes at which the gap was the largest (-1).
    """

    touching: TouchingSizes
    low: float
    high: float
    near: float
    seen: dict[tuple[int, bytes], Array] = field(default_factory=dict)

    @property
    def limits(self) -> Array:
        """Of the shifts, (s, 2)."""
        return self.touching.ranges

    def at(self, q: Array) -> GapRange:
        """Return the range of the gap at shifts q."""
        there = self.touching.shifted(q)
        least, most = there.least(), there.largest()
        parts = there.pairs[there.governing(least[1])[0]].parts
        place = [pair.parts for pair in self.touching.pairs].index(parts)
        self.seen[place, least[1].tobytes()] = least[1]
        self.seen[-1, most[1].tobytes()] = most[1]
        return GapRange(least, most, max(most[0] - self.high, self.low - least[0]))

    def bound(self, cell: Array) -> tuple[float, Array]:
        """Return what `off` is not less than in a cell (s, 2) of shifts, and what each shift adds to what is lost."""
        known, half = len(self.touching.sizes), np.ptp(cell, axis=1) / 2.0
        corners, middle = np.array(list(product(*cell))), cell.mean(axis=1)
        pairs = [(pair.values[:, : 1 + known], pair.values[:, 1 + known :]) for pair in self.touching.pairs]
        told, slopes = [], []
        for (place, _), p in list(self.seen.items())[-MOST_SEEN:]:
            q = np.append(1.0, p)
            if place >= 0 and self.low > -np.inf:
                rows, rates = pairs[place]
                heights = (rows @ q)[:, None] + rates @ corners.T
                told.append(self.low - heights.max(axis=0))
                slopes.append(rates[int(heights.max(axis=1).argmax())])
            elif place < 0 and self.high < np.inf:
                chosen = [int((rows @ q + rates @ middle).argmax()) for rows, rates in pairs]
                heights = np.array([
                    rows[k] @ q + rates[k] @ corners.T for k, (rows, rates) in zip(chosen, pairs, strict=True)
                ])  # fmt: skip
                told.append(heights.min(axis=0) - self.high)
                least = int(heights.min(axis=1).argmin())
                slopes.append(pairs[least][1][chosen[least]])
        floor = (self.low - self.high) / 2.0
        if not told:
            return floor, half
        values = np.array(told)
        shares = game(values)
        return max(float((shares @ values).min()), floor), (shares @ np.abs(slopes) + RAW) * half

    def rows(self, q: Array) -> tuple[Array, Array]:
        """Return affine functions of the shifts, values at q and slopes: off is no more than the largest of them.

        For the least gap one row of each pair, at its lowest; for the largest all rows of one pair, at their highest.
        """
        known = len(self.touching.sizes)
        box = self.touching.box[:known]
        middle, half = box.mean(axis=1), np.ptp(box, axis=1) / 2.0
        values, slopes, tops = [], [], []
        for pair in self.touching.pairs:
            heights = pair.values[:, 0] + pair.values[:, 1 : 1 + known] @ middle + pair.values[:, 1 + known :] @ q
            swing = np.abs(pair.values[:, 1 : 1 + known]) @ half
            row = int((heights - swing).argmax())
            values.append([self.low - (heights - swing)[row]])
            slopes.append(-pair.values[row : row + 1, 1 + known :])
            tops.append((float((heights + swing).max()), heights + swing - self.high, pair.values[:, 1 + known :]))
        _, most, rates = min(tops, key=lambda own: own[0])
        values.append(most)
        slopes.append(rates)
        made, rates = np.concatenate(values), np.vstack(slopes)
        return made[np.isfinite(made)], rates[np.isfinite(made)]

    def better(self, q: Array) -> tuple[Array, GapRange]:
        """Return shifts that are off by less than q, or q itself: linear programs."""
        from scipy.optimize import linprog

        here = self.at(q)
        for _ in range(ROUNDS):
            values, slopes = self.rows(q)
            cost = np.append(np.zeros(len(q)), 1.0)
            left = np.column_stack([slopes, -np.ones(len(values))])
            found = linprog(cost, left, slopes @ q - values, bounds=[*self.limits.tolist(), (None, None)])
            if found.status:
                break
            step = np.clip(found.x[:-1], *self.limits.T)
            there = self.at(step)
            if not there.off < here.off - self.near:
                break
            q, here = step, there
        return q, here

    def smaller(self, q: Array, here: GapRange, weights: Array) -> tuple[Array, GapRange]:
        """Return shifts in the window of a smaller weighted amount than q, or q itself."""
        for _ in range(ROUNDS):
            values, slopes = self.rows(q)
            steps = self.limits - q[:, None]
            step = nearest(Linear(values - self.near, slopes), q, weights, steps, 0.0)
            there = None if step is None else self.at(np.clip(step, *self.limits.T))
            if step is None or there is None or there.off > self.near:
                break
            if not np.linalg.norm(weights * step) < np.linalg.norm(weights * q) * (1.0 - DEFAULT.line):
                break
            q, here = np.clip(step, *self.limits.T), there
        return q, here

    def searched(
        self, q: Array, here: GapRange, weights: Array, *, amounts: bool, accuracy: float, effort: int, stop: bool
    ) -> tuple[Array, GapRange, float, int]:
        """Return the best shifts, what no shifts have less of, and the number of cells: branch and bound.

        With `amounts` the least amount in the window is looked for, else what is off least; with `stop` only until
        something is in the window.
        """

        def value() -> float:
            return float(np.linalg.norm(weights * q)) if amounts else here.off

        def of(cell: Array) -> tuple[float, Array]:
            bound, scores = self.bound(cell)
            if not amounts:
                return bound, scores
            least = np.linalg.norm(weights * np.maximum(np.maximum(cell[:, 0], -cell[:, 1]), 0.0))
            wide = weights * np.ptp(cell, axis=1)
            mixed = scores / max(float(scores.max()), TINY) + WIDE * wide / max(float(wide.max()), TINY)
            return (np.inf if bound > 2.0 * self.near else float(least)), mixed

        numbers, cells = count(), 0
        heap = [(of(self.limits)[0], next(numbers), self.limits)]
        floor = 0.0 if amounts else (self.low - self.high) / 2.0
        while heap and cells < effort and not (stop and here.off <= self.near):
            enough = value() - max(accuracy * abs(value()), self.near)
            if max(heap[0][0], floor) >= enough:
                break
            cell = heappop(heap)[2]
            bound, scores = of(cell)  # by all that was seen since
            if bound >= enough:
                heappush(heap, (bound, next(numbers), cell))
                continue
            axis = int(np.argmax(scores))
            middle = cell[axis].mean()
            for side in (0, 1):
                half = cell.copy()
                half[axis, 1 - side] = middle
                cells += 1
                bound, _ = of(half)
                if bound < enough:
                    centre, there = half.mean(axis=1), self.at(half.mean(axis=1))
                    promising = there.off <= self.near if amounts else there.off < here.off
                    if promising and (not amounts or np.linalg.norm(weights * centre) < value()):
                        q, here = self.smaller(centre, there, weights) if amounts else self.better(centre)
                    bound = of(half)[0]
                heappush(heap, (bound, next(numbers), half))
        return q, here, max(min(heap[0][0] if heap else np.inf, value()), floor), cells


def found(
    problem: Problem, low: float, high: float, *, windowed: bool, accuracy: float, effort: int
) -> tuple[NamedPose, bool]:
    """Return the best pose for all of a problem's sizes, and whether it is inside the window.

    Without a window the pose whose largest |gap| is least; else the smallest motion into the window, or the pose that
    misses it least.
    """
    straight = _straight(problem)
    turns = np.logical_not(straight)
    weights, limits = problem.weights, np.array(problem.limits)
    scale = problem.motion.weights(problem.movable.size / 2.0)

    def posed(q: Array, thorough: int) -> tuple[NamedPose, bool]:
        shifts = _shifts(problem, q, straight, low, high)
        rest = np.clip(np.zeros(int(straight.sum())), *shifts.limits.T)
        here = shifts.at(rest)
        place, bound, cells = rest, here.off, 0
        if not windowed or here.off > shifts.near:
            place, here = shifts.better(rest)
            place, here, bound, cells = shifts.searched(
                place, here, weights[straight], amounts=False, accuracy=accuracy, effort=thorough, stop=windowed
            )
        inside = windowed and here.off <= shifts.near
        if inside:
            place, here = shifts.smaller(place, here, weights[straight])
            place, here, bound, more = shifts.searched(
                place, here, weights[straight], amounts=True, accuracy=accuracy, effort=thorough, stop=False
            )
            cells += more
        made = q.copy()
        made[straight] = place
        return NamedPose(made, here, shifts.touching.shifted(place), bound, cells), inside

    start = np.clip(np.zeros(len(limits)), *limits.T)
    if not turns.any():
        return posed(start, effort)
    from scipy.optimize import minimize

    best = posed(start, 0)

    def cost(x: Array) -> float:
        nonlocal best
        q = start.copy()
        q[turns] = np.clip(x / scale[turns], *limits[turns].T)
        outcome, inside = posed(q, 0)
        value = _value(outcome, inside, weights, problem.size)
        if value < _value(*best, weights, problem.size) - DEFAULT.tie * problem.size:
            best = outcome, inside
        return value

    first = (start * scale)[turns]
    simplex = np.vstack([first, first + 0.02 * problem.size * np.eye(len(first))])
    options = {"maxfev": TURNS, "initial_simplex": simplex, "xatol": 1e-9 * problem.size, "fatol": 1e-9 * problem.size}
    minimize(cost, first, method="Nelder-Mead", options=options)
    outcome, inside = best
    return outcome._replace(bound=0.0 if inside or windowed else (low - high) / 2.0, cells=0), inside


def _value(outcome: NamedPose, inside: bool, weights: Array, size: float) -> float:
    """Return what a pose is compared by: its amount in the window, which beats all that are outside."""
    return float(np.linalg.norm(weights * outcome.q)) if inside else outcome.range.off + 1e3 * size


def _straight(problem: Problem) -> Flags:
    """Return which parameters shift the movable body whatever the others are, (k,)."""
    found: list[bool] = []
    for step in problem.motion.steps:
        kinds = [kind for _, kind in step.own_parameters]
        found += [isinstance(step, Translation | Free) and kind == "translation" for kind in kinds]
    return np.array(found)


def _shifts(problem: Problem, q: Array, straight: Flags, low: float, high: float) -> Shifts:
    """Return the shifts about a pose, as far as any is wanted."""
    movable, static = problem.request["movable"], problem.request["static"]

    def transform(q: Array) -> Array:
        return problem.motion.transform(q, movable.seed, static.seed)

    places = np.flatnonzero(straight)
    still = np.where(straight, 0.0, q)
    T = transform(still)
    ways = np.array([transform(still + np.eye(len(q))[k])[:3, 3] - T[:3, 3] for k in places]).reshape(-1, 3)
    # parts further apart than this are further apart than any wanted pose: than they are at rest, or have to be
    away = float(np.linalg.norm(T[:3, :3] @ movable.seed + T[:3, 3] - static.seed))
    reach = 2.0 * (away + 2.0 * (movable.size + static.size) + sum(abs(x) for x in (low, high) if np.isfinite(x)))
    narrow = float(np.linalg.svd(ways, compute_uv=False)[-1]) if 0 < len(ways) <= 3 else 1.0
    reach = reach / narrow if narrow > DEFAULT.nominal else np.inf
    limits = np.clip(np.array(problem.limits)[places].reshape(-1, 2), -reach, reach)
    within = np.array([passage(problem, way) for way in ways]).reshape(-1, 2)  # gaps beyond a wall mean nothing
    limits = np.column_stack([np.maximum(limits[:, 0], within[:, 0]), np.minimum(limits[:, 1], within[:, 1])])
    touching = TouchingSizes.of(movable, static, problem.sizes, transform=T, shifts=(ways, limits), least=False)
    return Shifts(touching, low, high, DEFAULT.touch * problem.size)
