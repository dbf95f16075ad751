"""Expansions: numbers that change along a ray of motions, with a bound of what two terms leave out.

An expansion of f about x0 is four numbers: f(x0), f'(x0), a bound of |f''| on x0 <= x <= x0 + span, and its error in
units of roundoff: how f(x0) changes with the relative changes of all that it is made of. They flow through the motion's
own CasADi expression (`fcdm_opt.motion.instructions`), so every motion has them, and from there into `conditions`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerances import DEFAULT

ROUNDING = 2 * np.finfo(float).eps  # of the fourth number
LARGEST = 700.0  # exponents beyond this overflow
_ATAN_BEND, _TANH_BEND = 0.65, 0.77  # the most that their second derivatives reach


class Expansion:
    """A number along a ray, or an array of them: four floats, or four arrays; functions are of single numbers.

    Parameters
    ----------
    value, slope, bend, terms : float or array
        See above.
    span : float
        Of all that one calculation is made of.
    """

    __slots__ = ("bend", "slope", "span", "terms", "value")
    __array_ufunc__ = None  # numpy leaves the arithmetic to this class

    def __init__(self, value: Any, slope: Any, bend: Any, terms: Any, span: float) -> None:
        self.value, self.slope, self.bend, self.terms, self.span = value, slope, bend, terms, span

    @classmethod
    def gathered(cls, numbers: list[Any], shape: tuple[int, ...], span: float) -> Expansion:
        """Return single expansions, and floats, as an array."""
        value, slope, bend, terms = np.array([_fields(number) for number in numbers]).T.reshape(4, *shape)
        return cls(value, slope, bend, terms, span)

    @property
    def finite(self) -> bool:
        """Whether all is known, and bounded."""
        return all(bool(np.isfinite(own).all()) for own in _fields(self))

    def __getitem__(self, key: Any) -> Expansion:
        return Expansion(self.value[key], self.slope[key], self.bend[key], self.terms[key], self.span)

    def sum(self, axis: int) -> Expansion:
        """Return sums along an axis."""
        totals = np.cumsum(self.value, axis)
        fields = (np.add.reduce(own, axis) for own in (self.value, self.slope, self.bend, self.terms + abs(totals)))
        value, slope, bend, terms = fields
        return Expansion(value, slope, bend, terms - abs(self.value.take(0, axis)), self.span)

    def __add__(self, other: Any) -> Expansion:
        if not isinstance(other, Expansion):
            value = self.value + other
            return Expansion(value, self.slope, self.bend, self.terms + abs(other) + abs(value), self.span)
        value = self.value + other.value
        terms = self.terms + other.terms + abs(value)
        return Expansion(value, self.slope + other.slope, self.bend + other.bend, terms, self.span)

    __radd__ = __add__

    def __neg__(self) -> Expansion:
        return Expansion(-self.value, -self.slope, self.bend, self.terms, self.span)

    def __sub__(self, other: Any) -> Expansion:
        return self + -other

    def __rsub__(self, other: Any) -> Expansion:
        return -self + other

    def _most(self) -> tuple[Any, Any, Any]:
        """Return |f|, and bounds of |f| and |f'| on the span."""
        size, rate = abs(self.value), abs(self.slope)
        return size, size + self.span * (rate + 0.5 * self.span * self.bend), rate + self.span * self.bend

    def __mul__(self, other: Any) -> Expansion:
        if not isinstance(other, Expansion):
            size = abs(other)
            terms = size * (self.terms + 2.0 * abs(self.value))
            return Expansion(other * self.value, other * self.slope, size * self.bend, terms, self.span)
        x, a, b = self._most()
        y, c, d = other._most()
        slope = self.value * other.slope + self.slope * other.value
        bend = a * other.bend + 2.0 * b * d + self.bend * c
        return Expansion(self.value * other.value, slope, bend, x * y + x * other.terms + y * self.terms, self.span)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Expansion:
        return self * (other._reciprocal() if isinstance(other, Expansion) else 1.0 / other)

    def __rtruediv__(self, other: float) -> Expansion:
        return self._reciprocal() * other

    # -------------------------------------------------------------------------------------- functions, single numbers

    def _composed(self, value: float, slope: float, steepest: float, bend: float) -> Expansion:
        """Return a function of f with given value and slope at f(x0), and bounds of its derivatives on the span."""
        rate = self._most()[2]
        terms = abs(value) + abs(slope) * self.terms
        return Expansion(value, slope * self.slope, steepest * self.bend + bend * rate * rate, terms, self.span)

    def _undefined(self) -> Expansion:
        return Expansion(math.nan, math.nan, math.nan, math.nan, self.span)

    def _reciprocal(self) -> Expansion:
        x, most, _ = self._most()
        if not x > 0:
            return self._undefined()
        least = 2.0 * x - most
        bound = 1.0 / least if least > 0 else math.inf
        inverse = 1.0 / self.value
        return self._composed(inverse, -inverse * inverse, bound * bound, 2.0 * bound * bound * bound)

    def sqrt(self) -> Expansion:
        """Return the square root."""
        x, most, _ = self._most()
        if not self.value > 0:
            return self._undefined()
        least = 2.0 * x - most
        bound = 1.0 / math.sqrt(least) if least > 0 else math.inf
        root = math.sqrt(x)
        return self._composed(root, 0.5 / root, 0.5 * bound, 0.25 * bound * bound * bound)

    def sin(self) -> Expansion:
        """Return the sine."""
        return self._wave(math.sin, math.cos)

    def cos(self) -> Expansion:
        """Return the cosine."""
        return self._wave(math.cos, lambda x: -math.sin(x))

    def _wave(self, value: Callable[[float], float], slope: Callable[[float], float]) -> Expansion:
        if not math.isfinite(self.value):
            return self._undefined()
        return self._composed(value(self.value), slope(self.value), 1.0, 1.0)

    def tan(self) -> Expansion:
        """Return the tangent."""
        return self.sin() / self.cos()

    def exp(self) -> Expansion:
        """Return the exponential."""
        top = self.value + self._most()[1] - abs(self.value)
        if not top <= LARGEST:
            return self._undefined()
        value, most = math.exp(self.value), math.exp(top)
        return self._composed(value, value, most, most)

    def atan(self) -> Expansion:
        """Return the inverse tangent."""
        return self._composed(math.atan(self.value), 1.0 / (1.0 + self.value * self.value), 1.0, _ATAN_BEND)

    def tanh(self) -> Expansion:
        """Return the hyperbolic tangent."""
        value = math.tanh(self.value)
        return self._composed(value, 1.0 - value * value, 1.0, _TANH_BEND)


