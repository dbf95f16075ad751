"""Arithmetic over named numbers, for keys of a problem that follow from parameters.

An expression is a text of numbers, names, + - * / **, brackets and the functions below; simpleeval works it out. What
it can reach is only that, and powers are `math.pow`: there are no objects, no loops, no giant numbers.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NoReturn

from fcdm_opt.errors import InputError
from fcdm_opt.problem.arguments import LARGEST, is_real
from fcdm_opt.problem.schema import closest

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
    """A parsed expression; call it with the values of all names.

    Attributes
    ----------
    text : str
    names : frozenset of str
        The parameters in it.
    """

    text: str
    names: frozenset[str]
    tree: ast.expr = field(repr=False, compare=False)

    @classmethod
    def of(cls, text: str) -> Formula:
        """Return the expression of a text; raises `InputError` for anything but arithmetic."""
        if len(text) > LONGEST:
            raise InputError("the expression is too long", found=text, allowed=f"{LONGEST} characters")
        try:
            tree = ast.parse(text.strip(), mode="eval").body
            called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
            for node in ast.walk(tree):
                _check(node, text, id(node) in called)
            if _depth(tree) > DEEPEST:
                raise RecursionError
        except (SyntaxError, ValueError) as reason:
            if isinstance(reason, InputError):
                raise
            raise InputError("not an expression", found=text, allowed=ALLOWED) from reason
        except (RecursionError, MemoryError) as reason:
            raise InputError("the expression is nested too deep", found=text, allowed=ALLOWED) from reason
        names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and id(node) not in called}
        return cls(text, frozenset(names - set(CONSTANTS)), tree)

    def __call__(self, values: Mapping[str, float]) -> float:
        """Return the value; raises `InputError` where there is none."""
        from simpleeval import InvalidExpression

        calculator = _calculator()
        calculator.names = {**CONSTANTS, **values}
        named = ", ".join(f"{name} = {values[name]:.9g}" for name in sorted(self.names))
        try:
            value = calculator.eval(self.text, previously_parsed=self.tree)
        except (ArithmeticError, ValueError, TypeError, InvalidExpression) as reason:
            what = f"the expression has no value: {reason}{named and f', with {named}'}"
            raise InputError(what, found=self.text) from reason
        if not math.isfinite(value):
            raise InputError("the expression has no finite value", found=self.text)
        return float(value)


@cache
def _calculator() -> Any:
    """Return what works expressions out; it knows nothing but the nodes, operators and functions above."""
    from simpleeval import SimpleEval

    calculator = SimpleEval(operators=OPERATORS, functions=FUNCTIONS)
    calculator.nodes = {kind: own for kind, own in calculator.nodes.items() if kind in NODES}
    return calculator


def _check(node: ast.AST, text: str, called: bool) -> None:
    """Refuse, before anything is worked out, what is no arithmetic, with a hint at what was meant."""

    def refuse(what: str) -> NoReturn:
        raise InputError(what, found=text, allowed=ALLOWED)

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
