"""A problem or an assembly as plain tables: any key can be changed, and it travels to other processes as it stands."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from fcdm_opt.curve.decision_curve import DecisionCurve
from fcdm_opt.curve.true_sizes import ROLES
from fcdm_opt.design.places import Place, check_item, parse, put, written
from fcdm_opt.errors import InputError, closest, placed
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.resizing import fit_for_sizes
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.units import same_unit
from fcdm_opt.motion.motions import Motion
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.assembly_file import AssemblyFile, PartEntry, PartSizeEntry
from fcdm_opt.problem.entries import BodyEntry, KeepOutEntry, SizeEntry, plain_body
from fcdm_opt.problem.keep_out import KeepOut, keep_outs
from fcdm_opt.problem.keys import Case, Defaults, Parts, ProblemFile, each, with_defaults
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.schema import Entry, checked, known_sizes
from fcdm_opt.problem.syntax import contents, is_assembly

REMEMBERED = 32  # bodies and scenes a process
_MESH = ("file", "unit", "file_unit", "deviation", "decomposition")
_OF_KEEP_OUTS = ("scale", "clearance")
_OF_PARTS = tuple(key for key in PartEntry.model_fields if key not in BodyEntry.model_fields)
_NOT_OF_MESH = ("seed", "name", *_OF_KEEP_OUTS)
_NO_DEFAULTS = Defaults()
_UNITS = (("_per_deg", "_per_rad"), ("_deg", "_rad"))
_EXCLUDED = {
    "target": ("requirement", "tolerance"),
    "requirement": ("target",),
    "tolerance": ("target",),
    "pitch": ("pitch_per_deg", "pitch_per_rad"),
    "pitch_per_deg": ("pitch_per_rad", "pitch"),
    "pitch_per_rad": ("pitch_per_deg", "pitch"),
    "file": ("vertices", "parts", "faces", "deviation", "facet_errors", "surfaces", "rounding", "notes"),
    "each": ("along",),
    "along": ("each",),
}
_ENCODED = json.JSONEncoder(sort_keys=True, separators=(",", ":"), allow_nan=False).encode


def canonical(data: Any) -> str:
    """Return plain data as JSON text, the same for every order of keys; raises `InputError` for nan."""
    try:
        return _ENCODED(data)
    except (TypeError, ValueError, RecursionError) as reason:
        allowed = "finite numbers, texts, truth values, lists and tables"
        raise InputError(f"no plain data: {reason}", found=data, allowed=allowed) from reason


def digest(text: str) -> str:
    """Return the sha256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def plain_value(value: Any) -> Any:
    """Return a value of a key as plain data: entries, motions and bodies too, arrays as lists, infinities as text."""
    if isinstance(value, float | int | str):  # most values by far
        return str(value) if isinstance(value, float) and math.isinf(value) else value
    if isinstance(value, Entry):
        return {
            key: plain_value(getattr(value, key)) for key in type(value).model_fields if key in value.model_fields_set
        }
    if isinstance(value, Mapping):
        return {str(key): plain_value(item) for key, item in value.items()}
    if isinstance(value, Motion):
        return [step.own_plain() for step in value.steps]
    if isinstance(value, Body):
        return plain_body(value)
    if isinstance(value, list | tuple):
        return [plain_value(item) for item in value]
    return plain_value(value.tolist()) if isinstance(value, np.ndarray | np.generic) else value


@lru_cache(maxsize=1024)
def excluded(key: str) -> tuple[str, ...]:
    """Return the keys of the same table that say the same in another way: another unit, target for requirement."""
    if key in _EXCLUDED:
        return _EXCLUDED[key]
    for one, two in chain(_UNITS, ((two, one) for one, two in _UNITS)):
        if key.endswith(one):
            return (key.removesuffix(one) + two,)
    return ()


