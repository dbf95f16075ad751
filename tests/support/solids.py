"""Random solids that are not convex, as closed triangle meshes: unions of convex parts, boxes and prisms less others.

Every solid is made twice. Its mesh is the boolean of its convex blocks, by manifold3d in double precision: the
undecomposed surface. Its parts are the same blocks cut along the planes of what is taken away. The plain variant has
integer or short rational coordinates, so that many faces and edges are parallel; the turned one is that stretched and
turned at random, in floats without pattern.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from strategies import random_rotation

from fcdm_opt.geometry.bodies import Body

Array = np.ndarray
Blocks = list[Array]  # convex blocks, each the (n, 3) points that it is the hull of

TOUCHING = 1e-9  # times the size: what comes this near touches
THINNEST = 1e-13  # parts of less than this share of the solid's volume are what rounding leaves of a cut


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed solid.

    Attributes
    ----------
    name : str
        Its family, and whether it is turned.
    vertices : (n, 3) array
        Welded.
    triangles : (m, 3) int array
        Counter-clockwise seen from outside; cavities and parts of their own are shells of their own.
    parts : tuple of (k, 3) arrays
        Corners of convex parts that it is the union of.
    seed : (3,) array
    """

    name: str
    vertices: Array
    triangles: Array
    parts: tuple[Array, ...]
    seed: Array

    @property
    def size(self) -> float:
        """Diagonal of the axis-aligned box."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    @property
    def reach(self) -> float:
        """Largest distance of a vertex from the seed."""
        return float(np.linalg.norm(self.vertices - self.seed, axis=1).max())

    @property
    def volume(self) -> float:
        return _moments(self.vertices, self.triangles)[0]

    def times(self, factor: float) -> Solid:
        """The solid with all lengths times a factor."""
        parts = tuple(factor * part for part in self.parts)
        return replace(self, vertices=factor * self.vertices, parts=parts, seed=factor * self.seed)

    def body(self) -> Body:
        """The package's body of the mesh: it knows nothing of the parts."""
        return Body.from_mesh(self.vertices, self.triangles, seed=self.seed, name=self.name)

    def union(self) -> Body:
        """The body of the parts as they were made."""
        return Body.from_parts(list(self.parts), seed=self.seed, name=self.name)


# ------------------------------------------------------------------------------------------------------------- blocks


def box(low: Sequence[float], high: Sequence[float]) -> Array:
    return np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)], dtype=float)


def prism(outline: Array, low: float, high: float, axis: int = 2) -> Array:
    """Extrude a convex outline along an axis."""
    flat = np.asarray(outline, dtype=float)
    rows = np.vstack([np.column_stack([flat, np.full(len(flat), z)]) for z in (low, high)])
    return np.roll(rows, axis - 2, axis=1)


def polygon(sides: int, radius: float, phase: float = 0.0) -> Array:
    """Regular polygon, its corners rounded to 64ths: short rationals."""
    angle = 2 * np.pi * np.arange(sides) / sides + phase
    return np.round(64 * radius * np.column_stack([np.cos(angle), np.sin(angle)])) / 64


def _hulls(rng: np.random.Generator) -> tuple[Blocks, Blocks]:
    """Unions of 2 to 5 hulls of integer points, or in 256ths, each about a point of the one before it."""
    blocks: Blocks = []
    centre, parts = np.zeros(3), int(rng.choice([1, 256]))
    for _ in range(rng.integers(2, 6)):
        points = rng.integers(-3 * parts, 3 * parts + 1, (int(rng.integers(5, 10)), 3)) / parts + centre
        if np.linalg.matrix_rank(points - points[0]) < 3:
            points = box(centre - 1, centre + 2)
        blocks.append(points)
        centre = points[rng.integers(len(points))]
    return blocks, []


def _boxes(rng: np.random.Generator) -> tuple[Blocks, Blocks]:
    """Unions of 2 to 5 integer boxes."""
    blocks: Blocks = []
    centre = np.zeros(3, np.int64)
    for _ in range(rng.integers(2, 6)):
        low, high = centre - rng.integers(1, 4, 3), centre + rng.integers(1, 4, 3)
        blocks.append(box(low, high))
        centre = np.array([rng.integers(a, b + 1) for a, b in zip(low, high, strict=True)])
    return blocks, []


def _box_less_boxes(rng: np.random.Generator) -> tuple[Blocks, Blocks]:
    """Notches, steps, pockets and passages, cut by 1 to 3 boxes."""
    half = rng.integers(3, 6, 3)
    cuts: Blocks = []
    for _ in range(rng.integers(1, 4)):
        low = np.array([rng.integers(-h - 1, h) for h in half])
        cuts.append(box(low, low + rng.integers(2, 6, 3)))
    return [box(-half, half)], cuts


