"""Convex solids and how far apart they are: by separating axes, and by distances of corners, edges and triangles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from fcdm_opt_benchmarks.shapes import Array

SAME = 1e-9  # directions that differ by less are one; sizes of the scenes are 1 to 10


def unlike(directions: Array) -> Array:
    """Return the directions, (m, 3), unit and each once, up to their sign."""
    kept: list[Array] = []
    for n in directions:
        length = np.linalg.norm(n)
        if length < SAME:
            continue
        n = n / length
        if not any(abs(abs(float(n @ m)) - 1.0) < SAME and np.linalg.norm(np.cross(n, m)) < SAME for m in kept):
            kept.append(n)
    return np.array(kept).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class ConvexSolid:
    """A convex solid.

    Attributes
    ----------
    points : (n, 3) array
        Its corners, world frame.
    normals, edges : (f, 3) and (e, 3) arrays
        Unit directions of its faces' normals and of its edges, parallel ones once.
    triangles : (m, 3) int array
        Of the surface, rows of `points`.
    """

    points: Array
    normals: Array
    edges: Array
    triangles: Any

    @classmethod
    def of(cls, points: Any) -> ConvexSolid:
        """Return the hull of points, (n, 3)."""
        given = np.asarray(points, dtype=np.float64)
        middle = given.mean(axis=0)
        hull = ConvexHull(given - middle, qhull_options="Qt")
        number = {old: new for new, old in enumerate(sorted(hull.vertices.tolist()))}
        corners = given[sorted(number)]
        triangles = np.array([[number[k] for k in simplex] for simplex in hull.simplices])
        normals = hull.equations[:, :3]
        edges = []
        for k, around in enumerate(hull.neighbors):
            for j, other in enumerate(around):
                if k < other and np.linalg.norm(normals[k] - normals[other]) > 1e-7:
                    one, two = np.delete(hull.simplices[k], j)
                    edges.append(given[two] - given[one])
        return cls(corners, unlike(normals), unlike(np.array(edges)), triangles)

    def scaled(self, seed: Array, scale: float) -> ConvexSolid:
        """Return it scaled about a seed."""
        return ConvexSolid(seed + scale * (self.points - seed), self.normals, self.edges, self.triangles)

    def moved(self, R: Array, t: Array) -> ConvexSolid:
        """Return it after x -> R x + t."""
        return ConvexSolid(self.points @ R.T + t, self.normals @ R.T, self.edges @ R.T, self.triangles)

    @cached_property
    def sides(self) -> Any:
        """Edges of the triangles, (m, 2), rows of `points`, each once."""
        pairs = np.vstack([self.triangles[:, [0, 1]], self.triangles[:, [1, 2]], self.triangles[:, [2, 0]]])
        return np.unique(np.sort(pairs, axis=1), axis=0)


def axes(one: ConvexSolid, two: ConvexSolid, R: Array) -> Array:
    """Return directions that tell two solids apart, unit, (N, m, 3), for rotations (N, 3, 3) of the first.

    Face normals of both, and products of their edges: one of these separates them if any direction does.
    """
    count = len(R)
    turned, edges = one.normals @ R.transpose(0, 2, 1), one.edges @ R.transpose(0, 2, 1)
    crossed = np.cross(edges[:, :, None, :], two.edges[None, None, :, :]).reshape(count, -1, 3)
    lengths = np.linalg.norm(crossed, axis=2, keepdims=True)
    crossed = np.where(lengths > SAME, crossed / np.where(lengths > SAME, lengths, 1.0), two.normals[0])
    return np.concatenate([np.broadcast_to(two.normals, (count, *two.normals.shape)), turned, crossed], axis=1)


def reaches(one: ConvexSolid, two: ConvexSolid, R: Array, n: Array) -> tuple[Array, Array]:
    """Return the separations along n and along -n of the solids with the first turned by R and not shifted.

    Each (N, m); a shift t of the first takes n.t from the one and adds it to the other.
    """
    local = np.einsum("nij,nmi->nmj", R, n) @ one.points.T
    fixed = n @ two.points.T
    return fixed.min(axis=2) - local.max(axis=2), local.min(axis=2) - fixed.max(axis=2)


def separations(one: ConvexSolid, two: ConvexSolid, R: Array, t: Array) -> Array:
    """Return the largest separation along an axis, (N,), for poses (N, 3, 3), (N, 3) of the first solid.

    Above 0 they are apart, and by no less; below 0 they overlap, and its negative is the depth.
    """
    n = axes(one, two, R)
    above, below = reaches(one, two, R, n)
    along = np.einsum("nmi,ni->nm", n, t)
    return np.maximum(above - along, below + along).max(axis=1)


def distance(one: ConvexSolid, two: ConvexSolid) -> float:
    """Return the Euclidean distance of two solids that are apart."""
    return min(_corners(one, two), _corners(two, one), _crossing(one, two))


def _corners(one: ConvexSolid, two: ConvexSolid) -> float:
    """Return the least distance of a corner of the first from a triangle of the second."""
    p = one.points[:, None, :]
    a, b, c = (two.points[two.triangles[:, k]][None] for k in range(3))
    least = np.inf
    for u, v in ((a, b), (b, c), (c, a)):
        along = v - u
        s = np.clip(((p - u) * along).sum(2) / (along * along).sum(2), 0.0, 1.0)
        least = min(least, float(np.linalg.norm(p - u - s[..., None] * along, axis=2).min()))
    n = np.cross(b - a, c - a)
    n = n / np.linalg.norm(n, axis=2, keepdims=True)
    inside = np.ones((len(one.points), len(two.triangles)), dtype=bool)
    for u, v in ((a, b), (b, c), (c, a)):
        inside &= (np.cross(v - u, p - u) * n).sum(2) >= 0
    height = np.abs(((p - a) * n).sum(2))
    return min(least, float(height[inside].min())) if inside.any() else least


def _crossing(one: ConvexSolid, two: ConvexSolid) -> float:
    """Return the least distance of two edges whose nearest points are inside both."""
    p, q = one.points[one.sides[:, 0]][:, None], two.points[two.sides[:, 0]][None]
    u, v = one.points[one.sides[:, 1]][:, None] - p, two.points[two.sides[:, 1]][None] - q
    n, w = np.cross(u, v), q - p
    square = (n * n).sum(2)
    crossing = square > 1e-18 * (u * u).sum(2) * (v * v).sum(2)
    square = np.where(crossing, square, 1.0)
    s, r = (np.cross(w, v) * n).sum(2) / square, (np.cross(w, u) * n).sum(2) / square
    inside = crossing & (s >= 0) & (s <= 1) & (r >= 0) & (r <= 1)
    gaps = np.abs((w * n).sum(2)) / np.sqrt(square)
    return float(gaps[inside].min()) if inside.any() else np.inf
