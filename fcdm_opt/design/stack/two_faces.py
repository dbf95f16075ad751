"""The gap of two plane faces that face each other, chosen by name, as sizes move them: a row along their normal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.touching_sizes import PairRows, TouchingSizes
from fcdm_opt.curve.true_sizes import ROLES
from fcdm_opt.design.contact_gaps import move_of, relations_of
from fcdm_opt.design.sizes import SCALES
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.polygons import area, inside
from fcdm_opt.geometry.size import Size
from fcdm_opt.problem import arguments
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.tolerances import DEFAULT

ALLOWED = "two plane faces that look at each other, as `fcdm-opt faces` lists them"


class TwoFaces(NamedTuple):
    """The rows of two plane faces, one of each body of a relation: of each all in its plane that the name means."""

    pair: tuple[str, str]
    rows: tuple[Ints, Ints]

    @classmethod
    def of(cls, scene: Scene, asked: Any) -> TwoFaces | None:
        """Return those that `of` names, as "part:face", or (part, face); of two bodies "face", too, movable first.

        None where two parts of an assembly are named; raises `InputError` for what is no face, or of one part.
        """
        relations, two = relations_of(scene), arguments.items(asked)
        parts = {name: name for pair in relations for name in pair}
        if isinstance(scene, Problem):
            parts = {scene.drawn[role].name: role for role in reversed(ROLES)} | dict(zip(ROLES, ROLES, strict=True))
        elif all(isinstance(own, str) and (own in parts or ":" not in own) for own in two):
            return None
        chosen = dict[str, Any]()
        for role, own in zip(ROLES, two, strict=False):
            part, face = own.split(":", 1) if isinstance(own, str) and ":" in own else (role, own)
            if len(items := arguments.items(own)) == 2:
                part, face = items
            chosen[parts.get(part, "")] = face
        named = {ROLES if own == SCALES else own: own for own in relations}
        pair = next((own for own in named if len(two) == 2 and {*own} == {*chosen}), None)
        if pair is None:
            known = " or ".join(map(" - ".join, named))
            what = "not two faces of two parts that move against each other"
            raise InputError(what, key="of", found=asked, allowed=f"part:face,part:face of {known}")
        bodies = relations[named[pair]].at_scales.values()
        first, second = (_rows(body, chosen[part]) for body, part in zip(bodies, pair, strict=True))
        return cls(named[pair], (first, second))

    def touching(self, relation: Problem, transform: Array, carried: Array, sizes: tuple[Size, ...]) -> TouchingSizes:
        """Return the row of their gap in all `sizes`, each of which moves body 1 besides, (k, 3), at its pose, (4, 4).

        Raises `InputError` where they do not face each other, and where a size turns them.
        """
        bodies, (R, t) = (*relation.at_scales.values(),), (transform[:3, :3], transform[:3, 3])
        normals, points, places, elements = list[Array](), list[Array](), list[tuple[int, int]](), list[Element]()
        for body, rows in zip(bodies, self.rows, strict=True):
            every, at = body.face_planes
            normals.append(every[rows[0]])
            points.append(at[rows[0]])
            facets = ((k, j, own) for k, owners in enumerate(body.facet_faces) for j, own in enumerate(owners))
            places.append(next((k, j) for k, j, own in facets if rows[0] in own))
            elements.append(Element("F", tuple(body.faces[rows[0]])))
        n, feature = R @ normals[0], Feature(*elements)
        if n @ normals[1] > DEFAULT.nominal - 1.0 or not self._overlap(bodies, transform, n):
            text = feature.in_words(*bodies)
            raise InputError("these faces do not face each other", key="of", found=text, allowed=ALLOWED)
        gap, mine = float(n @ (points[1] - R @ points[0] - t)), {size.name: size for size in relation.sizes}
        rates = -carried @ n
        for column, name in enumerate(size.name for size in sizes):
            if name not in mine:
                continue
            side = ROLES.index(mine[name].body)
            across = mine[name].directions() @ normals[side]
            part, facet = places[side]
            move = move_of(relation.request[ROLES[side]], part, mine[name], self._drawn(relation, side), facet)
            if move is None or np.linalg.norm(np.cross(across, normals[side])) > DEFAULT.nominal:
                what = f"size '{name}' turns one of these faces"
                raise InputError(what, key="of", found=mine[name].scale, allowed=ALLOWED)
            rates[column] -= relation.target[side] * float(normals[side] @ move)
        pair = PairRows((places[0][0], places[1][0]), np.array([[gap, *rates]]), n[None], [], [feature])
        return TouchingSizes((bodies[0], bodies[1]), sizes, transform, (pair,), (np.inf, ""), as_drawn=True)

    def _drawn(self, relation: Problem, side: int) -> Array:
        """Return a point of one of them as drawn."""
        return np.asarray(relation.request[ROLES[side]].face_planes[1][self.rows[side][0]])

    def _overlap(self, bodies: Iterable[Body], transform: Array, n: Array) -> bool:
        """Tell whether they have something in common, seen along the normal of the first one."""
        seen = []
        for body, rows, T in zip(bodies, self.rows, (transform, np.eye(4)), strict=True):
            triangles, owners = body.face_triangles
            own = triangles[np.isin(owners, rows)] @ T[:3, :3].T + T[:3, 3]
            seen.append(own - (own @ n)[..., None] * n)
        boxes = [(own.min(axis=1), own.max(axis=1)) for own in seen]
        near = ((boxes[0][0][:, None] <= boxes[1][1]) & (boxes[1][0] <= boxes[0][1][:, None])).all(axis=2)
        least = max(body.size for body in bodies) ** 2 * DEFAULT.nominal
        pairs = np.argwhere(near).tolist()  # of the second ones corners are clockwise about the normal
        return any(area(inside(seen[1][j][::-1], seen[0][i], n)) > least for i, j in pairs)


def _rows(body: Body, selector: Any) -> Ints:
    """Return the faces of a body that a selector of sizes means; refuse round ones."""
    if not isinstance(selector, str | Mapping):
        raise InputError("no face is named like this", key="of", found=selector, allowed=ALLOWED)
    try:
        rows = np.flatnonzero(Size("of", "movable", faces=selector).offsets(body))
    except InputError as reason:
        raise InputError(reason.what, key="of", found=selector, allowed=reason.allowed) from reason
    normals, points = (own[rows] for own in body.face_planes)
    off = np.abs((points - points[0]) @ normals[0]).max() > DEFAULT.snap * body.size
    if off or np.abs(normals - normals[0]).max() > DEFAULT.nominal:
        raise InputError(f"a round face of '{body.name}', or several planes", key="of", found=selector, allowed=ALLOWED)
    return rows
