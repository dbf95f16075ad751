"""What if: change anything in a solved problem and see what changes, beside what the derivatives foretell."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from time import perf_counter
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fcdm_opt.design.question import excluded
from fcdm_opt.design.whatif.constraints import problem_of
from fcdm_opt.design.whatif.prediction import Prediction, prediction, same
from fcdm_opt.doors import Shown
from fcdm_opt.errors import InputError, closest
from fcdm_opt.geometry.units import measured
from fcdm_opt.plain import Plain, plain
from fcdm_opt.problem.keys import ARGUMENTS
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Solution
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT


class Difference(NamedTuple):
    """One thing of the answer that changed: plain values before and after, None where there is none."""

    name: str
    before: Any
    after: Any


@dataclass(frozen=True, eq=False, kw_only=True)
class WhatIf(Plain, Shown):
    """A solved problem, a changed one, and what the change did.

    Attributes
    ----------
    changed : tuple of str
        The arguments of `Problem` that were changed.
    before, after : Solution
    prediction : Prediction
        What the derivatives of `before` foretell for the amount.
    seconds : dict
        Wall time of "before" (0 where a solution was given), "after" and "prediction" (which works the derivatives
        out where `before` has none yet).
    """

    plain_names: ClassVar[tuple[str, ...]] = (
        "changed", "before", "after", "change", "predicted_amount", "prediction", "differences", "seconds",
    )  # fmt: skip

    changed: tuple[str, ...]
    before: Solution
    after: Solution
    prediction: Prediction
    seconds: Mapping[str, float]

    @property
    def predicted_amount(self) -> float:
        """Amount to first order, length units; nan where `prediction` has a reason."""
        return self.prediction.amount

    @property
    def change(self) -> float:
        """By how much the amount grew; nan where there is no motion on either side."""
        return self.after.amount - self.before.amount

    @cached_property
    def differences(self) -> tuple[Difference, ...]:
        """What changed in the answer: parameters, amount, bound, status, features, what holds it, target pair."""
        return tuple(_differences(self.before, self.after))

    def __str__(self) -> str:
        """Return one line: the change, the amount before, after and foretold."""
        after = measured(f"{self.after.amount:.6g}", self.after.problem.amount_unit)
        amounts = f"amount {self.before.amount:.6g} -> {after}"
        told = f"foretold {self.predicted_amount:.6g}"
        if np.isnan(self.predicted_amount):
            told = "not foretold: " + ("; ".join(self.prediction.reasons) or "no amount before")
        status = self.after.status.name
        return f"{', '.join(self.changed) or 'nothing'} changed: {amounts} ({told}), {status}"


def whatif(problem: Problem | Solution, other: Problem | None = None, /, **changes: Any) -> WhatIf:
    """Change a solved problem, solve it again, and say what changed.

    The changed problem shares what did not change: bodies, decision curve, compiled programs. A solution that is
    certified is compared with one that is.

    Parameters
    ----------
    problem : Problem or Solution
        A problem is solved first. A solution's problem names the features that it tracks, where there was a choice:
        give the problem to leave it open again.
    other : Problem, optional
        The changed problem as a whole, in place of `changes`.
    **changes
        Arguments of `Problem`. A target drops requirement and tolerance, and these drop a target, unless given too;
        another motion drops `published`.

    Returns
    -------
    WhatIf

    Raises
    ------
    InputError
        For an argument that `Problem` does not have or does not take, what is neither problem nor solution, and
        changes besides a changed problem.
    """
    asked = problem_of(problem)
    for name in changes:
        if name not in ARGUMENTS:
            what = f"a problem has no such argument{closest(name, ARGUMENTS)}"
            raise InputError(what, key=name, allowed=", ".join(ARGUMENTS))
    if other is None:
        other = asked.changed(**{**_dropped(changes), **changes})
    elif changes or not isinstance(other, Problem):
        found = ", ".join(changes) or type(other).__name__
        raise InputError("not one way to say what changes", key="other", found=found, allowed="a Problem, or changes")
    names = tuple(changes) or tuple(name for name in ARGUMENTS if not same(asked.request[name], other.request[name]))
    times = [perf_counter()]
    before = problem if isinstance(problem, Solution) else solve(problem)
    times.append(perf_counter())
    after = solve(other, certify=before.evidence is not None)
    times.append(perf_counter())
    foretold = prediction(before, other)
    times.append(perf_counter())
    spans = zip(("before", "after", "prediction"), pairwise(times), strict=True)
    seconds = {name: end - start for name, (start, end) in spans}
    return WhatIf(changed=names, before=before, after=after, prediction=foretold, seconds=seconds)


def _dropped(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments that a change leaves without meaning."""
    dropped: dict[str, Any] = {
        other: None for name, value in changes.items() if value is not None for other in excluded(name)
    }
    if "motion" in changes:
        dropped |= {"published": None, "published_text": ""}
    return dropped


def _differences(before: Solution, after: Solution) -> Iterator[Difference]:
    floor = DEFAULT.tie * max(before.problem.size, after.problem.size)  # of lengths: below it, rounding
    weights = dict[str, float]()
    for problem in (before.problem, after.problem):
        weights |= problem.motion.by_name(problem.weights)
    for name in dict.fromkeys((*before.parameters, *after.parameters)):
        one, two = before.parameters.get(name), after.parameters.get(name)
        if one is None or two is None or abs(one - two) * weights[name] > floor:
            yield Difference(f"parameters.{name}", one, two)
    for name in ("amount", "lower_bound", "pair_gap"):
        was_told, now_told = plain(getattr(before, name)), plain(getattr(after, name))
        tied = isinstance(was_told, float) and isinstance(now_told, float) and abs(was_told - now_told) <= floor
        if was_told != now_told and not tied:  # infinity is a word
            yield Difference(name, was_told, now_told)
    for name in ("status", "usable", "pair_state", "pair", "features", "active"):
        was, now = (plain(getattr(told, name))
                    for told in (before, after))  # fmt: skip
        if was != now:
            yield Difference(name, was, now)
