"""Stack-ups against closed forms: worst cases, root-sum-square, yield, contributions, cheapest tolerances."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from itertools import product
from math import comb
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.special import ndtr, ndtri
from scipy.stats import norm, truncnorm
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.design.stack.spread import spreads
from fcdm_opt.errors import InputError
from fcdm_opt.problem.entries import SizeEntry
from fcdm_opt.problem.schema import checked
from fcdm_opt.show.printing import console, printed
from fcdm_opt.show.stacks import print_faces, print_stack

PROBLEMS = Path(__file__).parents[2] / "problems"


def box(low: Any, high: Any) -> fo.Body:
    """An aligned box."""
    return fo.Body.convex(list(product(*zip(low, high, strict=True))))


def stacked(movable: fo.Body, static: fo.Body, *sizes: fo.Size, **more: Any) -> Any:
    """The stack-up of two bodies as drawn."""
    return fo.stack_up(fo.Problem(movable, static, sizes=sizes, motion=fo.Translation("x"), goal="touch"), **more)


def channel(width: float, name: str = "channel") -> fo.Body:
    """Two walls with a gap of a width between them, about x = 0."""
    half = width / 2
    walls = [list(product(ends, (-5.0, 5.0), (-5.0, 5.0))) for ends in ((-half - 3, -half), (half, half + 3))]
    return fo.Body.from_parts(walls, seed=(0, 0, 0), name=name)


def inner(tolerance: Any, name: str = "gap", along: str | None = None) -> fo.Size:
    """The two walls that face each other, further apart; or moved together along x."""
    faces = [{"through": (-10.0, 0, 0)}, {"through": (10.0, 0, 0)}]
    more = {"along": along} if along else {"each": -0.5}
    return fo.Size(name, "static", faces=faces, tolerance=tolerance, **more)


BLOCK = fo.Size("block", "movable", faces=["+x", "-x"], each=0.5, tolerance=0.05)


def test_a_collar_on_its_walls_hid_the_play_between_them() -> None:
    """The collar touches at all sizes, so that the gap was 0 whatever the block and the channel measure."""
    stem, collar = ([*product(x, (-2.0, 2.0), z)] for x, z in (((-9.9, 9.9), (0.0, 6.0)), ((-13.0, 13.0), (5.0, 6.0))))
    body = fo.Body.from_parts([stem, collar], seed=(0, 0, 0), name="collared")
    sides = fo.Size("block", "movable", faces=[{"through": (x, 0, 2)} for x in (-9.9, 9.9)], each=0.5, tolerance=0.05)
    stack = stacked(body, channel(20.0), sides, inner((-0.02, 0.08)))
    assert len(stack.standing) == 2  # on the top of each wall
    assert stack.worst().least == pytest.approx(0.1 - 0.025 - 0.01, abs=1e-14)
    assert stack.worst().largest == pytest.approx(0.1 + 0.025 + 0.04, abs=1e-9)
    assert stack.gap({"block": 0.2}) == pytest.approx(0.0, abs=1e-14)  # beyond the tolerances too
    assert len(stack.to_dict()["standing"]) == 2


def prism(outline: Any, length: float, name: str) -> fo.Body:
    """An outline in x and z, drawn out along y."""
    corners, n = [(x, y, z) for y in (-length, length) for x, z in outline], len(outline)
    sides = [[k, k + n, (k + 1) % n + n, (k + 1) % n] for k in range(n)]
    return fo.Body.from_mesh(corners, [[*range(n)], [*range(2 * n - 1, n - 1, -1)], *sides], name=name)


def test_of_two_faces_in_one_plane_the_one_across_the_slot_was_named() -> None:
    """A T key on both sides of its slot: the part under both of its wings has their faces in one facet."""
    key = prism([(-4, -7), (4, -7), (4, 0), (7, 0), (7, 3), (-7, 3), (-7, 0), (-4, 0)], 5.0, "key")
    outline = [(-9, -9), (9, -9), (9, 0), (4.1, 0), (4.1, -7.5), (-4.1, -7.5), (-4.1, 0), (-9, 0)]
    width = fo.Size("width", "movable", faces=[{"through": (x, 0, -3)} for x in (-4, 4)], each=0.5, tolerance=0.05)
    problem = fo.Problem(key, prism(outline, 8.0, "base"), sizes=[width], motion=fo.Translation("x"), goal="clear")
    both = ((5, 1), (9, 2))
    right, left = (f"face {own} (facing -z) of key, top face no. {other} of base" for own, other in both)
    best = fo.best_pose(problem)
    assert {*fo.stack_up(problem).standing} == {*best.standing} == {right, left}
    assert "; verified; closed at all these sizes" in str(best)  # it was judged, and print did not say so


def test_a_block_between_walls() -> None:
    """At the middle each side's gap is (channel - block) / 2 -+ position."""
    stack = stacked(
        box((-9.9, -1, -1), (9.9, 1, 1)), channel(20.0), BLOCK, inner((-0.02, 0.08)), inner(0.03, "at", "x")
    )
    worst = stack.worst()
    assert worst.least == pytest.approx(0.1 - 0.025 - 0.01 - 0.03, abs=1e-14)
    assert worst.largest == pytest.approx(0.1 + 0.025 + 0.04, abs=1e-9)
    assert worst.at_least["block"] == 0.05
    assert worst.at_least["gap"] == -0.02
    assert worst.at_largest["at"] == pytest.approx(0.0, abs=1e-9)
    assert stack.gap(worst.at_least) == pytest.approx(worst.least, abs=1e-14)
    assert len(stack.rows) == 2
    mean, spread = 0.1 + 0.015, np.array([0.025, 0.025, 0.03]) / 3
    told = stack.root_sum_square()
    assert told.mean == pytest.approx(mean, abs=1e-14)
    assert told.deviation == pytest.approx(np.sqrt((spread**2).sum()), rel=1e-13)
    for own in ("worst", "variance"):
        assert abs(sum(getattr(row, own) for row in stack.contributions) - 1.0) < 1e-12
    assert stack.contributions[0].size == "at"


def test_yield_of_one_row_is_the_normal_distribution_s() -> None:
    """A chain of five widths: published practice, gap = bore - sum of widths."""
    halves = [0.01, 0.02, 0.015, 0.03, 0.005]
    sizes = [fo.Size(f"w{k}", "movable", faces="+x", tolerance=t) for k, t in enumerate(halves)]
    stack = stacked(box((0, 0, 0), (10, 1, 1)), box((10.03, 0, 0), (12, 1, 1)), *sizes, limits=(0.015, 0.05))
    sigma = np.sqrt(sum(t * t for t in halves)) / 3
    share = ndtr((0.05 - 0.03) / sigma) - ndtr((0.015 - 0.03) / sigma)
    assert stack.worst().least == pytest.approx(0.03 - sum(halves), abs=1e-13)
    assert stack.worst().largest == pytest.approx(0.03 + sum(halves), abs=1e-13)
    assert stack.root_sum_square().share == pytest.approx(share, abs=5e-11)
    drawn = stack.yield_(2_000_000, confidence=0.999)
    assert drawn.interval[0] <= share <= drawn.interval[1]
    assert drawn.mean == pytest.approx(0.03, abs=4 * sigma / np.sqrt(2e6))
    assert drawn.deviation == pytest.approx(sigma, rel=3e-3)


