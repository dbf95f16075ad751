"""Lengths and bounds in words, with the unit that a problem names; no number follows from it."""

from __future__ import annotations

from decimal import ROUND_FLOOR, Context

ROUNDING = 1e-11
"""Of a bound: what floats leave of 0.07 may be 0.06999999999999999, and is shown as it was meant."""


def measured(length: str, unit: str) -> str:
    """Return a length with its unit, "0.25 mm"; alone where the unit is ""."""
    return f"{length} {unit}" if unit else length


def floored(bound: float, digits: int) -> str:
    """Return a positive lower bound, never more than it is but for the rounding of floats."""
    down = Context(prec=digits, rounding=ROUND_FLOOR)
    return f"{float(down.create_decimal_from_float(bound * (1.0 + ROUNDING))):.{digits}g}"
