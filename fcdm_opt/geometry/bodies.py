"""Bodies: unions of convex parts that share one seed and are scaled about it.

A part is the convex hull of its float vertices; a *face* is a maximal group of hull facets coplanar within
`Tolerances.planarity`. Labels are 1-based and follow the order of the input, as in the FCDM paper.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, wraps
from itertools import combinations
from math import isfinite
from pathlib import Path
from typing import Any, Concatenate, Literal, NamedTuple, ParamSpec, TypeVar, cast
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fcdm_opt import pacing
from fcdm_opt.errors import InputError, known_arguments, known_word
from fcdm_opt.geometry.arrays import (
    LARGEST,
    SMALLEST,
    Array,
    Ints,
    checked_corners,
    distinct_rows,
    frozen,
    numbers,
    row_lists,
)
from fcdm_opt.geometry.closing import union_of_shells
from fcdm_opt.geometry.decomposition import Method, by_features, decompose
from fcdm_opt.geometry.elements import Element, Elements, own_elements, pyramid_elements
from fcdm_opt.geometry.hull import convex_hull
from fcdm_opt.geometry.measures import largest_ball, volume_and_centroid
from fcdm_opt.geometry.mesh import SEVERAL, Mesh, checked_mesh
from fcdm_opt.geometry.packing import packed, packed_in_one
from fcdm_opt.geometry.polygons import clipped, fans, normals_of, uncovered
from fcdm_opt.geometry.pyramids import Pyramids
from fcdm_opt.geometry.surface import Surface
from fcdm_opt.geometry.tessellation import RoundFaces, errors_of_faces, true_centroid
from fcdm_opt.geometry.units import NANOMETRES, Unit, UnitOrNone, measured
from fcdm_opt.lazy_import import NotebookRepr, imported
from fcdm_opt.moved_files import write
from fcdm_opt.tolerances import DEFAULT

SeedRule = Literal["centroid", "vertices", "box"]
Seed = SeedRule | Sequence[float] | NDArray[Any]
Known = TypeVar("Known")
Asked = ParamSpec("Asked")
SINGLE = 8 * 2.0**-23  # how far the numbers of a rotation may be off it in single precision: eight roundings
SEED_RULES: tuple[str, ...] = ("centroid", "vertices", "box")
KNOWN_SOLIDS = "a Body, a trimesh.Trimesh, (vertices, faces), a coal.Convex, a coal BVH model"
NOT_RIGID = "the transform is not a rigid motion"
RIGID = f"a rotation matrix and a shift, last row 0 0 0 1, to {DEFAULT.rigid:g}, or with six digits"
MOST_PRODUCTS = 1_000_000  # of normals and corners worked out at a time


class _Sealed:
    """Arrays stay read-only through pickle and copy, which make them writable."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        for value in state.values():
            for array in value if isinstance(value, tuple) else (value,):
                if isinstance(array, np.ndarray):
                    array.flags.writeable = False
        self.__dict__.update(state)


def cached_per_body(work: Callable[Concatenate[Body, Asked], Known]) -> Callable[Concatenate[Body, Asked], Known]:
    """Let what a function finds of a body be kept as long as the body is there."""
    known: WeakKeyDictionary[Body, dict[Any, Known]] = WeakKeyDictionary()

    @wraps(work)
    def found(body: Body, *asked: Asked.args, **options: Asked.kwargs) -> Known:
        own, key = known.setdefault(body, {}), (asked, *options.items())
        if key not in own:
            own[key] = work(body, *asked, **options)
        return own[key]

    return found


def cached_of_whole(work: Callable[Concatenate[Body, Asked], Known]) -> Callable[Concatenate[Body, Asked], Known]:
    """Let it be kept, of the body with all parts where some of them are given."""
    kept = cached_per_body(work)

    @wraps(work)
    def found(body: Body, *asked: Asked.args, **options: Asked.kwargs) -> Known:
        return kept(body.full_body or body, *asked, **options)

    return found


