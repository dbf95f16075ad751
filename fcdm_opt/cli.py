"""`fcdm-opt`: parses, calls, prints; no mathematics.

Nothing heavy is imported before it is needed: `--help` loads no numerical library.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryFile
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fcdm_opt.errors import InputError

if TYPE_CHECKING:
    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.measure.record import Run
    from fcdm_opt.show.album import Album
    from fcdm_opt.show.tables import SolvedCase
    from fcdm_opt.tolerance.problem import Problem
    from fcdm_opt.tolerance.ranges.coherent_range import CoherentRange
    from fcdm_opt.tolerance.ranges.contact_times import ContactTimes
    from fcdm_opt.tolerance.solution import Solution

SOLVED, NO_MOTION, BAD_INPUT, NOT_VERIFIED = 0, 1, 2, 3
LISTED = 3  # scenes in which a rival is ahead
SEVERITY = (SOLVED, NO_MOTION, NOT_VERIFIED, BAD_INPUT)

app = typer.Typer(
    name="fcdm-opt",
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Smallest re-positioning of contacting polyhedral parts under size tolerances.",
    epilog="Exit codes: 0 all well, 1 a case without a motion, 2 bad input, 3 a motion that was not verified.",
)
Files = Annotated[list[Path], typer.Argument(metavar="FILE...", help="Problem files (TOML).", show_default=False)]
AsJson = Annotated[bool, typer.Option("--json", help="Write one JSON document to stdout.")]
Out = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Write pictures (PNG and SVG) there.")]
Quick = Annotated[bool, typer.Option("--quick", help="The short form.")]
Seed = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Of all that is drawn at random.")]
Compare = Annotated[
    Path | None, typer.Option("--compare", metavar="OLD", help="Tell what changed since this earlier results file.")
]
Cases = Annotated[list[str] | None, typer.Option("--case", metavar="NAME", help="Only this case; may be repeated.")]


def main() -> None:
    """Entry point of the command `fcdm-opt`."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # names in any script, on terminals of any
            stream.reconfigure(errors="backslashreplace")
    app(prog_name="fcdm-opt")


