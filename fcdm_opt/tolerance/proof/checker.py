"""The checker of proofs: whether excluded cells of motions bound the amount of every motion that does what is asked.

It takes nothing from what made a proof but the proof itself (`fcdm_opt.tolerance.evidence`). That the cells leave
nothing out is counted exactly. What each claims is built anew from the problem: functions of the pose, of explicit
vertices and of nothing else, written in CasADi, differentiated there and worked out in intervals. Over a cell they
are bounded by the mean value form, f(centre) + slopes over the cell times half widths; where that does not suffice the
cell is halved. Shared is what a problem means: nominal contact, tracked features, target, motion conventions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fcdm_opt.curve.kernels import E1E2, F1V2, V1F2
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.motion import Free, Motion, Rotation, Screw, Step, Translation
from fcdm_opt.own_motion import OwnMotion
from fcdm_opt.tolerance.equations import FeaturePoints, feature_points
from fcdm_opt.tolerance.evidence import WITNESS, Evidence, Reason
from fcdm_opt.tolerance.problem import TRACKING, Problem
from fcdm_opt.tolerance.proof.intervals import Interval, Program
from fcdm_opt.tolerance.solution import Check
from fcdm_opt.tolerance.stages.seat import besides, held, seat_of
from fcdm_opt.tolerances import DEFAULT

Bools = NDArray[np.bool_]

HALVINGS = 12  # times that a cell is halved at most
BATCH = 4096  # pieces of cells looked at together
FLOATS = 2.0**-48  # relative rounding of a bound, a product of two numbers that a handful of roundings gave
POSE = 12  # numbers of a pose: R, row by row, and d = s_2 - moved s_1


def check_evidence(problem: Problem, evidence: Evidence, lower_bound: float) -> tuple[Check, ...]:
    """Check a proof that no motion with a smaller amount does what a problem asks.

    Parameters
    ----------
    problem : Problem
        With the weighted amount.
    evidence : Evidence
        Taken at its word in nothing.
    lower_bound : float
        What it is said to prove; infinite where no motion is to do at all.

    Returns
    -------
    tuple of Check
        One for the cover of all directions and stretches, one for the bound, one for each reason.
    """
    flaw = _flaw(problem, evidence)
    if flaw:
        return (Check("proof well-formed", False, 1.0, 0.0, flaw),)
    with np.errstate(all="ignore"):  # what cannot be computed is nan or infinite, and passes no check
        judge = _Examiner(problem, evidence)
        return (*judge.cover(), judge.bound(lower_bound), *judge.reasons())


def _flaw(problem: Problem, evidence: Evidence) -> str:
    """Return what keeps a proof from being looked at, "" if nothing does."""
    k, n, c = len(problem.weights), len(evidence.faces), len(evidence.column_faces)
    shapes = {
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
    if problem.amount != "weighted":
        return "the amount is not the weighted one"
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
    if not (evidence.fronts >= 0.0).all():
        return "fronts are none"
    if evidence.first[0] != 0 or (np.diff(evidence.first) < 1).any() or evidence.first[-1] != len(evidence.witnesses):
        return "the witness rows do not belong to the cells"
    return ""


# ---------------------------------------------------------------------------------------------------------------- cover


def _left_over(faces: Ints, low: Array, high: Array, counts: Ints) -> tuple[int, Array] | None:
    """Return a point (face, coordinates) near which boxes, counted with these signs, do not cancel; None if all do.

    The indicator of a box is a sum over its corners, with alternating signs, of indicators of quadrants; those are
    independent, so boxes cancel but for borders if and only if their corners do. No arithmetic is done on coordinates.
    """
    n, m = low.shape
    corners = np.array(list(product((0, 1), repeat=m)), dtype=np.int64).reshape(2**m, m)
    signs = (counts[:, None] * (1 - 2 * (corners.sum(axis=1) & 1))[None]).ravel()
    key = np.repeat(faces.astype(np.int64), len(corners))
    for axis in range(m):
        ends = np.stack([low[:, axis], high[:, axis]], axis=1)
        values, places = np.unique(ends, return_inverse=True)
        own = places.reshape(n, 2)[:, corners[:, axis]].ravel()
        _, key = np.unique(key * len(values) + own, return_inverse=True)
    total = np.bincount(key, weights=signs, minlength=1)
    wrong = np.flatnonzero(total != 0)
    if not len(wrong):
        return None
    place = int(np.flatnonzero(key == wrong[0])[0])
    row, corner = divmod(place, len(corners))
    return int(faces[row]), np.where(corners[corner] == 0, low[row], high[row])


# ------------------------------------------------------------------------------------------ what is to be positive


def _vector(*parts: Any) -> Any:
    import casadi

    return casadi.vertcat(*parts)


def _one(kind: int, R: Any, u: Any, w: Any, x: Any) -> Any:
    """Return n . R x along a direction: n = R u (a face of body 1), u (of body 2) or R u x w (two edges)."""
    import casadi

    if kind == F1V2:
        return casadi.dot(u, x)
    if kind == V1F2:
        return casadi.dot(u, R @ x)
    return casadi.dot(w, R @ casadi.cross(x, u))  # (R u x w) . R x = w . (R x x R u)


def _two(kind: int, R: Any, u: Any, w: Any, y: Any) -> Any:
    """Return n . y along a direction, see `_one`."""
    import casadi

    if kind == F1V2:
        return casadi.dot(R @ u, y)
    if kind == V1F2:
        return casadi.dot(u, y)
    return casadi.dot(R @ u, casadi.cross(w, y))


@dataclass(frozen=True, eq=False)
class Expression:
    """Functions of a pose and of given numbers, and their derivatives by the pose.

    Attributes
    ----------
    values : Program
        (pose, given) -> values.
    slopes : Program
        (pose, given) -> values, derivatives column by column.
    count : int
        Number of values.
    """

    values: Program
    slopes: Program
    count: int

    @classmethod
    def of(cls, size: int, build: Callable[[Any, Any, Any], Any]) -> Expression:
        """Build from a function (R, d, given) -> values; `size` numbers are given."""
        import casadi

        pose, given = casadi.SX.sym("pose", POSE), casadi.SX.sym("given", size)
        R = casadi.reshape(pose[:9], 3, 3).T
        values = casadi.densify(casadi.vertcat(build(R, pose[9:], given)))
        slopes = casadi.vec(casadi.densify(casadi.jacobian(values, pose)))
        options = {"cse": True}
        return cls(
            Program(casadi.Function("values", [pose, given], [values], options)),
            Program(casadi.Function("slopes", [pose, given], [values, slopes], options)),
            values.shape[0],
        )


@cache
def _separation(kind: int) -> Expression:
    """Given (u, w, x, y): n . (d + y - R x), how far y is from x along a direction."""
    return Expression.of(
        12,
        lambda R, d, p: _two(kind, R, p[:3], p[3:6], d + p[9:]) - _one(kind, R, p[:3], p[3:6], p[6:9]),
    )


@cache
def _height(kind: int, body: int) -> Expression:
    """Given (u, w, x): n . R x, or -n . x for a point of body 2: how far a point reaches towards the other body."""
    if body == 0:
        return Expression.of(9, lambda R, d, p: _one(kind, R, p[:3], p[3:6], p[6:]))
    return Expression.of(9, lambda R, d, p: -_two(kind, R, p[:3], p[3:6], p[6:]))


def _crossing(kinds: tuple[int, ...], R: Any, d: Any, p: Any) -> tuple[Any, Any, Any, Any, Any]:
    """Return (D, D rho_1, D rho_2, D (rho_1 - rho_t1), D (rho_2 - rho_t2)) of the tracked scale pair.

    kinds (0,) or (1,): a vertex of one body on an edge of body 1 or 2, rho_1 R x = d + rho_2 y + t u; given the target
    pair, u, x, y. Else those of two features, whose contact lines cross; given the target pair and, for each, u, w, x,
    y. Multiplied by the determinant D, as by Cramer's rule, nothing is divided.
    """
    import casadi

    cross, dot, target = casadi.cross, casadi.dot, (p[0], p[1])
    if len(kinds) == 1:
        u, x, y = p[2:5], p[5:8], p[8:11]
        turned = R @ x
        if kinds[0] == 1:
            beside = cross(y, u)
            across, determinant = cross(turned, u), dot(turned, beside)
        else:
            beside, across = cross(y, R @ u), R @ cross(x, u)
            determinant = -dot(y, across)
        first = dot(d, beside)
        return (
            determinant,
            first,
            dot(d, across),
            first - target[0] * determinant,
            dot(d + target[1] * y, across),
        )
    rows = []
    for kind, q in zip(kinds, (p[2:14], p[14:26]), strict=True):
        u, w, x, y = q[:3], q[3:6], q[6:9], q[9:]
        a, b, c = _one(kind, R, u, w, x), -_two(kind, R, u, w, y), _two(kind, R, u, w, d)
        rows.append((a, b, c, _two(kind, R, u, w, d + target[1] * y) - target[0] * a))
    (a, b, c, g), (e, f, h, i) = rows
    return a * f - e * b, c * f - h * b, a * h - e * c, g * f - i * b, a * i - e * g


@cache
def _crossings(kinds: tuple[int, ...]) -> Expression:
    """The tracked scale pair, see `_crossing`."""
    return Expression.of(_taken(kinds), lambda R, d, p: _vector(*_crossing(kinds, R, d, p)))


@cache
def _gap_at_crossing(kinds: tuple[int, ...], kind: int) -> Expression:
    """D times how far y is from x along a direction at the tracked scale pair; given what that takes, then u, w, x, y."""
    taken = _taken(kinds)

    def build(R: Any, d: Any, p: Any) -> Any:
        determinant, first, second, _, _ = _crossing(kinds, R, d, p[:taken])
        u, w, x, y = (p[taken + 3 * k : taken + 3 * k + 3] for k in range(4))
        return determinant * _two(kind, R, u, w, d) - first * _one(kind, R, u, w, x) + second * _two(kind, R, u, w, y)

    return Expression.of(taken + 12, build)


def _taken(kinds: tuple[int, ...]) -> int:
    return 11 if len(kinds) == 1 else 26


@cache
def _depth(body: int) -> Expression:
    """Given (n, level, start, along, place): how deep a point of an edge is below a plane of the other body.

    The edge of body 1, in its axes about its moved seed, the plane about s_2; or the other way round. `place` is one
    more variable, and the second value its coefficient.
    """

    def build(R: Any, d: Any, p: Any) -> Any:
        import casadi

        n, level, start, along, place = p[:3], p[3], p[4:7], p[7:10], p[10]
        if body == 0:
            rate = casadi.dot(n, R @ along)
            return _vector(level - casadi.dot(n, R @ start - d) - place * rate, -rate)
        rate = casadi.dot(R @ n, along)
        return _vector(level - casadi.dot(R @ n, start + d) - place * rate, -rate)

    return Expression.of(11, build)


@cache
def _nearness() -> Expression:
    """Given (x, y, need): need^2 - |d + y - R x|^2."""

    def build(R: Any, d: Any, p: Any) -> Any:
        import casadi

        return p[6] * p[6] - casadi.sumsqr(d + p[3:6] - R @ p[:3])

    return Expression.of(7, build)


# ---------------------------------------------------------------------------------------------------- cells and poses


@dataclass(frozen=True, eq=False)
class Pieces:
    """Cells, or pieces of them: `rows` tells of which cell each is.

    `low` and `high`, (n, k), are the ends of s, then of the box coordinates.
    """

    rows: Ints
    faces: Ints
    low: Array
    high: Array

    def __getitem__(self, key: Any) -> Pieces:
        return Pieces(self.rows[key], self.faces[key], self.low[key], self.high[key])

    def halved(self) -> Pieces:
        """Return both halves of each, cut across what is longest as an amount."""
        lengths = self.high - self.low
        lengths[:, 1:] *= self.high[:, :1]
        axis = lengths.argmax(axis=1)
        row = np.arange(len(self.rows))
        middle = 0.5 * self.low[row, axis] + 0.5 * self.high[row, axis]
        low, high = np.concatenate([self.low, self.low]), np.concatenate([self.high, self.high])
        high[row, axis] = middle
        low[len(row) + row, axis] = middle
        return Pieces(np.tile(self.rows, 2), np.tile(self.faces, 2), low, high)

    @property
    def centres(self) -> Pieces:
        """Their centres alone."""
        return Pieces(self.rows, self.faces, self.centre, self.centre)

    @cached_property
    def centre(self) -> Array:
        """Some point well inside each, (n, k)."""
        return 0.5 * self.low + 0.5 * self.high

    @cached_property
    def half(self) -> Array:
        """How far each reaches from its centre, (n, k)."""
        return np.nextafter(np.maximum(self.high - self.centre, self.centre - self.low), np.inf)

    def directions(self, s: Interval, t: Interval) -> tuple[list[Interval], list[Interval]]:
        """Return v and y = s v, k numbers each, of s (n,) and box coordinates (n, k - 1)."""
        axis, sign = self.faces >> 1, 1.0 - 2.0 * (self.faces & 1)
        count = self.low.shape[1]
        v = []
        for k in range(count):
            middle, radius = sign.copy(), np.zeros(len(sign))
            for own in range(count):
                if own != k:
                    here, place = axis == own, k - (k > own)
                    middle[here], radius[here] = t.middle[here, place], t.radius[here, place]
            v.append(Interval(middle, radius))
        return v, [s * own for own in v]


@dataclass(frozen=True, eq=False)
class Poses:
    """The poses of pieces: at their centres, over them, and how they change, times half widths; columns (n, 1).

    `jumps` tells where the motion may not be continuous.
    """

    pieces: Pieces
    centre: list[Interval]
    over: list[Interval]
    change: list[list[Interval]]
    jumps: Bools

    def bounds(
        self, expression: Expression, given: Sequence[Interval], place: _Place | None = None
    ) -> tuple[list[Array], list[Array]]:
        """Return lower and upper bounds of each value of an expression, (n, rows) each.

        Parameters
        ----------
        given : sequence of Interval
            Each (n, rows) or what broadcasts to it.
        place : _Place, optional
            What the last of the given numbers is, where it is not fixed over a piece; the last value is then the first
            one's derivative by it.
        """
        still, moving = list(given), list(given)
        if place is not None:
            still.append(place.centre)
            moving.append(place.over)
        (at_centre,), _ = expression.values(self.centre, still)
        (over, slopes), _ = expression.slopes(self.over, moving)
        lows, highs = [], []
        for m in range(expression.count):
            spread: Any = 0.0
            for j in range(len(self.change[0])):
                rate = Interval(0.0)
                for p in range(POSE):
                    own = slopes[p * expression.count + m]
                    if np.any(own.middle) or np.any(own.radius):
                        rate = rate + own * self.change[p][j]
                if place is not None and m == 0:
                    rate = rate + over[-1] * place.change[j]
                spread = spread + rate.size
            found = Interval(at_centre[m].middle, (at_centre[m].radius + spread) * (1.0 + FLOATS))
            spread_known = ~self.jumps & np.isfinite(found.radius)
            lows.append(np.where(spread_known, np.fmax(found.low, over[m].low), over[m].low))
            highs.append(np.where(spread_known, np.fmin(found.high, over[m].high), over[m].high))
        return lows, highs


@dataclass(frozen=True, eq=False)
class _Place:
    """A place along an edge that depends on the variables of a piece: at the centre, over it, changes; (n, 1) each."""

    centre: Interval
    over: Interval
    change: list[Interval]


class _Kinematics:
    """The motion as functions of the weighted coordinates y: the pose of body 1 relative to body 2, and its changes."""

    def __init__(self, problem: Problem) -> None:
        import casadi

        count = len(problem.weights)
        origin = _origin(problem.motion, problem.movable.seed)
        y, seeds = casadi.SX.sym("y", count), casadi.SX.sym("seeds", 6)
        seen = problem.motion.seen_from(origin) if origin.any() else problem.motion
        q = casadi.vertcat(*(y[k] / w for k, w in enumerate(problem.weights.tolist())))
        T = seen.symbolic(q, seeds[:3], seeds[3:])
        R, moved = T[:3, :3], T[:3, :3] @ seeds[:3] + T[:3, 3]
        pose = casadi.densify(casadi.vertcat(casadi.vec(R.T), seeds[3:] - moved))
        change = casadi.vec(casadi.densify(casadi.jacobian(pose, y)))
        options = {"cse": True}
        self._pose = Program(casadi.Function("pose", [y, seeds], [pose], options))
        self._change = Program(casadi.Function("change", [y, seeds], [change], options))
        exact = [Interval(seed) - origin for seed in (problem.movable.seed, problem.static.seed)]
        self._seeds = [own[k] for own in exact for k in range(3)]
        # the package's own motions are smooth; where a series takes over, they jump by less than 1e-20
        self._smooth = not any(isinstance(step, OwnMotion) for step in problem.motion.steps)

    def poses(self, pieces: Pieces) -> Poses:
        """Return the poses of pieces."""
        centre, half = pieces.centre, pieces.half
        _, y = pieces.directions(Interval(centre[:, 0]), Interval(centre[:, 1:], np.zeros_like(centre[:, 1:])))
        (at_centre,), _ = self._pose(y, self._seeds)
        s, t = Interval(centre[:, 0], half[:, 0]), Interval(centre[:, 1:], half[:, 1:])
        v, y = pieces.directions(s, t)
        (over,), jumps = self._pose(y, self._seeds)
        (rates,), _ = self._change(y, self._seeds)
        count = half.shape[1]
        axis = pieces.faces >> 1
        columns = np.array([[k + (k >= own) for k in range(count - 1)] for own in range(count)], dtype=np.int64)
        change, kept = [], []
        for p in range(POSE):
            own = [rates[k * POSE + p] for k in range(count)]
            first = Interval(0.0)
            for k in range(count):
                first = first + own[k] * v[k]
            middle, radius = (np.stack([np.broadcast_to(x, axis.shape) for x in side]) for side in _sides(own))
            changes = [first * Interval(half[:, 0])]
            for j in range(count - 1):
                place = columns[axis, j], np.arange(len(axis))
                changes.append(Interval(middle[place], radius[place]) * s * Interval(half[:, 1 + j]))
            spread: Any = 0.0
            for x in changes:
                spread = spread + x.size
            by_mean = Interval(at_centre[p].middle, (at_centre[p].radius + spread) * (1.0 + FLOATS))
            broken = jumps if not self._smooth else np.zeros(len(axis), dtype=bool)
            natural = over[p]
            tight = natural.tighter(by_mean)
            kept.append(
                Interval(np.where(broken, natural.middle, tight.middle), np.where(broken, natural.radius, tight.radius))
            )
            change.append([_column(x, len(axis)) for x in changes])
        broken = np.broadcast_to(np.asarray(jumps) & (not self._smooth), axis.shape)
        return Poses(
            pieces,
            [_column(x, len(axis)) for x in at_centre],
            [_column(x, len(axis)) for x in kept],
            change,
            broken[:, None],
        )


def _sides(values: Sequence[Interval]) -> tuple[list[Any], list[Any]]:
    return [x.middle for x in values], [x.radius for x in values]


def _column(x: Interval, count: int) -> Interval:
    """Return numbers as a column; one that is the same for all stays one."""
    if np.ndim(x.middle) == np.ndim(x.radius) == 0:
        return x
    return Interval(np.broadcast_to(x.middle, count)[:, None], np.broadcast_to(x.radius, count)[:, None])


def _origin(motion: Motion, seed: Array) -> Array:
    """Return where to see a motion from: the seed, if its fixed points can be written so without rounding, else 0."""
    points = []
    for step in motion.steps:
        if isinstance(step, Rotation) and step.centre != "seed":
            points.append((0.0, 0.0, 0.0) if step.centre == "origin" else step.centre)
        elif isinstance(step, Screw) and not isinstance(step.axis, str):
            points.append(step.axis[0])
        elif not isinstance(step, Translation | Rotation | Screw | Free):
            return np.zeros(3)
    numbers = [(float(x), float(s)) for point in points for x, s in zip(point, seed, strict=True)]
    exact = all(Fraction(x) - Fraction(s) == Fraction(x - s) for x, s in numbers)
    return np.asarray(seed) if exact else np.zeros(3)


# ------------------------------------------------------------------------------------------------------- the examiner


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A convex part that the parts of body 1 meet, as placed: vertices about s_2, and the least gap asked for."""

    part: ConvexPart
    vertices: Interval
    need: float


