"""The measured methods trace the exact curve within what they claim."""

from __future__ import annotations

import sys
from fractions import Fraction
from importlib.util import find_spec
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from cases import CUBE, EXAMPLE_1, Shape, exact, shape, union
from curve_checks import ODD_BOX
from oracles import Pair as ExactPair
from strategies import random_pair, random_pose

from fcdm_opt.errors import FcdmError
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.curves import METHODS
from fcdm_opt_benchmarks.method import CurveAnswer, CurveQuestion, Failure, Method, Pair
from fcdm_opt_benchmarks.pairs import DrawnPair
from fcdm_opt_benchmarks.references import curve_error, exact_curve_in_box, touching_right

LIBRARIES = {"coal": "coal", "HiGHS": "highspy", "Clarabel": "cvxpy"}
SAMPLED = "coal bisection"
# what the finest setting leaves along rays; samples are on the curve, nothing is claimed in between
CLAIMED = {"Clarabel": DEFAULT.snap, "coal": 1e-9, "growth distance": DEFAULT.nominal, "HiGHS": DEFAULT.nominal}


def marked(methods: Any) -> list[Any]:
    """Methods as parameters of tests, left out where their library is not installed."""
    made = []
    for method in methods:
        gone = find_spec(LIBRARIES.get(method.family, "numpy")) is None
        made.append(pytest.param(method, id=method.name, marks=pytest.mark.skipif(gone, reason="not installed")))
    return made


EVERY = marked(METHODS)
BREAKPOINTS = marked(method for method in METHODS if method.name != SAMPLED)
IDENTITY = np.eye(4)


def finest(method: Method, pair: Pair) -> Any:
    return method.prepare(pair, list(method.settings.values())[-1])


def answered(method: Method, one: Shape, two: Shape, box: Any = ODD_BOX, pose: Any = IDENTITY) -> Any:
    (answer,) = finest(method, Pair(one.body("one"), two.body("two")))([CurveQuestion(pose, np.array(box))])
    return answer


def check(method: Method, answer: CurveAnswer | Failure, pair: ExactPair, box: Any = ODD_BOX) -> None:
    """Every point is on the oracle's curve and in the box; every exact corner and end on the polyline."""
    assert isinstance(answer, CurveAnswer), answer
    assert (np.diff(answer.points[:, 0]) > 0).all()
    claimed = CLAIMED.get(method.family, DEFAULT.line)
    for k, rho in enumerate(answer.points):
        if method.name != SAMPLED or 0 < k < len(answer.points) - 1:  # its ends are on chords
            assert abs(error_along_ray(pair, rho)) <= claimed
        assert all(low * (1 - 1e-12) <= x <= high * (1 + 1e-12) for x, (low, high) in zip(rho, box, strict=True))
    if method.name != SAMPLED:
        corners = [np.array(rho, dtype=float) for rho, _ in pair.corners(box)]
        assert all(error_of_polyline(answer.points, corner) <= claimed for corner in corners)


def error_along_ray(pair: ExactPair, rho: Any) -> float:
    """How far beyond the exact curve a scale pair lies, relative to its distance from (0, 0); seeds inside."""
    x, y = (Fraction(float(r)) for r in rho)
    return float(max(Fraction(f.line[2]) / (f.line[0] * x + f.line[1] * y) for f in pair.facets) - 1)


def error_of_polyline(points: np.ndarray, rho: np.ndarray) -> float:
    """How far a scale pair lies from a polyline along its ray, relatively; infinite where the ray misses it."""
    errors = [np.inf]
    for start, end in pairwise(points):
        if np.cross([*start, 0], [*rho, 0])[2] * np.cross([*rho, 0], [*end, 0])[2] >= 0:
            errors.append(abs(np.linalg.solve(np.array([start, end]).T, rho).sum() - 1))
    return min(errors)


@pytest.mark.sampled(9)
@pytest.mark.parametrize("method", EVERY)
@pytest.mark.parametrize("reach", [3, 1000])
def test_method_traces_the_exact_curve(method: Method, reach: int) -> None:
    rng = np.random.default_rng([reach, 5])
    drawn = 0
    for _ in range(3):
        one, two = random_pair(rng, reach)
        if not exact(one, two).pieces(ODD_BOX):
            continue
        answer = answered(method, one, two)
        check(method, answer, exact(one, two).pair)
        drawn += isinstance(answer, CurveAnswer) and len(answer.points) > 1
    assert drawn >= 2


@pytest.mark.parametrize("method", EVERY)
def test_method_moves_body_1(method: Method) -> None:
    rng = np.random.default_rng(11)
    one, two = random_pair(rng, 10)
    two = two.shifted((20, 0, 0))
    poses = [random_pose(rng, 3) for _ in range(3)]
    answers = finest(method, Pair(one.body(), two.body()))([CurveQuestion(pose, np.array(ODD_BOX)) for pose in poses])
    for pose, answer in zip(poses, answers, strict=True):
        assert len(answer.points) > 1
        check(method, answer, exact(one, two, pose).pair)


