"""The boundary of a union of overlap regions: what each pair's boundary leaves outside every other open region.

Only the part pairs that can be on it in the box are looked at, cell by cell (`pruning`): all others are
apart there, or hidden by a pair that overlaps in a whole cell.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import located
from fcdm_opt.curve.pruning import region_between, relevant_pairs
from fcdm_opt.curve.region import Piece, Region, same_pair
from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
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
    isolated: list[tuple[int, float]]
    owners: Ints  # (pieces, 2): the region of each piece, and its number in there


def visible(regions: Sequence[Region], cells: Array, members: Ints, shares: Ints) -> Visible:
    """Return what is on the boundary of a union of regions; cells, members and shares as in `envelope.Union`."""
    lines, line_starts = _stacked([region.unit_lines for region in regions], 3)
    pieces, piece_starts = _stacked([region.table for region in regions], 6)
    found = kernels.stretches(lines, line_starts, pieces, piece_starts, cells, members, shares, LIMITS)
    point = found[:, 1] == found[:, 2]
    region = np.repeat(np.arange(len(regions)), np.diff(piece_starts))
    with np.errstate(invalid="ignore"):  # ends at infinity are nowhere near each other
        kept = _without_repeats(_merged(found[~point]), pieces)
        chains = _chained(kept, pieces, [regions[k].parts for k in region.tolist()])
        isolated = [
            (int(piece), s) for piece, s, _ in found[point].tolist() if not _passed(pieces[int(piece)], s, kept, pieces)
        ]
    return Visible(chains, isolated, np.column_stack([region, np.arange(len(pieces)) - piece_starts[region]]))


def _stacked(tables: list[Array], width: int) -> tuple[Array, Ints]:
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
            remaining = _less(rest, lo, hi, scale)
            if np.array_equal(remaining, rest):
                continue
            if opposed:
                begin, end = max(known.lo, -own.hi), min(known.hi, -own.lo)
                outside = _less(np.array([[known.lo, known.hi]]), begin, end, scale)
                kept += [known._replace(lo=p, hi=q) for p, q in outside.tolist()]
                kept.append(known._replace(lo=begin, hi=end, snug=True))
                kept[place] = None
            else:
                kept[place] = known._replace(dropped=True)
            rest = remaining
        kept += [Stretch(own.piece, p, q) for p, q in rest.tolist()]
    return [known for known in kept if known is not None]


def on_line(table: Array, base: Array, travel: Array) -> Flags:
    """Tell which rows of a table of pieces, see `Region.table`, lie on a line."""
    turned = np.abs(travel[0] * table[:, 3] - travel[1] * table[:, 2])
    near = DEFAULT.nominal * max(float(np.abs(base).sum()), LEAST_SCALE)
    return ~(turned > DEFAULT.nominal) & (np.abs(base - table[:, :2]).sum(axis=1) <= near)


def _less(spans: Array, lo: float, hi: float, scale: float) -> Array:
    """Return what an open interval leaves of closed ones, but for slivers."""
    rest = np.concatenate([spans, spans])
    return rest[: kernels.take_out(rest, np.empty_like(rest), len(spans), lo, hi, DEFAULT.line, scale, False)]


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
    offset = place - base
    along = np.clip((offset * travel).sum(axis=1), rows[:, 1], rows[:, 2])[:, None] * travel
    return bool((np.hypot(*(offset - along).T) <= DEFAULT.nominal * np.abs(place).sum()).any())


Limits = tuple[tuple[float, float], tuple[float, float]]


class Run(NamedTuple):
    """Consecutive pieces with one label and one line: the whole stretch, and the pieces of the part pairs in it."""

    whole: Piece
    pieces: tuple[Piece, ...]

    def at(self, rho: Array) -> Piece:
        """Return the piece in which a scale pair of the stretch lies."""
        s = self.whole.parameter(rho)
        return next((p for p in self.pieces if s <= self.whole.parameter(p.end)), self.pieces[-1])


@dataclass(frozen=True, eq=False)
class Union:
    """The overlap regions of two unions of parts, of all part pairs that can be on their curve in a box."""

    movable: Body
    static: Body
    regions: tuple[Region, ...]  # in the order of the part pairs
    hiding: tuple[Region, ...]  # others, each of which holds parts of the box that no cell covers
    cells: Array  # (m, 4): parts of the box, (low, high) of rho_1, then of rho_2. Outside them no curve passes
    members: Ints  # members, shares: regions that matter in cell c: members[shares[c]:shares[c + 1]]
    shares: Ints
    shared: tuple[bool, ...]  # of each region, whether other pairs that end with it along one line were left out for it
    walked: int  # part pairs that were looked at more closely than by bounds

    @classmethod
    def of(cls, movable: Body, static: Body, transform: Array, box: Limits) -> Union:
        """Return the union in a box of rho_1 and rho_2, finite; `transform`, (4, 4): pose change of body 1."""
        (a, b), (c, d) = ((low * (1.0 - DEFAULT.rim), high * (1.0 + DEFAULT.rim)) for low, high in box)
        walked, found, hiding, marked = relevant_pairs(movable, static, transform, (a, b, c, d))
        used = sorted({code for _, codes in found for code in codes})
        number = {code: k for k, code in enumerate(used)}
        return cls(
            movable,
            static,
            tuple(walked[code] for code in used),
            tuple(walked[code] for code in sorted(hiding.difference(used))),
            np.array([cell for cell, _ in found]).reshape(-1, 4),
            np.array([number[code] for _, codes in found for code in codes], np.int64),
            np.cumsum([0, *(len(codes) for _, codes in found)]),
            tuple(code in marked for code in used),
            len(walked),
        )

    @cached_property
    def _visible(self) -> Visible:
        if any(region.status == "full" for region in self.regions):
            return Visible([], [], np.empty((0, 2), np.int64))  # no curve
        return visible(self.regions, self.cells, self.members, self.shares)

    @cached_property
    def chains(self) -> list[list[Run]]:
        """The chains of the union's boundary in the box, overlap on the left, each in order."""
        # pieces that two pairs share count once; where the pairs lie on opposite sides the piece is marked `snug`
        chains = []
        for chain in self._visible.chains:
            pacing.check()
            made = []
            for stretch in chain:
                k, number = self._visible.owners[stretch.piece].tolist()
                piece = _named(self.regions[k], self.regions[k].piece(number).cut(stretch.lo, stretch.hi), stretch.snug)
                solid = not (self.movable.is_surface or self.static.is_surface)
                several = (stretch.dropped or self.shared[k]) and solid
                made.append(self._equals(piece) if several else [piece])
            chains.append(_one_each(made))
        return [_joined(chain) for chain in _sorted(chains)]

    @cached_property
    def isolated(self) -> list[tuple[Array, Piece, Piece]]:
        """Single scale pairs of the union's boundary, on none of its chains: a fit without play on all sides."""
        # each with pieces of two different directions that pass there, the first by their labels, cut to the point
        found: list[tuple[Array, list[Piece]]] = []
        for piece_number, s in self._visible.isolated:
            k, number = self._visible.owners[piece_number].tolist()
            region = self.regions[k]
            piece = region.piece(number).cut(s, s)
            rho = piece.start
            if not rho.min() > LEAST_SCALE:
                continue
            piece = _named(region, piece, False)
            for place, pieces in found:
                if same_pair(place, rho):
                    pieces.append(piece)
                    break
            else:
                found.append((rho, [piece]))
        chosen = []
        for place, pieces in sorted(found, key=lambda own: tuple(own[0])):
            first, *others = sorted(pieces, key=_key)
            second = next((piece for piece in others if not _parallel(first, piece)), None)
            if second is not None:
                chosen.append((place, first, second))
        return chosen

    def _equals(self, piece: Piece) -> list[Piece]:
        """Return the pieces of all part pairs that touch all along a visible stretch."""
        middle, found = _middle(piece), [piece]
        pose = kernels.relative_pose(self.regions[0].transform, self.movable.seed, self.static.seed)
        near = DEFAULT.nominal * max(self.movable.size, self.static.size)
        gaps = kernels.near_gaps(*self.movable.packed, *self.static.packed, pose, middle, near)
        own = _foremost(self.movable, self.static, pose, piece.normal, piece.parts)
        for i, j in np.argwhere(np.abs(gaps) <= near).tolist():
            if _foremost(self.movable, self.static, pose, piece.normal, (i, j)) == own:
                continue  # the same corners, in another part
            region = region_between(self.movable, self.static, self.regions[0].transform, (i, j))
            along = on_line(region.table, piece.base, piece.travel) & (region.table[:, 2:4] @ piece.travel > 0.0)
            for number in np.flatnonzero(along).tolist():
                other = region.piece(number)
                shift = float((piece.base - other.base) @ other.travel)
                slack = DEFAULT.nominal * (float(np.abs(middle).sum()) + 1.0)
                lo, hi = (
                    end if abs(s + shift - end) <= slack else s + shift
                    for s, end in ((piece.lo, other.lo), (piece.hi, other.hi))
                )
                if other.lo <= lo < hi <= other.hi:
                    found.append(_named(region, other.cut(lo, hi), piece.snug))
        return found


