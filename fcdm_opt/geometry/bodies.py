"""Bodies: unions of convex parts that share one seed and are scaled about it.

A part is the convex hull of its float vertices; a *face* is a maximal group of hull facets coplanar within
`Tolerances.planarity`. Labels are 1-based and follow the order of the input, as in the FCDM paper.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fcdm_opt.errors import InputError
from fcdm_opt.tolerances import DEFAULT

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
SeedRule = Literal["centroid", "vertices", "box"]
SEED_RULES: tuple[str, ...] = ("centroid", "vertices", "box")


class Element(NamedTuple):
    """A vertex, edge or face of a body: `kind` "V", "E" or "F" and the body's 1-based vertex labels."""

    kind: str
    vertices: tuple[int, ...]


def frozen(values: Any, dtype: Any = np.float64) -> NDArray[Any]:
    """Return a read-only C-contiguous copy."""
    array = np.array(values, dtype=dtype, order="C")
    array.flags.writeable = False
    return array


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
        return frozen([_area_vector(self.vertices[list(loop)]) for loop in self.loops])

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
        around_face = [
            [edge_of[a, b] for a, b in zip(loop, loop[1:] + loop[:1], strict=True)] for loop in self.loops
        ]
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
    """

    name: str
    vertices: Array
    seed: Array
    parts: tuple[ConvexPart, ...]
    faces: tuple[tuple[int, ...], ...]

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
        points = _points(vertices, name)
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
            0-based rows of each true face of the body. Without it, faces of the parts in one plane that share
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
            groups = [_points(group, f"{name}, part {k + 1}") for k, group in enumerate(_groups(vertices, name))]
            points, rows = _numbered(groups)
        else:
            points = _points(vertices, name)
            rows = [_rows(part, len(points), f"body '{name}': parts[{k}]") for k, part in enumerate(parts)]
        if not rows:
            raise InputError("a body needs at least one part", key=f"body '{name}'")
        hulls = [_hull(points[part], part, name, k, len(rows)) for k, part in enumerate(rows)]
        given = None
        if faces is not None:
            given = [_rows(face, len(points), f"body '{name}': faces[{k}]") for k, face in enumerate(faces)]
        true_faces, elements = _own_elements(points, hulls, given)
        origin = _seed(seed, points, hulls, name)
        made = tuple(
            ConvexPart(frozen(points[used]), origin, tuple(loops), frozen(edges, np.int64), named)
            for (used, loops, edges), named in zip(hulls, elements, strict=True)
        )
        return cls(name, frozen(points), origin, made, true_faces)

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
        if not (np.isfinite(rho) and rho > 0):
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
    T = _array(transform, key)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise InputError("a transform is a finite 4x4 matrix", key=key, found=T.shape)
    R = T[:3, :3]
    error = max(np.abs(R @ R.T - np.eye(3)).max(), np.abs(T[3] - [0, 0, 0, 1]).max())
    if error > DEFAULT.rigid or np.linalg.det(R) < 0:
        raise InputError("the transform is not a rigid motion", key=key, found=f"error {error:.3g}")
    return frozen(T)


# ---------------------------------------------------------------------------------------------------- input checks


def _array(values: Any, key: str) -> Array:
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as reason:
        raise InputError("expected a rectangular array of numbers", key=key, found=values) from reason


def _groups(vertices: Any, name: str) -> list[Any]:
    if np.ndim(vertices[0] if len(vertices) else vertices) != 2:
        raise InputError(
            "without `parts` give one (n, 3) array a part", key=f"body '{name}'", found=np.shape(vertices)
        )
    return list(vertices)


def _points(vertices: Any, name: str) -> Array:
    key = f"body '{name}'"
    points = _array(vertices, key)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError("vertices must be an (n, 3) array", key=key, found=f"shape {points.shape}")
    if len(points) < 4:
        raise InputError("a solid needs at least 4 vertices", key=key, found=len(points))
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if bad.size:
        raise InputError(f"vertex {bad[0] + 1} is not finite", key=key, found=points[bad[0]].tolist())
    return points


def _rows(indices: Iterable[int], count: int, key: str) -> list[int]:
    rows = list(indices)
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


def _seed(seed: Any, points: Array, hulls: list[tuple[list[int], Any, Any]], name: str) -> Array:
    key = f"body '{name}': seed"
    if not isinstance(seed, str):
        point = _array(seed, key)
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


# --------------------------------------------------------------------------------------------------------- topology


def _area_vector(polygon: Array) -> Array:
    """Return the unit normal of a (nearly) planar polygon, by Newell's sum about its first vertex."""
    spokes = polygon[1:] - polygon[0]
    total = np.cross(spokes[:-1], spokes[1:]).sum(axis=0)
    return total / np.linalg.norm(total)


Hull = tuple[list[int], list[tuple[int, ...]], list[tuple[int, int, int, int]]]


