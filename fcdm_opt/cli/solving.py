"""`curve`, `solve`, `range`, `report`: questions about the cases of problem files, and one HTML file of answers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

from fcdm_opt import pacing
from fcdm_opt.cli import common
from fcdm_opt.cli.common import FAILURES, Inquiry, OpenedFile, argument, code_of, option
from fcdm_opt.cli.guarding import BAD_INPUT, INTERRUPTED, ending, refuse, say
from fcdm_opt.errors import InputError, name_list
from fcdm_opt.problem import syntax

if TYPE_CHECKING:
    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.problem.solution import Bounded, Effort
    from fcdm_opt.show.solved import SolvedCase

DIRECTION = (
    "Motion that x multiplies, as TZ=1,RZ_deg=2. Default: the only parameter, else the published motion, else the "
    "motion that solves the case."
)
CERTIFY = "Prove to 1e-4 how small a motion can be at all, and have the proof checked."
PROVING = "Wall time of a case's proof; default: a number of looks."
QUICK = "quick: the first motion that the stages find, without proof."


def _direction(key: str, text: str) -> dict[str, float]:
    """Read a direction: NAME=VALUE,..., lengths and radians, degrees where a name ends in _deg."""
    found: dict[str, float] = {}
    for item in common.names(key, text):
        name, _, value = (part.strip() for part in item.partition("="))
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not name or not math.isfinite(number):
            raise InputError("not a direction", key=key, found=item, allowed="NAME=VALUE,... as TZ=1,RZ_deg=2")
        short = name.removesuffix("_deg")
        if short in found:
            raise InputError("a parameter is given twice", key=key, found=item)
        found[short] = number if short == name else math.radians(number)
    return found


def curve_command(
    files: common.Files,
    time: common.Time = None,
    as_json: common.AsJson = False,
    out: common.Out = None,
    dark: common.Dark = False,
    case: common.Cases = None,
) -> None:
    """Print the decision curve of each pair of bodies: segments, switching points, status."""
    inquiry = Inquiry(files, case, as_json=as_json, out=out, dark=dark)  # refuses words before libraries are loaded
    from fcdm_opt.show.tables import print_curves

    for file in inquiry:
        found: dict[DecisionCurve, list[str]] = {}  # the same one for the same bodies and box
        for problem in file.problems:
            found.setdefault(problem.curve, []).append(problem.name)
        unit = next((problem.unit for problem in file.problems), "")  # a file has one
        made = {problem.curve: bool(problem.made) for problem in file.problems}
        shared = {"unit": unit} if unit else {}
        inquiry.say_of("curves", [{"cases": names, **shared, **curve.to_dict()} for curve, names in found.items()])
        if found and not as_json:
            inquiry.print_head(file)
            print_curves(found)
        if inquiry.pictures:
            for number, curve in enumerate(found, 1):
                suffix = f"-pair{number}" if len(found) > 1 else ""
                inquiry.pictures.add_curve(f"{file.path.stem}{suffix}", file.name, curve, unit=unit, made=made[curve])
    inquiry.finish()


def solve_command(
    files: common.Files,
    certify: Annotated[bool, option("--certify", None, CERTIFY)] = False,
    effort: Annotated[
        str, option("--effort", "proved|quick", QUICK, check=common.one_of("proved", "quick"))
    ] = "proved",
    seconds: Annotated[float | None, option("--seconds", "S", PROVING, check=common.SECONDS)] = None,
    time: common.Time = None,
    table: common.TableOut = None,
    as_json: common.AsJson = False,
    out: common.Out = None,
    dark: common.Dark = False,
    case: common.Cases = None,
) -> None:
    """Find the smallest motion of each case, verify it, and print one table a file.

    Of a file of an assembly the smallest motions of all its parts together.
    """
    inquiry = Inquiry(files, case, as_json=as_json, out=out, dark=dark)
    from fcdm_opt.design.cases import write_cases
    from fcdm_opt.show.assemblies import print_answers
    from fcdm_opt.show.solved import solved_case

    answers: list[tuple[str, Bounded]] = []

    def answered(file: OpenedFile, problem: Any, entry: dict[str, Any]) -> SolvedCase:
        row = solved_case(problem, certify=certify, effort=cast("Effort", effort), seconds=seconds)
        entry |= {"name": problem.name, **row.solution.to_dict(), **row.extras}
        inquiry.codes.append(code_of(row.solution.usable, row.solution.status.name))
        answers.append((problem.name if len(files) == 1 else f"{file.path.stem}: {problem.name}", row.solution))
        if table is not None:
            write_cases(table, answers)
            if len(answers) == 1:
                inquiry.wrote(f"wrote {table}")
        if inquiry.pictures:
            with pacing.telling():
                inquiry.pictures.add_solution(file.path.stem, file.name, row.solution)
        return row

    inquiry.ask(answered, print_answers)


def range_command(
    files: common.Files,
    direction: Annotated[common.Text, option("--direction", "NAME=VALUE,...", DIRECTION, check=_direction)] = None,
    time: common.Time = None,
    as_json: common.AsJson = False,
    out: common.Out = None,
    dark: common.Dark = False,
    case: common.Cases = None,
) -> None:
    """Print how far the tracked features stay the contact along a motion, and what ends that on both sides.

    Parts drawn with play, or overlapping, have no such contact: along which motions the parts made touch is told alone,
    also of two parts of an assembly.
    Of a file of an assembly it is told of each contact whose parts move against each other; parameters are
    "part.parameter".
    """
    inquiry = Inquiry(files, case, as_json=as_json, out=out, dark=dark)
    from fcdm_opt.along.coherent_range import AssemblyRange, coherent_range, has_contact, moved_contacts
    from fcdm_opt.along.contact_times import contact_times
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.show.plots import family_figure
    from fcdm_opt.show.tables import print_ranges

    def answered(file: OpenedFile, problem: Any, entry: dict[str, Any]) -> list[tuple[Any, Any]]:
        along = _default_direction(file, problem) if direction is None else direction
        asked = {"": problem} if isinstance(problem, Problem) else moved_contacts(problem, along)
        opened = {name: own for name, own in asked.items() if not has_contact(own)}
        touching = [(None, contact_times(own, along)) for own in opened.values()]
        if opened and len(opened) == len(asked):
            times = contact_times(problem, along)
            entry |= {"contact_times": times.to_dict()}
            if inquiry.pictures:
                say(f"no picture of case {problem.name!r}: parts apart, or overlapping, have no contact to follow")
            if isinstance(problem, Problem):
                return [(None, times)]
            return [(AssemblyRange(problem, times.to_dict()["direction"], {}, (*opened,)), times), *touching]
        found: Any = coherent_range(problem, along)
        try:
            shared: Any = contact_times(problem, along)
            data = shared.to_dict()
        except InputError as reason:  # keep-outs that it cannot count: the tracked contact is told all the same
            shared = f"not told: {reason}"
            data = {"error": shared}
        entry |= {**found.to_dict(), "contact_times": data}
        each = [*found.contacts.values()] if isinstance(found, AssemblyRange) else [found]
        if inquiry.pictures:
            for own in each:
                figure = family_figure(own, title=f"{file.name}: case {own.problem.name}, coherent range")
                inquiry.pictures.add(f"{file.path.stem}-{own.problem.name}", figure, ending="-range")
        return [(found, shared), *touching]

    inquiry.ask(answered, lambda rows: print_ranges([pair for each in rows for pair in each]))


def _default_direction(file: OpenedFile, problem: Any) -> Any:
    """Return the direction of a range where none is asked for; None for a motion of one parameter."""
    motion = next(iter(problem.relations.values())).motion
    if len(motion.parameters) == 1:
        return None
    if any(published := getattr(problem, "published", None) or ()):
        return published
    from fcdm_opt.solver import solve

    solution = solve(problem)
    if not solution.status.found or not solution.amount > 0:
        advice = "the case is solved without any motion" if solution.status.found else solution.advice
        what = f"no direction is given, and none follows from a motion that solves the case: {advice}"
        names = ",".join(f"{name}{'_deg' * (kind == 'rotation')}=1" for name, kind in motion.parameters)
        raise InputError(what, key="--direction", found="none", allowed=f"NAME=VALUE,... as {names}")
    along = motion.describe(list(solution.coordinates.values()), unit=problem.unit)
    say(f"note: {file.path}: case {problem.name!r}: no --direction given; along the motion found, {along}")
    return solution.coordinates


STUDY = "study.sqlite"  # what makes a folder that of a study
MEGABYTE = 1e6
GATHERED = 0.9  # share of the time left for what the page shows; the rest is for making it

FILES = "Problem files (TOML), files of assemblies, folders of them, or the folder that a study was run into."


def report_command(
    sources: Annotated[list[Path], argument("FILE|DIR", FILES, autocompletion=common.problem_files)],
    out: Annotated[Path, option("--out", "HTML", "The file to write.")] = Path("report.html"),
    certify: Annotated[bool, option("--certify/--no-certify", None, "Prove how small a motion can be at all.")] = True,
    time: common.Time = None,
    case: common.Cases = None,
) -> None:
    """Write problems or assemblies and their solutions, or a study, as one HTML file; it needs no network."""
    from fcdm_opt.moved_files import write

    if out.suffix.lower() not in (".html", ".htm"):
        raise InputError("not the name of a report", key="--out", found=str(out), allowed="a name in .html")
    if any((source / STUDY).is_file() for source in sources):
        text, codes = _study(sources, case or ()), list[int]()
    else:
        paths = list(_files(sources))
        asked = _assemblies if paths and all(syntax.is_assembly(syntax.contents(path)) for path in paths) else _problems
        text, codes = asked(paths, certify, case or ())
    if text:
        with suppress(OSError):  # what is wrong with it is said when the file is written
            out.parent.mkdir(parents=True, exist_ok=True)
        write(out, text)
        say(f"wrote {out} ({len(text.encode()) / MEGABYTE:.1f} MB)")
    if INTERRUPTED in codes:  # the page says which cases are missing
        raise KeyboardInterrupt
    common.finish(None, codes)


def _files(sources: Iterable[Path]) -> Iterator[Path]:
    """Yield problem files, those of a folder by name."""
    for source in sources:
        if not source.is_dir():
            yield source
            continue
        found = sorted(source.glob("*.toml"))
        if not found:
            raise InputError("nothing to report on", file=source, allowed=f"a folder with problem files or {STUDY}")
        yield from found


def _problems(paths: Sequence[Path], certify: bool, cases: Sequence[str]) -> tuple[str, list[int]]:
    """Return the report on problem files, nothing where none could be read, and the exit code of each file and case."""
    opened = common.opened_files(paths, cases, assemblies=False)
    from fcdm_opt.show.rendering import plotly
    from fcdm_opt.show.report.gather import gather
    from fcdm_opt.show.report.page import page

    plotly()  # what is missing is said before anything is solved
    if not any(file.problems for file in opened):
        return "", [BAD_INPUT]
    with pacing.sharing(GATHERED):
        payload = gather(opened, certify=certify, say=say, refuse=refuse)
    codes = _codes(payload["files"], interrupted=payload["interrupted"])
    return page(payload), codes + [code_of(case["usable"], case["status"]) for case in payload["cases"]]


def _codes(files: Sequence[Mapping[str, Any]], *, interrupted: bool) -> list[int]:
    """Return the exit codes of what is missing; after an interrupt there is time for the page."""
    if interrupted:
        ending.set()
    failures = [FAILURES[kind] for file in files for kind in file.get("failures", ())]
    return [*failures, *[INTERRUPTED] * interrupted]


def _assemblies(paths: Sequence[Path], certify: bool, cases: Sequence[str]) -> tuple[str, list[int]]:
    """Return the same of files of assemblies."""
    opened = common.opened_files(paths, cases, assemblies=True)
    from fcdm_opt.show.report.gather import answered_in_turn
    from fcdm_opt.show.report.page import assembly_page, assembly_report
    from fcdm_opt.show.solved import solved_case

    asked = [assembly for file in opened for assembly in file.problems]

    def answer(number: int) -> dict[str, Any]:
        return assembly_report(solved_case(asked[number], certify=certify).solution, f"case-{number}")

    heads, _, found, interrupted = answered_in_turn(opened, answer, say, refuse)
    codes = _codes(heads, interrupted=interrupted) + [code_of(case["usable"], case["status"]) for case in found]
    return assembly_page(heads, found) if found else "", codes


def _study(sources: Sequence[Path], cases: Sequence[str]) -> str:
    from fcdm_opt.design.study.results import StudyResult
    from fcdm_opt.show.report.page import study_page

    if len(sources) > 1:
        found = ", ".join(map(str, sources))
        raise InputError("a study is reported on alone", key="FILE|DIR", found=found, allowed="one folder of a study")
    if cases:
        raise InputError("cases belong to problem files", key="--case", found=name_list(cases), allowed="no --case")
    return study_page(StudyResult.read(sources[0]))
