"""General solvers on a program in formulas, each as its makers set it up: what they claim, in plain data.

An answer is {"x": [...]}, {"none": why} where the solver claims that there is no x, or {"flag": why}.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.library import dense, highs_model, highs_solver

Answer = dict[str, Any]
Rows = Callable[[Any, Mapping[str, Any], Any], tuple[Any, list[Any], list[Any]]]
ITERATIONS = 200


@dataclass(frozen=True)
class Statement:
    """Least f(x) with e(x) = 0, g(x) >= 0 and low <= x <= high.

    Attributes
    ----------
    rows : callable
        (x, numbers, module with sin, cos ...) -> (f, e, g): a number and two lists.
    numbers : mapping
    start : list of float
    low, high : lists of float or None
    """

    rows: Rows
    numbers: Mapping[str, Any]
    start: list[float]
    low: list[float | None]
    high: list[float | None]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of x, infinite where there are none."""
        low, high = ([end if x is None else x for x in own] for own, end in ((self.low, -np.inf), (self.high, np.inf)))
        return np.array(low), np.array(high)

    @cached_property
    def symbols(self) -> tuple[Any, Any, Any, Any, Any]:
        """CasADi's x, f(x), (e(x), g(x)) as a column, and the column's bounds."""
        import casadi

        x = casadi.SX.sym("x", len(self.start))
        f, e, g = self.rows(x, self.numbers, casadi)
        return x, f, casadi.vertcat(*e, *g), np.zeros(len(e) + len(g)), np.array([0.0] * len(e) + [np.inf] * len(g))

    @cached_property
    def derivatives(self) -> tuple[Any, Any, Any, Any]:
        """Functions of an array: f, its gradient, the column and its Jacobian."""
        import casadi

        x, f, rows, _, _ = self.symbols
        made = (f, casadi.gradient(f, x), rows, casadi.jacobian(rows, x))
        functions = [casadi.Function("made", [x], [casadi.densify(own)]) for own in made]

        def value(k: int, at: Array) -> Any:
            found = np.asarray(functions[k](at).full())
            return float(found[0, 0]) if k == 0 else found if k == 3 else found.ravel()

        return tuple(partial(value, k) for k in range(4))  # type: ignore[return-value]

    @cached_property
    def quadratic(self) -> tuple[Array, Array, Array, Array, Array]:
        """Of a quadratic program its P, l, A and low, high: least x P x / 2 + l x with low <= A x <= high."""
        import casadi

        x, f, rows, low, high = self.symbols
        P, linear = casadi.hessian(f, x)
        at = casadi.Function("at", [x], [P, linear, casadi.jacobian(rows, x), rows])(np.zeros(len(self.start)))
        P, linear, A, constant = (np.asarray(own.full()) for own in at)
        return P, linear.ravel(), A, low - constant.ravel(), high - constant.ravel()


def _claimed(x: Any, fine: bool, said: str) -> Answer:
    """Return the x that a solver stands by."""
    return {"x": np.asarray(x, dtype=np.float64).ravel().tolist()} if fine else {"flag": said}


def nonlinear(name: str, options: Mapping[str, Any], statement: Statement) -> Answer:
    """Ask one of CasADi's solvers of nonlinear programs."""
    import casadi

    x, f, rows, low, high = statement.symbols
    solver = casadi.nlpsol("solver", name, {"x": x, "f": f, "g": rows}, {"print_time": False, **options})
    bounds = statement.bounds
    made = solver(x0=statement.start, lbx=bounds[0], ubx=bounds[1], lbg=low, ubg=high)
    stats = solver.stats()
    return _claimed(made["x"].full(), stats["success"], str(stats["return_status"]))


def scipy(method: str, options: Mapping[str, Any], statement: Statement) -> Answer:
    """Ask one of scipy's solvers with constraints, with exact derivatives."""
    import warnings

    from scipy.optimize import BFGS, Bounds, NonlinearConstraint, minimize

    f, gradient, rows, jacobian = statement.derivatives
    _, _, _, low, high = statement.symbols
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # of quasi-Newton updates and of programs without a second derivative
        made = minimize(
            f,
            np.array(statement.start),
            jac=gradient,
            method=method,
            bounds=Bounds(*statement.bounds),
            constraints=[NonlinearConstraint(rows, low, high, jac=jacobian, hess=BFGS())],
            options=dict(options),
        )
    return _claimed(made.x, bool(made.success), str(made.message))


