"""Goal "seat": flush contacts stay flush. Answers in closed form, planted errors, refusals, invariances."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases import Shape, box_shape, shape, union
from strategies import random_pose

from fcdm_opt.curve.flush import dimension, flush_contacts
from fcdm_opt.errors import InputError
from fcdm_opt.geometry import judging
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.primitives import Box, cut, joined
from fcdm_opt.judge.certificate import Certificate, verify
from fcdm_opt.motion.motions import Motion, Rotation, Screw, Translation
from fcdm_opt.problem.problem import Problem, load_problems
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.solver import solve

X, Y, Z = (Translation(axis) for axis in "xyz")
RX, RY, RZ = (Rotation(axis) for axis in "xyz")
FREE = X >> Y >> Z >> RX >> RY >> RZ
WIDE = ((0.5, 5.0), (0.5, 5.0))

# The floor's top is z = 0, its seed at z = -1/2. A body with its seed at height h over a contact there has the gap
# (h + 1/2) - h rho_1 - rho_2 / 2.
FLOOR = box_shape((-4, -4, -1), (4, 4, 0))
BLOCK = box_shape((-1, -1, 0), (1, 1, 2))
PRISM = shape([(-1, 0, 0), (1, 0, 0), (-1, -1, 1), (1, -1, 1), (-1, 1, 1), (1, 1, 1)], (0, 0, "0.5"))  # on its edge
RIDGE = shape([(-2, -1, -1), (-2, 1, -1), (2, -1, -1), (2, 1, -1), (-2, 0, 0), (2, 0, 0)], (0, 0, "-0.5"))
# a corner of three walls, seed 1/2 behind each of the two at x = -1, y = -2 and of the floor
WALLS = union(
    FLOOR, box_shape((-4, -4, 0), (-1, 4, 3)), box_shape((-4, -4, 0), (4, -2, 3)), seed=("-1.5", "-2.5", "-0.5")
)
CORNERED = box_shape((-1, -2, 0), (1, 1, 2))
LETTERS = {"A": (1, 1), "B": (1, -1), "C": (-1, 1), "D": (-1, -1)}


def problem(one: Shape, two: Shape, **arguments: Any) -> Problem:
    return Problem(one.body("one"), two.body("two"), **{"box": WIDE, "motion": Z, **arguments})


def named(motion: Motion) -> str:
    return " ".join(parameter.name for parameter in motion.parameters)


def seated(asked: Problem, amount: float, *, exact: bool = True, **q: float) -> Solution:
    """The solution, checked: judged, of this amount and these parameters; exact: in closed form, proved smallest."""
    solution = solve(asked)
    assert asked.goal == "seat"
    assert solution.usable, (solution.status, solution.certificate)
    assert solution.pair_state == "touching"
    assert solution.amount == pytest.approx(amount, rel=1e-9)
    assert solution.lower_bound <= solution.amount
    if exact:
        assert solution.stage.startswith("1")
        assert solution.lower_bound == solution.amount
    for name, value in q.items():
        assert solution.parameters[name] == pytest.approx(value, rel=1e-7, abs=1e-9)
    return solution


def refused(asked: Problem, status: Status) -> Solution:
    solution = solve(asked)
    assert asked.goal == "seat"
    assert solution.status is status
    assert not solution.parameters
    return solution


# ------------------------------------------------------------------------------------------------------ face on face


@pytest.mark.parametrize("motion", [Z, Z >> RX, RX >> Z, RZ >> Z, X >> Y >> Z >> RZ, FREE], ids=named)
@pytest.mark.parametrize("target", [(1.1, 1.0), (0.97, 1.02), (1.5, 0.6)])
def test_a_block_is_lifted_by_its_overlap_and_does_not_turn(motion, target):
    lift = target[0] + target[1] / 2 - 1.5
    solution = seated(problem(BLOCK, FLOOR, target=target, motion=motion), abs(lift), TZ=lift)
    assert all(value == 0 for name, value in solution.parameters.items() if name != "TZ")


@pytest.mark.parametrize("letter", LETTERS)
def test_every_requirement_letter(letter):
    signs, tau = LETTERS[letter], (0.02, 0.03)
    lift = signs[0] * tau[0] + signs[1] * tau[1] / 2
    seated(problem(BLOCK, FLOOR, requirement=letter, tolerance=tau, motion=Z >> RX), abs(lift), TZ=lift, RX=0)


@pytest.mark.parametrize("path", ["coherent", "free"])
@pytest.mark.parametrize("motion", [Z >> RX, FREE, RX >> Z >> RX, RX >> RY >> Z >> RX, Screw("seeds")], ids=named)
def test_the_nonlinear_program_agrees(motion, path):
    asked = problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=motion, path=path)
    solution = solve(asked, model="nlp")
    assert solution.usable
    assert solution.amount == pytest.approx(0.1, rel=1e-9)
    assert 0 < solution.lower_bound <= solution.amount


def test_a_slanted_way_is_longer_and_a_lighter_direction_takes_more():
    seated(problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=Translation((3, 0, 4))), 0.1 / 0.8)
    up = problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=Translation((3, 0, 4)) >> Z, weights={"TZ": 2.0})
    # least (t^2 + 4 z^2) with 0.8 t + z = 0.1: t = 3.2 z
    z = 0.1 / (0.8 * 3.2 + 1)
    seated(up, math.hypot(3.2 * z, 2 * z), T=3.2 * z, TZ=z)


def test_a_screw_advances_by_its_pitch_as_it_turns_about_the_normal():
    screw = Screw(((0, 0, 0), (0, 0, 1)), 0.5)
    asked = problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=screw, length=1.0)
    seated(asked, 0.2 * math.hypot(0.5, 1.0), screw_angle=0.2)


def test_limits_that_bind_hand_the_rest_to_other_directions_or_forbid():
    asked = problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=Translation((0, 3, 4)) >> Z)
    seated(asked.changed(limits={"TZ": (0, 0.02)}), math.hypot(0.1, 0.02), T=0.1, TZ=0.02)
    seated(asked.changed(limits={"TZ": (0.08, 1)}), math.hypot(0.025, 0.08), T=0.025, TZ=0.08)
    both = {"T": (-0.01, 0.01), "TZ": (-0.01, 0.01)}
    assert refused(asked.changed(limits=both), Status.INFEASIBLE).lower_bound == math.inf
    refused(asked.changed(motion=RX >> Z, limits={"RX": (0.1, 1.0)}), Status.INFEASIBLE)


def test_nothing_that_turns_the_block_alone_can_seat_it():
    refused(problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=RX), Status.INFEASIBLE)
    refused(problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=RX >> RY), Status.INFEASIBLE)
    refused(problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=RZ), Status.INFEASIBLE)
    refused(problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=X >> Y), Status.INFEASIBLE)
    refused(problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=RX, path="free"), Status.NOT_FOUND)  # not proved there


def test_what_is_seated_already_stays():
    solution = solve(problem(BLOCK, FLOOR, target=(1.25, 0.5), motion=FREE))
    assert solution.status is Status.ALREADY_SATISFIED
    assert solution.usable


def test_swapped_bodies_move_the_other_way():
    seated(problem(FLOOR, BLOCK, target=(1.02, 1.1), motion=FREE), 0.11, TZ=-0.11)


# ---------------------------------------------------------------------------------------------- faces that slide apart


def test_a_face_that_slides_off_is_proved_to_have_no_place():
    """The block leaves the floor once it has gone 5; the way up by 0.1 takes 10."""
    for path in ("coherent", "free"):
        asked = problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=Translation((100, 0, 1)), path=path)
        refused(asked, Status.INFEASIBLE)
    seated(asked.changed(motion=Translation((40, 0, 1))), 0.1 * math.hypot(40, 1))


def test_a_bump_on_the_way_ends_the_coherent_range():
    bumped = union(FLOOR, box_shape(("0", -1, 0), ("0.2", 1, "0.3")), seed=(0, 0, "-0.5"))
    small = box_shape((-2, "-0.5", 0), (-1, "0.5", 1))
    asked = problem(small, bumped, target=(1.1, 1.0), motion=Translation((50, 0, 1)))
    refused(asked, Status.LEFT_COHERENT_RANGE)
    seated(asked.changed(path="free"), 0.05 * math.hypot(50, 1))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("one", "axis", "reach"),
    [(BLOCK, (1, 0), 5.1), (PRISM, (1, 0), 5.1), (PRISM, (0, 1), 4)],
    ids=["face on face", "edge along itself", "edge across itself"],
)
def test_a_face_slides_no_further_than_it_keeps_a_hold(one, axis, reach):
    """The way up is a thousand times heavier than the slope, which would end beyond the floor's border."""
    slope, height = 0.001, 0.1 if one is BLOCK else 0.05
    motion = Translation((*axis, slope)) >> Z
    asked = problem(one, FLOOR, target=(1.1, 1.0), motion=motion, weights={"TZ": 1e6})
    solution = solve(asked)
    assert solution.usable
    along = solution.parameters["T"] / math.hypot(1, slope)
    assert along == pytest.approx(reach, abs=1e-4)
    assert along < reach
    assert solution.parameters["TZ"] == pytest.approx(height - slope * along, rel=1e-6)
    assert "flush contacts stay on one another" in solution.active


