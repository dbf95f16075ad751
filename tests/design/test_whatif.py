"""What-if: predictions against closed forms and to second order, what is told of changes, what is handed on."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from ordinary import box, problems

import fcdm_opt as fo
from fcdm_opt.design.whatif.whatif import WhatIf, whatif
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.primitives import Box, Cylinder, cut
from fcdm_opt.geometry.size import Size
from fcdm_opt.motion.motions import Rotation, Translation
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Solution
from fcdm_opt.show.printing import print_rows
from fcdm_opt.show.tables import print_comparison, print_whatif
from fcdm_opt.solver import solve

EXACT = 1e-11  # of closed forms, relative to the size
XY = Translation("x") >> Translation("y")


@cache
def of_file(name: str, case: str) -> Solution:
    return solve(problems(name)[case])


CUBE = box((-1, -1, -1), (1, 1, 1), "cube")
WALL = box((0.9, -0.5, -1), (3, 0.5, 1), "wall")
ROOF = box((-0.5, 0.95, -1), (0.5, 3, 1), "roof")


@cache
def cornered() -> Solution:
    """A cube .1 deep in a wall and .05 in a roof: amount hypot(.1 + c, .05 + k) for clearances c and k."""
    kept = KeepOut(ROOF, clearance=0.03)
    return solve(Problem(CUBE, WALL, target=(1.0, 1.0), motion=XY, goal="clear", clearance=0.02, keep_out=(kept,)))


@cache
def held() -> Solution:
    """The same, pushed further by a limit: amount hypot(.15, .08)."""
    return solve(cornered().problem.changed(limits={"TX": (-1.0, -0.15)}))


# -------------------------------------------------------------------------------------------------------- predictions


def stretched(body: Body, row: int, shift: Any) -> Body:
    vertices = body.vertices.copy()
    vertices[row] += shift
    return Body.convex(vertices, seed=body.seed, name=body.name)


def seeded(body: Body, shift: Any) -> Body:
    return Body.convex(body.vertices, seed=body.seed + np.array(shift), name=body.name)


CHANGES: dict[str, tuple[Callable[[], Solution], Callable[[Problem, float], dict[str, Any]]]] = {
    "tolerance": (lambda: of_file("example1_touch", "B"), lambda p, h: {"tolerance": 0.02 * (1 + h)}),
    "tolerance of one side": (
        lambda: of_file("example1", "C"),
        lambda p, h: {"tolerance": ((0.02 + 0.01 * h, 0.02), (0.02, 0.02))},
    ),
    "tracked tolerance": (lambda: of_file("example1", "B"), lambda p, h: {"tolerance": 0.02 * (1 + h)}),
    "tie of constraints": (lambda: of_file("peg_square", "B at the wall"), lambda p, h: {"tolerance": 0.01 * (1 + h)}),
    "target": (
        lambda: of_file("peg_square", "turned until it jams"),
        lambda p, h: {"target": p.target * [1 + 0.003 * h, 1 - 0.001 * h]},
    ),
    "target for a requirement": (
        lambda: of_file("example1_touch", "B"),
        lambda p, h: {"target": p.target * [1 + 0.002 * h, 1.0]},
    ),
    "weight": (lambda: of_file("example1_touch", "B"), lambda p, h: {"weights": {"TZ": 1 + 0.1 * h}}),
    "length": (lambda: of_file("example1", "C"), lambda p, h: {"length": p.length * (1 + h)}),
    "clearance": (cornered, lambda p, h: {"clearance": 0.02 * (1 + h)}),
    "keep-out's clearance": (cornered, lambda p, h: {"keep_out": (KeepOut(ROOF, clearance=0.03 * (1 + h)),)}),
    "limit": (held, lambda p, h: {"limits": {"TX": (-1.0, -0.15 * (1 + h))}}),
    "vertex": (
        lambda: of_file("example2", "B"),
        lambda p, h: {"movable": stretched(p.movable, 4, [0.2 * h, 0.05 * h, 0.03 * h])},
    ),
    "seed": (
        lambda: of_file("example1_touch", "B"),
        lambda p, h: {"movable": seeded(p.movable, [0.1 * h, 0, 0.1 * h])},
    ),
    "all at once": (
        lambda: of_file("example1_touch", "B"),
        lambda p, h: {
            "tolerance": 0.02 * (1 - h),
            "length": p.length * (1 + h),
            "static": seeded(p.static, [0, 0.02 * h, 0]),
            "limits": {"TZ": (-1.0, 1.0)},
        },
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_prediction_is_right_to_second_order(name: str) -> None:
    solved, changes = CHANGES[name]
    before = solved()
    errors, shifts = [], []
    for h in (0.08, 0.04):
        found = whatif(before, **changes(before.problem, h))
        assert found.after.usable
        assert found.prediction.reasons == ()
        errors.append(found.after.amount - found.predicted_amount)
        shifts.append(found.change)
    assert abs(shifts[1]) > 1e-7 * before.amount  # something happened
    if abs(errors[0]) > 1e-9 * before.amount:
        assert 3.4 < errors[0] / errors[1] < 4.6  # halving the change quarters the error
    else:
        assert abs(errors[1]) <= 1e-9 * before.amount  # the amount is linear in it


def test_amounts_are_those_of_closed_forms() -> None:
    before = cornered()
    assert before.amount == pytest.approx(math.hypot(0.12, 0.08), abs=EXACT)
    found = whatif(before, clearance=0.03, keep_out=(KeepOut(ROOF, clearance=0.05),))
    assert found.after.amount == pytest.approx(math.hypot(0.13, 0.10), abs=EXACT)
    slope = np.array([0.12, 0.08]) / math.hypot(0.12, 0.08)
    assert found.predicted_amount == pytest.approx(before.amount + slope @ [0.01, 0.02], abs=1e-9)
    assert found.prediction.terms == {
        "clearance": pytest.approx(slope[0] * 0.01, abs=1e-9),
        "keep_out 'roof' clearance": pytest.approx(slope[1] * 0.02, abs=1e-9),
    }


def test_walls_that_shift_are_predicted_by_their_faces() -> None:
    """Peg against the lower wall: TY = .125 - S with S = 10 rho_2 - w rho_1 for a peg of half-width w."""
    before = of_file("peg_square", "against the lower wall")
    peg, target = before.problem.movable, before.problem.target
    arms = peg.vertices - peg.seed
    wide = Body.convex(peg.seed + arms * np.where([True, True, False], 9.8 / 9.75, 1.0), seed=peg.seed, name="peg")
    found = whatif(before, movable=wide, length=before.problem.length)
    amount = 10 * target[1] - 9.8 * target[0] - 0.125
    assert found.after.amount == pytest.approx(amount, abs=1e-9)
    assert found.predicted_amount == pytest.approx(amount, abs=1e-9)
    assert set(found.prediction.terms) == {"P1 faces"}
    tapered = peg.vertices + np.where(arms[:, 2:] > 0, 0.01, 0.0) * np.sign(arms) * [1, 1, 0]
    turned = whatif(before, movable=Body.convex(tapered, seed=peg.seed, name="peg"), length=before.problem.length)
    assert np.isnan(turned.predicted_amount)
    assert "breaks or turns a face" in turned.prediction.reasons[0]


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"goal": "beyond"}, "goal is another"),
        ({"motion": Translation("x")}, "motion is another"),
        ({"requirement": "A"}, "requirement is another"),
        ({"amount": "displacement"}, "amount is another"),
        ({"nominal": 2}, "another switching point"),
    ],
)
def test_a_discrete_change_is_not_predicted(changes: dict[str, Any], reason: str) -> None:
    found = whatif(of_file("example1_touch", "B"), **changes)
    assert np.isnan(found.predicted_amount)
    assert any(reason in text for text in found.prediction.reasons)


def test_limits_that_come_and_go() -> None:
    before = held()
    gone = whatif(before, limits=None)
    assert np.isnan(gone.predicted_amount)
    assert gone.after.amount == pytest.approx(cornered().amount, abs=EXACT)
    idle = whatif(before, limits={"TX": (-2.0, -0.15), "TY": (-1.0, 1.0)})
    assert idle.predicted_amount == before.amount == pytest.approx(idle.after.amount, abs=EXACT)
    broken = whatif(cornered(), limits={"TX": (-1.0, -0.15)})
    assert "breaks the new limit of TX" in broken.prediction.reasons[0]
    assert np.isnan(broken.predicted_amount)


def test_no_derivative_where_the_requirement_is_only_just_met() -> None:
    touching = Problem(CUBE, box((1, -1, -1), (3, 1, 1)), target=(1.0, 1.0), motion=XY, goal="clear")
    before = solve(touching)
    assert before.amount == 0.0
    found = whatif(before, target=(1.01, 1.0))
    assert found.after.amount == pytest.approx(0.01, abs=EXACT)
    assert np.isnan(found.predicted_amount)
    assert "one-sided" in found.prediction.reasons[0]


def test_nothing_is_predicted_without_a_motion_before() -> None:
    stuck = of_file("example1_touch", "B").problem.changed(limits={"TZ": (0, 1e-6), "RZ": (0, 1e-6)})
    found = whatif(stuck, limits=None)
    assert not found.before.status.found
    assert found.after.usable
    assert np.isnan(found.predicted_amount)
    assert {"amount", "status", "usable"} <= {difference.name for difference in found.differences}
    assert "no motion was found" in str(found)


# ---------------------------------------------------------------------------------------------------- what is told


def test_differences_name_what_changed_and_nothing_else() -> None:
    before = of_file("peg_square", "against the lower wall")
    assert whatif(before).differences == ()
    assert whatif(before).predicted_amount == before.amount
    found = whatif(before, target=(0.97, 1.0))
    told = {difference.name: difference for difference in found.differences}
    assert set(told) == {"parameters.TY", "amount", "lower_bound", "pair"}
    assert told["parameters.TY"].after - told["parameters.TY"].before == pytest.approx(-0.0975, abs=1e-9)
    assert found.change == pytest.approx(0.0975, abs=1e-9)
    assert str(found).startswith("target changed: amount 0.32 -> 0.4175 mm (predicted 0.4175)")


@pytest.mark.parametrize("ends", [(-0.3, -0.2), (-0.4, -0.2), (-0.2, -0.2), (-0.4, -0.3), (-0.3, -0.3), (-0.31, -0.29)])
def test_a_held_parameter_is_predicted_to_go_to_the_better_end_of_its_new_range(ends: tuple[float, float]) -> None:
    """The peg has to go left by .1475 at least, up by .0225: the amount is the root of TX^2 + .0225^2."""
    held = of_file("peg_square", "running clearance").problem.changed(limits={"TX": (-0.3, -0.3)})
    found = whatif(held, limits={"TX": ends})
    slope = 0.3 / np.hypot(0.3, 0.0225)
    assert found.predicted_amount == pytest.approx(found.before.amount - slope * (0.3 + ends[1]), abs=1e-8)
    assert found.after.amount == pytest.approx(np.hypot(ends[1], 0.0225), abs=1e-8)


def test_a_held_parameter_that_is_let_go_is_not_predicted() -> None:
    held = of_file("peg_square", "running clearance").problem.changed(limits={"TX": (-0.3, -0.3)})
    found = whatif(held, limits={"TX": (-0.3, np.inf)})
    assert np.isnan(found.predicted_amount)
    assert found.prediction.reasons == ("the limit of TX, which holds the motion, is gone: no derivative by that",)


def test_an_amount_predicted_below_zero_is_said_to_be_none() -> None:
    found = whatif(of_file("peg_square", "against the lower wall"), target=(1.05, 1.0))
    assert found.predicted_amount < 0.0  # .32 - 9.75 * .07, as the peg passes the wall
    assert any(reason.startswith("below zero") for reason in found.prediction.reasons)


def test_another_motion_replaces_the_parameters() -> None:
    found = whatif(of_file("peg_square", "against the lower wall"), motion=Rotation("z"), limits=None)
    told = {difference.name: (difference.before, difference.after) for difference in found.differences}
    assert told["parameters.TY"][1] is None
    assert told["parameters.RZ"][0] is None


@pytest.mark.parametrize("changes", [{"tolerance": 0.03}, {"motion": Translation("x"), "goal": "beyond"}])
def test_it_can_be_written_as_json(changes: dict[str, Any]) -> None:
    found: WhatIf = whatif(of_file("example1_touch", "B").problem, **changes)
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert data["changed"] == list(changes)
    assert Solution.from_dict(data["after"]).amount == pytest.approx(found.after.amount, abs=0.0, nan_ok=True)
    assert str(type(found).from_dict(data)) == str(found)
    assert set(data["seconds"]) == {"before", "after", "prediction"}


def test_infinity_is_a_word_in_json() -> None:
    found = whatif(of_file("peg_square", "against the lower wall"), goal="seat")  # proved impossible: the bound is inf
    told = json.loads(json.dumps(found.to_dict(), allow_nan=False))["differences"]
    (bound,) = (difference for difference in told if difference["name"] == "lower_bound")
    assert bound["after"] == "inf"


def test_what_stays_is_handed_on_and_the_answer_is_that_of_a_fresh_problem() -> None:
    before = of_file("example1", "B")
    found = whatif(before, tolerance=0.025)
    assert found.after.problem.curve is before.problem.curve
    assert found.after.problem.movable is before.problem.movable
    fresh = solve(Problem.from_dict(found.after.problem.to_dict()))
    assert fresh.parameters == found.after.parameters


def test_a_certified_solution_is_compared_with_a_certified_one() -> None:
    certified = solve(of_file("example1_touch", "B").problem, certify=True)
    assert certified.evidence is not None
    assert whatif(certified, tolerance=0.021).after.evidence is not None
    assert whatif(of_file("example1_touch", "B"), tolerance=0.021).after.evidence is None


def test_a_target_takes_the_place_of_a_requirement_and_back() -> None:
    before = of_file("example1_touch", "B")
    found = whatif(before, target=tuple(before.problem.target))
    assert found.differences == ()
    assert whatif(found.after, requirement="B", tolerance=0.02).differences == ()


def test_bad_input_is_named() -> None:
    with pytest.raises(InputError, match="tolrance: a problem has no such argument"):
        whatif(of_file("example1", "B"), tolrance=0.03)
    with pytest.raises(InputError, match="problem: wrong kind of argument; found 'str'"):
        whatif("example1.toml")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="tolerance"):
        whatif(of_file("example1", "B"), tolerance=-1.0)


def test_an_amount_was_predicted_below_zero_where_the_motion_goes_the_other_way() -> None:
    """A pin 0.02 thicker in a bore 0.02 smaller has a play of 0.03; 0.02 thinner, in one 0.01 larger, 0.065."""
    pin = Cylinder(3.95, 30.0, base=(0, 0, -15))
    plate = cut(Box((30, 30, 10)), Cylinder(4.0, 30.0, base=(0, 0, -15)))
    named = (("pin", "movable", "cylinder radius 3.95", 0.5), ("bore", "static", "bore radius 4", -0.5))
    sizes = [Size(name, role, faces=[face], each=each) for name, role, face, each in named]
    asked = Problem(pin, plate, sizes=sizes, made={"pin": 0.02, "bore": -0.02}, goal="touch", motion=Translation("x"))
    assert whatif(asked, made={"pin": -0.02, "bore": 0.01}).predicted_amount == pytest.approx(0.065, rel=1e-9)
    # a stop moved out by 0.02 for a rod that is too thick is moved in by 0.01 for one that is too thin
    stop, rod = Box((10, 12, 14), centre=(-10, 0, 0)), Cylinder(5.0, 30.0, base=(0, 0, -15))
    size = Size("rod", "static", faces=["cylinder radius 5"], each=0.5)
    held = Problem(stop, rod, sizes=[size], made={"rod": 0.04}, goal="touch", motion=Translation("x"))
    found = whatif(held, made={"rod": -0.02})
    assert found.predicted_amount == pytest.approx(0.01, rel=1e-9)
    assert found.after.amount == pytest.approx(0.01, rel=1e-9)


def test_what_if_a_block_that_does_not_fit_were_smaller() -> None:
    """A block .05 too high for its slot, between stops that leave it no way out: there is no motion to predict from."""
    slot = fo.cut(fo.Box((30, 30, 20)), fo.Box((10, 40, 10)))
    block, height = fo.Box((9, 30, 9.9)), fo.Size("height", "movable", faces="+z", tolerance=0.2)
    shifts = fo.Translation("y") >> fo.Translation("z")
    limits = {"TY": (-1, 1), "TZ": (-1, 1)}
    asked = fo.Problem(block, slot, sizes=[height], made={"height": 0.15}, goal="clear", motion=shifts, limits=limits)
    found = fo.whatif(asked, made={"height": 0.05})
    assert found.before.status is fo.Status.INFEASIBLE
    assert math.isnan(found.predicted_amount)
    assert found.after.amount == pytest.approx(0.0)
    assert "not predicted" in str(found)


def test_an_amount_was_predicted_from_a_motion_that_takes_a_block_out_of_its_slot(capsys: Any) -> None:
    """A block .05 too high for a slot 30 long leaves it endwise: "predicted 30" for one that fits."""
    slot = fo.cut(fo.Box((30, 30, 20)), fo.Box((10, 40, 10)))
    block, height = fo.Box((9, 30, 9.9)), fo.Size("height", "movable", faces="+z", tolerance=0.2)
    shifts = fo.Translation("y") >> fo.Translation("z")
    asked = fo.Problem(block, slot, sizes=[height], made={"height": 0.15}, goal="clear", motion=shifts)
    found = fo.whatif(asked, made={"height": 0.05})
    assert found.before.status is fo.Status.OUTSIDE_FIT
    assert found.after.amount == pytest.approx(0.0)
    assert math.isnan(found.predicted_amount)
    assert found.prediction.reasons == ("the motion found before is not to be used",)
    print_whatif(found)
    before, after, *notes = capsys.readouterr().out.splitlines()[2:]
    assert before.split()[-6:] == ["-", "-", "-", "does", "not", "fit"]
    assert "touching" not in before
    assert "verified" in after
    assert not [line for line in notes if line.startswith("predicted ")]


def test_the_one_size_of_many_that_was_changed_was_not_told(capsys: Any) -> None:
    """Of six sizes the last is changed, of two contacts the clearance of the second: "asked" names the first four."""
    blocks = [fo.Box((2, 2, 2), centre=(0, 0, z), name=name) for name, z in (("low", 0), ("mid", 2), ("top", 5))]
    faces = {f"{axis} {side}": f"{side}{axis}" for axis in "xyz" for side in "-+"}
    sizes = [fo.Size(name, "low", faces=face, tolerance=0.1) for name, face in faces.items()]
    parts, z = {own.name: own for own in blocks}, fo.Translation("z")
    contacts = [{"parts": ["mid", "low"]}, {"parts": ["top", "mid"], "goal": "clear", "clearance": 0.5}]
    given = {"motions": {"mid": z, "top": z}, "sizes": sizes, "unit": "mm"}
    asked = fo.Assembly(parts, contacts, made=dict.fromkeys(faces, 0.01), **given)
    wider = [contacts[0], {**contacts[1], "clearance": 0.75}]
    print_whatif(fo.whatif(asked, made={**dict.fromkeys(faces, 0.01), "z +": 0.03}, contacts=wider))
    told = capsys.readouterr().out
    assert "made.z +: 0.01 -> 0.03" in told
    assert "contacts[2].clearance: 0.5 -> 0.75" in told


def test_a_table_too_wide_for_the_page_had_cells_without_anything(capsys: Any) -> None:
    print_rows([{"": "predicted", "asked": "", "amount": "0.2", "motion": ""}, {"": "before", "asked": 999 * "x "}])
    assert capsys.readouterr().out.splitlines()[:3] == ["predicted", "  amount: 0.2", "before"]


def test_a_change_that_changes_nothing_is_said_to() -> None:
    """A cube .1 deep in a wall is to go back by that, whatever scales curves are shown at."""
    asked = Problem(CUBE, WALL, target=(1, 1), goal="touch", motion=Translation("x"))
    assert str(whatif(asked, target=(1, 1))).startswith("nothing changed: ")
    assert "nothing is changed: the question is the same" in str(whatif(asked, asked.changed(target=(1, 1))))
    assert "the answer stays the same" in str(whatif(asked, box=((0.9, 1.1), (0.9, 1.1))))
    assert "same" not in str(whatif(asked, target=(1.1, 1)))


def test_amounts_of_answers_without_a_motion_were_nan() -> None:
    """A lid that rests on two blocks, one of them higher: by shifts it does not, however much the higher one is."""
    parts = {"lid": fo.Box((20, 10, 2), centre=(0, 0, 2)), "left": fo.Box((9, 10, 2), centre=(-5, 0, 0))}
    parts["right"] = fo.Box((9, 10, 2), centre=(5, 0, 0))
    asked = fo.Assembly(
        parts, [("lid", "left"), ("lid", "right")], motions={"lid": fo.Translation("z")},
        sizes=[fo.Size("high", "right", faces="+z", tolerance=0.1)], made={"high": 0.02}, unit="mm",
    )  # fmt: skip
    assert "made changed: no amount before or after (" in str(fo.whatif(asked, made={"high": 0.01}))
    assert "amount none -> 0 mm" in str(fo.whatif(asked, made={"high": 0.0}))


def test_the_amount_of_a_motion_out_of_the_fit_was_compared(capsys: Any) -> None:
    """A block .05 too high for a slot 30 long: along y it leaves that, by 30; along z it needs .05."""
    slot = fo.cut(fo.Box((30, 30, 20)), fo.Box((10, 40, 10), centre=(0, 0, 5)))
    block, low = fo.Box((9, 30, 12), centre=(0, 0, 6)), fo.Size("low", "movable", faces="-z", tolerance=0.2)
    asked = fo.Problem(block, slot, sizes=[low], made={"low": 0.05}, goal="clear", motion=fo.Translation("y"))
    found = fo.compare(asked, {"along": fo.Translation("y"), "up": fo.Translation("z")})
    print_comparison(found)
    (line,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("along"))
    assert "outside the fit" in line
    assert line.split()[1] == "-"
