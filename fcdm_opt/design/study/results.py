"""What a study found: read back from its store, as rows, as tables of other libraries, and in a few numbers."""

from __future__ import annotations

import json
import math
import os
import sqlite3
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from fcdm_opt.design.sizes import proportion_interval
from fcdm_opt.design.study.point import Row
from fcdm_opt.design.study.store import FILE, SCHEMA
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.units import number_text
from fcdm_opt.lazy_import import NotebookRepr, extra
from fcdm_opt.moved_files import moved, to_csv
from fcdm_opt.plain import Plain, plain
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

PENDING = "PENDING"  # status of a point that is not worked out yet
CONFIDENCE = 0.95

DRAW = "draw"  # an axis that no key of a problem stands for

PLAIN = ("message", "usable", "amount", "lower_bound")
PAIRS = ("rho", "pair")
LISTS = ("features", "active", "checks_failed")
TABLES = ("modelled", "seconds")
"""Keys of a row by what becomes of them: a column; two columns; a text; a column for each key within."""


class Share(NamedTuple):
    """How many points a motion within the budget was found for."""

    share: float  # of the points that were worked out; failures count as not within
    # Clopper and Pearson's; of a Latin hypercube with one draw less, which is wider than it needs; None of a grid
    interval: tuple[float, float] | None
    within: int  # points, as is `of`
    of: int
    confidence: float
    budget: float

    @property
    def sure_text(self) -> str:
        """How many points of how many, and of points drawn between which shares that of all parts is."""
        ends = "; {:.0%} interval {:.2%} to {:.2%}".format(self.confidence, *self.interval) if self.interval else ""
        return f"{self.within} of {self.of}{ends}"


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyResult(NotebookRepr, Plain):
    """The points of a study in order, with what was found for each of them.

    Attributes
    ----------
    definition : mapping
        As `Study.to_dict` gives it.
    study, version : str
        Key of the study, and the version of fcdm_opt that its rows are from.
    points : tuple of (str or None, mapping)
        Key of its row, and value of each label, for every point of the study. A point that no run has come to yet has
        no key, and None for what is drawn.
    answers : mapping of str to dict
        Row of each key that is worked out, see `point.row`.
    """

    plain_names = ("study", "version", "counts", "seconds", "assembly_yield", "rows")
    plain_kinds: ClassVar[Mapping[str, Any]] = {"rows": tuple[Mapping[str, float | bool | str | None], ...]}

    definition: Mapping[str, Any]
    study: str
    version: str
    points: tuple[tuple[str | None, Mapping[str, Any]], ...]
    answers: Mapping[str, Row]

    @classmethod
    def read(cls, out: str | os.PathLike[str]) -> StudyResult:
        """Return what the store in a folder holds by now; a run may be writing to it meanwhile.

        Parameters
        ----------
        out : path
            Folder of the study.

        Raises
        ------
        InputError
            Where there is no store of a study, or a damaged one.
        """
        path = Path(out) / FILE
        if not path.is_file():
            raise InputError("no study has been run into this folder", file=str(out), allowed=f"a folder with {FILE}")
        try:
            with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as base:
                base.execute("BEGIN")  # one state of the store, whatever is written meanwhile
                meta = dict(base.execute("SELECT name, value FROM meta"))
                if meta["schema"] != str(SCHEMA):
                    allowed = f"{SCHEMA}, that of this version"
                    raise InputError("laid out in another way", file=path, found=meta["schema"], allowed=allowed)
                met = {
                    number: (key, json.loads(values))
                    for number, key, values in base.execute('SELECT number, key, "values" FROM points')
                }
                answers = {key: json.loads(row) for key, row in base.execute("SELECT key, row FROM results")}
            definition = json.loads(meta["definition"])
            labels, axes = definition["labels"], _axes(definition)
            expected = (dict(zip(axes, values, strict=True)) for values in product(*axes.values()))
            points = tuple(
                met.get(number, (None, {label: values.get(label) for label in labels}))
                for number, values in enumerate(expected)
            )
            study, version = meta["study"], meta["version"]
        except InputError:
            raise
        except (sqlite3.Error, LookupError, TypeError, ValueError, AttributeError) as reason:
            raise InputError(f"not a store of a study ({reason})", file=path) from reason
        return cls(definition=definition, study=study, version=version, points=points, answers=answers)

    @cached_property
    def axes(self) -> dict[str, tuple[Any, ...]]:
        """Label -> values, as `Study.axes`; the last one varies fastest in the order of the points."""
        return _axes(self.definition)

    @cached_property
    def counts(self) -> dict[str, int]:
        """Points by status, the most frequent first; "PENDING" for those that are not worked out yet."""
        return dict(Counter(self.answer(key).get("status", PENDING) for key, _ in self.points).most_common())

    @property
    def complete(self) -> bool:
        """Whether every point is worked out."""
        return PENDING not in self.counts

    @cached_property
    def seconds(self) -> dict[str, float]:
        """Working time of all rows: of "build", "solve", "prove", "verify", and "point" for all of it."""
        total: Counter[str] = Counter()
        for row in self.answers.values():
            total.update(row["seconds"])
        return {name: float(value) for name, value in total.items()}

    @property
    def unit(self) -> str:
        """Unit of all lengths and amounts, "" where none is known."""
        return str(self.definition.get("unit", ""))

    @property
    def assembly_yield(self) -> Share | None:
        """Share of the points whose motion stays within the budget; None without a budget, or a point worked out."""
        budget = self.definition.get("budget")
        found = [row for key, _ in self.points if (row := self.answer(key))]
        if budget is None or not found:
            return None
        within = sum(row["usable"] and row["amount"] <= budget * (1.0 + DEFAULT.cut) for row in found)
        independent, drawn = self.definition.get("sampling") != "latin hypercube", DRAW in self.axes
        interval = proportion_interval(within, len(found), CONFIDENCE, independent=independent) if drawn else None
        return Share(within / len(found), interval, within, len(found), CONFIDENCE, budget)

    def __str__(self) -> str:
        counts = ", ".join(f"{count} {status}" for status, count in self.counts.items()) or "none"
        lines = [f"{self.definition.get('title') or 'study'}: {len(self.points)} points: {counts}"]
        amounts = sorted(row["amount"] for key, _ in self.points if (row := self.answer(key)) and row["usable"])
        if amounts:
            middle = amounts[len(amounts) // 2]
            head = f"amount, {self.unit}" if self.unit else "amount"
            lines.append(
                f"{head}: {number_text(amounts[0])} to {number_text(amounts[-1])}, median {number_text(middle)}"
            )
        if found := self.assembly_yield:
            lines.append(f"yield: {found.share:.2%} within {found.budget:g} ({found.sure_text})")
        if self.seconds:
            lines.append("seconds: " + ", ".join(f"{name} {value:.3g}" for name, value in self.seconds.items()))
        return "\n".join(lines)

    def __repr__(self) -> str:
        counts = ", ".join(f"{status}: {count}" for status, count in self.counts.items())
        return f"StudyResult({self.definition.get('title', '')!r}, {counts})"

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as plain data; as JSON has no such numbers, infinity becomes "inf"."""
        known = {name: getattr(self, name) for name in self.plain_names}
        return {**self.definition, **plain({**known, "rows": self.rows()})}

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for every point, in order, all with the same columns.

        Columns: "number"; what varies, one column a key where several vary together, and "draw"; "status", "message",
        "usable", "amount", "lower_bound"; the parameters of the motion by name (length units, radians); "rho_1",
        "rho_2", "pair_1", "pair_2", "pair_gap", "pair_state"; "features", "active", "checks_failed" (joined by "; "),
        "stage"; "modelled.*" and "seconds.*"; "key". What varies and is named as another column (a parameter of the
        motion, say) has " (varied)" added.
        Values are numbers, texts, booleans or None; what is more in a problem (a list of vertices) is JSON text.
        """
        return [dict(zip(self._columns, row, strict=True)) for row in zip(*self._columns.values(), strict=True)]

    def frame(self) -> DataFrame:
        """Return `rows` as a pandas table; numbers that are not there are nan."""
        pandas = extra("pandas", "tables", key="table")
        return pandas.DataFrame({name: _filled(values) for name, values in self._columns.items()})

    def dataset(self) -> Dataset:
        """Return the columns as arrays of an xarray dataset, over the axes of the study.

        Where several keys vary together, their values along the axis are coordinates of their own, and the axis counts
        from 0. Where what is drawn is not known yet, it is nan. Select with `.sel({"tolerance": 0.02})`: as an
        argument, xarray takes that name for its own.
        """
        xarray, pandas = (extra(name, "tables", key="table") for name in ("xarray", "pandas"))
        sizes = {self._names[label][0]: len(values) for label, values in self.axes.items()}
        coordinates: dict[str, Any] = {}
        for label, values in self.axes.items():
            axis, names = self._names[label]
            columns = zip(*values, strict=True) if len(names) > 1 else [values]
            coordinates |= {
                name: (axis, pandas.Series(_filled(_column(own))).to_numpy())
                for name, own in zip(names, columns, strict=True)
            }
            coordinates.setdefault(axis, range(len(values)))
        table = {name: pandas.Series(_filled(values)).to_numpy() for name, values in self._columns.items()}
        arrays = {
            name: (tuple(sizes), values.reshape(tuple(sizes.values())))
            for name, values in table.items()
            if name not in coordinates
        }
        about = {name: self.definition.get(name) or "" for name in ("title", "note")}
        return xarray.Dataset(arrays, coordinates, {**about, "study": self.study, "version": self.version})

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write `rows` as CSV: UTF-8, numbers with all their digits, nothing for None; "(rad)" in the heads of angles.

        Raises
        ------
        InputError
            Where the file cannot be written; then there is none.
        """
        heads = [f"{name} (rad)" if name in self.angles else name for name in self._columns]
        to_csv(path, [heads, *zip(*self._columns.values(), strict=True)])

    def to_parquet(self, path: str | os.PathLike[str]) -> None:
        """Write `frame` as Parquet.

        Raises
        ------
        InputError
            Where the file cannot be written; then there is none.
        """
        extra("pyarrow", "tables", key="table")
        frame = self.frame()
        with moved(path) as other:
            frame.to_parquet(other, engine="pyarrow", index=False)

    @cached_property
    def _names(self) -> dict[str, tuple[str, tuple[str, ...]]]:
        """Label -> name of its axis, and of its columns; each is a name of its own in all tables."""
        taken = {*OWN, *(name for row in self.answers.values() for name in row["parameters"])}
        taken |= {f"{name}.{key}" for row in self.answers.values() for name in TABLES for key in row[name]}

        def free(name: str) -> str:
            while name in taken:
                name += " (varied)"
            taken.add(name)
            return name

        names: dict[str, tuple[str, tuple[str, ...]]] = {}
        varied = _joint_keys(self.definition)
        for label in dict.fromkeys([*self.definition["labels"], *self.axes]):
            keys = varied.get(label, (label,))
            columns = tuple(map(free, keys))
            names[label] = columns[keys.index(label)] if label in keys else free(label), columns
        return names

    @cached_property
    def angles(self) -> set[str]:
        """Columns of parameters that are angles, radians: "RZ", of an assembly "lid.RZ"."""
        names = {name for row in self.answers.values() for name in row["parameters"]}
        return {name for name in names if name.rpartition(".")[2].startswith("R")}

    @cached_property
    def _columns(self) -> dict[str, list[Any]]:
        rows = [self.answer(key) for key, _ in self.points]
        columns: dict[str, Iterable[Any]] = {"number": range(len(self.points))}
        for label, (_, names) in self._names.items():
            given = [values.get(label) for _, values in self.points]
            if label == DRAW:
                given = [number % len(self.axes[DRAW]) for number in range(len(self.points))]
            for k, name in enumerate(names):
                columns[name] = [value and value[k] for value in given] if len(names) > 1 else given
        columns["status"] = [row.get("status", PENDING) for row in rows]
        columns |= {name: [row.get(name) for row in rows] for name in PLAIN}
        columns |= _within(rows, "parameters", "")
        for name in PAIRS:
            columns |= {f"{name}_{k + 1}": [row[name][k] if row.get(name) else None for row in rows] for k in (0, 1)}
        columns |= {name: [row.get(name) for row in rows] for name in ("pair_gap", "pair_state")}
        columns |= {name: ["; ".join(row.get(name, ())) for row in rows] for name in LISTS}
        columns["stage"] = [row.get("stage") for row in rows]
        for name in TABLES:
            columns |= _within(rows, name, f"{name}.")
        columns["key"] = [key for key, _ in self.points]
        return {name: _column(values) for name, values in columns.items()}

    def answer(self, key: str | None) -> Row:
        """Return the row of a point, an empty one where there is none yet."""
        return {} if key is None else self.answers.get(key, {})


def _axes(definition: Mapping[str, Any]) -> dict[str, tuple[Any, ...]]:
    joint = _joint_keys(definition)
    return {
        label: tuple(range(values)) if label == DRAW else tuple(map(tuple, values) if label in joint else values)
        for label, values in definition["axes"].items()
    }


def _joint_keys(definition: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Label -> keys that vary together, except where their values have names: a name is one value."""
    vary = definition["vary"]
    return {own["label"]: tuple(own["key"]) for own in vary if len(own["key"]) > 1 and not own.get("names")}


OWN = {
    "number", "status", *PLAIN, "pair_gap", "pair_state", *LISTS, "stage", "key",
    *(f"{name}_{k}" for name in PAIRS for k in (1, 2)),
}  # fmt: skip
"""Names of columns that are there whatever varies."""

WHOLE = 2**63 - 1  # largest whole number that a column of other libraries holds; larger ones are text


def _within(rows: Sequence[Row], name: str, head: str) -> dict[str, list[Any]]:
    """Return a column for each key within a table of the rows, in the order in which they first appear."""
    names = dict.fromkeys(key for row in rows for key in row.get(name, ()))
    return {head + key: [row.get(name, {}).get(key) for row in rows] for key in names}


def _column(values: Iterable[Any]) -> list[Any]:
    """Return values of one kind: all numbers, all booleans, or all texts; None where there is none."""
    found = list(values)
    kinds = {type(value) for value in found if value is not None}
    large = int in kinds and any(isinstance(value, int) and abs(value) > WHOLE for value in found)
    if (kinds <= {int, float} and not large) or kinds == {bool} or kinds == {str}:
        return found
    return [value if value is None or isinstance(value, str) else json.dumps(value) for value in found]


def _filled(values: list[Any]) -> list[Any]:
    """Return values whose kind a library can tell: nan where there are none at all."""
    return [math.nan] * len(values) if all(value is None for value in values) else values
