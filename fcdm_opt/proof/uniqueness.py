"""How far a motion that restores several contacts is the only one: interval Newton over boxes of motions.

Each contact gives equations between the pose and the elements that touch: a vertex in the plane of a face, an edge that
meets an edge; a face or edge on a face several of the first kind. Where as many of them as there are parameters have
derivatives over a box that are regular whichever they are there, no two motions of the box meet the equations. Several
problems with the same parameters, as the contacts of an assembly are, give theirs together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import product

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.kernels import E1E2, F1V2, V1F2
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.problem.contacts_restored import contact_balls
from fcdm_opt.problem.problem import Problem
from fcdm_opt.proof.conditions import distance, separation
from fcdm_opt.proof.intervals import Interval, cross, numbers_of
from fcdm_opt.proof.mean_value import Boxes, Expression, PosesOfPieces
from fcdm_opt.tolerances import DEFAULT

PIECES, NARROWED = 400, 0.7  # that are looked at, and of a longest side, above which a piece is cut in two
DETERMINED = 0.1  # of a parameter, by the equations, from which on they narrow it by itself
ROUNDING = 1e-12  # of the size: more than corners as made are off where they ought to be
MOST_BOXES = 4000  # in which equations are shown to disagree
TRIED = (64.0, 32.0, 16.0, 8.0, 4.0, 2.0, 1.01)  # half widths of boxes, in amounts

Equation = tuple[Expression, list[Interval]]  # what is 0, and what it is given
Problems = Sequence[Problem]


def widest_unique(problems: Problems, q: Array) -> float:
    """Return the half width of the widest box tried about no motion in which no other motion restores the contacts."""
    # of problems with `contacts`, and the same parameters, weights and limits, which q restores. Boxes are of weights *
    # q, and all hold it; 0 where none is proved
    largest = float(np.abs(problems[0].weights * q).max())
    tried = max(largest, DEFAULT.least_unit * _size(problems)) * np.array(TRIED)
    return float(tried[unique(problems, q, tried)].max(initial=0.0))


@np.errstate(all="ignore")  # what has no bound is infinite or nan, and passes no comparison
def unique(problems: Problems, q: Array, half: Array) -> Array:
    """Tell for boxes |weights * q| <= half, (n,), whether at most one motion within restores the contacts."""
    # limits narrow them only where they hold a parameter
    weights, (low, high) = problems[0].weights, problems[0].limits.T
    moving = low < high
    count, still = int(moving.sum()), np.where(moving, 0.0, low * weights)
    equations, step = _Equations(problems), 1e-9 * _size(problems)
    if equations.count < count or not count:
        return np.zeros(len(half), dtype=np.bool_)
    wide = half[:, None] * moving
    here = np.where(moving, weights * q, still)[None]
    # derivatives at the motion, by the coordinates of the unit box: which equations are independent, and their inverse
    slopes = equations.slopes(Boxes.between(here - step * moving, here + step * moving)).middle[0][:, moving] / step
    chosen = _independent(slopes, count)
    if len(chosen) < count:
        return np.zeros(len(half), dtype=np.bool_)
    inverse = np.linalg.inv(slopes[chosen])
    over = equations.slopes(Boxes.between(still - wide, still + wide), chosen)
    places = np.broadcast_to(np.flatnonzero(moving), (len(half), count, count))
    scaled = inverse / half[:, None, None]
    product = Interval(scaled, np.zeros_like(scaled)).contracted(over.taken(np.ascontiguousarray(places)))
    off = (product - Interval(np.eye(count))).size.sum(axis=2).max(axis=1)
    return np.asarray(off * (1.0 + 2.0**-40) < 1.0)  # nan is not


def least_amount(problems: Problems, tried: Array) -> float:
    """Return the largest of some weighted amounts below which no motion restores the contacts; 0: none is proved."""
    # they rise: what is proved of one holds of those before it
    first, last = 0, len(tried)
    while first < last:
        middle = last - 1 if last == len(tried) else (first + last) // 2  # the largest first: nearly always it does
        first, last = (middle + 1, last) if _none_below(problems, float(tried[middle])) else (first, middle)
    return float(tried[first - 1]) if first else 0.0


@np.errstate(all="ignore")
def _none_below(problems: Problems, amount: float) -> bool:
    """Tell whether no motion of smaller weighted amount restores the contacts: boxes of them narrow to nothing."""
    # about the centre c of a box the equations F ask for F(c) + J (y - c) = 0, J somewhere in it. With multipliers l
    # and w = l . J(c) that is w . y = w . c - l . F(c) - (l . J - w) . (y - c), so that y is at least some way d along
    # w; and where it is no longer than a, in a ball of the radius sqrt(a^2 - d^2) about that place. Multipliers are
    # those that balance the least y, and those of what no y changes, where equations disagree
    weights, (low, high) = problems[0].weights, problems[0].limits.T
    moving, equations = low < high, _Equations(problems)
    if low[~moving].any() or not equations.count or not moving.any():
        return False
    low, high = np.maximum(low * weights, -amount)[None], np.minimum(high * weights, amount)[None]
    looked_at, noise = 0, ROUNDING * _size(problems)
    while len(low) and looked_at + len(low) <= PIECES and not pacing.over():
        looked_at += len(low)
        boxes = Boxes.between(low, high)
        centre, half, slopes = boxes.centre, np.where(boxes.half > 0.0, boxes.half, 1.0), equations.slopes(boxes)
        values = equations.centred(boxes) + Interval(0.0, noise)  # corners as made are off each other
        J = slopes.middle / half[:, None]
        inverse = np.linalg.pinv(J, rcond=DEFAULT.nominal)
        levels = np.einsum("nmk,nk->nm", J, centre) - values.middle
        least = np.einsum("nkm,nm->nk", inverse, levels)
        wide, below, above = (high - low).max(axis=1), low, high
        for ways in (np.einsum("nkm,nk->nm", inverse, least), levels - np.einsum("nmk,nk->nm", J, least)):
            fixed = Interval(ways[:, None], np.zeros_like(ways)[:, None])
            w = np.einsum("nm,nmk->nk", ways, J)
            rest = (fixed.contracted(slopes)[:, 0] - Interval(w) * Interval(half)).size.sum(axis=1)
            level = fixed.contracted(values.shaped((*values.middle.shape, 1))).high[:, 0, 0]
            along, steep = (w * centre).sum(axis=1), np.linalg.norm(w, axis=1)
            far = along - level - rest - (np.abs(along) + np.abs(level) + rest) * 2.0**-40
            far = np.where(far > 0.0, far / steep * (1.0 - 2.0**-40), 0.0)  # nan is not
            reach = np.sqrt(np.maximum(amount * amount - far * far, 0.0)) + 2.0**-38 * amount
            near = np.where(far > 0.0, np.where(far < amount, reach, -np.inf), np.inf)[:, None]
            place = np.where((far > 0.0) & (steep > 0.0), far / steep, 0.0)[:, None] * w  # 0: no y meets it at all
            below, above = np.maximum(below, place - near), np.minimum(above, place + near)
        # each number by itself, as far as the equations determine it
        fixed = Interval(inverse, np.zeros_like(inverse))
        P = inverse @ J
        rest = (fixed.contracted(slopes) - Interval(P) * Interval(half[:, None])).size.sum(axis=2)
        level = fixed.contracted(values.shaped((*values.middle.shape, 1)))
        own = np.einsum("nkk->nk", P)
        others = (np.abs(P) * half[:, None]).sum(axis=2) - np.abs(own) * half
        reach = (rest + others + level.radius[:, :, 0]) / own * (1.0 + 2.0**-40) + 2.0**-40 * amount
        known = moving & (own > DETERMINED)
        place = centre - level.middle[:, :, 0] / own
        below = np.maximum(below, np.where(known, place - reach, -np.inf))
        above = np.minimum(above, np.where(known, place + reach, np.inf))
        kept = ~(below > above).any(axis=1)
        low, high = below[kept], above[kept]
        cut = np.flatnonzero((high - low).max(axis=1) > NARROWED * wide[kept])
        axis = (high - low)[cut].argmax(axis=1)
        more = low[cut], high[cut]
        high[cut, axis] = more[0][np.arange(len(cut)), axis] = 0.5 * (low + high)[cut, axis]
        low, high = np.concatenate([low, more[0]]), np.concatenate([high, more[1]])
    return not len(low)


@np.errstate(all="ignore")
def excluded(problem: Problem, low: Array, high: Array) -> tuple[Array, Array] | None:
    """Return boxes that fill one, and a motion in each at which what disagrees there excludes all of it."""
    # boxes of weighted parameters, (n, 2, k), as `low` and `high` are ends of one, and (n, k). None where `MOST_BOXES`
    # do not do
    if not (np.isfinite(low) & np.isfinite(high)).all():
        return None
    equations, left, shown, count = _Equations((problem,)), np.array([[low, high]]), list[Array](), 0
    while len(left):
        count += len(left)
        if count > MOST_BOXES:
            return None
        pacing.check()
        boxes = Boxes.between(left[:, 0], left[:, 1])
        values, slopes = equations.centred(boxes), equations.slopes(boxes)
        half = np.where(boxes.half > 0.0, boxes.half, 1.0)
        rates = slopes.middle / half[:, None]
        middle = values.middle[:, :, None]
        off = middle - rates @ (np.linalg.pinv(rates, DEFAULT.nominal) @ middle)  # what no motion changes
        none = np.zeros(len(left), np.bool_)
        for way in (off, middle):
            fixed = Interval(np.swapaxes(way, 1, 2), np.zeros_like(np.swapaxes(way, 1, 2)))
            level = fixed.contracted(values.shaped(middle.shape)).low[:, 0, 0]
            none |= level - fixed.contracted(slopes).size[:, 0].sum(axis=1) * (1.0 + 2.0**-40) > 0.0
        shown.append(left[none])
        left = left[~none]
        axis = (left[:, 1] - left[:, 0]).argmax(axis=1)
        rows = np.arange(len(left))
        one, two = left.copy(), left.copy()
        one[rows, 1, axis] = two[rows, 0, axis] = left[rows, :, axis].mean(axis=1)
        left = np.concatenate([one, two])
    found = np.concatenate(shown)
    return found, 0.5 * found[:, 0] + 0.5 * found[:, 1]


def equations_at(problems: Problems, y: Array) -> tuple[Array, Array]:
    """Return the values of the contacts' equations at weighted parameters, (m,), and their derivatives, (m, k)."""
    # in floats, to choose by: neither is an enclosure
    limits = problems[0].limits
    moving, equations, step = limits[:, 0] < limits[:, 1], _Equations(problems), 1e-9 * _size(problems)
    values = equations.centred(Boxes.between(y[None], y[None])).middle[0]
    slopes = equations.slopes(Boxes.between((y - step * moving)[None], (y + step * moving)[None])).middle[0] / step
    return values, slopes


