"""The nonlinear program: smallest motion under rows that are instances of the contact equations.

A program's layout (which templates, in which order) is compiled once and cached; its numbers are parameters.
Variables: z = q / steps (`Task.steps`), so that everything is of order one whatever the weights, and for each
pair that a free separating plane keeps apart that plane: the tilt of its normal against a
fixed one, in a frame given as a parameter, and its level / unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve.flush import Overlap
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.equations import FeaturePoints, SymbolicPose, intersection
from fcdm_opt.model.seats import independent, tilts
from fcdm_opt.model.task import Task
from fcdm_opt.model.templates import template
from fcdm_opt.motion.motions import Motion
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.tolerances import DEFAULT

INF = float("inf")


class Row(NamedTuple):
    """One constraint lower <= template(values) <= upper; `name` says what it keeps."""

    template: tuple[Any, ...]
    values: Array
    lower: float
    upper: float
    name: str


class Outcome(NamedTuple):
    """Result of one solve: parameters, normals of the planes, whether all rows hold, and the rows that are active."""

    q: Array
    normals: Array
    feasible: bool
    active: tuple[int, ...]


# -------------------------------------------------------------------------------------------------- kinds of rows


def goal_rows(task: Task) -> list[Row]:
    """Return what the goals "beyond", "at" and "seat" ask of the tracked point."""
    if task.goal == "seat":
        return _seat_rows(task)
    if len(task.tracked) == 1:
        return [Row(("on",), np.empty(0), 0.0, 0.0, "target on the moved segment")]
    # more equations than parameters: a band within rounding, as solvers refuse such programs
    band = 0.0 if len(task.weights) >= 2 else DEFAULT.solver
    change = max(np.abs(task.target - task.nominal).max(), DEFAULT.least_unit)
    lower, upper = (0.0, INF) if task.goal == "beyond" else (-band, band)
    return [
        Row(
            ("tracked", k), np.array([(task.signs[k] or 1.0) / change]), lower, upper, f"rho_{k + 1} reaches its target"
        )
        for k in range(2)
    ]


def _seat_rows(task: Task) -> list[Row]:
    """Return what keeps flush contacts aligned and brings them to the target pair, without rows that depend on others.

    Rows that hold whatever the parameters do, and repeated ones, would make gradients dependent. Alignment along the
    whole way needs no tilt to first order, which is linear; at its end alone it is asked for as it is.
    """
    rates = tilts(task.seats, task.spins)
    turns = [turn for seat in task.seats for turn in seat.turns]
    scale = task.size / task.unit
    rows = [
        Row(("turned",), scale * rate, 0.0, 0.0, "flush contacts stay aligned")
        if task.coherent
        else Row(("aligned",), np.concatenate([scale * m, p]), 0.0, 0.0, "flush contacts end aligned")
        for (m, p), rate in zip(turns, rates, strict=True)
    ]
    lines = (*task.tracked, *task.besides)
    rows += [
        Row(
            ("target", line.kind),
            np.append(line.values, line.steepness(np.eye(3)) * task.unit),
            0.0,
            0.0,
            "target on the moved segment",
        )
        for line in lines
    ]
    moving = (task.limits != 0).any(axis=1)
    # beside rest, where a turn may change nothing to first order, and without a tilt
    beside = task.steps * moving / np.arange(1, len(moving) + 1)
    beside -= np.linalg.lstsq(rates, rates @ beside, rcond=DEFAULT.nominal)[0] if len(rates) else 0.0
    slopes = np.empty((len(lines), len(task.weights)))
    for k, step in enumerate(np.diag(DEFAULT.least_unit * task.steps)):
        gaps = [task.line_gaps(beside + sign * step)[1] for sign in (1.0, -1.0)]
        slopes[:, k] = (gaps[0] - gaps[1]) / (2.0 * step[k] * task.unit)
    return [rows[k] for k in independent(np.vstack([scale * rates, slopes]) * task.steps * moving)]


def still_row(task: Task, parameter: int) -> Row:
    """Keep a parameter at zero."""
    return Row(("turned",), np.eye(len(task.weights))[parameter] / task.steps, 0.0, 0.0, "flush contacts stay aligned")


def shared_row(task: Task, overlap: Overlap, least: float) -> Row:
    """Keep flush elements over one another by a length, along a direction that stays."""
    values = np.concatenate([overlap.way / task.unit, overlap.one, overlap.two])
    return Row(("over",), values, least / task.unit, INF, "flush contacts stay on one another")


def line_row(task: Task, s: float, feature: FeaturePoints, scale: float, apart: bool, name: str) -> Row:
    """Keep the tracked pair at path position s on the touching (or apart) side of a feature's contact line."""
    values = np.concatenate([[s], feature.values, [scale * task.unit]])
    return Row(("line", feature.kind), values, *((0.0, INF) if apart else (-INF, 0.0)), name)


