"""The decision curve of a convex pair by rival methods: what it costs without a walk over the Gauss maps.

All of them need both seeds inside their parts. The curve then is one decreasing chain, the lower left boundary of the
convex set of overlapping scale pairs, which can be asked two kinds of question:

- how far is it along a ray of the scale plane: bisection with a collision library, or one growth distance;
- which scale pair minimises w.rho: a linear program in the coordinates of a common point,

      min w.(rho_1, rho_2)   s.t.   sum lambda_i p_i - sum mu_j q_j = d,   lambda, mu >= 0,
      rho_1 = sum lambda, rho_2 = sum mu,   p_i = R (v_i - s_1), q_j = w_j - s_2, d = s_2 - moved s_1.

A method is one function and one row of `RIVALS`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.errors import FcdmError, InputError
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body, rigid_transform
from fcdm_opt.tolerances import DEFAULT

RAYS = 33  # of a bisection
ROUNDING = 1e-12  # relative: scale pairs, and lines, that differ by less are equal to a method that works in floats
TIGHTEST = 1e-10  # feasibility tolerance: HiGHS accepts none below
INTERIOR = 1e-7  # relative: ten times what an interior point method leaves of its answers

Answer = tuple[Array, int]  # scale pairs, and the number of questions asked
Tracer = Callable[[Array, Array], Answer]  # of a rigid transform and a box
Gives = Literal["breakpoints", "samples"]


@dataclass(frozen=True, eq=False)
class Trace:
    """A curve as a rival method gives it.

    Attributes
    ----------
    points : (k, 2) array
        Scale pairs by increasing rho_1, inside the box. Breakpoints: the corners of the curve and its two ends, so that
        the polyline is the curve. Samples: points of the curve, nothing is known in between.
    gives : "breakpoints" or "samples"
    accuracy : float
        What the method claims: relative error along the ray from (0, 0), of points and polyline.
    queries : int
        Questions asked: collision tests, linear programs or growth distances.
    """

    points: Array
    gives: Gives
    accuracy: float
    queries: int


@dataclass(frozen=True)
class Rival:
    """A rival method; call it with two bodies for their curve, or `prepare` it once for many transforms.

    Attributes
    ----------
    name : str
    prepare : callable
        (movable, static) -> function of a transform and a box.
    gives : "breakpoints" or "samples"
    accuracy : float
        See `Trace`.
    """

    name: str
    prepare: Callable[[Body, Body], Tracer]
    gives: Gives
    accuracy: float

    def __call__(
        self, movable: Body, static: Body, *, transform: ArrayLike | None = None, box: Sequence[Sequence[float]]
    ) -> Trace:
        """Return the curve of two bodies of one convex part each, seeds inside.

        Parameters
        ----------
        movable, static : Body
        transform : (4, 4) array, optional
            Rigid pose change of body 1 with its seed.
        box : ((lo, hi), (lo, hi))
            Range of rho_1 and rho_2, positive.

        Raises
        ------
        InputError
            For bodies of several parts and seeds that are not inside.
        FcdmError
            Where the library that the method stands on is not installed.
        """
        points, queries = self.prepare(movable, static)(rigid_transform(transform), np.asarray(box, dtype=np.float64))
        return Trace(frozen(points), self.gives, self.accuracy, queries)


class Solid(NamedTuple):
    """A convex part about its seed: vertices, and radii of the balls about the seed inside and around it."""

    vertices: Array
    inner: float
    outer: float

    @classmethod
    def of(cls, body: Body) -> Solid:
        """Return a body's only part; raise `InputError` for several, or a seed that is not inside."""
        if len(body.parts) != 1:
            raise InputError("the rival methods take one convex part", key=f"body '{body.name}'", found=len(body.parts))
        (part,) = body.parts
        local = part.vertices - part.seed
        inner = (part.normals * local[[loop[0] for loop in part.loops]]).sum(axis=1).min()
        if not inner > 0:
            raise InputError("the rival methods need the seed inside", key=f"body '{body.name}'", found=body.seed)
        return cls(local, float(inner), float(np.linalg.norm(local, axis=1).max()))


