"""What solving an assembly returns: plain data, with everything needed to refute it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any, Self

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.lazy_import import imported
from fcdm_opt.plain import Plain, ShortRepr, agree, plain
from fcdm_opt.problem.assembly import Assembly, JoinedPair
from fcdm_opt.problem.evidence import SharedBound
from fcdm_opt.problem.fit import verdict
from fcdm_opt.problem.solution import (
    UNMET,
    Bounded,
    Solution,
    Status,
    derivatives_text,
    kept_clear,
    nearest_miss,
    quaternion_of,
)
from fcdm_opt.tolerances import DEFAULT

IN_PLACE = "status"
"""The check that the status says whether a part leaves the fit in which it is drawn; its note says which."""


def kept_apart(one: str, two: str) -> str:
    """Return the name of the check that two parts do not overlap."""
    return f"no overlap: {one} - {two}"


def kept_clear_by(part: str, keep_out: str) -> str:
    """Return the name of the check that a part keeps clear of a keep-out."""
    return f"{part}: {kept_clear(keep_out)}"


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class AssemblySensitivity(ShortRepr, Plain):
    """First derivatives of the least amount of an assembly, and of its motions, each by one datum.

    Attributes
    ----------
    exists : bool
        Whether there are any; else the values are nan.
    reasons : tuple of str
        Why not.
    parameters : tuple of str
        Of all motions, "part.parameter".
    scales : dict
        Name of each part -> by its scale, amount per unit of scale.
    sizes : dict
        Name of each of the assembly's sizes -> by it, from the sizes made.
    motion_by_scale, motion_by_size : dict
        The same names -> (k,) array of the parameters by it, lengths and radians.
    """

    exists: bool
    reasons: tuple[str, ...]
    parameters: tuple[str, ...]
    scales: Mapping[str, float]
    sizes: Mapping[str, float]
    motion_by_scale: Mapping[str, Array]
    motion_by_size: Mapping[str, Array]

    def __str__(self) -> str:
        """Return a table of the derivatives that there are, and why others are missing."""
        return derivatives_text(self, {**{f"scale of {part}": x for part, x in self.scales.items()}, **self.sizes})


class ByPart(dict[str, Any]):
    """What is known of each part, by its name; `why` there is nothing, where that is so."""

    def __init__(self, known: Mapping[str, Any], why: str = "") -> None:
        super().__init__(known)
        self._why = why

    def __missing__(self, name: str) -> Any:
        what = f"there are {', '.join(self)}" if self else f"no motion was found{self._why}"
        raise KeyError(f"{name!r}; {what}")


@dataclass(frozen=True, eq=False, kw_only=True)
class AssemblySolution(Bounded):
    """Answer to an `Assembly`.

    Attributes
    ----------
    assembly : Assembly
    status : Status
        Its value is advice.
    parameters : dict
        Of each part's motion by name (length units, radians), by part; empty where no motion was found.
    transforms : dict
        Pose change of each part in the world, (4, 4), by part; empty likewise. Another name is a `KeyError` that says
        what there is.
    amounts : dict
        Amount of each part's motion, length units, not weighted.
    amount : float
        Root of the sum of (weight times amount)^2 (nan where no motion was found).
    lower_bound : float
        No motions smaller than this together can do; 0 where nothing is proved.
    amount_low, amount_high : float
        Between these the least amount is as far as facets of round faces leave it open, see `Solution.amount_low`: of
        contacts that are problems of their own, from theirs; nan, not known, where several share motions.
    contacts : tuple of Solution
        Of each contact, with a problem in the parameters that it depends on.
    stages : tuple of str
        How each group of contacts that share parameters was settled.
    active : tuple of str
        What stops the motions from being smaller, or what excludes what.
    stopped : str
        What the time limit ended, in words; empty where the search was through. The bound holds all the same.
    evidence : tuple of SharedBound, or None
        With `certify` what is claimed of contacts that share motions; of each other contact it is with its solution.
    certificate : Certificate or None
    seconds : dict
        Wall time of "solve" and "verify".
    """

    plain_names = (
        "name", "unit", "assembly", "status", "advice", "reason", "usable", "parameters", "motions", "transforms",
        "amounts", "amount", "lower_bound", "amount_low", "amount_high", "gap", "contacts", "gaps", "keep_out_gaps",
        "stages", "active", "stopped", "doubt", "evidence", "certificate", "seconds",
    )  # fmt: skip

    assembly: Assembly = field(repr=False)
    parameters: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    transforms: Mapping[str, Array] = field(default_factory=dict, repr=False)
    amounts: Mapping[str, float] = field(default_factory=dict)
    contacts: tuple[Solution, ...] = field(default=(), repr=False)
    stages: tuple[str, ...] = ()
    evidence: tuple[SharedBound, ...] | None = None

    def __post_init__(self) -> None:
        """Keep what is known by part so that a name which is none says what there is."""
        why = "" if self.parameters else f": {self.status.words}"
        for key in ("parameters", "transforms", "amounts"):
            object.__setattr__(self, key, ByPart(getattr(self, key), why))

    def __str__(self) -> str:
        """Return the verdict in words, and below it the amount and what is proved of it."""
        return imported("show.assemblies:answer_text")(self)

    @property
    def question(self) -> Assembly:
        """`assembly`."""
        return self.assembly

    @property
    def coordinates(self) -> dict[str, float]:
        """The parameters of all motions as "part.parameter"."""
        return {f"{part}.{name}": x for part, own in self.parameters.items() for name, x in own.items()}

    def answering(self, question: Assembly) -> Self:
        """Return the same motions as an answer to another question about the same parts and motions."""
        contacts = tuple(
            own.answering(question.problem(pair, _parts_of(own.parameters)))
            for pair, own in zip(question.contacts, self.contacts, strict=False)
        )
        return replace(self, assembly=question, contacts=contacts)

    @property
    def _why_unknown(self) -> str:
        shared = len(self.contacts) < len(self.assembly.contacts) or any(", " in stage for stage in self.stages)
        return "where contacts share motions that is worked out of shifts that restore all of them" * shared

    @property
    def _why_not(self) -> str:
        """Which part leaves its fit, and where, or which widths do not go together, or contacts that are not met."""
        if self.status is not Status.OUTSIDE_FIT:
            return verdict(self.assembly) or "; ".join(self.active * (not self.status.found))
        checks = self.certificate.checks if self.certificate else ()
        return next((check.note for check in checks if check.name == IN_PLACE), "")

    @cached_property
    def reason(self) -> str:
        """Why there are no motions to use, see `Solution.reason`."""
        if self.status is not Status.INFEASIBLE or verdict(self.assembly):
            return self._why_not
        reasons = list(self.active)
        for pair in filter(self.assembly.is_own, self.assembly.contacts):
            heads = f"{pair}: ", f"contact {pair} {UNMET}"
            k = next((k for k, why in enumerate(reasons) if why.startswith(heads)), None)
            if k is not None and (miss := nearest_miss(self.assembly.problem(pair))):
                reasons[k] = f"{reasons[k]}: {miss}" if reasons[k] == heads[1] else f"{pair}: {miss}; {reasons[k]}"
        return "; ".join(reasons)

    @cached_property
    def sensitivity(self) -> AssemblySensitivity:
        """Derivatives of amount and motions by scales and sizes; worked out when first asked for, then kept."""
        return imported("along.sensitivity:assembly_sensitivity")(self)

    @property
    def gaps(self) -> dict[tuple[str, str], float]:
        """Signed distance of each two parts, not both fixed, after the motion, by names, as judged; length units."""
        found = self._judged
        return {pair: found[kept_apart(*pair)] for pair in self.assembly.pairs() if kept_apart(*pair) in found}

    @property
    def keep_out_gaps(self) -> dict[tuple[str, str], float]:
        """Signed distance of each part that moves from each keep-out, by names, after the motion, as judged."""
        found = self._judged
        both = product(self.assembly.motions, (keep_out.name for keep_out in self.assembly.keep_out))
        return {(part, name): found[key] for part, name in both if (key := kept_clear_by(part, name)) in found}

    @property
    def motions(self) -> dict[str, str]:
        """The motions in words, by part."""
        return self.assembly.motion_texts([*self.coordinates.values()]) if self.parameters else {}

    @property
    def quaternions(self) -> dict[str, tuple[float, float, float, float]]:
        """The rotation of each of `transforms` as a unit quaternion (x, y, z, w), in ROS' and SciPy's order."""
        return {part: quaternion_of(pose) for part, pose in self.transforms.items()}

    def to_dict(self) -> dict[str, Any]:
        """Return plain data as `Solution.to_dict`; pairs of parts as "one - two", contacts with the names of theirs."""
        data = {
            "name": self.assembly.name,
            "unit": self.assembly.unit,
            "contacts": [
                {"parts": pair[:2], **own.to_dict(problem=False), **_exact_at(pair, own)}
                for pair, own in zip(self.assembly.contacts, self.contacts, strict=False)
            ],
            "gaps": {" - ".join(pair): gap for pair, gap in self.gaps.items()},
            "keep_out_gaps": {" - ".join(both): gap for both, gap in self.keep_out_gaps.items()},
        }
        return {name: plain(data[name] if name in data else getattr(self, name)) for name in self.plain_names}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Rebuild a solution from `to_dict`; raises `InputError` naming a missing or wrong key."""
        try:
            assembly = Assembly.from_dict(data["assembly"])
            pairs = zip(assembly.contacts, data["contacts"], strict=bool(data["contacts"]))
            contacts = tuple(_contact(assembly, pair, own) for pair, own in pairs)
            read = super().from_dict({**data, "assembly": assembly, "contacts": contacts})
            read._check_shapes()
        except (KeyError, TypeError, ValueError) as reason:
            if isinstance(reason, InputError):
                raise
            raise InputError("not the plain data of a solution", key="AssemblySolution", found=str(reason)) from reason
        for key, own in (("usable", read.usable), ("gap", read.gap), ("gaps", read.to_dict()["gaps"])):
            if key in data and not agree(data[key], plain(own), DEFAULT.touch * assembly.size):
                raise InputError("does not follow from the rest", key=key, found=data[key], allowed=str(own))
        return read

    def _check_shapes(self) -> None:
        """Refuse poses that are none, and parameters of other motions."""
        assembly, asked = self.assembly, {part: motion.names for part, motion in self.assembly.motions.items()}
        for part, pose in self.transforms.items():
            if part not in assembly.parts or pose.shape != (4, 4) or not np.isfinite(pose).all():
                allowed = f"of {', '.join(assembly.parts)} (4, 4) finite numbers"
                raise InputError("not a pose of a part", key=f"transforms.{part}", found=pose.tolist(), allowed=allowed)
        found = {part: tuple(own) for part, own in self.parameters.items()}
        if found and found != asked:
            raise InputError("not the motions' parameters", key="parameters", found=found, allowed=str(asked))


