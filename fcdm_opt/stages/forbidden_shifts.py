"""What clearances forbid shifts: of two convex parts all that bring them nearer, a convex set with rounded edges.

A polytope within that set forbids no more than it does. Where a shift outside all polytopes still brings parts too
near, the point of the set's border ahead of it joins the polytope: so the least shift outside is found, and bounded.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.task import Parts, Task
from fcdm_opt.proof.least_distance import nearer_than
from fcdm_opt.stages.best_first import Rows
from fcdm_opt.tolerances import DEFAULT

SHARPENED = 60  # rounds in which polytopes are grown
POLISHED = 12  # last rounds of these, of planes that touch what is forbidden
MOST_DIFFERENCES = 40_000  # pairs of vertices of two parts that are kept apart by a distance


@dataclass(frozen=True, eq=False)
class ForbiddenShifts:
    """Polytopes within what clearances forbid the shifts of a task, and half-spaces outside of them, by part pair.

    The hull of `points`, (n, 3), is the polytope of a pair; `walls` are alternatives over the weighted parameters in
    sizes, one of which each allowed motion meets, None where parts are too large, or no shift leads out.
    """

    task: Task
    points: dict[Parts, Array] = field(default_factory=dict)
    walls: dict[Parts, Rows | None] = field(default_factory=dict)

    def further(self, q: Array, pairs: Collection[Parts], slopes: Array, remaining: int) -> bool:
        """Tell whether more is forbidden now: polytopes of pairs that a motion leaves too near grow.

        A point of the border that motions reach without changing rows over the weighted parameters, (m, k), that
        equations hold, joins a polytope, too. In the last rounds that remain polytopes are touched.
        """
        task, gaps, grown = self.task, self.task.pair_gaps(q), remaining < POLISHED
        slack = min(DEFAULT.nominal * task.unit, DEFAULT.cut * task.size)
        near = [] if grown else np.argwhere((task.needs > 0.0) & (gaps < task.needs)).tolist()
        for i, j in near:
            if (i, j) not in pairs or self.walls.get((i, j), ()) is None:
                continue
            normal, miss = self._missed((i, j), q)
            if miss > slack:
                self._grow((i, j), q, miss * normal, slopes)
                grown = True
        if grown and remaining <= POLISHED:
            self._touch(q)
        return grown

    def _touch(self, q: Array) -> None:
        """Forbid all but what is beyond planes between the pairs, as is needed: more than clearances forbid."""
        task = self.task
        for i, j in self.points:
            normal, miss = self._missed((i, j), q)
            slopes = -task.rates(q)[1][:, :3, 3] @ normal / task.weights
            self.walls[i, j] = Rows(slopes[None], (miss + slopes[None] @ (q * task.weights)) / task.size)

    def _missed(self, parts: Parts, q: Array) -> tuple[Array, float]:
        """Return the direction between two parts after a motion, (3,), and by how much they are too near."""
        normal = self.task.direction_between(parts, q)
        gap = self.task.pair_gaps(q, {parts: normal})[parts]
        return normal / np.linalg.norm(normal), float(self.task.needs[parts[1]] - gap)

    def _grow(self, parts: Parts, q: Array, missed: Array, slopes: Array) -> None:
        """Grow the polytope of a pair that is too near by as much as is `missed`, (3,)."""
        task = self.task
        shifts = task.rates(q)[1][:, :3, 3]
        points = self.points[parts] if parts in self.points else _nearer(task, parts)
        if points is None:
            self.walls[parts] = None
            return
        places = [q @ shifts - missed]
        apart = -shifts @ missed / task.weights
        ends = np.isclose(q, np.where(apart < 0.0, *task.limits.T), rtol=0.0, atol=DEFAULT.cut * task.size)
        held = np.vstack([np.eye(len(q))[ends], slopes])
        apart = apart - held.T @ np.linalg.lstsq(held.T, apart, rcond=DEFAULT.nominal)[0]
        along = apart / task.weights @ shifts
        if (length := float(np.linalg.norm(along))) > DEFAULT.nominal * np.linalg.norm(missed):
            along /= length
            moved, other = placed(task, parts)
            moved = moved + q @ shifts
            far = float(np.abs(other[:, None] - moved[None]).max()) * 2.0 + task.needs[parts[1]]
            place = nearer_than(task.needs[parts[1]], moved, other, along, -far, far, np.zeros((2, 3)))[1]
            places += [q @ shifts + place * along] if np.isfinite(place) else []
        points = self.points[parts] = np.vstack([points, *places])
        self.walls[parts] = _outside(task, points, shifts)


def placed(task: Task, parts: Parts) -> tuple[Array, Array]:
    """Return the vertices of two parts as made, at rest, about s_2."""
    one, obstacle, centre = task.movable.parts[parts[0]], task.obstacles[parts[1]], task.static.seed
    moved = task.target[0] * (one.vertices - task.movable.seed) + (task.movable.seed - centre)
    return moved, obstacle.placed(centre)


def _nearer(task: Task, parts: Parts) -> Array | None:
    """Return shifts, (n, 3), that bring two parts as near as may be: facets, corners moved out; None of large ones."""
    from scipy.spatial import ConvexHull

    moved, other = placed(task, parts)
    if len(moved) * len(other) > MOST_DIFFERENCES:
        return None
    differences = (other[:, None] - moved[None]).reshape(-1, 3)
    need = task.obstacles[parts[1]].need
    hull = ConvexHull(differences)
    outward, middles = hull.equations[:, :3], np.zeros_like(differences)
    np.add.at(middles, hull.simplices, outward[:, None])  # within a corner's normal cone
    middles[hull.vertices] /= np.linalg.norm(middles[hull.vertices], axis=1)[:, None]
    facets = differences[hull.simplices] + need * outward[:, None]
    return np.vstack([facets.reshape(-1, 3), (differences + need * middles)[hull.vertices]])


def _outside(task: Task, points: Array, shifts: Array) -> Rows | None:
    """Return the half-spaces outside the hull of points, (n, 3); None where no shift of the task crosses it."""
    from scipy.spatial import ConvexHull

    planes = ConvexHull(points).equations
    lines = planes[:, :3] @ shifts.T / task.weights
    flat = np.linalg.norm(lines, axis=1) <= DEFAULT.tie
    if (planes[flat, 3] >= -DEFAULT.cut * task.size).any():
        return None
    return Rows(lines[~flat], -planes[~flat, 3] / task.size)
