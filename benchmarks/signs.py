"""Pairs opened and closed by very little, and whether their sign is told right."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np

import fcdm_opt as fo
from fcdm_opt_benchmarks.coal_shapes import CoalHulls
from fcdm_opt_benchmarks.pairs import random_hull, random_pose
from fcdm_opt_benchmarks.record import Row

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from oracles import exact_curve
from strategies import random_pair

OPENINGS = (1e-9, 1e-11, 1e-13)
TOLERANCES = (None, 1e-12, 1e-15)  # of coal: its own, and whether its answers at touch are a matter of settings
Drawn = tuple[fo.Body, fo.Body, np.ndarray]


def random_pairs(rng: np.random.Generator, count: int) -> Iterator[Drawn]:
    """Random hulls of 8 vertices in random poses: nothing is parallel."""
    for _ in range(count):
        one, two = (fo.Body.convex(random_hull(rng, 8), name=name) for name in ("one", "two"))
        yield one, two, random_pose(rng, one, two)


def integer_pairs(rng: np.random.Generator, count: int) -> Iterator[Drawn]:
    """Hulls of small integers as drawn: many faces and edges are parallel."""
    drawn = 0
    while drawn < count:
        one, two = (shape.body() for shape in random_pair(rng, int(rng.choice([2, 3, 10]))))
        if (one.seed != two.seed).any():
            drawn += 1
            yield one, two, np.eye(4)


def signs_at_touch(rng: np.random.Generator, count: int) -> list[Row]:
    """Open and close pairs along a ray of the scale plane, and count who tells their sign, by kind and opening.

    The truth is exact: all facets of the Minkowski difference in integers, tests/oracles.py, at the scale pair as it
    was rounded.
    """
    rows = []
    for kind, draw in (("random hulls", random_pairs), ("parallel faces and edges", integer_pairs)):
        right: dict[float, Counter[str]] = {opening: Counter() for opening in OPENINGS}
        for number, (one, two, transform) in enumerate(draw(rng, count)):
            pair = exact_curve(one.vertices, one.seed, two.vertices, two.seed, pose=transform).pair
            angle = 0.25 + 1.1 * (6 * number / 7 % 1)
            ray = [Fraction(float(x)) for x in (np.cos(angle), np.sin(angle))]
            touch = max(Fraction(f.line[2]) / (f.line[0] * ray[0] + f.line[1] * ray[1]) for f in pair.facets)
            curve, coal = fo.decision_curve(one, two, transform=transform), _hulls(one, two, transform)
            for opening in OPENINGS:
                for sign in (1, -1):
                    rho = np.array([float(touch * x * (1 - sign * Fraction(opening))) for x in ray])
                    assert pair.side(rho) == sign, "the opening was lost in rounding the scale pair"
                    told = {"gap": int(np.sign(curve.gap(rho))), **_told(coal, one, two, transform, rho)}
                    right[opening].update({who: int(said == sign) for who, said in told.items()})
        rows += [
            {"pairs": kind, "opening": opening, "cases": 2 * count, "right": dict(own)}
            for opening, own in right.items()
        ]
    return rows


def _hulls(one: fo.Body, two: fo.Body, transform: np.ndarray) -> dict[str, CoalHulls]:
    """Return both bodies for coal, about their seeds, by its setting."""
    arms = [body.vertices - body.seed for body in (one, two)]
    made = {"default" if own is None else f"{own:g}": CoalHulls(*arms, own) for own in TOLERANCES}
    for hulls in made.values():
        hulls.turn(transform[:3, :3])
    return made


def _told(
    coal: dict[str, CoalHulls], one: fo.Body, two: fo.Body, transform: np.ndarray, rho: np.ndarray
) -> dict[str, int]:
    """Return what coal's distance and collide say, by setting: 1 apart, 0 touching, -1 overlapping."""
    reach = max(scale * np.abs(body.vertices - body.seed).max() for scale, body in zip(rho, (one, two), strict=True))
    unit = 2.0 ** np.ceil(np.log2(reach))  # sizes of about one; a power of two: no rounding
    offset = two.seed - (transform[:3, :3] @ one.seed + transform[:3, 3])
    found = {}
    for name, hulls in coal.items():
        for k, scale in enumerate(rho):
            hulls.scale(k, scale / unit)
        hulls.shift(offset / unit)
        gap = hulls.gap()
        found[f"coal distance, {name}"] = int(np.sign(gap)) if abs(gap) < 1e100 else 0  # some settings give the largest
        found[f"coal collide, {name}"] = -1 if hulls.overlap() else 1
    return found
