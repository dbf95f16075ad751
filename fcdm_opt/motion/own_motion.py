"""Motions that a user writes: a function of the parameters that returns a CasADi matrix."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, get_args

import numpy as np

from fcdm_opt.errors import InputError, known_arguments
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.motion.function_text import TEXTS, OwnFunction, last_line, text_of
from fcdm_opt.motion.instructions import interpreted
from fcdm_opt.motion.motions import Kind, Matrix, Parameter, Step
from fcdm_opt.tolerances import DEFAULT

PROBES = 8  # parameters at which a motion is looked at when it is made
SPREAD = (1e-3, 1.0)  # of these parameters, least and most


@known_arguments
class OwnMotion(OwnFunction, Step):
    """A motion of the user's own, a step like any other.

    No bound of what it displaces is known: searches go by sampled rates, and stages that need such a bound prove
    nothing.

    Parameters
    ----------
    function : callable or casadi.Function
        Called once with a column of SX symbols q, one a parameter; returns the 4x4 pose change of body 1, world frame,
        an expression of q alone: rigid everywhere, the identity at zero, and smooth there.
    parameters : sequence of (name, kind)
        Kind is "translation" (a length) or "rotation" (radians); names are distinct.
    name : str
        In words and messages.

    Raises
    ------
    InputError
        Says what was found and what is allowed.

    Examples
    --------
    >>> import casadi, fcdm_opt as fo
    >>> def ramp(q):  # up a slope of 1 in 10
    ...     T = casadi.SX.eye(4)
    ...     T[0, 3], T[2, 3] = q[0], 0.1 * q[0]
    ...     return T
    >>> motion = fo.OwnMotion(ramp, [("TX", "translation")], name="ramp") >> fo.Rotation("z")
    """

    text_key, text_allowed = "OwnMotion.text", f"the text of another OwnMotion, or {TEXTS}"

    def __init__(
        self, function: Callable[[Any], Any], parameters: Iterable[tuple[str, Kind]], name: str = "own motion"
    ) -> None:
        if not isinstance(name, str) or not name:
            raise InputError("not a name", key="OwnMotion.name", found=name, allowed="a text")
        self.name = name
        self._parameters = _checked_parameters(parameters)
        self.function = _built(function, len(self._parameters))
        self.text, self.given = text_of(self.function), (self._parameters, name)
        _check(self.function, self._parameters)

    def own_plain(self) -> dict[str, Any]:
        """Return the text of its function, its parameters and its name."""
        return {"casadi": self.text, "parameters": [list(one) for one in self.own_parameters], "name": self.name}

    def __repr__(self) -> str:
        return f"OwnMotion({self.name!r}, {[tuple(parameter) for parameter in self._parameters]})"

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        """As given."""
        return self._parameters

    bounded = False  # no bound of its displacements is known
    smooth = False  # the function may jump

    def own_transform(self, q: list[Any], movable_seed: tuple[Any, ...], static_seed: tuple[Any, ...]) -> Matrix:
        """Numbers through the compiled function, CasADi expressions by putting them in, others step by step.

        Raises
        ------
        NotImplementedError
            For scalars of another kind, where the function has operations that are not theirs.
        """
        import casadi

        if all(isinstance(x, float) for x in q):
            column = self._values(q)[0].tolist()
        elif any(isinstance(x, casadi.SX | casadi.MX | casadi.DM) for x in q):
            T = self.function(casadi.vertcat(*q))
            column = [T[k] for k in range(16)]
        else:
            column = interpreted(self.function, q)
        return (*(tuple(column[i::4]) for i in range(3)), (0.0, 0.0, 0.0, 1.0))

    def own_reaches(self, points: Array, seed: Array, turned: bool) -> tuple[float, ...]:
        """No bound is known."""
        return (np.inf,) * len(self._parameters)

    def own_seen_from(self, origin: Array) -> OwnMotion:
        """Take points to the other origin and back."""
        import casadi

        def shifted(q: Any) -> Any:
            T = self.function(q)
            T[:3, 3] += casadi.mtimes(T[:3, :3], origin) - origin
            return T

        return OwnMotion(shifted, self._parameters, self.name)

    def own_words(self, q: list[float], unit: str = "", digits: int = 6) -> str:
        """Name, and parameters in degrees and lengths."""
        return f"{self.name} ({super().own_words(q, unit, digits)})"


def _checked_parameters(parameters: Any) -> tuple[Parameter, ...]:
    kinds = get_args(Kind)
    allowed = 'pairs (name, kind) such as ("TZ", "translation"), ("RZ", "rotation"), each name once'
    try:
        given = [tuple(pair) for pair in parameters]
    except TypeError:
        given = []
    names = [pair[0] for pair in given if len(pair) == 2 and isinstance(pair[0], str) and pair[0]]
    fine = given and len(set(names)) == len(given) and all(pair[1] in kinds for pair in given)
    if not fine:
        raise InputError("unusable parameters", key="OwnMotion.parameters", found=parameters, allowed=allowed)
    return tuple(Parameter(*pair) for pair in given)


def _built(function: Any, count: int) -> Any:
    import casadi

    if not callable(function):
        raise _refused("not a function", function, "a function of q")
    q = casadi.SX.sym("q", count)
    try:
        T = function(q)
    except InputError:
        raise
    except Exception as reason:
        message = f"the function fails on {count} CasADi symbols: {type(reason).__name__}: {last_line(reason)}"
        allowed = "a function of an SX column that returns a 4x4 SX matrix"
        raise _refused(message, getattr(function, "__name__", function), allowed) from reason
    if not isinstance(T, casadi.SX | casadi.DM | np.ndarray) or tuple(T.shape) != (4, 4):
        found = f"{type(T).__name__} {tuple(T.shape)}" if hasattr(T, "shape") else type(T).__name__
        raise _refused("not a 4x4 CasADi matrix", found, "SX (4, 4)")
    try:
        T = casadi.densify(casadi.SX(T))
    except NotImplementedError as reason:  # an array of texts or complex numbers
        raise _refused("not a 4x4 CasADi matrix", f"an array of {T.dtype}", "SX (4, 4)") from reason
    others = {str(x) for x in casadi.symvar(T)} - {str(x) for x in casadi.symvar(q)}
    if others:
        message = "the matrix holds symbols that are no parameters"
        raise _refused(message, ", ".join(sorted(others)), "an expression of q alone")
    return casadi.Function("own_motion", [q], [T], ["q"], ["transform"])


def _check(function: Any, parameters: tuple[Parameter, ...]) -> None:
    """Refuse a function that is no family of rigid motions from the identity on, or not smooth there."""
    import casadi

    count = len(parameters)
    at_rest = np.asarray(function(np.zeros(count)).full())
    if not float(np.abs(at_rest - np.eye(4)).max()) <= DEFAULT.rigid:
        raise _refused("not the identity at zero", at_rest.tolist(), "the 4x4 unit matrix")
    q = casadi.SX.sym("q", count)
    first = casadi.jacobian(casadi.vec(function(q)), q)
    slopes = casadi.Function("slopes", [q], [first, casadi.jacobian(casadi.vec(first), q)])(np.zeros(count))
    if not all(np.isfinite(slope.full()).all() for slope in slopes):
        raise _refused(
            "a derivative at zero is not finite",
            "nan or infinity in the first or second derivatives",
            "an expression that is smooth at zero: no square root or division that vanishes there",
        )
    rng = np.random.default_rng(0)
    for values in rng.uniform(-1.0, 1.0, (PROBES, count)) * np.geomspace(*SPREAD, PROBES)[:, None]:
        T = function(values).full()
        R = T[:3, :3]
        skew = max(np.abs(R @ R.T - np.eye(3)).max(), np.abs(T[3] - [0, 0, 0, 1]).max(), 1.0 - np.linalg.det(R))
        if not (np.isfinite(T).all() and skew <= DEFAULT.rigid):
            where = ", ".join(f"{name} = {x:.6g}" for (name, _), x in zip(parameters, values, strict=True))
            message, found = f"not a rigid motion at {where}", f"a matrix that is off one by {skew:.3g}"
            raise _refused(message, found, "a rotation matrix and a shift, last row 0 0 0 1")


def _refused(message: str, found: Any, allowed: str) -> InputError:
    return InputError(message, key="OwnMotion.function", found=found, allowed=allowed)
