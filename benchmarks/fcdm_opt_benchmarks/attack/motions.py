"""Rigid motions of the scenes, in arithmetic of their own: steps, poses, weights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from fcdm_opt_benchmarks.shapes import Array

Point = tuple[float, float, float]


@dataclass(frozen=True)
class MotionStep:
    """One step of a motion.

    Attributes
    ----------
    kind : "T", "R", "S" or "F"
        Translation along, rotation about, screw about, anything.
    axis : (3,) or None
        Direction, world frame; None for a screw about the line from the movable seed, as moved, to the static one.
    centre : "seed" or (3,)
        Point of a rotation's or a screw's axis; "seed" is the movable one as moved so far.
    pitch : float or "free"
        Of a screw: length per radian.
    """

    kind: str
    axis: Point | None = None
    centre: Any = "seed"
    pitch: Any = 0.0

    @property
    def turns(self) -> tuple[bool, ...]:
        """Which of the step's parameters are angles."""
        if self.kind == "S":
            return (False, True) if self.pitch == "free" else (True,)
        return {"T": (False,), "R": (True,), "F": (False,) * 3 + (True,) * 3}[self.kind]

    def weights(self, length: float) -> tuple[float, ...]:
        """Weights of the parameters in the amount; `length` turns radians into lengths."""
        if self.kind == "S" and self.pitch != "free":
            return (float(np.hypot(self.pitch, length)),)
        return tuple(length if turn else 1.0 for turn in self.turns)

    def placed(self, R: Array, t: Array) -> MotionStep:
        """Return the step as it is after the whole scene is moved by x -> R x + t."""
        axis = None if self.axis is None else tuple((R @ np.array(self.axis)).tolist())
        centre = self.centre if self.centre == "seed" else tuple((R @ np.array(self.centre) + t).tolist())
        return MotionStep(self.kind, axis, centre, self.pitch)


Steps = tuple[MotionStep, ...]


def turns(steps: Steps) -> Any:
    """Return which parameters are angles, (k,)."""
    return np.array([turn for step in steps for turn in step.turns])


def weights(steps: Steps, length: float) -> Array:
    """Return the weights of all parameters, (k,)."""
    return np.array([weight for step in steps for weight in step.weights(length)])


def poses(steps: Steps, Q: Any, movable: Array, static: Array) -> tuple[Array, Array]:
    """Return R (N, 3, 3) and t (N, 3) of x -> R x + t for parameters (N, k) and the seeds at rest."""
    rows = np.atleast_2d(np.asarray(Q, dtype=np.float64))
    R, t = np.broadcast_to(np.eye(3), (len(rows), 3, 3)), np.zeros((len(rows), 3))
    start = 0
    for step in steps:
        q = rows[:, start : start + len(step.turns)]
        start += len(step.turns)
        seed = R @ movable + t
        turn, shift = _step(step, q, seed, static)
        R, t = turn @ R, np.einsum("nij,nj->ni", turn, t) + shift
    return R, t


def _step(step: MotionStep, q: Array, seed: Array, static: Array) -> tuple[Array, Array]:
    if step.kind == "T":
        axis = np.array(step.axis) / np.linalg.norm(step.axis or 0.0)
        return np.broadcast_to(np.eye(3), (len(q), 3, 3)), q * axis
    if step.kind == "F":
        R, centre, along = Rotation.from_rotvec(q[:, 3:]).as_matrix(), seed, q[:, :3]
    else:
        axis = static - seed if step.axis is None else np.broadcast_to(np.array(step.axis), seed.shape)
        axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
        if step.kind == "R":
            angle, slide = q[:, :1], np.zeros((len(q), 1))
        elif step.pitch == "free":
            slide, angle = q[:, :1], q[:, 1:]
        else:
            angle, slide = q, q * step.pitch
        R, along = Rotation.from_rotvec(angle * axis).as_matrix(), slide * axis
        centre = seed if step.axis is None or step.centre == "seed" else np.broadcast_to(step.centre, seed.shape)
    return R, centre - np.einsum("nij,nj->ni", R, centre) + along
