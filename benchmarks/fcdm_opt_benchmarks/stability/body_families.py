"""Families of bodies that are hard to build: their shapes, and the truth in rationals or in closed form."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import combinations, product
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt_benchmarks.shapes import box, polygon, prism, random_rotation
from fcdm_opt_benchmarks.stability.case import HardCase

Blocks = frozenset[tuple[int, int, int]]
Surface = tuple[Array, list[list[int]]]  # vertices, triangles counter-clockwise seen from outside
Plain = dict[str, Any]
FAR = (1e6, -1e6, 1e6)
CUBE = (8, 12, 6)  # vertices, edges, faces
OVERLAPS = "overlap lost in few digits"
FAULTY = ("faults that can be repaired", "no solid")


def families(seed: int) -> dict[str, list[HardCase]]:
    """Return all cases by family.

    Parameters
    ----------
    seed : int
        Of turns and of random points.
    """
    rng = np.random.default_rng(seed)
    turn = random_rotation(rng)
    made = dict[str, list[HardCase]]()
    for case in [*_of_blocks(turn), *_faulty(turn), *_overlaps(turn), *_hulls(turn), *_random_hulls(rng)]:
        made.setdefault(case.family, []).append(case)
    return made


def _of_blocks(turn: Array) -> Iterable[HardCase]:
    def volume(family: str, name: str, surface: Surface) -> HardCase:
        return _volume_case(family, name, surface, surface)

    cube3, cube5 = _cube_of(3), _cube_of(5)
    inner = frozenset((x + 1, y + 1, z + 1) for x, y, z in cube3)
    hollow = {"cavity": cube3 - {(1, 1, 1)}, "nested cavity": cube5 - inner | {(2, 2, 2)}}
    many = frozenset((2 * x, 2 * y, 2 * z) for x, y, z in cube3 - {(1, 1, 1)})
    for pose, matrix in (("", np.eye(3)), (", turned", turn)):
        for name, own in SOLIDS.items():
            yield volume("solids of blocks", name + pose, _moved(surface_of(own), turn=matrix))
        for name, own in TOUCHING.items():
            yield volume("touching themselves", name + pose, _moved(surface_of(own), turn=matrix))
            apart = _joined([_moved(surface_of(blocks("#")), shift=cube) for cube in sorted(own)])
            name += f", each with vertices of its own{pose}"
            yield volume("touching themselves", name, _moved(apart, turn=matrix))
        for name, own in hollow.items():
            yield volume("cavities", name + pose, _moved(surface_of(own), turn=matrix))
        yield volume("26 components", "cubes apart" + pose, _moved(surface_of(many), turn=matrix))
    family = "tiny, huge, far away"
    for side in (1e-8, 1e-7, 1e-6, 1e-3, 1e6, 1e9):
        for name in ("cube", "L"):
            yield volume(family, f"{name} of side {side:g}", _moved(surface_of(BLOCKS[name]), scale=side))
    for name, own in SOLIDS.items():
        yield volume(family, f"{name} at 1e6", _moved(surface_of(own), shift=FAR))
        yield volume(family, f"{name} at 1e6, turned", _moved(surface_of(own), shift=FAR, turn=turn))


def _faulty(turn: Array) -> Iterable[HardCase]:
    for name, (pose, matrix) in product(("L", "cube", "frame"), (("", np.eye(3)), (", turned", turn))):
        good = _moved(surface_of(BLOCKS[name]), turn=matrix, shift=(3.0, 2.0, 1.0))
        vertices, faces = good
        back = [face[::-1] for face in faces]
        (a, b, _), new = faces[0], len(vertices)
        fin = np.vstack([vertices, vertices[:1] + np.array([[-0.5, -0.25, -0.25]]) @ matrix.T])
        soup = vertices[np.array(faces)].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3).tolist()
        repairable = {
            "duplicated face": (vertices, [*faces, faces[0]]),
            "inverted winding": (vertices, back),
            "one triangle turned": (vertices, [*faces[:3], back[3], *faces[4:]]),
            "fin of two sides": (fin, [*faces, [a, b, new], [b, a, new]]),
            "triangle without area": (vertices, [*faces, [a, b, a]]),
            "each triangle with vertices of its own": soup,
        }
        for fault, surface in repairable.items():
            yield _volume_case(FAULTY[0], f"{name}, {fault}{pose}", surface, good)
        hopeless = {
            "open": (vertices, faces[1:]),
            "open by a quad": (vertices, faces[2:]),
            "fin of one side": (fin, [*faces, [a, b, new]]),
            "a flat sheet": (vertices, [faces[0], back[0]]),
        }
        for fault, surface in hopeless.items():
            yield _volume_case(FAULTY[1], f"{name}, {fault}{pose}", surface, None)


def _overlaps(turn: Array) -> Iterable[HardCase]:
    corners = box((0, 0, 0), (1, 1, 1))
    for depth in (1e-7, 1e-3, 1e-5, 1e-9, -1e-7, -1e-9, -1e-5):
        for place, shift in (("", 0.0), (" at 1000", 1000.0)):
            x = np.array([shift, 0.0, 0.0])
            one, two = corners + x, corners * [1.0, 0.5, 0.5] + [1.0 - depth, 0.25, 0.25] + x
            exact = Fraction(one[:, 0].max()) - Fraction(two[:, 0].min())
            word = "overlapping" if depth > 0 else "apart"
            name = f"boxes {word} by {abs(depth):g}{place}"
            truth = {"depth": max(0.0, float(exact)), "source": "difference of two coordinates, exact"}
            yield HardCase(OVERLAPS, name, "body", _overlap_data(one, two), truth)
            if abs(depth) >= 1e-7 and not shift:
                truth = {"depth": max(0.0, depth), "source": "closed form, turned: rounding of coordinates, 1e-16"}
                yield HardCase(OVERLAPS, f"{name}, turned", "body", _overlap_data(one @ turn.T, two @ turn.T), truth)


def _overlap_data(one: Array, two: Array) -> Plain:
    order = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [own for quad in order for own in (quad[:3], [quad[0], *quad[2:]])]
    return {"ask": "overlap", "one": one.tolist(), "two": two.tolist(), "faces": faces, "area": 0.25}


def _hulls(turn: Array) -> Iterable[HardCase]:
    family = "hull: many sides"
    for sides in (3, 4, 5, 7, 30, 101, 1000):
        flat, pointed = (2 * sides, 3 * sides, sides + 2), (sides + 1, 2 * sides, sides + 1)
        yield _hull_case(
            family, f"prism of {sides} sides, turned", prism(polygon(sides), -1, 1) @ turn.T, flat, turned=True
        )
        yield _hull_case(family, f"pyramid of {sides} sides, turned", _pyramid(sides) @ turn.T, pointed, turned=True)
    a, b = 0.414213562373, 0.171572875254
    rounded = np.array(sorted({own for x in product((-a, a), (-a, a), (-b, b)) for own in _orders(x)}))
    yield _hull_case(family, "rounded cube of 24 vertices", rounded, (24, 36, 14))
    family, corners = "hull: thin, tiny, far away", box((0, 0, 0), (1, 1, 1))
    for thin in (1e-9, 1e-4, 1e-6, 1e-11):
        slab, rod = corners * [1, 1, thin], corners * [1, thin, thin]
        yield _hull_case(family, f"slab of thickness {thin:g}", slab, CUBE)
        yield _hull_case(family, f"rod of thickness {thin:g}", rod, CUBE)
        yield _hull_case(family, f"slab of thickness {thin:g}, turned", slab @ turn.T, CUBE, turned=True)
    for side in (1e-12, 1e-8, 1e-4, 1e4, 1e8, 1e12):
        yield _hull_case(family, f"cube of side {side:g}", side * corners, CUBE)
        yield _hull_case(family, f"cube of side {side:g}, turned", side * corners @ turn.T, CUBE, turned=True)
    yield _hull_case(family, "cube of side 1 at 1e6", corners + FAR, CUBE)
    yield _hull_case(family, "cube of side 2^-10 at 1e6", corners / 1024 + FAR, CUBE)
    slanted = np.array([[79667, -375426, 758120], [79645, -375407, 758146], [79658, -375409, 758130],
                        [79647, -375414, 758144], [79648, -375403, 758142]], float)  # fmt: skip
    for name, points in (
        ("5 points in a slanted plane, far away", slanted),
        ("27 points in a plane", _grid(3)[:, :2] @ np.array([[1.0, 2.0, 3.0], [3.0, -5.0, 1.0]])),
        ("6 points on a line", np.arange(6.0)[:, None] * [1.0, 2.0, 3.0]),
        ("one point 8 times", np.ones((8, 3))),
        ("three points", corners[:3]),
    ):
        yield _hull_case("hull: no solid", name, points, None)


def _random_hulls(rng: np.random.Generator) -> Iterable[HardCase]:
    family, corners = "hull: needless points", box((0, 0, 0), (1, 1, 1))
    yield _hull_case(family, "grid of 27 points", _grid(3), CUBE)
    yield _hull_case(family, "grid of 1000 points", _grid(10), CUBE)
    yield _hull_case(family, "corners of a cube, 5 times each", np.repeat(corners, 5, axis=0), CUBE)
    yield _hull_case(family, "cube and 50 points inside", np.vstack([corners, rng.uniform(0.1, 0.9, (50, 3))]), CUBE)
    on = rng.integers(0, 257, (50, 3)) / 256
    on[np.arange(50), rng.integers(0, 3, 50)] = rng.integers(0, 2, 50)
    yield _hull_case(family, "cube and 50 points on its faces", np.vstack([corners, on]), CUBE)
    for k in range(12):
        points = rng.integers(-4, 5, (15, 3))
        points[:7, 2] = 4
        for aspect in (1, 10**6):
            own = np.vstack([points, points[:3]]) * [1, 1, aspect]
            name = f"7 of 15 points in a plane, 3 of them twice, {k + 1}, aspect {aspect:g}"
            yield _hull_case(family, name, own * 1.0, exact_counts(own), source="exact integers")


def _hull_case(
    family: str,
    name: str,
    points: Array,
    counts: Sequence[int] | None,
    *,
    turned: bool = False,
    source: str = "closed form",
) -> HardCase:
    truth: Plain = {"refused": True, "source": "exact: the points lie in one plane"}
    if turned and counts is not None:
        truth = {"vertices": counts[0], "source": f"{source}; faces are planar within rounding only: not counted"}
    elif counts is not None:
        truth = {**dict(zip(("vertices", "edges", "faces"), counts, strict=True)), "source": source}
    return HardCase(family, name, "body", {"ask": "hull", "vertices": points.tolist()}, truth)


def _volume_case(family: str, name: str, surface: Surface, good: Surface | None) -> HardCase:
    vertices, faces = surface
    data = {"ask": "volume", "vertices": np.asarray(vertices).tolist(), "faces": faces}
    truth: Plain = {"refused": True, "source": "nothing is enclosed, or not by a closed surface"}
    if good is not None:
        truth = {"volume": float(exact_volume(*good)), "source": "signed tetrahedra in rationals"}
    return HardCase(family, name, "body", data, truth)


# -------------------------------------------------------------------------------------------------------------- shapes


def blocks(*layers: str) -> Blocks:
    """Return unit cubes where rows, divided by /, have a #; one text a layer."""
    rows = ((y, z, row) for z, layer in enumerate(layers) for y, row in enumerate(layer.split("/")))
    return frozenset((x, y, z) for y, z, row in rows for x, mark in enumerate(row) if mark == "#")


