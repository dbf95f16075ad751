"""The seven contact configurations and their contact sets, in closed form, at segments and switching points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from cases import CUBE, DIAMOND, OCTAHEDRON, TETRAHEDRON, Shape, box_shape
from curve_checks import ODD_BOX
from degenerate import BLOCK, SLAB, fewer
from hypothesis import given, settings
from hypothesis import strategies as st

import fcdm_opt as fo
from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.curve.segments import Segment, SwitchingPoint
from fcdm_opt.geometry.bodies import Body
from fcdm_opt_benchmarks.stability.contacts.scenes import TILT

CONFIGURATIONS = {"F-V", "E-E crossing", "E-V", "V-V", "E-E parallel", "F-E", "F-F"}


@dataclass(frozen=True, eq=False)
class Touch:
    """Two shapes that touch at a scale pair, and the corners of what they share, in order around it."""

    name: str
    configuration: str
    one: Shape
    two: Shape
    rho: tuple[float, float]
    corners: Sequence[Any]


def rectangle(x: float, y: tuple[float, float], z: tuple[float, float]) -> list[tuple[float, float, float]]:
    return [(x, y[0], z[0]), (x, y[1], z[0]), (x, y[1], z[1]), (x, y[0], z[1])]


def octagon(half: float, reach: float, z: float) -> list[tuple[float, float, float]]:
    """What |x|, |y| <= half and |x| + |y| <= reach leave at a height."""
    s, t = half, reach - half
    return [(s, -t, z), (s, t, z), (t, s, z), (-t, s, z), (-s, t, z), (-s, -t, z), (-t, -s, z), (t, -s, z)]


BEAM = box_shape((-1, "-0.25", -3), (1, "0.25", 3))
POST = box_shape((-1, -1, -3), (1, 1, 3))
ROOF = DIAMOND  # its edges at x = 2 and x = -2 run along z, from -1 to 1
SEGMENTS = [
    Touch("vertex on face", "F-V", OCTAHEDRON, CUBE.shifted((6, "0.5", "0.25")), (2, 2), [(4, 0, 0)]),
    Touch("face on vertex", "F-V", CUBE, OCTAHEDRON.shifted((6, "0.5", "0.25")), (2, 2), [(2, 0.5, 0.25)]),
    Touch("edge across edge", "E-E crossing", TETRAHEDRON, TETRAHEDRON.shifted((0, 0, 4)), (1.5, 2.5), [(0, 0, 1.5)]),
    Touch("edge across edge, off both middles", "E-E crossing", TETRAHEDRON, TETRAHEDRON.shifted(("0.5", "0.25", 4)),
          (2, 2), [(0.375, 0.375, 2)]),
    Touch("vertex on edge", "E-V", OCTAHEDRON, DIAMOND.shifted((8, 0, "0.5")), (2, 2), [(4, 0, 0)]),
    Touch("edge on vertex", "E-V", DIAMOND, OCTAHEDRON.shifted((8, 0, "0.5")), (1.5, 2.5), [(3, 0, 0.5)]),
    Touch("vertex on vertex", "V-V", OCTAHEDRON, OCTAHEDRON.shifted((8, 0, 0)), (1, 3), [(2, 0, 0)]),
    Touch("corner on corner", "V-V", CUBE, CUBE.shifted((4, 4, 4)), (1, 3), [(1, 1, 1)]),
    Touch("edge along edge", "E-E parallel", CUBE, CUBE.shifted((4, 4, 0)), (2, 2), [(2, 2, -2), (2, 2, 2)]),
    Touch("edge along edge, partly", "E-E parallel", CUBE, CUBE.shifted((4, 4, 3)), (2, 2), [(2, 2, 1), (2, 2, 2)]),
    Touch("edge along a longer edge", "E-E parallel", CUBE, POST.shifted((4, 4, 1)), (2, 2), [(2, 2, -2), (2, 2, 2)]),
    Touch("edge on face", "F-E", ROOF, CUBE.shifted((6, 0, 0)), (1, 4), [(2, 0, -1), (2, 0, 1)]),
    Touch("face on edge", "F-E", CUBE, ROOF.shifted((6, "0.5", 0)), (4, 1), [(4, 0.5, -1), (4, 0.5, 1)]),
    Touch("edge longer than the face", "F-E", ROOF, CUBE.shifted((6, 0, 0)), (2.5, 1), [(5, 0, -1), (5, 0, 1)]),
    Touch("edge that sticks out of a face", "F-E", ROOF, CUBE.shifted((6, "0.5", 3)), (2, 2), [(4, 0, 1), (4, 0, 2)]),
    Touch("face that an edge sticks out of", "F-E", CUBE, ROOF.shifted((6, "0.5", -3)), (2, 2),
          [(2, 0.5, -2), (2, 0.5, -1)]),
    Touch("equal squares", "F-F", CUBE, CUBE.shifted((4, 0, 0)), (2, 2), rectangle(2, (-2, 2), (-2, 2))),
    Touch("a square in a larger one", "F-F", CUBE, CUBE.shifted((4, 0.5, -0.25)), (1, 3),
          rectangle(1, (-1, 1), (-1, 1))),
    Touch("a square that another one covers", "F-F", CUBE, CUBE.shifted((4, 0.5, -0.25)), (3, 1),
          rectangle(3, (-0.5, 1.5), (-1.25, 0.75))),
    Touch("squares that overlap partly", "F-F", CUBE, CUBE.shifted((4, 2, -1)), (2, 2), rectangle(2, (0, 2), (-2, 1))),
    Touch("a bar across a bar", "F-F", SLAB, BLOCK.shifted((4, 0, 0)), (1, 1), rectangle(1, (-1, 1), (-2, 2))),
    Touch("a square turned in a square", "F-F", CUBE, DIAMOND.shifted((0, 0, 4)), (3, 1),
          [(2, 0, 3), (0, 2, 3), (-2, 0, 3), (0, -2, 3)]),
    Touch("a square in a turned one", "F-F", CUBE, DIAMOND.shifted((0, 0, 4)), (1, 3),
          [(1, -1, 1), (1, 1, 1), (-1, 1, 1), (-1, -1, 1)]),
    Touch("a square whose corners lie on the sides of a turned one", "F-F", CUBE, DIAMOND.shifted((0, 0, 4)), (2, 2),
          [(2, -2, 2), (2, 2, 2), (-2, 2, 2), (-2, -2, 2)]),
    Touch("two squares make an octagon", "F-F", CUBE, DIAMOND.shifted((0, 0, 4)), (2.5, 1.5), octagon(2.5, 3, 2.5)),
]  # fmt: skip
# lines r1 + 3 r2 = 4, 2 r1 + r2 = 3, 3 r1 + 2 r2 = 5 of the slab and the block meet in (1, 1)
POINTS = [
    Touch("boxes, edge along edge", "E-E parallel", SLAB, BLOCK.shifted((4, 3, 1)), (1, 1), [(1, 2, -1), (1, 2, 3)]),
    Touch("boxes, edge along edge, partly", "E-E parallel", SLAB, BLOCK.shifted((4, 3, 4)), (1, 1),
          [(1, 2, 2), (1, 2, 3)]),
    Touch("boxes, edge along a longer edge", "E-E parallel", CUBE, BEAM.shifted((4, 2.5, 1)), (2, 2),
          [(2, 2, -2), (2, 2, 2)]),
    Touch("boxes, corner on corner", "V-V", SLAB, BLOCK.shifted((4, 3, 5)), (1, 1), [(1, 2, 3)]),
    # the vertex (2, 0, 0) of body 1 reaches the edge at y = -1 of the face at x = 4 of body 2, scaled by 2
    Touch("vertex on edge", "E-V", OCTAHEDRON, CUBE.shifted((6, 2, "0.5")), (2, 2), [(4, 0, 0)]),
    Touch("edge on vertex", "E-V", CUBE, OCTAHEDRON.shifted((6, 2, "0.5")), (2, 2), [(2, 2, 0.5)]),
    # on the way from face on edge to edge on face the edges meet
    Touch("a roof's edge on a cube's", "E-E parallel", ROOF, CUBE.shifted((6, 2, 3)), (2, 2), [(4, 0, 1), (4, 0, 2)]),
]  # fmt: skip


def curve_of(case: Touch, pose: np.ndarray, box: Any = ODD_BOX) -> DecisionCurve:
    """The pair's curve with both bodies moved, body 1 by the transform."""
    return decision_curve(case.one.body(), case.two.body().moved(pose), transform=pose, box=box)


