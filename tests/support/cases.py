"""Hand-made cases: shapes as exact numbers, with what is known of their curves in closed form or in print."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from oracles import Box, ExactCurve, exact_curve, rational

from fcdm_opt.geometry.bodies import Body

Rows = tuple[tuple[Fraction, ...], ...]


@dataclass(frozen=True)
class Shape:
    """A body in exact numbers: the package gets it as floats, the oracle as fractions."""

    vertices: Rows
    seed: tuple[Fraction, ...]
    parts: tuple[tuple[int, ...], ...] | None = None
    faces: tuple[tuple[int, ...], ...] | None = None

    @property
    def array(self) -> np.ndarray:
        return np.array(self.vertices, dtype=np.float64)

    def body(self, name: str = "body") -> Body:
        seed = np.array(self.seed, dtype=np.float64)
        if self.parts is None:
            return Body.convex(self.array, seed=seed, name=name)
        return Body.from_parts(self.array, parts=self.parts, faces=self.faces, seed=seed, name=name)

    def shifted(self, shift: Sequence[Any]) -> Shape:
        """Move the shape and its seed."""
        (t,) = rational([shift])
        *vertices, seed = (tuple(a + b for a, b in zip(x, t, strict=True)) for x in (*self.vertices, self.seed))
        return replace(self, vertices=tuple(vertices), seed=seed)


def shape(vertices: Any, seed: Any, parts: Any = None, faces: Any = None) -> Shape:
    """Build a shape from numbers or decimal strings."""
    own = None if parts is None else tuple(tuple(part) for part in parts)
    return Shape(tuple(rational(vertices)), rational([seed])[0], own, faces)


def box_shape(low: Sequence[Any], high: Sequence[Any], seed: Any = None) -> Shape:
    """Axis-aligned box; seed: its centre unless given."""
    low, high = rational([low, high])
    corners = [tuple((low, high)[k >> axis & 1][axis] for axis in range(3)) for k in range(8)]
    return shape(corners, [(a + b) / 2 for a, b in zip(low, high, strict=True)] if seed is None else seed)


def union(*shapes: Shape, seed: Any) -> Shape:
    """Several convex shapes as one body; equal vertices once."""
    rows = list(dict.fromkeys(x for own in shapes for x in own.vertices))
    return shape(rows, seed, [[rows.index(x) for x in own.vertices] for own in shapes])


def exact(one: Shape, two: Shape, pose: Any = None) -> ExactCurve:
    """The oracle's curve of two shapes."""
    return exact_curve(one.vertices, one.seed, two.vertices, two.seed, parts1=one.parts, parts2=two.parts, pose=pose)


DEFAULT_BOX: Box = ((0.8, 3.0), (0.8, 3.0))
CUBE = box_shape((-1, -1, -1), (1, 1, 1))
OCTAHEDRON = shape([(2, 0, 0), (-2, 0, 0), (0, 2, 0), (0, -2, 0), (0, 0, 2), (0, 0, -2)], (0, 0, 0))
DIAMOND = shape(  # cube turned by 45 degrees about z: square with corners on the axes, extruded
    [(2, 0, -1), (-2, 0, -1), (0, 2, -1), (0, -2, -1), (2, 0, 1), (-2, 0, 1), (0, 2, 1), (0, -2, 1)], (0, 0, 0)
)
TETRAHEDRON = shape([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], (0, 0, 0))


@dataclass(frozen=True)
class OneLine:
    """A pair of convex shapes that touches along one line p rho_1 + q rho_2 = r, by one contact."""

    name: str
    one: Shape
    two: Shape
    line: tuple[int, int, int]
    label: str


