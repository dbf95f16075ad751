"""What is said of a solution besides its numbers."""

from __future__ import annotations

import re
from itertools import product
from typing import Any

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.design.whatif import fitting
from fcdm_opt.problem.solution import Status
from fcdm_opt.show.assemblies import unsaid
from fcdm_opt.show.remarks import not_considered, remarks
from fcdm_opt.show.solved import SolvedCase
from fcdm_opt.show.texts import advised
from fcdm_opt.show.verdict import verdict_text

CUBE = np.array([*product((-0.5, 0.5), repeat=3)])


def shifted(apart: float, **more) -> fo.Solution:
    """Two unit cubes, the static one so far away along x: the movable one shifts by the gap, or out of the other."""
    one, two = fo.Body.convex(CUBE), fo.Body.convex(CUBE + np.array([apart, 0.0, 0.0]))
    return fo.solve(fo.Problem(one, two, target=(1.0, 1.0), goal="touch", motion=fo.Translation("x"), **more))


@pytest.mark.parametrize(("apart", "moved"), [(1.2, 0.2), (1.6, 0.6), (0.3, -0.7), (0.49, -0.51), (0.51, -0.49)])
def test_a_motion_of_more_than_half_a_part_is_said_to_be_large(apart: float, moved: float) -> None:
    """But for one that only closes a gap: there is nothing on its way."""
    solution = shifted(apart)
    assert solution.parameters["TX"] == pytest.approx(moved, abs=1e-9)
    told = remarks(solution)
    assert [text.startswith("a large motion: ") for text in told] == [True] * (moved < -0.5)
    assert all("it may end on another side" in text and "of TX" in text for text in told)


def test_wider_limits_were_advised_that_do_not_do() -> None:
    """A square 2e-6 wider than its frame: it gets out of it by a shift of 17.0000015, which 17 does not allow."""
    half, corner = 5.000001, 7.0 * 1.0000003
    plug = fo.Body.convex([(*own, z) for z in (-1, 3) for own in ((1, 7), (-7, 1), (-1, -7), (7, -1))])
    frame = fo.cut(fo.Box((24, 24, 2), centre=(0, 0, 1)), fo.Box((2 * half, 2 * half, 8)), name="frame")
    motion = fo.Rotation("z") >> fo.Translation("x") >> fo.Translation("y")
    limits = {"TX": (-0.5, 0.5), "TY": (-0.5, 0.5)}
    asked = fo.Problem(plug, frame, motion=motion, limits=limits, goal="clear", target=(corner / 7.0, 1.0))
    assert not (found := fo.solve(asked)).usable
    assert advised(SolvedCase(found)) == "Choose another motion, a smaller tolerance or other sizes."


def test_limits_that_are_there_are_not_advised() -> None:
    (told,) = remarks(shifted(0.3, limits={"TX": (-1.0, 1.0)}))
    assert "limits" not in told


def test_no_motion_is_not_large() -> None:
    assert remarks(shifted(1.6, limits={"TX": (-0.1, 0.1)})) == []


def test_steps_that_do_nothing_are_left_out_of_the_words() -> None:
    from fcdm_opt.show.texts import motion_text

    one, two = fo.Body.convex(CUBE), fo.Body.convex(CUBE + np.array([1.2, 0.0, 0.0]))
    both = fo.Translation("y") >> fo.Translation("x")
    problem = fo.Problem(one, two, target=(1.0, 1.0), goal="touch", motion=both)
    assert motion_text(fo.solve(problem)) == "TX 0.2"
    assert motion_text(fo.solve(problem.changed(target=(1.0, 1.4)))) == "TY 0"  # touching as it is


