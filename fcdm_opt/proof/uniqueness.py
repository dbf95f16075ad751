"""Whether a motion that restores several contacts is the only one in a box, or none is smaller, in intervals.

Stages ask how much is so, the judge whether what a solution claims is. The contacts are equations between the corners
of the claimed elements, as made and as moved. Where a square of their derivatives, times its inverse at the motion, is
nearer to the unit matrix than 1 all over the box, no two motions of the box meet the equations. The derivatives are
bounded piece by piece of the box.

Where none in the box is smaller than some amount, multipliers l of the equations F show it piece by piece: about its
centre c, F(y) = 0 asks for w . y = w . c - l . F(c) - (l . J - w) . (y - c) with w = l . J(c) and J somewhere in the
piece, so that y is no shorter than the right side over |w|.

Where nothing turns the equations are linear, and so is what keeps parts apart: two convex ones that do not overlap are
apart along a normal of a face of either, or one across two edges, and two that touch along none. Branched over which it
is wherever the shortest shift so far does not do, multipliers show what each branch costs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.contact import NARROWEST
from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.problem.contacts_restored import BallOnFace, contact_balls
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import Problem
from fcdm_opt.proof.intervals import Interval, IntervalFunction
from fcdm_opt.tolerances import DEFAULT

PIECES = 5000  # of a box, at most
TRIED, FEW = (64.0, 32.0, 16.0, 8.0, 4.0, 2.0, 1.01), 64  # half widths of boxes, in amounts, and pieces of each
MOST_BOXES = 4000  # in which equations are shown to disagree
NEAR = 1.0 - 1e-9  # how near to the unit matrix; what rounding does to the corners is far less
DETERMINED = 0.1  # of a parameter, by the equations, from which on they narrow it by itself
NARROWED = 0.7  # of the longest side, above which a piece is cut in two
CORNERS = 1e-12  # of the size: more than the rounding of corners as made, which leaves equations off each other
ROUNDED = 1.0 - 1e-12  # more than the rounding of sums
LEAST = 1e-7  # share of its length that a row of derivatives adds to those taken before it
MOST_CROSSED = 40_000  # pairs of edges of two parts, whose directions are looked at
MOST_BRANCHES = 2000  # of directions along which parts are apart

Problems = Sequence[Problem]


def widest_unique(problems: Problems, q: Array) -> float:
    """Return the half width of the widest box tried about no motion in which no other motion restores the contacts."""
    # boxes are of weights * q, and all hold it; infinite of motions that turn nothing, 0 where none is proved
    size = max(problem.size for problem in problems)
    least = max(float(np.abs(problems[0].weights * q).max()), DEFAULT.least_unit * size)
    tried = [np.inf] if all(problem.motion.shifts for problem in problems) else [share * least for share in TRIED]
    return next((half for half in tried if only_motion(problems, q, half, FEW)), 0.0)


def least_amount(problems: Problems, tried: Array) -> float:
    """Return the largest of some weighted amounts below which no motion restores the contacts; 0: none is proved."""
    # they rise: what is proved of one holds of those before it
    first, last = 0, len(tried)
    while first < last:
        middle = last - 1 if last == len(tried) else (first + last) // 2  # the largest first: nearly always it does
        below = pacing.in_time(none_smaller, problems, float(tried[middle]), late=False)
        first, last = (middle + 1, last) if below else (first, middle)
    return float(tried[first - 1]) if first else 0.0


@np.errstate(all="ignore")  # what has no bound is infinite or nan, and passes no comparison
def only_motion(problems: Problems, q: Array, half: float, pieces: int = PIECES) -> bool:
    """Tell whether it is proved that no motion but this one restores the contacts of some problems in a box."""
    # they have `contacts`, and the same parameters, weights and limits. The box, in which the motion is to lie, is
    # |weight x parameter| <= half, infinite only of motions that turn nothing
    equations = _restored(tuple(problems))
    if equations is None or not (np.abs(y := (problems[0].weights * q)[equations.moving]) <= half).all():
        return False
    if np.isinf(half):  # derivatives that are the same everywhere
        if not all(problem.motion.shifts for problem in problems):
            return False
        half = float(np.abs(y).max()) + max(problem.size for problem in problems)
    here, k = equations.slopes_at(y) * half, len(y)
    chosen = _independent(here)
    if len(chosen) < k:
        return False
    inverse, count = np.linalg.inv(here[chosen]), 1
    while count**k <= pieces:
        ends = half * np.linspace(-1.0, 1.0, count + 1)
        places = np.stack(np.meshgrid(*[np.arange(count)] * k, indexing="ij"), axis=-1).reshape(-1, k)
        over, jumps = equations.slopes(ends[places], ends[places + 1])
        if jumps.any():
            return False
        low, high = over.low[:, chosen].min(axis=0) * half, over.high[:, chosen].max(axis=0) * half
        product = Interval(inverse, np.zeros(inverse.shape)).contracted(Interval.between(low, high))
        if (product - Interval(np.eye(len(inverse)))).size.sum(axis=1).max() < NEAR:  # nan is not
            return True
        count *= 2
    return False


@np.errstate(all="ignore")
def none_smaller(problems: Problems, least: float) -> bool:
    """Tell whether it is proved that no motion of a smaller weighted amount restores the contacts of some problems."""
    # these are as of `only_motion`. The amount is infinite where none is to do at all, which is proved only within
    # limits
    equations = _restored(tuple(problems))
    if equations is None:
        return False
    low, high = (problems[0].weights[:, None] * problems[0].limits)[equations.moving].T[:, None]
    low, high, looked_at = np.maximum(low, -least), np.minimum(high, least), 0
    if not np.isfinite([low, high]).all():
        return False
    while len(low) and looked_at + len(low) <= PIECES:
        pacing.check()
        looked_at += len(low)
        below, above = equations.narrowed(low, high, least)
        kept, wide = ~(below > above).any(axis=1), (high - low).max(axis=1)
        low, high = below[kept], above[kept]
        cut = np.flatnonzero((high - low).max(axis=1) > NARROWED * wide[kept])
        axis = (high - low)[cut].argmax(axis=1)
        ends = low[cut], high[cut].copy()
        high[cut, axis] = ends[0][np.arange(len(cut)), axis] = 0.5 * (low + high)[cut, axis]
        low, high = np.concatenate([low, ends[0]]), np.concatenate([high, ends[1]])
    return not len(low)


@np.errstate(all="ignore")
def none_shorter(problems: Problems, least: float) -> bool:
    """Tell whether it is proved that no shift of a smaller weighted amount does what some problems ask."""
    # they have the same parameters, weights and limits
    if not (all(problem.motion.shifts for problem in problems) and 0.0 < least < np.inf):
        return False
    weights, unit = problems[0].weights, np.eye(len(problems[0].weights))
    rest, (low, high) = 0.0 * weights, (problems[0].limits * weights[:, None] / least).T
    room = np.append(rest, CORNERS * max(problem.size for problem in problems) / least)
    held, alternatives = [np.column_stack([unit, low]), np.column_stack([-unit, -high])], list[list[Array]]()
    if closed := [problem for problem in problems if problem.contacts and problem.goal != FIT]:
        values, slopes = equations_at(closed, rest)
        rows = np.column_stack([slopes, -values / least])
        held += [rows, -rows]
    for problem in problems:  # rows (g, h), g . y >= h, of y in units of the amount: all of one alternative are met
        directions = problem.motion.shift_vectors(problem.movable.seed, problem.static.seed) / weights[:, None]
        met = dict[tuple[int, int], tuple[Array, Array]]()
        for pair, normals, gaps in gaps_of_parts(problem):
            rows = np.column_stack([-normals @ directions.T, -gaps / least])
            alternatives.append([*(rows[np.unique(rows.round(12), axis=0, return_index=True)[1]] - room)[:, None]])
            if pair is not None:
                met[pair] = -rows - room, normals
        every = len(met) == len(problem.movable.parts) * len(problem.static.parts) and not problem.partial
        alternatives += [[own for own, _ in met.values()]] if "touch" in (problem.goal, problem.pair) and every else []
        for joint in problem.chosen_joints if problem.goal != FIT and every else ():  # a pair that carries it touches
            flush = next((own for own in problem.nominal_seats if own.touching == joint.feature), None)
            each = [met[own][0] for own in joint.carriers]
            if flush is not None and flush.dimension == 2:
                across = (np.cross(met[own][1], flush.normal) for own in joint.carriers)
                wide = [NARROWEST * flush.least * np.linalg.norm(own, axis=1) for own in across]
                each = [x + np.outer(w, np.append(rest, 1.0 / least)) for x, w in zip(each, wide, strict=True)]
            alternatives.append(each)
    rows, looked_at = np.vstack(held) - room, 0
    nodes = [rows[np.isfinite(rows[:, -1])]]
    while nodes and looked_at < MOST_BRANCHES:
        pacing.check()
        rows, looked_at = nodes.pop(), looked_at + 1
        amount, y = _shortest(rows)
        if amount >= 1.0:
            continue
        short = (own for own in alternatives if not any((x[:, :-1] @ y >= x[:, -1] - room[-1]).all() for x in own))
        near = [[own for own in group if (np.linalg.norm(own[:, :-1], axis=1) >= own[:, -1]).all()] for group in short]
        if not near:
            return False
        # one after the other, the nearest first: what the last one holds too is left to it
        fewest: list[Array] = min(near, key=lambda group: len(group))
        for own in sorted(fewest, key=lambda own: float((own[:, -1] - own[:, :-1] @ y).max())):
            nodes.append(np.vstack([rows, own]))
            rows = np.vstack([rows, -own]) if len(own) == 1 else rows
    return not nodes


def _shortest(rows: Array) -> tuple[float, Array]:
    """Return a bound of the length of all y with g . y >= h, by the multipliers of the shortest, and that."""
    # by non-negative least squares (Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23)
    from scipy.optimize import nnls

    none = np.zeros(rows.shape[1] - 1)
    if not rows[:, -1].max(initial=0.0) > 0.0:
        return 0.0, none
    shares, _ = nnls(rows.T, np.append(none, 1.0))
    *w, level = shares @ rows
    return float(level * ROUNDED / np.linalg.norm(w)) if level > 0.0 else 0.0, np.array(w) / (1.0 - level)


def gaps_of_parts(problem: Problem) -> Iterator[tuple[tuple[int, int] | None, Array, Array]]:
    """Yield of parts that must not overlap, of few edges, their numbers, normals, (n, 3), and gaps at rest.

    Where a clearance is asked for, gaps are less by as much: parts are that far apart only where one of them is none.
    """
    # None where one is of a keep-out
    seed, (own, other) = problem.movable.seed, problem.target
    apart = {"touch", "clear"} & {problem.goal, problem.pair}
    need, seed_2 = problem.clearance if "clear" in apart else 0.0, problem.static.seed
    obstacles = [(j, part, seed_2, other, need) for j, part in enumerate(problem.static.parts) if apart]
    for kept in problem.keep_out:
        obstacles += [(-1, part, part.seed, scale, kept.clearance) for part, scale in kept.obstacles]
    for i, one in enumerate(problem.movable.parts):
        X = seed + own * (one.vertices - seed)
        for j, two, datum, scale, need in obstacles:
            Y = datum + scale * (two.vertices - datum)
            sides = [np.diff(part.vertices[part.edges[:, :2]], axis=1)[:, 0] for part in (one, two)]
            if len(sides[0]) * len(sides[1]) > MOST_CROSSED:
                continue
            across = np.cross(sides[0][:, None], sides[1][None]).reshape(-1, 3)
            lengths = np.linalg.norm(across, axis=1)
            across = across[lengths > DEFAULT.planarity * lengths.max()]
            across /= np.linalg.norm(across, axis=1)[:, None]
            normals = np.vstack([one.normals, -two.normals, across, -across])
            gaps = (Y @ normals.T).min(axis=0) - (X @ normals.T).max(axis=0)
            if need > 0.0:
                normals, gaps = _faces_within((Y[:, None] - X).reshape(-1, 3), need)
            yield (i, j) if j >= 0 else None, normals, gaps


def _faces_within(shifts: Array, need: float) -> tuple[Array, Array]:
    """Return a polyhedron within all shifts nearer than a length to a hull: normals, (n, 3), inward, and gaps at 0."""
    # the hull of its faces moved outward by the length: these are exact, and what is round between them is chamfered
    from scipy.spatial import ConvexHull

    hull = ConvexHull(shifts)
    moved = shifts[hull.simplices] + need * hull.equations[:, None, :3]
    points = moved.reshape(-1, 3)
    normals = ConvexHull(points).equations[:, :3]
    normals = normals[np.unique(normals.round(12), axis=0, return_index=True)[1]]
    return -normals, -(points @ normals.T).max(axis=0)


@np.errstate(all="ignore")
def excluded(problem: Problem, low: Array, high: Array) -> tuple[Array, Array] | None:
    """Return boxes that fill one, and a motion in each at which what disagrees there excludes all of it."""
    # boxes of weighted parameters, (n, 2, k), as `low` and `high` are ends of one, and (n, k). None where `MOST_BOXES`
    # do not do
    equations, remaining, shown, count = _restored((problem,)), np.array([[low, high]]), list[Array](), 0
    if equations is None or not np.isfinite(remaining).all():
        return None
    while len(remaining):
        count += len(remaining)
        if count > MOST_BOXES:
            return None
        pacing.check()
        none = equations.disagree(*np.moveaxis(remaining[:, :, equations.moving], 1, 0))
        shown.append(remaining[none])
        remaining = remaining[~none]
        rows, axis = np.arange(len(remaining)), (remaining[:, 1] - remaining[:, 0]).argmax(axis=1)
        one, two = remaining.copy(), remaining.copy()
        one[rows, 1, axis] = two[rows, 0, axis] = remaining[rows, :, axis].mean(axis=1)
        remaining = np.concatenate([one, two])
    found = np.concatenate(shown)
    return found, 0.5 * found[:, 0] + 0.5 * found[:, 1]


def equations_at(problems: Problems, y: Array) -> tuple[Array, Array]:
    """Return the values of the contacts' equations at weighted parameters, (m,), and their derivatives, (m, k)."""
    equations = _restored(tuple(problems))
    if equations is None:
        return np.empty(0), np.empty((0, len(y)))
    values = equations.values_at(y[equations.moving])
    slopes = np.zeros((len(values), len(y)))
    slopes[:, equations.moving] = equations.slopes_at(y[equations.moving])
    return values, slopes


