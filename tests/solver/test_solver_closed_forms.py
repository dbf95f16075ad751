"""Solved problems whose answers are known in closed form, most of them of axis-aligned boxes."""

from __future__ import annotations

import math
from functools import reduce
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases import CUBE, Shape, box_shape, shape, union
from contact_truth import exact_gap

from fcdm_opt.geometry.bodies import Body
from fcdm_opt.motion.motions import Motion, Rotation, Screw, Translation
from fcdm_opt.problem.problem import Problem, load_problems
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.solver import solve

BOXES = load_problems(Path(__file__).parents[2] / "problems" / "boxes.toml")
X, Y, Z = (Translation(axis) for axis in "xyz")
WIDE = ((0.5, 5.0), (0.5, 5.0))
# 1 <= x <= 3/2, seed in its middle, wide in y and z: met by a body of reach h_1 towards x where
# rho_1 h_1 + rho_2 / 4 = 5/4
PLATE = box_shape((1, -2, -2), ("1.5", 2, 2))
HALF = box_shape(("-0.5", "-0.5", "-0.5"), ("0.5", "0.5", "0.5"))
TIP = shape([("0.5", 0, 0), ("-0.5", 0, 0), (0, "0.5", 0), (0, "-0.5", 0), (0, 0, "0.5"), (0, 0, "-0.5")], (0, 0, 0))


def problem(one: Shape, two: Shape, **arguments: Any) -> Problem:
    return Problem(one.body("one"), two.body("two"), **{"box": WIDE, "goal": "touch", "motion": X, **arguments})


SUCCESS = (Status.SOLVED, Status.PAIR_OVERLAPS)


def solved(asked: Problem, amount: float, among: tuple[Status, ...] = SUCCESS, **q: float) -> Solution:
    """The solution, checked: found, judged, of this amount, and these parameters."""
    solution = solve(asked)
    assert solution.status in among
    assert solution.verified, solution.certificate
    scale = max(1.0, amount)
    assert solution.amount == pytest.approx(amount, rel=1e-9, abs=1e-10 * scale)
    assert solution.lower_bound <= amount * (1 + 1e-9) + 1e-12 * scale
    for name, value in q.items():
        assert solution.parameters[name] == pytest.approx(value, rel=1e-6, abs=1e-7 * scale)
    return solution


def refused(asked: Problem, status: Status) -> Solution:
    solution = solve(asked)
    assert solution.status is status
    assert not solution.usable
    assert solution.transform is None
    assert math.isnan(solution.amount)
    assert not solution.parameters
    return solution


# -------------------------------------------------------------------------------------------------- problems/boxes.toml


@pytest.mark.parametrize("case", BOXES, ids=lambda case: case.name)
def test_box_files_answers_are_the_closed_forms_beside_them(case):
    solution = solve(case)
    assert solution.usable
    assert list(solution.parameters.values()) == pytest.approx(case.published, rel=1e-9, abs=1e-9)
    assert solution.amount == pytest.approx(float(np.linalg.norm(case.weights * case.published)), rel=1e-9, abs=1e-12)
    assert solution.lower_bound <= solution.amount
    assert (solution.status is Status.ALREADY_SATISFIED) == (not any(case.published))
    gap = 1.25 - case.target[0] / 2 - case.target[1] / 4 - solution.parameters.get("TX", 0.0)
    if [step for step in case.motion.steps if step.parameters[0].name == "TX"]:
        assert solution.pair_gap == pytest.approx(gap, abs=1e-12)


# ------------------------------------------------------------------------------------------------- one translation


@pytest.mark.parametrize(("axis", "sign"), [(f"{sign}{name}", sign) for name in "xyz" for sign in ("", "-")])
@pytest.mark.parametrize("goal", ["touch", "clear"])
def test_a_cube_is_shifted_by_its_gap_along_every_axis_both_ways(axis, sign, goal):
    direction = np.array([axis[-1] == name for name in "xyz"], dtype=float)
    for side in (1.0, -1.0):
        away = CUBE.shifted(4 * side * direction)
        asked = problem(CUBE, away, motion=Translation(axis), target=(1.5, 3.0), goal=goal)
        q = -0.5 * side * (-1.0 if sign else 1.0)  # overlap of 1.5 + 3 - 4
        solution = solved(asked, 0.5, **{asked.motion.parameters[0].name: q})
        np.testing.assert_allclose(solution.transform[:3, 3], -0.5 * side * direction, atol=1e-12)
        assert solution.pair_state == "touching"
        assert solution.lower_bound == pytest.approx(0.5, rel=1e-12)


