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
from fcdm_opt.model.bounds import displacement_bound, displacement_rate
from fcdm_opt.model.task import Answer, Parts, Task
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages import compiled
from fcdm_opt.stages.relaxation import choices
from fcdm_opt.tolerances import DEFAULT

# Nodes looked at, and directions of one of several pairs, before the task is left to stage 4. A single pair is done
# after one node for any number of directions: they are tried the nearest first.
MOST_NODES, MOST_WAYS = 2000, 200
MOST_DIFFERENCES = 4000  # pairs of vertices of two parts that are kept apart by a distance, for a bound
SPACE = 3  # dimensions
SHARPENED = 60  # rounds in which polytopes within what clearances forbid are grown
NOWHERE = 1e-9  # half-spaces exclude each other where their least motion is longer than its inverse, in sizes


class Wall(NamedTuple):
    """Half-spaces normals . x <= levels of the scaled parameters x, in each of which a part pair is apart as asked.

    `lengths` are their distances from zero, increasing.
    """

    normals: Array
    levels: Array
    lengths: Array

    @classmethod
    def of(cls, normals: Array, levels: Array) -> Wall:
        """Return half-spaces with the nearest first."""
        lengths = np.maximum(-levels / np.sqrt(np.einsum("ij,ij->i", normals, normals)), 0.0)
        order = np.argsort(lengths, kind="stable")
        return cls(normals[order], levels[order], lengths[order])


class Branch(NamedTuple):
    """The half-spaces of a wall from `first` on, `many` to be tried next among the x with G x >= h."""

    G: Array
    h: Array
    wall: Wall
    pairs: tuple[Parts, ...]
    first: int = 0
    many: int = 1


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
    if task.part_pairs > 1 and max((len(wall.levels) for wall in walls.values()), default=0) > MOST_WAYS:
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


def bound_below(task: Task, most: float) -> float:
    """Return an amount that no shift stays below which keeps clearances as distances.

    The shifts that bring two parts nearer than c fill their Minkowski difference and what is nearer to it than c: a
    convex set. A polytope within it forbids no more than it does; where the least shift outside all polytopes still
    brings parts nearer than c, the point of the set's border ahead of it joins the polytope, and it is sought anew.
    """
    reach, walls, forbidden = most * displacement_rate(task), _walls(task), dict[Parts, Array]()
    gaps, shifts, closings = task.pair_gaps(task.rest), _shifts(task), _closings(task)
    for parts in list(walls):
        if (need := task.opponents[parts[1]].need) > 0:
            points = _nearer(task, parts) if gaps[parts] < need + reach else None
            wall = None if points is None else _outside(task, points, shifts)
            if points is None or wall is None:
                del walls[parts]
            else:
                forbidden[parts], walls[parts] = points, wall
    bound, slack = 0.0, DEFAULT.nominal * most
    for _ in range(SHARPENED):
        found = _least(task, walls, closings)
        if found is None or found[0] is None:
            break
        bound, q = float(np.linalg.norm(found[0])) * task.size, found[0] * task.size / task.weights
        gaps, sharper = task.pair_gaps(q), []
        for parts in walls.keys() & forbidden.keys() if bound < most - slack else ():
            need = task.opponents[parts[1]].need
            if not 0.0 < gaps[parts] < need:
                continue
            way = task.way_between(parts, q)
            miss = need - task.pair_gaps(q, {parts: way})[parts]
            if miss > slack:
                ahead = q @ shifts - miss * way / np.linalg.norm(way)
                forbidden[parts] = np.vstack([forbidden[parts], ahead])
                sharper.append(parts)
        if not sharper:
            break
        for parts in sharper:
            wall = _outside(task, forbidden[parts], shifts)
            assert wall is not None  # as before: the polytope has only grown
            walls[parts] = wall
    return bound


def _nearer(task: Task, parts: Parts) -> Array | None:
    """Return shifts that bring two parts nearer than they may be, or just: facets and corners moved out, (n, 3).

    None where the parts are too large.
    """
    one, opponent = task.movable.parts[parts[0]], task.opponents[parts[1]]
    if len(one.vertices) * len(opponent.part.vertices) > MOST_DIFFERENCES:
        return None
    moved = task.movable.seed + task.target[0] * (one.vertices - task.movable.seed)
    other = opponent.part.seed + opponent.scale * (opponent.part.vertices - opponent.part.seed)
    differences = (other[:, None] - moved[None]).reshape(-1, 3)
    _, rows, separations = task.separations(parts, task.pose(task.rest))
    outward = -rows[:, :3]
    on = differences @ outward.T >= -separations - DEFAULT.tie * task.size
    corners = np.flatnonzero(on.sum(axis=1) >= SPACE)
    middles = on[corners] @ outward
    middles /= np.linalg.norm(middles, axis=1)[:, None]
    facets, points = np.nonzero(on.T)
    return np.vstack(
        [differences[points] + opponent.need * outward[facets], differences[corners] + opponent.need * middles]
    )


