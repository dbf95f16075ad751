"""The checker of proofs: whether excluded cells of motions bound the amount of every motion that does what is asked.

It takes nothing from what made a proof but the proof itself (`fcdm_opt.problem.evidence`). That the cells leave
nothing out is counted exactly. What each claims is built anew from the problem: functions of the pose, of explicit
vertices and of nothing else, written in CasADi, differentiated there and worked out in intervals. Over a cell they
are bounded by the mean value form, f(centre) + slopes over the cell times half widths; where that does not suffice the
cell is halved. Shared is what a problem means: nominal contact, tracked features, target, motion conventions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from fcdm_opt.curve.kernels import E1E2, F1V2, V1F2
from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.geometry.measures import nearest_mixture
from fcdm_opt.model.equations import FeaturePoints, feature_points
from fcdm_opt.model.seats import flush_of, held, untracked
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.evidence import WITNESS, Evidence, Reason
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.solution import Check
from fcdm_opt.proof import conditions
from fcdm_opt.proof.intervals import Interval, cross, numbers_of
from fcdm_opt.proof.mean_value import AmountOfPieces, Pieces, Place, Poses, PosesOfPieces
from fcdm_opt.tolerances import DEFAULT

Margins = Iterator[tuple[Any, Array]]
"""Pieces, and by how much what their witness rows say holds all over them; of others it does not."""
Test = Callable[[Poses, Array], Margins]

HALVINGS = 34  # times that a cell is halved at most: to one in ten thousand million of its width all of it is shown
PIECES = 100_000  # pieces of cells looked at after one halving, at most: what is left counts as not shown
BATCH = 4096  # pieces of cells looked at together
ACCURACY = 1e-9  # relative, to which the user's own amount is what is claimed
FLOATS = 2.0**-48  # relative rounding of what a handful of operations on floats gave


def check_evidence(problem: Problem, evidence: Evidence, lower_bound: float) -> tuple[Check, ...]:
    """Check a proof that no motion of a smaller amount than `lower_bound`, or none at all, does what a problem asks."""
    # the evidence is taken at its word in nothing. Returned are checks of the cover of all directions and stretches, of
    # the bound, and of each reason
    flaw = _flaw(problem, evidence)
    if flaw:
        return (Check("proof well-formed", False, 1.0, 0.0, flaw),)
    with np.errstate(all="ignore"):  # what cannot be computed is nan or infinite, and passes no check
        judge = Examiner(problem, evidence, lower_bound)
        return (*judge.cover(), judge.bound(lower_bound), *judge.reasons())


def _flaw(problem: Problem, evidence: Evidence) -> str:
    """Return what keeps a proof from being looked at, "" if nothing does."""
    k, n, c = len(problem.weights), len(evidence.faces), len(evidence.column_faces)
    shapes = {
        "limits": (k, 2),
        "faces": (n,),
        "boxes": (n, 2, k - 1),
        "stretches": (n, 2),
        "reasons": (n,),
        "first": (n + 1,),
        "witnesses": (len(evidence.witnesses), WITNESS),
        "column_faces": (c,),
        "column_boxes": (c, 2, k - 1),
        "fronts": (c,),
    }
    for name, shape in shapes.items():
        if getattr(evidence, name).shape != shape:
            return f"{name} are of shape {getattr(evidence, name).shape}, not {shape}"
    if problem.amount == "displacement":
        return "the amount is neither the weighted one nor the user's own"
    for name in ("faces", "column_faces"):
        if not np.isin(getattr(evidence, name), np.arange(2 * k)).all():
            return f"{name} name no face of the cube"
    for name in ("boxes", "column_boxes"):
        low, high = getattr(evidence, name)[:, 0], getattr(evidence, name)[:, 1]
        if not ((low >= -1.0) & (low <= high) & (high <= 1.0)).all():
            return f"{name} do not lie on the cube"
    start, end = evidence.stretches.T
    if not ((start >= 0.0) & (start <= end) & (end < np.inf)).all():
        return "stretches are none"
    if not (evidence.limits[:, 0] <= evidence.limits[:, 1]).all():
        return "limits are none"
    if not (evidence.fronts >= 0.0).all():
        return "fronts are none"
    if evidence.first[0] != 0 or (np.diff(evidence.first) < 1).any() or evidence.first[-1] != len(evidence.witnesses):
        return "the witness rows do not belong to the cells"
    return ""


# ---------------------------------------------------------------------------------------------------------------- cover


def least_outside(amount: OwnAmount, weights: Array, half: float) -> float:
    """Return an amount of the user's own that no motion with a weighted parameter beyond `half` is below."""
    faces, wide = np.arange(2 * len(weights)), np.ones((2 * len(weights), len(weights) - 1))
    cells = Pieces.of(faces, np.stack([-wide, wide], axis=1), np.full((len(faces), 2), half))
    with np.errstate(all="ignore"):
        return float(np.nan_to_num(AmountOfPieces(amount.function, weights).least_beyond(cells), nan=-np.inf).min())