def target_row(task: Task, feature: FeaturePoints, scale: float, name: str) -> Row:
    """Keep the target pair from being apart in a feature's direction."""
    return Row(("target", feature.kind), np.append(feature.values, scale * task.unit), -INF, 0.0, name)


def support_row(task: Task, s: float, feature: FeaturePoints, scale: float, body: int, vertex: Array, name: str) -> Row:
    """Keep a vertex, as drawn, behind a tracked feature's plane at path position s."""
    values = np.concatenate([[s], feature.values, vertex, [scale * task.unit]])
    return Row(("support", feature.kind, body), values, -INF, 0.0, name)


def plane_row(task: Task, block: int, body: int, vertex: Array, need: float, name: str) -> Row:
    """Keep a vertex on its body's side of separating plane `block`, of body 2 by `need`.

    Of body 1 as drawn, to be scaled and moved; of body 2 or a keep-out, which stay, as scaled and relative to s_2.
    """
    return Row(("plane", block, body), np.append(vertex, need / task.unit), 0.0, INF, name)


@dataclass(frozen=True, eq=False)
class _Symbols:
    """Symbols that the templates of one program share."""

    motion: Motion
    q: Any
    seeds: Any
    unit: Any
    nominal: Any
    target: Any
    tracked: tuple[tuple[int, Any], ...]
    planes: Any
    frames: tuple[Any, ...]

    @cached_property
    def end(self) -> SymbolicPose:
        """The scene after the whole motion."""
        return SymbolicPose.of(self.motion, self.q, self.seeds)

    @cached_property
    def end_pair(self) -> Any:
        """The tracked scale pair after the whole motion."""
        return self.tracked_pair(self.end, 1.0)

    def tracked_pair(self, scene: SymbolicPose, s: Any) -> Any:
        """Return the tracked scale pair: both lines' intersection, or one line's point nearest the straight path."""
        lines = [scene.line(kind, values) for kind, values in self.tracked]
        if len(lines) == 2:
            return intersection(*lines)[0]
        a, b, c, _ = lines[0]
        path = self.nominal + s * (self.target - self.nominal)
        excess = (c - a * path[0] - b * path[1]) / (a * a + b * b)
        import casadi

        return path + excess * casadi.vertcat(a, b)


