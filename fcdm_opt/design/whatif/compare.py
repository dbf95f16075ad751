"""Compare families of motions: which one is cheapest for the same goal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from fcdm_opt.design.whatif.constraints import PlainMotion
from fcdm_opt.errors import InputError, expected, known_arguments
from fcdm_opt.geometry.units import measured, number_text
from fcdm_opt.motion.motions import XYZ, Free, Motion, Rotation, Screw, Translation
from fcdm_opt.plain import Plain, ShortRepr, plain
from fcdm_opt.problem.arguments import truth
from fcdm_opt.problem.assembled import AssemblySolution
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import Bounded
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT

REFUSED = "BAD_INPUT"  # status of a family that the question does not hold for
OWN = "as given"  # name of the problem's own motion


def families() -> dict[str, Motion]:
    """Return the usual families by name: translations, rotations about the seed, screws, pairs of both, any motion."""
    along = {f"translation {axis}": Translation(axis) for axis in XYZ}
    about = {f"rotation {axis}": Rotation(axis) for axis in XYZ}
    both = {f"translation and rotation {axis}": Translation(axis) >> Rotation(axis) for axis in XYZ}
    return {
        **along,
        "along the seeds": Screw("seeds", pitch=math.inf),
        "translations": Translation("x") >> Translation("y") >> Translation("z"),
        **about,
        "screw along the seeds": Screw("seeds", pitch="free"),
        **both,
        "free": Free(),
    }


def contained() -> dict[str, tuple[str, ...]]:
    """Return for each usual family those that are part of it, with the same amounts: it is never dearer."""
    single = tuple(f"translation {axis}" for axis in "xyz")
    pairs = {f"translation and rotation {axis}": (f"translation {axis}", f"rotation {axis}") for axis in "xyz"}
    made = {"translations": (*single, "along the seeds"), "screw along the seeds": ("along the seeds",), **pairs}
    return {**made, "free": tuple(name for name in families() if name != "free")}


@dataclass(frozen=True, eq=False, kw_only=True)
class FamilyRow(PlainMotion):
    """One family."""

    plain_names: ClassVar[tuple[str, ...]] = ("status", "dropped", "tied", "note")

    name: str
    motion: Motion | None  # None of an assembly as given, whose parts have a motion each
    solution: Bounded | None  # None where the question does not hold for the family
    # what the question says of parameters that the family does not have: "limits.TX", "weights.RZ"
    dropped: tuple[str, ...] = ()
    tied: tuple[str, ...] = ()  # usable families of the same amount, within `Tolerances.tied`
    note: str = ""  # why the question does not hold; or which family, though part of this one, was found cheaper

    @property
    def status(self) -> str:
        """Name of the solution's status, or "BAD_INPUT"."""
        return REFUSED if self.solution is None else self.solution.status.name

    @property
    def usable(self) -> bool:
        """Whether a motion was found and the judge passed it."""
        return self.solution is not None and self.solution.usable

    @property
    def amount(self) -> float:
        """Least amount, length units; nan where there is no motion."""
        return math.nan if self.solution is None else self.solution.amount

    def to_dict(self) -> dict[str, Any]:
        """Return plain data; nan becomes None and infinity "inf"."""
        solution, several = self.solution, isinstance(self.solution, AssemblySolution)
        found = solution.coordinates if solution else {}
        texts = solution.question.motion_texts(found.values()).items() if solution and found else ()
        motion = "; ".join(f"{part} {text}" if several else text for part, text in texts) or None
        bound = None if solution is None else plain(solution.lower_bound)
        state = getattr(solution, "pair_state", "")
        return {"family": self.name, **super().to_dict(), "motion": motion, "lower_bound": bound, "pair_state": state}


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Comparison(ShortRepr, Plain):
    """Families of motions, cheapest first; those without a usable motion last."""

    plain_names: ClassVar[tuple[str, ...]] = ("length", "best", "rows")
    plain_kinds: ClassVar[Mapping[str, Any]] = {"best": str | None, "rows": tuple[FamilyRow, ...]}

    problem: Scene = field(repr=False)
    # length that turns radians into lengths, the same for all families; of an assembly the least of its parts'
    length: float
    table: tuple[FamilyRow, ...]

    @property
    def best(self) -> FamilyRow | None:
        """The cheapest family, None where none is usable."""
        return self.table[0] if self.table and self.table[0].usable else None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        best = self.best
        rows = [row.to_dict() for row in self.table]
        return {"length": self.length, "best": None if best is None else best.name, "rows": rows}

    def __str__(self) -> str:
        """Return one line: the cheapest family and those that tie with it."""
        best = self.best
        if best is None:
            return f"none of {len(self.table)} families has a usable motion"
        ties = f"; tied: {', '.join(best.tied)}" if best.tied else ""
        amount = measured(best.amount, best.solution.amount_unit if best.solution else "")
        return f"cheapest of {len(self.table)} families: {best.name}, amount {amount}{ties}"