def _outside(task: Task, points: Array, shifts: Array) -> Wall | None:
    """Return the half-spaces outside the hull of points, (n, 3); None where no shift of the task crosses it."""
    from scipy.spatial import ConvexHull

    planes = ConvexHull(points).equations
    lines = -planes[:, :3] @ shifts.T / task.weights
    flat = np.linalg.norm(lines, axis=1) <= DEFAULT.tie
    if (planes[flat, 3] >= -DEFAULT.cut * task.size).any():
        return None
    return Wall.of(lines[~flat], planes[~flat, 3] / task.size)


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
                found[parts] = Wall.of(normals[~flat], levels[~flat])
    return found


def _closings(task: Task) -> list[tuple[Parts | None, Array, Array]]:
    """Return for each pair that may be the one to touch the half-spaces G x >= h in which it does not stay apart.

    A single pair that overlaps at rest touches as soon as it is not overlapping: it needs none.
    """
    if not task.must_touch:
        return [(None, np.empty((0, len(task.weights))), np.empty(0))]
    closings: list[tuple[Parts | None, Array, Array]] = []
    for parts in np.ndindex(len(task.movable.parts), len(task.static.parts)):
        normals, separations = _lines(task, parts)
        flat = np.linalg.norm(normals, axis=1) <= DEFAULT.tie
        if task.part_pairs == 1 and separations.max() <= 0.0 and task.allows(task.rest):
            closings.append((parts, normals[:0], separations[:0]))
        elif (separations[flat] <= DEFAULT.cut).all():
            closings.append((parts, normals[~flat], separations[~flat]))
    return closings


def _lines(task: Task, parts: Parts) -> tuple[Array, Array]:
    """Return a pair's directions as rows over the scaled parameters, and separations at rest, in sizes.

    Where there are several pairs each direction once: all ways of one pair are combined with those of the others.
    """
    _, rows, separations = task.separations(parts, task.pose(task.rest))
    lines = np.column_stack([rows[:, :3] @ _shifts(task).T / task.weights, separations / task.size])
    if task.part_pairs == 1:
        return lines[:, :-1], lines[:, -1]
    _, first = np.unique(np.round(lines / DEFAULT.tie), axis=0, return_index=True)
    return lines[first, :-1], lines[first, -1]


def _shifts(task: Task) -> Array:
    """Return what each parameter shifts, (k, 3)."""
    return np.array([(task.transform(step) - task.transform(task.rest))[:3, 3] for step in np.eye(len(task.weights))])


def _least(
    task: Task, walls: dict[Parts, Wall], closings: list[tuple[Parts | None, Array, Array]]
) -> tuple[Array | None, list[Parts], int] | None:
    """Return the least x that no wall forbids, or None; the pairs that decide, and the rows besides the limits.

    None alone where too many nodes were looked at.
    """
    box = _limits(task)
    number = count()
    heap: list[tuple[float, int, Branch | tuple[Array, Branch, Array, float]]] = []

    def push(branch: Branch, least: float) -> None:
        """Add what is left of a branch, all of it at least that far off."""
        if branch.first < len(branch.wall.lengths):
            least = max(least, float(branch.wall.lengths[branch.first]))
            heapq.heappush(heap, (least, next(number), branch))

    everywhere = Wall.of(np.eye(1, len(task.weights)), np.array([1.0 / NOWHERE]))
    for closing, G, h in closings:
        sides = np.vstack([box[0], G]), np.concatenate([box[1], h])
        push(Branch(*sides, everywhere, () if closing is None else (closing,)), 0.0)
    nodes = 0
    while heap and nodes < MOST_NODES:
        length, _, item = heapq.heappop(heap)
        if isinstance(item, Branch):  # the next half-spaces of a wall
            some = slice(item.first, item.first + item.many)
            normals, levels = item.wall.normals[some], item.wall.levels[some]
            found = compiled.least_distance(item.G, item.h, normals, levels)
            lengths = np.linalg.norm(found, axis=1).tolist()
            for x, own, normal, level in zip(found, lengths, normals, levels, strict=True):
                if own < 1.0 / NOWHERE:  # nan where there is none
                    heapq.heappush(heap, (own, next(number), (x, item, normal, level)))
            push(item._replace(first=some.stop, many=2 * item.many), length)
            continue
        nodes += 1
        x, branch, normal, level = item
        G, h = np.vstack([branch.G, -normal]), np.append(branch.h, -level)
        gaps = {parts: float((wall.levels - wall.normals @ x).max()) for parts, wall in walls.items()}
        worst = min(gaps, key=gaps.__getitem__, default=None)
        if worst is None or gaps[worst] >= -DEFAULT.cut:
            return x, sorted(set(branch.pairs)), len(h) - len(box[1]) - 1  # of which one forbids nothing
        push(Branch(G, h, walls[worst], (*branch.pairs, worst)), length)
    return None if heap else (None, [], 0)


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
