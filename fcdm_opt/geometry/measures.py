"""Vectors, many at a time, and what triangles enclose: volume, centroid, and how often they wind round a point."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.geometry.arrays import SMALLEST, Array
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from flint import fmpq

FEW_DIGITS = 6  # of a number of a drawing, which single precision moves in the seventh
FIRMLY = 1e3  # times as much as lengths over the size, sums of shares count
BLOCK = 1 << 18  # pairs of points and triangles looked at together


def cross(u: Array, v: Array) -> Array:
    """Return cross products of vectors, (..., 3); quicker than numpy's."""
    a, b, c, x, y, z = u[..., 0], u[..., 1], u[..., 2], v[..., 0], v[..., 1], v[..., 2]
    # of objects the type is told: numpy would make machine integers of what is left of them, and round or overflow
    products = np.empty(np.broadcast_shapes(u.shape, v.shape), np.result_type(u, v))
    products[..., 0], products[..., 1], products[..., 2] = b * z - c * y, c * x - a * z, a * y - b * x
    return products


def following(corners: Array) -> Array:
    """Return for each corner of polygons, (..., n, 3), the next one; quicker than numpy's roll."""
    return np.concatenate([corners[..., 1:, :], corners[..., :1, :]], axis=-2)


def norms(vectors: Array) -> Array:
    """Return the lengths of vectors, (..., 3)."""
    return np.sqrt(dots(vectors, vectors))


def dots(u: Array, v: Array) -> Array:
    """Return dot products of vectors, (..., 3); quicker than a sum along so short an axis."""
    return u[..., 0] * v[..., 0] + u[..., 1] * v[..., 1] + u[..., 2] * v[..., 2]


def units(vectors: Array) -> Array:
    """Return vectors, (..., 3), at unit length; zero stays zero."""
    return vectors / np.maximum(norms(vectors), SMALLEST)[..., None]


def unit_normals(polygons: Array) -> Array:
    """Return unit normals of (nearly) planar polygons, (..., n, 3), by Newell's sum about their first vertices."""
    spokes = polygons[..., 1:, :] - polygons[..., :1, :]
    total = cross(spokes[..., :-1, :], spokes[..., 1:, :]).sum(axis=-2)
    return total / norms(total)[..., None]


def least_vector(rows: Array, levels: Array) -> Array | None:
    """Return the shortest x, (k,), with rows x >= levels, rows (m, k); None where there is none."""
    # by the dual, least squares with multipliers that are not negative (Lawson and Hanson, 1974, chapter 23)
    from scipy.optimize import nnls

    scale = max(float(np.abs(levels).max()), SMALLEST)
    system, goal = np.vstack([rows.T, levels / scale]), np.append(np.zeros(rows.shape[1]), 1.0)
    rest = system @ nnls(system, goal)[0] - goal
    if np.linalg.norm(rest) <= DEFAULT.nominal or not rest[-1] < 0.0:
        return None
    return np.asarray(-scale * rest[:-1] / rest[-1])


def nearest_mixture(points: Array) -> Array:
    """Return shares of points, (n, 3), not negative, with sum 1, that mix the point of their hull nearest to zero."""
    # by least squares with shares that are not negative, whose sum comes near 1: over it, they are those
    from scipy.optimize import nnls

    shares = nnls(np.vstack([points.T, np.ones(len(points))]), np.array([0.0, 0.0, 0.0, 1.0]))[0]
    return np.asarray(shares / shares.sum())


def nearest_points(X: Array, Y: Array) -> tuple[Array, Array]:
    """Return points of the hulls of X and Y, the same where they have one in common and else about the nearest."""
    from scipy.optimize import nnls

    # shares of both, not negative and each with sum 1, which counts more, that give the same point
    middle = (X.mean(axis=0) + Y.mean(axis=0)) / 2.0
    scale = max(np.abs(X - middle).max(), np.abs(Y - middle).max(), SMALLEST)
    ones = np.repeat([[FIRMLY, 0.0], [0.0, FIRMLY]], [len(X), len(Y)], axis=0).T
    system = np.vstack([np.column_stack([(X - middle).T, (middle - Y).T]) / scale, ones])
    shares, _ = nnls(system, np.array([0.0, 0.0, 0.0, FIRMLY, FIRMLY]))
    one, two = shares[: len(X)], shares[len(X) :]
    return one @ X / one.sum(), two @ Y / two.sum()


