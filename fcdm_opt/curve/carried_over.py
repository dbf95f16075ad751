"""Contacts of parts as drawn, on the same parts as made: by their faces' planes, which sizes move."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from itertools import product
from typing import NoReturn, TypeVar

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import Joint
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.flush import Flush
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints, frozen
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.naming import element_text
from fcdm_opt.geometry.resizing import planes_made
from fcdm_opt.geometry.size import Size
from fcdm_opt.tolerances import DEFAULT

T = TypeVar("T")


class CarriedOver:
    """Two bodies as drawn, and as made with deviations of their sizes, `values`, however these are cut into parts.

    Raises `InputError` where what touches is gone on the body as made, with its face: then nothing tells what became of
    the contact.
    """

    def __init__(
        self, drawn: tuple[Body, Body], made: tuple[Body, Body], values: tuple[Mapping[Size, float], ...]
    ) -> None:
        self._bodies, self._made = tuple(zip(drawn, made, strict=True)), made
        self._planes = tuple(map(planes_made, drawn, values))
        self._known = dict[tuple[int, int, int], _PartsAlike]()

    def joint(self, joint: Joint) -> Joint:
        """Return a contact of the bodies as made: the same elements, with the directions that they have now."""
        pose = kernels.relative_pose(np.eye(4), self._made[0].seed, self._made[1].seed)

        def of_parts(one: _PartsAlike, two: _PartsAlike) -> Joint:
            sites, rows = kernels.facet_rows(*one.made.packed, *two.made.packed, pose)
            each = zip(joint.sites.tolist(), joint.normals, strict=True)
            found = [one.row(two, site, normal, sites, rows) for site, normal in each]
            feature = _named(joint.feature, one, two, rows[found[0], :3])
            return replace(joint, feature=feature, sites=sites[found], normals=rows[found, :3])

        parts, made = self._on_parts(joint.parts, joint.feature, of_parts)
        return replace(made, parts=parts, carriers=(parts,)).carried_by(*self._made)

    def flush(self, flush: Flush) -> Flush:
        """Return a flush contact of the bodies as made."""

        def of_parts(one: _PartsAlike, two: _PartsAlike) -> Flush:
            own, n = flush.contact, flush.normal
            contact = replace(own, one=one.element(own.one, n), two=two.element(own.two, -n))
            if len(contact.two) > 2:
                n = -two.made.normals[two.made.loops.index(contact.two)]
            else:
                n = one.made.normals[one.made.loops.index(contact.one)]
            feature, touching = (_named(named, one, two, n) for named in (flush.feature, flush.touching))
            contact = replace(contact, feature=_named(own.feature, one, two, n))
            carrier = one.made, two.made, replace(flush.carriers[0][2], feature=touching)
            return replace(
                flush, feature=feature, touching=touching, contact=contact, normal=frozen(n), carriers=(carrier,),
                _pair=(one.made, two.made),
            )  # fmt: skip

        parts, made = self._on_parts(flush.parts, flush.feature, of_parts)
        return replace(made, parts=parts).carried_by(*self._made)

    def _on_parts(
        self, parts: tuple[int, int], feature: Feature, of_parts: Callable[[_PartsAlike, _PartsAlike], T]
    ) -> tuple[tuple[int, int], T]:
        """Return which parts as made have what two as drawn touch with, and what that is on them."""
        # the same two, or, where bodies are cut otherwise as made, others that have the elements
        refused = list[InputError]()
        for rows in self._candidates(parts, feature):
            one, two = (self._alike(k, *own) for k, own in enumerate(zip(parts, rows, strict=True)))
            try:
                return rows, of_parts(one, two)
            except InputError as reason:
                refused.append(reason)
        raise refused[0]

    def _candidates(self, parts: tuple[int, int], feature: Feature) -> Iterator[tuple[int, int]]:
        yield parts[0] % len(self._made[0].parts), parts[1] % len(self._made[1].parts)
        others = (
            [row for row in range(len(self._made[k].parts)) if self._alike(k, part, row).has(element)]
            for k, (part, element) in enumerate(zip(parts, (feature.one, feature.two), strict=True))
        )
        yield from product(*others)

    def _alike(self, k: int, part: int, row: int) -> _PartsAlike:
        """Return a part of body k as drawn and one as made."""
        if (k, part, row) not in self._known:
            (drawn, made), planes = self._bodies[k], self._planes[k][part]
            self._known[k, part, row] = _PartsAlike(drawn.parts[part], made.parts[row], planes, (drawn, made))
        return self._known[k, part, row]


def _named(feature: Feature, one: _PartsAlike, two: _PartsAlike, n: Array) -> Feature:
    """Return a feature with the labels that the bodies as made have."""
    return Feature(one.named(feature.one, n), two.named(feature.two, -n))


class _PartsAlike:
    """A part as drawn and one as made, and which vertices, edges and faces of the one are whose of the other.

    `planes` are the normals of the drawn part's facets as made, and how far out they are from the seed; `bodies` the
    parts' own, whose vertices may be numbered anew.
    """

    def __init__(
        self, drawn: ConvexPart, made: ConvexPart, planes: tuple[Array, Array], bodies: tuple[Body, Body]
    ) -> None:
        self.drawn, self.made, self._planes, self._bodies = drawn, made, planes, bodies
        self._renamed = bodies[0].faces != bodies[1].faces

    @cached_property
    def faces(self) -> Ints:
        """The facet as made of each as drawn, -1 where it is gone."""
        if not self._renamed and self.drawn.loops == self.made.loops:  # those of round faces are not where planes go
            return np.arange(len(self.made.loops))
        (normals, levels), made, body = self._planes, self.made, self._bodies[1]
        out = (made.normals * (made.bases - body.seed)).sum(axis=1)
        off = np.abs(normals[:, None] - made.normals).max(axis=2) + np.abs(levels[:, None] - out) / body.size
        nearest = off.argmin(axis=1)
        return np.where(off[np.arange(len(nearest)), nearest] <= DEFAULT.snap, nearest, -1)

    def has(self, element: Element) -> bool:
        """Tell whether the part as made has an element of the body as drawn."""
        with suppress(InputError):
            return bool(self.made.carriers(self.named(element, np.zeros(3))))
        return False

    def element(self, vertices: Sequence[int], n: Array) -> tuple[int, ...]:
        """Return vertices of an element, of a face in the order of its loop; of a corner's the farthest along n."""
        # a corner that splits becomes several
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
            self.refuse(element)
        made = self.face(row) if kind == "F" else self.edge(row) if kind == "E" else self.corner(row, n)
        return self.made.elements[kind][made]

    def face(self, facet: int) -> int:
        found = int(self.faces[facet])
        if found < 0:
            self.refuse(self.drawn.elements["F"][facet])
        return found

    def edge(self, edge: int) -> int:
        """Return the edge as made of one as drawn: between the same faces."""
        wanted = set(self.faces[self.drawn.edges[edge, 2:]].tolist())
        found = [k for k, own in enumerate(self.made.edges[:, 2:].tolist()) if set(own) == wanted]
        if not found:
            self.refuse(self.drawn.elements["E"][edge])
        return found[0]

    def corner(self, vertex: int, n: Array) -> int:
        """Return that of the vertices as made of one as drawn which is the farthest along n."""
        found = self.corners(vertex)
        if not found:
            self.refuse(self.drawn.elements["V"][vertex])
        return max(found, key=lambda k: float(self.made.vertices[k] @ n))

    def corners(self, vertex: int) -> list[int]:
        """Return the vertices as made of one as drawn: where three of its faces meet or more."""
        around = [k for k, loop in enumerate(self.drawn.loops) if vertex in loop]
        loops = [self.made.loops[face] for face in self.faces[around].tolist() if face >= 0]
        rows, counts = np.unique([k for loop in loops for k in loop], return_counts=True)
        return rows[counts >= 3].tolist()

    def foremost(self, vertex: int, n: Array) -> list[int]:
        """Return the vertices as made of all that is as far along n as a vertex is, both as drawn."""
        heights = self.drawn.vertices @ n
        level = set(np.flatnonzero(heights >= heights[vertex] - DEFAULT.snap * self._bodies[0].size).tolist())
        flat = self.faces[[k for k, loop in enumerate(self.drawn.loops) if level.issuperset(loop)]]
        return [
            *(row for own in level for row in self.corners(own)),
            *(row for face in flat.tolist() if face >= 0 for row in self.made.loops[face]),
        ]

    def row(self, two: _PartsAlike, site: Sequence[int], n: Array, sites: Ints, rows: Array) -> int:
        """Return the row that a site as drawn, along n, has of the Minkowski difference's facets with part `two`."""
        kind, first, second = site
        if kind == kernels.E1E2:
            gone = self, self.drawn.elements["E"][first]
            same = (sites == [kind, self.edge(first), two.edge(second)]).all(axis=1)
        else:
            mine, face, own, vertex, out = (
                (1, self.face(first), two, second, -n)
                if kind == kernels.F1V2
                else (2, two.face(second), self, first, n)
            )
            gone = own, own.drawn.elements["V"][vertex]
            same = (sites[:, 0] == kind) & (sites[:, mine] == face)
            points, near = own.made.vertices, DEFAULT.planarity * own._bodies[1].size
            tied = points[own.foremost(vertex, out)]
            behind = [np.abs((tied - points[sites[k, 3 - mine]]) @ rows[k, :3]) for k in np.flatnonzero(same)]
            same[same] = [(own <= near).any() for own in behind]
        if not same.any():  # two edges that are parallel now, or part the other way; a corner behind another one
            gone[0].refuse(gone[1])
        return max(np.flatnonzero(same).tolist(), key=lambda k: float(rows[k, :3] @ n))

    def refuse(self, element: Element) -> NoReturn:
        """Raise that an element of what touches as drawn is gone."""
        text = element_text(self._bodies[0], element)
        what = f"the body changes its shape at these sizes: what touches as drawn, {text}, is not there any more"
        allowed = "smaller deviations, or a question without contacts"
        raise InputError(what, key=f"body '{self._bodies[0].name}'", allowed=allowed)
