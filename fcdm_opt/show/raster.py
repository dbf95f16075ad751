"""Solid bodies as pixels: nearest surface first, shaded by how it faces the light; which lines are in front of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fcdm_opt.geometry.arrays import Array, Flags

LIGHT = np.array([-0.45, 0.6, 0.66])
"""Where the light comes from: right, up and towards the reader, a unit vector nearly."""

DULL = 0.5
"""Of its colour that a face keeps that the light does not reach."""

STEP = 2.0
"""Pixels between two places of a line that are looked at."""

GRAZING = 1e-6
"""A face whose normal is this near the page's plane is a line."""

TINT = 0.62
"""How much of white is in the colour of a surface."""


class Raster:
    """A picture of surfaces seen in parallel projection.

    Parameters
    ----------
    page : (3, 2) array
        The page's directions, right and up.
    low, high : (2,) arrays
        Corners of the area shown, in lengths along these.
    width : int
        Pixels across.
    """

    def __init__(self, page: Array, low: Array, high: Array, width: int) -> None:
        self._page, self._low = page, low
        self._toward = np.cross(page[:, 0], page[:, 1])
        self._scale = width / float(high[0] - low[0])
        height = max(1, round(float(high[1] - low[1]) * self._scale))
        self._depth = np.full((height, width), -np.inf)
        self._owner = np.full((height, width), -1, dtype=np.int8)
        self._colour = np.ones((height, width, 3))

    def fill(self, polygons: Sequence[Array], colour: str, owner: int) -> None:
        """Draw convex polygons, (k, 3) each, where nothing is nearer."""
        from matplotlib.colors import to_rgb

        tint = TINT + (1.0 - TINT) * np.array(to_rgb(colour))
        for polygon in polygons:
            normal = np.cross(polygon[1:-1] - polygon[0], polygon[2:] - polygon[0]).sum(axis=0)
            long = float(np.linalg.norm(normal))
            facing = float(normal @ self._toward)
            if abs(facing) <= GRAZING * long:
                continue
            normal = normal * (np.sign(facing) / long)
            flat = (polygon @ self._page - self._low) * self._scale
            (left, bottom), (right, top) = np.floor(flat.min(axis=0)), np.ceil(flat.max(axis=0)) + 1
            columns = np.arange(max(0, int(left)), min(self._depth.shape[1], int(right)))
            rows = np.arange(max(0, int(bottom)), min(self._depth.shape[0], int(top)))
            if not len(columns) or not len(rows):
                continue
            x, y = columns + 0.5, (rows + 0.5)[:, None]
            inside = np.ones((len(rows), len(columns)), dtype=bool)
            ahead = np.roll(flat, -1, axis=0) - flat
            turn = np.sign(np.sum(flat[:, 0] * np.roll(flat, -1, axis=0)[:, 1] - flat[:, 1] * np.roll(flat[:, 0], -1)))
            for (u, v), (du, dv) in zip(flat, ahead, strict=True):
                inside &= turn * (du * (y - v) - dv * (x - u)) >= -0.5 * np.hypot(du, dv)
            slope = -(normal @ self._page) / (normal @ self._toward)
            start = polygon[0] @ self._toward
            depth = start + (slope[0] * (x - flat[0, 0]) + slope[1] * (y - flat[0, 1])) / self._scale
            place = np.ix_(rows, columns)
            nearer = inside & (depth > self._depth[place])
            shade = normal @ np.column_stack([self._page, self._toward]) @ LIGHT
            lit = tint * (DULL + (1.0 - DULL) * max(float(shade), 0.0))
            for plane, value in ((self._depth, depth[nearer]), (self._owner, owner), (self._colour, lit)):
                part = plane[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
                part[nearer] = value

    def visible(self, ends: Array) -> list[Array]:
        """Return the pieces of straight lines (m, 2, 3) that no surface hides, on the page, (2, 2) each."""
        from scipy.ndimage import minimum_filter

        behind, found = minimum_filter(self._depth, 3), []
        height, width = self._depth.shape
        slack = 2.0 / self._scale
        for one, two in ends:
            flat = np.array([one, two]) @ self._page
            count = 2 + int(np.linalg.norm(flat[1] - flat[0]) * self._scale / STEP)
            shares = np.linspace(0.0, 1.0, count)[:, None]
            places = flat[0] + shares * (flat[1] - flat[0])
            depth = ((1.0 - shares) * one + shares * two) @ self._toward
            pixel = np.floor((places - self._low) * self._scale).astype(int)
            within = ((pixel >= 0) & (pixel < (width, height))).all(axis=1)
            pixel = np.clip(pixel, 0, (width - 1, height - 1))
            seen = ~within | (depth >= behind[pixel[:, 1], pixel[:, 0]] - slack)
            starts = np.flatnonzero(seen & ~np.r_[False, seen[:-1]])
            stops = np.flatnonzero(seen & ~np.r_[seen[1:], False])
            found += [places[[a, b]] for a, b in zip(starts, stops, strict=True) if b > a]
        return found

    def free(self, line: Array) -> bool:
        """Tell whether no body is behind a straight line on the page, (2, 2)."""
        places = line[0] + np.linspace(0.0, 1.0, 40)[:, None] * (line[1] - line[0])
        pixel = np.floor((places - self._low) * self._scale).astype(int)
        height, width = self._depth.shape
        inside = ((pixel >= 0) & (pixel < (width, height))).all(axis=1)
        return bool(inside.all()) and bool((self._owner[pixel[:, 1], pixel[:, 0]] < 0).all())

    @property
    def covered(self) -> Flags:
        """Which pixels have a surface, (height, width), from the lowest row up."""
        return self._owner >= 0

    @property
    def image(self) -> Array:
        """Colours, (height, width, 4), from the lowest row up; nothing where there is no body, outlines darker."""
        owner = self._owner
        edge = np.zeros(owner.shape, dtype=bool)
        edge[:, 1:] |= owner[:, 1:] != owner[:, :-1]
        edge[1:] |= owner[1:] != owner[:-1]
        shown = np.where(edge[:, :, None], 0.35 * self._colour, self._colour)
        return np.dstack([shown, ((owner >= 0) | edge).astype(float)])
