"""Solids of unit cubes, and their surfaces."""

from __future__ import annotations

import itertools

import numpy as np

Voxels = set[tuple[int, int, int]]
Faces = list[list[int]]


def stacked(*layers: str) -> Voxels:
    """Unit cubes where rows, divided by /, have a #; one text a layer."""
    return {
        (x, y, z)
        for z, layer in enumerate(layers)
        for y, row in enumerate(layer.split("/"))
        for x, mark in enumerate(row)
        if mark == "#"
    }


CUBE3 = set(itertools.product(range(3), repeat=3))
VOXELS: dict[str, tuple[Voxels, int, int | None]] = {  # unit cubes, parts of a partition, of a cover
    "L": (stacked("##/#."), 2, 2),
    "T": (stacked("###/.#."), 2, 2),
    "U": (stacked("#.#/#.#/###"), 3, None),
    "square frame": (stacked("###/#.#/###"), 4, None),
    "two frames": (stacked("#####/#.#.#/#####"), 5, None),
    "cross": (stacked(".#./###/.#."), 3, 2),
    "cross in space": ({x for x in CUBE3 if x.count(1) >= 2}, 5, 3),
    "cube less an eighth": (set(itertools.product(range(2), repeat=3)) - {(1, 1, 1)}, 3, 3),
    "nested cavity": (CUBE3 - {(1, 1, 1)}, 6, None),
    "edges of a cube": ({x for x in CUBE3 if x.count(1) <= 1}, 12, None),
    "comb": (stacked("#.#.#.#.#.#/###########"), 7, None),
    "stairs": (stacked("######/.#####/..####/...###/....##/.....#"), 6, None),
    "two cubes sharing an edge": ({(0, 0, 0), (1, 1, 0)}, 2, 2),
    "two cubes sharing a vertex": ({(0, 0, 0), (1, 1, 1)}, 2, 2),
    "two cubes apart": ({(0, 0, 0), (2, 0, 0)}, 2, None),
}


def surface_of(voxels: Voxels) -> tuple[np.ndarray, Faces]:
    number: dict[tuple[int, ...], int] = {}
    faces = []
    for cube, axis, way in itertools.product(sorted(voxels), range(3), (0, 1)):
        if tuple(x + (2 * way - 1) * (k == axis) for k, x in enumerate(cube)) in voxels:
            continue
        u, v = (axis + 1) % 3, (axis + 2) % 3
        face = []
        for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
            corner = list(cube)
            corner[axis], corner[u], corner[v] = corner[axis] + way, corner[u] + du, corner[v] + dv
            face.append(number.setdefault(tuple(corner), len(number)))
        faces.append(face if way else face[::-1])
    return np.array(list(number), float), faces