def _print_version(wanted: bool) -> None:
    if wanted:
        import fcdm_opt

        typer.echo(f"fcdm-opt {fcdm_opt.__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


@app.command("curve")
def curve_command(files: Files, as_json: AsJson = False, out: Out = None, case: Cases = None) -> None:
    """Print the decision curve of each pair of bodies: segments, switching points, status."""
    from fcdm_opt.show.tables import print_curves

    opened = _opened(files, case or ())
    document, codes = [], [BAD_INPUT for file in opened if file.error]
    pictures = _album(out)
    for file in opened:
        found = _distinct_curves(file.problems)
        document.append({**file.head(), "curves": [{"cases": names, **_curve_data(curve)} for curve, names in found]})
        if not as_json and not file.error:
            print_curves(file.path.name, file.title, file.note, found)
        if pictures:
            for number, (curve, _) in enumerate(found, 1):
                suffix = f"-pair{number}" if len(found) > 1 else ""
                pictures.add_curve(f"{file.path.stem}{suffix}", file.name, curve)
    codes += [BAD_INPUT] if pictures and pictures.failed else []
    _finish(document if as_json else None, codes)


@app.command("solve")
def solve_command(
    files: Files,
    certify: Annotated[
        bool, typer.Option("--certify", help="Prove how small a motion can be at all, and have the proof checked.")
    ] = False,
    as_json: AsJson = False,
    out: Out = None,
    case: Cases = None,
) -> None:
    """Find the smallest motion of each case, verify it, and print one table a file."""
    from rich.progress import track

    from fcdm_opt.show.tables import console, print_solutions

    opened = _opened(files, case or ())
    document, codes = [], [BAD_INPUT for file in opened if file.error]
    pictures = _album(out)
    for file in opened:
        rows, cases = [], []
        notes = console(stderr=True)
        for problem in track(
            file.problems, file.path.name, console=notes, transient=True, disable=not notes.is_terminal
        ):
            try:
                row = _solved(problem, certify)
            except InputError as reason:
                error = str(reason.within(file=file.path, key=f"case {problem.name!r}"))
                _say(f"error: {error}")
                codes.append(BAD_INPUT)
                cases.append({"problem": problem.to_dict(), "error": error})
                continue
            rows.append(row)
            cases.append(_case_data(row))
            codes.append(_code(row.solution))
            if pictures:
                pictures.add_solution(file.path.stem, file.name, row.solution)
        document.append({**file.head(), "cases": cases})
        if rows and not as_json:
            print_solutions(file.path.name, file.title, file.note, rows)
    codes += [BAD_INPUT] if pictures and pictures.failed else []
    _finish(document if as_json else None, codes)


@app.command("range")
def range_command(
    files: Files,
    direction: Annotated[
        str | None,
        typer.Option(
            "--direction",
            metavar="NAME=VALUE,...",
            help="Motion that x multiplies, for instance TZ=1,RZ_deg=2; default: the only parameter, or the published "
            "motion.",
        ),
    ] = None,
    as_json: AsJson = False,
    out: Out = None,
    case: Cases = None,
) -> None:
    """Print how far the tracked features stay the contact along a motion, and what ends that on both sides."""
    from fcdm_opt.show.tables import print_ranges

    opened = _opened(files, case or ())
    document, codes = [], [BAD_INPUT for file in opened if file.error]
    pictures = _album(out)
    for file in opened:
        rows: list[tuple[CoherentRange, ContactTimes]] = []
        cases: list[dict[str, Any]] = []
        for problem in file.problems:
            try:
                row = _ranged(problem, direction)
            except InputError as reason:
                error = str(reason.within(file=file.path, key=f"case {problem.name!r}"))
                _say(f"error: {error}")
                codes.append(BAD_INPUT)
                cases.append({"name": problem.name, "error": error})
                continue
            rows.append(row)
            cases.append({"name": problem.name, **row[0].to_dict(), "contact_times": row[1].to_dict()})
            if pictures:
                pictures.add_range(file.path.stem, file.name, row[0])
        document.append({**file.head(), "cases": cases})
        if rows and not as_json:
            print_ranges(file.path.name, file.title, file.note, rows)
    codes += [BAD_INPUT] if pictures and pictures.failed else []
    _finish(document if as_json else None, codes)


@app.command("bench")
def bench_command(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Write results, tables and pictures there.")],
    quick: Quick = False,
    seed: Seed = 1,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="PART", help="contact, curve, motion, growth or models; may be repeated."),
    ] = None,
    compare: Compare = None,
) -> None:
    """Chart speed against accuracy: every method at several settings, against exact references.

    The quick form takes about a minute, the full form about a quarter of an hour.
    """
    from fcdm_opt.measure.chart import bench, results

    with _refusals():
        old = _earlier(compare, "bench", out)
        run = bench.bench(quick=quick, seed=seed, only=only or bench.PARTS, say=_say)
        _recorded(run, old, out, partial(results.write, run))
        typer.echo(results.summary(run, most=LISTED))
    raise typer.Exit(NOT_VERIFIED if bench.wrong(run) else SOLVED)


