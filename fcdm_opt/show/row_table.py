"""Contact rows as a table: what touches, what is asked, value and slopes at a motion."""

from __future__ import annotations

from contextlib import redirect_stdout
from io import StringIO
from typing import TYPE_CHECKING

import numpy as np

from fcdm_opt.show.printing import print_rows, print_text
from fcdm_opt.show.texts import number, shortened

if TYPE_CHECKING:
    from fcdm_opt.geometry.arrays import Array
    from fcdm_opt.model.contact_rows import ContactRow, ContactRows

MOST, LONGEST = 20, 56
"""Rows that are listed, and letters of a name."""


def rows_text(rows: ContactRows) -> str:
    """Return the first rows as a table, as through a pipe, and how many more there are."""
    kinds = {
        "contact": rows.contacts, "alignment": rows.alignments, "clearance": rows.clearances,
        "switching point": () if rows.switching_point is None else (rows.switching_point,),
    }  # fmt: skip
    every = [(kind, row) for kind, own in kinds.items() for row in own]
    with redirect_stdout(StringIO()) as output:
        place = ", ".join(f"{name} {number(x)}" for name, x in zip(rows.parameters, rows.at.tolist(), strict=True))
        units = f"; lengths in {rows.unit}, angles in radians" if rows.unit else ""
        print_text(f"rows at {shortened(place, LONGEST)}{units}")
        if every:
            print_rows([_cells(kind, row, rows) for kind, row in every[:MOST]], numbers=("value",))
        if len(every) > MOST:
            print_text(f"... and {len(every) - MOST} more")
    return "\n".join(map(str.rstrip, output.getvalue().rstrip().splitlines()))


def _cells(kind: str, row: ContactRow, rows: ContactRows) -> dict[str, str]:
    values, slopes = _at(row, rows.at)
    steep = np.where(np.abs(slopes) > 1e-12, slopes, 0.0)
    terms = (f"{name} {x:+.4g}" for name, x in zip(rows.parameters, steep.tolist(), strict=True) if x)
    return {
        "row": kind,
        "between": shortened(row.name, LONGEST),
        "asked": row.asked,
        "value": ", ".join(f"{x + 0.0:+.4g}" for x in np.round(values, 12).tolist()),
        "slope by each parameter": shortened(", ".join(terms), LONGEST) if values.size == 1 else "",
    }


def _at(row: ContactRow, q: Array) -> tuple[Array, Array]:
    """Return what a row comes to at a motion, of several numbers the least where all are to be positive, and slopes."""
    import casadi

    given = {"plane": row.start} if len(row.start) else {}
    name = next(own for own in ("gap", "aligned", "apart", "rho") if own in row.function.name_out())
    symbols = casadi.MX.sym("q", len(q))
    out = casadi.vec(row(q=symbols, **given)[name])
    both = casadi.Function("both", [symbols], [out, casadi.jacobian(out, symbols)])(q)
    values, slopes = (np.asarray(own.full()) for own in both)
    if name == "apart":
        least = int(values.argmin())
        values, slopes = values[[least]], slopes[[least]]
    return values.ravel(), slopes[0]
