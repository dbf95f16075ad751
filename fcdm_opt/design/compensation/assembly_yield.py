"""The share of the parts made whose motion stays within a budget, and which size's tolerance it hangs on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve.true_sizes import ROLES
from fcdm_opt.design.distributions import Distribution, Measured, Normal
from fcdm_opt.design.sizes import drawn_pairs, proportion_interval, sources
from fcdm_opt.design.stack.spread import spreads
from fcdm_opt.errors import InputError, known_arguments
from fcdm_opt.geometry.arrays import Array, Flags, Ints, frozen
from fcdm_opt.geometry.units import measured
from fcdm_opt.judge.sampled_sizes import MotionClaims, ShareClaim
from fcdm_opt.lazy_import import NotebookRepr
from fcdm_opt.plain import Plain
from fcdm_opt.problem.arguments import by_parameter, interval, length, real
from fcdm_opt.problem.problem import SCALES
from fcdm_opt.tolerances import DEFAULT

BLOCK = 2**14  # pairs looked up at once: few enough to stay in the processor's cache
BINS = 128  # of the histogram of amounts
SHARES = (0.5, 0.9, 0.99, 0.999)  # shares of the pairs that quantiles are told for
MOST_HELD = 2_000_000  # pairs looked up at most to tell what each size' scatter costs
SAMPLED, LOOKED_UP, SEED = 50, 100_000, 20_011  # pairs of parts by which a share is judged: made anew, and looked up
OTHERS = {
    "impossible": "have no motion, or none known",
    "undecided": "are undecided: the map is not exact enough there",
}
COARSE = 0.01  # width of an interval of shares from which on tenths of a per cent are told; undecided: the range only
UNKNOWN = 0.5  # share of pairs that are undecided above which that of those that pass is not known


@dataclass(frozen=True)
class Contribution(Plain):
    """How much of the amount's variance, and of the failures, is due to one size' tolerance."""

    body: str  # "movable" or "static", of the scales of both; else the size, of an assembly's scales "scales.PART"
    # Sobol index of the amount: the share of its variance that goes when this body's size is fixed, on average. Pairs
    # without a motion are left out, with those they are compared with. nan where the amount does not vary
    first_order: float
    first_order_error: float  # its standard error
    total: float  # another one: the share that stays when only this size varies; they differ by what sizes do together
    total_error: float  # its standard error
    # the yield if this body's size were always its median, of pairs within the map's box; nan where there are none, or
    # the map leaves open whether pairs have a motion
    share_without: float


@dataclass(frozen=True, kw_only=True)
class AssemblyYield(Plain, NotebookRepr):
    """The share of part pairs whose motion stays within a budget.

    Attributes
    ----------
    share : float
        Pairs whose amount passes, of those within the map's box; an amount that is not known does not. nan where there
        are none, or more than half are `undecided`.
    interval : pair of float
        Holds the true share of all pairs with at least the `confidence` asked for (Clopper-Pearson); pairs that are
        `undecided`, or `outside` the map's box, fail for its lower end and pass for its upper one.
    confidence : float
    count, passed : int
        All pairs looked at, and those that pass.
    outside : float
        Share of the pairs outside the map's box: of these it is not known whether they pass.
    impossible : float
        Share of the pairs without a motion; they fail.
    undecided : float
        Share of the pairs whose amount is as near to the budget as the map's stated error, and of those of which a map
        that was cut off does not know whether they have a motion. Limits of parameters are taken at their word: a map
        states no error of single parameters.
    budget : float
        Largest amount that passes, a length; inf where there are limits only.
    limits : mapping of str to (lower, upper)
        Of parameters: lengths, radians.
    quantiles : mapping of float to float
        Amounts that the given shares of the pairs with a motion do not exceed. nan where no pair has a motion.
    contributions : tuple of `Contribution`
        Of each size; for measured pairs as if each size were drawn by itself.
    amounts : array (n + 1,)
        Edges of the bins of a histogram of the amount.
    counts : array of int (n,)
        Pairs in these bins.
    unit : str
        Of amounts; "" where none is known.
    sizes_map, sizes
        What it was worked out from, for `verify`.
    """

    plain_names = (
        "share", "interval", "confidence", "count", "passed", "outside", "impossible", "undecided", "budget", "limits",
        "quantiles", "contributions", "amounts", "counts", "unit", "known_to",
    )  # fmt: skip

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
    contributions: tuple[Contribution, ...]
    amounts: Array = field(repr=False, compare=False)
    counts: Ints = field(repr=False, compare=False)
    unit: str = ""
    sizes_map: Any = field(default=None, repr=False, compare=False)
    sizes: Any = field(default=None, repr=False, compare=False)

    @property
    def known_to(self) -> tuple[str, ...]:
        """How well gaps are known, as its map has it."""
        return getattr(self.sizes_map, "known_to", ())

    def claims(self, *, proof: bool = False) -> MotionClaims:
        """Return what `verify` looks at: motions at sizes drawn otherwise, and how many of them are within the budget.

        Raises
        ------
        InputError
            Where it is of a map that does not know what it is a map of.
        """
        if getattr(self.sizes_map, "problem", None) is None:
            what = "a yield is judged by the motions of its map, which knows no problem"
            raise InputError(what, key="sizes_map", found=type(self.sizes_map).__name__, allowed="a CompensationMap")
        pairs, _ = drawn_pairs(self.sizes, None, LOOKED_UP, SEED, positive=self.sizes_map.scaled)
        names = self.sizes_map.table.names
        limits = {names.index(name): ends for name, ends in self.limits.items()}
        known = _looked_up(self.sizes_map, self.budget, limits, pairs)
        share = ShareClaim(share=self.share, interval=self.interval, passed=known.passed[~known.outside])
        return replace(self.sizes_map.claims_at(pairs[:: max(len(pairs) // SAMPLED, 1)]), share=share)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data; nan is None, and so is an end of a range that is open."""
        limits = {name: [end if math.isfinite(end) else None for end in ends] for name, ends in self.limits.items()}
        budget = self.budget if math.isfinite(self.budget) else None
        return {**super().to_dict(), "budget": budget, "limits": limits}

    def __str__(self) -> str:
        low, high = self.interval
        places = 4 if high - low < COARSE else 1  # no more than is known
        within, least = round((1.0 - self.outside) * self.count), measured(self.budget, self.unit)
        does = f"a motion of at most {least}" if math.isfinite(self.budget) else "a motion within the limits"
        apart = f", whether or not the {self.outside:.4%} beyond the map's ends do" if self.outside else ""
        sure = f"{100.0 * self.confidence:.6g} % confidence"
        ends = f"{low:.{places}%} to {high:.{places}%} pass ({sure}){apart}"
        words = [f"{self.share:.{places}%} of {within} pairs pass ({does})", f"of all such pairs {ends}"][not within :]
        if self.undecided >= COARSE:
            unknown = f"how many of {within} pairs pass ({does}) is not known"
            words = [unknown if self.undecided > UNKNOWN else f"of {within} pairs ({does}) {ends}"]
        words += [f"{getattr(self, what):.{places}%} {text}" for what, text in OTHERS.items() if getattr(self, what)]
        return "; ".join((*words, *self._distribution_text, *self.known_to))

    @property
    def _distribution_text(self) -> list[str]:
        if not isinstance(self.sizes, tuple):
            return []
        ends = zip(self.sizes, getattr(self.sizes_map, "box", ()), strict=False)
        usual = [isinstance(own, Normal) and math.isclose(6.0 * own.deviation, b - a) for own, (a, b) in ends]
        how = "normally, the ends of the box at three deviations" if all(usual) else "as the sizes are distributed"
        return [f"drawn {how}"]


