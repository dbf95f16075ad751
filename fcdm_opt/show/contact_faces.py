"""Faces in place of those of their edges and corners that touch, where the whole face lies there."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.naming import is_round, rows_of_element, told_element
from fcdm_opt.problem.fit import drawn_bodies
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

DIGITS = 2.0
"""Times the rounding of both bodies' corners: planes through some of them, looked at where others are."""
CONVEX = ("cylinder", "cone")
ON_A_FACE = ("V1F2", "F1V2", "E1F2", "F1E2")


def with_whole_faces(problem: Problem, features: Sequence[Feature], transform: Array | None) -> list[Feature]:
    """Return contacts with those of faces in place of those of their edges and corners, each once.

    Of a face that lies on another one but for the digits of files, where the movable part's `transform` is told; and of
    one that touches a round face with two of its edges, and so between them.
    """
    found = [own if transform is None else _on_a_face(problem, own, transform) for own in features]
    for role in (0, 1):
        found = _along_round_faces((problem.movable, problem.static), found, role)
    return list(dict.fromkeys(found))


def _drawn(body: Body) -> Body:
    return body if body.exact is None else body.exact.facets


def _on_a_face(problem: Problem, feature: Feature, transform: Array) -> Feature:
    digits = DIGITS * sum(body.rounding for body in drawn_bodies(problem))
    if feature.kind not in ON_A_FACE or not digits:
        return feature
    sides = list[list[tuple[Element, Array, Array]]]()
    for body, element, rho, turn in zip(
        (problem.movable, problem.static), (feature.one, feature.two), problem.target, (transform[:3, :3], np.eye(3)),
        strict=True,
    ):  # fmt: skip
        drawn, normals = _drawn(body), _drawn(body).face_planes[0] @ turn.T
        faces = [(row, np.array(drawn.faces[row]) - 1) for row in rows_of_element(body, element)]
        sides.append(
            [(Element("F", drawn.faces[row]), normals[row], rho * drawn.vertices[own] @ turn.T) for row, own in faces]
        )
    for (one, normal, corners), (two, other, others) in product(*sides):
        off = min(np.ptp(corners @ other), np.ptp(others @ normal))
        if normal @ other < -np.cos(DEFAULT.sharp) and off <= digits:
            return Feature(one, two)
    return feature


def _along_round_faces(bodies: tuple[Body, Body], features: Sequence[Feature], role: int) -> list[Feature]:
    """Return the contacts with those of faces of body `role` where two of a face's edges touch a convex round face."""
    found = dict[object, list[tuple[Element, Element]]]()
    for feature in features:
        own, other = (feature.one, feature.two)[:: 1 - 2 * role]
        text = told_element(bodies[1 - role], other)
        edge = own.kind != "F" and not is_round(told_element(bodies[role], own))
        found.setdefault(text if edge and is_round(text) and text.startswith(CONVEX) else feature, []).append(
            (own, other)
        )
    kept = list[Feature]()
    for pairs in found.values():
        rows = set.intersection(*(set(rows_of_element(bodies[role], own)) for own, _ in pairs))
        if len(dict(pairs)) > 1 and len(rows) == 1:
            pairs = [(Element("F", _drawn(bodies[role]).faces[rows.pop()]), pairs[0][1])]
        kept += [Feature(*pair[:: 1 - 2 * role]) for pair in pairs]
    return kept
