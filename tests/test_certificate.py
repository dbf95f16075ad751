"""The judge: published motions pass, and every planted error fails the check that is meant to catch it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles import cross, dot, exact_curve, minus, rational

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.bodies import Body, Element
from fcdm_opt.motion import Rotation, Translation
from fcdm_opt.tolerance.certificate import verify
from fcdm_opt.tolerance.files import load_problems
from fcdm_opt.tolerance.problem import Problem
from fcdm_opt.tolerance.solution import Certificate, Solution, Status
from fcdm_opt.tolerances import DEFAULT

PROBLEMS = Path(__file__).parent.parent / "problems"
NOMINAL = {  # published features of SW3 and SW1
    "example1": ("F1V2(P1V1,V3,V4,V6; P2V2)", "E1E2(P1V1,V4; P2V1,V2)"),
    "example2": ("V1F2(P1V5; P2V4,V5,V10,V11)", "V1F2(P1V4; P2V3,V4,V9,V10)"),
}
CASES = [(file, case) for file in NOMINAL for case in "ABCD"]


@cache
def problems(file: str) -> dict[str, Problem]:
    return {problem.name: problem for problem in load_problems(PROBLEMS / f"{file}.toml")}


# ----------------------------------------------------------------------------------------------------- exact truth


def placed(body: Body, labels: tuple[int, ...], pose: Any) -> list[tuple[Any, Any]]:
    """Points of a body as (base, arm): base + rho * arm, in rationals."""
    (seed,) = rational([body.seed])
    made = []
    for (point,) in (rational([body.vertices[label - 1]]) for label in labels):
        arm = minus(point, seed)
        made.append((tuple(dot(row, seed) + row[3] for row in pose), tuple(dot(row, arm) for row in pose)))
    return made


def exact_line(problem: Problem, feature: Feature, transform: Any) -> tuple[Fraction, Fraction, Fraction]:
    """(a, b, c) of a contact line in rationals, up to a common factor."""
    T = rational(np.asarray(transform))[:3]
    one = placed(problem.movable, feature.one.vertices, T)
    two = placed(problem.static, feature.two.vertices, rational(np.eye(4))[:3])
    sides = [[minus(arm, points[0][1]) for _, arm in points[1:]] for points in (one, two)]
    n = {"F1V2": lambda: cross(*sides[0][:2]), "V1F2": lambda: cross(*sides[1][:2]),
         "E1E2": lambda: cross(sides[0][0], sides[1][0])}[feature.kind]()  # fmt: skip
    return dot(n, one[0][1]), -dot(n, two[0][1]), dot(n, minus(two[0][0], one[0][0]))


def exact_meeting(problem: Problem, features: tuple[Feature, ...], transform: Any) -> np.ndarray:
    """Scale pair at which two contacts hold at once, by Cramer's rule in rationals."""
    (a, b, c), (d, e, f) = (exact_line(problem, feature, transform) for feature in features)
    return np.array([float((c * e - b * f) / (a * e - b * d)), float((a * f - c * d) / (a * e - b * d))])


def own_parts(body: Body) -> list[list[int]]:
    rows = {tuple(vertex): k for k, vertex in enumerate(body.vertices.tolist())}
    return [[rows[tuple(vertex)] for vertex in part.vertices.tolist()] for part in body.parts]


def exact_gap(problem: Problem, transform: Any) -> float:
    one, two = problem.movable, problem.static
    curve = exact_curve(one.vertices, one.seed, two.vertices, two.seed, parts1=own_parts(one), parts2=own_parts(two),
                        pose=transform)  # fmt: skip
    return curve.gap(problem.target)


def stated(problem: Problem, gap: float) -> str:
    limit = DEFAULT.touch * problem.static.size
    return "touching" if abs(gap) <= limit else "apart" if gap > 0 else "overlapping"


def claimed(problem: Problem, q: Any, labels: tuple[str, ...], rho: Any = None, **changes: Any) -> Solution:
    """A solution with these parameters, everything else worked out in rationals."""
    names = [parameter.name for parameter in problem.motion.parameters]
    transform = problem.motion.transform(q, problem.movable.seed, problem.static.seed)
    features = tuple(map(Feature.from_label, labels))
    gap = exact_gap(problem, transform)
    state = stated(problem, gap)
    overlaps = state == "overlapping"
    made = Solution(
        problem=problem, status=Status.PAIR_OVERLAPS if overlaps else Status.SOLVED,
        parameters=dict(zip(names, map(float, q), strict=True)), transform=transform,
        amount=float(np.linalg.norm(problem.weights * q)),
        rho=exact_meeting(problem, features, transform) if rho is None else np.asarray(rho, dtype=np.float64),
        features=features, pair=problem.target, pair_gap=gap, pair_state=state,
    )  # fmt: skip
    return replace(made, **changes)


@cache
def published(file: str, case: str) -> Solution:
    problem = problems(file)[case]
    assert problem.published is not None
    return claimed(problem, problem.published, NOMINAL[file])


def failed(certificate: Certificate) -> set[str]:
    return {check.name for check in certificate.failed}


def tell(certificate: Certificate) -> str:
    return "\n".join(map(str, certificate.failed))

