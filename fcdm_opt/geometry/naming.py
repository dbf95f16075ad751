"""Short names of faces that labels of many corners, or of facets of a round face, tell little of."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body, cached_of_whole
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.polygons import distances
from fcdm_opt.geometry.round_recognition import (
    FEW,
    MANY_CORNERS,
    Label,
    Round,
    normals_and_rounds,
)
from fcdm_opt.tolerances import DEFAULT

ASLANT = 0.2  # component of a normal from which on a face looks along that axis too
NUMBER = re.compile(r" no\. \d+$")
RADIUS = re.compile(r"(?<= radius )\S+|(?<= to )\S+")
MOST_NAMED = 4  # faces that are listed by name
NUMBERED = 24  # corners of a body up to which one is told by its number
ALONG = np.linspace(0.0, 1.0, 17)[1:-1, None]  # places on an edge
NEAR_FACE = 1e-3  # of the size: so near to a face is what stands for it
ENDS = (("left", "right"), ("front", "back"), ("bottom", "top"))
"""Faces that a body ends with along x, y and z, below and above: as drawings have them, where the front view looks
along +y."""
SIDES = tuple(side for pair in ENDS for side in pair)


@cached_of_whole
def names_of_faces(body: Body, *, four_digits: bool = False) -> dict[Label, str]:
    """Return the names of those faces of a body that have one, by their labels.

    "cylinder radius 9.9" for each facet of a convex cylinder, "bore radius 9.9" for those of a concave one, "sphere
    radius 9.9" and "hollow radius 9.9", "cone radius 4 to 8" and "countersink radius 4 to 8" alike, the radius of
    their corners; "top", "bottom" and so on for plane faces of many corners that the body ends with along an axis;
    "face 12", as they are counted, for others. Several that are called alike are numbered: "bore radius 2 no. 1".
    `four_digits`: with radii to `FEW` digits.
    """
    if body.at_scale is not None:
        return names_of_faces(body.at_scale[0], four_digits=four_digits)
    normals, rounds = normals_and_rounds(body)
    return {**_plane(body, normals, MANY_CORNERS), **_numbered(body, rounds, four_digits)}


def _numbered(body: Body, rounds: Sequence[Round], four_digits: bool) -> dict[Label, str]:
    """Return the name of each round face; what is called alike is numbered, as drawn where its faces were moved."""
    order = sorted(range(len(rounds)), key=lambda k: rounds[k].faces)
    called = [
        RADIUS.sub(lambda own: f"{float(own[0]):.{FEW}g}", own.name) if four_digits else own.name for own in rounds
    ]
    names = dict(sorted(zip(order, numbered_names([called[k] for k in order]), strict=True)))
    if (drawn := body.drawn) is not None:  # surfaces that are told are in the same order, whatever labels faces have
        before = (
            normals_and_rounds(drawn)[1] if body.surfaces is not None else rounds if drawn.faces == body.faces else []
        )
        known = names_of_faces(drawn, four_digits=four_digits)
        alike = zip(called, [NUMBER.search(known.get(own.faces[0], "")) for own in before], strict=False)
        as_drawn = {k: name + (number[0] if number else "") for k, (name, number) in enumerate(alike)}
        if len(set(as_drawn.values())) == len(names):  # else sizes have made faces alike that are not as drawn
            names = as_drawn
    return {face: name for k, name in names.items() for face in rounds[k].faces}


def numbered_names(names: Sequence[str]) -> list[str]:
    """Return names of which each stands for one thing: "top no. 2" where several are called alike."""
    alike, counted, found = Counter(names), Counter[str](), list[str]()
    for name in names:
        counted[name] += 1
        found.append(f"{name} no. {counted[name]}" if alike[name] > 1 else name)
    return found


def element_text(body: Body, element: Element) -> str:
    """Return an element in words: "top face (facing +z)", "bore of radius 10", "face 3 (facing -x)", "corner 5"."""
    # an edge is told by the faces that meet in it; what lies within one round face is told as that. Corners of bodies
    # with many of them are told by where they are as drawn: "corner at (3, 0, 12.5)"
    body = body.full_body or body
    if body.exact is not None:
        rows, points = rows_of_element(body, element), body.vertices[np.array(element.vertices) - 1]
        off, body = _off_true_faces(body, element, points), body.exact.facets
        if max(element.vertices) > len(body.vertices):  # of a facet that was moved to be within the true solid
            on = [row for row in rows if off.get(row, np.inf) <= DEFAULT.touch * body.size]
            if element.kind == "F" or len(on) == 1 or (off and not on):
                return element_text(body, Element("F", body.faces[rows[0]]))
            named = names_of_rows(body)
            sides, along = [named[row] for row in on or rows], points[0] + ALONG * (points[-1] - points[0])
            if not any(" radius " in side for side in sides):  # a chord, as across a bore that it is beside somewhere
                sides = [named[row] for row in _rows_near(body, along) if " radius " in named[row]] or sides
            return _edge_or_corner(element.kind, sides, [*map(_place, points)])
    label, names = tuple(sorted(element.vertices)), described_faces(body)
    if element.kind == "F":
        name, side = names.get(label, ("face", ""))
        end, *number = name.split(" ", 1)
        text = " ".join((end, "face", *number)) if end in SIDES else _rounded(name)
        return f"{text} (facing {side})" if side else text
    sides = [names[face][0] for face in body.faces_with(label) if face in names]
    few = len(body.vertices) <= NUMBERED
    return _edge_or_corner(element.kind, sides, [str(v) if few else _place(body.vertices[v - 1]) for v in label])


def rows_of_element(body: Body, element: Element) -> list[int]:
    """Return the rows of the faces of a body, as drawn, that an element is of, that which names it first."""
    body = body.full_body or body
    drawn = body.of_facets
    if off := _off_true_faces(body, element, body.vertices[np.array(element.vertices) - 1]):
        return sorted(off, key=lambda row: off[row] > DEFAULT.touch * body.size)
    if max(element.vertices) > len(drawn.vertices):
        return _rows_near(drawn, body.vertices[np.array(element.vertices) - 1].mean(axis=0)[None])
    return [row for row in rows_at(drawn, element) if row >= 0]


def _off_true_faces(body: Body, element: Element, points: Array) -> dict[int, float]:
    """Return how far an element leaves each of the true faces at whose point it is, by their rows; none of others."""
    if (piece := body.piece_of(element)) is None:
        return {}
    off = np.abs(piece.normals @ np.diff(points, axis=0).T).max(axis=1, initial=0.0)
    return dict(zip(piece.rows, off.tolist(), strict=True))


def _rows_near(body: Body, points: Array) -> list[int]:
    """Return the rows of the faces that some of a few points are on or beside, the nearest first."""
    corners, owners = body.face_triangles
    off = distances(points, corners).min(axis=1)
    near = np.flatnonzero(off <= 2.0 * off.min() + NEAR_FACE * body.size)
    return list(dict.fromkeys(owners[near[np.argsort(off[near], kind="stable")]].tolist()))


def rows_at(body: Body, element: Element) -> list[int]:
    """Return the rows in `Body.faces` of a face, or of all that meet at an edge or corner; -1 of one that has none."""
    label = tuple(sorted(element.vertices))
    return [body.face_rows.get(face, -1) for face in ([label] if element.kind == "F" else body.faces_with(label))]


def _edge_or_corner(kind: str, sides: Sequence[str], ends: Sequence[str]) -> str:
    """Return an edge or a corner in words, from the names of the faces that meet there and what its ends are called."""
    sides = list(dict.fromkeys(map(_rounded, sides)))
    if len(sides) == 1 and is_round(sides[0]):
        return sides[0]
    if kind == "V" and not (len(sides) == 2 and any(map(is_round, sides))):  # else on the rim of a round face
        return f"corner {ends[0]}"
    if len(sides) == 2:
        return f"edge between {sides[0]} and {sides[1]}"
    return f"edge from corner {ends[0]} to {ends[-1]}"


def _place(point: Array) -> str:
    """Return where a corner is, in words."""
    least = DEFAULT.weld * float(np.abs(point).max())
    return f"at ({', '.join(f'{x if abs(x) > least else 0.0:.4g}' for x in point.tolist())})"


def is_round(text: str) -> bool:
    """Tell whether an element in words is a round face."""
    return " of radius " in text and not text.startswith("edge ")


def pair_in_words(movable: Body, static: Body, parts: Sequence[int]) -> str:
    """Return two convex parts in words: by their bodies, of which one with several has its parts counted from 1."""
    # but for bodies that are exact at points of round faces, of which there is a part for each
    bodies = (movable.name or "the movable part", movable), (static.name or "the static part", static)
    both = zip(bodies, parts, strict=True)
    words = (
        f"convex part {k + 1} of " * (len(body.parts) > 1 and body.exact is None) + name for (name, body), k in both
    )
    return " and ".join(words)


def with_article(text: str) -> str:
    """Return an element in words with "the", but where a number names it."""
    numbered = text.startswith(("corner ", "face ")) and not text.startswith("corner at ")
    return text if numbered else f"the {text}"


def _rounded(name: str) -> str:
    return name.replace(" radius ", " of radius ")


@cached_of_whole
def described_faces(body: Body, *, four_digits: bool = False) -> dict[Label, tuple[str, str]]:
    """Return a name for every face of a body, and the axes that it looks along, "" where it is round."""
    normals, rounds = normals_and_rounds(body)
    named = {}
    for face, name in {**_plane(body, normals, 0), **_numbered(body, rounds, four_digits)}.items():
        normal = normals[face]
        along = [k for k in np.argsort(-np.abs(normal), kind="stable").tolist() if abs(normal[k]) >= ASLANT]
        sides = [f"{'-+'[int(normal[k] > 0.0)]}{'xyz'[k]}" for k in along]
        named[face] = (name, "" if " radius " in name else " and ".join(sides))
    return named


def names_of_rows(body: Body, *, four_digits: bool = False) -> list[str]:
    """Return the names of a body's faces, in their order; "face 12" where there is nothing better."""
    described = described_faces(body, four_digits=four_digits)
    return [described.get(tuple(sorted(face)), (f"face {k}", ""))[0] for k, face in enumerate(body.faces, 1)]