def uncovered(faces: Ints, low: Array, high: Array, counts: Ints) -> tuple[int, Array] | None:
    """Return a point (face, coordinates) near which boxes, counted with these signs, do not cancel; None if all do."""
    # the indicator of a box is a sum over its corners, with alternating signs, of indicators of quadrants; those are
    # independent, so boxes cancel but for borders if and only if their corners do. No arithmetic is done on coordinates
    n, m = low.shape
    corners = np.array(list(product((0, 1), repeat=m)), dtype=np.int64).reshape(2**m, m)
    signs = (counts[:, None] * (1 - 2 * (corners.sum(axis=1) & 1))[None]).ravel()
    key = np.repeat(faces.astype(np.int64), len(corners))
    for axis in range(m):
        values, places = np.unique(np.stack([low[:, axis], high[:, axis]], axis=1), return_inverse=True)
        _, key = np.unique(key * len(values) + places.reshape(n, 2)[:, corners[:, axis]].ravel(), return_inverse=True)
    wrong = np.flatnonzero(np.bincount(key, weights=signs, minlength=1) != 0)
    if not len(wrong):
        return None
    row, corner = divmod(int(np.flatnonzero(key == wrong[0])[0]), len(corners))
    return int(faces[row]), np.where(corners[corner] == 0, low[row], high[row])


def filled_box(boxes: Array) -> tuple[Array, bool]:
    """Return the ends of the box that boxes span, (2, k), and whether they fill it, each place of it once."""
    ends, count = np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]), len(boxes)
    wide = ends[0] < ends[1]  # along others all boxes are the same point, and would cancel each other
    low, high = np.concatenate([boxes, ends[None]])[:, :, wide].swapaxes(0, 1)
    return ends, uncovered(np.zeros(count + 1, np.int64), low, high, np.append(np.ones(count), -1.0)) is None


