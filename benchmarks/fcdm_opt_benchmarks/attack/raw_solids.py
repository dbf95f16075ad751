"""Closed surfaces as files have them, and what a library of exact-predicate booleans says of them: manifold3d alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import manifold3d as m3
import numpy as np

from fcdm_opt_benchmarks.shapes import Array

Ints = np.ndarray[Any, np.dtype[np.int64]]


@dataclass(frozen=True, eq=False)
class RawSolid:
    """A closed surface of triangles and the point about which it is scaled.

    Attributes
    ----------
    vertices : (n, 3) array
    triangles : (t, 3) int array
        Counter-clockwise seen from outside.
    seed : (3,) array
    """

    vertices: Array
    triangles: Ints
    seed: Array

    @classmethod
    def of(cls, solid: Any, seed: Any) -> RawSolid:
        """Return the surface of a manifold3d solid."""
        mesh = solid.to_mesh64()
        triangles = np.asarray(mesh.tri_verts).astype(np.int64)
        return cls(np.array(mesh.vert_properties)[:, :3], triangles, np.asarray(seed, dtype=np.float64))

    def scaled(self, rho: float) -> RawSolid:
        """Return the solid made larger about its seed."""
        return replace(self, vertices=self.seed + rho * (self.vertices - self.seed))

    def moved(self, T: Array) -> RawSolid:
        """Return the solid after x -> R x + t, its seed with it."""
        R, t = T[:3, :3], T[:3, 3]
        return replace(self, vertices=self.vertices @ R.T + t, seed=R @ self.seed + t)

    def solid(self) -> Any:
        """Return the manifold3d solid."""
        return m3.Manifold(m3.Mesh64(np.ascontiguousarray(self.vertices), self.triangles.astype(np.uint64)))

    def rounded(self) -> RawSolid:
        """Return the solid with its corners in single precision, as binary STL has them."""
        return replace(self, vertices=self.vertices.astype(np.float32).astype(np.float64))


def block(low: Any, high: Any) -> Any:
    """Return an axis-aligned box."""
    low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    return m3.Manifold.cube((high - low).tolist()).translate(low.tolist())


def prism(sides: int, apothem: float, low: float, high: float, middle: Any = (0.0, 0.0)) -> Any:
    """Return a regular prism along z with faces across +x and -x; `sides` is a multiple of four."""
    radius = apothem / np.cos(np.pi / sides)
    angles = (2 * np.arange(sides) + 1) * np.pi / sides
    corners = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    outline = m3.CrossSection([corners])
    return outline.extrude(high - low).translate([middle[0], middle[1], low])


def ball(radius: float, middle: Any, rounds: int) -> Any:
    """Return a ball of 8 * 4^rounds facets."""
    return m3.Manifold.sphere(radius, 4 * 2**rounds).translate(list(middle))


def depth_at_most(one: RawSolid, two: RawSolid, limit: float) -> bool:
    """Tell whether two solids overlap by no more than a skin of this thickness would."""
    shared = one.solid() ^ two.solid()
    if shared.volume() <= 0.0:
        return True
    return bool(shared.volume() <= limit * shared.surface_area())


def distance(one: RawSolid, two: RawSolid, most: float) -> float:
    """Return how far two solids are apart, at the most `most`."""
    return float(one.solid().min_gap(two.solid(), most))
