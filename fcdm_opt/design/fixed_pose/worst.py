"""What is made small: how far the worst gap of all sizes is off a window, as a function of the pose."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fcdm_opt.design.fixed_pose.scene import Extremes, Lines, Scene
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.motion.motions import Free, Rotation, Screw, Step, Translation
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

MOST_ACTIVE = 12  # size pairs at which cells are looked at: the latest extremes


class Off(NamedTuple):
    """How far the worst gap is off the window at a pose (<= 0: all are inside), and the extremes of the gap there."""

    value: float
    extremes: Extremes
    lines: Lines


@dataclass(eq=False)
class Worst:
    """The worst gap of a problem's bodies over all sizes: off(q) = max(most(q) - high, low - least(q)).

    With the window [0, 0] it is the largest |gap|.

    Attributes
    ----------
    problem : Problem
        Bodies, motion, limits and weights.
    scene : Scene
    low, high : float
        The window; infinite where it is open.
    active : (m, 2) array
        Sizes that were extreme at a pose looked at: a list that grows.
    """

    problem: Problem
    scene: Scene
    low: float = 0.0
    high: float = 0.0
    active: Array = field(default_factory=lambda: np.empty((0, 2)))

    def __post_init__(self) -> None:
        if self.scene.sizes.pairs is None:
            self.active = np.array(self.scene.sizes.corners)

    def transform(self, q: Array) -> Array:
        """Return the pose of body 1 at parameters q."""
        return self.problem.motion.transform(q, self.problem.movable.seed, self.problem.static.seed)

    def pose(self, q: Array) -> Array:
        """Return the relative pose at parameters q."""
        return self.scene.pose(self.transform(q))

    def off(self, q: Array) -> Off:
        """Return how far the worst gap is off at parameters q, over all sizes."""
        lines = self.scene.lines(self.pose(q))
        found = self.scene.extremes(lines)
        self._remember(found)
        return Off(max(found.most.gap + found.doubt - self.high, self.low - found.least.gap), found, lines)

    def _remember(self, found: Extremes) -> None:
        for rho in (found.least.rho, found.most.rho):
            known = (self.active == rho).all(axis=1)
            if not known.any():
                fixed = 4 if self.scene.sizes.pairs is None else 0
                kept = self.active if len(self.active) < MOST_ACTIVE else np.delete(self.active, fixed, axis=0)
                self.active = np.ascontiguousarray(np.vstack([kept, rho]))

    def amount(self, q: Array) -> float:
        """Return the weighted amount of a motion."""
        return float(np.linalg.norm(self.problem.weights * q))

    @property
    def floor(self) -> float:
        """What `off` is not less than at any pose: no gap is off both ends of a window by less than half its width."""
        return (self.low - self.high) / 2.0


def domain(worst: Worst, most: float, amount: float) -> Array:
    """Return the limits of the parameters outside which no pose is wanted, (k, 2).

    A turn beyond half a revolution repeats a smaller one where the limits have that one. A gap is no less than the
    distance of the seeds less what both bodies reach, so that the seed of body 1 comes to lie in a ball; from the balls
    before and after them follows how long translations are. What no such bound is known of may be infinite.

    Parameters
    ----------
    worst : Worst
    most : float
        Poses whose largest gap exceeds this are not wanted.
    amount : float
        Nor are motions of a larger weighted amount.
    """
    problem, scene = worst.problem, worst.scene
    limits = np.array(problem.limits)
    reach = amount / problem.weights * (1.0 + DEFAULT.line) if np.isfinite(amount) else np.full(len(limits), np.inf)
    limits = np.column_stack([np.maximum(limits[:, 0], -reach), np.minimum(limits[:, 1], reach)])
    half = float(np.nextafter(np.pi, 4.0))
    for k, step in enumerate(problem.motion.owners):
        low, high = limits[k]
        turns = problem.motion.turning[k]
        free = isinstance(step, Free) or (isinstance(step, Screw) and step.pitch == "free")
        if step.closed or (free and turns and low == -np.inf and high == np.inf):
            limits[k] = max(low, min(-half, high - 2.0 * half)), min(high, max(half, low + 2.0 * half))
    nearest = float((scene.sizes.corners @ scene.reach).min())
    return _reached(problem, limits, most + nearest)


def _reached(problem: Problem, limits: Array, radius: float) -> Array:
    """Return limits narrowed to what leads the seed of body 1 into a ball about that of body 2."""
    if not np.isfinite(radius):
        return limits
    one, two = np.array(problem.movable.seed), np.array(problem.static.seed)
    before, after = (one, 0.0), (two, radius)
    places: list[int] = []
    directions: list[Array] = []
    rests: list[Array] = []
    start = 0
    for step in problem.motion.steps:
        count = len(step.own_parameters)
        shifts = _shifts(step, one, two, not directions and start == 0)
        if shifts is None:
            return limits
        centre = _centre(step)
        if centre is not None and not directions:
            before = centre, float(np.linalg.norm(before[0] - centre)) + before[1]
        elif centre is not None:
            rests.append(centre)
        elif shifts and rests:
            return limits  # translations with a turn about a fixed point between them
        places += [start + k for k, _ in shifts]
        directions += [u for _, u in shifts]
        start += count
    for centre in reversed(rests):
        after = centre, float(np.linalg.norm(after[0] - centre)) + after[1]
    if not directions or len(directions) > 3:
        return limits
    least = float(np.linalg.svd(np.array(directions), compute_uv=False)[-1])
    if not least > DEFAULT.nominal:
        return limits
    longest = (after[1] + before[1] + float(np.linalg.norm(after[0] - before[0]))) / least * (1.0 + DEFAULT.line)
    for k in places:
        limits[k] = max(limits[k, 0], -longest), min(limits[k, 1], longest)
    return limits


def _centre(step: Step) -> Array | None:
    """Return the fixed point that a step turns about; None for the seed, and for what does not turn."""
    if isinstance(step, Rotation) and step.centre != "seed":
        return np.zeros(3) if isinstance(step.centre, str) else np.array(step.centre)
    return None


def _shifts(step: Step, one: Array, two: Array, first: bool) -> list[tuple[int, Array]] | None:
    """Return which of a step's parameters shift the seed, and along what; None where that is not known."""
    if isinstance(step, Translation):
        return [(0, np.array(step.direction))]
    if isinstance(step, Rotation):
        return []
    if isinstance(step, Free):
        return list(enumerate(np.eye(3)))
    if isinstance(step, Screw) and isinstance(step.axis, str) and first:
        along = (two - one) / np.linalg.norm(two - one)
        if isinstance(step.pitch, str) or np.isinf(step.pitch):
            return [(0, along)]
        return [(0, step.pitch * along)] if step.pitch != 0.0 else []
    return None
