"""Several parts: closed forms, invariances, what is refused, and a judge that is not taken in."""

from __future__ import annotations

import hashlib
import json
import re
import shlex
from dataclasses import replace
from itertools import pairwise, product
from math import atan, atan2, cos, hypot, sin, sqrt
from pathlib import Path
from types import SimpleNamespace

import casadi
import numpy as np
import pytest
import trimesh
from manifold3d import Manifold
from scipy.spatial.transform import Rotation as Turn
from scripts import loaded
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt import pacing
from fcdm_opt.cli import app
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.problem.solution import Status
from fcdm_opt.show.assemblies import assembly_verdict
from fcdm_opt.show.report.gather import head
from fcdm_opt.show.report.page import assembly_page, assembly_report

X, Y, Z = (fo.Translation(axis) for axis in "xyz")


def block(low: tuple[float, ...], high: tuple[float, ...]) -> Array:
    """The corners of a box."""
    return np.array(list(product(*zip(low, high, strict=True))), dtype=float)


def drawn(outline: list[tuple[float, float]], low: float, high: float) -> Array:
    """The corners of a prism along y over an outline in x and z."""
    return np.array([[x, y, z] for y in (low, high) for x, z in outline], dtype=float)


def found(solution: fo.AssemblySolution) -> dict[str, list[float]]:
    return {part: list(own.values()) for part, own in solution.parameters.items()}


def flat(solution: fo.AssemblySolution) -> list[float]:
    return [x for own in found(solution).values() for x in own]


# ------------------------------------------------------------------------------------------------------------- chains


def stack(count: int, scales: list[float], **more) -> fo.Assembly:
    """Plates on one another, each 1 high, on a base; seeds .3 above their lower face, of the base .3 below its top."""
    parts = {"base": fo.Body.convex(block((-5, -5, -1), (5, 5, 0)), seed=(0, 0, -0.3))}
    for k in range(count):
        corners = block((0.1 * k - 4, -4, k), (4 - 0.1 * k, 4, k + 1))
        parts[f"plate {k + 1}"] = fo.Body.convex(corners, seed=(0, 0, k + 0.3))
    names = list(parts)
    asked = {
        "contacts": [(two, one) for one, two in pairwise(names)],
        "motions": dict.fromkeys(names[1:], Z),
        "scales": dict(zip(names, scales, strict=False)),
    }
    return fo.Assembly(parts, **{**asked, **more})


def lifts(count: int, scales: list[float]) -> list[float]:
    """How far each plate rises on the one below, both as made."""
    tops = [-0.3 + 0.3 * scales[0], *(k + 0.3 + 0.7 * scales[k + 1] for k in range(count))]
    bottoms = [k + 0.3 - 0.3 * scales[k + 1] for k in range(count)]
    return [top - bottom for top, bottom in zip(tops, bottoms, strict=False)]


SCALES = [1.02, 0.99, 1.01, 1.03, 0.98, 1.0, 0.97]


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5])
def test_a_stack_of_plates_in_closed_form(count) -> None:
    solution = fo.solve_assembly(stack(count, SCALES))
    expected = lifts(count, SCALES)
    assert solution.usable
    assert [own[0] for own in found(solution).values()] == pytest.approx(expected, abs=1e-12)
    assert solution.amount == pytest.approx(hypot(*expected), rel=1e-12)
    assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-12)
    heights = np.cumsum(expected)
    assert [solution.transforms[part][2, 3] for part in solution.parameters] == pytest.approx(heights, abs=1e-12)


def test_motions_in_the_world_are_one_program_with_the_same_poses() -> None:
    """Then the lowest plate's lift is paid by each above it, and the poses, which have no choice here, stay."""
    names = {f"plate {k + 1}": "base" for k in range(3)}
    one, other = fo.solve_assembly(stack(3, SCALES)), fo.solve_assembly(stack(3, SCALES, follows=names))
    expected = np.cumsum(lifts(3, SCALES))
    assert other.usable
    assert [own[0] for own in found(other).values()] == pytest.approx(expected, abs=1e-12)
    assert other.amount == pytest.approx(hypot(*expected), rel=1e-12)
    assert other.lower_bound == pytest.approx(other.amount, rel=1e-12)
    for part, pose in one.transforms.items():
        assert other.transforms[part] == pytest.approx(pose, abs=1e-12)


def test_weights_and_order_of_parts_change_the_total_and_nothing_else() -> None:
    assembly = stack(3, SCALES)
    heavy = stack(3, SCALES, weights={"plate 2": 5.0}, contacts=[pair[1::-1] for pair in reversed(assembly.contacts)])
    one, other = fo.solve_assembly(assembly), fo.solve_assembly(heavy)
    assert found(one) == found(other)
    a, b, c = lifts(3, SCALES)
    assert other.amount == pytest.approx(hypot(a, 5.0 * b, c), rel=1e-12)
    assert list(other.amounts.values()) == pytest.approx([abs(a), abs(b), abs(c)], rel=1e-12)


def test_an_arm_on_stops_turns_about_its_joints() -> None:
    """Each link rests with a pointed nose on the one before, and turns about a joint of it: one angle in closed form.

    The nose is at (4, 1) from the joint and meets the plane z = 1 of the link before: seeds are the joints, so that
    what is made is larger round its joint. Turned by t the nose is at height s (4 sin t + cos t) where it must be 1.
    """
    parts = {"base": fo.Body.convex(block((-1, -2, -1), (6, 2, 1)), seed=(0, 0, 0))}
    motions, scale = {}, 0.97
    for k in range(3):
        joint = np.array([6.0 * k, 0.0, 2.0 * k])
        bar = joint + block((0, -1, 2), (11, 1, 3))
        nose = joint + np.array([[4, 0, 1], [3.5, -0.5, 2.5], [4.5, -0.5, 2.5], [4, 0.5, 2.5]])
        parts[f"link {k + 1}"] = fo.Body.from_parts([bar, nose], seed=joint)
        motions[f"link {k + 1}"] = fo.Rotation("-y", centre=tuple(joint))
    names = list(parts)
    contacts = [(two, one) for one, two in pairwise(names)]
    # of link 2 and 3 what they rest on is the upper face of the bar before, 3 above its joint, which is 1 below theirs
    solution = fo.solve_assembly(fo.Assembly(parts, contacts, motions=motions, scales=dict.fromkeys(names[1:], scale)))
    assert solution.usable
    first = solution.parameters["link 1"]["R-Y"]
    assert scale * (4.0 * sin(first) + cos(first)) == pytest.approx(1.0, abs=1e-12)
    for name in names[2:]:  # the face before is lower by what its link is smaller: 3 (1 - s)
        angle = solution.parameters[name]["R-Y"]
        assert scale * (4.0 * sin(angle) + cos(angle)) == pytest.approx(3.0 * scale - 2.0, abs=1e-12)
    assert solution.lower_bound >= solution.amount * (1.0 - 1e-2)
    proved = fo.solve_assembly(solution.assembly, certify=True)
    assert proved.lower_bound >= proved.amount * (1.0 - 1e-4)


# -------------------------------------------------------------------------------------------------------------- loops


def wedges(post: fo.Motion, roof: fo.Motion, **more) -> fo.Assembly:
    """A key between the slopes z = -x - 1 and z = x - 1 of two wedges on a base: a loop of four parts."""
    base = fo.Body.convex(block((-10, -4, -1), (10, 4, 0)), seed=(0, 0, -0.5), name="base")
    left = fo.Body.convex(drawn([(-8, 0), (-3, 0), (-3, 2), (-8, 7)], -2, 2), seed=(-6, 0, 2), name="left")
    right = fo.Body.convex(drawn([(8, 0), (3, 0), (3, 2), (8, 7)], -2, 2), seed=(6, 0, 2), name="right")
    key = fo.Body.convex(drawn([(-6, 5), (6, 5), (-4, 3), (4, 3), (0, 9)], -1, 1), seed=(0, 0, 5), name="key")
    contacts = [("left", "base"), ("right", "base"), ("key", "left"), ("key", "right")]
    motions = {"left": post, "right": post, "key": roof}
    return fo.Assembly([base, left, right, key], contacts, motions=motions, **more)


MADE = {"base": 1.03, "left": 1.02, "right": 1.01, "key": 0.99}


def levels() -> tuple[Array, Array]:
    """The four contacts as equations A q = b in (left x, z; right x, z; key x, z), the key relative to the left wedge.

    b are the gaps as made and not moved. Distances of planes from seeds: base .5; wedges 2 below, 3 / sqrt(2) on the
    slopes; key 6 / sqrt(2) on both sides.
    """
    s, r = MADE, sqrt(2.0)
    top = -0.5 + 0.5 * s["base"]
    floors = [2.0 - 2.0 * s["left"] - top, 2.0 - 2.0 * s["right"] - top]
    key = (5.0 + 1.0) / r - 6.0 / r * s["key"]  # from the plane as drawn to the key's, along (1, 1) or (-1, 1)
    left = (-6.0 + 2.0 + 1.0) / r + 3.0 / r * s["left"]  # to the wedge's
    right = (-6.0 + 2.0 + 1.0) / r + 3.0 / r * s["right"]
    rows = [
        [0, -1, 0, 0, 0, 0],
        [0, 0, 0, -1, 0, 0],
        [0, 0, 0, 0, -1 / r, -1 / r],
        [1 / r, -1 / r, -1 / r, 1 / r, 1 / r, -1 / r],  # the left wedge takes the key along
    ]
    return np.array(rows), np.array([*floors, key - left, key - right])


