"""The internal task: what every stage of the solver takes, and the answer every stage gives."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.coherence import Fault, Tracked, contact_faults
from fcdm_opt.curve.contact import supporting_contact
from fcdm_opt.curve.decision_curve import relative_pose
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.region import Piece
from fcdm_opt.curve.segments import SwitchingPoint
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints, frozen
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.motion import Motion
from fcdm_opt.tolerance.equations import FeaturePoints, feature_points
from fcdm_opt.tolerance.problem import MOST_TURNED, Problem
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.tolerance.solution import Status


Parts = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Answer:
    """What a stage found.

    Attributes
    ----------
    status : Status
    q : (k,) array or None
        Motion parameters.
    stage : str
        Which stage, and why it sufficed.
    lower_bound : float
        No smaller amount is possible.
    active : tuple of str
        What stops the motion from being smaller.
    modelled : dict
        Constraints kept, of how many.
    """

    status: Status
    q: Array | None
    stage: str
    lower_bound: float = 0.0
    active: tuple[str, ...] = ()
    modelled: dict[str, int] | None = None


class KeepOut(NamedTuple):
    """A further static body that the moved, re-scaled part must keep clear of: its scale, and the least gap."""

    body: Body
    scale: float
    clearance: float


class Opponent(NamedTuple):
    """A convex part that the parts of body 1 meet: of the static body at the target pair, or of a keep-out.

    `need` is the least gap it asks for, -inf where it asks for none.
    """

    part: ConvexPart
    scale: float
    need: float


@dataclass(frozen=True, eq=False)
class Task:
    """A problem in the solver's terms. Part pairs (i, j) are of part i of body 1 and opponent j.

    Attributes
    ----------
    movable, static : Body
    motion : Motion
    weights : (k,) array
    limits : (k, 2) array
    goal : "beyond", "at", "touch" or "clear"
    nominal, target : (2,) arrays
    signs : (2,) array
        Side of the target that "beyond" asks for.
    tracked : tuple of FeaturePoints
        The features of the nominal contact: two at a switching point, one inside a segment, none for "touch", "clear".
    pair : "any", "clear" or "touch"
        State that the target pair must have besides the goal.
    clearance : float
        Length units.
    coherent : bool
        Whether the tracked features must stay the contact along the ray.
    size : float
        Length that relative tolerances refer to.
    flush : tuple
        Of each tracked feature, itself where more than a point is in contact and must stay so.
    keep_out : tuple of KeepOut
    seconds : dict
        Time spent on "build", the compiling of templates, on the way.
    """

    movable: Body
    static: Body
    motion: Motion
    weights: Array
    limits: Array
    goal: str
    nominal: Array
    target: Array
    signs: Array
    tracked: tuple[FeaturePoints, ...]
    pair: str
    clearance: float
    coherent: bool
    size: float
    flush: tuple[Feature | None, ...] = ()
    keep_out: tuple[KeepOut, ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, problem: Problem) -> Task:
        """Return the task of a problem."""
        tracked: tuple[FeaturePoints, ...] = ()
        flush: tuple[Feature | None, ...] = ()
        if problem.goal in ("beyond", "at"):
            contact = problem.nominal_contact
            assert contact is not None  # Problem refuses these goals off the curve
            if isinstance(contact, SwitchingPoint):
                pieces: tuple[Piece, ...] = contact.pieces
            else:
                pieces = (contact.piece_at(problem.nominal_pair),)
            tracked = tuple(
                feature_points(problem.movable, problem.static, p.site, p.parts, p.normal, np.eye(3)) for p in pieces
            )
            flush = tuple(p.feature if p.feature.is_flush else None for p in pieces)
        return cls(
            problem.movable,
            problem.static,
            problem.motion,
            problem.weights,
            problem.limits,
            problem.goal,
            problem.nominal_pair,
            problem.target,
            problem.signs,
            tracked,
            problem.pair,
            problem.clearance,
            problem.path == "coherent" and bool(tracked),
            problem.size,
            flush,
        )

    @cached_property
    def opponents(self) -> tuple[Opponent, ...]:
        """The static body's parts, then those of the keep-outs."""
        need = self.need if self.must_clear else -np.inf
        contact = [Opponent(part, float(self.target[1]), need) for part in self.static.parts]
        others = [Opponent(part, k.scale, k.clearance) for k in self.keep_out for part in k.body.parts]
        return (*contact, *others)

    @cached_property
    def needs(self) -> Array:
        """Least gap that each opponent asks for, -inf where it asks for none."""
        return frozen([opponent.need for opponent in self.opponents])

    @property
    def part_pairs(self) -> int:
        """Number of pairs of convex parts."""
        return len(self.movable.parts) * len(self.opponents)

    @property
    def steps(self) -> Array:
        """Natural change of each parameter: the unit as a length, and over the size as an angle (at most 1), (k,)."""
        angle = min(self.unit / self.size, 1.0)
        return np.array([self.unit if kind == "translation" else angle for _, kind in self.motion.parameters])

    @property
    def must_clear(self) -> bool:
        """Whether the target pair must be apart by `need`."""
        return bool({"touch", "clear"} & {self.goal, self.pair})

    @property
    def must_touch(self) -> bool:
        """Whether the target pair must touch."""
        return "touch" in (self.goal, self.pair)

    @property
    def need(self) -> float:
        """Least gap of a target pair that must be apart."""
        return self.clearance if "clear" in (self.goal, self.pair) else 0.0

    @property
    def rest(self) -> Array:
        """No motion."""
        return np.zeros(len(self.weights))

    @cached_property
    def unit(self) -> float:
        """A typical amount, which scales the program: what the deviation, or closing the gap, takes."""
        if self.tracked:
            typical = float(np.abs(self.target / self.nominal - 1.0).max()) * self.size
        else:
            typical = abs(self.gap(self.rest) - self.need)
        return max(typical, DEFAULT.least_unit * self.size)

    def amount(self, q: Array) -> float:
        """Return the weighted motion amount."""
        return float(np.linalg.norm(self.weights * q))

    def transform(self, q: Array) -> Array:
        """Return the 4x4 transform of body 1; nan where a screw has lost its axis on the way."""
        try:
            return self.motion.transform(q, self.movable.seed, self.static.seed)
        except InputError:
            return np.full((4, 4), np.nan)

    def pose(self, q: Array) -> Array:
        """Return the pose relative to the static body that the kernels take."""
        return relative_pose(self.movable, self.static, self.transform(q))

    def _pose_to(self, opponent: Opponent, pose: Array) -> Array:
        """Return a pose relative to an opponent: the offset leads to its own seed."""
        if opponent.part.seed is self.static.seed:
            return pose
        return np.append(pose[:9], pose[9:] + opponent.part.seed - self.static.seed)

    @property
    def start(self) -> Array:
        """The allowed motion nearest to none."""
        return np.clip(self.rest, self.limits[:, 0], self.limits[:, 1])

    def allows(self, q: Array) -> bool:
        """Tell whether a motion lies within the limits."""
        return bool((q >= self.limits[:, 0]).all() and (q <= self.limits[:, 1]).all())

    def separations(self, parts: Parts, pose: Array) -> tuple[Ints, Array, Array]:
        """Return (sites, rows, separations) of all facet directions of a part pair, the last at the scales made.

        `pose` is relative to the static body, see `pose`.
        """
        one, opponent = self.movable.parts[parts[0]], self.opponents[parts[1]]
        pose = self._pose_to(opponent, pose)
        sites, rows = kernels.facet_rows(*one.packed, *opponent.part.packed, pose)
        return sites, rows, rows[:, 5] - rows[:, 3] * self.target[0] - rows[:, 4] * opponent.scale

    def pair_gaps(self, q: Array, normals: Mapping[Parts, Array] | None = None) -> Array:
        """Return the signed gap of every part pair at the scales made, (parts of 1, opponents).

        The largest separation over facet directions and, where it is larger, along the direction that `normals` gives
        for a pair: none exceeds the distance.
        """
        pose = self.pose(q)
        gaps = np.empty((len(self.movable.parts), len(self.opponents)))
        for j, opponent in enumerate(self.opponents):
            here, rho = self._pose_to(opponent, pose), np.array([self.target[0], opponent.scale])
            for i, one in enumerate(self.movable.parts):
                packed = (*one.packed, *opponent.part.packed, here, rho)
                gaps[i, j] = kernels.least_separation(*packed)
                if normals and (i, j) in normals:
                    n = normals[i, j] / np.linalg.norm(normals[i, j])
                    gaps[i, j] = max(gaps[i, j], kernels.separation(*packed, n))
        return gaps

    def gap(self, q: Array, normals: Mapping[Parts, Array] | None = None) -> float:
        """Return the signed gap of the target pair, see `pair_gaps`."""
        return self.contact_gap(self.pair_gaps(q, normals))

    def contact_gap(self, gaps: Array) -> float:
        """Return the least of `pair_gaps` over the static body's parts."""
        return float(gaps[:, : len(self.static.parts)].min())

    def tracked_contact(self, q: Array, s: float = 1.0) -> tuple[Array, Array, tuple[Tracked, ...]]:
        """Return (scale pair, pose, features) of the tracked contact at path position s.

        The pair is nan where the two lines are parallel.
        """
        pose = self.pose(s * np.asarray(q))
        tracked = tuple(
            Tracked.at(self.movable, self.static, pose, feature.parts, feature.site, feature.sign)
            for feature in self.tracked
        )
        lines = np.array([feature.line for feature in tracked])
        if len(tracked) == 2:
            steep = np.hypot(lines[:, 0], lines[:, 1])
            determinant = lines[0, 0] * lines[1, 1] - lines[0, 1] * lines[1, 0]
            if not abs(determinant) > DEFAULT.determinant * steep[0] * steep[1]:
                return np.full(2, np.nan), pose, tracked
            return np.linalg.solve(lines[:, :2], lines[:, 2]), pose, tracked
        a, b, c = lines[0]
        path = self.nominal + s * (self.target - self.nominal)
        return path + (c - a * path[0] - b * path[1]) / (a * a + b * b) * np.array([a, b]), pose, tracked

    def path_faults(self, q: Array) -> list[tuple[float, Array, Fault | None]]:
        """Return why the tracked contact is not real along the path (at its end only where coherence is not asked).

        The worst fault of each kind, as (path position, pose, fault); None for a fault where the tracked pair does not
        exist, or a flush contact opens.
        """
        worst: dict[tuple[object, ...], tuple[float, Array, Fault | None]] = {}
        turned = sum(abs(x) for (_, kind), x in zip(self.motion.parameters, q, strict=True) if kind == "rotation")
        count = max(DEFAULT.path_points - 1, math.ceil(min(turned, MOST_TURNED) / DEFAULT.path_turn))
        for s in np.linspace(1.0, 0.0, count + 1)[: count if self.coherent else 1]:
            rho, pose, tracked = self.tracked_contact(q, s)
            if not (np.isfinite(rho).all() and rho.min() > 0 and self._stays_flush(pose, tracked)):
                worst.setdefault((), (float(s), pose, None))
                continue
            for fault in contact_faults(self.movable, self.static, pose, rho, tracked, DEFAULT.cut * self.size):
                known = worst.get(fault.key)
                if known is None or known[2] is None or fault.excess > known[2].excess:
                    worst[fault.key] = (float(s), pose, fault)
        return list(worst.values())

    def _stays_flush(self, pose: Array, tracked: tuple[Tracked, ...]) -> bool:
        return all(
            whole is None
            or whole
            == supporting_contact(
                self.movable.parts[feature.parts[0]], self.static.parts[feature.parts[1]], feature.normal, pose
            ).feature
            for whole, feature in zip(self.flush, tracked, strict=False)
        )

    def meets(self, q: Array, slack: float, normals: Mapping[Parts, Array] | None = None, *, path: bool = True) -> bool:
        """Tell whether a motion meets goal, pair state and, with `path`, coherence to within a relative slack.

        `normals` are directions that prove part pairs apart, see `pair_gaps`.
        """
        if self.tracked:
            rho, _, _ = self.tracked_contact(q)
            excess = (rho - self.target) * self.signs if self.goal == "beyond" else -np.abs(rho - self.target)
            if not (excess >= -slack * self.target).all() or (path and self.path_faults(q)):
                return False
        if not np.isfinite(self.needs).any():
            return True
        gaps, slack = self.pair_gaps(q, normals), slack * self.size
        return bool((gaps >= self.needs - slack).all()) and not (self.must_touch and self.contact_gap(gaps) > slack)
