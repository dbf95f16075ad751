"""How sizes are distributed, and the gaps that follow: drawn many times, rows of the stack-up alone being asked.

What each size contributes to a gap: to how it is spread over all pairs of parts, and to its worst case.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve.touching_sizes import TouchingSizes
from fcdm_opt.curve.true_sizes import widened
from fcdm_opt.design.distributions import ALL, Distribution, Measured, Normal, Uniform
from fcdm_opt.design.sizes import proportion_interval
from fcdm_opt.errors import InputError, placed
from fcdm_opt.geometry.arrays import Array, Ints, frozen, numbers
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.units import measured, signed
from fcdm_opt.judge.sampled_sizes import GapClaims, ShareClaim
from fcdm_opt.plain import Plain
from fcdm_opt.problem.arguments import positive, real, whole
from fcdm_opt.tolerances import DEFAULT

CHUNK = 2**13  # pairs of parts that are drawn at a time: what they need stays in the processor's cache
MOST = 10**9
OTHERS, SEED = 100_000, 20_011  # pairs of parts drawn otherwise, to judge a share by
BINS = 200  # of the gaps that are kept for pictures
BEYOND = 0.00135  # share of a normal distribution beyond three deviations, to one side


@dataclass(frozen=True, eq=False)
class GapYield(Plain):
    """The share of pairs of parts whose gap is within its limits.

    Attributes
    ----------
    share : float
    interval : (float, float)
        Of the share, with `confidence`.
    share_low, share_high : float
        Of the pairs drawn those that are within the limits however facets of round faces are off, and those that may
        be, see `StackUp.known_to`; both are `share` where gaps are exact.
    count : int
        Pairs of parts that were drawn.
    confidence : float
    mean, deviation, least, largest : float
        Of the gaps drawn, length units.
    low, high : float
        Below the one, and above the other, are 0.135 % of the gaps drawn, as of a normal distribution beyond three
        deviations.
    limits : (float, float)
    edges, counts : arrays (bins + 1,), (bins,)
        Histogram of the gaps over the range that the tolerances allow, with what lies beyond in the outer bins.
    unit : str
        Of lengths, "" where the problem names none.
    claimed : GapClaims, optional
        What is told of the gap, which `verify` looks at with the share; without one for sizes that depend on others.
    counted : callable, optional
        The gaps, (n,), whose share it is, at sizes (n, k): those claimed, or of one contact of several.
    """

    plain_names = (
        "share", "interval", "share_low", "share_high", "count", "confidence", "mean", "deviation", "least", "largest",
        "low", "high", "limits", "edges", "counts",
    )  # fmt: skip

    share: float
    interval: tuple[float, float]
    share_low: float
    share_high: float
    count: int
    confidence: float
    mean: float
    deviation: float
    least: float
    largest: float
    limits: tuple[float, float]
    edges: Array
    counts: Array
    low: float
    high: float
    unit: str = ""
    claimed: GapClaims | None = field(default=None, repr=False)
    counted: Callable[[Array], Array] | None = field(default=None, repr=False)

    def __str__(self) -> str:
        """Return the share in words, and how the gaps are spread."""
        low, high = (measured(signed(end), self.unit) for end in (self.low, self.high))
        middle = f"mean {signed(self.mean)}, sigma {measured(self.deviation, self.unit, 4)}"
        return f"{self.share_text}; all but 0.27% of the gaps from {low} to {high}, {middle}"

    @property
    def share_text(self) -> str:
        """The share in words."""
        low, high = self.interval
        return (
            f"gap {self.limits_text}: {self.share:.4%} of {self.count} pairs drawn ({low:.4%} to "
            f"{high:.4%} with {100.0 * self.confidence:.6g} % confidence)"
        )

    @property
    def limits_text(self) -> str:
        """The limits in words: "of at least 0 mm", "from 0.01 mm to 0.05 mm"."""
        words = ("from", "to") if np.isfinite(self.limits).all() else ("of at least", "of at most")
        ends = zip(words, self.limits, strict=True)
        return " ".join(f"{word} {measured(x, self.unit, 4)}" for word, x in ends if np.isfinite(x)) or "of any size"

    def claims(self, *, proof: bool = False) -> GapClaims:
        """Return what `verify` looks at: the gap at all sizes, and the share by draws of their own."""
        if self.claimed is None or self.counted is None:
            raise InputError("what is drawn of sizes that depend on each other is not judged", key="correlation")
        gaps = self.counted(draws(self.claimed.sizes, OTHERS, SEED))
        passed = (gaps >= self.limits[0]) & (gaps <= self.limits[1])
        return replace(self.claimed, share=ShareClaim(share=self.share, interval=self.interval, passed=passed))


def spreads(sizes: Sequence[Size]) -> list[Distribution | float]:
    """Return the distribution of each size's deviation; a number where it has just one value."""
    found: list[Distribution | float] = []
    for size in sizes:
        told = {"normal": {}} if size.distribution is None else size.distribution
        if isinstance(told, Uniform | Normal | Measured):
            found.append(told)
            continue
        key = f"size '{size.name}'.distribution"
        kind = next(iter(told)) if isinstance(told, dict) and len(told) == 1 else None
        if kind not in ("normal", "uniform", "measured"):
            allowed = '{"normal": {"cp": 1.0, "shift": 0.0}}, {"normal": {"sigma": 0.01, "mean": 0.0}}, '
            allowed += '{"uniform": {}}, {"measured": [...]} or a distribution'
            raise InputError("unusable distribution", key=key, found=told, allowed=allowed)
        if kind == "measured":
            found.append(Measured(np.asarray(told[kind])))
        elif told[kind] and not isinstance(told[kind], Mapping):
            raise InputError("unusable distribution", key=f"{key}.{kind}", found=told[kind], allowed="a table")
        elif kind == "normal" and "sigma" in (told[kind] or {}):
            found.append(_normal_of_sigma(size, told[kind], key))
        elif kind == "uniform" and told[kind]:
            if set(told[kind]) != {"low", "high"}:
                raise InputError("unusable distribution", key=key, found=told, allowed="{}, or low and high")
            found.append(Uniform(**told[kind]))
        elif not size.half > 0.0:
            found.append(size.middle)
        elif kind == "uniform":
            assert size.tolerance is not None
            found.append(Uniform(*size.tolerance))
        else:
            given = {"cp": 1.0, "shift": 0.0, **(told[kind] or {})}
            if set(given) != {"cp", "shift"}:
                allowed = "of a normal one cp and shift, or sigma and mean, low, high"
                raise InputError("unusable distribution", key=key, found=told, allowed=allowed)
            deviation = size.half / (3.0 * positive(given["cp"], f"{key}.cp"))
            mean = size.middle + real(given["shift"], f"{key}.shift", "a finite number") * size.half
            found.append(Normal(mean, deviation))
    return found


