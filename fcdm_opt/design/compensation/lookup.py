"""Which triangle of a table a size pair is in."""

from __future__ import annotations

import math

import numpy as np

from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.tolerances import DEFAULT

_BUCKETS = 16  # a triangle: most points then have one triangle to look at, or two


class Locator:
    """Finds triangles by equal buckets of their box: each lists the triangles that meet it, in increasing order.

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
        # first corner, and the gradients of the second and third barycentric coordinate
        slopes = np.column_stack([q[:, 1], -q[:, 0], -p[:, 1], p[:, 0]]) / twice[:, None]
        self._frames = np.column_stack([first, slopes])
        # how far below zero a coordinate may be for a point that is in the triangle but for rounding, and on a seam
        self.seam = float(DEFAULT.line * corners.max())
        self._slack = self.rounding / height, self.seam / height
        self._fill(corners)

    def _fill(self, corners: Array) -> None:
        """List the triangles that meet each bucket."""
        width = (self._high - self._low) / self._side
        near = 2.0 * self.seam
        first, last = (
            np.clip((ends - self._low) // width, 0, self._side - 1).astype(np.int64)
            for ends in (corners.min(axis=1) - near, corners.max(axis=1) + near)
        )
        spans = last - first + 1
        counts = spans.prod(axis=1)
        triangle = np.repeat(np.arange(len(corners)), counts)
        place = np.arange(len(triangle)) - np.repeat(np.cumsum(counts) - counts, counts)
        row, column = first[triangle, 0] + place // spans[triangle, 1], first[triangle, 1] + place % spans[triangle, 1]
        weights = self._weights(triangle, self._low + (np.column_stack([row, column]) + 0.5) * width)
        second, third = np.moveaxis(self._frames[:, 2:].reshape(-1, 2, 2), 1, 0)
        reach = np.stack([np.abs(own) @ width / 2.0 for own in (second + third, second, third)], axis=1)
        meets = (weights + reach[triangle] >= -2.0 * self._slack[1][triangle, None]).all(axis=1)
        bucket, triangle = (row * self._side + column)[meets], triangle[meets]
        self._members = triangle[np.argsort(bucket, kind="stable")]
        self._starts = np.concatenate([[0], np.cumsum(np.bincount(bucket, minlength=self._side**2))])

    def _weights(self, triangle: Ints, points: Array) -> Array:
        """Return barycentric coordinates of points in triangles, (n, 3)."""
        frames = self._frames[triangle]
        dx, dy = points[:, 0] - frames[:, 0], points[:, 1] - frames[:, 1]
        s, t = frames[:, 2] * dx + frames[:, 3] * dy, frames[:, 4] * dx + frames[:, 5] * dy
        return np.stack([1.0 - s - t, s, t], axis=1)

    def locate(self, points: Array) -> tuple[Ints, Array]:
        """Return the first triangle that holds each point, and the point's barycentric coordinates there.

        Parameters
        ----------
        points : array (n, 2)

        Returns
        -------
        array of int (n,), array (n, 3)
            -1 and nan for what is in no triangle.
        """
        triangles, weights = np.full(len(points), -1), np.full((len(points), 3), np.nan)
        near = (points >= self._low - self.rounding) & (points <= self._high + self.rounding)  # nan is not
        inside = np.flatnonzero(near.all(axis=1))
        points = np.clip(points, self._low, self._high)
        cells = ((points[inside] - self._low) * (self._side / (self._high - self._low))).astype(np.int64)
        cells = np.minimum(cells, self._side - 1)
        bucket = cells[:, 0] * self._side + cells[:, 1]
        for slack in self._slack:
            left = np.flatnonzero(triangles[inside] < 0)
            place, end = self._starts[bucket[left]], self._starts[bucket[left] + 1]
            while len(left):
                full = place < end
                left, place, end = left[full], place[full], end[full]
                member = self._members[place]
                there = self._weights(member, points[inside[left]])
                hit = there.min(axis=1) >= -slack[member]
                triangles[inside[left[hit]]], weights[inside[left[hit]]] = member[hit], there[hit]
                left, place, end = left[~hit], place[~hit] + 1, end[~hit]
        return triangles, weights
