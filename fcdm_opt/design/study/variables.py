"""What varies in a study: keys of a problem, and what they take: listed values, grids, joint draws.

Other keys follow from parameters, by arithmetic over named numbers. An expression is a text of numbers, names,
+ - * / **, brackets and the functions below; simpleeval works it out. What it can reach is only that, and powers are
`math.pow`: there are no objects, no loops, no giant numbers.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from keyword import iskeyword
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from fcdm_opt.design.distributions import Distribution, Measured, Normal, Uniform, read_columns
from fcdm_opt.design.places import Place, parse, written
from fcdm_opt.design.question import canonical, located, plain_value
from fcdm_opt.errors import InputError, closest, known_word, placed
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.problem.arguments import LARGEST, is_real, items, real

MOST = 10_000_000  # draws, and numbers of a grid: they are held in memory, 8 bytes each
PARAMETERS = "parameters"  # head of the places that are names of a study's own
_ONE_KEY = "one key; keys that follow from one number: a parameter and [derive]"


@dataclass(frozen=True, eq=False)
class Variable:
    """Keys of a problem that vary together, and what they take.

    `keys` are places, see `fcdm_opt.design.places`; `values` are listed, one a point, lists of one a key where there
    are several, or what is drawn from. `label` is the column in the results, by default the keys; `names` stand for
    listed values in the results, by default these themselves. `where` is how errors name it, and `listed` its values.
    """

    keys: tuple[str, ...]
    values: Any
    label: str = ""
    names: tuple[str, ...] = ()
    where: str = ""
    listed: str = ""

    def __post_init__(self) -> None:
        keys = tuple(self.keys) if isinstance(self.keys, list | tuple) else (self.keys,)
        where = self.where or f"vary[{keys[0] if len(keys) == 1 else keys!r}]"
        label, listed = self.label or ", ".join(map(str, keys)), self.listed or where
        self.__dict__.update(keys=keys, label=label, where=where, listed=listed, names=tuple(self.names))
        if not keys:
            raise InputError("no key", key=where, allowed="one key or more")
        for k, key in enumerate(keys, 1):
            with placed(key=f"{where}.key" + (f"[{k}]" if len(keys) > 1 else "")):
                parse(key if isinstance(key, str) else f" {key!r}")
        if not isinstance(self.label, str):
            raise InputError("not a text", key=f"{where}.label", found=self.label, allowed="a text")
        if not isinstance(self.values, Distribution):
            self.__dict__["values"] = self._checked_values()
        elif len(keys) > 1:
            raise InputError("numbers are drawn for one key", key=where, found=", ".join(keys), allowed=_ONE_KEY)
        names = self.names
        texts = all(isinstance(name, str) and name for name in names)
        if names and (self.drawn or len(names) != len(self.values) or not texts or len(set(names)) != len(names)):
            allowed = "listed values" if self.drawn else f"{len(self.values)} texts, one a value and all different"
            raise InputError("the names do not fit the values", key=f"{where}.names", found=names, allowed=allowed)

    def _checked_values(self) -> tuple[Any, ...]:
        allowed = "a list with at least one value, or Uniform, Normal, Measured"
        values = items(self.values) if not isinstance(self.values, range) else list(self.values)
        if not values:
            raise InputError("no values", key=self.listed, found=self.values, allowed=allowed)
        if len(self.keys) == 1 and all(type(value) is float and math.isfinite(value) for value in values):
            return tuple(values)
        return tuple(self._plain(value, f"{self.listed}[{k}]") for k, value in enumerate(values, 1))

    def _plain(self, value: Any, key: str) -> Any:
        try:
            plain = plain_value(value)
            canonical(plain)
        except InputError as reason:
            raise reason.within(key=key) from reason
        except RecursionError as reason:  # a list in itself
            raise InputError("nested too deep", key=key, allowed="plain data") from reason
        if len(self.keys) > 1 and (not isinstance(plain, list) or len(plain) != len(self.keys)):
            allowed = f"a list of {len(self.keys)}: {', '.join(self.keys)}"
            raise InputError("not one value a key", key=key, found=value, allowed=allowed)
        for own, item in self.at(plain).items():
            if parse(own)[0] == PARAMETERS and not (is_real(item) and abs(item) <= LARGEST):
                raise InputError(f"{own} is no number", key=key, found=item, allowed="a finite number")
        return plain

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """The keys as places."""
        return tuple(map(parse, self.keys))

    @property
    def drawn(self) -> bool:
        """Whether values are drawn rather than listed."""
        return isinstance(self.values, Distribution)

    @property
    def axis(self) -> tuple[Any, ...]:
        """What stands for each listed value in the results; values of several keys are tuples."""
        if self.names or len(self.keys) == 1:
            return self.names or self.values
        return tuple(map(tuple, self.values))

    def at(self, value: Any) -> dict[str, Any]:
        """Return the value of each key for one of the values."""
        return {self.keys[0]: value} if len(self.keys) == 1 else dict(zip(self.keys, value, strict=True))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        values = self.values.to_dict() if self.drawn else {"values": list(self.values)}
        return {"key": list(self.keys), "label": self.label, "names": list(self.names), **values}


def variable_of(entry: Any, where: str, folder: Path) -> Variable:
    """Return the variable of a [[vary]] table; `folder` is where paths in it start."""
    keys = (entry.key,) if isinstance(entry.key, str) else tuple(entry.key)
    try:
        source, values = _values(entry, keys, folder)
        return Variable(keys, values, entry.label or "", entry.names or (), where, f"{where}.{source}")
    except InputError as reason:
        if reason.file is not None or (reason.key or "").startswith(where):
            raise
        raise reason.within(key=where) from reason


def _values(entry: Any, keys: tuple[str, ...], folder: Path) -> tuple[str, Any]:
    """Return in which way the values of a [[vary]] table are given, and the values."""
    if entry.values is not None:
        return "values", entry.values
    if entry.grid is not None:
        if len(keys) > 1:
            raise InputError("a grid is of one key", key="grid", found=", ".join(keys), allowed=_ONE_KEY)
        with placed(key="grid"):
            numbers = grid(getattr(entry.grid, "from"), entry.grid.to, entry.grid.count, entry.grid.spacing)
        return "grid", numbers
    if entry.uniform is not None:
        return "uniform", Uniform(**dict(entry.uniform))
    if entry.normal is not None:
        return "normal", Normal(**dict(entry.normal))
    csv = entry.csv
    path = located(csv.file, folder)
    if csv.column is not None:
        return "csv", Measured.from_csv(path, csv.column, 1.0 if csv.nominal is None else csv.nominal)
    if len(csv.columns) != len(keys):
        raise InputError("not one column a key", key="csv.columns", found=csv.columns, allowed=f"{len(keys)} names")
    rows = read_columns(path, csv.columns, csv.nominals).tolist()
    return "csv", rows if len(keys) > 1 else [row[0] for row in rows]


def shares(sampling: str, count: int, dimensions: int, *, seed: int) -> Array:
    """Return points of the unit cube, (dimensions, count), the same for the same seed.

    "latin hypercube": in each dimension every interval [k / count, (k + 1) / count] has one point, and which ones
    meet is left to chance; numpy alone keeps the draws the same through all versions of scipy. "random": independent.
    """
    rng = np.random.default_rng(seed)
    within = rng.random((dimensions, count))
    if sampling == "random":
        return within
    return (rng.permuted(np.tile(np.arange(count), (dimensions, 1)), axis=1) + within) / count


def grid(start: float, stop: float, count: int, spacing: str = "linear") -> tuple[float, ...]:
    """Return evenly spaced numbers, with both ends exactly as given; for "log" of equal ratios.

    Raises `InputError` that names the key of a grid: from, to, count.
    """
    for key, end in (("from", start), ("to", stop)):
        real(end, key, "a finite number")
    if count > MOST:
        raise InputError("too many numbers", key="count", found=count, allowed=f"at most {MOST}")
    if spacing == "log" and start <= 0:
        raise InputError("a ratio needs numbers > 0", key="from", found=start, allowed="> 0, or linear spacing")
    if count == 1 and start != stop:
        raise InputError("one number cannot be both", key="count", found=f"{start} and {stop}", allowed="from = to")
    if count > 1 and not start < stop:
        raise InputError("empty range", key="to", found=f"{start} to {stop}", allowed="from < to")
    made = (np.geomspace if spacing == "log" else np.linspace)(start, stop, count)
    return (start, *made[1:-1].tolist(), stop)[:count] if count > 1 else (start,)


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
        unused = parameters.keys() - {name for _, formula in used for name in formula.names}
        if unused:
            name = min(unused, key=list(parameters).index)
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
