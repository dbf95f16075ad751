"""The sizes at which two bodies touch at a pose: for each part pair the boundary of one convex polyhedron.

With n from body 1 to body 2, a pair of parts { A_i x <= b_i + G_i p } is apart by

    gap(p) = max over rows of n . (x_2(p) - x_1(p)),

x_i(p) the point of part i that the row's feature has: a row is a face with a corner of the other part in its normal's
cone, or two edges whose cones meet. (By Farkas' lemma the parts share a point iff lambda . (b + G p) >= 0 for all
lambda >= 0 with A^T lambda = 0, which faces' triples and pairs generate.) Rows are affine in p, and do not depend on it
otherwise. Those of which others are larger all over the box of sizes are left out; so the rest is complete there.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from operator import itemgetter
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import Contact, facing
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.games import game
from fcdm_opt.curve.pruning import region_between
from fcdm_opt.curve.region import Region
from fcdm_opt.errors import InputError, placed
from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.geometry.bodies import IDENTITY, Body, rigid_transform
from fcdm_opt.geometry.facet_errors import rounding_line
from fcdm_opt.geometry.measures import norms
from fcdm_opt.geometry.resizing import MovingPart, Resizing
from fcdm_opt.geometry.size import Size
from fcdm_opt.tolerances import DEFAULT

CLOSEST = 64  # part pairs apart whose corners bound the least gap
MOST_TRIPLES = 40  # facets of a part that changes its shape within the box: all its triples are corners then
ANSWERS = 200  # of a game over sizes, after which a linear program is asked
SAMPLES = 64  # sizes at which rows are seen to bind before any linear program is asked


class ChangedShapeError(InputError):
    """Tolerances within which other corners and edges meet than as drawn, in a part of too many faces to follow all."""


class PairRows(NamedTuple):
    """The rows that bind, of one pair of parts."""

    parts: tuple[int, int]  # indices of the parts
    values: Array  # (m, 1 + k): each row's gap as drawn, and how that changes a unit of each size
    normals: Array  # (m, 3): from body 1 to body 2, unit
    # kind "V", "E" or "F" and number of the parts' elements that touch
    elements: list[tuple[tuple[str, int], tuple[str, int]]]
    features: Sequence[Feature] = ()  # of contacts as drawn, in place of elements

    def some(self, rows: Ints) -> PairRows:
        """Return some rows."""
        own = ([each[k] for k in rows.tolist()] if len(each) else [] for each in (self.elements, self.features))
        return PairRows(self.parts, self.values[rows], self.normals[rows], *own)


class PlacedRow(NamedTuple):
    """How far two parts go along a direction from body 1 to body 2, and how that changes a unit of each size."""

    normal: Array
    ends: Array  # (2, 1 + k): of the first one where it ends, of the second where it begins

    @property
    def gap(self) -> Array:
        """How far apart the parts are along it, (1 + k,)."""
        return self.ends[1] - self.ends[0]


@dataclass(frozen=True, eq=False)
class TouchingSizes:
    """At which sizes two bodies touch at a pose, within a box of sizes."""

    bodies: tuple[Body, Body]  # as drawn, movable and static
    sizes: tuple[Size, ...]
    transform: Array  # (4, 4): of the movable body
    pairs: tuple[PairRows, ...]  # of the part pairs that can be the nearest within the box
    # by what factor the box may be widened until one of the bodies changes its shape, and the face there
    reach: tuple[float, str]
    # (s, 2): of shifts of the movable body, which count as sizes behind the others
    ranges: Array = field(default_factory=lambda: np.empty((0, 2)))
    permanent: tuple[PairRows, ...] = ()  # of part pairs that touch at all sizes of the box and were left out, see `of`
    behind: frozenset[tuple[int, int]] = frozenset()  # others that were left out with them, see `is_behind`
    # of bodies with round faces the patches, by number in `true_faces`, that meet at all sizes: they do not count
    permanent_faces: frozenset[tuple[int, int]] = frozenset()
    between: float = (
        0.0  # by how much gaps of true faces may be less, as between two directions of `TrueSizes.all_around`
    )
    as_drawn: bool = False  # whether rows are those of contacts as drawn, whatever the box: they are not found anew
    carried: Array | None = None  # (k, 3): how each size moves the movable body besides

    @classmethod
    def of(
        cls,
        movable: Body,
        static: Body,
        sizes: Sequence[Size],
        *,
        transform: Any = None,
        shifts: tuple[Array, Array] | None = None,
        carried: Array | None = None,
        least: bool = True,
        permanent: bool = True,
        without: Collection[tuple[int, int]] = (),
        normals: Mapping[tuple[int, int], Array] = MappingProxyType({}),
    ) -> TouchingSizes:
        """Return them, the movable body moved by a 4x4 transform, by default at rest; tolerances of sizes are the box.

        `shifts`, (s, 3) and (s, 2), are ways that the movable body is moved along, and how far at least and most: as
        sizes behind the others; `carried`, (k, 3), how each size moves it besides. With `least`, rows that bind nowhere
        in the box are all found and left out, which may take a linear program each. With `permanent`, part pairs count
        that touch at all sizes of the box, as a flange on its plate; without them the gap is that of all others, unless
        there are no others. Part pairs `without` do not count, and of others rows along one of their directions
        `normals`, (n, 3), alone do, if there are any.

        Raises `InputError` for sizes without tolerance, and where the box is so large that a body changes its shape in
        a way that its parts do not follow; names the face.
        """
        T = IDENTITY if transform is None else rigid_transform(transform)
        without = frozenset(without)
        if shifts is None or sizes:
            check_sizes(sizes)
        low, high = np.array([size.tolerance for size in sizes], float).reshape(-1, 2).T
        directions, ranges = (np.empty((0, 3)), np.empty((0, 2))) if shifts is None else shifts
        along = np.zeros((len(sizes), 3)) if carried is None else carried
        sides, reaches, shares = [], [], []
        for role, body in (("movable", movable), ("static", static)):
            own = [k for k, size in enumerate(sizes) if size.body == role]
            moving = Resizing.of(body, [sizes[k] for k in own])
            if turned := moving.inclined():
                raise InputError(
                    f"{turned}: the gap does not change in proportion", key="sizes", found=body.name,
                    allowed='for a stack-up "xyz", or an axis that all faces are along or across; solve takes any',
                )  # fmt: skip
            reached = moving.reaches(low[own], high[own])
            lowest = min(reached, key=lambda one: one[0])
            parts = [*moving.parts]
            for k, (part, (factor, where)) in enumerate(zip(moving.parts, reached, strict=True)):
                if factor >= 1.0:
                    continue
                if len(part.faces) > MOST_TRIPLES:
                    what = f"{where} is reached, where the body changes its shape"
                    raise ChangedShapeError(**_beyond(moving, what, f"up to {100.0 * factor:.4g} % of them"))
                parts[k] = part.with_all_corners()
                if _is_lost(parts[k], low[own], high[own]):
                    piece = "a piece that is cut off " * (len(moving.parts) > 1) + f"body '{body.name}'"
                    raise InputError(**_beyond(moving, f"nothing may be left of {piece}", "smaller ones"))
            if lowest[0] < 1.0 and len(moving.parts) > 1:  # where only cuts end elsewhere, all is well
                with placed(key="sizes.tolerance"):
                    moving.check(low[own], high[own])
            R, t = (T[:3, :3], T[:3, 3]) if role == "movable" else (np.eye(3), np.zeros(3))
            factor = float(role == "movable")
            posed = [_PosedPart.of(part, own, factor * along, R, t) for part in parts]
            sides.append([part.shifted(factor * directions) for part in posed] if len(directions) else posed)
            reaches.append(lowest)
            shares.append(np.zeros(len(sizes)))
            shares[-1][own] = moving.shares
        box = np.vstack([np.column_stack([low, high]), ranges])
        size = max(movable.size, static.size)
        slack, known, behind = DEFAULT.tie * size, dict[tuple[int, int], PairRows](), set[tuple[int, int]]()

        def placed_row(parts: tuple[int, int], n: Array) -> PlacedRow:
            one, two = (side[k] for side, k in zip(sides, parts, strict=True))
            corners = (one, int((one.points @ n).argmax())), (two, int((two.points @ n).argmin()))
            return PlacedRow(n, np.array([[part.points[k] @ n, *(n @ part.moves[k])] for part, k in corners]))

        while True:
            counted = _near_enough(sides, box, slack, without | behind)
            for i, j in counted:
                if (i, j) not in known:
                    known[i, j] = _pair((i, j), sides[0][i], sides[1][j], box, size, normals.get((i, j)))
            pairs = [known[own] for own in counted]
            always = [not permanent and np.abs(np.max(_ends(own.values, box), axis=1)).max() <= slack for own in pairs]
            held = [own for own, closes in zip(pairs, always, strict=True) if closes]
            kept = [own for own, closes in zip(pairs, always, strict=True) if not closes]
            kept, held = (_nearest(kept, box), held) if kept else (held, [])
            closed = [placed_row(own.parts, n) for own in held for n in own.normals]
            bodies = movable, static
            more = {own.parts for own in kept if held and is_behind(own, closed, placed_row, bodies, T[:3, :3], box)}
            if not more:
                break
            behind |= more
        if least:
            kept, held = ([_binding(pair, box) for pair in own] for own in (kept, held))
        if np.any(shares):
            region = partial(region_between, movable, static, T)
            uniform = np.array(shares)
            kept, held = ([_on_lines(pair, region(pair.parts), uniform, size) for pair in own] for own in (kept, held))
        return cls(
            (movable, static), tuple(sizes), T, tuple(kept), min(reaches), ranges, tuple(held),
            behind=frozenset(behind if held else ()), carried=carried,
        )  # fmt: skip

    @property
    def box(self) -> Array:
        """Least and largest of each size, (k, 2)."""
        return np.vstack([np.array([size.tolerance for size in self.sizes], float).reshape(-1, 2), self.ranges])

    @cached_property
    def vanishing(self) -> tuple[float, str, dict[str, float]]:
        """By what factor the box may be widened until a face of a body vanishes, which, and the sizes where it does."""
        # parts are not made beyond (`resized`), whereas the rows go on: what a convex body has beside the face is told
        # by its other faces' planes
        found: list[tuple[float, str, dict[str, float]]] = [(np.inf, "", {})]
        for role, body in () if self.as_drawn else zip(("movable", "static"), self.bodies, strict=True):
            own = [k for k, size in enumerate(self.sizes) if size.body == role]
            moving = Resizing.of(body, [self.sizes[k] for k in own])
            low, high = np.minimum(self.box[own, 0], 0.0), np.maximum(self.box[own, 1], 0.0)
            factor, where = moving.valid_up_to(low, high)
            corner = np.zeros(len(own))
            if factor < np.inf and len(moving.parts) == 1 and len(body.parts[0].loops) <= MOST_TRIPLES:
                part = moving.parts[0].with_all_corners()
                kinds = [_slack_of_faces(part, room=room) for room in (False, True)]
                values, facets = (np.concatenate(rows) for rows in zip(*kinds, strict=True))
                swings = np.minimum(values[:, 1:] * low, values[:, 1:] * high).sum(axis=1)
                with np.errstate(divide="ignore"):
                    factors = np.where(swings < 0.0, -values[:, 0] / np.minimum(swings, 0.0), np.inf)
                first = int(factors.argmin())
                factor, where = float(factors[first]), moving.named(part, int(facets[first]))
                corner = np.where(values[first, 1:] > 0.0, low, np.where(values[first, 1:] < 0.0, high, 0.0))
            elif factor < 1.0:
                with suppress(InputError):  # of several parts some end there; the body may be cut anew
                    moving.check(low, high)
                    factor = np.inf
            found.append((factor, where, dict(zip([size.name for size in moving.sizes], corner.tolist(), strict=True))))
        return min(found, key=lambda own: own[0])

    @cached_property
    def stacked(self) -> tuple[Array, Ints]:
        """The rows of all pairs, (m, 1 + k), and where each pair's begin."""
        counts = np.array([len(pair.values) for pair in self.pairs])
        return np.vstack([pair.values for pair in self.pairs]), np.cumsum(counts) - counts

    def gap(self, p: Any) -> Array:
        """Return the gap at sizes p, (..., k): > 0 apart, < 0 overlapping; as `DecisionCurve.gap`, with its sign."""
        # the largest separation over the rows of a part pair, least over pairs
        return np.minimum.reduce(self.gaps(p), axis=-1)

    def gaps(self, p: Any) -> Array:
        """Return those of each part pair, (..., pairs)."""
        p = np.asarray(p, float)
        rows, starts = self.stacked
        heights = p.reshape(-1, rows.shape[1] - 1) @ rows[:, 1:].T + rows[:, 0]
        return np.maximum.reduceat(heights, starts, axis=1).reshape(*p.shape[:-1], len(starts))

    def governing(self, p: Any) -> tuple[PairRows, int]:
        """Return the pair and its row that the gap at sizes p is of."""
        heights = [pair.values[:, 0] + pair.values[:, 1:] @ np.asarray(p, float) for pair in self.pairs]
        pair = int(np.argmin([own.max() for own in heights]))
        return self.pairs[pair], int(heights[pair].argmax())

    def shifted(self, q: Array) -> TouchingSizes:
        """Return them with the movable body shifted by q, (s,), along its ways; other rows than the nearest go."""
        count, (rows, starts) = len(self.sizes), self.stacked
        values = rows[:, : 1 + count].copy()
        values[:, 0] += rows[:, 1 + count :] @ q
        lows, highs = _ends(values, self.box[:count])
        tops, ends = np.maximum.reduceat(lows, starts), np.append(starts, len(rows))
        pairs = list[PairRows]()
        for k in np.flatnonzero(tops <= np.maximum.reduceat(highs, starts).min()).tolist():
            own = slice(ends[k], ends[k + 1])
            pairs.append(self.pairs[k]._replace(values=values[own]).some(np.flatnonzero(highs[own] >= tops[k])))
        return replace(self, pairs=tuple(pairs), ranges=np.empty((0, 2)))

    def feature(self, own: PairRows, row: int) -> Feature:
        """Return the contact feature of a row, with the bodies' own labels; of a cut between parts with its corners."""
        # of a part's face that lies on several of the body's own it is the one that faces the other part
        if own.features:
            return own.features[row]
        one, two = (body.parts[k] for body, k in zip(self.bodies, own.parts, strict=True))
        # an edge or corner that is there at other sizes only: the corner that it comes from
        (kind, i), (other, j) = ((kind, k) if k >= 0 else ("V", -k - 1) for kind, k in own.elements[row])
        ends = one.vertices_of(kind, i), two.vertices_of(other, j)
        contact = Contact(Feature(one.elements[kind][i], two.elements[other][j]), *ends)
        pose, n = kernels.relative_pose(self.transform, *(body.seed for body in self.bodies)), own.normals[row]
        found = facing(one, two, pose, contact, np.ones(2), n, own.values[row, 0]).feature
        sides = zip(self.bodies, (found.one, found.two), (n @ self.transform[:3, :3], -n), strict=True)
        return Feature(*(body.face_looking(element, normal) for body, element, normal in sides))

    # ---------------------------------------------------------------------------------------------------- worst cases

    def least(self) -> tuple[float, Array]:
        """Return the least gap in the box, exact, and sizes at which it is: the largest interference."""
        value, place = min(self.leasts, key=lambda one: one[0])
        return value, self._plainest(place)

    @cached_property
    def leasts(self) -> tuple[tuple[float, Array], ...]:
        """The same of each part pair."""
        return tuple(least_of(pair.values, self.box) for pair in self.pairs)

    def of_each(self, *, least: bool) -> Array:
        """Return sizes with the least gap in the box, or the largest; those that it does not depend on as next pairs'.

        As far as they can, the pair whose least, or largest, gap is the least first: a part that two walls locate is
        off both of them. Of largest gaps no pair that is nearer comes nearer by that.
        """
        drawn, place = np.clip(0.0, *self.box.T), (self.least() if least else self.largest())[1]
        near, sign = DEFAULT.planarity * max(body.size for body in self.bodies), 1.0 if least else -1.0
        each = ([least_of(-row[None], self.box) for row in pair.values] for pair in self.pairs)
        largest = (min(rows, key=itemgetter(0)) for rows in each)
        ends, known = self.leasts if least else [(-value, at) for value, at in largest], list[int]()
        for k in np.argsort([value for value, _ in ends]).tolist():
            (value, own), before, other = ends[k], self.gaps(place), place.copy()
            limit = before[known] if least else -np.minimum(before, before[k])
            held = known if least else slice(None)
            free = np.flatnonzero((place == drawn) & (own != drawn)) if sign * (before[k] - value) > near else ()
            for size in free:
                kept, other[size] = other[size], own[size]
                if (sign * self.gaps(other)[held] > limit + near).any():
                    other[size] = kept
            for size in free:  # back, where the pair does not depend on it either
                moved, gap, other[size] = other[size], self.gaps(other)[k], place[size]
                if sign * (self.gaps(other)[k] - gap) > near:
                    other[size] = moved
            place = other if sign * (before[k] - self.gaps(other)[k]) > near else place
            known.append(k)
        return place

    def largest(self) -> tuple[float, Array]:
        """Return the largest gap in the box, exact, and sizes at which it is: the largest play."""
        # of several such sizes those with the largest gap of all that they move: beside a lid that lies close, as
        # always, a slide is loosest where it has most play to its sides. The gap is the least over pairs of the largest
        # of each pair's rows: branched over which row a pair takes, each node a linear program
        moved = tuple(pair for pair in self.pairs if pair.values[:, 1:].any())
        if 0 < len(moved) < len(self.pairs):
            where = replace(self, pairs=moved).largest()[1]
            return float(self.gap(where)), where
        box = self.box
        middle, half = _centred(box)
        tops = [_ends(pair.values, box)[1] for pair in self.pairs]
        bound = min(float(top.max()) for top in tops)
        lowest = min(range(len(tops)), key=lambda k: float(tops[k].max()))
        where = middle + half * np.sign(self.pairs[lowest].values[tops[lowest].argmax(), 1:])
        best = float(self.gap(where))  # in a corner: of one pair that is all, of several often
        near = DEFAULT.planarity * max(body.size for body in self.bodies)
        nodes: list[tuple[float, dict[int, int]]] = [(bound, {})]
        while nodes:
            nodes.sort(key=lambda node: node[0])
            height, taken = nodes.pop()
            if height <= best + near:
                break
            rows = np.array([self.pairs[k].values[row] for k, row in taken.items()]).reshape(-1, 1 + len(box))
            value, p = least_of(-rows, box) if len(rows) else (-bound, box.mean(axis=1))
            value = min(-value, bound)  # the largest that every row may have
            if value <= best:
                continue
            here = [float((pair.values[:, 0] + pair.values[:, 1:] @ p).max()) for pair in self.pairs]
            if min(here) > best:
                best, where = min(here), p
            worst = int(np.argmin(here))
            if here[worst] >= value or worst in taken:
                continue
            nodes += [
                (min(value, float(tops[worst][row])), {**taken, worst: row}) for row in range(len(tops[worst]))
                if tops[worst][row] > best
            ]  # fmt: skip
        for k, side in np.argwhere(np.abs(box - where[:, None]) <= DEFAULT.snap * np.ptp(box, axis=1)[:, None]):
            other = where.copy()
            other[k] = box[k, side]  # which linear programs miss by a little
            if (gap := float(self.gap(other))) >= best:
                best, where = gap, other
        return best, self._plainest(where)

    @property
    def permanent_features(self) -> list[Feature]:
        """What meets where contacts are closed at all sizes."""
        return [self.feature(pair, k) for pair in self.permanent for k in range(len(pair.values))]

    @cached_property
    def permanent_in_words(self) -> tuple[str, ...]:
        """The same in words."""
        return tuple(dict.fromkeys(feature.in_words(*self.bodies) for feature in self.permanent_features))

    def _plainest(self, place: Array) -> Array:
        """Return sizes with the same gap, as drawn or near to it where they do not matter, else at an end if may be."""
        drawn = np.clip(0.0, self.box[:, 0], self.box[:, 1])
        gap, near = self.gap(place), DEFAULT.planarity * max(body.size for body in self.bodies)
        for own in np.eye(len(place), dtype=bool)[place != drawn]:
            at_end = (self.box[own] == place[own]).any()
            others = (np.where(own, ends, place) for ends in (drawn, *(() if at_end else self.box.T)))
            place = next((other for other in others if abs(self.gap(other) - gap) <= near), place)
        return place + 0.0


