"""The only part that knows the package: builds its question, asks, and returns plain data."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

import fcdm_opt as fo
from fcdm_opt_benchmarks.attack.motions import MotionStep
from fcdm_opt_benchmarks.attack.raw_scenes import RawScene
from fcdm_opt_benchmarks.attack.raw_solids import RawSolid
from fcdm_opt_benchmarks.attack.raw_verdicts import RawReply
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


def _motion(steps: Any) -> Any:
    motion = _step(steps[0])
    for step in steps[1:]:
        motion = motion >> _step(step)
    return motion


def _body(pieces: Any, seed: Any, name: str) -> Any:
    if len(pieces) == 1:
        return fo.Body.convex(pieces[0], seed=seed, name=name)
    return fo.Body.from_parts(pieces, seed=seed, name=name)


def problem(scene: FitScene) -> Any:
    """Return the package's question."""
    motion = _motion(scene.steps)
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


# ------------------------------------------------------------------------------------------------------ raw scenes


def _raw_body(own: RawSolid, name: str, scene: RawScene) -> Any:
    if name in scene.files or scene.kept == "single":
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / (f"{name}.step" if name in scene.files else f"{name}.stl")
            if name in scene.files:
                file.write_text(scene.files[name])
            else:
                trimesh.Trimesh(own.vertices, own.triangles, process=False).export(file)
            return fo.Body.from_file(file, unit="mm", seed=own.seed, name=name)
    how: Any = "surface" if scene.kept == "surface" else "auto"
    return fo.Body.from_mesh(own.vertices, own.triangles, decomposition=how, seed=own.seed, name=name)


def _raw_question(scene: RawScene) -> Any:
    """Return the package's question: a problem of two parts, or an assembly."""
    bodies = {part: _raw_body(own, part, scene) for part, own in scene.parts.items()}
    motions = {part: _motion(steps) for part, steps in scene.steps.items()}
    limits = None
    if scene.limit is not None:
        limits = {
            part: {parameter.name: (-scene.limit, scene.limit) for parameter in motion.parameters}
            for part, motion in motions.items()
        }
    if set(bodies) != {"movable", "static"}:
        order = list(bodies)
        joined: list[Any] = list(pairwise(order))[: len(motions)]
        if scene.goal != "at":
            joined = [{"parts": pair, "goal": scene.goal} for pair in joined]
        return fo.Assembly(bodies, joined, motions=motions, scales=scene.scales, limits=limits)
    sizes = [
        fo.Size(own.name, own.part, faces=[{"through": x} for x in own.through], each=own.each, tolerance=own.most)
        for own in scene.sizes
    ]
    kept = tuple(fo.KeepOut(_raw_body(own, f"block {k}", scene)) for k, own in enumerate(scene.keep_out))
    more: dict[str, Any] = {"goal": scene.goal, "contacts": scene.contacts}
    if sizes:
        more |= {"sizes": sizes, "made": {own.name: own.made for own in scene.sizes}}
    if not sizes:
        more["target"] = scene.scales["movable"], scene.scales["static"]
    return fo.Problem(
        bodies["movable"],
        bodies["static"],
        motion=motions["movable"],
        limits=limits["movable"] if limits else None,
        keep_out=kept,
        unit="mm",
        **more,
    )


def asked_raw(scene: RawScene, **options: Any) -> RawReply:
    """Ask the package; whatever it raises is an answer too."""
    start = time.perf_counter()
    try:
        question = _raw_question(scene)
        answer: Any
        if isinstance(question, fo.Assembly):
            answer = fo.solve_assembly(question, **options)
            poses: Mapping[str, Any] = answer.transforms
        else:
            answer = fo.solve(question, **options)
            poses = {} if answer.transform is None else {"movable": answer.transform}
    except Exception as reason:  # an attack must outlive what it provokes
        return RawReply("RAISED", False, advice=f"{type(reason).__name__}: {reason}")
    checks = () if answer.certificate is None else answer.certificate.failed
    low, high = (getattr(answer, key, answer.amount) for key in ("amount_low", "amount_high"))
    return RawReply(
        answer.status.name,
        answer.usable,
        answer.amount,
        answer.lower_bound,
        answer.amount if low is None else low,
        answer.amount if high is None else high,
        {part: np.asarray(pose) for part, pose in poses.items()},
        "; ".join(f"{check.name} ({check.value:.3g}, limit {check.limit:.3g})" for check in checks),
        time.perf_counter() - start,
    )