def _cube_of(steps: int) -> Blocks:
    return blocks(*["/".join(["#" * steps] * steps)] * steps)


SOLIDS: dict[str, Blocks] = {
    "L": blocks("##/#."),
    "U": blocks("#.#/#.#/###"),
    "frame": blocks("###/#.#/###"),
    "cross": blocks(".#./###/.#."),
    "cross in space": blocks(".../.#./...", ".#./###/.#.", ".../.#./..."),
    "cube less an eighth": blocks("##/##", "##/#."),
}
BLOCKS = {"cube": blocks("#"), **SOLIDS}
TOUCHING = {
    "two cubes sharing an edge": blocks("#./.#"),
    "two cubes sharing a vertex": blocks("#./..", "../.#"),
    "two cubes sharing a face": blocks("##"),
}


def surface_of(own: Blocks) -> Surface:
    """Return the surface of unit cubes, in triangles; where cubes meet in an edge or a vertex only, that is one."""
    number = dict[tuple[int, ...], int]()
    faces = []
    for cube, axis, way in product(sorted(own), range(3), (0, 1)):
        if tuple(x + (2 * way - 1) * (k == axis) for k, x in enumerate(cube)) in own:
            continue
        u, v = (axis + 1) % 3, (axis + 2) % 3
        quad = []
        for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
            corner = list(cube)
            corner[axis], corner[u], corner[v] = corner[axis] + way, corner[u] + du, corner[v] + dv
            quad.append(number.setdefault(tuple(corner), len(number)))
        quad = quad if way else quad[::-1]
        faces += [quad[:3], [quad[0], *quad[2:]]]
    return np.array(list(number), float), faces


