"""The tables of a problem file that are no cases: bodies, keep-outs, steps of a motion, reference values.

Each entry is a model that knows its way both from plain data and back.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Discriminator, Tag, model_validator

from fcdm_opt import pacing
from fcdm_opt.errors import InputError, closest
from fcdm_opt.geometry.arrays import frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.size import SELECTORS, Size
from fcdm_opt.geometry.tessellation import Swept
from fcdm_opt.geometry.units import Unit
from fcdm_opt.motion.motions import PITCHES, AxisWord, Free, Rotation, Screw, Step, Translation
from fcdm_opt.motion.own_motion import OwnMotion
from fcdm_opt.plain import plain
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.schema import (
    Deviation,
    Entry,
    FacetError,
    Label,
    Length,
    Number,
    Pair,
    Point,
    Positive,
    declared,
    one_of,
    refusal,
)

Axis = AxisWord | Point
_PITCH_KEYS = ("pitch", "pitch_per_deg", "pitch_per_rad")

# ---------------------------------------------------------------------------------------------------------- bodies


class SurfaceEntry(Entry, title="Round surfaces"):
    """The surface that some faces stand for: a cylinder, a cone, a sphere or a torus."""

    origin: Point = declared(
        ...,
        "[x, y, z], length units: a point of the axis, of a cone its apex, of a sphere or torus the centre",
        [0, 0, 0],
    )
    axis: Point = declared(..., "[x, y, z], unit direction of the axis; of a sphere any", [0.0, 0.0, 1.0])
    line: Pair | None = declared(
        None,
        "[cos, sin] of the half angle of a cone, a unit vector; [1, 0] of a cylinder; without it a sphere or torus",
        [1.0, 0.0],
    )
    ring: Length = declared(0.0, "radius of the circle that a torus is about, length units; 0 of others", 20.0)
    radius: Number = declared(0.0, "radius, length units, of a torus that of its tube; 0 of a cone", 5.0)
    faces: list[Label] = declared(..., "numbers, from 1, of the faces that stand for it", [1, 2, 3])

    @property
    def surface(self) -> tuple[Swept, tuple[int, ...]]:
        """It, and the rows of its faces."""
        own = Swept(frozen(self.origin), frozen(self.axis), self.line, self.ring, self.radius)
        return own, tuple(face - 1 for face in self.faces)


class BodyEntry(Entry, title="Bodies", json_schema_extra=one_of(("vertices",), ("file", "unit"))):
    """A body with its seed: a union of convex parts, or a mesh from a file."""

    name: str | None = declared(
        None, "name in messages and pictures (text); without it movable, static, keep-out k, or the file's name", "peg"
    )
    vertices: list[Point] | None = declared(
        None,
        '[[x, y, z], ...], length units, at least four; label k is the k-th; or a mesh: file = "peg.stl"',
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    )
    parts: list[list[Label]] | None = declared(
        None,
        "1-based vertex labels of each convex part; without it the body is the hull of its vertices",
        [[1, 2, 3, 4], [3, 4, 5, 6]],
    )
    faces: list[list[Label]] | None = declared(
        None,
        "1-based vertex labels of each true face; without it faces follow from the parts",
        [[1, 2, 3], [1, 2, 4], [2, 3, 4], [1, 3, 4]],
    )
    triangles: list[list[list[Label]]] | None = declared(
        None,
        "of each true face, 1-based vertex labels of the triangles that it is drawn with, wound outwards; without it "
        "those follow from the parts",
        [[[1, 2, 3]], [[1, 4, 2]], [[2, 4, 3]], [[1, 3, 4]]],
    )
    seed: Literal["centroid", "vertices", "box"] | Point = declared(
        "centroid",
        'the point that scaling holds: "centroid" (of the volume), "vertices" (their mean), "box" (its '
        "centre) or [x, y, z], length units",
        "centroid",
        [0.0, 0.0, 2.5],
    )
    deviation: Deviation | None = declared(
        None,
        "[outward, inward], lengths >= 0: how far the parts stick out of the true body, fall short of it; "
        "without it [0, 0]. Of a STEP file one length > 0: how far triangles may leave its curved faces; without it "
        "about a thousandth of the length of their edges",
        [0.01, 0.0],
        0.01,
    )
    facet_errors: list[FacetError] | None = declared(
        None,
        "[face, outward, inward] of each face that stands for a round one: its number, from 1, and how far, lengths "
        ">= 0, it sticks out of that and falls short of it; without it facets side by side whose corners lie on one "
        "cylinder, cone or sphere are taken for that",
        [[3, 0.0, 0.01]],
    )
    surfaces: list[SurfaceEntry] | None = declared(
        None,
        "the round surfaces that faces stand for; without it those of a STEP file, or what facets are taken for",
        [{"origin": [0, 0, 0], "axis": [0, 0, 1], "line": [1, 0], "radius": 5.0, "faces": [1, 2]}],
    )
    rounding: Length = declared(
        0.0, "length >= 0 by which the digits of a file that the vertices were read from leave each of them open", 1e-5
    )
    round: bool | None = declared(
        None,
        "whether facets stand for the cylinder, cone or sphere that their corners lie on (true) or are the true faces "
        "(false); without it those of a STEP file stand for what that says, and those of meshes are taken as they are",
        True,
        strict=True,
    )
    notes: list[str] = declared(
        [], "how the body was made: text that is shown with results", ["cut by CoACD at threshold 0.05"]
    )
    file: str | None = declared(
        None,
        'mesh in place of vertices: STL, OBJ, PLY, OFF, GLB or STEP, relative to this file; "drive.step#key" is one '
        "solid of several",
        "peg.stl",
    )
    unit: Unit | None = declared(
        None,
        'unit of all lengths here, shown with results: "m", "cm", "mm", "um", "in" or "ft"; a mesh is read '
        "in it, vertices stay as they are; without it, beside vertices alone, length units",
        "mm",
    )
    file_unit: Unit | None = declared(None, "unit of the numbers in a mesh file that does not say; default: unit", "in")
    decomposition: Literal["auto", "exact", "surface", "coacd"] | None = declared(
        None, 'how a mesh, of a file or of vertices and faces, is cut into parts: "auto", "exact" or "coacd"', "exact"
    )

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        given = self.model_fields_set
        drawn = ["vertices", "parts", "faces", "triangles", "notes", "facet_errors", "surfaces", "rounding"]
        read = ["file_unit"]
        (read if isinstance(self.deviation, float) else drawn).append("deviation")
        wrong = next((key for key in (drawn if self.file is not None else read) if key in given), None)
        if wrong and self.file is not None:
            what = "a body is given by its file or by its vertices, not by both"
            allowed = "file, unit, file_unit, decomposition, seed, name, and of a STEP file deviation, one length"
            raise refusal(what, found=f"file and {wrong}", allowed=allowed, inside=(wrong,))
        if wrong:
            what = "this key goes with file" if wrong in read[:1] else "one length goes with file"
            allowed = 'file = "peg.stl"' if wrong in read[:1] else 'file = "peg.step", or [outward, inward]'
            raise refusal(what, found=getattr(self, wrong), allowed=allowed, inside=(wrong,))
        needed = "vertices" if self.file is None else "unit"
        if self.decomposition and self.file is None and (self.faces is None or "parts" in given):
            what = "only a mesh is cut into parts"
            allowed = "decomposition with file and unit, or with vertices and faces alone"
            raise refusal(what, found=", ".join(sorted(given)), allowed=allowed, inside=("decomposition",))
        if getattr(self, needed) is None:
            found = f"only {', '.join(sorted(given))}" if given else "an empty table"
            allowed = str(type(self).model_fields[needed].description)
            raise refusal("missing key", found=found, allowed=allowed, inside=(needed,))
        return self

    def body(self, role: str, folder: Path | None) -> Body:
        """Return the body, named after its role if it has no other name; in `folder` the path of a mesh file starts."""
        found = self._drawn(role) if self.file is None else self._read(folder)
        return found if self.round is None else found.rounded() if self.round else found.faceted()

    def _read(self, folder: Path | None) -> Body:
        try:
            path = Path(str(self.file)).expanduser()
        except RuntimeError as reason:
            allowed = "the path of a mesh file"
            raise InputError("no such home folder", key="file", found=self.file, allowed=allowed) from reason
        if folder is None and not path.is_absolute():
            allowed = "a full path"
            raise InputError("there is no problem file to start from", key="file", found=self.file, allowed=allowed)
        assert self.unit is not None
        pacing.at(f"reading {path.name!r} and cutting it into convex parts")
        try:
            return Body.from_file(
                (folder or path) / path,
                unit=self.unit,
                file_unit=self.file_unit,
                deviation=self.deviation if isinstance(self.deviation, float) else None,
                decomposition=self.decomposition or "auto",
                seed=self.seed,
                name=self.name,
            )
        except InputError as reason:
            raise InputError(f"the body cannot be taken from its file: {reason}", key="file") from reason

    def _drawn(self, role: str) -> Body:
        assert self.vertices is not None
        count = len(self.vertices)
        triangles = [[v for triangle in face for v in triangle] for face in self.triangles or ()]
        for key, groups in (("parts", self.parts), ("faces", self.faces), ("triangles", triangles)):
            for k, group in enumerate(groups or (), 1):
                wrong = [label for label in group if label > count]
                if wrong:
                    raise InputError("no such vertex", key=f"{key}[{k}]", found=wrong[0], allowed=f"1 to {count}")
        parts = [range(count)] if self.parts is None else _shifted(self.parts)
        faces = None if self.faces is None else _shifted(self.faces)
        name = role if self.name is None else self.name
        if self.decomposition is not None and faces is not None:
            body = Body.from_mesh(self.vertices, faces, decomposition=self.decomposition, seed=self.seed, name=name)
        else:
            body = Body.from_parts(self.vertices, parts=parts, faces=faces, seed=self.seed, name=name)
        if self.triangles is not None:
            if len(self.triangles) != len(body.faces) or {3} != {len(own) for face in self.triangles for own in face}:
                allowed = f"triangles of each of {len(body.faces)} faces, three labels each"
                raise InputError("not the triangles of the faces", key="triangles", allowed=allowed)
            drawn = tuple(tuple(tuple(label - 1 for label in own) for own in face) for face in self.triangles)
            body = body.with_triangles(drawn)
        given: dict[str, Any] = {"deviation": self.deviation, "notes": tuple(self.notes), "unit": self.unit}
        given["rounding"] = self.rounding
        if self.facet_errors is not None:
            errors = np.zeros((len(body.faces), 2))
            for face, *own in self.facet_errors:
                if face > len(errors):
                    allowed = f"1 to {len(errors)}"
                    raise InputError("no such face", key="facet_errors", found=face, allowed=allowed)
                errors[int(face) - 1] = own
            body = replace(body, facet_errors=frozen(errors))
        if self.surfaces is not None:
            body = replace(body, surfaces=tuple(own.surface for own in self.surfaces))
            wrong = [row + 1 for _, rows in body.surfaces or () for row in rows if row >= len(body.faces)]
            if wrong:
                allowed = f"1 to {len(body.faces)}"
                raise InputError("no such face", key="surfaces.faces", found=wrong[0], allowed=allowed)
        return replace(body, **{key: value for key, value in given.items() if value})


def _shifted(groups: list[list[int]]) -> list[list[int]]:
    return [[label - 1 for label in group] for group in groups]


class Bodies(Entry, title="Both bodies"):
    """The two bodies."""

    movable: BodyEntry = declared(
        ..., "the body that moves: a table with vertices, seed, ...", {"file": "peg.stl", "unit": "mm"}
    )
    static: BodyEntry = declared(
        ..., "the body at rest: a table with vertices, seed, ...", {"file": "plate.stl", "unit": "mm"}
    )


def plain_body(body: Body) -> dict[str, Any]:
    """Return a body as drawn, as plain data; `parts` only where the hull of all vertices would not do."""
    more: dict[str, Any] = {"deviation": list(body.deviation) * any(body.deviation), "notes": list(body.notes)}
    more["rounding"] = body.rounding
    if body.facet_errors is not None:
        rows = np.flatnonzero(body.facet_errors.any(axis=1)).tolist()
        more["facet_errors"] = [[row + 1, *body.facet_errors[row].tolist()] for row in rows]
    if body.surfaces is not None:
        more["surfaces"] = [
            {key: value for key, value in plain({**own._asdict(), "faces": [row + 1 for row in rows]}).items() if value}
            for own, rows in body.surfaces
        ]
    more = {key: value for key, value in more.items() if value or key in ("facet_errors", "surfaces")}
    unit = {"unit": body.unit} if body.unit else {}
    if body.is_surface:  # one part under each face: made again from these
        drawn = body.vertices[: max(v for face in body.triangles for triangle in face for v in triangle) + 1].tolist()
        faces = [[v + 1 for v in triangle] for face in body.triangles for triangle in face]
        surface = {"vertices": drawn, "faces": faces, "decomposition": "surface"}
        return {"name": body.name, **surface, **more, "seed": body.seed.tolist(), **unit}
    entry: dict[str, Any] = {"name": body.name, "vertices": body.vertices.tolist()}
    parts = [
        [
            own.vertices[0] if own.kind == "V" else int(np.abs(body.vertices - vertex).max(axis=1).argmin()) + 1
            for own, vertex in zip(part.elements["V"], part.vertices, strict=True)
        ]
        for part in body.parts
    ]
    if parts != [list(range(1, len(body.vertices) + 1))]:
        entry["parts"] = parts
    faces = [list(face) for face in body.outlines]
    if body.triangles and len(body.parts) > 1:  # facets of parts go on where these are cut
        more["triangles"] = [[[v + 1 for v in own] for own in face] for face in body.triangles]
    return {**entry, **more, "faces": faces, "seed": body.seed.tolist(), **unit}


class KeepOutEntry(BodyEntry, title="Keep-outs"):
    """A further static body that the movable one must keep clear of."""

    scale: Number | Pair = declared(
        1.0, "a scale > 0 about its seed, or [low, high]: the gap is kept at every scale between", 1.0, [0.99, 1.01]
    )
    clearance: Number = declared(0.0, "least gap, length units; 0: touching allowed, overlapping not", 0.5)

    def keep_out(self, role: str, folder: Path | None) -> KeepOut:
        """Return the keep-out, see `body`."""
        return KeepOut(self.body(role, folder), self.scale, clearance=self.clearance)


def plain_keep_out(keep_out: KeepOut) -> dict[str, Any]:
    """Return a keep-out as plain data, which its entry reads."""
    return {**plain_body(keep_out.body), "scale": plain(keep_out.scale), "clearance": keep_out.clearance}


# ----------------------------------------------------------------------------------------------------------- sizes


class ThroughEntry(Entry, title="Face through a point"):
    """The face that a point lies in."""

    through: Point = declared(..., "[x, y, z], length units, a point of the face", [0.0, 1.0, 0.5])


class AroundEntry(Entry, title="Facets of a cylinder"):
    """All facets of a cylinder."""

    around: Point = declared(..., "[x, y, z], length units, a point of the axis", [0.0, 0.0, 0.0])
    axis: Axis = declared(..., 'its direction: "x", "y", "z" or a vector', "z")
    radius: Number = declared(..., "a length > 0", 5.0)


def _selector_kind(value: Any) -> str:
    keys = vars(value) if isinstance(value, Entry) else value
    return "<word>" if isinstance(value, str) else "<around>" if "around" in keys else "<through>"


def _some_selector(value: Any) -> Any:
    """Refuse what names no face."""
    if isinstance(value, str) or (isinstance(value, Mapping) and ("around" in value or "through" in value)):
        return value
    raise refusal("no face is named like this", found=value, allowed=SELECTORS)


Selector = Annotated[
    Annotated[str, Tag("<word>")] | Annotated[ThroughEntry, Tag("<through>")] | Annotated[AroundEntry, Tag("<around>")],
    Discriminator(_selector_kind),
    BeforeValidator(_some_selector),
]


class NormalSpreadEntry(Entry, title="Normal distribution of a size"):
    """A normal distribution of a size, by the capability of its process or by its standard deviation."""

    cp: Positive = declared(
        1.0, "capability > 0, no unit: 3 cp standard deviations from the middle to each limit", 1.33
    )
    shift: Number = declared(0.0, "of the mean from the middle, in units of half the tolerance", 0.1)
    sigma: Positive | None = declared(
        None, "standard deviation > 0 in the size's own unit, in place of cp and shift; of what is not cut off", 0.004
    )
    mean: Number | None = declared(
        None, "mean deviation from drawn in the size's own unit, goes with sigma; without it the middle", 0.001
    )
    low: Number | None = declared(
        None, "least deviation, in the size's own unit, as parts beyond are sorted out; goes with sigma", -0.01
    )
    high: Number | None = declared(None, "largest deviation, in the size's own unit; goes with sigma", 0.01)

    @model_validator(mode="after")
    def _keys_go_together(self) -> Self:
        capable = self.model_fields_set & {"cp", "shift"}
        for key in ("mean", "low", "high") if self.sigma is None else capable:
            if key in self.model_fields_set:
                allowed = "cp and shift, or sigma with mean, low and high"
                raise refusal("this does not go together", found=getattr(self, key), allowed=allowed, inside=(key,))
        return self


class SpreadEntry(
    Entry, title="Distribution of a size", json_schema_extra=one_of(("normal",), ("uniform",), ("measured",))
):
    """How a size is distributed within its tolerance: exactly one of the keys."""

    normal: NormalSpreadEntry | None = declared(
        None, "{ cp = 1.0, shift = 0.0 } or { sigma = 0.004, mean = 0.0, low = -0.01, high = 0.01 }", {"cp": 1.0}
    )
    uniform: dict[str, Number] | None = declared(
        None, "{}: every deviation of the tolerance alike; or { low = .., high = .. } in the size's own unit", {}
    )
    measured: list[Number] | None = declared(
        None, "measured deviations, lengths or shares in their own unit, each drawn alike", [0.01, -0.02, 0.005]
    )


class SizeEntry(Entry, title="Sizes", json_schema_extra=one_of(("faces",), ("scale",))):
    """One named way in which a body can come out different from drawn."""

    name: str = declared(..., "name of the size (text), once in a file", "peg width")
    body: Literal["movable", "static"] = declared(..., '"movable" or "static"', "movable")
    faces: Selector | list[Selector] | None = declared(
        None, f"the faces that move, one or a list of: {SELECTORS}", ["+x", "-x"]
    )
    each: Number | list[Number] | None = declared(
        None,
        "outward offset, from the material, of the faces of each selector a unit of the size: 0.5 for a width between "
        "two faces, -0.5 for a slot between two, -1 for one of its walls; without it 1, for one selector",
        0.5,
        [1.0, -1.0],
    )
    along: Axis | None = declared(
        None, "in place of each: the faces move together along this axis or vector, as the walls of a hole", "x"
    )
    scale: str | Point | None = declared(
        None, 'in place of faces: the body is scaled about its seed, "xyz", "x", "y", "z" or along [a, b, c]', "xyz"
    )
    tolerance: Number | Pair | str | None = declared(
        None,
        "least and largest deviation from drawn, [-0.02, 0.0], or one number for both sides; of faces a length, of a "
        "scale a share",
        0.05,
        [-0.02, 0.0],
    )
    distribution: SpreadEntry | None = declared(
        None,
        "{ normal = { cp = 1.0, shift = 0.0 } }, { normal = { sigma = 0.004, mean = 0.0 } }, { uniform = {} } or "
        "{ measured = [...] } deviations; without it normal with cp 1",
        {"normal": {"cp": 1.33}},
        {"normal": {"sigma": 0.004}},
    )

    def size(self) -> Size:
        """Return the size."""
        return Size(**self.model_dump(exclude_unset=True))


# ---------------------------------------------------------------------------------------------------------- motion


class TranslationEntry(Entry, title="Translation"):
    """A translation along a fixed axis."""

    translation: Axis = declared(
        ..., 'axis: "x", "y", "z", "-x", "-y", "-z" or a vector [x, y, z]', "z", [0.0, 1.0, 1.0]
    )

    def step(self) -> Step:
        """Return the step of a motion."""
        return Translation(self.translation)


class RotationEntry(Entry, title="Rotation"):
    """A rotation about a fixed direction through a centre."""

    rotation: Axis = declared(..., 'axis: "x", "y", "z", "-x", "-y", "-z" or a vector [x, y, z]', "z")
    centre: Literal["seed", "origin"] | Point = declared(
        ...,
        '"seed" (of the movable body, as already moved), "origin" (of the world) or [x, y, z], length units',
        "seed",
        "origin",
        [0.0, 0.0, 5.0],
    )

    def step(self) -> Step:
        """Return the step of a motion."""
        return Rotation(self.rotation, centre=self.centre)


class LineEntry(Entry, title="Line"):
    """A directed line."""

    point: Point = declared(..., "[x, y, z], length units, a point of the line", [0.0, 0.0, 0.0])
    direction: Point = declared(..., "[x, y, z], not zero; its length does not matter, no unit", [0.0, 0.0, 1.0])


class ScrewEntry(Entry, title="Screw", json_schema_extra=one_of(*((key,) for key in _PITCH_KEYS))):
    """A rotation about a directed line and a translation along it, with exactly one of the three pitch keys."""

    screw: Literal["seeds"] | LineEntry = declared(
        ...,
        '"seeds" (the line from the movable seed to the static one) or { point = [...], direction = [...] }',
        "seeds",
        {"point": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 1.0]},
    )
    pitch: Literal["free", "infinite", "-infinite"] | None = declared(
        None, '"free" (translation and angle independent), "infinite" (translation alone) or "-infinite"', "free"
    )
    pitch_per_deg: Number | None = declared(
        None, "translation for each degree of turning, a number of length units", 1.0
    )
    pitch_per_rad: Number | None = declared(
        None, "translation for each radian of turning, a number of length units", 0.25
    )

    @model_validator(mode="after")
    def _one_pitch(self) -> ScrewEntry:
        given = [key for key in _PITCH_KEYS if getattr(self, key) is not None]
        if len(given) != 1:
            allowed = 'exactly one of pitch_per_deg, pitch_per_rad, pitch = "free", "infinite" or "-infinite"'
            raise refusal("the pitch is not given once", found=", ".join(given) or "none", allowed=allowed)
        return self

    def step(self) -> Step:
        """Return the step of a motion."""
        axis = (self.screw.point, self.screw.direction) if isinstance(self.screw, LineEntry) else self.screw
        if self.pitch is not None:
            return Screw(axis, pitch=PITCHES[self.pitch])
        if self.pitch_per_deg is not None:
            return Screw(axis, pitch=math.degrees(self.pitch_per_deg))
        return Screw(axis, pitch=self.pitch_per_rad or 0.0)


class FreeEntry(Entry, title="Free motion"):
    """Any motion: a translation, and a rotation about the seed by a rotation vector."""

    free: Literal[True] = declared(..., "true: all six parameters, TX TY TZ and RX RY RZ about the movable seed", True)

    def step(self) -> Step:
        """Return the step of a motion."""
        return Free()


class OwnMotionEntry(Entry, title="Own motion"):
    """A motion of the user's own: a CasADi function of SX symbols, as text; as `Problem.to_dict` writes it."""

    casadi: str = declared(..., "the text of an fcdm_opt.OwnMotion")
    parameters: list[tuple[str, Literal["translation", "rotation"]]] = declared(
        ..., '[["TZ", "translation"], ...]: name and kind of each parameter', [["TX", "translation"]]
    )
    name: str = declared("own motion", "name in words and messages (text)", "ramp")

    def step(self) -> Step:
        """Return the step of a motion."""
        return OwnMotion.from_text(self.casadi, self.parameters, self.name)


