"""How far apart bodies are at least on their true faces: a bound, to any accuracy.

Each triangle stands for a piece of its surface, which leaves it by a known length. Pairs of triangles between which
the bodies may be nearest are cut, at points of the surfaces, until what they leave is small beside their distance:
branch and bound over pieces of faces.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import SMALLEST, Array, Flags, Ints, distinct_rows
from fcdm_opt.geometry.crossings import overlapping_between
from fcdm_opt.geometry.measures import cross, dots, norms, unit_normals
from fcdm_opt.geometry.patches import Patch, TrueFaces
from fcdm_opt.geometry.tessellation import onto

SHARE = 0.2  # of the distance: by so much the bound may fall short of it
LEVELS = 40  # of cuts
MOST = 1_000_000  # pairs of pieces that are looked at: some seconds
SOME = 200  # pairs whose corners tell what the distance is at most
TRIM = 1.5  # times what the middle of a side leaves an edge, any point of it does at most: edges are conics


class FacePieces(NamedTuple):
    """FacePieces of the faces of a body, each known by a triangle with its corners on the surface.

    Attributes
    ----------
    corners : (n, 3, 3) array
    patches : (n,) int array
    others : (n, 3) int array
        The patch beyond the side from each corner to the next; -1 within the patch.
    errors : (n,) array
        No point of the piece is further from the triangle.
    """

    corners: Array
    patches: Ints
    others: Ints
    errors: Array

    @classmethod
    def of(cls, faces: TrueFaces) -> FacePieces:
        """Return the pieces that the triangles of a body stand for."""
        others = np.full((len(faces.corners), 3), -1)
        _, same = distinct_rows(np.concatenate([faces.corners.reshape(-1, 3), faces.every_edge.reshape(-1, 3)]))
        corners, ends = np.split(same, [3 * len(faces.corners)])
        known = dict[tuple[int, int, int], int]()
        for (a, b), pair in zip(ends.reshape(-1, 2).tolist(), faces.every_pair_of_patches.tolist(), strict=True):
            for one, two in (pair, pair[::-1]):
                known[min(a, b), max(a, b), one] = two
        for k, (own, patch) in enumerate(zip(corners.reshape(-1, 3).tolist(), faces.owners.tolist(), strict=True)):
            for side in range(3):
                a, b = own[side], own[(side + 1) % 3]
                others[k, side] = known.get((min(a, b), max(a, b), patch), -1)
        return cls(faces.corners, faces.owners, others, np.zeros(0)).measured(faces.patches)

    def measured(self, patches: Sequence[Patch]) -> FacePieces:
        """Return them with their errors."""
        errors = np.zeros(len(self.corners))
        for k in np.unique(self.patches).tolist():
            own = self.patches == k
            errors[own] = patches[k].surface.left_by_each(self.corners[own]).max(axis=1)
        middles, on = self.middles(patches), (self.corners + np.roll(self.corners, -1, axis=1)) / 2.0
        for k in np.unique(self.patches).tolist():
            own = self.patches == k
            on[own] = onto(on[own].reshape(-1, 3), [patches[k].surface]).reshape(-1, 3, 3)
        trimmed = np.where(self.others >= 0, norms(middles - on), 0.0).max(axis=1)
        return self._replace(errors=errors + TRIM * trimmed)

    def middles(self, patches: Sequence[Patch]) -> Array:
        """Return a point of the surface, or of the edge, at the middle of each side, (n, 3, 3)."""
        found = (self.corners + np.roll(self.corners, -1, axis=1)) / 2.0
        pairs = np.column_stack([np.repeat(self.patches, 3), self.others.ravel()])
        flat = found.reshape(-1, 3)
        for one, two in np.unique(pairs, axis=0).tolist():
            own = (pairs == (one, two)).all(axis=1)
            flat[own] = onto(flat[own], [patches[k].surface for k in (one, two) if k >= 0])
        return flat.reshape(-1, 3, 3)

    def cut(self, rows: Flags, patches: Sequence[Patch]) -> tuple[FacePieces, Ints]:
        """Return pieces of which some are cut in two at the side that leaves its surface most, and what each is of."""
        own = FacePieces(self.corners[rows], self.patches[rows], self.others[rows], self.errors[rows])
        middles, k = own.middles(patches), np.arange(len(own.corners))
        bulge = norms(middles - (own.corners + np.roll(own.corners, -1, axis=1)) / 2.0)
        long = norms(own.corners - np.roll(own.corners, -1, axis=1))
        side = np.where(bulge.max(axis=1) > 0.0, bulge.argmax(axis=1), long.argmax(axis=1))
        a, b, c = (own.corners[k, (side + turn) % 3] for turn in range(3))
        ab, bc, ca = (own.others[k, (side + turn) % 3] for turn in range(3))
        m, within = middles[k, side], np.full(len(k), -1)
        corners = np.concatenate([np.stack([a, m, c], axis=1), np.stack([m, b, c], axis=1)])
        others = np.concatenate([np.column_stack([ab, within, ca]), np.column_stack([ab, bc, within])])
        halves = FacePieces(corners, np.tile(own.patches, 2), others, np.zeros(0)).measured(patches)
        kept = ~rows
        of = np.concatenate([np.flatnonzero(kept), np.tile(np.flatnonzero(rows), 2)])
        return FacePieces(*(np.concatenate([mine[kept], new]) for mine, new in zip(self, halves, strict=True))), of


class FacesApart:
    """Two bodies at scale 1 that are apart, in pieces that are cut further with each question.

    Parameters
    ----------
    faces : (TrueFaces, TrueFaces)
    most : int
        Pairs of pieces that are looked at, over all questions.

    Attributes
    ----------
    remaining : int
        Pairs of pieces that may still be looked at; below 0 nothing is shown any more.
    """

    def __init__(self, faces: Sequence[TrueFaces], most: int = MOST) -> None:
        self._patches = [own.patches for own in faces]
        self._pieces = [FacePieces.of(own) for own in faces]
        self._nearest = np.zeros((0, 2), np.int64)
        self.remaining = most

    def least(self, transform: Array, *, small: float = 0.0) -> float:
        """Return what their distance is at least, 0 where none is shown.

        It falls short of the distance by a fifth of it at most, or by `small`.

        Parameters
        ----------
        transform : (4, 4) array
            Pose change of body 1.
        """
        for level in range(LEVELS):
            one = self._pieces[0].corners @ transform[:3, :3].T + transform[:3, 3]
            two, errors = self._pieces[1].corners, [own.errors for own in self._pieces]
            if not level:
                self._nearest = _near(one, two, errors, self._nearest)
            i, j = self._nearest.T
            self.remaining -= len(i)
            if self.remaining < 0:
                break
            lows = _separations(one[i], two[j]) - errors[0][i] - errors[1][j]
            some = np.argsort(lows, kind="stable")[:SOME]  # the nearest are among them
            upper, low = _no_more(one, two, errors, self._nearest[some]), float(lows.min())
            near = (lows < (1.0 - SHARE) * upper) & (lows < upper - small)
            if not near.any():
                return max(low, 0.0)
            i, j = self._nearest[near].T
            self._nearest = self._nearest[near | (lows <= upper)]
            first, wide = errors[0][i] >= errors[1][j], errors[0][i] + errors[1][j] <= small
            sizes = [norms(np.ptp(own, axis=1)) for own in (one, two)]
            first = np.where(wide, sizes[0][i] >= sizes[1][j], first)  # what is left is how large they are
            for k, chosen in enumerate((i[first], j[~first])):
                rows = np.zeros(len(self._pieces[k].corners), bool)
                rows[chosen] = True
                if rows.any():
                    self._pieces[k], of = self._pieces[k].cut(rows, self._patches[k])
                    self._nearest = _followed(self._nearest, k, of)
        return 0.0


def _near(one: Array, two: Array, errors: Sequence[Array], last: Ints) -> Ints:
    """Return pairs of pieces that may be the nearest, by their boxes, (m, 2); `last` were those before."""
    room = [own[:, None] for own in errors]
    (low, high), (under, over) = ((x.min(axis=1) - e, x.max(axis=1) + e) for x, e in zip((one, two), room, strict=True))
    if len(last):
        most = _no_more(one, two, errors, last[:: max(1, len(last) // SOME)])
    else:
        most = float(norms(np.maximum(over - low[:, None], high[:, None] - under)).min())
    pairs = overlapping_between(low - most, high + most, under, over)
    i, j = pairs.T
    pairs = pairs[norms(np.maximum(np.maximum(under[j] - high[i], low[i] - over[j]), 0.0)) <= most]
    for own, other, k in ((one, two, 0), (two, one, 1)):
        normals = unit_normals(own)
        levels = (normals * own[:, 0]).sum(axis=1)
        i, j = pairs[:, k], pairs[:, 1 - k]
        heights = np.einsum("mcx,mx->mc", other[j], normals[i]) - levels[i, None]
        apart = np.maximum(heights.min(axis=1), -heights.max(axis=1)) - errors[k][i] - errors[1 - k][j]
        pairs = pairs[apart <= most]
    return pairs


def _no_more(one: Array, two: Array, errors: Sequence[Array], pairs: Ints) -> float:
    """Return what the distance is at most, by some pairs: of corners, which are on their face, from the other piece."""
    from trimesh.triangles import closest_point

    found = np.inf
    for points, triangles, errors_there, k in ((one, two, errors[1], 0), (two, one, errors[0], 1)):
        flat, there = points[pairs[:, k]].reshape(-1, 3), pairs[:, 1 - k]
        off = norms(flat - closest_point(np.repeat(triangles[there], 3, axis=0), flat)).reshape(-1, 3).min(axis=1)
        found = min(found, float((off + errors_there[there]).min()))
    return found


def _followed(pairs: Ints, k: int, of: Ints) -> Ints:
    """Return the pairs of pieces that were cut, from those before."""
    order = np.argsort(of, kind="stable")
    first, last = np.searchsorted(of[order], pairs[:, k]), np.searchsorted(of[order], pairs[:, k], side="right")
    count = last - first
    rows = np.repeat(np.arange(len(pairs)), count)
    place = np.arange(len(rows)) - np.repeat(np.cumsum(count) - count, count)
    new = pairs[rows].copy()
    new[:, k] = order[first[rows] + place]
    return new


def _separations(one: Array, two: Array) -> Array:
    """Return the largest separation of triangles, (m, 3, 3), along some directions: no more than their distance."""
    sides = [own - np.roll(own, -1, axis=1) for own in (one, two)]
    normals = [unit_normals(own) for own in (one, two)]
    directions = [normals[0][:, None], normals[1][:, None], (two.mean(axis=1) - one.mean(axis=1))[:, None]]
    directions += [cross(sides[0][:, [k] * 3], sides[1]) for k in range(3)]
    directions += [cross(own, n[:, None]) for own, n in zip(sides, normals, strict=True)]
    every = np.concatenate(directions, axis=1)
    length = norms(every)
    every = every / np.maximum(length, SMALLEST)[..., None]
    heights = ([dots(every, own[:, None, k]) for k in range(3)] for own in (one, two))
    (low, high), (under, over) = ((reduce(np.minimum, own), reduce(np.maximum, own)) for own in heights)
    apart = np.maximum(under - high, low - over)
    return np.asarray(np.where(length > SMALLEST, apart, -np.inf).max(axis=1))
