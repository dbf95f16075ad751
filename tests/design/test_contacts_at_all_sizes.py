"""One pose for all sizes and stack-ups by contacts as drawn: of assemblies, several contacts, surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import CUBE, FLOOR, LOWER, OFF, PROBE, SCENES, TABLE, UPPER, X, Y, Z, box, hollow

import fcdm_opt as fo
from fcdm_opt.errors import InputError
from fcdm_opt.show.report.cases import stack_report

NEAR = {"rel": 1e-7, "abs": 1e-7}
THICK = fo.Size("thick", "lower", faces="+z", tolerance=(0.0, 0.1))
DEEP = fo.Size("deep", "upper", faces="-z", tolerance=(-0.05, 0.02))


def tower(sizes=(THICK, DEEP), contacts=(("lower", "floor"), ("upper", "lower")), motion=X >> Z, **more) -> fo.Assembly:
    """Two blocks on a floor: the gap between them is TZ - thick - deep, from TZ - .12 to TZ + .05."""
    parts = {body.name: body for body in (FLOOR, LOWER, UPPER)}
    return fo.Assembly(parts, contacts, sizes, {"lower": motion, "upper": motion}, **more)


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("asked", "window", "status", "value", "lift"),
    [
        (tower(), None, "least worst gap", 0.085, 0.035),
        (tower(), (0.0, 1.0), "inside the window", 0.12, 0.12),
        (tower(), (0.0, 0.1), "no pose", 0.035, 0.085),
        (tower(limits={"upper": {"TZ": (-0.01, 0.01)}}), None, "least worst gap", 0.11, 0.01),
        (tower(resolution={"upper": 0.02}), None, "least worst gap", 0.09, 0.04),  # .02 and .04 are as near
        (tower(contacts=[("lower", "floor"), {"parts": ("upper", "lower"), "goal": "touch"}]), None,
         "least worst gap", 0.085, 0.035),
        (tower(contacts=[("lower", "floor"), {"parts": ("upper", "lower"), "goal": "clear", "clearance": 0.1}]), None,
         "least worst gap", 0.0, 0.22),
        (tower(motion=Z >> fo.Rotation("x")), None, "least worst gap", 0.085, 0.035),
    ],
)  # fmt: skip
def test_one_pose_of_each_part_for_all_sizes_of_all(asked, window, status, value, lift) -> None:
    found = fo.best_pose(asked, clearance=window)
    assert (found.status, found.passed) == (status, True)
    assert found.value == pytest.approx(value, **NEAR)
    assert found.parameters["upper.TZ"] == pytest.approx(lift, **NEAR)
    assert found.certified == (asked.shifts and not asked.resolution)
    assert found.lower_bound <= found.value + 1e-12
    forged = replace(found, parameters={**found.parameters, "upper.TZ": lift + 0.01})
    forged = replace(forged, transforms=asked.poses({"lower": np.zeros(2), "upper": np.array([0.0, lift + 0.01])}))
    assert not fo.verify(forged).passed


def test_a_carried_part_keeps_clear_of_what_is_beside_it() -> None:
    """At 1.01 of its size the upper block is .005 in the post: both blocks go half of that."""
    post = box((1.005, -1, 1.5), (2, 1, 2.5), "post")
    found = fo.best_pose(tower(sizes=(), keep_out=[post]), box=(0.99, 1.01))
    assert found.worst_gap == pytest.approx(0.01, **NEAR)
    assert [found.parameters[f"{part}.TX"] for part in ("lower", "upper")] == pytest.approx([-0.0025] * 2, abs=1e-6)
    assert found.certified
    assert found.passed


def test_a_face_that_tilts_is_off_by_its_corners() -> None:
    """A block of half length 1, which must turn by .01 at least: its corners are as far above as below."""
    asked = fo.Assembly(
        {"floor": FLOOR, "lower": LOWER}, [("lower", "floor")], (), {"lower": Z >> fo.Rotation("x")},
        limits={"lower": {"RX": (0.01, 0.02)}},
    )  # fmt: skip
    found = fo.best_pose(asked, box=(1.0, 1.0))
    assert found.parameters["lower.RX"] == pytest.approx(0.01, abs=1e-9)
    assert found.worst_gap == pytest.approx(np.sin(0.01), rel=1e-6)
    assert not found.certified


def test_several_contacts_are_as_far_off_each() -> None:
    """In the corner: gaps x - d / 2 - e and y - d / 2 - e, d from 0 to .02 and e within .01."""
    asked = SCENES["several contacts"].ask(OFF).changed(tolerance=[[0.0, 0.02], [0.01, 0.01]])
    found = fo.best_pose(asked)
    assert found.worst_gap == pytest.approx(0.015, **NEAR)
    assert [*found.parameters.values()] == pytest.approx([0.005, 0.005, 0.0], **NEAR)
    assert found.certified
    assert fo.verify(found).passed
    listed = fo.best_pose(asked, sizes=[(1.0, 1.0), (1.02, 1.0)])
    assert (listed.worst_gap, listed.certified) == (pytest.approx(0.005, **NEAR), True)


def test_a_fit_of_one_wall_asks_for_limits() -> None:
    wall = box((-1, 0, 0), (0, 1, 1), "wall")
    asked = fo.Problem(CUBE, wall, goal="fit", contacts="all", motion=X, tolerance=0.01, requirement="C")
    for motion in (X, X >> fo.Rotation("z")):
        with pytest.raises(InputError, match="no contact holds the part"):
            fo.best_pose(asked.changed(motion=motion), certify=False)
    held = fo.best_pose(asked.changed(limits={"TX": (-1.0, 0.5)}))  # x + .5 (1 - rho_1) + .5 (1 - rho_2)
    assert held.least.gap == pytest.approx(0.49, **NEAR)


@pytest.mark.parametrize(
    ("more", "window", "lift", "value", "bound"),
    [
        ({}, None, 0.016, 0.016, 0.015),
        ({}, (0.0, 1.0), 0.032, 0.032, 0.03),
        ({"resolution": None, "amount": "displacement"}, (0.0, 1.0), 0.03, 0.03, 0.0),
    ],
)
def test_steps_of_the_machine_and_other_amounts(more, window, lift, value, bound) -> None:
    """Gaps from z - .03 to z, in steps of .004."""
    asked = SCENES["resolution"].ask(OFF).changed(tolerance=[[0.0, 0.02], [0.0, 0.02]], **more)
    found = fo.best_pose(asked, clearance=window or "middle")
    assert found.parameters["TZ"] == pytest.approx(lift, **NEAR)
    assert found.value == pytest.approx(value, **NEAR)
    assert found.lower_bound == pytest.approx(bound, rel=1e-3, abs=1e-9)
    assert (found.certified, found.passed) == (False, True)


def test_a_window_between_two_steps_holds_no_pose_of_the_machine() -> None:
    """Gaps of z - .03 to z, all within [0, .031]: z from .03 to .031, where no step of .004 is."""
    asked = SCENES["resolution"].ask(OFF).changed(tolerance=[[0.0, 0.02], [0.0, 0.02]])
    found = fo.best_pose(asked, clearance=(0.0, 0.031))
    assert (found.status, found.lower_bound, found.passed) == ("undecided", 0.0, True)
    assert found.violation == pytest.approx(0.001, **NEAR)


def test_a_solid_kept_as_its_surface_bars_its_middle() -> None:
    """The post's middle is no place for a pin, though nothing there touches its surface."""
    pin, post = box((0.3, 0.3, 0.6), (0.5, 0.5, 0.8), "pin"), hollow(box((-1, -1, 0.2), (2, 2, 2), "post"))
    asked = fo.Problem(pin, box((-3, -3, -1), (3, 3, 0), "table"), goal="touch", motion=Z, keep_out=(fo.KeepOut(post),),
                       tolerance=0.01, requirement="A", limits={"TZ": (-1.0, 1.0)})  # fmt: skip
    found = fo.best_pose(asked)
    assert found.parameters["TZ"] == pytest.approx(-0.6, abs=2e-3)  # on the table, below the post