def _centred(box: Array) -> tuple[Array, Array]:
    """Return the middle of a box and half its widths."""
    return box.mean(axis=1), np.ptp(box, axis=1) / 2.0


def check_sizes(sizes: Sequence[Size]) -> None:
    """Refuse none, and one without a tolerance."""
    if not sizes:
        raise InputError("there are no sizes", key="sizes", allowed="one [[size]] table or more, or sizes=[Size(...)]")
    for size in sizes:
        if size.tolerance is None:
            allowed = "tolerance = 0.05, or tolerance = [-0.02, 0.0]"
            raise InputError("a size without tolerance", key=f"size '{size.name}'.tolerance", allowed=allowed)


# -------------------------------------------------------------------------------------------------------------- a part


@dataclass(frozen=True, eq=False)
class _PosedPart:
    """A part at its pose: facets, corners and edges, and how they move by size; see `MovingPart`."""

    normals: Array
    triples: Ints
    cones: Array  # turn a direction into its shares of a corner's three normals
    points: Array
    moves: Array
    names: Ints
    bases: Ints  # a corner on each facet
    edges: Ints
    along: Array
    ends: Ints
    edge_names: Ints

    def supporting(self, corner: int, n: Array) -> tuple[str, int]:
        """Return the element at a corner that is farthest along a direction: its facet, its edge, or the vertex."""
        shares, facets = self.cones[corner] @ n, self.triples[corner]
        held = np.sort(facets[shares > DEFAULT.tie])
        if len(held) == 1:
            return "F", int(held[0])
        if len(held) == 2:
            rows = np.flatnonzero((np.sort(self.edges, axis=1) == held).all(axis=1))
            if rows.size:
                return "E", int(self.edge_names[rows[0]])
        return "V", int(self.names[corner])

    def shifted(self, directions: Array) -> _PosedPart:
        """Return the part with shifts along some ways, (s, 3), as sizes behind the others."""
        wide = np.broadcast_to(directions.T, (len(self.triples), 3, len(directions)))
        return replace(self, moves=np.concatenate([self.moves, wide], axis=2))

    @classmethod
    def of(cls, part: MovingPart, own: Sequence[int], carried: Array, R: Array, t: Array) -> _PosedPart:
        triples, vertices = part.triples, part.vertices
        normals = part.part.normals @ R.T
        facets = len(normals)
        wide = np.repeat(carried.T[None], len(triples), axis=0)
        wide[:, :, list(own)] += np.einsum("xy,tyk->txk", R, part.moves)
        bases = np.empty(facets, np.int64)
        bases[triples.ravel()] = np.repeat(np.arange(len(triples)), 3)
        # edges: of the part as drawn; where corners split or the shape changes any two facets of a corner
        if not part.split.any():
            drawn = part.part.edges
            pairs, names = drawn[:, 2:], np.arange(len(drawn))
            at = np.zeros(len(part.part.vertices), np.int64)
            at[vertices] = np.arange(len(vertices))
            ends = at[drawn[:, 0]]
            along = (part.part.vertices[drawn[:, 1]] - part.part.vertices[drawn[:, 0]]) @ R.T  # has the digits of n
        else:
            each = np.sort(triples[:, [[0, 1], [0, 2], [1, 2]]].reshape(-1, 2), axis=1)
            codes, first = np.unique(each @ [facets, 1], return_index=True)
            pairs = np.column_stack(np.divmod(codes, facets))
            ends = first // 3
            known = {tuple(sorted(row)): k for k, row in enumerate(part.part.edges[:, 2:].tolist())}
            along = np.cross(normals[pairs[:, 0]], normals[pairs[:, 1]])
            lost = vertices[ends].tolist()
            names = np.array([known.get(tuple(pair), -lost[k] - 1) for k, pair in enumerate(pairs.tolist())])
        return cls(
            normals, triples, np.asarray(np.linalg.inv(np.swapaxes(normals[triples], 1, 2))), part.points @ R.T + t,
            wide, vertices, bases, pairs, along, ends, names,
        )  # fmt: skip


