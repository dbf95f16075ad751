"""A compensation map as a grid for the shop floor: size of one part by size of the other, in each cell the motion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fcdm_opt.design.compensation.compensation_map import CompensationMap
from fcdm_opt.design.moved_files import to_csv, write
from fcdm_opt.design.sizes import SCALES
from fcdm_opt.geometry.units import measured
from fcdm_opt.show.rendering import rendered
from fcdm_opt.show.texts import number

if TYPE_CHECKING:
    from fcdm_opt.motion.motions import Parameter

LINES = 11
"""Sizes of each part that are listed."""
NOTHING = 1e-5
"""Of the largest value, what is listed as 0: less than four digits of it tell."""


class Grid(NamedTuple):
    """One parameter of a motion over both sizes.

    Attributes
    ----------
    name, unit : str
    rows, columns : sequence of str
        Sizes of the movable and of the static part, in per cent off the nominal ones; of sizes by name deviations.
    cells : sequence of sequence of str
        A row for each size of the movable part; a dash where there is no motion, a question mark where
        that is not known.
    """

    name: str
    unit: str
    rows: Sequence[str]
    columns: Sequence[str]
    cells: Sequence[Sequence[str]]


def grids(found: CompensationMap, parameters: Sequence[Parameter], *, lines: int = LINES) -> list[Grid]:
    """Return a grid for each parameter of a map's motion: lengths in its unit, angles in degrees."""
    sizes = [np.linspace(low, high, lines) for low, high in np.asarray(found.box)]
    points = found.at(sizes[0][:, None], sizes[1][None])
    motion, unknown = points.parameters, points.undecided.tolist()
    heads = [
        [f"{100.0 * off:+.4g} %" if off else "as nominal" for off in np.round(values / nominal - 1.0, 9)]
        if nominal
        else [measured(f"{off:+.4g}", found.unit) if off else "as drawn" for off in np.round(values, 9)]
        for values, nominal in zip(sizes, found.nominal, strict=True)
    ]
    made = []
    for k, (name, kind) in enumerate(parameters):
        turned = kind == "rotation"
        values = np.degrees(motion[..., k]) if turned else motion[..., k]
        small = NOTHING * float(np.nanmax(np.abs(values), initial=0.0))
        cells = [
            ["?" if open_ else number(0.0 if abs(x) <= small else x) for x, open_ in zip(*row, strict=True)]
            for row in zip(values.tolist(), unknown, strict=True)
        ]
        made.append(Grid(name, "deg" if turned else found.unit, heads[0], heads[1], cells))
    return made


def write_grids(found: CompensationMap, parameters: Sequence[Parameter], base: Path, *, title: str) -> list[Path]:
    """Write the grids of a map as CSV and as a page to print, named after `base`; return both paths."""
    tables, bodies = grids(found, parameters), ("movable", "static")
    known = (found.problem or {}).get("bodies", {})
    names = [str(known.get(body, {}).get("name", f"the {body} part")) for body in bodies]
    moved = names[0]
    names = names if tuple(found.over) == SCALES else list(found.over)
    lines: list[list[str]] = []
    for table in tables:
        told = f"{table.name}, {table.unit}" if table.unit else table.name
        lines += [[f"{told}: {names[0]} down, {names[1]} across", *table.columns]]
        lines += [[row, *cells] for row, cells in zip(table.rows, table.cells, strict=True)]
        lines.append([])
    paths = [base.with_name(f"{base.name}-grid.{ending}") for ending in ("csv", "html")]
    to_csv(paths[0], lines[:-1])
    words = {"title": title, "names": names, "moved": moved, "reached": number(found.reached), "unit": found.unit,
             "undecided": found.undecided, "bounded": np.isfinite(found.reached)}  # fmt: skip
    write(paths[1], rendered("grid.html", grids=tables, **words))
    return paths
