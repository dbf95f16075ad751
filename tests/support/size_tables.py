"""Hand-made compensation tables whose answers are known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fcdm_opt.design.compensation.table import Table
from fcdm_opt.geometry.arrays import Array

BOX = ((0.96875, 1.03125), (0.984375, 1.015625))  # dyadic: sums of sizes stay exact


def squares(cells: int, box: Any = BOX) -> Array:
    """Return the corners of triangles, two a square of a regular grid."""
    x, y = (np.linspace(low, high, cells + 1) for low, high in box)
    found = []
    for i in range(cells):
        for j in range(cells):
            a, b, c, d = (x[i], y[j]), (x[i + 1], y[j]), (x[i + 1], y[j + 1]), (x[i], y[j + 1])
            found += [(a, b, c), (a, c, d)]
    return np.array(found)


def scattered(count: int, seed: int, box: Any = BOX) -> Array:
    """Return the corners of a Delaunay triangulation of random points, in either sense of rotation."""
    from scipy.spatial import Delaunay

    random = np.random.default_rng(seed)
    (a, b), (c, d) = box
    points = np.concatenate([[(a, c), (b, c), (b, d), (a, d)], random.uniform((a, c), (b, d), (count, 2))])
    corners = points[Delaunay((points - (a, c)) / (b - a, d - c)).simplices]
    turned = random.random(len(corners)) < 0.5
    corners[turned] = corners[turned][:, ::-1]
    return corners


def table(
    corners: Array,
    *functions: Callable[[Array, Array], Array],
    errors: tuple[float, float] = (0.0, 0.0),
    regions: Any = None,
) -> Table:
    """Return a table of an amount, and of parameters p1, p2, ..., each a function of both sizes."""
    nodes = np.concatenate([corners, (corners + np.roll(corners, -1, axis=1)) / 2.0], axis=1)
    x, y = nodes[..., 0], nodes[..., 1]
    return Table(
        corners=corners,
        values=np.stack([np.broadcast_to(function(x, y), x.shape) for function in functions], axis=-1),
        errors=np.tile(errors, (len(corners), 1)),
        regions=np.arange(len(corners)) if regions is None else regions,
        names=tuple(f"p{k}" for k in range(1, len(functions))),
    )
