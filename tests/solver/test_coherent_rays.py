"""Least motions with two parameters whose coherent path ends before the least motion of its kind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.curve.coherence import contact_faults
from fcdm_opt.model.task import Task
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

EXAMPLE = Path(__file__).parents[2] / "problems" / "example1.toml"
CASES = {case.name: case for case in fo.load_problems(EXAMPLE)}
TOLERANCES = {  # before and beyond the tolerance from which on the least motion stands where coherence ends
    "B": (0.03, 0.034, 0.0355, 0.036, 0.037, 0.038, 0.039, 0.041, 0.043, 0.045, 0.047, 0.049, 0.051, 0.054, 0.056),
    "C": (0.005, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09),
}
WINDOW = 5e-4  # relative: how well motions at the end of a window, near parallel lines, are least


def asked(name: str, tolerance: float) -> Problem:
    return CASES[name].changed(tolerance=tolerance, published=None)


@pytest.mark.slow
@pytest.mark.parametrize("name", TOLERANCES)
def test_the_least_motion_grows_with_the_tolerance(name: str) -> None:
    """Beyond a larger target is beyond every smaller one."""
    solutions = [fo.solve(asked(name, tolerance)) for tolerance in TOLERANCES[name]]
    assert all(solution.usable for solution in solutions), [solution.status for solution in solutions]
    amounts = np.array([solution.amount for solution in solutions])
    assert (np.diff(amounts) > 0).all(), amounts


@pytest.mark.slow
@pytest.mark.parametrize(("name", "tolerance"), [("B", 0.036), ("B", 0.04), ("B", 0.05), ("C", 0.05)])
def test_a_proved_bound_is_near(name: str, tolerance: float) -> None:
    solution = fo.solve(asked(name, tolerance), certify=True)
    assert solution.usable
    assert (1.0 - WINDOW) * solution.amount <= solution.lower_bound <= solution.amount


@pytest.mark.slow
@pytest.mark.parametrize(("name", "tolerance"), [("B", 0.038), ("B", 0.05), ("C", 0.03)])
def test_no_direction_has_a_smaller_motion(name: str, tolerance: float) -> None:
    """By brute force: along each of many rays until the contact is lost, with the uncompiled test of the contact."""
    problem = asked(name, tolerance)
    task, amount = Task.of(problem), fo.solve(problem).amount
    smaller, looked = [], 0
    for angle in np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False) + 0.01:
        for share in np.linspace(0.0, 1.0 - WINDOW, 25)[1:]:
            q = share * amount * np.array([np.cos(angle), np.sin(angle)]) / task.weights
            rho, pose, tracked = task.tracked_contact(q)
            slack = DEFAULT.cut * task.size
            if not (rho > 0).all() or contact_faults(task.movable, task.static, pose, rho, tracked, slack):
                break
            looked += 1
            if ((rho - task.target) * task.signs >= 0).all():
                smaller.append((angle, share))
    assert looked > 100
    assert not smaller


def test_nothing_is_found_where_nothing_is() -> None:
    solution = fo.solve(asked("B", 0.06))
    assert not solution.status.found
    assert solution.lower_bound > CASES["B"].size
