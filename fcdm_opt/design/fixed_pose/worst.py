"""What is made small: how far the worst gap of all sizes is off a window, as a function of the pose."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fcdm_opt.design.fixed_pose.scene import NEAR, Extremes, GapRows, OwnSizes, Scales, Scene
from fcdm_opt.design.sizes import Sizes
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.judge.engagement import passage
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

FAR = 1e3  # sizes of the bodies: more than gaps are off at any pose looked at
POSES = 3  # at which contacts are looked at that stay closed wherever the motion leads
MOST_ACTIVE = 12  # sizes at which cells are looked at: the latest extremes


class Off(NamedTuple):
    """How far the worst gap is off the window at a pose (<= 0: all are inside), and the extremes of the gap there.

    `excess` is how far any gap is off what it has to be, those of keep-outs too. A pose that is not `clear` of them has
    a value beyond that of all that are.
    """

    value: float
    extremes: Extremes
    rows: GapRows
    excess: float
    clear: bool


@dataclass(eq=False)
class Worst:
    """The worst gap of a problem's bodies over all sizes: off(q) = max(most(q) - high, low - least(q)).

    With the window [0, 0] it is the largest |gap|.

    Attributes
    ----------
    problem : Problem
        Bodies, motion and weights.
    scene : Scene
    low, high : float
        The window; infinite where it is open.
    limits : (k, 2) array
        Of the parameters; default the problem's.
    active : (m, s) array
        Sizes that were extreme at a pose looked at: a list that grows.
    keep_out : tuple of Worst
        Of the movable body and each keep-out, whose window is the clearance and more.
    """

    problem: Problem
    scene: Scene
    low: float = 0.0
    high: float = 0.0
    limits: Array = field(default_factory=lambda: np.empty((0, 2)))
    active: Array = field(default_factory=lambda: np.empty((0, 0)))
    keep_out: tuple[Worst, ...] = ()

    def __post_init__(self) -> None:
        if not len(self.limits):
            self.limits = np.array(self.problem.limits)
        if not self.active.size:
            corners = isinstance(self.scene, Scales) and self.scene.sizes.pairs is None
            self.active = np.array(self.scene.sizes.corners) if corners else np.empty((0, len(self.scene.sizes.box)))

    @classmethod
    def of(cls, problem: Problem, sizes: Sizes | None, low: float, high: float) -> Worst:
        """Return it for the scales of both bodies, or, without them, for all of a problem's own sizes."""
        if sizes is not None:
            ends = sizes.box.copy()
            ends[1] = 1.0  # of a keep-out, whose own scales its obstacles have
            pairs = None if sizes.pairs is None else np.column_stack([sizes.pairs[:, 0], np.ones(len(sizes.pairs))])
            near = tuple(
                cls(problem, Scales(problem.movable, body, Sizes(ends, pairs=pairs)), gap, np.inf)
                for body, gap in obstacles(problem)
            )
            return cls(problem, Scales(problem.movable, problem.static, sizes), low, high, keep_out=near)
        movable, static, motion = problem.request["movable"], problem.request["static"], problem.motion
        start, count = motion.transform([0.0] * len(motion.names), movable.seed, static.seed), len(motion.names)
        ways = np.array([motion.transform(row, movable.seed, static.seed)[:3, 3] for row in np.eye(count)])
        straight = np.array([direction is not None for direction in motion.shift_directions])
        # parts further apart than this are further apart than any wanted pose: than they are at rest, or have to be
        away = float(np.linalg.norm(movable.seed - static.seed))
        reach = 2.0 * (away + 2.0 * (movable.size + static.size) + sum(abs(x) for x in (low, high) if np.isfinite(x)))
        some = 0 < straight.sum() <= 3
        narrow = float(np.linalg.svd(ways[straight], compute_uv=False)[-1]) if some else 1.0
        limits = np.array(problem.limits)
        for k in np.flatnonzero(straight).tolist():
            far = reach / narrow if narrow > DEFAULT.nominal else np.inf
            within = passage(problem, ways[k])  # gaps beyond a wall mean nothing
            limits[k] = max(limits[k, 0], -far, within[0]), min(limits[k, 1], far, within[1])
        places = None
        if motion.shifts and np.isfinite(limits).all():
            ends = ways[:, :, None] * limits[:, None, :]
            places = start[:3, 3:] + np.column_stack([ends.min(axis=2).sum(axis=0), ends.max(axis=2).sum(axis=0)])
        own, kept = tuple(size for size in problem.sizes if size.body == "movable"), list[Worst]()
        for body, gap in obstacles(problem):
            alone = OwnSizes(movable, body, own, places) if own else Scales(movable, body, Sizes(np.ones((2, 2))))
            kept.append(cls(problem, alone, gap, np.inf, limits))
        return cls(problem, OwnSizes(movable, static, problem.sizes, places), low, high, limits, keep_out=tuple(kept))

    def leave_out_standing(self) -> None:
        """Do not count contacts that are closed at all sizes wherever the motion leads: at rest, and anywhere else."""
        count = len(self.limits)
        near = NEAR * self.scene.size / self.problem.motion.weights(self.scene.movable.size / 2.0)
        q = near * np.random.default_rng(5).uniform(-1.0, 1.0, (POSES, count))
        self.scene.leave_out(map(self.pose, np.clip(np.vstack([np.zeros((1, count)), q]), *self.limits.T)))

    def transform(self, q: Array) -> Array:
        """Return the pose of body 1 at parameters q."""
        return self.problem.motion.transform(q, self.problem.movable.seed, self.problem.static.seed)

    def pose(self, q: Array) -> Array:
        """Return the relative pose at parameters q."""
        return self.scene.pose(self.transform(q))

    def off(self, q: Array) -> Off:
        """Return how far the worst gap is off at parameters q, over all sizes."""
        rows = self.scene.rows(self.pose(q))
        found = self.scene.extremes(rows)
        self._remember(found)
        off = max(found.most.gap + found.doubt - self.high, self.low - found.least.gap)
        overlap = max((own.off(q).value for own in self.keep_out), default=-np.inf)
        clear = overlap <= self.problem.contact_slack
        return Off(off if clear else FAR * self.scene.size + overlap, found, rows, max(off, overlap), clear)

    def _remember(self, found: Extremes) -> None:
        for rho in (found.least.rho, found.most.rho):
            if not (self.active == rho).all(axis=1).any():
                fixed = 4 if isinstance(self.scene, Scales) and self.scene.sizes.pairs is None else 0
                kept = self.active if len(self.active) < MOST_ACTIVE else np.delete(self.active, fixed, axis=0)
                self.active = np.ascontiguousarray(np.vstack([kept, rho]))

    def amount(self, q: Array) -> float:
        """Return the weighted amount of a motion."""
        return float(np.linalg.norm(self.problem.weights * q))

    @property
    def floor(self) -> float:
        """What `off` is not less than at any pose: no gap is off both ends of a window by less than half its width."""
        return (self.low - self.high) / 2.0


