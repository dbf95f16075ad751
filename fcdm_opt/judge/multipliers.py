"""Whether multipliers of contacts show that no motion of a smaller amount restores them, or does what else is asked.

The Lagrangian |y|^2 / 2 - l . F(y), y = weights * q, is half the square of the amount wherever the contacts are closed,
whatever the multipliers l. Over a box it is bounded from below by its value and slopes at a motion, and by its second
derivatives over the box: where these are positive, by what a least motion costs, exactly. Where l . F(y) is negative
all over the box, nothing closes the contacts there. Goal "fit" leaves gaps between 0 and the largest one: of those with
l > 0 that they are not negative holds the motion, of those with l < 0 that they are no larger. All in intervals. Of
goals "touch" and "clear" there are no equations: see `one_contact`.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.solids import kept_as_surface
from fcdm_opt.judge.one_contact import FAR, ROUNDED, OneContact, lagrangian_bounds
from fcdm_opt.problem.evidence import Multipliers
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Check, Solution
from fcdm_opt.proof.checker import Examiner, filled_box
from fcdm_opt.proof.intervals import Interval, IntervalFunction
from fcdm_opt.proof.uniqueness import equations
from fcdm_opt.tolerances import DEFAULT

MOST_BOXES = 150  # about one contact
MOST_OPEN = 8  # of them, where not one has been shown yet: as where two contacts hold the motion, and not one alone
SHORT = 5e-5  # relative, by which what boxes show may be less than the amount
CLOSED = {"V1F2", "F1V2", "E1E2", "F1F2", "F1E2", "E1F2"}  # contacts, whose equations are all that tracking them asks
ACCURACY = 1e-9  # relative, to which a bound is what is claimed


def shows(solution: Solution, evidence: Multipliers) -> bool:
    """Tell whether multipliers show the lower bound of a solution, see `check_multipliers`."""
    return all(check.passed for check in check_multipliers(solution, evidence))


@np.errstate(all="ignore")  # what has no bound is infinite or nan, and passes no comparison
def check_multipliers(solution: Solution, evidence: Multipliers) -> tuple[Check, ...]:
    """Check that no motion of a smaller weighted amount than the lower bound of a solution does what is asked."""
    # the evidence is taken at its word in nothing
    problem, claimed = solution.problem, solution.lower_bound
    k, n = len(problem.weights), len(evidence.boxes)
    shapes = evidence.boxes.shape == (n, 2, k) and evidence.motions.shape == (n, k) and n > 0
    shapes = shapes and bool((evidence.boxes[:, 0] <= evidence.boxes[:, 1]).all())
    if not (shapes and problem.amount == "weighted" and (problem.contacts or _whole(problem))):
        return (Check("proof well-formed", False, 1.0, 0.0, "not boxes of motions of solids, by weighted amount"),)
    ends, filled = filled_box(evidence.boxes)
    asked = Examiner(problem, None).limits.T * problem.weights
    asked = np.array([np.maximum(asked[0], -claimed), np.minimum(asked[1], claimed)])
    short = float(np.maximum(ends[0] - asked[0], asked[1] - ends[1]).max())
    covered = short <= 0.0 and filled
    q = np.array([*solution.parameters.values()]) if solution.status.found else None
    low, high = evidence.boxes[:, 0], evidence.boxes[:, 1]
    shown = float(_rows_of(problem, q).least(low, high, evidence.motions, claimed)[0].min())
    passed = covered and shown >= claimed * (1.0 - ACCURACY)
    return (
        Check("proof: cover", covered, max(short, float(not filled)), 0.0, "boxes fill all smaller motions"),
        Check("proof: lower bound", bool(passed), shown, claimed, "least amount that the contacts' multipliers leave"),
    )


@np.errstate(all="ignore")
def smallest_by_multipliers(problem: Problem, q: Array) -> tuple[float, Multipliers] | None:
    """Return a bound as large as the amount of a motion about one contact, but for rounding, and boxes that show it."""
    # None where so many do not, and where parts were left out that might matter
    y = problem.weights * q
    amount = float(np.linalg.norm(y))
    if problem.amount != "weighted" or not _whole(problem) or not amount > 0.0:
        return None
    low, high = (Examiner(problem, None).limits.T * problem.weights)[:, None]
    low, high = np.maximum(low, -amount), np.minimum(high, amount)
    rows, motions = _rows_of(problem, q), y[None]
    shown, bound, looked_at = list[tuple[Array, Array]](), amount, 0
    while len(low):
        looked_at += len(low)
        if looked_at > MOST_BOXES or pacing.over():
            return None
        found, places = rows.least(low, high, motions, amount)
        enough = found >= amount * (1.0 - SHORT)
        bound = min(bound, float(found[enough].min(initial=bound)))
        shown += [(np.array([low[k], high[k]]), motions[k]) for k in np.flatnonzero(enough)]
        low, high, motions, places = (own[~enough] for own in (low, high, motions, places))
        if len(low) and not (isinstance(rows, OneContact) and rows.part_pairs):
            return None
        if len(low) >= MOST_OPEN and not shown:
            return None
        if isinstance(rows, OneContact):
            low, high, motions = rows.divided(low, high, motions, places)
    boxes, motions = (np.array(own) for own in zip(*shown, strict=True))
    return bound, Multipliers(boxes=boxes, motions=motions)


def _whole(problem: Problem) -> bool:
    """Whether all parts of both bodies are looked at, and are solids."""
    return not problem.partial and not kept_as_surface(problem.movable, problem.static)


def _rows_of(problem: Problem, q: Array | None) -> _Contacts | OneContact:
    """Return what must be met, or left, about a motion that was found."""
    tracked = problem.goal == "seat" or (problem.goal == "at" and not problem.nominal_seats)
    kinds = {own.kind for own in problem.tracked_features} if tracked else set()
    closed = problem.contacts or (kinds and kinds <= CLOSED)
    return _Contacts(problem, q) if closed else OneContact(problem)


class _Contacts:
    """The gaps of contacts along their normals, or what lies off an edge or a corner, by weighted parameters."""

    def __init__(self, problem: Problem, q: Array | None) -> None:
        import casadi

        k, smooth = len(problem.weights), all(step.smooth for step in problem.motion.steps)
        origin = problem.movable.seed if smooth else np.zeros(3)  # near what turns, intervals are narrow
        y, shift = casadi.SX.sym("y", k), casadi.SX.sym("shift", 3)
        seeds = (casadi.SX(body.seed - origin) for body in (problem.movable, problem.static))
        T = problem.motion.seen_from(origin).symbolic(y / problem.weights, *seeds)
        moved = casadi.vertcat(casadi.horzcat(T[:3, :3], T[:3, 3] + shift), T[3, :])
        rows = casadi.vertcat(*equations(problem, moved, origin))
        normals = casadi.substitute(casadi.jacobian(rows, shift), shift, np.zeros(3))
        rows = casadi.substitute(rows, shift, np.zeros(3))
        here = casadi.Function("normals", [y], [normals])(np.zeros(k)).full()
        lengths = np.linalg.norm(here, axis=1)
        kept = np.flatnonzero(lengths > DEFAULT.nominal * lengths.max()).tolist()  # of an edge, across it
        rows = casadi.vertcat(*(rows[j] / casadi.norm_2(normals[j, :]) for j in kept))
        self._problem, self._smooth, self._fit = problem, smooth, problem.goal == FIT
        self._sides = self._facing(here[kept])
        self._rows = casadi.Function("rows", [y], [rows, casadi.densify(casadi.jacobian(rows, y))])
        self.largest = 0.0
        if self._fit and q is not None:
            gaps = self._sides * self._rows(problem.weights * q)[0].full().ravel()
            self.largest = max(float(gaps.max()), 0.0) + (1.0 - ROUNDED) * problem.size
        weights = casadi.SX.sym("l", rows.numel())
        total = casadi.dot(weights, rows)
        bend, slope = casadi.hessian(total, y)
        out = casadi.densify(casadi.vertcat(total, slope, casadi.vec(bend)))
        self._total = IntervalFunction(casadi.Function("total", [y, weights], [out], {"cse": True}))

    def _facing(self, normals: Array) -> Array:
        """Return for each row of goal "fit" whether it grows as the bodies part, 1, or else -1; 1 of other goals."""
        if not self._fit:
            return np.ones(len(normals))
        known = [joint.normals[0] for joint in self._problem.chosen_joints]
        nearest = [max(known, key=lambda n: abs(n @ own)) for own in normals]
        return np.array([-np.sign(own @ n) for own, n in zip(normals, nearest, strict=True)])

    def least(self, low: Array, high: Array, motions: Array, enough: float) -> tuple[Array, Array]:
        """Return amounts below which no motion in boxes does what is asked, (n,), infinite for none, and motions."""
        # no more is looked for than `enough`
        found = np.zeros(len(low))
        chosen = [self._chosen(*one) for one in zip(low, high, motions, strict=True)]
        for directions in zip(*chosen, strict=True):
            if found.min() < enough:
                found = np.maximum(found, self._bounds(low, high, motions, np.array(directions)))
        return found, motions

    def _chosen(self, low: Array, high: Array, y: Array) -> tuple[Array, ...]:
        """Return multipliers that balance a motion, and such as tell how far equations are from met there."""
        from scipy.optimize import nnls

        values, J = (own.full() for own in self._rows(y))
        values = self._sides * values.ravel()
        J = self._sides[:, None] * J
        ends = self._problem.limits.T * self._problem.weights
        free = (ends[0] < ends[1]) & (y > ends[0]) & (y < ends[1])
        most = np.full(len(values), self.largest if self._fit else 0.0)
        slack = DEFAULT.active * self._problem.size
        held, opened = np.flatnonzero(values <= slack), np.flatnonzero(values >= most - slack)
        shares, _ = nnls(np.vstack([J[held], -J[opened]])[:, free].T, y[free])
        balanced = np.zeros(len(values))
        balanced[held] += shares[: len(held)]
        balanced[opened] -= shares[len(held) :]
        if self._fit:
            return (balanced,)
        off = values - J @ np.linalg.lstsq(J, values, rcond=DEFAULT.nominal)[0]
        far = FAR * max(float((np.maximum(-low, high) ** 2).sum()), DEFAULT.tie)
        return balanced, *(-own * far / max(float(own @ own), 1e-300) for own in (off, values))

    def _bounds(self, low: Array, high: Array, y: Array, multipliers: Array) -> Array:
        """Return such amounts by some multipliers, (n, rows)."""
        k = low.shape[1]
        signed = multipliers * self._sides
        # at the motions, then over the boxes and the ways to them
        n, both = len(low), (np.vstack([y, np.minimum(low, y)]), np.vstack([y, np.maximum(high, y)]))
        given = [Interval(np.tile(signed[:, j], 2)) for j in range(multipliers.shape[1])]
        (found,), jumps = self._total([Interval.between(both[0][:, j], both[1][:, j]) for j in range(k)], given)
        wide = [Interval(*(np.broadcast_to(side, 2 * n) for side in (x.middle, x.radius))) for x in found]
        here, over = [x[:n] for x in wide], [x[n:] for x in wide]
        jumps = np.broadcast_to(np.asarray(jumps), 2 * n)[n:]
        opened = np.maximum(-multipliers, 0.0).sum(axis=1) * self.largest / ROUNDED  # gaps that may be left
        value = here[0] + Interval(opened)
        slope = [here[1 + j] for j in range(k)]
        bend = [[over[1 + k + i * k + j] for j in range(k)] for i in range(k)]
        far = np.maximum(np.maximum(y - low, high - y).T / ROUNDED, 0.0)
        # l . F over the box: by its slopes here and its bends, or by its slopes over the box
        sides = np.array([[own.size for own in row] for row in bend])
        by_bends = sum(own.size * far[j] for j, own in enumerate(slope))
        by_bends = by_bends + 0.5 * np.einsum("in,ijn,jn->n", far, sides, far)
        by_slopes = sum(over[1 + j].size * far[j] for j in range(k))
        closed = np.abs(multipliers).sum(axis=1) * DEFAULT.touch * self._problem.size
        empty = value.high + np.fmin(by_bends, by_slopes) / ROUNDED < -closed  # what nearly closes counts as closed
        amounts = np.where(empty, np.inf, lagrangian_bounds(low, high, y, value, slope, bend))
        return np.where(jumps & (not self._smooth), 0.0, amounts)
