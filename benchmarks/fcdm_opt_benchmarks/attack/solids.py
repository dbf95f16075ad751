"""Ordinary parts: corners of convex pieces, drawn in their nominal place, lengths of 1 to 10."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcdm_opt_benchmarks.shapes import Array, box, polygon, prism

Pieces = list[Array]


class Fit(NamedTuple):
    """Two parts in their nominal place.

    Attributes
    ----------
    movable, static : lists of (n, 3) arrays
        Corners of their convex pieces.
    flush : float or None
        Height z of the one plane in which faces of both rest on each other, the movable part above.
    round : bool
        Whether it has many faces: questions about it cost more.
    """

    movable: Pieces
    static: Pieces
    flush: float | None = None
    round: bool = False


def circle(count: int, radius: float) -> Array:
    """Return the corners of a polygon, (n, 2)."""
    return radius * polygon(count)


def ring(count: int, inner: float, outer: float, low: float, high: float) -> Pieces:
    """Return a ring as sectors between two polygons."""
    a, b = circle(count, inner), circle(count, outer)
    nexts = [(k, (k + 1) % count) for k in range(count)]
    return [prism([a[i], a[j], b[j], b[i]], low, high) for i, j in nexts]


def walls(hole: float, half: float, low: float, high: float) -> Pieces:
    """Return a block with a square hole, as four walls."""
    return [
        box((-half, -half, low), (-hole, half, high)),
        box((hole, -half, low), (half, half, high)),
        box((-hole, -half, low), (hole, -hole, high)),
        box((-hole, hole, low), (hole, half, high)),
    ]


def _play(rng: np.random.Generator) -> float:
    return float(rng.choice([0.003, 0.01, 0.02, 0.05]))


def _boxes(rng: np.random.Generator) -> Fit:
    a, b = rng.integers(2, 9, size=(2, 3)) / 4
    middle = rng.integers(-6, 7, size=3) / 4
    if np.all(np.abs(middle) < 0.3):
        middle[2] = 1.0
    return Fit([box(middle - a / 2, middle + a / 2)], [box(-b / 2, b / 2)])


def _slab(rng: np.random.Generator) -> Fit:
    a, b, h = rng.integers(2, 8, size=3) / 4
    x = float(rng.integers(-2, 3)) / 4
    return Fit([box((x - a, -b, 0), (x + a, b, h))], [box((-3, -3, -1), (3, 3, 0))], 0.0)


def _ell(rng: np.random.Generator) -> Fit:
    g = float(rng.choice([0.0, 0.02, 0.25]))
    return Fit([box((0, -1, 0), (3, 1, 1)), box((0, -1, 1), (1, 1, 3))], [box((1 + g, -1.5, 1), (3, 1.5, 2.5))])


def _you(rng: np.random.Generator) -> Fit:
    p = _play(rng)
    rail = box((-1, -4, -1.5), (1, 4, 0))
    return Fit(
        [box((-2, -1, 0), (2, 1, 1)), box((-2, -1, -1), (-1 - p, 1, 0)), box((1 + p, -1, -1), (2, 1, 0))], [rail], 0.0
    )


def _tee(rng: np.random.Generator) -> Fit:
    p = _play(rng)
    nut = [box((-2 + p, -1, p), (2 - p, 1, 1 - p)), box((-1 + p, -1, 1 - p), (1 - p, 1, 2.5))]
    rail = [box((-3, -3, -1), (3, 3, 0))]
    rail += [box((s * 2.5 - 0.5, -3, 0), (s * 2.5 + 0.5, 3, 2)) for s in (-1, 1)]
    rail += [box((min(s, s * 2), -3, 1), (max(s, s * 2), 3, 2)) for s in (-1, 1)]
    return Fit(nut, rail)


def _step(rng: np.random.Generator) -> Fit:
    g = float(rng.choice([0.0, 0.01, 0.1]))
    lower = [box((-2, -2, -1), (2, 2, 0)), box((-2, -2, 0), (0, 2, 1))]
    return Fit([box((g, -1, 0), (2, 1, 2)), box((-1.5, -1, 1 + g), (g, 1, 2))], lower)


def _stair(rng: np.random.Generator) -> Fit:
    g = float(rng.choice([0.0, 0.01, 0.1]))
    stair = [box((k, -1, 0), (4, 1, k + 1)) for k in range(3)]
    shoe = [box((k - 1 + g, -0.75, k + g), (k - g, 0.75, 4)) for k in range(3)]
    return Fit(shoe, stair)


def _peg(rng: np.random.Generator) -> Fit:
    p = _play(rng)
    return Fit([box((-1 + p, -1 + p, 0.5), (1 - p, 1 - p, 4))], walls(1.0, 2.5, 0.0, 3.0))


def _headed(rng: np.random.Generator) -> Fit:
    p = float(rng.choice([0.02, 0.05, 0.12]))
    peg = [box((-1 + p, -1 + p, -2), (1 - p, 1 - p, 0)), box((-2, -2, 0), (2, 2, 1))]
    return Fit(peg, walls(1.0, 2.5, -3.0, 0.0), 0.0)


def _round(rng: np.random.Generator) -> Fit:
    n, p = int(rng.choice([6, 8])), _play(rng)
    return Fit([prism(circle(n, 1 - p), -1, 2)], ring(n, 1.0, 2.0, -1.5, 1.5), None, True)


def _shaft(rng: np.random.Generator) -> Fit:
    n, p = int(rng.choice([6, 8])), float(rng.choice([0.05, 0.12]))
    shaft = [prism(circle(n, 1 - p), -1, 0), prism(circle(n, 1.5), 0, 1)]
    return Fit(shaft, ring(n, 1.0, 2.0, -1.5, 0.0), 0.0, True)


def _dovetail(rng: np.random.Generator) -> Fit:
    p = _play(rng)
    turn = np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]])  # a prism along z becomes one along x

    def bar(outline: object, half: float) -> Array:
        return prism(outline, -half, half) @ turn.T

    slide = bar([(-1.5 + p, p), (1.5 - p, p), (1 - p, 1), (-1 + p, 1)], 1.0)
    sides = [bar([(s * 1.5, 0), (s * 3, 0), (s * 3, 1), (s * 1.0, 1)], 2.0) for s in (-1, 1)]
    return Fit([slide], [bar([(-3, -1), (3, -1), (3, 0), (-3, 0)], 2.0), *sides])


def _lid(rng: np.random.Generator) -> Fit:
    p = float(rng.choice([0.02, 0.05, 0.12]))
    lid = [box((-2, -2, 0), (2, 2, 0.5)), box((-1.5 + p, -1.5 + p, -0.5), (1.5 - p, 1.5 - p, 0))]
    return Fit(lid, [*walls(1.5, 2.0, -2.0, 0.0), box((-2, -2, -2.5), (2, 2, -2))], 0.0)


def _comb(rng: np.random.Generator) -> Fit:
    p = float(rng.choice([0.02, 0.05, 0.1]))
    teeth = int(rng.integers(2, 5))
    comb = [box((0, -0.5, 1.25), (2.0 * teeth - 1, 0.5, 2))]
    comb += [box((2 * k, -0.5, 0), (2 * k + 1, 0.5, 1.25)) for k in range(teeth)]
    rack = [box((-1, -1, -1), (2.0 * teeth, 1, 0))]
    rack += [box((2 * k - 1 + p, -1, 0), (2 * k - p, 1, 1)) for k in range(teeth + 1)]
    return Fit(comb, rack, 0.0)


def _plate(rng: np.random.Generator) -> Fit:
    p = float(rng.choice([0.02, 0.05, 0.12]))
    bars = [
        ((-3, -1.5), (3, -0.5)),
        ((-3, 0.5), (3, 1.5)),
        ((-3, -0.5), (-2, 0.5)),
        ((-1, -0.5), (1, 0.5)),
        ((2, -0.5), (3, 0.5)),
    ]
    plate = [box((*low, 0), (*high, 0.75)) for low, high in bars]
    h = 0.5 - p
    pins = [box((x - h, -h, 0), (x + h, h, 1.5)) for x in (-1.5, 1.5)]
    return Fit(plate, [box((-4, -2, -1), (4, 2, 0)), *pins], 0.0)


def _foot(rng: np.random.Generator) -> Fit:
    n = int(rng.choice([6, 8, 12]))
    return Fit(ring(n, 1.0, 1.5, 0.0, 0.75), [box((-2.5, -2.5, -1), (2.5, 2.5, 0))], 0.0, True)


def _wedge(rng: np.random.Generator) -> Fit:
    slope = float(rng.choice([0.1, 0.25, 0.5]))
    g = float(rng.choice([0.0, 0.02, 0.2]))
    lower = np.array([[x, y, z] for y in (-1, 1) for x, z in ((0, 0), (4, 0), (4, 4 * slope))])
    upper = [[x, y, z] for y in (-0.5, 0.5) for x, z in ((1, slope), (3, 3 * slope), (3, 2.5), (1, 2.5))]
    return Fit([np.array(upper) + np.array([0, 0, g])], [lower])


def _hulls(rng: np.random.Generator) -> Fit:
    def ball() -> Array:
        points = rng.normal(size=(int(rng.integers(6, 10)), 3))
        return points / np.linalg.norm(points, axis=1, keepdims=True) * rng.uniform(0.7, 1.3, size=(len(points), 1))

    u = rng.normal(size=3)
    return Fit([ball() + u / np.linalg.norm(u) * rng.uniform(1.2, 2.4)], [ball()])


def no_play(rng: np.random.Generator) -> Fit:
    """Return a square peg that exactly fills its hole, with or without a head."""
    head = [box((-2, -2, 3), (2, 2, 4))] if rng.random() < 0.5 else []
    return Fit([box((-1, -1, 0), (1, 1, 4)), *head], walls(1.0, 2.0 + float(rng.integers(0, 2)), 0.0, 3.0))


FITS = {
    "boxes": _boxes, "slab": _slab, "L": _ell, "U": _you, "T-nut": _tee, "step": _step, "stair": _stair, "peg": _peg,
    "headed peg": _headed, "round peg": _round, "shaft": _shaft, "dovetail": _dovetail, "lid": _lid, "comb": _comb,
    "plate": _plate, "foot": _foot, "wedge": _wedge, "hulls": _hulls,
}  # fmt: skip
"""By name: a function that draws a fit of this kind."""
