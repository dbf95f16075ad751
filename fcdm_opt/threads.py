"""One thread for the libraries of linear algebra: matrices here are small, and threads only wait for each other.

On a machine that does something else besides, they take several times as long as one alone.
"""

from __future__ import annotations

import os

SINGLE = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
"""What the libraries look up in the environment when they are loaded."""


def single() -> None:
    """Ask for one thread where the environment says nothing: before numpy is loaded."""
    for name, count in SINGLE.items():
        os.environ.setdefault(name, count)
