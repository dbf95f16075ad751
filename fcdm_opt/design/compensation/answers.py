"""Least motions at single pairs of sizes: searched everywhere, or only near what is known around, and always judged."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.design.compensation.ways import NOTHING, Way, way_of
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.judge.certificate import verify
from fcdm_opt.judge.engagement import inside_fit
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.solver import STAGES, reported, solve
from fcdm_opt.stages.branching import near

QUICK = ("satisfied", "shift", "straight", "one parameter", "rotations", "descent", "translations")  # dearest last
CONTINUED = "continued from motions around"


class Node(NamedTuple):
    """A least motion: `way` holds it; `values`, (1 + k,), are its amount and parameters, nan without a motion."""

    way: Way
    values: Array


class Question(NamedTuple):
    """A pair of sizes, and how its least motion is to be found.

    Attributes
    ----------
    pair : (float, float)
    everywhere : bool
        Whether all motions are looked at, as `solve` does; otherwise local searches have to do.
    hints : tuple of tuple of float
        Motions known around, one of each way.
    nothing : bool
        Whether there is none at the nearest pair known: none is then taken for granted where none is found.
    all_hints : bool
        Whether hints are followed even where a stage of the solver has an answer.
    """

    pair: tuple[float, float]
    everywhere: bool = True
    hints: tuple[tuple[float, ...], ...] = ()
    nothing: bool = False
    all_hints: bool = False


def asked(problem: Problem, pair: Sequence[float] | Array) -> Problem:
    """Return the problem for one pair of sizes."""
    return problem.changed(target=(float(pair[0]), float(pair[1])), requirement=None, tolerance=None, goal=problem.goal)


def node_at(problem: Problem, question: Question) -> Node:
    """Return the least motion for one pair of sizes, judged."""
    one = asked(problem, question.pair)
    solution = None
    if not question.everywhere and problem.amount == "weighted" and not problem.feature_pairs:
        task = Task.of(one)
        answer = _near_by(task, question)
        if answer is None and question.nothing:
            return Node(NOTHING, np.full(1 + len(problem.weights), np.nan))
        if answer is not None:
            solution = reported(one, task, answer)
            solution = inside_fit(solution.with_certificate(verify(solution), {}))
    if solution is None or (solution.status.found and not solution.usable):
        solution = solve(one, effort="quick")
    return _node(solution)


def _near_by(task: Task, question: Question) -> Answer | None:
    """Return what the quick stages find, or the least that is found near the hints."""
    tried = (STAGES[name](task) for name in QUICK)
    best = next((answer for answer in tried if answer is not None and answer.settles), None)
    if best is not None and not question.all_hints:
        return best
    least = task.amount(best.q) if best is not None and best.q is not None else np.inf
    for hint in question.hints:
        found = near(task, np.array(hint))
        if found is not None and found.amount < least:
            least = found.amount
            best = Answer(Status.SOLVED, found.q, CONTINUED, 0.0, found.active, found.modelled)
    return best


def _node(solution: Solution) -> Node:
    if not solution.usable:
        return Node(way_of(solution), np.full(1 + len(solution.problem.weights), np.nan))
    return Node(way_of(solution), np.array([solution.amount, *solution.parameters.values()]))


_asked: dict[str, Problem] = {}  # the problem that this process was last asked


def nodes_at(text: str, questions: Iterable[tuple[Any, ...]]) -> list[tuple[tuple[Any, ...], list[float]]]:
    """Answer several questions about a problem in plain data: what a worker process does."""
    import json

    if text not in _asked:
        _asked.clear()
        _asked[text] = Problem.from_dict(json.loads(text))
    nodes = [node_at(_asked[text], Question(*question)) for question in questions]
    return [(tuple(node.way), node.values.tolist()) for node in nodes]