class _Examiner:
    """What a problem asks of a motion, and why the cells of a proof are said not to do it."""

    def __init__(self, problem: Problem, evidence: Evidence) -> None:
        self.problem, self.evidence = problem, evidence
        self.kinematics = _Kinematics(problem)
        self.target = problem.target.tolist()

    # ------------------------------------------------------------------------------------------------------ meaning

    @cached_property
    def features(self) -> tuple[tuple[FeaturePoints, ...], int]:
        """The features whose lines the goal speaks of, and how many of them are tracked."""
        problem = self.problem
        if problem.goal not in TRACKING:
            return (), 0
        lines: Any = problem.tracked_lines
        seats = problem.nominal_seats if problem.goal == "seat" else ()
        if seats:
            lines = tuple(seat_of(line, seats) or line for line in lines)
        others = besides(seats, lines, problem.target)
        bodies = problem.movable, problem.static
        made = (feature_points(*bodies, own.site, own.parts, own.normal, np.eye(3)) for own in (*lines, *others))
        return tuple(made), len(lines)

    @cached_property
    def crossing(self) -> tuple[tuple[int, ...], list[Interval]] | None:
        """What the tracked scale pair follows from: kinds and given numbers of `_crossing`; None for one line."""
        features, count = self.features
        if count != 2:
            return None
        given = [Interval(x) for x in self.target]
        one, two = features[:2]
        if one.parts == two.parts:
            bodies, corners = (self.problem.movable, self.problem.static), []
            for own, body in enumerate(bodies):
                part = body.parts[one.parts[own]]
                shared = set.intersection(*(_corners(feature, own, part) for feature in (one, two)))
                corners.append([Interval(part.vertices[v]) - body.seed for v in sorted(shared)])
            for own in (0, 1):  # the body of the edge
                if len(corners[own]) == 2 and len(corners[1 - own]) == 1:
                    (start, end), (corner,) = corners[own], corners[1 - own]
                    points = (start, corner) if own == 0 else (corner, start)
                    return (own,), [*given, *_numbers(end - start, *points)]
        return (one.kind, two.kind), [*given, *(x for own in (one, two) for x in _numbers(*self._feature(own)))]

    def _feature(self, feature: FeaturePoints) -> tuple[Interval, Interval, Interval, Interval]:
        """Return (u, w, x, y) of a feature: its direction, not of unit length, and a point of each body."""
        p, q, r, s = (Interval(point) for point in feature.points.T)
        nothing = Interval(np.zeros(3))
        if feature.kind == E1E2:
            u, w = q - p, (s - r) * feature.sign
        else:
            sides = (q - p, r - p) if feature.kind == F1V2 else (r - q, s - q)
            u, w = _cross(*sides) * feature.sign, nothing
        return u, w, p - self.problem.movable.seed, s - self.problem.static.seed

    @cached_property
    def coherent(self) -> bool:
        """Whether what is tracked must be the contact all the way."""
        return self.problem.path == "coherent" and self.features[1] > 0

    @cached_property
    def limits(self) -> Array:
        """The limits, narrowed where what lies beyond will not do or repeats smaller motions.

        Zero for parameters that tilt a flush contact which must stay so on the way. Goals that ask for poses alone are
        met by a turn q of a step that repeats itself if they are by q - 2 pi, which is smaller for q > pi: nothing need
        be beyond pi, nor, where the other limit keeps q - 2 pi out, beyond a whole turn from it. And where the seed
        only shifts, parts do not touch further out than the seeds' distance and both reaches.
        """
        problem = self.problem
        limits = np.array(problem.limits)
        around = (limits[:, 0] <= 0) & (limits[:, 1] >= 0)
        if problem.goal == "seat" and self.coherent:
            still = held(problem.nominal_seats, problem.motion, problem.movable, problem.static)
            limits[still & around] = 0.0
        if self.features[1]:
            return limits
        steps = [step for step in problem.motion.steps for _ in step.own_parameters]
        half, reach = np.pi * (1.0 + FLOATS), self._reach(steps)
        for k, step in enumerate(steps):
            low, high = limits[k]
            if step.closed and around[k]:
                limits[k] = max(low, min(-half, high - 2.0 * half)), min(high, max(half, low + 2.0 * half))
            elif isinstance(step, Translation):
                limits[k] = max(low, -reach), min(high, reach)
        return limits

    def _reach(self, steps: Sequence[Step]) -> float:
        """Return a translation beyond which nothing touches; infinite if that is not known or not asked."""
        shifts = [step.direction for step in steps if isinstance(step, Translation)]
        turns = [step for step in steps if not isinstance(step, Translation)]
        seeded = all(isinstance(step, Rotation) and step.centre == "seed" for step in turns)
        if not (self.must_touch and seeded and 0 < len(shifts) <= 3):
            return np.inf
        least = float(np.linalg.svd(np.array(shifts), compute_uv=False)[-1]) - DEFAULT.nominal
        parts = [_norm(own).max() for own in self.movable]
        others = [_norm(own.vertices).max() for own in self.obstacles[: len(self.problem.static.parts)]]
        away = _norm(Interval(self.problem.static.seed) - self.problem.movable.seed)
        return float((away + max(parts) + max(others)) * (1.0 + FLOATS) / least) if least > 0 else np.inf

    @cached_property
    def must_touch(self) -> bool:
        """Whether the target pair must touch."""
        return "touch" in (self.problem.goal, self.problem.pair)

    @cached_property
    def movable(self) -> list[Interval]:
        """Vertices of the parts of body 1 at the scale made, about the moved seed in its own axes."""
        own = self.problem.movable
        return [(Interval(part.vertices) - own.seed) * self.target[0] for part in own.parts]

    @cached_property
    def obstacles(self) -> list[Obstacle]:
        """The parts of the static body, then those of the keep-outs."""
        problem = self.problem
        seed, clear = problem.static.seed, "clear" in (problem.goal, problem.pair)
        need = problem.clearance if clear else 0.0 if self.must_touch else -np.inf
        placed = [(part, self.target[1], need) for part in problem.static.parts]
        placed += [(part, scale, own.clearance) for own in problem.keep_out for part, scale in own.obstacles]
        return [
            Obstacle(part, Interval(part.seed) - seed + (Interval(part.vertices) - part.seed) * scale, need)
            for part, scale, need in placed
        ]

    # -------------------------------------------------------------------------------------------------------- cover

    @cached_property
    def closing(self) -> frozenset[Reason]:
        """Reasons that exclude every motion further out in the same direction."""
        found = set()
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
        wrong = _left_over(
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
        fronts = np.where(np.isnan(fronts), 0.0, fronts)
        low = np.concatenate([own.stretches[:, 0], np.zeros(len(fronts))])
        high = np.concatenate([own.stretches[:, 1], fronts])
        wrong = _left_over(
            np.concatenate([own.faces, own.column_faces]),
            np.column_stack([low, np.concatenate([own.boxes[:, 0], own.column_boxes[:, 0]])]),
            np.column_stack([high, np.concatenate([own.boxes[:, 1], own.column_boxes[:, 1]])]),
            np.repeat([1, -1], [len(own.faces), len(fronts)]),
        )
        note = _where("not covered once up to the fronts", wrong)
        checks.append(Check("proof: stretches", wrong is None, float(wrong is not None), 0.0, note))
        return checks

    def bound(self, claimed: float) -> Check:
        """Check that no motion of a smaller amount is left."""
        low, high = self.evidence.column_boxes[:, 0], self.evidence.column_boxes[:, 1]
        least = np.maximum(np.maximum(low, -high), 0.0)
        lengths = np.sqrt(1.0 + (least * least).sum(axis=1))
        value = float((self.evidence.fronts * lengths).min(initial=np.inf))
        passed = value * (1.0 + FLOATS) >= claimed
        return Check("proof: lower bound", bool(passed), value, float(claimed), "least amount that the cells leave")

    # ------------------------------------------------------------------------------------------------------ reasons

    def reasons(self) -> Iterator[Check]:
        """Check each cell's reason, all of one reason at once."""
        tests = {
            Reason.SHORT: self.short,
            Reason.LOOSE: self.loose,
            Reason.LEFT: self.left,
            Reason.APART: self.apart,
            Reason.MEETS: self.meets,
            Reason.OUTSIDE: self.outside,
            Reason.NEAR: self.near,
        }
        for code in np.unique(self.evidence.reasons).tolist():
            rows = np.flatnonzero(self.evidence.reasons == code)
            test = next((test for reason, test in tests.items() if reason == code), None)
            name = f"proof: {Reason(code).name}" if code in list(Reason) else f"proof: reason {code}"
            if test is None:
                note = f"cell {rows[0]} and others: no reason that can be checked"
                yield Check(name, False, float(len(rows)), 0.0, note)
                continue
            lost, halved = self._unproved(rows, test)
            note = f"of {len(rows)} cells not shown, {halved} halved to be shown"
            if len(lost):
                note += f"; {self._described(int(lost[0]))}"
            yield Check(name, not len(lost), float(len(lost)), 0.0, note)

    def _described(self, row: int) -> str:
        own = self.evidence
        box = ", ".join(f"[{a:.17g}, {b:.17g}]" for a, b in own.boxes[row].T.tolist())
        start, end = own.stretches[row].tolist()
        return f"first cell {row}: face {own.faces[row]}, directions {box or 'one'}, s [{start:.17g}, {end:.17g}]"

    def _unproved(self, rows: Ints, test: Callable[[Poses], Array]) -> tuple[Ints, int]:
        """Return the cells of which a margin is not positive all over, and how many were halved."""
        own = self.evidence
        low = np.column_stack([own.stretches[rows, 0], own.boxes[rows, 0]])
        high = np.column_stack([own.stretches[rows, 1], own.boxes[rows, 1]])
        waiting, lost, halved = Pieces(rows, own.faces[rows], low, high), np.array([], dtype=np.int64), 0
        for level in range(HALVINGS + 1):
            waiting = waiting[~self._shown(waiting, test)]
            refuted = waiting.rows[~self._shown(waiting.centres, test)]
            lost = np.union1d(lost, refuted if level < HALVINGS else waiting.rows)
            waiting = waiting[~np.isin(waiting.rows, lost)]
            if level == 0:
                halved = len(waiting.rows)
            if not len(waiting.rows):
                break
            waiting = waiting.halved()
        return lost, halved

    def _shown(self, pieces: Pieces, test: Callable[[Poses], Array]) -> Bools:
        """Tell of which pieces a margin is positive all over."""
        batches = range(0, len(pieces.rows), BATCH)
        found = [test(self.kinematics.poses(pieces[start : start + BATCH])) > 0.0 for start in batches]
        return np.concatenate([np.empty(0, dtype=bool), *found])

    def _witness(self, poses: Poses, row: int = 0) -> Array:
        """Return a witness row of each piece's cell, (n, 16)."""
        return self.evidence.witnesses[self.evidence.first[poses.pieces.rows] + row]

    def short(self, poses: Poses) -> Array:
        """The tracked pair lies short of the target, or a line does not pass through it."""
        features, tracked = self.features
        count, witness = len(poses.pieces.rows), self._witness(poses)
        margin = np.full(count, -np.inf)
        if self.problem.goal == "beyond":
            if self.crossing is None:
                return margin
            kinds, given = self.crossing
            lows, highs = poses.bounds(_crossings(kinds), given)
            for i in (0, 1):
                here = witness[:, 0] == i
                low, high = (lows[3 + i], highs[3 + i]) if self.problem.signs[i] > 0 else (-highs[3 + i], -lows[3 + i])
                own = np.where(lows[0] > 0, -high, np.where(highs[0] < 0, low, -np.inf))
                margin[here] = _flat(own, count)[here]
            return margin
        if self.problem.goal == "at" and self.crossing is not None and len(self.crossing[0]) == 1:
            return self._off_edge(poses)
        for k, feature in enumerate(features):
            here = np.flatnonzero(witness[:, 0] == k)
            if len(here):
                u, w, x, y = self._feature(feature)
                given = _numbers(u, w, x * self.target[0], y * self.target[1])
                (low,), (high,) = _at(poses, here).bounds(_separation(feature.kind), given)
                margin[here] = _flat(np.maximum(low, -high), len(here))
        return margin

    def _off_edge(self, poses: Poses) -> Array:
        """Return a margin by which the vertex that touches an edge is off its line at the target pair.

        Across the edge, along the normal of a face beside it or any other direction at right angles.
        """
        assert self.crossing is not None
        (own,), given = self.crossing
        body = (self.problem.movable, self.problem.static)[own]
        u, x, y = (_joined(given[2 + 3 * k : 5 + 3 * k]) for k in range(3))
        points = x * self.target[0], y * self.target[1]
        margin = np.full(len(poses.pieces.rows), -np.inf)
        for n in body.parts[self.features[0][0].parts[own]].normals[list(self.beside)]:
            direction = _cross(u, _cross(Interval(n), u))  # at right angles to the edge, whatever n is
            numbers = _numbers(direction, Interval(np.zeros(3)), *points)
            (low,), (high,) = poses.bounds(_separation((F1V2, V1F2)[own]), numbers)
            margin = np.fmax(margin, np.maximum(low, -high)[:, 0])
        return margin

    def loose(self, poses: Poses) -> Array:
        """A vertex of a part reaches beyond the plane of its tracked feature, so that this is no contact."""
        features, tracked = self.features
        witness = self._witness(poses)
        margin = np.full(len(witness), -np.inf)
        bodies = self.problem.movable, self.problem.static
        for k, body in product(range(tracked), (0, 1)):
            feature = features[k]
            part = bodies[body].parts[feature.parts[body]]
            u, w, *points = self._feature(feature)
            vertex, known = _index(witness[:, 2], len(part.vertices))
            here = np.flatnonzero((witness[:, 0] == k) & (witness[:, 1] == body + 1) & known)
            if not len(here):
                continue
            reach = Interval(part.vertices[vertex[here]]) - bodies[body].seed - points[body]
            (low,), _ = _at(poses, here).bounds(_height(feature.kind, body), _numbers(u, w, reach))
            flat = DEFAULT.planarity * self.problem.size * _norm(u) * (_norm(w) if feature.kind == E1E2 else 1.0)
            margin[here] = _flat(low - flat, len(here))
        return margin

    def left(self, poses: Poses) -> Array:
        """A direction keeps the tracked parts apart at the tracked pair."""
        witness = self._witness(poses)
        margin = np.full(len(witness), -np.inf)
        movable, static = self.problem.movable, self.problem.static
        if self.crossing is None or len(movable.parts) != 1 or len(static.parts) != 1:
            return margin  # parts of unions may be left for one another
        kinds, given = self.crossing
        one, two = Interval(movable.parts[0].vertices) - movable.seed, Interval(static.parts[0].vertices) - static.seed
        for kind, here, u, w in _directions(witness):
            own = _at(poses, here)
            first, second, reach = _extremes(own, kind, u, w, one, two)
            lows, highs = own.bounds(_crossings(kinds), given)
            (low,), (high,) = own.bounds(_gap_at_crossing(kinds, kind), [*given, *_numbers(u, w, first, second)])
            up, down = lows[0] > 0, highs[0] < 0
            gap = np.where(up, low, np.where(down, -high, -np.inf))[:, 0]
            scales = [np.where(up, highs[1 + i], -lows[1 + i])[:, 0] for i in (0, 1)]
            excess = sum(np.maximum(s, 0.0) * r for s, r in zip(scales, reach, strict=True))
            margin[here] = gap - excess * (1.0 + FLOATS)
        return margin

    def apart(self, poses: Poses) -> Array:
        """A direction for each part pair keeps it apart at the target pair."""
        count, others = len(poses.pieces.rows), len(self.problem.static.parts)
        if not self.must_touch:
            return np.full(count, -np.inf)
        first = self.evidence.first
        rows = np.diff(first)[poses.pieces.rows] == len(self.movable) * others
        margin = np.where(rows, np.inf, -np.inf)
        for row, (i, j) in enumerate(product(range(len(self.movable)), range(others))):
            witness = self.evidence.witnesses[np.where(rows, first[poses.pieces.rows] + row, 0)]
            gap = np.full(count, -np.inf)
            for kind, here, u, w in _directions(witness):
                own, two = _at(poses, here), self.obstacles[j].vertices
                x, y, reach = _extremes(own, kind, u, w, self.movable[i], two)
                (low,), _ = own.bounds(_separation(kind), _numbers(u, w, x, y))
                gap[here] = low[:, 0] - (reach[0] + reach[1]) * (1.0 + FLOATS)
            margin = np.minimum(margin, gap)
        return margin

    def meets(self, poses: Poses) -> Array:
        """A point of an edge of one part is inside the other."""
        witness = self._witness(poses)
        margin = np.full(len(witness), -np.inf)
        for i, j, body in product(range(len(self.movable)), range(len(self.obstacles)), (0, 1)):
            obstacle = self.obstacles[j]
            here = np.flatnonzero((witness[:, :3] == (i, j, body + 1)).all(axis=1))
            if not len(here) or not np.isfinite(obstacle.need):
                continue
            sides = (self.problem.movable.parts[i], self.movable[i]), (obstacle.part, obstacle.vertices)
            (edged, points), (part, corners) = sides[body], sides[1 - body]
            edge, known = _index(witness[here, 3], len(edged.edges))
            start, end = points[edged.edges[edge, 0]], points[edged.edges[edge, 1]]
            along = end - start
            own = _at(poses, here)
            place, beyond = self._place(own, witness[here])
            normals, levels = _planes(part, corners)
            given = [
                *(Interval(normals.T[k][None]) for k in range(3)),
                Interval(levels.middle[None], levels.radius[None]),
            ]
            given += [x for vector in (start, along) for x in _numbers(vector)]
            lows, _ = own.bounds(_depth(body), given, place)
            depth = lows[0].min(axis=1) - beyond * _norm(along) * _norm(Interval(normals)).max()
            margin[here] = np.where(known, depth, -np.inf)
        return margin

    def _place(self, poses: Poses, witness: Array) -> tuple[_Place, Array]:
        """Return where on its edge a point is, and how far beyond the edge's ends at most."""
        pieces, own = poses.pieces, self.evidence
        low = np.column_stack([own.stretches[pieces.rows, 0], own.boxes[pieces.rows, 0]])
        high = np.column_stack([own.stretches[pieces.rows, 1], own.boxes[pieces.rows, 1]])
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        rates = np.where(half > 0, witness[:, 5 : 5 + low.shape[1]] / np.where(half > 0, half, 1.0), 0.0)
        centre, change = Interval(witness[:, 4:5]), []
        spread: Any = 0.0
        for j in range(low.shape[1]):
            rate = Interval(rates[:, j : j + 1])
            centre = centre + rate * (Interval(pieces.centre[:, j : j + 1]) - middle[:, j : j + 1])
            change.append(rate * pieces.half[:, j : j + 1])
            spread = spread + change[-1].size
        over = Interval(centre.middle, (centre.radius + spread) * (1.0 + FLOATS))
        beyond = np.maximum(np.maximum(-over.low, over.high - 1.0), 0.0)[:, 0]
        return _Place(centre, over, change), beyond

    def outside(self, poses: Poses) -> Array:
        """A parameter is beyond a limit."""
        pieces, witness = poses.pieces, self._witness(poses)
        centre, half = pieces.centre, pieces.half
        _, y = pieces.directions(Interval(centre[:, 0], half[:, 0]), Interval(centre[:, 1:], half[:, 1:]))
        margin = np.full(len(witness), -np.inf)
        for k, (own, weight, ends) in enumerate(zip(y, self.problem.weights.tolist(), self.limits, strict=True)):
            low, high = (Interval(end) * weight if np.isfinite(end) else Interval(end) for end in ends)
            here = witness[:, 0] == k
            margin[here] = np.maximum(own.low - high.high, low.low - own.high)[here]
        return margin

    def near(self, poses: Poses) -> Array:
        """Points of two parts are nearer than the gap asked for."""
        witness = self._witness(poses)
        margin = np.full(len(witness), -np.inf)
        for i, j in product(range(len(self.movable)), range(len(self.obstacles))):
            obstacle = self.obstacles[j]
            here = np.flatnonzero((witness[:, :2] == (i, j)).all(axis=1))
            if not len(here) or not obstacle.need > 0:
                continue
            x, y = witness[here, 2:5], witness[here, 5:8]
            off = _off(x, self.movable[i]) + _off(y, obstacle.vertices)
            need = (obstacle.need - off) * (1.0 - FLOATS)
            (low,), _ = _at(poses, here).bounds(
                _nearness(), [*_numbers(Interval(x), Interval(y)), Interval(need[:, None])]
            )
            margin[here] = np.where(need > 0, low[:, 0], -np.inf)
        return margin


def _where(what: str, point: tuple[int, Array] | None) -> str:
    """Return in words where boxes do not cancel."""
    if point is None:
        return "each covered once"
    face, coordinates = point
    return f"{what}: beside face {face}, {', '.join(f'{x:.17g}' for x in coordinates.tolist())}"


def _corners(feature: FeaturePoints, body: int, part: ConvexPart) -> set[int]:
    """Return the vertices of a feature's element of one body."""
    kind, place = feature.site[0], feature.site[1 + body]
    if kind == E1E2:
        return set(part.edges[place, :2].tolist())
    return set(part.loops[place]) if kind == (F1V2, V1F2)[body] else {place}


def _cross(u: Interval, v: Interval) -> Interval:
    """Return the cross product along the last axis."""
    places = np.array([1, 2, 0]), np.array([2, 0, 1])
    (a, b), (c, e) = ((x[..., places[0]], x[..., places[1]]) for x in (u, v))
    return a * e - b * c


def _norm(v: Interval) -> Any:
    """Return an upper bound of the lengths of vectors."""
    size = v.size
    return np.sqrt((size * size).sum(axis=-1)) * (1.0 + FLOATS)


def _numbers(*vectors: Interval) -> list[Interval]:
    """Return the components of vectors, (3,) each for all rows or (n, 3) a column each."""
    found = []
    for vector in vectors:
        for k in range(3):
            own = vector[..., k]
            found.append(own if np.ndim(own.middle) == 0 else Interval(own.middle[:, None], _as_column(own.radius)))
    return found


def _as_column(radius: Any) -> Any:
    return radius if np.ndim(radius) == 0 else radius[:, None]


def _joined(numbers: Sequence[Interval]) -> Interval:
    """Return a vector of its components, plain numbers."""
    return Interval(np.array([x.middle for x in numbers]), np.array([x.radius for x in numbers]))


def _index(values: Array, count: int) -> tuple[Ints, Bools]:
    """Return numbers as indices, and which of them are."""
    known = (values >= 0) & (values < count) & (values == np.floor(values))
    return np.where(known, values, 0).astype(np.int64), known


def _flat(margin: Any, count: int) -> Array:
    return np.array(np.broadcast_to(margin, (count, 1))[:, 0])


def _at(poses: Poses, rows: Ints) -> Poses:
    """Return some of the poses."""
    if len(rows) == len(poses.pieces.rows):
        return poses

    def some(x: Interval) -> Interval:
        return x if np.ndim(x.middle) == 0 else x[rows]

    return Poses(
        poses.pieces[rows],
        [some(x) for x in poses.centre],
        [some(x) for x in poses.over],
        [[some(x) for x in own] for own in poses.change],
        poses.jumps[rows],
    )


def _middles(poses: Poses) -> tuple[Array, Array]:
    """Return R and d at the centres in floats, (n, 3, 3) and (n, 3)."""
    count = len(poses.pieces.rows)
    numbers = np.stack([np.broadcast_to(np.ravel(x.middle), count) for x in poses.centre], axis=1)
    return numbers[:, :9].reshape(-1, 3, 3), numbers[:, 9:]


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

    Returns
    -------
    first, second : (n, 3) Interval
        The vertices, at the centres.
    reach : list of two (n,) arrays
        Upper bounds, over the pieces, of how much further any vertex reaches; not negative.
    """
    R, _ = _middles(poses)
    if kind == V1F2:
        n = u.middle
    else:
        n = np.einsum("nij,nj->ni", R, u.middle)
        if kind == E1E2:
            n = np.cross(n, w.middle)
    nearest = np.einsum("nij,ni,vj->nv", R, n, one.middle).argmax(axis=1), (n @ two.middle.T).argmin(axis=1)
    points, reach = [], []
    for body, (vertices, place) in enumerate(zip((one, two), nearest, strict=True)):
        own = vertices[place]
        further = [
            vertices[..., k][None] - Interval(own.middle[:, k : k + 1], own.radius[:, k : k + 1]) for k in range(3)
        ]
        _, (high,) = poses.bounds(_height(kind, body), [*_numbers(u, w), *further])
        points.append(own)
        reach.append(np.maximum(high, 0.0).max(axis=1) * np.ones(len(place)))
    return points[0], points[1], reach


def _planes(part: ConvexPart, vertices: Interval) -> tuple[Array, Interval]:
    """Return directions and levels such that what is below all levels is inside a part with these vertices.

    The level of a face is that of its lowest vertex: a point beyond the part is seen from inside it through some hull
    facet, whose vertices are among those of one face, and lies higher than they do.
    """
    normals = np.asarray(part.normals)
    levels = []
    for loop, n in zip(part.loops, normals, strict=True):
        corners = vertices[list(loop)]
        heights = corners[..., 0] * n[0] + corners[..., 1] * n[1] + corners[..., 2] * n[2]
        levels.append(float(heights.low.min()))
    return normals, Interval(np.array(levels), np.zeros(len(levels)))


def _off(points: Array, vertices: Interval) -> Array:
    """Return upper bounds of the distances of points from the hull of vertices, (n,): from mixtures of these."""
    from scipy.optimize import nnls

    corners = vertices.middle
    scale = np.abs(corners).max()
    rounding = len(corners) * (scale * FLOATS + vertices.radius.max())
    rows, places = np.unique(points, axis=0, return_inverse=True)
    found = np.empty(len(rows))
    for k, point in enumerate(rows):
        shares, _ = nnls(np.vstack([corners.T, np.full(len(corners), scale)]), np.append(point, scale))
        mixture = shares @ corners / shares.sum()
        found[k] = np.linalg.norm(point - mixture) * (1.0 + FLOATS) + rounding
    return found[places.ravel()]