def test_a_slanted_translation_is_longer_by_the_cosine():
    solved(problem(HALF, PLATE, target=(1, 1), motion=Translation((3, 4, 0))), 0.5 / 0.6, T=0.5 / 0.6)


@pytest.mark.parametrize("height", [0, 0.5, 1, 2])
def test_a_clearance_of_edges_is_euclidean_along_one_direction(height):
    """Gaps 3 and 4, distance 5, whatever their heights share; flush at height 2."""
    y = math.sqrt(6**2 - 3**2) - 4
    far = CUBE.shifted((5, 6, height))
    solved(problem(CUBE, far, target=(1, 1), motion=Y, goal="clear", clearance=6), y, TY=-y)


def test_a_clearance_of_edges_is_gained_straight_away_from_each_other():
    far = CUBE.shifted((5, 6, 1))
    solution = solved(problem(CUBE, far, target=(1, 1), motion=X >> Y, goal="clear", clearance=6), 1, TX=-0.6, TY=-0.8)
    assert solution.pair_state == "apart"
    solved(problem(CUBE, far, target=(1, 1), motion=X >> Y >> Z, goal="clear", clearance=7), 2, TX=-1.2, TY=-1.6, TZ=0)


def test_boxes_that_only_graze_on_the_way_touch():
    """Their sides are flush: they meet without ever overlapping, which an open interval of overlap does not show."""
    flush = box_shape((-1, -1, -1), (1, 1, 1)).shifted((2, 5, 0))
    solved(problem(CUBE, flush, target=(1, 1), motion=Y), 3.0, TY=3.0)


def test_a_block_that_stands_flush_on_the_floor_slides_out_of_the_wall():
    """The floor's gap is 0 but for rounding, which must not count as an overlap on the whole way."""
    corner = union(box_shape((-9, -9, -9), (9, 9, "-0.3")), box_shape(("0.7", -9, "-0.3"), (9, 9, 9)), seed=(0, 0, 0))
    block = box_shape((0, -1, "-0.3"), ("0.9", 1, 1), seed=("0.1", 0, "0.1"))
    solved(problem(block, corner, target=(1, 1), goal="clear"), 0.2, TX=-0.2)


# ------------------------------------------------------------------------------------------- several translations


@pytest.mark.parametrize("offset", [(3, 0, 1), (5, 6, 1), (5, -6, 0.5), (-5, 6, -7)], ids=["face", "edge", "other edge",
                                                                                          "corner"])  # fmt: skip
def test_cubes_are_brought_together_along_their_distance(offset):
    way = np.sign(offset) * np.maximum(np.abs(offset) - 2.0, 0)
    asked = problem(CUBE, CUBE.shifted(offset), target=(1, 1), motion=X >> Y >> Z)
    solution = solved(asked, float(np.linalg.norm(way)), TX=way[0], TY=way[1], TZ=way[2])
    assert solution.pair_state == "touching"


def test_two_directions_share_the_way_in_proportion_to_their_use():
    motion = X >> Translation((1, 1, 0))  # x + t / sqrt 2 = 1/2, least x^2 + t^2
    q = {"TX": 1 / 3, "T": math.sqrt(2) / 6}
    solution = solved(problem(HALF, PLATE, target=(1, 1), motion=motion), 0.5 / math.sqrt(1.5), **q)
    assert solution.lower_bound > 0
    weighted = problem(HALF, PLATE, target=(1, 1), motion=motion, weights={"TX": 2.0})  # least 4 x^2 + t^2
    solved(weighted, 0.5 / math.sqrt(0.75), TX=0.5 / 3, T=math.sqrt(2) / 3)


def test_a_limit_that_binds_hands_the_rest_to_the_other_direction():
    motion = X >> Translation((1, 1, 0))
    limited = problem(HALF, PLATE, target=(1, 1), motion=motion, limits={"TX": (-1, 0.3)})
    solved(limited, math.hypot(0.3, 0.2 * math.sqrt(2)), TX=0.3, T=0.2 * math.sqrt(2))


# ----------------------------------------------------------------------------------------------------------- rotations


def swung(rho_1: float) -> float:
    """Angle at which a square of half-width 1/2 reaches x = 1: rho_1 (cos t + sin t) / 2 = 1."""
    return math.asin((2 / rho_1) ** 2 - 1) / 2


