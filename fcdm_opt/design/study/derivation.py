"""Keys of a problem that follow from parameters, by arithmetic over named numbers.

An expression is a text of numbers, names, + - * / **, brackets and the functions below; simpleeval works it out. What
it can reach is only that, and powers are `math.pow`: there are no objects, no loops, no giant numbers.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from keyword import iskeyword
from typing import Any, NoReturn

from fcdm_opt.design.places import Place, written
from fcdm_opt.errors import InputError, closest, known_word, placed
from fcdm_opt.problem.arguments import LARGEST, is_real

FUNCTIONS: dict[str, Callable[..., float]] = {
    name: getattr(math, name)
    for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sqrt", "hypot", "radians", "degrees")
}
FUNCTIONS |= {"min": min, "max": max, "abs": abs}
LEAST = {"hypot": 1, "min": 2, "max": 2}  # numbers that they take, or more; all others take one
CONSTANTS = {"pi": math.pi}
OPERATORS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: math.pow,  # a float, or no value
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
NODES = (ast.Constant, ast.Name, ast.UnaryOp, ast.BinOp, ast.Call)
LONGEST, DEEPEST = 1000, 100  # characters, and nodes below each other
ALLOWED = f"numbers, parameters, + - * / **, brackets, pi, {', '.join(FUNCTIONS)}"


@dataclass(frozen=True)
class Formula:
    """A parsed expression; call it with the values of all `names`, the parameters in it."""

    text: str
    names: frozenset[str]
    tree: ast.expr = field(repr=False, compare=False)

    @classmethod
    def of(cls, text: str, key: str | None = None) -> Formula:
        """Return the expression of a text; raises `InputError` with the key for anything but arithmetic."""
        if len(text) > LONGEST:
            raise InputError("the expression is too long", key=key, found=text, allowed=f"{LONGEST} characters")
        try:
            tree = ast.parse(text.strip(), mode="eval").body
            called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
            for node in ast.walk(tree):
                _check(node, text, key, id(node) in called)
            if _depth(tree) > DEEPEST:
                raise RecursionError
        except (SyntaxError, ValueError) as reason:
            if isinstance(reason, InputError):
                raise
            raise InputError("not an expression", key=key, found=text, allowed=ALLOWED) from reason
        except (RecursionError, MemoryError) as reason:
            raise InputError("the expression is nested too deep", key=key, found=text, allowed=ALLOWED) from reason
        names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and id(node) not in called}
        return cls(text, frozenset(names - set(CONSTANTS)), tree)

    def __call__(self, values: Mapping[str, float]) -> float:
        """Return the value; raises `InputError` where there is none."""
        from simpleeval import InvalidExpression, SimpleEval

        calculator = SimpleEval(operators=OPERATORS, functions=FUNCTIONS, names={**CONSTANTS, **values})
        named = ", ".join(f"{name} = {values[name]:.9g}" for name in sorted(self.names))
        try:
            value = calculator.eval(self.text, previously_parsed=self.tree)
        except (ArithmeticError, ValueError, TypeError, InvalidExpression) as reason:
            what = f"the expression has no value: {reason}{named and f', with {named}'}"
            raise InputError(what, found=self.text) from reason
        if not math.isfinite(value):
            raise InputError("the expression has no finite value", found=self.text)
        return float(value)


def _check(node: ast.AST, text: str, key: str | None, called: bool) -> None:
    """Refuse, before anything is worked out, what is no arithmetic, with a hint at what was meant."""

    def refuse(what: str) -> NoReturn:
        raise InputError(what, key=key, found=text, allowed=ALLOWED)

    if isinstance(node, ast.operator | ast.unaryop):
        if type(node) not in OPERATORS:
            hint = ": powers are written **" if isinstance(node, ast.BitXor) else ""
            refuse(f"no arithmetic: {type(node).__name__}{hint}")
    elif isinstance(node, ast.Constant):
        value: Any = node.value
        if not is_real(value) or not abs(value) <= LARGEST:
            refuse(f"not a number, or one too large: {str(value)[:50]}")
    elif isinstance(node, ast.Name):
        if called and node.id not in FUNCTIONS:
            refuse(f"no such function{closest(node.id, FUNCTIONS)}")
        if not called and node.id in FUNCTIONS:
            refuse(f"{node.id} is a function: {node.id}(...)")
    elif isinstance(node, ast.Call):
        if not isinstance(node.func, ast.Name):
            refuse("no such function")
        least = LEAST.get(node.func.id)
        if node.keywords or (len(node.args) != 1 if least is None else len(node.args) < least):
            refuse(f"{node.func.id} takes {'one number' if least is None else f'{least} numbers or more'}")
    elif not isinstance(node, (*NODES, ast.expr_context)):
        refuse(f"no arithmetic: {type(node).__name__}")


def _depth(node: ast.AST) -> int:
    return 1 + max(map(_depth, ast.iter_child_nodes(node)), default=0)


@dataclass(frozen=True)
class Derivation:
    """Keys of a problem that follow from parameters.

    `numbers` are the parameters that are numbers (a point may have others), `steps` those that are expressions, in an
    order in which each can be worked out; `values` is what is derived: lists and tables with a `Formula` for each text.
    """

    numbers: Mapping[str, float]
    steps: tuple[tuple[str, Formula], ...]
    values: Mapping[str, Any]

    @classmethod
    def of(cls, parameters: Mapping[str, Any], derive: Mapping[str, Any], varied: set[str]) -> Derivation:
        """Return the derivation; raises `InputError` for unknown, cyclic and unused parameters.

        Texts in `derive`, at any depth, are expressions; `{ text = "..." }` is a text. Of the parameters in `varied`
        points have values.
        """
        numbers: dict[str, float] = {}
        formulas: dict[str, Formula] = {}
        for name, value in parameters.items():
            key = f"parameters.{name}"
            if not name.isidentifier() or iskeyword(name):
                raise InputError("not a name for a parameter", key=key, found=name, allowed="letters, digits and _")
            if name in FUNCTIONS or name in CONSTANTS:
                raise InputError("this name has a meaning in expressions", key=key, found=name, allowed="another name")
            if isinstance(value, str):
                formulas[name] = Formula.of(value, key)
            elif not is_real(value) or not abs(value) <= LARGEST:
                raise InputError("wrong value", key=key, found=value, allowed="a finite number or an expression")
            else:
                numbers[name] = float(value)
        used = [(f"parameters.{name}", formula) for name, formula in formulas.items()]

        def kept(value: Any, place: Place) -> Any:
            if not isinstance(value, str):
                return value
            used.append((written(place), Formula.of(value, written(place))))
            return used[-1][1]

        values = {place: _each_leaf(value, ("derive", f"'{place}'"), kept) for place, value in derive.items()}
        for key, formula in used:
            for name in sorted(formula.names - parameters.keys()):
                what = f"no such parameter '{name}'{closest(name, [*parameters, *FUNCTIONS])}"
                raise InputError(what, key=key, found=formula.text, allowed=", ".join(parameters) or "none is given")
        for name in sorted(varied - numbers.keys()):
            key = f"parameters.{name}"
            if name in formulas:
                raise InputError("it follows from others and cannot vary", key=key, found=formulas[name].text)
            known_word(name, numbers, "no such parameter", key=key)
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
            with placed(key=written(place)):
                return leaf(known)

        for name, formula in self.steps:
            known[name] = worked_out(formula, ("parameters", name))
        return {place: _each_leaf(tree, ("derive", f"'{place}'"), worked_out) for place, tree in self.values.items()}


def _each_leaf(tree: Any, place: Place, made: Callable[[Any, Place], Any]) -> Any:
    """Return lists and tables with something else in place of each leaf, which is given with its place."""
    if isinstance(tree, Mapping):
        if list(tree) == ["text"] and isinstance(tree["text"], str):
            return tree["text"]
        return {key: _each_leaf(item, (*place, key), made) for key, item in tree.items()}
    if isinstance(tree, list | tuple):
        return [_each_leaf(item, (*place, k), made) for k, item in enumerate(tree)]
    return made(tree, place)
