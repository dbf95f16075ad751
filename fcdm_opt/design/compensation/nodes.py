"""Least motions at the places that the map asks for: remembered, and proved where it counts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np

from fcdm_opt.design.compensation.answers import Node, Question, node_at, nodes_at
from fcdm_opt.design.compensation.ways import MOTIONLESS, NOTHING, Way
from fcdm_opt.design.sizes import size_box, tolerance_box
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

AROUND = 2e-5  # of the box: a way that does not hold so far off a place is a strip between two regions
CIRCLE = tuple((math.cos(0.3 + 0.4 * math.pi * k), math.sin(0.3 + 0.4 * math.pi * k)) for k in range(5))
FEWEST = 2  # of these directions in which the way of a region holds
CHUNK = 16  # pairs that a process is handed at once
BEYOND = 4.0  # times the distance of the nearest: ways whose motions are continued
HINTS = 3  # ways, nearest first, whose motions are continued to a place

Key = tuple[float, float]


@dataclass(eq=False)
class Nodes:
    """Finds least motions and remembers them.

    Some are proved: all motions are looked at. Others are what local searches find from motions known around, which
    is a hundred times cheaper, and as good unless a way comes up that no proved node around has: hence `agree`.

    Attributes
    ----------
    problem : Problem
    box : (2, 2) array
        Places are relative to it: (0, 0) is its lower, (1, 1) its upper corner.
    budget : int
        Number of nodes after which `spent` is true.
    jobs : int
        Processes.
    seconds : float
        Time after which `spent` is true.
    known, moved : dict
        Place -> node as found; and as taken where its own way is but a strip.
    proved : set
        Places of nodes that are proved.
    solved_in_all : int
        How many pairs of sizes were solved, those forgotten included.
    """

    problem: Problem
    box: Array
    budget: int
    jobs: int = 1
    seconds: float = math.inf
    known: dict[Key, Node] = field(default_factory=dict)
    moved: dict[Key, Node] = field(default_factory=dict)
    proved: set[Key] = field(default_factory=set)
    solved_in_all: int = 0
    _wide: set[Way] = field(default_factory=set)
    _start: float = field(default_factory=perf_counter)
    _doubt: int = 0

    @property
    def spent(self) -> bool:
        """Whether the budget or the time is used up."""
        return self.effort >= 1.0

    @property
    def effort(self) -> float:
        """The share of the budget, or of the time, that is used up."""
        return max(self.solved_in_all / self.budget, (perf_counter() - self._start) / self.seconds)

    def pair(self, place: Any) -> Array:
        """Return the sizes at a place, or at several, (..., 2)."""
        place = np.asarray(place, dtype=float)
        return np.asarray(self.box[:, 0] * (1.0 - place) + self.box[:, 1] * place)

    def solved(self, places: Sequence[Array], *, proved: bool = False) -> list[Node]:
        """Return the nodes at some places."""
        nodes = self._remembered([(float(place[0]), float(place[1])) for place in places], proved)
        for k, (place, node) in enumerate(zip(places, nodes, strict=True)):
            if node.way not in self._wide:
                nodes[k] = self._beside(place, node)
        return nodes

    def agree(self, places: Sequence[Array]) -> bool:
        """Tell whether nodes hold when they are proved; if not, forget all that are not, and be more careful."""
        keys = [(float(place[0]), float(place[1])) for place in places]
        before = self._remembered(keys)
        after = self._remembered(keys, True)
        slack = DEFAULT.touch * self.problem.size
        gains = np.array([one.values[0] - two.values[0] for one, two in zip(before, after, strict=True)])
        lost = [math.isnan(one.values[0]) != math.isnan(two.values[0]) for one, two in zip(before, after, strict=True)]
        if not any(lost) and not (gains > slack).any():
            return True
        self._doubt += 1
        self.known = {key: self.known[key] for key in self.proved}
        self.moved.clear()
        self._wide.clear()
        return False

    def _remembered(self, keys: list[Key], proved: bool = False) -> list[Node]:
        known = self.proved if proved else self.known
        missing = [key for key in dict.fromkeys(keys) if key not in known]
        everywhere = proved or self._doubt > 1
        for key, node in zip(missing, self._solve(self._questions(missing, everywhere)), strict=True):
            self.known[key] = node
        if everywhere:
            self.proved.update(missing)
        self.solved_in_all += len(missing)
        return [self.known[key] for key in keys]

    def _questions(self, keys: Sequence[Key], everywhere: bool) -> list[Question]:
        """Return what is asked at some places, with what is known around; the same however many processes answer."""
        pairs = [(float(pair[0]), float(pair[1])) for pair in self.pair(np.reshape(keys, (-1, 2)))]
        if everywhere or not keys or not self.known:
            return [Question(pair) for pair in pairs]
        places, nodes = np.array(list(self.known)), list(self.known.values())
        rows: dict[Way, list[int]] = {}
        for row, node in enumerate(nodes):
            rows.setdefault(node.way, []).append(row)
        nearest = []  # of each way, for every key
        for way, own in rows.items():
            off = np.abs(np.array(keys)[:, None] - places[own]).sum(axis=2)
            best = off.argmin(axis=1)
            nearest.append((way, off[np.arange(len(keys)), best], np.array(own)[best]))
        made = []
        for k, pair in enumerate(pairs):
            order = sorted(nearest, key=lambda own: float(own[1][k]))
            reach = BEYOND * float(order[0][1][k])
            close = [own for own in order if own[0].kind not in MOTIONLESS and (self._doubt or own[1][k] <= reach)]
            hints = [nodes[own[2][k]].values[1:] for own in close]
            nothing = order[0][0] == NOTHING
            made.append(
                Question(pair, False, tuple(map(tuple, np.array(hints[:HINTS]).tolist())), nothing, bool(self._doubt))
            )
        return made

    def _beside(self, place: Array, node: Node) -> Node:
        """Return the node itself if its way holds around it, else that of a region beside, continued to its place.

        On a boundary of two regions both ways hold at once, in a strip as wide as rounding: that is no region.
        """
        key = float(place[0]), float(place[1])
        if key not in self.moved:
            x, y = place
            ring = [(x + AROUND * c, y + AROUND * s) for c, s in CIRCLE]
            near = self._remembered(ring)
            if sum(own.way == node.way for own in near) >= FEWEST:
                self._wide.add(node.way)
                return node
            self.moved[key] = node
            order = sorted(range(len(ring)), key=lambda k: (near[k].way not in self._wide, k))
            for k in order:  # continued from a region beside
                (far,) = self._remembered([(2 * ring[k][0] - x, 2 * ring[k][1] - y)])
                if far.way == near[k].way:
                    self.moved[key] = Node(far.way, 2 * near[k].values - far.values)
                    break
        return self.moved[key]

    def _solve(self, questions: list[Question]) -> Iterator[Node]:
        if self.jobs == 1 or len(questions) < 2 * self.jobs:
            yield from (node_at(self.problem, question) for question in questions)
            return
        from joblib import Parallel, delayed

        count = min(len(questions), max(self.jobs, len(questions) // CHUNK))
        ends = np.linspace(0, len(questions), count + 1).astype(int)
        chunks = [[tuple(own) for own in questions[a:b]] for a, b in pairwise(ends)]
        with Parallel(n_jobs=self.jobs, return_as="generator", inner_max_num_threads=1, backend="loky") as run:
            for nodes in run(delayed(nodes_at)(self._plain, chunk) for chunk in chunks):
                yield from (Node(Way(*way), np.array(values)) for way, values in nodes)

    @cached_property
    def _plain(self) -> str:
        import json

        return json.dumps(self.problem.to_dict())


def covered(problem: Problem, box: Any) -> Array:
    """Return the box of sizes that a map covers, (2, 2); raises `InputError` for what has no map.

    Parameters
    ----------
    problem : Problem
    box : ((low_1, high_1), (low_2, high_2)) or None
        None: what the problem's tolerance leaves open.
    """
    if not isinstance(problem, Problem):
        raise InputError("expected a Problem", key="problem", found=type(problem).__name__)
    if problem.goal == "beyond":
        raise InputError(
            "the amount of this goal jumps wherever the deviation changes sign, so it has no map",
            key="goal",
            found="beyond",
            allowed='"touch", "clear", "at" or "seat"',
        )
    if problem.resolution is not None:
        raise InputError(
            "a motion in whole steps jumps from pair to pair, so it has no map",
            key="resolution",
            found=problem.resolution.tolist(),
            allowed="a problem without resolution",
        )
    made = tolerance_box(problem) if box is None else size_box(box, "box")
    if (np.ptp(made, axis=1) <= DEFAULT.snap * made[:, 1]).any():
        raise InputError(
            "a box this narrow has no map", key="box", found=made.tolist(), allowed="low < high, for both sizes"
        )
    return made
