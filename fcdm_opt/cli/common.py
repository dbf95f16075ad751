"""What all commands share: options, exit codes, problem files and their cases asked one by one, the JSON document."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from fcdm_opt import pacing
from fcdm_opt.cli.guarding import BAD_INPUT, INTERNAL, NO_MOTION, NOT_VERIFIED, SOLVED, document, manner, refuse, say
from fcdm_opt.cli.registry import ROWS
from fcdm_opt.errors import InputError, known_word
from fcdm_opt.problem import syntax

if TYPE_CHECKING:
    from fcdm_opt.show.album import Album

    Text = Any  # what the check of an option makes of its text
    Texts = Any  # likewise, of an option that may be repeated
else:
    Text, Texts = str | None, list[str] | None
Named = Mapping[str, tuple[str, Sequence[str]]]  # option -> the kind of table whose names it gives, and these
Check = Callable[[str, Any], Any]
"""Takes the name of an option and what was given; returns what the command gets, or refuses it."""

SEVERITY = (SOLVED, NO_MOTION, NOT_VERIFIED, BAD_INPUT, INTERNAL)
FAILURES = {"late": NO_MOTION, "input": BAD_INPUT, "internal": INTERNAL}  # see `pacing.failure`
CHOICE, OUTPUT = "Which cases", "Output"  # headings of groups of options
ENDINGS = {
    ".csv", ".glb", ".htm", ".html", ".jpeg", ".jpg", ".json", ".md", ".obj", ".off", ".parquet", ".pdf", ".ply",
    ".png", ".py", ".sqlite", ".step", ".stl", ".stp", ".svg", ".tex", ".toml", ".tsv", ".txt", ".xls", ".xlsx", ".zip",
}  # fmt: skip
"""Endings that say what kind of file is meant."""
MOST_READ = 2**20  # bytes of a problem file that is read at a press of the tab key, so that none is slow


def problem_files(incomplete: str) -> list[str]:
    """Return the TOML files that a path may go on to; none where folders may be meant, which the shell knows best."""
    try:
        start = Path(incomplete)
        folder, begun = (start, "") if incomplete.endswith("/") else (start.parent, start.name)
        found = [path for path in sorted(folder.iterdir()) if path.name.startswith(begun or "")]
        if any(path.is_dir() and not path.name.startswith(".") for path in found):
            return []
    except (OSError, ValueError):
        return []
    head = incomplete[: len(incomplete) - len(begun)]
    return [head + path.name for path in found if path.suffix == ".toml" and not path.name.startswith(".")]


def case_names(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the cases of the files that are on the line already."""
    begun = ctx.args  # before "--case" has a value
    paths = map(Path, map(str, (*(ctx.params.get("files") or ctx.params.get("sources") or ()), *begun)))
    found = dict.fromkeys(name for path in paths for name in syntax.names(syntax.contents(path, MOST_READ), "case"))
    return [name for name in found if name.startswith(incomplete)]


def option(
    name: str, metavar: str | None, text: str, group: str | None = None, *, check: Check | None = None, **more: Any
) -> Any:
    """Return an option of a command: its name, what its value is called, its help, and the heading it stands under.

    What `check` makes of the name and a value that is given is what the command gets; it looks before any file is read.
    """
    if check is not None:
        more["callback"] = lambda value: None if value is None else check(name, value)
    return typer.Option(name, metavar=metavar, help=text, rich_help_panel=group, **more)


def argument(metavar: str, text: str, **more: Any) -> Any:
    """Return an argument of a command: what it is called, and its help."""
    return typer.Argument(metavar=metavar, help=text, show_default=False, **more)


def written(*endings: str) -> Check:
    """Return the check of an option that names what is written: a file with one of some endings, else a folder.

    A name with the ending of another kind of file is refused.
    """
    allowed = f"a name in {' or '.join(endings)}" if endings else "the name of a folder for several files"
    others = ENDINGS - {*endings}
    what = "no file of this kind is written"
    return checked(what, allowed, lambda path: path.suffix.lower() not in others or path.is_dir())


