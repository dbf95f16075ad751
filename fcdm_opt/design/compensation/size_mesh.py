"""Simplices over the box of sizes: intervals of one size, triangles of two, tetrahedra of three.

Every simplex lies in one region, in which one active set makes the motion a smooth function. Vertices are places with
the values of each region that they belong to: those on a boundary have several: there, along a line through the
sizes, one active set gives way to another.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np
from scipy.interpolate import KroghInterpolator
from scipy.optimize import brentq

from fcdm_opt.design.compensation.sampling import NOTHING, ActiveSet, Asking, Sample
from fcdm_opt.design.compensation.table import edges_of, nodes_of, quadratic_basis, slopes, volumes
from fcdm_opt.geometry.arrays import Array

NARROW = 1e-5  # of the box: brackets are closed to this, then both sides' continuations are intersected; nearer, two
# contacts are told apart neither by the features, 1e-9 of the size, nor always by the judge
FINEST = 1e-4  # times that, where they do not meet
MOST_ROUNDS = 60
MOST_POINTS = 4  # of each side that are continued: cubics
MISSED = 0.6  # of a bracket: what is left of it is longer where continuations misled
CLOSER = 30.0  # how much narrower a bracket becomes about a predicted crossing

Point = tuple[float, Array]
Known = tuple[float, Sample]


class Changeover(NamedTuple):
    """A place on the boundary of two regions: its position along the line, and the active sets of both.

    `values` are both sides' amount and parameters there; `sides` are points of either side, nearest last, which
    continue them.
    """

    at: float
    sets: tuple[ActiveSet, ActiveSet]
    values: tuple[Array, Array]
    sides: tuple[list[Point], list[Point]]

    def continued(self, t: float) -> tuple[Array, Array]:
        """Return what both sides continue to at a position."""
        return _curve(self.sides[0])(t), _curve(self.sides[1])(t)


def _curve(points: Sequence[Point]) -> KroghInterpolator:
    """Return the polynomial through the last points of one side."""
    places, values = zip(*points[-MOST_POINTS:], strict=True)
    return KroghInterpolator(places, values)


def changeover(
    start: Array, end: Array, known: Sequence[Known], walls: Array, alike: Callable[[Array, Array, Array], bool]
) -> Asking[Changeover]:
    """Find where, between two places with different active sets, that of the first ends.

    The bracket is narrowed about the place where both sides' continuations agree, halved where they do not say, until
    they are `alike` in all of it. Of several boundaries on the line one is found. What is `known` on it, its ends too,
    is not looked at again. Where parameters reach their limits, `walls`, (k, 2), a motion may cease to exist.
    """
    sets = [known[0][1].held, known[-1][1].held]
    sides: tuple[list[Point], list[Point]] = ([(0.0, known[0][1].values)], [(1.0, known[-1][1].values)])
    points = [*known[1:-1]]
    narrow = NARROW / max(float(np.linalg.norm(end - start)), NARROW)
    strip, missed, foreseen = None, True, None
    for _ in range(MOST_ROUNDS):
        for t, sample in points:
            if sample.held not in sets:  # a region, or but the strip in which both sides hold within rounding
                around = t - 2.0 * narrow, t + 2.0 * narrow
                neighbours = yield [start + place * (end - start) for place in around]
                if all(near.held != sample.held for near in neighbours):
                    points, strip = list(zip(around, neighbours, strict=True)), t
                    break
        width = sides[1][-1][0] - sides[0][-1][0]
        for t, (held, values) in points:
            if not sides[0][-1][0] < t < sides[1][-1][0]:
                continue
            if held in sets:
                sides[sets.index(held)].append((t, values))
            else:  # a third one takes the place of the second
                sides[1][:], sets[1] = [(t, values)], held
        low, high = sides[0][-1][0], sides[1][-1][0]
        missed, width = not points or high - low > MISSED * width, high - low
        at = _meeting(sides, walls)
        if strip is not None or width <= narrow:
            break
        if at is not None and min(map(len, sides)) > 1:
            one, two = (_curve(side) for side in sides)
            if all(alike(one(t), two(t), start + t * (end - start)) for t in (low, high)):
                break
        off = width / 3 if at is None or missed else max(width / CLOSER, narrow / 3)
        if at is not None and foreseen is not None and abs(at - foreseen) <= narrow / 4:  # twice alike
            off = min(off, narrow)
        foreseen = at
        middle = (low + high) / 2 if at is None or missed else at
        about = (middle - off / 2, middle + off / 2) if at is not None or width > 0.5 else (middle,)
        looks = [t for t in about if low < t < high]
        samples = yield [start + t * (end - start) for t in looks]
        points = list(zip(looks, samples, strict=True))
    at = strip if strip is not None else at if at is not None else (low + high) / 2
    # continued from the nearest points by no more than they are off
    found = _curve(sides[0][-2:])(at), _curve(sides[1][-2:])(at)
    return Changeover(float(at), (sets[0], sets[1]), found, sides)


def _meeting(sides: tuple[list[Point], list[Point]], walls: Array) -> float | None:
    """Return where the continuations of both sides agree in the bracket, by what differs most; None if they do not."""
    # a side without a motion has none: the other one then meets its walls
    low, high = sides[0][-1][0], sides[1][-1][0]
    curves = [_curve(side) for side in sides if np.isfinite(side[-1][1][0])]
    if not curves:
        return None

    def off(t: float) -> Array:
        values = [curve(t) for curve in curves]
        return values[0] - values[1] if len(values) == 2 else np.subtract(values[0][1:, None], walls).ravel()

    ends = np.array([off(low), off(high)])
    with np.errstate(invalid="ignore"):
        differ = np.abs(ends[1] - ends[0])
        ends[np.abs(ends) <= FINEST * NARROW / (high - low) * differ] = 0.0  # they agree at an end, but for rounding
        changes = np.where(ends[0] * ends[1] <= 0, differ, -1.0)
    changes[~np.isfinite(changes)] = -1.0
    k = int(np.argmax(changes))
    if changes[k] > 0 and not ends[:, k].all():
        return high if ends[1, k] == 0.0 else low
    return float(brentq(lambda t: off(t)[k], low, high, xtol=1e-15, rtol=1e-14)) if changes[k] > 0 else None


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

    @property
    def some(self) -> Array:
        """Its values in one of its regions, a motion where there is one."""
        return max(self.values.values(), key=lambda own: bool(np.isfinite(own[0])))


@dataclass(eq=False)
class MeshEdge:
    """What is known of an edge."""

    middle: Values = field(default_factory=dict)  # active set -> values in its middle
    # active set -> errors of quadratic interpolation along it, of amount and motion, (2,)
    off: Values = field(default_factory=dict)
    kink: Array = field(default_factory=lambda: np.full(2, np.inf))  # those of linear interpolation, whatever holds
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
        """Split the simplices whose edges are to be split, all about an edge alike."""
        self._straighten()
        pieces: list[Simplex] = []
        for simplex in self.simplices:
            cuts = self._cuts(simplex)
            if cuts:
                pieces += [Simplex(corners) for corners in self._pieces(simplex.corners, cuts)]
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
