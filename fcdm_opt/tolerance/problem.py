"""The tolerance problem: two bodies, a nominal contact, the scales actually made, a motion and a goal; plain data.

Everything is checked, and every default resolved, when a `Problem` is made: stages that read it check nothing again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import KW_ONLY, dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.motion import Motion, Screw
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.curve.segments import Segment, SwitchingPoint

SIGNS: dict[str, tuple[float, float]] = {"A": (1.0, 1.0), "B": (1.0, -1.0), "C": (-1.0, 1.0), "D": (-1.0, -1.0)}
GOALS = ("beyond", "at", "touch", "clear")
PAIR_STATES = ("any", "clear", "touch")
PATHS = ("coherent", "free")
MOST_TURNED = 100.0  # radians of turning beyond which a path is looked at no more closely
LARGEST = 1e30  # of any number: sums and products of lengths, weights and scales stay finite


@dataclass(frozen=True, eq=False)
class Problem:
    """The question: which smallest motion brings the parts actually made into the intended contact.

    The arguments are what the user asks; the attributes of the same name hold what that means (`goal`, `target`,
    `tolerance`, `length`, `weights` and `limits` are resolved). `request` keeps the question itself; `changed` asks a
    similar one.

    Parameters
    ----------
    movable, static : Body
        Body 1, which moves with its seed, and body 2.
    nominal : int, (rho_1, rho_2) or "drawn"
        Nominal contact: the k-th switching point (from 1) of the decision curve in the box, or a scale pair; "drawn"
        is (1, 1). A pair within `Tolerances.nominal` of a switching point is that switching point.
    tolerance : tau, (tau_1, tau_2) or ((minus_1, plus_1), (minus_2, plus_2)), optional
        Relative scale tolerances, >= 0; goes with `requirement`. Attribute: (2, 2) array, one row a body, or None.
    requirement : "A", "B", "C" or "D", optional
        Which way each body is off its nominal scale: (+, +), (+, -), (-, +), (-, -).
    target : (rho_1, rho_2), optional
        The scales made, in place of `requirement`. Attribute: (2,) array, nominal * (1 + tau * signs) where a
        requirement is given.
    box : ((low_1, high_1), (low_2, high_2))
        Scales in which the decision curve is shown and its switching points are numbered.
    motion : Motion
        The family of motions to choose from.
    goal : "beyond", "at", "touch" or "clear", optional
        Default: "beyond" at a switching point with a requirement, else "touch".
    pair : "any", "clear" or "touch"
        State of the target pair that is required besides the goal.
    clearance : float
        Least gap of the target pair, length units, for goal "clear" or pair "clear".
    path : "coherent" or "free"
        Whether the tracked features must stay the real contact along the motion.
    amount : "weighted"
        What is minimised: sqrt(sum (w_k q_k)^2).
    length : float, optional
        Length that turns radians into lengths; default half the diagonal of the movable body's box as drawn.
    weights : mapping of parameter name to positive number, optional
        Replaces single weights, in amount per length unit or radian. Attribute: (k,) array of all weights.
    limits : mapping of parameter name to (lower, upper), optional
        Length units or radians. Attribute: (k, 2) array, infinite where nothing is given.
    keep_out, resolution
        Not available in this version: anything but the defaults is refused.
    snap : float
        Relative distance within which a nominal pair near the curve may be closed to it. This version closes none: a
        goal that needs a nominal contact refuses a pair that is not on the curve.
    name : str
        Name of the case.
    published : sequence of floats, optional
        Reference values of the motion's parameters, in their order, lengths and radians; never used in solving.
    published_text : str
        The reference motion in the words of its source.

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
    amount: str = "weighted"
    length: Any = None
    weights: Any = None
    limits: Any = None
    keep_out: tuple[Body, ...] = ()
    resolution: Any = None
    snap: float = DEFAULT.snap
    name: str = ""
    published: tuple[float, ...] | None = None
    published_text: str = ""
    request: dict[str, Any] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._check_motion()
        names = [parameter.name for parameter in self.motion.parameters]
        self._set(
            nominal=_nominal(self.nominal),
            tolerance=_tolerance(self.tolerance),
            target=None if self.target is None else _pair(self.target, "target", "two scales > 0", positive=True),
            box=_box(self.box),
            clearance=_real(self.clearance, "clearance", "a finite length >= 0", lambda x: x >= 0),
            length=self.length if self.length is None else _positive(self.length, "length"),
            weights={
                key: _positive(value, f"weights.{key}")
                for key, value in _by_parameter(self.weights, "weights", names).items()
            },
            limits={
                key: _interval(value, f"limits.{key}")
                for key, value in _by_parameter(self.limits, "limits", names).items()
            },
            snap=_real(self.snap, "snap", "a finite number >= 0", lambda x: x >= 0),
            published=_published(self.published, names),
        )
        self._check_choices()
        self._check_nominal()
        self._set(request={item.name: getattr(self, item.name) for item in fields(self) if item.init})
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
        away = float(np.linalg.norm(self.static.seed - self.movable.seed))
        between = any(isinstance(step, Screw) and step.axis == "seeds" for step in self.motion.steps)
        if between and away <= DEFAULT.seeds * self.size:
            raise InputError(
                "the seeds coincide: they define no screw axis",
                key="motion.Screw.axis",
                found=away,
                allowed="a screw about a line (point, direction)",
            )

    def _check_choices(self) -> None:
        for key, choices, later in (
            ("requirement", (None, *SIGNS), ()),
            ("goal", (None, *GOALS), ("seat",)),
            ("pair", PAIR_STATES, ()),
            ("path", PATHS, ()),
        ):
            _choice(getattr(self, key), key, choices, later)
        if not (isinstance(self.amount, str) and self.amount == "weighted"):
            raise InputError("not available in this version", key="amount", found=self.amount, allowed='"weighted"')
        if not isinstance(self.keep_out, list | tuple) or len(self.keep_out) > 0:
            raise InputError("not available in this version", key="keep_out", found=self.keep_out, allowed="()")
        if self.resolution is not None:
            raise InputError("not available in this version", key="resolution", found=self.resolution, allowed="None")
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
        tolerance = None if self.tolerance is None else frozen(_per_body(self.tolerance))
        weights, limits = self.weights, self.limits
        length = self.movable.size / 2 if self.length is None else self.length
        made = np.array(self.motion.weights(length))
        made[[names.index(key) for key in weights]] = list(weights.values())
        bounds = np.tile([-math.inf, math.inf], (len(names), 1))
        for key, interval in limits.items():
            bounds[names.index(key)] = interval
        self._set(tolerance=tolerance, length=length, weights=frozen(made), limits=frozen(bounds))
        self._set(target=self._made_pair())
        self._set(goal=self._resolved_goal())

    def _made_pair(self) -> Array:
        if self.requirement is None:
            return frozen(self.target)
        signs = np.array(SIGNS[self.requirement])
        tau = np.where(signs < 0, self.tolerance[:, 0], self.tolerance[:, 1])
        target = self.nominal_pair * (1.0 + tau * signs)
        if not (np.isfinite(target).all() and target.min() > 0):
            raise InputError(
                f"requirement {self.requirement} would make the scales {target.tolist()}",
                key="tolerance",
                found=self.request["tolerance"],
                allowed="below 1 (100 %) where a body is made smaller",
            )
        return frozen(target)

    def _resolved_goal(self) -> str:
        if self.goal is None:
            return "beyond" if self.requirement and self._at_switching_point else "touch"
        goal = str(self.goal)
        if goal not in ("beyond", "at"):
            return goal
        if self.nominal_contact is None:
            rho = self.nominal_pair.tolist()
            raise InputError(
                f'goal "{goal}" tracks the nominal contact, but the nominal pair is not on the decision curve: '
                f"the gap there is {self.curve.gap(self.nominal_pair):.6g} (> 0 apart, < 0 overlapping), and this "
                "version moves no pair onto the curve",
                key="nominal",
                found=rho,
                allowed='a switching point, a pair on the curve, or goal "touch" or "clear"',
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
        return goal

    @property
    def size(self) -> float:
        """Length that relative tolerances refer to: the larger box diagonal of the bodies as drawn."""
        return max(self.movable.size, self.static.size)

    @property
    def contact_slack(self) -> float:
        """Gap up to which a pair touches, length units.

        Relative to the smaller body, but no less than rounding at the larger one allows.
        """
        smaller = min(self.movable.size, self.static.size)
        return max(DEFAULT.touch * smaller, DEFAULT.tie * self.size)

    @cached_property
    def curve(self) -> DecisionCurve:
        """Decision curve of the bodies as drawn, in the box; computed when first asked for."""
        from fcdm_opt.curve.decision_curve import decision_curve

        return decision_curve(self.movable, self.static, box=self.box)

    @cached_property
    def nominal_contact(self) -> Segment | SwitchingPoint | None:
        """The switching point or segment that the nominal pair lies on, None where it lies on neither."""
        if isinstance(self.nominal, int):
            return self.curve.switching_points[self.nominal - 1]
        return self.curve.locate(self._asked_pair, DEFAULT.nominal)

    @cached_property
    def nominal_pair(self) -> Array:
        """Nominal scales, (2,): those of the switching point where it is one."""
        from fcdm_opt.curve.segments import SwitchingPoint

        contact = self.nominal_contact
        return frozen(contact.rho if isinstance(contact, SwitchingPoint) else self._asked_pair)

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
        """Return the same question with other arguments, resolved anew; raises as the constructor does."""
        return Problem(**{**self.request, **arguments})

    def to_dict(self) -> dict[str, Any]:
        """Return the question as plain data: the keys of a problem file with one case, angles in radians."""
        from fcdm_opt.tolerance.files import problem_to_dict

        return problem_to_dict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Problem:
        """Rebuild a problem from `to_dict`, bit for bit, or from the contents of a problem file with one case.

        Raises
        ------
        InputError
            Names the key, what was found and what is allowed.
        """
        from fcdm_opt.tolerance.files import problem_from_dict

        return problem_from_dict(data)


# ---------------------------------------------------------------------------------------------------- input checks


def _is_real(value: Any) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def _real(value: Any, key: str, allowed: str, passes: Any = lambda x: True) -> float:
    if not _is_real(value) or not abs(value) <= LARGEST or not passes(value):
        raise InputError("unusable number", key=key, found=value, allowed=allowed)
    return float(value)


def _positive(value: Any, key: str) -> float:
    return _real(value, key, "a finite number > 0", lambda x: x > 0)


def _items(value: Any) -> list[Any]:
    """Return the items of a sequence or array; nothing else has any."""
    return list(value) if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim) else []


