"""The judge's look at round faces: on points of these, by equations of its own, and finer where they come nearest.

What is solved for bodies of facets must hold for the faces that these stand for. Points are taken on the triangles of
either body near the other, brought onto the surface that a triangle stands for, and measured against the surfaces of
the other body; about the nearest the grid is made finer until it tells no more.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from fcdm_opt.geometry.arrays import Array, Flags
from fcdm_opt.geometry.crossings import overlapping_between
from fcdm_opt.geometry.patches import TrueFaces
from fcdm_opt.geometry.tessellation import Swept

GRID, MANY = 6, 48  # points along a side of a triangle, half as many of many triangles
FINER, TIMES = 0.35, 24  # of a grid about the nearest points, and how often
ROUNDING = 1e-12  # of areas
SLIVER = 1e-9  # of the square of its longest side: the area of a triangle that is none
FEWEST = 6  # times at least; then until it tells no more
SLACK = 1e-9  # of the band: nearer to a rim a point is on it
SMOOTH = 0.99  # cosine of the angle of two faces from which on one goes on in the other
KEPT = 6  # points about which it is made finer, of each two surfaces


def gap_of_true_faces(
    faces: Sequence[TrueFaces],
    scales: Sequence[float] | Array,
    transform: Array,
    band: float,
    without: Collection[tuple[int, int]] = (),
) -> float:
    """Return the gap of bodies on their true faces, minus their depth; infinite where it is more than the band.

    Parameters
    ----------
    faces : (TrueFaces, TrueFaces)
    scales : (2,) array
    transform : (4, 4) array
        Pose change of body 1.
    band : float
        Points further off a surface are not looked at: deeper ones are on the other side of a solid.
    without : collection of (int, int)
        Surfaces of body 1 and of body 2, by number in `true_faces`, that are not looked at together.
    """
    placed = [
        _There(own, float(scale), pose) for own, scale, pose in zip(faces, scales, (transform, np.eye(4)), strict=True)
    ]
    turned = [(j, i) for i, j in without]
    one, two = placed
    return -max(_deepest(one, two, band, without), _deepest(two, one, band, turned))


class _There:
    """A body's triangles and surfaces where they are."""

    def __init__(self, faces: TrueFaces, scale: float, pose: Array) -> None:
        self.owners, self.is_round = faces.owners, faces.is_round
        seed = faces.body.seed

        def there(points: Array) -> Array:
            return np.asarray((seed + scale * (points - seed)) @ pose[:3, :3].T + pose[:3, 3])

        self.corners = there(faces.corners)
        self.patches = [
            (
                own.surface._replace(
                    origin=there(own.surface.origin),
                    axis=pose[:3, :3] @ own.surface.axis,
                    ring=scale * own.surface.ring,
                    radius=scale * own.surface.radius,
                ),
                own.side,
            )
            for own in faces.patches
        ]

    def onto(self, k: int, points: Array) -> Array:
        """Return points brought onto a surface."""
        surface, _ = self.patches[k]
        if not self.is_round[k]:
            return points
        for _ in range(3):
            height, directions = _height(surface, points)
            points = points - height[:, None] * directions
        return points

    def cut_off(self, points: Array, own: int, band: Array, least: Array, cosine: float = np.inf) -> Flags:
        """Tell which points are before another face than their own by so much at least and at most: not of the face.

        Not those before faces to which the angle has no smaller cosine.
        """
        found, normals = np.zeros(len(points), bool), _height(self.patches[own][0], points)[1]
        for k in range(len(self.patches)):
            if k == own:
                continue
            surface, side = self.patches[k]
            height, directions = _height(surface, points)
            off = side * height
            sharp = np.abs(np.einsum("ni,ni->n", normals, directions)) < cosine
            rows = np.flatnonzero((off > least) & (off <= band) & sharp & ~found)
            feet = points[rows] - height[rows, None] * directions[rows]
            found[rows] = _over(feet, directions[rows], self.corners[self.owners == k])
        return found


def _height(surface: Swept, points: Array) -> tuple[Array, Array]:
    """Return how far points are off a surface, and the ways there: from the nearest point of its profile."""
    local = points - surface.origin
    z = local @ surface.axis
    radial = local - np.outer(z, surface.axis)
    r = np.sqrt(np.einsum("ni,ni->n", radial, radial))
    out = radial / np.where(r > 0.0, r, 1.0)[:, None]
    if surface.line is None:  # a circle of this radius about (ring, 0) in the half-plane of r and z
        extent = np.sqrt((r - surface.ring) ** 2 + z**2)
        safe = np.where(extent > 0.0, extent, 1.0)
        return extent - surface.radius, ((r - surface.ring) / safe)[:, None] * out + np.outer(z / safe, surface.axis)
    a, b = surface.line  # the line a r - b z = radius, a and b of length 1
    return a * r - b * z - surface.radius, a * out - b * surface.axis


