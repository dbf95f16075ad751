"""How a problem is drawn on a notebook's card: in the plane of scales, about the tolerance box."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fcdm_opt.problem.problem import TRACKING
from fcdm_opt.show.notebook.pictures import Area, Mark, Point, plane
from fcdm_opt.show.notebook.words import Html, card, counted, listing, number, numbers, rows

if TYPE_CHECKING:
    from fcdm_opt.geometry.arrays import Array
    from fcdm_opt.geometry.bodies import Body
    from fcdm_opt.problem.problem import Problem

MARGIN, LEAST = 0.4, 0.05
"""Room about what must be seen, as a share of its extent, which is at least this share of the scales."""


def problem_card(problem: Problem) -> Html:
    """Return the card of a problem: what is asked, and the plane of scales about it."""
    parameters = problem.motion.parameters
    length = problem.unit or "length"
    units = [(name, "deg" if kind == "rotation" else length) for name, kind in parameters]
    held = [
        f"{name} from {number(in_unit(low, unit))} to {number(in_unit(high, unit))} {unit}"
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
    return card(card_title("Problem", problem), facts, *lists, state="to be solved", picture=picture)


def card_title(what: str, problem: Problem) -> str:
    """Return what a card is of, with the case's name."""
    return f"{what}: {problem.name}" if problem.name else what


def _body(body: Body) -> str:
    return f"{body.name}, {counted(len(body.corners), 'corner')}, {counted(len(body.parts), 'part')}"


def in_unit(value: float, unit: str) -> float:
    """Return a parameter in the unit that it is shown in."""
    return math.degrees(value) if unit == "deg" else value


def scales_picture(problem: Problem, pose: Array | None = None, rho: Array | None = None) -> Html:
    """Return the curve about the nominal pair, tolerances, and the pair made; after a motion, the curve then too.

    Star: nominal pair; diamond: the pair made; circle: the tracked point after the motion.
    """
    from fcdm_opt.curve.decision_curve import decision_curve
    from fcdm_opt.show.notebook.curve_card import curve_lines, switching_points

    tracked = problem.goal in TRACKING
    nominal, made = problem.nominal_pair, problem.target
    points = [
        Point(nominal, "nominal", f"nominal pair ({numbers(nominal)})", "nominal pair"),
        Point(made, "target", f"pair made ({numbers(made)})", "pair made"),
    ]
    if tracked and rho is not None:
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
