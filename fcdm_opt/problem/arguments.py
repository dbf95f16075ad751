"""Checks of single arguments: each returns plain values or raises `InputError` that names the key."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, frozen

LARGEST = 1e30  # of any number: sums and products of lengths, weights and scales stay finite


def is_real(value: Any) -> bool:
    """Tell whether a value is a number, and no larger than any float: no truth value, no text.

    An array without axes is the number in it: what functions of arrays give for one point.
    """
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


def nominal(value: Any) -> int | str | tuple[float, float]:
    """Return a nominal contact: a number, "drawn" or a scale pair."""
    allowed = 'the number of a switching point (from 1), a scale pair (rho_1, rho_2) > 0, or "drawn"'
    if isinstance(value, str) and value == "drawn":
        return value
    if isinstance(value, int | np.integer) and not isinstance(value, bool) and value >= 1:
        return int(value)
    return pair(value, "nominal", allowed, positive=True)


def tolerance(value: Any) -> Any:
    """Return the tolerance in the shape given, in plain numbers."""
    if value is None:
        return None
    allowed = (
        "tau, (tau_1, tau_2) or ((minus_1, plus_1), (minus_2, plus_2)), all finite, >= 0 and below 1 (0.02 is 2 %)"
    )

    def numbers(given: Any, depth: int) -> Any:
        if is_real(given) and 0 <= given < 1:
            return float(given)
        if is_real(given) and given >= 1:
            meant = f": {given:g} % is {given / 100.0:g}" if given < 100 else ""
            raise InputError(f"a tolerance is a share, below 1{meant}", key="tolerance", found=value, allowed=allowed)
        inner = items(given)
        shaped = [numbers(item, depth + 1) for item in inner]
        if depth == 2 or len(shaped) != 2 or isinstance(shaped[0], float) != isinstance(shaped[1], float):
            raise InputError("unusable tolerance", key="tolerance", found=value, allowed=allowed)
        return tuple(shaped)

    return numbers(value, 0)


def rows(value: Any) -> Array | None:
    """Return (minus, plus) of both bodies, (2, 2), of a tolerance that was checked; None for None."""
    if value is None:
        return None
    bodies = (value, value) if isinstance(value, float) else value
    return frozen([(x, x) if isinstance(x, float) else x for x in bodies])


def target(value: Any) -> tuple[float, float] | None:
    """Return the scales made; None for None."""
    return None if value is None else pair(value, "target", "two scales > 0", positive=True)


def box(value: Any) -> tuple[tuple[float, float], ...]:
    """Return two ranges of scales."""
    allowed = "((low_1, high_1), (low_2, high_2)) with 0 < low < high"
    sides = items(value)
    if len(sides) != 2:
        raise InputError("unusable box", key="box", found=value, allowed=allowed)
    ranges = tuple(pair(side, "box", allowed, positive=True) for side in sides)
    if not all(low < high for low, high in ranges):
        raise InputError("empty box", key="box", found=value, allowed=allowed)
    return ranges


def interval(value: Any, key: str) -> tuple[float, float]:
    """Return an interval that may be open to one side or both."""
    ends = items(value)
    ordered = len(ends) == 2 and all(map(is_real, ends)) and ends[0] <= ends[1]
    if not ordered or ends[0] == math.inf or ends[1] == -math.inf:
        raise InputError("unusable limits", key=key, found=value, allowed="(lower, upper) with lower <= upper")
    return float(ends[0]), float(ends[1])


def by_parameter(values: Any, key: str, names: Iterable[str]) -> dict[str, Any]:
    """Return a mapping whose keys are parameters of the motion."""
    allowed = ", ".join(names)
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise InputError("not a mapping", key=key, found=values, allowed=f"a mapping with some of the names {allowed}")
    for name in values:
        if name not in names:
            raise InputError("no such parameter of the motion", key=f"{key}.{name}", found=name, allowed=allowed)
    return dict(values)


def labels(value: Any, key: str) -> tuple[str, str] | None:
    """Return two feature labels, None for None."""
    if value is None:
        return None
    two = [str(item) for item in items(value) if isinstance(item, str | Feature)]
    if len(two) != 2 or len(items(value)) != 2:
        raise InputError("not two features", key=key, found=value, allowed="two labels such as V1F2(P1V6; P2V2,V3,V5)")
    return two[0], two[1]


def steps(value: Any, key: str, names: list[str]) -> dict[str, float] | None:
    """Return a step > 0 for some parameters, or for all where one number is given; None for None."""
    if value is None:
        return None
    given = dict.fromkeys(names, value) if is_real(value) else by_parameter(value, key, names)
    if not given:
        raise InputError("no step", key=key, found=value, allowed=f"a number > 0, or steps of {', '.join(names)}")
    return {name: positive(step, f"{key}.{name}") for name, step in given.items()}


def published(values: Any, names: list[str]) -> tuple[float, ...] | None:
    """Return one number for each parameter."""
    if values is None:
        return None
    allowed = f"{len(names)} finite numbers: {', '.join(names)}"
    given = items(values)
    if len(given) != len(names):
        raise InputError("not one value for each motion parameter", key="published", found=values, allowed=allowed)
    return tuple(real(value, "published", allowed) for value in given)


def choice(value: Any, key: str, choices: tuple[str | None, ...]) -> None:
    """Refuse a value that is none of the choices."""
    if (value is None or isinstance(value, str)) and value in choices:
        return
    allowed = ", ".join(f'"{choice}"' for choice in choices if choice)
    raise InputError(f"unknown {key}", key=key, found=value, allowed=allowed)