def test_surfaces_that_are_apart_are_refused() -> None:
    lifted = box((0, 0, 1), (1, 1, 2), "cube")
    asked = fo.Problem(lifted, hollow(TABLE), tolerance=0.01, requirement="A", goal="touch", motion=Z)
    with pytest.raises(InputError, match="here are none as drawn"):
        fo.best_pose(asked)


def test_scales_of_an_assembly_need_a_box() -> None:
    with pytest.raises(InputError, match="have no tolerance"):
        fo.best_pose(tower(sizes=()))


# ------------------------------------------------------------------------------------------------------------ stack-ups


def gate() -> fo.Assembly:
    """Two blocks in a frame, .2 lower than it: what is left is .2 + mouth - thick - tall."""
    frame = fo.Body.from_parts(
        [[(x, y, z) for x in (-3, 3) for y in (-3, 3) for z in ends] for ends in ((-1, 0), (2.2, 3))], name="frame"
    )
    parts = {"frame": frame, "lower": LOWER, "upper": UPPER}
    sizes = [
        fo.Size("mouth", "frame", faces={"through": (0, 0, 2.2)}, each=-1.0, tolerance=(-0.01, 0.03)),
        fo.Size("thick", "lower", faces=["+z", "-z"], each=0.5, tolerance=0.05),
        fo.Size("tall", "upper", faces="+z", tolerance=(0.0, 0.04)),
    ]
    contacts = [("lower", "frame"), ("upper", "lower"), {"parts": ("upper", "frame"), "goal": "clear"}]
    return fo.Assembly(parts, contacts, sizes, {"lower": X >> Z, "upper": X >> Y >> Z})


