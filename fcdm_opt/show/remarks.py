"""What is to be said of a solution besides its numbers, in sentences that are true of the problem at hand.

`remarks` for every answer: contacts that were closed, keep-outs, how well gaps are known, large motions.
`not_considered` for a report: what the case was solved without.
"""

from __future__ import annotations

import math
import re

import numpy as np

from fcdm_opt.design.sizes import beyond_tolerances
from fcdm_opt.design.whatif.fitting import ACCURACY, NOT_MET, clearance_within
from fcdm_opt.geometry.bodies import solids_notes
from fcdm_opt.geometry.facet_errors import deviation_of, gaps_off, known_to
from fcdm_opt.geometry.units import floored, measured, number_text
from fcdm_opt.model.true_faces import on_true_faces
from fcdm_opt.problem.fit import FAR
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.show.rendering import paragraphs, rendered
from fcdm_opt.show.texts import CLOSED, asked_text, bound_text, listed, number, numbers, proved_least
from fcdm_opt.show.verdict import EXACT, gone_through
from fcdm_opt.tolerances import DEFAULT

NUMBERED = re.compile(r"\bcontacts? \d")  # a sentence that speaks of contacts by number
MANY = 6  # contacts of which the same is said in one line where there are more
LARGE, GROWTH = 0.5, 2.0
"""A corner that moves farther than this share of the smaller body's shortest side, and than this times what the sizes
change, may end on another side of the other body."""


class GoodNews(str):
    """A remark that is no warning: what is closed, and what is proved of it."""

    __slots__ = ()


def remarks(solution: Solution) -> list[str]:
    """Return what a table's row does not say, a sentence each; what is as it is to be as `GoodNews`."""
    lines, unit = [], solution.problem.unit
    if solution.stopped and solution.status.found:
        lines.append(f"{solution.stopped}; the bound is what was proved by then")
    if (snapped := solution.problem.snapped) is not None:
        was = f"nominal ({numbers(snapped.asked, 9)}), where the gap was {measured(snapped.gap, unit, 3)}"
        lines.append(f"{was}, closed to the curve at ({numbers(snapped.pair, 9)})")
    moved = solution.status is not Status.OUTSIDE_FIT  # else no motion is shown that gaps could be of
    for name, gap in solution.keep_out_gaps.items() if moved else ():
        off = f"{measured(abs(gap), unit, 4)} {'clear' if gap > 0 else 'overlapping'}"
        state = "touching" if abs(gap) <= solution.problem.contact_slack else off
        lines.append(f"keep-out {name}: {state}")
    problem = solution.problem
    overlaps = not solution.status.found and solution.pair_gap < 0.0
    if overlaps and any(gaps_off(problem.bodies)):
        depth = measured(number_text(-solution.pair_gap, 4), unit)
        others = "; what is said of motions is of the true faces" * on_true_faces(problem)
        lines.append(f"overlapping by {depth} is of the facets{others}")
    low, high = solution.amount_low, solution.amount_high
    known = () if solution.exact_of_mesh else errors_of_facets(problem)
    lines += [*solids_notes(problem.bodies), *known, *beyond_tolerances(problem), *sizes_as_drawn(problem)]
    if not (math.isclose(low, high, rel_tol=EXACT) or math.isnan(low) or solution.left_by_mesh):
        end = measured(high, problem.amount_unit)
        lines.append(f"the true parts need between {number_text(low)} and {end}")
    return [*lines, *least_at_rest(problem), *_frames(solution), *_contacts(solution), *_large(solution)]


def least_at_rest(scene: Scene) -> list[str]:
    """Return what sizes made "worst" are, and are not."""
    if scene.request.get("made") != "worst":
        return []
    what = 'made "worst" is the least play at rest, sizes without a part in the least gap at that of the next contact'
    return [GoodNews(f"{what}: others may need a larger motion, and a gap be smaller in a chain of parts (see stack)")]


