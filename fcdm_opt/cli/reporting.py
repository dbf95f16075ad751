"""`report`: one HTML file to look at, to turn, to print and to pass on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from fcdm_opt import pacing
from fcdm_opt.cli.common import Cases, Time, argument, code_of, finish, opened_files, option, problem_files
from fcdm_opt.cli.guarding import BAD_INPUT, INTERRUPTED, NO_MOTION, ending, say
from fcdm_opt.errors import InputError, name_list
from fcdm_opt.problem import syntax

STUDY = "study.sqlite"  # what makes a folder that of a study
MEGABYTE = 1e6
GATHERED = 0.9  # share of the time left for what the page shows; the rest is for making it

FILES = "Problem files (TOML), files of assemblies, folders of them, or the folder that a study was run into."


def report_command(
    sources: Annotated[list[Path], argument("FILE|DIR", FILES, autocompletion=problem_files)],
    out: Annotated[Path, option("--out", "HTML", "The file to write.")] = Path("report.html"),
    certify: Annotated[bool, option("--certify/--no-certify", None, "Prove how small a motion can be at all.")] = True,
    time: Time = None,
    case: Cases = None,
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
    finish(None, codes)


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
    opened = opened_files(paths, cases, assemblies=False)
    from fcdm_opt.show.rendering import plotly
    from fcdm_opt.show.report.gather import gather
    from fcdm_opt.show.report.page import page

    plotly()  # what is missing is said before anything is solved
    if not any(file.problems for file in opened):
        return "", [BAD_INPUT]
    with pacing.sharing(GATHERED):
        payload = gather(opened, certify=certify, say=say)
    codes = _codes(payload["files"], interrupted=payload["interrupted"])
    return page(payload), codes + [code_of(case["usable"], case["status"]) for case in payload["cases"]]


def _codes(files: Sequence[Mapping[str, Any]], *, interrupted: bool) -> list[int]:
    """Return the exit codes of what is missing; after an interrupt there is time for the page."""
    if interrupted:
        ending.set()
    late = [NO_MOTION if file.get("late") else BAD_INPUT for file in files if file.get("error")]
    return [*late, *[INTERRUPTED] * interrupted]


def _assemblies(paths: Sequence[Path], certify: bool, cases: Sequence[str]) -> tuple[str, list[int]]:
    """Return the same of files of assemblies."""
    opened = opened_files(paths, cases, assemblies=True)
    from fcdm_opt.show.report.gather import answered_in_turn
    from fcdm_opt.show.report.page import assembly_page, assembly_report
    from fcdm_opt.show.solved import solved_case

    asked = [assembly for file in opened for assembly in file.problems]

    def answer(number: int) -> dict[str, Any]:
        return assembly_report(solved_case(asked[number], certify=certify).solution, f"case-{number}")

    heads, _, found, interrupted = answered_in_turn(opened, answer, say)
    codes = _codes(heads, interrupted=interrupted) + [code_of(case["usable"], case["status"]) for case in found]
    return assembly_page(heads, found) if found else "", codes


def _study(sources: Sequence[Path], cases: Sequence[str]) -> str:
    """Return the report on one study."""
    from fcdm_opt.design.study.results import StudyResult
    from fcdm_opt.show.report.page import study_page

    if len(sources) > 1:
        found = ", ".join(map(str, sources))
        raise InputError("a study is reported on alone", key="FILE|DIR", found=found, allowed="one folder of a study")
    if cases:
        raise InputError("cases belong to problem files", key="--case", found=name_list(cases), allowed="no --case")
    return study_page(StudyResult.read(sources[0]))
