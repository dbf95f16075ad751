"""What is timed: each contender is one function and one row of `CONTENDERS`.

A function takes a pair and returns work to be timed, and the number of curves (or of coal's answers) in it. Everything
that can be prepared is prepared before: objects, requests, models, compiled kernels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, Literal

import numpy as np

import fcdm_opt as fo
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.curves import METHODS
from fcdm_opt_benchmarks.library import coal_hull
from fcdm_opt_benchmarks.pairs import BOX, SIZES, DrawnPair

Work = Callable[[], Any]
POSES = 500
TIGHT = 1e-12
COAL, CURVE, RIVAL = "coal", "curve", "rival"


@dataclass(frozen=True)
class Contender:
    """One line of the results.

    `shapes`: the hulls it is timed on, see `pairs.SHAPES`. `poses`: whether the work goes through many poses or repeats
    one; coal is timed beside it the same way. `target`: largest ratio to coal's distance that is asked for, by number
    of vertices.
    """

    name: str
    kind: str
    prepare: Callable[[DrawnPair], tuple[Work, int]]
    sizes: tuple[int, ...] = SIZES
    shapes: tuple[str, ...] = ("round",)
    poses: Literal["many", "one"] = "many"
    target: Callable[[int], float | None] = lambda vertices: None
    rounds: int = 40


def coal_requests(tolerance: float | None) -> tuple[Any, Any]:
    """Return settings of coal's distance and collide: its defaults, or another tolerance."""
    import coal

    requests = coal.DistanceRequest(), coal.CollisionRequest()
    if tolerance is not None:
        for request in requests:
            request.gjk_tolerance = request.epa_tolerance = tolerance
    return requests


@cache
def coal_scene(drawn: DrawnPair) -> tuple[tuple[Any, Any], list[Any]]:
    """Return both hulls as drawn, and all poses, for coal."""
    import coal

    poses = []
    for T in drawn.transforms(POSES):
        poses.append(coal.Transform3s())
        poses[-1].setRotation(T[:3, :3])
        poses[-1].setTranslation(T[:3, 3])
    one, two = drawn.pair
    return (coal_hull(one.vertices), coal_hull(two.vertices)), poses


def coal_distance(drawn: DrawnPair, tolerance: float | None = None) -> tuple[Work, int]:
    """Coal's distance from Python, result not cleared between calls (its return value is right all the same)."""
    import coal

    ((one, two), poses), fixed, result = coal_scene(drawn), coal.Transform3s(), coal.DistanceResult()
    request, distance = coal_requests(tolerance)[0], coal.distance

    def work() -> None:
        for pose in poses:
            distance(one, pose, two, fixed, request, result)

    fresh = [distance(one, pose, two, fixed, request, coal.DistanceResult()) for pose in poses]
    assert fresh == [distance(one, pose, two, fixed, request, result) for pose in poses]
    assert min(fresh) > 0
    return work, len(poses)


def coal_distance_of_one_pose(drawn: DrawnPair) -> tuple[Work, int]:
    """Coal's distance of the same pose again and again: all its branches are predicted."""
    import coal

    ((one, two), (pose, *_)), fixed, result = coal_scene(drawn), coal.Transform3s(), coal.DistanceResult()
    request, distance = coal_requests(None)[0], coal.distance

    def work() -> None:
        for _ in range(500):
            distance(one, pose, two, fixed, request, result)

    return work, 500


def coal_collide(drawn: DrawnPair, tolerance: float | None) -> tuple[Work, int]:
    """Coal's collide from Python; the pairs are apart, so nothing has to be cleared."""
    import coal

    ((one, two), poses), fixed, result = coal_scene(drawn), coal.Transform3s(), coal.CollisionResult()
    request, collide = coal_requests(tolerance)[1], coal.collide

    def work() -> None:
        for pose in poses:
            collide(one, pose, two, fixed, request, result)

    assert not any(collide(one, pose, two, fixed, request, result) for pose in poses)
    return work, len(poses)


def batch(drawn: DrawnPair, threads: int, repeats: int = 1) -> tuple[Work, int]:
    """All curves of the pair in one call of `decision_curves`."""
    transforms = np.tile(drawn.transforms(POSES), (repeats, 1, 1))
    return partial(fo.decision_curves, *drawn.pair, transforms, box=BOX, threads=threads), len(transforms)