# Published results: dimstack (github.com/phcreery/dimstack, docs/examples.md and tests), which has them from the
# demonstration of MITCalc, from the Dimensioning and Tolerancing Handbook (McGraw-Hill), chapters 9 and 12, and from a
# tutorial of New Concepts Design. Of the pulley dimstack tells two ranges: its closed analysis, which is that of the
# handbook, and a worst case narrower by 0.004; what is here are the handbook's numbers, which its tests quote.
# A link: how it enters the gap, drawn size, least and largest deviation, Cp.
MOTOR = [
    (1, 208.0, -0.036, 0.036, 1.0), (-1, 1.75, -0.06, 0.0, 1.0), (-1, 23.0, -0.12, 0.0, 1.0),
    (1, 20.0, -0.026, 0.026, 1.0), (-1, 200.0, -0.145, 0.145, 1.0), (1, 20.0, -0.026, 0.026, 1.0),
    (-1, 23.0, -0.12, 0.0, 1.0),
]  # fmt: skip
PULLEY = [
    (-1, 0.375, -0.031, 0.0, 1.0), (1, 0.032, -0.002, 0.002, 1.0), (1, 0.06, -0.003, 0.003, 1.0),
    (1, 0.438, -0.015, 0.0, 1.0), (1, 0.12, -0.005, 0.005, 1.0), (1, 1.5, -0.004, 0.01, 1.0),
    (1, 0.12, -0.005, 0.005, 1.0), (1, 0.438, -0.015, 0.0, 1.0), (1, 0.45, -0.007, 0.007, 1.0),
    (-1, 3.019, 0.0, 0.012, 1.0), (1, 0.3, -0.03, 0.03, 1.0),
]  # fmt: skip
WEIGHTED = [
    (a, drawn, -t, t, 1.0)
    for a, drawn, t in (
        (-0.5146, 0.875, 0.01), (0.1567, 1.625, 0.02), (0.4180, 1.7, 0.012), (-1.0, 0.875, 0.01),
        (-0.0540, 2.625, 0.02), (0.4372, 7.875, 0.03), (1.0, 4.125, 0.01), (-0.9956, 1.125, 0.02),
        (-0.7530, 3.625, 0.015), (-0.4006, 5.125, 0.02), (-1.0914, 1.0, 0.01),
    )
]  # fmt: skip
COVER = [(-1, 0.319, -0.005, 0.005, 2.0), (1, 10.486, -0.01, 0.01, 2.0), (-1, 0.319, -0.005, 0.005, 2.0)]
PUBLISHED = {  # name: links, gap as drawn, worst case, mean and deviation by root sum square (None: not published)
    "motor": (MOTOR, 0.25, (0.017, 0.783), 0.4, 0.17825 / 3),
    "motor, shaft with Cpk 1.5": ([(*MOTOR[0][:4], 1.5), *MOTOR[1:]], 0.25, (0.017, 0.783), 0.4, 0.05874),
    "pulley": (PULLEY, 0.064, (-0.034, 0.157), 0.0615, 0.0381 / 3),
    "weighted": (WEIGHTED, 0.07201, (-0.02561, 0.07201 + 0.09763), 0.07201, None),
    "cover": (COVER, 9.848, (9.828, 9.868), 9.848, 0.0122 / 6),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_stack_ups_come_out_as_published(name: str) -> None:
    links, drawn, worst, mean, deviation = PUBLISHED[name]
    sizes = [
        fo.Size(f"link {k}", "movable", faces="+x", each=-a, tolerance=(low, high), distribution={"normal": {"cp": cp}})
        for k, (a, _, low, high, cp) in enumerate(links)
    ]
    gap = sum(a * length for a, length, *_ in links)
    stack = stacked(box((0, 0, 0), (300, 1, 1)), box((300 + gap, 0, 0), (320 + gap, 1, 1)), *sizes)
    rounded = 6e-6  # five digits after the point are told
    assert stack.gap({}) == pytest.approx(drawn, abs=rounded)
    assert (stack.worst().least, stack.worst().largest) == pytest.approx(worst, abs=2 * rounded)
    spread = stack.root_sum_square()
    assert spread.mean == pytest.approx(mean, abs=rounded)
    if deviation is not None:
        assert spread.deviation == pytest.approx(deviation, abs=2 * rounded)
        assert (spread.low, spread.high) == pytest.approx((mean - 3 * deviation, mean + 3 * deviation), abs=4e-5)


@pytest.mark.parametrize(
    ("distribution", "deviation", "mean"),
    [
        ({"normal": {"cp": 2.0, "shift": 0.5}}, 0.03 / 6, 0.015),
        ({"uniform": {}}, 0.03 / np.sqrt(3.0), 0.0),
        ({"measured": [0.0, 0.01, 0.03, 0.0]}, np.std([0.0, 0.01, 0.03, 0.0]), 0.01),
        (fo.Uniform(0.0, 0.03), 0.03 / np.sqrt(12.0), 0.015),
    ],
)
def test_distributions_have_their_moments(distribution: Any, deviation: float, mean: float) -> None:
    size = fo.Size("w", "movable", faces="+x", tolerance=0.03, distribution=distribution)
    stack = stacked(box((0, 0, 0), (10, 1, 1)), box((10.03, 0, 0), (12, 1, 1)), size)
    told, drawn = stack.root_sum_square(), stack.yield_(300_000)
    assert (told.mean, told.deviation) == (pytest.approx(0.03 - mean), pytest.approx(deviation))
    assert drawn.mean == pytest.approx(0.03 - mean, abs=5 * deviation / np.sqrt(3e5))
    assert drawn.deviation == pytest.approx(deviation, rel=0.01)


def test_correlated_sizes_add_or_cancel() -> None:
    sizes = [fo.Size(name, "movable", faces="+x", tolerance=0.03) for name in "ab"]
    stack = stacked(box((0, 0, 0), (10, 1, 1)), box((10.1, 0, 0), (12, 1, 1)), *sizes)
    for r in (-1.0, 0.0, 0.5, 1.0):
        drawn = stack.yield_(200_000, correlation=[[1.0, r], [r, 1.0]])
        assert drawn.deviation == pytest.approx(0.01 * np.sqrt(2 + 2 * r), rel=0.01, abs=1e-12)


def test_two_pins_in_two_holes_keep_the_fixed_fastener_rule() -> None:
    """Worst clearance, as a diameter: hole - pin - both position zones."""
    pin, hole, pitch, height = 5.0, 5.6, 20.0, 6.0

    def square(x: float, side: float) -> list[tuple[float, ...]]:
        return list(product((x - side / 2, x + side / 2), (-side / 2, side / 2), (0.0, height)))

    pins = fo.Body.from_parts([square(x, pin) for x in (-pitch / 2, pitch / 2)], seed=(0, 0, 3), name="pins")
    cuts = [-pitch, -pitch / 2 - hole / 2, -pitch / 2 + hole / 2, pitch / 2 - hole / 2, pitch / 2 + hole / 2, pitch]
    bars = [(cuts[k], cuts[k + 1], side) for k in (1, 3) for side in (-1, 1)]
    walls = [list(product((cuts[k], cuts[k + 1]), (-9.0, 9.0), (0.0, height))) for k in (0, 2, 4)]
    walls += [list(product((a, b), sorted((side * hole / 2, side * 9.0)), (0.0, height))) for a, b, side in bars]
    plate = fo.Body.from_parts(walls, seed=(0, 0, 3), name="plate")
    sizes = []
    for k, x in enumerate((-pitch / 2, pitch / 2)):
        for body, side, sign, tolerance in (("movable", pin, 1, (-0.1, 0.0)), ("static", hole, -1, (0.0, 0.1))):
            ends = [{"through": (x + s * side / 2, 0.0, 3.0)} for s in (-1, 1)]
            more = {"tolerance": tolerance, "each": 0.5 * sign}
            sizes.append(fo.Size(f"{body} width {k}", body, faces=ends, **more))
            sizes.append(fo.Size(f"{body} at {k}", body, faces=ends, along="x", tolerance=0.2 / 2))
    stack = stacked(pins, plate, *sizes)
    assert 2 * stack.worst().least == pytest.approx(hole - pin - 0.2 - 0.2, abs=1e-12)
    assert {row.coefficients[f"static at {k}"] for row in stack.rows for k in (0, 1)} == {-1.0, 0.0, 1.0}


def test_shrinkage_by_axis_of_a_lid() -> None:
    """Rim of half length 10 about the seed in a well of half length 10.2: the gap at its ends shrinks with x alone."""
    sizes = [fo.Size(axis, "static", scale=axis, tolerance=(-0.006, 0.0)) for axis in "xyz"]
    well = channel(20.4)
    stack = stacked(box((-10, -1, -1), (10, 1, 1)), well, *sizes)
    assert stack.worst().least == pytest.approx(0.2 - 0.006 * 10.2, abs=1e-13)
    assert stack.gap({"x": -0.004, "y": -0.006}) == pytest.approx(0.2 - 0.004 * 10.2, abs=1e-13)
    sloped = fo.Body.convex([(0, 0, 0), (3, 0, 0), (0, 3, 0), (0, 0, 3)])
    with pytest.raises(fo.InputError, match="size 'x' turns face F"):
        stacked(box((5, 5, 5), (6, 6, 6)), sloped, *sizes)


def test_a_peg_with_a_tolerance_on_each_side() -> None:
    sides = {"+x": (-0.1, 0.02), "-x": (-0.03, 0.04), "+y": (0.0, 0.05), "-y": (-0.01, 0.01)}
    sizes = [fo.Size(f"side {face}", "movable", faces=face, tolerance=t) for face, t in sides.items()]
    stack = stacked(box((-9.9, -1, -1), (9.95, 1, 1)), channel(20.0), *sizes)
    assert stack.worst().least == pytest.approx(min(0.05 - 0.02, 0.1 - 0.04), abs=1e-13)
    assert stack.worst().largest == pytest.approx(min(0.05 + 0.1, 0.1 + 0.03), abs=1e-9)


# ----------------------------------------------------------------------------------------------------------- allocation


def least_gap(stack: Any, t: Any) -> float:
    """The least gap of half tolerances t: a linear program for each part pair, in another formulation."""
    middle = np.array([size.middle for size in stack.sizes])
    found = []
    for pair in {row.parts for row in stack.rows}:
        rows = np.array([[row.gap, *row.coefficients.values()] for row in stack.rows if row.parts == pair])
        heights = rows[:, 0] + rows[:, 1:] @ middle
        left = np.column_stack([rows[:, 1:] * t, -np.ones(len(rows))])
        cost = [0.0] * len(t) + [1.0]
        found.append(linprog(cost, left, -heights, bounds=[(-1, 1)] * len(t) + [(None, None)]).fun)
    return min(found)


def brute(stack: Any, cost: dict[str, Any], halves: list[float], low: float, steps: int = 6) -> float:
    """The least cost on ever finer grids of half tolerances."""
    best, place, span = np.inf, np.array([1.0] * len(halves)), np.array([2.0] * len(halves))
    for _ in range(6):
        grid = [np.linspace(max(x - s, 0.02), min(x + s, 4.0), steps) for x, s in zip(place, span, strict=True)]
        for shares in product(*grid):
            t = np.array(shares) * halves
            price = sum(own(x) for own, x in zip(cost.values(), t, strict=True))
            if price < best and least_gap(stack, t) >= low:
                best, place = price, np.array(shares)
        span = span / 2.5
    return best


def wide(stack: Any, *bodies: fo.Body) -> Any:
    """The same with rows that are complete for four times the tolerances."""
    sizes = [replace(s, tolerance=(s.middle - 4 * s.half, s.middle + 4 * s.half)) for s in stack.sizes]
    return stacked(*bodies, *sizes)


SCENES = {
    "chain": (box((0, 0, 0), (10, 1, 1)), box((10.1, 0, 0), (12, 1, 1)), ("+x", "+x", "+x")),
    "corner": (
        fo.Body.convex([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1)]),
        box((0.9, 0.9, 0.9), (3, 3, 3)),
        ("F1", "F2", "+x"),
    ),
    "walls": (box((-9.9, -1, -1), (9.9, 1, 1)), channel(20.0), ("+x", "-x", "+x")),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_cheapest_tolerances_are_those_of_brute_force(name: str) -> None:
    one, two, faces = SCENES[name]
    sizes = [fo.Size(f"s{k}", "movable", faces=face, tolerance=0.02) for k, face in enumerate(faces)]
    stack = stacked(one, two, *sizes)
    low = stack.gap({}) - 0.05
    found = stack.allocate({"s0": 1.0, "s1": ("1/t^2", 0.02), "s2": 0.5}, limits=(low, np.inf))
    cost = {"s0": lambda t: 1.0 / t, "s1": lambda t: 0.02 / t**2, "s2": lambda t: 0.5 / t}
    least = brute(wide(stack, one, two), cost, [0.02] * 3, low)
    assert found.least >= low - 1e-14
    assert found.cost <= least * (1 + 1e-9)  # no grid is cheaper
    assert found.cost >= 0.98 * least  # and it comes near


def test_cheapest_tolerances_have_their_closed_form() -> None:
    """c_k / t_k subject to sum t_k = m: t_k = m sqrt(c_k) / sum sqrt(c)."""
    sizes = [fo.Size(name, "movable", faces="+x", tolerance=0.05) for name in "abc"]
    stack = stacked(box((0, 0, 0), (10, 1, 1)), box((10.1, 0, 0), (12, 1, 1)), *sizes)
    cost = {"a": 1.0, "b": 4.0, "c": 9.0}
    found = stack.allocate(cost, limits=(0.04, np.inf))
    assert [high for _, high in found.tolerances.values()] == pytest.approx([0.01, 0.02, 0.03], rel=1e-4)
    assert found.cost == pytest.approx(600.0, rel=1e-6)
    table = stack.allocate({"a": [(0.01, 5.0), (0.02, 2.0), (0.05, 1.0)]}, limits=(-0.02, np.inf))
    assert table.tolerances["a"][1] == pytest.approx(0.02, rel=1e-5)
    assert table.cost == pytest.approx(2.0, rel=1e-5)
    share = stack.allocate(cost, share=0.9973, limits=(0.04, np.inf))
    assert np.linalg.norm([high for _, high in share.tolerances.values()]) == pytest.approx(
        3 * 0.06 / ndtri(0.9973), rel=1e-5
    )
    assert share.cost < found.cost
    for limits in ((0.04, 0.16), (0.04, 0.13), (0.07, 0.2), (-1.0, 0.15)):  # both limits together, not each
        told = stack.allocate(cost, share=0.9973, limits=limits).tolerances
        made = [replace(size, tolerance=told[size.name]) for size in sizes]
        again = stacked(box((0, 0, 0), (10, 1, 1)), box((10.1, 0, 0), (12, 1, 1)), *made, limits=limits)
        assert again.root_sum_square().share == pytest.approx(0.9973, abs=1e-9)
    with pytest.raises(fo.InputError, match="no tolerances keep the gap"):
        stack.allocate(cost, limits=(0.2, np.inf))
    for table in ([("a", 1.0), (0.05, 2.0)], [(0.1, 1.0), (0.05,)], [(0.01, np.nan), (0.05, 2.0)], [(1, 2, 3)] * 2):
        with pytest.raises(fo.InputError, match="cost"):
            stack.allocate({"a": table})
    with pytest.raises(fo.InputError, match="unusable table of costs"):
        stack.allocate({"a": [(0.01, 1.0), (0.02, 2.0)]})


# --------------------------------------------------------------------------------------------------------- command line


def run(*arguments: Any) -> tuple[int, str]:
    """Run a command."""
    result = CliRunner().invoke(app, [*map(str, arguments)])
    return result.exit_code, result.stdout


def test_faces_are_listed_by_name() -> None:
    code, text = run("faces", PROBLEMS / "slot_and_key.toml", "--json")
    assert code == 0
    faces = json.loads(text)["files"][0]["faces"]["static"]
    bottom = next(face for face in faces if face["plane"] == "y = 12")
    assert (bottom["face"], bottom["normal"], bottom["area"]) == ("F7", "+y", pytest.approx(10.125 * 30))
    code, text = run("faces", PROBLEMS / "slot_and_key.toml")
    assert code == 0
    assert "x = 5.0625" in text


def test_beyond_the_tolerances_gaps_are_found_anew() -> None:
    """A peg that grows through a wall of 1 x 2 x 1 leaves it along z sooner than along x."""
    size = fo.Size("w", "movable", faces="+x", tolerance=0.1)
    stack = stacked(box((0, 0, 0), (4, 2, 1)), box((5, 0, 0), (6, 2, 1)), size)
    assert stack.gap({"w": 3.0}) == pytest.approx(-1.0)
    assert stack.gap([[0.05], [3.0]]) == pytest.approx([0.95, -1.0])
    only_smaller = stacked(box((0, 0, 0), (4, 2, 1)), box((5, 0, 0), (6, 2, 1)), replace(size, tolerance=(-0.3, -0.1)))
    assert only_smaller.gap({}) == pytest.approx(1.0)
    with pytest.raises(fo.InputError, match="nothing may be left"):
        stack.gap({"w": -5.0})
    for wrong in ({"w": float("nan")}, {"w": "x"}, [1.0, 2.0], 1.0, {"v": 1.0}):
        with pytest.raises(fo.InputError, match="sizes"):
            stack.gap(wrong)


@pytest.mark.parametrize(
    "wrong", [{"seed": -1}, {"confidence": 2.0}, {"confidence": "x"}, {"correlation": "x"}, {"n": 1e6}, {"n": 0}]
)
def test_draws_of_no_such_kind_are_refused(wrong: dict[str, Any]) -> None:
    size = fo.Size("w", "movable", faces="+x", tolerance=0.1)
    with pytest.raises(fo.InputError, match=next(iter(wrong))):
        stacked(box((0, 0, 0), (4, 2, 1)), box((5, 0, 0), (6, 2, 1)), size).yield_(**{"n": 10, **wrong})


def test_sizes_that_do_not_matter_are_as_drawn_in_the_worst_case() -> None:
    """And no size is -0; faces across the gap do not matter."""
    sizes = [fo.Size(f"s{k}", "movable", faces=face, tolerance=0.1) for k, face in enumerate(("+x", "-x", "+y"))]
    sizes.append(fo.Size("thinner", "movable", faces="+z", tolerance=(-0.3, -0.1)))
    worst = stacked(box((0, 0, 0), (4, 1, 1)), box((5, 0, 0), (6, 1, 1)), *sizes).worst()
    for at, first in ((worst.at_least, 0.1), (worst.at_largest, -0.1)):
        assert list(at.values()) == [first, 0.0, 0.0, -0.1]
        assert not np.signbit(list(at.values())[1:3]).any()
    _, text = run("stack", PROBLEMS / "slot_and_key.toml", "--case", "as drawn", "--draws", 100)
    assert "-0," not in text
    assert " -0 " not in text


def test_a_stack_is_printed_drawn_and_written(tmp_path: Path) -> None:
    file = PROBLEMS / "slot_and_key.toml"
    line = ("stack", file, "--case", "as drawn", "--gap", "0.04,0.12", "--draws", 5000, "--cost", "key_width=1")
    code, text = run(*line, "--json", "--out", tmp_path)
    assert code == 0
    case = json.loads(text)["files"][0]["cases"][0]
    assert case["stack"]["worst"]["least"] == pytest.approx(0.0325, abs=1e-12)
    assert case["stack"]["worst"]["largest"] == pytest.approx(0.0955, abs=1e-9)
    assert case["yield"]["count"] == 5000
    names = sorted(path.name for path in tmp_path.iterdir())
    assert [name.rsplit(".")[-1] for name in names].count("csv") == 1
    assert sum(name.endswith("slice.png") for name in names) == 1
    rows = next(tmp_path.glob("*.csv")).read_text().splitlines()
    assert rows[0] == "row,gap as drawn,key_width,key_foot,slot_width,slot_position,slot_depth"
    code, text = run(*line)
    assert "of the worst case" in text


def test_a_stack_without_sizes_says_what_to_write(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["stack", str(PROBLEMS / "boxes.toml")])
    assert result.exit_code == 2
    assert "[[size]]" in result.stderr
    assert result.stderr.count("error: ") == 1  # once, not once a case
    path = tmp_path / "own.toml"
    text = (PROBLEMS / "boxes.toml").read_text(encoding="utf-8")
    path.write_text(f'{text}\n#[[size]]\n#name = "a"\n# [[size]]  # as init leaves it\n', encoding="utf-8")
    assert "2 are there, commented out" in CliRunner().invoke(app, ["stack", str(path)]).stderr
    path.write_text(path.read_text("utf-8").replace("#[[size]]", "", 1), encoding="utf-8")
    assert "1 is there, commented out" in CliRunner().invoke(app, ["stack", str(path)]).stderr


# ----------------------------------------------------------------------------------------------- who contributes what


def flanks(*names: str, tolerance: Any = 0.05, width: float = 20.0, **more: Any) -> Any:
    """A block of 19.8 between walls, each of the four flanks a size of its own, in the order of the names."""
    own = {
        "block left": fo.Size("block left", "movable", faces="-x", tolerance=tolerance, **more),
        "block right": fo.Size("block right", "movable", faces="+x", tolerance=tolerance, **more),
        "wall left": fo.Size("wall left", "static", faces=[{"through": (-width / 2, 0, 0)}], tolerance=tolerance),
        "wall right": fo.Size("wall right", "static", faces=[{"through": (width / 2, 0, 0)}], tolerance=tolerance),
    }
    block = box((-9.9, -1, -1), (19.8 - 9.9, 1, 1))
    return stacked(block, channel(width), *(own[name] for name in names), limits=(0.05, np.inf))


def test_of_two_flanks_alike_one_had_all_the_contributions() -> None:
    """The right flanks were told 50 % each, the left ones 0 %, or the other way round by the order of the parts."""
    names = "block left", "block right", "wall left", "wall right"
    stack = flanks(*names)
    for own in stack.contributions:
        assert own.worst == pytest.approx(0.25, abs=1e-12)
        assert own.variance == pytest.approx(0.25, abs=2e-3)
        assert own.coefficient == pytest.approx(-0.5, abs=2e-3)
    assert sum(own.variance for own in stack.contributions) == pytest.approx(1.0, abs=1e-12)
    for other in (names[::-1], ("wall left", "block right", "block left", "wall right")):
        assert [vars(own) for own in flanks(*other).contributions] == [vars(own) for own in stack.contributions]
    # one gap is the least of two alike: root sum square has one of them
    told, drawn = stack.root_sum_square(), stack.yield_(400_000, confidence=0.999)
    assert told.elsewhere == pytest.approx(0.5, abs=2e-3)
    alone = ndtr((0.1 - 0.05) / told.deviation)
    assert told.share == pytest.approx(alone, abs=1e-12)
    assert drawn.interval[0] <= alone**2 <= drawn.interval[1]
    ends = ndtri([1.0 - np.sqrt(1.0 - 0.00135), 1.0 - np.sqrt(0.00135)])  # of the lesser of two, .135 % to each side
    truth = told.mean + told.deviation * ends
    assert (drawn.low, drawn.high) == pytest.approx(tuple(truth), abs=0.05 * told.deviation)
    assert drawn.high < told.high - 0.5 * told.deviation  # which stood for the pairs drawn
    assert "of 400000 pairs drawn" in str(drawn)


def test_contributions_of_a_wall_cut_into_parts_are_those_of_the_whole_wall() -> None:
    """Two part pairs with the same row counted twice, or first."""
    walls = [
        list(product((-13.0, -10.0), ends, (-5.0, 5.0))) for ends in ((-5.0, 0.0), (0.0, 5.0))
    ] + [list(product((10.0, 13.0), (-5.0, 5.0), (-5.0, 5.0)))]  # fmt: skip
    block = box((-9.9, -1, -1), (9.9, 1, 1))
    sizes = [fo.Size(f"block {side}", "movable", faces=side, tolerance=0.05) for side in ("-x", "+x")]
    for parts in (walls, walls[::-1]):
        stack = stacked(block, fo.Body.from_parts(parts, seed=(0, 0, 0)), *sizes)
        assert [own.worst for own in stack.contributions] == pytest.approx([0.5, 0.5], abs=1e-12)
        assert [own.variance for own in stack.contributions] == pytest.approx([0.5, 0.5], abs=2e-3)


def shapley(gap: Any, values: Any) -> Any:
    """Return the Shapley effects of independent sizes of a few values each, over all subsets of them."""
    grid = np.array(list(product(*values)))
    gaps, count = gap(grid).reshape([len(own) for own in values]), len(values)
    explained = {}
    for kept in product((False, True), repeat=count):
        mean = gaps.mean(axis=tuple(k for k in range(count) if not kept[k]), keepdims=True)
        explained[kept] = float(((mean - gaps.mean()) ** 2).mean())
    effects = np.zeros(count)
    for k in range(count):
        for kept, value in explained.items():
            if not kept[k]:
                more = tuple(own or j == k for j, own in enumerate(kept))
                effects[k] += (explained[more] - value) / (count * comb(count - 1, sum(kept)))
    return effects


def test_contributions_are_shapley_effects_of_the_whole_distribution() -> None:
    rng = np.random.default_rng(4)
    for _ in range(3):
        values = [np.sort(rng.uniform(-0.1, 0.1, 4)) for _ in range(3)]
        names = ("block left", "block right", "wall left")
        sizes = [
            fo.Size(name, body, faces=faces, tolerance=0.1, distribution={"measured": own.tolist()})
            for name, body, faces, own in zip(
                names, ("movable", "movable", "static"), ("-x", "+x", [{"through": (-10.0, 0, 0)}]), values, strict=True
            )
        ]
        stack = stacked(box((-9.95, -1, -1), (9.9, 1, 1)), channel(20.0), *sizes)
        truth = shapley(lambda p: np.minimum(0.05 - p[:, 0] - p[:, 2], 0.1 - p[:, 1]), values)
        found = {own.size: own.variance for own in stack.contributions}
        assert [found[name] for name in names] == pytest.approx(truth / truth.sum(), abs=5e-3)


def test_where_root_sum_square_and_draws_differ_it_is_said_why() -> None:
    """87.2 and 98.4 % stood side by side without a word."""
    from fcdm_opt.show.stacks import print_stack

    left = fo.Size("left", "movable", faces="-x", tolerance=0.01)
    far = stacked(box((-9.95, -1, -1), (9.0, 1, 1)), channel(20.0), left)
    for stack, differ in ((flanks("block left", "block right"), True), (far, False)):
        drawn = stack.yield_(200_000)
        with console().capture() as said:
            print_stack(stack, drawn)
        assert ("another one decides" in said.get().replace("\n", " ")) == differ
    for mean, text in ((-1.2e-6, "mean +0 "), (1e-3, "mean +0.001 ")):  # .006 / 200000 ** .5 are 1.3e-5
        with console().capture() as said:
            print_stack(far, replace(far.yield_(200_000), mean=mean))
        assert text in said.get()


def test_a_mean_of_nothing_and_what_is_beyond_the_worst_case_were_not_marked() -> None:
    """A block in a channel, .05 off either wall, and where it stands, .04: -1 at one wall and +1 at the other."""
    place = fo.Size("place", "movable", faces=["+x", "-x"], along="x", tolerance=0.04)
    stack = stacked(box((-9.95, -1, -1), (9.95, 1, 1)), channel(20.0), place)
    told = str(stack)
    assert "-1 to +1" in next(line for line in told.splitlines() if line.startswith("place"))
    marked = [line for line in told.splitlines() if " * " in line and "root sum square" in line]
    assert len(marked) == 1  # 3 sigma about .05 are .01 to .09; the gap is at most .05
    assert "+ 3 sigma" in marked[0]
    assert "+0.09 *" in marked[0]
    assert "* beyond the worst case" in told
    with console().capture() as said:
        print_stack(stack, stack.yield_(1000))
    assert "pairs drawn" in said.get()
    assert "by root sum square" not in said.get()  # .38 % stood beside 98 %


def test_a_face_that_is_none_is_told_with_its_line_by_faces_too(tmp_path: Path) -> None:
    """It was 'drawn is refused: contacts[2]...', without the file."""
    path, text = tmp_path / "own.toml", (PROBLEMS / "slot_and_key.toml").read_text(encoding="utf-8")
    size = text[text.index("[[size]]") :]
    wrong = re.sub(r"faces = .*", 'faces = ["F99"]', size, count=1)
    path.write_text(text.replace(size, wrong).replace('"meshes/', f'"{PROBLEMS}/meshes/'), encoding="utf-8")
    places = []
    for command in ("solve", "faces"):
        told = CliRunner().invoke(app, [command, str(path)]).stderr
        assert "'F99'" in told
        places += re.findall(r"own\.toml:\d+", told)[:1]
    assert len(places) == 2
    assert places[0] == places[1]


def test_gaps_of_arrays_by_name_broadcast_and_a_stack_prints_as_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    """A channel of 20 + d about a block of 19 + e: the gap is (1 + d - e) / 2."""
    stack = stacked(box((-9.5, -5, -5), (9.5, 5, 5)), channel(20.0), inner(0.2), replace(BLOCK, tolerance=0.1))
    wider, larger = np.linspace(-0.2, 0.2, 5), np.linspace(-0.1, 0.1, 3)[:, None]
    found = stack.gap({"gap": wider, "block": larger})
    assert found.shape == (3, 5)
    np.testing.assert_allclose(found, (1.0 + wider - larger) / 2.0, atol=1e-12)
    assert isinstance(stack.gap({"gap": 0.1}), float)
    with pytest.raises(fo.InputError, match="do not broadcast"):
        stack.gap({"gap": wider, "block": np.zeros(2)})
    lines = str(stack).splitlines()
    assert capsys.readouterr().out == ""
    assert lines[0].split() == ["gap", "at"]
    assert sum(line.startswith(("gap  ", "block ")) for line in lines) == 2  # one row a size
    assert any("% of 1000000 pairs drawn" in line for line in lines)
    assert sum(line.startswith("99.73 % of pairs drawn") for line in lines) == 2  # as the command prints
    assert repr(stack).startswith("StackUp(gap ")
    assert "\n" not in repr(stack)


SIGMAS: list[tuple[dict[str, float], Any]] = [
    ({"sigma": 0.004}, norm(0.015, 0.004)),
    ({"sigma": 0.004, "mean": 0.01}, norm(0.01, 0.004)),
    ({"sigma": 0.004, "mean": 0.01, "low": 0.008}, truncnorm(-0.5, np.inf, 0.01, 0.004)),
    ({"sigma": 0.02, "mean": 0.0, "low": -0.02, "high": 0.03}, truncnorm(-1.0, 1.5, 0.0, 0.02)),
]


@pytest.mark.parametrize(("normal", "truth"), SIGMAS)
def test_a_size_is_distributed_by_its_standard_deviation(normal: dict[str, float], truth: Any) -> None:
    """The gap is 0.03 - w; of w with tolerance [0, 0.03], limits leave P(0.012 <= w <= 0.02) by scipy."""
    size = fo.Size("w", "movable", faces="+x", tolerance=(0.0, 0.03), distribution={"normal": normal})
    bodies = box((0, 0, 0), (10, 1, 1)), box((10.03, 0, 0), (12, 1, 1))
    stack = stacked(*bodies, size, limits=(0.01, 0.018))
    told, drawn = stack.root_sum_square(), stack.yield_(200_000)
    assert told.mean == pytest.approx(0.03 - truth.mean(), abs=1e-12)
    assert told.deviation == pytest.approx(truth.std(), rel=1e-9)
    share = truth.cdf(0.02) - truth.cdf(0.012)
    assert drawn.share == pytest.approx(share, abs=5.0 * np.sqrt(share * (1.0 - share) / 2e5))


def test_pairs_drawn_beyond_the_tolerances_meet_the_contacts_that_are_there() -> None:
    """A step that no size within the tolerance brings into contact first, but most of those drawn: a block of 10 + w
    ends 1 before a wall, its step, which does not move, 1.05: beyond w = -0.05 the gap stays 1.05."""
    long, step = [*product((0.0, 10.0), (0.0, 1.0), (0.0, 1.0))], [*product((0.0, 9.95), (2.0, 3.0), (0.0, 1.0))]
    body = fo.Body.from_parts([long, step], seed=(0, 0, 0), name="stepped")
    spread = {"normal": {"sigma": 0.05, "mean": -0.1, "low": -0.2, "high": 0.0}}
    face = {"through": (10.0, 0.5, 0.5)}
    size = fo.Size("w", "movable", faces=[face], tolerance=0.01, distribution=spread)
    stack = stacked(body, box((11.0, 0, 0), (12.0, 3.0, 1)), size)
    assert len(stack.rows) == 1
    assert stack.yield_(20_000).largest == pytest.approx(1.05, abs=1e-12)
    stack.yield_(2_000).claims()


@pytest.mark.slow
def test_the_sides_of_a_lid_flush_with_its_box_hid_the_play_of_its_pegs(capsys: pytest.CaptureFixture[str]) -> None:
    """Pegs of 8 - 0.035 +- 0.015 in holes of 8.1 +- 0.05, one peg +-0.08 off its place.

    Play of the one 0.05 + (hole 1 - peg 1) / 2, of the other 0.05 + (hole 2 - peg 2) / 2 - |pitch|: at most
    0.05 + (0.05 + 0.05) / 2 = 0.1, at least 0.05 + (-0.05 + 0.02) / 2 - 0.08 = -0.045.
    """
    pegs = [fo.Cylinder(4, 8, base=(x, 0, -8), facets=12) for x in (-25, 25)]
    bores = [fo.Cylinder(4.05, 12, base=(x, 0, -11), facets=12) for x in (-25, 25)]
    lid = fo.joined(fo.Box((70, 30, 5), centre=(0, 0, 2.5)), *pegs, name="lid")
    own = fo.cut(fo.Box((70, 30, 20), centre=(0, 0, -10)), *bores, name="box")
    each = {"each": 0.5, "tolerance": (-0.05, -0.02)}, {"each": -0.5, "tolerance": 0.05}
    sizes = [
        fo.Size(f"{name} {k}", body, faces=[f"{face} no. {k}"], **more)
        for name, body, face, more in (
            ("peg", "movable", "cylinder radius 4", each[0]), ("hole", "static", "bore radius 4.05", each[1])
        )
        for k in (1, 2)
    ]  # fmt: skip
    pitch = fo.Size("pitch", "movable", faces=["cylinder radius 4 no. 2"], along="x", tolerance=0.08)
    stack = stacked(lid, own, *sizes, pitch, limits=(0.0, 0.2))
    worst = stack.worst()
    assert (worst.least, worst.largest) == pytest.approx((-0.045, 0.1), abs=1e-9)
    one = {"hole 1": 0.5, "peg 1": -0.5}, {"hole 2": 0.5, "peg 2": -0.5}
    every = one[0], {**one[1], "pitch": 1.0}, {**one[1], "pitch": -1.0}
    for row in stack.rows:
        told = {name: round(rate, 6) for name, rate in row.coefficients.items() if abs(rate) > 1e-6}
        assert told in every or abs(told["pitch"]) < 1.0
        assert row.gap == pytest.approx(0.05, abs=1e-9)
    places = np.random.default_rng(1).uniform(*stack.touching.box.T, (1000, 5))
    peg, other, hole, bore, off = places.T
    play = np.minimum(0.05 + (hole - peg) / 2.0, 0.05 + (bore - other) / 2.0 - np.abs(off))
    assert stack.gap(places) == pytest.approx(play, abs=1e-9)
    # what the pegs' play is less than by chance: P(|pitch| < play), play and pitch normal, the limits three deviations
    play = np.linspace(0.0, 0.15, 200_001)
    density = norm(0.0675, np.hypot(0.025, 0.0075) / 3.0).pdf(play)
    share = np.trapezoid(density * (2.0 * ndtr(3.0 * play / 0.08) - 1.0), play)
    drawn = stack.yield_(confidence=0.999)
    assert drawn.interval[0] < share < drawn.interval[1]
    print_stack(stack, drawn)
    assert "e-1" not in capsys.readouterr().out
    claims = stack.claims()
    gap, place = claims.largest
    checks = replace(claims, largest=(gap - 0.001, place), listed=places[:1]).checks()  # which is the one that is wrong
    assert {own.name: own.value for own in checks if not own.passed} == {"largest gap": pytest.approx(0.001, abs=1e-7)}
    assert {"least gap", "gap at sampled sizes"} <= {own.name for own in checks}


def test_a_standard_deviation_and_a_capability_are_one_too_many() -> None:
    for wrong, named in (({"sigma": 0.01, "cp": 1.0}, "cp"), ({"sigma": -1.0}, "sigma"), ({"mean": 0.0}, "normal")):
        told = {"normal": wrong}
        size = fo.Size("w", "movable", faces="+x", tolerance=0.1, distribution=told)
        with pytest.raises(fo.InputError, match=named):
            spreads([size])
        entry = {"name": "w", "body": "movable", "faces": "+x", "tolerance": 0.1, "distribution": told}
        with pytest.raises(fo.InputError, match=next(iter(wrong)) if named == "normal" else named):
            checked(SizeEntry, entry)
    known = checked(SizeEntry, {**entry, "distribution": {"normal": {"sigma": 0.004}}}).size()
    assert spreads([known]) == [fo.Normal(0.0, 0.004)]


def test_gaps_of_worst_cases_of_many_sizes_had_no_room_in_their_table() -> None:
    """Names of sizes fill lines of their own, and what is too wide is printed one below the other, never left out."""
    names = [f"a rather long name of the size number {k} of the slide" for k in range(8)]
    slide, rail = fo.Box((10, 30, 4)), fo.Box((10, 40, 4), centre=(10.5, 0, 0))
    sizes = [fo.Size(name, "movable", faces=["+x"], each=1.0, tolerance=0.01) for name in names]
    found = fo.stack_up(fo.Problem(slide, rail, sizes=sizes, made={}, goal="touch", motion=fo.Translation("x")))
    text = str(found)
    assert "worst case, least gap" in text
    assert "+0.42" in text  # 0.5 less 8 times 0.01
    assert "+0.58" in text
    assert max(map(len, text.splitlines())) <= 200


def test_what_does_not_vary_has_no_shares() -> None:
    """A pin between walls that no size moves: shares of rounding were told as 100 % of the worst case and variance."""
    static = fo.Body.from_parts([[*product((1.01, 2.0), (-1, 1), (-1, 1))], [*product((5.0, 6.0), (-1, 1), (-1, 1))]])
    block = box((0, -1, -1), (1, 1, 1))
    far = fo.Size("far wall", "static", faces=[{"through": (6.0, 0, 0)}], each=1.0, tolerance=(-0.1, 0.3))
    stack = stacked(block, static, far)
    assert stack.worst().least == pytest.approx(0.01, abs=1e-12) == stack.worst().largest
    assert [(own.worst, own.variance) for own in stack.contributions] == [(0.0, 0.0)]
    told = str(stack)
    assert "100" not in next(line for line in told.splitlines() if line.startswith("far wall"))
    assert "nan" not in told
    assert "trust" not in told
    assert "none" in told


def test_a_size_that_the_worst_case_does_not_depend_on_is_not_told_at_it() -> None:
    """Two walls ahead, the nearer one decides the least gap: the other stood there at the middle of its tolerance."""
    walls = [[*product((1.1, 2.0), (-1, 0), (-1, 1))], [*product((1.5, 2.0), (0, 1), (-1, 1))]]
    static = fo.Body.from_parts(walls, name="walls")
    near = fo.Size("near", "static", faces=[{"through": (1.1, -0.5, 0)}], each=-1.0, tolerance=0.05)
    far = fo.Size("far", "static", faces=[{"through": (1.5, 0.5, 0)}], each=-1.0, tolerance=(-0.1, 0.3))
    stack = stacked(box((0, -1, -1), (1, 1, 1)), static, near, far)
    assert stack.worst().least == pytest.approx(0.05)
    assert stack.worst().largest == pytest.approx(0.15)
    lines = [line for line in str(stack).splitlines() if line.startswith("worst case")]
    assert all("near" in line and "far" not in line for line in lines)


def test_a_size_in_the_middle_of_its_tolerance_was_left_out_where_the_gap_is_largest() -> None:
    """.1 of play a side, .152 at most by their widths; above it .15, so that the height of the lid counts as well."""
    walls = [[*product(x, (-5, 5), (-5, 5))] for x in ((-4.1, -2.1), (2.1, 4.1))]
    static = fo.Body.from_parts([*walls, [*product((-4.1, 4.1), (-5, 5), (1.15, 3))]], seed=(0, 0, 0), name="tunnel")
    block = fo.Size("block", "movable", faces=["+x", "-x"], each=0.5, tolerance=(-0.052, 0.0))
    faces = [{"through": (-2.1, 0, 0)}, {"through": (2.1, 0, 0)}]
    width = fo.Size("width", "static", faces=faces, each=-0.5, tolerance=(0.0, 0.052))
    lid = fo.Size("lid", "static", faces=[{"through": (0, 0, 1.15)}], each=-1.0, tolerance=(0.0, 0.07))
    stack = stacked(box((-2, -4, -1), (2, 4, 1)), static, block, width, lid)
    assert stack.worst().largest == pytest.approx(0.152, abs=1e-12)
    (line,) = (line for line in str(stack).splitlines() if line.startswith("worst case, largest"))
    told = {name: float(off) for name, off in re.findall(r"(block|width|lid) ([-+][\d.]+)", line)}
    assert stack.gap(told) == pytest.approx(0.152, abs=1e-12)
    assert stack.gap({**told, "lid": 0.0}) == pytest.approx(0.15, abs=1e-12)


def test_a_gap_that_the_weights_of_free_motions_decide_did_not_say_so() -> None:
    """A part s wider between two jaws: of all places where the right jaw touches it the weights choose one."""

    def box(name: str, low: tuple[float, ...], high: tuple[float, ...]) -> fo.Body:
        return fo.Body.convex(list(product(*zip(low, high, strict=True))), name=name, unit="mm")

    bodies = box("left", (-25, -5, 2), (-15, 5, 30)), box("right", (15, -5, 2), (25, 5, 30))
    part, along = box("part", (-15, -10, 0), (15, 10, 20)), fo.Translation("x")
    width = fo.Size("width", "part", faces=["+x", "-x"], each=0.5, tolerance=0.2)
    motions = {"left": along, "right": along, "part": along}
    world = dict.fromkeys(motions, "table")
    table = box("table", (-50, -30, -5), (50, 30, 0))
    contacts = [("left", "part"), ("right", "part"), ("part", "table")]
    for weight in (1.0, 5.0):
        gripper = fo.Assembly(
            [*bodies, part, table], contacts, [width], motions, follows=world, weights={"part": weight}
        )
        found = fo.stack_up(gripper, of=("left", "part"))
        assert found.worst().least == pytest.approx(-0.1 * (1.0 + 1.0 / (1.0 + weight**2)))
        assert found.weighted == ("right.TX", "part.TX")
        assert found.to_dict()["weighted"] == [*found.weighted]
        assert "leave right.TX and part.TX free" in str(found).replace("\n", " ")
    found = fo.stack_up(fo.Assembly([*bodies, part, table], contacts, [width], motions), of=("left", "part"))
    assert found.worst().least == pytest.approx(-0.1)  # the jaws go with the part, and weights play no part
    assert found.weighted == ()


def test_a_gap_that_no_size_changes_had_contributions() -> None:
    """A key of 1.9 in 2 beside one of 1.5, whose width may grow by .3 until it is as near to its walls."""
    flat, upright, bridge = ((9, 1.9, 2), (0, 0, 0)), ((1.5, 3, 2), (0, 6, 0)), ((1, 6, 1), (0, 3, 1.5))
    keys = fo.joined(*(fo.Box(extent, centre=place) for extent, place in (flat, upright, bridge)))
    walls = [((9, 2, 2), (0, y, 0)) for y in (-2, 2)] + [((2, 3, 2), (x, 6, 0)) for x in (-1.875, 1.875)]
    slots = fo.joined(*(fo.Box(extent, centre=place) for extent, place in [*walls, ((20, 20, 1), (0, 0, -2))]))
    sides = [{"through": (x, 6, 0)} for x in (-0.75, 0.75)]
    width = fo.Size("width", "movable", faces=sides, each=0.5, tolerance=[0, 0.15])
    problem = fo.Problem(keys, slots, sizes=[width], goal="clear", motion=fo.Translation("x"))
    stack = fo.stack_up(problem)
    assert [stack.worst().least, stack.worst().largest] == pytest.approx([0.05, 0.05], abs=1e-9)
    assert [own.worst for own in stack.contributions] == [0.0]


def test_one_of_several_contacts_alone() -> None:
    """A key .01 off both walls, .02 wider or narrower, between walls of which the left one moves by .004."""
    key, walls = fo.Box((9.98, 8, 4), name="key"), [fo.Box((4, 20, 10), centre=(x, 0, 0)) for x in (-7, 7)]
    base = fo.Body.from_parts([own.vertices for own in walls], name="base")
    sizes = [
        fo.Size("width", "movable", faces=["+x", "-x"], each=0.5, tolerance=0.01),
        fo.Size("wall", "static", faces={"through": (-5, 0, 0)}, tolerance=0.004),
    ]
    stack = fo.stack_up(fo.Problem(key, base, motion=fo.Translation("x"), target=(1, 1), goal="clear", sizes=sizes))
    assert len(stack.contacts) == 2
    number = 1 + next(k for k, name in enumerate(stack.contacts) if name.startswith("left"))
    left, right = stack.of_contact(number), stack.of_contact(stack.contacts[2 - number])
    assert stack.worst().largest == pytest.approx(0.015)  # the right wall ends it
    assert (left.worst().least, left.worst().largest) == pytest.approx((0.001, 0.019))
    assert (right.worst().least, right.worst().largest) == pytest.approx((0.005, 0.015))
    assert left.gap({"width": 0.01, "wall": 0.0}) == pytest.approx(0.005)
    assert fo.verify(left.yield_(1000)).passed
    with pytest.raises(InputError, match="no such contact"):
        stack.of_contact(3)


def test_the_share_of_one_contact_was_judged_by_that_of_all() -> None:
    """A key that fills its slot, both walls of which move alone: half of all clear the one, a quarter both."""
    key, walls = fo.Box((10, 8, 4), name="key"), [fo.Box((4, 20, 10), centre=(x, 0, 0)) for x in (-7, 7)]
    base = fo.Body.from_parts([own.vertices for own in walls], name="base")
    sizes = [fo.Size(f"wall {x}", "static", faces={"through": (x, 0, 0)}, tolerance=0.01) for x in (-5, 5)]
    stack = fo.stack_up(fo.Problem(key, base, motion=fo.Translation("x"), target=(1, 1), goal="clear", sizes=sizes))
    for asked, share in ((stack, 0.25), (stack.of_contact(1), 0.5), (stack.of_contact(2), 0.5)):
        found = asked.yield_(100_000)
        assert found.share == pytest.approx(share, abs=0.006)
        assert fo.verify(found).passed


def test_areas_of_round_faces_are_true_where_these_are_known() -> None:
    """Of a mesh that nobody says to be round they are those of its facets, which is said."""
    note, pin = "area of a round face: that of its facets", fo.Cylinder(5, 10, name="pin")
    mesh, box = fo.Body.convex(pin.vertices, name="pin"), fo.Box((1, 2, 3), name="box")
    facets = 32 * 2 * 5 * np.sin(np.pi / 32) * 10
    for body, area, of_facets in ((pin, 100 * np.pi, False), (mesh, facets, True), (box, 2.0, False)):
        told = printed(lambda own: print_faces(own, "movable"), body)
        assert (note in told) == of_facets
        assert f" {area:.6g} " in f"{told} ".replace("\n", " ")


def test_a_stack_up_names_one_wall_of_two_and_that_another_is_as_near() -> None:
    key = fo.Box((9.98, 8, 4), name="key")
    walls = [fo.Box((4, 20, 10), centre=(x, 0, 0)) for x in (-7, 7)]
    base = fo.Body.from_parts([own.vertices for own in walls], name="base")
    size = fo.Size("width", "movable", faces=["+x", "-x"], each=0.5, tolerance=0.01)
    asked = fo.Problem(key, base, motion=fo.Translation("x"), target=(1, 1), goal="clear", sizes=[size])
    assert fo.stack_up(asked).deciding_contact.endswith("(and 1 as near)")
    aside = np.eye(4)
    aside[0, 3] = 0.004
    assert "as near" not in fo.stack_up(asked, pose=aside).deciding_contact
