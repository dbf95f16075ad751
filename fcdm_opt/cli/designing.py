"""`study`, `whatif`, `map`, `pose`, `faces`, `stack`: what if sizes, tolerances, motions or shapes were different."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Annotated, Any, cast

from fcdm_opt import pacing
from fcdm_opt.cli import common
from fcdm_opt.cli.common import Inquiry, OpenedFile, argument, checked, code_of, option
from fcdm_opt.cli.guarding import BAD_INPUT, NO_MOTION, NOT_VERIFIED, SOLVED, say
from fcdm_opt.errors import InputError, name_list
from fcdm_opt.problem.syntax import parsed

if TYPE_CHECKING:
    from fcdm_opt.design.study.running import Engine
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.problem.scene import Scene
    from fcdm_opt.problem.solution import Bounded

_CHANGE = re.compile(r"""((?:"[^"]*"|'[^']*'|[^="'])+)=(.*)""", re.DOTALL)
CHANGES = """KEY=VALUE as tolerance=0.03, made."peg width"=0.01"""
POSED = 0.6  # share of the time left for a pose, and judging it; the gaps as drawn are judged, too
JUDGED = ("map", "yield", "as drawn", "best pose")
"""What is judged where parts are made anew; with a yield the stack-up it is of."""
ALL_SIZES = ("scales", "made", "requirement")
"""Keys of a case that are no matter where all sizes are asked about; of a budget that of scales is."""
LEAST = 0.1  # seconds that a map gets in any case


def _changes(allowed: str) -> common.Check:
    """Return the check of options KEY=VALUE, each value as in a problem file; a word that is no such value is text."""

    def change(key: str, text: str) -> tuple[str, Any]:
        match = _CHANGE.fullmatch(text)
        if match is None:
            raise InputError("not a name and a value", key=key, found=text, allowed=allowed)
        name, value = match[1].strip(), match[2].strip()
        try:
            return name, parsed(f"value = {value}")["value"]
        except ValueError:
            return name, value

    return lambda key, texts: [change(key, text) for text in texts]


def _limit(key: str, text: str) -> float | str:
    """Read an amount, or that it is the limits that bound it."""
    with suppress(ValueError):
        if text == "limits" or float(text) >= 0.0:
            return text if text == "limits" else float(text)
    raise InputError("not an amount", key=key, found=text, allowed='a length >= 0, or "limits"')


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


def _ranges(allowed: str, count: int | None = None) -> common.Check:
    """Return the check of an option LOW,HIGH,...: a single range as it is, else a list of them."""

    def ranges(key: str, text: str) -> Any:
        numbers = _numbers(text, key, allowed, count)
        found = [*zip(numbers[::2], numbers[1::2], strict=True)]
        if any(low > high for low, high in found):
            raise InputError("a lower end is above its upper one", key=key, found=text, allowed=allowed)
        return found if len(found) > 1 else found[0]

    return ranges


WITHIN = _ranges("LOW,HIGH as 0.1,0.3, LOW <= HIGH", 2)
POSE = _ranges('LOW,HIGH as 0.1,inf, LOW <= HIGH, or "middle"', 2)


def _window(key: str, text: str) -> Any:
    """Read the window of a pose's gaps, or that there is to be none."""
    return text if text == "middle" else POSE(key, text)


IN_BOX = _ranges("two for each size, LOW1,HIGH1,LOW2,HIGH2 as 0.98,1.02,0.99,1.01, LOW <= HIGH")
MAPS = "Write the map, its grid for the shop floor and pictures into this folder."
RESULTS = "Write results and pictures into this folder."
Jobs = Annotated[int | None, option("--jobs", "N", "Processes; default: one a core.", min=1)]
MEASURED = "Measured parts, of [[size]] tables their deviations; default: the tolerance box."
Sizes = Annotated[Path | None, option("--sizes", "CSV", MEASURED)]
OF_PARTS = "Its columns with these sizes. Default: named as these, of both scales rho_1,rho_2."
Columns = Annotated[common.Text, option("--columns", "A,B", OF_PARTS, check=common.names)]
DIVIDED = "What these columns are divided by: the sizes as drawn. Default: 1."
Nominals = Annotated[str | None, option("--nominals", "X,Y", DIVIDED)]
BOX = "Sizes of both parts as shares of those drawn, in place of the tolerance box."
SizeBox = Annotated[common.Text, option("--box", "LOW1,HIGH1,LOW2,HIGH2", BOX, check=IN_BOX)]
SET = (
    "Change any key of a case, or bodies.movable..., or size.NAME...: tolerance=0.03, limits.RZ_deg=[-5,5], "
    "made.NAME=0.01, size.NAME.tolerance=0.02; of an assembly scales.PART=1.01, part.NAME.limits.TZ=[-1,1], "
    "contact[1].clearance=0.1; may be repeated."
)
BUDGET = (
    'Largest tolerance that motions up to this amount make good, per requirement; "limits": that any within limits.'
)
SCHEDULER = "Of a Dask cluster; without it a local one is made."
OVER = (
    "One to six sizes of the file, in place of both scales, or scales of an assembly's parts, scales.PART; the others "
    "stay as made. Default: all sizes."
)
AMOUNT = checked("unusable number", "a finite length >= 0", lambda amount: 0.0 <= amount < math.inf)
SHARE = checked("unusable number", "between 0.5 and 1, as 0.9973", lambda share: 0.5 < share < 1.0)
ERROR = "Error of the amount that is allowed; default: 1e-4 of the largest."
SHARED = "Time for all maps, a share each, after which they are left as they are."
PASSING = "Tell the share of pairs whose motion stays within it."
MUST_FIT = "With --cost: share of pairs that must fit."
LIMITS = "Least and largest gap that will do; default: the case's clearance and any."
COST = "Find the cheapest tolerances: a half tolerance t of this size costs C / t; may be repeated."
ENGINE = "joblib: processes of this machine; dask: workers of a cluster, --scheduler, or of one made here."
OF = (
    "Of an assembly: the two parts whose gap it is. Or two plane faces as PART:FACE, while all contacts stay closed: "
    "clip:F5,base:F2; of two bodies F5,F2 too, the movable one first."
)
CONTACT = "Of one contact alone, by its number in the table of contacts."
SLICE = "With --out: the two sizes of the slice."
WINDOW = (
    'Smallest motion after which every pair\'s gap is in this window; default of goal "clear" its clearance and more, '
    'else "middle": the largest gap or interference is made least.'
)


def study_command(
    file: Annotated[Path, argument("FILE", "A study file (TOML).")],
    out: Annotated[Path, option("--out", "DIR", RESULTS, check=common.written())],
    dark: common.Dark = False,
    jobs: Jobs = None,
    engine: Annotated[str, option("--engine", "joblib|dask", ENGINE, check=common.one_of("joblib", "dask"))] = "joblib",
    scheduler: Annotated[str | None, option("--scheduler", "ADDRESS", SCHEDULER)] = None,
    time: common.Time = None,
    parquet: Annotated[bool, option("--parquet", None, "Write study.parquet besides study.csv.")] = False,
    as_json: common.AsJson = False,
) -> None:
    """Solve and verify every point of a study; a run that was stopped is taken up where it was.

    Rows go to study.sqlite in DIR as they come, at the end to study.csv, with a picture.
    """
    from fcdm_opt.design.study.running import run_study
    from fcdm_opt.show.album import Album
    from fcdm_opt.show.printing import console
    from fcdm_opt.show.studies import study_figure

    with common.named(engine="--engine", jobs="--jobs", scheduler="--scheduler"):
        result = run_study(
            file, out, engine=cast("Engine", engine), jobs=jobs, scheduler=scheduler, progress=True, say=say
        )
    pacing.at("drawing")
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
    common.finish({"file": str(file), **result.to_dict()} if as_json else None, codes)


def whatif_command(
    files: common.Files,
    changes: Annotated[common.Texts, option("--set", "KEY=VALUE", SET, check=_changes(CHANGES))] = None,
    budget: Annotated[common.Text, option("--budget", "AMOUNT", BUDGET, check=_limit)] = None,
    conflicts: Annotated[bool, option("--conflicts", None, "Why there is no motion, and what cures it.")] = False,
    drop: Annotated[bool, option("--drop", None, "What each constraint costs.")] = False,
    compare: Annotated[bool, option("--compare", None, "Which family of motions is cheapest.")] = False,
    time: common.TimeOrUsual = None,
    as_json: common.AsJson = False,
    case: common.Cases = None,
) -> None:
    """Ask what would be if something were different; without options what constraints cost, or why none is met."""
    if not pacing.limited():
        pacing.begin(common.USUAL, usual=True)
    inquiry = Inquiry(files, case, as_json=as_json)  # refuses words before libraries are loaded
    from fcdm_opt.design.whatif.budget import budget as largest_tolerances
    from fcdm_opt.design.whatif.compare import compare as compared
    from fcdm_opt.design.whatif.conflicts import conflicts as clashing
    from fcdm_opt.design.whatif.constraints import drop as costs
    from fcdm_opt.design.whatif.fitting import fits_up_to
    from fcdm_opt.design.whatif.whatif import whatif
    from fcdm_opt.show import tables
    from fcdm_opt.show.assemblies import verdict_of
    from fcdm_opt.show.solved import SolvedCase
    from fcdm_opt.show.texts import advised
    from fcdm_opt.solver import solve

    plain = not (changes or budget or conflicts or drop or compare)

    def asked(file: OpenedFile, problem: Any) -> Iterator[tuple[str, Any, Callable[[Any], None]]]:
        if changes:
            yield "whatif", whatif(*_changed(file.path, problem.name, dict(changes))), tables.print_whatif
        if budget is not None:
            yield "budget", largest_tolerances(problem, None if budget == "limits" else budget), tables.print_budgets
        solution: Bounded | None = solve(problem, time=math.inf) if plain or conflicts else None
        if plain and solution is not None and solution.verified and not solution.usable:  # outside the fit
            found = cast("Any", solution)
            lines = [verdict_of(found)]
            if not hasattr(found, "assembly"):
                lines.append(advised(SolvedCase(found, fits_up_to=fits_up_to(problem))))
            yield "solution", solution, lambda _: tables.print_lines(lines)
        if conflicts or (solution is not None and not solution.verified):
            with common.named(problem="--conflicts" * conflicts):
                clashes = clashing(problem if solution is None else solution)
            yield "conflicts", clashes, tables.print_as_text
        if drop or (plain and solution is not None and solution.usable):
            with common.named(problem="--drop" * drop):
                dropped = costs(problem if solution is None else solution)
            yield "drop", dropped, tables.print_costs
        if compare:
            yield "compare", compared(problem), tables.print_comparison

    only_budget = budget is not None and not (changes or conflicts or drop or compare)
    _each_case(inquiry, asked, ignored=ALL_SIZES[1:] if only_budget else ())


def map_command(
    files: common.Files,
    out: Annotated[Path | None, option("--out", "DIR", MAPS)] = None,
    dark: common.Dark = False,
    error: Annotated[float | None, option("--error", "LENGTH", ERROR, check=common.LENGTH)] = None,
    seconds: Annotated[float, option("--seconds", "S", SHARED, check=common.SECONDS)] = 120.0,
    time: common.Time = None,
    budget: Annotated[float | None, option("--budget", "AMOUNT", PASSING, check=AMOUNT)] = None,
    over: Annotated[common.Text, option("--over", "SIZE,...", OVER, check=common.names)] = None,
    box: SizeBox = None,
    sizes: Sizes = None,
    columns: Columns = None,
    nominals: Nominals = None,
    seed: common.Seed = 1,
    jobs: Jobs = None,
    as_json: common.AsJson = False,
    case: common.Cases = None,
) -> None:
    """Map the smallest motion over all sizes in the tolerance box, with a grid for the shop floor; tell the yield.

    The sizes are the scales of both parts, or one to six [[size]] tables of the file, of an assembly too, or scales of
    its parts. The grid, one across and all others down, is written as CSV and as a page to print.
    """
    given = {"over": "--over" * (over is not None), "box": "--box" * (box is not None)}

    def looked_at(file: Any) -> None:
        from fcdm_opt.design.sizes import SCALES, box_over, chosen_sizes

        scales = {f"scales.{part.name}": 1.0 for part in getattr(file, "part", ())} or dict.fromkeys(SCALES, 1.0)
        known: Any = SimpleNamespace(sizes=file.size, nominal_scales=scales)
        with common.named(**given):
            names = () if over is None else chosen_sizes(known, over)
            if box is not None and (names or not file.size):  # else a case's own keys say what it is of
                box_over(known, names or [*scales], box)

    inquiry = Inquiry(files, case, as_json=as_json, out=out, dark=dark, first=looked_at)
    from fcdm_opt.design.compensation.assembly_yield import assembly_yield
    from fcdm_opt.design.compensation.compensation_map import compensation_map
    from fcdm_opt.design.sizes import chosen_sizes
    from fcdm_opt.show import tables
    from fcdm_opt.show.grids import write_grids
    from fcdm_opt.show.maps import map_figure, yield_figure

    pictures, each = inquiry.pictures, seconds / max(inquiry.count, 1)

    def asked(file: OpenedFile, problem: Scene) -> Iterator[tuple[str, Any, Callable[[Any], None]]]:
        with common.named(**given):
            names = () if sizes is None else chosen_sizes(problem, over=over)
        pairs = _measured(problem, names, sizes, columns, nominals)  # refused before a map is made
        spent = min(each, max(pacing.remaining(), LEAST))
        with pacing.unlimited(), common.named(**given):  # it has its own limit
            found = compensation_map(problem, over=over, box=box, error=error, seconds=spent, jobs=jobs or 1)
        title = f"{file.name}: case {problem.name}"
        if pictures is not None and out is not None:
            stem = f"{file.path.stem}-{problem.name}"
            stem = pictures.add(stem, map_figure(found, problem, title=title), ending="-map")
            for write, ending in ((found.to_json, "json"), (found.to_csv, "csv")):
                write(out / f"{stem}.{ending}")
                inquiry.wrote(f"wrote {out / f'{stem}.{ending}'}")
            for path in write_grids(found, problem, out / stem, title=title):
                inquiry.wrote(f"wrote {path}")
        yield "map", found, tables.print_as_text
        if budget is not None:
            share = assembly_yield(found, sizes=pairs, budget=budget, seed=seed)
            if pictures is not None:
                pictures.add(f"{stem}-yield", yield_figure(share, title=title))
            yield "yield", share, tables.print_yield

    _each_case(inquiry, asked)


def pose_command(
    files: common.Files,
    window: Annotated[common.Text, option("--clearance", "LO,HI", WINDOW, check=_window)] = None,
    box: SizeBox = None,
    sizes: Sizes = None,
    columns: Columns = None,
    nominals: Nominals = None,
    time: common.Time = None,
    as_json: common.AsJson = False,
    case: common.Cases = None,
) -> None:
    """Tell clearance and interference of all sizes at a fixed pose, and find the one pose that is best for all.

    With [[size]] tables parts are scaled as the case says, and have all sizes within their tolerances.
    """
    if box is not None and sizes is not None:
        raise InputError("a box and measured sizes exclude each other", key="--box", allowed="--box or --sizes")
    if box is not None:
        from fcdm_opt.design.sizes import size_box

        with common.named(box="--box"):  # of an assembly one range, of all its parts
            size_box(box, "box", positive=[True] * (1 + isinstance(box[0], tuple)))
    inquiry = Inquiry(files, case, as_json=as_json)
    from fcdm_opt.design.distributions import Measured
    from fcdm_opt.design.fixed_pose.best_pose import ONLY_CLEAR, best_pose
    from fcdm_opt.design.fixed_pose.clearances import clearances
    from fcdm_opt.design.sizes import by_name, not_counted
    from fcdm_opt.show import tables

    def asked(file: OpenedFile, problem: Any) -> Iterator[tuple[str, Any, Callable[[Any], None]]]:
        own = {size.name: size for size in problem.sizes} if by_name(problem) else {}
        pairs = _measured(problem, [*(own or problem.nominal_scales)], sizes, columns, nominals)
        if own and pairs is not None:  # of these all within what was measured
            ends = zip(own.values(), pairs.min(axis=0).tolist(), pairs.max(axis=0).tolist(), pairs.T, strict=True)
            within = [replace(size, tolerance=(low, high), distribution=Measured(x)) for size, low, high, x in ends]
            problem, pairs = problem.changed(sizes=within), None
        with (
            common.named(
                sizes="--sizes", box="--box" * (box is not None), clearance="--clearance" * (window is not None)
            ),
            pacing.sharing(POSED),
        ):
            best = best_pose(problem, sizes=pairs, box=box, clearance=window)  # what it refuses is said first
        with pacing.telling():
            drawn = clearances(problem, sizes=pairs, box=box)
        yield "as drawn", drawn, partial(tables.print_clearances, problem=problem, where="as drawn")
        opened = [] if best.standing or best.permanent_faces else drawn.standing
        counted = not_counted(opened, "but counted in the pose, whose motion opens them")
        text = "; ".join([str(best).replace(ONLY_CLEAR, "--clearance 0,inf"), *counted])
        yield "best pose", best, lambda _: tables.print_as_text(text)
        pose = best.parameters if best.transform is None else best.transform
        with pacing.telling():
            made = clearances(problem, sizes=pairs, box=box, pose=pose)
        yield "at the best pose", made, partial(tables.print_clearances, problem=problem, where="at the best pose")

    _each_case(inquiry, asked, ignored=ALL_SIZES)


def faces_command(
    files: common.Files,
    time: common.Time = None,
    as_json: common.AsJson = False,
    out: common.Out = None,
    dark: common.Dark = False,
) -> None:
    """List the faces of all bodies with the names that [[size]] tables use; draw them with --out."""
    from fcdm_opt.show.stacks import faces_figure, listed_faces, print_faces

    inquiry = Inquiry(files, None, as_json=as_json, out=out, dark=dark, some=True)
    for file in inquiry:
        problem = file.problems[0]
        inquiry.say_of("faces", {role: listed_faces(body) for role, body in problem.drawn.items()})
        if not as_json:
            inquiry.print_head(file)
            for role, body in problem.drawn.items():
                print_faces(body, role)
        if inquiry.pictures is not None:
            inquiry.pictures.add(file.path.stem, faces_figure(problem, title=file.name), ending="-faces")
    inquiry.finish()


def stack_command(
    files: common.Files,
    gap: Annotated[common.Text, option("--gap", "LO,HI", LIMITS, check=WITHIN)] = None,
    draws: Annotated[int, option("--draws", "N", "Pairs of parts drawn for the yield.", min=1)] = 1_000_000,
    cost: Annotated[common.Texts, option("--cost", "SIZE=C", COST, check=_changes("SIZE=C as width=1"))] = None,
    share: Annotated[float | None, option("--share", "S", MUST_FIT, check=SHARE)] = None,
    of: Annotated[common.Text, option("--of", "PART,PART", OF, check=common.two("parts"))] = None,
    contact: Annotated[int | None, option("--contact", "N", CONTACT, min=1)] = None,
    cut: Annotated[common.Text, option("--slice", "SIZE,SIZE", SLICE, check=common.two("sizes"))] = None,
    seed: common.Seed = 1,
    time: common.Time = None,
    as_json: common.AsJson = False,
    out: common.Out = None,
    dark: common.Dark = False,
    case: common.Cases = None,
) -> None:
    """Tell how the gap depends on the sizes of faces and features: worst case, yield, what each contributes.

    Parts are scaled as the case says, and have all sizes within their tolerances, whatever it says is made.
    With --cost it finds the cheapest tolerances too. With --out it writes the rows as CSV, and pictures.
    """
    from fcdm_opt.lazy_import import extra

    if share is not None and not cost:
        raise InputError("this is for the cheapest tolerances", key="--share", found=share, allowed="with --cost")
    if cost:
        extra("cvxpy", "allocation", key="--cost")  # refused before tables are printed
    if cut is not None and out is None:
        raise InputError("this is for pictures", key="--slice", found=name_list(cut), allowed="with --out")
    parts = [own for own in of or () if ":" not in own]
    named = {"--of": ("part", parts), "--slice": ("size", cut or ()), "--cost": ("size", [*dict(cost or ())])}
    inquiry = Inquiry(files, case, as_json=as_json, out=out, dark=dark, named=named)
    from fcdm_opt.design.stack.stack_up import stack_up
    from fcdm_opt.plain import plain
    from fcdm_opt.show import stacks
    from fcdm_opt.show.printing import print_text

    pictures, before = inquiry.pictures, dict[str, str]()

    def asked(file: OpenedFile, problem: Any) -> Iterator[tuple[str, Any, Callable[[Any], None]]]:
        if not problem.sizes:
            there = stacks.commented_out_sizes(file.path)
            allowed = f"one [[size]] table or more{': ' * bool(there)}{there}"
            raise InputError("there are no sizes", key="size", allowed=allowed)
        with common.named(limits="--gap" * (gap is not None), of="--of"):
            found = stack_up(problem, limits=gap, of=of)
        with common.named(contact="--contact"):
            found = found if contact is None else found.of_contact(contact)
        drawn = found.yield_(draws, seed=seed)
        first = before.setdefault(f"{file.path} {plain(found)}", problem.name)
        alike = first != problem.name  # requirements, say, which sizes of faces do not ask about
        yield "stack", found, lambda _: None  # printed with the yield, below what the judge says
        yield "yield", drawn, lambda _: print_text(f"as case {first}") if alike else stacks.print_stack(found, drawn)
        if cost:
            with common.named(cost="--cost", share="--share"):
                cheapest = found.allocate(dict(cost), share=share)
            yield "allocation", cheapest, stacks.print_allocation
        if pictures is not None and out is not None and not alike:
            title, stem = f"{file.name}: case {problem.name}", f"{file.path.stem}-{problem.name}-stack"
            title += ": NOT VERIFIED, do not use it" * inquiry.refused
            stem = pictures.add(stem, stacks.stack_figure(found, drawn, title=title))
            stacks.write_stack(found, out / f"{stem}.csv")
            inquiry.wrote(f"wrote {out / f'{stem}.csv'}")
            most = [own.size for own in found.contributions[:2]]
            if len(cut or most) == 2:
                pictures.add(f"{stem}-slice", stacks.slice_figure(found, cut or most, title=title))

    _each_case(inquiry, asked, ignored=ALL_SIZES)


def _each_case(
    inquiry: Inquiry,
    asked: Callable[[OpenedFile, Problem], Iterator[tuple[str, Any, Callable[[Any], None]]]],
    *,
    ignored: Sequence[str] = (),
) -> None:
    """Ask about every case of every file, print or collect the answers, and exit with the most severe code.

    Cases that differ in keys alone that are no matter, `ignored`, are asked about once.
    """
    from fcdm_opt.judge.certificate import Certificate, judged_in_time
    from fcdm_opt.show.printing import print_lines
    from fcdm_opt.show.remarks import errors_of_facets, on_true_faces, sizes_as_drawn
    from fcdm_opt.show.tables import print_case, print_judged

    before = dict[str, tuple[str, dict[str, Any]]]()

    def answered(file: OpenedFile, problem: Problem, entry: dict[str, Any]) -> None:
        inquiry.refused, known = False, dict[str, None]()
        alike = _question_key(file, problem, ignored) if ignored else ""
        if alike in before:
            name, answers = before[alike]
            entry |= answers
            if not inquiry.as_json:
                print_case(file.path.name, problem)
                print_lines([f"as case {name}: these are of all sizes, whatever was made"])
            return
        for number, (key, answer, printed) in enumerate(asked(file, problem)):
            if not (inquiry.as_json or number):
                print_case(file.path.name, problem)
            data = entry[key.replace(" ", "_")] = answer.to_dict()
            inquiry.codes.append(_code(answer))
            if key != "map":  # which says it itself
                exact = getattr(answer, "on_true_faces", number > 0 or on_true_faces(problem))
                facets = [] if exact else errors_of_facets(problem)
                known |= dict.fromkeys(getattr(answer, "known_to", facets))
            certificate = None
            if key in JUDGED:
                certificate = Certificate(answer.checks) if hasattr(answer, "checks") else judged_in_time(answer)
            if certificate is not None:
                inquiry.refused |= not certificate.passed
                data["certificate"] = certificate.to_dict()
                inquiry.codes.append(SOLVED if certificate.passed else NOT_VERIFIED)
            if not inquiry.as_json:
                if certificate is not None and not certificate.passed:  # at its head
                    print_judged(certificate)
                printed(answer)
                if certificate is not None and certificate.passed:
                    print_judged(certificate)
        if known:
            entry["known_to"] = [*known]
        if unasked := sizes_as_drawn(problem) if "stack" not in entry else []:
            entry["sizes_as_drawn"] = unasked
        if not inquiry.as_json:
            print_lines([*known, *unasked])
        if alike:
            before[alike] = problem.name, {key: value for key, value in entry.items() if key not in ("name", "unit")}

    inquiry.ask(answered)


def _question_key(file: OpenedFile, problem: Scene, ignored: Sequence[str]) -> str:
    """Return what cases have in common that differ only in some keys, as text; "" where it cannot be written."""
    try:
        (case,) = problem.to_dict()["case"]
    except (InputError, AttributeError):
        return ""
    own = {*ignored, "name", "published", "published_text"}
    return repr((file.path, {key: value for key, value in case.items() if key not in own}))


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
    none = getattr(answer, "without_motion", False) or getattr(answer, "status", "") in (NONE, UNDECIDED)
    return NO_MOTION if none else SOLVED


def _changed(path: Path, name: str, values: dict[str, Any]) -> tuple[Scene, Scene]:
    """Return a case of a file as it is, and with other values at some places."""
    from fcdm_opt.design.question import Question

    question = next(each for each in Question.read(path) if each.name == name)
    return question.problem(), question.changed(values).problem()


def _measured(
    problem: Scene, names: Sequence[str], path: Path | None, columns: Sequence[str] | None, nominals: str | None
) -> Any:
    """Return measured sizes, (n, k): shares of what is drawn, of [[size]] tables deviations; None without their file.

    Columns have the names of the sizes where none are given.
    """
    if path is None:
        return None
    from fcdm_opt.design.distributions import read_columns
    from fcdm_opt.design.sizes import sources

    positive = [name in problem.nominal_scales for name in names]
    columns, each = columns or names, "a number for each column, as 10,20"
    drawn = [1.0] * len(columns) if nominals is None else _numbers(nominals, "--nominals", each, len(columns))
    return sources(read_columns(path, columns, drawn, deviations=not all(positive)), positive=positive)
