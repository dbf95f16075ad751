"""The full model: everything that a problem asks in one nonlinear program, nothing left out, from one start.

The yardstick for the stages that model no more than the scene needs: where it converges, answers must agree. Variables
are the parameters; one separating plane for each part pair that must not overlap (of the parts made, at the end; of the
tracked contact's other pairs, at each point of the way); where bodies that are apart must touch, a point that both have
in common; and the largest displacement where that is the amount. The tracked features are the contact at a point of the
way if their planes keep all vertices of both parts on their own sides and the point lies in both elements: rows for
every vertex and every side.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.model.equations import FeaturePoints
from fcdm_opt.model.task import Answer, Parts, Task
from fcdm_opt.stages import program
from fcdm_opt.stages.program import Row
from fcdm_opt.tolerances import DEFAULT

CLOSINGS = 4  # part pairs tried that may be the one to touch, nearest first
TRIALS = 3  # motions at which a row must vanish to be taken for one that always does
POINT = np.array([1.0, 0.0, 0.0, 0.0])  # what a common point starts from, see `program.minimise`


def full(task: Task) -> Answer | None:
    """Solve the full model; None where it does not converge, and for flush contacts, for which it has no rows."""
    if task.seats or any(task.flush):
        return None
    answer = modelled_in_full(task)
    if answer is None or not task.meets(answer.motion, DEFAULT.requirement):
        return None
    return replace(answer, lower_bound=min(task.displacement_bound, answer.amount))


def modelled_in_full(task: Task, *, tolerance: float = DEFAULT.solver) -> Answer | None:
    """Return what the full model gives, solved for each part pair that may be the one to touch; None for nothing."""
    # the tolerance is that of IPOPT, of scaled rows and stationarity
    asks = bool(np.isfinite(task.needs).any())
    gaps = task.pair_gaps(task.start) if asks else np.full((1, 1), np.inf)
    closings: list[Parts | None] = [None]
    if task.must_touch and task.contact_gap(gaps) > 0:
        pairs = list(np.ndindex(len(task.movable.parts), len(task.static.parts)))
        closings = [*sorted(pairs, key=lambda parts: float(gaps[parts]))[:CLOSINGS]]
    best: Answer | None = None
    for closing in closings:
        rows, planes = _everything(task, closing)
        outcome = program.minimise(task, rows, task.start, planes, "full", tolerance)
        if outcome is None or (best is not None and task.amount(outcome.q) >= best.amount):
            continue
        pairs = list(np.ndindex(len(task.movable.parts), len(task.obstacles)))
        largest = len(task.made_vertices) if task.amount_kind == "displacement" else 0
        variables = len(task.weights) + 3 * len(planes) + min(largest, 1)
        counts = task.modelled(pairs, variables=variables, constraints=len(rows) + largest, features=task.features)
        best = task.answer(outcome.q, "full model, IPOPT from one start", 0.0, ("everything",), counts)
    return best


def _everything(task: Task, closing: Parts | None) -> tuple[list[Row], Array]:
    """Return all rows, and what their planes start from; `closing`: the pair that must touch, of bodies apart."""
    rows, planes = program.goal_rows(task) if task.tracked else [], list[Array]()
    positions = np.linspace(0.0, 1.0, DEFAULT.path_points)[1:].tolist() if task.coherent else [1.0]
    for feature in task.tracked:
        kept = np.flatnonzero([_tells(task, row) for row in _real(task, feature, 1.0)])
        for s in positions:
            real = list(_real(task, feature, s))
            rows += [real[k] for k in kept]
    contacts, pose = {feature.parts for feature in task.tracked}, task.pose(task.rest)
    for i, j in np.ndindex(len(task.movable.parts), len(task.static.parts)) if task.tracked else ():
        if (i, j) not in contacts:
            one, two = task.movable.parts[i], task.static.parts[j]
            _, facets = kernels.facet_rows(*one.packed, *two.packed, pose)
            normal = facets[int(np.argmax(facets[:, 5] - facets[:, 3:5] @ task.nominal)), :3]
            sides = (1, one.vertices), (2, two.vertices - two.seed)
            for s in positions:
                rows += [
                    Row(("plane on the way", body), np.append(vertex, s), 0.0, np.inf, "", len(planes))
                    for body, vertices in sides
                    for vertex in vertices
                ]
                planes.append(_level(task, one, normal, task.nominal[0]))
    pose = task.pose(task.start)
    for i, j in np.ndindex(len(task.movable.parts), len(task.obstacles)):
        one, obstacle = task.movable.parts[i], task.obstacles[j]
        if np.isfinite(obstacle.need):
            _, facets, gaps = task.separations((i, j), pose)
            for body, need, vertices in ((1, 0.0, one.vertices), (2, obstacle.need, obstacle.placed(task.static.seed))):
                rows += [program.plane_row(task, len(planes), body, v, need, "") for v in vertices]
            planes.append(_level(task, one, facets[int(np.argmax(gaps)), :3], task.target[0]))
    if closing is not None:
        rows += program.common_rows(task, len(planes), task.movable.parts[closing[0]], task.static.parts[closing[1]])
        planes.append(POINT)
    return rows, np.array(planes).reshape(-1, 4)


def _level(task: Task, one: ConvexPart, normal: Array, scale: float) -> Array:
    """Return the plane that touches a part at a scale, without motion: its normal, and its level in units."""
    support = scale * float(((one.vertices - one.seed) @ normal).max())
    return np.append(normal, (support - normal @ (task.static.seed - task.movable.seed)) / task.unit)


def _real(task: Task, feature: FeaturePoints, s: float) -> Iterator[Row]:
    """Yield what must hold for a tracked feature to be the contact at path position s."""
    one, two = task.movable.parts[feature.parts[0]], task.static.parts[feature.parts[1]]
    scale = feature.steepness(np.eye(3))
    for body, part in ((1, one), (2, two)):
        for vertex in part.vertices:
            yield program.support_row(task, s, feature, scale, body, vertex, "")
    yield from program.element_rows(s, feature, one, two, scale * task.unit)


def _tells(task: Task, row: Row) -> bool:
    """Tell whether a row's value changes: not of the elements that define the tracked pair."""
    rng, slack = np.random.default_rng(0), DEFAULT.solver * max(1.0, task.size / task.unit)
    trials = [program.value(task, row, rng.uniform(-1.0, 1.0, len(task.weights))) for _ in range(TRIALS)]
    return any(min(abs(x - row.lower), abs(x - row.upper)) > slack for x in trials)
