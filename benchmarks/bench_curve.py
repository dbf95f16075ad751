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

import fcdm_opt as fo
from contenders import (
    BISECTION,
    BOTH,
    CLARABEL,
    CONTENDERS,
    POSES,
    RIVAL,
    TIGHT,
    Contender,
    coal_distance,
    coal_distance_of_one_pose,
)
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.curves import METHODS
from fcdm_opt_benchmarks.pairs import BOX, SIZES, DrawnPair
from fcdm_opt_benchmarks.references import curve_error, exact_curve_in_box
from report import Results, Timing
from signs import Openings, integer_pairs, random_pairs

TIGHTER = 1e-15  # of coal, to see whether its answers at touch are a matter of settings


@cache
def pair_of(seed: int, vertices: int, shape: str) -> DrawnPair:
    """Draw a pair once for all its contenders."""
    return DrawnPair.of(seed, vertices, shape)


@pytest.fixture
def pair(pytestconfig: pytest.Config, vertices: int, family: str) -> DrawnPair:
    """Return the pair that a test asks for."""
    if vertices > pytestconfig.getoption("--bench-largest"):
        pytest.skip("larger than --bench-largest")
    return pair_of(pytestconfig.getoption("--bench-seed"), vertices, family)


@pytest.mark.parametrize(
    ("contender", "family", "vertices"),
    [
        pytest.param(contender, family, vertices, id=f"{contender.name}-{family}-{vertices}")
        for family in BOTH
        for vertices in SIZES
        for contender in CONTENDERS
        if vertices in contender.sizes and family in contender.shapes
    ],
)
def test_time(
    benchmark: Any, results: Results, contender: Contender, family: str, vertices: int, pair: DrawnPair
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
@pytest.mark.parametrize("family", BOTH)
def test_all_methods_trace_the_same_curves(results: Results, family: str, vertices: int, pair: DrawnPair) -> None:
    """What is timed is the same thing: every method but the bisection gives the exact breakpoints."""
    curves = fo.decision_curves(*pair.pair, pair.transforms(POSES), box=BOX)
    results.segments.setdefault(family, {})[vertices] = float(curves.counts.mean())
    questions = [pair.curve(k) for k in range(5)]
    references = [exact_curve_in_box(pair.pair, question) for question in questions]
    timed = {c.name for c in CONTENDERS if c.kind == RIVAL and vertices in c.sizes} - {BISECTION}
    for method in METHODS:
        if not (method.ours or method.name in timed):
            continue
        answers = method.prepare(pair.pair, list(method.settings.values())[-1])(questions)
        errors = [curve_error(answer, exact) for answer, exact in zip(answers, references, strict=True)]
        assert max(errors) <= (DEFAULT.snap if method.name == CLARABEL else DEFAULT.nominal), method.name


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
