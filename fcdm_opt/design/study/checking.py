"""What a study refuses before anything is solved."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.design.places import Place, overlap, parse
from fcdm_opt.design.question import canonical, excluded
from fcdm_opt.design.study import sampling
from fcdm_opt.design.study.variables import PARAMETERS
from fcdm_opt.errors import InputError
from fcdm_opt.problem.arguments import LARGEST, is_real, positive
from fcdm_opt.problem.keys import Defaults
from fcdm_opt.problem.solution import EFFORTS

if TYPE_CHECKING:
    from fcdm_opt.design.study.study import Study

OWN_LABELS = ("case", "draw", "number", "key")  # columns that every table of results may have
MOST_POINTS = 10**12  # more than any run will see the end of
_NO_DEFAULTS = Defaults()


def check_arguments(study: Study) -> None:
    """Refuse arguments of the wrong kind, each for itself."""
    if study.sampling not in sampling.SAMPLINGS:
        raise InputError(
            "no such sampling", key="sampling", found=study.sampling, allowed=" or ".join(sampling.SAMPLINGS)
        )
    for key, least in (("count", 1), ("seed", 0)):
        value = getattr(study, key)
        if not (key == "count" and value is None) and not (_is_whole(value) and value >= least):
            raise InputError("wrong value", key=key, found=value, allowed=f"a whole number >= {least}")
    if study.count is not None and study.count > sampling.MOST:
        raise InputError("too many draws", key="count", found=study.count, allowed=f"at most {sampling.MOST}")
    if not isinstance(study.certify, bool):
        raise InputError("wrong value", key="certify", found=study.certify, allowed="true or false")
    if study.effort not in EFFORTS:
        raise InputError("no such effort", key="effort", found=study.effort, allowed=" or ".join(EFFORTS))
    if study.certify and study.effort == "quick":
        raise InputError("a quick search proves nothing", key="effort", found="quick", allowed="proved, with certify")
    if study.time_limit is not None:
        positive(study.time_limit, "time_limit")
    if study.budget is not None and not (is_real(study.budget) and 0 <= study.budget <= LARGEST):
        raise InputError("wrong value", key="budget", found=study.budget, allowed="a finite amount >= 0")
    for key in ("title", "note"):
        if not isinstance(getattr(study, key), str):
            raise InputError("not a text", key=key, found=getattr(study, key), allowed="a text")
    for key in ("parameters", "derive"):
        given = getattr(study, key)
        if given is not None and not (isinstance(given, Mapping) and all(isinstance(name, str) for name in given)):
            raise InputError("expected a table", key=key, found=given, allowed="names or keys with their values")


def check_keys(study: Study) -> None:
    """Refuse keys and labels that are given twice, and keys of which one lies inside another."""
    placed = [(variable.where, key) for variable in study.variables for key in variable.keys]
    placed += [(f"derive.'{key}'", key) for key in study.derive or {}]
    for where, key in placed:
        try:
            place = parse(key)
        except InputError as reason:
            raise reason.within(key=where) from reason
        if where.startswith("derive") and place[0] == PARAMETERS:
            allowed = f"the expression itself as a value in {PARAMETERS}"
            raise InputError("a parameter is not derived", key=where, found=key, allowed=allowed)
        if place[0] == PARAMETERS and not (len(place) == 2 and isinstance(place[1], str)):
            raise InputError("not a parameter", key=where, found=key, allowed=f"{PARAMETERS}.name")
        if place[0] == "name":
            raise InputError("the name of a case does not vary", key=where, found=key, allowed="other keys")
    for (one, first), (two, second) in combinations(placed, 2):
        if overlap(_without_units(parse(first)), _without_units(parse(second))):
            what = "a key is given twice" if first == second else "two keys say the same"
            raise InputError(what, key=two, found=f"{second}, and {first} in {one}", allowed="each key once")
    names: dict[str, str] = {}
    for variable in study.variables:
        label, where = variable.label, f"{variable.where}.label"
        if label in OWN_LABELS:
            raise InputError("this label has a meaning in tables", key=where, found=label, allowed="another label")
        if names.setdefault(label, variable.where) != variable.where:
            raise InputError(
                f"the label is that of {names[label]}", key=where, found=label, allowed="a label of its own"
            )


def check_draws(study: Study) -> None:
    """Refuse distributions without a number of draws and the other way round, and points without end."""
    drawn = [variable for variable in study.variables if variable.drawn]
    if drawn and study.count is None:
        raise InputError(
            "how many numbers to draw?", key="count", found=f"none, with a distribution in {drawn[0].where}",
            allowed="a whole number >= 1",
        )  # fmt: skip
    if study.count is not None and not drawn:
        raise InputError(
            "nothing is drawn", key="count", found=study.count, allowed="no count, or a variable with a distribution"
        )
    points = math.prod(map(len, study.axes.values()))
    if points > MOST_POINTS:
        raise InputError("too many points", key="vary", found=points, allowed=f"at most {MOST_POINTS}")


def check_values(study: Study) -> None:
    """Refuse keys and listed values that make no question, whatever the others are."""
    for base in study.questions:
        first = dict.fromkeys(study.variables, 0)
        try:
            question = study.question_at(base, first)
            question.check().arguments(_NO_DEFAULTS)
            question.drawn()
        except InputError as reason:
            raise _placed(study, reason) from reason
        _check_target(question.case)
        for variable in study.variables:
            for k in [] if variable.drawn else _telling(variable.values):
                try:
                    study.question_at(base, {**first, variable: k}).check()
                except InputError as reason:
                    if not _of_derivation(reason):
                        raise _wrong(reason, f"{variable.listed}[{k + 1}]") from reason


def _placed(study: Study, reason: InputError) -> InputError:
    """Return what is wrong with the first point as an error of the variable or derived key that it comes from."""
    if reason.key is None or _of_derivation(reason):
        return reason
    where = {key: variable.where for variable in study.variables for key in variable.keys}
    where |= {key: f"derive.'{key}'" for key in study.derive or {}}
    for key, own in where.items():
        if _reaches(reason.key, key):
            return _wrong(reason, own)
    if not where:
        return reason
    what = f"the first point makes no question: {reason.key}: {reason.what}"
    return InputError(what, key="vary", found=reason.found, allowed=reason.allowed, file=reason.file)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _without_units(place: Place) -> Place:
    """Return a place in which keys that exclude each other as units do are one."""
    head = "names of keep-outs" if place == ("keep_out",) else place[0]  # which count in a case, not their bodies
    return (head, *(min([item, *excluded(item)]) if isinstance(item, str) else item for item in place[1:]))


def _of_derivation(reason: InputError) -> bool:
    """Tell whether an expression had no value, as it may at one point and not at others."""
    return reason.key == PARAMETERS or (reason.key or "").startswith((f"{PARAMETERS}.", "derive."))


def _telling(values: Sequence[Any]) -> list[int]:
    """Return which of the listed values to check: those that differ in more than finite numbers."""
    first: dict[Any, int] = {}
    for k, value in enumerate(values):
        first.setdefault(_shape(value), k)
    return list(first.values())


def _shape(value: Any) -> Any:
    """Return a value with all floats alike."""
    if isinstance(value, float):
        return float
    return tuple(map(_shape, value)) if isinstance(value, list) else canonical(value)


def _check_target(case: Mapping[str, Any]) -> None:
    """Refuse a target together with what it replaces."""
    given = [key for key in ("target", "requirement", "tolerance") if key in case]
    if given[:1] == ["target"] and len(given) > 1:
        allowed = "target, or requirement and tolerance"
        raise InputError("these keys exclude each other", key="vary", found=" and ".join(given), allowed=allowed)


def _reaches(found: str, key: str) -> bool:
    """Tell whether what is wrong at a place comes from a key."""
    try:
        return overlap(parse(found), parse(key))
    except InputError:
        return False


def _wrong(reason: InputError, where: str) -> InputError:
    """Return an error of a value as one of the study."""
    what = f"no problem takes this: {reason.key}: {reason.what}" if reason.key else reason.what
    return InputError(what, key=where, found=reason.found, allowed=reason.allowed, file=reason.file)
