"""The internal task: what every stage of the solver takes, and the answer every stage gives."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve import kernels
from fcdm_opt.curve.coherence import Fault, Tracked, contact_faults, overlaps_between
from fcdm_opt.curve.contact import Joint, features_along, located, supporting_contact
from fcdm_opt.curve.decision_curve import relative_pose
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.flush import Flush
from fcdm_opt.curve.region import Piece
from fcdm_opt.curve.tight import TightLine
from fcdm_opt.geometry.arrays import Array, Flags, Ints, frozen
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.measures import cross, least_vector, norms
from fcdm_opt.geometry.naming import pair_in_words
from fcdm_opt.geometry.packing import packed_in_one
from fcdm_opt.model.equations import FeaturePoints, feature_points
from fcdm_opt.model.seats import flush_of, held, independent, spins, untracked
from fcdm_opt.motion.kinematics import Kinematics
from fcdm_opt.motion.motions import Motion
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import MOST_TURNED, TRACKING, Problem
from fcdm_opt.problem.solution import Status
from fcdm_opt.tolerances import DEFAULT

Parts = tuple[int, int]
SAMPLED = (0.0, 1.0, 10.0)  # `Task.steps` away from rest at which the rate of an unknown motion is looked at
MARGIN = 2.0  # on what is found there
BATCH_SIZE = 20_000  # part pairs that are looked at before the time is
REMEMBERED = 8  # motions whose poses and gaps are kept: stages and report ask about rest and the answer again


@dataclass(frozen=True, eq=False)
class Answer:
    """What a stage or a local search gives; with a motion made by `Task.answer`."""

    status: Status
    q: Array | None  # motion parameters, (k,)
    stage: str  # which stage, and why it sufficed
    lower_bound: float = 0.0  # no smaller amount is possible
    active: tuple[str, ...] = ()  # what stops the motion from being smaller
    modelled: dict[str, int] | None = None  # what is in the program that the motion solves, see `Task.modelled`
    last: bool = False  # no later stage is to be asked
    amount: float = math.inf  # of the motion; infinite without
    unique: float = 0.0  # see `Solution.unique_within`

    @property
    def motion(self) -> Array:
        """The motion parameters of an answer that has some."""
        assert self.q is not None
        return self.q

    @property
    def settles(self) -> bool:
        """Whether there is a motion, or provably none, or no stage has a better chance."""
        return self.q is not None or self.last or not math.isfinite(self.lower_bound)


class ObstaclePart(NamedTuple):
    """A convex part that the parts of body 1 meet: of the static body at the target pair, or of a keep-out."""

    part: ConvexPart
    scale: float
    need: float  # the least gap it asks for, -inf where it asks for none
    keep_out: int = -1  # counts from 0, -1 for the static body

    def placed(self, origin: Array) -> Array:
        """Return its vertices as scaled, from a point, (n, 3)."""
        return np.asarray(self.part.seed - origin + self.scale * (self.part.vertices - self.part.seed))


@dataclass(frozen=True, eq=False)
class Task:
    """A problem in the solver's terms. Part pairs (i, j) are of part i of body 1 and obstacle j."""

    movable: Body
    static: Body
    motion: Motion
    weights: Array  # (k,)
    limits: Array  # zero for parameters that "seat" holds, (k, 2)
    goal: str  # "beyond", "at", "seat", "touch" or "clear"
    # (2,): the pair that a tracked contact leaves, the target itself where none is tracked; and the target pair
    nominal: Array
    target: Array
    signs: Array  # (2,): side of the target that "beyond" asks for; 0 where none is tracked
    # the features of the nominal contact: two at a switching point, one inside a segment, none for "touch", "clear"
    tracked: tuple[FeaturePoints, ...]
    pair: str  # state that the target pair must have besides the goal, "any", "clear" or "touch"
    clearance: float  # length units
    coherent: bool  # whether the tracked features must stay the contact along the ray
    size: float  # length that relative tolerances refer to
    # of each tracked feature of "beyond" and "at", itself where more than a point is in contact and must stay so
    flush: tuple[Feature | None, ...] = ()
    keep_out: tuple[KeepOut, ...] = ()
    seats: tuple[Flush, ...] = ()  # the flush contacts that "seat" keeps, tracked or not
    # one feature for each plane of flush contacts that is not tracked; those of all `joints`, see `lines_of`
    untracked: tuple[FeaturePoints, ...] = ()
    joints: tuple[Joint, ...] = ()  # contacts that are restored together: then none is tracked
    amount_kind: str | OwnAmount = "weighted"  # what is made least; "displacement" of `made_vertices`
    resolution: Array | None = None  # steps of the machine, 0 where a parameter has none, (k,)
    # whether all contacts of true faces that are closed after a motion are to be, see `Problem.to_touch`
    restored: bool = False
    length_unit: str = ""  # unit of lengths, in what is told; "" without
    # the least answer made so far, for a search that ends before it is through; none in most tasks
    found: list[Answer] = field(default_factory=list, init=False)
    _poses: dict[bytes, Array] = field(default_factory=dict, init=False)
    _facet_gaps: dict[bytes, Array] = field(default_factory=dict, init=False)
    _faultless: set[bytes] = field(default_factory=set, init=False)  # motions without faults, asked about again

    @classmethod
    def of(cls, problem: Problem) -> Task:
        """Return the task of a problem."""
        problem = problem.reformulated
        bodies = movable, static = problem.active
        pieces: tuple[Piece | TightLine | Flush, ...] = ()
        flush: tuple[Feature | None, ...] = ()
        seats = problem.nominal_seats if problem.goal == "seat" else ()
        joints = problem.chosen_joints
        if joints:
            named = set(problem.contacts)
            seats = tuple(flush for flush in problem.nominal_seats if {flush.feature, flush.touching} & named)
        elif problem.goal in TRACKING:
            lines = problem.tracked_lines
            if problem.goal == "seat":
                pieces = tuple(flush_of(line, seats) or line for line in lines)
            else:
                pieces, flush = lines, tuple(p.feature if p.feature.is_flush else None for p in lines)
        tracked, others = (
            tuple(feature_points(*bodies, p.site, p.parts, p.normal, np.eye(3)) for p in some)
            for some in (pieces, () if joints else untracked(seats, pieces, problem.target))
        )
        others += tuple(line for joint in joints for line in lines_of(*bodies, joint))
        weights, amount = problem.weights, problem.amount
        if amount == "displacement" and _shifts_at_right_angles(problem):
            weights, amount = frozen(np.ones(len(weights))), "weighted"  # the same number
        return cls(
            movable,
            static,
            problem.motion,
            weights,
            _held_limits(problem, seats),
            problem.goal,
            problem.nominal_pair if tracked else problem.target,
            problem.target,
            problem.signs if tracked else np.zeros(2),
            tracked,
            problem.pair,
            problem.clearance,
            problem.path == "coherent" and bool(tracked),
            problem.size,
            flush,
            problem.keep_out,
            seats,
            others,
            joints,
            amount,
            problem.resolution,
            problem.restoring is not None,
            problem.unit,
        )

    def answer(
        self,
        q: Array,
        stage: str = "",
        lower_bound: float = 0.0,
        active: tuple[str, ...] = (),
        modelled: dict[str, int] | None = None,
        *,
        status: Status = Status.SOLVED,
    ) -> Answer:
        """Return a motion as an answer, with its amount, which the lower bound passes by rounding at most."""
        amount = self.amount(q)
        made = Answer(status, q, stage, min(lower_bound, amount), active, modelled, amount=amount)
        if not self.found or amount < self.found[0].amount:
            self.found[:] = [made]
        return made

    def line_gaps(self, q: Array) -> tuple[Array, Array]:
        """Return normals, (k, 3), and separations at the target pair, (k,), of the contact lines after a motion."""
        # the lines that goals "at" and "seat" bring to the target pair: the tracked ones, then those `untracked`
        pose, asked = self.pose(q), (*self.tracked, *self.untracked)
        lines = [Tracked.at(self.movable, self.static, pose, line.parts, line.site, line.sign) for line in asked]
        rows = np.array([line.line for line in lines])
        return np.array([line.normal for line in lines]), rows[:, 2] - rows[:, :2] @ self.target

    def line_rates(self, q: Array, normals: Array) -> Array:
        """Return the derivatives of `line_gaps`, which gives the normals, by each parameter, (lines, k)."""
        asked = zip((*self.tracked, *self.untracked), normals, strict=True)
        rates = [self.gap_rates(line.parts, q, np.array([line.site]), n[None])[0] for line, n in asked]
        return np.array(rates).reshape(-1, len(self.weights))

    @cached_property
    def _seating(self) -> tuple[Array, float]:
        """The least shift, (3,), that brings faces which stay flush onto one another, and by how much it misses."""
        faces = [flush for flush in self.seats if flush.whole]
        normals = np.array([flush.normal for flush in faces]).reshape(-1, 3)
        gaps = np.array([flush.gap(self.target) for flush in faces])
        found = np.linalg.lstsq(normals, gaps, rcond=DEFAULT.nominal)[0] if faces else np.zeros(3)
        return found, float(np.abs(normals @ found - gaps).max(initial=0.0))

    @property
    def seats_disagree(self) -> bool:
        """Whether faces that stay flush cannot all lie on one another at the target pair, whatever the motion is.

        One that keeps them aligned changes each gap by n . t, t the displacement of the seed: two walls that face each
        other stay as far apart as they are.
        """
        return self._seating[1] > DEFAULT.touch * self.size

    @cached_property
    def spins(self) -> Array:
        """Axis of each parameter's turning at rest, (k, 3), see `seat.spins`."""
        return spins(self.motion, self.movable, self.static)

    @cached_property
    def obstacles(self) -> tuple[ObstaclePart, ...]:
        """The static body's parts, then those of the keep-outs."""
        need = self.need if self.must_clear else -np.inf
        contact = [ObstaclePart(part, float(self.target[1]), need) for part in self.static.parts]
        others = [
            ObstaclePart(part, scale, keep_out.clearance, k)
            for k, keep_out in enumerate(self.keep_out)
            for part, scale in keep_out.obstacles
        ]
        return (*contact, *others)

    @cached_property
    def needs(self) -> Array:
        """Least gap that each obstacle asks for, -inf where it asks for none."""
        return frozen([obstacle.need for obstacle in self.obstacles])

    @property
    def part_pairs(self) -> int:
        """Number of pairs of convex parts."""
        return len(self.movable.parts) * len(self.obstacles)

    def named(self, parts: Parts) -> str:
        """Return a part pair in words: the keep-out it is with, or both bodies, of several parts each with which."""
        keep_out = self.obstacles[parts[1]].keep_out
        if keep_out >= 0:
            return f"keep-out {self.keep_out[keep_out].name!r}"
        return pair_in_words(self.movable, self.static, parts)

    def modelled(
        self, kept: Collection[Parts] = (), *, variables: int = 0, constraints: int = 0, features: int = 0
    ) -> dict[str, int]:
        """Return the counts of a program: the same keys whatever the stage; none kept without a program.

        - `kept`, collection of (i, j): part pairs in it.
        - `variables`, `constraints`: its unknowns, and its rows besides the limits of variables.
        - `features`: pairs of elements that its rows are made of, and vertices held by separating planes; in all there
          are `features`.
        """
        return {
            "variables": variables,
            "constraints": constraints,
            "part_pairs_kept": len(set(kept)),
            "part_pairs_total": self.part_pairs,
            "features_kept": features,
            "features_total": self.features,
            "keep_outs_kept": len({self.obstacles[j].keep_out for _, j in kept} - {-1}),
            "keep_outs_total": len(self.keep_out),
        }

    def modelled_by_gaps(self, q: Array, kept: Collection[Parts] | None = None) -> dict[str, int]:
        """Return the counts of a program in which each part pair is one row: its largest separation over its facets.

        `q` (k,): where the facets are counted. `kept`, collection of (i, j), optional: part pairs in it; by default
        those that bounds do not tell to be further off than the nearest, and than is needed, see `pair_gaps`.
        """
        kept, pose = self._near(q) if kept is None else kept, self.pose(q)
        features = sum(len(self.separations(parts, pose)[2]) for parts in kept)
        return self.modelled(kept, variables=len(q), constraints=len(kept), features=features)

    def _near(self, q: Array) -> list[Parts]:
        gaps, pose, near = self.pair_gaps(q), self.pose(q), list[Parts]()
        for columns, packed in self._groups:
            obstacle = self.obstacles[columns.start]
            bounds = kernels.pair_bounds(*self.movable.packed, *packed, *self._against(obstacle, pose))
            enough = max(float(gaps[:, columns].min()), obstacle.need) + DEFAULT.requirement * self.size
            near += [(i, columns.start + j) for i, j in np.argwhere(bounds <= enough).tolist()]
        return near

    @cached_property
    def features(self) -> int:
        """Number of pairs of elements that may be a contact after some motion: face and vertex, edge and edge."""
        bodies = self.movable.parts, [obstacle.part for obstacle in self.obstacles]
        counts = [[(len(part.loops), len(part.vertices), len(part.edges)) for part in parts] for parts in bodies]
        (faces, vertices, edges), (others, against, across) = (map(sum, zip(*own, strict=True)) for own in counts)
        return faces * against + vertices * others + edges * across

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
        if self.joints:
            typical = float(np.abs(self.line_gaps(self.rest)[1]).max())
        elif self.tracked:
            typical = float(np.abs(self.target / self.nominal - 1.0).max()) * self.size
        else:
            typical = abs(self.gap(self.rest) - self.need)
        nearest = 0.0  # how far the nearest keep-out is from being clear
        if self.keep_out:
            nearest = float((self.needs - self.pair_gaps(self.rest))[:, len(self.static.parts) :].max())
        return max(typical, nearest, DEFAULT.least_unit * self.size)

    def amount(self, q: Array) -> float:
        """Return the motion amount."""
        if self.weighted:
            weighted = self.weights * q
            return math.sqrt(weighted.dot(weighted))
        if isinstance(self.amount_kind, OwnAmount):
            return self.amount_kind(q)
        T = self.transform(q)
        return float(np.linalg.norm(self.made_vertices @ (T[:3, :3] - np.eye(3)).T + T[:3, 3], axis=1).max())

    @property
    def weighted(self) -> bool:
        """Whether the amount is the weighted one: that which the stages make least."""
        return self.amount_kind == "weighted"

    @property
    def bounded(self) -> bool:
        """Whether it is known without trying what each parameter displaces."""
        return all(step.bounded for step in self.motion.steps)

    @cached_property
    def made_vertices(self) -> Array:
        """Corners of the hull of body 1 at the scale made, about the seed at rest, (n, 3)."""
        corners, _ = self.movable.extremes
        return frozen(self.movable.seed + self.target[0] * (corners - self.movable.seed))

    @cached_property
    def displacement_rate(self) -> float:
        """The most that a vertex of body 1, re-scaled, can move per unit of weighted amount."""
        # infinite for a motion of the user's own, of which no bound is known
        return float(np.linalg.norm(self.motion.reaches(self.made_vertices, self.movable.seed) / self.weights))

    @cached_property
    def search_rate(self) -> float:
        """`displacement_rate`, or what a few samples suggest where that is infinite: for searches, no proof."""
        rate = self.displacement_rate
        if np.isfinite(rate):
            return rate
        rates = np.array([self.rates(x * sign * self.steps)[1] for x in SAMPLED for sign in (1.0, -1.0)])
        speeds = np.linalg.norm(self.made_vertices @ rates[:, :, :3, :3].mT + rates[:, :, None, :3, 3], axis=3)
        found = np.linalg.norm(speeds / self.weights[:, None], axis=1)
        return MARGIN * float(np.max(found[np.isfinite(found)], initial=0.0)) or 1.0

    @cached_property
    def displacement_bound(self) -> float:
        """A lower bound of the amount (design: bounds known to hold); 0 for one of the user's own."""
        # the signed distance of a part pair changes by no more than the largest displacement of a vertex, and parameter
        # k displaces none by more than its reach d_k per unit, so need <= sum d_k |q_k| <= |w q| sqrt(sum (d_k /
        # w_k)^2). The gap over facet directions is the signed distance where a pair overlaps, and never exceeds it: it
        # may stand for it where a gap is to be closed or an overlap undone, not where a gap is to be widened. 0 where
        # nothing asks for either
        if self.amount_kind == "displacement":
            return self._least_displacement
        return self._least_displacement / self.displacement_rate if self.weighted else 0.0

    @property
    def _least_displacement(self) -> float:
        """A lower bound of the largest displacement of a vertex."""
        if not np.isfinite(self.needs).any():
            return self._tracked_need
        gaps = self.pair_gaps(self.rest)
        needs = [self._tracked_need, *(self.needs - gaps)[gaps <= 0]]
        if self.goal == "touch":
            needs.append(self.contact_gap(self.distances(self.rest) if self.amount_kind == "displacement" else gaps))
        return float(max(needs))

    @property
    def _tracked_need(self) -> float:
        """How far a vertex of body 1 moves at least where the tracked contact comes to the target pair."""
        # the point that touches in the end belongs to the contact's elements, and is at rest its line's gap away from
        # the other body's. Of faces that stay flush every point moves alike along each normal: so as to close all gaps
        # at once
        if self.goal not in ("at", "seat"):
            return 0.0
        return max(float(np.linalg.norm(self._seating[0])), float(np.abs(self.line_gaps(self.rest)[1]).max()))

    def transform(self, q: Array) -> Array:
        """Return the 4x4 transform of body 1; nan where a screw has lost its axis on the way."""
        T = self._kinematics.transform(q)
        return T if math.isfinite(T.sum()) else np.full((4, 4), np.nan)

    @cached_property
    def _kinematics(self) -> Kinematics:
        return self.motion.kinematics(self.movable.seed, self.static.seed)

    def pose(self, q: Array) -> Array:
        """Return the pose relative to the static body that the kernels take."""
        return self._remembered(self._poses, q, lambda: relative_pose(self.movable, self.static, self.transform(q)))

    @staticmethod
    def _remembered(known: dict[bytes, Array], q: Array, made: Callable[[], Array]) -> Array:
        """Return what is made of a motion, which is kept of the last ones asked about."""
        key = np.asarray(q, dtype=np.float64).tobytes()
        found = known.get(key)
        if found is None:
            if len(known) == REMEMBERED:
                known.clear()
            found = known[key] = made()
        return found

    def _against(self, obstacle: ObstaclePart, pose: Array) -> tuple[Array, Array]:
        """Return a pose relative to an obstacle, the offset leading to its own seed, and the scales made of both."""
        if obstacle.part.seed is not self.static.seed:
            pose = np.append(pose[:9], pose[9:] + obstacle.part.seed - self.static.seed)
        return pose, np.array([self.target[0], obstacle.scale])

    @property
    def start(self) -> Array:
        """The allowed motion nearest to none."""
        return np.clip(self.rest, self.limits[:, 0], self.limits[:, 1])

    @property
    def flat(self) -> float:
        """Length within which elements in contact are in one plane."""
        return DEFAULT.cut * self.size

    @property
    def met_at_rest(self) -> bool:
        """Whether there is nothing to do."""
        if self.joints and not self.restores(self.rest, DEFAULT.line * self.size):
            return False
        return self.allows(self.rest) and self.meets(self.rest, DEFAULT.line)

    def allows(self, q: Array) -> bool:
        """Tell whether a motion lies within the limits."""
        return bool((q >= self.limits[:, 0]).all() and (q <= self.limits[:, 1]).all())

    def separations(self, parts: Parts, pose: Array) -> tuple[Ints, Array, Array]:
        """Return (sites, rows, separations) of all facet directions of a part pair, the last at the scales made."""
        # `pose` is relative to the static body, see `pose`
        one, obstacle = self.movable.parts[parts[0]], self.obstacles[parts[1]]
        pose, rho = self._against(obstacle, pose)
        sites, rows = kernels.facet_rows(*one.packed, *obstacle.part.packed, pose)
        return sites, rows, rows[:, 5] - rows[:, 3] * rho[0] - rows[:, 4] * rho[1]

    def gap_rates(self, parts: Parts, q: Array, sites: Ints, normals: Array) -> Array:
        """Return the derivatives of separations along facet directions of a part pair by each parameter, (m, k).

        A gap changes as the point of body 1 recedes at which its elements meet, or would along the normal: however the
        normal turns with it. nan along parallel edges, which have no such point, of a motion that turns.

        `parts` (i, j). `q` (k,). `sites`, `normals` (m, 3): as `separations` gives them after the motion.
        """
        (T, rates), one, other = self.rates(q), self.movable.parts[parts[0]], self.obstacles[parts[1]]
        first = self.target[0] * (one.vertices - one.seed) @ T[:3, :3].T + T[:3, :3] @ one.seed + T[:3, 3]
        second, (kinds, rows, columns) = other.placed(np.zeros(3)), sites.T
        meeting = np.empty((len(sites), 3))
        meeting[kinds == kernels.V1F2] = first[rows[kinds == kernels.V1F2]]
        meeting[kinds == kernels.F1V2] = second[columns[kinds == kernels.F1V2]]
        if (edges := kinds == kernels.E1E2).any():
            (a, b), (c, d) = one.edges[rows[edges], :2].T, other.part.edges[columns[edges], :2].T
            along, across = first[b] - first[a], second[d] - second[c]
            normal, lengths = cross(along, across), norms(along) * norms(across)
            sines = norms(normal)
            squares = np.where(sines > DEFAULT.tie * lengths, sines * sines, np.nan if rates[:, :3, :3].any() else 1.0)
            shares = (cross(second[c] - first[a], across) * normal).sum(axis=1) / squares
            meeting[edges] = first[a] + shares[:, None] * along
        speeds = (meeting - T[:3, 3]) @ T[:3, :3] @ rates[:, :3, :3].mT + rates[:, None, :3, 3]
        return -np.asarray((speeds * normals).sum(axis=2).T)

    def rates(self, q: Array) -> tuple[Array, Array]:
        """Return the transform of body 1, (4, 4), and its derivatives by each parameter, (k, 4, 4)."""
        return self._kinematics.rates(q)

    def pair_gaps(self, q: Array, normals: Mapping[Parts, Array] | None = None) -> Array:
        """Return the signed gap of every part pair at the scales made, (parts of 1, obstacles)."""
        # the largest separation over facet directions and, where it is larger, along the direction that `normals` gives
        # for a pair: none exceeds the distance. Of pairs that need no closer look a lower bound of the distance that
        # exceeds what is needed and the least gap
        pose = self.pose(q)
        gaps = self._remembered(self._facet_gaps, q, lambda: self._along_facets(pose)).copy()
        for (i, j), normal in (normals or {}).items():
            one, obstacle = self.movable.parts[i], self.obstacles[j]
            seen, n = self._against(obstacle, pose), normal / np.linalg.norm(normal)
            gaps[i, j] = max(gaps[i, j], kernels.separation(*one.packed, *obstacle.part.packed, *seen, n))
        return gaps

    def _along_facets(self, pose: Array) -> Array:
        gaps = np.empty((len(self.movable.parts), len(self.obstacles)))
        for columns, packed in self._groups:
            obstacle = self.obstacles[columns.start]
            seen = self._against(obstacle, pose)
            gaps[:, columns] = kernels.near_gaps(*self.movable.packed, *packed, *seen, obstacle.need)
        return gaps

    def without_joints(self, pairs: Flags) -> Flags:
        """Return which part pairs are among those given, (i, j), but for those that `joints` say all of."""
        found = pairs.copy()
        for joint in self.joints:
            found[tuple(np.transpose(joint.carriers))] = False
        return found

    def spans(self, pairs: Ints, along: Array) -> Array:
        """Return from where to where part pairs, (k, 2), are too near along a shift from rest, see `kernels.spans`."""
        found, pose = np.empty((len(pairs), 4)), self.pose(self.rest)
        for columns, packed in self._groups:
            obstacle = self.obstacles[columns.start]
            both, seen = (*self.movable.packed, *packed), self._against(obstacle, pose)
            rows = np.flatnonzero((columns.start <= pairs[:, 1]) & (pairs[:, 1] < columns.stop))
            for some in np.split(rows, range(BATCH_SIZE, len(rows), BATCH_SIZE)):
                pacing.check()
                own = pairs[some] - (0, columns.start)
                found[some] = kernels.spans(*both, *seen, own, along, obstacle.need, DEFAULT.tie)
        return found

    @cached_property
    def _groups(self) -> tuple[tuple[slice, tuple[Array, Ints, Ints]], ...]:
        """Opponents of one body and scale, as a slice of all, and packed together."""
        kinds = [(id(own.part.seed), own.scale, own.keep_out) for own in self.obstacles]
        starts = [0, *(k for k in range(1, len(kinds)) if kinds[k] != kinds[k - 1]), len(kinds)]
        runs = [slice(first, last) for first, last in pairwise(starts)]
        first = slice(0, len(self.static.parts))  # these are packed already
        return tuple(
            (run, self.static.packed if run == first else packed_in_one([own.part for own in self.obstacles[run]]))
            for run in runs
        )

    def gap(self, q: Array, normals: Mapping[Parts, Array] | None = None) -> float:
        """Return the signed gap of the target pair, see `pair_gaps`."""
        return self.contact_gap(self.pair_gaps(q, normals))

    def misses(self, q: Array, normals: Mapping[Parts, Array] | None = None) -> tuple[float, float]:
        """Return how far goal "touch" or "clear" is from being met, and by how much keep-outs are cleared besides."""
        # the first is 0 where "touch" has its contact, and not negative where "clear" has its gaps, those to keep-outs
        # among them; the second is infinite where there are none besides
        excess = self.pair_gaps(q, normals) - self.needs
        contact = float(excess[:, : len(self.static.parts)].min())
        others = float(excess[:, len(self.static.parts) :].min(initial=np.inf))
        return (contact, others) if self.must_touch else (min(contact, others), np.inf)

    def distances(self, q: Array) -> Array:
        """Return `pair_gaps` with the distances of the pairs that may be the nearest, which facets understate."""
        found, least = self.pair_gaps(q), np.inf
        for parts in sorted(np.ndindex(len(found), len(self.static.parts)), key=found.copy().__getitem__):
            if found[parts] >= least:
                break
            if found[parts] > 0.0:
                found[parts] = self.pair_gaps(q, {parts: self.direction_between(parts, q)})[parts]
            least = min(least, float(found[parts]))
        return found

    def contact_gap(self, gaps: Array) -> float:
        """Return the least of `pair_gaps` over the static body's parts."""
        return float(gaps[:, : len(self.static.parts)].min())

    def direction_between(self, parts: Parts, q: Array) -> Array:
        """Return the direction along which two parts are their distance apart; of overlapping parts, of a facet."""
        # the differences of their points are {v: n_i . v >= gap_i} over facet directions: of these the nearest to 0
        _, rows, gaps = self.separations(parts, self.pose(q))
        nearest = least_vector(rows[gaps > 0, :3], gaps[gaps > 0]) if (gaps > 0).any() else None
        return frozen(rows[gaps.argmax(), :3]) if nearest is None else nearest

    def tracked_contact(self, q: Array, s: float = 1.0) -> tuple[Array, Array, tuple[Tracked, ...]]:
        """Return (scale pair, pose, features) of the tracked contact at path position s."""
        # the pair is nan where the two lines are parallel. Contacts that are restored together are sought at the target
        pose = self.pose(s * np.asarray(q))
        if self.joints:
            return self.target, pose, ()
        tracked = tuple(
            Tracked.at(self.movable, self.static, pose, feature.parts, feature.site, feature.sign)
            for feature in self.tracked
        )
        a, b, c = tracked[0].line.tolist()
        if len(tracked) == 2:
            d, e, f = tracked[1].line.tolist()
            determinant = a * e - b * d
            if not abs(determinant) > DEFAULT.determinant * math.hypot(a, b) * math.hypot(d, e):
                return np.full(2, np.nan), pose, tracked
            return np.array([(c * e - b * f) / determinant, (a * f - c * d) / determinant]), pose, tracked
        path = self.nominal + s * (self.target - self.nominal)
        return path + (c - a * path[0] - b * path[1]) / (a * a + b * b) * np.array([a, b]), pose, tracked

    def path_faults(self, q: Array, *, first: bool = False) -> list[tuple[float, Array, Fault | None]]:
        """Return why the tracked contact is not real along the path (at its end only where coherence is not asked)."""
        # the worst fault of each kind, as (path position, pose, fault); None for a fault where the tracked pair does
        # not exist, or a flush contact opens. With `first` what is met first, from the end of the path back
        key = (np.ascontiguousarray(q).view(np.int64) >> 10).tobytes()  # alike but for roundings
        if key in self._faultless:
            return []
        worst: dict[tuple[object, ...], tuple[float, Array, Fault | None]] = {}
        for s in self._telling(q):
            rho, pose, tracked = self.tracked_contact(q, s)
            if not (np.isfinite(rho).all() and rho.min() > 0 and self._stays_flush(pose, rho, tracked)):
                worst.setdefault((), (float(s), pose, None))
                if first:
                    break
                continue
            for fault in contact_faults(self.movable, self.static, pose, rho, tracked, self.flat):
                known = worst.get(fault.key)
                if known is None or known[2] is None or fault.excess > known[2].excess:
                    worst[fault.key] = (float(s), pose, fault)
            if first and worst:
                break
        if not worst:
            self._faultless.add(key)
        return list(worst.values())

    def _telling(self, q: Array) -> Sequence[float]:
        """Return path positions, from the end back, one of which shows a fault if there is any."""
        if not self.coherent:
            return (1.0,)
        found = self._telling_shift(q) if self.motion.shifts_by(q) else None
        return self.path_positions(q) if found is None else found

    def path_positions(self, q: Array) -> list[float]:
        """Return path positions, from the end back, near enough to one another."""
        turned = float(np.abs(q[self.motion.turning]).sum())
        count = max(DEFAULT.path_points - 1, math.ceil(min(turned, MOST_TURNED) / DEFAULT.path_turn))
        return np.linspace(1.0, 0.0, count + 1)[:count].tolist()

    def _telling_shift(self, q: Array) -> Sequence[float] | None:
        """Return these of a motion that shifts: every separation along a facet direction is linear on the way."""
        # so a contact that holds at both ends comes apart nowhere between, parts overlap in an interval, and two flush
        # elements share something on the way if they do at both ends: it is convex in place and position together.
        # Where what they share lies on several faces of a body, its name is looked at all along. None where several
        # parts take turns at one of these
        (before, start, _), (rho, pose, tracked) = self.tracked_contact(q, 0.0), self.tracked_contact(q)
        if not (np.isfinite(rho).all() and min(rho.min(), before.min()) > 0):
            return None
        touching, ends = {feature.parts for feature in tracked}, ((start, before), (pose, rho))
        if len(self.movable.parts) == len(self.static.parts) == 1:
            overlaps: list[float] | None = []
        else:
            overlaps = overlaps_between(self.movable, self.static, ends, touching, self.flat)
        alike = all(len(flush.carriers) == 1 or flush.holds_between(*ends) for flush in self.seats)
        return None if overlaps is None or not alike else [1.0, *overlaps, *self._renamed(q, tracked, *ends)]

    def _renamed(
        self, q: Array, tracked: Sequence[Tracked], start: tuple[Array, Array], end: tuple[Array, Array]
    ) -> list[float]:
        """Return the first path position, from the end back, at which a flush contact of a shift has another name."""
        # `start` and `end` of the shift as (pose, scale pair), between which both change in proportion
        found = list[float]()
        for whole, feature in zip(self.flush, tracked, strict=False):
            one, two = self.movable.parts[feature.parts[0]], self.static.parts[feature.parts[1]]
            if whole is not None and (one.elements.spans or two.elements.spans):
                places = self.path_positions(q)
                path = [(start[0] + s * (end[0] - start[0]), start[1] + s * (end[1] - start[1])) for s in places]
                names = features_along(one, two, supporting_contact(one, two, feature.normal, path[0][0]), path)
                found += [s for s, name in zip(places, names, strict=True) if name != whole][:1]
        return found

    def _stays_flush(self, pose: Array, rho: Array, tracked: tuple[Tracked, ...]) -> bool:
        for whole, feature in zip(self.flush, tracked, strict=False):
            one, two = self.movable.parts[feature.parts[0]], self.static.parts[feature.parts[1]]
            contact = supporting_contact(one, two, feature.normal, pose)
            if whole is not None and whole != located(one, two, pose, contact, rho).feature:
                return False
        return all(flush.holds(pose, rho, self.flat) for flush in self.seats)

    def meets(self, q: Array, slack: float, normals: Mapping[Parts, Array] | None = None, *, path: bool = True) -> bool:
        """Tell whether a motion meets goal, pair state and, with `path`, coherence to within a relative slack."""
        # `normals` are directions that prove part pairs apart, see `pair_gaps`
        if self.tracked:
            rho, _, _ = self.tracked_contact(q)
            excess = (rho - self.target) * self.signs if self.goal == "beyond" else -np.abs(rho - self.target)
            if not (excess >= -slack * self.target).all() or (path and self.path_faults(q, first=True)):
                return False
        if self.joints and self.goal != FIT and not self.restores(q, slack * self.size):
            return False
        if not np.isfinite(self.needs).any():
            return True
        gaps, slack = self.pair_gaps(q, normals), slack * self.size
        short = (gaps > 0) & (gaps < self.needs - slack)
        if short.any():  # facet directions understate the distance of corners and edges
            directions = {(i, j): self.direction_between((i, j), q) for i, j in np.argwhere(short).tolist()}
            gaps = self.pair_gaps(q, {**(normals or {}), **directions})
        return bool((gaps >= self.needs - slack).all()) and not (self.must_touch and self.contact_gap(gaps) > slack)

    def restores(self, q: Array, slack: float) -> bool:
        """Tell whether a motion closes each of `joints` to within a length, by its own elements."""
        pose = self.pose(q)
        if not (np.abs(self.line_gaps(q)[1]) <= slack).all():
            return False
        for joint in self.joints:  # some part pair that carries it touches
            if not min(abs(self.separations(parts, pose)[2].max()) for parts in joint.carriers) <= slack:
                return False
        return all(flush.holds(pose, self.target, self.flat) for flush in self.seats)

    @property
    def is_equation(self) -> bool:
        """Whether the requirement is an equation, which motions in whole steps miss."""
        return self.must_touch or self.goal in ("at", "seat", FIT)

    def miss(self, q: Array) -> float:
        """Return by how much a motion misses an equation, a length; of goal "fit" the largest gap."""
        lines = float(np.abs(self.line_gaps(q)[1]).max()) if self.goal in ("at", "seat", FIT) else 0.0
        return max(lines, abs(self.gap(q))) if self.must_touch else lines

    def meets_in_steps(self, q: Array) -> bool:
        """Tell whether a motion in whole steps meets the requirement; an equation to within what steps leave open."""
        # the target pair of such a goal must not overlap
        if not self.is_equation:
            return self.meets(q, DEFAULT.requirement)
        assert self.resolution is not None
        play = self.motion.play(q, self.resolution, self.made_vertices, self.movable.seed, self.static.seed)
        if (self.miss(q) > play and self.goal != FIT) or self.gap(q) < -DEFAULT.touch * self.size:
            return False
        if self.tracked and self.path_faults(q, first=True):
            return False
        if self.goal == "seat" and not all(own.holds(self.pose(q), self.target, self.flat) for own in self.seats):
            return False  # flush or not
        if self.goal == "beyond" and not replace(self, pair="any", keep_out=()).meets(q, DEFAULT.requirement):
            return False
        return bool((self.pair_gaps(q) >= self.needs - DEFAULT.requirement * self.size).all())


