"""The constraints of a problem as its user knows them: limits, keep-outs, clearances, states; each can be dropped.

What the goal asks is no constraint: it is always kept. Some constraints include a weaker one: a keep-out's clearance
the keep-out itself. Dropping the weaker one drops the stronger one too. `drop` tells what each constraint costs: the
least motion without it, and with another goal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any, ClassVar

from fcdm_opt.along.sensitivity import Sensitivity
from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError, known_arguments, known_word
from fcdm_opt.geometry.units import measured, number_text
from fcdm_opt.judge.certificate import verify
from fcdm_opt.plain import Plain, plain
from fcdm_opt.problem.assembled import AssemblySolution, kept_apart, kept_clear_by
from fcdm_opt.problem.assembly import CLEAR, Assembly, JoinedPair
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import GOALS, TRACKING, Problem
from fcdm_opt.problem.scene import Coordinate, Scene
from fcdm_opt.problem.solution import Bounded, Certificate, Solution, Status, kept_clear
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT

OUTWARD = (-1.0, 1.0)  # where a lower and an upper limit is widened to


@dataclass(frozen=True, kw_only=True)
class Constraint:
    """One constraint of a problem or an assembly."""

    name: str  # as `Solution.active` has it where that names the same
    # returns a problem with this constraint relaxed by any amount up to `most`, which drops it
    changed: Callable[[Any, float], Any]
    # returns by how much a motion passes it, not above 0 where it keeps it, of a solution and the judge's certificate
    # of its motion in the whole problem
    excess: Callable[[Any, Certificate], float]
    value: float = math.nan  # the limit or clearance, in its unit; nan for what is no number
    unit: str = ""  # of its relaxation: "length", "radian", "halvings", or empty where it can only be dropped
    includes: str = ""  # name of the weaker constraint that comes with it; empty where none does
    parameter: str = ""  # the parameter that it limits; empty for all else
    most: float = math.inf  # largest relaxation: the clearance itself for a clearance, else infinite
    # what the limit or clearance grows by per unit of relaxation; nan where that is no number
    outward: float = math.nan
    slack: float = 0.0  # by how much, in its unit, the judge lets it be passed
    kept_at_rest: bool = False  # whether it is a limit that no motion at all keeps
    # returns what the amount falls by, to first order, per unit of relaxation, of the sensitivity of two parts; nan
    # where unknown
    rate: Callable[[Sensitivity], float] = lambda _: math.nan


def _limit(scene: Scene, coordinate: Coordinate, label: str, sides: tuple[int, ...]) -> Constraint:
    """Return the lower (sides (0,)) or upper ((1,)) limit of a parameter, or both where they are equal: it is held."""
    name, value, held = coordinate.name, coordinate.limits[sides[0]], len(sides) > 1

    def changed(scene: Scene, by: float) -> Scene:
        ends = next([*own.limits] for own in scene.coordinates if own.name == name)
        for side in sides:
            ends[side] = value + OUTWARD[side] * by
        return scene.with_limits(name, (ends[0], ends[1]))

    def rate(sensitivity: Sensitivity) -> float:  # equal limits are one datum, the lower
        rates = sensitivity.limits[name]
        return abs(rates[0]) if held else -OUTWARD[sides[0]] * rates[sides[0]]

    return Constraint(
        name=label,
        changed=changed,
        excess=lambda solution, _: max(OUTWARD[side] * (solution.coordinates[name] - value) for side in sides),
        value=value,
        unit="length" if coordinate.kind == "translation" else "radian",
        parameter=name,
        outward=math.nan if held else OUTWARD[sides[0]],
        slack=scene.limit_slack / coordinate.weight,
        kept_at_rest=all(OUTWARD[side] * value >= 0.0 for side in sides),
        rate=rate,
    )


def _clearance(
    scene: Scene, name: str, value: float = math.nan, includes: str = "", kept: KeepOut | None = None
) -> Constraint:
    """Return a clearance of the target pair or to a keep-out; nan: that it is clear at all, which is kept or not."""
    whole = math.isnan(value)

    def changed(scene: Scene, by: float) -> Scene:
        clearance = 0.0 if whole else value - by
        if kept is None:
            return scene.changed(clearance=clearance, **({"pair": "any"} if whole else {}))
        others = [one for one in scene.keep_out if one.name != kept.name or not whole]
        return scene.changed(
            keep_out=tuple(replace(one, clearance=clearance) if one.name == kept.name else one for one in others)
        )

    def excess(solution: Bounded, certificate: Certificate) -> float:
        names = ["clearance" if kept is None else kept_clear(kept.name)]
        if kept is not None and isinstance(solution, AssemblySolution):
            names = [kept_clear_by(part, kept.name) for part in solution.assembly.motions]
        known = {one.name: one.value for one in certificate.checks}
        # what the judge could not find is infinitely bad
        return (0.0 if whole else value) - min(known.get(check, -math.inf) for check in names)

    def rate(sensitivity: Sensitivity) -> float:
        if kept is not None:
            return sensitivity.keep_out[kept.name]
        return math.nan if whole else sensitivity.clearance

    return Constraint(
        name=name,
        changed=changed,
        excess=excess,
        value=value,
        unit="" if whole else "length",
        includes=includes,
        most=value,
        outward=-1.0,
        slack=max(scene.contact_slack, 0.0 if kept is None else DEFAULT.tie * kept.body.size),
        rate=rate,
    )


def _contact(problem: Problem, k: int, feature: Feature) -> Constraint:
    """Return one of several contacts that are restored together, from 1; without it, it may stay open."""

    def changed(problem: Problem, by: float) -> Problem:
        remaining = [own.label for own in problem.contacts if own != feature]
        return problem.changed(contacts=remaining) if remaining else problem.changed(goal="clear")

    def excess(solution: Solution, certificate: Certificate) -> float:
        if problem.goal == FIT:
            return max(-solution.answering(problem).contact_gaps.get(feature.label, math.inf), 0.0)
        # by these very faces: the parts may touch elsewhere
        return next((one.value for one in certificate.checks if one.name == f"contact {k}"), math.inf)

    def rate(sensitivity: Sensitivity) -> float:
        known = sensitivity.multipliers if sensitivity.exists else {}
        return abs(known.get(f"contact {feature.label}", math.nan))

    name = f"contact {k}, {feature.in_words(problem.movable, problem.static)}"
    return Constraint(name=name, changed=changed, excess=excess, slack=problem.contact_slack, rate=rate)


def _meeting(assembly: Assembly, pair: JoinedPair) -> Constraint:
    """Return that two parts of an assembly meet, or are as far apart, as is asked; without it, they do not overlap."""
    value = pair.asked.get("clearance", 0.0) if pair.asked.get("goal") == "clear" else 0.0

    def changed(assembly: Assembly, by: float) -> Assembly:
        less = {**pair.asked, "clearance": value - by} if by < value else CLEAR
        asked = [{"parts": own[:2], **(less if own[:2] == pair[:2] else own.asked)} for own in assembly.contacts]
        return assembly.changed(contacts=asked, follows=assembly.follows)

    whole = replace(_passed(f"contact {pair}", f"contact: {pair}", {}), changed=changed)
    if not value > 0.0:
        return whole

    def excess(_: AssemblySolution, certificate: Certificate) -> float:
        known = kept_apart(pair.one, pair.two), kept_apart(pair.two, pair.one)
        return value - next((own.value for own in certificate.checks if own.name in known), -math.inf)

    slack = assembly.contact_slack
    return replace(whole, excess=excess, value=value, unit="length", most=value, outward=-1.0, slack=slack)


def _passed(name: str, check: str, instead: dict[str, Any], unit: str = "") -> Constraint:
    """Return that the judge's checks whose names start so pass; without it, the question has other arguments."""

    def changed(scene: Scene, by: float) -> Scene:
        if unit and math.isfinite(by):
            return scene.changed(resolution=_divided(scene.request["resolution"], 2.0**by))
        return scene.changed(**instead)

    def excess(solution: Bounded, certificate: Certificate) -> float:
        checks = [one.passed for one in certificate.checks if one.name.startswith(check)]
        return 0.0 if checks and all(checks) else math.inf

    return Constraint(name=name, changed=changed, excess=excess, unit=unit)