def _slack_of_faces(part: MovingPart, *, room: bool = False) -> tuple[Array, Ints]:
    """Return rows that are all positive at sizes at which a convex part has all of its facets, (m, 1 + k), and facets.

    All points in which three of its planes meet are among its corners.

    By Farkas' lemma a facet's plane is cut off by three others where it lies beyond their corner, in the cone of their
    normals; with `room`, and nothing is left at all where it lies so and faces the other way.
    """
    normals, triples = part.part.normals, part.triples
    cones = np.linalg.inv(np.swapaxes(normals[triples], 1, 2))
    sign = -1.0 if room else 1.0
    facet, corner = np.nonzero(np.einsum("txy,fy->ftx", cones, sign * normals).min(axis=2) >= -DEFAULT.tie)
    kept = ~(triples[corner] == facet[:, None]).any(axis=1)
    facet, corner = facet[kept], corner[kept]
    n = normals[facet]
    heights = (n * (part.points[corner] - part.part.bases[facet])).sum(axis=1)
    rates = np.einsum("mx,mxk->mk", n, part.moves[corner]) - part.offsets[facet]
    return sign * np.column_stack([heights, rates]), facet


def _beyond(moving: Resizing, what: str, allowed: str) -> dict[str, Any]:
    """Return what an error says of tolerances that a body does not allow."""
    parted, line = moving.parted(), rounding_line((moving.body,))
    if parted:
        what, allowed = f"{what}: {parted}", f"{allowed}, or all of these faces in one size{line and f', or {line}'}"
    error = {"what": f"within these tolerances {what}", "key": "sizes.tolerance", "allowed": allowed}
    return {**error, "found": [size.tolerance for size in moving.sizes]}