def checked(what: str, allowed: str, holds: Callable[[Any], bool]) -> Check:
    """Return the check of an option whose values are taken as they are where `holds` is true of them."""

    def check(key: str, value: Any) -> Any:
        if not holds(value):
            raise InputError(what, key=key, found=str(value) if isinstance(value, Path) else value, allowed=allowed)
        return value

    return check


def one_of(*words: str) -> Check:
    """Return the check of an option that is one of some words."""
    return lambda key, word: known_word(word, words, "no such word", key=key)


def names(key: str, text: str) -> list[str]:
    """Return the names of a text with commas between, in quotes where they have some; the check of such options."""
    return [name.strip() for row in csv.reader([text], skipinitialspace=True) for name in row]


def two(what: str) -> Check:
    """Return the check of an option that is two different names of something."""

    def check(key: str, text: str) -> list[str]:
        if len({*(found := names(key, text))}) != 2 or len(found) != 2 or not all(found):
            allowed = f"two different {what} with a comma between"
            raise InputError(f"not two {what}", key=key, found=text, allowed=allowed)
        return found

    return check


LENGTH = checked("unusable number", "a finite length > 0", lambda length: 0.0 < length < math.inf)
SECONDS = checked("unusable number", "a number of seconds > 0", lambda seconds: seconds > 0.0)


@contextmanager
def named(**options: str) -> Iterator[None]:
    """Name options in place of the arguments that they are given to, where these are refused; "": it is not given."""
    try:
        yield
    except InputError as reason:
        head, _, rest = (reason.key or "").partition(".")
        if not options.get(head):
            raise
        key = " ".join(filter(None, (options[head], rest)))
        raise InputError(reason.what, key=key, found=reason.found, allowed=reason.allowed) from reason


Files = Annotated[list[Path], argument("FILE", "Problem files (TOML).", autocompletion=problem_files)]
AsJson = Annotated[bool, option("--json", None, "Write one JSON document to stdout in place of tables.", OUTPUT)]
PICTURES = "Write pictures (PNG and SVG) into this folder."
Out = Annotated[Path | None, option("--out", "DIR", PICTURES, OUTPUT, check=written())]
TABLE = "Write one row a case into this file, for Excel and the like."
TableOut = Annotated[Path | None, option("--table", "CSV", TABLE, OUTPUT, check=written(".csv", ".txt"))]
Dark = Annotated[bool, option("--dark", None, "Pictures light on dark.", OUTPUT)]
Seed = Annotated[int, option("--seed", "N", "Start of everything that is drawn at random, >= 0.", min=0)]
TIME = "Wall time after which all ends, with the best answers and bounds so far."
Time = Annotated[float | None, option("--time", "S", TIME, check=lambda key, own: pacing.begin(own, key=key))]
USUAL = 120.0  # seconds that a command has whose work may have no end
USUAL_TIME = f"{TIME[:-1]}; default: {USUAL:.0f}."
TimeOrUsual = Annotated[
    float | None, option("--time", "S", USUAL_TIME, check=lambda key, own: pacing.begin(own, key=key))
]
CASES = "Take only this case; may be repeated."
Cases = Annotated[list[str] | None, option("--case", "NAME", CASES, CHOICE, autocompletion=case_names)]


@dataclass(frozen=True)
class OpenedFile:
    """A problem file as read: its problems, why there are none or some are not, and by the name of a case its error."""

    path: Path
    title: str = ""
    note: str = ""
    problems: tuple[Any, ...] = ()  # a Problem a case, or an Assembly
    error: str | None = None
    refused: tuple[tuple[str, str], ...] = ()

    @property
    def name(self) -> str:
        """Title, or the file's name where it has none."""
        return self.title or self.path.stem

    def head(self) -> dict[str, Any]:
        """Return what a JSON document says of the file."""
        head = {"file": str(self.path), "title": self.title, "note": self.note}
        return {**head, "error": self.error} if self.error and not self.problems else head


