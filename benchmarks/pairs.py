"""Random pairs for the benchmarks: hulls of a given number of vertices, separated, in many poses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fcdm_opt.geometry.bodies import Body
from fcdm_opt.measure.rivals import Solid, growth_distance

BOX = ((0.8, 3.0), (0.8, 3.0))
SIZES = (8, 12, 20, 100, 1000, 10000)
GROWTH = (1.1, 2.0)  # growth distances of the poses: apart as drawn, and the curve crosses the box
# Round hulls keep the direction of contact at all scales, so their curves have few segments however many vertices there
# are. Long ones do not: the more vertices, the more segments.
AXES = {"round": (1.0, 1.0, 1.0), "long": (1.0, 0.75, 0.5)}


def random_hull(rng: np.random.Generator, vertices: int) -> np.ndarray:
    """Points on the unit sphere with radial noise, exactly `vertices` of them, each a corner of their hull.

    The noise is half the spacing's sagitta, so that nearly all points stay corners; the others are drawn again.
    """
    from scipy.spatial import ConvexHull

    points = np.empty((0, 3))
    while len(points) < vertices:
        directions = rng.normal(size=(vertices - len(points), 3))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        noise = rng.uniform(-0.5, 0.5, len(directions)) / vertices
        points = np.vstack([points, directions * (1 + noise)[:, None]])
        points = points[np.sort(ConvexHull(points).vertices)]
    return points


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    """Rotation matrix, uniform."""
    w, x, y, z = (q := rng.normal(size=4)) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def random_pose(rng: np.random.Generator, movable: Body, static: Body) -> np.ndarray:
    """Transform that turns body 1 at random and puts it on any side of body 2, at a random growth distance."""
    way, rho = rng.normal(size=3), np.ones(2)
    one, two, R = Solid.of(movable), Solid.of(static), random_rotation(rng)
    touch = growth_distance(one.vertices @ R.T, two.vertices, way, rho, (one.inner + two.inner) / 2)
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = static.seed - way * rng.uniform(*GROWTH) / touch.point[0] - R @ movable.seed
    return T


@dataclass(frozen=True, eq=False)
class RandomPair:
    """Two random hulls, seeds at their centroids, and transforms that separate them; coal's objects for the same."""

    movable: Body
    static: Body
    transforms: np.ndarray

    @classmethod
    def of(cls, seed: int, vertices: int, poses: int, family: str = "round") -> RandomPair:
        """Draw a pair of hulls with axes in the ratio of a family."""
        rng = np.random.default_rng([seed, vertices])
        hulls = [random_hull(rng, vertices) * AXES[family] for _ in range(2)]
        movable, static = (Body.convex(hull, name=name) for hull, name in zip(hulls, ("one", "two"), strict=True))
        made = cls(movable, static, np.array([random_pose(rng, movable, static) for _ in range(poses)]))
        assert all(len(body.parts[0].vertices) == vertices for body in (movable, static))
        return made

    @cached_property
    def shapes(self) -> tuple[Any, Any]:
        """Both hulls for coal, as drawn."""
        return coal_hull(self.movable.vertices), coal_hull(self.static.vertices)

    @cached_property
    def poses(self) -> list[Any]:
        """The transforms for coal."""
        import coal

        made = []
        for T in self.transforms:
            pose = coal.Transform3s()
            pose.setRotation(T[:3, :3])
            pose.setTranslation(T[:3, 3])
            made.append(pose)
        return made


def coal_hull(points: np.ndarray) -> Any:
    """Return a convex shape of coal."""
    import coal

    vectors = coal.StdVec_Vec3s()
    vectors.extend(list(points))
    return coal.Convex.convexHull(vectors, True, "Qt")


def coal_requests(tolerance: float | None) -> tuple[Any, Any]:
    """Return settings of coal's distance and collide: its defaults, or another tolerance."""
    import coal

    requests = coal.DistanceRequest(), coal.CollisionRequest()
    if tolerance is not None:
        for request in requests:
            request.gjk_tolerance = request.epa_tolerance = tolerance
    return requests
