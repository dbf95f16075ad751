"""The constraints of a problem as its user knows them: limits, keep-outs, clearances, states; each can be dropped.

What the goal asks is no constraint: it is always kept. Some constraints include a weaker one: a keep-out's clearance
the keep-out itself. Dropping the weaker one drops the stronger one too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fcdm_opt.along.sensitivity import Sensitivity
from fcdm_opt.errors import InputError
from fcdm_opt.judge.certificate import verify
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.solution import Certificate, Solution, kept_clear
from fcdm_opt.tolerances import DEFAULT


@dataclass(frozen=True, kw_only=True)
class Constraint:
    """One constraint of a problem.

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

    def dropped(self, problem: Problem) -> Problem:
        """Return the problem without this constraint and those that include it."""
        raise NotImplementedError

    def relaxed(self, problem: Problem, by: float) -> Problem:
        """Return the problem with this constraint relaxed by an amount in its unit.

        Raises
        ------
        InputError
            Where there is nothing between keeping and dropping it, or this is more than can be.
        """
        raise InputError(
            "there is nothing between keeping and dropping it", key=self.name, found=by, allowed="`without` it"
        )

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
        """Largest relaxation: the clearance itself for a clearance, else infinite; nan where there is none."""
        return math.nan

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
    """The lower (side 0) or upper (side 1) limit of a parameter."""

    side: int

    def dropped(self, problem: Problem) -> Problem:
        return self._set(problem, math.copysign(math.inf, self._sign))

    def relaxed(self, problem: Problem, by: float) -> Problem:
        return self._set(problem, self.relaxed_value(_not_negative(self.name, by)))

    def excess(self, solution: Solution, certificate: Certificate) -> float:
        return self._sign * (solution.parameters[self.parameter] - self.value)

    @property
    def most(self) -> float:
        return math.inf

    @property
    def kept_at_rest(self) -> bool:
        return self._sign * self.value >= 0.0

    def relaxed_value(self, by: float) -> float:
        return self.value + self._sign * by

    def slack(self, problem: Problem) -> float:
        return DEFAULT.requirement * problem.length / _weight(problem, self.parameter)

    def rate(self, sensitivity: Sensitivity) -> float:
        return -self._sign * sensitivity.limits[self.parameter][self.side]

    @property
    def _sign(self) -> float:
        return 1.0 if self.side else -1.0

    def _set(self, problem: Problem, value: float) -> Problem:
        ends = list(problem.request["limits"].get(self.parameter, (-math.inf, math.inf)))
        ends[self.side] = value
        return problem.changed(limits={**problem.request["limits"], self.parameter: tuple(ends)})


@dataclass(frozen=True, kw_only=True)
class _Held(Constraint):
    """A parameter whose limits are equal; it is relaxed to both sides."""

    def dropped(self, problem: Problem) -> Problem:
        limits = problem.request["limits"]
        return problem.changed(limits={name: ends for name, ends in limits.items() if name != self.parameter})

    def relaxed(self, problem: Problem, by: float) -> Problem:
        by = _not_negative(self.name, by)
        ends = (self.value - by, self.value + by)
        return problem.changed(limits={**problem.request["limits"], self.parameter: ends})

    def excess(self, solution: Solution, certificate: Certificate) -> float:
        return abs(solution.parameters[self.parameter] - self.value)

    @property
    def most(self) -> float:
        return math.inf

    @property
    def kept_at_rest(self) -> bool:
        return self.value == 0.0

    def slack(self, problem: Problem) -> float:
        return DEFAULT.requirement * problem.length / _weight(problem, self.parameter)

    def rate(self, sensitivity: Sensitivity) -> float:
        return abs(sensitivity.limits[self.parameter][0])  # equal limits are one datum, the lower


@dataclass(frozen=True, kw_only=True)
class _KeptOut(Constraint):
    """That a keep-out is not entered."""

    keep_out: str

    def dropped(self, problem: Problem) -> Problem:
        return problem.changed(keep_out=tuple(own for own in problem.keep_out if own.name != self.keep_out))

    def excess(self, solution: Solution, certificate: Certificate) -> float:
        return -_checked(certificate, kept_clear(self.keep_out))

    def slack(self, problem: Problem) -> float:
        return _slack_to(problem, _keep_out(problem, self.keep_out))

    def rate(self, sensitivity: Sensitivity) -> float:
        return sensitivity.keep_out[self.keep_out]


@dataclass(frozen=True, kw_only=True)
class _KeepOutClearance(Constraint):
    """The clearance that is kept to a keep-out."""

    keep_out: str

    def dropped(self, problem: Problem) -> Problem:
        return self.relaxed(problem, self.value)

    def relaxed(self, problem: Problem, by: float) -> Problem:
        clearance = self.relaxed_value(_not_negative(self.name, by, self.value))
        return problem.changed(
            keep_out=tuple(
                replace(own, clearance=clearance) if own.name == self.keep_out else own for own in problem.keep_out
            )
        )

    def excess(self, solution: Solution, certificate: Certificate) -> float:
        return self.value - _checked(certificate, kept_clear(self.keep_out))

    @property
    def most(self) -> float:
        return self.value

    def relaxed_value(self, by: float) -> float:
        return self.value - by

    def slack(self, problem: Problem) -> float:
        return _slack_to(problem, _keep_out(problem, self.keep_out))

    def rate(self, sensitivity: Sensitivity) -> float:
        return sensitivity.keep_out[self.keep_out]