def _divided(steps: Any, by: float) -> Any:
    """Return steps of a machine, of parameters or of parts and theirs, by as much smaller."""
    return {name: _divided(own, by) for name, own in steps.items()} if isinstance(steps, Mapping) else steps / by


def constraints(scene: Scene) -> tuple[Constraint, ...]:
    """Return all constraints of a problem or an assembly; what is implied by the goal is none.

    Limits by parameter, keep-outs, contacts that are restored together, pair state, clearance, coherence, whole steps;
    a weaker one stands before the one that includes it.
    """
    listed: list[Constraint] = []
    for own in scene.coordinates:
        limits = {f"lower limit of {own.name}": (0,), f"upper limit of {own.name}": (1,)}
        for label, sides in {f"{own.name} held": (0, 1)}.items() if own.limits[0] == own.limits[1] else limits.items():
            if math.isfinite(own.limits[sides[0]]):
                listed.append(_limit(scene, own, label, sides))
    for kept in scene.keep_out:
        label = f"keep-out {kept.name!r}"
        listed.append(_clearance(scene, label, kept=kept))
        if kept.clearance > 0:
            listed.append(_clearance(scene, kept_clear(kept.name), kept.clearance, label, kept))
    if isinstance(scene, Assembly):
        listed += [_meeting(scene, pair) for pair in scene.contacts]
    if isinstance(scene, Problem):
        listed += _of_the_pair(scene)
    if scene.resolution is not None and len(scene.resolution):
        check = "contact: " if isinstance(scene, Assembly) else "whole steps"
        listed.append(_passed("whole steps", check, {"resolution": None}, "halvings"))
    return tuple(listed)


