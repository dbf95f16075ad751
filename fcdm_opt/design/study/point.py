"""What a worker does with a chunk of points: asks, has judged, and gives one row of plain data for each."""

from __future__ import annotations

import faulthandler
import gc
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from fcdm_opt.errors import InputError

if TYPE_CHECKING:
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.problem.solution import Solution

Payload = dict[str, Any]
"""A chunk of points, plain data: "certify", "effort", "time_limit" (seconds a point, or None), "scenes" (key to
canonical JSON) and "points", each [key, scene key, case]."""

Row = dict[str, Any]
Outcome = tuple[Payload, list[Row] | None]
"""A chunk and its rows, in the order of its points; None where its worker was lost."""

BAD_INPUT, ERROR, WORKER_LOST = "BAD_INPUT", "ERROR", "WORKER_LOST"
"""What a row's status may be besides the names of `Status`: no question, an unexpected error, no answer at all."""

STDERR = 2  # where the system's own watch writes where a point was that took too long


def evaluate(payload: Payload) -> list[Row]:
    """Solve and verify the points of a chunk.

    Parameters
    ----------
    payload : dict
        See `Payload`. With a time limit the process ends where a point takes longer: only for a process that somebody
        replaces.

    Returns
    -------
    list of dict
        A row a point, see `row` for its keys.
    """
    rows = []
    for key, scene, case in payload["points"]:
        with within(payload["time_limit"]):
            rows.append(_evaluated(key, payload["scenes"][scene], case, payload["certify"], payload["effort"]))
    return rows


def load(limited: bool) -> bool:
    """Load what `evaluate` needs, which takes a second.

    Parameters
    ----------
    limited : bool
        Solve something small even where that means to compile, so that it counts in no point's time.

    Returns
    -------
    bool
        Whether it is compiled already.
    """
    from fcdm_opt.curve import kernels
    from fcdm_opt.design import question  # noqa: F401
    from fcdm_opt.geometry.bodies import Body
    from fcdm_opt.motion.motions import Rotation, Translation
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.solver import solve

    if not (limited or _is_compiled(kernels.facet_rows)):
        return False
    corners = [[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
    beside = [[1.2, 1.3, 0.2], [3.1, 0.2, 1.2], [1.3, 3.0, 0.9], [2.9, 2.5, -1.4]]
    motion = Translation("x") >> Rotation("z", centre="origin")
    bodies, box = (Body.convex(corners), Body.convex(beside)), ((0.2, 3.0), (0.2, 3.0))
    problem = Problem(*bodies, target=(1.0, 1.0), goal="touch", motion=motion, box=box)
    solve(problem)
    solve(problem.changed(nominal=1, tolerance=0.01, requirement="C", target=None, goal="beyond"))
    gc.freeze()  # what is loaded stays: not to be looked through again and again
    return True


def _is_compiled(kernel: Any) -> bool:
    """Tell whether a kernel's cache has machine code of it, as far as its folder tells."""
    folder = kernel.stats.cache_path
    return folder is not None and any(Path(folder).glob(f"*{kernel.__name__}*.nbc"))


def row(key: str, status: str, message: str = "", *, seconds: float = 0.0) -> Row:
    """Return the row of a point without a solution.

    Parameters
    ----------
    key : str
        Of the point.
    status, message : str
        How it ended, and the reason in words.
    seconds : float
        What it took.

    Returns
    -------
    dict
        "key", "status", "message", "usable", "amount", "lower_bound", "parameters", "rho", "pair", "pair_gap",
        "pair_state", "features" (labels), "active", "stage", "modelled", "checks_failed" (names of checks) and
        "seconds" ("build", "solve", "prove", "verify", and "point" for all of it); the others as in `Solution`, None
        for nan.
    """
    return {
        "key": key,
        "status": status,
        "message": message,
        "usable": False,
        "amount": None,
        "lower_bound": None,
        "parameters": {},
        "rho": None,
        "pair": None,
        "pair_gap": None,
        "pair_state": "unknown",
        "features": [],
        "active": [],
        "stage": "",
        "modelled": {},
        "checks_failed": [],
        "seconds": {"point": seconds},
    }


def _evaluated(key: str, scene: str, case: Mapping[str, Any], certify: bool, effort: str) -> Row:
    from fcdm_opt.design.question import Question

    start = perf_counter()
    try:
        solution, seconds = _solved(Question.restored(scene, case).problem(), certify, effort)
        answer = _answer(key, solution)
        answer["seconds"] = {**seconds, "point": perf_counter() - start}
        return answer
    except InputError as reason:
        return row(key, BAD_INPUT, str(reason), seconds=perf_counter() - start)
    except Exception as reason:  # whatever a library raises is this point's answer, and not the end of a study
        message = f"{type(reason).__name__}: {' '.join(str(reason).split())}"
        return row(key, ERROR, message, seconds=perf_counter() - start)


def _solved(problem: Problem, certify: bool, effort: str) -> tuple[Solution, dict[str, float]]:
    """Return the judged solution, and what it took; what a proof says is checked too."""
    from fcdm_opt.judge.certificate import verify
    from fcdm_opt.solver import solve

    start = perf_counter()
    solution = solve(problem, certify=certify, effort=effort)
    seconds = dict(solution.seconds)
    seconds["solve"] += perf_counter() - start - sum(seconds.values())  # features that were tried besides, and the rest
    if solution.evidence is not None:
        start = perf_counter()
        solution = solution.with_certificate(verify(solution, proof=True), solution.seconds)
        seconds["verify"] += perf_counter() - start
    return solution, seconds


def _answer(key: str, solution: Solution) -> Row:
    certificate = solution.certificate
    return {
        "key": key,
        "status": solution.status.name,
        "message": solution.advice,
        "usable": solution.usable,
        "amount": _number(solution.amount),
        "lower_bound": _number(solution.lower_bound),
        "parameters": {name: _number(value) for name, value in solution.parameters.items()},
        "rho": None if solution.rho is None else solution.rho.tolist(),
        "pair": solution.pair.tolist(),
        "pair_gap": _number(solution.pair_gap),
        "pair_state": solution.pair_state,
        "features": [feature.label for feature in solution.features],
        "active": list(solution.active),
        "stage": solution.stage,
        "modelled": dict(solution.modelled),
        "checks_failed": [check.name for check in certificate.failed] if certificate else [],
    }


def _number(value: float) -> float | None:
    """Return a plain number, None for nan; infinite bounds of what is infeasible stay infinite."""
    value = float(value)
    return None if math.isnan(value) else value


@contextmanager
def within(limit: float | None) -> Iterator[None]:
    """End this process where the block takes longer: a watch of the system's own, which works in compiled code too."""
    if limit is None:
        yield
        return
    faulthandler.dump_traceback_later(limit, exit=True, file=STDERR)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
