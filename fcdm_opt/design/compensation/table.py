"""A table of motions over the sizes: triangles with quadratic interpolation, for programs on the shop floor."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.design.moved_files import to_csv
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags, Ints, frozen, numbers
from fcdm_opt.plain import Plain
from fcdm_opt.tolerances import DEFAULT

NODES = 6
"""Nodes of a triangle: its corners 1, 2, 3 and the midpoints of its edges 12, 23, 31."""

_BUCKETS = 16  # a triangle: most points then have one triangle to look at, or two


def quadratic_basis(weights: Array) -> Array:
    """Return the functions that are 1 at one node and 0 at the others, (6, n), of barycentric coordinates, (3, n)."""
    r, s, t = weights
    return np.stack([r * (2 * r - 1), s * (2 * s - 1), t * (2 * t - 1), 4 * r * s, 4 * s * t, 4 * t * r])


@dataclass(frozen=True, kw_only=True, eq=False)
class MapPoints:
    """What a map says at size pairs; all arrays have the shape of what was asked.

    Attributes
    ----------
    parameters : array (..., k)
        The motion: lengths and radians, in the order of the map's names. nan: no motion, outside the map's box, or
        `undecided`.
    amount : array (...)
        Its amount, in length units. nan as above.
    error, displacement_error : array (...)
        Bounds of the error of the amount, and of the largest displacement of a vertex of a part that moves, as made,
        between this motion and the true one: length units.
    region : array of int (...)
        Number of the region, from 0; -1 outside the map's box.
    """

    parameters: Array
    amount: Array
    error: Array
    displacement_error: Array
    region: Ints
    posed: Callable[[Array], Array | dict[str, Array]] | None = field(default=None, repr=False)

    @property
    def transforms(self) -> Array | dict[str, Array]:
        """The same motions as transforms of the movable body, (..., 4, 4); nan where there is none.

        Of an assembly those of each part that moves, in the world, by its name.

        Raises
        ------
        InputError
            Where the points are those of a table alone, or of a map that does not know its problem.
        """
        if self.posed is None:
            raise InputError("only a map that has its problem knows the transforms", key="transforms")
        return self.posed(self.parameters)

    @property
    def undecided(self) -> Flags:
        """Where a map that was cut off does not know whether there is a motion; a motion may have an error of nan."""
        return np.isnan(self.amount) & np.isnan(self.error) & (self.region >= 0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Table(Plain):
    """Triangles that cover a box of size pairs, with a motion at six nodes each.

    Within a triangle, with barycentric coordinates r, s, t of a size pair (1 at corner 1, 2, 3), amount and parameters
    are the values at its nodes times r (2r - 1), s (2s - 1), t (2t - 1), 4rs, 4st, 4tr, added up. A pair on an edge
    that triangles share belongs to the one that comes first.

    Attributes
    ----------
    corners : array (m, 3, 2)
        Corners of the triangles: size pairs (rho_1, rho_2), or deviations of two sizes. They cover a rectangle without
        overlap.
    values : array (m, 6, 1 + k)
        Amount (length units), then the parameters (lengths, radians), at corners 1, 2, 3 and the midpoints of edges 12,
        23 and 31; nan where there is no motion.
    errors : array (m, 2)
        Bounds, in length units, of the error of the amount and of the motion, see `MapPoints`; nan where none is known.
    regions : array of int (m,)
        Number of the region that each triangle is part of, from 0.
    names : tuple of str
        Names of the k parameters.

    Raises
    ------
    InputError
        Where shapes do not match.
    """

    plain_names: ClassVar[tuple[str, ...]] = ("format", "names", "corners", "values", "errors", "regions")
    format: ClassVar[str] = "fcdm_opt compensation table 1"

    corners: Array
    values: Array
    errors: Array
    regions: Ints
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        count = len(np.atleast_1d(numbers(self.corners, "corners")))
        shapes = {"corners": (3, 2), "values": (NODES, 1 + len(self.names)), "errors": (2,), "regions": ()}
        for key, shape in shapes.items():
            array = numbers(getattr(self, key), key)
            if array.shape != (count, *shape) or not count:
                allowed = f"{(count, *shape)}, at least one triangle"
                raise InputError("wrong shape", key=key, found=array.shape, allowed=allowed)
            object.__setattr__(self, key, frozen(array, np.int64 if key == "regions" else np.float64))

    @cached_property
    def box(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The range of rho_1, and of rho_2, that the table covers."""
        low, high = self.corners.min(axis=(0, 1)).tolist(), self.corners.max(axis=(0, 1)).tolist()
        return (low[0], high[0]), (low[1], high[1])

    @cached_property
    def _locator(self) -> Locator:
        return Locator(self.corners)

    @cached_property
    def _columns(self) -> Array:
        """The values by parameter and node, (1 + k, 6, m)."""
        return np.ascontiguousarray(self.values.T)

    def at(self, rho1: ArrayLike, rho2: ArrayLike) -> MapPoints:
        """Return the motion for size pairs, with bounds of its error.

        Parameters
        ----------
        rho1, rho2 : float or array
            Actual sizes of body 1 and body 2, of one shape or of shapes that broadcast.

        Returns
        -------
        MapPoints
            nan and region -1 outside the box; a pair outside by no more than rounding is inside.

        Raises
        ------
        InputError
            For what is no numbers, and shapes that do not broadcast.
        """
        try:
            first, second = np.broadcast_arrays(numbers(rho1, "rho1"), numbers(rho2, "rho2"))
        except ValueError as reason:  # InputError, too
            raise InputError(f"not two arrays of sizes: {reason}", key="rho1, rho2") from reason
        triangle, weights = self._locator.locate(first.ravel(), second.ravel())
        basis, inside, shape = quadratic_basis(weights), triangle >= 0, first.shape
        values = np.empty((1 + len(self.names), len(triangle)))
        for value, columns in zip(values, self._columns, strict=True):  # each pair by itself: how many is no matter
            value[:] = sum(share * column.take(triangle) for share, column in zip(basis, columns, strict=True))
        errors = np.where(inside, self.errors.T.take(triangle, axis=1), np.nan)
        return MapPoints(
            parameters=values[1:].T.reshape(*shape, len(self.names)),
            amount=values[0].reshape(shape),
            error=errors[0].reshape(shape),
            displacement_error=errors[1].reshape(shape),
            region=np.where(inside, self.regions.take(triangle), -1).reshape(shape),
        )

    def __len__(self) -> int:
        return len(self.corners)

    def __repr__(self) -> str:
        (low_1, high_1), (low_2, high_2) = self.box
        return f"Table({len(self)} triangles over [{low_1:.6g}, {high_1:.6g}] x [{low_2:.6g}, {high_2:.6g}])"

    def to_csv(self, path: str | Path, sizes: Sequence[str] = ("rho1", "rho2")) -> None:
        """Write the table as CSV, a row a triangle: `rho1_2` is rho_1 at corner 2, `amount_4` the amount at node 4."""
        columns = (self.regions.tolist(), self.errors.tolist(), self.corners, np.swapaxes(self.values, 1, 2))
        rows = ([region, *errors, *corners.ravel().tolist(), *values.ravel().tolist()]
                for region, errors, corners, values in zip(*columns, strict=True))  # fmt: skip
        to_csv(path, [_columns(self.names, sizes), *rows])


