"""Which sizes of all parts of an assembly open a gap: loops of contacts, by their linear rows.

Where motions only shift, gaps of contacts are affine in the sizes p and the motions q. Parts rest on each other: all
contacts but the one that is asked about stay closed, c + S p + D q = 0, by the least motions q(p) with which they do.
Contacts that oppose each other, as all around a shaft as wide as its bore, are a fit, which sizes open or close all
around, c + S p + D q = u: its play u(p), the same of all its rows, no motion closes, and parts are in its middle.

Where motions turn, D is the derivative, and gaps are of first order in the sizes: of two faces along each other each
corner of what they have in common has a row. How far that is off is looked at in corners of the tolerances, parts moved
until the contacts are closed there, and is said.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import islice, product
from typing import Any

import numpy as np

from fcdm_opt.curve.touching_sizes import ChangedShapeError, PairRows, TouchingSizes, check_sizes
from fcdm_opt.curve.true_sizes import touching_true_faces
from fcdm_opt.design.contact_gaps import AffineGaps, ContactGaps, by_contacts, range_of, relations_of
from fcdm_opt.design.sizes import Sizes, tolerance_boxes
from fcdm_opt.design.stack.two_faces import TwoFaces
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facet_errors import round_surfaces
from fcdm_opt.geometry.polygons import inside
from fcdm_opt.geometry.size import Size
from fcdm_opt.judge.sampled_sizes import GapClaims
from fcdm_opt.problem import arguments
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

ClosedAt = Callable[[tuple[float, ...]], Array]
"""Motions with which contacts are closed at sizes."""
CORNERS, NEWTON, TURN = 64, 6, 1e-3
"""Corners of the sizes that are looked at, steps until contacts are closed there, and that of derivatives, radians."""
FIT = "fit: "  # before the name of a contact whose gap is the play of a fit


@dataclass(frozen=True, eq=False)
class Loop:
    """The rows of a gap in all sizes, and what is told of the pair that it is of and of contacts that stay closed.

    `pair` is without what is told of the gap; `of_facets` are the bodies with rows that are not of true faces.
    `weighted` are the motions, by name, that contacts which stay closed leave free together, and that the gap depends
    on: the least ones are taken, by their weights.
    """

    touching: TouchingSizes
    pair: GapClaims
    of_facets: tuple[Body, ...]
    closed: tuple[GapClaims, ...] = ()
    weighted: tuple[str, ...] = ()
    sizes: tuple[Size, ...] = ()  # of an assembly, by its parts
    parts: tuple[str, str] = ("", "")  # of an assembly, the two by name
    is_restored: bool = False  # whether motions close the gap, whatever it is at rest
    fits: tuple[GapClaims, ...] = ()  # those of `closed` whose gap is the play of a fit
    second_order: float = 0.0  # how far gaps are off, at most, where parts turn

    def claims(self, least: tuple[float, Array], largest: tuple[float, Array], told: Any) -> GapClaims:
        """Return what `verify` looks at."""
        return replace(self.pair, least=least, largest=largest, told=told, further=self.closed)


def of_all_faces(problem: Problem, sizes: Sequence[Size], contacts: Callable[[], Any] | None, **how: Any) -> Any:
    """Return the rows of the gap of two bodies, of walls as of contacts; else, where these are not known, `contacts`.

    They are not known of bodies kept as surfaces, of sizes that turn faces, and where other corners meet at some sizes.
    """
    check_sizes(sizes)
    if contacts is not None and by_contacts(problem, named=False):
        return contacts()
    movable, static = problem.at_scales.values()
    try:
        return touching_true_faces(movable, static, sizes, permanent=False, **how)
    except ChangedShapeError:
        with suppress(InputError):
            if contacts is not None:
                return contacts()
        raise


def pair_loop(problem: Problem, pose: Array) -> Loop:
    """Return the rows of the contacts of two bodies as drawn, at a pose of the movable one."""
    gaps = ContactGaps(problem, Sizes(tolerance_boxes(problem.sizes)), [size.name for size in problem.sizes], own=True)
    touching, claims = gaps.touching(gaps.rows([pose]), pose), gaps.claims([pose])
    if len(claims) == 1:
        return Loop(touching, claims[0], gaps.of_facets)
    every = None if claims[0].permanent_faces is None else frozenset[tuple[int, int]]()
    return Loop(touching, replace(claims[0], contact=None, permanent_faces=every), gaps.of_facets, tuple(claims))


def assembly_loop(assembly: Assembly | Problem, of: Any = None) -> Loop:
    """Return the rows of the gap of two parts in all sizes, and what is told of the contacts that stay closed.

    The assembly has sizes, each with a tolerance; its parts count at the scales made. The gap is that of the two parts
    that `of` names, by default those of the only contact of goal "clear", or without one those of the only contact that
    sizes open, and of all their faces; of contacts as drawn alone where `stack_up` looks at these. Raises `InputError`
    where contacts cannot all be closed within the tolerances, and for parts that are none.
    """
    faces = None if of is None else TwoFaces.of(assembly, of)
    check_sizes(assembly.sizes)
    names, box = [size.name for size in assembly.sizes], tolerance_boxes(assembly.sizes)
    gaps = ContactGaps(assembly, Sizes(box), names, own=True, needed=faces is None)
    rest, step = np.zeros(len(assembly.coordinates)), 1.0 if assembly.shifts else TURN  # of shifts all are exact
    base = gaps.rows(gaps.transforms(rest))
    slopes = _derivative(lambda q: gaps.rows(gaps.transforms(q)).values[:, 0], rest, step)
    fits, relations = _fits(gaps, base.normals), relations_of(assembly)
    weights = np.array([own.weight for own in assembly.coordinates])
    asked = [pair for pair in relations if relations[pair] in gaps.relations]

    def opened(chosen: int, times: Array | float = 1.0) -> tuple[Array, Array]:
        """Return the motions that close all other contacts, and the rows of one relation, by all sizes.

        The least ones by the motions' weights, or by so many times these.
        """
        own = np.array([line.relation == chosen for line in gaps.lines], bool)
        motions = _closed(gaps, times * weights, np.flatnonzero(~own), base, slopes, fits)[0]
        return motions, base.values[own] + slopes[own] @ motions

    if faces is not None:
        pair = faces.pair
        if not assembly.shifts:
            what = "parts turn, and two faces by name have a gap along their normal"
            raise InputError(what, key="of", found=of, allowed="motions that only shift, or two parts")
    elif of is None:
        assert isinstance(assembly, Assembly)
        meant, why = list(assembly.kept_clear), 'of these goal "clear" asks for one'
        if not meant:
            moved = (k for k in range(len(asked)) if np.abs(opened(k)[1][:, 1:]).max(initial=0.0) > DEFAULT.tie)
            meant, why = [asked[k] for k in moved] or asked, "sizes open"
        if len(meant) != 1:
            opening = ", ".join(map(" - ".join, meant))
            what = f"which gap is meant is to be said, while all other contacts stay closed; {why}: {opening}"
            known = " or ".join(map(" - ".join, relations))
            raise InputError(what, key="of", allowed=f"two parts of {known}, as --of {','.join(meant[0])}")
        pair = meant[0]
    else:
        named = [own for own in relations if sorted(own) == sorted(map(str, arguments.items(of)))]
        if not named:
            allowed = " or ".join(" - ".join(own) for own in relations)
            what = "not two parts of this assembly that move against each other"
            raise InputError(what, key="of", found=of, allowed=allowed)
        pair = named[0]
    chosen = asked.index(pair) if pair in asked and faces is None else -1
    rows = np.array([k for k, line in enumerate(gaps.lines) if line.relation != chosen], np.int64)
    motions, closing, met = _closed(gaps, weights, rows, base, slopes, fits)
    relation, drawn = relations[pair], AffineGaps(base.values + slopes @ motions, base.normals)

    @lru_cache(maxsize=256)
    def closed_at(sizes: tuple[float, ...]) -> Array:
        """Return the motions with which contacts are closed at sizes, those of first order where parts only shift."""
        q, place = motions[:, 0] + motions[:, 1:] @ sizes, np.array([sizes])
        for _ in range(0 if assembly.shifts else NEWTON):
            q = q + (closing @ gaps.rows(gaps.transforms(q)).heights(place)[rows, 0])[: len(q)] / weights
        return q

    claim, second = _claim(gaps, relation, motions, assembly.sizes, closed_at), 0.0
    contacts = partial(gaps.touching, drawn, claim.transform, chosen) if chosen >= 0 else None
    if assembly.shifts:
        directions = relation.motion.shift_vectors(relation.movable.seed, relation.static.seed)
        how = {"transform": claim.transform, "carried": motions[:, 1:].T @ directions}
        if faces is None:
            found = of_all_faces(relation, claim.sizes, contacts, **how)
        else:
            found = faces.touching(relation, sizes=claim.sizes, **how)
            claim = replace(claim, faces=(int(faces.rows[0][0]), int(faces.rows[1][0])))
        rates = np.vstack([own.normals for own in found.pairs]) @ directions.T
    elif contacts is not None:
        found, own = contacts(), np.flatnonzero([line.relation == chosen for line in gaps.lines])
        rates = slopes[own]
        for place in _corners(gaps.sizes.box):
            there = gaps.rows(gaps.transforms(closed_at(tuple(place.tolist()))))
            second = max(second, float(np.abs((there.heights(place[None]) - drawn.heights(place[None]))[own]).max()))
    else:
        found, rates, second = _turned(relation, claim, motions, closed_at)
    second += _bent(gaps, motions) if not assembly.shifts else 0.0
    claim = replace(claim, second_order=second)
    touching, of_facets = replace(found, sizes=claim.sizes), gaps.of_facets
    if not touching.as_drawn:
        is_exact = any(body.exact is not None for body in touching.bodies)
        of_facets += () if is_exact else touching.bodies
        claim = replace(claim, permanent_faces=touching.permanent_faces if is_exact else None, within=touching.between,
                        permanent=[own.parts for own in touching.permanent])  # fmt: skip
    each = (own for k in range(len(asked)) if k != chosen
            for own in _claims(gaps, k, met @ drawn.values, motions, assembly.sizes, closed_at))  # fmt: skip
    still = [replace(own, second_order=second) for own in each]
    times = np.arange(1.0, slopes.shape[1] + 1.0)  # any weights but the ones asked for
    off = opened(chosen, times)[0] - motions
    gap_off = np.abs(rates @ off).max(axis=0)
    free = (np.abs(off) > DEFAULT.nominal * np.abs(motions).max(axis=0))[:, gap_off > DEFAULT.nominal].any(axis=1)
    weighted = tuple(own.name for own, is_free in zip(assembly.coordinates, free.tolist(), strict=True) if is_free)
    parts = ("", "") if isinstance(assembly, Problem) else pair
    return Loop(touching, claim, of_facets, tuple(still), weighted, assembly.sizes, parts,
                chosen >= 0, tuple(own for own in still if own.least != own.largest), second)  # fmt: skip


def _derivative(of: Callable[[Array], Array], at: Array, step: float) -> Array:
    """Return how an array changes a unit of each of some motions, (..., q), by differences of the fourth order."""
    each = ((of(at + h) - of(at - h), of(at + 2.0 * h) - of(at - 2.0 * h)) for h in step * np.eye(len(at)))
    return np.stack([(8.0 * near - far) / (12.0 * step) for near, far in each], axis=-1)


def _corners(box: Array) -> Iterator[Array]:
    """Yield corners of a box of sizes, `CORNERS` at most."""
    yield from map(np.array, islice(product(*box.tolist()), CORNERS))


def _bent(gaps: ContactGaps, motions: Array) -> float:
    """Return how far contacts of round faces are off at corners of the sizes: they are closed at points as drawn."""
    radii = (abs(own.radius) + abs(own.ring) for task in gaps.tasks for body in (task.movable, task.static)
             for own, _ in round_surfaces(body))  # fmt: skip
    turns = _derivative(lambda q: np.array(gaps.transforms(q))[:, :3, :3], motions[:, 0], TURN)
    angles = (
        np.linalg.norm(turns @ motions[:, 1:] @ place, 2, axis=(1, 2)).max() for place in _corners(gaps.sizes.box)
    )
    return float(max(angles, default=0.0) ** 2 * max(radii, default=0.0))


def _turned(
    relation: Problem, claim: GapClaims, motions: Array, closed_at: ClosedAt
) -> tuple[TouchingSizes, Array, float]:
    """Return rows at rest with what motions change to first order, the rates by these, (m, q), and what they are off.

    That is the most at corners of the sizes: of where points are, of how far they slip along a face that turns, and of
    the gap that is along its normal.
    """
    start, drawn, movable = motions[:, 0], np.linalg.inv(claim.transform), claim.bodies[0]
    pairs, points, rates = list[PairRows](), list[Array](), list[Array]()

    def pose(q: Array) -> Array:
        return relation.motion.transform(q, relation.movable.seed, relation.static.seed)

    moves = np.einsum("xyq,yz->qxz", _derivative(pose, start, TURN), drawn)
    corners = np.pad(movable.vertices, ((0, 0), (0, 1)), constant_values=1.0) @ claim.transform.T
    widest = motions[:, 1:] * np.abs(claim.box).max(axis=1)
    far = np.linalg.norm(np.einsum("qk,qxy,cy->kcx", widest, moves[:, :3], corners), axis=2).sum(axis=0).max()
    shifts = np.eye(3), np.tile([-far, far], (3, 1))  # with rows of all that parts turned may come near to
    found = of_all_faces(relation, claim.sizes, None, transform=claim.transform, shifts=shifts)
    found = replace(found, ranges=np.empty((0, 2)))
    for own in found.pairs:
        each = []
        for row, (values, n) in enumerate(zip(own.values[:, :-3], own.normals, strict=True)):
            met = _met(found, own, row, DEFAULT.tie * movable.size)
            rates.append(-np.einsum("x,qxy,cy->cq", n, moves[:, :3], met))
            points.append(np.hstack([met, np.tile([*n, values[0]], (len(met), 1))]))
            turned = rates[-1] @ motions[:, 1:]
            each.append(values + np.pad(np.where(np.abs(turned) > DEFAULT.tie, turned, 0.0), ((0, 0), (1, 0))))
        features = [found.feature(own, row) for row in range(len(each))]
        kept = np.arange(len(each))
        if np.prod([float(len(rows)) for rows in each]) > CORNERS:  # no gap is less than that of one row
            kept = kept[[own.values[:, 0].argmax()]]
        for rows in product(*(each[row] for row in kept)):
            one, two = (len(body.parts) + len(pairs) for body in found.bodies)  # each by itself
            normals, met_there = own.normals[kept], [features[row] for row in kept]
            pairs.append(PairRows((one, two), np.array(rows), normals, [], met_there))
    second, every = 0.0, np.vstack(points)
    for place in _corners(found.box):
        linear = np.tensordot(motions[:, 1:] @ place, moves, 1)[:3]
        exact = (pose(closed_at(tuple(place.tolist()))) @ drawn - np.eye(4))[:3]
        angle, moved, n = np.linalg.norm(linear[:, :3], 2), every[:, :4] @ linear.T, every[:, 4:7]
        off = np.abs(((every[:, :4] @ exact.T - moved) * n).sum(axis=1))
        slip = np.linalg.norm(np.cross(moved, n), axis=1)
        second = max(second, float((off + angle * slip + angle**2 / 2.0 * np.abs(every[:, 7])).max()))
    return replace(found, pairs=tuple(pairs), as_drawn=True), np.vstack(rates), second


def _met(found: TouchingSizes, own: PairRows, row: int, near: float) -> Array:
    """Return corners of what two parts have in common seen along a row's normal, homogeneous, (c, 4)."""
    n, sides, feature = own.normals[row], list[Array](), found.feature(own, row)
    frame = np.linalg.svd(n[None])[2][1:]
    poses = zip(found.bodies, own.parts, (feature.one, feature.two), (found.transform, np.eye(4)), (n, -n), strict=True)
    for body, part, element, at, out in poses:
        known = part < len(body.parts)
        points = body.parts[part].vertices if known else body.vertices[np.array(element.vertices) - 1]
        points = points @ at[:3, :3].T + at[:3, 3]
        points = points[points @ out >= (points @ out).max() - near]
        across = (points - points.mean(axis=0)) @ frame.T
        sides.append(points[np.argsort(np.arctan2(across[:, 1], across[:, 0]))])
    sides.sort(key=len)
    few, many = sides
    normal = n * np.sign(n @ np.cross(*frame))  # about which corners are in order
    common = inside(few, many, normal, near) if len(many) > 2 else few
    return np.pad(common if len(common) else few.mean(axis=0)[None], ((0, 0), (0, 1)), constant_values=1.0)