@pytest.mark.parametrize("axis", ["y", "-y", "z", "-z"])
@pytest.mark.parametrize("rho_1", [1.5, 1.6, 1.9])
def test_an_edge_swings_against_the_face(axis, rho_1):
    asked = problem(HALF, PLATE, target=(rho_1, 1), motion=Rotation(axis))
    solution = solve(asked)
    assert solution.usable
    assert abs(solution.parameters[asked.motion.parameters[0].name]) == pytest.approx(swung(rho_1), abs=1e-9)
    assert solution.amount == pytest.approx(asked.length * swung(rho_1), rel=1e-8)
    assert solution.lower_bound <= asked.length * swung(rho_1) * (1 + 1e-9)


@pytest.mark.parametrize(("low", "high", "sign"), [(-0.1, 0.8, 1), (-0.8, 0.1, -1)])
def test_limits_choose_between_two_mirror_angles(low, high, sign):
    asked = problem(HALF, PLATE, target=(1.6, 1), motion=Rotation("z"), limits={"RZ": (low, high)})
    solved(asked, asked.length * swung(1.6), RZ=sign * swung(1.6))


def test_a_rotation_meets_what_no_translation_along_the_face_can():
    refused(problem(HALF, PLATE, target=(1.6, 1), motion=Y), Status.INFEASIBLE)
    refused(problem(HALF, PLATE, target=(1.6, 1), motion=Y >> Z), Status.INFEASIBLE)
    asked = problem(HALF, PLATE, target=(1.6, 1), motion=Y >> Rotation("z"))
    solution = solved(asked, asked.length * swung(1.6), TY=0.0)
    assert abs(solution.parameters["RZ"]) == pytest.approx(swung(1.6), abs=1e-8)


def test_a_turned_square_swings_free_of_the_face():
    """Target 1.6 at 45 degrees reaches 1.13: it must turn back until it reaches 1."""
    turn = math.radians(45)
    c, s = math.cos(turn), math.sin(turn)
    square = Body.convex([(x * c - y * s, x * s + y * c, z) for x, y, z in HALF.array], seed=(0, 0, 0))
    for goal in ("touch", "clear"):
        asked = Problem(square, PLATE.body(), target=(1.6, 1), motion=Rotation("z"), goal=goal)
        solved(asked, asked.length * (turn - swung(1.6)))


# --------------------------------------------------------------------------------------------------------------- screws


@pytest.mark.parametrize("axis", ["seeds", ((0, 0, 0), (1, 0, 0)), ((7, -3, 2), (1, 0, 0))])
def test_a_screw_of_infinite_pitch_is_the_translation(axis):
    as_screw = solved(problem(HALF, PLATE, target=(1, 1), motion=Screw(axis, math.inf)), 0.5, screw_translation=0.5)
    shifted = solved(problem(HALF, PLATE, target=(1, 1)), 0.5)
    np.testing.assert_allclose(as_screw.transform, shifted.transform, atol=1e-12)
    solved(problem(HALF, PLATE, target=(1, 1), motion=Screw(axis, -math.inf)), 0.5, screw_translation=-0.5)


@pytest.mark.parametrize("pitch", [0.1, -0.1, 1.0, -3.0, 50.0])
def test_a_tip_on_the_axis_of_a_screw_advances_by_the_pitch(pitch):
    asked = problem(TIP, PLATE, target=(1, 1), motion=Screw(((0, 0, 0), (1, 0, 0)), pitch))
    solved(asked, math.hypot(pitch, asked.length) * 0.5 / abs(pitch), screw_angle=0.5 / pitch)
    inside = problem(
        TIP, PLATE, nominal=(1.5, 2), target=(1.53, 2.08), goal="at", motion=Screw(((0, 0, 0), (1, 0, 0)), pitch)
    )
    solved(inside, math.hypot(pitch, inside.length) * 0.035 / abs(pitch), screw_angle=-0.035 / pitch)


def test_a_free_screw_turns_no_more_than_it_must():
    solved(problem(TIP, PLATE, target=(1, 1), motion=Screw()), 0.5, screw_translation=0.5, screw_angle=0)
    flat = problem(TIP, PLATE, target=(1, 1), motion=Screw(((0, 0, 0), (1, 0, 0)), 0.0))
    refused(flat, Status.INFEASIBLE)  # a full turn about its own axis brings the tip no nearer


