"""The right answer about one contact, in rational arithmetic on the floats as given.

Nothing here knows a hull: the points are taken as they come, with repeated and inner ones among them. What side of the
curve a scale pair lies on, and where the curve is met, is read off the exact curve and counts only where the
independent check `proves` agrees. The distance is GJK in rationals, ended by its own proof: a common direction in which
the nearest point is the support. The depth is the least overlap over all cross products of all differences of points,
among which all facet directions of the Minkowski difference are.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import cached_property
from itertools import combinations, product
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat, fmpz

from fcdm_opt.curve.exact import ExactCurve, exact_curve
from fcdm_opt.curve.exact.rationals import coprime, cross, dot, minus, rational
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.geometry.elements import Elements
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.references.proofs import judged, proves

DIGITS = 30  # of the numbers that are recorded
FEW = 10  # points of a part: with more of them the depth is not worked out, their differences are too many
SUPPORT = 1e-12  # relative: heights in floats that differ by less are compared in rationals; rounding is 1e-15
Point = tuple[fmpq, fmpq, fmpq]
Interval = tuple[fmpq, fmpq | None]  # of rho_2, open; None: without end

SOURCE = "rational arithmetic on the floats as given; verdicts proved from the points alone"


def truth_of(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is right for the data of a contact case.

    Returns
    -------
    dict
        `side`: 1 apart, 0 touching, -1 overlapping, None where bodies without inside meet (they may be said to touch
        or to overlap). `meets`: whether the closed bodies do. `distance`, `depth`: decimal strings, None where it does
        not apply or is not known. `rho2`: the least contact scale of body 2 in the box for the scale of body 1, a
        decimal string, None where there is none. `rho2_asked`: False where the question has no one answer, see
        `_contact_scale`. `sizes`: of the smaller and the larger scaled body. `source`.
    """
    rho = tuple(rational(x) for x in data["rho"])
    one, two = (_parts(data[key]) for key in ("one", "two"))
    transform = np.array(data["transform"], dtype=np.float64)
    sizes = sorted(size * scale for size, scale in zip(_sizes(data), data["rho"], strict=True))
    pairs = [ScaledParts(p, q, transform, rho) for p, q in product(one, two)]
    truth: dict[str, Any] = {"side": None, "depth": None, "rho2": None, "rho2_asked": False}
    if any(is_flat(part) for part in (*one, *two)):
        squared = [pair.squared_distance() for pair in pairs]
        truth |= {"meets": not all(squared), "distance": None, "opening": 0.0}
        if all(squared):
            truth |= {"side": 1, "distance": root(min(squared))}
            truth["opening"] = float(truth["distance"])
    else:
        sides = [pair.side() for pair in pairs]
        side = min(sides)
        apart = side > 0
        truth |= {"side": side, "meets": not apart, "distance": None, "opening": 0.0}
        if apart:
            truth["distance"] = root(min(pair.squared_distance() for pair in pairs))
            truth["opening"] = float(truth["distance"])
        elif side < 0:
            truth["depth"] = pairs[0].depth() if len(pairs) == 1 else None
            bound = min(pair.curve.separation(rho) for pair in pairs)
            truth["opening"] = bound if truth["depth"] is None else -float(truth["depth"])
        truth["rho2_asked"], truth["rho2"] = _contact_scale(pairs, data["box"])
    return truth | {"sizes": sizes, "source": SOURCE}


def contact_scales(data: Mapping[str, Any], rho1: float) -> list[fmpq]:
    """Return all exact contact scales of body 2 for a scale of body 1, least first."""
    one, two = (_parts(data[key]) for key in ("one", "two"))
    transform = np.array(data["transform"], dtype=np.float64)
    return crossings([exact_curve(p, q, transform) for p, q in product(one, two)], rational(rho1))


def is_flat(part: ConvexPart) -> bool:
    """Whether all points of a part lie in one plane, exactly."""
    spans = np.linalg.svd(part.vertices - part.vertices.mean(axis=0), compute_uv=False)
    if spans[-1] > SUPPORT * spans[0] * len(part.vertices):
        return False
    points = [[rational(x) for x in row] for row in part.vertices.tolist()]
    return fmpq_mat([list(minus(x, points[0])) for x in points]).rank() < 3


