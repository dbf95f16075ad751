"""Floats to integers and back, against Python's own fractions and integers."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from flint import fmpq, fmpz
from hypothesis import given
from hypothesis import strategies as st

from fcdm_opt.curve.exact.rationals import (
    common_unit,
    coprime,
    length,
    multiple,
    normalised,
    over_length,
    quotient,
    rational,
)

FLOATS = st.floats(allow_nan=False, allow_infinity=False)
WIDE = st.integers(-(2**3000), 2**3000)


@given(st.lists(FLOATS, min_size=1, max_size=6))
def test_floats_are_multiples_of_their_largest_common_unit(values):
    unit = common_unit(np.array(values))
    whole = [int(multiple(x, unit)) for x in values]
    assert [n * Fraction(2) ** unit for n in whole] == [Fraction(x) for x in values]
    assert any(n % 2 for n in whole) or (unit == 0 and not any(values))


@given(FLOATS)
def test_a_float_is_a_rational_as_it_is(x):
    found = rational(x)
    assert Fraction(int(found.p), int(found.q)) == Fraction(x)


@given(st.lists(WIDE, min_size=1, max_size=6), st.integers(-4000, 4000))
def test_normalised_integers_of_any_size_are_right_to_a_few_units(values, shift):
    found = normalised([fmpz(x) for x in values], [shift] * len(values))
    largest = max(map(abs, values))
    for x, y in zip(values, found, strict=True):
        expected = Fraction(x, largest) if largest else Fraction(0)
        assert abs(Fraction(y) - expected) <= 4 * Fraction(2) ** -53 * abs(expected) + Fraction(2) ** -500
    assert not largest or max(map(abs, found)) == 1


@given(WIDE, WIDE.filter(bool))
def test_quotients_are_correctly_rounded(top, bottom):
    try:
        expected = float(Fraction(top, bottom))
    except OverflowError:
        expected = math.inf if top * bottom > 0 else -math.inf
    assert quotient(fmpz(top), fmpz(bottom)) == expected


@given(st.lists(WIDE, min_size=3, max_size=3).filter(any))
def test_unit_vectors_are_rounded_once(vector):
    size = length([fmpz(x) for x in vector])
    square = sum(x * x for x in vector)
    for x in vector:
        value = over_length(fmpz(x), size)
        low, high = (Fraction(float(np.nextafter(abs(value), to))) for to in (0, 2))
        assert low**2 < Fraction(x * x, square) < high**2 or value == x == 0
        assert (value >= 0) if x >= 0 else (value <= 0)
        assert over_length(fmpq(x, 3), size) == over_length(fmpz(x), 3 * size)


@given(st.lists(WIDE, min_size=2, max_size=4).filter(any))
def test_coprime_integers_keep_their_ratios(values):
    found = [int(x) for x in coprime([fmpz(x) for x in values])]
    assert math.gcd(*found) == 1
    factor = math.gcd(*values)
    assert [factor * x for x in found] == values
