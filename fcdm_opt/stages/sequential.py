"""The nonlinear program by sequential least squares over rows that are compiled one by one.

Each template is a small function of its own with its derivatives, so that a new choice of rows needs no new program.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.task import Task
from fcdm_opt.motion.kinematics import Compiled
from fcdm_opt.motion.motions import Motion
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.stages import program
from fcdm_opt.stages.program import Outcome, Row
from fcdm_opt.tolerances import DEFAULT

ITERATIONS = 40
PLANE = 3  # variables of a separating plane: tilt of its normal, and level
CORRECTIONS = 4  # Newton steps that bring a solution onto its rows


@lru_cache(maxsize=1024)
def _row(motion: Motion, kinds: tuple[int, ...], template: tuple[Any, ...], size: int) -> Any:
    """Return a template's function (variables, numbers) -> (value, derivatives)."""
    import casadi

    k = len(motion.parameters)
    x, step, unit = casadi.SX.sym("x", k + PLANE), casadi.SX.sym("step", k), casadi.SX.sym("unit")
    seeds, nominal, target = casadi.SX.sym("seeds", 6), casadi.SX.sym("nominal", 2), casadi.SX.sym("target", 2)
    tracked = tuple((kind, casadi.SX.sym(f"tracked_{m}", 13)) for m, kind in enumerate(kinds))
    frame, values = casadi.SX.sym("frame", 3, 3), casadi.SX.sym("values", size)
    symbols = program._Symbols(motion, step * x[:k], seeds, unit, nominal, target, tracked, x[k:], (frame,))
    value = program._template(symbols, template, values)
    numbers = [step, unit, seeds, nominal, target, *(own for _, own in tracked), casadi.vec(frame), values]
    both = casadi.densify(casadi.horzcat(value, casadi.jacobian(value, x)))
    return casadi.Function("row", [x, casadi.vertcat(*numbers)], [both], {"cse": True})


@lru_cache(maxsize=256)
def _own_amount(amount: OwnAmount, count: int) -> Any:
    """Return an amount of the user's own, squared where it is not smooth at rest, with its derivatives."""
    import casadi

    q = casadi.SX.sym("q", count)
    value = amount.function(q)
    value = value if amount.is_smooth_at_rest else value**2
    return casadi.Function("amount", [q], [casadi.densify(casadi.horzcat(value, casadi.jacobian(value, q)))])


class _Sequence:
    """Amount and rows as SLSQP asks for them; variables z = q / steps, planes, and a bound of displacements."""

    def __init__(self, task: Task, rows: Sequence[Row], planes: Array) -> None:
        self.task, self.rows = task, rows
        self.count, self.unit = len(task.weights), task.unit
        self.step = task.steps
        self.displaced = task.amount_kind == "displacement"
        self.size = self.count + PLANE * len(planes) + self.displaced
        kinds = tuple(feature.kind for feature in task.tracked)
        shared = [self.step, [task.unit], task.movable.seed, task.static.seed, task.nominal, task.target]
        shared += [feature.values for feature in task.tracked]
        self.frames = [program._frame(plane[:3]) for plane in planes]
        none = np.zeros(9)
        self.functions, self.blocks = [], []
        for row in rows:
            block = row.template[1] if row.template[0] == "plane" else -1
            template = row.template if block < 0 else ("plane", 0, row.template[2])
            frame = none if block < 0 else self.frames[block].ravel(order="F")
            function = _row(task.motion, kinds, template, len(row.values))
            self.functions.append(Compiled(function, np.concatenate([*shared, frame, row.values])))
            self.blocks.append(block)
        self.lower = np.array([row.lower for row in rows])
        self.upper = np.array([row.upper for row in rows])
        self.equal = self.lower == self.upper
        self.kinematics = task.motion.kinematics(task.movable.seed, task.static.seed)
        self.own = None
        if isinstance(task.amount_kind, OwnAmount):
            self.own = Compiled(_own_amount(task.amount_kind, self.count))
            there = [self.own(sign * z)[0][0] for z in np.diag(self.step) for sign in (1.0, -1.0)]
            self.typical = float(np.max(there, where=np.isfinite(there), initial=0.0)) or 1.0
        self.weight = self.step * task.weights / (self.step * task.weights).max()
        self._at: tuple[bytes, Array, Array] | None = None

    def values(self, x: Array) -> tuple[Array, Array]:
        """Return values, (rows,), and derivatives, (rows, variables), of all rows."""
        key = x.tobytes()
        if self._at is not None and self._at[0] == key:
            return self._at[1:]
        k, made = self.count, np.zeros((len(self.rows), self.size))
        g = np.empty(len(self.rows))
        variables = np.zeros(k + PLANE)
        variables[:k] = x[:k]
        for m, (function, block) in enumerate(zip(self.functions, self.blocks, strict=True)):
            at = k + PLANE * block
            if block >= 0:
                variables[k:] = x[at : at + PLANE]
            found = function(variables)[0]
            g[m] = found[0]
            made[m, :k] = found[1 : k + 1]
            if block >= 0:
                made[m, at : at + PLANE] = found[k + 1 :]
        self._at = key, g, made
        return g, made

    def objective(self, x: Array) -> tuple[float, Array]:
        """Return the amount, or a function of it that is smooth, and its slopes."""
        slopes = np.zeros(self.size)
        if self.displaced:
            slopes[-1] = 1.0
            return float(x[-1]), slopes
        z = x[: self.count]
        if self.own is None:
            slopes[: self.count] = 2.0 * self.weight**2 * z
            return float(np.sum((self.weight * z) ** 2)), slopes
        found = self.own(z * self.step)[0]
        slopes[: self.count] = found[1:] * self.step / self.typical
        return float(found[0]) / self.typical, slopes

    def ways(self, x: Array) -> tuple[Array, Array]:
        """Return squares of the vertices' displacements / unit, and their slopes, (n, k)."""
        points = self.task.made_vertices
        T, rates = self.kinematics.rates(x[: self.count] * self.step)
        ways = points @ (T[:3, :3] - np.eye(3)).T + T[:3, 3]
        speeds = np.einsum("kij,nj->nki", rates[:, :3, :3], points) + rates[:, :3, 3]
        slopes = 2.0 * np.einsum("nki,ni->nk", speeds, ways) * self.step
        return (ways * ways).sum(axis=1) / self.unit**2, slopes / self.unit**2

    def equations(self, x: Array) -> tuple[Array, Array]:
        """Return what must be zero, and its slopes."""
        g, slopes = self.values(x)
        return g[self.equal] - self.lower[self.equal], slopes[self.equal]

    def inequalities(self, x: Array) -> tuple[Array, Array]:
        """Return what must not be negative, and its slopes."""
        g, slopes = self.values(x)
        low, high = ~self.equal & np.isfinite(self.lower), ~self.equal & np.isfinite(self.upper)
        values = [g[low] - self.lower[low], self.upper[high] - g[high]]
        rows = [slopes[low], -slopes[high]]
        if self.displaced:
            squares, rates = self.ways(x)
            values.append(x[-1] - squares)
            own = np.zeros((len(squares), self.size))
            own[:, : self.count], own[:, -1] = -rates, 1.0
            rows.append(own)
        return np.concatenate(values), np.vstack(rows)


