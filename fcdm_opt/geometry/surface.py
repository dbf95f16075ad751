"""The true faces and edges of a body, which its parts' elements are named after, and what lies on them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from fcdm_opt.geometry.arrays import Array, Flags, Ints, groups_of
from fcdm_opt.geometry.measures import cross, following, norms
from fcdm_opt.geometry.polygons import Sides, area, components, hold, inside
from fcdm_opt.tolerances import DEFAULT

Rows = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Surface:
    """Faces and edges of a solid that no two of its neighbouring facets in one plane divide."""

    points: Array  # (n, 3)
    triangles: Ints  # (t, 3): rows of `points`; counter-clockwise seen from outside
    owners: Ints  # the face that each triangle is of, (t,)
    faces: tuple[Rows, ...]  # rows of each face's corners, those of its holes too, ascending
    edges: Ints  # rows of the ends of each edge, (k, 2)
    hidden: Ints  # edges inside the solid that keep names of their own, (h, 2)
    # the faces with their corners in order, counter-clockwise seen from outside; ascending of those with holes
    loops: tuple[Rows, ...]

    @classmethod
    def of(cls, points: Array, triangles: Ints, planes: Ints) -> Surface:
        """Return the surface of triangles, of which each pair with one edge and one oriented plane is one face."""
        sides = Sides.around(triangles.ravel(), 3)
        plane = planes[sides.face]
        order = np.lexsort((plane, sides.edge))
        one, two = order[:-1], order[1:]
        same = (sides.edge[one] == sides.edge[two]) & (plane[one] == plane[two])
        owners = components(sides.face[np.column_stack([one, two])[same]], len(planes))
        around = defaultdict[tuple[int, int], set[int]](set)
        ends = np.sort(np.column_stack([sides.origin, sides.end]), axis=1).tolist()
        for (low, high), face in zip(ends, owners[sides.face].tolist(), strict=True):
            around[low, high].add(face)
        edges = straightened(points, {edge: frozenset(both) for edge, both in around.items() if len(both) > 1})
        corners: list[set[int]] = [set() for _ in range(owners.max() + 1)]
        for edge, adjacent in edges.items():
            for face in adjacent:
                corners[face].update(edge)
        faces = tuple(tuple(sorted(own)) for own in corners)
        own = (triangles[some].tolist() for some in groups_of(owners))
        loops = tuple(_loop(some, face) for some, face in zip(own, faces, strict=True))
        rows = np.array(list(edges), np.int64).reshape(-1, 2)
        return cls(points, triangles, owners, faces, rows, np.empty((0, 2), np.int64), loops)

    @cached_property
    def size(self) -> float:
        """Largest distance along an axis from the first corner: the length that tolerances refer to."""
        used = np.unique(self.triangles)
        return float(np.abs(self.points[used] - self.points[used[0]]).max())

    @cached_property
    def planes(self) -> tuple[Array, Array]:
        """Outward unit normals of the faces, and a point of each."""
        corners = self.points[self.triangles]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        count = len(self.faces)
        normals = np.column_stack([np.bincount(self.owners, x, count) for x in across.T])
        largest = np.zeros(count, np.int64)
        order = np.argsort((across**2).sum(axis=1), kind="stable")
        largest[self.owners[order]] = order
        lengths = np.linalg.norm(normals, axis=1)
        return normals / np.where(lengths > 0, lengths, 1.0)[:, None], corners[largest, 0]

    def triangles_of_faces(self) -> tuple[tuple[tuple[int, ...], ...], ...]:
        """Return the triangles of each face, as rows of the points."""
        order = np.argsort(self.owners, kind="stable")
        ends = np.searchsorted(self.owners[order], np.arange(len(self.faces) + 1)).tolist()
        rows = list(map(tuple, self.triangles[order].tolist()))
        return tuple(tuple(rows[first:last]) for first, last in pairwise(ends))

    @cached_property
    def _polygons(self) -> list[Array]:
        order = np.argsort(self.owners, kind="stable")
        ends = np.searchsorted(self.owners[order], np.arange(1, len(self.faces)))
        return np.split(self.points[self.triangles[order]], ends)

    def polygons(self, face: int) -> Array:
        """Return a face's triangles, (k, 3, 3)."""
        return self._polygons[face]

    @cached_property
    def _boxes(self) -> Array:
        """Lowest and highest corner of each face's box, (2, faces, 3)."""
        return np.array([(own.min(axis=(0, 1)), own.max(axis=(0, 1))) for own in self._polygons]).swapaxes(0, 1)

    def near(self, faces: Ints, points: Array) -> Ints:
        """Return those of some faces, (k,), whose boxes meet that of points, (m, 3)."""
        (lowest, highest), slack = self._boxes[:, faces], DEFAULT.nominal * self.size
        low, high = points.min(axis=0) - slack, points.max(axis=0) + slack
        return faces[((lowest <= high) & (highest >= low)).all(axis=1)]

    def _polygons_near(self, face: int, points: Array) -> Array:
        """Return those of a face's triangles whose boxes meet that of points, (m, 3)."""
        triangles, slack = self.polygons(face), DEFAULT.nominal * self.size
        low, high = points.min(axis=0) - slack, points.max(axis=0) + slack
        return triangles[((triangles.min(axis=1) <= high) & (triangles.max(axis=1) >= low)).all(axis=1)]

    def flat(self, points: Array) -> Flags:
        """Tell which points lie in the planes of which faces, (m, faces)."""
        normals, bases = self.planes
        heights = np.stack([(points - base) @ n for n, base in zip(normals, bases, strict=True)], axis=1)
        return np.abs(heights) <= DEFAULT.nominal * self.size

    def lies_on(self, face: int, points: Array) -> Flags:
        """Tell which points of a face's plane, (m, 3), lie on the face, its border included."""
        if not len(points):
            return np.zeros(0, bool)
        near = self._polygons_near(face, points)
        return np.asarray(hold(near, self.planes[0][[face]], points, DEFAULT.nominal * self.size).any(axis=1))

    def area_within(self, face: int, loop: Array) -> float:
        """Return the area of a face inside a convex polygon of its plane, (m, 3), in units of the size squared."""
        normal = self.planes[0][face]
        near = self._polygons_near(face, loop)
        return sum(area(inside(loop, triangle, normal)) for triangle in near) / self.size**2

    def stretches(self, ends: Array, faces: Ints, edges: Ints) -> tuple[Array, Array]:
        """Return lengths, in units of the size, and middles of the stretches that borders cut a segment into.

        `ends` (2, 3). `faces` (k,): in whose planes the segment lies: their triangles' sides cut it. `edges` (m,): on
        whose lines it lies: their ends cut it.
        """
        corners = self.points[self.triangles[np.isin(self.owners, faces)]]
        after, others = following(corners), self.points[self.edges[edges]]
        starts = np.concatenate([corners.reshape(-1, 3), others[:, 0]]) - ends[0]
        stops = np.concatenate([after.reshape(-1, 3), others[:, 1]]) - ends[0]
        line, sides = ends[1] - ends[0], stops - starts
        length, normals = float(np.linalg.norm(line)), cross(line, sides)
        squares = (normals**2).sum(axis=1)
        crossing = squares > (DEFAULT.nominal * length) ** 2 * (sides**2).sum(axis=1)
        crossings = (cross(starts, sides) * normals).sum(axis=1)[crossing] / squares[crossing]
        along = np.concatenate([starts, stops])[np.tile(~crossing, 2)] @ line / length**2
        places = np.unique(np.clip(np.concatenate([[0.0, 1.0], crossings, along]), 0.0, 1.0))
        middles = (places[1:] + places[:-1]) / 2.0
        return np.diff(places) * length / self.size, ends[0] + middles[:, None] * line

    @cached_property
    def lengths(self) -> Array:
        """Lengths of the edges, in units of the size."""
        return norms(np.diff(self.points[self.edges], axis=1)[:, 0]) / self.size

    def along_edges(self, points: Array, edges: Ints | slice = slice(None)) -> tuple[Flags, Flags]:
        """Tell which points lie on the lines of which edges, and which on the edges, (m, edges) each."""
        origin, end = (self.points[self.edges[edges, k]] for k in (0, 1))
        along, lengths = end - origin, self.lengths[edges]
        lengths = np.where(lengths > 0.0, lengths, np.inf)  # of ends that rounding made one: only they lie on it
        places, starts = (own - self.points[self.triangles[0, 0]] for own in (points, origin))
        directions = along / (lengths * self.size)[:, None]
        heights = places @ directions.T - (starts * directions).sum(axis=1)
        off = (places**2).sum(axis=1)[:, None] - 2.0 * places @ starts.T + (starts**2).sum(axis=1) - heights**2
        largest = max(np.abs(own).max(initial=0.0) for own in (places, starts))
        i, j = np.nonzero(off <= (DEFAULT.snap * max(largest, self.size)) ** 2)  # as far as digits tell
        spokes = points[i] - origin[j]
        share = (spokes * along[j]).sum(axis=1) / (lengths[j] * self.size) ** 2
        near = norms(spokes - share[:, None] * along[j]) <= DEFAULT.nominal * self.size
        room, found = DEFAULT.nominal / lengths[j], np.zeros((2, len(points), len(origin)), np.bool_)
        found[:, i, j] = near, near & (share >= -room) & (share <= 1 + room)
        return found[0], found[1]


