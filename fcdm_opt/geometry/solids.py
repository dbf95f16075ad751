"""Whole solids: which points lie inside one, whether two overlap or one lies inside the other, and how deep.

A body is kept as convex parts, which may be its surface alone, or some of it. Here it is the solid that counts: its
closed surface, or the union of its parts where these were given by hand. Signs are exact for the floats given; depths
are not, and converge as meshes are refined.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array, Flags, Ints, distinct_rows, exactly, groups_of
from fcdm_opt.geometry.bodies import Body, cached_of_whole
from fcdm_opt.geometry.crossings import overlapping
from fcdm_opt.geometry.facets import surface_distance
from fcdm_opt.geometry.measures import cross, dots, norms, unit_normals
from fcdm_opt.geometry.polygons import components, distances, fans, offsets_from
from fcdm_opt.tolerances import DEFAULT

EPSILON = float(np.finfo(float).eps) / 2.0
TURN_ERROR, HEIGHT_ERROR = (3.0 + 16.0 * EPSILON) * EPSILON, (7.0 + 56.0 * EPSILON) * EPSILON
"""Of determinants of two and three rows of differences, relative to the sum of their products (Shewchuk 1997)."""
STARTS, STEPS, ROWS = 5, 40, 1000  # of the search for the deepest point: places, steps from each, rows of a program
FEW = 64  # points for each of which all triangles are looked at
REACHED = 0.9  # of the way to the surface, by convex bodies inside
PIECES = 8  # of what two solids have in common, in which it starts
FACETS = 100  # of the thickest of these, on which it starts
DEEP = 0.9  # of the greatest depth, at points that may stand for it: well inside, not on an end face
CORNERS = 16  # of what two solids have in common that it may start from, of each piece
REMEMBERED = 64  # depths
SHEET = 1e-6  # share of its surface from which on what is flush on a piece in common is told from rounding


class SolidSurface:
    """The closed surface of a body's solid, from its seed."""

    points: Array  # each once, (n, 3)
    triangles: Ints  # rows of the points, counter-clockwise seen from outside, (t, 3)
    closed: bool  # whether that is one surface, of the solid; else it is that of each part, and these may overlap

    def __init__(self, body: Body) -> None:
        if body.triangles:
            points, triangles = body.vertices, np.array([own for face in body.triangles for own in face], np.int64)
        else:
            starts = np.cumsum([0, *(len(part.vertices) for part in body.parts)]).tolist()
            points = np.concatenate([part.vertices for part in body.parts])
            triangles = np.concatenate(
                [start + fans(part.loops) for start, part in zip(starts, body.parts, strict=False)]
            )
        self.closed = bool(body.triangles) or len(body.parts) == 1
        used, rows = np.unique(triangles, return_inverse=True)
        self.points, self.triangles = points[used] - body.seed, rows.reshape(-1, 3)
        if body.triangles:
            first, same = distinct_rows(self.points)
            self.points, self.triangles = self.points[first], same[self.triangles]

    @cached_property
    def shells(self) -> list[Ints]:
        """Rows of the points of each closed surface that no edge connects with another."""
        return groups_of(components(np.concatenate([self.triangles[:, :2], self.triangles[:, 1:]]), len(self.points)))


solid_surface = cached_of_whole(SolidSurface)  # of the solid that a body, or some of its parts, stands for
_DEPTHS: dict[bytes, float] = {}  # by the triangles where they are


class Located(NamedTuple):
    """Where points are against closed surfaces."""

    # how often the surfaces wind round each point: of one on a surface as if it were moved by an infinitesimal, (m,)
    winding: Ints
    on: Flags  # whether it is on one of the triangles, (m,)

    @property
    def inside(self) -> Flags:
        """Whether points are inside, not on the surface."""
        return (self.winding > 0) & ~self.on


