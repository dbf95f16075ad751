"""Hulls and surfaces as coal's users build them, and two hulls that are asked about again and again."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt_benchmarks.library import library


def coal_hull(points: Array) -> Any:
    """Return the hull of points, (n, 3), as coal's users build it; its own points, in their order, may be rewritten."""
    coal = library("coal")
    vectors = coal.StdVec_Vec3s()
    vectors.extend(list(points))
    return coal.Convex.convexHull(vectors, True, "Qt")


def coal_surface(body: Body) -> Any:
    """Return the surfaces of all parts of a body as one mesh of coal: as far from others as their union is."""
    coal = library("coal")
    vectors, triangles, first = coal.StdVec_Vec3s(), coal.StdVec_Triangle(), 0
    for part in body.parts:
        vectors.extend(list(part.vertices))
        triangles.extend(
            [coal.Triangle(first + loop[0], first + b, first + c) for loop in part.loops for b, c in pairwise(loop[1:])]
        )
        first += len(part.vertices)
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(triangles), len(vectors))
    model.addSubModel(vectors, triangles)
    model.endModel()
    return model


def coal_pose(transform: Array) -> Any:
    """Return a (4, 4) transform for coal."""
    return library("coal").Transform3s(transform[:3, :3], transform[:3, 3])


def coal_requests(tolerance: float | None = None) -> tuple[Any, Any]:
    """Return settings of coal's distance and of its collide: its defaults, or another tolerance."""
    coal = library("coal")
    requests = coal.DistanceRequest(), coal.CollisionRequest()
    if tolerance is not None:
        for request in requests:
            request.gjk_tolerance = request.epa_tolerance = tolerance
    return requests


class CoalHulls:
    """Two hulls about their seeds, built once: points are scaled, the first is turned, the second shifted.

    Parameters
    ----------
    one, two : (n, 3) arrays
    tolerance : float, optional
        Of coal; default its own.

    Attributes
    ----------
    result : coal.DistanceResult
        Of the last `gap`.
    """

    def __init__(self, one: Array, two: Array, tolerance: float | None = None) -> None:
        coal = library("coal")
        self._shapes = [coal_hull(points) for points in (one, two)]
        self._bases = [shape.points().copy() for shape in self._shapes]
        self._poses = coal.Transform3s(), coal.Transform3s()
        self._pair = self._shapes[0], self._poses[0], self._shapes[1], self._poses[1]
        self._distance, self._collision = coal_requests(tolerance)
        self._collision.enable_contact = False
        self.result, self._hit = coal.DistanceResult(), coal.CollisionResult()
        self._measure, self._collide = coal.distance, coal.collide

    def scale(self, k: int, factor: float) -> None:
        """Scale the first hull (0) or the second (1)."""
        np.multiply(self._bases[k], factor, out=self._shapes[k].points())

    def turn(self, R: Array) -> None:
        """Turn the first hull."""
        self._poses[0].setRotation(R)

    def shift(self, d: Array) -> None:
        """Put the second hull's seed at d."""
        self._poses[1].setTranslation(d)

    def overlap(self) -> bool:
        """Ask whether they collide."""
        self._hit.clear()
        return bool(self._collide(*self._pair, self._collision, self._hit))

    def gap(self) -> float:
        """Ask for the signed distance."""
        self.result.clear()  # coal keeps the normal of the least distance so far
        return float(self._measure(*self._pair, self._distance, self.result))
