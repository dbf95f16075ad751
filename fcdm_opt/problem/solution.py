"""What a solve returns: plain data, with everything needed to refute it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import Any, Literal, NamedTuple, Self, cast, get_args

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.contact import true_faces_met
from fcdm_opt.curve.decision_curve import relative_pose
from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.facet_errors import known_to, rounding_line
from fcdm_opt.geometry.units import measured, number_text
from fcdm_opt.lazy_import import NotebookRepr, imported
from fcdm_opt.plain import Plain, ShortRepr, agree, plain
from fcdm_opt.problem.evidence import ProofData
from fcdm_opt.problem.fit import verdict
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import Problem

MadeState = Literal["apart", "touching", "overlapping", "unknown"]
Effort = Literal["proved", "quick"]
EFFORTS = get_args(Effort)  # what `solve` may spend

LOOSE = 0.1  # relative gap above which an amount is not to be taken for the least

SURE = 0.01  # share of an amount that its mesh may leave open for it to be called the smallest possible

MOST_CORNERS = 8  # of a face, which are listed where derivatives are printed
FACETED = "their curved faces are facets here"
OPEN = "less is not ruled out on their round faces"
"""Why an answer about a mesh may not be that about the parts, and why one about round faces may not be the least."""

UNLOOKED = 'it is not worked out with effort "quick", nor where it takes long'
"""Why it is not known what a mesh leaves open where larger parts make a question harder, or easier."""


class Status(Enum):
    """How a solve ended; the value says what to do."""

    SOLVED = "Solved: apply the motion."
    ALREADY_SATISFIED = "Nothing to do: the requirement is met without any motion."
    PAIR_OVERLAPS = (
        "Solved for the tracked contact point, but the pair made overlaps there: use goal 'touch' or 'clear', or "
        "add pair = 'clear' or 'touch'."
    )
    OUTSIDE_FIT = (
        "The motion leaves the fit in which the parts are drawn, through the other part or out of it; do not use it: "
        "choose a smaller tolerance, other sizes, another motion, or limits that keep the part in."
    )
    INFEASIBLE = "Proved impossible with this motion and these limits: widen the limits or choose another motion."
    NOT_FOUND = "No motion found, and none proved impossible: widen the limits, choose another motion, or goal 'touch'."
    LEFT_COHERENT_RANGE = (
        "Motions that reach the requirement were found only beyond the coherent range: choose another motion, a "
        "smaller tolerance, or path = 'free'."
    )
    NOT_IN_STEPS = (
        "A motion was found, but none near it in whole steps of the resolution meets the requirement: choose finer "
        "steps, or leave more room; goals 'beyond' and 'clear' have some."
    )
    NOT_VERIFIED = "A motion was found but the judge rejected it: see the certificate's failed checks; do not use it."

    @property
    def found(self) -> bool:
        """Whether there is a motion."""
        return self in (
            Status.SOLVED,
            Status.ALREADY_SATISFIED,
            Status.PAIR_OVERLAPS,
            Status.OUTSIDE_FIT,
            Status.NOT_VERIFIED,
        )

    @property
    def words(self) -> str:
        """The status in a few words, for a cell of a table: "impossible", "no motion found"."""
        return WORDS.get(self.name, self.name.lower().replace("_", " "))


WORDS = {
    "ALREADY_SATISFIED": "nothing to do",
    "INFEASIBLE": "impossible",
    "NOT_FOUND": "no motion found",
    "NOT_IN_STEPS": "none in whole steps",
    "LEFT_COHERENT_RANGE": "only beyond coherent range",
    "OUTSIDE_FIT": "outside the fit",
}
"""What rows say of statuses whose names say less, by these."""

UNTIMED = "No motion found by then, and none proved impossible: allow more time."
UNFIT = "Choose a smaller tolerance, or other sizes."
UNJUDGED = "A motion was found, but was not judged in the time given: allow more time; do not use it."
IN_TIME = "judged in time"  # name of the one check of what the time given did not do for judging
TRUE_FACES = "true faces"  # name of the check that those which facets stand for do not overlap

ENDS = ("amount_low", "amount_high")  # what facets of round faces leave open of the amount

IMPOSSIBLE = (Status.OUTSIDE_FIT, Status.INFEASIBLE)
"""What says that nothing can be done, which facets that stick out of round faces may be the only cause of."""

UNLIMITED = {
    Status.INFEASIBLE: "Proved impossible with this motion: choose another motion, a smaller tolerance or other sizes.",
    Status.NOT_FOUND: "No motion found, and none proved impossible: choose another motion, or goal 'touch'.",
}
"""What to do where no limits are set, which could be widened."""


def kept_clear(name: str) -> str:
    """Return the name of the check that a keep-out is kept clear of."""
    return f"keep-out {name!r}: clearance"


UNCLAIMED = "no bound is claimed: that no smaller motion will do was not checked"
"""Note of the check of a proof where there is none."""

UNMET = "cannot be met"  # of a contact of an assembly that no motion meets

PARALLEL = "faces in contact stay parallel: round or pointed locators would let the part tilt"
"""Why flush contacts at unlike heights exclude each other."""


class Check(NamedTuple):
    """One check of a certificate: `value` was compared with `limit`."""

    name: str
    passed: bool
    value: float
    limit: float
    note: str


@dataclass(frozen=True, repr=False)
class Certificate(ShortRepr, Plain, NotebookRepr):
    """Outcome of the judge: a list of checks, all of which must pass; an empty list does not.

    One that was `read`, from plain data, is a claim, which `verify` compares with what it finds.
    """

    plain_names = ("passed", "checks")

    checks: tuple[Check, ...]
    read: bool = field(default=False, repr=False, compare=False)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Rebuild from `to_dict`; raises `InputError`."""
        found = super().from_dict({**data, "read": True})
        if data["passed"] is not found.passed:
            raise InputError("does not follow from the checks", key="certificate.passed", found=data["passed"])
        return found

    def __str__(self) -> str:
        """Return how many checks passed, and each that did not with its number and limit."""
        failed = [f"  {own.name}: {own.value:.6g}, limit {own.limit:.6g}; {own.note}" for own in self.failed]
        text = f"{len(self.checks) - len(failed)} of {len(self.checks)} checks passed"
        text += f"; {UNCLAIMED}" * any(own.note == UNCLAIMED for own in self.checks)
        return "\n".join([f"{text}; not:" if failed else text, *failed])

    @property
    def passed(self) -> bool:
        """Whether there are checks and every one passed: of a motion; without any, the check that there is one fails.

        That none is possible is proved where the status says so: its bound is infinite, and `verify(proof=True)` looks
        at what shows that.
        """
        return bool(self.checks) and all(check.passed for check in self.checks)

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that did not pass."""
        return tuple(check for check in self.checks if not check.passed)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Sensitivity(ShortRepr, Plain):
    """First derivatives of the least amount.

    Each is by one datum, all others as they are. Seeds and `length` count as data of their own: with a rule such as
    "centroid" a vertex that moves takes the seed along, which is not in the derivative by the vertex. A nominal
    switching point moves with the geometry, and with it the target pair that a requirement makes of it; a nominal pair
    given as numbers stays, and so does an explicit target.

    Attributes
    ----------
    exists : bool
        Whether the amount is differentiable there; where it is not, the values hold on one side, or of one of several
        equally small motions, and those that differ are nan.
    reasons : tuple of str
        Why it is not.
    target : (2,) array
        By the scales made, per unit of scale.
    tolerance : (2, 2) array or None
        By each relative tolerance, one row a body, minus and plus; 0 where the requirement does not use it, None
        without a requirement.
    nominal : (2,) array
        By the nominal scales, through the target pair that a requirement makes of them.
    limits : dict
        Parameter name -> (by its lower, by its upper limit), amount per unit of the parameter.
    clearance : float
        By the clearance, amount per length.
    keep_out : dict
        Name -> by that keep-out's clearance.
    weights : dict
        Parameter name -> by its weight.
    length : float
        By the length that turns radians into lengths.
    faces : dict
        Label such as "P1V1,V3,V4,V6" -> by the outward shift of the face's plane, amount per length; nan where the
        shift would part a vertex of more than three faces that matters. Keep-outs: "keep-out 'name' V1,V2,V3".
    vertices : dict
        Label such as "P1V6" -> (3,) array by the vertex, world frame as drawn; nan where its move would break a face
        of more than three corners, or a flush contact, that matters: see `faces` for these.
    seeds : dict
        "P1", "P2" -> (3,) array, world frame as drawn.
    sizes : dict
        Name of each of the problem's sizes -> by it, amount per unit of the size, from the sizes made; nan as with
        vertices, and where the body made has other vertices than as drawn.
    multipliers : dict
        Constraint -> multiplier, amount per unit of the constraint.
    residual : float
        Share of the amount's gradient that the constraints leave unbalanced.
    motion_by_pose : (k, 6) array
        Of the motion's parameters, by how body 1 stands as drawn: per length that it is shifted along the world's x, y
        and z, and per radian that it is turned about each, through its seed. nan where there is no derivative or none
        is worked out: the change goes with other contacts to either side, several contacts are restored together, a
        keep-out or the way of a contact holds the motion, or it is rounded to steps of the machine.
    motion_by_size : dict
        Name of each of the problem's sizes -> (k,) array of the same parameters by it, per unit of the size.
    motion_reasons : tuple of str
        By which of these the motion has no derivative, and why: "no derivative by slot: ...", one a reason.
    """

    exists: bool
    reasons: tuple[str, ...]
    target: Array
    tolerance: Array | None
    nominal: Array
    limits: Mapping[str, tuple[float, float]]
    clearance: float
    keep_out: Mapping[str, float]
    weights: Mapping[str, float]
    length: float
    faces: Mapping[str, float]
    vertices: Mapping[str, Array]
    seeds: Mapping[str, Array]
    sizes: Mapping[str, float]
    multipliers: Mapping[str, float]
    residual: float
    motion_by_pose: Array
    motion_by_size: Mapping[str, Array]
    motion_reasons: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return a table of the derivatives that there are, and why others are missing; of faces those that count."""
        each: dict[str, Any] = {"scales made": self.target, **self.sizes, "clearance": self.clearance}
        each |= {f"clearance of {name}": x for name, x in self.keep_out.items()}
        many = ((name, name.split(","), x) for name, x in self.faces.items() if x)
        each |= {name if len(own) <= MOST_CORNERS else f"{','.join(own[:3])},... {own[-1]}": x for name, own, x in many}
        return "\n".join([derivatives_text(self, each), *(f"  of the motion {why}" for why in self.motion_reasons)])

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Sensitivity:
        """Rebuild it from plain data, of earlier versions too, which did not work out how the motion changes."""
        unknown = {
            "motion_by_pose": [[None] * 6] * len(data.get("limits", ())),
            "motion_by_size": {},
            "motion_reasons": (),
        }
        return super().from_dict({**unknown, **data})