def _solids(movable: Body, static: Body) -> tuple[Solid, Solid, Callable[[Array], tuple[Array, Array]]]:
    """Return both parts, and the function from a transform to (p_i, d)."""
    one, two = Solid.of(movable), Solid.of(static)

    def place(transform: Array) -> tuple[Array, Array]:
        R = transform[:3, :3]
        return one.vertices @ R.T, static.seed - (R @ movable.seed + transform[:3, 3])

    return one, two, place


def _library(name: str) -> Any:
    """Import an optional library."""
    try:
        return import_module(name)
    except ImportError as reason:
        raise FcdmError(f"this rival method needs {name}: pip install 'fcdm_opt[bench]' ({reason})") from reason


# ---------------------------------------------------------------------------------------------- how far along a ray


def bisection(movable: Body, static: Body) -> Tracer:
    """Halve, along rays, the interval between a scale pair that is apart and one that overlaps, asking coal.

    Scaling both bodies by t is moving them nearer by 1 / t: along a ray only the offset changes, no vertex.
    """
    coal = _library("coal")
    one, two, _ = _solids(movable, static)
    size = max(one.outer, two.outer)
    shapes, bases = [], []
    for solid in (one, two):
        vectors = coal.StdVec_Vec3s()
        vectors.extend(list(solid.vertices / size))
        shapes.append(coal.Convex.convexHull(vectors, True, "Qt"))
        bases.append(shapes[-1].points().copy())
    poses = coal.Transform3s(), coal.Transform3s()
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    request.gjk_tolerance = request.epa_tolerance = DEFAULT.judge_gjk
    request.enable_contact = False

    def trace(transform: Array, box: Array) -> Answer:
        R = transform[:3, :3]
        poses[0].setRotation(R)
        d = static.seed - (R @ movable.seed + transform[:3, 3])
        way, queries, points = d / np.linalg.norm(d), 0, []
        (low1, high1), (low2, high2) = box
        for angle in np.linspace(np.arctan2(high2, low1), np.arctan2(low2, high1), RAYS):
            ratio = np.array([np.cos(angle), np.sin(angle)])
            for shape, base, scale in zip(shapes, bases, ratio, strict=True):
                np.multiply(base, scale, out=shape.points())
            inside, outside = (ratio @ radii / size for radii in ([one.inner, two.inner], [one.outer, two.outer]))
            while outside - inside > ROUNDING * outside:
                middle = (inside + outside) / 2
                poses[1].setTranslation(middle * way)
                result.clear()
                overlap = coal.collide(shapes[0], poses[0], shapes[1], poses[1], request, result)
                inside, outside = (middle, outside) if overlap else (inside, middle)
                queries += 1
            points.append(np.linalg.norm(d) / size / inside * ratio)
        rows = np.array(points)
        return rows[((rows >= box[:, 0]) & (rows <= box[:, 1])).all(axis=1)], queries

    return trace


class Touch(NamedTuple):
    """Where a ray of the scale plane meets the curve: scale pair, a contact line there, and three vertex pairs.

    The offset d is a sum, with weights that are not negative, of the three scaled differences of those vertices.
    """

    point: Array
    line: Array
    pairs: tuple[tuple[int, int], ...]


def growth(movable: Body, static: Body) -> Tracer:
    """Recur on single growth distances: where the contact lines of two rays cross, a third ray asks for what is there.

    It either meets the crossing, a breakpoint, or a line that neither of them knew: twice the number of segments, less
    one, is all it takes.
    """
    one, two, place = _solids(movable, static)

    def trace(transform: Array, box: Array) -> Answer:
        (P, d), Q = place(transform), two.vertices
        queries = 0

        def touch(rho: Array, near: Touch | None) -> Touch:
            nonlocal queries
            queries += 1
            inner = float(rho[0] * one.inner + rho[1] * two.inner) / 2
            return growth_distance(P, Q, d, rho, inner, near.pairs if near else ())

        def between(left: Touch, right: Touch) -> list[Array]:
            (a, b, c), (e, f, g) = left.line, right.line
            det = a * f - b * e
            if abs(det) <= ROUNDING * np.hypot(a, b) * np.hypot(e, f):
                return []
            corner = np.array([c * f - b * g, a * g - c * e]) / det
            found = touch(corner, left)
            if found.point @ found.point <= (1 + ROUNDING) ** 2 * (corner @ corner):
                return [corner]
            return [*between(left, found), *between(found, right)]

        left = touch(np.array([box[0, 0], box[1, 1]]), None)
        right = touch(np.array([box[0, 1], box[1, 0]]), None)
        return _clipped([left.point, *between(left, right), right.point], box), queries

    return trace