def _template(symbols: _Symbols, template: tuple[Any, ...], values: Any) -> Any:
    """Return the expression of a row."""
    import casadi

    name, *detail = template
    if name == "plane":
        block, body = detail
        tilt, level = symbols.planes[:2, block], symbols.planes[2, block]
        n = symbols.frames[block] @ casadi.vertcat(1.0, tilt)
        point = values[:3]
        if body == 1:
            point = symbols.end.scaled(symbols.target[0], point) - symbols.seeds[3:]
        height = casadi.dot(n, point) / symbols.unit
        return level - height if body == 1 else height - level - values[3] * casadi.sqrt(1.0 + casadi.dot(tilt, tilt))
    if name == "tracked":
        return (symbols.end_pair[detail[0]] - symbols.target[detail[0]]) * values[0]
    if name == "on":
        a, b, c, n = symbols.end.line(*symbols.tracked[0])
        return (a * symbols.target[0] + b * symbols.target[1] - c) / (casadi.norm_2(n) * symbols.unit)
    if name == "target":
        a, b, c, _ = symbols.end.line(detail[0], values)
        return (c - a * symbols.target[0] - b * symbols.target[1]) / values[13]
    if name == "turned":
        return casadi.dot(values, symbols.q)
    if name == "aligned":
        return casadi.dot(values[:3], symbols.end.transform[:3, :3] @ values[3:])
    if name == "over":
        point = symbols.end.scaled(symbols.target[0], values[3:6]) - symbols.seeds[3:]
        return casadi.dot(values[:3], point - values[6:])
    s, feature = values[0], values[1:14]
    scene = SymbolicPose.of(symbols.motion, s * symbols.q, symbols.seeds)
    a, b, c, n = scene.line(detail[0], feature)
    if name == "line":
        rho = symbols.tracked_pair(scene, s)
        return (c - a * rho[0] - b * rho[1]) / values[14]
    body = detail[1]
    own = feature[:3] if body == 1 else feature[9:12]  # the first point is of body 1, the last of body 2
    vertex = values[14:17]
    height = casadi.dot(n, scene.moved(vertex) - scene.moved(own)) if body == 1 else casadi.dot(n, own - vertex)
    return height / values[17]


@template
def _compiled(
    motion: Motion,
    kinds: tuple[int, ...],
    blocks: int,
    forms: tuple[tuple[Any, ...], ...],
    sizes: tuple[int, ...],
    method: str,
    amount: str | OwnAmount = "weighted",
    vertices: int = 0,
) -> Any:
    """Build the NLP solver of a layout; `vertices` is the number of those whose displacement counts."""
    import casadi

    k = len(motion.parameters)
    z, planes = casadi.SX.sym("z", k), casadi.SX.sym("planes", 3, blocks)
    step, unit = casadi.SX.sym("step", k), casadi.SX.sym("unit")
    weight = casadi.SX.sym("weight", k)
    seeds, nominal, target = casadi.SX.sym("seeds", 6), casadi.SX.sym("nominal", 2), casadi.SX.sym("target", 2)
    tracked = tuple((kind, casadi.SX.sym(f"tracked_{m}", 13)) for m, kind in enumerate(kinds))
    frames = tuple(casadi.SX.sym(f"frame_{m}", 3, 3) for m in range(blocks))
    values = [casadi.SX.sym(f"row_{m}", size) for m, size in enumerate(sizes)]
    symbols = _Symbols(motion, step * z, seeds, unit, nominal, target, tracked, planes, frames)
    rows = [_template(symbols, form, value) for form, value in zip(forms, values, strict=True)]
    points, largest = casadi.SX.sym("points", 3, vertices), casadi.SX.sym("largest", min(vertices, 1))
    objective = casadi.sumsqr(weight * z)
    if isinstance(amount, OwnAmount):
        objective = amount.function(symbols.q)
        objective = objective if amount.is_smooth_at_rest else objective**2
    elif amount == "displacement":
        # the largest of several is not smooth: a variable that no square of a displacement exceeds
        ways = [symbols.end.moved(points[:, m]) - points[:, m] for m in range(vertices)]
        rows += [casadi.sumsqr(way / unit) - largest for way in ways]
        objective = largest
    nlp = {
        "x": casadi.vertcat(z, casadi.vec(planes), largest),
        "p": casadi.vertcat(
            step,
            weight,
            unit,
            seeds,
            nominal,
            target,
            *(value for _, value in tracked),
            *(casadi.vec(frame) for frame in frames),
            *values,
            casadi.vec(points),
        ),
        "f": objective,
        "g": casadi.vertcat(*rows),
    }
    return casadi.nlpsol("smallest_motion", method, nlp, _OPTIONS[method])


