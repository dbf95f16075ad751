"""Lengths in words, with the unit that a problem names; no number follows from it."""

from __future__ import annotations


def measured(length: str, unit: str) -> str:
    """Return a length with its unit, "0.25 mm"; alone where the unit is ""."""
    return f"{length} {unit}" if unit else length
