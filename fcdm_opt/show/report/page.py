"""The report as one HTML text: everything readable stands in it; scripts only draw the figures.

Tables, certificates and answers of all cases are written here, so that the page can be read, searched and printed
without JavaScript. plotly.js and the figures' data are embedded compressed; nothing is fetched.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Any

from fcdm_opt.geometry.units import measured
from fcdm_opt.problem.problem import SIGNS
from fcdm_opt.show.report.markup import NONE, facts, folded, paragraphs, shown, table, whole_page, yes_no

Data = Mapping[str, Any]

FIGURES = (  # what the scripts draw of a case; all else is text and written here
    *("file", "name", "scene", "feature_shapes", "labels", "axes", "nominal", "tolerance_box", "signs", "quadrant"),
    *("tracking", "poses", "families", "unit", "amount_unit"),
)
POSES = {
    "nominal": "nominal",
    "rescaled": "re-scaled, at rest",
    "corrected": "corrected",
    "tracked": "tracked sizes",
}
SCRIPTS = ("curve.js", "scene.js", "page.js")
OUTSIDE = "OUTSIDE_FIT"
MISSING = "motion found"  # the check that fails where there is no motion to judge
UNREMARKABLE = ("SOLVED", "ALREADY_SATISFIED")  # statuses whose advice says no more than the answer
MINUS = "\u2212"
LAYOUT = (("A", "C"), ("B", "D"))
"""Requirements as in the paper's tables: rho_1 larger on the left, rho_2 larger above."""


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
    cases = payload["cases"]
    placed = [(case, number, _source(case, payload["files"])) for number, case in enumerate(cases)]
    return whole_page(
        "page.html",
        {
            "notices": _notices(payload["files"]),
            "answers": "\n".join(_answer(*each) for each in placed),
            "alone": "hidden" if len(cases) < 2 and not payload["matrices"] else "",
            "chooser": _chooser(payload),
            "matrices": "\n".join(_matrix(matrix, cases) for matrix in payload["matrices"]),
            "poses": _pose_buttons(),
            "details": "\n".join(_details(*each) for each in placed),
            "about": _about(payload),
        },
        title=payload["title"],
        note=payload.get("note"),
        scripts=SCRIPTS,
        figures={"cases": [_figures(case) for case in cases]},
    )


def _figures(case: Data) -> dict[str, Any]:
    bodies = [{key: body[key] for key in ("name", "role")} for body in case["bodies"]]
    return {**{key: case.get(key) for key in FIGURES}, "bodies": bodies}


def _words(status: str) -> str:
    return escape(status.lower().replace("_", " "))


# --------------------------------------------------------------------------------------------- what was asked and found


def _source(case: Data, read: Sequence[Data]) -> str:
    """Return which file a case is from, where there are several."""
    file = read[case["file"]]
    return f'<p class="source">{escape(file["title"] or file["file"])}</p>\n' if len(read) > 1 else ""


def _answer(case: Data, number: int, source: str) -> str:
    """Return a case's question in one sentence and its answer in big letters."""
    found = (
        ("Amount", _amount(case)),
        ("Proved at least", _bound(case)),
        ("Pair made", _made(case)),
        ("Verified", _verified(case)),
    )
    if case.get("amount") is None:
        answer = f'<p class="big nothing">No motion: {_words(case["status"])}</p>'
    elif case["status"] == OUTSIDE:
        answer = f'<p class="big nothing">Outside the fit: {escape(case["motion"])}</p>'
    else:
        answer = f'<p class="big">{escape(case["motion"])}</p>'
    said = [] if case["status"] in UNREMARKABLE else [case.get("advice")]
    advice = "".join(f'<p class="advice">{shown(text)}</p>' for text in [*said, *case.get("remarks", ())])
    return (
        f'<article class="answer" data-case="{number}">\n'
        f'{source}<h2><span class="quiet">Case</span> {escape(case["name"])}</h2>\n'
        f'<p class="asked">{_question(case)}</p>\n{answer}\n{facts(found)}{advice}</article>'
    )


def _question(case: Data) -> str:
    names = [escape(body["name"]) for body in case["bodies"][:2]]
    bodies = f"<b>{names[0]}</b> against <b>{names[1]}</b>" if len(names) == 2 else "the movable body"
    asked = escape(case["asked"])
    what = asked if asked.startswith("target") else f"requirement {asked}"
    return f"Asked: the least motion of {bodies} for {what}, goal \u201c{escape(case['goal'])}\u201d."