def test_a_loop_of_four_parts_in_closed_form() -> None:
    solution = fo.solve_assembly(wedges(Z, X >> Z, scales=MADE))
    rows, gaps = levels()
    kept = [1, 3, 4, 5]
    assert solution.usable
    assert flat(solution) == pytest.approx(np.linalg.solve(rows[:, kept], gaps), abs=1e-12)
    assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-12)
    assert len(solution.stages) == 1


def test_a_loop_with_freedom_left_takes_the_least_total() -> None:
    rows, gaps = levels()
    for weights in ({}, {"left": 4.0, "key": 0.5}):
        w = np.repeat([weights.get(part, 1.0) for part in ("left", "right", "key")], 2)
        solution = fo.solve_assembly(wedges(X >> Z, X >> Z, scales=MADE, weights=weights))
        least = np.linalg.pinv(rows / w) @ gaps / w
        assert solution.usable
        assert flat(solution) == pytest.approx(least, abs=1e-12)
        assert solution.amount == pytest.approx(np.linalg.norm(w * least), rel=1e-12)
        assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-12)


def test_a_loop_that_may_turn_is_bounded() -> None:
    turn = fo.Rotation("y")
    solution = fo.solve_assembly(wedges(X >> Z >> turn, X >> Z >> turn, scales=MADE))
    rows, gaps = levels()
    assert solution.usable
    assert solution.amount <= np.linalg.norm(np.linalg.pinv(rows) @ gaps) * (1.0 + 1e-9)  # which needs no turn
    assert solution.lower_bound >= 0.9 * solution.amount


@pytest.mark.slow
def test_a_loop_of_parts_that_may_all_turn_was_bounded_by_half() -> None:
    """Six parameters a part: the bound was that of the beam on one of its posts alone."""
    free = {"left": fo.Free(), "right": fo.Free()}
    solution = fo.solve(bridge({"left": 1.02, "right": 0.98}, fo.Free(), motions=free))
    assert solution.usable
    assert solution.lower_bound >= 0.9 * solution.amount


def tip(x: float, high: float) -> Array:
    return np.array([[x, 0, high], [x - 1, -1, 0], [x + 1, -1, 0], [x + 1, 1, 0], [x - 1, 1, 0]], dtype=float)


def bridge(
    scales: dict[str, float], motion: fo.Motion, goal: str = "at", T: Array | None = None, **more
) -> fo.Assembly:
    """A beam on two points of unequal height that stand on a base."""
    parts = [
        fo.Body.convex(block((-10, -4, -1), (10, 4, 0)), seed=(0, 0, -0.5), name="base"),
        fo.Body.convex(tip(-5, 3), seed=(-5, 0, 0), name="left"),
        fo.Body.convex(tip(5, 4), seed=(5, 0, 0), name="right"),
        fo.Body.convex(drawn([(-7, 2.8), (7, 4.2), (7, 6), (-7, 6)], -2, 2), seed=(0, 0, 3.5), name="beam"),
    ]
    parts = parts if T is None else [replace(body.moved(T), name=body.name) for body in parts]
    contacts = [
        ("left", "base"),
        ("right", "base"),
        *({"parts": ("beam", side), "goal": goal} for side in ("left", "right")),
    ]
    motions = {"left": Z, "right": Z, "beam": motion, **more.pop("motions", {})}
    return fo.Assembly(parts, contacts, scales=scales, motions=motions, **more)


def test_a_loop_that_turns_in_closed_form() -> None:
    """The beam's seed is in its lower plane, which the points as made tilt and lift."""
    solution = fo.solve_assembly(bridge({"left": 1.02, "right": 0.98}, Z >> fo.Rotation("y")))
    low, high = 3.0 * 1.02, 4.0 * 0.98
    tilt = atan(0.1) - atan2(high - low, 10.0)
    assert solution.usable
    assert found(solution)["beam"] == pytest.approx([(low + high) / 2.0 - 3.5, tilt], abs=1e-12)
    assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-12)  # by interval Newton


def test_what_touches_and_what_is_clear_in_a_loop() -> None:
    """Along z alone the beam cannot rest on both points: one carries, the other is clear; and both cannot be asked."""
    asked = bridge({"left": 1.02, "right": 0.98}, Z)
    pairs = [{"parts": pair[:2], **pair.asked} for pair in asked.contacts]
    one = [*pairs[:2], {"parts": ("beam", "left"), "goal": "touch"}, {"parts": ("beam", "right"), "goal": "clear"}]
    more = {"motions": asked.motions, "scales": asked.scales}
    solution = fo.solve_assembly(fo.Assembly(asked.parts, one, **more))
    assert solution.usable
    assert found(solution)["beam"] == pytest.approx([0.06], abs=1e-12)
    assert solution.lower_bound == pytest.approx(0.06, rel=1e-9)
    kept = [*one[:3], {"parts": ("beam", "right"), "goal": "clear", "clearance": 0.25}]
    assert fo.solve_assembly(fo.Assembly(asked.parts, kept, **more)).status is Status.INFEASIBLE
    assert fo.solve_assembly(asked).status is Status.INFEASIBLE
    assert not fo.solve_assembly(asked).usable


def test_a_common_rigid_motion_changes_nothing() -> None:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Turn.from_rotvec([0.3, -0.5, 0.2]).as_matrix(), (4.0, -2.0, 1.0)
    scales, lengths = {"left": 1.02, "right": 0.98}, {"beam": 8.0, "left": 2.0, "right": 2.0}
    free = {"left": fo.Free(), "right": fo.Free()}
    here = fo.solve_assembly(bridge(scales, fo.Free(), lengths=lengths, motions=free), effort="quick")
    there = fo.solve_assembly(bridge(scales, fo.Free(), T=T, lengths=lengths, motions=free), effort="quick")
    assert there.usable
    assert there.amount == pytest.approx(here.amount, rel=1e-9)
    for part, own in found(here).items():
        turned = np.array(own).reshape(2, 3) @ T[:3, :3].T
        assert np.array(found(there)[part]) == pytest.approx(turned.ravel(), abs=1e-8)


def test_parts_that_would_overlap_make_way_for_each_other() -> None:
    """Two blocks on a base, .02 apart, 2 % too large: each alone rises; together they share the way aside by weight."""
    base = fo.Body.convex(block((-9, -4, -1), (9, 4, 0)), seed=(0, 0, -0.5), name="base")
    one = fo.Body.convex(block((-4, -1, 0), (-0.01, 1, 2)), seed=(-2, 0, 1), name="one")
    two = fo.Body.convex(block((0.01, -1, 0), (4, 1, 2)), seed=(2, 0, 1), name="two")
    weights = {"one": 1.0, "two": 3.0}
    assembly = fo.Assembly(
        [base, one, two], [("one", "base"), ("two", "base")], motions={"one": X >> Z, "two": X >> Z},
        scales={"one": 1.02, "two": 1.02}, weights=weights,
    )  # fmt: skip
    solution = fo.solve_assembly(assembly)
    overlap = 2 * (1.99 * 0.02) - 0.02
    assert solution.usable
    assert found(solution)["one"] == pytest.approx([-overlap * 0.9, 0.02], abs=1e-9)
    assert found(solution)["two"] == pytest.approx([overlap * 0.1, 0.02], abs=1e-9)
    assert solution.gaps["one", "two"] == pytest.approx(0.0, abs=1e-9)
    assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-9)


@pytest.mark.parametrize("motion", [Z, Z >> fo.Rotation("y"), fo.Free()], ids=["rise", "tilt", "free"])
def test_contacts_of_a_loop_that_exclude_each_other_are_named(motion) -> None:
    """A beam flat on two posts, one .04 higher and one .02 lower than drawn: all four contacts clash, any three do."""
    parts = {
        "floor": fo.Body.convex(block((-5, -5, -1), (5, 5, 0))),
        "left": fo.Body.convex(block((-4, -1, 0), (-3, 1, 2))),
        "right": fo.Body.convex(block((3, -1, 0), (4, 1, 2))),
        "beam": fo.Body.convex(block((-4.5, -1, 2), (4.5, 1, 3))),
    }
    contacts = [("left", "floor"), ("right", "floor"), ("beam", "left"), ("beam", "right")]
    motions, made = dict.fromkeys(("left", "right", "beam"), motion), {"left": 1.02, "right": 0.99}
    solution = fo.solve_assembly(fo.Assembly(parts, contacts, motions=motions, scales=made))
    clash, *carry = solution.active
    assert solution.status is (Status.INFEASIBLE if motion.shifts else Status.NOT_FOUND)
    assert all(" - ".join(pair) in clash for pair in contacts)
    assert "exclude each other" in clash
    assert {told.split(" with ")[1] for told in carry} == {
        "right - floor open by 0.06",
        "beam - right open by 0.06",
    }


CORNER = {
    "floor": fo.Body.convex(block((-5, -5, -1), (5, 5, 0)), seed=(0, 0, -0.5)),
    "wall": fo.Body.convex(block((4, -5, 0), (5, 5, 3)), seed=(4.5, 0, 1.5)),
    "back": fo.Body.convex(block((-5, 4, 0), (5, 5, 3)), seed=(0, 4.5, 1.5)),
    "block": fo.Body.convex(block((-4, -4, 0), (4, 4, 1)), seed=(0, 0, 0.5)),
}