# --------------------------------------------------------------------------------------------------------------- limits


def test_limits_that_exclude_every_answer_are_infeasible_where_that_is_proved():
    assert refused(problem(HALF, PLATE, target=(1, 1), limits={"TX": (-1, 0.3)}), Status.INFEASIBLE).lower_bound > 0.3
    turn = problem(HALF, PLATE, target=(1.6, 1), motion=Rotation("z"), limits={"RZ": (-0.2, 0.2)})
    assert refused(turn, Status.INFEASIBLE).lower_bound > 0.2 * turn.length
    refused(problem(HALF, PLATE, target=(1.4, 1), motion=Rotation("z")), Status.INFEASIBLE)  # 1.4 / sqrt 2 < 1


def test_without_a_proof_the_status_does_not_claim_one():
    """Proved for translations and up to three parameters: 1/2 to go, .1 allowed, and a corner reaches .21 further."""
    narrow = {"TX": (-0.1, 0.1), "T": (-0.1, 0.1)}
    both = problem(HALF, PLATE, target=(1, 1), motion=X >> Translation((1, 1, 0)), limits=narrow)
    refused(both, Status.INFEASIBLE)
    limits = {"TX": (-0.1, 0.1), "RZ": (-1, 1)}
    turned = problem(HALF, PLATE, target=(1, 1), motion=X >> Rotation("z"), limits=limits)
    refused(turned, Status.INFEASIBLE)
    refused(problem(HALF, PLATE, target=(1, 1), goal="clear", clearance=1, limits={"TX": (-0.4, 1)}), Status.INFEASIBLE)
    three = turned.changed(motion=X >> Rotation("z") >> Y, limits=limits | {"TY": (-1, 1)})
    refused(three, Status.INFEASIBLE)
    tilted = Rotation("z") >> Rotation("x")
    four = turned.changed(motion=X >> Y >> tilted, limits=limits | {"TY": (-1, 1), "RX": (-1, 1)})
    assert 0 < refused(four, Status.NOT_FOUND).lower_bound <= 0.5


def test_limits_that_exclude_rest_still_have_their_least_answer():
    solved(problem(HALF, PLATE, target=(1, 1), limits={"TX": (0.1, 9)}), 0.5, TX=0.5)
    solved(problem(HALF, PLATE, target=(1, 1), limits={"TX": (0.5, 0.5)}), 0.5, TX=0.5)
    solved(problem(HALF, PLATE, target=(1, 1), limits={"TX": (0.6, 9)}), 2, TX=2)  # from behind: 3/2 + 1/2
    solved(problem(HALF, PLATE, target=(1, 1), goal="clear", limits={"TX": (0.1, 9)}), 0.1, TX=0.1)
    solved(problem(HALF, PLATE, target=(1, 1), goal="clear", clearance=0.1, limits={"TX": (0.1, 9)}), 0.1, TX=0.1)
    solved(problem(HALF, PLATE, target=(1, 1), goal="clear", limits={"TX": (0.7, 9)}), 2, TX=2)


def test_limits_that_exclude_rest_are_met_in_two_parameters_too():
    limits = {"TX": (0.6, 9), "TY": (-0.1, 0.1)}
    solved(problem(HALF, PLATE, target=(1, 1), motion=X >> Y, limits=limits), 2, TX=2, TY=0)


# ------------------------------------------------------------- tracked contact: where two lines of boxes cross
#
# Half-widths 1, 1 and 1, 2, offset (4, 5): after a shift (x, y) the lines are rho_1 + rho_2 = 4 - x and
# rho_1 + 2 rho_2 = 5 - y, which cross at (3 - 2 x + y, 1 + x - y); the pair's gap is the larger of
# 4 - x - rho_1 - rho_2 and 5 - y - rho_1 - 2 rho_2.

CROSSING = box_shape((3, 3, -1), (5, 7, 1))
SIGNS = {"A": (1, 1), "B": (1, -1), "C": (-1, 1), "D": (-1, -1)}


def crossing(**arguments: Any) -> Problem:
    return problem(CUBE, CROSSING, **{"nominal": (3, 1), "motion": X >> Y, "goal": "beyond", **arguments})


def shift_to(rho: Any) -> tuple[float, float]:
    """The shift that brings the crossing point to a scale pair."""
    return 4 - rho[0] - rho[1], 5 - rho[0] - 2 * rho[1]


