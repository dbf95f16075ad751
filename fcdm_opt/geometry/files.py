"""Vertices and faces from mesh files, with nothing merged or dropped on the way.

Points that are the same in the file are the same here, digit for digit; `mesh.checked_mesh` makes them one and judges
the surface. Only where a file's digits are too few for its faces to be plane, its vertices are moved. trimesh reads
STL, PLY and GLB, through those of its functions that give the raw arrays. OBJ and OFF are read here: trimesh would cut
their polygons into fans, wrong unless convex, and number an OBJ file's vertices anew.
"""

from __future__ import annotations

import io
import os
import re
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.errors import InputError, checked_path, name_list, similar_name
from fcdm_opt.geometry.arrays import LARGEST, Array, Flags, Ints, distinct_rows
from fcdm_opt.geometry.closing import listed
from fcdm_opt.geometry.flattening import flattened, onto_planes
from fcdm_opt.geometry.measures import norms, short_decimals, unit_normals
from fcdm_opt.geometry.mesh import SEVERAL, solids
from fcdm_opt.geometry.polygons import Polygon
from fcdm_opt.geometry.tessellation import TESSELLATED, Surfaces, Swept, on_rings
from fcdm_opt.geometry.units import NANOMETRES, Unit
from fcdm_opt.lazy_import import extra
from fcdm_opt.tolerances import DEFAULT

STEP = (".step", ".stp")
WRITTEN = (".stl", ".obj", ".off")
SINGLE = 8 * float(np.finfo(np.float32).eps)  # of the largest coordinate: how far corners may be off surfaces
TRIES = 8  # to keep the deviation asked for of a STEP file
_METRES = np.array(list(NANOMETRES.values())) / NANOMETRES["m"]
# of a STEP file: a spline surface with the lists of its control points, the surface of a face, and a point
_NET = re.compile(
    rb"#(\d+)\s*=[^;=]*?(?:B_SPLINE|BEZIER)_SURFACE(?:_WITH_KNOTS)?\s*\((?:\s*'[^']*'\s*,)?\s*\d+\s*,\s*\d+\s*,\s*\(((?:\s*\([#\d,\s]*\)\s*,?)+)"
)
_FACE = re.compile(rb"(?:ADVANCED_FACE|FACE_SURFACE)\s*\([^;]*?#(\d+)\s*,\s*\.[TF]\.\s*\)\s*;")
_POINT = re.compile(rb"#(\d+)\s*=\s*CARTESIAN_POINT\s*\(\s*'[^']*'\s*,\s*\(([-+.\d\sEe,]+)\)")
SINGLE_DIGITS = 9  # digits that tell all numbers of single precision apart
DECIMALS = 15  # most that are looked at: more than double precision has of a length above 1
CHANCE = 1e-4  # that the decimals of a file are those of single precision though they were not rounded to it
ROUNDED = 3.0**0.5 / 2.0  # of a last digit: how far rounding moves a point of three coordinates


class Drawn(NamedTuple):
    """What is read from a file."""

    vertices: Array  # (n, 3)
    faces: list[Polygon]
    off: Array = np.zeros((0, 2))  # how far each may lie outside and within its solid, lengths; none where none does
    surfaces: Surfaces | None = None  # those of a STEP file
    # name of each of the file's objects, and how many of the faces it has; none where it tells of no objects
    solids: Sequence[tuple[str, int]] = ()

    def by_name(self) -> dict[str, Ints]:
        """Return the numbers of each solid's faces: of the objects that the file names, else of closed surfaces."""
        ends = np.cumsum([0, *(count for _, count in self.solids)]).tolist()
        named = {name: np.arange(*own) for (name, _), own in zip(self.solids, pairwise(ends), strict=True)}
        whole = (solids(self.vertices, [self.faces[k] for k in own.tolist()]) for own in named.values())
        if 1 < len(named) == len(self.solids) and all(whole):
            return named
        return {str(k): own for k, own in enumerate(solids(self.vertices, self.faces), 1)}

    def only(self, rows: Ints) -> Drawn:
        """Return some of the faces, and the vertices that these use."""
        faces = [self.faces[k] for k in rows.tolist()]
        used, place = np.unique(np.array([v for face in faces for v in face], np.int64), return_inverse=True)
        numbers = iter(place.tolist())
        own = [tuple(next(numbers) for _ in face) for face in faces]
        off = self.off[rows] if len(self.off) else self.off
        return self._replace(vertices=self.vertices[used], faces=own, off=off, solids=())


