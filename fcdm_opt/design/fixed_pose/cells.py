"""Branch and bound over cells of poses: boxes of motion parameters, each halved until it holds nothing better.

A cell is known by the enclosure of its poses, of first order: everything linear in its parameters is kept, the rest
bounded. Of its bound keeps a record what proves it, see `gaps.cell_bound`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.design.fixed_pose import gaps as kernels
from fcdm_opt.design.fixed_pose.local_search import Found, found_at
from fcdm_opt.design.fixed_pose.scene import GapRows
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
    directions: tuple[Array, ...]


NO_WITNESSES = Witnesses(np.empty(0, np.int64), np.empty(0), np.empty((0, 2), np.int64), np.empty((0, 2)), ())


@dataclass(eq=False)
class Node:
    """A cell, its bound and what proves it; `split` is the axis along which it is to be halved, if it is not yet."""

    low: Array
    high: Array
    bound: float = -np.inf
    witnesses: Witnesses = NO_WITNESSES
    split: int = 0
    halved: bool = False


@dataclass(eq=False)
class Search:
    """Cells of poses within limits, (k, 2), all finite, and the best pose known.

    A pose is in the window whose worst gap is off by no more than `slack`. With `amounts` the smallest amount in the
    window is looked for; else the pose whose worst gap is off least. `improve` returns a pose near one that is as good
    as those about it; `known` is what no pose has less of, where a program tells it without cells.
    """

    worst: Worst
    limits: Array
    best: Found
    slack: float
    amounts: bool
    improve: Callable[[Array], Found]
    nodes: list[Node] = field(default_factory=list)
    known: float | None = None

    @property
    def value(self) -> float:
        """What is made small, of the best pose known."""
        return self.best.amount if self.amounts else self.best.off.value

    @property
    def lower(self) -> float:
        """What no pose has less of: by the leaves."""
        leaves = [node.bound for node in self.nodes if not node.halved]
        return max(min(min(leaves, default=np.inf), self.value), 0.0 if self.amounts else self.worst.floor)

    def run(self, *, accuracy: float, near: float, most: int, settled: Callable[[], bool] = lambda: False) -> None:
        """Halve cells until no pose is better than the best by `accuracy`, or there are `most` cells."""
        # the accuracy is relative, and values as near to each other as `near` are equal; what is `settled` ends early
        heap, floor = list[tuple[float, int]](), 0.0 if self.amounts else self.worst.floor
        self._add([(self.limits[:, 0], self.limits[:, 1])], heap)
        while heap and len(self.nodes) < most and not settled():
            enough = self.value - max(accuracy * abs(self.value), near)
            if max(heap[0][0], floor) >= enough:
                break
            halves: list[tuple[Array, Array]] = []
            while heap and len(halves) < BATCH and heap[0][0] < enough:
                node = self.nodes[heappop(heap)[1]]
                upper, lower, axis = node.low.copy(), node.high.copy(), node.split
                upper[axis] = lower[axis] = middle = 0.5 * node.low[axis] + 0.5 * node.high[axis]
                if node.low[axis] < middle < node.high[axis]:  # else as small as digits allow
                    node.halved = True
                    halves += [(node.low, lower), (upper, node.high)]
            if halves:
                self._add(halves, heap)

    def _add(self, boxes: list[tuple[Array, Array]], heap: list[tuple[float, int]]) -> None:
        low, high = map(np.array, zip(*boxes, strict=True))
        scene = self.worst.scene
        motion, offset = self.worst.problem.motion.seen_from(scene.movable.seed), scene.static.seed - scene.movable.seed
        for a, b, T in zip(low, high, enclosed_pose(motion, Enclosure.box(low, high), offset), strict=True):
            node = Node(a, b)
            self._look_at(node, T)
            heappush(heap, (node.bound, len(self.nodes)))
            self.nodes.append(node)

    def _look_at(self, node: Node, T: Array) -> None:
        worst, scene, slopes = self.worst, self.worst.scene, T[:, 1:-1]
        moved = np.abs(slopes[9:]).sum(axis=0) + scene.circumradius * np.abs(slopes[:9]).sum(axis=0)
        for own in worst.keep_out:
            other = T.copy()
            other[9:, 0] += own.scene.static.seed - scene.static.seed
            if _bounded(own, other, float(moved.sum()))[1][0] > 2.0 * self.slack:
                node.bound = np.inf
                return
        rows, (bound, value, shares, kinds, normals, scores) = _bounded(worst, T, float(moved.sum()))
        if not np.isfinite(bound):
            bound = -np.inf
        chosen = np.flatnonzero(shares > NEGLIGIBLE)
        parts = np.full((len(chosen), 2), -1)
        kind, place, size = kinds[chosen].T
        short = kind != kernels.DIRECTED
        parts[short] = rows.pairs[place[short]]
        directions = tuple(np.empty((0, 3)) if own else normals[s] for own, s in zip(short, size, strict=True))
        node.witnesses = Witnesses(kind, shares[chosen], parts, worst.active[size], directions)
        width, turning = node.high - node.low, worst.problem.motion.turning
        if self.amounts:
            # beyond rounding off the window; else what the cell may hold counts by its amount
            sure = bound > 2.0 * self.slack
            node.bound = np.inf if sure else worst.amount(np.maximum(np.maximum(node.low, -node.high), 0.0))
            node.witnesses = node.witnesses if sure else NO_WITNESSES
            node.split = int(np.argmax(worst.weights * width))
        else:
            # what each parameter costs the bound, moves points by, and adds to what is not linear in it: turns do
            node.bound, bent = bound, np.where(turning, width**2, 0.0)
            error = scene.circumradius * T[:9, -1].sum() + T[9:, -1].sum()
            if error < np.inf and bent.any():
                bent = error * bent / bent.sum()
            scores = np.where(np.isfinite(scores), scores, 0.0) + RAW * moved + bent
            node.split = int(np.argmax(np.where(width > 0, scores, -1.0)))
        if (value <= self.slack if self.amounts else value < self.best.off.value) and len(worst.active):
            found, before = found_at(worst, 0.5 * node.low + 0.5 * node.high), self.value
            if self._beats(found):
                self.best = found
                improved = self.improve(found.q) if before - self.value > MUCH * abs(before) else found
                if self._beats(improved):
                    self.best = improved

    def _beats(self, found: Found) -> bool:
        if self.amounts:
            return found.off.value <= self.slack and found.amount < self.best.amount
        return found.off.value < self.best.off.value


def _bounded(worst: Worst, T: Array, slack: float) -> tuple[GapRows, tuple[Any, ...]]:
    """Return the rows at the centre of a cell of poses, and what `gaps.cell_bound` makes of them."""
    scene = worst.scene
    rows = scene.rows(np.ascontiguousarray(T[:, 0]), slack)
    return rows, kernels.cell_bound(
        *(scene.vertices[0], scene.starts[0], scene.vertices[1], scene.starts[1], scene.counted),
        *(rows.rows, rows.first, rows.pairs, rows.along),
        *(np.ascontiguousarray(T.T), worst.active, worst.low, worst.high),
    )
