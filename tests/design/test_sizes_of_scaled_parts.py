"""Stack-ups, poses, clearances and tables of sizes where the case scales the parts: a size grows with its part."""

from itertools import product
from typing import Any

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.geometry.resizing import at_scale, resized
from fcdm_opt.show.report.cases import size_rows, stack_report

HOT = 1.004
NEAR = {"abs": 1e-9}


def channel(width: float, centre: float = 0.0) -> fo.Body:
    """Two walls with a gap of a width between them."""
    low, high = centre - width / 2.0, centre + width / 2.0
    walls = [[*product(ends, (-5.0, 5.0), (-5.0, 5.0))] for ends in ((low - 3.0, low), (high, high + 3.0))]
    return fo.Body.from_parts(walls, seed=(0.0, 0.0, 0.0), name="housing")


def hot(movable: fo.Body, static: fo.Body, *sizes: fo.Size, **more: Any) -> fo.Problem:
    """Both bodies at rest, the movable one hot."""
    asked: dict[str, Any] = {"target": (HOT, 1.0), "goal": "clear", "motion": fo.Translation("x"), **more}
    return fo.Problem(movable, static, sizes=sizes, **asked)


def checked(problem: fo.Problem, gap: Any, ends: tuple[float, float], off: float = 1e-9) -> None:
    """Check that all that is said of the gap at rest is the closed form, gap(p) of the only size within its ends."""
    (size,), stack, pose = problem.sizes, fo.stack_up(problem), fo.best_pose(problem.changed(limits={"TX": (0.0, 0.0)}))
    clear = fo.clearances(problem, count=100)
    least, largest = sorted(map(gap, ends))
    assert [stack.worst().least, stack.worst().largest] == pytest.approx([least, largest], abs=off)
    assert [clear.least.gap, clear.most.gap] == pytest.approx([least, largest], abs=off)
    assert [pose.least.gap, pose.most.gap] == pytest.approx([least, largest], abs=off)
    for p in (*ends, sum(ends) / 3.0):
        assert stack.gap({size.name: p}) == pytest.approx(gap(p), abs=off)
    assert fo.verify(stack)
    assert fo.verify(clear)
    assert pose.passed


def test_a_hot_cover_was_stacked_up_as_drawn() -> None:
    """A spigot of 60 at 1.004 of its size is 60.24 in 60.2; "least gap +.1, 100 % fit" was told of it."""
    spigot = fo.Box((60.0, 4.0, 4.0), name="cover")
    length = fo.Size("spigot length", "movable", faces=["+x", "-x"], each=0.5, tolerance=(-0.074, 0.0))
    problem = hot(spigot, channel(60.2), length)
    checked(problem, lambda p: (60.2 - HOT * (60.0 + p)) / 2.0, (-0.074, 0.0))
    assert fo.stack_up(problem).yield_(10_000).share < 0.9
    assert stack_report(problem)["worst"][0]["gap"] == pytest.approx(-0.02, **NEAR)
    made = problem.changed(made={length.name: -0.05})
    assert [(row["drawn"], row["made"]) for row in size_rows(made)] == [("60", f"{HOT * 59.95:.6g}")]
    assert fo.solve(made).pair_gap == pytest.approx(fo.stack_up(problem).gap(made.made), **NEAR)
    assert not fo.solve(problem.changed(made={length.name: -0.03})).usable


def test_faces_by_a_point_and_along_an_axis_are_those_of_the_part_as_drawn() -> None:
    """A channel of 10.2 about x = 20, at .99 of its size about 0, whose walls move together along x."""
    walls = [{"through": (14.9, 0.0, 0.0)}, {"through": (25.1, 0.0, 0.0)}]
    place = fo.Size("place", "static", faces=walls, along="x", tolerance=0.01)
    block = fo.Box((10.0, 4.0, 4.0), centre=(20.0, 0.0, 0.0))
    problem = hot(block, channel(10.2, 20.0), place, target=(1.0, 0.995))

    def gap(p: float) -> float:
        low, high = 0.995 * (14.9 + p), 0.995 * (25.1 + p)
        return min(15.0 - low, high - 25.0)

    checked(problem, gap, (-0.01, 0.01))


def test_a_round_pin_that_grows_in_its_bore() -> None:
    """A pin of 9.95 in a bore of 10, at 1.004 of its size: radii are told, not those of facets."""
    plate = fo.cut(fo.Box((30.0, 30.0, 8.0)), fo.Cylinder(5.0, 20.0, base=(0.0, 0.0, -10.0)), name="plate")
    pin = fo.Cylinder(4.975, 20.0, base=(0.0, 0.0, -10.0), name="pin")
    size = fo.Size("pin", "movable", faces="cylinder radius 4.975", each=0.5, tolerance=(-0.02, 0.01))
    checked(hot(pin, plate, size), lambda p: 5.0 - HOT * (4.975 + p / 2.0), (-0.02, 0.01), 1e-7)


