"""The constraints of a problem as its user knows them: limits, keep-outs, clearances, states; each can be dropped.

What the goal asks is no constraint: it is always kept. Some constraints include a weaker one: a keep-out's clearance
the keep-out itself. Dropping the weaker one drops the stronger one too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from fcdm_opt.along.sensitivity import Sensitivity
from fcdm_opt.errors import InputError
from fcdm_opt.judge.certificate import verify
from fcdm_opt.problem.arguments import is_real
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.solution import Certificate, Solution, kept_clear
from fcdm_opt.tolerances import DEFAULT

OUTWARD = (-1.0, 1.0)  # where a lower and an upper limit is widened to


@dataclass(frozen=True, kw_only=True)
class Constraint:
    """One constraint of a problem; each kind of it is a class below.

    Attributes
    ----------
    name : str
        As `Solution.active` has it where that names the same.
    value : float
        The limit or clearance, in its unit; nan for what is no number.
    unit : "length", "radian", "halvings" or ""
        Of its relaxation; empty where it can only be dropped.
    includes : str
        Name of the weaker constraint that comes with it; empty where none does.
    parameter : str
        The parameter that it limits; empty for all else.
    """

    name: str
    value: float = math.nan
    unit: str = ""
    includes: str = ""
    parameter: str = ""

    def relaxed(self, problem: Problem, by: float) -> Problem:
        """Return the problem with this constraint relaxed by an amount in its unit, at most `most`.

        Raises
        ------
        InputError
            Where there is nothing between keeping and dropping it, or this is more than can be.
        """
        if not self.unit:
            raise InputError(
                "there is nothing between keeping and dropping it", key=self.name, found=by, allowed="`without` it"
            )
        if not (is_real(by) and 0.0 <= by <= self.most and math.isfinite(by)):
            allowed = f"a number from 0 to {self.most:.9g}" if math.isfinite(self.most) else "a finite number >= 0"
            raise InputError("not a relaxation", key=self.name, found=by, allowed=allowed)
        return self.changed(problem, float(by))

    def dropped(self, problem: Problem) -> Problem:
        """Return the problem without this constraint and those that include it."""
        return self.changed(problem, self.most)

    def changed(self, problem: Problem, by: float) -> Problem:
        """Return the problem with this constraint relaxed by any amount up to `most`, which drops it."""
        raise NotImplementedError

    def excess(self, solution: Solution, certificate: Certificate) -> float:
        """Return by how much a motion passes the constraint: not above 0 where it keeps it.

        Parameters
        ----------
        solution : Solution
        certificate : Certificate
            The judge's, of the motion in the whole problem.
        """
        raise NotImplementedError

    @property
    def most(self) -> float:
        """Largest relaxation: the clearance itself for a clearance, else infinite."""
        return math.inf

    @property
    def kept_at_rest(self) -> bool:
        """Whether it is a limit that no motion at all keeps."""
        return False

    def relaxed_value(self, by: float) -> float:
        """Return the limit or clearance after a relaxation."""
        return math.nan

    def slack(self, problem: Problem) -> float:
        """Return the amount, in the constraint's unit, by which the judge lets it be passed."""
        return 0.0

    def rate(self, sensitivity: Sensitivity) -> float:
        """Return what the amount falls by, to first order, per unit of relaxation; nan where it is not known."""
        return math.nan


@dataclass(frozen=True, kw_only=True)
class _Limit(Constraint):
    """The lower (sides (0,)) or upper ((1,)) limit of a parameter, or both where they are equal: it is held."""

    sides: tuple[int, ...]

    def changed(self, problem: Problem, by: float) -> Problem:
        given = problem.request["limits"]
        ends = list(given.get(self.parameter, (-math.inf, math.inf)))
        for side in self.sides:
            ends[side] = self.value + OUTWARD[side] * by
        return problem.changed(limits={**given, self.parameter: tuple(ends)})

    def excess(self, solution: Solution, certificate: Certificate) -> float:
        return max(OUTWARD[side] * (solution.parameters[self.parameter] - self.value) for side in self.sides)

    @property
    def kept_at_rest(self) -> bool:
        return all(OUTWARD[side] * self.value >= 0.0 for side in self.sides)

    def relaxed_value(self, by: float) -> float:
        return math.nan if len(self.sides) > 1 else self.value + OUTWARD[self.sides[0]] * by

    def slack(self, problem: Problem) -> float:
        names = [parameter.name for parameter in problem.motion.parameters]
        return DEFAULT.requirement * problem.length / float(problem.weights[names.index(self.parameter)])

    def rate(self, sensitivity: Sensitivity) -> float:
        rates = sensitivity.limits[self.parameter]
        # equal limits are one datum, the lower
        return abs(rates[0]) if len(self.sides) > 1 else -OUTWARD[self.sides[0]] * rates[self.sides[0]]


