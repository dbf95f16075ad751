"""Distances of scaled pairs: against exact arithmetic, closed forms and invariances, and where coal fails."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from cases import EXAMPLE_2, Shape, box_shape, exact
from strategies import random_pair, random_pose

from fcdm_opt.geometry import judging
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.collision import ScaledPair
from fcdm_opt.tolerances import DEFAULT

HERE = np.eye(4)
OPENINGS = [s * 10.0**-k for k in (1, 3, 5, 7, 9, 11) for s in (1, -1)] + [0.0]
CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def turn(x: float, y: float, z: float) -> np.ndarray:
    """Rotation by angles in degrees about x, then y, then z, fixed axes."""
    R = np.eye(3)
    for axis, angle in enumerate(np.radians([x, y, z])):
        own = np.eye(3)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        own[[i, j], [i, j]], own[i, j], own[j, i] = np.cos(angle), -np.sin(angle), np.sin(angle)
        R = own @ R
    return R


def touching(one: Shape, two: Shape, pose: Any = None) -> float:
    """Scale at which both bodies, grown alike, first touch."""
    return float(max(Fraction(f.line[2], f.line[0] + f.line[1]) for f in exact(one, two, pose).pair.facets))


def pair_of(one: Shape, two: Shape) -> tuple[ScaledPair, float]:
    bodies = one.body("one"), two.body("two")
    return ScaledPair(*bodies), max(body.size for body in bodies)


# ------------------------------------------------------------------------------------------------- general position


@pytest.mark.parametrize("thin", [1.0, 1e-3, 1e-9])
def test_a_part_is_laid_out_as_it_is_and_evened_for_coal(thin: float) -> None:
    rng = np.random.default_rng(11)
    body = Body.convex((rng.normal(size=(30, 3)) * [1.0, 1.0, thin]) @ turn(20, 30, 40).T + [3.0, 2.0, 1.0])
    part, scale = body.parts[0], body.size
    solid = judging.Solid.of(part)
    points, planes, sides, ball, even = solid.points, solid.planes, solid.edges, solid.ball, solid.even
    local = part.vertices - part.seed
    np.testing.assert_array_equal(points, local)
    np.testing.assert_allclose(planes[:, :3], part.normals, atol=1e-14 / thin)
    np.testing.assert_allclose(planes[:, 3], (local @ planes[:, :3].T).max(axis=0), atol=1e-15 * scale)
    np.testing.assert_allclose(sides, np.diff(local[part.edges[:, :2]], axis=1)[:, 0], atol=1e-15 * scale)
    np.testing.assert_allclose(ball[:3], local.mean(axis=0), atol=1e-15 * scale)
    assert np.linalg.norm(local - ball[:3], axis=1).max() == pytest.approx(ball[3], rel=1e-14)
    np.testing.assert_allclose(even.T @ even, np.eye(3), atol=1e-14)
    image = np.linalg.lstsq(local - ball[:3], even)[0]
    assert np.linalg.det(image) > 0
    np.testing.assert_allclose((local - ball[:3]) @ image, even, atol=1e-14 / thin)


def least_separation(scaled: ScaledPair, rho: Any) -> float:
    """The least separation as drawn, of explicit vertices."""
    return float(scaled.least_separations(np.array([rho]), HERE[None])[0])


@pytest.mark.parametrize("number", range(10))
def test_pairs_in_general_position_are_right_to_rounding(number: int) -> None:
    """Signed distance and separation, opened and closed by a relative 1e-1 to 1e-11, and at touch itself."""
    one, two = random_pair(np.random.default_rng(number), 50)
    curve, (scaled, size) = exact(one, two), pair_of(one, two)
    scale = touching(one, two)
    for opening in OPENINGS:
        rho = (scale * (1 - opening),) * 2
        gap, distance = curve.gap(rho), curve.distance(rho)
        truth = distance if gap > 0 else gap
        reach = size * scale
        assert abs(scaled.signed_distance(rho, HERE) - truth) <= 1e-14 * reach
        separation = least_separation(scaled, rho)
        assert gap - 1e-14 * reach <= separation <= truth + 1e-14 * reach
        exact_separation = scaled.exact_separation(rho, HERE)
        assert gap - 1e-14 * reach <= exact_separation <= truth + 1e-14 * reach


@pytest.mark.parametrize("number", range(10))
def test_moved_pairs_and_unequal_scales(number: int) -> None:
    rng = np.random.default_rng(1000 + number)
    one, two = random_pair(rng, 50)
    scaled, size = pair_of(one, two)
    for _ in range(4):
        pose, rho = random_pose(rng, 20.0), rng.uniform(0.2, 3.0, 2)
        curve = exact(one, two, pose)
        gap, distance = curve.gap(rho), curve.distance(rho)
        truth = distance if gap > 0 else gap
        assert abs(scaled.signed_distance(rho, pose) - truth) <= 1e-14 * (3 * size + 100)


def test_every_part_pair_of_a_union_is_told_apart() -> None:
    scaled, size = pair_of(EXAMPLE_2.one, EXAMPLE_2.two)
    rho = (2.0, 2.1)
    values = np.array([[scaled.between(0, j).signed_distance(rho, HERE) for j in range(2)]])
    for (i, j), pair in exact(EXAMPLE_2.one, EXAMPLE_2.two).pairs.items():
        truth = pair.distance(rho) if pair.side(rho) > 0 else pair.gap(rho)
        assert abs(values[i, j] - truth) <= 1e-14 * size * 3
    assert scaled.signed_distance(rho, HERE) == values.min()


def test_answers_do_not_depend_on_what_was_asked_before() -> None:
    one, two = random_pair(np.random.default_rng(7), 50)
    scaled, _ = pair_of(one, two)
    first = scaled.signed_distance((0.7, 0.9), HERE)
    scaled.signed_distance((1.3, 0.1), random_pose(np.random.default_rng(1), 20.0))
    assert np.array_equal(first, scaled.signed_distance((0.7, 0.9), HERE))
    assert np.array_equal(first, pair_of(one, two)[0].signed_distance((0.7, 0.9), HERE))


@pytest.mark.parametrize("number", range(10))
def test_common_motion_swap_and_units_change_nothing(number: int) -> None:
    rng = np.random.default_rng(2000 + number)
    one, two = (own.body() for own in random_pair(rng, 50))
    scale = rng.uniform(0.5, 1.5)
    rho, size = np.array([scale, scale * 1.1]), max(one.size, two.size)
    here = ScaledPair(one, two).signed_distance(rho, HERE)
    pose = random_pose(rng, 1.0)
    assert abs(ScaledPair(one.moved(pose), two.moved(pose)).signed_distance(rho, HERE) - here) <= 1e-13 * size
    assert abs(ScaledPair(two, one).signed_distance(rho[::-1], HERE) - here) <= 1e-13 * size
    away = np.linalg.inv(pose)
    assert abs(ScaledPair(one.moved(pose), two).signed_distance(rho, away) - here) <= 1e-12 * size
    for unit in (1e-6, 1e6):
        small = [Body.convex(body.vertices * unit, seed=body.seed * unit) for body in (one, two)]
        assert abs(ScaledPair(*small).signed_distance(rho, HERE) / unit - here) <= 1e-13 * size


# ------------------------------------------------------------------------------------------------------ hard places


def cubes(R: np.ndarray, shift: Any, size: float = 1.0) -> tuple[ScaledPair, np.ndarray]:
    """Two cubes of edge `size`, turned alike, one shifted in their own frame."""
    corners = size * CUBE @ R.T
    return ScaledPair(Body.convex(corners, seed=[0, 0, 0]), Body.convex(corners + R @ shift, seed=R @ shift)), corners


@pytest.mark.parametrize("kind", [(1, 0, 0), (1, 1, 0), (1, 1, 1)], ids=["faces", "parallel edges", "vertices"])
def test_kissing_cubes_in_tilted_frames(kind: tuple[int, int, int]) -> None:
    """Raw coal calls most parallel edges that are less than 1e-5 apart touching; confirmed answers are right.

    What remains is the zone in which a confirmed answer may still be off: `tie` of the size.
    """
    rng = np.random.default_rng(5)
    axes = np.array(kind)
    wrong = undecided = 0
    for _ in range(6):
        R = turn(*rng.uniform(-180, 180, 3))
        for opening in OPENINGS:
            shift = np.where(axes, 1 + opening, rng.uniform(-0.3, 0.3, 3))
            truth = opening * (np.sqrt(axes.sum()) if opening > 0 else 1)
            scaled, _ = cubes(R, shift)
            found = scaled.signed_distance((1.0, 1.0), HERE)
            undecided += np.isnan(found)
            wrong += abs(found - truth) > 2 * DEFAULT.tie
            separation = least_separation(scaled, (1.0, 1.0))
            assert separation <= truth + 1e-14
            assert abs(separation - truth) <= 1e-14 or truth > 1e-14
            if abs(truth) > 1e-14:
                assert (separation > 0) == (truth > 0)
    assert (wrong, undecided) == (0, 0)


@pytest.mark.parametrize("size", [0.01, 0.25, 0.5, 10.0, 1000.0])
def test_cubes_face_to_face_within_rounding(size: float) -> None:
    R = turn(15, -10, 17)
    for s in (-1e-15, -2.5e-16, -1e-16, 0.0, 1e-16, 2.5e-16, 1e-15):
        gap = s * max(1.0, size)
        scaled, _ = cubes(R, [size + gap, 0, 0], size)
        assert abs(scaled.signed_distance((1.0, 1.0), HERE) - gap) <= 2 * DEFAULT.tie * size + 4e-16


@pytest.mark.parametrize("thickness", [1e-3, 1e-6, 1e-9, 1e-11])
def test_thin_slabs_are_measured(thickness: float) -> None:
    """Built as drawn, coal's hull of a slab of 1e-9 ends the process."""
    R = turn(15, -10, 17)
    slab = CUBE * [1, 1, thickness]
    for gap in (1e-1, 1e-6, 1e-9, 1e-12):
        shift = R @ np.array([0.3, 0.2, thickness + gap])
        one, two = Body.convex(slab @ R.T, seed=[0, 0, 0]), Body.convex(slab @ R.T + shift, seed=shift)
        assert abs(ScaledPair(one, two).signed_distance((1.0, 1.0), HERE) - gap) <= 2 * DEFAULT.tie