@dataclass(frozen=True, eq=False)
class ScaledParts:
    """Two convex parts of given scales, the first one moved."""

    one: ConvexPart
    two: ConvexPart
    transform: Array
    rho: tuple[fmpq, ...]

    @cached_property
    def curve(self) -> ExactCurve:
        """The exact curve of the parts, of all points."""
        return exact_curve(self.one, self.two, self.transform)

    def side(self) -> int:
        """Return 1 apart, 0 touching, -1 overlapping, proved."""
        verdict = judged(self.curve, self.rho)
        if not proves(self.one, self.two, self.transform, self.rho, verdict):
            raise ArithmeticError("the verdict on a hard case could not be proved")
        return verdict.side

    def touches_at(self, rho2: fmpq) -> bool:
        """Whether the parts touch at another scale of part 2, proved."""
        pair = self.rho[0], rho2
        verdict = judged(self.curve, pair)
        return verdict.side == 0 and proves(self.one, self.two, self.transform, pair, verdict)

    @cached_property
    def _clouds(self) -> tuple[_Cloud, _Cloud]:
        T = [[rational(x) for x in row] for row in self.transform.tolist()]
        still = [[fmpq(i == j) for j in range(4)] for i in range(3)]
        return _Cloud(self.one, self.rho[0], T[:3]), _Cloud(self.two, self.rho[1], still)

    def squared_distance(self) -> fmpq:
        """Return the square of the distance, by GJK without rounding."""
        first, second = self._clouds
        corners = [minus(second.point(0), first.point(0))]
        while True:
            corners, nearest = _least(corners)
            length = dot(nearest, nearest)
            if not length:
                return length
            n = _direction(nearest)
            found = minus(second.lowest(n), first.highest(n))
            if dot(nearest, found) >= length:
                return length
            corners.append(found)

    def depth(self) -> str | None:
        """Return the penetration depth of overlapping parts, None for parts of many points."""
        if max(len(part.vertices) for part in (self.one, self.two)) > FEW:
            return None
        points = [[cloud.point(k) for k in range(len(cloud.floats))] for cloud in self._clouds]
        spans = [list({_direction(minus(q, p)) for p, q in combinations(own, 2) if p != q}) for own in points]
        pairs = [*product(*spans), *combinations(spans[0], 2), *combinations(spans[1], 2)]
        crosses = (cross(e, f) for e, f in pairs)
        least: fmpq | None = None
        for n in {coprime(n) for n in crosses if any(n)}:
            (low, high), (bottom, top) = ((min(h), max(h)) for h in ([dot(n, x) for x in own] for own in points))
            overlap = min(high - bottom, top - low)
            squared = overlap * overlap / dot(n, n)
            least = squared if least is None or squared < least else least
        return None if least is None else root(least)


class _Cloud:
    """The points of a scaled and moved part: floats to choose among them, rationals where they are used."""

    def __init__(self, part: ConvexPart, rho: fmpq, T: Sequence[Sequence[fmpq]]) -> None:
        self._part, self._rho, self._T = part, rho, T
        self._seed = [rational(x) for x in part.seed.tolist()]
        self._known: dict[int, Point] = {}
        turn = np.array([[float(x) for x in row[:3]] for row in T])
        self.floats = float(rho) * (part.vertices - part.seed) @ turn.T

    def point(self, k: int) -> Point:
        """Return a point, exact."""
        if k not in self._known:
            drawn = (rational(x) for x in self._part.vertices[k].tolist())
            scaled = [s + self._rho * (x - s) for x, s in zip(drawn, self._seed, strict=True)]
            x, y, z = (dot(row, scaled) + row[3] for row in self._T)
            self._known[k] = x, y, z
        return self._known[k]

    def highest(self, n: Sequence[fmpz]) -> Point:
        """Return a point that is farthest along a direction."""
        return max(self._candidates(n, 1.0), key=lambda x: dot(n, x))

    def lowest(self, n: Sequence[fmpz]) -> Point:
        """Return a point that is least far along a direction."""
        return min(self._candidates(n, -1.0), key=lambda x: dot(n, x))

    def _candidates(self, n: Sequence[fmpz], sign: float) -> list[Point]:
        widest = max(abs(x) for x in n)
        heights = sign * self.floats @ np.array([float(fmpq(x, widest)) for x in n])
        near = heights >= heights.max() - SUPPORT * np.abs(self.floats).max()
        return [self.point(k) for k in np.flatnonzero(near).tolist()]


def _least(corners: list[Point]) -> tuple[list[Point], Point]:
    """Return the point of the hull of at most four points that is nearest to zero, and the corners that carry it."""
    for count in range(1, len(corners) + 1):
        for chosen in combinations(corners, count):
            gram = [[dot(p, q) for q in chosen] + [fmpq(1)] for p in chosen] + [[fmpq(1)] * count + [fmpq(0)]]
            try:
                solved = fmpq_mat(gram).solve(fmpq_mat([[fmpq(0)]] * count + [[fmpq(1)]]))
            except ZeroDivisionError:  # dependent: fewer of them carry the point
                continue
            weights = [solved[k, 0] for k in range(count)]
            if min(weights) <= 0:
                continue
            x, y, z = (sum((w * p[axis] for w, p in zip(weights, chosen, strict=True)), fmpq(0)) for axis in range(3))
            length = x * x + y * y + z * z
            if all(dot((x, y, z), p) >= length for p in corners):
                return list(chosen), (x, y, z)
    raise ArithmeticError("a simplex without a nearest point")


