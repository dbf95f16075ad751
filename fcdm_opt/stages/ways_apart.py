"""Local descent for "touch" and "clear" over all ways in which part pairs may come apart near a motion.

A pair of convex parts is apart where one of its directions separates it: a choice. Near a motion each direction is
linear in the parameters, a row for each vertex that its plane may meet, and the least motion over all choices is found
best first, as `translations` does for motions in which the rows are linear everywhere. Unlike a program with the
directions of one motion, it does not stop where parts must come apart another way, or touch with another pair.
"""

from __future__ import annotations

import heapq
from itertools import count
from typing import NamedTuple

import numpy as np

from fcdm_opt.curve.kernels import E1E2
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.model.bounds import search_rate
from fcdm_opt.model.task import Answer, Parts, Task
from fcdm_opt.stages import compiled
from fcdm_opt.tolerances import DEFAULT

ROUNDS = 40  # linearisations, at most
RESTORED = 8  # of these in a row that only bring a motion back to where it does
NODES = 100  # choices looked at in one linearisation
SHRINK, GROW = 0.2, 2.0  # of the radius in which rows are taken as linear
SHORTEST = 1e-9  # radius, relative to the amount, at which to stop
STILL = 1e-11  # relative gain of a round that is none
FURTHER = 10.0  # times the first radius, from which on no motion is looked for where none was found
CLOSINGS = 6  # pairs that may be the one to touch, the nearest first


class Rows(NamedTuple):
    """Conditions normals . y >= levels on the weighted parameters, all to be met: (m, k), (m,)."""

    normals: Array
    levels: Array


class Choices(NamedTuple):
    """Of each of several groups one alternative is to be met: rows of all alternatives of all groups, in order.

    `alternatives` are their first rows, `groups` the first alternatives of the groups.
    """

    rows: Rows
    alternatives: Ints
    groups: Ints

    @classmethod
    def of(cls, groups: list[list[Rows]], count: int) -> Choices:
        """Return groups of alternatives in `count` parameters; none of them empty."""
        every = [rows for group in groups for rows in group]
        firsts = np.cumsum([0, *(len(rows.levels) for rows in every)])[:-1]
        starts = np.cumsum([0, *map(len, groups)])[:-1]
        together = (np.concatenate(own) for own in zip(*every, strict=True)) if every else None
        rows = Rows(np.empty((0, count)), np.empty(0)) if together is None else Rows(*together)
        return cls(rows, firsts.astype(np.int64), starts.astype(np.int64))

    def short(self, y: Array) -> Array:
        """Return by how much y misses each group's best alternative, (groups,); not positive where it meets it."""
        if not len(self.groups):
            return np.empty(0)
        of_rows = self.rows.levels - self.rows.normals @ y
        return np.asarray(np.minimum.reduceat(np.maximum.reduceat(of_rows, self.alternatives), self.groups))


def suits(task: Task) -> bool:
    """Tell whether a task asks for nothing but gaps of part pairs."""
    return not task.tracked and task.weighted and task.goal in ("touch", "clear")


def descended(task: Task, q: Array, radius: float) -> Answer | None:
    """Return the least motion that a descent from a motion finds; None where it finds none.

    Parameters
    ----------
    task : Task
        One that `suits`.
    q : (k,) array
        Where to begin; it need not do.
    radius : float
        Amount by which the first step may change it.
    """
    weights, most = task.weights, FURTHER * radius
    best: Array | None = None
    y = np.clip(np.asarray(q, dtype=np.float64), *task.limits.T) * weights
    least, restoring = np.inf, 0
    start = y
    for _ in range(ROUNDS):
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
    """Return the motion nearest to `centre` within a radius of y in which all linearised pairs are apart."""
    low, high = (np.maximum(y - radius, task.limits[:, 0] * task.weights), y + radius)
    high = np.minimum(high, task.limits[:, 1] * task.weights)
    sides = Rows(np.vstack([np.eye(len(y)), -np.eye(len(y))]), np.concatenate([low, -high]))
    nearby = _linearised(task, y, radius)
    if nearby is None:
        return None
    apart, closings = nearby
    best = _least(Choices.of(apart, len(y)), sides, centre, np.inf)
    if task.must_touch and best is not None:
        own = [Choices.of(closing, len(y)) for closing in closings]
        if not any(choices.short(best).max(initial=-np.inf) <= 0.0 for choices in own):
            best, length = None, np.inf
            for closing in closings:
                found = _least(Choices.of([*apart, *closing], len(y)), sides, centre, length)
                if found is not None:
                    best, length = found, float(np.linalg.norm(found - centre))
    return None if best is None else np.clip(best, low, high)