def _is_lost(part: MovingPart, low: Array, high: Array) -> bool:
    """Tell whether nothing is left of a convex part at some sizes of a box."""
    base = part.part.bases - part.part.vertices.mean(axis=0)
    inward = np.minimum(part.offsets * low, part.offsets * high).sum(axis=1)
    if ((part.part.normals * base).sum(axis=1) + inward > 0.0).all():
        return False  # the middle stays
    values, _ = _slack_of_faces(part, room=True)
    least = values[:, 0] + np.minimum(values[:, 1:] * low, values[:, 1:] * high).sum(axis=1)
    return bool(least.min(initial=np.inf) <= 0.0)


# ------------------------------------------------------------------------------------------------------- rows of a pair


def _pair(
    parts: tuple[int, int], one: _PosedPart, two: _PosedPart, box: Array, size: float, along: Array | None
) -> PairRows:
    """Return the rows of a pair that no row elsewhere outdoes in the box, those along directions alone if any."""
    pacing.check()
    found = [_face_rows(one, two), _face_rows(two, one, swapped=True), _edge_rows(one, two)]
    if along is not None:
        ends = (one.points @ along.T).argmax(axis=0), (two.points @ along.T).argmin(axis=0)
        found.append((along, _heights(along, one, ends[0], two, ends[1]), *ends, np.full(len(along), 3)))
    normals, values, first, second, kinds = (np.concatenate(own) for own in zip(*found, strict=True))
    if not len(values):
        raise InputError("no feature of these parts can touch", key="sizes", found=parts)
    if along is not None:
        near = (normals @ along.T > 1.0 - DEFAULT.nominal).any(axis=1)
        normals, values, first, second, kinds = (own[near] for own in (normals, values, first, second, kinds))
    middle, half = _centred(box)
    lows, highs = _ends(values, box)
    kept = np.flatnonzero(highs >= lows.max() - DEFAULT.planarity * size)
    heights = values[kept, 0] + values[kept, 1:] @ middle
    kept = kept[np.lexsort((kinds[kept], -heights))]
    kept = kept[_undone(values[kept], middle, half, DEFAULT.planarity * size)]
    elements = []
    for k in kept.tolist():
        i, j = int(first[k]), int(second[k])
        if kinds[k] == 2:
            elements.append((("E", int(one.edge_names[i])), ("E", int(two.edge_names[j]))))
        else:
            mine = one.supporting(i, normals[k]) if kinds[k] else ("F", i)
            elements.append((mine, ("F", j) if kinds[k] == 1 else two.supporting(j, -normals[k])))
    return PairRows(parts, values[kept], normals[kept], elements)


