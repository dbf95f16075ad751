"""How the least amount changes with the data: the envelope theorem, from the constraints that hold the motion.

At a least motion the gradient of the amount is a sum of multipliers times the gradients of the active constraints; the
amount then changes with any other datum as the Lagrangian does, amount - sum of multipliers times constraints. Active
constraints are found from geometry (`holding`), so it does not matter which stage found the motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice, product
from operator import itemgetter
from typing import Any

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.along.holding import Holding
from fcdm_opt.along.motion_rates import Change, Field, motion_rates
from fcdm_opt.along.round_contacts import BALANCED
from fcdm_opt.along.variation import MOVABLE, Layout, MovedScene, Rate, Term
from fcdm_opt.curve.segments import SwitchingPoint
from fcdm_opt.geometry.arrays import Array, Flags, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.patches import true_faces
from fcdm_opt.geometry.polygons import distances
from fcdm_opt.geometry.resizing import exact_vertex_rates, true_point_rate, vertex_rates
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.units import number_text
from fcdm_opt.model.equations import FeaturePoints, feature_points
from fcdm_opt.model.task import Task
from fcdm_opt.problem.active_parts import expand_active_parts
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.assembled import AssemblySensitivity, AssemblySolution
from fcdm_opt.problem.contacts_restored import touching_again
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.solution import Sensitivity, Solution
from fcdm_opt.stages.order import STAGES
from fcdm_opt.tolerances import DEFAULT

MOST_CHOICES = 256  # of alternatives that may hold the motion
APART = 0.05  # of the amount: how far off another motion of the same amount is looked for
SECONDS = 5.0  # for which it is looked for: of parts that are hundreds of pairs the search for nothing takes minutes


def sensitivity(solution: Solution) -> Sensitivity:
    """Return the derivatives of a solution's amount; without a motion, or one that nothing holds, there are none."""
    problem, task = solution.problem.reformulated, Task.of(solution.problem)
    layout = Layout.of(task)
    if not solution.status.found:
        return _made(problem, task, None, _nothing(layout, np.nan), ["no motion was found"])
    q = np.array(list(solution.parameters.values()))
    if not task.amount(q) > 0:
        met = not task.tracked and not task.must_touch and task.misses(q)[0] > DEFAULT.active * task.size
        reasons = [] if met else ["the requirement is only just met without motion: derivatives are one-sided"]
        return _made(problem, task, q, _nothing(layout, 0.0), reasons)
    if _keeps_its_steps(problem, task, q):
        return _made(problem, task, q, _nothing(layout, 0.0), [])
    holding = Holding(task, q, problem.limits)
    balances = _balances(task, _pieces(holding), holding.groups())
    best = min(balances, key=lambda balance: balance.residual)
    near = BALANCED if holding.round else DEFAULT.stationary
    even = [balance for balance in balances if balance.residual <= near] or [best]
    only = solution.unique_within >= task.amount(q) or task.restored or task.goal == FIT  # of a fit gaps differ
    others = [] if only else _ties(problem, task, q)
    tied = [end for amount, end in others if amount >= task.amount(q) * (1.0 - DEFAULT.tied)]
    reasons = [*holding.reasons, *["another motion is as small"] * bool(tied)]
    if len(tied) < len(others):
        reasons.append(f"not the least motion: there is one of amount {number_text(min(others, key=itemgetter(0))[0])}")
    if solution.status.name == "NOT_VERIFIED":
        reasons.append("the judge rejected the motion")
    if problem.resolution is not None:
        reasons.append("the motion is rounded to steps of the machine: the amount changes in jumps")
    if best.residual > near:
        reasons.append(f"what was found does not hold the motion: residual {best.residual:.2g} of the gradient")
    counted = ~layout.parting
    counted[layout.clearances] = [task.clearance > 0, *(own.clearance > 0 for own in task.keep_out)]  # else one-sided
    more = np.any([balance.open for balance in even], axis=0)
    for end in tied:  # the amount is the less of both
        at = Holding(task, end, problem.limits)
        even += [own for own in _balances(task, _pieces(at), at.groups()) if own.residual <= near]
    other = np.any([balance.unlike(best) for balance in even], axis=0)
    if (more & counted).any():
        reasons.append("more constraints hold the motion than it takes: which of them do depends on what changes")
    if (other & counted).any():
        reasons.append("either of several constraints holds the motion: which does depends on what changes")
    broken = np.any([balance.broken for balance in even], axis=0)
    return _made(problem, task, q, replace(best, open=more | other, broken=broken), reasons, tied)