@dataclass(frozen=True, eq=False)
class BodyTable:
    """A body or keep-out as a plain table; never changed, so that what follows from it is worked out once.

    Its `role` is "movable", "static", "keep-out 1" or the name of a part: the name of the body where none is given.
    """

    data: Mapping[str, Any]
    role: str

    @cached_property
    def checked(self) -> BodyEntry:
        """The contents as an entry, which refuses what no body has."""
        return checked(KeepOutEntry if self.data.keys() & _OF_KEEP_OUTS else BodyEntry, self.data)

    def drawn(self, sizes: Sequence[Size] = ()) -> BodyTable:
        """Return the table without a mesh file, with the body as read from it; itself where it names none."""
        # it is cut so that it can follow its sizes, which takes the surface that the file has
        if "file" not in self.data:
            return self
        stamp: tuple[int, ...] = ()
        with suppress(OSError, ValueError):  # reading it says what is wrong
            now = Path(str(self.data["file"])).expanduser().stat()
            stamp = now.st_mtime_ns, now.st_size
        return _read(canonical(self.data), self.role, stamp, tuple(own for own in sizes if own.body == self.role))

    @cached_property
    def body(self) -> Body:
        """The body itself; equal ones are built once a process."""
        return _built(canonical({key: item for key, item in self.data.items() if key not in _OF_KEEP_OUTS}), self.role)

    @property
    def bare(self) -> Mapping[str, Any]:
        """The contents without the unit of vertices, which is only shown; that of a file counts."""
        return self.data if "file" in self.data else {key: item for key, item in self.data.items() if key != "unit"}

    def with_value(self, place: Place, value: Any) -> BodyTable:
        """Return the table with a value at a place in it, or in whole."""
        # what a mesh file says is read where a place in it is changed, and forgotten where all vertices are
        if not place:
            return BodyTable(value, self.role)
        data: Mapping[str, Any] = self.data
        if "file" in data and place == ("vertices",):
            data = {key: item for key, item in data.items() if key == "unit" or key not in _MESH}
        elif "file" in data and place[0] not in (*_MESH, *_NOT_OF_MESH):
            data = self.drawn().data
        return BodyTable(put(data, place, value, dropped=excluded), self.role)


@lru_cache(maxsize=REMEMBERED)
def _read(text: str, role: str, stamp: tuple[int, ...], sizes: tuple[Size, ...]) -> BodyTable:
    """Return a body read from its mesh file, once a process; `stamp` tells the file from a later one."""
    table = BodyTable(json.loads(text), role)
    extras = {key: table.data[key] for key in ("unit", *_OF_KEEP_OUTS) if key in table.data}
    return BodyTable({**plain_body(fit_for_sizes(table.checked.body(role, None), sizes)), **extras}, role)


@lru_cache(maxsize=REMEMBERED)
def _built(text: str, role: str) -> Body:
    return checked(BodyEntry, json.loads(text)).body(role, None)


