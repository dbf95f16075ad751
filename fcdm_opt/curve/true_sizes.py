"""The sizes at which two bodies touch on their true faces, where some of these are round.

The rows are those of bodies that are exact at points (`exact_points`) and elsewhere within the true ones. Where the
true faces, made anew at the sizes of the least and of the largest gap, are nearer than the rows say, bodies are made
exact there, until they are not: the exchange method, as for motions (`fcdm_opt.model.true_faces`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain, islice, product
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.touching_sizes import PairRows, TouchingSizes, check_sizes, least_of
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags, distinct_rows
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.exact_points import exact_at
from fcdm_opt.geometry.facet_errors import bounding_bodies, deviation_of, round_surfaces
from fcdm_opt.geometry.measures import norms
from fcdm_opt.geometry.moving_faces import MovesOfFaces
from fcdm_opt.geometry.patches import (
    DIGITS,
    NearestPoints,
    Patch,
    TrueFaces,
    line_of_contact,
    nearest_on_faces,
    true_faces,
)
from fcdm_opt.geometry.resizing import Resizing
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.tessellation import Swept, onto, onto_crossings
from fcdm_opt.tolerances import DEFAULT

ROUNDS = 12  # of making bodies exact where they are nearer than the rows say
SEVERAL = 8  # points at a time, and one of each two faces
AROUND = 128  # directions in a plane for which a pin in its bore has rows: to 3e-4 of how far they are apart
NARROW = 1e-4  # share of a length that a gap between two of these may be less by, where edges have them
CORNERS = 64  # of the box of sizes at which pins next to each other have a row of their own
ALL_AROUND, BETWEEN = 1024, 5e-3  # the same in space: they are less than .1 apart
KEPT = 64  # sizes whose faces are kept
APART = 0.05  # of the size: nearer points at the same sizes are one
ROLES = "movable", "static"


def touching_true_faces(
    movable: Body, static: Body, sizes: Sequence[Size], *, transform: Any = None, **how: Any
) -> TouchingSizes:
    """Return the sizes at which two bodies touch at a pose, see `TouchingSizes.of`: of true faces where known."""
    # bodies that are exact at points are taken for those that they stand for, and made exact anew
    one, two = (own if own.exact is None else own.exact.facets for own in (movable, static))
    at_all, every_row = TrueSizes.of(one, two, sizes, how.get("carried")), how.get("least", True)
    pose = np.eye(4) if transform is None else np.asarray(transform, float)
    others = list[Array]()  # those at which rows and true faces differ yet
    along = (how.get("shifts") or (np.empty((0, 3)),))[0]
    for turn in range(ROUNDS if at_all is not None else 0):
        assert at_all is not None
        apart, met = at_all.apart(), normals_met(at_all.bodies, pose)
        every = TouchingSizes.of(*at_all.bodies, sizes, transform=transform, without=apart, normals=met, **how)
        found = at_all.all_around(at_all.counted(every), pose, along)
        ends = [own[::-1] for own in (found.least(), found.largest())]
        if not turn:  # all that may be the nearest at some sizes
            ends.append((np.zeros(len(sizes)), ends[0][1] + 2.0 * at_all.largest_move))
        asked = [*((own, float(found.gap(own)) - at_all.between) for own in others), *ends]
        refined = at_all.refined(pose, asked)
        if not turn and every_row and (others := at_all.shifted(ends[0][0])):
            continue  # with rows all around round faces that touch there
        if not refined or turn == ROUNDS - 1:
            pairs, off = _without_hidden(found.pairs, found.box), max(at_all.between, refined * at_all.short)
            return replace(found, pairs=pairs, permanent_faces=frozenset(at_all.permanent), between=off)
        near = zip([place for place, _ in asked], at_all.deepest, strict=True)
        others = [place for place, own in near if own is not None and (every_row or turn)]
    return TouchingSizes.of(one, two, sizes, transform=transform, **how)


def _without_hidden(pairs: tuple[PairRows, ...], box: Array) -> tuple[PairRows, ...]:
    """Return pairs without those of one row that nowhere in the box is less than all others, as beside it on a bore."""
    kept = [*pairs]
    for own in pairs:
        others = [other.values[0] for other in kept if len(other.values) == 1 and other is not own]
        if len(own.values) == 1 and others:
            near = DEFAULT.nominal * float(np.abs(own.values).max())
            if least_of(own.values - np.array(others), box)[0] >= -near:
                kept = [other for other in kept if other is not own]
    return tuple(kept)


def widened(touching: TouchingSizes, sizes: Sequence[Size], *, least: bool = True) -> TouchingSizes:
    """Return the same with other tolerances, without contacts that are closed at all of them."""
    if touching.as_drawn:
        return replace(touching, sizes=tuple(sizes))
    one, two = touching.bodies
    how = {"carried": touching.carried, "least": least, "permanent": False}
    return touching_true_faces(one, two, sizes, transform=touching.transform, **how)


def made_at(
    movable: Body, static: Body, sizes: Sequence[Size], made: Any, touching: TouchingSizes | None = None
) -> dict[str, float]:
    """Return the deviations that are meant by name: all of them, or those at a named corner.

    `made` are deviations by name, 0 where none is given; or the corner of the box of tolerances with the least gap,
    "worst", or the largest one, "loosest", at rest (of what is not closed at all sizes, if there is any), all sizes at
    their least, "low", largest, "high", or in the "middle". Sizes that the gap does not depend on are those with the
    least, or largest, gap of the next contact, and so on; of bodies with round faces of one that may be the nearest.
    `touching` is what is known of them at rest, with these sizes.
    """
    if isinstance(made, Mapping):
        return {size.name: float(made.get(size.name, 0.0)) for size in sizes}
    check_sizes(sizes)
    box = np.array([size.tolerance for size in sizes], float)
    if made in ("low", "high", "middle"):
        values = box @ {"low": [1.0, 0.0], "high": [0.0, 1.0], "middle": [0.5, 0.5]}[made]
    else:
        values = np.clip(0.0, *box.T)
        for _, at in extremes(movable, static, sizes, touching, least=made == "worst"):
            values = np.where(np.isnan(at), values, at)
    return dict(zip([size.name for size in sizes], values.tolist(), strict=True))


def extremes(
    movable: Body, static: Body, sizes: Sequence[Size], touching: TouchingSizes | None = None, *, least: bool
) -> list[tuple[float, Array]]:
    """Return the least gap at rest, or the largest, and the deviations of sizes that it depends on, nan of others.

    Then the same of each next contact that depends on sizes on which no nearer one does. `touching` as in `made_at`.
    """
    bodies, found, nearer = (movable, static), list[tuple[float, Array]](), list[TouchingSizes]()
    values, one = np.clip(0.0, *np.array([size.tolerance for size in sizes], float).T), np.eye(len(sizes), dtype=bool)
    near, free = DEFAULT.planarity * max(body.size for body in bodies), np.ones(len(sizes), bool)
    known, every = set[tuple[int, int]](), {*np.ndindex(len(movable.parts), len(static.parts))}
    how: dict[str, Any] = {"least": False, "permanent": False}
    touching = touching_true_faces(*bodies, sizes, **how) if touching is None else touching
    while not known.issuperset(own.parts for own in touching.pairs):
        place = touching.of_each(least=least)
        ends = np.where(one, touching.box.T[:, None], place)  # (2, k, k): each size at its ends
        matter = free & (np.abs(touching.gaps(ends) - touching.gaps(place)) > near).any(axis=(0, 2))
        for own in one[matter]:
            other = np.where(own, place, values)
            if all(np.abs(each.gaps(other) - each.gaps(values)).max() <= near for each in nearer):
                values = other
        found.append((float(touching.gap(place)), np.where(matter, values, np.nan)))
        nearer, free = [*nearer, touching], free & ~matter
        known |= {*(own.parts for own in touching.pairs), *touching.behind, *_unmoved(bodies, sizes, free)}
        if any(map(round_surfaces, bodies)) or known >= every:  # rows of round faces are found for the nearest
            break
        asked = [
            size if own else replace(size, tolerance=(x, x))
            for size, own, x in zip(sizes, free.tolist(), values.tolist(), strict=True)
        ]
        touching = TouchingSizes.of(*bodies, asked, without=known, **how)
    return found


def _unmoved(bodies: tuple[Body, Body], sizes: Sequence[Size], free: Flags) -> list[tuple[int, int]]:
    """Return the part pairs that none of these sizes moves."""
    still = list[list[int]]()
    for role, body in zip(ROLES, bodies, strict=True):
        own = [size for size, one in zip(sizes, free.tolist(), strict=True) if one and size.body == role]
        moved = [bool(part.moves.any()) for part in Resizing.of(body, own).parts] if own else [False] * len(body.parts)
        still.append([k for k, moves in enumerate(moved) if not moves])
    return [*product(still[0], still[1])]


class TrueContact(NamedTuple):
    """Points of the true faces that come nearest, where both are at some sizes, and the faces that meet there."""

    gap: float
    points: Array
    normal: Array
    patches: tuple[tuple[int, ...], tuple[int, ...]]

    @property
    def pairs(self) -> frozenset[tuple[int, int]]:
        """Each two of the faces."""
        return frozenset(product(*self.patches))

    @classmethod
    def each(
        cls, found: Sequence[NearestPoints], faces: Sequence[TrueFaces], scales: Sequence[float] | Array, pose: Array
    ) -> list[TrueContact]:
        """Return those of points that come nearest; where they do along a straight line of the middle of it."""
        points = np.array([own.points for own in found]).reshape(-1, 2, 3)

        def patches(rows: Sequence[int]) -> list[tuple[tuple[int, ...], ...]]:
            both = zip(faces, points[rows].swapaxes(0, 1), strict=True)
            met = (own.at_each(x, DIGITS * own.body.rounding) for own, x in both)
            return [tuple(map(tuple, own)) for own in zip(*met, strict=True)]

        at = patches(range(len(found)))
        straight = [k for k, own in enumerate(at) if _may_be_straight(found[k], own, faces, pose)]
        for k in straight:
            points[k] = ends_of_line(found[k], faces, scales, pose).mean(axis=0)
        for k, own in zip(straight, patches(straight), strict=True):
            at[k] = own
        return [
            cls(near.gap, x, near.normal, (one, two)) for near, x, (one, two) in zip(found, points, at, strict=True)
        ]


def _may_be_straight(
    near: NearestPoints, met: Sequence[Sequence[int]], faces: Sequence[TrueFaces], pose: Array
) -> bool:
    """Tell whether two faces that meet at a contact face each other along its normal, and are not both plane."""
    one, two = (
        [own.patches[k].surface.flat for k in numbers if own.patches[k].gaps(x[None])[1][0] @ n > 1.0 - DEFAULT.nominal]
        for own, x, numbers, n in zip(faces, near.points, met, (near.normal @ pose[:3, :3], -near.normal), strict=True)
    )
    return bool(one and two) and not (all(one) and all(two))


def ends_of_line(
    near: NearestPoints | TrueContact, faces: Sequence[TrueFaces], scales: Sequence[float] | Array, pose: Array
) -> Array:
    """Return the points of both bodies, as drawn, at the ends of the line along which they come nearest, (n, 2, 3)."""
    # those given where there is no such line
    seed, moved = faces[0].body.seed, pose.copy()
    moved[:3, 3] += near.gap * near.normal
    point = moved[:3, :3] @ (seed + scales[0] * (near.points[0] - seed)) + moved[:3, 3]
    line = line_of_contact(faces, scales, moved, point)
    if line is None:
        return near.points[None]
    along = (line - point)[:, None]
    return near.points + np.concatenate([along @ pose[:3, :3] / scales[0], along / scales[1]], axis=1)


def _off_edges(contacts: Sequence[TrueContact], slack: float) -> list[TrueContact]:
    """Return contacts without those at edges of faces that are as near off these: at a concave edge none is told."""
    found = list[TrueContact]()
    for own in contacts:
        if not any(other.pairs < own.pairs and other.gap <= own.gap + slack for other in contacts):
            found.append(own)
    return found


def _of_each_faces(contacts: Sequence[TrueContact]) -> list[TrueContact]:
    """Return the nearest contact of each two faces: at edges only where faces meet nowhere else."""
    found, known = list[TrueContact](), set[tuple[int, int]]()
    for own in sorted(contacts, key=lambda own: sum(map(len, own.patches))):
        if not own.pairs & known:
            found.append(own)
        known |= own.pairs
    return found


def contacts_as_drawn(movable: Body, static: Body, scales: Array, slack: float) -> list[TrueContact]:
    """Return where two bodies touch as drawn on their true faces, a round one among them, at their scales, (2,)."""
    # to within `slack`; each contact once: of a line of contact the middle. None of bodies without round faces, and not
    # where plane faces lie on each other, whose rims may be round
    return [*_as_drawn(movable, static, *map(float, scales), slack)]


@lru_cache(maxsize=16)  # each question about two bodies asks for them
def _as_drawn(movable: Body, static: Body, scale: float, its_scale: float, slack: float) -> list[TrueContact]:
    found, scales = list[TrueContact](), (scale, its_scale)
    if not any(map(round_surfaces, (movable, static))):
        return found
    faces = true_faces(movable), true_faces(static)
    band = slack + sum(scale * sum(deviation_of(own.body)) for scale, own in zip(scales, faces, strict=True))
    for near in nearest_on_faces(faces, scales, np.eye(4), band):
        if near.gap > slack:
            break
        contact = TrueContact.each([near], faces, scales, np.eye(4))[0]
        alike = (
            other.pairs == contact.pairs and other.normal @ contact.normal > 1.0 - DEFAULT.nominal for other in found
        )
        if abs(near.gap) <= slack and contact.pairs and not any(alike) and not _flush(contact, faces):
            found.append(contact)
    return _off_edges(found, slack)


def _flush(contact: TrueContact, faces: Sequence[TrueFaces]) -> bool:
    """Tell whether plane faces lie on each other at a contact of bodies as drawn."""
    one, two = (
        [patch.gaps(point[None])[1][0] for patch in (own.patches[k] for k in met) if patch.surface.flat]
        for own, met, point in zip(faces, contact.patches, contact.points, strict=True)
    )
    return any(n @ other < DEFAULT.nominal - 1.0 for n, other in product(one, two))


def normals_met(bodies: tuple[Body, Body], pose: Array) -> dict[tuple[int, int], Array]:
    """Return the normals of round faces, (k, 3), of each two pieces at points of these: other rows are aslant."""
    found = dict[tuple[int, int], Array]()
    pieces = [() if body.exact is None else body.exact.pieces for body in bodies]
    first, second = (len(body.parts) - len(own) for body, own in zip(bodies, pieces, strict=True))
    sides = [own.normals @ pose[:3, :3].T for own in pieces[0]], [-own.normals for own in pieces[1]]
    for (i, one), (j, two) in product(*map(enumerate, sides)):
        if normals := [own for own in (one, two) if len(own) == 1]:
            found[first + i, second + j] = np.concatenate(normals)
    return found


class TrueSizes:
    """Two bodies with round faces that follow sizes, exact at a list of points that grows.

    `facets` are the bodies as drawn, movable and static, `bodies` the same, exact at the points; `carried`, (k, 3), is
    how each size moves the movable body besides.

    `permanent` are the patches, by number in `true_faces`, that meet whatever the sizes are, as a flange on its plate:
    not counted. With `of_rest` only those that do so at rest are, whatever pose is looked at; else those of any pose;
    none that a motion opens, by the `rates` of poses with its parameters at rest, (k, 4, 4).
    `asked` are the sizes last asked of `refined` with the gaps claimed, `deepest` of each the gap of the true faces and
    its direction, where it is less; `between`, how much that may be between two directions of `all_around`.
    """

    def __init__(self, movable: Body, static: Body, sizes: Sequence[Size], carried: Array | None = None) -> None:
        self.facets, self.sizes = (movable, static), tuple(sizes)
        self.size = max(movable.size, static.size)
        self.carried = np.zeros((len(sizes), 3)) if carried is None else carried
        self.points = [np.empty((0, 3)), np.empty((0, 3))]
        self.faces = [SizedFaces.of(body, role, self.sizes) for body, role in zip(self.facets, ROLES, strict=True)]
        self.permanent, self.of_rest, self.rates = set[tuple[int, int]](), False, np.zeros((0, 4, 4))
        self.between = 0.0
        self.deepest = list[tuple[float, Array] | None]()
        self.asked = list[tuple[Array, float]]()
        self.bodies = self._exact()

    @classmethod
    def of(cls, movable: Body, static: Body, sizes: Sequence[Size], carried: Array | None = None) -> TrueSizes | None:
        """Return it; None where no face is known to be round, for bodies that cannot be exact, and for other sizes."""
        bodies = movable, static
        if not any(map(round_surfaces, bodies)) or any(own.is_surface for own in bodies):
            return None
        if any(bounding_bodies(own) is None for own in bodies) or any(own.scale not in (None, "xyz") for own in sizes):
            return None
        try:
            return cls(movable, static, sizes, carried)
        except InputError:
            return None

    @property
    def short(self) -> float:
        """By how much gaps of true faces were less than claimed at most, of the sizes last asked about."""
        both = zip(self.asked, self.deepest, strict=True)
        return max((gap - own[0] for (_, gap), own in both if own is not None), default=0.0)

    @property
    def largest_move(self) -> float:
        """By how much sizes change a gap at most, within their tolerances."""
        carried = norms(self.carried) @ [max(map(abs, own.tolerance or (0.0, 0.0))) for own in self.sizes]
        return float(carried) + sum(own.largest_move(self.sizes) for own in self.faces)

    def shifted(self, place: Array) -> list[Array]:
        """Return sizes as at a place but for those that move round faces, (k,) each: these touch where they go to."""
        # those that shift them at their other end, and each at both; those that offset them where that is outwards
        box = np.array([own.tolerance for own in self.sizes], float)
        carrying = np.flatnonzero(norms(self.carried) > DEFAULT.nominal).tolist()
        columns = list(dict.fromkeys([*(k for own in self.faces for k in own.shifts), *carrying]))
        found = np.tile(place, (2 + 2 * len(columns), 1))
        found[0, columns] = box[columns].sum(axis=1) - place[columns]
        for row, (k, end) in enumerate(product(columns, (0, 1)), 2):
            found[row, k] = box[k, end]
        for k, outwards in (each for own in self.faces for each in own.offsets.items()):
            found[1, k] = box[k, int(outwards)]
        return [own for own in np.unique(found, axis=0) if (own != place).any()]

    def _exact(self) -> tuple[Body, Body]:
        one, two = (exact_at(body, own) for body, own in zip(self.facets, self.points, strict=True))
        assert one is not None
        assert two is not None
        return one, two

    def apart(self) -> list[tuple[int, int]]:
        """Return part pairs that are not looked at: of pieces that meet others."""
        meeting = {*chain.from_iterable(self._meeting_pieces())}
        firsts = [len(body.parts) - len(points) for body, points in zip(self.bodies, self._piece_points, strict=True)]
        return [
            (i, j) for i, j in np.ndindex(*(len(body.parts) for body in self.bodies))
            if (i >= firsts[0] or j >= firsts[1])
            and (i if i >= firsts[0] else None, j if j >= firsts[1] else None) not in meeting
        ]  # fmt: skip

    def _meeting_pieces(self) -> list[list[tuple[int | None, ...]]]:
        """Return each two parts that are pieces and meet at each of the points; None where there is no room for one."""
        pieces, near = list[list[list[int | None]]](), DEFAULT.tie * self.size
        for body, points, at in zip(self.bodies, self.points, self._piece_points, strict=True):
            first = len(body.parts) - len(at)
            numbers = [[first + k for k, x in enumerate(at) if norms(x - point) <= near] for point in points]
            pieces.append([[*found] or [None] for found in numbers])
        return [list(product(*each)) for each in zip(*pieces, strict=True)]

    def replaced(self, pose: Array, place: Array, gap: float, pairs: Sequence[tuple[int, int]]) -> bool:
        """Replace points of these part pairs where true faces have a larger gap at sizes; tell whether any were."""
        # along normals that have turned since, as where a ball has moved on a rim: those nearest now are taken
        slack = DEFAULT.tie * self.size
        kept = [{*pairs}.isdisjoint(own) for own in self._meeting_pieces()]
        if all(kept) or self.nearest(pose, place, gap + slack):
            return False
        self.points = [own[kept] for own in self.points]
        return self.refined(pose, [(place, gap + self.largest_move)])

    def counted(self, found: TouchingSizes) -> TouchingSizes:
        """Return rows without those of facets that are within round faces, if there are others."""
        self.permanent |= self.faces_of(found.permanent_features)
        return replace(found, pairs=tuple(own for own in found.pairs if not self._within_round(own)) or found.pairs)

    def faces_of(self, features: Iterable[Feature]) -> frozenset[tuple[int, int]]:
        """Return the patches of both bodies, by number in `true_faces`, that meet where contacts are."""
        found = set[tuple[int, int]]()
        for own in features:
            found |= {*product(self._patches(0, own.one), self._patches(1, own.two))}
        return frozenset(found)

    def _patches(self, role: int, element: Element) -> set[int]:
        body = self.facets[role]
        return {true_faces(body).patch_of(body.face_rows[face]) for face in body.faces_with(element.vertices)}

    def all_around(self, found: TouchingSizes, pose: Array, along: Array) -> TouchingSizes:
        """Return rows with those of all directions in which a pin may be nearest to its bore, or a ball to its socket.

        Where sizes turn the normal by little, of a straight edge too, as of a pin without a radius, and of pins next
        to each other, whose gap is the largest over directions, and no longer the least of those at points.

        Of such that sizes, or shifts along directions (s, 3), move about in a plane or in space: their gap is the least
        over directions of rows, of which `AROUND` stand for all of a plane, to within 1 - cos(pi / AROUND) of how far
        centres are apart. Where they move along a line there is nothing to add.
        """
        firsts = [len(body.parts) - len(own) for body, own in zip(self.bodies, self._piece_points, strict=True)]
        meeting = list(zip(self._meeting_pieces(), zip(*self.points, strict=True), strict=True))
        added, known = list[PairRows](), dict[tuple[tuple[int, ...], ...], bool]()
        meet = list[tuple[tuple[int, int], tuple[list[int], ...]]]()
        for own in found.pairs if all(size.scale is None for size in self.sizes) else ():
            pieces = tuple(k if k >= first else None for k, first in zip(own.parts, firsts, strict=True))
            points = next((both for each, both in meeting if pieces in each), None)
            if points is None or pieces == (None, None):
                continue
            feature = found.feature(own, 0)
            sides = [*zip((0, 1), points, pieces, (feature.one, feature.two), strict=True)]
            meet.append((own.parts, tuple(self._met(*side) for side in sides)))
            for met in product(*(self._swept(*side) for side in sides)):
                names, both = zip(*met, strict=True)
                if names not in known:
                    rows, convex = self._around(met, points, pose, along), not any(own.concave for own in both)
                    known[names] = convex and bool(rows)
                    for few in [rows] if known[names] else [[own] for own in rows]:
                        values, normals = map(np.array, zip(*few, strict=True))
                        added.append(PairRows((0, 0), values, normals, [], [feature] * len(few)))
        whole = [names for names, convex in known.items() if convex]  # edges with the faces that meet there
        replaced = {parts for parts, own in meet for names in whole if all(map(_of_one, names, own))}
        last = [len(body.parts) for body in self.bodies]  # each by itself, as of pieces that are not made
        numbered = (own._replace(parts=(last[0] + k, last[1] + k)) for k, own in enumerate(added))
        return replace(found, pairs=(*(own for own in found.pairs if own.parts not in replaced), *numbered))

    @property
    def _piece_points(self) -> list[list[Array]]:
        """The points as drawn at which each body has a piece."""
        return [
            [] if body.exact is None else [body.vertices[piece.first - 1] for piece in body.exact.pieces]
            for body in self.bodies
        ]

    def _met(self, role: int, point: Array, piece: int | None, element: Element) -> list[int]:
        """Return the patches that meet at a point as drawn; where it is beyond them those of the contact there."""
        return self.faces[role].faces.at(point) or [*(self._patches(role, element) if piece is None else ())]

    def _swept(
        self, role: int, point: Array, piece: int | None, element: Element
    ) -> list[tuple[tuple[int, ...], Patch]]:
        """Return round faces at a point; of two plane ones their edge as one without a radius. By their patches."""
        faces = self.faces[role].faces
        met = faces.at(point)
        if piece is not None:
            return [((k,), faces.patches[k]) for k in met if faces.is_round[k]]
        named = self._patches(role, element)  # of one of the faces where the edge is at the end of its normals
        if len(met) != 2 or faces.is_round[met].any() or not ({*met} <= named or named <= {*met}):
            return []
        axis = np.cross(faces.patches[met[0]].surface.axis, faces.patches[met[1]].surface.axis)
        return [((*met,), Patch(Swept(point, axis / norms(axis), (1.0, 0.0), 0.0, 0.0), 1.0))]

    def _around(
        self, met: Sequence[tuple[tuple[int, ...], Patch]], points: Sequence[Array], pose: Array, along: Array
    ) -> list[tuple[Array, Array]]:
        """Return rows of a pin in its bore, or a ball in its socket, and all directions in which sizes move them."""
        names, (one, two) = zip(*met, strict=True)
        shape = one.surface.line, one.surface.ring
        turned = any(np.abs(each.moves.turns).max(initial=0.0) for each in self.faces)
        if turned or (one.concave and two.concave) or (two.surface.line, two.surface.ring) != shape:
            return []
        if shape not in (((1.0, 0.0), 0.0), (None, 0.0)):
            return []
        turns, near = (pose[:3, :3], np.eye(3)), DEFAULT.tie * self.size
        frame, sides = np.eye(3), (-1.0 if one.concave else 1.0, 1.0 if two.concave else -1.0)
        if shape[0] is not None:
            frame = np.linalg.svd(two.surface.axis[None])[2][1:]
            if np.abs(frame @ turns[0] @ one.surface.axis).max() * self.size > near:
                return []

        def feet(n: Array) -> list[Array]:
            """Return the point of each face, as drawn, that looks along a direction."""
            found = list[Array]()
            for patch, x, turn, side in zip((one, two), points, turns, sides, strict=True):
                origin, axis = patch.surface.origin, patch.surface.axis
                up = 0.0 if shape[0] is None else (x - origin) @ axis
                found.append(origin + up * axis + side * patch.surface.radius * (n @ turn))
            return found

        def row(n: Array) -> Array:
            """Return the gap in a direction from body 1 to body 2, and how it changes with each size and way."""
            rates, places = -self.carried @ n, feet(n)
            for own, patches, x, turn, sign in zip(self.faces, names, places, turns, (-1.0, 1.0), strict=True):
                rates[own.columns] += sign * (n @ turn) @ own.move_at(x, patches)
            gap = n @ (places[1] - (turns[0] @ places[0] + pose[:3, 3]))
            return np.concatenate([[gap], rates, -along @ n])

        ends = np.array([[row(n), row(-n)] for n in frame])
        middle, odd = ends[0].mean(axis=0), (ends[:, 0] - ends[:, 1]) / 2.0
        widths = [max(map(abs, size.tolerance or (0.0, 0.0))) for size in self.sizes]
        moved = odd * np.concatenate([[1.0], widths, np.full(len(along), self.size)])
        convex = not (one.concave or two.concave)
        (directions, share), added = _directions(-moved if convex else moved, near), list[tuple[Array, Array]]()
        if (convex or 2 in map(len, names)) and share > NARROW:  # far off the axis
            return []
        if convex:  # exact where gaps are least and largest, and at the ends of an edge's normals
            sizes = zip(self.sizes, odd.T[1:], strict=False)
            corners = product(*(own.tolerance or (0.0,) if rate.any() else (0.0,) for own, rate in sizes))
            places = np.array([*islice(corners, CORNERS)])
            centres = odd[:, 0] + places @ odd.T[1 : 1 + len(widths)]
            directions = np.vstack([directions, centres / np.linalg.norm(centres, axis=1)[:, None]])
            for own, patches, turn, sign in zip(self.faces, names, turns, (1.0, -1.0), strict=True):
                of_edge = [own.faces.patches[k] for k in patches if len(patches) == 2]
                looks = [frame @ turn @ (sign * x.side * x.surface.axis) for x in of_edge]
                directions = np.vstack([directions, *looks])
        self.between = max(self.between, share * float(np.linalg.norm(moved, axis=0).sum()))
        for shares in directions:
            n = shares @ frame
            each = zip(self.faces, names, feet(n), (n @ turns[0], -n), strict=True)
            if all(own.faces.look_along(patches, x, outward) for own, patches, x, outward in each):
                added.append((middle + shares @ odd, n))
        return added

    def _within_round(self, own: PairRows) -> bool:
        """Tell whether a row of a part pair is of a facet that is within a round face, or beside one."""
        for role, (body, drawn, place) in enumerate(zip(self.bodies, self.facets, own.parts, strict=True)):
            pieces = 0 if body.exact is None else len(body.exact.pieces)
            if place >= len(body.parts) - pieces:
                continue
            flat = {*range(len(drawn.faces))} - {row for _, rows in round_surfaces(drawn) for row in rows}
            part, facets = body.parts[place], body.facet_faces[place]
            bent = [bool(facet) and not flat.issuperset(facet) for facet in facets]
            for elements in own.elements:
                kind, k = elements[role]
                if kind == "V" and (norms(self.points[role] - part.vertices[k]) <= DEFAULT.tie * self.size).any():
                    continue  # a corner where the bodies are exact
                if kind == "F":
                    corners = part.loops[k]
                else:
                    corners = (k if k >= 0 else -k - 1,) if kind == "V" else part.edges[k, :2].tolist()
                around = [k] if kind == "F" else [f for f, loop in enumerate(part.loops) if {*corners} <= {*loop}]
                if any(bent[f] for f in around):
                    return True
        return False

    def refined(self, pose: Array, claimed: Sequence[tuple[Array, float]]) -> bool:
        """Make the bodies exact where they are nearer than is claimed of sizes, (k,); tell whether any were."""
        slack, near, new = DEFAULT.planarity * self.size, DEFAULT.tie * self.size, list[tuple[Array, ...]]()
        self.asked, self.deepest = list(claimed), []
        for place, gap in claimed:
            found = self.nearest(pose, place, gap)
            self.deepest.append((found[0].gap, found[0].normal) if found else None)
            nearest, first = _off_edges([own for own in found if own.gap < gap - slack], slack), len(new)
            for own in (*nearest[:SEVERAL], *_of_each_faces(nearest)):
                sides = zip(self.faces, own.points, own.patches, strict=True)
                both = tuple(body.drawn(point, patches, place) for body, point, patches in sides)
                if any(norms(np.subtract(both, other)).max() <= near for other in new[:first]):
                    continue
                if all(norms(both[0] - other[0]) > APART * self.size for other in new[first:]):
                    new.append(both)
        if not new:
            return False
        known = list(zip(*self.points, strict=True))
        fresh = [all(norms(np.subtract(both, pair)).max() > near for pair in known) for both in new]
        self.points = [np.vstack([own, *each]) for own, each in zip(self.points, zip(*new, strict=True), strict=True)]
        self.bodies = self._exact()
        return any(fresh)  # a point known with another one meets this one, too

    def nearest(self, pose: Array, place: Array, gap: float) -> list[TrueContact]:
        """Return contacts of true faces at sizes, the nearest first, without those that stand."""
        made, scales = zip(*(own.at(place) for own in self.faces), strict=True)
        pose = np.vstack([pose[:3] + np.column_stack([np.zeros((3, 3)), place @ self.carried]), pose[3:]])
        below = 2.0 * self.largest_move  # by how much the gap there may be less than at other sizes
        band = abs(gap) + below + sum(sum(deviation_of(own)) for own in self.facets) + DEFAULT.snap * self.size
        found, at_rest = list[TrueContact](), not self.of_rest or bool((pose == np.eye(4)).all())
        near = [own for own in nearest_on_faces(made, scales, pose, band) if own.gap < gap]
        for contact in TrueContact.each(near, made, scales, pose):
            known = contact.pairs <= self.permanent
            if not contact.pairs or (known and not self.of_rest):  # of no face that is known, or left out
                continue
            stands = (known or at_rest) and self._stands(made, contact, pose, place)
            if stands and at_rest:
                self.permanent |= self._facing(made, contact, pose)
            elif not (stands and known):
                found.append(contact)
        return found

    def _facing(self, made: Sequence[TrueFaces], own: TrueContact, pose: Array) -> frozenset[tuple[int, int]]:
        """Return each two faces there of which one is square to it, or else aslant: of rims not bore and pin."""
        normals = own.normal @ pose[:3, :3], -own.normal
        square, along = (
            [
                [k for k in patches if faces.patches[k].gaps(x[None])[1][0] @ n > least]
                for faces, patches, x, n in zip(made, own.patches, own.points, normals, strict=True)
            ]
            for least in (1.0 - DEFAULT.nominal, DEFAULT.sharp)
        )
        facing = frozenset((i, j) for i, j in own.pairs if i in square[0] or j in square[1])
        return facing or frozenset((i, j) for i, j in own.pairs if i in along[0] or j in along[1])  # none along a bore

    def _stands(self, made: Sequence[TrueFaces], own: TrueContact, pose: Array, place: Array) -> bool:
        """Tell whether a contact is closed at all sizes within their tolerances, and stays so in a motion."""
        opening = own.normal @ (self.rates[:, :3] @ np.append(own.points[0], 1.0)).T
        if np.abs(opening).max(initial=0.0) > DEFAULT.nominal:
            return False
        rates = -self.carried @ own.normal
        for role, side in ((0, -1.0), (1, 1.0)):
            normal = own.normal @ (pose[:3, :3] if role == 0 else np.eye(3))
            point = own.points[role]
            move = self.faces[role].moves.at(point, *_meeting(made[role], own.patches[role], point))
            rates[self.faces[role].columns] += side * normal @ move
        box = np.array([size.tolerance for size in self.sizes], float)
        start = own.gap - float(rates @ place)
        ends = np.sort(rates[:, None] * box, axis=1).sum(axis=0)
        return bool(np.abs(start + ends).max() <= DEFAULT.tie * self.size)


def _of_one(names: tuple[int, ...], met: list[int]) -> bool:
    """Tell whether a contact is of a round face among those met, or of an edge or a face of it."""
    return bool(met) and ({*met} <= {*names} if len(names) > 1 else names[0] in met)


def _meeting(faces: TrueFaces, patches: Sequence[int], point: Array) -> tuple[list[int], Array]:
    """Return rows of the body's faces that stand for patches at a point, and the normals of these there, (k, 3)."""
    normals = [faces.patches[k].gaps(point[None])[1][0] for k in patches]
    return faces.first_rows[[*patches]].tolist(), np.array(normals).reshape(-1, 3)  # all rows of a face move alike