def _normal_of_sigma(size: Size, told: Mapping[str, Any], key: str) -> Normal:
    if wrong := [name for name in told if name not in ("sigma", "mean", "low", "high")]:
        allowed = "mean, low and high"
        raise InputError("not with sigma", key=f"{key}.normal.{wrong[0]}", found=told[wrong[0]], allowed=allowed)
    with placed(key=key):
        ends = {name: told[name] for name in ("low", "high") if name in told}
        return Normal(told.get("mean", size.middle), positive(told["sigma"], "normal.sigma"), **ends)


def drawn_from(touching: TouchingSizes) -> TouchingSizes:
    """Return the rows that count for the pairs of parts drawn: where these may be beyond the tolerances, further ones.

    So far as three deviations of a normal distribution reach, within which a normal size of cp 1 keeps its tolerance.
    """
    sources, wider = spreads(touching.sizes), []
    for size, source in zip(touching.sizes, sources, strict=True):
        assert size.tolerance is not None
        (low, high), slack = size.tolerance, DEFAULT.nominal * size.half
        least, most = (source, source) if isinstance(source, float) else source.range
        if isinstance(source, Normal):
            reach = 3.0 * source.deviation
            least, most = max(least, source.mean - reach), min(most, source.mean + reach)
        ends = min(low, least) if least < low - slack else low, max(high, most) if most > high + slack else high
        wider.append(replace(size, tolerance=ends, distribution=source) if ends != (low, high) else size)
    if all(one is other for one, other in zip(wider, touching.sizes, strict=True)):
        return touching
    return widened(touching, wider)