def _near_enough(
    sides: Sequence[Sequence[_PosedPart]], box: Array, slack: float, without: Collection[tuple[int, int]]
) -> list[tuple[int, int]]:
    """Return the part pairs that may be the nearest within the box, by boxes about parts and distances of corners.

    Only pairs that are surely apart bound the least gap: others may be closed at all sizes, and not counted.
    """
    middle, half = _centred(box)
    each = [[(own.points + own.moves @ middle, np.abs(own.moves) @ half) for own in side] for side in sides]
    lows = [np.array([(x - room).min(axis=0) for x, room in side]) for side in each]
    highs = [np.array([(x + room).max(axis=0) for x, room in side]) for side in each]
    apart = np.maximum(lows[1] - highs[0][:, None], lows[0][:, None] - highs[1]).max(axis=2)
    apart[tuple(np.array([*without], np.int64).reshape(-1, 2).T)] = np.inf
    order, largest = np.argsort(apart, axis=None), float(np.finfo(float).max)
    order = order[(apart.ravel()[order] > slack) & (apart.ravel()[order] < np.inf)][:CLOSEST]
    for i, j in zip(*np.unravel_index(order, apart.shape), strict=True):
        (x, room), (y, other) = each[0][i], each[1][j]
        largest = min(largest, float((norms(x[:, None] - y) + norms(room)[:, None] + norms(other)).min()))
    return [*zip(*(rows.tolist() for rows in np.nonzero(apart <= largest)), strict=True)]