# -------------------------------------------------------------------------------------------------------- edge on face


def test_a_prism_on_its_edge_is_lifted_and_keeps_its_edge_down():
    for motion in (Z, Z >> RY, Z >> RX, FREE, Z >> Rotation((1, 0, 0.5))):
        exact = motion in (Z, Z >> RY)
        solution = seated(problem(PRISM, FLOOR, target=(1.1, 1.0), motion=motion), 0.05, exact=exact, TZ=0.05)
        assert [feature.kind for feature in solution.features] == ["E1F2"]
    seated(problem(FLOOR, PRISM, target=(1.0, 1.1), motion=Z >> RX), 0.05, exact=False, TZ=-0.05)


@pytest.mark.parametrize("motion", [RX, RX >> RY, RX >> RZ])
def test_a_prism_turns_about_its_edge_where_it_cannot_be_lifted(motion):
    """The edge, 0.51 below the seed, must be 0.49 below it: it swings by acos(0.49 / 0.51)."""
    asked = problem(PRISM, FLOOR, target=(1.02, 1.02), motion=motion, length=1.0)
    solution = seated(asked, math.acos(0.49 / 0.51), exact=False)
    assert abs(solution.parameters["RX"]) == pytest.approx(math.acos(0.49 / 0.51), rel=1e-9)