def moments(sources: Sequence[Distribution | float]) -> tuple[Array, Array]:
    """Return means and standard deviations."""
    pairs = []
    for source in sources:
        if isinstance(source, float):
            pairs.append((source, 0.0))
        elif isinstance(source, Uniform):
            pairs.append(((source.low + source.high) / 2.0, (source.high - source.low) / np.sqrt(12.0)))
        elif isinstance(source, Measured):
            pairs.append((float(source.values.mean()), float(source.values.std())))
        elif _whole(source):
            pairs.append((source.mean, source.deviation))
        else:
            from scipy.stats import truncnorm

            ends = [(end - source.mean) / source.deviation for end in source.range]
            cut = truncnorm(*ends, loc=source.mean, scale=source.deviation)
            pairs.append((float(cut.mean()), float(cut.std())))
    means, deviations = np.array(pairs).reshape(-1, 2).T
    return means, deviations


def drawn_gaps(
    touching: TouchingSizes,
    limits: tuple[float, float],
    count: int,
    *,
    seed: int = 1,
    confidence: float = 0.95,
    correlation: Any = None,
    off: tuple[float, float] = (0.0, 0.0),
) -> GapYield:
    """Return what share of gaps is within limits, see `StackUp.yield_`; `off`: how far true gaps may be off these."""
    whole(count, "n", "number of draws", 1, MOST)
    whole(seed, "seed", "seed", 0)
    real(confidence, "confidence", "a number between 0 and 1", lambda x: 0.0 < x < 1.0)
    rows, starts = touching.stacked
    rng = np.random.Generator(np.random.SFC64(seed))
    middle, half = touching.box.mean(axis=1), np.ptp(touching.box, axis=1) / 2.0
    swing = np.abs(rows[:, 1:]) @ half
    heights = rows[:, 0] + rows[:, 1:] @ middle
    zero = next((end for end in limits if np.isfinite(end)), float(heights.mean()))  # that it is met is told exactly
    low, high = limits[0] - zero, limits[1] - zero
    ends, edges = (float((heights - swing).min()) - zero, float((heights + swing).max()) - zero), np.zeros(BINS + 1)
    counts, total, square = np.zeros(BINS, np.int64), 0.0, 0.0
    within = [(low, high), (low + off[1], high - off[0]), (low - off[0], high + off[1])]
    passed = np.zeros(3, np.int64)
    least, largest, kept = np.inf, -np.inf, list[Array]()
    sources, mixed = spreads(touching.sizes), _mixed(correlation, len(touching.sizes))
    for begin in range(0, count, CHUNK):
        drawn = rows[:, 1:] @ _drawn(rng, sources, CHUNK, mixed) + (rows[:, :1] - zero)
        gaps = least_of_largest(drawn, starts)[: count - begin]
        passed += [np.count_nonzero((gaps >= a) & (gaps <= b)) for a, b in within]
        least, largest = min(least, float(gaps.min())), max(largest, float(gaps.max()))
        total += float(gaps.sum())
        square += float(gaps @ gaps)
        if not begin:  # a normal distribution goes beyond the tolerances
            start, end = min(ends[0], least), max(ends[1], largest)
            edges = np.linspace(start, end if end > start else start + 1.0, BINS + 1)
        if begin < 2**21:  # enough for a picture
            kept.append(gaps)
            bins = ((gaps - edges[0]) * (BINS / (edges[-1] - edges[0]))).astype(np.int64)
            counts += np.bincount(np.clip(bins, 0, BINS - 1), minlength=BINS)
    mean = total / count
    deviation = min(float(np.sqrt(max(square / count - mean**2, 0.0))), (largest - least) / 2.0)  # Popoviciu
    share, surely, possibly = (passed / count).tolist()
    interval = proportion_interval(int(passed[0]), count, confidence)
    three = (zero + np.quantile(np.concatenate(kept), [BEYOND, 1.0 - BEYOND])).tolist()
    return GapYield(
        share, interval, surely, possibly, count, confidence, zero + mean, deviation, zero + least, zero + largest,
        limits, frozen(zero + edges), frozen(counts), *three,
    )  # fmt: skip


