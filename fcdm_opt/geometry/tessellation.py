"""How far triangles leave the planes, cylinders, cones, spheres and tori of a CAD file that they stand for.

Each of these surfaces is swept about an axis by a line, or by a circle in its plane: its distance follows from how far
a point is from the axis, and along it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Self

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.measures import cross, norms

TESSELLATED = "triangles leave its curved faces"  # so begins the note of a body
CUTS = 8  # of a side of a triangle on a torus, at whose corners it is looked at
_TINY = float(np.finfo(float).tiny)


class Swept(NamedTuple):
    """A surface of revolution, as the zeros of its signed distance; length units of the file's reader.

    Attributes
    ----------
    origin, axis : (3,) array
        A point of the axis and its unit direction.
    line : (float, float) or None
        Swept by the line `line[0]` u - `line[1]` h = `radius`, where u is the distance from the axis and h that along
        it: a cylinder (1, 0), a cone (cos, sin), a plane (0, -1). None: by a circle.
    ring, radius : float
        By the circle of this radius about (`ring`, 0): a torus, or a sphere with `ring` 0.
    """

    origin: Array
    axis: Array
    line: tuple[float, float] | None
    ring: float
    radius: float

    @property
    def flat(self) -> bool:
        """Whether it is a plane."""
        return self.line == (0.0, -1.0)

    @classmethod
    def of(cls, primitive: Any) -> Self:
        """Return a primitive of cascadio as such a surface."""
        given = vars(primitive)
        angle = given.get("semi_angle")
        line = (0.0, -1.0) if "normal" in given else (1.0, 0.0) if angle is None else (math.cos(angle), math.sin(angle))
        return cls(
            np.array(next(given[key] for key in ("origin", "apex", "center") if key in given)),
            np.array(given.get("normal", given.get("axis", (0.0, 0.0, 1.0)))),
            None if "center" in given else line,
            given.get("major_radius", 0.0),
            given.get("minor_radius", given.get("radius", 0.0)),
        )

    def misses(self, points: Array) -> tuple[Array, Array]:
        """Return how far points (n, 3) are off the surface, away from axis or tube positive, and unit normals there."""
        along, across, far = self._about(points)
        outward = across / np.maximum(far, _TINY)[:, None]
        if self.line is not None:
            c, s = self.line
            return c * far - s * along - self.radius, c * outward - s * self.axis
        tube = far - self.ring
        long = np.hypot(tube, along)
        ways = tube[:, None] * outward + along[:, None] * self.axis
        return long - self.radius, ways / np.maximum(long, _TINY)[:, None]

    def _about(self, points: Array) -> tuple[Array, Array, Array]:
        """Return how far points are along the axis, where across it, and how far across."""
        local = points - self.origin
        along = local @ self.axis
        across = local - along[:, None] * self.axis
        return along, across, norms(across)

    def left_by(self, corners: Array) -> tuple[float, float]:
        """Return how far triangles (m, 3, 3), wound outwards, stick out of a solid of that face, and fall short of it.

        Exact for cylinders, cones and spheres: the distance is convex along a triangle, so that it is largest at a
        corner, and smallest on a side (a straight line of the surface that is parallel to the triangle crosses its
        sides), of a sphere at the point nearest to the centre. Tori are looked at in a grid of points: half the bend
        of the distance along a side is four times what it reaches there, and between the points, by CUTS^2 less, a
        third of it may hide.
        """
        one, two, three = corners.transpose(1, 0, 2)
        points, hidden = corners.reshape(-1, 3), 0.0
        if self.line is not None:
            steps = (np.roll(corners, -1, axis=1) - corners).reshape(-1, 3)
            _, start, _ = self._about(points)
            rise, way, long = self._about(steps + self.origin)
            c, s = self.line
            square = np.maximum(long**2, _TINY)
            nearest = -(start * way).sum(axis=1) / square
            aside, slope = norms(start + nearest[:, None] * way), s * rise
            steep = np.sqrt(np.maximum(((c * long) ** 2 - slope**2) * square, _TINY))
            share = np.clip(nearest + slope * aside / steep, 0.0, 1.0)
            points = np.concatenate([points, points + share[:, None] * steps])
        elif not self.ring:
            from trimesh.triangles import closest_point

            points = np.concatenate([points, closest_point(corners, np.broadcast_to(self.origin, one.shape))])
        else:
            shares = np.array([(i, j, CUTS - i - j) for i in range(CUTS + 1) for j in range(CUTS + 1 - i)]) / CUTS
            points, hidden = (shares @ corners).reshape(-1, 3), 4.0 / (3.0 * CUTS**2)
        off, _ = self.misses(points)
        slack = hidden * float(np.abs(off).max())
        low, high = float(off.min()) - slack, float(off.max()) + slack
        middle = self.misses(corners.mean(axis=1))[1]
        turned = float((cross(two - one, three - one) * middle).sum()) < 0.0  # the material is on the other side
        low, high = (-high, -low) if turned else (low, high)
        return max(high, 0.0), max(-low, 0.0)
