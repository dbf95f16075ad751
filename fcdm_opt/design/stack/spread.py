"""How sizes are distributed, and the gaps that follow: drawn many times, rows of the stack-up alone being asked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fcdm_opt.curve.touching_sizes import TouchingSizes
from fcdm_opt.design.distributions import ALL, Distribution, Measured, Normal, Uniform
from fcdm_opt.design.sizes import proportion_interval
from fcdm_opt.errors import InputError, placed
from fcdm_opt.geometry.arrays import Array, frozen, numbers
from fcdm_opt.geometry.size import Size
from fcdm_opt.judge.sampled_sizes import GapClaims, ShareClaim
from fcdm_opt.plain import Plain
from fcdm_opt.problem.arguments import positive, real, whole
from fcdm_opt.tolerances import DEFAULT

CHUNK = 2**13  # pairs of parts that are drawn at a time: what they need stays in the processor's cache
MOST = 10**9
OTHERS, SEED = 100_000, 20_011  # pairs of parts drawn otherwise, to judge a share by
BINS = 200  # of the gaps that are kept for pictures


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
    limits : (float, float)
    edges, counts : arrays (bins + 1,), (bins,)
        Histogram of the gaps over the range that the tolerances allow, with what lies beyond in the outer bins.
    claimed : GapClaims, optional
        What is told of the gap, which `verify` looks at with the share; without one for sizes that depend on others.
    """

    plain_names = (
        "share", "interval", "share_low", "share_high", "count", "confidence", "mean", "deviation", "least", "largest",
        "limits", "edges", "counts",
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
    claimed: GapClaims | None = field(default=None, repr=False)

    def claims(self, *, proof: bool = False) -> GapClaims:
        """Return what `verify` looks at: the gap at all sizes, and the share by draws of their own."""
        if self.claimed is None or self.claimed.told is None:
            raise InputError("what is drawn of sizes that depend on each other is not judged", key="correlation")
        gaps = self.claimed.told(draws(self.claimed.sizes, OTHERS, SEED))
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
    """Return the normal distribution of a size that is told by its standard deviation."""
    if wrong := [name for name in told if name not in ("sigma", "mean", "low", "high")]:
        allowed = "mean, low and high"
        raise InputError("not with sigma", key=f"{key}.normal.{wrong[0]}", found=told[wrong[0]], allowed=allowed)
    with placed(key=key):
        ends = {name: told[name] for name in ("low", "high") if name in told}
        sigma = positive(told["sigma"], "normal.sigma")
        return Normal(told.get("mean", size.middle), sigma, **ends)


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
    bodies, pose = touching.bodies, touching.transform
    return TouchingSizes.of(*bodies, wider, transform=pose, standing=False)


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
    heights = heights - zero
    low, high = limits[0] - zero, limits[1] - zero
    ends = float((heights - swing).min()), float((heights + swing).max())
    edges = np.linspace(ends[0], ends[1] if ends[1] > ends[0] else ends[0] + 1.0, BINS + 1)
    counts, total, square = np.zeros(BINS, np.int64), 0.0, 0.0
    within = [(low, high), (low + off[1], high - off[0]), (low - off[0], high + off[1])]
    passed = np.zeros(3, np.int64)
    least, largest = np.inf, -np.inf
    draw = _Draw.of(rows, spreads(touching.sizes), correlation, zero)
    for begin in range(0, count, CHUNK):
        products = draw(rng)
        if len(starts) > 1:
            products = np.maximum.reduceat(products, starts, axis=0)
        best = np.minimum if len(starts) > 1 else np.maximum
        gaps = best.reduce(products, axis=0)[: count - begin].astype(float)
        passed += [np.count_nonzero((gaps >= a) & (gaps <= b)) for a, b in within]
        least, largest = min(least, float(gaps.min())), max(largest, float(gaps.max()))
        total += float(gaps.sum())
        square += float(gaps @ gaps)
        if begin < 2**21:  # enough for a picture
            bins = ((gaps - edges[0]) * (BINS / (edges[-1] - edges[0]))).astype(np.int64)
            counts += np.bincount(np.clip(bins, 0, BINS - 1), minlength=BINS)
    mean = total / count
    deviation = float(np.sqrt(max(square / count - mean**2, 0.0)))
    share, surely, possibly = (passed / count).tolist()
    interval = proportion_interval(int(passed[0]), count, confidence)
    return GapYield(
        share, interval, surely, possibly, count, confidence, zero + mean, deviation, zero + least, zero + largest,
        limits, frozen(zero + edges), frozen(counts),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Draw:
    """Draws the heights of rows: of normal sizes together, of others each.

    Rows of more normal sizes than there are rows are as those of as many as rows. Seven digits of how much sizes
    deviate are enough where their distributions are smooth; of measured sizes all are kept.
    """

    heights: Any
    factor: Any
    normal: int
    others: tuple[Distribution | float, ...]
    mixed: Array | None
    room: tuple[Any, Any]

    @classmethod
    def of(cls, rows: Array, sources: Sequence[Distribution | float], correlation: Any, zero: float) -> _Draw:
        """Return it; `zero` is subtracted from the heights."""
        mixed, rates = _mixed(correlation, len(sources)), rows[:, 1:]
        straight = [isinstance(own, float) or (isinstance(own, Normal) and _whole(own)) for own in sources]
        if mixed is not None and not all(straight):  # they are tied by their ranks
            straight = [False] * len(sources)
        means, deviations = moments(sources)
        scores = rates[:, straight] * deviations[straight]
        if mixed is not None and all(straight):
            scores, mixed = scores @ mixed, None
        scores = scores[:, scores.any(axis=0)]
        if scores.shape[1] > len(rows):
            scores = np.linalg.qr(scores.T)[1].T
        others = [k for k, own in enumerate(straight) if not own]
        fine = np.float32 if all(isinstance(sources[k], Uniform) for k in others) and mixed is None else np.float64
        factor = np.column_stack([scores, rates[:, others]]).astype(fine)
        heights = (rows[:, 0] - zero + rates[:, straight] @ means[straight])[:, None]
        for k in others if fine is np.float32 else ():
            heights = heights + rates[:, k : k + 1] * means[k]
        room = np.empty((factor.shape[1], CHUNK), fine), np.empty((len(rows), CHUNK), fine)
        return cls(heights.astype(fine), factor, scores.shape[1], tuple(sources[k] for k in others), mixed, room)

    def __call__(self, rng: np.random.Generator) -> Any:
        places, products = self.room
        if self.normal:
            places[: self.normal] = _scores(rng, self.normal * CHUNK).reshape(self.normal, CHUNK)
        if products.dtype == np.float32:
            for row, source in zip(places[self.normal :], self.others, strict=True):
                assert isinstance(source, Uniform)
                rng.random(dtype=np.float32, out=row)
                row -= np.float32(0.5)
                row *= np.float32(source.high - source.low)
        else:
            _draw(rng, self.others, self.mixed, places[self.normal :])
        np.matmul(self.factor, places, out=products)
        products += self.heights
        return products


def _scores(rng: np.random.Generator, count: int) -> Any:
    """Return standard normal numbers by Box and Muller, up to 6.7 and with seven digits."""
    drawn = rng.bit_generator.random_raw(count // 2).view(np.uint32).astype(np.float32)
    drawn += np.float32(0.5)
    drawn *= np.float32(2.0**-32)
    away, angle = drawn[: count // 2], drawn[count // 2 :]
    np.log(away, out=away)
    away *= np.float32(-2.0)
    np.sqrt(away, out=away)
    angle *= np.float32(2.0 * np.pi)
    across = np.sin(angle)
    np.cos(angle, out=angle)
    angle *= away
    away *= across
    return drawn


def draws(sizes: Sequence[Size], count: int, seed: int) -> Array:
    """Return deviations as sizes are distributed, independently, (count, k)."""
    found = np.empty((len(sizes), count))
    _draw(np.random.Generator(np.random.SFC64(seed)), spreads(sizes), None, found)
    return found.T


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


def _draw(rng: np.random.Generator, sources: Sequence[Distribution | float], mixed: Array | None, out: Array) -> None:
    """Fill rows of an array with draws."""
    if mixed is not None:
        from scipy.special import ndtr

        scores = mixed @ rng.standard_normal(out.shape)
    for k, source in enumerate(sources):
        row = out[k]
        if isinstance(source, float):
            row[:] = source
        elif isinstance(source, Normal) and _whole(source):
            if mixed is None:
                rng.standard_normal(out=row)
            else:
                row[:] = scores[k]
            row *= source.deviation
            row += source.mean
        elif mixed is not None:
            row[:] = source.quantile(ndtr(scores[k]))
        elif isinstance(source, Uniform):
            rng.random(out=row)
            row *= source.high - source.low
            row += source.low
        else:
            row[:] = source.quantile(rng.random(len(row)))
