"""Ordinary parts as they are drawn, faces along the axes and flush: plain data, lengths in mm, unions of prisms.

Each is a pair (movable, static) of its convex parts and its seed; the answers in closed form stand beside it.
"""

from __future__ import annotations

from typing import NamedTuple

from fcdm_opt_benchmarks.shapes import Array, box, prism


class DrawnPart(NamedTuple):
    """The corners of each convex part of a solid, and its seed."""

    parts: tuple[Array, ...]
    seed: tuple[float, float, float]


class DrawnParts(NamedTuple):
    """Two parts that belong together."""

    movable: DrawnPart
    static: DrawnPart


def _along_y(outline: list[tuple[float, float]], low: float, high: float) -> Array:
    """Return the corners of a prism along y over an outline in x and z."""
    return prism(outline, low, high)[:, [0, 2, 1]]


def _walls(half: float, outer: float, low: float, high: float) -> tuple[Array, ...]:
    """Return four walls about the z axis, their inner sides at |x| and |y| = half."""
    return (
        box((half, -outer, low), (outer, outer, high)),
        box((-outer, -outer, low), (-half, outer, high)),
        box((-half, half, low), (half, outer, high)),
        box((-half, -outer, low), (half, -half, high)),
    )


DOVETAIL = DrawnParts(
    DrawnPart(
        (
            box((-25, -10, 9), (25, 10, 16)),
            _along_y([(10.5, 0), (25, 0), (25, 9), (15, 9)], -10, 10),
            _along_y([(-10.5, 0), (-25, 0), (-25, 9), (-15, 9)], -10, 10),
        ),
        (0, 0, 8),
    ),
    DrawnPart(
        (box((-25, -40, -8), (25, 40, 0)), _along_y([(-10, 0), (10, 0), (14, 8), (-14, 8)], -40, 40)), (0, 0, -4)
    ),
)
"""A slide on the shoulders of its rail: gaps 12 - 8 rho_1 - 4 rho_2 + TZ of the shoulders, 12 + rho_1 - 12 rho_2 + TZ
of the roof, (29 rho_1 - 16 rho_2 - 12 - TZ -+ 2 TX) / sqrt(5) of the flanks."""

LID = DrawnParts(
    DrawnPart((box((-20, -15, 0), (20, 15, 4)), box((-17.5, -12.5, -3), (17.5, 12.5, 0))), (0, 0, 2)),
    DrawnPart(
        (
            box((-20, -15, -20), (20, 15, -18)),
            box((18, -15, -18), (20, 15, 0)),
            box((-20, -15, -18), (-18, 15, 0)),
            box((-18, 13, -18), (18, 15, 0)),
            box((-18, -15, -18), (18, -13, 0)),
        ),
        (0, 0, -10),
    ),
)
"""A lid on the rim of a box: gaps 12 - 2 rho_1 - 10 rho_2 + TZ of the rim, 18 rho_2 - 17.5 rho_1 -+ TX and
13 rho_2 - 12.5 rho_1 -+ TY of the plug."""

PEG = DrawnParts(
    DrawnPart((box((-9.5, -9.875, -10), (10, 9.625, 20)),), (0.25, -0.125, 5)),
    DrawnPart(_walls(10, 25, 0, 10), (0, 0, 5)),
)
"""A square peg at a wall of its hole: with S = 10 rho_2 - 9.75 rho_1 gaps S -+ (0.25 + TX) and S -+ (TY - 0.125)."""

KEY = DrawnParts(
    DrawnPart((box((-6, 12, -12), (6, 24, 12)),), (0, 18, 0)),
    DrawnPart(
        (
            box((-20, -20, -30), (20, 12, 30)),
            box((-20, 12, -30), (-6.25, 18, 30)),
            box((6.25, 12, -30), (20, 18, 30)),
        ),
        (0, 0, 0),
    ),
)
"""A key on the bottom of its slot: gaps 18 - 6 rho_1 - 12 rho_2 + TY of the bottom, 6.25 rho_2 - 6 rho_1 -+ TX of
the walls."""

TEE = DrawnParts(
    DrawnPart((box((-6, -5, 0), (6, 5, 4)), box((-2, -5, -8), (2, 5, 0))), (0, 0, 2)),
    DrawnPart(
        (
            box((-9, -5, -12), (9, 5, -8)),
            box((3, -5, -8), (9, 5, 0)),
            box((-9, -5, -8), (-3, 5, 0)),
        ),
        (0, 0, -12),
    ),
)
"""A T in a U, whose web stands on the bottom as its arms do on the walls: gaps 14 - 10 rho_1 - 4 rho_2 + TZ of
the bottom, 14 - 2 rho_1 - 12 rho_2 + TZ of the walls, 3 rho_2 - 2 rho_1 -+ TX of the web."""

ELL = DrawnParts(
    DrawnPart((box((0, -5, 0), (20, 5, 4)), box((0, -5, 4), (4, 5, 16))), (2, 0, 2)),
    DrawnPart((box((-30, -15, -6), (30, 15, 0)), box((-30, -15, 0), (0, 15, 10))), (-6, 0, -3)),
)
"""An L in the corner of a step, on its floor and against its riser: gaps 5 - 2 rho_1 - 3 rho_2 + TZ of the floor and
8 - 2 rho_1 - 6 rho_2 + TX of the riser."""

PARTS = {"dovetail": DOVETAIL, "lid": LID, "peg": PEG, "key": KEY, "tee": TEE, "ell": ELL}
