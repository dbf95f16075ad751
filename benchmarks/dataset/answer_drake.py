"""Answer the data set with Drake: inverse kinematics with SNOPT from 20 starts, least amount kept.

    python answer_drake.py answers.json [--only WORD]

Needs drake. A motion's translations are prismatic joints, turns revolute ones about the seed, six parameters a
floating joint with a quaternion. Conditions are Drake's own: a distance constraint for each part pair, and for
touching unions its upper bound of the least distance. Nothing is proved, so the claim is "motion".
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import asking
import numpy as np
import score
from pydrake.common import MemoryFile
from pydrake.geometry import Convex, InMemoryMesh, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.inverse_kinematics import InverseKinematics, MinimumDistanceUpperBoundConstraint
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PrismaticJoint,
    QuaternionFloatingJoint,
    RevoluteJoint,
    ScrewJoint,
    SpatialInertia,
)
from pydrake.solvers import SnoptSolver, SolverOptions
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial import ConvexHull

STARTS = 20
FINE = 1e-6  # of the size: conditions that are missed by no more are taken as met
TIGHT = {"Major feasibility tolerance": 1e-7, "Major optimality tolerance": 1e-6}


def shape(corners: Any) -> Any:
    """Return the convex shape of some corners."""
    hull = ConvexHull(corners)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(corners, float).tolist()]
    lines += [f"f {i + 1} {j + 1} {k + 1}" for i, j, k in hull.simplices.tolist()]
    return Convex(InMemoryMesh(mesh_file=MemoryFile("\n".join(lines).encode(), ".obj", "part")))


class Scene:
    """A scene as a plant: its joints, and its geometries."""

    def __init__(self, scene: Mapping[str, Any]) -> None:
        self.scene, question = scene, scene["question"]
        builder = DiagramBuilder()
        plant = builder.AddSystem(MultibodyPlant(0.0))
        graph = builder.AddSystem(SceneGraph())
        plant.RegisterAsSourceForSceneGraph(graph)
        builder.Connect(graph.get_query_output_port(), plant.get_geometry_query_input_port())
        builder.Connect(plant.get_geometry_pose_output_port(), graph.get_source_pose_port(plant.get_source_id()))
        self.seed = np.array(scene["movable"]["seed"], float)
        inertia, still = SpatialInertia.SolidCubeWithDensity(1.0, 1.0), CoulombFriction(0.0, 0.0)
        base = plant.AddFrame(FixedOffsetFrame("base", plant.world_frame(), RigidTransform(self.seed)))
        steps, self.joints = question["motion"], []
        self.free = any("free" in step for step in steps)
        order = [k for k, step in enumerate(steps) if "translation" in step]
        order += [k for k in reversed(range(len(steps))) if "translation" not in steps[k]]
        parent, body = base, plant.world_body()
        for k in order:
            step = steps[k]
            body = plant.AddRigidBody(f"link {k}", inertia)
            child = body.body_frame()
            if "free" in step:
                joint = QuaternionFloatingJoint(f"joint {k}", parent, child)
            elif "translation" in step:
                joint = PrismaticJoint(f"joint {k}", parent, child, step["translation"])
            elif "rotation" in step:
                joint = RevoluteJoint(f"joint {k}", parent, child, step["rotation"])
            else:
                offset = RigidTransform(np.array(step["screw"]["point"], float) - self.seed)
                parent, child = (
                    plant.AddFrame(FixedOffsetFrame(name, own, offset))
                    for name, own in (("from", parent), ("to", child))
                )
                joint = ScrewJoint(
                    f"joint {k}", parent, child, step["screw"]["direction"], 2 * math.pi * step["pitch"], 0.0
                )
            self.joints.append((k, plant.AddJoint(joint)))
            parent = body.body_frame()
        place = RigidTransform(-self.seed)
        self.ones = [
            plant.RegisterCollisionGeometry(body, place, shape(own), f"one {k}", still)
            for k, own in enumerate(score.made(scene, "movable"))
        ]
        self.twos = [
            plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(), shape(own), f"two {k}", still)
            for k, own in enumerate(score.made(scene, "static"))
        ]
        plant.Finalize()
        self.plant, self.diagram = plant, builder.Build()

    def parameters(self, x: Any) -> list[float]:
        """Return the scene's parameters of the plant's positions."""
        if self.free:
            w, v = (x[0], x[1:4]) if x[0] >= 0 else (-x[0], -x[1:4])
            length = float(np.linalg.norm(v))
            turn = v * (2 * math.atan2(length, w) / length if length else 2.0)
            return [*map(float, x[4:7]), *map(float, turn)]
        places = {k: joint.position_start() for k, joint in self.joints}
        return [float(x[places[k]]) for k in range(len(places))]


def squared(size: float, length: float) -> Any:
    """Return the square of the amount of a floating joint's positions, in sizes."""

    def cost(x: Any) -> Any:
        square = sum(own * own for own in x[1:4])
        value = square if isinstance(square, float) else square.value()
        # (2 asin sqrt s)^2, whose derivative at 0 the formula does not have
        angle = (
            4 * square * (1 + square / 3 + 8 * square * square / 45)
            if value < 1e-3
            else 4 * np.arcsin(square**0.5) ** 2
        )
        return (sum(own * own for own in x[4:7]) + length**2 * angle) / size**2

    return cost


