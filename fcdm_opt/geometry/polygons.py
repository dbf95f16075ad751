"""Planar polygons: their sides, cut by planes, what they hold, and triangles of any of them, without new corners.

Lengths here are in the mesh's own unit; `slack` is the length below which its points count as one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.geometry.measures import cross, dots, following, norms, unit_normals, units
from fcdm_opt.tolerances import DEFAULT

Polygon = tuple[int, ...]
BLOCK = 256  # planes that are looked at together
TILT = 1e-2  # radians: how far the plane of a polygon may be from that which it lies in, unless it is slim
ROUNDING = 64 * float(np.finfo(float).eps)  # of a middle's height above a plane, relative to the coordinates


def by_size(polygons: Sequence[Polygon] | Sequence[Ints]) -> Iterator[tuple[Ints, Ints]]:
    """Yield the places of the polygons with 3 corners, with 4, ... and their corners, (m,) and (m, k)."""
    sizes = np.fromiter(map(len, polygons), np.int64, len(polygons))
    for size in np.unique(sizes):
        places = np.flatnonzero(sizes == size)
        yield places, np.array([polygons[k] for k in places.tolist()], np.int64)


def normals_of(points: Array, polygons: Sequence[Polygon]) -> Array:
    """Return the unit normals of polygons, (k, 3): rows of the points."""
    normals = np.empty((len(polygons), 3))
    for places, corners in by_size(polygons):
        normals[places] = unit_normals(points[corners])
    return normals


def widths(corners: Array) -> Array:
    """Return how far polygons, (m, k, 3), reach from the line through two far corners of theirs."""
    spokes = corners - corners[:, :1]
    lengths = np.sqrt((spokes**2).sum(axis=2))
    far = lengths.argmax(axis=1)
    rows = np.arange(len(corners))
    along = spokes[rows, far] / np.maximum(lengths[rows, far], np.finfo(float).tiny)[:, None]
    return np.sqrt((np.cross(spokes, along[:, None]) ** 2).sum(axis=2)).max(axis=1)


def between(points: Array, ends: tuple[int, int], rows: Ints, slack: float) -> list[int]:
    """Return which of some rows of points lie on the segment from one point to another, its ends not, in order."""
    origin, end = points[list(ends)]
    length = float(norms(end - origin))
    along, spokes = (end - origin) / length, points[rows] - origin
    steps = spokes @ along
    on = (norms(spokes - steps[:, None] * along) <= slack) & (rows != ends[0]) & (rows != ends[1])
    on &= (steps > slack / 2) & (steps < length - slack / 2)
    return rows[on][np.argsort(steps[on], kind="stable")].tolist()


def clipped(polygon: Array, heights: Array) -> Array:
    """Return what of a convex polygon, (m, 3), has no negative heights over a plane, (m,); of rationals too."""
    kept = []
    for k, height in enumerate(heights):
        if height * heights[k - 1] < 0:
            kept.append(polygon[k] + (polygon[k - 1] - polygon[k]) * (height / (height - heights[k - 1])))
        if height >= 0:
            kept.append(polygon[k])
    return np.array(kept) if kept else polygon[:0]


def uncovered(polygon: Array, solids: Iterable[tuple[Array, Array]], slack: float) -> list[Array]:
    """Return what of a convex polygon, a segment or a point lies in none of some convex solids, in pieces of its kind.

    `solids`: outward normals, (k, 3), and levels, (k,), of the planes of each; off it by no more than a slack is in.
    """
    pieces = [polygon]
    for normals, levels in solids:
        rest = list[Array]()
        for within in pieces:
            for n, level in zip(normals, levels, strict=True):
                heights = within @ n - level
                if len(within) and heights.max() > slack:
                    rest.append(clipped(within, heights))
                    within = clipped(within, -heights)
        pieces = rest
    return pieces


def inside(polygon: Array, loop: Array, normal: Array, slack: float = 0.0) -> Array:
    """Return what of a convex polygon lies in another one of its plane, counter-clockwise about the normal."""
    for base, inward in zip(loop, units(cross(normal, following(loop) - loop)), strict=True):
        polygon = clipped(polygon, (polygon - base) @ inward + slack)
    return polygon


def area(polygon: Array) -> float:
    """Return the area of a planar polygon, (m, 3); 0 of none."""
    spokes = polygon[1:] - polygon[:1]
    return float(norms(cross(spokes[:-1], spokes[1:]).sum(axis=0))) / 2.0


def hold(polygons: Array, normals: Array, points: Array, slack: float) -> Flags:
    """Tell which convex polygons, (k, c, 3), counter-clockwise about normals, hold points of their planes, (m, k)."""
    inward = units(cross(normals[:, None], following(polygons) - polygons))
    return (((points[:, None, None] - polygons) * inward).sum(axis=3) >= -slack).all(axis=2)


def offsets_from(points: Array, polygons: Array) -> Array:
    """Return the vectors to points, (..., k, 3), from the nearest of triangles or segments, (..., 3 or 2, 3)."""
    corners = polygons[..., None, :, :]
    along = following(corners) - corners
    spokes = points[..., None, :] - corners
    share = dots(spokes, along) / np.maximum(dots(along, along), np.finfo(float).tiny)
    off = spokes - np.clip(share, 0, 1)[..., None] * along
    rim = np.take_along_axis(off, dots(off, off).argmin(axis=-1)[..., None, None], axis=-2)[..., 0, :]
    normal = cross(along[..., 0, :], along[..., 1, :])
    square = dots(normal, normal)
    broad = square > (DEFAULT.nominal * dots(along, along).max(axis=-1)) ** 2  # of slivers the rim tells as much
    above = broad & (dots(cross(normal[..., None, :], along), spokes).min(axis=-1) >= 0)
    height = dots(spokes[..., 0, :], normal) / np.where(broad, square, 1.0)
    return np.where(above[..., None], height[..., None] * normal, rim)


def distances(points: Array, polygons: Array) -> Array:
    """Return the distances of points, (..., k, 3), from triangles or segments, (..., 3 or 2, 3), (..., k)."""
    return norms(offsets_from(points, polygons))


def coplanar(
    points: Array, polygons: Sequence[Polygon] | Sequence[Ints], normals: Array, levels: Array, slack: float
) -> list[Ints]:
    """Return groups of polygons, each within `slack` of the plane of its first one; take the best known first."""
    from scipy.spatial import cKDTree

    if not polygons:
        return []
    counts = np.array([len(own) for own in polygons])
    middles = np.add.reduceat(points[np.concatenate(polygons)], np.cumsum(counts) - counts) / counts[:, None]
    size = float(np.abs(points).max())
    wide = slack + ROUNDING * size
    # the plane of a polygon that is not slim differs little from each that it lies in, so that a tree finds it
    slim = np.empty(len(polygons), bool)
    for places, corners in by_size(polygons):
        slim[places] = TILT * widths(points[corners]) <= 4.0 * wide
    planes, broad, slim = np.column_stack([normals, levels / size]), np.flatnonzero(~slim), np.flatnonzero(slim)
    tree = cKDTree(np.concatenate([planes[broad], -planes[broad]]))
    free, groups = np.ones(len(polygons), bool), []
    for first in range(0, len(polygons), BLOCK):
        block = first + np.flatnonzero(free[first : first + BLOCK])
        parallel = tree.query_ball_point(planes[block], 3.0 * TILT)
        near = np.abs(middles[slim] @ normals[block].T - levels[block]) <= wide
        for k, rows, others in zip(block.tolist(), parallel, near.T, strict=True):
            if not free[k]:
                continue
            own = np.unique(np.concatenate([[k], broad[np.array(rows, np.int64) % len(broad)], slim[others]]))
            own = own[free[own] & ((np.abs(middles[own] @ normals[k] - levels[k]) <= wide) | (own == k))]
            if len(own) > 1:
                chosen = [polygons[row] for row in own.tolist()]
                heights = np.abs(points[np.concatenate(chosen)] @ normals[k] - levels[k])
                tops = np.maximum.reduceat(heights, np.cumsum([0, *map(len, chosen)])[:-1])
                own = own[(tops <= slack) | (own == k)]
            free[own] = False
            groups.append(own)
    return groups


def triangulated(
    points: Array, polygons: Sequence[Polygon], numbers: Sequence[int], slack: float, key: str
) -> tuple[Ints, Ints]:
    """Return triangles of polygons, (t, 3), and the polygon each is from, (t,).

    - `points` (n, 3).
    - `polygons`: rows of `points`; no polygon lies on one line.
    - `numbers`: how messages number the polygons.
    - `slack`: length up to which a polygon may be out of plane, and a corner in line.
    - `key`: names the body in messages.

    Raises `InputError` for a polygon that is not planar or meets itself; names it.
    """
    triangles, owners = [np.empty((0, 3), np.int64)], [np.empty(0, np.int64)]
    for places, corners in by_size(polygons):
        if corners.shape[1] == 3:
            triangles.append(corners)
            owners.append(places)
            continue
        local = points[corners] - points[corners[:, :1]]
        ahead = following(local) - local
        normals = cross(local, following(local)).sum(axis=1)
        lengths = np.sqrt((normals**2).sum(axis=1))
        normals /= np.maximum(lengths, np.finfo(float).tiny)[:, None]
        levels = (local * normals[:, None]).sum(axis=2)
        middle = (levels.max(axis=1) + levels.min(axis=1)) / 2
        off = np.abs(levels - middle[:, None])
        bent = np.flatnonzero(off.max(axis=1) > slack)
        if bent.size:
            first = int(bent[0])
            worst = int(off[first].argmax())
            what = f"the corners lie in no plane: vertex {corners[first, worst] + 1} misses their mean plane"
            found = float(off[first, worst])
            allowed = f"at most {slack:.3g}; give its triangles instead"
            raise InputError(what, key=f"{key}: face {numbers[places[first]] + 1}", found=found, allowed=allowed)
        turns = (np.cross(np.roll(ahead, 1, axis=1), ahead) * normals[:, None]).sum(axis=2)
        cosines = (np.roll(ahead, 1, axis=1) * ahead).sum(axis=2)
        chords = np.sqrt(((ahead + np.roll(ahead, 1, axis=1)) ** 2).sum(axis=2))
        once = np.arctan2(turns, cosines).sum(axis=1) < 3 * np.pi  # a star turns left everywhere, but twice round
        convex = (turns > slack * chords).all(axis=1) & once & (lengths > 0)
        size = corners.shape[1]
        fan = np.array([(0, k, k + 1) for k in range(1, size - 1)])
        triangles.append(corners[convex][:, fan].reshape(-1, 3))
        owners.append(np.repeat(places[convex], size - 2))
        for k in np.flatnonzero(~convex).tolist():
            ears = _ears(_in_plane(local[k], normals[k]), slack) if lengths[k] > slack**2 else None
            if ears is None:
                what = "the outline crosses or touches itself"
                loop = tuple(int(v) + 1 for v in corners[k])
                raise InputError(what, key=f"{key}: face {numbers[places[k]] + 1}", found=loop)
            triangles.append(corners[k][ears])
            owners.append(np.full(len(ears), places[k]))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(triangles)[order], owner[order]


def _in_plane(local: Array, normal: Array) -> Array:
    """Return plane coordinates, (k, 2): counter-clockwise about the normal stays so."""
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    first /= np.sqrt(first @ first)
    return local @ np.column_stack([first, np.cross(normal, first)])


def _cross2(u: Array, v: Array) -> Array:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _ears(flat: Array, slack: float) -> Ints | None:
    """Cut a polygon of the plane, counter-clockwise, into triangles of some height; None where it meets itself."""
    # an ear has no other corner inside or on it, so that corners in line with their neighbours get a triangle each side
    remaining = np.arange(len(flat))
    ears = []
    while len(remaining) > 3:
        u, v, w = flat[np.roll(remaining, 1)], flat[remaining], flat[np.roll(remaining, -1)]
        longest = np.sqrt(np.max([((x - y) ** 2).sum(axis=1) for x, y in ((u, v), (v, w), (w, u))], axis=0))
        height = _cross2(v - u, w - v) / np.maximum(longest, np.finfo(float).tiny)
        for k in np.argsort(-height, kind="stable").tolist():
            if height[k] <= slack:
                return None
            three = np.array([k - 1, k, (k + 1) % len(remaining)]) % len(remaining)
            if not _covered(flat[remaining[three]], np.delete(flat[remaining], three, axis=0), slack):
                ears.append(remaining[three])
                remaining = np.delete(remaining, k)
                break
        else:
            return None
    return np.array([*ears, remaining])


def _covered(triangle: Array, points: Array, slack: float) -> bool:
    """Tell whether one of the points lies in or on a triangle."""
    sides = np.roll(triangle, -1, axis=0) - triangle
    inward = _cross2(sides[:, None], points - triangle[:, None])
    return bool((inward >= -slack * np.sqrt((sides**2).sum(axis=1))[:, None]).all(axis=0).any())


@dataclass(frozen=True, eq=False)
class Sides:
    """Directed sides of polygons, three after another of triangles."""

    origin: Ints  # rows of the points, (s,)
    end: Ints
    face: Ints  # the polygon that each is of, (s,)
    edge: Ints  # the number of the edge that each runs along, one way or the other, (s,)

    @classmethod
    def of(cls, polygons: Sequence[Polygon]) -> Sides:
        """Return the sides of polygons, one after another."""
        sizes = np.fromiter(map(len, polygons), np.int64, len(polygons))
        return cls.around(np.fromiter((v for own in polygons for v in own), np.int64, int(sizes.sum())), sizes)

    @classmethod
    def around(cls, corners: Ints, sizes: Ints | int) -> Sides:
        """Return the sides of polygons from their corners, one polygon after another, and how many each has."""
        if isinstance(sizes, int):
            sizes = np.full(len(corners) // sizes, sizes)
        after, last = np.arange(1, len(corners) + 1), np.cumsum(sizes) - 1
        after[last] = last - sizes + 1
        end = corners[after]
        low, high = np.minimum(corners, end), np.maximum(corners, end)
        edge = np.unique(low * (corners.max(initial=0) + 1) + high, return_inverse=True)[1]
        return cls(corners, end, np.repeat(np.arange(len(sizes)), sizes), edge)

    @cached_property
    def counts(self) -> Ints:
        """How many sides each edge has."""
        return np.bincount(self.edge)

    @cached_property
    def pairs(self) -> Ints:
        """The two sides of each edge that has two, (m, 2): one that runs upwards first."""
        order = np.argsort(2 * self.edge + (self.origin > self.end), kind="stable")
        return order[self.counts[self.edge[order]] == 2].reshape(-1, 2)

    @property
    def links(self) -> Ints:
        """Each two sides of an edge that come one after the other, (m, 2), edge by edge."""
        order = np.argsort(self.edge, kind="stable")
        return np.column_stack([order[:-1], order[1:]])[np.diff(self.edge[order]) == 0]

    @property
    def odd(self) -> Ints:
        """Sides of edges that have an odd number of them: the surface ends there."""
        return np.flatnonzero(self.counts[self.edge] % 2)

    @property
    def unequal(self) -> Ints:
        """Sides of edges that are run along more often one way than the other."""
        return np.flatnonzero(np.bincount(self.edge, np.where(self.origin < self.end, 1, -1))[self.edge])

    def wedges(self, points: Array, normals: Array, edge: int, *, inwards: bool) -> list[tuple[int, int]]:
        """Return the pairs of polygons between which material at an edge lies, by their normals out of or into it."""
        # where they are not as many one way round as the other, each two after another
        own = np.flatnonzero(self.edge == edge)
        senses = np.where(self.origin[own] < self.end[own], 1.0, -1.0)
        along = units(points[self.end[own[0]]] - points[self.origin[own[0]]]) * senses[0]
        into = cross(normals[self.face[own]], senses[:, None] * along)
        angles = np.arctan2(cross(into[:1], into) @ along, into @ into[0])
        faces, up = self.face[own], (senses > 0) ^ inwards
        if 2 * up.sum() != len(own):
            return list(pairwise(faces.tolist()))
        turns = (angles[up] - angles[~up][:, None] - DEFAULT.sharp) % (2.0 * np.pi)  # material is ahead of those down
        pairs = list[tuple[int, int]]()
        for k in np.argsort(turns.min(axis=1), kind="stable").tolist():
            other = int(turns[k].argmin())
            turns[:, other] = np.inf
            pairs.append((int(faces[~up][k]), int(faces[up][other])))
        return pairs

    def sections(self, points: Array, pairs: Ints) -> tuple[Array, Array, Array]:
        """Return the section across edges of two triangles each: along them, and to corners opposite, (m, 3) each."""
        # rounding is of the order of the lengths there, however slim the triangles are. The first one of a pair is to
        # the left of the edge
        one, two = pairs.T
        opposite = self.origin.reshape(-1, 3)[:, [2, 0, 1]].ravel()
        base = points[self.origin[one]]
        along = units(points[self.end[one]] - base)
        c, d = (points[opposite[k]] - base for k in (one, two))
        c, d = (x - (x * along).sum(axis=1)[:, None] * along for x in (c, d))
        return along, c, d


def components(links: Ints, count: int) -> Ints:
    """Return the number of each one's connected component, by their first ones, from pairs that are linked, (k, 2)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    one, two = np.asarray(links, np.int64).reshape(-1, 2).T
    graph = coo_array((np.ones(len(one), np.int8), (one, two)), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64) if count else np.empty(0, np.int64)


def fans(loops: Sequence[Polygon]) -> Ints:
    """Return the triangles of convex polygons, fanned from their first corners, (t, 3)."""
    if all(len(loop) == 3 for loop in loops):
        return np.array(loops, np.int64).reshape(-1, 3)
    return np.array([(loop[0], *loop[k : k + 2]) for loop in loops for k in range(1, len(loop) - 1)])