def _directions(moved: Array, near: float) -> tuple[Array, float]:
    """Return directions, (m, k), that stand for all in the plane or the space that columns of (k, n) span; else none.

    And by what share of a length its largest component along one of them may be less.
    """
    spread = np.linalg.svd(moved)
    plane = spread[0][:, spread[1] > near].T
    if len(plane) < 2:
        return np.empty((0, len(moved))), 0.0
    if len(plane) == 2:
        (x, y), off = plane @ moved[:, 0], float(np.linalg.norm(moved[:, 1:], axis=0).sum())
        half, step = np.arcsin(min(off / max(np.hypot(x, y), near), 1.0)), np.pi / AROUND
        angles = 2.0 * step * np.arange(AROUND)
        if half < np.pi / 4.0:  # nowhere else does it come nearest
            step = half / (AROUND // 4)
            angles = np.arctan2(-y, -x) + step * np.arange(-AROUND // 4, AROUND // 4 + 1, 2)
        return np.column_stack([np.cos(angles), np.sin(angles)]) @ plane, 1.0 - float(np.cos(step))
    heights = (np.arange(ALL_AROUND) + 0.5) / (0.5 * ALL_AROUND) - 1.0  # a spiral with turns of the golden angle
    angles, radii = np.pi * (3.0 - 5.0**0.5) * np.arange(ALL_AROUND), np.sqrt(1.0 - heights**2)
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles), heights]), BETWEEN


