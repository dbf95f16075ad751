"""The tolerance problem: two bodies, a nominal contact, the scales actually made, a motion and a goal; plain data.

Everything is checked, and every default resolved, when a `Problem` is made: stages that read it check nothing again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.doors import Shown
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.files import NANOMETRES
from fcdm_opt.motion.motions import Motion, Screw
from fcdm_opt.problem import amounts, arguments
from fcdm_opt.problem.keep_out import keep_outs
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.curve.flush import Flush
    from fcdm_opt.curve.region import Piece
    from fcdm_opt.curve.segments import Segment, SwitchingPoint
    from fcdm_opt.curve.tight import TightLine

SIGNS: dict[str, tuple[float, float]] = {"A": (1.0, 1.0), "B": (1.0, -1.0), "C": (-1.0, 1.0), "D": (-1.0, -1.0)}
GOALS = ("beyond", "at", "seat", "touch", "clear")
TRACKING = ("beyond", "at", "seat")  # goals that follow the nominal contact
PAIR_STATES = ("any", "clear", "touch")
PATHS = ("coherent", "free")
MOST_TURNED = 100.0  # radians of turning beyond which a path is looked at no more closely


class Snapped(NamedTuple):
    """How a nominal pair was closed to the decision curve: the pair asked for, that on the curve, the gap closed."""

    asked: Array
    pair: Array
    gap: float

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {"asked": self.asked.tolist(), "pair": self.pair.tolist(), "gap": self.gap}


@dataclass(frozen=True, eq=False)
class Problem(Shown):
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
    goal : "beyond", "at", "seat", "touch" or "clear", optional
        Default: "beyond" at a switching point between two segments with a requirement, "seat" where the nominal contact
        is flush (at such a point too where it leaves no play), else "touch".
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
        is rounded to whole steps such that it still meets the requirement, see `fcdm_opt.tolerance.resolution`.
        Attribute: (k,) array, 0 where a parameter is not rounded, or None.
    features : (label, label), optional
        The two features to track at a switching point where more than two lines meet; default those of the segments
        that meet there. Attribute: two `Feature`, or None.
    snap : float
        For goals that need a nominal contact: a nominal pair off the curve is closed to the nearest point of the curve
        in the (rho_1, rho_2) plane, or to a switching point, where its gap is at most `snap` times the size of the
        bodies and neither scale changes by more than `snap`, relative; else it is refused. See `snapped`. "touch" and
        "clear" leave the pair as it is.
    name : str
        Name of the case.
    published : sequence of floats, optional
        Reference values of the motion's parameters, in their order, lengths and radians; never used in solving.
    published_text : str
        The reference motion in the words of its source.
    unit : "m", "cm", "mm", "um", "in", "ft" or ""
        Of all lengths, as shown with results; no number follows from it. Without it they are in length units.

    Attributes
    ----------
    request : dict
        The arguments as given, in plain form.

    Raises
    ------
    InputError
        Names the argument, what was found and what is allowed.
    """

    movable: Body = field(repr=False)
    static: Body = field(repr=False)
    _: KW_ONLY
    nominal: Any = "drawn"
    tolerance: Any = None
    requirement: str | None = None
    target: Any = None
    box: Any = ((0.8, 3.0), (0.8, 3.0))
    motion: Motion
    goal: Any = None
    pair: str = "any"
    clearance: float = 0.0
    path: str = "coherent"
    amount: Any = "weighted"
    length: Any = None
    weights: Any = None
    limits: Any = None
    keep_out: Any = ()
    resolution: Any = None
    features: Any = None
    snap: float = DEFAULT.snap
    name: str = ""
    published: tuple[float, ...] | None = None
    published_text: str = ""
    unit: str = ""
    request: dict[str, Any] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._check_motion()
        names = [parameter.name for parameter in self.motion.parameters]
        self._set(
            nominal=arguments.nominal(self.nominal),
            tolerance=arguments.tolerance(self.tolerance),
            target=arguments.target(self.target),
            box=arguments.box(self.box),
            clearance=arguments.length(self.clearance, "clearance"),
            keep_out=keep_outs(self.keep_out),
            length=self.length if self.length is None else arguments.positive(self.length, "length"),
            weights={
                key: arguments.positive(value, f"weights.{key}")
                for key, value in arguments.by_parameter(self.weights, "weights", names).items()
            },
            limits={
                key: arguments.interval(value, f"limits.{key}")
                for key, value in arguments.by_parameter(self.limits, "limits", names).items()
            },
            amount=amounts.amount(self.amount, names),
            resolution=arguments.steps(self.resolution, "resolution", names),
            features=arguments.labels(self.features, "features"),
            snap=arguments.real(self.snap, "snap", "a finite number >= 0", lambda x: x >= 0),
            published=arguments.published(self.published, names),
        )
        self._check_choices()
        self._check_nominal()
        self._set(request={name: self.__dict__[name] for name in _ARGUMENTS})
        self._resolve(names)

    def _set(self, **values: Any) -> None:
        for key, value in values.items():
            object.__setattr__(self, key, value)

    def _check_motion(self) -> None:
        for key, kind in (("movable", Body), ("static", Body), ("motion", Motion)):
            if not isinstance(getattr(self, key), kind):
                found = type(getattr(self, key)).__name__
                raise InputError("wrong kind of argument", key=key, found=found, allowed=f"a {kind.__name__}")
        count = len(self.motion.parameters)
        if count == 0:
            raise InputError("the motion has no parameters", key="motion", found=self.motion)
        if not any(isinstance(step, Screw) and step.axis == "seeds" for step in self.motion.steps):
            return
        away = float(np.linalg.norm(self.static.seed - self.movable.seed))
        if away <= DEFAULT.seeds * self.size:
            raise InputError(
                "the seeds coincide: they define no screw axis",
                key="motion.Screw.axis",
                found=away,
                allowed="a screw about a line (point, direction)",
            )

    def _check_choices(self) -> None:
        for key, choices in (
            ("requirement", (None, *SIGNS)),
            ("goal", (None, *GOALS)),
            ("pair", PAIR_STATES),
            ("path", PATHS),
            ("unit", ("", *NANOMETRES)),
        ):
            arguments.choice(getattr(self, key), key, choices)
        for key in ("name", "published_text"):
            if not isinstance(getattr(self, key), str):
                raise InputError("not a text", key=key, found=getattr(self, key), allowed="a string")
        self._check_agreement()

    def _check_agreement(self) -> None:
        """Refuse arguments that exclude each other, or that the goal would ignore."""
        if (self.requirement is None) == (self.target is None):
            found = "neither" if self.target is None else f"requirement {self.requirement!r} and target {self.target}"
            raise InputError(
                "exactly one of requirement and target must be given",
                key="requirement",
                found=found,
                allowed='requirement "A", "B", "C" or "D" with a tolerance, or a target (rho_1, rho_2)',
            )
        if (self.requirement is None) != (self.tolerance is None):
            what = "a requirement needs a tolerance" if self.tolerance is None else "a target takes no tolerance"
            found = "no tolerance" if self.tolerance is None else self.tolerance
            raise InputError(what, key="tolerance", found=found, allowed="requirement and tolerance, or target alone")
        if self.clearance > 0 and "clear" not in (self.goal, self.pair):
            raise InputError(
                "nothing asks for this clearance",
                key="clearance",
                found=self.clearance,
                allowed='0, or goal = "clear", or pair = "clear"',
            )
        if self.clearance > 0 and "touch" in (self.goal, self.pair):
            raise InputError(
                "the target pair cannot touch and keep a clearance",
                key="pair",
                found=f"goal {self.goal!r}, pair {self.pair!r}, clearance {self.clearance}",
                allowed='clearance = 0, or "clear" without "touch"',
            )

    def _check_nominal(self) -> None:
        if not isinstance(self.nominal, int) or self.nominal <= len(self.curve.switching_points):
            return
        points = self.curve.switching_points
        listed = ", ".join(f"{k} at ({point.rho[0]:.6g}, {point.rho[1]:.6g})" for k, point in enumerate(points, 1))
        raise InputError(
            f"no such switching point in the box {self.box}",
            key="nominal",
            found=self.nominal,
            allowed=f"one of {len(points)}: {listed}" if points else "a scale pair; the curve has no switching point",
        )

    # --------------------------------------------------------------------------------------------- resolved values

    def _resolve(self, names: list[str]) -> None:
        weights, limits = self.weights, self.limits
        length = self.movable.size / 2 if self.length is None else self.length
        own = dict(zip(names, self.motion.weights(length).tolist(), strict=True))
        self._set(
            tolerance=arguments.rows(self.tolerance),
            length=length,
            weights=frozen([weights.get(name, own[name]) for name in names]),
            limits=frozen([limits.get(name, (-math.inf, math.inf)) for name in names]),
        )
        if self.resolution is not None:
            self._set(resolution=frozen([self.resolution.get(name, 0.0) for name in names]))
        self._set(goal=self._chosen_goal())
        self._set(target=self._made_pair())
        self._check_goal()
        self._set(features=self._named_features())

    def _made_pair(self) -> Array:
        if self.requirement is None:
            return frozen(self.target)
        sides = zip(self.nominal_pair.tolist(), SIGNS[self.requirement], self.tolerance.tolist(), strict=True)
        target = [scale * (1.0 + sign * (minus if sign < 0 else plus)) for scale, sign, (minus, plus) in sides]
        if not all(0.0 < scale < math.inf for scale in target):
            raise InputError(
                f"requirement {self.requirement} would make the scales {target}",
                key="tolerance",
                found=self.request["tolerance"],
                allowed="below 1 (100 %) where a body is made smaller",
            )
        return frozen(target)

    def _chosen_goal(self) -> str:
        if self.goal is not None:
            return str(self.goal)
        from fcdm_opt.curve.segments import SwitchingPoint

        contact = self.nominal_contact
        at_point = self.requirement is not None and isinstance(contact, SwitchingPoint) and not contact.alone
        normals = np.array([seat.normal for seat in self.nominal_seats]).reshape(-1, 3)
        no_play = (normals @ normals.T <= DEFAULT.nominal - 1.0).any()  # held from two sides
        if at_point and not no_play:
            return "beyond"
        if self.nominal_seats:
            return "seat"
        for key in ("nominal_contact", "nominal_pair", "_closed"):  # "touch" takes the nominal pair as asked for
            self.__dict__.pop(key, None)
        return "touch"

    def _check_goal(self) -> None:
        goal = self.goal
        if goal not in TRACKING:
            return
        if self.nominal_contact is None:
            asked = self.nominal_pair
            nearest = self.curve.nearest(asked)
            near = f"nearest to it is {nearest.tolist()}" if np.isfinite(nearest).all() else "the bodies have none near"
            raise InputError(
                f'goal "{goal}" tracks the nominal contact, but the nominal pair is not on the decision curve: {near}; '
                f"the gap there is {self.curve.gap(asked):.6g} (> 0 apart, < 0 overlapping), and one of "
                f"{self.snap * self.size:.3g} (snap times the size) would be closed if no scale changed by more than "
                f"{self.snap:.3g} (snap) of what was asked",
                key="nominal",
                found=asked.tolist(),
                allowed='a switching point, a pair on the curve, a larger snap, or goal "touch" or "clear"',
            )
        if goal == "beyond" and not self._at_switching_point:
            raise InputError(
                "the nominal pair lies inside a segment, and a long segment reaches the quadrant beyond the target "
                "pair with no motion at all, so the goal would say nothing",
                key="goal",
                found=goal,
                allowed='"at" or "touch" there; "beyond" at a switching point',
            )
        if goal == "beyond" and not self.signs.all():
            raise InputError(
                'goal "beyond" needs a direction for both scales, but the target equals the nominal pair in one',
                key="target",
                found=self.target.tolist(),
                allowed=f"both scales off {self.nominal_pair.tolist()}",
            )
        if goal == "seat" and not self.nominal_seats:
            contact = self.nominal_contact
            found = getattr(contact, "configurations", None) or (getattr(contact, "configuration", ""),)
            raise InputError(
                'goal "seat" keeps flush contacts flush, but the nominal contact shares no more than a point',
                key="goal",
                found=f'"seat" at a nominal contact {" and ".join(found)}',
                allowed='a nominal contact F-F, F-E or E-E parallel; "at" or "touch" at this one',
            )

    def _named_features(self) -> tuple[Feature, Feature] | None:
        """Return the features that were named, which must touch at the nominal switching point."""
        if self.features is None:
            return None
        from fcdm_opt.curve.tight import parallel

        lines = {line.feature: line for line in self._tight_lines}
        if not lines:
            found = f'goal "{self.goal}"' if self.goal not in TRACKING else "a nominal pair off the switching points"
            allowed = 'a switching point and goal "beyond", "at" or "seat"'
            raise InputError("there are no two features to choose from", key="features", found=found, allowed=allowed)
        chosen = []
        for k, label in enumerate(self.features, 1):
            try:
                feature = Feature.from_label(label)
            except InputError as reason:
                raise reason.within(key=f"features[{k}]") from reason
            if feature not in lines:
                listed = "; ".join(str(name) for name in lines)
                raise InputError(
                    "no such feature touches at the nominal point", key=f"features[{k}]", found=label, allowed=listed
                )
            chosen.append(lines[feature])
        if parallel(chosen[0].line, chosen[1].line):
            others = "; ".join(str(name) for name in lines)
            raise InputError(
                "the lines of these two features are parallel: they fix no point",
                key="features",
                found=" and ".join(self.features),
                allowed=f"two of different direction: {others}",
            )
        return chosen[0].feature, chosen[1].feature

    @cached_property
    def _tight_lines(self) -> tuple[TightLine, ...]:
        """The lines that meet at the nominal switching point; none elsewhere, and where the goal tracks nothing."""
        from fcdm_opt.curve.segments import SwitchingPoint
        from fcdm_opt.curve.tight import tight_lines

        contact = self.nominal_contact
        return tight_lines(contact) if self.goal in TRACKING and isinstance(contact, SwitchingPoint) else ()

    @property
    def feature_pairs(self) -> tuple[tuple[str, str], ...]:
        """Two features each, by label, that the nominal point may keep, where three or more lines meet in it.

        See `fcdm_opt.curve.tight.choices`. Empty where two were named, or there is no choice.
        """
        from fcdm_opt.curve.segments import SwitchingPoint
        from fcdm_opt.curve.tight import choices

        contact = self.nominal_contact
        if self.features is not None or self.goal not in TRACKING or not isinstance(contact, SwitchingPoint):
            return ()
        return tuple((one.label, two.label) for one, two in choices(contact))

    @property
    def tracked_lines(self) -> tuple[TightLine | Piece, ...]:
        """What is tracked of the nominal contact: two lines at a switching point, one inside a segment."""
        from fcdm_opt.curve.segments import Segment

        contact = self.nominal_contact
        if self.goal not in TRACKING or contact is None:
            return ()
        if isinstance(contact, Segment):
            return (contact.piece_at(self.nominal_pair),)
        if self.features is None:
            return contact.pieces
        named = {line.feature: line for line in self._tight_lines}
        return tuple(named[feature] for feature in self.features)

    @property
    def amount_unit(self) -> str:
        """Unit of the amount: `unit`, and "" for an amount of one's own, which need not be a length."""
        return self.unit if isinstance(self.amount, str) else ""

    @property
    def size(self) -> float:
        """Length that relative tolerances refer to: the larger box diagonal of the bodies as drawn."""
        return max(self.movable.size, self.static.size)

    def play(self, q: Array) -> float:
        """Return how far a vertex of body 1 as made may move when every parameter changes by its step; 0 without.

        A goal that is an equation can be met in whole steps to within this length.
        """
        if self.resolution is None:
            return 0.0
        points = self.movable.seed + self.target[0] * (self.movable.vertices - self.movable.seed)
        return self.motion.play(q, self.resolution, points, self.movable.seed, self.static.seed)

    @property
    def contact_slack(self) -> float:
        """Gap up to which a pair touches, length units.

        Relative to the smaller body, but no less than rounding at the larger one allows.
        """
        smaller = min(self.movable.size, self.static.size)
        return max(DEFAULT.touch * smaller, DEFAULT.tie * self.size)

    @cached_property
    def curve(self) -> DecisionCurve:
        """Decision curve of the bodies as drawn, in the box; problems about the same bodies share it."""
        from fcdm_opt.curve.decision_curve import drawn_curve

        return drawn_curve(self.movable, self.static, self.box)

    @cached_property
    def nominal_contact(self) -> Segment | SwitchingPoint | None:
        """The switching point or segment that the nominal pair lies on, None where it lies on neither."""
        return self._located if self._closed is None else self._closed[0]

    @cached_property
    def _located(self) -> Segment | SwitchingPoint | None:
        """What the nominal pair lies on as asked for."""
        if isinstance(self.nominal, int):
            return self.curve.switching_points[self.nominal - 1]
        return self.curve.locate(self._asked_pair, DEFAULT.nominal)

    @cached_property
    def _closed(self) -> tuple[Segment | SwitchingPoint, Snapped] | None:
        """What a nominal pair slightly off the curve is closed to, None where it is left as it is.

        A switching point within `snap` comes first; goal "beyond" speaks of nothing else.
        """
        if self.goal not in (None, *TRACKING) or isinstance(self.nominal, int):
            return None
        from fcdm_opt.curve.segments import Segment, SwitchingPoint

        located = self._located
        if isinstance(located, SwitchingPoint) or (isinstance(located, Segment) and self.goal != "beyond"):
            return None
        asked = np.array(self._asked_pair)
        gap = float(self.curve.gap(asked))
        if abs(gap) > self.snap * self.size:
            return None
        for point in self.curve.switching_points:
            if self._within_snap(point.rho, asked):
                return point, Snapped(asked, point.rho, gap)
        nearest = self.curve.nearest(asked)
        if located is not None or not self._within_snap(nearest, asked):
            return None
        contact = self.curve.locate(nearest, DEFAULT.nominal)
        return None if contact is None else (contact, Snapped(asked, nearest, gap))

    def _within_snap(self, pair: Array, asked: Array) -> bool:
        """Tell whether neither scale differs from the one asked for by more than `snap`; never for nan."""
        return bool(np.abs(pair / asked - 1.0).max() <= self.snap)

    @property
    def snapped(self) -> Snapped | None:
        """How the nominal pair was closed to the curve, None where it was not."""
        return None if self._closed is None else self._closed[1]

    @cached_property
    def nominal_pair(self) -> Array:
        """Nominal scales, (2,): those of the switching point where it is one, and on the curve where closed to it."""
        from fcdm_opt.curve.segments import SwitchingPoint

        contact = self.nominal_contact
        if isinstance(contact, SwitchingPoint):
            return frozen(contact.rho)
        return frozen(self._asked_pair if self.snapped is None else self.snapped.pair)

    @cached_property
    def nominal_seats(self) -> tuple[Flush, ...]:
        """The flush contacts at the nominal pair, tracked or besides; none off the curve."""
        return () if self.nominal_contact is None else self.curve.flush(self.nominal_pair)

    @property
    def nominal_features(self) -> tuple[Feature, ...]:
        """The features of the nominal contact: two at a switching point, one inside a segment, none off the curve."""
        from fcdm_opt.curve.segments import Segment

        contact = self.nominal_contact
        if contact is None:
            return ()
        if self.features is not None:
            return tuple(self.features)
        return (contact.feature,) if isinstance(contact, Segment) else contact.features

    @property
    def tracked_features(self) -> tuple[Feature, ...]:
        """The features that the goal follows: the nominal ones, for "seat" all flush contacts there besides."""
        if self.goal not in TRACKING:
            return ()
        own = self.nominal_features
        others = self.nominal_seats if self.goal == "seat" else ()
        return (*own, *dict.fromkeys(seat.touching for seat in others if not {seat.feature, seat.touching} & set(own)))

    @property
    def _asked_pair(self) -> Any:
        return (1.0, 1.0) if self.nominal == "drawn" else self.nominal

    @cached_property
    def signs(self) -> Array:
        """Which way the target pair is off the nominal pair, (2,): 1 or -1, and 0 where an explicit target is not.

        Within `Tolerances.nominal`, as a switching point's scales are known up to rounding.
        """
        if self.requirement is not None:
            return frozen(SIGNS[self.requirement])
        off = self.target - self.nominal_pair
        return frozen(np.where(np.abs(off) <= DEFAULT.nominal * self.nominal_pair, 0.0, np.sign(off)))

    @property
    def _at_switching_point(self) -> bool:
        from fcdm_opt.curve.segments import SwitchingPoint

        return isinstance(self.nominal_contact, SwitchingPoint)

    # --------------------------------------------------------------------------------------------------- plain data

    def changed(self, **arguments: Any) -> Problem:
        """Return the same question with other arguments, resolved anew; raises as the constructor does.

        Of what does not depend on these nothing is checked again.
        """
        if all(key in _SIZES and (value is None) == (self.request[key] is None) for key, value in arguments.items()):
            return self._resized(arguments)
        return Problem(**{**self.request, **arguments})

    def _resized(self, sizes: Mapping[str, Any]) -> Problem:
        """Return the same question for another tolerance or target, of which nothing depends but the pair made."""
        request = {**self.request, **{key: check(sizes[key]) for key, check in _SIZES.items() if key in sizes}}
        other = object.__new__(Problem)
        other.__dict__.update((key, self.__dict__[key]) for key in _STAYS if key in self.__dict__)
        other._set(request=request, tolerance=arguments.rows(request["tolerance"]), target=request["target"])
        other._set(target=other._made_pair())
        other._check_goal()
        return other

    def to_dict(self) -> dict[str, Any]:
        """Return the question as plain data: the keys of a problem file with one case, angles in radians."""
        from fcdm_opt.problem.files import problem_to_dict

        return problem_to_dict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Problem:
        """Rebuild a problem from `to_dict`, bit for bit, or from the contents of a problem file with one case.

        Raises
        ------
        InputError
            Names the key, what was found and what is allowed.
        """
        from fcdm_opt.problem.files import problem_from_dict

        return problem_from_dict(data)


_ARGUMENTS = tuple(item.name for item in fields(Problem) if item.init)

_SIZES = {"tolerance": arguments.tolerance, "target": arguments.target}
"""Arguments that only the target pair depends on."""

_STAYS = (
    *(name for name in _ARGUMENTS if name not in _SIZES),
    *("curve", "_located", "_closed", "nominal_contact", "nominal_pair", "nominal_seats", "_tight_lines"),
)
"""What is the same for other sizes: attributes, and cached values of the nominal contact."""
