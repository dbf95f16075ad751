"""The part pairs that a union's curve depends on, and where in a box each can be on it.

A cell is (low, high) of rho_1, then of rho_2. In what is compiled parts' vertices are from their seeds, those of all
parts of a body one after the other with the first place of each and the number of all.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.compiling import kernel, light, step
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
    lines are one within `Tolerances.line` times these. The box, of rho_1, then of rho_2, is finite.

    Returned are the regions of the pairs that were walked, by the number i n_2 + j of a pair (of the others no point is
    on the curve inside the box); cells where the curve may pass, each with the pairs that matter there: no others are
    on the curve, and none hide it; the pairs that overlap in a whole cell; and those for which another was left out
    that ends with it along one line.
    """
    pairs = _Pairs(movable, static, transform, box)
    cells, hiding, shared = list[tuple[Cell, list[int]]](), set[int](), set[int]()
    stack = [(box, 0, np.arange(len(movable.parts) * len(static.parts)))]
    while stack:
        pacing.check()
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
            chosen = (codes == code) | beyond | (level & (codes < code))
            if (level & ~chosen).any():
                shared.add(code)
            codes, depths = codes[chosen], depths[chosen]
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
        count = len(movable.parts) * len(static.parts)
        self._lines = lines  # of all pairs, and of each walked one anew behind them: (a, b, c), (n, 3), then room
        self._known = len(lines)
        self._firsts = np.arange(count) * (len(lines) // count)
        self._lasts = self._firsts + len(lines) // count
        self._R = pose[:9].reshape(3, 3)
        self.slack = DEFAULT.prune * (float(np.linalg.norm(pose[9:])) + box[1] * most1 + box[3] * most2)
        self._vertices = [
            (
                np.concatenate([part.vertices - part.seed for part in body.parts]),
                np.cumsum([0, *(len(part.vertices) for part in body.parts)]),
            )
            for body in self._bodies
        ]
        self.walked: dict[int, Region] = {}

    def region(self, code: int) -> Region:
        """Return the region of a pair, walked when it is first asked for."""
        if code not in self.walked:
            self.walked[code] = made = region_between(*self._bodies, self._transform, divmod(code, self._count))
            first, last = self._known, self._known + len(made.rows)
            if last > len(self._lines):
                self._lines = np.concatenate([self._lines, np.empty((last, 3))])
            self._lines[first:last] = made.rows[:, 3:]
            self._firsts[code], self._lasts[code], self._known = first, last, last
        return self.walked[code]

    def depths(self, codes: Ints, cell: Cell) -> Array:
        """Return how deep pairs overlap at least in a cell, by the lines known; -inf where one keeps them apart."""
        return np.asarray(pair_depths(self._lines, self._firsts, self._lasts, codes, np.array(cell), self.slack))

    def inside(self, code: int, codes: Ints, cell: Cell) -> tuple[Flags, Flags]:
        """Tell which pairs are further on than one along a line of it that crosses a cell, and which end with it."""
        # all others are inside the one there
        rows, own = self.region(code).rows, int(np.flatnonzero(codes == code)[0])
        (one, starts), (two, others) = self._vertices
        line = DEFAULT.line / DEFAULT.prune * self.slack
        beyond, level = pairs_further(
            rows, self._R, one, starts, two, others, codes, own, np.array(cell), self.slack, line
        )
        return beyond, level


@light
@kernel
def pair_depths(lines, firsts, lasts, codes, cell, slack):
    """Return how deep pairs overlap at least in a cell, (k,); -inf where a line keeps them more than `slack` apart."""
    # lines (a, b, c) of pair p are those from `firsts[p]` to `lasts[p]`
    x, y, u, v = _middle(cell)
    depths = np.empty(len(codes))
    for k in range(len(codes)):
        deepest, least = np.inf, np.inf
        for m in range(firsts[codes[k]], lasts[codes[k]]):
            a, b = lines[m, 0], lines[m, 1]
            level, spread = a * x + b * y - lines[m, 2], np.abs(a) * u + np.abs(b) * v
            deepest, least = min(deepest, level + spread), min(least, level - spread)
        depths[k] = -np.inf if deepest < -slack else least
    return depths


@light
@kernel
def pairs_further(rows, R, vertices1, starts1, vertices2, starts2, codes, own, cell, slack, line):
    """Tell which pairs are further on than one along a row of it that crosses a cell, and which end with it, (2, k).

    Parameters: rows (n, a, b, c) of the pair's region; the rotation of body 1; of either body its vertices and where
    each part's begin; pairs i n_2 + j; the place of the one among them; by how much a pair is further on, `line`.
    """
    x0, x1, y0, y1 = cell[0], cell[1], cell[2], cell[3]
    n1, n2 = len(starts1) - 1, len(starts2) - 1
    flags = np.zeros((2, len(codes)), np.bool_)
    here, there = np.empty(n1), np.empty(n2)
    for m in range(len(rows)):
        a, b = rows[m, 3], rows[m, 4]
        if min(a * x0, a * x1) + min(b * y0, b * y1) - rows[m, 5] > slack:
            continue
        n = rows[m, 0], rows[m, 1], rows[m, 2]
        back = (
            n[0] * R[0, 0] + n[1] * R[1, 0] + n[2] * R[2, 0],
            n[0] * R[0, 1] + n[1] * R[1, 1] + n[2] * R[2, 1],
            n[0] * R[0, 2] + n[1] * R[1, 2] + n[2] * R[2, 2],
        )
        for i in range(n1):
            here[i] = _highest_of(vertices1, starts1[i], starts1[i + 1], back)
        for j in range(n2):
            there[j] = _highest_of(vertices2, starts2[j], starts2[j + 1], (-n[0], -n[1], -n[2]))
        one, two = here[codes[own] // n2], there[codes[own] % n2]
        for k in range(len(codes)):
            p, q = here[codes[k] // n2] - one, there[codes[k] % n2] - two
            most = max(p * x0, p * x1) + max(q * y0, q * y1)
            flags[0, k] |= most > line
            flags[1, k] |= most > -slack
    for k in range(len(codes)):
        flags[1, k] &= not flags[0, k]
    return flags


@step
def _middle(cell):
    """Return the middle of a cell and half its extents."""
    x0, x1, y0, y1 = cell[0], cell[1], cell[2], cell[3]
    return 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0)


@step
def _highest_of(vertices, first, last, n):
    """Return the largest product of n with some vertices."""
    height = -np.inf
    for k in range(first, last):
        height = max(height, vertices[k, 0] * n[0] + vertices[k, 1] * n[1] + vertices[k, 2] * n[2])
    return height
