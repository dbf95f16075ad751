"""The constraints of a problem as its user knows them: limits, keep-outs, clearances, states; each can be dropped.

What the goal asks is no constraint: it is always kept. Some constraints include a weaker one: a keep-out's clearance
the keep-out itself. Dropping the weaker one drops the stronger one too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

from fcdm_opt.along.sensitivity import Sensitivity
from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError
from fcdm_opt.judge.certificate import verify
from fcdm_opt.plain import Plain, plain
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.solution import Certificate, Solution, kept_clear
from fcdm_opt.tolerances import DEFAULT

OUTWARD = (-1.0, 1.0)  # where a lower and an upper limit is widened to


def _unknown(sensitivity: Sensitivity) -> float:
    return math.nan


@dataclass(frozen=True, kw_only=True)
class Constraint:
    """One constraint of a problem.

    Attributes
    ----------
    name : str
        As `Solution.active` has it where that names the same.
    changed : callable
        Returns a problem with this constraint relaxed by any amount up to `most`, which drops it.
    excess : callable
        Returns by how much a motion passes it, not above 0 where it keeps it, of a solution and the judge's certificate
        of its motion in the whole problem.
    value : float
        The limit or clearance, in its unit; nan for what is no number.
    unit : "length", "radian", "halvings" or ""
        Of its relaxation; empty where it can only be dropped.
    includes : str
        Name of the weaker constraint that comes with it; empty where none does.
    parameter : str
        The parameter that it limits; empty for all else.
    most : float
        Largest relaxation: the clearance itself for a clearance, else infinite.
    outward : float
        What the limit or clearance grows by per unit of relaxation; nan where that is no number.
    slack : float
        By how much, in its unit, the judge lets it be passed.
    kept_at_rest : bool
        Whether it is a limit that no motion at all keeps.
    rate : callable
        Returns what the amount falls by, to first order, per unit of relaxation, of a sensitivity; nan where unknown.
    """

    name: str
    changed: Callable[[Problem, float], Problem]
    excess: Callable[[Solution, Certificate], float]
    value: float = math.nan
    unit: str = ""
    includes: str = ""
    parameter: str = ""
    most: float = math.inf
    outward: float = math.nan
    slack: float = 0.0
    kept_at_rest: bool = False
    rate: Callable[[Sensitivity], float] = _unknown


def _limit(problem: Problem, k: int, label: str, sides: tuple[int, ...]) -> Constraint:
    """Return the lower (sides (0,)) or upper ((1,)) limit of a parameter, or both where they are equal: it is held."""
    parameter, value = problem.motion.parameters[k], float(problem.limits[k, sides[0]])
    name, held = parameter.name, len(sides) > 1

    def changed(problem: Problem, by: float) -> Problem:
        given = problem.request["limits"]
        ends = list(given.get(name, (-math.inf, math.inf)))
        for side in sides:
            ends[side] = value + OUTWARD[side] * by
        return problem.changed(limits={**given, name: tuple(ends)})

    def rate(sensitivity: Sensitivity) -> float:  # equal limits are one datum, the lower
        rates = sensitivity.limits[name]
        return abs(rates[0]) if held else -OUTWARD[sides[0]] * rates[sides[0]]

    return Constraint(
        name=label,
        changed=changed,
        excess=lambda solution, _: max(OUTWARD[side] * (solution.parameters[name] - value) for side in sides),
        value=value,
        unit="length" if parameter.kind == "translation" else "radian",
        parameter=name,
        outward=math.nan if held else OUTWARD[sides[0]],
        slack=DEFAULT.requirement * problem.length / float(problem.weights[k]),
        kept_at_rest=all(OUTWARD[side] * value >= 0.0 for side in sides),
        rate=rate,
    )


def _clearance(
    problem: Problem, name: str, value: float = math.nan, includes: str = "", kept: KeepOut | None = None
) -> Constraint:
    """Return a clearance of the target pair or to a keep-out; nan: that it is clear at all, which is kept or not."""
    whole = math.isnan(value)

    def changed(problem: Problem, by: float) -> Problem:
        clearance = 0.0 if whole else value - by
        if kept is None:
            return problem.changed(clearance=clearance, **({"pair": "any"} if whole else {}))
        others = [one for one in problem.keep_out if one.name != kept.name or not whole]
        return problem.changed(
            keep_out=tuple(replace(one, clearance=clearance) if one.name == kept.name else one for one in others)
        )

    def excess(solution: Solution, certificate: Certificate) -> float:
        check = "clearance" if kept is None else kept_clear(kept.name)
        # what the judge could not find is infinitely bad
        measured = next((one.value for one in certificate.checks if one.name == check), -math.inf)
        return (0.0 if whole else value) - measured

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
        slack=max(problem.contact_slack, 0.0 if kept is None else DEFAULT.tie * kept.body.size),
        rate=rate,
    )


def _contact(problem: Problem, k: int, feature: Feature) -> Constraint:
    """Return one of several contacts that are restored together, from 1; without it, it may stay open."""

    def changed(problem: Problem, by: float) -> Problem:
        left = [own.label for own in problem.contacts if own != feature]
        return problem.changed(contacts=left) if left else problem.changed(contacts=None, goal="clear")

    def excess(solution: Solution, certificate: Certificate) -> float:
        if problem.goal == FIT:
            return max(-replace(solution, problem=problem).contact_gaps.get(feature.label, math.inf), 0.0)
        # by these very faces: the parts may touch elsewhere
        return next((one.value for one in certificate.checks if one.name == f"contact {k}"), math.inf)

    def rate(sensitivity: Sensitivity) -> float:
        known = sensitivity.multipliers if sensitivity.exists else {}
        return abs(known.get(f"contact {feature.label}", math.nan))

    name = f"contact {k}, {feature.in_words(problem.movable, problem.static)}"
    return Constraint(name=name, changed=changed, excess=excess, slack=problem.contact_slack, rate=rate)


def _passed(name: str, check: str, instead: dict[str, Any], unit: str = "") -> Constraint:
    """Return that the judge's checks whose names start so pass; without it, the problem has other arguments."""

    def changed(problem: Problem, by: float) -> Problem:
        if unit and math.isfinite(by):
            steps = problem.request["resolution"]
            return problem.changed(resolution={name: step / 2.0**by for name, step in steps.items()})
        return problem.changed(**instead)

    def excess(solution: Solution, certificate: Certificate) -> float:
        checks = [one.passed for one in certificate.checks if one.name.startswith(check)]
        return 0.0 if checks and all(checks) else math.inf

    return Constraint(name=name, changed=changed, excess=excess, unit=unit)


