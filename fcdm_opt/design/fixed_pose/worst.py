"""What is made small: how far the worst gap of all sizes is off a window, as a function of the pose."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fcdm_opt.curve.true_sizes import TrueSizes
from fcdm_opt.design.contact_gaps import ContactGaps, Extremes, columns_of, relations_of
from fcdm_opt.design.fixed_pose.scene import NEAR, BodyGaps, GapRows, OwnSizes, Scales
from fcdm_opt.design.sizes import SCALES, Sizes
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.measures import least_vector
from fcdm_opt.geometry.solids import contains
from fcdm_opt.geometry.units import gap_text
from fcdm_opt.judge.engagement import passage
from fcdm_opt.judge.sampled_sizes import GapClaims
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.tolerances import DEFAULT

WIDE = 4.0  # sizes of the bodies: no gap of parts that hold each other is as large
FAR = 1e3  # sizes of the bodies: more than gaps are off at any pose looked at
POSES = 3  # at which contacts are looked at that stay closed wherever the motion leads
NEAR_REST = 1e-4  # of the size: how far these are from rest, less than parts have of play
DIFFERENCE = 1e-6  # finite differences, in sizes of the bodies
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

    With the window [0, 0] it is the largest |gap|; its ends are infinite where it is open.
    """

    problem: Problem
    scene: BodyGaps
    low: float = 0.0
    high: float = 0.0
    limits: Array = field(default_factory=lambda: np.empty((0, 2)))  # of the parameters, (k, 2); default the problem's
    # sizes that were extreme at a pose looked at, (m, s): a list that grows
    active: Array = field(default_factory=lambda: np.empty((0, 0)))
    keep_out: tuple[Worst, ...] = ()  # of the movable body and each keep-out, whose window is the clearance and more
    solid: Body | None = None  # the other body, where only its surface is known: a pose inside of it is none
    kept_first: bool = False  # whether the window is kept and keep-outs are missed, by as little as they can be
    columns: Sequence[int] = ()  # of two parts among several: which of all sizes are theirs
    is_program: ClassVar[bool] = False  # whether a linear program tells the best pose

    def __post_init__(self) -> None:
        if not len(self.limits):
            self.limits = np.array([own.limits for own in self.problem.coordinates])
        if not self.active.size:
            corners = isinstance(self.scene, Scales) and self.scene.sizes.pairs is None
            self.active = np.array(self.scene.sizes.corners) if corners else np.empty((0, len(self.scene.sizes.box)))

    @classmethod
    def of(cls, problem: Problem, sizes: Sizes | None, low: float, high: float, true: TrueSizes | None = None) -> Worst:
        """Return it for the scales of both bodies, or, without them, for all of a problem's own sizes."""
        # with `true` of bodies that are exact at points of their round faces
        if sizes is not None:
            near = tuple(_kept_clear(problem, sizes, SCALES, own=False))
            bodies = (problem.movable, problem.static) if true is None else true.bodies
            scaled = Scales(*bodies, sizes, apart=() if true is None else true.apart())
            return cls(problem, scaled, low, high, keep_out=near)
        motion, (movable, static) = problem.motion, problem.at_scales.values() if true is None else true.bodies
        start, count = motion.transform([0.0] * len(motion.names), movable.seed, static.seed), len(motion.names)
        directions = np.array([motion.transform(row, movable.seed, static.seed)[:3, 3] for row in np.eye(count)])
        straight = np.array([direction is not None for direction in motion.shift_directions])
        # parts further apart than this are further apart than any wanted pose: than they are at rest, or have to be
        away = float(np.linalg.norm(movable.seed - static.seed))
        most = 2.0 * (away + 2.0 * (movable.size + static.size) + sum(abs(x) for x in (low, high) if np.isfinite(x)))
        some = 0 < straight.sum() <= 3
        narrow = float(np.linalg.svd(directions[straight], compute_uv=False)[-1]) if some else 1.0
        limits = np.array(problem.limits)
        for k in np.flatnonzero(straight).tolist():
            far = most / narrow if narrow > DEFAULT.nominal else np.inf
            within = passage(problem, directions[k])  # gaps beyond a wall mean nothing
            limits[k] = max(limits[k, 0], -far, within[0]), min(limits[k, 1], far, within[1])
        places = None
        if motion.shifts and np.isfinite(limits).all():
            ends = directions[:, :, None] * limits[:, None, :]
            places = start[:3, 3:] + np.column_stack([ends.min(axis=2).sum(axis=0), ends.max(axis=2).sum(axis=0)])
        scene, names = OwnSizes(movable, static, problem.sizes, places, true), [size.name for size in problem.sizes]
        kept = _kept_clear(problem, scene.sizes, names, own=True, places=places)
        near = tuple(replace(own, limits=limits) for own in kept)
        return cls(problem, scene, low, high, limits, keep_out=near)

    def leave_out_permanent(self, also: Sequence[Array] = ()) -> None:
        """Do not count contacts closed at all sizes at rest, wherever the motion leads near by, and elsewhere."""
        # `also` are parameters of poses further away, at which they are closed, too
        count = len(self.limits)
        near = NEAR_REST * self.scene.size / self.problem.motion.weights(self.scene.movable.size / 2.0)
        q = near * np.random.default_rng(5).uniform(-1.0, 1.0, (POSES, count))
        q = np.vstack([np.zeros((1, count)), q, *(own[None] for own in also)])
        self.scene.leave_out(map(self.pose, np.clip(q, *self.limits.T)))

    def opened(self, q: Array) -> bool:
        """Tell whether a contact that was left out is open at parameters q, at some sizes."""
        return bool(self.scene.permanent) and not self.scene.permanent.keys() <= self.scene.closed(self.pose(q)).keys()

    def transform(self, q: Array) -> Array:
        """Return the pose of body 1 at parameters q."""
        return self.problem.motion.transform(q, self.problem.movable.seed, self.problem.static.seed)

    def pose(self, q: Array) -> Array:
        """Return the relative pose at parameters q."""
        return self.scene.pose(self.transform(q))

    def off(self, q: Array, *, whole: bool = False) -> Off:
        """Return how far the worst gap is off at parameters q, over all sizes; the `whole` range only if asked for."""
        rows = self.rows(q)
        window = () if whole or not isinstance(self.scene, Scales) else ((self.low, self.high),)
        found = self.extremes(q, rows, *window)
        for rho in (found.least.rho, found.most.rho):
            if not (self.active == rho).all(axis=1).any():
                fixed = 4 if isinstance(self.scene, Scales) and self.scene.sizes.pairs is None else 0
                kept = self.active if len(self.active) < MOST_ACTIVE else np.delete(self.active, fixed, axis=0)
                self.active = np.ascontiguousarray(np.vstack([kept, rho]))
        off = self.missed(found)
        if off <= 0.0 and self.solid is not None and self._inside(q):
            off = self.scene.size
        overlap = max((own.off(q).value for own in self.keep_out), default=-np.inf)
        first, then = (off, overlap) if self.kept_first else (overlap, off)
        clear = first <= self.problem.contact_slack
        return Off(then if clear else FAR * self.scene.size + first, found, rows, max(off, overlap), clear)

    def too_near(self, q: Array) -> Iterator[str]:
        """Yield in words what is not as clear of each other at parameters q as it is to be, at all sizes."""
        slack = self.problem.contact_slack
        for kept in self.keep_out:
            one, two, off = kept.scene.movable.name, kept.scene.static.name, kept.off(q).value
            if off > slack:
                gap = gap_text(kept.low - off, slack, self.problem.unit, kept.low)
                yield f"{one or 'movable'} and {two or 'static'}, which are kept clear of each other, at worst {gap}"

    def extremes(self, q: Array, rows: Any, *window: tuple[float, float]) -> Extremes:
        """Return the least and the largest gap over all sizes at parameters q, whose rows are given."""
        return self.scene.extremes(rows, *window)

    def missed(self, found: Extremes) -> float:
        """Return how far extremes of the gap are off the window."""
        return max(found.most.gap + found.doubt - self.high, self.low - found.least.gap)

    def rows(self, q: Array) -> Any:
        """Return the rows of the gap at parameters q."""
        return self.scene.rows(self.pose(q))

    def _inside(self, q: Array) -> bool:
        """Tell whether one body is within the other, of bodies whose surfaces are apart."""
        assert self.solid is not None
        one, two, T = self.scene.movable, self.solid, self.transform(q)
        moved = T[:3, :3] @ one.vertices[0] + T[:3, 3]
        back = (two.vertices[0] - T[:3, 3]) @ T[:3, :3]
        return bool(contains(two, moved[None]).any() or contains(one, back[None]).any())

    @cached_property
    def weights(self) -> Array:
        """Amount a unit of each parameter."""
        return np.array([own.weight for own in self.problem.coordinates])

    @cached_property
    def natural(self) -> Array:
        """What makes lengths of turns: how far they move the movable body."""
        return self.problem.motion.weights(self.scene.movable.size / 2.0)

    def linear(self, q: Array, far: float = 0.0) -> tuple[Array, Array, Flags]:
        """Return functions of which none may exceed 0 in the window, values and slopes (f, k), and which keep clear.

        They are of the part pairs' gaps at the active sizes, by central differences; one-sided at a limit. The largest
        of those that do not keep clear of keep-outs is how far the worst gap is off; with `far`, a length, no less than
        that: gaps are those of the pairs that so large a step may bring nearest.
        """
        pairs = self.scene.rows(self.pose(q), NEAR * self.scene.size).pairs
        centre, slopes = self.differences(lambda at: self.scene.of_pairs(self.pose(at), pairs, self.active), q)
        lowered = centre - far * np.abs(slopes / self.natural).sum(axis=2) if far else centre
        owners, columns = lowered.argmin(axis=0), np.arange(len(self.active))
        values = np.append(self.low - centre, centre[owners, columns] - self.high)
        return self._with_keep_outs(q, values, np.concatenate([-slopes.reshape(-1, len(q)), slopes[owners, columns]]))

    def differences(self, gaps: Callable[[Array], Array], q: Array, far: float = DIFFERENCE) -> tuple[Array, Array]:
        """Return gaps at q, and their slopes by differences of this share of the size, (..., k)."""
        centre = gaps(q)
        slopes = np.zeros((*centre.shape, len(q)))
        for k, step in enumerate((far * self.scene.size / self.natural).tolist()):
            ends = np.tile(q, (2, 1))
            ends[:, k] = np.clip([q[k] + step, q[k] - step], *self.limits[k])
            if ends[0, k] > ends[1, k]:
                with np.errstate(invalid="ignore"):
                    slopes[..., k] = (gaps(ends[0]) - gaps(ends[1])) / (ends[0, k] - ends[1, k])
        return centre, slopes

    def _with_keep_outs(self, q: Array, values: Array, rates: Array) -> tuple[Array, Array, Flags]:
        known = np.isfinite(values) & np.isfinite(rates).all(axis=1)
        others = [own.linear(q)[:2] for own in self.keep_out]
        values, rates = (np.concatenate(own) for own in zip((values[known], rates[known]), *others, strict=True))
        return values, rates, (np.arange(len(values)) >= known.sum()) != self.kept_first

    def amount(self, q: Array) -> float:
        """Return the weighted amount of a motion."""
        return float(np.linalg.norm(self.weights * q))

    @property
    def floor(self) -> float:
        """What `off` is not less than at any pose: no gap is off both ends of a window by less than half its width."""
        return (self.low - self.high) / 2.0


