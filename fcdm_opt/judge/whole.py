"""The judge's look at whole surfaces: what was not modelled must neither touch nor lie inside the other body.

Of bodies whose parts are their surface, or of which only parts within reach are modelled, the judge takes part pairs
only where surfaces come near each other. That the rest is apart is told by the collision library on the surfaces as
they were drawn, scaled and moved, and by how often these wind round each other's corners.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facets import facets_of, near_facets, surface_distance
from fcdm_opt.geometry.measures import winding_numbers
from fcdm_opt.geometry.polygons import distances
from fcdm_opt.geometry.solids import solid_surface

CORNERS = 8  # of each closed surface that are looked at, besides those at its ends
FIRST, WIDER = 2e-6, 8.0  # of the size: how near surfaces are to be looked at in detail, and times as much if none are


class Outside(NamedTuple):
    """What was found on the whole surfaces: the least distance of what is not looked at closely, and what is inside."""

    distance: float
    inside: int  # closed surfaces of one body that lie inside the other


class WholeSurfaces:
    """The surfaces of two bodies, all that they have, at a scale pair, (2,), body 1 moved by a 4x4 transform."""

    def __init__(self, movable: Body, static: Body, rho: Array, transform: Array) -> None:
        self._bodies = movable, static
        self._own = facets_of(self._bodies[0]), facets_of(self._bodies[1])
        away = transform[:3, :3] @ movable.seed + transform[:3, 3] - static.seed
        self._places = (rho[0] * transform[:3, :3], away), (rho[1] * np.eye(3), np.zeros(3))
        self._points = [self._placed(k, own.points) for k, own in enumerate(self._own)]
        self._size = max(float(np.ptp(points, axis=0).max()) for points in self._points)

    def _placed(self, which: int, points: Array) -> Array:
        """Return points of a body, from its seed, where they are, from the static seed."""
        turn, shift = self._places[which]
        return np.asarray(points @ turn.T + shift)

    def looked_at(self) -> tuple[Body, Body, Outside]:
        """Return the bodies with only the parts whose surfaces are near each other, and what is known of the rest."""
        band = self._distance(slice(None), slice(None)) + FIRST * self._size
        while True:
            pacing.check()
            found = near_facets(self._own[0], self._points[0], self._own[1], self._points[1], band)
            pairs = found.parts[found.furthest(np.empty((0, 3)), 1.0, 0.0, 2.0 * band) <= band]
            near = [np.zeros(len(body.parts), bool) for body in self._bodies]
            for flags, own in zip(near, pairs.T, strict=True):
                flags[own] = True
            if near[0].any():
                apart = min(self._distance(~near[0], slice(None)), self._distance(near[0], ~near[1]))
                break
            band *= WIDER
        kept = []
        for body, own in zip(self._bodies, near, strict=True):
            rows = np.flatnonzero(own).tolist()
            kept.append(body if len(rows) == len(body.parts) else body.subset(rows))
        return kept[0], kept[1], Outside(apart, self._inside(0, 1) + self._inside(1, 0))

    def _distance(self, one: Any, two: Any) -> float:
        """Return the least distance of the surfaces of some parts; infinite without any."""
        chosen = []
        for body, own, parts in zip(self._bodies, self._own, (one, two), strict=True):
            flags = np.zeros(len(body.parts), bool)
            flags[parts] = True
            chosen.append(own.triangles[flags[own.owners]])
        return surface_distance(self._points[0], chosen[0], self._points[1], chosen[1])

    def _inside(self, one: int, two: int) -> int:
        """Return how many closed surfaces of one body lie inside the other."""
        inner, outer = (solid_surface(self._bodies[k]) for k in (one, two))
        if not outer.closed:
            return 0  # such parts fill the solid, and overlaps show
        found, near = 0, FIRST * self._size
        corners, solid = self._placed(one, inner.points), self._placed(two, outer.points)[outer.triangles]
        low, high = solid.min(axis=1) - near, solid.max(axis=1) + near
        box = low.min(axis=0), high.max(axis=0)
        for rows in inner.shells:
            pacing.check()
            ends = [rows[place(corners[rows], axis=0)] for place in (np.argmin, np.argmax)]
            points = corners[np.unique([*rows[:: max(1, len(rows) // CORNERS)], *ends[0], *ends[1]])]
            if 2 * np.count_nonzero(((points < box[0]) | (points > box[1])).any(axis=1)) > len(points):
                continue
            boxes = [solid[((low <= point) & (point <= high)).all(axis=1)] for point in points]
            on = [(distances(point[None, None], own) <= near).any() for point, own in zip(points, boxes, strict=True)]
            free = ~np.array(on)  # at corners that touch, rounding chooses
            found += bool(free.any()) and bool(np.median(winding_numbers(points[free], solid)) > 0.5)
        return found
