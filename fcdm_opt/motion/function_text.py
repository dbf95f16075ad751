"""CasADi functions as texts, read without CasADi's own reader: nothing that a text names is loaded, compiled or run.

`casadi.Function.deserialize` makes whatever a text asks for: it loads shared libraries, plugins of solvers and results
of compilers. Texts are of functions of SX symbols here, lists of operations with one or two numbers, and the function
is built anew from these.

A text is in JSON: name, length of the one argument, shape of the result, and the operations: name, place of the result,
places of what it takes. Read as well is what `serialize()` gives of such a function: two letters a to p a byte, the
lower half first; numbers in little-endian order; lists with their length before them; symbols, operations and matrices
at their first use ("d"), then by their number ("r").
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar, Self, TypeVar

from fcdm_opt.errors import InputError
from fcdm_opt.motion.kinematics import Compiled

T = TypeVar("T")

TWO = (
    "ADD", "SUB", "MUL", "DIV", "POW", "CONSTPOW", "LT", "LE", "EQ", "NE", "AND", "OR", "FMOD", "COPYSIGN",
    "IF_ELSE_ZERO", "FMIN", "FMAX", "ATAN2", "HYPOT", "REMAINDER",
)  # fmt: skip
ONE = (
    "ASSIGN", "NEG", "EXP", "LOG", "SQRT", "SQ", "TWICE", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "NOT", "FLOOR",
    "CEIL", "FABS", "SIGN", "ERF", "ERFINV", "INV", "SINH", "COSH", "TANH", "ASINH", "ACOSH", "ATANH", "LOG1P", "EXPM1",
)  # fmt: skip
CHECK, PROTOCOL = 123456789012345, 3  # first two numbers of CasADi's texts
NEWEST, NEWEST_SX = 9, 4  # known forms of what all functions have, and of those of SX: CasADi 3.7 and 3.8
TEXTS = "serialize() of a casadi.Function of SX symbols (of MX: of its expand())"
MOST = 1000  # numbers that a function takes
CONSTANTS = {"0": 0.0, "1": 1.0, "m": -1.0, "F": float("inf"), "f": float("-inf"), "n": float("nan")}


def text_of(function: Any) -> str:
    """Return the text of a casadi.Function of one SX vector with one dense result."""
    names, operations = _names(), list[list[Any]]()
    for k in range(function.n_instructions()):
        name, given = names[function.instruction_id(k)], function.instruction_input(k)
        made = function.instruction_output(k)
        if name == "CONST":
            given = [function.instruction_constant(k)]
        elif name in ("INPUT", "OUTPUT"):
            given, made = (given[1:], made) if name == "INPUT" else (given, made[1:])
        operations.append([name, *made, *(given[:1] if name in ONE else given)])
    return json.dumps([function.name(), function.size1_in(0), function.size_out(0), operations], separators=(",", ":"))


def function_of(text: str) -> Any:
    """Return the casadi.Function of SX symbols of which a text is, built anew.

    Raises `ValueError` for any other text: of functions of MX symbols (give `function.expand()`), of those that call
    others, that are compiled or come from a library, and of a release of CasADi whose form is not known.
    """
    try:
        return _built(*json.loads(text)) if text[:1] == "[" else _Reader(text).function()
    except (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, struct.error) as reason:
        raise ValueError(f"not as such texts are: {type(reason).__name__} {reason}".strip().split("\n")[0]) from reason


class OwnFunction:
    """Base of what a user writes as a function: equal, and pickled, by its text and what else it was made from."""

    function: Any
    text: str
    given: tuple[Any, ...]  # what it was made from besides
    text_key: ClassVar[str]
    text_allowed: ClassVar[str]

    @classmethod
    def from_text(cls, text: str, *given: Any) -> Self:
        """Return what has this `text`, bit for bit."""
        try:
            function = function_of(text)
        except ValueError as reason:
            what = "not the text of a CasADi function"
            raise InputError(what, key=cls.text_key, found=last_line(reason), allowed=cls.text_allowed) from reason
        made = cls(function, *given)  # type: ignore[call-arg]
        made.function, made.text = function, text
        return made

    @cached_property
    def _values(self) -> Compiled:
        return Compiled(self.function)

    def __reduce__(self) -> Any:
        return type(self).from_text, (self.text, *self.given)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and (self.text, self.given) == (other.text, other.given)

    def __hash__(self) -> int:
        return hash((self.text, self.given))


def last_line(reason: BaseException) -> str:
    """Return the last line of what an error of CasADi says, which is long."""
    return str(reason).strip().split("\n")[-1][:200]


def _names() -> dict[int, str]:
    """Return the names of operations that may be in a text, by CasADi's codes."""
    import casadi

    return {getattr(casadi, f"OP_{name}"): name for name in (*ONE, *TWO, "CONST", "PARAMETER", "INPUT", "OUTPUT")}


