"""The reports as one HTML text each: on problems what `page.html` shows, on a study its points and what was found."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fcdm_opt.design.study.results import DRAW, StudyResult
from fcdm_opt.design.whatif.fitting import barred_text
from fcdm_opt.geometry.naming import element_text
from fcdm_opt.geometry.units import floored
from fcdm_opt.plain import finite
from fcdm_opt.problem.assembled import AssemblySolution
from fcdm_opt.problem.problem import SIGNS
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.show import inline_svg, texts
from fcdm_opt.show.assemblies import ARROWS, assembly_verdict, part_texts, parts_of, unsaid
from fcdm_opt.show.contact_faces import with_whole_faces
from fcdm_opt.show.rendering import whole_page
from fcdm_opt.show.report.cases import beyond_stack, picture_of, size_rows, stack_reports
from fcdm_opt.show.report.frames import assembly_scene
from fcdm_opt.show.report.gather import made
from fcdm_opt.show.scene import scene_pieces
from fcdm_opt.show.studies import axis_text, study_figure
from fcdm_opt.show.verdict import length_text

Data = Mapping[str, Any]

FIGURES = (  # what the scripts draw of a case; all else is text
    *("file", "name", "scene", "feature_shapes", "labels", "axes", "nominal", "tolerance_box", "signs", "quadrant"),
    *("tracking", "poses", "families", "unit", "amount_unit", "bodies", "off_drawn"),
)

MOST_POINTS, MOST_ROWS, MOST_VALUES = 10_000, 500, 40
"""Points that the chart holds, rows of the printed table, and values of an axis that are listed."""

FEW = 4  # values that are listed even where they are a grid

COLUMNS = {
    "draw": "number of the draw", "pair_state": "parts made are", "features": "what touches", "stage": "settled by",
    "active": "what holds the motion", "message": "remark",
}  # fmt: skip
LENGTHS = {"amount": "amount", "lower_bound": "proved at least", "pair_gap": "gap of the parts made"}
"""What columns of a study are called, and those of lengths."""

ALWAYS = ("lower_bound", "pair_gap", "pair_state", "features", "active", "stage", "message")
"""Columns of a row besides what was varied, status, amount and the motion's parameters."""


def page(payload: Data) -> str:
    """Return the report of a payload, plain data as `gather` returns it, as one self-contained HTML text, in UTF-8.

    Text from the payload is escaped wherever it stands.
    """
    cases, files = payload["cases"], payload["files"]
    shared = _shared_stacks(cases, files)
    tabled = {cell["case"] for table in payload["matrices"] for cell in table["cells"].values()}
    return whole_page(
        "page.html",
        scripts=("curve.js", "scene.js", "page.js"),
        figures={"cases": [{key: case[key] for key in FIGURES} for case in cases]},
        title=payload["title"],
        note=payload["note"],
        cases=[{"number": number, "stacked": shared.get(number), **case} for number, case in enumerate(cases)],
        stacks=[*{own["id"]: own for own in shared.values()}.values()],
        files=files,
        matrices=payload["matrices"],
        listed=len(cases) > 1 and (len(payload["matrices"]) != 1 or any(k not in tabled for k in range(len(cases)))),
        unstacked=_unstacked(cases, files),
        signs=SIGNS,
        inputs=_inputs(files),
        versions=payload["made"].items(),
        made_at=payload["made"]["date"],
        tolerances=[(name, f"{value:g}", meaning) for name, value, meaning in payload["tolerances"]],
    )


def _shared_stacks(cases: Sequence[Data], files: Sequence[Data]) -> dict[int, Data]:
    """Return by the numbers of cases the stack-ups that several have, with identifier, cases, file, parts and notes."""
    known = list[tuple[Data, list[int]]]()
    for number, case in enumerate(cases):
        own = {key: value for key, value in (case["stack"] or {}).items() if key not in ("chart", "notes")}
        alike = next((numbers for other, numbers in known if other == own), None)
        if alike is not None:
            alike.append(number)
        elif "worst" in own:
            known.append((own, [number]))
    shared = dict[int, Data]()
    for _, numbers in (each for each in known if len(each[1]) > 1):
        names = texts.listed([cases[number]["name"] for number in numbers]) * (len(numbers) < len(cases))
        first = cases[numbers[0]]
        of = {"file": files[first["file"]], "parts": [body["name"] for body in first["bodies"][:2]]}
        of["notes"] = [*dict.fromkeys(note for number in numbers for note in cases[number]["stack"]["notes"])]
        shared |= {key: {**first["stack"], "id": f"stack-{numbers[0]}", "cases": names, **of} for key in numbers}
    return shared


