"""The nonlinear program: smallest motion under rows that are instances of the contact equations.

A template is compiled once, and serves all its rows; a program's layout (how many rows of which templates) is put
together once and cached; its numbers are parameters. Variables: z = q / steps (`Task.steps`), so that everything is of
order one whatever the weights, and blocks of three: for each pair that a free separating plane keeps apart that plane,
the tilt of its normal against a fixed one, in a frame given with the row, and its level / unit; or a point that two
parts have in common, in units.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.kernels import E1E2, F1V2
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.model.equations import FeaturePoints, SymbolicPose, intersection
from fcdm_opt.model.seats import independent, tilts
from fcdm_opt.model.task import Task
from fcdm_opt.model.templates import template
from fcdm_opt.motion.motions import Motion
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.tolerances import DEFAULT

INF = float("inf")
FARTHEST = 1e5  # a tilt or level there: of planes that are nearly free, which would wander off
PATIENCE = 10.0  # seconds of a program with everything in it


class Row(NamedTuple):
    """One constraint lower <= template(values) <= upper; `name` says what it keeps, `block` whose variables it has."""

    template: tuple[Any, ...]
    values: Array
    lower: float
    upper: float
    name: str
    block: int = -1


class Outcome(NamedTuple):
    """Result of one solve in which all rows hold: parameters, normals of the planes, and the rows that are active."""

    q: Array
    normals: Array
    active: tuple[int, ...]


# -------------------------------------------------------------------------------------------------- kinds of rows


def goal_rows(task: Task) -> list[Row]:
    """Return what the goals "beyond", "at" and "seat" ask of the tracked point, or of all contacts."""
    if task.goal == "seat" or task.joints:
        return _flush_rows(task)
    if len(task.tracked) == 1:
        return [Row(("on",), np.empty(0), 0.0, 0.0, "target on the moved segment")]
    # more equations than parameters: a band within rounding, as solvers refuse such programs
    band = 0.0 if len(task.weights) >= 2 else DEFAULT.solver
    change = max(np.abs(task.target - task.nominal).max(), DEFAULT.least_unit)
    lower, upper = (0.0, INF) if task.goal == "beyond" else (-band, band)
    factors = np.array([[(sign or 1.0) / change] for sign in task.signs])
    return [Row(("tracked", k), factors[k], lower, upper, f"rho_{k + 1} reaches its target") for k in range(2)]


def _flush_rows(task: Task) -> list[Row]:
    """Return what keeps flush contacts aligned and brings them to the target pair, without rows that depend on others.

    Rows that hold whatever the parameters do, and repeated ones, would make gradients dependent. Alignment along the
    whole way needs no tilt to first order, which is linear; at its end alone it is asked for as it is.
    """
    rates = tilts(task.seats, task.spins)
    turns = [turn for flush in task.seats for turn in flush.turns]
    scale = task.size / task.unit
    rows = [
        Row(("turned",), scale * rate, 0.0, 0.0, "flush contacts stay aligned")
        if task.coherent
        else Row(("aligned",), np.concatenate([scale * m, p]), 0.0, 0.0, "flush contacts end aligned")
        for (m, p), rate in zip(turns, rates, strict=True)
    ]
    lines = (*task.tracked, *task.untracked)
    values = [np.append(line.values, line.steepness(np.eye(3)) * task.unit) for line in lines]
    name = "target on the moved segment"
    rows += [Row(("target", line.kind), own, 0.0, 0.0, name) for line, own in zip(lines, values, strict=True)]
    moving = (task.limits != 0).any(axis=1)
    # beside rest, where a turn may change nothing to first order, and without a tilt
    step = task.steps * moving / np.arange(1, len(moving) + 1)
    step -= np.linalg.lstsq(rates, rates @ step, rcond=DEFAULT.nominal)[0] if len(rates) else 0.0
    slopes = task.line_rates(step, task.line_gaps(step)[0]) / task.unit
    return [rows[k] for k in independent(np.vstack([scale * rates, slopes]) * task.steps * moving)]


def support_row(task: Task, s: float, feature: FeaturePoints, scale: float, body: int, vertex: Array, name: str) -> Row:
    """Keep a vertex, as drawn, behind a tracked feature's plane at path position s."""
    values = np.concatenate([[s], feature.values, vertex, [scale * task.unit]])
    return Row(("support", feature.kind, body), values, -INF, 0.0, name)


