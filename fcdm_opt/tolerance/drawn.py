"""How a problem and its answer are drawn on a notebook's card: in the plane of scales, about the tolerance box."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fcdm_opt.cards import (
    Area,
    Html,
    Mark,
    Point,
    card,
    counted,
    floored,
    listing,
    number,
    numbers,
    plane,
    rows,
    sentence,
)
from fcdm_opt.tolerance.problem import TRACKING
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.geometry.arrays import Array
    from fcdm_opt.geometry.bodies import Body
    from fcdm_opt.tolerance.problem import Problem
    from fcdm_opt.tolerance.solution import Solution

MARGIN, LEAST = 0.4, 0.05
"""Room about what must be seen, as a share of its extent, which is at least this share of the scales."""


def problem_card(problem: Problem) -> Html:
    """Return the card of a problem: what is asked, and the plane of scales about it."""
    parameters = problem.motion.parameters
    length = problem.unit or "length"
    units = [(name, "deg" if kind == "rotation" else length) for name, kind in parameters]
    held = [
        f"{name} from {number(_shown(low, unit))} to {number(_shown(high, unit))} {unit}"
        for (name, unit), (low, high) in zip(units, problem.limits.tolist(), strict=True)
        if math.isfinite(low) or math.isfinite(high)
    ]
    asked = f"requirement {problem.requirement}" if problem.requirement else "explicit target"
    facts = rows(
        [
            ("movable", _body(problem.movable)),
            ("static", _body(problem.static)),
            ("keep-outs", ", ".join(own.name for own in problem.keep_out)),
            ("motion", ", ".join(name for name, _ in parameters)),
            ("goal", f'"{problem.goal}"'),
            ("made at", f"({numbers(problem.target)})", f"from ({numbers(problem.nominal_pair)}), {asked}"),
            ("clearance", number(problem.clearance) if problem.clearance else "", length),
            ("pair made must", {"clear": "be clear", "touch": "touch"}.get(problem.pair, "")),
        ]
    )
    picture = scales_picture(problem)
    tracked = listing("tracked contact", [own.label for own in problem.tracked_features])
    lists = listing("limits", held), tracked
    return card(_title("Problem", problem), facts, *lists, state="to be solved", picture=picture)


def solution_card(solution: Solution) -> Html:
    """Return the card of an answer: the advice, the motion, how small it is, and what it does to the pair made."""
    problem, status = solution.problem, solution.status.name
    mood = "bad" if not solution.usable else "mind" if status == "PAIR_OVERLAPS" else "good"
    motion, after = [], solution.rho
    length, amount = problem.unit or "length", problem.amount_unit or "length"
    for (name, kind), q, weight in zip(
        problem.motion.parameters, solution.parameters.values(), problem.weights, strict=False
    ):
        unit = "deg" if kind == "rotation" else length
        small = abs(weight * q) <= DEFAULT.tie * solution.amount  # rounding
        motion.append((f"motion {name}", number(0.0 if small else _shown(q, unit)), unit))
    contact = listing("contact", [own.label for own in solution.features])
    facts = rows(
        [
            *motion,
            ("amount", number(solution.amount), amount),
            ("proved at least", *_bound(solution, amount)),
            ("pair made", f"({numbers(solution.pair)})"),
            ("its state after", solution.pair_state, f"gap {number(solution.pair_gap)} {length}"),
            ("tracked contact at", f"({numbers(after)})" if after is not None and problem.goal in TRACKING else ""),
            ("verified", _verdict(solution)),
            ("settled by", solution.stage),
            ("time", number(sum(solution.seconds.values()), 3) if solution.seconds else "", "s"),
        ]
    )
    picture = scales_picture(problem, solution)
    title = _title("Solution", problem)
    return card(title, sentence(solution.status.value), facts, contact, state=status, mood=mood, picture=picture)


def _title(what: str, problem: Problem) -> str:
    return f"{what}: {problem.name}" if problem.name else what


def _body(body: Body) -> str:
    return f"{body.name}, {counted(len(body.vertices), 'corner')}, {counted(len(body.parts), 'part')}"


def _shown(value: float, unit: str) -> float:
    return math.degrees(value) if unit == "deg" else value


def _bound(solution: Solution, unit: str) -> tuple[str, str]:
    """Return the lower bound and how far below the amount it is."""
    if not solution.lower_bound > 0.0:
        return "0", "(nothing is proved)" if solution.amount else unit
    if math.isinf(solution.lower_bound):
        return "impossible", ""
    gap = "exact" if abs(solution.gap) <= DEFAULT.nominal else f"relative gap {number(solution.gap, 2)}"
    return floored(solution.lower_bound, 6), f"{unit}, {gap}" if math.isfinite(solution.gap) else unit


def _verdict(solution: Solution) -> str:
    certificate = solution.certificate
    if certificate is None or not solution.status.found:
        return "" if certificate is None else "no motion to verify"
    if certificate.passed:
        return f"yes, {counted(len(certificate.checks), 'check')} passed"
    return f"no: {', '.join(check.name for check in certificate.failed) or 'no checks'}"


def scales_picture(problem: Problem, solution: Solution | None = None) -> Html:
    """Return the curve about the nominal pair, tolerances, and the pair made; with an answer, the curve after it too.

    Star: nominal pair; diamond: the pair made; circle: the tracked point after the motion.
    """
    from fcdm_opt.curve.decision_curve import decision_curve
    from fcdm_opt.curve.drawn import curve_lines, switching_points

    tracked = problem.goal in TRACKING
    nominal, made = problem.nominal_pair, problem.target
    points = [
        Point(nominal, "nominal", f"nominal pair ({numbers(nominal)})", "nominal pair"),
        Point(made, "target", f"pair made ({numbers(made)})", "pair made"),
    ]
    if tracked and solution is not None and solution.rho is not None:
        rho = solution.rho
        points.append(Point(rho, "after", f"tracked contact after ({numbers(rho)})", "tracked contact after"))
    areas, corners = [], [np.asarray(point.at, dtype=np.float64) for point in points]
    if problem.tolerance is not None:
        minus, plus = np.transpose(problem.tolerance)
        low, high = nominal * (1.0 - minus), nominal * (1.0 + plus)
        corners += [low, high]
        areas.append(Area(tuple(zip(low, high, strict=True)), "tolerance", "", "tolerance"))
    if problem.goal == "beyond":
        sides = zip(made.tolist(), problem.signs.tolist(), strict=True)
        quadrant = tuple((at, math.inf) if sign > 0 else (-math.inf, at) for at, sign in sides)
        areas.append(Area(quadrant, "required", "", "required"))
    window = _window(corners)
    pose = None if solution is None else solution.transform
    lines: list[Mark] = []
    for transform, style, name in ((None, "before", "curve as drawn"), (pose, "after", "curve after the motion")):
        if style == "before" or transform is not None:
            curve = decision_curve(problem.movable, problem.static, box=window, transform=transform)
            lines += [*curve_lines(curve, style, name), *(switching_points(curve) if style == "before" else ())]
    told = f"decision curve{'' if pose is None else ' before and after the motion'}, nominal pair and pair made"
    return plane([*areas, *lines, *points], window, told=told)


def _window(corners: list[Array]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return a box about scale pairs with some room around, above 0."""
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    extent = np.maximum(high - low, LEAST * high)
    room = MARGIN * np.maximum(extent, extent.max() / 2.0)
    (a, c), (b, d) = np.maximum(low - room, low / 2.0).tolist(), (high + room).tolist()
    return (a, b), (c, d)
