"""A motion along a ray as a list of elementary operations, which any kind of number can be sent through."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints, frozen
from fcdm_opt.motion.motions import Motion

NAMES = (
    "INPUT", "OUTPUT", "CONST", "ASSIGN", "ADD", "SUB", "MUL", "DIV", "NEG", "TWICE", "SQ", "INV", "SQRT", "SIN", "COS",
    "TAN", "EXP", "ATAN", "TANH",
)  # fmt: skip
(INPUT, OUTPUT, CONST, ASSIGN, ADD, SUB, MUL, DIV, NEG, TWICE, SQ, INV, SQRT, SIN, COS,
 TAN, EXP, ATAN, TANH) = range(len(NAMES))  # fmt: skip
_EXACTLY: dict[int, Callable[[Any, Any], Any]] = {
    ASSIGN: lambda f, g: f, ADD: lambda f, g: f + g, SUB: lambda f, g: f - g, MUL: lambda f, g: f * g,
    DIV: lambda f, g: f / g, NEG: lambda f, g: -f, TWICE: lambda f, g: f + f, SQ: lambda f, g: f * f,
    INV: lambda f, g: 1 / f, SQRT: lambda f, g: f.sqrt(), SIN: lambda f, g: f.sin(), COS: lambda f, g: f.cos(),
    TAN: lambda f, g: f.tan(), EXP: lambda f, g: f.exp(), ATAN: lambda f, g: f.atan(), TANH: lambda f, g: f.tanh(),
}  # fmt: skip
RESULTS = 12


@dataclass(frozen=True, eq=False)
class Operations:
    """What gives R, row by row, and d = s_2 - moved s_1 along a ray, of x, the direction and both seeds.

    Attributes
    ----------
    codes : (n, 4) int array
        Operation, place of its result, and places of its arguments.
    constants : (n,) array
    places : int
    """

    codes: Ints
    constants: Array
    places: int

    @classmethod
    def of(cls, motion: Motion) -> Operations:
        """Return the operations of a motion.

        Raises
        ------
        InputError
            For a motion of the user's own that uses functions without known bounds.
        """
        return _operations(motion)

    def carried_out(self, given: list[Any]) -> list[Any]:
        """Return the results of inputs of any kind that knows arithmetic and has the functions as methods."""
        work: list[Any] = [None] * self.places
        results: list[Any] = [given[0] * 0] * RESULTS
        for (code, place, i, j), constant in zip(self.codes.tolist(), self.constants.tolist(), strict=True):
            if code == INPUT:
                work[place] = given[i]
            elif code == CONST:
                work[place] = given[0] * 0 + constant
            elif code == OUTPUT:
                results[place] = work[i]
            else:
                work[place] = _EXACTLY[code](work[i], work[j])
        return results


@lru_cache(maxsize=64)
def _operations(motion: Motion) -> Operations:
    import casadi

    x, along, seeds = casadi.SX.sym("x"), casadi.SX.sym("along", len(motion.parameters)), casadi.SX.sym("seeds", 6)
    T = casadi.densify(motion.symbolic(x * along, seeds[:3], seeds[3:]))
    offset = seeds[3:] - (T[:3, :3] @ seeds[:3] + T[:3, 3])
    whole = casadi.vertcat(*(T[i, j] for i in range(3) for j in range(3)), offset)
    function = casadi.Function("ray", [x, along, seeds], [whole], {"cse": True})
    codes = np.zeros((function.n_instructions(), 4), dtype=np.int64)
    constants = np.zeros(len(codes))
    starts = (0, 1, 1 + len(motion.parameters))
    known = {getattr(casadi, f"OP_{name}"): code for code, name in enumerate(NAMES)}
    for k in range(len(codes)):
        operation = function.instruction_id(k)
        if operation not in known:
            found = next(key for key in dir(casadi) if key.startswith("OP_") and getattr(casadi, key) == operation)
            raise InputError(
                "what the motion's function uses has no known bounds along a ray",
                key="motion",
                found=found.removeprefix("OP_").lower(),
                allowed=", ".join(name.lower() for name in NAMES[ASSIGN:]),
            )
        code, given, made = known[operation], function.instruction_input(k), function.instruction_output(k)
        if code == INPUT:
            codes[k] = code, made[0], starts[given[0]] + given[1], 0
        elif code == OUTPUT:
            codes[k] = code, made[1], given[0], 0
        elif code == CONST:
            codes[k] = code, made[0], 0, 0
            constants[k] = function.instruction_constant(k)
        else:
            codes[k] = code, made[0], given[0], given[-1]
    return Operations(frozen(codes, np.int64), frozen(constants), function.sz_w())