def _unstacked(cases: Sequence[Data], files: Sequence[Data]) -> list[str]:
    """Return why cases have no stack-up, each reason once, with the names of its cases where these are not all."""
    known = dict[str, list[str]]()
    for case in cases:
        stack, unread = case["stack"] or {}, files[case["file"]].get("sizes_left")
        reasons = stack["notes"] if stack else [f"no sizes by name: {unread}"] if unread else []
        for reason in reasons if "worst" not in stack else ():
            known.setdefault(reason, []).append(case["name"])
    return [why if len(own) == len(cases) else f"{why} (cases {texts.listed(own)})" for why, own in known.items()]


def assembly_page(files: Sequence[Data], cases: Sequence[Data]) -> str:
    """Return the report on assemblies as one self-contained HTML text.

    `files` have each "file", "title", "note", "sha256", "meshes", the numbers of its "cases", and an "error" or None;
    `cases` are as `assembly_report` returns them.
    """
    of = {number: file for file in files for number in file["cases"]}
    sources = {file["file"]: (file["title"] or file["file"]) * (len(files) > 1) for file in files}
    firsts = ((file, cases[file["cases"][0]]) for file in files if file["cases"])  # as drawn: alike for all of a file
    stacks = [
        {**own, "file": file, "source": sources[file["file"]], "parts": case["parts"]}
        for file, case in firsts
        for own in case["stacks"]
    ]
    return whole_page(
        "assembly.html",
        scripts=("scene.js", "page.js"),
        figures={"cases": [case["figure"] for case in cases]},
        title="; ".join(file["title"] or file["file"] for file in files),
        files=[{"note": file["note"], "error": file.get("error")} for file in files],
        cases=[
            {"file": of[number], "source": sources[of[number]["file"]], "number": number, **case}
            for number, case in enumerate(cases)
        ],
        stacks=[{**own, "id": f"stack-{k}"} for k, own in enumerate(stacks)],
        arrows=ARROWS,
        inputs=_inputs(files),
        versions=(versions := made()).items(),
        made_at=versions["date"],
    )


def _inputs(files: Sequence[Data]) -> list[dict[str, Any]]:
    """Return each file with its note on one line, and after it the mesh files that it names."""
    inputs = list[dict[str, Any]]()
    for file in files:
        inputs.append({**file, "note": " ".join((file.get("note") or "").split())})
        inputs += [{**mesh, "title": f"mesh of {file['file']}", "note": None} for mesh in file.get("meshes") or ()]
    return inputs


def assembly_report(solution: AssemblySolution, name: str = "case-0") -> dict[str, Any]:
    """Return the data of one case of an assembly; `name` begins the identifiers of its pictures."""
    bodies, contacts = parts_of(solution)
    assembly, unit = solution.assembly, solution.assembly.unit
    pieces = scene_pieces(bodies, contacts=contacts, unit=unit)
    certificate, verdict, lines = solution.certificate, assembly_verdict(solution), unsaid(solution)
    if (why := solution.reason) and verdict[1:].startswith(why[1:]):  # what is to be done comes below
        verdict, lines = f"{solution.status.words}: {why}", [verdict[len(why) + 2 :], *lines]
    solved = zip(assembly.contacts if solution.contacts else (), solution.contacts, strict=True)
    return {
        **{key: getattr(assembly, key) for key in ("name", "parts", "unit")},
        "usable": solution.usable,
        "status": solution.status.name,
        "verdict": verdict,
        "figure": assembly_scene(solution, contacts, pieces),
        "picture": picture_of(pieces, name),
        "stacks": stack_reports(assembly, f"{name}-stack"),
        "moved": solution.usable and any(map(any, texts.values_by_part(solution).values())),
        "outside": texts.outcome_text(solution) * (solution.status.name == "OUTSIDE_FIT"),
        "outcome": barred_text(solution),
        "motion": motion if (motion := texts.motion_text(solution)) != "-" else "none",
        "amount": texts.seen_amount(solution) if solution.status.found else None,
        "amount_unit": unit,
        "pair_state": "all met" if solution.usable else "",
        "beyond": beyond_stack(assembly),
        "total": texts.amount_text(texts.seen_amount(solution), unit),
        "bound": texts.bound_line(solution),
        "passed": certificate.passed if certificate is not None and solution.status.found else None,
        "told": lines,
        "asked": texts.asked_text(assembly),
        "wanted": "",
        "limits": texts.limits_text(assembly),
        "sizes": size_rows(assembly),
        "motions": part_texts(solution),
        "contacts": [
            (f"{pair.one} - {pair.two}", texts.goal_text(own.problem), _touching(own), gap_state(own))
            for pair, own in solved
        ],
        "stages": solution.stages,
        "checks": certificate.checks if certificate is not None else (),
    }


