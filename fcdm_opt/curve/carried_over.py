"""Contacts of parts as drawn, on the same parts as made: by their faces' planes, which sizes move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NoReturn

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import Contact, Joint
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.flush import Flush
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints, frozen
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.resizing import planes_made
from fcdm_opt.geometry.size import Size
from fcdm_opt.tolerances import DEFAULT


class CarriedOver:
    """Two bodies as drawn, and as made at some sizes.

    Parameters
    ----------
    drawn, made : (body 1, body 2)
    values : (sizes of body 1, of body 2)
        Deviations from drawn.

    Raises
    ------
    InputError
        Where what touches is gone on the body as made: then nothing tells what became of the contact.
    """

    def __init__(
        self, drawn: tuple[Body, Body], made: tuple[Body, Body], values: tuple[Mapping[Size, float], ...]
    ) -> None:
        self._made = made
        self._parts: list[list[_PartsAlike]] = []
        for before, body, sizes in zip(drawn, made, values, strict=True):
            if len(before.parts) != len(body.parts):
                _refuse(body.name)
            planes = planes_made(before, sizes)
            alike = zip(before.parts, body.parts, planes, strict=True)
            renamed = before.faces != body.faces
            self._parts.append([_PartsAlike(was, part, own, body, renamed) for was, part, own in alike])

    def joint(self, joint: Joint) -> Joint:
        """Return a contact of the bodies as made: the same elements, with the directions that they have now."""
        i, j = joint.parts
        one, two = self._parts[0][i], self._parts[1][j]
        pose = kernels.relative_pose(np.eye(4), self._made[0].seed, self._made[1].seed)
        sites, rows = kernels.facet_rows(*one.made.packed, *two.made.packed, pose)
        found, normals = [], []
        for site, normal in zip(joint.sites.tolist(), joint.normals, strict=True):
            same = one.rows(two, site, sites, rows)
            if not same:  # two edges that are parallel now, or part the other way; a corner behind another one
                _refuse(self._made[0].name)
            row = max(same, key=lambda k: rows[k, :3] @ normal)
            found.append(sites[row])
            normals.append(rows[row, :3])
        feature = _named(joint.feature, one, two, normals[0])
        return replace(joint, feature=feature, sites=np.array(found), normals=np.array(normals))

    def seat(self, seat: Flush) -> Flush:
        """Return a flush contact of the bodies as made."""
        i, j = seat.parts
        one, two = self._parts[0][i], self._parts[1][j]
        contact = self._contact(seat.contact, one, two, seat.normal)
        carriers = []
        for first, second, own in seat.carriers:
            a, b = (
                next(alike for alike in parts if alike.drawn is part)
                for parts, part in zip(self._parts, (first, second), strict=True)
            )
            carriers.append((a.made, b.made, self._contact(own, a, b, seat.normal)))
        if len(contact.two) > 2:
            normal = -two.made.normals[two.made.loops.index(contact.two)]
        else:
            normal = one.made.normals[one.made.loops.index(contact.one)]
        return replace(
            seat, feature=_named(seat.feature, one, two, normal), touching=_named(seat.touching, one, two, normal),
            contact=contact, normal=frozen(normal), carriers=tuple(carriers), _pair=(one.made, two.made),
        )  # fmt: skip

    def _contact(self, contact: Contact, one: _PartsAlike, two: _PartsAlike, n: Array) -> Contact:
        feature = _named(contact.feature, one, two, n)
        return replace(contact, feature=feature, one=one.element(contact.one, n), two=two.element(contact.two, -n))


def _named(feature: Feature, one: _PartsAlike, two: _PartsAlike, n: Array) -> Feature:
    """Return a feature with the labels that the bodies as made have."""
    return Feature(one.named(feature.one, n), two.named(feature.two, -n))


class _PartsAlike:
    """A part as drawn and as made, and where its vertices, edges and faces are then.

    `planes` are the normals of the part's facets as made, and how far out they are from the seed; `renamed` tells that
    the body's vertices are numbered anew.
    """

    def __init__(
        self, drawn: ConvexPart, made: ConvexPart, planes: tuple[Array, Array], body: Body, renamed: bool
    ) -> None:
        self.drawn, self.made, self._planes, self._body, self._renamed = drawn, made, planes, body, renamed

    @cached_property
    def faces(self) -> Ints:
        """The facet as made of each as drawn, -1 where it is gone."""
        if not self._renamed and self.drawn.loops == self.made.loops:  # those of round faces are not where planes go
            return np.arange(len(self.made.loops))
        normals, levels = self._planes
        made, size = self.made, self._body.size
        out = (made.normals * (made.bases - self._body.seed)).sum(axis=1)
        off = np.abs(normals[:, None] - made.normals).max(axis=2) + np.abs(levels[:, None] - out) / size
        nearest = off.argmin(axis=1)
        return np.where(off[np.arange(len(nearest)), nearest] <= DEFAULT.snap, nearest, -1)

    def element(self, vertices: Sequence[int], n: Array) -> tuple[int, ...]:
        """Return vertices of an element, those of a face in the order of its loop; of a corner's the farthest along n.

        A corner that splits becomes several.
        """
        if len(vertices) > 2:
            facet = next(k for k, loop in enumerate(self.drawn.loops) if set(loop) == set(vertices))
            return self.made.loops[self.face(facet)]
        if len(vertices) == 2:
            edge = next(k for k, own in enumerate(self.drawn.edges.tolist()) if set(own[:2]) == set(vertices))
            return tuple(self.made.edges[self.edge(edge), :2].tolist())
        return (self.corner(vertices[0], n),)

    def named(self, element: Element, n: Array) -> Element:
        """Return an element of the body as drawn with the labels that it has as made."""
        if not self._renamed:
            return element
        kind = element.kind
        row = next((k for k, own in enumerate(self.drawn.elements[kind]) if own == element), None)
        if row is None:
            _refuse(self._body.name)
        made = self.face(row) if kind == "F" else self.edge(row) if kind == "E" else self.corner(row, n)
        return self.made.elements[kind][made]

    def face(self, facet: int) -> int:
        found = int(self.faces[facet])
        if found < 0:
            _refuse(self._body.name)
        return found

    def edge(self, edge: int) -> int:
        """Return the edge as made of one as drawn: between the same faces."""
        wanted = set(self.faces[self.drawn.edges[edge, 2:]].tolist())
        found = [k for k, own in enumerate(self.made.edges[:, 2:].tolist()) if set(own) == wanted]
        if not found:
            _refuse(self._body.name)
        return found[0]

    def corner(self, vertex: int, n: Array) -> int:
        """Return that of the vertices as made of one as drawn which is the farthest along n."""
        found = self.corners(vertex)
        if not found:
            _refuse(self._body.name)
        return max(found, key=lambda k: float(self.made.vertices[k] @ n))

    def corners(self, vertex: int) -> list[int]:
        """Return the vertices as made of one as drawn: where three of its faces meet or more."""
        around = [k for k, loop in enumerate(self.drawn.loops) if vertex in loop]
        loops = [self.made.loops[face] for face in self.faces[around].tolist() if face >= 0]
        rows, counts = np.unique([k for loop in loops for k in loop], return_counts=True)
        return rows[counts >= 3].tolist()

    def rows(self, two: _PartsAlike, site: Sequence[int], sites: Ints, rows: Array) -> list[int]:
        """Return the rows of facets of the Minkowski difference, with part `two`, that a site as drawn has as made."""
        kind, first, second = site
        if kind == kernels.E1E2:
            wanted = [kind, self.edge(first), two.edge(second)]
            return np.flatnonzero((sites == wanted).all(axis=1)).tolist()
        mine, face, corner = (1, self.face(first), two) if kind == kernels.F1V2 else (2, two.face(second), self)
        vertex = (first, second)[2 - mine]
        own = np.flatnonzero((sites[:, 0] == kind) & (sites[:, mine] == face)).tolist()
        points, near = corner.made.vertices, DEFAULT.planarity * self._body.size
        tied = points[corner.corners(vertex)]
        return [k for k in own if (np.abs((tied - points[sites[k, 3 - mine]]) @ rows[k, :3]) <= near).any()]


def _refuse(name: str) -> NoReturn:
    what = "the body changes its shape at these sizes: what touches as drawn is not there any more"
    raise InputError(what, key=f"body '{name}'", allowed="smaller deviations, or a question without contacts")