@pytest.mark.slow
def test_a_gap_is_opened_by_all_sizes_of_its_loop() -> None:
    stack = fo.stack_up(gate(), of=("upper", "frame"))
    worst = stack.worst()
    assert (worst.least, worst.largest) == pytest.approx((0.2 - 0.01 - 0.05 - 0.04, 0.2 + 0.03 + 0.05), **NEAR)
    assert worst.at_least == pytest.approx({"mouth": -0.01, "thick": 0.05, "tall": 0.04})
    assert stack.gap({"mouth": 0.01, "thick": -0.02, "tall": 0.03}) == pytest.approx(0.2 + 0.01 + 0.02 - 0.03, **NEAR)
    assert {own.size: own.worst for own in stack.contributions} == pytest.approx(
        {"mouth": 0.04 / 0.18, "thick": 0.1 / 0.18, "tall": 0.04 / 0.18}
    )
    certificate = fo.verify(stack)
    assert certificate.passed
    assert sum(check.name.startswith("closed: ") for check in certificate.checks) == 10
    assert fo.verify(stack.yield_(2_000)).passed


@pytest.mark.slow
def test_the_judge_moves_the_parts_as_their_sizes_do() -> None:
    stack = fo.stack_up(gate(), of=("upper", "frame"))
    (pair,) = stack.touching.pairs
    wrong = pair._replace(values=pair.values * [1.0, 1.0, 0.5, 1.0])  # half of what the block below takes
    forged = replace(stack, touching=replace(stack.touching, pairs=(wrong,)))
    assert {check.name for check in fo.verify(forged).failed} >= {"least gap", "gap at sampled sizes"}
    loop = stack.loop
    still = tuple(replace(own, moved=None) for own in loop.closed)
    forged = replace(stack, loop=replace(loop, closed=still))
    assert any(check.name.startswith("closed: ") for check in fo.verify(forged).failed)


