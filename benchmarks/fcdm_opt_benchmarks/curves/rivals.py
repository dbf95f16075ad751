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
from fcdm_opt_benchmarks.curves.rays import ROUNDING, RayTouch, SeededPart, breakpoints, clipped, growth_distance
from fcdm_opt_benchmarks.library import coal_hull, library
from fcdm_opt_benchmarks.method import Ask, CurveAnswer, CurveQuestion, Pair, one_by_one

SIDES = 1e-11  # relative: lines of support are no better known from nearest points of hulls of 10,000 vertices
NEWTON = 60  # steps along one ray at most: each finds a new feature or ends it
PRIMAL = 4  # of HiGHS: its primal simplex method
SLACK = 10.0  # what an interior point method leaves of its answers, in units of its tolerance
Tracer = Callable[[Array, Array], Array]  # of a transform and a box: points by increasing rho_1

Place = Callable[[Array], tuple[Array, Array]]  # of a transform: vertices of part 1 about its seed, turned, and d


def solids(pair: Pair) -> tuple[SeededPart, SeededPart, Place]:
    """Return both parts, and the function from a transform to (p_i, d)."""
    one, two = SeededPart.of(pair.movable), SeededPart.of(pair.static)

    def place(transform: Array) -> tuple[Array, Array]:
        R = transform[:3, :3]
        return one.vertices @ R.T, pair.static.seed - (R @ pair.movable.seed + transform[:3, 3])

    return one, two, place


def _asked(trace: Tracer) -> Ask:
    def answer(question: CurveQuestion) -> CurveAnswer:
        return CurveAnswer(trace(question.transform, question.box))

    return one_by_one(answer)


# ---------------------------------------------------------------------------------------------------- along rays: coal


class _Coal:
    """Both parts about their seeds, in units of their size, for coal; along a ray only the offset changes, no vertex.

    Scaling both bodies by t is moving them nearer by 1 / t.
    """

    def __init__(self, pair: Pair, tolerance: float) -> None:
        self.coal = library("coal")
        self.solids = one, two = SeededPart.of(pair.movable), SeededPart.of(pair.static)
        self.size = max(one.outer, two.outer)
        self.seeds = pair.movable.seed, pair.static.seed
        self.shapes = [coal_hull(solid.vertices / self.size) for solid in (one, two)]
        self._bases = [shape.points().copy() for shape in self.shapes]
        self.poses = self.coal.Transform3s(), self.coal.Transform3s()
        self.collision, self.distance = self.coal.CollisionRequest(), self.coal.DistanceRequest()
        for request in (self.collision, self.distance):
            request.gjk_tolerance = request.epa_tolerance = tolerance
        self.collision.enable_contact = False

    def place(self, transform: Array) -> tuple[Array, float]:
        """Turn body 1; return the way between the seeds, a unit vector and its length."""
        R = transform[:3, :3]
        self.poses[0].setRotation(R)
        d = self.seeds[1] - (R @ self.seeds[0] + transform[:3, 3])
        length = math.sqrt(d @ d)
        return d / length, length / self.size

    def scale(self, ratio: Array) -> tuple[float, float]:
        """Scale both shapes; return bounds of the offset at which they touch."""
        for shape, base, scale in zip(self.shapes, self._bases, ratio, strict=True):
            np.multiply(base, scale, out=shape.points())
        one, two = self.solids
        x, y = ratio.tolist()
        return (x * one.inner + y * two.inner) / self.size, (x * one.outer + y * two.outer) / self.size

    @property
    def placed(self) -> tuple[Any, ...]:
        """Shapes and poses, as coal's queries take them."""
        return self.shapes[0], self.poses[0], self.shapes[1], self.poses[1]


