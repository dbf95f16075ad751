"""Which triangle of a table a size pair is in."""

from __future__ import annotations

import math

import numpy as np

from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.tolerances import DEFAULT

_BUCKETS = 16  # a triangle: most points then have one triangle to look at, or two


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
        self.rounding = float(DEFAULT.point * corners.max())
        self._low, self._high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        self._side = math.ceil(math.sqrt(_BUCKETS * len(corners)))
        first, (p, q) = corners[:, 0], np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 0)
        twice = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
        longest = np.sqrt(np.max([(p**2).sum(1), (q**2).sum(1), ((q - p) ** 2).sum(1)], axis=0))
        height = np.abs(twice) / longest
        # first corner, and the slopes of the second and third barycentric coordinate along both sizes; by columns
        self._frames = *first.T.copy(), *np.array([q[:, 1], -q[:, 0], -p[:, 1], p[:, 0]]) / twice
        # how far below zero a coordinate may be for a point that is in the triangle but for rounding, and on a seam
        self.seam = float(DEFAULT.line * corners.max())
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