def test_contacts_that_cannot_all_close_have_no_loop() -> None:
    """A third contact beside the two that place the blocks: thicknesses of both sides are not one."""
    parts = {"floor": FLOOR, "left": box((-2, 0, 0), (-1, 1, 1), "left"), "right": box((1, 0, 0), (2, 1, 1), "right")}
    parts["lid"] = box((-2, 0, 1), (2, 1, 2), "lid")
    contacts = [("left", "floor"), ("right", "floor"), ("lid", "left"), ("lid", "right")]
    sizes = [fo.Size("one", "left", faces="+z", tolerance=0.01), fo.Size("two", "right", faces="+z", tolerance=0.01)]
    table = fo.Assembly(parts, contacts, sizes, dict.fromkeys(("left", "right", "lid"), Z), follows={"lid": "floor"})
    with pytest.raises(InputError, match="cannot all be closed"):
        fo.stack_up(table, of=("left", "right"))  # all four contacts are to stay closed
    stack = fo.stack_up(table, of=("lid", "right"))  # the lid is on the left one
    assert stack.gap({"one": 0.01, "two": -0.01}) == pytest.approx(0.02, **NEAR)
    assert fo.verify(stack).passed
    with pytest.raises(InputError, match="which gap is meant"):
        fo.stack_up(table)
    (told,) = (stack_report(table) or {})["notes"]  # which named no command that takes them
    assert "; `fcdm-opt stack` takes two parts of " in told
    assert told.endswith(", as --of left,floor")


def test_a_probe_on_a_surface_has_the_rows_of_its_contact() -> None:
    top = fo.Size("top", "static", faces="+z", tolerance=0.05)
    probe = fo.Size("all", "movable", scale="xyz", tolerance=0.05)
    stack = fo.stack_up(fo.Problem(PROBE, hollow(TABLE), sizes=[top, probe], motion=Z, goal="touch"))
    assert stack.gap({"top": 0.01, "all": 0.2}) == pytest.approx(-0.21, **NEAR)
    assert fo.verify(stack).passed


def test_a_tool_was_turned_by_eleven_degrees_for_a_worst_gap_that_it_has_at_rest() -> None:
    """The rail's range of .07 sets the worst gap; the carriage's of .06 leaves the tool where it is drawn.

    Each step of the search was corrected for its curvature by all gaps, and the rail's had no room for that.
    """
    rail, carriage = box((-10, -4, -2), (10, 4, 0), "rail"), box((-3, -3, 0), (3, 3, 4), "carriage")
    tool = fo.Body.convex([(0, 0, 4), *((x, y, 7) for x in (-1, 1) for y in (-1, 1))])
    top = fo.Size("rail top", "rail", faces=["+z"], tolerance=(-0.02, 0.05))
    height = fo.Size("height", "carriage", faces=["+z"], tolerance=0.03)
    lift = fo.Translation("z")
    assembly = fo.Assembly(
        {"rail": rail, "carriage": carriage, "tool": tool}, [("carriage", "rail"), ("tool", "carriage")],
        sizes=[top, height], motions={"carriage": lift, "tool": lift >> fo.Rotation("x", (0, 2, 4))},
    )  # fmt: skip
    best = fo.best_pose(assembly)
    assert best.worst_gap == pytest.approx(0.035, abs=1e-9)
    assert [*best.parameters.values()] == pytest.approx([0.015, 0.0, 0.0], abs=1e-7)


