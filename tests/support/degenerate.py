"""Pairs of convex bodies at which methods fail: parallel, nearly parallel, flush, flat, tiny, huge, far away.

Every item on our own geometry in the project's list of hard cases is one list of cases here: those of the stability
map, whose floats are taken as exact numbers, so that the oracle and the package see the same ones, and a few besides.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, TypeVar

import numpy as np
from cases import CUBE, OCTAHEDRON, Shape, box_shape, shape
from curve_checks import ODD_BOX, SEED_PAIRS
from oracles import Box
from strategies import random_pair

from fcdm_opt.curve.region import Piece
from fcdm_opt_benchmarks.stability.contacts.geometry import FAMILIES
from fcdm_opt_benchmarks.stability.contacts.scenes import TILT, HardPair

T = TypeVar("T")
RIGHT = 1e-13  # lines and settled breakpoints, relative
SLIVER = 4e-15  # pieces shorter than this, relative, may be listed or not
EVERY = 8  # with kernels in plain Python one item in so many runs
ANGLES = [10.0**-k for k in range(3, 16)]


def fewer(items: Sequence[T]) -> list[T]:
    """All items, or every few of them where nothing is compiled."""
    return list(items[::EVERY] if os.environ.get("NUMBA_DISABLE_JIT") == "1" else items)


def is_seen(piece: Piece) -> bool:
    """Whether a computed piece is longer than a sliver."""
    return not np.isfinite(piece.hi - piece.lo) or np.abs(piece.end - piece.start).sum() > SLIVER * piece.start.sum()


def condition(*lines: Any) -> float:
    """Of the system of two contact lines, each normalised."""
    return float(np.linalg.cond([line[:2] / np.hypot(*line[:2]) for line in map(np.array, lines)]))


@dataclass(frozen=True, eq=False)
class Case:
    """Two convex shapes, rounded to floats, a pose of the first, and the box that is listed."""

    name: str
    one: Shape
    two: Shape
    pose: np.ndarray | None = None
    box: Box = ODD_BOX

    def __post_init__(self) -> None:
        for key in ("one", "two"):
            object.__setattr__(self, key, rounded(getattr(self, key)))


# -------------------------------------------------------------------------------------------------------------- shapes


def rounded(own: Shape) -> Shape:
    """The shape as the package gets it."""
    return shape(own.array.tolist(), [float(x) for x in own.seed])


def stretched(own: Shape, *factors: float) -> Shape:
    """The shape and its seed times one factor, or one an axis, rounded to floats."""
    by = [Fraction(x) for x in (factors if len(factors) == 3 else factors * 3)]
    vertices = tuple(tuple(x * f for x, f in zip(row, by, strict=True)) for row in own.vertices)
    return rounded(replace(own, vertices=vertices, seed=tuple(x * f for x, f in zip(own.seed, by, strict=True))))


def placed(own: Shape, matrix: np.ndarray) -> Shape:
    """The shape moved by a 4x4 matrix in floats."""
    seed = np.array(own.seed, dtype=float)
    return shape(own.array @ matrix[:3, :3].T + matrix[:3, 3], matrix[:3, :3] @ seed + matrix[:3, 3])


def seeded(own: Shape, seed: Sequence[Any]) -> Shape:
    return shape(own.vertices, seed)


def ring(sides: int, radius: float = 1.0, phase: float = 0.0) -> np.ndarray:
    """Corners of a regular polygon, counter-clockwise; opposite ones of an even number are exactly so."""
    angle = 2 * np.pi * np.arange(sides) / sides + phase
    points = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return points if sides % 2 else np.vstack([points[: sides // 2], -points[: sides // 2]])


def prism_points(sides: int, height: float = 1.0, phase: float = 0.0) -> np.ndarray:
    """Bottom ring at -height, then top ring."""
    own = ring(sides, 1.0, phase)
    return np.vstack([np.column_stack([own, np.full(sides, z)]) for z in (-height, height)])


def pyramid_points(sides: int, height: float = 1.0, phase: float = 0.0) -> np.ndarray:
    """Base ring at -height, then the apex at +height."""
    return np.vstack([np.column_stack([ring(sides, 1.0, phase), np.full(sides, -height)]), [[0.0, 0.0, height]]])


def prism(sides: int, phase: float = 0.0) -> Shape:
    return shape(prism_points(sides, phase=phase), (0, 0, 0))


def pyramid(sides: int, phase: float = 0.0) -> Shape:
    return shape(pyramid_points(sides, phase=phase), (0, 0, -0.5))


SLAB = box_shape((-1, -2, -3), (1, 2, 3))
BLOCK = box_shape((-3, -1, -2), (3, 1, 2))

# ------------------------------------------------------------------------------------------- of the stability map


def of_map(family: str, chosen: Callable[[HardPair], bool] = lambda scene: True) -> list[Case]:
    """The scenes of a family as drawn, each once whatever the amounts by which the map opens it."""
    scenes: dict[str, HardPair] = {}
    for scene in FAMILIES[family](np.random.default_rng(0)):
        if scene.one["parts"] is scene.two["parts"] is None and not scene.heavy and chosen(scene):
            scenes.setdefault(scene.name.split(", opened")[0], scene)
    return [Case(name, drawn(own.one), drawn(own.two), own.transform) for name, own in scenes.items()]


def drawn(solid: Any) -> Shape:
    """The shape whose floats are those of a solid."""
    return shape(solid["vertices"], solid["seed"])


ORIENTED = of_map("parallel boxes")
NEARLY = of_map("turned by 1e-3 to 1e-15")
FLUSH_CONTACTS = [
    *of_map("flush contacts", lambda scene: scene.rho == (1.0, 1.0)),
    Case("edge on edge, the same line, end to end", CUBE, CUBE.shifted((4, 4, 4))),
    Case("the same cube twice, a seed on a face", CUBE, seeded(CUBE, (1, 0, 0))),
    Case("a cube and its mirror image", CUBE, stretched(CUBE, -1)),
]
SEEDED = of_map("places of the seeds", lambda scene: "closed" not in scene.name)
NO_OFFSET = of_map("seeds at one point")
DIRECTED = of_map("ways between the seeds")
SIZE_RATIOS = of_map("size ratio 1e-8 to 1e8")
ASPECTS = of_map("aspect 1e4 to 1e8")
FAR_AWAY = of_map("1e6 from the origin", lambda scene: "tilted" not in scene.name)
FAR_TILTED = of_map("1e6 from the origin", lambda scene: "tilted" in scene.name)
UNITS = of_map("micrometres, kilometres")
MANY_POINTS = [
    case
    for family in ("coplanar points", "repeated and inner points")
    for case in of_map(family, lambda scene: "tilted" not in scene.name)
]
SIDED = [
    *of_map("prisms and pyramids", lambda scene: int(scene.name.split()[0]) <= 7),
    *(
        Case(f"{sides} sides, {name}", one, two)
        for sides in (3, 4, 5, 6, 7)
        for name, one, two in [
            ("pyramids base on base", stretched(pyramid(sides), 1, 1, -1), pyramid(sides).shifted((0, 0, 3.5))),
            ("pyramids side by side", pyramid(sides), pyramid(sides).shifted((2.5, 1, 0.5))),
        ]
    ),
]
TILTED = [
    Case(f"{case.name}, tilted", placed(case.one, TILT), placed(case.two, TILT))
    for case in SIDED
    if "tilted" not in case.name
]
MANY_MEET = of_map("three features meet")

# ----------------------------------------------------------------------------------------------------- and besides

AROUND = seeded(CUBE.shifted((11, 0, 0)), (0, 0, 0))  # far from its seed: only scales near the other's bring it close
CLOSED = [
    Case(f"closed polygon: {name}", one, two)
    for name, one, two in [
        ("cubes", AROUND, seeded(CUBE.shifted((0, 11, 0)), (0, 22, 0)).shifted((11, -11, 0))),
        ("cube, octahedron", AROUND, seeded(OCTAHEDRON.shifted((0, 11, 0)), (0, 22, 0)).shifted((11, -11, 0))),
        ("cubes, tilted", placed(AROUND, TILT), placed(seeded(CUBE, (0, 11, 0)).shifted((11, 0, 0)), TILT)),
        ("slabs, tilted", placed(AROUND, TILT), placed(seeded(SLAB, (2, 11, 5)).shifted((10, "0.5", 1)), TILT)),
        ("hexagons, tilted", placed(seeded(prism(6), (9, 1, 5)), TILT), placed(seeded(prism(6), (1, 9, 4)), TILT)),
    ]
]

SMALL_NUMBERS = [
    Case(f"small integers {seed}, seeds {p}, {q}", *random_pair(np.random.default_rng(seed), 1 + seed % 2, (p, q)))
    for seed, (p, q) in enumerate(SEED_PAIRS * 4)
]
