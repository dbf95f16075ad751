"""The descent against the nonlinear program, against closed forms, and its parts against oracles of their own."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
import pytest
from scipy.optimize import nnls

from fcdm_opt.curve import kernels
from fcdm_opt.curve.coherence import contact_faults
from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.model.task import Task
from fcdm_opt.motion.instructions import pose_instructions
from fcdm_opt.motion.motions import Motion, Rotation, Screw, Translation
from fcdm_opt.problem.problem import Problem
from fcdm_opt.solver import solve
from fcdm_opt.stages import compiled, rays
from fcdm_opt.stages.descent import descent
from fcdm_opt.stages.rays import one_parameter
from fcdm_opt.stages.relaxation import nonlinear

X, Y, Z = (Translation(axis) for axis in "xyz")
RX, RY, RZ = (Rotation(axis) for axis in "xyz")
BOX = ((0.5, 2.5), (0.5, 2.5))
FAMILIES: dict[int, tuple[Motion, ...]] = {
    1: (Z, RZ, Screw("seeds", 0.5), Rotation((1.0, 1.0, 1.0), (0.5, -0.3, 0.2))),
    2: (Z >> RZ, Screw("seeds"), RX >> Y, RX >> RY),
    3: (X >> Y >> RZ, Z >> RX >> RY),
    6: (X >> Y >> Z >> RX >> RY >> RZ,),
}
CASES = [(goal, count, k) for goal in ("beyond", "at", "touch", "clear") for count in FAMILIES for k in range(3)]


def hull(rng: np.random.Generator, centre: np.ndarray) -> Body:
    """Twelve points on an ellipsoid, all of them corners."""
    points = rng.normal(size=(12, 3))
    return Body.convex(centre + points / np.linalg.norm(points, axis=1)[:, None] * rng.uniform(0.7, 1.3, 3))


@cache
def problem(goal: str, count: int, number: int) -> Problem:
    """Two hulls whose nominal contact is a switching point, or for all goals but "beyond" the longest segment."""
    rng = np.random.default_rng([51, count, number])
    while True:
        away = rng.normal(size=3)
        one, two = hull(rng, np.zeros(3)), hull(rng, away / np.linalg.norm(away) * rng.uniform(2.0, 3.5))
        curve = decision_curve(one, two, box=BOX)
        if curve.switching_points:
            break
    longest = max(curve.segments, key=lambda own: float(np.linalg.norm(own.end - own.start)))
    nominal = 1 if goal == "beyond" else tuple((longest.start + longest.end) / 2)
    return Problem(one, two, nominal=nominal, tolerance=0.02, requirement="ABCD"[number % 4],
                   motion=FAMILIES[count][number % len(FAMILIES[count])], box=BOX, goal=goal)  # fmt: skip


@cache
def both(goal: str, count: int, number: int) -> tuple[float, float] | None:
    """Amounts of the descent and of the program, infinite where there is none; None where nothing is to be done."""
    asked = problem(goal, count, number)
    if Task.of(asked).met_at_rest:
        return None
    amounts = []
    for stage in (descent, nonlinear):
        task = Task.of(asked)
        answer = stage(task)
        found = answer is not None and answer.q is not None
        assert not found or task.meets(answer.q, 1e-9)
        amounts.append(task.amount(answer.q) if found else np.inf)
    return amounts[0], amounts[1]


@pytest.mark.sampled(11)
@pytest.mark.parametrize(("goal", "count", "number"), CASES)
def test_the_descent_finds_no_more_than_the_program(goal, count, number):
    found = both(goal, count, number)
    assert found is None or found[0] <= found[1] * (1 + 1e-7)


@pytest.mark.slow
def test_most_of_these_cases_ask_for_a_motion_and_have_one():
    answers = [both(*case) for case in CASES]
    assert sum(found is not None and np.isfinite(found[0]) for found in answers) >= len(CASES) // 2


def test_where_the_descent_answers_the_program_does_not_run():
    solution = solve(problem("beyond", 6, 0))
    assert solution.stage.startswith("4: descent")
    assert solution.usable


def test_of_a_convex_body_that_shifts_the_end_of_the_path_tells_all():
    """Beyond the coherent range too: the faults at the end are those of all points of the path."""
    verdicts = []
    for number in range(12):
        asked, rng = problem("beyond", 1, number), np.random.default_rng(number)
        task = Task.of(asked.changed(motion=X >> Y >> Z))
        for size in (0.01, 0.1, 0.5):
            q = size * rng.normal(size=3)
            whole = []
            for s in np.linspace(1.0, 0.0, 33)[:-1]:
                rho, pose, tracked = task.tracked_contact(q, float(s))
                slack = 1e-10 * task.size
                whole.append(bool(contact_faults(asked.movable, asked.static, pose, rho, tracked, slack)))
            verdicts.append(whole[0])
            assert any(whole) == bool(task.path_faults(q, first=True)) == whole[0]
    assert 5 < sum(verdicts) < len(verdicts) - 5


@pytest.mark.parametrize("number", range(8))
def test_the_first_contact_does_not_depend_on_the_way_that_is_gone_first(number, monkeypatch):
    asked = problem("touch", 1, number)
    if not rays.is_steady(Task.of(asked), np.ones(1)) or Task.of(asked).met_at_rest:
        pytest.skip("another stage")
    found = []
    for forwards in (True, False):
        monkeypatch.setattr(rays, "leads_nearer", lambda task, direction, first=forwards: first)
        answer = one_parameter(Task.of(asked))
        found.append((answer.q.tolist(), answer.lower_bound))
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-11)
    np.testing.assert_allclose(found[0][1], found[1][1], rtol=1e-9)


@pytest.mark.parametrize("motion", [Z, RZ, Screw("seeds"), *FAMILIES[3], *FAMILIES[6]], ids=str)
def test_instructions_run_as_the_motion_does(motion):
    rng = np.random.default_rng(3)
    one, two, k = rng.normal(size=3), rng.normal(size=3), len(motion.parameters)
    own = pose_instructions(motion)
    q, flat, work = rng.uniform(-1, 1, k), np.empty(12 * (k + 1)), np.zeros(own.instructions.places)

    def pose(values: np.ndarray) -> np.ndarray:
        T = motion.transform(values, one, two)
        return np.append(T[:3, :3].ravel(), two - T[:3, :3] @ one - T[:3, 3])

    given = own.scaled(np.ones(k), one, two)[4]
    rows, constants = own.instructions.rows, own.instructions.constants
    compiled.run(rows, constants, work, q, given, flat, len(rows))
    np.testing.assert_allclose(flat[:12], pose(q), atol=1e-14)
    steps = 1e-6 * np.eye(k)
    slopes = [(pose(q + step) - pose(q - step)) / 2e-6 for step in steps]
    np.testing.assert_allclose(flat[12:].reshape(k, 12), slopes, atol=1e-8)
    start = np.empty_like(flat)
    compiled.run(rows, constants, work, q, given, start, own.short)
    np.testing.assert_array_equal(start[:12], flat[:12])  # the first instructions give the pose


@pytest.mark.parametrize("number", range(40))
def test_the_least_vector_in_half_spaces_is_that_of_non_negative_least_squares(number):
    rng = np.random.default_rng([4, number])
    k, count = int(rng.integers(1, 7)), int(rng.integers(1, 12))
    G, h = rng.normal(size=(count, k)), rng.normal(size=count)
    G /= np.linalg.norm(G, axis=1)[:, None]
    x, duals = np.empty(k), np.empty(count)
    found = compiled.nearest(G, h, np.zeros(count, dtype=bool), count, x, duals)
    goal = np.append(np.zeros(k), 1.0)
    weights, rest = nnls(np.vstack([G.T, h]), goal)
    assert found == (rest > 1e-9)
    if found:
        residual = np.vstack([G.T, h]) @ weights - goal
        np.testing.assert_allclose(x, -residual[:-1] / residual[-1], atol=1e-9)
        np.testing.assert_allclose(x, G.T @ duals, atol=1e-12)  # stationary, and complementary:
        np.testing.assert_allclose(duals * (G @ x - h), 0.0, atol=1e-10)
        assert duals.min() >= 0


def test_equalities_are_kept_whichever_side_they_are_met_from():
    G, h = np.array([[1.0, 0.0], [0.0, 1.0], [0.6, 0.8]]), np.array([-1.0, 2.0, 1.0])
    x, duals = np.empty(2), np.empty(3)
    assert compiled.nearest(G, h, np.array([True, True, False]), 3, x, duals)
    np.testing.assert_allclose(x, [-1.0, 2.0], atol=1e-14)
    assert duals.tolist() == pytest.approx([-1.0, 2.0, 0.0])
    assert not compiled.nearest(G, np.array([-1.0, 2.0, 5.0]), np.array([True, True, False]), 3, x, duals)


def test_rates_of_separations_are_what_differences_of_them_tell():
    task, q, step = Task.of(problem("touch", 6, 0)), np.array([0.3, -0.2, 0.1, 0.2, 0.3, -0.4]), 1e-6
    sites, rows, _ = task.separations((0, 0), task.pose(q))
    rates = dict(zip(map(tuple, sites.tolist()), task.gap_rates((0, 0), q, sites, rows[:, :3]), strict=True))
    expected = {site: np.zeros(6) for site in rates}
    for k, sign in product(range(6), (1.0, -1.0)):
        sites, _, gaps = task.separations((0, 0), task.pose(q + sign * step * np.eye(6)[k]))
        told = dict(zip(map(tuple, sites.tolist()), gaps.tolist(), strict=True))
        for site, slopes in expected.items():  # a site that is none there is not told
            slopes[k] += sign * told.get(site, np.nan) / (2.0 * step)
    known = [site for site, slopes in expected.items() if np.isfinite(slopes).all()]
    assert len(known) > 0.9 * len(rates)
    assert {site[0] for site in known} == {kernels.V1F2, kernels.F1V2, kernels.E1E2}
    np.testing.assert_allclose([rates[site] for site in known], [expected[site] for site in known], atol=1e-7)
