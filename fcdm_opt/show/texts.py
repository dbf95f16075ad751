"""How numbers, answers and questions are told in words: the one place for terminal, pictures, cards and reports."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from fcdm_opt import pacing
from fcdm_opt.errors import counted as counted  # as what speaks of results knows it
from fcdm_opt.geometry.size import direction
from fcdm_opt.geometry.solids import depth_as_drawn
from fcdm_opt.geometry.units import NOISE, floored, measured, number_text, signed
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.fit import LINE_TO_LINE, drawn_bodies, mending_turn, misfit, verdict
from fcdm_opt.problem.solution import UNLIMITED, Solution, Status

if TYPE_CHECKING:
    from fcdm_opt.design.study.results import StudyResult
    from fcdm_opt.design.whatif.fitting import Kept
    from fcdm_opt.motion.motions import Motion
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.problem.scene import Scene
    from fcdm_opt.problem.solution import Bounded
    from fcdm_opt.show.solved import SolvedCase

DIGITS = 4  # significant digits of what people read; all of them are in JSON
PLACES = 6  # those of coordinates and sizes as shares of those drawn, which differ by little from one another
NONE = "\u2013"  # an en dash, where a page has no value
CLOSED = 1e-9  # relative gap of a closed form
NEAR = 0.01  # relative gap, from which on the bound is told as a share of the amount: it is not nearly proved
ALMOST = 1e-4  # of the tolerances, with which parts are as good as drawn; of an amount, a bound that is told as it
NOTHING = 1e-12  # of the amount, a parameter that adds less, or of the size, a gap: shown as 0
UNSEEN = 0.5 * 10.0**-DIGITS  # of the amount, a parameter that adds less: in words 0, as these round the others by that
NO_STEP = re.compile(r"[RT][A-Z]\w* -?0( [a-z]+)?")
NO_PART = re.compile(r"(^|(?<= ))[RT][A-Z] -?0( [a-z]+)?( |$)")  # of a motion with several parameters

CLEARED = 0.7  # share of the time for advice in which a smaller clearance is looked for, before sizes and limits
MOST_SIZES = 4  # sizes by name, or limits, that are told in a line


def number(value: float | None, digits: int = DIGITS, least: float = NOISE) -> str:
    """Return a number, 0 up to `least`; a dash for nan and None."""
    if value is None or math.isnan(value):
        return "-"
    if math.isinf(value):
        return "infinite" if value > 0 else "-infinite"
    return number_text(float(value), digits, least)


def numbers(values: Iterable[float | None], digits: int = PLACES) -> str:
    """Return numbers, separated by commas."""
    return ", ".join(number(value, digits) for value in values)


def scale_text(scale: float) -> str:
    """Return a scale of few digits, or of as many, up to 9, as tell it from one that it is not: 0.5999999 from 0.6."""
    text = f"{scale:.{PLACES}g}"
    return f"{scale:.9g}" if len(text.replace(".", "").lstrip("0")) < PLACES - 1 else text


def share_text(share: float, digits: int = 2) -> str:
    """Return a share of all pairs in per cent; of one that is nan that it is not known."""
    return "undecided" if math.isnan(share) else f"{share:.{digits}%}"


def listed(words: Sequence[str], last: str = "and") -> str:
    """Return words in a row: "a", "a and b", "a, b and c"; or with another word before the last."""
    return f" {last} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def shown(value: Any, digits: int = DIGITS) -> str:
    """Return a value of JSON: numbers with so many digits, lists with commas (coordinates), an en dash for nothing."""
    if value is None or value == "":
        return NONE
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return number_text(value, digits) if math.isfinite(value) else f"{value:g}"
    if isinstance(value, list | tuple):
        return ", ".join(shown(item, max(digits, PLACES)) for item in value) or NONE
    return str(value)


def status_text(status: str) -> str:
    """Return a status in words, from its name; a study has further ones, as "WORKER_LOST"."""
    return Status[status].words if status in Status.__members__ else status.lower().replace("_", " ")


def shortened(text: str, longest: int) -> str:
    """Return a text of at most so many letters, its end left out where it is longer."""
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


def asked_text(scene: Scene) -> str:
    """Return requirement and signs, or the sizes made, or the target; of an assembly the scales and sizes made."""
    word = scene.request.get("made")
    made = sizes_text(scene) or (f"{word}, which is as drawn" if isinstance(word, str) else "")
    if isinstance(scene, Assembly):
        scales = (f"{part} {signed(100.0 * (x - 1.0), 6)} %" for part, x in scene.scales.items() if x != 1.0)
        text = ", ".join(filter(None, [*scales, made]))
        return f"made {text}" if text else "parts as drawn"
    problem: Any = scene
    more = f", made {made}" if made else ""
    if problem.requirement:
        signs = ",".join("+" if sign > 0 else "-" if sign < 0 else "0" for sign in problem.signs)
        return f"{problem.requirement} ({signs}){more}"
    if (problem.target == 1.0).all():
        return f"made {made or 'as drawn'}" if problem.made is not None else "parts as drawn"
    return f"target {', '.join(map(scale_text, problem.target.tolist()))}{more}"


def goal_text(problem: Problem) -> str:
    """Return the goal, with the least gap where it asks for one: "clear by 0.04 mm"."""
    asked = problem.goal == "clear" and problem.clearance > 0.0
    clear = f"clear by {measured(number(problem.clearance), problem.unit)}"
    return clear if asked else problem.goal


def dimensions_text(lengths: Mapping[str, float], noise: float) -> str:
    """Return what a size measures, by the face that it is measured to: "14.92 to face bottom"; a dash for nothing."""
    each = (f"{number(x, PLACES, noise)}{f' to {face}' if face else ''}" for face, x in lengths.items())
    return ", ".join(each) or NONE


def sizes_text(scene: Scene, of: str | None = None) -> str:
    """Return which sizes by name, of all parts or of one, came out otherwise than drawn, and by how much; else ""."""
    made = [(size, (scene.made or {}).get(size.name, 0.0)) for size in scene.sizes if of in (None, size.body)]
    texts = [f"{size.name} {size.deviation_text(x, scene.unit)}" for size, x in made if x]
    return ", ".join(few(texts, MOST_SIZES, "more size"))


def few(words: list[str], most: int, more: str = "") -> list[str]:
    """Return of many words the first, and how many more there are: "and 3 more", "2 more sizes"."""
    if len(words) <= most + bool(more):
        return words
    return [*words[:most], counted(len(words) - most, more) if more else f"and {len(words) - most} more"]


def made_text(assembly: Assembly, part: str) -> str:
    """Return how a part of an assembly is made: "scale 1.02", "height +0.05 mm", "as drawn"."""
    scale = assembly.scales[part]
    return ", ".join(filter(None, [f"scale {scale:g}" * (scale != 1.0), sizes_text(assembly, part)])) or "as drawn"


def limits_texts(scene: Scene) -> list[str]:
    """Return the limits of each parameter that has some: "TX from -0.05 to 0.05 mm"."""
    return [
        f"{own.name} from {' to '.join(number(in_unit(end, unit)) for end in own.limits)} {unit}"
        for own, unit in zip(scene.coordinates, parameter_units(scene), strict=True)
        if any(map(math.isfinite, own.limits))
    ]


def limits_text(scene: Scene) -> str:
    """Return the same on one line, of many the first: "limits TX from -0.05 to 0.05 mm"; "" where there are none."""
    texts = few(limits_texts(scene), MOST_SIZES, "more limit")
    return f"limits {', '.join(texts)}" if texts else ""


def tolerance_text(problem: Problem) -> str:
    """Return the tolerances: "2 %", or both bodies' downward and upward ones where they differ."""
    rows = [] if problem.tolerance is None else (100.0 * problem.tolerance).tolist()
    if len({x for row in rows for x in row}) == 1:
        return f"{rows[0][0]:.6g} %"
    texts = [f"{minus:.6g} %" if minus == plus else f"-{minus:.6g} / +{plus:.6g} %" for minus, plus in rows]
    return ", ".join(f"rho_{k} {text}" for k, text in enumerate(texts, 1))