def _pair(value: Any, key: str, allowed: str, *, positive: bool = False) -> tuple[float, float]:
    pair = _items(value)
    if len(pair) != 2 or not all(_is_real(x) and abs(x) <= LARGEST and (x > 0 or not positive) for x in pair):
        raise InputError("unusable pair", key=key, found=value, allowed=allowed)
    return float(pair[0]), float(pair[1])


def _nominal(value: Any) -> int | str | tuple[float, float]:
    allowed = 'the number of a switching point (from 1), a scale pair (rho_1, rho_2) > 0, or "drawn"'
    if isinstance(value, str) and value == "drawn":
        return value
    if isinstance(value, int | np.integer) and not isinstance(value, bool) and value >= 1:
        return int(value)
    return _pair(value, "nominal", allowed, positive=True)


def _tolerance(value: Any) -> Any:
    """Return the tolerance in the shape given, in plain numbers."""
    if value is None:
        return None
    allowed = "tau, (tau_1, tau_2) or ((minus_1, plus_1), (minus_2, plus_2)), all finite and >= 0"

    def numbers(given: Any, depth: int) -> Any:
        if _is_real(given) and math.isfinite(given) and given >= 0:
            return float(given)
        items = _items(given)
        shaped = [numbers(item, depth + 1) for item in items]
        if depth == 2 or len(shaped) != 2 or isinstance(shaped[0], float) != isinstance(shaped[1], float):
            raise InputError("unusable tolerance", key="tolerance", found=value, allowed=allowed)
        return tuple(shaped)

    return numbers(value, 0)