@known_arguments
def compare(
    problem: Scene, motions: Mapping[str, Motion] | Iterable[Motion] | None = None, *, certify: bool = False
) -> Comparison:
    """Solve a problem, or an assembly all parts of which move so, with families of motions; say which is cheapest.

    Goal, length and everything else stay as they are; what the problem says of parameters that a family does not have
    is dropped there, and told.

    Parameters
    ----------
    problem : Problem or Assembly
    motions : mapping of name to Motion, or Motions, optional
        Default: the problem's own motion and the usual `families`.
    certify : bool
        Prove how small each family's motion can be at all.

    Raises
    ------
    InputError
        For arguments of the wrong kind. A family that the question does not hold for is a row, not an error.
    """
    expected(problem, (Problem, Assembly), "problem")
    truth(certify, "certify")  # each family would be a row that says so
    chosen = _usual(problem) if motions is None else _named(motions)
    rows = [_row(problem, name, motion, certify) for name, motion in chosen.items()]
    rows.sort(key=lambda row: (not row.usable, math.isnan(row.amount), row.amount))  # stable: equal ones as given
    notes = {**_other_centres(rows), **(_checked(rows) if motions is None else {})}
    table = (replace(row, tied=_tied(row, rows), note=row.note or notes.get(row.name, "")) for row in rows)
    return Comparison(problem=problem, length=problem.turning_length, table=tuple(table))


def _usual(problem: Any) -> dict[str, Motion | None]:
    """Return the usual families, and what is asked where that is none of them."""
    usual, own = families(), problem.motions.values()
    if any(all(motion.steps == each.steps for each in own) for motion in usual.values()):
        return {**usual}
    return {OWN: None if isinstance(problem, Assembly) else problem.motion, **usual}


def _named(motions: Mapping[str, Motion] | Iterable[Motion]) -> dict[str, Motion | None]:
    """Return checked motions by name, those without one named by their parameters."""
    if not isinstance(motions, Mapping | Iterable) or isinstance(motions, str | Motion | np.ndarray):
        found = type(motions).__name__
        raise InputError("no motions", key="motions", found=found, allowed="a mapping or a sequence of Motion")
    made: dict[str, Motion | None] = {}
    pairs = motions.items() if isinstance(motions, Mapping) else ((None, motion) for motion in motions)
    for k, (name, motion) in enumerate(pairs, 1):
        if not isinstance(motion, Motion):
            raise InputError("not a motion", key=f"motions[{name or k}]", found=type(motion).__name__, allowed="Motion")
        if name is not None and not isinstance(name, str):
            raise InputError("a family's name is text", key=f"motions[{k}]", found=name, allowed="a text")
        label = name or " ".join(motion.names)
        made[label if label not in made else f"{label} ({k})"] = motion
    if not made:
        raise InputError("no motions", key="motions", found=motions, allowed="at least one Motion")
    return made


def _row(problem: Any, name: str, motion: Motion | None, certify: bool) -> FamilyRow:
    """Return a family solved, or why it cannot be asked."""
    row = FamilyRow(name=name, motion=motion, solution=None)
    try:
        asked, dropped = (problem, ()) if motion is None else problem.with_motion(motion)
        return replace(row, solution=solve(asked, certify=certify), dropped=dropped)
    except InputError as reason:
        return replace(row, note=str(reason))


def _tied(row: FamilyRow, rows: list[FamilyRow]) -> tuple[str, ...]:
    """Return the other usable families of the same amount."""
    if row.solution is None or not row.usable:
        return ()
    floor, others = DEFAULT.tie * row.solution.question.size, [one for one in rows if one is not row and one.usable]
    near = [max(DEFAULT.tied * max(row.amount, other.amount), floor) for other in others]
    return tuple(
        other.name for other, slack in zip(others, near, strict=True) if abs(other.amount - row.amount) <= slack
    )


def _other_centres(rows: list[FamilyRow]) -> dict[str, str]:
    """Return through which points families turn, in words, where others do not turn about these."""
    centres = dict[str, str]()
    for row in rows:
        if row.motion is not None and any(kind == "rotation" for _, kind in row.motion.parameters):
            points = {point for step in row.motion.steps for point in step.own_fixed_points or ()}
            centres[row.name] = " and ".join([f"({', '.join(map(number_text, point))})" for point in sorted(points)])
    if len({*centres.values()}) < 2:
        return {}
    return {
        name: f"it turns through {points}, others do not: angles are not to be compared"
        for name, points in centres.items()
        if points
    }


def _checked(rows: list[FamilyRow]) -> dict[str, str]:
    """Return notes on families that were found dearer than one that is part of them, where nothing sets them apart."""
    by_name = {row.name: row for row in rows}
    notes: dict[str, str] = {}
    for name, parts in contained().items():
        row = by_name[name]
        cheaper = [
            part
            for part in (by_name[part] for part in parts)
            if part.usable
            and not set(part.dropped) - set(row.dropped)
            and not (row.usable and row.amount <= part.amount * (1.0 + DEFAULT.tied))
        ]
        if row.solution is not None and cheaper:
            best = min(cheaper, key=lambda part: part.amount)
            notes[name] = (
                f"not the least: {best.name!r}, which is part of it, has a motion of amount {number_text(best.amount)}"
            )
    return notes
