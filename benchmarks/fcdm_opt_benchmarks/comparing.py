"""What changed between two runs of the same command.

Rows belong together where all their labels agree. Outcomes and other words are compared as they are; an error has
changed where it is more than `FACTOR` times as large or as small, above rounding; a time where the quartiles of the
two runs lie apart by more than `APART`, after each is divided by how long its run took for the same methods on the
whole: a faster machine is no change of a method.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt_benchmarks.record import BenchRun, Row, table

LABELS = ("task", "axis", "scene", "question", "family", "name", "case", "model", "method", "setting", "x")
WORDS = ("outcome", "verified", "stage")
FACTOR, SAME, ROUNDING = 10.0, 1 + 1e-9, 1e-14
APART = 1.25


@dataclass(frozen=True)
class Change:
    """One difference: in which table and row, of which column, from what to what."""

    table: str
    row: str
    column: str
    old: str
    new: str


@dataclass(frozen=True)
class RunComparison:
    """Two runs: what changed, how much slower the new machine is on the whole, and what cannot be compared."""

    changes: Sequence[Change]
    pace: float
    notes: Sequence[str]

    @property
    def text(self) -> str:
        """In Markdown."""
        lines = [*self.notes, f"Times of the new run over those of the old one, on the whole: {self.pace:.3g}."]
        if not self.changes:
            return "\n\n".join([*lines, "Nothing else changed."])
        rows = [[c.table, c.row, c.column, c.old, c.new] for c in self.changes]
        return "\n\n".join([*lines, table(["table", "row", "column", "old", "new"], rows, left=5)])


def compared(old: BenchRun, new: BenchRun) -> RunComparison:
    """Return what changed from one run to another of the same command.

    Raises
    ------
    InputError
        For runs of different commands.
    """
    if old.command != new.command:
        raise InputError("a run of another command", key="--compare", found=old.command, allowed=new.command)
    notes = [
        f"{name}: {was} then, {now} now."
        for name, was, now in (
            ("machine", old.where, new.where),
            ("form", "quick" if old.quick else "full", "quick" if new.quick else "full"),
            ("seed", old.seed, new.seed),
            *((package, old.versions.get(package), new.versions[package]) for package in new.versions),
        )
        if was != now
    ]
    tables = {name: (_by_label(old.tables.get(name, ())), _by_label(rows)) for name, rows in new.tables.items()}
    parts = new.settings.get("parts")
    if parts is not None:  # what was not measured this time is not gone
        tables = {name: (_measured(before, name, parts), after) for name, (before, after) in tables.items()}
        if (earlier := old.settings.get("parts", parts)) != parts:
            notes.append(f"parts: {earlier} then, {parts} now; only what is in both is compared.")
    pace = _pace(list(tables.values()))
    changes = []
    for name, (before, after) in tables.items():
        for label in before.keys() | after.keys():
            if label not in before or label not in after:
                word = "is new" if label in after else "is gone"
                changes.append(Change(name, label, "row", "" if label in after else "there", word))
            else:
                changes += [
                    Change(name, label, *difference) for difference in _differences(before[label], after[label], pace)
                ]
    return RunComparison(sorted(changes, key=lambda c: (c.table, c.row, c.column)), pace, notes)


def _by_label(rows: Sequence[Row]) -> dict[str, Row]:
    """Return rows by their labels; one without labels, a fault, is told by all that it holds."""
    labels = ({key: row[key] for key in LABELS if row.get(key) is not None} or row for row in rows)
    return {", ".join(map(str, own.values())): row for own, row in zip(labels, rows, strict=True)}


def _measured(rows: Mapping[str, Row], name: str, parts: Sequence[str]) -> dict[str, Row]:
    """Return the rows of a table whose part of the command, the task or the table itself, is among some."""
    home = {"chart": None, "faults": "curve"}.get(name, name)
    return {label: row for label, row in rows.items() if (home or row.get("task")) in parts}


def _pace(tables: Sequence[tuple[Mapping[str, Row], Mapping[str, Row]]]) -> float:
    """Return the median ratio of new to old times."""
    ratios = [
        after[label]["seconds"] / before[label]["seconds"]
        for before, after in tables
        for label in before.keys() & after.keys()
        if (before[label].get("seconds") or 0.0) > 0 and (after[label].get("seconds") or 0.0) > 0
    ]
    return float(np.median(ratios)) if ratios else 1.0


def _differences(old: Row, new: Row, pace: float) -> list[tuple[str, str, str]]:
    """Return (column, old, new) of what changed in a row."""
    found = [(key, str(old.get(key)), str(new.get(key))) for key in WORDS if old.get(key) != new.get(key)]
    found += [
        (key, f"{old[key]:.3g}", f"{new[key]:.3g}")
        for key, factor in (("error", FACTOR), ("amount", SAME))
        if _numbers(old, new, key) and _grew(old[key], new[key], factor)
    ]
    if all(_numbers(old, new, key) for key in ("seconds", "low", "high")) and old["seconds"] > 0:
        slower, faster = new["low"] / pace > APART * old["high"], new["high"] / pace * APART < old["low"]
        if slower or faster:
            ratio = new["seconds"] / pace / old["seconds"]
            found.append(("seconds", f"{old['seconds']:.3g}", f"{new['seconds']:.3g}, {ratio:.2g} times"))
    return found


def _numbers(old: Row, new: Row, key: str) -> bool:
    values: list[Any] = [old.get(key), new.get(key)]
    return all(isinstance(value, int | float) for value in values)


def _grew(old: float, new: float, factor: float) -> bool:
    low, high = sorted((abs(old) + ROUNDING, abs(new) + ROUNDING))
    return high > factor * low
