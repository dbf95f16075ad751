"""The smallest motion by solvers of others, each as its own users would ask it: Drake, SCIP, and intervals of codac.

drake inverse kinematics with SNOPT, from some starts: the script of the data set, asked about the same scene scip a
quadratic program in rotation matrix, quaternion, shift and separating plane (or common point), solved globally
enclosed one parameter: intervals about rest are proved free of what is asked, as near to it as is asked

What they cannot express they refuse. Their own sizes: see `few`.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.task import Task
from fcdm_opt.problem.problem import Problem
from fcdm_opt_benchmarks.library import dataset_script, library, rounding_upward

AXES = {"x": [1.0, 0.0, 0.0], "y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}
SECONDS = 20.0  # that SCIP is given
FEW = 60  # vertices of both parts, beyond which SCIP and the intervals are not asked
MANY = 500  # vertices of a part: two prisms of 1,000, aligned, held Drake for over seven minutes, until it was ended
SCAN = 400  # steps of half a typical amount, each way, within which a contact is looked for
NARROW = 60  # halvings of an interval that is not proved, at most


# --------------------------------------------------------------------------------------------------------------- Drake


def scene_of(problem: Problem, task: Task) -> dict[str, Any]:
    """Return a problem as a scene of the data set."""
    (case,) = problem.to_dict()["case"]
    steps = []
    for step in case["motion"]:
        kind = next(key for key in ("translation", "rotation", "free") if key in step)
        own = step[kind]
        sign, name = (-1.0, own[1:]) if isinstance(own, str) and own[0] == "-" else (1.0, own)
        axis = [sign * x for x in AXES[name]] if isinstance(name, str) else own
        steps.append({kind: axis, **({"centre": step["centre"]} if kind == "rotation" else {})})
    parts = {role: [part.vertices.tolist() for part in body.parts]
             for role, body in (("movable", problem.movable), ("static", problem.static))}  # fmt: skip
    limits = [None if np.isinf(ends).any() else ends.tolist() for ends in task.limits]
    return {
        "movable": {"seed": problem.movable.seed.tolist(), "parts": parts["movable"]},
        "static": {"seed": problem.static.seed.tolist(), "parts": parts["static"]},
        "scale": list(map(float, task.target)),
        "question": {"goal": problem.goal, "motion": steps, "weights": task.weights.tolist(), "limits": limits,
                     "length": float(task.weights[-1]), "clearance": float(problem.clearance)},
    }  # fmt: skip


def drake(problem: Problem, task: Task, starts: int) -> Array | None:
    """Ask Drake's inverse kinematics with SNOPT; the least motion of all starts counts."""
    found = dataset_script("answer_drake").least(scene_of(problem, task), starts)
    return None if found is None else np.array(found)


# ---------------------------------------------------------------------------------------------------------------- SCIP


