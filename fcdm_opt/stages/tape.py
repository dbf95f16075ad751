"""A motion's pose and rates as the instructions of its CasADi function, which kernels run for themselves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.motion.motions import Motion
from fcdm_opt.stages.compiled import CODES

POSE = 12  # numbers of a pose


@dataclass(frozen=True, eq=False)
class Tape:
    """A motion's pose and rates as instructions: (operation, result, operand, operand), and their constants.

    The first `short` of them give the pose alone. Their second argument is seeds and `numbers`, see `Motion.numbers`.
    """

    instructions: Ints
    constants: Array
    places: int
    short: int
    numbers: Array

    def scaled(self, scale: Array, movable_seed: Array, static_seed: Array) -> tuple[Any, ...]:
        """Return what the kernels take as a motion of z, where q = scale * z."""
        given = np.concatenate([movable_seed, static_seed, self.numbers])
        return self.instructions, self.constants, np.zeros(self.places), scale, given, self.short


def tape(motion: Motion) -> Tape | None:
    """Return the instructions of a motion's pose (R row by row, s_2 - moved s_1) and its derivatives.

    None where an operation of a user's own motion has no place in `compiled.run`.
    """
    found = _of_pattern(motion.pattern)
    return None if found is None else replace(found, numbers=motion.numbers)


@lru_cache(maxsize=64)
def _of_pattern(pattern: Motion) -> Tape | None:
    """Return the instructions that motions of a pattern share."""
    import casadi

    count = len(pattern.numbers)
    q, given = casadi.SX.sym("q", len(pattern.parameters)), casadi.SX.sym("given", 6 + count)
    seeds, motion = given[:6], pattern.with_numbers([given[6 + k] for k in range(count)])
    T = motion.symbolic(q, seeds[:3], seeds[3:])
    R, t = T[:3, :3], T[:3, 3]
    pose = casadi.vertcat(casadi.vec(R.T), seeds[3:] - (R @ seeds[:3] + t))
    flat = casadi.densify(casadi.vertcat(pose, casadi.vec(casadi.jacobian(pose, q))))
    function = casadi.Function("rates", [q, given], [flat], {"cse": True})
    codes = {getattr(casadi, f"OP_{name}"): code for name, code in CODES.items()}
    rows: list[tuple[int, ...]] = []
    constants: list[float] = []
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        if operation not in codes:
            return None
        code, result, operands = codes[operation], function.instruction_output(k), function.instruction_input(k)
        if code == CODES["OUTPUT"]:
            rows.append((code, result[1], operands[0], 0))
        else:
            rows.append((code, result[0], *(*operands, 0, 0)[:2]))
        constants.append(function.instruction_constant(k) if code == CODES["CONST"] else 0.0)
    table = np.array(rows, dtype=np.int64)
    short = int(np.flatnonzero((table[:, 0] == CODES["OUTPUT"]) & (table[:, 1] < POSE)).max()) + 1
    return Tape(table, np.array(constants), function.sz_w(), short, pattern.numbers)
