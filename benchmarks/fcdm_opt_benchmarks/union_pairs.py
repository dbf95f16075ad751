"""Bodies of many convex parts, and poses in which they are a little apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fcdm_opt.geometry.bodies import Body
from fcdm_opt_benchmarks.coal_shapes import coal_requests, coal_surface
from fcdm_opt_benchmarks.shapes import prism, random_rotation

GROWTH = (1.05, 1.5)  # both scales at which the poses touch: apart as drawn, and the curve crosses the box
NEAR = 1e-3  # of the bodies' reach: touching, for placing them
KEPT = 0.7  # share of the cells of a ball that are kept as chunks
STRIP = np.array([[0, -1], [1, -1], [1, 1], [0, 1]])  # outline of a bar's pieces

Parts = list[np.ndarray]


def spiky(rng: np.random.Generator, count: int) -> Parts:
    """Make a star: spikes on all sides, each from a common core, so that all contain the seed."""
    core = np.vstack([np.eye(3), -np.eye(3)]) * 0.25
    if count == 1:
        return [core * rng.uniform(2, 4, 3)]
    tips = _spread(rng, count) * rng.uniform(0.8, 1.2, (count, 1))
    blunt = 0.1 / np.sqrt(count)
    return [np.vstack([core, tip + blunt * rng.normal(size=(3, 3))]) for tip in tips]


def gear(rng: np.random.Generator, count: int) -> Parts:
    """Make a spur gear with a bore: hub pieces side by side around it and teeth on them, none with the seed."""
    height = 0.15
    if count < 6:
        return [prism(STRIP + np.array([k - count / 2, 0]), -height, height) for k in range(count)]
    pieces = max(3, count // 3)
    teeth = count - pieces
    hub, root, tip = 0.3, 0.8, 1.0
    start = rng.uniform(0, 2 * np.pi)

    def corner(share: float, radius: float) -> list[float]:
        return [radius * np.cos(start + 2 * np.pi * share), radius * np.sin(start + 2 * np.pi * share)]

    outlines = []
    for k in range(pieces):
        sides = ((0, hub), (1, hub), (1, root), (0, root))
        outlines.append([corner((k + share) / pieces, radius) for share, radius in sides])
    flat = root * np.cos(np.pi / pieces)  # of the hub's sides
    for k in range(teeth):
        tooth = ((0.25, 0.9 * flat), (0.75, 0.9 * flat), (0.6, tip), (0.4, tip))
        outlines.append([corner((k + share) / teeth, radius) for share, radius in tooth])
    return [prism(outline, -height, height) for outline in outlines]


def chunks(rng: np.random.Generator, count: int) -> Parts:
    """Cut a ball into the cells of random sites, a share of them left out at random."""
    from scipy.spatial import HalfspaceIntersection

    cells = max(count, round(count / KEPT))
    sites = _spread(rng, cells) * np.cbrt(rng.uniform(0.02, 0.9, (cells, 1)))
    directions = _spread(rng, 60)
    ball = np.column_stack([directions, -np.ones(len(directions))])
    made = []
    for k in rng.permutation(cells)[:count]:
        others = np.delete(sites, k, axis=0)
        walls = np.column_stack([others - sites[k], -((others**2).sum(axis=1) - sites[k] @ sites[k]) / 2])
        made.append(HalfspaceIntersection(np.vstack([ball, walls]), sites[k]).intersections)
    return made


def _spread(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return unit directions on a spiral over the sphere, turned at random."""
    k = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * k / count), np.pi * (1 + np.sqrt(5)) * k
    points = np.column_stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)])
    return points @ random_rotation(rng).T


FAMILIES: dict[str, Callable[[np.random.Generator, int], Parts]] = {"spiky": spiky, "gear": gear, "chunks": chunks}


@dataclass(frozen=True, eq=False)
class UnionPair:
    """Two bodies of many parts, seeds at 0, and transforms that put them a little apart.

    Attributes
    ----------
    parts : tuple
        Corners of the parts of each body.
    bodies : tuple of Body
    transforms : (poses, 4, 4) array
    """

    parts: tuple[Parts, Parts]
    bodies: tuple[Body, Body]
    transforms: np.ndarray

    @classmethod
    def of(cls, seed: int, family: str, count: int, poses: int) -> UnionPair:
        """Draw two bodies of `count` parts each."""
        rng = np.random.default_rng([seed, list(FAMILIES).index(family), count])
        parts = FAMILIES[family](rng, count), FAMILIES[family](rng, count)
        one, two = (Body.from_parts(own, seed=np.zeros(3), name=f"{family} {k + 1}") for k, own in enumerate(parts))
        reach = sum(float(np.linalg.norm(body.vertices, axis=1).max()) for body in (one, two))
        surfaces = coal_surface(one), coal_surface(two)
        return cls(parts, (one, two), np.array([_pose(rng, *surfaces, reach) for _ in range(poses)]))


def _pose(rng: np.random.Generator, one: Any, two: Any, reach: float) -> np.ndarray:
    """Turn body 1 at random and put it on any side of body 2, where equal scales of `GROWTH` make them touch.

    It comes in from outside by its distance until it touches; all lengths grow with both scales.
    """
    import coal

    way, R, fixed = _spread(rng, 1)[0], random_rotation(rng), coal.Transform3s()
    (request, _), result = coal_requests(), coal.DistanceResult()
    offset, left = 1.1 * reach, np.inf
    while left > NEAR * reach and offset > NEAR * reach:
        result.clear()
        left = coal.distance(one, coal.Transform3s(R, offset * way), two, fixed, request, result)
        offset -= left
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, rng.uniform(*GROWTH) * max(offset, NEAR * reach) * way
    return T
