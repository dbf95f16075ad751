"""`solve` without a word: the least motion, and a bound that shows it; what a bound reaches is the answer.

Motions that are known to do are checked by the fifteen axes of two boxes, which share nothing with the product.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

import fcdm_opt as fo
from fcdm_opt.problem.solution import Status
from fcdm_opt.proof.exclusion import _swollen

Boxes = list[tuple[tuple[float, ...], tuple[float, ...]]]

STEP: Boxes = [((0, 0, 0), (4, 3, 1)), ((0, 0, 1), (2, 3, 2))]
STAIR: Boxes = [((0, 0, 0), (6, 3, 1)), ((0, 0, 1), (4, 3, 2)), ((0, 0, 2), (2, 3, 3))]
ELL: Boxes = [((0, 0, 0), (3, 1, 1)), ((0, 0, 1), (1, 1, 3))]
PEG: Boxes = [((-0.95, -0.95, 0.1), (0.95, 0.95, 4.0))]
HOLE: Boxes = [
    ((-2, -2, 0), (-1, 2, 3)),
    ((1, -2, 0), (2, 2, 3)),
    ((-1, -2, 0), (1, -1, 3)),
    ((-1, 1, 0), (1, 2, 3)),
]
CUBE: Boxes = [((-1, -1, -1), (1, 1, 1))]


def shifted(boxes: Boxes, way: tuple[float, ...]) -> Boxes:
    return [(tuple(np.add(low, way)), tuple(np.add(high, way))) for low, high in boxes]


def corners(box: tuple[tuple[float, ...], tuple[float, ...]]) -> np.ndarray:
    return np.array(list(product(*zip(*box, strict=True))), dtype=float)


def body(boxes: Boxes, seed: Any = "centroid", name: str = "body") -> fo.Body:
    return fo.Body.from_parts([corners(box) for box in boxes], seed=seed, name=name)


def separation(one: np.ndarray, two: np.ndarray, turn: np.ndarray) -> float:
    """The largest gap along the axes that can part two boxes of given corners, the first turned by a matrix."""
    axes = [*np.eye(3), *turn.T, *(np.cross(a, b) for a in np.eye(3) for b in turn.T)]
    units = [axis / np.linalg.norm(axis) for axis in axes if np.linalg.norm(axis) > 1e-6]
    return max(max((two @ n).min() - (one @ n).max(), (one @ n).min() - (two @ n).max()) for n in units)


def gaps(
    problem: fo.Problem, movable: Boxes, others: list[tuple[Boxes, np.ndarray, float]], q: list[float]
) -> list[float]:
    """Separations of all boxes after a free motion: a shift, and a rotation vector about the seed."""
    turn, seed = Turn.from_rotvec(q[3:]).as_matrix(), problem.movable.seed
    own = [seed + np.array(q[:3]) + problem.target[0] * (corners(box) - seed) @ turn.T for box in movable]
    return [
        min(separation(x, about + scale * (corners(box) - about), turn) for x in own for box in boxes)
        for boxes, about, scale in others
    ]


KNOWN: dict[str, tuple[Boxes, Boxes, Boxes, Any, dict[str, Any], list[float]]] = {
    "a peg in its hole, both made smaller": (
        PEG,
        HOLE,
        [],
        (0.0, 0.0, 1.5),
        {"tolerance": 0.05, "requirement": "D", "goal": "touch"},
        [-0.0271077217355956, 0.0, 0.0, 0.0, 0.00891595915687427, -0.00434369468784018],
    ),
    "a step on a step beside a block": (
        shifted(STEP, (0.6, 0.5, 1.2)),
        STEP,
        [((2.19249, -1.027762, 3.724089), (4.071731, 0.603895, 5.559137))],
        "centroid",
        {"tolerance": 0.05, "requirement": "A", "goal": "clear"},
        [0.0, 0.178895256, 0.898984878, 0.0, 0.004089736846224983, 0.0],
    ),
    "a step over a step beside a block": (
        shifted(STEP, (1.3, 0.6, 2.3)),
        STEP,
        [((5.219143, 3.733525, 1.71434), (6.774157, 5.381104, 3.547666))],
        "centroid",
        {"tolerance": 0.05, "requirement": "D", "goal": "touch"},
        [0.0, 0.0, -0.2501366858830753, 0.0477370337969895, -0.05304114866332167, 0.0],
    ),
    "an angle beside a stair": (
        shifted(ELL, (3.3, 3.1, 2.6)),
        STAIR,
        [],
        "centroid",
        {"tolerance": 0.001, "requirement": "C", "goal": "touch"},
        [
            0.0,
            -0.10438175559554927,
            -0.48531672159218975,
            0.02381036328896711,
            -0.09943267688363995,
            0.02138609836829952,
        ],
    ),
    "a stair on a stair": (
        shifted(STAIR, (3.4, -0.1, 1.8)),
        STAIR,
        [],
        "centroid",
        {"tolerance": 0.001, "requirement": "C", "goal": "clear"},
        [0.0034049595985437484, 0.0, 0.1638657403, 0.0, 0.02077569359967867, 0.0],
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", KNOWN)
def test_a_free_motion_was_not_least(name: str) -> None:
    """Local programs of one way apart ended up to a fifth above a motion that is known to do."""
    movable, static, keep_out, seed, asked, q = KNOWN[name]
    problem = fo.Problem(
        body(movable), body(static, seed), motion=fo.Free(), keep_out=[body([box]) for box in keep_out], **asked
    )
    others = [(static, problem.static.seed, problem.target[1])]
    others += [([box], np.zeros(3), 1.0) for box in keep_out]
    first, *rest = gaps(problem, movable, others, q)
    assert abs(first) <= 1e-8
    assert min(rest, default=0.0) >= -1e-8
    known = float(np.linalg.norm(problem.weights * q))
    solution = fo.solve(problem)
    assert solution.usable
    assert solution.amount <= known * (1.0 + 1e-6)
    assert 0.0 < solution.lower_bound <= known * (1.0 + 1e-9)


@pytest.mark.parametrize("file", ["example1", "example2"])
def test_one_and_two_parameters_are_proved_to_one_percent(file: str) -> None:
    for problem in fo.load_problems(f"problems/{file}.toml"):
        solution = fo.solve(problem)
        assert solution.lower_bound >= 0.99 * solution.amount * (1.0 - 1e-12)
        assert solution.evidence is None
        assert not solution.doubt


@pytest.mark.slow
def test_where_the_origin_is_does_not_matter() -> None:
    """Ten thousand sizes off, amounts agree to 1e-9 of the size."""
    amounts = []
    for way in ((0.0, 0.0, 0.0), (4e4, -3e4, 2e4)):
        block = body(shifted([((2.2, -1.0, 3.7), (4.1, 0.6, 5.6))], way))
        movable, static = (body(shifted(own, way)) for own in (shifted(STEP, (0.6, 0.5, 1.2)), STEP))
        problem = fo.Problem(
            movable, static, tolerance=0.05, requirement="A", goal="clear", motion=fo.Free(), keep_out=[block]
        )
        amounts.append(fo.solve(problem).amount)
    assert amounts[0] == pytest.approx(amounts[1], abs=1e-9 * 5.0)


def test_what_lies_beyond_reach_is_proved_impossible_not_only_not_found() -> None:
    """A cube half a length above another, shifted along y and turned about z: their heights never meet."""
    above = body(shifted(CUBE, (0.3, 0.0, 2.5)), name="above")
    problem = fo.Problem(
        above, body(CUBE), target=(1.0, 1.0), goal="touch", motion=fo.Rotation("z") >> fo.Translation("y")
    )
    solution = fo.solve(problem, certify=True)
    assert solution.status is Status.INFEASIBLE
    assert math.isinf(solution.lower_bound)
    proof = [check for check in fo.verify(solution, proof=True).checks if check.name.startswith("proof")]
    assert proof
    assert all(check.passed for check in proof)


@pytest.mark.parametrize("more", [None, fo.Translation("z")])
def test_a_bound_that_no_evidence_was_kept_of_failed_where_its_proof_was_asked_for(more: fo.Motion | None) -> None:
    """A bar is turned onto a post: what is claimed of the smallest turn is shown anew, what is not so is refused."""
    posts = [*shifted(CUBE, (3.0, 2.0, 0.0)), *shifted(CUBE, (-3.0, 2.5, 0.0))]
    bar, post = body(np.array(CUBE) * [4.0, 0.5, 0.5], name="bar"), body(posts, name="posts")
    turn = fo.Rotation("z") if more is None else fo.Rotation("z") >> more
    problem = fo.Problem(bar, post, target=(1.0, 1.0), goal="touch", motion=turn)
    solution = fo.solve(problem)
    assert solution.evidence is None
    assert solution.gap < 0.02
    assert fo.verify(solution, proof=True).passed
    other = fo.solve(problem.changed(limits={"RZ": (-math.pi / 2.0, -0.1)}))
    assert other.amount > 1.01 * solution.amount
    forged = dataclasses.replace(other, problem=problem)
    assert [own.name for own in fo.verify(forged, proof=True).failed] == ["proof: lower bound"]


@pytest.mark.parametrize("way", [(0.4, 0.3, 0.2), (1.9, 1.9, 1.9), (2.1, 2.2, 0.0), (2.3, 2.2, 2.4)])
def test_a_clearance_from_a_cube_has_a_bound(way: tuple[float, ...]) -> None:
    """The distance of two cubes is |max(|x| - 2, 0)|; the least shift to a distance c by a fine search over x."""
    need = 0.5
    problem = fo.Problem(
        body(shifted(CUBE, way)),
        body(CUBE),
        target=(1.0, 1.0),
        goal="clear",
        clearance=need,
        motion=fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z"),
    )
    turned = Turn.random(4000, random_state=1).as_matrix()[:, :, 0]
    steps = np.linspace(0.0, 2.5, 251)[:, None, None] * np.abs(turned)  # outwards is shorter, by symmetry
    apart = np.linalg.norm(np.maximum(np.array(way) + steps - 2.0, 0.0), axis=2) >= need
    least = np.where(apart, np.linalg.norm(steps, axis=2), np.inf).min()  # a motion that does, 1e-2 above the least
    solution = fo.solve(problem)
    assert solution.usable
    assert solution.amount <= least * (1.0 + 1e-9)
    assert solution.lower_bound <= solution.amount
    assert solution.gap <= 1e-6
    assert solution.amount >= 0.98 * least
    if max(way) < 1.0:  # over the middle of a face
        assert solution.amount == pytest.approx(2.0 + need - max(way), rel=1e-9)
        assert solution.gap <= 1e-9


def test_quick_is_said_and_proves_nothing_it_does_not_know() -> None:
    (problem, *_) = fo.load_problems("problems/example1.toml")
    solution = fo.solve(problem, effort="quick")
    assert solution.usable
    assert solution.lower_bound == 0.0
    assert solution.doubt == "not proved least"
    assert solution.to_dict()["doubt"] == solution.doubt


@pytest.mark.parametrize(
    ("key", "how"),
    [
        ("effort", {"effort": "slow"}),
        ("effort", {"effort": "quick", "certify": True}),
        ("seconds", {"seconds": 0.0}),
        ("seconds", {"seconds": float("nan")}),
        ("seconds", {"seconds": "1"}),
        ("seconds", {"seconds": True}),
    ],
)
def test_efforts_that_are_none_are_refused(key: str, how: dict[str, Any]) -> None:
    (problem, *_) = fo.load_problems("problems/example1.toml")
    with pytest.raises(fo.InputError, match=key):
        fo.solve(problem, **how)


@pytest.mark.slow
def test_a_proof_ends_with_its_time(ticking: Iterator[int]) -> None:
    """Six parameters never close; the time given is kept to within one batch of cells."""
    movable, static, _, seed, asked, _ = KNOWN["a step on a step beside a block"]
    problem = fo.Problem(body(movable), body(static, seed), motion=fo.Free(), **asked)
    solution = fo.solve(problem, certify=True, seconds=1.0)
    assert next(ticking) < 10
    assert 0.0 < solution.lower_bound < solution.amount


@pytest.mark.parametrize("seed", range(6))
def test_swollen_parts_stay_within_what_is_nearer_than_the_clearance(seed: int) -> None:
    """Every vertex of a swollen hull is within the length of the hull: by the judge's library of distances."""
    import coal

    rng = np.random.default_rng(seed)
    (part,) = fo.Body.convex(rng.normal(size=(9, 3))).parts
    by = float(rng.uniform(0.01, 2.0))
    swollen = _swollen(part, part.vertices, by)
    points = coal.StdVec_Vec3s()
    for vertex in part.vertices:
        points.append(vertex)
    hull = coal.Convex.convexHull(points, True, "Qt")
    result, here = coal.DistanceResult(), coal.Transform3s()
    for vertex in swollen.vertices:
        away = coal.distance(
            hull, here, coal.Sphere(1e-9), coal.Transform3s(np.eye(3), vertex), coal.DistanceRequest(), result
        )
        assert away <= by * (1.0 + 1e-6)
        result.clear()
    assert len(swollen.vertices) > len(part.vertices)


@pytest.mark.parametrize("off", [0.02, 0.04])
def test_a_key_that_another_slot_grew_past_was_called_solved(off: float) -> None:
    """Slots that grow about a far seed move past the key: it would end in the next one."""
    fins: Boxes = [((x, -5, 0), (x + 1, 5, 10)) for x in range(0, 100, 4)]
    fins.append(((0, -5, -1), (97, 5, 0)))
    key: Boxes = [((85.5, -2.0, 1.0), (87.5, 2.0, 12.0))]
    problem = fo.Problem(
        body(key, "box"),
        body(fins, (0.0, 0.0, 0.0)),
        tolerance=(0.0, off),
        requirement="A",
        motion=fo.Translation("x"),
        goal="touch",
    )
    solution = fo.solve(problem)
    left = abs(solution.parameters["TX"] - 86.5 * off) > 1.0  # of where the slot went
    assert (solution.status is Status.OUTSIDE_FIT) == left