def _keeps_its_steps(problem: Problem, task: Task, q: Array) -> bool:
    """Tell whether a motion in whole steps of the machine stays what it is: more room is left than is asked for."""
    if problem.resolution is None or not problem.resolution.all() or task.tracked or task.is_equation:
        return False
    return bool((task.pair_gaps(q) - task.needs > DEFAULT.active * task.size).all())


@dataclass(frozen=True, eq=False)
class _Balance:
    """The amount's gradient as a sum of constraints' gradients."""

    data: Array  # (n,), derivatives by the data, in the order of a `Layout`
    broken: Flags  # (n,), that do not exist as an element would break
    open: Flags  # (n,), that other multipliers make others
    multipliers: dict[str, float]
    residual: float

    def unlike(self, other: _Balance) -> Flags:
        """Return which derivatives are not those of another balance."""
        return (np.abs(self.data - other.data) > _near(self.data)) & ~self.broken & ~other.broken


def _nothing(layout: Layout, value: float) -> _Balance:
    none = np.zeros(layout.size, dtype=bool)
    return _Balance(np.full(layout.size, value), none, none, {}, 0.0)


def _near(values: Array) -> float:
    return DEFAULT.stationary * float(np.abs(values).max(initial=1.0))


def _pieces(holding: Holding) -> list[Rate]:
    """Return the rates of the amount: of "displacement" those of all vertices that move furthest."""
    task, q, layout = holding.task, holding.q, holding.layout
    if task.weighted:
        return [layout.rate("amount", task.weights**2 * q / task.amount(q))]
    if isinstance(task.amount_kind, OwnAmount):
        return [layout.rate("amount", task.amount_kind.gradient(q))]
    rest = MovedScene.at(task, layout, task.rest)
    moved = task.made_vertices @ (holding.end.transform[:3, :3] - np.eye(3)).T + holding.end.transform[:3, 3]
    lengths = np.linalg.norm(moved, axis=1)
    points, elements = task.movable.extremes
    found = []
    for k in np.flatnonzero(lengths >= lengths.max() - holding.slack):
        term = Term(MOVABLE, points[k], elements[k], moved[k] / lengths[k], float(task.target[0]))
        after, before = (scene.rate("amount", [term]) for scene in (holding.end, rest))
        data = after.data - before.data
        data[layout.target] += after.scales - before.scales
        found.append(replace(after, scales=np.zeros(2), data=data))
    return found


def _balances(task: Task, pieces: Sequence[Rate], groups: Sequence[Sequence[tuple[Rate, ...]]]) -> list[_Balance]:
    """Return the balance for each choice of alternatives."""
    alike = list({id(rate): rate for group in groups for rates in group for rate in rates}.values())
    used = np.any([(rate.data != 0.0) | rate.broken for rate in (*pieces, *alike)], axis=0)  # few of a large body's
    short = {id(rate): replace(rate, data=rate.data[used], broken=rate.broken[used]) for rate in (*pieces, *alike)}
    own = [short[id(piece)] for piece in pieces]
    choices = islice(product(*groups), MOST_CHOICES)
    return [_balance(task, own, [short[id(one)] for rates in choice for one in rates], used) for choice in choices]


