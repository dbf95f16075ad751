"""Cuts between the convex parts of a body are none of its faces: no gap, pose or corner of tolerances is theirs.

A plate lies on a bar, closed at all sizes and not counted, and has a hook beside it. However the plate is cut, the gap
is that of the hook and the bar's side.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.curve import touching_sizes

PLAY, EDGE = 0.2, 0.03
TURN = np.array(fo.Rotation("x", centre="origin").transform([0.3], np.zeros(3), np.zeros(3))) @ np.array(
    fo.Rotation("y", centre="origin").transform([0.5], np.zeros(3), np.zeros(3))
)


def box(low, high, name="part"):
    corners = [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    return fo.Body.convex(corners, seed="box", name=name)


def parts_of(*boxes, name, seed=(0.0, 0.0, 0.0)):
    return fo.Body.from_parts([box(*own).vertices for own in boxes], seed=seed, name=name)


BAR = box((1, 0, -1), (3, 4, 0), "bar")
END = 1.0 - EDGE
WIDTH = fo.Size("width", "static", faces="+x", tolerance=0.1)
HOOK = ((3.0 + PLAY, 0, -1), (5, 4, 0))
# cut just beside the bar, across the bar, and level above it, 1 or .05 off it
CUTS = {
    "beside the bar": [((-3, 0, 0), (END, 4, 1)), ((END, 0, 0), (5, 4, 1)), HOOK],
    "across the bar": [((-3, 0, 0), (END, 4, 1)), ((END, 0, 0), (2, 4, 1)), ((2, 0, 0), (5, 4, 1)), HOOK],
    "along the bar": [((-3, 0, 0), (5, 1, 1)), ((-3, 1, 0), (END, 4, 1)), ((END, 1, 0), (5, 4, 1)), HOOK],
    "above the bar": [((-3, 0, 0), (5, 4, 0.05)), ((-3, 0, 0.05), (END, 4, 1)), ((END, 0, 0.05), (5, 4, 1)), HOOK],
    "not at all": [((-3, 0, 0), (5, 4, 1)), HOOK],
}


def asked(cut, **more):
    plate = parts_of(*CUTS[cut], name="plate")
    return fo.Problem(plate, BAR, goal="touch", **{"motion": fo.Translation("x"), "sizes": [WIDTH], "made": {}, **more})


@pytest.mark.sampled(3)
@pytest.mark.parametrize("cut", CUTS)
@pytest.mark.parametrize("turn", [np.eye(4), TURN], ids=["square", "aslant"])
def test_a_cut_beside_a_closed_contact_had_a_gap(cut, turn):
    """The bar's side is .2 - w off the hook, w within .1: .1 to .3. A cut .03 beside the bar made that .03 to .03."""
    problem = asked(cut)
    moved = {name: body.moved(turn) for name, body in (("movable", problem.movable), ("static", problem.static))}
    way = tuple(turn[:3, 0].tolist())
    if not np.array_equal(turn, np.eye(4)):
        sizes = [fo.Size("width", "static", faces={"through": tuple((turn @ [3.0, 2.0, -0.5, 1.0])[:3].tolist())},
                         tolerance=0.1)]  # fmt: skip
        problem = problem.changed(**moved, sizes=sizes, motion=fo.Translation(way))
    stack = fo.stack_up(problem)
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.1, 0.3), abs=1e-9)
    assert [row.coefficients for row in stack.rows] == [{"width": pytest.approx(-1.0)}]
    assert len(stack.standing) == 1
    assert fo.verify(stack).passed
    assert problem.changed(made="worst").made == {"width": pytest.approx(0.1)}
    assert problem.changed(made="loosest").made == {"width": pytest.approx(-0.1)}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("cut", CUTS)