@dataclass(frozen=True, eq=False)
class ConvexPart(_Sealed):
    """One convex part of a body: the hull of `vertices`, with its faces, edges and half-edges."""

    vertices: Array  # extreme points, in the body's frame (as drawn), in the order of the input, (n, 3)
    seed: Array  # seed of the body, (3,)
    loops: tuple[tuple[int, ...], ...]  # vertex indices of each face, counter-clockwise seen from outside
    edges: Ints  # `origin, end, left face, right face`: the left face's loop runs from origin to end, (m, 4)
    # "V", "E", "F" -> the body's own element that each vertex, edge, face belongs to, read-only. An edge or vertex that
    # a cut between parts makes on a true face carries that face
    elements: Elements = field(repr=False)

    @cached_property
    def normals(self) -> Array:
        """Outward unit normals of the faces, (f, 3)."""
        return frozen(normals_of(self.vertices, self.loops))

    @cached_property
    def bases(self) -> Array:
        """The first corner of each face, (f, 3)."""
        return self.vertices[[loop[0] for loop in self.loops]]

    @cached_property
    def levels(self) -> Array:
        """The height of each face along its normal, (f,)."""
        return np.asarray((self.normals * self.bases).sum(axis=1))

    @cached_property
    def half_edges(self) -> Ints:
        """Half-edges, (2m, 4): `origin, face, twin, next`; half-edge 2k runs along edge k, 2k + 1 against it."""
        count = 2 * len(self.edges)
        table = np.empty((count, 4), dtype=np.int64)
        table[0::2, :2], table[1::2, :2] = self.edges[:, [0, 2]], self.edges[:, [1, 3]]
        table[:, 2] = np.arange(count) ^ 1
        # the next side of a face leaves the vertex that this one reaches
        leaves = table[:, 1] * len(self.vertices) + table[:, 0]
        reaches = table[:, 1] * len(self.vertices) + table[table[:, 2], 0]
        order = np.argsort(leaves)
        table[:, 3] = order[np.searchsorted(leaves[order], reaches)]
        return frozen(table, np.int64)

    @cached_property
    def circumradius(self) -> float:
        """Largest distance of a vertex from the seed."""
        return float(np.linalg.norm(self.vertices - self.seed, axis=1).max())

    @cached_property
    def packed(self) -> tuple[Array, Ints]:
        """Arrays that the kernels take, see `packing`."""
        return packed(self)

    @cached_property
    def volume_and_centroid(self) -> tuple[float, Array]:
        """Volume and centroid, by signed tetrahedra."""
        triangles = fans(self.loops)
        volume, middle, rounding = volume_and_centroid(self.vertices[triangles])
        if rounding > DEFAULT.nominal * volume:  # thin: with its principal axes made equally long it is not
            centre = self.vertices.mean(axis=0)
            _, stretch, axes = np.linalg.svd(self.vertices - centre, full_matrices=False)
            even = (self.vertices - centre) @ (axes.T / stretch)
            volume, middle, _ = volume_and_centroid(even[triangles])
            volume, middle = abs(volume) * float(stretch.prod()), centre + middle @ (stretch[:, None] * axes)
        return volume, middle

    def element_at(self, kind: str, k: int, point: Array) -> Element:
        """Return the body's own element that edge ("E") or face ("F") k of the part belongs to at a point of it."""
        # it depends on the point where the part's edge or face lies on several of the body's: a bar of a cross has one
        # side, of which the other bar leaves two faces
        return self.elements_at(kind, k, point[None])[0]

    def elements_at(self, kind: str, k: int, points: Array) -> list[Element]:
        """Return that at each of some points, (m, 3)."""
        span = self.elements.spans.get((kind, k))
        if span is None:
            return [self.elements[kind][k]] * len(points)
        return span.at(self.vertices[list(self.vertices_of(kind, k))], points)

    def vertices_of(self, kind: str, k: int) -> tuple[int, ...]:
        """Return the own vertices of vertex, edge or face k of the part: a face's in order around it."""
        if kind == "V":
            return (k,)
        return self.loops[k] if kind == "F" else tuple(self.edges[k, :2].tolist())

    def carriers(self, element: Element) -> list[tuple[int, ...]]:
        """Return the own vertices of each vertex, edge or face of the part that lies on an element of the body."""
        kind, found = element.kind, sorted(self._carried.get((element.kind, frozenset(element.vertices)), ()))
        return [self.vertices_of(kind, k) for k in found]

    @cached_property
    def _carried(self) -> dict[tuple[str, frozenset[int]], set[int]]:
        """The own vertices, edges or faces that lie on each element of the body of the same kind."""
        found: dict[tuple[str, frozenset[int]], set[int]] = {}
        own = [(kind, k, each) for kind in self.elements for k, each in enumerate(self.elements[kind])]
        own += [(kind, k, each) for (kind, k), span in self.elements.spans.items() for each in span.elements]
        for kind, k, each in own:
            if each.kind == kind:
                found.setdefault((kind, frozenset(each.vertices)), set()).add(k)
        return found

    def placed(self, vertices: Array, seed: Array) -> ConvexPart:
        """Return the part with other coordinates but the same combinatorics."""
        return replace(self, vertices=frozen(vertices), seed=frozen(seed))


class PointPiece(NamedTuple):
    """A small convex piece of the true solid at a point of its round faces: there the body is exact."""

    first: int  # labels of its vertices: of the point, and of the one that is inside
    last: int
    rows: tuple[int, ...]  # the faces of the body of facets that meet at the point, a round one first
    normals: Array  # outward normals of the true faces there, (k, 3)


class ExactPoints(NamedTuple):
    """How a body was made that is exact at points of round faces and elsewhere within the true one."""

    facets: Body  # the body of facets that it stands for
    pieces: tuple[PointPiece, ...]  # of the last parts of the body, one each