def measure(corners: np.ndarray) -> float:
    """Length of a segment, area of a planar polygon given in order, 0 of a point."""
    if len(corners) < 3:
        return float(np.linalg.norm(corners[-1] - corners[0]))
    spokes = corners[1:] - corners[0]
    return float(np.linalg.norm(np.cross(spokes[:-1], spokes[1:]).sum(axis=0))) / 2


def outside_by(points: np.ndarray, body: Body) -> float:
    """How far the worst point lies outside a convex body."""
    (part,) = body.parts
    return float((points @ part.normals.T - (part.vertices @ part.normals.T).max(axis=0)).max())


def check_set(found: np.ndarray, case: Touch, curve: DecisionCurve) -> None:
    expected = np.array(case.corners, dtype=float) @ curve.transform[:3, :3].T + curve.transform[:3, 3]
    assert found.shape == expected.shape
    apart = np.linalg.norm(found[:, None] - expected, axis=2)
    assert apart.min(axis=1).max() < 1e-12
    assert apart.min(axis=0).max() < 1e-12
    assert measure(found) == pytest.approx(measure(expected), abs=1e-12)
    moved = curve.movable.scaled(case.rho[0]).moved(curve.transform)
    assert max(outside_by(found, moved), outside_by(found, curve.static.scaled(case.rho[1]))) < 1e-12
    np.testing.assert_allclose(curve.contact_points(case.rho), [found.mean(axis=0)], atol=1e-13)


