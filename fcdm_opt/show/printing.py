"""Tables and text on a terminal and through a pipe."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import redirect_stdout
from functools import cache
from io import StringIO
from typing import Any

from fcdm_opt.show.texts import units_text

PIPED_WIDTH, TEXT_WIDTH, CELL_WIDTH = 200, 110, 16
"""Columns of a table that is not printed on a terminal (more than any needs: nothing is folded), of text, of a name."""


def console() -> Any:
    """Return a rich console, always the same; wide enough for everything where it is not a terminal."""
    terminal = sys.stdout is not None and sys.stdout.isatty()  # None: it was closed before the start
    return _console(terminal, bool(os.environ.get("NO_COLOR")))


@cache
def _console(terminal: bool, plain: bool) -> Any:
    from rich.console import Console

    return Console(
        width=None if terminal else PIPED_WIDTH,
        markup=False,
        highlight=False,
        emoji=False,
        color_system=None if plain else "auto",  # None: no bold either, plain text
        soft_wrap=not terminal,
    )


def print_rows(
    rows: Sequence[dict[str, str]],
    numbers: Sequence[str] = (),
    *,
    optional: Sequence[str] = (),
    notes: Iterable[str] = (),
) -> None:
    """Print rows as a table, closer set where it is too wide, and one below the other where that does not do.

    Notes stand below it, then an empty line. An optional column is left out where no row has anything in it.
    """
    from rich import box
    from rich.table import Table

    out = console()
    dropped = [column for column in optional if not any(row[column] for row in rows)]
    kept = [{column: cell for column, cell in row.items() if column not in dropped} for row in rows]
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False, collapse_padding=True, show_edge=False)
    for column in kept[0]:
        justify: Any = "right" if column in numbers else "left"
        table.add_column(column, no_wrap=True, justify=justify, vertical="top")
    for row in kept:
        table.add_row(*row.values())
    unlimited = out.options.update(width=50 * PIPED_WIDTH)
    if out.measure(table, options=unlimited).maximum > out.width:
        table.padding = 0
    if out.measure(table, options=unlimited).maximum <= out.width:
        out.print(table)
    else:
        for (_, head), *rest in (row.items() for row in kept):
            out.print(head, style="bold")
            for column, cell in ((column, cell) for column, cell in rest if cell):
                name = column.replace("\n", " ")
                out.print(f"  {name}: {' '.join(cell.split())}")
    print_lines(notes)


def print_lines(lines: Iterable[str]) -> None:
    """Print lines, each broken between words where it is too long, and an empty one."""
    for line in lines:
        print_text(line, indent="   ")
    print_text()


def print_text(text: str = "", indent: str = "") -> None:
    """Print text, its lines broken between words, and later ones begun with `indent`; an empty line without."""
    out = console()
    out.print(wrapped(text, min(TEXT_WIDTH, out.width), indent))


def print_head(name: str, title: str, note: str, *, unit: str = "") -> None:
    """Print what stands above a file's tables; the unit of its lengths is said once, here."""
    console().print(f"{name}: {title}" if title else name, style="bold")
    if note:
        print_text(note)
    if unit:
        console().print(units_text(unit))
    print_text()


def wrapped(text: str, width: int, indent: str = "") -> str:
    """Return text in lines of at most `width` characters."""
    from textwrap import fill

    return fill(" ".join(text.split()), width, subsequent_indent=indent)


def printed(printing: Callable[[Any], None], what: Any) -> str:
    """Return what is printed of something, as through a pipe."""
    with redirect_stdout(StringIO()) as stream:
        printing(what)
    return "\n".join(map(str.rstrip, stream.getvalue().rstrip().splitlines()))