def _built(name: str, count: int, shape: list[int], operations: list[list[Any]]) -> Any:
    import casadi

    if not (0 < count <= MOST and math.prod(shape) == sum(row[0] == "OUTPUT" for row in operations)):
        raise ValueError(f"{count} numbers taken, and a result {shape} of which operations give another part")
    q, made, places = casadi.SX.sym("q", count), casadi.SX.zeros(*shape), dict[int, Any]()
    for operation, place, *given in operations:
        if operation == "OUTPUT":
            made[place] = places[given[0]]
        elif operation == "INPUT":
            places[place] = q[given[0]]
        elif operation == "CONST":
            places[place] = casadi.SX(float(given[0]))
        else:
            places[place] = _applied(operation, *(places[k] for k in given))
    return casadi.Function(name, [q], [made])


def _applied(name: str | None, *given: Any) -> Any:
    """Return what an operation makes of expressions."""
    import casadi

    if len(given) == 1 and name in ONE:
        return casadi.SX.unary(getattr(casadi, f"OP_{name}"), *given)
    if len(given) == 2 and name in TWO:
        return casadi.SX.binary(getattr(casadi, f"OP_{name}"), *given)
    raise ValueError(f"operation {name!r} of {len(given)} numbers")


class _Reader:
    """A text, read from its beginning on; what is no function of SX symbols alone is refused where it begins."""

    def __init__(self, text: str) -> None:
        import casadi

        if len(text) % 2 or not set(text) <= set("abcdefghijklmnop"):
            raise ValueError("not pairs of the letters a to p")
        halves = [ord(letter) - ord("a") for letter in text]
        self._bytes, self._at = bytes(low + 16 * high for low, high in zip(halves[::2], halves[1::2], strict=True)), 0
        self._casadi, self._names, self._shared = casadi, _names(), list[Any]()

    def function(self) -> Any:
        self._is("first number", self._long(), CHECK)
        self._is("protocol", self._long(), PROTOCOL)
        self._is("with descriptions", self._flag(), False)
        self._is("empty function", self._flag(), False)
        self._is("class of the function", self._text(), "SXFunction")
        name, taken, returned = self._common()
        self._is("form of expressions", self._int(), 1)
        given = self._list(self._matrix)
        self._program()
        made = self._list(self._matrix)
        self._is("bytes that are left", len(self._bytes) - self._at, 0)
        return self._casadi.Function(name, given, made, taken, returned)

    def _common(self) -> tuple[str, list[str], list[str]]:
        """Read what all functions have: return the name, and those of inputs and outputs."""
        settled = self._int() >= 2
        name = self._text()
        self._flags(5 if settled else 3)
        form = self._int()
        if not 1 <= form <= NEWEST:
            raise ValueError(f"form {form} of functions, of another release of CasADi: known are 1 to {NEWEST}")
        for read in (self._flag, self._flag, self._sparsity, self._sparsity):
            self._list(read)
        taken, returned = self._list(self._text), self._list(self._text)
        self._is("compiled", self._flag(), False)
        self._flag()
        if form >= 2:
            self._is("way of compiling", self._text(), "source")
        self._flag()
        self._text()
        for _ in range(2 if form >= 9 else 1):
            self._nothing("options of compiling")
        self._text()
        self._flag()
        if form >= 6:
            self._nothing("functions beside")
        self._no_function()
        self._doubles(1)
        self._flags(8)
        self._doubles(2)
        self._flags(2)
        self._long()
        self._flags(2 if form < 3 else 1)
        self._doubles(1)
        self._text()
        self._flags(3 if form >= 7 else 2)
        if form >= 4:
            self._long()
        self._flags(2)
        for _ in range(2):
            self._text()
        for _ in range(4 if form >= 5 else 2):
            self._nothing("options of derivatives")
        self._no_function()
        if form >= 8:
            self._nothing("functions beside")
        for _ in range(8):
            self._long()
        return name, taken, returned

    def _program(self) -> None:
        """Read the operations, in an order in which each has its operands before it; what they are given follows."""
        form, count = self._int(), self._long()
        if not 1 <= form <= NEWEST_SX:
            raise ValueError(f"form {form} of SX functions, of another release of CasADi")
        self._long()
        self._nothing("symbols that are no input")
        self._list(self._element)
        self._list(self._element)
        self._list(lambda: self._doubles(1))
        if form >= 2:
            for _ in range(6):
                self._long()
            self._nothing("calls of functions")
            self._list(self._flag)
        self._take(f"<{4 * count}i")
        self._flags(max(form - 1, 1))

    # ------------------------------------------------------------------------------------------------------- numbers

    def _take(self, form: str) -> tuple[Any, ...]:
        found = struct.unpack_from(form, self._bytes, self._at)
        self._at += struct.calcsize(form)
        return found

    def _long(self) -> int:
        return int(self._take("<q")[0])

    def _int(self) -> int:
        return int(self._take("<i")[0])

    def _doubles(self, count: int) -> tuple[float, ...]:
        return self._take(f"<{count}d")

    def _flag(self) -> bool:
        return bool(self._take("<b")[0])

    def _flags(self, count: int) -> None:
        self._take(f"<{count}b")

    def _letter(self) -> str:
        return chr(self._take("<B")[0])

    def _text(self) -> str:
        return str(self._take(f"<{self._int()}s")[0].decode())

    def _list(self, read: Callable[[], T]) -> list[T]:
        length = self._long()
        if not 0 <= length <= len(self._bytes):
            raise ValueError(f"a list of {length}")
        return [read() for _ in range(length)]

    # ------------------------------------------------------------------------------------------------- what is refused

    def _is(self, what: str, found: Any, allowed: Any) -> None:
        if found != allowed:
            raise ValueError(f"{what}: {found}, where only {allowed} is read")

    def _nothing(self, what: str) -> None:
        self._is(f"number of {what}", self._long(), 0)

    def _no_function(self) -> None:
        """Read a place for a function, which must be empty."""
        self._is("another function", self._of_shared(lambda: None if self._flag() else "one"), None)

    # ----------------------------------------------------------------------------------------------------- expressions

    def _of_shared(self, read: Callable[[], Any]) -> Any:
        """Read what stands at its first use in full, and then by its number."""
        if self._letter() == "r":
            number = self._long()
            self._is("number of a use", 0 <= number < len(self._shared), True)
            return self._shared[number]
        found = read()
        self._shared.append(found)
        return found

    def _sparsity(self) -> Any:
        return self._of_shared(self._new_sparsity)

    def _new_sparsity(self) -> Any:
        """Read a sparsity; of one with more entries than the text has bytes there would be more symbols."""
        numbers = self._list(self._long)
        self._is("size of a matrix is known", 0 <= math.prod(numbers[:2]) <= len(self._bytes), True)
        return self._casadi.Sparsity.compressed(numbers)

    def _matrix(self) -> Any:
        return self._casadi.SX(self._sparsity(), self._casadi.vertcat(*self._list(self._element)))

    def _element(self) -> Any:
        return self._of_shared(self._new_element)

    def _new_element(self) -> Any:
        """Read a number, a symbol or an operation."""
        SX, name = self._casadi.SX, self._names.get(self._long())
        if name == "PARAMETER":
            return SX.sym(self._text())
        if name == "CONST":
            kind = self._letter()
            return SX(self._doubles(1)[0] if kind == "r" else self._int() if kind == "i" else CONSTANTS[kind])
        return _applied(name, *(self._element() for _ in range(2 if name in TWO else 1)))