def located(points: Array, corners: Array, boxes: tuple[Array, Array] | None = None) -> Located:
    """Return where points, (m, 3), are against closed surfaces of triangles, (t, 3, 3): exact for these floats.

    By the triangles above each point, with their orientations; where a point is in line with an edge it counts as moved
    by an infinitesimal along x, and a smaller one along y, so that neighbouring triangles agree on it. `boxes` are the
    least and largest coordinates of each triangle, where they are known.
    """
    winding, on = np.zeros(len(points), np.int64), np.zeros(len(points), bool)
    low, high = boxes or (corners.min(axis=1), corners.max(axis=1))
    for m, t in _above(points, low, high):
        turns = np.stack([_turns(points[m], corners[t], k) for k in range(3)])
        sides = np.where((turns[0] == turns[1]) & (turns[1] == turns[2]), turns[0], 0)
        heights = _heights(points[m], corners[t])
        np.add.at(winding, m, np.where(sides * heights > 0, sides, 0))
        flat = np.flatnonzero((heights == 0) & ((low[t] <= points[m]) & (points[m] <= high[t])).all(axis=1))
        held = [_holds(corners[t[k]], points[m[k]]) for k in flat.tolist()]
        on[m[flat[held]]] = True
    return Located(winding, on)


def _above(points: Array, low: Array, high: Array) -> Iterator[tuple[Ints, Ints]]:
    """Yield pairs of points and boxes that are above them, or hold them."""
    if len(points) <= FEW:
        for m, point in enumerate(points):
            t = np.flatnonzero(high[:, 2] >= point[2])
            for axis in (0, 1):
                t = t[(low[t, axis] <= point[axis]) & (point[axis] <= high[t, axis])]
            yield np.full(len(t), m), t
        return
    top = np.maximum(points, [-np.inf, -np.inf, high[:, 2].max()])
    groups = np.repeat([0, 1], [len(points), len(low)])
    for one, two in overlapping(np.concatenate([points, low]), np.concatenate([top, high]), groups):
        yield np.minimum(one, two), np.maximum(one, two) - len(points)


def _turns(points: Array, corners: Array, k: int) -> Ints:
    """Return on which side of a triangle's side k, seen from above, points are: 1 on its left, -1 on its right."""
    # 0 where the side is seen as a point
    a, b = corners[:, k], corners[:, (k + 1) % 3]
    u, v = a - points, b - points
    left, right = u[:, 0] * v[:, 1], u[:, 1] * v[:, 0]
    exact = (u[:, 0] == 0) | (v[:, 1] == 0) | (u[:, 1] == 0) | (v[:, 0] == 0)  # a difference of 0 is no rounding
    sign = np.sign(left - right).astype(np.int64)
    for i in np.flatnonzero(~exact & (np.abs(left - right) <= TURN_ERROR * (np.abs(left) + np.abs(right)))).tolist():
        p, q = exactly(np.array([a[i, :2], b[i, :2]])) - exactly(points[i, :2])
        sign[i] = _sign(p[0] * q[1] - p[1] * q[0])
    moved = np.where(a[:, 1] != b[:, 1], np.sign(a[:, 1] - b[:, 1]), np.sign(b[:, 0] - a[:, 0]))
    return np.where(sign == 0, moved.astype(np.int64), sign)


def _heights(points: Array, corners: Array) -> Ints:
    """Return on which side of triangles' planes points are: 1 behind them, 0 on them."""
    a, b, c = (corners - points[:, None]).transpose(1, 0, 2)
    terms = a * cross(b, c)
    size = np.abs(a) * (np.abs(b[:, [1, 2, 0]] * c[:, [2, 0, 1]]) + np.abs(b[:, [2, 0, 1]] * c[:, [1, 2, 0]]))
    value = terms.sum(axis=1)
    sign = np.sign(value).astype(np.int64)
    for i in np.flatnonzero(np.abs(value) <= HEIGHT_ERROR * size.sum(axis=1)).tolist():
        p, q, r = exactly(corners[i]) - exactly(points[i])
        sign[i] = _sign(p @ cross(q, r))
    return sign


