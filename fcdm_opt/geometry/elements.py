"""The body's own vertices, edges and faces, and which of them each part's elements belong to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array, Ints, frozen
from fcdm_opt.geometry.hull import Hull
from fcdm_opt.geometry.measures import unit_normals
from fcdm_opt.geometry.polygons import distances
from fcdm_opt.geometry.surface import Surface, label
from fcdm_opt.geometry.union import surface_of_parts
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.geometry.pyramids import Pyramids

Faces = tuple[tuple[int, ...], ...]
_PLACES = 9  # decimals of lengths, relative to the size, that are compared


class Element(NamedTuple):
    """A vertex, edge or face of a body: `kind` "V", "E" or "F" and the body's 1-based vertex labels."""

    kind: str
    vertices: tuple[int, ...]


class Elements(Mapping[str, Sequence[Element]]):
    """The body's own element that each vertex, edge and face of a part belongs to, by kind "V", "E" and "F": read-only.

    `spans`: (kind, index) of an edge or face of the part that lies on several of the body's own -> `Span`.
    """

    def __init__(
        self,
        vertices: Sequence[Element],
        edges: Sequence[Element],
        faces: Sequence[Element],
        spans: Mapping[tuple[str, int], Span] | None = None,
    ) -> None:
        self._kinds, self.spans = {"V": vertices, "E": edges, "F": faces}, spans or {}

    def __getitem__(self, kind: str) -> Sequence[Element]:
        return self._kinds[kind]

    def __iter__(self) -> Iterator[str]:
        return iter(self._kinds)

    def __len__(self) -> int:
        return len(self._kinds)

    def mapped(self, rows: Callable[[Array], Array]) -> Elements:
        """Return those of the part moved or scaled, as `rows` does points."""
        spans = {
            key: Span(frozen(rows(own.corners)), own.elements, tuple(frozen(rows(each)) for each in own.regions))
            for key, own in self.spans.items()
        }
        return Elements(self["V"], self["E"], self["F"], spans) if spans else self


class _Named(Sequence[Element]):
    """Elements of one kind, each made when it is asked for: a large part has hundreds of thousands."""

    def __init__(self, kind: str, labels: Ints | Faces) -> None:
        self._kind, self._labels = kind, labels.tolist() if isinstance(labels, np.ndarray) else labels

    def __getitem__(self, k: Any) -> Any:
        if isinstance(k, slice):
            return tuple(self)[k]
        return Element(self._kind, tuple(self._labels[k]))

    def __len__(self) -> int:
        return len(self._labels)


class Span(NamedTuple):
    """The body's own elements that one edge or face of a part lies on, which of them depends on the place."""

    corners: Array  # of the part's edge or face, in the order of its ends or loop, (n, 3)
    elements: tuple[Element, ...]
    # for each element, the segments (c = 2) or triangles (c = 3) that it is, each (k, c, 3)
    regions: tuple[Array, ...]

    def at(self, corners: Array, points: Array) -> list[Element]:
        """Return the element at each of some points of the part's edge or face.

        `corners` (n, 3): the corners where they are now: moved and scaled together. `points` (m, 3): in the same place.
        """
        shares = np.linalg.lstsq((corners[1:] - corners[0]).T, (points - corners[0]).T)[0].T
        drawn = self.corners[0] + shares @ (self.corners[1:] - self.corners[0])
        off = np.array([distances(drawn[None], region).min(axis=0) for region in self.regions])
        near = off <= off.min(axis=0) + DEFAULT.nominal * np.ptp(self.corners, axis=0).max()
        return [self.elements[k] for k in near.argmax(axis=0).tolist()]