_STEP_KEYS = ("translation", "rotation", "screw", "free", "casadi")


def _step_kind(entry: Any) -> str:
    """Tell by its first key which step an entry is; tags differ from keys so that paths can drop them."""
    return next(f"<{key}>" for key in _STEP_KEYS if key in entry)


def _some_step(entry: Any) -> Any:
    """Refuse what no step is, with a hint at the key that was probably meant."""
    steps = [key for key in _STEP_KEYS if key in entry] if isinstance(entry, Mapping) else []
    if len(steps) > 1:
        allowed = f"a table each: {', '.join(f'{{ {key} = .. }}' for key in entry if key in steps)}"
        raise refusal("several steps in one", found=entry, allowed=allowed)
    if steps:
        return entry
    hints = ((key, closest(str(key), _STEP_KEYS)) for key in (entry if isinstance(entry, Mapping) else ()))
    what = next((f": unknown key '{key}'{hint}" for key, hint in hints if hint), "")
    raise refusal(f"not a step of a motion{what}", found=entry)


StepEntry = Annotated[
    Annotated[TranslationEntry, Tag("<translation>")]
    | Annotated[RotationEntry, Tag("<rotation>")]
    | Annotated[ScrewEntry, Tag("<screw>")]
    | Annotated[FreeEntry, Tag("<free>")]
    | Annotated[OwnMotionEntry, Tag("<casadi>")],
    Discriminator(_step_kind),
    BeforeValidator(_some_step),
]


