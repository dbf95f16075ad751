"""Sobol indices: which share of the amount's variance is due to which size."""

from __future__ import annotations

import numpy as np

from fcdm_opt.geometry.arrays import Array


def sobol_indices(f: Array, g: Array, h: Array, k: Array) -> tuple[Array, Array]:
    """Return both sizes' Sobol indices from the amounts of pairs (x, y), (x', y), (x, y'), (x', y').

    The means of u = (f - g)^2 + (h - k)^2, v = (f - h)^2 + (g - k)^2 and w = (f - g - h + k)^2 are four times the
    variance due to x with what both do together, due to y likewise, and what both do together alone; u + v - w =
    (f - k)^2 + (g - h)^2 is four times all of it. (`scipy.stats.sobol_indices` knows no pairs without a motion, asks
    for a power of two of them, and its indices do not add up as these do.)

    Parameters
    ----------
    f, g, h, k : array (n,)
        Quadruples with nan are left out.

    Returns
    -------
    array (2, 2), array (2, 2)
        For either size its first-order and its total index, and their standard errors; nan where the amount does not
        vary.
    """
    terms = np.array([(f - g) ** 2 + (h - k) ** 2, (f - h) ** 2 + (g - k) ** 2, (f - g - h + k) ** 2])
    terms = terms[:, np.isfinite(terms).all(axis=0)]
    sums, all_of_it = terms.sum(axis=1), np.array([1.0, 1.0, -1.0])
    whole, count = float(all_of_it @ sums), terms.shape[1]
    if count < 2 or not whole > 0.0:
        return np.full((2, 2), np.nan), np.full((2, 2), np.nan)
    taken = np.array([[[1.0, 0.0, -1.0], [1.0, 0.0, 0.0]], [[0.0, 1.0, -1.0], [0.0, 1.0, 0.0]]])
    indices = taken @ sums / whole
    slopes = (taken - indices[..., None] * all_of_it) / whole
    variances = np.einsum("abi,ij,abj->ab", slopes, count * np.cov(terms, bias=True), slopes)
    return indices, np.sqrt(np.maximum(variances, 0.0))
