"""Stage 1 for "touch" and "clear" along several translations: best first over the ways in which part pairs come apart.

While nothing turns, the separation of a part pair along each of its facet directions is linear in the parameters, and
the pair is apart where one of them is positive: a branching over half-spaces, with a least distance problem in each
node. The first node in which no pair overlaps is the smallest motion of all; where none is left, there is no motion.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from itertools import count
from typing import NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerance.bounds import displacement_bound
from fcdm_opt.tolerance.solution import Status
from fcdm_opt.tolerance.stages import compiled
from fcdm_opt.tolerance.stages.relaxation import choices
from fcdm_opt.tolerance.task import Answer, Parts, Task
from fcdm_opt.tolerances import DEFAULT

MOST_NODES, MOST_WAYS = 2000, 200  # nodes looked at, and directions of one pair, before the task is left to stage 4
NOWHERE = 1e-9  # half-spaces exclude each other where their least motion is longer than its inverse, in sizes


class Wall(NamedTuple):
    """Half-spaces normals . x <= levels of the scaled parameters x, in each of which a part pair is apart as asked."""

    normals: Array
    levels: Array


def translations(task: Task) -> Answer | None:
    """Find the smallest shift that undoes all overlaps, and touches where that is asked; exact.

    A clearance between corners is a distance that is not linear. Where the smallest shift without the keep-outs'
    clearances keeps them too it is the answer; else the shift found keeps them along facet directions, is improved by
    the nonlinear program, and nothing is proved.
    """
    if task.tracked or len(task.weights) < 2 or not task.motion.shifts:
        return None
    if task.need <= 0 < task.needs.max():
        answer = translations(task.bare)
        if answer is not None and (answer.q is None or task.meets(answer.q, DEFAULT.requirement)):
            return answer
    walls, closings = _walls(task), _closings(task)
    if max((len(wall.levels) for wall in walls.values()), default=0) > MOST_WAYS:
        return None
    stage, exact = "1: translations, best first over the ways apart", not task.needs.max() > 0
    found = _least(task, walls, closings)
    if found is None:
        return None
    x, pairs, rows = found
    if x is None:
        return Answer(Status.INFEASIBLE, None, stage, np.inf) if exact else None
    q = np.clip(x * task.size / task.weights, *task.limits.T)
    if not task.meets(q, DEFAULT.requirement):
        return None
    names = tuple(dict.fromkeys(task.named(parts) for parts in pairs))
    closing = {parts: len(levels) for parts, _, levels in closings if parts is not None}
    ways = [max(len(walls[parts].levels) if parts in walls else 0, closing.get(parts, 0)) for parts in pairs]
    counts = task.modelled(pairs, variables=len(q), constraints=rows, features=sum(ways))
    answer = Answer(Status.SOLVED, q, stage, task.amount(q), names, counts)
    return answer if exact else _improved(task, answer)


def _improved(task: Task, answer: Answer) -> Answer:
    """Return an answer that keeps clearances as distances, not only along facet directions."""
    assert answer.q is not None
    best, active, modelled = answer.q, answer.active, answer.modelled
    for relaxation in choices(task, answer.q, near=True):
        found = relaxation.smallest([best], "sqpmethod", task.amount(best))
        if found is not None and found.amount < task.amount(best) * (1.0 - DEFAULT.nominal):
            best, active, modelled = found.q, found.active, found.modelled
    bound = min(displacement_bound(task), task.amount(best))
    return Answer(Status.SOLVED, best, answer.stage + ", nonlinear program", bound, active, modelled)


def _walls(task: Task) -> dict[Parts, Wall]:
    """Return the ways apart of each part pair that some motion brings in each other's way."""
    found = {}
    for parts in np.ndindex(len(task.movable.parts), len(task.opponents)):
        need = task.opponents[parts[1]].need
        if np.isfinite(need):
            normals, separations = _lines(task, parts)
            flat = np.linalg.norm(normals, axis=1) <= DEFAULT.tie
            levels = separations - need / task.size
            if not (levels[flat] >= -DEFAULT.cut).any():
                found[parts] = Wall(normals[~flat], levels[~flat])
    return found


