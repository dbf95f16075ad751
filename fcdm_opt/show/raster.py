"""Solid bodies as pixels: nearest surface first, shaded by how it faces the light; which lines are in front of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fcdm_opt.compiling import kernel
from fcdm_opt.geometry.arrays import Array, Flags

LIGHT = np.array([-0.45, 0.6, 0.66])
"""Where the light comes from: right, up and towards the reader, a unit vector nearly."""

DEEP = 1.9
"""How many times as far from white the colour of a face is that the light does not reach: deeper, as no grey is."""

STEP = 2.0  # pixels between two places of a line that are looked at
ROOMY = 0.95  # of the greatest distance to an outline: places so far from it are as good as any
GRAZING = 1e-6  # a face whose normal is this near the page's plane is a line
TINT = 0.62  # how much of white is in the colour of a surface


class Raster:
    """A picture of surfaces seen in parallel projection, `width` pixels across.

    `page`, (3, 2), has the page's directions, right and up; `low` and `high`, (2,), are corners of the area shown, in
    lengths along these.
    """

    def __init__(self, page: Array, low: Array, high: Array, width: int) -> None:
        self._page, self._low = page, low
        self._toward = np.cross(page[:, 0], page[:, 1])
        self._scale = width / float(high[0] - low[0])
        height = max(1, round(float(high[1] - low[1]) * self._scale))
        self._depth = np.full((height, width), -np.inf)
        self._owner = np.full((height, width), -1, dtype=np.int32)
        self._colour = np.ones((height, width, 3))

    def empty(self) -> Raster:
        """Return an empty picture of the same area."""
        height, width = self._depth.shape
        return Raster(self._page, self._low, self._low + np.array([width, height]) * self.pixel, width)

    @property
    def pixel(self) -> float:
        """How long a pixel is."""
        return 1.0 / self._scale

    def fill(self, polygons: Sequence[Array], colour: str, owner: int, *, white: float = TINT) -> None:
        """Draw convex polygons, (k, 3) each, where nothing is nearer, their colour mixed with so much white."""
        from matplotlib.colors import to_rgb

        if not polygons:
            return
        starts = np.cumsum([0, *map(len, polygons)])
        corners, tint = np.concatenate(polygons), white + (1.0 - white) * np.array(to_rgb(colour))
        frame = np.column_stack([self._page, self._toward])
        placed = corners @ frame
        placed[:, :2] = (placed[:, :2] - self._low) * self._scale
        fill_pixels(placed, starts, self._scale, tint, owner, self._depth, self._owner, self._colour)

    def visible(self, ends: Array | Sequence[Array]) -> list[Array]:
        """Return the pieces of straight lines (m, 2, 3) that no surface hides, on the page, (2, 2) each."""
        from scipy.ndimage import minimum_filter

        behind, found = minimum_filter(self._depth, 3), []
        for one, two in ends:
            flat = np.array([one, two]) @ self._page
            count = 2 + int(np.linalg.norm(flat[1] - flat[0]) * self._scale / STEP)
            points = one + np.linspace(0.0, 1.0, count)[:, None] * (two - one)
            places, seen = points @ self._page, self._seen(points, behind)
            starts = np.flatnonzero(seen & ~np.r_[False, seen[:-1]])
            stops = np.flatnonzero(seen & ~np.r_[seen[1:], False])
            found += [places[[a, b]] for a, b in zip(starts, stops, strict=True) if b > a]
        return found

    def share_seen(self, points: Sequence[Array]) -> float:
        """Return the share of points that no surface hides."""
        return float(np.mean(self.seen(points)))

    def seen(self, points: Sequence[Array]) -> Flags:
        """Tell which of some points no surface hides."""
        from scipy.ndimage import minimum_filter

        return self._seen(np.array(points), minimum_filter(self._depth, 3))

    def _seen(self, points: Array, behind: Array) -> Flags:
        """Tell which points (m, 3) no surface hides, by depths to compare with."""
        height, width = self._depth.shape
        pixel = np.floor((points @ self._page - self._low) * self._scale).astype(int)
        outside = ((pixel < 0) | (pixel >= (width, height))).any(axis=1)
        pixel = np.clip(pixel, 0, (width - 1, height - 1))
        nearest = behind[pixel[:, 1], pixel[:, 0]]
        return outside | np.asarray(points @ self._toward >= nearest - 2.0 / self._scale)

    def free(self, line: Array) -> bool:
        """Tell whether no body is behind a straight line on the page, (2, 2)."""
        places = line[0] + np.linspace(0.0, 1.0, 40)[:, None] * (line[1] - line[0])
        pixel = np.floor((places - self._low) * self._scale).astype(int)
        height, width = self._depth.shape
        inside = ((pixel >= 0) & (pixel < (width, height))).all(axis=1)
        return bool(inside.all()) and bool((self._owner[pixel[:, 1], pixel[:, 0]] < 0).all())

    def roomiest(self) -> dict[int, tuple[Array, float]]:
        """Return for each owner that is seen a place on the page far from where it ends, and the farthest there is.

        Of all places that are nearly as far from there, as along a strip, the most central one.
        """
        from scipy.ndimage import distance_transform_edt, find_objects

        found = {}
        for owner, window in enumerate(find_objects(self._owner + 1)):
            if window is not None:
                room = distance_transform_edt(np.pad(self._owner[window] == owner, 1))[1:-1, 1:-1]
                far = np.argwhere(room >= ROOMY * room.max())
                middle = np.argwhere(room > 0.0).mean(axis=0)
                row, column = far[np.linalg.norm(far - middle, axis=1).argmin()]
                pixel = np.array([window[1].start + column, window[0].start + row]) + 0.5
                found[owner] = self._low + pixel / self._scale, float(room.max()) / self._scale
        return found

    @property
    def covered(self) -> Flags:
        """Which pixels have a surface, (height, width), from the lowest row up."""
        return self._owner >= 0

    @property
    def image(self) -> NDArray[np.uint8]:
        """Colours 0 to 255, (height, width, 4), from the lowest row up; nothing without a body."""
        shown = np.empty((*self._owner.shape, 4), np.uint8)
        shown[..., :3] = 255.0 * self._colour + 0.5
        shown[..., 3] = 255 * self.covered
        return shown


@kernel
def fill_pixels(corners, starts, scale, tint, owner, depths, owners, colours):
    """Draw convex polygons where nothing is nearer: fill in `depths`, `owners` and `colours` of the pixels.

    Corners are in pixels, right and up, and in lengths towards the reader.
    """
    for k in range(len(starts) - 1):
        polygon = corners[starts[k] : starts[k + 1]]
        count, low, high = len(polygon), np.full(2, np.inf), np.full(2, -np.inf)
        nx, ny, nz = 0.0, 0.0, 0.0  # twice the area's vector
        for m in range(count):
            for axis in range(2):
                low[axis] = min(low[axis], polygon[m, axis])
                high[axis] = max(high[axis], polygon[m, axis])
            if 0 < m < count - 1:
                u, v = polygon[m] - polygon[0], polygon[m + 1] - polygon[0]
                nx += (u[1] * v[2] - u[2] * v[1]) / scale
                ny += (u[2] * v[0] - u[0] * v[2]) / scale
                nz += (u[0] * v[1] - u[1] * v[0]) / scale**2
        long = np.sqrt(nx * nx + ny * ny + nz * nz)
        if not abs(nz) > GRAZING * long:
            continue
        turn = 1.0 if nz > 0.0 else -1.0
        shade = turn * (nx * LIGHT[0] + ny * LIGHT[1] + nz * LIGHT[2]) / long
        deep = DEEP + (1.0 - DEEP) * max(shade, 0.0)
        for row in range(max(0, int(np.floor(low[1]))), min(depths.shape[0], int(np.ceil(high[1])) + 1)):
            for column in range(max(0, int(np.floor(low[0]))), min(depths.shape[1], int(np.ceil(high[0])) + 1)):
                x, y, inside = column + 0.5, row + 0.5, True
                for m in range(count):
                    a, b = polygon[m], polygon[(m + 1) % count]
                    du, dv = b[0] - a[0], b[1] - a[1]
                    inside = inside and turn * (du * (y - a[1]) - dv * (x - a[0])) >= -0.5 * np.sqrt(du * du + dv * dv)
                if not inside:
                    continue
                depth = polygon[0, 2] - (nx * (x - polygon[0, 0]) + ny * (y - polygon[0, 1])) / (nz * scale)
                if depth > depths[row, column]:
                    depths[row, column], owners[row, column] = depth, owner
                    for part in range(3):
                        colours[row, column, part] = max(0.0, 1.0 - (1.0 - tint[part]) * deep)
