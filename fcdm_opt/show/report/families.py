"""Frames along the tolerance and along the motion, for sliders: from coarse to fine until the time is up."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.task import Task
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.solution import Solution
from fcdm_opt.show.report.frames import Frames
from fcdm_opt.show.solved import solved_again
from fcdm_opt.show.texts import motion_text, parameter_texts
from fcdm_opt.tolerances import DEFAULT

FACTORS = tuple(k / 10 for k in range(21))
"""Multiples of the tolerance: none, as asked, and up to twice as much."""

SHARES = tuple(k / 20 for k in range(31))
"""Shares of the motion: rest, whole, and half as far again."""

AS_ASKED = 1.0

LEAST = 5
"""Frames that a family has at least, whatever the time."""


def tolerance_family(frames: Frames, problem: Problem, solution: Solution, seconds: float) -> dict[str, Any] | None:
    """Return the frames of the same question for other tolerances, each solved anew and judged.

    All tolerances are multiplied by one factor; an explicit target moves along the straight line from the nominal
    pair. Factors that the problem does not allow are left out; None where the sizes made are the nominal ones.
    """
    if not (problem.target != problem.nominal_pair).any():
        return None
    refused: list[float] = []

    def frame(factor: float) -> dict[str, Any] | None:
        if factor == AS_ASKED:
            return frames.solved(solution)
        try:
            return frames.solved(solved_again(problem, effort="quick", **_resized(problem, factor)))
        except InputError:
            refused.append(factor)
            return None

    found, late = _refined(frame, FACTORS, seconds)
    notes = [f"at {factor:g} times the tolerance there is no such question" for factor in sorted(refused)]
    return {
        "label": "tolerance",
        "unit": "times as asked",
        **_listed(found, [_off(problem, factor) for factor in found]),
        "note": "; ".join([*notes, *late]),
    }


def _resized(problem: Problem, factor: float) -> dict[str, Any]:
    """Return what makes all tolerances, or the way from the nominal pair to the target, so many times as large."""
    if problem.tolerance is not None:
        return {"tolerance": tuple(map(tuple, (factor * problem.tolerance).tolist()))}
    return {"target": tuple(target_at(problem, factor).tolist())}


def target_at(problem: Problem, factor: float) -> Array:
    """Return the scales made at a multiple of the tolerance, (2,)."""
    return np.asarray(problem.nominal_pair + factor * (problem.target - problem.nominal_pair))


def _off(problem: Problem, factor: float) -> str:
    """Return how far both scales made are off the nominal ones: "+2 %, -2 %"."""
    off = target_at(problem, factor) / problem.nominal_pair - 1.0
    shown = [0.0 if abs(x) <= DEFAULT.nominal else 100.0 * x for x in off.tolist()]
    return ", ".join(f"{x:+.4g} %" if x else "0 %" for x in shown)


def motion_family(frames: Frames, solution: Solution, seconds: float) -> dict[str, Any] | None:
    """Return the frames along the straight way to the motion found: the parts made, and the tracked contact.

    None without a motion, and where it is none at all.
    """
    q = np.array(list(solution.parameters.values()))
    if solution.transform is None or not q.any():
        return None
    problem, task = solution.problem, Task.of(solution.problem)
    lost: list[float] = []

    def frame(share: float) -> dict[str, Any] | None:
        if share == AS_ASKED:
            return frames.solved(solution)
        here, transform = share * q, task.transform(share * q)
        if not np.isfinite(transform).all():  # a screw about a line that is gone there
            lost.append(share)
            return None
        values = dict(zip(solution.parameters, here.tolist(), strict=True))
        amount = task.amount(here)
        return frames.frame(
            solution.pair,
            transform,
            task.tracked_contact(here)[0] if problem.goal in TRACKING else solution.pair,
            motion=motion_text(replace(solution, parameters=values, amount=amount)),
            amount=amount,
            gap=task.gap(here),
            parameters=parameter_texts(problem, values),
            note=_limits_passed(problem, here),
        )

    found, late = _refined(frame, SHARES, seconds)
    return {
        "label": "share of the motion",
        "unit": "of the motion",
        **_listed(found, [f"{share:.0%}".replace("%", " %") for share in found]),
        "note": "; ".join([*(f"at {share:g} of the motion there is no pose" for share in sorted(lost)), *late]),
    }


def _limits_passed(problem: Problem, q: Array) -> str:
    """Tell which parameters are beyond their limits."""
    slack = DEFAULT.requirement * problem.length / problem.weights
    low, high = problem.limits.T
    beyond = (q < low - slack) | (q > high + slack)
    names = [parameter.name for parameter, passed in zip(problem.motion.parameters, beyond, strict=True) if passed]
    return f"beyond the limits of {', '.join(names)}" if names else ""


# ------------------------------------------------------------------------------------------------------ coarse to fine


def _refined(
    frame: Callable[[float], dict[str, Any] | None], values: Sequence[float], seconds: float
) -> tuple[dict[float, dict[str, Any]], list[str]]:
    """Return frames by value, increasing, and what to say where the time did not suffice for all."""
    end = perf_counter() + seconds
    frames: dict[float, dict[str, Any]] = {}
    asked = 0
    for value in _coarse_to_fine(values):
        if asked >= LEAST and perf_counter() > end:
            break
        asked += 1
        made = frame(value)
        if made is not None:
            frames[value] = made
    late = [f"{asked} of {len(values)} values: the others were left out for time"] if asked < len(values) else []
    return dict(sorted(frames.items())), late


def _coarse_to_fine(values: Sequence[float]) -> Iterator[float]:
    """Yield the value as asked and both ends, then always the one farthest from all before."""
    chosen = [AS_ASKED, values[0], values[-1]]
    yield from chosen
    left = [value for value in values if value not in chosen]
    while left:
        farthest = max(left, key=lambda value: (round(min(abs(value - before) for before in chosen), 9), -value))
        left.remove(farthest)
        chosen.append(farthest)
        yield farthest


def _listed(frames: dict[float, dict[str, Any]], shown: list[str]) -> dict[str, Any]:
    values = list(frames)
    start = values.index(AS_ASKED)
    return {"values": values, "shown": shown, "start": start, "frames": list(frames.values())}
