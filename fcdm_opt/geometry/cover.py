"""Cover of a star-shaped solid by convex parts that all hold its seed.

What a half-space through the seed leaves of a solid that is star-shaped about it is star-shaped too; the inner side of
a facet at a reflex edge settles that edge. Cut like that until no reflex edge is left, the solid is convex.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.cells import Arrangement, Cell, Facet
from fcdm_opt.geometry.partition import Edge, inner_edges, reflex_edges

TARGETS = 6  # largest pieces still to be covered that a part is grown around, of which the best is taken


def is_star_shaped(space: Arrangement, facets: Sequence[Facet], seed: int) -> bool:
    """Tell whether a point is on the inner side of, or on, every facet's plane."""
    return all(space.signs[plane, seed] != side for plane, side in {(facet.plane, facet.side) for facet in facets})


def cover(
    space: Arrangement, hull: Cell, facets: Sequence[Facet], seed: int, cells: Sequence[Cell], most: int
) -> list[Cell] | None:
    """Return convex parts of the solid that hold the seed and together are all of it; None for more than `most`.

    Parameters
    ----------
    space : Arrangement
    hull : Cell
        Of the solid.
    facets : sequence of Facet
        Of its surface, without those on the hull.
    seed : int
        Row of a point about which the solid is star-shaped.
    cells : sequence of Cell
        A partition of it.
    most : int
    """
    left, parts = list(cells), list[Cell]()
    while left:
        options = list[tuple[float, int, Cell, list[Cell]]]()
        for target in sorted(left, key=space.volume, reverse=True)[:TARGETS]:
            if (part := _grown(space, hull, facets, seed, target, left)) is not None:
                rest = [own for piece in left for own in _less(space, piece, part)]
                options.append((sum(map(space.volume, rest)), len(options), part, rest))
        if not options or len(parts) == most:
            return None
        *_, part, left = min(options, key=lambda option: option[:2])
        parts.append(part)
    for part in list(parts):
        others = [own for own in parts if own is not part]
        if not _without(space, part, others):
            parts = others
    return None if any(_without(space, part, cells) for part in parts) else parts


def _grown(
    space: Arrangement, cell: Cell, facets: Sequence[Facet], seed: int, target: Cell, left: Sequence[Cell]
) -> Cell | None:
    """Return a convex part of the solid that holds the seed and the middle of the target, and much of what is left."""
    middle = space.local[target.points].mean(axis=0)
    weights = np.concatenate([np.full(len(own.points), space.volume(own)) for own in left])
    points = np.concatenate([own.points for own in left])
    total = max(float(weights.sum()), float(np.finfo(float).tiny))
    whole: Cell | None = cell
    while whole is not None:
        reflex = reflex_edges(space, facets, inner_edges(space, whole, facets)) if facets else {}
        if not reflex:
            inner = {(f.plane, f.side) for f in facets if _height(space, f.plane, middle) * f.side < space.slack}
            return space.kept(whole, sorted(inner))
        best, most = None, -1.0
        for plane, side in sorted({(f.plane, f.side) for own in reflex.values() for f in own}):
            if _height(space, plane, middle) * side > -space.slack:
                continue
            share = (space.signs[plane, target.points] * side <= 0).mean()
            held = float(share == 1) + (weights * (space.signs[plane, points] * side <= 0)).sum() / total
            if held > most:
                best, most = (plane, side), held
        if best is None:  # the middle is seen round the end of an edge
            best = _beside(space, *next(iter(reflex.items())), seed, middle)
        plane, side = best
        facets = space.split_facets(facets, plane)[0 if side > 0 else 1]
        whole = space.kept(whole, [best])
    return None


def _beside(space: Arrangement, edge: Edge, own: Sequence[Facet], seed: int, middle: Array) -> tuple[int, int]:
    """Return a plane through a reflex edge and the seed, and the side of it that the middle is not on."""
    a, b = space.local[list(edge)] - space.local[seed]
    on_line = np.linalg.norm(np.cross(a, b)) <= space.slack * np.linalg.norm(b - a)
    plane = own[0].plane if on_line else space.plane([*edge, seed])
    return plane, -1 if _height(space, plane, middle) > 0 else 1


def _height(space: Arrangement, plane: int, place: Array) -> float:
    return float(space.normals[plane] @ place - space.levels[plane])


def _less(space: Arrangement, cell: Cell, part: Cell) -> list[Cell]:
    """Return convex cells that fill what a part leaves of a cell; the cell itself where they are apart."""
    heights = space.signs[part.planes[:, None], cell.points] * part.sides[:, None]
    if (heights >= 0).all(axis=1).any():
        return [cell]
    pieces, rest = list[Cell](), cell
    for k in np.flatnonzero((heights > 0).any(axis=1)).tolist():
        inner, outer = space.split(rest, int(part.planes[k]))[:: int(part.sides[k])]
        if inner is None:
            return [cell]
        if outer is not None:
            pieces.append(outer)
        rest = inner
    return pieces


def _without(space: Arrangement, cell: Cell, others: Sequence[Cell]) -> list[Cell]:
    left = [cell]
    for other in others:
        left = [piece for own in left for piece in _less(space, own, other)]
    return left