def _foremost(
    movable: Body, static: Body, pose: Array, normal: Array, parts: tuple[int, int]
) -> tuple[frozenset[Element], ...]:
    """Return the bodies' elements that the foremost corners of two parts belong to, along a direction from 1 to 2."""
    found = []
    for body, k, direction in ((movable, parts[0], normal @ pose[:9].reshape(3, 3)), (static, parts[1], -normal)):
        part = body.parts[k]
        heights = (part.vertices - part.seed) @ direction
        top = np.flatnonzero(heights >= heights.max() - DEFAULT.tie * body.size)
        found.append(frozenset(part.elements["V"][v] for v in top.tolist()))
    return tuple(found)


def _one_each(chain: list[list[Piece]]) -> list[Piece]:
    """Choose one piece of each stretch, whatever the order of the parts."""
    # a feature stays as long as it lasts along one line; of several that last equally long the first by its labels
    chosen: list[Piece] = []
    while len(chosen) < len(chain):
        first = len(chosen)
        lasting = {_key(piece) for piece in chain[first]}
        stop = first + 1
        while stop < len(chain) and _one_line(chain[stop - 1][0], chain[stop][0]):
            both = lasting & {_key(piece) for piece in chain[stop]}
            if not both:
                break
            lasting, stop = both, stop + 1
        name = min(lasting)
        chosen += [next(piece for piece in stretch if _key(piece) == name) for stretch in chain[first:stop]]
    return chosen