def errors_of_facets(problem: Scene) -> list[str]:
    """Return a sentence on how far gaps of the facets may be off those of the solids that bodies stand for, and why."""
    return known_to(problem.bodies, problem.unit)


def sizes_as_drawn(scene: Scene) -> list[str]:
    """Return which sizes a question leaves as drawn, as it is about parts that are larger or smaller as a whole."""
    corner = scene.request.get("requirement")
    if corner is None or scene.made or not scene.sizes:
        return []
    names = listed([size.name for size in scene.sizes])
    asked = 'a case with made = "worst", or with target = [1.0, 1.0], asks about them'
    return [f"a requirement makes whole parts larger or smaller, and leaves sizes as drawn ({names}): {asked}"]


def _frames(solution: Solution) -> list[str]:
    """Return a warning where the parts are drawn farther from one another than the larger is long."""
    problem = solution.problem
    far = FAR * max(problem.movable.size, problem.static.size)
    corners = problem.movable.vertices - problem.static.vertices[0]
    if np.linalg.norm(corners, axis=1).min() <= far or (apart := float(problem.curve.distance((1.0, 1.0)))) <= far:
        return []
    return [f"as drawn the parts are {measured(number(apart), problem.unit)} apart: are both drawn in one frame?"]


def _contacts(solution: Solution) -> list[str]:
    """Return what became of the contacts of the nominal position, where there are several."""
    problem, unit, gaps = solution.problem.reformulated, solution.problem.unit, solution.contact_gaps
    if not problem.contacts:
        if problem.goal != "touch" or solution.status is Status.OUTSIDE_FIT or not solution.open_contacts:
            return []
        round_ones = {  # each facet of a round face is a contact for itself, and opens as the parts roll on one another
            own.feature.label
            for own in problem.nominal_joints
            if " of radius " in own.feature.in_words(*problem.active)
        }
        gaps = {label: gap for label, gap in gaps.items() if label not in round_ones}
        opened = [gaps[label] for label in solution.open_contacts if label in gaps]
        if not opened:
            return []
        most = measured(max(opened), unit, 4)
        if len(gaps) == 1:
            return [f"the contact of the nominal position is open now, by {most}"]
        return [
            f"of the {len(gaps)} contacts of the nominal position {len(opened)} {'is' if len(opened) == 1 else 'are'} "
            f"open now, by up to {most}; "
            'contacts = "all" asks for all of them'
        ]
    lines = list[str]()
    if gaps and not solution.open_contacts:
        every = {1: "the contact is", 2: "both contacts are"}.get(len(gaps), f"all {len(gaps)} contacts are")
        lines.append(GoodNews(f"{every} closed"))
    numbered = solution.open_contacts or any(map(NUMBERED.search, solution.active))
    alike = dict[str, list[int]]()
    for k, feature in enumerate(problem.contacts):
        gap = gaps.get(feature.label, math.nan)
        state = f"open by {measured(gap, unit, 4)}" if gap > problem.contact_slack else "closed"
        alike.setdefault(f": {state}" * bool(gaps), []).append(k)
    for state, rows in alike.items() if numbered else ():
        words = [f"contact {k + 1}, {problem.contacts[k].in_words(problem.movable, problem.static)}" for k in rows]
        if state and len(rows) > MANY:
            words = [f"{words[0]}, and {len(rows) - 1} more ({', '.join(str(k + 1) for k in rows[1:])})"]
        lines.extend(f"{text}{state}" for text in words)
    if not solution.status.found:
        return [*lines, *(own for own in solution.active if own[1:] not in solution.advice)]
    if problem.goal == FIT:
        lines += solution.active
    else:
        within = solution.unique_within
        box = f" whose weighted parameters are at most {measured(number(within), unit)}" if within < math.inf else ""
        what = "it" if len(problem.contacts) == 1 else "them"
        if within:
            lines.append(GoodNews(f"no other motion{box} closes {what}: proved"))
        elif _leaves_freedom(problem):
            least = solution.gap < CLOSED
            lines.append(
                (GoodNews if least else str)(f"other motions close {what} too" + ": this is the smallest" * least)
            )
        else:
            lines.append(f"whether another motion closes {what} too is not known")
    return lines