class ReadMesh(NamedTuple):
    """A mesh as `drawn_mesh` returns it."""

    vertices: Array  # in the order of the file, (n, 3)
    # rows of `vertices`; the polygons of OBJ, PLY and OFF files as they are, else triangles. All objects of a file are
    # one mesh, those of a GLB scene where the scene places them
    faces: list[Polygon]
    remarks: tuple[str, ...]  # what was done to the vertices, and how far triangles leave curved faces
    # how far the surface lies outside the solid of the file, and within it, at most, in `unit`: by its triangles on
    # curved faces, by vertices moved from where the file has them, and by digits too few for the coordinates
    off: tuple[float, float]
    rounding: float  # length by which the file's digits leave each vertex open; 0.0 where nothing tells that they do
    surfaces: Surfaces | None  # those of a STEP file, in `unit`
    solids: tuple[str, ...]  # names of the file's solids, where there are several and all are returned


def chosen_solid(path: str | Path) -> tuple[Path, str]:
    """Return a file and the name of one solid in it, "drive.step#key"; "" where all are meant."""
    whole = checked_path(path, "path")
    name, _, solid = whole.name.rpartition("#")
    if not solid or Path(name).suffix.lower() not in _READERS or whole.exists():
        return whole, ""
    return whole.with_name(name), solid


def called(path: str | Path) -> str:
    """Return what the part in a file is called: as the solid chosen of it, with the file's name before a number."""
    file, solid = chosen_solid(path)
    return f"{file.stem}-{solid}" if solid.isdecimal() else solid or file.stem


