"""Bounds over cells of motions by the mean value form: f(centre) and slopes over the cell times half widths.

A motion is q = y / weights, y = s v: v on a face of the cube [-1, 1]^k, numbered 2 axis (+1) and 2 axis + 1 (-1), its
other coordinates in a box; s in a stretch. All derivatives are CasADi's; all numbers are intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.motion.instructions import Instructions
from fcdm_opt.motion.motions import Motion
from fcdm_opt.problem.problem import Problem
from fcdm_opt.proof.enclosure import Enclosure
from fcdm_opt.proof.intervals import ARITHMETIC, Interval, IntervalFunction

POSE = 12  # numbers of a pose: R, row by row, and d = s_2 - moved s_1
OPTIONS = {"cse": True}


@dataclass(frozen=True, eq=False)
class Pieces:
    """Cells, or pieces of them."""

    rows: Ints  # of which cell each is, (n,)
    faces: Ints  # those of the cube, (n,)
    low: Array  # the ends of s, then of the box coordinates, (n, k)
    high: Array

    @classmethod
    def of(cls, faces: Ints, boxes: Array, stretches: Array) -> Pieces:
        """Return whole cells by the ends of their directions, (n, 2, k - 1), and of s, (n, 2)."""
        low, high = (np.column_stack([stretches[:, side], boxes[:, side]]) for side in (0, 1))
        return cls(np.arange(len(faces)), faces, low, high)

    def __getitem__(self, key: Any) -> Pieces:
        return Pieces(self.rows[key], self.faces[key], self.low[key], self.high[key])

    def halved(self) -> Pieces:
        """Return both halves of each, cut across what is longest as an amount."""
        lengths = self.high - self.low
        lengths[:, 1:] *= self.high[:, :1]
        row, axis = np.arange(len(self.rows)), lengths.argmax(axis=1)
        low, high = np.concatenate([self.low, self.low]), np.concatenate([self.high, self.high])
        high[row, axis] = low[len(row) + row, axis] = self.centre[row, axis]
        return Pieces(np.tile(self.rows, 2), np.tile(self.faces, 2), low, high)

    @property
    def centres(self) -> Pieces:
        """Their centres alone."""
        return Pieces(self.rows, self.faces, self.centre, self.centre)

    @cached_property
    def centre(self) -> Array:
        """A point of each, (n, k)."""
        return 0.5 * self.low + 0.5 * self.high

    @cached_property
    def half(self) -> Array:
        """How far each reaches from its centre, (n, k)."""
        return np.nextafter(np.maximum(self.high - self.centre, self.centre - self.low), np.inf)

    @property
    def axes(self) -> Ints:
        """The axis of each one's face, (n,)."""
        return self.faces >> 1

    @cached_property
    def others(self) -> Ints:
        """The axes that the box coordinates belong to, (n, k - 1)."""
        places = np.arange(self.low.shape[1] - 1)
        return places + (places >= self.axes[:, None])

    def directions(self, *, over: bool) -> tuple[Interval, Interval]:
        """Return s, (n,), and v, (n, k): all of the pieces, or their centres."""
        n, k = self.low.shape
        middle, radius = np.empty((n, k)), np.zeros((n, k))
        rows = np.arange(n)
        middle[rows, self.axes] = 1.0 - 2.0 * (self.faces & 1)
        middle[rows[:, None], self.others] = self.centre[:, 1:]
        if over:
            radius[rows[:, None], self.others] = self.half[:, 1:]
        return Interval(self.centre[:, 0], self.half[:, 0] if over else 0.0), Interval(middle, radius)

    def coordinates(self, *, over: bool) -> list[Interval]:
        """Return y, k numbers (n,), over the pieces or at their centres."""
        s, v = self.directions(over=over)
        return [s * v[:, k] for k in range(self.low.shape[1])]

    @cached_property
    def enclosed(self) -> list[Enclosure]:
        """The same k numbers to the first order in the variables."""
        rows, (n, k) = np.arange(len(self.faces)), self.low.shape
        s, *box = Enclosure.box(self.low, self.high)
        own = s.data * (1.0 - 2.0 * (self.faces & 1))[:, None]
        own[:, -1] = s.data[:, -1]
        made, places = np.stack([own, *((s * x).data for x in box)]), np.zeros((n, k), np.int64)
        places[rows[:, None], self.others] = np.arange(1, k)
        return [Enclosure(made[places[:, axis], rows]) for axis in range(k)]

    def changes(self, slopes: Interval) -> Interval:
        """Return how much numbers change with each variable, (n, p, k), of their slopes by y."""
        (n, k), (s, v) = self.low.shape, self.directions(over=True)
        by_s = slopes.contracted(v.shaped((n, k, 1)))
        shape = n, slopes.middle.shape[1], k - 1
        others = slopes.taken(np.broadcast_to(self.others[:, None, :], shape)) * s.shaped((n, 1, 1))
        return by_s.joined(others) * Interval(self.half[:, None, :])


