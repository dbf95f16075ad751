"""What a worker does with a point: asks, has judged, and gives a row of plain data."""

from __future__ import annotations

import gc
import math
from collections.abc import Mapping
from time import perf_counter
from typing import TYPE_CHECKING, Any

from fcdm_opt.errors import InputError
from fcdm_opt.plain import plain

if TYPE_CHECKING:
    from fcdm_opt.problem.scene import Scene
    from fcdm_opt.problem.solution import Bounded

Asked = tuple[str, str, Mapping[str, Any], bool, str]
"""A point as plain data: its key, the canonical JSON of its scene, its case, and `certify` and `effort` of `solve`."""

Row = dict[str, Any]

AS_PLAIN = ("usable", "rho", "pair", "pair_state", "active", "stage", "modelled")

BAD_INPUT, ERROR, WORKER_LOST = "BAD_INPUT", "ERROR", "WORKER_LOST"
"""What a row's status may be besides the names of `Status`: no question, an unexpected error, no answer at all."""


def evaluate(asked: Asked) -> Row:
    """Solve and verify a point, see `row` for what is returned; whatever is raised on the way is told there."""
    from fcdm_opt.design.question import Question

    key, scene, case, certify, effort = asked
    start = perf_counter()
    try:
        solution, seconds = _solved(Question.restored(scene, case).problem(), certify, effort)
        return {**_answer(key, solution), "seconds": {**seconds, "point": perf_counter() - start}}
    except InputError as reason:
        return row(key, BAD_INPUT, str(reason), seconds=perf_counter() - start)
    except Exception as reason:  # whatever a library raises is this point's answer, and not the end of a study
        message = f"{type(reason).__name__}: {' '.join(str(reason).split())}"
        return row(key, ERROR, message, seconds=perf_counter() - start)


def load() -> None:
    """Load and compile what `evaluate` needs, by solving something small, so that it counts in no point's time."""
    from fcdm_opt.geometry.bodies import Body
    from fcdm_opt.motion.motions import Rotation, Translation
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.solver import solve

    corners = [[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
    others = [[1.2, 1.3, 0.2], [3.1, 0.2, 1.2], [1.3, 3.0, 0.9], [2.9, 2.5, -1.4]]
    motion = Translation("x") >> Rotation("z", centre="origin")
    bodies, box = (Body.convex(corners), Body.convex(others)), ((0.2, 3.0), (0.2, 3.0))
    problem = Problem(*bodies, target=(1.0, 1.0), goal="touch", motion=motion, box=box)
    solve(problem)
    solve(problem.changed(nominal=1, tolerance=0.01, requirement="C", target=None, goal="beyond"))
    gc.freeze()  # what is loaded stays: not to be looked through again and again


def row(key: str, status: str, message: str = "", *, seconds: float = 0.0) -> Row:
    """Return the row of a point without a solution, with the reason in words.

    Parameters have the names of `Scene.coordinates`, features in words, "checks_failed" names of checks, "seconds"
    those of "build", "solve", "prove", "verify", and "point" for all of it; the others as in `Solution`, None for nan.
    """
    return {
        "key": key,
        "status": status,
        "message": message,
        "usable": False,
        **dict.fromkeys(("amount", "lower_bound", "rho", "pair", "pair_gap")),
        **{name: {} for name in ("parameters", "modelled")},
        **{name: [] for name in ("features", "active", "checks_failed")},
        "pair_state": "unknown",
        "stage": "",
        "seconds": {"point": seconds},
    }


def _solved(problem: Scene, certify: bool, effort: Any) -> tuple[Any, dict[str, float]]:
    """Return the judged solution, and what it took; what a proof says is checked too."""
    from fcdm_opt.judge.certificate import verify
    from fcdm_opt.solver import solve

    start = perf_counter()
    solution: Any = solve(problem, certify=certify, effort=effort)
    seconds = dict(solution.seconds)
    seconds["solve"] += perf_counter() - start - sum(seconds.values())  # features that were tried besides, and the rest
    if solution.evidence is not None:
        start = perf_counter()
        solution = solution.with_certificate(verify(solution, proof=True), solution.seconds)
        seconds["verify"] += perf_counter() - start
    return solution, seconds


def _answer(key: str, solution: Bounded) -> Row:
    certificate, empty = solution.certificate, row(key, solution.status.name, solution.advice)
    # None for nan; infinite bounds of what is infeasible stay infinite
    numbers = {name: float(getattr(solution, name, math.nan)) for name in ("amount", "lower_bound", "pair_gap")}
    return {
        **empty,
        **{name: None if math.isnan(value) else value for name, value in numbers.items()},
        **{name: plain(getattr(solution, name, empty[name])) for name in AS_PLAIN},
        "features": [own.in_words(*solution.question.bodies[:2]) for own in getattr(solution, "features", ())],
        "parameters": plain(solution.coordinates),
        "checks_failed": [check.name for check in certificate.failed] if certificate else [],
    }
