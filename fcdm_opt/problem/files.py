"""Problem files: TOML with the bodies and one or several cases, and the same as plain data.

The models below and in `fcdm_opt.problem.schema` are the format. A place such as `case[2] 'B'.motion[1].centre`
counts from 1, as the vertex labels in a file do.
"""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Mapping, Sequence
from functools import partial, reduce
from operator import rshift
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

import numpy as np
from pydantic import ConfigDict, Discriminator, Field, Tag, ValidationError, ValidationInfo, field_validator

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.motion.motions import Motion, Step
from fcdm_opt.problem import arguments
from fcdm_opt.problem.amounts import AMOUNTS, OwnAmount
from fcdm_opt.problem.keep_out import KeepOut, keep_outs
from fcdm_opt.problem.problem import GOALS, PAIR_STATES, PATHS, SIGNS, Problem
from fcdm_opt.problem.schema import (
    REFUSED,
    STEPS,
    AmountEntry,
    Bodies,
    Bound,
    Entry,
    KeepOutEntry,
    Number,
    Pair,
    PublishedEntry,
    StepEntry,
    closest,
    descend,
    plain,
    refusal,
)
from fcdm_opt.problem.syntax import mistake, parsed
from fcdm_opt.tolerances import DEFAULT

Read = TypeVar("Read", bound=Entry)
WORDS = {"requirement": tuple(SIGNS), "goal": GOALS, "pair": PAIR_STATES, "path": PATHS, "amount": AMOUNTS}
LARGEST_FILE = 2**26  # bytes: more than any file that is written as text; a device has no end

# ----------------------------------------------------------------------------------------------------------- cases


class Scene(NamedTuple):
    """The bodies of a file, keep-outs by name, and the unit of its lengths, "" where none is named."""

    movable: Body
    static: Body
    keep_out: Mapping[str, KeepOut]
    unit: str = ""


