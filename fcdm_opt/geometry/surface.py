"""The true faces and edges of a body, which its parts' elements are named after, and what lies on them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.tolerances import DEFAULT

Rows = tuple[int, ...]
FRACTIONS = np.array([1e-3, 0.25, 0.5, 0.75, 1 - 1e-3])  # of the way along an edge, or to a corner: where one looks


@dataclass(frozen=True, eq=False)
class Surface:
    """Faces and edges of a solid that no two of its neighbouring facets in one plane divide.

    Attributes
    ----------
    points : (n, 3) array
    triangles : (t, 3) int array
        Rows of `points`; counter-clockwise seen from outside.
    owners : (t,) int array
        The face that each triangle is of.
    faces : tuple of tuples of int
        Rows of each face's corners, those of its holes too, ascending.
    edges : (k, 2) int array
        Rows of the ends of each edge.
    hidden : (h, 2) int array
        Edges inside the solid that keep names of their own.
    outlines : tuple of tuples of int
        The faces with their corners in order, counter-clockwise seen from outside; ascending of those with holes.
    """

    points: Array
    triangles: Ints
    owners: Ints
    faces: tuple[Rows, ...]
    edges: Ints
    hidden: Ints
    outlines: tuple[Rows, ...]

    @classmethod
    def of(cls, points: Array, triangles: Ints, planes: Ints) -> Surface:
        """Return the surface of triangles, of which each pair with one edge and one oriented plane is one face."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        around = defaultdict[tuple[int, int], list[int]](list)
        for k, (a, b, c) in enumerate(triangles.tolist()):
            for edge in ((a, b), (b, c), (c, a)):
                around[min(edge), max(edge)].append(k)
        links = [(i, j) for own in around.values() for i in own for j in own if i < j and planes[i] == planes[j]]
        graph = coo_array((np.ones(len(links)), np.array(links, np.int64).reshape(-1, 2).T), shape=(len(planes),) * 2)
        labels = connected_components(graph, directed=False)[1]
        _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
        owners = np.argsort(np.argsort(first))[inverse]  # faces in the order of their first triangles
        seams = defaultdict[frozenset[int], list[tuple[int, int]]](list)
        for edge, own in around.items():
            if len(beside := frozenset(owners[own].tolist())) > 1:
                seams[beside].append(edge)
        edges = dict[tuple[int, int], frozenset[int]]()
        for beside, pieces in seams.items():
            edges.update(dict.fromkeys(_straightened(points, pieces), beside))
        corners: list[set[int]] = [set() for _ in range(owners.max() + 1)]
        for edge, beside in edges.items():
            for face in beside:
                corners[face].update(edge)
        faces = tuple(tuple(sorted(own)) for own in corners)
        sides: list[set[tuple[int, int]]] = [set() for _ in faces]
        for face, (a, b, c) in zip(owners.tolist(), triangles.tolist(), strict=True):
            sides[face].update([(a, b), (b, c), (c, a)])
        outlines = tuple(_outline(own, face) for own, face in zip(sides, faces, strict=True))
        ends = np.array(list(edges), np.int64).reshape(-1, 2)
        return cls(points, triangles, owners, faces, ends, np.empty((0, 2), np.int64), outlines)

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
        return tuple(tuple(map(tuple, self.triangles[self.owners == k].tolist())) for k in range(len(self.faces)))

    def polygons(self, face: int) -> Array:
        """Return a face's triangles, (k, 3, 3)."""
        return self.points[self.triangles[self.owners == face]]

    def heights(self, points: Array) -> Array:
        """Return how far points, (m, 3), are above the faces' planes, in units of the size, (m, faces)."""
        normals, bases = self.planes
        return np.stack([(points - base) @ n for n, base in zip(normals, bases, strict=True)], axis=1) / self.size

    def lies_on(self, face: int, points: Array) -> Array:
        """Tell which points of a face's plane, (m, 3), lie on the face, its border included."""
        corners = self.polygons(face)
        along = np.roll(corners, -1, axis=1) - corners
        inward = np.cross(self.planes[0][face], along)
        inward /= np.linalg.norm(inward, axis=2)[:, :, None]
        depth = ((points[:, None, None] - corners) * inward).sum(axis=3)
        on: Array = (depth >= -DEFAULT.nominal * self.size).all(axis=2).any(axis=1)
        return on

    def area_within(self, face: int, outline: Array) -> float:
        """Return the area of a face inside a convex polygon of its plane, (m, 3), in units of the size squared."""
        normal = self.planes[0][face]
        across = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
        axes = np.column_stack([across, np.cross(normal, across)]) / np.linalg.norm(across)
        polygon = (outline - outline[0]) @ axes
        triangles = (self.polygons(face) - outline[0]) @ axes
        low, high = polygon.min(axis=0), polygon.max(axis=0)
        near = ((triangles.min(axis=1) < high) & (triangles.max(axis=1) > low)).all(axis=1)
        return sum(_area(_clipped(polygon, triangle)) for triangle in triangles[near]) / self.size**2

    def stretches(self, ends: Array, faces: Ints, edges: Ints) -> tuple[Array, Array]:
        """Return lengths, in units of the size, and middles of the stretches that borders cut a segment into.

        Parameters
        ----------
        ends : (2, 3) array
        faces : (k,) int array
            In whose planes the segment lies: their triangles' sides cut it.
        edges : (m,) int array
            On whose lines it lies: their ends cut it.
        """
        corners = self.points[self.triangles[np.isin(self.owners, faces)]]
        after, others = np.roll(corners, -1, axis=1), self.points[self.edges[edges]]
        starts = np.concatenate([corners.reshape(-1, 3), others[:, 0]]) - ends[0]
        stops = np.concatenate([after.reshape(-1, 3), others[:, 1]]) - ends[0]
        way, ways = ends[1] - ends[0], stops - starts
        length, normals = float(np.linalg.norm(way)), np.cross(way, ways)
        squares = (normals**2).sum(axis=1)
        crossing = squares > (DEFAULT.nominal * length) ** 2 * (ways**2).sum(axis=1)
        crossings = (np.cross(starts, ways) * normals).sum(axis=1)[crossing] / squares[crossing]
        along = np.concatenate([starts, stops])[np.tile(~crossing, 2)] @ way / length**2
        places = np.unique(np.clip(np.concatenate([[0.0, 1.0], crossings, along]), 0.0, 1.0))
        middles = (places[1:] + places[:-1]) / 2.0
        return np.diff(places) * length / self.size, ends[0] + middles[:, None] * way

    def along_edges(self, points: Array) -> tuple[Array, Array]:
        """Return how far points are off the edges' lines, and where on them: 0 at the origin, 1 at the end."""
        origin, end = (self.points[self.edges[:, k]] for k in (0, 1))
        along = end - origin
        lengths = np.linalg.norm(along, axis=1)
        spokes = points[:, None] - origin
        share = (spokes * along).sum(axis=2) / lengths**2
        off = np.linalg.norm(spokes - share[:, :, None] * along, axis=2)
        return off / self.size, share