def _fields(number: Any) -> tuple[Any, Any, Any, Any]:
    if isinstance(number, Expansion):
        return number.value, number.slope, number.bend, number.terms
    return number, 0.0, 0.0, abs(number)


def columns(number: Any, count: int) -> Array:
    """Return the four numbers of expansions, or of plain numbers, (count, 4)."""
    return np.column_stack([np.broadcast_to(own, count) for own in _fields(number)])


# ------------------------------------------------------------------------- what rows of value, slope, bend, terms say


def flat(found: Array) -> bool:
    """Tell whether one of some expansions is zero to within rounding, and so is its slope."""
    value, slope, bend, terms = found.T
    rounding = ROUNDING * terms
    return bool(((value <= rounding) & (slope * slope <= 8.0 * bend * rounding)).any())


def roots(found: Array) -> Array:
    """Return where each condition becomes zero as its slope goes on, infinite where it grows."""
    value, slope, _, _ = found.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(slope < 0, np.abs(value / slope), np.where(np.abs(value) > 0, np.inf, 0.0))


def safe_steps(found: Array, span: float) -> Array:
    """Return how far each condition surely holds: the root of f + f' h - B h^2 / 2, at most the span; 0 if it fails."""
    value, slope, bend, terms = found.T
    held = value >= -DEFAULT.tie * terms
    value = np.maximum(value, 0.0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        root = np.sqrt(slope * slope + 2.0 * bend * value)
        steps = np.where(slope >= 0, (slope + root) / bend, 2.0 * value / (root - slope))
    steps = np.where((bend == 0) & (slope >= 0), span, steps)
    return np.where(held & ~np.isnan(steps), np.minimum(steps, span), 0.0)
