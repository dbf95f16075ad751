"""The plane of scales: what of it a picture shows, and what of straight pieces lies inside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.geometry.arrays import Array

if TYPE_CHECKING:
    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.problem.solution import Solution

MARGIN, LEAST_EXTENT = 0.3, 0.05
"""Room around what must be seen, as a share of its extent; the extent is at least this share of rho."""


def marked(problem: Problem, solution: Solution | None) -> list[Array]:
    """Return the points that are marked: nominal pair, target, and the tracked point after the motion."""
    after = None if solution is None else solution.rho
    return [problem.nominal_pair, problem.target, *([] if after is None else [after])]


def tolerance_box(problem: Problem) -> Array:
    """Corners (2, 2) of the tolerance box around the nominal pair, lower then upper; without tolerances the pair."""
    minus, plus = np.zeros((2, 2)) if problem.tolerance is None else np.transpose(problem.tolerance)
    return np.array([problem.nominal_pair * (1.0 - minus), problem.nominal_pair * (1.0 + plus)])


def window(problem: Problem, solution: Solution | None, more: Sequence[Array] = ()) -> Array:
    """Limits (2, 2) of an enlarged picture: tolerance box, marked points and `more`, with a margin; never empty."""
    points = [*marked(problem, solution), *tolerance_box(problem), *more]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    extent = np.maximum(high - low, LEAST_EXTENT * high)
    margin = MARGIN * np.maximum(extent, extent.max() / 2)
    return np.column_stack([np.maximum(low - margin, low / 2.0), high + margin])


def reaching(curve: DecisionCurve, window: ArrayLike) -> DecisionCurve:
    """Return the curve listed over its box and a window, which may reach beyond it."""
    box, seen = np.asarray(curve.box), np.asarray(window, dtype=float)
    low, high = np.minimum(box[:, 0], seen[:, 0]), np.maximum(box[:, 1], seen[:, 1])
    if (low == box[:, 0]).all() and (high == box[:, 1]).all():
        return curve
    (a, b), (c, d) = np.column_stack([low, high]).tolist()
    return replace(curve, box=((a, b), (c, d)))


def pieces(curve: DecisionCurve) -> Array:
    """Return the ends of a curve's segments, (n, 2, 2)."""
    return np.array([[segment.start, segment.end] for segment in curve.segments]).reshape(-1, 2, 2)


def path(ends: Array) -> Array:
    """Return straight pieces (n, 2, 2) as one path (m, 2) that a picture draws: nan parts what does not go on."""
    joins = np.abs(ends[1:, 0] - ends[:-1, 1]).max(axis=1, initial=0.0) == 0.0
    corners = []
    for (start, end), goes_on in zip(ends, [False, *joins], strict=True):
        corners += [end] if goes_on else [(np.nan, np.nan), start, end]
    return np.array(corners[1:], dtype=float).reshape(-1, 2)


def clipped(lines: ArrayLike, window: ArrayLike) -> tuple[Array, Any]:
    """Return the parts inside a window of straight pieces (n, 2, 2) that pass through it, and which these are.

    Parameters
    ----------
    lines : (n, 2, 2) array
        Both ends of each piece; those that are not finite are outside.
    window : (2, 2) array
        Low and high of both scales.

    Returns
    -------
    parts : (k, 2, 2) array
    inside : (n,) array of bool
    """
    whole = np.asarray(lines, dtype=float).reshape(-1, 2, 2)
    low, high = np.asarray(window, dtype=float).T
    start = whole[:, 0]
    with np.errstate(all="ignore"):
        step = whole[:, 1] - start
        ends = np.sort((np.array([low, high]) - start[:, None]) / step[:, None], axis=1)  # (n, low or high, axis)
    still = step == 0.0
    within = (low <= start) & (start <= high)
    enter = np.where(still, np.where(within, -np.inf, np.inf), ends[:, 0]).max(axis=1, initial=0.0)
    leave = np.where(still, np.where(within, np.inf, -np.inf), ends[:, 1]).min(axis=1, initial=1.0)
    inside = np.isfinite(start + step).all(axis=1) & (enter < leave)
    shares, kept = np.array([enter, leave]).T[inside], whole[inside]
    return kept[:, :1] + shares[:, :, None] * (kept[:, 1:] - kept[:, :1]), inside
