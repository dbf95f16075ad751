"""The only part that knows the package: builds its question, asks, and returns plain data."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import fcdm_opt as fo
from fcdm_opt_benchmarks.attack.motions import MotionStep
from fcdm_opt_benchmarks.attack.scenes import FitScene
from fcdm_opt_benchmarks.attack.verdicts import Reply


def _step(step: MotionStep) -> Any:
    if step.kind == "T":
        return fo.Translation(_named(step.axis))
    if step.kind == "F":
        return fo.Free()
    if step.kind == "R":
        return fo.Rotation(_named(step.axis), "origin" if step.centre == (0.0, 0.0, 0.0) else step.centre)
    return fo.Screw("seeds" if step.axis is None else (step.centre, step.axis), step.pitch)


def _named(axis: Any) -> Any:
    """Return "x", "y", "z" where it is one of these: both ways of asking are used."""
    for name, unit in (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0)), ("z", (0.0, 0.0, 1.0))):
        if axis == unit:
            return name
    return axis


def _body(pieces: Any, seed: Any, name: str) -> Any:
    if len(pieces) == 1:
        return fo.Body.convex(pieces[0], seed=seed, name=name)
    return fo.Body.from_parts(pieces, seed=seed, name=name)


def problem(scene: FitScene) -> Any:
    """Return the package's question."""
    motion = _step(scene.steps[0])
    for step in scene.steps[1:]:
        motion = motion >> _step(step)
    names = [parameter.name for parameter in motion.parameters]
    sizes: dict[str, Any] = {"target": tuple(scene.target.tolist())}
    if scene.requirement is not None:
        sizes = {"requirement": scene.requirement, "tolerance": scene.tolerance}
    words: dict[str, Any] = {name: getattr(scene, name) for name in ("goal", "pair", "path", "amount")}
    return fo.Problem(
        _body(scene.fit.movable, scene.s1, "movable"),
        _body(scene.fit.static, scene.s2, "static"),
        nominal=scene.nominal,
        motion=motion,
        clearance=scene.clearance,
        **words,
        length=scene.length,
        weights={names[k]: weight for k, weight in scene.heavier.items()} or None,
        limits={names[k]: limit for k, limit in scene.limits.items()} or None,
        keep_out=tuple(
            fo.KeepOut(fo.Body.convex(block.corners, name=f"block {k}"), clearance=block.clearance)
            for k, block in enumerate(scene.keep_out)
        ),
        **sizes,
    )


def asked(scene: FitScene, **options: Any) -> Reply:
    """Ask the package; whatever it raises is an answer too."""
    start = time.perf_counter()
    try:
        question = problem(scene)
        solution = fo.solve(question, **options)
    except Exception as reason:  # an attack must outlive what it provokes
        return Reply("RAISED", None, np.nan, 0.0, None, None, None, np.nan, f"{type(reason).__name__}: {reason}")
    checks = () if solution.certificate is None else solution.certificate.failed
    return Reply(
        solution.status.name,
        np.array(list(solution.parameters.values())) if solution.parameters else None,
        solution.amount,
        solution.lower_bound,
        solution.transform,
        np.asarray(question.target),
        np.asarray(solution.pair),
        solution.pair_gap,
        "; ".join(f"{check.name} ({check.value:.3g}, limit {check.limit:.3g})" for check in checks),
        time.perf_counter() - start,
    )