def bisection(pair: Pair, setting: tuple[int, float]) -> Ask:
    """Halve, along rays, the interval between a scale pair that is apart and one that overlaps, asking coal.

    Setting: number of rays, spread over the box, and relative tolerance. The curve is taken as straight in between.
    """
    rays, tolerance = setting
    world = _Coal(pair, tolerance)
    collide, request, result = world.coal.collide, world.collision, world.coal.CollisionResult()

    def trace(transform: Array, box: Array) -> Array:
        way, length = world.place(transform)
        moved, placed, points = world.poses[1], world.placed, []
        (low1, high1), (low2, high2) = box.tolist()
        for angle in np.linspace(math.atan2(high2, low1), math.atan2(low2, high1), rays).tolist():
            ratio = np.array([math.cos(angle), math.sin(angle)])
            inside, outside = world.scale(ratio)
            while outside - inside > tolerance * outside:
                middle = (inside + outside) / 2
                moved.setTranslation(middle * way)
                result.clear()
                if collide(*placed, request, result):
                    inside = middle
                else:
                    outside = middle
            points.append(2 * length / (inside + outside) * ratio)
        return clipped(points, box)

    return _asked(trace)


def distances(pair: Pair, tolerance: float) -> Ask:
    """Follow coal's nearest points along a ray: they give a line of support, which gives a nearer scale pair (Newton).

    The lines of two rays cross where a third one is asked, see `rays.breakpoints`. Setting: coal's tolerance.
    """
    world = _Coal(pair, tolerance)
    measure, request, result = world.coal.distance, world.distance, world.coal.DistanceResult()

    def trace(transform: Array, box: Array) -> Array:
        way, length = world.place(transform)
        moved, placed = world.poses[1], world.placed

        def touch(rho: Array, near: RayTouch | None) -> RayTouch:
            ratio = rho / math.hypot(*rho)
            x, y = ratio.tolist()
            _, offset = world.scale(ratio)
            line = None
            if near is not None:  # its line holds here too: the bodies are apart from there on
                line = near.line
                offset = length * float(line[:2] @ ratio) / float(line[2])
            for _ in range(NEWTON):
                shift = offset * way
                moved.setTranslation(shift)
                result.clear()
                if measure(*placed, request, result) <= tolerance * offset and line is not None:
                    break
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

    return _asked(trace)


def growth(pair: Pair, slack: float) -> Ask:
    """Ask single growth distances, compiled, where the contact lines of two rays cross. Setting: relative tolerance."""
    one, two, place = solids(pair)

    def trace(transform: Array, box: Array) -> Array:
        (P, d), Q = place(transform), two.vertices

        def touch(rho: Array, near: RayTouch | None) -> RayTouch:
            inner = (rho[0] * one.inner + rho[1] * two.inner) / 2
            return growth_distance(P, Q, d, rho, inner, near.pairs if near else None, slack)

        return breakpoints(touch, box, slack)

    return _asked(trace)


# --------------------------------------------------------------------------------------------- least w.rho, for all w


def warm_highs(pair: Pair, tolerance: float) -> Ask:
    """Solve the linear program with HiGHS, changing only the costs: each solution starts from the basis of the last."""
    options = {"presolve": "off", "solver": "simplex", "simplex_strategy": PRIMAL}  # the last basis is still feasible
    return _highs(pair, tolerance, options, warm=True)


def cold_highs(pair: Pair, tolerance: float) -> Ask:
    """Solve each linear program with HiGHS from nothing, by its own choice of presolve and method."""
    return _highs(pair, tolerance, {}, warm=False)