def _clipped(polygon: Array, triangle: Array) -> list[tuple[float, float]]:
    """Return the corners of a convex polygon inside a triangle that runs counter-clockwise, both in a plane."""
    kept = [tuple(point) for point in polygon.tolist()]
    corners = triangle.tolist()
    for (x, y), (u, v) in zip(corners, corners[1:] + corners[:1], strict=True):
        heights = [(u - x) * (q - y) - (v - y) * (p - x) for p, q in kept]
        inside = []
        for k, (point, height) in enumerate(zip(kept, heights, strict=True)):
            before, other = kept[k - 1], heights[k - 1]
            if (height > 0.0) != (other > 0.0):
                share = height / (height - other)
                inside.append(tuple(a + share * (b - a) for a, b in zip(point, before, strict=True)))
            if height > 0.0:
                inside.append(point)
        kept = inside
    return kept


def _area(polygon: list[tuple[float, float]]) -> float:
    """Return the area of a polygon in a plane."""
    sides = zip(polygon, polygon[1:] + polygon[:1], strict=True)
    return abs(sum(a * d - b * c for (a, b), (c, d) in sides)) / 2.0


def _outline(sides: set[tuple[int, int]], corners: Rows) -> Rows:
    """Return corners in the order in which the rim of triangles passes them; as they are where it is not one loop."""
    rim = [(a, b) for a, b in sides if (b, a) not in sides]
    ahead, kept = dict(rim), set(corners)
    loop = [corners[0]]
    while len(loop) < len(rim) and ahead.get(loop[-1], loop[0]) != loop[0]:
        loop.append(ahead[loop[-1]])
    return tuple(v for v in loop if v in kept) if len(loop) == len(ahead) == len(rim) else corners


def label(rows: Iterable[int]) -> tuple[int, ...]:
    """Return the 1-based labels of rows, ascending."""
    return tuple(sorted(v + 1 for v in rows))


def _straightened(points: Array, pieces: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Join edges between the same faces that go on straight."""
    at = defaultdict[int, list[tuple[int, int]]](list)
    left = dict.fromkeys(pieces)
    for edge in left:
        for v in edge:
            at[v].append(edge)
    for v, own in at.items():
        if len(own) != 2:
            continue
        (a, b), (c, d) = own
        one, two = a + b - v, c + d - v
        u, w = points[one] - points[v], points[two] - points[v]
        lengths = float(np.linalg.norm(u)), float(np.linalg.norm(w))
        if u @ w < 0 and np.linalg.norm(np.cross(u, w)) <= DEFAULT.nominal * max(lengths) * min(lengths):
            joined = (min(one, two), max(one, two))
            for edge in own:
                left.pop(edge, None)
            left[joined] = None
            for end in (one, two):
                at[end] = [joined if edge in own else edge for edge in at[end]]
    return list(left)