def _balance(task: Task, pieces: Sequence[Rate], constraints: Sequence[Rate], nonzero: Flags) -> _Balance:
    """Return the balance: multipliers by non-negative least squares (Lawson and Hanson), of the amount's pieces too.

    The pieces' multipliers add up to one. Where a constraint without multiplier is made of those that have one, other
    multipliers do as well: the derivatives that they change are open. The rates have the data that are `nonzero`.
    """
    from scipy.optimize import nnls

    unit = max(float(np.linalg.norm(piece.slope / task.weights)) for piece in pieces)
    columns = [np.append(-piece.slope / task.weights / unit, 1.0) for piece in pieces]
    factors, rates = [0.0] * len(pieces), list(pieces)  # of a column's multiplier; whose it is
    owners = [-1] * len(pieces)
    for owner, rate in enumerate(constraints):
        slope = rate.slope / task.weights
        length = float(np.linalg.norm(slope))
        if length <= DEFAULT.tie:  # no motion changes it, but for rounding
            slope, length = 0.0 * slope, 1.0
        for sign in (1.0, -1.0) if rate.free else (1.0,):
            columns.append(np.append(sign * slope / length, 0.0))
            factors.append(sign * unit / length)
            rates.append(rate)
            owners.append(owner)
    matrix, breaks = np.array(columns).T, np.array([rate.broken for rate in rates])
    adds = np.where(np.array(owners) < 0, 1.0, -np.array(factors))  # what a column adds to the amount's rate
    data = adds[:, None] * [rate.data for rate in rates]
    shares, residual = nnls(matrix, np.append(np.zeros(len(task.weights)), 1.0))
    used = shares > DEFAULT.stationary
    mixes = np.linalg.lstsq(matrix[:, used], matrix[:, ~used])[0]
    made = (np.abs(matrix[:, used] @ mixes - matrix[:, ~used]) <= DEFAULT.stationary).all(axis=0)
    unused = data[~used][made]
    near = DEFAULT.stationary * np.abs(unused).max(axis=1, initial=1.0)
    undetermined = (np.abs(unused - mixes[:, made].T @ data[used]) > near[:, None]).any(axis=0)
    broken = breaks[used].any(axis=0) | breaks[~used][made].any(axis=0)
    multipliers: dict[str, float] = {}
    for owner, factor, share in zip(owners, factors, shares.tolist(), strict=True):
        if owner >= 0:
            name = _named(constraints, owner)
            multipliers[name] = multipliers.get(name, 0.0) + factor * share
    whole = np.zeros(len(nonzero)), np.zeros(len(nonzero), bool), np.zeros(len(nonzero), bool)
    for values, some in zip(whole, (shares @ data, broken, undetermined & ~broken), strict=True):
        values[nonzero] = some
    return _Balance(*whole, multipliers, float(residual))


def _named(constraints: Sequence[Rate], place: int) -> str:
    """Return a constraint's name, numbered where it repeats an earlier one."""
    name = constraints[place].name
    count = sum(rate.name == name for rate in constraints[:place])
    return f"{name} ({count + 1})" if count else name


def _ties(problem: Problem, task: Task, q: Array) -> list[tuple[float, Array]]:
    """Return other motions, some way off, that are as small, or smaller, with their amounts.

    What is not found in `SECONDS` is taken for not there.
    """
    pacing.at("looking whether another motion is as small")
    found, amount = list[tuple[float, Array]](), task.amount(q)
    most = amount * (1.0 + DEFAULT.tied)
    with suppress(pacing.TimeOverError), pacing.within(SECONDS):
        for k, side in product(range(len(q)), (0, 1)):
            limits = task.limits.copy()
            limits[k, side] = q[k] + (1.0, -1.0)[side] * APART * amount / task.weights[k]
            nearest = max(limits[k, 0], -limits[k, 1], 0.0) * task.weights[k]
            if limits[k, 0] > limits[k, 1] or (task.weighted and nearest > most):
                continue
            end = _least(problem, limits, most)
            if end is not None and task.amount(end) <= most:
                found.append((task.amount(end), end))
    return found


