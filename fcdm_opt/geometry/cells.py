"""Convex cells, cut by planes: sides are told in floats, points are made in rationals.

A point within `Tolerances.planarity` of a plane is on it; so its side is a sign that floats know, or zero, and a point
that a cut makes on an edge is on every plane that the edge is on. A cell is the points that are its corners and the
planes that bound it; which corners share an edge follows from the planes they share (the double description method).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.geometry.measures import cross, units
from fcdm_opt.tolerances import DEFAULT

Signs = NDArray[np.int8]
MOST_DIGITS = 4096  # binary, of a point's denominator: points of three planes through drawn corners have some 500

if TYPE_CHECKING:
    from flint import fmpq

    Point = tuple[fmpq, ...]


class Cell(NamedTuple):
    """A convex polytope: rows of its corners, its planes, and the side (1 or -1) of each plane that is outside."""

    points: Ints
    planes: Ints
    sides: Ints


class Facet(NamedTuple):
    """A convex polygon of the body's surface: its plane, which side of that is outside, its corners' rows in order."""

    plane: int
    side: int
    loop: tuple[int, ...]


class Arrangement:
    """Points and planes, and on which side of each plane each point lies. Both are added to, none is changed.

    `vertices` (n, 3): the first points. `used` (k,): those of them that count for the size.
    """

    exact: list[Point]  # the points as drawn, as rationals
    normals: Array  # unit normals of the planes, (p, 3), and their products with points of them, as in `local`, (p,)
    levels: Array

    def __init__(self, vertices: Array, used: Ints) -> None:
        spread = vertices - vertices[used[0]]
        self._origin = _exactly(vertices[used[0]])
        self.size = float(np.abs(spread[used]).max())
        # far from the origin a drawn vertex is off its plane by its coordinates' last digit
        digits = 4 * float(np.spacing(np.abs(vertices[used]).max())) / self.size
        self.slack = max(DEFAULT.planarity, digits)
        self.exact = [_exactly(row) for row in vertices]
        self._rows = {point: k for k, point in reversed(list(enumerate(self.exact)))}
        self._cuts: dict[tuple[int, int, int], int] = {}
        self._volumes: dict[bytes, float] = {}
        self._local, self._signs = spread / self.size, np.empty((0, len(vertices)), np.int8)
        self._points = len(vertices)
        self.normals, self.levels = np.empty((0, 3)), np.empty(0)
        self._equations: list[Point] = []
        self._near = {name: int(k) for k in used[::-1] for name in self._cells(self.local[k])}
        self.planar = True

    def heights(self, points: Sequence[int] | Ints, plane: int) -> Array:
        """Return how far points are above a plane, in units of the size."""
        return self.local[points] @ self.normals[plane] - self.levels[plane]

    def coordinates(self, points: Iterable[int]) -> Array:
        """Return points, rounded once."""
        return np.array([[_rounded(x) for x in self.exact[k]] for k in points])

    @property
    def local(self) -> Array:
        """The points relative to the first one, in units of the size, (n, 3)."""
        return self._local[: self._points]

    @property
    def signs(self) -> Signs:
        """The side (1, 0, -1) of each plane that each point lies on, (p, n)."""
        return self._signs[:, : self._points]

    def shared_plane(self, points: Sequence[int]) -> int | None:
        """Return the plane of four points, added if there is none; None where it would spoil planes that are exact."""
        known = np.flatnonzero((self.signs[:, list(points)] == 0).all(axis=1))
        if known.size:
            return int(known[0])
        if self.planar:
            a, b, c, d = (np.array(self.exact[k]) for k in points)
            if cross(b - a, c - a) @ (d - a):
                return None
        return self.plane(points)

    def signs_of(self, quads: Ints, points: Ints) -> Signs:
        """Return the sides that points lie on of planes through four points each, not on one line."""
        a, b, c, d = self.local[quads.T]
        one, two = np.cross(b - a, c - a), np.cross(b - a, d - a)
        normals = np.where(((one**2).sum(axis=1) > (two**2).sum(axis=1))[:, None], one, two)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        return _sides(normals @ self.local[points].T - (normals * a).sum(axis=1)[:, None], self.slack)

    def plane(self, points: Sequence[int]) -> int:
        """Add the plane through points that lie in one, through the three that are furthest apart; return its row."""
        rows = np.array(points)
        local = self.local[rows]
        first = int(((local - local.mean(axis=0)) ** 2).sum(axis=1).argmax())
        along = local - local[first]
        second = int((along**2).sum(axis=1).argmax())
        third = int((np.cross(along, along[second]) ** 2).sum(axis=1).argmax())
        a, b, c = (np.array(self.exact[k]) for k in rows[[first, second, third]])
        n = cross(b - a, c - a)
        n = n / max(abs(n))
        unit = units(np.array([_rounded(x) for x in n]))
        row = len(self.levels)
        self.normals, self.levels = np.vstack([self.normals, unit]), np.append(self.levels, unit @ local[first])
        self._equations.append((*n, n @ a))
        self._signs = np.vstack([self._signs, _sides(self._local @ unit - self.levels[row], self.slack)])
        self.lie_on(points, row)
        return row

    def parallel(self, plane: int, points: tuple[int, int]) -> int:
        """Return the plane in parallel to another through the middle of two points, added if there is none."""
        known = np.abs(self.normals @ self.normals[plane]) >= 1.0 - self.slack
        known &= np.abs(self.normals @ self.local[list(points)].mean(axis=0) - self.levels) <= self.slack
        if known.any():
            return int(np.flatnonzero(known)[0])
        corners = [np.array(self.exact[k]) for k in np.flatnonzero(self.signs[plane] == 0)]
        one, two = (np.array(self.exact[k]) for k in points)
        shift = (one + two) / 2 - corners[0]
        return self.plane([self._placed(tuple(corner + shift)) for corner in corners])

    def lie_on(self, points: Sequence[int], plane: int) -> None:
        """Count points as points of a plane."""
        self.signs[plane, list(points)] = 0
        self.planar = self.planar and not any(self._height(k, plane) for k in points)

    def cut(self, a: int, b: int, plane: int) -> int:
        """Return the point in which the edge from a to b, on different sides of a plane, crosses it."""
        key = (min(a, b), max(a, b), plane)
        if key in self._cuts:
            return self._cuts[key]
        a, b, _ = key
        above, below = self._height(a, plane), self._height(b, plane)
        share = above / (above - below)
        point = tuple(x + share * (y - x) for x, y in zip(self.exact[a], self.exact[b], strict=True))
        # points near a plane that count as on it, as on drawn faces that are no planes: digits multiply from cut to cut
        self.planar = self.planar and point[0].q.bit_length() < MOST_DIGITS
        if not self.planar:
            point = _exactly([_rounded(x) for x in point])
        self._cuts[key] = row = self._placed(point)
        on = (self.signs[:, a] == 0) & (self.signs[:, b] == 0)
        on[plane] = True
        self.signs[on, row] = 0
        return row

    def point(self, coordinates: Array) -> int:
        """Add a point, given in floats; return its row."""
        return self._placed(_exactly(coordinates))

    def _placed(self, point: Point) -> int:
        """Return the row of a point, added unless it is there already."""
        row = self._rows.get(point)
        local = np.array([_rounded(x - o) for x, o in zip(point, self._origin, strict=True)]) / self.size
        names = self._cells(local)
        if row is None and not self.planar:
            row = next((self._near[name] for name in names if name in self._near), None)
        if row is not None:
            return row
        row = self._points
        self.exact.append(point)
        self._rows[point] = row
        if row == len(self._local):  # room for as many again: each point added alone would copy all of them
            self._local, self._signs = np.pad(self._local, ((0, row), (0, 0))), np.pad(self._signs, ((0, 0), (0, row)))
        self._points += 1
        self._local[row], self._signs[:, row] = local, _sides(self.normals @ local - self.levels, self.slack)
        self._near.update(dict.fromkeys(names, row))
        return row

    def _cells(self, local: Array) -> list[tuple[int, ...]]:
        """Return the cells that a place lies in of eight grids: of two places near each other one is the same."""
        cells = np.floor(local / (4 * self.slack) + np.array([[0.0], [0.5]])).astype(np.int64).tolist()
        return [(k, cells[k >> 2][0], cells[k >> 1 & 1][1], cells[k & 1][2]) for k in range(8)]

    def _height(self, point: int, plane: int) -> fmpq:
        a, b, c, level = self._equations[plane]
        x, y, z = self.exact[point]
        return a * x + b * y + c * z - level

    def on(self, cell: Cell) -> Array:
        """Tell which points of a cell lie on which of its planes, (planes, points), as zeros and ones."""
        return (self.signs[cell.planes[:, None], cell.points] == 0).astype(np.float32)

    def pruned(self, cell: Cell, doubtful: Flags | None = None) -> Cell:
        """Return a cell without points that are no corners: another point is on all their planes, and on more."""
        on = self.on(cell)
        asked = np.arange(len(cell.points)) if doubtful is None else np.flatnonzero(doubtful)
        shared = _in_common(on[:, asked], on)
        count = on.sum(axis=0)
        better = (count > count[asked][:, None]) | (np.arange(len(count)) < asked[:, None])
        needless = asked[((shared == count[asked][:, None]) & better).any(axis=1)]
        return cell._replace(points=np.delete(cell.points, needless))

    def split(self, cell: Cell, plane: int) -> tuple[Cell | None, Cell | None]:
        """Return what of a cell lies below and above a plane, None where nothing does."""
        pacing.check()
        own = self.signs[plane, cell.points]
        below, above = own < 0, own > 0
        if not below.any() or not above.any():
            return (cell if below.any() else None), (cell if above.any() else None)
        on = self.on(cell)
        low, high = np.flatnonzero(below), np.flatnonzero(above)
        i, j = np.nonzero(_in_common(on[:, low], on[:, high]) >= 2)
        both = on[:, low[i]] * on[:, high[j]]  # of edges no third corner is on all planes that the ends share
        edges = (_in_common(both, on) == both.sum(axis=0)[:, None]).sum(axis=1) == 2
        ends = cell.points[low[i[edges]]].tolist(), cell.points[high[j[edges]]].tolist()
        made = [self.cut(a, b, plane) for a, b in zip(*ends, strict=True)]

        def part(strictly: Flags, out: Flags, side: int) -> Cell:
            kept = on[:, strictly].any(axis=1)  # else no more than an edge of that face is left, on the cut
            points = np.unique([*cell.points[~out].tolist(), *made])
            whole = Cell(points, np.append(cell.planes[kept], plane), np.append(cell.sides[kept], side))
            return self.pruned(whole, self.signs[plane, points] == 0)

        return part(below, above, 1), part(above, below, -1)

    def volume(self, cell: Cell) -> float:
        """Return a cell's volume, in units of the size cubed; that of its box where it is too thin to tell."""
        from scipy.spatial import ConvexHull, QhullError

        key, corners = cell.points.tobytes(), self.local[cell.points]
        if key not in self._volumes:
            try:
                self._volumes[key] = float(ConvexHull(corners).volume)
            except (QhullError, ValueError):
                self._volumes[key] = float(np.ptp(corners, axis=0).prod())
        return self._volumes[key]

    def kept(self, cell: Cell | None, planes: Iterable[tuple[int, int]]) -> Cell | None:
        """Return what of a cell lies inside of planes, given with their outer sides."""
        for plane, side in planes:
            if cell is None:
                return None
            cell = self.split(cell, plane)[0 if side > 0 else 1]
        return cell

    def split_facets(self, facets: Iterable[Facet], plane: int) -> tuple[list[Facet], list[Facet], list[Facet]]:
        """Return what of facets lies below, above and on a plane."""
        sign = self.signs[plane].tolist()
        parts: tuple[list[Facet], list[Facet], list[Facet]] = [], [], []
        for facet in facets:
            own = [sign[v] for v in facet.loop]
            low, high = min(own), max(own)
            if low * high >= 0:
                parts[0 if low < 0 else 1 if high > 0 else 2].append(facet)
                continue
            ring = list(facet.loop)
            loop: list[int] = []
            for a, b in pairwise([*ring, ring[0]]):
                loop.append(a)
                if sign[a] * sign[b] < 0:
                    loop.append(self.cut(a, b, plane))
            sign.extend([0] * (len(self.local) - len(sign)))
            for k, side in enumerate((-1, 1)):
                parts[k].append(facet._replace(loop=tuple(v for v in loop if sign[v] * side >= 0)))
        return parts


def _in_common(ones: Array, others: Array) -> Array:
    """Return how many planes each of some points shares with each of others, of zeros and ones (planes, points)."""
    with np.errstate(invalid="ignore"):  # which BLAS seldom raises, of what is beside these in its registers
        return np.asarray(ones.T @ others)


def _sides(heights: Array, slack: float) -> Signs:
    return np.where(np.abs(heights) <= slack, 0, np.sign(heights)).astype(np.int8)


def _exactly(point: Iterable[float]) -> Point:
    from flint import fmpq

    return tuple(fmpq(*float(x).as_integer_ratio()) for x in point)


def _rounded(x: fmpq) -> float:
    return int(x.p) / int(x.q)
