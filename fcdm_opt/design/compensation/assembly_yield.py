"""The share of part pairs whose motion stays within a budget, and which body's tolerance it hangs on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from fcdm_opt.design.compensation.histogram import Amounts
from fcdm_opt.design.compensation.indices import SizeMap, SwappedPairs
from fcdm_opt.design.compensation.table import MapPoints
from fcdm_opt.design.distributions import Distribution, Measured, Normal, Uniform
from fcdm_opt.design.proportion import proportion_interval
from fcdm_opt.doors import Shown
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags, Ints, numbers
from fcdm_opt.problem.arguments import by_parameter, interval, is_real, length

BLOCK = 2**14
"""Pairs looked up at once, an even number: few enough to stay in the processor's cache."""

MOST = 10**10
"""Pairs at most: more tell nothing new."""

SHARES = (0.5, 0.9, 0.99, 0.999)
"""Shares of the pairs that quantiles are told for."""

BODIES = ("movable", "static")
OTHERS = ("outside", "impossible", "undecided")


@dataclass(frozen=True, kw_only=True)
class Contribution:
    """How much of the amount's variance, and of the failures, is due to one body's tolerance.

    Attributes
    ----------
    body : str
        "movable" or "static".
    first_order, total : float
        Sobol indices of the amount: the share of its variance that goes when this body's size is fixed, on average, and
        the share that stays when only this size varies; they differ by what both sizes do together. Pairs without a
        motion are left out, with those they are compared with. nan where the amount does not vary.
    first_order_error, total_error : float
        Their standard errors.
    share_without : float
        The yield if this body's size were always its median.
    """

    body: str
    first_order: float
    first_order_error: float
    total: float
    total_error: float
    share_without: float


