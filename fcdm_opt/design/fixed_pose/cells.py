"""Branch and bound over cells of poses: boxes of motion parameters, each halved until it holds nothing better.

A cell is known by the enclosure of its poses, of first order: everything linear in its parameters is kept, the rest
bounded. Of its bound keeps a record what proves it, see `gaps.cell_bound`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from fcdm_opt.design.fixed_pose import gaps as kernels
from fcdm_opt.design.fixed_pose.local_search import Found, found_at
from fcdm_opt.design.fixed_pose.worst import Worst
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.proof.enclosure import Enclosure, enclosed_pose

BATCH = 64  # cells looked at together
NEGLIGIBLE = 1e-9  # shares of a mixture that are left out
RAW = 0.05  # of how far a parameter moves points, besides what it costs the bound, in the choice of what to halve
MUCH = 1e-3  # relative gain at a cell's centre from which on a search for the best pose near it is worth its time


class Witnesses(NamedTuple):
    """A mixture that proves a bound of a cell: kinds and shares (w,), part pairs and sizes (w, 2), directions.

    For kinds and directions see `gaps.cell_bound`; the part pair is -1, -1 where all gaps exceed the window.
    """

    kinds: Ints
    shares: Array
    parts: Ints
    sizes: Array
    ways: tuple[Array, ...]


@dataclass(eq=False)
class Node:
    """A cell, its bound and what proves it; `axis` is that along which it was halved, -1 for a leaf."""

    low: Array
    high: Array
    bound: float = -np.inf
    witnesses: Witnesses | None = None
    split: int = 0
    axis: int = -1
    children: tuple[int, int] | None = None


@dataclass(eq=False)
class Search:
    """Cells of poses, and the best pose known.

    Attributes
    ----------
    worst : Worst
    limits : (k, 2) array
        All finite.
    best : Found
    slack : float
        A pose is in the window whose worst gap is off by no more.
    amounts : bool
        Whether the smallest amount in the window is looked for; else the pose whose worst gap is off least.
    improve : callable
        Given a pose, returns one near it that is as good as those about it.
    """

    worst: Worst
    limits: Array
    best: Found
    slack: float
    amounts: bool
    improve: Callable[[Array], Found]
    nodes: list[Node] = field(default_factory=list)

    @property
    def value(self) -> float:
        """What is made small, of the best pose known."""
        return self.best.amount if self.amounts else self.best.off.value

    @property
    def lower(self) -> float:
        """What no pose has less of: by the leaves."""
        leaves = [node.bound for node in self.nodes if node.axis < 0]
        return max(min(min(leaves, default=np.inf), self.value), 0.0 if self.amounts else self.worst.floor)

    def run(self, *, accuracy: float, near: float, most: int, settled: Callable[[], bool] = lambda: False) -> None:
        """Halve cells until no pose is better than the best by `accuracy`, or there are `most` cells.

        Parameters
        ----------
        accuracy : float
            Relative.
        near : float
            Values this near to each other are equal.
        most : int
        settled : callable
            Ends the search early.
        """
        heap = list[tuple[float, int]]()
        self._add([self.limits], heap)
        while heap and len(self.nodes) < most and not settled():
            enough = self.value - max(accuracy * abs(self.value), near)
            if max(heap[0][0], self.worst.floor if not self.amounts else 0.0) >= enough:
                break
            boxes: list[Array] = []
            while heap and len(boxes) < BATCH and heap[0][0] < enough:
                _, k = heappop(heap)
                node = self.nodes[k]
                middle = 0.5 * node.low[node.split] + 0.5 * node.high[node.split]
                if not node.low[node.split] < middle < node.high[node.split]:
                    continue  # as small as digits allow
                node.axis = node.split
                node.children = (len(self.nodes) + len(boxes), len(self.nodes) + len(boxes) + 1)
                box = np.column_stack([node.low, node.high])
                for side in (0, 1):
                    half = box.copy()
                    half[node.split, 1 - side] = middle
                    boxes.append(half)
            if boxes:
                self._add(boxes, heap)

    def _add(self, boxes: list[Array], heap: list[tuple[float, int]]) -> None:
        low, high = (np.array([box[:, side] for box in boxes]) for side in (0, 1))
        for a, b, T in zip(low, high, enclosures(self.worst, low, high), strict=True):
            node = Node(a, b)
            self._look_at(node, T)
            heappush(heap, (node.bound, len(self.nodes)))
            self.nodes.append(node)

    def _look_at(self, node: Node, T: Array) -> None:
        worst, scene, slopes = self.worst, self.worst.scene, T[:, 1:-1]
        moved = np.abs(slopes[9:]).sum(axis=0) + scene.reach * np.abs(slopes[:9]).sum(axis=0)
        rows = scene.rows(np.ascontiguousarray(T[:, 0]), float(moved.sum()))
        bound, value, shares, kinds, ways, scores = kernels.cell_bound(
            *(scene.vertices[0], scene.starts[0], scene.vertices[1], scene.starts[1]),
            *(rows.rows, rows.first, rows.pairs, rows.along),
            *(np.ascontiguousarray(T.T), worst.active, worst.low, worst.high),
        )
        if not np.isfinite(bound):
            bound = -np.inf
        chosen = np.flatnonzero(shares > NEGLIGIBLE)
        parts = np.full((len(chosen), 2), -1)
        kind, place, size = kinds[chosen].T
        short = kind != kernels.DIRECTED
        parts[short] = rows.pairs[place[short]]
        directions = tuple(np.empty((0, 3)) if own else ways[s] for own, s in zip(short, size, strict=True))
        node.witnesses = Witnesses(kind, shares[chosen], parts, worst.active[size], directions)
        width = node.high - node.low
        if self.amounts:
            # beyond rounding off the window; else what the cell may hold counts by its amount
            sure = bound > 2.0 * self.slack
            node.bound = np.inf if sure else worst.amount(np.maximum(np.maximum(node.low, -node.high), 0.0))
            if not sure:
                node.witnesses = None
            node.split = int(np.argmax(worst.problem.weights * width))
        else:
            node.bound = bound
            scores = np.where(np.isfinite(scores), scores, 0.0) + RAW * moved + self._bent(T, width)
            node.split = int(np.argmax(np.where(width > 0, scores, -1.0)))
        promising = value <= self.slack if self.amounts else value < self.best.off.value
        if promising and len(worst.active):
            self._try(0.5 * node.low + 0.5 * node.high)

    def _bent(self, T: Array, width: Array) -> Array:
        """Return how much each parameter adds to what the linear part of the poses leaves out: turns do."""
        scene = self.worst.scene
        error = scene.reach * T[:9, -1].sum() + T[9:, -1].sum()
        turns = np.where(self.worst.problem.motion.turning, width**2, 0.0)
        if not (error < np.inf and turns.any()):
            return turns
        return np.asarray(error * turns / turns.sum())

    def _try(self, q: Array) -> None:
        """Take a cell's centre as the best pose if it is, and improve it."""
        found = found_at(self.worst, q)
        if self._beats(found):
            much = self.value - (found.amount if self.amounts else found.off.value) > MUCH * abs(self.value)
            self.best = found
            if much:
                improved = self.improve(q)
                if self._beats(improved):
                    self.best = improved

    def _beats(self, found: Found) -> bool:
        if self.amounts:
            return found.off.value <= self.slack and found.amount < self.best.amount
        return found.off.value < self.best.off.value


def enclosures(worst: Worst, low: Array, high: Array) -> Array:
    """Return the enclosures of the relative pose over boxes of parameters, (n, 12, k + 2)."""
    problem, scene, k = worst.problem, worst.scene, low.shape[1]
    offset = scene.static.seed - scene.movable.seed
    q = [Enclosure.variable((low[:, j] + high[:, j]) / 2.0, (high[:, j] - low[:, j]) / 2.0, j, k) for j in range(k)]
    return enclosed_pose(problem.motion.seen_from(scene.movable.seed), q, offset)
