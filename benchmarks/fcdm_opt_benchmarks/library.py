"""Libraries of rivals, imported where they are installed, and what several methods say to HiGHS."""

from __future__ import annotations

import ctypes
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fcdm_opt.errors import FcdmError
from fcdm_opt.geometry.arrays import Array, Ints

DUAL, PRIMAL = 1, 4  # of HiGHS: its simplex methods
Compressed = tuple[NDArray[Any], NDArray[Any], Array]
"""A matrix by columns: where they start, rows, values."""


class MissingLibraryError(FcdmError, ModuleNotFoundError):
    """An optional library is not installed; `name` is its module."""


PACKAGES = {"pydrake": "drake"}
"""What to install for a module of another name."""


def package(module: str) -> str:
    """Return what to install for a module."""
    top = module.partition(".")[0]
    return PACKAGES.get(top, top)


def library(name: str) -> Any:
    """Import an optional library; raise `MissingLibraryError` that says what to install."""
    try:
        return import_module(name)
    except ImportError as reason:
        word = f"this rival method needs {name}: pip install {package(name)} ({reason})"
        raise MissingLibraryError(word, name=name) from reason


UPWARD = 0x800 if platform.machine() in ("x86_64", "AMD64") else 0x400000  # FE_UPWARD


@contextmanager
def rounding_upward() -> Iterator[None]:
    """Round upward within, as interval libraries need it, and as before afterwards.

    codac sets the processor so when it is imported and leaves it: every later sum of the process would be rounded up.
    """
    system = ctypes.CDLL(None)
    before = system.fegetround()
    system.fesetround(UPWARD)
    try:
        yield
    finally:
        system.fesetround(before)


@cache
def dataset_script(name: str) -> Any:
    """Return a script of the data set as a module: it lies beside this package, or in it where that is installed."""
    beside, within = Path(__file__).parents[1] / "dataset", Path(__file__).with_name("question_files")
    folder = str(beside if beside.is_dir() else within)
    sys.path.insert(0, folder)
    try:
        return import_module(name)
    finally:
        sys.path.remove(folder)


def highs_solver(tolerance: float | None = None, **options: Any) -> Any:
    """Return a silent solver of HiGHS, with a feasibility tolerance and other options, or its own."""
    solver = library("highspy").Highs()
    if tolerance is not None:
        options |= {"primal_feasibility_tolerance": tolerance, "dual_feasibility_tolerance": tolerance}
    for key, value in {"output_flag": False, "threads": 1, **options}.items():
        solver.setOptionValue(key, value)
    return solver


def highs_model(
    matrix: Compressed, costs: Array, rows: tuple[Array, Array], columns: tuple[Array, Array] | None = None
) -> Any:
    """Return min costs.x with A x and x between two bounds each, for HiGHS; x >= 0 unless `columns` are given."""
    highspy, count = library("highspy"), len(costs)
    model = highspy.HighsLp()
    model.num_col_, model.num_row_, model.col_cost_ = count, len(rows[0]), costs
    model.col_lower_, model.col_upper_ = columns or (np.zeros(count), np.full(count, highspy.kHighsInf))
    model.row_lower_, model.row_upper_ = rows
    own = model.a_matrix_
    own.format_, own.num_col_, own.num_row_ = highspy.MatrixFormat.kColwise, count, len(rows[0])
    own.start_, own.index_, own.value_ = matrix
    return model


def dense(matrix: Array) -> Compressed:
    """Return a matrix by columns, with its zeros."""
    rows, columns = matrix.shape
    places = np.tile(np.arange(rows, dtype=np.int32), columns)
    return rows * np.arange(columns + 1, dtype=np.int32), places, matrix.T.ravel()


def solved_by_highs(solver: Any) -> None:
    """Solve what a solver holds; raise `FcdmError` with its own word where it has no optimum."""
    solver.run()
    status = solver.getModelStatus()
    if status != library("highspy").HighsModelStatus.kOptimal:
        raise FcdmError(f"HiGHS: {solver.modelStatusToString(status)}")


def basic_weights(solver: Any, columns: Array, right: Array) -> tuple[Ints, Array]:
    """Return the basis that HiGHS ended with and its weights, worked out anew, as its own sums are less exact.

    `columns`: (n, rows). A negative entry of the basis stands for a row, whose slack is zero.
    """
    basis = np.asarray(solver.getBasicVariables()[1])
    unit = np.eye(len(right))
    system = np.array([columns[k] if k >= 0 else unit[-1 - k] for k in basis]).T
    return basis, np.linalg.solve(system, right)
