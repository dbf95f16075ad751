"""Local descent for "touch" and "clear" over all ways in which part pairs may come apart near a motion.

A pair of convex parts is apart where one of its directions separates it: a choice. Near a motion each direction is
linear in the parameters, a row for each vertex that its plane may meet, and the least motion over all choices is found
best first, see `best_first`. Unlike a program with the directions of one motion, it does not stop where parts must come
apart another way, or touch with another pair.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.kernels import E1E2
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.model.task import Answer, Parts, Task
from fcdm_opt.stages.best_first import Choices, Rows, nearest
from fcdm_opt.tolerances import DEFAULT

ROUNDS = 40  # linearisations, at most
RESTORED = 8  # of these in a row that only bring a motion back to where it does
NODES = 100  # choices looked at in one linearisation
SHRINK, GROW = 0.2, 2.0  # of the radius in which rows are taken as linear
SHORTEST = 1e-9  # radius, relative to the amount, at which to stop
STILL = 1e-11  # relative gain of a round that is none
FURTHER = 10.0  # times the first radius, from which on no motion is looked for where none was found
CLOSINGS = 6  # pairs that may be the one to touch, the nearest first


def suits(task: Task) -> bool:
    """Tell whether a task asks for nothing but gaps of part pairs."""
    return not task.tracked and task.weighted and task.goal in ("touch", "clear")


def descended(task: Task, q: Array, radius: float) -> Answer | None:
    """Return the least motion that a descent from a motion, which need not do, finds; None where it finds none."""
    # of a task that `suits`; the first step may change the amount by `radius`
    weights, most = task.weights, FURTHER * radius
    best: Array | None = None
    y = np.clip(np.asarray(q, dtype=np.float64), *task.limits.T) * weights
    least, restoring = np.inf, 0
    start = y
    for _ in range(ROUNDS):
        if pacing.over():
            break
        done = task.meets(y / weights, DEFAULT.line)
        amount = float(np.linalg.norm(y))
        if done and amount < least * (1.0 - STILL):
            radius = radius * (GROW if best is not None else 1.0)
            best, least, restoring, start = y, amount, 0, y
        elif done or restoring == RESTORED:  # no gain, or no way back
            radius, restoring, done, y = radius * SHRINK, 0, best is not None, start
        else:
            restoring += 1
        if radius <= SHORTEST * max(amount, task.unit * SHORTEST) or (best is None and radius > most):
            break
        moved = _step(task, y, radius, np.zeros_like(y) if done else y)
        if moved is None:  # no linearised motion does: nearer ones tell more of it, or, of the start, further ones
            radius, restoring, y = radius * (SHRINK if best is not None else GROW), 0, start
            continue
        if done and float(np.linalg.norm(moved)) >= least * (1.0 - STILL):
            break  # nothing smaller near: a least motion
        y = moved
    if best is None:
        return None
    q = np.clip(best / weights, *task.limits.T)
    near = np.argwhere(task.pair_gaps(q) - task.needs <= DEFAULT.requirement * task.size).tolist()
    names = tuple(dict.fromkeys(f"{task.named((i, j))} stays apart" for i, j in near))
    return task.answer(q, active=names, modelled=task.modelled_by_gaps(q))


def _step(task: Task, y: Array, radius: float, centre: Array) -> Array | None:
    """Return the motion nearest to `centre` within a radius of y in which all linearised pairs are apart.

    A pair is linearised once a motion is found at which it is not apart: of many pairs that are near, few matter.
    """
    scene = Linearised.of(task, y, radius)
    if scene is None:
        return None
    low, high = (np.maximum(y - radius, task.limits[:, 0] * task.weights), y + radius)
    high = np.minimum(high, task.limits[:, 1] * task.weights)
    sides = Rows(np.vstack([np.eye(len(y)), -np.eye(len(y))]), np.concatenate([low, -high]))
    scale = float(np.abs(sides.levels).max()) + float(np.linalg.norm(centre))
    slack = DEFAULT.line * max(scale, DEFAULT.least_unit)
    search = partial(nearest, centre=centre, slack=slack, nodes=NODES)
    gaps = task.pair_gaps(y / task.weights)
    waiting, apart = gaps < task.needs + scene.band, list[list[Rows]]()

    def parted(closing: list[Rows], most: float = np.inf) -> Array | None:
        """Return the nearest motion at which the pairs are apart and those to touch are joined."""
        # of the directions that keep them from touching few matter: each is taken up once a motion misses it
        found, every, taken = gaps, Choices.of_single_rows(closing, len(y)), dict[int, list[Rows]]()
        while True:
            for i, j in np.argwhere(waiting & (found < task.needs)).tolist():
                waiting[i, j] = False
                options = scene.apart((i, j))
                if options is not None:
                    apart.append(options)
            groups = [*apart, *taken.values()]
            best = search(Choices.of(groups, len(y)), sides, most=most).y if all(apart) else None
            if best is None:
                return None
            missed = every.of_rows(every.rows.levels - every.rows.normals @ best)[1]
            worst = int(missed.argmax()) if len(missed) else -1
            if worst >= 0 and worst not in taken and missed[worst] > slack:
                normals, levels = closing[worst]
                taken[worst] = [Rows(normals[k : k + 1], levels[k : k + 1]) for k in range(len(levels))]
                continue
            found = task.pair_gaps(best / task.weights)
            if not (waiting & (found < task.needs)).any():
                return best

    best = parted([])
    if task.must_touch and best is not None:
        partners = gaps[:, : len(task.static.parts)]
        near = sorted(np.argwhere(partners < scene.band).tolist(), key=lambda own: float(gaps[tuple(own)]))
        closings = []
        for i, j in near[:CLOSINGS]:
            closings.append(scene.joined((i, j)))
            if Choices.of_single_rows(closings[-1], len(y)).met(best):
                break
        else:
            best, length = None, np.inf
            for closing in closings:
                closed = parted(closing, length)
                if closed is not None:
                    best, length = closed, float(np.linalg.norm(closed - centre))
    return None if best is None else np.clip(best, low, high)


class Linearised(NamedTuple):
    """A motion y and its rates: R and seed of body 1 about s_2, derivatives by y; gaps within `band` matter."""

    task: Task
    y: Array
    R: Array
    offset: Array
    turns: Array
    shifts: Array
    band: float
    known: dict[Parts, list[tuple[Array, Array]]]

    @classmethod
    def of(cls, task: Task, y: Array, radius: float) -> Linearised | None:
        """Return a motion with its rates and what may change within a radius; None where they are not finite."""
        pose, rates = task.rates(y / task.weights)
        if not (np.isfinite(pose).all() and np.isfinite(rates).all()):
            return None
        rates = rates / task.weights[:, None, None]
        R, turns, seed = pose[:3, :3], rates[:, :3, :3], task.movable.seed
        offset, shifts = R @ seed + pose[:3, 3] - task.static.seed, turns @ seed + rates[:, :3, 3]
        return cls(task, y, R, offset, turns, shifts, 2.0 * task.search_rate * radius * np.sqrt(len(y)), {})

    def apart(self, parts: Parts) -> list[Rows] | None:
        """Return a pair's ways apart as alternatives, none where it has none; None where nothing can join it."""
        found = self.separating(parts)
        return None if found is None else [Rows(J, self.task.needs[parts[1]] - g + J @ self.y) for J, g in found]

    def joined(self, parts: Parts) -> list[Rows]:
        """Return what lets a pair touch, a row of each: of a direction, the vertices that may first meet its plane."""
        return [Rows(-J, g - J @ self.y) for J, g in self.directions(parts) if g.min() > -self.band]

    def separating(self, parts: Parts) -> list[tuple[Array, Array]] | None:
        """Return (gradients, separations) of each direction that may part a pair; None where nothing can join it."""
        need = self.task.obstacles[parts[1]].need
        found = []
        for gradients, gaps in self.directions(parts):
            rows = gaps <= need + self.band
            if not rows.any():
                return None
            if gaps.min() >= need - self.band:
                found.append((gradients[rows], gaps[rows]))
        return found

    def directions(self, parts: Parts) -> list[tuple[Array, Array]]:
        """Return (gradients, (m, k), separations, (m,)) of every direction: a row for each vertex before its plane."""
        if parts not in self.known:
            self.known[parts] = self._directions(parts)
        return self.known[parts]

    def _directions(self, parts: Parts) -> list[tuple[Array, Array]]:
        task, (i, j) = self.task, parts
        one, obstacle = task.movable.parts[i], task.obstacles[j]
        two, need = obstacle.part, obstacle.need
        q = self.y / task.weights

        def near(heights: Array) -> Ints:  # vertices that may meet a plane, or else the nearest
            rows = np.flatnonzero(heights <= max(need, 0.0) + self.band)
            return rows if len(rows) else np.array([heights.argmin()])

        sites, lines, gaps = task.separations(parts, task.pose(q))
        if not self.turns.any() and need <= 0.0:  # a shift: one row for all vertices
            some = np.argsort(-gaps)[: int((gaps >= need - self.band).sum())]  # one that nothing can join comes first
            return list(zip(-(lines[some, None, :3] @ self.shifts.T), gaps[some, None], strict=True))
        x = task.target[0] * (one.vertices - one.seed)
        p = obstacle.placed(task.static.seed)
        moved = x @ self.R.T + self.offset
        speeds = np.einsum("kab,nb->kna", self.turns, x) + self.shifts[:, None]  # of the vertices of body 1
        away = p - self.offset
        found = []
        normals = one.normals @ self.R.T
        heights = normals @ away.T - (one.normals @ x.T).max(axis=1)[:, None]
        turned = np.einsum("kab,fb->kfa", self.turns, one.normals)
        for f in np.flatnonzero(heights.min(axis=1) >= need - self.band):
            rows = near(heights[f])
            found.append(((turned[:, f] @ away[rows].T).T - self.shifts @ normals[f], heights[f, rows]))
        heights = two.normals @ moved.T - (two.normals @ p.T).max(axis=1)[:, None]
        for f in np.flatnonzero(heights.min(axis=1) >= need - self.band):
            rows = near(heights[f])
            found.append(((speeds[:, rows] @ two.normals[f]).T, heights[f, rows]))
        some = (sites[:, 0] == E1E2) & (gaps >= need - self.band)
        if some.any():
            rates = task.gap_rates(parts, q, sites[some], lines[some, :3]) / task.weights
            known = np.isfinite(rates).all(axis=1)
            found += [(J[None], np.array([g])) for J, g in zip(rates[known], gaps[some][known], strict=True)]
        if need > 0.0 and 0.0 < gaps.max() < need + self.band:  # corners: the distance is along no facet direction
            n = task.direction_between(parts, q)
            if (length := float(np.linalg.norm(n))) > 0.0:
                n = n / length
                heights = (p @ n).min() - moved @ n
                rows = near(heights)
                found.append((-(speeds[:, rows] @ n).T, heights[rows]))
        return found