@dataclass(frozen=True, kw_only=True)
class _Clearance(Constraint):
    """The clearance of the target pair."""

    def dropped(self, problem: Problem) -> Problem:
        return problem.changed(clearance=0.0)

    def relaxed(self, problem: Problem, by: float) -> Problem:
        return problem.changed(clearance=self.relaxed_value(_not_negative(self.name, by, self.value)))

    def excess(self, solution: Solution, certificate: Certificate) -> float:
        return self.value - _checked(certificate, "clearance")

    @property
    def most(self) -> float:
        return self.value

    def relaxed_value(self, by: float) -> float:
        return self.value - by

    def slack(self, problem: Problem) -> float:
        return problem.contact_slack

    def rate(self, sensitivity: Sensitivity) -> float:
        return sensitivity.clearance


@dataclass(frozen=True, kw_only=True)
class _PairState(Constraint):
    """The state that the target pair must have besides the goal: "clear" or "touch"."""

    state: str

    def dropped(self, problem: Problem) -> Problem:
        return problem.changed(pair="any", clearance=problem.clearance if problem.goal == "clear" else 0.0)

    def excess(self, solution: Solution, certificate: Certificate) -> float:
        if self.state == "touch":
            return 0.0 if _passed(certificate, "pair touches") else math.inf
        return -_checked(certificate, "clearance")

    def slack(self, problem: Problem) -> float:
        return problem.contact_slack


@dataclass(frozen=True, kw_only=True)
class _Coherence(Constraint):
    """That the tracked features stay the contact along the path."""

    def dropped(self, problem: Problem) -> Problem:
        return problem.changed(path="free")

    def excess(self, solution: Solution, certificate: Certificate) -> float:
        return 0.0 if _passed(certificate, "path") else math.inf


@dataclass(frozen=True, kw_only=True)
class _WholeSteps(Constraint):
    """That the motion is in whole steps of the machine; the relaxation counts how often the steps are halved."""

    def dropped(self, problem: Problem) -> Problem:
        return problem.changed(resolution=None)

    def relaxed(self, problem: Problem, by: float) -> Problem:
        finer = 2.0 ** _not_negative(self.name, by)
        steps = problem.request["resolution"]
        return problem.changed(resolution={name: step / finer for name, step in steps.items()})

    @property
    def most(self) -> float:
        return math.inf

    def excess(self, solution: Solution, certificate: Certificate) -> float:
        return 0.0 if _passed(certificate, "whole steps") else math.inf


def constraints(problem: Problem) -> tuple[Constraint, ...]:
    """Return all constraints of a problem; what is implied by the goal is none.

    Returns
    -------
    tuple of Constraint
        Limits by parameter, keep-outs, pair state, clearance, coherence, whole steps; a weaker one stands before the
        one that includes it.
    """
    found: list[Constraint] = []
    for parameter, ends in zip(problem.motion.parameters, problem.limits.tolist(), strict=True):
        name, unit = parameter.name, "length" if parameter.kind == "translation" else "radian"
        if ends[0] == ends[1]:
            found.append(_Held(name=f"{name} held", value=ends[0], unit=unit, parameter=name))
            continue
        for side, (word, end) in enumerate(zip(("lower", "upper"), ends, strict=True)):
            if math.isfinite(end):
                found.append(_Limit(name=f"{word} limit of {name}", value=end, unit=unit, parameter=name, side=side))
    for own in problem.keep_out:
        kept = f"keep-out {own.name!r}"
        found.append(_KeptOut(name=kept, keep_out=own.name))
        if own.clearance > 0:
            found.append(
                _KeepOutClearance(
                    name=kept_clear(own.name), value=own.clearance, unit="length", includes=kept, keep_out=own.name
                )
            )
    state = "" if problem.pair in ("any", problem.goal) else f"pair {problem.pair!r}"
    if state:
        found.append(_PairState(name=state, state=problem.pair))
    if problem.clearance > 0:
        includes = "" if problem.goal == "clear" else state
        found.append(_Clearance(name="clearance", value=problem.clearance, unit="length", includes=includes))
    if problem.goal in TRACKING and problem.path == "coherent":
        found.append(_Coherence(name="coherence"))
    if problem.resolution is not None:
        found.append(_WholeSteps(name="whole steps", unit="halvings"))
    return tuple(found)


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
    chosen = [named(problem, name) for name in dict.fromkeys(names)]
    for own in chosen:
        problem = own.dropped(problem)
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
    found = {own.name: (own.excess(solution, certificate), own.slack(problem)) for own in constraints(problem)}
    return {name: 0.0 if value <= slack else value for name, (value, slack) in found.items()}


def _not_negative(name: str, by: Any, most: float = math.inf) -> float:
    if not (isinstance(by, int | float | np.integer | np.floating) and 0.0 <= by <= most and math.isfinite(by)):
        allowed = f"a number from 0 to {most:.9g}" if math.isfinite(most) else "a finite number >= 0"
        raise InputError("not a relaxation", key=name, found=by, allowed=allowed)
    return float(by)


def _weight(problem: Problem, parameter: str) -> float:
    names = [own.name for own in problem.motion.parameters]
    return float(problem.weights[names.index(parameter)])


def _keep_out(problem: Problem, name: str) -> KeepOut:
    return next(own for own in problem.keep_out if own.name == name)


def _slack_to(problem: Problem, keep_out: KeepOut) -> float:
    """Return the slack with which the judge looks at a keep-out."""
    return max(problem.contact_slack, DEFAULT.tie * keep_out.body.size)


def _checked(certificate: Certificate, name: str) -> float:
    """Return what the judge found in a check; what he could not find is infinitely bad."""
    return next((check.value for check in certificate.checks if check.name == name), -math.inf)


def _passed(certificate: Certificate, start: str) -> bool:
    """Tell whether there are checks whose names start so, and all passed."""
    checks = [check.passed for check in certificate.checks if check.name.startswith(start)]
    return bool(checks) and all(checks)
