"""Partition of a solid into convex cells: cut at reflex edges along face planes, then joined where cuts ran too far.

A convex cell of space is cut, together with the facets of the surface in it, until they have no reflex edge; what is
inside then is the cell within its facets' planes. Only convex polygons and convex cells are ever cut.

A star-shaped solid may be covered by convex parts that all hold its seed instead.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.cells import Arrangement, Cell, Facet
from fcdm_opt.geometry.measures import cross
from fcdm_opt.geometry.polygons import components

Edge = tuple[int, int]


class Rule(NamedTuple):
    """How a cutting plane is chosen: what counts for it or against it, in reflex edges that it settles."""

    edge: float  # against it: a reflex edge or a facet that it cuts
    facet: float
    # for it: that it is no facet's plane, but goes through two reflex edges. None: only facets' planes are tried
    diagonal: float | None = None
    last: bool = False  # of equally good planes the last one is taken


RULES = (Rule(1.0, 1e-3), Rule(2.0, 0.0, 0.5), Rule(1.0, 1e-3, 0.0), Rule(0.5, 0.1, last=True))
NEAREST = 4  # edges that a diagonal plane is tried through, of each edge


def partition(
    space: Arrangement, cell: Cell, facets: Sequence[Facet], rule: Rule, most: int | None = None
) -> list[Cell] | None:
    """Return convex cells that fill what the facets bound in a cell; None where they are more than so many.

    `cell`: convex, and inside the solid where it holds no facets. `facets`: of the solid's surface, inside the cell; on
    its border they are left out. Raises `InputError` where the facets bound no solid.
    """
    found: list[Cell] = []
    stack: list[tuple[Cell, Sequence[Facet]]] = [(cell, facets)]
    while stack:
        if most is not None and len(found) + len(stack) > most:
            return None
        cell, facets = stack.pop()
        if not facets:
            found.append(cell)
            continue
        around = inner_edges(space, cell, facets)
        reflex = reflex_edges(space, facets, around)
        if not reflex and _connected(facets, around):
            inner = space.kept(cell, dict.fromkeys((facet.plane, facet.side) for facet in facets))
            if inner is not None:
                found.append(inner)
            continue
        plane = _best_plane(space, facets, reflex, rule)
        low, high, on = space.split_facets(facets, plane)
        cells = space.split(cell, plane)
        if None in cells and not on:
            raise InputError("the faces bound no solid: no plane settles their edges", key="mesh")
        for child, its, side in zip(cells, (low, high), (-1, 1), strict=True):
            if child is not None and (its or _is_inside(space, on, plane, side)):
                stack.append((child, its))
    return found


def partition_by_features(space: Arrangement, cell: Cell, facets: Sequence[Facet], rule: Rule) -> list[Cell]:
    """Return what `partition` does, of cells that are first divided along planes that cut no facet."""
    # so the walls of one hole, pocket or boss are cut along by no plane of another's, and each can move by itself
    found: list[Cell] = []
    stack: list[tuple[Cell, Sequence[Facet]]] = [(cell, facets)]
    while stack:
        cell, facets = stack.pop()
        plane = _dividing_plane(space, cell, facets)
        if plane is None:
            found += merged(space, partition(space, cell, facets, rule) or [])
            continue
        low, high, _ = space.split_facets(facets, plane)
        stack += [(child, its) for child, its in zip(space.split(cell, plane), (low, high), strict=True) if child]
    return found


def _dividing_plane(space: Arrangement, cell: Cell, facets: Sequence[Facet]) -> int | None:
    """Return a plane parallel to a wall of a cell that cuts no facet and has facets on both sides; None without one."""
    # the one in the middle of the widest room between facets, else one that facets only touch
    if len(facets) < 2:
        return None
    loops = np.concatenate([facet.loop for facet in facets])
    starts = np.cumsum([0] + [len(facet.loop) for facet in facets[:-1]])
    best: tuple[float, int, int, int] | None = None
    for wall in cell.planes.tolist():
        heights = space.heights(loops, wall)
        low, high = (end.reduceat(heights, starts) for end in (np.minimum, np.maximum))
        order = np.argsort(low, kind="stable")
        top = np.maximum.accumulate(high[order])
        rooms = low[order][1:] - top[:-1]
        # facets that lie in the plane are on neither side of it
        rooms[(top[:-1] - low[order][0] <= space.slack) | (high.max() - low[order][1:] <= space.slack)] = -np.inf
        k = int(rooms.argmax())
        if rooms[k] >= -space.slack and (best is None or rooms[k] > best[0] + space.slack):
            ends = [int(loops[np.abs(heights - level).argmin()]) for level in (top[k], low[order][k + 1])]
            best = float(rooms[k]), wall, *ends
    return None if best is None else space.parallel(best[1], best[2:])


def inner_edges(space: Arrangement, cell: Cell, facets: Sequence[Facet]) -> dict[Edge, list[Facet]]:
    """Return the facets at each edge inside a cell."""
    around: dict[Edge, list[Facet]] = {}
    for facet in facets:
        a = facet.loop[-1]
        for b in facet.loop:
            around.setdefault((a, b) if a < b else (b, a), []).append(facet)
            a = b
    on = space.signs[cell.planes[:, None, None], np.array(list(around)).T] == 0
    outer = on.all(axis=1).any(axis=0).tolist()
    return {edge: own for (edge, own), out in zip(around.items(), outer, strict=True) if not out}


def reflex_edges(
    space: Arrangement, facets: Sequence[Facet], around: dict[Edge, list[Facet]]
) -> dict[Edge, list[Facet]]:
    """Return the edges at which the solid is not convex: one facet rises above another, or more than two meet."""
    rows = {plane: space.signs[plane].tolist() for plane in {facet.plane for facet in facets}}

    def rises(one: Facet, two: Facet) -> bool:
        row, side = rows[one.plane], one.side
        return any(row[v] == side for v in two.loop)

    return {
        edge: own
        for edge, own in around.items()
        if len(own) > 2 or (len(own) == 2 and (rises(own[0], own[1]) or rises(own[1], own[0])))
    }


def _connected(facets: Sequence[Facet], around: dict[Edge, list[Facet]]) -> bool:
    place = {facet: k for k, facet in enumerate(facets)}
    links = [(place[own[0]], place[other]) for own in around.values() for other in own[1:]]
    return not components(np.array(links), len(facets)).any()


def _best_plane(space: Arrangement, facets: Sequence[Facet], reflex: dict[Edge, list[Facet]], rule: Rule) -> int:
    """Return the plane that settles most reflex edges and cuts fewest others: a facet's, or one through two edges."""
    at = [facet for own in reflex.values() for facet in own] if reflex else facets
    planes = np.array(sorted({facet.plane for facet in at}))
    loops = np.concatenate([facet.loop for facet in facets])
    starts = np.cumsum([0] + [len(facet.loop) for facet in facets[:-1]])
    points, place = np.unique(loops, return_inverse=True)
    signs = space.signs[planes[:, None], points]
    pairs = _diagonals(space, reflex) if rule.diagonal is not None else np.empty((0, 4), np.int64)
    if len(pairs):
        signs = np.vstack([signs, space.signs_of(pairs, points)])
    own = signs[:, place]
    crossed = np.minimum.reduceat(own, starts, axis=1) * np.maximum.reduceat(own, starts, axis=1) < 0
    score = -rule.facet * crossed.sum(axis=1)
    if reflex:
        a, b = (signs[:, np.searchsorted(points, ends)] for ends in np.array(list(reflex)).T)
        score = score + ((a == 0) & (b == 0)).sum(axis=1) - rule.edge * (a * b < 0).sum(axis=1)
        score[len(planes) :] += rule.diagonal or 0.0
    while True:
        k = int(np.flatnonzero(score == score.max())[-1 if rule.last else 0])
        if k < len(planes):
            return int(planes[k])
        plane = space.shared_plane(pairs[k - len(planes)].tolist())
        if plane is not None:
            return plane
        score[k] = -np.inf