def test_what_a_motion_goes_through_on_its_way_was_not_named() -> None:
    """A box above a slab is to touch the floor below it; between them is a keep-out."""

    def block(low: float, high: float) -> np.ndarray:
        return CUBE * np.array([4.0, 4.0, high - low]) + np.array([0.0, 0.0, (low + high) / 2])

    static = fo.Body.from_parts([block(-0.5, 0.0), block(-8.0, -7.5)], seed=(0.0, 0.0, 0.0), name="table")
    box, shelf = fo.Body.convex(CUBE + np.array([0.0, 0.0, 1.0])), fo.Body.convex(block(-3.0, -2.9), name="shelf")
    asked = {"target": (1.0, 1.0), "goal": "touch", "motion": fo.Translation("z"), "keep_out": (fo.KeepOut(shelf),)}
    through = fo.solve(fo.Problem(box, static, **asked, limits={"TZ": (-9.0, -5.0)}))
    assert through.parameters["TZ"] == pytest.approx(-8.0, abs=1e-9)
    assert "straight there it goes through table and keep-out shelf" in remarks(through)[-1]
    assert [text for text in remarks(fo.solve(fo.Problem(box, static, **asked))) if "large" in text] == []


def test_a_distance_of_pins_that_no_motion_mends_was_answered_by_wider_limits() -> None:
    """Pins of 9.9 in bores of 10, .12 farther apart than drawn: 50.02 in 50; the facets say less than .02 / 2."""
    pins = [fo.Cylinder(4.95, 16, base=(x, 0, -10)) for x in (-20, 20)]
    base = fo.joined(fo.Box((60, 40, 8), centre=(0, 0, -9), name="base"), *pins)
    plate = fo.cut(fo.Box((60, 40, 8), name="plate"), *(fo.Cylinder(5, 30, base=(x, 0, -15)) for x in (-20, 20)))
    sizes = [
        fo.Size("spacing", "static", faces=["cylinder radius 4.95 no. 2"], along="x", tolerance=0.2),
        fo.Size("width", "movable", faces=["+y", "-y"], each=0.5, tolerance=0.2),
    ]
    asked = {"sizes": sizes, "goal": "clear", "motion": fo.Translation("x"), "limits": {"TX": (-0.5, 0.5)}}
    solution = fo.solve(fo.Problem(plate, base, made={"spacing": 0.12}, **asked))
    assert solution.status is Status.INFEASIBLE
    told = advised(SolvedCase(solution))
    assert told == "Change spacing (to +0.1)."  # what is impossible stands in the verdict
    facets = [text for text in remarks(solution) if "is of the facets" in text]
    assert len(facets) == 1
    assert f"overlapping by {-solution.pair_gap:.4g}" in facets[0]
    (text,) = (text for text in not_considered(solution) if text.startswith("The convex parts of base"))
    assert "motion, amount and bound are of the true faces" in text


def test_sizes_without_a_part_in_the_least_gap_stood_beside_those_with_one_without_a_word() -> None:
    """Between walls along x .1 away and along y .105, .01 more or less: "worst" is the least gap of either."""
    walls = fo.Body.from_parts([
        [*product(*own)]
        for own in (
            ((-9, -1.1), (-9, 9), (0, 1)), ((1.1, 9), (-9, 9), (0, 1)),
            ((-1.1, 1.1), (-9, -1.105), (0, 1)), ((-1.1, 1.1), (1.105, 9), (0, 1)),
        )
    ])  # fmt: skip
    block = fo.Body.convex([*product((-1, 1), (-1, 1), (0, 1))])
    sizes = [fo.Size(axis, "movable", faces=[f"+{axis}", f"-{axis}"], each=0.5, tolerance=0.02) for axis in ("x", "y")]
    asked = fo.Problem(block, walls, sizes=sizes, made="worst", goal="clear", motion=fo.Translation("x"))
    assert asked.made == pytest.approx({"x": 0.02, "y": 0.02})
    word = "without a part in the least gap"
    assert sum(word in text for text in remarks(fo.solve(asked))) == 1
    assert not [text for text in remarks(fo.solve(asked.changed(made={"x": 0.02, "y": 0.02}))) if word in text]