@dataclass(eq=False)
class WorstContacts(Worst):
    """The same of all contacts as drawn, of two parts or of an assembly, whose rows are a program of the pose."""

    # where the motion only shifts it is a linear one: its best pose is the best there is
    problem: Any
    scene: Any
    walls: tuple[Worst, ...] = ()  # of all faces of parts that have a contact

    @classmethod
    def asked(cls, question: Scene, sizes: Sizes, names: Sequence[str], low: float, high: float) -> WorstContacts:
        """Return it of a question and all sizes that its parts may have, by their names."""
        own = [*names] == [size.name for size in question.sizes]
        gaps = ContactGaps(question, sizes, names, own=own)
        return cls(question, gaps, low, high, keep_out=tuple(_kept_clear(question, sizes, names, own=own)))

    def with_walls(self, q: Array) -> WorstContacts:
        """Return it with all faces of parts that have a contact, which may be nearer at parameters q than these."""
        walls, gaps = list[Worst](), self.scene
        for _, relation, whose in gaps.whole_parts():
            both = _between(relation, gaps.sizes, whose, own=gaps.own)
            wall = Worst(relation, both, self.low, np.inf, columns=whose)
            with suppress(InputError):  # sizes turn faces, or make another shape of a part
                wall.off(q)
                walls.append(wall)
        return replace(self, walls=tuple(walls))

    def nearest_wall(self, q: Array, rows: Any) -> tuple[Worst, Off] | None:
        """Return the parts whose least gap at parameters q is below that of contacts, and it, if one is."""
        each = [(wall, wall.off(q)) for wall in self.walls]
        nearest = min(each, key=lambda own: own[1].extremes.least.gap, default=None)
        least = self.scene.extremes(rows).least.gap - DEFAULT.tie * self.scene.size
        return nearest if nearest is not None and nearest[1].extremes.least.gap < least else None

    def extremes(self, q: Array, rows: Any, *window: tuple[float, float]) -> Extremes:
        """Return them: the least of all faces where walls are looked at, the largest of contacts."""
        found, nearest = super().extremes(q, rows, *window), self.nearest_wall(q, rows)
        if nearest is None:
            return found
        (wall, off), place = nearest, np.clip(0.0 if self.scene.own else 1.0, *self.scene.sizes.box.T)
        place[wall.columns] = off.extremes.least.rho[: len(wall.columns)]
        return found._replace(least=off.extremes.least._replace(rho=frozen(place)))

    def claims(self, q: Array, least: float, *, failed: bool) -> GapClaims:
        """Return what `verify` looks at: the gap of each contact, and what is kept clear of unless that failed.

        And that parts which have a contact overlap nowhere deeper than the `least` gap told.
        """
        gaps, poses = self.scene, self.scene.transforms(q)
        first, *others = gaps.claims(poses)
        for k, relation, whose in gaps.whole_parts():
            claim = gaps.claim(relation, whose, poses[k])
            others.append(replace(claim, keep_out=[(claim.bodies[1], min(least, 0.0))]))
        for kept in () if failed else self.keep_out:
            claim = gaps.claim(kept.problem, kept.columns, kept.transform(q))
            others.append(replace(claim, keep_out=[(kept.scene.static, kept.low)]))
        return replace(first, further=others)

    def bound(self, slack: float, *, amounts: bool) -> float | None:
        """Return what no pose has less of, its amount or how far its worst gap is off; None where the motion turns."""
        from scipy.optimize import linprog

        if not self.problem.shifts:
            return None
        rest = np.zeros(len(self.limits))
        # without walls, and what is kept clear of, no pose is worse
        values, slopes, kept = replace(self, walls=()).linear(rest)
        values, slopes = values[~kept], slopes[~kept]
        if amounts:
            q = least_motion(values - slack, slopes, rest, self.weights, self.limits)
            return np.inf if q is None else self.amount(q)
        step = linprog([0.0] * len(rest) + [1.0], A_ub=np.column_stack([slopes, -np.ones(len(values))]), b_ub=-values,
                       bounds=[*self.limits.tolist(), (None, None)], method="highs")  # fmt: skip
        return float(step.x[-1]) if step.status == 0 else None

    @cached_property
    def is_program(self) -> bool:  # type: ignore[override]
        """Whether the motions only shift, and contacts alone are looked at."""
        return self.problem.shifts and not self.walls

    @cached_property
    def natural(self) -> Array:
        """As of one body, of half the size."""
        turns = np.array([own.kind == "rotation" for own in self.problem.coordinates])
        return np.where(turns, self.scene.size / 2.0, 1.0)

    def rows(self, q: Array) -> Any:
        """Return the rows of all contacts at parameters q."""
        return self.scene.rows(self.scene.transforms(q))

    def linear(self, q: Array, far: float = 0.0) -> tuple[Array, Array, Flags]:
        """Return the functions of the contacts' least and largest gaps, and of what is kept clear of."""
        step = 1.0 if self.problem.shifts else DIFFERENCE
        ends, slopes = self.differences(lambda at: np.array(self.scene.ends(self.rows(at))), q, step)
        values, rates = np.append(self.low - ends[0], ends[1] - self.high), np.concatenate([-slopes[0], slopes[1]])
        walls = [replace(own, low=self.low).linear(q)[:2] for own in self.walls]
        values, rates = (np.concatenate(own) for own in zip((values, rates), *walls, strict=True))
        return self._with_keep_outs(q, values, rates)