def rims(triangles: Iterable[Rows]) -> list[list[int]]:
    """Return the loops in which the border of triangles of one face passes rows, holes clockwise."""
    # where loops touch in a row they are one that passes it more than once
    directed = {pair for a, b, c in triangles for pair in ((a, b), (b, c), (c, a))}
    ahead = defaultdict[int, list[int]](list)
    for a, b in sorted(directed, reverse=True):
        if (b, a) not in directed:
            ahead[a].append(b)
    loops = []
    while ahead:
        first = min(ahead)
        loop, row = [], first
        while row in ahead:
            loop.append(row)
            after = ahead[row].pop()
            if not ahead[row]:
                del ahead[row]
            row = after
        loops.append(loop)
    return loops


def _loop(triangles: Iterable[Rows], corners: Rows) -> Rows:
    """Return corners in the order in which the rim of triangles passes them; as they are where it is not one loop."""
    loops, kept = rims(triangles), set(corners)
    loop = [v for v in loops[0] if v in kept]
    first = loop.index(corners[0]) if corners[0] in loop else 0
    return (*loop[first:], *loop[:first]) if len(loops) == 1 and len(set(loop)) == len(loop) else corners


def label(rows: Iterable[int]) -> tuple[int, ...]:
    """Return the 1-based labels of rows, ascending."""
    return tuple(sorted(v + 1 for v in rows))


def straightened(
    points: Array, edges: Mapping[tuple[int, int], frozenset[int]]
) -> dict[tuple[int, int], frozenset[int]]:
    """Return edges, each with the faces beside it, with those joined that go on straight between the same faces."""
    merged = dict(edges)
    at = defaultdict[tuple[int, frozenset[int]], list[tuple[int, int]]](list)
    for edge, faces in edges.items():
        for v in edge:
            at[v, faces].append(edge)
    for (v, faces), own in at.items():
        if len(own) != 2:
            continue
        (a, b), (c, d) = own
        one, two = a + b - v, c + d - v
        u, w = points[one] - points[v], points[two] - points[v]
        lengths = float(norms(u)), float(norms(w))
        if u @ w < 0 and norms(cross(u, w)) <= DEFAULT.nominal * max(lengths) * min(lengths):
            joined = (min(one, two), max(one, two))
            for edge in own:
                merged.pop(edge, None)
            merged[joined] = faces
            for end in (one, two):
                at[end, faces] = [joined if edge in own else edge for edge in at[end, faces]]
    return merged