def _columns(names: Sequence[str], sizes: Sequence[str]) -> list[str]:
    """Return the names of a CSV file's columns."""
    corners = [f"{size}_{corner}" for corner in (1, 2, 3) for size in sizes]
    nodes = [f"{name}_{node}" for name in ("amount", *names) for node in range(1, NODES + 1)]
    return ["region", "error", "displacement_error", *corners, *nodes]


class Locator:
    """Finds triangles by equal buckets of their box: each lists the triangles whose boxes meet it, in increasing order.

    Parameters
    ----------
    corners : array (m, 3, 2)
        Of triangles, none of them flat.

    Attributes
    ----------
    rounding : float
        Size pairs nearer to each other than this are one.
    seam : float
        Triangles may be apart, or overlap, by this.
    """

    def __init__(self, corners: Array) -> None:
        self.rounding = float(DEFAULT.point * np.abs(corners).max())
        self._low, self._high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        self._side = math.ceil(math.sqrt(_BUCKETS * len(corners)))
        first, (p, q) = corners[:, 0], np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 0)
        twice = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
        longest = np.sqrt(np.max([(p**2).sum(1), (q**2).sum(1), ((q - p) ** 2).sum(1)], axis=0))
        height = np.abs(twice) / longest
        # first corner, and the slopes of the second and third barycentric coordinate along both sizes; by columns
        self._frames = *first.T.copy(), *np.array([q[:, 1], -q[:, 0], -p[:, 1], p[:, 0]]) / twice
        # how far below zero a coordinate may be for a point that is in the triangle but for rounding, and on a seam
        self.seam = float(DEFAULT.line * np.abs(corners).max())
        self._slack = self.rounding / height, self.seam / height
        width, near = (self._high - self._low) / self._side, 2.0 * self.seam
        first, last = (
            np.clip((ends - self._low) // width, 0, self._side - 1).astype(np.int64)
            for ends in (corners.min(axis=1) - near, corners.max(axis=1) + near)
        )
        spans = last - first + 1
        counts = spans.prod(axis=1)
        triangle = np.repeat(np.arange(len(corners)), counts)
        place = np.arange(len(triangle)) - np.repeat(np.cumsum(counts) - counts, counts)
        row, column = first[triangle, 0] + place // spans[triangle, 1], first[triangle, 1] + place % spans[triangle, 1]
        bucket = row * self._side + column
        self._members = triangle[np.argsort(bucket, kind="stable")]
        self._starts = np.concatenate([[0], np.cumsum(np.bincount(bucket, minlength=self._side**2))])

    def _weights(self, triangle: Ints, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """Return the barycentric coordinates of size pairs in triangles."""
        first_x, first_y, second_x, second_y, third_x, third_y = (column.take(triangle) for column in self._frames)
        x, y = x - first_x, y - first_y
        s, t = second_x * x + second_y * y, third_x * x + third_y * y
        return 1.0 - s - t, s, t

    def locate(self, x: Array, y: Array) -> tuple[Ints, Array]:
        """Return the first triangle that holds each size pair, and the pair's barycentric coordinates there.

        Parameters
        ----------
        x, y : array (n,)

        Returns
        -------
        array of int (n,), array (3, n)
            -1 and nan for what is in no triangle.
        """
        low, high = self._low - self.rounding, self._high + self.rounding
        inside = np.flatnonzero((x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1]))  # nan is not
        triangles, weights = np.full(len(x), -1), np.full((3, len(x)), np.nan)
        x, y = np.clip([x[inside], y[inside]], self._low[:, None], self._high[:, None])
        scale = self._side / (self._high - self._low)
        row, column = ((x - self._low[0]) * scale[0]).astype(np.int64), ((y - self._low[1]) * scale[1]).astype(np.int64)
        bucket = np.minimum(row, self._side - 1) * self._side + np.minimum(column, self._side - 1)
        for slack in self._slack:
            left = np.arange(len(x)) if slack is self._slack[0] else np.flatnonzero(triangles[inside] < 0)
            place, end = self._starts[bucket[left]], self._starts[bucket[left] + 1]
            while len(left):
                full = place < end
                if not full.all():
                    left, place, end = left[full], place[full], end[full]
                member = self._members[place]
                there = self._weights(member, x[left], y[left])
                hit = np.minimum(np.minimum(*there[:2]), there[2]) >= -slack[member]
                where = inside[left[hit]]
                triangles[where] = member[hit]
                for coordinate, weight in zip(weights, there, strict=True):
                    coordinate[where] = weight[hit]
                left, place, end = left[~hit], place[~hit] + 1, end[~hit]
        return triangles, weights