def own_elements(
    points: Array,
    hulls: list[Hull],
    given: list[list[int]] | None,
    name: str,
    *,
    surface: Surface | None = None,
    apart: bool = False,
) -> tuple[Faces, list[Elements]]:
    """Return the body's faces and, for each part, the body's element that each vertex, edge, face belongs to.

    - `points` (n, 3).
    - `hulls`: the parts.
    - `given`, optional: the body's faces.
    - `name`: of the body.
    - `surface`, optional: the body's faces and edges, where they are known better than from the parts.
    - `apart`: every element of a part is the body's own: of approximate parts, which do not fit together.

    Raises `InputError` where a given face is no face of the body, or only a piece of one.
    """
    if given is None and surface is None and (apart or len(hulls) == 1):
        named = [_labels(hull.used, hull.loops) for hull in hulls]
        ends = [np.sort(hull.used[hull.edges[:, :2]], axis=1) + 1 for hull in hulls]
        return tuple(dict.fromkeys(face for own in named for face in own)), [
            Elements(_Named("V", hull.used[:, None] + 1), _Named("E", edges), _Named("F", faces))
            for hull, edges, faces in zip(hulls, ends, named, strict=True)
        ]
    if surface is None:
        surface = surface_of_parts(points, hulls, given, name)
    faces = tuple(label(face) for face in surface.faces)
    return faces, _located(surface, points, hulls, faces)


def pyramid_elements(made: Pyramids) -> tuple[Faces, list[Elements]]:
    """Return the same of pyramids under the faces of a surface: what is below the base is no body's own element."""
    surface, points = made.surface, made.points
    faces = tuple(label(face) for face in surface.faces)
    face_names = [Element("F", face) for face in faces]
    edge_names = [Element("E", (a + 1, b + 1)) for a, b in np.sort(surface.edges, axis=1).tolist()]
    straight = dict(zip(map(frozenset, surface.edges.tolist()), edge_names, strict=True))
    corners = set(surface.edges.ravel().tolist())
    owners = made.owners.tolist()
    faces_at: dict[frozenset[int], set[int]] = {}
    for hull, face in zip(made.hulls, owners, strict=True):
        for ends in hull.used[hull.edges[: len(hull.used) - 1, :2]].tolist():
            faces_at.setdefault(frozenset(ends), set()).add(face)
    bent = [ends for ends, own in faces_at.items() if len(own) > 1 and ends not in straight]
    if bent:  # pieces of edges that go on straight
        rows = np.array([sorted(ends) for ends in bent])
        longer = np.flatnonzero(~np.isin(np.array([ends in faces_at for ends in straight]), True))
        for ends, middle in zip(bent, points[rows].mean(axis=1), strict=True):
            (place,) = np.flatnonzero(surface.along_edges(middle[None], longer)[1][0])[:1].tolist() or (None,)
            if place is not None:
                straight[ends] = edge_names[int(longer[place])]
    on_edge = {v: name for ends, name in straight.items() for v in ends if v not in corners}
    elements = []
    for hull, face in zip(made.hulls, owners, strict=True):
        *base, apex = hull.used.tolist()
        own = face_names[face]
        vertices = [Element("V", (v + 1,)) if v in corners else on_edge.get(v, own) for v in base]
        ends = hull.used[hull.edges[:, :2]].tolist()
        edges = [straight.get(frozenset(pair), own) for pair in ends[: len(base)]]
        edges += [Element("E", label(pair)) for pair in ends[len(base) :]]
        sides = [Element("F", label((a, b, apex))) for a, b in ends[: len(base)]]
        elements.append(Elements((*vertices, Element("V", (apex + 1,))), tuple(edges), (own, *sides)))
    return faces, elements


