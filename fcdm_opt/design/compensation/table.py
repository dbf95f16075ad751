"""A table of motions over the sizes: simplices with quadratic interpolation, for programs on the shop floor."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags, Ints, frozen, numbers
from fcdm_opt.geometry.units import number_text
from fcdm_opt.moved_files import to_csv
from fcdm_opt.plain import Plain
from fcdm_opt.tolerances import DEFAULT

KINDS = {1: "interval", 2: "triangle", 3: "tetrahedron"}  # what simplices of so many sizes are called
FIRST = 3  # sizes up to which what is on a facet that simplices share belongs to the first of them; of more to any
LISTED = 20  # points of which something is said in words
_BUCKETS = 16  # a simplex: most points then have one simplex to look at, or two


@lru_cache
def edges_of(sizes: int) -> tuple[tuple[int, int], ...]:
    """Return the edges of a simplex by its corners, from 0: 01, 12, ..., then 02, 13, ..., and so on."""
    return tuple((i, i + step) for step in range(1, sizes + 1) for i in range(sizes + 1 - step))


def nodes_of(corners: Array) -> Array:
    """Return the nodes of simplices, (..., n, k): their corners, then the midpoints of their edges."""
    one, two = np.transpose(edges_of(corners.shape[-2] - 1))
    return np.concatenate([corners, (corners[..., one, :] + corners[..., two, :]) / 2.0], axis=-2)


def quadratic_basis(weights: Array) -> Array:
    """Return functions that are 1 at one node and 0 at the others, (n, m), of barycentric coordinates, (k + 1, m)."""
    corners = [own * (2 * own - 1) for own in weights]
    return np.stack([*corners, *(4 * weights[i] * weights[j] for i, j in edges_of(len(weights) - 1))])


def amounts_of(parameters: Array, amounts: Array, weights: Sequence[float]) -> Array:
    """Return the amounts of motions, (..., p), by the weights of their parameters; without weights those given."""
    return np.asarray(np.linalg.norm(parameters * np.asarray(weights), axis=-1) if weights else amounts)


def slopes(corners: Array) -> Array:
    """Return the gradients of barycentric coordinates of simplices, (..., k + 1, k): 1 / the height over each facet."""
    others = np.swapaxes(np.linalg.inv(corners[..., 1:, :] - corners[..., :1, :]), -1, -2)
    return np.concatenate([-others.sum(axis=-2, keepdims=True), others], axis=-2)


def volumes(corners: Array) -> Array:
    """Return the signed volumes of simplices, (..., k + 1, k): lengths, areas, volumes."""
    sizes = corners.shape[-1]
    return np.asarray(np.linalg.det(corners[..., 1:, :] - corners[..., :1, :])) / math.factorial(sizes)


def simplices(count: int, sizes: int) -> str:
    """Return a number of simplices in words."""
    kind = KINDS.get(sizes, "simplex")
    several = {"tetrahedron": "tetrahedra", "simplex": "simplices"}.get(kind, f"{kind}s")
    return f"{count} {kind if count == 1 else several}"


def box_text(box: Sequence[Sequence[float]] | Array) -> str:
    """Return a box of sizes in words."""
    return " x ".join(f"[{low:.6g}, {high:.6g}]" for low, high in box)


@dataclass(frozen=True, kw_only=True, eq=False)
class MapPoints:
    """What a map says at sizes; all arrays have the shape of what was asked."""

    # the motion, (..., p): lengths and radians, in the order of the map's names. nan: no motion, outside the map's box,
    # or `undecided`
    parameters: Array
    amount: Array  # its amount, (...), in length units. nan as above
    error: Array  # bound of the error of the amount, (...), length units
    # the same of the largest displacement of a vertex of a moving part, as made, between this motion and the true one
    displacement_error: Array
    region: Ints  # number of the region, (...), from 0; -1 outside the map's box
    names: tuple[str, ...] = ()  # of the parameters
    posed: Callable[[Array], Array | dict[str, Array]] | None = field(default=None, repr=False)

    @property
    def transforms(self) -> Array | dict[str, Array]:
        """The same motions as transforms of the movable body, (..., 4, 4); nan where there is none.

        Of an assembly those of each part that moves, in the world, by its name. An `InputError` where the points are
        those of a table alone, or of a map that does not know its problem.
        """
        if self.posed is None:
            raise InputError("only a map that has its problem knows the transforms", key="transforms")
        return self.posed(self.parameters)

    def __str__(self) -> str:
        """Return a line for each point, of many for the first ones: its motion, lengths and radians, and amount."""
        q = self.parameters.reshape(self.amount.size, -1)
        amounts, errors = self.amount.ravel(), self.error.ravel()
        regions, lines = self.region.ravel().tolist(), list[str]()
        for values, amount, error, region in zip(q[:LISTED].tolist(), amounts, errors, regions[:LISTED], strict=False):
            motion = ", ".join(f"{name} {number_text(x)}" for name, x in zip(self.names, values, strict=True))
            if region < 0:
                lines.append("outside the sizes that the map is of")
            elif np.isnan(amount):
                lines.append(f"{'undecided' if np.isnan(error) else 'no motion, or none known'}, region {region}")
            else:
                lines.append(f"{motion}, amount {number_text(amount)} +- {error:.1g}, region {region}")
        more = len(amounts) - len(lines)
        return "\n".join([*lines, *([f"... and {more} more"] if more else [])])

    @property
    def undecided(self) -> Flags:
        """Where a map that was cut off does not know whether there is a motion; a motion may have an error of nan."""
        return np.isnan(self.amount) & np.isnan(self.error) & (self.region >= 0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Table(Plain):
    """Simplices that cover a box of k sizes, with a motion at n = (k + 1) (k + 2) / 2 nodes each.

    Intervals of one size, triangles of two, tetrahedra of three. Within a simplex, with barycentric coordinates r_i (1
    at corner i), amount and parameters are the values at its corners times r_i (2 r_i - 1), and those at the midpoints
    of its edges ij times 4 r_i r_j, added up. Sizes on a facet that simplices share belong to the one that comes first;
    of more than three to any. Shapes that do not match are an `InputError`.
    """

    plain_names: ClassVar[tuple[str, ...]] = ("format", "names", "corners", "values", "errors", "regions", "weights")
    format: ClassVar[str] = "fcdm_opt compensation table 1"

    # of the simplices, (m, k + 1, k): sizes (rho_1, rho_2), or deviations of sizes. They cover a box without overlap
    corners: Array
    # amount (length units), then the parameters (lengths, radians), at the corners and the midpoints of edges 12, 23,
    # ..., then 13, 24, ..., (m, n, 1 + p); nan where there is no motion
    values: Array
    # bounds of the error of amount and motion, in length units, see `MapPoints`, (m, 2); nan where none is known
    errors: Array
    regions: Ints  # number of the region that each simplex is part of, from 0, (m,)
    names: tuple[str, ...]  # of the p parameters
    # their weights in the amount, per length unit or radian: it is the root of the sum of (weight times parameter)^2
    # everywhere. None where the amount is another one, which is interpolated as the parameters are
    weights: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        corners = np.atleast_1d(numbers(self.corners, "corners"))
        count, k = len(corners), corners.shape[-1]
        nodes = k + 1 + len(edges_of(k))
        shapes = {"corners": (k + 1, k), "values": (nodes, 1 + len(self.names)), "errors": (2,), "regions": ()}
        for key, shape in shapes.items():
            array = numbers(getattr(self, key), key)
            if array.shape != (count, *shape) or not count:
                allowed = f"{(count, *shape)}, at least one simplex"
                raise InputError("wrong shape", key=key, found=array.shape, allowed=allowed)
            object.__setattr__(self, key, frozen(array, np.int64 if key == "regions" else np.float64))
        if len(self.weights) not in (0, len(self.names)):
            allowed = f"{len(self.names)}, or none"
            raise InputError("wrong shape", key="weights", found=len(self.weights), allowed=allowed)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Rebuild a table from `to_dict`; raises `InputError` for anything else."""
        return super().from_dict({"weights": (), **data})  # which older files lack

    @cached_property
    def box(self) -> tuple[tuple[float, float], ...]:
        """The range of each size that the table covers."""
        low, high = self.corners.min(axis=(0, 1)).tolist(), self.corners.max(axis=(0, 1)).tolist()
        return tuple(zip(low, high, strict=True))

    @cached_property
    def _locator(self) -> Locator:
        return Locator(self.corners)

    @cached_property
    def _columns(self) -> Array:
        """The values by parameter and node, (1 + p, n, m)."""
        return np.ascontiguousarray(self.values.T)

    def at(self, *sizes: ArrayLike) -> MapPoints:
        """Return the motion at actual sizes, an argument each (of body 1 and body 2, say), with bounds of its error.

        Sizes are of one shape, or of shapes that broadcast. nan and region -1 outside the box; sizes outside by no more
        than rounding are inside. An `InputError` for what is no numbers, another number of sizes, and shapes that do
        not broadcast.
        """
        count = self.corners.shape[-1]
        try:
            given = np.broadcast_arrays(*(numbers(own, f"sizes[{k}]") for k, own in enumerate(sizes, 1)))
        except ValueError as reason:  # InputError, too
            raise InputError(f"not {count} arrays of sizes: {reason}", key="sizes") from reason
        if len(given) != count:
            raise InputError(f"not {count} arrays of sizes", key="sizes", found=len(given), allowed=str(count))
        shape = given[0].shape
        simplex, weights = self._locator.locate(np.array([own.ravel() for own in given]))
        basis, inside = quadratic_basis(weights), simplex >= 0
        values = np.empty((1 + len(self.names), len(simplex)))
        for value, columns in zip(values, self._columns, strict=True):  # each by itself: how many is no matter
            value[:] = sum(share * column.take(simplex) for share, column in zip(basis, columns, strict=True))
        errors = np.where(inside, self.errors.T.take(simplex, axis=1), np.nan)
        return MapPoints(
            parameters=values[1:].T.reshape(*shape, len(self.names)),
            amount=amounts_of(values[1:].T, values[0], self.weights).reshape(shape),
            error=errors[0].reshape(shape),
            displacement_error=errors[1].reshape(shape),
            region=np.where(inside, self.regions.take(simplex), -1).reshape(shape),
            names=self.names,
        )

    def __len__(self) -> int:
        return len(self.corners)

    def __repr__(self) -> str:
        return f"Table({simplices(len(self), len(self.box))} over {box_text(self.box)})"

    def to_csv(self, path: str | Path, sizes: Sequence[str] = ("rho1", "rho2")) -> None:
        """Write the table as CSV, a row a simplex: `rho1_2` is rho_1 at corner 2, `amount_4` the amount at node 4.

        With weights, `weight_TX` is that of TX, in each row: the amount follows from the interpolated parameters.
        """
        weighted = np.tile(self.weights, (len(self), 1))
        columns = (self.regions.tolist(), self.errors.tolist(), self.corners, np.swapaxes(self.values, 1, 2), weighted)
        rows = ([region, *errors, *corners.ravel().tolist(), *values.ravel().tolist(), *weights.tolist()]
                for region, errors, corners, values, weights in zip(*columns, strict=True))  # fmt: skip
        corners = [f"{size}_{corner}" for corner in range(1, len(sizes) + 2) for size in sizes]
        nodes = [f"{name}_{k}" for name in ("amount", *self.names) for k in range(1, self.values.shape[1] + 1)]
        weights = [f"weight_{name}" for name in self.names[: len(self.weights)]]
        to_csv(path, [["region", "error", "displacement_error", *corners, *nodes, *weights], *rows])