def _contact(assembly: Assembly, pair: JoinedPair, given: Mapping[str, Any]) -> Solution:
    """Return the solution of a contact, in the parameters of one part's motion or, as PART.NAME, of several."""
    if [*given["parts"]] != [*pair[:2]]:
        raise InputError("not the assembly's contact", key="contacts.parts", found=given["parts"], allowed=str(pair))
    problem = assembly.problem(pair, _parts_of(given["parameters"]))
    problem = problem if given.get("goal", problem.goal) == problem.goal else problem.to_touch()
    problem = problem.with_exact_points(given["exact_at"]).asked if "exact_at" in given else problem
    return Solution.from_dict({**given, "problem": problem})


def _exact_at(pair: JoinedPair, solution: Solution) -> dict[str, Any]:
    """Return the points at which the parts of a contact are exact, where there are any, and a goal not asked for."""
    points, goal = solution.problem.exact_at, solution.problem.reformulated.goal
    other = goal == "touch" != pair.asked.get("goal")
    return {} if points is None else {"exact_at": points, **({"goal": goal} if other else {})}


def _parts_of(names: Iterable[str]) -> list[str] | None:
    """Return the parts whose motions parameters PART.NAME are of; None where they are those of one motion."""
    parts = [*dict.fromkeys(name.rpartition(".")[0] for name in names)]
    return None if "" in parts else parts
