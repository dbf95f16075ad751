"""CasADi functions of symbols (SX) as lists of instructions: one table, carried out in any arithmetic.

`Instructions.carried_out` sends any kind of number through a function: an arithmetic maps operations to what is done
with one or two numbers. `SCALARS` serves floats and all that has operators and the functions as methods; proofs
have one of intervals. Kernels carry out the same rows for themselves, with the codes that are named here.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.motion.kinematics import symbols

if TYPE_CHECKING:
    from fcdm_opt.motion.motions import Motion

Arithmetic = Mapping[str, Callable[..., Any]]
"""What each operation does with its operands, by name; "CONST" makes a number of a float, "UNKNOWN" of nothing."""

_COMPILED = (
    "INPUT", "OUTPUT", "CONST", "ASSIGN", "ADD", "SUB", "MUL", "DIV", "NEG", "SQ", "TWICE", "SIN", "COS", "SQRT", "INV",
    "LT", "LE", "NOT", "IF_ELSE_ZERO", "FABS", "FMIN", "FMAX", "EXP", "LOG", "POW", "TAN", "ATAN2", "EQ", "AND", "OR",
    "NE", "SIGN",
)  # fmt: skip
_OTHERS = (
    "ATAN", "TANH", "ASIN", "ACOS", "SINH", "COSH", "ASINH", "ACOSH", "ATANH", "EXPM1", "LOG1P", "FLOOR", "CEIL",
    "UNKNOWN",
)  # fmt: skip
NAMES = _COMPILED + _OTHERS
CODES = {name: code for code, name in enumerate(NAMES)}
COMPILED = len(_COMPILED)  # codes below this have a place in `stages.compiled.run`
(INPUT, OUTPUT, CONST, ASSIGN, ADD, SUB, MUL, DIV, NEG, SQ, TWICE, SIN, COS, SQRT, INV, LT, LE, NOT, IF_ELSE_ZERO, FABS,
 FMIN, FMAX, EXP, LOG, POW, TAN, ATAN2, EQ, AND, OR, NE, SIGN, ATAN, TANH) = range(COMPILED + 2)  # fmt: skip
UNKNOWN = CODES["UNKNOWN"]
BINARY = frozenset((ADD, SUB, MUL, DIV, LT, LE, IF_ELSE_ZERO, FMIN, FMAX, POW, ATAN2, EQ, AND, OR, NE))
POSE = 12  # numbers of a pose: R row by row, and d = s_2 - moved s_1


@dataclass(frozen=True, eq=False)
class Instructions:
    """A CasADi function as instructions."""

    # (n, 4): code, place of the result, places of the operands. Of INPUT the operands are the number of the input and
    # the entry; of OUTPUT the place is the entry, the operands what is given out and the number of the output
    rows: Ints
    constants: Array  # (n,), values of CONST
    places: int  # numbers that are kept at most
    sizes: tuple[int, ...]  # entries of each output
    unknown: tuple[str, ...]  # CasADi's names of operations that the table does not have

    @classmethod
    def of(cls, function: Any) -> Instructions:
        """Return the instructions of a casadi.Function of SX expressions, with dense results."""
        import casadi

        names = {value: name[3:] for name, value in vars(casadi).items() if name.startswith("OP_")}
        rows: list[tuple[int, ...]] = []
        constants: list[float] = []
        unknown: list[str] = []
        for k in range(function.n_instructions()):
            name, given = names[function.instruction_id(k)], function.instruction_input(k)
            made = function.instruction_output(k)
            code = CODES.get("POW" if name == "CONSTPOW" else name, UNKNOWN)
            if code == OUTPUT:
                rows.append((code, made[1], given[0], made[0]))
            elif code == UNKNOWN:
                rows += [(code, place, 0, 0) for place in made]
                unknown.append(name)
            else:
                rows.append((code, made[0], *(*given, 0, 0)[:2]))
            constants += [function.instruction_constant(k) if code == CONST else 0.0] * (len(rows) - len(constants))
        sizes = tuple(function.nnz_out(k) for k in range(function.n_out()))
        table = np.array(rows, dtype=np.int64).reshape(-1, 4)
        return cls(table, np.array(constants), function.sz_w(), sizes, tuple(dict.fromkeys(unknown)))

    @cached_property
    def operations(self) -> tuple[str, ...]:
        """Names of all operations, each once."""
        known = (NAMES[code] for code in self.rows[:, 0].tolist() if code != UNKNOWN)
        return tuple(dict.fromkeys((*known, *self.unknown)))

    @cached_property
    def _steps(self) -> list[tuple[int, str, int, int, int, float]]:
        rows = zip(self.rows.tolist(), self.constants.tolist(), strict=True)
        return [(code, NAMES[code], place, i, j, constant) for (code, place, i, j), constant in rows]

    def carried_out(self, arithmetic: Arithmetic, *inputs: Sequence[Any]) -> list[list[Any]]:
        """Return the output columns for any kind of numbers; `NotImplementedError` for an operation they lack."""
        constant = arithmetic.get("CONST", float)
        work: list[Any] = [None] * self.places
        outputs = [[constant(0.0)] * size for size in self.sizes]
        for code, name, place, i, j, value in self._steps:
            if code == INPUT:
                work[place] = inputs[i][j]
            elif code == OUTPUT:
                outputs[j][place] = work[i]
            elif code == CONST:
                work[place] = constant(value)
            elif name not in arithmetic:
                raise NotImplementedError(f"CasADi operation {name.lower()}")
            elif code == UNKNOWN:
                work[place] = arithmetic[name]()
            elif code in BINARY:
                work[place] = arithmetic[name](work[i], work[j])
            else:
                work[place] = arithmetic[name](work[i])
        return outputs


def _function(name: str) -> Callable[[Any], Any]:
    def called(x: Any) -> Any:
        if hasattr(x, name):
            return getattr(x, name)()
        if isinstance(x, float):
            return getattr(math, name)(x)
        raise NotImplementedError(f"{name} of {type(x).__name__}")

    return called


SCALARS: Arithmetic = {
    "ASSIGN": lambda x: x,
    "ADD": operator.add,
    "SUB": operator.sub,
    "MUL": operator.mul,
    "DIV": operator.truediv,
    "NEG": operator.neg,
    "TWICE": lambda x: 2.0 * x,
    "SQ": lambda x: x * x,
    "INV": lambda x: 1.0 / x,
    **{name.upper(): _function(name) for name in ("sqrt", "sin", "cos", "tan", "exp", "atan", "tanh")},
}
"""Floats, and objects with operators and functions as methods."""


def interpreted(function: Any, values: Sequence[Any]) -> list[Any]:
    """Return what a CasADi function of one vector (SX, dense) gives for `SCALARS`, column by column."""
    return Instructions.of(function).carried_out(SCALARS, values)[0]


@dataclass(frozen=True, eq=False)
class PoseInstructions:
    """A motion's pose and rates as instructions for kernels, with their constants."""

    instructions: Instructions
    short: int  # so many of them, the first, give the pose alone
    numbers: Array  # their second argument is seeds and these, see `Motion.numbers`

    def scaled(self, scale: Array, movable_seed: Array, static_seed: Array) -> tuple[Any, ...]:
        """Return what the kernels take as a motion of z, where q = scale * z."""
        given, table = np.concatenate([movable_seed, static_seed, self.numbers]), self.instructions
        return table.rows, table.constants, np.zeros(table.places), scale, given, self.short


