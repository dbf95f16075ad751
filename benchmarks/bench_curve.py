"""The whole decision curve beside one distance query, and beside rival ways to the same curve.

    pytest benchmarks/bench_curve.py [--bench-out DIR] [--bench-seed N] [--bench-largest VERTICES]

Before every round of every contender, coal's distance is timed on the same pair and poses: ratios compare what ran
within the same milliseconds, whatever else the machine does. Both are run once untimed just before, so that neither
pays for what the other left in the caches.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from time import perf_counter
from typing import Any

import numpy as np
import pytest
from contenders import CONTENDERS, TIGHT, Contender, coal_distance, coal_distance_of_one_pose
from pairs import AXES, BOX, SIZES, RandomPair
from report import Results, Timing
from signs import Openings, integer_pairs, random_pairs

import fcdm_opt as fo
from fcdm_opt.measure.rivals import RIVALS

TIGHTER = 1e-15  # of coal, to see whether its answers at touch are a matter of settings
POSES = 500


@cache
def pair_of(seed: int, vertices: int, family: str) -> RandomPair:
    """Draw a pair once for all its contenders."""
    return RandomPair.of(seed, vertices, POSES, family)


@pytest.fixture
def pair(pytestconfig: pytest.Config, vertices: int, family: str) -> RandomPair:
    """Return the pair that a test asks for."""
    if vertices > pytestconfig.getoption("--bench-largest"):
        pytest.skip("larger than --bench-largest")
    return pair_of(pytestconfig.getoption("--bench-seed"), vertices, family)


@pytest.mark.parametrize(
    ("contender", "family", "vertices"),
    [
        pytest.param(contender, family, vertices, id=f"{contender.name}-{family}-{vertices}")
        for family in AXES
        for vertices in SIZES
        for contender in CONTENDERS
        if vertices in contender.sizes and family in contender.families
    ],
)
def test_time(
    benchmark: Any, results: Results, contender: Contender, family: str, vertices: int, pair: RandomPair
) -> None:
    """Time a contender, with coal's distance before every round."""
    work, count = contender.prepare(pair)
    beside, calls = (coal_distance if contender.poses == "many" else coal_distance_of_one_pose)(pair)
    coal: list[float] = []

    def time_coal() -> None:
        beside()
        start = perf_counter()
        beside()
        coal.append((perf_counter() - start) / calls)
        work()

    benchmark.group = f"{vertices} vertices, {family}"
    benchmark.extra_info.update(contender=contender.name, family=family, vertices=vertices, curves=count)
    benchmark.pedantic(work, setup=time_coal, rounds=contender.rounds, warmup_rounds=2)
    own = [seconds / count for seconds in benchmark.stats.stats.data]
    labels = contender.name, contender.kind, family, vertices
    results.timings.append(Timing.of(labels, own, coal[-len(own) :], contender.target(vertices)))


@pytest.mark.parametrize("vertices", SIZES)
@pytest.mark.parametrize("family", AXES)
def test_all_methods_trace_the_same_curves(results: Results, family: str, vertices: int, pair: RandomPair) -> None:
    """What is timed is the same thing: every breakpoint of `decision_curves` and of each rival agrees."""
    count = 5
    curves = fo.decision_curves(pair.movable, pair.static, pair.transforms, box=BOX)
    results.segments.setdefault(family, {})[vertices] = float(curves.counts.mean())
    for name, rival in RIVALS.items():
        if rival.gives == "samples" or not any(vertices in c.sizes for c in CONTENDERS if c.name == name):
            continue
        for k in range(count):
            ends = curves.vertices[curves.offsets[k] : curves.offsets[k + 1]]
            own = np.vstack([ends[:, 0], ends[-1:, 1]])
            trace = rival(pair.movable, pair.static, transform=pair.transforms[k], box=BOX)
            assert beyond(own, trace.points) <= rival.accuracy, name
            assert beyond(trace.points, own) <= rival.accuracy, name


def beyond(polyline: np.ndarray, points: np.ndarray) -> float:
    """Largest relative distance, along their rays, of points from a falling polyline."""
    order = np.argsort(polyline[:, 0])
    angles = np.arctan2(points[:, 1], points[:, 0])
    corners = np.arctan2(polyline[order, 1], polyline[order, 0])[::-1]
    k = np.clip(np.searchsorted(corners, angles) - 1, 0, len(polyline) - 2)
    p, q = polyline[order][::-1][k], polyline[order][::-1][k + 1]
    system = np.stack([p, q], axis=2)
    return float(np.abs(np.linalg.solve(system, points[:, :, None]).sum(axis=(1, 2)) - 1).max())


@pytest.mark.parametrize("draw", [random_pairs, integer_pairs], ids=["random hulls", "parallel faces and edges"])
def test_sign_at_touch(
    results: Results, pytestconfig: pytest.Config, request: pytest.FixtureRequest, draw: Callable[..., Any]
) -> None:
    """The sign of `gap` is right however little the pair is opened or closed; coal's is recorded beside it."""
    openings = Openings(name=request.node.callspec.id, tolerances=(TIGHT, TIGHTER))
    for one, two, transform in draw(np.random.default_rng([pytestconfig.getoption("--bench-seed"), 77]), 500):
        openings.add(one, two, transform)
    results.signs += openings.rows()
    for row in openings.rows():
        assert row["cases"] == 1000
        assert row["right"]["gap"] == row["cases"], row