def gap_state(solution: Solution) -> str:
    """Return how a contact is: "touching", "apart 0.15 mm, at least 0.01 mm required", "overlapping 0.2 mm"."""
    problem, state = solution.problem, solution.pair_state
    off = state not in ("", "touching") and np.isfinite(solution.pair_gap)
    text = f"{state} {length_text(problem, abs(solution.pair_gap))}" if off else state or "-"
    return f"{text}, at least {length_text(problem, problem.clearance)} required" if problem.clearance else text


def _touching(solution: Solution) -> str:
    """Return what touches, in words; of the solution's own bodies, which may be exact at points of round faces."""
    one, two = solution.problem.movable, solution.problem.static
    features = with_whole_faces(solution.problem, solution.features, solution.transform)
    pairs = ((element_text(one, own.one), element_text(two, own.two)) for own in features)
    return "; ".join(dict.fromkeys(f"{mine} at {its}" for mine, its in pairs)) or "-"


def study_page(result: StudyResult) -> str:
    """Return the report on a study, complete or not, as one self-contained HTML text, in UTF-8.

    The chart holds 10,000 points at most, evenly chosen, the table 500; both say so.
    """
    rows = result.rows()
    count = len(rows)
    varied, columns = _columns(result, rows)
    fewer = (min(count, most) for most in (MOST_POINTS, MOST_ROWS))
    charted, printed = ([k * count // some for k in range(some)] for some in fewer)
    definition = {key: value for key, value in result.definition.items() if key not in ("title", "note", "axes")}
    words = COLUMNS | {name: f"{text} ({result.unit or 'length units'})" for name, text in LENGTHS.items()}
    words |= {name: axis_text(name) for name in varied if name not in COLUMNS}
    words |= {name: f"{name} (radians)" for name in result.angles}
    return whole_page(
        "study.html",
        scripts=("study.js",),
        figures={
            "words": words,
            "columns": columns,
            "varied": varied,
            "rows": [[finite(rows[k][name]) for name in columns] for k in charted],
            "usable": [bool(rows[k]["usable"]) for k in charted],
            "unanswered": (unanswered := _unanswered(result, rows)),
            "numbers": list(charted),
            "of": count,
            "budget": result.definition.get("budget"),
            "unit": result.unit,
        },
        title=result.definition.get("title") or "Study",
        note=result.definition.get("note"),
        summary=[(name.capitalize(), *row) for name, *row in texts.study_facts(result)],
        unanswered=unanswered.values(),
        picture=inline_svg(study_figure(result), "picture"),
        varied=[_varied(label, values) for label, values in result.axes.items()],
        caption=f"{count} points" if count <= MOST_ROWS else f"{MOST_ROWS} of {count} points, evenly chosen",
        heads=("number", *(words.get(name, name) for name in columns)),
        rows=[(str(k), *(_cell(name, finite(rows[k][name])) for name in columns)) for k in printed],
        study=result.study,
        versions=[("rows worked out by fcdm_opt", result.version), *made().items()],
        definition=json.dumps(definition, indent=1, ensure_ascii=False),
    )


def _unanswered(result: StudyResult, rows: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Return of each status that is no answer how many points have it, and what the first of them says."""
    first = {row["status"]: row["message"] or "" for row in reversed(rows) if row["status"] not in Status.__members__}
    return {
        status: f"{count} without an answer, {texts.status_text(status)}{': ' * bool(first[status])}{first[status]}"
        for status, count in result.counts.items()
        if status in first
    }


def _columns(result: StudyResult, rows: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[str]]:
    """Return the columns that hold what was varied, and all of chart and table: with them what was found, the motion.

    A row holds its number, what was varied, status and amounts, the motion, then all else.
    """
    if not rows:
        return list(result.axes), []
    names = list(rows[0])
    varied = names[names.index("number") + 1 : names.index("status")]
    motion = names[names.index("lower_bound") + 1 : names.index("rho_1")]
    return varied, [*varied, "status", "amount", *motion, *(name for name in ALWAYS if name in rows[0])]


def _varied(label: str, values: Sequence[Any]) -> tuple[str, str, str]:
    """Return what was varied, how many values it took, and which: of a grid its ends."""
    text, count = axis_text(label), str(len(values))
    if label == DRAW:
        return "parts drawn at random", count, "from the distributions in the definition below"
    if len(values) > FEW and all(type(value) in (int, float) for value in values) and [*values] == sorted(values):
        return text, count, f"{texts.shown(values[0])} to {texts.shown(values[-1])}"
    some = [
        f"({texts.shown(value)})" if isinstance(value, list | tuple) else texts.shown(value)
        for value in values[:MOST_VALUES]
    ]
    more = f" and {len(values) - MOST_VALUES} more" if len(values) > MOST_VALUES else ""
    return text, count, ", ".join(some) + more


def _cell(name: str, value: Any) -> str:
    """Return a value as the table shows it, a bound never rounded up."""
    return floored(value, 6) if name == "lower_bound" and value and value > 0 else texts.shown(value)
