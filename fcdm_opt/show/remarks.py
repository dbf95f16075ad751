"""What is to be said of a solution besides its numbers, in sentences that are true of the problem at hand.

`remarks` for every answer: contacts that were closed, keep-outs, large motions. `left_out` for a report: what the case
was solved without.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fcdm_opt.geometry.units import measured
from fcdm_opt.problem.problem import TRACKING
from fcdm_opt.problem.solution import Solution
from fcdm_opt.show.texts import CLOSED, bound_text, numbers
from fcdm_opt.tolerances import DEFAULT

LARGE, GROWTH = 0.5, 2.0
"""A corner that moves farther than this share of the smaller body's shortest side, and than this times what the sizes
change, may end on another side of the other body."""


def remarks(solution: Solution) -> list[str]:
    """Return what a table's row does not say, a sentence each."""
    told, unit = [], solution.problem.unit
    if (snapped := solution.problem.snapped) is not None:
        was = f"nominal ({numbers(snapped.asked, 9)}), where the gap was {measured(f'{snapped.gap:.3g}', unit)}"
        told.append(f"{was}, closed to the curve at ({numbers(snapped.pair, 9)})")
    for name, gap in solution.keep_out_gaps.items():
        off = f"{measured(f'{abs(gap):.4g}', unit)} {'clear' if gap > 0 else 'overlapping'}"
        state = "touching" if abs(gap) <= solution.problem.contact_slack else off
        told.append(f"keep-out {name}: {state}")
    return [*told, *_large(solution)]


def _large(solution: Solution) -> list[str]:
    """Return a warning where a motion is so large that it may have gone through the other body."""
    if not solution.status.found or solution.transform is None or solution.status.name == "OUTSIDE_FIT":
        return []
    problem = solution.problem
    movable, static = problem.movable.scaled(solution.pair[0]), problem.static.scaled(solution.pair[1])
    turned = movable.moved(solution.transform).vertices - movable.vertices
    moved = float(np.linalg.norm(turned, axis=1).max())
    extents = np.array([np.ptp(body.vertices, axis=0) for body in (movable, static)])
    side = float(extents.min())
    change = np.abs(solution.pair - problem.nominal_pair) / solution.pair @ extents.max(axis=1)
    open_way = problem.curve.gap(solution.pair) * (1.0 + DEFAULT.touch)  # none can be met sooner
    if moved <= max(LARGE * side, GROWTH * float(change), open_way):
        return []
    way, long = (measured(f"{length:.4g}", problem.unit) for length in (moved, side))
    names = [parameter.name for parameter in problem.motion.parameters]
    free = [name for name, limits in zip(names, problem.limits, strict=True) if not np.isfinite(limits).all()]
    cure = f"; limits keep it near, for instance of {', '.join(free)}" if free else ""
    return [
        f"a large motion: a corner moves by {way}, the thinner part measures {long}. It may end on another "
        f"side of the other part; the way there is not looked at{cure}"
    ]


# ------------------------------------------------------------------------------------------------------------- left out


def left_out(solution: Solution) -> list[str]:
    """Return what was not modelled, or not looked at, and why."""
    problem, unit = solution.problem, solution.problem.unit
    told = [
        "Sizes change uniformly about the seed, which is the datum: no other error of shape, position or angle is "
        "modelled. Bodies are rigid; forces, friction and gravity are not modelled."
    ]
    for body in (problem.movable, problem.static, *(keep_out.body for keep_out in problem.keep_out)):
        if any(body.deviation):
            outward, inward = (measured(f"{length:.3g}", unit) for length in body.deviation)
            told.append(
                f"{body.name} is approximated by convex parts, which stick out of the solid by at most {outward} "
                f"and fall short of it by at most {inward}: the numbers hold for the parts."
            )
    made = f"({numbers(problem.target, 9)})"
    if problem.tolerance is None:
        told.append(f"One pair of sizes was solved, {made}: others have other motions.")
    else:
        told.append(
            f"One corner of the tolerances was solved, the sizes {made}: parts made otherwise have other motions."
        )
    if problem.snapped is not None:
        told.append(
            f"The nominal sizes asked for, ({numbers(problem.snapped.asked, 9)}), leave a gap of "
            f"{measured(f'{problem.snapped.gap:.3g}', unit)}; they were closed to the decision curve, and that gap is "
            "not part of the question."
        )
    if problem.goal not in TRACKING:
        told.append("The way there was not looked at: the bodies may collide before the motion ends.")
    elif problem.path == "coherent":
        told.append(
            "On the straight way there the tracked features stay the contact, at the scales of the tracked point "
            '(path "coherent"). Whether the parts made collide before the motion ends was not looked at.'
        )
    else:
        told.append(
            'The way there was not looked at (path "free"): the tracked features need not stay the contact, and the '
            "bodies may collide before the motion ends."
        )
    if problem.goal == "beyond" and problem.pair == "any":
        told.append(
            'Goal "beyond" speaks of the tracked contact only: whether the parts made are apart, touch or overlap was '
            'not asked for (pair "any"), only found out.'
        )
    if names := ", ".join(keep_out.name for keep_out in problem.keep_out):
        told.append(f"Keep-outs count where the motion ends, not on the way: {names}. Other bodies are not modelled.")
    else:
        told.append("No keep-out counts here: nothing but these two bodies was looked at.")
    limited = zip(problem.motion.parameters, problem.limits.tolist(), strict=True)
    if free := [parameter.name for parameter, limits in limited if not any(map(math.isfinite, limits))]:
        told.append(f"No limits are set for {', '.join(free)}.")
    if problem.resolution is None:
        told.append("The motion is exact: it was not rounded to the steps of a machine.")
    return [*told, *_program(solution), *_bound(solution)]


def _program(solution: Solution) -> Iterator[str]:
    counts = solution.modelled
    if counts and not counts["part_pairs_kept"]:
        why = "nothing is to do" if solution.status.found else "there is no motion"
        yield f"No part pair is in a program that a motion solves, as {why}."
    elif counts:
        missing = [
            f"{counts[f'{key}_total'] - counts[f'{key}_kept']} of {counts[f'{key}_total']} {noun}"
            for key, noun in (("part_pairs", "part pairs"), ("features", "pairs of elements"))
            if counts[f"{key}_total"] > counts[f"{key}_kept"]
        ]
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