def test_the_least_play_at_rest_stood_as_the_worst_case() -> None:
    """A lid .3 over a block: the block's height off by .02 has the least play at +.02, of an assembly, too."""
    block, lid = fo.Box((2, 2, 2), name="block"), fo.Box((2, 2, 1), centre=(0, 0, 1.8), name="lid")
    asked: dict[str, Any] = {"motion": fo.Translation("z"), "goal": "touch", "made": "worst"}
    pair = fo.Problem(lid, block, sizes=[fo.Size("height", "static", faces="+z", tolerance=0.02)], **asked)
    assert pair.made == {"height": 0.02}
    parts = fo.Assembly(
        {"lid": lid, "block": block}, [{"parts": ["lid", "block"], "goal": "touch"}],
        motions={"lid": fo.Translation("z")}, made="worst",
        sizes=[fo.Size("height", "block", faces="+z", tolerance=0.02)],
    )  # fmt: skip
    for worst, loose in (
        (remarks(fo.solve(pair)), remarks(fo.solve(pair.changed(made="loosest")))),
        (unsaid(fo.solve(parts)), unsaid(fo.solve(parts.changed(made="loosest")))),
    ):
        assert sum("is the least play at rest" in text and "see stack" in text for text in worst) == 1
        assert not any("at rest" in text for text in loose)


def test_a_size_with_which_another_width_still_lacks_is_not_advised():
    """10.05 by 10.03 in a window of 10: with its length as drawn, it is too wide by .03 all the same."""
    window = fo.cut(fo.Box((30, 30, 4)), fo.Box((10, 10, 6)), name="window")
    sizes = [fo.Size(f"along {axis}", "movable", faces=[f"+{axis}", f"-{axis}"], each=0.5) for axis in "xy"]
    shifts = fo.Translation("x") >> fo.Translation("y")
    problem = fo.Problem(fo.Box((10, 10, 4), name="insert"), window, sizes=sizes, goal="clear", motion=shifts,
                         made={"along x": 0.05, "along y": 0.03}, unit="mm")  # fmt: skip
    assert fitting.mending_sizes(problem) == {}
    assert "along" not in advised(SolvedCase(fo.solve(problem)))
    assert fitting.mending_sizes(problem.with_sizes({"along y": 0.0})) == {"along x": 0.0}


def test_the_size_that_is_beyond_its_tolerance_is_advised_first_and_no_other_is_asked_about_in_vain(monkeypatch):
    """A slot 10 wide, and a key of 10.08 within -.1, .05; or the slot made wider, within .1."""
    slot = fo.cut(fo.Box((30, 30, 4)), fo.Box((10, 30, 6)), name="slot")
    sizes = [fo.Size("slot", "static", faces=[{"through": (5, 0, 0)}], each=-1, tolerance=0.1),
             fo.Size("key", "movable", faces=["+x"], tolerance=(-0.1, 0.05))]  # fmt: skip
    problem = fo.Problem(fo.Box((10, 10, 4), name="key"), slot, sizes=sizes, goal="clear", motion=fo.Translation("x"),
                         made={"key": 0.08}, unit="mm")  # fmt: skip
    assert [*fitting.mending_sizes(problem)] == ["key", "slot"]


@pytest.mark.slow
def test_a_distance_of_pins_that_only_a_turn_or_the_size_beside_it_mends_was_answered_by_the_spacing() -> None:
    """Pins of 9.9 in bores of 10, 40 apart, one .12 aside, across: 40.0002 in 40 once turned, spacing does nothing."""
    pins = [fo.Cylinder(4.95, 16, base=(x, 0, -10)) for x in (-20, 20)]
    base = fo.joined(fo.Box((60, 40, 8), centre=(0, 0, -9), name="base"), *pins)
    plate = fo.cut(fo.Box((60, 40, 8), name="plate"), *(fo.Cylinder(5, 30, base=(x, 0, -15)) for x in (-20, 20)))
    sizes = [
        fo.Size(name, "static", faces=["cylinder radius 4.95 no. 2"], along=along, tolerance=0.3)
        for name, along in (("spacing", "x"), ("aside", "y"))
    ]
    asked = {"sizes": sizes, "goal": "clear", "motion": fo.Translation("x") >> fo.Translation("y")}
    asked["limits"] = {"TX": (-0.5, 0.5), "TY": (-0.5, 0.5)}
    for made in (0.12, 0.22):
        solution = fo.solve(fo.Problem(plate, base, made={"aside": made}, **asked))
        assert solution.status is Status.INFEASIBLE
        assert advised(SolvedCase(solution)) == "Change aside, or allow a turn about z."
    both = fo.solve(fo.Problem(plate, base, made={"spacing": 0.25, "aside": 0.12}, **asked))
    assert advised(SolvedCase(both)).startswith("Change spacing")
    assert "turn" not in advised(SolvedCase(both))


