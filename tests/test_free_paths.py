"""A path that is free asks for less than a coherent one, so that its answer is never dearer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.motion import Motion, Rotation, Screw, Translation
from fcdm_opt.tolerance.solution import Status
from fcdm_opt.tolerance.stages import polar
from fcdm_opt.tolerance.task import Task

EXAMPLE = Path(__file__).parents[1] / "problems" / "example1.toml"
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


@pytest.mark.parametrize("tolerance", [0.02, 0.04, 0.045, 0.05])
def test_where_the_contact_ends_first_a_free_path_is_no_dearer(tolerance: float) -> None:
    """From 0.04 on the least motion stands at the end of a window of directions, that local searches miss."""
    asked = fo.load_problems(EXAMPLE)[1].changed(tolerance=tolerance)
    free, coherent = (fo.solve(asked.changed(path=path)) for path in ("free", "coherent"))
    assert free.usable
    assert coherent.usable
    assert free.lower_bound <= free.amount <= coherent.amount * (1.0 + EQUAL)


def test_of_random_hulls_free_paths_are_no_dearer() -> None:
    found = 0
    for number in range(64):
        asked = problem(number)
        coherent = fo.solve(asked)
        if not coherent.usable:
            continue
        free = fo.solve(asked.changed(path="free"))
        assert free.usable, number
        assert free.amount <= coherent.amount * (1.0 + EQUAL), number
        found += 1
    assert found > 30


def test_rays_of_a_free_path_are_no_dearer() -> None:
    """Where descent answers before, too: of one tracked feature and of two."""
    found = 0
    for number in range(2, 20):
        asked = problem(number)
        task = Task.of(asked)
        if not polar.suits(task):
            continue
        coherent, free = polar.polar(task), polar.polar(replace(task, coherent=False))
        if coherent is not None:
            assert coherent.q is not None
            assert free is not None
            assert free.q is not None
            assert task.amount(free.q) <= task.amount(coherent.q) * (1.0 + EQUAL), number
            found += 1
    assert found > 2


def test_a_ray_that_finds_nothing_leaves_a_free_path_to_other_stages() -> None:
    """Along a ray the contact may come back after it is lost: no rays, no proof."""
    asked = fo.load_problems(EXAMPLE)[1].changed(tolerance=0.06)
    task = Task.of(asked)
    assert polar.nothing(task)
    assert not polar.nothing(replace(task, coherent=False))
    assert fo.solve(asked).status is not Status.SOLVED
