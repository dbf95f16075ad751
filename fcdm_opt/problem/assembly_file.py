"""Files of assemblies (TOML): parts, contacts, sizes, and cases of what was made."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Container, Mapping, Sequence
from functools import reduce
from operator import rshift
from pathlib import Path
from typing import Any, Literal

from fcdm_opt.errors import InputError, known_arguments, placed
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.units import same_unit
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.assembly import Assembly, JoinedEntry
from fcdm_opt.problem.entries import AmountEntry, BodyEntry, KeepOutEntry, SizeEntry, StepEntry
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.keys import Corner, Made, Requirement, by_name, each, read_keep_outs, unlike_names
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.schema import Bound, Entry, Number, Positive, declared, read_entry


class PartEntry(BodyEntry, title="Parts"):
    """A part of the assembly, as drawn in the frame of all; those without a motion are fixed."""

    name: str = declared(..., "name of the part (text), once in a file", "slide")
    motion: list[StepEntry] | None = declared(
        None,
        "steps in order, relative to the part that it follows, as in a problem file: { translation = .. }, { rotation "
        "= .., centre = .. }, { screw = .., pitch.. }, { free = true }; a fixed part has none",
        [{"translation": "z"}],
        min_length=1,
    )
    follows: str | None = declared(
        None,
        "name of the part that takes this one along; without it the next on the way of contacts to a fixed part",
        "frame",
    )
    weight: Positive = declared(1.0, "a number > 0, relative: of its amount in the total", 2.0)
    length: Positive | None = declared(
        None, "length > 0 that turns radians into lengths; without it half the diagonal of the part's box", 20.0
    )
    limits: dict[str, tuple[Bound, Bound]] = declared(
        {},
        "{ TZ = [-1, 1], RZ_deg = [-10, 10] }: lower and upper, lengths, angles as _deg or _rad",
        {"TZ": [-1.0, 1.0]},
    )
    resolution: Positive | dict[str, Positive] | None = declared(
        None,
        "the machine's step, a number > 0, or { TZ = 0.05, RZ_deg = 0.5 }: the motion found is in whole steps; not of "
        "parts whose contacts share motions",
        0.05,
        {"TZ": 0.05},
    )


class PartSizeEntry(SizeEntry, title="Sizes of parts"):
    """One named way in which a part can come out different from drawn."""

    body: str = declared(..., "name of the part (text)", "slide")  # type: ignore[assignment]


class MadeEntry(Entry, title="Cases of an assembly"):
    """What came out."""

    name: str = declared(..., "name of the case (text), once in a file", "slide too large")
    scales: dict[str, Positive] = declared(
        {}, "scales > 0 of parts about their seeds, by name, 1 without", {"slide": 1.02}
    )
    tolerance: Number | dict[str, Number] | None = declared(
        None,
        "relative, >= 0 and below 1 (0.02 is 2 %), or by name: by how much parts are off; with requirement",
        0.02,
        {"slide": 0.01},
    )
    requirement: Requirement | None = declared(
        None,
        'which way parts are off, in place of scales, first those that move, then the fixed ones: "A" (+, +), "B" '
        '(+, -), "C" (-, +) or "D" (-, -)',
        "B",
    )
    amount: AmountEntry | Literal["weighted"] = declared(
        "weighted",
        'what is made least: "weighted" (the total) or { casadi = ... }, an expression of the parameters of all '
        "motions as Assembly.to_dict writes it",
        "weighted",
    )
    made: Corner | dict[str, Number] | None = declared(
        None,
        "deviations of the [[size]] tables by name, lengths or shares in their own unit, 0 where none is given; or "
        '"worst" (each contact\'s least gap at rest), "loosest" (largest), "low", "high", "middle" (all sizes)',
        {"slide width": 0.01},
        "high",
    )


class AssemblyFile(Entry, title="Assembly file"):
    """A whole file of an assembly."""

    title: str = declared("", "title (text)", "A key between two wedges")
    note: str = declared("", "what the reader should know (text)", "Lengths in mm.")
    part: list[PartEntry] = declared(
        ..., "[[part]] tables, two or more", [{"name": "frame", "file": "frame.stl", "unit": "mm"}]
    )
    contact: list[JoinedEntry] = declared(
        ..., "[[contact]] tables: which parts meet", [{"parts": ["slide", "frame"]}], min_length=1
    )
    keep_out: list[KeepOutEntry] = declared(
        [],
        "[[keep_out]] tables: further bodies at rest that every part with a motion must keep clear of",
        [{"file": "rib.stl", "unit": "mm"}],
    )
    size: list[PartSizeEntry] = declared(
        [],
        "[[size]] tables: ways in which a part can come out different from drawn",
        [{"name": "slide width", "body": "slide", "faces": ["+x", "-x"], "each": 0.5, "tolerance": 0.05}],
    )
    case: list[MadeEntry] = declared(..., "[[case]] tables", [{"name": "as drawn"}], min_length=1)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> AssemblyFile:
        """Return the checked contents of a file; raises `InputError` as `load_assemblies`."""
        return read_entry(cls, path, "file of an assembly", "[[part]], [[contact]] and [[case]]")

    def check(self, file: Path | None = None) -> None:
        """Refuse two parts or cases of one name."""
        with placed(file=file):
            unlike_names("part", self.part)
            unlike_names("case", self.case)

    def assemblies(
        self,
        made_of: Callable[..., Made],
        file: Path | None = None,
        bodies: Mapping[str, Body] | None = None,
        keep_out: Sequence[KeepOut] | None = None,
        wanted: Container[str] = (),
        refused: list[tuple[str, InputError]] | None = None,
    ) -> tuple[Made, ...]:
        """Return what `Assembly` makes of the arguments of each case, or those wanted; bodies may be built already."""
        # `refused` gets the name of a case that cannot be made, and why; without it, that ends all
        self.check(file)
        with placed(file=file):
            asked = self._asked(file, bodies, keep_out)
            made = list[Made]()
            for k, case in enumerate(self.case, 1):
                if wanted and case.name not in wanted:
                    continue
                own: dict[str, Any] = {key: getattr(case, key) for key in MadeEntry.model_fields}
                if isinstance(case.amount, AmountEntry):
                    names = [f"{part}.{name}" for part, motion in asked["motions"].items() for name in motion.names]
                    own["amount"] = OwnAmount.from_text(case.amount.casadi, names)
                try:
                    made.append(made_of(**asked, **own))
                except InputError as reason:
                    head = (reason.key or "").replace("[", ".").split(".")[0]
                    place = f"case[{k}] {case.name!r}"
                    error = reason if head in own else _renamed(reason)
                    if refused is None:
                        raise (error.within(key=place) if head in own else error) from reason
                    refused.append((case.name, error.within(key=place)))
        return tuple(made)

    def _asked(
        self, file: Path | None, built: Mapping[str, Body] | None, kept: Sequence[KeepOut] | None
    ) -> dict[str, Any]:
        """Return what all cases share, as `Assembly` wants it."""
        units = {f"part[{k}]": entry.unit for k, entry in enumerate(self.part, 1)}
        unit = same_unit(units | {f"keep_out[{k}]": own.unit for k, own in enumerate(self.keep_out, 1)}, file)
        bodies = (
            [built[own.name] for own in self.part]
            if built
            else each("part", [lambda own=own: own.body(own.name, file and file.parent) for own in self.part])
        )
        moving = [(k, own) for k, own in enumerate(self.part, 1) if own.motion]
        for k, own in ((k, own) for k, own in enumerate(self.part, 1) if not own.motion):
            for key in ("weight", "length", "limits", "resolution"):
                if key in own.model_fields_set and getattr(own, key):
                    what, allowed = "a part without a motion is fixed", "none, or a motion"
                    raise InputError(what, key=f"part[{k}].{key}", found=getattr(own, key), allowed=allowed)
        motions, limits, steps = {}, dict[str, Mapping[str, Any]](), dict[str, Any]()
        for k, own in moving:
            with placed(key=f"part[{k}]"):
                motions[own.name] = reduce(rshift, each("motion", [step.step for step in own.motion or ()]))
                limits[own.name] = by_name("limits", own.limits, motions[own.name])
                step = own.resolution
                steps[own.name] = by_name("resolution", step, motions[own.name]) if isinstance(step, dict) else step
        return {
            "parts": dict(zip((own.name for own in self.part), bodies, strict=True)),
            "contacts": [own.model_dump(exclude_unset=True) for own in self.contact],
            "sizes": each("size", [own.size for own in self.size]),
            "motions": motions,
            "follows": {own.name: own.follows for own in self.part if own.follows is not None},
            "weights": {own.name: own.weight for _, own in moving},
            "lengths": {own.name: own.length for _, own in moving if own.length is not None},
            "limits": limits,
            "keep_out": read_keep_outs(self.keep_out, file) if kept is None else kept,
            "resolution": {part: own for part, own in steps.items() if own},
            "unit": unit,
        }


def scene_of(data: Mapping[str, Any]) -> Problem | Assembly:
    """Return the problem or assembly of plain data; raises `InputError` as their `from_dict` does."""
    return Assembly.from_dict(data) if "part" in data else Problem.from_dict(data)


def _renamed(reason: InputError) -> InputError:
    """Return a refusal with the key as a file has it."""
    key = re.sub(r"^follows\.(.*)", r"part '\1'.follows", reason.key or "")
    for argument, table in (("contacts", "contact"), ("parts", "part"), ("motions", "part motion")):
        if key.split("[")[0].split(".")[0] == argument:
            key = table + key.removeprefix(argument)
    return InputError(reason.what, key=key, found=reason.found, allowed=reason.allowed)


@known_arguments
def load_assemblies(path: str | os.PathLike[str]) -> tuple[Assembly, ...]:
    """Return the assemblies of a file, one for each case.

    Parameters
    ----------
    path : path
        A file of an assembly (TOML).

    Raises
    ------
    InputError
        Names the file, the key, what was found and what is allowed; the first thing that is wrong.
    """
    return AssemblyFile.read(path).assemblies(Assembly, Path(path))