# ------------------------------------------------------------------------------------------------------- the examiner


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A convex part that the parts of body 1 meet, as placed: vertices about s_2, and the least gap asked for."""

    part: ConvexPart
    vertices: Interval
    need: float


@dataclass(frozen=True, eq=False)
class TrackedCrossing:
    """What the tracked scale pair follows from: `kinds` and `given` numbers, as `conditions.crossing` takes them."""

    kinds: tuple[int, ...]
    given: list[Interval]
    face_normals: Array  # where a vertex touches an edge, the normals of the faces beside the edge, else empty


class Examiner:
    """What a problem asks of a motion, and why the cells of a proof are said not to do it."""

    def __init__(self, problem: Problem, evidence: Evidence | None, claimed: float = np.inf) -> None:
        self.problem, self.claimed = problem, claimed
        if evidence is not None:
            self.evidence = evidence
        self.kinematics = PosesOfPieces(problem)
        self.target = problem.target.tolist()

    # ------------------------------------------------------------------------------------------------------ meaning

    @cached_property
    def features(self) -> tuple[tuple[FeaturePoints, ...], int]:
        """The features whose lines the goal speaks of, and how many of them are tracked."""
        problem = self.problem
        if problem.goal not in TRACKING or problem.contacts:
            return (), 0
        lines: Any = problem.tracked_lines
        seats = problem.nominal_seats if problem.goal == "seat" else ()
        if seats:
            lines = tuple(flush_of(line, seats) or line for line in lines)
        others = untracked(seats, lines, problem.target)
        bodies = problem.active
        made = (feature_points(*bodies, own.site, own.parts, own.normal, np.eye(3)) for own in (*lines, *others))
        return tuple(made), len(lines)

    @cached_property
    def crossing(self) -> TrackedCrossing | None:
        """What the tracked scale pair follows from; None for one line."""
        # two features of a part pair that share an edge of one part and a vertex of the other meet where this vertex
        # lies on the line of this edge; so they do in passing, where their own lines coincide
        features, count = self.features
        if count != 2:
            return None
        given = [Interval(x) for x in self.target]
        one, two = features[:2]
        bodies = self.problem.active
        for own in (0, 1) if one.parts == two.parts else ():  # the body of the edge
            parts = [body.parts[k] for body, k in zip(bodies, one.parts, strict=True)]
            shared = [sorted(_corners(one, k, parts[k]) & _corners(two, k, parts[k])) for k in (0, 1)]
            if len(shared[own]) == 2 and len(shared[1 - own]) == 1:
                ends = Interval(parts[own].vertices[shared[own]]) - bodies[own].seed
                corner = Interval(parts[1 - own].vertices[shared[1 - own][0]]) - bodies[1 - own].seed
                points = (ends[0], corner) if own == 0 else (corner, ends[0])
                sides = [set(shared[own]) <= set(loop) for loop in parts[own].loops]
                return TrackedCrossing(
                    (own,), [*given, *numbers_of(ends[1] - ends[0], *points)], parts[own].normals[sides]
                )
        given += [x for feature in (one, two) for x in numbers_of(*self._feature(feature))]
        return TrackedCrossing((one.kind, two.kind), given, np.empty((0, 3)))

    def _feature(self, feature: FeaturePoints) -> tuple[Interval, Interval, Interval, Interval]:
        """Return (u, w, x, y) of a feature: its direction, not of unit length, and a point of each body."""
        p, q, r, s = (Interval(point) for point in feature.points.T)
        nothing = Interval(np.zeros(3))
        if feature.kind == E1E2:
            u, w = q - p, (s - r) * feature.sign
        else:
            sides = (q - p, r - p) if feature.kind == F1V2 else (r - q, s - q)
            u, w = cross(*sides) * feature.sign, nothing
        return u, w, p - self.problem.movable.seed, s - self.problem.static.seed

    @cached_property
    def coherent(self) -> bool:
        """Whether what is tracked must be the contact all the way."""
        return self.problem.path == "coherent" and self.features[1] > 0

    @cached_property
    def limits(self) -> Array:
        """The limits, narrowed where what lies beyond will not do or repeats smaller motions."""
        # zero for parameters that tilt a flush contact which must stay so on the way. Goals that ask for poses alone
        # are met by a turn q of a step that repeats itself if they are by q - 2 pi, which is smaller for q > pi:
        # nothing need be beyond pi, nor, where the other limit keeps q - 2 pi out, beyond a whole turn from it. And
        # where the seed only shifts, parts do not touch further out than the seeds' distance and both reaches
        problem = self.problem
        limits = np.array(problem.limits)
        around = (limits[:, 0] <= 0) & (limits[:, 1] >= 0)
        if problem.goal == "seat" and self.coherent:
            limits[held(problem.nominal_seats, problem.motion, problem.movable, problem.static) & around] = 0.0
        directions = problem.motion.shift_directions
        half, largest = np.pi * (1.0 + FLOATS), self._largest_shift([own for own in directions if own is not None])
        for k, (step, direction) in enumerate(zip(problem.motion.owners, directions, strict=True)):
            low, high = limits[k]
            if direction is None and self.features[1]:
                continue
            if step.closed and around[k] and not isinstance(problem.amount, OwnAmount):
                limits[k] = max(low, min(-half, high - 2.0 * half)), min(high, max(half, low + 2.0 * half))
            elif direction is not None:
                limits[k] = max(low, -largest), min(high, largest)
        return limits

    def _largest_shift(self, shifts: Sequence[Array]) -> float:
        """Return a translation beyond which nothing touches; infinite if that is not known or not asked."""
        kept = self.coherent and self.problem.goal in ("at", "seat")
        if not ((self.must_touch or kept) and self.problem.motion.about_seed and 0 < len(shifts) <= 3):
            return np.inf
        least = float(np.linalg.svd(np.array(shifts), compute_uv=False)[-1]) - DEFAULT.nominal
        parts = [_norm(own).max() for own in self.movable]
        others = [_norm(own.vertices).max() for own in self.obstacles[: len(self.problem.active[1].parts)]]
        away = _norm(Interval(self.problem.static.seed) - self.problem.movable.seed)
        return float((away + max(parts) + max(others)) * (1.0 + FLOATS) / least) if least > 0 else np.inf

    @cached_property
    def must_touch(self) -> bool:
        """Whether the target pair must touch."""
        return "touch" in (self.problem.goal, self.problem.pair)

    @cached_property
    def movable(self) -> list[Interval]:
        """Vertices of the parts of body 1 at the scale made, about the moved seed in its own axes."""
        own = self.problem.active[0]
        return [(Interval(part.vertices) - own.seed) * self.target[0] for part in own.parts]

    @cached_property
    def obstacles(self) -> list[Obstacle]:
        """The parts of the static body, then those of the keep-outs."""
        problem = self.problem
        seed, clear = problem.static.seed, "clear" in (problem.goal, problem.pair)
        # a contact that ends at the target pair is none where parts overlap at it
        apart = self.must_touch or problem.goal in ("at", "seat")
        need = problem.clearance if clear else 0.0 if apart else -np.inf
        placed = [(part, self.target[1], need) for part in problem.active[1].parts]
        placed += [(part, scale, own.clearance) for own in problem.keep_out for part, scale in own.obstacles]
        return [
            Obstacle(part, Interval(part.seed) - seed + (Interval(part.vertices) - part.seed) * scale, need)
            for part, scale, need in placed
        ]

    # -------------------------------------------------------------------------------------------------------- cover

    @cached_property
    def closing(self) -> frozenset[Reason]:
        """Reasons that exclude every motion further out in the same direction."""
        found = {Reason.BEYOND}
        if self.coherent:
            found |= {Reason.LOOSE} | ({Reason.LEFT} if self.features[1] == 2 else set())
        if (self.limits[:, 0] <= 0).all() and (self.limits[:, 1] >= 0).all():
            found |= {Reason.OUTSIDE}  # the limits are a box around rest: who leaves it does not return
        return frozenset(found)

    def cover(self) -> list[Check]:
        """Check that columns fill all directions, and that cells fill columns up to their fronts, each place once."""
        own, count = self.evidence, len(self.problem.weights)
        faces = np.arange(2 * count)
        cube = np.ones((2 * count, count - 1))
        wrong = uncovered(
            np.concatenate([own.column_faces, faces]),
            np.concatenate([own.column_boxes[:, 0], -cube]),
            np.concatenate([own.column_boxes[:, 1], cube]),
            np.repeat([1, -1], [len(own.fronts), 2 * count]),
        )
        name = "proof: directions"
        checks = [Check(name, wrong is None, float(wrong is not None), 0.0, _where("not covered once", wrong))]
        fronts, closed = np.array(own.fronts), np.isinf(own.fronts)
        ends: dict[tuple[int, bytes], float] = {}
        for row in np.flatnonzero(np.isin(own.reasons, list(self.closing))).tolist():
            key = int(own.faces[row]), (own.boxes[row] + 0.0).tobytes()
            ends[key] = max(ends.get(key, 0.0), float(own.stretches[row, 1]))
        for row in np.flatnonzero(closed).tolist():
            key = int(own.column_faces[row]), (own.column_boxes[row] + 0.0).tobytes()
            fronts[row] = ends.get(key, np.nan)
        open_ends = int(np.isnan(fronts).sum())
        note = f"of {int(closed.sum())} columns have no cell that closes them"
        checks.append(Check("proof: closed columns", open_ends == 0, float(open_ends), 0.0, note))
        stretches = np.column_stack([np.zeros(len(fronts)), np.where(np.isnan(fronts), 0.0, fronts)])
        cells, columns = self._cells, Pieces.of(own.column_faces, own.column_boxes, stretches)
        wrong = uncovered(
            np.concatenate([cells.faces, columns.faces]),
            np.concatenate([cells.low, columns.low]),
            np.concatenate([cells.high, columns.high]),
            np.repeat([1, -1], [len(own.faces), len(fronts)]),
        )
        note = _where("not covered once up to the fronts", wrong)
        checks.append(Check("proof: stretches", wrong is None, float(wrong is not None), 0.0, note))
        return checks

    @cached_property
    def _cells(self) -> Pieces:
        return Pieces.of(self.evidence.faces, self.evidence.boxes, self.evidence.stretches)

    def bound(self, claimed: float) -> Check:
        """Check that no motion of a smaller amount is left."""
        low, high = self.evidence.column_boxes[:, 0], self.evidence.column_boxes[:, 1]
        least = np.maximum(np.maximum(low, -high), 0.0)
        value = float((self.evidence.fronts * np.sqrt(1.0 + (least * least).sum(axis=1))).min(initial=np.inf))
        if self.problem.amount != "weighted":  # which may be less further out: all is to be excluded, or COSTLY
            value = self.claimed if np.isinf(value) else 0.0
        elif value * (1.0 - FLOATS) > _norm(Interval(self.problem.weights * np.abs(self.problem.limits).max(axis=1))):
            value = np.inf  # the limits allow no motion as large
        passed = value * (1.0 + FLOATS) >= claimed
        return Check("proof: lower bound", bool(passed), value, float(claimed), "least amount that the cells leave")

    # ------------------------------------------------------------------------------------------------------ reasons

    def reasons(self) -> Iterator[Check]:
        """Check each cell's reason, all of one reason at once."""
        tests: dict[Reason, Test] = {
            Reason.SHORT: self.short,
            Reason.LOOSE: self.loose,
            Reason.LEFT: self.left,
            Reason.APART: self.apart,
            Reason.MEETS: self.meets,
            Reason.OUTSIDE: self.outside,
            Reason.NEAR: self.near,
        }
        if isinstance(self.problem.amount, OwnAmount):
            tests |= {Reason.COSTLY: self.costly, Reason.BEYOND: self.beyond}
        for code in np.unique(self.evidence.reasons).tolist():
            rows = np.flatnonzero(self.evidence.reasons == code)
            test = tests.get(code)
            name = f"proof: {Reason(code).name}" if code in list(Reason) else f"proof: reason {code}"
            if test is None:
                note = f"cell {rows[0]} and others: no reason that can be checked"
                yield Check(name, False, float(len(rows)), 0.0, note)
                continue
            lost, halved = self._unproved(rows, test)
            note = f"of {len(rows)} cells not shown, {halved} halved to be shown"
            if len(lost):
                cells, row = self.evidence, int(lost[0])
                box = ", ".join(f"[{a:.17g}, {b:.17g}]" for a, b in cells.boxes[row].T.tolist()) or "one"
                start, end = cells.stretches[row].tolist()
                note += f"; first cell {row}: face {cells.faces[row]}, directions {box}, s [{start:.17g}, {end:.17g}]"
            yield Check(name, not len(lost), float(len(lost)), 0.0, note)

    def _unproved(self, rows: Ints, test: Test) -> tuple[Ints, int]:
        """Return the cells of which a margin is not positive all over, and how many were halved."""
        waiting, lost, halved = self._cells[rows], np.array([], dtype=np.int64), 0
        for level in range(HALVINGS + 1):
            waiting = waiting[~self._is_positive(waiting, test)]
            refuted = waiting.rows[~self._is_positive(waiting.centres, test)]
            last = level == HALVINGS or 2 * len(waiting.rows) > PIECES
            lost = np.union1d(lost, waiting.rows if last else refuted)
            waiting = waiting[~np.isin(waiting.rows, lost)]
            if level == 0:
                halved = len(waiting.rows)
            if not len(waiting.rows):
                break
            waiting = waiting.halved()
        return lost, halved

    def _is_positive(self, pieces: Pieces, test: Test) -> Flags:
        """Tell of which pieces a margin is positive all over."""
        shown = np.zeros(len(pieces.rows), dtype=bool)
        for start in range(0, len(shown), BATCH):
            poses = self.kinematics.poses(pieces[start : start + BATCH])
            margin = np.full(len(poses.pieces.rows), -np.inf)
            for here, own in test(poses, self.evidence.witnesses[self.evidence.first[poses.pieces.rows]]):
                margin[here] = own
            shown[start : start + BATCH] = margin > 0.0
        return shown

    def _parts_meant(self, witness: Array, *bodies: int) -> Iterator[tuple[int, int, Ints]]:
        """Yield each part of body 1, each obstacle that counts, and witnesses that start with both and `bodies`."""
        for i, j in product(range(len(self.movable)), range(len(self.obstacles))):
            here = np.flatnonzero((witness[:, : 2 + len(bodies)] == (i, j, *bodies)).all(axis=1))
            if len(here) and np.isfinite(self.obstacles[j].need):
                yield i, j, here

    def short(self, poses: Poses, witness: Array) -> Margins:
        """Yield by how much the tracked pair lies short of the target, or a line misses it."""
        features, _ = self.features
        count = len(witness)
        if self.problem.goal == "beyond":
            if self.crossing is None:
                return
            lows, highs = poses.bounds(conditions.crossing(self.crossing.kinds), self.crossing.given)
            ends = list(zip(lows, highs, strict=True))  # of D, D rho and D (rho - rho_t)
            excess = [
                (low, high) if sign > 0 else (-high, -low)
                for sign, (low, high) in zip(self.problem.signs, ends[3:], strict=True)
            ]
            short = [np.where(lows[0] > 0, -high, np.where(highs[0] < 0, low, -np.inf)) for low, high in excess]
            for code, own in enumerate((*short, _opposed(*excess), _opposed(*ends[1:3]))):
                here = witness[:, 0] == code
                yield here, _flat(own, count)[here]
        elif self.problem.goal == "at" and self.crossing is not None and len(self.crossing.face_normals):
            yield slice(None), self._off_edge(poses, self.crossing)
        else:
            for k, feature in enumerate(features):
                here = np.flatnonzero(witness[:, 0] == k)
                if len(here):
                    u, w, x, y = self._feature(feature)
                    given = numbers_of(u, w, x * self.target[0], y * self.target[1])
                    (low,), (high,) = poses[here].bounds(conditions.separation(feature.kind), given)
                    yield here, _flat(np.maximum(low, -high), len(here))

    def _off_edge(self, poses: Poses, crossing: TrackedCrossing) -> Array:
        """Return a margin by which the vertex that touches an edge is off its line at the target pair."""
        # across the edge, along the normal of a face beside it or what is near that and at right angles
        u, x, y = (Interval.stacked(crossing.given[2 + 3 * k : 5 + 3 * k], ()) for k in range(3))
        points = x * self.target[0], y * self.target[1]
        margin = np.full(len(poses.pieces.rows), -np.inf)
        for n in crossing.face_normals:
            across = cross(u, cross(Interval(n), u))  # at right angles to the edge, whatever n is
            given = numbers_of(across, Interval(np.zeros(3)), *points)
            (low,), (high,) = poses.bounds(conditions.separation((F1V2, V1F2)[crossing.kinds[0]]), given)
            margin = np.fmax(margin, np.maximum(low, -high)[:, 0])
        return margin

    def loose(self, poses: Poses, witness: Array) -> Margins:
        """Yield by how much a vertex reaches beyond the plane of a tracked feature, which then is no contact."""
        features, tracked = self.features
        bodies = self.problem.active
        for k, body in product(range(tracked), (0, 1)):
            feature = features[k]
            part = bodies[body].parts[feature.parts[body]]
            u, w, *points = self._feature(feature)
            vertex, known = _index(witness[:, 2], len(part.vertices))
            here = np.flatnonzero((witness[:, 0] == k) & (witness[:, 1] == body + 1) & known)
            if not len(here):
                continue
            lever = Interval(part.vertices[vertex[here]]) - bodies[body].seed - points[body]
            (low,), _ = poses[here].bounds(conditions.height(feature.kind, body), numbers_of(u, w, lever))
            flat = DEFAULT.planarity * self.problem.size * _norm(u) * (_norm(w) if feature.kind == E1E2 else 1.0)
            yield here, _flat(low - flat, len(here))

    def left(self, poses: Poses, witness: Array) -> Margins:
        """Yield by how much a direction keeps the tracked parts apart at the tracked pair."""
        movable, static = self.problem.active
        if self.crossing is None or len(movable.parts) != 1 or len(static.parts) != 1:
            return  # parts of unions may be left for one another
        kinds, given = self.crossing.kinds, self.crossing.given
        one, two = Interval(movable.parts[0].vertices) - movable.seed, Interval(static.parts[0].vertices) - static.seed
        for kind, here, u, w in _directions(witness):
            own = poses[here]
            first, second, heights = _extremes(own, kind, u, w, one, two)
            lows, highs = own.bounds(conditions.crossing(kinds), given)
            (low,), (high,) = own.bounds(
                conditions.gap_at_crossing(kinds, kind), [*given, *numbers_of(u, w, first, second)]
            )
            up, down = lows[0] > 0, highs[0] < 0
            gap = np.where(up, low, np.where(down, -high, -np.inf))[:, 0]
            scales = [np.where(up, highs[1 + i], -lows[1 + i])[:, 0] for i in (0, 1)]
            yield here, gap - sum(np.maximum(s, 0.0) * r for s, r in zip(scales, heights, strict=True)) * (1.0 + FLOATS)

    def apart(self, poses: Poses, witness: Array) -> Margins:
        """Yield by how much a direction for each part pair keeps it apart at the target pair."""
        count, others = len(poses.pieces.rows), len(self.problem.active[1].parts)
        if not self.must_touch:
            return
        first = self.evidence.first
        rows = np.diff(first)[poses.pieces.rows] == len(self.movable) * others
        margin = np.where(rows, np.inf, -np.inf)
        for row, (i, j) in enumerate(product(range(len(self.movable)), range(others))):
            witness = self.evidence.witnesses[np.where(rows, first[poses.pieces.rows] + row, 0)]
            gap = np.full(count, -np.inf)
            for kind, here, u, w in _directions(witness):
                own, two = poses[here], self.obstacles[j].vertices
                x, y, heights = _extremes(own, kind, u, w, self.movable[i], two)
                (low,), _ = own.bounds(conditions.separation(kind), numbers_of(u, w, x, y))
                gap[here] = low[:, 0] - (heights[0] + heights[1]) * (1.0 + FLOATS)
            margin = np.minimum(margin, gap)
        yield slice(None), margin

    def meets(self, poses: Poses, witness: Array) -> Margins:
        """Yield how deep a point of an edge of one part is inside the other, or one that moves with body 1."""
        for body, (i, j, here) in ((k, own) for k in (0, 1) for own in self._parts_meant(witness, k + 1)):
            obstacle = self.obstacles[j]
            sides = (self.problem.active[0].parts[i], self.movable[i]), (obstacle.part, obstacle.vertices)
            (edged, points), (part, corners) = sides[body], sides[1 - body]
            (origin, last), known = _ends_of_edges(witness[here], edged)
            start, end = points[origin], points[last]
            along = end - start
            own = poses[here]
            place, beyond = self._place(own, witness[here])
            normals, planes = face_planes(part, corners)
            given = [*planes, *(x for vector in (start, along) for x in numbers_of(vector))]
            lows, _ = own.bounds(conditions.depth(body), given, place)
            depth = lows[0].min(axis=1) - beyond * _norm(along) * _norm(Interval(normals)).max()
            yield here, np.where(known, depth, -np.inf)
        for i, j, here in self._parts_meant(witness, 3):
            yield here, self._depth_of_point(poses[here], witness[here, 4:7], i, j)

    def _depth_of_point(self, poses: Poses, x: Array, i: int, j: int) -> Array:
        """Return how deep a point that moves with body 1 is inside an obstacle, less how far it is from the part."""
        obstacle, none = self.obstacles[j], Interval(np.zeros((len(x), 1)))
        normals, planes = face_planes(obstacle.part, obstacle.vertices)
        still = Place(none, none, Interval(np.zeros((len(x), 1, poses.pieces.half.shape[1]))))
        given = [*planes, *numbers_of(Interval(x), Interval(np.zeros_like(x)))]
        lows, _ = poses.bounds(conditions.depth(0), given, still)
        return np.asarray(lows[0].min(axis=1) - distances_from(x, self.movable[i]) * _norm(Interval(normals)).max())

    def _place(self, poses: Poses, witness: Array) -> tuple[Place, Array]:
        """Return where on its edge a point is, and how far beyond the edge's ends at most."""
        pieces, cells = poses.pieces, self._cells[poses.pieces.rows]
        middle, half = 0.5 * (cells.low + cells.high), 0.5 * (cells.high - cells.low)
        rates = np.where(half > 0, witness[:, 5 : 5 + half.shape[1]] / np.where(half > 0, half, 1.0), 0.0)
        centre = Interval(witness[:, 4:5])
        for j in range(half.shape[1]):
            centre = centre + Interval(rates[:, j : j + 1]) * (Interval(pieces.centre) - middle)[:, j : j + 1]
        change = Interval(rates[:, None]) * Interval(pieces.half[:, None])
        over = centre + Interval(0.0, change.size.sum(axis=2) * (1.0 + FLOATS))
        beyond = np.maximum(np.maximum(-over.low, over.high - 1.0), 0.0)[:, 0]
        return Place(centre, over, change), beyond

    def outside(self, poses: Poses, witness: Array) -> Margins:
        """Yield by how much a parameter is beyond a limit."""
        y = poses.pieces.coordinates(over=True)
        for k, (own, weight, ends) in enumerate(zip(y, self.problem.weights.tolist(), self.limits, strict=True)):
            low, high = (Interval(end) * weight if np.isfinite(end) else Interval(end) for end in ends)
            here = witness[:, 0] == k
            yield here, np.maximum(own.low - high.high, low.low - own.high)[here]

    def near(self, poses: Poses, witness: Array) -> Margins:
        """Yield by how much points of two parts are nearer than the gap asked for, squared."""
        for i, j, here in self._parts_meant(witness):
            obstacle = self.obstacles[j]
            x, y = witness[here, 2:5], witness[here, 5:8]
            off = distances_from(x, self.movable[i]) + distances_from(y, obstacle.vertices)
            need = (obstacle.need - off) * (1.0 - FLOATS)
            (low,), _ = poses[here].bounds(
                conditions.nearness(), [*numbers_of(Interval(x), Interval(y)), Interval(need[:, None])]
            )
            yield here, np.where(need > 0, low[:, 0], -np.inf)

    def costly(self, poses: Poses, _: Array) -> Margins:
        """Yield by how much the amount, the user's own, is more than what is claimed."""
        yield slice(None), self._amount_bounds.least(poses.pieces) - self.claimed * (1.0 - ACCURACY)

    def beyond(self, poses: Poses, _: Array) -> Margins:
        """Yield the same of all motions from here on outwards."""
        yield slice(None), self._amount_bounds.least_beyond(poses.pieces) - self.claimed * (1.0 - ACCURACY)

    @cached_property
    def _amount_bounds(self) -> AmountOfPieces:
        return AmountOfPieces(self.problem.amount.function, self.problem.weights)