@app.command("stability")
def stability_command(
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Write results, tables, the map and failing inputs there."),
    ] = None,
    quick: Quick = False,
    seed: Seed = 1,
    replay: Annotated[
        Path | None, typer.Option("--replay", metavar="FILE", help="Show a saved failing input alone, asked again.")
    ] = None,
    compare: Compare = None,
) -> None:
    """Map where each method fails: families of hard cases, every method in a process of its own.

    The quick form takes about two minutes, the full form about twenty.
    """
    from fcdm_opt.measure.stability.failures import replay as asked_again
    from fcdm_opt.measure.stability.grid import grid

    if (out is None) == (replay is None):
        raise typer.BadParameter("either --out DIR for a run, or --replay FILE for one saved input")
    with _refusals():
        if replay is not None:
            again = asked_again(replay)
            typer.echo(again.text)
            raise typer.Exit(SOLVED if again.now.outcome == "right" else NOT_VERIFIED)
        assert out is not None
        old = _earlier(compare, "stability", out)
        found = grid(quick=quick, seed=seed, say=_say)
        _recorded(found.run, old, out, found.write)
    typer.echo(found.text)
    raise typer.Exit(NOT_VERIFIED if found.faults else SOLVED)


def _earlier(path: Path | None, command: str, out: Path) -> Run | None:
    """Return the run that a new one is compared with; what cannot be compared or written is refused beforehand."""
    from fcdm_opt.measure.record import Run

    try:
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=out):
            pass
    except OSError as reason:
        raise InputError(f"cannot be written ({reason.strerror})", key="--out", found=str(out)) from reason
    old = None if path is None else Run.read(path)
    if old is not None and old.command != command:
        raise InputError("a run of another command", key="--compare", found=old.command, allowed=command)
    return old


def _recorded(run: Run, old: Run | None, out: Path, write: Callable[[Path], list[Path]]) -> None:
    """Write what a run found, and what changed since an earlier one."""
    from fcdm_opt.measure.comparing import compared

    try:
        for path in write(out):
            _say(f"wrote {path}")
        if old is not None:
            (out / "changes.md").write_text(compared(old, run).text + "\n", encoding="utf-8")
            typer.echo(compared(old, run).text)
    except OSError as reason:
        raise InputError(f"cannot be written ({reason.strerror})", key="--out", found=str(out)) from reason


# ---------------------------------------------------------------------------------------------------------- input, exit


@dataclass(frozen=True)
class _File:
    """A problem file as read: its problems, or why there are none."""

    path: Path
    title: str = ""
    note: str = ""
    problems: tuple[Problem, ...] = ()
    error: str | None = None

    @property
    def name(self) -> str:
        return self.title or self.path.stem

    def head(self) -> dict[str, Any]:
        head = {"file": str(self.path), "title": self.title, "note": self.note}
        return {**head, "error": self.error} if self.error else head


def _opened(paths: Sequence[Path], wanted: Sequence[str]) -> list[_File]:
    """Read all files; says on stderr what is wrong with one, and goes on with the others."""
    from fcdm_opt.tolerance.files import ProblemFile

    files = []
    for path in paths:
        try:
            contents = ProblemFile.read(path)
            files.append(_File(path, contents.title, contents.note, contents.problems(path)))
        except InputError as reason:
            files.append(_File(path, error=str(reason.within(file=path))))
            _say(f"error: {files[-1].error}")
    known = [problem.name for file in files for problem in file.problems]
    for name in wanted:
        if name not in known:
            _say(f"error: --case: no such case; found {name!r}; allowed: {', '.join(dict.fromkeys(known)) or 'none'}")
            raise typer.Exit(BAD_INPUT)
    if not wanted:
        return files
    return [
        _File(file.path, file.title, file.note, tuple(p for p in file.problems if p.name in wanted), file.error)
        for file in files
    ]


def _album(out: Path | None) -> Album | None:
    """Return where pictures go, None where none are wanted; exits where they cannot."""
    if out is None:
        return None
    from fcdm_opt.show.album import Album

    with _refusals():
        return Album(out, _say)


@contextmanager
def _refusals() -> Iterator[None]:
    """Exit with bad input's code where something refuses its input, after saying why."""
    try:
        yield
    except InputError as reason:
        _say(f"error: {reason}")
        raise typer.Exit(BAD_INPUT) from reason


def _say(text: str) -> None:
    typer.echo(text, err=True)


def _finish(document: list[Any] | None, codes: Iterable[int]) -> None:
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


