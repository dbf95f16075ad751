"""Whole solids: containment, nesting and depth, whatever convex parts a body is kept as."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import fcdm_opt as fo
from fcdm_opt.geometry.measures import winding_numbers
from fcdm_opt.geometry.solids import PlacedSolids, contains, located

ONES = np.ones(2)


def ball(radius, subdivisions, name="ball", centre=(0, 0, 0)):
    """A ball with a thorn at -x, kept as its surface."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    points = np.array(mesh.vertices)
    points[points[:, 0].argmin()] *= 1.3
    body = fo.Body.from_mesh(
        points + centre, np.array(mesh.faces), decomposition="surface", seed=np.array(centre, float), name=name
    )
    assert body.hollow
    return body


def box(half, centre=(0, 0, 0), name="box", sides=0):
    """A box; of so many sides along each edge and kept as its surface where these are told."""
    mesh = trimesh.creation.box(extents=2.0 * np.broadcast_to(half, 3))
    for _ in range(sides):
        mesh = mesh.subdivide()
    vertices = np.array(mesh.vertices) + centre
    kept = {"decomposition": "surface"} if sides else {}
    return fo.Body.from_mesh(vertices, np.array(mesh.faces), seed=centre, name=name, **kept)


def frame(half, inner, name="frame", **kept):
    """A square ring along z: a box with a square hole, not convex."""
    whole = trimesh.creation.box(extents=2.0 * np.array(half))
    made = whole.difference(trimesh.creation.box(extents=2.0 * np.array(inner)), engine="manifold")
    return fo.Body.from_mesh(np.array(made.vertices), np.array(made.faces), name=name, **kept)


def shifted(*by):
    pose = np.eye(4)
    pose[:3, 3] = by
    return pose


def test_points_are_located_exactly_on_edges_walls_and_corners():
    rng = np.random.default_rng(1)
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=10)
    points, corners = np.round(rng.uniform(-11, 11, (4000, 3)), 0), np.round(np.array(mesh.vertices), 1)[mesh.faces]
    found = located(points, corners)
    assert (found.winding == np.round(winding_numbers(points, corners)))[~found.on].all()
    assert located(corners[:, 0], corners).on.all()
    cube = np.array(trimesh.creation.box(extents=[2, 2, 2]).triangles)  # walls along z, points above their edges
    grid = np.stack(np.meshgrid(*[np.linspace(-2, 2, 9)] * 3), axis=-1).reshape(-1, 3)
    reach = np.abs(grid).max(axis=1)
    at = located(grid, cube)
    assert (at.on == (reach == 1)).all()
    assert (at.inside == (reach < 1)).all()


def test_a_point_by_one_digit_off_a_slanted_face_is_on_its_side():
    body = fo.Body.convex([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], seed=(0, 0, 0))
    third = np.array([0.25, 0.25, 0.5])  # on x + y + z = 1 exactly
    points = np.array([third, np.nextafter(third, 0), np.nextafter(third, 1)])
    assert contains(body, points).tolist() == [False, True, False]


@pytest.mark.parametrize("subdivisions", [2, 3])
@pytest.mark.parametrize("place", [(0, 0, 0), (0, 0, 3), (2, 1, 4)])
def test_a_cube_in_the_middle_of_a_surface_body_is_inside(subdivisions, place):
    big, cube = ball(10, subdivisions), box(1)
    pair = PlacedSolids(cube, big, ONES, shifted(*place))
    assert pair.nested == 1
    assert pair.distance > 0
    assert PlacedSolids(big, cube, ONES, shifted(*-np.array(place))).nested == 1
    assert PlacedSolids(cube, big, ONES, shifted(0, 0, 12)).nested == 0


@pytest.mark.parametrize("refined", [1, 2, 3])
def test_depth_of_surface_bodies_does_not_fall_with_refinement(refined):
    """A box .5 wide of sides 4 stands 1.5 deep in one of 20; in the middle of it 10 + 2 deep."""
    block, peg = box(10, sides=refined), box((2, 2, 4), sides=refined)
    assert PlacedSolids(peg, block, ONES, shifted(0, 0, 12.5)).depth == pytest.approx(1.5, rel=1e-6)
    assert PlacedSolids(peg, block, ONES, shifted(0, 0, 14)).depth == 0
    assert PlacedSolids(peg, block, ONES, shifted(1, 0, 0)).depth == pytest.approx(11, rel=1e-6)
    assert PlacedSolids(peg, block, np.array([0.5, 2.0]), shifted(0, 0, 21)).depth == pytest.approx(1, rel=1e-6)


def test_depth_of_balls_converges_to_the_closed_form():
    """Radii less the distance of their centres, that of one inside the other too."""
    for subdivisions, off in ((2, 0.07), (3, 0.018)):
        big, small = ball(10, subdivisions), ball(3, subdivisions)
        for place in ((0, 0, 12), (0, 3, 6), (0, 4, 0)):
            depth = PlacedSolids(small, big, ONES, shifted(*place)).depth
            exact = 13 - np.linalg.norm(place)
            assert exact - 13 * off <= depth <= exact + 1e-9


def test_depth_of_a_peg_tight_all_round_is_that_of_its_walls():
    """20.04 in 20, square: .02 on either side; pushed by .01 to one side .03 deep there."""
    peg = box((10.02, 10.02, 20), sides=1)
    for kept in ("exact", "surface"):
        ring = frame((30, 30, 10), (10, 10, 11), decomposition=kept)
        assert PlacedSolids(peg, ring, ONES, np.eye(4)).depth == pytest.approx(0.02, rel=1e-6)
        assert PlacedSolids(peg, ring, ONES, shifted(0.01, 0, 0)).depth == pytest.approx(0.03, rel=1e-6)
        small = box(9.0)
        inside = PlacedSolids(small, ring, ONES, np.eye(4))
        assert inside.nested == 0
        assert inside.depth == 0