def test_a_prism_cannot_turn_to_reach_further():
    assert solve(problem(PRISM, FLOOR, target=(0.98, 0.98), motion=RX)).status is Status.NOT_FOUND


def test_lifting_and_turning_share_as_their_weights_say():
    """Least (100 t)^2 + a^2 with t = 0.51 cos a - 0.49, by a fine table."""
    asked = problem(PRISM, FLOOR, target=(1.02, 1.02), motion=Z >> RX, length=1.0, weights={"TZ": 100.0})
    a = np.linspace(0, 0.5, 2_000_001)
    least = np.hypot(100 * (0.51 * np.cos(a) - 0.49), a).min()
    assert seated(asked, least, exact=False).amount < math.acos(0.49 / 0.51)


# ------------------------------------------------------------------------------------------------------ edge along edge


STEEP = shape([(-1, "-0.5", 1), (-1, "0.5", 1), (1, "-0.5", 1), (1, "0.5", 1), (-1, 0, 0), (1, 0, 0)], (0, 0, "0.5"))


@pytest.mark.parametrize("motion", [Z, Z >> Y, Y >> Z >> RX, FREE])
def test_a_ridge_on_a_ridge_stays_parallel_and_on_it(motion):
    asked = problem(STEEP, RIDGE, target=(1.1, 1.0), motion=motion)
    assert asked.nominal_contact.configuration == "E-E parallel"
    solution = seated(asked, 0.05, exact=motion in (Z, Z >> Y), TZ=0.05)
    assert [feature.kind for feature in solution.features] == ["E1E2"]


def test_a_ridge_may_not_leave_the_other_to_the_side():
    """A slanted way would touch, edge on slope, elsewhere; the edges meet nowhere on it."""
    for motion in (Y, Translation((0, 1, 1)), Translation((1, 1, 1))):
        refused(problem(STEEP, RIDGE, target=(1.1, 1.0), motion=motion), Status.INFEASIBLE)
    seated(problem(STEEP, RIDGE, target=(1.1, 1.0), motion=Translation((3, 0, 4))), 0.0625)


def test_boxes_edge_along_edge_at_a_switching_point_meet_there_again():
    """rho_1 + s rho_2 = 1 + s towards x, s = 1/2, and towards y, s = 3/2."""
    asked = problem(
        box_shape((-1, -1, -1), (1, 1, 1)),
        box_shape((1, 1, -1), (2, 4, 1)),
        target=(1.1, 0.9),
        goal="seat",
        motion=X >> Y >> RZ,
    )
    assert asked.nominal_contact.configurations == ("E-E parallel",)
    x, y = -(0.1 - 0.05), -(0.1 - 0.15)
    seated(asked, math.hypot(x, y), TX=x, TY=y, RZ=0)


# --------------------------------------------------------------------------------------------- several contacts at once


@pytest.mark.parametrize("motion", [X >> Y >> Z, FREE])
def test_a_block_in_a_corner_keeps_all_three_walls(motion):
    """Reach of the block: 1, 3/2, 1; of the corner: 1/2 each."""
    solution = seated(problem(CORNERED, WALLS, target=(1.02, 0.98), motion=motion, goal="seat"),
                      math.sqrt(0.01**2 + 0.02**2 + 0.01**2), TX=0.01, TY=0.02, TZ=0.01)  # fmt: skip
    assert [feature.kind for feature in solution.features] == ["F1F2"] * 3


def test_a_wall_that_cannot_be_followed_has_no_answer():
    for motion in (X >> Y, Y >> Z, Translation((1, 1, 1)), X >> Y >> RZ):
        refused(problem(CORNERED, WALLS, target=(1.02, 0.98), motion=motion, goal="seat"), Status.INFEASIBLE)
    seated(
        problem(CORNERED, WALLS, target=(1.02, 0.98), motion=Translation((1, 2, 1)), goal="seat"), math.sqrt(6) / 100
    )


def test_two_walls_with_one_line_are_both_kept():
    """Floor and wall are alike, so that the curve cannot tell them apart: rho_1 + rho_2 / 2 = 3/2."""
    walls = union(box_shape((-4, -4, -1), (4, 4, 0)), box_shape((-4, -4, -1), (-1, 4, 3)), seed=("-1.5", 0, "-0.5"))
    asked = problem(BLOCK, walls, target=(1.1, 1.0), motion=X >> Z >> RY)
    assert len(asked.curve.segments) == 1
    solution = seated(asked, math.hypot(0.1, 0.1), TX=0.1, TZ=0.1, RY=0)
    assert len(solution.features) == 2
    seated(asked.changed(motion=Translation((1, 0, 1))), math.hypot(0.1, 0.1))
    refused(asked.changed(motion=Z), Status.INFEASIBLE)


