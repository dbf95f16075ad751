"""Contact rows as a table: what touches, what is asked, value and slopes at a motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fcdm_opt.show.printing import print_rows, print_text, wrapped
from fcdm_opt.show.texts import number, shortened

if TYPE_CHECKING:
    from fcdm_opt.model.contact_rows import ContactRow, ContactRows

MOST, LONGEST, NEAR = 20, 56, 1.0 / 16.0
"""Rows that are listed, letters in a line of a name, and how far apart parts are listed, of the largest of them."""


OF_LEAST = ("least gap", "gap >=")  # how what is asked begins where of many features none is named


def print_contact_rows(rows: ContactRows) -> None:
    """Print the first rows as a table, and how many more there are, or parts that are far apart.

    Of contacts of which only the least gap is asked about, the least first.
    """
    far = _far(rows)
    kinds = {"contacts": rows.contacts, "alignments": rows.alignments, "clearances": rows.clearances}
    every = [(f"{kind}[{k}]", row) for kind, own in kinds.items() for k, row in enumerate(own) if id(row) not in far]
    every += [("switching_point", rows.switching_point)] if rows.switching_point else []
    if any(row.asked.startswith(OF_LEAST) for row in rows.contacts):
        count = len(rows.contacts)
        every[:count] = sorted(every[:count], key=lambda own: float(own[1](q=rows.at)["gap"]))
    place = ", ".join(f"{name} {number(x)}" for name, x in zip(rows.parameters, rows.at.tolist(), strict=True))
    units = f"; lengths in {rows.unit}, angles in radians" if rows.unit else ""
    print_text(f"rows at {shortened(place, LONGEST)}{units}")
    if every:
        print_rows([_cells(kind, row, rows) for kind, row in every[:MOST]], numbers=("value",))
    if len(every) > MOST:
        print_text(f"... and {len(every) - MOST} more")
    if far:
        least = f"{number(min(far.values()))}{f' {rows.unit}' * bool(rows.unit)}"
        print_text(f"{len(far)} clearance{'s' * (len(far) > 1)} of parts that are {least} or more apart")


def _far(rows: ContactRows) -> dict[int, float]:
    """Return how far apart the two sides of clearances are, by id, of those that are not `NEAR` each other."""
    given = [(row, row.numbers["movable"], row.numbers["static"]) for row in rows.clearances]
    size = max((float(np.ptp(own, axis=1).max()) for _, *both in given for own in both), default=0.0)
    found = dict[int, float]()
    for row, one, _ in given:
        corners = row(q=rows.at, plane=row.start)["apart"].full().ravel()
        found[id(row)] = float(corners[: one.shape[1]].min() + corners[one.shape[1] :].min())
    return {key: x for key, x in found.items() if x > NEAR * size}


def _cells(kind: str, row: ContactRow, rows: ContactRows) -> dict[str, str]:
    """Return the cells of a row: of a plane what it leaves between the parts, no slopes of several numbers."""
    import casadi

    name = next(own for own in ("gap", "aligned", "apart", "rho") if own in row.function.name_out())
    q = casadi.MX.sym("q", len(rows.at))
    out = casadi.vec(row(q=q, **({"plane": row.start} if len(row.start) else {}))[name])
    values, slopes = (own.full() for own in casadi.Function("row", [q], [out, casadi.jacobian(out, q)])(rows.at))
    if name == "apart":
        count = row.numbers["movable"].shape[1]  # of the corners on one side of the plane: what both sides leave
        both = [int(values[:count].argmin()), count + int(values[count:].argmin())]
        values, slopes = (own[both].sum(axis=0, keepdims=True) for own in (values, slopes))
    steep = zip(rows.parameters, slopes[0].tolist(), strict=True)
    terms = (f"{parameter} {x:+.4g}" for parameter, x in steep if abs(x) > 1e-12)
    return {
        "row": kind,
        "between": wrapped(row.name, LONGEST),
        "asked": row.asked,
        "value": ", ".join(f"{x + 0.0:+.4g}" for x in np.round(values.ravel(), 12).tolist()),
        "slope by each parameter": shortened(", ".join(terms), LONGEST) if values.size == 1 else "",
    }
