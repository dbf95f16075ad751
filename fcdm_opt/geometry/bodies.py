"""Bodies: unions of convex parts that share one seed and are scaled about it.

A part is the convex hull of its float vertices; a *face* is a maximal group of hull facets coplanar within
`Tolerances.planarity`. Labels are 1-based and follow the order of the input, as in the FCDM paper.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints, frozen, numbers
from fcdm_opt.geometry.elements import Element, own_elements
from fcdm_opt.geometry.hull import Hull, convex_hull, unit_normal
from fcdm_opt.tolerances import DEFAULT

SeedRule = Literal["centroid", "vertices", "box"]
SEED_RULES: tuple[str, ...] = ("centroid", "vertices", "box")


@dataclass(frozen=True, eq=False)
class ConvexPart:
    """One convex part of a body: the hull of `vertices`, with its faces, edges and half-edges.

    Attributes
    ----------
    vertices : (n, 3) array
        Extreme points, in the body's frame (as drawn), in the order of the input.
    seed : (3,) array
        Seed of the body.
    loops : tuple of tuples of int
        Vertex indices of each face, counter-clockwise seen from outside.
    edges : (m, 4) int array
        `origin, end, left face, right face`: the left face's loop runs from origin to end.
    elements : dict
        "V", "E", "F" -> the body's own element that each vertex, edge, face belongs to. An edge or vertex that a
        cut between parts makes on a true face carries that face.
    """

    vertices: Array
    seed: Array
    loops: tuple[tuple[int, ...], ...]
    edges: Ints
    elements: dict[str, tuple[Element, ...]] = field(repr=False)

    @cached_property
    def normals(self) -> Array:
        """Outward unit normals of the faces, (f, 3)."""
        return frozen([unit_normal(self.vertices[list(loop)]) for loop in self.loops])

    @cached_property
    def half_edges(self) -> Ints:
        """Half-edges, (2m, 4): `origin, face, twin, next`; half-edge 2k runs along edge k, 2k + 1 against it."""
        count = len(self.edges)
        table = np.empty((2 * count, 4), dtype=np.int64)
        table[0::2, 0], table[1::2, 0] = self.edges[:, 0], self.edges[:, 1]
        table[0::2, 1], table[1::2, 1] = self.edges[:, 2], self.edges[:, 3]
        table[:, 2] = np.arange(2 * count) ^ 1
        leaving = {(int(row[0]), int(row[1])): k for k, row in enumerate(table)}
        for k in range(2 * count):
            table[k, 3] = leaving[int(table[k ^ 1, 0]), int(table[k, 1])]
        return frozen(table, np.int64)

    @cached_property
    def packed(self) -> tuple[Array, Ints]:
        """Arrays that the kernels take.

        Reals, (n + f, 3): vertices relative to the seed, then face normals. Ints, 1-D: n, f, m, then the offsets of
        four tables: edges (m x 4), edges around each vertex (pointers, entries), edges around each face (pointers,
        entries, in loop order).
        """
        n, f, m = len(self.vertices), len(self.loops), len(self.edges)
        around_vertex: list[list[int]] = [[] for _ in range(n)]
        edge_of = {}
        for k, (origin, end, _, _) in enumerate(self.edges.tolist()):
            around_vertex[origin].append(k)
            around_vertex[end].append(k)
            edge_of[origin, end] = edge_of[end, origin] = k
        around_face = [[edge_of[a, b] for a, b in zip(loop, loop[1:] + loop[:1], strict=True)] for loop in self.loops]
        tables = [self.edges.ravel().tolist()]
        for lists in (around_vertex, around_face):
            tables.append(np.concatenate([[0], np.cumsum([len(entries) for entries in lists])]).tolist())
            tables.append([k for entries in lists for k in entries])
        header = 8
        offsets = header + np.concatenate([[0], np.cumsum([len(table) for table in tables])])
        ints = [n, f, m, *offsets[:5].tolist(), *(k for table in tables for k in table)]
        return frozen(np.vstack([self.vertices - self.seed, self.normals])), frozen(ints, np.int64)

    @cached_property
    def volume_and_centroid(self) -> tuple[float, Array]:
        """Volume and centroid, by signed tetrahedra about the mean vertex."""
        centre = self.vertices.mean(axis=0)
        local = self.vertices - centre
        triangles = local[[(loop[0], a, b) for loop in self.loops for a, b in pairwise(loop[1:])]]
        volumes = np.linalg.det(triangles) / 6.0
        return float(volumes.sum()), centre + volumes @ triangles.sum(axis=1) / 4.0 / volumes.sum()

    def placed(self, vertices: Array, seed: Array) -> ConvexPart:
        """Return the part with other coordinates but the same combinatorics."""
        return replace(self, vertices=frozen(vertices), seed=frozen(seed))


@dataclass(frozen=True, eq=False)
class Body:
    """A solid made of convex parts, scaled as a whole about one seed: X -> s + rho (X - s).

    Build one with `Body.convex` or `Body.from_parts`; bodies never change.

    Attributes
    ----------
    name : str
    vertices : (n, 3) array
        As given, in the world frame as drawn; label k is row k - 1.
    seed : (3,) array
        The datum of the scaling, world frame.
    parts : tuple of ConvexPart
    faces : tuple of tuples of int
        Faces of the body as sorted 1-based vertex labels.
    outlines : tuple of tuples of int
        The same faces with their corners in the order given, where faces were given.
    """

    name: str
    vertices: Array
    seed: Array
    parts: tuple[ConvexPart, ...]
    faces: tuple[tuple[int, ...], ...]
    outlines: tuple[tuple[int, ...], ...]

    @classmethod
    def convex(cls, vertices: ArrayLike, *, seed: SeedRule | ArrayLike = "centroid", name: str = "body") -> Body:
        """Return the convex hull of points as a body.

        Parameters
        ----------
        vertices : (n, 3) array
            At least four points that span a volume; interior and repeated points keep their number and are unused.
        seed : {"centroid", "vertices", "box"} or (3,) array
            Volume centroid, mean of the vertices, centre of the axis-aligned box, or a point.
        name : str
            Used in messages and pictures.

        Raises
        ------
        InputError
            For anything that is not a finite solid; names the body and the offending row.
        """
        points = _points(vertices, f"body '{name}'")
        return cls.from_parts(points, parts=[range(len(points))], seed=seed, name=name)

    @classmethod
    def from_parts(
        cls,
        vertices: ArrayLike | Sequence[ArrayLike],
        *,
        parts: Iterable[Iterable[int]] | None = None,
        faces: Iterable[Iterable[int]] | None = None,
        seed: SeedRule | ArrayLike = "centroid",
        name: str = "body",
    ) -> Body:
        """Return a union of convex parts as one body.

        Parameters
        ----------
        vertices : (n, 3) array, or a sequence of such arrays
            With `parts`: the body's vertices. Without: one array a part; the body's numbering is then the order of
            first appearance, equal points counted once.
        parts : index lists, optional
            0-based rows of `vertices` of each part. Parts may overlap.
        faces : index lists, optional
            0-based rows of each true face of the body, corners in order. Without it, faces of the parts in one plane
            that share
            vertices are one face, and faces that two parts turn to each other are seams.
        seed : {"centroid", "vertices", "box"} or (3,) array
            As in `convex`; it may lie outside a part. "centroid" needs parts that do not overlap.
        name : str
            Used in messages and pictures.

        Raises
        ------
        InputError
            Names the body, the part and the row.
        """
        if parts is None:
            groups = [_points(group, f"body '{name}': part {k + 1}") for k, group in enumerate(_groups(vertices, name))]
            points, rows = _numbered(groups)
        else:
            points = _points(vertices, f"body '{name}'")
            rows = [_rows(part, len(points), f"body '{name}': part {k + 1}") for k, part in enumerate(parts)]
        if not rows:
            raise InputError("a body needs at least one part", key=f"body '{name}'")
        keys = [f"body '{name}'" + (f": part {k + 1}" if len(rows) > 1 else "") for k in range(len(rows))]
        hulls = [convex_hull(points[part], part, key) for part, key in zip(rows, keys, strict=True)]
        given = None
        if faces is not None:
            if not isinstance(faces, Iterable):
                raise InputError("expected lists of rows", key=f"body '{name}': faces", found=faces)
            given = [_rows(face, len(points), f"body '{name}': face {k + 1}") for k, face in enumerate(faces)]
            for k, face in enumerate(given):
                if len(face) < 3:
                    key = f"body '{name}': face {k + 1}"
                    raise InputError("a face needs at least 3 corners", key=key, found=len(face))
        true_faces, elements = own_elements(points, hulls, given)
        origin = _seed(seed, points, hulls, name)
        made = tuple(
            ConvexPart(frozen(points[used]), origin, tuple(loops), frozen(edges, np.int64), named)
            for (used, loops, edges), named in zip(hulls, elements, strict=True)
        )
        outlines = true_faces if given is None else tuple(tuple(row + 1 for row in face) for face in given)
        return cls(name, frozen(points), origin, made, true_faces, outlines)

    @cached_property
    def size(self) -> float:
        """Diagonal of the axis-aligned box as drawn: the length that relative tolerances refer to."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    def _mapped(self, rows: Any) -> Body:
        seed = frozen(rows(self.seed[None])[0])
        parts = tuple(part.placed(rows(part.vertices), seed) for part in self.parts)
        return replace(self, vertices=frozen(rows(self.vertices)), seed=seed, parts=parts)

    def scaled(self, rho: float) -> Body:
        """Return the body scaled by `rho` > 0 about its seed."""
        if not isinstance(rho, int | float | np.number) or not (np.isfinite(rho) and rho > 0):
            raise InputError("a scale is a positive number", key=f"body '{self.name}': scale", found=rho)
        return self._mapped(lambda x: self.seed + rho * (x - self.seed))

    def moved(self, transform: ArrayLike) -> Body:
        """Return the body moved with its seed by a rigid 4x4 `transform`."""
        T = rigid_transform(transform, key=f"body '{self.name}': transform")
        return self._mapped(lambda x: x @ T[:3, :3].T + T[:3, 3])

    def placed_vertices(self, rho: float, transform: Array) -> Array:
        """Return all vertices, scaled about the seed and then moved, (n, 3)."""
        scaled = self.seed + rho * (self.vertices - self.seed)
        return scaled @ transform[:3, :3].T + transform[:3, 3]