def test_a_key_without_play_fits_at_no_other_sizes():

    def slot(left: str, right: str) -> Shape:
        return union(box_shape((-9, -3, -9), (left, 3, 9)), box_shape((right, -3, -9), (9, 3, 9)), seed=(0, 0, 0))

    key = box_shape(("-0.7", -1, -1), ("0.7", 1, 1))
    for motion in (X, X >> Y >> RZ, FREE):
        for path in ("coherent", "free"):
            asked = problem(key, slot("-0.7", "0.7"), target=(1.02, 0.98), motion=motion, path=path, goal="seat")
            assert "no place" in refused(asked, Status.INFEASIBLE).stage
        stays = solve(asked.changed(target=(1.02, 1.02), path="coherent"))
        assert stays.status is Status.ALREADY_SATISFIED
        assert stays.usable
    off = problem(key.shifted(("0.1", 0, 0)), slot("-0.6", "0.8"), target=(1.02, 1.02), motion=X, goal="seat")
    seated(off, 0.002, TX=0.002)


def test_two_steps_keep_their_height_difference():
    stairs = union(FLOOR, box_shape((-4, -4, 0), (0, 4, 1)), seed=(0, 0, "-0.5"))
    top = union(box_shape(("0.2", -1, 0), (1, 1, 2)), box_shape((-1, -1, 1), (1, 1, 2)), seed=(0, 0, "1.2"))
    for motion in (Z, FREE):
        refused(problem(top, stairs, target=(1.1, 1.0), motion=motion, goal="seat"), Status.INFEASIBLE)
        seated(problem(top, stairs, target=(1.1, 1.1), motion=motion, goal="seat"), 0.17, TZ=0.17)


def test_a_plane_through_both_seeds_stays_in_contact_at_all_sizes():
    walls = union(FLOOR, box_shape((-4, -4, 0), (0, 4, 3)), seed=(0, 0, "-0.5"))
    block = box_shape((0, -1, 0), (2, 1, 2), seed=(0, 0, 1))
    solution = seated(problem(block, walls, target=(1.1, 1.0), motion=FREE), 0.1, TZ=0.1, TX=0)
    assert len(solution.features) == 2


# -------------------------------------------------------------------------------------------------- faces of many parts


def plates(thick: str, seed: Any) -> Shape:
    """An open box of a bottom and four walls, its rim at z = 0: one ring-shaped face."""
    t = thick
    outer = [((-2, -2, -2), (2, 2, "-1.9")), ((-2, -2, "-1.9"), (f"-{t}", 2, 0)), ((t, -2, "-1.9"), (2, 2, 0)),
             ((f"-{t}", -2, "-1.9"), (t, f"-{t}", 0)), ((f"-{t}", t, "-1.9"), (t, 2, 0))]  # fmt: skip
    return union(*(box_shape(low, high) for low, high in outer), seed=seed)


@pytest.mark.parametrize("motion", [Z, FREE])
@pytest.mark.parametrize("letter", LETTERS)
def test_a_lid_lies_on_the_rim_of_a_box_of_five_plates(motion, letter):
    lid, signs = box_shape(("-1.8", "-1.8", 0), ("1.8", "1.8", "0.4")), LETTERS[letter]
    lift = 0.01 * (0.2 * signs[0] + 1.0 * signs[1])
    solution = seated(
        problem(lid, plates("1.7", (0, 0, -1)), requirement=letter, tolerance=0.01, motion=motion), abs(lift), TZ=lift
    )
    assert [feature.kind for feature in solution.features] == ["F1F2"]


def test_a_table_stands_on_all_its_legs_or_is_not_seated():
    legs = [box_shape((x, y, 0), (x + 1, y + 1, 2)) for x in (-2, 1) for y in (-2, 1)]
    table = union(*legs, box_shape((-2, -2, 2), (2, 2, 3)), seed=(0, 0, 2))
    solution = seated(problem(table, FLOOR, target=(1.02, 1.0), motion=FREE), 0.04, TZ=0.04)
    assert len(solution.features) == 4
    slide = problem(table, FLOOR, target=(1.02, 1.0), motion=Translation((80, 0, 1)))  # two legs leave after 2.98
    refused(slide, Status.INFEASIBLE)
    refused(slide.changed(path="free"), Status.INFEASIBLE)
    seated(slide.changed(motion=Translation((70, 0, 1))), 0.04 * math.hypot(70, 1))


def test_a_block_slides_over_the_seam_of_two_parts():
    """The tracked part pair is left behind on the way; the faces, which the seam does not divide, are the same."""
    floor = union(box_shape((-4, -4, -1), (0, 4, 0)), box_shape((0, -4, -1), (4, 4, 0)), seed=(0, 0, "-0.5"))
    small = box_shape((-2, "-0.5", 0), (-1, "0.5", 1))
    solution = seated(
        problem(small, floor, target=(1.1, 1.0), motion=Translation((60, 0, 1))), 0.05 * math.hypot(60, 1)
    )
    assert solution.transform[0, 3] == pytest.approx(3.0)


HALVES = union(box_shape((-1, -1, 0), (0, 1, 2)), box_shape((0, -1, 0), (1, 1, 2)), seed=(0, 0, 1))