def _undone(values: Array, middle: Array, half: Array, near: float) -> Flags:
    """Tell which rows no row before them outdoes or repeats all over the box."""
    heights, scaled = values[:, 0] + values[:, 1:] @ middle, values[:, 1:] * half
    kept = np.ones(len(values), bool)
    for k in range(len(values)):
        if kept[k]:
            most = heights - heights[k] + np.abs(scaled - scaled[k]).sum(axis=1)
            outdone = most <= near
            outdone[: k + 1] = False
            kept &= ~outdone
    return kept


def _face_rows(one: _PosedPart, two: _PosedPart, swapped: bool = False) -> tuple[Any, ...]:
    """Return rows of the facets of one part, each with the corners of the other that its normal's cone holds."""
    facet, corner = np.nonzero(np.einsum("txy,fy->ftx", two.cones, -one.normals).min(axis=2) >= -DEFAULT.tie)
    n, kind = one.normals[facet], np.full(len(facet), int(swapped))
    rows = _heights(n, one, one.bases[facet], two, corner)
    return (-n, rows, corner, facet, kind) if swapped else (n, rows, facet, corner, kind)


def _heights(n: Array, one: _PosedPart, own: Ints, two: _PosedPart, other: Ints) -> Array:
    """Return how far corners of one part are from those of another along directions, and how that changes."""
    rates = np.einsum("mx,mxk->mk", n, two.moves[other]) - np.einsum("mx,mxk->mk", n, one.moves[own])
    return np.column_stack([(n * (two.points[other] - one.points[own])).sum(axis=1), rates])