def _amount(case: Data) -> str:
    text = _in(case, "amount_unit", shown(case.get("amount")))
    if case.get("doubt"):
        text += f"<small>{escape(case['doubt'])}</small>"
    if published := case.get("published"):
        amount = _in(case, "amount_unit", shown(published.get("amount")))
        text += f"<small>published: {amount}, {shown(published.get('motion'))}</small>"
    if case.get("touch_amount") is not None:
        least = _in(case, "amount_unit", shown(case["touch_amount"]))
        text += f"<small>least for goal \u201ctouch\u201d: {least}</small>"
    return text


def _in(data: Data, key: str, text: str) -> str:
    """Return a number in a unit that a case or cell names, alone where it names none or there is no number."""
    return text if text in (NONE, "impossible") else measured(text, escape(data.get(key) or ""))


def _bound(case: Data) -> str:
    """Return the lower bound as the tables show it, rounded down, and how near it is; where it is the amount, that."""
    bound, _, gap = shown(case.get("bound_text")).partition(", ")
    if gap == "exact":
        bound = shown(case["amount"])
    return _in(case, "amount_unit", bound) + (f"<small>{gap}</small>" if gap else "")


def _made(case: Data) -> str:
    state, gap, pair = case.get("pair_state"), case.get("pair_gap"), case.get("pair")
    if not state:
        return NONE
    if gap is None:
        text = escape(state)
    elif state == "touching":
        text = f"touching<small>gap {_in(case, 'unit', f'{gap:.2g}')}</small>"
    else:
        text = f'{escape(state)} by <span class="whole">{_in(case, "unit", f"{abs(gap):.3g}")}</span>'
    pose = "at rest, " if case.get("amount") is None else ""
    return text + (f"<small>{pose}at \u03c1 = ({shown(pair)})</small>" if pair else "")


def _verified(case: Data) -> str:
    checks = (case.get("certificate") or {}).get("checks", ())
    if case.get("amount") is None:
        proved = (case.get("evidence") or {}).get("checked")
        return yes_no(proved, "proof checked", "no", "nothing to verify")
    passed = False if case["status"] == OUTSIDE else (case.get("certificate") or {}).get("passed")
    verdict = yes_no(passed, no="outside the fit" if case["status"] == OUTSIDE else "no", neither="not judged")
    held = sum(bool(check["passed"]) for check in checks)
    return verdict + (f"<small>{held} of {len(checks)} checks hold</small>" if checks else "")


def _chooser(payload: Data) -> str:
    """Return the list to choose a case from, grouped by file."""
    cases, several = payload["cases"], len(payload["files"]) > 1
    groups = []
    for file in payload["files"]:
        options = "".join(
            f'<option value="{k}">{escape("{name}: {asked}, {goal}".format_map(cases[k]))}</option>'
            for k in file.get("cases") or ()
        )
        groups.append(
            f'<optgroup label="{escape(file["title"] or file["file"])}">{options}</optgroup>' if several else options
        )
    return "".join(groups)


def _matrix(matrix: Data, cases: Sequence[Data]) -> str:
    """Return the requirements A to D as in the paper's Tables 1 and 2; cells choose their case."""
    told = re.sub(r"rho_([12])", "\u03c1<sub>\\1</sub>", escape(matrix.get("tolerance") or ""))
    tolerance = f", tolerance {told}" if told else ""
    rows = "".join(
        f'<tr><th scope="row">\u03c1<sub>2</sub> {sign}\u03c4</th>'
        + "".join(_cell(letter, matrix["cells"].get(letter), cases) for letter in letters)
        + "</tr>\n"
        for sign, letters in zip(("+", MINUS), LAYOUT, strict=True)
    )
    return (
        f'<table class="matrix" data-file="{matrix["file"]}">'
        f"<caption>Requirements: {escape(matrix['title'])}{tolerance}</caption>"
        '<thead><tr><td></td><th scope="col">\u03c1<sub>1</sub> +\u03c4</th>'
        f'<th scope="col">\u03c1<sub>1</sub> \u2212\u03c4</th></tr></thead><tbody>\n{rows}</tbody></table>'
    )