class Boxes(Pieces):
    """Boxes of y themselves, which have no faces."""

    @classmethod
    def between(cls, low: Array, high: Array) -> Boxes:
        """Return boxes by their ends, (n, k) each."""
        rows = np.arange(len(low))
        return cls(rows, np.zeros_like(rows), low, high)

    def coordinates(self, *, over: bool) -> list[Interval]:
        """Return y, k numbers (n,), over the boxes or at their centres."""
        return [Interval(self.centre[:, k], self.half[:, k] if over else 0.0) for k in range(self.low.shape[1])]

    @cached_property
    def enclosed(self) -> list[Enclosure]:
        """The same k numbers to the first order in the variables."""
        return Enclosure.box(self.low, self.high)

    def changes(self, slopes: Interval) -> Interval:
        """Return how much numbers change with each variable, (n, p, k), of their slopes by y."""
        return slopes * Interval(self.half[:, None, :])


@dataclass(frozen=True, eq=False)
class Expression:
    """So many functions of a pose and of given numbers, and their derivatives by the pose, column by column."""

    values: IntervalFunction
    slopes: IntervalFunction
    count: int

    @classmethod
    def of(cls, size: int, build: Callable[[Any, Any, Any], Any]) -> Expression:
        """Build from a function (R, d, given) -> value or tuple of values; `size` numbers are given."""
        import casadi

        pose, given = casadi.SX.sym("pose", POSE), casadi.SX.sym("given", size)
        built = build(casadi.reshape(pose[:9], 3, 3).T, pose[9:], given)
        values = casadi.densify(casadi.vertcat(*built) if isinstance(built, tuple) else built)
        slopes = casadi.vec(casadi.densify(casadi.jacobian(values, pose)))
        return cls(
            IntervalFunction(casadi.Function("values", [pose, given], [values], OPTIONS)),
            IntervalFunction(casadi.Function("slopes", [pose, given], [values, slopes], OPTIONS)),
            values.shape[0],
        )


class Place(NamedTuple):
    """A number that depends on the variables of a piece: at its centre, over it, (n, 1), and its changes, (n, 1, k)."""

    centre: Interval
    over: Interval
    change: Interval


@dataclass(frozen=True, eq=False)
class Poses:
    """The poses of pieces: at their centres and over them, twelve numbers (n, 1) each, and how they change."""

    pieces: Pieces
    centre: list[Interval]
    over: list[Interval]
    change: Interval  # slopes over the piece by s and the box coordinates, times the half widths, (n, 12, k)
    jumps: Flags  # where the motion may not be continuous, (n, 1)

    def __getitem__(self, rows: Ints) -> Poses:
        if len(rows) == len(self.pieces.rows):
            return self
        centre, over = ([x[rows] for x in numbers] for numbers in (self.centre, self.over))
        return Poses(self.pieces[rows], centre, over, self.change[rows], self.jumps[rows])

    def bounds(
        self, expression: Expression, given: Sequence[Interval], place: Place | None = None
    ) -> tuple[list[Array], list[Array]]:
        """Return lower and upper bounds of each value of an expression, (n, rows) each, as what is given broadcasts to.

        With a place as the last of the given numbers, which is not fixed over a piece, the expression's last value is
        the first one's derivative by it.
        """
        at = ([*given, place.centre], [*given, place.over]) if place else (given, given)
        (still,), _ = expression.values(self.centre, at[0])
        (over, slopes), _ = expression.slopes(self.over, at[1])
        lows, highs = [], []
        for m in range(expression.count):
            change = _stacked(slopes[m :: expression.count], len(self.jumps)).contracted(self.change)
            if place and m == 0:
                rate = over[-1]
                change = change + Interval(rate.middle[..., None], rate.radius[..., None]) * place.change
            low, high = _spread(still[m], change), over[m]
            jumps = self.jumps | ~np.isfinite(low.radius)
            lows.append(np.where(jumps, high.low, np.fmax(low.low, high.low)))
            highs.append(np.where(jumps, high.high, np.fmin(low.high, high.high)))
        return lows, highs


