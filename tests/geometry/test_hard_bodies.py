"""Hard shapes against closed-form counts and exact hulls: large, thin, tiny, far away, nearly planar, redundant."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from body_checks import check_against_exact, check_consistent
from hypothesis import given
from hypothesis import strategies as st
from oracles import hull
from strategies import generators, random_rotation

import fcdm_opt as fo
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.round_recognition import round_faces
from fcdm_opt.tolerances import DEFAULT

CUBE = np.array(list(itertools.product([0.0, 1.0], repeat=3)))
SIDES = (3, 4, 5, 6, 7, 12, 30, 101, 1000)
poses = st.one_of(st.none(), generators)


def counts(body: Body) -> tuple[int, int, int]:
    (part,) = body.parts
    return len(part.vertices), len(part.edges), len(part.loops)


def ring(sides: int) -> np.ndarray:
    angles = 2 * np.pi * np.arange(sides) / sides
    return np.column_stack([np.cos(angles), np.sin(angles)])


def prism(sides: int, height: float = 1.0) -> np.ndarray:
    return np.array([(*x, z) for z in (-height, height) for x in ring(sides)])


def pyramid(sides: int, height: float = 1.0) -> np.ndarray:
    return np.array([*((*x, 0.0) for x in ring(sides)), (0.0, 0.0, height)])


def grid(steps: int) -> np.ndarray:
    return np.array(list(itertools.product(np.linspace(0, 1, steps), repeat=3)))


def rotations(number: int) -> list[np.ndarray]:
    rng = np.random.default_rng(number)
    return [np.eye(3), *(random_rotation(rng) for _ in range(3))]


# ---------------------------------------------------------------------------------------------- prisms and pyramids


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("sides", "size"), [*zip(SIDES, itertools.cycle([1e-8, 1.0, 1e8]), strict=False)])
def test_regular_prisms_and_pyramids_of_any_size(sides, size):
    for R in rotations(sides):
        assert counts(Body.convex(prism(sides) @ R.T * size)) == (2 * sides, 3 * sides, sides + 2)
        assert counts(Body.convex(pyramid(sides) @ R.T * size)) == (sides + 1, 2 * sides, sides + 1)


@pytest.mark.parametrize("sides", [3, 4, 5, 12, 30])
@pytest.mark.parametrize("aspect", [1e4, 1e6, 1e8])
def test_tall_and_flat_prisms_and_pyramids(sides, aspect):
    for R in rotations(sides):
        for height in (aspect, 1 / aspect):
            assert counts(Body.convex(prism(sides, height) @ R.T)) == (2 * sides, 3 * sides, sides + 2)
            assert counts(Body.convex(pyramid(sides, height) @ R.T)) == (sides + 1, 2 * sides, sides + 1)


@pytest.mark.parametrize("sides", SIDES)
def test_prisms_far_from_the_origin(sides):
    points = np.round(prism(sides) * 2**20) / 2**20 + [1e6, -1e6, 1e6]  # exact there
    body = Body.convex(points)
    check_consistent(body.parts[0])
    assert counts(body) == (2 * sides, 3 * sides, sides + 2)
    assert sorted(map(len, body.faces)) == sorted([4] * sides + [sides] * 2)


@pytest.mark.parametrize("size", [1e-8, 1.0, 1e8])
def test_rounded_cube_is_a_truncated_cube(size):
    """b / a = sqrt 2 - 1: eight triangles and six regular octagons."""
    a, b = 0.414213562373, 0.171572875254
    signs = itertools.product([-1, 1], repeat=3)
    points = np.array(sorted({p for x, y, z in signs for p in itertools.permutations((x * a, y * a, z * b))}))
    for R in rotations(24):
        body = Body.convex(points @ R.T * size)
        assert counts(body) == (24, 36, 14)
        assert sorted(map(len, body.faces)) == [3] * 8 + [8] * 6


# ---------------------------------------------------------------------------------------- slabs, rods, needless points


@pytest.mark.parametrize("thickness", [1e-4, 1e-6, 1e-9, 1e-11])
@pytest.mark.parametrize("steps", [2, 3, 6])
def test_slabs_and_rods_with_points_all_over_their_faces(thickness, steps):
    corners = [k + 1 for k, x in enumerate(grid(steps)) if set(x) <= {0.0, 1.0}]
    for R in rotations(steps):
        for thin in ([1, 1, thickness], [1, thickness, thickness]):
            body = Body.convex(grid(steps) * thin @ R.T)
            assert counts(body) == (8, 12, 6)
            assert sorted({v for face in body.faces for v in face}) == corners
            middle = R @ (np.array(thin) / 2)
            assert np.abs(body.seed - middle).max() < max(1e-15 / thickness, 1e-14)


@pytest.mark.parametrize("noise", [0.0, 1e-15, 1e-14, 1e-13, 4e-13])
@pytest.mark.parametrize("steps", [3, 5, 12])
def test_points_within_planarity_of_a_cube_are_no_corners(noise, steps):
    rng = np.random.default_rng(steps)
    for R in rotations(steps):
        points = grid(steps) @ R.T + noise * rng.uniform(-0.5, 0.5, (steps**3, 3))
        body = Body.convex(points)
        check_consistent(body.parts[0])
        assert counts(body) == (8, 12, 6)
        np.testing.assert_array_equal(body.vertices, points)


@pytest.mark.parametrize("noise", [1e-15, 1e-14, 3e-13])
def test_clusters_of_points_are_one_corner_each(noise):
    rng = np.random.default_rng(7)
    for R in rotations(7):
        points = np.repeat(CUBE @ R.T, 30, axis=0) + noise * rng.uniform(-0.5, 0.5, (240, 3))
        body = Body.convex(points)
        assert counts(body) == (8, 12, 6)
        assert sorted((v - 1) // 30 for v in {v for face in body.faces for v in face}) == list(range(8))


@pytest.mark.parametrize("bump", [0.1, 0.5, 2.0, 10.0])
@pytest.mark.parametrize("place", [(0.5, 0.5), (0.3, 0.6), (0.5, 0.0)])
def test_a_bump_is_a_corner_just_when_it_is_higher_than_planarity(bump, place):
    """On a face or an edge of the cube (0, 1)^3, whose size is 1/2 about its middle."""
    height = 1 + bump * DEFAULT.planarity / 2
    body = Body.convex(np.vstack([CUBE, [*place, height]]))
    check_consistent(body.parts[0])
    assert (9 in {v for face in body.faces for v in face}) == (bump > 1)


def test_a_smooth_cap_does_not_melt_away():
    """A sphere's cap of points 1e-4 apart: 1e-9 above their neighbours' plane, all of them corners."""
    steps = 1e-4 * np.arange(-20, 21)
    x, y = (u.ravel() for u in np.meshgrid(steps, steps))
    body = Body.convex([*np.column_stack([x, y, np.sqrt(1 - x**2 - y**2)]), (1, 0, -1), (-1, 1, -1), (-1, -1, -1)])
    assert counts(body)[0] == 41 * 41 + 3
    check_consistent(body.parts[0])


@given(generators, st.sampled_from([1, 10**4, 10**8]), st.sampled_from([1.0, 2.0**-26, 2.0**26]))
def test_seven_of_fifteen_points_on_one_plane_and_any_aspect(rng, aspect, unit):
    rows = rng.integers(-4, 5, (15, 3))
    rows[:7, 2] = 4
    rows = rows * [1, 1, aspect]
    exact = [tuple(map(int, x)) for x in rows]
    try:
        hull(dict(enumerate(exact)))
    except ValueError:
        with pytest.raises(InputError):
            Body.convex(rows * unit)
        return
    distinct = list(dict.fromkeys(exact))
    body = Body.convex(np.array(distinct) * unit)
    check_consistent(body.parts[0])
    check_against_exact(body, distinct)
    again = Body.convex(rows * unit)  # of equal points the first counts
    assert counts(again) == counts(body)
    first = {exact.index(x) + 1 for x in distinct}
    assert {v for face in again.faces for v in face} <= first


def test_coplanar_points_far_away_passed_as_a_solid():
    """Exactly coplanar; the mean of such coordinates is off by more than planarity."""
    rows = [(79667, -375426, 758120), (79645, -375407, 758146), (79658, -375409, 758130), (79647, -375414, 758144),
            (79648, -375403, 758142)]  # fmt: skip
    with pytest.raises(InputError, match="one plane, through vertices 1, 2 and 3"):
        Body.convex(rows)


@given(generators)
def test_points_far_away_on_slanted_planes(rng):
    basis = np.array([[1, 2, 3], [3, -5, 1], [2, 2, -7]])
    rows = np.unique(rng.integers(-2, 3, (14, 3)) @ basis + rng.integers(-(10**6), 10**6, 3), axis=0)
    exact = [tuple(map(int, x)) for x in rows]
    try:
        hull(dict(enumerate(exact)))
    except ValueError:
        return
    check_against_exact(Body.convex(rows), exact)


# --------------------------------------------------------------------------------------------------------- many points


@pytest.mark.parametrize("count", [4, 12, 100, 1000, 10000])
def test_points_on_a_sphere_are_all_corners_of_triangles(count):
    points = np.random.default_rng(count).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    body = Body.convex(points)
    assert counts(body) == (count, 3 * count - 6, 2 * count - 4)
    (part,) = body.parts
    np.testing.assert_array_equal(part.vertices, points)
    assert part.elements["V"][count - 1].vertices == (count,)
    if count <= 1000:
        check_consistent(part)
    # the loops close to an outward surface: Gauss's theorem for the field x gives three times the volume
    a, b, c = points[np.array(part.loops)].transpose(1, 0, 2)
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert part.volume_and_centroid[0] == pytest.approx(volume, rel=1e-12)
    assert count < 100 or volume == pytest.approx(4 / 3 * np.pi, rel=40 / count)


def test_many_points_on_the_surface_of_a_slanted_box():
    points = grid(30)
    points = points[((points == 0) | (points == 1)).any(axis=1)]
    R = rotations(3)[1]
    assert counts(Body.convex(points @ R.T * [1, 1, 1])) == (8, 12, 6)


@pytest.mark.slow
def test_a_union_of_two_large_parts_hides_their_seam():
    """Two prisms of 400 sides, one on the other: the shared end is no face, their sides are one face each."""
    low, high = prism(400), prism(400) + np.array([0, 0, 2])
    body = Body.from_parts([low, high])
    assert len(body.vertices) == 1200
    assert sorted(map(len, body.faces)) == sorted([6] * 400 + [400] * 2)
    np.testing.assert_allclose(body.seed, [0, 0, 1], atol=1e-13)


def test_slivers_that_other_parts_leave_of_a_face_are_no_faces():
    """A shaft in its hub, of digits as a STEP file has them: numpy could not tell the box about a face of none."""
    bore, keyway = fo.Cylinder(15.0, 22, base=(0, 0, -1), facets=16), fo.Box((8, 20, 22), centre=(0, 10, 10))
    hub = fo.cut(fo.Box((60, 60, 20), centre=(0, 0, 10)), bore, keyway)
    seat = fo.Box((8, 8, 20), centre=(1e-9, 15, 10))
    shaft = fo.cut(fo.Cylinder(15.0, 40, base=(0, 0, -10), facets=16), seat)
    rows = [np.round(part.vertices, 9) for body in (shaft, hub) for part in body.parts]
    body = fo.Body.from_parts(rows, seed="box")
    assert len(body.parts) == len(rows)
    assert all(len(face) > 2 for face in body.faces)


@pytest.mark.parametrize("angle", [0.0, 45.0, 75.0])
@pytest.mark.parametrize("combine", [fo.joined, fo.cut])
def test_facets_of_pins_side_by_side_in_one_plane_were_taken_for_those_of_the_other(combine, angle: float) -> None:
    """Across the line of their axes 12 facets have one plane at 45 and 75 degrees: corners went to the other pin."""
    ahead = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    pins = [fo.Cylinder(4.0, 14.0, base=(*own, -2.0), facets=12) for own in (30.0 * ahead, -30.0 * ahead)]
    found = combine(fo.Box((80, 80, 10), centre=(0, 0, 5)), *pins)
    sides = []
    for own in round_faces(found):
        corners = found.vertices[[label - 1 for face in own.faces for label in face]]
        sides.append(float(np.sign(own.surface.origin[:2] @ ahead)))
        np.testing.assert_allclose(np.linalg.norm(corners[:, :2] - 30.0 * sides[-1] * ahead, axis=1), 4.0, atol=1e-9)
    assert sorted(sides) == [-1.0, 1.0]
