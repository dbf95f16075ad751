"""The full model: everything that a problem asks in one nonlinear program, nothing left out, from one start.

The yardstick for the stages that model no more than the scene needs: where it converges, answers must agree. Variables
are the parameters; one separating plane for each part pair that must not overlap (of the parts made, at the end; of the
tracked contact's other pairs, at each point of the way); where bodies that are apart must touch, the weights of the
vertices whose common point they touch in; and the largest displacement where that is the amount. The tracked features
are the contact at a point of the way if their planes keep all vertices of both parts on their own sides and the point
lies in both elements: rows for every vertex and every side.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.kernels import E1E2, F1V2
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.bounds import displacement_bound
from fcdm_opt.model.equations import OWNERS, FeaturePoints, SymbolicPose, intersection
from fcdm_opt.model.task import Answer, Parts, Task
from fcdm_opt.model.templates import timed
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.solution import Status
from fcdm_opt.tolerances import DEFAULT

INF = float("inf")
PATIENCE = 10.0  # seconds of one program
CLOSINGS = 4  # part pairs tried that may be the one to touch, nearest first
TRIALS = 3  # motions at which a row must vanish to be taken for one that always does


class InFull(NamedTuple):
    """What the full model gives: parameters (None where it did not converge), its counts, evaluations of its rows."""

    q: Array | None
    modelled: dict[str, int]
    evaluations: int


def full(task: Task) -> Answer | None:
    """Solve the full model; None where it does not converge, and for flush contacts, for which it has no rows."""
    if task.seats or any(task.flush):
        return None
    outcome = modelled_in_full(task)
    if outcome.q is None or not task.meets(outcome.q, DEFAULT.requirement):
        return None
    q = outcome.q
    bound = min(displacement_bound(task), task.amount(q))
    return Answer(Status.SOLVED, q, "full model, IPOPT from one start", bound, ("everything",), outcome.modelled)


def modelled_in_full(task: Task, *, tolerance: float = DEFAULT.solver) -> InFull:
    """Solve the full model as it is, once for each part pair that may be the one to touch; the least counts.

    Parameters
    ----------
    task : Task
    tolerance : float
        Of IPOPT, scaled rows and stationarity.
    """
    asks = bool(np.isfinite(task.needs).any())
    gaps = task.pair_gaps(task.start) if asks else np.full((1, 1), INF)
    closings: list[Parts | None] = [None]
    if task.must_touch and task.contact_gap(gaps) > 0:
        pairs = list(np.ndindex(len(task.movable.parts), len(task.static.parts)))
        closings = [*sorted(pairs, key=lambda parts: float(gaps[parts]))[:CLOSINGS]]
    best, evaluations, counts = None, 0, dict[str, int]()
    for closing in closings:
        program = _Program(task)
        program.build(closing)
        q, asked = program.solve(tolerance)
        evaluations, counts = evaluations + asked, program.modelled
        if q is not None and (best is None or task.amount(q) < task.amount(best)):
            best = q
    return InFull(best, counts, evaluations)


@dataclass(eq=False)
class _Program:
    """One nonlinear program under construction: symbols with their starts, rows with their limits."""

    task: Task
    symbols: list[Any] = field(default_factory=list)
    starts: list[Array] = field(default_factory=list)
    limits: list[Array] = field(default_factory=list)
    rows: list[Any] = field(default_factory=list)
    ranges: list[tuple[Array, Array]] = field(default_factory=list)
    planes: int = 0

    # --------------------------------------------------------------------------------------------------- variables

    def build(self, closing: Parts | None) -> None:
        """Write everything that the task asks; `closing`: the pair that must touch, where bodies are apart."""
        task = self.task
        self.z = self._variable("z", task.start / task.steps, task.limits / task.steps[:, None])
        if task.tracked:
            self._goal()
            self._way()
        pose = task.pose(task.start)
        for i, j in np.ndindex(len(task.movable.parts), len(task.opponents)):
            opponent = task.opponents[j]
            if np.isfinite(opponent.need):
                _, rows, gaps = task.separations((i, j), pose)
                self._kept_apart((i, j), rows[int(np.argmax(gaps)), :3], opponent.need)
        if closing is not None:
            self._touching(closing)
        self.objective = self._amount()

    def _amount(self) -> Any:
        """Return what is made least: the square of the amount, in typical amounts, or the user's own expression."""
        import casadi

        task = self.task
        if isinstance(task.amount_kind, OwnAmount):
            value = task.amount_kind.function(task.steps * self.z)
            return value if task.amount_kind.is_smooth_at_rest else value**2
        if task.weighted:
            return casadi.sumsqr(task.steps * task.weights / task.unit * self.z)
        moved = self._moved()
        ways = [casadi.sumsqr((moved.scene.moved(x) - x) / task.unit) for x in task.made_vertices]
        largest = self._variable("largest", np.array([(task.amount(task.start) / task.unit) ** 2]))
        self._add(self._at_end(moved, casadi.vertcat(*ways)) - largest, -INF, 0.0)
        return largest

    def _variable(self, name: str, start: Array, limits: Array | None = None) -> Any:
        import casadi

        symbol = casadi.MX.sym(name, len(start))
        self.symbols.append(symbol)
        self.starts.append(np.asarray(start, dtype=np.float64))
        self.limits.append(np.tile([-INF, INF], (len(start), 1)) if limits is None else limits)
        return symbol

    def _add(self, rows: Any, lower: float, upper: float) -> None:
        import casadi

        rows = casadi.vec(rows)
        self.rows.append(rows)
        self.ranges.append((np.full(rows.numel(), lower), np.full(rows.numel(), upper)))

    # ------------------------------------------------------------------------------------------------------- rows

    def _goal(self) -> None:
        task = self.task
        moved = self._moved()
        if len(task.tracked) == 1:
            a, b, c, n = moved.scene.line(task.tracked[0].kind, task.tracked[0].values)
            row = (a * task.target[0] + b * task.target[1] - c) / (moved.length(n) * task.unit)
            self._add(self._at_end(moved, row), 0.0, 0.0)
            return
        change = max(np.abs(task.target - task.nominal).max(), DEFAULT.least_unit)
        signs = np.where(task.signs == 0, 1.0, task.signs)
        band = 0.0 if len(task.weights) >= 2 else DEFAULT.solver  # solvers refuse more equations than parameters
        lower, upper = (0.0, INF) if task.goal == "beyond" else (-band, band)
        self._add(self._at_end(moved, (moved.pair - task.target) * signs / change), lower, upper)

    def _way(self) -> None:
        """Keep the tracked features the contact, and all other part pairs apart at the tracked scales, on the way."""
        import casadi

        task = self.task
        moved = self._moved()
        s = np.linspace(0.0, 1.0, DEFAULT.path_points)[1:] if task.coherent else np.ones(1)
        rows = casadi.vertcat(*(row for feature in task.tracked for row in _real(task, moved, feature)))
        made = casadi.Function("real", [moved.z, moved.s], [rows])
        kept = np.flatnonzero(~_always_zero(task, made))
        values = made.map(len(s))(casadi.repmat(self.z, 1, len(s)), casadi.DM(s).T)
        self._add(values[kept.tolist(), :], 0.0, INF)
        own = {feature.parts for feature in task.tracked}
        pose = task.pose(task.rest)
        for i, j in np.ndindex(len(task.movable.parts), len(task.static.parts)):
            if (i, j) not in own:
                one, two = task.movable.parts[i], task.static.parts[j]
                _, facets = kernels.facet_rows(*one.packed, *two.packed, pose)
                normal = facets[int(np.argmax(facets[:, 5] - facets[:, 3:5] @ task.nominal)), :3]
                first = [moved.first(v, moved.pair[0]) for v in one.vertices]
                second = [moved.pair[1] * (w - two.seed) for w in two.vertices]
                self._separated(moved, first, second, normal, 0.0, s, task.nominal[0] * self._reach(one, normal))

    def _kept_apart(self, parts: Parts, normal: Array, need: float) -> None:
        """Keep a part pair of the scales made apart by a plane."""
        task, moved = self.task, self._moved()
        one, opponent = task.movable.parts[parts[0]], task.opponents[parts[1]]
        first = [moved.first(v, task.target[0]) for v in one.vertices]
        part = opponent.part
        second = list(part.seed - task.static.seed + opponent.scale * (part.vertices - part.seed))
        self._separated(moved, first, second, normal, need, np.ones(1), task.target[0] * self._reach(one, normal))

    def _reach(self, part: Any, normal: Array) -> float:
        return float(((part.vertices - part.seed) @ normal).max())

    def _separated(
        self, moved: _Moved, first: list[Any], second: list[Any], normal: Array, need: float, s: Array, reach: float
    ) -> None:
        """Add a plane of its own for each position on the way, and its rows for all vertices of both parts."""
        import casadi

        task = self.task
        frame = np.linalg.svd(normal[:, None])[0]
        frame[:, 0] = normal
        plane = casadi.SX.sym("plane", 3)
        n = frame @ casadi.vertcat(1.0, plane[:2])
        below = [plane[2] - casadi.dot(n, x) / task.unit for x in first]
        room = need / task.unit * casadi.sqrt(1.0 + casadi.sumsqr(plane[:2]))
        above = [casadi.dot(n, y) / task.unit - plane[2] - room for y in second]
        made = casadi.Function("apart", [moved.z, moved.s, plane], [casadi.vertcat(*below, *above)])
        offset = task.static.seed - task.movable.seed
        start = np.array([0.0, 0.0, (reach - normal @ offset) / task.unit])
        planes = self._variable(f"planes_{self.planes}", np.tile(start, len(s)))
        self.planes += len(s)
        values = made.map(len(s))(casadi.repmat(self.z, 1, len(s)), casadi.DM(s).T, casadi.reshape(planes, 3, len(s)))
        self._add(values, 0.0, INF)

    def _touching(self, parts: Parts) -> None:
        """Ask for a common point of two parts at the scales made: weights of the vertices of both that give it."""
        import casadi

        task, moved = self.task, self._moved()
        one, two = task.movable.parts[parts[0]], task.static.parts[parts[1]]
        counts = len(one.vertices), len(two.vertices)
        unit = [np.tile([0.0, 1.0], (count, 1)) for count in counts]
        weights = [self._variable(f"weights_{k}", np.full(n, 1.0 / n), unit[k]) for k, n in enumerate(counts)]
        points = casadi.horzcat(*(moved.first(v, task.target[0]) for v in one.vertices))
        placed = casadi.Function("placed", [moved.z, moved.s], [points])(self.z, 1.0)
        others = casadi.DM(task.target[1] * (two.vertices - two.seed)).T
        self._add((placed @ weights[0] - others @ weights[1]) / task.unit, 0.0, 0.0)
        for own in weights:
            self._add(casadi.sum1(own) - 1.0, 0.0, 0.0)

    def _moved(self) -> _Moved:
        return _Moved.of(self.task)

    def _at_end(self, moved: _Moved, row: Any) -> Any:
        import casadi

        return casadi.Function("at_end", [moved.z, moved.s], [row])(self.z, 1.0)

    # ------------------------------------------------------------------------------------------------------ solving

    @property
    def modelled(self) -> dict[str, int]:
        """Counts of what is in the program: everything."""
        task = self.task
        everything = list(np.ndindex(len(task.movable.parts), len(task.opponents)))
        variables, constraints = sum(map(len, self.starts)), sum(len(lower) for lower, _ in self.ranges)
        return task.modelled(everything, variables=variables, constraints=constraints, features=task.features)

    def solve(self, tolerance: float) -> tuple[Array | None, int]:
        """Return the parameters, None where the program did not converge, and how often its rows were evaluated."""
        import casadi

        task = self.task
        nlp: dict[str, Any] = {
            "x": casadi.vertcat(*self.symbols),
            "f": self.objective,
            "g": casadi.vertcat(*self.rows) if self.rows else casadi.MX(0, 1),
        }
        options: dict[str, Any] = {
            "print_time": False,
            "error_on_fail": False,
            "show_eval_warnings": False,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "ipopt.tol": tolerance,
            "ipopt.constr_viol_tol": tolerance,
            "ipopt.acceptable_tol": max(DEFAULT.requirement, tolerance),
            "ipopt.bound_relax_factor": 0.0,
            "ipopt.mu_strategy": "adaptive",  # many rows are tight at once where all vertices move alike
            "ipopt.max_iter": 500,
            "ipopt.max_wall_time": PATIENCE,
        }
        with timed():
            solver = casadi.nlpsol("everything", "ipopt", nlp, options)
        low, high = np.vstack(self.limits).T
        lower, upper = (np.concatenate([bounds[k] for bounds in self.ranges] or [np.empty(0)]) for k in (0, 1))
        result = solver(x0=np.concatenate(self.starts), lbx=low, ubx=high, lbg=lower, ubg=upper)
        stats = solver.stats()
        x, g = result["x"].full().ravel(), result["g"].full().ravel()
        missed = np.maximum(lower - g, g - upper).max(initial=0.0)
        q = np.clip(x[: len(task.weights)] * task.steps, *task.limits.T)
        good = stats["success"] and np.isfinite(x).all() and missed <= max(DEFAULT.cut, tolerance)
        return (q if good else None), int(stats.get("n_call_nlp_g", 0))


