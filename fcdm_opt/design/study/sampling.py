"""Which points: every combination of the listed values, times joint draws from the distributions."""

from __future__ import annotations

import numpy as np

from fcdm_opt.design.distributions import Distribution
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.problem.arguments import real

SAMPLINGS = ("latin hypercube", "random")
MOST = 10_000_000  # draws, and numbers of a grid: they are held in memory, 8 bytes each


def shares(sampling: str, count: int, dimensions: int, *, seed: int) -> Array:
    """Return points of the unit cube, (dimensions, count), the same for the same seed.

    "latin hypercube": in each dimension every interval [k / count, (k + 1) / count] has one point, and which ones
    meet is left to chance; numpy alone keeps the draws the same through all versions of scipy. "random": independent.
    """
    rng = np.random.default_rng(seed)
    within = rng.random((dimensions, count))
    if sampling == "random":
        return within
    rows = np.tile(np.arange(count), (dimensions, 1))
    return (rng.permuted(rows, axis=1) + within) / count


def draws(distributions: list[Distribution], sampling: str, count: int, *, seed: int) -> list[Array]:
    """Return `count` joint draws, one array a distribution."""
    cube = shares(sampling, count, len(distributions), seed=seed)
    return [distribution.quantile(row) for distribution, row in zip(distributions, cube, strict=True)]


def grid(start: float, stop: float, count: int, spacing: str = "linear") -> tuple[float, ...]:
    """Return evenly spaced numbers, with both ends exactly as given; for "log" of equal ratios.

    Raises
    ------
    InputError
        Names the key of a grid: from, to, count.
    """
    for key, end in (("from", start), ("to", stop)):
        real(end, key, "a finite number")
    if count > MOST:
        raise InputError("too many numbers", key="count", found=count, allowed=f"at most {MOST}")
    if spacing == "log" and start <= 0:
        raise InputError("a ratio needs numbers > 0", key="from", found=start, allowed="> 0, or linear spacing")
    if count == 1 and start != stop:
        raise InputError("one number cannot be both", key="count", found=f"{start} and {stop}", allowed="from = to")
    if count > 1 and not start < stop:
        raise InputError("empty range", key="to", found=f"{start} to {stop}", allowed="from < to")
    made = (np.geomspace if spacing == "log" else np.linspace)(start, stop, count)
    return (start, *made[1:-1].tolist(), stop)[:count] if count > 1 else (start,)
