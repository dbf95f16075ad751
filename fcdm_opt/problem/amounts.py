"""Amounts of motion: the weighted one, the largest displacement of a vertex, or an expression of the user's own."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.motion.function_text import TEXTS, OwnFunction, last_line, text_of
from fcdm_opt.motion.kinematics import Compiled

AmountWord = Literal["weighted", "displacement"]
ALLOWED = (
    '"weighted", "displacement", or a CasADi expression >= 0 of symbols named like the parameters, or a '
    "casadi.Function of their vector"
)
PROBES, SPREAD = 8, (1e-3, 1.0)  # motions at which an amount is looked at when it is made


class OwnAmount(OwnFunction):
    """A motion amount of the user's own: a number >= 0 for each motion.

    The expression, a `casadi.SX`, is of scalar symbols that bear the names of motion parameters (lengths and radians),
    or a `casadi.Function` of the vector of all parameters; `names` are the motion's parameters, in order. An
    `InputError` where it is no scalar, not finite at rest, negative, or has other symbols.
    """

    text_key, text_allowed = "amount.casadi", f"{ALLOWED}; as text {TEXTS}"

    def __init__(self, expression: Any, names: Sequence[str]) -> None:
        self.names, self.given = tuple(names), (tuple(names),)
        self.function = _built(expression, list(names))
        self.text = text_of(self.function)
        at_rest = self(np.zeros(len(names)))
        if not np.isfinite(at_rest):
            raise _refused("not finite at rest", at_rest)
        probes = np.random.default_rng(0).uniform(-1.0, 1.0, (PROBES, len(names)))
        least = min(at_rest, *map(self, probes * np.geomspace(*SPREAD, PROBES)[:, None]))
        if least < 0:
            raise _refused("negative for some motions", least)

    def __call__(self, q: Sequence[float] | Array) -> float:
        """Return the amount of a motion."""
        return float(self._values(q)[0][0])

    @cached_property
    def is_smooth_at_rest(self) -> bool:
        """Whether the first two derivatives at rest are finite, which those of a norm are not."""
        return bool(np.isfinite(self._derived[1](np.zeros(len(self.names)))[0]).all())

    @cached_property
    def weights_at_rest(self) -> Array:
        """Weights, (k,), with which the weighted amount grows like this one from rest; nan where it does not curve."""
        with np.errstate(invalid="ignore"):
            return np.sqrt(np.diag(self.derivatives(np.zeros(len(self.names)))[:, :-1]) / 2.0)

    def derivatives(self, q: Array) -> Array:
        """Return Hessian and, as last column, gradient after a motion, (k, k + 1); of the square where not smooth."""
        return self._derived[1 if self.is_smooth_at_rest else 2](q)[0].reshape(-1, len(self.names)).T.copy()

    def gradient(self, q: Array) -> Array:
        """Return the gradient after a motion, (k,)."""
        return self._derived[1](q)[0][-len(self.names) :].copy()

    @cached_property
    def _derived(self) -> dict[int, Compiled]:
        """The same of powers of the amount."""
        import casadi

        q = casadi.SX.sym("q", len(self.names))
        found = {power: casadi.horzcat(*casadi.hessian(self.function(q) ** power, q)) for power in (1, 2)}
        made = {power: casadi.Function("derivatives", [q], [casadi.densify(own)]) for power, own in found.items()}
        return {power: Compiled(own) for power, own in made.items()}

    def __repr__(self) -> str:
        import casadi

        q = casadi.vertcat(*map(casadi.SX.sym, self.names))
        return f"OwnAmount({str(self.function(q))[:200]})"


def amount(value: Any, names: Sequence[str]) -> str | OwnAmount:
    """Return a checked amount: a word, or an `OwnAmount` of an expression or function."""
    if isinstance(value, str):
        if value in get_args(AmountWord):
            return value
        raise _refused("unknown amount", value)
    if isinstance(value, OwnAmount):
        if value.names != tuple(names):
            raise _refused("the amount is of another motion's parameters", f"one of {', '.join(value.names)}")
        return value
    return OwnAmount(value, names)


def _built(expression: Any, names: list[str]) -> Any:
    """Return the CasADi function (k,) -> dense scalar."""
    import casadi

    q = casadi.SX.sym("q", len(names))
    if isinstance(expression, casadi.Function):
        inputs = [expression.size_in(k) for k in range(expression.n_in())]
        outputs = [expression.size_out(k) for k in range(expression.n_out())]
        if inputs != [(len(names), 1)] or len(outputs) != 1:
            found = f"inputs of shapes {inputs}, outputs {outputs}"
            raise _refused(f"not a function of the {len(names)} parameters {', '.join(names)}", found)
        try:
            value = expression(q)
        except Exception as reason:
            raise _refused(f"the function takes no SX symbols: {last_line(reason)}", str(expression)) from reason
    elif isinstance(expression, casadi.SX):
        symbols = casadi.symvar(expression)
        unknown = [str(x) for x in symbols if str(x) not in names]
        if unknown:
            raise _refused(f"no such parameter of the motion, which has {', '.join(names)}", ", ".join(unknown))
        places = casadi.vertcat(*(q[names.index(str(x))] for x in symbols))
        value = casadi.substitute(expression, casadi.vertcat(*symbols), places)
    else:
        raise _refused("unknown amount", type(expression).__name__)
    if tuple(value.shape) != (1, 1):
        raise _refused("not a scalar", f"shape {tuple(value.shape)}")
    return casadi.Function("amount", [q], [casadi.densify(casadi.SX(value))], ["q"], ["amount"])


def _refused(what: str, found: Any, key: str = "amount") -> InputError:
    return InputError(what, key=key, found=found, allowed=ALLOWED)
