"""References: the exact scale of body 2 that touches, and the exact curve in a box, proved."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fcdm_opt.errors import FcdmError, InputError
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.method import ContactQuestion, CurveQuestion, Pair, Touching

if TYPE_CHECKING:
    from flint import fmpq

    from fcdm_opt.curve.exact import ExactCurve, ExactPiece

Point = tuple[Any, Any]  # two rationals
# Scale pairs of a curve that are proved: one takes 1 ms for 20 vertices a part, 0.15 s for 10,000. So many at most, and
# at least, and in between as many as this number of vertices is looked at.
MOST_PROOFS, LEAST_PROOFS, PROVED_VERTICES = 20, 3, 20_000


class ExactStretch(NamedTuple):
    """A straight piece of the exact curve between two scale pairs, by increasing rho_1, and what touches along it."""

    start: Point
    end: Point
    piece: ExactPiece

    @property
    def touching(self) -> Touching:
        """Vertices of the smallest faces that touch."""
        return self.piece.touching

    @property
    def middle(self) -> Point:
        """The scale pair half-way."""
        return (self.start[0] + self.end[0]) / 2, (self.start[1] + self.end[1]) / 2

    @property
    def long(self) -> bool:
        """Whether floats can tell its ends apart."""
        size = abs(self.end[0] - self.start[0]) + abs(self.end[1] - self.start[1])
        return bool(size > as_rational(DEFAULT.line) * (self.start[0] + self.start[1]))


@dataclass(frozen=True)
class ExactContact:
    """The least scale of body 2 that touches, as a rational, and what touches: 0-based vertices, sorted."""

    rho2: fmpq
    touching: Touching


@dataclass(frozen=True, eq=False)
class ExactStretches:
    """A decision curve in a box, exact.

    Attributes
    ----------
    whole : tuple of ExactStretch
        All of it, from axis to axis.
    box : (2, 2) array
    """

    whole: tuple[ExactStretch, ...]
    box: Array

    @cached_property
    def stretches(self) -> tuple[ExactStretch, ...]:
        """What the box leaves; nothing that only runs along its border."""
        limits = [[as_rational(x) for x in bounds] for bounds in self.box.tolist()]
        return tuple(part for own in self.whole if (part := _clipped(own, limits)) is not None)

    @cached_property
    def points(self) -> tuple[Point, ...]:
        """Ends and breakpoints in the box, by increasing rho_1."""
        own = self.stretches
        return (*(part.start for part in own), own[-1].end) if own else ()

    @property
    def touching(self) -> tuple[Touching, ...]:
        """What touches along each stretch."""
        return tuple(part.touching for part in self.stretches)

    @cached_property
    def rounded(self) -> Array:
        """The points, correctly rounded, (k, 2)."""
        return frozen(np.array([[as_float(x) for x in point] for point in self.points]).reshape(-1, 2))

    @cached_property
    def _directions(self) -> list[float]:
        """Slopes rho_1 / rho_2 of the starts of all stretches, increasing, infinite at the axis."""
        return [own.start[0] / own.start[1] for own in self.whole]

    def number(self, point: Point) -> int:
        """Return the number in `whole` of the stretch that the ray of a scale pair meets."""
        return max(0, bisect_right(self._directions, point[0] / point[1]) - 1)

    def excess(self, point: Point, number: int | None = None) -> fmpq:
        """Return how far a scale pair lies beyond the curve along its ray, relative to the curve's own distance.

        `number`: of the line to take instead of the one that the ray meets.
        """
        a, b, c = self.whole[self.number(point) if number is None else number].piece.exact_line
        return (a * point[0] + b * point[1]) / c - 1


# ---------------------------------------------------------------------------------------------------------- references


def exact_contact(pair: Pair, question: ContactQuestion) -> ExactContact:
    """Return the exact answer to a contact question, proved.

    Raises
    ------
    InputError
        For seeds that are not inside.
    FcdmError
        Where the proof does not hold, or body 2 touches at no scale: there is no reference then.
    """
    curve, whole = whole_curve(pair, question.transform)
    rho1 = as_rational(question.rho1)
    k = next((k for k, own in enumerate(whole) if own.start[0] <= rho1 < own.end[0]), None)
    if k is None:
        raise FcdmError(f"no scale of body 2 touches body 1 of scale {question.rho1!r}")
    own = whole[k]
    a, b, c = own.piece.exact_line
    rho2 = (c - a * rho1) / b
    touching = own.touching
    if k and rho1 == own.start[0]:
        corner = curve.chains[0].corners[k - 1]
        touching = corner.touching
    _prove(pair, question.transform, curve, [(rho1, rho2)])
    return ExactContact(rho2, touching)


def exact_curve_in_box(pair: Pair, question: CurveQuestion, *, proofs: int | None = None) -> ExactStretches:
    """Return the exact curve in a box.

    Parameters
    ----------
    pair : Pair
    question : CurveQuestion
    proofs : int, optional
        So many at most of its points and of the middles of its stretches, spread evenly, are proved to touch; unless
        given, 20 of small parts and 3 of the largest. The overlap region being convex, a stretch whose ends and middle
        touch is all on the curve.

    Raises
    ------
    InputError
        For seeds that are not inside.
    FcdmError
        Where a proof does not hold: there is no reference then.
    """
    curve, whole = whole_curve(pair, question.transform)
    found = ExactStretches(whole, np.asarray(question.box, dtype=np.float64))
    if proofs is None:
        vertices = sum(len(part.vertices) for part in parts_of(pair))
        proofs = max(LEAST_PROOFS, min(MOST_PROOFS, PROVED_VERTICES // vertices))
    candidates = [*found.points, *(own.middle for own in found.stretches)]
    chosen = sorted({round(x) for x in np.linspace(0, len(candidates) - 1, min(proofs, len(candidates))).tolist()})
    _prove(pair, question.transform, curve, [candidates[k] for k in chosen])
    return found


def whole_curve(pair: Pair, transform: Array) -> tuple[ExactCurve, tuple[ExactStretch, ...]]:
    """Return the exact curve and its stretches from axis to axis, by increasing rho_1."""
    from fcdm_opt.curve.exact import exact_curve

    one, two = parts_of(pair)
    curve = exact_curve(one, two, transform)
    far = any(piece.starts_far or piece.ends_far for piece in curve.pieces)
    if curve.status != "bounded" or len(curve.chains) != 1 or far or curve.chains[0].closed:
        raise InputError(
            "references need both seeds inside", key="pair", found=f"{curve.status}, {len(curve.chains)} chains"
        )
    return curve, tuple(
        ExactStretch(_plane(piece.exact_start), _plane(piece.exact_end), piece) for piece in curve.chains[0].pieces
    )


def _prove(pair: Pair, transform: Array, curve: ExactCurve, points: Sequence[Point]) -> None:
    from fcdm_opt_benchmarks.references.proofs import judged, proves

    one, two = parts_of(pair)
    for point in points:
        verdict = judged(curve, point)
        if verdict.side != 0 or not proves(one, two, transform, point, verdict):
            raise FcdmError(f"the exact reference is not proved at ({as_float(point[0])!r}, {as_float(point[1])!r})")


def parts_of(pair: Pair) -> tuple[ConvexPart, ConvexPart]:
    """Return both parts; raise `InputError` for bodies of several."""
    for body in pair:
        if len(body.parts) != 1:
            raise InputError("references take one convex part", key=f"body '{body.name}'", found=len(body.parts))
    return pair.movable.parts[0], pair.static.parts[0]


def _plane(point: Sequence[Any]) -> Point:
    from flint import fmpq

    return fmpq(point[0], point[2]), fmpq(point[1], point[2])


def _clipped(own: ExactStretch, limits: list[list[Any]]) -> ExactStretch | None:
    """Return what a box leaves of a falling stretch; None where it is no more than a point or runs along the border."""
    start, end = own.start, own.end
    lo, hi = as_rational(0.0), as_rational(1.0)
    for x, y, (low, high) in zip(start, end, limits, strict=True):
        if x == y:
            if not low < x < high:
                return None
            continue
        s, t = (low - x) / (y - x), (high - x) / (y - x)
        lo, hi = max(lo, min(s, t)), min(hi, max(s, t))
    if hi <= lo:
        return None

    def at(share: Any) -> Point:
        return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])

    return ExactStretch(start if lo == 0 else at(lo), end if hi == 1 else at(hi), own.piece)


def as_rational(x: float) -> Any:
    """Return a number as a rational, a float as it is."""
    from fcdm_opt.curve.exact.rationals import rational

    return rational(x)


def as_float(x: Any) -> float:
    """Return a rational, correctly rounded."""
    from fcdm_opt.curve.exact.rationals import quotient

    return quotient(x.p, x.q)
