"""What two closed surfaces say of two solids at given scales: coal on the triangles, and winding numbers.

It knows no parts and no contact lines. Surfaces are hollow for coal: solids whose surfaces do not meet overlap where a
shell of one lies inside the other, which one vertex of every shell tells.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import coal
import numpy as np
from solids import Solid

GJK = 1e-12  # relative to the size; coal's own tolerance takes surfaces 1e-6 apart for colliding


class Verdict(NamedTuple):
    """Whether the interiors meet, and the distance of the surfaces; `sure`: coal's two answers agree."""

    overlap: bool
    distance: float
    sure: bool


class ScaledMeshes:
    """Two undecomposed meshes; body 1 scaled and moved, body 2 scaled.

    Parameters
    ----------
    movable, static : Solid
    transform : (4, 4) array
        Pose change of body 1, world frame.
    """

    def __init__(self, movable: Solid, static: Solid, transform: np.ndarray) -> None:
        R = transform[:3, :3]
        self._offset = R @ movable.seed + transform[:3, 3] - static.seed
        self._bases = (movable.vertices - movable.seed) @ R.T, static.vertices - static.seed
        self._triangles = movable.triangles, static.triangles
        self._lists = [coal_triangles(own) for own in self._triangles]
        self._shells = [shells(own) for own in self._triangles]
        self._unit = max(movable.size, static.size)
        self._queries = coal.DistanceRequest(), coal.CollisionRequest()
        for query in self._queries:
            query.gjk_tolerance = query.epa_tolerance = GJK

    def verdict(self, rho: np.ndarray) -> Verdict:
        """Judge the solids at a scale pair."""
        unit = self._unit * max(rho)
        points = (self._offset + rho[0] * self._bases[0]) / unit, rho[1] * self._bases[1] / unit
        one, two = (coal_surface(own, triangles) for own, triangles in zip(points, self._lists, strict=True))
        fixed = coal.Transform3s()
        distance = coal.distance(one, fixed, two, fixed, self._queries[0], coal.DistanceResult())
        meet = coal.collide(one, fixed, two, fixed, self._queries[1], coal.CollisionResult()) > 0
        inside = not meet and any(
            winding_number(points[k][shell[0]], points[1 - k], self._triangles[1 - k]) > 0.5
            for k in (0, 1)
            for shell in self._shells[k]
        )
        return Verdict(meet or inside, float(distance * unit), meet == (distance <= 0))


def coal_triangles(triangles: np.ndarray) -> Any:
    made = coal.StdVec_Triangle()
    made.extend([coal.Triangle(*row) for row in triangles.tolist()])
    return made


def coal_surface(points: np.ndarray, triangles: Any) -> Any:
    vectors = coal.StdVec_Vec3s()
    vectors.extend(list(points))
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(triangles), len(points))
    model.addSubModel(vectors, triangles)
    model.endModel()
    return model


def shells(triangles: np.ndarray) -> list[np.ndarray]:
    """Vertex rows of each connected shell."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = int(triangles.max()) + 1
    edges = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    _, labels = connected_components(coo_array((np.ones(len(edges)), edges.T), shape=(count, count)), directed=False)
    used = np.unique(triangles)
    return [used[labels[used] == label] for label in np.unique(labels[used])]


def winding_number(point: np.ndarray, points: np.ndarray, triangles: np.ndarray) -> float:
    """How often a closed surface winds around a point off it: solid angles over 4 pi (van Oosterom, Strackee, 1983)."""
    a, b, c = np.moveaxis((points - point)[triangles], 1, 0)
    x, y, z = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
    return float(np.arctan2(volume, x * y * z + ab * z + bc * x + ca * y).sum() / (2 * np.pi))
