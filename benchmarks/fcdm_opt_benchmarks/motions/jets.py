"""Numbers in many digits that carry their error and their derivatives: balls of FLINT with gradient and Hessian.

They take the place of floats wherever formulas are written for any scalars, motions among them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

BITS = 192  # of the balls' midpoints: 57 digits
TERMS = 80  # of a power series in the square of an angle of up to a turn


class Jet:
    """A ball with its gradient and its second derivatives by the motion's parameters."""

    def __init__(self, value: Any, slope: Any, bend: Any) -> None:
        self.value, self.slope, self.bend = value, slope, bend

    @classmethod
    def variables(cls, values: Sequence[Any]) -> list[Jet]:
        """Return the parameters themselves."""
        from flint import arb_mat

        k = len(values)
        return [cls(x, arb_mat(k, 1, [int(i == j) for j in range(k)]), arb_mat(k, k)) for i, x in enumerate(values)]

    def __add__(self, other: Any) -> Jet:
        if isinstance(other, Jet):
            return Jet(self.value + other.value, self.slope + other.slope, self.bend + other.bend)
        return Jet(self.value + other, self.slope, self.bend)

    def __mul__(self, other: Any) -> Jet:
        from flint import arb

        if not isinstance(other, Jet):
            other = arb(other)
            return Jet(self.value * other, self.slope * other, self.bend * other)
        cross = self.slope * other.slope.transpose()
        bend = self.bend * other.value + other.bend * self.value + cross + cross.transpose()
        return Jet(self.value * other.value, self.slope * other.value + other.slope * self.value, bend)

    def __neg__(self) -> Jet:
        return Jet(-self.value, -self.slope, -self.bend)

    def __sub__(self, other: Any) -> Jet:
        return self + (-other)

    def __rsub__(self, other: Any) -> Jet:
        return -self + other

    def __truediv__(self, other: Any) -> Jet:
        from flint import arb

        if not isinstance(other, Jet):
            return self * (1 / arb(other))
        return self * other.inverse()

    def __rtruediv__(self, other: Any) -> Jet:
        return self.inverse() * other

    __radd__, __rmul__ = __add__, __mul__

    def by(self, value: Any, first: Any, second: Any) -> Jet:
        """Return a function of the number, by its value and two derivatives."""
        return Jet(value, self.slope * first, self.bend * first + self.slope * self.slope.transpose() * second)

    def inverse(self) -> Jet:
        """Return one over the number."""
        own = 1 / self.value
        return self.by(own, -own * own, 2 * own * own * own)

    def sin(self) -> Jet:
        """Return the sine."""
        s, c = self.value.sin_cos()
        return self.by(s, c, -s)

    def cos(self) -> Jet:
        """Return the cosine."""
        s, c = self.value.sin_cos()
        return self.by(c, -s, -c)

    def sqrt(self) -> Jet:
        """Return the square root."""
        root = self.value.sqrt()
        return self.by(root, 1 / (2 * root), -1 / (4 * root * self.value))

    def sinc(self) -> Jet:
        """Return sin(r) / r of the number r^2."""
        return self.by(*series(self.value, 1))

    def versine(self) -> Jet:
        """Return (1 - cos r) / r^2 of the number r^2."""
        return self.by(*series(self.value, 2))


def series(x: Any, first: int) -> tuple[Any, Any, Any]:
    """Return 1/first! - x/(first + 2)! + x^2/(first + 4)! - ... and two derivatives, with what is left out."""
    from flint import arb, fmpz

    def total(order: int) -> Any:
        made, power = arb(0), arb(1)
        for k in range(order, TERMS):
            made += power * (-1) ** k * arb(math.perm(k, order)) / arb(fmpz(math.factorial(2 * k + first)))
            power *= x
        # terms fall by more than half from here, for angles of a few turns
        left = abs(power) * 2 * arb(math.perm(TERMS, order)) / arb(fmpz(math.factorial(2 * TERMS + first)))
        return made + arb(0, left.upper())

    return total(0), total(1), total(2)


# -------------------------------------------------------------------------------------------------- vectors of numbers


def value(x: Any) -> Any:
    """Return the ball of a jet, or of a number."""
    from flint import arb

    return x.value if isinstance(x, Jet) else arb(x)


def certain(vector: Sequence[Any]) -> bool:
    """Tell whether a vector is surely not zero."""
    return any(x != 0 for x in vector)


def dot(u: Sequence[Any], v: Sequence[Any]) -> Any:
    """Return the inner product."""
    return v[0] * u[0] + v[1] * u[1] + v[2] * u[2]


def minus(u: Sequence[Any], v: Sequence[Any]) -> list[Any]:
    """Return the difference."""
    return [x - y for x, y in zip(u, v, strict=True)]


def cross(u: Sequence[Any], v: Sequence[Any]) -> list[Any]:
    """Return the cross product."""
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
