"""The verdict on a case, in words that a machinist would use: what to do, what then touches, whether less would do."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.features import Feature
from fcdm_opt.design.sizes import beyond_tolerances
from fcdm_opt.geometry.facet_errors import gaps_off
from fcdm_opt.geometry.naming import element_text, is_round, with_article
from fcdm_opt.geometry.units import measured
from fcdm_opt.judge.engagement import collides_on_path
from fcdm_opt.problem.fit import drawn_bodies, mating_cylinders, verdict
from fcdm_opt.problem.solution import TRUE_FACES
from fcdm_opt.show import texts
from fcdm_opt.show.contact_faces import with_whole_faces
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.along.coherent_range import AssemblyRange, CoherentRange
    from fcdm_opt.geometry.arrays import Array
    from fcdm_opt.geometry.bodies import Body
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.problem.scene import Scene
    from fcdm_opt.problem.solution import Bounded, Solution

CONTACTS, NAME = 3, 72  # contacts that are told one by one where there are no more, and letters of a body's name
NO_FIT = "does not fit: the only motion found"
UNMOVED = "not moved"  # of parts in a picture
MISSED = ("INFEASIBLE", "NOT_FOUND", "NOT_IN_STEPS", "OUTSIDE_FIT")  # of which a pose is known that comes near
EXACT = 1e-3  # relative gap below which a bound is told as the amount: to the digits that are shown it is
REFUSED = {
    "NOT_FOUND": "no motion found, and none proved impossible",
    "LEFT_COHERENT_RANGE": "no motion found that keeps the intended contact all the way",
    "NOT_IN_STEPS": "no motion found in whole steps of the machine",
    "NOT_VERIFIED": "not to be used: a motion was found, but the judge refused it",
}
"""What is said where there is no motion to use, and it is not known whether there can be one."""


def verdict_text(solution: Solution) -> str:
    """Return the verdict in one sentence: "move nut 0.033 mm along +z: then its top face lies on ...", or why none."""
    if solution.usable:
        return f"{instruction(solution)}: {_effect(solution)}; {sure_text(solution)}"
    refused, of_mesh = _refused_text(solution), solution.left_by_mesh
    if of_mesh.startswith("but "):  # all that is known is of the facets
        return f"not known whether true parts fit: of the facets, {refused.replace(': ', ', ', 1)}; {of_mesh}"
    return "; ".join(filter(None, (refused, of_mesh)))


@lru_cache(maxsize=16)
def _refused_text(solution: Solution) -> str:
    """Return why there is no motion to use."""
    from fcdm_opt.design.whatif.fitting import advising

    problem = solution.problem
    widths = verdict(problem)
    if widths:
        if solution.status.name == "INFEASIBLE":
            return f"{widths}; no such motion brings them together"
        known = solution.status.found or solution.stopped or solution.status.name not in REFUSED
        return widths if known else f"{widths}; {REFUSED[solution.status.name]}"
    if solution.status.name == "INFEASIBLE":
        limited = " and these limits" if np.isfinite(problem.limits).any() else ""
        proved = " (proved)" * (not solution.left_by_mesh)
        return f"impossible with this motion{limited}{proved}" + f": {solution.reason}" * bool(solution.reason)
    if solution.status.name == "OUTSIDE_FIT":
        late = bool(solution.stopped)  # then nothing else is asked either
        why, more = solution.reason, ""
        with advising(solution):
            barred = "" if late else barring(problem)
            more = "" if late else _without_clearance(problem, barred or why)
        through = texts.listed(gone_through(solution))
        where = f"goes straight through {through}" if through else "takes it out of the place it is drawn in"
        known = f"{solution.stopped}: the only motion found by then" if late else NO_FIT
        return more or "; ".join(filter(None, (f"{known} {where}", why, barred)))
    if solution.status.name == "NOT_FOUND" and solution.active and not solution.stopped:
        return f"{REFUSED['NOT_FOUND']}; {'; '.join(solution.active)}"
    if solution.stopped:
        return f"{solution.stopped}: no motion found by then"
    failed = solution.certificate.failed if solution.certificate else ()
    overlap = max((-check.value for check in failed if check.name == TRUE_FACES), default=0.0)
    why = f": true faces, which facets stand for, overlap by {length_text(problem, overlap)}" * (overlap > 0.0)
    return f"{REFUSED[solution.status.name]}{why}"


@lru_cache(maxsize=16)
def barring(scene: Scene) -> str:
    """Return which keep-outs, and clearances of an assembly, are in the way, in words: without these it is solved."""
    from fcdm_opt.design.whatif.constraints import constraints, without
    from fcdm_opt.design.whatif.fitting import largest_clearance, usable_answer

    every = {f"keep-out {own.name!r}": f"keep-out {own.name}" for own in scene.keep_out}
    contacts = {own.name: own.value for own in constraints(scene) if own.name.startswith("contact ") and own.value > 0}
    every |= {name: f"{name} (clear by {length_text(scene, value)})" for name, value in contacts.items()}
    if not every or usable_answer(without(scene, every)) is None:
        return ""
    single = [name for name in every if len(every) == 1 or usable_answer(without(scene, [name])) is not None]
    names = [every[name] for name in single or every]
    text = f"in the way: {' or '.join(names) if single else texts.listed(names)}, without which there is a motion"
    if len(single) == 1 and single[0] in contacts:
        kept = pacing.in_time(largest_clearance, scene, single[0], late=None)
        text += f"; {texts.kept_text(kept, scene.unit)} can be kept" if kept and kept.clearance else ""
    return text


def _without_clearance(problem: Problem, why: str) -> str:
    """Return that parts fit without a clearance, with why not with one; "" where they do not."""
    from fcdm_opt.design.whatif.fitting import NOT_MET, without_clearance

    bare = without_clearance(problem)
    if bare is None:
        return ""
    contact = contact_text(bare.problem, bare.features, bare.transform)
    closed = f"; without one, {contact}" if contact and bare.pair_state == "touching" else ""
    asked = f"no such motion leaves {length_text(problem, problem.clearance)}"
    return f"fits, {NOT_MET}: {asked} in the place it is drawn in{closed}" + f"; {why}" * bool(why)


def answer_text(solution: Solution) -> str:
    """Return the verdict of a case, and below it what its table row says: all that `print` shows of a solution."""
    problem = solution.problem
    head = f"{problem.name}: " * bool(problem.name)
    row = f"{texts.asked_text(problem)}, goal {texts.goal_text(problem)}"
    if solution.status.found and solution.status.name != "OUTSIDE_FIT":
        amount = texts.amount_text(texts.seen_amount(solution), problem.amount_unit)
        row += f": {texts.motion_text(solution)}; amount {amount}{texts.proved_text(solution)}; "
        row += f"pair made {solution.pair_state}; {texts.outcome_text(solution)}"
    else:
        row += f": {texts.outcome_text(solution)}"
    first = "; ".join([f"{head}{verdict_text(solution)}", *straight_texts(solution)])
    return "\n".join([first, row, *beyond_tolerances(problem)])


def straight_texts(solution: Solution) -> list[str]:
    """Return that the straight motion goes through another part, if it does."""
    through = texts.listed(gone_through(solution)) if solution.usable else ""
    return [f"straight there it goes through {through}, and no other way is looked for"] * bool(through)


def gone_through(solution: Solution) -> list[str]:
    """Return the names of what body 1 goes through on the straight way of its motion, as far as there is time."""
    problem, parameters = solution.problem, tuple(solution.parameters.values())
    return [
        name_of(problem, 1) if other is None else f"keep-out {other.name}"
        for other in (None, *problem.keep_out)
        if any(parameters) and pacing.in_time(collides_on_path, problem, parameters, other, late=False)
    ]


def _done(problem: Problem, values: Sequence[float]) -> list[tuple[str, str]]:
    """Return the steps that do something as (verb, manner)."""
    values = texts.telling(problem, values)
    steps = zip(problem.motion.by_step(values), problem.motion.describe_steps(values, unit=problem.unit), strict=True)
    return [step for own, step in steps if any(own)]


def range_texts(coherent: CoherentRange, head: str | None = None) -> list[str]:
    """Return from where to where the contact meant lasts, and what ends it on both sides, a sentence each.

    Where the motion leads across the contact it lasts at sizes that change on the way, down to a size of zero at most.
    `head`: in place of along which motion what touches.
    """
    problem = coherent.problem
    if head is None:
        contact = contact_text(problem, coherent.features, named=True)
        head = f"along {texts.direction_text(problem, coherent.direction.tolist())}, {contact}"
    sizes = " while both scales change, as little as keeps it (at unchanged sizes the parts come apart or overlap)"
    near = np.clip([coherent.low, coherent.high], -coherent.natural_step, coherent.natural_step)
    sizes *= bool(np.abs(coherent.rho(max(near.tolist(), key=abs) / 2.0) - coherent.rho(0.0)).max() > DEFAULT.nominal)
    lines = [f"{head}{sizes}, until"]
    for side, event in zip(("backwards", "forwards"), coherent.events, strict=True):
        values = (event.x * coherent.direction).tolist() if math.isfinite(event.x) else []
        steps = " and ".join(map(" ".join, _done(problem, values) if values else [])) or "no motion at all"
        if not values:
            what = "nothing ends it"
        elif event.kind == "scale":
            what = f"{steps}; there, a size would be zero, and no other contact ends it before"
        elif event.successors:
            what = f"{steps}; beyond, {contact_text(problem, event.successors)} instead"
        else:
            what = f"{steps}{'; there,' if event.x else ':'} {labels_in_words(event.what, problem)}"
        lines.append(f"{side}: {what}")
    return [*lines, *(f"round faces are followed as facets; {line}" for line in coherent.known_to)]


def shared_range_texts(found: AssemblyRange) -> list[str]:
    """Return how far all contacts of an assembly last at once, and which of them is the first to end both ways."""
    asked, direction = next(iter(found.assembly.questions.values())), [*found.direction.values()]
    along = f"along {texts.direction_text(asked, direction)}"
    if len(found.contacts) < 2:
        return [along]
    lines = [f"all {len(found.contacts)} contacts last at once {along}, until"]
    for side, event in (("backwards", found.first), ("forwards", found.last)):
        steps = texts.steps_text(asked, [event.x * x for x in direction]) if math.isfinite(event.x) else ""
        contact, _, what = event.what.partition(": ")
        first = f"{steps}; there, {what if event.kind == 'limit' else f'that of {contact} is the first to end'}"
        lines.append(f"{side}: {first if steps else 'nothing ends it'}")
    return lines


def no_contact_text(problem: Problem) -> str:
    """Return why no contact is followed along a motion: the parts are drawn with play, or overlap."""
    from fcdm_opt.along.followed import TOUCH_BETWEEN, touch_on_true_faces

    facets, gap, of_facets = problem.of_facets, float(problem.curve.gap(problem.nominal_pair)), False
    if not problem.partial:
        ends = tuple(np.repeat(problem.nominal_pair, 2).tolist())
        gap, _, of_facets = _drawn_gaps(facets.movable, facets.static, ends)
    lie = f"are {length_text(problem, gap)} apart" if gap > 0.0 else f"overlap by {length_text(problem, -gap)}"
    if of_facets:  # by how much these say
        lie = "are apart" if gap > 0.0 else "overlap"
    drawn = "as drawn" if (problem.nominal_pair == 1.0).all() else "at their nominal sizes"
    drawn = "as made" if any((problem.made or {}).values()) else drawn
    if touch_on_true_faces(problem):
        return f"{drawn} {TOUCH_BETWEEN}"
    return f"{drawn} the parts {lie}, so that no contact is there to be followed"


def _steps(solution: Solution) -> list[tuple[str, str]]:
    return _done(solution.problem, list(solution.parameters.values()))


def motion_text(solution: Solution) -> str:
    """Return the motion in words, for an arrow: "0.25 mm along -z, then 2 deg about +x"; "" without one."""
    steps = _steps(solution)
    return _in_order(steps, "")[1] if steps else ""


def refusal_text(solution: Bounded, where: str = UNMOVED) -> str:
    """Return that there is no motion to use: "does not fit: parts as made, not moved"; "" where there is one.

    `where`: the parts are shown, see `poses_shown`.
    """
    from fcdm_opt.design.whatif.fitting import barred_text

    return "" if solution.usable else f"{barred_text(solution)}: parts as made, {where}"


def poses_shown(solution: Bounded) -> tuple[Any, str]:
    """Return which motion a picture shows, and where it leaves the parts: `UNMOVED`, at the pose that words tell of.

    Without a motion to use that is where all but keep-outs and clearances is met, else the nearest pose of two parts.
    A motion is (4, 4), of an assembly by its parts; None at rest.
    """
    from fcdm_opt.design.fixed_pose.nearest_miss import nearest_pose
    from fcdm_opt.design.whatif.fitting import without_clearance

    moved, scene = "transform" if hasattr(solution, "transform") else "transforms", solution.question
    none: tuple[Any, list[str]] = (), []
    if solution.usable:
        return getattr(solution, moved), ""
    if not solution.stopped and solution.status.name in MISSED:
        if (known := pacing.in_time(partial(without_clearance, keep_outs=True), scene, late=None)) is not None:
            return getattr(known, moved), "moved to where all else is met"
        q, lacking = pacing.in_time(nearest_pose, scene, late=none) if moved == "transform" else none
        if lacking and any(q):
            return scene.motion.transform(q, scene.movable.seed, scene.static.seed), "at the nearest pose found"
    return (None if moved == "transform" else {}), UNMOVED


def instruction(solution: Solution) -> str:
    """Return what to do with the movable part: "move nut 0.25 mm along -z, then turn it 2 deg about +x"."""
    return instruction_text(name_of(solution.problem, 0), _steps(solution))


def instruction_text(name: str, steps: list[tuple[str, str]]) -> str:
    """Return what to do with a part: "move nut 0.25 mm along -z, then turn it 2 deg about +x"."""
    verb, text = _in_order(steps, "it ") if steps else ("", "")
    return f"{verb} {name} {text}" if steps else f"leave {name} where it is"


def _in_order(steps: list[tuple[str, str]], again: str) -> tuple[str, str]:
    """Return the first verb, and all that is done: shifts in a row together, then what comes after them.

    `again`: what is turned, said with each further verb.
    """
    runs: list[tuple[str, list[str]]] = []
    for verb, manner in steps:
        if runs and runs[-1][0] == verb == "move":
            runs[-1][1].append(manner)
        else:
            runs.append((verb, [manner]))
    (first, words), *more = [(verb, texts.listed(manners)) for verb, manners in runs]
    return first, words + "".join(f", then {f'{verb} {again}' if again else ''}{manner}" for verb, manner in more)


def _effect(solution: Solution) -> str:
    """Return what holds after the motion: of the parts made, and of the contact meant where that is asked."""
    problem, state = solution.problem, solution.pair_state
    other, then = name_of(problem, 1), "then " * bool(_steps(solution))
    contact = contact_text(problem, solution.features, solution.transform) or f"it touches {other}"
    gap = length_text(problem, abs(solution.pair_gap))
    made = {"touching": "touch", "apart": f"are {gap} apart", "overlapping": f"overlap by {gap}"}.get(state, state)
    if problem.goal == "clear":
        return f"{then}it is {gap} clear of {other}" if state == "apart" else f"{then}it just clears {other}"
    if problem.goal == "beyond" and solution.rho is not None:
        but = "but " * (state == "overlapping")
        scales = " and ".join(f"{scale:.6g}" for scale in solution.rho)
        return f"{then}{contact} at scales {scales}, those asked or beyond; {but}the parts made {made}"
    if problem.resolution is not None and state == "apart":
        return f"{then}{contact} but for {gap}, as near as whole steps come"
    if problem.goal == "fit" and (widest := max(solution.contact_gaps.values(), default=0.0)) > problem.contact_slack:
        least = (
            f"the largest gap of {len(problem.contacts)} contacts is {length_text(problem, widest)}, as small as may be"
        )
        return f"{then}{least}" + f"; {contact}" * (state == "touching")
    settled = state == "touching" or problem.goal == "fit"
    return f"{then}{contact}" + ("" if settled else f"; the parts made {made}")


def sure_text(solution: Solution) -> str:
    """Return whether less would do, in words."""
    if not _steps(solution):
        return "; ".join(filter(None, ("nothing to do", solution.left_by_mesh, _sliding_contact(solution))))
    if solution.doubt:
        return solution.doubt
    if abs(solution.gap) < max(texts.CLOSED, EXACT):
        return "smallest possible (proved)"
    return (
        f"smallest possible to within {100.0 * solution.gap:.2g} % (proved)" if solution.gap < 10 * texts.NEAR else ""
    )


def _sliding_contact(solution: Solution) -> str:
    """Return that no motion opens the contact, where bodies only slide on plane faces that touch as drawn."""
    problem = solution.problem
    asked = problem.goal in ("touch", "at", "seat")
    if not asked or solution.pair_state != "touching" or not solution.features:
        return ""
    motion, rest = problem.motion.kinematics(problem.movable.seed, problem.static.seed), np.zeros(len(problem.weights))
    rates = motion.rates(rest)[1][:, :3]
    for feature in solution.features:
        sides = (feature.one, problem.movable), (feature.two, problem.static)
        flat = [pair for pair in sides if pair[0].kind == "F" and not is_round(element_text(pair[1], pair[0]))]
        if not flat:
            return ""
        corners = flat[0][1].vertices[np.array(flat[0][0].vertices) - 1]
        normal = np.linalg.svd(corners - corners.mean(axis=0))[2][2]
        speeds = np.pad(corners, ((0, 0), (0, 1)), constant_values=1.0) @ rates.transpose(0, 2, 1)  # by each parameter
        if np.abs(speeds @ normal).max() > DEFAULT.nominal * np.abs(speeds).max():
            return ""
    return (
        "this motion only slides the parts on each other, whatever else is near: range and pose tell the play there; "
        "to restore a contact ahead too, draw parts touching there too and ask with goal 'at'"
    )


def contact_text(
    problem: Problem, features: Sequence[Feature], transform: Array | None = None, *, named: bool = False
) -> str:
    """Return what touches what: "its corner 5 touches the top face (facing +z) of plate"; of many the first ones.

    `transform`: of the movable part there. `named`: it is named, where no text before it does.
    """
    features = with_whole_faces(problem, features, transform)
    found: dict[str, list[str]] = {}
    for feature in features:
        one, two = element_text(problem.movable, feature.one), element_text(problem.static, feature.two)
        flat = feature.kind == "F1F2" and not is_round(one) and not is_round(two)
        mine = f"{with_article(one)} of {name_of(problem, 0)}" if named else f"its {one}"
        others = found.setdefault(f"{mine} {'lies on' if flat else 'touches'}", [])
        others += [two] if two not in others else []
    if not found:
        return ""
    pairs = [(step, two) for step, others in found.items() for two in others]
    most = CONTACTS if len(pairs) <= CONTACTS else 1  # as of a shaft in its bore, of facets: one says what they are
    few = [(step, [with_article(two) for own, two in pairs[:most] if own == step]) for step in found]
    shown = [f"{step} {' and '.join(others)}" for step, others in few]
    words = " and ".join(shown[: len({step for step, _ in pairs[:most]})])
    more = f", and {texts.counted(len(pairs) - most, 'more contact')}" if len(pairs) > most else ""
    return f"{words} of {name_of(problem, 1)}{more}"


def labels_in_words(text: str, scene: Scene) -> str:
    """Return a text with the labels of contacts in it as names of faces, edges and corners of a scene's bodies."""
    for pair, problem in scene.relations.items():
        keep_outs = {own.name: own.body for own in problem.keep_out}
        head = "" if problem is scene else f"{' - '.join(pair)}: "
        exact = problem.exact_at is not None  # then labels are of these bodies
        bodies = (problem.movable, problem.static) if exact else drawn_bodies(problem)
        text = Feature.all_in_words(text, *bodies, keep_outs, head)
    return text


