"""Expansions: numbers that change along a ray of motions, with a bound of what two terms leave out.

An expansion of f about x0 is four numbers: f(x0), f'(x0), a bound of |f''| on x0 <= x <= x0 + span, and its error in
units of roundoff: how f(x0) changes with the relative changes of all that it is made of. They are expressions of x0 and
the span: they flow once through the motion's own CasADi expression (`fcdm_opt.motion.instructions`), so every motion
has them, and from there into `conditions`; what comes out is a CasADi function.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerances import DEFAULT

ROUNDING = 2 * np.finfo(float).eps  # of the fourth number
_ATAN_BEND, _TANH_BEND = 0.65, 0.77  # the most that their second derivatives reach


class Expansion:
    """A number along a ray, see above; where it is not defined, or unbounded on the span, one of four is not finite."""

    # all are symbols (SX), the span that of all that one calculation is made of
    __slots__ = ("bend", "slope", "span", "terms", "value")

    def __init__(self, value: Any, slope: Any, bend: Any, terms: Any, span: Any) -> None:
        self.value, self.slope, self.bend, self.terms, self.span = value, slope, bend, terms, span

    @classmethod
    def variable(cls, x: Any, span: Any) -> Expansion:
        """Return that of x itself."""
        return cls(x, 1.0, 0.0, np.fabs(x), span)

    @classmethod
    def constant(cls, value: Any, span: Any) -> Expansion:
        """Return that of a number, or a symbol, that does not change."""
        return cls(value, 0.0, 0.0, np.fabs(value), span)

    @property
    def fields(self) -> tuple[Any, Any, Any, Any]:
        """The four."""
        return self.value, self.slope, self.bend, self.terms

    def _other(self, other: Any) -> Expansion:
        return other if isinstance(other, Expansion) else Expansion.constant(other, self.span)

    def __add__(self, other: Any) -> Expansion:
        y = self._other(other)
        value = self.value + y.value
        terms = self.terms + y.terms + np.fabs(value)
        return Expansion(value, self.slope + y.slope, self.bend + y.bend, terms, self.span)

    __radd__ = __add__

    def __neg__(self) -> Expansion:
        return Expansion(-self.value, -self.slope, self.bend, self.terms, self.span)

    def __sub__(self, other: Any) -> Expansion:
        return self + -other

    def __rsub__(self, other: Any) -> Expansion:
        return -self + other

    def _most(self) -> tuple[Any, Any, Any]:
        """Return |f|, and bounds of |f| and |f'| on the span."""
        size, rate = np.fabs(self.value), np.fabs(self.slope)
        return size, size + self.span * (rate + 0.5 * self.span * self.bend), rate + self.span * self.bend

    def __mul__(self, other: Any) -> Expansion:
        factor = self._other(other)
        x, a, b = self._most()
        y, c, d = factor._most()
        slope = self.value * factor.slope + self.slope * factor.value
        bend = a * factor.bend + 2.0 * b * d + self.bend * c
        return Expansion(self.value * factor.value, slope, bend, x * y + x * factor.terms + y * self.terms, self.span)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Expansion:
        return self * self._other(other)._reciprocal()

    def __rtruediv__(self, other: Any) -> Expansion:
        return self._reciprocal() * other

    def _composed(self, value: Any, slope: Any, steepest: Any, bend: Any) -> Expansion:
        """Return a function of f with given value and slope at f(x0), and bounds of its derivatives on the span."""
        rate = self._most()[2]
        terms = np.fabs(value) + np.fabs(slope) * self.terms
        return Expansion(value, slope * self.slope, steepest * self.bend + bend * rate * rate, terms, self.span)

    def _inverse_least(self) -> Any:
        """Return 1 / the least |f| on the span, infinite where f may vanish there."""
        import casadi

        size, most, _ = self._most()
        least = 2.0 * size - most
        return casadi.if_else(least > 0, 1.0 / least, np.inf)

    def _reciprocal(self) -> Expansion:
        bound, inverse = self._inverse_least(), 1.0 / self.value
        return self._composed(inverse, -inverse * inverse, bound * bound, 2.0 * bound * bound * bound)

    def sqrt(self) -> Expansion:
        """Return the square root."""
        bound, root = self._inverse_least(), self.value**0.5
        return self._composed(root, 0.5 / root, 0.5 * bound**0.5, 0.25 * bound**1.5)

    def sin(self) -> Expansion:
        """Return the sine."""
        return self._composed(self.value.sin(), self.value.cos(), 1.0, 1.0)

    def cos(self) -> Expansion:
        """Return the cosine."""
        return self._composed(self.value.cos(), -self.value.sin(), 1.0, 1.0)

    def tan(self) -> Expansion:
        """Return the tangent."""
        return self.sin() / self.cos()

    def exp(self) -> Expansion:
        """Return the exponential."""
        value, most = self.value.exp(), (self.value + self._most()[1] - np.fabs(self.value)).exp()
        return self._composed(value, value, most, most)

    def atan(self) -> Expansion:
        """Return the inverse tangent."""
        return self._composed(self.value.arctan(), 1.0 / (1.0 + self.value * self.value), 1.0, _ATAN_BEND)

    def tanh(self) -> Expansion:
        """Return the hyperbolic tangent."""
        value = self.value.tanh()
        return self._composed(value, 1.0 - value * value, 1.0, _TANH_BEND)


def is_tied(expanded: Array) -> Array:
    """Return which expansions are zero to within rounding, (n,)."""
    return np.asarray(np.abs(expanded[:, 0]) <= DEFAULT.tie * expanded[:, 3])


def flat(expanded: Array) -> bool:
    """Tell whether one of some expansions is zero to within rounding, and so is its slope."""
    value, slope, bend, terms = expanded.T
    rounding = ROUNDING * terms
    return bool(((value <= rounding) & (slope * slope <= 8.0 * bend * rounding)).any())


def roots(expanded: Array) -> Array:
    """Return where each condition becomes zero as its slope goes on, infinite where it grows."""
    value, slope, _, _ = expanded.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(slope < 0, np.abs(value / slope), np.where(np.abs(value) > 0, np.inf, 0.0))


def safe_steps(expanded: Array, span: float) -> Array:
    """Return how far each condition surely holds: the root of f + f' h - B h^2 / 2, at most the span; 0 if it fails."""
    value, slope, bend, terms = expanded.T
    held = value >= -DEFAULT.tie * terms
    value = np.maximum(value, 0.0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        root = np.sqrt(slope * slope + 2.0 * bend * value)
        steps = np.where(slope >= 0, (slope + root) / bend, 2.0 * value / (root - slope))
    steps = np.where((bend == 0) & (slope >= 0), span, steps)
    return np.where(held & ~np.isnan(steps), np.minimum(steps, span), 0.0)