@pytest.mark.parametrize(
    "one", [BLOCK, box_shape((0, -1, 0), (2, 1, 2)), PRISM, HALVES], ids=["across", "beside", "edge", "both"]
)
def test_seams_are_no_faces(one):
    """Faces that parts turn to each other touch what lies on the seam, and ask for nothing."""
    for axis in range(2):
        cut = [list(side) for side in ((-4, -4, -1), (4, 4, 0), (-4, -4, -1), (4, 4, 0))]
        cut[1][axis] = cut[2][axis] = 0
        floor = union(box_shape(*cut[:2]), box_shape(*cut[2:]), seed=(0, 0, "-0.5"))
        (flush,) = flush_contacts(one.body(), floor.body(), np.ones(2))
        assert np.abs(flush.normal).tolist() == [0, 0, 1]
        height = float(one.seed[2])
        seated(
            problem(one, floor, target=(1.1, 1.0), motion=FREE), height * 0.1, exact=one is not PRISM, TZ=height * 0.1
        )


# ---------------------------------------------------------------------------------------------- besides flush contacts


def test_a_keep_out_in_the_way_makes_the_block_slide():
    wall = box_shape(("1.02", -2, "0.5"), (3, 2, 3)).body("wall")
    asked = problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=X >> Z, keep_out=(wall,))
    seated(asked, math.hypot(0.08, 0.1), exact=False, TX=-0.08, TZ=0.1)
    refused(asked.changed(motion=Z), Status.INFEASIBLE)


@pytest.mark.parametrize("pair", ["touch", "clear"])
def test_the_pair_made_touches_in_any_case(pair):
    seated(problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=FREE, pair=pair), 0.1, TZ=0.1)


# ----------------------------------------------------------------------------------------------- what "seat" applies to


def test_it_is_the_default_where_the_nominal_contact_is_flush():
    tip = shape([(0, 0, 0), (-1, -1, 1), (1, -1, 1), (0, 1, 1)], (0, 0, "0.5"))
    corner = problem(CORNERED, WALLS, target=(1.02, 0.98), motion=FREE)
    for one in (BLOCK, PRISM):
        assert problem(one, FLOOR, target=(1.1, 1.0)).goal == "seat"
        assert problem(one, FLOOR, requirement="A", tolerance=0.02).goal == "seat"
    assert problem(tip, FLOOR, target=(1.1, 1.0)).goal == "touch"
    assert problem(BLOCK.shifted((0, 0, 1)), FLOOR, target=(1.1, 1.0)).goal == "touch"
    assert corner.goal == "seat"
    assert corner.changed(target=None, requirement="B", tolerance=0.02).goal == "beyond"  # at a switching point


POINTS = {
    "F-V": (shape([(0, 0, 0), (-1, -1, 1), (1, -1, 1), (0, 1, 1)], (0, 0, "0.5")), FLOOR),
    "E-E crossing": (PRISM, shape([(y, x, z) for x, y, z in RIDGE.vertices], (0, 0, "-0.5"))),
    "V-V": (box_shape((0, 0, 0), (1, 1, 1)), box_shape((-1, -1, -1), (0, 0, 0))),
    "E-V": (shape([(0, 0, 0), (-1, -1, 1), (1, -1, 1), (0, 1, 1)], (0, 0, "0.5")), RIDGE),
}  # fmt: skip


@pytest.mark.parametrize("configuration", POINTS)
def test_contacts_that_share_a_point_are_refused_by_their_name(configuration):
    with pytest.raises(InputError, match="no more than a point") as caught:
        problem(*POINTS[configuration], target=(1.1, 1.0), goal="seat")
    assert caught.value.key == "goal"
    assert configuration in str(caught.value.found)
    assert "F-F, F-E or E-E parallel" in caught.value.allowed


def test_without_contact_it_is_refused_with_the_gap():
    with pytest.raises(InputError, match=r"are 0\.5 apart as drawn") as caught:
        problem(BLOCK.shifted((0, 0, "0.5")), FLOOR, target=(1.1, 1.0), goal="seat")
    assert caught.value.key == "nominal"


def test_what_flush_contacts_are_and_share():
    """Face, edge and parallel edges on a face or each other; points and what is apart are none."""
    found = {
        name: flush_contacts(one.body(), two.body(), np.ones(2))
        for name, one, two in (
            ("F-F", BLOCK, FLOOR),
            ("F-E", PRISM, FLOOR),
            ("E-E", STEEP, RIDGE),
            ("apart", BLOCK.shifted((0, 0, 1)), FLOOR),
        )
    }
    assert {name: [flush.dimension for flush in own] for name, own in found.items()} == {
        "F-F": [2], "F-E": [1], "E-E": [1, 1], "apart": [],
    }  # fmt: skip
    assert {flush.touching.kind for flush in found["E-E"]} == {"E1E2"}
    assert not any(flush_contacts(one.body(), two.body(), np.ones(2)) for one, two in POINTS.values())
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    assert [dimension(own, 1e-6) for own in (square[:1], square[[0, 0]], square[:2], square)] == [0, 0, 1, 2]


# --------------------------------------------------------------------------------------------------------- invariances


SCENES: dict[str, tuple[Shape, Shape, Motion, tuple[float, float]]] = {
    "face on face": (BLOCK, FLOOR, Z >> RX >> RZ, (1.1, 1.0)),
    "edge on face": (PRISM, FLOOR, Z >> RX >> RY, (1.1, 1.0)),
    "edge turned on face": (PRISM, FLOOR, RX >> RZ, (1.02, 1.02)),
    "edge along edge": (STEEP, RIDGE, Y >> Z >> RX, (1.1, 1.0)),
    "corner": (CORNERED, WALLS, X >> Y >> Z >> RY, (1.02, 0.98)),
}


