"""First-order enclosures: numbers that depend on a few variables, each with a bound of what the linear part leaves out.

One object holds a number for each cell of a batch. Over a cell, with the cell's variables scaled to -1 <= x <= 1,

    | f(x) - (centre + slopes . x) | <= error.

They flow through the same code as floats and CasADi expressions (`fcdm_opt.motion.motions`). Products and functions
keep the linear part and bound the rest by second derivatives, so errors fall with the square of a cell's size.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.motion.motions import Motion

TERMS = 10  # of the series of sin(r)/r and (1 - cos r)/(r r) in r r, for r <= 1
_SINC, _VERSINE = (Polynomial([(-1) ** n / math.factorial(2 * n + more) for n in range(TERMS)]) for more in (1, 2))
PAD = 2.0**-49  # rounding of one operation: no more than sixteen units in the last place of what enters


class Enclosure:
    """A number over each of n cells with k variables: centre, slopes and error of each, `data` of (n, k + 2)."""

    __slots__ = ("data",)
    __array_ufunc__ = None  # numpy leaves the arithmetic to this class

    def __init__(self, data: Array) -> None:
        self.data = data

    @classmethod
    def variable(cls, centre: Array, half: Array, place: int, count: int) -> Enclosure:
        """Return variable number `place` of `count`: `centre` +- `half` in each cell, (n,) each."""
        data = np.zeros((len(centre), count + 2))
        data[:, 0], data[:, 1 + place] = centre, half
        data[:, -1] = PAD * np.abs(centre)
        return cls(data)

    @classmethod
    def box(cls, low: Array, high: Array) -> list[Enclosure]:
        """Return the variables of boxes, given by their ends, (n, k) each."""
        middle, half, count = (low + high) / 2.0, (high - low) / 2.0, low.shape[1]
        return [cls.variable(middle[:, j], half[:, j], j, count) for j in range(count)]

    @property
    def radius(self) -> Array:
        """Bound of what is off the centre, (n,)."""
        return np.asarray(np.abs(self.data[:, 1:]).sum(axis=1))

    @property
    def low(self) -> Array:
        """Lower bound over each cell, (n,)."""
        return np.asarray(self.data[:, 0] - self.radius * (1.0 + PAD))

    @property
    def high(self) -> Array:
        """Upper bound over each cell, (n,)."""
        return np.asarray(self.data[:, 0] + self.radius * (1.0 + PAD))

    def __add__(self, other: Any) -> Enclosure:
        if isinstance(other, Enclosure):
            data = self.data + other.data
        else:
            if other == 0.0:
                return self
            data = self.data.copy()
            data[:, 0] += other
        data[:, -1] += PAD * np.abs(data[:, 0])
        return Enclosure(data)

    __radd__ = __add__

    def __neg__(self) -> Enclosure:
        data = -self.data
        data[:, -1] = self.data[:, -1]
        return Enclosure(data)

    def __sub__(self, other: Any) -> Enclosure:
        return self + (-other)

    def __rsub__(self, other: Any) -> Enclosure:
        return -self + other

    def __mul__(self, other: Any) -> Any:
        if not isinstance(other, Enclosure):
            if other == 0.0:
                return 0.0  # what is zero stays a plain number, and costs nothing from here on
            if other == 1.0:
                return self
            data = self.data * other
            data[:, -1] = np.abs(data[:, -1]) * (1.0 + PAD) + PAD * np.abs(data[:, 0])
            return Enclosure(data)
        one, two = self.data, other.data
        r, s = np.abs(one[:, 1:]).sum(axis=1), np.abs(two[:, 1:]).sum(axis=1)
        data = one[:, :1] * two + two[:, :1] * one
        sizes = np.abs(one[:, 0]), np.abs(two[:, 0])
        data[:, 0] *= 0.5
        data[:, -1] = sizes[0] * two[:, -1] + sizes[1] * one[:, -1] + r * s
        data[:, -1] += PAD * (sizes[0] + r) * (sizes[1] + s)
        return Enclosure(data)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return self * (other.reciprocal() if isinstance(other, Enclosure) else 1.0 / other)

    def __rtruediv__(self, other: Any) -> Any:
        return self.reciprocal() * other

    def __pow__(self, power: float) -> Any:
        if power == 2.0:
            return self * self
        raise TypeError("enclosures have squares only")

    def _function(self, value: Array, slope: Array, bend: Array) -> Enclosure:
        """Return a function given at the centre, with a bound `bend` of its second derivative over the cell."""
        r = self.radius
        data = self.data * slope[:, None]
        data[:, 0] = value
        data[:, -1] = np.abs(data[:, -1]) + 0.5 * bend * r * r + PAD * (np.abs(value) + np.abs(slope) * r)
        return Enclosure(data)

    def sin(self) -> Enclosure:
        """Return the sine."""
        x = self.data[:, 0]
        return self._function(np.sin(x), np.cos(x), np.ones(len(x)))._at_most_one()

    def cos(self) -> Enclosure:
        """Return the cosine."""
        x = self.data[:, 0]
        return self._function(np.cos(x), -np.sin(x), np.ones(len(x)))._at_most_one()

    def _at_most_one(self) -> Enclosure:
        """Replace what says less than -1 <= f <= 1."""
        wide = ~(self.radius <= 2.0)
        self.data[wide] = 0.0
        self.data[wide, -1] = 1.0
        return self

    def sqrt(self) -> Enclosure:
        """Return the square root; of unbounded error where the number may be zero."""
        x, low = self.data[:, 0], self.low
        with np.errstate(all="ignore"):
            root = np.sqrt(x)
            return self._function(root, 0.5 / root, np.where(low > 0, 0.25 / (low * np.sqrt(low)), np.inf))

    def reciprocal(self) -> Enclosure:
        """Return 1 / f; of unbounded error where the number may be zero."""
        x, r = self.data[:, 0], self.radius
        least = np.abs(x) - r
        with np.errstate(all="ignore"):
            return self._function(1.0 / x, -1.0 / (x * x), np.where(least > 0, 2.0 / least**3, np.inf))

    def sinc(self) -> Enclosure:
        """Return sin(r) / r of f = r r: cos(s r) averaged over 0 <= s <= 1, so |2nd derivative| <= 1/60 for f >= 0."""
        # its series 1 - f/6 + f f/120 - ... has a second derivative below 1/50 down to f = -1
        return self._series(_SINC, _sinc, 1.0 / 50.0)

    def versine(self) -> Enclosure:
        """Return (1 - cos(r)) / (r r) of f = r r; |second derivative| <= 1/360 for f >= 0, below 1/300 from f = -1."""
        return self._series(_VERSINE, _versine, 1.0 / 300.0)

    def _series(self, series: Polynomial, far: Callable[[Array, Array], tuple[Array, Array]], bend: float) -> Enclosure:
        """Return a function of a square x at max(centre, 0): by its series below 1, else `far` of its root and x."""
        centre = np.maximum(self.data[:, 0], 0.0)
        moved = self + 0.0 if (centre == self.data[:, 0]).all() else Enclosure(self.data.copy())
        moved.data[:, -1] += centre - moved.data[:, 0]  # a square is not negative: its rounding may be
        moved.data[:, 0] = centre
        small = centre < 1.0
        safe, near = np.where(small, 1.0, centre), np.minimum(centre, 1.0)
        value, slope = far(np.sqrt(safe), safe)
        value, slope = np.where(small, series(near), value), np.where(small, series.deriv()(near), slope)
        return moved._function(value, slope, np.where(moved.low >= -1.0, bend, np.inf))


def enclosed_pose(motion: Motion, q: list[Any], offset: Array) -> Array:
    """Return the relative pose of body 1 over cells of parameters, (n, 12, k + 2): R, row by row, and s_2 - moved s_1.

    Of a motion as seen from the seed of body 1, for enclosures q of its parameters; `offset` leads from there to s_2.
    """
    with np.errstate(all="ignore"):  # what has no bound becomes infinite or nan, and bounds nothing
        matrix = motion.composed(q, (0.0, 0.0, 0.0), tuple(offset.tolist()))
    entries = [matrix[i][j] for i in range(3) for j in range(3)]
    entries += [float(offset[i]) - matrix[i][3] for i in range(3)]
    T = np.zeros((len(q[0].data), 12, len(q) + 2))
    for place, entry in enumerate(entries):
        if isinstance(entry, Enclosure):
            T[:, place] = entry.data
        else:
            T[:, place, 0] = entry
    return T


def _sinc(r: Array, x: Array) -> tuple[Array, Array]:
    """Return sin(r)/r and its derivative in x = r r."""
    value = np.sin(r) / r
    return value, (np.cos(r) - value) / (2.0 * x)


def _versine(r: Array, x: Array) -> tuple[Array, Array]:
    """Return (1 - cos r)/(r r) and its derivative in x = r r."""
    value = 2.0 * np.sin(r / 2) ** 2 / x
    return value, (np.sin(r) / r - 2.0 * value) / (2.0 * x)
