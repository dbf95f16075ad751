"""The rows of a study on disk: SQLite in the output folder, written as they come, so that a killed run goes on.

    meta      name, value       schema, version (of fcdm_opt), study (its key), definition (JSON)
    points    number, key, values (JSON)
    results   key, status, usable, amount, row (JSON, see `point.row`)

What is committed survives the death of the process at any moment; a row is written once and never again. The files
beside the store, SQLite's and the lock, are there while a run is, and after one that was killed.
"""

from __future__ import annotations

import fcntl
import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from fcdm_opt.design.study.point import Row
from fcdm_opt.errors import InputError

SCHEMA = 1
FILE, LOCK = "study.sqlite", "study.lock"

EMPTY = "another folder for --out"

PATIENCE = 30.0  # seconds that a write waits for somebody who reads, or copies, the store
TABLES = {
    "meta": "name TEXT PRIMARY KEY, value TEXT NOT NULL",
    "points": 'number INTEGER PRIMARY KEY, key TEXT NOT NULL, "values" TEXT NOT NULL',
    "results": "key TEXT PRIMARY KEY, status TEXT NOT NULL, usable INTEGER NOT NULL, amount REAL, row TEXT NOT NULL",
}

_json = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"), check_circular=False).encode


def _encoded(data: Any) -> str:
    """Return plain data as JSON; "?" stands for what is no text in any encoding, as a file's name may have it."""
    return _json(data).encode(errors="replace").decode()