def derivatives_text(derivatives: Any, each: Mapping[str, Any]) -> str:
    """Return a table of derivatives of the amount by their names, of sizes also that there is none, and why."""
    known = {name: x for name, x in each.items() if np.isfinite(x).all() and np.any(x)}
    lines = [f"  by {name}: {np.round(x, 6) + 0.0}" for name, x in known.items()]
    lines += [f"  by {name}: none" for name, x in derivatives.sizes.items() if np.isnan(x)]
    first = "derivatives of the amount" if lines else "the amount depends on nothing that is listed, to first order"
    if not derivatives.exists:
        first = f"{'derivatives of the amount, not by all data' if known else 'no derivative'}: "
    return "\n".join([first + "; ".join(derivatives.reasons), *lines])


def quaternion_of(transform: Array) -> tuple[float, float, float, float]:
    """Return the rotation of a transform, (4, 4), as a unit quaternion (x, y, z, w), w >= 0."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(transform[:3, :3]).as_quat(canonical=True).tolist()
    return x, y, z, w


class _WhenRead:
    """One of `ENDS`, which may be set to what works out both: that is done when one is read, as it takes solves."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, solution: Any, owner: type) -> Any:
        if solution is None:
            return math.nan
        if callable(own := vars(solution)[self._name]):
            vars(solution).update(zip(ENDS, own(), strict=True))
        return vars(solution)[self._name]

    def __set__(self, solution: Any, value: Any) -> None:
        vars(solution)[self._name] = value