def _box_less_prisms(rng: np.random.Generator) -> tuple[Blocks, Blocks]:
    """Prismatic holes and grooves along the axes, open at both ends or blind."""
    half = rng.integers(3, 6, 3)
    cuts: Blocks = []
    for axis in rng.permutation(3)[: rng.integers(1, 3)].tolist():
        outline = polygon(int(rng.integers(3, 7)), float(rng.integers(4, 9)) / 4, float(rng.uniform(0, 6)))
        middle = rng.integers(-2, 3, 2)
        bottom = rng.choice([-8.0, -1.0])
        cuts.append(prism(outline + middle, bottom, 8.0, axis))
    return [box(-half, half)], cuts


def _ring(rng: np.random.Generator) -> tuple[Blocks, Blocks]:
    """A prism less a thinner one along the same axis: the hole goes through."""
    sides, radius = int(rng.integers(3, 9)), float(rng.integers(3, 6))
    outer = polygon(sides, radius, np.pi / 4 if sides == 4 else 0.0)
    height = float(rng.integers(1, 4))
    hole = polygon(int(rng.integers(3, 9)), radius * rng.integers(2, 6) / 16, float(rng.uniform(0, 6)))
    return [prism(outer, -height, height)], [prism(hole, -height - 1, height + 1)]