def _of_the_pair(problem: Problem) -> list[Constraint]:
    """Return what is asked of two parts besides the goal."""
    listed = list[Constraint]()
    if len(problem.contacts) > 1:
        listed += [_contact(problem, *own) for own in enumerate(problem.contacts, 1)]
    state = "" if problem.contacts or problem.pair in ("any", problem.goal) else f"pair {problem.pair!r}"
    if problem.pair == "touch" and state:
        listed.append(_passed(state, "pair touches", {"pair": "any"}))
    elif state:
        listed.append(_clearance(problem, state))
    if problem.clearance > 0:
        listed.append(_clearance(problem, "clearance", problem.clearance, "" if problem.goal == "clear" else state))
    if problem.goal in TRACKING and problem.path == "coherent":
        listed.append(_passed("coherence", "path", {"path": "free"}))
    return listed


class PlainMotion(Plain):
    """Base of what has a `solution`, whose motion is told with it."""

    solution: Bounded | None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data with status, amount and parameters; nan becomes None and infinity "inf"."""
        motion: dict[str, Any] = {"status": None, "usable": False, "amount": None, "parameters": {}}
        if self.solution is not None:
            motion = {name: plain(getattr(self.solution, name)) for name in motion}
        data = super().to_dict()
        return {**data, **motion, **data}


def scene_of(asked: Scene | Bounded) -> Any:
    """Return the question that is spoken of; raises `InputError` for what is neither question nor solution."""
    if not isinstance(asked, Scene | Bounded):
        found, allowed = type(asked).__name__, "a Problem, an Assembly, or a Solution of one"
        raise InputError("wrong kind of argument", key="problem", found=found, allowed=allowed)
    return asked.question if isinstance(asked, Bounded) else asked


def without(scene: Any, names: Iterable[str]) -> Any:
    """Return a question without some of its constraints, as `constraints` names them, and those that include them.

    Raises `InputError` for a name that no constraint of the question has.
    """
    known = {one.name: one for one in constraints(scene)}
    for name in dict.fromkeys(names):
        known_word(name, known, "no such constraint of the problem", key="constraint")
        scene = known[name].changed(scene, known[name].most)
    return scene


def excesses(scene: Scene, solution: Bounded) -> dict[str, float]:
    """Return by how much a motion passes each constraint of a question, as judged.

    The motion is that of a solution of the question without some of its constraints. Told is by each name an amount in
    the constraint's unit, 0 where it is kept to within the judge's slack; infinite where it is not and there is none.
    """
    certificate = verify(solution.answering(scene))
    passed = {one.name: (one.excess(solution, certificate), one.slack) for one in constraints(scene)}
    return {name: 0.0 if excess <= slack else excess for name, (excess, slack) in passed.items()}


@dataclass(frozen=True, eq=False, kw_only=True)
class Dropped(PlainMotion):
    """The question without one constraint, or with another goal."""

    plain_names: ClassVar[tuple[str, ...]] = ("name", "amount", "saving", "excess", "rate", "estimate")

    name: str  # the constraint's name as `constraints` has it, or `goal "touch"`
    solution: Bounded = field(repr=False)  # of the question so changed
    amount: float  # its least amount; nan where none was found
    # how much smaller that is; 0 where dropping the constraint changes nothing to within `Tolerances.tied`. Of another
    # goal negative where that asks for more
    saving: float
    # by how much the motion without the constraint passes it, in its unit; infinite where there is no amount, nan
    # without a motion, or for a goal
    excess: float = math.nan
    # what the amount falls by, to first order, per unit by which the constraint is relaxed (see `Sensitivity`); nan
    # where it does not exist
    rate: float = math.nan
    # the saving that `rate` gives over `excess`; nan where either does not exist. Where the amount is a convex function
    # of the relaxation the saving is no larger
    estimate: float = math.nan

    @property
    def status(self) -> Status:
        """How the solve ended."""
        return self.solution.status

    def __str__(self) -> str:
        if math.isnan(self.amount):
            return f"{self.name}: {self.status.words}"
        if self.saving == 0.0:
            return f"{self.name}: costs nothing"
        more = "" if math.isnan(self.estimate) else f" (its multiplier predicted {number_text(self.estimate)})"
        word = "saves" if self.saving > 0 else "adds"
        unit = self.solution.amount_unit
        saved, amount = (measured(x, unit) for x in (abs(self.saving), self.amount))
        return f"{self.name}: {word} {saved}, amount {amount}{more}"


@dataclass(frozen=True, eq=False, kw_only=True)
class Costs(Plain):
    """Which constraint of a solvable problem costs how much."""

    plain_names: ClassVar[tuple[str, ...]] = ("amount", "rows", "goals", "free", "solves", "seconds")

    solution: Bounded = field(repr=False)  # with all constraints
    rows: tuple[Dropped, ...]  # one for each constraint, the largest saving first
    # of each other goal that a problem of two parts can have, the largest saving first, those without a motion last
    goals: tuple[Dropped, ...]
    solves: int
    seconds: float

    @property
    def amount(self) -> float:
        """Least amount with all constraints."""
        return self.solution.amount

    @property
    def free(self) -> tuple[str, ...]:
        """The constraints that cost nothing."""
        return tuple(row.name for row in self.rows if row.saving == 0.0)

    def __str__(self) -> str:
        amount = measured(self.solution.amount, self.solution.amount_unit)
        lines = [f"amount {amount}", *(f"without {row}" for row in self.rows if row.saving != 0.0)]
        lines += [f"cost nothing: {', '.join(self.free)}"] if self.free else []
        return "\n".join([*lines, *(f"with {row}" for row in self.goals)])


@known_arguments
def drop(problem: Scene | Bounded) -> Costs:
    """Find out which constraint of a problem or an assembly costs how much.

    Parameters
    ----------
    problem : Problem or Assembly, or a solution of one
        One that can be solved; a solution is taken as it is.

    Raises
    ------
    InputError
        For a problem that has no motion: `conflicts` tells why.
    """
    start = perf_counter()
    known = isinstance(problem, Bounded)
    solution: Any = problem if isinstance(problem, Bounded) else solve(scene_of(problem), effort="quick")
    if not solution.usable:
        what = "the problem has no motion that could become smaller"
        allowed = "a problem with a motion that the judge passes; `conflicts` tells what clashes where there is none"
        raise InputError(what, key="problem", found=solution.status.words, allowed=allowed)
    asked = solution.question
    rows = [_without(solution, one) for one in constraints(asked)]
    goals = list(_other_goals(solution.problem, solution.amount)) if isinstance(asked, Problem) else []
    return Costs(
        solution=solution,
        rows=tuple(sorted(rows, key=lambda row: -row.saving)),
        goals=tuple(sorted(goals, key=lambda row: (math.isnan(row.saving), -row.saving))),
        solves=len(rows) + len(goals) + (not known),
        seconds=perf_counter() - start,
    )


def _without(solution: Any, constraint: Constraint) -> Dropped:
    # the motion found with it does without it, too: where the solver finds none as small, dropping it saves nothing
    problem, name = solution.question, constraint.name
    rate = constraint.rate(solution.sensitivity) if isinstance(problem, Problem) else math.nan
    without_it = solve(without(problem, [name]), effort="quick")
    row = Dropped(name=name, solution=without_it, amount=solution.amount, saving=0.0, excess=0.0, rate=rate)
    if not (without_it.usable and without_it.amount < solution.amount * (1.0 - DEFAULT.tied)):
        return row
    passed = excesses(problem, without_it)
    # without a keep-out its clearance is passed, too
    excess = max(passed[one.name] for one in constraints(problem) if name in (one.name, one.includes))
    estimate = rate * excess if math.isfinite(excess) else math.nan
    saving = solution.amount - without_it.amount
    return replace(row, amount=without_it.amount, saving=saving, excess=excess, estimate=estimate)


def _other_goals(problem: Problem, least: float) -> Iterator[Dropped]:
    """Yield the problem with each other goal that makes a question."""
    for goal in GOALS:
        if goal == problem.goal:
            continue
        try:
            other = problem.changed(goal=goal, features=None)
        except InputError:  # no switching point, nothing flush
            continue
        answer = solve(other, effort="quick")
        amount = answer.amount if answer.usable else math.nan
        saving = least - amount
        tied = abs(saving) <= DEFAULT.tied * max(amount, least)
        yield Dropped(name=f'goal "{goal}"', solution=answer, amount=amount, saving=0.0 if tied else saving)