def _moved(
    surface: Surface, *, scale: float = 1.0, turn: Array | None = None, shift: Sequence[float] = (0.0, 0.0, 0.0)
) -> Surface:
    vertices, faces = surface
    return (scale * vertices @ (np.eye(3) if turn is None else turn).T) + np.asarray(shift), faces


def _joined(surfaces: Sequence[Surface]) -> Surface:
    faces, count = list[list[int]](), 0
    for vertices, own in surfaces:
        faces += [[v + count for v in face] for face in own]
        count += len(vertices)
    return np.vstack([vertices for vertices, _ in surfaces]), faces


def _grid(steps: int) -> Array:
    return np.array(list(product(np.linspace(0, 1, steps), repeat=3)))


def _pyramid(sides: int) -> Array:
    return np.array([*((*x, 0.0) for x in polygon(sides)), (0.0, 0.0, 1.0)])


def _orders(own: Sequence[float]) -> Iterable[tuple[float, ...]]:
    return [tuple(own[(k + j) % 3] for k in range(3)) for j in range(3)]


# --------------------------------------------------------------------------------------------------------------- truth


def exact_volume(vertices: Array, faces: Sequence[Sequence[int]]) -> Fraction:
    """Return what triangles with float corners enclose."""
    points = [[Fraction(x) for x in row] for row in vertices.tolist()]
    total = Fraction(0)
    for (a, b, c), (d, e, f), (g, h, i) in ([points[v] for v in face] for face in faces):
        total += a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return total / 6


