"""The report as one HTML text: what the template `page.html` shows, as plain values and texts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fcdm_opt.problem.problem import SIGNS
from fcdm_opt.show.rendering import whole_page
from fcdm_opt.show.texts import shown

Data = Mapping[str, Any]

FIGURES = (  # what the scripts draw of a case; all else is text
    *("file", "name", "scene", "feature_shapes", "labels", "axes", "nominal", "tolerance_box", "signs", "quadrant"),
    *("tracking", "poses", "families", "unit", "amount_unit"),
)
POSES = {"nominal": "nominal", "rescaled": "re-scaled, at rest", "corrected": "corrected", "tracked": "tracked sizes"}
UNREMARKABLE = ("SOLVED", "ALREADY_SATISFIED")  # statuses whose advice says no more than the answer
MINUS = "\u2212"
LAYOUT = (("A", "C"), ("B", "D"))
"""Requirements as in the paper's tables: rho_1 larger on the left, rho_2 larger above."""

OPTIONAL = (
    *("unit", "amount_unit", "doubt", "published", "touch_amount", "pair_state", "pair_gap", "pair", "rho", "note"),
    *("certificate", "evidence", "sensitivities", "sha256", "tracking", "verified", "bound_text", "lower_bound", "gap"),
    *("advice", "stage", "configurations", "bound", "parameters", "modelled", "left_out", "seconds", "active"),
)
"""What a case or a cell of a table may leave out."""


def page(payload: Data) -> str:
    """Return the report of a payload (`fcdm_opt.show.report.gather`) as one self-contained HTML text.

    Parameters
    ----------
    payload : mapping
        What `gather` returns: plain data without NaN.

    Returns
    -------
    str
        HTML5, UTF-8. Text from the payload is escaped wherever it stands.
    """
    cases, files = payload["cases"], payload["files"]
    inputs = []
    for file in files:
        inputs.append({**file, "note": " ".join((file.get("note") or "").split())})
        inputs += [{**mesh, "title": f"mesh of {file['file']}", "note": None} for mesh in file.get("meshes") or ()]
    figures = []
    for case in cases:
        bodies = [{key: body[key] for key in ("name", "role")} for body in case["bodies"]]
        figures.append({**{key: case.get(key) for key in FIGURES}, "bodies": bodies})
    return whole_page(
        "page.html",
        scripts=("curve.js", "scene.js", "page.js"),
        figures={"cases": figures},
        title=payload["title"],
        note=payload.get("note"),
        unread=[file for file in files if file.get("error")],
        cases=[_case(case, number, files[case["file"]], len(files) > 1) for number, case in enumerate(cases)],
        files=[{"cases": (), **file} for file in files],
        matrices=[_matrix(matrix) for matrix in payload["matrices"]],
        poses=POSES,
        inputs=inputs,
        versions=[(name, shown(value)) for name, value in payload["made"].items()],
        tolerances=[(name, shown(value), meaning) for name, value, meaning in payload["tolerances"]],
    )


def _answer(data: Data) -> dict[str, Any]:
    """Return a case or a cell with all that it may leave out, and its bound as tables show it, with how near it is."""
    known = {**dict.fromkeys(OPTIONAL), **data}
    text, _, near = shown(known["bound_text"]).partition(", ")
    if near == "exact":  # the amount, to the digits that it is shown with
        text = shown(known["amount"])
    return {**known, "least": {"text": text, "near": near}, "outside": known["status"] == "OUTSIDE_FIT"}


def _case(data: Data, number: int, file: Data, several: bool) -> dict[str, Any]:
    """Return what the page says of a case; the file that it is from is named where there are several."""
    case = _answer(data)
    advice = [] if case["status"] in UNREMARKABLE else [case["advice"]]
    bars = case["sensitivities"]["bars"] if case["sensitivities"] else []
    longest = max((abs(bar["value"]) for bar in bars if bar["value"] is not None), default=0.0) or 1.0
    widths = [50.0 * (bar["value"] or 0.0) / longest for bar in bars]  # percent, left of the middle less
    return {
        **case,
        "number": number,
        "source": (file["title"] or file["file"]) if several else "",
        "told": [*advice, *case.get("remarks", ())],
        "bars": [{**bar, "left": 50.0 + min(x, 0.0), "width": abs(x)} for bar, x in zip(bars, widths, strict=True)],
    }


def _matrix(matrix: Data) -> dict[str, Any]:
    """Return the requirements A to D in rows, as in the paper's Tables 1 and 2."""
    rows = [
        (sign, [_cell(letter, matrix["cells"].get(letter)) for letter in letters])
        for sign, letters in zip(("+", MINUS), LAYOUT, strict=True)
    ]
    return {**matrix, "rows": rows}


def _cell(letter: str, cell: Data | None) -> dict[str, Any]:
    signs = ",".join("+" if sign > 0 else MINUS for sign in SIGNS[letter])
    head = {"letter": letter, "signs": signs, "asked": bool(cell), "number": (cell or {}).get("case")}
    return {**_answer(cell or {"amount": None, "status": ""}), **head}