ONE_LINE = (
    OneLine("cubes face to face", CUBE, CUBE.shifted((4, 0, 0)), (1, 1, 4),
            "F1F2(P1V2,V4,V6,V8; P2V1,V3,V5,V7)"),
    OneLine("cubes edge along edge", CUBE, CUBE.shifted((4, 4, 0)), (1, 1, 4), "E1E2(P1V4,V8; P2V1,V5)"),
    OneLine("cubes vertex to vertex", CUBE, CUBE.shifted((4, 4, 4)), (1, 1, 4), "V1V2(P1V8; P2V1)"),
    OneLine("vertex on face", OCTAHEDRON, CUBE.shifted((6, 0, 0)), (2, 1, 6), "V1F2(P1V1; P2V1,V3,V5,V7)"),
    OneLine("edge on face", DIAMOND, CUBE.shifted((6, 0, 0)), (2, 1, 6), "E1F2(P1V1,V5; P2V1,V3,V5,V7)"),
    OneLine("vertex on vertex", OCTAHEDRON, OCTAHEDRON.shifted((8, 0, 0)), (2, 2, 8), "V1V2(P1V1; P2V2)"),
    OneLine("vertex on edge", OCTAHEDRON, DIAMOND.shifted((8, 0, 0)), (2, 2, 8), "V1E2(P1V1; P2V2,V6)"),
    OneLine("tetrahedra edge across edge", TETRAHEDRON, TETRAHEDRON.shifted((0, 0, 4)), (1, 1, 4),
            "E1E2(P1V1,V4; P2V2,V3)"),
)  # fmt: skip


@dataclass(frozen=True)
class Published:
    """An example of the paper (reconstruction): published labels, and points as these bodies give them."""

    one: Shape
    two: Shape
    labels: tuple[str, ...]
    switching_points: tuple[tuple[float, float], ...]


EXAMPLE_1 = Published(
    shape(
        [("0.0415", "-0.0771", "-0.43"), ("-0.1372", "0.1638", "-0.43"), ("0.0453", "-0.1083", "-0.43"),
         ("0.0751", "-0.0627", "0.43"), ("-0.1036", "0.1782", "0.43"), ("0.0789", "-0.0939", "0.43")],
        (0, 0, 0),
    ),
    shape(
        [("0.1125", "-0.1197", "-0.12"), ("0.1009", "-0.0753", "-0.12"), ("0.4353", "0.1363", "-0.12"),
         ("0.4469", "0.0919", "-0.12"), ("0.1629", "-0.0332", "0.48")],
        ("0.2517", 0, 0),
    ),
    (
        "V1F2(P1V6; P2V2,V3,V5)",
        "E1E2(P1V3,V6; P2V2,V5)",
        "F1V2(P1V1,V3,V4,V6; P2V2)",
        "E1E2(P1V1,V4; P2V1,V2)",
        "F1V2(P1V1,V2,V4,V5; P2V1)",
    ),
    ((0.8643014, 1.6033989), (0.9546676, 1.3169051), (1.2734505, 1.214536), (1.8213994, 1.0817832)),
)  # fmt: skip

EXAMPLE_2 = Published(
    shape(
        [("-0.38756", "-2.43473", "1.1077"), ("-0.24556", "-3.21413", "0.7077"), ("-0.26756", "-2.37073", "0.3077"),
         ("-0.40956", "-1.59133", "0.7077"), ("-0.77756", "-1.74273", "0.7077")],
        ("-0.41756", "-2.27073", "0.7077"),
    ),
    shape(
        [(x, y, z) for z in ("-0.6", "0.6") for x, y in (("-4.33", "1.506"), ("-0.33", "1.506"), ("-0.33", "-0.306"),
                                                         ("-1.73", "-0.306"), ("-1.73", "-1.2"), ("-4.33", "-1.2"))],
        ("-2.13", 0, 0),
        [(0, 1, 2, 3, 6, 7, 8, 9), (0, 3, 4, 5, 6, 9, 10, 11)],
        ((0, 1, 2, 3, 4, 5), (11, 10, 9, 8, 7, 6), (0, 6, 7, 1), (1, 7, 8, 2), (2, 8, 9, 3), (3, 9, 10, 4),
         (4, 10, 11, 5), (5, 11, 6, 0)),
    ),
    ("V1F2(P1V5; P2V4,V5,V10,V11)", "V1F2(P1V4; P2V3,V4,V9,V10)", "E1E2(P1V3,V4; P2V9,V10)"),
    ((2.3780035, 2.1408969), (2.8110141, 1.1795)),
)  # fmt: skip