class _Moved(NamedTuple):
    """The scene at a position of the way, symbolic (SX), in scaled parameters z."""

    z: Any
    s: Any
    scene: SymbolicPose
    pair: Any
    static_seed: Array

    @classmethod
    def of(cls, task: Task) -> _Moved:
        """Return the scene of a task, with the tracked scale pair (the target pair where nothing is tracked)."""
        import casadi

        z, s = casadi.SX.sym("z", len(task.weights)), casadi.SX.sym("s")
        seeds = casadi.DM(np.concatenate([task.movable.seed, task.static.seed]))
        scene = SymbolicPose.of(task.motion, s * (task.steps * z), seeds)
        lines = [scene.line(feature.kind, feature.values) for feature in task.tracked]
        pair: Any = casadi.DM(task.target)
        if len(lines) == 2:
            pair = intersection(*lines)[0]
        elif lines:
            a, b, c, _ = lines[0]
            straight = task.nominal + s * (task.target - task.nominal)
            excess = (c - a * straight[0] - b * straight[1]) / (a * a + b * b)
            pair = straight + excess * casadi.vertcat(a, b)
        return cls(z, s, scene, pair, task.static.seed)

    def first(self, vertex: Array, scale: Any) -> Any:
        """Return a vertex of body 1, scaled and moved, relative to s_2."""
        return self.scene.scaled(scale, vertex) - self.static_seed

    @staticmethod
    def length(vector: Any) -> Any:
        """Return the length of a vector that is never zero."""
        import casadi

        return casadi.norm_2(vector)


