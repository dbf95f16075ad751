"""Contacts of parts as drawn, on the same parts as made: by the labels of vertices, which sizes keep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import NoReturn

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import Contact, Joint
from fcdm_opt.curve.flush import Flush
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Ints, frozen
from fcdm_opt.geometry.bodies import Body, ConvexPart


class CarriedOver:
    """Two bodies as drawn, and as made.

    Parameters
    ----------
    drawn, made : (body 1, body 2)

    Raises
    ------
    InputError
        Where a part has other vertices, edges or faces as made: then nothing tells what became of a contact.
    """

    def __init__(self, drawn: tuple[Body, Body], made: tuple[Body, Body]) -> None:
        self._made = made
        for before, body in zip(drawn, made, strict=True):
            if len(before.parts) != len(body.parts):
                _refuse(body.name)
        self._parts = [
            [_PartsAlike(was, part, body.name) for was, part in zip(before.parts, body.parts, strict=True)]
            for before, body in zip(drawn, made, strict=True)
        ]

    def joint(self, joint: Joint) -> Joint:
        """Return a contact of the bodies as made: the same elements, with the directions that they have now."""
        i, j = joint.parts
        one, two = self._parts[0][i], self._parts[1][j]
        pose = kernels.relative_pose(np.eye(4), self._made[0].seed, self._made[1].seed)
        sites, rows = kernels.facet_rows(*one.made.packed, *two.made.packed, pose)
        found, normals = [], []
        for site, normal in zip(joint.sites.tolist(), joint.normals, strict=True):
            wanted = _moved(site, one, two)
            same = np.flatnonzero((sites == wanted).all(axis=1))
            if not same.size:  # two edges that are parallel now, or part the other way
                _refuse(self._made[0].name)
            found.append(wanted)
            normals.append(rows[max(same.tolist(), key=lambda k: rows[k, :3] @ normal), :3])
        return replace(joint, sites=np.array(found), normals=np.array(normals))

    def seat(self, seat: Flush) -> Flush:
        """Return a flush contact of the bodies as made."""
        i, j = seat.parts
        one, two = self._parts[0][i], self._parts[1][j]
        contact = self._contact(seat.contact, one, two)
        hosts = []
        for first, second, own in seat.hosts:
            a, b = (
                next(alike for alike in parts if alike.drawn is part)
                for parts, part in zip(self._parts, (first, second), strict=True)
            )
            hosts.append((a.made, b.made, self._contact(own, a, b)))
        if len(contact.two) > 2:
            normal = -two.made.normals[two.made.loops.index(contact.two)]
        else:
            normal = one.made.normals[one.made.loops.index(contact.one)]
        pair = (one.made, two.made)
        return replace(seat, contact=contact, normal=frozen(normal), hosts=tuple(hosts), _pair=pair)

    def _contact(self, contact: Contact, one: _PartsAlike, two: _PartsAlike) -> Contact:
        return replace(contact, one=one.element(contact.one), two=two.element(contact.two))


class _PartsAlike:
    """A part as drawn and as made, and where its vertices, edges and faces are then."""

    def __init__(self, drawn: ConvexPart, made: ConvexPart, name: str) -> None:
        self.drawn, self.made, self._name = drawn, made, name

    @cached_property
    def vertices(self) -> Ints:
        """The vertex as made of each as drawn."""
        places = {own.vertices: k for k, own in enumerate(self.made.elements["V"])}
        names = [own.vertices for own in self.drawn.elements["V"]]
        if len(self.made.vertices) != len(names) or not places.keys() >= set(names):
            _refuse(self._name)
        return np.array([places[name] for name in names])

    def element(self, vertices: Sequence[int]) -> tuple[int, ...]:
        """Return vertices of an element, those of a face in the order of its loop."""
        moved = tuple(self.vertices[list(vertices)].tolist())
        return self.made.loops[self.face(vertices)] if len(moved) > 2 else moved

    def face(self, vertices: Sequence[int]) -> int:
        """Return the face of some vertices as drawn."""
        wanted = set(self.vertices[list(vertices)].tolist())
        found = [k for k, loop in enumerate(self.made.loops) if set(loop) == wanted]
        if not found:
            _refuse(self._name)
        return found[0]

    def edge(self, ends: Ints) -> int:
        """Return the edge between two vertices as drawn."""
        wanted = set(self.vertices[ends].tolist())
        found = [k for k, own in enumerate(self.made.edges[:, :2].tolist()) if set(own) == wanted]
        if not found:
            _refuse(self._name)
        return found[0]


def _moved(site: Sequence[int], one: _PartsAlike, two: _PartsAlike) -> list[int]:
    kind, first, second = site
    if kind == kernels.F1V2:
        return [kind, one.face(one.drawn.loops[first]), int(two.vertices[second])]
    if kind == kernels.V1F2:
        return [kind, int(one.vertices[first]), two.face(two.drawn.loops[second])]
    return [kind, one.edge(one.drawn.edges[first, :2]), two.edge(two.drawn.edges[second, :2])]


def _refuse(name: str) -> NoReturn:
    what = "the body changes its shape at these sizes: its contacts as drawn are no longer told by its vertices"
    raise InputError(what, key=f"body '{name}'", allowed="smaller deviations, or a question without contacts")
