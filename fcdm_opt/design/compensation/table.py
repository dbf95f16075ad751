"""A table of motions over the sizes: triangles with quadratic interpolation, for programs on the shop floor."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.design.moved_files import write
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints, frozen, numbers
from fcdm_opt.tolerances import DEFAULT

NODES = 6
"""Nodes of a triangle: its corners 1, 2, 3 and the midpoints of its edges 12, 23, 31."""

_FORMAT = "fcdm_opt compensation table 1"
_INNER = np.array([[1.0, 1.0, 1.0], [2.4, 0.3, 0.3], [0.3, 2.4, 0.3], [0.3, 0.3, 2.4]]) / 3.0
"""Points well inside a triangle, as weights of its corners: its middle, and one near each corner."""

_BUCKETS = 16  # a triangle: few enough to be made quickly, and most points have one triangle to look at, or two


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
class Table:
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

    corners: Array
    values: Array
    errors: Array
    regions: Ints
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        names = tuple(self.names) if isinstance(self.names, list | tuple) else (None,)
        if not all(isinstance(name, str) for name in names) or len({*names, "amount"}) != len(names) + 1:
            raise InputError("parameters need names of their own", key="names", found=self.names)
        corners = numbers(self.corners, "corners")
        count = len(corners) if corners.ndim else 0
        regions = numbers(self.regions, "regions")
        if not (regions == np.rint(regions)).all():
            raise InputError("regions are whole numbers", key="regions", found=self.regions)
        arrays = {
            "corners": (corners, (count, 3, 2)),
            "values": (numbers(self.values, "values"), (count, NODES, 1 + len(names))),
            "errors": (numbers(self.errors, "errors"), (count, 2)),
            "regions": (regions, (count,)),
        }
        for key, (array, shape) in arrays.items():
            if array.shape != shape or not count:
                raise InputError("wrong shape", key=key, found=array.shape, allowed=f"{shape}, at least one triangle")
            object.__setattr__(self, key, frozen(array, np.int64 if key == "regions" else np.float64))
        object.__setattr__(self, "names", names)
        for key, wrong in {
            "corners": ~(np.isfinite(corners) & (corners > 0.0)).all(axis=(1, 2)),
            "values": np.isinf(self.values).any(axis=(1, 2)),
            "errors": ((self.errors < 0.0) | np.isinf(self.errors)).any(axis=1),
            "regions": self.regions < 0,
        }.items():
            if wrong.any():
                first = int(np.flatnonzero(wrong)[0])
                found = getattr(self, key)[first].tolist()
                allowed = {
                    "corners": "finite sizes > 0",
                    "values": "finite numbers, nan: no motion",
                    "errors": "finite lengths >= 0, nan: no bound",
                    "regions": ">= 0",
                }[key]
                raise InputError("unusable number", key=f"{key}[{first}]", found=found, allowed=allowed)
        self._check_cover()

    def _check_cover(self) -> None:
        """Raise `InputError` unless the triangles' areas add up to their box's."""
        edges = np.roll(self.corners, -1, axis=1) - self.corners
        lengths = np.hypot(edges[..., 0], edges[..., 1])
        areas = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) / 2.0
        flat = np.flatnonzero(2.0 * areas <= self._rounding * lengths.max(axis=1))
        if flat.size:
            raise InputError("a flat triangle", key=f"corners[{flat[0]}]", found=self.corners[flat[0]].tolist())
        (low_1, high_1), (low_2, high_2) = self.box
        whole = (high_1 - low_1) * (high_2 - low_2)
        # seams as wide as `line` are rounding
        if not abs(areas.sum() - whole) <= DEFAULT.line * self.corners.max() * lengths.sum():
            raise InputError(
                "the triangles do not cover their box exactly once",
                key="corners",
                found=f"{areas.sum():.9g} of {whole:.9g}",
            )
        self._check_overlap(2.0 * areas / lengths.max(axis=1))

    def _check_overlap(self, heights: Array) -> None:
        """Raise `InputError` where points well inside a triangle are in another: what is there twice lacks elsewhere.

        Points nearer to the rim of their triangle than seams may be wide tell nothing.
        """
        from fcdm_opt.design.compensation.lookup import locate

        points = np.einsum("kc,mcx->mkx", _INNER, self.corners).reshape(-1, 2)
        found = np.empty(len(points), np.int64)
        locate(*np.ascontiguousarray(points.T), *self._index, found, np.empty((len(points), 2)))
        own = np.repeat(np.arange(len(self.corners)), len(_INNER))
        told = np.repeat(_INNER.min() * heights > 2.0 * DEFAULT.line * self.corners.max(), len(_INNER))
        wrong = np.flatnonzero(told & (found != own))
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

    @property
    def _rounding(self) -> float:
        """Size pairs nearer to each other than this are one."""
        return float(DEFAULT.point * self.corners.max())

    @cached_property
    def _index(self) -> tuple[Array, int, Ints, Ints, Array]:
        """Bounds, buckets and frames, see `lookup`."""
        from fcdm_opt.design.compensation.lookup import buckets

        (low_1, high_1), (low_2, high_2) = self.box
        bounds = np.array([low_1, low_2, high_1, high_2, self._rounding])
        side = math.ceil(math.sqrt(_BUCKETS * len(self.corners)))
        starts, members = buckets(self.corners, bounds, side)
        first, second, third = np.moveaxis(self.corners, 1, 0)
        p, q = second - first, third - first
        twice = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
        longest = np.sqrt(np.max([(p**2).sum(1), (q**2).sum(1), ((q - p) ** 2).sum(1)], axis=0))
        height = np.abs(twice) / longest
        frames = np.column_stack(
            [
                first,
                np.column_stack([q[:, 1], -q[:, 0], -p[:, 1], p[:, 0]]) / twice[:, None],
                self._rounding / height,
                DEFAULT.line * self.corners.max() / height,
            ]
        )
        return bounds, side, starts, members, np.ascontiguousarray(frames)

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
        from fcdm_opt.design.compensation.lookup import look_up

        try:
            first, second = np.broadcast_arrays(numbers(rho1, "rho1"), numbers(rho2, "rho2"))
        except ValueError as reason:  # InputError, too
            raise InputError(f"not two arrays of sizes: {reason}", key="rho1, rho2") from reason
        shape, count = first.shape, first.size
        amount, region = np.empty(count), np.empty(count, np.int64)
        parameters, error = np.empty((count, len(self.names))), np.empty((count, 2))
        look_up(
            np.ascontiguousarray(first).reshape(-1),
            np.ascontiguousarray(second).reshape(-1),
            *self._index,
            self.values,
            self.errors,
            self.regions,
            amount,
            parameters,
            error,
            region,
        )
        return MapPoints(
            parameters=parameters.reshape(*shape, len(self.names)),
            amount=amount.reshape(shape),
            error=error[:, 0].reshape(shape),
            displacement_error=error[:, 1].reshape(shape),
            region=region.reshape(shape),
        )

    def __len__(self) -> int:
        return len(self.corners)

    def __repr__(self) -> str:
        (low_1, high_1), (low_2, high_2) = self.box
        return f"Table({len(self)} triangles over [{low_1:.6g}, {high_1:.6g}] x [{low_2:.6g}, {high_2:.6g}])"

    def to_dict(self) -> dict[str, Any]:
        """Return plain data; nan is None."""
        return {
            "format": _FORMAT,
            "names": list(self.names),
            "corners": self.corners.tolist(),
            "values": _without_nan(self.values),
            "errors": _without_nan(self.errors),
            "regions": self.regions.tolist(),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Table:
        """Return the table that `to_dict` gave, bit for bit.

        Raises
        ------
        InputError
            For anything else.
        """
        keys = {"format", "names", "corners", "values", "errors", "regions"}
        if not isinstance(data, Mapping) or data.get("format") != _FORMAT:
            raise InputError("not a compensation table", allowed=f"format = {_FORMAT!r}")
        if set(data) != keys:
            odd = sorted(set(data) ^ keys, key=str)
            raise InputError("keys are missing or unknown", found=odd, allowed=", ".join(sorted(keys)))
        arrays = {key: numbers(_with_nan(data[key]), key) for key in ("corners", "values", "errors")}
        if not isinstance(data["names"], list):
            raise InputError("a list of names is wanted", key="names", found=data["names"])
        return cls(**arrays, regions=data["regions"], names=tuple(data["names"]))

    def to_json(self, path: str | Path) -> None:
        """Write the table as JSON; the file is there as a whole or not at all."""
        write(path, json.dumps(self.to_dict(), allow_nan=False))

    def to_csv(self, path: str | Path) -> None:
        """Write the table as CSV, a row a triangle: `rho1_2` is rho_1 at corner 2, `amount_4` the amount at node 4."""
        text = io.StringIO()
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(_columns(self.names))
        for region, errors, corners, values in zip(
            self.regions.tolist(), self.errors.tolist(), self.corners, np.swapaxes(self.values, 1, 2), strict=True
        ):
            rows.writerow([region, *errors, *corners.ravel().tolist(), *values.ravel().tolist()])
        write(path, text.getvalue())

    @classmethod
    def read(cls, path: str | Path) -> Table:
        """Read what `to_json` (a name that ends in .json) or `to_csv` wrote, bit for bit.

        Raises
        ------
        InputError
            Naming the file, and what in it cannot be used.
        """
        try:
            text = Path(path).read_text(encoding="utf-8-sig")
        except (OSError, TypeError, ValueError) as reason:
            what = getattr(reason, "strerror", None) or str(reason)
            raise InputError(f"the file cannot be read: {what}", file=repr(str(path))) from reason
        try:
            if Path(path).suffix.lower() != ".json":
                return cls._from_csv(text)
            try:
                data = json.loads(text)
            except (ValueError, RecursionError) as reason:
                raise InputError(f"not JSON: {str(reason)[:100]}") from reason
            return cls.from_dict(data)
        except InputError as wrong:
            raise wrong.within(file=path) from wrong

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


def _without_nan(values: Array) -> Any:
    """Return nested lists with None for nan."""
    if not np.isnan(values).any():
        return values.tolist()
    plain = values.astype(object)
    plain[np.isnan(values)] = None
    return plain.tolist()


def _with_nan(values: Any) -> Any:
    """Return nested lists with nan for None."""
    if isinstance(values, list):
        return [_with_nan(value) for value in values]
    return math.nan if values is None else values
