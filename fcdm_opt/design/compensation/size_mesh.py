"""Simplices over the box of sizes: intervals of one size, triangles of two, tetrahedra of three.

Every simplex lies in one region, in which one active set makes the motion a smooth function. Vertices are places with
the values of each region that they belong to: those on a boundary have several.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations, permutations

import numpy as np

from fcdm_opt.design.compensation.changeover import NARROW
from fcdm_opt.design.compensation.sampling import NOTHING, ActiveSet
from fcdm_opt.design.compensation.table import edges_of, nodes_of, quadratic_basis, slopes, volumes
from fcdm_opt.geometry.arrays import Array

STRIP = 1.5  # times what both sides differ by in the middle of the strip between a boundary and its chord
FLAT = 1e-7  # of the box: simplices of less volume than a cube with such sides are none

Values = dict[ActiveSet, Array]
Ends = tuple[int, int]
Facet = tuple[int, ...]


@dataclass(eq=False)
class MeshVertex:
    """A place with the values of every region it belongs to.

    `step`, (2,), is what both sides' values, of amount and motion, differ by where it was found between two regions;
    `jumps` tells whether the motion jumps there.
    """

    place: Array
    values: Values
    number: int = -1
    step: Array = field(default_factory=lambda: np.zeros(2))
    jumps: bool = False
    bend: float = 0.0


@dataclass(eq=False)
class MeshEdge:
    """What is known of an edge."""

    middle: Values = field(default_factory=dict)  # active set -> values in its middle
    # active set -> errors of quadratic interpolation along it, of amount and motion, (2,)
    off: Values = field(default_factory=dict)
    # what both sides' values differ by in its middle, where it runs along a boundary
    step: Array = field(default_factory=lambda: np.zeros(2))
    bend: float = 0.0  # how far the boundary is off its middle
    jumps: bool = False  # whether the motion jumps at that boundary
    split: MeshVertex | None = None  # where it is to be split, should it be
    # the same on the edge itself, for where the boundary is off it by so much that simplices would turn over
    straight: MeshVertex | None = None
    must: bool = False  # whether it is to be split


@dataclass(eq=False)
class Simplex:
    """A vertex more than there are sizes; what holds it, values at its nodes and errors once it is finished."""

    # one in which regions meet has the values of its centre
    corners: tuple[int, ...]
    held: ActiveSet = NOTHING
    values: Array = field(default_factory=lambda: np.empty((0, 0)))
    errors: Array = field(default_factory=lambda: np.zeros(2))
    split: MeshVertex | None = None
    finished: bool = False

    @property
    def edges(self) -> list[Ends]:
        """Its edges in the order of `edges_of`, each with the smaller vertex first."""
        c = self.corners
        return [(min(c[i], c[j]), max(c[i], c[j])) for i, j in edges_of(len(c) - 1)]

    @property
    def facets(self) -> list[Facet]:
        """The corners of the facet opposite each corner, the smaller first."""
        return [tuple(sorted({*self.corners} - {own})) for own in self.corners]


class SizeMesh:
    """The simplices, how they are split, and what becomes of them in the map."""

    # it begins with a grid of vertices, the first size fastest, `count` along each; `edges` are those looked at
    def __init__(self, vertices: Sequence[MeshVertex], count: int) -> None:
        self.vertices: list[MeshVertex] = []
        for vertex in vertices:
            self._numbered(vertex)
        self.sizes = len(self.vertices[0].place)
        self.edges: dict[Ends, MeshEdge] = {}
        self.simplices = [Simplex(corners) for corners in _grid(count, self.sizes)]
        for simplex in self.simplices:
            if volumes(self.places(simplex)) < 0.0:
                simplex.corners = (*simplex.corners[:-2], *simplex.corners[:-3:-1])
        self.made = len(self.simplices)

    def finished(self) -> Iterator[tuple[Array, Array, Array, ActiveSet]]:
        """Yield (corners, values, errors, active set) of simplices that cover the box, see `Table`.

        Where the motion jumps at a boundary, the strip between it and its chord is a simplex' worth of its own: only
        there the other motion may be the least.
        """
        for simplex in self.simplices:
            corners, values = self.places(simplex), simplex.values
            for k, facet in enumerate(simplex.facets):
                if not self.jumps(facet):
                    continue
                bend = max(own.bend for own in self._faults(facet))
                step = np.max([own.step for own in self._faults(facet)], axis=0)
                share = min(0.5, (2.0 * bend + NARROW) * float(np.linalg.norm(slopes(corners)[k])))
                outer = np.eye(len(corners))  # barycentric coordinates
                inner = (1.0 - share) * outer + share * outer[k]  # of what is left
                others = [own for own in range(len(corners)) if own != k]
                for place in range(len(others)):
                    strip = np.vstack([outer[others[: place + 1]], inner[others[place:]]])
                    yield *_part(corners, values, strip), simplex.errors + STRIP * step, simplex.held
                corners, values = _part(corners, values, inner)
            yield corners, values, simplex.errors, simplex.held

    def _faults(self, facet: Facet) -> list[MeshEdge | MeshVertex]:
        """Return what tells of a facet how far the motion jumps: its edges, or the vertex that it is."""
        known: list[MeshEdge | None] = [self.edges.get(ends) for ends in combinations(facet, 2)]
        return [own for own in known if own is not None] if known else [self.vertices[facet[0]]]

    def boundaries(self) -> dict[tuple[ActiveSet, ActiveSet], list[Facet]]:
        """Return the facets between simplices with different active sets, by those sets."""
        sides: dict[Facet, list[ActiveSet]] = {}
        for simplex in self.simplices:
            for facet in simplex.facets:
                sides.setdefault(facet, []).append(simplex.held)
        between: dict[tuple[ActiveSet, ActiveSet], list[Facet]] = {}
        for facet, held in sides.items():
            if len(set(held)) == 2:
                one, two = sorted(held)
                between.setdefault((one, two), []).append(facet)
        return between

    def size(self, simplex: Simplex) -> float:
        """Return the longest edge of a simplex."""
        return float(self.lengths(simplex).max())

    def lengths(self, simplex: Simplex) -> Array:
        """Return the lengths of the edges of a simplex."""
        places = self.places(simplex)
        one, two = np.transpose(edges_of(self.sizes))
        return np.asarray(np.linalg.norm(places[two] - places[one], axis=1))

    def jumps(self, facet: Facet) -> bool:
        """Tell whether the motion jumps across a facet."""
        faults = self._faults(facet)
        return len(faults) == max(len(facet) * (len(facet) - 1) // 2, 1) and all(own.jumps for own in faults)

    def subdivide(self) -> None:
        """Split the simplices whose edges are to be split, all about an edge alike, and those split within."""
        self._straighten()
        pieces: list[Simplex] = []
        for simplex in self.simplices:
            cuts = self._cuts(simplex)
            if cuts:
                pieces += [Simplex(corners) for corners in self._pieces(simplex.corners, cuts)]
            elif simplex.split is not None and not simplex.finished:
                k = self._numbered(simplex.split)
                pieces += [Simplex(_instead(simplex.corners, own, k)) for own in simplex.corners]
            else:
                pieces.append(simplex)
        least, self.made = FLAT**self.sizes, self.made + len(pieces) - len(self.simplices)
        self.simplices = [piece for piece in pieces if piece.finished or volumes(self.places(piece)) > least]

    def _cuts(self, simplex: Simplex) -> list[tuple[Ends, MeshVertex]]:
        """Return the edges of a simplex that are to be split, the longest first, and where."""
        known = [(ends, edge.split) for ends in simplex.edges if (edge := self.edges.get(ends)) and edge.must]
        return sorted([(ends, split) for ends, split in known if split], key=lambda cut: (-self.length(cut[0]), cut[0]))

    def length(self, ends: Ends) -> float:
        """Return the length of an edge."""
        return float(np.linalg.norm(np.subtract(*(self.vertices[k].place for k in ends))))

    def _straighten(self) -> None:
        """Split edges on themselves, not on the boundary beside them, where a simplex would turn over."""
        changed = True
        while changed:
            changed = False
            for simplex in self.simplices:
                edges = [edge for ends in simplex.edges if (edge := self.edges.get(ends)) and edge.must]
                bent = [edge for edge in edges if edge.straight is not None and edge.split is not edge.straight]
                pieces = self._pieces(simplex.corners, self._cuts(simplex)) if bent else []
                if any(volumes(self.places(Simplex(corners))) < -(FLAT**self.sizes) for corners in pieces):
                    changed = True
                    for edge in bent:
                        edge.split = edge.straight

    def _pieces(self, corners: tuple[int, ...], cuts: list[tuple[Ends, MeshVertex]]) -> list[tuple[int, ...]]:
        """Return the simplices that one is cut into, by one edge after the other."""
        pieces = [corners]
        for ends, split in cuts:
            middle, halves = self._numbered(split), list[tuple[int, ...]]()
            for piece in pieces:
                cut = {*ends} <= {*piece}
                halves += [_instead(piece, own, middle) for own in ends] if cut else [piece]
            pieces = halves
        return pieces

    def _numbered(self, vertex: MeshVertex) -> int:
        if vertex.number < 0:
            vertex.number = len(self.vertices)
            self.vertices.append(vertex)
        return vertex.number

    def places(self, simplex: Simplex) -> Array:
        """Return the corners of a simplex, (k + 1, k)."""
        return np.array([self.vertices[k].place for k in simplex.corners])


def _instead(corners: tuple[int, ...], gone: int, joins: int) -> tuple[int, ...]:
    return tuple(joins if own == gone else own for own in corners)


def _part(corners: Array, values: Array, shares: Array) -> tuple[Array, Array]:
    """Return corners and values of a simplex in another, given its corners' barycentric coordinates, row by row."""
    return shares @ corners, quadratic_basis(nodes_of(shares).T).T @ values


def _grid(count: int, sizes: int) -> Iterator[tuple[int, ...]]:
    """Yield the simplices of a grid of vertices: along each way through a cell, mirrored from one cell to the next."""
    strides = count ** np.arange(sizes)
    for cell in np.ndindex(*[count - 1] * sizes):
        turned = (np.array(cell[::-1]) + np.eye(sizes, dtype=int)[0]) % 2
        start, steps = (cell[::-1] + turned) @ strides, (1 - 2 * turned) * strides
        for order in permutations(range(sizes)):
            yield tuple((start + np.cumsum([0, *steps[list(order)]])).tolist())