class Locator:
    """Finds simplices by equal buckets of their box: each lists the simplices that meet it, in increasing order.

    Their corners are (m, k + 1, k), and none of them is flat. Sizes nearer to each other than `rounding` are one;
    simplices may be apart, or overlap, by the `seam`.
    """

    def __init__(self, corners: Array) -> None:
        count, _, sizes = corners.shape
        largest = np.abs(corners).max()
        self.rounding, self.seam = float(DEFAULT.point * largest), float(DEFAULT.line * largest)
        self._low, self._high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        # first corner, and the slopes of all barycentric coordinates but the first along all sizes; by columns
        steep = slopes(corners)
        self._first, self._slopes = corners[:, 0].T.copy(), np.moveaxis(steep, 0, -1)[1:].copy()
        # how far below zero a coordinate may be for a point that is in the simplex but for rounding, and on a seam
        steepest = np.linalg.norm(steep, axis=-1).max(axis=-1)
        self._slack = self.rounding * steepest, self.seam * steepest
        # what only touches a bucket is in it, for the first of several to be found; of many sizes that were most
        margin = 2.0 * self.seam * (1.0 if sizes <= FIRST else -1.0)
        ends = corners.min(axis=1) - margin, corners.max(axis=1) + margin
        self._sides, member, bucket = np.ones(sizes, dtype=np.int64), np.arange(count), np.zeros((count, sizes), int)
        for k in range(round(math.log2(_BUCKETS * count))):  # halved along one size after the other
            self._sides[k % sizes] *= 2
            bucket[:, k % sizes] *= 2
            member, bucket = np.repeat(member, 2), np.repeat(bucket, 2, axis=0)
            bucket[1::2, k % sizes] += 1
            width = (self._high - self._low) / self._sides
            middle = self._low + (bucket + 0.5) * width
            spread = (np.abs(steep) @ (width / 2.0)).T + margin * steepest
            meets = (self._weights(member, middle.T) >= -spread[:, member]).all(axis=0)
            meets &= ((middle + width / 2 >= ends[0][member]) & (middle - width / 2 <= ends[1][member])).all(axis=1)
            member, bucket = member[meets], bucket[meets]
        keys = np.ravel_multi_index(tuple(bucket.T), tuple(self._sides))
        self._members = member[np.argsort(keys, kind="stable")]
        self._starts = np.concatenate([[0], np.cumsum(np.bincount(keys, minlength=int(self._sides.prod())))])

    def _weights(self, simplex: Ints, points: Array) -> Array:
        """Return the barycentric coordinates, (k + 1, n), of points, (k, n), in a simplex each."""
        away = [x - first.take(simplex) for x, first in zip(points, self._first, strict=True)]
        others = [sum(slope.take(simplex) * x for slope, x in zip(row, away, strict=True)) for row in self._slopes]
        return np.array([1.0 - sum(others), *others])

    def locate(self, points: Array) -> tuple[Ints, Array]:
        """Return the first simplex of each point, (k, n), and barycentric coordinates, (k + 1, n); -1, nan without."""
        (sizes, count), low, high = points.shape, self._low[:, None], self._high[:, None]
        within = (points >= low - self.rounding) & (points <= high + self.rounding)  # nan is not
        inside = np.flatnonzero(within.all(axis=0))
        found, weights = np.full(count, -1), np.full((sizes + 1, count), np.nan)
        points, sides = np.clip(points[:, inside], low, high), self._sides[:, None]
        bucket = np.minimum(((points - low) * (sides / (high - low))).astype(np.int64), sides - 1)
        bucket = np.ravel_multi_index(tuple(bucket), tuple(self._sides))
        for slack in self._slack:
            pending = np.arange(len(inside)) if slack is self._slack[0] else np.flatnonzero(found[inside] < 0)
            place, end = self._starts[bucket[pending]], self._starts[bucket[pending] + 1]
            while len(pending):
                full = place < end
                if not full.all():
                    pending, place, end = pending[full], place[full], end[full]
                member = self._members[place]
                there = self._weights(member, points[:, pending])
                hit = there.min(axis=0) >= -slack[member]
                where = inside[pending[hit]]
                found[where], weights[:, where] = member[hit], there[:, hit]
                pending, place, end = pending[~hit], place[~hit] + 1, end[~hit]
        return found, weights
