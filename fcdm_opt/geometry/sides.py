"""Sides of polygons, the edges that they run along, and what hangs together by these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.measures import units

Polygon = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Sides:
    """Directed sides of polygons, three after another of triangles.

    Attributes
    ----------
    origin, end : (s,) int arrays
        Rows of the points.
    face : (s,) int array
        The polygon that each is of.
    edge : (s,) int array
        The number of the edge that each runs along, one way or the other.
    """

    origin: Ints
    end: Ints
    face: Ints
    edge: Ints

    @classmethod
    def of(cls, polygons: Sequence[Polygon]) -> Sides:
        """Return the sides of polygons, one after another."""
        sizes = np.fromiter(map(len, polygons), np.int64, len(polygons))
        return cls.around(np.fromiter((v for own in polygons for v in own), np.int64, int(sizes.sum())), sizes)

    @classmethod
    def around(cls, corners: Ints, sizes: Ints | int) -> Sides:
        """Return the sides of polygons from their corners, one polygon after another, and how many each has."""
        if isinstance(sizes, int):
            sizes = np.full(len(corners) // sizes, sizes)
        after, last = np.arange(1, len(corners) + 1), np.cumsum(sizes) - 1
        after[last] = last - sizes + 1
        end = corners[after]
        low, high = np.minimum(corners, end), np.maximum(corners, end)
        edge = np.unique(low * (corners.max(initial=0) + 1) + high, return_inverse=True)[1]
        return cls(corners, end, np.repeat(np.arange(len(sizes)), sizes), edge)

    @cached_property
    def counts(self) -> Ints:
        """How many sides each edge has."""
        return np.bincount(self.edge)

    @cached_property
    def pairs(self) -> Ints:
        """The two sides of each edge that has two, (m, 2): one that runs upwards first."""
        order = np.argsort(2 * self.edge + (self.origin > self.end), kind="stable")
        return order[self.counts[self.edge[order]] == 2].reshape(-1, 2)

    @property
    def odd(self) -> Ints:
        """Sides of edges that have an odd number of them: the surface ends there."""
        return np.flatnonzero(self.counts[self.edge] % 2)

    @property
    def unequal(self) -> Ints:
        """Sides of edges that are run along more often one way than the other."""
        ways = np.where(self.origin < self.end, 1, -1)
        return np.flatnonzero(np.bincount(self.edge, ways)[self.edge])

    def sections(self, points: Array, pairs: Ints) -> tuple[Array, Array, Array]:
        """Return the section across edges of two triangles each: along them, and to the corners opposite, (m, 3) each.

        Rounding is of the order of the lengths there, however slim the triangles are. The first one of a pair is to
        the left of the edge.
        """
        one, two = pairs.T
        opposite = self.origin.reshape(-1, 3)[:, [2, 0, 1]].ravel()
        base = points[self.origin[one]]
        along = units(points[self.end[one]] - base)
        c, d = (points[opposite[k]] - base for k in (one, two))
        c, d = (x - (x * along).sum(axis=1)[:, None] * along for x in (c, d))
        return along, c, d


def components(links: Ints, count: int) -> Ints:
    """Return the number of each one's connected component, from pairs that are linked, (k, 2)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = np.asarray(links, np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(links)), tuple(links.T)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def fans(loops: Sequence[Polygon]) -> Ints:
    """Return the triangles of convex polygons, fanned from their first corners, (t, 3)."""
    if all(len(loop) == 3 for loop in loops):
        return np.array(loops, np.int64).reshape(-1, 3)
    return np.array([(loop[0], *loop[k : k + 2]) for loop in loops for k in range(1, len(loop) - 1)])