class Store(AbstractContextManager["Store"]):
    """The rows of a study, open for one run; used in a `with` block, by any thread, one at a time.

    It must belong to, or will where it is new, the study of that key, which stands for its whole definition and what
    that reads, and that version of fcdm_opt. The definition is kept for who reads the results. `InputError` is raised
    for a folder that cannot be written or that another run is using, and a store that is damaged, or of another study
    or version; in later calls where the disk is full.
    """

    def __init__(self, folder: Path, study: str, version: str, definition: Mapping[str, Any]) -> None:
        self.path = folder / FILE
        with _refusals(self.path), ExitStack() as stack:
            folder.mkdir(parents=True, exist_ok=True)
            stack.enter_context(_locked(folder / LOCK))
            self._own = {folder / LOCK: _identity(folder / LOCK)}
            if not self.path.exists():  # what SQLite left beside a store that was taken away would spoil a new one
                for rest in ("-wal", "-shm"):
                    self.path.with_name(FILE + rest).unlink(missing_ok=True)
            self._writing = False
            self._base = sqlite3.connect(self.path, timeout=PATIENCE, isolation_level=None, check_same_thread=False)
            self._own[self.path] = _identity(self.path)
            stack.callback(self._base.close)
            self._prepare(study, version, _encoded(definition))
            stack.callback(self._put_away)
            self._open = stack.pop_all()

    def __exit__(self, *reason: object) -> None:
        self._open.close()

    def has(self, key: str) -> bool:
        """Tell whether there is a row of this key."""
        return self._base.execute("SELECT 1 FROM results WHERE key = ?", (key,)).fetchone() is not None

    def write(self, points: Iterable[tuple[int, str, Mapping[str, Any]]], rows: Iterable[Row]) -> None:
        """Write points that were met, and rows: all of them or, where the process dies, none.

        Points are (number, key of the row, values by label); those that an earlier run has met already change nothing.
        Rows are of keys that have none yet.
        """
        seen = "SELECT 1 FROM points WHERE number = ?"
        met = [
            (number, key, _encoded(values))
            for number, key, values in points
            if self._base.execute(seen, (number,)).fetchone() is None
        ]
        made = [(row["key"], row["status"], row["usable"], row["amount"], _encoded(row)) for row in rows]
        if not (met or made):
            return
        with _refusals(self.path):
            if not self._writing:  # a run with nothing to write leaves the store as it is
                self._base.execute("PRAGMA journal_mode = WAL")
                self._base.execute("PRAGMA synchronous = NORMAL")
                self._writing = True
        with _refusals(self.path), self._base:
            self._base.execute("BEGIN IMMEDIATE")
            self._check_place()
            self._base.executemany("INSERT OR IGNORE INTO points VALUES (?, ?, ?)", met)
            self._base.executemany("INSERT INTO results VALUES (?, ?, ?, ?, ?)", made)

    def _check_place(self) -> None:
        """Refuse to go on where the files were taken away: what is written to them then is lost, or another run's."""
        for path, known in self._own.items():
            if _identity(path) != known:
                raise InputError("taken away while a run was writing to it", file=path, allowed="running it again")

    def _put_away(self) -> None:
        """Leave a store of one file: readers of one that is ready for writers leave files beside it."""
        # not where somebody reads it now, or the files were taken away: then the next run does
        with suppress(InputError, OSError, sqlite3.Error):
            self._check_place()
            self._base.execute("PRAGMA busy_timeout = 0")
            self._base.execute("PRAGMA journal_mode = DELETE")

    def _prepare(self, study: str, version: str, definition: str) -> None:
        """Make the tables, or refuse those that are there if they are not of this study and version."""
        tables = {name for (name,) in self._base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        own = {"schema": str(SCHEMA), "version": version, "study": study, "definition": definition}
        if not tables:
            with self._base:
                self._base.execute("BEGIN IMMEDIATE")
                for name, columns in TABLES.items():
                    self._base.execute(f"CREATE TABLE {name} ({columns})")
                self._base.executemany("INSERT INTO meta VALUES (?, ?)", own.items())
            return
        if not tables.issuperset(TABLES):
            found = ", ".join(sorted(tables))
            raise InputError("not a store of a study", file=self.path, found=f"tables {found}", allowed=EMPTY)
        verdict = self._base.execute("PRAGMA quick_check(1)").fetchone()[0]
        if verdict != "ok":
            raise InputError(f"the store is damaged ({verdict})", file=self.path, allowed=EMPTY)
        meta, title = dict(self._base.execute("SELECT name, value FROM meta")), ""
        with suppress(KeyError, TypeError, ValueError):
            title = json.loads(meta["definition"])["title"]
        for name, what in (
            ("schema", "the store is laid out in another way"),
            ("version", "the store was made by another version of fcdm_opt"),
            ("study", f"the store is of another study{title and f' ({title!r})'}, or this one was changed since"),
        ):
            if meta.get(name) != own[name]:
                allowed = f"{own[name]}; or {EMPTY}"
                raise InputError(what, file=self.path, key=name, found=meta.get(name, "nothing"), allowed=allowed)
        if meta.get("definition") != definition:  # another title, note or budget: of no answer
            self._base.execute("UPDATE meta SET value = ? WHERE name = 'definition'", (definition,))


def _identity(path: Path | int) -> tuple[int, int] | None:
    """Return which file a path, or an open file's number, leads to; None for a missing one."""
    try:
        found = os.stat(path)
    except FileNotFoundError:
        return None
    return found.st_dev, found.st_ino


@contextmanager
def _refusals(path: Path) -> Iterator[None]:
    """Say why a store cannot be read or written, as bad input."""
    try:
        yield
    except sqlite3.IntegrityError:
        raise  # a row written twice: a fault of ours
    except sqlite3.DatabaseError as reason:
        allowed = f"room to write; or {EMPTY}"
        raise InputError(f"the store cannot be used: {reason}", file=path, allowed=allowed) from reason
    except ValueError as reason:
        if isinstance(reason, InputError):
            raise
        raise InputError(f"no path of a folder: {reason}", file=repr(str(path.parent)), key="out") from reason
    except OSError as reason:
        file = reason.filename or path
        allowed = "a folder that can be written"
        raise InputError("the store cannot be used", file=file, found=reason.strerror, allowed=allowed) from reason


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Keep other runs out as long as this process lives; the system lets go of the lock however that ends."""
    with ExitStack() as stack:
        known: tuple[int, int] | None = (0, 0)
        while _identity(path) != known:  # a run that ended just now took it away
            file = stack.enter_context(path.open("a+", encoding="utf-8"))
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as reason:
                file.seek(0)
                holder = file.read().strip()
                what = "another run is writing to this folder"
                found = f"process {holder}" if holder else None
                allowed = "waiting for it to end; or another folder"
                raise InputError(what, file=path.parent, found=found, allowed=allowed) from reason
            known = _identity(file.fileno())
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        try:
            yield
        finally:
            with suppress(OSError):
                if _identity(path) == known:
                    path.unlink()
