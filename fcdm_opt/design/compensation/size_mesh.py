"""Triangles over the box of sizes.

Every triangle lies in one region, in which one active set makes the motion a smooth function. Vertices are places with
the values of each region that they belong to: those on a boundary have several.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from fcdm_opt.design.compensation.changeover import NARROW
from fcdm_opt.design.compensation.sampling import NOTHING, ActiveSet
from fcdm_opt.design.compensation.table import quadratic_basis
from fcdm_opt.geometry.arrays import Array

STRIP = 1.5  # times what both sides differ by in the middle of the strip between a boundary and its chord
FLAT = 1e-14  # of the box: area of triangles that are none

Values = dict[ActiveSet, Array]
Ends = tuple[int, int]


@dataclass(eq=False)
class MeshVertex:
    """A place with the values of every region it belongs to."""

    place: Array
    values: Values
    number: int = -1


@dataclass(eq=False)
class MeshEdge:
    """What is known of an edge.

    Attributes
    ----------
    middle : dict
        Active set -> values in its middle.
    off : dict
        Active set -> errors, (2,), of quadratic interpolation along it: of amount and motion.
    step : (2,) array
        What both sides' values differ by in its middle, where it runs along a boundary.
    bend : float
        How far the boundary is off its middle.
    jumps : bool
        Whether the motion jumps at that boundary.
    split : MeshVertex or None
        Where it is to be split, should it be; `must` if so.
    straight : MeshVertex or None
        The same on the edge itself, for where the boundary is off it by so much that triangles would turn over.
    """

    middle: Values = field(default_factory=dict)
    off: Values = field(default_factory=dict)
    step: Array = field(default_factory=lambda: np.zeros(2))
    bend: float = 0.0
    jumps: bool = False
    split: MeshVertex | None = None
    straight: MeshVertex | None = None
    must: bool = False


@dataclass(eq=False)
class Triangle:
    """Three vertices, counter-clockwise; what holds it, values at six nodes and errors once it is finished.

    One in which regions meet has the values of its centre.
    """

    corners: tuple[int, int, int]
    held: ActiveSet = NOTHING
    values: Array = field(default_factory=lambda: np.empty((0, 0)))
    errors: Array = field(default_factory=lambda: np.zeros(2))
    split: MeshVertex | None = None
    finished: bool = False

    @property
    def edges(self) -> list[Ends]:
        """Edges 12, 23, 31, each with the smaller vertex first."""
        a, b, c = self.corners
        return [(min(i, j), max(i, j)) for i, j in ((a, b), (b, c), (c, a))]


class SizeMesh:
    """The triangles, how they are split, and what becomes of them in the map.

    It begins with a grid of vertices, row by row, `count` in a row. `edges` holds those that have been looked at.
    """

    def __init__(self, vertices: Sequence[MeshVertex], count: int) -> None:
        self.vertices: list[MeshVertex] = []
        for vertex in vertices:
            self._numbered(vertex)
        self.edges: dict[Ends, MeshEdge] = {}
        self.triangles = [Triangle(corners) for corners in _grid(count)]

    def finished(self) -> Iterator[tuple[Array, Array, Array, ActiveSet]]:
        """Yield (corners, values, errors, active set) of triangles that cover the box, (3, 2), (6, 1 + k), (2,).

        Where the motion jumps at a boundary, the strip between it and its chord is a triangle's worth of its own: only
        there the other motion may be the least.
        """
        for triangle in self.triangles:
            corners, values = self.places(triangle), triangle.values
            for k, ends in enumerate(triangle.edges):
                edge = self.edges.get(ends)
                if edge is None or not edge.jumps:
                    continue
                first, second, third = k, (k + 1) % 3, (k + 2) % 3
                length = float(np.linalg.norm(corners[second] - corners[first]))
                share = min(0.5, (2.0 * edge.bend + NARROW) * length / (2.0 * abs(float(areas(corners)))))
                inner = np.eye(3)  # barycentric coordinates of what is left
                inner[first, [first, third]] = inner[second, [second, third]] = 1.0 - share, share
                one, two = np.eye(3)[[first, second]]
                for strip in ((one, two, inner[second]), (one, inner[second], inner[first])):
                    errors = triangle.errors + STRIP * edge.step
                    yield *_part(corners, values, np.array(strip)), errors, triangle.held
                corners, values = _part(corners, values, inner)
            yield corners, values, triangle.errors, triangle.held

    def boundaries(self) -> dict[tuple[ActiveSet, ActiveSet], list[Ends]]:
        """Return the edges between triangles with different active sets, by those sets."""
        sides: dict[Ends, list[ActiveSet]] = {}
        for triangle in self.triangles:
            for ends in triangle.edges:
                sides.setdefault(ends, []).append(triangle.held)
        between: dict[tuple[ActiveSet, ActiveSet], list[Ends]] = {}
        for ends, held in sides.items():
            if len(set(held)) == 2:
                one, two = sorted(held)
                between.setdefault((one, two), []).append(ends)
        return between

    def size(self, triangle: Triangle) -> float:
        """Return the longest edge of a triangle."""
        return max(float(np.linalg.norm(a - b)) for a, b in combinations(self.places(triangle), 2))

    def jumps(self, ends: Ends) -> bool:
        """Tell whether the motion jumps across an edge."""
        return ends in self.edges and self.edges[ends].jumps

    def subdivide(self) -> None:
        """Split the triangles whose edges are to be split, on both sides of an edge alike, and those split within."""
        self._straighten()
        pieces: list[Triangle] = []
        for triangle in self.triangles:
            cuts = self._cuts(triangle)
            if any(cuts):
                pieces += [Triangle(corners) for corners in self._pieces(triangle.corners, cuts)]
            elif triangle.split is not None and not triangle.finished:
                k = self._numbered(triangle.split)
                a, b, c = triangle.corners
                pieces += [Triangle((a, b, k)), Triangle((b, c, k)), Triangle((c, a, k))]
            else:
                pieces.append(triangle)
        self.triangles = [piece for piece in pieces if piece.finished or areas(self.places(piece)) > FLAT]

    def _cuts(self, triangle: Triangle) -> list[MeshVertex | None]:
        """Return where each edge of a triangle is to be split."""
        edges = [self.edges.get(ends) for ends in triangle.edges]
        return [edge.split if edge and edge.must else None for edge in edges]

    def _straighten(self) -> None:
        """Split edges on themselves, not on the boundary beside them, where a triangle would turn over."""
        changed = True
        while changed:
            changed = False
            for triangle in self.triangles:
                edges = [edge for ends in triangle.edges if (edge := self.edges.get(ends)) and edge.must]
                bent = [edge for edge in edges if edge.straight is not None and edge.split is not edge.straight]
                pieces = self._pieces(triangle.corners, self._cuts(triangle)) if bent else []
                if any(areas(self.places(Triangle(corners))) < -FLAT for corners in pieces):
                    changed = True
                    for edge in bent:
                        edge.split = edge.straight

    def _pieces(self, corners: tuple[int, int, int], cuts: list[MeshVertex | None]) -> list[tuple[int, int, int]]:
        """Return the triangles that one with one to three split edges is cut into."""
        number = [None if cut is None else self._numbered(cut) for cut in cuts]
        while number[0] is None or (number[2] is not None and number[1] is None):  # first edge is split, third last
            corners, number = (corners[1], corners[2], corners[0]), [number[1], number[2], number[0]]
        (a, b, c), (m, n, o) = corners, number
        assert m is not None
        if n is None:
            return [(a, m, c), (m, b, c)]
        if o is not None:
            return [(a, m, o), (m, b, n), (n, c, o), (m, n, o)]
        ring = [self.vertices[k].place for k in (a, m, n, c)]
        if np.linalg.norm(ring[0] - ring[2]) <= np.linalg.norm(ring[1] - ring[3]):
            return [(m, b, n), (a, m, n), (a, n, c)]
        return [(m, b, n), (a, m, c), (m, n, c)]

    def _numbered(self, vertex: MeshVertex) -> int:
        if vertex.number < 0:
            vertex.number = len(self.vertices)
            self.vertices.append(vertex)
        return vertex.number

    def places(self, triangle: Triangle) -> Array:
        """Return the corners of a triangle, (3, 2)."""
        return np.array([self.vertices[k].place for k in triangle.corners])


def _part(corners: Array, values: Array, shares: Array) -> tuple[Array, Array]:
    """Return corners and values of a triangle in another, given its corners' barycentric coordinates, row by row."""
    nodes = np.vstack([shares, (shares + np.roll(shares, -1, axis=0)) / 2])
    return shares @ corners, quadratic_basis(nodes.T).T @ values


def _grid(count: int) -> list[tuple[int, int, int]]:
    """Return the triangles of a grid of vertices, row by row."""
    made = []
    for j in range(count - 1):
        for i in range(count - 1):
            a = j * count + i
            b, c, d = a + 1, a + count + 1, a + count
            made += [(a, b, c), (a, c, d)] if (i + j) % 2 else [(a, b, d), (b, c, d)]
    return made


def areas(corners: Array) -> Array:
    """Return the areas of triangles, (..., 3, 2): negative where corners go round clockwise."""
    one, two = corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
    return np.asarray(one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]) / 2.0