def _size(problems: Problems) -> float:
    return max(problem.size for problem in problems)


_motion = lru_cache(maxsize=16)(PosesOfPieces)
_poses = lru_cache(maxsize=16)(PosesOfPieces.poses)  # of which both values and derivatives of all equations are


class _Equations:
    """The equations of all contacts of some problems, in order."""

    def __init__(self, problems: Problems) -> None:
        every = ((problem, [*_equations_of(problem)]) for problem in problems)
        self._own = [(_motion(problem), equations) for problem, equations in every if equations]
        self.count = sum(len(equations) for _, equations in self._own)

    def centred(self, boxes: Boxes) -> Interval:
        """Return their values at the centres of boxes, (n, equations)."""
        found = []
        for motion, equations in self._own:
            centre = _poses(motion, boxes).centre
            found += [own.values(centre, given)[0][0][0] for own, given in equations]
        return Interval.stacked(found, (len(boxes.rows), 1))[:, 0]

    def slopes(self, boxes: Boxes, chosen: Sequence[int] | None = None) -> Interval:
        """Return derivatives of all, or of those chosen, over boxes times their half widths, (n, equations, k)."""
        found, first = [], 0
        for motion, equations in self._own:
            kept = [own for k, own in enumerate(equations, first) if chosen is None or k in chosen]
            found += _slopes(motion, boxes, kept) if kept else []
            first += len(equations)
        both = (np.concatenate([getattr(own, side) for own in found], axis=1) for side in ("middle", "radius"))
        return Interval(*both)


