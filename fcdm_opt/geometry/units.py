"""Units of length, and lengths and bounds in words with the unit that a problem names; no number follows from it."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import ROUND_FLOOR, Context
from pathlib import Path
from typing import Literal, cast

from fcdm_opt.errors import InputError

Unit = Literal["m", "cm", "mm", "um", "in", "ft"]
UnitOrNone = Literal["", Unit]
NANOMETRES = {"m": 1_000_000_000, "cm": 10_000_000, "mm": 1_000_000, "um": 1_000, "in": 25_400_000, "ft": 304_800_000}

NOISE = 1e-12
"""A length that is 0, in any unit: of the shortest, a micrometre, it is less than an atom; parts are not so small."""

ROUNDING = 1e-11  # of a bound: what floats leave of 0.07 may be 0.06999999999999999, and is shown as it was meant


def same_unit(given: Mapping[str, str | None], file: Path | None = None) -> UnitOrNone:
    """Return the unit that bodies, by their places, name; "" where none does. Refuse different ones."""
    units = {place: unit for place, unit in given.items() if unit}
    first = next(iter(units), "")
    for place, unit in units.items():
        if unit != units[first]:
            what = "the bodies come in different units"
            found = f"{place} in {unit}, {first} in {units[first]}"
            allowed = (
                "one unit, that of all lengths asked and told: STEP and GLB files say what they are in, and are "
                "converted; of other mesh files file_unit says it"
            )
            raise InputError(what, file=file, key=f"{place}.unit", found=found, allowed=allowed)
    return cast("UnitOrNone", units.get(first, ""))


def unit_of(named: str, bodies: Mapping[str, str]) -> UnitOrNone:
    """Return the unit of a question: that of its bodies, by their places, or else what it names itself."""
    own = same_unit(bodies)
    if named and own and named != own:
        raise InputError("not the unit of the bodies", key="unit", found=named, allowed=f'"{own}", or none')
    return own or cast("UnitOrNone", named)


def number_text(value: float, digits: int = 6, least: float = NOISE) -> str:
    """Return a number in words, 0 up to `least`: what rounding leaves of it."""
    return f"{0.0 if abs(value) <= least else value:.{digits}g}"


def signed(value: float, digits: int = 4, least: float = NOISE) -> str:
    """Return a number with its sign in words, as `number_text` does."""
    return f"{0.0 if abs(value) <= least else value:+.{digits}g}"


def measured(length: str | float, unit: str, digits: int = 6) -> str:
    """Return a length, a number or in words, with its unit, "0.25 mm"; alone where the unit is ""."""
    text = length if isinstance(length, str) else number_text(length, digits)
    return f"{text} {unit}" if unit else text


def shortest(value: float, error: float) -> float:
    """Return the number of fewest digits that is no further than an error from a value; the value for no error."""
    for digits in range(1, 17):
        rounded = float(f"{value:.{digits}g}")
        if abs(rounded - value) <= error:
            return rounded
    return value


def gap_text(gap: float, slack: float, unit: str, need: float = 0.0) -> str:
    """Return in words whether two things touch, are apart or overlap, by how much, and which clearance they need."""
    length = measured(abs(gap), unit, 4)
    text = "touch" if abs(gap) <= slack else f"are {length} apart" if gap > 0.0 else f"overlap by {length}"
    return f"{text}, a clearance of {measured(need, unit, 4)} is required" if need > 0.0 else text


def floored(bound: float, digits: int) -> str:
    """Return a positive lower bound, never more than it is but for the rounding of floats."""
    down = Context(prec=digits, rounding=ROUND_FLOOR)
    return f"{float(down.create_decimal_from_float(bound * (1.0 + ROUNDING))):.{digits}g}"