def growth_distance(
    P: Array, Q: Array, d: Array, rho: Array, inner: float, start: Sequence[tuple[int, int]] = ()
) -> Touch:
    """Return where the ray through `rho` meets the curve; on the diagonal, the growth distance of Ong and Gilbert.

    The primal simplex method on three rows: the least s with d in s (rho_1 P - rho_2 Q) is min sum x s.t.
    sum x_k c_k = d, x >= 0, over all differences c = rho_1 p_i - rho_2 q_j. The dual is a direction n, and the best
    column for it is the pair of vertices extreme in n and -n, so that a step costs one pass over the vertices of both
    parts. It starts from three vectors well inside, which are never optimal.

    Parameters
    ----------
    P, Q : (n, 3) arrays
        Vertices about the seeds, world axes.
    d : (3,) array
        Way between the seeds.
    rho : (2,) array
    inner : float
        Less than the radius of a ball about 0 in rho_1 P - rho_2 Q.
    start : sequence of three (i, j), optional
        Vertex pairs of a neighbouring answer, tried first.
    """
    pairs = list(start)
    columns = np.array([rho[0] * P[i] - rho[1] * Q[j] for i, j in pairs]).reshape(-1, 3).T
    if not pairs or np.linalg.cond(columns) > 1 / ROUNDING or np.linalg.solve(columns, d).min() < 0:
        pairs = [(-1, -1)] * 3
        columns = np.diag(np.where(d < 0, -inner, inner))
    for _ in range(len(P) + len(Q) + len(P) * len(Q)):
        weights, n = np.linalg.solve(columns, d), np.linalg.solve(columns.T, np.ones(3))
        first, second = P @ n, Q @ n
        i, j = int(first.argmax()), int(second.argmin())
        if rho[0] * first[i] - rho[1] * second[j] <= 1 + ROUNDING:
            return Touch(weights.sum() * rho, np.array([first[i], -second[j], n @ d]), tuple(pairs))
        entering = rho[0] * P[i] - rho[1] * Q[j]
        change = np.linalg.solve(columns, entering)
        rising = change > ROUNDING * np.abs(change).max()
        leaving = int(np.where(rising, weights / np.where(rising, change, 1.0), np.inf).argmin())
        columns[:, leaving], pairs[leaving] = entering, (i, j)
    raise FcdmError("the simplex method of a growth distance did not end")


# --------------------------------------------------------------------------------------------- least w.rho, for all w


def highs(movable: Body, static: Body) -> Tracer:
    """Solve the linear program with HiGHS, changing only the costs: each solution starts from the basis of the last."""
    highspy = _library("highspy")
    _, two, place = _solids(movable, static)
    solver = highspy.Highs()
    settings = {
        "output_flag": False,
        "presolve": "off",
        "solver": "simplex",
        "simplex_strategy": 4,  # primal: after a change of costs the last basis is still feasible
        "threads": 1,
        "primal_feasibility_tolerance": TIGHTEST,
        "dual_feasibility_tolerance": TIGHTEST,
    }
    for key, value in settings.items():
        solver.setOptionValue(key, value)

    def trace(transform: Array, box: Array) -> Answer:
        P, d = place(transform)
        columns = np.vstack([P, -two.vertices])
        everything, count = np.arange(len(columns), dtype=np.int32), len(P)
        solver.passModel(_model(highspy, columns, d))

        def least(w: Array) -> Array:
            solver.changeColsCost(len(columns), everything, np.repeat(w, [count, len(columns) - count]))
            solver.run()
            if solver.getModelStatus() != highspy.HighsModelStatus.kOptimal:
                raise FcdmError(f"HiGHS: {solver.modelStatusToString(solver.getModelStatus())}")
            # from the basis, not the solver's own sums; a negative entry stands for a row, whose slack is zero
            basis = np.asarray(solver.getBasicVariables()[1])
            system = np.array([columns[k] if k >= 0 else np.eye(3)[-1 - k] for k in basis]).T
            weights = np.linalg.solve(system, d)
            return np.array([weights[(basis >= 0) & (basis < count)].sum(), weights[basis >= count].sum()])

        return _by_chords(least, box, ROUNDING)

    return trace


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


