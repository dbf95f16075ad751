"""Faces in place of those of their edges and corners that touch, where the whole face lies there."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.naming import element_text, is_round, rows_of_element
from fcdm_opt.geometry.round_recognition import round_faces
from fcdm_opt.problem.fit import drawn_bodies
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

DIGITS = 2.0  # times the rounding of both bodies' corners: planes through some of them, looked at where others are
CONVEX = ("cylinder", "cone")
ON_A_FACE = ("V1F2", "F1V2", "E1F2", "F1E2")


def with_whole_faces(problem: Problem, features: Sequence[Feature], transform: Array | None) -> list[Feature]:
    """Return contacts with those of faces in place of those of their edges and corners, each once.

    Of a face that lies on another one but for the digits of files, where the movable part's `transform` is told; and of
    one that lies along a round face, by one of its edges, in that place or as drawn.
    """
    found = [own if transform is None else _on_a_face(problem, own, transform) for own in features]
    for role in (0, 1):
        found = [_along_round_face(problem, own, np.eye(4) if transform is None else transform, role) for own in found]
    return list(dict.fromkeys(found))


def _on_a_face(problem: Problem, feature: Feature, transform: Array) -> Feature:
    digits = DIGITS * sum(body.rounding for body in drawn_bodies(problem))
    if feature.kind not in ON_A_FACE or not digits:
        return feature
    sides = list[list[tuple[Element, Array, Array]]]()
    for body, element, rho, turn in zip(
        (problem.movable, problem.static), (feature.one, feature.two), problem.target, (transform[:3, :3], np.eye(3)),
        strict=True,
    ):  # fmt: skip
        drawn, normals = body.of_facets, body.of_facets.face_planes[0] @ turn.T
        corners = rho * drawn.vertices @ turn.T
        faces = [(row, drawn.faces[row]) for row in rows_of_element(body, element)]
        sides.append([(Element("F", own), normals[row], corners[np.array(own) - 1]) for row, own in faces])
    for (one, normal, corners), (two, other, others) in product(*sides):
        off = min(np.ptp(corners @ other), np.ptp(others @ normal))
        if normal @ other < -np.cos(DEFAULT.sharp) and off <= digits:
            return Feature(one, two)
    return feature


def _along_round_face(problem: Problem, feature: Feature, transform: Array, role: int) -> Feature:
    """Return a contact of a face of body `role` in place of that of its edge, where it lies along a convex round face.

    There the round face's normal is against that of the face, which its axis or generator is in.
    """
    bodies = [own.full_body or own for own in (problem.movable, problem.static)]
    own, other = (feature.one, feature.two)[:: 1 - 2 * role]
    text, rows = element_text(bodies[1 - role], other), rows_of_element(bodies[1 - role], other)
    if own.kind == "F" or not is_round(text) or not text.startswith(CONVEX):
        return feature
    labels = {tuple(sorted(bodies[1 - role].of_facets.faces[row])) for row in rows}
    surface = next((each.surface for each in round_faces(bodies[1 - role]) if labels & set(each.faces)), None)
    if surface is None:  # of a body that is exact at points, whose round faces go by other names
        return feature
    turn, shift = transform[:3, :3], transform[:3, 3]
    if role:  # all in the frame of the round body
        turn, shift = turn.T, -turn.T @ shift
    seed, rho = bodies[role].seed, problem.target[role]
    ends = (seed + rho * (bodies[role].vertices[np.array(own.vertices) - 1] - seed)) @ turn.T + shift
    seed, rho = bodies[1 - role].seed, problem.target[1 - role]
    ends = seed + (ends - seed) / rho - surface.origin
    away = ends - (ends @ surface.axis)[:, None] * surface.axis
    along = away[-1] - away[0]
    place = np.clip(-(away[0] @ along) / max(along @ along, DEFAULT.weld), 0.0, 1.0)
    _, normal = surface.misses((ends[0] + place * (ends[-1] - ends[0]) + surface.origin)[None])
    drawn = bodies[role].of_facets
    against = [row for row in rows_of_element(bodies[role], own)
               if drawn.face_planes[0][row] @ turn.T @ normal[0] < -np.cos(DEFAULT.sharp)]  # fmt: skip
    lying = Element("F", drawn.faces[against[0]]) if len(against) == 1 else own
    return Feature(*(lying, other)[:: 1 - 2 * role])