def plane_row(task: Task, block: int, body: int, vertex: Array, need: float, name: str) -> Row:
    """Keep a vertex on its body's side of separating plane `block`, of body 2 by `need`."""
    # of body 1 as drawn, to be scaled and moved; of body 2 or a keep-out, which stay, as scaled and relative to s_2
    return Row(("plane", body), np.append(vertex, need / task.unit), 0.0, INF, name, block)


def common_rows(task: Task, block: int, one: ConvexPart, two: ConvexPart) -> list[Row]:
    """Let two parts of the scales made have the point `block` in common, which starts at the seed of part 2."""
    sites = [(1, m, one.vertices[loop[0]]) for m, loop in zip(one.normals, one.loops, strict=True)]
    offsets = task.target[1] * (two.vertices - two.seed)
    sites += [(2, m, offsets[loop[0]]) for m, loop in zip(two.normals, two.loops, strict=True)]
    return [Row(("common", body), np.concatenate([m, v]), 0.0, INF, "", block) for body, m, v in sites]


def element_rows(s: float, feature: FeaturePoints, one: ConvexPart, two: ConvexPart, scale: float) -> list[Row]:
    """Keep the tracked contact point within the elements of its feature at path position s."""
    values, (_, i, j) = np.append(s, feature.values), feature.site
    if feature.kind == E1E2:
        return [Row(("along", body), values, 0.0, 1.0, "") for body in (1, 2)]
    corners = one.vertices[list(one.loops[i])] if feature.kind == F1V2 else two.vertices[list(two.loops[j])]
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    return [
        Row(("inside", feature.kind), np.concatenate([values, p, q, [scale * np.linalg.norm(q - p)]]), 0.0, INF, "")
        for p, q in sides
    ]


class _Symbols:
    """Symbols that the templates of one program share, and a row's own: its block and its values."""

    def __init__(self, motion: Motion, kinds: tuple[int, ...], size: int) -> None:
        import casadi

        k = len(motion.parameters)
        self.motion, self.z, self.block = motion, casadi.SX.sym("z", k), casadi.SX.sym("block", 3)
        self.shared, self.values = casadi.SX.sym("shared", k + 11 + 13 * len(kinds)), casadi.SX.sym("values", size)
        step, self.unit, self.seeds, self.nominal, self.target, *tracked = casadi.vertsplit(
            self.shared, [0, k, k + 1, k + 7, k + 9, *(k + 11 + 13 * m for m in range(len(kinds) + 1))]
        )
        self.q, self.tracked = step * self.z, tuple(zip(kinds, tracked, strict=False))

    @cached_property
    def end(self) -> SymbolicPose:
        """The scene after the whole motion."""
        return SymbolicPose.of(self.motion, self.q, self.seeds)

    def tracked_pair(self, scene: SymbolicPose, s: Any) -> Any:
        """Return the tracked scale pair: both lines' intersection, or one line's point nearest the straight path."""
        import casadi

        lines = [scene.line(kind, values) for kind, values in self.tracked]
        if len(lines) == 2:
            return intersection(*lines)[0]
        a, b, c, _ = lines[0]
        path = self.nominal + s * (self.target - self.nominal)
        excess = (c - a * path[0] - b * path[1]) / (a * a + b * b)
        return path + excess * casadi.vertcat(a, b)


