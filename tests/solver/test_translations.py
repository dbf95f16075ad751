"""Several translations: the least shift, against all candidates that boxes with parallel sides leave."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import nnls
from scipy.spatial import ConvexHull
from strategies import generators, runs

import fcdm_opt as fo
from fcdm_opt.model.task import Task
from fcdm_opt.stages import best_first
from fcdm_opt.stages.contact_system import System, least
from fcdm_opt_benchmarks.motions.upright import least_shift as least_shift_of_prisms
from fcdm_opt_benchmarks.pairs import lattice_prism

AXES = "xyz"


def corners(low: Any, high: Any) -> np.ndarray:
    return np.array(list(product(*zip(low, high, strict=True))), dtype=float)


def random_box(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    low = rng.integers(-6, 6, 3).astype(float)
    return low, low + rng.integers(1, 6, 3)


def least_shift(moving: Any, fixed: list[Any], others: list[Any], axes: str, touch: bool) -> float | None:
    """The least shift of all that end at a side of some box, or do not move, along each axis."""
    low, high = moving
    places = [sorted({0.0, *(x for a, b in fixed + others for x in (a[k] - high[k], b[k] - low[k]))}) for k in range(3)]
    places = [own if AXES[k] in axes else [0.0] for k, own in enumerate(places)]
    best = None
    for t in product(*places):
        a, b = low + t, high + t
        if any((a < q).all() and (b > p).all() for p, q in fixed + others):
            continue
        if touch and not any((a <= q).all() and (b >= p).all() for p, q in fixed):
            continue
        best = min(float(np.linalg.norm(t)), np.inf if best is None else best)
    return best


@runs(30)
@given(generators, st.sampled_from(["xy", "yz", "xyz"]), st.sampled_from(["touch", "clear"]))
def test_the_least_shift_of_boxes_is_found(rng, axes, goal):
    moving, fixed = random_box(rng), [random_box(rng) for _ in range(int(rng.integers(1, 3)))]
    others = [random_box(rng) for _ in range(int(rng.integers(0, 3)))]
    motion = fo.Translation(axes[0])
    for axis in axes[1:]:
        motion = motion >> fo.Translation(axis)
    problem = fo.Problem(
        fo.Body.convex(corners(*moving), name="block"),
        fo.Body.from_parts([corners(*own) for own in fixed], seed=(0, 0, 0), name="stop"),
        nominal=(1.0, 1.0),
        target=(1.0, 1.0),
        goal=goal,
        motion=motion,
        keep_out=[fo.KeepOut(fo.Body.convex(corners(*own)), name=f"no {k}") for k, own in enumerate(others)],
    )
    least, solution = least_shift(moving, fixed, others, axes, goal == "touch"), fo.solve(problem)
    if least is None:
        assert solution.status is fo.Status.INFEASIBLE
        return
    assert solution.usable
    assert solution.amount == pytest.approx(least, abs=1e-9)
    assert solution.lower_bound == pytest.approx(least, abs=1e-9)


def test_limits_that_leave_no_place_are_proved():
    cube = corners((-1, -1, -1), (1, 1, 1))
    wall = corners((-5, -5, -1.5), (5, 5, 0.5))
    asked = fo.Problem(
        fo.Body.convex(cube),
        fo.Body.convex(wall),
        target=(1.0, 1.0),
        nominal=(1.0, 1.0),
        goal="clear",
        motion=fo.Translation("x") >> fo.Translation("z"),
        limits={"TX": (-1, 1), "TZ": (-0.5, 1.4)},
    )
    solution = fo.solve(asked)
    assert solution.status is fo.Status.INFEASIBLE
    assert solution.stage.startswith("1: translations")
    wider = fo.solve(asked.changed(limits={"TX": (-1, 1), "TZ": (-0.5, 1.6)}))
    assert wider.parameters == pytest.approx({"TX": 0.0, "TZ": 1.5})


def test_weights_choose_the_cheaper_way_out():
    cube, post = corners((-1, -1, -1), (1, 1, 1)), corners((0.5, -9, 0.2), (9, 9, 9))

    def solved(**weights: float) -> dict[str, float]:
        motion = fo.Translation("x") >> fo.Translation("z")
        asked = fo.Problem(
            fo.Body.convex(cube), fo.Body.convex(post), target=(1.0, 1.0), goal="clear", motion=motion, weights=weights
        )
        return dict(fo.solve(asked).parameters)

    assert solved() == pytest.approx({"TX": -0.5, "TZ": 0.0})
    assert solved(TX=2.0) == pytest.approx({"TX": 0.0, "TZ": -0.8})


def test_a_clearance_round_a_corner_is_a_distance():
    """Past the edge of a block the least way keeps the distance from the edge, not from the planes of its sides."""
    cube = corners((-1, -1, -1), (1, 1, 1))
    block = corners((1.2, -9, 1.3), (9, 9, 9))
    asked = fo.Problem(
        fo.Body.convex(cube),
        fo.Body.convex(block),
        target=(1.0, 1.0),
        goal="clear",
        clearance=1.0,
        motion=fo.Translation("x") >> fo.Translation("z"),
    )
    solution = fo.solve(asked)
    assert solution.usable
    # from (0.2, 0.3), the way between the edges, straight on to distance 1
    assert solution.amount == pytest.approx(1.0 - np.hypot(0.2, 0.3), abs=1e-9)
    assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-8)
    assert solution.stage.startswith("1: translations")


@pytest.mark.parametrize("number", range(4))
def test_a_clearance_of_hulls_is_exact(number):
    """The least way out of what is nearer than the clearance to the hull of all differences, by directions from it.

    Of bodies that are apart the way goes straight on from the nearest point: what is missing is what the shift is.
    """
    rng = np.random.default_rng(number)
    one, two = rng.normal(size=(2, 20, 3))
    two = two + np.array([4.0, 1.0, 2.0])
    asked = fo.Problem(
        fo.Body.convex(one),
        fo.Body.convex(two),
        target=(1.0, 1.0),
        goal="clear",
        clearance=3.0,
        motion=fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z"),
    )
    solution = fo.solve(asked)
    planes = ConvexHull((two[:, None] - one[None]).reshape(-1, 3)).equations
    system = np.vstack([-planes[:, :3].T, planes[:, 3]])
    residual = np.append(np.zeros(3), 1.0) - system @ nnls(system, np.array([0.0, 0.0, 0.0, 1.0]))[0]
    distance = np.linalg.norm(residual[:3] / residual[3])
    assert 0.1 < distance < 3.0
    assert solution.usable
    assert solution.amount == pytest.approx(3.0 - distance, abs=1e-8)
    assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-8)


def test_the_search_of_several_contacts_takes_no_keep_out_for_the_part_to_touch():
    """The cube has 1 to the keep-out beside it, and 4 to the other part; also where several tasks are met at once."""
    post = fo.KeepOut(fo.Body.convex(corners((2, -9, -9), (3, 9, 9))))
    asked = fo.Problem(
        fo.Body.convex(corners((-1, -1, -1), (1, 1, 1))),
        fo.Body.convex(corners((-1, 5, -1), (1, 7, 1))),
        target=(1.0, 1.0),
        goal="touch",
        keep_out=(post,),
        motion=fo.Translation("x") >> fo.Translation("y"),
    )
    task = Task.of(asked)
    for systems in ([System.of(task)], [System.of(task)] * 2):
        z, bound = least(systems)
        assert z is not None
        np.testing.assert_allclose(systems[0].q(z), [0.0, 4.0], atol=1e-12)
        assert bound * task.size == pytest.approx(4.0)
    assert fo.solve(asked).lower_bound == pytest.approx(4.0)


def test_too_many_ways_are_left_to_the_program(monkeypatch):
    monkeypatch.setattr(best_first, "MOST_CHOICES", 3)
    post, other = corners((0.5, -9, 0.2), (9, 9, 0.4)), corners((0.7, -9, 0.4), (9, 9, 9))
    asked = fo.Problem(
        fo.Body.convex(corners((-1, -1, -1), (1, 1, 1))),
        fo.Body.from_parts([post, other]),
        target=(1.0, 1.0),
        goal="clear",
        motion=fo.Translation("x") >> fo.Translation("z"),
    )
    solution = fo.solve(asked)
    assert solution.stage.startswith("4")
    assert solution.amount == pytest.approx(0.5)


@pytest.mark.parametrize("number", range(4))
def test_one_pair_of_many_faces_is_settled(number):
    """Against the hull of all differences of vertices: nearest facet from inside, nearest point from outside."""
    rng = np.random.default_rng(number)
    apart, low = number == 2, -0.01 if number == 3 else -np.inf
    one, two = (own / np.linalg.norm(own, axis=1)[:, None] for own in rng.normal(size=(2, 60, 3)))
    two = two + np.array([0.9, 1.1, -0.6]) * (2.0 if apart else 1.0)
    weights = np.array([1.0, 2.0, 0.5])
    planes = ConvexHull((two[:, None] - one[None]).reshape(-1, 3) * weights).equations
    assert (planes[:, 3].max() > 0) == apart
    if apart:  # the nearest point y of a convex set n.y <= -d
        system = np.vstack([-planes[:, :3].T, planes[:, 3]])
        residual = np.append(np.zeros(3), 1.0) - system @ nnls(system, np.array([0.0, 0.0, 0.0, 1.0]))[0]
        least = float(np.linalg.norm(residual[:3] / residual[3]))
    else:
        x = -planes[:, 3:] * planes[:, :3]
        held = x[:, 0] < low  # the nearest point of the facet's plane on the limit
        across = np.linalg.norm(planes[:, 1:3], axis=1)
        beside = np.hypot(low, (-planes[:, 3] - planes[:, 0] * low) / across) if held.any() else np.inf
        least = float(np.where(held, beside, np.linalg.norm(x, axis=1)).min())
    solutions = [
        fo.solve(
            fo.Problem(
                fo.Body.convex(one),
                fo.Body.convex(two),
                target=(1.0, 1.0),
                goal=goal,
                motion=fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z"),
                weights=dict(zip(("TX", "TY", "TZ"), weights.tolist(), strict=True)),
                limits={"TX": (low, np.inf)},
            ),
            certify=True,
        )
        for goal in (("touch",) if apart else ("touch", "clear"))
    ]
    for solution in solutions:
        assert solution.usable
        assert solution.stage.startswith("1")
        assert solution.amount == pytest.approx(least, rel=1e-12)
        assert solution.lower_bound == solution.amount


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("count", "axes"),
    [
        (8, "xyz"), (8, "slanted"), (24, "xyz"), (24, "slanted"), (100, "slanted"),
        pytest.param(400, "xyz", marks=pytest.mark.slow),
    ],
)
def test_prisms_whose_faces_are_all_parallel_are_shifted_by_the_rational_least(count, axes):
    """Flush on faces, along edges and at corners; parts of 400 corners are too large for the judge to try all edges."""
    rng = np.random.default_rng([count, len(axes)])
    motion = fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z")
    for ways in ((3, 0, 0), (0, 2, 1), (1, 1, 1), (1, 0, 1)):
        one, two = (lattice_prism(rng, count) for _ in range(2))
        reach = (np.ptp(one, axis=0) + np.ptp(two, axis=0)) / 2
        bodies = [fo.Body.convex(own, seed="box") for own in (one, two + reach * ways)]
        if axes == "slanted":
            motion = fo.Translation((reach * ways + (0.25, 0.125, 0.5)).tolist())
        for target, goal in (((0.75, 0.875), "touch"), ((1.5, 1.25), "touch"), ((1.5, 1.25), "clear")):
            problem = fo.Problem(*bodies, motion=motion, goal=goal, target=target, nominal=(1.0, 1.0))
            least, solution = least_shift_of_prisms(problem), fo.solve(problem)
            assert least is not None
            assert solution.status.name == ("SOLVED" if least else "ALREADY_SATISFIED"), (ways, target, goal)
            assert solution.amount == pytest.approx(least, rel=1e-11)