@dataclass(frozen=True, eq=False)
class SceneTables:
    """The bodies of a question, and all that its cases share, as plain tables."""

    # by their places: bodies.movable and bodies.static, or part.NAME of each part; keep_out[1] and on
    tables: Mapping[str, BodyTable]
    sizes: tuple[Mapping[str, Any], ...] = ()  # the [[size]] tables
    # of an assembly "part": name -> what it has besides a body, and "contact": the [[contact]] tables; else empty
    assembled: Mapping[str, Any] = field(default_factory=dict)
    # the curve of the last problem asked about it, which the next one finds as long as it is kept; or empty
    latest: list[DecisionCurve] = field(default_factory=list, init=False, repr=False)

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> SceneTables:
        """Return the scene of plain data with the keys bodies, or part and contact, and keep_out and size."""
        if assembled := {key: data[key] for key in ("contact",) if key in data}:
            parts = {str(table["name"]): table for table in data["part"]}
            assembled["part"] = {name: {k: x for k, x in own.items() if k in _OF_PARTS} for name, own in parts.items()}
            bare = {name: {k: x for k, x in own.items() if k not in _OF_PARTS} for name, own in parts.items()}
            bodies = {written(("part", name)): BodyTable(body, name) for name, body in bare.items()}
        else:
            bodies = {f"bodies.{role}": BodyTable(data["bodies"][role], role) for role in ROLES}
        others = enumerate(data.get("keep_out", ()), 1)
        tables = bodies | {f"keep_out[{k}]": BodyTable(table, f"keep-out {k}") for k, table in others}
        return cls(tables, tuple(data.get("size", ())), assembled)

    def to_dict(self, *, bare: bool = False) -> dict[str, Any]:
        """Return the plain data; `bare` without the unit of vertices, which is only shown."""
        tables = {place: dict(table.bare if bare else table.data) for place, table in self.tables.items()}
        others = [tables.pop(place) for place in self.tables if place.startswith("keep_out[")]
        more = {"keep_out": others} | ({"size": list(self.sizes)} if self.sizes else {})
        if not self.assembled:
            return {"bodies": dict(zip(ROLES, tables.values(), strict=True)), **more}
        rest = self.assembled["part"]
        parts = [{**body, **rest[name]} for name, body in zip(rest, tables.values(), strict=True)]
        return {"part": parts, "contact": self.assembled["contact"], **more}

    @cached_property
    def text(self) -> str:
        """The scene as canonical JSON."""
        return canonical(self.to_dict())

    @cached_property
    def key(self) -> str:
        """The sha256 of `text` without the unit of vertices: bodies of scenes with equal keys are equal."""
        return digest(canonical(self.to_dict(bare=True)))

    @cached_property
    def drawn(self) -> SceneTables:
        """The scene without mesh files; itself where there is none."""
        if all("file" not in table.data for table in self.tables.values()):
            return self
        assert self.unit  # refuses different ones
        tables = _each(self.tables, lambda table: table.drawn(self.checked_sizes))
        return SceneTables(tables, self.sizes, self.assembled)

    @cached_property
    def unit(self) -> str:
        """The unit that the bodies name, "" where none does; raises `InputError` where they differ."""
        return same_unit({place: table.data.get("unit") for place, table in self.tables.items()})

    @cached_property
    def built(self) -> Parts:
        """The bodies of a problem themselves."""
        bodies = self.bodies
        kept = {keep_out.name: keep_out for keep_out in self.kept}
        return Parts(bodies["movable"], bodies["static"], kept, self.unit, self.checked_sizes)

    @cached_property
    def bodies(self) -> dict[str, Body]:
        """The bodies but the keep-outs themselves, by roles or names of parts."""
        own = {place: table for place, table in self.tables.items() if not place.startswith("keep_out[")}
        return {own[place].role: body for place, body in _each(own, lambda table: table.body).items()}

    @cached_property
    def kept(self) -> tuple[KeepOut, ...]:
        """The keep-outs themselves."""
        own = {place: table for place, table in self.tables.items() if place.startswith("keep_out[")}
        tables = [(body, own[place].data) for place, body in _each(own, lambda table: table.body).items()]
        return keep_outs(
            [KeepOut(body, data.get("scale", 1.0), clearance=data.get("clearance", 0.0)) for body, data in tables]
        )

    @cached_property
    def checked_sizes(self) -> tuple[Size, ...]:
        """The sizes themselves; raises `InputError` for what is none."""
        kind = PartSizeEntry if self.assembled else SizeEntry
        return tuple(each("size", [lambda own=own: checked(kind, own).size() for own in self.sizes]))

    def check(self) -> None:
        """Refuse tables that are no bodies or sizes; reads and builds nothing."""
        if self.assembled:
            return
        _each(self.tables, lambda table: table.checked)
        assert len(self.checked_sizes) == len(self.sizes)  # refuses what is no size

    def with_value(self, place: Place, value: Any) -> SceneTables:
        """Return the scene with a value at a place."""
        # a place starts with bodies.movable, bodies.static, part.NAME or keep_out[k]; or with size[k] or size.NAME, and
        # has a key then; or with contact[k]
        if place[0] == "size":
            return SceneTables(self.tables, self._other_sizes(place, value), self.assembled)
        table = written(place[:2])
        if place[0] in ("part", "contact"):
            self._check_part(place)
            if place[0] == "contact" or (len(place) > 2 and place[2] in _OF_PARTS):
                return SceneTables(self.tables, self.sizes, put(self.assembled, place, value, dropped=excluded))
        if place[0] == "keep_out":
            if isinstance(place[1], str):
                allowed = "keep_out[1], ..."
                raise InputError("keep-outs are counted", key=written(place), found=place[1], allowed=allowed)
            if "keep_out[1]" not in self.tables:
                raise InputError("there are no keep-outs", key=written(place), allowed="one in the file first")
            check_item([own for own in self.tables if own.startswith("keep_out[")], place, 1)
        elif table not in self.tables:
            if self.assembled:
                allowed = f"part.NAME, of {', '.join(self.assembled['part'])}"
                raise InputError("an assembly has parts", key=written(place), found=place[0], allowed=allowed)
            role = str(place[1]) if len(place) > 1 else ""
            what = f"no such body{closest(role, ROLES)}" if role else "both bodies at once"
            raise InputError(what, key=written(place), found=role or None, allowed="bodies.movable or bodies.static")
        with placed(key=table):
            changed = {**self.tables, table: self.tables[table].with_value(place[2:], value)}
            return SceneTables(changed, self.sizes, self.assembled)

    def _check_part(self, place: Place) -> None:
        """Refuse a place that starts with part or contact, and names no part or contact there is."""
        if not self.assembled:
            allowed = "bodies.movable or bodies.static"
            raise InputError("two parts, and no assembly", key=written(place), found=place[0], allowed=allowed)
        if place[0] == "part" and (len(place) < 3 or place[1] not in self.assembled["part"]):
            name = str(place[1]) if len(place) > 1 else ""
            what = f"no such part{closest(name, self.assembled['part'])}" if len(place) > 2 else "a whole part at once"
            allowed = f"a key of part.NAME, of {', '.join(self.assembled['part'])}"
            raise InputError(what, key=written(place), found=name or None, allowed=allowed)

    def _other_sizes(self, place: Place, value: Any) -> tuple[Mapping[str, Any], ...]:
        names, rows = [str(table.get("name")) for table in self.sizes], list(self.sizes)
        if len(place) < 3:
            allowed = "a key of one size, as size.NAME.tolerance"
            raise InputError("sizes are changed one by one", key=written(place), allowed=allowed)
        if isinstance(place[1], str):
            known_sizes([place[1]], "size", names)
        else:
            check_item(rows, place, 1)
        k = names.index(place[1]) if isinstance(place[1], str) else place[1]
        rows[k] = put(rows[k], place[2:], value, dropped=excluded)
        return tuple(rows)


