"""One contact as a linear program, by HiGHS and Clarabel.

    max d.m - rho_1 t  over n, m, t    s.t.  R n = m,  p_i.n <= t,  -q_j.m <= 1

with the vertices p_i of part 1 in its own axes, q_j of part 2, both about their seeds: the steepest bound by a contact
line, scaled to b = 1. Its dual is the question for a common point,

    min sum mu  over v, lambda, mu >= 0    s.t.  sum lambda_i p_i = -R^T v,  sum mu_j q_j = -v - d,  sum lambda = rho_1.

A pose changes nine entries of the matrix and d, whatever the number of vertices; so a solver keeps the rest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcdm_opt.errors import FcdmError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt_benchmarks.library import (
    DUAL,
    PRIMAL,
    Compressed,
    basic_weights,
    highs_model,
    highs_solver,
    library,
    solved_by_highs,
)
from fcdm_opt_benchmarks.method import Ask, ContactAnswer, ContactQuestion, Method, Pair, one_by_one, settings
from fcdm_opt_benchmarks.placed import Placed, answered

EVERY = np.arange(7, dtype=np.int32)


class Simplex(NamedTuple):
    """Feasibility tolerance of HiGHS, and whether rho_2 is worked out anew from the last basis."""

    tolerance: float
    anew: bool = False


class ContactProgram:
    """The program of a pair: max g.y s.t. A y = 0 in the first three rows, A y <= u in all others; y = (n, m, t).

    Attributes
    ----------
    matrix : (3 + vertices, 7) array
        With ones for the entries of R, which are its upper left corner.
    upper : array
        Right-hand sides u.
    static : slice
        The rows of part 2.
    """

    def __init__(self, placed: Placed) -> None:
        P, Q = placed.one.vertices, placed.two.vertices
        second = 3 + len(P)
        self.static = slice(second, second + len(Q))
        self.matrix = np.zeros((self.static.stop, 7))
        self.matrix[:3, :3], self.matrix[:3, 3:6] = 1.0, -np.eye(3)
        self.matrix[3:second, :3], self.matrix[3:second, 6] = P, -1.0
        self.matrix[self.static, 3:6] = -Q
        self.upper = np.zeros(len(self.matrix))
        self.upper[self.static] = 1.0

    def compressed(self, matrix: Array) -> Compressed:
        """Return starts, indices and values of a matrix by columns, without its zeros."""
        from scipy.sparse import csc_matrix

        made = csc_matrix(matrix)
        return made.indptr, made.indices, made.data


def gain(d: Array, rho1: float) -> Array:
    """Return the costs g."""
    return np.array([0.0, 0.0, 0.0, *d, -rho1])


# ------------------------------------------------------------------------------------------------------------ HiGHS


def cold(pair: Pair, setting: Simplex) -> Ask:
    """Solve the dual with HiGHS, from scratch: its own choice, the dual simplex method."""
    return _highs(pair, setting, warm=False)


def warm(pair: Pair, setting: Simplex) -> Ask:
    """Solve the dual with HiGHS, starting from the last answer's basis by the primal simplex method."""
    return _highs(pair, setting, warm=True)


def _highs(pair: Pair, setting: Simplex, *, warm: bool) -> Ask:
    placed = Placed.of(pair)
    program = ContactProgram(placed)
    count = len(program.matrix)
    solver = highs_solver(
        setting.tolerance,
        presolve="off",  # takes longer than the simplex method on seven rows
        solver="simplex",
        simplex_strategy=PRIMAL if warm else DUAL,
    )
    low = np.where(np.arange(count) < 3, -np.inf, 0.0)  # the dual: a column for every row of the program
    columns, zero = (low, np.full(count, np.inf)), np.zeros(7)
    solver.passModel(highs_model(program.compressed(program.matrix.T), program.upper, (zero, zero), columns))
    matrix, change = program.matrix.copy(), solver.changeCoeff

    def answer(question: ContactQuestion) -> ContactAnswer:
        R, d = placed.pose(question.transform)
        for i, row in enumerate(R.tolist()):
            for j, entry in enumerate(row):
                change(j, i, entry)
        g = gain(d, question.rho1)
        solver.changeRowsBounds(7, EVERY, g, g)
        if not warm:
            solver.clearSolver()
        solved_by_highs(solver)
        if not setting.anew:
            return answered(solver.getObjectiveValue())
        matrix[:3, :3] = R
        basis, weights = basic_weights(solver, matrix, g)
        return answered(weights[basis >= program.static.start].sum())

    return one_by_one(answer)


