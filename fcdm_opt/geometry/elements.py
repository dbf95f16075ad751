"""The body's own vertices, edges and faces, and which of them each part's elements belong to."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, overload

import numpy as np

from fcdm_opt.geometry.arrays import Array, Ints, frozen
from fcdm_opt.geometry.hull import Hull, unit_normals
from fcdm_opt.geometry.surface import Surface, label
from fcdm_opt.geometry.union import surface_of_parts
from fcdm_opt.tolerances import DEFAULT

Faces = tuple[tuple[int, ...], ...]
_PLACES = 9  # decimals of lengths, relative to the size, that are compared


class Element(NamedTuple):
    """A vertex, edge or face of a body: `kind` "V", "E" or "F" and the body's 1-based vertex labels."""

    kind: str
    vertices: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Elements(Mapping[str, Sequence[Element]]):
    """The body's own element that each vertex, edge and face of a part belongs to, by kind: read-only.

    Attributes
    ----------
    vertices, edges, faces : sequences of Element
        What the keys "V", "E" and "F" give.
    spans : mapping
        (kind, index) of an edge or face of the part that lies on several of the body's own -> `Span`.
    """

    vertices: Sequence[Element]
    edges: Sequence[Element]
    faces: Sequence[Element]
    spans: Mapping[tuple[str, int], Span] = field(default_factory=dict)

    def __getitem__(self, kind: str) -> Sequence[Element]:
        """Return the elements of one kind."""
        return {"V": self.vertices, "E": self.edges, "F": self.faces}[kind]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the kinds."""
        return iter("VEF")

    def __len__(self) -> int:
        """Return the number of kinds."""
        return 3


class _Named(Sequence[Element]):
    """Elements of one kind, each made when it is asked for: a large part has hundreds of thousands."""

    __slots__ = ("_kind", "_labels")

    def __init__(self, kind: str, labels: Ints | Faces) -> None:
        self._kind = kind
        self._labels = frozen(labels, np.int64) if isinstance(labels, np.ndarray) else labels

    @overload
    def __getitem__(self, k: int) -> Element: ...
    @overload
    def __getitem__(self, k: slice) -> tuple[Element, ...]: ...
    def __getitem__(self, k: Any) -> Any:
        if isinstance(k, slice):
            return tuple(self)[k]
        return Element(self._kind, tuple(int(label) for label in self._labels[k]))

    def __iter__(self) -> Iterator[Element]:
        rows = self._labels.tolist() if isinstance(self._labels, np.ndarray) else self._labels
        return (Element(self._kind, tuple(row)) for row in rows)

    def __len__(self) -> int:
        return len(self._labels)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, _Named | tuple):
            return NotImplemented
        return tuple(self) == tuple(other)

    def __reduce__(self) -> tuple[Any, ...]:
        return _Named, (self._kind, self._labels)

    def __repr__(self) -> str:
        return f"<{len(self)} elements {self._kind}>"


class Span(NamedTuple):
    """The body's own elements that one edge or face of a part lies on, which of them depends on the place.

    Attributes
    ----------
    corners : (n, 3) array
        Of the part's edge or face, in the order of its ends or loop, as drawn.
    elements : tuple of Element
    regions : tuple of (k, c, 3) arrays
        For each element, the segments (c = 2) or triangles (c = 3) that it is, as drawn.
    """

    corners: Array
    elements: tuple[Element, ...]
    regions: tuple[Array, ...]

    def at(self, corners: Array, point: Array) -> Element:
        """Return the element at a point of the part's edge or face.

        Parameters
        ----------
        corners : (n, 3) array
            The corners where they are now: moved and scaled together.
        point : (3,) array
            In the same place.
        """
        shares = np.linalg.lstsq((corners[1:] - corners[0]).T, point - corners[0])[0]
        drawn = self.corners[0] + shares @ (self.corners[1:] - self.corners[0])
        off = np.array([_distance(drawn, region) for region in self.regions])
        return self.elements[int((off <= off.min() + DEFAULT.nominal * np.ptp(self.corners, axis=0).max()).argmax())]


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

    Parameters
    ----------
    points : (n, 3) array
    hulls : list of Hull
        The parts.
    given : lists of rows, optional
        The body's faces.
    name : str
        Of the body.
    surface : Surface, optional
        The body's faces and edges, where they are known better than from the parts.
    apart : bool
        Every element of a part is the body's own: of approximate parts, which do not fit together.

    Raises
    ------
    InputError
        Where a given face is no face of the body, or only a piece of one.
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


# ----------------------------------------------------------------------------------------- what lies on the true faces


def _located(surface: Surface, points: Array, hulls: list[Hull], faces: Faces) -> list[Elements]:
    """Name each part's elements after those of the surface that they lie on."""
    slack = DEFAULT.nominal
    rows = np.unique(np.concatenate([hull.used for hull in hulls]))
    flat = np.abs(surface.heights(points[rows])) <= slack
    off, share = surface.along_edges(points[rows])
    lengths = np.linalg.norm(np.diff(surface.points[surface.edges], axis=1)[:, 0], axis=1) / surface.size
    collinear = off <= slack
    within = collinear & (share >= -slack / lengths) & (share <= 1 + slack / lengths)
    corners, hidden = set(surface.edges.ravel().tolist()), set(map(tuple, surface.hidden.tolist()))
    edge_names = [Element("E", (a + 1, b + 1)) for a, b in np.sort(surface.edges, axis=1).tolist()]
    face_names = [Element("F", face) for face in faces]
    place = {row: k for k, row in enumerate(rows.tolist())}

    def ordered(shares: dict[int, float], least: float) -> list[int]:
        """Return the faces with more than the least share, the largest first."""
        known = [face for face, own in shares.items() if own > least]
        return sorted(known, key=lambda face: (-round(shares[face], _PLACES), faces[face]))

    def vertex(row: int) -> Element:
        k = place[row]
        if row in corners:
            return Element("V", (row + 1,))
        if within[k].any():
            return min(edge_names[j] for j in np.flatnonzero(within[k]))
        on = (face for face in np.flatnonzero(flat[k]).tolist() if surface.lies_on(face, points[[row]])[0])
        return min((face_names[face] for face in on), default=Element("V", (row + 1,)))

    def edge(a: int, b: int) -> tuple[Element, Span | None]:
        i, j = place[a], place[b]
        if (whole := within[i] & within[j]).any():
            return min(edge_names[k] for k in np.flatnonzero(whole)), None
        own = Element("E", (min(a, b) + 1, max(a, b) + 1))
        if (min(a, b), max(a, b)) in hidden:
            return own, None
        ends = points[[a, b]]
        low, high = np.minimum(share[i], share[j]), np.maximum(share[i], share[j])
        common = (np.minimum(high, 1.0) - np.maximum(low, 0.0)) * lengths
        along = np.flatnonzero(collinear[i] & collinear[j] & (common > slack))
        along = np.array(sorted(along.tolist(), key=lambda k: (-round(common[k], _PLACES), edge_names[k])), np.int64)
        on: dict[int, float] = {}
        if (candidates := np.flatnonzero(flat[i] & flat[j])).size:
            shares, middles = surface.stretches(ends, candidates, along)
            if along.size:  # the faces beside a true edge are not what the part's edge lies on
                places = surface.along_edges(middles)[1][:, along]
                free = ((places < 0) | (places > 1)).all(axis=1)
                shares, middles = shares[free], middles[free]
            on = {face: float(shares[surface.lies_on(face, middles)].sum()) for face in candidates.tolist()}
        order = ordered(on, slack)
        names = [edge_names[k] for k in along] + [face_names[face] for face in order]
        regions = [surface.points[surface.edges[[k]]] for k in along] + [surface.polygons(face) for face in order]
        return _first(own, names, regions, ends)

    def face(loop: list[int]) -> tuple[Element, Span | None]:
        outline = points[loop]
        on = flat[[place[row] for row in loop]].all(axis=0) & (surface.planes[0] @ unit_normals(outline) > 0)
        reach = np.ptp(outline, axis=0).max() / surface.size
        order = ordered({own: surface.area_within(own, outline) for own in np.flatnonzero(on).tolist()}, slack * reach)
        names = [face_names[own] for own in order]
        return _first(Element("F", label(loop)), names, [surface.polygons(own) for own in order], outline)

    named_vertices = {row: vertex(row) for row in rows.tolist()}
    elements = []
    for hull in hulls:
        spans: dict[tuple[str, int], Span] = {}
        sides, ends = [], hull.used[hull.edges[:, :2]].tolist()
        for k, (a, b) in enumerate(ends):
            element, span = edge(a, b)
            sides.append(element)
            if span:
                spans["E", k] = span
        loops = []
        for k, loop in enumerate(hull.loops):
            element, span = face(hull.used[list(loop)].tolist())
            loops.append(element)
            if span:
                spans["F", k] = span
        named = tuple(named_vertices[row] for row in hull.used.tolist())
        elements.append(Elements(named, tuple(sides), tuple(loops), spans))
    return elements


