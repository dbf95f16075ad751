"""What sizes and other numbers are drawn from: uniform, truncated normal, measured."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.errors import InputError, known_arguments
from fcdm_opt.geometry.arrays import Array, frozen, numbers
from fcdm_opt.moved_files import read
from fcdm_opt.plain import Plain
from fcdm_opt.problem.arguments import positive, real

ALL = 8.0  # deviations beyond which a normal distribution draws nothing that floats of 53 digits could tell
_ONE_DOWN = 1.0 - np.finfo(np.float64).eps  # k / n times n may round to above k; this takes it back


class _Drawn(Plain):
    """Base of the distributions."""

    low: float
    high: float

    @property
    def range(self) -> tuple[float, float]:
        """The least and the largest number that can be drawn."""
        return self.low, self.high

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, as it stands in a study file."""
        return {type(self).__name__.lower(): super().to_dict()}

    def _set_range(self, key: str) -> None:
        """Check the range, and keep it as floats."""
        low = real(self.low, f"{key}.low", "a finite number")
        high = real(self.high, f"{key}.high", "a finite number")
        if not low < high:
            raise InputError("empty range", key=key, found=(low, high), allowed="low < high")
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)


@known_arguments
@dataclass(frozen=True)
class Uniform(_Drawn):
    """Every number of a range alike.

    Attributes
    ----------
    low, high : float
        The range, low < high.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        self._set_range("uniform")

    def quantile(self, u: ArrayLike) -> Array:
        """Return the numbers below which the shares `u` of all draws lie, in the shape of `u`."""
        u = _shares(u)
        return np.clip(self.low + u * (self.high - self.low), self.low, self.high)


@known_arguments
@dataclass(frozen=True)
class Normal(_Drawn):
    """A normal distribution cut off at both ends of a range.

    Attributes
    ----------
    mean, deviation : float
        Of the whole distribution, before it is cut off; the mean may lie outside the range.
    low, high : float
        The range, low < high; by default eight deviations to either side of the mean, which cuts off nothing.
    """

    mean: float
    deviation: float
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean", real(self.mean, "normal.mean", "a finite number"))
        object.__setattr__(self, "deviation", positive(self.deviation, "normal.deviation"))
        for key, free in (("low", -math.inf), ("high", math.inf)):
            if getattr(self, key) == free:
                object.__setattr__(self, key, self.mean + math.copysign(ALL * self.deviation, free))
        self._set_range("normal")
        below, above = self._masses
        if not max(below[1] - below[0], above[0] - above[1]) > 0.0:
            what = "no draw falls into this range: the probability of it is lost in rounding"
            allowed = "a range less than 37 deviations from the mean, and no narrower than digits tell apart"
            raise InputError(what, key="normal", found=self.to_dict()["normal"], allowed=allowed)

    @cached_property
    def _masses(self) -> tuple[Array, Array]:
        """What lies below, and above, both ends of the range in the whole distribution."""
        from scipy.special import ndtr

        ends = (np.array([self.low, self.high]) - self.mean) / self.deviation
        return ndtr(ends), ndtr(-ends)

    def quantile(self, u: ArrayLike) -> Array:
        """Return the numbers below which the shares `u` of all draws lie, in the shape of `u`."""
        from scipy.special import ndtri

        u = _shares(u)
        # what lies below and above the number; the smaller of the two has all its digits
        (least, most), (largest, last) = self._masses
        below, above = least + u * (most - least), last + (1.0 - u) * (largest - last)
        turned = np.where(below < above, self.deviation, -self.deviation)
        return np.clip(self.mean + turned * ndtri(np.minimum(below, above)), self.low, self.high)


@known_arguments
@dataclass(frozen=True, eq=False)
class Measured(_Drawn):
    """Measured values, each drawn as often as any other.

    Attributes
    ----------
    values : array (n,)
        The values, in increasing order.
    """

    values: Array

    def __post_init__(self) -> None:
        values = numbers(self.values, "measured")
        if values.ndim != 1 or not values.size or not np.isfinite(values).all():
            allowed = "at least one finite number"
            raise InputError("unusable measured values", key="measured", found=self.values, allowed=allowed)
        object.__setattr__(self, "values", frozen(np.sort(values)))

    @classmethod
    def from_csv(cls, path: str | Path, column: str, nominal: float = 1.0) -> Measured:
        """Read the sizes in a column of a CSV file.

        Parameters
        ----------
        path : path
            A file as `read_columns` wants it.
        column : str
            Name of the column.
        nominal : float
            The size that stands for a scale of 1, in the unit of the column: values are divided by it.

        Raises
        ------
        InputError
            As `read_columns`.
        """
        return cls(read_columns(path, [column], [nominal])[:, 0])

    @property
    def range(self) -> tuple[float, float]:
        """The least and the largest of the values."""
        return float(self.values[0]), float(self.values[-1])

    def quantile(self, u: ArrayLike) -> Array:
        """Return the least values that at least the shares `u` of all values do not exceed, in the shape of `u`."""
        u = _shares(u)
        count = len(self.values)
        return self.values[np.clip(np.ceil(u * count * _ONE_DOWN).astype(np.int64) - 1, 0, count - 1)]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Measured) and np.array_equal(self.values, other.values)

    def __hash__(self) -> int:
        return hash(self.values.tobytes())

    def __repr__(self) -> str:
        low, high = self.range
        return f"Measured({len(self.values)} values from {low:.6g} to {high:.6g})"


Distribution = Uniform | Normal | Measured


def read_columns(
    path: str | Path, columns: Sequence[str], nominals: Sequence[float] | None = None, *, deviations: bool = False
) -> Array:
    """Read columns of measured sizes, by name, from a CSV file: an array (rows, columns) of numbers > 0.

    The file is text in UTF-8 with comma-separated columns and decimal points; its first line names the columns. Lines
    with nothing in them are skipped, before it too. Each column is divided by its nominal, default 1; `deviations` of
    sizes may be 0 and less.

    An `InputError` names file, row (the line of the file, the first is 1) and column: for a file that cannot be read, a
    column that is not there or there twice, and for what is no number > 0: empty, text, nan, zero.
    """
    if isinstance(columns, str) or not columns or not all(isinstance(column, str) for column in columns):
        raise InputError("name the columns to read", key="columns", found=columns, allowed="a list of names")
    nominals = [1.0] * len(columns) if nominals is None else list(nominals)
    if len(nominals) != len(columns):
        raise InputError("one nominal size a column", key="nominals", found=nominals)
    divisors = [positive(nominal, "nominal") for nominal in nominals]
    return read(path, lambda text: _table(text, columns, -np.inf if deviations else 0.0)) / np.array(divisors)


def _table(text: str, columns: Sequence[str], above: float) -> Array:
    rows = csv.reader(io.StringIO(text), strict=True)
    filled = (row for row in rows if any(cell.strip() for cell in row))
    try:
        header = [name.strip() for name in next(filled, [])]
        places = [_place(header, column) for column in columns]
        table = [[_size(row, place, header, rows.line_num, above) for place in places] for row in filled]
    except csv.Error as reason:
        raise InputError(f"not a CSV file: {reason}", key=f"row {rows.line_num}") from reason
    if not table:
        raise InputError("no row of numbers below the line of names")
    return np.array(table)


def _place(header: list[str], column: str) -> int:
    if header.count(column) == 1:
        return header.index(column)
    what = "this column is there twice" if column in header else "no such column"
    if len(header) == 1 and (";" in header[0] or "\t" in header[0]):
        what += " (columns are separated by commas, and by nothing else)"
    raise InputError(what, key=f"column {column!r}", allowed=f"one of {', '.join(map(repr, header))}")


def _size(row: list[str], place: int, header: list[str], line: int, above: float) -> float:
    key = f"row {line}, column {header[place]!r}"
    if len(row) != len(header):
        what = f"this row has {len(row)} cells and the line of names {len(header)}"
        raise InputError(what, key=key, allowed="commas between cells only, and points in numbers")
    try:
        value = float(row[place].replace("_", "?"))  # Python takes 1_000
    except ValueError:
        value = float("nan")
    if not above < value < np.inf:
        found = row[place] or "nothing"
        raise InputError("not a size", key=key, found=found, allowed=f"a finite number{' > 0' * (above == 0.0)}")
    return value


def _shares(u: ArrayLike) -> Array:
    shares = numbers(u, "u")
    if not ((shares >= 0.0) & (shares <= 1.0)).all():
        raise InputError("shares of all draws lie between 0 and 1", key="u", found=u)
    return shares