def _where(what: str, point: tuple[int, Array] | None) -> str:
    """Return in words where boxes do not cancel."""
    if point is None:
        return "each covered once"
    face, coordinates = point
    return f"{what}: beside face {face}, {', '.join(f'{x:.17g}' for x in coordinates.tolist())}"


def _opposed(x: tuple[Array, Array], y: tuple[Array, Array]) -> Array:
    """Return by how much two numbers, given by their ends, have different signs."""
    return np.asarray(np.maximum(np.minimum(x[0], -y[1]), np.minimum(-x[1], y[0])))


def _corners(feature: FeaturePoints, body: int, part: ConvexPart) -> set[int]:
    """Return the vertices of a feature's element of one body."""
    kind, place = feature.site[0], feature.site[1 + body]
    if kind == E1E2:
        return set(part.edges[place, :2].tolist())
    return set(part.loops[place]) if kind == (F1V2, V1F2)[body] else {place}


def _norm(v: Interval) -> Any:
    """Return an upper bound of the lengths of vectors."""
    size = v.size
    return np.sqrt((size * size).sum(axis=-1)) * (1.0 + FLOATS)


def _ends_of_edges(witness: Array, part: ConvexPart) -> tuple[Ints, Flags]:
    """Return the vertices that edges of a part run between, by the rows that name them, (2, n), and which there are."""
    ends, known = _index(np.stack([witness[:, 3], witness[:, -1] - 1.0]), len(part.vertices))
    edge, numbered = _index(witness[:, 3], len(part.edges))
    by_number = witness[:, -1] == 0.0
    return np.where(by_number, part.edges[edge, :2].T, ends), np.where(by_number, numbered, known.all(axis=0))


