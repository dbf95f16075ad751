"""Frames along the tolerance and along the motion, for sliders; how many is decided by the problem, not by a clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import Any

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.task import Task
from fcdm_opt.model.true_faces import has_round_faces
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.solution import Solution
from fcdm_opt.show.report.frames import Frames
from fcdm_opt.show.texts import motion_text, parameter_texts
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT

FACTORS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5)
"""Multiples of the tolerance: none, as asked, and half as much again."""

SHARES = tuple(k / 20 for k in range(31))  # shares of the motion: rest, whole, and half as far again
AS_ASKED = 1.0

LOOKS, LEAST_LOOKS = 2000, 400
"""Looks at the time after which the search for a frame is given up, and with it larger tolerances: what is asked may
have no answer there. Of small bodies, some seconds; fewer of bodies with many corners, but for so many."""

LEAST, CORNERS, CASES = 3, 160, 4
"""Frames that a family has at least; corners of both bodies, and cases of a report, up to which it has all of them."""
ROUND = 0.3  # of these where round faces take part, for which each answer takes several times as long


def frames_of(problem: Problem, cases: int) -> float:
    """Return the share of its frames that a family has: fewer of round parts, of many corners, and of many cases."""
    if problem.partial:
        return 0.0
    share = ROUND if has_round_faces(problem) else 1.0
    return (
        share
        * min(1.0, CORNERS / (len(problem.movable.corners) + len(problem.static.corners)))
        * min(1.0, CASES / cases)
    )


def tolerance_family(frames: Frames, problem: Problem, solution: Solution, share: float) -> dict[str, Any] | None:
    """Return the frames of the same question for other tolerances, each solved anew and judged.

    All tolerances are multiplied by one factor; an explicit target moves along the straight line from the nominal
    pair. Factors that the problem does not allow are left out; None where the sizes made are the nominal ones. `share`
    of the frames, see `frames_of`; below 0 the answer's own alone.
    """
    if not (problem.target != problem.nominal_pair).any():
        return None

    def frame(factor: float) -> dict[str, Any] | None:
        if factor == AS_ASKED:
            return frames.solved(solution)
        if problem.tolerance is not None:
            changes: dict[str, Any] = {"tolerance": tuple(map(tuple, (factor * problem.tolerance).tolist()))}
        else:
            changes = {"target": tuple(target_at(problem, factor).tolist())}
        try:
            with pacing.looking(max(LEAST_LOOKS, int(LOOKS * frames_of(problem, 1)))):
                answer = pacing.in_time(partial(solve, effort="quick"), problem.changed(**changes), late=None)
        except InputError:
            return None
        if answer is None:
            raise pacing.TimeOverError
        return frames.solved(answer)

    def shown(factor: float) -> str:
        """Return how far both scales made are off the nominal ones: "+2 %, -2 %"."""
        off = target_at(problem, factor) / problem.nominal_pair - 1.0
        return ", ".join("0 %" if abs(x) <= DEFAULT.nominal else f"{100.0 * x:+.4g} %" for x in off.tolist())

    none = "at {:g} times the tolerance there is no such question"
    return _family(frame, FACTORS, share, shown, none, label="tolerance", unit="times as asked")


def target_at(problem: Problem, factor: float) -> Array:
    """Return the scales made at a multiple of the tolerance, (2,)."""
    return np.asarray(problem.nominal_pair + factor * (problem.target - problem.nominal_pair))


def motion_family(frames: Frames, solution: Solution, share: float) -> dict[str, Any] | None:
    """Return the frames along the straight way to the motion found: the parts made, and the tracked contact.

    None without a motion to use, and where it is none at all.
    """
    q = np.array(list(solution.parameters.values()))
    if not (solution.usable and q.any()):
        return None
    problem, task = solution.problem.reformulated, Task.of(solution.problem)
    low, high = problem.limits.T
    slack = DEFAULT.requirement * problem.length / problem.weights

    def frame(part: float) -> dict[str, Any] | None:
        if part == AS_ASKED:
            return frames.solved(solution)
        here, transform = part * q, task.transform(part * q)
        if not np.isfinite(transform).all():  # a screw about a line that is gone there
            return None
        values = dict(zip(solution.parameters, here.tolist(), strict=True))
        amount = task.amount(here)
        passed = zip(solution.parameters, (here < low - slack) | (here > high + slack), strict=True)
        beyond = ", ".join(name for name, off in passed if off)
        return frames.frame(
            solution.pair,
            transform,
            task.tracked_contact(here)[0] if problem.goal in TRACKING else solution.pair,
            motion=motion_text(replace(solution, parameters=values, amount=amount)),
            amount=amount,
            gap=task.gap(here),
            parameters=parameter_texts(problem, values),
            note=f"beyond the limits of {beyond}" if beyond else "",
        )

    return _family(
        frame, SHARES, share, lambda part: f"{100.0 * part:.0f} %", "at {:g} of the motion there is no pose",
        label="share of the motion", unit="of the motion",
    )  # fmt: skip


def _family(
    frame: Callable[[float], dict[str, Any] | None],
    values: Sequence[float],
    share: float,
    shown: Callable[[float], str],
    none: str,
    **names: str,
) -> dict[str, Any]:
    """Return the frames by value, increasing, with what to say where there is none or the search was given up."""
    count = max(LEAST, int(share * len(values))) if share >= 0.0 else 1
    frames: dict[float, dict[str, Any]] = {}
    refused: list[float] = []
    ends = [-np.inf, np.inf]  # from which values on, to either side, no answer is found soon
    chosen = list(islice(_coarse_to_fine(values), count))
    for value in chosen:
        if not ends[0] < value < ends[1]:
            continue
        try:
            made = frame(value)
        except pacing.TimeOverError:
            ends[value > AS_ASKED] = value
            continue
        if made is None:
            refused.append(value)
        else:
            frames[value] = made
    found = sorted(frames)
    why = "the time given is nearly over" if share < 0.0 else "more take long, of many corners or many cases"
    fewer = [f"{count} of {len(values)} values: {why}"] if count < len(values) else []
    cut = " left out: the search for an answer there is too long"
    late = [f"{shown(end)} and {'more' if end > AS_ASKED else 'less'}{cut}" for end in ends if np.isfinite(end)]
    return {
        **names,
        "values": found,
        "shown": list(map(shown, found)),
        "start": found.index(AS_ASKED),
        "frames": [frames[value] for value in found],
        "note": "; ".join([*map(none.format, sorted(refused)), *late, *fewer]),
    }


def _coarse_to_fine(values: Sequence[float]) -> Iterator[float]:
    """Yield the value as asked and both ends, then always the one farthest from all before."""
    chosen = [AS_ASKED, values[0], values[-1]]
    yield from chosen
    remaining = [value for value in values if value not in chosen]
    while remaining:
        farthest = max(remaining, key=lambda value: (round(min(abs(value - before) for before in chosen), 9), -value))
        remaining.remove(farthest)
        chosen.append(farthest)
        yield farthest