def test_a_contact_of_parts_kept_as_surfaces_opens_and_closes_with_their_scales() -> None:
    """A block 6 high on a floor, scaled about its middle: it sinks in by half of what it grows."""
    notch = fo.Box((4.0, 4.0, 4.0), centre=(3.0, 3.0, 6.0))
    shape = fo.cut(fo.Box((6.0, 6.0, 6.0), centre=(0.0, 0.0, 3.0)), notch)
    rows = [own for face in shape.triangles for own in face]
    seed = (0.0, 0.0, 3.0)
    block = fo.Body.from_mesh(shape.vertices, rows, decomposition="surface", seed=seed, name="block")
    assert block.is_surface
    floor = fo.Box((20.0, 20.0, 2.0), centre=(0.0, 0.0, -1.0), name="floor")
    foot = fo.Size("foot", "movable", faces="-z", tolerance=(-0.05, 0.02))
    problem = hot(block, floor, foot, goal="touch", motion=fo.Translation("z"))
    stack = fo.stack_up(problem)
    ends = [-3.0 * (HOT - 1.0) - HOT * p for p in (0.02, -0.05)]
    assert [stack.worst().least, stack.worst().largest] == pytest.approx(ends, **NEAR)
    assert fo.verify(stack)
    pose = fo.best_pose(problem)
    assert (pose.parameters["TZ"], pose.value) == pytest.approx((-sum(ends) / 2.0, (ends[1] - ends[0]) / 2.0), **NEAR)
    assert pose.certified
    assert pose.passed


def tower(**more: Any) -> fo.Assembly:
    """A block 4 high on a floor, and above it a bridge that stands on the floor, its beam from 4.1 on."""
    floor, block = (fo.Box((20.0, 20.0, 2.0), centre=(0.0, 0.0, -1.0), name="floor"),
                    fo.Box((4.0, 4.0, 4.0), centre=(0.0, 0.0, 2.0), name="block"))  # fmt: skip
    legs = [[*product(ends, (-2.0, 2.0), (0.0, 4.1))] for ends in ((-6.0, -4.0), (4.0, 6.0))]
    bridge = fo.Body.from_parts(
        [*legs, [*product((-6.0, 6.0), (-2.0, 2.0), (4.1, 6.0))]], seed=(0, 0, 0), name="bridge"
    )
    contacts = [("block", "floor"), ("bridge", "floor"), {"parts": ("block", "bridge"), "goal": "clear"}]
    sizes = [fo.Size("height", "block", faces="+z", tolerance=(-0.05, 0.02))]
    motions = dict.fromkeys(("block", "bridge"), fo.Translation("z"))
    return fo.Assembly([floor, block, bridge], contacts, sizes, motions, **more)


def test_parts_of_an_assembly_were_stacked_up_as_drawn() -> None:
    """At 1.02 of its size the block is 4.08 + 1.02 p high, under 4.1: .02 is left, where .1 was told."""
    assembly = tower(scales={"block": 1.02})
    stack = fo.stack_up(assembly)
    assert [stack.worst().least, stack.worst().largest] == pytest.approx(
        [0.02 - 1.02 * 0.02, 0.02 + 1.02 * 0.05], **NEAR
    )
    assert fo.verify(stack)
    for p in (-0.05, 0.015):
        solved = fo.solve(assembly.changed(made={"height": p}))
        assert solved.usable
        assert stack.gap({"height": p}) == pytest.approx(0.02 - 1.02 * p, **NEAR)
    assert not fo.solve(assembly.changed(made={"height": 0.02})).usable  # -.0004
    pose = fo.best_pose(assembly)
    assert pose.passed
    # the block's foot, .04 below the floor's top as it is scaled about its middle, goes up to it; half of the .0004
    # that lacks at the largest height is taken here, half by the bridge
    assert [*pose.parameters.values()] == pytest.approx([0.04 - 0.0002, 0.0002], **NEAR)
    (row,) = size_rows(assembly.changed(made={"height": -0.05}))
    assert (row["drawn"], row["made"]) == ("4 to face bottom", "4.029 to face bottom")


@pytest.mark.parametrize("turn", [False, True])
def test_a_part_scaled_or_moved_is_cut_at_sizes_as_the_one_drawn(turn: bool) -> None:
    """A bored block made at a size and then scaled, or moved, is the block scaled, or moved, made at that size.

    Scaled, it was cut anew, into parts with other numbers, and the judge refused a contact of one of these.
    """
    box, bore = fo.Box((40.0, 30.0, 24.0)), fo.Cylinder(5.0, 30.0, base=(0.0, 0.0, -15.0))
    block = fo.cut(box, bore, name="block")
    quarter = [[0.0, -1.0, 0.0, 7.0], [1.0, 0.0, 0.0, 3.0], [0.0, 0.0, 1.0, 2.0], [0.0, 0.0, 0.0, 1.0]]
    there = block.moved(quarter) if turn else at_scale(block, 1.25)
    height = fo.Size("height", "movable", faces="+z")
    made, drawn = resized(there, {height: -0.25}), resized(block, {height: -0.25})
    truth = drawn.moved(quarter) if turn else drawn.scaled(1.25)
    assert made.faces == truth.faces
    for own, true in zip(made.parts, truth.parts, strict=True):
        np.testing.assert_allclose(own.vertices, true.vertices, rtol=0.0, atol=1e-9)