def test_all_seven_configurations_are_here():
    assert {case.configuration for case in SEGMENTS} == CONFIGURATIONS


POSES = pytest.mark.parametrize("pose", [np.eye(4), TILT], ids=["straight", "tilted"])


@POSES
@pytest.mark.parametrize("case", fewer(SEGMENTS), ids=lambda case: case.name)
def test_segments(case, pose):
    curve = curve_of(case, pose)
    segment = curve.locate(case.rho)
    assert isinstance(segment, Segment)
    assert segment.configuration == case.configuration
    (found,) = curve.contact_sets(case.rho)
    check_set(found, case, curve)


@POSES
@pytest.mark.parametrize("case", fewer(POINTS), ids=lambda case: case.name)
def test_switching_points(case, pose):
    curve = curve_of(case, pose)
    point = curve.locate(case.rho)
    assert isinstance(point, SwitchingPoint)
    assert point.configurations == (case.configuration,)
    (found,) = point.contact_sets
    check_set(found, case, curve)
    np.testing.assert_array_equal(curve.contact_sets(case.rho)[0], found)


@pytest.mark.parametrize("case", fewer(SEGMENTS), ids=lambda case: case.name)
def test_swapped_bodies_share_the_same(case):
    curve = decision_curve(case.two.body(), case.one.body(), box=ODD_BOX)
    assert curve.locate(case.rho[::-1]).configuration == case.configuration
    (found,) = curve.contact_sets(case.rho[::-1])
    assert measure(found) == pytest.approx(measure(np.array(case.corners, dtype=float)), abs=1e-12)
    assert len(found) == len(case.corners)