def _least(problem: Problem, limits: Array, most: float) -> Array | None:
    """Return the least motion of a question within other limits; None where none is found.

    For tracked contacts without the last stage, which takes long to find nothing. Of large bodies with as many parts as
    a motion of at most so much needs: in the way of others there may be parts that the one found never came near.
    """
    while True:
        task = replace(Task.of(problem), limits=frozen(limits))
        last, answer = "descent" if task.tracked else "nlp", None
        for name, stage in STAGES.items():
            answer = stage(task)
            if answer is not None or name == last:
                break
        if answer is None or answer.q is None:
            return None
        further = None if task.amount(answer.q) > most else expand_active_parts(problem, task.transform(answer.q), 0.0)
        if further is None:
            return answer.q
        problem = further


def _made(
    problem: Problem, task: Task, q: Array | None, balance: _Balance, reasons: Sequence[str], tied: Sequence[Array] = ()
) -> Sensitivity:
    """Return the derivatives by what the user gives, from those by what the task has; `tied` are motions as small."""
    layout, reasons, names = Layout.of(task), list(reasons), task.motion.names
    data = np.where(balance.broken | balance.open, np.nan, balance.data)
    target = data[layout.target]
    nominal, tolerance = np.zeros(2), None
    if problem.requirement is not None:
        assert problem.tolerance is not None
        nominal = target * problem.target / problem.nominal_pair
        taken = np.array([problem.signs < 0, problem.signs > 0]).T
        tolerance = np.where(taken, (target * problem.nominal_pair * problem.signs)[:, None], 0.0)
    if nominal.any() and np.isfinite(nominal).all():
        for share, rate in zip(nominal, _nominal_rates(problem, task, reasons), strict=False):
            data += share * np.where(rate.broken & (share != 0), np.nan, rate.data)
    weights = np.zeros(len(names)) if q is None or problem.amount != "weighted" else problem.weights * q**2
    weights = weights / (task.amount(q) or 1.0) if q is not None else np.full(len(names), np.nan)
    keys = ["P1", "P2", *(f"keep-out {own.name!r} " for own in task.keep_out)]
    faces, vertices, seeds = dict[str, float](), dict[str, Array](), dict[str, Array]()
    for k, (key, body) in enumerate(zip(keys, layout.bodies, strict=True)):
        rows = data[layout.vertices(k)].reshape(-1, 3)
        vertices |= {f"{key}V{row}": frozen(value) for row, value in enumerate(rows, 1)}
        drawn = {*body.of_facets.faces}  # others are of pieces at points
        shifts = zip(body.faces, data[layout.faces(k)].tolist(), strict=True)
        faces |= {key + ",".join(f"V{label}" for label in face): x for face, x in shifts if face in drawn}
        seeds[key.strip()] = frozen(data[layout.seed(k)])
    clearance, *kept = data[layout.clearances].tolist()
    sizes = {}
    for size in problem.sizes:
        body, moves = getattr(problem, size.body), _size_rates(problem, size)
        key = "P1" if size.body == "movable" else "P2"
        sizes[size.name] = np.nan if moves is None else by_moves(key, body, moves, faces, vertices)[0]
    motions, by_size = _motions(problem, task, q)  # corners of cuts alone are no data, and contacts on a line one
    for end in tied:
        by_size = np.where(np.abs(_motions(problem, task, end)[1] - by_size) <= _near(by_size), by_size, np.nan)
    sizes = {name: float(other if np.isnan(x) else x) for (name, x), other in zip(sizes.items(), by_size, strict=True)}
    limits = data[layout.limits].reshape(-1, 2).tolist()
    step, given = DEFAULT.stationary * problem.length, problem.request["weights"]
    ends = [np.array(problem.motion.weights(problem.length + side * step)) for side in (1.0, -1.0)]
    by_length = np.where([name in given for name in names], 0.0, (ends[0] - ends[1]) / (2.0 * step))
    return Sensitivity(
        exists=not reasons,
        reasons=tuple(dict.fromkeys(reasons)),
        target=frozen(target),
        tolerance=None if tolerance is None else frozen(tolerance),
        nominal=frozen(nominal),
        limits={name: (low, high) for name, (low, high) in zip(names, limits, strict=True)},
        clearance=clearance,
        keep_out={own.name: x for own, x in zip(task.keep_out, kept, strict=True)},
        weights=dict(zip(names, weights.tolist(), strict=True)),
        length=float(by_length @ weights),
        faces=faces,
        vertices=vertices,
        seeds=seeds,
        sizes=sizes,
        multipliers=balance.multipliers,
        residual=balance.residual,
        **motions,
    )