class Defaults(Entry):
    """What all cases of a file share; a case may give any of it anew."""

    model_config = ConfigDict(title="Defaults of all cases")

    nominal: Annotated[int, Field(strict=True, ge=1)] | Pair | Literal["drawn"] = Field(
        default="drawn",
        description='number of a switching point (from 1), a scale pair [rho_1, rho_2] or "drawn" (= [1, 1])',
        examples=[3, [1.05, 0.98], "drawn"],
    )
    tolerance: Number | Pair | tuple[Pair, Pair] | None = Field(
        default=None,
        description="tau, [tau_1, tau_2] or [[minus_1, plus_1], [minus_2, plus_2]], relative (0.02 is 2 %), >= 0 and "
        "below 1",
        examples=[0.02, [0.02, 0.01], [[0.0, 0.02], [0.01, 0.01]]],
    )
    requirement: str | None = Field(
        default=None,
        description='which way each body is off its nominal scale: "A" (+, +), "B" (+, -), "C" (-, +) or "D" (-, -)',
        json_schema_extra={"enum": [*SIGNS]},
        examples=["B"],
    )
    target: Pair | None = Field(
        default=None,
        description="[rho_1, rho_2], scales > 0 of the parts made, in place of requirement and tolerance",
        examples=[[1.02, 0.99]],
    )
    box: tuple[Pair, Pair] = Field(
        default=((0.8, 3.0), (0.8, 3.0)),
        description="[[low_1, high_1], [low_2, high_2]], scales > 0 that are shown and numbered",
        examples=[[[0.8, 1.2], [0.8, 1.2]]],
    )
    goal: str | None = Field(
        default=None,
        description='"beyond" (the tracked contact ends in the quadrant beyond the target), "at" (exactly at the '
        'target), "seat" (so that a flush contact stays flush), "touch" (the pair made touches) or "clear" (it keeps '
        'clearance); without it "beyond" at a switching point with a requirement, "seat" where the contact is flush, '
        'else "touch"',
        json_schema_extra={"enum": [*GOALS]},
        examples=["touch"],
    )
    pair: str = Field(
        default="any",
        description='"any", "clear" or "touch": required state of the target pair, besides the goal',
        json_schema_extra={"enum": [*PAIR_STATES]},
        examples=["clear"],
    )
    clearance: Number = Field(
        default=0.0, description='least gap, length units, for goal or pair "clear"', examples=[0.1]
    )
    path: str = Field(
        default="coherent",
        description='"coherent" (the tracked features stay the real contact all along the motion) or "free"',
        json_schema_extra={"enum": [*PATHS]},
        examples=["free"],
    )
    amount: Annotated[str, Field(json_schema_extra={"enum": [*AMOUNTS]})] | AmountEntry = Field(
        default="weighted",
        description='what is made least: "weighted" (root of the sum of squares), "displacement" (of the farthest '
        "vertex), or { casadi = ... }, an expression as Problem.to_dict writes it",
        examples=["displacement"],
    )
    length: Number | None = Field(
        default=None,
        description="length > 0 that turns radians into lengths; without it half the diagonal of the movable body's "
        "box",
        examples=[20.0],
    )
    weights: dict[str, Number] = Field(
        default={},
        description="{ TZ = 1.0, RZ_per_rad = 0.5 }: amount per length unit, per radian (or _per_deg)",
        examples=[{"TZ": 1.0, "RZ_per_deg": 0.5}],
    )
    limits: dict[str, tuple[Bound, Bound]] = Field(
        default={},
        description='{ TZ = [-1, 1], RZ_deg = [-10, "inf"] }: lower and upper, angles as _deg or _rad',
        examples=[{"TZ": [-1.0, 1.0], "RZ_deg": [-10.0, "inf"]}],
    )
    resolution: Number | dict[str, Number] | None = Field(
        default=None,
        description="{ TZ = 0.01, RZ_deg = 0.1 }: machine steps, angles as _deg or _rad; for lengths alone a number",
        examples=[{"TZ": 0.01, "RZ_deg": 0.1}],
    )
    features: tuple[str, str] | None = Field(
        default=None,
        description="labels of the two features to track at a switching point where more than two lines meet",
        examples=[["V1F2(P1V6; P2V2,V3,V5)", "E1E2(P1V4,V3; P2V9,V10)"]],
    )
    snap: Number = Field(
        default=DEFAULT.snap,
        description="relative distance within which a nominal pair may be closed to the curve",
        examples=[1e-06],
    )
    keep_out: list[str] | None = Field(
        default=None,
        description='names of the [[keep_out]] bodies that count: ["rib", ...]; without it all do',
        examples=[["rib"]],
    )
    motion: list[StepEntry] = Field(
        default=[],
        min_length=1,
        description="steps in order, in the case or in defaults: { translation = .. }, { rotation = .., centre = .. }, "
        "{ screw = .., pitch.. }, { free = true }",
        examples=[
            [{"translation": "z"}, {"rotation": "z", "centre": "origin"}],
            [{"screw": "seeds", "pitch_per_deg": 1.0}],
            [{"free": True}],
        ],
    )
    published: list[PublishedEntry] | None = Field(
        default=None,
        description="reference values, one table a step: { translation = ... }, { angle_deg = ... }",
        examples=[[{"translation": 0.25}, {"angle_deg": 7.0191}]],
    )
    published_text: str = Field(
        default="",
        description="the reference motion in the words of its source (text)",
        examples=["TZ 0.25 + RZ 7.0191 deg"],
    )

    @field_validator(*WORDS, "tolerance")
    @classmethod
    def _where_it_stands(cls, value: Any, info: ValidationInfo) -> Any:
        """Refuse here what `Problem` would refuse in every case that shares it."""
        key = str(info.field_name)
        try:
            if key == "tolerance":
                arguments.tolerance(value)
            elif isinstance(value, str):
                arguments.choice(value, key, WORDS[key])
        except InputError as reason:
            near = closest(value, WORDS[key]) if key in WORDS else ""
            raise refusal(f"{reason.what}{near}", found=reason.found, allowed=reason.allowed) from reason
        return value