def _index(values: Array, count: int) -> tuple[Ints, Flags]:
    known = (values >= 0) & (values < count) & (values == np.floor(values))
    return np.where(known, values, 0).astype(np.int64), known


def _flat(margin: Any, count: int) -> Array:
    return np.array(np.broadcast_to(margin, (count, 1))[:, 0])


def _directions(witness: Array) -> Iterator[tuple[int, Ints, Interval, Interval]]:
    """Return, for each kind of direction, the pieces whose witness has it, with u and w, (n, 3) each."""
    for kind in (F1V2, V1F2, E1E2):
        here = np.flatnonzero((witness[:, 0] == kind) & (np.abs(witness[:, 1]) == 1.0))
        if len(here):
            sign = witness[here, 1:2]
            u, w = witness[here, 2:5], witness[here, 5:8]
            yield kind, here, Interval(u if kind == E1E2 else sign * u), Interval(sign * w)


def _extremes(
    poses: Poses, kind: int, u: Interval, w: Interval, one: Interval, two: Interval
) -> tuple[Interval, Interval, list[Array]]:
    """Return the vertices of two parts that are nearest to each other along directions, and what others reach beyond.

    These are (n, 3) each, at the centres of the pieces; upper bounds over them, (n,) each, are not negative.
    """
    R = np.concatenate([x.middle for x in poses.centre[:9]], axis=1).reshape(-1, 3, 3)
    if kind == V1F2:
        n = u.middle
    else:
        n = np.einsum("nij,nj->ni", R, u.middle)
        if kind == E1E2:
            n = np.cross(n, w.middle)
    nearest = np.einsum("nij,ni,vj->nv", R, n, one.middle).argmax(axis=1), (n @ two.middle.T).argmin(axis=1)
    points, heights = [], []
    for body, (vertices, place) in enumerate(zip((one, two), nearest, strict=True)):
        own = vertices[place]
        further = [
            vertices[..., k][None] - Interval(own.middle[:, k : k + 1], own.radius[:, k : k + 1]) for k in range(3)
        ]
        _, (high,) = poses.bounds(conditions.height(kind, body), [*numbers_of(u, w), *further])
        points.append(own)
        heights.append(np.maximum(high, 0.0).max(axis=1) * np.ones(len(place)))
    return points[0], points[1], heights