@dataclass(frozen=True, kw_only=True)
class AssemblyYield(Shown):
    """The share of part pairs whose motion stays within a budget.

    Attributes
    ----------
    share : float
        Pairs that pass, of all.
    interval : pair of float
        Holds the true share with at least the `confidence` asked for (Clopper-Pearson); pairs that the map's error
        leaves `undecided` fail for its lower end and pass for its upper one.
    confidence : float
    count, passed : int
        All pairs looked at, and those that pass.
    outside : float
        Share of the pairs outside the map's box; they count as failing.
    impossible : float
        Share of the pairs without a motion; they fail.
    undecided : float
        Share of the pairs whose amount is as near to the budget as the map's stated error. Limits of parameters are
        taken at their word: a map states no error of single parameters.
    budget : float
        Largest amount that passes, a length; inf where there are limits only.
    limits : mapping of str to (lower, upper)
        Of parameters: lengths, radians.
    quantiles : mapping of float to float
        Amounts that the given shares of the pairs with a motion do not exceed; above the exact ones by at most 2^-15 of
        the largest amount. nan where no pair has a motion.
    contributions : tuple of two `Contribution`
        Of the movable and of the static body; for measured pairs as if each size were drawn by itself.
    amounts : array (n + 1,)
        Edges of the bins of a histogram of the amount.
    counts : array of int (n,)
        Pairs in these bins.
    unit : str
        Of amounts; "" where none is known.
    """

    share: float
    interval: tuple[float, float]
    confidence: float
    count: int
    passed: int
    outside: float
    impossible: float
    undecided: float
    budget: float
    limits: Mapping[str, tuple[float, float]]
    quantiles: Mapping[float, float]
    contributions: tuple[Contribution, Contribution]
    amounts: Array = field(repr=False, compare=False)
    counts: Ints = field(repr=False, compare=False)
    unit: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return plain data; nan is None, and so is an end of a range that is open."""
        plain = {own.name: getattr(self, own.name) for own in fields(self)}
        plain["interval"] = list(self.interval)
        plain["budget"] = _finite(self.budget)
        plain["limits"] = {name: [_finite(end) for end in ends] for name, ends in self.limits.items()}
        plain["quantiles"] = {str(share): _finite(amount) for share, amount in self.quantiles.items()}
        plain["contributions"] = [
            {key: value if key == "body" else _finite(value) for key, value in vars(own).items()}
            for own in self.contributions
        ]
        plain["amounts"], plain["counts"] = self.amounts.tolist(), self.counts.tolist()
        return plain

    def __str__(self) -> str:
        low, high = self.interval
        sure = f"{100.0 * self.confidence:.6g} % sure: {low:.4%} to {high:.4%}"
        words = [f"{self.share:.4%} of {self.count} pairs pass ({sure})"]
        words += [f"{getattr(self, what):.4%} {what}" for what in OTHERS if getattr(self, what) > 0.0]
        return ", ".join(words)


def assembly_yield(
    sizes_map: SizeMap,
    *,
    sizes: tuple[Distribution, Distribution] | Array,
    budget: float | None = None,
    limits: Mapping[str, Any] | None = None,
    count: int = 1_000_000,
    seed: int = 1,
    confidence: float = 0.95,
) -> AssemblyYield:
    """Return the share of part pairs whose motion stays within a budget.

    Parameters
    ----------
    sizes_map : Table or CompensationMap
        The motion for every size pair, with its error.
    sizes : pair of distributions, or array (n, 2)
        What the sizes of body 1 and body 2 are drawn from, independently of each other; or measured pairs, which are
        looked up as they are (from a CSV file: `read_columns`).
    budget : float, optional
        Largest amount that passes, a length.
    limits : mapping of parameter name to (lower, upper), optional
        What parameters of the map's table must keep to as well: lengths, radians.
    count : int
        Pairs to draw.
    seed : int
        Of the random numbers; the same seed gives the same pairs.
    confidence : float
        Of the interval, between 0 and 1.

    Raises
    ------
    InputError
        For a size that can be zero or less, neither budget nor limits, or an argument that makes no sense.

    Notes
    -----
    Contributions: two successive pairs are also looked up with their movable bodies swapped. The four amounts give
    both first-order and total indices (A. Saltelli et al., Variance based sensitivity analysis of model output,
    Computer Physics Communications 181 (2010)).
    """
    if not callable(getattr(sizes_map, "at", None)):
        raise InputError("not a map of motions", key="sizes_map", found=type(sizes_map).__name__, allowed="a Table")
    if budget is None and not limits:
        raise InputError("nothing to keep to", key="budget", allowed="a budget, limits, or both")
    names = tuple(getattr(getattr(sizes_map, "table", sizes_map), "names", ()))
    rule = _Rule(
        most=math.inf if budget is None else length(budget, "budget"),
        names=names,
        limits={name: interval(ends, f"limits.{name}") for name, ends in by_parameter(limits, "limits", names).items()},
    )
    _whole(count, "count", 1, MOST)
    _whole(seed, "seed", 0, 2**63 - 1)
    if not is_real(confidence) or not 0.0 < confidence < 1.0:
        raise InputError("unusable confidence", key="confidence", found=confidence, allowed="between 0 and 1")
    drawn, measured = _sources(sizes)
    medians = [float(own.quantile(0.5)) for own in drawn]

    tally, swapped, passing = _Tally(), SwappedPairs(sizes_map), np.zeros(2, np.int64)
    for pairs in _blocks(drawn, count, seed) if measured is None else _cut(measured):
        points = sizes_map.at(pairs[:, 0], pairs[:, 1])
        tally.add(points, rule)
        passing += [
            np.count_nonzero(rule.passed(sizes_map.at(medians[0], pairs[:, 1]))),
            np.count_nonzero(rule.passed(sizes_map.at(pairs[:, 0], medians[1]))),
        ]
        if measured is None:
            swapped.add(pairs, points.amount)
    if measured is not None:
        for pairs in _blocks(drawn, count, seed):
            swapped.add(pairs, sizes_map.at(pairs[:, 0], pairs[:, 1]).amount)

    of, indices = tally.count, swapped.indices()
    return AssemblyYield(
        share=tally.passed / of,
        interval=proportion_interval((tally.surely, tally.surely + tally.undecided), of, confidence),
        confidence=float(confidence),
        count=of,
        passed=tally.passed,
        outside=tally.outside / of,
        impossible=tally.impossible / of,
        undecided=tally.undecided / of,
        budget=rule.most,
        limits=rule.limits,
        quantiles={share: tally.amounts.quantile(share) for share in SHARES},
        contributions=(
            Contribution(body=BODIES[0], share_without=float(passing[0] / of), **indices[0]),
            Contribution(body=BODIES[1], share_without=float(passing[1] / of), **indices[1]),
        ),
        **tally.amounts.shown(),
        unit=getattr(sizes_map, "unit", ""),
    )


@dataclass(frozen=True, kw_only=True)
class _Rule:
    """What passes."""

    most: float
    names: tuple[str, ...]
    limits: Mapping[str, tuple[float, float]]

    def kept(self, points: MapPoints) -> Flags | bool:
        """Tell which motions keep to the limits of their parameters."""
        kept: Flags | bool = True
        for name, (low, high) in self.limits.items():
            value = points.parameters[..., self.names.index(name)]
            kept = kept & (value >= low) & (value <= high)
        return kept

    def passed(self, points: MapPoints) -> Flags:
        """Tell which pairs pass; one without a motion has amount nan and does not."""
        return (points.amount <= self.most) & self.kept(points)


class _Tally:
    """Counts of pairs."""

    def __init__(self) -> None:
        self.count = self.passed = self.surely = self.undecided = self.outside = self.impossible = 0
        self.amounts = Amounts()

    def add(self, points: MapPoints, rule: _Rule) -> None:
        """Count pairs."""
        amount, kept = points.amount, rule.kept(points)
        known = amount == amount
        self.count += len(amount)
        self.passed += int(np.count_nonzero((amount <= rule.most) & kept))
        # an error of nan decides nothing
        surely = int(np.count_nonzero((amount + points.error <= rule.most) & kept))
        self.surely += surely
        self.undecided += int(np.count_nonzero(known & ~(amount - points.error > rule.most) & kept)) - surely
        outside = int(np.count_nonzero(points.region < 0))
        self.outside += outside
        self.impossible += len(amount) - outside - int(np.count_nonzero(known & (points.region >= 0)))
        self.amounts.add(amount[known])


def _sources(sizes: Any) -> tuple[list[Distribution], Array | None]:
    """Return what both sizes are drawn from, and the measured pairs where there are some."""
    if isinstance(sizes, list | tuple) and any(isinstance(own, Uniform | Normal | Measured) for own in sizes):
        if len(sizes) != 2 or not all(isinstance(own, Uniform | Normal | Measured) for own in sizes):
            raise InputError("not two distributions", key="sizes", found=sizes, allowed="one for each body")
        for own in sizes:
            if not own.range[0] > 0.0:
                raise InputError("sizes must be > 0", key="sizes", found=own)
        return list(sizes), None
    measured = numbers(sizes, "sizes")
    if measured.ndim != 2 or measured.shape[1] != 2 or not len(measured):
        allowed = "two distributions, or an (n, 2) array of measured pairs"
        raise InputError("unusable sizes", key="sizes", found=f"shape {measured.shape}", allowed=allowed)
    wrong = np.flatnonzero(~(np.isfinite(measured) & (measured > 0.0)).all(axis=1))
    if wrong.size:
        found = measured[wrong[0]].tolist()
        raise InputError("not a size pair", key=f"sizes[{wrong[0]}]", found=found, allowed="finite numbers > 0")
    return [Measured(measured[:, 0]), Measured(measured[:, 1])], measured


def _blocks(drawn: list[Distribution], count: int, seed: int) -> Iterator[Array]:
    """Yield `count` pairs, block by block; how long a block is changes no pair."""
    random = np.random.default_rng(seed)
    for start in range(0, count, BLOCK):
        shares = random.random((min(BLOCK, count - start), 2))
        yield np.column_stack([own.quantile(shares[:, k]) for k, own in enumerate(drawn)])


def _cut(pairs: Array) -> Iterator[Array]:
    """Yield pairs, block by block."""
    for start in range(0, len(pairs), BLOCK):
        yield pairs[start : start + BLOCK]


def _whole(value: Any, key: str, least: int, most: int) -> None:
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or not least <= value <= most:
        raise InputError("unusable number", key=key, found=value, allowed=f"a whole number from {least} to {most}")


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