@lru_cache(maxsize=16)
def _restored(problems: tuple[Problem, ...]) -> _Restored | None:
    """Return the equations of some problems; None where there are none, or nothing moves."""
    own = any(each.contacts or any(ball.plane or ball.about for ball in contact_balls(each)) for each in problems)
    return _Restored(problems) if own and (problems[0].limits[:, 0] < problems[0].limits[:, 1]).any() else None


class _Restored:
    """Equations of some problems' contacts, and derivatives, by those weighted parameters, (k,), that are `moving`."""

    def __init__(self, problems: Problems) -> None:
        import casadi

        self._corners = CORNERS * max(problem.size for problem in problems)
        self._smooth = all(step.smooth for problem in problems for step in problem.motion.steps)
        low, high = problems[0].limits.T
        self.moving: Ints = np.flatnonzero(low < high)
        variables, rows = casadi.SX.sym("y", len(self.moving)), list[Any]()
        every = casadi.SX(np.where(low < high, 0.0, low * problems[0].weights))
        every[self.moving.tolist()] = variables
        q = every / problems[0].weights
        for problem in problems:
            origin = problem.movable.seed if self._smooth else np.zeros(3)  # near what turns, intervals are narrow
            seeds = (casadi.SX(body.seed - origin) for body in (problem.movable, problem.static))
            rows += equations(problem, problem.motion.seen_from(origin).symbolic(q, *seeds), origin)
        self._shape, self._variables, self._rows = (len(rows), len(self.moving)), variables, casadi.vertcat(*rows)

    @cached_property
    def _values(self) -> IntervalFunction:
        import casadi

        return IntervalFunction(casadi.Function("rows", [self._variables], [casadi.densify(self._rows)]))

    @cached_property
    def _derivatives(self) -> Any:
        import casadi

        slopes = casadi.densify(casadi.jacobian(self._rows, self._variables))
        return casadi.Function("rows", [self._variables], [casadi.vec(slopes.T)])

    @cached_property
    def _slopes(self) -> IntervalFunction:
        return IntervalFunction(self._derivatives)

    def values_at(self, y: Array) -> Array:
        """Return the equations at a point, (m,)."""
        return np.asarray(self._worked_out(self._values, y[None], y[None])[0].middle[0])

    def slopes_at(self, y: Array) -> Array:
        """Return the derivatives at a point in floats, (m, j)."""
        return np.asarray(self._derivatives(y)).reshape(self._shape)

    def slopes(self, low: Array, high: Array) -> tuple[Interval, Flags]:
        """Return what holds the derivatives over boxes, (n, m, j), and where they may jump, (n,)."""
        found, jumps = self._worked_out(self._slopes, low, high)
        # of smooth motions only the way of writing them changes
        return found.shaped((len(low), *self._shape)), np.broadcast_to(np.asarray(jumps) & (not self._smooth), len(low))

    def narrowed(self, low: Array, high: Array, least: float) -> tuple[Array, Array]:
        """Return what is left of boxes, (n, j): ends round all motions of smaller amounts that meet the equations."""
        # a lower end above an upper one where there is none
        centre, half, values, over, jumps = self._about(low, high)
        none, J = np.linalg.norm(np.maximum(np.maximum(low, -high), 0.0), axis=1) * ROUNDED >= least, over.middle
        inverse = np.linalg.pinv(J, rcond=LEAST)
        levels = (J @ centre[:, :, None])[:, :, 0] - values.middle
        z = (inverse @ levels[:, :, None])[:, :, 0]
        balanced = (np.swapaxes(inverse, 1, 2) @ z[:, :, None])[:, :, 0]
        against = levels - (J @ z[:, :, None])[:, :, 0]  # what no motion changes: where equations disagree
        wide = values.shaped((*values.middle.shape, 1))
        fixed, turned = Interval(inverse, np.zeros_like(inverse)), inverse @ J
        own, level = np.diagonal(turned, axis1=1, axis2=2), fixed.contracted(wide)  # y_k, as far as it is determined
        off = (fixed.contracted(over) - Interval(turned)).size + np.abs(turned) * (1.0 - np.eye(low.shape[1]))
        radius = ((off @ half[:, :, None])[:, :, 0] + level.radius[:, :, 0]) / own / ROUNDED + (1.0 - ROUNDED) * least
        place, determined = centre - level.middle[:, :, 0] / own, (own > DETERMINED) & ~jumps[:, None]
        low = np.where(determined, np.maximum(low, place - radius), low)
        high = np.where(determined, np.minimum(high, place + radius), high)
        for multipliers in (balanced, against):
            w = (multipliers[:, None] @ J)[:, 0]
            fixed = Interval(multipliers[:, None], np.zeros_like(multipliers)[:, None])
            off = fixed.contracted(over)[:, 0] - Interval(w)
            level = fixed.contracted(wide).high[:, 0, 0]
            terms = (w * centre).sum(axis=1), -level, -(off.size * half).sum(axis=1)
            steep = np.linalg.norm(w, axis=1)
            far = (sum(terms) - sum(map(np.abs, terms)) * (1.0 - ROUNDED)) / steep * ROUNDED
            none |= (far > 0.0) & (far >= least) & ~jumps
            # motions no longer than `least` and as far as this along w lie in a ball about the nearest of them
            radius = np.sqrt(least * least - far * far) / ROUNDED + (1.0 - ROUNDED) * least
            known = (far > 0.0) & (far < least) & ~jumps
            middle, radius = (far / steep)[:, None] * w, np.where(known, radius, np.inf)[:, None]
            low = np.where(known[:, None], np.maximum(low, middle - radius), low)
            high = np.where(known[:, None], np.minimum(high, middle + radius), high)
        return np.where(none[:, None], np.inf, low), high

    def disagree(self, low: Array, high: Array) -> Flags:
        """Tell in which boxes, (n, j), values at the centre, or what no motion changes of them, exclude all motions."""
        _, half, values, over, jumps = self._about(low, high)
        middle, none = values.middle[:, :, None], np.zeros(len(low), np.bool_)
        for multipliers in (middle - over.middle @ (np.linalg.pinv(over.middle, rcond=LEAST) @ middle), middle):
            fixed = Interval(np.swapaxes(multipliers, 1, 2), np.zeros_like(np.swapaxes(multipliers, 1, 2)))
            level = fixed.contracted(values.shaped(middle.shape)).low[:, 0, 0]
            none |= level - (fixed.contracted(over).size[:, 0] * half).sum(axis=1) / ROUNDED > 0.0
        return none & ~jumps

    def _about(self, low: Array, high: Array) -> tuple[Array, Array, Interval, Interval, Flags]:
        """Return of boxes centres and half widths, values at the centres, and derivatives, see `slopes`."""
        centre = 0.5 * low + 0.5 * high
        half = np.nextafter(np.maximum(high - centre, centre - low), np.inf)
        values = self._worked_out(self._values, centre, centre)[0] + Interval(0.0, self._corners)
        return centre, half, values, *self.slopes(low, high)

    def _worked_out(self, function: IntervalFunction, low: Array, high: Array) -> tuple[Interval, Any]:
        """Return outputs over boxes, (n, outputs), and where they may jump."""
        (found,), jumps = function([Interval.between(low[:, k], high[:, k]) for k in range(low.shape[1])])
        return Interval.stacked(found, (len(low),)), jumps