def test_contacts_were_named_by_labels() -> None:
    """A block on a floor and at a wall, 0.1 taller: along x its floor contact cannot be closed."""
    block = fo.Box((4, 4, 4), centre=(0, 0, 2), name="block")
    ends = fo.Box((10, 10, 2), centre=(0, 0, -1)), fo.Box((2, 10, 6), centre=(3, 0, 3))
    ell = fo.Body.from_parts([own.vertices for own in ends], name="ell")
    height = fo.Size("height", "movable", faces="-z", tolerance=0.2)
    given = {"goal": "at", "contacts": "all", "motion": fo.Translation("x")}
    told = remarks(fo.solve(fo.Problem(block, ell, sizes=[height], made={"height": 0.1}, **given)))
    assert told[:2] == [
        "contact 1, bottom face of block, face 2 (facing +z) of ell",
        "contact 2, right face of block, face 7 (facing -x) of ell",
    ]


def peg_in_hole(high: float, **asked: Any) -> fo.Solution:
    """A peg 10 wide, .1 from either wall of a hole, whose right face is higher."""
    walls = [*fo.cut(fo.Box((30, 30, 6), name="plate"), fo.Box((10.2, 12, 8))).parts]
    plate = fo.Body.from_parts([part.vertices for part in walls], name="plate", seed=(0, 0, 0))
    right = fo.Size("right", "movable", faces="+x", tolerance=0.5)
    high_peg = {"sizes": [right], "made": {"right": high}, "goal": "clear", "motion": fo.Translation("x"), "unit": "mm"}
    return fo.solve(fo.Problem(fo.Box((10, 10, 10), name="peg"), plate, **high_peg, **asked))


@pytest.mark.parametrize(
    ("high", "limits", "told"),
    [
        (0.15, (-0.02, 0.02), "Widen the lower limit of TX to -0.05 mm, or change right (to +0.12 mm)."),
        (0.15, (0.0, 0.0), "Widen the limits of TX to -0.05 mm, or change right (to +0.1 mm)."),
        (0.25, (-0.2, 0.2), "Change right (to +0.2 mm)."),  # 10.25 in 10.2: no limit mends it
        (0.25, (-0.02, 0.02), "Change right (to +0.12 mm)."),
    ],
)
def test_how_far_a_size_or_a_limit_is_to_change_was_not_told(
    high: float, limits: tuple[float, float], told: str
) -> None:
    """The face is .1 from the wall as drawn, and the peg may move as far as that the other way."""
    assert advised(SolvedCase(peg_in_hole(high, limits={"TX": limits}))) == told


def test_a_size_beyond_its_tolerance_was_no_cure() -> None:
    """A peg of 10.3, with 10 +- .1 in order, in a slot of 10.2 + .1: 10.2 in 10.2 fits, and 10.3 in 10.3."""
    walls = fo.joined(*(fo.Box((5, 30, 6), centre=(side * 7.6, 0, 0)) for side in (-1, 1)), name="walls")
    inner = [{"through": (side * 5.1, 0.0, 0.0)} for side in (-1, 1)]
    sizes = [
        fo.Size("peg", "movable", faces=["+x", "-x"], each=0.5, tolerance=0.1),
        fo.Size("slot", "static", faces=inner, each=-0.5, tolerance=(0.0, 0.1)),
    ]
    asked = fo.Problem(
        fo.Box((10, 10, 10), name="peg"), walls,
        sizes=sizes, made={"peg": 0.3}, goal="clear", motion=fo.Translation("x"), unit="mm",
    )  # fmt: skip
    solution = fo.solve(asked)
    assert advised(SolvedCase(solution)) == "Change peg (to +0.2 mm, beyond its tolerance) or slot (to +0.1 mm)."
    found = fo.conflicts(solution)
    assert found.sizes == pytest.approx({"peg": 0.2, "slot": 0.1})
    assert "to change alone: peg to +0.2 mm\nto change alone: slot to +0.1 mm" in str(found)
    assert fo.conflicts(solution, deviation=False).sizes == {}