def _holds(corners: Array, point: Array) -> bool:
    """Tell whether a triangle holds a point of its plane, rim included."""
    ends = exactly(corners)
    sides = np.roll(ends, -1, axis=0) - ends
    return bool((cross(sides, exactly(point) - ends) @ cross(sides[0], sides[1]) >= 0).all())


def _sign(x: Fraction) -> int:
    return (x > 0) - (x < 0)


def kept_as_surface(*bodies: Body) -> bool:
    """Tell whether parts of some bodies leave out what is inside their solids, or some of the parts are left out."""
    # then parts that keep apart do not tell that the solids do, see `PlacedSolids.gap`
    return any(body.is_surface or body.full_body is not None for body in bodies)


def contains(body: Body, points: Array) -> Flags:
    """Tell which points, (m, 3) in the frame of the drawing, lie inside the solid: exactly, and not on its surface."""
    own = solid_surface(body)
    found = located(np.asarray(points, dtype=np.float64), (own.points + body.seed)[own.triangles])
    return found.inside if own.closed else np.asarray(found.winding > 0)


def convex_inside(body: Body, point: Array) -> Body:
    """Return a convex body with the same seed inside a body's solid, about a point inside it in the drawing's frame."""
    # of all that is nearer to the point than planes across the shortest ways from there to the surface, which it does
    # not reach: what touches the solid from outside does not touch this
    from scipy.spatial import HalfspaceIntersection

    own = solid_surface(body)
    corners, place = own.points[own.triangles], point - body.seed
    offsets = -offsets_from(place[None], corners)[:, 0]
    order, planes = np.argsort(norms(offsets), kind="stable"), list[Array]()
    ahead = np.ones(len(order), bool)
    for k in order.tolist():
        if ahead[k]:
            far = float(norms(offsets[k]))
            plane = np.append(offsets[k] / far, -float(offsets[k] @ place) / far - REACHED * far)
            planes.append(plane)
            ahead &= (corners @ plane[:3]).min(axis=1) < -plane[3]
    inside = HalfspaceIntersection(np.array(planes), place).intersections
    return Body.convex(np.unique(inside, axis=0) + body.seed, seed=body.seed, name=f"inside {body.name}")


def depth_as_drawn(movable: Body, static: Body, rho: Sequence[float] | Array) -> float:
    """Return how deep two solids overlap as drawn, at a scale pair, see `PlacedSolids.depth`."""
    return PlacedSolids(movable, static, np.asarray(rho, np.float64), np.eye(4)).depth