def _cell(letter: str, cell: Data | None, cases: Sequence[Data]) -> str:
    signs = ",".join("+" if sign > 0 else MINUS for sign in SIGNS[letter])
    head = f'<span class="letter">{letter}</span> <span class="signs">({signs})</span>'
    if not cell:
        return f'<td class="unasked">{head}<span class="line">not asked</span></td>'
    if cell.get("amount") is None:
        lines = [("motion", f"no motion: {_words(cell.get('status') or 'not found')}")]
    else:
        amount = _in(cell, "amount_unit", shown(cell["amount"]))
        lines = [("motion", escape(cell["motion"])), ("amounts", f"amount {amount}")]
        if cell.get("doubt"):
            lines.append(("amounts", escape(cell["doubt"])))
    if cell.get("bound") and cell.get("amount"):
        lines.append(("amounts", f"proved \u2265 {_bound(cell).partition('<')[0]}"))
    if cell.get("published"):
        lines.append(("published", f"published: {escape(cell['published'])}"))
    if cell.get("pair_state") and cell.get("amount") is not None:
        unusable = "outside the fit" if cell.get("status") == OUTSIDE else "not verified"
        verified = yes_no(cell.get("verified"), "verified", unusable, "not judged")
        lines.append(("state", f"pair made {escape(cell['pair_state'])}, {verified}"))
    if cell.get("note"):
        lines.append(("made", escape(cell["note"])))
    inside = head + "".join(f'<span class="line {kind}">{text}</span>' for kind, text in lines)
    number = cell.get("case")
    if number is None:
        return f'<td class="unasked">{inside}</td>'
    name = escape(cases[number]["name"])
    return f'<td><a href="#case-{number}" data-case="{number}" aria-label="Show case {name}">{inside}</a></td>'


def _pose_buttons() -> str:
    return "".join(
        f'<label><input type="radio" name="pose" value="{pose}"><span>{words}</span></label>'
        for pose, words in POSES.items()
    )


# ------------------------------------------------------------------------------------------------- a case in all detail


def _details(case: Data, number: int, source: str) -> str:
    """Return everything there is to read about a case."""
    parts: tuple[Callable[[Data], str], ...] = (_sensitivities, _modelled, _certificate, _record)
    name = escape(case["name"])
    return (
        f'<article class="case" id="case-{number}" data-case="{number}" tabindex="-1">\n'
        f'{source}<h2><span class="quiet">Details of case</span> {name}</h2>\n'
        + "\n".join(part(case) for part in parts)
        + "\n</article>"
    )


def _sensitivities(case: Data) -> str:
    """Return the derivatives of the amount as a bar chart that is a table."""
    found = case.get("sensitivities")
    if not found:
        return ""
    longest = max((abs(bar["value"]) for bar in found["bars"] if bar["value"] is not None), default=0.0) or 1.0

    def bar(value: float | None) -> str:
        if value is None:
            return ""
        share = 50.0 * abs(value) / longest
        left = 50.0 - share if value < 0 else 50.0
        side = "less" if value < 0 else "more"
        return f'<span class="bar {side}" style="left:{left:.2f}%;width:{share:.2f}%"></span>'

    rows = [
        (
            escape(b["name"]),
            f'<span class="track">{bar(b["value"])}</span>',
            (f"{b['value']:+.4g}" if b["value"] else shown(b["value"])),
            f"{shown(b.get('unit') or '')}<small>{escape(b.get('note') or '')}</small>",
        )
        for b in found["bars"]
    ]
    caption = "What the amount depends on: left of the middle less, right of it more"
    amount = f"amount, {case['amount_unit']}" if case.get("amount_unit") else "amount"
    chart = table(caption, ("change", "effect on the amount", amount, "per"), rows, (2,))
    return f'<section class="bars"><h3>Sensitivities</h3>{paragraphs(found.get("text"))}{chart}</section>'


def _modelled(case: Data) -> str:
    """Return what the solution rests on, and what it leaves out."""
    rows = [
        (escape(row["what"]), shown(row.get("kept")), shown(row.get("total"))) for row in case.get("modelled") or ()
    ]
    left = "".join(f"<li>{escape(text)}</li>" for text in case.get("left_out") or ())
    bodies = [
        (
            escape(body["name"]),
            *(shown(body.get(key)) for key in ("role", "vertices", "parts", "seed", "deviation")),
            "; ".join(escape(str(note)) for note in body.get("notes") or ()) or NONE,
        )
        for body in case["bodies"]
    ]
    unit = f", lengths in {case['unit']}" if case.get("unit") else ""
    heads = ("body", "role", "vertices", "convex parts", "seed", "deviation", "notes")
    return (
        '<section><h3>Modelled and left out</h3><div class="pair"><div><h4>Modelled</h4>'
        f"{table('How much of the scene was needed', ('what', 'kept', 'of all'), rows, (1, 2))}</div>"
        f"<div><h4>Left out</h4><ul>{left or '<li>nothing named</li>'}</ul></div></div>"
        f"{table(f'Bodies as read{unit}', heads, bodies, (2, 3))}</section>"
    )


