"""Small pieces of HTML: values, tables and packed data, for pages that are one file.

Arguments are plain text unless said otherwise; what is returned is HTML.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from html import escape
from importlib.resources import files
from typing import Any

from fcdm_opt.errors import InputError

NONE = "\u2013"
"""An en dash, where there is no value."""


def filled(template: str, slots: Mapping[str, str]) -> str:
    """Return a template with all its `{{slots}}` filled, in one pass: what is filled in is never searched for slots."""
    return re.sub(r"\{\{(\w+)\}\}", lambda found: slots[found[1]], template)


def asset(name: str) -> str:
    """Return the text of a file beside this module, in `assets`."""
    return files(__package__).joinpath("assets", name).read_text(encoding="utf-8")


def packed(text: str) -> str:
    """Return gzip + base64 of a text; the same text gives the same characters."""
    return base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode()


@cache
def _plotly() -> str:
    """Return the source of plotly.js."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as reason:
        what = f"plotly cannot be loaded ({reason}), whose script draws the figures; install it with pip install plotly"
        raise InputError(what, key="report") from reason
    return get_plotlyjs()


@cache
def embedded_plotly() -> str:
    """Return plotly.js as `packed` gives it; raises `InputError` where it is not installed."""
    return packed(_plotly())


@cache
def plotly_licence() -> str:
    """Return the notice at the head of plotly.js and its licence, for a comment of the page."""
    source = _plotly()
    notice = source[source.index("/*") + 2 : source.index("*/")].replace("--", "- -")
    return filled(asset("plotly-licence.txt"), {"licence": escape(notice, quote=False)})


def whole_page(
    body: str, slots: Mapping[str, str], *, title: str, note: str | None, scripts: Sequence[str], figures: Any
) -> str:
    """Return a page that is one file, with plotly.js, scripts and what they draw inside it.

    Parameters
    ----------
    body : str
        Asset with what stands in the page's body.
    slots : mapping of str to str
        HTML for its slots, besides title and note.
    title, note : str
        Plain text.
    scripts : sequence of str
        Assets, joined in this order after "common.js".
    figures : plain data
        What the scripts read, as `JSON.parse` gives it.
    """
    head = {"title": escape(title), "note": paragraphs(note)}
    return filled(
        asset("frame.html"),
        {
            **head,
            "body": filled(asset(body), {**slots, **head}),
            "css": asset("page.css"),
            "js": "\n".join(map(asset, ("common.js", *scripts))),
            "licence": plotly_licence(),
            "plotly": embedded_plotly(),
            "figures": packed(json.dumps(figures, allow_nan=False, separators=(",", ":"))),
        },
    )


def shown(value: Any, digits: int = 6) -> str:
    """Return a value of JSON: numbers with so many digits, lists with commas, an en dash for nothing."""
    if value is None or value == "":
        return NONE
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.{digits}g}"
    if isinstance(value, list | tuple):
        return ", ".join(shown(item, digits) for item in value) or NONE
    return escape(str(value))


def paragraphs(text: str | None) -> str:
    """Return text whose paragraphs are parted by empty lines."""
    pieces = re.split(r"\n\s*\n", (text or "").strip())
    return "".join(f"<p>{escape(' '.join(piece.split()))}</p>" for piece in pieces if piece)


def yes_no(passed: bool | None, yes: str = "yes", no: str = "no", neither: str = "not asked") -> str:
    """Return a mark and a word: never told by colour alone."""
    kind, sign, word = {
        True: ("good", "\u2713", yes),
        False: ("bad", "\u2717", no),
        None: ("none", "\u25cb", neither),
    }[passed]
    return f'<span class="mark {kind}"><span aria-hidden="true">{sign}</span> {escape(word)}</span>'


def table(caption: str, heads: Sequence[str], rows: Iterable[Sequence[str]], numbers: Iterable[int] = ()) -> str:
    """Return a table that scrolls in its own box, nothing where it has no rows.

    Parameters
    ----------
    caption : str
    heads : sequence of str
    rows : iterable of sequences of str
        Cells as HTML; the first of a row names it.
    numbers : iterable of int
        Columns set flush right.
    """
    right = set(numbers)

    def kind(k: int) -> str:
        return ' class="number"' if k in right else ""

    def cell(k: int, text: str) -> str:
        tag, scope = ("th", ' scope="row"') if k == 0 else ("td", "")
        return f"<{tag}{scope}{kind(k)}>{text}</{tag}>"

    def head(k: int, text: str) -> str:
        return f'<th scope="col"{kind(k)}>{escape(text)}</th>'

    body = "".join(f"<tr>{''.join(cell(k, text) for k, text in enumerate(row))}</tr>\n" for row in rows)
    if not body:
        return ""
    top = "".join(head(k, text) for k, text in enumerate(heads))
    return (
        f'<div class="scroll" role="region" aria-label="{escape(caption)}" tabindex="0"><table>'
        f"<caption>{escape(caption)}</caption><thead><tr>{top}</tr></thead><tbody>\n{body}</tbody></table></div>"
    )


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Return a list of names and their values; values are HTML."""
    return f"<dl>{''.join(f'<div><dt>{escape(name)}</dt><dd>{value}</dd></div>' for name, value in pairs)}</dl>"


def folded(summary: str, inside: str) -> str:
    """Return HTML that is folded away behind a line of text; open on paper. Nothing where there is nothing inside."""
    return f"<details><summary>{escape(summary)}</summary>{inside}</details>" if inside else ""