def _each(tables: Mapping[str, BodyTable], made: Callable[[BodyTable], Any]) -> dict[str, Any]:
    """Return what is made of each table; an error says of which one."""
    results = {}
    for place, table in tables.items():
        with placed(key=place):
            results[place] = made(table)
    return results


@lru_cache(maxsize=REMEMBERED)
def _scene(text: str) -> SceneTables:
    return SceneTables.of(json.loads(text))


@dataclass(frozen=True, eq=False)
class Question:
    """One case of a file as plain tables, defaults merged in: the scene, which others may share, and its own keys."""

    scene: SceneTables
    case: Mapping[str, Any]

    @classmethod
    def of(cls, problem: Problem | Assembly) -> Question:
        """Return the question of a problem or an assembly, in the form of its `to_dict`."""
        data = problem.to_dict()
        return cls(SceneTables.of(data), data["case"][0])

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> tuple[Question, ...]:
        """Return the questions of a file, one a case; raises `InputError` as `load_problems` and `load_assemblies`."""
        path = Path(path)
        if is_assembly(contents(path)):
            several = AssemblyFile.read(path)
            several.check(path)
            parts, kept = ([_given(own, path.parent) for own in each] for each in (several.part, several.keep_out))
            tables = {"contact": [*map(_given, several.contact)], "size": [*map(_given, several.size)]}
            scene = SceneTables.of({"part": parts, "keep_out": kept, **tables})
            return tuple(cls(scene, _given(case)) for case in several.case)
        file = ProblemFile.read(path)
        cases = file.named_cases(path).values()
        bodies, home = file.both_bodies(path)
        file.common_unit(bodies, path)
        drawn = {role: _given(getattr(bodies, role), (home or path).parent) for role in ROLES}
        others = {"keep_out": [_given(entry, path.parent) for entry in file.keep_out]}
        scene = SceneTables.of({"bodies": drawn, **others, "size": [_given(entry) for entry in file.size]})
        return tuple(cls(scene, with_defaults(_given(file.defaults_of(case)), _given(case))) for case in cases)

    @classmethod
    def restored(cls, scene: str, case: Mapping[str, Any]) -> Question:
        """Return the question of `scene.text` and `case`, as another process sends them: one scene for one text."""
        return cls(_scene(scene), case)

    @property
    def name(self) -> str:
        """Name of the case."""
        return str(self.case.get("name", ""))

    def changed(self, values: Mapping[str, Any]) -> Question:
        """Return the question with other values at some places.

        A place that starts with `bodies.`, `part.`, `contact[`, `size` or `keep_out[` is of the scene, any other of the
        case. None takes a key away, so that its default holds. Setting an angle or pitch in one unit drops the other;
        setting the target drops requirement and tolerance, and the other way round. Raises `InputError` that names a
        place whose way ends before it does, and a value that is no plain data.
        """
        scene, case = self.scene, self.case
        places = {parse(text): value for text, value in values.items()}
        prefixes = {place[: k + 1] for place in places for k in range(len(place))}
        for place, value in places.items():
            given = plain_value(value)
            if place[0] in ("bodies", "part", "contact", "size") or (place[0] == "keep_out" and len(place) > 1):
                scene = scene.with_value(place, given)
            else:
                if place[0] == "made" and len(place) > 1 and isinstance(case.get("made"), str):  # a corner, by its word
                    case = {**case, "made": plain_value(self.problem().made)}
                case = put(case, place, given, kept=prefixes, dropped=excluded)
        if not scene.assembled:
            changed = {place[0] for place in places}
            own = {key: value for key, value in case.items() if key in changed}
            case = with_defaults({key: value for key, value in case.items() if key not in changed}, own)
        return Question(scene, case)

    def drawn(self) -> Question:
        """Return the question without mesh files, the bodies as plain data."""
        return self if self.scene.drawn is self.scene else replace(self, scene=self.scene.drawn)

    def check(self) -> None:
        """Refuse keys and values that no case or body has; reads and builds nothing."""
        if self.scene.assembled:
            with _without_case_number(self.name):
                checked(AssemblyFile, {**self.scene.to_dict(), "case": [self.case]})
        else:
            self.scene.check()
            checked(Case, self.case).arguments(_NO_DEFAULTS)

    def problem(self) -> Problem | Assembly:
        """Return the problem, or assembly; raises `InputError` as these do."""
        # equal bodies are built once a process, and the decision curve found once for each scene and box
        scene = self.scene.drawn
        if scene.assembled:
            with _without_case_number(self.name):
                file = checked(AssemblyFile, {**scene.to_dict(), "case": [self.case]})
                return file.assemblies(Assembly, bodies=scene.bodies, keep_out=scene.kept)[0]
        problem = Problem(**checked(Case, self.case).asked(scene.built, _NO_DEFAULTS))
        scene.latest[:] = [problem.curve]
        return problem


@contextmanager
def _without_case_number(name: str) -> Iterator[None]:
    """Leave out of an error's key that it is about the one case there is."""
    try:
        yield
    except InputError as reason:
        key = re.sub(rf"^case\[1\]( {re.escape(repr(name))})?\.", "", reason.key or "") or None
        raise InputError(reason.what, file=reason.file, key=key, found=reason.found, allowed=reason.allowed) from reason


def _given(entry: Entry, folder: Path | None = None) -> dict[str, Any]:
    """Return what was given of an entry as plain data; the path of a mesh file starts in `folder`."""
    data: dict[str, Any] = plain_value(entry)
    if folder is not None and "file" in data:
        data["file"] = located(data["file"], folder)
    return data


def located(file: str, folder: Path) -> str:
    """Return the full path of a file that is named from a folder."""
    try:
        return os.path.abspath(folder / Path(file).expanduser())
    except RuntimeError as reason:
        raise InputError("no such home folder", key="file", found=file, allowed="the path of a file") from reason
