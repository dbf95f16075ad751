"""How well a share is known from a count."""

from __future__ import annotations


def proportion_interval(passed: int | tuple[int, int], count: int, confidence: float) -> tuple[float, float]:
    """Return the Clopper-Pearson interval of a share: it holds the true one at least as often as asked.

    Parameters
    ----------
    passed : int, or pair of int
        How many of `count` independent draws passed; two numbers where only bounds of it are known.
    count : int
        Draws, at least one.
    confidence : float
        Between 0 and 1.
    """
    from scipy.stats import binomtest

    least, most = passed if isinstance(passed, tuple) else (passed, passed)
    low, high = (binomtest(some, count).proportion_ci(confidence, method="exact") for some in (least, most))
    return float(low.low), float(high.high)