def _motions(problem: Problem, task: Task, q: Array | None) -> tuple[dict[str, Any], Array]:
    """Return the motion's derivatives by the problem's sizes and the pose of body 1, and the amount's by sizes."""
    fields = [_by_pose(task.movable.seed, k) for k in range(6)]
    fields += [_by_one_size(problem, size) for size in problem.sizes]
    moved, amounts = np.full((len(fields), len(task.weights)), np.nan), np.full(len(fields), np.nan)
    reasons = list[str]()
    if q is not None and _keeps_its_steps(problem, task, q):
        moved = np.zeros_like(moved)
    elif q is not None and (task.amount(q) > 0 or task.joints) and problem.resolution is None:
        nominal = _nominal_features(problem, task) if problem.requirement else ()
        turns = [*np.zeros((3, 3)), *np.eye(3), *np.zeros((len(problem.sizes), 3))]
        changes = [[Change(own, turn=turn)] for own, turn in zip(fields, turns, strict=True)]
        moved, amounts, missing = motion_rates(
            [Holding(task, q, problem.limits)], changes, nominal, problem.target / problem.nominal_pair
        )
        if problem.exact_at is not None and problem.amount == "weighted":
            faces, seed = true_faces(problem.of_facets.movable), task.movable.seed
            still = [3 + k for k in range(3) if faces.of_revolution(seed, np.eye(3)[k]).all()]
            moved[still] = 0.0
            missing = tuple("" if k in still else why for k, why in enumerate(missing))
        names = [f"{verb} {axis}" for verb in ("shifted along", "turned about") for axis in "xyz"]
        names += [size.name for size in problem.sizes]
        for why in dict.fromkeys(filter(None, missing)):
            without = [name for name, own in zip(names, missing, strict=True) if own == why]
            some = f" by {', '.join(without)}" if len(without) < len(names) else ""
            reasons.append(f"no derivative{some}: {why}")
    by_size = {size.name: frozen(own) for size, own in zip(problem.sizes, moved[6:], strict=True)}
    rates = {"motion_by_pose": frozen(moved[:6].T), "motion_by_size": by_size, "motion_reasons": tuple(reasons)}
    return rates, amounts[6:]