def _closings(task: Task) -> list[tuple[Parts | None, Array, Array]]:
    """Return for each pair that may be the one to touch the half-spaces G x >= h in which it does not stay apart."""
    if not task.must_touch:
        return [(None, np.empty((0, len(task.weights))), np.empty(0))]
    closings: list[tuple[Parts | None, Array, Array]] = []
    for parts in np.ndindex(len(task.movable.parts), len(task.static.parts)):
        normals, separations = _lines(task, parts)
        flat = np.linalg.norm(normals, axis=1) <= DEFAULT.tie
        if (separations[flat] <= DEFAULT.cut).all():
            closings.append((parts, normals[~flat], separations[~flat]))
    return closings


def _lines(task: Task, parts: Parts) -> tuple[Array, Array]:
    """Return a pair's distinct directions as rows over the scaled parameters, and separations at rest, in sizes."""
    shifts = np.array([(task.transform(step) - task.transform(task.rest))[:3, 3] for step in np.eye(len(task.weights))])
    _, rows, separations = task.separations(parts, task.pose(task.rest))
    lines = np.column_stack([rows[:, :3] @ shifts.T / task.weights, separations / task.size])
    _, first = np.unique(np.round(lines / DEFAULT.tie), axis=0, return_index=True)
    return lines[first, :-1], lines[first, -1]


def _least(
    task: Task, walls: dict[Parts, Wall], closings: list[tuple[Parts | None, Array, Array]]
) -> tuple[Array | None, list[Parts], int] | None:
    """Return the least x that no wall forbids, or None; the pairs that decide, and the rows besides the limits.

    None alone where too many nodes were looked at.
    """
    box = _limits(task)
    number = count()
    heap: list[tuple[float, int, Array, Array, Array, tuple[Parts, ...]]] = []

    def push(G: Array, h: Array, wall: Wall, pairs: tuple[Parts, ...]) -> None:
        """Add the least x of each half-space of a wall, among those that G x >= h leaves."""
        found = compiled.least_distance(G, h, *wall)
        for x, length, normal, level in zip(found, np.linalg.norm(found, axis=1).tolist(), *wall, strict=True):
            if length < 1.0 / NOWHERE:  # nan where there is none
                heapq.heappush(heap, (length, next(number), x, np.vstack([G, -normal]), np.append(h, -level), pairs))

    everywhere = Wall(np.eye(1, len(task.weights)), np.array([1.0 / NOWHERE]))
    for closing, G, h in closings:
        sides = np.vstack([box[0], G]), np.concatenate([box[1], h])
        push(*sides, everywhere, () if closing is None else (closing,))
    for _ in range(MOST_NODES):
        if not heap:
            return None, [], 0
        _, _, x, G, h, pairs = heapq.heappop(heap)
        gaps = {parts: float((wall.levels - wall.normals @ x).max()) for parts, wall in walls.items()}
        worst = min(gaps, key=gaps.__getitem__, default=None)
        if worst is None or gaps[worst] >= -DEFAULT.cut:
            return x, sorted(set(pairs)), len(h) - len(box[1]) - 1  # of which one forbids nothing
        push(G, h, walls[worst], (*pairs, worst))
    return None


def _limits(task: Task) -> tuple[Array, Array]:
    """Return the limits as half-spaces G x >= h."""
    rows = list(_sides(task))
    G = np.array([row for row, _ in rows]).reshape(-1, len(task.weights))
    return G, np.array([level for _, level in rows])


def _sides(task: Task) -> Iterator[tuple[Array, float]]:
    for k, (low, high) in enumerate(task.limits):
        for sign, end in ((1.0, low), (-1.0, -high)):
            if np.isfinite(end):
                yield sign * np.eye(len(task.weights))[k], float(end * task.weights[k] / task.size)
