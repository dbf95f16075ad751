"""Which deviations from nominal can be made good: how they lie, told before any is solved, and the largest of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from enum import Enum
from functools import lru_cache, partial
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.segments import SwitchingPoint
from fcdm_opt.design.sizes import by_name
from fcdm_opt.design.whatif.constraints import Constraint, constraints, without
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.units import shortest
from fcdm_opt.model.true_faces import has_round_faces
from fcdm_opt.motion.motions import Translation
from fcdm_opt.problem.fit import lack, misfit, verdict
from fcdm_opt.problem.keep_out import holds_seed
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import Bounded, Status
from fcdm_opt.solver import has_motion, solve
from fcdm_opt.tolerances import DEFAULT

ACCURACY = 1e-4  # relative, of the tolerance: more digits than are shown
BEYOND = 1e-3  # relative: so far beyond what widths allow a motion is looked for
MOST_SECONDS = 60.0  # seconds that another question may take, which is asked only to say why there is no motion
ADVICE = 2.0  # times the solve that all of them may take for one answer, within `pacing.ADVISED`
NO_TIME = 1e-9  # seconds
FAR = 4.0  # times a clearance that lacks, up to where a shift is looked for that leaves it
LEVER = 0.25  # share of the largest change of a width by a size from which on another one helps it, too
NUDGE = 1e-6  # of the size of the parts: by how much a size is changed to see what it does to widths
MOST_SECANTS = 8  # widths are linear in sizes but for corners that turn, and where others come to lack more
NOT_MET = "clearance not met"  # of parts that fit without one
UNKNOWN = "a smaller tolerance may ask for more than a larger one"
_advice_seconds = WeakKeyDictionary[Bounded, float]()  # seconds, of answers that were advised about


def narrowed(
    holds: Callable[[float], bool], low: float, high: float, done: Callable[[float, float], bool]
) -> tuple[float, float]:
    """Return a narrower bracket of a place where something ends to hold, by bisection until `done` says so."""
    # it is known to hold at `low`, and not to at `high`
    while not done(low, high):
        middle = (low + high) / 2.0
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high


def largest_share(holds: Callable[[float], bool], low: float, high: float, *, accuracy: float) -> tuple[float, float]:
    """Return `narrowed` ends of a share, relative; both may be tiny, or the lower one 0."""
    return narrowed(holds, low, high, lambda low, high: high - low <= accuracy * high or high <= accuracy)


def _largest(holds: Callable[[float], bool], most: float) -> float:
    """Return up to where something holds that does not at `most`, to a share of `ACCURACY`; 0 where nowhere."""
    least = ACCURACY * most  # below it there is none: of parts that overlap as drawn one question tells
    return largest_share(holds, least, most, accuracy=ACCURACY)[0] if holds(least) else 0.0


class Kept(NamedTuple):
    """The largest clearance found that a motion leaves, length units, if none is larger, and the answer for it."""

    clearance: float = 0.0
    is_largest: bool = False
    answer: Any = None


@lru_cache(maxsize=16)
def largest_clearance(scene: Scene, name: str = "clearance", guess: float = 0.0) -> Kept:
    """Return the largest clearance that a motion leaves where none leaves that asked for, of fewest digits.

    By bisection, about a guess, or what the first motion found leaves, as far as there is time. Of an assembly that of
    the contact with a name in `constraints`. As with `fits_up_to` one crossing is taken for granted.
    """
    own, answers = next(one for one in constraints(scene) if one.name == name), dict[bool, Any]()
    ends = {True: 0.0, False: own.value}  # that is kept, and that is not

    def is_kept(need: float) -> bool:
        if not ends[True] < need < ends[False]:
            return need <= ends[True]
        answer = solve(own.changed(scene, own.value - need), effort="quick")
        ends[answer.usable], answers[answer.usable] = need, answer
        if answer.usable:
            found = own.value - own.excess(answer, answer.certificate)
            ends[True] = max(need, min(shortest(found, ACCURACY * need), found))
        return bool(answer.usable)

    with suppress(pacing.TimeOverError):
        for need in (shortest(guess, ACCURACY * guess), ACCURACY * own.value):
            is_kept(need)
        is_kept(ends[True] * (1.0 + ACCURACY))
        if ends[True]:
            largest_share(is_kept, ends[True], ends[False], accuracy=ACCURACY)
            is_kept(shortest((ends[False] + ends[True]) / 2.0, (ends[False] - ends[True]) / 2.0))
    return Kept(ends[True], ends[False] - ends[True] <= ACCURACY * ends[False], answers.get(True))


@contextmanager
def advising(solution: Bounded) -> Iterator[None]:
    """Ask meanwhile only to say why there is no motion and what cures it, in what remains of the time for that."""
    usual = float(np.clip(ADVICE * sum(solution.seconds.values()), *pacing.ADVISED))
    start, rest = pacing.clock(), _advice_seconds.get(solution, usual)
    try:
        with pacing.within(max(rest, NO_TIME), share=1.0):
            yield
    finally:
        _advice_seconds[solution] = rest - (pacing.clock() - start)


@lru_cache(maxsize=16)
def clearance_within(problem: Problem, far: float) -> float:
    """Return the largest clearance, length units, that motions leave of which no parameter's amount is above a length.

    0 where none is left, where that asked for is, and where the time does not last.
    """
    limits = {own.name: np.clip(own.limits, -far / own.weight, far / own.weight) for own in problem.coordinates}
    near = problem.changed(limits={name: tuple(ends.tolist()) for name, ends in limits.items()})
    with pacing.within(MOST_SECONDS):
        if problem.goal != "clear" or not problem.clearance > 0.0 or pacing.in_time(has_motion, near, late=True):
            return 0.0
        return pacing.in_time(largest_clearance, near, late=Kept()).clearance


def quick_answer(scene: Scene, **changes: Any) -> Any:
    """Return the answer to a question that is changed, None where the time does not last."""
    with pacing.within(MOST_SECONDS):
        return pacing.in_time(partial(solve, effort="quick"), scene.changed(**changes), late=None)


def usable_answer(scene: Scene, **changes: Any) -> Any:
    """Return the answer to a question that is changed, None where it cannot be used, or the time does not last."""
    found = quick_answer(scene, **changes)
    return found if found is not None and found.usable else None


@lru_cache(maxsize=16)
def without_clearance(scene: Scene, *, keep_outs: bool = False) -> Any:
    """Return the answer to a question without clearances, as `usable_answer`; None of one that has none.

    Of two parts where they are its goal; `keep_outs`: without these, too.
    """
    heads = "contact ", *(["clearance"] if getattr(scene, "goal", "") == "clear" else [])
    known = [own.name for own in constraints(scene) if own.value > 0.0 and own.name.startswith(heads)]
    known += [f"keep-out {own.name!r}" for own in scene.keep_out if keep_outs]
    return usable_answer(without(scene, known)) if known else None


def barred_text(solution: Bounded) -> str:
    """Return how a solve without a motion to use ended: "does not fit", "clearance not met"; of others "verified"."""
    asked, outside = solution.question, solution.status is Status.OUTSIDE_FIT
    if solution.usable:
        return "verified"
    if outside and not solution.stopped and without_clearance(asked) is not None:  # else there is no time to ask more
        return NOT_MET
    return "does not fit" if outside or verdict(asked) else solution.status.words


@lru_cache(maxsize=16)
def opening_shift(problem: Problem) -> tuple[str, Kept]:
    """Return along which axis of the world, "+z", a shift opens what a motion keeps closed, and the clearance then.

    That is up to what is asked for; "" and none where one shift more does not do. Asked first is what leaves the
    largest gap by itself, within `FAR` times that.
    """
    from scipy.optimize import minimize_scalar

    known, bare = [own for own in problem.motion.directions if own is not None], without_clearance(problem)
    if bare is None:
        return "", Kept()
    need, guesses, moved = problem.clearance, dict[str, float](), np.array(bare.transform)
    least = ACCURACY * need

    def overlap(far: float, axis: Array) -> float:
        shifted = moved.copy()
        shifted[:3, 3] += far * axis
        return -float(problem.curve_after(shifted, problem.target).gap(problem.target))

    for name, axis in zip("xyz", np.eye(3), strict=True):
        if np.linalg.matrix_rank([*known, axis], tol=DEFAULT.nominal) > len(known):
            opened = min((axis, -axis), key=partial(overlap, least))
            look: Any = {"bounds": (0.0, FAR * need), "method": "bounded", "options": {"xatol": least / FAR}}
            opens = overlap(least, opened) < -LEVER * least
            guesses[name] = -float(minimize_scalar(overlap, args=(opened,), **look).fun) if opens else 0.0
    for name, guess in sorted(guesses.items(), key=lambda own: -own[1]):
        asked, _ = problem.with_motion(problem.motion >> Translation(name))  # type: ignore[arg-type]
        answer = usable_answer(asked) if not least < guess < need else None
        kept = largest_clearance(asked, guess=guess) if answer is None else Kept(need, True, answer)
        if kept.clearance > 0.0:
            return "+-"[[*kept.answer.parameters.values()][-1] < 0.0] + name, kept
    return "", Kept()


def fits_up_to(problem: Problem) -> float | None:
    """Return the largest tolerance at which a problem without a usable solution has one, by bisection.

    One crossing is taken for granted, see `budget` for a proof. The problem's motion, goal, limits and keep-outs stay.
    Told is the largest of its tolerances at that size, the others in proportion; 0 where none will do, None where the
    problem asks for a target and not for tolerances. Raises `TimeOverError` where the enclosing time limit is met
    before.
    """
    if problem.tolerance is None or problem.requirement is None:
        return None

    return _fitting_share(problem.deviating) * float(problem.tolerance.max())


def _fitting_share(made: Callable[[float], Problem]) -> float:
    """Return the largest share of something that is off drawn with which parts made have a usable motion."""

    def usable(made: Problem) -> bool:
        answer = solve(made, effort="quick", time=math.inf)
        if answer.stopped:
            raise pacing.TimeOverError
        return answer.usable

    def fits(share: float, moved: Callable[[Problem], bool]) -> bool:
        try:
            return moved(made(share))
        except InputError:  # the goal does not hold at these sizes
            return False

    def narrowed_by(moved: Callable[[Problem], bool], share: float) -> float:
        if not share > 0.0 or fits(share, moved):
            return share
        return _largest(partial(fits, moved=moved), share)

    wide = narrowed_by(lambda made: misfit(made) is None, 1.0)  # by widths alone, which a slanted shift may evade
    share = 1.0 if wide < 1.0 and fits(wide * (1.0 + BEYOND), has_motion) else wide
    for moved in (has_motion, usable):  # then motions, then what the judge says of them
        share = narrowed_by(moved, share)
    return share


def rounded_on(value: float, side: float, extent: float) -> float:
    """Return a value to three digits of an extent, rounded to where there is more of it, or less with side -1."""
    step = 10.0 ** (math.floor(math.log10(extent)) - 2)
    return side * float(f"{math.ceil(side * value / step - ACCURACY / BEYOND) * step:.12g}")


def widened_limits(scene: Scene) -> list[tuple[Constraint, float]]:
    """Return which limits the least motion without any of them passes, and to where they are to be widened for one.

    In lengths and degrees, to three digits with which a motion was found; none where that is found without limits only.
    """
    limits = [own for own in constraints(scene) if own.parameter]
    found = usable_answer(without(scene, [own.name for own in limits])) if limits else None
    if found is None:
        return []
    wider = list[tuple[Constraint, float]]()
    for own in limits:
        if own.excess(found, found.certificate) <= own.slack:
            continue
        each = math.degrees(1.0) if own.unit == "radian" else 1.0
        value = each * found.coordinates[own.parameter]
        beyond = value - each * own.value
        end = rounded_on(value, math.copysign(1.0, beyond), max(abs(value), abs(beyond)))
        wider.append((own, end))
        scene = own.changed(scene, abs(end / each - own.value))
    return wider if wider and usable_answer(scene) is not None else []


@lru_cache(maxsize=16)
def mending_sizes(problem: Problem) -> dict[str, float]:
    """Return the sizes which alone, made otherwise, let the parts fit, with the least change of their deviations.

    nan where no deviation was found to do; where some do within their tolerances, or nearer to these than made, without
    others. Sizes off drawn come first. Where no widths tell, these alone are asked about, between what they are and
    drawn.
    """
    made = {own.name: (problem.made or {}).get(own.name, 0.0) for own in problem.sizes}
    names = sorted(made, key=lambda name: (not beyond_tolerance(problem, name, made[name]), not made[name]))
    found = dict[str, float]()

    def helps(name: str, value: float) -> bool:
        beyond = beyond_tolerance(problem, name, value)
        return beyond <= ACCURACY * abs(value) or beyond < beyond_tolerance(problem, name, made[name])

    if wanting := lack(problem):
        off = {name: math.copysign(NUDGE * problem.size, -made[name]) for name in names}
        rates = {name: (_lack_at(problem, name, made[name] + off[name]) - wanting) / off[name] for name in names}
        most = max((abs(rate) for rate in rates.values() if not math.isnan(rate)), default=0.0)
        known = {name: _unlacking(problem, name, rate) for name, rate in rates.items() if abs(rate) > LEVER * most}
        known = {name: value for name, value in known.items() if not math.isinf(value)}
        for some in ({name for name in known if helps(name, known[name])}, {*known}):  # else whatever does
            if not any(map(math.isfinite, found.values())):
                found |= {name: _rounded_fit(problem, name, known[name]) for name in names if name in some - {*found}}
    open_ones = [name for name in found or names if made[name] and math.isnan(found.get(name, math.nan))]
    if found and has_round_faces(problem):  # each question takes a good part of a second, and there are some twenty
        open_ones = []
    for name in open_ones:
        sized = partial(_with_share, problem, name)
        share = _fitting_share(sized)
        if share < 1.0 and not (share and has_motion(sized(share * (1.0 + BEYOND)))):  # else the judge refused it alone
            fit = _rounded_fit(problem, name, share * made[name])
            found |= {name: fit} if share or not math.isnan(fit) else {}  # nothing but as drawn may do
    return {name: x for name, x in found.items() if helps(name, x)} or found


def beyond_tolerance(problem: Problem, name: str, value: float) -> float:
    """Return by how much a deviation of a size is beyond its tolerance, 0 within; nan for none."""
    low, high = next(own.tolerance or (-math.inf, math.inf) for own in problem.sizes if own.name == name)
    return max(low - value, value - high, 0.0 * value)


def mending_combination(problem: Problem) -> dict[str, float]:
    """Return sizes which together, within their tolerances, let the parts fit, where each alone goes beyond its own.

    Each by the same share of what its tolerance leaves it, the least that does, in three digits; none where none does.
    """
    known, made = mending_sizes(problem), problem.made or {}
    if len(known) < 2 or not all(beyond_tolerance(problem, *own) > 0.0 for own in known.items()):
        return {}
    sides = {name: math.copysign(1.0, x - made.get(name, 0.0)) for name, x in known.items()}
    ends = {own.name: own.tolerance[sides[own.name] > 0.0] for own in problem.sizes if own.name in sides}

    def changed(share: float) -> dict[str, float]:
        return {name: (1.0 - share) * made.get(name, 0.0) + share * end for name, end in ends.items()}

    def short(share: float) -> bool:
        return lack(problem.with_sizes(changed(share))) > 0.0

    if not lack(problem) or short(1.0):
        return {}
    share = narrowed(short, 0.0, 1.0, lambda low, high: high - low <= ACCURACY * high)[1]
    rounded = {name: rounded_on(x, sides[name], max(abs(x), abs(ends[name]))) for name, x in changed(share).items()}
    within = {name: sides[name] * min(sides[name] * x, sides[name] * ends[name]) for name, x in rounded.items()}
    return within if usable_answer(problem.with_sizes(within)) is not None else {}


def _with_share(problem: Problem, name: str, share: float) -> Problem:
    return problem.with_sizes({name: share * problem.made[name]})


def _lack_at(problem: Problem, name: str, value: float) -> float:
    """Return what widths lack with another deviation of a size; nan where it cannot be made."""
    try:
        return lack(problem.with_sizes({name: value}))
    except InputError:
        return math.nan


def _unlacking(problem: Problem, name: str, rate: float) -> float:
    """Return the deviation of a size at which widths lack nothing, by the secant method; nan where it does not end."""
    # infinite where others lack, whatever it is
    value, wanting = (problem.made or {}).get(name, 0.0), lack(problem)
    for _ in range(MOST_SECANTS):
        last, value = value, value - wanting / rate
        lacking = _lack_at(problem, name, value)
        if not lacking > 0.0:
            return value + 0.0 * lacking
        if abs(lacking - wanting) <= ACCURACY * wanting:
            return math.inf
        rate, wanting = (lacking - wanting) / (value - last), lacking
    return math.nan


def _rounded_fit(problem: Problem, name: str, value: float) -> float:
    """Return a deviation of a size in three digits with which there is a usable motion; nan where none is found."""
    made = (problem.made or {}).get(name, 0.0)
    if math.isfinite(value) and value != made:
        side, extent = math.copysign(1.0, value - made), max(abs(value), abs(value - made))
        for more in (0.0, BEYOND * extent):
            rounded = rounded_on(value + side * more, side, extent)
            with suppress(InputError):
                if usable_answer(problem.with_sizes({name: rounded})) is not None:
                    return rounded + 0.0
    return math.nan


class Order(Enum):
    """How the good tolerances of a requirement lie."""

    FROM_ZERO = "one stretch from zero"
    ALL_OR_NONE = "all where there are any near zero"
    ANY = "nothing is known"


def order(problem: Scene, made: str = "") -> tuple[Order, str]:
    """Return how the tolerances lie that a problem's requirement can be made good for, and why that is so.

    The problem has a requirement, at any tolerance of the shape asked about; `made` is the corner of its sizes that is
    asked about, where it names deviations, by default what it says is made. Of an assembly nothing is known.

    Sets of scaled bodies that are star-shaped about their seeds are nested, so are the motions that keep them clear.
    For "touch", the gap of the pair with less deviation has one sign at rest and the other where the pair with more
    touches, so it is zero on the straight way there, at a smaller amount.
    """
    if not isinstance(problem, Problem):
        return Order.ANY, UNKNOWN
    changes = problem.target - problem.nominal_pair
    grows, shrinks = bool((changes >= 0).all()), bool((changes <= 0).all())
    single = not problem.keep_out and problem.pair == "any"
    if problem.resolution is not None:
        return Order.ANY, "rounding to steps of the machine"
    if isinstance(problem.amount, str) and problem.amount == "displacement":
        return Order.ANY, "the displacement of the part made depends on its size"
    if by_name(problem) and problem.goal == "clear" and problem.pair != "touch":
        if problem.motion.shifts and _has_most_material(problem):  # the length that weighs turns may follow sizes
            return Order.FROM_ZERO, "faces only move outwards: a motion that clears larger parts clears smaller ones"
        drawn_within = all(low <= 0.0 <= high for low, high in (size.tolerance or (0.0, 0.0) for size in problem.sizes))
        loosest = (made or problem.request["made"]) == "loosest" and single and bool((problem.target == 1.0).all())
        if loosest and drawn_within:  # else the largest gap within may be less than as drawn
            need = problem.clearance - problem.contact_slack
            if float(problem.changed(made=None).curve.gap(problem.target)) >= need:  # all as drawn
                return Order.ALL_OR_NONE, "clear as drawn, and sizes with more play need no motion either"
    if by_name(problem):
        return Order.ANY, UNKNOWN
    if problem.goal == "beyond" and single:
        return Order.FROM_ZERO, "a motion beyond a larger tolerance is beyond every smaller one"
    weighted = problem.amount == "weighted"
    rest = bool(((problem.limits[:, 0] <= 0) & (problem.limits[:, 1] >= 0)).all())
    if problem.goal == "at" and single and weighted and rest and _is_linear(problem):
        return Order.FROM_ZERO, "a linear program in translations and tolerance: its least amount is convex"
    parts = *problem.movable.parts, *problem.static.parts  # that all hold the seed: smaller bodies lie within larger
    if problem.goal not in ("clear", "touch") or not all(map(holds_seed, parts)):
        return Order.ANY, UNKNOWN
    if problem.goal == "clear" and problem.pair != "touch" and grows:
        return Order.FROM_ZERO, "star-shaped bodies only grow: a motion that clears them clears smaller ones"
    if problem.goal == "clear" and problem.pair != "touch" and shrinks:
        return Order.ALL_OR_NONE, "star-shaped bodies only shrink: a motion that clears them clears smaller ones"
    if problem.goal == "touch" and single and weighted and rest and (grows or shrinks):
        gap = float(problem.curve.gap(problem.nominal_pair))
        if abs(gap) <= problem.contact_slack or (gap > 0) == shrinks:
            return (
                Order.FROM_ZERO,
                "on the way to where more deviation touches, star-shaped bodies with less touch first",
            )
    return Order.ANY, UNKNOWN


def _has_most_material(problem: Problem) -> bool:
    """Tell whether each size moves faces one way, outwards as far as its tolerance allows: smaller ones lie within."""
    for size in problem.sizes:
        out, ends = size.offsets(problem.request[size.body]), np.array(size.tolerance or (0.0, 0.0))
        if not size.is_length or (problem.made[size.name] * out < np.outer([0.0, *ends], out).max(axis=0)).any():
            return False
    return True


def _is_linear(problem: Problem) -> bool:
    """Tell whether the tracked point, and what it must stay beside, are linear in motion and scales."""
    convex = len(problem.movable.parts) == len(problem.static.parts) == 1
    point = isinstance(problem.nominal_contact, SwitchingPoint) and len(problem.nominal_contact.pieces) == 2
    return convex and point and problem.motion.shifts and not problem.feature_pairs
