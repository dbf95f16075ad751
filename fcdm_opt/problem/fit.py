"""How the parts as drawn fit into each other, and which widths of the parts made do not go together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.decision_curve import relative_pose
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.naming import told_element
from fcdm_opt.geometry.units import measured
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

REST = np.eye(4)

FAR = 2.0
"""Sizes of the larger part between the parts, from which on they are likely to be drawn in different frames."""


def _drawn(problem: Problem) -> tuple[Body, Body]:
    """Return the bodies as drawn, where the problem's are those made at given sizes."""
    own = problem.request if problem.made else {"movable": problem.movable, "static": problem.static}
    return own["movable"], own["static"]


def _walls(problem: Problem) -> tuple[Array, Array, Ints]:
    """Return how part pairs keep apart as drawn: normals, (k, 3), how far the parts made reach, and which, (k, 2).

    Of each pair the facet direction of its largest separation at the nominal sizes; of pairs that overlap there, none.
    The reaches, (k, 2), are those of body 1 along the normal and of body 2 against it, from the origin: the parts made
    are apart in this direction by minus their sum.
    """
    made = problem.movable, problem.static
    movable, static = drawn = _drawn(problem)
    if any(len(one.parts) != len(other.parts) for one, other in zip(drawn, made, strict=True)):
        return np.empty((0, 3)), np.empty((0, 2)), np.empty((0, 2), np.int64)
    pose, slack = relative_pose(movable, static, REST), DEFAULT.snap * problem.size
    rows = kernels.widest_rows(*movable.packed, *static.packed, pose, problem.nominal_pair)
    apart = np.flatnonzero(rows[:, 5] - rows[:, 3:5] @ problem.nominal_pair >= -slack)
    normals, places = rows[apart, :3], np.column_stack(np.divmod(apart, len(static.parts)))
    reaches = np.empty((len(apart), 2))
    for own, (body, rho, side) in enumerate(zip(made, problem.target, (1.0, -1.0), strict=True)):
        order = np.argsort(places[:, own], kind="stable")
        for met in np.split(order, np.flatnonzero(np.diff(places[order, own])) + 1) if len(order) else ():
            part = body.parts[places[met[0], own]]
            corners = part.seed + rho * (part.vertices - part.seed)
            reaches[met, own] = (side * normals[met] @ corners.T).max(axis=1)
    return normals, reaches, places


def holds(problem: Problem) -> bool:
    """Tell whether no shift of body 1 leads away from all parts of body 2 at once, as drawn: 0 is among the normals.

    Parts that overlap as drawn hold nothing.
    """
    from scipy.optimize import linprog

    normals, *_ = _walls(problem)
    if not len(normals):
        return False
    rows = np.hstack([normals, np.ones((len(normals), 1))])  # n.u + s <= 0 for each
    chosen = list(dict.fromkeys([*normals.argmin(axis=0).tolist(), *normals.argmax(axis=0).tolist()]))
    bounds = [(-1.0, 1.0)] * 3 + [(0.0, 1.0)]
    while True:  # with the rows alone that matter: there may be millions
        found = linprog([0.0, 0.0, 0.0, -1.0], A_ub=rows[chosen], b_ub=np.zeros(len(chosen)), bounds=bounds)
        if found.status != 0 or found.x[3] <= DEFAULT.partition:
            return True
        heights = rows @ found.x
        worst = int(heights.argmax())
        if heights[worst] <= DEFAULT.partition or worst in chosen:
            return False
        chosen.append(worst)


class Misfit(NamedTuple):
    """Two widths of the parts made that do not go together.

    `inner` and `outer` are the widths, length units, the first of body `inside` (0: movable, 1: static). `walls` are
    the faces of the other one that limit it, in words.
    """

    inside: int
    inner: float
    outer: float
    walls: tuple[str, ...] = ()


def misfit(problem: Problem) -> Misfit | None:
    """Return by which widths the parts made do not go together as drawn; None where no two walls tell.

    Part pairs that keep apart as drawn along opposite normals: the sum of their gaps does not depend on any shift. Of
    all that are closed at the target sizes, and were not as drawn, those that lack most.
    """
    normals, reaches, places = _walls(problem)
    if not len(normals):
        return None
    keys = np.round(normals / np.sqrt(DEFAULT.tie)).astype(np.int64)
    gaps = -reaches.sum(axis=1)
    order = np.argsort(gaps, kind="stable")
    first = order[np.unique(keys[order], axis=0, return_index=True)[1]]
    tightest = {tuple(keys[k].tolist()): k for k in first.tolist()}
    found, least, tie = None, -problem.contact_slack, DEFAULT.tie * problem.size
    for k, key in sorted((k, key) for key, k in tightest.items()):  # of equals the first
        j = tightest.get(tuple(-x for x in key))
        if j is None or not gaps[k] + gaps[j] < least - tie:
            continue
        width = reaches[k] + reaches[j]
        inside = 0 if width[0] > 0.0 else 1
        if not width[inside] > -width[1 - inside]:
            continue  # walls that are a little aslant, seen from far away
        least = float(gaps[k] + gaps[j])
        outer = 1 - inside
        drawn, side = _drawn(problem)[outer], (1.0, -1.0)[outer]
        walls = (_wall(drawn, drawn.parts[places[each, outer]], side * normals[each]) for each in (k, j))
        found = Misfit(inside, float(width[inside]), float(-width[outer]), tuple(dict.fromkeys(filter(None, walls))))
    return found


def _wall(body: Body, part: ConvexPart, normal: Array) -> str:
    """Return the face of a part that looks along a direction, in words; "" for one that only a cut made."""
    towards = part.normals @ normal
    best = int(towards.argmax())
    return told_element(body, part.elements["F"][best]) if towards[best] >= 1.0 - DEFAULT.side else ""


def verdict(problem: Problem) -> str:
    """Return the misfit of a problem's parts in words; empty where no two walls tell."""
    found = misfit(problem)
    if found is None:
        return ""
    places = int(max(0, 1 - np.floor(np.log10(found.inner - found.outer))))
    names = (problem.movable.name or "the movable part", problem.static.name or "the static part")
    inner, outer = names[found.inside], names[1 - found.inside]
    widths = (f"{float(f'{width:.12g}'):.{places}f}" for width in (found.inner, found.outer))  # not by rounding
    wide, room = (measured(width, problem.unit) for width in widths)
    fit = f"{inner} {wide} in {outer} {room}"
    walls = " and ".join(found.walls)
    between = f", between its {walls}" if len(found.walls) == 2 else f", across its {walls}" if walls else ""
    return f"does not fit: {fit}{between}"