@pytest.mark.slow
def test_gaps_of_a_roller_in_an_assembly_are_those_of_its_cylinder() -> None:
    """On its floor it moves by half its diameter, not by what a corner of facets does (.0502 of .05); a lid by all."""
    pin = fo.Cylinder(5, 20, base=(-10, 5, 0), axis=(1, 0, 0), name="pin")
    plates = [fo.Box((40, 10, 40), centre=(0, y, 0), name=name) for name, y in (("floor", -5), ("lid", 15.3))]
    contacts = [{"parts": ("pin", "floor"), "goal": "touch"}, {"parts": ("pin", "lid"), "goal": "clear"}]
    sizes = [
        fo.Size("d", "pin", faces="cylinder radius 5", each=0.5, tolerance=0.1),
        fo.Size("h", "floor", faces="+y", tolerance=0.05),
    ]
    asked = fo.Assembly([*plates, pin], contacts, sizes, {"pin": fo.Translation("y")})
    at = {"d": 0.1, "h": 0.05}
    for of, drawn, rates in ((("pin", "floor"), 0.0, (0.5, 1.0)), (("pin", "lid"), 0.3, (1.0, 1.0))):
        stack = fo.stack_up(asked, of=of)
        ends = stack.worst().least, stack.worst().largest
        most = rates[0] * at["d"] + rates[1] * at["h"]
        assert ends == pytest.approx((drawn - most, drawn + most), abs=1e-9)
        assert stack.gap(at) == pytest.approx(ends[0], abs=1e-9)
        assert [-stack.rows[0].coefficients[name] for name in at] == pytest.approx(rates, abs=1e-9)
        assert fo.verify(stack).passed
    best = fo.best_pose(asked)
    assert best.value == pytest.approx(0.1, abs=1e-9)
    assert fo.verify(best).passed


def between_posts(*, width=(), motion=X) -> fo.Assembly:
    """A block that lies at the left post of its base, and .1 off the right one."""
    walls = [((-5, -5, -2), (16, 5, 0)), ((-5, -5, 0), (0, 5, 6)), ((10.1, -5, 0), (16, 5, 6))]
    base = fo.Body.from_parts([box(*ends, "").vertices for ends in walls], name="base")
    sizes = [
        fo.Size("width", "block", faces="+x", tolerance=0.1), *width,
        fo.Size("slot", "base", faces={"through": (10.1, 0, 3)}, each=-1.0, tolerance=0.1),
    ]  # fmt: skip
    block = box((0, -5, 0), (10, 5, 4), "block")
    return fo.Assembly({"base": base, "block": block}, [("block", "base")], sizes, {"block": motion})


def test_a_wall_that_is_no_contact_as_drawn_was_left_out_of_the_gap_of_its_parts() -> None:
    """Slot less width is .1 and .2 more or less; what the left side of the block grows by, it is in the left post."""
    stack = fo.stack_up(between_posts())
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((-0.1, 0.3), **NEAR)
    assert stack.gap({"width": 0.02, "slot": -0.03}) == pytest.approx(0.1 - 0.02 - 0.03, **NEAR)
    assert fo.verify(stack).passed
    assert fo.verify(stack.yield_(2_000)).passed
    stack = fo.stack_up(between_posts(width=[fo.Size("left", "block", faces="-x", tolerance=0.05)]))
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((-0.1, 0.05), **NEAR)
    assert fo.verify(stack).passed
    assert stack.gap({"width": 0.4}) == pytest.approx(-0.3, **NEAR)  # beyond the tolerances


def test_a_part_carried_by_another_has_the_walls_of_that_one() -> None:
    """A pallet in a frame that stands on a floor whose height lifts both: a bar of the frame is .1 above the pallet."""
    walls = [((-5, -5, 0), (15, 5, 1)), ((-5, -5, 5.1), (15, 5, 7))]
    frame = fo.Body.from_parts([box(*ends, "").vertices for ends in walls], name="frame")
    parts = {"floor": box((-9, -9, -1), (20, 9, 0), "floor"), "frame": frame, "pallet": box((0, -5, 1), (9, 5, 5), "")}
    sizes = [
        fo.Size("floor", "floor", faces="+z", tolerance=0.5),
        fo.Size("tall", "pallet", faces="+z", tolerance=(-0.02, 0.15)),
        fo.Size("bar", "frame", faces={"through": (0, 0, 5.1)}, each=-1.0, tolerance=(-0.07, 0.01)),
    ]
    contacts = [("frame", "floor"), ("pallet", "frame")]
    stack = fo.stack_up(fo.Assembly(parts, contacts, sizes, {"frame": X >> Z, "pallet": Z}), of=("pallet", "frame"))
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.1 - 0.15 - 0.07, 0.13), **NEAR)
    assert stack.gap({"floor": 2.0, "tall": 0.3}) == pytest.approx(-0.2, **NEAR)
    assert fo.verify(stack).passed