@pytest.mark.parametrize("case", fewer(SEGMENTS), ids=lambda case: case.name)
def test_nothing_is_shared_off_the_curve(case):
    curve = decision_curve(case.one.body(), case.two.body(), box=ODD_BOX)
    assert curve.contact_sets(np.array(case.rho) * (1 + 1e-6)) == ()


@settings(max_examples=40)
@given(st.floats(0.5, 3.5), st.tuples(st.integers(-14, 14), st.integers(-14, 14)))
def test_rectangles_overlap_as_intervals_do(scale, shift):
    """Squares of half sides r1 and 4 - r2 about (0, 0) and (y, z): the product of two intervals."""
    y, z = (k / 4 for k in shift)
    curve = decision_curve(CUBE.body(), CUBE.shifted((4, y, z)).body(), box=ODD_BOX)
    rho = np.array([scale, 4 - scale])
    spans = [(max(-rho[0], at - rho[1]), min(rho[0], at + rho[1])) for at in (y, z)]
    (found,) = curve.contact_sets(rho)
    assert curve.locate(rho).configuration == "F-F"
    np.testing.assert_allclose(np.sort(found[:, 1:], axis=0)[[0, -1]], np.transpose(spans), atol=1e-12)
    assert measure(found) == pytest.approx(np.prod([b - a for a, b in spans]), abs=1e-11)
    assert len(found) == 4


@settings(max_examples=40)
@given(st.integers(0, 90), st.floats(0.6, 3.4))
def test_turned_squares_overlap_as_clipping_the_corners_says(degrees, scale):
    """A square of half side 1 turned about the middle of one of half side k cuts off, or loses, four equal triangles.

    Beyond a side at distance s from the middle lies a corner of the other square, at distance h sqrt(2) and an angle
    45 - t from that side's normal: a right triangle of height v = h (cos t + sin t) - s and area v^2 / sin 2t.
    """
    t = np.radians(degrees)
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]]
    curve = decision_curve(CUBE.body(), CUBE.shifted((0, 0, 4)).body(), transform=pose, box=ODD_BOX)
    rho = (scale, 4 - scale)
    (found,) = curve.contact_sets(rho)
    low, high = sorted(rho)
    over = max(0.0, low * (np.cos(t) + np.sin(t)) - high)
    lost = 4 * over**2 / np.sin(2 * t) if 0 < degrees < 90 else 0.0
    assert measure(found) == pytest.approx(4 * low**2 - lost, rel=1e-12)
    if abs(low * (np.cos(t) + np.sin(t)) - high) > 1e-6:
        assert len(found) == (8 if over else 4)


def test_a_sliver_that_a_cut_leaves_of_a_face_does_not_make_its_edge_pass_for_the_face():
    """A tilted edge meets a box's edge; beside that lies a part of the face 1.5e-5 wide, as high to 4e-12."""
    tilt, wide = 2.5e-7, 1.5e-5
    cut = [[0, -20, -20], [-20, -20, -20], [0, -20 + wide, 20], [-20, -20 + wide, 20]]
    sliver, rest = [[0, -20, 20], [-20, -20, 20]], [[x, 20, z] for x in (0, -20) for z in (-20, 20)]
    movable = Body.from_parts([cut + sliver, cut + rest], seed=(-10.0, 0.0, 0.0))
    behind = [[5, y, z] for y in (-25, 25) for z in (15, 22)]
    static = Body.convex([[1, -25, 18.5], [1 + 50 * tilt, 25, 18.5], *behind])
    problem = fo.Problem(movable, static, target=(1.0, 1.0), goal="touch", motion=fo.Translation("x"))
    found = fo.solve(problem)
    assert found.usable
    assert found.amount == pytest.approx(1.0 + 5 * tilt, abs=1e-12)
    assert {feature.kind for feature in found.features} == {"E1E2"}
