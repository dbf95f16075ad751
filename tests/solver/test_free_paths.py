"""A path that is free asks for less than a coherent one, so that its answer is never dearer; and what has no room."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.model.task import Task
from fcdm_opt.motion.motions import Motion, Rotation, Screw, Translation
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages import direction_search
from fcdm_opt.stages.branching import branch_and_bound

PROBLEMS = Path(__file__).parents[2] / "problems"
EXAMPLE, PEG = PROBLEMS / "example1.toml", PROBLEMS / "peg_square.toml"
EQUAL = 1e-9  # relative: what an answer may be dearer by
BOX = ((0.5, 2.5), (0.5, 2.5))
X, Y, Z = (Translation(axis) for axis in "xyz")
RX, RY, RZ = (Rotation(axis) for axis in "xyz")
MOTIONS: tuple[Motion, ...] = (Z, RZ, Z >> RZ, RX >> Y, RX >> RY, Screw("seeds"), X >> Y >> RZ, Z >> RX >> RY)


def hull(rng: np.random.Generator, centre: np.ndarray) -> fo.Body:
    """Twelve points on an ellipsoid, all of them corners."""
    points = rng.normal(size=(12, 3))
    return fo.Body.convex(centre + points / np.linalg.norm(points, axis=1)[:, None] * rng.uniform(0.7, 1.3, 3))


def problem(number: int) -> fo.Problem:
    """Two hulls whose nominal contact is a switching point, a motion, a goal and a pair state by its number."""
    rng = np.random.default_rng([83, number])
    while True:
        away = rng.normal(size=3)
        one, two = hull(rng, np.zeros(3)), hull(rng, away / np.linalg.norm(away) * rng.uniform(2.0, 3.5))
        if decision_curve(one, two, box=BOX).switching_points:
            break
    goal = ("beyond", "at")[number % 2]
    pair = str(rng.choice(["any", "clear", "touch"])) if goal == "beyond" else "any"
    return fo.Problem(one, two, nominal=1, tolerance=float(rng.choice([0.01, 0.02, 0.04])), box=BOX, goal=goal,
                      requirement="ABCD"[int(rng.integers(4))], motion=MOTIONS[number % len(MOTIONS)],
                      pair=pair)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [0.02, 0.04, 0.045])
def test_where_the_contact_ends_first_a_free_path_is_no_dearer(tolerance: float) -> None:
    """From 0.04 on the least motion stands at the end of a window of directions, that local searches miss."""
    asked = fo.load_problems(EXAMPLE)[1].changed(tolerance=tolerance)
    free, coherent = (fo.solve(asked.changed(path=path)) for path in ("free", "coherent"))
    assert free.usable
    assert coherent.usable
    assert free.lower_bound <= free.amount <= coherent.amount * (1.0 + EQUAL)


@pytest.mark.slow
def test_of_random_hulls_free_paths_are_no_dearer() -> None:
    found = 0
    for number in range(12):
        asked = problem(number)
        coherent = fo.solve(asked)
        if not coherent.usable:
            continue
        free = fo.solve(asked.changed(path="free"))
        assert free.usable, number
        assert free.amount <= coherent.amount * (1.0 + EQUAL), number
        found += 1
    assert found > 5


@pytest.mark.slow
@pytest.mark.parametrize("number", [10, 18, 36])
def test_rays_of_a_free_path_are_no_dearer(number: int) -> None:
    """Where descent answers before, too."""
    task = Task.of(problem(number).changed(pair="any"))
    coherent, free = (direction_search.least_direction(replace(task, coherent=own)) for own in (True, False))
    assert coherent is not None
    assert coherent.q is not None
    assert free is not None
    assert free.q is not None
    assert task.amount(free.q) <= task.amount(coherent.q) * (1.0 + EQUAL)


def test_where_no_direction_has_a_coherent_motion_none_is_found() -> None:
    asked = fo.load_problems(EXAMPLE)[1].changed(tolerance=0.06)
    assert direction_search.least_direction(Task.of(asked)) is None
    assert not fo.solve(asked).status.found


@pytest.mark.parametrize(("tolerance", "room"), [(0.0102, False), (0.0101, True)])
def test_a_peg_that_may_turn_has_the_room_of_the_closed_form(tolerance: float, room: bool) -> None:
    """A turn only makes the peg wider: it fits where S = 10 rho_2 - 9.75 rho_1 leaves the clearance."""
    asked = fo.load_problems(PEG)[4]
    assert (10.0 * (1.0 - tolerance) - 9.75 * (1.0 + tolerance) >= asked.clearance) == room
    solution = fo.solve(asked.changed(target=None, requirement="B", tolerance=tolerance, motion=X >> Y >> RZ,
                                      limits={"TX": (-1, 1), "TY": (-1, 1)}, published=None))  # fmt: skip
    assert solution.usable == room
    assert solution.status is (Status.SOLVED if room else Status.INFEASIBLE)


def test_that_nothing_is_possible_is_not_claimed_of_limits_with_room() -> None:
    """The proof that comes before the program, of tasks that descent solves: it must not end in that."""
    asked = fo.load_problems(PEG)[4].changed(motion=X >> Y >> RZ, limits={"TX": (-1, 1)}, published=None)
    assert branch_and_bound(Task.of(asked)) is None