def _highs(pair: Pair, tolerance: float, options: dict[str, Any], *, warm: bool) -> Ask:
    highspy = library("highspy")
    _, two, place = solids(pair)
    solver = highspy.Highs()
    own = {"output_flag": False, "threads": 1, **options}
    own |= {"primal_feasibility_tolerance": tolerance, "dual_feasibility_tolerance": tolerance}
    for key, value in own.items():
        solver.setOptionValue(key, value)
    optimal = highspy.HighsModelStatus.kOptimal

    def trace(transform: Array, box: Array) -> Array:
        P, d = place(transform)
        columns = np.vstack([P, -two.vertices])
        everything, count = np.arange(len(columns), dtype=np.int32), len(P)
        solver.passModel(_model(highspy, columns, d))

        def least(w: Array) -> Array:
            if not warm:
                solver.clearSolver()
            solver.changeColsCost(len(columns), everything, np.repeat(w, [count, len(columns) - count]))
            solver.run()
            if solver.getModelStatus() != optimal:
                raise FcdmError(f"HiGHS: {solver.modelStatusToString(solver.getModelStatus())}")
            # from the basis, not the solver's own sums; a negative entry stands for a row, whose slack is zero
            basis = np.asarray(solver.getBasicVariables()[1])
            system = np.array([columns[k] if k >= 0 else np.eye(3)[-1 - k] for k in basis]).T
            weights = np.linalg.solve(system, d)
            return np.array([weights[(basis >= 0) & (basis < count)].sum(), weights[basis >= count].sum()])

        return by_chords(least, box, ROUNDING)

    return _asked(trace)


def _model(highspy: Any, columns: Array, d: Array) -> Any:
    """Return the linear program, with costs still to be set."""
    model = highspy.HighsLp()
    model.num_col_, model.num_row_ = len(columns), 3
    model.col_cost_ = np.ones(len(columns))
    model.col_lower_, model.col_upper_ = np.zeros(len(columns)), np.full(len(columns), highspy.kHighsInf)
    model.row_lower_ = model.row_upper_ = d
    matrix = model.a_matrix_
    matrix.format_, matrix.num_col_, matrix.num_row_ = highspy.MatrixFormat.kColwise, len(columns), 3
    matrix.start_ = 3 * np.arange(len(columns) + 1, dtype=np.int32)
    matrix.index_ = np.tile(np.arange(3, dtype=np.int32), len(columns))
    matrix.value_ = columns.ravel()
    return model


def clarabel(pair: Pair, tolerance: float) -> Ask:
    """Solve the linear program in cvxpy: pose and costs are parameters, so the model is compiled once (Clarabel)."""
    cvxpy = library("cvxpy")
    library("clarabel")
    one, two, place = solids(pair)
    P, d = cvxpy.Parameter(one.vertices.T.shape), cvxpy.Parameter(3)
    w, high = cvxpy.Parameter(2, nonneg=True), cvxpy.Parameter(2)
    first, second = (cvxpy.Variable(len(solid.vertices), nonneg=True) for solid in (one, two))
    rho = cvxpy.hstack([cvxpy.sum(first), cvxpy.sum(second)])
    # an interior point method needs a bounded set of solutions, also for w = (1, 0): hence the upper ends of the box
    problem = cvxpy.Problem(cvxpy.Minimize(w @ rho), [P @ first - two.vertices.T @ second == d, rho <= high])
    accuracy = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance)
    # compiled here, not with the first question: it knows nothing of the pose
    P.value, d.value, w.value, high.value = one.vertices.T, np.zeros(3), np.ones(2), np.ones(2)
    problem.get_problem_data(cvxpy.CLARABEL)

    def trace(transform: Array, box: Array) -> Array:
        placed, d.value = place(transform)
        P.value, high.value = placed.T, box[:, 1]

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

    return _asked(trace)


def linprog(pair: Pair, tolerance: float) -> Ask:
    """Solve each linear program with scipy's `linprog`, which hands it to HiGHS' dual simplex method."""
    from scipy.optimize import linprog as solve

    _, two, place = solids(pair)
    options = {"primal_feasibility_tolerance": tolerance, "dual_feasibility_tolerance": tolerance}

    def trace(transform: Array, box: Array) -> Array:
        P, d = place(transform)
        system, counts = np.hstack([P.T, -two.vertices.T]), [len(P), len(two.vertices)]

        def least(w: Array) -> Array:
            found = solve(np.repeat(w, counts), A_eq=system, b_eq=d, method="highs-ds", options=options)
            if found.status != 0:
                raise FcdmError(f"linprog: {found.message}")
            return np.array([found.x[: counts[0]].sum(), found.x[counts[0] :].sum()])

        return by_chords(least, box, ROUNDING)

    return _asked(trace)


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