def pose_instructions(motion: Motion) -> PoseInstructions | None:
    """Return the instructions of a motion's pose (R row by row, s_2 - moved s_1) and its derivatives."""
    # None where an operation of a user's own motion has no place in `stages.compiled.run`
    shared = _of_pattern(motion.pattern)
    return None if shared is None else replace(shared, numbers=motion.numbers)


@lru_cache(maxsize=64)
def _of_pattern(pattern: Motion) -> PoseInstructions | None:
    """Return the instructions that motions of a pattern share."""
    import casadi

    q, given, pose = pose_symbols(pattern)
    flat = casadi.densify(casadi.vertcat(pose, casadi.vec(casadi.jacobian(pose, q))))
    table = Instructions.of(casadi.Function("rates", [q, given], [flat], {"cse": True}))
    if (table.rows[:, 0] >= COMPILED).any():
        return None
    short = int(np.flatnonzero((table.rows[:, 0] == OUTPUT) & (table.rows[:, 1] < POSE)).max()) + 1
    return PoseInstructions(table, short, pattern.numbers)


def pose_symbols(pattern: Motion) -> tuple[Any, Any, Any]:
    """Return q and what is given, see `kinematics.symbols`, and R, row by row, with s_2 - moved s_1, of SX."""
    import casadi

    q, given, T = symbols(pattern)
    R, t = T[:3, :3], T[:3, 3]
    return q, given, casadi.densify(casadi.vertcat(casadi.vec(R.T), given[3:6] - (R @ given[:3] + t)))
