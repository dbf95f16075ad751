"""Random pairs of hulls of a given number of vertices, shape and separation, and questions about them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np

from fcdm_opt.errors import FcdmError, InputError
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body, SeedRule
from fcdm_opt_benchmarks.curves.rays import growth_distance
from fcdm_opt_benchmarks.method import ContactQuestion, CurveQuestion, Pair
from fcdm_opt_benchmarks.placed import SeededPart
from fcdm_opt_benchmarks.shapes import polygon, prism, random_directions, random_rotation

BOX = ((0.8, 3.0), (0.8, 3.0))
PARALLEL = 2.0**-32
"""Unit of all that parallel bodies are moved by: sums of such numbers up to a million are exact, so nothing turns."""
WAYS = 3  # parallel bodies lie apart along integers up to this: often in the plane of a face, or along an edge


class Separation(NamedTuple):
    """Range of growth distances, and what the box of scale pairs is multiplied by, so that the curve crosses it."""

    low: float
    high: float
    unit: float


SEPARATIONS = {
    "near": Separation(1 + 1e-6, 1 + 1e-6, 1.0),
    "middling": Separation(1.1, 2.0, 1.0),
    "far": Separation(10.0, 10.0, 10.0),
}


# ------------------------------------------------------------------------------------------------------------- shapes


def random_hull(rng: np.random.Generator, vertices: int) -> Array:
    """Points on the unit sphere with radial noise, exactly `vertices` of them, each a corner of their hull.

    The noise is half the spacing's sagitta, so that nearly all points stay corners; the others are drawn again.
    """
    from scipy.spatial import ConvexHull

    points = np.empty((0, 3))
    while len(points) < vertices:
        directions = random_directions(rng, vertices - len(points))
        noise = rng.uniform(-0.5, 0.5, len(directions)) / vertices
        points = np.vstack([points, directions * (1 + noise)[:, None]])
        points = points[np.sort(ConvexHull(points).vertices)]
    return points


def regular_prism(rng: np.random.Generator, vertices: int) -> Array:
    """Corners of a prism over a regular polygon of radius 1, of random height."""
    height = rng.uniform(0.5, 1.5)
    return prism(polygon(vertices // 2), -height, height)


def lattice_prism(rng: np.random.Generator, vertices: int) -> Array:
    """Corners of a prism over a polygon, small integers all: its sides run along the shortest vectors of the grid.

    Any two of them have parallel faces and edges; of eight vertices they are boxes.
    """
    sides = _shortest(vertices // 4)
    outline = np.cumsum(np.vstack([sides, -sides]), axis=0)
    outline = 2 * outline - (outline.min(axis=0) + outline.max(axis=0))  # centred
    scale = rng.integers(1, 4, 2 if vertices == 8 else 1)  # others keep their directions
    width = max(1, int(np.ptp(outline, axis=0).max()) // 2)
    height = int(rng.integers(width, 3 * width, endpoint=True))
    return prism(outline * scale, -height, height)


@cache
def _shortest(count: int) -> Array:
    """Return the shortest directions of the integer grid in a half-plane, by angle, (count, 2)."""
    reach = 2 + math.isqrt(4 * count)
    grid = [(x, y) for x in range(-reach, reach + 1) for y in range(reach + 1) if (y > 0 or x > 0)]
    primitive = [(x, y) for x, y in grid if math.gcd(x, y) == 1]
    chosen = sorted(primitive, key=lambda v: (v[0] ** 2 + v[1] ** 2, v[1], -v[0]))[:count]
    return np.array(sorted(chosen, key=lambda v: math.atan2(v[1], v[0])), dtype=np.int64)


class Shape(NamedTuple):
    """How hulls are drawn: their corners, a multiple of `step` of them, `most` at most; whether they stay parallel."""

    corners: Callable[[np.random.Generator, int], Array]
    step: int = 1
    most: int = 10_000
    parallel: bool = False


def _stretched(*axes: float) -> Callable[[np.random.Generator, int], Array]:
    return lambda rng, vertices: random_hull(rng, vertices) * axes


# Round hulls keep the direction of contact at all scales, so their curves have few segments however many vertices there
# are. Long ones do not: the more vertices, the more segments.
SHAPES = {
    "round": Shape(_stretched(1.0, 1.0, 1.0)),
    "long": Shape(_stretched(1.0, 0.75, 0.5)),
    "flat": Shape(_stretched(1.0, 1.0, 0.05)),
    "prism": Shape(regular_prism, step=2),
    "aligned": Shape(lattice_prism, step=4, most=1000, parallel=True),  # with more, neighbours are nearly in line
}


def why_not(vertices: int, shape: str) -> str | None:
    """Return why there is no such shape of so many vertices, None if there is."""
    if shape not in SHAPES:
        return f"shapes are {', '.join(SHAPES)}"
    step, most = SHAPES[shape].step, SHAPES[shape].most
    least = 4 if step == 1 else 8
    if least <= vertices <= most and vertices % step == 0:
        return None
    return f"{least} to {most} vertices" + (f", a multiple of {step}" if step > 1 else "")


# -------------------------------------------------------------------------------------------------------------- poses


def quarter_turns(rng: np.random.Generator) -> Array:
    """Rotation about z by a multiple of a right angle, exact, and in half of the cases upside down."""
    c, s = [(1, 0), (0, 1), (-1, 0), (0, -1)][rng.integers(4)]
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.diag([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0]][rng.integers(2)])


def _posed(
    rng: np.random.Generator,
    bodies: tuple[Body, Body],
    solids: tuple[SeededPart, SeededPart],
    separation: Separation,
    parallel: bool,
) -> tuple[Array, Array, Array]:
    """Return a transform, the vertices of body 1 turned, and the way between the seeds."""
    movable, static = bodies
    one, _ = solids
    R = quarter_turns(rng) if parallel else random_rotation(rng)
    P = one.vertices @ R.T
    way = rng.normal(size=3)
    while parallel:
        way = rng.integers(-WAYS, WAYS, 3, endpoint=True).astype(np.float64)
        if way.any():
            break
    factor = rng.uniform(separation.low, separation.high) / _met(P, solids, way, np.ones(2))
    d = way * (round(factor / PARALLEL) * PARALLEL if parallel else factor)
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = static.seed - d - R @ movable.seed
    return T, P, d


def _met(P: Array, solids: tuple[SeededPart, SeededPart], d: Array, ray: Array) -> float:
    """Return which multiple of a scale pair touches; P: vertices of body 1 turned, d: way between the seeds."""
    one, two = solids
    try:
        inner = float(ray @ [one.inner, two.inner]) / 2
        return float(growth_distance(P, two.vertices, d, ray, inner).point[0] / ray[0])
    except FcdmError:  # it may go round in circles where many columns tie: a general solver then
        from scipy.optimize import linprog

        columns = np.hstack([P.T, -two.vertices.T])
        sums = np.repeat(np.eye(2), [len(P), len(two.vertices)], axis=1)
        equations = np.column_stack([np.vstack([columns, sums]), np.append(np.zeros(3), -ray)])
        costs = np.append(np.zeros(columns.shape[1]), 1.0)
        found = linprog(costs, A_eq=equations, b_eq=np.append(d, np.zeros(2)), method="highs")
        if not found.success:
            raise FcdmError(f"no touch along a ray: {found.message}") from None
        return float(found.x[-1])


# -------------------------------------------------------------------------------------------------- pairs and questions


@dataclass(frozen=True, eq=False)
class DrawnPair:
    """Two random hulls, seeds in their middles, and questions about them, as many as are asked for, no two alike.

    Question k is drawn from the seed, the pair's labels and k alone. Every call makes it anew, so that nothing a method
    remembers by identity helps it.

    Attributes
    ----------
    pair : Pair
    vertices : int
        Of either hull.
    shape : str
        One of `SHAPES`; "aligned" ones are only moved and turned by right angles: faces and edges stay parallel.
    separation : str
        One of `SEPARATIONS`, of the bodies as drawn.
    seed : int
    """

    pair: Pair
    vertices: int
    shape: str
    separation: str
    seed: int
    _solids: tuple[SeededPart, SeededPart] = field(repr=False)
    _asked: dict[int, tuple[Array, float]] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, seed: int, vertices: int, shape: str = "round", separation: str = "middling") -> DrawnPair:
        """Draw the hulls.

        Raises
        ------
        InputError
            For names that are none, and a number of vertices that the shape cannot have.
        """
        if (reason := why_not(vertices, shape)) is not None:
            raise InputError("no such hull", key=f"{shape}, {vertices} vertices", found=vertices, allowed=reason)
        if separation not in SEPARATIONS:
            raise InputError("no such separation", key="separation", found=separation, allowed=", ".join(SEPARATIONS))
        rng = np.random.default_rng([seed, vertices, list(SHAPES).index(shape)])
        hulls = [SHAPES[shape].corners(rng, vertices) for _ in range(2)]
        middle: SeedRule = "box" if SHAPES[shape].parallel else "centroid"  # the centroid would be rounded
        movable, static = (
            Body.convex(hull, seed=middle, name=name) for hull, name in zip(hulls, ("one", "two"), strict=True)
        )
        assert all(len(body.parts[0].vertices) == vertices for body in (movable, static))
        parts = SeededPart.of(movable), SeededPart.of(static)
        return cls(Pair(movable, static), vertices, shape, separation, seed, parts)

    @property
    def box(self) -> Array:
        """Scale pairs of the curve questions, (2, 2): `BOX`, or as many times as far out as the bodies lie apart."""
        return frozen(np.array(BOX) * SEPARATIONS[self.separation].unit)

    def contact(self, k: int) -> ContactQuestion:
        """Return contact question k: rho_1 where a random ray through the box meets the curve."""
        transform, rho1 = self._drawn(k)
        return ContactQuestion(frozen(transform), rho1)

    def curve(self, k: int) -> CurveQuestion:
        """Return curve question k, the curve in `box`; the pose is that of contact question k."""
        return CurveQuestion(frozen(self._drawn(k)[0]), self.box)

    def transforms(self, count: int) -> Array:
        """Return the poses of the first questions, (count, 4, 4)."""
        return frozen([self._drawn(k)[0] for k in range(count)])

    def _drawn(self, k: int) -> tuple[Array, float]:
        if k not in self._asked:
            labels = list(SHAPES).index(self.shape), list(SEPARATIONS).index(self.separation)
            rng = np.random.default_rng([self.seed, self.vertices, *labels, k])
            separation, parallel = SEPARATIONS[self.separation], SHAPES[self.shape].parallel
            T, P, d = _posed(rng, (self.pair.movable, self.pair.static), self._solids, separation, parallel=parallel)
            (low, high), _ = BOX
            angle = rng.uniform(math.atan2(low, high), math.atan2(high, low))
            ray = np.array([math.cos(angle), math.sin(angle)])
            self._asked[k] = T, float(_met(P, self._solids, d, ray) * ray[0])
        return self._asked[k]
