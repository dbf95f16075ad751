"""The point in which two scaled parts touch."""

from __future__ import annotations

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.tolerances import DEFAULT


def contact_point(one: ConvexPart, two: ConvexPart, pose: Array, normal: Array, rho: Array) -> Array:
    """Return a common point of the two scaled parts, relative to the seed of body 2, world axes.

    Parameters
    ----------
    one, two : ConvexPart
    pose : (12,) array
        R, row by row, and d.
    normal : (3,) array
        Direction in which the parts support each other, from body 1 to body 2.
    rho : (2,) array
        A scale pair on the contact line of `normal`.
    """
    R, d = pose[:9].reshape(3, 3), pose[9:]
    X = rho[0] * _top((one.vertices - one.seed) @ R.T, normal) - d
    Y = rho[1] * _top(two.vertices - two.seed, -normal)
    if len(X) == 1:
        return X[0]
    if len(Y) == 1:
        return Y[0]
    from scipy.optimize import nnls

    # weights of both supporting elements, non-negative and each adding up to one, that give the same point
    scale = max(np.abs(X).max(), np.abs(Y).max())
    ones = np.concatenate([np.ones(len(X)), np.zeros(len(Y))])
    system = np.vstack([np.column_stack([X.T, -Y.T]) / scale, ones, 1.0 - ones])
    weights, _ = nnls(system, np.array([0.0, 0.0, 0.0, 1.0, 1.0]))
    return (weights[: len(X)] @ X + weights[len(X) :] @ Y) / weights[: len(X)].sum() / 2.0


def _top(X: Array, n: Array) -> Array:
    """Return the vertices on which n.x is largest."""
    heights = X @ n
    return X[heights >= heights.max() - DEFAULT.tie * np.abs(X).max()]
