"""How the parts as drawn fit into each other, and which widths of the parts made do not go together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.decision_curve import relative_pose
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

REST = np.eye(4)

FAR = 2.0
"""Sizes of the larger part between the parts, from which on they are likely to be drawn in different frames."""


def _walls(problem: Problem) -> tuple[Array, Array]:
    """Return how part pairs keep apart as drawn: unit normals, (k, 3), and how far the parts made reach along them.

    Of each pair the facet direction of its largest separation at the nominal sizes; of pairs that overlap there, none.
    The reaches, (k, 2), are those of body 1 along the normal and of body 2 against it, from the origin: the parts made
    are apart in this direction by minus their sum.
    """
    made = problem.movable, problem.static
    movable, static = drawn = [problem.request[role] for role in ("movable", "static")] if problem.made else made
    if any(len(one.parts) != len(other.parts) for one, other in zip(drawn, made, strict=True)):
        return np.empty((0, 3)), np.empty((0, 2))
    pose, slack = relative_pose(movable, static, REST), DEFAULT.snap * problem.size
    placed = [
        [part.seed + rho * (part.vertices - part.seed) for part in body.parts]
        for body, rho in zip(made, problem.target, strict=True)
    ]
    normals, reaches = [], []
    for one, inner in zip(movable.parts, placed[0], strict=True):
        for two, outer in zip(static.parts, placed[1], strict=True):
            _, rows = kernels.facet_rows(*one.packed, *two.packed, pose)
            gaps = rows[:, 5] - rows[:, 3:5] @ problem.nominal_pair
            best = int(gaps.argmax())
            if gaps[best] >= -slack:
                n = rows[best, :3]
                normals.append(n)
                reaches.append(((inner @ n).max(), -(outer @ n).min()))
    return np.reshape(normals, (-1, 3)), np.reshape(reaches, (-1, 2))


def holds(problem: Problem) -> bool:
    """Tell whether no shift of body 1 leads away from all parts of body 2 at once, as drawn: 0 is among the normals.

    Parts that overlap as drawn hold nothing.
    """
    from scipy.optimize import linprog

    normals, _ = _walls(problem)
    if not len(normals):
        return False
    rows = np.hstack([normals, np.ones((len(normals), 1))])  # n.u + s <= 0 for each
    found = linprog([0.0, 0.0, 0.0, -1.0], A_ub=rows, b_ub=np.zeros(len(rows)), bounds=[(-1.0, 1.0)] * 3 + [(0.0, 1.0)])
    return not (found.status == 0 and found.x[3] > DEFAULT.partition)


class Misfit(NamedTuple):
    """Two widths of the parts made that do not go together.

    `inner` and `outer` are the widths, length units, the first of body `inside` (0: movable, 1: static).
    """

    inside: int
    inner: float
    outer: float


def misfit(problem: Problem) -> Misfit | None:
    """Return by which widths the parts made do not go together as drawn; None where no two walls tell.

    Part pairs that keep apart as drawn along opposite normals: the sum of their gaps does not depend on any shift. Of
    all that are closed at the target sizes, and were not as drawn, those that lack most.
    """
    normals, reaches = _walls(problem)
    if not len(normals):
        return None
    keys = np.round(normals / np.sqrt(DEFAULT.tie)).astype(np.int64)
    gaps = -reaches.sum(axis=1)
    tightest: dict[tuple[int, ...], int] = {}
    for k in np.argsort(-gaps).tolist():
        tightest[tuple(keys[k].tolist())] = k
    found, least = None, -problem.contact_slack
    for key, k in tightest.items():
        j = tightest.get(tuple(-x for x in key))
        if j is None or not gaps[k] + gaps[j] < least:
            continue
        width = reaches[k] + reaches[j]
        inside = 0 if width[0] > 0.0 else 1
        if not width[inside] > -width[1 - inside]:
            continue  # walls that are a little aslant, seen from far away
        least = float(gaps[k] + gaps[j])
        found = Misfit(inside, float(width[inside]), float(-width[1 - inside]))
    return found


def verdict(problem: Problem) -> str:
    """Return the misfit of a problem's parts in words; empty where no two walls tell."""
    found = misfit(problem)
    if found is None:
        return ""
    places = int(max(0, 1 - np.floor(np.log10(found.inner - found.outer))))
    names = (problem.movable.name or "the movable part", problem.static.name or "the static part")
    inner, outer = names[found.inside], names[1 - found.inside]
    unit = f" {problem.unit}" if problem.unit else ""
    wide, room = (f"{float(f'{width:.12g}'):.{places}f}" for width in (found.inner, found.outer))  # not by rounding
    return f"does not fit: {inner} {wide} in {outer} {room}{unit}"