def units_text(unit: str) -> str:
    """Return what the numbers of a table are in."""
    return f"lengths in {unit}, angles in degrees"


def parameter_units(scene: Scene) -> list[str]:
    """Return what each parameter is shown in: the unit of lengths, or degrees."""
    return ["deg" if own.kind == "rotation" else scene.unit or "length" for own in scene.coordinates]


def in_unit(value: float, unit: str) -> float:
    """Return a parameter in the unit that it is shown in."""
    return math.degrees(value) if unit == "deg" else value


def telling(scene: Scene, values: Sequence[float], least: float = UNSEEN) -> list[float]:
    """Return values of the parameters, 0 for those that add no more than a share of the weighted amount of all.

    And for those that move no part further than the digits of its file leave open where it is (single precision).
    """
    weighted = [own.weight * q for q, own in zip(values, scene.coordinates, strict=False)]
    open_by = max(2.0 * max(body.rounding for body in scene.drawn.values()), least * math.hypot(*weighted))
    return [q if abs(x) > open_by else 0.0 for q, x in zip(values, weighted, strict=False)]


def parameter_texts(problem: Problem, parameters: Mapping[str, float]) -> list[str]:
    """Return parameters in words: lengths with their unit, if it is known, angles in degrees."""
    named = zip(parameter_units(problem), telling(problem, list(parameters.values())), strict=False)
    return [measured(f"{in_unit(x, unit):.{DIGITS}g}", unit if unit == "deg" else problem.unit) for unit, x in named]