def _leaves_freedom(problem: Problem) -> bool:
    """Tell whether there are shifts along all contacts: their normals span less than the motion does."""
    if not problem.motion.shifts:
        return False
    directions = problem.motion.shift_vectors(problem.movable.seed, problem.static.seed)
    normals = np.vstack([joint.normals for joint in problem.chosen_joints])
    return bool(np.linalg.matrix_rank(normals @ directions.T, tol=DEFAULT.nominal) < len(directions))


def _large(solution: Solution) -> list[str]:
    """Return a warning where a motion goes through other bodies, or is so large that it may have."""
    if not solution.status.found or solution.transform is None or solution.status.name == "OUTSIDE_FIT":
        return []
    problem, through = solution.problem, gone_through(solution)
    poses = (np.eye(4), np.eye(4), solution.transform)
    bodies, scales = (problem.movable, problem.static, problem.movable), solution.pair[[0, 1, 0]]
    rest, other, end = (own.placed_vertices(*at) for own, *at in zip(bodies, scales, poses, strict=True))
    moved = float(np.linalg.norm(end - rest, axis=1).max())
    extents = np.array([np.ptp(rest, axis=0), np.ptp(other, axis=0)])
    side = float(extents.min())
    change = np.abs(solution.pair - problem.nominal_pair) / solution.pair @ extents.max(axis=1)
    open_gap = problem.curve.near_gap(solution.pair, 0.0) * (1.0 + DEFAULT.touch)  # none can be met sooner
    far = max(LARGE * side, GROWTH * float(change), open_gap)
    if moved <= far and not through:
        return []
    limited = zip(problem.motion.names, problem.limits, strict=True)
    free = [name for name, limits in limited if not np.isfinite(limits).all()]
    cure = f"; limits keep it near, for instance of {', '.join(free)}" if free else ""
    if through:
        what = f"straight there it goes through {listed(through)}, and no other way is looked for"
    else:
        what = "it may end on another side of the other part; the way there is not looked at"
    if free and not through and (most := clearance_within(problem, far)) > 0.0:
        less = measured(floored(most * (1.0 + ACCURACY), 3), problem.unit)
        cure += f"; {NOT_MET} there, where at most {less} can be kept"
    return [f"a large motion: {what}{cure}"]


def not_considered(solution: Solution) -> list[str]:
    """Return what was not modelled, or not looked at, and why; the template `left_out.txt` says it."""
    problem, counts = solution.problem, solution.modelled
    limited = zip(problem.motion.names, problem.limits.tolist(), strict=True)
    kept = [
        (counts.get(f"{key}_kept", 0), counts.get(f"{key}_total", 0), noun)
        for key, noun in (("part_pairs", "part pairs"), ("features", "pairs of elements"))
    ]
    text = rendered(
        "left_out.txt",
        solution=solution,
        problem=problem,
        scaled=problem.tolerance is not None or bool((problem.target != 1.0).any()),
        asked=asked_text(problem),
        bodies=problem.bodies,
        deviation_of=deviation_of,
        exact=on_true_faces(problem),
        tracking=problem.goal in TRACKING,
        free=[name for name, limits in limited if not any(map(math.isfinite, limits))],
        missing=[f"{total - some} of {total} {noun}" for some, total, noun in kept if total > some],
        impossible=math.isinf(solution.lower_bound),
        proved=proved_least(solution) or abs(solution.gap) < EXACT,
        drawn=DEFAULT.drawn,
        least=bound_text(solution).splitlines()[0],
    )
    return paragraphs(text)