def exact_counts(points: Any) -> tuple[int, int, int] | None:
    """Return numbers of vertices, edges and faces of the hull of integer points; None where they span no volume.

    A face is a plane through three of them with none beyond; a point is a vertex where the faces' normals span space.
    """
    rows = sorted({tuple(map(int, row)) for row in points})
    planes = dict[tuple[int, ...], set[tuple[int, ...]]]()
    for p, q, r in combinations(rows, 3):
        u, v = ([x - y for x, y in zip(end, p, strict=True)] for end in (q, r))
        n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
        if not any(n):
            continue
        heights = [sum(a * (x - y) for a, x, y in zip(n, row, p, strict=True)) for row in rows]
        if min(heights) < 0 < max(heights):
            continue
        if min(heights) == max(heights):
            return None
        divisor = math.gcd(*n) * (-1 if max(heights) > 0 else 1)
        on = {row for row, height in zip(rows, heights, strict=True) if height == 0}
        planes.setdefault(tuple(x // divisor for x in n), set()).update(on)
    if not planes:
        return None
    vertices = 0
    for row in rows:
        own = [n for n, on in planes.items() if row in on]
        vertices += any(_determinant(*three) != 0 for three in combinations(own, 3))
    return vertices, vertices + len(planes) - 2, len(planes)


def _determinant(a: Sequence[int], b: Sequence[int], c: Sequence[int]) -> int:
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