@pytest.mark.slow
@pytest.mark.sampled(2)
def test_a_wall_beside_a_contact_was_gone_through_by_poses_without_a_window() -> None:
    """Right of the block .1 is left, less .2 at worst: half of what it lacks is in either post.

    With a left side that may grow by .05 as well it lacks .15, of which .075 are in either.
    """
    for width, shift in (((), -0.05), ([fo.Size("left", "block", faces="-x", tolerance=0.05)], -0.025)):
        for window in (None, (0.0, np.inf)):
            pose = fo.best_pose(between_posts(width=width), clearance=window)
            off = -shift if not width else 0.075
            assert pose.parameters == pytest.approx({"block.TX": shift}, **NEAR)
            assert (pose.worst_gap, pose.least.gap) == pytest.approx((off, -off), **NEAR)
            assert pose.passed


def test_it_was_not_told_why_parts_in_a_row_leave_a_rest_of_the_same_worst_gap() -> None:
    """A pusher against a slider on a base up to .05 higher, with no contact of its own there: it is to be clear of it.

    The slider carries it: each lifts half of .05. The pusher's face sets the worst gap, .1, and that is rest's, too.
    """
    slider, half = box((0, 0, 0), (10, 10, 10), "slider"), 0.025
    sizes = [fo.Size("top", "base", faces="+z", tolerance=0.05), fo.Size("face", "pusher", faces="+x", tolerance=0.1)]
    contacts = [("slider", "base"), ("pusher", "slider")]
    for drawn, more, lift in ((0.0, (), half), (0.05, (), 0.0), (0.0, [("pusher", "base")], 0.0)):
        pusher = box((-10, 0, drawn), (0, 10, 10), "pusher")
        parts = {"base": box((-20, -9, -5), (20, 20, 0), "base"), "slider": slider, "pusher": pusher}
        motions = {"slider": Z, "pusher": X >> Z}
        pose = fo.best_pose(fo.Assembly(parts, [*contacts, *more], sizes, motions, follows={"pusher": "slider"}))
        assert [*pose.parameters.values()] == pytest.approx([lift, 0.0, lift], **NEAR)
        assert pose.worst_gap == pytest.approx(0.1, **NEAR)
        assert pose.passed
        why = ("pusher and base, which are kept clear of each other, at worst overlap by 0.05",) * (lift > 0.0)
        assert pose.too_near_at_rest == why
        assert f"at rest {why[0] if why else ''}" in str(pose) or not why


def test_a_keep_out_that_rest_is_too_near_to_is_told_and_left_by_no_more_than_it_takes() -> None:
    """By .2; it was 3.4 where a search found the same worst gap, or none, below the table, out of the place."""
    post = fo.KeepOut(box((10.3, -5, 0), (12, 5, 9), "post"), clearance=0.5)
    asked = fo.Problem(
        box((0, -5, 0), (10, 5, 9), "block"), box((-9, -9, -5), (20, 9, 0), "table"), goal="touch", motion=X >> Z,
        sizes=[fo.Size("top", "static", faces="+z", tolerance=0.05)], keep_out=[post],
    )  # fmt: skip
    pose = fo.best_pose(asked)
    assert pose.parameters == pytest.approx({"TX": -0.2, "TZ": 0.0}, **NEAR)
    above = fo.best_pose(asked, clearance=(0.0, np.inf))
    assert above.parameters == pytest.approx({"TX": -0.2, "TZ": 0.05}, **NEAR)
    assert pose.too_near_at_rest == (
        "block and post, which are kept clear of each other, at worst are 0.3 apart, a clearance of 0.5 is required",
    )
    assert pose.to_dict()["too_near_at_rest"] == list(pose.too_near_at_rest)
