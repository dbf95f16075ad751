"""What can be asked of two parts: every key of a problem, declared once, and the files that hold them.

A key is a field: its type says what is allowed, its description what it means. Reading a file, the arguments of
`Problem`, the JSON Schema, the reference page and all messages follow from it. A key that looks alike in Python and in
a file is one entry in `Defaults`; one that does not has its other form in `Arguments`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import reduce
from operator import rshift
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Discriminator, Tag, WrapValidator

from fcdm_opt import pacing, process_pool
from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError, closest, known_word, placed
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.units import UnitOrNone, same_unit
from fcdm_opt.motion.motions import Motion, Step
from fcdm_opt.problem.amounts import AmountWord, OwnAmount
from fcdm_opt.problem.entries import AmountEntry, Bodies, BodyEntry, KeepOutEntry, PublishedEntry, SizeEntry, StepEntry
from fcdm_opt.problem.keep_out import KeepOut, keep_outs
from fcdm_opt.problem.schema import (
    Bound,
    Entry,
    Label,
    Length,
    Number,
    Pair,
    Positive,
    Real,
    ScaleRange,
    Scales,
    checked,
    declared,
    must,
    read_entry,
    refusal,
)
from fcdm_opt.tolerances import DEFAULT

Made = TypeVar("Made")
MOST_BITS = 10_000  # of a whole number that Python writes in decimals
Requirement = Literal["A", "B", "C", "D"]
Goal = Literal["beyond", "at", "seat", "touch", "clear", "fit"]
PairState = Literal["any", "clear", "touch"]
PathWord = Literal["coherent", "free"]
Corner = Literal["worst", "loosest", "low", "high", "middle"]


def _shares(tolerance: Any) -> Any:
    """Refuse a tolerance that is no share of the size; one in percent is told what it is."""
    given = np.ravel(0.0 if tolerance is None else tolerance)
    if given.max() >= 1.0:
        large = given.max()
        meant = f": {large:g} % is {large / 100.0:g}" if large < 100.0 else ""
        raise refusal(f"a tolerance is a share, below 1{meant}", found=tolerance)
    if given.min() < 0.0:
        raise refusal("unusable tolerance", found=tolerance)
    return tolerance


Place = tuple[Real, Real, Real]
Shares = Annotated[Number | Pair | tuple[Pair, Pair], AfterValidator(_shares)]

# ----------------------------------------------------------------------------------------------------------------- keys


class SizeKeys(Entry):
    """Which sizes are nominal, and which are made."""

    nominal: Label | Scales | Literal["drawn"] = declared(
        "drawn",
        'number of a switching point (from 1), a scale pair [rho_1, rho_2] or "drawn" (= [1, 1])',
        3,
        [1.05, 0.98],
        "drawn",
    )
    tolerance: Shares | None = declared(
        None,
        "tau, [tau_1, tau_2] or [[minus_1, plus_1], [minus_2, plus_2]], relative (0.02 is 2 %), finite, "
        ">= 0 and below 1",
        0.02,
        [0.02, 0.01],
        [[0.0, 0.02], [0.01, 0.01]],
    )
    requirement: Requirement | None = declared(
        None, 'which way each body is off its nominal scale: "A" (+, +), "B" (+, -), "C" (-, +) or "D" (-, -)', "B"
    )
    target: Scales | None = declared(
        None, "[rho_1, rho_2], scales > 0 of the parts made, in place of requirement and tolerance", [1.02, 0.99]
    )
    box: tuple[ScaleRange, ScaleRange] = declared(
        ((0.8, 3.0), (0.8, 3.0)),
        "[[low_1, high_1], [low_2, high_2]], 0 < low < high: scales that are shown and numbered",
        [[0.8, 1.2], [0.8, 1.2]],
    )


class Defaults(SizeKeys, title="Defaults of all cases"):
    """What all cases of a file share; a case may give any of it anew."""

    made: Corner | dict[str, Number] | None = declared(
        None,
        'deviations from drawn of the [[size]] tables by name, 0 where none is given; or "worst" (least gap at rest '
        'within the tolerances), "loosest" (largest), "low", "high", "middle" (all sizes); the parts made so are then '
        "what scales 1 are of, and the target is [1, 1] unless one is given",
        {"peg width": 0.01, "shrinkage": -0.001},
        "worst",
    )

    goal: Goal | None = declared(
        None,
        '"beyond" (the tracked contact ends in the quadrant beyond the target), "at" (exactly at the '
        'target), "seat" (so that a flush contact stays flush), "touch" (the pair made touches), "clear" (it keeps '
        'clearance) or "fit" (the largest gap of several contacts is least); without it "at" with contacts, "beyond" '
        'at a switching point with a requirement, "seat" where the contact is flush, else "touch"',
        "touch",
    )
    pair: PairState = declared(
        "any", '"any", "clear" or "touch": required state of the target pair, besides the goal', "clear"
    )
    clearance: Length = declared(0.0, 'least gap >= 0, length units, for goal or pair "clear"', 0.1)
    path: PathWord | None = declared(
        None,
        '"coherent" (the tracked features stay the real contact all along the motion) or "free"; without it "coherent" '
        "where one contact is tracked, as several are restored at the end of the motion alone",
        "free",
    )
    amount: Annotated[
        Annotated[AmountWord, Tag("<word>")] | Annotated[AmountEntry, Tag("<casadi>")],
        Discriminator(lambda value: "<word>" if isinstance(value, str) else "<casadi>"),
    ] = declared(
        "weighted",
        'what is made least: "weighted" (root of the sum of squares), "displacement" (of the farthest '
        "vertex), or { casadi = ... }, an expression as Problem.to_dict writes it",
        "displacement",
    )
    length: Positive | None = declared(
        None, "length > 0 that turns radians into lengths; without it half the diagonal of the movable body's box", 20.0
    )
    weights: dict[str, Number] = declared(
        {},
        "{ TZ = 1.0, RZ_per_rad = 0.5 }: amount per length unit, per radian (or _per_deg)",
        {"TZ": 1.0, "RZ_per_deg": 0.5},
    )
    limits: dict[str, tuple[Bound, Bound]] = declared(
        {},
        '{ TZ = [-1, 1], RZ_deg = [-10, "inf"] }: lower and upper, angles as _deg or _rad',
        {"TZ": [-1.0, 1.0], "RZ_deg": [-10.0, "inf"]},
    )
    resolution: Number | dict[str, Number] | None = declared(
        None,
        "{ TZ = 0.01, RZ_deg = 0.1 }: machine steps, angles as _deg or _rad; for lengths alone a number",
        {"TZ": 0.01, "RZ_deg": 0.1},
    )
    features: tuple[str, str] | None = declared(
        None,
        "labels of the two features to track at a switching point where more than two lines meet: two labels such as "
        "V1F2(P1V6; P2V2,V3,V5)",
        ["V1F2(P1V6; P2V2,V3,V5)", "E1E2(P1V4,V3; P2V9,V10)"],
    )
    contacts: Literal["all"] | list[str] | None = declared(
        None,
        '"all", or labels of nominal contacts that goal "at", "seat" or "fit" restores together: ["V1F2(P1V6; '
        'P2V2,V3,V5)", ...]; without it, or with [] where defaults have it, the one tracked, all of them with "made"',
        "all",
        ["V1F2(P1V6; P2V2,V3,V5)", "V1F2(P1V1; P2V2,V3,V5)"],
    )
    exact_at: dict[str, list[Place]] | None = declared(
        None,
        'points of round faces, [x, y, z], length units, by "movable" and "static", at which parts are exact, and '
        "elsewhere within the true ones; a solution names those that it needs",
        {"movable": [[10.0, 0.0, 5.0]], "static": []},
    )
    snap: Length = declared(
        DEFAULT.snap, "relative distance >= 0 within which a nominal pair may be closed to the curve", 1e-06
    )
    keep_out: list[str] | None = declared(
        None, 'names of the [[keep_out]] bodies that count: ["rib", ...]; without it all do', ["rib"]
    )
    motion: list[StepEntry] = declared(
        [],
        "steps in order, in the case or in defaults: { translation = .. }, { rotation = .., centre = .. }, "
        "{ screw = .., pitch.. }, { free = true }",
        [{"translation": "z"}, {"rotation": "z", "centre": "origin"}],
        [{"screw": "seeds", "pitch_per_deg": 1.0}],
        [{"free": True}],
        min_length=1,
    )
    published: list[PublishedEntry] | None = declared(
        None,
        "reference values, one table a step: { translation = ... }, { angle_deg = ... }",
        [{"translation": 0.25}, {"angle_deg": 7.0191}],
    )
    published_text: str = declared(
        "", "the reference motion in the words of its source (text)", "TZ 0.25 + RZ 7.0191 deg"
    )


class Parts(NamedTuple):
    """The bodies of a file, keep-outs by name, and the unit of its lengths, "" where none is named."""

    movable: Body
    static: Body
    keep_out: Mapping[str, KeepOut]
    unit: str = ""
    sizes: tuple[Size, ...] = ()


class Case(Defaults, title="Cases"):
    """One problem."""

    name: str = declared(..., "name of the case (text), once in a file", "B")

    def asked(self, parts: Parts, defaults: Defaults) -> dict[str, Any]:
        """Return the arguments of `Problem`; keys of the case come before those of `defaults`."""
        given = self.arguments(defaults)
        return {
            **given,
            "movable": parts.movable,
            "static": parts.static,
            "keep_out": _chosen(given.get("keep_out"), parts.keep_out),
            "unit": parts.unit,
            "sizes": parts.sizes,
        }

    def arguments(self, defaults: Defaults) -> dict[str, Any]:
        """Return what is asked of any scene, as `Problem` wants it; keep-outs still by name."""
        given = with_defaults(*({key: getattr(own, key) for key in own.model_fields_set} for own in (defaults, self)))
        motion = given["motion"] = self.moved(defaults)
        if isinstance(given.get("amount"), AmountEntry):
            given["amount"] = OwnAmount.from_text(given["amount"].casadi, motion.names)
        if isinstance(given.get("resolution"), float):
            turning = [name for name, kind in motion.parameters if kind == "rotation"]
            if turning:
                what, allowed = "the unit of the angles is missing", f"{{ {turning[0]}_deg = 0.1 }}"
                allowed = f"a table with a step for each parameter that is rounded: {allowed}"
                raise InputError(what, key="resolution", found=given["resolution"], allowed=allowed)
        for key in BY_PARAMETER:
            if isinstance(given.get(key), Mapping):
                given[key] = by_name(key, given[key], motion)
        if given.get("published") is not None:
            given["published"] = _published_values(given["published"], motion.steps)
        return given

    def moved(self, defaults: Defaults) -> Motion:
        """Return the motion, its own or that of `defaults`; raises `InputError` where neither is one."""
        if not (entries := self.motion or defaults.motion):
            raise InputError("missing key", key="motion", allowed=str(Case.model_fields["motion"].description))
        return reduce(rshift, each("motion", [entry.step for entry in entries]))


RESTORING_GOALS = (None, "at", "seat", "fit")
"""Goals that restore several contacts together; without one it is "at"."""


def with_defaults(defaults: Mapping[str, Any], case: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of a case and the defaults: whose tolerance goes with a requirement alone."""
    # and whose contacts go with the goals and the pair that restore them together, and clearance with what is "clear"
    given = {**defaults, **case}
    restoring = given.get("goal") in RESTORING_GOALS and given.get("pair") != "clear"
    if case.get("contacts") == [] or ("contacts" not in case and not restoring):
        given.pop("contacts", None)
    state = given.get("goal"), given.get("pair")
    if "clearance" not in case and ("clear" not in state or "touch" in state):
        given.pop("clearance", None)
    if ("made" in given or "target" in case) and "requirement" not in given and "tolerance" not in case:
        given.pop("tolerance", None)
    return given