class PosesOfPieces:
    """The motion of a problem: the pose of body 1 relative to body 2, and its changes, over pieces of cells.

    `symbols` are y, both seeds as the pose is seen from, and the pose, (12,); `seeds` what these are. It is `smooth`
    where it has no jumps.
    """

    def __init__(self, problem: Problem) -> None:
        import casadi

        self._count = len(problem.weights)
        origin = _origin(problem.motion, problem.movable.seed)
        y, seeds = casadi.SX.sym("y", self._count), casadi.SX.sym("seeds", 6)
        seen = problem.motion.seen_from(origin) if origin.any() else problem.motion
        q = casadi.vertcat(*(y[k] / w for k, w in enumerate(problem.weights.tolist())))
        T = seen.symbolic(q, seeds[:3], seeds[3:])
        moved = T[:3, :3] @ seeds[:3] + T[:3, 3]
        pose = casadi.densify(casadi.vertcat(casadi.vec(T[:3, :3].T), seeds[3:] - moved))
        self.symbols = y, seeds, pose
        slopes = casadi.vec(casadi.densify(casadi.jacobian(pose, y)))
        self._pose = IntervalFunction(casadi.Function("pose", [y, seeds], [pose], OPTIONS))
        self._slopes = IntervalFunction(casadi.Function("slopes", [y, seeds], [slopes], OPTIONS))
        exact = [Interval(seed) - origin for seed in (problem.movable.seed, problem.static.seed)]
        self.seeds = [own[k] for own in exact for k in range(3)]
        # the package's own motions are smooth; where a series takes over, they jump by less than 1e-20
        self.smooth = all(step.smooth for step in problem.motion.steps)

    def poses(self, pieces: Pieces) -> Poses:
        """Return the poses of pieces."""
        n, k = pieces.low.shape
        (centre,), _ = self._pose(pieces.coordinates(over=False), self.seeds)
        y = pieces.coordinates(over=True)
        (natural,), jumps = self._pose(y, self.seeds)
        (flat,), _ = self._slopes(y, self.seeds)
        slopes = _stacked([_column(x, n) for x in flat], n).shaped((n, k, POSE)).turned((0, 2, 1))  # by y
        change = pieces.changes(slopes)
        broken = np.broadcast_to(np.asarray(jumps) & (not self.smooth), n)[:, None]
        over, still = [], []
        for p in range(POSE):
            at, wide = (_column(x, n) for x in (centre[p], natural[p]))
            tight = wide.tighter(_spread(at, change[:, p : p + 1]))
            still.append(at)
            over.append(
                Interval(np.where(broken, wide.middle, tight.middle), np.where(broken, wide.radius, tight.radius))
            )
        return Poses(pieces, still, over, change, broken)


class AmountOfPieces:
    """An amount of the user's own over pieces of cells: a function of the parameters q = y / weights."""

    def __init__(self, amount: Any, weights: Array) -> None:
        import casadi

        y = casadi.SX.sym("y", len(weights))
        value = amount(y / weights)
        slopes = casadi.densify(casadi.jacobian(value, y))
        made = [casadi.Function("amount", [y], [own], OPTIONS) for own in (value, slopes)]
        self._value, self._slopes = map(IntervalFunction, made)
        self._beyond = Instructions.of(made[0])

    def least(self, pieces: Pieces) -> Array:
        """Return a lower bound over each piece, (n,)."""
        n, y = len(pieces.low), pieces.coordinates(over=True)
        ((centre,),), _ = self._value(pieces.coordinates(over=False))
        ((natural,),), jumps = self._value(y)
        (slopes,), _ = self._slopes(y)
        change = pieces.changes(_stacked([_column(x, n) for x in slopes], n))
        wide, near = _column(natural, n).low[:, 0], _spread(_column(centre, n), change).low[:, 0]
        return np.where(jumps, wide, np.fmax(wide, near))

    def least_beyond(self, pieces: Pieces) -> Array:
        """Return a lower bound over all motions in each piece and further out in the same directions, (n,)."""
        s, v = pieces.directions(over=True)
        y = [Growing(s.low * v[:, k], 1.0) for k in range(pieces.low.shape[1])]
        ((value,),) = self._beyond.carried_out(GROWTH, y)
        low = np.asarray(value.factor.low) * np.ones(len(pieces.low))
        return np.where(low >= 0.0, low * (value.power >= 0.0), low if value.power <= 0.0 else -np.inf)


