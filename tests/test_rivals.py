"""The rival methods trace the exact curve within what they claim."""

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
from oracles import Pair
from strategies import random_pair, random_pose

from fcdm_opt.errors import FcdmError, InputError
from fcdm_opt.measure.rivals import RAYS, RIVALS, Rival, Trace

LIBRARIES = {"coal bisection": "coal", "highs": "highspy", "cvxpy": "cvxpy", "growth distances": "numpy"}
METHODS = [
    pytest.param(
        rival,
        id=name,
        marks=pytest.mark.skipif(
            find_spec(LIBRARIES[name]) is None, reason=f"{LIBRARIES[name]} is not installed: fcdm_opt[bench]"
        ),
    )
    for name, rival in RIVALS.items()
]


def error_along_ray(pair: Pair, rho: Any) -> float:
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


def check(trace: Trace, pair: Pair, box: Any = ODD_BOX) -> None:
    """Every point is on the exact curve and in the box, every exact corner on the polyline."""
    assert (np.diff(trace.points[:, 0]) > 0).all()
    for rho in trace.points:
        assert abs(error_along_ray(pair, rho)) <= trace.accuracy
        assert all(low * (1 - 1e-12) <= x <= high * (1 + 1e-12) for x, (low, high) in zip(rho, box, strict=True))
    corners = [np.array(rho, dtype=float) for rho, _ in pair.corners(box)]
    if trace.gives == "breakpoints":
        assert all(error_of_polyline(trace.points, corner) <= trace.accuracy for corner in corners)


@pytest.mark.parametrize("rival", METHODS)
@pytest.mark.parametrize("reach", [3, 10, 1000])
def test_rival_traces_the_exact_curve(rival: Rival, reach: int) -> None:
    rng = np.random.default_rng([reach, 5])
    drawn = 0
    for _ in range(8):
        one, two = random_pair(rng, reach)
        pair = exact(one, two).pair
        if not exact(one, two).pieces(ODD_BOX):
            continue
        trace = rival(one.body(), two.body(), box=ODD_BOX)
        check(trace, pair)
        drawn += len(trace.points) > 1
    assert drawn >= 4


@pytest.mark.parametrize("rival", METHODS)
def test_rival_moves_body_1(rival: Rival) -> None:
    rng = np.random.default_rng(11)
    one, two = random_pair(rng, 10)
    two = two.shifted((20, 0, 0))
    prepared = rival.prepare(one.body(), two.body())
    for _ in range(3):
        pose = random_pose(rng, 3)
        points, queries = prepared(pose, np.array(ODD_BOX))
        assert len(points) > 1
        assert queries > 1
        check(Trace(points, rival.gives, rival.accuracy, queries), exact(one, two, pose).pair)


@pytest.mark.parametrize("rival", [p for p in METHODS if p.values[0].gives == "breakpoints"])
def test_breakpoints_of_the_paper(rival: Rival) -> None:
    box = ((0.8, 3.0), (0.8, 3.0))
    trace = rival(EXAMPLE_1.one.body(), EXAMPLE_1.two.body(), box=box)
    corners = [rho for rho, _ in exact(EXAMPLE_1.one, EXAMPLE_1.two).pair.corners(box)]
    np.testing.assert_allclose(trace.points[1:-1], np.array(corners, dtype=float), rtol=1e-6)


@pytest.mark.parametrize("rival", METHODS)
def test_one_line(rival: Rival) -> None:
    """Two cubes face to face touch where rho_1 + rho_2 = 4: a line from border to border."""
    trace = rival(CUBE.body(), CUBE.shifted((4, 0, 0)).body(), box=((0.5, 2.5), (1.0, 3.0)))
    np.testing.assert_allclose(trace.points.sum(axis=1), 4, rtol=trace.accuracy)
    if trace.gives == "breakpoints":
        np.testing.assert_allclose(trace.points, [[1, 3], [2.5, 1.5]], rtol=1e-6)
        assert len(trace.points) == 2
    else:
        assert len(trace.points) > RAYS / 3


@pytest.mark.parametrize("rival", METHODS)
@pytest.mark.parametrize("box", [((0.1, 1.0), (0.1, 1.0)), ((5.0, 6.0), (5.0, 6.0))], ids=["apart", "overlapping"])
def test_no_curve_in_the_box(rival: Rival, box: Any) -> None:
    assert rival(CUBE.body(), CUBE.shifted((4, 0, 0)).body(), box=box).points.shape == (0, 2)


@pytest.mark.parametrize("rival", METHODS)
def test_bodies_that_no_rival_takes(rival: Rival) -> None:
    far = CUBE.shifted((4, 0, 0))
    outside: Shape = shape(CUBE.vertices, (3, 0, 0))
    with pytest.raises(InputError, match=r"'off'.*need the seed inside"):
        rival(outside.body("off"), far.body(), box=ODD_BOX)
    with pytest.raises(InputError, match=r"'two'.*one convex part"):
        rival(far.body(), union(CUBE, CUBE.shifted((2, 0, 0)), seed=(0, 0, 0)).body("two"), box=ODD_BOX)


@pytest.mark.parametrize("name", ["coal bisection", "highs", "cvxpy"])
def test_missing_library_says_what_to_install(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, LIBRARIES[name], None)
    with pytest.raises(FcdmError, match=rf"needs {LIBRARIES[name]}: pip install 'fcdm_opt\[bench\]'"):
        RIVALS[name](CUBE.body(), CUBE.shifted((4, 0, 0)).body(), box=ODD_BOX)
