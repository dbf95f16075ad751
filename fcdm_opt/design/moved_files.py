"""Files that are there as a whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fcdm_opt.errors import InputError


@contextmanager
def moved(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a name to write to, and move it to the wanted one when all is written; a file that fails is taken away.

    Raises
    ------
    InputError
        Where it cannot be written, or would take the place of a device.
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
        raise InputError(
            "the file cannot be written",
            file=repr(str(path)) if "\0" in str(path) else str(path),
            found=found,
            allowed="a file in a folder",
        ) from reason


def write(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file as a whole or not at all; raises as `moved`."""
    with moved(path) as other:
        other.write_text(text, encoding="utf-8", newline="")