@pytest.mark.parametrize("ratio", [1e-3, 1e-6])
def test_a_small_cube_at_a_large_one(ratio: float) -> None:
    for gap in (1e-3, 1e-6, 1e-9, 0.0, -1e-9 * ratio):
        centre = np.array([0.5 + ratio / 2 + gap, 0.1, 0.2])
        one, two = Body.convex(CUBE, seed=[0, 0, 0]), Body.convex(ratio * CUBE + centre, seed=centre)
        assert abs(ScaledPair(one, two).signed_distance((1.0, 1.0), HERE) - gap) <= 1e-15


def test_many_vertices_and_changing_scales() -> None:
    """A prism over a regular 200-gon: coal climbs from vertex to vertex, from points stored before the scaling."""
    angles = np.arange(200) * (2 * np.pi / 200)
    prism = Body.convex([(np.cos(t), np.sin(t), z) for t in angles for z in (-1, 1)], seed=[0, 0, 0])
    wall = Body.convex(CUBE * [1, 9, 9], seed=[0.5, 0, 0])
    scaled = ScaledPair(prism, wall)
    pose = np.eye(4)
    pose[0, 3] = -3.0
    for rho_1 in (0.01, 1.0, 2.0, 2.5, 2.9):
        for rho_2 in (0.01, 0.5, 1.0):
            wall_at = 0.5 - rho_2
            assert abs(scaled.signed_distance((rho_1, rho_2), pose) - (wall_at + 3 - rho_1)) <= 1e-12


