"""What solving an assembly returns: plain data, with everything needed to refute it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.plain import plain
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.solution import Bounded, Certificate, Solution, Status

IN_PLACE = "status"
"""The check that the status says whether a part leaves the fit in which it is drawn; its note says which."""


def kept_apart(one: str, two: str) -> str:
    """Return the name of the check that two parts do not overlap."""
    return f"no overlap: {one} - {two}"


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
        Pose change of each part in the world, (4, 4), by part; empty likewise.
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
    certificate : Certificate or None
    seconds : dict
        Wall time of "solve" and "verify".
    """

    plain_names = (
        "name", "unit", "status", "advice", "usable", "parameters", "motions", "transforms", "amounts", "amount",
        "lower_bound", "amount_low", "amount_high", "gap", "contacts", "gaps", "stages", "active", "certificate",
        "seconds",
    )  # fmt: skip

    assembly: Assembly = field(repr=False)
    status: Status
    parameters: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    transforms: Mapping[str, Array] = field(default_factory=dict, repr=False)
    amounts: Mapping[str, float] = field(default_factory=dict)
    amount: float = float("nan")
    lower_bound: float = 0.0
    amount_low: float = float("nan")
    amount_high: float = float("nan")
    contacts: tuple[Solution, ...] = field(default=(), repr=False)
    stages: tuple[str, ...] = ()
    active: tuple[str, ...] = ()
    certificate: Certificate | None = field(default=None, repr=False)
    seconds: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def left_by_mesh(self) -> str:
        """As in `Bounded`; `known_to` of each two parts says why."""
        return self._mesh_bracket_text([*self.assembly.bodies_made.values()], self.assembly.unit)

    @property
    def advice(self) -> str:
        """What to do, in words; where a part leaves its fit, which and where."""
        if self.status is not Status.OUTSIDE_FIT or self.certificate is None:
            return self._meshed(self.status.value)
        left = next((check.note for check in self.certificate.checks if check.name == IN_PLACE), "")
        return f"{left}. {self._meshed(self.status.value)}"

    @property
    def gaps(self) -> dict[tuple[str, str], float]:
        """Signed distance of each two parts, not both fixed, after the motion, by names, as judged; length units."""
        found = {check.name: check.value for check in (self.certificate.checks if self.certificate else ())}
        return {pair: found[kept_apart(*pair)] for pair in self.assembly.pairs() if kept_apart(*pair) in found}

    @property
    def motions(self) -> dict[str, str]:
        """The motions in words, by part."""
        told, unit = self.assembly.motions, self.assembly.unit
        return {part: told[part].describe([*own.values()], unit=unit) for part, own in self.parameters.items()}

    def with_certificate(self, certificate: Certificate) -> AssemblySolution:
        """Return the solution with the judge's verdict, and the status it implies."""
        status = Status.NOT_VERIFIED if self.status.found and not certificate.passed else self.status
        return replace(self, certificate=certificate, status=status)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data; nan becomes None, and pairs of parts "one - two"."""
        pairs = self.assembly.contacts if self.contacts else ()
        shown = ("status", "pair_gap", "pair_state", "features", "open_contacts", "stage", "certificate")
        told = {
            "name": self.assembly.name,
            "unit": self.assembly.unit,
            "contacts": [
                {"parts": pair[:2], **{name: getattr(own, name) for name in shown}}
                for pair, own in zip(pairs, self.contacts, strict=True)
            ],
            "gaps": {" - ".join(pair): gap for pair, gap in self.gaps.items()},
        }
        return {name: plain(told[name] if name in told else getattr(self, name)) for name in self.plain_names}