def _direction(v: Sequence[fmpq]) -> tuple[fmpz, ...]:
    """Return the shortest integers along a direction."""
    common = fmpz(1)
    for x in v:
        common = common.lcm(x.q)
    return coprime([x.p * (common // x.q) for x in v])


# ------------------------------------------------------------------------------------------------------ contact scales


def _contact_scale(pairs: Sequence[ScaledParts], box: Sequence[Sequence[float]]) -> tuple[bool, str | None]:
    """Return whether the least contact scale in the box is a fair question, and the answer.

    It is none where parts touch at all scales without ever overlapping, where the line rho_1 = const is tangent to the
    curve, and where a contact scale lies beside the border of the box by less than a nominal pair is rounded by.
    """
    curves = [pair.curve for pair in pairs]
    rho1, (low, high) = pairs[0].rho[0], (rational(x) for x in box[1])
    if any(curve.status == "empty" and _may_touch(pair) for pair, curve in zip(pairs, curves, strict=True)):
        return False, None
    spans = [_interval(curve, rho1) for curve in curves]
    if any(span is not None and span[0] == span[1] for span in spans):
        return False, None
    found = crossings(curves, rho1)
    rim = rational(DEFAULT.nominal)
    for y in found:
        if any(0 < abs(y - end) <= rim * end for end in (low, high)):
            return False, None
        if not any(pair.touches_at(y) for pair in pairs):
            raise ArithmeticError("a contact scale of a hard case could not be proved")
    listed = [y for y in found if low <= y <= high]
    return True, decimal(listed[0]) if listed else None


def _may_touch(pair: ScaledParts) -> bool:
    """Whether parts that never overlap may touch: the direction that excludes it leaves no room at any scale."""
    n = pair.curve.proof
    assert n is not None
    T = [[rational(x) for x in row] for row in pair.transform.tolist()[:3]]
    (V, s), (W, e) = (([_rationals(x) for x in p.vertices], _rationals(p.seed)) for p in (pair.one, pair.two))
    own = [sum((n[i] * T[i][j] for i in range(3)), fmpq(0)) for j in range(3)]  # n in the frame of part 1 as drawn
    a, b = max(dot(own, minus(v, s)) for v in V), max(-dot(n, minus(w, e)) for w in W)
    c = dot(n, e) - dot(own, s) - sum((n[i] * T[i][3] for i in range(3)), fmpq(0))
    return not (a or b or c)


def _rationals(row: Array) -> tuple[fmpq, ...]:
    return tuple(rational(x) for x in row.tolist())


def crossings(curves: Iterable[ExactCurve], rho1: fmpq) -> list[fmpq]:
    """Return where rho_1 = const meets the boundary of the union of the open overlap regions, least first."""
    spans = [span for curve in curves if (span := _interval(curve, rho1)) and span[0] != span[1]]
    ends = {end for span in spans for end in span if end}
    return sorted(y for y in ends if not any(low < y and (high is None or y < high) for low, high in spans))


def _interval(curve: ExactCurve, rho1: fmpq) -> Interval | None:
    """Return the scales of part 2 at which the parts overlap; of no width where the line is tangent to the region."""
    low, high = fmpq(0), None
    if curve.status == "empty":
        return None
    for piece in curve.pieces:
        a, b, c = piece.exact_line
        if not b:
            if a * rho1 < c:
                return None
            if a * rho1 == c:
                return fmpq(0), fmpq(0)
            continue
        y = (c - a * rho1) / b
        low, high = (max(low, y), high) if b > 0 else (low, y if high is None else min(high, y))
    return (low, high) if high is None or low <= high else None


# ------------------------------------------------------------------------------------------------------ plain numbers


def decimal(x: fmpq) -> str:
    """Return a rational as a decimal string."""
    with localcontext(prec=DIGITS):
        return str(Decimal(int(x.p)) / Decimal(int(x.q)))


def root(x: fmpq) -> str:
    """Return the square root of a rational as a decimal string."""
    with localcontext(prec=2 * DIGITS):
        squared = Decimal(int(x.p)) / Decimal(int(x.q))
    with localcontext(prec=DIGITS):
        return str(squared.sqrt())


def _parts(body: Mapping[str, Any]) -> list[ConvexPart]:
    """Return the points of each part, as parts of which nothing but points and seed is known."""
    points = np.array(body["vertices"], dtype=np.float64)
    seed = frozen(body["seed"])
    rows = body["parts"] or [range(len(points))]
    nothing = np.empty((0, 4), np.int64)
    return [ConvexPart(frozen(points[list(own)]), seed, (), nothing, Elements((), (), ())) for own in rows]


def _sizes(data: Mapping[str, Any]) -> list[float]:
    """Return the largest distance of a point from the middle of each body."""
    clouds = (np.array(data[key]["vertices"], dtype=np.float64) for key in ("one", "two"))
    return [float(np.linalg.norm(x - (x.max(axis=0) + x.min(axis=0)) / 2, axis=1).max()) for x in clouds]