@pytest.mark.slow
@pytest.mark.parametrize("motion", [X >> Y >> Z, fo.Free()], ids=["shifts", "free"])
@pytest.mark.parametrize("asked", [("floor", "wall", "back"), ("floor", "wall")], ids=["all", "one in the way"])
def test_a_block_between_fixed_parts_of_sizes_of_their_own(motion, asked) -> None:
    """Fixed parts may overlap each other as made; what is not asked for is not run into."""
    scales = {"block": 1.02, "floor": 0.99, "wall": 1.01, "back": 1.03}
    assembly = fo.Assembly(
        CORNER, [("block", part) for part in asked], motions={"block": motion}, scales=scales
    )  # fmt: skip
    solution = fo.solve_assembly(assembly)
    expected = [-0.08 - 0.005, -0.08 - 0.015, 0.01 - 0.005]
    assert assembly.fixed == ("floor", "wall", "back")
    assert solution.usable
    assert flat(solution)[:3] == pytest.approx(expected, abs=1e-9)
    assert ("floor", "wall") not in solution.gaps
    if motion.shifts or len(asked) == 3:
        assert solution.lower_bound == pytest.approx(hypot(*expected), rel=1e-9)


def test_sizes_of_parts_are_made_and_their_contacts_restored() -> None:
    """Plates whose upper or lower face came out elsewhere: each rises by what is thicker between them."""
    sizes = [
        fo.Size("floor", body="base", faces="+z", tolerance=0.05),
        fo.Size("thickness 1", body="plate 1", faces=["+z", "-z"], each=0.5, tolerance=0.05),
        fo.Size("sole 2", body="plate 2", faces="-z", tolerance=0.02),
    ]
    made = {"floor": -0.03, "thickness 1": 0.04, "sole 2": -0.01}
    solution = fo.solve_assembly(stack(2, [1.0] * 3, sizes=sizes, made=made))
    assert solution.usable
    assert [own[0] for own in found(solution).values()] == pytest.approx([-0.03 + 0.02, 0.02 - 0.01], abs=1e-12)
    high = fo.solve_assembly(stack(2, [1.0] * 3, sizes=sizes, made="high"))
    assert [own[0] for own in found(high).values()] == pytest.approx([0.05 + 0.025, 0.025 + 0.02], abs=1e-12)
    both = fo.solve_assembly(stack(2, SCALES, sizes=sizes, made=made))
    one, two = lifts(2, SCALES)
    shares = -0.03 * SCALES[0] + 0.02 * SCALES[1], 0.02 * SCALES[1] - 0.01 * SCALES[2]
    assert [own[0] for own in found(both).values()] == pytest.approx([one + shares[0], two + shares[1]], abs=1e-12)


def test_nothing_to_do_is_said() -> None:
    solution = fo.solve_assembly(stack(2, [1.0] * 3))
    assert solution.status is Status.ALREADY_SATISFIED
    assert solution.usable
    assert solution.amount == 0.0


# ------------------------------------------------------------------------- amounts, letters and corners of its own


@pytest.mark.parametrize("root", [False, True])
def test_an_assembly_took_no_amount_of_ones_own(root) -> None:
    """Squares of parameters, each at its own price, and their root: the least of the equations at other weights."""
    costs, (rows, gaps) = np.array([1.0, 4.0, 9.0, 1.0, 25.0, 0.25]), levels()
    asked = wedges(X >> Z, X >> Z, scales=MADE)
    names = [own.name for own in asked.coordinates]
    amount = sum(cost * casadi.SX.sym(name) ** 2 for cost, name in zip(costs, names, strict=True))
    asked = asked.changed(amount=casadi.sqrt(amount) if root else amount)
    solution = fo.solve(fo.Assembly.from_dict(json.loads(json.dumps(asked.to_dict()))), certify=True)
    w = np.sqrt(costs)
    least = np.linalg.pinv(rows / w) @ gaps / w
    assert solution.usable
    assert flat(solution) == pytest.approx(least, abs=1e-9)
    assert solution.amount == pytest.approx(np.linalg.norm(w * least) ** (1 if root else 2), rel=1e-9)
    assert fo.verify(fo.AssemblySolution.from_dict(json.loads(json.dumps(solution.to_dict())))).passed
    assert not fo.verify(replace(solution, amount=0.9 * solution.amount)).passed


def test_an_own_amount_of_the_one_motion_of_a_loop_that_turns_is_proved() -> None:
    asked = bridge({"left": 1.02, "right": 0.98}, Z >> fo.Rotation("y"))
    amount = sum(casadi.SX.sym(own.name) ** 2 for own in asked.coordinates)
    solution = fo.solve(asked.changed(amount=amount), certify=True)
    assert solution.usable
    assert flat(solution) == pytest.approx(flat(fo.solve(asked)), abs=1e-12)
    assert solution.lower_bound == pytest.approx(float(np.square(flat(solution)).sum()), rel=1e-12)
    assert fo.verify(solution, proof=True).passed
    assert not fo.verify(replace(solution, lower_bound=1.01 * solution.lower_bound), proof=True).passed


def test_an_own_amount_of_a_loop_with_freedom_left_had_no_bound() -> None:
    """One parameter at least moves as far as the least weighted amount asks for, and costs what it costs there."""
    asked = bridge({"left": 1.02, "right": 0.98}, X >> Z >> fo.Rotation("y"))
    amount = sum((k + 1) * casadi.SX.sym(own.name) ** 2 for k, own in enumerate(asked.coordinates))
    solution = fo.solve(asked.changed(amount=amount), certify=True)
    assert 0.1 * solution.amount < solution.lower_bound <= solution.amount
    assert fo.verify(solution, proof=True).passed
    assert not fo.verify(replace(solution, lower_bound=1.05 * solution.lower_bound), proof=True).passed


def solid(size: tuple[float, ...], centre: tuple[float, ...], name: str) -> fo.Body:
    return fo.Box(size, centre=centre, name=name)


FLUSH = (("low", "floor"), ("up", "low"))
TOUCHING = tuple({"parts": own, "goal": "touch"} for own in FLUSH)


@pytest.mark.parametrize(
    ("lift", "contacts", "scale", "wall", "amount"),
    [
        (0.0, FLUSH[:1], 1.02, 1.9, hypot(0.14, 0.02)),  # flush, and its side at 2.04 goes to the wall
        (0.0, FLUSH, 1.02, 0.9, hypot(1.14, 0.02, 0.04)),  # over the wall's foot is no way out: it must stay flush
        (0.1, TOUCHING, 1.0, 0.9, hypot(0.55, 0.55, 0.1, 0.2)),  # the upper one goes with the lower one, by as much
    ],
)
@pytest.mark.parametrize("certify", [False, True])
def test_what_is_proved_of_an_assembly_beside_a_keep_out_was_not_confirmed(
    lift, contacts, scale, wall, amount, certify
) -> None:
    low = solid((4, 2, 4), (0, 1 + lift, 0), "low")
    up = solid((2, 2, 2), (0 if lift == 0 else 1, 3 + 3 * lift, 0), "up")
    foot = 0.0 if lift == 0 else 2.5 + lift  # beside both, or the upper one alone
    keep_out = solid((10, 20, 40), (wall + 5, foot + 10, 0), "wall")
    parts = [solid((40, 10, 40), (0, -5, 0), "floor"), low, up][: 1 + len(contacts)]
    moving = {own.name: X >> Y for own in parts[1:]}
    scales = dict.fromkeys(moving, scale)
    asked = fo.Assembly(parts, contacts, (), moving, scales=scales, keep_out=[keep_out])
    solution = fo.solve(asked, certify=certify)
    assert solution.amount == pytest.approx(amount, rel=1e-6)
    assert solution.lower_bound == pytest.approx(amount, rel=1e-6)
    assert fo.verify(solution, proof=True).passed
    more = replace(solution, amount=1.01 * amount, lower_bound=1.01 * amount)
    assert "proof: lower bound" in [check.name for check in fo.verify(more, proof=True).failed]


def test_a_letter_says_which_way_parts_are_off() -> None:
    """First those that move, then the fixed ones."""
    for letter, signs in {"A": (1, 1), "B": (1, -1), "C": (-1, 1), "D": (-1, -1)}.items():
        asked = PLATES.changed(scales=None, requirement=letter, tolerance={"base": 0.01, "plate 2": 0.02})
        assert asked.scales == {"base": 1 + 0.01 * signs[1], "plate 1": 1.0, "plate 2": 1 + 0.02 * signs[0]}
        assert asked.changed(scales={"base": 1.1}).scales["base"] == 1.1


def test_the_worst_sizes_of_an_assembly_are_those_of_its_contacts() -> None:
    """A plate on another: the gap between is least where the lower one is thicker and the upper one goes deeper."""
    thick = fo.Size("thick", "plate 1", faces="+z", tolerance=(-0.1, 0.2))
    deep = fo.Size("deep", "plate 2", faces="-z", tolerance=(-0.3, 0.05))
    asked = stack(2, [1.0, 1.0, 1.0], sizes=[thick, deep])
    assert asked.changed(made="worst").made == pytest.approx({"thick": 0.2, "deep": 0.05})
    assert asked.changed(made="loosest").made == pytest.approx({"thick": -0.1, "deep": -0.3})
    assert fo.solve(asked.changed(made="worst")).amount == pytest.approx(0.25)


# -------------------------------------------------------------------------------------------------------------- refused


