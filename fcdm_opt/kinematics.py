"""Compiled motions: poses of body 1 and how fast they change, for the loops that ask for thousands."""

from __future__ import annotations

import math
import operator
import threading
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array

CHUNK = 64  # poses worked out in one call
FEW = 8  # fewer are worked out one by one


class Compiled(threading.local):
    """A CasADi function with dense results, called on plain arrays: about 1 us a call instead of 15.

    Each thread has buffers of its own.

    Parameters
    ----------
    function : casadi.Function
    fixed : arrays
        Arguments after the first, the same at every call.
    """

    def __init__(self, function: Any, *fixed: Array) -> None:
        self._buffer, self._evaluate = function.buffer()
        self._first = np.zeros(function.nnz_in(0))
        self._given = (self._first, *(np.array(values, dtype=np.float64) for values in fixed))
        self._results = tuple(np.zeros(function.nnz_out(k)) for k in range(function.n_out()))
        for k, values in enumerate(self._given):
            self._buffer.set_arg(k, values.data)
        for k, values in enumerate(self._results):
            self._buffer.set_res(k, values.data)

    def __call__(self, first: Sequence[float] | Array) -> tuple[Array, ...]:
        """Return the results, each flat and column by column; they are overwritten by this thread's next call."""
        self._first[:] = first
        self._evaluate()
        return self._results


def interpreted(function: Any, values: Sequence[Any]) -> list[Any]:
    """Return what a CasADi function of one vector gives for scalars of any kind, column by column.

    Parameters
    ----------
    function : casadi.Function
        Of SX expressions, with a dense result.
    values : sequence
        Numbers, or objects with +, -, *, / and the methods sin, cos and sqrt.

    Raises
    ------
    NotImplementedError
        For other operations.
    """
    import casadi

    def called(name: str) -> Callable[[Any], Any]:
        return lambda x: getattr(math, name)(x) if isinstance(x, float) else getattr(x, name)()

    unary: dict[int, Callable[[Any], Any]] = {
        casadi.OP_ASSIGN: lambda x: x,
        casadi.OP_NEG: lambda x: -x,
        casadi.OP_SQ: lambda x: x * x,
        casadi.OP_TWICE: lambda x: 2.0 * x,
        casadi.OP_INV: lambda x: 1.0 / x,
        casadi.OP_SIN: called("sin"),
        casadi.OP_COS: called("cos"),
        casadi.OP_SQRT: called("sqrt"),
    }
    binary = {
        casadi.OP_ADD: operator.add,
        casadi.OP_SUB: operator.sub,
        casadi.OP_MUL: operator.mul,
        casadi.OP_DIV: operator.truediv,
    }
    work: dict[int, Any] = {}
    results: list[Any] = [0.0] * function.nnz_out(0)
    for k in range(function.n_instructions()):
        operation, places = function.instruction_id(k), function.instruction_output(k)
        if operation == casadi.OP_CONST:
            work[places[0]] = float(function.instruction_constant(k))
            continue
        given = function.instruction_input(k)
        if operation == casadi.OP_INPUT:
            work[places[0]] = values[given[1]]
        elif operation == casadi.OP_OUTPUT:
            results[places[1]] = work[given[0]]
        elif operation in unary:
            work[places[0]] = unary[operation](work[given[0]])
        elif operation in binary:
            work[places[0]] = binary[operation](work[given[0]], work[given[1]])
        else:
            raise NotImplementedError(f"CasADi operation {operation}")
    return results


class Kinematics:
    """Poses and rates of a motion for two given seeds; made by `Motion.kinematics`.

    Where a screw between the seeds has lost its axis, poses are not finite: nothing is checked here.

    Parameters
    ----------
    q, seeds : (k,), (6,) SX
        Symbols of the parameters and of s_1, s_2 as drawn.
    transform : (4, 4) SX
        Pose change of body 1, an expression of both.
    values : (6,) array
        The seeds.
    """

    def __init__(self, q: Any, seeds: Any, transform: Any, values: Array) -> None:
        import casadi

        # column by column, as CasADi stores matrices, the transposed is the pose row by row
        rows = casadi.vec(casadi.densify(transform).T)
        rates = casadi.densify(casadi.jacobian(rows, q))
        self._count, self._values = q.shape[0], values
        self._pose = casadi.Function("pose", [q, seeds], [rows], ["q", "seeds"], ["pose"], {"cse": True})
        self._transform = Compiled(self._pose, values)
        self._rates = Compiled(
            casadi.Function("rates", [q, seeds], [rows, rates], ["q", "seeds"], ["pose", "rates"], {"cse": True}),
            values,
        )

    def transform(self, q: Sequence[float] | Array) -> Array:
        """Return the 4x4 transform of body 1 at parameters q, (k,)."""
        return self._transform(q)[0].reshape(4, 4).copy()

    def rates(self, q: Sequence[float] | Array) -> tuple[Array, Array]:
        """Return (transform (4, 4), its derivatives by each parameter (k, 4, 4)) at q."""
        pose, rates = self._rates(q)
        return pose.reshape(4, 4).copy(), rates.reshape(self._count, 4, 4).copy()

    def transforms(self, Q: Array) -> Array:
        """Return the transforms, (n, 4, 4), at parameters Q, (n, k)."""
        rows = np.asarray(Q, dtype=np.float64).reshape(-1, self._count)
        poses = np.empty((len(rows), 4, 4))
        whole = len(rows) - len(rows) % CHUNK
        for start in range(0, whole, CHUNK):
            poses[start : start + CHUNK] = self._chunk(rows[start : start + CHUNK].ravel())[0].reshape(CHUNK, 4, 4)
        if len(rows) - whole > FEW:  # the rest of the chunk is for nothing
            padded = np.zeros((CHUNK, self._count))
            padded[: len(rows) - whole] = rows[whole:]
            poses[whole:] = self._chunk(padded.ravel())[0].reshape(CHUNK, 4, 4)[: len(rows) - whole]
        else:
            for k in range(whole, len(rows)):
                poses[k] = self._transform(rows[k])[0].reshape(4, 4)
        return poses

    @cached_property
    def _chunk(self) -> Compiled:
        return Compiled(self._pose.map("poses", "serial", CHUNK, [1], []), self._values)