def drawn_mesh(
    path: str | Path, *, unit: Unit, file_unit: Unit | None = None, deviation: float | None = None
) -> ReadMesh:
    """Return vertices, faces, remarks, how far they are off the solid in a mesh or STEP file, and its surfaces.

    - `path`: its suffix says what it is, see `mesh_formats`. Of a file of several solids "drive.step#key" is one alone,
      by its name, or by its number from 1 where the file names none.
    - `unit`: of the coordinates returned.
    - `file_unit`, optional: unit of the numbers in an STL, OBJ, PLY or OFF file, which do not say; default `unit`. GLB
      files are in metres and STEP files name their unit: there it is an error.
    - `deviation`, optional: of a STEP file, how far triangles may leave its curved faces at most, in `unit`, > 0.
      Default `Tolerances.tessellation` of the length of their edges.

    Raises `InputError`, which names the file and what is wrong with it, or what to install (STEP).

    Plane faces of a STEP file, splines of coplanar control points among them, are exact to double precision; curved
    ones are approximated by triangles with corners on the surface that turn by at most
    `Tolerances.tessellation_turn`; how far they leave it is measured, see `tessellation`. Vertices in single precision
    (binary STL and PLY, GLB) and polygons within `Tolerances.drawn` of a plane are made plane to double precision, see
    `flattening`.
    """
    path, solid = chosen_solid(path)
    for key, value in (("unit", unit), ("file_unit", file_unit)):
        if not (isinstance(value, str) and value in NANOMETRES) and (key == "unit" or value is not None):
            raise InputError("unknown unit", file=path, key=key, found=value, allowed=", ".join(NANOMETRES))
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        raise InputError("unknown kind of file", file=path, found=suffix, allowed=", ".join(mesh_formats))
    reader, own_unit = _READERS[suffix]
    if own_unit is not None and file_unit is not None:
        what = f"a {suffix[1:].upper()} file says itself what its lengths are"
        raise InputError(what, file=path, key="file_unit", found=file_unit, allowed="none")
    if deviation is not None and suffix not in STEP:
        what = "only curved faces of a STEP file are cut into triangles here"
        raise InputError(what, file=path, key="deviation", found=deviation, allowed="none but with STEP")
    if deviation is not None and not (isinstance(deviation, float | int) and 0.0 < deviation <= LARGEST):
        raise InputError("not a length", file=path, key="deviation", found=deviation, allowed="a finite number > 0")
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):  # a pipe that nobody writes to would be waited for
            raise InputError("not a regular file", file=path, found="a pipe, socket or device", allowed="a mesh file")
        data = path.read_bytes()
    except (OSError, ValueError) as reason:  # a path with a null is no value
        what = f"cannot be read: {getattr(reason, 'strerror', None) or reason}"
        if isinstance(reason, FileNotFoundError):
            what = f"no such file in {path.parent.resolve()}"
        where = repr(str(path)) if "\0" in str(path) else path
        raise InputError(what + similar_name(path), file=where) from reason
    data = data.removeprefix(b"\xef\xbb\xbf")  # some editors begin a text with a mark
    if not data.strip():
        raise InputError("the file is empty", file=path)
    try:
        asked = None if deviation is None else deviation * NANOMETRES[unit] / NANOMETRES["m"]
        drawn = reader(data) if asked is None else _step(data, asked)
    except InputError as reason:
        raise reason.within(file=path) from reason.__cause__
    except Exception as reason:
        kind = "STEP" if suffix in STEP else suffix[1:].upper()
        raise InputError(f"not a complete {kind} file: {str(reason) or type(reason).__name__}", file=path) from reason
    if not len(drawn.faces):
        raise InputError("no faces in the file", file=path)
    drawn, names, several = _picked(drawn, solid, path)
    vertices, faces, surfaces, off = drawn.vertices, drawn.faces, drawn.surfaces, drawn.off.max(axis=0, initial=0.0)
    scale = Fraction(NANOMETRES[own_unit or file_unit or unit], NANOMETRES[unit])
    # with no more digits than single precision takes
    joined = suffix == ".stl" and all(x == float(f"{x:.{SINGLE_DIGITS - 1}e}") for x in np.unique(vertices).tolist())
    vertices, remarks, moved, rounding, cause = _plane(
        vertices, faces, single=own_unit is not None, joined=joined, binary=b"\0" in data
    )
    coarse = rounding if rounding > DEFAULT.drawn * float(norms(np.ptp(vertices, axis=0))) else 0.0
    if coarse:
        place = f"{coarse * float(scale):.2g} {unit}"
        remarks = (*remarks, f"{cause}: vertices are known to {place}")
    out, short = ((off + moved + coarse) * float(scale)).tolist()
    if off.any():
        most = float(off.max()) * float(scale)
        if deviation is not None and most > deviation * (1.0 + DEFAULT.nominal):
            what = f"its faces are drawn too coarsely: {TESSELLATED} by {most:.2g} however small they are"
            raise InputError(what, file=path, key="deviation", found=deviation, allowed="a larger length, or none")
        bound = "" if deviation is None else f", at most {deviation:g} asked"
        remarks = (f"{TESSELLATED} by up to {most:.2g} {unit} (STEP{bound})", *remarks)
    if surfaces is not None:
        known = tuple(own.placed(np.eye(4), float(scale)) for own in surfaces.known)
        surfaces = Surfaces(known, *(float(scale) * length for length in surfaces[1:]))
    remarks, vertices = (*remarks, *several), vertices * scale.numerator / scale.denominator
    return ReadMesh(vertices, faces, remarks, (out, short), rounding * float(scale), surfaces, names)