def least_of_largest(heights: Array, starts: Ints) -> Array:
    """Return the least over part pairs, which begin at `starts`, of the largest of their rows' heights, (m, n)."""
    return np.minimum.reduce(np.maximum.reduceat(heights, starts, axis=0), axis=0)


def draws(sizes: Sequence[Size], count: int, seed: int) -> Array:
    """Return deviations as sizes are distributed, independently, (count, k)."""
    return _drawn(np.random.Generator(np.random.SFC64(seed)), spreads(sizes), count).T


def _whole(source: Normal) -> bool:
    """Tell whether a normal distribution is cut off nowhere that counts."""
    return min(source.mean - source.low, source.high - source.mean) >= (ALL - 1e-9) * source.deviation


def _mixed(correlation: Any, count: int) -> Array | None:
    """Return the root of a correlation, None for independent sizes."""
    if correlation is None:
        return None
    given = numbers(correlation, "correlation")
    if given.shape != (count, count) or not np.allclose(given, given.T) or not np.allclose(np.diag(given), 1.0):
        allowed = f"a symmetric ({count}, {count}) array with ones on its diagonal"
        raise InputError("unusable correlation", key="correlation", found=correlation, allowed=allowed)
    values, vectors = np.linalg.eigh(given)
    if values.min() < -1e-12:
        allowed = "no eigenvalue < 0"
        raise InputError("no sizes have this correlation", key="correlation", found=correlation, allowed=allowed)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _drawn(
    rng: np.random.Generator, sources: Sequence[Distribution | float], count: int, mixed: Array | None = None
) -> Array:
    """Return deviations drawn, (k, count): independently, or tied by the normal scores of their ranks."""
    found = np.empty((len(sources), count))
    if mixed is not None:
        from scipy.special import ndtr

        shares = ndtr(mixed @ rng.standard_normal(found.shape))
    for k, source in enumerate(sources):
        if mixed is None and isinstance(source, Normal) and _whole(source):  # the quickest way
            found[k] = source.mean + source.deviation * rng.standard_normal(count)
        else:
            found[k] = at_shares(source, rng.random(count) if mixed is None else shares[k])
    return found


def at_shares(source: Distribution | float, shares: Array) -> Array:
    """Return the deviations below which shares of all lie; the one that there is where there is just one."""
    return np.full(shares.shape, source) if isinstance(source, float) else source.quantile(shares)


BLOCK = 2**11  # pairs of parts that are drawn at a time
WORK, FEWEST, MOST_DRAWS = 2**25, 2**12, 2**17  # rows times sizes times draws, and draws


class GapSpread(NamedTuple):
    """How the gap changes with the sizes over all pairs of parts.

    `slopes`, (k,), are its mean change a unit of each size, `variances`, (k,), Shapley effects: what each size
    contributes to the variance of the gap; they add up to it. `elsewhere` is the share of the pairs of parts whose gap
    is not that of the row asked about.
    """

    slopes: Array
    variances: Array
    elsewhere: float


