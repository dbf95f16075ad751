"""One contact as a linear program, through CasADi: by IPOPT, and by two of its solvers of conic programs.

Of the conic plugins in CasADi's wheels clp and ipqp are taken. qrqp, daqp and osqp mostly end without an answer to a
program without curvature, proxqp and superscs take a hundred times as long, fatrop and hpipm want the structure of
optimal control, qpoases prints its licence past any redirection, and highs is HiGHS (see `programs`) built anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import TextIOBase
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fcdm_opt.errors import FcdmError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt_benchmarks.contacts.programs import ContactProgram, gain
from fcdm_opt_benchmarks.library import library
from fcdm_opt_benchmarks.method import Ask, ContactAnswer, ContactQuestion, Method, Pair, one_by_one, settings
from fcdm_opt_benchmarks.placed import Placed, answered, up_to

BUFFERED = 1  # the memory of a function's first buffer: 0 is that of its plain calls


def ipopt(pair: Pair, setting: float) -> Ask:
    """Solve the program (see `programs`) as a nonlinear one with IPOPT: R, d and rho_1 are parameters."""
    casadi = library("casadi")
    placed = Placed.of(pair)
    program = ContactProgram(placed)
    p, y = casadi.MX.sym("p", 13), casadi.MX.sym("y", 7)
    R, d, n, m, t = casadi.reshape(p[:9], 3, 3), p[9:12], y[:3], y[3:6], y[6]
    P, Q = (casadi.DM(own.vertices) for own in (placed.one, placed.two))
    nlp = {"x": y, "p": p, "f": p[12] * t - casadi.dot(d, m), "g": casadi.vertcat(R @ n - m, P @ n - t, -Q @ m)}
    options = {
        "ipopt.tol": setting,
        "ipopt.acceptable_iter": 0,  # by default it calls 1e-6 a success too, after some steps
        "ipopt.bound_relax_factor": 0.0,  # by default bounds are moved by 1e-8, and the answer with them
        "ipopt.jac_c_constant": "yes",
        "ipopt.jac_d_constant": "yes",
        "ipopt.hessian_constant": "yes",
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "print_time": False,
        "error_on_fail": True,
    }
    solver = _Buffered(casadi.nlpsol("contact", "ipopt", nlp, options), "f")
    free = np.full(7, np.inf)
    solver.set(x0=np.zeros(7), lbx=-free, ubx=free, lbg=np.where(_equal(program), 0.0, -np.inf), ubg=program.upper)
    parameters = solver.set(p=np.zeros(13))["p"]

    def answer(question: ContactQuestion) -> ContactAnswer:
        R, d = placed.pose(question.transform)
        parameters[:9], parameters[9:12], parameters[12] = R.ravel("F"), d, question.rho1
        return answered(-solver("IPOPT", "return_status"))

    return one_by_one(answer)


def clp(pair: Pair, setting: float) -> Ask:
    """Solve the dual with Clp."""
    return _conic(pair, "clp", {"clp": {"PrimalTolerance": setting, "DualTolerance": setting}})


def ipqp(pair: Pair, setting: float) -> Ask:
    """Solve the dual with CasADi's own interior point method."""
    quiet = {"print_header": False, "print_iter": False, "print_info": False}
    return _conic(pair, "ipqp", {"constr_viol_tol": setting, "dual_inf_tol": setting, **quiet})


def _conic(pair: Pair, plugin: str, options: dict[str, Any]) -> Ask:
    casadi = library("casadi")
    placed = Placed.of(pair)
    program = ContactProgram(placed)
    count = len(program.matrix)
    starts, indices, values = program.compressed(program.matrix.T)
    pattern = {"a": casadi.Sparsity(7, count, starts.tolist(), indices.tolist()), "h": casadi.Sparsity(count, count)}
    made = casadi.conic("contact", plugin, pattern, {"error_on_fail": True, **options})
    solver = _Buffered(made, "cost")
    solver.set(g=program.upper, lbx=np.where(_equal(program), -np.inf, 0.0), ubx=np.full(count, np.inf))
    given = solver.set(a=values, lba=np.zeros(7), uba=np.zeros(7))
    turned = np.add.outer(starts[:3], np.arange(3)).ravel()  # the places of R, row by row

    def answer(question: ContactQuestion) -> ContactAnswer:
        R, d = placed.pose(question.transform)
        given["a"][turned] = R.ravel()
        given["lba"][:] = given["uba"][:] = gain(d, question.rho1)
        return answered(solver(plugin, "return_status"))

    ask, nowhere = one_by_one(answer), _Nowhere()

    def quiet(questions: Sequence[Any]) -> list[Any]:
        with redirect_stdout(nowhere), redirect_stderr(nowhere):  # Clp prints each solution, ipqp its warnings
            return ask(questions)

    return quiet


def _equal(program: ContactProgram) -> NDArray[np.bool_]:
    """Return which of the program's rows are equations."""
    return np.arange(len(program.matrix)) < 3


class _Nowhere(TextIOBase):
    """Takes what is printed, and forgets it."""

    def write(self, text: str) -> int:
        return len(text)


class _Buffered:
    """A solver of CasADi that reads its arguments from arrays: a call costs a microsecond instead of fifteen."""

    def __init__(self, function: Any, wanted: str) -> None:
        self._function = function
        self._buffer, self._trigger = function.buffer()
        self._given: dict[str, Array] = {}
        self._found = np.zeros(1)
        self._buffer.set_res(function.name_out().index(wanted), self._found.data)

    def set(self, **given: Array) -> dict[str, Array]:
        """Set arguments by copies of arrays, and return these: what is written into them is what the solver reads."""
        made = {name: np.array(value, dtype=np.float64) for name, value in given.items()}
        self._given |= made  # the buffer keeps no reference
        for name, value in made.items():
            self._buffer.set_arg(self._function.name_in().index(name), value.data)
        return made

    def __call__(self, name: str, status: str) -> float:
        """Solve and return the cost; raise `FcdmError` with the solver's own word where it reports no success."""
        try:
            self._trigger()
        except RuntimeError as reason:
            raise FcdmError(f"{name}: {self._function.stats(BUFFERED).get(status, reason)}") from reason
        return float(self._found[0])


SLOW, LOST = up_to(5000, "over a second an answer"), up_to(1000, "no answer in its iterations")
METHODS = (
    Method("CasADi IPOPT", "CasADi", settings("1e-4", "1e-8", "1e-12"), ipopt, SLOW),
    Method("CasADi clp", "CasADi", settings("1e-4", "1e-7", "1e-10"), clp),
    Method("CasADi ipqp", "CasADi", settings("1e-8"), ipqp, LOST),
)