def carried(motion: Motion, T: np.ndarray) -> Motion:
    steps = [type(step)(tuple(T[:3, :3] @ np.array(step.direction))) for step in motion.steps]
    made: Motion = steps[0]
    for step in steps[1:]:
        made = made >> step
    return made


@pytest.mark.parametrize("scene", SCENES)
def test_a_common_rigid_motion_changes_no_parameter(scene):
    one, two, motion, target = SCENES[scene]
    T = random_pose(np.random.default_rng([71, 1]), 3.0)
    here = solve(problem(one, two, target=target, motion=motion, goal="seat", length=1.3))
    there = solve(
        Problem(
            one.body().moved(T),
            two.body().moved(T),
            target=target,
            motion=carried(motion, T),
            goal="seat",
            box=WIDE,
            length=1.3,
        )
    )
    assert here.usable
    assert there.usable
    assert there.amount == pytest.approx(here.amount, rel=1e-8)
    q = [np.abs(list(solution.parameters.values())) for solution in (here, there)]
    np.testing.assert_allclose(q[1], q[0], atol=1e-6 * here.amount)


@pytest.mark.parametrize(("scene", "factor"), [*zip(SCENES, itertools.cycle([1e-3, 1e3]), strict=False)])
def test_the_unit_of_length_scales_the_amount_only(scene, factor):
    one, two, motion, target = SCENES[scene]

    def grown(body: Body) -> Body:
        return Body.from_parts([factor * part.vertices for part in body.parts], seed=factor * body.seed)

    asked = problem(one, two, target=target, motion=motion, goal="seat", length=1.3)
    here, there = (
        solve(asked),
        solve(asked.changed(movable=grown(asked.movable), static=grown(asked.static), length=1.3 * factor)),
    )
    assert there.usable
    assert there.amount == pytest.approx(factor * here.amount, rel=1e-8)


def test_the_order_of_parts_changes_nothing():
    asked = problem(CORNERED, WALLS, target=(1.02, 0.98), motion=FREE, goal="seat")
    turned = Body.from_parts([part.vertices[::-1] for part in asked.static.parts[::-1]], seed=asked.static.seed)
    one, two = solve(asked), solve(asked.changed(static=turned))
    assert two.usable
    assert list(two.parameters.values()) == pytest.approx(list(one.parameters.values()), abs=1e-12)


def test_body_in_general_position_turns_no_more_than_it_must():
    """World axes oblique to the floor: a straight way in three angles keeps it flush only without any turn."""
    T = random_pose(np.random.default_rng([72, 0]), 2.0)
    for one, lift in ((BLOCK, 0.1), (PRISM, 0.05)):
        asked = Problem(one.body().moved(T), FLOOR.body().moved(T), target=(1.1, 1.0), motion=FREE, box=WIDE)
        for path in ("coherent", "free"):
            solution = solve(asked.changed(path=path))
            assert solution.usable
            assert solution.amount == pytest.approx(lift, rel=1e-8)


# ----------------------------------------------------------------------------------------------------------- the judge


def failed(certificate: Certificate) -> set[str]:
    return {check.name for check in certificate.failed}


def claimed(asked: Problem, q: dict[str, float], rho: Any = None) -> Solution:
    """A solution that claims these parameters and all contacts, as the parts would stand with them."""
    good = solve(asked)
    assert good.usable
    names = [parameter.name for parameter in asked.motion.parameters]
    values = np.array([q.get(name, 0.0) for name in names])
    gap = asked.curve.__class__(
        asked.movable, asked.static, asked.motion.transform(values, asked.movable.seed, asked.static.seed), asked.box
    ).gap(asked.target)
    state = "touching" if abs(gap) <= asked.contact_slack else "apart" if gap > 0 else "overlapping"
    amount = float(np.linalg.norm(asked.weights * values))
    return replace(
        good,
        status=Status.PAIR_OVERLAPS if state == "overlapping" else Status.SOLVED,
        parameters=dict(zip(names, values.tolist(), strict=True)),
        transform=asked.motion.transform(values, asked.movable.seed, asked.static.seed),
        amount=amount, amount_low=amount, amount_high=amount, lower_bound=0.0, pair_gap=gap, pair_state=state,
        rho=asked.target if rho is None else np.array(rho),
    )  # fmt: skip


EDGE = Rotation("y", (1.1, 0, 0))  # about the block's lower right edge, once it is lifted by 0.1 and grown by 1.1
AT_EDGE = problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=X >> Z >> EDGE, path="free")


def test_the_truth_is_accepted():
    for asked in (AT_EDGE, problem(PRISM, FLOOR, target=(1.1, 1.0), motion=FREE)):
        lift = {"TZ": 0.1 if asked is AT_EDGE else 0.05}
        certificate = verify(claimed(asked, lift))
        assert certificate.passed, certificate.failed
        assert {"seat 1 aligned", "seat 1 shared"} <= {check.name for check in certificate.checks}