def selectors_of_rows(body: Body) -> list[str]:
    """Return what selects each face of a body: its name, or its label where it has none."""
    return [f"F{name[5:]}" if name.startswith("face ") else name for name in names_of_rows(body)]


def faces_text(body: Body, rows: Sequence[int]) -> str:
    """Return faces in words, as `fcdm-opt faces` lists them: "face bottom", "faces F3, F7", "bore radius 8"."""
    names = selectors_of_rows(body)
    ends = [name.split(" no. ")[0] for name in names]
    others = {ends[row] for row in range(len(ends)) if row not in {*rows}}
    texts = [*dict.fromkeys(ends[row] if ends[row] in {*SIDES} - others else names[row] for row in rows)]
    texts.sort(key=lambda text: " radius " in text)
    plane = sum(" radius " not in text for text in texts)
    few = ", ".join(texts[:MOST_NAMED]) + ", ..." * (len(texts) > MOST_NAMED)
    return f"face{'s' * (plane > 1)} {few}" if plane else few


def _plane(body: Body, normals: dict[Label, Array], least: int) -> dict[Label, str]:
    """Return the names of plane faces with so many corners at least; several at one end of the body are numbered."""
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    slack = DEFAULT.side * float((high - low).max())
    ends = dict[Label, str]()
    for face in body.faces:
        if face in normals:
            normal, corner = normals[face], body.vertices[face[0] - 1]
            k = int(np.abs(normal).argmax())
            up = bool(normal[k] > 0.0)
            if abs(normal[k]) >= 1.0 - DEFAULT.side and abs((high if up else low)[k] - corner[k]) <= slack:
                ends[face] = ENDS[k][up]
    named = {face: f"face {number}" for number, face in enumerate(body.faces, 1) if face in normals}
    named.update(zip(ends, numbered_names([*ends.values()]), strict=True))
    return {face: name for face, name in named.items() if len(face) >= least}
