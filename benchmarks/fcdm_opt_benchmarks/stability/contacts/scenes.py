"""What the hard contacts are made of: solids of plain numbers, poses, and scenes of two of them.

Most scenes are scaled to exact touch and then opened or closed by a stated relative amount of the scale of body 2. What
is right of them is worked out elsewhere, from the floats that come out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from itertools import permutations, product
from math import cos, sin
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt_benchmarks import shapes

Solid = dict[str, Any]
STILL = np.eye(4)
WIDE = ((1e-3, 1e3), (1e-3, 1e3))
SLIGHT = (0.0, 1e-3, -1e-7, 1e-9, -1e-5, 1e-7, -1e-9, 1e-12, -1e-12)  # taken in turn by the scenes of a family


class HardPair(NamedTuple):
    """Two solids, a pose of the first one, and the scales that are asked about.

    Attributes
    ----------
    name : str
    one, two : dict
        `vertices`, `seed` and `parts` (None: one convex part).
    transform : (4, 4) array
    rho : (float, float)
    opening : float or None
        The scale of body 2 is not the given one, but its least contact scale made smaller by this share of it, rounded
        to a float; where there is none the given one stays.
    box : ((lo, hi), (lo, hi))
    blur : float
        Length of edges that are below `Tolerances.planarity`, and whose ends may therefore be taken as one corner.
    heavy : bool
        Only in the full form.
    """

    name: str
    one: Solid
    two: Solid
    transform: Array = STILL
    rho: tuple[float, float] = (1.0, 1.0)
    opening: float | None = None
    box: tuple[tuple[float, float], tuple[float, float]] = WIDE
    blur: float = 0.0
    heavy: bool = False

    def opened(self, opening: float) -> HardPair:
        """Return the scene at its contact scale, opened by a relative amount."""
        return self._replace(name=f"{self.name}, opened by {opening:g}", opening=opening)


def seen(name: str, one: Solid, two: Solid, frame: Array, **settings: Any) -> HardPair:
    """Return a scene of two solids as drawn in another frame, rounded to floats."""
    return HardPair(name, placed(one, frame), placed(two, frame), **settings)


def each(scenes: Iterable[HardPair], openings: Sequence[float]) -> list[HardPair]:
    """Return every scene opened by every amount."""
    return [scene.opened(opening) for scene in scenes for opening in openings]


def turns(scenes: Iterable[HardPair], openings: Sequence[float] = SLIGHT, count: int = 1) -> list[HardPair]:
    """Return every scene opened by so many of the amounts, the next ones in turn."""
    taken = 0
    made = []
    for scene in scenes:
        made += [scene.opened(openings[(taken + k) % len(openings)]) for k in range(count)]
        taken += count
    return made


Drawing = Callable[[np.random.Generator], Iterable[HardPair]]
Families = dict[str, Callable[[np.random.Generator], list[HardPair]]]


def family(families: Families, name: str, count: int = 0) -> Callable[[Drawing], Callable[..., list[HardPair]]]:
    """Put what a function draws among the families, each scene opened by `count` of the amounts, or none, in turn."""

    def registered(draw: Drawing) -> Callable[[np.random.Generator], list[HardPair]]:
        @wraps(draw)
        def scenes(rng: np.random.Generator) -> list[HardPair]:
            made = list(draw(rng))
            return turns(made, count=count) if count else made

        families[name] = scenes
        return scenes

    return registered


# -------------------------------------------------------------------------------------------------------------- solids


def solid(vertices: Any, seed: Any = (0.0, 0.0, 0.0), parts: Any = None) -> Solid:
    """Return a solid of plain numbers."""
    own = None if parts is None else [list(part) for part in parts]
    return {"vertices": np.array(vertices, float).tolist(), "seed": np.array(seed, float).tolist(), "parts": own}


def cuboid(*half: float) -> Solid:
    """Return a box about the origin."""
    return solid(shapes.box([-x for x in half], half))


def stretched(own: Solid, *factors: float) -> Solid:
    """Return a solid with its seed times one factor, or one an axis."""
    by = np.array(factors if len(factors) == 3 else factors * 3)
    return solid(np.array(own["vertices"]) * by, np.array(own["seed"]) * by, own["parts"])


def shifted(own: Solid, shift: Sequence[float] | Array) -> Solid:
    """Return a solid with its seed moved, rounded to floats."""
    return solid(np.array(own["vertices"]) + shift, np.array(own["seed"]) + shift, own["parts"])


def placed(own: Solid, matrix: Array) -> Solid:
    """Return a solid with its seed moved by a 4x4 matrix, rounded to floats."""
    R, t = matrix[:3, :3], matrix[:3, 3]
    return solid(np.array(own["vertices"]) @ R.T + t, R @ np.array(own["seed"]) + t, own["parts"])


def seeded(own: Solid, seed: Sequence[float]) -> Solid:
    """Return a solid with another seed."""
    return {**own, "seed": [float(x) for x in seed]}


def hull_of(rng: np.random.Generator, count: int) -> Solid:
    """Return points on a sphere of radius about 1, seed inside."""
    return solid(shapes.random_directions(rng, count) * rng.uniform(0.8, 1.0, (count, 1)))


def prism(sides: int, phase: float = 0.0, half: float = 1.0) -> Solid:
    """Return a prism about the z axis."""
    return solid(shapes.prism(shapes.polygon(sides, phase), -half, half))


def pyramid(sides: int, phase: float = 0.0) -> Solid:
    """Return a pyramid about the z axis, its apex above."""
    base = shapes.polygon(sides, phase).tolist()
    return solid([*((x, y, -1.0) for x, y in base), (0.0, 0.0, 1.0)], (0.0, 0.0, -0.5))


CUBE = cuboid(1.0, 1.0, 1.0)
SMALL_CUBE = cuboid(0.5, 0.5, 0.5)
SLAB, BLOCK = cuboid(1.0, 2.0, 3.0), cuboid(3.0, 1.0, 2.0)
OCTAHEDRON = solid([(2, 0, 0), (-2, 0, 0), (0, 2, 0), (0, -2, 0), (0, 0, 2), (0, 0, -2)])
TETRAHEDRON = solid([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)])
DIAMOND = solid([(x, y, z) for z in (-1, 1) for x, y in ((2, 0), (-2, 0), (0, 2), (0, -2))])


# --------------------------------------------------------------------------------------------------------------- poses


def turned(axis: int, angle: float) -> Array:
    """Return the 4x4 turn about a coordinate axis."""
    matrix = np.eye(4)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i] = matrix[j, j] = cos(angle)
    matrix[i, j], matrix[j, i] = -sin(angle), sin(angle)
    return matrix


def moved(shift: Sequence[float] | Array, turn: Array = STILL) -> Array:
    """Return a turn followed by a shift."""
    matrix = turn.copy()
    matrix[:3, 3] = shift
    return matrix


def random_turn(rng: np.random.Generator) -> Array:
    """Return a random rotation."""
    turn = np.eye(4)
    turn[:3, :3] = shapes.random_rotation(rng)
    return turn


def orientations() -> list[Array]:
    """Return the 24 turns that map the axes to axes."""
    found = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        matrix = np.eye(4)
        matrix[:3, :3] = np.diag(signs) @ np.eye(3)[list(order)]
        if np.linalg.det(matrix) > 0:
            found.append(matrix + 0.0)
    return found


TILT = turned(0, 0.61) @ turned(1, -0.37) @ turned(2, 1.23)


def box_of(sides: Sequence[float]) -> Solid:
    """Return a box of given sides about the origin."""
    return cuboid(*(side / 2 for side in sides))


def random_way(rng: np.random.Generator) -> Array:
    """Return a random unit vector."""
    return shapes.random_directions(rng, 1)[0]


def sphere(rng: np.random.Generator, count: int) -> Solid:
    """Return random points on the unit sphere: all of them are corners."""
    return solid(shapes.random_directions(rng, count))
