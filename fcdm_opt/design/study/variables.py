"""What varies in a study: keys of a problem, and what they take: listed values, grids, joint draws."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fcdm_opt.design.distributions import Distribution, Measured, Normal, Uniform, read_columns
from fcdm_opt.design.places import Place, parse
from fcdm_opt.design.question import canonical, located, plain_value
from fcdm_opt.errors import InputError, placed
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.problem.arguments import LARGEST, is_real, items, real

MOST = 10_000_000  # draws, and numbers of a grid: they are held in memory, 8 bytes each
PARAMETERS = "parameters"  # head of the places that are names of a study's own
_ONE_KEY = "one key; keys that follow from one number: a parameter and [derive]"


@dataclass(frozen=True, eq=False)
class Variable:
    """Keys of a problem that vary together, and what they take.

    `keys` are places, see `fcdm_opt.design.places`; `values` are listed, one a point, lists of one a key where there
    are several, or what is drawn from. `label` is the column in the results, by default the keys; `names` stand for
    listed values in the results, by default these themselves. `where` is how errors name it, and `listed` its values.
    """

    keys: tuple[str, ...]
    values: Any
    label: str = ""
    names: tuple[str, ...] = ()
    where: str = ""
    listed: str = ""

    def __post_init__(self) -> None:
        keys = tuple(self.keys) if isinstance(self.keys, list | tuple) else (self.keys,)
        where = self.where or f"vary[{keys[0] if len(keys) == 1 else keys!r}]"
        label, listed = self.label or ", ".join(map(str, keys)), self.listed or where
        self.__dict__.update(keys=keys, label=label, where=where, listed=listed, names=tuple(self.names))
        if not keys:
            raise InputError("no key", key=where, allowed="one key or more")
        for k, key in enumerate(keys, 1):
            with placed(key=f"{where}.key" + (f"[{k}]" if len(keys) > 1 else "")):
                parse(key if isinstance(key, str) else f" {key!r}")
        if not isinstance(self.label, str):
            raise InputError("not a text", key=f"{where}.label", found=self.label, allowed="a text")
        if not isinstance(self.values, Distribution):
            self.__dict__["values"] = self._checked_values()
        elif len(keys) > 1:
            raise InputError("numbers are drawn for one key", key=where, found=", ".join(keys), allowed=_ONE_KEY)
        names = self.names
        texts = all(isinstance(name, str) and name for name in names)
        if names and (self.drawn or len(names) != len(self.values) or not texts or len(set(names)) != len(names)):
            allowed = "listed values" if self.drawn else f"{len(self.values)} texts, one a value and all different"
            raise InputError("the names do not fit the values", key=f"{where}.names", found=names, allowed=allowed)

    def _checked_values(self) -> tuple[Any, ...]:
        allowed = "a list with at least one value, or Uniform, Normal, Measured"
        values = items(self.values) if not isinstance(self.values, range) else list(self.values)
        if not values:
            raise InputError("no values", key=self.listed, found=self.values, allowed=allowed)
        if len(self.keys) == 1 and all(type(value) is float and math.isfinite(value) for value in values):
            return tuple(values)
        return tuple(self._plain(value, f"{self.listed}[{k}]") for k, value in enumerate(values, 1))

    def _plain(self, value: Any, key: str) -> Any:
        try:
            plain = plain_value(value)
            canonical(plain)
        except InputError as reason:
            raise reason.within(key=key) from reason
        except RecursionError as reason:  # a list in itself
            raise InputError("nested too deep", key=key, allowed="plain data") from reason
        if len(self.keys) > 1 and (not isinstance(plain, list) or len(plain) != len(self.keys)):
            allowed = f"a list of {len(self.keys)}: {', '.join(self.keys)}"
            raise InputError("not one value a key", key=key, found=value, allowed=allowed)
        for own, item in self.at(plain).items():
            if parse(own)[0] == PARAMETERS and not (is_real(item) and abs(item) <= LARGEST):
                raise InputError(f"{own} is no number", key=key, found=item, allowed="a finite number")
        return plain

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """The keys as places."""
        return tuple(map(parse, self.keys))

    @property
    def drawn(self) -> bool:
        """Whether values are drawn rather than listed."""
        return isinstance(self.values, Distribution)

    @property
    def axis(self) -> tuple[Any, ...]:
        """What stands for each listed value in the results; values of several keys are tuples."""
        if self.names or len(self.keys) == 1:
            return self.names or self.values
        return tuple(map(tuple, self.values))

    def at(self, value: Any) -> dict[str, Any]:
        """Return the value of each key for one of the values."""
        return {self.keys[0]: value} if len(self.keys) == 1 else dict(zip(self.keys, value, strict=True))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        values = self.values.to_dict() if self.drawn else {"values": list(self.values)}
        return {"key": list(self.keys), "label": self.label, "names": list(self.names), **values}


def variable_of(entry: Any, where: str, folder: Path) -> Variable:
    """Return the variable of a [[vary]] table; `folder` is where paths in it start."""
    keys = (entry.key,) if isinstance(entry.key, str) else tuple(entry.key)
    try:
        way, values = _values(entry, keys, folder)
        return Variable(keys, values, entry.label or "", entry.names or (), where, f"{where}.{way}")
    except InputError as reason:
        if reason.file is not None or (reason.key or "").startswith(where):
            raise
        raise reason.within(key=where) from reason


def _values(entry: Any, keys: tuple[str, ...], folder: Path) -> tuple[str, Any]:
    """Return in which way the values of a [[vary]] table are given, and the values."""
    if entry.values is not None:
        return "values", entry.values
    if entry.grid is not None:
        if len(keys) > 1:
            raise InputError("a grid is of one key", key="grid", found=", ".join(keys), allowed=_ONE_KEY)
        with placed(key="grid"):
            numbers = grid(getattr(entry.grid, "from"), entry.grid.to, entry.grid.count, entry.grid.spacing)
        return "grid", numbers
    if entry.uniform is not None:
        return "uniform", Uniform(**dict(entry.uniform))
    if entry.normal is not None:
        return "normal", Normal(**dict(entry.normal))
    csv = entry.csv
    path = located(csv.file, folder)
    if csv.column is not None:
        return "csv", Measured.from_csv(path, csv.column, 1.0 if csv.nominal is None else csv.nominal)
    if len(csv.columns) != len(keys):
        raise InputError("not one column a key", key="csv.columns", found=csv.columns, allowed=f"{len(keys)} names")
    rows = read_columns(path, csv.columns, csv.nominals).tolist()
    return "csv", rows if len(keys) > 1 else [row[0] for row in rows]


def shares(sampling: str, count: int, dimensions: int, *, seed: int) -> Array:
    """Return points of the unit cube, (dimensions, count), the same for the same seed.

    "latin hypercube": in each dimension every interval [k / count, (k + 1) / count] has one point, and which ones
    meet is left to chance; numpy alone keeps the draws the same through all versions of scipy. "random": independent.
    """
    rng = np.random.default_rng(seed)
    within = rng.random((dimensions, count))
    if sampling == "random":
        return within
    return (rng.permuted(np.tile(np.arange(count), (dimensions, 1)), axis=1) + within) / count


def grid(start: float, stop: float, count: int, spacing: str = "linear") -> tuple[float, ...]:
    """Return evenly spaced numbers, with both ends exactly as given; for "log" of equal ratios.

    Raises `InputError` that names the key of a grid: from, to, count.
    """
    for key, end in (("from", start), ("to", stop)):
        real(end, key, "a finite number")
    if count > MOST:
        raise InputError("too many numbers", key="count", found=count, allowed=f"at most {MOST}")
    if spacing == "log" and start <= 0:
        raise InputError("a ratio needs numbers > 0", key="from", found=start, allowed="> 0, or linear spacing")
    if count == 1 and start != stop:
        raise InputError("one number cannot be both", key="count", found=f"{start} and {stop}", allowed="from = to")
    if count > 1 and not start < stop:
        raise InputError("empty range", key="to", found=f"{start} to {stop}", allowed="from < to")
    made = (np.geomspace if spacing == "log" else np.linspace)(start, stop, count)
    return (start, *made[1:-1].tolist(), stop)[:count] if count > 1 else (start,)