def minimise(task: Task, rows: Sequence[Row], start: Array, planes: Array) -> Outcome:
    """Solve the program of `program.minimise` from one start."""
    from scipy.optimize import minimize

    own, k, blocks = _Sequence(task, rows, planes), len(task.weights), len(planes)
    largest = [float(own.ways(start / own.step)[0].max())] if own.displaced else []
    tilted = np.column_stack([np.zeros((blocks, 2)), planes[:, 3]]).ravel()
    x = np.concatenate([start / own.step, tilted, largest])
    bounds = np.vstack([task.limits / own.step[:, None], np.tile([-np.inf, np.inf], (len(x) - k, 1))])
    constraints = [
        {"type": kind, "fun": lambda x, of=of: of(x)[0], "jac": lambda x, of=of: of(x)[1]}
        for kind, of in (("eq", own.equations), ("ineq", own.inequalities))
        if len(of(x)[0])
    ]
    with np.errstate(all="ignore"):
        made = minimize(
            own.objective,
            x,
            jac=True,
            method="SLSQP",
            bounds=bounds,
            constraints=constraints,
            options={"maxiter": ITERATIONS, "ftol": DEFAULT.solver},
        ).x
        return _outcome(own, made)


def _outcome(own: _Sequence, x: Array) -> Outcome:
    """Return a solution, brought onto its rows."""
    task, k = own.task, own.count
    x = np.clip(x, np.append(task.limits[:, 0] / own.step, np.full(len(x) - k, -np.inf)),
                np.append(task.limits[:, 1] / own.step, np.full(len(x) - k, np.inf)))  # fmt: skip
    for _ in range(CORRECTIONS if np.isfinite(x).all() else 0):
        g, slopes = own.values(x)
        off = np.where(g < own.lower, g - own.lower, np.where(g > own.upper, g - own.upper, 0.0))
        if not np.isfinite(g).all() or not np.abs(off).max(initial=0.0) > DEFAULT.solver:
            break
        held = (off != 0) | own.equal
        x = x - np.linalg.lstsq(slopes[held], off[held], rcond=DEFAULT.nominal)[0]
    q = np.clip(x[:k] * own.step, *task.limits.T)
    x[:k] = q / own.step
    g, _ = own.values(x)
    excess = np.maximum(own.lower - g, g - own.upper)
    feasible = bool(np.isfinite(x).all() and np.isfinite(g).all() and excess.max(initial=-np.inf) <= DEFAULT.cut)
    active = tuple(int(m) for m in np.flatnonzero((excess >= -DEFAULT.cut) & ~own.equal))
    tilts = x[k : k + PLANE * len(own.frames)].reshape(-1, PLANE)
    normals = [frame @ [1.0, *tilt[:2]] for frame, tilt in zip(own.frames, tilts, strict=True)]
    return Outcome(q, np.array(normals).reshape(-1, 3), feasible, active)