def least_motion(values: Array, slopes: Array, q: Array, weights: Array, steps: Array) -> Array | None:
    """Return the motion of the least amount, steps from q, at which no function exceeds 0; None if there is none."""
    identity = np.eye(len(q))
    G = np.vstack([-slopes, identity, -identity]) / weights
    h = np.concatenate([values - slopes @ q, q + steps[:, 0], -(q + steps[:, 1])])
    used = np.isfinite(h)
    found = least_vector(G[used], h[used])
    return None if found is None else found / weights


def _kept_clear(
    question: Scene, sizes: Sizes, names: Sequence[str], *, own: bool, places: Array | None = None
) -> Iterator[Worst]:
    """Yield of every two parts that are kept clear of each other, and of keep-outs, their worst gap."""
    every = relations_of(question)
    for pair, relation in every.items():
        whose = columns_of(pair, relation, names, own=own)
        for body, gap, solid in obstacles(relation):
            both = _between(relation, sizes, whose, own=own, body=body, places=places)
            yield Worst(relation, both, gap, np.inf, solid=solid, columns=whose)
    # the two parts of a contact may be asked about keep-outs the other way round
    clear = (pair for pair, it in every.items() if it.goal == "clear" and pair[::-1] not in every)
    for pair in clear if isinstance(question, Assembly) else ():
        relation, whose = every[pair], columns_of(pair, every[pair], names, own=own)
        both = _between(relation, sizes, whose, own=own)
        solid = both.static if both.static.is_surface else None
        yield Worst(relation, both, relation.clearance, np.inf, solid=solid, columns=whose)