def _value(symbols: _Symbols, template: tuple[Any, ...]) -> Any:
    import casadi

    (name, *detail), values, target = template, symbols.values, symbols.target
    if name.startswith("plane"):
        (body,), tilt, level = detail, symbols.block[:2], symbols.block[2]
        n = casadi.reshape(values[:9], 3, 3) @ casadi.vertcat(1.0, tilt)
        scene, rho, point, room = symbols.end, target, values[9:12], values[12] * casadi.sqrt(1.0 + casadi.sumsqr(tilt))
        if name == "plane on the way":
            scene = SymbolicPose.of(symbols.motion, values[12] * symbols.q, symbols.seeds)
            rho, room = symbols.tracked_pair(scene, values[12]), casadi.SX(0)
            point = point if body == 1 else rho[1] * point
        if body == 1:
            return level - casadi.dot(n, scene.scaled(rho[0], point) - symbols.seeds[3:]) / symbols.unit
        return casadi.dot(n, point) / symbols.unit - level - room
    if name == "common":
        n, point = values[9:12], values[12:15]
        if detail[0] == 1:
            n, point = symbols.end.transform[:3, :3] @ n, symbols.end.scaled(target[0], point) - symbols.seeds[3:]
        return casadi.dot(n, point / symbols.unit - symbols.block)
    if name == "tracked":
        return (symbols.tracked_pair(symbols.end, 1.0)[detail[0]] - target[detail[0]]) * values[0]
    if name == "on":
        a, b, c, n = symbols.end.line(*symbols.tracked[0])
        return (a * target[0] + b * target[1] - c) / (casadi.norm_2(n) * symbols.unit)
    if name == "target":
        a, b, c, _ = symbols.end.line(detail[0], values)
        return (c - a * target[0] - b * target[1]) / values[13]
    if name == "displaced":  # the square of a vertex's displacement
        return casadi.sumsqr((symbols.end.moved(values) - values) / symbols.unit)
    if name == "turned":
        return casadi.dot(values, symbols.q)
    if name == "aligned":
        return casadi.dot(values[:3], symbols.end.transform[:3, :3] @ values[3:])
    if name == "over":
        point = symbols.end.scaled(target[0], values[3:6]) - symbols.seeds[3:]
        return casadi.dot(values[:3], point - values[6:])
    s, feature = values[0], values[1:14]
    scene = SymbolicPose.of(symbols.motion, s * symbols.q, symbols.seeds)
    a, b, c, n = scene.line(E1E2 if name == "along" else detail[0], feature)
    if name == "support":
        body, vertex = detail[1], values[14:17]
        own = feature[:3] if body == 1 else feature[9:12]  # the first point is of body 1, the last of body 2
        height = casadi.dot(n, scene.moved(vertex) - scene.moved(own)) if body == 1 else casadi.dot(n, own - vertex)
        return height / values[17]
    rho = symbols.tracked_pair(scene, s)
    if name == "line":
        return (c - a * rho[0] - b * rho[1]) / values[14]

    def placed(body: int, point: Any) -> Any:
        seed = symbols.seeds[3:]
        return scene.scaled(rho[0], point) if body == 1 else seed + rho[1] * (point - seed)

    if name == "along":
        p, q, r, t = (placed(body, feature[3 * k : 3 * k + 3]) for k, body in enumerate((1, 1, 2, 2)))
        normal = casadi.cross(q - p, t - r)
        across = casadi.cross(r - p, t - r if detail[0] == 1 else q - p)
        return casadi.dot(across, normal) / casadi.sumsqr(normal)
    body = 1 if detail[0] == F1V2 else 2  # whose face it is
    p, q = placed(body, values[14:17]), placed(body, values[17:20])
    point = placed(2, feature[9:12]) if body == 1 else placed(1, feature[:3])
    return casadi.dot(casadi.cross(n if body == 1 else -n, q - p), point - p) / values[20]


@template
def _function(motion: Motion, kinds: tuple[int, ...], form: tuple[Any, ...], size: int) -> Any:
    """Return a template's function (z, block, shared, values) -> value."""
    import casadi

    symbols = _Symbols(motion, kinds, size)
    given = [symbols.z, symbols.block, symbols.shared, symbols.values]
    return casadi.Function("row", given, [_value(symbols, form)], {"cse": True})


