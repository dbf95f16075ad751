"""Which convex parts of large bodies are modelled: those that touch, overlap, or can come into contact.

A body of thousands of parts meets another with a few of them. A question about such bodies is put with the parts that
are near each other as drawn. Where its answer lets others overlap, or where a smaller motion may bring others into
contact, these are looked at too and it is put again: parts that overlap nowhere on the way to an answer take nothing
from it. That those left out are apart is judged on the whole surfaces, see `fcdm_opt.judge.whole`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal
from weakref import WeakKeyDictionary

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.segments import Box
from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.facets import NearFacets, facets_of, near_facets, surface_distance
from fcdm_opt.geometry.measures import unit_normals
from fcdm_opt.geometry.solids import PlacedSolids, convex_inside, kept_as_surface
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.problem.problem import Problem

FEW = 10_000  # part pairs that are all modelled
BATCH_SIZE = 64  # pairs of facets whose parts are taken up together at first, the worst; then twice as many each time
MOST_TOUCHING = 100  # pairs of facets in contact as drawn whose parts are taken up
DIGITS = 6  # of directions in which facets are flush that are told apart
NEAREST = 1e-3  # of the size: how near parts are taken up first where those modelled never touch; then twice as far
MOST_LOOKED_AT = 4_000_000  # pairs of facets of which all are looked at, however far apart
LOCAL = 0.3  # of the size: how near other parts are taken up
WIDEST = 1.0 / 64  # of the size: how far parts may move on a stretch of a way on which all near ones are taken up
AROUND = 1e-3  # of the nominal scales in which the curve of some of the parts is worked out

Indices = tuple[Ints, Ints]
Reason = tuple[Ints, Array]  # pairs of parts that matter, -1 for a keep-out, and how far apart they are
_FIRST: WeakKeyDictionary[Body, dict[tuple[Any, ...], tuple[Body, Body]]] = WeakKeyDictionary()


def active_bodies(
    movable: Body,
    static: Body,
    nominal: int | Literal["drawn"] | tuple[float, float],
    box: Box,
    indices: Indices | None = None,
) -> tuple[tuple[Body, Body], Box]:
    """Return both bodies with only the parts that are looked at, and the box of their curve; as given where all are.

    `movable`, `static`: at the sizes made. `nominal`, `box`: see `Problem`. `indices`, optional: parts of either body
    that are; by default those near each other as drawn.
    """
    few = len(movable.parts) * len(static.parts) <= FEW and not (movable.is_surface or static.is_surface)
    if isinstance(nominal, int) or few:
        return (movable, static), box
    scales = np.array((1.0, 1.0) if nominal == "drawn" else nominal)
    (a, b), (c, d) = (
        (max(low, scale * (1.0 - AROUND)), min(high, scale * (1.0 + AROUND)))
        for (low, high), scale in zip(box, scales.tolist(), strict=True)
    )
    if indices is not None:
        return (movable.subset(indices[0].tolist()), static.subset(indices[1].tolist())), ((a, b), (c, d))
    known, key = _FIRST.setdefault(movable, {}), (id(static), *scales.tolist())
    if key not in known:
        near = _nearest(movable, static, scales)
        order = _of_all_kinds(near)[:MOST_TOUCHING]
        own, others = (np.unique(near.parts[order, k]).tolist() or [0] for k in (0, 1))
        known[key] = movable.subset(own), static.subset(others)
    return known[key], ((a, b), (c, d))


def _nearest(movable: Body, static: Body, nominal: Array) -> NearFacets:
    """Return the pairs of facets that are as near each other as any as drawn, or touch, or overlap."""
    one, two = facets_of(movable), facets_of(static)
    points = nominal[0] * one.points + (movable.seed - static.seed), nominal[1] * two.points
    band = surface_distance(points[0], one.triangles, points[1], two.triangles)
    band += DEFAULT.snap * max(movable.size, static.size)
    near = near_facets(one, points[0], two, points[1], band)
    return near.some(near.furthest(np.empty((0, 3)), 1.0, 0.0, 2.0 * band) <= band)


def _of_all_kinds(near: NearFacets) -> Ints:
    """Return the order in which to take pairs of facets: the nearest of those flush in each direction, the next, ..."""
    normals = [unit_normals(near.corners[:, own]) for own in (0, 1)]
    flush = (normals[0] * normals[1]).sum(axis=1) <= DEFAULT.side - 1.0
    directions = np.where(flush[:, None], normals[0].round(DIGITS), 0.0) + 0.0
    kind = np.unique(directions, axis=0, return_inverse=True)[1].reshape(-1)
    order = np.lexsort((near.heights.max(axis=1), kind))
    starts = np.searchsorted(kind[order], kind[order])
    return np.asarray(order[np.argsort(np.arange(len(order)) - starts, kind="stable")])


def _near(movable: Body, static: Body, rho: Array, transform: Array, band: float, **how: Any) -> NearFacets:
    """Return the near facets of two bodies at a scale pair and pose, in lengths from the static seed."""
    one, two = facets_of(movable), facets_of(static)
    away = transform[:3, :3] @ movable.seed + transform[:3, 3] - static.seed
    return near_facets(one, rho[0] * one.points @ transform[:3, :3].T + away, two, rho[1] * two.points, band, **how)


def with_near_parts(problem: Problem, transform: Array, band: float, rho: Array | None = None) -> Problem:
    """Return the problem with all parts active, too, whose surfaces come as near to the other body's as a length.

    `transform` (4, 4): pose change of body 1. `rho` (2,), optional: scale pair; by default the target pair.
    """
    if not problem.partial:
        return problem
    near = _near(problem.movable, problem.static, problem.target if rho is None else rho, transform, band)
    return with_parts(problem, near.parts.T)


def with_parts(problem: Problem, wanted: Indices | Ints | None) -> Problem:
    """Return the problem with some parts of either body active, too, where not all are; no others than it has."""
    known = problem.active_indices
    if known is None or wanted is None:
        return problem
    there = (own[(own >= 0) & (own < len(body.parts))] for own, body in zip(wanted, problem.bodies, strict=False))
    one, two = (np.setdiff1d(own, rows) for own, rows in zip(there, known, strict=True))
    if not len(one) and not len(two):
        return problem
    return problem.with_active_parts((np.append(known[0], one), np.append(known[1], two)))  # those known come first


def with_parts_met_along(
    problem: Problem, along: Array, near: Callable[[float, float], tuple[Array, float]], low: float, high: float
) -> tuple[Problem, float]:
    """Return the problem with parts active that may touch next after some motion q = x * along, low <= x <= high.

    The same problem where no more parts may touch; and up to which x that is so. `near` takes both ends of a stretch of
    x; it returns the scale pair in its middle, and how near parts are there at most that touch anywhere on it.
    Stretches are halved until that is not far.
    """
    stretches, least = [(low, high)] if problem.partial and high > low else [], DEFAULT.point * high
    while stretches:
        pacing.check()
        low, top = stretches.pop()
        middle, (rho, band) = 0.5 * (low + top), near(low, top)
        if band > WIDEST * problem.size * rho.max() and top - low > least:
            stretches += [(middle, top), (low, middle)]
            continue
        pose = problem.motion.transform(middle * along, problem.movable.seed, problem.static.seed)
        fuller = with_near_parts(problem, pose, min(band, WIDEST * problem.size * float(rho.max())), rho)
        if fuller is not problem:
            return fuller, low
    return problem, high


def moving_at_most(problem: Problem, along: Array, rho: Array) -> Callable[[float, float], tuple[Array, float]]:
    """Return how near parts of one scale pair are, see `with_parts_met_along`; infinite where no rate is known."""
    fastest = float(_rates(problem) @ np.abs(along))
    return lambda low, high: (rho, 0.5 * fastest * (high - low))


def expand_active_parts(
    problem: Problem, transform: Array | None, amount: float, most: int = BATCH_SIZE
) -> Problem | None:
    """Return the problem with further parts that an answer shows to matter; None where no others do.

    - `transform` (4, 4): the pose that was found; None where none was.
    - `amount`: the amount of the motion to it. Of goals that want a contact, whichever, parts that may touch after a
      smaller motion matter too; infinite where there is none.
    - `most`: pairs of parts that are taken up for one reason, the worst first.
    """
    known = problem.active_indices
    if known is None:
        return None
    movable, static, pose = problem.movable, problem.static, np.eye(4) if transform is None else transform
    kept = [np.isin(np.arange(len(own.parts)), rows) for own, rows in zip((movable, static), known, strict=True)]
    reasons = [_overlapping(problem, movable, static, pose), *_near_keep_outs(problem, movable, pose)]
    found = [_new(*reason, kept, most) for reason in reasons]
    if "touch" in (problem.goal, problem.pair) and not problem.contacts:
        sooner = (_new(*reason, kept, most) for reason in _touching_sooner(problem, movable, static, amount, kept))
        found += next(([new] for new in sooner if len(new)), [])
    new = np.concatenate(found)
    return with_parts(problem, new.T) if len(new) else None


def with_insides(problem: Problem, transform: Array) -> Problem | None:
    """Return the problem with what is inside of solids, where one lies in another at a pose; None where none does.

    Parts that are a solid's surface alone bar the way into it, not a place in the middle of it: a convex body there
    does, as a further keep-out, or as a further part of body 1.
    """
    if not kept_as_surface(*problem.bodies):
        return None
    partner = (KeepOut(problem.static, float(problem.target[1])),)
    others = (*(partner if {"clear", "touch"} & {problem.goal, problem.pair} else ()), *problem.keep_out)
    movable, rho = problem.movable, problem.target[0]
    found, parts = list[KeepOut](), list[ConvexPart]()
    for other in others:
        for end in dict.fromkeys(other.ends) if kept_as_surface(movable, other.body) else ():
            placed = PlacedSolids(movable, other.body, np.array([rho, end]), transform)
            point, held = placed.within(1), placed.within(0)
            if point is not None:
                inside = convex_inside(other.body, other.body.seed + point / end)
                name = f"{inside.name} {len(problem.keep_out) + len(found) + 1}"
                found.append(KeepOut(inside, other.scale, clearance=other.clearance, name=name))
            elif held is not None and problem.partial:
                own = (held + other.body.seed - transform[:3, 3]) @ transform[:3, :3]  # where it is on body 1 as made
                parts += convex_inside(movable, movable.seed + (own - movable.seed) / rho).parts
            if point is not None or held is not None:
                break
    if not (found or parts):
        return None
    if not parts:
        return problem.changed(keep_out=(*problem.keep_out, *found))
    more = replace(movable, parts=(*movable.parts, *parts))
    assert problem.active_indices is not None
    one, two = problem.active_indices
    fuller = problem.changed(movable=more, keep_out=(*problem.keep_out, *found))
    return fuller.with_active_parts((np.append(one, np.arange(len(movable.parts), len(more.parts))), two))


def _overlapping(problem: Problem, movable: Body, static: Body, pose: Array) -> Reason:
    """Return the parts that overlap at a pose, or are nearer each other than they must be."""
    clear = problem.clearance if "clear" in (problem.goal, problem.pair) else 0.0
    slack = DEFAULT.cut * problem.size
    near = _near(movable, static, problem.target, pose, clear + slack, crossing=not clear)
    depth = near.heights.max(axis=1) - clear
    return near.parts[depth < -slack], depth[depth < -slack]


def _near_keep_outs(problem: Problem, movable: Body, pose: Array) -> Iterator[Reason]:
    """Yield the parts of body 1 that are too near a keep-out at a pose, for each and either end of its scales."""
    for keep_out in problem.keep_out:
        for scale in keep_out.ends:
            near = _near(movable, keep_out.body, np.array([problem.target[0], scale]), pose, keep_out.clearance)
            depth = near.heights.max(axis=1) - keep_out.clearance
            rows = near.parts[depth < 0.0]
            rows[:, 1] = -1
            yield rows, depth[depth < 0.0]


def _touching_sooner(
    problem: Problem, movable: Body, static: Body, amount: float, kept: list[Flags]
) -> Iterator[Reason]:
    """Yield parts not modelled that may touch after a motion of less than an amount."""
    # of an infinite one within larger and larger ones, as far as parts can be apart
    fastest, size = float(np.linalg.norm(_rates(problem) / problem.weights)), problem.size
    pairs = len(facets_of(movable).triangles) * len(facets_of(static).triangles)
    farthest = float(np.linalg.norm(movable.seed - static.seed)) + problem.target @ (movable.size, static.size)
    distance = farthest if pairs <= MOST_LOOKED_AT else LOCAL * size
    distances = NEAREST * size * 2.0 ** np.arange(math.ceil(math.log2(distance / (NEAREST * size))) + 1)
    shifts = np.empty((0, 3))
    if problem.motion.shifts:
        shifts = problem.motion.shift_vectors(problem.movable.seed, problem.static.seed) / problem.weights[:, None]
    line = shifts[0] / np.linalg.norm(shifts[0]) if len(shifts) == 1 else None
    # bounds by axis of where a shift of the amount 1 leads
    along = np.linalg.norm(shifts, axis=0) / fastest + DEFAULT.cut if len(shifts) else 1.0
    for largest in [amount] if math.isfinite(amount) else (distances / fastest).tolist():
        if pacing.over():
            return  # what may touch sooner is looked for while there is time
        near = _near(movable, static, problem.target, np.eye(4), fastest * largest, along=along)
        near = near.some(_unknown(near.parts, kept))
        needed = near.furthest(shifts, fastest, DEFAULT.cut * size, largest, line)
        sooner = needed < largest * (1.0 - DEFAULT.nominal)
        yield near.parts[sooner], needed[sooner]


def _unknown(pairs: Ints, kept: list[Flags]) -> Flags:
    """Tell which pairs of parts are not modelled yet; of -1 in place of the second the first counts alone."""
    return np.asarray(~(kept[0][pairs[:, 0]] & (kept[1][pairs[:, 1]] | (pairs[:, 1] < 0))))


def _new(pairs: Ints, values: Array, kept: list[Flags], most: int) -> Ints:
    """Return the pairs of parts with the least values that are not modelled yet, each once, so many at a time."""
    unknown = _unknown(pairs, kept)
    pairs, values = pairs[unknown], values[unknown]
    pairs = pairs[np.argsort(values, kind="stable")]
    first = np.sort(np.unique(pairs, axis=0, return_index=True)[1])
    return np.asarray(pairs[first[:most]])


def _rates(problem: Problem) -> Array:
    """Return the most that a vertex of body 1 as made can be displaced per unit of each parameter, (k,)."""
    body = problem.movable
    return problem.motion.reaches(body.seed + problem.target[0] * (body.vertices - body.seed), body.seed)