class PlacedSolids:
    """Two whole solids at a scale pair, (2,), and pose change of body 1, (4, 4), in lengths from the static seed.

    Of bodies of which some parts are given the whole solids are looked at.
    """

    complete: bool  # whether the bodies given have all of their parts
    size: float  # largest extent of either

    def __init__(self, movable: Body, static: Body, rho: Array, transform: Array) -> None:
        self._own = tuple(map(solid_surface, (movable, static)))
        self.complete = movable.full_body is static.full_body is None
        away = transform[:3, :3] @ movable.seed + transform[:3, 3] - static.seed
        self._points = rho[0] * self._own[0].points @ transform[:3, :3].T + away, rho[1] * self._own[1].points
        self._corners = tuple(points[own.triangles] for own, points in zip(self._own, self._points, strict=True))
        self._boxes = tuple((own.min(axis=1), own.max(axis=1)) for own in self._corners)
        self.size = max(float(np.ptp(points, axis=0).max()) for points in self._points)

    @cached_property
    def distance(self) -> float:
        """Distance of the two surfaces, by the collision library; 0 where they meet."""
        (one, points), (two, others) = zip(self._own, self._points, strict=True)
        return surface_distance(points, one.triangles, others, two.triangles)

    @cached_property
    def nested(self) -> int:
        """How many closed surfaces of either solid lie inside the other: corners of theirs do, none lies outside."""
        # of solids whose surfaces do not cross it tells whether they overlap
        return sum(self._holds(1 - one, one, rows) for one in range(2) for rows in self._own[one].shells)

    def _holds(self, which: int, other: int, rows: Ints) -> bool:
        """Tell whether a closed surface of the other solid, rows of its points, lies inside a solid."""
        low, high, points = self._points[which].min(axis=0), self._points[which].max(axis=0), self._points[other][rows]
        if not ((points >= low) & (points <= high)).all():
            return False
        where = self._located(which, points[:1])
        if where.winding[0] <= 0 and not where.on[0]:
            return False
        where = self._located(which, points)
        if where.on.all():
            own = np.isin(self._own[other].triangles[:, 0], rows)
            where = self._located(which, self._corners[other][own].mean(axis=1))
        return bool(where.inside.any()) and not ((where.winding <= 0) & ~where.on).any()

    def within(self, which: int) -> Array | None:
        """Return a point of a closed surface of the other solid that lies inside solid 0 or 1, deep in it; or None."""
        # the middle of its box, or that of its corners which is the furthest from the surface around
        other = 1 - which
        found = (self._points[other][rows] for rows in self._own[other].shells if self._holds(which, other, rows))
        points = next(found, None)
        if points is None:
            return None
        points = points[:: max(1, len(points) // FEW)]
        middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
        if self.inside(which, middle[None])[0]:
            return np.asarray(middle)
        return np.asarray(points[np.argmax([self._distance(which, own)[0] for own in points])])

    def gap(self, of_parts: float, slack: float = 0.0) -> float:
        """Return the signed gap of the solids: minus their `depth` where they overlap, never more than their distance.

        - `of_parts`: that of the convex parts of the bodies given, which have all of their surface, or some of it.
        - `slack`: length up to which solids whose surfaces meet are taken to touch.
        """
        if of_parts < -slack or self.nested:
            return -max(self.depth, -of_parts, np.finfo(float).tiny)
        if self.complete:  # parts that keep apart, or touch, have all of the surfaces
            return of_parts
        if self.distance > slack:
            return min(of_parts, self.distance)
        return -self.depth if self.depth > max(slack, DEFAULT.tie * self.size) else min(of_parts, 0.0)

    def inside(self, which: int, points: Array) -> Flags:
        """Tell which points lie inside solid 0, the movable one, or 1, the static one."""
        found = self._located(which, points)
        return found.inside if self._own[which].closed else np.asarray(found.winding > 0)

    def _located(self, which: int, points: Array) -> Located:
        return located(points, self._corners[which], self._boxes[which])

    @cached_property
    def depth(self) -> float:
        """How deep the solids overlap, 0 where they do not: no shorter shift takes them apart."""
        # the largest sum of a point's depths in both, each its distance from the surface: that of two balls, one in
        # either, that overlap most. It is the least shift itself where plane faces or balls meet, and is less where
        # edges cross, or where only a way round leads out. It is asked of the same places again and again
        placed = hashlib.sha256(len(self._corners[0]).to_bytes(8) + b"".join(own.tobytes() for own in self._corners))
        key = placed.digest()
        if key not in _DEPTHS:
            found = self._greatest_depth()
            if pacing.over():  # it may be a bound of it alone
                return found
            if len(_DEPTHS) >= REMEMBERED:
                del _DEPTHS[next(iter(_DEPTHS))]
            _DEPTHS[key] = found
        return _DEPTHS[key]

    def _greatest_depth(self) -> float:
        pieces = self._deepest_pieces()
        thickest = sorted(pieces, key=_thickness)[-STARTS:]
        facets = [(corners[rows].mean(axis=1), len(rows)) for corners, rows in thickest]
        on_facets = [middles[:: -(-count // FACETS)] for middles, count in facets]
        starts = np.concatenate([self._within_common(pieces), *on_facets, *_between(thickest[-1:])])
        values, best = self._depths(starts), 0.0
        for k in np.argsort(-values, kind="stable")[:STARTS].tolist():
            if pacing.over():  # each bounds it, the more the nearer
                return max(best, float(values.max()))
            best = max(best, self._deepest(starts[k], float(values[k])))
        return best

    def common(self) -> list[tuple[Array, Ints]]:
        """Return the surface of each piece of what the solids have in common: corners, and triangles of these.

        Nothing as thin as what rounding makes of faces flush on one another, also where that joins pieces.
        """
        from manifold3d import Manifold, Mesh64, OpType

        solids = []
        for own, points in zip(self._own, self._points, strict=True):
            rows = [own.triangles]
            if not own.closed:
                rows = [own.triangles[np.isin(own.triangles[:, 0], shell)] for shell in own.shells]
            pieces = []
            for some in rows:
                used, faces = np.unique(some, return_inverse=True)
                mesh = Mesh64(np.ascontiguousarray(points[used]), faces.reshape(-1, 3).astype(np.uint64))
                pieces.append(Manifold(mesh))
            solids.append(Manifold.batch_boolean(pieces, OpType.Add) if len(pieces) > 1 else pieces[0])
        pieces = []
        for piece in (solids[0] ^ solids[1]).decompose():
            thick = piece
            for step in DEFAULT.tie * self.size * np.eye(3):  # some axis leads out of a thin sheet
                thick = thick ^ thick.translate(step)
            with_sheets = thick.surface_area() < (1.0 - SHEET) * piece.surface_area()
            pieces += thick.decompose() if with_sheets else [piece]
        meshes = [piece.to_mesh64() for piece in pieces]
        return [(np.asarray(own.vert_properties)[:, :3], np.asarray(own.tri_verts, np.int64)) for own in meshes]

    def _deepest_pieces(self) -> list[tuple[Array, Ints]]:
        """Return the pieces of what the solids have in common that are deepest in their middle, or the thickest."""
        # round faces that hardly differ have hundreds in common
        pieces = self.common()
        if len(pieces) <= PIECES:
            return pieces
        depths = self._depths(np.array([corners.mean(axis=0) for corners, _ in pieces]))
        thick = np.array([_thickness(piece) for piece in pieces])
        kept = {*np.argsort(-depths)[:PIECES].tolist(), *np.argsort(-thick)[:PIECES].tolist()}
        return [pieces[k] for k in sorted(kept)]

    def _within_common(self, pieces: list[tuple[Array, Ints]]) -> Array:
        """Return points of these pieces, (m, 3): in the middle of each, and towards its corners."""
        found = []
        for corners, _ in pieces:
            middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
            some = corners[:: max(1, len(corners) // CORNERS)]
            found += [middle, corners.mean(axis=0), *((middle + some) / 2.0), *some]
        return np.array(found).reshape(-1, 3)

    def deep_in(self, pieces: list[tuple[Array, Ints]]) -> Array:
        """Return the nearest points of both surfaces, (2, 3), to a point deep in what the solids have in common."""
        pieces = sorted(pieces, key=_thickness)[-STARTS:]
        every = np.concatenate([self._within_common(pieces), *_between(pieces)])
        for _ in range(2):  # then half way between such, too: on no end face
            depths = self._depths(every)
            as_deep = every[depths >= DEEP * depths.max()]
            some = as_deep[:: -(-len(as_deep) // CORNERS)]
            every = np.concatenate([as_deep, (some[:, None] + some).reshape(-1, 3) / 2.0])
        inner = [min(self._distance(which, point)[0] for which in range(2)) for point in as_deep]
        point = as_deep[int(np.argmax(inner))]
        near = (self._near(which, point, 0.0) for which in range(2))
        return np.array([point - offsets_from(point[None], corners[far.argmin()])[0] for corners, far in near])

    def _depths(self, points: Array) -> Array:
        """Return the sum of points' depths in both solids, (m,); minus infinity outside of one."""
        total = np.zeros(len(points))
        for which in range(2):
            found = self._located(which, points)
            total[(found.winding <= 0) & ~found.on] = -np.inf
            for k in np.flatnonzero(np.isfinite(total) & ~found.on):
                total[k] += self._distance(which, points[k])[0]
        return total

    def _near(self, which: int, point: Array, more: float) -> tuple[Array, Array]:
        """Return the triangles of a surface as near to a point as the nearest and a length, and how far they are."""
        (nearest, least), slack = self._distance(which, point), DEFAULT.weld * self.size
        near = self._corners[which][least <= (nearest + more + slack) ** 2]
        far = distances(point[None], near)[:, 0]
        kept = far <= nearest + more + slack
        return near[kept], far[kept]

    def _distance(self, which: int, point: Array) -> tuple[float, Array]:
        """Return how far a point is from a surface, and the squares of how far from its triangles it is at least."""
        corners, (low, high) = self._corners[which], self._boxes[which]
        away = np.maximum(np.maximum(low - point, point - high), 0.0)
        least, most = dots(away, away), dots(own := corners[:, 0] - point, own).min()
        near = corners[least <= (np.sqrt(most) + DEFAULT.weld * self.size) ** 2]
        return float(distances(point[None], near).min()), least

    def _deepest(self, point: Array, value: float) -> float:
        """Return the largest sum of depths that steps from a point lead to."""
        # a distance from a convex set is nowhere below its tangent planes, so a linear program in these gives a step
        # that is worth what it says, but for triangles further away than it knows of
        from scipy.optimize import linprog

        step = self.size / 4.0
        for _ in range(STEPS):
            rows, levels = [], []
            for which in range(2):
                near, far = self._near(which, point, 2.0 * step)
                order = np.argsort(far, kind="stable")[:ROWS]
                slopes = _slopes(point, near[order], far[order])
                own = np.zeros((len(order), 2))
                own[:, which] = 1.0
                rows.append(np.hstack([-slopes, own]))
                levels.append(far[order])
            bounds = [(-step, step)] * 3 + [(None, None)] * 2
            best = linprog([0, 0, 0, -1, -1], np.vstack(rows), np.concatenate(levels), bounds=bounds, method="highs")
            gained = -np.inf
            if best.status == 0:
                there = point + best.x[:3]
                gained = float(self._depths(there[None])[0]) - value
            if gained > 0.0:
                point, value = there, value + gained
            if not gained > DEFAULT.snap * value:
                step /= 4.0
            if step <= DEFAULT.snap * self.size:
                break
        return value


def _between(pieces: list[tuple[Array, Ints]]) -> list[Array]:
    """Return points half way between the largest triangles of pieces: of a bent one the middle may be outside."""
    found = []
    for corners, rows in pieces:
        triangles = corners[rows]
        large = np.argsort(-norms(cross(*np.diff(triangles, axis=1).swapaxes(0, 1))))[:CORNERS]
        middles, (one, two) = triangles[large].mean(axis=1), np.triu_indices(len(large))
        found.append((middles[one] + middles[two]) / 2.0)
    return found


def _thickness(piece: tuple[Array, Ints]) -> float:
    """Return the volume of a closed surface by its area."""
    triangles = piece[0][piece[1]]
    across = cross(*np.diff(triangles, axis=1).swapaxes(0, 1))
    return float(abs((triangles[:, 0] * across).sum()) / norms(across).sum())


def _slopes(point: Array, corners: Array, far: Array) -> Array:
    """Return how the distances of triangles change with a point, (k, 3): of those it is on, from the inside."""
    away = offsets_from(point[None], corners)[:, 0]
    slopes = away / np.maximum(norms(away), np.finfo(float).tiny)[:, None]
    on = far <= DEFAULT.weld * np.abs(corners - point).max(axis=(1, 2))
    slopes[on] = -unit_normals(corners[on])
    return slopes
