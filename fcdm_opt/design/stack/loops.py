"""Which sizes of all parts of an assembly open a gap: loops of contacts, by their linear rows.

Where motions only shift, gaps of contacts are affine in the sizes p and the motions q. Parts rest on each other: all
contacts but the one that is asked about stay closed, c + S p + D q = 0, by the least motions q(p) with which they do.
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
from fcdm_opt.design.contact_gaps import AffineGaps, ContactGaps, by_contacts, relations_of
from fcdm_opt.design.sizes import Sizes, tolerance_boxes
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.size import Size
from fcdm_opt.judge.sampled_sizes import GapClaims
from fcdm_opt.problem import arguments
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT


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
    box, relations = gaps.sizes.box, relations_of(assembly)
    asked = [pair for pair in relations if relations[pair] in gaps.relations]

    def opened(chosen: int, times: Array | float = 1.0) -> tuple[Array, Array]:
        """Return the motions that close all other contacts, and the rows of one relation, by all sizes.

        The least ones by the motions' weights, or by so many times these.
        """
        own = np.array([line.relation == chosen for line in gaps.lines], bool)
        motions = _closed(assembly, times, base.values[~own], slopes[~own], box)
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
    still = tuple(own for k in range(len(asked)) if k != chosen for own in _claims(gaps, k, motions, assembly.sizes))
    times = np.arange(1.0, slopes.shape[1] + 1.0)  # any weights but the ones asked for
    off = opened(chosen, times)[0] - motions
    along = relation.motion.ways(relation.movable.seed, relation.static.seed)
    gap_off = np.abs(np.vstack([own.normals for own in touching.pairs]) @ along.T @ off).max(axis=0)
    free = (np.abs(off) > DEFAULT.nominal * np.abs(motions).max(axis=0))[:, gap_off > DEFAULT.nominal].any(axis=1)
    weighted = tuple(own.name for own, is_free in zip(assembly.coordinates, free.tolist(), strict=True) if is_free)
    return Loop(touching, claim, gaps.exact and touching.as_drawn, still, weighted, assembly.sizes, pair, chosen >= 0)


def decisive(assembly: Assembly, places: Array) -> Array:
    """Return those of some sizes, (n, k), that decide whether parts fit, and how far they move, all contacts closed.

    Each two parts that are to be clear have their least gap at one of them, of several that with the largest motion,
    and at one the motion is the largest. Raises `InputError` as `assembly_loop`.
    """
    gaps, base, slopes = _rows_of_motions(assembly)
    motions = _closed(assembly, 1.0, base.values, slopes, gaps.sizes.box)
    weights = np.array([own.weight for own in assembly.coordinates])
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


def _claims(gaps: ContactGaps, chosen: int, motions: Array, sizes: Sequence[Size]) -> Iterator[GapClaims]:
    """Yield what is told of each contact of a relation that stays closed."""
    middle, claim = gaps.sizes.middle, _claim(gaps, gaps.relations[chosen], motions, sizes)
    for own in gaps.claims(gaps.transforms(motions[:, 0])):
        if own.bodies == claim.bodies and own.contact is not None:
            ends = (0.0, middle)
            yield replace(claim, contact=own.contact, name=f"closed: {own.name}", least=ends, largest=ends,
                          told=lambda places: np.zeros(len(places)))  # fmt: skip


def _closed(assembly: Assembly, times: Array | float, values: Array, slopes: Array, box: Array) -> Array:
    """Return the least motions that close contacts, (q, 1 + k): at sizes of 0, and by each."""
    weights = times * np.array([own.weight for own in assembly.coordinates])
    motions = -(np.linalg.pinv(slopes / weights, rcond=DEFAULT.nominal) @ values) / weights[:, None]
    left = np.abs(values + slopes @ motions)
    open_ = left[:, 0] + left[:, 1:] @ np.abs(box).max(axis=1)
    if open_.max(initial=0.0) > DEFAULT.touch * assembly.size:
        what = "the other contacts cannot all be closed at once within these tolerances"
        raise InputError(what, key="of", found=float(open_.max()), allowed="two parts whose contacts close this loop")
    return np.asarray(motions)