@known_arguments
def assembly_yield(
    sizes_map: Any,
    *,
    sizes: tuple[Distribution, ...] | Array | None = None,
    budget: float | None = None,
    limits: Mapping[str, Any] | None = None,
    count: int = 1_000_000,
    seed: int = 1,
    confidence: float = 0.95,
) -> AssemblyYield:
    """Return the share of part pairs whose motion stays within a budget.

    Parameters
    ----------
    sizes_map : Table or CompensationMap, or anything else with an `at` that answers alike
        The motion for all sizes, with its error.
    sizes : a distribution for each size, or array (n, k), optional
        What the k sizes, such as those of body 1 and body 2, are drawn from, independently of each other; or measured
        ones, which are looked up as they are (from a CSV file: `read_columns`). Deviations, of sizes by name. Default,
        of a map that knows its problem: as the problem's sizes are distributed, scales normally, with the ends of the
        map's box at three standard deviations.
    budget : float, optional
        Largest amount that passes, a length.
    limits : mapping of parameter name to (lower, upper), optional
        What parameters of the map's table must keep to as well: lengths, radians.
    count : int
        Pairs to draw, at most 10^7.
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
    Contributions: two successive draws are also looked up with one size swapped, each in turn. The four amounts give
    both first-order and total indices (A. Saltelli et al., Variance based sensitivity analysis of model output,
    Computer Physics Communications 181 (2010)).
    """
    if not callable(getattr(sizes_map, "at", None)):
        raise InputError("not a map of motions", key="sizes_map", found=type(sizes_map).__name__, allowed="a Table")
    if budget is None and not limits:
        raise InputError("nothing to keep to", key="budget", allowed="a budget, limits, or both")
    names = tuple(getattr(getattr(sizes_map, "table", sizes_map), "names", ()))
    most = math.inf if budget is None else length(budget, "budget")
    kept = {name: interval(ends, f"limits.{name}") for name, ends in by_parameter(limits, "limits", names).items()}
    real(confidence, "confidence", "a number between 0 and 1", lambda x: 0.0 < x < 1.0)
    looked_up = partial(_looked_up, sizes_map, most, {names.index(name): ends for name, ends in kept.items()})
    of = len(getattr(sizes_map, "box", SCALES))
    over = getattr(sizes_map, "over", SCALES if of == 2 else tuple(f"size {k}" for k in range(1, of + 1)))
    scaled = getattr(sizes_map, "scaled", np.ones(of, dtype=bool))
    sizes = _distributions_of(sizes_map) if sizes is None else sizes
    given = sources(sizes, positive=scaled)
    scatter = given if isinstance(given, tuple) else tuple(map(Measured, given.T))
    drawn, _ = drawn_pairs(scatter, None, count, seed, positive=scaled)
    scattered = looked_up(drawn)
    pairs, points = (drawn, scattered) if isinstance(given, tuple) else (given, looked_up(given))
    even = 2 * (len(drawn) // max(len(over), 2))
    ends = drawn[0:even:2], drawn[1:even:2]
    here, there = scattered.amount[0:even:2], scattered.amount[1:even:2]
    amounts, of = points.amount[~np.isnan(points.amount)], len(pairs)
    quantiles = np.quantile(amounts, SHARES, method="inverted_cdf") if len(amounts) else np.full(len(SHARES), np.nan)
    low, high = (float(amounts.min()), float(amounts.max())) if len(amounts) else (0.0, 0.0)
    alike = not high - low > DEFAULT.tie * high  # else the bins were narrower than digits tell apart
    wide = 0.1 * (high or (most if math.isfinite(most) else 0.0)) or 1.0
    counts, edges = np.histogram(amounts, 1 if alike else BINS, (low, high + wide * alike))
    surely, possibly = int(points.surely.sum()), int(points.possibly.sum())
    (low, _), (_, high) = (proportion_interval(some, of, confidence) for some in (surely, possibly))
    exchanged = cache(lambda *own: looked_up(np.where(own, *ends[::-1])).amount)  # of two sizes one's is the other's
    known = points.error[np.isfinite(points.error)]
    varies = len(amounts) > 0 and np.ptp(amounts) > known.max(initial=0.0)  # by more than the map is off
    contributions = []
    for k, body in enumerate(ROLES if over == SCALES else over):
        own, held = np.arange(len(over)) == k, pairs[:: max(len(pairs) * len(over) // MOST_HELD, 1)].copy()
        held[:, k] = scatter[k].quantile(0.5)
        one, other = exchanged(*own.tolist()), exchanged(*(~own).tolist())
        indices, deviations = sobol_indices(here, one, other, there) if varies else np.full((2, 2), np.nan)
        (first, total), (first_error, total_error) = indices.tolist(), deviations.tolist()
        fixed = looked_up(held)
        without = math.nan if fixed.unknown.any() or fixed.undecided > UNKNOWN else fixed.share
        contributions.append(Contribution(body, first, first_error, total, total_error, without))
    return AssemblyYield(
        share=math.nan if points.undecided > UNKNOWN else points.share,
        interval=(low, high),
        confidence=float(confidence),
        count=of,
        passed=int(points.passed.sum()),
        outside=float(points.outside.mean()),
        impossible=float((np.isnan(points.amount) & ~points.outside & ~points.unknown).mean()),
        undecided=points.undecided,
        budget=most,
        limits=kept,
        quantiles=dict(zip(SHARES, quantiles.tolist(), strict=True)),
        contributions=tuple(contributions),
        amounts=frozen(edges),
        counts=frozen(counts, np.int64),
        unit=getattr(sizes_map, "unit", ""),
        sizes_map=sizes_map,
        sizes=sizes,
    )


def _distributions_of(sizes_map: Any) -> tuple[Distribution, ...]:
    """Return how the sizes of a map are distributed, by its problem; scales normally, its box at three deviations."""
    if getattr(sizes_map, "problem", None) is None:
        what = "not given, and this map knows no problem whose sizes these are"
        raise InputError(what, key="sizes", found="nothing", allowed="a distribution for each size, or measured ones")
    ends = [Normal((low + high) / 2, (high - low) / 6, low, high) for low, high in sizes_map.box]
    own = [size for size in sizes_map.scene.sizes if size.name in sizes_map.over]
    named = dict(zip((size.name for size in own), spreads(own), strict=True))
    each = dict(zip(sizes_map.over, ends, strict=True)) | named
    return tuple(own if isinstance(own, Distribution) else Measured(np.array([own])) for own in each.values())


class _LookedUp(NamedTuple):
    """Amounts of pairs, nan without a motion, and which pairs pass, surely or possibly do, and are outside; (n,) each.

    An error of nan decides nothing; where the amount is nan too it is `unknown` whether there is a motion.
    """

    amount: Array
    passed: Flags
    surely: Flags
    possibly: Flags
    outside: Flags
    unknown: Flags
    error: Array

    @property
    def share(self) -> float:
        """Those that pass, of all that are not outside; nan without any."""
        return float(np.mean(self.passed[~self.outside])) if not self.outside.all() else math.nan

    @property
    def undecided(self) -> float:
        """Those that may pass or not, of all."""
        return float(np.mean(self.possibly & ~self.surely & ~self.outside))


def _looked_up(sizes_map: Any, most: float, limits: Mapping[int, tuple[float, float]], made: Array) -> _LookedUp:
    """Return what a map says of sizes, block by block; parameters that have limits are told by their number."""
    blocks = []
    for start in range(0, max(len(made), 1), BLOCK):
        points = getattr(sizes_map, "table", sizes_map).at(*made[start : start + BLOCK].T)
        amount, error, kept = points.amount, points.error, np.ones(points.amount.shape, dtype=bool)
        for k, (low, high) in limits.items():
            kept &= (points.parameters[..., k] >= low) & (points.parameters[..., k] <= high)
        surely, possibly = amount + error <= most, ~((amount - error > most) | np.isnan(amount))
        outside, unknown = points.region < 0, points.undecided
        possibly = possibly & kept | unknown | outside
        blocks.append((amount, (amount <= most) & kept, surely & kept, possibly, outside, unknown, error))
    return _LookedUp(*(np.concatenate(column) for column in zip(*blocks, strict=True)))


def sobol_indices(f: Array, g: Array, h: Array, k: Array) -> tuple[Array, Array]:
    """Return a size' Sobol indices from the amounts of (x, y), (x', y), (x, y'), (x', y'), of that size and all others.

    The means of u = (f - g)^2 + (h - k)^2, v = (f - h)^2 + (g - k)^2 and w = (f - g - h + k)^2 are four times the
    variance due to x with what both do together, due to y likewise, and what both do together alone; u + v - w =
    (f - k)^2 + (g - h)^2 is four times all of it. (`scipy.stats.sobol_indices` knows no pairs without a motion, asks
    for a power of two of them, and its indices do not add up as these do.)

    Amounts are (n,), quadruples with nan are left out. Returned are the first-order and the total index of x, and their
    standard errors, (2,) each; nan where the amount does not vary.
    """
    terms = np.array([(f - g) ** 2 + (h - k) ** 2, (f - h) ** 2 + (g - k) ** 2, (f - g - h + k) ** 2])
    terms = terms[:, np.isfinite(terms).all(axis=0)]
    sums, all_of_it = terms.sum(axis=1), np.array([1.0, 1.0, -1.0])
    whole, count = float(all_of_it @ sums), terms.shape[1]
    if count < 2 or not whole > 0.0:
        return np.full(2, np.nan), np.full(2, np.nan)
    taken = np.array([[1.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    indices = taken @ sums / whole
    slopes = (taken - indices[..., None] * all_of_it) / whole
    return indices, np.sqrt(np.maximum(np.einsum("ai,ij,aj->a", slopes, count * np.cov(terms, bias=True), slopes), 0.0))