class AmountEntry(Entry, title="Own amount"):
    """A motion amount of the user's own: a CasADi function of SX symbols, as text; as `Problem.to_dict` writes it."""

    casadi: str = declared(..., "the text of an OwnAmount")


class PublishedEntry(Entry, title="Reference values"):
    """Reference values for one step of the motion."""

    translation: Number | list[Number] | None = declared(None, "a length, or a list where it has several", 0.25)
    angle_deg: Number | list[Number] | None = declared(None, "an angle in degrees, or a list", 7.0191)
    angle_rad: Number | list[Number] | None = declared(None, "an angle in radians, or a list", 0.1225)

    def values(self, step: Step) -> list[float]:
        """Return the values of the step's own parameters; raises `InputError` where the keys do not fit them."""
        kinds = [parameter.kind for parameter in step.own_parameters]
        keys = [key for key in ("angle_deg", "angle_rad") if getattr(self, key) is not None]
        given = [*(["translation"] if self.translation is not None else []), *keys]
        counts = {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)}
        words = {"translation": "translation", "rotation": "angle_deg or angle_rad"}
        allowed = " and ".join(f"{words[kind]}{f' = [{n} numbers]' if n > 1 else ''}" for kind, n in counts.items())
        shifts, degrees = _listed(self.translation), _listed(self.angle_deg)
        angles = [*map(math.radians, degrees), *_listed(self.angle_rad)]
        fixed_pitch = step.own_pitch is not None and len(shifts) <= 1
        if (
            len(keys) > 1
            or len(angles) != kinds.count("rotation")
            or (len(shifts) != kinds.count("translation") and not fixed_pitch)
        ):
            what = f"the keys do not fit this step ({step.own_words([0.0] * len(kinds)).split()[0]})"
            raise InputError(what, found=", ".join(given) or "none", allowed=allowed)
        if step.own_pitch is not None and shifts:
            _check_pitch(step.own_pitch, shifts[0], angles[0], degrees[0] if degrees else None)
        values = {"translation": iter(shifts), "rotation": iter(angles)}
        return [next(values[kind]) for kind in kinds]


def _listed(value: float | list[float] | None) -> list[float]:
    return [] if value is None else value if isinstance(value, list) else [value]


def _check_pitch(pitch: float, translation: float, angle: float, degrees: float | None) -> None:
    """Refuse a translation that differs from pitch times angle by more than the digits given leave open."""
    unit, shown = (1.0, angle) if degrees is None else (math.radians(1.0), degrees)
    slack = _half_digit(translation) + abs(pitch) * unit * _half_digit(shown)
    expected = pitch * angle
    if abs(translation - expected) > slack:
        what = "translation and angle do not agree with the screw's pitch"
        raise InputError(what, key="translation", found=translation, allowed=f"{expected:.9g}, to the digits given")


def _half_digit(x: float) -> float:
    """Return half a unit in the last decimal digit that a number is written with."""
    return 0.5 * 10.0 ** int(Decimal(repr(x)).as_tuple().exponent)
