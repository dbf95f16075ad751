"""The cheapest tolerances with which a gap keeps within its limits: convex programs over the rows of its stack-up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from fcdm_opt.curve.touching_sizes import TouchingSizes
from fcdm_opt.curve.true_sizes import widened
from fcdm_opt.design.stack.spread import mixture
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, numbers
from fcdm_opt.lazy_import import extra, imported
from fcdm_opt.plain import Plain
from fcdm_opt.problem.arguments import positive
from fcdm_opt.problem.schema import known_sizes
from fcdm_opt.tolerances import DEFAULT

MOST_CHOICES = 256  # of rows that hold the least gap of each part pair: all are tried up to here
COSTS = 'a number c > 0 (c / t), ("1/t", c), ("1/t^2", c) or [(t, cost), ...], convex and falling'
ROUNDS = 20  # of mixing rows anew at the tolerances found


@dataclass(frozen=True, eq=False)
class Allocation(Plain):
    """The cheapest tolerances.

    Attributes
    ----------
    tolerances : mapping of size name to (low, high)
    cost : float
        Of those that have one.
    least, largest : float
        The gap in the worst case with these tolerances.
    deviation : float or None
        Standard deviation of the gap that was asked to be within by a share; None for the worst case.
    """

    tolerances: Mapping[str, tuple[float, float]]
    cost: float
    least: float
    largest: float
    deviation: float | None = None

    def __str__(self) -> str:
        """Return the tolerances as a table."""
        return str(imported("show.printing:printed")(imported("show.stacks:print_allocation"), self))


def allocated(
    touching: TouchingSizes,
    cost: Mapping[str, Any],
    limits: tuple[float, float],
    *,
    share: float | None,
    widest: float,
    cp: float,
) -> Allocation:
    """Return the cheapest tolerances, see `StackUp.allocate`.

    For each part pair one row, or a mix of rows with weights that add up to 1, proves that the gap is never too small;
    of one pair all rows prove that it is never too large. Each choice of these is a convex program; single rows are all
    tried, then mixed at the tolerances found for as long as that makes them cheaper.

    Raises
    ------
    InputError
        For a cost that is no such, and where the limits cannot be kept with any tolerances.
    """
    sizes = touching.sizes
    names = [size.name for size in sizes]
    known_sizes(cost, "cost", names)
    if not cost:
        raise InputError("no size has a cost", key="cost", allowed="{name: c} or {name: [(t, cost), ...]}")
    if share is not None and not 0.5 < share < 1.0:
        raise InputError("unusable share", key="share", found=share, allowed="between 0.5 and 1, as 0.9973")
    widest, cp = positive(widest, "widest"), positive(cp, "cp")
    limit = min(widest, touching.reach[0]) if max(len(body.parts) for body in touching.bodies) > 1 else widest
    laws = {name: _law(own) for name, own in cost.items()}
    tables = {name: float(own[-1, 0]) for name, (law, own) in laws.items() if law == "table"}
    tops = ((size.half * (limit if size.name in cost else 1.0), tables.get(size.name, np.inf)) for size in sizes)
    most = np.array([min(own) for own in tops])
    for size, top in zip(sizes, most, strict=True):
        if size.name in cost and not top > 0.0:
            raise InputError("a size without width has no cost", key=f"cost.{size.name}", found=size.tolerance)
    wide = [replace(s, tolerance=(s.middle - top, s.middle + top)) for s, top in zip(sizes, most.tolist(), strict=True)]
    around = widened(touching, wide)
    middle = np.array([size.middle for size in sizes])
    pairs = [
        np.column_stack([pair.values[:, 0] + pair.values[:, 1:] @ middle, pair.values[:, 1:]]) for pair in around.pairs
    ]
    program = _Program(names, laws, most, np.array([size.half for size in sizes]), share, cp)
    low, high = limits
    uppers = [list(pair) for pair in pairs] if np.isfinite(high) else [[]]
    best: tuple[float, Array, list[Array]] | None = None
    for lowers in _choices(pairs, most, low):
        for upper in uppers:
            found = program.solved(lowers, low, upper, high)
            if found is None:
                continue
            held = lowers
            for _ in range(ROUNDS if share is None and lowers else 0):
                t = found[1]
                mixed = [mixture(pair, t) @ pair for pair in pairs]
                again = program.solved(mixed, low, upper, high)
                if again is None or again[0] >= found[0] * (1.0 - DEFAULT.requirement):
                    break
                found, held = again, mixed
            if best is None or found[0] < best[0]:
                best = (*found, held)
    if best is None:
        reached = float(touching.gap(middle))
        what = f"no tolerances keep the gap within these limits; it is {reached:.6g} in their middle"
        raise InputError(what, key="limits", found=limits)
    price, t, lowers = best
    made = [
        replace(size, tolerance=(size.middle - own, size.middle + own))
        for size, own in zip(sizes, t.tolist(), strict=True)
    ]
    result = widened(touching, made, least=False)
    deviation = None
    if share is not None:
        held = lowers or [pair[0] for pair in pairs]
        deviation = max(float(np.linalg.norm(row[1:] * t)) for row in held) / (3.0 * cp)
    ends = {size.name: size.tolerance for size in made}
    return Allocation(ends, price, result.least()[0], result.largest()[0], deviation)


def _choices(pairs: Sequence[Array], most: Array, low: float) -> list[list[Array]]:
    """Return, one row a pair, what may prove the least gap; the likeliest where there are too many."""
    if low == -np.inf:
        return [[]]
    usable = [[row for row in pair if row[0] >= low] for pair in pairs]
    if np.prod([float(len(rows)) for rows in usable]) <= MOST_CHOICES:
        return [list(rows) for rows in product(*usable)]
    likely = [max(rows, key=lambda row: row[0] - np.abs(row[1:]) @ most / 2.0) for rows in usable if rows]
    return [likely] if len(likely) == len(pairs) else []


class _Program:
    """The convex program over half tolerances, in shares of the largest ones."""

    def __init__(
        self, names: Sequence[str], laws: Mapping[str, Any], most: Array, given: Array, share: float | None, cp: float
    ) -> None:
        self._names, self._laws, self._most, self._given = names, laws, most, given
        self._share, self._deviations = share, 3.0 * cp

    def solved(self, lowers: Sequence[Array], low: float, uppers: Any, high: float) -> tuple[float, Array] | None:
        """Return the least cost and its half tolerances; None where there are none."""
        cp = extra("cvxpy", "allocation", key="allocate")
        free = [k for k, name in enumerate(self._names) if name in self._laws]
        x = cp.Variable(len(free), pos=True)
        held = np.where(np.isin(np.arange(len(self._names)), free), 0.0, self._given)

        def taken(row: Array) -> Any:
            parts = np.abs(row[1:]) * self._most
            if self._share is None:
                return parts[free] @ x + np.abs(row[1:]) @ held
            rest = float(np.linalg.norm(row[1:] * held))
            return cp.norm(cp.hstack([cp.multiply(parts[free], x), rest]))

        rows = [(row, row[0] - low) for row in lowers] + [(row, high - row[0]) for row in uppers]
        if self._share is not None:
            rows = self._spread(lowers, low, uppers, high)
        size = max([abs(float(row[0])) for row, _ in rows], default=1.0) or 1.0
        limits = [x <= 1.0, *(taken(row) / size <= room / size for row, room in rows)]
        prices = [_price(cp, self._laws[self._names[k]], x[j], float(self._most[k])) for j, k in enumerate(free)]
        problem = cp.Problem(cp.Minimize(sum(prices)), limits)
        try:
            problem.solve(solver=cp.CLARABEL)
        except cp.error.SolverError:
            return None
        if problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
            return None
        x.value = np.clip(np.asarray(x.value), 0.0, 1.0)
        x.value = x.value * self._within(rows, free, x.value * self._most[free], held)
        t = held + 0.0
        t[free] = x.value * self._most[free]
        return float(problem.objective.value), t

    def _spread(self, lowers: Sequence[Array], low: float, uppers: Any, high: float) -> list[tuple[Array, float]]:
        """Return rows, and what the root sum square of their half tolerances may be for a share to be within.

        A row that holds both limits has all that is outside; where different rows do, each has half of it.
        """
        from scipy.optimize import brentq
        from scipy.special import ndtr, ndtri

        assert self._share is not None
        share = self._share if high == np.inf or low == -np.inf else (1.0 + self._share) / 2.0
        rows = [(row, row[0] - low, high) for row in lowers] + [(row, high - row[0], low) for row in uppers]
        found = []
        for row, room, other in rows:
            deviation = room / float(ndtri(share))
            both = np.isfinite(other) and all(any((row == own).all() for own in side) for side in (lowers, uppers))
            if both and min(row[0] - low, high - row[0]) > 0.0:
                ends = np.array([low, high]) - row[0]
                least, most = (np.sort(np.abs(ends)) / ndtri((1.0 + self._share) / 2.0)).tolist()
                deviation = least if most == least else brentq(
                    lambda own, ends=ends: np.diff(ndtr(ends / own))[0] - self._share, least, most
                )  # fmt: skip
            found.append((row, deviation * self._deviations))
        return found

    def _within(self, rows: Sequence[tuple[Array, float]], free: Sequence[int], t: Array, held: Array) -> float:
        """Return the share of some half tolerances, 1 but for the solver's slack, with which all limits are kept."""
        share = 1.0
        for row, room in rows:
            moving, fixed = row[1:][free] * t, row[1:] * held
            if self._share is None:
                own, left = float(np.abs(moving).sum()), room - float(np.abs(fixed).sum())
            else:
                own, rest = float(np.linalg.norm(moving)), float(np.linalg.norm(fixed))
                left = float(np.sqrt(max(room**2 - rest**2, 0.0)))
            if own > left:
                share = min(share, max(left, 0.0) / own)
        return share


