"""The part pairs that a union's curve depends on, and where in a box each can be on it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.region import Region, pair_region
from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.tolerances import DEFAULT

_DEPTH, _FEW, _ATTEMPTS = 8, 12, 3  # halvings at most; pairs that need no more; pairs tried to cover a cell
_POSES = 4  # of two bodies, the regions of whose parts are kept
Cell = tuple[float, float, float, float]  # (low, high) of rho_1, then of rho_2


@lru_cache(maxsize=_POSES)
def _regions(movable: Body, static: Body, transform: bytes) -> dict[tuple[int, int], Region]:
    """Return what is known of two bodies in one of the last poses: other boxes and questions ask about it again."""
    return {}


def region_between(movable: Body, static: Body, transform: Array, parts: tuple[int, int]) -> Region:
    """Return the overlap region of part i of body 1 and part j of body 2, after a pose change of body 1."""
    known = _regions(movable, static, transform.tobytes())
    if parts not in known:
        i, j = parts
        known[parts] = pair_region(movable.parts[i], static.parts[j], transform, parts)
    return known[parts]


def relevant_pairs(
    movable: Body, static: Body, transform: Array, box: Cell
) -> tuple[dict[int, Region], list[tuple[Cell, list[int]]], set[int], set[int]]:
    """Walk the part pairs of two unions that can be on their curve in a box, and tell where in the box each can be.

    The box is halved both ways into cells until few pairs are left in each. A pair is left out of a cell where a
    direction keeps the two parts apart at all its scale pairs, or where it overlaps only where another pair does (of
    two whose overlap ends along one line the first stays). A cell is left out where one pair overlaps in all of it, as
    no curve passes there, or where no pair is left. All by more than `Tolerances.prune` times the bodies' extents;
    lines are one within `Tolerances.line` times these.

    Parameters
    ----------
    movable, static : Body
    transform : (4, 4) array
        Pose change of body 1.
    box : (low, high, low, high)
        Of rho_1, then of rho_2, finite.

    Returns
    -------
    walked : dict
        The regions of the pairs that were walked, by the number i n_2 + j of a pair. Of the others no point is on the
        curve inside the box.
    cells : list of (cell, list of int)
        Where the curve may pass, and the pairs that matter there: no others are on the curve, and none hide it.
    hiding : set of int
        Pairs that overlap in a whole cell.
    shared : set of int
        Pairs for which another was left out that ends with it along one line.
    """
    pairs = _Pairs(movable, static, transform, box)
    cells, hiding, shared = list[tuple[Cell, list[int]]](), set[int](), set[int]()
    stack = [(box, 0, np.arange(len(movable.parts) * len(static.parts)))]
    while stack:
        cell, depth, codes = stack.pop()
        depths = pairs.depths(codes, cell)
        open_ = depths > -np.inf
        codes, depths = codes[open_], depths[open_]
        for _ in range(_ATTEMPTS if len(codes) > 1 else 0):
            best = int(np.where(depths < np.inf, depths, -np.inf).argmax())
            if depths[best] == np.inf:
                break
            code = int(codes[best])
            depths[best] = np.inf  # tried
            region = pairs.region(code)
            (value,) = pairs.depths(codes[[best]], cell)
            if value > pairs.slack:
                hiding.add(code)
                codes = codes[:0]
                break
            if value == -np.inf or region.surely_empty:
                continue
            beyond, level = pairs.inside(code, codes, cell)
            # of those that end with it the first stays, whichever was tried
            left = (codes == code) | beyond | (level & (codes < code))
            if (level & ~left).any():
                shared.add(code)
            codes, depths = codes[left], depths[left]
        if len(codes) > _FEW and depth < _DEPTH:
            x0, x1, y0, y1 = cell
            x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
            quarters = (x0, x, y0, y), (x, x1, y0, y), (x0, x, y, y1), (x, x1, y, y1)
            stack += [(quarter, depth + 1, codes) for quarter in quarters]
            continue
        codes = np.array([k for k in codes.tolist() if not pairs.region(k).surely_empty], np.int64)
        if codes.size and (kept := codes[pairs.depths(codes, cell) > -np.inf].tolist()):
            cells.append((cell, kept))
    return pairs.walked, cells, hiding, shared


class _Pairs:
    """Contact lines of all part pairs in a few directions, and the regions of those that were walked."""

    def __init__(self, movable: Body, static: Body, transform: Array, box: Cell) -> None:
        self._bodies, self._transform, self._count = (movable, static), transform, len(static.parts)
        pose = kernels.relative_pose(transform, movable.seed, static.seed)
        middle = 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3])
        lines, most1, most2 = kernels.quick_lines(*movable.packed, *static.packed, pose, *middle)
        self._lines = list(lines.reshape(len(movable.parts) * len(static.parts), -1, 3))
        self._R = pose[:9].reshape(3, 3)
        self.slack = DEFAULT.prune * (float(np.linalg.norm(pose[9:])) + box[1] * most1 + box[3] * most2)
        self._vertices = [
            (
                np.concatenate([part.vertices - part.seed for part in body.parts]),
                np.cumsum([0, *(len(part.vertices) for part in body.parts[:-1])]),
            )
            for body in self._bodies
        ]
        self.walked: dict[int, Region] = {}

    def region(self, code: int) -> Region:
        """Return the region of a pair, walked when it is first asked for."""
        if code not in self.walked:
            parts = divmod(code, self._count)
            self.walked[code] = made = region_between(*self._bodies, self._transform, parts)
            self._lines[code] = made.rows[:, 3:]
        return self.walked[code]

    def depths(self, codes: Ints, cell: Cell) -> Array:
        """Return how deep pairs overlap at least in a cell, by the lines known; -inf where one keeps them apart."""
        known = [self._lines[code] for code in codes.tolist()]
        (x0, x1, y0, y1), (a, b, c) = cell, np.concatenate(known).T
        starts = np.cumsum([0, *map(len, known[:-1])])
        level = a * (0.5 * (x0 + x1)) + b * (0.5 * (y0 + y1)) - c
        spread = np.abs(a) * (0.5 * (x1 - x0)) + np.abs(b) * (0.5 * (y1 - y0))
        apart = np.minimum.reduceat(level + spread, starts) < -self.slack
        return np.where(apart, -np.inf, np.minimum.reduceat(level - spread, starts))

    def inside(self, code: int, codes: Ints, cell: Cell) -> tuple[Flags, Flags]:
        """Tell which pairs are further on than one along a line of its own that crosses a cell, and which end with it.

        All others are inside the one there.
        """
        x0, x1, y0, y1 = cell
        rows = self.region(code).rows
        a, b, c = rows[:, 3:].T
        rows = rows[np.minimum(a * x0, a * x1) + np.minimum(b * y0, b * y1) - c <= self.slack]
        heights = [
            np.maximum.reduceat(ways @ vertices.T, starts, axis=1)[:, parts]
            for ways, (vertices, starts), parts in zip(
                (rows[:, :3] @ self._R, -rows[:, :3]), self._vertices, divmod(codes, self._count), strict=True
            )
        ]
        own = int(np.flatnonzero(codes == code)[0])
        a, b = (height - height[:, own, None] for height in heights)
        most = np.maximum(a * x0, a * x1) + np.maximum(b * y0, b * y1)
        beyond = (most > DEFAULT.line / DEFAULT.prune * self.slack).any(axis=0)
        return beyond, ~beyond & (most > -self.slack).any(axis=0)
