"""Files that are there as a whole or not at all, and what is read from them."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from fcdm_opt.errors import InputError, placed

Made = TypeVar("Made")


@contextmanager
def moved(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a name to write to, and move it to the wanted one when all is written; a file that fails is taken away.

    Raises `InputError` where it cannot be written, or would take the place of a device.
    """
    try:
        path = Path(path)
        if path.exists() and not path.is_file():  # a device, say, that a file must not take the place of
            raise InputError("no file, and none is put in its place", file=path, allowed="a file in a folder")
        other = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            yield other
            os.replace(other, path)
        except BaseException:
            with suppress(OSError):
                other.unlink()
            raise
    except (OSError, TypeError, ValueError) as reason:  # a path with a null, say
        if isinstance(reason, InputError):
            raise
        found = getattr(reason, "strerror", None) or str(reason)
        allowed = "a file in a folder"
        raise InputError("the file cannot be written", file=_named(path), found=found, allowed=allowed) from reason


def _named(path: Any) -> str:
    return repr(str(path)) if "\0" in str(path) else str(path)


def write(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file as a whole or not at all; raises as `moved`."""
    with moved(path) as other:
        other.write_text(text, encoding="utf-8", newline="")


def read(path: str | os.PathLike[str], made: Callable[[str], Made]) -> Made:
    """Return what is made of a file's text; raises `InputError` naming the file."""
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except (OSError, TypeError, ValueError) as reason:
        what = getattr(reason, "strerror", None) or str(reason)
        what = "not a text file in UTF-8" if isinstance(reason, UnicodeDecodeError) else what
        raise InputError(f"the file cannot be read: {what}", file=_named(path)) from reason
    with placed(file=Path(path)):
        return made(text)


def of_json(text: str) -> Any:
    """Return what a JSON text holds; raises `InputError`."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as reason:
        raise InputError(f"not JSON: {str(reason)[:100]}") from reason


def to_json(path: str | os.PathLike[str], data: Any) -> None:
    """Write plain data as JSON; raises as `moved`."""
    write(path, json.dumps(data, allow_nan=False))


def to_csv(path: str | os.PathLike[str], rows: Iterable[Iterable[Any]]) -> None:
    """Write rows as CSV, numbers with all their digits; raises as `moved`."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    write(path, text.getvalue())