def _law(cost: Any) -> tuple[str, Any]:
    """Return the law of a cost, "1/t" or "1/t^2", and its factor; or "table" and half tolerances with costs, (n, 2)."""
    if isinstance(cost, tuple | list) and len(cost) == 2 and isinstance(cost[0], str):
        law, factor = cost
    elif isinstance(cost, tuple | list | np.ndarray):
        table = numbers(cost, "cost")
        if table.ndim == 2 and table.shape[1] == 2 and len(table) > 1 and np.isfinite(table).all():
            steps, falls = np.diff(table, axis=0).T
            if table[0, 0] >= 0.0 and (steps > 0).all() and (falls < 0).all() and (np.diff(falls / steps) >= 0).all():
                return "table", table
        raise InputError("unusable table of costs", key="cost", found=cost, allowed=COSTS)
    else:
        law, factor = "1/t", cost
    if law not in ("1/t", "1/t^2") or np.ndim(factor):
        raise InputError("unusable cost", key="cost", found=cost, allowed=COSTS)
    return law, positive(factor, "cost")


def _price(cp: Any, cost: tuple[str, Any], x: Any, most: float) -> Any:
    """Return the cost of a half tolerance x * most as an expression."""
    law, c = cost
    if law == "table":
        ends, prices = c.T
        slopes = np.diff(prices) / np.diff(ends)
        return cp.max(cp.hstack([prices[k] + slope * (x * most - ends[k]) for k, slope in enumerate(slopes)]))
    return c / most * cp.inv_pos(x) if law == "1/t" else c / most**2 * cp.power(x, -2)
