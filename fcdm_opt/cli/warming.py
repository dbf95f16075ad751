"""`warmup`: all numerical kernels are compiled at once, on all cores, so that no later command waits for them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from itertools import product
from time import perf_counter
from typing import TYPE_CHECKING, Any

import typer

from fcdm_opt import beside, pacing

if TYPE_CHECKING:
    from fcdm_opt.geometry.bodies import Body


def warmup_command() -> None:
    """Compile the numerical kernels now and keep them: other commands do so when they first need one.

    A minute or two the first time, on two cores; a few seconds where all are kept already.
    """
    start = perf_counter()
    with pacing.working_on("warmup"):
        pacing.at("compiling numerical kernels that all commands share")
        _shared()
        groups = _moved, _sized
        for done, result in enumerate(beside.each(_asked, groups), 1):
            result()
            pacing.at("compiling numerical kernels", done, len(groups))
        for ask in groups:  # what both compiled is kept of one, which code of the other may not fit
            ask()
    typer.echo(f"the numerical kernels are compiled and kept for later runs, in {perf_counter() - start:.0f} s")


def _asked(ask: Callable[[], None]) -> None:
    ask()


def _shared() -> None:
    """Ask what needs the kernels of curves, shifts and the judge."""
    import fcdm_opt as fo

    peg, plate = _bodies()
    fo.solve(fo.Problem(peg, plate, target=(1.06, 1.0), goal="touch", motion=fo.Translation("x")), certify=True)


def _moved() -> None:
    """Ask what needs the kernels of motions, their proofs and pictures."""
    import fcdm_opt as fo
    from fcdm_opt.show.album import solution_figure

    peg, plate = _bodies()
    wedge = fo.Body.convex([(0, 0, 0), (2, 0.3, 0), (0.4, 1.7, 0), (0.6, 0.5, 1.9)], name="wedge")
    stone = fo.Body.convex([(3, 0.2, -0.4), (5, 0, 0), (4.2, 1.9, 0.1), (4, 0.6, 2.2), (3.4, 1.1, 1.3)], name="stone")
    turn = fo.Rotation("z", centre="origin")
    beyond = fo.Problem(wedge, stone, nominal=1, tolerance=0.01, requirement="B", motion=fo.Translation("x") >> turn)
    fo.coherent_range(beyond, {"TX": 1.0})
    away: dict[str, Any] = {"target": (1.06, 1.0), "goal": "touch"}
    motions = turn, fo.Translation("y") >> turn, fo.Free()
    for problem in (beyond, *(fo.Problem(peg, plate, motion=motion, **away) for motion in motions)):
        solution = fo.solve(problem, certify=True, seconds=1.0)
    with suppress(fo.InputError):  # pictures are an extra
        solution_figure(solution)


def _sized() -> None:
    """Ask what needs the kernels of sizes, poses, maps, surfaces and assemblies."""
    from manifold3d import Manifold

    import fcdm_opt as fo

    peg, plate = _bodies()
    aside = fo.Translation("x")
    asked = fo.Problem(peg, plate, tolerance=0.01, requirement="A", goal="touch", motion=aside)
    fo.compensation_map(asked, error=0.1)
    fo.best_pose(asked)
    width = fo.Size("width", "movable", faces="+x", tolerance=0.01)
    fo.stack_up(fo.Problem(peg, plate, sizes=[width], goal="touch", motion=aside)).gap({"width": 0.01})
    contact = {"parts": ["peg", "plate"], "goal": "touch"}
    fo.solve_assembly(fo.Assembly({"peg": peg, "plate": plate}, [contact], motions={"peg": aside}))
    slab = Manifold.cube([10.0, 10.0, 2.0], True) - Manifold.cylinder(4.0, 1.6, 1.6, 24, True)
    mesh = slab.to_mesh64()
    surface = fo.Body.from_mesh(mesh.vert_properties, mesh.tri_verts, decomposition="surface", name="slab")
    fo.solve(fo.Problem(peg, surface, target=(1.06, 1.0), goal="touch", motion=aside))


def _bodies(**more: Any) -> tuple[Body, Body]:
    """Return a peg, and a plate of four walls around it, a little wider."""
    from fcdm_opt.geometry.bodies import Body

    def box(low: tuple[float, ...], high: tuple[float, ...]) -> list[tuple[float, ...]]:
        return list(product(*zip(low, high, strict=True)))

    w = 1.05
    walls = [((-5, -5, 0), (-w, 5, 2)), ((w, -5, 0), (5, 5, 2)), ((-w, -5, 0), (w, -w, 2)), ((-w, w, 0), (w, 5, 2))]
    plate = Body.from_parts([box(*wall) for wall in walls], name="plate", **more)
    return Body.convex(box((-1, -1, 0.5), (1, 1, 4)), name="peg"), plate