def _between(
    relation: Problem, sizes: Sizes, whose: list[int], *, own: bool, body: Body | None = None,
    places: Array | None = None,
) -> BodyGaps:  # fmt: skip
    """Return the gap of two parts over all their sizes, or of the movable one and a `body` whose scales it has."""
    bodies = relation.at_scales if own else relation.bodies_made
    one, two = bodies["movable"], bodies["static"] if body is None else body
    mine = tuple(size for size in relation.sizes if own and (body is None or size.body == "movable"))
    if mine:
        return OwnSizes(one, two, mine, places)
    box, listed = (np.ones((2, 2)), None) if own else (sizes.box[whose], sizes.pairs)
    if body is not None:
        box = np.vstack([box[0], np.ones(2)])
        listed = None if listed is None else np.column_stack([listed[:, 0], np.ones(len(listed))])
    return Scales(one, two, Sizes(box, pairs=listed))


def obstacles(problem: Problem) -> list[tuple[Body, float, Body | None]]:
    """Return the keep-outs of a problem as bodies, over all of their scales, and how far to keep clear of them.

    With the solid itself, where only its surface is known.
    """
    found = []
    for own in problem.keep_out:
        seed = own.body.seed
        parts = [seed + scale * (part.vertices - seed) for part, scale in own.obstacles]
        solid = own.body if own.body.is_surface else None
        found.append((Body.from_parts(parts, seed=seed, name=own.name), own.clearance, solid))
    return found


def domain(worst: Worst, most: float, amount: float) -> Array:
    """Return the limits of the parameters outside which no pose is wanted, (k, 2).

    None is whose largest gap exceeds `most`, nor a motion of a larger weighted `amount`. A turn beyond half a
    revolution repeats a smaller one where the limits have that one. A gap is no less than the distance of the seeds
    less what both bodies reach, so that the seed of body 1 comes to lie in a ball; from the balls before and after
    them follows how long translations are. What no such bound is known of may be infinite.
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
    """Return limits narrowed to what leads the seed of body 1 into a ball about that of body 2."""
    # each turn about a fixed point keeps a seed on its sphere: it is before all translations, or after them
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
