"""The bodies and the elements in contact as plain arrays, in the coordinates that they are drawn in."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.problem.problem import Problem
from fcdm_opt.show.plain import drawn
from fcdm_opt.show.scene import face_polygons, own_polygons, true_edges

MOST_NAMED = 8
"""Corners of a face that are named one by one."""


def scene(problem: Problem) -> dict[str, Any]:
    """Return all bodies of a problem as triangles and true edges; keep-outs at their largest scale.

    The first two are shown at scales about their `seed`, the others as they are.
    """
    keep_outs = [keep_out.body.scaled(keep_out.ends[1]) for keep_out in problem.keep_out]
    bodies = [problem.movable, problem.static, *keep_outs]
    objects = [{"body": k, "name": body.name, **_surface(body)} for k, body in enumerate(bodies)]
    return {"size": problem.size, "objects": objects}


def _surface(body: Body) -> dict[str, Any]:
    """Return the body's own faces as triangles and its true edges; each corner is listed once."""
    rows = _Corners()
    triangles = [fan for polygon in own_polygons(body) for fan in _fans(rows.of(polygon))]
    edges = [rows.of(ends) for ends in true_edges(body).values()]
    return {"points": drawn(rows.points), "triangles": triangles, "edges": edges, "seed": drawn(body.seed)}


class _Corners:
    """Points, each listed once, in the order in which they were first asked for."""

    def __init__(self) -> None:
        self._known: dict[bytes, int] = {}
        self.points: list[Array] = []

    def of(self, corners: Array) -> list[int]:
        """Return the rows of points (k, 3)."""
        places = []
        for corner in corners + 0.0:  # -0.0 and 0.0 are one
            row = self._known.setdefault(corner.tobytes(), len(self.points))
            if row == len(self.points):
                self.points.append(corner)
            places.append(row)
        return places


def _fans(loop: list[int]) -> list[list[int]]:
    """Return the triangles of a convex polygon about its first corner."""
    return [[loop[0], loop[k], loop[k + 1]] for k in range(1, len(loop) - 1)]


class ContactShapes:
    """The features that frames name, each once, with what to draw for it.

    Parameters
    ----------
    movable, static : Body
        As drawn.
    """

    def __init__(self, movable: Body, static: Body) -> None:
        self._bodies = movable, static
        self._features: dict[Feature, int] = {}

    def of(self, features: Iterable[Feature]) -> list[int]:
        """Return the places of features in `listed`."""
        return [self._features.setdefault(feature, len(self._features)) for feature in features]

    def listed(self) -> list[dict[str, Any]]:
        """Return label and shapes of every feature asked for, vertices and edges as points, faces as triangles."""
        return [
            {
                "label": feature.label,
                "shapes": [
                    _shape(k, body, element)
                    for k, (body, element) in enumerate(zip(self._bodies, (feature.one, feature.two), strict=True))
                ],
            }
            for feature in self._features
        ]


def _shape(place: int, body: Body, element: Element) -> dict[str, Any]:
    rows, triangles = _Corners(), list[list[int]]()
    if element.kind == "F":
        triangles = [fan for polygon in face_polygons(body, element) for fan in _fans(rows.of(polygon))]
    else:
        rows.of(body.vertices[np.array(element.vertices) - 1])
    return {
        "body": place,
        "kind": element.kind,
        "points": drawn(rows.points),
        "triangles": triangles,
        "name": _name(element),
    }


def _name(element: Element) -> str:
    """Return "V6", "E V4-V10" or "F V2,V3,V5"."""
    labels = [f"V{label}" for label in element.vertices]
    if element.kind == "V":
        return labels[0]
    if element.kind == "E":
        return f"E {'-'.join(labels)}"
    more = f", ... ({len(labels)} corners)" if len(labels) > MOST_NAMED else ""
    return f"F {','.join(labels[:MOST_NAMED])}{more}"