PLATES = stack(2, SCALES)


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({"parts": [PLATES.parts["base"], PLATES.parts["base"]]}, "parts"),
        ({"parts": {"base": PLATES.parts["base"]}}, "parts"),
        ({"parts": {"base": 3, "plate 1": 4}}, "parts"),
        ({"contacts": []}, "contacts"),
        ({"contacts": [("plate 1", "plate 1")]}, "contacts[1].parts"),
        ({"contacts": [("plate 1", "bass")]}, "contacts[1].parts"),
        ({"contacts": [("plate 1", "base"), ("plate 2", "plate 1"), ("base", "plate 1")]}, "contacts[3].parts"),
        ({"contacts": [("plate 1", "base")]}, "contacts"),
        ({"contacts": [("plate 1", "base"), {"parts": ("plate 2", "plate 1"), "goal": "fit"}]}, "contacts[2].goal"),
        ({"contacts": [("plate 1", "base"), ("plate 2", "base")]}, "contacts[2] 'plate 2 - base'.nominal"),
        ({"contacts": [("plate 1", "base", "plate 2")]}, "contacts[1].parts"),
        ({"motions": {"plate 2": Z}}, "contacts[1].parts"),
        ({"motions": {}}, "motions"),
        ({"motions": {"plate 1": Z, "plate 2": Z, "base": Z}}, "motions"),
        ({"motions": {"plate 1": Z, "plate 3": Z}}, "motions.plate 3"),
        ({"motions": {"plate 1": Z, "plate 2": "z"}}, "motions.plate 2"),
        ({"follows": {"plate 1": "plate 2", "plate 2": "plate 1"}}, "follows.plate 1"),
        ({"follows": {"base": "plate 2"}}, "follows.base"),
        ({"follows": {"plate 1": "plate 9"}}, "follows.plate 1"),
        ({"scales": {"plate 1": 0.0}}, "scales.plate 1"),
        ({"scales": {"plate 1": float("nan")}}, "scales.plate 1"),
        ({"weights": {"base": 1.0}}, "weights.base"),
        ({"limits": {"plate 1": {"TX": (0, 1)}}}, "limits.plate 1.TX"),
        ({"limits": {"plate 1": {"TZ": (1, 0)}}}, "limits.plate 1.TZ"),
        ({"made": "worst"}, "sizes"),
        ({"made": "best"}, "made"),
        ({"requirement": "A"}, "requirement"),
        ({"requirement": "E", "tolerance": 0.02}, "requirement"),
        ({"requirement": "A", "tolerance": 0.02, "scales": {"base": 1.1}}, "requirement"),
        ({"requirement": "A", "tolerance": 2}, "tolerance"),
        ({"requirement": "A", "tolerance": {"lid": 0.02}}, "tolerance.lid"),
        ({"amount": "displacement"}, "amount"),
        ({"amount": casadi.SX.sym("TZ") ** 2}, "amount"),
        ({"made": {"width": 0.1}}, "made.width"),
        ({"sizes": [fo.Size("width", body="movable", scale="x")]}, "size 'width'.body"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_is_refused_by_name(changed, key) -> None:
    asked = {"parts": PLATES.parts, "contacts": [pair[:2] for pair in PLATES.contacts], "motions": PLATES.motions}
    with pytest.raises(InputError) as refused:
        fo.Assembly(**{**asked, **changed})
    assert refused.value.key == key


# ---------------------------------------------------------------------------------------------------------------- judge


@pytest.mark.parametrize("assembly", [PLATES, wedges(X >> Z, X >> Z, scales=MADE)], ids=["tree", "loop"])
def test_planted_errors_are_refused(assembly) -> None:
    solution = fo.solve_assembly(assembly)
    assert fo.verify_assembly(solution).passed
    part = list(solution.parameters)[-1]
    own = dict(solution.parameters[part])
    nudged = {**own, "TZ": own["TZ"] + 1e-6}
    shifted = np.array(solution.transforms[part])
    shifted[0, 3] += 1e-6
    other = fo.solve_assembly(stack(2, [1.0] * 3))
    planted = [
        {"parameters": {**solution.parameters, part: nudged}},
        {"parameters": {name: own for name, own in solution.parameters.items() if name != part}},
        {"transforms": {**solution.transforms, part: shifted}},
        {"amount": solution.amount * (1.0 + 1e-6)},
        {"lower_bound": solution.amount * (1.0 + 1e-6)},
        {"amounts": {**solution.amounts, part: 0.0}},
        {"contacts": solution.contacts[:-1]},
        {"contacts": solution.contacts[::-1]},
        {"contacts": (*solution.contacts[:-1], other.contacts[-1])},
        {"amount": float("nan")},
    ]
    for wrong in planted:
        assert not fo.verify_assembly(replace(solution, **wrong)).passed, wrong
    nowhere = replace(solution, status=Status.NOT_FOUND)
    assert not fo.verify_assembly(nowhere).passed


def test_parts_that_overlap_elsewhere_are_refused() -> None:
    """Motions that restore both contacts, and let the two parts run into each other."""
    base = fo.Body.convex(block((-9, -4, -1), (9, 4, 0)), seed=(0, 0, -0.5), name="base")
    one = fo.Body.convex(block((-4, -1, 0), (-0.01, 1, 2)), seed=(-2, 0, 1), name="one")
    two = fo.Body.convex(block((0.01, -1, 0), (4, 1, 2)), seed=(2, 0, 1), name="two")
    pairs, motions = [("one", "base"), ("two", "base")], {"one": X >> Z, "two": X >> Z}
    asked = fo.Assembly([base, one, two], pairs, motions=motions, scales={"one": 1.02, "two": 1.02})
    near = fo.Assembly([base, one, two], pairs, motions=motions, scales={"one": 1.02, "two": 1.02, "base": 1.0})
    good = fo.solve_assembly(asked)
    alone = [fo.solve(near.problem(pair)) for pair in near.contacts]
    q = {pair.one: own.parameters for pair, own in zip(near.contacts, alone, strict=True)}
    wrong = replace(
        good, parameters=q, contacts=tuple(alone), amount=hypot(*(own.amount for own in alone)), lower_bound=0.0,
        amounts={part: own.amount for part, own in zip(q, alone, strict=True)},
        amount_low=hypot(*(own.amount_low for own in alone)), amount_high=hypot(*(own.amount_high for own in alone)),
        transforms=near.poses({part: list(own.values()) for part, own in q.items()}),
    )  # fmt: skip
    failed = fo.verify_assembly(wrong).failed
    assert [check.name for check in failed] == ["no overlap: one - two"]


def test_a_solution_is_plain_data() -> None:
    told = fo.solve_assembly(PLATES).to_dict()
    assert told["status"] == "SOLVED"
    assert told["usable"] is True
    assert told["parameters"]["plate 1"]["TZ"] == pytest.approx(lifts(2, SCALES)[0], abs=1e-12)
    assert told["contacts"][0]["parts"] == ["plate 1", "base"]
    assert set(told["gaps"]) == {"base - plate 1", "base - plate 2", "plate 1 - plate 2"}


# ---------------------------------------------------------------------------------------------------------------- files

FILE = Path(__file__).parents[2] / "problems" / "assemblies" / "loop_of_four.toml"


def run(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


def test_the_file_asks_what_python_asks() -> None:
    assembly = fo.load_assemblies(FILE)[0]
    names = {"base": "base", "left": "left wedge", "right": "right wedge", "key": "key"}
    assert assembly.scales == {names[part]: scale for part, scale in MADE.items()}
    assert assembly.unit == "mm"
    rows, gaps = levels()
    assert flat(fo.solve_assembly(assembly)) == pytest.approx(np.linalg.pinv(rows) @ gaps, abs=1e-12)


def test_the_command_line_solves_it_and_others_say_what_they_are_about(tmp_path) -> None:
    told = run("solve", FILE, "--case", "made unlike", "--json", "--out", tmp_path)
    (document,) = json.loads(told.stdout)["files"]
    rows, gaps = levels()
    assert told.exit_code == 0
    assert document["cases"][0]["amount"] == pytest.approx(np.linalg.norm(np.linalg.pinv(rows) @ gaps), rel=1e-12)
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".png", ".svg"]
    table = run("solve", FILE, "--case", "made unlike")
    for words in ("left wedge", "TX -0.0125", "0.06982", "exact", "yes"):
        assert words in table.stdout
    said = " ".join(table.stdout.split())
    verdict, amount = str(fo.solve(fo.load_assemblies(FILE)[0])).split("\n")  # of the amount nothing was printed
    assert verdict in said
    assert amount == "amount 0.06982 mm, proved at least 0.06982 mm, exact; verified"
    assert "base - scale 1.03 fixed -" in said
    for command in ("curve",):
        refused = run(command, FILE)
        assert refused.exit_code == 2
        assert "assembly" in refused.output


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("scales.keyy=1", "'made unlike'.scales.keyy: no such part, did you mean 'key'"),
        ("keep_out[1].clearance=1", "there are no keep-outs"),
        ("bodies.movable.seed=[0,0,0]", "an assembly has parts"),
        ("part.base.weight=2", "part[1].weight: a part without a motion is fixed"),
        ("part.keyy.seed=[0,0,0]", "no such part, did you mean 'key'"),
        ("contact[9].goal=at", "contact[9]: no such item; allowed: 1 to 4"),
        ("case=1", "'made unlike'.case: unknown key 'case'"),
    ],
)
def test_a_change_of_an_assembly_that_is_none_is_named(change: str, said: str) -> None:
    told = run("whatif", FILE, "--case", "made unlike", "--set", change)
    assert told.exit_code == 2
    assert said in told.output


