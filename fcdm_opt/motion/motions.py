"""Rigid motions of the movable body: the only file that knows conventions.

A motion is a sequence of steps; each step acts in the world frame on the body as the steps before it left it. Every
step is written once, on nested tuples of scalars, and so serves floats and CasADi expressions alike. Rotations use
R = u u' + cos(t) (1 - u u') + sin(t) [u]x, which is smooth at t = 0.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from itertools import islice
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from fcdm_opt.errors import InputError, known_arguments, known_word
from fcdm_opt.geometry.arrays import AXES, Array, Flags, frozen
from fcdm_opt.geometry.units import measured, number_text
from fcdm_opt.plain import plain

if TYPE_CHECKING:
    from fcdm_opt.motion.kinematics import Kinematics

ROUNDING = 64 * np.finfo(float).eps  # of coordinates: seeds no further apart are the same
Matrix = tuple[tuple[Any, ...], ...]
ORIGIN = (0.0, 0.0, 0.0)
IDENTITY: Matrix = tuple(tuple(float(i == j) for j in range(4)) for i in range(4))

PITCHES: dict[str, float | Literal["free"]] = {"free": "free", "infinite": math.inf, "-infinite": -math.inf}
"""Words for pitches that are no finite number."""

Kind = Literal["translation", "rotation"]
AxisWord = Literal["x", "y", "z", "-x", "-y", "-z"]
XYZ: tuple[AxisWord, AxisWord, AxisWord] = ("x", "y", "z")


class Parameter(NamedTuple):
    """One parameter of a motion: its name and whether it is a "translation" (length) or a "rotation" (radians)."""

    name: str
    kind: Kind


class Motion:
    """A family of rigid motions with parameters q; zero is the identity.

    Combine with `>>`: `Translation("z") >> Rotation("z")` translates, then rotates.
    """

    @property
    def steps(self) -> tuple[Step, ...]:
        """The elementary steps, first to last."""
        raise TypeError(f"{type(self).__name__} defines no steps")

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Names and kinds of the parameters, in order; repeated names get a number."""
        seen: dict[str, int] = {}
        made = []
        for step in self.steps:
            for name, kind in step.own_parameters:
                seen[name] = seen.get(name, 0) + 1
                made.append(Parameter(name if seen[name] == 1 else f"{name}_{seen[name]}", kind))
        return tuple(made)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return tuple(name for name, _ in self.parameters)

    @cached_property
    def turning(self) -> Flags:
        """Which parameters are angles, (k,)."""
        return frozen([kind == "rotation" for _, kind in self.parameters], bool)

    @cached_property
    def owners(self) -> tuple[Step, ...]:
        """The step that each parameter belongs to."""
        return tuple(step for step in self.steps for _ in step.own_parameters)

    def by_name(self, q: Iterable[float]) -> dict[str, float]:
        """Return values of the parameters by their names."""
        return dict(zip(self.names, map(float, q), strict=True))

    def by_step(self, q: Iterable[Any]) -> list[list[Any]]:
        """Return values of the parameters, those of each step together."""
        values = iter(q)
        return [list(islice(values, len(step.own_parameters))) for step in self.steps]

    @property
    def directions(self) -> list[Array]:
        """The unit vectors along and about which its steps move as drawn, where they are given."""
        lines = [step for step in self.steps if isinstance(step, Straight) and getattr(step, "axis", None) != "seeds"]
        return [np.array(step.line(ORIGIN, ORIGIN)[0], float) for step in lines]

    @cached_property
    def shifts(self) -> bool:
        """Whether the body moves in proportion to the parameters and never turns."""
        return all(step.own_shifts(k == 0) for k, step in enumerate(self.steps))

    @cached_property
    def shift_directions(self) -> tuple[Array | None, ...]:
        """The direction along which each parameter shifts the body, whatever the others do, world frame; or None."""
        given = [direction for step in self.steps for direction in step.own_shift_directions]
        return tuple(None if direction is None else frozen(direction) for direction in given)

    @property
    def about_seed(self) -> bool:
        """Whether every turn is about the movable seed as already moved: then the shifts alone move the seed."""
        return all(step.own_about_seed for step in self.steps)

    @property
    def along_seeds(self) -> Flags:
        """Which parameters are of a line that joins the seeds, and turns with what other parameters do, (k,)."""
        return np.array([step.own_along_seeds for step in self.owners], bool)

    def shift_vectors(self, movable_seed: Any, static_seed: Any) -> Array:
        """Return what each parameter shifts a body that never turns, (k, 3), see `shifts`."""
        return _shift_vectors(self, (*map(float, movable_seed), *map(float, static_seed)))

    def shifts_by(self, q: Array) -> bool:
        """Tell whether it does so all the way to parameters q."""
        own = zip(self.steps, self.by_step(q.tolist()), strict=True)
        return all(step.own_shifts_by(values, k == 0) for k, (step, values) in enumerate(own))

    @cached_property
    def numbers(self) -> Array:
        """Axes, centres and pitches of all steps, one after the other: what the transform depends on besides."""
        return frozen([number for step in self.steps for number in step.own_numbers])

    @cached_property
    def pattern(self) -> Motion:
        """The same steps with zeros for their numbers: equal of motions that differ in these alone."""
        return self.with_numbers([0.0] * len(self.numbers))

    def with_numbers(self, numbers: Sequence[Any]) -> Motion:
        """Return the same steps with other numbers, of any kind of scalars: symbols, or zeros; nothing is checked."""
        remaining = iter(numbers)
        return Sequenced(tuple(step.own_with([next(remaining) for _ in step.own_numbers]) for step in self.steps))

    def __rshift__(self, other: Motion) -> Motion:
        """Return this motion followed by `other`."""
        if not isinstance(other, Motion):
            raise InputError("only a motion can follow a motion", key="motion", found=type(other).__name__)
        return Sequenced(self.steps + other.steps)

    def weights(self, length: float) -> Array:
        """Return what each parameter weighs in the amount: 1, `length`, or hypot(pitch, length) for a fixed pitch.

        Parameters
        ----------
        length : float
            Length that turns radians into lengths.
        """
        return frozen([weight for step in self.steps for weight in step.own_weights(length)])

    def transform(self, q: Sequence[float] | Array, movable_seed: Any, static_seed: Any) -> Array:
        """Return the 4x4 transform of body 1.

        Parameters
        ----------
        q : (k,) floats
            Parameters: lengths and radians.
        movable_seed, static_seed : (3,) arrays
            Seeds s_1 and s_2 as drawn, world frame.

        Raises
        ------
        InputError
            If the number of parameters is wrong, or a screw along the seeds meets coincident seeds.
        """
        values = [float(x) for x in q]
        if len(values) != len(self.parameters):
            allowed = ", ".join(self.names)
            raise InputError("wrong number of motion parameters", key="motion", found=len(values), allowed=allowed)
        return np.array(self.composed(values, [float(x) for x in movable_seed], [float(x) for x in static_seed]))

    def symbolic(self, q: Any, movable_seed: Any, static_seed: Any) -> Any:
        """Return the 4x4 transform as a CasADi expression of `q` (and of the seeds, numbers or symbols)."""
        import casadi

        rows = self.composed(
            *([x[k] for k in range(n)] for x, n in ((q, len(self.parameters)), (movable_seed, 3), (static_seed, 3)))
        )
        return casadi.vertcat(*(casadi.horzcat(*row) for row in rows))

    def kinematics(self, movable_seed: Any, static_seed: Any) -> Kinematics:
        """Return the compiled motion for these seeds: poses and rates in a microsecond; built once and kept.

        Motions of one `pattern` share what is compiled.

        Parameters
        ----------
        movable_seed, static_seed : (3,) arrays
            Seeds s_1 and s_2 as drawn, world frame.
        """
        return _kinematics(self, (*map(float, movable_seed), *map(float, static_seed)))

    def composed(self, q: list[Any], movable_seed: Sequence[Any], static_seed: Sequence[Any]) -> Matrix:
        """Return the 4x4 transform as nested tuples, of any kind of scalars: floats, CasADi's, enclosures."""
        before = IDENTITY
        for k, (step, own) in enumerate(zip(self.steps, self.by_step(q), strict=True)):
            after = step.own_transform(own, _applied(before, movable_seed), tuple(static_seed))
            before = product(after, before) if k else after
        return before

    def reaches(self, points: Array, movable_seed: Any) -> Array:
        """Return bounds d_k such that no point moves by more than sum d_k |q_k|, (k,).

        A step S about a fixed line adds at most what it moves the point at rest, |S T x - x| <= |T x - x| + |S x - x|;
        one about the moved seed at most the angle times the point's distance from the axis, or, once an earlier step
        has turned the body against that axis, from the seed.

        Parameters
        ----------
        points : (n, 3) array
            Points of body 1 at rest, world frame.
        movable_seed : (3,) array
        """
        seed = np.asarray(movable_seed, dtype=np.float64)
        found: list[float] = []
        turned = False
        for step in self.steps:
            found += step.own_reaches(np.asarray(points), seed, turned)
            turned = turned or any(kind == "rotation" for _, kind in step.own_parameters)
        return frozen(found)

    def seen_from(self, origin: Any) -> Motion:
        """Return the same motion in coordinates whose origin is the point `origin`, (3,)."""
        return Sequenced(tuple(step.own_seen_from(np.asarray(origin, dtype=np.float64)) for step in self.steps))

    def play(self, q: Array, steps: Array, points: Array, movable_seed: Any, static_seed: Any) -> float:
        """Return how far a point moves at most when every parameter changes by its step, one after the other.

        Parameters
        ----------
        q, steps : (k,) arrays
        points : (n, 3) array
            Points of body 1 at rest, world frame.
        movable_seed, static_seed : (3,) arrays
        """

        def moved(values: Array) -> Array:
            T = self.transform(values, movable_seed, static_seed)
            return points @ T[:3, :3].T + T[:3, 3]

        changes = [[moved(q + sign * step) - moved(q) for sign in (1.0, -1.0)] for step in np.diag(steps)]
        return float(np.linalg.norm(changes, axis=3).max(axis=(1, 2)).sum())

    def describe(self, q: Sequence[float] | Array, *, unit: str = "", digits: int = 6) -> str:
        """Return the motion in words, degrees and lengths, in a unit or without: "TZ 0.25 mm + RZ 7.02 deg"."""
        own = zip(self.steps, self.by_step(map(float, q)), strict=True)
        return " + ".join(step.own_words(values, unit, digits) for step, values in own)

    def describe_steps(self, q: Sequence[float] | Array, *, unit: str = "") -> list[tuple[str, str]]:
        """Return what is done, a (verb, manner) for each step, to four digits: ("move", "0.25 mm along -z")."""
        own = zip(self.steps, self.by_step(map(float, q)), strict=True)
        return [step.own_description(values, unit) for step, values in own]