@dataclass(frozen=True, kw_only=True)
class _Clearance(Constraint):
    """The clearance of the target pair or to a keep-out, as a check of the judge measures it.

    Without a unit it is that the pair is clear, or the keep-out not entered, at all: it can only be dropped.
    """

    check: str = "clearance"
    keep_out: str = ""

    def changed(self, problem: Problem, by: float) -> Problem:
        clearance = self.relaxed_value(by) if self.unit else 0.0
        if not self.keep_out:
            return problem.changed(clearance=clearance, **({} if self.unit else {"pair": "any"}))
        others = [own for own in problem.keep_out if self.unit or own.name != self.keep_out]
        return problem.changed(
            keep_out=tuple(replace(own, clearance=clearance) if own.name == self.keep_out else own for own in others)
        )

    def excess(self, solution: Solution, certificate: Certificate) -> float:
        # what the judge could not find is infinitely bad
        measured = next((check.value for check in certificate.checks if check.name == self.check), -math.inf)
        return (self.value if self.unit else 0.0) - measured

    @property
    def most(self) -> float:
        return self.value

    def relaxed_value(self, by: float) -> float:
        return self.value - by

    def slack(self, problem: Problem) -> float:
        sizes = [own.body.size for own in problem.keep_out if own.name == self.keep_out]
        return max([problem.contact_slack, *(DEFAULT.tie * size for size in sizes)])

    def rate(self, sensitivity: Sensitivity) -> float:
        if self.keep_out:
            return sensitivity.keep_out[self.keep_out]
        return sensitivity.clearance if self.unit else math.nan


@dataclass(frozen=True, kw_only=True)
class _Passed(Constraint):
    """That the judge's checks whose names start so pass; without it, an argument of the problem has another value."""

    check: str
    instead: tuple[str, Any]

    def changed(self, problem: Problem, by: float) -> Problem:
        return problem.changed(**dict([self.instead]))

    def excess(self, solution: Solution, certificate: Certificate) -> float:
        checks = [check.passed for check in certificate.checks if check.name.startswith(self.check)]
        return 0.0 if checks and all(checks) else math.inf


@dataclass(frozen=True, kw_only=True)
class _WholeSteps(_Passed):
    """That the motion is in whole steps of the machine; the relaxation counts how often the steps are halved."""

    def changed(self, problem: Problem, by: float) -> Problem:
        if math.isinf(by):
            return super().changed(problem, by)
        steps = problem.request["resolution"]
        return problem.changed(resolution={name: step / 2.0**by for name, step in steps.items()})


def constraints(problem: Problem) -> tuple[Constraint, ...]:
    """Return all constraints of a problem; what is implied by the goal is none.

    Returns
    -------
    tuple of Constraint
        Limits by parameter, keep-outs, pair state, clearance, coherence, whole steps; a weaker one stands before the
        one that includes it.
    """
    listed: list[Constraint] = []
    for parameter, ends in zip(problem.motion.parameters, problem.limits.tolist(), strict=True):
        name, unit = parameter.name, "length" if parameter.kind == "translation" else "radian"
        limits = {f"lower limit of {name}": (0,), f"upper limit of {name}": (1,)}
        for label, sides in {f"{name} held": (0, 1)}.items() if ends[0] == ends[1] else limits.items():
            if math.isfinite(value := ends[sides[0]]):
                listed.append(_Limit(name=label, value=value, unit=unit, parameter=name, sides=sides))
    for own in problem.keep_out:
        kept, clear = f"keep-out {own.name!r}", kept_clear(own.name)
        listed.append(_Clearance(name=kept, check=clear, keep_out=own.name))
        if own.clearance > 0:
            value = own.clearance
            listed.append(
                _Clearance(name=clear, value=value, unit="length", includes=kept, check=clear, keep_out=own.name)
            )
    state = "" if problem.pair in ("any", problem.goal) else f"pair {problem.pair!r}"
    if problem.pair == "touch" and state:
        listed.append(_Passed(name=state, check="pair touches", instead=("pair", "any")))
    elif state:
        listed.append(_Clearance(name=state))
    if problem.clearance > 0:
        includes = "" if problem.goal == "clear" else state
        listed.append(_Clearance(name="clearance", value=problem.clearance, unit="length", includes=includes))
    if problem.goal in TRACKING and problem.path == "coherent":
        listed.append(_Passed(name="coherence", check="path", instead=("path", "free")))
    if problem.resolution is not None:
        steps = "whole steps"
        listed.append(_WholeSteps(name=steps, unit="halvings", check=steps, instead=("resolution", None)))
    return tuple(listed)


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
    for constraint in [named(problem, name) for name in dict.fromkeys(names)]:
        problem = constraint.dropped(problem)
    return problem


def relaxed(problem: Problem, name: str, by: float) -> Problem:
    """Return a problem with one constraint relaxed.

    Parameters
    ----------
    problem : Problem
    name : str
        As `constraints` names it.
    by : float
        How far a limit is widened (a held parameter to both sides) or a clearance reduced, in its unit; for "whole
        steps" how often the steps are halved.

    Raises
    ------
    InputError
        For an unknown name, a constraint that can only be dropped, and more than the whole of a clearance.
    """
    return named(problem, name).relaxed(problem, by)


def named(problem: Problem, name: str) -> Constraint:
    """Return the constraint of a name; raises `InputError` that lists the names there are."""
    known = {own.name: own for own in constraints(problem)}
    if name not in known:
        allowed = ", ".join(known) or "none: the problem has no constraint"
        raise InputError("no such constraint of the problem", key="constraint", found=name, allowed=allowed)
    return known[name]


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
    certificate = verify(replace(solution, problem=problem))
    passed = {own.name: (own.excess(solution, certificate), own.slack(problem)) for own in constraints(problem)}
    return {name: 0.0 if excess <= slack else excess for name, (excess, slack) in passed.items()}
