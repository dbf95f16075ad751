"""Bodies and curves that once came out wrong: nearly parallel faces, bodies cut into parts, many sides, odd input."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cases import CUBE, DEFAULT_BOX, box_shape, exact, shape, union
from curve_checks import ODD_BOX, curve_of
from oracles import exact_curve
from strategies import random_rotation

from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.motion.motions import Translation
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Status
from fcdm_opt.solver import solve
from fcdm_opt_benchmarks.stability.contacts.scenes import turned

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


@pytest.mark.sampled(7)
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


# ------------------------------------------------------------------------------------- edges and steps near rounding

SLIM = """
    -0.486484881002 0.340092093451 -0.462044815911  -0.202653738004 1.218407772932 -0.96686523462
    -0.202639605042 1.218393906109 -0.966865282406  -0.104003779974 -1.179662785787 0.035154035309
    -0.103991500411 -1.179651040846 0.035143630311  1.108896151832 -0.02929302475 -0.80848151496
    1.374999707866 0.122649551576 0.908308435348  1.375002502586 0.122647371621 0.908310763664
"""
SLIMMER = """
    -4.764147381785 0.120553337256 -1.107238073647  -4.764147356872 0.120556168566 -1.107238767268
    -3.477580395083 2.062225157973 -2.134754256551  -3.477579487651 2.062226728255 -2.134753254939
    -3.477565222514 2.062213186498 -2.134747395057  -3.269320474084 0.790628301006 -0.356698273129
    -3.269317435701 0.790638380847 -0.356698930428  -3.163881328363 2.722872103465 -0.775734425269
    -3.163880532595 2.72287157696 -0.775733804573  -2.414126115683 0.614293232039 -1.811279460602
    -2.241427368671 1.142021008636 -1.301900152391  -2.241425854629 1.142014635494 -1.301905865667
    -2.241424795838 1.142014548061 -1.301904252904  -2.055363449716 -1.042450634151 -2.004274089849
    -2.055361718655 -1.042430863115 -2.004271149103  -2.055361484055 -1.042448305553 -2.004275505876
"""


def test_edges_of_a_millionth_hid_the_direction_that_separates() -> None:
    """Corners lie about 1e-12 off the faces: which edges meet is beyond what floats can tell."""
    one = Body.convex(
        np.array(SLIM.split(), float).reshape(-1, 3), seed=(0.386337710557, -0.052118378224, -0.112392371737)
    )
    two = Body.convex(
        np.array(SLIMMER.split(), float).reshape(-1, 3), seed=(-3.05511967455, 0.915732808489, -1.355983634014)
    )
    rho, truth = (2.195285834706, 2.122379543085), exact_curve(one.vertices, one.seed, two.vertices, two.seed)
    curve = decision_curve(one, two)
    assert truth.side(rho) == 1
    assert curve.gap(rho) == pytest.approx(truth.gap(rho), abs=1e-12)
    assert curve.distance(rho) == pytest.approx(truth.distance(rho), abs=1e-11)


def nicked(rng: np.random.Generator) -> np.ndarray:
    """Corners of a turned box, two of them cut off by tiny triangles, and everything a little off its planes."""
    points = POINTS * rng.uniform(0.5, 1.5, 3)
    for corner in rng.choice(8, 2, replace=False):
        nicks = points[corner] - np.sign(points[corner]) * np.eye(3) * 10.0 ** rng.uniform(-9, -4)
        points = np.vstack([points, nicks[1:]])
        points[corner] = nicks[0]
    points += rng.normal(size=points.shape) * 10.0 ** rng.uniform(-14, -11)
    return points @ random_rotation(rng).T


@pytest.mark.sampled(6)
@pytest.mark.parametrize("seed", range(16))
def test_tiny_edges_and_nearly_coplanar_faces_turned_signs(seed: int) -> None:
    """Gaps, and signs to within 1e-13 of the curve, of bodies whose edges and folds are of 1e-3 to 1e-15."""
    rng = np.random.default_rng([seed, 81])
    one, two = Body.convex(nicked(rng), seed="vertices"), Body.convex(nicked(rng), seed="vertices")
    way = rng.normal(size=3)
    two = two.moved(
        np.block([[np.eye(3), 3.0 * (way / np.linalg.norm(way))[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
    )
    curve = decision_curve(one, two)
    truth = exact_curve(one.parts[0].vertices, one.seed, two.parts[0].vertices, two.seed)
    ends = [float(end) for end in truth.crossings(1) if end < 10]
    steps = [sign * step for step in (0.0, 1e-13, 1e-12, 1e-9) for sign in (-1, 1)]
    assert ends
    slack = 1e-9 * max(one.size, two.size)
    for rho in (*((1.0, end * (1.0 + step)) for end in ends for step in steps), (1, 0.7), (1, 1.3), (2, 2), (3, 3)):
        gap, true = curve.gap(rho), truth.gap(rho)
        assert np.sign(gap) == truth.side(rho)
        # where they are apart, a direction beside a facet may be wider
        assert gap == pytest.approx(true, abs=slack) or 0 < true < gap <= truth.distance(rho) + slack


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