# -------------------------------------------------------------------------------------------------------------- results


def _solved(problem: Problem, certify: bool) -> SolvedCase:
    """Solve a case, and beside goal "beyond" the assembly question with the same motions."""
    from fcdm_opt.show.tables import SolvedCase
    from fcdm_opt.tolerance.certificate import verify
    from fcdm_opt.tolerance.solver import solve

    solution = solve(problem, certify=certify)
    if solution.evidence is not None:
        start = perf_counter()
        certificate = verify(solution, proof=True)
        seconds = {**solution.seconds, "check": perf_counter() - start}
        solution = solution.with_certificate(certificate, seconds)
    published = None
    if problem.published is not None:
        published = math.hypot(*(w * q for w, q in zip(problem.weights, problem.published, strict=True)))
    touch = None
    if problem.goal == "beyond":
        answer = solve(problem.changed(goal="touch", pair="any", clearance=0.0))
        touch = answer.amount if answer.usable else None
    return SolvedCase(solution, published, touch, certify)


def _ranged(problem: Problem, direction: str | None) -> tuple[CoherentRange, ContactTimes]:
    """Return the coherent range of a case, and when its pair made touches."""
    from fcdm_opt.tolerance.ranges.coherent_range import coherent_range
    from fcdm_opt.tolerance.ranges.contact_times import contact_times

    along: Any = problem.published if direction is None and len(problem.motion.parameters) > 1 else None
    if direction is not None:
        along = _direction(direction)
    return coherent_range(problem, along), contact_times(problem, along)


def _direction(text: str) -> dict[str, float]:
    """Read a direction: NAME=VALUE,..., lengths and radians, degrees where a name ends in _deg."""
    found: dict[str, float] = {}
    for item in text.split(","):
        name, _, value = (part.strip() for part in item.partition("="))
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not name or not math.isfinite(number):
            allowed = "NAME=VALUE,... as TZ=1,RZ_deg=2"
            raise InputError("not a direction", key="--direction", found=item, allowed=allowed)
        short = name.removesuffix("_deg")
        if short in found:
            raise InputError("a parameter is given twice", key="--direction", found=item)
        found[short] = number if short == name else math.radians(number)
    return found


def _code(solution: Solution) -> int:
    if not solution.status.found:
        return NO_MOTION
    return SOLVED if solution.usable else NOT_VERIFIED


def _case_data(case: SolvedCase) -> dict[str, Any]:
    extras = {"published_amount": case.published_amount, "touch_amount": case.touch_amount}
    return {"name": case.solution.problem.name, **case.solution.to_dict(), **extras}


def _distinct_curves(problems: Iterable[Problem]) -> list[tuple[DecisionCurve, list[str]]]:
    """Return the decision curve of each pair of bodies in a box, with the cases that share it."""
    found: dict[Any, tuple[DecisionCurve, list[str]]] = {}
    for problem in problems:
        key = (problem.movable, problem.static, problem.box)
        found.setdefault(key, (problem.curve, []))[1].append(problem.name)
    return list(found.values())


def _curve_data(curve: DecisionCurve) -> dict[str, Any]:
    from fcdm_opt.show.tables import slope

    return {
        "movable": curve.movable.name,
        "static": curve.static.name,
        "box": curve.box,
        "status": curve.status,
        "paths": curve.paths,
        "segments": [
            {
                "index": s.index,
                "feature": s.feature.label,
                "configuration": s.configuration,
                "line": s.line,
                "start": s.start,
                "end": s.end,
                "slope": slope(s),
                "parts": s.parts,
                "snug": s.snug,
            }
            for s in curve.segments
        ],
        "switching_points": [
            {
                "index": p.index,
                "rho": p.rho,
                "kind": p.kind,
                "configurations": list(p.configurations),
                "label": p.label,
                "contacts": p.contacts,
                "contact_sets": list(p.contact_sets),
            }
            for p in curve.switching_points
        ],
    }
