"""`study`, `whatif`, `map`, `pose`, `faces`, `stack`: what if sizes, tolerances, motions or shapes were different."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

from fcdm_opt import pacing
from fcdm_opt.cli.common import (
    SECONDS,
    AsJson,
    Cases,
    Dark,
    Files,
    Inquiry,
    OpenedFile,
    Out,
    Seed,
    Time,
    argument,
    checked_number,
    code_of,
    finish,
    named,
    option,
    written,
)
from fcdm_opt.cli.guarding import BAD_INPUT, NO_MOTION, NOT_VERIFIED, SOLVED, say
from fcdm_opt.errors import InputError
from fcdm_opt.problem.syntax import parsed

if TYPE_CHECKING:
    from fcdm_opt.design.study.running import Engine
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.problem.scene import Scene
    from fcdm_opt.problem.solution import Bounded

_CHANGE = re.compile(r"""((?:"[^"]*"|'[^']*'|[^="'])+)=(.*)""", re.DOTALL)
CHANGES = """KEY=VALUE as tolerance=0.03, made."peg width"=0.01"""
JUDGED = ("map", "yield", "as drawn", "best pose")
"""What is judged where parts are made anew; with a yield the stack-up it is of."""
LEAST = 0.1  # seconds that a map gets in any case
MAPS = "Write the map, its grid for the shop floor and pictures into this folder."
RESULTS = "Write results and pictures into this folder."
Results = Annotated[Path, option("--out", "DIR", RESULTS, callback=written("--out"))]
Jobs = Annotated[int | None, option("--jobs", "N", "Processes; default: one a core.", min=1)]
MEASURED = "Measured parts, of [[size]] tables their deviations; default: the tolerance box."
Sizes = Annotated[Path | None, option("--sizes", "CSV", MEASURED)]
Columns = Annotated[str, option("--columns", "A,B", "Its columns with the movable and the static part's sizes.")]
Nominals = Annotated[
    str | None, option("--nominals", "X,Y", "What these columns are divided by: the sizes as drawn. Default: 1.")
]
BOX = "Sizes of both parts as shares of those drawn, in place of the tolerance box."
SizeBox = Annotated[str | None, option("--box", "LOW1,HIGH1,LOW2,HIGH2", BOX)]
SET = (
    "Change any key of a case, or bodies.movable..., or size.NAME...: tolerance=0.03, limits.RZ_deg=[-5,5], "
    "made.NAME=0.01, size.NAME.tolerance=0.02; of an assembly scales.PART=1.01, part.NAME.limits.TZ=[-1,1], "
    "contact[1].clearance=0.1; may be repeated."
)
BUDGET = (
    'Largest tolerance that motions up to this amount make good, per requirement; "limits": that any motion within the '
    "case's own limits does."
)
SCHEDULER = "Of a Dask cluster; without it a local one is made."
OVER = (
    "One to six sizes of the file, in place of both scales, or scales of an assembly's parts, scales.PART; the others "
    "stay as made. Default: all sizes."
)
ERROR = checked_number("--error", "a finite number > 0", holds=lambda error: 0.0 < error < math.inf)
AMOUNT = checked_number("--budget", "a finite length >= 0", holds=lambda amount: 0.0 <= amount < math.inf)
SHARE = checked_number("--share", "between 0.5 and 1, as 0.9973", holds=lambda share: 0.5 < share < 1.0)
LIMITS = "Least and largest gap that will do; default: the case's clearance and any."
COST = "Find the cheapest tolerances: a half tolerance t of this size costs C / t; may be repeated."
WINDOW = "Smallest motion after which every pair's gap is in this window."


def study_command(
    file: Annotated[Path, argument("FILE", "A study file (TOML).")],
    out: Results,
    dark: Dark = False,
    jobs: Jobs = None,
    engine: Annotated[str, option("--engine", "NAME", '"joblib" (this machine) or "dask" (many).')] = "joblib",
    scheduler: Annotated[str | None, option("--scheduler", "ADDRESS", SCHEDULER)] = None,
    time: Time = None,
    parquet: Annotated[bool, option("--parquet", None, "Write study.parquet besides study.csv.")] = False,
    as_json: AsJson = False,
) -> None:
    """Solve and verify every point of a study; a run that was stopped is taken up where it was.

    Rows go to study.sqlite in DIR as they come, at the end to study.csv, with a picture.
    """
    from fcdm_opt.design.study.running import run_study
    from fcdm_opt.show.album import Album
    from fcdm_opt.show.printing import console
    from fcdm_opt.show.studies import study_figure

    result = run_study(file, out, engine=cast("Engine", engine), jobs=jobs, scheduler=scheduler, progress=True, say=say)
    if not as_json:
        console().print(f"{result}\n")
    result.to_csv(out / "study.csv")
    say(f"wrote {out / 'study.csv'}")
    if parquet:
        result.to_parquet(out / "study.parquet")
        say(f"wrote {out / 'study.parquet'}")
    pictures = Album(out, say, dark=dark)
    pictures.add("study", study_figure(result))
    counts = result.counts
    wrong = any(counts.get(status) for status in ("ERROR", "WORKER_LOST", "NOT_VERIFIED", "PENDING"))
    code = NOT_VERIFIED if wrong else BAD_INPUT if counts.get("BAD_INPUT") else SOLVED
    codes = [code, BAD_INPUT] if pictures.failed else [code]
    finish({"file": str(file), **result.to_dict()} if as_json else None, codes)


def whatif_command(
    files: Files,
    changes: Annotated[list[str] | None, option("--set", "KEY=VALUE", SET)] = None,
    budget: Annotated[str | None, option("--budget", "AMOUNT", BUDGET)] = None,
    conflicts: Annotated[bool, option("--conflicts", None, "Why there is no motion, and what cures it.")] = False,
    drop: Annotated[bool, option("--drop", None, "What each constraint costs.")] = False,
    compare: Annotated[bool, option("--compare", None, "Which family of motions is cheapest.")] = False,
    time: Time = None,
    as_json: AsJson = False,
    case: Cases = None,
) -> None:
    """Ask what would be if something were different; without options what constraints cost, or why none is met."""
    from fcdm_opt.design.whatif.budget import budget as largest_tolerances
    from fcdm_opt.design.whatif.compare import compare as compared
    from fcdm_opt.design.whatif.conflicts import conflicts as clashing
    from fcdm_opt.design.whatif.drop import drop as costs
    from fcdm_opt.design.whatif.whatif import whatif
    from fcdm_opt.show import tables
    from fcdm_opt.solver import solve

    values = dict(map(_change, changes or ()))
    try:
        limit = None if budget is None or budget == "limits" else float(budget)
    except ValueError:
        limit = math.nan
    if limit is not None and not limit >= 0.0:
        raise InputError("not an amount", key="--budget", found=budget, allowed='a length >= 0, or "limits"')
    plain = not (changes or budget or conflicts or drop or compare)

    def asked(file: OpenedFile, problem: Any) -> Iterator[tuple[str, Any, Callable[[Any], None]]]:
        if changes:
            yield "whatif", whatif(*_changed(file.path, problem.name, values)), tables.print_whatif
        if budget is not None:
            yield "budget", largest_tolerances(problem, limit), tables.print_budgets
        solution: Bounded | None = solve(problem, time=math.inf) if plain or conflicts else None
        if plain and solution is not None and solution.verified and not solution.usable:  # outside the fit
            yield "solution", solution, lambda answer: tables.print_lines([answer.advice])
        if conflicts or (solution is not None and not solution.verified):
            yield "conflicts", clashing(problem if solution is None else solution), tables.print_said
        if drop or (plain and solution is not None and solution.usable):
            yield "drop", costs(problem if solution is None else solution), tables.print_costs
        if compare:
            yield "compare", compared(problem), tables.print_comparison

    _each_case(Inquiry(files, case, as_json=as_json), asked)


def map_command(
    files: Files,
    out: Annotated[Path | None, option("--out", "DIR", MAPS)] = None,
    dark: Dark = False,
    error: Annotated[
        float | None,
        option(
            "--error", "LENGTH", "Error of the amount that is allowed; default: 1e-4 of the largest.", callback=ERROR
        ),
    ] = None,
    seconds: Annotated[
        float,
        option(
            "--seconds",
            "S",
            "Time for all maps, a share each, after which they are left as they are.",
            callback=SECONDS,
        ),
    ] = 120.0,
    time: Time = None,
    budget: Annotated[
        float | None,
        option("--budget", "AMOUNT", "Tell the share of pairs whose motion stays within it.", callback=AMOUNT),
    ] = None,
    over: Annotated[str | None, option("--over", "SIZE,...", OVER)] = None,
    box: SizeBox = None,
    sizes: Sizes = None,
    columns: Columns = "rho_1,rho_2",
    nominals: Nominals = None,
    seed: Seed = 1,
    jobs: Jobs = None,
    as_json: AsJson = False,
    case: Cases = None,
) -> None:
    """Map the smallest motion over all sizes in the tolerance box, with a grid for the shop floor; tell the yield.

    The sizes are the scales of both parts, or one to six [[size]] tables of the file, of an assembly too, or scales of
    its parts. The grid, one across and all others down, is written as CSV and as a page to print.
    """
    from fcdm_opt.design.compensation.assembly_yield import assembly_yield
    from fcdm_opt.design.compensation.compensation_map import compensation_map
    from fcdm_opt.design.distributions import Normal
    from fcdm_opt.design.sizes import chosen_sizes, sources
    from fcdm_opt.design.stack.spread import spreads
    from fcdm_opt.show import tables
    from fcdm_opt.show.grids import write_grids
    from fcdm_opt.show.maps import map_figure, yield_figure

    covered, pairs = _box(box), _pairs(sizes, columns, nominals, deviations=True)
    names = None if over is None else _names(over)
    given = {"over": "--over" * (over is not None), "box": "--box" * (box is not None)}

    def sizes_of(problem: Scene) -> Any:
        with named(**given):
            return chosen_sizes(problem, over=names)

    inquiry = Inquiry(files, case, as_json=as_json, out=out, dark=dark, first=sizes_of)
    pictures, each = inquiry.pictures, seconds / max(inquiry.count, 1)

    def asked(file: OpenedFile, problem: Scene) -> Iterator[tuple[str, Any, Callable[[Any], None]]]:
        if pairs is not None:  # refused before a map is made
            sources(pairs, positive=[name in problem.nominal_scales for name in sizes_of(problem)])
        spent = min(each, max(pacing.left(), LEAST))
        with pacing.unlimited(), named(**given):  # it has its own limit
            found = compensation_map(problem, over=names, box=covered, error=error, seconds=spent, jobs=jobs or 1)
        title = f"{file.name}: case {problem.name}"
        if pictures is not None and out is not None:
            stem = f"{file.path.stem}-{problem.name}"
            stem = pictures.add(stem, map_figure(found, problem, title=title), ending="-map")
            for write, ending in ((found.to_json, "json"), (found.to_csv, "csv")):
                write(out / f"{stem}.{ending}")
                inquiry.wrote(f"wrote {out / f'{stem}.{ending}'}")
            for path in write_grids(found, problem, out / stem, title=title):
                inquiry.wrote(f"wrote {path}")
        yield "map", found, tables.print_said
        if budget is not None:
            ends = [Normal((low + high) / 2, (high - low) / 6, low, high) for low, high in found.box]  # at 3 sigma
            own = [size for size in problem.sizes if size.name in found.over]
            told = dict(zip(found.over, ends, strict=True)) | {
                size.name: spread for size, spread in zip(own, spreads(own), strict=True)
            }
            scattered: Any = tuple(told.values()) if pairs is None else pairs
            share = assembly_yield(found, sizes=scattered, budget=budget, seed=seed)
            if pictures is not None:
                pictures.add(f"{stem}-yield", yield_figure(share, title=title))
            yield "yield", share, tables.print_yield

    _each_case(inquiry, asked)


def pose_command(
    files: Files,
    window: Annotated[str | None, option("--clearance", "LO,HI", WINDOW)] = None,
    box: SizeBox = None,
    sizes: Sizes = None,
    columns: Columns = "rho_1,rho_2",
    nominals: Nominals = None,
    time: Time = None,
    as_json: AsJson = False,
    case: Cases = None,
) -> None:
    """Tell clearance and interference of all sizes at a fixed pose, and find the one pose that is best for all."""
    from fcdm_opt.design.fixed_pose.best_pose import best_pose
    from fcdm_opt.design.fixed_pose.clearances import clearances
    from fcdm_opt.show import tables

    if box is not None and sizes is not None:
        raise InputError("a box and measured sizes exclude each other", key="--box", allowed="--box or --sizes")
    ends = None if window is None else _window(window, "--clearance")
    within, pairs = _box(box), _pairs(sizes, columns, nominals)

    def asked(file: OpenedFile, problem: Any) -> Iterator[tuple[str, Any, Callable[[Any], None]]]:
        with named(sizes="--sizes", box="--box" * (box is not None), clearance="--clearance" * (window is not None)):
            best = best_pose(problem, sizes=pairs, box=within, clearance=ends)  # what it refuses is said first
        drawn = clearances(problem, sizes=pairs, box=within)
        yield "as drawn", drawn, partial(tables.print_clearances, problem=problem, where="as drawn")
        yield "best pose", best, tables.print_said
        pose = best.parameters if best.transform is None else best.transform
        made = clearances(problem, sizes=pairs, box=within, pose=pose)
        yield "at the best pose", made, partial(tables.print_clearances, problem=problem, where="at the best pose")

    _each_case(Inquiry(files, case, as_json=as_json), asked, made=False)


def faces_command(
    files: Files, time: Time = None, as_json: AsJson = False, out: Out = None, dark: Dark = False
) -> None:
    """List the faces of both bodies with the names that [[size]] tables use; draw them with --out."""
    from fcdm_opt.show.stacks import faces_figure, listed_faces, print_faces

    inquiry = Inquiry(files, None, as_json=as_json, out=out, dark=dark)
    for file in inquiry:
        problem = file.problems[0]
        bodies = {role: problem.request[role] for role in ("movable", "static")}
        inquiry.say_of("faces", {role: listed_faces(body) for role, body in bodies.items()})
        if not as_json:
            inquiry.print_head(file)
            for role, body in bodies.items():
                print_faces(body, role)
        if inquiry.pictures is not None:
            inquiry.pictures.add(file.path.stem, faces_figure(problem, title=file.name), ending="-faces")
    inquiry.finish()


def stack_command(
    files: Files,
    gap: Annotated[str | None, option("--gap", "LO,HI", LIMITS)] = None,
    draws: Annotated[int, option("--draws", "N", "Pairs of parts drawn for the yield.", min=1)] = 1_000_000,
    cost: Annotated[list[str] | None, option("--cost", "SIZE=C", COST)] = None,
    share: Annotated[
        float | None, option("--share", "S", "With --cost: share of pairs that must fit.", callback=SHARE)
    ] = None,
    of: Annotated[str | None, option("--of", "PART,PART", "Of an assembly: the two parts whose gap it is.")] = None,
    cut: Annotated[str | None, option("--slice", "SIZE,SIZE", "With --out: the two sizes of the slice.")] = None,
    seed: Seed = 1,
    time: Time = None,
    as_json: AsJson = False,
    out: Out = None,
    dark: Dark = False,
    case: Cases = None,
) -> None:
    """Tell how the gap depends on the sizes of faces and features: worst case, yield, what each contributes.

    With --cost it finds the cheapest tolerances too. With --out it writes the rows as CSV, and pictures.
    """
    from fcdm_opt.design.stack.stack_up import stack_up
    from fcdm_opt.plain import plain
    from fcdm_opt.show import stacks
    from fcdm_opt.show.printing import print_text

    limits: Any = None if gap is None else _window(gap, "--gap")
    if share is not None and not cost:
        raise InputError("this is for the cheapest tolerances", key="--share", found=share, allowed="with --cost")
    if cut is not None and out is None:
        raise InputError("this is for pictures", key="--slice", found=cut, allowed="with --out")
    costs, parts = (
        dict(map(partial(_change, key="--cost", allowed="SIZE=C as width=1"), cost or ())),
        None if of is None else _names(of),
    )
    inquiry = Inquiry(files, case, as_json=as_json, out=out, dark=dark)
    pictures, before = inquiry.pictures, dict[str, str]()

    def asked(file: OpenedFile, problem: Any) -> Iterator[tuple[str, Any, Callable[[Any], None]]]:
        if not problem.sizes:
            there = stacks.commented_out_sizes(file.path)
            allowed = f"one [[size]] table or more{': ' * bool(there)}{there}"
            raise InputError("there are no sizes", key="size", allowed=allowed)
        with named(limits="--gap" * (gap is not None), of="--of"):
            found = stack_up(problem, limits=limits, of=parts)
        drawn = found.yield_(draws, seed=seed)
        first = before.setdefault(f"{file.path} {plain(found)}", problem.name)
        alike = first != problem.name  # requirements, say, which sizes of faces do not ask about
        printed = partial(stacks.print_stack, share=drawn)
        yield "stack", found, (lambda _: print_text(f"as case {first}")) if alike else printed
        yield "yield", drawn, lambda _: None
        if costs:
            with named(cost="--cost", share="--share"):
                cheapest = found.allocate(costs, share=share)
            yield "allocation", cheapest, stacks.print_allocation
        if pictures is not None and out is not None and not alike:
            title, stem = f"{file.name}: case {problem.name}", f"{file.path.stem}-{problem.name}-stack"
            stem = pictures.add(stem, stacks.stack_figure(found, drawn, title=title))
            stacks.write_stack(found, out / f"{stem}.csv")
            inquiry.wrote(f"wrote {out / f'{stem}.csv'}")
            most = [own.size for own in found.contributions[:2]]
            names = most if cut is None else _names(cut)
            if len(names) == 2:
                pictures.add(f"{stem}-slice", stacks.slice_figure(found, names, title=title))

    _each_case(inquiry, asked, made=False)


def _each_case(
    inquiry: Inquiry,
    asked: Callable[[OpenedFile, Problem], Iterator[tuple[str, Any, Callable[[Any], None]]]],
    *,
    made: bool = True,
) -> None:
    """Ask about every case of every file, print or collect the answers, and exit with the most severe code.

    Where it is no matter what was `made`, cases that differ in that alone are asked about once.
    """
    from fcdm_opt.judge.certificate import verify
    from fcdm_opt.show.printing import print_lines
    from fcdm_opt.show.remarks import known_gaps
    from fcdm_opt.show.tables import print_case, print_judged

    known = dict[str, tuple[str, dict[str, Any]]]()

    def answered(file: OpenedFile, problem: Problem, entry: dict[str, Any]) -> None:
        of_facets, alike = False, "" if made else _question_key(file, problem)
        if alike in known:
            name, answers = known[alike]
            entry |= answers
            if not inquiry.as_json:
                print_case(file.path.name, problem)
                print_lines([f"as case {name}: these are of all sizes, whatever was made"])
            return
        for number, (key, answer, printed) in enumerate(asked(file, problem)):
            if not (inquiry.as_json or number):
                print_case(file.path.name, problem)
            told = entry[key.replace(" ", "_")] = answer.to_dict()
            inquiry.codes.append(_code(answer))
            of_facets |= not (key == "map" or getattr(answer, "on_true_faces", number > 0))  # a map says it itself
            if not inquiry.as_json:
                printed(answer)
            if key in JUDGED:
                certificate = verify(answer)
                told["certificate"] = certificate.to_dict()
                inquiry.codes.append(SOLVED if certificate.passed else NOT_VERIFIED)
                if not inquiry.as_json:
                    print_judged(certificate)
        if known_to := known_gaps(problem) if of_facets else []:
            entry["known_to"] = known_to
            if not inquiry.as_json:
                print_lines(known_to)
        if alike:
            known[alike] = problem.name, {key: value for key, value in entry.items() if key not in ("name", "unit")}

    inquiry.ask(answered)


def _question_key(file: OpenedFile, problem: Scene) -> str:
    """Return what cases have in common that differ only in the sizes made, as text; "" where it cannot be written."""
    try:
        (case,) = problem.to_dict()["case"]
    except (InputError, AttributeError):
        return ""
    ignored = ("name", "made", "scales", "requirement", "published", "published_text")
    return repr((file.path, {key: value for key, value in case.items() if key not in ignored}))


def _code(answer: Any) -> int:
    """Return the exit code that an answer stands for."""
    from fcdm_opt.design.fixed_pose.best_pose import NONE, UNDECIDED, BestPose
    from fcdm_opt.design.whatif.whatif import WhatIf
    from fcdm_opt.problem.solution import Bounded

    solution = answer.after if isinstance(answer, WhatIf) else answer
    if isinstance(solution, Bounded):
        return code_of(solution.usable, solution.status.name)
    if isinstance(answer, BestPose) and not answer.passed:
        return NOT_VERIFIED
    return NO_MOTION if isinstance(answer, BestPose) and answer.status in (NONE, UNDECIDED) else SOLVED


def _change(text: str, key: str = "--set", allowed: str = CHANGES) -> tuple[str, Any]:
    """Read KEY=VALUE, the value as in a problem file; a word that is no such value is text."""
    told = _CHANGE.fullmatch(text)
    if told is None:
        raise InputError("not a name and a value", key=key, found=text, allowed=allowed)
    name, value = told[1].strip(), told[2].strip()
    try:
        return name, parsed(f"value = {value}")["value"]
    except ValueError:
        return name, value


def _changed(path: Path, name: str, values: dict[str, Any]) -> tuple[Scene, Scene]:
    """Return a case of a file as it is, and with other values at some places."""
    from fcdm_opt.design.question import Question

    question = next(each for each in Question.read(path) if each.name == name)
    return question.problem(), question.changed(values).problem()


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",")]


