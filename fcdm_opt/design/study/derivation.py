"""Keys of a problem that follow from parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from keyword import iskeyword
from typing import Any

from fcdm_opt.design.places import Place, written
from fcdm_opt.design.study.expressions import CONSTANTS, FUNCTIONS, Formula
from fcdm_opt.errors import InputError
from fcdm_opt.problem.arguments import LARGEST, is_real
from fcdm_opt.problem.schema import closest


@dataclass(frozen=True)
class Derivation:
    """Keys of a problem that follow from parameters.

    Attributes
    ----------
    numbers : mapping
        The parameters that are numbers; a point may have others.
    steps : tuple of (name, Formula)
        The parameters that are expressions, in an order in which each can be worked out.
    values : mapping of place to tree
        What is derived: lists and tables, with an `Formula` for each text.
    """

    numbers: Mapping[str, float]
    steps: tuple[tuple[str, Formula], ...]
    values: Mapping[str, Any]

    @classmethod
    def of(cls, parameters: Mapping[str, Any], derive: Mapping[str, Any], varied: set[str]) -> Derivation:
        """Return the derivation; raises `InputError` for unknown, cyclic and unused parameters.

        Parameters
        ----------
        parameters : mapping of name to number or expression
        derive : mapping of place to value
            Texts in it, at any depth, are expressions; `{ text = "..." }` is a text.
        varied : set of str
            Names of the parameters that points have values for.
        """
        numbers: dict[str, float] = {}
        formulas: dict[str, Formula] = {}
        for name, value in parameters.items():
            key = f"parameters.{name}"
            _check_name(name, key)
            if isinstance(value, str):
                formulas[name] = _expression(value, key)
            elif not is_real(value) or not abs(value) <= LARGEST:
                raise InputError("wrong value", key=key, found=value, allowed="a finite number or an expression")
            else:
                numbers[name] = float(value)
        used = [(f"parameters.{name}", formula) for name, formula in formulas.items()]

        def kept(value: Any, place: Place) -> Any:
            if not isinstance(value, str):
                return value
            used.append((written(place), _expression(value, written(place))))
            return used[-1][1]

        values = {place: _each_leaf(value, (f"derive.'{place}'",), kept) for place, value in derive.items()}
        for key, formula in used:
            for name in sorted(formula.names - parameters.keys()):
                what = f"no such parameter '{name}'{closest(name, [*parameters, *FUNCTIONS])}"
                raise InputError(what, key=key, found=formula.text, allowed=", ".join(parameters) or "none is given")
        for name in sorted(varied - numbers.keys()):
            key = f"parameters.{name}"
            if name in formulas:
                raise InputError("it follows from others and cannot vary", key=key, found=formulas[name].text)
            what = f"no such parameter{closest(name, numbers)}"
            raise InputError(what, key=key, found=name, allowed=", ".join(numbers) or "none is given")
        spare = parameters.keys() - {name for _, formula in used for name in formula.names}
        if spare:
            name = min(spare, key=list(parameters).index)
            raise InputError("nothing uses this parameter", key=f"parameters.{name}", allowed="an expression with it")
        try:
            graph = {name: formula.names for name, formula in formulas.items()}
            order = [name for name in TopologicalSorter(graph).static_order() if name in formulas]
        except CycleError as reason:
            cycle = " -> ".join(reversed(reason.args[1]))
            raise InputError("parameters follow from each other in a circle", key="parameters", found=cycle) from None
        return cls(numbers, tuple((name, formulas[name]) for name in order), values)

    def at(self, given: Mapping[str, float]) -> dict[str, Any]:
        """Return the derived values by place; raises `InputError` where an expression has none."""
        known = {**self.numbers, **given}

        def worked_out(leaf: Any, place: Place) -> Any:
            if not isinstance(leaf, Formula):
                return leaf
            try:
                return leaf(known)
            except InputError as reason:
                raise reason.within(key=written(place)) from reason

        for name, formula in self.steps:
            known[name] = worked_out(formula, ("parameters", name))
        return {place: _each_leaf(tree, (f"derive.'{place}'",), worked_out) for place, tree in self.values.items()}


def _check_name(name: str, key: str) -> None:
    if not name.isidentifier() or iskeyword(name):
        raise InputError("not a name for a parameter", key=key, found=name, allowed="letters, digits and _")
    if name in FUNCTIONS or name in CONSTANTS:
        raise InputError("this name has a meaning in expressions", key=key, found=name, allowed="another name")


def _expression(text: str, key: str) -> Formula:
    try:
        return Formula.of(text)
    except InputError as reason:
        raise reason.within(key=key) from reason


def _each_leaf(tree: Any, place: Place, made: Callable[[Any, Place], Any]) -> Any:
    """Return lists and tables with something else in place of each leaf, which is given with its place."""
    if isinstance(tree, Mapping):
        if list(tree) == ["text"] and isinstance(tree["text"], str):
            return tree["text"]
        return {key: _each_leaf(item, (*place, key), made) for key, item in tree.items()}
    if isinstance(tree, list | tuple):
        return [_each_leaf(item, (*place, k), made) for k, item in enumerate(tree)]
    return made(tree, place)
