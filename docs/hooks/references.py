"""Writes the references of the pages, of keys, commands, statuses and tolerances, from the code: run it after a change.

A page holds a marker, `<!-- tolerances -->`, and one where what was made ends; what is between them is written anew. It
stands in the pages so that it is there for who reads them without a site. A test holds that it is what the code says.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

import command_line
import problem_file

from fcdm_opt.problem.solution import Status
from fcdm_opt.tolerances import DEFAULT, meanings

PAGES = Path(__file__).parents[1]
END = "<!-- up to here -->"


def written(page: str) -> str:
    """Return a page with its references as they are now."""
    for name, text in TABLES.items():
        place = re.compile(rf"(<!-- {name} -->\n).*?({END})", re.DOTALL)
        page = place.sub(lambda found, text=text: f"{found[1]}\n{text().strip()}\n\n{found[2]}", page)
    return page


def tolerances() -> str:
    """Return one row a tolerance: name, value, meaning and reason as its docstring has them."""
    told = ((name, meaning.replace("|", "&#124;")) for name, meaning in meanings().items())  # fits a cell
    rows = [f"| `{name}` | {getattr(DEFAULT, name):g} | {meaning} |" for name, meaning in told]
    return "\n".join(["| name | value | meaning, and why |", "|---|---:|---|", *rows])


def statuses() -> str:
    """Return one row a status: name, whether there is a motion, advice."""
    rows = [f"| `{status.name}` | {'yes' if status.found else 'no'} | {status.value} |" for status in Status]
    return "\n".join(["| status | a motion | what it says |", "|---|---|---|", *rows])


TABLES: dict[str, Callable[[], str]] = {
    "tolerances": tolerances,
    "statuses": statuses,
    "exit codes": command_line.exit_codes,
    "commands": command_line.commands,
    **{f"keys: {kind}": partial(problem_file.reference_of, kind) for kind in problem_file.SCHEMAS},
}

if __name__ == "__main__":
    for path in PAGES.glob("*.md"):
        text = path.read_text(encoding="utf-8")
        if written(text) != text:
            path.write_text(written(text), encoding="utf-8")
