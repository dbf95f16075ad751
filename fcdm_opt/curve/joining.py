"""What is on the boundary of a union of overlap regions, as stretches of lines, joined to chains."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve import kernels
from fcdm_opt.curve.region import Region
from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.tolerances import DEFAULT

LEAST_SCALE = 1e-6  # lines that pass this near to (0, 0) are compared as lines through it
LIMITS = (DEFAULT.tie, DEFAULT.line, DEFAULT.nominal, LEAST_SCALE)


class Stretch(NamedTuple):
    """A stretch of a piece of a region, whether it is snug, and whether another piece was dropped for part of it."""

    piece: int  # pieces of all regions are numbered one after the other
    lo: float
    hi: float
    snug: bool = False
    dropped: bool = False


class Visible(NamedTuple):
    """What is on the boundary of a union."""

    chains: list[list[Stretch]]
    # list of (piece, s): pieces and where on them a point is that no open region holds, off all stretches; once for
    # each that passes
    alone: list[tuple[int, float]]
    owners: Ints  # (pieces, 2): the region of each piece, and its number in there


def visible(regions: Sequence[Region], cells: Array, members: Ints, shares: Ints) -> Visible:
    """Return what is on the boundary of a union of regions; cells, members and shares as in `envelope.Union`."""
    lines, line_starts = _together([region.unit_lines for region in regions], 3)
    pieces, piece_starts = _together([region.table for region in regions], 6)
    found = kernels.stretches(lines, line_starts, pieces, piece_starts, cells, members, shares, LIMITS)
    point = found[:, 1] == found[:, 2]
    region = np.repeat(np.arange(len(regions)), np.diff(piece_starts))
    with np.errstate(invalid="ignore"):  # ends at infinity are nowhere near each other
        kept = _without_repeats(_merged(found[~point]), pieces)
        chains = _chained(kept, pieces, [regions[k].parts for k in region.tolist()])
        alone = [
            (int(piece), s) for piece, s, _ in found[point].tolist() if not _passed(pieces[int(piece)], s, kept, pieces)
        ]
    return Visible(chains, alone, np.column_stack([region, np.arange(len(pieces)) - piece_starts[region]]))


def _together(tables: list[Array], width: int) -> tuple[Array, Ints]:
    """Return tables one after the other, and where each starts."""
    starts = np.concatenate([[0], np.cumsum([len(table) for table in tables])]).astype(np.int64)
    return np.concatenate([np.empty((0, width)), *tables]), starts


def _merged(found: Array) -> list[Stretch]:
    """Return stretches by piece and start, those joined that cells have parted."""
    made: list[Stretch] = []
    for piece, lo, hi in found[np.lexsort((found[:, 1], found[:, 0]))].tolist():
        if made and made[-1].piece == piece and lo <= made[-1].hi:
            made[-1] = made[-1]._replace(hi=max(made[-1].hi, hi))
        else:
            made.append(Stretch(int(piece), lo, hi))
    return made


def _without_repeats(stretches: Sequence[Stretch], pieces: Array) -> list[Stretch]:
    """Keep one of the stretches that coincide: snug where overlap lies on both sides."""
    kept: list[Stretch | None] = []
    for own in stretches:
        pacing.check()
        line, (x, y) = on_line(pieces, *pieces[own.piece, :4].reshape(2, 2)), pieces[own.piece, 2:4].tolist()
        scale = max(float(np.abs(pieces[own.piece, :2]).sum()), LEAST_SCALE)
        rest = np.array([[own.lo, own.hi]])
        for place, known in enumerate(list(kept)):
            if known is None or not line[known.piece]:
                continue
            u, v = pieces[known.piece, 2:4].tolist()
            opposed = not x * u + y * v > 0.0
            lo, hi = (-known.hi, -known.lo) if opposed else (known.lo, known.hi)
            left = _less(rest, lo, hi, scale)
            if np.array_equal(left, rest):
                continue
            if opposed:
                begin, end = max(known.lo, -own.hi), min(known.hi, -own.lo)
                outside = _less(np.array([[known.lo, known.hi]]), begin, end, scale)
                kept += [known._replace(lo=p, hi=q) for p, q in outside.tolist()]
                kept.append(known._replace(lo=begin, hi=end, snug=True))
                kept[place] = None
            else:
                kept[place] = known._replace(dropped=True)
            rest = left
        kept += [Stretch(own.piece, p, q) for p, q in rest.tolist()]
    return [known for known in kept if known is not None]


def on_line(table: Array, base: Array, travel: Array) -> Flags:
    """Tell which rows of a table of pieces, see `Region.table`, lie on a line."""
    turned = np.abs(travel[0] * table[:, 3] - travel[1] * table[:, 2])
    near = DEFAULT.nominal * max(float(np.abs(base).sum()), LEAST_SCALE)
    return ~(turned > DEFAULT.nominal) & (np.abs(base - table[:, :2]).sum(axis=1) <= near)


def _less(spans: Array, lo: float, hi: float, scale: float) -> Array:
    """Return what an open interval leaves of closed ones, but for slivers."""
    left = np.concatenate([spans, spans])
    return left[: kernels.take_out(left, np.empty_like(left), len(spans), lo, hi, DEFAULT.line, scale, False)]


def _chained(kept: list[Stretch], pieces: Array, parts: Sequence[tuple[int, int]]) -> list[list[Stretch]]:
    """Join stretches where one ends and another starts, snug ones apart, of several the one of the same parts."""
    if not kept:
        return []
    own, lo, hi, snug, _ = (np.array(column) for column in zip(*kept, strict=True))
    base, travel = pieces[own, :2], pieces[own, 2:4]
    ends = [base + np.where(travel != 0.0, s[:, None] * travel, 0.0) for s in (lo, hi)]
    free, chains = np.ones(len(kept), bool), []
    for first in range(len(kept)):
        if not free[first]:
            continue
        free[first] = False
        row = deque([first])
        for forward in (True, False):
            while True:
                tip = row[-1] if forward else row[0]
                place, others = ends[forward][tip], ends[not forward]
                size = np.abs(others).sum(axis=1) + np.abs(place).sum()
                fits = free & (snug == snug[first]) & (size < np.inf)
                fits &= np.abs(others - place).sum(axis=1) < DEFAULT.nominal * size
                found = np.flatnonzero(fits).tolist()
                if not found:
                    break
                after = next((k for k in found if parts[own[k]] == parts[own[tip]]), found[0])
                free[after] = False
                (row.append if forward else row.appendleft)(after)
        chains.append([kept[k] for k in row])
    return chains


def _passed(piece: Array, s: float, kept: list[Stretch], pieces: Array) -> bool:
    """Tell whether one of the stretches passes a point of a piece."""
    place = piece[:2] + s * piece[2:4]
    rows = np.array([own[:3] for own in kept]).reshape(-1, 3)
    base, travel = (pieces[rows[:, 0].astype(np.int64), k : k + 2] for k in (0, 2))
    way = place - base
    along = np.clip((way * travel).sum(axis=1), rows[:, 1], rows[:, 2])[:, None] * travel
    return bool((np.hypot(*(way - along).T) <= DEFAULT.nominal * np.abs(place).sum()).any())