def _certificate(case: Data) -> str:
    """Return the judge's checks and the evidence of the bound."""
    certificate, evidence = case.get("certificate"), case.get("evidence")
    if certificate:
        rows = [
            (
                escape(check["name"]),
                shown(check.get("value"), 4),
                shown(check.get("limit"), 4),
                yes_no(None if check["name"] == MISSING else bool(check["passed"]), neither="no motion"),
                escape(check.get("note") or ""),
            )
            for check in certificate["checks"]
        ]
        passed = certificate["passed"] if case.get("amount") is not None else None
        verdict = yes_no(passed, "Every check holds.", "A check fails.", "No motion was found; checks of the proof:")
        checks = table("Checks of the judge", ("check", "value", "limit", "holds", "what it means"), rows, (1, 2))
        text = f'<p class="verdict">{verdict}</p>{checks}'
    else:
        text = "<p>No motion was judged.</p>"
    least = _in(case, "amount_unit", shown(case.get("lower_bound"), 17))
    bounds = [
        ("Amount found", _in(case, "amount_unit", shown(case.get("amount"), 17))),
        ("Proved at least", "impossible" if _bound(case) == "impossible" else least),
        ("Relative gap", shown(case.get("gap"), 3)),
    ]
    proof = ""
    if evidence:
        bounds.append(("Checked again", yes_no(evidence.get("checked"), neither="no")))
        proof = paragraphs(evidence.get("text"))
    return f"<section><h3>Certificate</h3>{text}<h4>Bounds and their evidence</h4>{facts(bounds)}{proof}</section>"


def _record(case: Data) -> str:
    """Return pair, features and times: what another run can be compared with."""
    parameters = [
        (escape(p["name"]), shown(p["value"], 12), shown(p.get("unit")), shown(p.get("shown")))
        for p in case.get("parameters") or ()
    ]
    known = (
        ("Status", escape(case["status"])),
        ("Advice", shown(case.get("advice"))),
        ("Stage", shown(case.get("stage"))),
        ("Pair made", f"({shown(case.get('pair'), 9)})"),
        ("Tracked pair", f"({shown(case.get('rho'), 9)})" if case.get("tracking") and case.get("rho") else NONE),
        ("Features", "<br>".join(map(escape, case.get("features") or ())) or NONE),
        ("Configuration", shown(case.get("configurations"))),
        ("Active", shown(list(case.get("active") or ()))),
        ("Seconds", ", ".join(f"{escape(k)} {shown(v, 3)}" for k, v in (case.get("seconds") or {}).items()) or NONE),
        ("SHA-256 of the problem", f"<code>{shown(case.get('sha256'))}</code>"),
    )
    motion = table("Parameters", ("parameter", "value", "unit", "shown"), parameters, (1,))
    return f"<section><h3>Record</h3>{motion}{facts(known)}</section>"


# ------------------------------------------------------------------------------------------------------- about this run


def _notices(read: Sequence[Data]) -> str:
    """Return what could not be read: first thing to know."""
    items = [f"<li><b>{escape(file['file'])}</b>: {escape(file['error'])}</li>" for file in read if file.get("error")]
    return f'<div class="notice" role="note"><p>Not solved:</p><ul>{"".join(items)}</ul></div>' if items else ""


def _about(payload: Data) -> str:
    """Return inputs with their hashes, versions and tolerances."""
    inputs = [
        (
            escape(file["file"]),
            f"{shown(file.get('title'))}<small>{escape(' '.join((file.get('note') or '').split()))}</small>",
            f"<code>{shown(file.get('sha256'))}</code>",
        )
        for file in payload["files"]
    ]
    inputs += [
        (escape(mesh["file"]), f"mesh of {escape(file['file'])}", f"<code>{shown(mesh.get('sha256'))}</code>")
        for file in payload["files"]
        for mesh in file.get("meshes") or ()
    ]
    versions = [(escape(name), shown(value)) for name, value in payload["made"].items()]
    tolerances = [(escape(name), shown(value), escape(meaning)) for name, value, meaning in payload["tolerances"]]
    return (
        table("Inputs", ("file", "title and note", "SHA-256"), inputs)
        + table("Made with", ("what", "version"), versions)
        + folded(
            f"Tolerances ({len(tolerances)})",
            table("Relative tolerances and their reasons", ("tolerance", "value", "meaning"), tolerances, (1,)),
        )
    )
