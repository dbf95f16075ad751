"""Short names of faces that labels of many corners, or of facets of a cylinder, tell little of."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from functools import lru_cache

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.polygons import components
from fcdm_opt.tolerances import DEFAULT

MANY = 8  # corners from which a plane face goes by a name
FEWEST = 6  # facets side by side that are taken for a cylinder
TURN = 0.65  # cosine: the most that two of them are turned against one another
ROUND = 1e-4  # of the radius: how far corners may be off it
ENDS = (("back", "front"), ("left", "right"), ("bottom", "top"))
"""Faces that a body ends with along x, y and z: below, above."""
SIDES = tuple(side for pair in ENDS for side in pair)

Label = tuple[int, ...]
_FACET = re.compile(r"(P[12])V[V0-9,]+ of (\w+ radius )")


@lru_cache(maxsize=16)
def names_of_faces(body: Body) -> dict[Label, str]:
    """Return the names of those faces of a body that have one, by their labels.

    "cylinder radius 9.9" for each facet of a convex cylinder, "bore radius 9.9" for those of a concave one, the radius
    of their corners ("bore radius 2 no. 1" where several are alike); "top", "bottom" and so on for plane faces of many
    corners that the body ends with along an axis; "face 12", as they are counted, for others.
    """
    normals = normals_of_faces(body)
    return {**_plane(body, normals, MANY), **_round(body, normals)}


def told_element(body: Body, element: Element) -> str:
    """Return an element of a body in words: "top (+z) face", "bore radius 10", "face 3 (-x)", "corner 5".

    An edge is told by the faces that meet in it.
    """
    label, names = tuple(sorted(element.vertices)), told_faces(body)
    if element.kind == "V":
        return f"corner {label[0]}"
    if element.kind == "F":
        name, side = names.get(label, ("face", ""))
        told = f"{name} ({side})" if side else name
        return f"{told} face" if name in SIDES else told
    sides = list(dict.fromkeys(names[face][0] for face in body.faces if set(label) <= set(face) and face in names))
    if len(sides) == 2:
        return f"edge between {sides[0]} and {sides[1]}"
    return f"edge from corner {label[0]} to {label[-1]}"


@lru_cache(maxsize=16)
def told_faces(body: Body) -> dict[Label, tuple[str, str]]:
    """Return a name for every face of a body, and the axis that it faces along, "" where it does so along none."""
    normals = normals_of_faces(body)
    named = {}
    for face, name in {**_plane(body, normals, 0), **_round(body, normals)}.items():
        k = int(np.abs(normals[face]).argmax())
        straight = abs(normals[face][k]) >= 1.0 - DEFAULT.side and " radius " not in name
        named[face] = (name, f"{'-+'[int(normals[face][k] > 0.0)]}{'xyz'[k]}" if straight else "")
    return named


def names_of_rows(body: Body) -> list[str]:
    """Return the names of a body's faces, in their order; "face 12" where there is nothing better."""
    told = told_faces(body)
    return [told.get(tuple(sorted(face)), (f"face {k}", ""))[0] for k, face in enumerate(body.faces, 1)]


def without_corners(told: str) -> str:
    """Return a contact as `Feature.told` gives it, without the corners of facets that go by their cylinder's name."""
    return _FACET.sub(r"\1 \2", told)


def normals_of_faces(body: Body) -> dict[Label, Array]:
    """Return a normal of each face that a part carries."""
    normals: dict[Label, Array] = {}
    for part in body.parts:
        for k, face in enumerate(part.elements["F"]):
            normals.setdefault(face.vertices, part.normals[k])
        for (kind, k), span in part.elements.spans.items():
            for face in span.elements if kind == "F" else ():
                normals.setdefault(face.vertices, part.normals[k])
    return normals


def _plane(body: Body, normals: dict[Label, Array], least: int) -> dict[Label, str]:
    """Return the names of plane faces with so many corners at least."""
    named: dict[Label, str] = {}
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    slack = DEFAULT.side * float((high - low).max())
    for number, face in enumerate(body.faces, 1):
        if len(face) < least or face not in normals:
            continue
        normal, corner = normals[face], body.vertices[face[0] - 1]
        k = int(np.abs(normal).argmax())
        up = bool(normal[k] > 0.0)
        ends = abs(normal[k]) >= 1.0 - DEFAULT.side and abs((high if up else low)[k] - corner[k]) <= slack
        name = ENDS[k][up] if ends else f"face {number}"
        named[face] = name if name not in named.values() else f"face {number}"
    return named


def _round(body: Body, normals: dict[Label, Array]) -> dict[Label, str]:
    """Return the names of facets that lie side by side around one axis."""
    around = defaultdict[int, set[Label]](set)
    facets = [face for face in normals if len(face) < MANY]
    for face in facets:
        for vertex in face:
            around[vertex].add(face)
    by_axis = defaultdict[Label, list[tuple[Label, Label]]](list)
    for face in facets:
        for other in set[Label]().union(*(around[vertex] for vertex in face)):
            shared = sorted(set(face) & set(other))
            if face >= other or len(shared) != 2 or not TURN <= normals[face] @ normals[other] < 1.0 - ROUND:
                continue
            way = body.vertices[shared[1] - 1] - body.vertices[shared[0] - 1]
            way = way / np.linalg.norm(way)
            way *= np.sign(way[np.abs(way).argmax()])
            by_axis[tuple(np.round(way / ROUND).astype(int).tolist())].append((face, other))
    rounds: list[tuple[str, list[Label]]] = []
    for key, pairs in by_axis.items():
        faces = sorted({face for pair in pairs for face in pair})
        place = {face: k for k, face in enumerate(faces)}
        owners = components(np.array([[place[one], place[two]] for one, two in pairs]), len(faces))
        for owner in np.unique(owners).tolist():
            own = [faces[k] for k in np.flatnonzero(owners == owner)]
            name = _radius(body, own, normals, np.array(key, dtype=np.float64)) if len(own) >= FEWEST else ""
            rounds += [(name, own)] if name else []
    names, count = [name for name, _ in rounds], Counter[str]()
    named: dict[Label, str] = {}
    for name, own in sorted(rounds, key=lambda one: one[1]):
        count[name] += 1
        named |= dict.fromkeys(own, name if names.count(name) == 1 else f"{name} no. {count[name]}")
    return named


def _radius(body: Body, faces: list[Label], normals: dict[Label, Array], axis: Array) -> str:
    """Return what facets around an axis are, nothing where their corners are not as far from one line."""
    axis = axis / np.linalg.norm(axis)
    corners = body.vertices[np.unique([v - 1 for face in faces for v in face])]
    flat = np.linalg.svd(axis[None])[2][1:]
    points = corners @ flat.T
    # |x - c|^2 = r^2, linear in c and r^2 - c^2
    found = np.linalg.lstsq(np.column_stack([2.0 * points, np.ones(len(points))]), (points**2).sum(axis=1))[0]
    off = np.linalg.norm(points - found[:2], axis=1)
    radius = float(off.mean())
    if np.abs(off - radius).max() > ROUND * radius:
        return ""
    outward = [normals[face] @ flat.T @ (body.vertices[face[0] - 1] @ flat.T - found[:2]) > 0.0 for face in faces]
    return f"{'cylinder' if all(outward) else 'bore'} radius {radius:.4g}" if len(set(outward)) == 1 else ""
