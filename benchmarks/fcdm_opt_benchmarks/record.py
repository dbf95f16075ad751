"""A run of measurements as a file, and how two of them differ.

The file is one JSON object:

    schema      1; a reader refuses others
    command     "bench" or "stability"
    quick       whether it was the short form
    seed        of everything drawn at random
    settings    what else fixes the run: rounds, limits, numbers of questions
    started     date and time, UTC, ISO 8601
    seconds     that the run took
    machine     processor, cores, system
    versions    of Python and of the packages that take part
    load        see `Load`
    tables      name -> list of rows; a row is an object with the table's columns, null where nothing was measured

The columns of each table are described where its rows are made: `bench`, `growth`, `models` and `stability.grid`.
"""

from __future__ import annotations

import json
import os
import platform
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import psutil

from fcdm_opt.errors import InputError
from fcdm_opt.plain import finite

SCHEMA = 1
PACKAGES = ("fcdm_opt", "numpy", "numba", "scipy", "casadi", "coal", "highspy", "cvxpy", "clarabel", "python-flint",
            "trimesh", "coacd", "manifold3d", "drake", "pyscipopt", "mujoco", "codac")  # fmt: skip
NUMBERS = ("seconds", "low", "high", "error", "amount")
"""Columns that runs are compared by."""

Row = dict[str, Any]
DISTURBED = 0.1
"""Share of the machine that other programs may take before a run says so."""


@dataclass(frozen=True)
class Load:
    """What else the machine did during a run.

    Attributes
    ----------
    others : float or None
        Share of all cores' time that other programs took, 0 to 1; None where the system does not tell.
    average : float or None
        Load average of the last minute at the start.
    yardstick : float
        Slowest over fastest time of one and the same piece of work, repeated all through the run: 1 on a machine that
        does not drift. 0: not measured.
    """

    others: float | None
    average: float | None
    yardstick: float = 0.0

    @property
    def sentence(self) -> str:
        """Say it."""
        said = []
        if self.others is not None:
            word = "Other programs took" if self.others > DISTURBED else "Undisturbed: other programs took"
            said.append(f"{word} {100 * self.others:.0f} % of the machine")
        elif self.average is not None:
            said.append(f"Load average at the start {self.average:.2g}")
        if self.yardstick:
            said.append(f"the same piece of work took up to {self.yardstick:.2g} times its least time")
        return ("; ".join(said) or "Load is not known on this system") + "."


class Watch:
    """Tells what other programs do from when it is made."""

    def __init__(self) -> None:
        self._average = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
        self._before = self._times()

    def load(self, yardstick: Sequence[float] = ()) -> Load:
        """Return the load since the start.

        Parameters
        ----------
        yardstick : sequence of float
            Times of one and the same work in the course of the run.
        """
        drift = max(yardstick) / min(yardstick) if yardstick else 0.0
        now = self._times()
        if now is None or self._before is None:
            return Load(None, self._average, drift)
        busy, total, own = (after - before for after, before in zip(now, self._before, strict=True))
        others = min(1.0, max(0.0, (busy - own) / total)) if total > 0 else 0.0
        return Load(others, self._average, drift)

    @staticmethod
    def _times() -> tuple[float, float, float] | None:
        """Return seconds that all cores were busy, that they had, and that this process and its children used."""
        try:
            cores = psutil.cpu_times()
        except OSError:
            return None
        own, idle = os.times(), cores.idle + getattr(cores, "iowait", 0.0)  # waiting for a disk is idle too
        total = sum(cores) - getattr(cores, "guest", 0.0) - getattr(cores, "guest_nice", 0.0)  # within the others
        return total - idle, total, own.user + own.system + own.children_user + own.children_system


