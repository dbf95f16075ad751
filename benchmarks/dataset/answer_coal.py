"""Answer the data set with the collision library coal: bisection along one parameter, SLSQP from 12 starts for more.

    python answer_coal.py answers.json [--only WORD]

Needs coal and scipy. The distances are the library's signed ones at its own tolerance of 1e-6; conditions are that no
part pair is nearer than the clearance, and for touching that the least distance is zero. Nothing is proved, so the
claim is "motion".
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import asking
import coal
import numpy as np
import score
from scipy.optimize import minimize

STARTS = 12
STEPS = 120  # of a scan along one parameter, each way
DIFFERENCE = 1e-6  # of a length, for derivatives
FINE = 1e-7  # of the size: conditions that are missed by no more are taken as met


def shape(corners: Any) -> Any:
    """Return the convex shape of some corners."""
    points = coal.StdVec_Vec3s()
    points.extend(list(np.asarray(corners, float)))
    return coal.Convex.convexHull(points, True, "Qt")


class Gaps:
    """Signed distances of all part pairs under a motion."""

    def __init__(self, scene: Mapping[str, Any]) -> None:
        self.scene, self.question = scene, scene["question"]
        self.ones, self.twos = ([shape(own) for own in score.made(scene, role)] for role in ("movable", "static"))
        self.request, self.result = coal.DistanceRequest(True), coal.DistanceResult()
        self.here, self.there = coal.Transform3s(), coal.Transform3s()

    def __call__(self, q: Any) -> Any:
        """Return the distances less the clearance."""
        R, t = score.pose(self.question["motion"], q, self.scene["movable"]["seed"])
        self.here.setRotation(R)
        self.here.setTranslation(t)
        found = [self._distance(one, two) for one in self.ones for two in self.twos]
        return np.array(found) - self.question.get("clearance", 0.0)

    def _distance(self, one: Any, two: Any) -> float:
        self.result.clear()
        return float(coal.distance(one, self.here, two, self.there, self.request, self.result))


def conditions(gaps: Gaps, size: float) -> Any:
    """Return (equations, inequalities) of q, in parts of the size."""
    question, columns = gaps.question, len(gaps.twos)
    touching = [i * columns + j for i, j in question.get("pairs", ())]

    def both(q: Any) -> tuple[Any, Any]:
        found = gaps(q) / size
        if question["goal"] == "touch":
            return np.array([found.min()]), found
        return found[touching], found

    return both


def along_one(scene: Mapping[str, Any], size: float) -> list[float] | None:
    """Scan along the only parameter both ways, and bisect where the least distance changes its sign."""
    gaps, weight = Gaps(scene), scene["question"]["weights"][0]
    limits = (scene["question"].get("limits") or [None])[0] or (-math.inf, math.inf)
    angle = score.parameters(scene["question"]["motion"]) == ["angle"]
    reach = math.pi if angle else 2.0 * size
    start = float(gaps([0.0]).min())
    if start >= 0 and scene["question"]["goal"] == "clear":
        return [0.0]
    found = []
    for sign in (1.0, -1.0):
        before = 0.0
        for k in range(1, STEPS + 1):
            here = float(np.clip(sign * reach * (k / STEPS) ** 2, *limits))
            if here == before:
                break
            if float(gaps([here]).min()) * start <= 0:
                low, high = before, here
                while abs(high - low) > 1e-12 * abs(high):
                    middle = (low + high) / 2
                    low, high = (middle, high) if float(gaps([middle]).min()) * start > 0 else (low, middle)
                found.append([high])
                break
            before = here
    return min(found, key=lambda q: abs(q[0]) * weight, default=None)


def along_many(scene: Mapping[str, Any], size: float) -> list[float] | None:
    """Ask SLSQP from rest and from seeded starts around it; keep the least that meets its conditions."""
    question, gaps = scene["question"], Gaps(scene)
    weights = np.array(question["weights"])
    both, rng, found = conditions(gaps, size), np.random.default_rng(0), []
    bounds = [
        (None, None) if own is None else tuple(np.array(own) * w)
        for own, w in zip(question.get("limits") or [None] * len(weights), weights, strict=True)
    ]

    def slopes(own: int) -> Any:
        def made(z: Any) -> Any:
            step = DIFFERENCE * size
            rows = [
                (both((z + step * e) / weights)[own] - both((z - step * e) / weights)[own]) / (2 * step)
                for e in np.eye(len(z))
            ]
            return np.array(rows).T

        return made

    rows = [
        {"type": kind, "fun": lambda z, own=own: both(z / weights)[own], "jac": slopes(own)}
        for own, kind in enumerate(("eq", "ineq"))
        if len(both(np.zeros(len(weights)))[own])
    ]
    for k in range(STARTS):
        z = rng.normal(size=len(weights)) * (0.0, 0.01, 0.1)[min(k, 1 + k % 2)] * size
        made = minimize(
            lambda z: (z / size) @ (z / size),
            z,
            jac=lambda z: 2 * z / size**2,
            method="SLSQP",
            bounds=bounds,
            constraints=rows,
            options={"ftol": 1e-14, "maxiter": 100},
        )
        q = made.x / weights
        if np.isfinite(q).all():
            e, g = both(q)
            if np.abs(e).max(initial=0.0) <= FINE and g.min() >= -FINE:
                found.append(q.tolist())
    return min(found, key=lambda q: float(np.linalg.norm(np.array(q) * weights)), default=None)


def scale(scene: Mapping[str, Any]) -> float:
    """Bisect the scale of body 2 at which it overlaps body 1."""
    low, high = 0.0, 1.0
    seed, corners = np.array(scene["static"]["seed"]), np.array(scene["static"]["parts"][0])
    one = shape(score.made(scene, "movable")[0])

    def gap(rho: float) -> float:
        made = coal.distance(
            one,
            coal.Transform3s(),
            shape(seed + rho * (corners - seed)),
            coal.Transform3s(),
            coal.DistanceRequest(True),
            coal.DistanceResult(),
        )
        return float(made)

    while gap(high) > 0:
        high *= 2
    while high - low > 1e-9 * high:
        middle = (low + high) / 2
        low, high = (middle, high) if gap(middle) > 0 else (low, middle)
    return high


def answered(scene: Mapping[str, Any]) -> asking.Answer:
    """Return the answer to a scene."""
    question = scene["question"]
    if question["goal"] == "scale":
        return {"claim": "motion", "scale": scale(scene)}
    one = len(question["weights"]) == 1 and question["goal"] != "locate"
    q = (along_one if one else along_many)(scene, score.size(scene))
    return {"claim": "unknown", "said": "found none"} if q is None else {"claim": "motion", "motion": q}


if __name__ == "__main__":
    asking.asked_each(answered, "Answer the data set with coal.", f"coal {coal.__version__}, bisection or SLSQP")