def test_separations_of_very_large_parts_are_not_attempted() -> None:
    rng = np.random.default_rng(3)
    points = rng.normal(size=(200, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    scaled = ScaledPair(Body.convex(points, seed=[0, 0, 0]), Body.convex(points + np.array([3, 0, 0]), seed=[3, 0, 0]))
    assert np.isnan(least_separation(scaled, (1.0, 1.0)))
    assert np.isnan(scaled.exact_separation((1.0, 1.0), HERE))
    leaf = np.array([0])  # the faces about one corner are looked at
    direction = scaled.best_direction((1.0, 1.0), HERE, (0, 0), (leaf, leaf))
    assert 0 in direction.one + direction.two
    assert 0.9 < scaled.signed_distance((1.0, 1.0), HERE) < 1.1


@pytest.mark.parametrize("tip", [True, False])
def test_a_vertex_of_very_many_neighbours(tip: bool) -> None:
    """coal cannot count more than 255: a face is cut otherwise than by Qhull, a cone is measured without coal."""
    angles = np.arange(300) * (2 * np.pi / 300)
    ring = [(np.cos(t), np.sin(t), 0.0) for t in angles]
    body = Body.convex([*ring, (0, 0, 1)] if tip else [*ring, *((x, y, 1.0) for x, y, _ in ring)], seed=[0, 0, 0])
    block = Body.convex(CUBE + np.array([0, 0, 4]), seed=[0, 0, 4])
    scaled, top = ScaledPair(body, block), 4.0 + CUBE[:, 2].min()
    assert (scaled._hulls[0][0].shape is None) == tip
    assert abs(scaled.signed_distance((1.0, 1.0), HERE) - (top - 1.0)) <= 1e-14
    pose = np.eye(4)
    pose[2, 3] = top - 0.75
    assert abs(scaled.signed_distance((1.0, 1.0), pose) + 0.25) <= 1e-14
    pose[:3, 3] = -2.0, 0.0, 5.0  # the rim comes near the block's upper edge
    assert abs(scaled.signed_distance((1.0, 1.0), pose) - np.hypot(0.5, 0.5)) <= 1e-14


# -------------------------------------------------------------------------------------------------- exact arithmetic


@pytest.mark.parametrize("ulps", [-3, -1, 0, 1, 3])
def test_exact_separation_tells_single_units_in_the_last_place(ulps: int) -> None:
    gap = Fraction(ulps, 2**52)
    one, two = box_shape((0, 0, 0), (1, 1, 1), (0, 0, 0)), box_shape((1 + gap, 0, 0), (2, 1, 1), (0, 0, 0))
    assert ScaledPair(one.body(), two.body()).exact_separation((1.0, 1.0), HERE) == float(gap)


@pytest.mark.parametrize("number", range(5))
def test_exact_separation_is_the_largest_over_all_facets(number: int) -> None:
    rng = np.random.default_rng(3000 + number)
    one, two = random_pair(rng, 50)
    pose = random_pose(rng, 5.0)
    rho = (1.1 * touching(one, two, pose),) * 2
    truth = exact(one, two, pose).gap(rho)
    assert truth < 0  # where the parts overlap no other direction can exceed the facets'
    found = pair_of(one, two)[0].exact_separation(rho, pose)
    assert abs(found - truth) <= 1e-15 * abs(truth)


# ---------------------------------------------------------------------------------------------- coal's own failures


class Failing:
    """Stands in for the library: answers wrongly a number of times, then as it should."""

    def __init__(self, library: Any, answer: float, times: int) -> None:
        self._library, self.answer, self.times = library, answer, times

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library, name)

    def distance(self, *arguments: Any) -> float:
        value = self._library.distance(*arguments)
        self.times -= 1
        return self.answer if self.times >= 0 else value


@pytest.mark.parametrize("answer", [1.7976931348623157e308, -1.7976931348623157e308, float("nan"), float("inf"), 0.0])
def test_a_failure_of_the_library_is_retried_and_never_returned(answer: float) -> None:
    """Zero between bodies that are apart is the failure met most often."""
    scaled, _ = cubes(turn(15, -10, 17), [1.25, 0.1, 0.0])
    library = scaled._coal
    scaled._coal = Failing(library, answer, 1)
    assert abs(scaled.signed_distance((1.0, 1.0), HERE) - 0.25) <= 1e-15
    scaled._coal = Failing(library, answer, 2)
    assert np.isnan(scaled.signed_distance((1.0, 1.0), HERE))
