"""A compensation map as a grid for the shop floor: one size across, all others down, in each cell the motion."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.true_sizes import ROLES
from fcdm_opt.design.compensation.compensation_map import CompensationMap
from fcdm_opt.design.compensation.refined_mesh import SHORTEST
from fcdm_opt.design.compensation.sampling import sample_at
from fcdm_opt.geometry.units import measured, signed
from fcdm_opt.moved_files import to_csv, write
from fcdm_opt.problem.scene import Scene
from fcdm_opt.show.rendering import rendered
from fcdm_opt.show.texts import number

LINES = {1: 21, 2: 11, 3: 5}  # values of each size that are listed, of a map over so many; of more 3
UNSURE = 0.1  # of the largest amount: a motion that may be off by more is not told
NOTHING = 1e-5  # of the largest value, what is listed as 0: less than four digits of it tell


class Grid(NamedTuple):
    """One parameter of a motion over the sizes.

    `rows` are all sizes but the last one, and `columns` the last one; of a single size that and nothing: lengths that
    can be measured, without a unit per cent off the nominal ones; of sizes by name what they measure, with the
    deviation from drawn, or that alone. `cells` are a row for each of the rows; a dash where there is no motion, a
    question mark where that is not known.
    """

    name: str
    unit: str
    rows: Sequence[str]
    columns: Sequence[str]
    cells: Sequence[Sequence[str]]


def grids(found: CompensationMap, scene: Scene, *, lines: int | None = None) -> list[Grid]:
    """Return a grid for each parameter of a map's motion: lengths in its unit, angles in degrees.

    Scales of parts whose unit is known are told as the length of a part along the axis in which it is longest.
    """
    many = LINES.get(len(found.over), 3) if lines is None else lines
    sizes = [np.linspace(low, high, many) for low, high in np.asarray(found.box)]
    places = np.stack(np.meshgrid(*sizes, indexing="ij"), axis=-1).reshape(-1, len(sizes))
    points = found.at(*places.T)
    shape = (len(places) // many, many) if len(sizes) > 1 else (many, 1)
    motion, late = points.parameters.copy(), points.undecided
    # where a region without a motion ends, as at no play at all, a map knows it to its shortest edge only
    off = 2.0 * SHORTEST * np.diag(np.ptp(np.asarray(found.box), axis=1))
    around = found.table.at(*np.moveaxis(places[:, None] + np.array([*off, *-off]), -1, 0))
    for k in np.flatnonzero(np.isnan(points.amount) & ~late & np.isfinite(around.amount).any(axis=1)).tolist():
        sample = pacing.in_time(sample_at, scene, tuple(places[k].tolist()), found.over, late=None)
        late[k] = sample is None
        motion[k] = np.nan if sample is None else sample.values[1:]
    motion = motion.reshape(*shape, -1)
    most = max(found.error, UNSURE * float(np.nanmax(points.amount, initial=0.0)))
    between = np.isfinite(points.amount) & ~(points.displacement_error <= most)  # of motions found beside it, on a jump
    unknown = (late | between).reshape(shape)
    heads = [
        [_size_text(off, own, unit, found.unit) for off in np.round(values, 9).tolist()]
        if not nominal
        else [f"{own.length * value:.6g} {found.unit}" for value in values]
        if found.unit
        else [f"{signed(100.0 * off)} %" if off else "as nominal" for off in np.round(values / nominal - 1.0, 9)]
        for values, nominal, unit, own in zip(
            sizes, found.nominal, units_over(found), _measured(found, scene), strict=True
        )
    ]
    *down, across = heads if len(heads) > 1 else (*heads, [""])
    rows = [" / ".join(row) for row in product(*down)]
    made = []
    for k, own in enumerate(scene.coordinates):
        turned = own.kind == "rotation"
        values = np.degrees(motion[..., k]) if turned else motion[..., k]
        small = NOTHING * float(np.nanmax(np.abs(values), initial=0.0))
        cells = [
            ["?" if unsure else number(0.0 if abs(x) <= small else x) for x, unsure in zip(*row, strict=True)]
            for row in zip(values.tolist(), unknown.tolist(), strict=True)
        ]
        made.append(Grid(own.name, "deg" if turned else found.unit, rows, across, cells))
    return made


class _Length(NamedTuple):
    """What is measured of a size as drawn, nan where that is not one length; of a scale the part, where it is longest.

    `name` says what it is of, `off` what it is told as where that is no length; as made it is `scale` times as long.
    """

    name: str
    length: float
    off: str
    scale: float = 1.0


def _measured(found: CompensationMap, scene: Scene) -> list[_Length]:
    """Return what is measured of the sizes that a map is over."""
    own, made = {size.name: size for size in scene.sizes}, list[_Length]()
    scales = scene.scales_at({name: 1.0 for name in found.over if name not in own})
    for name in found.over:
        if name in own:
            body = own[name].body
            length = own[name].drawn(scene.drawn[body])
            made.append(_Length(name, length, "off drawn" if np.isnan(length) else "", scales[body]))
            continue
        part = [*scene.drawn][[*scene.nominal_scales].index(name)]
        extents = np.ptp(scene.bodies_made[part].vertices, axis=0)
        told = scene.drawn[part].name or (f"the {part} part" if part in ROLES else part)
        along = f", length along {'xyz'[int(extents.argmax())]}" if found.unit else ""
        made.append(_Length(f"{told}{along}", float(extents.max()), "" if found.unit else "off nominal"))
    return made


def _size_text(off: float, own: _Length, unit: str, whole: str) -> str:
    """Return a size by its deviation from drawn, in a unit or as a share: "9.964 mm (-0.036)", "-0.036 mm"."""
    made = own.scale * (own.length + off if unit else own.length * (1.0 + off))
    told = "as drawn" if not off else signed(off) if unit else f"{signed(100.0 * off)} %"
    return (measured(told, unit) if off else told) if np.isnan(made) else f"{measured(made, whole)} ({told})"


def units_over(found: CompensationMap) -> list[str]:
    """Return the units of what a map is over: none of scales, which are shares, and where none is known."""
    shares = {size["name"] for size in (found.problem or {}).get("size", ()) if "scale" in size}
    named = zip(found.over, found.scaled, strict=True)
    return ["" if scale or name in shares else found.unit for name, scale in named]


def write_grids(found: CompensationMap, scene: Scene, base: Path, *, title: str) -> list[Path]:
    """Write the grids of a map as CSV and as a page to print, named after `base`; return both paths."""
    tables, own = grids(found, scene), _measured(found, scene)
    *most, across = [one.name for one in own]
    down, across = (" / ".join(most), across) if most else (across, "")
    off = ", ".join(sorted({one.off for one in own if one.off}))
    off = off or "in brackets how far off drawn" * (not found.scaled.all())
    moved = scene.drawn[scene.moving[0]].name or "the movable part"
    moved = moved if scene.moving == ROLES[:1] else "the parts named before a dot"
    lines: list[list[str]] = []
    for table in tables:
        told = f"{table.name}, {table.unit}" if table.unit else table.name
        lines += [[f"{told}: {down} down{f', {across} across' if across else ''}", *table.columns]]
        lines += [[row, *cells] for row, cells in zip(table.rows, table.cells, strict=True)]
        lines.append([])
    paths = [base.with_name(f"{base.name}-grid.{ending}") for ending in ("csv", "html")]
    to_csv(paths[0], lines[:-1])
    words = {"title": title, "down": down, "across": across, "moved": moved, "off": off, "unit": found.unit,
             "reached": number(found.reached), "bounded": np.isfinite(found.reached),
             "open": any("?" in row for table in tables for row in table.cells),
             "jumps": any(own.jumps for own in found.boundaries)}  # fmt: skip
    write(paths[1], rendered("grid.html", grids=tables, **words))
    return paths