@dataclass(frozen=True)
class BenchRun:
    """A run and everything that it recorded; see the module for the file."""

    command: str
    quick: bool
    seed: int
    settings: Mapping[str, Any]
    started: str
    seconds: float
    load: Load
    tables: Mapping[str, Sequence[Row]]
    machine: Mapping[str, Any] = field(default_factory=lambda: machine())
    versions: Mapping[str, str] = field(default_factory=lambda: versions())

    def write(self, path: Path) -> None:
        """Write the file; numbers that JSON does not have become null."""
        path.parent.mkdir(parents=True, exist_ok=True)
        text = json.dumps(finite({"schema": SCHEMA, **asdict(self)}), indent=1, allow_nan=False)
        path.write_text(text + "\n", encoding="utf-8")

    @classmethod
    def read(cls, path: Path) -> BenchRun:
        """Read a file that `write` wrote.

        Raises
        ------
        InputError
            For a file that is none, naming what is wrong.
        """
        data = json_of(path)
        if not isinstance(data, dict) or data.get("schema") != SCHEMA:
            found = data.get("schema") if isinstance(data, dict) else type(data).__name__
            raise InputError(
                "not a run of measurements of this version", file=path, key="schema", found=found, allowed=str(SCHEMA)
            )
        kinds: dict[str, Any] = {"command": str, "quick": bool, "seed": int, "settings": dict, "started": str,
                                 "seconds": (int, float), "load": dict, "tables": dict, "machine": dict,
                                 "versions": dict}  # fmt: skip
        for key, kind in kinds.items():
            if not isinstance(data.get(key), kind):
                raise InputError("missing, or of a wrong kind", file=path, key=key, found=data.get(key))
        for name, rows in data["tables"].items():
            if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
                raise InputError("not a list of rows", file=path, key=f"tables.{name}")
            for row, column in ((row, column) for row in rows for column in NUMBERS):
                if not _measurable(row.get(column)):
                    raise InputError(
                        "not a number", file=path, key=f"tables.{name}.{column}", found=row[column],
                        allowed="a finite number, or null",
                    )  # fmt: skip
        try:
            load = Load(**data["load"])
        except TypeError as reason:
            raise InputError("not what a run records", file=path, key="load", found=data["load"]) from reason
        return cls(load=load, **{key: data[key] for key in kinds if key != "load"})

    @property
    def about(self) -> str:
        """Date, machine, versions, seed and load, in sentences."""
        packages = ", ".join(f"{name} {number}" for name, number in self.versions.items())
        form = "quick form" if self.quick else "full form"
        took = (
            f"{self.command}, {form}, seed {self.seed}, {self.started[:16].replace('T', ' ')} UTC, {self.seconds:.0f} s"
        )
        return f"{took}. {self.where}; {packages}. {self.load.sentence}"

    @property
    def caption(self) -> str:
        """Date, form, seed and machine, for a picture."""
        return f"{self.started[:10]}, {'quick' if self.quick else 'full'} form, seed {self.seed}, {self.where}."

    @property
    def where(self) -> str:
        """The machine in a few words."""
        return f"{self.machine.get('processor')}, {self.machine.get('cores')} cores, {self.machine.get('system')}"


def json_of(path: Path) -> Any:
    """Return what a JSON file holds.

    Raises
    ------
    InputError
        For a file that cannot be read, or is no JSON; for one nested deeper, or with more digits, than Python takes.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as reason:
        raise InputError("cannot be read", file=path, found=reason.strerror) from reason
    except (ValueError, RecursionError) as reason:  # among them: no Unicode, no JSON, no path
        raise InputError(f"not JSON: {reason}", file=path) from reason


def machine() -> Row:
    """Return processor, number of cores and system."""
    model = platform.processor() or platform.machine()
    if sys.platform == "linux":
        with suppress(OSError):  # not every container shows it
            lines = Path("/proc/cpuinfo").read_text().splitlines()
            model = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), model)
    return {"processor": model, "cores": os.cpu_count(), "system": platform.system()}


def versions() -> dict[str, str]:
    """Return versions of what takes part."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def table(head: Sequence[str], rows: Sequence[Sequence[str]], *, left: int | None = 1) -> str:
    """Return a Markdown table, all columns but the first `left` to the right; none where it is None."""
    left = len(head) if left is None else left
    lines = [head, [*["---"] * left, *["---:"] * (len(head) - left)], *rows]
    cells = ([cell.replace("|", r"\|") for cell in line] for line in lines)
    return "\n".join(f"| {' | '.join(own)} |" for own in cells)


def _measurable(value: Any) -> bool:
    """Tell whether a value is a finite number that fits in a double, or None."""
    if value is None:
        return True
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max