def _claim(
    gaps: ContactGaps, relation: Problem, motions: Array, sizes: Sequence[Size], closed_at: ClosedAt
) -> GapClaims:
    """Return what is told of two parts, moved as sizes do, but for their gap."""
    seeds, mine = (relation.movable.seed, relation.static.seed), {size.name: size for size in relation.sizes}
    every = tuple(mine.get(own.name) or replace(own, body="another part") for own in sizes)
    claim = gaps.claim(relation, [*range(len(sizes))], relation.motion.transform(motions[:, 0], *seeds))

    def moved(place: Array) -> Array:
        return relation.motion.transform(closed_at(tuple(np.asarray(place, float).tolist())), *seeds)

    return replace(claim, sizes=every, moved=moved)


def _claims(
    gaps: ContactGaps, chosen: int, drawn: Array, motions: Array, sizes: Sequence[Size], closed_at: ClosedAt
) -> Iterator[GapClaims]:
    """Yield what is told of each contact of a relation that stays closed, or has the play of its fit."""
    still, claim = (0.0, gaps.sizes.middle), _claim(gaps, gaps.relations[chosen], motions, sizes, closed_at)
    near = DEFAULT.touch * gaps.size
    for own in gaps.claims(gaps.transforms(motions[:, 0])):
        if own.bodies == claim.bodies and own.contact is not None:
            rows = gaps.contacts[chosen, own.contact[0]]
            play = AffineGaps(drawn[rows], np.empty((len(rows), 3)))
            ends = range_of(play, gaps.sizes.box, None)
            least, largest = (still, still) if max(abs(gap) for gap, _ in ends) <= near else ends
            name = f"{'closed: ' if least is largest else FIT}{own.name}"
            yield replace(claim, contact=own.contact, permanent_faces=own.permanent_faces, name=name, least=least,
                          largest=largest, told=play.gaps)  # fmt: skip