def test_whatif_and_study_of_a_file_of_an_assembly(tmp_path) -> None:
    """The key 1 % too small alone: the amount by the pseudo-inverse of the contacts' equations."""
    rows, gaps = levels()
    least = np.linalg.norm(np.linalg.pinv(rows) @ gaps)
    told = run("whatif", FILE, "--case", "made unlike", "--set", 'scales."left wedge"=1.0', "--json")
    found = json.loads(told.stdout)["files"][0]["cases"][0]["whatif"]
    assert told.exit_code == 0
    assert found["before"]["amount"] == pytest.approx(least, rel=1e-12)
    assert found["after"]["assembly"]["case"][0]["scales"]["left wedge"] == 1.0
    study = tmp_path / "study.toml"
    lines = [f'problem = "{FILE}"', 'cases = ["made unlike"]', "[[vary]]", "key = 'scales.\"left wedge\"'"]
    study.write_text("\n".join([*lines, "values = [1.0, 1.02]"]), "utf-8")
    result = fo.run_study(study, tmp_path / "out", jobs=1)
    assert [row["amount"] for row in result.rows()] == pytest.approx([found["after"]["amount"], least], rel=1e-9)


@pytest.mark.slow
def test_the_report_says_and_draws_each_case_without_scripts(tmp_path) -> None:
    out = tmp_path / "loop.html"
    assert run("report", FILE, "--out", out).exit_code == 0
    text, script, _ = out.read_text("utf-8").partition("<script")  # scripts draw the parts in space besides
    rows, gaps = levels()
    amount = np.linalg.norm(np.linalg.pinv(rows) @ gaps)
    assert script
    assert text.count("<svg") == 2  # a picture of each case
    assert f"<dd>{amount:.4g} mm</dd>" in text
    assert "Move left wedge 0.0125 mm along +x and 0.055 mm along +z" in text
    assert "then every contact is closed; smallest possible together (proved)" in text
    assert '<th scope="row">base</th><td>-</td><td>scale 1.03</td><td>fixed</td>' in text
    face = '<span class="whole">-z</span>'  # in one line
    assert text.count(f"<td>bottom face (facing {face}) at top face (facing +z)</td><td>touching</td>") == 4
    for parts in ("key - left wedge", "key - right wedge"):
        assert f'<th scope="row">{parts}</th>' in text
    two = run("report", FILE, FILE.parent.parent / "nut.toml", "--case", "shifted against a flat", "--out", out)
    assert "where all files are of them" in two.output


def test_the_file_in_the_documentation_is_whole(tmp_path) -> None:
    """The plate's top, half a length above its seed, comes down by 2 % of that; the lid is taken along."""
    page = (FILE.parents[2] / "docs" / "assemblies.md").read_text("utf-8")
    path = tmp_path / "stack.toml"
    path.write_text(page.rpartition("```toml\n")[2].partition("```")[0], "utf-8")
    smaller, thick = fo.load_assemblies(path)
    assert flat(fo.solve(smaller)) == pytest.approx([-0.01, 0.0], abs=1e-12)
    assert flat(fo.solve(thick)) == pytest.approx([0.05, -0.02], abs=1e-12)
    assert fo.stack_up(thick, of=("lid", "pad")).contributions[0].size == "pad height"


def test_the_open_gap_in_the_documentation_is_what_both_commands_print(tmp_path) -> None:
    """The gap is .2 + jaw - hub length - shim thickness; measured, the hub is .1 short and the shim goes along."""
    page, path = (FILE.parents[2] / "docs" / "assemblies.md").read_text("utf-8"), tmp_path / "fork.toml"
    path.write_text(page.partition("```toml\n")[2].partition("```")[0], "utf-8")
    stack = fo.stack_up(fo.load_assemblies(path)[0])
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.2 - 0.05 - 0.03, 0.2 + 0.05 + 0.1 + 0.03))
    for command in ("stack", "solve"):
        line = next(own for own in page.splitlines() if own.startswith(f"fcdm-opt {command} fork.toml "))
        words = [str(path) if word == "fork.toml" else word for word in shlex.split(line)[1:]]
        printed = "\n".join(own.rstrip() for own in run(*words).output.splitlines())
        table, verdict = page.partition("  gap  at\n")[2].partition("```")[0], "then every contact is met as asked"
        assert {"stack": table, "solve": verdict}[command] in printed


@pytest.mark.parametrize(
    ("right", "wrong", "hint"),
    [
        ('body = "plate"', 'part = "plate"', "size[1].part: unknown key 'part', did you mean 'body'?"),
        ('parts = ["pad", "plate"]', 'bodies = ["pad", "plate"]', "'bodies', did you mean 'parts'?"),
        ("made = {", "sizes = {", "'sizes', did you mean 'made'?"),
        ("tolerance = 0.03", "tol = 0.03", "'tol', did you mean 'tolerance'?"),
        ("made = {", 'goal = "clear"\nmade = {', "unknown key 'goal': a key of [[contact]]; found 'clear'"),
        (
            "made = {",
            "clearance = 0.1\nmade = {",
            "unknown key 'clearance': a key of [[contact]] and [[keep_out]]; found 0.1",
        ),
        ("made = {", 'motion = [{ translation = "z" }]\nmade = {', "unknown key 'motion': a key of [[part]]"),
        ("tolerance = 0.03", "tolerance = 0.03\nmade = 1", "unknown key 'made': a key of [[case]]"),
    ],
)
def test_a_key_of_another_table_names_the_right_one(tmp_path, right: str, wrong: str, hint: str) -> None:
    page = (FILE.parents[2] / "docs" / "assemblies.md").read_text("utf-8")
    text = page.rpartition("```toml\n")[2].partition("```")[0]
    assert right in text
    (tmp_path / "a.toml").write_text(text.replace(right, wrong), "utf-8")
    with pytest.raises(fo.InputError, match=re.escape(hint)):
        fo.load_assemblies(tmp_path / "a.toml")


def test_an_open_gap_is_said_to_be_one(tmp_path) -> None:
    """A lid drawn .25 above its pad has no contact to restore: it is to be kept clear, and the gap is the answer."""
    plate, pin = fo.Box((4, 4, 1), centre=(0, 0, 0.5), name="plate"), fo.Box((1, 1, 1), centre=(0, 0, 1.5), name="pin")
    lid = fo.Box((2, 2, 1), centre=(0, 0, 2.75), name="lid")
    asked = {"parts": [plate, pin, lid], "motions": {"pin": fo.Translation("z"), "lid": fo.Translation("z")}}
    asked |= {"follows": {"lid": "plate"}, "unit": "mm"}
    with pytest.raises(fo.InputError) as caught:
        fo.Assembly(**asked, contacts=[("pin", "plate"), ("lid", "pin")])
    said = str(caught.value)
    assert caught.value.key == "contacts[2] 'lid - pin'.nominal"
    assert 'lid and pin are 0.25 mm apart as drawn: write goal = "clear", in a file of an assembly under this' in said
    assert not re.search(r"\d\.\d{10}", said)
    clear, high = {"parts": ("lid", "pin"), "goal": "clear"}, fo.Size("high", "pin", faces="+z", tolerance=0.1)
    made = fo.Assembly(**asked, contacts=[("pin", "plate"), clear], sizes=[high])
    assert fo.stack_up(made).gap({"high": 0.1}) == pytest.approx(0.15)


def test_the_report_lists_the_checksums_of_the_meshes_too(tmp_path) -> None:
    path, mesh = tmp_path / "stack.toml", FILE.parent.parent / "meshes" / "square_plate.stl"
    (tmp_path / "plate.stl").write_bytes(mesh.read_bytes())
    path.write_text('[[part]]\nname = "plate"\nfile = "plate.stl"\n[[part]]\nname = "pin"\nvertices = []\n', "utf-8")
    told = head(SimpleNamespace(path=path, title="", note="", error="not read"))
    digest = hashlib.sha256(mesh.read_bytes()).hexdigest()
    assert told["meshes"] == [{"file": "plate.stl", "sha256": digest}]
    text = assembly_page([{**told, "cases": []}], [])
    assert f"<td>mesh of stack.toml</td><td><code>{digest}</code></td>" in text


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('parts = ["key", "left wedge"]', 'parts = ["kex", "left wedge"]', "contact[3].parts"),
        ('name = "key"', 'name = "base"', "part[4] 'base'.name"),
        ('name = "made unlike"', 'name = "made unlike"\nmade = { width = 0.1 }', "case[1] 'made unlike'.made.width"),
        ('scales = { key = 1.02 }', 'scales = { kex = 1.02 }', "case[2] 'key 2 % too large'.scales.kex"),
        ('scales = { key = 1.02 }', 'scales = { key = "2 %" }', "case[2] 'key 2 % too large'.scales.key"),
        ('motion = [{ translation = "x" }', 'motion = [{ translation = "w" }', "part[2].motion[1].translation"),
        ('name = "right wedge"', 'name = "right wedge"\nlimits = { RX_deg = [0, 1] }', "part[3].limits.RX_deg"),
        ('name = "right wedge"', 'name = "right wedge"\nfollows = "kez"', "part 'right wedge'.follows"),
        ('name = "right wedge"\nunit = "mm"', 'name = "right wedge"\nunit = "cm"', "part[3].unit"),
        ('body = "key"', 'body = "movable"', "size 'key width'.body"),
        ("[[case]]", "[[cases]]", "cases"),
    ],
)  # fmt: skip
def test_what_a_file_cannot_ask_is_refused_with_its_place(tmp_path, old, new, key) -> None:
    path, text = tmp_path / "loop.toml", FILE.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new), "utf-8")
    with pytest.raises(InputError) as refused:
        fo.load_assemblies(path)
    assert refused.value.key == key
    assert refused.value.file == path
    assert run("solve", path).exit_code == 2


