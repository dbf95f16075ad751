"""A convex pair as rivals take it: in units of the larger body, so that their absolute tolerances are relative."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve.kernels import E1E2, F1V2, V1F2
from fcdm_opt.errors import FcdmError, InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt_benchmarks.method import ContactAnswer, Pair, Touching, anything

Elements = tuple[tuple[list[tuple[int, ...]], list[tuple[int, ...]]], ...]


class SeededPart(NamedTuple):
    """A convex part about its seed: vertices, and radii of the balls about the seed inside and around it."""

    vertices: Array
    inner: float
    outer: float

    @classmethod
    def of(cls, body: Body) -> SeededPart:
        """Return a body's only part; raise `InputError` for several, or a seed that is not inside."""
        if len(body.parts) != 1:
            raise InputError("the rival methods take one convex part", key=f"body '{body.name}'", found=len(body.parts))
        (part,) = body.parts
        local = part.vertices - part.seed
        inner = (part.normals * local[[loop[0] for loop in part.loops]]).sum(axis=1).min()
        if not inner > 0:
            raise InputError("the rival methods need the seed inside", key=f"body '{body.name}'", found=body.seed)
        return cls(np.ascontiguousarray(local), float(inner), float(np.linalg.norm(local, axis=1).max()))


@dataclass(frozen=True, eq=False)
class Placed:
    """Both parts about their seeds, and where a transform puts them; lengths in units of the larger body's reach.

    Attributes
    ----------
    one, two : SeededPart
    unit : float
    seeds : pair of (3,) arrays
    """

    one: SeededPart
    two: SeededPart
    unit: float
    seeds: tuple[Array, Array]

    @classmethod
    def of(cls, pair: Pair) -> Placed:
        """Return a pair's parts; raise `InputError` for several, or a seed that is not inside."""
        one, two = (SeededPart.of(body) for body in pair)
        unit = max(one.outer, two.outer)
        one, two = (SeededPart(own.vertices / unit, own.inner / unit, own.outer / unit) for own in (one, two))
        return cls(one, two, unit, (pair.movable.seed, pair.static.seed))

    def pose(self, transform: Array) -> tuple[Array, Array]:
        """Return R (3, 3) and d = s_2 - moved s_1, (3,)."""
        R = transform[:3, :3]
        return R, (self.seeds[1] - R @ self.seeds[0] - transform[:3, 3]) / self.unit

    def between(self, d: Array, rho1: float) -> tuple[float, float]:
        """Return a rho_2 at which the parts are apart or barely touch, 0 if none is known, and one at which they meet.

        From the balls about the seeds, around and inside the parts.
        """
        way = math.sqrt(d @ d)
        return max(way - rho1 * self.one.outer, 0.0) / self.two.outer, way / self.two.inner


def elements(pair: Pair) -> Elements:
    """Return, by kind of feature, the sorted vertices of either part's elements by their numbers.

    So are named the smallest faces that touch: the vertices of a face, an edge's ends, or one.
    """
    parts = pair.movable.parts[0], pair.static.parts[0]
    faces = [[tuple(sorted(loop)) for loop in part.loops] for part in parts]
    edges = [[tuple(sorted(own)) for own in part.edges[:, :2].tolist()] for part in parts]
    vertices = [[(k,) for k in range(len(part.vertices))] for part in parts]
    by_kind: dict[int, Any] = {F1V2: (faces[0], vertices[1]), V1F2: (vertices[0], faces[1]), E1E2: (edges[0], edges[1])}
    return tuple(by_kind[kind] for kind in range(len(by_kind)))


def answered(rho2: float, touching: Touching | None = None) -> ContactAnswer:
    """Return the answer to a contact question; raise `FcdmError` where it is none."""
    if not 0.0 < rho2 < math.inf:
        raise FcdmError(f"no scale of body 2 above 0 touches: {rho2}")
    return ContactAnswer(float(rho2), touching)


def seeds_inside(pair: Pair) -> str | None:
    """Return what keeps a pair from having one decreasing curve, see `SeededPart.of`."""
    try:
        Placed.of(pair)
    except InputError as reason:
        return str(reason)
    return None


def up_to(most: int, reason: str, untracked: Callable[[Pair], str | None] = anything) -> Callable[[Pair], str | None]:
    """Return what refuses pairs of more than `most` vertices a body, and what something else refuses."""

    def refuses(pair: Pair) -> str | None:
        vertices = max(len(body.vertices) for body in pair)
        return f"{reason} above {most:,} vertices" if vertices > most else untracked(pair)

    return refuses
