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
    """Return how part pairs keep apart as drawn: unit normals, (k, 3), and the rows (a, b, c) of their lines, (k, 3).

    Of each pair the facet direction of its largest separation at the nominal sizes. Of pairs that overlap there, none.
    """
    pose, slack = relative_pose(problem.movable, problem.static, REST), DEFAULT.snap * problem.size
    rho = problem.nominal_pair
    rows = kernels.widest_rows(*problem.movable.packed, *problem.static.packed, pose, rho)
    rows = rows[rows[:, 5] - rows[:, 3:5] @ rho >= -slack]
    return rows[:, :3], rows[:, 3:]


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
    normals, lines = _walls(problem)
    if not len(normals):
        return None
    keys = np.round(normals / np.sqrt(DEFAULT.tie)).astype(np.int64)
    gaps = lines[:, 2] - lines[:, :2] @ problem.target
    tightest: dict[tuple[int, ...], int] = {}
    for k in np.argsort(-gaps).tolist():
        tightest[tuple(keys[k].tolist())] = k
    found, least = None, -problem.contact_slack
    for key, k in tightest.items():
        j = tightest.get(tuple(-x for x in key))
        if j is None or not gaps[k] + gaps[j] < least:
            continue
        width = (lines[k, :2] + lines[j, :2]) * problem.target
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
    return f"does not fit: {inner} {found.inner:.{places}f} in {outer} {found.outer:.{places}f}{unit}"
