"""Which constraint of a problem that can be solved costs how much."""

from __future__ import annotations

import json
import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from ordinary import CUBE, FAR, box, problems, random_scene

import fcdm_opt as fo
from fcdm_opt.design.whatif.constraints import Costs, Dropped, constraints, drop, without
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.motion.motions import Translation
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Status
from fcdm_opt.show.tables import print_costs
from fcdm_opt.solver import solve

X, Y = Translation("x"), Translation("y")


@cache
def costs(file: str, case: str) -> Costs:
    return drop(problems(file)[case])


def rows(found: Costs) -> dict[str, Dropped]:
    return {row.name: row for row in (*found.rows, *found.goals)}


def test_ribs_and_their_clearance_cost_what_the_formulas_say():
    """TX = 14 - c - 15 beside the ribs with clearance c, TZ = -2."""
    found = costs("bracket", "past the ribs")
    assert [row.name for row in found.rows] == ["keep-out 'ribs'", "keep-out 'ribs': clearance"]
    whole, clearance = found.rows
    assert whole.saving == pytest.approx(2.5 - 2.0, abs=1e-9)
    assert clearance.saving == pytest.approx(2.5 - math.hypot(1, 2), abs=1e-9)
    assert (whole.excess, clearance.excess) == pytest.approx((1.5, 0.5), abs=1e-7)
    # by the clearance the amount changes as TX / amount = 1.5 / 2.5
    assert (whole.rate, clearance.rate) == pytest.approx((0.6, 0.6), abs=1e-9)
    assert (whole.estimate, clearance.estimate) == pytest.approx((0.9, 0.3), abs=1e-7)
    assert found.free == ()
    assert found.solves == 4


def test_a_clearance_of_the_pair_costs_itself():
    found = costs("dovetail", "room to slide")
    (clearance,) = found.rows
    assert (clearance.saving, clearance.estimate) == pytest.approx((0.25, 0.25), abs=1e-9)
    assert clearance.rate == pytest.approx(1.0, abs=1e-9)
    assert clearance.excess == pytest.approx(0.25, abs=1e-7)


def test_other_goals_are_rows_of_their_own():
    found = costs("example1", "B")
    goals = rows(found)
    assert [row.name for row in found.goals] == ['goal "clear"', 'goal "touch"', 'goal "at"']  # by what they save
    for name, goal in (('goal "touch"', "touch"), ('goal "at"', "at")):
        alone = solve(found.solution.problem.changed(goal=goal))
        assert goals[name].amount == alone.amount
        assert goals[name].saving == pytest.approx(found.solution.amount - alone.amount, abs=1e-15)
    assert goals['goal "at"'].saving < 0
    assert "adds" in str(goals['goal "at"'])
    assert goals['goal "clear"'].amount == 0.0


def test_a_goal_without_a_motion_stands_last_with_its_status():
    found = costs("keyway", "C bottom and wall at once")
    last = found.goals[-1]
    assert math.isnan(last.amount)
    assert not last.status.found
    assert last.status.words in str(last)


def test_the_clearance_goes_with_the_goal_that_asks_for_it():
    asked = Problem(CUBE, box((0.5, -9, -9), (4, 9, 9)), target=(1, 1), goal="clear", clearance=0.25, motion=X)
    found = rows(drop(asked))
    assert found['goal "touch"'].solution.problem.clearance == 0.0
    assert found['goal "touch"'].saving == pytest.approx(0.25, abs=1e-9)
    assert found["clearance"].saving == pytest.approx(0.25, abs=1e-9)


def test_limits_cost_what_closed_forms_say_and_the_others_nothing():
    """Out of a block by TX = -1.25 or TY = -1.5; the limit of TX keeps the first from being reached."""
    block = box((-0.25, -0.5, -1), (9, 9, 1))
    asked = Problem(CUBE, block, target=(1, 1), goal="clear", motion=X >> Y, limits={"TX": (-0.25, 3), "TY": (-5, 5)})
    found = drop(asked)
    named = rows(found)
    assert found.solution.amount == pytest.approx(1.5, abs=1e-9)
    assert named["lower limit of TX"].saving == pytest.approx(0.25, abs=1e-9)
    assert named["lower limit of TX"].excess == pytest.approx(1.0, abs=1e-9)
    assert set(found.free) == {"upper limit of TX", "lower limit of TY", "upper limit of TY"}
    assert found.rows[0].name == "lower limit of TX"


def test_a_parameter_that_is_held_costs_by_its_multiplier():
    """A slanted wall x + y <= 1 of the cube's corner: held TX = 0 leaves TY = -1, free (-1/2, -1/2)."""
    wedge = Body.convex(
        [[3, -2, -9], [-2, 3, -9], [9, 9, -9], [3, -2, 9], [-2, 3, 9], [9, 9, 9]], seed="centroid", name="wedge"
    )
    asked = Problem(CUBE, wedge, target=(1, 1), goal="clear", motion=X >> Y, limits={"TX": (0, 0)})
    (held,) = drop(asked).rows
    assert held.name == "TX held"
    assert held.amount == pytest.approx(math.sqrt(0.5), abs=1e-9)
    assert held.saving == pytest.approx(1 - math.sqrt(0.5), abs=1e-9)
    assert held.excess == pytest.approx(0.5, abs=1e-7)
    assert held.rate == pytest.approx(1.0, abs=1e-9)  # the amount is 1 - dx
    assert held.estimate == pytest.approx(0.5, abs=1e-7)
    assert held.estimate >= held.saving  # the amount is convex in the limit