def _hull(points: Array, rows: list[int], name: str, part: int, count: int) -> Hull:
    """Return (rows used, face loops, edges) of the hull of one part, coplanar facets merged."""
    from scipy.spatial import ConvexHull, QhullError

    key = f"body '{name}'" + (f": parts[{part}]" if count > 1 else "")
    if len(points) < 4:
        raise InputError("a convex part needs at least 4 vertices", key=key, found=len(points))
    centred = points - points.mean(axis=0)
    size = np.abs(centred).max()
    if size == 0:
        raise InputError("all points coincide", key=key, found=points[0].tolist())
    _, stretch, axes = np.linalg.svd(centred / size, full_matrices=False)
    if stretch[2] <= DEFAULT.flatness * stretch[0]:
        raise InputError("the points lie in one plane", key=key, found=f"thickness ratio {stretch[2] / stretch[0]:.2g}")
    axes[2] *= np.sign(np.linalg.det(axes))  # no mirror: it would turn the facets inside out
    try:  # hulls are affinely invariant: equal extents keep Qhull from calling thin parts flat
        hull = ConvexHull(centred / size @ (axes.T / stretch), qhull_options="Qt")
    except QhullError as reason:
        raise InputError(f"no convex hull: {str(reason).splitlines()[0]}", key=key) from reason
    triangles = [
        tuple(row if normal @ np.cross(*(hull.points[row[1:]] - hull.points[row[0]])) > 0 else row[::-1])
        for row, normal in zip(hull.simplices, hull.equations[:, :3], strict=True)
    ]
    loops = _merged_faces(centred / size, triangles, hull.neighbors)
    edges = _edges(loops)
    if edges is None:  # merging met a borderline case: the triangles of the hull are always consistent
        loops = [tuple(int(v) for v in triangle) for triangle in triangles]
        edges = _edges(loops)
        if edges is None:
            raise InputError("the hull of the points is not a closed surface", key=key)
    used = sorted({vertex for loop in loops for vertex in loop})
    place = {vertex: k for k, vertex in enumerate(used)}
    loops = [tuple(place[vertex] for vertex in loop) for loop in loops]
    edges = [(place[a], place[b], left, right) for a, b, left, right in edges]
    return [rows[vertex] for vertex in used], loops, edges


def _merged_faces(points: Array, triangles: list[tuple[Any, ...]], neighbours: Ints) -> list[tuple[int, ...]]:
    """Group triangles coplanar within `planarity`, largest first, and return each group's outline."""
    corners = points[np.array(triangles)]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(areas, axis=1)
    group = np.full(len(triangles), -1)
    loops = []
    for start in np.argsort(-sizes, kind="stable"):
        if group[start] >= 0:
            continue
        normal = areas[start] / sizes[start] if sizes[start] > 0 else areas[start]
        heights = np.abs((points - corners[start, 0]) @ normal)
        group[start], stack, members = start, [start], {int(v) for v in triangles[start]}
        while stack:
            for other in neighbours[stack.pop()]:
                if group[other] < 0 and heights[list(triangles[other])].max() <= DEFAULT.planarity:
                    group[other] = start
                    members.update(int(v) for v in triangles[other])
                    stack.append(other)
        loops.append(_outline(points, sorted(members), normal))
    return [loop for loop in loops if len(loop) >= 3]


def _outline(points: Array, members: list[int], normal: Array) -> tuple[int, ...]:
    """Return the strictly convex outline of coplanar points, counter-clockwise about `normal` (monotone chain)."""
    if len(members) == 3:
        a, b, c = members
        turn = np.cross(points[b] - points[a], points[c] - points[a]) @ normal
        return (a, b, c) if turn > 0 else (a, c, b) if turn < 0 else ()
    u = np.linalg.svd(normal[None])[2][1]
    plane = points[members] @ np.column_stack([u, np.cross(normal, u)])
    order = [members[k] for k in np.lexsort((plane[:, 1], plane[:, 0]))]
    flat = dict(zip(members, plane, strict=True))

    def chain(sequence: list[int]) -> list[int]:
        kept: list[int] = []
        for vertex in sequence:
            while len(kept) > 1:
                p, q = flat[kept[-1]] - flat[kept[-2]], flat[vertex] - flat[kept[-2]]
                if p[0] * q[1] - p[1] * q[0] > DEFAULT.planarity * np.hypot(*q):
                    break
                kept.pop()
            kept.append(vertex)
        return kept[:-1]

    return tuple(chain(order) + chain(order[::-1]))


def _edges(loops: list[tuple[int, ...]]) -> list[tuple[int, int, int, int]] | None:
    """Pair the half-edges of face loops; None unless they close to a sphere."""
    left = {(a, b): f for f, loop in enumerate(loops) for a, b in zip(loop, loop[1:] + loop[:1], strict=True)}
    if len(left) != sum(map(len, loops)) or any((b, a) not in left for a, b in left):
        return None
    edges = [(a, b, f, left[b, a]) for (a, b), f in left.items() if a < b]
    vertices = {vertex for loop in loops for vertex in loop}
    return edges if len(vertices) - len(edges) + len(loops) == 2 else None


