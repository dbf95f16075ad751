"""Two bodies at a pose: the contact lines of their part pairs, and the extremes of the gap over all sizes.

The gap is the signed distance: the Euclidean distance where the bodies are apart, minus the penetration depth of the
deepest part pair where they overlap. For a convex pair it is the largest of c - a rho_1 - b rho_2 over all unit
directions, a convex function of the sizes: largest in a corner of a box, and least where a subgradient says so.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from heapq import heappop, heappush
from itertools import count
from typing import NamedTuple

import numpy as np

from fcdm_opt.curve import kernels as curve_kernels
from fcdm_opt.curve.contact import located, supporting_contact
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.games import game
from fcdm_opt.design.fixed_pose import gaps as kernels
from fcdm_opt.design.sizes import Sizes
from fcdm_opt.geometry.arrays import Array, Ints, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.tolerances import DEFAULT

PIECES = 2000  # pieces of a box of sizes looked at for the largest gap of unions; what is left in doubt is told
PLANES = 100  # planes below the gap of a part pair, each new one where they are lowest


class Extreme(NamedTuple):
    """An extreme gap: its size, where it is taken, by which part pair, along which direction (from body 1 to 2)."""

    gap: float
    rho: Array
    parts: tuple[int, int]
    way: Array


class Extremes(NamedTuple):
    """The least and the largest gap over all sizes; `doubt`: no gap is larger than the largest by more."""

    least: Extreme
    most: Extreme
    doubt: float = 0.0


@dataclass(frozen=True, eq=False)
class Lines:
    """The contact lines of part pairs at a pose.

    Attributes
    ----------
    rows, first : arrays
        See `gaps`.
    pairs : (p, 2) ints
        Of all part pairs those that may have the least gap at the sizes spoken of.
    pose : (12,) array
    """

    rows: Array
    first: Ints
    pairs: Ints
    pose: Array

    def gaps(self, sizes: Array) -> tuple[Array, Ints]:
        """Return the gaps at size pairs, (n,), and the part pairs that have them, (n, 2)."""
        found, owners = kernels.gaps(self.rows, self.first, np.ascontiguousarray(sizes))
        return found, self.pairs[owners]


class Scene:
    """Two bodies, and the sizes that they may have.

    Parameters
    ----------
    movable, static : Body
    sizes : Sizes
    """

    def __init__(self, movable: Body, static: Body, sizes: Sizes) -> None:
        self.movable, self.static, self.sizes = movable, static, sizes
        self.packed = (*movable.packed, *static.packed)
        bodies = movable, static
        self.vertices = [np.concatenate([part.vertices - body.seed for part in body.parts]) for body in bodies]
        self.starts = [np.cumsum([0, *(len(part.vertices) for part in body.parts)]) for body in bodies]
        self.reach = np.array([np.linalg.norm(own, axis=1).max() for own in self.vertices])
        self.size = max(movable.size, static.size)

    def pose(self, transform: Array) -> Array:
        """Return the relative pose that the kernels take, (12,)."""
        pose: Array = curve_kernels.relative_pose(transform, self.movable.seed, self.static.seed)
        return pose

    @cached_property
    def _all_pairs(self) -> Ints:
        return np.array(list(np.ndindex(len(self.movable.parts), len(self.static.parts))), dtype=np.int64)

    def lines(self, pose: Array, slack: float = 0.0) -> Lines:
        """Return the contact lines at a pose, of all part pairs that may have the least gap.

        Parameters
        ----------
        pose : (12,) array
        slack : float
            By which points of body 1 may be off the pose.
        """
        pairs = self._all_pairs
        if len(pairs) > 1:
            middle, spread = self.sizes.middle, float(self.reach @ self.sizes.half)
            bounds = curve_kernels.pair_bounds(*self.packed, pose, middle).ravel()
            nearest = pairs[[int(bounds.argmin())]]
            rows, first = kernels.pair_rows(*self.packed, pose, nearest)
            gap = float(kernels.gaps(rows, first, middle[None])[0][0])
            pairs = pairs[bounds <= gap + 2.0 * (spread + slack) + DEFAULT.prune * self.size]
            if not len(pairs):
                pairs = nearest
        rows, first = kernels.pair_rows(*self.packed, pose, pairs)
        return Lines(rows, first, pairs, pose)

    def extremes(self, lines: Lines) -> Extremes:
        """Return the least and the largest gap over all sizes."""
        if self.sizes.pairs is not None:
            found, _ = kernels.gaps(lines.rows, lines.first, self.sizes.pairs)
            least, most = (self._at(lines, self.sizes.pairs[k]) for k in (found.argmin(), found.argmax()))
            return Extremes(least, most)
        corners = self.sizes.corners
        values, ways = kernels.gaps_of_pairs(lines.rows, lines.first, corners)
        most, doubt = self._most(lines, corners, values)
        return Extremes(self._least(lines, corners, values, ways), most, doubt)

    def _at(self, lines: Lines, rho: Array) -> Extreme:
        """Return the gap at a size pair."""
        way = np.empty(3)
        gap, owner = kernels.least_gap(lines.rows, lines.first, rho[0], rho[1], (0.0, 0.0, 0.0), 0, way)
        return Extreme(float(gap), frozen(rho), _plain(lines.pairs[owner]), frozen(way))

    def _most(self, lines: Lines, corners: Array, values: Array) -> tuple[Extreme, float]:
        """Return the largest gap over the box, and by how much a larger one is not ruled out.

        Over a piece no gap exceeds the mixture of the corners that does best against all part pairs: of convex
        functions, which lie below their mixtures, the least is asked.
        """
        gaps = values.min(axis=0)
        best = int(gaps.argmax())
        found, rho = float(gaps[best]), corners[best]
        if len(values) == 1:
            return self._at(lines, rho), 0.0
        near, numbers = DEFAULT.tie * self.size, count()
        heap = [(-self._no_more(values), next(numbers), self.sizes.box)]
        left = found
        for _ in range(PIECES):
            if not heap or -heap[0][0] <= found + near:
                break
            top, _, box = heappop(heap)
            axis = int(np.argmax((box[:, 1] - box[:, 0]) * self.reach))
            for side in (0, 1):
                piece = box.copy()
                piece[axis, 1 - side] = box[axis].mean()
                ends = np.array([(x, y) for x in piece[0] for y in piece[1]])
                own, _ = kernels.gaps_of_pairs(lines.rows, lines.first, ends)
                least = own.min(axis=0)
                if least.max() > found:
                    found, rho = float(least.max()), ends[least.argmax()]
                heappush(heap, (-min(self._no_more(own), -top), next(numbers), piece))
        if heap:
            left = max(found, -heap[0][0])
        return self._at(lines, rho), left - found

    @staticmethod
    def _no_more(values: Array) -> float:
        """Return what no mixture of corners (columns) exceeds against all part pairs (rows)."""
        shares = game(np.ascontiguousarray(-values))
        return float((shares @ values).max())

    def _least(self, lines: Lines, corners: Array, values: Array, ways: Array) -> Extreme:
        """Return the least gap over the box: in a corner whose subgradient leads out of the box, or by planes below."""
        best = self._at(lines, corners[int(values.min(axis=0).argmin())])
        near, middle, half = DEFAULT.tie * self.size, self.sizes.middle, self.sizes.half
        for p in np.argsort(values.min(axis=1)).tolist():
            rows = lines.rows[lines.first[p] : lines.first[p + 1], 3:]
            if (rows[:, 2] - rows[:, :2] @ middle - np.abs(rows[:, :2]) @ half).max() >= best.gap - near:
                continue  # along one direction no gap of this pair is less
            corner = int(values[p].argmin())
            line = self._line(lines, p, ways[p, corner])
            if not self._ends_at(corners[corner], line):
                own = self._at(lines, self._lowest(lines, p, best.gap - near))
                best = own if own.gap < best.gap else best
        return best

    def _ends_at(self, corner: Array, line: Array) -> bool:
        """Tell whether a gap with the subgradient (-a, -b) in a corner is least there."""
        (low, high), slack = self.sizes.box.T, DEFAULT.line * self.size
        falls_on = np.where(corner == high, line[:2] < -slack, line[:2] > slack) & (low < high)
        return not falls_on.any()

    def _line(self, lines: Lines, p: int, way: Array) -> Array:
        """Return (a, b, c) of a part pair along a direction."""
        i, j = lines.pairs[p].tolist()
        own, other = (v[s[k] : s[k + 1]] for v, s, k in zip(self.vertices, self.starts, (i, j), strict=True))
        R, d = lines.pose[:9].reshape(3, 3), lines.pose[9:]
        return np.array([(own @ (way @ R)).max(), (other @ -way).max(), way @ d])

    def _lowest(self, lines: Lines, p: int, enough: float) -> Array:
        """Return the sizes at which a part pair has its least gap: lowest point of planes below a convex function.

        No more is asked of a pair that has none below `enough`.
        """
        from scipy.optimize import linprog

        planes = [lines.rows[lines.first[p] : lines.first[p + 1], 3:]]
        rho = self.sizes.middle
        for _ in range(PLANES):
            a = np.concatenate(planes)
            # scaled: sizes as shares of the box, gaps by the size of the bodies
            A = np.column_stack([-a[:, :2] * self.sizes.half / self.size, -np.ones(len(a))])
            level = -(a[:, 2] - a[:, :2] @ self.sizes.middle) / self.size
            limits = [(-1.0, 1.0), (-1.0, 1.0), (None, None)]
            found = linprog([0.0, 0.0, 1.0], A_ub=A, b_ub=level, bounds=limits, method="highs")
            if found.status != 0 or found.x[2] * self.size >= enough:
                break
            rho, way = self.sizes.middle + found.x[:2] * self.sizes.half, np.empty(3)
            rho = np.clip(rho, *self.sizes.box.T)
            gap = kernels.pair_gap(
                lines.rows, lines.first[p], lines.first[p + 1], rho[0], rho[1], (0.0, 0.0, 0.0), np.inf, way
            )
            if gap - found.x[2] * self.size <= DEFAULT.tie * self.size:
                break
            planes.append(self._line(lines, p, way)[None])
        return np.asarray(rho)

    def feature(self, lines: Lines, extreme: Extreme) -> Feature:
        """Return the features that face each other at an extreme, along its direction."""
        one, two = self.movable.parts[extreme.parts[0]], self.static.parts[extreme.parts[1]]
        contact = supporting_contact(one, two, extreme.way, lines.pose, DEFAULT.nominal)
        try:
            return located(one, two, lines.pose, contact, extreme.rho).feature
        except ValueError:  # the parts are apart: what they share of several faces is not defined
            return contact.feature


def _plain(pair: Ints) -> tuple[int, int]:
    i, j = pair.tolist()
    return i, j