def _located(surface: Surface, points: Array, hulls: list[Hull], faces: Faces) -> list[Elements]:
    """Name each part's elements after those of the surface that they lie on."""
    rows = np.unique(np.concatenate([hull.used for hull in hulls]))
    place = {row: k for k, row in enumerate(rows.tolist())}
    flat, (collinear, within) = surface.flat(points[rows]), surface.along_edges(points[rows])
    corners = {tuple(surface.points[row].tolist()): row for row in np.unique(surface.edges)[::-1].tolist()}
    hidden = {frozenset(map(tuple, ends)) for ends in surface.points[surface.hidden].tolist()}
    edge_names = [Element("E", (a + 1, b + 1)) for a, b in np.sort(surface.edges, axis=1).tolist()]
    face_names, whole = [Element("F", face) for face in faces], set(faces)

    def chosen(own: Element, shares: dict[Element, float], least: float, polygon: Array) -> tuple[Element, Span | None]:
        """Return the name with the largest share, edges first, and all above the least where they are several."""
        names = [name for name, amount in shares.items() if amount > least]
        names.sort(key=lambda name: (name.kind, -round(shares[name], _PLACES), name))
        if len(names) < 2:
            return (names or [own])[0], None
        where = [(edge_names if name.kind == "E" else face_names).index(name) for name in names]
        regions = (
            surface.points[surface.edges[[k]]] if name.kind == "E" else surface.polygons(k)
            for name, k in zip(names, where, strict=True)
        )
        return names[0], Span(frozen(polygon), tuple(names), tuple(frozen(region) for region in regions))

    def vertex(row: int) -> Element:
        k = place[row]
        if (corner := corners.get(tuple(points[row].tolist()))) is not None:
            return Element("V", (corner + 1,))
        if within[k].any():
            return min(edge_names[j] for j in np.flatnonzero(within[k]))
        near = surface.near(np.flatnonzero(flat[k]), points[[row]])
        on = (face for face in near.tolist() if surface.lies_on(face, points[[row]])[0])
        return min((face_names[face] for face in on), default=Element("V", (row + 1,)))

    @cache  # the parts beside a cut have its edges in common
    def stretch(a: int, b: int) -> tuple[Element, Span | None]:
        i, j, own, ends = place[a], place[b], Element("E", label((a, b))), points[[a, b]]
        if (over := within[i] & within[j]).any():
            return min(edge_names[k] for k in np.flatnonzero(over)), None
        if frozenset(map(tuple, ends.tolist())) in hidden:
            return own, None
        candidates, along = np.flatnonzero(flat[i] & flat[j]), np.flatnonzero(collinear[i] & collinear[j])
        near = surface.near(candidates, ends)
        if not len(near) and not len(along):
            return own, None
        lengths, middles = surface.stretches(ends, candidates, along)
        on = surface.along_edges(middles, along)[1]
        free = ~on.any(axis=1)  # the faces beside a true edge are not what the part's edge lies on
        shares = {edge_names[k]: float(lengths[each].sum()) for k, each in zip(along.tolist(), on.T, strict=True)}
        for face in near.tolist():
            shares[face_names[face]] = float(lengths[free][surface.lies_on(face, middles[free])].sum())
        return chosen(own, shares, DEFAULT.nominal, ends)

    def edge(a: int, b: int) -> tuple[Element, Span | None]:
        name, span = stretch(min(a, b), max(a, b))
        return name, span._replace(corners=frozen(points[[a, b]])) if span and a > b else span

    def face(loop: list[int]) -> tuple[Element, Span | None]:
        polygon, own = points[loop], Element("F", label(loop))
        if own.vertices in whole:
            return own, None
        on = np.flatnonzero(flat[[place[row] for row in loop]].all(axis=0))
        near = surface.near(on[surface.planes[0][on] @ unit_normals(polygon) > 0], polygon) if len(on) else on
        shares = {face_names[k]: surface.area_within(k, polygon) for k in near.tolist()}
        least = DEFAULT.nominal * np.ptp(polygon, axis=0).max() / surface.size
        return chosen(own, shares, least, polygon)

    named_vertices = {row: vertex(row) for row in rows.tolist()}
    elements = []
    for hull in hulls:
        pacing.check()
        sides = [edge(a, b) for a, b in hull.used[hull.edges[:, :2]].tolist()]
        loops = [face(hull.used[list(loop)].tolist()) for loop in hull.loops]
        spans = {
            (kind, k): span for kind, own in (("E", sides), ("F", loops)) for k, (_, span) in enumerate(own) if span
        }
        named = tuple(named_vertices[row] for row in hull.used.tolist())
        elements.append(Elements(named, tuple(name for name, _ in sides), tuple(name for name, _ in loops), spans))
    return elements


def _labels(used: Ints, loops: Faces) -> Faces:
    if all(len(loop) == 3 for loop in loops):
        return tuple(map(tuple, (np.sort(used[np.array(loops)], axis=1) + 1).tolist()))
    names = (used + 1).tolist()
    return tuple(tuple(sorted([names[v] for v in loop])) for loop in loops)
