"""The report on a study as one HTML text: its points as a chart to walk through, and what was found for each."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from fcdm_opt.geometry.units import floored, measured
from fcdm_opt.show.report.gather import made
from fcdm_opt.show.report.markup import facts, folded, shown, table, whole_page

if TYPE_CHECKING:
    from fcdm_opt.design.study.results import StudyResult

MOST_POINTS, MOST_ROWS, MOST_VALUES = 10_000, 500, 40
"""Points that the chart holds, rows of the printed table, and values of an axis that are listed."""

ALWAYS = ("status", "amount", "lower_bound", "pair_gap", "pair_state", "features", "active", "stage", "message")
"""Columns of a row besides what was varied and the motion's parameters."""


def study_page(result: StudyResult) -> str:
    """Return the report on a study as one self-contained HTML text.

    Parameters
    ----------
    result : StudyResult
        May be one of a run that is not complete.

    Returns
    -------
    str
        HTML5, UTF-8. The chart holds 10,000 points at most, evenly chosen, the table 500; both say so.
    """
    rows = result.rows()
    columns = _columns(result, rows)
    kept = _evenly(len(rows), MOST_POINTS)
    data = {
        "columns": columns,
        "varied": _varied(result, rows),
        "rows": [[_plain(rows[k][name]) for name in columns] for k in kept],
        "usable": [bool(rows[k]["usable"]) for k in kept],
        "numbers": list(kept),
        "of": len(rows),
        "budget": result.definition.get("budget"),
        "unit": result.unit,
    }
    return whole_page(
        "study.html",
        {
            "summary": facts(_summary(result, rows)),
            "picture": _picture(result),
            "varied": _axes_table(result),
            "rows": _rows_table(rows, columns),
            "about": _about(result),
        },
        title=result.definition.get("title") or "Study",
        note=result.definition.get("note"),
        scripts=("study.js",),
        figures=data,
    )


def _summary(result: StudyResult, rows: Sequence[Mapping[str, Any]]) -> list[tuple[str, str]]:
    amounts = sorted(row["amount"] for row in rows if row["usable"])
    counts = ", ".join(f"{count} {escape(status)}" for status, count in result.counts.items())
    told = [("Points", f"{len(rows)}<small>{counts}</small>")]
    if amounts:
        middle = f"<small>the middle one {shown(amounts[len(amounts) // 2])}</small>"
        unit = result.unit or "length units"
        told.append((f"Amounts ({unit})", f"{shown(amounts[0])} to {shown(amounts[-1])}{middle}"))
    if (found := result.assembly_yield) is not None:
        low, high = found.interval
        told.append(
            (
                f"Yield within {measured(f'{found.budget:g}', result.unit)}",
                f"{found.share:.2%}<small>{found.within} of {found.of}; "
                f"{found.confidence:.0%} interval {low:.2%} to {high:.2%}</small>",
            )
        )
    if result.seconds:
        parts = ", ".join(f"{escape(name)} {value:.3g}" for name, value in result.seconds.items() if name != "point")
        told.append(("Working time", f"{result.seconds.get('point', 0.0):.3g} s<small>{parts}</small>"))
    return told


def _varied(result: StudyResult, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the columns that hold what was varied: those between a row's number and its status."""
    names = list(rows[0]) if rows else []
    return names[names.index("number") + 1 : names.index("status")] if rows else list(result.axes)


def _columns(result: StudyResult, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the columns of chart and table: what was varied, what was found, the motion."""
    if not rows:
        return []
    names = list(rows[0])
    motion = names[names.index("lower_bound") + 1 : names.index("rho_1")]
    return [*_varied(result, rows), "status", "amount", *motion, *(name for name in ALWAYS[2:] if name in rows[0])]


def _plain(value: Any) -> Any:
    """Return a value that JSON has."""
    return value if not isinstance(value, float) or math.isfinite(value) else None


def _evenly(count: int, most: int) -> Iterable[int]:
    return range(count) if count <= most else [k * count // most for k in range(most)]


def _picture(result: StudyResult) -> str:
    """Return the study's picture as SVG in the page."""
    from matplotlib import rc_context

    from fcdm_opt.show.studies import study_figure

    text = io.StringIO()
    with rc_context({"svg.hashsalt": "fcdm_opt", "svg.fonttype": "none"}):
        study_figure(result).savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    drawn = text.getvalue()
    return drawn[drawn.index("<svg") :]


def _axes_table(result: StudyResult) -> str:
    rows = []
    for label, values in result.axes.items():
        some = [f"({shown(own)})" if isinstance(own, list | tuple) else shown(own) for own in values[:MOST_VALUES]]
        more = f" and {len(values) - MOST_VALUES} more" if len(values) > MOST_VALUES else ""
        rows.append((escape(label), str(len(values)), ", ".join(some) + more))
    return table("What was varied", ("key", "values", ""), rows, numbers=(1,))


def _rows_table(rows: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> str:
    kept = _evenly(len(rows), MOST_ROWS)
    caption = f"{len(rows)} points" if len(rows) <= MOST_ROWS else f"{MOST_ROWS} of {len(rows)} points, evenly chosen"
    body = ((str(k), *(_cell(name, _plain(rows[k][name])) for name in columns)) for k in kept)
    return table(caption, ("number", *columns), body)


def _cell(name: str, value: Any) -> str:
    """Return a value as the table shows it, a bound never rounded up."""
    return floored(value, 6) if name == "lower_bound" and value and value > 0 else shown(value)


def _about(result: StudyResult) -> str:
    definition = {key: value for key, value in result.definition.items() if key not in ("title", "note", "axes")}
    text = json.dumps(definition, indent=1, ensure_ascii=False)
    versions = [("rows worked out by fcdm_opt", result.version), *made().items()]
    return (
        facts([("Study (SHA-256 of its definition and all that it reads)", f"<code>{escape(result.study)}</code>")])
        + table("Made with", ("what", "version"), [(escape(k), escape(v)) for k, v in versions])
        + folded("Definition", f"<pre>{escape(text)}</pre>")
    )