def opened_files(
    paths: Sequence[Path],
    wanted: Sequence[str],
    *,
    assemblies: bool,
    named: Named | None = None,
    first: Callable[[Any], object] | None = None,
    some: bool = False,
) -> list[OpenedFile]:
    """Read all files; says on stderr what is wrong with one, and goes on with the others.

    Files of assemblies are refused unless `assemblies` are known what to do with. Only cases that are wanted are made,
    with `some` the first that can be, or what is about its bodies alone. Raises `InputError` for a wanted case that no
    file has, or what else options name.
    """
    plain = [syntax.contents(path) for path in paths]
    for key, (kind, given) in {"--case": ("case", wanted), **(named or {})}.items():  # before libraries are loaded
        known = list(dict.fromkeys(name for data in plain for name in syntax.names(data, kind)))
        for name in given if known else ():
            known_word(name, known, f"no such {kind}", key=key)
    from fcdm_opt.problem.assembly import Assembly
    from fcdm_opt.problem.assembly_file import AssemblyFile
    from fcdm_opt.problem.keys import ProblemFile
    from fcdm_opt.problem.problem import Problem

    read = list[tuple[Path, Any]]()  # or why it cannot be
    for path, data in zip(paths, plain, strict=True):
        try:
            several = syntax.is_assembly(data)
            if several and not assemblies:
                what = "a file of an assembly, and this command is about two parts"
                takers = ", ".join(name for name, row in ROWS.items() if row.assemblies)
                allowed = f"a problem file; {takers} take assemblies, report where all files are of them"
                raise InputError(what, allowed=allowed)
            read.append((path, AssemblyFile.read(path) if several else ProblemFile.read(path)))
        except InputError as reason:
            read.append((path, _refused(reason, file=path)))
    for _, own in read if first is not None else ():  # before any mesh is read
        if not isinstance(own, str):
            cast("Any", first)(own)
    files = list[OpenedFile]()
    for path, own in read:
        if isinstance(own, str):
            files.append(OpenedFile(path, error=own))
            continue
        try:
            scene, make = (Assembly, own.assemblies) if isinstance(own, AssemblyFile) else (Problem, own.problems)
            make = partial(make, partial(_of_bodies, scene, path) if some else scene)
            given = [case.name for case in own.case[:1]] if some else wanted
            refused = list[tuple[str, InputError]]()
            made = tuple(make(path, wanted=given, refused=refused))
            if refused and not made:
                raise refused[0][1]
            errors = tuple((name, _refused(reason, file=path)) for name, reason in refused)
            error = "; ".join(text for _, text in errors) or None
            files.append(OpenedFile(path, own.title, own.note, made, error, errors))
        except InputError as reason:
            files.append(OpenedFile(path, error=_refused(reason, file=path)))
    return files


BODIES = ("movable", "static", "motion", "parts", "contacts", "motions", "follows", "unit")
"""Arguments of problems and assemblies that tell which bodies there are, and how they move."""


def _of_bodies(kind: Callable[..., Any], file: Path, **asked: Any) -> Any:
    """Return a question about the bodies of a file and their sizes, where these are not refused; says why they are."""
    kept = {key: asked[key] for key in BODIES if key in asked}
    kept |= {"goal": "touch", "target": (1.0, 1.0), "contacts": None} if "movable" in kept else {}
    try:
        return kind(**kept, sizes=asked.get("sizes", ()))
    except InputError as reason:
        found = kind(**kept)
        say(f"this is of all bodies as drawn, the sizes are refused: {reason.within(file=file)}")
        return found


def _refused(reason: InputError, **place: Any) -> str:
    """Say what was refused and where; return what was said."""
    return refuse(reason.within(**place).with_traceback(reason.__traceback__))


