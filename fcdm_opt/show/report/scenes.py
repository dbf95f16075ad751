"""The bodies and the elements in contact as plain arrays, in the coordinates that they are drawn in."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.plain import drawn
from fcdm_opt.problem.problem import Problem
from fcdm_opt.show.scene import face_polygons, own_polygons, true_edges

MOST_NAMED = 8
"""Corners of a face that are named one by one."""

Rows = dict[tuple[float, ...], int]
"""Points, each listed once, in the order in which they were first asked for."""


def scene(problem: Problem) -> dict[str, Any]:
    """Return all bodies of a problem as triangles and true edges; keep-outs at their largest scale.

    The first two are shown at scales about their `seed`, the others as they are.
    """
    keep_outs = [keep_out.body.scaled(keep_out.ends[1]) for keep_out in problem.keep_out]
    objects = []
    for k, body in enumerate((problem.movable, problem.static, *keep_outs)):
        rows: Rows = {}
        triangles = _triangles(rows, own_polygons(body))
        edges = [_rows(rows, ends) for ends in true_edges(body).values()]
        shape = {"points": drawn(list(rows)), "triangles": triangles, "edges": edges, "seed": drawn(body.seed)}
        objects.append({"body": k, "name": body.name, **shape})
    return {"size": problem.size, "objects": objects}


def contact_shapes(problem: Problem, feature: Feature) -> dict[str, Any]:
    """Return label and shapes of a feature, vertices and edges as points, faces as triangles."""
    bodies = (problem.movable, feature.one), (problem.static, feature.two)
    return {"label": feature.label, "shapes": [{"body": k, **_shape(*each)} for k, each in enumerate(bodies)]}


def _shape(body: Body, element: Element) -> dict[str, Any]:
    rows, triangles = Rows(), list[list[int]]()
    if element.kind == "F":
        triangles = _triangles(rows, face_polygons(body, element))
    else:
        _rows(rows, body.vertices[np.array(element.vertices) - 1])
    return {"kind": element.kind, "points": drawn(list(rows)), "triangles": triangles, "name": _name(element)}


def _rows(known: Rows, corners: Array) -> list[int]:
    """Return the rows of points (k, 3); new ones are listed."""
    return [known.setdefault(tuple(corner), len(known)) for corner in (corners + 0.0).tolist()]  # -0.0 and 0.0 are one


def _triangles(known: Rows, polygons: Iterable[Array]) -> list[list[int]]:
    """Return the triangles of convex polygons, each about its first corner."""
    loops = [_rows(known, polygon) for polygon in polygons]
    return [[loop[0], loop[k], loop[k + 1]] for loop in loops for k in range(1, len(loop) - 1)]


def _name(element: Element) -> str:
    """Return "V6", "E V4-V10" or "F V2,V3,V5"."""
    labels = [f"V{label}" for label in element.vertices]
    if element.kind != "F":
        return labels[0] if element.kind == "V" else f"E {'-'.join(labels)}"
    more = f", ... ({len(labels)} corners)" if len(labels) > MOST_NAMED else ""
    return f"F {','.join(labels[:MOST_NAMED])}{more}"