def _slopes(motion: PosesOfPieces, boxes: Boxes, equations: Sequence[Equation]) -> list[Interval]:
    """Return derivatives of each equation over boxes times their half widths, (n, 1, k)."""
    poses = _poses(motion, boxes)
    found = []
    for expression, given in equations:
        (_, slopes), _ = expression.slopes(poses.over, given)
        own = Interval.stacked(slopes, (len(boxes.rows), 1)).contracted(poses.change)
        found.append(Interval(own.middle, np.where(poses.jumps[:, :, None], np.inf, own.radius)))
    return found


def _independent(slopes: Array, count: int) -> list[int]:
    """Return equations whose derivatives are as far from dependent as can be had one by one, at most `count`."""
    from scipy.linalg import qr

    lengths = np.linalg.norm(slopes, axis=1)
    _, R, order = qr((slopes / np.where(lengths > 0.0, lengths, 1.0)[:, None]).T, pivoting=True, mode="economic")
    diagonal = np.abs(np.diag(R))
    kept: list[int] = order[: len(diagonal)][diagonal > DEFAULT.nominal].tolist()
    return sorted(kept[:count])


def _equations_of(problem: Problem) -> Iterator[Equation]:
    """Yield the equations of a problem's contacts, of round parts those of balls on planes."""
    balls = [] if problem.motion.shifts else contact_balls(problem)
    for feature in () if balls else problem.contacts:
        yield from _equations(problem, feature)
    none, seeds = Interval(np.zeros(3), np.zeros(3)), (problem.movable.seed, problem.static.seed)
    for ball in balls:
        point = Interval(ball.centre) - seeds[1 - ball.holder]
        if ball.plane is not None:
            place, n = (Interval(own, np.zeros(3)) for own in ball.plane)
            both = [place - seeds[0], point] if ball.holder == 0 else [point, place - seeds[1]]
            yield separation(V1F2 if ball.holder else F1V2), numbers_of(n, none, *both)
        elif ball.about is not None:
            place, along = (Interval(own, np.zeros(3)) for own in ball.about[:2])
            both = [place - seeds[0], point] if ball.holder == 0 else [point, place - seeds[1]]
            s = Interval(ball.about[2])
            yield distance(ball.holder), [*numbers_of(along, *both), s, Interval(0.5) / s]


