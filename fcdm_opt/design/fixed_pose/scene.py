"""Two bodies at a pose: the rows of their part pairs, and the extremes of the gap over all sizes.

Sizes are the scales of both bodies (`Scales`), or the problem's own (`OwnSizes`): rows are affine in either. The gap of
scaled bodies is their signed distance: the Euclidean distance where they are apart, minus the penetration depth of the
deepest part pair where they overlap. That of sizes by name is the largest separation along a row, as in a stack-up.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from heapq import heappop, heappush
from itertools import count
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from fcdm_opt.curve import kernels as curve_kernels
from fcdm_opt.curve.contact import facing, supporting_contact
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.games import game
from fcdm_opt.curve.touching_sizes import PairRows, PlacedRow, TouchingSizes, is_behind, least_of
from fcdm_opt.curve.true_sizes import ROLES, ROUNDS, TrueSizes, normals_met
from fcdm_opt.design.contact_gaps import Extreme, Extremes
from fcdm_opt.design.fixed_pose import gaps as kernels
from fcdm_opt.design.sizes import SCALES, Sizes, tolerance_boxes
from fcdm_opt.geometry.arrays import Array, Flags, Ints, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.size import Size
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

PIECES = 2000  # pieces of a box of sizes looked at for the largest gap of unions; what is left in doubt is told
PLANES = 100  # planes below the gap of a part pair, each new one where they are lowest
FACING = 0.5  # cosine of the angle between directions that look the same way
NEAR = 0.1  # of the size of the bodies: how far shifts go about a pose with whose rows they are looked at


@dataclass(frozen=True, eq=False)
class GapRows:
    """The rows of part pairs at a pose, see `gaps`.

    Of all `pairs`, (p, 2), those that may have the least gap at the sizes spoken of; the pose, (12,), is R, row by
    row, and s_2 - moved s_1. Where it is `along`, the gap is measured along rows alone.
    """

    rows: Array
    first: Ints
    pairs: Ints
    pose: Array
    along: bool = False

    def gaps(self, sizes: Array) -> Array:
        """Return the gaps at sizes, (n, k)."""
        return np.asarray(kernels.gaps(self.rows, self.first, self.along, np.ascontiguousarray(sizes))[0])

    def of_pairs(self, sizes: Array) -> Array:
        """Return the gap of each part pair at sizes, (p, n)."""
        return np.asarray(kernels.gaps_of_pairs(self.rows, self.first, self.along, np.ascontiguousarray(sizes)))

    def only(self, which: Ints) -> GapRows:
        """Return the rows of some part pairs."""
        rows = [self.rows[self.first[k] : self.first[k + 1]] for k in which.tolist()]
        return replace(self, rows=np.concatenate(rows), first=np.cumsum([0, *map(len, rows)]), pairs=self.pairs[which])

    def at(self, rho: Array) -> Extreme:
        """Return the gap at sizes."""
        found, owners, directions = kernels.gaps(self.rows, self.first, self.along, np.ascontiguousarray(rho[None]))
        i, j = self.pairs[owners[0]].tolist()
        return Extreme(float(found[0]), frozen(rho), (i, j), frozen(directions[0]))


class SizedBodies:
    """Two bodies, and the sizes that they may have."""

    names: tuple[str, ...] = SCALES
    # of scaled bodies, about their seeds, part by part; empty of others
    vertices: Sequence[Array] = (np.empty((0, 3)), np.empty((0, 3)))
    starts: Sequence[Ints] = (np.zeros(1, np.int64), np.zeros(1, np.int64))  # where each part's begin
    circumradius: float  # how far points of body 1 are from its seed at most
    # how far apart the seeds may be of bodies that touch at some sizes; infinite where that is not known
    nearest: float = np.inf
    covers: bool = True  # whether rows are known at all poses of a cell, however large
    # part pairs that are closed at all sizes, see `leave_out`, and what touches: they do not count
    permanent: Mapping[tuple[int, int], Feature] = MappingProxyType({})
    behind: Collection[tuple[int, int]] = ()  # others left out with them, see `TouchingSizes.behind`
    apart: Collection[tuple[int, int]] = ()  # others that do not count

    def __init__(self, movable: Body, static: Body, sizes: Sizes, apart: Collection[tuple[int, int]] = ()) -> None:
        self.movable, self.static, self.sizes, self.apart = movable, static, sizes, apart
        self.size = max(movable.size, static.size)

    def pose(self, transform: Array) -> Array:
        """Return the relative pose, (12,)."""
        return np.asarray(curve_kernels.relative_pose(transform, self.movable.seed, self.static.seed))

    def closed(self, pose: Array) -> dict[tuple[int, int], Feature | None]:
        """Return the part pairs closed at all sizes at a pose, and what touches; none if there are no others.

        With those left out with them, of which nothing does.
        """
        return self.closed_at_each([pose])

    def closed_at_each(self, poses: Sequence[Array]) -> dict[tuple[int, int], Feature | None]:
        """Return those closed at each of some poses."""
        found = self.closed(poses[0])
        for pose in poses[1:]:
            closed = self.closed(pose) if found else {}
            found = {own: feature for own, feature in found.items() if own in closed}
        return found

    @property
    def uncounted(self) -> frozenset[tuple[int, int]]:
        """Part pairs that do not count."""
        return frozenset((*self.permanent, *self.behind, *self.apart))

    @cached_property
    def counted(self) -> Flags:
        """Of scaled bodies which part pairs count, (parts 1, parts 2)."""
        found = np.ones((len(self.starts[0]) - 1, len(self.starts[1]) - 1), np.bool_)
        for own in self.uncounted if found.size else ():
            found[own] = False
        return found

    def leave_out(self, poses: Iterable[Array]) -> None:
        """Do not count part pairs that are closed at all sizes at each of these poses, a flange on its plate."""
        closed = self.closed_at_each([*poses])
        self.permanent = {own: feature for own, feature in closed.items() if feature is not None}
        self.behind = closed.keys() - self.permanent.keys()

    @property
    def permanent_in_words(self) -> tuple[str, ...]:
        """What touches at all sizes and is not counted."""
        return tuple(dict.fromkeys(map(self.in_words, self.permanent.values())))

    def in_words(self, feature: Feature) -> str:
        """Return what touches in words."""
        return feature.in_words(self.movable, self.static)


class Scales(SizedBodies):
    """Two bodies of which all parts are known, scaled about their seeds.

    Pieces at points where true faces meet are measured along the normals of these where they overlap: small ones would
    come apart sooner sideways, or are through each other.
    """

    def __init__(self, movable: Body, static: Body, sizes: Sizes, apart: Collection[tuple[int, int]] = ()) -> None:
        super().__init__(movable, static, sizes, apart)
        self.packed = (*movable.packed, *static.packed)
        bodies = movable, static
        self.vertices = [np.concatenate([part.vertices - body.seed for part in body.parts]) for body in bodies]
        self.starts = [np.cumsum([0, *(len(part.vertices) for part in body.parts)]) for body in bodies]
        self.far = np.array([np.linalg.norm(own, axis=1).max() for own in self.vertices])
        self.middle, self.spread = sizes.middle, float(self.far @ sizes.half)
        self.circumradius, self.nearest = float(sizes.box[0, 1] * self.far[0]), float((sizes.corners @ self.far).min())

    @cached_property
    def _pairs(self) -> Ints:
        return np.argwhere(self.counted)

    def closed(self, pose: Array) -> dict[tuple[int, int], Feature | None]:
        """Return them: a convex gap that is nothing in the corners and in the middle is so all over."""
        sizes = self.sizes.pairs if self.sizes.pairs is not None else np.vstack([self.sizes.corners, self.middle])
        pairs = np.array(list(np.ndindex(len(self.movable.parts), len(self.static.parts))), dtype=np.int64)
        gaps = self.of_pairs(pose, pairs, sizes)
        closed = np.abs(gaps).max(axis=1) <= DEFAULT.tie * self.size
        others, behind = ~closed & [own not in self.apart for own in map(tuple, pairs.tolist())], list[int]()
        each = [self._rows(pose, own[None]) for own in (pairs[closed] if others.any() else ())]
        held = [(at, at.at(self.middle)) for at in each]

        def along(parts: tuple[int, int], n: Array) -> PlacedRow:
            offset, one, two = self._plane(parts, n, pose)
            return PlacedRow(n, np.array([[0.0, -one, 0.0], [offset, 0.0, two]]))

        def is_hidden(k: int) -> bool:
            rows, parts = self._rows(pose, pairs[[k]], every=True).rows, (int(pairs[k, 0]), int(pairs[k, 1]))
            pair = PairRows(parts, rows[:, 3:6], rows[:, :3], [])
            return is_behind(pair, planes, along, (self.movable, self.static), pose[:9].reshape(3, 3), self.sizes.box)

        planes = [along(end.parts, end.way) for _, end in held]
        while held and others.any():
            nearest = np.flatnonzero(others & (gaps.min(axis=1) <= gaps[others].max(axis=1).min()))
            more = [*filter(is_hidden, nearest.tolist())]
            others[more] = False
            behind += more
            if not more:
                found = {end.parts: self.feature(at, end) for at, end in held}
                return found | dict.fromkeys(map(tuple, pairs[behind].tolist()))
        return {}

    def _rows(self, pose: Array, pairs: Ints, *, every: bool = False) -> GapRows:
        rows, first = kernels.pair_rows(*self.packed, pose, pairs)
        met = {} if every else normals_met((self.movable, self.static), pose[:9].reshape(3, 3))
        if met:
            kinds, added, places = np.full(len(rows), kernels.OTHER), list[Array](), list[int]()
            for k, own in enumerate(map(tuple, pairs.tolist())):
                for n in met.get(own, ()):
                    there = slice(first[k], first[k + 1])
                    kinds[there][rows[there, :3] @ n <= -FACING] = kernels.BACK
                    added.append(np.array([*n, *self._plane(own, n, pose), kernels.MET]))
                    places.append(k)
            rows = np.insert(np.column_stack([rows, kinds]), first[places], np.array(added).reshape(-1, 7), axis=0)
            first = first + np.searchsorted(places, np.arange(len(first)))
        return GapRows(rows, first, pairs, pose)

    def rows(self, pose: Array, slack: float = 0.0) -> GapRows:
        """Return the rows at a pose, of all part pairs that may have the least gap, points off it by up to `slack`."""
        # with slack those along all normals: elsewhere the pieces may meet along others
        pairs = self._pairs
        if len(pairs) > 1:
            middle, spread = self.middle, self.spread
            bounds = curve_kernels.pair_bounds(*self.packed, pose, middle)[tuple(pairs.T)]
            nearest = pairs[[int(bounds.argmin())]]
            gap = self._rows(pose, nearest).gaps(middle[None])[0]
            pairs = pairs[bounds <= gap + 2.0 * (spread + slack) + DEFAULT.prune * self.size]
            if not len(pairs):
                pairs = nearest
        return self._rows(pose, pairs, every=slack > 0.0)

    def of_pairs(self, pose: Array, pairs: Ints, sizes: Array) -> Array:
        """Return the gaps of part pairs at a pose and sizes, (p, n)."""
        return self._rows(pose, pairs).of_pairs(sizes)

    def extremes(self, at: GapRows, window: tuple[float, float] | None = None) -> Extremes:
        """Return the least and the largest gap over all sizes; within a window that only if it is off by more."""
        if self.sizes.pairs is not None:
            found = at.gaps(self.sizes.pairs)
            least, most = (at.at(self.sizes.pairs[k]) for k in (found.argmin(), found.argmax()))
            return Extremes(least, most)
        corners = self.sizes.corners
        values = at.of_pairs(corners)
        least = self._least(at, corners, values)
        most, doubt = self._most(at, corners, values, -np.inf if window is None else sum(window) - least.gap)
        return Extremes(least, most, doubt)

    def _most(self, at: GapRows, corners: Array, values: Array, enough: float) -> tuple[Extreme, float]:
        """Return the largest gap over the box, and by how much a larger one is not ruled out, if it may be `enough`.

        Over a piece no gap exceeds the mixture of the corners that does best against all part pairs: of convex
        functions, which lie below their mixtures, the least is asked.
        """
        gaps = values.min(axis=0)
        best = int(gaps.argmax())
        found, rho = float(gaps[best]), corners[best]
        if len(values) == 1:
            return at.at(rho), 0.0
        near, numbers = DEFAULT.tie * self.size, count()
        heap = [(-_no_more(values), next(numbers), self.sizes.box, at)]
        for _ in range(PIECES):
            if not heap or -heap[0][0] <= max(found + near, enough):
                break
            top, _, box, rows = heappop(heap)
            axis = int(np.argmax((box[:, 1] - box[:, 0]) * self.far))
            for side in (0, 1):
                piece = box.copy()
                piece[axis, 1 - side] = box[axis].mean()
                ends = np.array([(x, y) for x in piece[0] for y in piece[1]])
                own = rows.of_pairs(ends)
                least = own.min(axis=0)
                if least.max() > found:
                    found, rho = float(least.max()), ends[least.argmax()]
                most = min(_no_more(own), -top)
                # from its nearest corner no gap changes by more within the piece
                limit = most + self.far @ (piece[:, 1] - piece[:, 0]) / 2.0 + near
                heappush(heap, (-most, next(numbers), piece, rows.only(np.flatnonzero(own.min(axis=1) <= limit))))
        return at.at(rho), max(-heap[0][0] - found, 0.0) if heap else 0.0

    def _least(self, at: GapRows, corners: Array, values: Array) -> Extreme:
        """Return the least gap over the box: of each part pair the lowest point of planes below its convex gap."""
        best = at.at(corners[int(values.min(axis=0).argmin())])
        near, middle, half = DEFAULT.tie * self.size, self.sizes.middle, self.sizes.half
        for p in np.argsort(values.min(axis=1)).tolist():
            one = at.only(np.array([p]))
            met = one.rows[one.rows[:, -1] == kernels.MET] if one.rows.shape[1] > 6 else one.rows[:0]
            planes = (met if len(met) else one.rows)[:, 3:6]
            if (planes[:, 0] + planes[:, 1:] @ middle - np.abs(planes[:, 1:]) @ half).max() >= best.gap - near:
                continue  # along one direction no gap of this pair is less
            for _ in range(1 if len(met) else PLANES):
                level, rho = least_of(planes, self.sizes.box)
                if level >= best.gap - near:
                    break
                here = one.at(rho)
                if here.gap - level <= near:
                    best = at.at(rho)
                    break
                planes = np.vstack([planes, self._plane(here.parts, here.way, at.pose)])
        return best

    def _plane(self, parts: tuple[int, int], n: Array, pose: Array) -> Array:
        """Return the separation of a part pair along a direction, and its rates by the scales."""
        own, other = (v[s[k] : s[k + 1]] for v, s, k in zip(self.vertices, self.starts, parts, strict=True))
        return np.array([n @ pose[9:], -(own @ (n @ pose[:9].reshape(3, 3))).max(), (other @ n).min()])

    def feature(self, at: GapRows, extreme: Extreme) -> Feature:
        """Return the features that face each other at an extreme, along its direction."""
        one, two = self.movable.parts[extreme.parts[0]], self.static.parts[extreme.parts[1]]
        contact = supporting_contact(one, two, extreme.way, at.pose, DEFAULT.nominal)
        return facing(one, two, at.pose, contact, extreme.rho, extreme.way, extreme.gap).feature


def _no_more(values: Array) -> float:
    """Return what no mixture of corners (columns) exceeds against all part pairs (rows)."""
    return float((game(np.ascontiguousarray(-values)) @ values).max())


class OwnSizes(SizedBodies):
    """Two bodies at the scales made, with their own sizes; the rows at an orientation are those of all shifts about it.

    Where the movable body does not turn, `places`, (3, 2), are its least and largest shift that is asked about. With
    `true` the bodies are exact at its points, and pins have rows all around their bores, see `TrueSizes.all_around`.
    """

    def __init__(
        self, movable: Body, static: Body, own: tuple[Size, ...], places: Array | None = None,
        true: TrueSizes | None = None,
    ) -> None:  # fmt: skip
        super().__init__(movable, static, Sizes(tolerance_boxes(own)), () if true is None else true.apart())
        self._true = true
        self.own, self.names, self.places = own, tuple(size.name for size in own), places
        self.circumradius, self.covers = movable.size, places is not None
        self._kept: list[TouchingSizes] = []

    def _transform(self, pose: Array) -> Array:
        transform = np.eye(4)
        transform[:3, :3] = pose[:9].reshape(3, 3)
        transform[:3, 3] = self.static.seed - pose[9:] - transform[:3, :3] @ self.movable.seed
        return transform

    def _touching(self, pose: Array) -> tuple[TouchingSizes, Array]:
        """Return the rows at an orientation, and how far a pose is shifted from where they are."""
        transform = self._transform(pose)
        for kept in self._kept:
            shift = transform[:3, 3] - kept.transform[:3, 3]
            off = np.maximum(kept.ranges[:, 0] - shift, shift - kept.ranges[:, 1]).max()
            if (transform[:3, :3] == kept.transform[:3, :3]).all() and off <= DEFAULT.nominal * self.size:
                return kept, shift
        around = NEAR * self.size * np.array([[-1.0, 1.0]] * 3)
        ranges = around if self.places is None else self.places - transform[:3, 3:]
        found = TouchingSizes.of(
            *(self.movable, self.static, self.own), transform=transform, shifts=(np.eye(3), ranges), least=False,
            without=self.uncounted, normals=normals_met((self.movable, self.static), transform),
        )  # fmt: skip
        if self._true is not None:
            found = self._true.all_around(found, transform, np.eye(3))
        self._kept = [found]
        self._normals = np.vstack([own.normals for own in found.pairs]), np.array([own.parts for own in found.pairs])
        return found, np.zeros(3)

    def closed_at_each(self, poses: Sequence[Array]) -> dict[tuple[int, int], Feature | None]:
        """Return those closed at each of some poses: of one orientation at all shifts that these span."""
        transforms = np.array([self._transform(own) for own in poses])
        if (transforms[:, :3, :3] != transforms[0, :3, :3]).any():
            return super().closed_at_each(poses)
        offsets = transforms[:, :3, 3] - transforms[0, :3, 3]
        spread = np.linalg.svd(offsets)
        directions = spread[2][: int((spread[1] > DEFAULT.nominal * self.size).sum())]
        ranges = np.column_stack([own(offsets @ directions.T, axis=0) for own in (np.min, np.max)])
        at = TouchingSizes.of(self.movable, self.static, self.own, transform=transforms[0], least=False,
                              permanent=False, without=self.apart, shifts=(directions, ranges))  # fmt: skip
        middle = np.append(self.sizes.middle, np.zeros(len(directions)))
        rows = {own.parts: int((own.values[:, 0] + own.values[:, 1:] @ middle).argmax()) for own in at.permanent}
        return {own.parts: at.feature(own, rows[own.parts]) for own in at.permanent} | dict.fromkeys(at.behind)

    def rows(self, pose: Array, slack: float = 0.0) -> GapRows:
        """Return the rows at a pose, and at all that are shifted from it, of the part pairs that may be the nearest."""
        (touching, shift), count = self._touching(pose), len(self.own)
        values, starts = touching.stacked
        normals, pairs = self._normals
        rows = np.column_stack([normals, values[:, 0] + values[:, 1 + count :] @ shift, values[:, 1 : 1 + count]])
        return GapRows(rows, np.append(starts, len(rows)), pairs, pose, along=True)

    def of_pairs(self, pose: Array, pairs: Ints, sizes: Array) -> Array:
        """Return the gaps of part pairs at a pose and sizes, (p, n); infinite of those that are far apart there."""
        at, found = self.rows(pose), np.full((len(pairs), len(sizes)), np.inf)
        if np.array_equal(pairs, at.pairs):
            return at.of_pairs(sizes)
        places, known = np.nonzero((pairs[:, None] == at.pairs).all(axis=2))
        found[places] = at.of_pairs(sizes)[known]
        return found

    def _at(self, pose: Array) -> TouchingSizes:
        touching, shift = self._touching(pose)
        return touching.shifted(shift)

    def extremes(self, at: GapRows) -> Extremes:
        """Return the least and the largest gap over all sizes."""
        there = self._at(at.pose)

        def end(gap: float, p: Array) -> Extreme:
            pair, row = there.governing(p)
            return Extreme(gap, frozen(p), pair.parts, pair.normals[row])

        return Extremes(end(*there.least()), end(*there.largest()))

    def feature(self, at: GapRows, extreme: Extreme) -> Feature:
        """Return the features that face each other at an extreme."""
        there = self._at(at.pose)
        return there.feature(*there.governing(extreme.rho))


BodyGaps = Scales | OwnSizes


def true_sizes(problem: Problem, sizes: Sizes | None) -> TrueSizes | None:
    """Return bodies made exact at points of round faces, for scales or, without, own sizes; None if none is known."""
    if sizes is None:
        movable, static = problem.at_scales.values()
        found = TrueSizes.of(movable, static, problem.sizes)
    else:
        found = true_scales(problem.of_facets.movable, problem.of_facets.static, sizes)
    if found is not None:
        free = problem.limits[:, 0] < problem.limits[:, 1]
        rates = problem.motion.kinematics(problem.movable.seed, problem.static.seed).rates(np.zeros(len(free)))[1]
        found.of_rest, found.rates = True, (rates / problem.weights[:, None, None])[free]
        found.nearest(np.eye(4), np.mean([size.tolerance for size in found.sizes], axis=1), DEFAULT.snap * found.size)
    return found


def true_scales(movable: Body, static: Body, sizes: Sizes) -> TrueSizes | None:
    """Return bodies made exact at points of their round faces, for scales; None where no round face is known."""
    both = zip(SCALES, ROLES, (sizes.box - 1.0).tolist(), strict=True)
    scales = [Size(name, role, scale="xyz", tolerance=(low, high)) for name, role, (low, high) in both]
    return TrueSizes.of(movable, static, scales)


def true_extremes(
    true: TrueSizes, transform: Array, extremes: Extremes, rows: GapRows, *, own: bool, last: bool = True
) -> tuple[Extremes, bool]:
    """Return the extreme gaps at a pose as the true faces have them, and whether the bodies had been exact there.

    Small pieces of a round solid lie less deep in another one than the whole of it, or deeper where they have slid on
    each other: asked at the `last` pose. Where sizes shift round faces these may be nearer at either end of these.
    """
    ends = [(end.rho - (0.0 if own else 1.0), end.gap) for end in extremes[:2]]
    others = [at for place, _ in ends for at in true.shifted(place)] if own else []
    gaps = rows.gaps(np.array(others)).tolist() if others else []
    refined = true.refined(transform, [*ends, *zip(others, gaps, strict=True)])
    found = list(zip(extremes[:2], true.deepest[:2], strict=True))
    for place, gap in ends if own and not refined else ():
        low = rows.of_pairs(place[None])[:, 0] <= gap + DEFAULT.tie * true.size
        refined |= true.replaced(transform, place, gap, [*map(tuple, rows.pairs[low].tolist())])
    least, most = (end._replace(gap=deep[0], way=frozen(deep[1])) if deep else end for end, deep in found)
    if last and not (own or refined):
        least, most = (_of_slid(true, transform, end, rows) for end in (least, most))
    return Extremes(least, most, extremes.doubt), not refined


def _of_slid(true: TrueSizes, transform: Array, end: Extreme, rows: GapRows) -> Extreme:
    """Return an extreme gap, of pieces that have slid on each other since they met, as the true faces have it."""
    # the normals known there are then no longer theirs: they are nearer along these than anywhere
    met = normals_met(true.bodies, transform)
    if end.parts not in met or true.nearest(transform, end.rho - 1.0, end.gap + DEFAULT.tie * true.size):
        return end
    near = true.nearest(transform, end.rho - 1.0, max(abs(end.gap), NEAR * true.size))
    found = [end._replace(gap=own.gap, way=frozen(own.normal)) for own in near[:1]]
    others = [k for k, own in enumerate(map(tuple, rows.pairs.tolist())) if own not in met]
    found += [rows.only(np.array(others)).at(end.rho)] if others else []
    return min(found, key=lambda own: own.gap, default=end)


class ScaleGaps(NamedTuple):
    """Two bodies at a pose, made exact at points of round faces, and the extremes of their gap over a box of scales.

    `true` are their faces whose gaps these are; None where all are flat, or gaps are those of facets.
    """

    scene: Scales
    rows: GapRows
    extremes: Extremes
    true: TrueSizes | None

    @classmethod
    def of(cls, movable: Body, static: Body, transform: Array, box: Array) -> ScaleGaps:
        """Return it for bodies of facets, the movable one at a pose (4, 4), over scales between the ends of `box`."""
        sizes = Sizes(box)
        true = true_scales(movable, static, sizes)
        for _ in range(ROUNDS):
            scene = Scales(movable, static, sizes) if true is None else Scales(*true.bodies, sizes, true.apart())
            pose = scene.pose(transform)
            scene.leave_out([pose])
            rows = scene.rows(pose)
            extremes = scene.extremes(rows)
            if true is None:
                break
            extremes, exact = true_extremes(true, transform, extremes, rows, own=False)
            if exact:
                break
        return cls(scene, rows, extremes, true)
