"""Least motions at single pairs of sizes: solved and verified, and what holds each of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import Contact, located, supporting_contact, touching_contact
from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerance.problem import Problem
from fcdm_opt.tolerance.sensitivities.holding import Holding
from fcdm_opt.tolerance.sensitivities.variation import Layout
from fcdm_opt.tolerance.solution import Solution
from fcdm_opt.tolerance.solver import solve
from fcdm_opt.tolerance.task import Parts, Task
from fcdm_opt.tolerances import DEFAULT

AROUND = 2e-5  # of the box: a way that does not hold so far off a place is a strip between two regions
CIRCLE = tuple((math.cos(0.3 + k * math.pi / 4), math.sin(0.3 + k * math.pi / 4)) for k in range(8))
FEWEST = 2  # of these directions in which the way of a region holds
CHUNK = 64  # pairs that a process is handed at once


Key = tuple[float, float]


class Way(NamedTuple):
    """One way of holding the motion: pairs of sizes that share it make a region of the map.

    Attributes
    ----------
    kind : str
        "motion", "already satisfied", "no motion" or "not verified".
    features : tuple of str
        Labels of the features that are in contact after the motion, or as near as they may be.
    active : tuple of str
        Limits that are reached, and what else holds the motion besides the features.
    """

    kind: str
    features: tuple[str, ...] = ()
    active: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "; ".join((*self.features, *self.active)) or self.kind


SATISFIED, NOTHING, REJECTED = Way("already satisfied"), Way("no motion"), Way("not verified")


class Node(NamedTuple):
    """A least motion: `way` holds it; `values`, (1 + k,), are its amount and parameters, nan without a motion."""

    way: Way
    values: Array


def way_of(solution: Solution) -> Way:
    """Return what holds the motion of a solution, read off the geometry: the same whichever stage found it."""
    if not solution.usable:
        return REJECTED if solution.status.found else NOTHING
    if solution.amount == 0.0:
        return SATISFIED
    task, q = Task.of(solution.problem), np.array(list(solution.parameters.values()))
    features = [feature.label for feature in solution.features] if task.tracked else []
    if np.isfinite(task.needs).any():
        features += [label for label in _nearest(task, q) if label not in features]
    active = list(_side(task))
    slack = DEFAULT.touch * task.size
    for k, name in enumerate(solution.parameters):
        low, high = solution.problem.limits[k]
        for limit, which in ((low, "lower"), (high, "upper")):
            if abs(q[k] - limit) * task.weights[k] <= slack:
                active.append(f"{which} limit of {name}")
    if task.tracked:
        groups = Holding(task, q, Layout.of(task), solution.problem.limits).groups()
        names = {rate.name for group in groups for rates in group for rate in rates}
        active += sorted(name for name in names if "limit of" not in name)
    return Way("motion", tuple(sorted(features)), tuple(active))


def _side(task: Task) -> Iterator[str]:
    """Yield which side of contact the pair is on at rest: the amount, not the motion, has a kink where it touches."""
    if task.must_touch:
        yield "closes a gap" if task.gap(task.rest) > 0 else "removes an overlap"
    elif task.tracked:
        gaps = task.line_gaps(task.rest)[1]
        if len(gaps) == 1:
            yield "closes a gap" if gaps[0] > 0 else "removes an overlap"


def _nearest(task: Task, q: Array) -> list[str]:
    """Return the features of the part pairs that are just as far apart as they must be."""
    slack = DEFAULT.touch * task.size
    near = task.pair_gaps(q) - task.needs <= slack
    found: dict[str, None] = {}
    for i, j in np.argwhere(near).tolist():
        keep_out = task.opponents[j].keep_out
        prefix = "" if keep_out < 0 else f"{task.named((i, j))} "
        found[f"{prefix}{_feature(task, q, (i, j), slack).label}"] = None
    return list(found)


def _feature(task: Task, q: Array, parts: Parts, slack: float) -> Feature:
    one, opponent = task.movable.parts[parts[0]], task.opponents[parts[1]]
    two, rho = opponent.part, np.array([task.target[0], opponent.scale])
    pose = task.pose(q)
    _, rows, separations = task.separations(parts, pose)
    pose = np.append(pose[:9], pose[9:] + two.seed - task.static.seed)
    contact: Contact
    if opponent.need > slack:
        normal = task.way_between(parts, q)
        normal = normal / np.linalg.norm(normal)
        gap = kernels.separation(*one.packed, *two.packed, pose, rho, normal)
        pose = np.append(pose[:9], pose[9:] - gap * normal)
        contact = supporting_contact(one, two, normal, pose, DEFAULT.touch)
    else:
        contact = touching_contact(one, two, rows[separations >= separations.max() - slack, :3], pose, DEFAULT.touch)
    return located(one, two, pose, contact, rho).feature


def asked(problem: Problem, pair: Sequence[float] | Array) -> Problem:
    """Return the question for one pair of sizes."""
    return problem.changed(target=(float(pair[0]), float(pair[1])), requirement=None, tolerance=None, goal=problem.goal)


def node_at(problem: Problem, pair: Sequence[float] | Array) -> Node:
    """Solve for one pair of sizes, and have the motion judged."""
    solution = solve(asked(problem, pair))
    way = way_of(solution)
    if not solution.usable:
        return Node(way, np.full(1 + len(problem.weights), np.nan))
    return Node(way, np.array([solution.amount, *solution.parameters.values()]))


@dataclass(eq=False)
class Nodes:
    """Solves pairs of sizes and remembers them.

    Attributes
    ----------
    problem : Problem
    box : (2, 2) array
        Places are relative to it: (0, 0) is its lower, (1, 1) its upper corner.
    budget : int
        Number of solves after which `spent` is true.
    jobs : int
        Processes.
    known, moved : dict
        Place -> node as solved; and as taken where its own way is but a strip.
    """

    problem: Problem
    box: Array
    budget: int
    jobs: int = 1
    known: dict[Key, Node] = field(default_factory=dict)
    moved: dict[Key, Node] = field(default_factory=dict)
    _wide: set[Way] = field(default_factory=set)

    @property
    def spent(self) -> bool:
        """Whether the budget is used up."""
        return len(self.known) >= self.budget

    def pair(self, place: Any) -> Array:
        """Return the sizes at a place, or at several, (..., 2)."""
        place = np.asarray(place, dtype=float)
        return np.asarray(self.box[:, 0] * (1.0 - place) + self.box[:, 1] * place)

    def solved(self, places: Sequence[Array]) -> list[Node]:
        """Return the nodes at some places."""
        nodes = self._remembered([(float(place[0]), float(place[1])) for place in places])
        for k, (place, node) in enumerate(zip(places, nodes, strict=True)):
            if node.way not in self._wide:
                nodes[k] = self._beside(place, node)
        return nodes

    def _remembered(self, keys: list[Key]) -> list[Node]:
        missing = [key for key in dict.fromkeys(keys) if key not in self.known]
        for key, node in zip(missing, self._solve([self.pair(key) for key in missing]), strict=True):
            self.known[key] = node
        return [self.known[key] for key in keys]

    def _beside(self, place: Array, node: Node) -> Node:
        """Return the node itself if its way holds around it, else that of a region beside, continued to its place.

        On a boundary of two regions both ways hold at once, in a strip as wide as rounding: that is no region.
        """
        key = float(place[0]), float(place[1])
        if key not in self.moved:
            x, y = place
            near = self._remembered([(x + AROUND * c, y + AROUND * s) for c, s in CIRCLE])
            if sum(own.way == node.way for own in near) >= FEWEST:
                self._wide.add(node.way)
                return node
            far = self._remembered([(x + 2 * AROUND * c, y + 2 * AROUND * s) for c, s in CIRCLE])
            pairs = [(one, two) for one, two in zip(near, far, strict=True) if one.way == two.way]
            best = [pair for pair in pairs if pair[0].way in self._wide] or pairs
            self.moved[key] = Node(best[0][0].way, 2 * best[0][0].values - best[0][1].values) if best else node
        return self.moved[key]

    def _solve(self, pairs: list[Array]) -> Iterator[Node]:
        if self.jobs == 1 or len(pairs) < CHUNK:
            yield from (node_at(self.problem, pair) for pair in pairs)
            return
        from joblib import Parallel, delayed

        text = self._plain
        chunks = [np.array(chunk) for chunk in np.array_split(np.array(pairs), max(self.jobs, len(pairs) // CHUNK))]
        with Parallel(n_jobs=self.jobs, return_as="generator", inner_max_num_threads=1, backend="loky") as run:
            for nodes in run(delayed(nodes_at)(text, chunk) for chunk in chunks):
                yield from (Node(Way(*way), np.array(values)) for way, values in nodes)

    @property
    def _plain(self) -> str:
        import json

        if "plain" not in self.__dict__:
            self.__dict__["plain"] = json.dumps(self.problem.to_dict())
        return str(self.__dict__["plain"])


_asked: dict[str, Problem] = {}  # the question that this process was last asked


def nodes_at(text: str, pairs: Array) -> list[tuple[tuple[Any, ...], list[float]]]:
    """Solve several pairs of sizes of a problem in plain data: what a worker process does."""
    import json

    if text not in _asked:
        _asked.clear()
        _asked[text] = Problem.from_dict(json.loads(text))
    nodes = [node_at(_asked[text], pair) for pair in pairs]
    return [(tuple(node.way), node.values.tolist()) for node in nodes]


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
    allowed = "((low_1, high_1), (low_2, high_2)) with 0 < low < high"
    if box is None:
        if problem.tolerance is None:
            raise InputError("neither a box nor a tolerance says which sizes to cover", key="box", allowed=allowed)
        minus, plus = problem.tolerance.T
        made = np.column_stack([problem.nominal_pair * (1.0 - minus), problem.nominal_pair * (1.0 + plus)])
    else:
        try:
            made = np.array(box, dtype=float)
        except (TypeError, ValueError) as reason:
            raise InputError("not a box of sizes", key="box", found=box, allowed=allowed) from reason
    if made.shape != (2, 2) or not np.isfinite(made).all() or made.min() <= 0 or (made[:, 0] >= made[:, 1]).any():
        raise InputError("not a box of sizes", key="box", found=made.tolist(), allowed=allowed)
    if (np.ptp(made, axis=1) <= DEFAULT.snap * made[:, 1]).any():
        raise InputError("a box this narrow has no map", key="box", found=made.tolist(), allowed=allowed)
    return made