@pytest.mark.slow
def test_slsqp_from_many_starts_finds_nothing_smaller(capsys) -> None:
    """The quick form of the comparison, whose full form is benchmarks/compare_assemblies.py."""
    rival = loaded(Path(__file__).parents[2] / "benchmarks" / "compare_assemblies.py")
    assert rival.main(["1", "--quick"]) == 0
    summary = capsys.readouterr().out.splitlines()[-1]
    assert "beaten 0, missed 0; equal to 1e-6 in 4" in summary
    case = rival.scene(1, 4)
    real = rival.Rival(case)
    ours = fo.solve_assembly(case.assembly)
    q = np.array([x for own in ours.parameters.values() for x in own.values()])
    assert real.feasible(q)  # by formulas of its own
    assert not real.feasible(q + 1e-4)


@pytest.mark.slow
def test_a_part_that_must_go_round_another_keeps_on_its_face_by_more_than_a_border() -> None:
    """It was not found: the least motion leaves a foot and its beam no more than an edge, which is no face on face."""
    boxes = {
        "tray": ((-8, -4, -1), (8, 4, 0)), "left": ((-4, -1, 0), (-2, 1, 1.25)),
        "right": ((2, -1, 0), (4, 1, 1.25)), "beam": ((-5, -1, 1.25), (5, 1, 2.25)),
    }  # fmt: skip
    parts = {name: fo.Body.convex(block(low, high), seed="box", name=name) for name, (low, high) in boxes.items()}
    asked = [
        {"parts": ["left", "tray"], "goal": "touch"}, {"parts": ["beam", "left"], "goal": "at"},
        {"parts": ["right", "beam"], "goal": "at"}, {"parts": ["right", "tray"], "goal": "clear", "clearance": 0.05},
    ]  # fmt: skip
    motions = {"left": X >> Z, "right": X >> Y >> Z, "beam": X >> Z}
    assembly = fo.Assembly(
        parts, asked, motions=motions, follows={"beam": "left"}, scales={"tray": 1.01, "right": 1.0168}
    )
    solution = fo.solve_assembly(assembly)
    assert solution.usable
    # the right foot, too high to be above the tray, goes beyond its end; the beam follows, half of it on the left foot
    beyond = 8.08 + 0.05 - (3.0 - 1.0168)
    along = (8.08 + 0.05 - 5.0) / 2.0
    least = sqrt(beyond**2 + 2.0 * along**2 + 0.005**2 + 0.0055**2)
    assert solution.amount == pytest.approx(least, rel=1e-6)
    assert least <= solution.amount
    assert solution.lower_bound <= least
    lap = 5.0 + solution.parameters["left"]["TX"] + solution.parameters["beam"]["TX"] - 8.13
    assert lap > 1e-6


# ------------------------------------------------------------------------------------------------------------ one entry


@pytest.mark.parametrize(
    ("how", "key"),
    [
        ({"effort": "fast"}, "effort"),
        ({"certify": 1}, "certify"),
        ({"certify": True, "effort": "quick"}, "effort"),
        ({"seconds": -1.0}, "seconds"),
        ({"time": 0.0}, "time"),
        ({"model": "best"}, "model"),
    ],
)
def test_assemblies_took_arguments_of_their_own(how, key) -> None:
    """Seconds below 0 were taken, and there was no time and no model."""
    with pytest.raises(InputError) as refused:
        fo.solve(PLATES, **how)
    assert refused.value.key == key
    assert fo.solve_assembly is fo.solve
    assert fo.verify_assembly is fo.verify


def test_a_forced_model_answers_a_chain_and_is_refused_of_a_loop() -> None:
    assert fo.solve(PLATES, model="together").amount == pytest.approx(hypot(*lifts(2, SCALES)), rel=1e-12)
    with pytest.raises(InputError, match="one program"):
        fo.solve(wedges(Z, X >> Z, scales=MADE), model="together")


def test_an_assembly_is_answered_in_the_time_given() -> None:
    turning = wedges(X >> Z >> fo.Rotation("y"), X >> Z >> fo.Rotation("y"), scales=MADE)
    late = fo.solve(turning, time=1e-9)
    assert late.stopped.startswith("the time limit of 1e-09 s was met")
    assert not late.usable
    assert "allow more time" in late.advice
    with pytest.raises(fo.FcdmError, match="time limit"), pacing.within(1e-9):
        fo.solve(turning)


ASKED = {
    "tree": PLATES,
    "loop": wedges(X >> Z, X >> Z, scales=MADE, weights={"left": 4.0}),
    "turning loop": wedges(X >> Z >> fo.Rotation("y"), X >> Z >> fo.Rotation("y"), scales=MADE),
    "only motion": bridge({"left": 1.02, "right": 0.98}, Z >> fo.Rotation("y"), unit="mm"),
}


@pytest.fixture(scope="module", params=ASKED)
def certified(request) -> fo.AssemblySolution:
    return fo.solve(ASKED[request.param], certify=True)


@pytest.mark.slow
def test_the_bound_of_an_assembly_is_proved_anew(certified) -> None:
    assert certified.lower_bound == pytest.approx(certified.amount, rel=1e-4)
    assert fo.verify(certified, proof=True).passed
    more = replace(certified, amount=1.01 * certified.amount, lower_bound=1.01 * certified.lower_bound)
    assert "proof: lower bound" in [check.name for check in fo.verify(more, proof=True).failed]
    if certified.evidence:
        (claim,) = certified.evidence
        for wrong in ((), (claim, claim), (replace(claim, bound=1.001 * claim.bound),), (replace(claim, contacts=()),)):
            claimed = replace(certified, evidence=wrong)
            assert not fo.verify(claimed, proof=True).passed, wrong
            assert fo.verify(claimed).passed


def test_an_assembly_had_no_quaternions() -> None:
    """An arm that turns by a about z has (0, 0, sin a/2, cos a/2): cos, as its sign is that of w >= 0."""
    arm, wall = fo.Box((4, 4, 10), name="arm"), fo.Box((2, 20, 20), centre=(3.5, 0, 0), name="wall")
    contacts = [{"parts": ("arm", "wall"), "goal": "touch"}]
    solution = fo.solve(fo.Assembly([arm, wall], contacts, motions={"arm": fo.Rotation("z")}))
    half = solution.parameters["arm"]["RZ"] / 2.0
    assert half
    assert solution.quaternions["arm"] == pytest.approx((0.0, 0.0, np.sin(half), np.cos(half)), abs=1e-12)
    assert solution.quaternions["wall"] == (0.0, 0.0, 0.0, 1.0)


@pytest.mark.slow
def test_a_solution_of_an_assembly_is_read_again_as_it_was_told(certified) -> None:
    told = json.loads(json.dumps(certified.to_dict()))
    read = fo.AssemblySolution.from_dict(told)
    assert json.loads(json.dumps(read.to_dict())) == told
    assert fo.verify(read, proof=True).passed
    assert flat(fo.solve(read.assembly)) == pytest.approx(flat(certified), abs=1e-12)
    part = next(iter(told["transforms"]))
    for key, wrong in (
        ("gap", 0.5), ("transforms", {part: [[1.0]]}), ("parameters", {"lid": {"TZ": 1.0}}), ("status", "FOUND"),
        ("contacts", told["contacts"][1:]), ("assembly", {}),
    ):  # fmt: skip
        with pytest.raises(InputError):
            fo.AssemblySolution.from_dict({**told, key: wrong})
    nudged = {**told, "amount": 1.1 * told["amount"], "gap": None}
    del nudged["gap"]
    assert not fo.verify(fo.AssemblySolution.from_dict(nudged)).passed


@pytest.mark.slow
def test_notebooks_show_an_assembly(certified) -> None:
    shown = certified._repr_html_()
    assert f"{certified.amount:.4f}"[:-1] in shown
    assert all(part in shown for part in certified.parameters)
    assert "<img" in shown


def test_several_answers_may_be_of_assemblies() -> None:
    found = fo.solve_all([PLATES, stack(1, [1.0] * 2)])
    assert [row["usable"] for row in found.rows()] == [True, True]
    assert "plate 1.TZ" in found.rows()[0]


def test_parts_that_see_each_other_move_are_seen_from_elsewhere_alike() -> None:
    """Only the first part's step knew of another origin: seen from there it was another motion."""
    assembly, origin = ASKED["turning loop"], np.array([3.0, -2.0, 5.0])
    pair = assembly.contacts[3]
    problem = assembly.problem(pair, [*assembly.motions])
    q = np.linspace(-0.3, 0.4, len(problem.motion.names))
    seeds = problem.movable.seed, problem.static.seed
    here = problem.motion.transform(q, *seeds)
    there = problem.motion.seen_from(origin).transform(q, *(seed - origin for seed in seeds))
    moved = here.copy()
    moved[:3, 3] += here[:3, :3] @ origin - origin
    assert there == pytest.approx(moved, abs=1e-12)


