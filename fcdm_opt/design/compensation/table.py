"""A table of motions over the sizes: triangles with quadratic interpolation, for programs on the shop floor."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.design.compensation.lookup import Locator
from fcdm_opt.design.moved_files import of_json, read, to_csv, to_json
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints, frozen, numbers
from fcdm_opt.plain import Plain
from fcdm_opt.tolerances import DEFAULT

NODES = 6
"""Nodes of a triangle: its corners 1, 2, 3 and the midpoints of its edges 12, 23, 31."""

_FORMAT = "fcdm_opt compensation table 1"
_INNER = np.array([[1.0, 1.0, 1.0], [2.4, 0.3, 0.3], [0.3, 2.4, 0.3], [0.3, 0.3, 2.4]]) / 3.0
"""Points well inside a triangle, as weights of its corners: its middle, and one near each corner."""

_NUMBERS = {
    "corners": (lambda x: np.isfinite(x) & (x > 0.0), "finite sizes > 0"),
    "values": (lambda x: ~np.isinf(x), "finite numbers, nan: no motion"),
    "errors": (lambda x: ~(np.isinf(x) | (x < 0.0)), "finite lengths >= 0, nan: no bound"),
    "regions": (lambda x: (x == np.rint(x)) & (x >= 0.0), "whole numbers >= 0"),
}
"""Which numbers each array may hold."""


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
        The motion: lengths and radians, in the order of the map's names. nan: no motion, or outside the map's box.
    amount : array (...)
        Its amount, in length units. nan as above.
    error, displacement_error : array (...)
        Bounds of the error of the amount, and of the largest displacement of a vertex of body 1, as made, between this
        motion and the true one: length units.
    region : array of int (...)
        Number of the region, from 0; -1 outside the map's box.
    """

    parameters: Array
    amount: Array
    error: Array
    displacement_error: Array
    region: Ints