class Angle(NamedTuple):
    """How keys of angles end in a file, in degrees and in radians, and what makes radians of degrees."""

    degrees: str
    radians: str
    converted: Callable[[Any], Any]


def _radians(value: float | tuple[float, ...]) -> Any:
    return tuple(map(math.radians, value)) if isinstance(value, tuple) else math.radians(value)


BY_PARAMETER = {
    "weights": Angle("_per_deg", "_per_rad", math.degrees),
    "limits": Angle("_deg", "_rad", _radians),
    "resolution": Angle("_deg", "_rad", _radians),
}
"""Keys with a value for each parameter of the motion."""


def of_kind(kind: type, example: str = "") -> BeforeValidator:
    """Return the check that an argument is of a kind."""

    def check(value: Any) -> Any:
        if not isinstance(value, kind):
            found = value if isinstance(value, str) else type(value).__name__
            raise refusal("wrong kind of argument", found=found, allowed=f"a {kind.__name__}{example}")
        return value

    return BeforeValidator(check)


_NoneIsEmpty = BeforeValidator(lambda value: {} if value is None else value)
_Tuple = BeforeValidator(lambda values: tuple(values) if isinstance(values, list) else values)


def _ordered(value: Any, handler: Any) -> Any:
    """Refuse limits that nothing lies between."""
    ends = handler(value)
    if not (ends[0] <= ends[1] and ends[0] < math.inf and ends[1] > -math.inf):
        raise refusal("unusable limits", found=value, allowed="(lower, upper) with lower <= upper")
    return ends