# -------------------------------------------------------------------------------------------- the body's own elements


def _own_elements(
    points: Array, hulls: list[Hull], given: list[list[int]] | None
) -> tuple[tuple[tuple[int, ...], ...], list[dict[str, tuple[Element, ...]]]]:
    """Return the body's faces and, for each part, the body's element that each vertex, edge, face belongs to."""
    size = np.abs(points - points.mean(axis=0)).max()
    rows = [[tuple(used[v] for v in loop) for loop in loops] for used, loops, _ in hulls]
    planes = [[_plane(points, loop) for loop in loops] for loops in rows]
    if given is None:
        groups = _faces_from_parts(rows, planes, size)
        given = [sorted({v for part, face in group for v in rows[part][face]}) for group in groups]
        owner = {place: k for k, group in enumerate(groups) for place in group}
    else:
        owner = _owners(points, rows, planes, given, size)
    faces = tuple(tuple(sorted(v + 1 for v in face)) for face in given)
    around: dict[tuple[int, int], set[int]] = {}
    corners: dict[int, set[int]] = {}
    for (part, face), own in owner.items():
        loop = rows[part][face]
        for a, b in zip(loop, loop[1:] + loop[:1], strict=True):
            around.setdefault((min(a, b), max(a, b)), set()).add(own)
            corners.setdefault(a, set()).add(own)
    elements = []
    for part, (used, _, edges) in enumerate(hulls):
        named_faces = tuple(
            Element("F", faces[owner[part, f]] if (part, f) in owner else _label(loop))
            for f, loop in enumerate(rows[part])
        )
        named_edges = []
        for a, b, _, _ in edges:
            pair = (min(used[a], used[b]), max(used[a], used[b]))
            beside = around.get(pair, set())
            named_edges.append(Element("F", faces[min(beside)]) if len(beside) == 1 else Element("E", _label(pair)))
        named_vertices = tuple(
            Element("F", faces[min(corners[v])]) if len(corners.get(v, ())) == 1 else Element("V", (v + 1,))
            for v in used
        )
        elements.append({"V": named_vertices, "E": tuple(named_edges), "F": named_faces})
    return faces, elements


def _label(rows: Iterable[int]) -> tuple[int, ...]:
    return tuple(sorted(v + 1 for v in rows))


def _plane(points: Array, loop: tuple[int, ...]) -> tuple[Array, float]:
    normal = _area_vector(points[list(loop)])
    return normal, float(normal @ points[loop[0]])


def _faces_from_parts(rows: Any, planes: Any, size: float) -> list[list[tuple[int, int]]]:
    """Group part faces in one plane that share vertices; drop seams (the same outline turned to each other)."""
    places = [(part, face) for part, loops in enumerate(rows) for face in range(len(loops))]
    outlines: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for part, face in places:
        outlines.setdefault(tuple(sorted(rows[part][face])), []).append((part, face))
    seams = {
        place
        for same in outlines.values()
        for place in same
        if any(planes[place[0]][place[1]][0] @ planes[p][f][0] < 0 for p, f in same)
    }
    groups: list[list[tuple[int, int]]] = []
    for part, face in places:
        if (part, face) in seams:
            continue
        normal, level = planes[part][face]
        mine = [(part, face)]
        rest = []
        for group in groups:
            other, height = planes[group[0][0]][group[0][1]]
            joined = (
                np.abs(normal - other).max() <= DEFAULT.nominal
                and abs(level - height) <= DEFAULT.nominal * size
                and any(set(rows[p][f]) & set(rows[part][face]) for p, f in group)
            )
            (mine := group + mine) if joined else rest.append(group)
        groups = [*rest, mine]
    return groups


def _owners(points: Array, rows: Any, planes: Any, given: list[list[int]], size: float) -> dict[tuple[int, int], int]:
    """Map each part face to the given face in its plane with which it shares most vertices, or in which it lies."""
    owner = {}
    for part, loops in enumerate(rows):
        for face, loop in enumerate(loops):
            normal, level = planes[part][face]
            shared = {
                k: len(set(own) & set(loop))
                for k, own in enumerate(given)
                if np.abs(points[own] @ normal - level).max() <= DEFAULT.nominal * size
            }
            middle = points[list(loop)].mean(axis=0)
            best = max(shared, key=lambda k: shared[k], default=None)
            if best is not None and (shared[best] or _surrounds(points[given[best]], middle, normal)):
                owner[part, face] = best
    return owner


def _surrounds(outline: Array, point: Array, normal: Array) -> bool:
    """Tell whether a polygon, corners in order, goes round a point of its plane: its winding number is not zero."""
    spokes = outline - point
    ahead = np.roll(spokes, -1, axis=0)
    turns = np.arctan2(np.cross(spokes, ahead) @ normal, (spokes * ahead).sum(axis=1))
    return bool(abs(turns.sum()) > np.pi)