def test_a_pose_kept_clear_of_a_cut(cut):
    """All gaps of .1 to .3 are .2 off by .1, and .04 and more at rest; the cut asked for -.01."""
    problem = asked(cut, limits={"TX": (-1.0, 1.0)})
    best = fo.best_pose(problem)
    assert best.parameters["TX"] == pytest.approx(-0.2, abs=1e-6)
    assert best.worst_gap == pytest.approx(0.1, abs=1e-6)
    assert best.certified
    clear = fo.best_pose(problem, clearance=(0.04, np.inf))
    assert clear.parameters["TX"] == pytest.approx(0.0, abs=1e-9)
    assert (clear.least.gap, clear.most.gap) == pytest.approx((0.1, 0.3), abs=1e-9)
    for own in (best, clear):
        assert fo.verify(own, proof=True).passed


@pytest.mark.sampled(2)
@pytest.mark.parametrize("cut", CUTS)
def test_a_cut_had_a_gap_of_parts_that_are_scaled(cut):
    """Scaled about a point of their plane by r and s within 1 %, the hook is 3.2 r - 3 s off the bar."""
    plate, bar = parts_of(*CUTS[cut], name="plate"), BAR.with_seed((0.0, 0.0, 0.0))
    motion = {"motion": fo.Translation("x"), "limits": {"TX": (-1.0, 1.0)}}
    problem = fo.Problem(plate, bar, tolerance=0.01, requirement="A", goal="touch", **motion)
    gaps, best = fo.clearances(problem, count=100), fo.best_pose(problem)
    assert gaps.range == pytest.approx((0.2 - 0.062, 0.2 + 0.062))
    assert best.worst_gap == pytest.approx(0.062, abs=1e-6)
    assert best.certified
    for own in (gaps, best):
        assert fo.verify(own, proof=own is best).passed


@pytest.mark.parametrize("cut", ["beside the bar", "above the bar"])
def test_the_judge_refuses_a_gap_of_a_cut(cut, monkeypatch):
    """Rows of cuts, taken for those of faces: the solid goes on beyond them."""
    monkeypatch.setattr(touching_sizes, "is_behind", lambda *how: False)
    stack = fo.stack_up(asked(cut))
    assert stack.worst().largest == pytest.approx({"beside the bar": EDGE, "above the bar": 0.05}[cut])
    assert {"least gap", "largest gap"} <= {check.name for check in fo.verify(stack).failed}


def test_a_groove_beside_a_closed_contact_has_no_gap_and_its_walls_have():
    """A pin in a groove of the plate, .03 off its wall: that is a face; the edge of the groove .03 off the bar is none.

    In the plane of the contact nothing meets: the plate slides over the edge.
    """
    parts = [((-3, 0, 0), (END, 4, 1)), ((END, 0, 0.5), (5, 4, 1)), ((1.5, 0, 0), (5, 4, 0.5)), HOOK]
    how = {"made": {}, "goal": "touch", "motion": fo.Translation("x")}
    stack = fo.stack_up(fo.Problem(parts_of(*parts, name="plate"), BAR, sizes=[WIDTH], **how))
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.1, 0.3))
    assert fo.verify(stack).passed
    bar = fo.Body.from_parts([BAR.vertices, box((1, 0, 0), (1.2, 4, 0.3)).vertices], seed=(2, 2, -0.5), name="bar")
    pin = fo.Size("pin", "static", faces={"through": (1.0, 2.0, 0.15)}, tolerance=0.01)
    stack = fo.stack_up(fo.Problem(parts_of(*parts, name="plate"), bar, sizes=[pin], **how))
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((EDGE - 0.01, EDGE + 0.01))
    assert fo.verify(stack).passed