def mesh_text(path: str | Path, solids: Sequence[Array], name: str) -> str:
    """Return the text of a file with solids of triangles, (t, 3, 3) each, of the kind that its suffix says."""
    suffix = checked_path(path, "path").suffix.lower()
    if suffix not in WRITTEN:
        raise InputError("no kind of file that is written", file=path, found=suffix, allowed=", ".join(WRITTEN))
    names = [name] if len(solids) == 1 else [f"{name} {k}" for k in range(1, len(solids) + 1)]
    lines, corners, faces = list[str](), list[str](), list[str]()
    for own, triangles in zip(names, solids, strict=True):
        if suffix == ".stl":
            lines.append(f"solid {own}")
            for points in triangles:
                n = unit_normals(points[None])[0]
                vertices = [f"      vertex {_digits(point)}" for point in points]
                lines += [f"  facet normal {_digits(n)}", "    outer loop", *vertices, "    endloop", "  endfacet"]
            lines.append(f"endsolid {own}")
            continue
        first, same = distinct_rows(triangles.reshape(-1, 3))
        rows = (same.reshape(-1, 3) + len(corners) + (suffix == ".obj")).tolist()
        faces += [f"o {own}"] if suffix == ".obj" else []
        faces += [f"{'f' if suffix == '.obj' else '3'} {a} {b} {c}" for a, b, c in rows]
        corners += [_digits(point) for point in triangles.reshape(-1, 3)[first]]
    if suffix == ".obj":
        lines = [*(f"v {own}" for own in corners), *faces]
    elif suffix == ".off":
        lines = ["OFF", f"{len(corners)} {len(faces)} 0", *corners, *faces]
    return "\n".join(lines) + "\n"


def _digits(point: Array) -> str:
    return " ".join(map(repr, (point + 0.0).tolist()))


def _picked(drawn: Drawn, solid: str, path: Path) -> tuple[Drawn, tuple[str, ...], tuple[str, ...]]:
    """Return the solid asked for of what was read, or all with their names and a remark on how to have one."""
    every = [v for face in drawn.faces for v in face]
    sound = np.isfinite(drawn.vertices).all() and min(every) >= 0 and max(every) < len(drawn.vertices)
    found = drawn.by_name() if sound else {}  # `checked_mesh` says what is wrong with others
    if solid and solid not in found:
        raise InputError("no such solid in the file", file=path, found=solid, allowed=name_list(found) or "none: open")
    if solid:
        return drawn.only(found[solid]), (), ()
    if len(found) < 2:
        return drawn, (), ()
    known, first = listed(list(found), "solid", "solids"), next(iter(found))
    text = f"{len(found)} solids in the file{SEVERAL}: {known}; one alone is '{path.name}#{first}'"
    return drawn, tuple(found), (text,)


def _plane(
    vertices: Array, faces: list[Polygon], *, single: bool, joined: bool, binary: bool
) -> tuple[Array, tuple[str, ...], float, float, str]:
    """Return vertices moved within their digits such that faces are plane (`flattening`), a remark, and how far.

    And how far the digits leave each vertex open, 0 of a text in which nothing tells that they do, and why.
    """
    size = float(np.abs(vertices).max(initial=0.0))
    if not size <= LARGEST or not all(0 <= v < len(vertices) for face in faces for v in face):
        return vertices, (), 0.0, 0.0, ""  # `checked_mesh` says what is wrong
    exactly, written = _in_single(vertices)
    if exactly:
        vertices = short_decimals(vertices, np.spacing(np.abs(vertices).astype(np.float32)) / 2.0)
    digits = float(np.finfo(np.float32).eps) if single or exactly else DEFAULT.drawn
    moved = flattened(vertices, faces, digits * size, joined=single or exactly or joined)
    step = float(norms(moved - vertices).max())
    rounded = step > 0.0 or single or written or (binary and exactly) or (joined and not exactly)
    rounding = max(step, digits * size * ROUNDED) if rounded else 0.0
    few = single or exactly or step <= 2.0 * 10.0 ** -_decimals(vertices)
    scattered = f"corners of its plane faces are off these by {step / size:.1g} of the size, more than its digits tell"
    cause = "its digits are too few so far from the origin" if few else scattered
    notes = (f"vertices moved by {step / size:.1g} of the size, to make plane faces plane",) if step else ()
    return moved, notes, step, rounding, cause


def _decimals(values: Array) -> int:
    """Return with how many decimals numbers are written, at most `DECIMALS`."""
    return next((k for k in range(DECIMALS) if (values.round(k) == values).all()), DECIMALS)