def test_a_bar_in_a_bore_was_told_by_facets_and_the_bore_was_to_change() -> None:
    """A bar 8 x 6 in a bore of 10.1, .3 wider: its diagonal is sqrt(8.3^2 + 6^2) = 10.2416; 8.1246 would do."""
    bar, sleeve = fo.Box((8, 6, 20), name="bar"), fo.Box((20, 20, 10), name="sleeve")
    sizes = [
        fo.Size("bore", "static", faces="bore radius 5.05", each=-0.5, tolerance=0.01),
        fo.Size("width", "movable", faces=["+x", "-x"], each=0.5, tolerance=0.2),
    ]
    shifts = fo.Translation("x") >> fo.Translation("y")
    problem = fo.Problem(
        bar, fo.cut(sleeve, fo.Cylinder(5.05, 30, base=(0, 0, -15))),
        sizes=sizes, made={"width": 0.3}, goal="clear", motion=shifts, unit="mm",
    )  # fmt: skip
    solution = fo.solve(problem)
    assert verdict_text(solution).startswith("does not fit: bar 10.24 mm in sleeve 10.10 mm, across the bore")
    assert "facets" not in verdict_text(solution)
    assert advised(SolvedCase(solution)) == "Change width (to +0.124 mm)."  # the bore within .01 does not


def test_a_part_lifted_far_for_its_clearance_was_not_told_with_what_is_left_near() -> None:
    """A hexagon of 15 across its edges in a chute of 15.2 has .1 on either side; above its walls it has any."""
    across = [(7.5 * np.cos(turn), 7.5 * np.sin(turn)) for turn in np.arange(6) * np.pi / 3]
    bar = fo.Body.convex([(x, y, z + across[1][1]) for x in (-15, 15) for y, z in across], name="bar")
    chute = fo.cut(fo.Box((50, 24, 19), centre=(0, 0, 4.5)), fo.Box((60, 15.2, 20), centre=(0, 0, 10)), name="chute")
    asked = {"target": (1, 1), "goal": "clear", "clearance": 0.2, "unit": "mm"}
    found = fo.solve(fo.Problem(bar, chute, motion=fo.Translation("y") >> fo.Translation("z"), **asked))
    assert found.amount > 7.0
    (told,) = remarks(found)
    assert told.endswith("of TY, TZ; clearance not met there, where at most 0.1 mm can be kept")


def test_contacts_that_are_as_far_open_are_told_in_one_line() -> None:
    """Five teeth .1 narrower than their slots: flanks are open by half of that, floors closed."""
    spine = fo.Box((50.0, 10.0, 4.0), centre=(0.0, 0.0, 8.0))
    places = (-20.0, -10.0, 0.0, 10.0, 20.0)
    comb = fo.joined(spine, *(fo.Box((4.0, 10.0, 6.0), centre=(x, 0.0, 3.0)) for x in places), name="comb")
    slots = [fo.Box((4.0, 20.0, 6.0), centre=(x, 0.0, 3.0)) for x in places]
    plate = fo.cut(fo.Box((60.0, 10.0, 10.0), centre=(0.0, 0.0, 0.0)), *slots, name="plate")
    narrow = [fo.Size("teeth", "movable", faces=[{"through": (x + 2.0, 0.0, 3.0)} for x in places], each=1.0)]
    fitted = fo.solve(fo.Problem(comb, plate, goal="fit", contacts="all", sizes=narrow, made={"teeth": -0.1},
                                 motion=fo.Translation("x") >> fo.Translation("z"), unit="mm"))  # fmt: skip
    lines = [text for text in remarks(fitted) if text.startswith("contact ")]
    assert (len(lines), len(fitted.problem.contacts)) == (1 + 5, 10 + 5)
    assert [text for text in lines if re.search(r", and 9 more \(\d+, .*\): open by 0\.05 mm$", text)]