def motion_text(solution: Bounded, *, unit: bool = True) -> str:
    """Return the motion found in words, without steps that do nothing; "-" of none, or of one that leaves the fit."""
    scene = solution.question
    if solution.status is Status.OUTSIDE_FIT:
        return "-"
    if not isinstance(scene, Assembly):
        return steps_text(scene, [*solution.coordinates.values()], unit=unit)
    moved = ((part, scene.motions[part], own) for part, own in values_by_part(solution).items() if any(own))
    return "; ".join(f"{part} {described(own, q, scene.unit if unit else '')}" for part, own, q in moved) or "-"


def values_by_part(solution: Bounded) -> dict[str, list[float]]:
    """Return the values of the motion of each part of an assembly, 0 for rounding; none without motions."""
    scene: Scene = solution.question
    return scene.by_part(telling(scene, [*solution.coordinates.values()]))


def steps_text(problem: Problem, values: Sequence[float], *, unit: bool = True) -> str:
    """Return a motion in words as `motion_text` does."""
    values = telling(problem, values)
    return described(problem.motion, values, problem.unit if unit else "") if values else "-"


def direction_text(problem: Problem, values: Sequence[float]) -> str:
    """Return along what a motion goes, in words: of one parameter alone its name, as its unit is none to go by."""
    named = [(name, x) for name, x in zip(problem.motion.names, values, strict=True) if x]
    if len(named) == 1 and abs(named[0][1]) == 1.0:
        return f"{'-' * (named[0][1] < 0.0)}{named[0][0]}"
    return steps_text(problem, values)


def described(motion: Motion, values: Sequence[float], unit: str) -> str:
    """Return a motion in words, without steps and parameters that do nothing."""
    steps = motion.describe(values, unit=unit, digits=DIGITS).split(" + ")
    kept = [step for step in steps if not NO_STEP.fullmatch(step)] or steps[:1]
    return " + ".join(NO_PART.sub("", step).strip() or step for step in kept)


def amount_text(amount: float | None, unit: str = "") -> str:
    """Return an amount, with its unit where one is given."""
    return "-" if amount is None or not math.isfinite(amount) else measured(number(amount), unit)


def seen_amount(solution: Bounded) -> float:
    """Return the amount found, 0 of motions that are rounding, see `telling`, nan of one that leaves the fit."""
    if solution.status is Status.OUTSIDE_FIT:
        return math.nan
    found = solution.status.found
    return solution.amount * (not found or any(telling(solution.question, [*solution.coordinates.values()])))


def proved_least(solution: Bounded) -> bool:
    """Tell whether nothing smaller than the amount does, but for rounding: by less than what counts as touching."""
    asked = solution.question
    room = asked.contact_slack if getattr(asked, "amount", "") == "weighted" else 0.0  # an assembly has none
    return abs(solution.gap) < CLOSED or 0.0 < solution.amount - solution.lower_bound <= room


def bound_text(solution: Bounded) -> str:
    """Return the lower bound, rounded down, and below it how near the amount it comes; "-" of ones not to be used.

    Of one within `ALMOST` of the amount this.
    """
    if solution.status in (Status.OUTSIDE_FIT, Status.NOT_VERIFIED):
        return "-"
    if not math.isfinite(solution.lower_bound):
        return "impossible"
    if not solution.lower_bound > 0 or seen_amount(solution) == 0.0:
        return "0"
    rounded = floored(solution.lower_bound, DIGITS)
    if not math.isfinite(solution.gap):
        return rounded
    mesh = "of the mesh" * bool(solution.left_by_mesh and not solution.amount_low >= solution.lower_bound)
    if proved_least(solution):
        return f"{amount_text(solution.amount)}\n{mesh or 'exact'}"
    if solution.gap <= ALMOST:  # how near it is differs with the time that a proof has
        return f"{amount_text(solution.amount)}\nto {ALMOST:.0e}" + f", {mesh}" * bool(mesh)
    near = f"to {solution.gap:.0e}" if solution.gap < NEAR else f"{1.0 - solution.gap:.0%} of it"
    return f"{rounded}\n{near}" + f", {mesh}" * bool(mesh)