def _first(own: Element, names: list[Element], regions: list[Array], corners: Array) -> tuple[Element, Span | None]:
    """Return the first of the names, and all of them where there are several; `own` where there is none."""
    if len(names) < 2:
        return (names or [own])[0], None
    return names[0], Span(frozen(corners), tuple(names), tuple(frozen(region) for region in regions))


def _distance(point: Array, region: Array) -> float:
    """Return how far a point is from segments or triangles in whose line or plane it lies, at most."""
    following = np.roll(region, -1, axis=1)
    along = following - region
    share = np.clip(((point - region) * along).sum(axis=2) / (along**2).sum(axis=2), 0, 1)
    rim = np.linalg.norm(region + share[:, :, None] * along - point, axis=2).min()
    if region.shape[1] == 3:
        normal = np.cross(along[:, 0], along[:, 1])
        inward = np.cross(normal[:, None], along)
        if (((point - region) * inward).sum(axis=2) >= 0).all(axis=1).any():
            return 0.0
    return float(rim)


def _labels(used: Ints, loops: Faces) -> Faces:
    """Return the sorted labels of each loop."""
    if all(len(loop) == 3 for loop in loops):
        return tuple(map(tuple, (np.sort(used[np.array(loops)], axis=1) + 1).tolist()))
    names = (used + 1).tolist()
    return tuple(tuple(sorted([names[v] for v in loop])) for loop in loops)