def modelled(movable: Body, static: Body) -> Tracer:
    """Solve the linear program in cvxpy: pose and costs are parameters, so the model is compiled once (Clarabel)."""
    cvxpy = _library("cvxpy")
    _library("clarabel")
    one, two, place = _solids(movable, static)
    P, d = cvxpy.Parameter(one.vertices.T.shape), cvxpy.Parameter(3)
    w, high = cvxpy.Parameter(2, nonneg=True), cvxpy.Parameter(2)
    first, second = (cvxpy.Variable(len(solid.vertices), nonneg=True) for solid in (one, two))
    rho = cvxpy.hstack([cvxpy.sum(first), cvxpy.sum(second)])
    # an interior point method needs a bounded set of solutions, also for w = (1, 0): hence the upper ends of the box
    problem = cvxpy.Problem(cvxpy.Minimize(w @ rho), [P @ first - two.vertices.T @ second == d, rho <= high])

    def trace(transform: Array, box: Array) -> Answer:
        placed, d.value = place(transform)
        P.value, high.value = placed.T, box[:, 1]

        def least(costs: Array) -> Array | None:
            w.value = costs
            problem.solve(solver=cvxpy.CLARABEL)
            if problem.status in ("infeasible", "infeasible_inaccurate"):
                return None
            values: Array = rho.value
            return values

        return _by_chords(least, box, INTERIOR)

    return trace


def _by_chords(least: Callable[[Array], Array | None], box: Array, slack: float) -> Answer:
    """Return the curve from its supporting lines: of each chord ask for the point farthest beyond it.

    Parameters
    ----------
    least : callable
        w -> a scale pair that minimises w.rho, None where no scale pair is allowed.
    box : (2, 2) array
    slack : float
        A chord that nothing exceeds by more than this, relatively, is a segment.
    """
    queries = 2
    first, last = least(np.array([1.0, 0.0])), least(np.array([0.0, 1.0]))
    if first is None or last is None:
        return np.empty((0, 2)), queries

    def between(p: Array, q: Array) -> list[Array]:
        nonlocal queries
        # the curve falls: it stays in the rectangle of its ends
        if p[0] >= box[0, 1] or q[0] <= box[0, 0] or q[1] >= box[1, 1] or p[1] <= box[1, 0]:
            return []
        w = np.maximum([p[1] - q[1], q[0] - p[0]], 0.0)
        if w.sum() <= slack * (p + q).sum():
            return []
        w /= w.sum()
        queries += 1
        found = least(w)
        if found is None or w @ found >= (1 - slack) * (w @ p) or not 0 < (found - p) @ (q - p) < (q - p) @ (q - p):
            return []  # nothing beyond the chord, or, within the solver's errors, another point of the segment it is in
        return [*between(p, found), found, *between(found, q)]

    return _clipped([first, *between(first, last), last], box), queries


def _clipped(polyline: list[Array], box: Array) -> Array:
    """Return the part of a falling polyline inside the box; stretches along its lower borders belong to no curve."""
    points: list[Array] = []
    for p, q in pairwise(polyline):
        travel = q - p
        lo, hi = 0.0, 1.0
        for axis in range(2):
            if travel[axis] == 0:
                lo, hi = (lo, hi) if box[axis, 0] < p[axis] < box[axis, 1] else (1.0, 0.0)
                continue
            s, t = sorted((box[axis] - p[axis]) / travel[axis])
            lo, hi = max(lo, s), min(hi, t)
        if hi > lo:
            start, end = p + lo * travel, p + hi * travel
            points += [start, end] if not points else [end]
    return np.array(points).reshape(-1, 2)


RIVALS = {
    rival.name: rival
    for rival in (
        Rival("coal bisection", bisection, "samples", DEFAULT.nominal),
        Rival("highs", highs, "breakpoints", DEFAULT.nominal),
        Rival("cvxpy", modelled, "breakpoints", DEFAULT.snap),
        Rival("growth distances", growth, "breakpoints", DEFAULT.nominal),
    )
}