def proved_text(solution: Bounded) -> str:
    """Return ", proved at least ..." with the lower bound; "" of a motion that is not to be used."""
    bound = bound_line(solution)
    return f", proved at least {bound}" * (bound != "-")


def bound_line(solution: Bounded) -> str:
    """Return the lower bound with its unit, and how near it is, on one line."""
    bound, *near = bound_text(solution).split("\n")
    return ", ".join([measured(bound, solution.amount_unit) if bound[0].isdigit() else bound, *near])


def outcome_text(solution: Bounded) -> str:
    """Return how a solve ended, in words for the cell of a table."""
    from fcdm_opt.design.whatif.fitting import NOT_MET, barred_text

    ended = barred_text(solution)
    return ended if solution.usable or ended == NOT_MET else solution.status.words


IMPOSSIBLE = re.compile(
    r"(Proved impossible|Impossible for the meshes|The motion leaves the fit|No motion found, and none proved)"
    r"[^.:]*: ([^.]*)\."
)
"""What advice says of why there is no motion, which a verdict says too, and what it advises."""


def advised(case: SolvedCase) -> str:
    """Return a case's advice, and up to which tolerance the parts fit where that is known.

    Without how they do not fit, and what their facets leave open, which the verdict says.
    """
    fits, of_mesh, advice = case.fits_up_to, case.solution.left_by_mesh, case.solution.advice
    text = _with_sizes(case.solution) if IMPOSSIBLE.search(advice) else advice
    text = text.replace(f" {of_mesh[:1].upper()}{of_mesh[1:]}.", "") if of_mesh else text
    if text.startswith("Does not fit"):  # a name in it may be "cylinder no. 3"
        text = re.sub(r"^.*?(?<!\bno)\. ", "", text, flags=re.DOTALL)
    text = IMPOSSIBLE.sub(lambda own: f"{own[2][:1].upper()}{own[2][1:]}.", text)
    if fits is None:
        return text
    problem, motion = case.solution.problem, "As meshed, with this motion" if of_mesh else "With this motion"
    if not fits > 0.0 and problem.contacts and (clear := _clear_up_to(problem)):
        fits, motion = clear, 'This motion closes all contacts again at no tolerance. With goal "clear"'
    if not fits > 0.0 or problem.tolerance is None:
        return f"{text} The parts fit at no tolerance: {_unfit(problem)}."
    others = "" if problem.tolerance.max() == problem.tolerance.min() else ", the largest of these tolerances"
    return f"{text} {motion} the parts fit up to ±{floored(100.0 * fits, 3)} %{others}."


def _clear_up_to(problem: Problem) -> float:
    """Return up to which tolerance parts fit whose contacts no motion closes at any; 0 where at none, or no time."""
    from fcdm_opt.design.whatif.fitting import MOST_SECONDS, fits_up_to

    with pacing.within(MOST_SECONDS):
        return pacing.in_time(fits_up_to, problem.changed(goal="clear", pair="any"), late=None) or 0.0


