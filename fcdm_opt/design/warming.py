"""Questions on small bodies that need, between them, the numerical kernels of all commands."""

from __future__ import annotations

from itertools import product

import numpy as np
from manifold3d import Manifold

from fcdm_opt import compiling
from fcdm_opt.along.coherent_range import coherent_range
from fcdm_opt.curve.batch import decision_curves
from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.design.compensation.compensation_map import compensation_map
from fcdm_opt.design.fixed_pose.best_pose import best_pose
from fcdm_opt.design.stack.stack_up import stack_up
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.primitives import Box, Cylinder, cut
from fcdm_opt.geometry.size import Size
from fcdm_opt.motion.motions import Free, Motion, Rotation, Translation
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Solution
from fcdm_opt.solver import solve

ASIDE, TURN = Translation("x"), Rotation("z", centre="origin")


def shared() -> None:
    """Ask what needs the kernels of curves, shifts and the judge: those that all other questions need, too."""
    compiling.eager()
    solve(_larger(ASIDE), certify=True)


def moved() -> Solution:
    """Ask what needs the kernels of motions and their proofs; return the last answer."""
    compiling.eager()
    wedge = Body.convex([(0, 0, 0), (2, 0.3, 0), (0.4, 1.7, 0), (0.6, 0.5, 1.9)], name="wedge")
    stone = Body.convex([(3, 0.2, -0.4), (5, 0, 0), (4.2, 1.9, 0.1), (4, 0.6, 2.2), (3.4, 1.1, 1.3)], name="stone")
    beyond, far = (
        Problem(wedge, stone, nominal=1, tolerance=tolerance, requirement="B", motion=ASIDE >> TURN)
        for tolerance in (0.01, 0.3)
    )
    coherent_range(beyond, {"TX": 1.0})
    for problem in (beyond, far, *(_larger(motion) for motion in (TURN, Translation("y") >> TURN, Free()))):
        solution = solve(problem, certify=True, seconds=1.0)
    return solution


def sized() -> None:
    """Ask what needs the kernels of unions, faces on faces, sizes, poses, maps and bodies kept as surfaces."""
    compiling.eager()
    peg, plate = _bodies()
    asked = Problem(peg, plate, tolerance=0.01, requirement="A", goal="touch", motion=ASIDE)
    best_pose(asked)  # what takes longest first: who has solved a problem may ask for it next
    curve = decision_curve(peg, plate)
    _ = curve.crossings(1.02), curve.chains
    block, floor = Body.convex(_box((-1, -1, 0), (1, 1, 3))), Body.convex(_box((-3, -3, -1), (3, 3, 0)))
    decision_curves(block, floor, np.eye(4)[None])
    anywhere = ASIDE >> Translation("y") >> Translation("z")
    solve(Problem(peg, plate, target=(1.06, 1.0), goal="clear", clearance=0.01, motion=anywhere))
    resting = Problem(block, floor, target=(0.98, 1.0), goal="seat", motion=Translation("z"))
    resting.curve.contact_points((1.0, 1.0))
    solve(resting)
    compensation_map(asked, error=0.1)
    width = Size("width", "movable", faces="+x", tolerance=0.01)
    stack_up(Problem(peg, plate, sizes=[width], goal="touch", motion=ASIDE)).gap({"width": 0.01})
    mesh = (Manifold.cube([10.0, 10.0, 2.0], True) - Manifold.cylinder(4.0, 1.6, 1.6, 24, True)).to_mesh64()
    corners, triangles = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts)
    surface = Body.from_mesh(corners, triangles, decomposition="surface", name="slab")
    solve(Problem(peg, surface, target=(1.06, 1.0), goal="touch", motion=ASIDE))
    pin, bore = Cylinder(0.9, 2.0, facets=12), Cylinder(1.0, 2.0, base=(0.0, 0.0, -0.5), facets=12)
    block = cut(Box((4.0, 4.0, 1.0), centre=(0.0, 0.0, 0.5)), bore, name="block")
    solve(Problem(pin, block, target=(1.0, 1.0), goal="touch", motion=ASIDE))


def _larger(motion: Motion) -> Problem:
    """Return what a motion is to do with a peg that came out too large for its hole."""
    return Problem(*_bodies(), target=(1.06, 1.0), goal="touch", motion=motion)


def _bodies() -> tuple[Body, Body]:
    """Return a peg, and a plate of four walls around it, a little wider."""
    w = 1.05
    walls = [((-5, -5, 0), (-w, 5, 2)), ((w, -5, 0), (5, 5, 2)), ((-w, -5, 0), (w, -w, 2)), ((-w, w, 0), (w, 5, 2))]
    return Body.convex(_box((-1, -1, 0.5), (1, 1, 4)), name="peg"), Body.from_parts([_box(*wall) for wall in walls])


def _box(low: tuple[float, ...], high: tuple[float, ...]) -> list[tuple[float, ...]]:
    return list(product(*zip(low, high, strict=True)))