def _independent(slopes: Array) -> list[int]:
    """Return as many rows as there are columns, each the one that is least dependent on those before it; or fewer."""
    residuals, chosen = slopes / np.maximum(np.linalg.norm(slopes, axis=1), 1e-300)[:, None], list[int]()
    for _ in range(slopes.shape[1]):
        lengths = np.linalg.norm(residuals, axis=1)
        best = int(lengths.argmax())
        if not lengths[best] > LEAST:
            break
        chosen.append(best)
        direction = residuals[best] / lengths[best]
        residuals = residuals - np.outer(residuals @ direction, direction)
    return chosen


def equations(problem: Problem, T: Any, origin: Array) -> list[Any]:
    """Return what is 0 where all contacts, or those tracked, are closed by a motion T, in CasADi, from an origin."""
    if balls := [] if problem.motion.shifts else contact_balls(problem):
        return [row for ball in balls for row in _off_face(ball, T, origin)]
    features = problem.contacts or problem.tracked_features
    return [row for feature in features for row in _equations(problem, feature, T, origin)]


def _off_face(ball: BallOnFace, T: Any, origin: Array) -> Iterator[Any]:
    """Yield how far the centre of a ball is from where a face has it, one of them moved; nothing of other faces."""
    import casadi

    R, t, centre = T[:3, :3], T[:3, 3], ball.centre - origin
    there = R @ centre + t if ball.holder else R.T @ (centre - t)
    if ball.plane is not None:
        place, normal = ball.plane
        yield (there - (place - origin)).T @ normal
    elif ball.about is not None:
        place, along, s = ball.about
        off = there - (place - origin)
        yield (casadi.dot(off, off) - (off.T @ along) ** 2 - s * s) / (2.0 * s)