def _extrusion(rng: np.random.Generator) -> tuple[Blocks, Blocks]:
    """L, U, T, cross, H and combs."""
    a, b, width = (int(x) for x in rng.integers([4, 4, 1], [8, 8, 3]))
    base, end = ((0, 0), (a, width)), ((0, 0), (width, b))
    far, middle = ((a - width, 0), (a, b)), ((a // 2, -b), (a // 2 + width, b))
    top = ((0, b - width), (a, b))
    teeth = int(rng.integers(3, 6))
    comb = [((2 * k, 0), (2 * k + 1, b)) for k in range(teeth)]
    shapes = (
        [base, end],
        [base, end, far],
        [base, ((a // 2, 0), (a // 2 + width, b))],
        [base, middle],
        [end, far, ((0, b // 2), (a, b // 2 + 1))],
        [base, end, far, top],
        [((0, 0), (2 * teeth - 1, width)), *comb],
    )
    height = int(rng.integers(1, 5))
    rectangles = shapes[rng.integers(len(shapes))]
    return [box((*low, -height), (*high, height)) for low, high in rectangles], []


def _gear(rng: np.random.Generator) -> tuple[Blocks, Blocks]:
    """A hub with teeth, each a tapered prism that reaches into it; sometimes with a bore."""
    teeth, height = int(rng.integers(4, 9)), float(rng.integers(1, 3))
    blocks = [prism(polygon(2 * teeth, 3.0), -height, height)]
    for k in range(teeth):
        turn = 2 * np.pi * (k + 0.5) / teeth
        way, side = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        half = 3.0 * np.sin(np.pi / teeth / 2)
        outline = [r * way + s * side for r, s in ((2.0, half), (2.0, -half), (4.5, -half / 2), (4.5, half / 2))]
        blocks.append(prism(np.round(64 * np.array(outline)) / 64, -height, height))
    bore = prism(polygon(int(rng.integers(4, 7)), 1.25), -height - 1, height + 1)
    return blocks, [bore] if rng.integers(2) else []


def _hollow(rng: np.random.Generator) -> tuple[Blocks, Blocks]:
    """A box around a closed cavity."""
    half = rng.integers(4, 7, 3)
    low = [rng.integers(-h + 1, -1) for h in half]
    high = [rng.integers(2, h) for h in half]
    return [box(-half, half)], [box(low, high)]


FAMILIES: dict[str, Callable[[np.random.Generator], tuple[Blocks, Blocks]]] = {
    "hulls": _hulls,
    "boxes": _boxes,
    "box less boxes": _box_less_boxes,
    "box less prisms": _box_less_prisms,
    "ring": _ring,
    "extrusion": _extrusion,
    "gear": _gear,
    "hollow": _hollow,
}
SEEDS = ("centroid", "centroid", "box", "vertex", "anywhere")


# -------------------------------------------------------------------------------------------------------------- solids


def random_solid(rng: np.random.Generator, family: str, turned: bool) -> Solid:
    """Draw a solid that is not convex, its surface closed and nowhere touching itself."""
    while True:
        solid = solid_of(*FAMILIES[family](rng), name=family)
        if solid is None or is_convex(solid) or not is_closed(solid.triangles) or touches_itself(solid):
            continue
        if turned:
            turn, stretch = random_rotation(rng), rng.uniform(0.5, 1.5, 3)
            vertices, *parts = (points * stretch @ turn.T for points in (solid.vertices, *solid.parts))
            solid = replace(solid, name=f"{family}, turned", vertices=vertices, parts=tuple(parts))
        return replace(solid, seed=_seed(rng, solid))


def solid_of(add: Blocks, cut: Blocks, name: str = "solid") -> Solid | None:
    """Union of convex blocks, less others; seed: the centroid. None where nothing is left."""
    from manifold3d import Manifold, OpType

    whole = Manifold.batch_boolean([Manifold.hull_points(points) for points in add], OpType.Add)
    for points in cut:
        whole -= Manifold.hull_points(points)
    mesh = whole.to_mesh64()
    vertices, triangles = _welded(np.array(mesh.vert_properties[:, :3]), np.array(mesh.tri_verts, np.int64))
    if not len(triangles):
        return None
    least = THINNEST * whole.volume()
    parts = [part for points in add for part in _less(Manifold.hull_points(points), cut, least)]
    corners = [np.array(part.to_mesh64().vert_properties[:, :3]) for part in parts]
    return Solid(name, vertices, triangles, tuple(corners), _moments(vertices, triangles)[1])


def _less(block: Any, cut: Blocks, least: float) -> list[Any]:
    """Convex pieces of a block outside of convex cuts: behind each plane of a cut, and not behind those before it."""
    from scipy.spatial import ConvexHull

    pieces = [block]
    for points in cut:
        outside = []
        for piece in pieces:
            rest = piece
            for *normal, offset in np.unique(ConvexHull(points).equations.round(14), axis=0).tolist():
                beyond, rest = rest.split_by_plane(normal, -offset)
                outside.append(beyond)
        pieces = [piece for piece in outside if piece.volume() > least]
    return pieces


def _welded(vertices: Array, triangles: Array) -> tuple[Array, Array]:
    rows, place = np.unique(vertices, axis=0, return_inverse=True)
    found = place[triangles]
    corners = (found[:, 0] != found[:, 1]) & (found[:, 1] != found[:, 2]) & (found[:, 2] != found[:, 0])
    used, numbers = np.unique(found[corners], return_inverse=True)
    return rows[used], numbers.reshape(-1, 3)


def is_closed(triangles: Array) -> bool:
    """Whether every edge has one triangle on either side."""
    ways = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    there, back = (np.unique(edges, axis=0) for edges in (ways, ways[:, ::-1]))
    return len(there) == len(ways) and bool((there == back).all())


def is_convex(solid: Solid) -> bool:
    from scipy.spatial import ConvexHull

    return bool(ConvexHull(solid.vertices).volume < (1 + 1e-9) * solid.volume)


def touches_itself(solid: Solid) -> bool:
    """Whether triangles meet elsewhere than in the edges and corners that they share, as at cubes along one edge.

    Then a vertex lies on a triangle that it is no corner of, or two edges without a common end meet.
    """
    points, triangles, near = solid.vertices, solid.triangles, TOUCHING * solid.size
    edges = np.unique(np.sort(np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])), axis=0)
    i, j = np.triu_indices(len(edges), 1)
    free = (edges[i][:, :, None] != edges[j][:, None, :]).all(axis=(1, 2))
    one, two = points[edges[i[free]]], points[edges[j[free]]]
    if (_edge_distances(one[:, 0], one[:, 1], two[:, 0], two[:, 1]) < near).any():
        return True
    v, t = np.nonzero((np.unique(triangles)[:, None, None] != triangles).all(axis=2))
    a, b, c = np.moveaxis(points[triangles[t]], 1, 0)
    n, x = np.cross(b - a, c - a), points[np.unique(triangles)[v]]
    above = np.abs(np.einsum("ij,ij->i", n, x - a)) < near * np.linalg.norm(n, axis=1)
    inside = [np.einsum("ij,ij->i", np.cross(q - p, x - p), n) > 0 for p, q in ((a, b), (b, c), (c, a))]
    return bool((above & np.logical_and.reduce(inside)).any())


def _edge_distances(p: Array, q: Array, r: Array, s: Array) -> Array:
    """Distances of the segments p q and r s, row by row: clamp one parameter, then the other, from both sides."""
    u, v, w = q - p, s - r, p - r
    uu, uv, vv, uw, vw = (np.einsum("ij,ij->i", x, y) for x, y in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    area = uu * vv - uv * uv
    least = np.full(len(p), np.inf)
    inner = np.divide(uv * vw - vv * uw, area, out=np.zeros_like(area), where=area > 1e-12 * uu * vv)
    for guess in (inner, np.zeros(len(p)), np.ones(len(p))):
        t = np.clip((np.clip(guess, 0, 1) * uv + vw) / vv, 0, 1)
        along = np.clip((t * uv - uw) / uu, 0, 1)
        least = np.minimum(least, np.linalg.norm(w + along[:, None] * u - t[:, None] * v, axis=1))
    return least


def _moments(vertices: Array, triangles: Array) -> tuple[float, Array]:
    """Volume and centroid, by signed tetrahedra about the mean vertex."""
    middle = vertices.mean(axis=0)
    corners = (vertices - middle)[triangles]
    volumes = np.linalg.det(corners) / 6
    return float(volumes.sum()), middle + volumes @ corners.sum(axis=1) / 4 / volumes.sum()


def _seed(rng: np.random.Generator, solid: Solid) -> Array:
    low, high = solid.vertices.min(axis=0), solid.vertices.max(axis=0)
    kind = rng.choice(SEEDS)
    if kind == "centroid":
        return _moments(solid.vertices, solid.triangles)[1]
    if kind == "box":
        return (low + high) / 2
    return solid.vertices[rng.integers(len(solid.vertices))] if kind == "vertex" else rng.uniform(low, high)