class SizedFaces:
    """How the true faces of a body, `faces` as drawn, follow its sizes.

    `columns` are which of all sizes they follow, `shifts` which of these shift round ones; `offsets` are the sizes that
    offset round ones, and whether that is outwards as they grow.
    """

    def __init__(self, body: Body, sizes: Sequence[Size], columns: list[int]) -> None:
        self.faces, self.columns, self._made = true_faces(body), columns, dict[bytes, tuple[TrueFaces, float]]()
        self.moves = MovesOfFaces.of(body, [sizes[k] for k in columns])
        self._uniform = np.array([float(sizes[k].scale == "xyz") for k in columns])
        first, self._places = distinct_rows(self.faces.corners.reshape(-1, 3))
        points, owners = self.faces.corners.reshape(-1, 3)[first], np.repeat(self.faces.owners, 3)
        self._points = points
        self._lengths = lengths = self.moves._replace(turns=0.0 * self.moves.turns)
        meeting = [np.unique(owners[self._places == k]).tolist() for k in range(len(points))]
        met = [(x, *_meeting(self.faces, own, x)) for x, own in zip(points, meeting, strict=True)]
        self._middles = [self.faces.corners[self.faces.owners == k].mean(axis=(0, 1)) for k in range(owners.max() + 1)]
        # corners and edges of round faces leave these with the square of the sizes
        self._bent = [row for row, own in enumerate(meeting) if len(own) > 1 and self.faces.is_round[own].any()]
        self._meeting = [meeting[row] for row in self._bent]
        shifting = [np.abs(own).max(initial=0.0) for own in (*np.moveaxis(self.moves.shifts, 2, 0), *self.moves.turns)]
        own = np.reshape(shifting, (2, -1)).max(axis=0, initial=0.0) if self.faces.is_round.any() else ()
        self.shifts = [k for k, shift in zip(columns, own, strict=False) if shift > DEFAULT.nominal]
        rows = self.faces.rows[self.faces.is_round[self.faces.owners]]
        outwards = self.moves.lengths[rows].sum(axis=0) if len(rows) else ()
        self.offsets = {k: rate > 0.0 for k, rate in zip(columns, outwards, strict=False) if rate}
        self._moves, self._all = (np.array([own.at(*each) for each in met]) for own in (lengths, self.moves))

    @classmethod
    def of(cls, body: Body, role: str, sizes: Sequence[Size]) -> SizedFaces:
        """Return it of the sizes that are the body's."""
        return cls(body, sizes, [k for k, own in enumerate(sizes) if own.body == role])

    def move_at(self, point: Array, patches: Sequence[int]) -> Array:
        """Return how a point of faces as drawn, (3,), moves a unit of each of their sizes, (3, k)."""
        return self.moves.at(point, *_meeting(self.faces, patches, point))

    def largest_move(self, sizes: Sequence[Size]) -> float:
        """Return how far sizes move any point of the faces at most."""
        most = np.array([max(map(abs, sizes[k].tolerance or (0.0, 0.0))) for k in self.columns])
        return float((norms(np.moveaxis(self._all, 1, -1)).max(axis=0) @ most) if len(most) else 0.0)

    def at(self, place: Array) -> tuple[TrueFaces, float]:
        """Return the faces at all sizes, (k,), before they are scaled about the seed, and that uniform scale."""
        if (key := np.asarray(place, float).tobytes()) not in self._made:
            self._made = {**dict([*self._made.items()][-KEPT:]), key: self._at(place)}
        return self._made[key]

    def drawn(self, point: Array, patches: Sequence[int], place: Array) -> Array:
        """Return the point as drawn that one of the faces at sizes is of: with the same normals."""
        made, scale = self.at(place)
        rates = self._lengths.at(point, *_meeting(made, patches, point))
        before = point - rates @ np.asarray(place, float)[self.columns] / scale
        return onto(before[None], [self.faces.patches[k].surface for k in patches])[0]

    def _at(self, place: Array) -> tuple[TrueFaces, float]:
        values = np.asarray(place, float)[self.columns]
        scale = 1.0 + float(self._uniform @ values)
        moves = self.moves.lengths, self.moves.shifts, self.moves.rings
        lengths, shifts, rings = (own @ values / scale for own in moves)
        patches = list[Patch]()
        for k, own in enumerate(self.faces.patches):
            row = int(self.faces.first_rows[k])
            if self.faces.is_round[k]:
                surface = own.surface.offset(own.side * float(lengths[row]), shifts[row], float(rings[row]))
            else:
                surface = own.surface._replace(origin=own.surface.origin + lengths[row] * own.surface.axis)
            patches.append(own._replace(surface=surface))
        corners, rows = self._points + self._moves @ values / scale, self._bent
        both = [own.surface for own in self.faces.patches], [own.surface for own in patches]
        met = self._points[rows], corners[rows], self._meeting
        there, off = onto_crossings(*met, both, self._middles, self.faces.slack)
        corners[rows] = np.where(off[:, None] <= DEFAULT.snap * self.faces.body.size, there, corners[rows])
        return self.faces.moved(patches, corners[self._places].reshape(-1, 3, 3)), scale