_QUIET = {"print_time": False, "error_on_fail": False, "show_eval_warnings": False}
_OPTIONS: dict[str, dict[str, Any]] = {
    "sqpmethod": {
        **_QUIET,
        "qpsol": "qrqp",
        "qpsol_options": {
            "print_iter": False,
            "print_header": False,
            "print_info": False,
            "error_on_fail": False,
            "max_iter": 100,
        },
        "print_header": False,
        "print_iteration": False,
        "print_status": False,
        "max_iter": 40,
        "tol_pr": DEFAULT.solver,
        "tol_du": DEFAULT.dual,
        "min_step_size": 1e-14,
        "convexify_strategy": "eigen-clip",
    },
    "ipopt": {
        **_QUIET,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.tol": DEFAULT.solver,
        "ipopt.constr_viol_tol": DEFAULT.solver,
        "ipopt.acceptable_iter": 0,
        "ipopt.bound_relax_factor": 0.0,
        "ipopt.max_iter": 300,
    },
}


def minimise(task: Task, rows: Sequence[Row], start: Array, planes: Array, method: str = "sqpmethod") -> Outcome:
    """Solve the program from one start.

    Parameters
    ----------
    task : Task
    rows : sequence of Row
    start : (k,) array
        Motion parameters to start from.
    planes : (blocks, 4) array
        Separating planes to start from, unit normal and level / unit, one for each block that a "plane" row names.
    method : "sqpmethod" or "ipopt"
        CasADi plugin.
    """
    points = task.made_vertices if task.amount_kind == "displacement" else np.empty((0, 3))
    solver = _compiled(
        task.motion,
        tuple(feature.kind for feature in task.tracked),
        len(planes),
        tuple(row.template for row in rows),
        tuple(len(row.values) for row in rows),
        method,
        task.amount_kind,
        len(points),
    )
    step, weight = task.steps, task.steps * task.weights
    frames = [_frame(plane[:3]) for plane in planes]
    parameters = np.concatenate(
        [
            step,
            weight / weight.max(),
            [task.unit],
            task.movable.seed,
            task.static.seed,
            task.nominal,
            task.target,
            *(feature.values for feature in task.tracked),
            *(frame.ravel(order="F") for frame in frames),
            *(row.values for row in rows),
            points.ravel(),
        ]
    )
    free = np.full(3 * len(planes) + min(len(points), 1), INF)
    largest = np.array([(task.amount(start) / task.unit) ** 2] if len(points) else [])
    result = solver(
        x0=np.concatenate([start / step, np.column_stack([np.zeros((len(planes), 2)), planes[:, 3]]).ravel(), largest]),
        p=parameters,
        lbx=np.concatenate([task.limits[:, 0] / step, -free]),
        ubx=np.concatenate([task.limits[:, 1] / step, free]),
        lbg=[*(row.lower for row in rows), *(-INF for _ in points)],
        ubg=[*(row.upper for row in rows), *(0.0 for _ in points)],
    )
    x, g = result["x"].full().ravel(), result["g"].full().ravel()[: len(rows)]
    k = len(step)
    q = np.clip(x[:k] * step, task.limits[:, 0], task.limits[:, 1])
    lower, upper = np.array([row.lower for row in rows]), np.array([row.upper for row in rows])
    with np.errstate(invalid="ignore"):  # where a row is not finite the outcome is no feasible one
        excess = np.maximum(lower - g, g - upper)
    feasible = bool(np.isfinite(x).all() and np.isfinite(g).all() and excess.max(initial=-INF) <= DEFAULT.cut)
    active = tuple(int(m) for m in np.flatnonzero((excess >= -DEFAULT.cut) & (lower < upper)))
    tilts = x[k : k + 3 * len(planes)].reshape(-1, 3)
    normals = [frame @ [1.0, *tilt[:2]] for frame, tilt in zip(frames, tilts, strict=True)]
    return Outcome(q, np.array(normals).reshape(-1, 3), feasible, active)


def _frame(normal: Array) -> Array:
    """Return a right-angled frame whose first column is a given unit vector."""
    frame = np.linalg.svd(normal[:, None])[0]
    frame[:, 0] = normal
    return frame