def assembly_sensitivity(solution: AssemblySolution) -> AssemblySensitivity:
    """Return the derivatives of an assembly's solution, see `motion_rates`: its contacts are one program.

    Without motions, or with ones that nothing holds, the derivatives do not exist.
    """
    assembly, questions = solution.assembly, solution.assembly.questions
    found = dict(zip([pair[:2] for pair in assembly.contacts], solution.contacts, strict=False))
    problems = [_where_exact(problem, found.get(pair)) for pair, problem in questions.items()]
    tasks = [Task.of(problem) for problem in problems]
    q = np.array([x for own in solution.parameters.values() for x in own.values()])
    changes = [
        [Change(scales=np.array([float(part == own) for own in pair])) for pair in questions] for part in assembly.parts
    ]
    for size in assembly.sizes:
        own = [next((s for s in problem.sizes if s.name == size.name), None) for problem in problems]
        changes.append([
            Change() if s is None else Change(_by_one_size(problem, s))
            for problem, s in zip(problems, own, strict=True)
        ])  # fmt: skip
    moved, reasons = np.full((len(changes), len(tasks[0].weights)), np.nan), list[str]()
    amounts = np.full(len(changes), np.nan)
    if not solution.status.found or not len(q):
        reasons.append("no motion was found")
    elif not q.any():
        reasons.append("the requirement is only just met without motion: derivatives are one-sided")
    elif assembly.resolution:
        reasons.append("the motion is rounded to steps of the machine: the amount changes in jumps")
    else:
        moved, amounts, _ = motion_rates([Holding(task, q, task.limits) for task in tasks], changes)
    if not reasons and np.isnan(moved).any():
        reasons.append("other contacts hold the motion to either side, or more than are needed")
    parts, sizes = [*assembly.parts], [size.name for size in assembly.sizes]
    (by_scale, by_size), (moved_by_scale, moved_by_size) = (np.split(x, [len(parts)]) for x in (amounts + 0.0, moved))
    return AssemblySensitivity(
        exists=not reasons,
        reasons=tuple(reasons),
        parameters=problems[0].motion.names,
        scales=dict(zip(parts, by_scale.tolist(), strict=True)),
        sizes=dict(zip(sizes, by_size.tolist(), strict=True)),
        motion_by_scale=dict(zip(parts, map(frozen, moved_by_scale), strict=True)),
        motion_by_size=dict(zip(sizes, map(frozen, moved_by_size), strict=True)),
    )


def _where_exact(asked: Problem, found: Solution | None) -> Problem:
    """Return the question of two parts that are exact where a solution of their contact has them."""
    points = None if found is None else found.problem.exact_at
    if found is None or points is None:
        return asked
    again = found.problem.reformulated is not found.problem
    return ((again and touching_again(asked)) or asked).with_exact_points(points)


def _by_pose(seed: Array, k: int) -> Field:
    """Return how points move as body 1 is drawn a little further along an axis, or turned about it through its seed."""
    axis = np.eye(3)[k % 3]

    def moves(owner: int, point: Array) -> Array:
        if owner == 2:
            return np.zeros(3)
        return axis if k < 3 else np.cross(axis, point - seed)

    return moves


def _by_one_size(problem: Problem, size: Size) -> Field:
    """Return how the vertices of a body as made move with one of its sizes."""
    body, made, rates = getattr(problem, size.body), _deviations(problem, size.body), _size_rates(problem, size)

    def moves(owner: int, point: Array) -> Array:
        if owner != (1 if size.body == "movable" else 2):
            return np.zeros(3)
        rows = _rows_at(body, point)
        known = None if rates is None or not len(rows) else np.asarray(rates[rows[0]])
        if body.exact is not None and (known is None or np.isnan(known).any()):
            return true_point_rate(body, problem.request[size.body], made, size, point)
        if rates is None:
            return np.full(3, np.nan)
        return known if known is not None else _within_face(body, rates, point)

    return moves


def _rows_at(body: Body, point: Array) -> list[int]:
    """Return which vertices are at a point, corners of the body before those that others were put onto."""
    rows = np.flatnonzero((body.vertices == point).all(axis=1)).tolist()
    return sorted(rows, key=lambda row: row + 1 not in body.corners)


def _within_face(body: Body, rates: Array, point: Array) -> Array:
    """Return how a point moves with the corners of the piece of a face that it is in; nan where it is in none."""
    corners, _ = body.face_triangles
    off = distances(point[None], corners)[:, 0]
    nearest = corners[off.argmin()]
    if off.min() > DEFAULT.nominal * body.size:
        return np.full(3, np.nan)
    rows = [_rows_at(body, corner)[0] for corner in nearest]
    shares = np.linalg.lstsq((nearest[1:] - nearest[0]).T, point - nearest[0])[0]
    return np.asarray(np.append(1.0 - shares.sum(), shares) @ rates[rows])


