"""The tolerance problem: two bodies, a nominal contact, the scales actually made, a motion and a goal; plain data.

Everything is checked, and every default resolved, when a `Problem` is made: stages that read it check nothing again.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from fcdm_opt.curve.carried_over import CarriedOver
from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.curve.true_sizes import ROLES, TrueContact, contacts_as_drawn, made_at
from fcdm_opt.errors import InputError, known_arguments
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.exact_points import exact_at
from fcdm_opt.geometry.matching import matched
from fcdm_opt.geometry.resizing import fit_for_sizes, resized
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.units import UnitOrNone, signed, unit_of
from fcdm_opt.lazy_import import NotebookRepr, imported
from fcdm_opt.motion.motions import Motion
from fcdm_opt.plain import plain
from fcdm_opt.problem.active_parts import AROUND, Indices, active_bodies
from fcdm_opt.problem.amounts import AmountWord, OwnAmount, amount
from fcdm_opt.problem.arguments import by_parameter, is_real
from fcdm_opt.problem.entries import plain_body, plain_keep_out
from fcdm_opt.problem.keep_out import KeepOut, keep_outs
from fcdm_opt.problem.keys import (
    ARGUMENTS,
    BY_PARAMETER,
    RESTORING_GOALS,
    Arguments,
    Case,
    Corner,
    Goal,
    PairState,
    PathWord,
    ProblemFile,
    Requirement,
    SizeKeys,
    checked_arguments,
    with_defaults,
)
from fcdm_opt.problem.nominal import FIT, TRACKING, NominalContact
from fcdm_opt.problem.scene import AnyScene, Coordinate
from fcdm_opt.problem.schema import checked, known_sizes
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from casadi import SX, Function

    from fcdm_opt.motion.kinematics import Kinematics

FREE = (-math.inf, math.inf)  # limits of a parameter that has none
SCALES = ("rho_1", "rho_2")  # names of the scales of the movable and of the static body
SIGNS: dict[str, tuple[float, float]] = {"A": (1.0, 1.0), "B": (1.0, -1.0), "C": (-1.0, 1.0), "D": (-1.0, -1.0)}
GOALS = get_args(Goal)
MOST_TURNED = 100.0  # radians of turning beyond which a path is looked at no more closely
_MADE = ("tolerance", "target")  # arguments that only the target pair depends on
_NOMINAL = ("nominal_pair", "_nominal_pair_touches")  # of the nominal contact, besides where it is on the curve
_ON_CURVE = ("nominal_contact", "_closed")
_AS_DRAWN = (  # of contacts as drawn, and what is asked of them
    *(*_NOMINAL, *_ON_CURVE, "_located", "_touches", "_tight_lines", "nominal_seats", "nominal_joints", "alternatives"),
    *("goal", "contacts", "path", "pair", "touches_between_facets", "round_contacts", "signs"),
)
HALVINGS = 7  # of the sizes made, to where contacts as drawn are last there


@dataclass(frozen=True, eq=False, init=False)
class Problem(NominalContact, AnyScene, NotebookRepr):
    """The question: which smallest motion brings the parts actually made into the intended contact.

    The arguments are what the user asks; the attributes of the same name hold what that means (`goal`, `target`,
    `tolerance`, `length`, `weights`, `limits`, `amount`, `features` and `resolution` are resolved). `request` keeps
    the question itself; `changed` asks a similar one.

    Parameters
    ----------
    movable, static : Body
        Body 1, which moves with its seed, and body 2.
    nominal : int, (rho_1, rho_2) or "drawn"
        Nominal contact: the k-th switching point (from 1) of the decision curve in the box, or a scale pair; "drawn"
        is (1, 1). A pair within `Tolerances.nominal` of a switching point is that switching point.
    tolerance : tau, (tau_1, tau_2) or ((minus_1, plus_1), (minus_2, plus_2)), optional
        Relative scale tolerances, >= 0 and below 1 (0.02 is 2 %); goes with `requirement`. Attribute: (2, 2) array,
        one row a body, or None.
    requirement : "A", "B", "C" or "D", optional
        Which way each body is off its nominal scale: (+, +), (+, -), (-, +), (-, -).
    target : (rho_1, rho_2), optional
        The scales made, in place of `requirement`. Attribute: (2,) array, nominal * (1 + tau * signs) where a
        requirement is given.
    box : ((low_1, high_1), (low_2, high_2))
        Scales in which the decision curve is shown and its switching points are numbered.
    motion : Motion
        The family of motions to choose from.
    goal : "beyond", "at", "seat", "touch", "clear" or "fit", optional
        Default: "at" with `contacts`; "beyond" at a switching point between two segments with a requirement, "seat"
        where the nominal contact is flush (at such a point too where it leaves no play), else "touch".
    pair : "any", "clear" or "touch"
        State of the target pair that is required besides the goal.
    clearance : float
        Least gap of the target pair, length units, for goal "clear" or pair "clear".
    path : "coherent" or "free"
        Whether the tracked features must stay the real contact along the motion.
    amount : "weighted", "displacement", casadi.SX or casadi.Function
        What is minimised: sqrt(sum (w_k q_k)^2); the largest displacement of a vertex of body 1 at its target scale;
        or a number >= 0 of one's own: an expression of scalar symbols named like the motion's parameters, or a function
        of their vector. It should be smooth; a norm, which is not at rest, is minimised by its square. Attribute: the
        word, or an `OwnAmount`, which is called with q.
    length : float, optional
        Length that turns radians into lengths; default half the diagonal of the movable body's box as drawn.
    weights : mapping of parameter name to positive number, optional
        Replaces single weights, in amount per length unit or radian. Attribute: (k,) array of all weights.
    limits : mapping of parameter name to (lower, upper), optional
        Length units or radians. Attribute: (k, 2) array, infinite where nothing is given.
    keep_out : sequence of KeepOut or Body
        Further static bodies that the movable body, moved and at its target scale, must keep clear of; a plain body
        at scale 1 and without clearance. Attribute: tuple of KeepOut, each with a name of its own.
    resolution : number or mapping of parameter name to number > 0, optional
        The machine's steps, length units or radians; a plain number is the step of every parameter. The motion found
        is rounded to whole steps such that it still meets the requirement, see `fcdm_opt.stages.after_weighted`.
        Attribute: (k,) array, 0 where a parameter is not rounded, or None.
    features : (label, label), optional
        The two features to track at a switching point where more than two lines meet; default those of the segments
        that meet there. Attribute: two `Feature`, or None.
    contacts : "all" or sequence of labels, optional
        Contacts of the nominal position that goal "at" or "seat" restores together, at the end of the motion, with
        nothing overlapping; flush ones stay flush. Goal "fit" leaves none of them overlapping and makes the largest of
        their gaps least. Default "all" for "at" and "seat" of sizes made. Attribute: tuple of `Feature`, empty where
        the goal tracks one contact, or none; with some, `path` is "free", and `pair` is "touch", of "fit" "clear".
    exact_at : mapping of "movable", "static" to (n, 3) arrays, optional
        Points of round faces, of the bodies of the sizes made, at which these are exact; elsewhere they are within the
        true ones. `solve` finds those that an answer needs, see `fcdm_opt.model.true_faces`.
    snap : float
        For goals that need a nominal contact: a nominal pair off the curve is closed to the nearest point of the curve
        in the (rho_1, rho_2) plane, or to a switching point, where its gap is at most `snap` times the size of the
        bodies and neither scale changes by more than `snap`, relative; else it is refused. See `snapped`. "touch" and
        "clear" leave the pair as it is.
    sizes : sequence of Size, optional
        Ways in which the bodies can come out different from drawn.
    made : mapping of size name to deviation, or "worst", "loosest", "low", "high", "middle", optional
        Makes `movable` and `static` the bodies of these sizes, 0 where none is given: all else is asked of them, and
        the target is (1, 1) unless sizes are asked for besides. Words are corners of the tolerances, see
        `fcdm_opt.curve.true_sizes.made_at`. Attribute: deviations by name, or None.
    name : str
        Name of the case.
    published : sequence of floats, optional
        Reference values of the motion's parameters, in their order, lengths and radians; never used in solving.
    published_text : str
        The reference motion in the words of its source.
    unit : "m", "cm", "mm", "um", "in", "ft" or ""
        Of all lengths, as shown with results; no number follows from it. By default that of the bodies; where these
        name none, lengths are in length units.

    Attributes
    ----------
    request : dict
        The arguments as given, in plain form.

    Raises
    ------
    InputError
        Names the argument, what was found and what is allowed.
    """

    bodies_made: Mapping[str, Body]
    tolerance: Any
    requirement: Requirement | None
    target: Array
    motion: Motion
    goal: Goal
    pair: PairState
    clearance: float
    path: PathWord
    length: float
    weights: Array
    limits: Array
    exact_at: Any
    published: tuple[float, ...] | None
    published_text: str

    def __init__(
        self,
        movable: Body,
        static: Body,
        *,
        nominal: int | Literal["drawn"] | Sequence[float] | Array = "drawn",
        tolerance: float | Sequence[Any] | Array | None = None,
        requirement: Requirement | None = None,
        target: Sequence[float] | Array | None = None,
        box: Sequence[Sequence[float]] | Array = ((0.8, 3.0), (0.8, 3.0)),
        motion: Motion,
        goal: Goal | None = None,
        pair: PairState = "any",
        clearance: float = 0.0,
        path: PathWord | None = None,
        amount: AmountWord | OwnAmount | SX | Function = "weighted",
        length: float | None = None,
        weights: Mapping[str, float] | None = None,
        limits: Mapping[str, Sequence[float]] | None = None,
        keep_out: Sequence[KeepOut] = (),
        resolution: float | Mapping[str, float] | None = None,
        features: Sequence[Any] | None = None,
        contacts: Literal["all"] | list[Any] | tuple[Any, ...] | None = None,
        exact_at: Mapping[str, Any] | None = None,
        snap: float = DEFAULT.snap,
        sizes: Sequence[Size] = (),
        made: Mapping[str, float] | Corner | None = None,
        name: str = "",
        published: Sequence[float] | Array | None = None,
        published_text: str = "",
        unit: UnitOrNone = "",
        **unknown: Any,
    ) -> None:
        given = {key: value for key, value in locals().items() if key in ARGUMENTS}
        super().__init__(**_resolved({**given, **unknown}))
        self._check_goal()

    @cached_property
    def of_facets(self) -> Problem:
        """The same question about the parts as their files have them, without points at which they are exact."""
        return self if self.exact_at is None else self.changed(exact_at=None)

    def to_touch(self) -> Problem:
        """Return the question of goal "touch" about the same parts, which all that restores their contacts answers.

        Its `restoring` is this one.
        """
        other = self.of_facets.changed(goal="touch", contacts=None, path=None, pair="any")
        other.__dict__["restoring"] = self.of_facets
        return other

    @property
    def restoring(self) -> Problem | None:
        """The question of facets about contacts as drawn that is solved as this one, see `to_touch`; else None."""
        return self.of_facets.__dict__.get("restoring")

    @property
    def reformulated(self) -> Problem:
        """The question that is solved and judged for this one: itself, or where it restores contacts `to_touch`."""
        found: Problem = self.__dict__.get("_reformulated", self)
        return found

    @property
    def asked(self) -> Problem:
        """What was asked of the same parts where this is a question `to_touch`, which is `reformulated` of it."""
        if (drawn := self.restoring) is None:
            return self
        nominal = {key: own for key, own in vars(drawn).items() if key in _AS_DRAWN}
        own = {key: value for key, value in vars(self).items() if key not in ("restoring", *_AS_DRAWN)}
        request = {**drawn.request, "exact_at": self.exact_at}
        made = object.__new__(Problem)
        made.__dict__.update({**own, **nominal, "request": request, "of_facets": drawn, "_reformulated": self})
        return made

    @property
    def nominal_scales(self) -> dict[str, float]:
        """The nominal pair, by `SCALES`."""
        return dict(zip(SCALES, self.nominal_pair.tolist(), strict=True))

    @property
    def kinematics(self) -> dict[str, Kinematics]:
        """Of the movable body."""
        return {"movable": self.motion.kinematics(self.movable.seed, self.static.seed)}

    @property
    def relations(self) -> dict[tuple[str, str], Problem]:
        """The problem itself: it is about two parts."""
        return {ROLES: self}

    def __repr__(self) -> str:
        """Return what is asked, on one line; everything else is an attribute."""
        asked = f"requirement {self.requirement}" if self.requirement else "explicit target"
        made = f"at ({', '.join(f'{x:.6g}' for x in self.target.tolist())})"
        if self.made:
            asked = "by size"
            made = ", ".join(f"{name} {signed(x, 6)}" for name, x in self.made.items() if x) or "as drawn"
        steps = ", ".join(self.motion.names)
        bodies = f"{self.movable.name!r} against {self.static.name!r}"
        unit = f", {self.unit}" if self.unit else ""
        return f"Problem({self.name!r}: {bodies}, goal {self.goal!r}, {asked}, made {made}, motion {steps}{unit})"

    @property
    def _key_data(self) -> str:
        worked_out = (*(body.part_indices for body in self.active), self.restoring is None)
        return f"{super()._key_data} {self.goal} {self.pair} {self.clearance} {worked_out}"

    def play(self, q: Array) -> float:
        """Return how far a vertex of body 1 as made may move when every parameter changes by its step; 0 without.

        A goal that is an equation can be met in whole steps to within this length.
        """
        if self.resolution is None:
            return 0.0
        points = self.movable.seed + self.target[0] * (self.movable.vertices - self.movable.seed)
        return self.motion.play(q, self.resolution, points, self.movable.seed, self.static.seed)

    @cached_property
    def signs(self) -> Array:
        """Which way the target pair is off the nominal pair, (2,): 1 or -1, and 0 where an explicit target is not.

        Within `Tolerances.nominal`, as a switching point's scales are known up to rounding.
        """
        if self.requirement is not None:
            return frozen(SIGNS[self.requirement])
        off = self.target - self.nominal_pair
        return frozen(np.where(np.abs(off) <= DEFAULT.nominal * self.nominal_pair, 0.0, np.sign(off)))

    def _check_goal(self) -> None:
        if self.goal not in (*TRACKING, FIT) or self.touches_between_facets:
            return
        if not self.contacts and self.nominal_contact is None and self.round_contacts:
            what = f'as drawn round faces touch, between their facets, which goal "{self.goal}" does not follow so'
            allowed = '"at" or "seat" with shifts, or with turns of balls on faces and of cylinders on planes'
            raise InputError(what, key="goal", found=self.goal, allowed=f'{allowed}; "touch" or "clear"')
        self.check_goal(self.target, self.signs)

    @cached_property
    def touches_between_facets(self) -> bool:
        """Whether goal "at" or "seat" is about round parts that touch as drawn where no facets do; `touching_again`."""
        asked = self.goal in ("at", "seat") and not self.contacts and self.nominal_contact is None
        if not asked or self.resolution is not None or self.amount != "weighted" or not self.round_contacts:
            return False
        return self.motion.shifts or bool(imported("problem.contacts_restored:contact_balls")(self))

    @cached_property
    def round_contacts(self) -> list[TrueContact]:
        """Where parts touch as drawn on their true faces, a round one among each two; of whole parts."""
        movable, static = self.drawn.values()
        return contacts_as_drawn(movable, static, self.nominal_pair, DEFAULT.snap * self.size)

    def changed(self, **arguments: Any) -> Problem:
        """Return the same question with other arguments, resolved anew; raises as the constructor does.

        Of what does not depend on these nothing is checked again. A movable body that is turned, as in a pose sensed,
        keeps the `length` by which angles count. Another goal or pair drops the clearance, or the contacts, that it
        does not ask for.
        """
        if self.reformulated is not self:
            return self.of_facets.changed(**arguments)  # the points are of these sizes
        if not all(key in _MADE and (value is None) == (self.request[key] is None) for key, value in arguments.items()):
            turned = self.request["length"] is None and self.movable.is_turned(arguments.get("movable"))
            kept = {**self.request, **({"length": self.length} if turned else {})}
            return Problem(**with_defaults(kept, arguments))
        asked = checked_arguments(SizeKeys, arguments)
        request = {**self.request, **{key: getattr(asked, key) for key in arguments}}
        kept = {key: value for key, value in vars(self).items() if key not in ("signs", "of_facets", "restoring")}
        return _with_attributes({**kept, "request": request, **_sizes_made(request, self)})

    def with_sizes(self, values: Mapping[str, float]) -> Problem:
        """Return the same question for a target pair, or other sizes made, or both."""
        given: dict[str, Any] = {"goal": self.goal}
        if not values.keys().isdisjoint(SCALES):
            given |= {"target": [*self.scales_at(values).values()], "requirement": None, "tolerance": None}
        if made := {name: x for name, x in values.items() if name not in SCALES}:
            given["made"] = {**(self.made or {}), **made}
        return self.changed(**given)

    def with_limits(self, name: str, limits: tuple[float, float]) -> Problem:
        """Return the same question with other limits of a parameter."""
        return self.changed(limits={**self.request["limits"], name: limits})

    def with_motion(self, motion: Motion) -> tuple[Problem, tuple[str, ...]]:
        """Return the same question about another motion, and which limits, weights and steps it has no parameter for.

        Goal and length stay as they are.
        """
        names, given = set(motion.names), {key: self.request[key] for key in ("limits", "weights", "resolution")}
        given = {key: values for key, values in given.items() if isinstance(values, Mapping)}
        kept = {key: {k: x for k, x in values.items() if k in names} or None for key, values in given.items()}
        dropped = tuple(f"{key}.{k}" for key, values in given.items() for k in values if k not in names)
        same = {"goal": self.goal, "length": self.length, "published": None, "published_text": ""}
        return self.changed(motion=motion, **same, **kept), dropped

    def deviating(self, share: float) -> Problem:
        """Return the same question with a share of the deviation of its tolerance, or target, and of its sizes made."""
        sizes = {"made": {name: share * value for name, value in self.made.items()}} if self.made else {}
        if self.tolerance is not None:
            return self.changed(tolerance=(share * self.tolerance).tolist(), **sizes)
        nominal = self.nominal_pair
        return self.changed(target=(nominal + share * (self.target - nominal)).tolist(), **sizes)

    @property
    def deviates(self) -> bool:
        """Whether the target pair is off the nominal one, or a size off drawn."""
        return bool(self.signs.any()) or any((self.made or {}).values())

    def curve_after(self, transform: Array | None, rho: Array) -> DecisionCurve:
        """Return the decision curve after a motion; of large bodies about a scale pair, to tell what touches there."""
        low, high = rho * (1.0 - AROUND), rho * (1.0 + AROUND)
        about = (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))
        box = about if self.partial else self.box
        return decision_curve(*self.active, box=box, transform=transform)

    @cached_property
    def alternatives(self) -> tuple[Problem, ...]:
        """The same question for each of the `feature_pairs` that it may track; empty where there is no choice."""
        return tuple(self.changed(features=pair) for pair in self.feature_pairs)

    def with_exact_points(self, points: Mapping[str, Any]) -> Problem:
        """Return the same question with parts that are exact at points of round faces, see `exact_at`."""
        drawn = self.of_facets
        return _with_attributes({**_resolved({**drawn.request, "exact_at": points}, None, drawn), "of_facets": drawn})

    def restored_at(self, points: Mapping[str, Any]) -> Problem:
        """Return the same question `with_exact_points`; of contacts of round faces what is solved is `reformulated`."""
        return (imported("problem.contacts_restored:touching_again")(self) or self).with_exact_points(points).asked

    def with_active_parts(self, indices: Indices) -> Problem:
        """Return the same question with other parts of large bodies looked at; see `problem.active_parts`."""
        drawn = {} if self.exact_at is None else {"of_facets": self.of_facets}
        return _with_attributes({**_resolved(self.request, indices, self), **drawn})

    # --------------------------------------------------------------------------------------------------- plain data

    def to_dict(self) -> dict[str, Any]:
        """Return the question as plain data: the keys of a problem file with one case, angles in radians.

        Two problems are equal where these data are.
        """
        asked, kinds = self.request, dict(self.motion.parameters)
        keys = [key for key in Case.model_fields if key != "keep_out" and asked[key] not in (None, {})]
        case = {key: plain(asked[key]) for key in keys}
        case["motion"] = [step.own_plain() for step in self.motion.steps]
        if isinstance(asked["amount"], OwnAmount):
            case["amount"] = {"casadi": asked["amount"].text}
        for key in BY_PARAMETER.keys() & case.keys():
            suffix = BY_PARAMETER[key].radians
            case[key] = {name + suffix * (kinds[name] == "rotation"): value for name, value in case[key].items()}
        if asked["published"] is not None:
            case["published"] = _published(self.motion, asked["published"])
        others = [plain_keep_out(keep_out) for keep_out in self.keep_out]
        unit = {"unit": self.unit} if self.unit else {}
        bodies = {role: {**plain_body(asked[role]), **unit} for role in ROLES}
        more = {"keep_out": others, "size": [size.to_dict() for size in self.sizes]}
        return {"bodies": bodies, **{key: value for key, value in more.items() if value}, "case": [case]}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Problem:
        """Rebuild a problem from `to_dict`, bit for bit, or from the contents of a problem file with one case.

        Raises
        ------
        InputError
            Names the key, what was found and what is allowed.
        """
        data, points = _without_path(data), None
        with suppress(AttributeError, IndexError, KeyError, TypeError):  # of what is none, see below
            if data["case"][0].get("goal") not in ("touch", "clear"):  # the contacts are of parts without these points
                points = data["case"][0].get("exact_at")
                data = {**data, "case": [{k: x for k, x in own.items() if k != "exact_at"} for own in data["case"]]}
        problems = checked(ProblemFile, data).problems(cls)
        if len(problems) > 1:
            raise InputError("more than one case", key="case", found=len(problems), allowed="one")
        return problems[0] if points is None else problems[0].restored_at(points)


def _with_attributes(values: Mapping[str, Any]) -> Problem:
    """Return a problem of what its arguments mean, all but the goal known to go together."""
    made = object.__new__(Problem)
    made.__dict__.update(values)
    made._check_goal()
    return made


def _without_path(data: Any) -> Any:
    """Return plain data without the path "coherent" where several contacts may be meant: earlier versions wrote it."""
    cases = data.get("case") if isinstance(data, Mapping) else None
    if not isinstance(cases, Sequence) or not all(isinstance(table, Mapping) for table in cases):
        return data
    several = [bool(table.get("contacts")) or table.get("goal") in ("at", "seat") for table in cases]
    return {
        **data,
        "case": [
            {key: own for key, own in table.items() if not (some and (key, own) == ("path", "coherent"))}
            for table, some in zip(cases, several, strict=True)
        ],
    }


@known_arguments
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
    return ProblemFile.read(path).problems(Problem, Path(path))


def _published(motion: Motion, numbers: tuple[float, ...]) -> list[dict[str, Any]]:
    """Return reference values as a file has them, one table a step."""
    entries = []
    for step, values in zip(motion.steps, motion.by_step(numbers), strict=True):
        entry: dict[str, Any] = {}
        for (_, kind), value in zip(step.own_parameters, values, strict=True):
            entry.setdefault("translation" if kind == "translation" else "angle_rad", []).append(value)
        entries.append({key: own if len(own) > 1 else own[0] for key, own in entry.items()})
    return entries


# -------------------------------------------------------------------------------------------------- from asked to meant


def _resolved(
    given: Mapping[str, Any], indices: Indices | None = None, before: Problem | None = None
) -> dict[str, Any]:
    """Return what arguments of a problem mean: its attributes, see `Problem`."""
    # `before` is the same question with the first of the parts of `indices` alone: its nominal contact stays
    if given.get("made") and given.get("nominal", "drawn") == "drawn" and given.get("goal") in ("at", "seat"):
        # the curve of the parts made has no contact where they are: those drawn are to be restored
        given = {**given, "contacts": given.get("contacts") or "all"}
    asked = _asked(given)
    names, others = asked.motion.names, keep_outs(asked.keep_out)
    units = {"movable": asked.movable.unit, "static": asked.static.unit}
    units |= {f"keep_out[{k}]": other.body.unit for k, other in enumerate(others, 1)}
    # walls that the digits of files cannot tell apart are made the same
    one, two, *rest = matched((asked.movable, asked.static, *(other.body for other in others)), asked.motion.directions)
    request = {
        **{key: getattr(asked, key) for key in ARGUMENTS},
        "amount": amount(asked.amount, names),
        "unit": unit_of(asked.unit, units),
        **{"movable": one, "static": two, "keep_out": tuple(map(KeepOut.with_body, others, rest))},
    }
    request |= {role: fit_for_sizes(request[role], own) for role, own in _sizes_of(asked.sizes).items()}
    if before is None:
        parts = _parts_made(request)
    else:
        parts = {"movable": before.movable, "static": before.static, "made": before.made}
    points = asked.exact_at if before is None or before.exact_at is None else None
    if points is not None:
        parts |= _exact(request, parts, points)
    bodies = parts.get("movable", request["movable"]), parts.get("static", request["static"])
    if before is None and parts and asked.contacts is not None:
        contacts, indices = _contacts_made(request, parts)
        parts |= contacts
    parts["active"], parts["box"] = active_bodies(*bodies, request["nominal"], request["box"], indices)
    if before is not None:
        names_known = [*_NOMINAL, *(() if before._nominal_pair_touches else _ON_CURVE)]
        names_known += ["nominal_seats"] if before.goal in TRACKING else []
        parts |= {name: getattr(before, name) for name in names_known if points is None or name in vars(before)}
        if "nominal_seats" in parts:
            parts["nominal_seats"] = tuple(own.carried_by(*parts["active"]) for own in before.nominal_seats)
        if before.contacts:
            parts["nominal_joints"] = tuple(joint.carried_by(*parts["active"]) for joint in before.nominal_joints)
    contact = NominalContact(**{**request, **parts})
    contact.check_number()
    if asked.goal is None:
        goal = "at" if asked.contacts else contact.default_goal(asked.requirement is not None)
        as_asked = goal not in TRACKING  # "touch" takes the nominal pair as asked for, not as closed to the curve
        contact = NominalContact(**{**(request if as_asked else vars(contact)), **parts, "goal": goal})
    length = asked.movable.size / 2 if asked.length is None else asked.length
    usual = asked.motion.by_name(asked.motion.weights(length))
    steps = asked.resolution
    weights = frozen([asked.weights.get(name, usual[name]) for name in names])
    limits = frozen([asked.limits.get(name, FREE) for name in names])
    rows = zip(asked.motion.parameters, weights.tolist(), limits.tolist(), strict=True)
    made = _sizes_made(request, contact)
    features = contact.named(asked.features)
    several = contact.chosen_contacts(asked.contacts)
    if asked.contacts is None and contact.goal in ("at", "seat") and contact.nominal_contact is None:
        several = contact.chosen_contacts("all")  # at all sizes, if at all
    if contact.goal == "seat" and contact.partial and not _no_room(asked):
        several = several or contact.flush_contacts
    if contact.goal == "fit" and any(len(j.normals) > 1 for j in contact.nominal_joints if j.feature in several):
        what = 'goal "fit" measures gaps along a normal, and a contact at a corner or along edges has several'
        raise InputError(what, key="contacts", found=asked.contacts, allowed="contacts on a face, or of crossing edges")
    if several and asked.path == "coherent":
        what = "several contacts are restored together at the end of the motion, and the way there is not looked at"
        raise InputError(what, key="path", found="coherent", allowed='"free", or one contact')
    jointly = {"path": "free", "pair": "clear" if contact.goal == "fit" else "touch"} if several else {}
    return {
        **vars(contact),
        "path": asked.path or "coherent",
        **jointly,
        "contacts": several,
        **made,
        "request": request,
        "drawn": {role: request[role] for role in ROLES},
        "bodies_made": {"movable": contact.movable, "static": contact.static},
        "motions": {"movable": asked.motion},
        "length": length,
        "lengths": {"movable": length},
        "limit_slack": DEFAULT.requirement * length,
        "coordinates": tuple(Coordinate(name, kind, x, (low, high)) for (name, kind), x, (low, high) in rows),
        "weights": weights,
        "limits": limits,
        "resolution": None if steps is None else frozen([steps.get(name, 0.0) for name in names]),
        "features": features,
    }


def _asked(given: Mapping[str, Any]) -> Arguments:
    """Return checked arguments; raises `InputError` for what cannot be asked."""
    if given.get("made") and not given.get("sizes"):
        known_sizes(given["made"] if isinstance(given["made"], Mapping) else (), "made", ())
        allowed = "[[size]] tables, or sizes=[Size(...)]"
        raise InputError("there are no sizes to be made so", key="made", found=given["made"], allowed=allowed)
    motion, step = given.get("motion"), given.get("resolution")
    if given.get("sizes") and all(given.get(key) is None for key in ("requirement", "target", "tolerance")):
        given = {**given, "target": (1.0, 1.0)}
    names = motion.names if isinstance(motion, Motion) else ()
    if is_real(step):
        given = {**given, "resolution": dict.fromkeys(names, step)}
    try:
        asked: Arguments = checked_arguments(Arguments, given)
    except InputError as reason:
        if (reason.key or "").split(".")[0] not in (*BY_PARAMETER, "published"):
            raise
        allowed = f"{reason.allowed}: {', '.join(names)}"
        raise InputError(reason.what, key=reason.key, found=reason.found, allowed=allowed) from reason
    for key in BY_PARAMETER:
        by_parameter(getattr(asked, key), key, names)
    if asked.published is not None and len(asked.published) != len(names):
        allowed = f"{len(names)} finite numbers: {', '.join(names)}"
        what = "not one value for each motion parameter"
        raise InputError(what, key="published", found=asked.published, allowed=allowed)
    _check_motion(asked)
    _check_agreement(asked)
    return asked


def _parts_made(request: Mapping[str, Any]) -> dict[str, Any]:
    """Return the bodies of the sizes made, and these by name."""
    sizes, made = request["sizes"], request["made"]
    names = [size.name for size in sizes]
    for size in sizes:
        if size.body not in ROLES:
            allowed = '"movable" or "static"'
            raise InputError("no such body", key=f"size '{size.name}'.body", found=size.body, allowed=allowed)
        size.offsets(request[size.body])  # refused here if its faces are not there, whatever is made
    for name in names:
        if names.count(name) > 1:
            allowed = "a name that no other size has"
            raise InputError("two sizes have one name", key="sizes", found=name, allowed=allowed)
    if made is None:
        return {}
    known_sizes(made if isinstance(made, Mapping) else (), "made", names)
    values = made_at(request["movable"], request["static"], sizes, made)
    parts = {role: resized(request[role], own) for role, own in _by_role(sizes, values).items()}
    return {**parts, "made": values}


def _exact(request: Mapping[str, Any], parts: Mapping[str, Any], points: Mapping[str, Any]) -> dict[str, Any]:
    """Return the bodies made, exact at points of their round faces and elsewhere within the true ones."""
    if unknown := points.keys() - {"movable", "static"}:
        raise InputError("no such body", key="exact_at", found=min(unknown), allowed='"movable", "static"')
    own = {role: parts.get(role, request[role]) for role in ROLES}
    made = {role: exact_at(body, np.reshape(points.get(role, ()), (-1, 3))) for role, body in own.items()}
    for role, body in made.items():
        if body is None:
            what = "its facets stand for faces that are not known"
            raise InputError(what, key=f"exact_at.{role}", found=own[role].name, allowed="none")
    return made


def _by_role(sizes: Sequence[Size], values: Mapping[str, float]) -> dict[str, dict[Size, float]]:
    return {role: {size: values[size.name] for size in own} for role, own in _sizes_of(sizes).items()}


def _sizes_of(sizes: Sequence[Size]) -> dict[str, tuple[Size, ...]]:
    return {role: tuple(size for size in sizes if size.body == role) for role in ROLES}


def _contacts_made(request: Mapping[str, Any], parts: Mapping[str, Any]) -> tuple[dict[str, Any], Indices | None]:
    """Return the contacts of the bodies as drawn, on the bodies as made: those are to be restored; and active parts."""
    if isinstance(request["nominal"], int):
        what = "with sizes the contacts to restore are those of the parts as drawn"
        raise InputError(what, key="nominal", found=request["nominal"], allowed='"drawn", or a pair of scales')
    active, box = active_bodies(request["movable"], request["static"], request["nominal"], request["box"])
    drawn = NominalContact(**{**request, "goal": request["goal"] or "at", "active": active, "box": box})
    values, indices = _by_role(request["sizes"], parts["made"]), drawn.active_indices

    def contacts(share: float) -> dict[str, Any]:
        """Return them at a share of what is made."""
        its, made = {role: {size: share * x for size, x in own.items()} for role, own in values.items()}, []
        for role, body in zip(ROLES, active, strict=True):
            whole = parts[role] if share == 1.0 else resized(request[role], its[role])
            same = indices is not None and len(whole.parts) == len(request[role].parts)
            made.append(whole.subset(body.part_indices) if same else whole)
        over = CarriedOver(active, (made[0], made[1]), (its["movable"], its["static"]))
        return {
            **{name: getattr(drawn, name) for name in _NOMINAL},
            "nominal_joints": tuple(map(over.joint, drawn.nominal_joints)),
            "nominal_seats": tuple(map(over.flush, drawn.nominal_seats)),
        }

    try:
        return contacts(1.0), indices
    except InputError as reason:
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = (low + high) / 2.0
            try:
                contacts(middle)
            except InputError:
                high = middle
            else:
                low = middle
        found = ", ".join(f"{name} = {x:.6g}" for name, x in parts["made"].items() if x)
        allowed = f"deviations of {100.0 * low:.3g} % of these, or a question without contacts"
        raise InputError(reason.what, key=reason.key, found=found, allowed=allowed) from reason


def _check_motion(asked: Arguments) -> None:
    """Refuse a motion that does not move, or whose axis is not there."""
    if not asked.motion.parameters:
        raise InputError("the motion has no parameters", key="motion", found=asked.motion)
    if not asked.motion.along_seeds.any():
        return
    away = float(np.linalg.norm(asked.static.seed - asked.movable.seed))
    if away <= DEFAULT.seeds * max(asked.movable.size, asked.static.size):
        what = "the seeds coincide: they define no screw axis"
        raise InputError(what, key="motion.Screw.axis", found=away, allowed="a screw about a line (point, direction)")


def _check_agreement(asked: Arguments) -> None:
    """Refuse arguments that exclude each other, or that the goal would ignore."""
    if (asked.requirement is None) == (asked.target is None):
        found = "neither" if asked.target is None else f"requirement {asked.requirement!r} and target {asked.target}"
        what = "one of requirement, target and made says what is asked for, and no two of them"
        allowed = 'requirement "A", "B", "C" or "D" with a tolerance, target (rho_1, rho_2), or sizes and what is made'
        raise InputError(what, key="requirement", found=found, allowed=allowed)
    if (asked.requirement is None) != (asked.tolerance is None):
        what = "a requirement needs a tolerance" if asked.tolerance is None else "a target takes no tolerance"
        given = "no tolerance" if asked.tolerance is None else asked.tolerance
        raise InputError(what, key="tolerance", found=given, allowed="requirement and tolerance, or target alone")
    _check_several(asked)
    if asked.clearance > 0 and "clear" not in (asked.goal, asked.pair):
        allowed = '0, or goal = "clear", or pair = "clear"'
        raise InputError("nothing asks for this clearance", key="clearance", found=asked.clearance, allowed=allowed)
    if asked.clearance > 0 and "touch" in (asked.goal, asked.pair):
        what = "the target pair cannot touch and keep a clearance"
        found = f"goal {asked.goal!r}, pair {asked.pair!r}, clearance {asked.clearance}"
        raise InputError(what, key="pair", found=found, allowed='clearance = 0, or "clear" without "touch"')


def _no_room(asked: Arguments) -> list[tuple[str, Any, str]]:
    """Return what contacts that are restored together leave no room for: key, what is asked, what is allowed."""
    usual = (
        *((("amount", "weighted", '"weighted" with goal "fit"'),) if asked.goal == FIT else ()),
        ("features", None, "either features, two that are tracked, or contacts"),
    )
    return [(key, getattr(asked, key), allowed) for key, value, allowed in usual if getattr(asked, key) != value]


def _check_several(asked: Arguments) -> None:
    """Refuse what contacts that are restored together leave no room for."""
    if asked.contacts is None and asked.goal != "fit":
        return
    wrong: list[tuple[str, Any, str]] = []
    if asked.contacts is None:
        raise InputError('missing with goal "fit"', key="contacts", allowed='"all", or a list of labels')
    if asked.goal not in RESTORING_GOALS:
        allowed = f'"at", "seat" or "fit" with contacts, or goal {asked.goal!r} without contacts'
        wrong.append(("goal", asked.goal, allowed))
    if asked.pair == "clear" or (asked.goal == "fit" and asked.pair == "touch"):
        wrong.append(("pair", asked.pair, '"any" with contacts: nothing overlaps in any case'))
    for key, found, allowed in (*wrong, *_no_room(asked)):
        raise InputError("does not go with contacts that are restored together", key=key, found=found, allowed=allowed)


def _sizes_made(request: Mapping[str, Any], contact: NominalContact) -> dict[str, Any]:
    """Return the tolerance, a row (minus, plus) a body, and the target pair."""
    if request["requirement"] is None:
        return {"tolerance": None, **_target_of(request["target"])}
    both = request["tolerance"]
    both = (both, both) if isinstance(both, float) else both
    tolerance = frozen([(share, share) if isinstance(share, float) else share for share in both])
    sides = zip(contact.nominal_pair.tolist(), SIGNS[request["requirement"]], tolerance.tolist(), strict=True)
    target = [scale * (1.0 + sign * (minus if sign < 0 else plus)) for scale, sign, (minus, plus) in sides]
    if not all(0.0 < scale < math.inf for scale in target):
        what = f"requirement {request['requirement']} would make the scales {target}"
        allowed = "below 1 (100 %) where a body is made smaller"
        raise InputError(what, key="tolerance", found=request["tolerance"], allowed=allowed)
    return {"tolerance": tolerance, **_target_of(target)}


def _target_of(scales: Sequence[float]) -> dict[str, Any]:
    return {"target": frozen(scales), "scales_made": dict(zip(ROLES, map(float, scales), strict=True))}