def face_planes(part: ConvexPart, vertices: Interval) -> tuple[Array, list[Interval]]:
    """Return directions, and their numbers with levels, below all of which all is inside a part with these vertices."""
    # the level of a face is that of its lowest vertex: a point beyond the part is seen from inside it through some hull
    # facet, whose vertices are among those of one face, and lies higher than they do
    normals = np.asarray(part.normals)
    levels = []
    for loop, n in zip(part.loops, normals, strict=True):
        corners = vertices[list(loop)]
        heights = corners[..., 0] * n[0] + corners[..., 1] * n[1] + corners[..., 2] * n[2]
        levels.append(float(heights.low.min()))
    return normals, [*(Interval(x[None]) for x in normals.T), Interval(np.array([levels]), np.zeros((1, len(levels))))]


def distances_from(points: Array, vertices: Interval) -> Array:
    """Return upper bounds of the distances of points from the hull of vertices, (n,): from mixtures of these."""
    corners = vertices.middle
    scale = np.abs(corners).max()
    rounding = len(corners) * (scale * FLOATS + vertices.radius.max())
    rows, places = np.unique(points, axis=0, return_inverse=True)
    found = np.empty(len(rows))
    for k, point in enumerate(rows):
        shares = nearest_mixture((corners - point) / scale)
        found[k] = np.linalg.norm(point - shares @ corners) * (1.0 + FLOATS) + rounding
    return found[places.ravel()]
