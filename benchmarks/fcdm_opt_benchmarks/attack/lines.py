"""Tracked contacts of two convex solids, "at" and "beyond", from contact lines a rho_1 + b rho_2 = c of their own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import HalfspaceIntersection

from fcdm_opt_benchmarks.attack.least import KnownMotion, Setting, nearest
from fcdm_opt_benchmarks.attack.separation import ConvexSolid, axes
from fcdm_opt_benchmarks.shapes import Array


@dataclass(frozen=True)
class ContactLine:
    """A contact feature: a face with a corner, a corner with a face, or two edges.

    Attributes
    ----------
    kind : "FV", "VF" or "EE"
    one, two : (3,) arrays
        Face normal or edge direction of body 1 and of body 2, as drawn; unused for the corner's body.
    v1, v2 : (3,) arrays
        A corner of each body on the feature, from its seed, as drawn.
    sign : float
        Orientation of the normal, which points from body 1 to body 2.
    """

    kind: str
    one: Array
    two: Array
    v1: Array
    v2: Array
    sign: float

    def normal(self, R: Array) -> Array:
        """Return the unit normals at rotations (N, 3, 3)."""
        if self.kind == "FV":
            return self.sign * (R @ self.one)
        if self.kind == "VF":
            return np.broadcast_to(self.sign * self.two, (len(R), 3))
        n = np.cross(R @ self.one, self.two)
        return self.sign * n / np.linalg.norm(n, axis=1, keepdims=True)

    def at(self, R: Array, offset: Array) -> Array:
        """Return (a, b, c), (N, 3); offset (N, 3): from the moved seed of body 1 to that of body 2."""
        n = self.normal(R)
        return np.stack([(n * (R @ self.v1)).sum(1), -(n @ self.v2), (n * offset).sum(1)], axis=1)


@dataclass(frozen=True, eq=False)
class TrackedPoint:
    """Two convex bodies as drawn, a nominal switching point, and the two lines that meet there."""

    one: ConvexSolid
    two: ConvexSolid
    s1: Array
    s2: Array
    rho: Array
    lines: tuple[ContactLine, ContactLine]

    def real(self, R: Array, t: Array) -> tuple[Array, Any]:
        """Return the tracked point (N, 2) at poses R, t, and whether its two features touch there."""
        moved = np.einsum("nij,j->ni", R, self.s1) + t
        rows = np.stack([line.at(R, self.s2 - moved) for line in self.lines], axis=1)
        with np.errstate(all="ignore"):
            x: Array = np.asarray(np.linalg.solve(rows[:, :, :2], rows[:, :, 2:])[:, :, 0], dtype=np.float64)
        fine = (x > 0).all(axis=1)
        arms, rest = self.one.points - self.s1, self.two.points - self.s2
        for line in self.lines:  # its own corners are still the outermost along its normal
            n = line.normal(R)
            local = np.einsum("nij,ni->nj", R, n)
            fine &= (arms @ local.T).max(axis=0) - local @ line.v1 < 1e-9
            fine &= (rest @ n.T).min(axis=0) - n @ line.v2 > -1e-9
        n = axes(self.one, self.two, R)  # and no other features hold the bodies apart
        local = np.einsum("nij,nmi->nmj", R, n) @ arms.T
        fixed, c = n @ rest.T, np.einsum("nmi,ni->nm", n, self.s2 - moved)
        one, two = x[:, :1], x[:, 1:]
        fine &= (local.max(axis=2) * one - fixed.min(axis=2) * two >= c - 1e-9).all(axis=1)
        fine &= (fixed.max(axis=2) * two - local.min(axis=2) * one >= -c - 1e-9).all(axis=1)
        return x, fine


def table(
    one: ConvexSolid, two: ConvexSolid, s1: Array, s2: Array, R: Array, seed: Array
) -> tuple[Array, list[ContactLine]]:
    """Return all lines (m, 3) at one pose, and what they are; `seed`: the moved one of body 1."""
    turned = (one.points - s1) @ R.T
    rest = two.points - s2
    made: list[tuple[str, Array, Array, Array]] = []
    made += [("FV", n, n, R @ n) for n in one.normals]
    made += [("VF", n, n, n) for n in two.normals]
    for e in one.edges:
        for f in two.edges:
            n = np.cross(R @ e, f)
            if np.linalg.norm(n) > 1e-7:
                made.append(("EE", e, f, n / np.linalg.norm(n)))
    rows, lines = [], []
    for kind, u, v, direction in made:
        for sign in (1.0, -1.0):
            n = sign * direction
            i, j = int((turned @ n).argmax()), int((rest @ n).argmin())
            rows.append([turned[i] @ n, -(rest[j] @ n), n @ (s2 - seed)])
            lines.append(ContactLine(kind, u, v, one.points[i] - s1, rest[j], sign))
    return np.array(rows), lines


def switching_points(
    one: ConvexSolid, two: ConvexSolid, s1: Array, s2: Array, box: tuple[float, float]
) -> list[TrackedPoint]:
    """Return the switching points at rest, both scales inside `box`, where exactly two lines meet.

    The seeds must be inside, so that bodies much larger than drawn overlap.
    """
    rows, lines = table(one, two, s1, s2, np.eye(3), s1)
    inside = np.full(2, 100.0)
    if (rows[:, :2] @ inside <= rows[:, 2]).any():
        return []
    corners = HalfspaceIntersection(np.column_stack([-rows[:, :2], rows[:, 2]]), inside).intersections
    found = []
    for x in corners[((corners > box[0]) & (corners < box[1])).all(axis=1)]:
        tight = np.flatnonzero(np.abs(rows[:, :2] @ x - rows[:, 2]) < 1e-6)
        if len(tight) == 2 and abs(np.linalg.det(rows[tight, :2])) > 1e-3:
            x = np.linalg.solve(rows[tight, :2], rows[tight, 2])
            found.append(TrackedPoint(one, two, s1, s2, x, (lines[tight[0]], lines[tight[1]])))
    return sorted(found, key=lambda point: float(point.rho[0]))


def reached(goal: str, x: Array, target: Array, signs: Array) -> Any:
    """Tell where tracked points (N, 2) meet the goal."""
    if goal == "at":
        return np.abs(x - target).max(axis=1) <= 1e-9
    return (signs * (x - target) >= -1e-10).all(axis=1)


def least_tracked(
    tracked: TrackedPoint, setting: Setting, goal: str, target: Array, coherent: bool
) -> KnownMotion | None:
    """Return the least motion known for "at" or "beyond"; exact for translations, scanned for one turn or screw."""
    signs = np.sign(target - tracked.rho)
    if not setting.turns.any():
        return _translated(tracked, setting, goal, target, signs)
    if len(setting.turns) > 1 or goal == "at":
        return None
    grid = np.unique(np.concatenate([np.linspace(0, np.pi, 721), np.geomspace(1e-6, np.pi, 300)]))
    best: KnownMotion | None = None
    for side in (1.0, -1.0):
        x, real = tracked.real(*setting.poses(side * grid[:, None]))
        fine = reached(goal, x, target, signs) & real
        if coherent:  # up to the first place where the features are no longer real
            fine &= np.logical_and.accumulate(real)
        if not fine.any():
            continue
        k = int(fine.argmax())
        low, high = grid[max(k - 1, 0)], grid[k]
        for _ in range(60):
            middle = 0.5 * (low + high)
            x, real = tracked.real(*setting.poses([[side * middle]]))
            if reached(goal, x, target, signs)[0] and real[0]:
                high = middle
            else:
                low = middle
        q = np.array([side * high])
        inside = setting.limits[0, 0] <= q[0] <= setting.limits[0, 1]
        if inside and (best is None or setting.amount(q) < best.amount):
            best = KnownMotion(q, setting.amount(q), False)
    return best


def _translated(tracked: TrackedPoint, setting: Setting, goal: str, target: Array, signs: Array) -> KnownMotion | None:
    """Return the least translation: all lines are linear in it, with constant a and b."""
    B = setting.affine(np.zeros((1, 0)))[2][0] @ np.diag(1.0 / setting.weights)
    rest = np.eye(3)
    own = np.array([line.at(rest[None], (tracked.s2 - tracked.s1)[None])[0] for line in tracked.lines])
    normals = np.array([line.normal(rest[None])[0] for line in tracked.lines])
    inverse = np.linalg.inv(own[:, :2])
    start, slope = inverse @ own[:, 2], -inverse @ normals @ B  # x = start + slope y
    rows, lines = table(tracked.one, tracked.two, tracked.s1, tracked.s2, rest, tracked.s1)
    n = np.array([line.normal(rest[None])[0] for line in lines])
    G = [rows[:, :2] @ slope + n @ B]
    h = [rows[:, 2] - rows[:, :2] @ start - 1e-10]
    if goal == "at":
        G += [slope, -slope]
        h += [target - start, start - target]
    else:
        G.append(signs[:, None] * slope)
        h.append(signs * (target - start))
    bounds = setting.bounds(np.diag(1.0 / setting.weights))
    y = nearest(np.vstack([*G, bounds[0]]), np.concatenate([*h, bounds[1]]))
    if y is None:
        return None
    q = y / setting.weights
    return KnownMotion(q, float(np.linalg.norm(y)), True)