class Inquiry:
    """The cases of some files, asked one by one.

    Iterating yields the files that were read. What is answered goes to the JSON document, what is refused to stderr
    too; `finish` writes the document and exits with the most severe code.

    Problem files, the wanted cases (none: all), whether the document is wanted in place of tables, the folder for
    pictures and whether these are light on dark make one; names that options give, `named`, and what `first` refuses
    about the contents of a file are refused before meshes are read. Its `pictures` are an album, made once the files
    were read and only where there is a case to show; `codes` are the exit codes so far.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        cases: Sequence[str] | None,
        *,
        as_json: bool,
        out: Path | None = None,
        dark: bool = False,
        first: Callable[[Any], object] | None = None,
        named: Named | None = None,
        some: bool = False,
    ) -> None:
        row = ROWS.get(manner.get().command)
        several = row is not None and row.assemblies
        self._opened = opened_files(paths, cases or (), assemblies=several, named=named, first=first, some=some)
        self._document: list[dict[str, Any]] = []
        self.as_json = as_json
        self.codes = [BAD_INPUT for file in self._opened if file.error]
        self.pictures: Album | None = None
        self.refused = False  # whether the judge refused what was answered last
        self._written: list[str] = []
        if out is not None and any(file.problems for file in self._opened):
            from fcdm_opt.show.album import Album

            self.pictures = Album(written()("--out", out), self.wrote, dark=dark)

    def __iter__(self) -> Iterator[OpenedFile]:
        """Yield each file that could be read; `say_of` is about the last."""
        for file in self._opened:
            self._document.append(file.head())
            if file.problems or not file.error:
                yield file

    @property
    def count(self) -> int:
        """How many cases there are."""
        return sum(len(file.problems) for file in self._opened)

    def wrote(self, text: str) -> None:
        """Keep a line about a file that was written; all are said after the answers."""
        self._written.append(text)

    def say_of(self, key: str, value: Any) -> Any:
        """Put a value into the document, under a key of the file at hand; return it."""
        self._document[-1][key] = value
        return value

    def print_head(self, file: OpenedFile) -> None:
        """Print what stands above a file's tables; the unit is that of its cases."""
        from fcdm_opt.show.printing import print_head

        print_head(file.path.name, file.title, file.note, unit=next((problem.unit for problem in file.problems), ""))

    def ask(
        self,
        answered: Callable[[OpenedFile, Any, dict[str, Any]], Any],
        print_all: Callable[[Sequence[Any]], None] | None = None,
    ) -> None:
        """Ask about every case of every file; why one has no answer is said, and ends no other; then `finish`.

        `answered` gets file, case and the case's entry in the document; what it returns is printed by `print_all`, a
        file at a time. Without it cases are printed as they are asked. Each gets an equal share of the time left.
        """
        waiting = self.count
        for file in self:
            entries = self.say_of("cases", [{"name": name, "error": error} for name, error in file.refused])
            rows, failed = [], dict[str, tuple[InputError, list[str]]]()
            for problem in file.problems:
                entry: dict[str, Any] = {"name": problem.name, **({"unit": problem.unit} if problem.unit else {})}
                entries.append(entry)
                try:
                    with pacing.working_on(f"case {problem.name}"), pacing.sharing(1.0 / waiting):
                        rows.append(answered(file, problem, entry))
                except Exception as reason:
                    kind, met = pacing.failure(reason)
                    self.codes.append(FAILURES[kind])
                    entry["error"] = str(met.within(file=file.path, key=f"case {problem.name!r}"))
                    failed.setdefault(str(met), (met, []))[1].append(problem.name)
                waiting -= 1
            for met, names in failed.values():  # what is wrong with several cases is said once
                _refused(met, file=file.path, key=f"case{'s' * (len(names) > 1)} {', '.join(map(repr, names))}")
            if rows and print_all is not None and not self.as_json:
                with pacing.telling():
                    self.print_head(file)
                    print_all(rows)
        self.finish()

    def finish(self) -> None:
        """Write the document, if it is wanted, say which files were written, and exit."""
        for line in self._written:
            say(line)
        failed = [BAD_INPUT] if self.pictures is not None and self.pictures.failed else []
        finish({"files": self._document} if self.as_json else None, [*self.codes, *failed])


def code_of(usable: bool, status: str) -> int:
    """Return the exit code of a solution by the name of its status: a motion out of the fit is none."""
    return SOLVED if usable else NOT_VERIFIED if status == "NOT_VERIFIED" else NO_MOTION


def finish(contents: Mapping[str, Any] | None, codes: Iterable[int]) -> None:
    """Write the JSON document, if one is wanted, and exit with the most severe code."""
    if contents is not None:
        typer.echo(document(contents))
    raise typer.Exit(max(codes, key=SEVERITY.index, default=SOLVED))