def lines_of(movable: Body, static: Body, joint: Joint) -> tuple[FeaturePoints, ...]:
    """Return the lines that say together that a contact's own elements meet."""
    # one of a vertex and a face or of two edges, two of a vertex and an edge, three of two vertices
    kept = independent(joint.normals)
    both = zip(joint.sites[kept].tolist(), joint.normals[kept], strict=True)
    return tuple(feature_points(movable, static, tuple(site), joint.parts, n, np.eye(3)) for site, n in both)


def _shifts_at_right_angles(problem: Problem) -> bool:
    """Tell whether the motion shifts along directions at right angles: all vertices then move by the norm of q."""
    if not problem.motion.shifts:
        return False
    directions = problem.motion.shift_vectors(problem.movable.seed, problem.static.seed)
    return bool(np.abs(directions @ directions.T - np.eye(len(directions))).max() <= DEFAULT.tie)


def _held_limits(problem: Problem, seats: tuple[Flush, ...]) -> Array:
    """Return the limits, zero for parameters that cannot change without tilting a flush contact on the way."""
    # a parameter whose limits exclude zero keeps them
    if not seats or problem.path != "coherent":
        return problem.limits
    still = held(seats, problem.motion, problem.movable, problem.static)
    still &= (problem.limits[:, 0] <= 0) & (problem.limits[:, 1] >= 0)
    return frozen(np.where(still[:, None], 0.0, problem.limits))