class Growing(NamedTuple):
    """Numbers factor * t^power for all t >= 1."""

    factor: Interval
    power: float


def _combined(function: Callable[[Interval, Interval], Interval]) -> Callable[[Growing, Growing], Growing]:
    """Return a function of two numbers that is homogeneous: of what they are relative to the larger power."""

    def combined(x: Growing, y: Growing) -> Growing:
        power = max(x.power, y.power)
        return Growing(function(*(f if p == power else f.hull(Interval(0.0)) for f, p in (x, y))), power)

    return combined


def _unbounded(*_: Growing) -> Growing:
    return Growing(Interval(0.0, np.inf), 0.0)


def _settled(name: str) -> Callable[..., Growing]:
    """Return any function of numbers that do not grow."""

    def settled(*given: Growing) -> Growing:
        if any(x.power for x in given):
            return _unbounded()
        return Growing(ARITHMETIC[name](*(x.factor for x in given)), 0.0)

    return settled


GROWTH: dict[str, Callable[..., Growing]] = {
    **{name: _settled(name) for name in ARITHMETIC},
    "CONST": lambda x: Growing(Interval(x), 0.0),
    "UNKNOWN": _unbounded,
    **{name: _combined(ARITHMETIC[name]) for name in ("ADD", "SUB", "FMIN", "FMAX")},
    "MUL": lambda x, y: Growing(x.factor * y.factor, x.power + y.power),
    "DIV": lambda x, y: Growing(x.factor / y.factor, x.power - y.power),
    "INV": lambda x: Growing(x.factor.reciprocal(), -x.power),
    "POW": lambda x, n: (
        Growing(x.factor.power(n.factor), x.power * float(np.max(n.factor.middle)))
        if not n.power and np.ndim(n.factor.middle) == 0
        else _settled("POW")(x, n)
    ),
    "SQ": lambda x: Growing(x.factor.square(), 2.0 * x.power),
    "SQRT": lambda x: Growing(ARITHMETIC["SQRT"](x.factor), 0.5 * x.power),
    **{
        name: lambda x, name=name: Growing(ARITHMETIC[name](x.factor), x.power)
        for name in ("ASSIGN", "NEG", "TWICE", "FABS")
    },
}
"""Interval arithmetic of numbers that grow."""


def _spread(centre: Interval, change: Interval) -> Interval:
    """Return a number that is off its value at the centre by changes, along the last axis, at most."""
    return centre + Interval(0.0, change.size.sum(axis=-1) * (1.0 + 2.0**-48))


def _column(x: Interval, count: int) -> Interval:
    return Interval.stacked([x], (count,))


def _stacked(numbers: Sequence[Interval], count: int) -> Interval:
    """Return numbers (n, rows) or what broadcasts to it as one array (n, rows, numbers)."""
    shape = np.broadcast_shapes(
        (count, 1), *(np.shape(x.middle) for x in numbers), *(np.shape(x.radius) for x in numbers)
    )
    return Interval.stacked(numbers, shape)


def _origin(motion: Motion, seed: Array) -> Array:
    """Return where to see a motion from: the seed, if its fixed points can be written so without rounding, else 0."""
    fixed = [step.own_fixed_points for step in motion.steps]
    if None in fixed:
        return np.zeros(3)
    points = [point for own in fixed for point in own or ()]
    numbers = [(float(x), float(s)) for point in points for x, s in zip(point, seed, strict=True)]
    return np.array(seed) if all(Fraction(x) - Fraction(s) == Fraction(x - s) for x, s in numbers) else np.zeros(3)
