"""Ten inputs at which methods that people trust give something else than they expect: makes the numbers of the page.

    python benchmarks/where_methods_fail.py [--only N]

Prints for each what is asked, what is true, and what came back, with versions. A library that is missing is said.
"""

from __future__ import annotations

import argparse
import ctypes
import math
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from fcdm_opt_benchmarks.library import MissingLibraryError, dataset_script, library, rounding_upward
from fcdm_opt_benchmarks.shapes import box, polygon, prism


def near_touch() -> str:
    """Ask coal's distance of 200 pairs of hulls, half of them 1e-8 apart, half overlapping by as much."""
    from fcdm_opt_benchmarks.coal_shapes import CoalHulls

    score, rng = dataset_script("score"), np.random.default_rng(1)
    wrong: dict[float | None, int] = {None: 0, 1e-12: 0}
    for k in range(200):
        P, Q = rng.normal(size=(12, 3)), rng.normal(size=(12, 3)) + np.array([4.0, 1.0, 1.0])
        near = CoalHulls(P, Q, 1e-12)
        gap = near.gap()
        Q -= (gap - 1e-8 * (-1) ** k) * np.array(near.result.normal)
        true = score.separation(score.part(P), score.part(Q))
        for tolerance in wrong:
            wrong[tolerance] += CoalHulls(P, Q, tolerance).gap() * true <= 0
    return f"wrong sign, or 0, at its own tolerance {wrong[None]} of 200; at 1e-12 {wrong[1e-12]} of 200"


def hollow() -> str:
    """Put a cube of side 1 into the middle of one of side 4, both as meshes (BVH) of coal: they overlap."""
    coal = library("coal")
    from fcdm_opt import Body
    from fcdm_opt_benchmarks.coal_shapes import coal_surface

    small, large = (Body.convex(box([-h] * 3, [h] * 3), name=str(h)) for h in (0.5, 2.0))
    pose, result = coal.Transform3s(), coal.CollisionResult()
    hit = coal.collide(coal_surface(small), pose, coal_surface(large), pose, coal.CollisionRequest(), result)
    gap = coal.distance(
        coal_surface(small), pose, coal_surface(large), pose, coal.DistanceRequest(), coal.DistanceResult()
    )
    return f"collide: {bool(hit)}; distance {gap:g}; true: they overlap"


def kept() -> str:
    """Ask coal for two distances, 0.1 and then 0.5, into one result without clear()."""
    coal = library("coal")
    from fcdm_opt_benchmarks.coal_shapes import coal_hull

    cube, pose, result = coal_hull(box([0] * 3, [1] * 3)), coal.Transform3s(), coal.DistanceResult()
    found = []
    for away in (0.1, 0.5):
        there = coal.Transform3s(np.eye(3), np.array([1.0 + away, 0.0, 0.0]))
        returned = coal.distance(cube, pose, cube, there, coal.DistanceRequest(), result)
        found.append(f"returned {returned:g}, result.min_distance {result.min_distance:g}")
    return "; ".join(found)


def stationary() -> str:
    """Find the least t^2 with cos t = 0.9 from t = 0, where no step changes the condition: acos 0.9 = 0.451."""
    from scipy.optimize import minimize

    slsqp = minimize(
        lambda t: t @ t,
        [0.0],
        jac=lambda t: 2 * t,
        method="SLSQP",
        constraints={"type": "eq", "fun": lambda t: np.cos(t) - 0.9, "jac": lambda t: -np.sin(t)[None]},
    )
    casadi = library("casadi")
    t = casadi.SX.sym("t")
    quiet = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False}
    solver = casadi.nlpsol("s", "ipopt", {"x": t, "f": t * t, "g": casadi.cos(t) - 0.9}, quiet)
    made = solver(x0=0.0, lbg=0.0, ubg=0.0)
    said = solver.stats()["return_status"]
    return f"SLSQP: t = {slsqp.x[0]:g}, {slsqp.message!r}; IPOPT: t = {float(made['x']):.6g}, {said}"


def another_root() -> str:
    """Find the least t^2 with tan(t / 2) = 5, from t = 0 and from 4: 2 atan 5 = 2.7468."""
    casadi = library("casadi")
    t = casadi.SX.sym("t")
    quiet = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False}
    solver = casadi.nlpsol("s", "ipopt", {"x": t, "f": t * t, "g": casadi.tan(t / 2) - 5.0}, quiet)
    found = []
    for start in (0.0, 4.0):
        made = solver(x0=start, lbg=0.0, ubg=0.0)
        found.append(f"from {start:g}: {float(made['x']):.6g}, {solver.stats()['return_status']}")
    return "IPOPT " + "; ".join(found)


def hardly_infeasible() -> str:
    """Find x <= 1 with x >= 1 + 5e-8: there is none."""
    from fcdm_opt_benchmarks.library import dense, highs_model, highs_solver

    said = []
    for tolerance in (None, 1e-10):
        solver = highs_solver(tolerance)
        rows = np.array([-np.inf, 1.0 + 5e-8]), np.array([1.0, np.inf])
        solver.passModel(highs_model(dense(np.array([[1.0], [1.0]])), np.array([1.0]), rows))
        solver.run()
        said.append(solver.modelStatusToString(solver.getModelStatus()))
    return f"HiGHS: {said[0]} at its own tolerance, {said[1]} at 1e-10"