def _size_rates(problem: Problem, size: Size) -> Array | None:
    """Return how the vertices of a body as made move a unit of one of its sizes, see `vertex_rates`."""
    drawn, body = problem.request[size.body], getattr(problem, size.body)
    made = _deviations(problem, size.body)
    if body.exact is not None:
        return exact_vertex_rates(body, drawn, made, size)
    return vertex_rates(drawn, made, size) if body.faces == drawn.faces else None


def _deviations(problem: Problem, body: str) -> dict[Size, float]:
    """Return the deviations of a body's sizes."""
    return {own: (problem.made or {}).get(own.name, 0.0) for own in problem.sizes if own.body == body}


def by_moves(
    key: str, body: Body, moves: Array, faces: Mapping[str, float], vertices: Mapping[str, Array]
) -> tuple[float, str]:
    """Return the change of the amount, to first order, where vertices of a body move, and which derivatives tell it.

    `moves`, (n, 3), are of all its vertices, `key` is how its labels begin: "P1". `faces` and `vertices` are a
    `Sensitivity`'s; by "faces" where those of the "vertices" tell nothing. nan where there is no derivative.
    """
    change = _summed([vertices[f"{key}V{row}"] for row in range(1, len(moves) + 1)], moves)
    of_faces = np.isnan(change) and body.exact is None  # pieces at points of round faces are of no face of the body
    shifts = _shifts(body, moves) if of_faces else None
    if shifts is not None and np.isfinite(shifts).all():
        labels = [key + ",".join(f"V{label}" for label in face) for face in body.faces]
        return _summed([faces[label] for label in labels], shifts), "faces"
    return change, "vertices"


def _summed(rates: Any, changes: Array) -> float:
    """Return the sum of rates times changes; what does not change needs no rate."""
    rates, changes = np.ravel(np.asarray(rates)), np.ravel(changes)
    used = (changes != 0.0) & (rates != 0.0)
    return float(rates[used] @ changes[used])


def _shifts(body: Body, moves: Array) -> Array:
    """Return how far each face's plane moves outwards, nan where it turns, or where it is not known, (f,)."""
    made = np.full(len(body.faces), np.nan)
    for k, (face, normal) in enumerate(zip(body.faces, body.face_planes[0], strict=True)):
        moved = moves[np.array(face) - 1]
        if not moved.any():
            made[k] = 0.0
        elif normal.any():
            along = moved @ normal
            if np.ptp(along) <= DEFAULT.planarity * body.size:
                made[k] = along.mean()
    return made


def _nominal_rates(problem: Problem, task: Task, reasons: list[str]) -> tuple[Rate, ...]:
    """Return the rates of both nominal scales; none where they are numbers that stay as given."""
    tracked = _nominal_features(problem, task)
    if not tracked:
        return ()
    contact = problem.nominal_contact
    assert isinstance(contact, SwitchingPoint)
    flush = tuple(piece.feature if piece.feature.is_flush else None for piece in contact.pieces)
    free = replace(task, goal="at", tracked=tracked, flush=flush, seats=(), untracked=())
    holding = Holding(free, task.rest, problem.limits)
    rates = holding.at_rest()
    reasons += holding.reasons
    return rates


def _nominal_features(problem: Problem, task: Task) -> tuple[FeaturePoints, ...]:
    """Return the features of the nominal switching point; none where it is a pair of numbers, which stays as given."""
    followed = isinstance(problem.nominal, int) or task.goal in TRACKING
    contact = problem.nominal_contact if followed and not task.joints else None
    if not isinstance(contact, SwitchingPoint):
        return ()
    return tuple(
        feature_points(task.movable, task.static, piece.site, piece.parts, piece.normal, np.eye(3))
        for piece in contact.pieces
    )
