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
MINUS = "\u2212"


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
        cases=[{"number": number, **case} for number, case in enumerate(cases)],
        files=[{"cases": (), **file} for file in files],
        matrices=payload["matrices"],
        signs={letter: ",".join("+" if sign > 0 else MINUS for sign in pair) for letter, pair in SIGNS.items()},
        poses=POSES,
        inputs=inputs,
        versions=[(name, shown(value)) for name, value in payload["made"].items()],
        tolerances=[(name, shown(value), meaning) for name, value, meaning in payload["tolerances"]],
    )
