"""What if: change anything in a solved problem and see what changes, beside what the derivatives predict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from time import perf_counter
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from fcdm_opt.design.question import excluded
from fcdm_opt.design.sizes import beyond_tolerances
from fcdm_opt.design.whatif.constraints import scene_of
from fcdm_opt.design.whatif.prediction import Prediction, prediction, same
from fcdm_opt.errors import InputError, closest
from fcdm_opt.geometry.units import measured, number_text
from fcdm_opt.lazy_import import NotebookRepr
from fcdm_opt.plain import Plain, plain
from fcdm_opt.problem.assembled import AssemblySolution
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import Bounded, Solution
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT


class Difference(NamedTuple):
    """One thing of the answer that changed: plain values before and after, None where there is none."""

    name: str
    before: Any
    after: Any


@dataclass(frozen=True, eq=False, kw_only=True)
class WhatIf(Plain, NotebookRepr):
    """A solved problem, a changed one, and what the change did.

    Attributes
    ----------
    changed : tuple of str
        The arguments of `Problem`, or of `Assembly`, that were changed.
    before, after : Solution or AssemblySolution
    prediction : Prediction
        What the derivatives of `before` predict for the amount.
    seconds : dict
        Wall time of "before" (0 where a solution was given), "after" and "prediction" (which works the derivatives
        out where `before` has none yet).
    """

    plain_names: ClassVar[tuple[str, ...]] = (
        "changed", "before", "after", "change", "predicted_amount", "prediction", "differences", "seconds",
    )  # fmt: skip

    changed: tuple[str, ...]
    before: Any
    after: Any
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

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Rebuild from `to_dict`; raises `InputError`."""
        sides = dict(data)
        for side in ("before", "after"):
            if isinstance(own := data.get(side), Mapping):
                sides[side] = (AssemblySolution if "assembly" in own else Solution).from_dict(own)
        return super().from_dict(sides)

    def __str__(self) -> str:
        """Return one line: the change, the amount before, after and predicted."""
        after = measured(self.after.amount, self.after.amount_unit)
        amounts = f"amount {number_text(self.before.amount)} -> {after}"
        told = f"predicted {number_text(self.predicted_amount)}"
        if np.isnan(self.predicted_amount):
            told = "not predicted: " + ("; ".join(self.prediction.reasons) or "no amount before")
        changed = f"{', '.join(self.changed) or 'nothing'} changed: {amounts} ({told}), {self.after.status.words}"
        return "; ".join(filter(None, [changed, self.unchanged_text, *beyond_tolerances(self.after.question)]))

    @property
    def unchanged_text(self) -> str:
        """That the change does not change the answer, in words, or is none; "" where it does."""
        if self.changed and self.differences:
            return ""
        return "the answer stays the same" if self.changed else "nothing is changed: the question is the same"


def whatif(problem: Scene | Bounded, other: Scene | None = None, /, **changes: Any) -> WhatIf:
    """Change a solved problem or assembly, solve it again, and say what changed.

    The changed problem shares what did not change: bodies, decision curve, compiled programs. A solution that is
    certified is compared with one that is.

    Parameters
    ----------
    problem : Problem or Assembly, or a solution of one
        A problem is solved first. A solution's problem names the features that it tracks, where there was a choice:
        give the problem to leave it open again.
    other : Problem or Assembly, optional
        The changed question as a whole, in place of `changes`.
    **changes
        Arguments of `Problem`, or of `Assembly`. A target drops requirement and tolerance, and these drop a target,
        unless given too; another motion drops `published`.

    Returns
    -------
    WhatIf

    Raises
    ------
    InputError
        For an argument that the question does not have or does not take, what is neither problem nor solution, and
        changes besides a changed problem.
    """
    asked = scene_of(problem)
    for name in changes:
        if name not in asked.request:
            kind = "an assembly" if isinstance(asked, Assembly) else "a problem"
            what = f"{kind} has no such argument{closest(name, asked.request)}"
            raise InputError(what, key=name, allowed=", ".join(asked.request))
    if other is None:
        dropped: dict[str, Any] = {  # what the change leaves without meaning
            key: None for name, value in changes.items() if value is not None for key in excluded(name)
        }
        if "motion" in changes:
            dropped |= {"published": None, "published_text": ""}
        other = asked.changed(**{**dropped, **changes})
    elif changes or type(other) is not type(asked):
        found, allowed = ", ".join(changes) or type(other).__name__, f"a {type(asked).__name__}, or changes"
        raise InputError("not one way to say what changes", key="other", found=found, allowed=allowed)
    names = tuple(key for key in changes or asked.request if not same(asked.request[key], other.request[key]))
    times = [perf_counter()]
    before: Any = problem if isinstance(problem, Bounded) else solve(problem)
    times.append(perf_counter())
    after: Any = solve(other, certify=before.evidence is not None)
    times.append(perf_counter())
    predicted = prediction(before, other)
    times.append(perf_counter())
    spans = zip(("before", "after", "prediction"), pairwise(times), strict=True)
    seconds = {name: end - start for name, (start, end) in spans}
    return WhatIf(changed=names, before=before, after=after, prediction=predicted, seconds=seconds)


def _differences(before: Any, after: Any) -> Iterator[Difference]:
    floor = DEFAULT.tie * max(before.question.size, after.question.size)  # of lengths: below it, rounding
    weights = {own.name: own.weight for answer in (before, after) for own in answer.question.coordinates}
    for name in dict.fromkeys((*before.coordinates, *after.coordinates)):
        one, two = before.coordinates.get(name), after.coordinates.get(name)
        if one is None or two is None or abs(one - two) * weights[name] > floor:
            yield Difference(f"parameters.{name}", one, two)
    for name in ("amount", "lower_bound", "pair_gap"):
        was_told, now_told = (plain(getattr(told, name, None)) for told in (before, after))
        tied = isinstance(was_told, float) and isinstance(now_told, float) and abs(was_told - now_told) <= floor
        if was_told != now_told and not tied:  # infinity is a word
            yield Difference(name, was_told, now_told)
    for name in ("status", "usable", "pair_state", "pair", "features", "active"):
        was, now = (plain(getattr(told, name, None)) for told in (before, after))
        if was != now:
            yield Difference(name, was, now)
