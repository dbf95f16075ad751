"""Numbers as JSON has them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

DIGITS = 9
"""Significant digits of what is only drawn: far finer than any screen, and half the length of a float."""


def plain(value: Any) -> Any:
    """Return mappings, sequences and arrays as dicts and lists; None for numbers that JSON does not have."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def drawn(value: Any) -> Any:
    """Return numbers as `plain` does, floats to `DIGITS` digits."""
    value = plain(value)
    if isinstance(value, list):
        return [drawn(item) for item in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value