@pytest.mark.parametrize("method", BREAKPOINTS)
def test_breakpoints_of_the_paper(method: Method) -> None:
    box = ((0.8, 3.0), (0.8, 3.0))
    answer = answered(method, EXAMPLE_1.one, EXAMPLE_1.two, box)
    corners = [rho for rho, _ in exact(EXAMPLE_1.one, EXAMPLE_1.two).pair.corners(box)]
    np.testing.assert_allclose(answer.points[1:-1], np.array(corners, dtype=float), rtol=1e-6)


@pytest.mark.parametrize("method", EVERY)
def test_one_line(method: Method) -> None:
    """Two cubes face to face touch where rho_1 + rho_2 = 4: a line from border to border."""
    answer = answered(method, CUBE, CUBE.shifted((4, 0, 0)), ((0.5, 2.5), (1.0, 3.0)))
    np.testing.assert_allclose(answer.points.sum(axis=1), 4, rtol=1e-9)
    np.testing.assert_allclose(answer.points[[0, -1]], [[1, 3], [2.5, 1.5]], rtol=1e-6)
    if method.name != SAMPLED:
        assert len(answer.points) == 2


@pytest.mark.parametrize("method", EVERY)
@pytest.mark.parametrize("box", [((0.1, 1.0), (0.1, 1.0)), ((5.0, 6.0), (5.0, 6.0))], ids=["apart", "overlapping"])
def test_no_curve_in_the_box(method: Method, box: Any) -> None:
    assert answered(method, CUBE, CUBE.shifted((4, 0, 0)), box).points.shape == (0, 2)


@pytest.mark.parametrize("method", [m for m in EVERY if m.values[0].ours])
def test_boxes_of_one_call_may_differ(method: Method) -> None:
    drawn = DrawnPair.of(4, 8)
    boxes = [drawn.box, np.array([[0.9, 1.9], [0.9, 2.9]])]
    questions = [CurveQuestion(drawn.curve(k).transform, box) for k in range(2) for box in boxes]
    together, alone = finest(method, drawn.pair)(questions), finest(method, drawn.pair)
    for question, answer in zip(questions, together, strict=True):
        np.testing.assert_allclose(answer.points, alone([question])[0].points, rtol=DEFAULT.line)


@pytest.mark.parametrize("shape", ["round", "flat", "prism", "aligned"])
@pytest.mark.parametrize("separation", ["near", "far"])
def test_our_methods_are_right_to_the_last_digits(shape: str, separation: str) -> None:
    drawn = DrawnPair.of(5, 8, shape, separation)
    questions = [drawn.curve(k) for k in range(5)]
    references = [exact_curve_in_box(drawn.pair, question) for question in questions]
    named = 0
    for method in METHODS:
        if not method.ours:
            continue
        for answer, reference in zip(finest(method, drawn.pair)(questions), references, strict=True):
            assert curve_error(answer, reference) <= 1e-14
            assert touching_right(answer, reference) is not False
            named += touching_right(answer, reference) is True
    assert named >= 10


def test_what_the_kernel_cannot_prove_is_exact() -> None:
    drawn = DrawnPair.of(5, 8, "aligned")
    question = drawn.curve(0)
    (kernel,) = (method for method in METHODS if method.name == "kernel")
    (answer,) = finest(kernel, drawn.pair)([question])
    np.testing.assert_array_equal(answer.points, exact_curve_in_box(drawn.pair, question).rounded)


def test_pairs_that_no_method_takes() -> None:
    far = CUBE.shifted((4, 0, 0)).body("far")
    outside = shape(CUBE.vertices, (3, 0, 0)).body("off")
    several = union(CUBE, CUBE.shifted((2, 0, 0)), seed=(0, 0, 0)).body("two")
    for method in METHODS:
        assert "need the seed inside" in str(method.refuses(Pair(outside, far)))
        assert "one convex part" in str(method.refuses(Pair(far, several)))
        assert method.refuses(Pair(far, far)) is None
    large = DrawnPair.of(1, 2000).pair
    refusing = {method.name for method in METHODS if method.refuses(large)}
    assert refusing == {"scipy linprog", "Clarabel (cvxpy)"}


@pytest.mark.parametrize("method", [m for m in EVERY if m.values[0].family in LIBRARIES and "scipy" not in m.id])
def test_missing_library_says_what_to_install(method: Method, monkeypatch: pytest.MonkeyPatch) -> None:
    name = LIBRARIES[method.family]
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(FcdmError, match=rf"needs {name}: pip install {name}"):
        finest(method, Pair(CUBE.body(), CUBE.shifted((4, 0, 0)).body()))
