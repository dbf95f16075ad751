"""What a study refuses before anything is solved."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import combinations
from typing import Any

from fcdm_opt.design.places import Place, overlap, parse
from fcdm_opt.design.question import Question, canonical, excluded
from fcdm_opt.design.study.variables import PARAMETERS, Variable
from fcdm_opt.errors import InputError, placed
from fcdm_opt.problem.keys import Defaults

Ask = Callable[[Question, Mapping[Variable, int]], Question]

RESERVED = ("case", "draw", "number", "key")  # columns that every table of results may have
MOST_POINTS = 10**12  # more than any run will see the end of
_NO_DEFAULTS = Defaults()


def check_keys(variables: Sequence[Variable], derived: Iterable[str]) -> None:
    """Refuse keys and labels that are given twice, and keys of which one lies inside another."""
    given = _places(variables, derived)
    for where, key in given:
        with placed(key=where):
            place = parse(key)
        if where.startswith("derive") and place[0] == PARAMETERS:
            allowed = f"the expression itself as a value in {PARAMETERS}"
            raise InputError("a parameter is not derived", key=where, found=key, allowed=allowed)
        if place[0] == PARAMETERS and not (len(place) == 2 and isinstance(place[1], str)):
            raise InputError("not a parameter", key=where, found=key, allowed=f"{PARAMETERS}.name")
        if place[0] == "name":
            raise InputError("the name of a case does not vary", key=where, found=key, allowed="other keys")
    for (one, first), (two, second) in combinations(given, 2):
        if overlap(_without_units(parse(first)), _without_units(parse(second))):
            what = "a key is given twice" if first == second else "two keys say the same"
            raise InputError(what, key=two, found=f"{second}, and {first} in {one}", allowed="each key once")
    names: dict[str, str] = {}
    for variable in variables:
        label, where = variable.label, f"{variable.where}.label"
        if label in RESERVED:
            raise InputError("this label has a meaning in tables", key=where, found=label, allowed="another label")
        if names.setdefault(label, variable.where) != variable.where:
            raise InputError(
                f"the label is that of {names[label]}", key=where, found=label, allowed="a label of its own"
            )


def check_draws(variables: Sequence[Variable], count: int | None, points: int) -> None:
    """Refuse distributions without a number of draws and the other way round, and points without end."""
    drawn = [variable for variable in variables if variable.drawn]
    if drawn and count is None:
        raise InputError(
            "how many numbers to draw?", key="count", found=f"none, with a distribution in {drawn[0].where}",
            allowed="a whole number >= 1",
        )  # fmt: skip
    if count is not None and not drawn:
        allowed = "no count, or a variable with a distribution"
        raise InputError("nothing is drawn", key="count", found=count, allowed=allowed)
    if points > MOST_POINTS:
        raise InputError("too many points", key="vary", found=points, allowed=f"at most {MOST_POINTS}")


def check_values(variables: Sequence[Variable], derived: Iterable[str], asked: Ask, base: Question) -> None:
    """Refuse keys and listed values that make no question from `base`, whatever the others are.

    `derived` are the keys that follow from parameters, `asked` gives the question where each variable takes its k-th
    value.
    """
    first = dict.fromkeys(variables, 0)
    try:
        question = asked(base, first)
        question.check().arguments(_NO_DEFAULTS)
        question.drawn()
    except InputError as reason:
        raise _placed(reason, _places(variables, derived)) from reason
    given = [key for key in ("target", "requirement", "tolerance") if key in question.case]
    if given[:1] == ["target"] and len(given) > 1:
        allowed = "target, or requirement and tolerance"
        raise InputError("these keys exclude each other", key="vary", found=" and ".join(given), allowed=allowed)
    for variable in variables:
        for k in [] if variable.drawn else _telling(variable.values):
            try:
                asked(base, {**first, variable: k}).check()
            except InputError as reason:
                if not _of_derivation(reason):
                    raise _wrong(reason, f"{variable.listed}[{k + 1}]") from reason


def _places(variables: Sequence[Variable], derived: Iterable[str]) -> list[tuple[str, str]]:
    """Return where each key is given, and the key."""
    varied = [(variable.where, key) for variable in variables for key in variable.keys]
    return varied + [(f"derive.'{key}'", key) for key in derived]


def _placed(reason: InputError, places: list[tuple[str, str]]) -> InputError:
    """Return what is wrong with the first point as an error of the variable or derived key that it comes from."""
    if reason.key is None or _of_derivation(reason) or not places:
        return reason
    for where, key in places:
        with suppress(InputError):  # some keys of errors are no places
            if overlap(parse(reason.key), parse(key)):
                return _wrong(reason, where)
    what = f"the first point makes no question: {reason.key}: {reason.what}"
    return InputError(what, key="vary", found=reason.found, allowed=reason.allowed, file=reason.file)


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


def _wrong(reason: InputError, where: str) -> InputError:
    """Return an error of a value as one of the study."""
    what = f"no problem takes this: {reason.key}: {reason.what}" if reason.key else reason.what
    return InputError(what, key=where, found=reason.found, allowed=reason.allowed, file=reason.file)
