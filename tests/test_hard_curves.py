"""Bodies and curves that once came out wrong: nearly parallel faces, bodies cut into parts, many sides, odd input."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cases import CUBE, DEFAULT_BOX, box_shape, exact, shape, union
from curve_checks import ODD_BOX, curve_of
from degenerate import turned

from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.motion import Translation
from fcdm_opt.tolerance.problem import Problem
from fcdm_opt.tolerance.solution import Status
from fcdm_opt.tolerance.solver import solve

POINTS = CUBE.array
SEED = (1, "0.5", "0.5")
WHOLE = box_shape((0, 0, 0), (2, 1, 1), SEED)  # one solid, in one part and in two
CUT = union(box_shape((0, 0, 0), (1, 1, 1)), box_shape((1, 0, 0), (2, 1, 1)), seed=WHOLE.seed)
TIP = shape([(1, "0.25", 3), (3, -1, 4), (3, 2, 4), (-1, "0.5", 5)], ("1.5", "0.5", 4))
EVERY_CUT = pytest.mark.parametrize("bar", [WHOLE, CUT], ids=["whole", "cut"])


def outside_by(curve: DecisionCurve, points: np.ndarray, rho: np.ndarray) -> float:
    """How far the worst point lies outside the nearest part of either scaled body."""
    bodies = curve.movable.scaled(rho[0]).moved(curve.transform), curve.static.scaled(rho[1])
    return max(
        min(float((part.normals @ x - (part.vertices @ part.normals.T).max(axis=0)).max()) for part in body.parts)
        for body in bodies
        for x in points
    )


# --------------------------------------------------------------------------------------------------- nearly parallel


@pytest.mark.parametrize(
    ("offset", "first", "second"),
    [((4, 4, 4), 1e-11, 0.7e-11), ((4, 4, 0), 1e-11, 0.7e-11), ((4, "0.5", "0.25"), 1e-11, 1e-11)],
)
@pytest.mark.parametrize("axis", range(3))
def test_cubes_turned_by_less_than_rounding_lost_parts_of_the_curve(
    offset: tuple[Any, ...], first: float, second: float, axis: int
) -> None:
    """Up to the turn rho_1 + rho_2 = 4, which crosses the box from (1, 3) to (3, 1)."""
    T, two = turned(axis, first) @ turned((axis + 1) % 3, second), CUBE.shifted(offset)
    curve = curve_of(CUBE, two, DEFAULT_BOX, T)
    assert curve.status == exact(CUBE, two, T).status(DEFAULT_BOX) == "contact"
    length = sum(float(np.linalg.norm(segment.end - segment.start)) for segment in curve.segments)
    assert length == pytest.approx(2 * math.sqrt(2), abs=1e-8)
    assert len(curve.branches) == 1


@pytest.mark.parametrize("angle", [1e-10, 1e-9, 1e-8, 3e-8, 1e-7, 1e-6])
@pytest.mark.parametrize("ratio", [0, 0.7, -1.3])
def test_nearly_parallel_cubes_had_a_branch_in_pieces(angle: float, ratio: float) -> None:
    """Both seeds inside: one decreasing curve; its points and corners are the oracle's."""
    two = CUBE.shifted((4, 2, 1))
    for axis in range(3):
        T = turned(axis, angle) @ turned((axis + 1) % 3, ratio * angle)
        curve, truth = curve_of(CUBE, two, DEFAULT_BOX, T), exact(CUBE, two, T)
        for before, after in zip(curve.segments, curve.segments[1:], strict=False):
            np.testing.assert_allclose(before.end, after.start, rtol=1e-9)
        assert len(curve.branches) == 1
        assert len(curve.switching_points) == len(curve.segments) - 1
        for x in np.linspace(1.05, 2.95, 7):
            (y,) = truth.crossings(x, DEFAULT_BOX)
            assert curve.locate((x, float(y))) is not None
        for point in curve.switching_points:
            true = [np.array(rho, dtype=float) for rho, _ in truth.pair.corners(((0.5, 3.5), (0.5, 3.5)))]
            nearest = min(np.abs(rho - point.rho).max() for rho in true)
            assert nearest < max(1e-9, 1e-11 / angle)  # lines this parallel meet no more sharply