def _edge_rows(one: _PosedPart, two: _PosedPart) -> tuple[Array, ...]:
    """Return rows of all pairs of edges whose cones of normals meet inside."""
    a, b = one.normals[one.edges[:, 0]], one.normals[one.edges[:, 1]]
    c, d = -two.normals[two.edges[:, 0]], -two.normals[two.edges[:, 1]]
    u, v = np.cross(a, b), np.cross(c, d)
    # the arcs ab and cd cross: either's ends lie on different sides of the other's plane, and they face each other
    sides = a @ v.T, b @ v.T, u @ c.T, u @ d.T
    near = DEFAULT.tie
    crossing = (sides[0] * sides[1] < -(near**2)) & (sides[2] * sides[3] < -(near**2)) & (sides[0] * sides[3] > 0.0)
    i, j = np.nonzero(crossing)
    n = np.cross(one.along[i], two.along[j])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    n *= np.sign((n * (a[i] + b[i])).sum(axis=1))[:, None]
    kept = ((n * (a[i] + b[i])).sum(axis=1) > 0.0) & ((n * (c[j] + d[j])).sum(axis=1) > 0.0)
    i, j, n = i[kept], j[kept], n[kept]
    rows = _heights(n, one, one.ends[i], two, two.ends[j])
    return n, rows, one.edge_names[i], two.edge_names[j], np.full(len(rows), 2)


def _on_lines(pair: PairRows, region: Region, shares: Array, size: float) -> PairRows:
    """Return the rows with the numbers of the decision curve's lines, where they have one: not rounded once more."""
    # `shares` of the uniform scale of either body that a unit of each size is, (2, k)
    values, scales = pair.values.copy(), np.flatnonzero(shares.any(axis=0))
    for piece in region.pieces:
        a, b, c = piece.line
        own = np.array([c - a - b, *-(shares.T @ piece.line[:2])])[np.append(0, 1 + scales)]
        off = np.abs(values[:, np.append(0, 1 + scales)] - own).max(axis=1) / size
        off = np.maximum(off, np.abs(pair.normals - piece.normal).max(axis=1))
        values[np.flatnonzero(off <= DEFAULT.planarity)[:, None], np.append(0, 1 + scales)] = own
    return pair._replace(values=values)


def _ends(values: Array, box: Array) -> tuple[Array, Array]:
    """Return the least and the largest that each row has in the box: their largest bound a pair's gap."""
    middle, half = _centred(box)
    heights, swings = values[:, 0] + values[:, 1:] @ middle, np.abs(values[:, 1:]) @ half
    return heights - swings, heights + swings


def _nearest(pairs: Sequence[PairRows], box: Array) -> list[PairRows]:
    """Return the pairs that can be the nearest somewhere in the box."""
    ends = [_ends(own.values, box) for own in pairs]
    most = min(highs.max() for _, highs in ends)
    return [pair for pair, (lows, _) in zip(pairs, ends, strict=True) if lows.max() <= most]


