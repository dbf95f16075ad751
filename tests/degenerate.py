"""Pairs of convex bodies at which methods fail: parallel, nearly parallel, flush, flat, tiny, huge, far away.

Every item on our own geometry in the project's list of hard cases is one list of cases here. The shapes are exact: what
is not a float is rounded to one first, so that the oracle and the package see the same numbers.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import permutations, product
from typing import Any, TypeVar

import numpy as np
from cases import CUBE, DIAMOND, OCTAHEDRON, TETRAHEDRON, Shape, box_shape, shape
from curve_checks import ODD_BOX, SEED_PAIRS
from oracles import Box, rational
from strategies import random_pair

from fcdm_opt.curve.region import Piece

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


def turned(axis: int, angle: float) -> np.ndarray:
    """4x4 turn about a coordinate axis."""
    M = np.eye(4)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    M[i, i] = M[j, j] = math.cos(angle)
    M[i, j], M[j, i] = -math.sin(angle), math.sin(angle)
    return M


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


def meeting(own: Shape, place: Sequence[Any]) -> Shape:
    """The shape moved so that its seed is at a place."""
    (at,) = rational([place])
    return own.shifted([a - b for a, b in zip(at, own.seed, strict=True)])


def gap(one: Shape, two: Shape, i: int, j: int, rho: Sequence[float]) -> list[Fraction]:
    """How far to shift `two` so that a vertex of each meet at a scale pair."""
    p, q = (Fraction(x) for x in rho)
    arms = zip(one.vertices[i], one.seed, two.vertices[j], two.seed, strict=True)
    return [p * (v - s) - q * (w - e) + s - e for v, s, w, e in arms]


TILT = turned(0, 0.61) @ turned(1, -0.37) @ turned(2, 1.23)
SLAB = box_shape((-1, -2, -3), (1, 2, 3))
BLOCK = box_shape((-3, -1, -2), (3, 1, 2))

# --------------------------------------------------------------------------------------------------- parallel faces


def orientations() -> list[np.ndarray]:
    """The 24 turns that map the axes to axes."""
    found = []
    for order, signs in product(permutations(range(3)), product((1, -1), repeat=3)):
        M = np.eye(4)
        M[:3, :3] = np.diag(signs) @ np.eye(3)[list(order)]
        if np.linalg.det(M) > 0:
            found.append(M)
    return found


def half_sizes(matrix: np.ndarray) -> np.ndarray:
    """Of `SLAB` turned by one of the orientations."""
    return np.abs(matrix[:3, :3]) @ (1, 2, 3)


BLOCK_HALF = np.array([3, 1, 2])
ORIENTED = [
    Case(f"orientation {k}: {name}", SLAB, BLOCK.shifted(factors * (half_sizes(M) + BLOCK_HALF)), M)
    for k, M in enumerate(orientations())
    for name, factors in [
        ("face on face", np.array([2, 0, 0])),
        ("edge on edge", np.array([0, 2, 2])),
        ("three lines meet at (1, 1)", np.array([1, 1, 1])),
    ]
]

NEARLY = [
    Case(f"turned by {angle:g} about {axes} axes: {name}", CUBE, CUBE.shifted(offset), pose)
    for angle in ANGLES
    for name, offset in [("face", (4, "0.5", "0.25")), ("edge", (4, 4, "0.5")), ("vertex", (4, 4, 4))]
    for axes, pose in [(1, turned(1, angle)), (2, turned(1, angle) @ turned(2, 0.7 * angle))]
]

# --------------------------------------------------------------------------------------------------- flush contacts

FLUSH_CONTACTS = [
    Case("vertex on vertex, cubes", CUBE, CUBE.shifted((4, 4, 4))),
    Case("vertex on vertex, octahedra", OCTAHEDRON, OCTAHEDRON.shifted((0, 0, 8))),
    Case("vertex on vertex, tetrahedra", TETRAHEDRON, stretched(TETRAHEDRON, -1).shifted((4, 4, 4))),
    Case("edge on edge, the same line", CUBE, CUBE.shifted((4, 4, 0))),
    Case("edge on edge, the same line, one further on", CUBE, CUBE.shifted((4, 4, 1))),
    Case("edge on edge, the same line, end to end", CUBE, CUBE.shifted((4, 4, 4))),
    Case("edge on edge, of other lengths", CUBE, SLAB.shifted((4, 6, "0.5"))),
    Case("edge on edge, diamonds", DIAMOND, DIAMOND.shifted((8, 0, 0))),
    Case("face on face, equal outlines", CUBE, CUBE.shifted((4, 0, 0))),
    Case("face on face, shifted in its plane", CUBE, CUBE.shifted((4, "0.5", "-0.25"))),
    Case("face on face, a diagonal away", CUBE, CUBE.shifted((4, 2, 2))),
    Case("face on face, one inside the other", CUBE, SLAB.shifted((4, 0, 0))),
    Case("the same cube twice", CUBE, CUBE),
    Case("the same cube twice, other seeds", CUBE, seeded(CUBE, ("0.5", "0.25", "0.125"))),
    Case("the same cube twice, a seed on a face", CUBE, seeded(CUBE, (1, 0, 0))),
    Case("the same cube twice, seeds on opposite faces", seeded(CUBE, (-1, 0, 0)), seeded(CUBE, (1, 0, 0))),
    Case("the same cube twice, seeds at opposite vertices", seeded(CUBE, (-1, -1, -1)), seeded(CUBE, (1, 1, 1))),
    Case("the same cube twice, both seeds outside", seeded(CUBE, (3, 0, 0)), seeded(CUBE, (3, 1, 0))),
    Case("a cube and its mirror image", CUBE, stretched(CUBE, -1)),
]

# ------------------------------------------------------------------------------------------------------- seeds and d

SEED_PLACES = {
    "inside": (0, 0, 0),
    "face": (1, 0, 0),
    "edge": (1, 1, 0),
    "vertex": (1, 1, 1),
    "outside": (3, "0.5", "0.25"),
    "outside in a face's plane": (1, 3, 0),
    "outside in an edge's line": (1, 1, 3),
}
SEEDED = [
    Case(f"seeds: {p}, {q}; two {where}", seeded(CUBE, first), seeded(SLAB, second).shifted(offset))
    for (p, first), (q, second) in product(SEED_PLACES.items(), SEED_PLACES.items())
    for where, offset in [("away", (5, 1, 2)), ("behind", (-5, 1, 2)), ("at the same place", (0, 0, 0))]
]
NO_OFFSET = [
    Case(f"d = 0, seeds: {p}, {q}, {name}", seeded(CUBE, first), meeting(seeded(own, second), first))
    for (p, first), (q, second) in product(SEED_PLACES.items(), SEED_PLACES.items())
    for name, own in [("cubes", CUBE), ("a cube and an octahedron", OCTAHEDRON)]
]
DIRECTIONS = {
    "through a face": (4, "0.5", "0.25"),
    "through the middle of a face": (4, 0, 0),
    "through an edge": (4, 4, "0.5"),
    "through the middle of an edge": (4, 4, 0),
    "through a vertex": (4, 4, 4),
    "parallel to a face": (0, 3, 5),
    "along an edge of a tetrahedron": (4, -4, 0),
    "along a normal of a tetrahedron": (-4, 4, 4),
    "through a vertex of an octahedron": (0, -5, 0),
}
DIRECTED = [
    Case(f"d {where}: {name}", one, two.shifted(d))
    for where, d in DIRECTIONS.items()
    for name, one, two in [
        ("cubes", CUBE, CUBE),
        ("cube, tetrahedron", CUBE, TETRAHEDRON),
        ("octahedron, tetrahedron", OCTAHEDRON, TETRAHEDRON),
        ("cube, seed on a face", seeded(CUBE, (0, 0, 1)), CUBE),
        ("cubes, both seeds on faces that d lies in", seeded(CUBE, (1, 0, 0)), seeded(CUBE, (-1, 0, 0))),
        ("octahedron, tetrahedron, seeds at vertices", seeded(OCTAHEDRON, (0, 2, 0)), seeded(TETRAHEDRON, (1, 1, 1))),
    ]
]

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

# ------------------------------------------------------------------------------------------------ sizes and places

POWERS = (-8, -6, -4, -2, 2, 4, 6, 8)
SIZE_RATIOS = [
    Case(f"size ratio 1e{k}: {name}", own, other.shifted([1.5 * (1 + reach * 10.0**k) * x for x in direction]))
    for k in POWERS
    for name, own, reach, other, direction in [
        ("cubes face on face", stretched(CUBE, 10.0**k), 1, CUBE, (1, 0, 0)),
        ("cubes face on face, off the middle", stretched(CUBE, 10.0**k), 1, CUBE, (1, 0.25, 0.125)),
        ("cubes vertex on vertex", stretched(CUBE, 10.0**k), 1, CUBE, (1, 1, 1)),
        ("octahedron and tetrahedron", stretched(OCTAHEDRON, 10.0**k), 2, TETRAHEDRON, (1, 0.3, 0.2)),
        ("tilted tetrahedra", stretched(placed(TETRAHEDRON, TILT), 10.0**k), 1, TETRAHEDRON, (0.6, 0.7, 0.2)),
    ]
]
THIN = [(k, 10.0**-k) for k in (4, 6, 8)]
ASPECTS = [
    Case(f"aspect 1e{k}: {name}", one, two.shifted(offset))
    for k, t in THIN
    for plate, needle in [(stretched(CUBE, 1, 1, t), stretched(CUBE, 1, t, t))]
    for name, one, two, offset in [
        ("plates face on face", plate, plate, (0, 0, 3 * t)),
        ("plates edge on edge", plate, plate, (3, 0.25, 0)),
        ("plates crossed", plate, stretched(CUBE, t, 1, 1), (1.5, 0.25, 0.5)),
        ("needles end to end", needle, needle, (3, 0, 0)),
        ("needles crossed", needle, stretched(CUBE, t, 1, t), (0.5, 0.25, 3 * t)),
        ("a needle on a cube", stretched(CUBE, t, t, 1), CUBE, (0.25, 0.125, 3)),
        ("a long one on a plate", stretched(CUBE, 1 / t, 1, 1), stretched(CUBE, 1 / t, 1 / t, 1), (0, 5, 3)),
        ("flat tetrahedra", stretched(TETRAHEDRON, 1, 1, t), stretched(TETRAHEDRON, 1, t, 1), (1, 2, 0.5)),
        ("thin, tilted", placed(stretched(TETRAHEDRON, 1, t, t), TILT), stretched(OCTAHEDRON, 1, t, 1), (1, 0.5, 0.25)),
        ("a plate, tilted, on a plate", placed(plate, TILT), placed(plate, TILT), tuple(TILT[:3, 2] * 3 * t)),
    ]
]
PLAIN = [
    ("face on face", CUBE, CUBE.shifted((4, "0.5", "0.25"))),
    ("edge on edge", CUBE, SLAB.shifted((4, 6, "0.5"))),
    ("vertex on vertex", CUBE, CUBE.shifted((4, 4, 4))),
    ("octahedron and tetrahedron", OCTAHEDRON, TETRAHEDRON.shifted((4, 2, 1))),
    ("seeds outside", seeded(CUBE, (3, "0.5", "0.25")), seeded(OCTAHEDRON, (0, 3, 1)).shifted((5, 1, 2))),
]
FAR = (10**6, -(10**6), 10**6)
FAR_AWAY = [
    *(Case(f"1e6 away: {name}", one.shifted(FAR), two.shifted(FAR)) for name, one, two in PLAIN),
    *(
        Case(f"brought from 1e6 away: {name}", rounded(one.shifted(FAR)), two, homing)
        for name, one, two in PLAIN
        for homing in [np.block([[np.eye(3), -np.array(FAR)[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])]
    ),
]
FAR_TILTED = [
    Case(f"1e6 away, tilted: {name}", *(rounded(placed(own, TILT).shifted(FAR)) for own in (one, two)))
    for name, one, two in PLAIN
]
UNITS = [
    Case(f"unit {unit:g}: {name}", stretched(one, unit), stretched(two, unit))
    for unit in (1e-6, 1e-3, 1e3, 1e6)
    for name, one, two in [
        *PLAIN,
        ("tilted tetrahedra", placed(TETRAHEDRON, TILT), placed(TETRAHEDRON.shifted((3, 1, 2)), TILT @ TILT)),
    ]
]

# --------------------------------------------------------------------------------------------------- many points

HEXAGON = [(3, 0, 3), (0, 3, 3), (-3, 3, 3), (-3, 0, 3), (0, -3, 3), (3, -3, 3), (0, 0, 3)]
LOWER = [(4, 1, 0), (1, 4, 0), (-4, 2, 0), (-1, -4, 0), (2, 1, -3), (-1, 2, -3), (-2, -1, -4), (3, -3, -1)]
SEVEN_OF_FIFTEEN = shape([*HEXAGON, *LOWER], (0, 0, 0))  # the seventh lies inside the face
GRID = shape(list(product((-1, 0, 1), repeat=3)), (0, 0, 0))  # a cube with points on edges, on faces and inside
REPEATED = shape([*CUBE.vertices, *CUBE.vertices[::-1], (0, 0, 0), ("0.5", "0.25", 0), (1, 1, 1)], (0, 0, 0))
INNER_FIRST = shape([(0, 0, 0), ("0.5", 1, 1), *CUBE.vertices, (-1, 0, 0)], (0, 0, 0))
MANY_POINTS = [
    Case(f"{name}, d = {offset}", one, two.shifted(offset))
    for offset in [(0, 0, 9), (9, 0, 0), (6, 6, 6), (5, "1.5", 7)]
    for name, one, two in [
        ("seven of 15 points in a plane", SEVEN_OF_FIFTEEN, stretched(SEVEN_OF_FIFTEEN, -1)),
        ("seven of 15 points in a plane on a grid", SEVEN_OF_FIFTEEN, GRID),
        ("points on all edges and faces", GRID, GRID),
        ("repeated and inner points", REPEATED, INNER_FIRST),
    ]
]
SIDED = [
    Case(f"{sides} sides: {name}", one, two)
    for sides in (3, 4, 5, 6, 7)
    for name, one, two in [
        ("prisms cap on cap", prism(sides), prism(sides).shifted((0, 0, 3.5))),
        ("prisms cap on cap, turned", prism(sides), prism(sides, 0.3).shifted((0.25, 0.125, 3.5))),
        ("prisms side by side", prism(sides), prism(sides).shifted((3, 0.5, 0.25))),
        ("prisms edge along edge", prism(sides), stretched(prism(sides), -1, -1, 1).shifted((3, 0, 0.25))),
        ("pyramid on a prism", pyramid(sides), prism(sides).shifted((0.25, 0.125, 3.5))),
        ("pyramids apex on apex", pyramid(sides), stretched(pyramid(sides), 1, 1, -1).shifted((0, 0, 3.5))),
        ("pyramids base on base", stretched(pyramid(sides), 1, 1, -1), pyramid(sides).shifted((0, 0, 3.5))),
        ("pyramids side by side", pyramid(sides), pyramid(sides).shifted((2.5, 1, 0.5))),
    ]
]
TILTED = [
    Case(f"{sides} sides, tilted: {name}", placed(one, TILT), placed(two, TILT))
    for sides in (3, 4, 5, 6, 7)
    for name, one, two in [
        ("prisms cap on cap", prism(sides), prism(sides).shifted((0, 0, 3.5))),
        ("prisms side by side", prism(sides), prism(sides).shifted((3, 0.5, 0.25))),
        ("pyramid on a prism", pyramid(sides), prism(sides).shifted((0.25, 0.125, 3.5))),
        ("pyramids apex on apex", pyramid(sides), stretched(pyramid(sides), 1, 1, -1).shifted((0, 0, 3.5))),
    ]
]

# ----------------------------------------------------------------------------------------- many features at one pair

MANY_MEET = [
    Case(f"vertices {i}, {j} meet at {rho}: {name}", one, two.shifted(gap(one, two, i, j, rho)))
    for rho in [(1.0, 1.0), (1.5, 1.25), (0.5, 3.0)]
    for name, one, two in [
        ("cube, octahedron", CUBE, OCTAHEDRON),
        ("tetrahedron, octahedron", TETRAHEDRON, OCTAHEDRON),
        ("boxes", SLAB, BLOCK),
        ("cube, seed outside, and tetrahedron", seeded(CUBE, (3, "0.5", "0.25")), TETRAHEDRON),
    ]
    for i, j in [(0, 0), (1, 2), (3, 1)]
]
SMALL_NUMBERS = [
    Case(f"small integers {seed}, seeds {p}, {q}", *random_pair(np.random.default_rng(seed), 1 + seed % 2, (p, q)))
    for seed, (p, q) in enumerate(SEED_PAIRS * 4)
]
