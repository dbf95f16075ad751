"""Kinematic couplings, with tetrahedra for balls: six contacts that hold a part in one place only, in closed form."""

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.motion.motions import Free

R, BALL, UP = 10.0, 1.0, np.array([0.0, 0.0, 1.0])


def slab(corner: Array, normal: Array, along: Array) -> Array:
    """Return a plate whose face through a corner has a normal, up from the corner and to both sides of it."""
    uphill = np.cross(along, normal)
    uphill *= np.sign(uphill[2]) or 1.0
    face = [corner + a * along + b * uphill for a in (-1.5, 1.5) for b in (0.0, 3.0)]
    return np.array([*face, *(point - 0.5 * normal for point in face)])


def ball(centre: Array, normals: list[Array], reaches: list[float]) -> Array:
    """Return a hull about a centre that has a corner on each wall, where a ball would touch it."""
    feet = [centre - reach * normal for normal, reach in zip(normals, reaches, strict=True)]
    tops = [centre + BALL * UP + 0.3 * np.array(way) for way in ((1.0, 0, 0), (-0.5, 0.8, 0), (-0.5, -0.8, 0))]
    return np.array([*feet, *tops])


def ways(degrees: float) -> tuple[Array, Array]:
    """Return the radial and the tangential direction at an angle."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([c, s, 0.0]), np.array([-s, c, 0.0])


def maxwell() -> tuple[fo.Body, fo.Body]:
    """Three balls in three grooves at 45 degrees that run outwards; ball centres at the seed's height."""
    balls, walls = [], []
    high = BALL * np.sqrt(2.0)
    for degrees in (90.0, 210.0, 330.0):
        out, across = ways(degrees)
        normals = [(UP + across) / np.sqrt(2.0), (UP - across) / np.sqrt(2.0)]
        balls.append(ball(R * out + high * UP, normals, [BALL, BALL]))
        walls += [slab(R * out, normal, out) for normal in normals]
    return fo.Body.from_parts(balls, seed=high * UP, name="plate"), fo.Body.from_parts(
        walls, seed=(0, 0, 0), name="base"
    )


def kelvin() -> tuple[fo.Body, fo.Body]:
    """One ball between three walls, one in a groove that runs towards it, one on a flat; all slopes alike."""
    slope, balls, walls = np.radians(40.0), [], []
    high = BALL / np.cos(slope)
    first = [np.cos(slope) * UP + np.sin(slope) * ways(degrees)[0] for degrees in (0.0, 120.0, 240.0)]
    balls.append(ball(high * UP, first, [BALL] * 3))
    walls += [slab(np.zeros(3), normal, ways(degrees)[1]) for normal, degrees in zip(first, (0, 120, 240), strict=True)]
    out, across = ways(200.0)
    second = [np.cos(slope) * UP + sign * np.sin(slope) * across for sign in (1.0, -1.0)]
    balls.append(ball(R * out + high * UP, second, [BALL] * 2))
    walls += [slab(R * out, normal, out) for normal in second]
    out = R * ways(290.0)[0]
    balls.append(ball(out + high * UP, [UP], [high]))
    corners = [(x, y, z) for x in (-2.0, 2.0) for y in (-2.0, 2.0) for z in (-1.0, 0.0)]
    walls.append(out + np.array(corners))
    return fo.Body.from_parts(balls, seed=high * UP, name="plate"), fo.Body.from_parts(
        walls, seed=(0, 0, 0), name="base"
    )


@pytest.mark.slow
@pytest.mark.parametrize(("coupling", "slope"), [(maxwell, 45.0), (kelvin, 40.0)])
@pytest.mark.parametrize("scale", [1.02, 0.98])
def test_a_plate_made_larger_rises_by_what_its_balls_grow(coupling, slope: float, scale: float) -> None:
    """Centres run along grooves, or stay; each stands its radius over the cosine of the slope above its vertex."""
    movable, static = coupling()
    problem = fo.Problem(movable, static, target=(scale, 1.0), motion=Free(), goal="at", contacts="all")
    assert len(problem.contacts) == 6
    solution = fo.solve(problem)
    assert solution.usable, solution.certificate
    expected = np.eye(4)
    expected[2, 3] = (scale - 1.0) * BALL / np.cos(np.radians(slope))
    np.testing.assert_allclose(solution.transform, expected, atol=1e-9)
    assert solution.unique_within > 0.0
    assert max(map(abs, solution.contact_gaps.values())) < 1e-9


@pytest.mark.parametrize("coupling", [maxwell, kelvin])
def test_a_coupling_of_parts_made_alike_only_grows(coupling) -> None:
    """Both larger by one factor: every contact is kept by the seed's height alone."""
    movable, static = coupling()
    solution = fo.solve(fo.Problem(movable, static, target=(1.03, 1.03), motion=Free(), goal="at", contacts="all"))
    assert solution.usable, solution.certificate
    expected = np.eye(4)
    expected[2, 3] = 0.03 * movable.seed[2]
    np.testing.assert_allclose(solution.transform, expected, atol=1e-9)
