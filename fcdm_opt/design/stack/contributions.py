"""What each size contributes to a gap: to how it is spread over all pairs of parts, and to its worst case."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcdm_opt.curve.touching_sizes import TouchingSizes
from fcdm_opt.design.stack.spread import at_shares, least_of_largest, moments, spreads
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerances import DEFAULT

CHUNK = 2**11  # pairs of parts that are drawn at a time
WORK, FEWEST, MOST = 2**25, 2**12, 2**17  # rows times sizes times draws, and draws


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
    draws = int(np.clip(2 ** np.ceil(np.log2(WORK / rows.size)), FEWEST, MOST))
    sequence, each = Sobol(3 * count, rng=np.random.default_rng(1)), np.arange(CHUNK)
    straight, slopes, variances, elsewhere = None, np.zeros(count), np.zeros(count), 0.0
    for _ in range(0, draws, CHUNK):
        u = sequence.random(CHUNK).T
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
        straight = slopes / CHUNK if straight is None else straight
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