@known_arguments
@dataclass(frozen=True, eq=False)
class Body(_Sealed, NotebookRepr):
    """A solid made of convex parts, scaled as a whole about one seed: X -> s + rho (X - s).

    Build one with `Body.convex` or `Body.from_parts`; bodies never change.

    Attributes
    ----------
    name : str
    vertices : (n, 3) array
        As given, in the world frame as drawn; label k is row k - 1.
    seed : (3,) array
        The datum of the scaling, world frame.
    parts : tuple of ConvexPart
    faces : tuple of tuples of int
        Faces of the body as sorted 1-based vertex labels.
    outlines : tuple of tuples of int
        The same faces with their corners in the order given, where faces were given.
    deviation : (float, float)
        Lengths by which the parts stick out of the solid that they stand for, and fall short of it, at most: of one
        made from a mesh or file also by how far its vertices were moved, and triangles leave curved faces.
    facet_errors : (faces, 2) array or None
        Lengths by which each face sticks out of the surface that it stands for, and falls short of it, where a file
        says what surface that is; see `fcdm_opt.geometry.facet_errors`.
    surfaces : tuple of (Swept, tuple of int) or None
        The round surfaces that faces stand for, each with the rows of these, where they are told; else facets are taken
        as they are, see `rounded`.
    notes : tuple of str
        How the body was decomposed and why, and what of its mesh was repaired.
    triangles : tuple of tuples of (int, int, int)
        Triangles of each face, rows of `vertices`: the solid's own surface, which parts that overlap do not show. Only
        where it was made exactly from a mesh.
    is_surface : bool
        Whether the parts are all of the solid's surface but leave out some of what is inside it.
    full_body : Body or None
        The body with all parts, where these are only some of it, see `subset`.
    part_indices : tuple of int
        The numbers, from 0, of the parts of `full_body` that these are.
    rounding : float
        Length by which each corner may be off what was drawn, by the digits of the file that it was read from.
    exact : ExactPoints or None
        The points of round faces at which it is exact, and the body of facets that it was made of.
    drawn : Body or None
        The body whose faces were moved to make this one: faces that are called alike keep its numbers.
    at_scale : (Body, float) or None
        The body that was scaled to make this one, and the scale, where sizes are of its faces and grow with it.
    unit : "m", "cm", "mm", "um", "in", "ft" or ""
        Of all its lengths, "" where none is named; a `Problem` takes it over, and no number follows from it.
    """

    name: str
    vertices: Array
    seed: Array
    parts: tuple[ConvexPart, ...]
    faces: tuple[tuple[int, ...], ...]
    outlines: tuple[tuple[int, ...], ...]
    deviation: tuple[float, float] = (0.0, 0.0)
    facet_errors: Array | None = field(default=None, repr=False)
    surfaces: RoundFaces | None = field(default=None, repr=False)
    notes: tuple[str, ...] = ()
    triangles: tuple[tuple[tuple[int, ...], ...], ...] = ()
    is_surface: bool = False
    full_body: Body | None = field(default=None, repr=False)
    part_indices: tuple[int, ...] = field(default=(), repr=False)
    rounding: float = 0.0
    exact: ExactPoints | None = field(default=None, repr=False)
    drawn: Body | None = field(default=None, repr=False)
    at_scale: tuple[Body, float] | None = field(default=None, repr=False)
    unit: UnitOrNone = ""

    @classmethod
    @known_arguments
    def convex(cls, vertices: ArrayLike, *, seed: Seed = "centroid", name: str = "body", unit: UnitOrNone = "") -> Body:
        """Return the convex hull of points as a body.

        Parameters
        ----------
        vertices : (n, 3) array
            At least four points that span a volume; interior and repeated points keep their number and are unused.
        seed : {"centroid", "vertices", "box"} or (3,) array
            Volume centroid, mean of the vertices, centre of the axis-aligned box, or a point.
        name : str
            Used in messages and pictures.
        unit : "m", "cm", "mm", "um", "in", "ft" or ""
            Of the coordinates, see the attribute.

        Raises
        ------
        InputError
            For anything that is not a finite solid; names the body and the offending row.
        """
        points = _points(vertices, f"body '{name}'")
        return cls._made(points, [np.arange(len(points))], None, seed, name)._in(unit)

    @classmethod
    @known_arguments
    def from_parts(
        cls,
        vertices: ArrayLike | Sequence[ArrayLike],
        *,
        parts: Iterable[Iterable[int]] | None = None,
        faces: Iterable[Iterable[int]] | None = None,
        seed: Seed = "centroid",
        name: str = "body",
        deviation: tuple[float, float] = (0.0, 0.0),
        unit: UnitOrNone = "",
    ) -> Body:
        """Return a union of convex parts as one body.

        Parameters
        ----------
        vertices : (n, 3) array, or a sequence of such arrays
            With `parts`: the body's vertices. Without: one array a part; the body's numbering is then the order of
            first appearance, equal points counted once.
        parts : index lists, optional
            0-based rows of `vertices` of each part. Parts may overlap.
        faces : index lists, optional
            0-based rows of each true face of the body, corners in order; points on the face that are no corners may be
            among them. Without it, faces of the parts in one plane that share vertices are one face, and faces that
            two parts turn to each other are seams.
        seed : {"centroid", "vertices", "box"} or (3,) array
            As in `convex`; it may lie outside a part. "centroid" needs parts that do not overlap.
        deviation : (float, float)
            Lengths by which the parts stick out of the solid that they stand for, and fall short of it, at most.
        name, unit
            As in `convex`.

        Raises
        ------
        InputError
            Names the body, the part or face, and the vertex or entry; for faces too that are none of the body's.
        """
        if parts is None:
            groups = [_points(group, f"body '{name}': part {k + 1}") for k, group in enumerate(_groups(vertices, name))]
            points, rows = _numbered(groups)
        else:
            points = _points(vertices, f"body '{name}'")
            rows = row_lists(parts, len(points), f"body '{name}'", "part")
        given = None if faces is None else row_lists(faces, len(points), f"body '{name}'", "face")
        for k, face in enumerate(given or ()):
            if len(face) < 3:
                raise InputError("a face needs at least 3 corners", key=f"body '{name}': face {k + 1}", found=len(face))
        body = cls._made(points, [np.array(part, np.int64) for part in rows], given, seed, name)
        return replace(body, deviation=_deviation(deviation, name))._in(unit)

    @classmethod
    @known_arguments
    def from_mesh(
        cls,
        vertices: Any,
        faces: Iterable[Sequence[int]] | ArrayLike | None = None,
        *,
        decomposition: Method = "auto",
        seed: Seed = "centroid",
        name: str = "body",
        unit: UnitOrNone = "",
    ) -> Body:
        """Return the solid inside a closed surface as one body.

        Parameters
        ----------
        vertices : (n, 3) array
            Corners, length units; or a whole mesh in one, see `as_body`.
        faces : sequence of sequences of int
            Polygons as rows of `vertices`; seen from outside they run counter-clockwise. None with a whole mesh.
        decomposition : {"auto", "exact", "surface", "coacd"}
            How a non-convex solid is made of convex parts: cut exactly at its reflex edges; its surface alone, one
            pyramid under each face, which "auto" takes where cutting would take long; or approximately by CoACD. A
            convex solid is one part.
        seed, name, unit
            As in `convex`.

        Raises
        ------
        InputError
            For a surface that bounds no solid: open, crossing itself, or with no one inside.
        """
        if faces is None:
            return as_body(vertices, decomposition=decomposition, seed=seed, name=name, unit=unit)
        return cls._of_mesh(checked_mesh(vertices, faces, name=name), decomposition, seed)._in(unit)

    @classmethod
    def _of_mesh(cls, mesh: Mesh, decomposition: Method, seed: Seed) -> Body:
        name = mesh.name
        origin = mesh.centroid if isinstance(seed, str) and seed == "centroid" else _seed(seed, mesh.vertices, [], name)
        pacing.check()
        made = decompose(mesh, origin, method=decomposition)
        pacing.check()
        apart = made.method == "coacd"
        if made.made is not None:
            return cls._of_surface(made.made, origin, name, notes=(made.why, *mesh.repairs), moved=mesh.moved)
        body = cls._made(made.points, list(made.parts), None, origin, name, surface=made.surface, apart=apart)
        out, short = made.deviation
        return replace(body, deviation=(out + mesh.moved, short + mesh.moved), notes=(made.why, *mesh.repairs))

    @classmethod
    @known_arguments
    def from_file(
        cls,
        path: str | Path,
        *,
        unit: Unit,
        file_unit: Unit | None = None,
        deviation: float | None = None,
        decomposition: Method = "auto",
        seed: Seed = "centroid",
        name: str | None = None,
    ) -> Body:
        """Return the solid in an STL, OBJ, PLY, OFF, GLB or STEP file as one body.

        Parameters
        ----------
        path : path
            Several solids of a file are one body; "drive.step#key" is one of them alone, by its name in a STEP, GLB,
            OBJ or text STL file, by its number, from 1, in others.
        unit : "m", "cm", "mm", "um", "in" or "ft"
            Of the body's coordinates, and its `unit`.
        file_unit : "m", "cm", "mm", "um", "in" or "ft", optional
            Unit of the numbers in an STL, OBJ, PLY or OFF file, which do not say; default `unit`.
        deviation : float, optional
            Of a STEP file: the chord error, how far triangles may leave its curved faces at most, in `unit`. Default
            `Tolerances.tessellation` of the length of their edges. What they do is measured, see the attribute.
        decomposition : {"auto", "exact", "surface", "coacd"}
            As in `from_mesh`.
        seed : {"centroid", "vertices", "box"} or (3,) array
            As in `convex`, in `unit`.
        name : str, optional
            Used in messages and pictures; default the solid's, or the file's name without suffix.

        Raises
        ------
        InputError
            For a file that cannot be read and a surface that bounds no solid; names the file.
        """
        from fcdm_opt.geometry.files import called, drawn_mesh

        read = drawn_mesh(path, unit=unit, file_unit=file_unit, deviation=deviation)
        own_name = called(path) if name is None else name
        pacing.at(f"making a solid of {own_name}: {len(read.faces)} faces")
        try:
            mesh, origin = checked_mesh(read.vertices, read.faces, name=own_name), seed
            if read.surfaces is not None and isinstance(seed, str) and seed == "centroid":
                middle = true_centroid(mesh.vertices[mesh.triangles], mesh.triangle_faces, read.surfaces)
                origin = seed if middle is None else middle
            body = cls._of_mesh(mesh, decomposition, origin)
        except InputError as reason:
            try:  # each may be a solid by itself
                single = [f"{path}#{solid}" for solid in read.solids if decomposition in ("auto", "exact")]
                made = [cls.from_file(own, unit=unit, file_unit=file_unit, deviation=deviation) for own in single]
            except InputError:
                made = []
            if not made or any(own.is_surface for own in made):
                several = next((f"; {text}" for text in read.remarks if SEVERAL in text), "")
                error = InputError(reason.what + several, key=reason.key, found=reason.found, allowed=reason.allowed)
                raise error.within(file=path) from reason.__cause__
            body = cls._side_by_side(made, seed, own_name)
            return replace(body, rounding=read.rounding, notes=(*body.notes, *read.remarks), unit=unit)
        out, short = body.deviation
        errors = known = None
        if read.surfaces is not None:
            errors, known = errors_of_faces(*body.face_triangles, len(body.faces), read.surfaces)
        own_deviation = out + read.off[0], short + read.off[1]
        notes = (*body.notes, *read.remarks)
        body = replace(body, deviation=own_deviation, facet_errors=errors, surfaces=known, notes=notes)
        return replace(body, rounding=read.rounding)._in(unit)

    def to_file(self, path: str | Path) -> None:
        """Write the body's surface, in triangles, to an STL, OBJ or OFF file, digit for digit as text.

        Numbers are in the body's `unit`, which such files do not say: `Body.from_file(path, unit=...)` reads them. Of
        a union whose own surface is not known each part is a solid of the file. Round faces are written as facets.

        Raises
        ------
        InputError
            For another kind of file, and where it cannot be written.
        """
        from fcdm_opt.geometry.files import mesh_text

        whole = self.full_body or self
        parts = [part.vertices[fans(part.loops)] for part in whole.parts]
        write(path, mesh_text(path, [whole.face_triangles[0]] if whole.triangles else parts, self.name))

    @classmethod
    def _side_by_side(cls, solids: Sequence[Body], seed: Seed, name: str) -> Body:
        """Return solids whose surfaces cross or touch as one body: the parts of all of them."""
        drawn = [body.face_triangles[0] for body in solids]
        first, same = distinct_rows(np.concatenate(drawn).reshape(-1, 3))
        points, triangles = np.concatenate(drawn).reshape(-1, 3)[first], same.reshape(-1, 3)
        joined = union_of_shells(points, triangles, np.repeat(np.arange(len(drawn)), list(map(len, drawn))))
        note = "side by side: their surfaces cross or touch"
        if joined is not None and joined.triangles is not None:
            points, triangles, note = joined.points, joined.triangles, joined.remark
        if isinstance(seed, str) and seed == "centroid":
            seed = volume_and_centroid(points[triangles])[1]
        parts = [part.vertices for body in solids for part in body.parts]
        pacing.at(f"joining {len(parts)} convex parts of the solids in {name}")
        body = cls.from_parts(parts, seed=seed, name=name)
        off = np.max([own.deviation for own in solids], axis=0)
        text = f"{len(parts)} parts of {', '.join(own.name for own in solids)}: {note}"
        return replace(body, deviation=_deviation(off, name), notes=(text,))

    @classmethod
    def _made(
        cls,
        points: Array,
        rows: list[Ints],
        given: list[list[int]] | None,
        seed: Any,
        name: str,
        *,
        surface: Surface | None = None,
        apart: bool = False,
    ) -> Body:
        if not isinstance(name, str):
            raise InputError("not a name", key="name", found=name, allowed="text")
        if not rows:
            raise InputError("a body needs at least one part", key=f"body '{name}'")
        keys = [f"body '{name}'" + (f": part {k + 1}" if len(rows) > 1 else "") for k in range(len(rows))]
        hulls = [convex_hull(points[part], part, key) for part, key in zip(rows, keys, strict=True)]
        faces, elements = own_elements(points, hulls, given, name, surface=surface, apart=apart)
        unseeded = [
            ConvexPart(frozen(points[hull.used]), frozen(points[0]), hull.loops, frozen(hull.edges, np.int64), named)
            for hull, named in zip(hulls, elements, strict=True)
        ]
        origin = _seed(seed, points, unseeded, name)
        parts = tuple(replace(part, seed=origin) for part in unseeded)
        drawn = surface.loops if surface is not None else given
        outlines = faces if drawn is None else tuple(tuple(row + 1 for row in face) for face in drawn)
        triangles = () if surface is None or apart else surface.triangles_of_faces()
        return cls(name, frozen(points), origin, parts, faces, outlines, triangles=triangles)

    def __repr__(self) -> str:
        """Return name, counts, seed and extent on one line; the arrays are attributes."""
        extent = measured(" x ".join(f"{x:.4g}" for x in np.ptp(self.vertices, axis=0).tolist()), self.unit)
        seed = ", ".join(f"{0.0 if abs(x) <= DEFAULT.weld * self.size else x:.6g}" for x in self.seed.tolist())
        counts = f"{len(self.corners)} corners, {len(self.faces)} faces, convex parts: {len(self.parts)}"
        return f"Body({self.name!r}: {counts}, seed ({seed}), extent {extent})"

    @classmethod
    def _of_surface(cls, made: Pyramids, seed: Array, name: str, *, notes: tuple[str, ...], moved: float) -> Body:
        faces, elements = pyramid_elements(made)
        parts = tuple(
            ConvexPart(frozen(made.points[hull.used]), seed, hull.loops, hull.edges, named)
            for hull, named in zip(made.hulls, elements, strict=True)
        )
        outlines = tuple(tuple(row + 1 for row in face) for face in made.surface.loops)
        triangles = made.surface.triangles_of_faces()
        points = frozen(made.points)
        off = moved, moved
        return cls(name, points, seed, parts, faces, outlines, off, notes=notes, triangles=triangles, is_surface=True)

    @cached_property
    def corners(self) -> tuple[int, ...]:
        """Labels of the body's own corners, in order; not of vertices that only cuts between its parts have."""
        return tuple(sorted({label for face in self.faces for label in face}))

    @property
    def of_facets(self) -> Body:
        """The body of facets that one was made of which is exact at points of round faces; any other itself."""
        return self if self.exact is None else self.exact.facets

    def owns(self, element: Element) -> bool:
        """Tell whether an element is a corner, an edge or a face of the solid, and not only of a cut between its parts.

        True of all where faces were listed by hand, as some may be left out.
        """
        if self.full_body is not None:
            return self.full_body.owns(element)
        if len(self.parts) == 1 or not (self.triangles or self.outlines == self.faces):
            return True
        labels = set(element.vertices)
        if (piece := self.piece_of(element)) is not None:
            return piece.last not in labels
        if element.kind == "V":
            return labels.issubset(self.corners)
        if element.kind == "E":
            return bool(self.faces_with(element.vertices))
        return tuple(sorted(labels)) in self.face_rows

    def is_bounded_by(self, part: int, normal: Array, facing: Callable[[], tuple[Array, Array]]) -> bool:
        """Tell whether the solid is bounded along a normal where one of its parts is furthest along it.

        It is so where no other part goes further, as parts do on a cut, at a concave edge, and on a face that goes on:
        at some point; of a face inside of planes `facing` it, normals (k, 3) and levels above the part's lowest corner.
        """
        own, slack = self.parts[part], DEFAULT.tie * self.size
        heights = own.vertices @ normal
        rows = np.flatnonzero(heights >= heights.max() - slack)
        shapes = own.vertices[rows][None] if len(rows) == 2 else own.vertices[rows][:, None]
        if len(rows) > 2 and (k := next((k for k, loop in enumerate(own.loops) if {*rows} <= {*loop}), -1)) >= 0:
            if own.elements["F"][k].kind != "F" or not self.owns(own.elements["F"][k]):
                return False
            face = own.vertices[list(own.loops[k])]
            for n, level in zip(*facing(), strict=True):
                face = clipped(face, level + (own.vertices @ n).min() + slack / 2.0 - face @ n)
            shapes = face[None]
        further = [
            (other.normals, other.levels) for other in (self.full_body or self).parts
            if other is not own and (other.vertices @ normal).max() > heights.max() + slack
        ]  # fmt: skip
        return any(not len(shape) or uncovered(shape, further, slack) for shape in shapes)

    def piece_of(self, element: Element) -> PointPiece | None:
        """Return the piece at a point of a round face that an element is of; None of others."""
        first, pieces = min(element.vertices), self.exact.pieces if self.exact is not None else ()
        return next((own for own in pieces if own.first <= first <= own.last), None)

    def face_looking(self, element: Element, normal: Array) -> Element:
        """Return the true face with an outward normal, of those that meet in an element at a point of a round face."""
        # an element itself where there is none, or of others; bodies as drawn have that face
        if (piece := self.piece_of(element)) is None or self.exact is None or len(piece.rows) == 1:
            return element
        rows = [row for row, own in zip(piece.rows, piece.normals, strict=True) if own @ normal > np.cos(DEFAULT.sharp)]
        return Element("F", self.exact.facets.faces[rows[0]]) if len(rows) == 1 else element

    @cached_property
    def face_rows(self) -> dict[tuple[int, ...], int]:
        """Row of each face in `faces`."""
        return {face: k for k, face in enumerate(self.faces)}

    @cached_property
    def _faces_at(self) -> dict[int, list[tuple[int, ...]]]:
        found: dict[int, list[tuple[int, ...]]] = {}
        for face in self.faces:
            for label in face:
                found.setdefault(label, []).append(face)
        return found

    def faces_with(self, labels: Sequence[int]) -> list[tuple[int, ...]]:
        """Return the faces that have all of some corners, in order."""
        first, *others = labels
        return [face for face in self._faces_at.get(first, ()) if all(label in face for label in others)]

    @cached_property
    def facet_faces(self) -> tuple[tuple[tuple[int, ...], ...], ...]:
        """For each facet of each part the rows of `faces` that it lies on; none for a cut between parts."""
        place = self.face_rows

        def of(part: ConvexPart, k: int) -> tuple[int, ...]:
            span = part.elements.spans.get(("F", k))
            named = (part.elements["F"][k],) if span is None else span.elements
            keys = (tuple(sorted(own.vertices)) for own in named if own.kind == "F")
            return tuple(place[key] for key in keys if key in place)

        return tuple(tuple(of(part, k) for k in range(len(part.loops))) for part in self.parts)

    @cached_property
    def face_planes(self) -> tuple[Array, Array]:
        """Outward unit normals of the faces, (f, 3), and a point of each."""
        normals, points = np.zeros((2, len(self.faces), 3))
        for part, owners in zip(self.parts, self.facet_faces, strict=True):
            for k, own in enumerate(owners):
                for face in own:
                    normals[face], points[face] = part.normals[k], part.vertices[part.loops[k][0]]
        return frozen(normals), frozen(points)

    @cached_property
    def face_triangles(self) -> tuple[Array, Ints]:
        """Triangles of the faces, (t, 3, 3), wound outwards, and the row in `faces` of each: the pieces parts have."""
        if self.triangles:
            rows = np.concatenate([np.array(own) for own in self.triangles])
            return self.vertices[rows], np.repeat(np.arange(len(self.triangles)), list(map(len, self.triangles)))
        found = [(np.empty((0, 3, 3)), np.empty(0, np.int64))]
        for part, owners in zip(self.parts, self.facet_faces, strict=True):
            for loop, own in zip(part.loops, owners, strict=True):
                corners = part.vertices[fans([loop])]
                found += [(corners, np.full(len(corners), face)) for face in own]
        return np.concatenate([own for own, _ in found]), np.concatenate([own for _, own in found])

    @cached_property
    def _part_rows(self) -> list[Ints]:
        """The rows of `vertices` of each part's own, of equal ones the last."""
        rows = {tuple(point): row for row, point in enumerate(self.vertices.tolist())}
        return [np.array([rows[tuple(point)] for point in part.vertices.tolist()]) for part in self.parts]

    @cached_property
    def size(self) -> float:
        """Diagonal of the axis-aligned box as drawn: the length that relative tolerances refer to."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    @cached_property
    def extremes(self) -> tuple[Array, tuple[Element, ...]]:
        """Corners of the hull of the full body, (n, 3), and which of its own vertices each is: none moves further."""
        from scipy.spatial import ConvexHull

        if self.full_body is not None:
            return self.full_body.extremes
        points = np.concatenate([part.vertices for part in self.parts])
        elements = [element for part in self.parts for element in part.elements["V"]]
        rows = range(len(points)) if len(self.parts) == 1 else np.sort(ConvexHull(points).vertices).tolist()
        return frozen(points[list(rows)]), tuple(elements[k] for k in rows)

    @cached_property
    def packed(self) -> tuple[Array, Ints, Ints]:
        """Arrays of all parts that the kernels take, see `packing.packed_in_one`."""
        return packed_in_one(self.parts)

    def with_triangles(self, triangles: tuple[tuple[tuple[int, ...], ...], ...]) -> Body:
        """Return the same body with the triangles of its faces known, rows of `vertices`: parts lie on these faces."""
        owners = np.repeat(np.arange(len(triangles)), list(map(len, triangles)))
        surface = Surface.of(self.vertices, np.concatenate([np.array(own) for own in triangles]), owners)
        made = Body._made(self.vertices, self._part_rows, None, self.seed, self.name, surface=surface)
        return made if made.faces == self.faces else replace(self, triangles=triangles)

    def by_features(self, rule: int) -> Body:
        """Return the same solid cut so that each hole, pocket or boss may change its size by itself.

        Only of a body whose own surface is known from a mesh; `rule` as in `partition.RULES`.
        """
        mesh = checked_mesh(self.vertices, np.concatenate([np.array(own) for own in self.triangles]), name=self.name)
        made = by_features(mesh, rule)
        body = Body._made(made.points, list(made.parts), None, self.seed, self.name, surface=made.surface)
        return replace(body, deviation=self.deviation, notes=(made.why, *self.notes[1:]), unit=self.unit)

    def subset(self, indices: Sequence[int]) -> Body:
        """Return the body with some of its parts alone, by number from 0; the full one stays with it."""
        return replace(self, parts=tuple(self.parts[k] for k in indices), full_body=self, part_indices=tuple(indices))

    def _in(self, unit: str) -> Body:
        if unit:
            known_word(unit, NANOMETRES, "unknown unit", key=f"body '{self.name}': unit")
        return self if unit == self.unit else replace(self, unit=cast("UnitOrNone", unit))

    def _mapped(self, rows: Any) -> Body:
        seed = frozen(rows(self.seed[None])[0])
        ends = np.cumsum([len(part.vertices) for part in self.parts])[:-1]
        mapped = np.split(rows(np.concatenate([part.vertices for part in self.parts])), ends)
        each = zip(self.parts, mapped, strict=True)
        parts = tuple(replace(part.placed(own, seed), elements=part.elements.mapped(rows)) for part, own in each)
        full = None if self.full_body is None else self.full_body._mapped(rows)
        return replace(self, vertices=frozen(rows(self.vertices)), seed=seed, parts=parts, full_body=full)

    def scaled(self, rho: float) -> Body:
        """Return the body scaled by `rho` > 0 about its seed."""
        key = f"body '{self.name}': scale"
        factor = numbers(rho, key)
        if factor.shape != () or not (np.isfinite(factor) and self.size * factor > SMALLEST):
            raise InputError("a scale is a positive number", key=key, found=rho)
        if factor == 1.0:
            return self
        errors = None if self.facet_errors is None else frozen(factor * self.facet_errors)
        out, short = (float(factor) * length for length in self.deviation)
        scaled = self._mapped(lambda x: self.seed + factor * (x - self.seed))
        scaled = scaled._on_surfaces(about(self.seed, float(factor)), float(factor))
        return replace(scaled, deviation=(out, short), facet_errors=errors)

    def with_seed(self, seed: Seed) -> Body:
        """Return the same body with another datum of scaling, as `convex` takes it."""
        origin = _seed(seed, self.vertices, self.parts, self.name)
        return replace(self, seed=origin, parts=tuple(replace(part, seed=origin) for part in self.parts))

    def rounded(self) -> Body:
        """Return the same body with facets that stand for the cylinders, cones and spheres that their corners lie on.

        Twelve facets a turn or more. A body that knows what its facets stand for stays as it is.
        """
        return imported("geometry.facet_errors:rounded")(self)

    def faceted(self) -> Body:
        """Return the same body with its facets as its true faces, whatever round ones they stand for."""
        return replace(self, facet_errors=frozen(np.zeros((len(self.faces), 2))), surfaces=(), deviation=(0.0, 0.0))

    def moved(self, transform: ArrayLike) -> Body:
        """Return the body moved with its seed by a rigid 4x4 `transform`."""
        T = rigid_transform(transform, key=f"body '{self.name}': transform")
        return self._mapped(lambda x: x @ T[:3, :3].T + T[:3, 3])._on_surfaces(T, 1.0)

    def is_turned(self, other: Any) -> bool:
        """Tell whether another body is this one `moved` so that its `size` differs, that of the box along the axes."""
        if not isinstance(other, Body) or other.vertices.shape != self.vertices.shape:
            return False
        one, two = (own.vertices - own.seed for own in (self, other))
        turn = np.linalg.lstsq(one, two, rcond=None)[0]
        off = max(float(np.abs(one @ turn - two).max()) / self.size, float(np.abs(turn @ turn.T - np.eye(3)).max()))
        return off <= DEFAULT.weld and abs(other.size - self.size) > DEFAULT.weld * self.size

    def _on_surfaces(self, transform: Array, scale: float) -> Body:
        """Return the body with its round surfaces moved and scaled, see `Swept.placed`."""
        if self.surfaces is None:
            return self
        placed = tuple((own.placed(transform, scale), rows) for own, rows in self.surfaces)
        full = self.full_body and self.full_body._on_surfaces(transform, scale)
        return replace(self, surfaces=placed, full_body=full)

    def placed_vertices(self, rho: float, transform: Array) -> Array:
        """Return all vertices, scaled about the seed and then moved, (n, 3)."""
        return (self.seed + rho * (self.vertices - self.seed)) @ transform[:3, :3].T + transform[:3, 3]


@known_arguments
def as_body(
    x: Any, *, seed: Seed = "centroid", name: str = "body", decomposition: Method = "auto", unit: UnitOrNone = ""
) -> Body:
    """Return a body from a solid in any of the usual forms.

    Parameters
    ----------
    x : Body, trimesh.Trimesh, (vertices, faces), coal.Convex or coal BVH model
        A body comes back as it is, with its own seed, name and unit. A `coal.Convex` is the hull of its points; coal's
        other shapes are approximated by nothing here. Units are those of the numbers.
    seed, name, unit
        As in `Body.convex`.
    decomposition : {"auto", "exact", "surface", "coacd"}
        See `Body.from_mesh`.

    Raises
    ------
    InputError
        For anything else, and for surfaces that bound no solid, see `Body.from_mesh`.
    """
    if isinstance(x, Body):
        return x
    library = {kind.__module__.partition(".")[0] for kind in type(x).__mro__}
    if "coal" in library and hasattr(x, "convexHull"):
        return Body.convex(np.array(x.points()), seed=seed, name=name, unit=unit)
    if "coal" in library and hasattr(x, "tri_indices"):
        triangles = map(x.tri_indices, range(x.num_tris))
        faces: Any = [(own[0], own[1], own[2]) for own in triangles]  # coal's triangles have three entries, but no end
        vertices = np.array(x.vertices())
    elif "trimesh" in library and hasattr(x, "faces"):
        vertices, faces = np.array(x.vertices), np.array(x.faces)
    elif isinstance(x, tuple | list) and len(x) == 2:
        vertices, faces = x
    else:
        what = f"cannot be made a body: {type(x).__module__}.{type(x).__qualname__}"
        hint = "; for a file Body.from_file(path, unit=...)" if isinstance(x, str) or hasattr(x, "__fspath__") else ""
        raise InputError(what, key=f"body '{name}'", allowed=KNOWN_SOLIDS + hint)
    return Body.from_mesh(vertices, faces, decomposition=decomposition, seed=seed, name=name, unit=unit)


IDENTITY = frozen(np.eye(4))


def about(seed: Array, scale: float) -> Array:
    """Return the 4x4 transform before a scaling about the origin that makes it one about a seed."""
    shift = np.eye(4)
    shift[:3, 3] = seed / scale - seed
    return shift


def in_full(given: Any, poses: Array) -> Array:
    """Return poses, (..., 4, 4), given in single precision, or rounded to six digits, with the nearest rotations."""
    # what is no rotation to within that stays as it is, as does what counts as one
    if poses.shape[-2:] != (4, 4) or not np.isfinite(poses).all():
        return poses
    least, turns = DEFAULT.rigid / 8.0, poses[..., :3, :3]
    if getattr(given, "dtype", None) != np.float32:
        least = DEFAULT.rigid / 4.0
        if np.abs(turns @ np.swapaxes(turns, -1, -2) - np.eye(3)).max(initial=0.0) <= DEFAULT.rigid:
            return poses
    left, _, right = np.linalg.svd(turns)
    nearest, made = left @ right, poses.copy()
    off = np.abs(nearest - turns).max(axis=(-1, -2), keepdims=True)
    made[..., :3, :3] = np.where((off > least) & (off <= SINGLE), nearest, turns)
    return made


def rigid_transform(transform: ArrayLike | None, *, key: str = "transform") -> Array:
    """Return a checked rigid 4x4 transform (identity for None); raise `InputError` otherwise."""
    if transform is None:
        return IDENTITY
    plain = type(transform) is np.ndarray and transform.dtype == np.float64
    T = np.array(transform if plain else numbers(transform, key), order="C")
    if T.shape != (4, 4):
        raise InputError("a transform is a 4x4 matrix", key=key, found=f"shape {T.shape}")
    if not all(map(isfinite, T.ravel().tolist())):
        raise InputError("a transform is a finite 4x4 matrix", key=key, found=T.tolist())
    shift = T[:3, 3].tolist()
    if max(map(abs, shift)) > LARGEST:
        raise InputError("a translation too large to calculate with", key=key, found=shift, allowed=f"{LARGEST:g}")
    error, determinant = skewness(T)
    if not error <= DEFAULT.rigid or not plain:
        T = in_full(transform, T)
        error, determinant = skewness(T)
    if not error <= DEFAULT.rigid:
        raise InputError(NOT_RIGID, key=key, found=f"one that is off by {error:.3g}: {T.tolist()}", allowed=RIGID)
    if determinant < 0:
        raise InputError(NOT_RIGID, key=key, found=f"a mirror image: {T.tolist()}", allowed=RIGID)
    T.flags.writeable = False
    return T


def skewness(T: Array) -> tuple[float, float]:
    """Return how far a 4x4 transform is from a rigid motion, or its mirror image, and the determinant, which tells."""
    # plain floats: numpy takes longer for sixteen numbers
    (a, b, c, _), (d, e, f, _), (g, h, i, _), last = T.tolist()
    error = max(
        *(abs(x * x + y * y + z * z - 1.0) for x, y, z in ((a, b, c), (d, e, f), (g, h, i))),
        *(abs(a * d + b * e + c * f), abs(a * g + b * h + c * i), abs(d * g + e * h + f * i)),
        *(abs(x - y) for x, y in zip(last, (0.0, 0.0, 0.0, 1.0), strict=True)),
    )
    return error, a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)


# ---------------------------------------------------------------------------------------------------- input checks


def _groups(vertices: Any, name: str) -> list[Any]:
    try:
        deep = np.ndim(vertices[0]) == 2
    except (TypeError, ValueError, IndexError, KeyError):
        deep = False
    if not deep:
        what = "without `parts` give one (n, 3) array a part"
        raise InputError(what, key=f"body '{name}'", found=type(vertices).__name__)
    return list(vertices)


def _points(vertices: Any, key: str) -> Array:
    try:
        points = numbers(vertices, key)
    except InputError:
        for k, row in enumerate(vertices if isinstance(vertices, list | tuple | np.ndarray) else ()):
            if numbers(row, f"{key}: vertex {k + 1}").shape != (3,):
                raise InputError("a vertex is three numbers", key=f"{key}: vertex {k + 1}", found=row) from None
        raise
    return checked_corners(points, key)


def _numbered(groups: list[Array]) -> tuple[Array, list[list[int]]]:
    """Return the distinct points by first appearance, and each group's rows among them."""
    number: dict[tuple[float, ...], int] = {}
    rows = []
    for group in groups:
        numbers = [number.setdefault(tuple(point), len(number)) for point in (group + 0.0).tolist()]
        rows.append(list(dict.fromkeys(numbers)))
    return np.array(list(number)), rows


