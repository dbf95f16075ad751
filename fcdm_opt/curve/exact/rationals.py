"""Rational arithmetic: vectors of integers, floats taken as they are, quotients rounded once.

A float is an integer times a power of two, and so is an array of them with one power for all its entries, its unit.
Integers and rationals are those of FLINT, of any size: nothing here rounds, except what says so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat, fmpz

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array

Vector = tuple[fmpz, ...]
Number = float | fmpq | fmpz
ZERO, ONE = fmpz(0), fmpz(1)
DIGITS = 53  # of a float's mantissa, binary
# Square roots of integers are taken to this many bits after the point: a quotient by one is then off by 2^-128 of its
# value before it is rounded to 53 bits, wrong only if 75 bits in a row happen to be those of a tie.
ROOT_BITS = 128
SAFE = 2.0**-500  # numbers from here to its inverse, and their products, neither underflow nor overflow


def dot(u: Sequence[Any], v: Sequence[Any]) -> Any:
    """Return the inner product of two vectors of three."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def dot4(u: Sequence[fmpz], v: Sequence[fmpz]) -> fmpz:
    """Return the inner product of two vectors of four."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2] + u[3] * v[3]


def cross(u: Sequence[Any], v: Sequence[Any]) -> tuple[Any, Any, Any]:
    """Return the cross product of two vectors of space."""
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def minus(u: Sequence[Any], v: Sequence[Any]) -> tuple[Any, Any, Any]:
    """Return the difference of two vectors of three."""
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


def coprime(values: Sequence[fmpz]) -> Vector:
    """Return integers divided by their greatest common divisor."""
    content = ZERO
    for x in values:
        content = content.gcd(x)
    return tuple(values) if content == 1 else tuple([x // content for x in values])


def rank(rows: Sequence[Sequence[fmpz | fmpq]]) -> int:
    """Return how many of the rows are independent."""
    return fmpq_mat([list(row) for row in rows]).rank() if rows else 0


def affine_rank(points: Sequence[Sequence[fmpz | fmpq]]) -> int:
    """Return the dimension of what the points span: 0 a point, 1 a line."""
    return rank([minus(point, points[0]) for point in points[1:]])


def common_unit(*arrays: Array) -> int:
    """Return the exponent of the largest power of two that all entries are multiples of; 0 where all are zero."""
    entries = np.concatenate([array.ravel() for array in arrays])
    mantissa, exponent = np.frexp(entries[entries != 0])
    if not mantissa.size:
        return 0
    whole = np.ldexp(mantissa, DIGITS).astype(np.int64)
    lowest = np.frexp((whole & -whole).astype(np.float64))[1] - 1
    return int((exponent - DIGITS + lowest).min())


def multiple(x: float, unit: int) -> fmpz:
    """Return x / 2^unit of a float that is a multiple of 2^unit."""
    mantissa, exponent = math.frexp(x)
    whole, shift = int(math.ldexp(mantissa, DIGITS)), exponent - DIGITS - unit
    return fmpz(whole << shift if shift >= 0 else whole >> -shift)


def scaled(x: fmpz, exponent: int) -> fmpq:
    """Return x times a power of two."""
    return fmpq(x << exponent) if exponent >= 0 else fmpq(x, ONE << -exponent)


def rational(x: Number) -> fmpq:
    """Return a number as a rational, a float as it is."""
    return x if isinstance(x, fmpq) else fmpq(x) if isinstance(x, fmpz) else fmpq(*float(x).as_integer_ratio())


def scale_pair(rho: Sequence[Number]) -> tuple[fmpq, fmpq]:
    """Return a scale pair as rationals; an InputError unless it is two positive finite numbers."""
    try:
        x, y = (rational(value) for value in rho)
    except (TypeError, ValueError, OverflowError) as reason:
        raise InputError("a scale pair is two finite numbers", key="rho", found=rho) from reason
    if not (x > 0 and y > 0):
        raise InputError("scales are positive", key="rho", found=rho)
    return x, y


def quotient(top: fmpz, bottom: fmpz) -> float:
    """Return a quotient of integers, correctly rounded; infinite where it is too large."""
    try:
        return int(top) / int(bottom)
    except OverflowError:
        return math.inf if (top > 0) == (bottom > 0) else -math.inf


def normalised(values: Sequence[fmpz], shifts: Sequence[int]) -> list[float]:
    """Return values times powers of two as floats, the largest made 1."""
    try:
        rounded = [math.ldexp(x, s) for x, s in zip(map(float, values), shifts, strict=True)]
        largest = max(max(rounded), -min(rounded))
    except OverflowError:
        largest = math.inf
    if not SAFE < largest < 1 / SAFE:
        if not any(values):
            return [0.0] * len(values)
        top = max(x.height_bits() + s for x, s in zip(values, shifts, strict=True) if x)
        wide = [max(0, x.height_bits() - 64) for x in values]
        rounded = [math.ldexp(float(x >> w), w + s - top) for x, w, s in zip(values, wide, shifts, strict=True)]
        largest = max(max(rounded), -min(rounded))
    return [x / largest for x in rounded]


def length(u: Sequence[fmpz]) -> fmpz:
    """Return the length of a vector times 2^ROOT_BITS, rounded down."""
    return (sum((x * x for x in u), ZERO) << 2 * ROOT_BITS).isqrt()


def over_length(x: fmpz | fmpq, size: fmpz) -> float:
    """Return a number divided by a `length`, rounded once."""
    top, bottom = (x.p, x.q) if isinstance(x, fmpq) else (x, ONE)
    return quotient(top << ROOT_BITS, bottom * size)