_Interval = Annotated[tuple[Bound, Bound], WrapValidator(_ordered)]


class Arguments(Case):
    """The arguments of `Problem`: the keys of a case, with values of Python where a file has tables."""

    name: str = declared("", "name of the case, a string")
    amount: Any = "weighted"
    weights: Annotated[dict[str, Positive], _NoneIsEmpty] = declared(
        {}, "a number > 0 by parameter, amount per length unit or radian"
    )
    limits: Annotated[dict[str, _Interval], _NoneIsEmpty] = declared(
        {}, "(lower, upper) by parameter with lower <= upper, length units or radians"
    )
    resolution: Annotated[dict[str, Positive], must(bool, "no step")] | None = declared(
        None, "a number > 0, or steps > 0 by parameter, length units or radians"
    )
    keep_out: Any = ()
    motion: Annotated[Any, of_kind(Motion, ', as fo.Translation("x") >> fo.Rotation("z")')] = declared(..., "a Motion")
    published: tuple[Real, ...] | None = declared(  # type: ignore[assignment]
        None, "a finite number for each parameter, length units or radians"
    )
    movable: Annotated[Any, of_kind(Body)] = declared(..., "a Body")
    static: Annotated[Any, of_kind(Body)] = declared(..., "a Body")
    sizes: Annotated[tuple[Annotated[Any, of_kind(Size)], ...], _Tuple] = declared((), "Sizes")
    unit: UnitOrNone = declared("", '"m", "cm", "mm", "um", "in", "ft" or ""')


