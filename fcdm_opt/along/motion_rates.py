"""How the least motion itself changes with the data: its optimality conditions, differentiated once more.

At a least motion q the gradient of half the amount's square is a sum of multipliers times gradients of constraints g_j
that are active there. With f = |W q|^2 / 2 and data v that move by dv

    (W^2 - sum m_j g_j,qq) dq - sum g_j,q dm_j = sum m_j g_j,qv dv,     g_j,q dq = - g_j,v dv

gives dq and the change dm of the multipliers. The constraints are the contact equations in CasADi, whose vertices and
seeds are inputs, so that all their derivatives are exact. What is not told by these is nan.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.along.holding import Holding, Site, fit_rows
from fcdm_opt.along.round_contacts import BALANCED, RoundContact, curved
from fcdm_opt.curve.contact import Contact, distinct, supporting_contact
from fcdm_opt.curve.kernels import F1V2, V1F2
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.model.equations import OWNERS, FeaturePoints, contact_line, feature_points, switching_point
from fcdm_opt.model.seats import independent
from fcdm_opt.model.task import Task
from fcdm_opt.model.templates import template
from fcdm_opt.motion.motions import Motion
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.tolerances import DEFAULT

DECIMALS = 12  # of points that are the same
NOT_WORKED_OUT = "not worked out: more holds the motion than it takes, or a keep-out or the way of a contact does"
OTHER_CONTACTS = "other contacts, or other ends of a line of contact that tilts, take over to either side"
OTHER_CORNERS = "the parts made have other corners or faces there than as drawn"

Field = Callable[[int, Array], Array]
"""How a point as drawn, (3,), of body 1 or 2 moves; of body 0 how the seed of body 1 does."""


class Change(NamedTuple):
    """How points as drawn move, how much each scale of the target pair changes, and how body 1 turns."""

    field: Field = lambda owner, point: np.zeros(3)
    scales: Array = np.zeros(2)
    turn: Array = np.zeros(3)


class Rates(NamedTuple):
    """How a least motion, (n, k), and its amount, (n,), change; nan where there is no derivative, and why, (n,)."""

    motion: Array
    amount: Array
    reasons: tuple[str, ...]


@template
def _expanded(motion: Motion, kinds: tuple[int, ...], row: int) -> Any:
    """Return the derivatives of a constraint: the gap of one feature, or scale `row` of the point where two meet.

    With row -1 by how much the gap of one of two features is larger than that of the other.

    A CasADi function (q, data) -> (slope (1, k + n), bend (k, k + n)), by q and then the data: seeds, (6,), features,
    13 numbers each, and the scale pair at which it is taken.
    """
    import casadi

    q, data = casadi.SX.sym("q", len(motion.parameters)), casadi.SX.sym("data", 8 + 13 * len(kinds))
    features = [data[6 + 13 * k : 19 + 13 * k] for k in range(len(kinds))]
    if len(kinds) == 1 or row < 0:
        lines = [contact_line(motion, kind) for kind in kinds]
        one, *other = (line(q, data[:6], own, data[-2:])[2] for line, own in zip(lines, features, strict=True))
        value = one - other[0] if other else one
    else:
        value = switching_point(motion, kinds)(q, data[:6], *features)[0][row] - data[-2 + row]
    both = casadi.vertcat(q, data)
    slope = casadi.jacobian(value, both)
    bend = casadi.jacobian(slope[: q.numel()].T, both)
    return casadi.Function("expanded", [q, data], [casadi.densify(slope), casadi.densify(bend)])


class _Constraint(NamedTuple):
    """What holds a motion, not negative where it is met: its derivatives by q, (k,) and (k, k), and by the data."""

    slope: Array
    bend: Array
    by_data: Array  # (n,)
    mixed: Array  # (k, n)
    features: tuple[FeaturePoints, ...]
    keep_out: bool = False  # the features are of body 1 and a keep-out, which stays as it is drawn
    free: bool = False  # pushes both ways
    choice: Any = None  # a pair of parts, or a contact of true faces, of whose constraints one is to hold
    round: bool = False  # of true faces, with how body 1 turns among its data


def motion_rates(
    holdings: Sequence[Holding],
    changes: Sequence[Sequence[Change]],
    nominal: Sequence[FeaturePoints] = (),
    ratio: Array | None = None,
) -> Rates:
    """Return how a least motion, (k,), changes as points move and sizes change.

    `holdings` are of one task, or of every two parts of an assembly, with the same parameters, weights and limits.
    `changes` are what is asked about: of each a change for every task. `nominal` are the features of one task that meet
    at the nominal switching point, which takes the target pair along; none where it stays. `ratio`, (2,), is that of
    the target pair to the nominal one.

    nan where there is no derivative: constraints that go with one side of the change only, and what no constraint here
    holds. Of the amount there is one where all multipliers that balance say the same.
    """
    tasks, task, q = [own.task for own in holdings], holdings[0].task, holdings[0].q
    none = np.full(len(q), np.nan)
    missing = (NOT_WORKED_OUT,) * len(changes)
    unknown = Rates(np.full((len(changes), len(q)), np.nan), np.full(len(changes), np.nan), missing)
    known = [(k, own) for k, each in enumerate(holdings) for own in _constraints(each, limits=k == 0)]
    held, owners = [own for _, own in known if own is not None], [k for k, _ in known]
    if len(held) < len(known):
        return unknown
    weights, several = task.weights, any(each.joints or each.restored for each in tasks)
    slopes = np.array([own.slope for own in held]).reshape(-1, len(q))
    given = task.amount_kind if several and isinstance(task.amount_kind, OwnAmount) else None
    both = given.derivatives(q) if given else np.column_stack([np.diag(weights**2), weights**2 * q])
    if task.weighted or given:
        free, columns = [j for j, own in enumerate(held) if own.free] if several else [], slopes / weights
        kept = [free[j] for j in independent(columns[free])]  # those without multiplier too
        columns[[j for j in free if j not in kept]] = 0.0
        multipliers = _multipliers(held, columns, both[:, -1] / weights)
        holds = multipliers != 0.0
        if holds.any() or not q.any():
            holds[kept] = True
    else:  # where constraints alone say what the motion is
        multipliers, holds = np.zeros(len(held)), slopes.any(axis=1)
    used, count = np.flatnonzero(holds), int(holds.sum())
    pairs = [held[j].choice for j in used if held[j].choice is not None]
    if not count or len(pairs) > len(set(pairs)) or (count < len(q) and not (task.weighted or given)):
        return unknown
    bend = both[:, :-1] - sum(m * own.bend for m, own in zip(multipliers, held, strict=True) if m)
    system = np.block([[bend, -slopes[used].T], [slopes[used], np.zeros((count, count))]])
    across = np.linalg.svd(slopes[used] / weights)[2][count:] / weights  # what the constraints leave open
    sure = np.linalg.matrix_rank(slopes[used] / weights, DEFAULT.stationary) == count
    sure &= not len(across) or float(np.linalg.eigvalsh(across @ bend @ across.T).min()) > DEFAULT.stationary
    motions, amounts, reasons = [], [], list[str]()
    unit = 1.0 if given else task.amount(q) or np.nan
    start = [_constraint(task, task.rest, nominal, 1.0, row=k) for k in (0, 1)] if len(nominal) == 2 else []
    for change in changes:
        drawn = [own.by_data @ _moves(task, own, Change(change[0].field), np.zeros(2)) for own in start]
        target = ratio * drawn if drawn and ratio is not None else np.zeros(2)
        moves = [_moves(tasks[k], own, change[k], target) for k, own in zip(owners, held, strict=True)]
        off = np.array([own.by_data @ move for own, move in zip(held, moves, strict=True)])
        dq, why = none, "" if sure else NOT_WORKED_OUT
        if not np.isfinite(off).all():
            why = OTHER_CORNERS
        elif sure:
            pulls = [m * own.mixed @ move for m, own, move in zip(multipliers, held, moves, strict=True) if m]
            dq = np.linalg.solve(system, np.append(sum(pulls, np.zeros(len(q))), -off[used]))[: len(q)]
            others = np.delete(slopes @ dq + off, used)  # those at rest there must stay so, else one side is another's
            near = DEFAULT.stationary * (1.0 + float(np.abs(off).max(initial=0.0)))
            dq, why = (dq, "") if np.abs(others).max(initial=0.0) <= near else (none, OTHER_CONTACTS)
        motions.append(dq)
        reasons.append(why)
        amounts.append(-_alike(held, slopes / weights, off, used, multipliers) / unit)
    return Rates(np.array(motions).reshape(-1, len(q)), np.array(amounts), tuple(reasons))


def _alike(held: Sequence[_Constraint], slopes: Array, off: Array, used: Ints, multipliers: Array) -> float:
    """Return the sum of multipliers times changes of constraints, nan where other multipliers make it another."""
    from scipy.optimize import linprog

    still = ~slopes.any(axis=1)
    value = float(multipliers @ off) if multipliers.any() else np.nan
    near = DEFAULT.stationary * (1.0 + float(np.abs(off).max(initial=0.0)))
    if not np.isfinite(value) or not np.abs(off[still]).max(initial=0.0) <= near:
        return np.nan
    rows = np.flatnonzero(~still)
    signs = [(None if held[j].free else 0.0, None) for j in rows.tolist()]
    for side in (1.0, -1.0) if len(rows) > len(used) else ():
        best = linprog(side * off[rows], A_eq=slopes[rows].T, b_eq=slopes.T @ multipliers, bounds=signs)
        if best.status != 0 or not abs(side * best.fun - value) <= near:
            return np.nan
    return value


def _multipliers(held: Sequence[_Constraint], slopes: Array, gradient: Array) -> Array:
    """Return the multipliers with which constraints hold the motion; all 0 where they do not balance."""
    from scipy.optimize import nnls

    signs = [(j, sign) for j, own in enumerate(held) for sign in ((1.0, -1.0) if own.free else (1.0,))]
    lengths = np.linalg.norm(slopes, axis=1)
    signs = [(j, sign) for j, sign in signs if lengths[j] > DEFAULT.tie]
    size, found = float(np.linalg.norm(gradient)), np.zeros(len(held))
    if not signs or not size > 0.0:
        return found
    columns = np.array([sign * slopes[j] / lengths[j] for j, sign in signs]).T
    shares, residual = nnls(columns, gradient / size)
    if residual <= (BALANCED if any(own.round for own in held) else DEFAULT.stationary):
        for (j, sign), share in zip(signs, shares.tolist(), strict=True):
            found[j] += size * sign * share / lengths[j] if share > DEFAULT.stationary else 0.0
    return found


def _constraints(holding: Holding, *, limits: bool = True) -> Iterator[_Constraint | None]:
    """Yield what may hold a motion; None for what is not known here."""
    task, q = holding.task, holding.q
    still = np.zeros((len(q), len(q)))
    for k, side, held in holding.limits_reached() if limits else ():
        yield _Constraint((1.0, -1.0)[side] * np.eye(len(q))[k], still, np.zeros(0), still[:, :0], (), free=held)
    if task.tracked and task.goal == "beyond":
        for k, sign in holding.scales_reached(task.tracked_contact(q)[0]):
            yield _constraint(task, q, task.tracked, float(sign), row=k) if len(task.tracked) == 2 else None
    elif task.goal == FIT:
        own = [_constraint(task, q, (feature,), 1.0) for feature in task.untracked]
        gaps, unit = task.line_gaps(q)[1], task.weights
        for k, other, held in fit_rows(gaps, np.array([one.slope for one in own]) / unit, holding.slack):
            pair = (task.untracked[k],) if other < 0 else (task.untracked[other], task.untracked[k])
            yield _constraint(task, q, pair, 1.0, row=-1, free=held)
    elif task.tracked or task.joints:
        for feature in (*task.tracked, *task.untracked):
            yield _constraint(task, q, (feature,), 1.0, free=True)
    if task.joints:
        yield from _aligned(task, q)
    if np.isfinite(task.needs).any():
        for near in _pairs(holding):
            yield near._replace(free=True) if near is not None and task.restored and not near.keep_out else near


def _aligned(task: Task, q: Array) -> Iterator[_Constraint]:
    """Yield what keeps faces and edges flush that are restored together: all corners are as far off as their line."""
    rotation = task.pose(q)[:9].reshape(3, 3)
    for flush in task.seats:
        joint = next(own for own in task.joints if own.feature in (flush.feature, flush.touching))
        there = tuple(joint.sites[np.argmax(joint.normals @ flush.normal)].tolist())
        line = next(line for line in task.untracked if (line.parts, line.site) == (joint.parts, there))
        for site in _level(flush.site, flush.contact):
            own = feature_points(task.movable, task.static, site, flush.parts, flush.normal, rotation)
            yield _constraint(task, q, (own, line), 1.0, row=-1, free=True)


def _level(site: Sequence[int], met: Contact) -> list[Site]:
    """Return the sites of a face and each vertex that lies on it, of a contact; of edges that cross the site itself."""
    kind, one, two = site
    if kind == V1F2:
        return [(kind, vertex, two) for vertex in met.one]
    return [(kind, one, vertex) for vertex in met.two] if kind == F1V2 else [(kind, one, two)]


def _pairs(holding: Holding) -> Iterator[_Constraint | None]:
    """Yield what keeps pairs of parts apart, or brings one together."""
    task, q = holding.task, holding.q
    closes = holding.closes and task.gap(task.rest) > 0.0
    rotation = holding.end.pose[:9].reshape(3, 3)
    seen, meetings = set[tuple[Any, ...]](), holding.round or []
    for number, own in enumerate(meetings):
        yield from _round(task, q, own, -1.0 if closes else 1.0, number if closes else None)
    for parts in holding.pairs_reached():
        obstacle, (other, place) = task.obstacles[parts[1]], holding.body_of(parts[1])
        sites, normals, widest = holding.facets_reached(parts)
        normals = normals[distinct(normals)]
        # of pairs farther apart than others a lower bound was known
        if not len(sites) or widest > max(obstacle.need, 0.0) + holding.slack:
            continue
        if any(holding.is_round(own, parts, normals) for own in meetings):
            continue
        swept = obstacle.part is not other.parts[place] or (other is not task.static and task.motion.along_seeds.any())
        if swept or len(normals) > 1 or widest < max(obstacle.need, 0.0) - holding.slack:
            yield None
            continue
        closing = closes and other is task.static
        met = supporting_contact(
            task.movable.parts[parts[0]], obstacle.part, normals[0], holding.end.pose, DEFAULT.active
        )
        for site in dict.fromkeys(own for there in sites.tolist() for own in _level(there, met)):
            feature = feature_points(task.movable, other, site, (parts[0], place), normals[0], rotation)
            scales = np.array([task.target[0], obstacle.scale])
            known = (feature.kind, *np.round(feature.points, DECIMALS).ravel().tolist())
            if known not in seen:  # of parts that have a corner of the solids in common
                seen.add(known)
                made = _constraint(
                    task, q, (feature,), -1.0 if closing else 1.0, at=(other.seed, scales),
                    keep_out=other is not task.static, choice=parts if closing else None,
                )  # fmt: skip
                if closing or np.abs(made.slope).max() > DEFAULT.tie:  # else no motion brings the two nearer
                    yield made


def _round(
    task: Task, q: Array, contact: RoundContact, sign: float, number: int | None
) -> Iterator[_Constraint | None]:
    """Yield what keeps true faces apart that touch, or brings them together; None where it tilts a line not `held`.

    The gap is that of a point and a plane, but for the bends. How it changes where the point is another, or the plane
    another one through it, says how the faces tilt and shift along each other. What must not change has no slope.
    """
    rotation, count, none = task.transform(q)[:3, :3], len(q), np.zeros(3)
    point, foot = contact.points

    def gap(k: int, at: Array = point) -> _Constraint:
        spans = foot + np.vstack([none, contact.frame[[(k + 1) % 3, (k + 2) % 3]]])
        plane = FeaturePoints(V1F2, np.column_stack([at, *spans]), 1.0, (0, 0), (V1F2, 0, 0))
        return _constraint(task, q, (plane,), 1.0)

    def row(own: _Constraint, turn: Array = none) -> Array:
        return np.concatenate([own.slope, own.by_data, turn])

    drawn, flat = contact.frame @ rotation, gap(2)
    shifts = -np.array([row(gap(k)) for k in (0, 1)])
    turns = [
        row(gap(2, point + own / task.target[0]), np.cross(drawn[2], own)) - row(flat) for own in drawn[:2]
    ]  # a turn w of body 1 lets a point at u sink by n . (u x w)
    twist = row(gap(0, point + drawn[1] / task.target[0]), np.cross(*drawn[:2])) + shifts[0]
    found = curved(contact, shifts, np.array(turns), twist)
    if found is None or (np.abs(found[1][:, :count]).max(initial=0.0) > DEFAULT.tie and not contact.held):
        yield None
        return
    second, still = found
    bend, mixed = np.split(np.hstack([flat.bend, flat.mixed, np.zeros((count, 3))]) + second[:count], [count], axis=1)
    points = (replace(flat.features[0], points=np.column_stack([point, foot, foot, foot])),)  # go with the faces
    yield _Constraint(
        sign * flat.slope, sign * bend, sign * np.append(flat.by_data, none), sign * mixed, points, choice=number,
        round=True,
    )  # fmt: skip
    zeros = np.zeros(count), np.zeros((count, count)), np.zeros_like(mixed)
    for own in still[: 0 if contact.held else None, count:]:
        yield _Constraint(zeros[0], zeros[1], own, zeros[2], points, round=True)


def _constraint(
    task: Task,
    q: Array,
    features: Sequence[FeaturePoints],
    sign: float,
    row: int = 0,
    at: tuple[Array, Array] | None = None,
    **more: Any,
) -> _Constraint:
    """Return a constraint; `at` is the seed of the other body and the scale pair, by default the static body's."""
    seed, scales = at or (task.static.seed, task.target)
    seeds = np.append(task.movable.seed, seed)
    data = np.concatenate([seeds, *(feature.values for feature in features), scales])
    slope, bend = (
        sign * np.array(own) for own in _expanded(task.motion, tuple(own.kind for own in features), row)(q, data)
    )
    count = len(q)
    return _Constraint(slope[0, :count], bend[:, :count], slope[0, count:], bend[:, count:], tuple(features), **more)


def _moves(task: Task, own: _Constraint, change: Change, target: Array) -> Array:
    """Return how the data of a constraint change, where the target pair does by `target`."""
    if not own.features:
        return np.zeros(0)
    moved = [change.field(0, task.movable.seed), np.zeros(3)]
    for feature in own.features:
        owned = zip(OWNERS[feature.kind], feature.points.T, strict=True)
        moved += [np.zeros(3) if own.keep_out and owner == 2 else change.field(owner, point) for owner, point in owned]
        moved.append(np.zeros(1))
    scales = (target + change.scales) * [1.0, not own.keep_out]
    return np.concatenate([*moved, scales, change.turn if own.round else []])