def gap_spread(touching: TouchingSizes, row: Array) -> GapSpread:
    """Return how the gap is spread over the pairs of parts as independent sizes are distributed.

    `GapSpread.elsewhere` is about the given row, (1 + k,).
    Of two pairs of parts x and y the sizes of x become those of y one after another, in random order, and the gap
    changes by as much as each size then does. Half the mean of these changes times g(x) - g(y) are the Shapley effects
    (A. B. Owen, Sobol' indices and Shapley value, SIAM/ASA Journal on Uncertainty Quantification 2 (2014); averaged
    over both directions, the estimator of T. Goda, Reliability Engineering and System Safety 213 (2021)). They are
    drawn by a Sobol' sequence, sizes in the order of their names; what is linear in the sizes is taken exactly.
    """
    from scipy.stats.qmc import Sobol

    rows, starts = touching.stacked
    named = sorted(range(len(touching.sizes)), key=lambda k: touching.sizes[k].name)
    own_column, columns = np.argsort(named), np.append(0, 1 + np.array(named, np.int64))
    rows, row, sources = rows[:, columns], row[columns], spreads([touching.sizes[k] for k in named])
    deviations = moments(sources)[1]
    if len(rows) == 1:
        return GapSpread(rows[0, 1:][own_column], ((rows[0, 1:] * deviations) ** 2)[own_column], 0.0)
    count, near = len(sources), DEFAULT.tie * max(body.size for body in touching.bodies)
    draws = int(np.clip(2 ** np.ceil(np.log2(WORK / rows.size)), FEWEST, MOST_DRAWS))
    sequence, each = Sobol(3 * count, rng=np.random.default_rng(1)), np.arange(BLOCK)
    straight, slopes, variances, elsewhere = None, np.zeros(count), np.zeros(count), 0.0
    for _ in range(0, draws, BLOCK):
        u = sequence.random(BLOCK).T
        x, y = (
            np.array([at_shares(own, share) for own, share in zip(sources, shares, strict=True)])
            for shares in (u[:count], u[count : 2 * count])
        )
        heights = rows[:, 1:] @ x + rows[:, :1]
        first = before = least_of_largest(heights, starts)
        deciding = heights == first
        slopes += rows[:, 1:].T @ (deciding / deciding.sum(axis=0)).sum(axis=1)
        elsewhere += np.count_nonzero(np.abs(row[0] + row[1:] @ x - first) > near)
        changes = np.empty_like(x)
        for own in u[2 * count :].argsort(axis=0):
            heights += rows[:, 1 + own] * (y[own, each] - x[own, each])
            after = least_of_largest(heights, starts)
            changes[own, each], before = before - after, after
        straight = slopes / BLOCK if straight is None else straight
        linear = straight[:, None] * (x - y)
        variances += (changes * (first - before) - linear * linear.sum(axis=0)).sum(axis=1)
    variances = variances / (2.0 * draws) + ((0.0 if straight is None else straight) * deviations) ** 2
    return GapSpread(slopes[own_column] / draws, np.maximum(variances, 0.0)[own_column], float(elsewhere / draws))


def worst_rows(touching: TouchingSizes) -> tuple[Array, Array]:
    """Return the rows, (m, 1 + k), that the least gap in the box is due to, and their weights, which add up to 1.

    Rows that are all as low count alike, each once, however many part pairs have it. Of a pair whose least gap is no
    row's alone several rows count as one, in proportions in which they prove it.
    """
    box, (least, _) = touching.box, touching.least()
    middle, half = box.mean(axis=1), np.ptp(box, axis=1) / 2.0
    near = DEFAULT.tie * max(body.size for body in touching.bodies)
    found: list[tuple[Array, Array]] = []
    for pair, (own, _) in zip(touching.pairs, touching.leasts, strict=True):
        if own > least + near:
            continue
        rates = pair.values[:, 1:]
        heights = pair.values[:, 0] + rates @ middle
        alone = np.flatnonzero(heights - np.abs(rates) @ half >= own - near)
        shares = np.eye(len(heights))[alone] if len(alone) else [mixture(np.column_stack([heights, rates]), half)]
        found += [(pair.values[share > 0.0], share[share > 0.0] / share.sum()) for share in shares]
    distinct: list[tuple[Array, Array]] = []
    for rows, weights in found:
        same = (weights @ rows - other @ those for those, other in distinct)
        if all(abs(off[0]) + np.abs(off[1:]) @ half > near for off in same):
            distinct.append((rows, weights))
    return np.vstack([rows for rows, _ in distinct]), np.concatenate([own for _, own in distinct]) / len(distinct)


def mixture(rows: Array, half: Array) -> Array:
    """Return the weights of the mix of rows (m, 1 + k) whose least over all sizes within `half` of zero is largest.

    They are >= 0 and add up to 1; by duality that least is the one of the largest row.
    """
    from scipy.optimize import linprog

    scaled, count = rows[:, 1:] * half, len(half)
    # the largest of mixture . gaps - sum of s, s >= |mixture . scaled|
    cost = np.concatenate([-rows[:, 0], np.ones(count)])
    left = np.vstack([np.hstack([sign * scaled.T, -np.eye(count)]) for sign in (1.0, -1.0)])
    found = linprog(cost, left, np.zeros(2 * count), np.concatenate([np.ones(len(rows)), np.zeros(count)])[None], [1.0])
    return np.asarray(found.x[: len(rows)])
