"""Whether multipliers show that no motion of a smaller amount brings two bodies to touch, or apart, as is asked.

Over a box of motions some lengths r_j(y), y = weights * q, are positive at rest, and one of them at least is not where
a motion does what is asked:

- a point of one body lies inside the other: it is to leave through one of the faces, r_j is how deep it is below each.
  Where two edges cross it moves along one of them, so that it comes out between the two faces beside the other.
- a direction keeps bodies apart that are to touch: a corner is to get through the plane, r_j is how far each pair is
  apart along it. It is kept fixed, turns with body 1, or is across an edge of each.

The least |y| with r_j <= 0 is bounded by the Lagrangian |y|^2 / 2 + l r_j with any l >= 0, see `lagrangian_bounds`.
Points and directions are looked for where bodies touch, or nearly; any do. All in intervals.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.kernels import E1E2, F1V2, V1F2
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.measures import nearest_points
from fcdm_opt.problem.problem import Problem
from fcdm_opt.proof.checker import Examiner, distances_from, face_planes
from fcdm_opt.proof.intervals import Interval, IntervalFunction
from fcdm_opt.tolerances import DEFAULT

NEAR = 1e-7  # of the size: corners as near to a plane of contact as this lie in it
FAR = 8.0  # squares of a box's size that a multiplier which excludes it is worth
MATCHED = 1e-3  # relative: how well forces at a contact are to balance a motion
STEPS = 6  # to the nearest motion at which a row is 0
MOST_CROSSED = 40_000  # pairs of edges of two parts, whose directions are looked at
ROUNDED = 1.0 - 2.0**-44  # more than the rounding of the sums taken in floats here

Pose = tuple[Array, Array, Array]


class _Contact(NamedTuple):
    """Along which direction two parts come apart first, see `conditions`, and what forces there balance the motion."""

    kind: int
    u: Array
    w: Array
    gap: float
    normal: Array  # unit, in the axes of body 2
    corners: tuple[Ints, Ints]  # numbers of the corners of both in its planes
    point: Array  # that the forces act at, about s_2
    missed: float  # how badly they balance, relative to the motion


class OneContact:
    """The rows of a problem without contacts that are restored together."""

    def __init__(self, problem: Problem) -> None:
        import casadi

        self.problem, self._scene = problem, Examiner(problem, None)
        kinematics = self._scene.kinematics
        (y, seeds, pose), self._seeds, self._smooth = kinematics.symbols, kinematics.seeds, kinematics.smooth
        k, R, d = len(problem.weights), casadi.reshape(pose[:9], 3, 3).T, pose[9:]
        self._pose = casadi.Function("pose", [y, seeds], [R, d, casadi.jacobian(pose, y)])
        self._rounding = DEFAULT.line * problem.size
        p = casadi.SX.sym("given", 16 + 2 * k)  # u, w, a point of each body, level; of body 1's: along, slopes, where
        u, w, x, level = p[:3], p[3:6], p[6:9] + casadi.dot(p[16 : 16 + k], y - p[16 + k :]) * p[13:16], p[12]
        self._rows = []
        for kind in (F1V2, V1F2, E1E2):  # level + n . (d + y - R x), linear in R where n = R u is across edges u and w
            n = (R @ u, u, casadi.cross(R @ u, w))[kind]
            along = (casadi.dot(u, x), casadi.dot(u, R @ x), casadi.dot(w, R @ casadi.cross(x, u)))[kind]
            row = level + casadi.dot(n, d + p[9:12]) - along
            bend, slope = casadi.hessian(row, y)
            outputs = [row, slope], [row, slope, casadi.vec(bend)]
            made = [casadi.Function("row", [y, seeds, p], [casadi.densify(casadi.vertcat(*own))]) for own in outputs]
            self._rows.append([IntervalFunction(own) for own in made])

    # ---------------------------------------------------------------------------------------------------------- bounds

    def least(self, low: Array, high: Array, motions: Array, enough: float) -> tuple[Array, Array]:
        """Return amounts below which no motion in boxes does what is asked, (n,), and near which they are, (n, k)."""
        # infinite where none does at all
        found, places = np.zeros(len(low)), motions.copy()
        for k, y in enumerate(motions):
            for choice in self._choices(y, np.maximum(np.abs(low[k] - y), np.abs(high[k] - y))):
                if not found[k] < enough:
                    break
                pacing.check()
                each = [self._bounds(kind, given, low[k], high[k], y) for kind, given in choice]
                if not each:  # as of a switching point, whose sizes follow the motion
                    break
                amounts, least = (np.concatenate(own) for own in zip(*each, strict=True))
                if amounts.min() > found[k]:
                    found[k], places[k] = amounts.min(), least[amounts.argmin()]
        return found, places

    def _bounds(self, kind: int, given: Array, low: Array, high: Array, start: Array) -> tuple[Array, Array]:
        """Return such amounts of rows over a box, (n,), and near which motions they are, (n, k)."""
        n, k, numbers = len(given), len(low), [Interval(own) for own in given.T]
        low, high = np.tile(low, (n, 1)), np.tile(high, (n, 1))

        def at(y: Array, to: Array, derivatives: int) -> tuple[list[Interval], Array]:
            (found,), jumps = self._rows[kind][derivatives - 1](
                [Interval.between(y[:, j], to[:, j]) for j in range(k)], self._seeds, numbers
            )
            wide = [Interval(*(np.broadcast_to(side, n) for side in (x.middle, x.radius))) for x in found]
            return wide, np.broadcast_to(np.asarray(jumps), n)

        y, share = np.clip(start, low, high), np.zeros(n)
        for _ in range(STEPS):  # to the least motion of the box at which the row is 0, as far as it is linear
            value, *slopes = (x.middle for x in at(y, y, 1)[0])
            slope, fixed = np.array(slopes).T, np.zeros((n, k), dtype=bool)
            level = (slope * y).sum(axis=1) - value
            for _ in range(k):
                steep = (np.where(fixed, 0.0, slope) ** 2).sum(axis=1)
                rest = level - np.where(fixed, slope * y, 0.0).sum(axis=1)
                share = np.where(steep > 0.0, np.maximum(-rest / np.maximum(steep, 1e-300), 0.0), 0.0)
                aim = np.where(fixed, y, -share[:, None] * slope)
                y = np.clip(aim, low, high)
                if not np.any((y != aim) & ~fixed):
                    break
                fixed = fixed | (y != aim)
        (value, *slopes), _ = at(y, y, 1)
        far = (np.maximum(-low, high) ** 2).sum(axis=1)
        reached = value.middle <= MATCHED * np.sqrt(far) * np.linalg.norm([own.middle for own in slopes], axis=0)
        share = np.where(reached, share, FAR * far / value.middle)  # where it is 0 nowhere, that alone excludes the box
        over, jumps = at(np.minimum(low, y), np.maximum(high, y), 2)
        times = Interval(-share)
        bends = [[over[1 + k + i * k + j] * times for j in range(k)] for i in range(k)]
        bounds = lagrangian_bounds(low, high, y, value * times, [x * times for x in slopes], bends)
        return np.where(jumps if not self._smooth else False, 0.0, np.where(over[0].low > 0.0, np.inf, bounds)), y

    # ------------------------------------------------------------------------------------------- points and directions

    def divided(self, low: Array, high: Array, motions: Array, places: Array) -> tuple[Array, Array, Array]:
        """Return halves of boxes, cut between the motion looked at and the one that it does not bound, and motions."""
        axis, each = np.abs(places - motions).argmax(axis=1), np.arange(len(low))
        cut = 0.5 * (places + motions)[each, axis]
        room = (cut > low[each, axis]) & (cut < high[each, axis])
        axis = np.where(room, axis, (high - low).argmax(axis=1))
        cut = np.where(room, cut, 0.5 * (low + high)[each, axis])
        start, end = low.copy(), high.copy()
        start[each, axis] = end[each, axis] = cut
        low, high = np.vstack([low, start]), np.vstack([end, high])
        motions, places = np.tile(motions, (2, 1)), np.tile(places, (2, 1))
        for k in np.flatnonzero(((motions < low) | (motions > high)).any(axis=1)):
            motions[k] = self._touching(low[k], high[k], places[k])
        return low, high, motions

    def _touching(self, low: Array, high: Array, near: Array) -> Array:
        """Return a motion near another one in a box after which the bodies touch, or nearly: it is shifted alone."""
        y, turning = np.clip(near, low, high), np.asarray(self.problem.motion.turning)
        for _ in range(STEPS):
            pose = self._at(y)
            directions = {(i, j): self._directions_of(i, j, pose) for i, j in self.part_pairs}
            short = {pair: float(own[-1].max()) - self._need(pair[1]) for pair, own in directions.items()}
            pair = min(short, key=lambda pair: short[pair])
            gap, n = short[pair], directions[pair][-2][directions[pair][-1].argmax()]
            X = self._corners(pair[0], pose)
            slope = np.where((low < high) & ~turning, self._slopes(pose, X[(X @ n).argmax()], n), 0.0)
            if not slope.any():
                break
            y = np.clip(y + gap * slope / (slope @ slope), low, high)
        return y

    @cached_property
    def _meeting(self) -> list[tuple[int, int]]:
        """Part pairs that overlap at rest, or are nearer than is asked for."""
        rest = self._at(np.zeros(len(self.problem.weights)))
        needed = [j for j, own in enumerate(self._scene.obstacles) if np.isfinite(own.need)]
        pairs = product(range(len(self._scene.movable)), needed)
        return [(i, j) for i, j in pairs if self._directions_of(i, j, rest)[-1].max() < self._need(j)]

    @cached_property
    def part_pairs(self) -> list[tuple[int, int]]:
        """The part pairs that are to come apart, or else those of which one is to touch."""
        statics = range(len(self.problem.active[1].parts) if self._scene.must_touch else 0)
        return self._meeting or list(product(range(len(self._scene.movable)), statics))

    def _need(self, j: int) -> float:
        return max(self._scene.obstacles[j].need, 0.0)

    def _at(self, y: Array) -> Pose:
        """Return R and d after a motion, and the slopes of both by y, (12, k)."""
        R, d, J = (np.asarray(own) for own in self._pose(y, [float(own.middle) for own in self._seeds]))
        return R, d.ravel(), J

    def _corners(self, i: int, pose: Pose) -> Array:
        """Return where the corners of a part of body 1 are, about s_2."""
        return np.asarray(self._scene.movable[i].middle @ pose[0].T - pose[1])

    def _slopes(self, pose: Pose, p: Array, n: Array) -> Array:
        """Return how points of body 1, about s_2, move along a direction, (..., k)."""
        R, d, J = pose
        moved = np.einsum("ijk,...j->...ik", J[:9].reshape(3, 3, -1), (p + d) @ R) - J[9:]
        return np.asarray(n @ moved)

    def _directions_of(self, i: int, j: int, pose: Pose) -> tuple[Array, ...]:
        """Return directions of two parts, kinds, u, w, and unit n, and how far the parts are apart along each."""
        R = pose[0]
        one, two = self.problem.active[0].parts[i], self._scene.obstacles[j].part
        e, f = (np.diff(part.vertices[part.edges[:, :2]], axis=1)[:, 0] for part in (one, two))
        if len(e) * len(f) > MOST_CROSSED:
            e = f = np.empty((0, 3))
        e, f = np.repeat(e, len(f), axis=0), np.tile(f, (len(e), 1))
        across = np.cross(e @ R.T, f)
        lengths = np.linalg.norm(across, axis=1)
        kept = lengths > DEFAULT.nominal * lengths.max(initial=0.0)
        e, f, across = e[kept], f[kept], across[kept] / lengths[kept, None]
        count = len(one.normals), len(two.normals), 2 * len(e)
        u = np.vstack([one.normals, -two.normals, e, -e])
        w = np.vstack([np.zeros((sum(count[:2]), 3)), f, f])
        n = np.vstack([one.normals @ R.T, -two.normals, across, -across])
        Y = self._scene.obstacles[j].vertices.middle
        gaps = (Y @ n.T).min(axis=0) - (self._corners(i, pose) @ n.T).max(axis=0)
        return np.repeat((F1V2, V1F2, E1E2), count), u, w, n, gaps

    def _contact(self, i: int, j: int, pose: Pose, y: Array) -> _Contact:
        """Return how two parts come apart first, of several directions alike the one along which forces fit best."""
        from scipy.optimize import nnls

        size, sign = self.problem.size, -1.0 if self._meeting else 1.0
        X, Y = self._corners(i, pose), self._scene.obstacles[j].vertices.middle
        kinds, u, w, normals, gaps = self._directions_of(i, j, pose)
        best = np.flatnonzero(gaps >= gaps.max() - NEAR * size)
        options = [(int(kinds[k]), u[k], w[k], normals[k]) for k in best]
        limits = self.problem.limits.T * self.problem.weights
        free = (limits[0] < limits[1]) & (y > limits[0]) & (y < limits[1])
        slopes = self._slopes(pose, nearest_points(X, Y)[0], np.eye(3))[:, free]
        along = sign * np.linalg.lstsq(slopes.T, y[free], rcond=DEFAULT.nominal)[0]  # two corners, or a clearance
        if (length := np.linalg.norm(along)) > 0.0:
            options.append((-1, along / length, np.zeros(3), along / length))
        found = list[_Contact]()
        for kind, e, f, n in options:
            heights, others = X @ n, Y @ n
            gap = float(others.min() - heights.max())
            own = np.flatnonzero(heights >= heights.max() - NEAR * size)
            other = np.flatnonzero(others <= others.min() + NEAR * size)
            if kind < 0:  # it turns with the body that has more in its plane
                kind, e = (F1V2, n @ pose[0]) if len(own) > len(other) else (V1F2, n)
            slopes = sign * self._slopes(pose, X[own], n)[:, free]
            weight = np.linalg.norm(y) / size + DEFAULT.tie
            A = np.vstack([
                np.hstack([slopes.T, np.zeros((free.sum(), len(other)))]),
                weight * np.hstack([X[own].T, -(Y[other] - gap * n).T]),
                weight * size * np.append(np.ones(len(own)), -np.ones(len(other))),
            ])  # fmt: skip
            shares, missed = nnls(A, np.concatenate([y[free], np.zeros(4)]))
            total = shares[: len(own)].sum()
            point = shares[: len(own)] @ X[own] / total if total > 0.0 else X[own].mean(axis=0)
            missed /= max(np.linalg.norm(y), DEFAULT.tie)
            found.append(_Contact(kind, e, f, gap, n, (own, other), point, missed))
            if found[-1].missed <= MATCHED:
                break
        return min(found, key=lambda contact: contact.missed)

    def _choices(self, y: Array, far: Array) -> list[list[tuple[int, Array]]]:
        """Return rows that may bound motions up to so far from one, kinds and numbers, one way after another."""
        pose = self._at(y)
        known = [(self._contact(i, j, pose, y), i, j) for i, j in self.part_pairs]
        if not self._meeting:
            return [[self._apart(i, j, own) for own, i, j in known]]
        nearest = sorted(known, key=lambda item: item[0].gap - self._need(item[2]))[:2]
        return [[self._inside(i, j, own, pose, y, far)] for own, i, j in nearest]

    def _apart(self, i: int, j: int, contact: _Contact) -> tuple[int, Array]:
        """Return how far corners of two parts are apart along a direction."""
        X, Y = self._scene.movable[i].middle, self._scene.obstacles[j].vertices.middle
        kind, u, w, none = contact.kind, contact.u, contact.w, np.zeros((1, 3))
        if kind == E1E2:
            x, y = np.repeat(X, len(Y), axis=0), np.tile(Y, (len(X), 1))
            return kind, self._numbers(u, w, x, y, -self._rounding * float(np.linalg.norm(u) * np.linalg.norm(w)))
        if kind == F1V2:
            return kind, self._numbers(u, w, none, Y, -float((X @ u).max()) - self._rounding)
        return kind, self._numbers(u, w, X, none, float((Y @ u).min()) - self._rounding)

    def _numbers(self, u: Array, w: Array, x: Array, y: Array, level: Array | float, *sliding: Array) -> Array:
        """Return what rows are given: directions, a point of each body, levels, and how the first slides."""
        k = len(self.problem.weights)
        along = sliding or (np.zeros(3), np.zeros(k), np.zeros(k))
        given = [np.atleast_2d(own) for own in (u, w, x, y)] + [np.reshape(level, (-1, 1)), *map(np.atleast_2d, along)]
        n = max(map(len, given))
        return np.hstack([np.broadcast_to(own, (n, own.shape[1])) for own in given])

    def _inside(self, i: int, j: int, contact: _Contact, pose: Pose, y: Array, far: Array) -> tuple[int, Array]:
        """Return how deep a point of one part is below the faces of the other."""
        (R, d, _), n, p, need = pose, contact.normal, contact.point, self._need(j)
        corners, none = (self._scene.movable[i], self._scene.obstacles[j].vertices), np.zeros(3)
        x, w = (p + d) @ R, p + need * n
        if contact.kind == F1V2:
            normals, levels = _near_planes(self.problem.active[0].parts[i], corners[0], need, n @ R)
            off = float(distances_from(w[None], corners[1])[0])
            return F1V2, self._numbers(-normals, none, none, w, levels - off - self._rounding)
        normals, levels = _near_planes(self._scene.obstacles[j].part, corners[1], need, -n)
        if contact.kind == V1F2:
            off = float(distances_from(x[None], corners[0])[0])
            return V1F2, self._numbers(normals, none, x, none, levels - off - self._rounding)
        first, second = np.argsort(levels - normals @ p)[:2].tolist()
        between, (start, end) = normals[first] - normals[second], corners[0].middle[contact.corners[0][[0, -1]]]
        along = end - start
        tilt = float(between @ R @ along)
        slopes = -self._slopes(pose, p, between) / tilt if tilt else np.zeros(len(y))
        ends = float(np.abs(slopes) @ far) / ROUNDED * along
        off = float(distances_from(np.array([x - ends, x + ends]), corners[0]).max())
        return V1F2, self._numbers(normals, none, x, none, levels - off - self._rounding, along, slopes, y)


def _near_planes(part: ConvexPart, corners: Interval, need: float, n: Array) -> tuple[Array, Array]:
    """Return planes below all of which all is in a part, or nearer to it than a length; one is across n if may be."""
    # normals, (f, 3), and levels, (f,)
    if need > 0.0:
        middle = corners.middle
        moved = [middle[list(loop)] + need * normal for loop, normal in zip(part.loops, part.normals, strict=True)]
        top = middle @ n >= (middle @ n).max() - NEAR * float(np.abs(middle).max())
        part = Body.convex(np.vstack([middle, *moved, middle[top] + need * n]), seed=np.zeros(3)).parts[0]
        corners = Interval(part.vertices)
    normals, planes = face_planes(part, corners)
    return normals, np.asarray(planes[-1].middle).ravel()


def lagrangian_bounds(
    low: Array, high: Array, y: Array, value: Interval, slope: Sequence[Interval], bend: Sequence[Sequence[Interval]]
) -> Array:
    """Return amounts below which the Lagrangian leaves no motion in boxes, (n,); infinite where none is in one."""
    # of l . F: its value and slopes at motions y, (n, k), which may lie outside, k of them, and its bends, k x k, over
    # the boxes and the ways to them
    k = low.shape[1]
    below, above = (low - y).T / ROUNDED, (high - y).T / ROUNDED
    sides = np.array([[own.size for own in row] for row in bend])
    total = Interval(0.5) * sum((Interval(y[:, j]).square() for j in range(k)), Interval(0.0)) - value
    level = np.array(total.low)
    for j in range(k):  # second derivatives are no less than `least` by Gershgorin's discs
        least = (1.0 - bend[j][j].high - (sides[j].sum(axis=0) - sides[j, j]) / ROUNDED) * ROUNDED
        steep = Interval(y[:, j]) - slope[j]
        ahead = _lowest(steep.low, np.maximum(below[j], 0.0), above[j], least)
        level = level + np.minimum(ahead, _lowest(-steep.high, np.maximum(-above[j], 0.0), -below[j], least))
    amounts = np.sqrt(np.maximum(2.0 * level, 0.0)) * ROUNDED
    largest = np.sqrt((np.maximum(-low, high) ** 2).sum(axis=1)) / ROUNDED
    return np.where(np.isnan(amounts), 0.0, np.where(amounts > largest, np.inf, amounts))


def _lowest(rate: Array, start: Array, end: Array, bend: Array) -> Array:
    """Return lower bounds of rate d + bend d^2 / 2 for d from `start` to `end`, infinite where that is not ahead."""
    turn = np.clip(np.where(bend > 0.0, -rate / bend, start), start, np.maximum(end, start))
    found = [(rate * d, 0.5 * bend * d * d) for d in (start, end, turn)]
    values = [one + two - (1.0 - ROUNDED) * (np.abs(one) + np.abs(two)) for one, two in found]
    return np.where(end >= start, np.min(values, axis=0), np.inf)
