"""Interval arithmetic for the checker of proofs, and CasADi functions worked out in it.

An interval is a middle and a radius. Every operation adds to the radius what rounding to nearest can do to the middle,
2^-53 of it, and rounds the radius up: whatever numbers within the operands, the exact result lies within the interval
returned. What cannot be bounded has an infinite radius or is nan; no comparison with it holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import reduce
from operator import mul
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Ints
from fcdm_opt.motion.instructions import Instructions

UNIT = 2.0**-52  # more than the rounding of one operation, relative to its result
UP = 1.0 + 2.0**-49  # more than the rounding of the few operations that a radius takes
LEAST = 1e-300  # more than what underflow can take from a result
SUMS = 2.0**-47  # error of a sum of up to twenty products, relative to the sum of their sizes
LIBRARY = 2.0**-48  # error of a library function: sixteen units in the last place of its result
WIDE = 2.0**-10  # radius, relative to the middle, from which on a square is found from its ends
WHOLE_TURNS = 1e6  # sines of larger angles are bounded by 1 alone


class Interval:
    """Numbers within `radius` of `middle`, arrays that broadcast."""

    __slots__ = ("middle", "radius")
    __array_ufunc__ = None  # numpy leaves the arithmetic to this class

    def __init__(self, middle: Any, radius: Any = 0.0) -> None:
        self.middle, self.radius = middle, radius

    @classmethod
    def between(cls, low: Any, high: Any) -> Interval:
        """Return the interval with these ends; nan where an end is."""
        with np.errstate(all="ignore"):
            middle = 0.5 * low + 0.5 * high
            bounded = np.isfinite(middle) | np.isnan(middle)
            middle = np.where(bounded, middle, 0.0)
            return cls(middle, np.where(bounded, np.maximum(high - middle, middle - low) * UP, np.inf))

    @classmethod
    def stacked(cls, numbers: Sequence[Interval], shape: tuple[int, ...]) -> Interval:
        """Return numbers, each broadcast to a shape, one after the other along a new last axis."""
        middles, radii = np.empty((2, *shape, len(numbers)))
        for k, number in enumerate(numbers):
            middles[..., k], radii[..., k] = number._sides
        return cls(middles, radii)

    @property
    def low(self) -> Any:
        """Lower end."""
        return self.middle - (self.radius + UNIT * (np.abs(self.middle) + self.radius))

    @property
    def high(self) -> Any:
        """Upper end."""
        return self.middle + (self.radius + UNIT * (np.abs(self.middle) + self.radius))

    @property
    def size(self) -> Any:
        """Largest absolute value."""
        return (np.abs(self.middle) + self.radius) * UP

    def __getitem__(self, key: Any) -> Interval:
        radius = self.radius if np.ndim(self.radius) == 0 else self.radius[key]
        return Interval(self.middle[key], radius)

    def hull(self, other: Interval) -> Interval:
        """Return the least interval that holds both."""
        return Interval.between(np.minimum(self.low, other.low), np.maximum(self.high, other.high))

    def tighter(self, other: Interval) -> Interval:
        """Return whichever of two intervals for the same numbers is the narrower."""
        better = other.radius < self.radius
        return Interval(np.where(better, other.middle, self.middle), np.where(better, other.radius, self.radius))

    def shaped(self, shape: tuple[int, ...]) -> Interval:
        """Return the numbers in another shape."""
        return Interval(*(np.reshape(np.broadcast_to(side, np.shape(self.middle)), shape) for side in self._sides))

    def turned(self, axes: tuple[int, ...]) -> Interval:
        """Return the numbers with their axes in another order."""
        return Interval(*(np.transpose(side, axes) for side in self._sides))

    def taken(self, places: Ints) -> Interval:
        """Return some numbers along the last axis."""
        return Interval(*(np.take_along_axis(side, places, axis=-1) for side in self._sides))

    def joined(self, other: Interval) -> Interval:
        """Return these numbers and others, one after the other along the last axis."""
        return Interval(*(np.concatenate(pair, axis=-1) for pair in zip(self._sides, other._sides, strict=True)))

    def contracted(self, other: Interval) -> Interval:
        """Return the matrix product."""
        (a, r), (b, q) = self._sides, other._sides
        own, others = np.abs(a), np.abs(b)
        # no sum of so few products is off by more than this share of the sum of their sizes
        spread = own @ (q + SUMS * others) + r @ (others + q)
        return Interval(a @ b, spread * (1.0 + SUMS) + LEAST)

    @property
    def _sides(self) -> tuple[Any, Any]:
        return self.middle, self.radius

    def __add__(self, other: Any) -> Interval:
        other = _interval(other)
        middle = self.middle + other.middle
        return Interval(middle, (self.radius + other.radius + UNIT * np.abs(middle)) * UP)

    __radd__ = __add__

    def __neg__(self) -> Interval:
        return Interval(-self.middle, self.radius)

    def __sub__(self, other: Any) -> Interval:
        return self + -_interval(other)

    def __rsub__(self, other: Any) -> Interval:
        return -self + other

    def __mul__(self, other: Any) -> Interval:
        other = _interval(other)
        middle, own, others = self.middle * other.middle, np.abs(self.middle), np.abs(other.middle)
        spread = own * other.radius + self.radius * (others + other.radius)
        return Interval(middle, (spread + UNIT * np.abs(middle)) * UP + LEAST)

    __rmul__ = __mul__

    def reciprocal(self) -> Interval:
        """Return 1 / x; all numbers where x may be 0."""
        low, high = self.low, self.high
        with np.errstate(all="ignore"):
            found = Interval.between(_down(1.0 / high), _up(1.0 / low))
        sure = (low > 0) | (high < 0)
        return Interval(np.where(sure, found.middle, 0.0), np.where(sure, found.radius, np.inf))

    def __truediv__(self, other: Any) -> Interval:
        return self * _interval(other).reciprocal()

    def square(self) -> Interval:
        """Return x x."""
        middle, radius = self.middle * self.middle, self.radius
        spread = (radius * (2.0 * np.abs(self.middle) + radius) + UNIT * middle) * UP + LEAST
        ends = self.magnitude().increasing(np.square)  # narrower, but for the rounding of a library
        wide = radius > WIDE * np.abs(self.middle)
        return Interval(np.where(wide, ends.middle, middle), np.where(wide, ends.radius, spread))

    def magnitude(self) -> Interval:
        """Return |x|."""
        low, high = self.low, self.high
        across = Interval.between(np.zeros_like(low), np.maximum(-low, high))
        sure = (low > 0) | (high < 0)
        return Interval(np.where(sure, np.abs(self.middle), across.middle), np.where(sure, self.radius, across.radius))

    def increasing(self, function: Callable[[Any], Any]) -> Interval:
        """Return a function that increases wherever it is defined, given in floats."""
        with np.errstate(all="ignore"):
            return Interval.between(_down(function(self.low)), _up(function(self.high)))

    def wave(self, function: Callable[[Any], Any], top: float) -> Interval:
        """Return a sine or cosine, which is 1 at the angle `top`."""
        low, high = self.low, self.high
        with np.errstate(all="ignore"):
            ends = function(low), function(high)
            least, most = np.minimum(*ends) - LIBRARY, np.maximum(*ends) + LIBRARY
            # an angle misjudged by its rounding is so near the crest that LIBRARY holds the difference
            crest, trough = (
                np.floor((high - angle) / math.tau) != np.floor((low - angle) / math.tau)
                for angle in (top, top + math.pi)
            )
            far = ~(np.maximum(np.abs(low), np.abs(high)) <= WHOLE_TURNS)
        return Interval.between(
            np.where(far | trough | ~(least >= -1.0), -1.0, least), np.where(far | crest | ~(most <= 1.0), 1.0, most)
        )

    def power(self, exponent: Interval) -> Interval:
        """Return x to a power: a small whole number, or any for positive x."""
        if np.ndim(exponent.middle) == 0 and not np.any(exponent.radius) and float(exponent.middle).is_integer():
            count = int(exponent.middle)
            if abs(count) <= 64:
                made = reduce(mul, [self] * abs(count), Interval(1.0))
                return made if count >= 0 else made.reciprocal()
        return (exponent * self.increasing(np.log)).increasing(np.exp)

    def angle(self, x: Interval) -> Interval:
        """Return the angle of the point (x, self): atan2."""
        with np.errstate(all="ignore"):
            right, side = (self / x).increasing(np.arctan), (x / self).increasing(np.arctan)
        above, below = math.pi / 2.0 - side, -math.pi / 2.0 - side
        found, known = Interval(np.zeros(np.shape(self.middle + x.middle)), math.pi * UP), [x.low > 0, self.low > 0]
        for own, sure in ((right, known[0]), (above, ~known[0] & known[1]), (below, ~known[0] & (self.high < 0))):
            found = Interval(np.where(sure, own.middle, found.middle), np.where(sure, own.radius, found.radius))
        return Interval(found.middle, found.radius + math.pi * UNIT)


def _interval(value: Any) -> Interval:
    return value if isinstance(value, Interval) else Interval(value)


def cross(u: Interval, v: Interval) -> Interval:
    """Return the cross product along the last axis."""
    places = np.array([1, 2, 0]), np.array([2, 0, 1])
    (a, b), (c, e) = ((x[..., places[0]], x[..., places[1]]) for x in (u, v))
    return a * e - b * c


def numbers_of(*vectors: Interval) -> list[Interval]:
    """Return the components of vectors, (3,) each for all rows or (n, 3) a column each."""
    found = []
    for vector in vectors:
        for k in range(3):
            own = vector[..., k]
            each = np.ndim(own.middle) > 0
            found.append(Interval(own.middle[:, None], np.asarray(own.radius)[..., None]) if each else own)
    return found


def _down(value: Any) -> Any:
    return value - (LIBRARY * np.abs(value) + LEAST)


def _up(value: Any) -> Any:
    return value + (LIBRARY * np.abs(value) + LEAST)


def _truth(sure: Any, never: Any) -> Interval:
    """Return 1 where something is sure, 0 where it never is, and what holds both elsewhere."""
    return Interval(np.where(sure, 1.0, np.where(never, 0.0, 0.5)), np.where(sure | never, 0.0, 0.5))


def _known(x: Interval) -> tuple[Any, Any]:
    """Tell where x is surely not 0, and where it surely is."""
    size = np.abs(x.middle)
    return size > x.radius + UNIT * (size + x.radius), (size == 0) & (x.radius == 0)


def _less(x: Interval, y: Interval) -> Interval:
    return _truth(x.high < y.low, x.low > y.high)


def _same(x: Interval, y: Interval) -> Interval:
    return _truth((x.radius == 0) & (y.radius == 0) & (x.middle == y.middle), (x.high < y.low) | (x.low > y.high))


def _is_not(x: Interval) -> Interval:
    sure, never = _known(x)
    return _truth(never, sure)


def _both(x: Interval, y: Interval) -> Interval:
    (sure, never), (others_sure, others_never) = _known(x), _known(y)
    return _truth(sure & others_sure, never | others_never)


def _kept_if(condition: Interval, x: Interval) -> Interval:
    """Return x where the condition holds, 0 where it does not, whatever x is there."""
    sure, never = _known(condition)
    if np.all(sure) or np.all(never):  # as nearly everywhere
        return x if np.all(sure) else Interval(0.0)
    either = x.hull(Interval(0.0))
    middle = np.where(never, 0.0, np.where(sure, x.middle, either.middle))
    return Interval(middle, np.where(never, 0.0, np.where(sure, x.radius, either.radius)))


def _least(x: Interval, y: Interval) -> Interval:
    return Interval.between(np.minimum(x.low, y.low), np.minimum(x.high, y.high))


def _within(function: Callable[[Any], Any], low: float, high: float) -> Callable[[Interval], Interval]:
    """Return an increasing function with a domain; nan where an argument may be beyond it."""
    return lambda x: x.increasing(lambda end: function(np.where((end >= low) & (end <= high), end, np.nan)))


JUMPS = frozenset(("LT", "LE", "EQ", "NE", "SIGN", "FLOOR", "CEIL", "UNKNOWN"))  # not continuous, or not known to be
ARITHMETIC: dict[str, Callable[..., Interval]] = {
    "CONST": Interval,
    "UNKNOWN": lambda: Interval(0.0, np.inf),
    "ASSIGN": lambda x: x,
    "ADD": lambda x, y: x + y,
    "SUB": lambda x, y: x - y,
    "MUL": lambda x, y: x * y,
    "DIV": lambda x, y: x / y,
    "NEG": lambda x: -x,
    "SQ": Interval.square,
    "TWICE": lambda x: Interval(2.0 * x.middle, 2.0 * x.radius),
    "INV": Interval.reciprocal,
    "SQRT": _within(np.sqrt, 0.0, np.inf),
    "POW": Interval.power,
    "SIN": lambda x: x.wave(np.sin, math.pi / 2.0),
    "COS": lambda x: x.wave(np.cos, 0.0),
    "TAN": lambda x: x.wave(np.sin, math.pi / 2.0) / x.wave(np.cos, 0.0),
    "ASIN": _within(np.arcsin, -1.0, 1.0),
    "ACOS": lambda x: -_within(lambda end: -np.arccos(end), -1.0, 1.0)(x),
    "ATAN": lambda x: x.increasing(np.arctan),
    "ATAN2": Interval.angle,
    "EXP": lambda x: x.increasing(np.exp),
    "EXPM1": lambda x: x.increasing(np.expm1),
    "LOG": _within(np.log, 0.0, np.inf),
    "LOG1P": _within(np.log1p, -1.0, np.inf),
    "SINH": lambda x: x.increasing(np.sinh),
    "COSH": lambda x: x.magnitude().increasing(np.cosh),
    "TANH": lambda x: x.increasing(np.tanh),
    "ASINH": lambda x: x.increasing(np.arcsinh),
    "ACOSH": _within(np.arccosh, 1.0, np.inf),
    "ATANH": _within(np.arctanh, -1.0, 1.0),
    "FABS": Interval.magnitude,
    "SIGN": lambda x: Interval.between(np.sign(x.low), np.sign(x.high)),
    "FLOOR": lambda x: Interval.between(np.floor(x.low), np.floor(x.high)),
    "CEIL": lambda x: Interval.between(np.ceil(x.low), np.ceil(x.high)),
    "FMIN": _least,
    "FMAX": lambda x, y: -_least(-x, -y),
    "LT": _less,
    "LE": _less,
    "EQ": _same,
    "NE": lambda x, y: _is_not(_same(x, y)),
    "NOT": _is_not,
    "AND": _both,
    "OR": lambda x, y: _is_not(_both(_is_not(x), _is_not(y))),
    "IF_ELSE_ZERO": _kept_if,
}


class IntervalFunction:
    """A CasADi function (SX) worked out in intervals; an operation that is not known here gives all numbers."""

    def __init__(self, function: Any) -> None:
        self._instructions = Instructions.of(function)

    def __call__(self, *inputs: Sequence[Interval]) -> tuple[list[list[Interval]], Any]:
        """Return the outputs, a list of numbers each, and where the function may have a jump within the inputs."""
        jumps: Any = False

        def watched(name: str) -> Callable[..., Interval]:
            def carried_out(*given: Interval) -> Interval:
                nonlocal jumps
                result = ARITHMETIC[name](*given)
                jumps = jumps | (result.radius > 0)
                return result

            return carried_out

        return self._instructions.carried_out({**ARITHMETIC, **{name: watched(name) for name in JUMPS}}, *inputs), jumps
