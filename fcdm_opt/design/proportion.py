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

    Notes
    -----
    Source: C. J. Clopper, E. S. Pearson, The use of confidence or fiducial limits illustrated in the case of the
    binomial, Biometrika 26 (1934). Its ends are quantiles of beta distributions.
    """
    from scipy.special import betainccinv, betaincinv

    least, most = passed if isinstance(passed, tuple) else (passed, passed)
    tail = (1.0 - confidence) / 2.0
    low = float(betaincinv(least, count - least + 1, tail)) if least > 0 else 0.0
    high = float(betainccinv(most + 1, count - most, tail)) if most < count else 1.0
    return low, high
