"""What a problem's card says, and the plane of scales about its tolerance box."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fcdm_opt.problem.problem import TRACKING
from fcdm_opt.show.notebook.card import Card
from fcdm_opt.show.notebook.pictures import Mark, Picture, plane
from fcdm_opt.show.scales import tolerance_box, window
from fcdm_opt.show.texts import counted, in_unit, number, numbers, parameter_units

if TYPE_CHECKING:
    from fcdm_opt.geometry.bodies import Body
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.problem.solution import Solution


def problem_card(problem: Problem) -> Card:
    """Return the card of a problem: what is asked, and the plane of scales about it."""
    names = [name for name, _ in problem.motion.parameters]
    limits = [
        f"{name} from {number(in_unit(low, unit))} to {number(in_unit(high, unit))} {unit}"
        for name, unit, (low, high) in zip(names, parameter_units(problem), problem.limits.tolist(), strict=True)
        if math.isfinite(low) or math.isfinite(high)
    ]
    asked = f"requirement {problem.requirement}" if problem.requirement else "explicit target"
    facts = [
        ("movable", _body(problem.movable)),
        ("static", _body(problem.static)),
        ("keep-outs", ", ".join(keep_out.name for keep_out in problem.keep_out)),
        ("motion", ", ".join(names)),
        ("goal", f'"{problem.goal}"'),
        ("made at", f"({numbers(problem.target)})", f"from ({numbers(problem.nominal_pair)}), {asked}"),
        ("clearance", number(problem.clearance) if problem.clearance else "", problem.unit or "length"),
        ("pair made must", {"clear": "be clear", "touch": "touch"}.get(problem.pair, "")),
    ]
    return Card(
        card_title("Problem", problem),
        facts=facts,
        lists={"limits": limits, "tracked contact": [feature.label for feature in problem.tracked_features]},
        state="to be solved",
        picture=scales_picture(problem),
    )


def card_title(what: str, problem: Problem) -> str:
    """Return what a card is of, with the case's name."""
    return f"{what}: {problem.name}" if problem.name else what


def _body(body: Body) -> str:
    return f"{body.name}, {counted(len(body.corners), 'corner')}, {counted(len(body.parts), 'part')}"


def scales_picture(problem: Problem, solution: Solution | None = None) -> Picture | None:
    """Return the curve about the nominal pair, tolerances, and the pair made; after a motion, the curve then too.

    Star: nominal pair; diamond: the pair made; circle: the tracked point after the motion.
    """
    from fcdm_opt.curve.decision_curve import decision_curve
    from fcdm_opt.show.notebook.curve_card import curve_lines, switching_points

    nominal, made = problem.nominal_pair, problem.target
    pose, rho = (None, None) if solution is None else (solution.transform, solution.rho)
    signs = [
        Mark("nominal", nominal, f"nominal pair ({numbers(nominal)})", "nominal pair"),
        Mark("target", made, f"pair made ({numbers(made)})", "pair made"),
    ]
    if problem.goal in TRACKING and rho is not None:
        signs.append(Mark("tracked", rho, f"tracked contact after ({numbers(rho)})", "tracked contact after"))
    areas = []
    if problem.tolerance is not None:
        areas.append(Mark("tolerance", tolerance_box(problem).T, "", "tolerance"))
    if problem.goal == "beyond":
        far = np.where(problem.signs > 0, np.inf, -np.inf)
        areas.append(Mark("required", np.sort(np.column_stack([made, far]), axis=1), "", "required"))
    limits = window(problem, solution if problem.goal in TRACKING else None)
    (a, b), (c, d) = limits.tolist()
    box = (a, b), (c, d)
    before = decision_curve(problem.movable, problem.static, box=box)
    lines = [*curve_lines(before, "before", "curve as drawn"), *switching_points(before)]
    if pose is not None:
        after = decision_curve(problem.movable, problem.static, box=box, transform=pose)
        lines += curve_lines(after, "after", "curve after the motion")
    told = f"decision curve{'' if pose is None else ' before and after the motion'}, nominal pair and pair made"
    return plane([*areas, *lines, *signs], limits, told=told)
