"""The body's own vertices, edges and faces, and which of them each part's elements belong to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, overload

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints, frozen
from fcdm_opt.geometry.hull import Hull, unit_normals
from fcdm_opt.tolerances import DEFAULT

Faces = tuple[tuple[int, ...], ...]


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
    """

    vertices: Sequence[Element]
    edges: Sequence[Element]
    faces: Sequence[Element]

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


def own_elements(
    points: Array, hulls: list[Hull], given: list[list[int]] | None, name: str
) -> tuple[Faces, list[Elements]]:
    """Return the body's faces and, for each part, the body's element that each vertex, edge, face belongs to.

    Raises
    ------
    InputError
        Where a given face is no face of the body, or only a piece of one.
    """
    if given is None and len(hulls) == 1:  # every face of the part is the body's own
        (hull,) = hulls
        faces = _labels(hull.used, hull.loops)
        edges = np.sort(hull.used[hull.edges[:, :2]], axis=1) + 1
        return faces, [Elements(_Named("V", hull.used[:, None] + 1), _Named("E", edges), _Named("F", faces))]
    size = float(np.abs(points - points.mean(axis=0)).max())
    rows = [[tuple(hull.used[list(loop)].tolist()) for loop in hull.loops] for hull in hulls]
    planes = [[_plane(points, loop) for loop in loops] for loops in rows]
    if given is None:
        groups = _faces_from_parts(rows, planes, size)
        given = [sorted({v for part, face in group for v in rows[part][face]}) for group in groups]
        owner = {place: k for k, group in enumerate(groups) for place in group}
    else:
        _check_faces(points, rows, planes, given, size, name)
        owner = _owners(points, rows, planes, given, size)
    faces = tuple(_label(face) for face in given)
    around: dict[tuple[int, int], set[int]] = {}
    corners: dict[int, set[int]] = {}
    for (part, face), own in owner.items():
        loop = rows[part][face]
        for a, b in zip(loop, loop[1:] + loop[:1], strict=True):
            around.setdefault((min(a, b), max(a, b)), set()).add(own)
            corners.setdefault(a, set()).add(own)
    elements = []
    for part, hull in enumerate(hulls):
        named_faces = tuple(
            Element("F", faces[owner[part, f]] if (part, f) in owner else _label(loop))
            for f, loop in enumerate(rows[part])
        )
        named_edges = []
        for a, b in np.sort(hull.used[hull.edges[:, :2]], axis=1).tolist():
            beside = around.get((a, b), set())
            named_edges.append(Element("F", faces[min(beside)]) if len(beside) == 1 else Element("E", (a + 1, b + 1)))
        named_vertices = tuple(
            Element("F", faces[min(corners[v])]) if len(corners.get(v, ())) == 1 else Element("V", (v + 1,))
            for v in hull.used.tolist()
        )
        elements.append(Elements(named_vertices, tuple(named_edges), named_faces))
    return faces, elements


def _label(rows: Iterable[int]) -> tuple[int, ...]:
    return tuple(sorted(v + 1 for v in rows))


def _labels(used: Ints, loops: Faces) -> Faces:
    """Return the sorted labels of each loop."""
    if all(len(loop) == 3 for loop in loops):
        return tuple(map(tuple, (np.sort(used[np.array(loops)], axis=1) + 1).tolist()))
    names = (used + 1).tolist()
    return tuple(tuple(sorted([names[v] for v in loop])) for loop in loops)


def _plane(points: Array, loop: tuple[int, ...]) -> tuple[Array, float]:
    normal = unit_normals(points[list(loop)])
    return normal, float(normal @ points[loop[0]])


def _seams(rows: Any, planes: Any) -> set[tuple[int, int]]:
    """Return the part faces that two parts turn to each other: the same outline, opposite normals."""
    outlines: dict[frozenset[int], list[tuple[int, int]]] = {}
    for part, loops in enumerate(rows):
        for face, loop in enumerate(loops):
            outlines.setdefault(frozenset(loop), []).append((part, face))
    return {
        (part, face)
        for same in outlines.values()
        if len(same) > 1
        for part, face in same
        if any(planes[part][face][0] @ planes[p][f][0] < 0 for p, f in same)
    }