def _equations(problem: Problem, feature: Feature, T: Any, origin: Array) -> Iterator[Any]:
    """Yield lengths that are 0 where a contact is closed, of corners as made and seen from an origin, some moved."""
    import casadi

    R, t = T[:3, :3], T[:3, 3]
    one, two = (
        [body.seed - origin + rho * (body.vertices[label - 1] - body.seed) for label in element.vertices]
        for body, element, rho in (
            (problem.movable, feature.one, problem.target[0]),
            (problem.static, feature.two, problem.target[1]),
        )
    )
    kinds, flush = feature.one.kind + feature.two.kind, any(feature == own.touching for own in problem.nominal_seats)
    if kinds == "EE" and not flush:
        e, f = (own / np.linalg.norm(own) for own in (one[1] - one[0], two[1] - two[0]))
        yield casadi.dot(casadi.cross(R @ e, f), R @ one[0] + t - two[0])
    elif kinds[1] == "F" or (kinds[1] == "E" and kinds[0] != "F"):  # in the axes of body 2
        points = [R @ p + t for p in (one if kinds != "FF" else [one[k] for k in _triangle(one)])]
        yield from _off(kinds[1], two, points)
    elif kinds[0] != "V":  # in those of body 1
        yield from _off(kinds[0], one, [R.T @ (p - t) for p in two])
    else:
        yield from casadi.vertsplit(R @ one[0] + t - two[0])


def _off(kind: str, corners: Sequence[Array], points: Sequence[Any]) -> Iterator[Any]:
    """Yield how far points are off the plane of a face, or off the line of an edge."""
    import casadi

    a, b, c = (corners[k] for k in _triangle(corners)) if kind == "F" else (*corners[:2], corners[0])
    across = np.cross(b - a, c - a) if kind == "F" else b - a
    across = across / np.linalg.norm(across)
    for p in points:
        if kind == "F":
            yield casadi.dot(across, p - a)
        else:
            yield from casadi.vertsplit(casadi.cross(casadi.SX(across), p - a))


def _triangle(corners: Sequence[Array]) -> tuple[int, int, int]:
    """Return which three corners of a face span a large triangle."""
    arms = np.array(corners) - corners[0]
    last = int(np.linalg.norm(arms, axis=1).argmax())
    return 0, last, int(np.linalg.norm(np.cross(arms, arms[last]), axis=1).argmax())