class Step(Motion):
    """One elementary motion. A new one defines the `own_` members below and nothing else."""

    @property
    def steps(self) -> tuple[Step, ...]:
        """The step itself."""
        return (self,)

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        """Names and kinds of the step's parameters."""
        raise TypeError(f"{type(self).__name__} defines no parameters")

    @property
    def own_numbers(self) -> tuple[float, ...]:
        """What tells the step from others of its kind in `own_transform`: of its axis, centre, pitch; or nothing."""
        return ()

    def own_with(self, numbers: Sequence[Any]) -> Step:
        """Return the step with other numbers in place of `own_numbers`, of any kind of scalars; nothing is checked."""
        return self

    def own_weights(self, length: float) -> tuple[float, ...]:
        """Weight of each parameter in the amount."""
        return tuple(1.0 if kind == "translation" else length for _, kind in self.own_parameters)

    def own_transform(self, q: list[Any], movable_seed: tuple[Any, ...], static_seed: tuple[Any, ...]) -> Matrix:
        """4x4 transform in the world frame; `movable_seed` as already moved."""
        raise TypeError(f"{type(self).__name__} defines no transform")

    @property
    def closed(self) -> bool:
        """Whether a whole turn is all there is: the motion repeats itself."""
        return False

    @property
    def bounded(self) -> bool:
        """Whether `own_reaches` are finite: what the step displaces is known without trying."""
        return True

    @property
    def smooth(self) -> bool:
        """Whether it has derivatives everywhere."""
        return True

    @property
    def own_shift_directions(self) -> tuple[tuple[float, ...] | None, ...]:
        """Unit direction along which each parameter shifts the body, whatever the others do; None of others."""
        return (None,) * len(self.own_parameters)

    @property
    def own_about_seed(self) -> bool:
        """Whether the step leaves the movable seed where it is, but for what `own_shift_directions` say."""
        return False

    @property
    def own_along_seeds(self) -> bool:
        """Whether its line joins the seeds."""
        return False

    @property
    def own_pitch(self) -> float | None:
        """Translation per radian of a step whose one parameter is an angle; None of others."""
        return None

    @property
    def own_fixed_points(self) -> tuple[Any, ...] | None:
        """Points of the world that the step is written with; None where that is not known."""
        return None

    def own_line(self, movable_seed: Any, static_seed: Any) -> tuple[Any, Any] | None:
        """Return unit direction of, and a point on, the line that the step is along and about; None without one."""
        return None

    def own_along_ray(self, q: list[float]) -> tuple[list[Step], list[float]]:
        """Return simpler steps that do the same on the whole ray to parameters q, and their parameters at q."""
        return [self], q

    def own_plain(self) -> dict[str, Any]:
        """Return the step as plain data, as problem files have it."""
        raise TypeError(f"{type(self).__name__} has no plain data")

    def own_shifts(self, first: bool) -> bool:
        """Whether the step shifts along a direction that no earlier step changes; `first`: there is none."""
        return False

    def own_shifts_by(self, q: list[float], first: bool) -> bool:
        """Whether it does so on the way to its parameters q."""
        return not any(q) or self.own_shifts(first)

    def own_reaches(self, points: Array, seed: Array, turned: bool) -> tuple[float, ...]:
        """Largest displacement of the points per unit of each parameter; `turned`: an earlier step turns the body."""
        raise TypeError(f"{type(self).__name__} defines no reaches")

    def own_seen_from(self, origin: Array) -> Step:
        """Return the step in coordinates with another origin: itself where no fixed point enters."""
        return self

    def own_words(self, q: list[float], unit: str = "", digits: int = 6) -> str:
        """Parameters in words, in degrees and lengths, in a unit or without."""
        named = zip(self.own_parameters, q, strict=True)
        shown = [(name, (x, unit) if kind == "translation" else (math.degrees(x), "deg")) for (name, kind), x in named]
        return " ".join(f"{name} {measured(f'{x:.{digits}g}', own)}" for name, (x, own) in shown)

    def own_description(self, q: list[float], unit: str = "") -> tuple[str, str]:
        """Return what the step does, a verb and how, lengths in a unit or without: by default its parameters."""
        return "move", f"by {self.own_words(q, unit, 4)}"