def test_a_tilt_about_an_edge_is_told_by_the_alignment():
    """The block still touches along its edge, and nothing overlaps; the rotation's centre moves with nothing.

    Tilted by more than faces of files are off their planes its face does not lie on the other one, either.
    """
    for angle, wrong in ((1e-6, {"seat 1 aligned"}), (1e-3, {"seat 1 aligned", "contact 1"})):
        assert failed(verify(claimed(AT_EDGE, {"TZ": 0.1, "RY": angle}))) == wrong
    tilted = claimed(problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=FREE), {"TZ": 0.1, "RX": 1e-6})
    assert {"seat 1 aligned", "path seat 1 aligned", "touching"} <= failed(verify(tilted))


@pytest.mark.parametrize(("x", "wrong"), [(5.1 - 1e-9, {"seat 1 shared"}), (5.1 - 1e-4, set()), (5.0, set())])
def test_a_face_at_the_border_of_the_other_shares_no_region(x, wrong):
    """The block's side, 1.1 from its middle, reaches the floor's border: faces that meet in a line are not flush."""
    assert failed(verify(claimed(AT_EDGE, {"TX": x, "TZ": 0.1}))) == wrong


def test_a_face_beyond_the_border_of_the_other_is_no_contact():
    assert {"touching", "contact 1", "seat 1 shared"} <= failed(verify(claimed(AT_EDGE, {"TX": 5.2, "TZ": 0.1})))


def test_a_face_on_the_corner_of_the_other_shares_a_point():
    asked = problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=X >> Y >> Z)
    spoilt = failed(verify(claimed(asked, {"TX": 5.1, "TY": 5.1, "TZ": 0.1})))
    assert spoilt == {"seat 1 shared", "path seat 1 shared"}


@pytest.mark.parametrize("off", [1e-6, -1e-6])
def test_a_pair_off_the_target_is_told(off):
    """Lifted to where slightly larger or smaller parts would be flush, and truly so claimed."""
    lift = 0.1 * (1 + off * 11)
    assert failed(verify(claimed(AT_EDGE, {"TZ": lift}, (1.1 * (1 + off), 1.0)))) >= {"requirement"}
    assert failed(verify(claimed(AT_EDGE, {"TZ": lift}))) >= {"touching", "seat 1 aligned"}


def test_a_contact_left_out_is_told():
    asked = problem(CORNERED, WALLS, target=(1.02, 0.98), motion=X >> Y >> Z, goal="seat")
    good = solve(asked)
    assert verify(good).passed
    for k in range(3):
        fewer = replace(good, features=tuple(own for m, own in enumerate(good.features) if m != k))
        assert "nominal features" in failed(verify(fewer))


def test_a_whole_turn_opens_the_contact_on_the_way():
    asked = problem(BLOCK, FLOOR, target=(1.1, 1.0), motion=Z >> RX)
    around = {"TZ": 0.1, "RX": 2 * math.pi}
    assert {"path seat 1 aligned", "path features"} <= failed(verify(claimed(asked, around)))
    assert verify(claimed(asked.changed(path="free"), around)).passed


def test_a_ridge_that_turns_or_steps_off_the_other_is_told():
    asked = problem(STEEP, RIDGE, target=(1.1, 1.0), motion=X >> Y >> Z >> RZ, path="free")
    assert verify(claimed(asked, {"TZ": 0.05})).passed
    assert "seat 1 aligned" in failed(verify(claimed(asked, {"TZ": 0.05, "RZ": 1e-6})))
    assert "seat 1 aligned" in failed(verify(claimed(asked, {"TZ": 0.05, "TY": 1e-6})))
    assert "seat 1 shared" in failed(verify(claimed(asked, {"TZ": 0.05, "TX": 3.1})))


def moved(points: Any, T: np.ndarray) -> np.ndarray:
    return np.array(points, dtype=np.float64) @ T[:3, :3].T + T[:3, 3]


SQUARE = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)]
SHARED: dict[str, tuple[list[Any], list[Any], tuple[float, float]]] = {
    "itself": (SQUARE, SQUARE, (math.sqrt(8), math.sqrt(8))),
    "a corner": (SQUARE, [(1, 1, 0), (3, 1, 0), (3, 3, 0), (1, 3, 0)], (math.sqrt(2), math.sqrt(2))),
    "a strip": (SQUARE, [(-1, 0, 0), (5, 0, 0), (5, 1.5, 0), (-1, 1.5, 0)], (2.5, 2.4)),
    "a cross": ([(-9, -1, 0), (9, -1, 0), (9, 1, 0), (-9, 1, 0)], [(-1, -9, 0), (1, -9, 0), (1, 9, 0), (-1, 9, 0)],
                (math.sqrt(8), math.sqrt(8))),
    "a side": (SQUARE, [(2, 1, 0), (4, 1, 0), (4, 5, 0), (2, 5, 0)], (1, 0)),
    "a point": (SQUARE, [(2, 2, 0), (4, 2, 0), (4, 4, 0), (2, 4, 0)], (0, 0)),
    "nothing": (SQUARE, [(3, 3, 0), (4, 3, 0), (4, 4, 0), (3, 4, 0)], (0, 0)),
    "an edge across": (SQUARE, [(-1, 1, 0), (3, 1, 0)], (2, 0)),
    "an edge within": (SQUARE, [(0.5, 0.5, 0), (1, 0.5, 0)], (0.5, 0)),
    "an edge beside": (SQUARE, [(2, -1, 0), (2, 0.5, 0)], (0.5, 0)),
    "an edge off": (SQUARE, [(3, -1, 0), (3, 0.5, 0)], (0, 0)),
    "edges along": ([(0, 0, 0), (2, 0, 0)], [(3, 0, 0), (1.25, 0, 0)], (0.75, 0)),
    "edges end to end": ([(0, 0, 0), (2, 0, 0)], [(3, 0, 0), (2, 0, 0)], (0, 0)),
}  # fmt: skip