@pytest.mark.sampled(1)
@pytest.mark.parametrize("tool", ["slot", "bore"])
def test_a_tool_far_from_any_contact_leaves_the_gap_as_it_is(tool):
    """As it was found: a cut of a slanted slot ends at x = 12.47, beside a rail that begins at 12.5; of a bore so too.

    The rail's sides are .2 - w / 2 off the hooks, w within .3: .05 to .35; moved by .2 they are off zero by .15.
    """
    slot = [(5.07, 30.0), (1.37, 25.0), (-3.63, 28.7), (0.07, 33.7)]
    tools = {
        "slot": fo.Body.convex([(x, y, z) for x, y in slot for z in (-1.0, 30.0)]),
        "bore": fo.Cylinder(3.0, 40.0, base=(0.0, 30.0, -10.0)),
    }
    plate = fo.joined(
        fo.Box((44.0, 20.0, 12.5), centre=(0.0, 30.0, 13.75)),
        *(fo.Box((4.3, 20.0, 2.5), centre=(x, 30.0, 6.25)) for x in (19.85, -19.85)),
    )
    rail = fo.joined(
        fo.Box((27.0, 60.0, 1.0), centre=(0.0, 30.0, 0.5)),
        *(fo.Box((5.0, 60.0, 1.0), centre=(x, 30.0, 7.0)) for x in (-15.0, 15.0)),
        *(fo.Box((1.0, 60.0, 6.0), centre=(x, 30.0, 3.5)) for x in (-13.0, 13.0)),
    )
    sides = [{"through": (x, 30.0, 7.0)} for x in (-17.5, 17.5)]
    sizes = [fo.Size("rail width", "static", faces=sides, each=0.5, tolerance=0.3)]
    motion = {"motion": fo.Translation("x"), "limits": {"TX": (-2.0, 2.0)}}
    problem = fo.Problem(fo.cut(plate, tools[tool]), rail, sizes=sizes, made={}, goal="touch", **motion)
    stack, best = fo.stack_up(problem), fo.best_pose(problem)
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.05, 0.35))
    assert abs(best.parameters["TX"]) == pytest.approx(0.2, abs=1e-6)
    assert best.worst_gap == pytest.approx(0.15, abs=1e-6)
    assert fo.verify(stack).passed
    assert best.passed


def test_what_is_covered_is_known_for_every_point_of_it() -> None:
    """The judge refused a stack-up of a plate with a pocket; an edge bare between two blocks was taken for covered."""

    def block(low, high) -> fo.Body:
        return fo.Box(np.subtract(high, low), centre=np.add(low, high) / 2.0)

    plate = fo.cut(block((-3, 0, 0), (3, 4, 1)), block((0.9, 1.8, -0.1), (2.4, 2.7, 0.3)))
    bed = fo.joined(
        block((-2, 0, -3), (2, 4, 0)), block((-9, -1, -4), (9, 5, -3)), block((4, 0, -3.5), (5, 4, 2)), name="bed"
    )
    sizes = [fo.Size("stop", "static", faces={"through": (4, 2.1, 0.5)}, tolerance=0.1)]
    asked = {"goal": "touch", "motion": fo.Translation("x"), "made": {}}
    pocketed = fo.stack_up(fo.Problem(plate, bed, sizes=sizes, **asked))
    assert (pocketed.worst().least, pocketed.worst().largest) == pytest.approx((0.3, 0.3))  # of its ceiling
    assert fo.verify(pocketed).passed

    def corners(low, high) -> list[tuple[float, ...]]:
        return [*product(*zip(low, high, strict=True))]

    ridge = [*product((3,), (0, 8), (1, 3)), (4, 0, 2), (4, 8, 2)]
    covers = [corners((3, 0, 1), (4.5, 1, 3)), corners((3, 4, 1), (4.5, 8, 3))]
    slide = fo.Body.from_parts([corners((-3, 0, 0), (3, 8, 3)), ridge, *covers], seed=(0, 4, 0.5))
    post = corners((4.2, 1.3, 0), (6, 3.2, 3))
    floor = fo.Body.from_parts(
        [corners((-5, -2, -1), (9, 10, 0)), post, corners((6, -1, -1), (7, 9, 3))], seed=(0, 4, -1)
    )
    sizes = [fo.Size("post", "static", faces={"through": (4.2, 2, 1)}, tolerance=0.05)]
    problem = fo.Problem(slide, floor, sizes=sizes, **asked)
    stack = fo.stack_up(problem)
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.15, 0.25))  # before the bare edge
    assert fo.verify(stack).passed
    assert problem.changed(made="worst").made == {"post": pytest.approx(0.05)}