def _deviation(lengths: Any, name: str) -> tuple[float, float]:
    key = f"body '{name}': deviation"
    pair = numbers(lengths, key)
    if pair.shape != (2,) or not (np.isfinite(pair) & (pair >= 0)).all():
        raise InputError("a deviation is two lengths: outward, inward", key=key, found=lengths)
    return float(pair[0]), float(pair[1])


def solids_notes(bodies: Iterable[Body]) -> list[str]:
    """Return for each body that is several solids how many these are, and how to have one of a file alone."""
    return [f"{body.name}: {note}" for body in bodies for note in body.notes if SEVERAL in note]


def _seed(seed: Any, points: Array, parts: Sequence[ConvexPart], name: str) -> Array:
    key = f"body '{name}': seed"
    if not isinstance(seed, str):
        point = numbers(seed, key)
        if point.shape != (3,) or not np.isfinite(point).all():
            raise InputError("a seed is a finite point", key=key, found=seed)
        return frozen(point)
    if seed == "vertices":
        return frozen(points.mean(axis=0))
    if seed == "box":
        return frozen((points.min(axis=0) + points.max(axis=0)) / 2)
    if seed == "centroid":
        if _parts_overlap(parts):
            raise InputError("the centroid of overlapping parts is not defined by them; give the seed", key=key)
        volumes, centroids = zip(*(part.volume_and_centroid for part in parts), strict=True)
        return frozen(np.average(centroids, axis=0, weights=volumes))
    raise InputError("unknown seed rule", key=key, found=seed, allowed=", ".join(SEED_RULES) + " or a point")


def _parts_overlap(parts: Sequence[ConvexPart]) -> bool:
    """Tell whether interiors of two parts meet: the largest ball inside both, by linear programming."""
    for one, two in combinations(parts, 2):
        slack = DEFAULT.partition * np.ptp(np.vstack([one.vertices, two.vertices]), axis=0).max()
        if _separates(one, two, slack) or _separates(two, one, slack):
            continue
        both = np.vstack([one.normals, two.normals]), np.concatenate([one.levels, two.levels])
        if largest_ball(*both)[1] > slack:
            return True
    return False


def _separates(one: ConvexPart, two: ConvexPart, slack: float) -> bool:
    """Tell whether all of part two lies outside a face of part one, as it does at a seam."""
    step = max(1, MOST_PRODUCTS // len(two.vertices))
    blocks = (slice(k, k + step) for k in range(0, len(one.levels), step))
    return any(((one.normals[at] @ two.vertices.T).min(axis=1) >= one.levels[at] - slack).any() for at in blocks)