def least(scene: Mapping[str, Any], starts: int = STARTS) -> list[float] | None:
    """Return the least motion that the starts end with."""
    own, question, size = Scene(scene), scene["question"], score.size(scene)
    context = own.diagram.CreateDefaultContext()
    here = own.plant.GetMyMutableContextFromRoot(context)
    asked = InverseKinematics(own.plant, here, with_joint_limits=False)
    x, program = asked.q(), asked.get_mutable_prog()
    clearance, pairs = question.get("clearance", 0.0), [tuple(pair) for pair in question.get("pairs", ())]
    alone = len(own.ones) * len(own.twos) == 1
    for i, one in enumerate(own.ones):
        for j, two in enumerate(own.twos):
            touching = (i, j) in pairs or (alone and question["goal"] == "touch")
            asked.AddDistanceConstraint((one, two), clearance, clearance if touching else math.inf)
    if question["goal"] == "touch" and not alone:
        program.AddConstraint(MinimumDistanceUpperBoundConstraint(own.plant, 0.5 * FINE * size, here, 0.1 * size), x)
    weights = np.array(question["weights"])
    if own.free:
        program.AddCost(squared(size, question["length"]), x)
    else:
        places = [dict(own.joints)[k].position_start() for k in range(len(weights))]
        program.AddQuadraticCost(np.diag(2 * (weights / size) ** 2), np.zeros(len(weights)), x[places])
        for k, ends in enumerate(question.get("limits") or ()):
            if ends is not None:
                program.AddBoundingBoxConstraint(*ends, x[places[k]])
    options, solver, rng, found = SolverOptions(), SnoptSolver(), np.random.default_rng(0), []
    for key, value in TIGHT.items():
        options.SetOption(solver.id(), key, value)
    for k in range(starts):
        spread = (0.0, 0.01, 0.1)[min(k, 1 + k % 2)]
        if own.free:
            start = np.concatenate([[1.0], spread * rng.normal(size=3), spread * size * rng.normal(size=3)])
            start[:4] /= np.linalg.norm(start[:4])
        else:
            start = np.zeros(len(weights))
            start[places] = spread * size * rng.normal(size=len(weights)) / weights
        try:
            made = solver.Solve(program, start, options)
        except RuntimeError:  # of a gradient that a distance of zero does not have
            continue
        ends = made.GetSolution(x)
        # SNOPT often says that it cannot go on where all conditions are met: such motions count too
        if np.isfinite(ends).all() and (
            made.is_success() or program.CheckSatisfied(program.GetAllConstraints(), ends, FINE)
        ):
            found.append(own.parameters(ends))
    return min(found, key=lambda q: float(np.linalg.norm(np.array(q) * weights)), default=None)


def answered(scene: Mapping[str, Any]) -> asking.Answer:
    """Return the answer to a scene."""
    if scene["question"]["goal"] == "scale":
        return {"claim": "unknown", "said": "not asked: no joint scales a body"}
    q = least(scene)
    return {"claim": "unknown", "said": "found none"} if q is None else {"claim": "motion", "motion": q}


if __name__ == "__main__":
    tool = f"Drake {version('drake')}, SNOPT, {STARTS} starts"
    asking.asked_each(answered, "Answer the data set with Drake.", tool)