TOOLS = {
    "nothing": (),
    "a rebate": (fo.Box((1, 5, 1), centre=(3.3, 2, -0.47)),),
    "a slot": (fo.Box((0.3, 5, 0.53), centre=(2.5, 2, -0.235)),),
    "a pocket": (fo.Box((0.3, 0.3, 0.53), centre=(2.5, 2, -0.235)),),
    "a rebate as far as the bed": (fo.Box((2, 5, 1), centre=(3, 2, -0.47)),),
}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("tool", TOOLS)
def test_a_facet_of_which_some_is_a_face_elsewhere_had_a_gap_where_it_is_a_cut(tool) -> None:
    """A lug .08 - w off a bed, w within .02: .06 to .10. What is cut .03 deep into the plate made it .03."""
    plate = fo.joined(fo.Box((6, 4, 1), centre=(0, 2, 0.5)), fo.Box((0.4, 4, 1), centre=(-2.28, 2, -0.4)))
    plate, bed = fo.cut(plate, *TOOLS[tool]), fo.Box((4, 4, 3), centre=(0, 2, -1.5), name="bed")
    motion = {"goal": "touch", "motion": fo.Translation("x"), "limits": {"TX": (-0.5, 0.5)}}
    left = fo.Size("left", "static", faces="-x", tolerance=0.02)
    problem = fo.Problem(plate, bed, sizes=[left], made={}, **motion)
    stack, best = fo.stack_up(problem), fo.best_pose(problem)
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.06, 0.1))
    assert problem.changed(made="worst").made == {"left": pytest.approx(0.02)}
    assert fo.clearances(problem, count=50).range == pytest.approx((0.06, 0.1))
    assert (best.parameters["TX"], best.worst_gap) == pytest.approx((0.08, 0.02), abs=1e-6)
    assert fo.verify(stack).passed
    assert best.passed
    if tool == "a rebate as far as the bed":  # which scaled ones would be under
        return
    at = (0.0, 0.0, 0.0)  # in the plane of the contact: scaled by r and s within 1 % the lug is 2.08 r - 2 s off
    scaled = fo.Problem(plate.with_seed(at), bed.with_seed(at), tolerance=0.01, requirement="A", **motion)
    assert fo.clearances(scaled, count=50).range == pytest.approx((0.08 - 0.0408, 0.08 + 0.0408))


def test_a_face_that_is_bare_where_the_other_part_is_still_counts() -> None:
    """A pocket .03 deep above a post as high as the bed: .03 less the post's w, within .01; elsewhere it is a cut."""
    plate = fo.cut(fo.Box((6, 4, 1), centre=(0, 2, 0.5)), fo.Box((1, 5, 1), centre=(2.3, 2, -0.47)))
    bed = fo.joined(fo.Box((4, 4, 3), centre=(-1, 2, -1.5)), fo.Box((6, 4, 1), centre=(0, 2, -3)))
    bed = fo.joined(bed, fo.Box((0.5, 4, 3), centre=(2.3, 2, -1.5)), name="bed")
    post = fo.Size("post", "static", faces={"through": (2.3, 2.1, 0.0)}, tolerance=0.01)
    problem = fo.Problem(plate, bed, sizes=[post], made={}, goal="touch", motion=fo.Translation("x"))
    stack = fo.stack_up(problem)
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.02, 0.04))
    assert fo.verify(stack).passed
    assert problem.changed(made="worst").made == {"post": pytest.approx(0.01)}