def batch_of_one_pose(drawn: DrawnPair) -> tuple[Work, int]:
    """Walk the same pose again and again, in one call: all branches of the walk are predicted."""
    transforms = np.tile(drawn.transforms(1), (POSES, 1, 1))
    return partial(fo.decision_curves, *drawn.pair, transforms, box=BOX, threads=1), len(transforms)


def kernel_of_all_poses(drawn: DrawnPair) -> tuple[Work, int]:
    """Call the compiled walk of all poses once: whole curves, proved and clipped, next to no Python."""
    from fcdm_opt.curve import kernels

    one, two = (body.parts[0] for body in drawn.pair)
    seeds, limits = np.array([one.seed, two.seed]), np.array(BOX, dtype=np.float64).ravel()
    bounds = DEFAULT.planarity, DEFAULT.point, DEFAULT.sign
    walk = partial(kernels.walk_many, *one.packed, *two.packed, drawn.transforms(POSES), seeds, limits, *bounds)
    return walk, POSES


def kernel(drawn: DrawnPair) -> tuple[Work, int]:
    """Call the compiled walk of one pose, again and again: the whole curve, unclipped, and the call from Python."""
    from fcdm_opt.curve import kernels

    (one, two), (T,) = (body.parts[0] for body in drawn.pair), drawn.transforms(1)
    walk, arguments = kernels.walk, (*one.packed, *two.packed, T, one.seed, two.seed, DEFAULT.planarity)

    def work() -> None:
        for _ in range(POSES):
            walk(*arguments)

    assert walk(*arguments)[0] == kernels.WALKED
    return work, POSES


def curve_object(drawn: DrawnPair, wanted: str) -> tuple[Work, int]:
    """`decision_curve` from Python, and what is `wanted` of it, so that the curve has been computed."""
    transforms = drawn.transforms(50)

    def work() -> None:
        for T in transforms:
            getattr(fo.decision_curve(*drawn.pair, box=BOX, transform=T), wanted)

    return work, len(transforms)


def rival(drawn: DrawnPair, name: str, count: int, setting: str | None = None) -> tuple[Work, int]:
    """Answer by a method of `measure.curves`, prepared once for the pair, at its finest setting unless one is named."""
    (method,) = (method for method in METHODS if method.name == name)
    value = method.settings[setting] if setting else list(method.settings.values())[-1]
    return partial(method.prepare(drawn.pair, value), [drawn.curve(k) for k in range(count)]), count


def _whole_curve(vertices: int) -> float:
    return 0.5 if vertices <= 100 else 1.0


def _from_python(vertices: int) -> float | None:
    return 15.0 if vertices == 12 else None


BOTH = ("round", "long")
BISECTION, CLARABEL = "coal bisection", "Clarabel (cvxpy)"
CONTENDERS = (
    Contender("coal distance", COAL, coal_distance, shapes=BOTH),
    Contender("coal distance, 1e-12", COAL, partial(coal_distance, tolerance=TIGHT)),
    Contender("coal collide", COAL, partial(coal_collide, tolerance=None)),
    Contender("coal collide, 1e-12", COAL, partial(coal_collide, tolerance=TIGHT)),
    Contender("kernel", CURVE, kernel_of_all_poses, shapes=BOTH, target=_whole_curve),
    Contender("decision_curves, 1 thread", CURVE, partial(batch, threads=1), shapes=BOTH),
    Contender("decision_curves, 1 thread, 50,000 poses", CURVE, partial(batch, threads=1, repeats=100), sizes=(12,)),
    Contender("decision_curves, 2 threads", CURVE, partial(batch, threads=2, repeats=10)),
    Contender("decision_curves, one pose", CURVE, batch_of_one_pose, poses="one"),
    Contender("kernel, one pose a call", CURVE, kernel, shapes=BOTH, poses="one"),
    Contender("decision_curve", CURVE, partial(curve_object, wanted="status"), target=_from_python),
    Contender("decision_curve, all segments", CURVE, partial(curve_object, wanted="segments")),
    Contender(
        "coal bisection", RIVAL, partial(rival, name="coal bisection", count=4, setting="33 rays, 1e-12"), rounds=8
    ),
    *(
        Contender(name, RIVAL, partial(rival, name=name, count=4), rounds=8)
        for name in ("coal distance + Newton", "growth distances", "HiGHS, warm")
    ),
    Contender(CLARABEL, RIVAL, partial(rival, name=CLARABEL, count=1), sizes=(8, 12, 20, 100), rounds=5),
)