def nearest_miss(problem: Problem) -> str:
    """Return what lacks at the nearest pose that a search finds, in words; "" where the time does not last."""
    return str(pacing.in_time(imported("design.fixed_pose.nearest_miss:nearest_miss"), problem, late=""))


@dataclass(frozen=True, eq=False, kw_only=True)
class Bounded(Plain, NotebookRepr):
    """An answer: a status, an amount with a bound that is proved, and the judge's word; see `Solution`."""

    status: Status
    parameters: Mapping[str, Any] = field(default_factory=dict)
    amount: float = float("nan")
    lower_bound: float = 0.0
    amount_low: float = cast("Any", _WhenRead())
    amount_high: float = cast("Any", _WhenRead())
    active: tuple[str, ...] = ()
    stopped: str = ""
    certificate: Certificate | None = field(default=None, repr=False)
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def question(self) -> Any:
        """The question that this answers."""
        raise NotImplementedError

    @property
    def coordinates(self) -> dict[str, float]:
        """Values of the parameters of all motions by the names of `Scene.coordinates`; empty without a motion."""
        return dict(self.parameters)

    @property
    def held_by(self) -> tuple[Any, ...]:
        """What the motion rests on: alike where the same contacts and constraints hold it."""
        return self.status, self.active

    def is_held_like(self, other: Any) -> bool:
        """Tell whether another answer to a question of this kind has the same status, contacts and constraints."""
        return bool(self.held_by == other.held_by)

    def answering(self, question: Any) -> Self:
        """Return the same motion as an answer to another question, to be judged by that."""
        raise NotImplementedError

    @property
    def amount_unit(self) -> str:
        """Unit of the amount, "" where none is known."""
        return str(self.question.amount_unit)

    @cached_property
    def left_by_mesh(self) -> str:
        """What facets of round faces leave open of the amount, in words, where that is more than `SURE` of it.

        As "true parts need between .32 and 2.85 mm: their curved faces are facets here".
        """
        low, high, unit, found = self.amount_low, self.amount_high, self.amount_unit, self.status.found
        if found and not (self.usable or self.status in IMPOSSIBLE):
            return ""
        if math.isnan(low) and (self.usable or self.status in IMPOSSIBLE):
            known = not known_to(self.question.bodies, unit)
            return "" if known else f"what true parts need is not known: {self._why_unknown or UNLOOKED}"
        if not self.usable:
            needed = f", moved by {measured(low, unit, 4)}" if low > 0.0 else ""
            return f"but true parts may fit{needed}: {self._why_open}" if low < math.inf else ""
        if high - low <= SURE * self.amount:
            return ""
        if math.isinf(high):
            least = f"need {measured(low, unit, 4)} or more, or do" if low > 0.0 else "may"
            return f"true parts {least} not fit: {self._why_open}"
        return f"true parts need between {number_text(low, 4)} and {measured(high, unit, 4)}: {self._why_open}"

    @property
    def _why_open(self) -> str:
        """Why true parts may need less or more than meshes, and what cures it."""
        if line := rounding_line(self.question.bodies):
            return f"{FACETED}; {line}"
        return FACETED if any(body.surfaces is None and body.exact is None for body in self.question.bodies) else OPEN

    @property
    def _why_unknown(self) -> str:
        """Why it is not known what a mesh leaves open, where that is because of what is asked."""
        return ""

    @cached_property
    def advice(self) -> str:
        """What to do, in words: the status's advice, and why there is no answer where more is known of that."""
        return self._advised(self._why_not)

    @property
    def explained(self) -> str:
        """`advice`, with `reason`."""
        return self._advised(self.reason)

    def _advised(self, why: str) -> str:
        text = self.status.value
        if not self._limited:
            text = UNLIMITED.get(self.status, text)
        if self.stopped and self.status is Status.NOT_FOUND:
            text = UNTIMED
        if self.certificate and any(check.name == IN_TIME for check in self.certificate.checks):
            text = UNJUDGED
        if self.stopped:
            text = f"{self.stopped[:1].upper()}{self.stopped[1:]}. {text}"
        if self.usable or self.status is Status.NOT_VERIFIED:
            return text
        if mesh := self.left_by_mesh:  # what is proved is proved of the meshes alone
            text = f"{text.replace('Proved impossible', 'Impossible for the meshes')} {mesh[:1].upper()}{mesh[1:]}."
        if not why:
            return text
        named = why.startswith(tuple(f"{part} " for part in self.question.drawn))  # names stay as they are
        why = why if named else f"{why[:1].upper()}{why[1:]}"
        return f"{why}. {UNFIT if self.status is Status.LEFT_COHERENT_RANGE else text}"

    @cached_property
    def reason(self) -> str:
        """Why there is no motion to use, as far as it is known: what overlaps, or passes a limit, and by how much.

        "" where there is one. Worked out when first read, as a search for the nearest pose that `advice` does without.
        """
        return "" if self.usable else self._why_not or self._nearest_miss()

    def _nearest_miss(self) -> str:
        """Return what lacks at the nearest pose that a search finds, in words."""
        raise NotImplementedError

    @property
    def _limited(self) -> bool:
        """Whether limits are set, which could be widened."""
        return any(np.isfinite(own.limits).any() for own in self.question.coordinates)

    @property
    def _why_not(self) -> str:
        """Why there is no answer that is of use, as far as the question tells."""
        raise NotImplementedError

    def with_certificate(self, certificate: Certificate, seconds: Mapping[str, float]) -> Self:
        """Return the solution with the judge's verdict, the status it implies, and the times."""
        status = Status.NOT_VERIFIED if self.status.found and not certificate.passed else self.status
        return self.changed(certificate=certificate, status=status, seconds=seconds)

    def changed(self, **values: Any) -> Self:
        """Return the solution with other values of some fields; what is worked out when read is not for that."""
        other, own = object.__new__(type(self)), vars(self)
        vars(other).update({name: own[name] for name in self.__dataclass_fields__}, **values)
        return other

    @property
    def _judged(self) -> dict[str, float]:
        """What the judge found, by the names of its checks."""
        return {check.name: check.value for check in (self.certificate.checks if self.certificate else ())}

    @property
    def verified(self) -> bool:
        """Whether a motion was found and the judge passed it, though it may leave the fit."""
        return self.status.found and self.certificate is not None and self.certificate.passed

    @property
    def usable(self) -> bool:
        """Whether a motion was found that stays in the fit, and the judge passed it."""
        return self.verified and self.status is not Status.OUTSIDE_FIT

    @property
    def gap(self) -> float:
        """Relative gap between the amount and its lower bound; nan where there is no motion."""
        return 0.0 if self.amount == 0.0 else 1.0 - self.lower_bound / self.amount

    @property
    def doubt(self) -> str:
        """What is to be said beside the amount: that its bound is far below it, or its mesh leaves much open."""
        if not self.status.found:
            return ""
        loose = self.amount > 0.0 and self.gap > LOOSE and self.status is not Status.OUTSIDE_FIT
        less = f"up to {100.0 * self.gap:.0f} % less not excluded" if self.lower_bound > 0.0 else "not proved least"
        loose &= not (self.left_by_mesh and self.amount_low >= self.lower_bound)  # which says more of the true parts
        return "; ".join(filter(None, (less * loose, self.left_by_mesh)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution(Bounded):
    """Answer to a `Problem`.

    Attributes
    ----------
    problem : Problem
    status : Status
        Its value is advice; `advice` has it for this solution.
    parameters : dict
        Motion parameters by name (length units, radians); empty where no motion was found.
    transform : (4, 4) array or None
        Pose change of body 1, world frame.
    amount : float
        Motion amount, length units (nan where no motion was found).
    lower_bound : float
        No motion smaller than this can do; 0 where nothing is proved.
    amount_low, amount_high : float
        Between these the least amount is for the parts whose round faces are cylinders, cones, spheres and so on, as
        far as the facets that stand for them leave it open: the amount for bodies that the true ones hold, and for
        bodies that hold them. Both are `amount` where all faces that matter are plane; nan where it is not known, and
        of effort "quick", which does not look; infinite where the larger bodies may not do at all, or neither does:
        both, beside the `amount` of a motion that leaves the fit, where nothing keeps the true parts in it.
        Worked out when first read or printed, as that takes further solves; within a time that is given at once.
    rho : (2,) array or None
        The tracked contact point after the motion; for "touch" and "clear" the target pair.
    features : tuple of Feature
        The tracked contact features.
    pair : (2,) array
        The target pair: the scales of the parts made.
    pair_gap : float
        Signed gap of the target pair after the motion (at rest where none was found), length units: > 0 their distance,
        < 0 overlapping.
    pair_state : "apart", "touching", "overlapping" or "unknown"
        "apart", "touching" or "overlapping"; "unknown" where no motion was judged.
    active : tuple of str
        What stops the motion from being smaller.
    modelled : dict
        What is in the program that the motion solves, by the same names for every stage: "variables", "constraints"
        (limits of variables not among them), and "part_pairs", "features", "keep_outs" with "_kept" and, for how many
        there are, "_total". Features are the pairs of elements that its rows are made of. Nothing is kept where
        nothing is to do, and without a motion.
    stage : str
        Which stage of the solver settled it, and why.
    stopped : str
        What the time limit ended, in words; empty where the search was through. The bound holds all the same.
    evidence : Evidence, Multipliers or None
        What `certify` proved, to be checked apart.
    certificate : Certificate or None
    unique_within : float
        Where several contacts are restored together: no other motion restores them whose parameters, each times its
        weight, are at most this; 0 where nothing is proved.
    seconds : dict
        Wall time of "build" (compiling templates), "solve", "prove" (and confirming, where only that is asked) and
        "verify".
    derivatives : Sensitivity or None
        `sensitivity` where it is known beforehand: of a solution that was stored.
    """

    plain_names = (
        "problem", "status", "advice", "reason", "usable", "parameters", "motion", "transform", "amount", "lower_bound",
        "amount_low", "amount_high", "rho", "features", "pair", "pair_gap", "pair_state", "keep_out_gaps", "snapped",
        "active", "modelled", "stage", "stopped", "gap", "unique_within", "contact_gaps", "open_contacts", "doubt",
        "evidence", "sensitivity", "certificate", "seconds",
    )  # fmt: skip

    problem: Problem
    parameters: Mapping[str, float] = field(default_factory=dict)
    transform: Array | None = None
    rho: Array | None = None
    features: tuple[Feature, ...] = ()
    pair: Array
    pair_gap: float = float("nan")
    pair_state: MadeState = "unknown"
    modelled: Mapping[str, int] = field(default_factory=dict)
    stage: str = ""
    evidence: ProofData | None = None
    unique_within: float = 0.0
    derivatives: Sensitivity | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        """Return outcome, motion, amount with its bound, and state of the pair made, on one line."""
        motion = imported("show.texts:motion_text")(self) if self.parameters else "no motion"
        amount, proved = (measured(x, self.amount_unit, 4) for x in (self.amount, self.lower_bound))
        amount += f" ({self.left_by_mesh})" * bool(self.left_by_mesh)
        found = f"{motion}, amount {amount}, proved at least {proved}, pair made {self.pair_state}"
        return f"Solution({self.problem.name!r}: {self.status.name}, {found})"

    def __str__(self) -> str:
        """Return the verdict in words, and below it what its row in a table says."""
        return imported("show.verdict:answer_text")(self)

    @property
    def question(self) -> Problem:
        """`problem`, without points at which parts are exact where it restores contacts of round faces."""
        return self.problem if self.problem.reformulated is self.problem else self.problem.of_facets

    @property
    def reformulated(self) -> Self:
        """The same answer to what was solved, see `Problem.reformulated`."""
        solved = self.problem.reformulated
        return self if solved is self.problem else replace(self, problem=solved)

    @property
    def exact_of_mesh(self) -> bool:
        """Whether facets of round faces leave neither the amount open nor a gap that is told."""
        return self.amount_low == self.amount_high and not imported("model.mesh_error:leaves_gap_open")(self)

    @property
    def _why_unknown(self) -> str:
        problem = self.problem.reformulated
        more = problem.contacts and imported("problem.contacts_restored:unfollowed")(problem)
        if more:
            what = "contact touches" if more == 1 else "contacts touch"
            return f"{more} more {what} as drawn on round faces and not on their facets, which is not followed in turns"
        if problem.goal not in ("touch", "clear"):
            return f'goal "{problem.goal}" is about contacts as drawn, and what such an error does to them has no bound'
        if (problem.goal == "touch" and problem.keep_out) or (problem.goal == "clear" and problem.pair == "touch"):
            return "larger parts touch sooner, and keep less clear"
        if problem.goal == "touch" and not (problem.resolution is None and isinstance(problem.amount, str)):
            return "larger parts touch sooner, which steps of a resolution and amounts of one's own need not follow"
        return ""

    @property
    def held_by(self) -> tuple[Any, ...]:
        """Status, features and what is active."""
        return self.status, self.features, self.active

    def is_held_like(self, other: Any) -> bool:
        """Tell it; of parts that are exact on true faces, where points are chosen anew, by the faces that meet."""
        if self.held_by == other.held_by or self.problem.exact_at is None or other.problem.exact_at is None:
            return bool(self.held_by == other.held_by)
        met, others = (
            [true_faces_met(own, *each.problem.bodies[:2]) for own in each.features] for each in (self, other)
        )
        alike = [[bool(one & its) and bool(two & theirs) for its, theirs in others] for one, two in met]
        same = all(map(any, alike)) and all(map(any, zip(*alike, strict=True))) and bool(met) == bool(others)
        return same and (self.status, self.active) == (other.status, other.active)

    def answering(self, question: Problem) -> Self:
        """Return the same motion as an answer to another question about the same motion."""
        features = question.contacts if question.contacts and question.goal != FIT else self.features
        return replace(self, problem=question, features=features)

    @property
    def _why_not(self) -> str:
        """Which widths do not go together, or contacts that are not met."""
        reasons = self.active * (self.status in (Status.NOT_FOUND, Status.NOT_IN_STEPS))
        words = verdict(self.problem) or "; ".join(reasons)
        return words + self._parallel * bool(words and self.status is Status.NOT_FOUND)

    @property
    def _parallel(self) -> str:
        several = sum(own.is_flush for own in self.problem.contacts) > 1
        return f"; {PARALLEL}" * (several and not self.problem.motion.shifts)

    def _nearest_miss(self) -> str:
        missed = nearest_miss(self.problem) if self.status in IMPOSSIBLE else ""
        active = "; ".join(self.active) * (self.status is Status.INFEASIBLE)
        return missed or active + self._parallel * bool(active)

    @cached_property
    def sensitivity(self) -> Sensitivity:
        """Derivatives of the amount by the data, see `Sensitivity`; worked out when first asked for, then kept."""
        return imported("along.sensitivity:sensitivity")(self) if self.derivatives is None else self.derivatives

    @property
    def keep_out_gaps(self) -> dict[str, float]:
        """Signed distance of the part made from each keep-out after the motion, as judged; length units, by name."""
        found, names = self._judged, (keep_out.name for keep_out in self.problem.keep_out)
        return {name: found[kept_clear(name)] for name in names if kept_clear(name) in found}

    @cached_property
    def contact_gaps(self) -> dict[str, float]:
        """Gap of each contact of the nominal position after the motion, length units, by label.

        Of the parts made; those that are restored together where the problem names some. < 0 where its parts overlap.
        Empty without a motion, and where the nominal pair has no contact.
        """
        problem = self.problem.reformulated
        if self.transform is None or not np.isfinite(self.transform).all():
            return {}
        joints = problem.chosen_joints or problem.nominal_joints
        pose = relative_pose(problem.movable, problem.static, self.transform)
        return {joint.feature.label: joint.gap(*problem.active, pose, self.pair) for joint in joints}

    @property
    def open_contacts(self) -> tuple[str, ...]:
        """Labels of `contact_gaps` that are open: what touched at the nominal position and touches no more."""
        limit = self.problem.contact_slack
        return tuple(label for label, gap in self.contact_gaps.items() if gap > limit)

    def to_dict(self, *, problem: bool = True, sensitivity: bool = False) -> dict[str, Any]:
        """Return plain data (lists, numbers, strings) from which `from_dict` rebuilds the solution.

        As JSON has no such numbers, nan becomes None and infinity "inf". Without its `problem` where that is known;
        with its `sensitivity` where asked to, or where it was read back with it.
        """
        values = list(self.parameters.values())
        made = {
            "motion": self.problem.motion.describe(values, unit=self.problem.unit) if values else None,
            "snapped": self.problem.snapped,
            "sensitivity": self.sensitivity if sensitivity else self.derivatives,
        }
        names = self.plain_names[not problem :]
        return {name: plain(made[name] if name in made else getattr(self, name)) for name in names}

    @property
    def quaternion(self) -> tuple[float, float, float, float] | None:
        """The rotation of `transform` as a unit quaternion (x, y, z, w), in ROS' and SciPy's order; None without."""
        return None if self.transform is None else quaternion_of(self.transform)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Rebuild a solution from `to_dict`; raises `InputError` naming a missing or wrong key."""
        try:
            read = super().from_dict({**data, "derivatives": data["sensitivity"]})
        except KeyError as missing:
            what, found = f"not the plain data of a solution: no {missing}", ", ".join(data) or "nothing"
            raise InputError(what, key="Solution", found=found) from missing
        except TypeError as reason:
            raise InputError("not the plain data of a solution", key="Solution", found=str(reason)) from reason
        for key, shape in (("transform", (4, 4)), ("rho", (2,)), ("pair", (2,))):
            array = getattr(read, key)
            if array is not None and array.shape != shape:
                raise InputError("wrong shape", key=key, found=array.shape, allowed=str(shape))
            if array is not None and not np.isfinite(array).all():
                raise InputError("not finite numbers", key=key, found=array.tolist())
        for key, times in (("seconds", read.seconds), ("modelled", read.modelled)):
            if not all(0.0 <= own < np.inf for own in times.values()):
                raise InputError("not finite numbers >= 0", key=key, found=dict(times))
        if read.parameters and tuple(read.parameters) != (names := read.problem.motion.names):
            what, allowed = "not the motion's parameters", ", ".join(names)
            raise InputError(what, key="parameters", found=[*read.parameters], allowed=allowed)
        for key in ("usable", "gap", "snapped", "keep_out_gaps", "contact_gaps", "open_contacts"):
            own = plain(read.problem.snapped if key == "snapped" else getattr(read, key))
            if key in data and not agree(data[key], own, read.problem.contact_slack):
                raise InputError("does not follow from the rest", key=key, found=data[key], allowed=str(own))
        return read
