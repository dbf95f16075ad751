"""Truth about a posed pair of bodies in rationals: contact lines of named features, where two meet, gaps.

The 4x4 pose is taken as given, entry by entry: rational, not exactly orthogonal.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from oracles import ExactCurve, cross, dot, exact_curve, minus, rational

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.problem.problem import Problem

Line = tuple[Fraction, Fraction, Fraction]


def placed(body: Body, points: Any, pose: Any = None) -> list[tuple[Any, Any]]:
    """Points of a body as (base, arm): at scale rho a point is base + rho * arm."""
    (seed,) = rational([body.seed])
    rows = rational(np.eye(4) if pose is None else np.asarray(pose))[:3]
    base = tuple(dot(row, seed) + row[3] for row in rows)
    return [(base, tuple(dot(row, minus(point, seed)) for row in rows)) for point in rational(points)]


def line_of(normal: Sequence[Any], one: tuple[Any, Any], two: tuple[Any, Any]) -> Line:
    """(a, b, c) of two points that meet with a given normal, not normalised."""
    return dot(normal, one[1]), -dot(normal, two[1]), dot(normal, minus(two[0], one[0]))


def exact_line(movable: Body, static: Body, feature: Feature, transform: Any) -> Line:
    """(a, b, c) of a feature's contact line, up to a factor of either sign."""
    one, two = (
        placed(body, [body.vertices[label - 1] for label in element.vertices], pose)
        for body, element, pose in ((movable, feature.one, transform), (static, feature.two, None))
    )
    sides = [[minus(arm, points[0][1]) for _, arm in points[1:]] for points in (one, two)]
    spans = {"F1V2": sides[0][:2], "V1F2": sides[1][:2], "E1E2": [side[0] for side in sides if side]}[feature.kind]
    return line_of(cross(*spans), one[0], two[0])


def exact_meeting(problem: Problem, features: Sequence[Feature], transform: Any) -> tuple[Fraction, Fraction]:
    """Scale pair at which two contacts hold at once, by Cramer's rule."""
    lines = (exact_line(problem.movable, problem.static, feature, transform) for feature in features)
    (a, b, c), (d, e, f) = lines
    return (c * e - b * f) / (a * e - b * d), (a * f - c * d) / (a * e - b * d)


def exact_of(movable: Body, static: Body, transform: Any) -> ExactCurve:
    """The exact curve of two bodies as the package holds them, body 1 moved."""
    parts = [_own_rows(body) for body in (movable, static)]
    return exact_curve(movable.vertices, movable.seed, static.vertices, static.seed, parts1=parts[0], parts2=parts[1],
                       pose=transform)  # fmt: skip


def exact_gap(problem: Problem, transform: Any, rho: Any = None) -> float:
    """Signed gap over facet directions, of the target pair unless another is given."""
    return exact_of(problem.movable, problem.static, transform).gap(problem.target if rho is None else rho)


def _own_rows(body: Body) -> list[list[int]]:
    rows = {tuple(vertex): k for k, vertex in enumerate(body.vertices.tolist())}
    return [[rows[tuple(vertex)] for vertex in part.vertices.tolist()] for part in body.parts]
