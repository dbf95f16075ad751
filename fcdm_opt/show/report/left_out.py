"""What a case was solved without: sentences, each true of the problem at hand."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fcdm_opt.geometry.units import measured
from fcdm_opt.problem.problem import TRACKING
from fcdm_opt.problem.solution import Solution
from fcdm_opt.show.tables import CLOSED, bound_text


def left_out(solution: Solution) -> list[str]:
    """Return what was not modelled, or not looked at, and why."""
    parts = (_shape, _sizes, _way, _pair, _others, _parameters, _program, _bound)
    return [sentence for part in parts for sentence in part(solution)]


def _shape(solution: Solution) -> Iterator[str]:
    problem = solution.problem
    yield (
        "Sizes change uniformly about the seed, which is the datum: no other error of shape, position or angle is "
        "modelled. Bodies are rigid; forces, friction and gravity are not modelled."
    )
    keep_outs = [keep_out.body for keep_out in problem.keep_out]
    for body in (problem.movable, problem.static, *keep_outs):
        if any(body.deviation):
            outward, inward = (measured(f"{length:.3g}", problem.unit) for length in body.deviation)
            yield (
                f"{body.name} is approximated by convex parts, which stick out of the solid by at most {outward} "
                f"and fall short of it by at most {inward}: the numbers hold for the parts."
            )


def _sizes(solution: Solution) -> Iterator[str]:
    problem = solution.problem
    first, second = (f"{scale:.9g}" for scale in problem.target)
    if problem.tolerance is None:
        yield f"One pair of sizes was solved, ({first}, {second}): others have other motions."
    else:
        yield (
            f"One corner of the tolerances was solved, the sizes ({first}, {second}): parts made otherwise have other "
            "motions."
        )
    if problem.snapped is not None:
        asked = ", ".join(f"{scale:.9g}" for scale in problem.snapped.asked)
        gap = measured(f"{problem.snapped.gap:.3g}", problem.unit)
        yield (
            f"The nominal sizes asked for, ({asked}), leave a gap of {gap}; they were closed to "
            "the decision curve, and that gap is not part of the question."
        )


def _way(solution: Solution) -> Iterator[str]:
    problem = solution.problem
    if problem.goal not in TRACKING:
        yield "The way there was not looked at: the bodies may collide before the motion ends."
    elif problem.path == "coherent":
        yield (
            "On the straight way there the tracked features stay the contact, at the scales of the tracked point "
            '(path "coherent"). Whether the parts made collide before the motion ends was not looked at.'
        )
    else:
        yield (
            'The way there was not looked at (path "free"): the tracked features need not stay the contact, and the '
            "bodies may collide before the motion ends."
        )


def _pair(solution: Solution) -> Iterator[str]:
    problem = solution.problem
    if problem.goal == "beyond" and problem.pair == "any":
        yield (
            'Goal "beyond" speaks of the tracked contact only: whether the parts made are apart, touch or overlap was '
            'not asked for (pair "any"), only found out.'
        )


def _others(solution: Solution) -> Iterator[str]:
    names = ", ".join(keep_out.name for keep_out in solution.problem.keep_out)
    if names:
        yield f"Keep-outs count where the motion ends, not on the way: {names}. Other bodies are not modelled."
    else:
        yield "No keep-out counts here: nothing but these two bodies was looked at."


def _parameters(solution: Solution) -> Iterator[str]:
    problem = solution.problem
    named = zip(problem.motion.parameters, problem.limits.tolist(), strict=True)
    free = [own.name for own, limits in named if not any(map(math.isfinite, limits))]
    if free:
        yield f"No limits are set for {', '.join(free)}."
    if problem.resolution is None:
        yield "The motion is exact: it was not rounded to the steps of a machine."


def _program(solution: Solution) -> Iterator[str]:
    counts = solution.modelled
    if not counts:
        return
    if not counts["part_pairs_kept"]:
        why = "nothing is to do" if solution.status.found else "there is no motion"
        yield f"No part pair is in a program that a motion solves, as {why}."
        return
    nouns = {"part_pairs": "part pairs", "features": "pairs of elements"}
    rest = {
        noun: (counts[f"{key}_total"] - counts[f"{key}_kept"], counts[f"{key}_total"]) for key, noun in nouns.items()
    }
    missing = [f"{less} of {total} {noun}" for noun, (less, total) in rest.items() if less > 0]
    if missing:
        yield (
            f"{' and '.join(missing)} are not in the program that the motion solves: bounds tell them to be out of "
            "reach, or the motion found does not violate them. The judge looks at the bodies as a whole."
        )


def _bound(solution: Solution) -> Iterator[str]:
    if not solution.status.found:
        if math.isfinite(solution.lower_bound):
            yield "That there is no motion is not proved."
    elif solution.amount > 0 and not solution.lower_bound > 0:
        yield "How small a motion can be at all is not proved."
    elif not abs(solution.gap) < CLOSED:
        least = measured(bound_text(solution).splitlines()[0], solution.problem.amount_unit)
        yield f"It is proved that no motion below an amount of {least} does; not that this one is the smallest."
