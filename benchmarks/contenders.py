"""What is timed: each contender is one function and one row of `CONTENDERS`.

A function takes a pair and returns work to be timed, and the number of curves (or of coal's answers) in it. Everything
that can be prepared is prepared before: objects, requests, models, compiled kernels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
from pairs import BOX, SIZES, RandomPair, coal_requests

import fcdm_opt as fo
from fcdm_opt.measure.rivals import RIVALS
from fcdm_opt.tolerances import DEFAULT

Work = Callable[[], Any]
TIGHT = 1e-12
COAL, CURVE, RIVAL = "coal", "curve", "rival"


@dataclass(frozen=True)
class Contender:
    """One line of the results.

    `families`: the hulls it is timed on, see `pairs.AXES`. `poses`: whether the work goes through many poses or repeats
    one; coal is timed beside it the same way. `target`: largest ratio to coal's distance that is asked for, by number
    of vertices.
    """

    name: str
    kind: str
    prepare: Callable[[RandomPair], tuple[Work, int]]
    sizes: tuple[int, ...] = SIZES
    families: tuple[str, ...] = ("round",)
    poses: Literal["many", "one"] = "many"
    target: Callable[[int], float | None] = lambda vertices: None
    rounds: int = 40


def coal_distance(pair: RandomPair, tolerance: float | None = None, count: int | None = None) -> tuple[Work, int]:
    """Coal's distance from Python, result not cleared between calls (its return value is right all the same)."""
    import coal

    (one, two), fixed, result = pair.shapes, coal.Transform3s(), coal.DistanceResult()
    request, poses, distance = coal_requests(tolerance)[0], pair.poses[:count], coal.distance

    def work() -> None:
        for pose in poses:
            distance(one, pose, two, fixed, request, result)

    fresh = [distance(one, pose, two, fixed, request, coal.DistanceResult()) for pose in poses]
    assert fresh == [distance(one, pose, two, fixed, request, result) for pose in poses]
    assert min(fresh) > 0
    return work, len(poses)


def coal_distance_of_one_pose(pair: RandomPair) -> tuple[Work, int]:
    """Coal's distance of the same pose again and again: all its branches are predicted."""
    import coal

    (one, two), fixed, result = pair.shapes, coal.Transform3s(), coal.DistanceResult()
    request, pose, distance = coal_requests(None)[0], pair.poses[0], coal.distance

    def work() -> None:
        for _ in range(500):
            distance(one, pose, two, fixed, request, result)

    return work, 500


def coal_collide(pair: RandomPair, tolerance: float | None) -> tuple[Work, int]:
    """Coal's collide from Python; the pairs are apart, so nothing has to be cleared."""
    import coal

    (one, two), fixed, result = pair.shapes, coal.Transform3s(), coal.CollisionResult()
    request, poses, collide = coal_requests(tolerance)[1], pair.poses, coal.collide

    def work() -> None:
        for pose in poses:
            collide(one, pose, two, fixed, request, result)

    assert not any(collide(one, pose, two, fixed, request, result) for pose in poses)
    return work, len(poses)


def batch(pair: RandomPair, threads: int, repeats: int = 1) -> tuple[Work, int]:
    """All curves of the pair in one call of `decision_curves`."""
    transforms = np.tile(pair.transforms, (repeats, 1, 1))
    return partial(fo.decision_curves, pair.movable, pair.static, transforms, box=BOX, threads=threads), len(transforms)


def batch_of_one_pose(pair: RandomPair) -> tuple[Work, int]:
    """Walk the same pose again and again, in one call: all branches of the walk are predicted."""
    transforms = np.tile(pair.transforms[:1], (500, 1, 1))
    return partial(fo.decision_curves, pair.movable, pair.static, transforms, box=BOX, threads=1), len(transforms)


def kernel_of_all_poses(pair: RandomPair) -> tuple[Work, int]:
    """Call the compiled walk of all poses once: whole curves, proved and clipped, next to no Python."""
    from fcdm_opt.curve import kernels

    one, two = pair.movable.parts[0], pair.static.parts[0]
    seeds, limits = np.array([one.seed, two.seed]), np.array(BOX, dtype=np.float64).ravel()
    bounds = DEFAULT.planarity, DEFAULT.point, DEFAULT.sign
    walk = partial(kernels.walk_many, *one.packed, *two.packed, pair.transforms, seeds, limits, *bounds)
    return walk, len(pair.transforms)


def kernel(pair: RandomPair) -> tuple[Work, int]:
    """Call the compiled walk of one pose, again and again: the whole curve, unclipped, and the call from Python."""
    from fcdm_opt.curve import kernels

    one, two, (T, *_) = pair.movable.parts[0], pair.static.parts[0], pair.transforms
    walk, arguments = kernels.walk, (*one.packed, *two.packed, T, one.seed, two.seed, DEFAULT.planarity)

    def work() -> None:
        for _ in range(500):
            walk(*arguments)

    assert walk(*arguments)[0] == kernels.WALKED
    return work, 500


def curve_object(pair: RandomPair, wanted: str) -> tuple[Work, int]:
    """`decision_curve` from Python, and what is `wanted` of it, so that the curve has been computed."""
    transforms = pair.transforms[:50]

    def work() -> None:
        for T in transforms:
            getattr(fo.decision_curve(pair.movable, pair.static, box=BOX, transform=T), wanted)

    return work, len(transforms)


def rival(pair: RandomPair, name: str, count: int) -> tuple[Work, int]:
    """Trace by a rival method, prepared once for the pair."""
    trace, box = RIVALS[name].prepare(pair.movable, pair.static), np.array(BOX)
    transforms = pair.transforms[:count]

    def work() -> None:
        for T in transforms:
            trace(T, box)

    return work, len(transforms)


def _whole_curve(vertices: int) -> float:
    return 0.5 if vertices <= 100 else 1.0


def _from_python(vertices: int) -> float | None:
    return 15.0 if vertices == 12 else None


BOTH = ("round", "long")
CONTENDERS = (
    Contender("coal distance", COAL, coal_distance, families=BOTH),
    Contender("coal distance, 1e-12", COAL, partial(coal_distance, tolerance=TIGHT)),
    Contender("coal collide", COAL, partial(coal_collide, tolerance=None)),
    Contender("coal collide, 1e-12", COAL, partial(coal_collide, tolerance=TIGHT)),
    Contender("kernel", CURVE, kernel_of_all_poses, families=BOTH, target=_whole_curve),
    Contender("decision_curves, 1 thread", CURVE, partial(batch, threads=1), families=BOTH),
    Contender("decision_curves, 1 thread, 50,000 poses", CURVE, partial(batch, threads=1, repeats=100), sizes=(12,)),
    Contender("decision_curves, 2 threads", CURVE, partial(batch, threads=2, repeats=10)),
    Contender("decision_curves, one pose", CURVE, batch_of_one_pose, poses="one"),
    Contender("kernel, one pose a call", CURVE, kernel, families=BOTH, poses="one"),
    Contender("decision_curve", CURVE, partial(curve_object, wanted="status"), target=_from_python),
    Contender("decision_curve, all segments", CURVE, partial(curve_object, wanted="segments")),
    Contender("coal bisection", RIVAL, partial(rival, name="coal bisection", count=4), rounds=8),
    Contender("highs", RIVAL, partial(rival, name="highs", count=4), rounds=8),
    Contender("cvxpy", RIVAL, partial(rival, name="cvxpy", count=1), sizes=(8, 12, 20, 100), rounds=5),
    Contender("growth distances", RIVAL, partial(rival, name="growth distances", count=4), rounds=8),
)