def _key(piece: Piece) -> tuple[object, ...]:
    feature = piece.feature
    return feature.kind, tuple(sorted(feature.one.vertices)), tuple(sorted(feature.two.vertices))


def _middle(piece: Piece) -> Array:
    """Return the middle of a stretch, or a place as far on as (1, 1) where an end is at infinity."""
    ends = [piece.end_at(s) for s in (piece.lo, piece.hi) if np.isfinite(s)]
    return np.mean(ends, axis=0) if len(ends) == 2 else sum(ends, np.zeros(2)) + np.abs(piece.travel)


def _named(region: Region, piece: Piece, snug: bool) -> Piece:
    """Return a visible piece, with the name of what touches in its middle."""
    contact = piece.contact
    if region.one.elements.spans or region.two.elements.spans:
        contact = located(region.one, region.two, region.pose, contact, _middle(piece))
    return piece if contact is piece.contact and not snug else replace(piece, contact=contact, snug=snug)


def boundary(region: Region) -> list[list[Run]]:
    """Return the chains of one region's boundary in the whole quadrant, overlap on the left, each in order."""
    return [_joined(chain) for chain in _sorted([list(chain) for chain in region.chains])]


def inside(region: Region, base: Array, travel: Array) -> tuple[float, float]:
    """Return the open interval of s in which base + s travel lies inside the open region (lo >= hi if none)."""
    if region.status != "bounded":
        return (-np.inf, np.inf) if region.status == "full" else (0.0, 0.0)
    return kernels.interval(region.unit_lines, base, travel, LIMITS)


def _sorted(chains: list[list[Piece]]) -> list[list[Piece]]:
    """Return chains by their first scale pair; closed ones start at their least rho_1, then rho_2."""

    def place(piece: Piece) -> tuple[float, ...]:
        return tuple(np.nan_to_num(piece.start, posinf=np.inf, neginf=np.inf))

    for k, chain in enumerate(chains):
        if len(chain) > 1 and same_pair(chain[-1].end, chain[0].start):
            first = min(range(len(chain)), key=lambda m: place(chain[m]))
            chains[k] = chain[first:] + chain[:first]
    return sorted(chains, key=lambda chain: place(chain[0]))


def _joined(chain: list[Piece]) -> list[Run]:
    """Join consecutive pieces with one label and one line (a face that several parts share) into one run."""
    # edges are then labelled from the vertex at which their contact starts
    runs = [Run(chain[0], (chain[0],))]
    for piece in chain[1:]:
        whole, pieces = runs[-1]
        if piece.feature == whole.feature and _one_line(piece, whole):
            hi = whole.parameter(piece.end) if np.isfinite(piece.hi) else np.inf
            runs[-1] = Run(replace(whole, hi=hi, last=piece.last, corner=piece.corner), (*pieces, piece))
            continue
        contact = pieces[-1].feature.merged(piece.feature) if pieces[-1].parts == piece.parts else None
        feature = piece.feature.starting_at(contact) if contact else piece.feature
        runs.append(Run(replace(piece, contact=piece.contact.labelled(feature)), (piece,)))
    return runs


def _parallel(one: Piece, two: Piece) -> bool:
    return bool(abs(one.travel[0] * two.travel[1] - one.travel[1] * two.travel[0]) <= DEFAULT.nominal)


def _one_line(one: Piece, two: Piece) -> bool:
    apart = np.abs(one.base - two.base).sum()
    return bool(_parallel(one, two) and apart <= DEFAULT.nominal * max(np.abs(one.base).sum(), LEAST_SCALE))