# ----------------------------------------------------------------------------------------------- bodies cut in parts


@EVERY_CUT
def test_a_cut_through_the_static_body_changed_the_least_motion(bar: Any) -> None:
    """The solid is the same. The tip on top of the bar: rho_1 + rho_2 / 2 = 7/2 grows by .02 + .05 along z."""
    asked = Problem(TIP.body(), bar.body(), nominal=(1.0, 5.0), tolerance=0.02, requirement="A", box=ODD_BOX, goal="at",
                    motion=Translation("z") >> Translation("x"))  # fmt: skip
    assert solve(asked).amount == pytest.approx(0.07, abs=1e-9)


@EVERY_CUT
@pytest.mark.parametrize("nominal", [(2.2, 2.6), 1])
def test_no_motion_was_found_along_a_segment_joined_across_parts(bar: Any, nominal: Any) -> None:
    asked = Problem(TIP.body(), bar.body(), nominal=nominal, tolerance=0.02, requirement="A", box=ODD_BOX, goal="at",
                    motion=Translation("z") >> Translation("x"))  # fmt: skip
    solution = solve(asked)
    assert solution.status is Status.SOLVED
    assert solution.usable, solution.certificate


def test_contact_points_of_a_segment_joined_across_parts_lay_outside_the_bodies() -> None:
    plate = box_shape(("0.1", "0.1", 3), ("0.3", "0.3", 4), (3, "0.2", "3.5"))
    curve = curve_of(plate, CUT)
    assert curve.segments
    for segment in curve.segments:
        for share in (0.1, 0.3, 0.5, 0.7, 0.9):
            rho = segment.start + share * (segment.end - segment.start)
            assert outside_by(curve, curve.contact_points(rho), rho) < 1e-9
    for point in curve.switching_points:
        assert outside_by(curve, point.contacts, point.rho) < 1e-9


@EVERY_CUT
def test_a_cut_doubled_the_contacts_of_a_switching_point(bar: Any) -> None:
    """Convex solids touch at one point at a corner of their curve; the oracle names its kind on the whole bar."""
    truth = exact(TIP, WHOLE).pair.corners(ODD_BOX)
    points = curve_of(TIP, bar).switching_points
    assert [len(point.contacts) for point in points] == [1] * len(truth)
    assert sorted(point.kind for point in points) == sorted(label.split("(")[0] for _, label in truth)


def test_a_touch_in_the_corner_of_the_box_was_not_located() -> None:
    """Cubes 2 apart, of half-width 1: rho_1 + rho_2 = 2 meets the box from 1 to 3 in its corner alone."""
    curve = curve_of(CUBE, CUBE.shifted((2, 0, 0)), ((1, 3), (1, 3)))
    assert curve.gap((1, 1)) == 0
    np.testing.assert_array_equal(curve.crossings(1.0), [1.0])
    assert curve.locate((1, 1)) is not None
    assert len(curve.contact_points((1, 1))) == 1


# --------------------------------------------------------------------------------------------------------- many sides


@pytest.mark.parametrize("sides", [12, 64, 300])
def test_parallel_prisms_of_many_sides_took_all_memory(sides: int) -> None:
    """Side k has the normal at (2 k + 1) pi / sides and the height cos(pi / sides); the farthest one separates."""
    angles = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    points = np.vstack([np.column_stack([ring, np.full(sides, z)]) for z in (-1.0, 1.0)])
    curve = decision_curve(Body.convex(points), Body.convex(points + np.array([3, 0.5, 0.3])))
    (segment,) = curve.segments
    height, normals = math.cos(math.pi / sides), angles + math.pi / sides
    reach = float((3 * np.cos(normals) + 0.5 * np.sin(normals)).max())
    assert segment.feature.kind == "F1F2"
    np.testing.assert_allclose(segment.line, [height, height, reach], rtol=1e-12)