def _diagonals(space: Arrangement, reflex: dict[Edge, list[Facet]]) -> Ints:
    """Return pairs of reflex edges that lie in a plane that is no facet's, of each edge the nearest; nearest first."""
    reflex = {edge: own for edge, own in reflex.items() if len(own) == 2}
    edges = np.array(list(reflex), np.int64).reshape(-1, 2)
    if len(edges) < 2:
        return np.empty((0, 4), np.int64)
    a, b = space.local[edges.T]
    along, middle = b - a, (a + b) / 2
    distance = ((middle[:, None] - middle) ** 2).sum(axis=2)
    # of the triangles on edge i with a corner at an end of edge j
    across = cross(along[:, None], np.stack([a, b])[:, None] - a[:, None])
    flat = np.abs((across[0] * along).sum(axis=2)) <= space.slack
    flat &= (across**2).sum(axis=3).max(axis=0) > space.slack**2
    planes = [{facet.plane for facet in own} for own in reflex.values()]
    found = []
    for i, row in enumerate(np.argsort(distance, axis=1, kind="stable")):
        near = (j for j in row[flat[i, row]].tolist() if j != i and not planes[i] & planes[j])
        found += [(min(i, j), max(i, j)) for j in islice(near, NEAREST)]
    pairs = sorted(dict.fromkeys(found), key=lambda pair: distance[pair])
    return np.array([[*edges[i], *edges[j]] for i, j in pairs], np.int64).reshape(-1, 4)


def _is_inside(space: Arrangement, on: Iterable[Facet], plane: int, side: int) -> bool:
    """Tell whether the side of a plane without facets is inside, by the facets on the plane."""
    # without any the plane goes through reflex edges, beyond which it is
    normal = space.normals[plane]
    facing = {facet.side if space.normals[facet.plane] @ normal > 0 else -facet.side for facet in on}
    if len(facing) > 1:
        raise InputError("the faces bound no solid: they do not agree on what is inside", key="mesh")
    return side not in facing