@template
def _compiled(
    motion: Motion,
    kinds: tuple[int, ...],
    blocks: int,
    layout: tuple[tuple[tuple[Any, ...], int, tuple[int, ...]], ...],
    method: str,
    tolerance: float,
    amount: str | OwnAmount = "weighted",
    vertices: int = 0,
) -> Any:
    """Build the NLP solver of a layout: for each template the size of its values, and the blocks of its rows."""
    # `vertices` is the number of those whose displacement counts
    import casadi

    k = len(motion.parameters)
    z, planes = casadi.MX.sym("z", k), casadi.MX.sym("planes", 3, blocks)
    weight, shared = casadi.MX.sym("weight", k), casadi.MX.sym("shared", k + 11 + 13 * len(kinds))
    values = [casadi.MX.sym("values", size, len(which)) for _, size, which in layout]
    points, largest = casadi.MX.sym("points", 3, vertices), casadi.MX.sym("largest", min(vertices, 1))

    def mapped(template: tuple[Any, ...], own: Any, which: tuple[int, ...]) -> Any:
        count = own.shape[1]
        of_blocks = planes[:, list(which)] if which[0] >= 0 else casadi.MX.zeros(3, count)
        function = _function(motion, kinds, template, own.shape[0])
        function = function if count == 1 else function.map(count)
        return function(casadi.repmat(z, 1, count), of_blocks, casadi.repmat(shared, 1, count), own).T

    rows = [mapped(template, own, which) for (template, _, which), own in zip(layout, values, strict=True)]
    objective = casadi.sumsqr(weight * z)
    if isinstance(amount, OwnAmount):
        objective = amount.function(shared[:k] * z)
        objective = objective if amount.is_smooth_at_rest else objective**2
    elif amount == "displacement":
        # the largest of several is not smooth: a variable that no square of a displacement exceeds
        rows.append(mapped(("displaced",), points, (-1,)) - largest)
        objective = largest
    nlp = {
        "x": casadi.vertcat(z, casadi.vec(planes), largest),
        "p": casadi.vertcat(weight, shared, *map(casadi.vec, values), casadi.vec(points)),
        "f": objective,
        "g": casadi.vertcat(*rows),
    }
    options = dict(_OPTIONS[method])
    if method != "sqpmethod":
        options |= {"ipopt.tol": tolerance, "ipopt.constr_viol_tol": tolerance}
    return casadi.nlpsol("smallest_motion", "sqpmethod" if method == "sqpmethod" else "ipopt", nlp, options)