@lru_cache(maxsize=16)
def _with_sizes(solution: Solution) -> str:
    """Return the advice of an answer; with the sizes, limits, turns and clearances known to mend it in its place.

    What leaves the clearance first; what there was no time to try is not proposed.
    """
    from fcdm_opt.design.whatif.fitting import Kept, advising, largest_clearance, opening_shift

    problem, axis, unsure = solution.problem, mending_turn(solution.problem), False
    need, shift, kept, changes = problem.clearance, "", Kept(), list[str]()
    if not solution.stopped:
        with advising(solution):
            if need > 0.0 and misfit(problem) is None:
                with pacing.sharing(CLEARED):
                    kept = pacing.in_time(largest_clearance, problem, late=kept)
                    if not kept.clearance:  # what is closed stays so by this motion
                        shift, kept = pacing.in_time(opening_shift, problem, late=("", kept))
            changes, unsure = pacing.in_time(_changes, problem, late=changes), pacing.over()
    opened = [f"allow a shift along {shift}, which opens the contact that stays closed"] * bool(shift)
    opened += [f"choose a smaller clearance, {kept_text(kept, problem.unit)}"] * (0.0 < kept.clearance < need)
    cures = [", and ".join(opened)] * bool(opened) + changes
    if axis is not None:
        cures.append(f"allow a turn about {direction(axis.round(DIGITS)).lstrip('+-')}")
    if not cures and verdict(problem).startswith("does not fit: "):  # wherever the part is moved to
        cures = ["choose a smaller tolerance, or other sizes"]
    cure = ", or ".join(cures)
    late = "; there was no time to try which of these would do" * (unsure and not cures)
    tried = "" if solution.stopped or unsure else UNLIMITED.get(solution.status, "").partition(": ")[2].rstrip(".")
    return IMPOSSIBLE.sub(lambda own: f"{own[1]}: {cure or tried or own[2] + late}.", solution.advice)


def kept_text(kept: Kept, unit: str) -> str:
    """Return in words which clearance can be kept: the largest, "at most 0.05 mm", or one that may not be that."""
    word, digits = ("at most", PLACES) if kept.is_largest else ("such as", DIGITS - 1)
    return f"{word} {measured(floored(kept.clearance, digits), unit)}"


def _changes(problem: Problem) -> list[str]:
    """Return in words which limits, together, or which size let the parts fit, and up to what; the first are limits."""
    from fcdm_opt.design.whatif.fitting import (
        beyond_tolerance,
        mending_combination,
        mending_sizes,
        widened_limits,
    )

    wider = list[str]()
    for own, end in widened_limits(problem):
        name = f"limits of {own.parameter}" if math.isnan(own.outward) else own.name
        wider.append(f"the {name} to {measured(number(end), 'deg' if own.unit == 'radian' else problem.unit)}")
    sizes = {own.name: own for own in problem.sizes}

    def in_words(name: str, value: float) -> str:
        beyond = ", beyond its tolerance" * (beyond_tolerance(problem, name, value) > 0.0)
        return (
            f"{name} (to {sizes[name].deviation_text(value, problem.unit)}{beyond})" if math.isfinite(value) else name
        )

    changed = listed([in_words(*own) for own in mending_sizes(problem).items()], "or")
    if combined := [in_words(*own) for own in mending_combination(problem).items()]:
        changed += f", or, within their tolerances, {listed(combined)} together"
    return [f"widen {listed(wider)}"] * bool(wider) + [f"change {changed}"] * bool(changed)


def _unfit(problem: Problem) -> str:
    """Return why two parts do not fit however little they are off what is drawn: widths, or how deep they overlap."""
    widths = verdict(problem.deviating(ALMOST)).partition(": ")[2]
    depth = depth_as_drawn(*drawn_bodies(problem), problem.nominal_pair)
    if not widths and depth > problem.contact_slack:
        return f"as drawn, they overlap by {measured(number(depth, DIGITS), problem.unit)}"
    if LINE_TO_LINE in widths:
        between = re.search(", (across|between) .*", verdict(problem))  # stands in the verdict
        return widths.replace(between[0], "") if between else widths
    return f"nearly as drawn, {widths or 'no motion of this kind keeps them in it'}"


def study_facts(result: StudyResult) -> list[tuple[str, str, str]]:
    """Return name, value and small print of what a study found: points, amounts, yield, time."""
    amounts = sorted(row["amount"] for row in result.rows() if row["usable"])
    counts = ", ".join(f"{count} {status_text(status)}" for status, count in result.counts.items())
    rows = [("points", str(len(result.points)), counts)]
    if amounts:
        least, middle, largest = (shown(amounts[k]) for k in (0, len(amounts) // 2, -1))
        rows.append((f"amounts ({result.unit or 'length units'})", f"{least} to {largest}", f"median {middle}"))
    if (share := result.assembly_yield) is not None:
        within = f"yield within {measured(f'{share.budget:g}', result.unit)}"
        rows.append((within, f"{share.share:.2%}", share.sure_text))
    if result.seconds:
        parts = ", ".join(f"{name} {value:.3g}" for name, value in result.seconds.items() if name != "point")
        rows.append(("working time", f"{result.seconds.get('point', 0.0):.3g} s", parts))
    return rows