def test_a_hull_of_many_vertices_is_complete() -> None:
    """Points on a sphere in general position: Euler's formula for triangles, 2 V - 4 of them and 3 V - 6 edges."""
    points = np.random.default_rng(0).normal(size=(1500, 3))
    (part,) = Body.convex(points / np.linalg.norm(points, axis=1)[:, None]).parts
    assert (len(part.vertices), len(part.normals), len(part.edges)) == (1500, 2996, 4494)


# -------------------------------------------------------------------------------------------------- input and results


@pytest.mark.parametrize("factor", [1e-200, 1e-108, 1e100, 1e160, 1e308])
def test_sizes_beyond_floats_gave_a_seed_that_is_no_number(factor: float) -> None:
    try:
        body = Body.convex(POINTS * factor)
    except InputError:  # refused is fine, a cube with other than six faces is not
        return
    assert len(body.parts[0].normals) == 6
    np.testing.assert_allclose(body.seed, 0, atol=1e-9 * factor)
    np.testing.assert_allclose(np.linalg.norm(body.parts[0].normals, axis=1), 1)


def test_complex_vertices_lost_their_imaginary_part() -> None:
    with pytest.raises(InputError):
        Body.convex(POINTS + 1j)


BAD_INPUT: dict[str, Callable[[], object]] = {
    "integer beyond floats": lambda: Body.convex([[10**400, 0, 0]] * 4),
    "ragged rows": lambda: Body.from_parts([[[1, 2, 3], [1, 2]]]),
    "part of one row": lambda: Body.from_parts(POINTS, parts=range(8)),
    "no part": lambda: Body.from_parts(POINTS, parts=[None]),
    "faces as a number": lambda: Body.from_parts(POINTS, parts=[range(8)], faces=3),
    "empty face": lambda: Body.from_parts(POINTS, parts=[range(8)], faces=[[]]),
    "face of two corners": lambda: Body.from_parts(POINTS, parts=[range(8)], faces=[[0, 1]]),
    "scale as a word": lambda: Body.convex(POINTS).scaled("a"),
    "two scales": lambda: Body.convex(POINTS).scaled([1, 2]),
    "ragged box": lambda: decision_curve(CUBE.body(), CUBE.body(), box=[[1, 2], [3]]),
    "box of words": lambda: decision_curve(CUBE.body(), CUBE.body(), box=[["a", "b"], ["c", "d"]]),
}


@pytest.mark.parametrize("name", BAD_INPUT)
def test_bad_input_raised_an_error_of_another_library(name: str) -> None:
    with pytest.raises(InputError):
        BAD_INPUT[name]()


@pytest.mark.parametrize(
    "rho",
    ["ab", (1j, 2), (10**400, 1), {1: 2}, (math.nan, 1), (math.inf, 1), 5, (1, 2, 3)],
    ids=lambda rho: str(rho)[:9],
)
@pytest.mark.parametrize("ask", ["gap", "distance", "locate"])
def test_bad_scale_pairs_raised_an_error_of_another_library(rho: Any, ask: str) -> None:
    curve = curve_of(CUBE, CUBE.shifted((4, 0, 0)))
    with pytest.raises(InputError):
        getattr(curve, ask)(rho)


def test_the_distance_of_bodies_of_no_size_was_answered() -> None:
    with pytest.raises(InputError):
        curve_of(CUBE, CUBE.shifted((4, 0, 0))).distance((0, 0))


def test_the_pose_of_a_curve_could_be_changed() -> None:
    assert not curve_of(CUBE, CUBE.shifted((4, 0, 0))).pose.flags.writeable
