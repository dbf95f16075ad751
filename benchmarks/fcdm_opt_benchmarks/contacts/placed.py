"""A convex pair as rivals take it: in units of the larger body, so that their absolute tolerances are relative."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fcdm_opt.errors import FcdmError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt_benchmarks.curves.rays import SeededPart
from fcdm_opt_benchmarks.method import ContactAnswer, Pair, Touching


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


def answered(rho2: float, touching: Touching | None = None) -> ContactAnswer:
    """Return an answer; raise `FcdmError` where it is none."""
    if not 0.0 < rho2 < math.inf:
        raise FcdmError(f"no scale of body 2 above 0 touches: {rho2}")
    return ContactAnswer(float(rho2), touching)


def up_to(most: int, reason: str) -> Callable[[Pair], str | None]:
    """Return what refuses pairs of more than `most` vertices a body."""

    def refuses(pair: Pair) -> str | None:
        vertices = max(len(body.vertices) for body in pair)
        return f"{reason} above {most:,} vertices" if vertices > most else None

    return refuses


def columns(R: Array) -> Array:
    """Return the entries of a matrix column by column."""
    return np.ravel(R, order="F")