def held_text(labels: Sequence[str], scene: Scene) -> str:
    """Return what touches or holds a motion, in words, each once; of much the first, and how much more there is."""
    words = (labels_in_words(str(own), scene) for own in labels)
    whole = dict.fromkeys(re.sub(r"convex part \d+ of ", "", own).replace("stays apart", "kept apart") for own in words)
    return "; ".join(texts.few([*whole], CONTACTS)) or "none"


def fit_text(problem: Problem) -> str:
    """Return the gaps of the pair as drawn over its whole tolerance, and of diameters the fit; "" without a tolerance.

    None of large bodies, of which only some parts are looked at.
    """
    if problem.tolerance is None or problem.partial:
        return ""
    ends = problem.nominal_pair[:, None] * (1.0 + problem.tolerance * [-1.0, 1.0])
    facets = problem.of_facets
    low, high, of_facets = _drawn_gaps(facets.movable, facets.static, tuple(ends.ravel().tolist()))
    slack = problem.contact_slack
    lengths = [
        f"{length_text(problem, abs(gap))} {'apart' if gap > slack else 'overlapping' if gap < -slack else 'touching'}"
        for gap in (low, high)
    ]
    between = " (between facets)" if of_facets else ""
    fits = [f"unmoved, over the whole tolerance: from {lengths[0]} to {lengths[1]}{between}"]
    for pair in mating_cylinders((facets.movable, facets.static)):
        inside = int(pair[0].name.startswith("bore"))
        room, thick = (2.0 * pair[k].surface.radius * ends[k] for k in (1 - inside, inside))
        play = room[0] - thick[1], room[1] - thick[0]
        kind = "clearance" if play[0] > slack else "interference" if play[1] < -slack else "transition"
        shown = [f"{length_text(problem, abs(own))} {'interference' if own < 0.0 else 'clearance'}" for own in play]
        walls = " in ".join(pair[k].name.replace(" radius ", " of radius ") for k in (inside, 1 - inside))
        fits.append(f"{walls}: {kind} fit, from {shown[0]} to {shown[1]} in diameter")
    return "; ".join(dict.fromkeys(fits))


@lru_cache(maxsize=4)  # the cases of a file have the same parts
def _drawn_gaps(movable: Body, static: Body, box: tuple[float, ...]) -> tuple[float, float, bool]:
    """Return the least and the largest gap as drawn over scales, and whether facets stand for round faces there."""
    from fcdm_opt.design.fixed_pose.scene import ScaleGaps

    found = ScaleGaps.of(movable, static, np.eye(4), np.reshape(box, (2, 2)))
    least, most = found.extremes[:2]  # of several parts the largest gap may be within
    return least.gap, most.gap, found.true is None and gaps_off((movable, static)) != (0.0, 0.0)


def name_of(problem: Problem, body: int) -> str:
    """Return the name of body 0 or 1, or what it is."""
    name = (problem.movable, problem.static)[body].name
    return texts.shortened(name, NAME) if name else ("the movable part", "the static part")[body]


def length_text(problem: Scene, length: float) -> str:
    """Return a length to four digits with its unit; rounding is 0."""
    return measured(
        texts.number(0.0 if abs(length) <= texts.NOTHING * problem.size else length, texts.DIGITS), problem.unit
    )