def _deepest(own: _There, other: _There, band: float, without: Collection[tuple[int, int]]) -> float:
    """Return how deep points of one body lie in the other at most."""
    deepest = -np.inf
    low, high = own.corners.min(axis=1), own.corners.max(axis=1)
    for k in np.unique(other.owners).tolist():
        theirs = other.corners[other.owners == k]
        ends = theirs.reshape(-1, 3).min(axis=0) - band, theirs.reshape(-1, 3).max(axis=0) + band
        near = ((high >= ends[0]) & (low <= ends[1])).all(axis=1)
        for j in np.unique(own.owners[near]).tolist():
            if (j, k) in without:
                continue
            triangles = own.corners[near & (own.owners == j)]
            deepest = max(deepest, _of_two(own, j, triangles, other, k, theirs, band))
    return deepest


def _of_two(own: _There, j: int, triangles: Array, other: _There, k: int, theirs: Array, band: float) -> float:
    grid = GRID if len(triangles) <= MANY else GRID // 2
    steps = np.arange(grid) / (grid - 1)
    shares = np.array([(1.0 - u - v, u, v) for u in steps for v in steps if u + v <= 1.0 + 1e-9])
    surface, side = other.patches[k]
    which, shares = np.repeat(np.arange(len(triangles)), len(shares)), np.tile(shares, (len(triangles), 1))
    deepest, width = -np.inf, 1.0
    for turn in range(TIMES):
        points = own.onto(j, np.einsum("nk,nki->ni", shares, triangles[which]))
        height, directions = _height(surface, points)
        depth = -side * height
        feet, slack = points - height[:, None] * directions, SLACK * band
        inside = np.abs(height) <= band
        rows = np.flatnonzero(inside)
        inside[rows] = _over(feet[rows], directions[rows], theirs)
        for there, face, places, far in ((own, j, points, band), (other, k, feet, band), (other, k, points, depth)):
            rows = np.flatnonzero(inside)
            most = np.broadcast_to(far, inside.shape)[rows]
            least = slack - most if far is depth else np.full(len(rows), slack)  # behind the nearest face alone
            smooth = SMOOTH if there.is_round[face] and far is band else np.inf  # it goes on in such a face
            inside[rows] = ~there.cut_off(places[rows], face, most, least, smooth)
        if not inside.any():
            break
        before, deepest = deepest, max(deepest, float(depth[inside].max()))
        if turn >= FEWEST and deepest - before <= 1e-12 * float(np.abs(points).max()):
            break
        best = np.flatnonzero(inside)[np.argsort(-depth[inside])[:KEPT]]
        width *= FINER
        moves = width * np.array([(u, v) for u in (-1.0, 0.0, 1.0) for v in (-1.0, 0.0, 1.0)])
        moves = np.column_stack([-moves.sum(axis=1), moves])
        shares = np.clip(shares[best][:, None] + moves, 0.0, 1.0).reshape(-1, 3)
        shares /= shares.sum(axis=1, keepdims=True)
        which = np.repeat(which[best], len(moves))
    return deepest


def _over(feet: Array, directions: Array, triangles: Array) -> Flags:
    """Tell which points of a surface have one of its triangles below or above them."""
    found = np.zeros(len(feet), bool)
    sides = triangles - np.roll(triangles, 1, axis=1)
    area, longest = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1), np.einsum("tki,tki->tk", sides, sides)
    triangles = triangles[area > SLIVER * longest.max(axis=1)]  # of others their neighbours tell as much
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    room = 0.25 * (high - low).max(axis=1, keepdims=True)  # a surface leaves its triangle by less
    if not len(feet):
        return found
    i, t = overlapping_between(feet, feet, low - room, high + room).T
    arms = triangles[t] - feet[i, None]
    turns = np.cross(arms, np.roll(arms, -1, axis=1))
    sides = np.einsum("nki,ni->nk", turns, directions[i])
    sides[np.abs(sides) <= ROUNDING * np.einsum("nki,nki->nk", arms, arms).max(axis=1, keepdims=True)] = 0.0
    met = (sides >= 0.0).all(axis=1) | (sides <= 0.0).all(axis=1)
    found[i[met]] = True
    return found
