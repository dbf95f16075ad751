"""Whether convex parts stay divided by planes along a motion, or only come apart: then none goes through another."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.solids import kept_as_surface
from fcdm_opt.tolerances import DEFAULT

MOST_PAIRS = 256  # pairs of convex parts up to which planes between them are looked for

Sizes = list[tuple[Body, Body, float, float]]  # of both bodies: as drawn, as made, and at which scale each


class _HalfSpaces(NamedTuple):
    """Convex parts about a body's seed: corners, (n, 3), facets' normals and levels, (f, 3), (f,); the parts' first."""

    seed: Array
    points: Array
    normals: Array
    levels: Array
    corners: Ints
    facets: Ints

    def is_like(self, other: _HalfSpaces) -> bool:
        """Tell whether another body has as many corners and facets, and these look alike."""
        same = self.points.shape == other.points.shape and np.array_equal(self.facets, other.facets)
        same = same and np.array_equal(self.seed, other.seed) and self.normals.shape == other.normals.shape
        return same and np.abs(self.normals - other.normals).max() <= DEFAULT.tie


@lru_cache(maxsize=16)
def _half_spaces(body: Body) -> _HalfSpaces:
    normals, points = np.concatenate([part.normals for part in body.parts]), [part.vertices for part in body.parts]
    levels = np.concatenate([part.levels for part in body.parts]) - normals @ body.seed
    firsts = (np.cumsum([0, *own[:-1]]) for own in ([*map(len, points)], [len(part.loops) for part in body.parts]))
    return _HalfSpaces(body.seed, np.concatenate(points) - body.seed, normals, levels, *firsts)


def stay_divided(sizes: Sizes, shares: Array, poses: Array, slack: float) -> bool:
    """Tell whether every two convex parts have the plane of a facet between them at both ends of each step.

    Seen from the body that the facet is of, the other one's corners are taken to go straight on in a step, as `passes`
    takes them, and sizes move planes and corners in proportion: a plane that is between two parts at both ends is so
    all along. Of parts that overlap at first it is enough that they do so less and less, until they are apart, along
    the facet's normal on which they are the least deep in each other: they go back where they came from.

    `shares`, (s,), are of the way, at the ends of the steps, `poses`, (s, 4, 4), of body 1 there; `slack` is a length
    by which a corner may be beyond a plane.
    """
    (drawn, made, *_), (other, others, *_) = sizes
    if kept_as_surface(drawn, other) or len(made.parts) * len(others.parts) > MOST_PAIRS:
        return False
    was, now = ([_half_spaces(own) for own in both] for both in ((drawn, other), (made, others)))
    if not all(x is y or x.is_like(y) for x, y in zip(was, now, strict=True)):
        return False
    both = [
        ((1.0 - shares)[:, None] * before, x, shares[:, None] * after, y)
        for (_, _, before, after), x, y in zip(sizes, was, now, strict=True)
    ]
    corners = [a[..., None] * x.points + b[..., None] * y.points for a, x, b, y in both]
    levels = [a * x.levels + b * y.levels for a, x, b, y in both]
    (one, two), turns = now, poses[:, :3, :3]
    offsets = (turns @ one.seed + poses[:, :3, 3] - two.seed)[:, None]
    seen = corners[0] @ turns.transpose(0, 2, 1) + offsets, (corners[1] - offsets) @ turns  # each from the other body
    gaps = [
        np.minimum.reduceat(points @ own.normals.T - heights[:, None], its.corners, axis=1)
        for points, its, own, heights in zip(seen, (one, two), (two, one), levels[::-1], strict=True)
    ]
    widest = [np.maximum.reduceat(own[0], its.facets, axis=1) for own, its in zip(gaps, (two, one), strict=True)]
    start = np.maximum(widest[0], widest[1].T) - slack
    divided = [
        _divided(own, its.facets, first, slack)
        for own, its, first in zip(gaps, (two, one), (start, start.T), strict=True)
    ]
    return bool((divided[0] | divided[1].transpose(0, 2, 1)).all())


def _divided(gaps: Array, facets: Ints, start: Array, slack: float) -> Flags:
    """Tell of gaps of parts to planes, (s, k, f), which of another one's is between two parts in each step."""
    # or else is one to which the gap is `start`, (k, l), at first, grows in every step, and is none at last
    above = gaps >= -slack
    parting = (gaps[1:] >= gaps[:-1] - slack).all(axis=0) & above[-1]
    first = np.repeat(start, np.diff(facets, append=gaps.shape[2]), axis=1)
    return np.logical_or.reduceat((above[1:] & above[:-1]) | (parting & (gaps[0] >= first)), facets, axis=2)