def _faces_from_parts(rows: Any, planes: Any, size: float) -> list[list[tuple[int, int]]]:
    """Group part faces in one plane that share vertices; drop seams."""
    seams = _seams(rows, planes)
    places = [(part, face) for part, loops in enumerate(rows) for face in range(len(loops))]
    groups: dict[tuple[int, int], list[tuple[int, int]]] = {}  # by the last face that joined
    touching: dict[int, set[tuple[int, int]]] = {}  # groups at each vertex
    for part, face in places:
        if (part, face) in seams:
            continue
        normal, level = planes[part][face]
        beside = set().union(*(touching.setdefault(v, set()) for v in rows[part][face]))
        joined = []
        for group in beside:
            p, f = groups[group][0]
            other, height = planes[p][f]
            if np.abs(normal - other).max() <= DEFAULT.nominal and abs(level - height) <= DEFAULT.nominal * size:
                joined.append(group)
        mine = [(part, face)]
        for group in [group for group in groups if group in joined] if len(joined) > 1 else joined:
            for p, f in groups[group]:
                for v in rows[p][f]:
                    touching[v].discard(group)
                    touching[v].add((part, face))
            mine = groups.pop(group) + mine
        for v in rows[part][face]:
            touching[v].add((part, face))
        groups[part, face] = mine
    return list(groups.values())


def _owners(points: Array, rows: Any, planes: Any, given: list[list[int]], size: float) -> dict[tuple[int, int], int]:
    """Map each part face to the given face in its plane with which it shares most vertices, or in which it lies."""
    owner = {}
    same = {frozenset(own): k for k, own in reversed(list(enumerate(given)))}
    for part, loops in enumerate(rows):
        for face, loop in enumerate(loops):
            if (exactly := same.get(frozenset(loop))) is not None:
                owner[part, face] = exactly
                continue
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


def _check_faces(points: Array, rows: Any, planes: Any, given: list[list[int]], size: float, name: str) -> None:
    """Refuse given faces that are no face of the body."""
    slack = DEFAULT.nominal * size
    seams = _seams(rows, planes)
    table = [
        (loop, *planes[part][face])
        for part, loops in enumerate(rows)
        for face, loop in enumerate(loops)
        if (part, face) not in seams
    ]
    known, earlier = {frozenset(loop) for loop, _, _ in table}, dict[frozenset[int], int]()
    normals, levels = np.array([normal for _, normal, _ in table]), np.array([level for _, _, level in table])
    for k, face in enumerate(given):
        key, found, corners = f"body '{name}': face {k + 1}", tuple(v + 1 for v in face), points[face]
        if (first := earlier.setdefault(frozenset(face), k)) != k:
            raise InputError(f"the corners are those of face {first + 1}", key=key, found=found)
        if frozenset(face) in known:
            continue
        if np.linalg.svd(corners - corners.mean(axis=0))[1][1] <= slack:
            raise InputError("the corners lie on one line", key=key, found=found)
        off = np.abs(corners @ normals.T - levels)
        here = np.flatnonzero(off.max(axis=0) <= slack)
        if not here.size:
            nearest = int(off.max(axis=0).argmin())
            worst = int(off[:, nearest].argmax())
            what = (
                "the corners lie in no plane of a face of the body: the nearest misses vertex "
                f"{face[worst] + 1} by {off[worst, nearest]:.3g}"
            )
            raise InputError(what, key=key, found=found, allowed=f"at most {slack:.3g}")
        loops = [table[c][0] for c in here]
        for v in set(face).difference(*loops):
            if not any(_covers(points[list(table[c][0])], points[v], normals[c], slack) for c in here):
                raise InputError(f"vertex {v + 1} lies in the plane of the face, but not on it", key=key, found=found)
        if len(rows) == 1:
            own = max(loops, key=lambda loop: len(set(loop) & set(face)))
            if missing := set(own) - set(face):
                what = f"only a piece of a face of the body, whose corner at vertex {min(missing) + 1} is missing"
                raise InputError(what, key=key, found=found, allowed=str(_label(own)))


def _covers(loop: Array, point: Array, normal: Array, slack: float) -> bool:
    """Tell whether a convex polygon, counter-clockwise about its normal, has a point of its plane on it."""
    along = np.roll(loop, -1, axis=0) - loop
    inward = np.cross(normal, along)
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    return bool(((point - loop) * inward).sum(axis=1).min() >= -slack)