# ------------------------------------------------------------------------------------------------------- linear rows


def _linearised(task: Task, y: Array, radius: float) -> tuple[list[list[Rows]], list[list[list[Rows]]]] | None:
    """Return what a task asks within a radius of y, as groups of `Choices`; None where nothing there can do.

    First the pairs, with their ways apart; then, for each pair that may be the one to touch, the directions that must
    not keep it apart, with the vertices that may be the first to meet their planes.
    """
    q = y / task.weights
    pose, rates = task.motion.kinematics(task.movable.seed, task.static.seed).rates(q)
    if not (np.isfinite(pose).all() and np.isfinite(rates).all()):
        return None
    rates = rates / task.weights[:, None, None]
    band = 2.0 * search_rate(task) * radius * np.sqrt(len(y))
    seed, other = task.movable.seed, task.static.seed
    scene = _Scene(
        task,
        q,
        pose[:3, :3],
        pose[:3, :3] @ seed + pose[:3, 3] - other,
        rates[:, :3, :3],
        rates[:, :3, :3] @ seed + rates[:, :3, 3],
        band,
    )
    gaps, partners = task.pair_gaps(q), len(task.static.parts)
    groups: list[list[Rows]] = []
    for i, j in np.argwhere(gaps < task.needs + band).tolist():
        ways = scene.ways((i, j))
        if ways is None:
            continue
        if not ways:
            return None
        groups.append([Rows(J, task.needs[j] - g + J @ y) for J, g in ways])
    near = [parts for parts in np.ndindex(len(gaps), partners) if task.must_touch and gaps[parts] < band]
    closings = [
        [
            [Rows(-J[k : k + 1], g[k : k + 1] - J[k : k + 1] @ y) for k in range(len(g))]
            for J, g in scene.directions(parts)
            if g.min() > -band
        ]
        for parts in sorted(near, key=lambda own: float(gaps[own]))[:CLOSINGS]
    ]
    return groups, closings


class _Scene(NamedTuple):
    """A motion and its rates: R and seed of body 1 about s_2, derivatives by y; gaps within `band` matter."""

    task: Task
    q: Array
    R: Array
    offset: Array
    turns: Array
    shifts: Array
    band: float

    def ways(self, parts: Parts) -> list[tuple[Array, Array]] | None:
        """Return (gradients, separations) of each direction that may part a pair; None where nothing can join it."""
        need = self.task.opponents[parts[1]].need
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
        task, (i, j) = self.task, parts
        one, opponent = task.movable.parts[i], task.opponents[j]
        two, need = opponent.part, opponent.need
        x = task.target[0] * (one.vertices - one.seed)
        p = two.seed - task.static.seed + opponent.scale * (two.vertices - two.seed)
        moved = x @ self.R.T + self.offset
        speeds = np.einsum("kab,nb->kna", self.turns, x) + self.shifts[:, None]  # of the vertices of body 1
        away = p - self.offset
        found = []
        normals = one.normals @ self.R.T
        heights = normals @ away.T - (one.normals @ x.T).max(axis=1)[:, None]
        turned = np.einsum("kab,fb->kfa", self.turns, one.normals)
        for f in np.flatnonzero(heights.min(axis=1) >= need - self.band):
            rows = np.flatnonzero(heights[f] <= max(need, 0.0) + self.band)
            rows = rows if len(rows) else heights[f].argmin(keepdims=True)
            found.append(((turned[:, f] @ away[rows].T).T - self.shifts @ normals[f], heights[f, rows]))
        heights = two.normals @ moved.T - (two.normals @ p.T).max(axis=1)[:, None]
        for f in np.flatnonzero(heights.min(axis=1) >= need - self.band):
            rows = np.flatnonzero(heights[f] <= max(need, 0.0) + self.band)
            rows = rows if len(rows) else heights[f].argmin(keepdims=True)
            found.append(((speeds[:, rows] @ two.normals[f]).T, heights[f, rows]))
        sites, lines, gaps = task.separations(parts, task.pose(self.q))
        some = (sites[:, 0] == E1E2) & (gaps >= need - self.band)
        if some.any():
            a, b, n = one.edges[sites[some, 1], :2], two.edges[sites[some, 2], :2], lines[some, :3]
            own, other = x[a[:, 1]] - x[a[:, 0]], p[b[:, 1]] - p[b[:, 0]]
            across = np.cross(own @ self.R.T, other)
            sines = np.linalg.norm(across, axis=1)
            steep = sines > DEFAULT.tie * np.linalg.norm(own, axis=1) * np.linalg.norm(other, axis=1)  # not parallel
            some[some] = steep
            a, b, n, own, other = a[steep], b[steep], n[steep], own[steep], other[steep]
            signs = np.copysign(1.0 / sines[steep], (across[steep] * n).sum(axis=1))
            change = signs[:, None] * np.cross(np.einsum("kab,eb->kea", self.turns, own), other)
            change -= (change * n).sum(axis=2)[..., None] * n
            rates = (change * (p[b[:, 0]] - moved[a[:, 0]])).sum(axis=2) - (speeds[:, a[:, 0]] * n).sum(axis=2)
            found += [(J[None], np.array([g])) for J, g in zip(rates.T, gaps[some], strict=True)]
        if need > 0.0 and 0.0 < gaps.max() < need + self.band:  # corners: the distance is along no facet direction
            n = task.way_between(parts, self.q)
            if (length := float(np.linalg.norm(n))) > 0.0:
                n = n / length
                heights = (p @ n).min() - moved @ n
                rows = np.flatnonzero(heights <= need + self.band)
                rows = rows if len(rows) else heights.argmin(keepdims=True)
                found.append((-(speeds[:, rows] @ n).T, heights[rows]))
        return found