def _equations(problem: Problem, feature: Feature) -> Iterator[Equation]:
    own, other = (
        [Interval(scale) * (Interval(body.vertices[label - 1]) - body.seed) for label in element.vertices]
        for body, element, scale in (
            (problem.movable, feature.one, float(problem.target[0])),
            (problem.static, feature.two, float(problem.target[1])),
        )
    )
    kinds = feature.one.kind + feature.two.kind
    flush = any(feature == seat.touching for seat in problem.nominal_seats)
    none, *axes = (Interval(axis, np.zeros(3)) for axis in np.vstack([np.zeros(3), np.eye(3)]))
    if kinds == "EE" and not flush:
        yield separation(E1E2), numbers_of(own[1] - own[0], other[1] - other[0], own[0], other[0])
        return
    in_two = kinds in ("VV", "VE") or kinds[1] == "F" or (kinds[1] == "E" and flush)  # else in the axes of body 1
    (held, points), kind = ((other, own), kinds[1]) if in_two else ((own, other), kinds[0])
    place, normals = held[0], axes
    if kind == "E":
        normals = [cross(held[1] - place, axis) for axis in axes]
    elif kind == "F":
        place, b, c = _corners(held)
        normals = [cross(b - place, c - place)]
    for point, n in product(_corners(points) if kinds == "FF" else points, normals):
        both = (point, place) if in_two else (place, point)
        yield separation(V1F2 if in_two else F1V2), numbers_of(n, none, *both)


def _corners(points: Sequence[Interval]) -> tuple[Interval, Interval, Interval]:
    """Return three corners of a face that span a large triangle: two far apart, and that farthest off their line."""
    places = np.array([point.middle for point in points])
    one = int(np.linalg.norm(places - places[0], axis=1).argmax())
    two = int(np.linalg.norm(places - places[one], axis=1).argmax())
    three = int(np.linalg.norm(np.cross(places - places[one], places[two] - places[one]), axis=1).argmax())
    return points[one], points[two], points[three]