def scip(problem: Problem, task: Task, feasibility: float) -> Array | None:
    """Ask SCIP for the least motion, at a feasibility tolerance; lengths in units of the larger part.

    Parts that must come apart have a plane between them; parts that must touch, and are apart, a common point. The
    cost of a turn is that of its chord, 2 sin(t / 2): the least by it is the least for turns that are small.
    """
    solver = library("pyscipopt")
    total, P, Q, L, unit = solver.quicksum, *_normalised(task)
    turning = len(task.weights) == 6
    model = solver.Model()
    model.hideOutput()
    model.setParam("limits/time", SECONDS)
    model.setParam("numerics/feastol", feasibility)

    def variables(count: int, low: float, high: float) -> list[Any]:
        return [model.addVar(lb=low, ub=high) for _ in range(count)]

    shift = variables(3, -2.0, 2.0)
    v = variables(3, -1.0, 1.0) if turning else []
    R: Any = np.eye(3).tolist()
    if turning:
        (w,), (a, b, c), R = variables(1, 0.0, 1.0), v, [variables(3, -1.0, 1.0) for _ in range(3)]
        model.addCons(w * w + total(x * x for x in v) == 1)
        entries = [
            [w * w + a * a - b * b - c * c, 2 * (a * b - w * c), 2 * (a * c + w * b)],
            [2 * (a * b + w * c), w * w - a * a + b * b - c * c, 2 * (b * c - w * a)],
            [2 * (a * c - w * b), 2 * (b * c + w * a), w * w - a * a - b * b + c * c],
        ]
        for i in range(3):
            for j in range(3):
                model.addCons(R[i][j] == entries[i][j])
    else:
        rates = np.column_stack([task.transform(step)[:3, 3] for step in np.eye(len(task.weights))])
        amounts = variables(len(task.weights), -2.0, 2.0)
        for i in range(3):
            model.addCons(shift[i] == total(float(rates[i, k]) * x for k, x in enumerate(amounts)))
    if task.gap(task.rest) > task.need:
        inner, outer, point = variables(len(P), 0.0, 1.0), variables(len(Q), 0.0, 1.0), variables(3, -3.0, 3.0)
        model.addCons(total(inner) == 1)
        model.addCons(total(outer) == 1)
        for i in range(3):
            model.addCons(point[i] == total(x * float(p[i]) for x, p in zip(inner, P, strict=True)))
        for i in range(3):
            here = total(R[i][j] * point[j] for j in range(3)) + shift[i]
            model.addCons(here == total(x * float(q[i]) for x, q in zip(outer, Q, strict=True)))
    else:
        n, (height, across) = variables(3, -1.0, 1.0), variables(2, -5.0, 5.0)
        turned = variables(3, -3.0, 3.0)
        model.addCons(total(x * x for x in n) == 1)
        model.addCons(across == total(n[i] * shift[i] for i in range(3)))
        for j in range(3):
            model.addCons(turned[j] == total(R[i][j] * n[i] for i in range(3)))
        for p in P:
            model.addCons(total(float(p[j]) * turned[j] for j in range(3)) + across <= height)
        for q in Q:
            model.addCons(total(float(q[j]) * n[j] for j in range(3)) >= height)
    cost = model.addVar(lb=0.0)
    moved = shift if turning else amounts
    model.addCons(cost >= total(x * x for x in moved) + 4 * L * L * total(x * x for x in v))
    model.setObjective(cost)
    model.optimize()
    if model.getStatus() != "optimal":
        return None
    found = [unit * model.getVal(x) for x in moved]
    if turning:
        sine = np.array([model.getVal(x) for x in v])
        length = float(np.linalg.norm(sine))
        found += (sine * (2 * math.atan2(length, model.getVal(w)) / length if length else 2.0)).tolist()
    return np.array(found)


def _normalised(task: Task) -> tuple[Array, Array, float, float]:
    """Return corners of both parts about the movable seed, the length of a radian, and the unit of all three."""
    (one,), (two,), s = task.movable.parts, task.static.parts, task.movable.seed
    P = (one.vertices - s) * task.target[0]
    Q = task.static.seed - s + (two.vertices - task.static.seed) * task.target[1]
    unit = float(np.ptp(np.vstack([P, Q]), axis=0).max())
    return P / unit, Q / unit, float(task.weights[-1]) / unit, unit


# ----------------------------------------------------------------------------------------------------------- intervals


def enclosed(problem: Problem, task: Task, width: float) -> Array | None:
    """Return the least motion of one parameter, proved by intervals of codac to a relative width.

    An interval of parameters is proved apart by the plane that parts best in its middle, evaluated with intervals, and
    proved overlapping by a point that is deep in both there. Intervals are halved until they are; the first that is
    not, to the width, holds the contact.
    """
    with rounding_upward():
        proof = _Proof(library("codac"), task)
        if not (proof.apart or proof.overlapping):
            return task.rest
        ends = [found for sign in (1.0, -1.0) if (found := proof.first(sign, width)) is not None]
    best = min(ends, key=abs, default=None)
    return None if best is None else np.array([best])