@pytest.mark.parametrize("tau", [1e-9, 1e-6, 0.02, 0.5])
@pytest.mark.parametrize("letter", "ABCD")
def test_at_a_switching_point_two_translations_have_one_answer(letter, tau):
    off = tau * np.array([3.0, 1.0]) * SIGNS[letter]
    x, y = -(off[0] + off[1]), -(off[0] + 2 * off[1])
    solution = solve(crossing(tolerance=tau, requirement=letter, goal="at"))
    assert solution.usable
    assert list(solution.parameters.values()) == pytest.approx([x, y], rel=1e-6, abs=1e-12)
    assert solution.amount == pytest.approx(math.hypot(x, y), rel=1e-6)
    np.testing.assert_allclose(solution.rho, [3 + off[0], 1 + off[1]], rtol=1e-12)


@pytest.mark.parametrize(("letter", "x", "y"), [("A", -0.08, -0.1), ("B", -0.024, 0.012), ("C", 0.024, -0.012),
                                                ("D", 0.08, 0.1)])  # fmt: skip
def test_beyond_a_switching_point_is_a_quadratic_program(letter, x, y):
    """Least x^2 + y^2 with 3 - 2 x + y and 1 + x - y two per cent off: one line active in B, C, both in A, D."""
    solution = solved(crossing(tolerance=0.02, requirement=letter), math.hypot(x, y), TX=x, TY=y)
    np.testing.assert_allclose(solution.rho, [3 - 2 * x + y, 1 + x - y], rtol=1e-9)
    rho = np.array([3, 1]) * (1 + 0.02 * np.array(SIGNS[letter]))
    each = np.array([4 - x - rho.sum(), 5 - y - rho @ [1, 2]])
    gap = np.hypot(*each) if each.min() > 0.0 else each.max()  # apart the distance, else how deep
    assert solution.pair_gap == pytest.approx(gap, abs=1e-9)
    assert solution.status is (Status.PAIR_OVERLAPS if letter == "B" else Status.SOLVED)
    assert solution.pair_state == {"A": "touching", "B": "overlapping", "C": "apart", "D": "touching"}[letter]


@pytest.mark.parametrize("pair", ["clear", "touch"])
def test_beyond_with_a_pair_state_moves_until_the_pair_made_touches(pair):
    """B: x = -0.04 frees the pair (3.06, 0.98), and then y need not move: 3 - 2 x = 3.08, 1 + x = 0.96."""
    solution = solved(crossing(tolerance=0.02, requirement="B", pair=pair), 0.04, TX=-0.04, TY=0)
    assert solution.status is Status.SOLVED
    assert solution.pair_state == "touching"


def test_beyond_with_a_clearance_of_the_pair_made():
    solution = solved(crossing(tolerance=0.02, requirement="B", pair="clear", clearance=0.01), 0.05, TX=-0.05, TY=0)
    assert solution.pair_gap == pytest.approx(0.01, abs=1e-9)


@pytest.mark.parametrize("pair", ["any", "clear", "touch"])
def test_at_a_switching_point_the_pair_made_touches_in_any_case(pair):
    x, y = shift_to((3.06, 0.98))
    assert solved(crossing(target=(3.06, 0.98), goal="at", pair=pair), math.hypot(x, y)).pair_state == "touching"


@pytest.mark.parametrize(("nominal", "target", "x", "y"), [((2, 2), (2.03, 2.02), -0.05, 0),
                                                           ((4, 0.5), (4.1, 0.55), 0, -0.2)])  # fmt: skip
@pytest.mark.parametrize("pair", ["any", "touch"])
def test_at_inside_a_segment_the_line_alone_must_pass_the_target(nominal, target, x, y, pair):
    asked = crossing(nominal=nominal, target=target, goal="at", pair=pair, box=((0.4, 5), (0.4, 5)))
    solution = solved(asked, math.hypot(x, y), TX=x, TY=y)
    np.testing.assert_allclose(solution.rho, target, rtol=1e-12)


# ------------------------------------------------------------------------------------------------- nothing to be done


@pytest.mark.parametrize("letter", "ABCD")
@pytest.mark.parametrize("goal", ["beyond", "at", "touch", "clear"])
def test_a_tolerance_of_zero_asks_for_nothing(letter, goal):
    solution = solve(crossing(tolerance=0, requirement=letter, goal=goal))
    assert solution.status is Status.ALREADY_SATISFIED
    assert solution.usable
    assert solution.amount == solution.lower_bound == 0
    assert list(solution.parameters.values()) == [0, 0]
    np.testing.assert_array_equal(solution.transform, np.eye(4))