# ------------------------------------------------------------------------------------------------- keep-outs, and steps


def posts(**more) -> fo.Assembly:
    """Plates of half widths 4 and 3.9 on one another, each on its shift along x and z, and posts beside them."""
    motions = {"plate 1": X >> Z, "plate 2": X >> Z}
    return stack(2, [1.0, 1.01, 1.01], motions=motions, **more)


LOW = fo.KeepOut(fo.Body.convex(block((4.01, -4, 0.1), (6, 4, 0.9)), name="low"), clearance=0.02)
HIGH = fo.KeepOut(fo.Body.convex(block((3.839, -4, 1.1), (6, 4, 1.9)), seed=(6, 0, 1.5), name="high"))


@pytest.mark.parametrize(
    ("keep_out", "beside", "questions"),
    [
        ((LOW,), {"plate 1": -0.05, "plate 2": 0.0}, 2),
        ((HIGH,), {"plate 1": -0.05, "plate 2": -0.05}, 1),  # what carries it may go, too
        ((fo.KeepOut(HIGH.body, (0.9, 1.0)),), {"plate 1": -0.05, "plate 2": -0.05}, 1),
        ((fo.KeepOut(HIGH.body, 1.0, clearance=0.04), LOW), {"plate 1": -0.07, "plate 2": -0.07}, 1),
    ],
    ids=["the first", "the second", "a range", "clearance"],
)
def test_an_assembly_took_no_keep_outs(keep_out, beside, questions) -> None:
    assembly = posts(keep_out=keep_out)
    solution = fo.solve(assembly)
    rises = dict(zip(beside, lifts(2, [1.0, 1.01, 1.01]), strict=True))
    assert solution.usable
    assert len(solution.stages) == questions
    for part, own in solution.parameters.items():
        assert [*own.values()] == pytest.approx([beside[part], rises[part]], abs=1e-9)
    assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-9)
    assert solution.keep_out_gaps["plate 1", keep_out[0].name] >= keep_out[0].clearance - 1e-9
    read = fo.AssemblySolution.from_dict(json.loads(json.dumps(solution.to_dict())))
    assert fo.verify(read).passed
    unasked = fo.solve(posts())
    forged = fo.verify(replace(unasked, assembly=assembly)).failed
    assert any(check.name.endswith(f"keep-out '{keep_out[0].name}': clearance") for check in forged)


def test_keep_outs_of_a_part_that_labels_name_second_were_in_no_question() -> None:
    """Labels say that the fixed part is body 1: what moves is asked about keep-outs the other way round."""
    asked = stack(1, [1.02, 1.0], keep_out=[HIGH])
    turned = fo.Problem(asked.parts["base"], asked.parts["plate 1"], goal="at", contacts="all", target=(1, 1), motion=Z)
    labels = [contact.label for contact in turned.contacts]
    other = asked.changed(contacts=[{"parts": ("base", "plate 1"), "contacts": labels}])
    assert {pair: len(own.keep_out) for pair, own in other.questions.items()} == {
        ("base", "plate 1"): 0, ("plate 1", "base"): 1,
    }  # fmt: skip
    assert fo.solve(other).amount == pytest.approx(fo.solve(asked).amount)
    gaps = [fo.best_pose(own, box=(0.98, 1.02), effort=100).worst_gap for own in (asked, other)]
    assert gaps[0] == pytest.approx(gaps[1])


@pytest.mark.sampled(1)
@pytest.mark.parametrize("kept", ["exact", "surface"])
def test_a_part_went_through_a_third_one_without_a_word(kept: str) -> None:
    """A slider is to reach a stop 4.5 away, through a bar: that is said. Through a ring about it, it leaves the fit."""
    ends = (("it", 0.0), ("stop", 6.5))
    slider, stop = (fo.Body.convex(block((x - 1, -1, -1), (x + 1, 1, 1)), name=name) for name, x in ends)
    asked = {"contacts": [{"parts": ("it", "stop"), "goal": "touch"}], "motions": {"it": X}}
    plate, bore, bar = (
        trimesh.creation.box(bounds=ends)
        for ends in (((-3, -3, -1), (3, 3, 1)), ((-1.2, -1.2, -2), (1.2, 1.2, 2)), ((2.5, -3, -3), (3, 3, 3)))
    )
    third = fo.Body.from_mesh(bar, decomposition=kept, name="bar")
    for more in ({"parts": [slider, stop, third]}, {"parts": [slider, stop], "keep_out": [third]}):
        solution = fo.solve(fo.Assembly(**asked, **more))
        assert solution.parameters == {"it": {"TX": pytest.approx(4.5)}}
        assert "straight there it goes through bar, and no other way is looked for" in assembly_verdict(solution)
    ring = fo.Body.from_mesh(trimesh.boolean.difference([plate, bore]), decomposition=kept, name="ring")
    assert fo.solve(fo.Assembly([slider, stop, ring], **asked)).status is Status.OUTSIDE_FIT


def test_a_part_goes_in_steps_of_the_machine_and_one_in_a_loop_is_refused() -> None:
    apart = {"parts": ("plate 1", "base"), "goal": "clear", "clearance": 0.05}
    both = [{**apart, "goal": "touch", "clearance": 0.0}, {"parts": ("plate 2", "plate 1"), "goal": "touch"}]
    asked = stack(1, [1.0, 1.0], contacts=[apart], resolution={"plate 1": 0.02})
    solution = fo.solve(fo.Assembly.from_dict(json.loads(json.dumps(asked.to_dict()))))
    assert solution.usable
    assert found(solution)["plate 1"] == pytest.approx([0.06], abs=1e-12)
    sharing = [*both, {**apart, "parts": ("plate 2", "base")}]
    with pytest.raises(InputError) as refused:
        fo.solve(stack(2, SCALES, contacts=sharing, resolution={"plate 2": 0.02}))
    assert refused.value.key == "resolution.plate 2"
    rounded = fo.solve(stack(1, [1.0, 1.01], resolution={"plate 1": 0.01}))  # .003 up: a step, as it would overlap
    assert rounded.usable
    assert found(rounded)["plate 1"] == pytest.approx([0.01], abs=1e-12)


def test_a_file_names_keep_outs_and_steps(tmp_path) -> None:
    wall = "[[keep_out]]\nname = 'wall'\nclearance = 0.5\nscale = [0.9, 1.1]\n" + (
        "vertices = [[20, 0, 0], [21, 0, 0], [20, 1, 0], [20, 0, 1]]\n"
    )
    path, text = tmp_path / "loop.toml", FILE.read_text("utf-8")
    path.write_text(f"{text}\n{wall}", "utf-8")
    (keep_out,) = fo.load_assemblies(path)[0].keep_out
    assert (keep_out.name, keep_out.clearance, keep_out.scale) == ("wall", 0.5, (0.9, 1.1))
    path.write_text(f"{text}\n{wall.replace('wall', 'key')}", "utf-8")
    with pytest.raises(InputError) as refused:
        fo.load_assemblies(path)
    assert refused.value.key == "keep_out[1]"


def test_a_motion_that_two_proofs_are_about_counts_once() -> None:
    """The wedges rise on the base in what is proved of the loop: what is proved of each alone adds nothing."""
    loop = fo.solve(ASKED["loop"], certify=True)
    alone = {pair.one: fo.solve(loop.assembly.problem(pair), certify=True) for pair in loop.assembly.contacts[:2]}
    (claim,) = loop.evidence
    fewer = replace(claim, contacts=(("key", "right"),), bound=0.01)
    contacts = tuple(alone.get(pair.one, own) for pair, own in zip(loop.assembly.contacts, loop.contacts, strict=True))
    most = hypot(0.01, *(own.amount for own in alone.values()))
    forged = replace(loop, contacts=contacts, evidence=(fewer,), lower_bound=most)
    checks = {check.name: check for check in fo.verify(forged, proof=True).checks}
    assert checks["proof: lower bound"].value <= 0.01