def _fits(gaps: ContactGaps, normals: Array) -> Array:
    """Return which rows are of which fit, 0 or 1, (m, f).

    Rows of two parts that oppose each other, a mixture of their normals being zero: of those the smallest sets that no
    mixture has a part in two of, as the two walls of a slot, or all directions around a bore.
    """
    from scipy.optimize import nnls
    from scipy.sparse.csgraph import connected_components

    found, relations = [np.empty((len(normals), 0))], np.array([line.relation for line in gaps.lines])
    for k in range(len(gaps.relations)):
        own = np.flatnonzero(relations == k)
        own = own[[nnls(normals[own].T, -n)[1] <= DEFAULT.snap for n in normals[own]]]
        shared = normals[own] @ np.linalg.pinv(normals[own])  # which parts into blocks as the sets do
        count, of = connected_components(np.abs(shared) > DEFAULT.snap, directed=False) if len(own) else (0, own)
        found.append(np.zeros((len(normals), count)))
        found[-1][own, of] = 1.0
    return np.hstack(found)


def _closed(
    gaps: ContactGaps, weights: Array, rows: Ints, base: AffineGaps, slopes: Array, fits: Array
) -> tuple[Array, Array, Array]:
    """Return the least motions that close rows, but for the play of fits, (q, 1 + k): at sizes of 0, and by each.

    And what makes weighted motions, and plays, of the rows' gaps, (q + f, m); and of all rows those that are closed.
    """
    met, why = gaps.met_along(base, slopes, fits)
    values, slopes, fits = (met @ base.values)[rows], (met @ slopes)[rows], fits[rows]
    closing = -np.linalg.pinv(np.hstack([slopes / weights, -fits]), rcond=DEFAULT.nominal)
    unknown = closing @ values
    motions = unknown[: len(weights)] / weights[:, None]
    off = np.abs(values + slopes @ motions - fits @ unknown[len(weights) :])
    open_ = off[:, 0] + off[:, 1:] @ np.abs(gaps.sizes.box).max(axis=1)
    if open_.max(initial=0.0) > DEFAULT.touch * gaps.size:
        lines = [gaps.lines[k] for k in rows[open_ > DEFAULT.touch * gaps.size].tolist()]
        texts = (gaps.words(*own[:2]) + (f" ({why[own[:2]]})" if own[:2] in why else "") for own in lines)
        named = "; ".join(dict.fromkeys(texts))
        what = f"the other contacts cannot all be closed at once within these tolerances: {named}"
        allowed = "two parts whose contacts close this loop; where parts turn, feet with round or pointed ends"
        raise InputError(what, key="of", found=float(open_.max()), allowed=allowed)
    return motions, closing, met
