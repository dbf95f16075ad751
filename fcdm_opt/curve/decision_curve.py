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
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.region import Piece, Region, pair_region, same_pair
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, frozen, numbers
from fcdm_opt.geometry.bodies import Body, rigid_transform
from fcdm_opt.tolerances import DEFAULT

Box = tuple[tuple[float, float], tuple[float, float]]
DEFAULT_BOX: Box = ((0.8, 3.0), (0.8, 3.0))


@dataclass(frozen=True, eq=False)
class Segment:
    """One straight piece of the curve: one contact feature.

    Attributes
    ----------
    feature : Feature
    line : (3,) array
        (a, b, c) of the contact line a rho_1 + b rho_2 = c, in lengths (unit normal); overlap on the side of (a, b).
    normal : (3,) array
        Unit direction from body 1 to body 2, world frame.
    start, end : (2,) arrays
        Ends inside the box, in the order of the chain: overlap on the left.
    parts : tuple of int
        The part pair, 0-based.
    snug : bool
        Overlap on both sides: a fit without play.
    index : int
        1-based number in the box; 0 outside it.
    run : Run
        The unclipped stretch, and the pieces of the part pairs in it.
    """

    feature: Feature
    line: Array
    normal: Array
    start: Array
    end: Array
    parts: tuple[int, int]
    snug: bool
    index: int
    run: Run

    @property
    def configuration(self) -> str:
        """Which of the seven contact configurations it is, see `Contact.configuration`."""
        return self.run.whole.contact.configuration

    def piece_at(self, rho: Array) -> Piece:
        """Return the piece of the part pair that touches at a scale pair of the segment."""
        return self.run.at(rho)


@dataclass(frozen=True, eq=False)
class SwitchingPoint:
    """Where two segments meet.

    Attributes
    ----------
    rho : (2,) array
    features : tuple of two Feature
        Of the segments before and after it.
    lines : (2, 3) array
        Their contact lines.
    pieces : tuple of two Piece
        Their unclipped pieces.
    touching : tuple of Contact
        What touches there: one contact (for instance V1E2) where the two segments' merge, or two at once.
    contact_sets : tuple of (k, 3) arrays
        What the bodies share in each contact: a point, a segment's ends or a polygon's corners, world frame.
    index : int
        1-based number in the box; 0 outside it.
    """

    rho: Array
    features: tuple[Feature, Feature]
    lines: Array
    pieces: tuple[Piece, Piece]
    touching: tuple[Contact, ...]
    contact_sets: tuple[Array, ...]
    index: int

    @property
    def contact_features(self) -> tuple[Feature, ...]:
        """One feature (for instance V1E2) where the two contacts merge, or both where they are two at once."""
        return tuple(contact.feature for contact in self.touching)

    @property
    def contacts(self) -> Array:
        """Contact points, one a contact, (k, 3), world frame."""
        return frozen([own.mean(axis=0) for own in self.contact_sets])

    @property
    def configurations(self) -> tuple[str, ...]:
        """Which of the seven contact configurations each contact is, see `Contact.configuration`."""
        return tuple(contact.configuration for contact in self.touching)

    @property
    def kind(self) -> str:
        """For instance "V1E2", or "V1F2 & V1F2" for two contacts at once."""
        return " & ".join(feature.kind for feature in self.contact_features)

    @property
    def label(self) -> str:
        """The contact features' labels."""
        return " & ".join(feature.label for feature in self.contact_features)


@dataclass(frozen=True, eq=False)
class Branch:
    """A connected chain of the curve inside the box.

    Attributes
    ----------
    segments : tuple of Segment
    """

    segments: tuple[Segment, ...]

    @property
    def is_function(self) -> bool:
        """Whether rho_2 is a function of rho_1 along it."""
        runs = [segment.end[0] - segment.start[0] for segment in self.segments]
        return all(run > 0 for run in runs) or all(run < 0 for run in runs)


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
            pair_region(one, two, self.transform, self.pose, (i, j))
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
            chain = [stretch for stretch in whole if not _is_point(stretch.whole)] or list(whole)
            run: list[Segment] = []
            first = len(branches)
            for k, stretch in enumerate(chain):
                piece = stretch.whole
                span = _clipped(piece, self.box)
                if span is not None:
                    count += 1
                    if run and not same_pair(run[-1].end, span[0]):
                        branches.append(Branch(tuple(run)))
                        run = []
                    run.append(self._segment(stretch, span, count))
                successor = chain[(k + 1) % len(chain)]
                meets = len(chain) > 1 and np.isfinite(piece.hi) and same_pair(piece.end, successor.whole.start)
                if meets and _inside(piece.end, self.box):
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
        return self._crossings(np.array([float(rho1), 0.0]), np.array([0.0, 1.0]), self.box[1])

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
        values = np.asarray(rho1, dtype=np.float64)
        found = [self.crossings(x) for x in values.ravel()]
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
    if limits.shape != (2, 2) or not (
        np.isfinite(limits).all() and (limits[:, 0] >= 0).all() and (limits[:, 0] < limits[:, 1]).all()
    ):
        raise InputError(
            "the box is not two ranges", key="box", found=box, allowed="((lo, hi), (lo, hi)) with 0 <= lo < hi"
        )
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


def _inside(point: Array, box: Box) -> bool:
    slack = DEFAULT.line * np.abs(point)
    return all(lo - e <= x <= hi + e for x, (lo, hi), e in zip(point, box, slack, strict=True))


def _is_point(piece: Piece) -> bool:
    """Tell whether a piece is too short for floats to tell its ends apart."""
    size = np.abs(piece.start).sum() + np.abs(piece.end).sum()
    return bool(size < np.inf and np.abs(piece.end - piece.start).sum() <= DEFAULT.point * size)


def _clipped(piece: Piece, box: Box) -> tuple[Array, Array] | None:
    """Return the ends of the stretch of a piece inside the box, None if there is none of positive length."""
    limits = np.array(box, dtype=np.float64).ravel()

    def left(start: Array, end: Array, endless: bool) -> tuple[Array, Array] | None:
        some, *ends = kernels.clip(start, end, endless, piece.line, limits, DEFAULT.point)
        return (frozen(ends[:2]), frozen(ends[2:])) if some else None

    if np.isfinite(piece.lo) and np.isfinite(piece.hi):
        return left(piece.start, piece.end, False)
    if np.isfinite(piece.lo):
        return left(piece.start, piece.travel, True)
    anchor = piece.end if np.isfinite(piece.hi) else piece.base
    before = left(anchor, -piece.travel, True)
    after = None if np.isfinite(piece.hi) else left(anchor, piece.travel, True)
    if before and after:
        return before[1], after[1]
    return (before[1], before[0]) if before else after
