"""Array types, and read-only copies."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fcdm_opt.errors import InputError

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
LARGEST = 1e50  # of any coordinate: volumes stay finite
AXES: dict[str, tuple[float, ...]] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
AXES |= {f"-{name}": tuple(-u + 0.0 for u in axis) for name, axis in AXES.items()}
SMALLEST = 1e-50  # extent of a part: its volume stays above what floats can hold


def numbers(values: Any, key: str) -> Array:
    """Return an array of real numbers; raise `InputError` for anything else, and for magnitudes whose cube is lost."""
    try:
        given = [values, *values] if isinstance(values, list | tuple) else [values]
        if any(isinstance(x, np.ma.MaskedArray) and np.ma.is_masked(x) for x in given):
            raise TypeError  # what lies below a mask is no value
        raw = np.asarray(values)
        mixed = raw.dtype.kind == "O"
        if raw.dtype.kind not in "biufO" or (mixed and any(isinstance(x, str | bytes) for x in raw.flat)):
            raise TypeError  # text, complex numbers, dates
        with np.errstate(over="ignore"):  # wider floats become infinite
            array = np.array(raw, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as reason:
        raise InputError("expected a rectangular array of numbers", key=key, found=values) from reason
    largest = np.abs(array).max(initial=0.0)
    if not largest <= LARGEST:  # nan and infinities are looked for by those who know what they stand for
        largest = np.abs(array[np.isfinite(array)]).max(initial=0.0)
    if largest > LARGEST:
        raise InputError("a number too large to calculate with", key=key, found=float(largest), allowed=f"{LARGEST:g}")
    return array


def checked_corners(points: Array, key: str) -> Array:
    """Return the corners of a solid, (n, 3), as they are; raise `InputError` unless they can be some."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError("vertices must be an (n, 3) array", key=key, found=f"shape {points.shape}")
    if len(points) < 4:
        raise InputError("a solid needs at least 4 vertices", key=key, found=len(points))
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if bad.size:
        raise InputError(f"vertex {bad[0] + 1} is not finite", key=key, found=points[bad[0]].tolist())
    return points


def row_lists(lists: Any, count: int, key: str, noun: str, *, repeats: bool = False) -> list[list[int]]:
    """Return lists of rows of vertices, checked: of the `noun` "part" or "face"; raise `InputError` otherwise."""
    known = f"{noun}s are lists of rows of the vertices"
    try:
        every = list(lists)
    except TypeError as reason:
        raise InputError(f"expected lists of rows: {known}", key=f"{key}: {noun}s", found=lists) from reason
    found = []
    for k, own in enumerate(every):
        where, place = f"{key}: {noun} {k + 1}", dict[int, int]()
        try:
            rows = list(own if repeats else islice(own, count + 1))  # of distinct rows longer lists repeat one
        except TypeError as reason:
            raise InputError(f"expected a list of rows: {known}", key=where, found=own) from reason
        for entry, row in enumerate(rows):
            if isinstance(row, bool | np.bool) or not isinstance(row, int | np.integer) or not 0 <= row < count:
                what = f"entry {entry + 1} is not a row of the vertices"
                raise InputError(what, key=where, found=row, allowed=f"0 to {count - 1}")
            if (first := place.setdefault(int(row), entry)) != entry and not repeats:
                what = f"a row appears twice, as entries {first + 1} and {entry + 1}"
                raise InputError(what, key=where, found=row)
        found.append(list(map(int, rows)))
    return found


def distinct_rows(rows: Array | Ints) -> tuple[Ints, Ints]:
    """Return the first place of each distinct row, (n, k), in order of the rows, and which of these each row equals."""
    # far faster than numpy's unique rows, which it compares byte by byte
    if not len(rows):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    order = np.lexsort(rows.T[::-1])
    new = np.r_[True, (rows[order[1:]] != rows[order[:-1]]).any(axis=1)]
    same = np.empty(len(rows), np.int64)
    same[order] = np.cumsum(new) - 1
    return order[new], same


def equal_pairs(keys: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Yield the places of all two equal keys, (n,) or rows (n, k), block by block, the earlier place first."""
    order = np.lexsort(keys.T[::-1]) if keys.ndim > 1 else np.argsort(keys, kind="stable")
    ordered = np.atleast_2d(keys.T).T[order]
    for step in range(1, len(order)):  # the next place of a key, the one after that, ...
        same = np.flatnonzero((ordered[step:] == ordered[:-step]).all(axis=1))
        if not same.size:
            return
        yield order[same], order[same + step]


def groups_of(labels: Ints) -> list[Ints]:
    """Return the places of each label, 0 to the largest."""
    return np.split(np.argsort(labels, kind="stable"), np.cumsum(np.bincount(labels))[:-1])


def crossed(u: Array, v: Array) -> Array:
    """Return the cross product of two vectors, (3,), in a tenth of the time that numpy's takes."""
    (a, b, c), (x, y, z) = u.tolist(), v.tolist()
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


def exactly(values: Array) -> NDArray[np.object_]:
    """Return floats as the fractions that they are."""
    return np.vectorize(Fraction, otypes=[object])(values)


def frozen(values: Any, dtype: Any = np.float64) -> NDArray[Any]:
    """Return a read-only C-contiguous copy."""
    array = np.array(values, dtype=dtype, order="C")
    array.flags.writeable = False
    return array