@pytest.mark.parametrize("goal", ["beyond", "at", "touch", "clear"])
def test_a_tolerance_of_rounding_size_moves_by_hardly_more(goal):
    for letter in SIGNS:
        solution = solve(crossing(tolerance=1e-12, requirement=letter, goal=goal))
        assert solution.usable
        assert solution.amount < 1e-8


def test_what_is_met_already_stays():
    assert solve(problem(HALF, PLATE, target=(1, 1), goal="clear", clearance=0.5)).status is Status.ALREADY_SATISFIED
    assert solve(problem(HALF, PLATE, target=(2, 1), motion=X >> Rotation("z"))).status is Status.ALREADY_SATISFIED
    limits = {"TX": (-1, 0)}
    assert solve(problem(HALF, PLATE, target=(2, 1), limits=limits)).status is Status.ALREADY_SATISFIED


# -------------------------------------------------------------------------------------------------- the way to the goal

# A wall with a small bump on its face; a tip that glides past it. Contact line rho_1 / 2 + rho_2 / 2 = 3/2 - x.
BUMPED = union(
    box_shape((1, -4, -4), (2, 4, 4)), box_shape(("0.9", "-0.1", "-0.1"), ("1.5", "0.1", "0.1")), seed=("1.5", 0, 0)
)
GLIDING = TIP.shifted((0, 1, 0))
PAST = Translation((-0.01, -2, 0))  # the tip ends as far beyond the bump as it began before it


def test_a_bump_on_the_way_ends_the_coherent_range_and_a_free_path_passes_it():
    asked = problem(GLIDING, BUMPED, nominal=(2, 1), target=(2.02, 1), goal="at", motion=PAST)
    assert solve(asked).status is Status.LEFT_COHERENT_RANGE
    length = math.hypot(0.01, 2)
    solution = solved(asked.changed(path="free"), length, T=length)
    half_way = asked.motion.transform([length / 2], asked.movable.seed, asked.static.seed)
    assert exact_gap(asked, half_way, (2.01, 1)) < -0.09
    assert solution.pair_state == "touching"


def test_a_small_step_short_of_the_bump_is_coherent():
    asked = problem(GLIDING, BUMPED, nominal=(2, 1), target=(2.002, 1), goal="at", motion=PAST)
    solved(asked, math.hypot(0.001, 0.2), T=math.hypot(0.001, 0.2))


def test_a_tip_that_would_leave_its_face_has_no_motion_on_either_path():
    """To close 0.01 the tip would have to glide by 10, and the face ends after 3."""
    asked = problem(GLIDING, BUMPED, nominal=(2, 1), target=(2.02, 1), goal="at", motion=Translation((-0.01, 10, 0)))
    refused(asked, Status.INFEASIBLE)
    refused(asked.changed(path="free"), Status.INFEASIBLE)


# -------------------------------------------------------------------------------------------------------------- unions


def slot(half: str, deep: str = "3") -> Shape:
    """Two walls, `half` either side of x = 0, reaching `deep` either side of y = 0."""
    low, high = ((-9, f"-{deep}", -9), (f"-{half}", deep, 9)), ((half, f"-{deep}", -9), (9, deep, 9))
    return union(box_shape(*low), box_shape(*high), seed=(0, 0, 0))


KEY = box_shape(("-0.7", -1, -1), ("0.7", 1, 1))
SLOT_MOTIONS = [X, X >> Y, X >> Y >> Rotation("z")]


@pytest.mark.parametrize("goal", ["touch", "clear"])
@pytest.mark.parametrize("motion", SLOT_MOTIONS, ids=["x", "x, y", "x, y, turn"])
@pytest.mark.parametrize("off", ["0.3", "0.001", "0.000001"])
def test_a_snug_key_goes_back_to_the_one_place_that_fits(goal, motion, off):
    asked = problem(KEY.shifted((off, 0, 0)), slot("0.7"), target=(1, 1), motion=motion, goal=goal)
    solution = solve(asked)
    assert solution.usable
    assert solution.parameters["TX"] == pytest.approx(-float(off), rel=1e-6)
    assert solution.amount == pytest.approx(float(off), rel=1e-6)
    assert solution.lower_bound <= float(off) * (1 + 1e-9)