def test_whole_steps_cost_what_rounding_adds():
    asked = Problem(
        CUBE, box((0.5, -1, -1), (4, 1, 1)), target=(1, 1), goal="clear", motion=X, resolution=0.3,
        limits={"TX": (-2, 0)},
    )  # fmt: skip
    found = drop(asked)
    assert found.solution.amount == pytest.approx(0.6)
    assert rows(found)["whole steps"].saving == pytest.approx(0.1, abs=1e-9)
    assert math.isinf(rows(found)["whole steps"].excess)
    assert math.isnan(rows(found)["whole steps"].estimate)


@pytest.mark.slow
def test_savings_are_those_of_solves_without():
    looked_at, costing = 0, 0
    for seed in range(60):
        solution = solve(random_scene(np.random.default_rng(seed), (1, 4), 2))
        if not solution.usable:
            continue
        looked_at += 1
        found = drop(solution)
        assert {row.name for row in found.rows} == {own.name for own in constraints(solution.problem)}
        assert [row.saving for row in found.rows] == sorted((row.saving for row in found.rows), reverse=True)
        for row in found.rows:
            alone = solve(without(solution.problem, [row.name]))
            assert alone.usable
            assert row.saving == pytest.approx(solution.amount - alone.amount, abs=2e-7)
            assert row.amount == pytest.approx(alone.amount, abs=2e-7)
            costing += row.saving > 0
            if row.saving > 0:
                assert row.excess > 0
        if looked_at == 10:
            break
    assert looked_at == 10
    assert costing >= 5


def test_where_nothing_smaller_is_found_dropping_costs_nothing():
    post = KeepOut(box((2, -1, -1), (4, 1, 1), "post"), clearance=0.5)
    found = drop(Problem(CUBE, FAR, target=(1, 1), goal="clear", motion=X, keep_out=[post]))
    assert found.solution.amount == 0.0
    assert set(found.free) == {"keep-out 'post'", "keep-out 'post': clearance"}
    assert "cost nothing: keep-out 'post'" in str(found)


def test_a_solution_is_taken_as_it_is():
    problem = Problem(
        CUBE, box((0.5, -9, -9), (4, 9, 9)), target=(1, 1), goal="clear", motion=X, limits={"TX": (-2, 9)}
    )
    solution = solve(problem)
    one, two = drop(solution), drop(problem)
    assert one.solution is solution
    assert [row.saving for row in one.rows] == [row.saving for row in two.rows]
    assert one.solves == two.solves - 1


def test_a_problem_without_a_motion_is_refused_and_points_to_conflicts():
    stuck: Any = Problem(
        CUBE, box((0.5, -9, -9), (4, 9, 9)), target=(1, 1), goal="clear", motion=X, limits={"TX": (-0.25, 1)}
    )
    for asked in (stuck, solve(stuck)):
        with pytest.raises(InputError, match="conflicts") as caught:
            drop(asked)
        assert caught.value.found == Status.INFEASIBLE.words
    with pytest.raises(InputError, match="Solution"):
        drop("bracket.toml")  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_goal_that_is_met_at_rest_was_said_to_have_no_motion() -> None:
    """A block with a bore on the floor of a chute, with 0.2 of play: clear of walls and floor by that at TZ = 0.2."""
    block = fo.cut(fo.Box((30, 13, 13), centre=(0, 0, 6.5)), fo.Cylinder(2.5, 40, base=(-20, 0, 6.5), axis="x"))
    chute = fo.cut(fo.Box((50, 24, 19), centre=(0, 0, 4.5)), fo.Box((60, 13.4, 20), centre=(0, 0, 10)))
    problem = fo.Problem(block, chute, target=(1, 1), goal="clear", clearance=0.2, motion=Y >> Translation("z"))
    for asked in (problem, solve(problem)):
        found = rows(drop(asked))['goal "touch"']
        assert found.status is Status.ALREADY_SATISFIED
        assert found.saving == pytest.approx(0.2, abs=1e-9)
        changed = fo.whatif(asked, goal="touch")
        assert (changed.after.amount, changed.after.problem.clearance) == (0.0, 0.0)


def test_results_are_plain_data():
    found = costs("bracket", "past the ribs")
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert data["amount"] == found.solution.amount
    assert [row["saving"] for row in data["rows"]] == [row.saving for row in found.rows]
    assert data["goals"][0]["excess"] is None
    assert str(found).startswith("amount 2.5 mm\nwithout keep-out 'ribs': saves 0.5 mm")


def test_the_table_says_what_was_changed_and_what_that_saves(capsys: pytest.CaptureFixture[str]):
    print_costs(costs("bracket", "past the ribs"))
    text = capsys.readouterr().out
    assert ["drop", "keep-out", "'ribs'", "2", "0.5", "0.9", "verified"] in [row.split() for row in text.splitlines()]
    assert "below 0 saved: the motion gets larger" in text
    assert '"predicted"' in text
    print_costs(costs("keyway", "C bottom and wall at once"))  # some other goal has no motion
    text = capsys.readouterr().out
    assert "impossible" in text or "no motion found" in text
    assert "NOT_FOUND" not in text
    assert "INFEASIBLE" not in text
