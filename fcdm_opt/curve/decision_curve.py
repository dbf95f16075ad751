"""The decision curve of two bodies: all scale pairs (rho_1, rho_2) at which they just touch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import Contact, contact_set
from fcdm_opt.curve.envelope import Run, boundary, overlap_interval
from fcdm_opt.curve.region import Piece, Region, pair_region, same_pair
from fcdm_opt.curve.segments import Box, Branch, Segment, SwitchingPoint, clipped, in_box, is_point
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, frozen, numbers
from fcdm_opt.geometry.bodies import Body, rigid_transform
from fcdm_opt.tolerances import DEFAULT

DEFAULT_BOX: Box = ((0.8, 3.0), (0.8, 3.0))


@dataclass(frozen=True, eq=False)
class DecisionCurve:
    """The decision curve of two bodies; build it with `decision_curve`.

    Everything is computed for the whole quadrant; the box only clips what is listed and numbered.

    Attributes
    ----------
    movable, static : Body
        As drawn.
    transform : (4, 4) array
        Pose change of the movable body.
    box : pair of intervals
        Of rho_1 and rho_2.
    """

    movable: Body
    static: Body
    transform: Array
    box: Box

    @cached_property
    def pose(self) -> Array:
        """R, row by row, and d = s_2 - s_1 with the moved seed, (12,)."""
        return frozen(relative_pose(self.movable, self.static, self.transform))

    @cached_property
    def regions(self) -> tuple[Region, ...]:
        """Overlap regions of all part pairs."""
        return tuple(
            pair_region(one, two, self.transform, (i, j))
            for i, one in enumerate(self.movable.parts)
            for j, two in enumerate(self.static.parts)
        )

    @cached_property
    def chains(self) -> tuple[tuple[Run, ...], ...]:
        """The curve in the whole quadrant."""
        return tuple(tuple(chain) for chain in boundary(self.regions))

    @cached_property
    def _listed(self) -> tuple[tuple[Branch, ...], tuple[SwitchingPoint, ...]]:
        branches: list[Branch] = []
        points: list[SwitchingPoint] = []
        count = 0
        for whole in self.chains:
            chain = [stretch for stretch in whole if not is_point(stretch.whole)] or list(whole)
            run: list[Segment] = []
            first = len(branches)
            for k, stretch in enumerate(chain):
                piece = stretch.whole
                span = clipped(piece, self.box)
                if span is not None:
                    count += 1
                    if run and not same_pair(run[-1].end, span[0]):
                        branches.append(Branch(tuple(run)))
                        run = []
                    run.append(self._segment(stretch, span, count))
                successor = chain[(k + 1) % len(chain)]
                meets = len(chain) > 1 and np.isfinite(piece.hi) and same_pair(piece.end, successor.whole.start)
                if meets and in_box(piece.end, self.box):
                    points.append(self._switching_point(stretch, successor, len(points) + 1))
            if run:
                branches.append(Branch(tuple(run)))
            made = branches[first:]
            if len(made) > 1 and same_pair(made[-1].segments[-1].end, made[0].segments[0].start):
                # a closed chain that starts inside the box
                branches[first] = Branch(branches.pop().segments + branches[first].segments)
        return tuple(branches), tuple(points)

    @property
    def branches(self) -> tuple[Branch, ...]:
        """Chains of segments inside the box."""
        return self._listed[0]

    @property
    def segments(self) -> tuple[Segment, ...]:
        """All segments inside the box, in order of their number."""
        return tuple(segment for branch in self.branches for segment in branch.segments)

    @property
    def switching_points(self) -> tuple[SwitchingPoint, ...]:
        """All switching points inside the box, in order of their number."""
        return self._listed[1]

    @property
    def paths(self) -> dict[str, int]:
        """How many part pairs were proved in floats ("float") and how many settled in rational numbers ("exact")."""
        taken = [region.path for region in self.regions]
        return {path: taken.count(path) for path in ("float", "exact")}

    @cached_property
    def status(self) -> str:
        """Return "contact", or "apart" or "overlapping" in the whole box."""
        if len(self.regions) == 1:  # without building any segment
            state = self.regions[0].state(np.array(self.box, dtype=np.float64).ravel())
            if state in _STATUS:
                return _STATUS[state]
        if self.segments:
            return "contact"
        middle = np.mean(self.box, axis=1)
        return "apart" if self.gap(middle) >= 0 else "overlapping"

    def _segment(self, run: Run, span: tuple[Array, Array], index: int) -> Segment:
        piece, (start, end) = run.whole, span
        return Segment(piece.feature, piece.line, piece.normal, start, end, piece.parts, piece.snug, index, run)

    def _switching_point(self, run: Run, successor: Run, index: int) -> SwitchingPoint:
        before, after = run.pieces[-1], successor.pieces[0]
        labels = run.whole.feature, successor.whole.feature
        rho = before.end
        if before.parts == after.parts and before.corner:
            touching: tuple[Contact, ...] = (before.corner,)
            sets = [self._contact_set(before, before.corner, rho)]
        else:
            touching = (run.whole.contact, successor.whole.contact)
            sets = [self._contact_set(piece, piece.contact, rho) for piece in (before, after)]
            merged = before.feature.merged(after.feature)
            size = max(self.movable.size, self.static.size)
            apart = np.abs(sets[0].mean(axis=0) - sets[1].mean(axis=0)).max()
            if merged and apart <= DEFAULT.nominal * size:  # one contact at a seam
                touching, sets = (before.contact.labelled(merged),), sets[:1]
        return SwitchingPoint(
            frozen(rho),
            labels,
            frozen([before.line, after.line]),
            (before, after),
            touching,
            tuple(frozen(own) for own in sets),
            index,
        )

    def _contact_set(self, piece: Piece, contact: Contact, rho: Array) -> Array:
        one, two = self.movable.parts[piece.parts[0]], self.static.parts[piece.parts[1]]
        return self.static.seed + contact_set(one, two, self.pose, piece.normal, contact, rho)

    def contact_sets(self, rho: ArrayLike) -> tuple[Array, ...]:
        """Return what the bodies share at a scale pair on the curve, one array a contact; empty off the curve.

        Each is (1, 3) for a point, (2, 3) for a segment's ends, (k, 3) for a polygon's corners in order; world frame.
        """
        found = self.locate(rho)
        if found is None:
            return ()
        if isinstance(found, SwitchingPoint):
            return found.contact_sets
        piece = found.piece_at(_pair(rho))
        return (frozen(self._contact_set(piece, piece.contact, _pair(rho))),)

    def contact_points(self, rho: ArrayLike) -> Array:
        """Return one point of each contact at a scale pair on the curve, (k, 3), world frame; (0, 3) off the curve.

        The middle of the corners of each of `contact_sets`.
        """
        return np.array([own.mean(axis=0) for own in self.contact_sets(rho)]).reshape(-1, 3)

    def locate(self, rho: ArrayLike, tolerance: float = DEFAULT.nominal) -> Segment | SwitchingPoint | None:
        """Return the switching point or segment at a scale pair (relative tolerance), None off the curve."""
        point = _pair(rho)
        near = tolerance * np.abs(point).max()
        for curve in (self, self._unboxed):
            for switching_point in curve.switching_points:
                if np.abs(switching_point.rho - point).max() <= near:
                    return switching_point if curve is self else replace(switching_point, index=0)
            for segment in curve.segments:
                piece = segment.run.whole
                s = np.clip(piece.parameter(point), piece.lo, piece.hi)
                if np.abs(piece.at(s) - point).max() <= near:
                    return segment if curve is self else replace(segment, index=0)
        return None

    @cached_property
    def _unboxed(self) -> DecisionCurve:
        """The same curve, listed in the whole quadrant."""
        whole = replace(self, box=((0.0, np.inf), (0.0, np.inf)))
        whole.__dict__["regions"] = self.regions
        return whole

    def crossings(self, rho1: float) -> Array:
        """Return all contact scales rho_2 in the box at a given rho_1, increasing."""
        value = numbers(rho1, "rho1")
        if value.shape != () or not np.isfinite(value):
            raise InputError("a scale is a finite number", key="rho1", found=rho1)
        return self._crossings(np.array([float(value), 0.0]), np.array([0.0, 1.0]), self.box[1])

    def _crossings(self, base: Array, travel: Array, span: tuple[float, float]) -> Array:
        """Return the parameters at which a line meets the boundary of the union of the open overlap regions."""
        intervals = sorted(
            (max(lo, 0.0), hi)
            for lo, hi in (overlap_interval(region, base, travel) for region in self.regions)
            if hi > max(lo, 0.0)
        )
        ends: list[float] = []
        for lo, hi in intervals:
            if ends and lo < ends[-1] * (1.0 - DEFAULT.line):
                ends[-1] = max(ends[-1], hi)
            elif ends and lo <= ends[-1] * (1.0 + DEFAULT.line):
                ends[-1:] = [lo, hi]  # two regions meet in one point: a snug fit
            else:
                ends += [lo, hi]
        return np.array([s for s in ends if span[0] <= s <= span[1] and 0 < s < np.inf])

    def rho2(self, rho1: ArrayLike) -> Array:
        """Return the least contact scale rho_2 in the box for each rho_1, nan where there is none."""
        values = numbers(rho1, "rho1")
        found = [self.crossings(x) for x in values.ravel().tolist()]
        return np.array([s[0] if s.size else np.nan for s in found]).reshape(values.shape)

    @cached_property
    def _rows(self) -> tuple[Array, ...]:
        return tuple(
            kernels.facet_rows(*one.packed, *two.packed, self.pose)[1]
            for one in self.movable.parts
            for two in self.static.parts
        )

    def gap(self, rho: ArrayLike) -> Array | float:
        """Return the signed gap: > 0 apart, 0 touching, < 0 overlapping, length units.

        For positive scales its sign is always right.

        For each part pair the largest separation over the facet directions of its Minkowski difference (minus the
        penetration depth where they overlap), least over the pairs; never more than the distance.

        Parameters
        ----------
        rho : (2,) or (n, 2) array
        """
        pairs = numbers(rho, "rho")
        if pairs.ndim not in (1, 2) or pairs.shape[-1] != 2 or not np.isfinite(pairs).all():
            raise InputError("scale pairs are finite numbers, (2,) or (n, 2)", key="rho", found=rho)
        flat = pairs.reshape(-1, 2)
        least = np.full(len(flat), np.inf)
        positive = np.asarray((flat > 0).all(axis=1))
        for region, rows in zip(self.regions, self._rows, strict=True):
            gaps = (rows[:, 5] - flat @ rows[:, 3:5].T).max(axis=-1)
            sides = np.sign(gaps)
            sides[positive] = region.sides(flat[positive])
            for k in np.flatnonzero((sides != np.sign(gaps)) | (sides == 0)):  # rounding would decide
                gaps[k] = region.exact.separation(flat[k].tolist()) if positive[k] else gaps[k]
            least = np.minimum(least, gaps)
        return float(least[0]) if pairs.ndim == 1 else least.reshape(pairs.shape[:-1])

    def distance(self, rho: ArrayLike) -> float:
        """Return the Euclidean distance of the scaled bodies, length units.

        0 where they touch or overlap, nan where the collision library cannot tell.
        """
        from fcdm_opt.geometry.collision import ScaledPair

        pair = _pair(rho)
        gap = float(self.gap(pair))
        if gap <= 0:
            return 0.0
        if pair.min() <= 0:
            raise InputError("scales are positive", key="rho", found=rho)
        return float(np.maximum(gap, ScaledPair(self.movable, self.static).signed_distance(pair, self.transform)))


def decision_curve(
    movable: Body,
    static: Body,
    *,
    box: Sequence[Sequence[float]] = DEFAULT_BOX,
    transform: ArrayLike | None = None,
) -> DecisionCurve:
    """Return the decision curve of two bodies.

    Parameters
    ----------
    movable, static : Body
        Body 1 and body 2, as drawn.
    box : ((lo, hi), (lo, hi))
        Range of rho_1 and rho_2 that is listed and numbered.
    transform : (4, 4) array, optional
        Rigid pose change of body 1 with its seed, world frame.

    Raises
    ------
    InputError
        For an empty or reversed box or a transform that is not rigid.
    """
    checked_bodies(movable, static)
    return DecisionCurve(movable, static, rigid_transform(transform), checked_box(box))


_STATUS = {kernels.CONTACT: "contact", kernels.WALKED: "apart", kernels.OVERLAPPING: "overlapping"}


def checked_bodies(movable: Body, static: Body) -> None:
    """Raise `InputError` unless both are bodies."""
    for key, body in (("movable", movable), ("static", static)):
        if not isinstance(body, Body):
            raise InputError("expected a Body", key=key, found=type(body).__name__)


def checked_box(box: Sequence[Sequence[float]]) -> Box:
    """Return a box of scale pairs as plain floats; raise `InputError` unless it is two ranges of positive width."""
    if box is DEFAULT_BOX:
        return DEFAULT_BOX
    limits = numbers(box, "box")
    if limits.shape != (2, 2):
        raise InputError("the box is not two ranges", key="box", found=box, allowed="((lo, hi), (lo, hi))")
    for name, (low, high) in zip(("rho_1", "rho_2"), limits.tolist(), strict=True):
        if not 0 <= low < high < np.inf:
            raise InputError(f"no range of {name}", key="box", found=(low, high), allowed="0 <= lo < hi, finite")
    (a, b), (c, d) = limits.tolist()
    return (a, b), (c, d)


def relative_pose(movable: Body, static: Body, transform: Array) -> Array:
    """Return (R row by row, d = s_2 - moved s_1), (12,): what the kernels take."""
    pose: Array = kernels.relative_pose(transform, movable.seed, static.seed)
    return pose


def _pair(rho: ArrayLike) -> Array:
    point = numbers(rho, "rho")
    if point.shape != (2,) or not np.isfinite(point).all():
        raise InputError("a scale pair is two finite numbers", key="rho", found=rho)
    return point
