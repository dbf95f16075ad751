"""Compiled motions: poses of body 1 and how fast they change, for the loops that ask for thousands."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array

CHUNK = 64  # poses worked out in one call


class Compiled(threading.local):
    """A CasADi function with dense results, called on plain arrays: about 1 us a call instead of 15.

    Each thread has buffers of its own.

    `fixed`: its last arguments, the same at every call.
    """

    def __init__(self, function: Any, *fixed: Array) -> None:
        self._buffer, self._evaluate = function.buffer()
        self._first = [np.zeros(function.nnz_in(k)) for k in range(function.n_in() - len(fixed))]
        self._given = (*self._first, *(np.array(values, dtype=np.float64) for values in fixed))
        self._results = tuple(np.zeros(function.nnz_out(k)) for k in range(function.n_out()))
        for k, values in enumerate(self._given):
            self._buffer.set_arg(k, values.data)
        for k, values in enumerate(self._results):
            self._buffer.set_res(k, values.data)

    def __call__(self, *given: Sequence[float] | Array) -> tuple[Array, ...]:
        """Return the results, each flat and column by column; they are overwritten by this thread's next call."""
        for room, values in zip(self._first, given, strict=True):
            room[:] = values
        self._evaluate()
        return self._results


def symbols(pattern: Any) -> tuple[Any, Any, Any]:
    """Return q, what is given (s_1 and s_2 as drawn, numbers) and the transform, of SX, of the motions of a pattern."""
    import casadi

    q, given = casadi.SX.sym("q", len(pattern.parameters)), casadi.SX.sym("given", 6 + len(pattern.numbers))
    motion = pattern.with_numbers([given[6 + k] for k in range(len(pattern.numbers))])
    return q, given, motion.symbolic(q, given[:3], given[3:6])


class _Pattern:
    """Functions (q, given) of the motions of one pattern."""

    def __init__(self, pattern: Any) -> None:
        import casadi

        self._q, self._given, transform = symbols(pattern)
        # column by column, as CasADi stores matrices, the transposed is the pose row by row
        self._rows = casadi.vec(casadi.densify(transform).T)

    def _function(self, **results: Any) -> Any:
        import casadi

        inputs, names = [self._q, self._given], ["q", "given"]
        return casadi.Function("motion", inputs, list(results.values()), names, list(results), {"cse": True})

    @cached_property
    def pose(self) -> Compiled:
        return Compiled(self._function(pose=self._rows))

    @cached_property
    def rates(self) -> Compiled:
        import casadi

        return Compiled(self._function(pose=self._rows, rates=casadi.densify(casadi.jacobian(self._rows, self._q))))

    @cached_property
    def poses(self) -> Compiled:
        return Compiled(self._function(pose=self._rows).map("poses", "serial", CHUNK, [1], []))


@lru_cache(maxsize=64)
def _compiled(pattern: Any) -> _Pattern:
    return _Pattern(pattern)


class Kinematics:
    """Poses and rates of a motion for two given seeds; made by `Motion.kinematics`.

    Where a screw between the seeds has lost its axis, poses are not finite: nothing is checked here.

    `seeds` (6,): s_1 and s_2 as drawn.
    """

    def __init__(self, motion: Any, seeds: Array) -> None:
        self._compiled, self._count = _compiled(motion.pattern), len(motion.parameters)
        self._given = np.concatenate([seeds, motion.numbers])

    def transform(self, q: Sequence[float] | Array) -> Array:
        """Return the 4x4 transform of body 1 at parameters q, (k,)."""
        return self._compiled.pose(q, self._given)[0].reshape(4, 4).copy()

    def rates(self, q: Sequence[float] | Array) -> tuple[Array, Array]:
        """Return (transform (4, 4), its derivatives by each parameter (k, 4, 4)) at q."""
        pose, rates = self._compiled.rates(q, self._given)
        return pose.reshape(4, 4).copy(), rates.reshape(self._count, 4, 4).copy()

    def transforms(self, Q: Array) -> Array:
        """Return the transforms, (n, 4, 4), at parameters Q, (n, k)."""
        rows = np.asarray(Q, dtype=np.float64).reshape(-1, self._count)
        padded = np.zeros((-(-len(rows) // CHUNK), CHUNK * self._count))
        padded.reshape(-1, self._count)[: len(rows)] = rows
        poses = np.array([self._compiled.poses(chunk, self._given)[0].copy() for chunk in padded])
        return poses.reshape(-1, 4, 4)[: len(rows)]
