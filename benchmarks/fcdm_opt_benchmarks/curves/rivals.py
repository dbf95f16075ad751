"""Rival ways to the decision curve of a convex pair: a collision library, linear programs, single growth distances.

With both seeds inside, the curve is one decreasing chain, the lower left boundary of the convex set of scale pairs that
overlap. It can be asked two kinds of question:

- what is there along a ray of the scale plane: bisection, Newton steps on distances, or one growth distance (`rays`);
- which scale pair minimises w.rho: a linear program in the coordinates of a common point,

      min w.(rho_1, rho_2)   s.t.   sum lambda_i p_i - sum mu_j q_j = d,   lambda, mu >= 0,
      rho_1 = sum lambda, rho_2 = sum mu,   p_i = R (v_i - s_1), q_j = w_j - s_2, d = s_2 - moved s_1.

Each function prepares a pair at one of its accuracy settings and gives what answers questions about it (`Method`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from fcdm_opt.errors import FcdmError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt_benchmarks.coal_shapes import CoalHulls
from fcdm_opt_benchmarks.curves.rays import ROUNDING, RayTouch, breakpoints, clipped, growth_distance
from fcdm_opt_benchmarks.library import (
    PRIMAL,
    basic_weights,
    dense,
    highs_model,
    highs_solver,
    library,
    solved_by_highs,
)
from fcdm_opt_benchmarks.method import Ask, CurveAnswer, CurveQuestion, Pair, one_by_one
from fcdm_opt_benchmarks.placed import Placed

SIDES = 1e-11  # relative: lines of support are no better known from nearest points of hulls of 10,000 vertices
NEWTON = 60  # steps along one ray at most: each finds a new feature or ends it
SLACK = 10.0  # what an interior point method leaves of its answers, in units of its tolerance
Tracer = Callable[[Array, Array, Array], Array]  # of R, the way between the seeds, and a box: points by rho_1


def _asked(placed: Placed, trace: Tracer) -> Ask:
    def answer(question: CurveQuestion) -> CurveAnswer:
        return CurveAnswer(trace(*placed.pose(question.transform), question.box))

    return one_by_one(answer)


# ---------------------------------------------------------------------------------------------------- along rays: coal

# Along a ray only the offset changes, no vertex: scaling both bodies by t is moving them nearer by 1 / t.


def bisection(pair: Pair, setting: tuple[int, float]) -> Ask:
    """Halve, along rays, the interval between a scale pair that is apart and one that overlaps, asking coal.

    Setting: number of rays, spread over the box, and relative tolerance. The curve is taken as straight in between.
    """
    rays, tolerance = setting
    placed = Placed.of(pair)
    one, two = placed.one, placed.two
    hulls = CoalHulls(one.vertices, two.vertices, tolerance)

    def trace(R: Array, d: Array, box: Array) -> Array:
        hulls.turn(R)
        length, points = math.sqrt(d @ d), []
        way = d / length
        (low1, high1), (low2, high2) = box.tolist()
        for angle in np.linspace(math.atan2(high2, low1), math.atan2(low2, high1), rays).tolist():
            x, y = math.cos(angle), math.sin(angle)
            hulls.scale(0, x)
            hulls.scale(1, y)
            inside, outside = x * one.inner + y * two.inner, x * one.outer + y * two.outer
            while outside - inside > tolerance * outside:
                middle = (inside + outside) / 2
                hulls.shift(middle * way)
                inside, outside = (middle, outside) if hulls.overlap() else (inside, middle)
            points.append(2 * length / (inside + outside) * np.array([x, y]))
        return clipped(points, box)

    return _asked(placed, trace)


def distances(pair: Pair, tolerance: float) -> Ask:
    """Follow coal's nearest points along a ray: they give a line of support, which gives a nearer scale pair (Newton).

    The lines of two rays cross where a third one is asked, see `rays.breakpoints`. Setting: coal's tolerance.
    """
    placed = Placed.of(pair)
    hulls = CoalHulls(placed.one.vertices, placed.two.vertices, tolerance)

    def trace(R: Array, d: Array, box: Array) -> Array:
        hulls.turn(R)
        length = math.sqrt(d @ d)
        way = d / length

        def touch(rho: Array, near: RayTouch | None) -> RayTouch:
            ratio = rho / math.hypot(*rho)
            x, y = ratio.tolist()
            hulls.scale(0, x)
            hulls.scale(1, y)
            line, offset = None, x * placed.one.outer + y * placed.two.outer
            if near is not None:  # its line holds here too: the bodies are apart from there on
                line = near.line
                offset = length * float(line[:2] @ ratio) / float(line[2])
            for _ in range(NEWTON):
                shift = offset * way
                hulls.shift(shift)
                if hulls.gap() <= tolerance * offset and line is not None:
                    break
                result = hulls.result
                n = result.normal
                a = float(n @ result.getNearestPoint1()) / x
                b = -float(n @ (result.getNearestPoint2() - shift)) / y
                c = float(n @ way)
                nearer = (a * x + b * y) / c
                if not 0 < nearer < offset:
                    break
                line, offset = np.array([a, b, c * length]), nearer
            if line is None:
                raise FcdmError("coal gives no direction that separates")
            return RayTouch(length / offset * ratio, line)

        return breakpoints(touch, box, max(tolerance, SIDES))

    return _asked(placed, trace)


def growth(pair: Pair, slack: float) -> Ask:
    """Ask single growth distances, compiled, where the contact lines of two rays cross. Setting: relative tolerance."""
    placed = Placed.of(pair)
    one, two = placed.one, placed.two

    def trace(R: Array, d: Array, box: Array) -> Array:
        P, Q = np.ascontiguousarray(one.vertices @ R.T), two.vertices

        def touch(rho: Array, near: RayTouch | None) -> RayTouch:
            inner = (rho[0] * one.inner + rho[1] * two.inner) / 2
            return growth_distance(P, Q, d, rho, inner, near.pairs if near else None, slack)

        return breakpoints(touch, box, slack)

    return _asked(placed, trace)


# --------------------------------------------------------------------------------------------- least w.rho, for all w


def warm_highs(pair: Pair, tolerance: float) -> Ask:
    """Solve the linear program with HiGHS, changing only the costs: each solution starts from the basis of the last."""
    options = {"presolve": "off", "solver": "simplex", "simplex_strategy": PRIMAL}  # the last basis is still feasible
    return _highs(pair, highs_solver(tolerance, **options), warm=True)


def cold_highs(pair: Pair, tolerance: float) -> Ask:
    """Solve each linear program with HiGHS from nothing, by its own choice of presolve and method."""
    return _highs(pair, highs_solver(tolerance), warm=False)


def _highs(pair: Pair, solver: Any, *, warm: bool) -> Ask:
    placed = Placed.of(pair)
    one, two = placed.one, placed.two
    counts = len(one.vertices), len(two.vertices)
    everything = np.arange(sum(counts), dtype=np.int32)

    def trace(R: Array, d: Array, box: Array) -> Array:
        columns = np.vstack([one.vertices @ R.T, -two.vertices])
        solver.passModel(highs_model(dense(columns.T), np.ones(len(columns)), (d, d)))

        def least(w: Array) -> Array:
            if not warm:
                solver.clearSolver()
            solver.changeColsCost(len(columns), everything, np.repeat(w, counts))
            solved_by_highs(solver)
            basis, weights = basic_weights(solver, columns, d)
            first = (basis >= 0) & (basis < counts[0])
            return np.array([weights[first].sum(), weights[basis >= counts[0]].sum()])

        return by_chords(least, box, ROUNDING)

    return _asked(placed, trace)


def clarabel(pair: Pair, tolerance: float) -> Ask:
    """Solve the linear program in cvxpy: pose and costs are parameters, so the model is compiled once (Clarabel)."""
    cvxpy = library("cvxpy")
    library("clarabel")
    placed = Placed.of(pair)
    one, two = placed.one, placed.two
    P, d = cvxpy.Parameter(one.vertices.T.shape), cvxpy.Parameter(3)
    w, high = cvxpy.Parameter(2, nonneg=True), cvxpy.Parameter(2)
    first, second = (cvxpy.Variable(len(part.vertices), nonneg=True) for part in (one, two))
    rho = cvxpy.hstack([cvxpy.sum(first), cvxpy.sum(second)])
    # an interior point method needs a bounded set of solutions, also for w = (1, 0): hence the upper ends of the box
    problem = cvxpy.Problem(cvxpy.Minimize(w @ rho), [P @ first - two.vertices.T @ second == d, rho <= high])
    accuracy = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance)
    # compiled here, not with the first question: it knows nothing of the pose
    P.value, d.value, w.value, high.value = one.vertices.T, np.zeros(3), np.ones(2), np.ones(2)
    problem.get_problem_data(cvxpy.CLARABEL)

    def trace(R: Array, way: Array, box: Array) -> Array:
        P.value, d.value, high.value = R @ one.vertices.T, way, box[:, 1]

        def least(costs: Array) -> Array | None:
            w.value = costs
            problem.solve(solver=cvxpy.CLARABEL, **accuracy)
            if problem.status in ("infeasible", "infeasible_inaccurate"):
                return None
            if problem.status not in ("optimal", "optimal_inaccurate"):
                raise FcdmError(f"Clarabel: {problem.status}")
            values: Array = rho.value
            return values

        return by_chords(least, box, SLACK * tolerance)

    return _asked(placed, trace)


def linprog(pair: Pair, tolerance: float) -> Ask:
    """Solve each linear program with scipy's `linprog`, which hands it to HiGHS' dual simplex method."""
    from scipy.optimize import linprog as solve

    placed = Placed.of(pair)
    one, two = placed.one.vertices, placed.two.vertices
    options = {"primal_feasibility_tolerance": tolerance, "dual_feasibility_tolerance": tolerance}

    def trace(R: Array, d: Array, box: Array) -> Array:
        system, counts = np.hstack([R @ one.T, -two.T]), [len(one), len(two)]

        def least(w: Array) -> Array:
            found = solve(np.repeat(w, counts), A_eq=system, b_eq=d, method="highs-ds", options=options)
            if found.status != 0:
                raise FcdmError(f"linprog: {found.message}")
            return np.array([found.x[: counts[0]].sum(), found.x[counts[0] :].sum()])

        return by_chords(least, box, ROUNDING)

    return _asked(placed, trace)


def by_chords(least: Callable[[Array], Array | None], box: Array, slack: float) -> Array:
    """Return the curve from its supporting lines: of each chord ask for the point farthest beyond it.

    Parameters
    ----------
    least : callable
        w -> a scale pair that minimises w.rho, None where no scale pair is allowed.
    box : (2, 2) array
    slack : float
        A chord that nothing exceeds by more than this, relatively, is a segment.
    """
    first, last = least(np.array([1.0, 0.0])), least(np.array([0.0, 1.0]))
    if first is None or last is None:
        return np.empty((0, 2))

    def between(p: Array, q: Array) -> list[Array]:
        # the curve falls: it stays in the rectangle of its ends
        if p[0] >= box[0, 1] or q[0] <= box[0, 0] or q[1] >= box[1, 1] or p[1] <= box[1, 0]:
            return []
        w = np.maximum([p[1] - q[1], q[0] - p[0]], 0.0)
        if w.sum() <= slack * (p + q).sum():
            return []
        w /= w.sum()
        found = least(w)
        if found is None or w @ found >= (1 - slack) * (w @ p) or not 0 < (found - p) @ (q - p) < (q - p) @ (q - p):
            return []  # nothing beyond the chord, or, within the solver's errors, another point of the segment it is in
        return [*between(p, found), found, *between(found, q)]

    return clipped([first, *between(first, last), last], box)
