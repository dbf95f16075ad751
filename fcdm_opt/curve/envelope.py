"""The boundary of a union of overlap regions: what each pair's boundary leaves outside every other open region."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fcdm_opt.curve.region import Piece, Region, same_pair
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerances import DEFAULT

_LEAST_SCALE = 1e-6  # lines that pass this near to (0, 0) are compared as lines through it


class Run(NamedTuple):
    """Consecutive pieces with one label and one line: the whole stretch, and the pieces of the part pairs in it."""

    whole: Piece
    pieces: tuple[Piece, ...]

    def at(self, rho: Array) -> Piece:
        """Return the piece in which a scale pair of the stretch lies."""
        s = self.whole.parameter(rho)
        return next((p for p in self.pieces if s <= self.whole.parameter(p.end)), self.pieces[-1])


def boundary(regions: Sequence[Region]) -> list[list[Run]]:
    """Return the chains of the union's boundary, overlap on the left, each in order.

    Pieces that two pairs share count once; where the pairs lie on opposite sides the piece is marked `snug`.
    """
    if any(region.status == "full" for region in regions):
        return []
    if len(regions) == 1:
        return [_joined(chain) for chain in _sorted([list(chain) for chain in regions[0].chains])]
    pieces = _without_repeats([left for k in range(len(regions)) for left in _outside_others(regions, k)])
    return [_joined(chain) for chain in _sorted(_chains(pieces))]


def _sorted(chains: list[list[Piece]]) -> list[list[Piece]]:
    """Return chains by their first scale pair."""
    return sorted(chains, key=lambda chain: tuple(np.nan_to_num(chain[0].start, posinf=np.inf, neginf=np.inf)))


def overlap_interval(region: Region, base: Array, travel: Array) -> tuple[float, float]:
    """Return the open interval of s in which base + s travel lies inside the open region (lo >= hi if none)."""
    if region.status != "bounded":
        return (-np.inf, np.inf) if region.status == "full" else (0.0, 0.0)
    lines = region.unit_lines
    value, slope = lines[:, :2] @ base - lines[:, 2], lines[:, :2] @ travel
    flat = np.abs(slope) <= DEFAULT.tie
    if np.any(value[flat] <= DEFAULT.line * (np.abs(base).sum() + np.abs(lines[flat, 2]))):
        return 0.0, 0.0
    at = -value[~flat] / slope[~flat]
    rising = slope[~flat] > 0
    return float(at[rising].max(initial=-np.inf)), float(at[~rising].min(initial=np.inf))


def _outside_others(regions: Sequence[Region], own: int) -> list[Piece]:
    """Return what remains of a region's boundary outside the other open regions."""
    left = []
    others = [region for k, region in enumerate(regions) if k != own and region.status != "empty"]
    for piece in regions[own].pieces:
        spans = [(piece.lo, piece.hi)]
        for region in others:
            if not spans:
                break
            spans = _minus(spans, *overlap_interval(region, piece.base, piece.travel), _scale(piece))
        left += [piece if span == (piece.lo, piece.hi) else piece.cut(*span) for span in spans]
    return left


def _scale(piece: Piece) -> float:
    """Return the size of a piece's scale pairs, which rounding is relative to."""
    return max(float(np.abs(piece.base).sum()), _LEAST_SCALE)


def _minus(spans: list[tuple[float, float]], lo: float, hi: float, scale: float) -> list[tuple[float, float]]:
    """Take an open interval out of a list of closed ones; slivers within rounding are dropped."""
    if hi <= lo:
        return spans
    rest = []
    for a, b in spans:
        for p, q in ((a, min(b, lo)), (max(a, hi), b)):
            if p < q and q - p > DEFAULT.line * (scale + min(abs(p), abs(q))):  # two infinite ends: none left
                rest.append((p, q))
    return rest


def _without_repeats(pieces: list[Piece]) -> list[Piece]:
    """Keep one of the pieces that coincide; where their overlap sides differ it is snug."""
    kept: list[Piece] = []
    for piece in pieces:
        rest = [piece]
        for known in list(kept):
            if not _one_line(piece, known):
                continue
            same = float(piece.travel @ known.travel)
            lo, hi = sorted(same * s + float(piece.base @ piece.travel) for s in (known.lo, known.hi))
            if all(_minus([(p.lo, p.hi)], lo, hi, _scale(p)) == [(p.lo, p.hi)] for p in rest):
                continue
            if same < 0:
                kept.remove(known)
                kept += _marked_snug(known, piece)
            rest = [p.cut(a, b) for p in rest for a, b in _minus([(p.lo, p.hi)], lo, hi, _scale(p))]
        kept += rest
    return kept


def _one_line(one: Piece, two: Piece) -> bool:
    cross = abs(one.travel[0] * two.travel[1] - one.travel[1] * two.travel[0])
    apart = np.abs(one.base - two.base).sum()
    return bool(cross <= DEFAULT.nominal and apart <= DEFAULT.nominal * _scale(one))


def _marked_snug(known: Piece, other: Piece) -> list[Piece]:
    """Split a piece where an opposite one covers it."""
    lo, hi = sorted(-s for s in (other.lo, other.hi))
    inside = (max(known.lo, lo), min(known.hi, hi))
    outside = [known.cut(a, b) for a, b in _minus([(known.lo, known.hi)], *inside, _scale(known))]
    return [*outside, replace(known.cut(*inside), snug=True)]


def _chains(pieces: list[Piece]) -> list[list[Piece]]:
    """Join pieces where one ends and another starts, snug ones apart."""
    rest = list(pieces)
    chains: list[list[Piece]] = []
    while rest:
        chain = [rest.pop(0)]
        for forward in (True, False):
            while True:
                tip = chain[-1].end if forward else chain[0].start
                found = next(
                    (
                        p
                        for p in sorted(rest, key=lambda p: p.parts != (chain[-1] if forward else chain[0]).parts)
                        if p.snug == chain[0].snug and same_pair(p.start if forward else p.end, tip)
                    ),
                    None,
                )
                if found is None:
                    break
                rest.remove(found)
                chain.insert(len(chain) if forward else 0, found)
        chains.append(chain)
    return chains


def _joined(chain: list[Piece]) -> list[Run]:
    """Join consecutive pieces with one label and one line (a face that several parts share) into one run.

    Edges are then labelled from the vertex at which their contact starts.
    """
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