@dataclass(frozen=True)
class Sequenced(Motion):
    """Several steps, one after the other; made by `>>`."""

    sequence: tuple[Step, ...]

    @property
    def steps(self) -> tuple[Step, ...]:
        """The elementary steps, first to last."""
        return self.sequence


class Straight(Step):
    """A step that shifts the body along a line and turns it about that line."""

    def movements(self, q: list[Any]) -> tuple[Any, Any]:
        """Return (translation along, angle about) the line: the one parameter."""
        return (q[0], 0.0) if self.own_parameters[0].kind == "translation" else (0.0, q[0])

    def line(self, movable_seed: Any, static_seed: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Return the unit direction of the line and a point on it, world frame; `movable_seed` as already moved."""
        raise TypeError(f"{type(self).__name__} defines no line")

    def own_line(self, movable_seed: Any, static_seed: Any) -> tuple[Any, Any] | None:
        """Return `line`."""
        return self.line(movable_seed, static_seed)

    def own_transform(self, q: list[Any], movable_seed: tuple[Any, ...], static_seed: tuple[Any, ...]) -> Matrix:
        """Turn about and shift along the line."""
        along, about = self.movements(q)
        return _turn(*self.line(movable_seed, static_seed), about, along)

    def own_reaches(self, points: Array, seed: Array, turned: bool) -> tuple[float, ...]:
        """Largest distance from the line, or from the seed where the body may have turned against a line there."""
        direction, point = self.line(tuple(seed), tuple(seed))
        return self.own_weights(_distance(points, None if turned and point == tuple(seed) else direction, point))

    def own_description(self, q: list[float], unit: str = "") -> tuple[str, str]:
        """Return a shift along the line, a turn about it by the right-hand rule, or both."""
        along, about = self.movements(q)
        if about and along:
            return "screw", f"{_angle(about)} about and {measured(along, unit, 4)} along {self.line_text(1.0)}"
        if about:
            return "turn", f"{_angle(abs(about))} about {self.line_text(about)}"
        return "move", f"{measured(abs(along), unit, 4)} along {self.line_text(along)}"

    def line_text(self, sign: float) -> str:
        """Return the line in words, backwards where the sign is negative; a seed that it goes through is not told."""
        return direction_text(self.line(ORIGIN, ORIGIN)[0], sign)


@known_arguments
@dataclass(frozen=True)
class Translation(Straight):
    """Translation along a fixed world axis: "x", "-x", ..., or a vector (its length does not matter)."""

    axis: AxisWord | tuple[float, float, float]
    direction: tuple[float, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", _hashable(self.axis))
        object.__setattr__(self, "direction", _direction(self.axis, "Translation.axis"))

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        """One length."""
        return (Parameter(f"T{_axis_name(self.axis)}", "translation"),)

    @property
    def own_numbers(self) -> tuple[float, ...]:
        """The direction."""
        return self.direction

    def own_with(self, numbers: Sequence[Any]) -> Step:
        """Set the direction."""
        return _changed(self, axis=tuple(numbers), direction=tuple(numbers))

    def line(self, movable_seed: Any, static_seed: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Return the axis through the origin."""
        return self.direction, ORIGIN

    @property
    def own_shift_directions(self) -> tuple[tuple[float, ...] | None, ...]:
        """The axis."""
        return (self.direction,)

    own_about_seed = True  # nothing turns
    own_fixed_points = ()  # none are needed

    def own_plain(self) -> dict[str, Any]:
        """Return its axis."""
        return {"translation": plain(self.axis)}

    def own_shifts(self, first: bool) -> bool:
        """Tell that it always does."""
        return True


@known_arguments
@dataclass(frozen=True)
class Rotation(Straight):
    """Rotation about a fixed world direction through a centre, right-hand rule.

    Attributes
    ----------
    axis : str or vector
        "x", "-x", ..., or a vector (its length does not matter).
    centre : "seed", "origin" or point
        The movable seed as already moved, the world origin, or a fixed point, world frame.
    """

    axis: AxisWord | tuple[float, float, float]
    centre: Literal["seed", "origin"] | tuple[float, float, float] = "seed"
    direction: tuple[float, ...] = field(init=False, repr=False)
    closed = True  # it repeats itself after a turn

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", _hashable(self.axis))
        object.__setattr__(self, "direction", _direction(self.axis, "Rotation.axis"))
        if not isinstance(self.centre, str):
            object.__setattr__(self, "centre", _point(self.centre, "Rotation.centre"))
        elif self.centre not in ("seed", "origin"):
            allowed = '"seed", "origin" or a point'
            raise InputError("unknown centre", key="Rotation.centre", found=self.centre, allowed=allowed)

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        """One angle."""
        return (Parameter(f"R{_axis_name(self.axis)}", "rotation"),)

    @property
    def own_numbers(self) -> tuple[float, ...]:
        """The direction, and the centre where it is a point."""
        return self.direction if isinstance(self.centre, str) else (*self.direction, *self.centre)

    def own_with(self, numbers: Sequence[Any]) -> Step:
        """Set the direction, and a centre that is a point."""
        axis, centre = tuple(numbers[:3]), self.centre if isinstance(self.centre, str) else tuple(numbers[3:])
        return _changed(self, axis=axis, direction=axis, centre=centre)

    def line(self, movable_seed: Any, static_seed: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Return the axis through the centre."""
        if isinstance(self.centre, str):
            return self.direction, tuple(movable_seed) if self.centre == "seed" else ORIGIN
        return self.direction, self.centre

    @property
    def own_about_seed(self) -> bool:
        """Where that is the centre."""
        return self.centre == "seed"

    @property
    def own_fixed_points(self) -> tuple[Any, ...] | None:
        """A centre that is not the seed."""
        return () if self.centre == "seed" else (ORIGIN if isinstance(self.centre, str) else self.centre,)

    def own_plain(self) -> dict[str, Any]:
        """Return axis and centre."""
        return {"rotation": plain(self.axis), "centre": plain(self.centre)}

    def own_description(self, q: list[float], unit: str = "") -> tuple[str, str]:
        """Return the turn about the axis, and the centre that it goes through."""
        verb, manner = super().own_description(q, unit)
        centre = "its seed" if self.centre == "seed" else _place(self.line(ORIGIN, ORIGIN)[1])
        return verb, f"{manner} through {centre}" if verb == "turn" else manner

    def own_seen_from(self, origin: Array) -> Step:
        """Shift a fixed centre."""
        return self if self.centre == "seed" else Rotation(self.axis, _shifted(self.line(ORIGIN, ORIGIN)[1], origin))


@known_arguments
@dataclass(frozen=True)
class Screw(Straight):
    """Rotation about a directed line and translation along it.

    Attributes
    ----------
    axis : "seeds" or (point, direction)
        The directed line from the movable seed, as moved by the preceding steps, to the static one; or a fixed line.
    pitch : float, "free" or infinity
        Translation per radian. 0 is a rotation about the line, infinity a translation along it; "free" makes
        translation and angle two parameters.
    """

    axis: Literal["seeds"] | tuple[tuple[float, float, float], tuple[float, float, float]] = "seeds"
    pitch: float | Literal["free"] = "free"

    def __post_init__(self) -> None:
        if isinstance(self.axis, str):
            if self.axis != "seeds":
                line = AXES.get(self.axis, (0.0, 0.0, 1.0))
                allowed = f'"seeds", or a line as (point, direction): (body.seed, {line}) is one through a seed'
                raise InputError("a screw is about a line", key="Screw.axis", found=self.axis, allowed=allowed)
        elif np.shape(self.axis) != (2, 3):
            raise InputError("a line is (point, direction)", key="Screw.axis", found=self.axis)
        else:
            point, direction = self.axis
            line = (_point(point, "Screw.axis"), _direction(direction, "Screw.axis"))
            object.__setattr__(self, "axis", line)
        if isinstance(self.pitch, str):
            if self.pitch != "free":
                raise InputError("unknown pitch", key="Screw.pitch", found=self.pitch, allowed='a number or "free"')
        elif math.isnan(self.pitch):
            raise InputError("the pitch is not a number", key="Screw.pitch", found=self.pitch)
        else:
            object.__setattr__(self, "pitch", float(self.pitch))

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        """Angle for a fixed pitch, translation for an infinite one, both for a free one."""
        along, about = Parameter("screw_translation", "translation"), Parameter("screw_angle", "rotation")
        if isinstance(self.pitch, str):
            return (along, about)
        return (along,) if self._endless else (about,)

    @property
    def own_numbers(self) -> tuple[float, ...]:
        """Point and direction of a fixed line, and a pitch that is finite."""
        line = () if isinstance(self.axis, str) else (*self.axis[0], *self.axis[1])
        return line if isinstance(self.pitch, str) or self._endless else (*line, self.pitch)

    def own_with(self, numbers: Sequence[Any]) -> Step:
        """Set a fixed line, and a pitch that is finite."""
        axis = self.axis if isinstance(self.axis, str) else (tuple(numbers[:3]), tuple(numbers[3:6]))
        return _changed(self, axis=axis, pitch=self.pitch if self.pitch == "free" or self._endless else numbers[-1])

    @property
    def _endless(self) -> bool:
        return isinstance(self.pitch, float) and math.isinf(self.pitch)

    def own_weights(self, length: float) -> tuple[float, ...]:
        """Weight of each parameter; a fixed pitch couples both movements: hypot(pitch, length) a radian."""
        if isinstance(self.pitch, str) or self._endless:
            return super().own_weights(length)
        return (math.hypot(self.pitch, length),)

    def movements(self, q: list[Any]) -> tuple[Any, Any]:
        """Return (translation along, angle about) the axis."""
        if isinstance(self.pitch, str):
            return q[0], q[1]
        return (math.copysign(1.0, self.pitch) * q[0], 0.0) if self._endless else (self.pitch * q[0], q[0])

    def line(self, movable_seed: Any, static_seed: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Return the axis."""
        if not isinstance(self.axis, str):
            return self.axis[1], self.axis[0]
        offset = tuple(b - a for a, b in zip(movable_seed, static_seed, strict=True))
        length = _of(sum(x * x for x in offset), "sqrt")
        if isinstance(length, float) and length <= ROUNDING * max(map(abs, (*movable_seed, *static_seed))):
            what = "the seeds coincide: they define no screw axis"
            raise InputError(what, key="Screw.axis", found=length, allowed="a line (point, direction)")
        return tuple(x / length for x in offset), movable_seed

    def own_reaches(self, points: Array, seed: Array, turned: bool) -> tuple[float, ...]:
        """Distance from the axis; from the seed for the line of the seeds, whose direction earlier steps change."""
        seeds = isinstance(self.axis, str)
        return self.own_weights(_distance(points, None, seed)) if seeds else super().own_reaches(points, seed, turned)

    def own_seen_from(self, origin: Array) -> Step:
        """Shift a fixed line."""
        if isinstance(self.axis, str):
            return self
        return Screw((_shifted(self.axis[0], origin), self.axis[1]), self.pitch)

    @property
    def own_along_seeds(self) -> bool:
        """Where the axis is not a fixed line."""
        return self.axis == "seeds"

    @property
    def own_pitch(self) -> float | None:
        """The pitch where it is a finite number."""
        return None if isinstance(self.pitch, str) or self._endless else self.pitch

    @property
    def own_fixed_points(self) -> tuple[Any, ...] | None:
        """A point on a fixed line."""
        return () if isinstance(self.axis, str) else (self.axis[0],)

    def own_plain(self) -> dict[str, Any]:
        """Return line and pitch."""
        line = plain(self.axis)
        named = {value: name for name, value in PITCHES.items()}
        pitch = {"pitch": named[self.pitch]} if self.pitch in named else {"pitch_per_rad": self.pitch}
        return {"screw": line if isinstance(line, str) else {"point": line[0], "direction": line[1]}, **pitch}

    @property
    def closed(self) -> bool:
        """Without pitch it is a rotation."""
        return self.pitch == 0.0

    def own_shifts(self, first: bool) -> bool:
        """With infinite pitch; along the line of the seeds as the first step only."""
        return self._endless and (first or self.axis != "seeds")

    def line_text(self, sign: float) -> str:
        """Return the line in words."""
        if self.axis == "seeds":
            return "the line from seed to seed" + (", backwards" if sign < 0.0 else "")
        return f"{super().line_text(sign)} through {_place(self.line(ORIGIN, ORIGIN)[1])}"

    def own_words(self, q: list[float], unit: str = "", digits: int = 6) -> str:
        """Parameters in words: translation and angle, as in the paper's tables."""
        along, about = self.movements(q)
        return f"Screw {measured(f'{along:.{digits}g}', unit)}, {math.degrees(about):.{digits}g} deg"


@known_arguments
@dataclass(frozen=True)
class Free(Step):
    """Any rigid motion: a translation, and a rotation about the seed by a rotation vector, world axes.

    x -> s_1 + t + R(theta) (x - s_1), s_1 the movable seed as already moved. Parameters t (lengths) and theta: its
    direction is the axis, its length the angle, radians.
    """

    own_shift_directions = (*(AXES[name] for name in XYZ), None, None, None)
    own_about_seed = True
    own_fixed_points = ()

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        """Three lengths and three components of the rotation vector."""
        lengths = (Parameter(f"T{name}", "translation") for name in "XYZ")
        return (*lengths, *(Parameter(f"R{name}", "rotation") for name in "XYZ"))

    def own_transform(self, q: list[Any], movable_seed: tuple[Any, ...], static_seed: tuple[Any, ...]) -> Matrix:
        """R = 1 + sin(r)/r [theta]x + (1 - cos r)/r^2 [theta]x^2, smooth in r^2 = |theta|^2."""
        x, y, z = theta = q[3:]
        square = x * x + y * y + z * z
        s, v = _sinc(square), _versine(square)
        skew = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
        R = tuple(
            tuple(
                (1.0 - v * (square - theta[i] * theta[i]) if i == j else v * theta[i] * theta[j] + s * skew[i][j])
                for j in range(3)
            )
            for i in range(3)
        )
        return _about(R, movable_seed, q[:3])

    def own_along_ray(self, q: list[float]) -> tuple[list[Step], list[float]]:
        """Return a shift, and a turn about a fixed direction."""
        found: tuple[list[Step], list[float]] = [], []
        for kind, own in ((Translation, q[:3]), (Rotation, q[3:])):
            length = math.hypot(*own)
            if length > 0.0:
                found[0].append(kind((own[0] / length, own[1] / length, own[2] / length)))
                found[1].append(length)
        return found

    def own_plain(self) -> dict[str, Any]:
        """Return that it is free."""
        return {"free": True}

    def own_description(self, q: list[float], unit: str = "") -> tuple[str, str]:
        """Return a shift, and a turn about the seed."""
        texts = []
        for vector, size, where in ((q[:3], lambda x: measured(x, unit, 4), "along"), (q[3:], _angle, "about")):
            if (long := math.hypot(*vector)) > 0.0:
                texts.append(f"{size(long)} {where} {direction_text([x / long for x in vector], 1.0)}")
        if any(q[3:]):
            texts[-1] += " through its seed"
        return "move", ", turned ".join(texts) or measured(0.0, unit, 4)

    def own_shifts_by(self, q: list[float], first: bool) -> bool:
        """Where no rotation is asked."""
        return not any(q[3:])

    def own_reaches(self, points: Array, seed: Array, turned: bool) -> tuple[float, ...]:
        """Distances from the axes: a turn by theta moves a point by no more than its arc, |theta x (x - s_1)|."""
        axes = [None] * 3 if turned else np.eye(3)
        return (1.0, 1.0, 1.0, *(_distance(points, axis, seed) for axis in axes))


@lru_cache(maxsize=64)
def _kinematics(motion: Motion, seeds: tuple[float, ...]) -> Kinematics:
    from fcdm_opt.motion.kinematics import Kinematics

    return Kinematics(motion, np.array(seeds))


@lru_cache(maxsize=64)
def _shift_vectors(motion: Motion, seeds: tuple[float, ...]) -> Array:
    return frozen([motion.transform(step, seeds[:3], seeds[3:])[:3, 3] for step in np.eye(len(motion.names))])


def _changed(step: Step, **values: Any) -> Any:
    """Return a step with other values in its fields, which are not checked."""
    made = object.__new__(type(step))
    for item in fields(step):  # type: ignore[arg-type]
        object.__setattr__(made, item.name, values.get(item.name, getattr(step, item.name)))
    return made


# ------------------------------------------------------------------------------------------------ scalars, any kind

SMALL = 1.0  # squares of angles below which series are used: no digits are lost there to differences
TERMS = 12  # of these series: what is left out, and its second derivative, is below rounding


def _of(x: Any, name: str) -> Any:
    """Return "cos", "sin" or "sqrt" of a scalar."""
    return getattr(math, name)(x) if isinstance(x, float) else getattr(x, name)()


def _sinc(square: Any) -> Any:
    """Return sin(r) / r of r^2."""
    return square.sinc() if hasattr(square, "sinc") else _smooth(square, lambda r: _of(r, "sin") / r, 1)


def _versine(square: Any) -> Any:
    """Return (1 - cos r) / r^2 of r^2."""
    if hasattr(square, "versine"):
        return square.versine()
    return _smooth(square, lambda r: 2.0 * (_of(0.5 * r, "sin") / r) * (_of(0.5 * r, "sin") / r), 2)


def _smooth(square: Any, far: Callable[[Any], Any], first: int) -> Any:
    """Return f(r^2) = 1/first! - r^2/(first + 2)! + ..., where r is not small by its closed form `far` of r."""
    # both branches of the expression are finite everywhere, with all derivatives: a derivative of the branch that is
    # not taken is multiplied by 0, which nan would survive
    if isinstance(square, float):
        return _series(square, first) if square < SMALL else far(math.sqrt(square))
    import casadi

    near = square < SMALL
    inside, outside = casadi.if_else(near, square, 0.0), casadi.if_else(near, SMALL, square)
    return casadi.if_else(near, _series(inside, first), far(_of(outside, "sqrt")))


def _series(square: Any, first: int) -> Any:
    total: Any = 0.0
    for k in reversed(range(TERMS)):
        total = (-1.0) ** k / math.factorial(2 * k + first) + total * square
    return total


def _applied(T: Matrix, p: Any) -> tuple[Any, ...]:
    return tuple(row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3] for row in T[:3])


def product(A: Matrix, B: Matrix) -> Matrix:
    """Return the product of two rigid transforms."""
    b0, b1, b2, _ = B
    rows = tuple(
        tuple(a[0] * b0[j] + a[1] * b1[j] + a[2] * b2[j] + (a[3] if j == 3 else 0.0) for j in range(4)) for a in A[:3]
    )
    return (*rows, B[3])


def _about(rotation: Any, centre: Any, shift: Any) -> Matrix:
    """Return the transform that turns about a centre, then shifts."""
    rows = (
        (*rotation[i][:3], centre[i] - sum(rotation[i][j] * centre[j] for j in range(3)) + shift[i]) for i in range(3)
    )
    return (*rows, IDENTITY[3])


def _turn(u: tuple[Any, ...], centre: tuple[Any, ...], angle: Any, along: Any) -> Matrix:
    """Rotate by `angle` about the unit direction `u` through `centre`, and shift by `along` along it."""
    shift = tuple(along * x for x in u)
    if isinstance(angle, float) and angle == 0.0:
        return _about(IDENTITY, ORIGIN, shift)
    c, s = _of(angle, "cos"), _of(angle, "sin")
    x, y, z = u
    skew = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    R = tuple(
        tuple(u[i] * u[j] + c * (float(i == j) - u[i] * u[j]) + s * skew[i][j] for j in range(3)) for i in range(3)
    )
    return _about(R, centre, shift)


def _distance(points: Array, direction: Any, point: Any) -> float:
    """Return the largest distance of points from a line, or where that has no direction from its point."""
    arms = points - np.asarray(point)
    if direction is not None:
        arms = arms - np.outer(arms @ np.asarray(direction), direction)
    return math.sqrt((arms * arms).sum(axis=1).max())


def _shifted(point: Any, origin: Array) -> Any:
    return tuple((np.array(point) - origin).tolist())


def _direction(axis: Any, key: str) -> tuple[float, ...]:
    if isinstance(axis, str):
        return AXES[known_word(axis, AXES, "unknown axis", key=key, more=" or a vector")]
    vector = _point(axis, key)
    longest = max(map(abs, vector))
    if longest == 0:
        raise InputError("a direction must not be zero", key=key, found=axis)
    if not 1e-100 < longest < 1e100:  # its square would over- or underflow
        vector = tuple(x / longest for x in vector)
    length = math.hypot(*vector)
    if abs(length - 1.0) <= 4 * sys.float_info.epsilon:  # a unit vector read back stays what it was
        return vector
    return tuple(x / length for x in vector)


def _point(values: Any, key: str) -> tuple[float, ...]:
    try:
        point = tuple(float(x) for x in values)
    except (TypeError, ValueError, OverflowError) as reason:
        raise InputError("expected three numbers", key=key, found=values) from reason
    if len(point) != 3 or not all(map(math.isfinite, point)):
        raise InputError("expected three finite numbers", key=key, found=values)
    return point


def _hashable(axis: Any) -> Any:
    return axis if isinstance(axis, str) else _point(axis, "axis")


def _axis_name(axis: Any) -> str:
    return axis.upper() if isinstance(axis, str) else ""


def _angle(x: float) -> str:
    return f"{math.degrees(x):.4g} deg"


def direction_text(direction: Sequence[float], sign: float) -> str:
    """Return a direction in words: "+z", or its components; turned round where the sign is negative."""
    components = [math.copysign(1.0, sign) * x + 0.0 for x in direction]
    for name, axis in AXES.items():
        if components == list(axis):
            return name if name[0] == "-" else f"+{name}"
    return f"({', '.join(number_text(x, 4) for x in components)})"


def _place(point: Sequence[float]) -> str:
    return f"({', '.join(number_text(x, 4) for x in point)})" if any(point) else "the origin"