class Case(Defaults):
    """One problem."""

    model_config = ConfigDict(title="Cases")

    name: str = Field(description="name of the case (text), once in a file", examples=["B"])

    def problem(self, scene: Scene, defaults: Defaults) -> Problem:
        """Return the problem; keys of the case come before those of `defaults`."""
        given = self.arguments(defaults)
        given["keep_out"] = _chosen(given.get("keep_out"), scene.keep_out)
        return Problem(scene.movable, scene.static, unit=scene.unit, **given)

    def arguments(self, defaults: Defaults) -> dict[str, Any]:
        """Return what is asked of any scene, as `Problem` wants it; keep-outs still by name."""
        given = {key: getattr(entry, key) for entry in (defaults, self) for key in entry.model_fields_set}
        if "motion" not in given:
            raise InputError("missing key", key="motion", allowed=str(Case.model_fields["motion"].description))
        steps = _placed("motion", [entry.step for entry in given["motion"]])
        motion = reduce(rshift, steps)
        given["motion"] = motion
        if given.get("limits"):
            ends = {key: tuple(map(float, pair)) for key, pair in given["limits"].items()}
            given["limits"] = _by_name("limits", ends, motion, ("_deg", "_rad"), _radians)
        if given.get("weights"):
            given["weights"] = _by_name("weights", given["weights"], motion, ("_per_deg", "_per_rad"), math.degrees)
        if isinstance(given.get("amount"), AmountEntry):
            names = [parameter.name for parameter in motion.parameters]
            given["amount"] = OwnAmount.from_text(given["amount"].casadi, names)
        if given.get("resolution") is not None:
            given["resolution"] = _steps(given["resolution"], motion)
        if given.get("published") is not None:
            given["published"] = _published_values(given["published"], steps)
        return given


def _chosen(names: list[str] | None, keep_out: Mapping[str, KeepOut]) -> tuple[KeepOut, ...]:
    """Return the keep-outs of these names, all for None."""
    for k, name in enumerate(names or (), 1):
        if name not in keep_out:
            what = f"no such keep-out{closest(name, keep_out)}"
            raise InputError(what, key=f"keep_out[{k}]", found=name, allowed=", ".join(keep_out) or "none is given")
    return tuple(keep_out[name] for name in (keep_out if names is None else names))


def _placed(key: str, makers: Sequence[Any]) -> list[Any]:
    """Return what the makers make; an error says which one it was."""
    made = []
    for k, maker in enumerate(makers, 1):
        try:
            made.append(maker())
        except InputError as reason:
            raise reason.within(key=f"{key}[{k}]") from reason
    return made


def _steps(given: float | dict[str, float], motion: Motion) -> float | dict[str, float]:
    """Return steps by parameter name; one number stands for lengths only, as angles carry their unit."""
    if isinstance(given, dict):
        return _by_name("resolution", given, motion, ("_deg", "_rad"), math.radians)
    turning = [name for name, kind in motion.parameters if kind == "rotation"]
    if turning:
        allowed = f"a table with a step for each parameter that is rounded: {{ {turning[0]}_deg = 0.1 }}"
        raise InputError("the unit of the angles is missing", key="resolution", found=given, allowed=allowed)
    return given