def highs(options: Mapping[str, Any], statement: Statement) -> Answer:
    """Ask HiGHS, a solver of linear and quadratic programs."""
    import highspy

    P, linear, A, low, high = statement.quadratic
    model, count = highspy.HighsModel(), len(linear)
    model.lp_ = highs_model(dense(A), linear, (low, high), statement.bounds)
    hessian = model.hessian_
    hessian.dim_, hessian.format_ = count, highspy.HessianFormat.kTriangular
    hessian.start_, hessian.index_, hessian.value_ = np.arange(count + 1), np.arange(count), np.diag(P)
    solver = highs_solver(**options)
    solver.passModel(model)
    solver.run()
    status = solver.getModelStatus()
    said = solver.modelStatusToString(status)
    if status == highspy.HighsModelStatus.kInfeasible:
        return {"none": said}
    return _claimed(solver.getSolution().col_value, status == highspy.HighsModelStatus.kOptimal, said)


def clarabel(options: Mapping[str, Any], statement: Statement) -> Answer:
    """Ask Clarabel, an interior point solver of quadratic and cone programs."""
    import clarabel as solver  # type: ignore[import-untyped]
    from scipy.sparse import csc_matrix

    P, linear, A, low, high = statement.quadratic
    everything = np.vstack([A, np.eye(len(linear))])
    low, high = (np.concatenate(own) for own in zip((low, high), statement.bounds, strict=True))
    equal = low == high
    above, below = ~equal & np.isfinite(low), ~equal & np.isfinite(high)
    matrix = csc_matrix(np.vstack([everything[equal], -everything[above], everything[below]]))
    bound = np.concatenate([low[equal], -low[above], high[below]])
    cones = [solver.ZeroConeT(int(equal.sum())), solver.NonnegativeConeT(int(above.sum() + below.sum()))]
    settings = solver.DefaultSettings()
    settings.verbose = False
    for key, value in options.items():
        setattr(settings, key, value)
    made = solver.DefaultSolver(csc_matrix(P), linear, matrix, bound, cones, settings).solve()
    said = str(made.status)
    return {"none": said} if said == "PrimalInfeasible" else _claimed(made.x, said == "Solved", said)


def osqp(options: Mapping[str, Any], statement: Statement) -> Answer:
    """Ask OSQP, a first-order solver of quadratic programs, through CasADi."""
    import casadi

    x, f, rows, low, high = statement.symbols
    quiet: dict[str, Any] = {"print_time": False, "error_on_fail": False, "osqp": {"verbose": False, **options}}
    solver = casadi.qpsol("solver", "osqp", {"x": x, "f": f, "g": rows}, quiet)
    bounds = statement.bounds
    made = solver(x0=statement.start, lbx=bounds[0], ubx=bounds[1], lbg=low, ubg=high)
    said = str(solver.stats()["return_status"])
    return {"none": said} if said == "primal infeasible" else _claimed(made["x"].full(), said == "solved", said)


TIGHT = 1e-12  # as tight as most of them go
IPOPT = {"print_level": 0, "sb": "yes", "max_iter": ITERATIONS}
SILENT = dict.fromkeys(("print_header", "print_iteration", "print_status", "error_on_fail"), False)
INNER = dict.fromkeys(("print_header", "print_iter", "print_info", "error_on_fail"), False)
NONLINEAR: dict[str, Callable[[Statement], Answer]] = {
    "IPOPT": partial(nonlinear, "ipopt", {"ipopt": IPOPT}),
    "IPOPT, tight": partial(nonlinear, "ipopt", {"ipopt": {**IPOPT, "tol": TIGHT, "constr_viol_tol": TIGHT,
                                                           "compl_inf_tol": TIGHT, "bound_relax_factor": 0.0}}),
    "CasADi SQP": partial(nonlinear, "sqpmethod", {**SILENT, "max_iter": ITERATIONS, "tol_pr": DEFAULT.cut,
                                                   "tol_du": DEFAULT.cut, "qpsol": "qrqp", "qpsol_options": INNER}),
    "fatrop": partial(nonlinear, "fatrop", {"structure_detection": "none",
                                            "fatrop": {"print_level": 0, "max_iter": ITERATIONS, "tol": TIGHT}}),
    "SLSQP": partial(scipy, "SLSQP", {"maxiter": ITERATIONS, "ftol": DEFAULT.point}),
    "trust-constr": partial(scipy, "trust-constr", {"maxiter": ITERATIONS, "gtol": TIGHT, "xtol": TIGHT,
                                                    "barrier_tol": TIGHT}),
}  # fmt: skip
QUADRATIC: dict[str, Callable[[Statement], Answer]] = {
    "HiGHS": partial(highs, {}),
    "HiGHS, tight": partial(highs, {"tolerance": 1e-10, "small_matrix_value": 1e-12}),
    "Clarabel": partial(clarabel, {}),
    "Clarabel, tight": partial(clarabel, dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), TIGHT)),
    "OSQP": partial(osqp, {"eps_abs": TIGHT, "eps_rel": TIGHT, "eps_prim_inf": TIGHT, "eps_dual_inf": TIGHT,
                           "max_iter": 100 * ITERATIONS, "polish": True}),
}  # fmt: skip