def called_optimal() -> str:
    """Bring the pairs of Example 1 to touch with six parameters: what is proved least, what SCIP calls optimal."""
    import fcdm_opt as fo
    from fcdm_opt.model.task import Task
    from fcdm_opt_benchmarks.motions import outside

    library("pyscipopt")
    found = []
    for letter in range(4):
        problem = fo.load_problems("problems/example1_touch.toml")[letter].changed(motion=fo.Free(), published=None)
        own = fo.solve(problem, certify=True, seconds=20)
        q = outside.scip(problem, Task.of(problem), 1e-6)
        if q is not None:
            task = Task.of(problem)
            amount, gap = task.amount(q), task.gap(q)
            found.append(f"{problem.requirement}: proved at least {own.lower_bound:.7g}, SCIP {amount:.7g} "
                         f"({amount / own.lower_bound - 1:+.1%}), gap left {gap:.1e}")  # fmt: skip
    return "; ".join(found)


def separated_meshes() -> str:
    """Ask MuJoCo's distance of 600 pairs of small hulls: how often it is 0 where they are apart, how far it is off."""
    library("mujoco")
    from fcdm_opt_benchmarks.stability.contacts.methods import mujoco_distance

    score, rng, zero, worst = dataset_script("score"), np.random.default_rng(7), 0, 0.0
    for _ in range(600):
        clouds = [rng.normal(size=(rng.integers(5, 30), 3)) * rng.uniform(0.02, 0.3, 3) for _ in range(2)]
        clouds[1] += rng.normal(size=3) * 0.5
        one, two = map(score.part, clouds)
        gap = score.separation(one, two)
        data = {key: {"vertices": own.tolist(), "seed": [0, 0, 0], "parts": None}
                for key, own in zip(("one", "two"), clouds, strict=True)}  # fmt: skip
        found = mujoco_distance({**data, "transform": np.eye(4), "rho": [1.0, 1.0]})["gap"]
        true = score.distance(one, two) if gap > 0 else gap
        zero += gap > 1e-3 and found == 0
        worst = max(worst, abs(found - true))
    return f"MuJoCo {version('mujoco')}: 0 in {zero} of 600, farthest off {worst:.2g}"


def rounded_upward() -> str:
    """Import codac, and add."""
    system = ctypes.CDLL(None)
    before = system.fegetround()
    with rounding_upward():
        system.fesetround(before)
        library("codac")
        library("codac").cos(library("codac").Interval(0, 1))
        after, total = system.fegetround(), sum([0.1] * 1000)
    return f"rounding mode {before} before, {after} after; 0.1 a thousand times {total!r}, before {sum([0.1] * 1000)!r}"


def hull_of_a_hole() -> str:
    """Put a peg of radius 9.5 into a ring with a hole of radius 10, one mesh: they are 0.5 apart."""
    geometry, math_ = library("pydrake.geometry"), library("pydrake.math")
    trimesh = library("trimesh")
    ring = trimesh.creation.annulus(10.0, 16.0, 20.0, sections=64)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in ring.vertices.tolist()]
    lines += [f"f {i + 1} {j + 1} {k + 1}" for i, j, k in ring.faces.tolist()]
    file = library("pydrake.common").MemoryFile("\n".join(lines).encode(), ".obj", "ring")
    shapes = (
        geometry.Mesh(geometry.InMemoryMesh(mesh_file=file)),
        dataset_script("answer_drake").shape(prism(9.5 * polygon(64), -15, 15)),
    )
    graph = geometry.SceneGraph()
    source = graph.RegisterSource("scene")
    frame = graph.RegisterFrame(source, geometry.GeometryFrame("peg"))
    for place, own in zip((graph.world_frame_id(), frame), shapes, strict=True):
        made = geometry.GeometryInstance(math_.RigidTransform(), own, str(place))
        made.set_proximity_properties(geometry.ProximityProperties())
        graph.RegisterGeometry(source, place, made)
    context, still = graph.CreateDefaultContext(), geometry.FramePoseVector()
    still.set_value(frame, math_.RigidTransform())
    graph.get_source_pose_port(source).FixValue(context, library("pydrake.common.value").Value(still))
    (found,) = graph.get_query_output_port().Eval(context).ComputeSignedDistancePairwiseClosestPoints()
    true = 10 * math.cos(math.pi / 64) - 9.5
    return f"Drake: {found.distance:.4g}; true: about {true:.3g}"


INPUTS: tuple[Callable[[], str], ...] = (
    near_touch,
    hollow,
    kept,
    hull_of_a_hole,
    separated_meshes,
    stationary,
    another_root,
    hardly_infeasible,
    called_optimal,
    rounded_upward,
)
"""In the order of the page."""

PACKAGES = ("coal", "scipy", "casadi", "highspy", "pyscipopt", "mujoco", "codac", "drake")


def main() -> None:
    """Ask all ten, or one."""
    asked = argparse.ArgumentParser(description="Make the numbers of the page on where methods fail.")
    asked.add_argument("--only", type=int, choices=range(1, len(INPUTS) + 1))
    given = asked.parse_args()
    for number, own in enumerate(INPUTS, 1):
        if given.only in (None, number):
            try:
                said: Any = own()
            except MissingLibraryError as reason:
                said = reason
            print(f"{number}. {own.__doc__}\n   {said}")
    known = []
    for name in PACKAGES:
        try:
            known.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            known.append(f"{name} not installed")
    print(", ".join(known))


if __name__ == "__main__":
    main()
