"""Pairs opened and closed by very little, and whether their sign is told right."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

import fcdm_opt as fo
from contenders import coal_requests
from fcdm_opt_benchmarks.library import coal_hull
from fcdm_opt_benchmarks.pairs import random_hull, random_pose

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from oracles import exact_curve
from strategies import random_pair

OPENINGS = (1e-9, 1e-11, 1e-13)
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


@dataclass
class Openings:
    """Counts right signs over pairs, by opening and by who says it.

    The truth is exact: all facets of the Minkowski difference in integers, tests/oracles.py, at the scale pair as it
    was rounded.
    """

    name: str
    tolerances: tuple[float, ...]
    cases: dict[float, int] = field(default_factory=lambda: dict.fromkeys(OPENINGS, 0))
    right: dict[float, dict[str, int]] = field(default_factory=lambda: {opening: {} for opening in OPENINGS})

    def add(self, one: fo.Body, two: fo.Body, transform: np.ndarray) -> None:
        """Open and close one pair along a ray of the scale plane, seeds inside."""
        pair = exact_curve(one.vertices, one.seed, two.vertices, two.seed, pose=transform).pair
        angle = 0.25 + 1.1 * (sum(self.cases.values()) / 7 % 1)
        ray = [Fraction(float(x)) for x in (np.cos(angle), np.sin(angle))]
        touch = max(Fraction(f.line[2]) / (f.line[0] * ray[0] + f.line[1] * ray[1]) for f in pair.facets)
        curve = fo.decision_curve(one, two, transform=transform)
        coal = _Coal(one, two, transform, self.tolerances)
        for opening in OPENINGS:
            for sign in (1, -1):
                rho = np.array([float(touch * x * (1 - sign * Fraction(opening))) for x in ray])
                truth = pair.side(rho)
                assert truth == sign, "the opening was lost in rounding the scale pair"
                self.cases[opening] += 1
                for name, answer in {"gap": np.sign(curve.gap(rho)), **coal.signs(rho)}.items():
                    self.right[opening].setdefault(name, 0)
                    self.right[opening][name] += int(answer == truth)

    def rows(self) -> list[dict[str, Any]]:
        """One row an opening."""
        return [
            {"pairs": self.name, "opening": opening, "cases": self.cases[opening], "right": self.right[opening]}
            for opening in OPENINGS
        ]


class _Coal:
    """Both bodies for coal, about their seeds, scaled to a size of about one."""

    def __init__(self, one: fo.Body, two: fo.Body, transform: np.ndarray, tolerances: tuple[float, ...]) -> None:
        import coal

        self._coal = coal
        self._bases, self._shapes = [], []
        for body in (one, two):
            self._shapes.append(coal_hull(body.vertices - body.seed))
            self._bases.append(self._shapes[-1].points().copy())
        R = transform[:3, :3]
        self._offset = R @ one.seed + transform[:3, 3] - two.seed
        self._pose, self._fixed = coal.Transform3s(), coal.Transform3s()
        self._pose.setRotation(R)
        self._requests = {"default": coal_requests(None)}
        self._requests |= {f"{tolerance:g}": coal_requests(tolerance) for tolerance in tolerances}

    def signs(self, rho: np.ndarray) -> dict[str, int]:
        """Return what coal's distance and collide say, by setting: 1 apart, 0 touching, -1 overlapping."""
        reach = max(scale * np.abs(base).max() for scale, base in zip(rho, self._bases, strict=True))
        unit = 2.0 ** np.ceil(np.log2(reach))  # a power of two: no rounding
        for scale, base, shape in zip(rho, self._bases, self._shapes, strict=True):
            np.multiply(base, scale / unit, out=shape.points())
        self._pose.setTranslation(self._offset / unit)
        pair = self._shapes[0], self._pose, self._shapes[1], self._fixed
        found = {}
        for name, (distance, collision) in self._requests.items():
            value = self._coal.distance(*pair, distance, self._coal.DistanceResult())
            sane = abs(value) < 1e100  # some settings return the largest float
            found[f"coal distance, {name}"] = int(np.sign(value)) if sane else 0
            hit = self._coal.collide(*pair, collision, self._coal.CollisionResult())
            found[f"coal collide, {name}"] = -1 if hit else 1
        return found