ARGUMENTS = ("movable", "static", *(key for key in Arguments.model_fields if key not in ("movable", "static")))
"""The arguments of `Problem`, in order."""


def checked_arguments(model: type[Entry], given: Mapping[str, Any]) -> Any:
    """Return arguments as an entry; raises `InputError` that names the argument."""

    def placed(place: Sequence[Any], given: Mapping[str, Any]) -> str:
        return ".".join(item for item in place if isinstance(item, str))  # an item of a sequence has no name of its own

    return checked(model, {key: _bare(value) for key, value in given.items()}, placed=placed)


def _bare(value: Any) -> Any:
    """Return arrays and numbers of NumPy as Python's, features as their labels, numbers too long to print in words."""
    if isinstance(value, int) and value.bit_length() > MOST_BITS:
        return "a whole number of too many digits"
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Feature):
        return value.label
    if isinstance(value, Mapping):
        return {key: _bare(item) for key, item in value.items()}
    return type(value)(map(_bare, value)) if type(value) in (list, tuple) else value


# ----------------------------------------------------------------------------------------------------- cases of a file


def _chosen(names: list[str] | None, keep_out: Mapping[str, KeepOut]) -> tuple[KeepOut, ...]:
    """Return the keep-outs of these names, all for None."""
    for k, name in enumerate(names or (), 1):
        known_word(name, keep_out, "no such keep-out", key=f"keep_out[{k}]")
    return tuple(keep_out[name] for name in (keep_out if names is None else names))


def each(key: str, makers: Sequence[Any]) -> list[Any]:
    """Return what the makers make; an error says which one it was."""
    made = []
    for k, maker in enumerate(makers, 1):
        with placed(key=f"{key}[{k}]"):
            made.append(maker())
    return made


def read_keep_outs(entries: Sequence[KeepOutEntry], file: Path | None) -> list[KeepOut]:
    """Return the bodies of [[keep_out]] tables of a file."""
    numbered, folder = enumerate(entries, 1), file and file.parent
    return each("keep_out", [lambda k=k, own=own: own.keep_out(f"keep-out {k}", folder) for k, own in numbered])