# ------------------------------------------------------------------------------------------------------------ choices


def _least(choices: Choices, sides: Rows, centre: Array, most: float) -> Array | None:
    """Return the y nearest to a point that meets `sides` and one alternative of every group, best first.

    None if there is none, or none nearer than `most`.
    """
    number, scale = count(), float(np.abs(sides.levels).max(initial=0.0)) + float(np.linalg.norm(centre))
    slack = DEFAULT.line * max(scale, DEFAULT.least_unit)
    heap: list[tuple[float, int, Array, Rows, dict[int, int]]] = []
    (normals, levels), firsts, groups = choices
    ends, lasts = np.append(firsts[1:], len(levels)), np.append(groups[1:], len(firsts))

    def push(rows: Rows, further: Rows, chosen: list[dict[int, int]]) -> None:
        """Add one node for each further row, those that can be met."""
        kept = np.flatnonzero((further.normals != 0.0).any(axis=1))
        found = compiled.least_distance(
            np.ascontiguousarray(rows.normals),
            rows.levels - rows.normals @ centre,
            -further.normals[kept],
            further.normals[kept] @ centre - further.levels[kept],
        )
        lengths = np.linalg.norm(found, axis=1)
        for k, x, length in zip(kept.tolist(), found, lengths.tolist(), strict=True):
            if length < most:  # nan where there is none
                own = Rows(np.vstack([rows.normals, further.normals[k]]), np.append(rows.levels, further.levels[k]))
                heapq.heappush(heap, (length, next(number), x + centre, own, chosen[k]))

    push(sides, Rows(sides.normals[:1], sides.levels[:1]), [{}])
    for _ in range(NODES):
        if not heap:
            return None
        _, _, y, rows, chosen = heapq.heappop(heap)
        if not len(groups):
            return y
        short = levels - normals @ y
        of_ways = np.maximum.reduceat(short, firsts)
        of_groups = np.minimum.reduceat(of_ways, groups)
        for group, way in chosen.items():
            of_groups[group] = of_ways[way]
        worst = int(of_groups.argmax())
        if of_groups[worst] <= slack:
            return y
        ways = [chosen[worst]] if worst in chosen else list(range(groups[worst], lasts[worst]))
        places = [int(firsts[way] + short[firsts[way] : ends[way]].argmax()) for way in ways]
        push(rows, Rows(normals[places], levels[places]), [{**chosen, worst: way} for way in ways])
    return None
