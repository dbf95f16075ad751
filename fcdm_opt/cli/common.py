"""What all commands share: options, exit codes, problem files and their cases asked one by one, the JSON document."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fcdm_opt.cli.completing import case_names, problem_files
from fcdm_opt.cli.guarding import BAD_INPUT, NO_MOTION, NOT_VERIFIED, SOLVED, refuse, say
from fcdm_opt.errors import InputError
from fcdm_opt.show.plain import plain

if TYPE_CHECKING:
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.show.album import Album

__all__ = ["BAD_INPUT", "NOT_VERIFIED", "NO_MOTION", "SOLVED", "say"]

SEVERITY = (SOLVED, NO_MOTION, NOT_VERIFIED, BAD_INPUT)
CHOICE, OUTPUT = "Which cases", "Output"  # headings of groups of options

Files = Annotated[
    list[Path],
    typer.Argument(metavar="FILE", help="Problem files (TOML).", show_default=False, autocompletion=problem_files),
]
AsJson = Annotated[
    bool,
    typer.Option("--json", help="Write one JSON document to stdout in place of tables.", rich_help_panel=OUTPUT),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Write pictures (PNG and SVG) there.", rich_help_panel=OUTPUT),
]
Seed = Annotated[
    int, typer.Option("--seed", metavar="N", min=0, help="Start of everything that is drawn at random, >= 0.")
]
Cases = Annotated[
    list[str] | None,
    typer.Option(
        "--case",
        metavar="NAME",
        help="Take only this case; may be repeated.",
        rich_help_panel=CHOICE,
        autocompletion=case_names,
    ),
]


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
    """Read all files; says on stderr what is wrong with one, and goes on with the others.

    Raises
    ------
    InputError
        For a wanted case that no file has.
    """
    from fcdm_opt.problem.keys import ProblemFile
    from fcdm_opt.problem.problem import Problem

    files = []
    for path in paths:
        try:
            contents = ProblemFile.read(path)
            files.append(OpenedFile(path, contents.title, contents.note, contents.problems(Problem, path)))
        except InputError as reason:
            files.append(OpenedFile(path, error=_refused(reason, file=path)))
    known = list(dict.fromkeys(problem.name for file in files for problem in file.problems))
    for name in wanted:
        if name in known:
            continue
        if not known and any(file.error for file in files):
            break  # what was said is what is wrong
        raise InputError("no such case", key="--case", found=name, allowed=", ".join(known) or "none is there")
    if not wanted:
        return files
    return [
        OpenedFile(file.path, file.title, file.note, tuple(p for p in file.problems if p.name in wanted), file.error)
        for file in files
    ]


def _refused(reason: InputError, **place: Any) -> str:
    """Say what was refused and where; return what was said."""
    return refuse(reason.within(**place).with_traceback(reason.__traceback__))


class Inquiry:
    """The cases of some files, asked one by one.

    Iterating yields the files that were read. What is answered goes to the JSON document, what is refused to stderr
    too; `finish` writes the document and exits with the most severe code.

    Parameters
    ----------
    paths : paths
        Problem files.
    cases : names, optional
        The cases that are wanted; default all.
    as_json : bool
        Whether the document is wanted, in place of tables.
    out : Path, optional
        Folder for pictures.

    Attributes
    ----------
    pictures : Album or None
        Made once the files were read, and only where there is a case to show.
    codes : list of int
        Exit codes of what was found.
    """

    def __init__(
        self, paths: Sequence[Path], cases: Sequence[str] | None, *, as_json: bool, out: Path | None = None
    ) -> None:
        self._opened = opened_files(paths, cases or ())
        self._document: list[dict[str, Any]] = []
        self.as_json = as_json
        self.codes = [BAD_INPUT for file in self._opened if file.error]
        wanted = out is not None and any(file.problems for file in self._opened)
        self.pictures = album_in(out) if wanted else None

    def __iter__(self) -> Iterator[OpenedFile]:
        """Yield each file that could be read; `say_of` is about the last."""
        for file in self._opened:
            self._document.append(file.head())
            if not file.error:
                yield file

    def say_of(self, key: str, value: Any) -> None:
        """Put a value into the document, under a key of the file at hand."""
        self._document[-1][key] = value

    @contextmanager
    def case(self, file: OpenedFile, problem: Problem) -> Iterator[dict[str, Any]]:
        """Give the entry of a case in the document; bad input met meanwhile is said, and ends nothing else."""
        entry: dict[str, Any] = {"name": problem.name, **({"unit": problem.unit} if problem.unit else {})}
        self._document[-1].setdefault("cases", []).append(entry)
        try:
            yield entry
        except InputError as reason:
            entry["error"] = _refused(reason, file=file.path, key=f"case {problem.name!r}")
            self.codes.append(BAD_INPUT)

    def finish(self) -> None:
        """Write the document, if it is wanted, and exit."""
        failed = [BAD_INPUT] if self.pictures is not None and self.pictures.failed else []
        finish(self._document if self.as_json else None, [*self.codes, *failed])


def code_of(usable: bool, status: str) -> int:
    """Return the exit code of a solution by the name of its status: a motion out of the fit is none."""
    return SOLVED if usable else NOT_VERIFIED if status == "NOT_VERIFIED" else NO_MOTION


def album_in(out: Path | None) -> Album | None:
    """Return where pictures go, None where none are wanted; raises `InputError` where they cannot."""
    if out is None:
        return None
    from fcdm_opt.show.album import Album

    return Album(out, say)


def finish(document: Any, codes: Iterable[int]) -> None:
    """Write the JSON document, if one is wanted, and exit with the most severe code."""
    if document is not None:
        typer.echo(json.dumps(plain(document), indent=2, allow_nan=False))
    raise typer.Exit(max(codes, key=SEVERITY.index, default=SOLVED))
