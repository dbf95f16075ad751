"""The decision curve of two bodies: all scale pairs (rho_1, rho_2) at which they just touch."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Literal
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import Contact, Joint, Meeting, joints, meetings
from fcdm_opt.curve.envelope import Run, Union, boundary, inside
from fcdm_opt.curve.flush import Flush, flush_contacts
from fcdm_opt.curve.pruning import region_between
from fcdm_opt.curve.region import Region, same_pair
from fcdm_opt.curve.segments import (
    Box,
    Branch,
    Segment,
    SwitchingPoint,
    clipped,
    in_box,
    is_point,
    shared,
    without_borders,
)
from fcdm_opt.errors import InputError, expected, known_arguments
from fcdm_opt.geometry.arrays import Array, Ints, frozen, numbers
from fcdm_opt.geometry.bodies import Body, rigid_transform
from fcdm_opt.geometry.facet_errors import deviation_of
from fcdm_opt.geometry.solids import PlacedSolids, kept_as_surface
from fcdm_opt.lazy_import import NotebookRepr
from fcdm_opt.plain import Plain
from fcdm_opt.tolerances import DEFAULT

DEFAULT_BOX: Box = ((0.8, 3.0), (0.8, 3.0))
_SHARES = ((0.5, 0.5), (0.29, 0.63), (0.71, 0.41))  # of the box, where a curve that does not pass it is asked
LISTED = 10_000  # part pairs up to which what touches at a place is told by the curve
REMEMBERED = 128  # answers about scale pairs that are kept


@dataclass(frozen=True, eq=False)
class DecisionCurve(NotebookRepr, Plain):
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

    plain_names = ("movable", "static", "box", "status", "paths", "segments", "switching_points")
    plain_kinds: ClassVar[Mapping[str, Any]] = {"movable": str, "static": str}

    movable: Body
    static: Body
    transform: Array
    box: Box

    def to_dict(self) -> dict[str, Any]:
        """Return what is in the box as plain data, the bodies by their names."""
        return {**super().to_dict(), "movable": self.movable.name, "static": self.static.name}

    def __repr__(self) -> str:
        """Return whose curve it is, and the box, on one line; nothing is worked out for it."""
        ends = ", ".join(f"rho_{k} {low:.6g} to {high:.6g}" for k, (low, high) in enumerate(self.box, 1))
        return f"DecisionCurve({self.movable.name!r} against {self.static.name!r}: {ends})"

    def __str__(self) -> str:
        """Return how many segments and switching points there are in the box, too."""
        counts = f"segments: {len(self.segments)}, switching points: {len(self.switching_points)}"
        return f"{repr(self)[:-1]}, {counts})"

    @cached_property
    def pose(self) -> Array:
        """R, row by row, and d = s_2 - s_1 with the moved seed, (12,)."""
        return frozen(relative_pose(self.movable, self.static, self.transform))

    @property
    def _convex(self) -> bool:
        return len(self.movable.parts) == len(self.static.parts) == 1

    @cached_property
    def _union(self) -> Union:
        return Union.of(self.movable, self.static, self.transform, self.box)

    @cached_property
    def regions(self) -> tuple[Region, ...]:
        """Overlap regions of the part pairs that can be on the curve in the box."""
        if self._convex:
            return (region_between(self.movable, self.static, self.transform, (0, 0)),)
        return self._union.regions

    @cached_property
    def chains(self) -> tuple[tuple[Run, ...], ...]:
        """The curve: of two convex bodies in the whole quadrant, of others in the box and a narrow rim about it."""
        found = boundary(self.regions[0]) if self._convex else self._union.chains
        return tuple(tuple(chain) for chain in found)

    @cached_property
    def _listed(self) -> tuple[tuple[Branch, ...], tuple[SwitchingPoint, ...]]:
        branches: list[Branch] = []
        points: list[SwitchingPoint] = []
        count = 0
        for whole in self.chains:
            chain = [stretch for stretch in whole if not is_point(stretch.whole)] or list(whole)
            spans = [clipped(stretch.whole, self.box) for stretch in chain]
            shown = next((np.mean(span, axis=0) for span in spans if span is not None), None)
            if shown is not None and self._buried(shown):
                continue
            back = _hanging(chain, spans)
            chain, spans = chain[-back:] + chain[:-back], spans[-back:] + spans[:-back]
            run: list[Segment] = []
            for k, (stretch, span) in enumerate(zip(chain, spans, strict=True)):
                piece = stretch.whole
                if span is not None:
                    count += 1
                    if run and not same_pair(run[-1].end, span[0]):
                        branches.append(Branch(tuple(run)))
                        run = []
                    own = piece.feature, piece.line, piece.normal, *span, piece.parts, piece.snug
                    run.append(Segment(*own, count, stretch))
                successor = chain[(k + 1) % len(chain)]
                meets = len(chain) > 1 and np.isfinite(piece.hi) and same_pair(piece.end, successor.whole.start)
                if meets and in_box(piece.end, self.box):
                    points.append(self._switching_point(stretch, successor, len(points) + 1))
            if run:
                branches.append(Branch(tuple(run)))
        for rho, one, two in [] if self._convex else self._union.isolated:
            near = DEFAULT.nominal * float(np.linalg.norm(self.pose[9:]) + rho @ self._circumradii)
            if in_box(rho, self.box) and abs(self.near_gap(rho, near)) <= near:
                runs = Run(one, (one,)), Run(two, (two,))
                points.append(self._switching_point(*runs, len(points) + 1, isolated=True))
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
    def modelled(self) -> dict[str, int]:
        """How many part pairs and pairs of features were worked out, of how many there are.

        Features kept are the contact lines of the pairs that can be on the curve; the total counts each face with each
        vertex extreme towards it, and each edge with each edge.
        """
        bodies = self.movable, self.static
        one, two = (np.array([[len(part.loops), len(part.edges)] for part in body.parts]) for body in bodies)
        (faces, edges), (others, against) = one.sum(axis=0).tolist(), two.sum(axis=0).tolist()
        return {
            "part_pairs_kept": 1 if self._convex else self._union.walked,
            "part_pairs_total": len(one) * len(two),
            "features_kept": sum(len(region.lines) for region in self.regions),
            "features_total": faces * len(two) + others * len(one) + edges * against,
        }

    @property
    def paths(self) -> dict[str, int]:
        """How many part pairs were proved in floats ("float") and how many settled in rational numbers ("exact")."""
        taken = [region.path for region in self.regions]
        return {path: taken.count(path) for path in ("float", "exact")}

    @cached_property
    def status(self) -> CurveStatus:
        """Return "contact", or "apart" or "overlapping" in the whole box."""
        if len(self.regions) == 1:  # without building any segment
            state = self.regions[0].state_in(np.array(self.box, dtype=np.float64).ravel())
            if state in _STATUS:
                return _STATUS[state]
        if self.segments or self.switching_points:
            return "contact"
        (a, b), (c, d) = ((low, min(high, 2.0 * low + 1.0)) for low, high in self.box)
        places = np.array([(a + p * (b - a), c + q * (d - c)) for p, q in _SHARES])
        # parts that touch at all scales may overlap by rounding, and at a single scale pair parts may just fit
        slack = DEFAULT.planarity * (np.linalg.norm(self.pose[9:]) + places @ self._circumradii)
        return "overlapping" if (np.atleast_1d(self.gap(places)) < -slack).any() else "apart"

    def _switching_point(self, run: Run, successor: Run, index: int, *, isolated: bool = False) -> SwitchingPoint:
        before, after = run.pieces[-1], successor.pieces[0]
        return SwitchingPoint(
            frozen(before.end),
            (run.whole.feature, successor.whole.feature),
            frozen([before.line, after.line]),
            (before.contact.labelled(run.whole.feature), after.contact.labelled(successor.whole.feature)),
            (before, after),
            (self.movable, self.static),
            self.pose,
            index,
            isolated,
        )

    def contact_sets(self, rho: ArrayLike) -> tuple[Array, ...]:
        """Return what the bodies share at a scale pair on the curve, one array a contact; empty off the curve.

        Each is (1, 3) for a point, (2, 3) for a segment's ends, (k, 3) for a polygon's corners in order; world frame.
        """
        return tuple(own for _, own in self.touching(rho))

    def touching(self, rho: ArrayLike) -> tuple[tuple[Contact, Array], ...]:
        """Return what touches at a scale pair on the curve, each contact with what is shared there; see `contact_sets`.

        Of very many part pairs without listing their curve, as of parts that touch at all scales.
        """
        point, bodies = _pair(rho), (self.movable, self.static)
        slack = DEFAULT.nominal * max(body.size for body in bodies)
        found = self.locate(point) if len(self.movable.parts) * len(self.static.parts) <= LISTED else None
        if isinstance(found, SwitchingPoint):
            return tuple(zip(found.touching, found.contact_sets, strict=True))
        if found is None:
            on_curve = abs(self.near_gap(point, slack)) <= slack
            met = without_borders(meetings(*bodies, self.pose, point, slack)) if on_curve else ()
        else:
            piece = found.piece_at(point)
            others = meetings(*bodies, self.pose, point, slack)
            met = (Meeting(piece.parts, piece.contact), *(own for own in others if own.parts != piece.parts))
        return tuple((own.contact, shared(bodies, self.pose, own, point)) for own in met)

    def contact_points(self, rho: ArrayLike) -> Array:
        """Return one point of each contact at a scale pair on the curve, (k, 3), world frame; (0, 3) off the curve.

        The middle of the corners of each of `contact_sets`.
        """
        return np.array([own.mean(axis=0) for own in self.contact_sets(rho)]).reshape(-1, 3)

    def locate(self, rho: ArrayLike, tolerance: float = DEFAULT.nominal) -> Segment | SwitchingPoint | None:
        """Return the switching point or segment at a scale pair, None off the curve.

        `tolerance` is relative: of each scale at a switching point, of the larger at a segment.
        """
        point = _pair(rho)
        return self._remembered((*point.tolist(), tolerance), lambda: self._located(point, tolerance))

    def flush(self, rho: ArrayLike) -> tuple[Flush, ...]:
        """Return the flush contacts of the bodies as drawn, without `transform`, at a scale pair on their curve."""
        point = _pair(rho)
        return self._remembered(tuple(point.tolist()), lambda: flush_contacts(self.movable, self.static, point))

    def joints(self, rho: ArrayLike, slack: float) -> tuple[Joint, ...]:
        """Return every contact of the bodies as drawn at a scale pair on their curve; see `contact.joints`."""
        point = _pair(rho)
        return self._remembered(
            ("joints", *point.tolist(), slack), lambda: joints(self.movable, self.static, point, slack)
        )

    def _remembered(self, asked: tuple[Any, ...], answer: Callable[[], Any]) -> Any:
        """Return an answer, one of the last if it is asked again: many problems ask for the same nominal scale pair."""
        if asked not in self._known:
            if len(self._known) >= REMEMBERED:
                del self._known[next(iter(self._known))]
            self._known[asked] = answer()
        return self._known[asked]

    @cached_property
    def _known(self) -> dict[tuple[Any, ...], Any]:
        return {}

    def _located(self, point: Array, tolerance: float) -> Segment | SwitchingPoint | None:
        near = tolerance * np.abs(point).max()
        most = 2.0 * near * float(self._circumradii.sum())
        if point.min() > 0 and abs(self.near_gap(point, most)) > most:
            return None  # a change of the scales by `near` closes no such gap
        each = np.maximum(tolerance * np.abs(point), DEFAULT.point * np.abs(point).max())  # one may be much smaller
        low, high = np.array(self.box).T
        inside = ((low < point - each) & (point + each < high)).all()  # all that is there is listed
        for curve in (self,) if inside else (self, self._about(point)):
            for switching_point in curve.switching_points:
                if (np.abs(switching_point.rho - point) <= each).all():
                    return switching_point if curve is self else replace(switching_point, index=0)
            for segment in curve.segments:
                if np.abs(segment.nearest(point) - point).max() <= near:
                    return segment if curve is self else replace(segment, index=0)
        return None

    def nearest(self, rho: ArrayLike) -> Array:
        """Return the scale pair on the curve nearest to a scale pair, (2,); nan where there is none.

        Of the curve in the box, and in a box from half to twice the scales unless nothing outside can be nearer.
        """
        point, found, (low, high) = _pair(rho), np.full(2, np.inf), np.array(self.box).T
        for curve in (self, self._about(point)):
            listed = [segment.nearest(point) for segment in curve.segments]
            listed += [other.rho for other in curve.switching_points if other.alone]
            found = min([found, *listed], key=lambda p: float(np.linalg.norm(p - point)))
            if np.linalg.norm(found - point) <= np.minimum(point - low, high - point).min():
                break
        return frozen(np.where(np.isfinite(found), found, np.nan))

    def _about(self, point: Array) -> DecisionCurve:
        """Return the same curve listed about a scale pair: of two convex bodies in the whole quadrant."""
        if not self._convex:
            low, high = np.maximum(point, 0.0) / 2.0, np.maximum(2.0 * point, DEFAULT.nominal)
            return replace(self, box=((low[0], high[0]), (low[1], high[1])))
        whole = replace(self, box=((0.0, np.inf), (0.0, np.inf)))
        whole.__dict__["regions"] = self.regions
        return whole

    @cached_property
    def _circumradii(self) -> Array:
        """Largest distance of a vertex from the seed of either body, (2,)."""
        return np.array([max(part.circumradius for part in body.parts) for body in (self.movable, self.static)])

    def crossings(self, rho1: float) -> Array:
        """Return all contact scales rho_2 in the box at a given rho_1, increasing."""
        value = numbers(rho1, "rho1")
        if value.shape != () or not np.isfinite(value):
            raise InputError("a scale is a finite number", key="rho1", found=rho1)
        return self._crossings(float(value))

    def _crossings(self, rho1: float) -> Array:
        """Return where rho_1 = const meets the boundary of the union of the open overlap regions, in the box."""
        (low, high), span = self.box
        if not (self._convex or low <= rho1 <= high):  # what is hidden or apart there is not known
            around = (max(rho1, 0.0) * (1.0 - DEFAULT.rim), max(rho1, DEFAULT.rim) * (1.0 + DEFAULT.rim))
            return replace(self, box=(around, span))._crossings(max(rho1, 0.0))
        regions = self.regions if self._convex else (*self._union.regions, *self._union.hiding)
        found = [inside(region, np.array([rho1, 0.0]), np.array([0.0, 1.0])) for region in regions]
        intervals = sorted((max(lo, 0.0), hi) for lo, hi in found if hi > max(lo, 0.0))
        ends: list[float] = []
        for lo, hi in intervals:
            if ends and lo < ends[-1] * (1.0 - DEFAULT.line):
                ends[-1] = max(ends[-1], hi)
            elif ends and lo <= ends[-1] * (1.0 + DEFAULT.line):
                ends[-1:] = [lo, hi]  # two regions meet in one point: a snug fit
            else:
                ends += [lo, hi]
        low, high = span[0] * (1.0 - DEFAULT.line), span[1] * (1.0 + DEFAULT.line)
        apart = [s for k, s in enumerate(ends) if not (k and s <= ends[k - 1] * (1.0 + DEFAULT.line))]
        listed = [float(np.clip(s, *span)) for s in apart if low <= s <= high and 0 < s < np.inf]
        return np.array([s for s in listed if not self._buried(np.array([rho1, s]))])

    def rho2(self, rho1: ArrayLike) -> Array:
        """Return the least contact scale rho_2 in the box for each rho_1, nan where there is none."""
        values = numbers(rho1, "rho1")
        found = [self.crossings(x) for x in values.ravel().tolist()]
        return np.array([s[0] if s.size else np.nan for s in found]).reshape(values.shape)

    def gap(self, rho: ArrayLike, *, settled: bool = True) -> Array | float:
        """Return the signed gap: > 0 apart, 0 touching, < 0 overlapping, length units.

        For positive scales its sign is always right, or with `settled` false within rounding of 0.

        For each part pair the largest separation over the facet directions of its Minkowski difference (minus the
        penetration depth where they overlap), least over the pairs; never more than the distance. Pairs of a union
        count with that along the axes, their diagonals, or from middle to middle of the two parts where it is more.
        Bodies kept as surfaces count as the solids that they are: one inside the other overlaps it, and depths are
        those of `geometry.solids.PlacedSolids.depth`, no less than that of any pair.

        Parameters
        ----------
        rho : (2,) or (n, 2) array
        settled : bool
            Have rational arithmetic settle the sign where rounding would decide; false for what has a slack anyway.
        """
        pairs = numbers(rho, "rho")
        if pairs.ndim not in (1, 2) or pairs.shape[-1] != 2 or not np.isfinite(pairs).all():
            raise InputError("scale pairs are finite numbers, (2,) or (n, 2)", key="rho", found=rho)
        flat = np.ascontiguousarray(pairs.reshape(-1, 2))
        gaps, positive = self._of_parts(flat), (flat > 0).all(axis=1)
        near = DEFAULT.sign * (np.linalg.norm(self.pose[9:]) + flat @ self._circumradii)
        for k in np.flatnonzero(positive & (np.abs(gaps) <= near)) if settled else ():  # rounding would decide
            gaps[k] = self._exact_gap(flat[k], near[k])
        for k in np.flatnonzero(positive) if kept_as_surface(self.movable, self.static) else ():
            gaps[k] = self._solids(flat[k]).gap(float(gaps[k]))
        return float(gaps[0]) if pairs.ndim == 1 else gaps.reshape(pairs.shape[:-1])

    def _of_parts(self, pairs: Array) -> Array:
        """Return the gaps of the convex parts at scale pairs, (n,); below 0 those of the solids are no larger."""
        if not self._convex:
            return np.asarray(kernels.least_gaps(*self._bodies, pairs)[0])
        rows = self.regions[0].facet_rows
        return np.asarray((rows[:, 5] - pairs @ rows[:, 3:5].T).max(axis=-1))

    def near_gap(self, rho: ArrayLike, slack: float, *, settled: bool = False) -> float:
        """Return the gap at a scale pair, see `gap`; any number below `-slack` where it is one.

        How deep solids overlap, which takes long, is not looked for where their parts tell that they do.
        """
        of_parts = float(self._of_parts(_pair(rho)[None])[0])
        return of_parts if of_parts < -slack else float(self.gap(rho, settled=settled))

    def _exact_gap(self, rho: Array, near: float) -> float:
        """Return the gap at positive scales where it is within rounding of 0: its sign by rational arithmetic."""
        bounds = np.zeros((1, 1)) if self._convex else kernels.pair_bounds(*self._bodies[:6], self.pose, rho)
        least = np.inf
        for i, j in np.argwhere(bounds <= near).tolist():
            region = region_between(self.movable, self.static, self.transform, (i, j))
            rows = region.facet_rows
            size, side = abs(float((rows[:, 5] - rows[:, 3:5] @ rho).max())), int(region.sides(rho[None])[0])
            exact = region.exact.separation(rho.tolist()) if side else 0.0
            # of parts that barely meet at all scales no line that the exact curve has need be near
            least = min(least, exact if abs(exact) <= 2.0 * near else side * max(size, float(np.finfo(float).tiny)))
        return least

    def _buried(self, rho: Array) -> bool:
        """Tell whether a contact of parts is inside a solid kept as its surface, with which the other one overlaps."""
        # all of its chain is, then, as that nowhere passes the surface
        complete = self.movable.full_body is self.static.full_body is None
        is_surface = complete and rho.min() > 0.0 and kept_as_surface(self.movable, self.static)
        return bool(is_surface and self._solids(rho).nested)

    def _solids(self, rho: Array) -> PlacedSolids:
        return PlacedSolids(self.movable, self.static, rho, self.transform)

    @property
    def _bodies(self) -> tuple[Array | Ints, ...]:
        """What the kernels take for two unions."""
        one, two = self.movable, self.static
        return (*one.packed, *two.packed, self.transform, one.seed, two.seed)

    def gap_bounds(self, rho: ArrayLike) -> tuple[float, float]:
        """Return bounds of the gap of the solids that the bodies' parts stand for; length units.

        By how far the parts are off these, see `Body.deviation`, and facets off the round faces they are taken for.
        Below: the gap less how far the parts fall short of the solids. Above: the distance of the parts and how far
        they stick out of the solids; where the parts overlap, the solids do, or are no further apart than that. Both
        are the gap or 0 where the parts are the solids themselves.

        Parameters
        ----------
        rho : (2,) array
            Scale pair, both positive.
        """
        pair = _pair(rho)
        outward, inward = (pair @ own for own in zip(*map(deviation_of, (self.movable, self.static)), strict=True))
        return float(self.gap(pair) - inward), float(self.distance(pair) + outward)

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
        if kept_as_surface(self.movable, self.static):
            return max(gap, self._solids(pair).distance)
        return float(np.maximum(gap, ScaledPair(self.movable, self.static).signed_distance(pair, self.transform)))


def _hanging(chain: Sequence[Run], spans: Sequence[tuple[Array, Array] | None]) -> int:
    """Return how many of the last stretches of a closed chain lead without a gap in the box to its first."""
    if not same_pair(chain[-1].whole.end, chain[0].whole.start):
        return 0
    for back in range(len(chain)):
        here, before = spans[-back], spans[-back - 1]
        if here is None or before is None or not same_pair(before[1], here[0]):
            return back
    return 0


@known_arguments
def decision_curve(
    movable: Body, static: Body, *, box: Sequence[Sequence[float]] = DEFAULT_BOX, transform: ArrayLike | None = None
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


_DRAWN: WeakValueDictionary[tuple[Body, Body, Box], DecisionCurve] = WeakValueDictionary()


def drawn_curve(movable: Body, static: Body, box: Box) -> DecisionCurve:
    """Return the decision curve of two bodies as drawn, the same one for all problems about them that live."""
    curve = _DRAWN.get((movable, static, box))
    if curve is None:
        curve = _DRAWN[movable, static, box] = decision_curve(movable, static, box=box)
    return curve


DecisionCurveList = tuple[DecisionCurve, ...]
CurveStatus = Literal["contact", "apart", "overlapping"]
_STATUS: dict[int, CurveStatus] = {
    kernels.CONTACT: "contact", kernels.WALKED: "apart", kernels.OVERLAPPING: "overlapping",
}  # fmt: skip


def checked_bodies(movable: Body, static: Body) -> None:
    """Raise `InputError` unless both are bodies."""
    for key, body in (("movable", movable), ("static", static)):
        expected(body, Body, key)


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
    return kernels.relative_pose(transform, movable.seed, static.seed)


def _pair(rho: ArrayLike) -> Array:
    point = numbers(rho, "rho")
    if point.shape != (2,) or not np.isfinite(point).all():
        raise InputError("a scale pair is two finite numbers", key="rho", found=rho)
    return point