class _Proof:
    """Two parts under one parameter: what can be proved of an interval of it."""

    def __init__(self, codac: Any, task: Task) -> None:
        self.codac, self.task = codac, task
        gap = task.gap(task.rest)
        self.overlapping, self.apart = gap < task.need, gap > task.need and task.must_touch
        (one,), (two,) = task.movable.parts, task.static.parts
        self.P = task.movable.seed + (one.vertices - task.movable.seed) * task.target[0]
        self.Q = task.static.seed + (two.vertices - task.static.seed) * task.target[1]
        self.spin = None
        if not task.motion.shifts:  # one turn: T(q) x = s + R(q) (x - s)
            turn = task.transform(np.array([1e-3]))[:3, :3]
            axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
            self.spin = axis / np.linalg.norm(axis)
        self.way = task.transform(np.array([1.0]))[:3, 3]

    def first(self, sign: float, width: float) -> float | None:
        """Return where what is asked begins on one side of rest, None where it does not within the scan."""
        step = 0.5 * self.task.unit / float(self.task.weights[0])
        start, done = 0.0, 0
        while done < SCAN * NARROW:
            if step <= width * max(start, step) or step < 1e-300:
                return sign * (start + step)
            ends = sorted((sign * start, sign * (start + step)))
            done += 1
            if self._holds(*ends):
                start, step = start + step, 1.5 * step
                if start > SCAN * 0.5 * self.task.unit / float(self.task.weights[0]) or (
                    self.spin is not None and start > math.pi
                ):
                    return None
            else:
                step *= 0.5
        return None

    def _holds(self, low: float, high: float) -> bool:
        """Tell whether it is proved of an interval that nothing changes: apart, or overlapping."""
        middle = np.array([(low + high) / 2])
        q = self.codac.Interval(low, high)
        if self.apart:
            _, rows, separations = self.task.separations((0, 0), self.task.pose(middle))
            n = rows[int(np.argmax(separations)), :3]
            inner = [self._along(n, p, q).ub() for p in self.P]
            return max(inner) < float((self.Q @ n).min()) - 1e-15
        return self._deep(middle, q)

    def _along(self, n: Array, p: Array, q: Any) -> Any:
        """Return n . T(q) p over an interval."""
        if self.spin is None:
            return float(n @ p) + q * float(n @ self.way)
        s, u = self.task.movable.seed, self.spin
        r = p - s
        along = float(u @ r)
        c, w = self.codac.cos(q), self.codac.sin(q)
        return float(n @ s) + along * float(n @ u) + c * float(n @ (r - along * u)) + w * float(n @ np.cross(u, r))

    def _deep(self, middle: Array, q: Any) -> bool:
        """Tell whether some point fixed to part 1 is within part 2 for all of an interval."""
        from scipy.optimize import linprog

        T = self.task.transform(middle)
        moved = self.P @ T[:3, :3].T + T[:3, 3]
        one, two = _planes(moved.tobytes(), len(moved)), _planes(self.Q.tobytes(), len(self.Q))
        A = np.vstack([one, two])
        made = linprog([0, 0, 0, -1], np.column_stack([A[:, :3], np.ones(len(A))]), -A[:, 3], bounds=[(None, None)] * 4)
        if not made.success or made.x[3] <= 0:
            return False
        own = T[:3, :3].T @ (made.x[:3] - T[:3, 3])
        return all(self._along(row[:3], own, q).ub() + float(row[3]) < 0 for row in two)


@cache
def _planes(raw: bytes, count: int) -> Array:
    from scipy.spatial import ConvexHull

    return np.asarray(ConvexHull(np.frombuffer(raw).reshape(count, 3)).equations)


# ------------------------------------------------------------------------------------------------------- what they take


def no_joint(problem: Problem) -> str | None:
    """Tell why Drake is not asked."""
    steps = problem.to_dict()["case"][0]["motion"]
    centres = [step.get("centre") for step in steps if "rotation" in step]
    if any("screw" in step for step in steps) or any(centre != "seed" for centre in centres):
        return "joints for shifts, turns about the seed, and six parameters only"
    if problem.amount != "weighted" or problem.keep_out or problem.pair != "any":
        return "asked with the weighted amount alone, without keep-outs and other states of the pair"
    parts = (*problem.movable.parts, *problem.static.parts)
    if max(len(part.vertices) for part in parts) > MANY:
        return f"parts of no more than {MANY} vertices: a distance of larger ones with parallel faces may never return"
    return None if problem.goal in ("touch", "clear") else "distances do not tell features: goals touch and clear only"


def few(problem: Problem) -> str | None:
    """Tell why a global solver is not asked: one small convex part a body, nothing but the goal."""
    parts = (*problem.movable.parts, *problem.static.parts)
    if len(parts) > 2 or sum(len(part.vertices) for part in parts) > FEW:
        return f"one convex part a body, and no more than {FEW} vertices"
    if np.isfinite(problem.limits).any() or problem.clearance:
        return "asked without limits and clearances"
    return no_joint(problem)


def no_program(problem: Problem) -> str | None:
    """Tell why SCIP is not asked."""
    steps = problem.to_dict()["case"][0]["motion"]
    if not (problem.motion.shifts or (len(steps) == 1 and "free" in steps[0])):
        return "shifts, or six parameters"
    return few(problem)


def no_interval(problem: Problem) -> str | None:
    """Tell why intervals are not asked."""
    if len(problem.motion.parameters) > 1:
        return "proofs by intervals of one parameter only"
    return few(problem)