@pytest.mark.slow
def test_why_no_motions_meet_an_assembly_was_not_said_which_it_is() -> None:
    """A block .05 larger goes .1 from the wall on its other side: past a limit, or into a block that is .05 off.

    Two others are to be .8 apart, which are .5 so, and may go .1 each; one between two posts is .05 larger to each.
    """
    parts = {
        "floor": fo.Body.convex(block((-5, -5, -1), (5, 5, 0))),
        "wall": fo.Body.convex(block((3, -5, 0), (5, 5, 3)), seed=(4, 0, 1)),
        "one": fo.Body.convex(block((-1, -1, 0), (1, 1, 2)), seed=(0, 0, 1)),
        "two": fo.Body.convex(block((1, -1, 0), (3, 1, 2)), seed=(2, 0, 1)),
    }
    contacts = [("one", "floor"), ("two", "floor"), ("two", "one"), ("two", "wall")]
    asked = {"motions": {"one": X >> Z, "two": X >> Z}, "scales": {"two": 1.05}, "unit": "mm"}
    closed = "with all contacts closed (one.TX -0.1 mm, two.TX -0.05 mm, two.TZ 0.05 mm) "
    limited = fo.solve(fo.Assembly(parts, contacts, **asked, limits={"one": {"TX": (-0.01, 0.01)}}))
    assert limited.reason == closed + "one.TX passes its limit -0.01 mm by 0.09 mm"
    post = {"post": fo.Body.convex(block((-3, -1, 0.5), (-1.05, 1, 1.5)), seed=(-2, 0, 1))}
    blocked = fo.solve(fo.Assembly(parts | post, contacts, **asked))
    assert blocked.reason == closed + "left face of one, right face of post overlap by 0.05 mm"
    rest = {"motions": {"one": X, "two": X}, "follows": {"one": "floor", "two": "floor"}, "unit": "mm"}
    parts |= {"two": fo.Body.convex(block((1.5, -1, 0), (3, 1, 2)), seed=(2, 0, 1))}
    apart = [{"parts": ("one", "two"), "goal": "clear", "clearance": 0.8}]
    del parts["wall"]
    kept = fo.solve(fo.Assembly(parts, apart, **rest, limits={part: {"TX": (-0.1, 0.1)} for part in rest["motions"]}))
    assert kept.reason == (
        "right face of one, left face of two are 0.7 mm apart, a clearance of 0.8 mm is required; with limits set "
        "aside (one.TX -0.15 mm, two.TX 0.15 mm) one.TX passes its limit -0.1 mm by 0.05 mm; two.TX passes its limit "
        "0.1 mm by 0.05 mm"
    )
    posts = {"left": block((-3, -1, 0), (-1, 1, 2)), "right": block((1, -1, 0), (3, 1, 2))}
    parts = {**{name: fo.Body.convex(own) for name, own in posts.items()}, "one": parts["one"], "floor": parts["floor"]}
    between = [{"parts": ("one", post), "goal": "clear"} for post in posts]
    rest = {"motions": {"one": X >> fo.Rotation("z")}, "follows": {"one": "floor"}, "unit": "mm"}
    tight = fo.solve(fo.Assembly(parts, between, **rest, scales={"one": 1.05}))
    assert tight.reason == (
        "left face of one, right face of left overlap by 0.05 mm; "
        "right face of one, left face of right overlap by 0.05 mm"
    )
    for solution in (limited, blocked, kept, tight):
        assert not solution.status.found
        assert solution.reason[1:] in str(solution)
        assert solution.to_dict()["reason"] == solution.reason
        with pytest.raises(fo.errors.UnsolvedError, match=re.escape(solution.reason[1:])):
            fo.solve(solution.assembly, throw=True)
        page = assembly_page(
            [{"file": "a.toml", "title": "a", "note": "", "sha256": "", "cases": [0]}], [assembly_report(solution)]
        )
        answer = re.sub(r"<[^>]*>", "", page.partition('aria-label="Case')[2].partition("Asked:")[0])
        assert f"{solution.status.words.capitalize()}:" in answer
        assert solution.reason.replace("; ", ";\n") in answer  # a line each
        assert "widen the limits" not in answer


def test_the_report_of_an_assembly_tells_what_each_contact_is_asked_to_be() -> None:
    """A cube on a floor before a wall, 0.3 from it: kept 0.5 clear it goes back by 0.2."""
    parts = {"cube": fo.Box((2, 2, 2), centre=(0, 0, 1)), "floor": fo.Box((20, 20, 2), centre=(0, 0, -1))}
    parts["wall"] = fo.Box((2, 20, 4), centre=(2.3, 0, 2))
    between = [("cube", "floor"), {"parts": ("cube", "wall"), "goal": "clear", "clearance": 0.5}]
    solution = fo.solve(fo.Assembly(parts, between, motions={"cube": X >> Z}, unit="mm"))
    assert solution.amount == pytest.approx(0.2)
    page = assembly_page(
        [{"file": "a.toml", "title": "a", "note": "", "sha256": "", "cases": [0]}], [assembly_report(solution)]
    )
    assert "<td>clear by 0.5 mm</td>" in page


def test_how_far_true_faces_are_from_touching_again_was_not_told() -> None:
    """A ball 1 % larger than the room between two walls overlaps each by half of what its diameter has grown."""
    walls = {name: fo.Box((4, 40, 20), centre=(x, 0, 10)) for name, x in (("left", -7), ("right", 7))}
    parts = {"ball": fo.Sphere(5, centre=(0, 0, 5)), **walls}
    asked = {"motions": {"ball": X >> Z}, "scales": {"ball": 1.01}, "unit": "mm"}
    solution = fo.solve(fo.Assembly(parts, [("ball", name) for name in walls], **asked))
    assert solution.status is Status.INFEASIBLE
    assert "nearest to that ball - left overlap by 0.05 mm; ball - right overlap by 0.05 mm" in solution.reason


def test_a_face_in_single_precision_was_told_as_an_edge_in_the_table_of_contacts(tmp_path: Path) -> None:
    """A hexagonal peg pushed against the wall of its hole, parallel but for the digits of the file."""
    plate = Manifold.cube([60, 60, 20], True) - Manifold.cylinder(40, 10, 10, 6).translate([0, 0, -20])
    parts = {}
    for name, solid in (("peg", Manifold.cylinder(30, 9.8, 9.8, 6)), ("plate", plate)):
        mesh = solid.to_mesh()
        points, rows = np.asarray(mesh.vert_properties, np.float32)[:, :3], np.asarray(mesh.tri_verts)
        trimesh.Trimesh(points, rows, process=False).export(tmp_path / f"{name}.stl")
        parts[name] = fo.Body.from_file(tmp_path / f"{name}.stl", unit="mm")
    along = fo.Translation((-np.cos(np.pi / 6), -0.5, 0.0))
    between = [{"parts": ("peg", "plate"), "goal": "touch"}]
    ((_, _, told, state),) = assembly_report(fo.solve(fo.Assembly(parts, between, motions={"peg": along})))["contacts"]
    assert state == "touching"
    sides = re.fullmatch(r"face \d+ \(facing ([+-])x and \1y\) at face \d+ \(facing ([+-])x and \2y\)", told)
    assert sides is not None
    assert {*sides.groups()} == {"+", "-"}


def test_a_contact_that_cannot_be_met_was_not_named_nor_parts_where_a_name_is_none(monkeypatch) -> None:
    """The tip is 0.3 above the arm, and may go 0.1; the arm meets the base."""
    ends = {"base": ((-5, -5, -1), (5, 5, 0)), "arm": ((-1, -1, 0.2), (1, 1, 1)), "tip": ((-0.5, -0.5, 1.3), (1, 1, 2))}
    parts = [fo.Body.convex(block(*own), name=name) for name, own in ends.items()]
    asked = {"motions": {"arm": fo.Translation("z"), "tip": fo.Translation("z") >> fo.Translation("x")}}
    contacts = [{"parts": pair, "goal": "touch"} for pair in (("arm", "base"), ("tip", "arm"))]
    assembly = fo.Assembly(parts, contacts, **asked, limits={"tip": {"TZ": (-0.1, 0.1)}})
    solution = fo.solve(assembly)
    assert solution.status is Status.INFEASIBLE
    assert str(solution).startswith("Contact tip - arm cannot be met: at the nearest pose found (TZ -0.1 + TX 0, TZ at")
    assert "bottom face of tip, top face of arm are 0.2 apart. Proved impossible" in str(solution)
    assert solution.active == ("contact tip - arm cannot be met",)
    with pytest.raises(KeyError, match="'arm'; no motion was found: impossible"):
        solution.transforms["arm"]
    found = fo.solve(assembly.with_limits("tip.TZ", (-1.0, 1.0)))
    with pytest.raises(KeyError, match="'hand'; there are base, arm, tip"):
        found.transforms["hand"]
    monkeypatch.setattr("fcdm_opt.design.whatif.compare.families", lambda: {"translation z": fo.Translation("z")})
    monkeypatch.setattr("fcdm_opt.design.whatif.compare.contained", dict)
    rows = {row.name: row for row in fo.compare(found.assembly).table}
    assert rows["as given"].amount == pytest.approx(found.amount)
    assert rows["as given"].to_dict()["motion"] == "; ".join(f"{part} {told}" for part, told in found.motions.items())


def test_assemblies_that_ask_the_same_are_equal() -> None:
    for asked in fo.load_assemblies(FILE):
        again = fo.Assembly.from_dict(asked.to_dict())
        assert again == asked
        assert hash(again) == hash(asked)
        assert asked != asked.changed(name="another")


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('parts = ["left wedge", "base"]', 'parts = ["base"]', "contact[1].parts: too few items; found ['base']"),
        ("[[contact]]", "[contact]", "[contact] is given twice; found '[[contact]]'; allowed: [[contact]], in"),
        ('name = "base"', 'name = "base"\nfollows = "key"', "part 'base'.follows: a fixed part follows none; found"),
        ('name = "key"', 'name = "key"\nfollows = "kay"', "part 'key'.follows: no such part, did you mean 'key'?"),
        ('name = "key"', 'name = "key"\nfollows = "key"', "part 'key'.follows: parts follow each other in a circle"),
        ("scales = { key", "tolerance = 0.01 #", "requirement: not what parts are off by; found 'tolerance'"),
    ],
)  # fmt: skip
def test_slips_in_a_file_of_an_assembly_were_told_without_a_line_or_as_none(
    tmp_path: Path, old: str, new: str, told: str
) -> None:
    text = FILE.read_text(encoding="utf-8")
    (path := tmp_path / "own.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(fo.InputError) as caught:
        fo.load_assemblies(path)
    assert re.match(rf"{path}:\d+: ", str(caught.value))
    assert told in str(caught.value)