def _real(task: Task, moved: _Moved, feature: FeaturePoints) -> Iterator[Any]:
    """Yield what must not be negative for a tracked feature to be the contact, in typical amounts."""
    import casadi

    one, two = task.movable.parts[feature.parts[0]], task.static.parts[feature.parts[1]]
    _, _, _, n = moved.scene.line(feature.kind, feature.values)
    scale = feature.steepness(np.eye(3)) * task.unit
    rho = moved.pair
    X = [moved.first(v, rho[0]) for v in one.vertices]
    Y = [rho[1] * (w - two.seed) for w in two.vertices]
    points = feature.points.T
    owners = OWNERS[feature.kind]
    own = moved.first(next(p for p, body in zip(points, owners, strict=True) if body == 1), rho[0])
    other = rho[1] * (next(p for p, body in zip(points, owners, strict=True) if body == 2) - two.seed)
    yield from (casadi.dot(n, own - x) / scale for x in X)
    yield from (casadi.dot(n, y - other) / scale for y in Y)
    _, i, j = feature.site
    if feature.kind == E1E2:
        p, q = (X[int(v)] for v in one.edges[i, :2])
        r, t = (Y[int(v)] for v in two.edges[j, :2])
        e, g, w = q - p, t - r, r - p
        raw = casadi.cross(e, g)
        for along in (casadi.dot(casadi.cross(w, g), raw), casadi.dot(casadi.cross(w, e), raw)):
            yield along / casadi.sumsqr(raw)
            yield 1.0 - along / casadi.sumsqr(raw)
        return
    if feature.kind == F1V2:
        polygon, corners, point, outward = [X[v] for v in one.loops[i]], one.vertices[list(one.loops[i])], Y[j], n
    else:
        polygon, corners, point, outward = [Y[v] for v in two.loops[j]], two.vertices[list(two.loops[j])], X[i], -n
    for k in range(len(polygon)):
        following = (k + 1) % len(polygon)
        inward = casadi.cross(outward, polygon[following] - polygon[k])
        side = float(np.linalg.norm(corners[following] - corners[k]))
        yield casadi.dot(inward, point - polygon[k]) / (scale * side)


def _always_zero(task: Task, rows: Any) -> Any:
    """Tell which rows are zero whatever the motion: those of the elements that define the tracked pair."""
    rng = np.random.default_rng(0)
    zero = True
    for _ in range(TRIALS):
        values = rows(rng.uniform(-1.0, 1.0, len(task.weights)), rng.uniform(0.2, 1.0)).full().ravel()
        zero = zero & ~(np.abs(values) > DEFAULT.solver * max(1.0, task.size / task.unit))
    return zero
