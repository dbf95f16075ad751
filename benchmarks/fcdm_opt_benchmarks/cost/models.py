"""What the models cost, scene by scene: the solver's own choice, each of its stages forced, and the full model.

Table "models", one row for each scene and model:

    scene, goal, parameters
                name, goal and number of motion parameters
    model       "auto", a stage's name, or "full"
    outcome     "settled"; "no motion" where the model says that there is none, or finds none; "refused" where a forced
                stage does not settle the scene; "over" where it ran over the limit; "crashed"
    reason      why it is not settled, or not verified
    stage       which stage settled it
    amount, verified
                of the motion, and whether the judge passed it
    difference  relative, of a verified amount to the least verified one of the scene
    variables, constraints
                of the program that the motion solves; limits of variables are no constraints
    part_pairs, part_pairs_total, features, features_total, keep_outs, keep_outs_total
                in that program, and all there are: features are pairs of elements, face and vertex or edge and edge
    seconds, low, high, rounds
                median and quartiles of the seconds of a whole `solve`, over rounds in which all models take turns
    build, solve, prove, verify
                parts of it: "build" of the first round, later ones find templates compiled; medians of the others

Models run in a process of their own, which is ended where it runs over the limit. The limit is a solve's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from time import perf_counter
from typing import Any

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.problem.problem import Problem
from fcdm_opt.solver import STAGES, solve
from fcdm_opt_benchmarks.cost.scenes import names, scene
from fcdm_opt_benchmarks.record import Row
from fcdm_opt_benchmarks.stability.process import CrashedError, HungError, Process

MODELS = ("auto", *STAGES)
ANSWERED = ("settled", "no motion")
COUNTS = ("part_pairs", "features", "keep_outs")
AGREE = 1e-6  # relative: verified amounts that differ by more are not of the same motion
LIMIT, QUICK_LIMIT = 6.0, 2.0  # seconds of one solve
ROUNDS, QUICK_ROUNDS = 5, 2
SLOW = 1.5  # seconds of a solve beyond which one round is enough
Say = Callable[[str], None]


def cost(problem: Problem, model: str) -> Row:
    """Solve a problem with one model and return what that cost, see the table's columns.

    Parameters
    ----------
    problem : Problem
    model : one of `MODELS`
    """
    start = perf_counter()
    try:
        solution = solve(problem, model=model)  # type: ignore[call-overload]
    except InputError as reason:
        if model not in STAGES:
            raise
        return {"outcome": "refused", "reason": reason.what, "seconds": perf_counter() - start}
    seconds, counts = perf_counter() - start, solution.modelled
    row: Row = {"outcome": "settled" if solution.status.found else "no motion", "stage": solution.stage}
    if not solution.usable:
        row["reason"] = solution.status.value
    if solution.status.found:
        row |= {"amount": solution.amount, "verified": solution.usable}
    row |= {name: counts[name] for name in ("variables", "constraints")}
    for name in COUNTS:
        row |= {name: counts[f"{name}_kept"], f"{name}_total": counts[f"{name}_total"]}
    return {**row, "seconds": seconds, **solution.seconds}


def costs(quick: bool, seed: int, progress: Say) -> list[Row]:
    """Return the table "models".

    Parameters
    ----------
    quick : bool
        A few scenes and rounds, ten seconds; else all, some minutes.
    seed : int
        Of the scenes drawn at random.
    progress : callable
        Gets a line before each scene.
    """
    rows: list[Row] = []
    limit, rounds = (QUICK_LIMIT, QUICK_ROUNDS) if quick else (LIMIT, ROUNDS)
    with _Apart(limit) as apart:
        for name in names(quick):
            progress(f"models: {name}")
            rows += _compared(apart, name, seed, rounds)
    return rows


def differing(rows: Sequence[Row]) -> list[Row]:
    """Return the rows whose verified amount is another one than the least verified one of the scene."""
    return [row for row in rows if row.get("difference") is not None and row["difference"] > AGREE]


def _compared(apart: _Apart, name: str, seed: int, rounds: int) -> list[Row]:
    """Return the rows of one scene: all models in turns, those that are slow or settle nothing once."""
    problem = scene(name, seed)
    labels = {"scene": name, "goal": problem.goal, "parameters": len(problem.motion.parameters)}
    found: dict[str, list[Row]] = {model: [] for model in MODELS}
    for _ in range(rounds):
        for model, own in found.items():
            if not own or (own[0]["outcome"] in ANSWERED and own[0]["seconds"] <= SLOW):
                own.append(apart.cost({"scene": name, "seed": seed}, model))
    rows = [{**labels, "model": model, **_median(own)} for model, own in found.items()]
    least = min((row["amount"] for row in rows if row.get("verified")), default=0.0)
    for row in rows:
        if row.get("verified"):
            row["difference"] = (row["amount"] - least) / least if least else row["amount"]
    return rows


def _median(rows: Sequence[Row]) -> Row:
    """Return the first of the rows of one model with the times of all."""
    first, *later = rows
    if first["outcome"] not in ANSWERED:
        return first
    others = [row for row in later if row["outcome"] in ANSWERED] or [first]
    times = [row["seconds"] for row in others]
    low, median, high = (float(x) for x in np.percentile(times, (25, 50, 75)))
    parts = {name: float(np.median([row[name] for row in others])) for name in ("solve", "prove", "verify")}
    return {**first, "seconds": median, "low": low, "high": high, "rounds": len(times), **parts}


# ------------------------------------------------------------------------------------------------- in a process apart


@cache
def _warmed() -> None:
    solve(scene(*EASY))


def _asked(data: Mapping[str, Any]) -> Row:
    """Answer what `_Apart` asks, in the worker; without a model the scene is drawn."""
    _warmed()
    problem = scene(data["scene"], data["seed"])
    return cost(problem, data["model"]) if "model" in data else {}


METHODS = {"cost": _asked}
EASY = "hull 12, 2 parameters", 0
"""What a worker solves before it is asked: kernels are loaded then."""


@dataclass(eq=False)
class _Apart:
    """A worker that solves, started again after each solve that it did not survive."""

    limit: float
    _process: Process | None = field(default=None)
    _drawn: Row = field(default_factory=dict)

    def __enter__(self) -> _Apart:
        return self

    def __exit__(self, *reason: object) -> None:
        self._end()

    def cost(self, drawn: Row, model: str) -> Row:
        """Return the costs of one solve of a scene that is drawn by name and seed."""
        start = perf_counter()
        try:
            process = self._ready(drawn)
            start = perf_counter()
            reply = process.ask({**drawn, "model": model})
        except HungError:
            self._end()
            return {"outcome": "over", "reason": f"over {self.limit:g} s", "seconds": self.limit}
        except CrashedError as reason:
            self._end()
            return {"outcome": "crashed", "reason": str(reason), "seconds": perf_counter() - start}
        if "answer" in reply:
            row: Row = reply["answer"]
            return row
        said = reply.get("flag") or reply.get("crash") or reply.get("missing")
        return {"outcome": "crashed", "reason": said, "seconds": perf_counter() - start}

    def _ready(self, drawn: Row) -> Process:
        """Return a worker that has drawn a scene; one that is new may take longer for that than the limit."""
        if self._process is not None and self._drawn != drawn:
            try:
                self._process.ask(drawn)
            except HungError:
                self._end()
        if self._process is None:
            self._process = Process(__name__, "cost", self.limit)
            self._process.ask(drawn)
        self._drawn = drawn
        return self._process

    def _end(self) -> None:
        if self._process is not None:
            self._process.close()
            self._process = None
