"""A compensation map as a grid for the shop floor: size of one part by size of the other, in each cell the motion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fcdm_opt.design.compensation.compensation_map import CompensationMap
from fcdm_opt.design.moved_files import to_csv, write
from fcdm_opt.design.question import ROLES
from fcdm_opt.design.sizes import SCALES
from fcdm_opt.geometry.units import measured
from fcdm_opt.problem.fit import drawn_bodies
from fcdm_opt.problem.problem import Problem
from fcdm_opt.show.rendering import rendered
from fcdm_opt.show.texts import number

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
        Sizes of the movable and of the static part: lengths that can be measured, without a unit per cent off the
        nominal ones; of sizes by name what they measure, with the deviation from drawn, or that alone.
    cells : sequence of sequence of str
        A row for each size of the movable part; a dash where there is no motion, a question mark where
        that is not known.
    """

    name: str
    unit: str
    rows: Sequence[str]
    columns: Sequence[str]
    cells: Sequence[Sequence[str]]


def grids(found: CompensationMap, problem: Problem, *, lines: int = LINES) -> list[Grid]:
    """Return a grid for each parameter of a map's motion: lengths in its unit, angles in degrees.

    Scales of parts whose unit is known are told as the length of a part along the axis in which it is longest.
    """
    sizes = [np.linspace(low, high, lines) for low, high in np.asarray(found.box)]
    points = found.at(sizes[0][:, None], sizes[1][None])
    motion, unknown = points.parameters, points.undecided.tolist()
    heads = [
        [_size_text(off, length, unit, found.unit) for off in np.round(values, 9).tolist()]
        if not nominal
        else [f"{longest * value:.6g} {found.unit}" for value in values]
        if found.unit
        else [f"{100.0 * off:+.4g} %" if off else "as nominal" for off in np.round(values / nominal - 1.0, 9)]
        for values, nominal, unit, (longest, _), length in zip(
            sizes, found.nominal, units_over(found), _longest(problem), _drawn(found, problem), strict=True
        )
    ]
    made = []
    for k, (name, kind) in enumerate(problem.motion.parameters):
        turned = kind == "rotation"
        values = np.degrees(motion[..., k]) if turned else motion[..., k]
        small = NOTHING * float(np.nanmax(np.abs(values), initial=0.0))
        cells = [
            ["?" if open_ else number(0.0 if abs(x) <= small else x) for x, open_ in zip(*row, strict=True)]
            for row in zip(values.tolist(), unknown, strict=True)
        ]
        made.append(Grid(name, "deg" if turned else found.unit, heads[0], heads[1], cells))
    return made


def _drawn(found: CompensationMap, problem: Problem) -> list[float]:
    """Return what the sizes that a map is over measure as drawn; nan where that is not one length."""
    bodies, own = dict(zip(ROLES, drawn_bodies(problem), strict=True)), {size.name: size for size in problem.sizes}
    return [own[name].drawn(bodies[own[name].body]) if name in own else np.nan for name in found.over]


def _size_text(off: float, length: float, unit: str, whole: str) -> str:
    """Return a size by its deviation from drawn, in a unit or as a share: "9.964 mm (-0.036)", "-0.036 mm"."""
    made = length + off if unit else length * (1.0 + off)
    told = "as drawn" if not off else f"{off:+.4g}" if unit else f"{100.0 * off:+.4g} %"
    return (measured(told, unit) if off else told) if np.isnan(made) else f"{measured(f'{made:.6g}', whole)} ({told})"


def units_over(found: CompensationMap) -> list[str]:
    """Return the units of what a map is over: none of scales, which are shares, and where none is known."""
    scales = {size["name"] for size in (found.problem or {}).get("size", ()) if "scale" in size} | set(SCALES)
    return ["" if name in scales else found.unit for name in found.over]


def _longest(problem: Problem) -> list[tuple[float, str]]:
    """Return how long either part is drawn along the axis in which it is longest, and that axis."""
    extents = [np.ptp(body.vertices, axis=0) for body in (problem.movable, problem.static)]
    return [(float(own.max()), "xyz"[int(own.argmax())]) for own in extents]


def write_grids(found: CompensationMap, problem: Problem, base: Path, *, title: str) -> list[Path]:
    """Write the grids of a map as CSV and as a page to print, named after `base`; return both paths."""
    tables = grids(found, problem)
    bodies = zip((problem.movable, problem.static), ("movable", "static"), _longest(problem), strict=True)
    parts = [(body.name or f"the {role} part", axis) for body, role, (_, axis) in bodies]
    moved, names = parts[0][0], list(found.over)
    off = "off drawn" if np.isnan(_drawn(found, problem)).any() else "in brackets how far off drawn"
    if tuple(found.over) == SCALES:
        names = [f"{name}, length along {axis}" if found.unit else name for name, axis in parts]
        off = "" if found.unit else "off nominal"
    lines: list[list[str]] = []
    for table in tables:
        told = f"{table.name}, {table.unit}" if table.unit else table.name
        lines += [[f"{told}: {names[0]} down, {names[1]} across", *table.columns]]
        lines += [[row, *cells] for row, cells in zip(table.rows, table.cells, strict=True)]
        lines.append([])
    paths = [base.with_name(f"{base.name}-grid.{ending}") for ending in ("csv", "html")]
    to_csv(paths[0], lines[:-1])
    words = {"title": title, "names": names, "moved": moved, "off": off, "reached": number(found.reached),
             "unit": found.unit, "undecided": found.undecided, "bounded": np.isfinite(found.reached)}  # fmt: skip
    write(paths[1], rendered("grid.html", grids=tables, **words))
    return paths
