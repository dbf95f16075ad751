"""The overlap region of one pair of convex parts: a convex region of the quadrant, and the chains that bound it.

Two paths give the same answer: the walk over the overlay of the Gauss maps (kernels.walk), and, where it meets a tie
or has nowhere to start, the intersection of all facet half-planes, which knows no topology to get wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array, Ints, frozen
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.geometry.elements import Element
from fcdm_opt.tolerances import DEFAULT

FAR = 1e9  # scale pairs beyond this, relative to the lines' distances from (0, 0), are at infinity
PARALLEL = 1e-14  # radians: lines whose directions differ by no more have no corner


@dataclass(frozen=True, eq=False)
class Piece:
    """A stretch of a boundary line: scale pairs `base + s travel` for lo <= s <= hi (either may be infinite).

    Attributes
    ----------
    feature : Feature
    site : tuple of int
        Facet of the Minkowski difference: kind, index in part 1, index in part 2 (see `kernels`).
    parts : tuple of int
        The part pair (i, j), 0-based.
    normal : (3,) array
        Unit direction from body 1 to body 2, world frame.
    line : (3,) array
        (a, b, c): a rho_1 + b rho_2 = c, in lengths; overlap on the side of (a, b).
    base, travel : (2,) arrays
        A point of the line, and the unit direction along it with the overlap region on the left.
    lo, hi : float
        Range of s.
    snug : bool
        Overlap on both sides.
    """

    feature: Feature
    site: tuple[int, int, int]
    parts: tuple[int, int]
    normal: Array
    line: Array
    base: Array
    travel: Array
    lo: float
    hi: float
    snug: bool = False

    def at(self, s: float) -> Array:
        """Return the scale pair at parameter s."""
        return self.base + s * self.travel

    @property
    def start(self) -> Array:
        """First scale pair, or a far point where the piece comes from infinity (entries may be infinite)."""
        return self.end_at(self.lo)

    @property
    def end(self) -> Array:
        """Last scale pair."""
        return self.end_at(self.hi)

    def end_at(self, s: float) -> Array:
        """Return the scale pair at s, which may be infinite."""
        if np.isfinite(s):
            return self.at(s)
        return np.array([x if t == 0 else t * s for x, t in zip(self.base, self.travel, strict=True)])

    def parameter(self, rho: Array) -> float:
        """Return s of the point of the line nearest to `rho`."""
        return float((rho - self.base) @ self.travel)


@dataclass(frozen=True, eq=False)
class Region:
    """Where one pair of convex parts overlaps, in the open quadrant rho > 0.

    Attributes
    ----------
    status : "bounded", "empty" or "full"
    chains : tuple of tuples of Piece
        The boundary, overlap on the left.
    path : "walk" or "lines"
        How it was computed.
    """

    status: Literal["bounded", "empty", "full"]
    chains: tuple[tuple[Piece, ...], ...]
    path: Literal["walk", "lines"]

    @property
    def pieces(self) -> list[Piece]:
        """All pieces, chain by chain."""
        return [piece for chain in self.chains for piece in chain]


def pair_region(one: ConvexPart, two: ConvexPart, pose: Array, parts: tuple[int, int] = (0, 0)) -> Region:
    """Return the overlap region of a pair of convex parts.

    Parameters
    ----------
    one, two : ConvexPart
        Of body 1 and body 2.
    pose : (12,) array
        Rotation of body 1, row by row, then d = s_2 - s_1 (moved).
    parts : tuple of int
        Indices of the parts in their bodies, kept in the pieces.
    """
    state, sites, rows, points, chains = kernels.walk(*one.packed, *two.packed, pose, DEFAULT.tie)
    if state == kernels.UNDECIDED:
        return _from_lines(one, two, pose, parts)
    made = []
    for number, (first, count, forward, endless) in enumerate(chains.tolist()):
        corners = points[first + number : first + number + count + 1]
        pieces = [
            _piece(
                _walked_feature(one, two, sites[first + k]),
                sites[first + k],
                rows[first + k],
                parts,
                corners[k],
                None if endless and k + 1 == count else corners[k + 1],
                forward,
            )
            for k in range(count)
        ]
        made.append(tuple(pieces if forward > 0 else pieces[::-1]))
    return Region("bounded", tuple(made), "walk")


def _piece(
    feature: Feature, site: Ints, row: Array, parts: tuple[int, int], start: Array, end: Array | None, forward: int
) -> Piece:
    """Make a piece from its ends in the order walked; an `end` of None is at infinity."""
    gradient = row[3:5]
    steep = np.hypot(*gradient)
    base = row[5] / steep**2 * gradient
    travel = np.array([gradient[1], -gradient[0]]) / steep
    lo = float((start - base) @ travel)
    hi = forward * np.inf if end is None else float((end - base) @ travel)
    kind, i, j = (int(x) for x in site)
    return Piece(
        feature,
        (kind, i, j),
        parts,
        frozen(row[:3]),
        frozen(row[3:]),
        frozen(base),
        frozen(travel),
        *((lo, hi) if forward > 0 else (hi, lo)),
    )


def _walked_feature(one: ConvexPart, two: ConvexPart, site: Ints) -> Feature:
    kinds = {kernels.F1V2: ("F", "V"), kernels.V1F2: ("V", "F"), kernels.E1E2: ("E", "E")}[int(site[0])]
    return Feature(one.elements[kinds[0]][site[1]], two.elements[kinds[1]][site[2]])


# ------------------------------------------------------------------------------------- the path without topology


def _from_lines(one: ConvexPart, two: ConvexPart, pose: Array, parts: tuple[int, int]) -> Region:
    """Intersect all facet half-planes a rho_1 + b rho_2 >= c with the quadrant."""
    sites, rows = kernels.facet_rows(*one.packed, *two.packed, pose, DEFAULT.tie)
    size = max(np.abs(part.packed[0][: len(part.vertices)]).max() for part in (one, two))
    steep = np.hypot(rows[:, 3], rows[:, 4])
    flat = steep <= DEFAULT.tie * size
    reach = max(size, np.abs(pose[9:]).max())
    if np.any(rows[flat, 5] >= -DEFAULT.tie * reach):  # 0 > c fails: this direction separates at every scale
        return Region("empty", (), "lines")
    sites, rows, steep = sites[~flat], rows[~flat], steep[~flat]
    lines = np.vstack([rows[:, 3:] / steep[:, None], [[1, 0, 0], [0, 1, 0]]])
    far = FAR * (1.0 + np.abs(lines[:, 2]).max())
    outline = _polygon(np.vstack([lines, [[-1, 0, -far], [0, -1, -far]]]))
    if not outline:
        return Region("empty", (), "lines")
    chains: list[list[Piece]] = []
    last = None
    for k, start, end in outline:
        if k >= len(rows):  # an axis or the far end: the chain is interrupted
            last = None
            continue
        if last is None:
            chains.append([])
        same = np.abs(lines[: len(rows)] - lines[k]).max(axis=1) <= DEFAULT.tie * max(1.0, np.abs(lines[k]).max())
        # directions of one line: what touches is what supports all of them
        feature = support_feature(one, two, _inner(rows[same, :3]), pose)
        piece = _piece(feature, sites[k], rows[k], parts, start, None if end.max() >= far / 2 else end, 1)
        chains[-1].append(replace(piece, lo=-np.inf) if start.max() >= far / 2 else piece)
        last = k
    if not chains:
        return Region("full", (), "lines")
    if len(chains) > 1 and outline[0][0] < len(rows) and outline[-1][0] < len(rows):
        chains[0] = chains.pop() + chains[0]
    return Region("bounded", tuple(tuple(chain) for chain in chains), "lines")


def _polygon(lines: Array) -> list[tuple[int, Array, Array]]:
    """Return the convex polygon of all half-planes a x + b y >= c as (line, start, end), counter-clockwise.

    Empty where they have no common interior.

    Lines are normalised and bound a finite polygon. Sorted by direction, each cuts off the corners behind it;
    neighbours share one corner, so that nothing tears however nearly parallel they are. Of lines of one direction only
    the most restrictive counts, the first of equals.
    """
    angle = np.arctan2(-lines[:, 0], lines[:, 1])
    order = np.lexsort((np.arange(len(lines)), -lines[:, 2], angle))
    new = np.concatenate([[True], np.diff(angle[order]) > PARALLEL])
    groups = np.cumsum(new) - 1
    tightest = np.full(groups[-1] + 1, -np.inf)
    np.maximum.at(tightest, groups, lines[order, 2])
    kept: list[int] = []
    for group, k in zip(groups, order, strict=True):
        if lines[k, 2] >= tightest[group] and len(kept) == group:
            kept.append(int(k))

    def corner(k: int, m: int) -> Array:
        # a point along line k: however flat the angle, rounding leaves it on both lines
        (a, b, c), (d, e, f) = lines[k], lines[m]
        along = (f - c * (a * d + b * e)) / (b * d - a * e)
        return np.array([c * a + along * b, c * b - along * a])

    def outside(m: int, point: Array) -> bool:
        slack = DEFAULT.line * (np.abs(lines[m, :2]) @ np.abs(point) + abs(lines[m, 2]))
        return bool(lines[m, :2] @ point - lines[m, 2] <= slack)

    chain: list[int] = []
    for m in kept:
        while len(chain) > 1 and outside(m, corner(chain[-2], chain[-1])):
            chain.pop()
        while len(chain) > 1 and outside(m, corner(chain[0], chain[1])):
            chain.pop(0)
        if chain and abs(np.sin(angle[m] - angle[chain[-1]])) <= PARALLEL:
            return []  # opposite lines with nothing between them
        chain.append(m)
    while len(chain) > 2 and outside(chain[0], corner(chain[-2], chain[-1])):
        chain.pop()
    while len(chain) > 2 and outside(chain[-1], corner(chain[0], chain[1])):
        chain.pop(0)
    if len(chain) < 3:
        return []
    corners = [corner(chain[k - 1], chain[k]) for k in range(len(chain))]
    middle = np.mean(corners, axis=0)
    values = lines[:, :2] @ middle - lines[:, 2]
    if not (np.isfinite(middle).all() and (values > 0).all()):
        return []
    return [(k, corners[n], corners[(n + 1) % len(chain)]) for n, k in enumerate(chain)]


def support_feature(one: ConvexPart, two: ConvexPart, normal: Array, pose: Array) -> Feature:
    """Return the elements with which the parts support each other along a direction from body 1 to body 2."""
    return Feature(_support_element(one, normal @ pose[:9].reshape(3, 3), 1.0), _support_element(two, normal, -1.0))


def touching_feature(
    one: ConvexPart, two: ConvexPart, rows: Array, pose: Array, rho: Array, slack: float
) -> tuple[Feature, Array]:
    """Return how two touching parts touch, and a direction inside the cone of all in which they support each other.

    Parameters
    ----------
    one, two : ConvexPart
    rows : (k, 6) array
        All facet directions of their Minkowski difference, see `kernels`.
    pose : (12,) array
    rho : (2,) array
        Scale pair at which they touch.
    slack : float
        Length within which a direction counts as tight.
    """
    tight = np.abs(rows[:, 5] - rows[:, 3:5] @ rho) <= slack
    inner = _inner(rows[tight, :3])
    return support_feature(one, two, inner, pose), inner


def _inner(normals: Array) -> Array:
    """Return a unit direction between some directions; the first where opposite ones cancel (contact on both sides)."""
    total = normals.sum(axis=0)
    length = np.linalg.norm(total)
    return total / length if length > DEFAULT.nominal else normals[0]


def same_pair(p: Array, q: Array) -> bool:
    """Tell whether two finite scale pairs, not both zero, are equal up to rounding."""
    return bool(
        np.isfinite(p).all()
        and np.isfinite(q).all()
        and np.abs(p - q).sum() < DEFAULT.nominal * (np.abs(p).sum() + np.abs(q).sum())
    )


def _support_element(part: ConvexPart, n: Array, sign: float) -> Element:
    """Return the element on which sign * n.x is largest."""
    local = part.vertices - part.seed
    heights = sign * (local @ n)
    top = set(np.flatnonzero(heights >= heights.max() - DEFAULT.tie * np.abs(local).max()).tolist())
    if len(top) == 1:
        return part.elements["V"][top.pop()]
    if len(top) == 2:
        for k, (origin, end) in enumerate(part.edges[:, :2].tolist()):
            if top == {origin, end}:
                return part.elements["E"][k]
    face = max(range(len(part.loops)), key=lambda f: len(top & set(part.loops[f])))
    return part.elements["F"][face]
