"""Tables that are written from the code while the site is built: where a page has `<!-- tolerances -->`, and so on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fcdm_opt.problem.solution import Status
from fcdm_opt.tolerances import DEFAULT, meanings


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Write each table where it has its place."""
    for name, table in TABLES.items():
        place = f"<!-- {name} -->"
        if place in markdown:
            markdown = markdown.replace(place, table())
    return markdown


def tolerances() -> str:
    """Return one row a tolerance: name, value, meaning and reason as its docstring has them."""
    told = ((name, meaning.replace("|", "&#124;")) for name, meaning in meanings().items())  # fits a cell
    rows = [f"| `{name}` | {getattr(DEFAULT, name):g} | {meaning} |" for name, meaning in told]
    return "\n".join(["| name | value | meaning, and why |", "|---|---:|---|", *rows])


def statuses() -> str:
    """Return one row a status: name, whether there is a motion, advice."""
    rows = [f"| `{status.name}` | {'yes' if status.found else 'no'} | {status.value} |" for status in Status]
    return "\n".join(["| status | a motion | what it says |", "|---|---|---|", *rows])


TABLES: dict[str, Callable[[], str]] = {"tolerances": tolerances, "statuses": statuses}