# --------------------------------------------------------------------------------------------------------- Clarabel


def clarabel(pair: Pair, setting: float) -> Ask:
    """Solve the program with Clarabel, called directly: one solver, updated."""
    sparse, solvers = library("scipy.sparse"), library("clarabel")
    placed = Placed.of(pair)
    program = ContactProgram(placed)
    settings = solvers.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    settings.presolve_enable = settings.chordal_decomposition_enable = False  # else nothing can be updated
    settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = setting
    starts, indices, values = program.compressed(program.matrix)
    matrix = sparse.csc_matrix((values, indices, starts), shape=program.matrix.shape)
    cones = [solvers.ZeroConeT(3), solvers.NonnegativeConeT(len(program.matrix) - 3)]
    quadratic = sparse.csc_matrix((7, 7))
    solver = solvers.DefaultSolver(quadratic, np.ones(7), matrix, program.upper, cones, settings)
    turned = np.add.outer(starts[:3], np.arange(3)).ravel().astype(np.int64)  # the places of R, column by column

    def answer(question: ContactQuestion) -> ContactAnswer:
        R, d = placed.pose(question.transform)
        solver.update(q=-gain(d, question.rho1), A=(turned, R.ravel("F")))
        found = solver.solve()
        if str(found.status) != "Solved":
            raise FcdmError(f"Clarabel: {found.status}")
        return answered(-found.obj_val)

    return one_by_one(answer)


def modelled(pair: Pair, setting: float) -> Ask:
    """Solve the program in cvxpy with Clarabel: pose and rho_1 are parameters, so the model is compiled once."""
    cvxpy = library("cvxpy")
    library("clarabel")
    placed = Placed.of(pair)
    R, d, rho1 = cvxpy.Parameter((3, 3)), cvxpy.Parameter(3), cvxpy.Parameter(nonneg=True)
    n, m, t = cvxpy.Variable(3), cvxpy.Variable(3), cvxpy.Variable()
    rows = [R @ n == m, placed.one.vertices @ n <= t, -placed.two.vertices @ m <= 1]
    problem = cvxpy.Problem(cvxpy.Maximize(d @ m - rho1 * t), rows)
    options = {"tol_feas": setting, "tol_gap_abs": setting, "tol_gap_rel": setting, "max_threads": 1}
    R.value, d.value, rho1.value = np.eye(3), np.ones(3), 1.0
    problem.get_problem_data(cvxpy.CLARABEL)

    def answer(question: ContactQuestion) -> ContactAnswer:
        R.value, d.value = placed.pose(question.transform)
        rho1.value = question.rho1
        problem.solve(solver=cvxpy.CLARABEL, **options)
        if problem.status != cvxpy.OPTIMAL:
            raise FcdmError(f"cvxpy: {problem.status}")
        return answered(problem.value)

    return one_by_one(answer)


TIGHT = {"1e-4": Simplex(1e-4), "1e-7": Simplex(1e-7), "1e-10": Simplex(1e-10), "1e-10, anew": Simplex(1e-10, True)}
INTERIOR = settings("1e-4", "1e-6", "1e-8", "1e-11")
METHODS = (
    Method("HiGHS, cold", "HiGHS", TIGHT, cold),
    Method("HiGHS, warm", "HiGHS", TIGHT, warm),
    Method("Clarabel", "Clarabel", INTERIOR, clarabel),
    Method("Clarabel (cvxpy)", "Clarabel", INTERIOR, modelled),
)
