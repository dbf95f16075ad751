"""Stage 3 for "touch" and "clear": where all translations are free, a search over the rotations alone, with proof.

A motion of three independent translations and rotations about the moved seed: for fixed rotations the smallest
translation is known, from the nearest points of parts that are apart and from the shallowest direction of parts that
overlap. So cells of rotations are cut, each with a lower bound to second order in its size (`turned_cells`), until none
is left below the best known motion.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.motion.instructions import pose_instructions
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages import rays, turned_cells
from fcdm_opt.tolerances import DEFAULT

SPACE = 3  # dimensions
MOST_CELLS, WORK = 400_000, 4_000_000  # cells looked at, and times pairs of parts, at most: some 20 seconds
SAME = 1e-14  # columns of a translation's matrix this near to orthogonal and equal are so but for rounding
FINE, PROVED = 1e-9, 1e-7  # gap that the stage asks for, and the one with which it claims the smallest motion
SHORT = 0.05  # share of these cells for it: about a second


class Bound(NamedTuple):
    """What a search over rotations found.

    `lower` bounds the amount of every motion that meets the goal; `upper` is that of the best known motion, q (None
    where the solver's is the best, or none is known); closed tells whether they are as near as was asked.
    """

    lower: float
    upper: float
    q: Array | None
    closed: bool


def least_over_turns(task: Task, *, upper: Answer | None, gap: float, share: float = 1.0) -> Bound | None:
    """Bound the amount of a task from below, by cutting its rotations into cells; None where the task is not its own.

    Limits on translations, keep-outs, and parts of unions that the motion brings in each other's way are left out:
    the bound holds without them, but may not meet the answer then, which `upper` has to bring. It ends at a relative
    `gap` between both, or after its share of `MOST_CELLS` and `WORK`, alike on any machine.
    """
    search = _TurnSearch.of(task)
    return None if search is None else search.least(upper, gap, share)


def turns(task: Task) -> Answer | None:
    """Stage 3: one rotation searched, translations exact; where the smallest motion is proved to be so."""
    search = _TurnSearch.of(task)
    if search is None or len(search.rotations) > 1 or not search.plain:
        return None
    bound = search.least(None, FINE, SHORT)
    if bound.q is None or bound.lower < bound.upper * (1.0 - PROVED) or not task.meets(bound.q, DEFAULT.requirement):
        return None
    stage, names = "3: rotations searched, translations exact", ("the nearest contact over all rotations",)
    kept = [(i, j) for i, j in (*search.near(bound.upper).tolist(), *search.apart.tolist())]
    return Answer(Status.SOLVED, bound.q, stage, bound.lower, names, task.modelled_by_gaps(bound.q, kept))


class _TurnSearch:
    """The scene as the kernels take it, and the loop over generations of cells."""

    # `plain`: the smallest translation for fixed rotations is known exactly, so that cells give motions too
    @classmethod
    def of(cls, task: Task) -> _TurnSearch | None:
        """Return it of a motion of three translations and rotations; None for other motions and goals."""
        if task.tracked or task.goal not in ("touch", "clear") or not task.weighted:
            return None
        motion = task.motion
        moves = [(k, own) for k, own in enumerate(motion.shift_directions) if own is not None]
        spins = np.flatnonzero(motion.turning)
        vector = any(len(step.own_parameters) > 1 for step in motion.steps)
        if not motion.about_seed or (vector and len(motion.steps) > 1):
            return None
        if len(moves) != SPACE or not 1 <= len(spins) <= SPACE:
            return None
        translations, directions = (np.array(own) for own in zip(*moves, strict=True))
        if abs(np.linalg.det(directions)) <= DEFAULT.nominal:
            return None
        return cls(task, translations, spins, directions.T, vector=vector)

    def __init__(self, task: Task, translations: Ints, rotations: Ints, directions: Array, *, vector: bool) -> None:
        self.task, self.translations, self.rotations = task, translations, rotations
        metric = directions / task.weights[translations]
        square = metric.T @ metric
        even = bool(np.abs(square - square[0, 0] * np.eye(3)).max() <= SAME * square[0, 0])
        spectral = float(np.linalg.norm(metric, 2)) * (1.0 + SAME)
        exact = even or task.need <= 0
        if not exact:  # the least way to a distance is along no face's normal: |y| is at least the length over the norm
            metric, even = spectral * np.eye(3), True
        self.metric, offset = metric, task.pose(task.rest)[9:]
        self.one = rays.stacked([_tables(part, float(task.target[0]), None) for part in task.movable.parts])
        others, seed = task.obstacles[: len(task.static.parts)], task.static.seed
        self.two = rays.stacked([_tables(own.part, own.scale, offset + own.part.seed - seed) for own in others])
        self.touching, self.apart = self._pairs()
        at_will = not np.isfinite(task.limits[translations]).any() and task.allows(task.rest)
        single = not task.keep_out and (len(self.apart) == 0 or task.part_pairs == 1)
        self.plain = exact and at_will and single
        self.weights = np.ones(3)
        self.weights[: len(rotations)] = task.weights[rotations]
        circumradius = float(np.linalg.norm(self.one[0], axis=1).max())
        size = circumradius + float(np.linalg.norm(self.two[0], axis=1).max())
        program = pose_instructions(task.motion)
        assert program is not None
        kind = program.scaled(1.0 / task.weights, task.movable.seed, task.static.seed), rotations, vector, self.weights
        space = metric.ravel(), np.linalg.inv(metric).ravel()
        pad = turned_cells.ROUNDING * size
        numbers = (not even, spectral, task.need / spectral, pad, circumradius / spectral, self.plain)
        self._advance = partial(turned_cells.advance, self.one, self.two, self.apart, kind, space, numbers)

    def _pairs(self) -> tuple[Ints, Ints]:
        """Return the pairs one of which must touch, and those that must come apart, see `turned_cells.advance`."""
        gaps = self.task.pair_gaps(self.task.rest)[:, : len(self.task.static.parts)]
        apart = np.ascontiguousarray(np.argwhere(gaps < self.task.need))  # one layout, so that kernels compile once
        none = np.empty((0, 2), np.int64)
        if self.task.must_touch and gaps.min() > 0:
            return np.ascontiguousarray(np.argwhere(gaps > 0)), none
        return none, apart

    def least(self, upper: Answer | None, gap: float, share: float) -> Bound:
        """Cut cells until none is left below the best motion known, or a share of those allowed is looked at."""
        task, best = self.task, np.full(7, np.inf)
        if upper is not None and upper.q is not None:
            best[0] = task.amount(upper.q)
        if not len(self.touching) and not len(self.apart):
            return Bound(0.0, float(best[0]), None, bool(best[0] == 0))
        pool = self._separating_features()
        ranges, cells = np.array([[0, len(pool)]]), 0
        self._advance(self.touching, np.zeros((1, 7)), ranges, pool, best, gap)  # a cell of no size: what it tries
        touching = self.near(float(best[0]))
        most = share * min(MOST_CELLS, WORK / max(1, len(touching) + len(self.apart)))
        nodes = self._root(float(best[0]))
        while len(nodes) and cells + len(nodes) <= most and not pacing.over():
            cells += len(nodes)
            nodes, ranges, pool = self._advance(touching, nodes, ranges, pool, best, gap)
        q = self._motion(best)
        least = float(best[0]) if q is None else task.amount(q)
        lower = min(float(nodes[:, 0].min(initial=np.inf)), (1.0 - gap) * float(best[0]), least)
        return Bound(lower, least, q, not len(nodes))

    def _separating_features(self) -> Ints:
        """Return every direction in which a pair may come apart, pair by pair, those of faces first: see `advance`."""
        made = [np.empty((0, 4), np.int64)]
        for k, (i, j) in enumerate(self.apart.tolist()):
            (_, f, e), (_, g, d) = (np.diff(body[4], axis=0)[own] for body, own in ((self.one, i), (self.two, j)))
            kinds = turned_cells.FACE_1, turned_cells.FACE_2, turned_cells.EDGES, turned_cells.EDGES_BACK
            for kind, a, b in zip(kinds, (f, 1, e, e), (1, g, d, d), strict=True):
                own = np.arange(a * b)
                made.append(np.column_stack([np.full_like(own, k), np.full_like(own, kind), own // b, own % b]))
        return np.concatenate(made)

    def near(self, most: float) -> Ints:
        """Return the pairs that may touch after a motion of at most this amount: no vertex moves further than that."""
        gaps = self.task.pair_gaps(self.task.rest)[tuple(self.touching.T)]
        return np.ascontiguousarray(self.touching[gaps <= most * self.task.displacement_rate * (1.0 + DEFAULT.nominal)])

    def _root(self, most: float) -> Array:
        """Return the cell of all rotations that may be the answer's."""
        # none of a larger amount than the best known; none of more than half a turn, if all are allowed
        count, limits = len(self.rotations), self.task.limits[self.rotations]
        ends = np.full(3, most)
        if not np.isfinite(limits).any():
            ends = np.minimum(ends, np.pi * self.weights)
        else:  # a whole turn further on is as good
            nearest = np.maximum(np.maximum(limits[:, 0], -limits[:, 1]), 0.0)
            ends[:count] = np.minimum(ends[:count], (2.0 * np.pi + nearest) * self.weights[:count])
        low, high = np.zeros((2, 3))
        low[:count] = np.maximum(limits[:, 0] * self.weights[:count], -ends[:count])
        high[:count] = np.minimum(limits[:, 1] * self.weights[:count], ends[:count])
        if (low > high).any():
            return np.empty((0, 7))
        return np.concatenate([[0.0], (low + high) / 2, (high - low) / 2])[None]

    def _motion(self, best: Array) -> Array | None:
        """Return the best motion found as parameters; one that undoes an overlap by the least of all directions."""
        if not np.isfinite(best[1]):
            return None
        task, q, y = self.task, self.task.rest, best[4:]
        q[self.rotations] = best[1 : 1 + len(self.rotations)] / task.weights[self.rotations]
        if len(self.apart):
            _, rows, gaps = task.separations((0, 0), task.pose(q))
            normals = rows[:, :3] @ self.metric
            depths = (task.need - gaps) / np.linalg.norm(normals, axis=1)
            k = int(depths.argmin())
            if gaps[k] <= 0:
                y = -max(float(depths[k]), 0.0) / np.linalg.norm(normals[k]) * normals[k]
        q[self.translations] = y / task.weights[self.translations]
        return q


def _tables(part: ConvexPart, scale: float, offset: Array | None) -> tuple[Array, Array, Array, Ints]:
    """Return points, normals, edges and ends of a part of body 1 or, with its offset, of body 2 (`turned_cells`)."""
    reals, ints = part.packed
    n, f = int(ints[0]), int(ints[1])
    points, outward, errors = scale * reals[:n, :3], reals[n : n + f, :3], reals[n : n + f, 3]
    normals = outward
    if offset is not None:
        points, normals = points + offset, -outward
    along = points[part.edges[:, 1]] - points[part.edges[:, 0]]
    along /= np.linalg.norm(along, axis=1)[:, None]
    sides = normals[part.edges[:, 2:]]
    middles = sides.sum(axis=1)
    middles /= np.linalg.norm(middles, axis=1)[:, None]
    chords = np.linalg.norm(sides - middles[:, None], axis=2).max(axis=1)
    chords += 2.0 * errors[part.edges[:, 2:]].max(axis=1) + turned_cells.ROUNDING
    table = np.column_stack([along, middles, chords])
    return points, np.column_stack([normals, errors]), table, part.edges[:, [0, 2, 3]]