def is_behind(
    pair: PairRows, closed: Sequence[PlacedRow], along: Callable[..., PlacedRow], bodies: Sequence[Body], R: Array,
    box: Array,
) -> bool:  # fmt: skip
    """Tell whether a part pair is none that can meet first, of solids with contacts that are closed in a box of sizes.

    One on both sides of the plane of such a contact, in which solids only slide on each other. And one whose rows are
    all of cuts between parts: where these are nearest, other parts are nearer, of a contact that does not count.
    `along` returns the row of two parts along a direction; body 1 is turned by R.
    """
    slack = DEFAULT.tie * max(body.size for body in bodies)
    for own in closed:
        row = along(pair.parts, own.normal)
        if np.abs(_ends(np.array([row.gap, *(row.ends - own.ends)]), box)).max() <= slack:
            return True
    parts = bodies[0].parts[pair.parts[0]], bodies[1].parts[pair.parts[1]]
    turns = R, np.eye(3)

    def facing(k: int, n: Array) -> tuple[Array, Array]:
        """Return planes of the other part, moved onto part k along n, as far out as they are at any sizes."""
        normals, sign = parts[1 - k].normals @ turns[1 - k].T, (1.0, -1.0)[k]
        ends = np.array([[along(pair.parts, one * m).ends for m in normals] for one in (sign, -sign)])
        most = ends[1, :, 0] - ends[1, :, 1] - (normals @ n)[:, None] * along(pair.parts, sign * n).gap
        wide = ends[:, :, k].sum(axis=0) * sign
        wide[:, 0] -= np.ptp(parts[k].vertices @ turns[k].T @ normals.T, axis=0)  # made it is not as wide as drawn
        return normals @ turns[k], _ends(most, box)[1] + np.abs(_ends(wide, box)).max(axis=0)

    def is_bounded(k: int, n: Array) -> bool:
        return bodies[k].is_bounded_by(pair.parts[k], n @ turns[k], partial(facing, k, n))

    return not any(is_bounded(0, n) and is_bounded(1, -n) for n in _binding(pair, box).normals)


def _binding(pair: PairRows, box: Array) -> PairRows:
    """Return the rows that are the largest somewhere in the box: seen at some sizes, else by a game over sizes."""
    pacing.check()
    values, count = pair.values, len(box)
    if len(values) < 2:
        return pair
    middle, half = _centred(box)
    signs = np.sign(values[:, 1:])
    places = np.vstack([
        np.zeros((1, count)), signs, -signs, np.random.default_rng(1).uniform(-1.0, 1.0, (SAMPLES, count)),
    ])  # fmt: skip
    seen = np.zeros(len(values), bool)
    seen[((middle + places * half) @ values[:, 1:].T + values[:, 0]).argmax(axis=1)] = True
    for k in np.flatnonzero(~seen).tolist():
        seen[k] = least_of(values[np.delete(np.arange(len(values)), k)] - values[k], box, sign=True)[0] < 0.0
    return pair.some(np.flatnonzero(seen))


def least_of(rows: Array, box: Array, *, sign: bool = False) -> tuple[float, Array]:
    """Return the least over the box of the largest row, and sizes at which it is; a corner where one row decides."""
    # a game of a few rows and corners: to the mixture of rows the box answers with the corner that makes it least, to
    # the mixture of corners with the row that is largest there, until both are worth the same, which proves it. With
    # `sign` only so far as to tell which side of zero it is on
    middle, half = _centred(box)
    ends = np.where(rows[:, 1:] > 0.0, box[:, 0], np.where(rows[:, 1:] < 0.0, box[:, 1], middle))
    heights = rows[:, 0] + (ends * rows[:, 1:]).sum(axis=1)
    top = int(heights.argmax())  # no row goes lower than this; where no other is higher at its corner, that is all
    if (sign and heights[top] >= 0.0) or (rows[:, 0] + rows[:, 1:] @ ends[top] <= heights[top]).all():
        return float(heights[top]), ends[top]
    near = DEFAULT.planarity * float(
        np.abs(rows[:, 0] + rows[:, 1:] @ middle).max() + (np.abs(rows[:, 1:]) @ half).max()
    )
    held, corners = np.unique([top, int((rows[:, 0] + rows[:, 1:] @ ends[top]).argmax())]), ends[[top]]
    for _ in range(ANSWERS):
        own = rows[held]
        table = own[:, :1] + own[:, 1:] @ corners.T
        mixture, place = game(table) @ own, game(np.ascontiguousarray(-table.T)) @ corners
        answer = np.where(mixture[1:] > 0.0, box[:, 0], np.where(mixture[1:] < 0.0, box[:, 1], middle))
        lower = float(mixture[0] + mixture[1:] @ answer)
        reached = rows[:, 0] + rows[:, 1:] @ place
        highest = int(reached.argmax())
        upper = float(reached[highest])
        if upper - lower <= near or (sign and (upper < 0.0 or lower >= 0.0)):
            return upper, np.clip(place, box[:, 0], box[:, 1])
        known = highest in held
        if known and (corners == answer).all(axis=1).any():
            break
        held = held if known else np.append(held, highest)
        corners = np.vstack([corners, answer])
    return _program(rows, box)


def _program(rows: Array, box: Array) -> tuple[float, Array]:
    """Return the same by a linear program, which has fewer digits."""
    from scipy.optimize import linprog

    scale = max(float(np.abs(rows[:, 0]).max()), float(np.abs(box).max()), float(np.finfo(float).tiny))
    matrix = np.column_stack([rows[:, 1:], -np.ones(len(rows))])
    ends = [*(box / scale).tolist(), (None, None)]
    answer = linprog([*[0.0] * len(box), 1.0], matrix, -rows[:, 0] / scale, bounds=ends)
    if answer.status:
        return np.inf, box.mean(axis=1)
    return float(answer.x[-1] * scale), np.clip(answer.x[:-1] * scale, box[:, 0], box[:, 1])