def rigid_transform(transform: ArrayLike | None, *, key: str = "transform") -> Array:
    """Return a checked rigid 4x4 transform (identity for None); raise `InputError` otherwise."""
    if transform is None:
        return frozen(np.eye(4))
    T = numbers(transform, key)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise InputError("a transform is a finite 4x4 matrix", key=key, found=T.shape)
    R = T[:3, :3]
    error = max(np.abs(R @ R.T - np.eye(3)).max(), np.abs(T[3] - [0, 0, 0, 1]).max())
    if error > DEFAULT.rigid or np.linalg.det(R) < 0:
        raise InputError("the transform is not a rigid motion", key=key, found=f"error {error:.3g}")
    return frozen(T)


# ---------------------------------------------------------------------------------------------------- input checks


def _groups(vertices: Any, name: str) -> list[Any]:
    try:
        deep = np.ndim(vertices[0]) == 2
    except (TypeError, ValueError, IndexError, KeyError):
        deep = False
    if not deep:
        raise InputError(
            "without `parts` give one (n, 3) array a part", key=f"body '{name}'", found=type(vertices).__name__
        )
    return list(vertices)


def _points(vertices: Any, key: str) -> Array:
    points = numbers(vertices, key)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError("vertices must be an (n, 3) array", key=key, found=f"shape {points.shape}")
    if len(points) < 4:
        raise InputError("a solid needs at least 4 vertices", key=key, found=len(points))
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if bad.size:
        raise InputError(f"vertex {bad[0] + 1} is not finite", key=key, found=points[bad[0]].tolist())
    return points