@dataclass(frozen=True, kw_only=True, eq=False)
class Table(Plain):
    """Triangles that cover a box of size pairs, with a motion at six nodes each.

    Within a triangle, with barycentric coordinates r, s, t of a size pair (1 at corner 1, 2, 3), amount and parameters
    are the values at its nodes times r (2r - 1), s (2s - 1), t (2t - 1), 4rs, 4st, 4tr, added up. A pair on an edge
    that triangles share belongs to the one that comes first.

    Attributes
    ----------
    corners : array (m, 3, 2)
        Corners of the triangles: size pairs (rho_1, rho_2). They cover a rectangle without overlap.
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
        Where shapes do not match, a triangle is flat, or the triangles leave part of the rectangle uncovered.
    """

    plain_names: ClassVar[tuple[str, ...]] = ("format", "names", "corners", "values", "errors", "regions")
    format: ClassVar[str] = _FORMAT

    corners: Array
    values: Array
    errors: Array
    regions: Ints
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        names = tuple(self.names) if isinstance(self.names, list | tuple) else (None,)
        if not all(isinstance(name, str) for name in names) or len({*names, "amount"}) != len(names) + 1:
            raise InputError("parameters need names of their own", key="names", found=self.names)
        object.__setattr__(self, "names", names)
        corners = numbers(self.corners, "corners")
        count = len(corners) if corners.ndim else 0
        shapes = ((count, 3, 2), (count, NODES, 1 + len(names)), (count, 2), (count,))
        for (key, (passes, allowed)), shape in zip(_NUMBERS.items(), shapes, strict=True):
            array = numbers(getattr(self, key), key)
            if array.shape != shape or not count:
                raise InputError("wrong shape", key=key, found=array.shape, allowed=f"{shape}, at least one triangle")
            wrong = np.argwhere(~passes(array))
            if len(wrong):
                first = int(wrong[0, 0])
                found = array[first].tolist()
                raise InputError("unusable number", key=f"{key}[{first}]", found=found, allowed=allowed)
            object.__setattr__(self, key, frozen(array, np.int64 if key == "regions" else np.float64))
        self._check_cover()

    def _check_cover(self) -> None:
        """Raise `InputError` unless the triangles' areas add up to their box's, and none lies on another."""
        edges = np.roll(self.corners, -1, axis=1) - self.corners
        lengths = np.hypot(edges[..., 0], edges[..., 1])
        areas = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) / 2.0
        flat = np.flatnonzero(2.0 * areas <= DEFAULT.point * self.corners.max() * lengths.max(axis=1))
        if flat.size:
            raise InputError("a flat triangle", key=f"corners[{flat[0]}]", found=self.corners[flat[0]].tolist())
        whole = float(np.prod(np.ptp(self.box, axis=1)))
        if not abs(areas.sum() - whole) <= self._locator.seam * lengths.sum():
            raise InputError(
                "the triangles do not cover their box exactly once",
                key="corners",
                found=f"{areas.sum():.9g} of {whole:.9g}",
            )
        # points well inside a triangle that are in another: what is there twice lacks elsewhere; points nearer to the
        # rim of their triangle than seams may be wide tell nothing
        points = np.einsum("kc,mcx->mkx", _INNER, self.corners).reshape(-1, 2)
        found, own = self._locator.locate(*points.T)[0], np.repeat(np.arange(len(self)), len(_INNER))
        told = _INNER.min() * 2.0 * areas / lengths.max(axis=1) > 2.0 * self._locator.seam
        wrong = np.flatnonzero(told[own] & (found != own))
        if wrong.size:
            one, two = sorted((int(own[wrong[0]]), int(found[wrong[0]])))
            raise InputError(
                "triangles overlap", key=f"corners[{one}], corners[{two}]", found=points[wrong[0]].tolist()
            )

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

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Table:
        """Return the table that `to_dict` gave, bit for bit.

        Raises
        ------
        InputError
            For anything else.
        """
        if not isinstance(data, Mapping) or data.get("format") != _FORMAT:
            raise InputError("not a compensation table", allowed=f"format = {_FORMAT!r}")
        keys = set(cls.plain_names)
        if set(data) != keys:
            odd = sorted(set(data) ^ keys, key=str)
            raise InputError("keys are missing or unknown", found=odd, allowed=", ".join(sorted(keys)))
        if not isinstance(data["names"], list):
            raise InputError("a list of names is wanted", key="names", found=data["names"])
        return cls(**{name: data[name] for name in cls.plain_names[1:]})

    def to_json(self, path: str | Path) -> None:
        """Write the table as JSON; the file is there as a whole or not at all."""
        to_json(path, self.to_dict())

    def to_csv(self, path: str | Path) -> None:
        """Write the table as CSV, a row a triangle: `rho1_2` is rho_1 at corner 2, `amount_4` the amount at node 4."""
        columns = (self.regions.tolist(), self.errors.tolist(), self.corners, np.swapaxes(self.values, 1, 2))
        rows = ([region, *errors, *corners.ravel().tolist(), *values.ravel().tolist()]
                for region, errors, corners, values in zip(*columns, strict=True))  # fmt: skip
        to_csv(path, [_columns(self.names), *rows])

    @classmethod
    def read(cls, path: str | Path) -> Table:
        """Read what `to_json` (a name that ends in .json) or `to_csv` wrote, bit for bit.

        Raises
        ------
        InputError
            Naming the file, and what in it cannot be used.
        """
        is_json = str(path).lower().endswith(".json")
        return read(path, (lambda text: cls.from_dict(of_json(text))) if is_json else cls._from_csv)

    @classmethod
    def _from_csv(cls, text: str) -> Table:
        """Return the table in a CSV text."""
        try:
            header, *rows = [row for row in csv.reader(io.StringIO(text), strict=True) if row] or [[]]
        except csv.Error as reason:
            raise InputError(f"not CSV: {reason}") from reason
        fixed = len(_columns(()))
        names = tuple(column[:-2] for column in header[fixed::NODES])
        if header != _columns(names):
            raise InputError("not the columns of a compensation table", found=header[:12], allowed=f"{_columns(())}")
        table = np.empty((len(rows), len(header)))
        for number, row in enumerate(rows):
            try:
                table[number] = [float(cell) for cell in row]
            except ValueError as reason:
                raise InputError(f"not {len(header)} numbers", key=f"row {number + 2}", found=row) from reason
        arrays: dict[str, Any] = {
            "corners": table[:, 3:9].reshape(-1, 3, 2),
            "values": np.swapaxes(table[:, 9:].reshape(-1, 1 + len(names), NODES), 1, 2),
            "errors": table[:, 1:3],
            "regions": table[:, 0],
        }
        return cls(**arrays, names=names)


def _columns(names: Sequence[str]) -> list[str]:
    """Return the names of a CSV file's columns."""
    corners = [f"{rho}_{corner}" for corner in (1, 2, 3) for rho in ("rho1", "rho2")]
    nodes = [f"{name}_{node}" for name in ("amount", *names) for node in range(1, NODES + 1)]
    return ["region", "error", "displacement_error", *corners, *nodes]
