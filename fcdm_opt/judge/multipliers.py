"""Whether multipliers of contacts' equations show that no motion of a smaller amount restores the contacts.

The Lagrangian |y|^2 / 2 - l . F(y), y = weights * q, is half the square of the amount wherever the contacts are closed,
whatever the multipliers l. Over a box it is bounded from below by its value and slopes at a motion, and by its second
derivatives over the box: where these are positive, by what a least motion costs, exactly. Where l . F(y) is negative
all over the box, nothing closes the contacts there. Goal "fit" leaves gaps between 0 and the largest one: of those with
l > 0 that they are not negative holds the motion, of those with l < 0 that they are no larger. So do the gaps of parts
that must not overlap, where nothing turns and all motions of the boxes leave them one direction to be apart in.
All in intervals.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.solids import kept_as_surface
from fcdm_opt.judge.only_motion import equations
from fcdm_opt.problem.evidence import Multipliers
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Check, Solution
from fcdm_opt.proof.checker import left_over, searched_limits
from fcdm_opt.proof.intervals import Interval, IntervalFunction
from fcdm_opt.tolerances import DEFAULT

ROUNDED = 1.0 - 2.0**-44  # more than the rounding of the sums taken in floats here
FAR = 8.0  # squares of a box's size that a multiplier which excludes it is worth
ALIKE = 13  # digits in which directions are the same
MOST_CROSSED = 40_000  # pairs of edges of two parts, whose directions are looked at
ACCURACY = 1e-9  # relative, to which a bound is what is claimed


def shows(solution: Solution, evidence: Multipliers) -> bool:
    """Tell whether multipliers show the lower bound of a solution, see `check_multipliers`."""
    return all(check.passed for check in check_multipliers(solution, evidence))


@np.errstate(all="ignore")  # what has no bound is infinite or nan, and passes no comparison
def check_multipliers(solution: Solution, evidence: Multipliers) -> tuple[Check, ...]:
    """Check that no motion of a smaller weighted amount than the lower bound of a solution does what is asked.

    Parameters
    ----------
    solution : Solution
        Of several contacts that are restored together.
    evidence : Multipliers
        Taken at its word in nothing.
    """
    problem, claimed = solution.problem, solution.lower_bound
    k, n = len(problem.weights), len(evidence.boxes)
    shapes = evidence.boxes.shape == (n, 2, k) and evidence.motions.shape == (n, k) and n > 0
    if not (shapes and problem.contacts and problem.amount == "weighted"):
        return (Check("proof well-formed", False, 1.0, 0.0, "not boxes of motions of several contacts"),)
    low, high = evidence.boxes[:, 0], evidence.boxes[:, 1]
    ends = np.array([low.min(axis=0), high.max(axis=0)])
    asked = searched_limits(problem).T * problem.weights
    asked = np.array([np.maximum(asked[0], -claimed), np.minimum(asked[1], claimed)])
    short = float(np.maximum(ends[0] - asked[0], asked[1] - ends[1]).max())
    wrong = left_over(
        np.zeros(n + 1, np.int64), np.vstack([low, ends[:1]]), np.vstack([high, ends[1:]]), np.append(np.ones(n), -1.0)
    )
    covered = short <= 0.0 and wrong is None
    shown = float(_Contacts(problem, solution, ends).least(low, high, evidence.motions, claimed).min())
    passed = covered and shown >= claimed * (1.0 - ACCURACY)
    return (
        Check("proof: cover", covered, max(short, float(wrong is not None)), 0.0, "boxes fill all smaller motions"),
        Check("proof: lower bound", bool(passed), shown, claimed, "least amount that the contacts' multipliers leave"),
    )


class _Contacts:
    """The gaps of contacts along their normals, or what lies off an edge or a corner, by weighted parameters."""

    def __init__(self, problem: Problem, solution: Solution, ends: Array) -> None:
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
        surfaces = kept_as_surface(problem.movable, problem.static)
        apart = _single_ways(problem, ends) if problem.motion.shifts and not surfaces else []
        rows = casadi.vertcat(
            *(rows[j] / casadi.norm_2(normals[j, :]) for j in kept),
            *(level - casadi.dot(casadi.SX(n), T[:3, 3]) for n, level in apart),
        )
        self._problem, self._smooth, self._fit = problem, smooth, problem.goal == FIT
        self._sides = np.append(self._facing(here[kept]), np.ones(len(apart)))
        self._listed = len(kept)
        self._rows = casadi.Function("rows", [y], [rows, casadi.densify(casadi.jacobian(rows, y))])
        self.largest = 0.0
        if self._fit and solution.status.found:
            q = np.array(list(solution.parameters.values()))
            gaps = self._sides * self._rows(problem.weights * q)[0].full().ravel()
            self.largest = max(float(gaps[: self._listed].max()), 0.0) + (1.0 - ROUNDED) * problem.size
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

    def least(self, low: Array, high: Array, motions: Array, enough: float) -> Array:
        """Return amounts below which no motion in boxes does what is asked, (n,); infinite where none does at all.

        No more is looked for than `enough`.
        """
        found = np.zeros(len(low))
        chosen = [self._chosen(*one) for one in zip(low, high, motions, strict=True)]
        for ways in zip(*chosen, strict=True):
            if found.min() < enough:
                found = np.maximum(found, self._bounds(low, high, motions, np.array(ways)))
        return found

    def _chosen(self, low: Array, high: Array, y: Array) -> tuple[Array, ...]:
        """Return multipliers that balance a motion, and such as tell how far equations are from met there."""
        from scipy.optimize import nnls

        values, J = (own.full() for own in self._rows(y))
        values = self._sides * values.ravel()
        J = self._sides[:, None] * J
        ends = self._problem.limits.T * self._problem.weights
        free = (ends[0] < ends[1]) & (y > ends[0]) & (y < ends[1])
        most = np.full(len(values), self.largest if self._fit else 0.0)
        most[self._listed :] = np.inf
        slack = DEFAULT.active * self._problem.size
        held, opened = np.flatnonzero(values <= slack), np.flatnonzero(values >= most - slack)
        shares, _ = nnls(np.vstack([J[held], -J[opened]])[:, free].T, y[free])
        balanced = np.zeros(len(values))
        balanced[held] += shares[: len(held)]
        balanced[opened] -= shares[len(held) :]
        if self._fit:
            return (balanced,)
        values[self._listed :], J[self._listed :] = 0.0, 0.0
        off = values - J @ np.linalg.lstsq(J, values, rcond=DEFAULT.nominal)[0]
        far = FAR * max(float((np.maximum(-low, high) ** 2).sum()), DEFAULT.tie)
        return balanced, *(-own * far / max(float(own @ own), 1e-300) for own in (off, values))

    def _bounds(self, low: Array, high: Array, y: Array, ways: Array) -> Array:
        """Return such amounts by some multipliers, (n, rows)."""
        k = low.shape[1]
        signed = ways * self._sides
        # at the motions, then over the boxes and the ways to them
        n, both = len(low), (np.vstack([y, np.minimum(low, y)]), np.vstack([y, np.maximum(high, y)]))
        given = [Interval(np.tile(signed[:, j], 2)) for j in range(ways.shape[1])]
        (found,), jumps = self._total([Interval.between(both[0][:, j], both[1][:, j]) for j in range(k)], given)
        wide = [Interval(*(np.broadcast_to(side, 2 * n) for side in (x.middle, x.radius))) for x in found]
        here, over = [x[:n] for x in wide], [x[n:] for x in wide]
        jumps = np.broadcast_to(np.asarray(jumps), 2 * n)[n:]
        opened = np.maximum(-ways, 0.0).sum(axis=1) * self.largest / ROUNDED  # gaps that may be left
        value = here[0] + Interval(opened)
        slope = [here[1 + j] for j in range(k)]
        bend = [[over[1 + k + i * k + j] for j in range(k)] for i in range(k)]
        below, above = (low - y).T / ROUNDED, (high - y).T / ROUNDED
        far = np.maximum(np.maximum(-below, above), 0.0)
        # l . F over the box: by its slopes here and its bends, or by its slopes over the box
        sides = np.array([[own.size for own in row] for row in bend])
        by_bends = sum(own.size * far[j] for j, own in enumerate(slope))
        by_bends = by_bends + 0.5 * np.einsum("in,ijn,jn->n", far, sides, far)
        by_slopes = sum(over[1 + j].size * far[j] for j in range(k))
        closed = np.abs(ways[:, : self._listed]).sum(axis=1) * DEFAULT.touch * self._problem.size
        empty = value.high + np.fmin(by_bends, by_slopes) / ROUNDED < -closed  # what nearly closes counts as closed
        # the Lagrangian: its second derivatives are no less than `least` by Gershgorin's discs
        total = Interval(0.5) * sum((Interval(y[:, j]).square() for j in range(k)), Interval(0.0)) - value
        level = np.array(total.low)
        for j in range(k):
            rest = sides[j].sum(axis=0) - sides[j, j]
            least = (1.0 - bend[j][j].high - rest / ROUNDED) * ROUNDED
            steep = Interval(y[:, j]) - slope[j]
            ahead = _lowest(steep.low, np.maximum(below[j], 0.0), above[j], least)
            level = level + np.minimum(ahead, _lowest(-steep.high, np.maximum(-above[j], 0.0), -below[j], least))
        amounts = np.sqrt(np.maximum(2.0 * level, 0.0)) * ROUNDED
        amounts = np.where(np.isfinite(amounts), amounts, 0.0)
        largest = np.sqrt((np.maximum(-low, high) ** 2).sum(axis=1)) / ROUNDED
        amounts = np.where(empty | (amounts > largest), np.inf, amounts)
        return np.where(jumps & (not self._smooth), 0.0, amounts)


def _lowest(rate: Array, start: Array, end: Array, bend: Array) -> Array:
    """Return lower bounds of rate d + bend d^2 / 2 for d from `start` to `end`, infinite where that is not ahead."""
    turn = np.clip(np.where(bend > 0.0, -rate / bend, start), start, np.maximum(end, start))
    found = [(rate * d, 0.5 * bend * d * d) for d in (start, end, turn)]
    values = [one + two - (1.0 - ROUNDED) * (np.abs(one) + np.abs(two)) for one, two in found]
    return np.where(end >= start, np.min(values, axis=0), np.inf)


def _single_ways(problem: Problem, ends: Array) -> list[tuple[Array, float]]:
    """Return what keeps parts apart after all shifts of a box: a direction and the gap along it at rest, of each pair.

    Convex parts are apart along a normal of a face of either or across two edges; of pairs to which all shifts leave
    one of these at most, that one. They shift from rest by no more than the box lets them.
    """
    ways = problem.motion.ways(problem.movable.seed, problem.static.seed)
    reach = float((np.abs(ends).max(axis=0) / problem.weights) @ np.linalg.norm(ways, axis=1)) / ROUNDED
    seed, (own, other) = problem.movable.seed, problem.target
    opponents = [(part, problem.static.seed, other) for part in problem.static.parts]
    opponents += [(part, part.seed, scale) for keep_out in problem.keep_out for part, scale in keep_out.obstacles]
    found = []
    for one in problem.movable.parts:
        X = seed + own * (one.vertices - seed)
        for two, datum, scale in opponents:
            Y = datum + scale * (two.vertices - datum)
            sides = [np.diff(part.vertices[part.edges[:, :2]], axis=1)[:, 0] for part in (one, two)]
            if len(sides[0]) * len(sides[1]) > MOST_CROSSED:
                continue
            across = np.cross(sides[0][:, None], sides[1][None]).reshape(-1, 3)
            lengths = np.linalg.norm(across, axis=1)
            across = across[lengths > DEFAULT.planarity * lengths.max()]
            across /= np.linalg.norm(across, axis=1)[:, None]
            normals = np.vstack([one.normals, -two.normals, across, -across])
            gaps = (Y @ normals.T).min(axis=0) - (X @ normals.T).max(axis=0)
            some = np.unique(np.round(normals[gaps + reach >= 0.0], ALIKE), axis=0)
            if len(some) == 1 and gaps.max() - reach <= 0.0:
                best = int(gaps.argmax())
                found.append((normals[best], float(gaps[best]) + 2.0 * 10.0**-ALIKE * problem.size))
    return found
