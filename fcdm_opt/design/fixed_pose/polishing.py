"""The best pose on true faces, near one that is best for parts exact at points of their round faces.

Each point of a round face is a constraint, and rounds of making parts exact at more of them end only slowly where these
slide along the face. Sequential quadratic programming (SLSQP) on the gaps of true faces leads to where they end.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from fcdm_opt.curve.true_sizes import TrueSizes
from fcdm_opt.design.fixed_pose.local_search import Found
from fcdm_opt.design.fixed_pose.scene import Scales
from fcdm_opt.design.fixed_pose.worst import Worst
from fcdm_opt.geometry.arrays import Array

STEPS = 25  # of either search
END = 1e-11  # of what is made small, in the lengths of a search
WIDE = 10.0  # times what gaps of true faces are less at the pose: points move no further, or by the gap
MOST = 3  # sizes at which gaps are least, and as many at which they are largest, are looked at
INNER = 0.1  # of what counts as inside a window: by so much it is left


class Polished(NamedTuple):
    """A pose, and sizes with the gaps that true faces have there, at most."""

    q: Array
    gaps: list[tuple[Array, float]]


class _NearPose:
    """How far gaps of true faces are within a window near a pose, in steps of a length, and the slopes of that.

    Of the contacts that there are at the pose, at each of some sizes; of all of them the least is to be no larger.
    """

    def __init__(self, worst: Worst, true: TrueSizes, start: Array, places: Sequence[Array], unit: float, most: float):
        self._worst, self._true, self._start, self._places, self._most = worst, true, start, places, most
        problem = worst.problem
        self.unit, self.per = unit, unit / worst.natural
        self._kinematics = problem.motion.kinematics(problem.movable.seed, problem.static.seed)
        self._known = dict[bytes, tuple[Array, Array]]()
        self._kinds = [[*own] for own in self.contacts(np.zeros(len(start)))]

    def contacts(self, y: Array) -> list[dict[frozenset[tuple[int, int]], tuple[float, Array]]]:
        """Return gaps and their slopes by the faces that are near, at each of the sizes."""
        (pose, rates), found = self._kinematics.rates(self._start + self.per * y), []
        seed = self._worst.problem.movable.seed
        for place in self._places:
            scale, own = self._true.faces[0].at(place)[1], dict[frozenset[tuple[int, int]], tuple[float, Array]]()
            for near in self._true.nearest(pose, place, self._most)[::-1]:  # the nearest of its faces last
                point = np.append(seed + scale * (near.points[0] - seed), 1.0)
                own[near.pairs] = near.gap, -(rates[:, :3] @ point) @ near.normal * self.per
            found.append(own)
        return found

    def __call__(self, y: Array) -> tuple[Array, Array]:
        if (key := y.tobytes()) not in self._known:
            low, high, values = self._worst.low, self._worst.high, list[tuple[float, Array]]()
            far = self._most, np.zeros(len(y))
            for own, kinds in zip(self.contacts(y), self._kinds, strict=True):
                values += [(gap - low, slopes) for gap, slopes in (own.get(kind, far) for kind in kinds)]
                gap, slopes = min(own.values(), key=lambda one: one[0], default=far)
                values.append((high - gap, -slopes))
            asked = [(value / self.unit, slopes / self.unit) for value, slopes in values if value < np.inf]
            heights = np.array([value for value, _ in asked])
            self._known[key] = heights, np.array([slopes for _, slopes in asked]).reshape(len(asked), len(y))
        return self._known[key]

    def off(self, y: Array) -> float:
        """Return how far any gap is off the window."""
        return max(0.0, float(-self(y)[0].min(initial=0.0)))


def polished(worst: Worst, true: TrueSizes, found: Found, places: Sequence[Array]) -> Polished:
    """Return the pose near a pose whose worst gap is off least on true faces, of such the one of the least amount.

    `worst` is of parts exact at points, `true` was asked last about the pose found, and `places` are sizes at which
    gaps were extreme so far, (k,) each, as `TrueSizes` has them.
    """
    slack, k = worst.problem.contact_slack, len(found.q)
    ends = [end.gap for end in found.off.extremes[:2]]
    unit, known = max(WIDE * true.short, *map(abs, ends)) + slack, np.unique(places, axis=0)
    order = np.argsort(found.off.rows.gaps(known + isinstance(worst.scene, Scales)), kind="stable")
    latest = [*known[np.unique(np.append(order[:MOST], order[-MOST:]))]]
    near = _NearPose(worst, true, found.q, latest, unit, max(ends) + 2.0 * unit)
    bounds = np.clip((worst.limits - found.q[:, None]) / near.per[:, None], -1.0, 1.0)
    how = {"method": "SLSQP", "options": {"maxiter": STEPS, "ftol": END}}
    y = minimize(
        lambda x: x[k], np.append(np.zeros(k), near.off(np.zeros(k))), jac=lambda x: np.append(np.zeros(k), 1.0),
        bounds=[*bounds.tolist(), (0.0, None)], **how,
        constraints={
            "type": "ineq", "fun": lambda x: near(x[:k])[0] + x[k],
            "jac": lambda x: np.insert(near(x[:k])[1], k, 1.0, axis=1),
        },
    ).x[:k]  # fmt: skip
    within, base, weights = INNER * slack / unit, worst.weights * found.q, worst.weights * near.per
    off, scale = near.off(y) + within, unit * (float(np.linalg.norm(base)) + unit)
    less = minimize(
        lambda x: float(((base + weights * x) ** 2).sum()) / scale, y, bounds=bounds.tolist(), **how,
        jac=lambda x: 2.0 * weights * (base + weights * x) / scale,
        constraints={"type": "ineq", "fun": lambda x: near(x)[0] + off, "jac": lambda x: near(x)[1]},
    ).x  # fmt: skip
    y = less if near.off(less) <= off + within else y
    q = found.q + near.per * y
    q = np.where(np.abs(worst.natural * q) <= INNER * slack, 0.0, q)
    each = zip(latest, near.contacts((q - found.q) / near.per), strict=True)
    return Polished(q, [(place, min(gap for gap, _ in own.values()) + slack) for place, own in each if own])