def largest_ball(normals: Array, levels: Array) -> tuple[Array, float]:
    """Return middle and radius of the largest ball within half-spaces n . x <= level; -inf where there is none."""
    from scipy.optimize import linprog

    rows = np.column_stack([normals, np.ones(len(levels))])
    ball = linprog([0.0, 0.0, 0.0, -1.0], rows, levels, bounds=[(None, None)] * 4)
    return (ball.x[:3], float(ball.x[3])) if ball.status == 0 else (np.zeros(3), -np.inf)


def corners_within(normals: Array, levels: Array, near: float) -> Array | None:
    """Return the corners of half-spaces n . x <= level, (n, 3), some repeated; None where hardly a ball fits in."""
    # `near`: radius up to which one hardly does
    from scipy.spatial import HalfspaceIntersection, QhullError

    middle, radius = largest_ball(normals, levels)
    if not radius > near:
        return None
    try:
        return np.asarray(HalfspaceIntersection(np.column_stack([normals, -levels]), middle).intersections)
    except QhullError:
        return None


def volume_and_centroid(corners: Array) -> tuple[float, Array, float]:
    """Return volume, centroid and a bound of the volume's rounding, by signed tetrahedra about the mean corner.

    `corners` (t, 3, 3): corners of the triangles of a closed surface.
    """
    first = corners[0, 0]
    local = corners - first  # exact far from the origin, where a mean is not
    middle = local.mean(axis=(0, 1))
    a, b, c = (local - middle).transpose(1, 0, 2)
    volumes = (a * cross(b, c)).sum(axis=1) / 6
    volume = float(volumes.sum())
    rounding = 8 * float(np.finfo(float).eps) * float((norms(a) * norms(b) * norms(c)).sum())
    offset = volumes @ (a + b + c) / 4 / volume if volume else np.zeros(3)
    return volume, first + (middle + offset), rounding


def exact_volume(corners: Array) -> fmpq:
    """Return the volume that triangles, (t, 3, 3), enclose, exactly that of their float corners."""
    from flint import fmpq, fmpz

    least = int(np.frexp(corners[corners != 0])[1].min(initial=0)) - 53  # every entry is a multiple of 2 to this
    number = {x: fmpz(int(fmpq(*x.as_integer_ratio()) * fmpq(2) ** -least)) for x in np.unique(corners).tolist()}
    a, b, c = np.array([number[x] for x in corners.ravel().tolist()], dtype=object).reshape(-1, 3, 3).transpose(1, 0, 2)
    return fmpq((a * cross(b, c)).sum(), 6) * fmpq(2) ** (3 * least)


def winding_numbers(points: Array, corners: Array) -> Array:
    """Return how often triangles, (t, 3, 3), counter-clockwise seen from outside, wind round each point, (m,)."""
    # of a closed surface: 1 inside, 0 outside. By solid angles (van Oosterom and Strackee 1983), not reliable nearer to
    # a triangle than rounding
    total = np.zeros(len(points))
    step = max(1, BLOCK // max(1, len(points)))
    for start in range(0, len(corners), step):
        for first in range(0, len(points), BLOCK):
            own = slice(first, first + BLOCK)
            spokes = corners[None, start : start + step] - points[own, None, None]
            lengths = norms(spokes)
            a, b, c = spokes[:, :, 0], spokes[:, :, 1], spokes[:, :, 2]
            la, lb, lc = lengths[:, :, 0], lengths[:, :, 1], lengths[:, :, 2]
            bottom = la * lb * lc + dots(a, b) * lc + dots(b, c) * la + dots(c, a) * lb
            total[own] += np.arctan2(dots(a, cross(b, c)), bottom).sum(axis=1)
    return total / (2 * np.pi)


def short_decimals(values: Array, off: Any) -> Array:
    """Return numbers known to within `off` as the decimals of few digits that they may be, as 4.997 of a drawing."""
    places = FEW_DIGITS - 1 - np.floor(np.log10(np.maximum(np.abs(values), SMALLEST)))
    scale = 10.0 ** np.clip(places, 0.0, 3 * FEW_DIGITS)
    short = np.round(values * scale) / scale
    return np.where(np.abs(short - values) <= off, short, values)