def _radians(interval: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(map(math.radians, interval))


def _by_name(
    key: str, given: Mapping[str, Any], motion: Motion, units: tuple[str, str], from_degrees: Any
) -> dict[str, Any]:
    """Return values by parameter name, in radians; angles' keys end in one of `units`, degrees first."""
    meaning: dict[str, tuple[str, Any]] = {}
    for name, kind in motion.parameters:
        suffixes = {"": None} if kind == "translation" else dict(zip(units, (from_degrees, None), strict=True))
        meaning.update({name + suffix: (name, convert) for suffix, convert in suffixes.items()})
    found: dict[str, Any] = {}
    for spelling, value in given.items():
        if spelling not in meaning:
            unit = any(name == spelling for name, _ in meaning.values())
            what = "the unit of the angle is missing" if unit else f"no such parameter{closest(spelling, meaning)}"
            raise InputError(what, key=f"{key}.{spelling}", found=spelling, allowed=", ".join(meaning))
        name, convert = meaning[spelling]
        if name in found:
            raise InputError("given twice", key=f"{key}.{spelling}", found=spelling, allowed="one unit")
        found[name] = convert(value) if convert else value
    return found


def _published_values(entries: list[PublishedEntry], steps: list[Step]) -> list[float]:
    if len(entries) != len(steps):
        raise InputError(
            "not one table for each step of the motion", key="published", found=len(entries), allowed=f"{len(steps)}"
        )
    pairs = zip(entries, steps, strict=True)
    values = _placed("published", [lambda entry=entry, step=step: entry.values(step) for entry, step in pairs])
    return [value for own in values for value in own]


# ------------------------------------------------------------------------------------------------------------ files


class ProblemFile(Entry):
    """A whole problem file."""

    model_config = ConfigDict(title="Problem file")

    title: str = Field(default="", description="title (text)", examples=["Peg in a plate"])
    note: str = Field(default="", description="what the reader should know (text)", examples=["Lengths in mm."])
    bodies: Annotated[
        Annotated[str, Tag("<file>")] | Annotated[Bodies, Tag("<bodies>")],
        Discriminator(lambda value: "<file>" if isinstance(value, str) else "<bodies>"),
    ] = Field(
        description='[bodies.movable] and [bodies.static], or the path of a file that has them: "other.toml"',
        examples=["other.toml"],
    )
    keep_out: list[KeepOutEntry] = Field(
        default=[],
        description="[[keep_out]] tables: further static bodies that the movable one must keep clear of",
        examples=[[{"file": "rib.stl", "unit": "mm"}]],
    )
    defaults: Defaults = Field(
        default=Defaults(), description="a table with any key of a case but its name", examples=[{"tolerance": 0.02}]
    )
    case: list[Case] = Field(default=[], description="[[case]] tables", examples=[[{"name": "A", "requirement": "A"}]])

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> ProblemFile:
        """Return the checked contents of a file; raises `InputError` as `load_problems`."""
        return read_entry(cls, path, "problem file", "[bodies.movable], [bodies.static] and [[case]]")

    def problems(self, file: Path | None = None) -> tuple[Problem, ...]:
        """Return a problem for each case; `file` is where the contents come from."""
        scene = self._scene(file)
        made = []
        for key, case in self.named_cases(file).items():
            try:
                made.append(case.problem(scene, self.defaults))
            except InputError as reason:
                raise self._placed(reason, case, key).within(file=file) from reason
        return tuple(made)

    def _placed(self, reason: InputError, case: Case, place: str) -> InputError:
        """Return what is wrong in a case, placed where the key stands: in the case, or in the defaults."""
        head = (reason.key or "").replace("[", ".").split(".")[0]
        if head not in self.defaults.model_fields_set - case.model_fields_set:
            return reason.within(key=place)
        what = f"for {place}: {reason.what}"
        return InputError(what, key=f"defaults.{reason.key}", found=reason.found, allowed=reason.allowed)

    def named_cases(self, file: Path | None) -> dict[str, Case]:
        """Return the cases by their places in the file; raises where there is none, or two have one name."""
        if not self.case:
            raise InputError("there is no case", file=file, key="case", allowed="one [[case]] table or more")
        placed: dict[str, Case] = {}
        names: dict[str, int] = {}
        for k, case in enumerate(self.case, 1):
            key = f"case[{k}] {case.name!r}"
            if not case.name.isprintable():
                allowed = "letters, digits and signs that can be printed"
                raise InputError("a name with control characters", file=file, key=key, allowed=allowed)
            if names.setdefault(case.name, k) != k:
                raise InputError(
                    f"the name is that of case[{names[case.name]}]",
                    file=file,
                    key=f"{key}.name",
                    found=case.name,
                    allowed="a name that no other case has",
                )
            placed[key] = case
        return placed

    def _scene(self, file: Path | None) -> Scene:
        """Return the bodies; a mesh file's path starts where the entry stands that names it."""
        bodies, home = self.both_bodies(file)
        unit = self.common_unit(bodies, file)
        try:
            movable, static = bodies.both(home and home.parent)
        except InputError as reason:
            raise reason.within(file=home) from reason
        folder = file and file.parent
        try:
            makers = [partial(entry.keep_out, f"keep-out {k}", folder) for k, entry in enumerate(self.keep_out, 1)]
            others = keep_outs(_placed("keep_out", makers))
        except InputError as reason:
            raise reason.within(file=file) from reason
        return Scene(movable, static, {keep_out.name: keep_out for keep_out in others}, unit)

    def both_bodies(self, file: Path | None) -> tuple[Bodies, Path | None]:
        """Return the entries of both bodies, and the file that they stand in."""
        bodies, home = self.bodies, file
        if isinstance(bodies, str):
            if file is None:
                raise InputError("there is no file to start from", key="bodies", found=bodies, allowed="both bodies")
            home = file.parent / bodies
            try:
                bodies = ProblemFile.read(home).bodies
            except InputError as reason:
                raise InputError(f"its bodies cannot be taken: {reason}", file=file, key="bodies") from reason
            if isinstance(bodies, str):
                raise InputError(
                    "that file has no bodies of its own",
                    file=file,
                    key="bodies",
                    found=bodies,
                    allowed="a file with [bodies.movable] and [bodies.static]",
                )
        return bodies, home

    def common_unit(self, bodies: Bodies, file: Path | None) -> str:
        """Return the unit that bodies name, "" where none does; refuse different ones."""
        entries = {"bodies.movable": bodies.movable, "bodies.static": bodies.static}
        entries |= {f"keep_out[{k}]": entry for k, entry in enumerate(self.keep_out, 1)}
        return same_unit({place: entry.unit for place, entry in entries.items()}, file)


def same_unit(given: Mapping[str, str | None], file: Path | None) -> str:
    """Return the unit that bodies, by their places, name; "" where none does. Refuse different ones."""
    units = {place: unit for place, unit in given.items() if unit is not None}
    first = next(iter(units), "")
    for place, unit in units.items():
        if unit != units[first]:
            raise InputError(
                "the bodies come in different units",
                file=file,
                key=f"{place}.unit",
                found=f"{place} in {unit}, {first} in {units[first]}",
                allowed="one unit for all bodies; file_unit says what a mesh file is in",
            )
    return units.get(first, "")


def load_problems(path: str | os.PathLike[str]) -> tuple[Problem, ...]:
    """Return the problems of a file, one for each case.

    Parameters
    ----------
    path : path
        A problem file (TOML).

    Raises
    ------
    InputError
        Names the file, the key, what was found and what is allowed; the first thing that is wrong.
    """
    return ProblemFile.read(path).problems(Path(path))


def read_entry(model: type[Read], path: str | os.PathLike[str], kind: str, needed: str) -> Read:
    """Return the checked contents of a TOML file; `kind` and `needed` say what it is and must have."""
    file = Path(path)
    try:
        with file.open("rb") as stream:
            content = stream.read(LARGEST_FILE + 1)
        if len(content) > LARGEST_FILE:
            raise InputError(
                "the file is too large", file=file, allowed=f"a {kind} (TOML) of at most {LARGEST_FILE} bytes"
            )
        text = content.decode("utf-8-sig")  # some editors begin a file with a mark
        data = parsed(text)
    except tomllib.TOMLDecodeError as reason:
        raise InputError(f"not valid TOML: {mistake(text, reason)}", file=file) from reason
    except UnicodeDecodeError as reason:
        raise InputError("not a text file in UTF-8", file=file, found=reason.object[reason.start]) from reason
    except InputError:
        raise
    except (RecursionError, ValueError) as reason:  # nested too deep, numbers too long, a path with a null
        raise InputError(f"the file cannot be read: {str(reason)[:100]}", file=repr(str(file))) from reason
    except OSError as reason:
        allowed = f"a readable {kind} (TOML)"
        raise InputError("the file cannot be read", file=file, found=reason.strerror, allowed=allowed) from reason
    if not data:
        raise InputError("the file is empty", file=file, allowed=needed)
    try:
        return checked(model, data, file)
    except RecursionError as reason:
        raise InputError("tables nested too deep", file=file, allowed=f"the keys of a {kind}") from reason


def checked(model: type[Read], data: Mapping[str, Any], file: Path | None = None) -> Read:
    """Return plain data as an entry; raises `InputError` that names the place in it."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        detail = next(item for item in error.errors(include_url=False) if item["type"] == REFUSED)
        context = detail["ctx"]
        inside, _ = descend(data, detail["loc"])
        where = (*inside, *context["inside"])
        place = _path(where, data) or None
        raise InputError(
            context["what"], file=file, key=place, found=context["found"], allowed=context["allowed"]
        ) from error


def _path(place: Sequence[Any], data: Mapping[str, Any]) -> str:
    """Return a place in words: `case[2] 'B'.motion[1].centre`."""
    text = ""
    for item in place:
        text += f"[{item + 1}]" if isinstance(item, int) else f".{item}"
    if len(place) > 1 and place[0] == "case" and isinstance(place[1], int):
        case = data["case"][place[1]]
        name = case.get("name") if isinstance(case, Mapping) else None
        head = f".case[{place[1] + 1}]"
        text = f"{head} {name!r}{text[len(head) :]}" if isinstance(name, str) else text
    return text.removeprefix(".")


# ------------------------------------------------------------------------------------------------------- plain data


def problem_from_dict(data: Mapping[str, Any]) -> Problem:
    """Return the problem of plain data with the keys of a one-case file; see `Problem.from_dict`."""
    problems = checked(ProblemFile, data).problems()
    if len(problems) > 1:
        raise InputError("more than one case", key="case", found=len(problems), allowed="one")
    return problems[0]


def problem_to_dict(problem: Problem) -> dict[str, Any]:
    """Return a problem as plain data; see `Problem.to_dict`."""
    asked = problem.request
    kinds = dict(problem.motion.parameters)
    keys = [key for key in Case.model_fields if key != "keep_out" and asked[key] is not None and asked[key] != {}]
    case = {key: plain(asked[key]) for key in keys}
    case["motion"] = [STEPS[type(step)].plain(step) for step in problem.motion.steps]
    if isinstance(asked["amount"], OwnAmount):
        case["amount"] = {"casadi": asked["amount"].text}
    if asked["features"] is not None:
        case["features"] = list(asked["features"])
    for key, suffix in (("limits", "_rad"), ("weights", "_per_rad"), ("resolution", "_rad")):
        if key in case:
            case[key] = {n + suffix * (kinds[n] == "rotation"): plain(value) for n, value in asked[key].items()}
    if asked["published"] is not None:
        case["published"] = _published_entries(problem)
    others = [
        {**plain_body(keep_out.body), "scale": plain(keep_out.scale), "clearance": keep_out.clearance}
        for keep_out in problem.keep_out
    ]
    unit = {"unit": problem.unit} if problem.unit else {}
    bodies = {"movable": {**plain_body(problem.movable), **unit}, "static": {**plain_body(problem.static), **unit}}
    return {"bodies": bodies, **({"keep_out": others} if others else {}), "case": [case]}


def _published_entries(problem: Problem) -> list[dict[str, Any]]:
    entries, values = [], iter(problem.request["published"])
    for step in problem.motion.steps:
        entry: dict[str, Any] = {}
        for _, kind in step.own_parameters:
            entry.setdefault("translation" if kind == "translation" else "angle_rad", []).append(next(values))
        entries.append({key: own if len(own) > 1 else own[0] for key, own in entry.items()})
    return entries


def plain_body(body: Body) -> dict[str, Any]:
    """Return a body as drawn, as plain data; `parts` only where the hull of all vertices would not do."""
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
    if any(body.deviation):
        entry["deviation"] = list(body.deviation)
    if body.notes:
        entry["notes"] = list(body.notes)
    return {**entry, "faces": [list(face) for face in body.outlines], "seed": body.seed.tolist()}