def _spellings(key: str, motion: Motion) -> dict[str, tuple[str, Any]]:
    """Return which parameters the keys of values by parameter mean, and what converts their values."""
    angle, meaning = BY_PARAMETER[key], dict[str, tuple[str, Any]]()
    for name, kind in motion.parameters:
        suffixes = {"": None} if kind == "translation" else {angle.degrees: angle.converted, angle.radians: None}
        meaning.update({name + suffix: (name, convert) for suffix, convert in suffixes.items()})
    return meaning


def by_name(key: str, given: Mapping[str, Any], motion: Motion) -> dict[str, Any]:
    """Return values by parameter name, in radians; the keys of angles say their unit."""
    meaning, found = _spellings(key, motion), dict[str, Any]()
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


def _published_values(entries: list[PublishedEntry], steps: Sequence[Step]) -> list[float]:
    if len(entries) != len(steps):
        what = "not one table for each step of the motion"
        raise InputError(what, key="published", found=len(entries), allowed=f"{len(steps)}")
    pairs = zip(entries, steps, strict=True)
    values = each("published", [lambda entry=entry, step=step: entry.values(step) for entry, step in pairs])
    return [value for own in values for value in own]


# ------------------------------------------------------------------------------------------------------------ files


class ProblemFile(Entry, title="Problem file"):
    """A whole problem file."""

    title: str = declared("", "title (text)", "Peg in a plate")
    note: str = declared("", "what the reader should know (text)", "Lengths in mm.")
    bodies: Annotated[
        Annotated[str, Tag("<file>")] | Annotated[Bodies, Tag("<bodies>")],
        Discriminator(lambda value: "<file>" if isinstance(value, str) else "<bodies>"),
    ] = declared(
        ..., '[bodies.movable] and [bodies.static], or the path of a file that has them: "other.toml"', "other.toml"
    )
    keep_out: list[KeepOutEntry] = declared(
        [],
        "[[keep_out]] tables: further static bodies that the movable one must keep clear of",
        [{"file": "rib.stl", "unit": "mm"}],
    )
    size: list[SizeEntry] = declared(
        [],
        "[[size]] tables: ways in which a part can come out different from drawn",
        [{"name": "width", "body": "movable", "faces": ["+x", "-x"], "each": 0.5, "tolerance": 0.05}],
    )
    defaults: Defaults = declared(Defaults(), "a table with any key of a case but its name", {"tolerance": 0.02})
    case: list[Case] = declared([], "[[case]] tables", [{"name": "A", "requirement": "A"}])

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> ProblemFile:
        """Return the checked contents of a file; raises `InputError` as `load_problems`."""
        return read_entry(cls, path, "problem file", "[bodies.movable], [bodies.static] and [[case]]")

    def problems(
        self,
        made_of: Callable[..., Made],
        file: Path | None = None,
        wanted: Container[str] = (),
        refused: list[tuple[str, InputError]] | None = None,
    ) -> tuple[Made, ...]:
        """Return what `Problem` makes of the arguments of each case, or of those wanted; contents come from `file`."""
        # `refused` gets the name of a case that cannot be made, and why; without it, that ends all
        cases = self.named_cases(file)
        used = set[str]()
        for key, case in cases.items():  # what is wrong there is said before meshes are read
            with self._placing(case, key, file):
                used |= case.arguments(self.defaults_of(case)).keys()
        if self.defaults.clearance and "clearance" not in used:
            what, allowed = "no case asks for this clearance", '0, or goal = "clear", or pair = "clear", of some case'
            raise InputError(what, file=file, key="defaults.clearance", found=self.defaults.clearance, allowed=allowed)
        parts, made = self._parts(file), list[Made]()
        for key, case in cases.items():
            if wanted and case.name not in wanted:
                continue
            pacing.at(f"looking how the parts of case {case.name} lie")
            pacing.check()
            try:
                with self._placing(case, key, file):
                    made.append(made_of(**case.asked(parts, self.defaults_of(case))))
            except InputError as reason:
                if refused is None:
                    raise
                refused.append((case.name, reason))
        return tuple(made)

    def defaults_of(self, case: Case) -> Defaults:
        """Return the defaults of a case, without values of parameters that the motions of other cases alone have.

        And without a target or a requirement, where the case has the other one.
        """
        kept, motions = dict[str, Any](), dict[str, Motion]()
        for key, other in (("requirement", "target"), ("target", "requirement")):
            if getattr(case, key) is not None and getattr(case, other) is None:
                kept[other] = None
        for own in self.case:
            with suppress(InputError):  # which is told of that case
                motions[own.name] = own.moved(self.defaults)
        for key in BY_PARAMETER if case.name in motions else ():
            if isinstance(given := getattr(self.defaults, key), Mapping) and given:
                known = _spellings(key, motions[case.name])
                others = {name for motion in motions.values() for name in _spellings(key, motion)} - known.keys()
                kept[key] = {name: x for name, x in given.items() if name not in others} or (
                    None if key == "resolution" else {}
                )
        found = self.defaults.model_copy(update=kept)
        found.model_fields_set.difference_update(key for key in ("requirement", "target") if key in kept)
        return found

    @contextmanager
    def _placing(self, case: Case, key: str, file: Path | None) -> Iterator[None]:
        try:
            yield
        except InputError as reason:
            raise self._placed(reason, case, key).within(file=file) from reason

    def _placed(self, reason: InputError, case: Case, place: str) -> InputError:
        """Return what is wrong in a case, placed where the key stands: in the case, or in the defaults."""
        head = (reason.key or "").replace("[", ".").split(".")[0]
        if head.startswith("size '"):  # which all cases share
            return reason
        if head not in self.defaults.model_fields_set - case.model_fields_set:
            return reason.within(key=place)
        what = f"for {place}: {reason.what}"
        return InputError(what, key=f"defaults.{reason.key}", found=reason.found, allowed=reason.allowed)

    def named_cases(self, file: Path | None) -> dict[str, Case]:
        """Return the cases by their places in the file; raises where there is none, or two have one name."""
        if not self.case:
            raise InputError("there is no case", file=file, key="case", allowed="one [[case]] table or more")
        with placed(file=file):
            return unlike_names("case", self.case)

    def _parts(self, file: Path | None) -> Parts:
        """Return the bodies; a mesh file's path starts where the entry stands that names it."""
        bodies, home = self.both_bodies(file)
        unit = self.common_unit(bodies, file)
        folder = home and home.parent

        def read(own: tuple[str, BodyEntry]) -> Body:
            role, entry = own
            with placed(file=home, key=f"bodies.{role}"):
                return entry.body(role, folder)

        with placed(file=file):
            sizes = each("size", [entry.size for entry in self.size])
        movable, static = bodies
        files = (Path(folder or "") / str(entry.file) for _, entry in (movable, static))
        both = process_pool.both(read, (movable, static), files)
        with placed(file=file):
            kept = {keep_out.name: keep_out for keep_out in keep_outs(read_keep_outs(self.keep_out, file))}
            return Parts(both[0], both[1], kept, unit, tuple(sizes))

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
                what = "that file has no bodies of its own"
                allowed = "a file with [bodies.movable] and [bodies.static]"
                raise InputError(what, file=file, key="bodies", found=bodies, allowed=allowed)
        return bodies, home

    def common_unit(self, bodies: Bodies, file: Path | None) -> str:
        """Return the unit that bodies name, "" where none does; refuse different ones."""
        entries = {"bodies.movable": bodies.movable, "bodies.static": bodies.static}
        entries |= {f"keep_out[{k}]": entry for k, entry in enumerate(self.keep_out, 1)}
        return same_unit({place: entry.unit for place, entry in entries.items()}, file)


def unlike_names(table: str, entries: Sequence[Any]) -> dict[str, Any]:
    """Return tables by their places in the file; refuses two of one name, and names that cannot be printed."""
    found: dict[str, Any] = {}
    names: dict[str, int] = {}
    for k, entry in enumerate(entries, 1):
        key = f"{table}[{k}] {entry.name!r}"
        if not entry.name.isprintable():
            allowed = "letters, digits and signs that can be printed"
            raise InputError("a name with control characters", key=key, allowed=allowed)
        if names.setdefault(entry.name, k) != k:
            what = f"the name is that of {table}[{names[entry.name]}]"
            raise InputError(what, key=f"{key}.name", found=entry.name, allowed=f"a name that no other {table} has")
        found[key] = entry
    return found
