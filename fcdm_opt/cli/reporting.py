"""`report`: one HTML file to look at, to turn, to print and to pass on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from fcdm_opt import pacing
from fcdm_opt.cli.common import Cases, Time, argument, code_of, finish, opened_files, option, problem_files
from fcdm_opt.cli.guarding import BAD_INPUT, NO_MOTION, refuse, say
from fcdm_opt.errors import InputError

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
    from fcdm_opt.problem.assembly_file import is_assembly

    if out.suffix.lower() not in (".html", ".htm"):
        raise InputError("not the name of a report", key="--out", found=str(out), allowed="a name in .html")
    if any((source / STUDY).is_file() for source in sources):
        text, codes = _study(sources, case or ()), list[int]()
    else:
        paths = list(_files(sources))
        asked = _assemblies if paths and all(map(is_assembly, paths)) else _problems
        text, codes = asked(paths, certify, case or ())
    if text:
        with suppress(OSError):  # what is wrong with it is said when the file is written
            out.parent.mkdir(parents=True, exist_ok=True)
        write(out, text)
        say(f"wrote {out} ({len(text.encode()) / MEGABYTE:.1f} MB)")
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
    from fcdm_opt.show.rendering import plotly
    from fcdm_opt.show.report.gather import gather
    from fcdm_opt.show.report.page import page

    plotly()  # what is missing is said before anything is solved
    opened = opened_files(paths, cases, assemblies=False)
    if not any(file.problems for file in opened):
        return "", [BAD_INPUT]
    with pacing.sharing(GATHERED):
        payload = gather(opened, certify=certify, say=say)
    codes = [NO_MOTION if file.get("late") else BAD_INPUT for file in payload["files"] if file.get("error")]
    return page(payload), codes + [code_of(case["usable"], case["status"]) for case in payload["cases"]]


def _assemblies(paths: Sequence[Path], certify: bool, cases: Sequence[str]) -> tuple[str, list[int]]:
    """Return the same of files of assemblies."""
    from fcdm_opt.show.report.gather import head
    from fcdm_opt.show.report.page import assembly_page
    from fcdm_opt.show.solved import solved_case

    opened = opened_files(paths, cases, assemblies=True)
    heads, solutions = list[dict[str, Any]](), list[Any]()
    codes = [BAD_INPUT for file in opened if file.error]
    for file in opened:
        first, errors = len(solutions), [file.error] if file.error else []
        for assembly in file.problems:
            say(f"{file.path.name}: case {assembly.name}")
            try:
                solutions.append(solved_case(assembly, certify=certify).solution)
            except InputError as reason:
                errors.append(refuse(reason.within(file=file.path, key=f"case {assembly.name!r}")))
                codes.append(BAD_INPUT)
        heads.append({**head(file), "cases": range(first, len(solutions)), "error": "\n".join(errors)})
    codes += [code_of(own.usable, own.status.name) for own in solutions]
    return assembly_page(heads, solutions) if solutions else "", codes


def _study(sources: Sequence[Path], cases: Sequence[str]) -> str:
    """Return the report on one study."""
    from fcdm_opt.design.study.results import StudyResult
    from fcdm_opt.show.report.page import study_page

    if len(sources) > 1:
        found = ", ".join(map(str, sources))
        raise InputError("a study is reported on alone", key="FILE|DIR", found=found, allowed="one folder of a study")
    if cases:
        raise InputError("cases belong to problem files", key="--case", found=", ".join(cases), allowed="no --case")
    return study_page(StudyResult.read(sources[0]))