@pytest.mark.parametrize("motion", SLOT_MOTIONS, ids=["x", "x, y", "x, y, turn"])
def test_a_key_with_play_goes_only_as_far_as_it_must(motion):
    asked = problem(KEY.shifted(("0.3", 0, 0)), slot("0.8"), target=(1, 1), motion=motion, goal="clear")
    solved(asked, 0.2, TX=-0.2)


def test_a_key_too_wide_for_its_slot_leaves_it_by_the_shorter_way():
    wide = {"target": (1.2, 1), "motion": X >> Y}  # half-widths 0.84 and 1.2 against 0.7
    left = (Status.OUTSIDE_FIT,)
    solved(problem(KEY, slot("0.7", "0.5"), **wide), 0.5 + 1.2, left, TX=0)
    solved(problem(KEY, slot("0.7"), target=(1.2, 1)), 9 + 0.84, left)
    solved(problem(KEY, slot("0.7", "20"), **wide), 9 + 0.84, left, TY=0)


def box_of(rng: np.random.Generator, shift: Any, reach: int) -> tuple[np.ndarray, np.ndarray]:
    low = rng.integers(-reach, reach + 1, 3) + shift
    return low, low + rng.integers(1, 5, 3)


def least_shift(ones: Any, twos: Any, axes: list[int], goal: str) -> float | None:
    """Least translation along some axes after which two unions of boxes touch (are clear); None if there is none.

    A pair of boxes overlaps for shifts in an open box. From outside them all, the nearest point of the closed boxes is
    least; from inside, the nearest point of the complement has each coordinate 0 or a side's.
    """
    rest = [axis for axis in range(3) if axis not in axes]
    open_boxes = []
    for (low, high), (bottom, top) in product(ones, twos):
        start, stop = bottom - high, top - low
        if all(start[axis] < 0 < stop[axis] for axis in rest):
            open_boxes.append((start[axes], stop[axes]))

    def overlaps(shift: np.ndarray) -> bool:
        return any(bool(((low < shift) & (shift < high)).all()) for low, high in open_boxes)

    origin = np.zeros(len(axes))
    if not overlaps(origin):
        if goal == "clear":
            return 0.0
        return min((float(np.linalg.norm(np.clip(origin, *sides))) for sides in open_boxes), default=None)
    places = [sorted({0.0, *(side[k] for sides in open_boxes for side in sides)}) for k in range(len(axes))]
    return min(float(np.linalg.norm(place)) for place in product(*places) if not overlaps(np.array(place)))


@pytest.mark.sampled(7)
@pytest.mark.parametrize("axes", ["x", "xy", "yz", "xyz"])
@pytest.mark.parametrize("counts", [(1, 1), (1, 2), (2, 1), (2, 2)], ids=str)
def test_unions_of_boxes_are_parted_and_brought_together_by_the_least_shift(counts, axes):
    rng = np.random.default_rng([21, len(axes), *counts])
    motion: Motion = reduce(lambda one, two: one >> two, (Translation(axis) for axis in axes))
    found = 0
    for trial in range(3):
        offset = rng.integers(-4, 5, 3)
        ones = [box_of(rng, 0.0, 2) for _ in range(counts[0])]
        twos = [box_of(rng, offset + 0.25, 3) for _ in range(counts[1])]
        seeds = np.array([0.31, 0.47, 0.59]), offset + np.array([0.13, 0.29, 0.41])  # no two sides are ever flush
        rho = np.array([(1.0, 1.0), (1.5, 0.75), (0.75, 1.25)][trial % 3])
        bodies = [
            Body.from_parts([box_shape(low, high).array for low, high in own], seed=seed)
            for own, seed in zip((ones, twos), seeds, strict=True)
        ]
        made = [
            [tuple(seed + r * (side - seed) for side in sides) for sides in own]
            for own, seed, r in zip((ones, twos), seeds, rho, strict=True)
        ]
        for goal in ("touch", "clear"):
            least = least_shift(*made, ["xyz".index(axis) for axis in axes], goal)
            solution = solve(Problem(*bodies, target=rho, motion=motion, goal=goal))
            if least is None:
                assert solution.status in (Status.INFEASIBLE, Status.NOT_FOUND)
                continue
            found += 1
            assert solution.status.found
            assert solution.amount == pytest.approx(least, rel=1e-8, abs=1e-10)
            assert solution.lower_bound <= least * (1 + 1e-9)
    assert found >= 2