def _rows(indices: Iterable[int], count: int, key: str) -> list[int]:
    try:
        rows = list(indices)
    except TypeError as reason:
        raise InputError("expected a list of rows", key=key, found=indices) from reason
    for row in rows:
        if isinstance(row, bool) or not isinstance(row, int | np.integer) or not 0 <= row < count:
            raise InputError("not a row of the vertices", key=key, found=row, allowed=f"0 to {count - 1}")
    if len(set(rows)) != len(rows):
        raise InputError("a row appears twice", key=key, found=rows)
    return [int(row) for row in rows]


def _numbered(groups: list[Array]) -> tuple[Array, list[list[int]]]:
    """Return the distinct points by first appearance, and each group's rows among them."""
    number: dict[tuple[float, ...], int] = {}
    rows = []
    for group in groups:
        numbers = [number.setdefault(tuple(point), len(number)) for point in (group + 0.0).tolist()]
        rows.append(list(dict.fromkeys(numbers)))
    return np.array(list(number)), rows


def _seed(seed: Any, points: Array, hulls: list[Hull], name: str) -> Array:
    key = f"body '{name}': seed"
    if not isinstance(seed, str):
        point = numbers(seed, key)
        if point.shape != (3,) or not np.isfinite(point).all():
            raise InputError("a seed is a finite point", key=key, found=seed)
        return frozen(point)
    if seed == "vertices":
        return frozen(points.mean(axis=0))
    if seed == "box":
        return frozen((points.min(axis=0) + points.max(axis=0)) / 2)
    if seed == "centroid":
        made = [
            ConvexPart(frozen(points[used]), frozen(points[0]), tuple(loops), frozen(edges, np.int64), {})
            for used, loops, edges in hulls
        ]
        if _parts_overlap(made):
            raise InputError("the centroid of overlapping parts is not defined by them; give the seed", key=key)
        volumes, centroids = zip(*(part.volume_and_centroid for part in made), strict=True)
        return frozen(np.average(centroids, axis=0, weights=volumes))
    raise InputError("unknown seed rule", key=key, found=seed, allowed=", ".join(SEED_RULES) + " or a point")


def _parts_overlap(parts: list[ConvexPart]) -> bool:
    """Tell whether interiors of two parts meet: the largest ball inside both, by linear programming."""
    if len(parts) == 1:
        return False
    from scipy.optimize import linprog

    for one, two in combinations(parts, 2):
        normals = np.vstack([one.normals, two.normals])
        levels = np.concatenate([(part.vertices @ part.normals.T).max(axis=0) for part in (one, two)])
        size = np.ptp(np.vstack([one.vertices, two.vertices]), axis=0).max()
        answer = linprog(
            [0, 0, 0, -1], np.column_stack([normals, np.ones(len(normals))]), levels, bounds=[(None, None)] * 4
        )
        if answer.status == 0 and -answer.fun > DEFAULT.partition * size:
            return True
    return False