def _numbers(text: str, key: str, allowed: str, count: int | None = None) -> tuple[float, ...]:
    """Return the numbers of a text with commas between: `count` of them, or two for each of some sizes."""
    try:
        numbers = tuple(map(float, text.split(",")))
    except ValueError:
        numbers = ()
    fits = len(numbers) == count if count else bool(numbers) and len(numbers) % 2 == 0
    if not fits or any(map(math.isnan, numbers)):
        raise InputError(f"not {count or 'pairs of'} numbers", key=key, found=text, allowed=allowed)
    return numbers


def _window(text: str, key: str) -> tuple[float, ...]:
    """Return the ends of a text LOW,HIGH."""
    allowed = "LOW,HIGH as 0.1,0.3, LOW <= HIGH"
    low, high = ends = _numbers(text, key, allowed, 2)
    if low > high:
        raise InputError("the lower end is above the upper one", key=key, found=text, allowed=allowed)
    return ends


def _box(text: str | None) -> Any:
    """Return the ends of each size; those of a single one, which stand for all scales in some places, as they are."""
    if text is None:
        return None
    allowed = "two for each size, LOW1,HIGH1,LOW2,HIGH2 as 0.98,1.02,0.99,1.01, LOW <= HIGH"
    numbers = _numbers(text, "--box", allowed)
    if any(low > high for low, high in zip(numbers[::2], numbers[1::2], strict=True)):
        raise InputError("a lower end is above its upper one", key="--box", found=text, allowed=allowed)
    return numbers if len(numbers) == 2 else [*zip(numbers[::2], numbers[1::2], strict=True)]


def _pairs(path: Path | None, columns: str, nominals: str | None, *, deviations: bool = False) -> Any:
    """Return measured sizes, (n, k), as shares of those drawn; None where there is no file of them."""
    from fcdm_opt.design.distributions import read_columns

    if path is None:
        return None
    names = _names(columns)
    each = "a number for each column, as 10,20"
    drawn = [1.0] * len(names) if nominals is None else _numbers(nominals, "--nominals", each, len(names))
    return read_columns(path, names, drawn, deviations=deviations)