def _per_body(tolerance: Any) -> list[tuple[float, float]]:
    """Return (minus, plus) of both bodies."""
    bodies = (tolerance, tolerance) if isinstance(tolerance, float) else tolerance
    return [(x, x) if isinstance(x, float) else x for x in bodies]


def _box(value: Any) -> tuple[tuple[float, float], ...]:
    allowed = "((low_1, high_1), (low_2, high_2)) with 0 < low < high"
    sides = _items(value)
    if len(sides) != 2:
        raise InputError("unusable box", key="box", found=value, allowed=allowed)
    box = tuple(_pair(side, "box", allowed, positive=True) for side in sides)
    if not all(low < high for low, high in box):
        raise InputError("empty box", key="box", found=value, allowed=allowed)
    return box


def _interval(value: Any, key: str) -> tuple[float, float]:
    ends = _items(value)
    ordered = len(ends) == 2 and all(map(_is_real, ends)) and ends[0] <= ends[1]
    if not ordered or ends[0] == math.inf or ends[1] == -math.inf:
        raise InputError("unusable limits", key=key, found=value, allowed="(lower, upper) with lower <= upper")
    return float(ends[0]), float(ends[1])


def _by_parameter(values: Any, key: str, names: Iterable[str]) -> dict[str, Any]:
    allowed = ", ".join(names)
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise InputError("not a mapping", key=key, found=values, allowed=f"a mapping with some of the names {allowed}")
    for name in values:
        if name not in names:
            raise InputError("no such parameter of the motion", key=f"{key}.{name}", found=name, allowed=allowed)
    return dict(values)


def _published(values: Any, names: list[str]) -> tuple[float, ...] | None:
    if values is None:
        return None
    allowed = f"{len(names)} finite numbers: {', '.join(names)}"
    items = _items(values)
    if len(items) != len(names):
        raise InputError("not one value for each motion parameter", key="published", found=values, allowed=allowed)
    return tuple(_real(value, "published", allowed) for value in items)


def _choice(value: Any, key: str, choices: tuple[str | None, ...], later: tuple[str, ...]) -> None:
    if value is None or isinstance(value, str):
        if value in choices:
            return
        what = "not available in this version" if value in later else f"unknown {key}"
    else:
        what = f"unknown {key}"
    raise InputError(what, key=key, found=value, allowed=", ".join(f'"{choice}"' for choice in choices if choice))