def _in_single(vertices: Array) -> tuple[bool, bool]:
    """Tell whether coordinates are numbers of single precision, and whether such rounded to decimals of a text."""
    # "21.3397464752" of 21.339746475219727: of a boolean operation in single precision, in a file of 10 decimals
    values = np.unique(np.abs(vertices))
    with np.errstate(all="ignore"):
        single = values.astype(np.float32)
        other = values != single
        decimals = _decimals(values)
        chances = np.minimum(10.0**-decimals / np.spacing(single[other]).astype(float), 1.0)
    near = (single.astype(float).round(decimals) == values).all()
    written = bool(near and np.log(chances).sum() <= np.log(CHANCE))
    return written or not other.any(), written


def _quietly(load: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """Call a loader; a warning that it passed over something becomes an error, others are dropped."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", message=".*could not be read to its end")
        return load(*arguments, **options)


def _stl(data: bytes) -> Drawn:
    from trimesh.exchange.stl import load_stl

    is_text = b"\0" not in data
    if is_text:
        lower = data.lower()
        if not lower.lstrip().startswith(b"solid") or b"facet" not in lower:
            raise ValueError("neither binary nor text of that kind")
        if lower.count(b"endsolid") == 0:
            raise ValueError("its text ends without 'endsolid'")
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    elif len(data) < 84 or len(data) != (size := 84 + 50 * int.from_bytes(data[80:84], "little")):
        found = f"{len(data)} bytes" + (f" where its header promises {size}" if len(data) >= 84 else "")
        raise ValueError(found)
    loaded = _quietly(load_stl, io.BytesIO(data))
    named = loaded.get("geometry", {"": loaded})
    drawn = _joined([(solid["vertices"], solid["faces"]) for solid in named.values()], list(named))
    if is_text and len(drawn.faces) != lower.count(b"endfacet"):
        raise ValueError(f"{lower.count(b'endfacet')} facets with {len(drawn.vertices)} corners")
    return drawn


def _ply(data: bytes) -> Drawn:
    from trimesh.exchange.ply import load_ply

    loaded = _quietly(load_ply, io.BytesIO(data))
    if "vertices" not in loaded:
        return Drawn(np.empty((0, 3)), [])
    elements = loaded["metadata"]["_ply_raw"]
    keys = "vertex_index", "vertex_indices"
    face = elements.get("face", {}).get("data")
    lists: Any = ()
    if isinstance(face, dict):
        lists = next((face[key] for key in keys if key in face), ())
    elif isinstance(face, np.ndarray) and face.dtype.names:
        lists = next((face[key]["f1"] for key in keys if key in face.dtype.names), ())
    vertices, faces = np.array(loaded["vertices"], float), [tuple(map(int, own)) for own in lists]
    for name, found in (("vertex", vertices), ("face", faces)):
        if len(found) != (count := elements.get(name, {}).get("length", 0)):
            raise ValueError(f"{len(found)} of {count} elements '{name}'")
    return Drawn(vertices, faces)


def _glb(data: bytes) -> Drawn:
    # a mirror turns the faces' winding round
    placed = [(mesh, T, -1 if np.linalg.det(T[:3, :3]) < 0 else 1, name) for mesh, T, name in _scene(data)]
    meshes = [(mesh.vertices @ T[:3, :3].T + T[:3, 3], mesh.faces[:, ::order]) for mesh, T, order, _ in placed]
    return _joined(meshes, [name for *_, name in placed])


def _scene(data: bytes) -> list[tuple[Any, Array, str]]:
    """Return the meshes of a GLB file, the 4x4 transform that places each, and its name."""
    from trimesh import Trimesh, load_scene

    loaded = _quietly(load_scene, io.BytesIO(data), file_type="glb", process=False)
    nodes = [(node, *loaded.graph.get(node)) for node in loaded.graph.nodes_geometry]
    placed = [(loaded.geometry[name], T, str(node)) for node, T, name in nodes]
    return [own for own in placed if isinstance(own[0], Trimesh)]


def _joined(meshes: Sequence[tuple[Any, Any]], names: Sequence[str]) -> Drawn:
    """Return several meshes as one."""
    vertices, faces, count = [np.empty((0, 3))], list[Polygon](), 0
    for own, rows in meshes:
        vertices.append(np.asarray(own, float))
        faces += [tuple(row) for row in (np.asarray(rows, np.int64) + count).tolist()]
        count += len(own)
    counts = [(name, len(own)) for name, (_, own) in zip(names, meshes, strict=True)]
    return Drawn(np.concatenate(vertices), faces, solids=counts)


def _step(data: bytes, deviation: float | None = None) -> Drawn:
    """Return the solids in a STEP file, in metres, as triangles; plane faces are exact.

    - `deviation`, optional: how far triangles may leave curved faces, metres: as near to it as `TRIES` come; default
      relative, `Tolerances.tessellation`.

    Raises `InputError` without cascadio; says what to install.
    Raises `ValueError` for a file that is not complete.
    """
    cascadio = extra("cascadio", "step", needing="reading a STEP file ")
    if not data.lstrip().startswith(b"ISO-10303-21"):
        raise ValueError("it does not begin with 'ISO-10303-21'")
    if b"END-ISO-10303-21" not in data:
        raise ValueError("it ends without 'END-ISO-10303-21'")
    tolerance, planes = deviation, _plane_splines(data)
    for _ in range(TRIES):
        with _unheard():
            glb = cascadio.load(
                data,
                tol_linear=DEFAULT.tessellation if tolerance is None else 1e3 * tolerance,  # it counts in millimetres
                tol_angular=DEFAULT.tessellation_turn,
                tol_relative=tolerance is None,
                use_parallel=False,
                include_brep=True,
                brep_types={"plane", "cylinder", "cone", "sphere", "torus"},
            )
        if not glb:
            raise ValueError("no shape can be made of it")
        scene = _scene(glb)
        faces = {id(mesh): _Faces.of(mesh) for mesh, *_ in scene}
        sure = planes.sure([*faces.values()]) if len(planes.normals) else None
        sharp = [_sharpened(faces[id(mesh)], deviation, planes, sure) for mesh, *_ in scene]
        off = np.reshape([own for _, own, *_ in sharp], (-1, 2))
        if deviation is None or tolerance is None or off.max(initial=0.0) <= deviation:
            break
        tolerance *= max(0.5, 0.8 * deviation / float(off.max()))  # of spheres it keeps only half of what is asked
    placed = list(zip(sharp, scene, strict=True))
    meshes = [(own @ T[:3, :3].T + T[:3, 3], mesh.faces) for (own, *_), (mesh, T, _) in placed]
    drawn = _joined(meshes, [name for *_, name in scene])
    largest = float(np.abs(drawn.vertices).max(initial=0.0))
    off = np.repeat(np.where(off > DEFAULT.weld * largest, off, 0.0), [count for _, count in drawn.solids], axis=0)
    known = tuple(each.placed(T, 1.0) for (_, _, own, _), (_, T, _) in placed for each in own)
    other = max((bound for *_, bound in sharp), default=0.0)
    return drawn._replace(off=off, surfaces=Surfaces(known, other, SINGLE * largest))


class _Faces(NamedTuple):
    """The faces of a mesh of a STEP file."""

    points: Array  # each once, (n, 3)
    same: Ints  # which of these each vertex of the mesh is
    triangles: list[Ints]  # of each face
    primitives: list[Any]  # of each face what is told of its surface; None where it is of no known kind
    slack: float  # how far corners may be off surfaces, in single precision

    @classmethod
    def of(cls, mesh: Any) -> _Faces:
        """Return those of a mesh."""
        vertices = np.array(mesh.vertices)
        first, same = distinct_rows(vertices)
        triangles = same[mesh.faces]
        owner = mesh.face_attributes.get("brep_index", np.full(len(triangles), -1))
        order = np.argsort(owner, kind="stable")
        faces = [triangles[own] for own in np.split(order, np.flatnonzero(np.diff(owner[order])) + 1)]
        primitives = dict(enumerate(mesh.metadata.get("cascadio", {}).get("brep_primitives", [])))
        found = [primitives.get(k) for k in np.unique(owner).tolist()]
        return cls(vertices[first], same, faces, found, SINGLE * np.abs(vertices).max(initial=0.0))


class _Planes(NamedTuple):
    """Planes of splines with coplanar control points, in metres, as if numbers were in each of the known units."""

    normals: Array  # (splines, 3)
    heights: Array  # from the origin, (units, splines)
    faces: Ints  # how many faces each spline is of, (splines,)

    def holding(self, faces: _Faces) -> Flags:
        """Tell which planes have all corners of which faces of no known kind, (units, splines, faces)."""
        on = np.zeros((*self.heights.shape, len(faces.triangles)), bool)
        for k, (primitive, own) in enumerate(zip(faces.primitives, faces.triangles, strict=True)):
            if primitive is None:
                off = faces.points[np.unique(own)] @ self.normals.T
                on[..., k] = np.abs(off - self.heights[:, None]).max(axis=1) <= faces.slack
        return on

    def sure(self, each: Sequence[_Faces]) -> Flags:
        """Tell which planes have no more faces of meshes in them than the file has faces of their splines."""
        # another curved face may have all of its corners there: of a triangle that bulges within what meshes leave out
        on = np.concatenate([self.holding(own) for own in each], axis=2)
        planes = [np.unique(own, axis=0, return_inverse=True)[1].reshape(-1) for own in on]
        most = [np.bincount(own, weights=self.faces)[own] for own in planes]
        return np.asarray(on.sum(axis=2) <= np.array(most))


def _plane_splines(data: bytes) -> _Planes:
    """Return the planes of the splines of a STEP file that are flat."""
    nets = [(name, re.findall(rb"#(\d+)", own)) for name, own in _NET.findall(data)]
    points = {name: [*map(float, own.split(b","))] for name, own in _POINT.findall(data)} if nets else {}
    of_faces, found = Counter(_FACE.findall(data) if nets else ()), list[tuple[Array, float, int]]()
    for spline, net in nets:
        corners = np.array([points[name] for name in net if name in points])
        if len(corners) == len(net) > 3:  # a spline is within the hull of these
            middle = corners.mean(axis=0)
            normal = np.linalg.svd(corners - middle, full_matrices=False)[2][2]
            if np.abs((corners - middle) @ normal).max() <= DEFAULT.weld * np.ptp(corners, axis=0).max():
                found.append((normal, float(middle @ normal), of_faces[spline]))
    normals, heights, counts = zip(*found, strict=True) if found else ((), (), ())
    return _Planes(np.reshape(normals, (-1, 3)), np.outer(_METRES, heights), np.array(counts, np.int64))


def _sharpened(
    faces: _Faces, deviation: float | None, planes: _Planes, sure: Flags | None
) -> tuple[Array, tuple[float, float], list[Swept], float]:
    """Return vertices of a mesh moved, within single precision, onto surfaces around them; how far triangles leave."""
    # that is measured at curved surfaces that are known, and the bound asked for at others; both come with it
    distinct, slack, known = faces.points, faces.slack, list[tuple[Swept, Ints]]()
    on = planes.holding(faces) & sure[..., None] if sure is not None else None
    for k, (primitive, own) in enumerate(zip(faces.primitives, faces.triangles, strict=True)):
        if primitive is not None:
            known.append((Swept.of(primitive), own))
        elif on is not None and on[..., k].any():
            unit, spline = np.argwhere(on[..., k])[0]
            normal = planes.normals[spline]
            known.append((Swept.plane(planes.heights[unit, spline] * normal, normal), own))
    moved = distinct.copy()
    if known:
        corners = [np.unique(own) for _, own in known]
        moved = on_rings(distinct, [(surface, own) for (surface, _), own in zip(known, corners, strict=True)], slack)
        missed = [surface.misses(moved[own]) for (surface, _), own in zip(known, corners, strict=True)]
        corner, (misses, normals) = np.concatenate(corners), map(np.concatenate, zip(*missed, strict=True))
        near = np.abs(misses) <= slack
        moved = onto_planes(moved, corner[near], normals[near], -misses[near])
        far = np.abs(moved - distinct).max(axis=1) > slack / DEFAULT.sharp
        moved[far] = distinct[far]
    curved = [surface.deviations(moved[own]) for surface, own in known if not surface.flat]
    errors, bound = [own.max(axis=0, initial=0.0) for own in curved], 0.0
    if len(known) < len(faces.triangles):
        bound = DEFAULT.tessellation * float(np.ptp(distinct, axis=0).max()) if deviation is None else deviation
        errors.append(np.full(2, bound))
    out, short = np.max(errors, axis=0, initial=0.0).tolist() if errors else (0.0, 0.0)
    return moved[faces.same], (out, short), [surface for surface, _ in known], bound


@contextmanager
def _unheard() -> Iterator[None]:
    """Let the library print nothing: standard output may be a program's result, and what is wrong is raised."""
    for stream in filter(None, (sys.stdout, sys.stderr)):
        stream.flush()
    # a bar of ours may be on the second
    kept = {own: os.dup(own) for own in ((1,) if pacing.has_listeners() else (1, 2))}
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for own in kept:
            os.dup2(nowhere, own)
        yield
    finally:
        for own, before in kept.items():
            os.dup2(before, own)
            os.close(before)
        os.close(nowhere)


def _lines(data: bytes) -> list[tuple[int, list[str]]]:
    """Return the words of each line that has some, with the line's number; comments are left out."""
    if b"\0" in data:
        raise ValueError("not text")
    text = data.decode("utf-8-sig", errors="replace").replace("\\\r\n", " ").replace("\\\n", " ")
    words = ((k + 1, line.partition("#")[0].split()) for k, line in enumerate(text.splitlines()))
    return [(k, own) for k, own in words if own]


def _obj(data: bytes) -> Drawn:
    vertices, faces, objects, name = list[list[float]](), list[Polygon](), list[str](), ""
    for line, (word, *rest) in _lines(data):
        try:
            if word == "o":
                name = " ".join(rest)
            elif word == "v":
                x, y, z = map(float, rest[:3])
                vertices.append([x, y, z])
            elif word == "f":
                rows = [int(corner.partition("/")[0]) for corner in rest]
                # counted from 1, or backwards from the last vertex so far
                own = tuple(row - 1 if row > 0 else len(vertices) + row for row in rows)
                if 0 in rows or min(own) < 0:
                    raise ValueError
                faces.append(own)
                objects.append(name)
        except ValueError as reason:
            raise ValueError(f"line {line}: {' '.join([word, *rest])[:60]!r}") from reason
    if faces and max(map(max, faces)) >= len(vertices):
        raise ValueError(f"a face names vertex {max(map(max, faces)) + 1} of {len(vertices)}")
    named = [(own, len(list(some))) for own, some in groupby(objects)]
    return Drawn(np.array(vertices).reshape(-1, 3), faces, solids=named)


def _off(data: bytes) -> Drawn:
    (_, (kind, *counts)), *lines = _lines(data)
    if kind not in ("OFF", "COFF", "NOFF", "CNOFF", "STOFF") or counts[:1] == ["BINARY"]:
        raise ValueError(f"it begins with {kind[:20]!r}")
    if not counts:
        (_, counts), *lines = lines
    many, polygons = int(counts[0]), int(counts[1])
    if len(lines) < many + polygons:
        raise ValueError(f"{len(lines)} lines for {many} vertices and {polygons} faces")
    vertices, faces = list[list[float]](), list[Polygon]()
    for k, (line, words) in enumerate(lines[: many + polygons]):
        try:
            if k < many:
                x, y, z = map(float, words[:3])
                vertices.append([x, y, z])
                continue
            size = int(words[0])
            own = tuple(map(int, words[1 : size + 1]))
            if len(own) != size or not all(0 <= v < many for v in own):
                raise ValueError
            faces.append(own)
        except ValueError as reason:
            raise ValueError(f"line {line}: {' '.join(words)[:60]!r}") from reason
    return Drawn(np.array(vertices).reshape(-1, 3), faces)


# how to read a kind of file, and the unit it comes in
_READERS: dict[str, tuple[Callable[[bytes], Drawn], str | None]] = {
    ".stl": (_stl, None),
    ".obj": (_obj, None),
    ".ply": (_ply, None),
    ".off": (_off, None),
    ".glb": (_glb, "m"),
    ".step": (_step, "m"),
    ".stp": (_step, "m"),
}
mesh_formats = tuple(_READERS)
