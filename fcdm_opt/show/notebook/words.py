"""Numbers, lists and tables of a card, and the card that holds them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import NewType

Html = NewType("Html", str)

LISTED = 12
"""Lines of a list or table that are shown; how many more there are is said."""

LONGEST = 160
"""Characters of a text that are shown; faces with hundreds of corners have labels of thousands."""

SHORT = 16
"""Characters of a cell that stay on one line."""

SIGNS = {"good": "\u2713 ", "bad": "\u2717 ", "mind": "! ", "": ""}
# Okabe and Ito's palette; each at least 3 : 1 on white and on a dark page
HUES = {"good": "#009E73", "bad": "#D55E00", "mind": "#C88A00", "": "#7F7F7F"}


# ------------------------------------------------------------------------------------------------------- words, numbers


def number(value: float | None, digits: int = 6) -> str:
    """Return a number as a card shows it: a dash for nan and None."""
    if value is None or math.isnan(value):
        return "-"
    return f"{float(value):.{digits}g}" if math.isfinite(value) else "infinite" if value > 0 else "-infinite"


def numbers(values: Iterable[float | None], digits: int = 6) -> str:
    """Return numbers, separated by commas."""
    return ", ".join(number(value, digits) for value in values)


def counted(count: int, noun: str) -> str:
    """Return a number of things: "1 part", "2 parts"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def cleaned(text: object, longest: int = LONGEST) -> str:
    """Return a text escaped, without what no page may hold, and its middle left out where it is too long."""
    whole = str(text).encode("utf-8", "replace").decode()
    half = longest // 2
    if len(whole) > longest:
        whole = f"{whole[:half]} \u2026 {whole[-half:]}"
    shown = "".join(sign if sign.isprintable() or sign.isspace() else "\ufffd" for sign in whole)
    return escape(" ".join(shown.split()))


# --------------------------------------------------------------------------------------------------------------- pieces


def card(title: object, *pieces: Html, state: object = "", mood: str = "", picture: Html | None = None) -> Html:
    """Return a card.

    Parameters
    ----------
    title : text
    *pieces : Html
        Of the functions below, one below the other; empty ones are left out.
    state : text
        In a badge beside the title, with a sign before it that tells the mood.
    mood : {"good", "bad", "mind", ""}
    picture : Html, optional
        Beside the pieces, or below them where the page is narrow.
    """
    badge = ""
    if state:
        badge = (
            f' <span style="border:1.5px solid {HUES[mood]};border-radius:9px;padding:0 7px;white-space:nowrap">'
            f"{SIGNS[mood]}{cleaned(state)}</span>"
        )
    beside = f'<div style="flex:0 1 auto">{picture}</div>' if picture else ""
    return Html(
        '<div style="border:1px solid rgba(127,127,127,.5);border-radius:6px;padding:8px 12px;margin:4px 0;'
        'max-width:62em;font-size:13px;line-height:1.45;text-align:left;overflow-wrap:anywhere">'
        f'<div><strong style="font-size:14px">{cleaned(title)}</strong>{badge}</div>'
        '<div style="display:flex;flex-wrap:wrap;gap:4px 24px;align-items:flex-start">'
        f'<div style="flex:1 1 21em;min-width:0">{"".join(pieces)}</div>{beside}</div></div>'
    )


def sentence(text: object) -> Html:
    """Return a line of words; nothing for an empty text."""
    return Html(f'<div style="margin:4px 0">{cleaned(text, 4 * LONGEST)}</div>' if text else "")


def rows(lines: Iterable[tuple[str, str] | tuple[str, str, str]]) -> Html:
    """Return a table of name, value and unit; lines without a value are left out."""
    side = "text-align:left;font-weight:normal;padding:1px 12px 1px 0;vertical-align:top;white-space:nowrap"
    head = f'<th scope="row" style="{side}">'
    cell = '<td style="text-align:left;padding:1px 0;vertical-align:top">'
    made = [
        f"<tr>{head}{cleaned(name)}</th>{cell}<b>{cleaned(value)}</b> {cleaned(''.join(unit))}</td></tr>"
        for name, value, *unit in lines
        if value
    ]
    return _table(made)


def table(head: Sequence[str], lines: Sequence[Sequence[object]], *, most: int = LISTED) -> Html:
    """Return a table with a head; of more than `most` lines the first ones and how many more there are."""
    kinds = [("th", head), *(("td", line) for line in lines[:most])]
    made = [f"<tr>{''.join(_cell(kind, value) for value in line)}</tr>" for kind, line in kinds]
    return Html((_table(made) if lines else "") + _more(len(lines) - most))


def listing(name: str, lines: Sequence[object], *, most: int = LISTED) -> Html:
    """Return a list under a name; of more than `most` lines the first ones and how many more there are."""
    if not lines:
        return Html("")
    items = "".join(f"<li>{cleaned(line)}</li>" for line in lines[:most])
    return Html(
        f'<div style="margin:6px 0 0">{cleaned(name)}</div>'
        f'<ul style="margin:0;padding-left:18px">{items}</ul>{_more(len(lines) - most)}'
    )


def _cell(kind: str, value: object) -> str:
    """Return a cell, a short one on one line: numbers and single words are not broken."""
    kept = ";white-space:nowrap" if len(str(value)) <= SHORT else ""
    scope = ' scope="col"' if kind == "th" else ""
    style = f"text-align:left;padding:1px 12px 1px 0;vertical-align:top{kept}"
    return f'<{kind}{scope} style="{style}">{cleaned(value, LONGEST // 2)}</{kind}>'


def _table(lines: Sequence[str]) -> Html:
    if not lines:
        return Html("")
    style = "border-collapse:collapse;margin:4px 0;font-size:13px;font-variant-numeric:tabular-nums"
    whole = f'<table style="{style}"><tbody>{"".join(lines)}</tbody></table>'
    return Html(f'<div style="overflow-x:auto">{whole}</div>')  # a wide table scrolls where the page is narrow


def _more(count: int) -> str:
    return f'<div style="opacity:.75">and {count} more</div>' if count > 0 else ""
