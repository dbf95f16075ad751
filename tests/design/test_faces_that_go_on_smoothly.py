"""Round faces that plane ones go on from tangentially: a shaft in a U-saddle, and an obround pin in its slot.

Gaps are told by hand. Of a shaft of radius r in the middle of a half bore of radius R between walls at distance w to
both sides it is min(R, w) - r; pushed to a wall, w - r, and down into the bore, R - r.
"""

from __future__ import annotations

import dataclasses
from itertools import product

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.geometry.patches import true_faces
from fcdm_opt.geometry.true_distance import FacePieces

J, B = (-0.04, -0.01), (0.0, 0.03)  # diameters of journal and bore


@pytest.fixture(scope="module")
def saddle() -> fo.Problem:
    """A shaft of 24 in a saddle of 24.1 along x, its bore's walls as far apart."""
    block = fo.cut(fo.Box((50, 40, 30), centre=(0, -5, 0)), fo.Cylinder(12.05, 40, base=(0, 0, -20)))
    sizes = [
        fo.Size("j", "movable", faces="cylinder radius 12", each=0.5, tolerance=J),
        fo.Size("b", "static", faces="bore radius 12.05", each=-0.5, tolerance=B),
    ]
    return fo.Problem(
        fo.Cylinder(12, 60, base=(0, 0, -30), name="shaft"),
        fo.cut(block, fo.Box((24.1, 40, 40), centre=(0, 20, 0)), name="saddle"),
        sizes=sizes, made={}, target=(1, 1), goal="touch", motion=fo.Translation("x"),
    )  # fmt: skip


@pytest.fixture(scope="module")
def obround() -> fo.Problem:
    """A pin with round ends of radius 5, 12 apart, in a slot that is 0.1 larger all around."""
    blank = fo.Box((40, 30, 10))
    holes = (fo.Cylinder(5.1, 20, base=(x, 0, -10)) for x in (-6, 6))
    ends = (fo.Cylinder(5, 14, base=(x, 0, -7)) for x in (-6, 6))
    sizes = [
        fo.Size("b", "static", faces=["bore radius 5.1 no. 1", "bore radius 5.1 no. 2"], each=-1, tolerance=(0, 0.004)),
        fo.Size("e", "movable", faces=["cylinder radius 5 no. 1", "cylinder radius 5 no. 2"], each=1,
                tolerance=(-0.004, 0)),
    ]  # fmt: skip
    return fo.Problem(
        fo.joined(fo.Box((12, 10, 14)), *ends, name="pin"),
        fo.cut(blank, *holes, fo.Box((12, 10.2, 20)), name="slot"),
        sizes=sizes, made={}, target=(1, 1), goal="touch", motion=fo.Translation("x"),
    )  # fmt: skip


def test_walls_decide_where_the_bore_alone_gets_larger(saddle: fo.Problem) -> None:
    stack = fo.stack_up(saddle)
    worst = stack.worst()
    assert (worst.least, worst.largest) == pytest.approx((0.055, 0.07), abs=1e-10)
    for j, b in product((*J, 0.0), (*B, 0.01)):
        assert float(stack.gap({"j": j, "b": b})) == pytest.approx(0.05 - j / 2, abs=1e-10)
    slopes = {tuple(np.round(row, 9)) for pair in stack.touching.pairs for row in pair.values[:, 1:]}
    assert slopes == {(-0.5, 0.0)}  # a larger bore is further off than the walls everywhere
    assert fo.verify(stack).passed


@pytest.mark.parametrize(("axis", "amount"), [("x", 0.07), ("y", 0.085)])
def test_the_saddle_made_is_touched_after_what_is_worked_out_by_hand(
    saddle: fo.Problem, axis: str, amount: float
) -> None:
    limits = {"TY": (-1.0, 0.0)} if axis == "y" else {}
    found = fo.solve(saddle.changed(made={"j": -0.04, "b": 0.03}, motion=fo.Translation(axis), limits=limits))
    assert (found.amount, found.lower_bound) == pytest.approx((amount, amount), abs=1e-9)
    assert fo.verify(found).passed
    assert "do not fit" not in str(found)


def test_where_a_bore_and_its_walls_cross_once_it_is_larger(saddle: fo.Problem) -> None:
    made = saddle.changed(made={"b": 0.03}).static
    own = made.vertices[np.abs(np.abs(made.vertices[:, 0]) - 12.05) < 1e-9]
    assert np.abs(own[:, 1] + np.sqrt(12.065**2 - 12.05**2)).min() < 1e-9  # they go on down to there


def test_a_bore_that_may_be_smaller_than_its_walls_and_larger_has_rows_of_its_own(saddle: fo.Problem) -> None:
    journal, bore = saddle.sizes
    stack = fo.stack_up(saddle.changed(sizes=[journal, dataclasses.replace(bore, tolerance=(-0.02, 0.03))]))
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.045, 0.07), abs=1e-10)
    slopes = {tuple(np.round(row, 9)) for pair in stack.touching.pairs for row in pair.values[:, 1:]}
    assert slopes == {(-0.5, 0.0), (-0.5, 0.5)}
    assert fo.verify(stack).passed


@pytest.mark.parametrize("channel", [0.1, 0.01])
def test_walls_further_apart_than_the_bore_have_the_bounds_of_true_faces(saddle: fo.Problem, channel: float) -> None:
    walls = [{"through": (x, 5, 0)} for x in (12.05, -12.05)]
    sizes = [*saddle.sizes, fo.Size("c", "static", faces=walls, each=[-0.5, -0.5], tolerance=(0, 0.1))]
    made = saddle.changed(sizes=sizes, made={"j": -0.04, "b": 0.03, "c": channel})
    found = fo.solve(made)
    amount = 0.07 + min(channel, 0.03) / 2
    assert (found.amount, found.lower_bound) == pytest.approx((amount, amount), abs=1e-9)
    assert not found.left_by_mesh
    # where bore and walls no longer cross, pieces of the bore leave it by no more than its facets
    facet = 12.065 * (1.0 - np.cos(np.pi / 32.0))
    assert FacePieces.of(true_faces(made.static)).errors.max() < 2.0 * facet


@pytest.mark.slow
def test_poses_and_clearances_of_a_saddle_are_told(saddle: fo.Problem) -> None:
    found = fo.clearances(saddle)
    assert found.on_true_faces
    assert (found.least.gap, found.most.gap) == pytest.approx((0.055, 0.07), abs=1e-10)
    best = fo.best_pose(saddle)  # between 0.0075 of interference and of clearance
    assert abs(best.parameters["TX"]) == pytest.approx(0.0625, abs=1e-6)


@pytest.mark.slow
def test_an_obround_pin_has_its_own_gap_to_each_face_of_its_slot(obround: fo.Problem) -> None:
    stack = fo.stack_up(obround)
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.1, 0.1), abs=1e-10)  # as flats tell
    assert fo.verify(stack).passed
    for b, e in ((0.0, 0.0), (0.004, 0.0), (0.004, -0.004)):
        along = fo.solve(obround.changed(made={"b": b, "e": e}))
        across = fo.solve(obround.changed(made={"b": b, "e": e}, motion=fo.Translation("y")))
        assert (along.amount, along.lower_bound) == pytest.approx((0.1 + b - e,) * 2, abs=1e-9)
        assert (across.amount, across.lower_bound) == pytest.approx((0.1, 0.1), abs=1e-9)
