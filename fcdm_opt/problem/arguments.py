"""Checks of single arguments: each returns plain values or raises `InputError` that names the key."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from fcdm_opt.errors import InputError, known_word
from fcdm_opt.geometry.arrays import Array

LARGEST = 1e30  # of any number: sums and products of lengths, weights and scales stay finite


def is_real(value: Any) -> bool:
    """Tell whether a value is a number, and no larger than any float: no truth value, no text."""
    # an array without axes is the number in it: what functions of arrays give for one point
    if isinstance(value, np.ndarray) and not value.ndim:
        value = value[()]
    if isinstance(value, int):
        return not isinstance(value, bool) and value.bit_length() < sys.float_info.max_exp
    return isinstance(value, float | np.integer | np.floating)


def real(value: Any, key: str, allowed: str, passes: Any = lambda x: True) -> float:
    """Return a number that passes a test."""
    if not is_real(value) or not abs(value) <= LARGEST or not passes(value):
        raise InputError("unusable number", key=key, found=value, allowed=allowed)
    return float(value)


def whole(value: Any, key: str, what: str, least: int, most: float = math.inf) -> int:
    """Return a whole number between two; `what` it is goes into the message."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= most:
        allowed = f"a whole number {f'>= {least}' if most == math.inf else f'from {least} to {most}'}"
        raise InputError(f"unusable {what}", key=key, found=value, allowed=allowed)
    return int(value)


def truth(value: Any, key: str) -> None:
    """Refuse what is no truth value."""
    if not isinstance(value, bool):
        raise InputError("not a truth value", key=key, found=value, allowed="True or False")


def positive(value: Any, key: str) -> float:
    """Return a number > 0, whose reciprocal is no larger than `LARGEST` either."""
    return real(value, key, "a finite number > 0", lambda x: x >= 1.0 / LARGEST)


def length(value: Any, key: str) -> float:
    """Return a length >= 0."""
    return real(value, key, "a finite length >= 0", lambda x: x >= 0)


def items(value: Any) -> list[Any]:
    """Return the items of a sequence or array; nothing else has any."""
    return list(value) if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim) else []


def pair(value: Any, key: str, allowed: str, *, positive: bool = False) -> tuple[float, float]:
    """Return two numbers, both > 0 if asked."""
    two = items(value)
    if len(two) != 2 or not all(is_real(x) and abs(x) <= LARGEST and (x > 0 or not positive) for x in two):
        raise InputError("unusable pair", key=key, found=value, allowed=allowed)
    return float(two[0]), float(two[1])


def scale(value: Any, key: str) -> float | tuple[float, float]:
    """Return a scale > 0, or the ends of a range of scales."""
    allowed = "a scale > 0, or a range (low, high) with 0 < low <= high"
    if not items(value):
        return real(value, key, allowed, lambda x: x > 0)
    low, high = pair(value, key, allowed, positive=True)
    if low > high:
        raise InputError("empty range of scales", key=key, found=value, allowed=allowed)
    return low, high


def interval(value: Any, key: str) -> tuple[float, float]:
    """Return an interval that may be open to one side or both."""
    ends = items(value)
    ordered = len(ends) == 2 and all(map(is_real, ends)) and ends[0] <= ends[1]
    if not ordered or ends[0] == math.inf or ends[1] == -math.inf:
        raise InputError("unusable limits", key=key, found=value, allowed="(lower, upper) with lower <= upper")
    return float(ends[0]), float(ends[1])


def by_parameter(
    values: Any, key: str, names: Iterable[str], unknown: str = "no such parameter of the motion"
) -> dict[str, Any]:
    """Return a mapping whose keys are parameters of the motion, or other names."""
    allowed = ", ".join(names)
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise InputError("not a mapping", key=key, found=values, allowed=f"a mapping with some of the names {allowed}")
    for name in values:
        known_word(name, names, unknown, key=f"{key}.{name}")
    return dict(values)


def motion_values(names: Sequence[str], given: Any, key: str) -> Array:
    """Return motion parameters, (k,), as given, by name or in order; 0 without any."""
    if given is None or isinstance(given, Mapping):
        named = by_parameter(given, key, tuple(names))
        return np.array([real(named.get(name, 0.0), f"{key}.{name}", "a finite number") for name in names])
    q = [real(value, key, "finite numbers") for value in items(given)]
    if len(q) != len(names):
        allowed = f"parameters {', '.join(names)}{', or a 4x4 transform' * (key == 'pose')}"
        raise InputError("not one value for each motion parameter", key=key, found=given, allowed=allowed)
    return np.array(q)