@pytest.mark.parametrize("name", SHARED)
def test_the_judge_measures_what_is_shared(name):
    one, two, (length, width) = SHARED[name]
    T = random_pose(np.random.default_rng(73), 5.0)
    orders: list[Callable[[Any], Any]] = [lambda own: own, lambda own: own[::-1]]
    for order in orders:
        for first, second in ((one, two), (two, one)):
            # three points of the plane besides, which give its normal
            drawn = np.array([*order(first), (0, 0, 0), (1, 0, 0), (0, 1, 0)]), np.array(second)
            rows = [np.arange(len(own)) for own in (first, second)]
            plane, nothing = len(first) + np.arange(3), np.array([], dtype=np.int64)
            placed = [moved(own, T) for own in drawn]
            here = np.zeros((2, 3)), np.ones((1, 2)), np.eye(4)[None]
            found = judging.contact_flushness(*placed, *rows, plane, nothing, 1, *here)[0].tolist()
            assert found == pytest.approx((0.0, length, width), abs=1e-8)


@pytest.mark.parametrize("tilt", [0.0, 4e-12, -4e-12])
def test_a_face_on_a_face_was_named_so_and_seated_as_an_edge_on_it(tilt: float) -> None:
    """By a tolerance of its own: drawn a few digits askew, a taper was asked about otherwise than without these."""
    corners = [(x, y, z) for z in (0.0, 2.0) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    block = Body.convex(np.array([(x, y, z + tilt * x * (z == 0.0)) for x, y, z in corners]), seed=(0.0, 0.0, 1.0))
    asked = {"nominal": "drawn", "tolerance": 0.1, "requirement": "A", "contacts": "all", "motion": Z}
    solution = solve(Problem(block, FLOOR.body("two"), goal="seat", box=WIDE, **asked))
    assert solution.status is Status.SOLVED
    assert solution.parameters["TZ"] == pytest.approx(0.1 + 0.05, abs=1e-9)


def test_a_corner_kept_clear_of_beside_a_face_was_left_to_the_nonlinear_program() -> None:
    """A foot that comes down beside a rib keeps .5 from its edge, 0.44 above it: by Pythagoras, and proved."""
    path = Path(__file__).parents[2] / "problems" / "bracket.toml"
    (asked,) = (problem for problem in load_problems(path) if problem.name == "D flush beside the rib")
    solution = solve(asked)
    least = np.hypot(14.0 - 15.0 * 0.99 - np.sqrt(0.5**2 - 0.44**2), 0.12)
    assert solution.usable
    assert solution.amount == pytest.approx(least, rel=1e-11)
    assert solution.lower_bound == pytest.approx(least, rel=1e-11)
    assert solution.stage.startswith("1:")


def test_limits_of_what_the_contact_holds_were_divided_by_zero() -> None:
    """A block that is seated by z alone, .02 larger, keeps its corner off a post: the shift of .005 along x does it."""
    block, floor, post = (
        Body.convex(list(itertools.product(*zip(low, high, strict=True))), name=name, seed="box")
        for low, high, name in (
            ((0, 0, 0), (1, 1, 1), "block"), ((-5, -5, -1), (5, 5, 0), "floor"), ((1.005, 0, 0), (2, 1, 1), "post"),
        )
    )  # fmt: skip
    motion = Translation("z") >> Translation("x")
    asked = Problem(
        block, floor, tolerance=0.02, requirement="A", motion=motion, limits={"TZ": (-1, 1)}, goal="seat", path="free",
        keep_out=[post],
    )  # fmt: skip
    assert solve(asked).amount == pytest.approx(np.hypot(0.02, 0.005), rel=1e-9)


@pytest.mark.parametrize("goal", ["seat", "at"])
def test_a_lid_that_cannot_be_flush_again_had_no_evidence_of_it(goal: str) -> None:
    """Its plug of 9 becomes wider than its hole of 9.2 and lies 1 deep: only shifts of at most both may touch."""
    lid = joined(Box((20, 20, 2), centre=(0, 0, 1)), Box((9, 9, 2), centre=(0, 0, 0)), name="lid")
    case = cut(Box((20, 20, 8), centre=(0, 0, -4)), Box((9.2, 9.2, 6), centre=(0, 0, -1)), name="case")
    motion = Translation("z")
    problem = Problem(lid, case, tolerance=0.02, requirement="B", nominal="drawn", goal=goal, motion=motion)
    solution = solve(problem, certify=True)
    assert solution.status is Status.INFEASIBLE
    assert solution.evidence is not None
    assert verify(solution, proof=True).passed
    together = solve(problem.changed(contacts="all"), certify=True)
    assert together.status is Status.INFEASIBLE
    assert verify(together, proof=True).passed
