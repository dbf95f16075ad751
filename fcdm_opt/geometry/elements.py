"""The body's own vertices, edges and faces, and which of them each part's elements belong to."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.hull import Hull, unit_normal
from fcdm_opt.tolerances import DEFAULT


class Element(NamedTuple):
    """A vertex, edge or face of a body: `kind` "V", "E" or "F" and the body's 1-based vertex labels."""

    kind: str
    vertices: tuple[int, ...]


def own_elements(
    points: Array, hulls: list[Hull], given: list[list[int]] | None
) -> tuple[tuple[tuple[int, ...], ...], list[dict[str, tuple[Element, ...]]]]:
    """Return the body's faces and, for each part, the body's element that each vertex, edge, face belongs to."""
    size = np.abs(points - points.mean(axis=0)).max()
    rows = [[tuple(used[v] for v in loop) for loop in loops] for used, loops, _ in hulls]
    planes = [[_plane(points, loop) for loop in loops] for loops in rows]
    if given is None:
        groups = _faces_from_parts(rows, planes, size)
        given = [sorted({v for part, face in group for v in rows[part][face]}) for group in groups]
        owner = {place: k for k, group in enumerate(groups) for place in group}
    else:
        owner = _owners(points, rows, planes, given, size)
    faces = tuple(tuple(sorted(v + 1 for v in face)) for face in given)
    around: dict[tuple[int, int], set[int]] = {}
    corners: dict[int, set[int]] = {}
    for (part, face), own in owner.items():
        loop = rows[part][face]
        for a, b in zip(loop, loop[1:] + loop[:1], strict=True):
            around.setdefault((min(a, b), max(a, b)), set()).add(own)
            corners.setdefault(a, set()).add(own)
    elements = []
    for part, (used, _, edges) in enumerate(hulls):
        named_faces = tuple(
            Element("F", faces[owner[part, f]] if (part, f) in owner else _label(loop))
            for f, loop in enumerate(rows[part])
        )
        named_edges = []
        for a, b, _, _ in edges:
            pair = (min(used[a], used[b]), max(used[a], used[b]))
            beside = around.get(pair, set())
            named_edges.append(Element("F", faces[min(beside)]) if len(beside) == 1 else Element("E", _label(pair)))
        named_vertices = tuple(
            Element("F", faces[min(corners[v])]) if len(corners.get(v, ())) == 1 else Element("V", (v + 1,))
            for v in used
        )
        elements.append({"V": named_vertices, "E": tuple(named_edges), "F": named_faces})
    return faces, elements


def _label(rows: Iterable[int]) -> tuple[int, ...]:
    return tuple(sorted(v + 1 for v in rows))


def _plane(points: Array, loop: tuple[int, ...]) -> tuple[Array, float]:
    normal = unit_normal(points[list(loop)])
    return normal, float(normal @ points[loop[0]])


def _faces_from_parts(rows: Any, planes: Any, size: float) -> list[list[tuple[int, int]]]:
    """Group part faces in one plane that share vertices; drop seams (the same outline turned to each other)."""
    places = [(part, face) for part, loops in enumerate(rows) for face in range(len(loops))]
    if len(rows) == 1:
        return [[place] for place in places]
    outlines: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for part, face in places:
        outlines.setdefault(tuple(sorted(rows[part][face])), []).append((part, face))
    seams = {
        place
        for same in outlines.values()
        for place in same
        if any(planes[place[0]][place[1]][0] @ planes[p][f][0] < 0 for p, f in same)
    }
    groups: list[list[tuple[int, int]]] = []
    for part, face in places:
        if (part, face) in seams:
            continue
        normal, level = planes[part][face]
        mine = [(part, face)]
        rest = []
        for group in groups:
            other, height = planes[group[0][0]][group[0][1]]
            joined = (
                np.abs(normal - other).max() <= DEFAULT.nominal
                and abs(level - height) <= DEFAULT.nominal * size
                and any(set(rows[p][f]) & set(rows[part][face]) for p, f in group)
            )
            (mine := group + mine) if joined else rest.append(group)
        groups = [*rest, mine]
    return groups


def _owners(points: Array, rows: Any, planes: Any, given: list[list[int]], size: float) -> dict[tuple[int, int], int]:
    """Map each part face to the given face in its plane with which it shares most vertices, or in which it lies."""
    owner = {}
    for part, loops in enumerate(rows):
        for face, loop in enumerate(loops):
            normal, level = planes[part][face]
            shared = {
                k: len(set(own) & set(loop))
                for k, own in enumerate(given)
                if np.abs(points[own] @ normal - level).max() <= DEFAULT.nominal * size
            }
            middle = points[list(loop)].mean(axis=0)
            best = max(shared, key=lambda k: shared[k], default=None)
            if best is not None and (shared[best] or _surrounds(points[given[best]], middle, normal)):
                owner[part, face] = best
    return owner


def _surrounds(outline: Array, point: Array, normal: Array) -> bool:
    """Tell whether a polygon, corners in order, goes round a point of its plane: its winding number is not zero."""
    spokes = outline - point
    ahead = np.roll(spokes, -1, axis=0)
    turns = np.arctan2(np.cross(spokes, ahead) @ normal, (spokes * ahead).sum(axis=1))
    return bool(abs(turns.sum()) > np.pi)