def obstacles(problem: Problem) -> list[tuple[Body, float]]:
    """Return the keep-outs of a problem as bodies, over all of their scales, and how far to keep clear of them."""
    found = []
    for own in problem.keep_out:
        if own.body.hollow:
            what = "one pose for all pairs looks at solids, and of this keep-out only the surface is known"
            raise InputError(what, key="keep_out", found=own.name, allowed='decomposition = "exact"')
        seed = own.body.seed
        parts = [seed + scale * (part.vertices - seed) for part, scale in own.obstacles]
        found.append((Body.from_parts(parts, seed=seed, name=own.name), own.clearance))
    return found


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
    problem, limits = worst.problem, worst.limits.copy()
    if np.isfinite(amount):
        far = amount / problem.weights * (1.0 + DEFAULT.line)
        limits = np.column_stack([np.maximum(limits[:, 0], -far), np.minimum(limits[:, 1], far)])
    half = float(np.nextafter(np.pi, 4.0))
    for k, step in enumerate(problem.motion.owners):
        low, high = limits[k]
        free = problem.motion.turning[k] and step.bounded and step.own_pitch is None
        if step.closed or (free and low == -np.inf and high == np.inf):
            limits[k] = max(low, min(-half, high - 2.0 * half)), min(high, max(half, low + 2.0 * half))
    radius = most + worst.scene.nearest
    return _reached(problem, limits, radius) if np.isfinite(radius) else limits


def _reached(problem: Problem, limits: Array, radius: float) -> Array:
    """Return limits narrowed to what leads the seed of body 1 into a ball about that of body 2.

    Each turn about a fixed point keeps a seed on its sphere: it is before all translations, or after them.
    """
    one, two = np.array(problem.movable.seed), np.array(problem.static.seed)
    before, after = (one, 0.0), (two, radius)
    shifts, rests = list[tuple[float, ...] | None](), list[Array]()
    for step in problem.motion.steps:
        own, centre = [*step.own_shift_directions], step.own_fixed_points if step.closed else ()
        if step.own_along_seeds and not shifts:
            own[0] = None if step.closed else tuple((step.own_pitch or 1.0) * (two - one) / np.linalg.norm(two - one))
        elif not (step.own_about_seed or centre):
            return limits  # not known
        if rests and any(direction is not None for direction in own):
            return limits  # a turn about a fixed point between translations
        if centre and any(direction is not None for direction in shifts):
            rests.append(np.array(centre[0]))
        elif centre:
            before = np.array(centre[0]), float(np.linalg.norm(before[0] - centre[0])) + before[1]
        shifts += own
    for rest in reversed(rests):
        after = rest, float(np.linalg.norm(after[0] - rest)) + after[1]
    directions = [direction for direction in shifts if direction is not None]
    least = float(np.linalg.svd(np.array(directions), compute_uv=False)[-1]) if 0 < len(directions) <= 3 else 0.0
    if least > DEFAULT.nominal:
        longest = (after[1] + before[1] + float(np.linalg.norm(after[0] - before[0]))) / least * (1.0 + DEFAULT.line)
        for k in np.flatnonzero([direction is not None for direction in shifts]):
            limits[k] = max(limits[k, 0], -longest), min(limits[k, 1], longest)
    return limits
