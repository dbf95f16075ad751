"""What holds a least motion: the active sets that tell the regions of a map apart."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fcdm_opt.along.holding import Holding
from fcdm_opt.along.variation import Layout
from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import Contact, located, supporting_contact, touching_contact
from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.task import Parts, Task
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.tolerances import DEFAULT


@dataclass(frozen=True, order=True)
class ActiveSet:
    """What holds a motion: pairs of sizes that share it make a region of the map.

    Attributes
    ----------
    kind : str
        "motion", "already satisfied", "no motion", "outside the fit" or "not verified".
    features : tuple of str
        Labels of the features that are in contact after the motion, or as near as they may be.
    active : tuple of str
        Limits that are reached, and what else holds the motion besides the features.
    """

    kind: str
    features: tuple[str, ...] = ()
    active: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "; ".join((*self.features, *self.active)) or self.kind


SATISFIED, NOTHING, REJECTED = ActiveSet("already satisfied"), ActiveSet("no motion"), ActiveSet("not verified")
OUTSIDE = ActiveSet("outside the fit")


def active_set(solution: Solution) -> ActiveSet:
    """Return what holds the motion of a solution, read off the geometry: the same whichever stage found it."""
    if solution.status is Status.OUTSIDE_FIT:
        return OUTSIDE
    if not solution.usable:
        return REJECTED if solution.status.found else NOTHING
    if solution.amount == 0.0:
        return SATISFIED
    task, q = Task.of(solution.problem), np.array(list(solution.parameters.values()))
    features = [feature.label for feature in solution.features] if task.tracked else []
    if np.isfinite(task.needs).any():
        features += [label for label in _nearest(task, q) if label not in features]
    active = list(_side(task))
    slack = DEFAULT.touch * task.size
    for k, name in enumerate(solution.parameters):
        low, high = solution.problem.limits[k]
        for limit, which in ((low, "lower"), (high, "upper")):
            if abs(q[k] - limit) * task.weights[k] <= slack:
                active.append(f"{which} limit of {name}")
    if task.tracked:
        groups = Holding(task, q, Layout.of(task), solution.problem.limits).groups()
        names = {rate.name for group in groups for rates in group for rate in rates}
        active += sorted(name for name in names if "limit of" not in name)
    return ActiveSet("motion", tuple(sorted(features)), tuple(active))


def _side(task: Task) -> Iterator[str]:
    """Yield which side of contact the pair is on at rest: the amount, not the motion, has a kink where it touches."""
    if task.must_touch:
        yield "closes a gap" if task.gap(task.rest) > 0 else "removes an overlap"
    elif task.tracked:
        gaps = task.line_gaps(task.rest)[1]
        if len(gaps) == 1:
            yield "closes a gap" if gaps[0] > 0 else "removes an overlap"


def _nearest(task: Task, q: Array) -> list[str]:
    """Return the features of the part pairs that are just as far apart as they must be."""
    slack = DEFAULT.touch * task.size
    near = task.pair_gaps(q) - task.needs <= slack
    labels = []
    for i, j in np.argwhere(near).tolist():
        prefix = "" if task.opponents[j].keep_out < 0 else f"{task.named((i, j))} "
        labels.append(f"{prefix}{_feature(task, q, (i, j), slack).label}")
    return list(dict.fromkeys(labels))


def _feature(task: Task, q: Array, parts: Parts, slack: float) -> Feature:
    one, opponent = task.movable.parts[parts[0]], task.opponents[parts[1]]
    two, rho = opponent.part, np.array([task.target[0], opponent.scale])
    pose = task.pose(q)
    _, rows, separations = task.separations(parts, pose)
    pose = np.append(pose[:9], pose[9:] + two.seed - task.static.seed)
    contact: Contact
    if opponent.need > slack:
        normal = task.way_between(parts, q)
        normal = normal / np.linalg.norm(normal)
        gap = kernels.separation(*one.packed, *two.packed, pose, rho, normal)
        pose = np.append(pose[:9], pose[9:] - gap * normal)
        contact = supporting_contact(one, two, normal, pose, DEFAULT.touch)
    else:
        contact = touching_contact(one, two, rows[separations >= separations.max() - slack, :3], pose, DEFAULT.touch)
    return located(one, two, pose, contact, rho).feature