def constraints(problem: Problem) -> tuple[Constraint, ...]:
    """Return all constraints of a problem; what is implied by the goal is none.

    Returns
    -------
    tuple of Constraint
        Limits by parameter, keep-outs, contacts that are restored together, pair state, clearance, coherence, whole
        steps; a weaker one stands before the one that includes it.
    """
    listed: list[Constraint] = []
    for k, (parameter, ends) in enumerate(zip(problem.motion.parameters, problem.limits.tolist(), strict=True)):
        name = parameter.name
        limits = {f"lower limit of {name}": (0,), f"upper limit of {name}": (1,)}
        for label, sides in {f"{name} held": (0, 1)}.items() if ends[0] == ends[1] else limits.items():
            if math.isfinite(ends[sides[0]]):
                listed.append(_limit(problem, k, label, sides))
    for kept in problem.keep_out:
        label = f"keep-out {kept.name!r}"
        listed.append(_clearance(problem, label, kept=kept))
        if kept.clearance > 0:
            listed.append(_clearance(problem, kept_clear(kept.name), kept.clearance, label, kept))
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
    if problem.resolution is not None:
        listed.append(_passed("whole steps", "whole steps", {"resolution": None}, "halvings"))
    return tuple(listed)


class PlainMotion(Plain):
    """Base of what has a `solution`, whose motion is told with it."""

    solution: Solution | None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data with status, amount and parameters; nan becomes None and infinity "inf"."""
        motion: dict[str, Any] = {"status": None, "usable": False, "amount": None, "parameters": {}}
        if self.solution is not None:
            motion = {name: plain(getattr(self.solution, name)) for name in motion}
        told = super().to_dict()
        return {**told, **motion, **told}


def problem_of(asked: Problem | Solution) -> Problem:
    """Return the problem that is spoken of; raises `InputError` for what is neither problem nor solution."""
    if not isinstance(asked, Problem | Solution):
        found, allowed = type(asked).__name__, "a Problem or a Solution"
        raise InputError("wrong kind of argument", key="problem", found=found, allowed=allowed)
    return asked.problem if isinstance(asked, Solution) else asked


def without(problem: Problem, names: Iterable[str]) -> Problem:
    """Return a problem without some of its constraints, and without those that include them.

    Parameters
    ----------
    problem : Problem
    names : iterable of str
        As `constraints` names them.

    Raises
    ------
    InputError
        For a name that no constraint of the problem has.
    """
    known = {one.name: one for one in constraints(problem)}
    for name in dict.fromkeys(names):
        if name not in known:
            allowed = ", ".join(known) or "none: the problem has no constraint"
            raise InputError("no such constraint of the problem", key="constraint", found=name, allowed=allowed)
        problem = known[name].changed(problem, known[name].most)
    return problem


def excesses(problem: Problem, solution: Solution) -> dict[str, float]:
    """Return by how much a motion passes each constraint of a problem, as judged.

    Parameters
    ----------
    problem : Problem
    solution : Solution
        Of the problem without some of its constraints, with a motion.

    Returns
    -------
    dict
        Name -> amount in the constraint's unit, 0 where it is kept to within the judge's slack; infinite where it is
        not and there is no amount.
    """
    features = problem.contacts if problem.contacts and problem.goal != FIT else solution.features
    certificate = verify(replace(solution, problem=problem, features=features))
    passed = {one.name: (one.excess(solution, certificate), one.slack) for one in constraints(problem)}
    return {name: 0.0 if excess <= slack else excess for name, (excess, slack) in passed.items()}
