"""What if: change anything in a solved problem and see what changes, beside what the derivatives predict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from time import perf_counter
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from fcdm_opt.along.sensitivity import Sensitivity, by_moves
from fcdm_opt.curve.segments import SwitchingPoint
from fcdm_opt.design.question import excluded
from fcdm_opt.design.sizes import beyond_tolerances
from fcdm_opt.design.whatif.constraints import scene_of
from fcdm_opt.design.whatif.fitting import barred_text
from fcdm_opt.errors import InputError, closest
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.units import measured, number_text
from fcdm_opt.lazy_import import NotebookRepr
from fcdm_opt.plain import Plain, plain
from fcdm_opt.problem.assembled import AssemblySolution
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.entries import plain_keep_out
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import Bounded, Solution
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT

NAN = float("nan")
HARMLESS = ("more constraints", "either of several")  # derivatives that these open are nan, the rest hold
DISCRETE = ("goal", "motion", "pair", "path", "amount", "requirement", "resolution", "features")


@dataclass(frozen=True, kw_only=True)
class Prediction(Plain):
    """What the derivatives of a solved problem predict."""

    # that of the motion which the derivatives of the motion predict, where sizes alone are changed and these are known;
    # else the amount before plus all `terms`. Length units; nan where one of them is
    amount: float
    # what was changed -> what it adds to the amount, to first order; nan where there is no derivative by it
    terms: Mapping[str, float] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()  # why a term is nan, or why the prediction may hold for smaller changes only


BY_SIZE, IN_WORDS = ("scales", "made"), ("name", "unit")  # arguments of an assembly: with derivatives, and only shown

Terms = Iterator[tuple[str, float, str]]  # name of a term, its value, the reason where it is nan or doubtful


def prediction(before: Any, problem: Any) -> Prediction:
    """Return the amount of a changed question, `problem`, to first order."""
    # right to second order in the changes while the same constraints hold the motion
    if not before.usable:
        why = "the motion found before is not to be used" if before.status.found else "no motion was found"
        return Prediction(amount=NAN, reasons=(why,))
    several = isinstance(before, AssemblySolution)
    discrete = [] if several else [*_discrete(before.question, problem)]
    found = discrete
    if not discrete:  # else the derivatives need not be worked out
        found = [*(_of_assembly(before, problem) if several else _changes(before, problem))]
        blocking = "; ".join(why for why in before.sensitivity.reasons if not why.startswith(HARMLESS))
        if found and blocking:
            found = [(name, NAN, blocking) for name, _, _ in found]
    terms = {name: term for name, term, _ in found}
    amount = _of_motion(before, problem) if terms and not discrete else None
    amount = before.amount + sum(terms.values()) if amount is None else amount
    reasons = dict.fromkeys(reason for _, _, reason in found if reason)
    if terms and amount < -DEFAULT.tie * problem.size:
        reasons["below zero, as no amount is: the derivatives hold for smaller changes only"] = None
    return Prediction(amount=amount, terms=terms, reasons=tuple(reasons))


def _of_motion(before: Any, new: Any) -> float | None:
    """Return the weighted amount of the motion to first order in the sizes changed; None where more is changed."""
    # it is right across motions at which the amount has a kink, as where a part is moved the other way
    old, rates = before.question, before.sensitivity
    others = [key for key in old.request if key not in (*BY_SIZE, *IN_WORDS, "exact_at")]
    alike = all(same(old.request[key], new.request[key]) for key in others)
    if not (alike and before.coordinates) or old.amount != "weighted":
        return None
    q = np.array([*before.coordinates.values()])
    for key, by in (("scales", "motion_by_scale"), ("made", "motion_by_size")):
        was, now = (getattr(own, key, None) or {} for own in (old, new))
        for name in was:
            if was[name] != now.get(name, was[name]):
                q = q + getattr(rates, by).get(name, NAN) * (now[name] - was[name])
    amount = float(np.linalg.norm(q * [own.weight for own in old.coordinates]))
    return None if np.isnan(amount) else amount


def _of_assembly(before: AssemblySolution, new: Assembly) -> Terms:
    """Yield what changed scales and sizes of an assembly add to the amount; by all else there is no derivative."""
    old, rates = before.assembly, before.sensitivity
    for key, value in new.request.items():
        if key not in (*BY_SIZE, *IN_WORDS) and not same(old.request[key], value):
            yield key, NAN, f"no derivative by {key} of an assembly"
    for key, known in (("scales", rates.scales), ("made", rates.sizes)):
        was, now = getattr(old, key), getattr(new, key)
        for name in (name for name in known if name in now):
            yield from _term(f"{key}.{name}", known[name], was[name], now[name])


def _discrete(old: Problem, new: Problem) -> Terms:
    """Yield changes that no derivative speaks of."""
    for name in DISCRETE:
        one, two = getattr(old, name), getattr(new, name)
        if name == "requirement" and None in (one, two):  # the same pair, given in another way: see the target
            continue
        if not same(one, two):
            yield name, NAN, f"{name} is another: no derivative by it"
    if isinstance(old.nominal, int) and isinstance(new.nominal, int) and old.nominal != new.nominal:
        yield "nominal", NAN, "another switching point: no derivative by its number"
    elif old.tracked_features != new.tracked_features or (
        isinstance(old.nominal, int) and old.nominal_features != new.nominal_features
    ):
        yield "nominal", NAN, "the nominal contact has other features"
    if [kept.name for kept in old.keep_out] != [kept.name for kept in new.keep_out]:
        yield "keep_out", NAN, "other keep-outs: no derivative by them"
    else:
        for one, two in zip(old.keep_out, new.keep_out, strict=True):
            if one.scale != two.scale:
                yield f"keep_out {one.name!r} scale", NAN, "no derivative by the scale of a keep-out"


def _changes(before: Solution, new: Problem) -> Terms:
    old, rates = before.problem, before.sensitivity
    yield from _pair(old, new, rates)
    if old.amount == "weighted":  # of the length as well
        yield from _term("weights", [*rates.weights.values()], old.weights, new.weights)
    yield from _limits(before, new)
    yield from _term("clearance", rates.clearance, old.clearance, new.clearance)
    for one, two in zip(old.keep_out, new.keep_out, strict=True):
        yield from _term(f"keep_out {one.name!r} clearance", rates.keep_out[one.name], one.clearance, two.clearance)
    if old.exact_at is not None and all(same(old.drawn[role], new.drawn[role]) for role in old.drawn):
        for name, now in (new.made or {}).items():  # the points at which parts are exact go with the sizes
            yield from _term(f"made.{name}", rates.sizes.get(name, NAN), (old.made or {}).get(name, 0.0), now)
        return
    keys = ["P1", "P2", *(f"keep-out {kept.name!r} " for kept in old.keep_out)]
    bodies = [(problem.movable, problem.static, *(kept.body for kept in problem.keep_out)) for problem in (old, new)]
    for key, one_body, two_body in zip(keys, *bodies, strict=True):
        yield from _body(key, one_body, two_body, rates)


def _pair(old: Problem, new: Problem, rates: Sensitivity) -> Terms:
    """Yield what a changed target pair adds: by tolerance and nominal scales, else by the target itself."""
    # a nominal switching point that moves with the geometry is in the derivatives by the geometry
    if old.requirement is None or new.requirement is None:
        yield from _term("target", rates.target, old.target, new.target)
        return
    yield from _term("tolerance", rates.tolerance, old.tolerance, new.tolerance)
    if np.array_equal(old.nominal_pair, new.nominal_pair) or isinstance(new.nominal, int):
        return
    if old.goal in TRACKING and same(old.request["nominal"], new.request["nominal"]):
        if not isinstance(new.nominal_contact, SwitchingPoint):
            yield "nominal", NAN, "the nominal pair was closed to another point of the curve"
        return
    yield from _term("nominal", rates.nominal, old.nominal_pair, new.nominal_pair)


def _limits(before: Solution, new: Problem) -> Terms:
    for k, (name, (lower, upper)) in enumerate(before.sensitivity.limits.items()):
        held, ends = before.problem.limits[k], new.limits[k]
        if held[0] == held[1]:
            yield from _freed(name, lower, ends - held[0])
            continue
        for side, (rate, one, two) in enumerate(zip((lower, upper), held.tolist(), ends.tolist(), strict=True)):
            if one == two:
                continue
            label, q = f"limits.{name} {('lower', 'upper')[side]}", before.parameters.get(name, NAN)
            beyond = (q - two) * new.weights[k] * (-1.0, 1.0)[side]
            if np.isfinite(two - one) and rate == 0 and beyond > DEFAULT.active * new.size:
                yield label, NAN, f"the motion before breaks the new limit of {name}, which did not hold it"
            elif np.isfinite(two - one):
                yield from _term(label, rate, one, two)
            elif np.isfinite(one) and rate != 0:
                yield label, NAN, f"the limit of {name}, which holds the motion, is gone: no derivative by that"
            elif np.isfinite(two) and not beyond <= 0:
                yield label, NAN, f"the motion before breaks the new limit of {name}"
            else:
                yield label, 0.0, ""


def _freed(name: str, rate: float, moves: Array) -> Terms:
    """Yield what it adds that a parameter held at one value may be in a range about it: its best end, if it has one."""
    # equal limits are one datum, with one derivative
    if not moves.any():
        return
    label, best = f"limits.{name}", float((rate * moves).min()) if rate else 0.0
    if np.isinf(best):
        yield label, NAN, f"the limit of {name}, which holds the motion, is gone: no derivative by that"
    else:
        yield label, best, f"no derivative by {label} there" if np.isnan(best) else ""


def _body(key: str, old: Body, new: Body, rates: Sensitivity) -> Terms:
    """Yield what a changed body adds: by its vertices, or the shifts of its faces, and by its seed."""
    name = key.strip()
    if old is new:
        return
    if set(old.faces) != set(new.faces) or len(old.vertices) != len(new.vertices) or len(old.parts) != len(new.parts):
        yield f"{name} shape", NAN, f"{name} has other vertices, faces or parts: no derivative by that"
        return
    yield from _term(f"{name} seed", rates.seeds[name], old.seed, new.seed)
    moves = new.vertices - old.vertices
    if not moves.any():
        return
    change, by = by_moves(key, old, moves, rates.faces, rates.vertices)
    reason = f"no derivative by a vertex of {name} that moves and breaks or turns a face that matters"
    yield f"{name} {by}", change, reason if np.isnan(change) else ""


def _term(name: str, rates: Any, old: Any, new: Any) -> Terms:
    """Yield derivatives times changes, of which those that are zero need no derivative; nothing where all are."""
    changes = np.ravel(np.subtract(new, old))
    used = changes != 0
    if used.any():
        total = float(np.ravel(rates)[used] @ changes[used])
        yield name, total, f"no derivative by {name} there" if np.isnan(total) else ""


def same(one: Any, two: Any) -> bool:
    """Tell whether two arguments of a problem are the same."""
    if one is two:
        return True
    if isinstance(one, np.ndarray) or isinstance(two, np.ndarray):
        return np.array_equal(one, two)
    if isinstance(one, list | tuple) and isinstance(two, list | tuple):
        return len(one) == len(two) and all(map(same, one, two))
    if isinstance(one, Size) and isinstance(two, Size):
        return one.to_dict() == two.to_dict()
    if isinstance(one, KeepOut) and isinstance(two, KeepOut):
        return plain_keep_out(one) == plain_keep_out(two)
    return bool(type(one) is type(two) and one == two)


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
        before = number_text(self.before.amount) if self.before.usable else "none"
        after = measured(self.after.amount, self.after.amount_unit) if self.after.usable else "none"
        amounts = "no amount before or after" if before == after == "none" else f"amount {before} -> {after}"
        predicted = f"predicted {number_text(self.predicted_amount)}"
        if np.isnan(self.predicted_amount):
            predicted = "not predicted: " + ("; ".join(self.prediction.reasons) or "no amount before")
        ended = self.after.status.words if self.after.usable else barred_text(self.after)
        changed = f"{', '.join(self.changed) or 'nothing'} changed: {amounts} ({predicted}), {ended}"
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
        old_value, new_value = (plain(getattr(own, name, None)) for own in (before, after))
        tied = isinstance(old_value, float) and isinstance(new_value, float) and abs(old_value - new_value) <= floor
        if old_value != new_value and not tied:  # infinity is a word
            yield Difference(name, old_value, new_value)
    for name in ("status", "usable", "pair_state", "pair", "features", "active"):
        was, now = (plain(getattr(own, name, None)) for own in (before, after))
        if was != now:
            yield Difference(name, was, now)