def merged(space: Arrangement, cells: Sequence[Cell]) -> list[Cell]:
    """Join cells, two at a time, as long as two of them make a convex one."""
    # two cells make a convex one when the plane between them is all that keeps either from holding the other
    own = dict(enumerate(cells))
    walls = _walls(space, own, own)
    while True:
        pairs = [(i, j) for (i, j), wall in walls.items() if i < j and walls.get((j, i)) == wall]
        if not pairs:
            return list(own.values())
        i, j = min(pairs)
        wall, one, two = walls[i, j], own.pop(i), own.pop(j)
        walls = {pair: plane for pair, plane in walls.items() if not {i, j} & set(pair)}
        sides = dict(zip([*one.planes.tolist(), *two.planes.tolist()], [*one.sides, *two.sides], strict=True))
        del sides[wall]
        planes, outer = np.array(list(sides.items())).T
        whole = space.pruned(Cell(np.union1d(one.points, two.points), planes, outer))
        if own:
            walls |= _walls(space, {i: whole}, own) | _walls(space, own, {i: whole})
        own[i] = whole


def _walls(space: Arrangement, ones: dict[int, Cell], others: dict[int, Cell]) -> dict[Edge, int]:
    """Return, where there is just one, the plane of the first cell that the second one is not inside of."""
    planes, sides = (np.concatenate([cell[k] for cell in ones.values()]) for k in (1, 2))
    points = np.concatenate([cell.points for cell in others.values()])
    rows, columns = (
        np.cumsum([0, *lengths[:-1]])
        for lengths in ([len(cell.planes) for cell in ones.values()], [len(cell.points) for cell in others.values()])
    )
    outside = space.signs[planes[:, None], points] * sides[:, None] > 0
    outside = np.logical_or.reduceat(outside, columns, axis=1)
    single = np.add.reduceat(outside, rows, axis=0, dtype=np.int64) == 1
    which = np.add.reduceat(np.where(outside, planes[:, None], 0), rows, axis=0)
    names, other_names = list(ones), list(others)
    return {
        (names[i], other_names[j]): int(which[i, j])
        for i, j in zip(*(at.tolist() for at in np.nonzero(single)), strict=True)
        if names[i] != other_names[j]
    }


# ---------------------------------------------------------------------------------------------------------------- cover
#
# What a half-space through the seed leaves of a solid that is star-shaped about it is star-shaped too; the inner side
# of a facet at a reflex edge settles that edge. Cut like that until no reflex edge is left, the solid is convex.


def is_star_shaped(space: Arrangement, facets: Sequence[Facet], seed: int) -> bool:
    """Tell whether a point is on the inner side of, or on, every facet's plane."""
    return all(space.signs[plane, seed] != side for plane, side in {(facet.plane, facet.side) for facet in facets})


def cover(
    space: Arrangement, hull: Cell, facets: Sequence[Facet], seed: int, cells: Sequence[Cell], most: int, targets: int
) -> list[Cell] | None:
    """Return convex parts of the solid that hold the seed and together are all of it; None for more than `most`.

    - `hull`: of the solid.
    - `facets`: of its surface, without those on the hull.
    - `seed`: row of a point about which the solid is star-shaped.
    - `cells`: a partition of it.
    - `targets`: largest pieces still to be covered that a part is grown around, of which the best is taken.
    """
    remaining, parts = list(cells), list[Cell]()
    while remaining:
        options = list[tuple[float, int, Cell, list[Cell]]]()
        for target in sorted(remaining, key=space.volume, reverse=True)[:targets]:
            if (part := _grown(space, hull, facets, seed, target, remaining)) is not None:
                rest = [own for piece in remaining for own in _less(space, piece, part)]
                options.append((sum(map(space.volume, rest)), len(options), part, rest))
        if not options or len(parts) == most:
            return None
        *_, part, remaining = min(options, key=lambda option: option[:2])
        parts.append(part)
    for part in list(parts):
        others = [own for own in parts if own is not part]
        if not _without(space, part, others):
            parts = others
    return None if any(_without(space, part, cells) for part in parts) else parts


def _grown(
    space: Arrangement, cell: Cell, facets: Sequence[Facet], seed: int, target: Cell, remaining: Sequence[Cell]
) -> Cell | None:
    """Return a convex part of the solid that holds the seed and the middle of the target, and much of what is left."""
    middle = space.local[target.points].mean(axis=0)
    weights = np.concatenate([np.full(len(own.points), space.volume(own)) for own in remaining])
    points = np.concatenate([own.points for own in remaining])
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
            best = _edge_plane(space, *next(iter(reflex.items())), seed, middle)
        plane, side = best
        facets = space.split_facets(facets, plane)[0 if side > 0 else 1]
        whole = space.kept(whole, [best])
    return None


def _edge_plane(space: Arrangement, edge: Edge, own: Sequence[Facet], seed: int, middle: Array) -> tuple[int, int]:
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
    remaining = [cell]
    for other in others:
        remaining = [piece for own in remaining for piece in _less(space, own, other)]
    return remaining