_QUIET = {"calc_lam_p": False, "print_time": False, "error_on_fail": False, "show_eval_warnings": False}
_IPOPT = {**_QUIET, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.bound_relax_factor": 0.0}
_OPTIONS: dict[str, dict[str, Any]] = {
    "sqpmethod": {
        **_QUIET,
        "qpsol": "qrqp",
        "qpsol_options": {
            **dict.fromkeys(("print_iter", "print_header", "print_info", "error_on_fail"), False),
            "max_iter": 100,
        },
        **dict.fromkeys(("print_header", "print_iteration", "print_status"), False),
        "max_iter": 40,
        "tol_pr": DEFAULT.solver,
        "tol_du": DEFAULT.dual,
        "min_step_size": 1e-14,
        "convexify_strategy": "eigen-clip",
    },
    "ipopt": {**_IPOPT, "ipopt.acceptable_iter": 0, "ipopt.max_iter": 300},
    "full": {
        **_IPOPT,
        "ipopt.acceptable_tol": DEFAULT.requirement,
        "ipopt.mu_strategy": "adaptive",  # many rows are tight at once where all vertices move alike
        "ipopt.max_iter": 500,
        "ipopt.max_wall_time": PATIENCE,
    },
}


def _shared(task: Task) -> Array:
    """Return the numbers that all templates take, see `_Symbols`."""
    tracked = [feature.values for feature in task.tracked]
    seeds = task.movable.seed, task.static.seed
    return np.concatenate([task.steps, [task.unit], *seeds, task.nominal, task.target, *tracked])


def value(task: Task, row: Row, z: Array) -> float:
    """Return the value of a row without variables of its own."""
    kinds = tuple(feature.kind for feature in task.tracked)
    function = _function(task.motion, kinds, row.template, len(row.values))
    return float(function(z, np.zeros(3), _shared(task), row.values))


def minimise(
    task: Task,
    rows: Sequence[Row],
    start: Array,
    planes: Array,
    method: str = "sqpmethod",
    tolerance: float = DEFAULT.solver,
) -> Outcome | None:
    """Solve the program from motion parameters to start from, (k,); None where rows do not hold.

    Separating planes start from `planes`, (blocks, 4), unit normal and level / unit, one for each block that a row
    names; of a common point what starts it at nothing. `method` is a CasADi plugin, "sqpmethod" or "ipopt", or
    "full", which is IPOPT with patience; the tolerance is that of IPOPT, of scaled rows and stationarity.
    """
    pacing.check()
    points = task.made_vertices if task.amount_kind == "displacement" else np.empty((0, 3))
    templates = list(dict.fromkeys((row.template, len(row.values)) for row in rows))
    groups = [[m for m, row in enumerate(rows) if (row.template, len(row.values)) == own] for own in templates]
    order = [m for group in groups for m in group]
    frames = [_frame(plane[:3]) for plane in planes]
    layout = tuple(
        (template, size + (9 if rows[group[0]].block >= 0 else 0), tuple(rows[m].block for m in group))
        for (template, size), group in zip(templates, groups, strict=True)
    )
    kinds = tuple(feature.kind for feature in task.tracked)
    solver = _compiled(task.motion, kinds, len(planes), layout, method, tolerance, task.amount_kind, len(points))
    step, weight = task.steps, task.steps * task.weights
    parameters = [weight / weight.max(), _shared(task)]
    for m in order:
        parameters += [frames[rows[m].block].ravel(order="F")] if rows[m].block >= 0 else []
        parameters.append(rows[m].values)
    free = np.full(3 * len(planes) + min(len(points), 1), INF if method != "full" else FARTHEST)
    largest = np.array([(task.amount(start) / task.unit) ** 2] if len(points) else [])
    lower, upper = np.array([(rows[m].lower, rows[m].upper) for m in order]).reshape(-1, 2).T
    result = solver(
        x0=np.concatenate([start / step, np.column_stack([np.zeros((len(planes), 2)), planes[:, 3]]).ravel(), largest]),
        p=np.concatenate([*parameters, points.ravel()]),
        lbx=np.concatenate([task.limits[:, 0] / step, -free]),
        ubx=np.concatenate([task.limits[:, 1] / step, free]),
        lbg=np.append(lower, np.full(len(points), -INF)),
        ubg=np.append(upper, np.zeros(len(points))),
    )
    x, g = result["x"].full().ravel(), result["g"].full().ravel()[: len(rows)]
    k = len(step)
    q = np.clip(x[:k] * step, task.limits[:, 0], task.limits[:, 1])
    with np.errstate(invalid="ignore"):  # where a row is not finite the outcome is no feasible one
        excess = np.maximum(lower - g, g - upper)
    feasible = np.isfinite(x).all() and np.isfinite(g).all() and excess.max(initial=-INF) <= max(DEFAULT.cut, tolerance)
    if not feasible or (method == "full" and not solver.stats()["success"]):
        return None
    active = tuple(sorted(order[m] for m in np.flatnonzero((excess >= -DEFAULT.cut) & (lower < upper))))
    tilts = x[k : k + 3 * len(planes)].reshape(-1, 3)
    normals = [frame @ [1.0, *tilt[:2]] for frame, tilt in zip(frames, tilts, strict=True)]
    return Outcome(q, np.array(normals).reshape(-1, 3), active)


def _frame(normal: Array) -> Array:
    """Return a right-angled frame whose first column is a given unit vector."""
    frame = np.linalg.svd(normal[:, None])[0]
    frame[:, 0] = normal
    return frame
