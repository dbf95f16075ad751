"""A compensation map as a grid for the shop floor: one size across, all others down, in each cell the motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.true_sizes import ROLES
from fcdm_opt.design.compensation.compensation_map import CompensationMap
from fcdm_opt.design.compensation.refined_mesh import SHORTEST
from fcdm_opt.design.compensation.sampling import sample_at
from fcdm_opt.design.compensation.table import edges_of
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.naming import faces_text
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.units import measured, signed
from fcdm_opt.moved_files import to_csv, write
from fcdm_opt.problem.scene import Scene
from fcdm_opt.show.rendering import rendered
from fcdm_opt.show.texts import DIGITS, number
from fcdm_opt.tolerances import DEFAULT

LINES = {1: 21, 2: 11, 3: 5}  # values of each size that are listed, of a map over so many; of more 3
UNSURE = 0.1  # of the largest amount: a motion that may be off by more is not told
EDGE, EVERY = 33, 2  # points of an edge of a map's simplices, of as many sizes at most; of more its nodes
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
    between: float = 0.0  # by how much values in proportion between lines are off, but for cells in which motions jump


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
    most = max(found.error, UNSURE * float(np.nanmax(points.amount, initial=0.0)))
    on_jump = np.isfinite(points.amount) & ~(points.displacement_error <= most)  # between motions found next to it
    at_end = np.isnan(points.amount) & ~late & np.isfinite(around.amount).any(axis=1)
    late |= on_jump & bool(found.stopped)
    for k in np.flatnonzero(at_end | (on_jump & ~late)).tolist():  # of motions that are as large, either will do
        sample = pacing.in_time(sample_at, scene, tuple(places[k].tolist()), found.over, late=None)
        late[k] = sample is None
        motion[k] = np.nan if sample is None else sample.values[1:]
    motion[late] = np.nan
    off = _off_between(found, sizes, np.where((points.displacement_error <= found.reached)[:, None], motion, np.nan))
    motion, unknown = motion.reshape(*shape, -1), late.reshape(shape)
    heads = [[own.text(x) for x in values.tolist()] for values, own in zip(sizes, _headings(found, scene), strict=True)]
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
        between = float(np.degrees(off[k]) if turned else off[k])
        made.append(Grid(own.name, "deg" if turned else found.unit, rows, across, cells, between * (between > small)))
    return made


def _off_between(found: CompensationMap, sizes: Sequence[Array], motion: Array) -> Array:
    """Return by how much motions in proportion between lines, at `sizes`, differ from a map's own, (p,).

    Along the edges of its simplices, on which contacts change, but for cells of the grid in which motions jump.
    `motion` (n, p) at all lines, nan on a jump.
    """
    from scipy.interpolate import RegularGridInterpolator

    table, count = found.table, len(sizes)
    one, two = np.transpose(edges_of(count))
    steps = np.linspace(0.0, 1.0, EDGE if count <= EVERY else 3)[:, None, None]
    basis = [(1 - steps) * (1 - 2 * steps), steps * (2 * steps - 1), 4 * steps * (1 - steps)]
    ends = [table.corners[:, None, own] for own in (one, two)]
    places = ends[0] + steps * (ends[1] - ends[0])  # (m, steps, edges, sizes)
    values = table.values[:, None, :, 1:]
    nodes = (values[:, :, one], values[:, :, two], values[:, :, count + 1 :])
    own = sum(share * each for share, each in zip(basis, nodes, strict=True))
    lines = motion.reshape(*map(len, sizes), -1)
    off = np.abs(RegularGridInterpolator(sizes, lines, bounds_error=False)(places) - own)
    within = [np.clip(np.searchsorted(own, places[..., k]) - 1, 0, len(own) - 2) for k, own in enumerate(sizes)]
    cells, jumps = np.ravel_multi_index(within, [*map(len, sizes)]), ~(table.errors[:, 1] <= found.reached)
    smooth = ~np.isin(cells, cells[jumps])
    return np.nan_to_num(np.nanmax(off[smooth].reshape(-1, off.shape[-1]), axis=0, initial=0.0))


class _Heading(NamedTuple):
    """What a line of a grid is called: what is measured, what it is told as where that is no length, its values."""

    name: str
    off: str
    text: Callable[[float], str]


def _headings(found: CompensationMap, scene: Scene) -> list[_Heading]:
    """Return what is measured of the sizes that a map is over; of scales the part, where it is longest."""
    own, made = {size.name: size for size in scene.sizes}, list[_Heading]()
    ends = list(zip(found.over, np.asarray(found.box).tolist(), strict=True))
    for name, nominal in zip(found.over, found.nominal, strict=True):
        if size := own.get(name):
            others = [{}, *({other: end} for other, box in ends for end in box if other != name)]
            lengths, *moved = (scene.dimensions_at(size, values) for values in others)
            face, body = next(iter(lengths), ""), scene.drawn[size.body]
            ends_moved = [x.get(face, np.nan) for x in moved]
            if known := len(lengths) == 1 and np.allclose(ends_moved, lengths[face], DEFAULT.nominal):
                words = [name, "to", face]
            else:
                words = [name, "of", faces_text(body, np.flatnonzero(size.offsets(body)).tolist())]
            text = partial(_size_text, scene, size, known)
            made.append(_Heading(" ".join(words if words[2] else words[:1]), "" if known else "off drawn", text))
            continue
        part = [*scene.drawn][[*scene.nominal_scales].index(name)]
        extents = np.ptp(scene.bodies_made[part].vertices, axis=0)
        part_name = scene.drawn[part].name or (f"the {part} part" if part in ROLES else part)
        along = f", length along {'xyz'[int(extents.argmax())]}" if found.unit else ""
        text = partial(_scale_text, found.unit, nominal, float(extents.max()))
        made.append(_Heading(f"{part_name}{along}", "" if found.unit else "off nominal", text))
    return made


def _size_text(scene: Scene, size: Size, known: bool, off: float) -> str:
    """Return what a size measures by its deviation from drawn, "9.964 mm (-0.036)"; that alone: "-0.036 mm"."""
    (length,) = scene.dimensions_at(size, {size.name: off}).values() if known else (np.nan,)
    text = size.deviation_text(off, "" if known else scene.unit, DIGITS) if (off := round(off, 9)) else "as drawn"
    return f"{measured(length, scene.unit)} ({text})" if known else text


def _scale_text(unit: str, nominal: float, length: float, value: float) -> str:
    """Return a length by its scale, without a unit how far that is off the nominal one: "2.02 mm", "+1 %"."""
    off = round(value / nominal - 1.0, 9)
    return f"{length * value:.6g} {unit}" if unit else f"{signed(100.0 * off)} %" if off else "as nominal"


def units_over(found: CompensationMap) -> list[str]:
    """Return the units of what a map is over: none of scales, which are shares, and where none is known."""
    shares = {size["name"] for size in (found.problem or {}).get("size", ()) if "scale" in size}
    named = zip(found.over, found.scaled, strict=True)
    return ["" if scale or name in shares else found.unit for name, scale in named]


def write_grids(found: CompensationMap, scene: Scene, base: Path, *, title: str) -> list[Path]:
    """Write the grids of a map as CSV and as a page to print, named after `base`; return both paths."""
    tables, own = grids(found, scene), _headings(found, scene)
    *most, across = [one.name for one in own]
    down, across = (" / ".join(most), across) if most else (across, "")
    off = ", ".join(sorted({one.off for one in own if one.off}))
    off = off or "in brackets how far off drawn" * (not found.scaled.all())
    moved = scene.drawn[scene.moving[0]].name or "the movable part"
    moved = moved if scene.moving == ROLES[:1] else "the parts named before a dot"
    lines: list[list[str]] = []
    for table in tables:
        heading = f"{table.name}, {table.unit}" if table.unit else table.name
        lines += [[f"{heading}: {down} down{f', {across} across' if across else ''}", *table.columns]]
        lines += [[row, *cells] for row, cells in zip(table.rows, table.cells, strict=True)]
        lines.append([])
    paths = [base.with_name(f"{base.name}-grid.{ending}") for ending in ("csv", "html")]
    to_csv(paths[0], lines[:-1])
    words = {"title": title, "down": down, "across": across, "moved": moved, "off": off, "unit": found.unit,
             "reached": number(found.reached), "bounded": np.isfinite(found.reached),
             "off_between": any(table.between for table in tables),
             "open": any("?" in row for table in tables for row in table.cells),
             "jumps": any(own.jumps for own in found.boundaries)}  # fmt: skip
    moving = [table for table in tables if any(cell not in ("0", "-", "?") for row in table.cells for cell in row)]
    moving = moving or tables[:1]  # where no part has to move, where one can
    words["still"] = ", ".join(table.name for table in tables if table not in moving)
    write(paths[1], rendered("grid.html", grids=moving, **words))
    return paths
