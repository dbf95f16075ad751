"""What all commands share: options, exit codes, problem files read, refusals, the JSON document."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fcdm_opt.errors import InputError

if TYPE_CHECKING:
    from fcdm_opt.show.album import Album
    from fcdm_opt.tolerance.problem import Problem

SOLVED, NO_MOTION, BAD_INPUT, NOT_VERIFIED = 0, 1, 2, 3
SEVERITY = (SOLVED, NO_MOTION, NOT_VERIFIED, BAD_INPUT)

Files = Annotated[list[Path], typer.Argument(metavar="FILE...", help="Problem files (TOML).", show_default=False)]
AsJson = Annotated[bool, typer.Option("--json", help="Write one JSON document to stdout.")]
Out = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Write pictures (PNG and SVG) there.")]
Quick = Annotated[bool, typer.Option("--quick", help="The short form.")]
Seed = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Of all that is drawn at random.")]
Compare = Annotated[
    Path | None, typer.Option("--compare", metavar="OLD", help="Tell what changed since this earlier results file.")
]
Cases = Annotated[list[str] | None, typer.Option("--case", metavar="NAME", help="Only this case; may be repeated.")]


@dataclass(frozen=True)
class OpenedFile:
    """A problem file as read: its problems, or why there are none."""

    path: Path
    title: str = ""
    note: str = ""
    problems: tuple[Problem, ...] = ()
    error: str | None = None

    @property
    def name(self) -> str:
        """Title, or the file's name where it has none."""
        return self.title or self.path.stem

    def head(self) -> dict[str, Any]:
        """Return what a JSON document says of the file."""
        head = {"file": str(self.path), "title": self.title, "note": self.note}
        return {**head, "error": self.error} if self.error else head


def opened_files(paths: Sequence[Path], wanted: Sequence[str]) -> list[OpenedFile]:
    """Read all files; says on stderr what is wrong with one, and goes on with the others."""
    from fcdm_opt.tolerance.files import ProblemFile

    files = []
    for path in paths:
        try:
            contents = ProblemFile.read(path)
            files.append(OpenedFile(path, contents.title, contents.note, contents.problems(path)))
        except InputError as reason:
            files.append(OpenedFile(path, error=str(reason.within(file=path))))
            say(f"error: {files[-1].error}")
    known = [problem.name for file in files for problem in file.problems]
    for name in wanted:
        if name not in known:
            say(f"error: --case: no such case; found {name!r}; allowed: {', '.join(dict.fromkeys(known)) or 'none'}")
            raise typer.Exit(BAD_INPUT)
    if not wanted:
        return files
    return [
        OpenedFile(file.path, file.title, file.note, tuple(p for p in file.problems if p.name in wanted), file.error)
        for file in files
    ]


def album_in(out: Path | None) -> Album | None:
    """Return where pictures go, None where none are wanted; exits where they cannot."""
    if out is None:
        return None
    from fcdm_opt.show.album import Album

    with refusals():
        return Album(out, say)


@contextmanager
def refusals() -> Iterator[None]:
    """Exit with bad input's code where something refuses its input, after saying why."""
    try:
        yield
    except InputError as reason:
        say(f"error: {reason}")
        raise typer.Exit(BAD_INPUT) from reason


def say(text: str) -> None:
    """Write a line to stderr."""
    typer.echo(text, err=True)


def finish(document: Any, codes: Iterable[int]) -> None:
    """Write the JSON document, if one is wanted, and exit with the most severe code."""
    if document is not None:
        typer.echo(json.dumps(_plain(document), indent=2, allow_nan=False))
    raise typer.Exit(max(codes, key=SEVERITY.index, default=SOLVED))


def _plain(value: Any) -> Any:
    """Return arrays as lists, and None for numbers that JSON does not have."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
