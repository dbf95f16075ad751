"""Which sizes of all parts of an assembly open a gap: loops of contacts, by their linear rows.

Where motions only shift, gaps of contacts are affine in the sizes p and the motions q. Parts rest on each other: all
contacts but the one that is asked about stay closed, c + S p + D q = 0, by the least motions q(p) with which they do.
Contacts that oppose each other, as all around a shaft as wide as its bore, are a fit, which sizes open or close all
around, c + S p + D q = u: its play u(p), the same of all its rows, no motion closes, and parts are in its middle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from fcdm_opt.curve.touching_sizes import ChangedShapeError, TouchingSizes, check_sizes
from fcdm_opt.curve.true_sizes import touching_true_faces
from fcdm_opt.design.contact_gaps import AffineGaps, ContactGaps, by_contacts, range_of, relations_of
from fcdm_opt.design.sizes import Sizes, tolerance_boxes
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.size import Size
from fcdm_opt.judge.sampled_sizes import GapClaims
from fcdm_opt.problem import arguments
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

FIT = "fit: "  # before the name of a contact whose gap is the play of a fit


@dataclass(frozen=True, eq=False)
class Loop:
    """The rows of a gap in all sizes, and what is told of the pair that it is of and of contacts that stay closed.

    `pair` is without what is told of the gap; `exact` tells whether all rows are of true faces, whatever facets stand
    for them. `weighted` are the motions, by name, that contacts which stay closed leave free together, and that the gap
    depends on: the least ones are taken, by their weights.
    """

    touching: TouchingSizes
    pair: GapClaims
    exact: bool
    closed: tuple[GapClaims, ...] = ()
    weighted: tuple[str, ...] = ()
    sizes: tuple[Size, ...] = ()  # of an assembly, by its parts
    parts: tuple[str, str] = ("", "")  # of an assembly, the two by name
    is_restored: bool = False  # whether motions close the gap, whatever it is at rest
    fits: tuple[GapClaims, ...] = ()  # those of `closed` whose gap is the play of a fit

    def claims(self, least: tuple[float, Array], largest: tuple[float, Array], told: Any) -> GapClaims:
        """Return what `verify` looks at."""
        return replace(self.pair, least=least, largest=largest, told=told, beside=self.closed)


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
        return Loop(touching, claims[0], gaps.exact)
    every = None if claims[0].permanent_faces is None else frozenset[tuple[int, int]]()
    return Loop(touching, replace(claims[0], contact=None, permanent_faces=every), gaps.exact, tuple(claims))


def assembly_loop(assembly: Assembly, of: Any = None) -> Loop:
    """Return the rows of the gap of two parts in all sizes, and what is told of the contacts that stay closed.

    The assembly has sizes, each with a tolerance; its parts count at the scales made. The gap is that of the two parts
    that `of` names, by default those of the only contact of goal "clear", or without one those of the only contact that
    sizes open, and of all their faces; of contacts as drawn alone where `stack_up` looks at these. Raises `InputError`
    where motions turn, where contacts cannot all be closed within the tolerances, and for parts that are none.
    """
    gaps, base, slopes = _rows_of_motions(assembly)
    fits, relations = _fits(gaps, base.normals), relations_of(assembly)
    weights = np.array([own.weight for own in assembly.coordinates])
    asked = [pair for pair in relations if relations[pair] in gaps.relations]

    def opened(chosen: int, times: Array | float = 1.0) -> tuple[Array, Array]:
        """Return the motions that close all other contacts, and the rows of one relation, by all sizes.

        The least ones by the motions' weights, or by so many times these.
        """
        own = np.array([line.relation == chosen for line in gaps.lines], bool)
        motions = _closed(gaps, times * weights, np.flatnonzero(~own), base, slopes, fits)
        return motions, base.values[own] + slopes[own] @ motions

    if of is None:
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
            raise InputError("not two parts of this assembly that move", key="of", found=of, allowed=allowed)
        pair = named[0]
    chosen = asked.index(pair) if pair in asked else -1
    motions = opened(chosen)[0]
    relation = relations[pair]
    claim = _claim(gaps, relation, motions, assembly.sizes)
    drawn = AffineGaps(base.values + slopes @ motions, base.normals)
    contacts = partial(gaps.touching, drawn, claim.transform, chosen) if chosen >= 0 else None
    touching = replace(
        of_all_faces(relation, claim.sizes, contacts, transform=claim.transform, carried=claim.shift), sizes=claim.sizes
    )
    if not touching.as_drawn:
        is_exact = any(body.exact is not None for body in touching.bodies)
        claim = replace(claim, permanent_faces=touching.permanent_faces if is_exact else None, within=touching.between,
                        permanent=[own.parts for own in touching.permanent])  # fmt: skip
    still = [own for k in range(len(asked)) if k != chosen for own in _claims(gaps, k, drawn, motions, assembly.sizes)]
    times = np.arange(1.0, slopes.shape[1] + 1.0)  # any weights but the ones asked for
    off = opened(chosen, times)[0] - motions
    along = relation.motion.ways(relation.movable.seed, relation.static.seed)
    gap_off = np.abs(np.vstack([own.normals for own in touching.pairs]) @ along.T @ off).max(axis=0)
    free = (np.abs(off) > DEFAULT.nominal * np.abs(motions).max(axis=0))[:, gap_off > DEFAULT.nominal].any(axis=1)
    weighted = tuple(own.name for own, is_free in zip(assembly.coordinates, free.tolist(), strict=True) if is_free)
    return Loop(touching, claim, gaps.exact and touching.as_drawn, tuple(still), weighted, assembly.sizes, pair,
                chosen >= 0, tuple(own for own in still if own.least != own.largest))  # fmt: skip


def decisive(assembly: Assembly, places: Array) -> Array:
    """Return those of some sizes, (n, k), that decide whether parts fit, and how far they move, all contacts closed.

    Each two parts that are to be clear have their least gap at one of them, of several that with the largest motion,
    and at one the motion is the largest. Raises `InputError` as `assembly_loop`.
    """
    gaps, base, slopes = _rows_of_motions(assembly)
    weights = np.array([own.weight for own in assembly.coordinates])
    motions = _closed(gaps, weights, np.arange(len(slopes)), base, slopes, _fits(gaps, base.normals))
    amounts = np.linalg.norm(weights * (motions[:, 0] + places @ motions[:, 1:].T), axis=1)
    least = [assembly_loop(assembly, own).touching.gap(places) for own in assembly.kept_clear]
    near = [np.flatnonzero(own <= own.min() + DEFAULT.tie * assembly.size) for own in (*least, -amounts)]
    return places[sorted({int(own[amounts[own].argmax()]) for own in near})]


def _rows_of_motions(assembly: Assembly) -> tuple[ContactGaps, AffineGaps, Array]:
    """Return the contacts that are to meet, their rows at rest, and how these change a unit of each motion, (m, q)."""
    check_sizes(assembly.sizes)
    if not assembly.shifts:
        what = "loops of contacts are linear in the sizes where motions only shift, and one of these turns"
        raise InputError(what, key="motions", found=list(assembly.motions), allowed="translations")
    names, box = [size.name for size in assembly.sizes], tolerance_boxes(assembly.sizes)
    gaps, count = ContactGaps(assembly, Sizes(box), names, own=True), len(assembly.coordinates)
    base = gaps.rows(gaps.transforms(np.zeros(count)))
    each = [gaps.rows(gaps.transforms(q)).values[:, 0] - base.values[:, 0] for q in np.eye(count)]
    return gaps, base, np.column_stack(each)


def _claim(gaps: ContactGaps, relation: Problem, motions: Array, sizes: Sequence[Size]) -> GapClaims:
    """Return what is told of two parts, moved as sizes do, but for their gap."""
    moved = motions.T @ relation.motion.ways(relation.movable.seed, relation.static.seed)  # (1 + k, 3)
    pose, mine = np.eye(4), {size.name: size for size in relation.sizes}
    pose[:3, 3] = moved[0]
    every = tuple(mine.get(own.name) or replace(own, body="another part") for own in sizes)
    return replace(gaps.claim(relation, [*range(len(sizes))], pose), sizes=every, shift=moved[1:])


def _claims(
    gaps: ContactGaps, chosen: int, drawn: AffineGaps, motions: Array, sizes: Sequence[Size]
) -> Iterator[GapClaims]:
    """Yield what is told of each contact of a relation that stays closed, or has the play of its fit."""
    still, claim = (0.0, gaps.sizes.middle), _claim(gaps, gaps.relations[chosen], motions, sizes)
    near = DEFAULT.touch * gaps.size
    for own in gaps.claims(gaps.transforms(motions[:, 0])):
        if own.bodies == claim.bodies and own.contact is not None:
            rows = gaps.contacts[chosen, own.contact[0]]
            play = AffineGaps(drawn.values[rows], drawn.normals[rows])
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


def _closed(gaps: ContactGaps, weights: Array, rows: Ints, base: AffineGaps, slopes: Array, fits: Array) -> Array:
    """Return the least motions that close rows, but for the play of fits, (q, 1 + k): at sizes of 0, and by each."""
    values, slopes, fits = base.values[rows], slopes[rows], fits[rows]
    unknown = -np.linalg.pinv(np.hstack([slopes / weights, -fits]), rcond=DEFAULT.nominal) @ values
    motions = unknown[: len(weights)] / weights[:, None]
    off = np.abs(values + slopes @ motions - fits @ unknown[len(weights) :])
    open_ = off[:, 0] + off[:, 1:] @ np.abs(gaps.sizes.box).max(axis=1)
    if open_.max(initial=0.0) > DEFAULT.touch * gaps.size:
        lines = [gaps.lines[k] for k in rows[open_ > DEFAULT.touch * gaps.size].tolist()]
        named = "; ".join(dict.fromkeys(gaps.words(own.relation, own.feature) for own in lines))
        what = f"the other contacts cannot all be closed at once within these tolerances: {named}"
        raise InputError(what, key="of", found=float(open_.max()), allowed="two parts whose contacts close this loop")
    return np.asarray(motions)
