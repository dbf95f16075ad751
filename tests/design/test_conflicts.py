"""Which constraints clash where there is no motion, and the least relaxation that cures it."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from functools import cache
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ordinary import CUBE, FAR, box, problems, random_scene

import fcdm_opt as fo
from fcdm_opt import pacing
from fcdm_opt.design.whatif import fitting
from fcdm_opt.design.whatif.conflicts import MANY, Conflicts, conflicts
from fcdm_opt.design.whatif.constraints import Constraint, constraints, excesses, without
from fcdm_opt.design.whatif.search import Clash, ClashSearch, LeastRelaxation, Trial
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.size import Size
from fcdm_opt.motion.motions import Rotation, Translation
from fcdm_opt.problem.assembly_file import load_assemblies
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Status
from fcdm_opt.solver import solve

CASES = Path(__file__).parents[1] / "cases"
X, Y, Z = (Translation(axis) for axis in "xyz")


WALL = box((5, -10, -1), (6, 10, 1), "wall")  # touched along x at TX = 4 and TX = 7, beside it for |TY| >= 11
POST = box((2, -1, -1), (4, 1, 1), "post")  # in the way at TX = 4 for |TY| < 2


def touching_wall(**arguments: Any) -> Problem:
    return Problem(CUBE, WALL, **{"target": (1, 1), "goal": "touch", "motion": X >> Y, **arguments})


def at_the_block(**arguments: Any) -> Problem:
    """The gap is 3 - rho_1 - rho_2 + TX."""
    block = box((2, -3, -3), (4, 3, 3), "block")
    return Problem(CUBE, block, nominal=(1.5, 1.5), target=(1.5, 1.6), goal="at", motion=X, **arguments)


def clear(*keep_out: Any, **arguments: Any) -> Problem:
    given = {"target": (1, 1), "goal": "clear", "motion": X, **arguments}
    return Problem(CUBE, FAR, keep_out=keep_out, **given)


def names(problem: Problem) -> list[str]:
    return [own.name for own in constraints(problem)]


def sets(found: Conflicts) -> set[frozenset[str]]:
    return {frozenset(clash.names) for clash in found.clashes}


def relaxations(found: Conflicts) -> dict[str, LeastRelaxation]:
    return {own.name: own for own in found.relaxations}


def assert_least(own: LeastRelaxation, by: float, problem: Problem) -> None:
    """The relaxation is this one: it does, verified, and a little less does not."""
    assert own.cures
    assert own.by == pytest.approx(by, abs=4e-9 * problem.size)
    assert own.failing < own.by
    assert own.by - own.failing <= 2e-8 * problem.size
    assert own.solution is not None
    assert own.solution.usable
    assert excesses(problem, own.solution)[own.name] == pytest.approx(own.by, abs=4e-9 * problem.size)


# -------------------------------------------------------------------------------------------------------- constraints


def rich() -> Problem:
    return clear(
        POST,
        KeepOut(WALL, clearance=0.5),
        motion=X >> Y >> Rotation("z"),
        clearance=0.25,
        limits={"TX": (-1, 2), "TY": (-math.inf, 3), "RZ": (0, 0)},
        resolution=0.125,
    )


def test_every_constraint_of_a_problem_is_listed_by_name():
    assert names(rich()) == [
        "lower limit of TX", "upper limit of TX", "upper limit of TY", "RZ held", "keep-out 'post'", "keep-out 'wall'",
        "keep-out 'wall': clearance", "clearance", "whole steps",
    ]  # fmt: skip
    assert names(touching_wall(pair="clear")) == ["pair 'clear'"]
    assert names(touching_wall(pair="touch")) == []  # the goal says so already
    assert names(at_the_block()) == ["coherence"]
    assert names(at_the_block(path="free")) == []


def test_names_are_those_of_what_is_active_in_a_solution():
    solution = solve(clear(box((-5, -1, -1), (0, 1, 1), "block")))
    assert set(solution.active) <= set(names(solution.problem))
    rounded = solve(clear(box((-5, -1, -1), (0, 1, 1), "block"), resolution=0.3))
    assert set(rounded.active) <= set(names(rounded.problem))


@pytest.mark.parametrize("dropped", names(rich()))
def test_a_dropped_constraint_is_gone_with_those_that_include_it_and_all_others_stay(dropped: str):
    asked = rich()
    includes = {own.name for own in constraints(asked) if own.includes == dropped}
    left = without(asked, [dropped])
    assert names(left) == [name for name in names(asked) if name not in {dropped, *includes}]
    by_name = {own.name: own for own in constraints(asked)}
    assert all(own.value == by_name[own.name].value for own in constraints(left) if not math.isnan(own.value))
    assert names(without(asked, names(asked))) == []


def test_dropping_a_pair_state_drops_the_clearance_that_it_asks_for():
    asked = at_the_block(pair="clear", clearance=0.5)
    assert names(asked) == ["pair 'clear'", "clearance", "coherence"]
    assert names(without(asked, ["pair 'clear'"])) == ["coherence"]
    assert names(without(asked, ["clearance"])) == ["pair 'clear'", "coherence"]


def named(problem: Problem, name: str) -> Constraint:
    (constraint,) = (one for one in constraints(problem) if one.name == name)
    return constraint


def relaxed(problem: Problem, name: str, by: float) -> Problem:
    return named(problem, name).changed(problem, by)


def test_relaxing_widens_limits_reduces_clearances_and_halves_steps():
    asked = rich()
    assert relaxed(asked, "lower limit of TX", 0.5).limits[0].tolist() == [-1.5, 2]
    assert relaxed(asked, "upper limit of TX", 0.5).limits[0].tolist() == [-1, 2.5]
    assert relaxed(asked, "RZ held", 0.5).limits[2].tolist() == [-0.5, 0.5]
    assert relaxed(asked, "clearance", 0.125).clearance == 0.125
    assert relaxed(asked, "keep-out 'wall': clearance", 0.5).keep_out[1].clearance == 0.0
    assert relaxed(asked, "whole steps", 2).resolution.tolist() == [0.125 / 4] * 3
    assert all(relaxed(asked, "whole steps", 0).resolution == asked.resolution)


def test_a_constraint_that_is_none_is_refused():
    with pytest.raises(InputError, match=r"no such constraint.*lower limit of TX"):
        without(rich(), ["limit of TX"])


def test_excesses_say_how_far_a_motion_passes_each_constraint():
    asked = rich()
    free = without(asked, [name for name in names(asked) if name != "whole steps"])
    found = excesses(asked, solve(free))  # at rest: 1 from the post, 4 from the wall
    assert set(found) == set(names(asked))
    assert set(found.values()) == {0.0}
    tight = clear(box((-3, -1, -1), (0.25, 1, 1), "A"), KeepOut(POST, clearance=1.25), limits={"TX": (0.5, 0.75)})
    at_rest = solve(without(tight, names(tight)))
    assert excesses(tight, at_rest) == pytest.approx(
        {"lower limit of TX": 0.5, "upper limit of TX": 0, "keep-out 'A'": 1.25, "keep-out 'post'": 0,
         "keep-out 'post': clearance": 0.25}, abs=1e-9,
    )  # fmt: skip


# ---------------------------------------------------------------------------------------------------------- by hand


def test_one_limit_alone_can_clash_with_the_goal():
    asked = touching_wall(motion=X, limits={"TX": (-1, 3)})
    found = conflicts(asked)
    assert sets(found) == {frozenset({"upper limit of TX"})}
    assert found.clashes[0].proved
    assert found.complete
    own = relaxations(found)["upper limit of TX"]
    assert_least(own, 1.0, asked)
    assert own.value == pytest.approx(4.0, abs=1e-9)
    assert own.amount == pytest.approx(4.0, abs=1e-9)
    assert own.impossible == own.failing  # of one translation: proved
    assert found.deviation is None
    assert found.trials == ()


def test_whoever_listened_heard_for_minutes_of_one_search_like_another():
    heard = list[str]()
    with pacing.listening(lambda text, done, total: heard.append(text)):
        found = conflicts(touching_wall(motion=X, limits={"TX": (-1, 3)}))
    known = [int(text.split()[3]) for text in heard if text.startswith("asking what clashes, ")]
    assert known == sorted(known)
    assert {0, found.solves - 1} <= {*known} <= {*range(found.solves)}


def test_four_constraints_clash_only_all_together():
    asked = touching_wall(limits={"TX": (0, 6), "TY": (-1, 1.5)}, keep_out=[POST])
    found = conflicts(asked)
    clash = {"upper limit of TX", "lower limit of TY", "upper limit of TY", "keep-out 'post'"}
    assert sets(found) == {frozenset(clash)}
    assert found.clashes[0].proved
    least = relaxations(found)
    assert_least(least["upper limit of TX"], 1.0, asked)  # the wall's other side, TX = 7
    assert_least(least["lower limit of TY"], 1.0, asked)  # past the post, TY = -2
    assert_least(least["upper limit of TY"], 0.5, asked)
    assert least["upper limit of TY"].amount == pytest.approx(math.hypot(4, 2), abs=1e-6)
    assert math.isinf(least["keep-out 'post'"].by)
    assert least["keep-out 'post'"].amount == pytest.approx(4.0, abs=1e-9)
    assert found.solves <= 40


def test_what_clashes_took_as_long_as_it_took():
    """With a time it ends then, with what is known: at first that all constraints clash, proved as the answer is."""
    asked = touching_wall(limits={"TX": (0, 6), "TY": (-1, 1.5)}, keep_out=[POST])
    whole = solve(asked)
    with pacing.looking(2):
        found = conflicts(whole, time=60.0)
    assert sets(found) == {frozenset(names(asked))}
    assert found.clashes[0].proved
    assert (found.complete, found.relaxations, found.deviation, found.trials) == (False, (), None, ())
    assert found.stopped in str(found)
    assert found.to_dict()["stopped"].startswith("the time limit of 60 s was met")
    assert conflicts(whole, time=60.0).stopped == ""
    with pytest.raises(InputError, match="not a time"):
        conflicts(whole, time=0.0)


def test_two_keep_outs_and_two_limits_leave_no_room():
    left, right = box((-9, -1, -1), (-0.5, 1, 1), "L"), box((1.2, -1, -1), (9, 1, 1), "R")
    asked = clear(left, right, limits={"TX": (-5, 5)})
    found = conflicts(asked)
    assert sets(found) == {frozenset(names(asked))}
    least = relaxations(found)
    assert_least(least["lower limit of TX"], 5.0, asked)
    assert_least(least["upper limit of TX"], 5.0, asked)
    assert least["keep-out 'L'"].amount == 0.0
    assert least["keep-out 'R'"].amount == pytest.approx(0.5, abs=1e-9)


def test_a_relaxation_that_cures_nothing_alone_is_told_so():
    a, b = box((-9, -1, -1), (0.5, 1, 1), "A"), box((-9, -1, -1), (1, 1, 1), "B")
    asked = clear(a, b, limits={"TX": (1, 1)})
    found = conflicts(asked)
    assert sets(found) == {frozenset({"TX held", "keep-out 'A'"}), frozenset({"TX held", "keep-out 'B'"})}
    least = relaxations(found)
    assert_least(least["TX held"], 1.0, asked)
    for name in ("keep-out 'A'", "keep-out 'B'"):
        assert not least[name].cures
        assert math.isnan(least[name].by)
        assert math.isinf(least[name].impossible)
        assert "cures nothing alone" in str(least[name])


def test_a_keep_out_that_clashes_whatever_its_clearance_is_named_where_motions_leave_the_fit() -> None:
    """A blade in its pocket needs TX >= -.1, a rib TX <= -.25; one through the pocket counted as kept."""
    blade = fo.Box((8, 6, 30), centre=(0.5, -0.3, 10), name="blade")
    block = fo.Box((30, 30, 15), centre=(0, 0, 7.5))
    pocket = fo.cut(block, fo.Box((8.3, 6.2, 20), centre=(0, 0, 7.5)), name="pocket")
    rib = KeepOut(fo.Box((4, 10, 4), centre=(5.8, 0, 20), name="rib"), clearance=0.05)
    more = {"goal": "clear", "clearance": 0.05, "motion": X >> Y, "target": (1, 1)}
    found = conflicts(Problem(blade, pocket, keep_out=[rib], **more))
    assert found.complete
    assert sets(found) == {frozenset({"keep-out 'rib'"})}
    assert math.isinf(relaxations(found)["keep-out 'rib'"].by)
    assert relaxations(found)["keep-out 'rib'"].amount == pytest.approx(math.hypot(0.4, 0.25), rel=1e-9)
    near = KeepOut(fo.Box((4, 10, 4), centre=(5.93, 0, 20), name="rib"), clearance=0.05)
    found = conflicts(Problem(blade, pocket, keep_out=[near], **more))  # TX <= -.62: either clearance by .02 less
    assert sets(found) == {frozenset({"keep-out 'rib': clearance", "clearance"})}
    assert [own.by for own in found.relaxations] == pytest.approx([0.02, 0.02], abs=1e-6)


def test_a_keep_out_is_offered_where_its_clearance_cures_nothing() -> None:
    """A fin at a plate: |TX| >= .12, with its clearance .16; within limits .15, and with clearance in its slot .1."""
    part = Body.from_parts([CUBE.vertices, [*product((-0.05, 0.05), (-1, 1), (1, 2))]])
    slot = Body.from_parts([[*product(own, (-1, 1), (-1, 1))] for own in ((-3, -1.2), (1.2, 3))])
    plate = KeepOut(box((-0.07, -1, 1.5), (0.07, 1, 3), "A"), clearance=0.04)
    more = {"goal": "clear", "clearance": 0.1, "target": (1, 1), "motion": X, "limits": {"TX": (-0.15, 0.15)}}
    found = conflicts(Problem(part, slot, keep_out=[plate], **more))
    assert sets(found) == {frozenset({"keep-out 'A': clearance", "lower limit of TX", "upper limit of TX"})}
    least = relaxations(found)
    assert least["keep-out 'A'"].cures
    assert least["keep-out 'A'"].amount == 0.0
    assert not least["keep-out 'A': clearance"].cures
    assert "(at 0: impossible)" in str(least["keep-out 'A': clearance"])


def test_a_limit_that_rest_is_beyond_is_relaxed_by_halving():
    a = box((-0.75, -1, -1), (9, 1, 1), "A")  # free for TX <= -1.75
    asked = clear(a, limits={"TX": (-1, -0.5)})
    found = conflicts(asked, deviation=False)
    assert sets(found) == {frozenset({"lower limit of TX", "upper limit of TX", "keep-out 'A'"})}
    least = relaxations(found)
    assert_least(least["lower limit of TX"], 0.75, asked)
    assert_least(least["upper limit of TX"], 10.5, asked)  # from -0.5 on, so rest itself is beyond: 9 + 1


def test_a_clearance_is_named_where_the_keep_out_itself_leaves_room():
    a, b = box((-9, -1, -1), (-1.1, 1, 1), "A"), box((1.3, -1, -1), (9, 1, 1), "B")  # room of 0.4 in all
    asked = clear(KeepOut(a, clearance=0.5), b, limits={"TX": (-3, 3)})
    found = conflicts(asked, relax=False)
    clash = {"lower limit of TX", "upper limit of TX", "keep-out 'A': clearance", "keep-out 'B'"}
    assert sets(found) == {frozenset(clash)}
    assert found.relaxations == ()
    assert solve(relaxed(asked, "keep-out 'A': clearance", 0.1)).usable
    assert solve(relaxed(asked, "keep-out 'A': clearance", 0.1 - 1e-5)).status is Status.INFEASIBLE


def test_where_answers_near_the_least_relaxation_tell_nothing_few_are_asked_for(monkeypatch: pytest.MonkeyPatch):
    a, b = box((-9, -1, -1), (-1.1, 1, 1), "A"), box((1.3, -1, -1), (9, 1, 1), "B")  # as above
    asked = clear(KeepOut(a, clearance=0.57), b, limits={"TX": (-3, 3)})
    unsure = []

    def solved(problem: Problem, **arguments: Any) -> Any:
        solution = solve(problem, **arguments)
        if solution.status is Status.INFEASIBLE and problem.keep_out and problem.keep_out[0].clearance < 0.401:
            unsure.append(problem)
            return replace(solution, status=Status.NOT_FOUND)
        return solution

    monkeypatch.setattr("fcdm_opt.design.whatif.search.solve", solved)
    search = ClashSearch(asked)
    own = next(own for own in search.constraints if own.name == "keep-out 'A': clearance")
    search.answer(search.names)
    least = search.least_relaxation(own)
    assert 2 <= len(unsure) <= 5
    assert least.failing < 0.17 <= least.by * (1 + 1e-8)
    assert 1e-7 < least.by - least.failing < 1e-3
    assert least.note == f"whether less does, down to {least.failing:.3g}, is not known"


def test_the_least_reduction_of_the_target_pairs_clearance():
    post = box((2, -1, -1), (4, 1, 1))
    asked = Problem(
        CUBE, post, target=(1, 1), goal="clear", clearance=2, motion=X, limits={"TX": (-0.25, 6)}
    )  # gaps 1 - TX and TX - 5
    found = conflicts(asked)
    assert sets(found) == {frozenset(names(asked))}
    least = relaxations(found)
    assert_least(least["lower limit of TX"], 0.75, asked)
    assert_least(least["upper limit of TX"], 1.0, asked)
    assert_least(least["clearance"], 0.75, asked)
    assert least["clearance"].value == pytest.approx(1.25, abs=1e-8)


def test_a_pair_state_can_only_be_dropped():
    asked = Problem(CUBE, POST, target=(1, 1), goal="clear", pair="touch", motion=X, limits={"TX": (-0.25, 0.5)})
    found = conflicts(asked)
    assert sets(found) == {frozenset({"upper limit of TX", "pair 'touch'"})}
    assert_least(relaxations(found)["upper limit of TX"], 0.5, asked)
    assert math.isinf(relaxations(found)["pair 'touch'"].by)


def test_whole_steps_are_halved_until_one_falls_into_the_room():
    left, right = box((-9, -1, -1), (-0.69, 1, 1), "L"), box((1.36, -1, -1), (9, 1, 1), "R")
    asked = clear(left, right, limits={"TX": (-5, 5)}, resolution=0.25)  # 0.31 <= TX <= 0.36: 5 steps of 1 / 16
    found = conflicts(asked)
    assert sets(found) == {frozenset({"keep-out 'L'", "keep-out 'R'", "whole steps"})}
    assert not found.clashes[0].proved
    steps = relaxations(found)["whole steps"]
    assert (steps.by, steps.failing) == (2.0, 1.0)
    assert steps.solution is not None
    assert steps.solution.parameters["TX"] == 0.3125


def test_where_the_motion_alone_cannot_do_it_other_motions_and_goals_are_tried():
    above = box((-1, 5, -1), (1, 6, 1))
    found = conflicts(Problem(CUBE, above, target=(1, 1), goal="touch", motion=X, limits={"TX": (-5, 5)}))
    assert sets(found) == {frozenset()}
    assert found.clashes[0].proved
    assert found.relaxations == ()
    tried = {trial.change: trial.solution.usable for trial in found.trials}
    assert tried == {"motion free = true": True, 'goal "clear"': True}
    assert "the motion alone cannot" in str(found)


def test_a_turn_is_relaxed_in_radians_and_told_in_degrees():
    """An edge of a square of half-width 1, turned by t, reaches cos t + sin t; the wall stands at 1.3."""
    wall = box((1.3, -10, -1), (6, 10, 1))
    asked = Problem(CUBE, wall, target=(1, 1), goal="touch", motion=Rotation("z"), limits={"RZ": (-0.1, 0.2)})
    t = math.asin(1.3 / math.sqrt(2)) - math.pi / 4
    found = conflicts(asked)
    assert sets(found) == {frozenset({"lower limit of RZ", "upper limit of RZ"})}
    least = relaxations(found)
    assert least["upper limit of RZ"].by == pytest.approx(t - 0.2, abs=1e-8)
    assert least["lower limit of RZ"].by == pytest.approx(t - 0.1, abs=1e-8)
    assert least["upper limit of RZ"].unit == "radian"
    assert f"to {math.degrees(t):.6g}" in str(least["upper limit of RZ"])


# ------------------------------------------------------------------------------------------------------ problem files


@cache
def tight(case: int) -> Conflicts:
    return conflicts(list(problems("peg_square_tight").values())[case])


def test_the_peg_that_is_too_large_needs_all_four_limits_to_be_stuck():
    found = tight(0)
    assert sets(found) == {frozenset(names(found.problem))}
    assert found.clashes[0].proved
    for own in found.relaxations:  # beside the plate: 20 half widths of it, 9.75 * 1.03 of the peg, 0.25 and -0.125 off
        assert own.impossible == own.failing
    reach = {own.name: own.by for own in found.relaxations}
    corners = found.problem.static.vertices
    half = 9.75 * 1.03
    assert reach["upper limit of TX"] == pytest.approx(corners[:, 0].max() + half - 0.25 - 2, abs=1e-7)
    assert reach["lower limit of TX"] == pytest.approx(-corners[:, 0].min() + half + 0.25 - 2, abs=1e-7)
    assert reach["upper limit of TY"] == pytest.approx(corners[:, 1].max() + half + 0.125 - 2, abs=1e-7)
    assert reach["lower limit of TY"] == pytest.approx(-corners[:, 1].min() + half - 0.125 - 2, abs=1e-7)
    assert found.deviation is not None
    share = (10 / 9.75 - 1) / 0.03  # up to which the peg goes in
    assert found.deviation.value == pytest.approx(share, abs=2e-6)
    assert found.solves <= 60


def test_a_motion_out_of_its_slot_was_offered_as_a_cure():
    """A cube with .01 of play on either side, its right one .05 further out: up to .02, two fifths of it, fits."""
    slot = Body.from_parts([[*product((-3, -1.01), (-1, 1), (-1, 1))], [*product((1.01, 3), (-1, 1), (-1, 1))]])
    right = Size("right", "movable", faces="+x", tolerance=0.05)
    asked = Problem(
        CUBE, slot, sizes=[right], made={"right": 0.05}, goal="clear", motion=X, limits={"TX": (-0.02, 0.02)}
    )
    found = conflicts(asked)
    assert [clash.names for clash in found.clashes] == [("lower limit of TX", "upper limit of TX")]
    assert [own.cures for own in found.relaxations] == [False, False]
    assert [own.by for own in found.relaxations] == pytest.approx([4.05 - 0.02, 4.0 - 0.02], abs=1e-6)
    assert found.deviation is not None
    assert found.deviation.value == pytest.approx(0.4, abs=2e-6)
    *_, told, lower, upper = str(found).splitlines()
    assert told.startswith("with 40 % of the deviation from nominal (right +0.02) a motion is found")
    assert all("cures nothing alone (any motion found then leaves the place" in own for own in (lower, upper))


def test_contacts_that_exclude_each_other_were_blamed_one_by_one() -> None:
    """A block in a slot, .06 wider: its sides meet the walls at TX .03 and -.03, and alone neither is closed clear."""
    slot = fo.cut(fo.Box((30, 30, 10), name="slot"), fo.Box((10, 40, 6), centre=(0, 0, 2)))
    block = fo.Box((10, 20, 10), centre=(0, 0, 4), name="block")
    wide = fo.Size("wide", "movable", faces=["+x", "-x"], each=0.5)
    given = {"sizes": [wide], "made": {"wide": 0.06}, "motion": X >> Z, "unit": "mm"}
    asked = Problem(block, slot, goal="seat", contacts="all", **given)
    (told,) = (line for line in solve(asked).active if "exclude each other" in line)
    numbers = [int(k) for k in re.findall(r"[0-9]+", told.partition(" exclude")[0])]
    (clash,) = conflicts(asked, deviation=False).clashes
    assert [int(name.split()[1].rstrip(",")) for name in clash.names] == numbers
    assert len(numbers) == 2


def test_a_share_of_a_deviation_that_only_the_judge_lets_pass_was_told() -> None:
    """A block on two steps, one of them .02 higher: by shifts both are touched at no share of it; 4e-6 was told."""
    lid = fo.Box((20, 10, 2), centre=(0, 0, 2), name="lid")
    parts = {"lid": lid, "left": fo.Box((9, 10, 2), centre=(-5, 0, 0)), "right": fo.Box((9, 10, 2), centre=(5, 0, 0))}
    high = fo.Size("high", "right", faces="+z", tolerance=0.1)
    contacts = [{"parts": ["lid", "left"]}, {"parts": ["lid", "right"]}]
    asked = fo.Assembly(parts, contacts, motions={"lid": Z}, sizes=[high], made={"high": 0.02}, unit="mm")
    found = conflicts(asked)
    assert found.deviation is not None
    assert found.deviation.value == 0.0
    assert "no share, however small, of the deviation" in str(found)


@pytest.mark.parametrize(("depth", "told"), [(4.0, "TZ 4 mm, nearly out of its place"), (1.0, "TZ 1 mm")])
def test_a_motion_that_lifts_a_part_nearly_out_was_proposed_without_a_word(depth: float, told: str) -> None:
    """A block 6 high that is to clear a slab which is so much higher than its bottom."""
    slab, block = fo.Box((40, 40, 10), centre=(0, 0, depth - 5)), fo.Box((10, 10, 6), centre=(0, 0, 3))
    asked = Problem(block, slab, target=(1, 1), goal="clear", motion=Z, unit="mm")
    assert str(Trial(change="motion", solution=solve(asked))) == f"motion: amount {depth:g} mm ({told})"


def test_small_shares_of_a_deviation_that_fit_were_said_not_to():
    """A cube in a slot 1 % wider than it, made up to 50 % larger: 2 % of that fit; of one as wide, none."""
    for play, share in ((0.01, 0.02), (0.0, 0.0), (-0.1, math.nan)):
        left, right = box((-9, -2, -2), (-1 - play, 2, 2), "L"), box((1 + play, -2, -2), (9, 2, 2), "R")
        limits = {"TX": (-1, 1)}
        asked = Problem(
            CUBE, left, nominal="drawn", target=(1.5, 1), goal="clear", keep_out=[right], motion=X, limits=limits
        )
        found = conflicts(asked, relax=False)
        assert found.deviation is not None
        assert found.deviation.value == pytest.approx(share, rel=2e-6, abs=1e-7, nan_ok=True)
        told = f"with {100 * found.deviation.value:.6g} %" if share > 0.0 else "with no share, however small,"
        assert f"{told} of the deviation from nominal a motion" in str(found)
        assert ("nor without any deviation" in str(found)) == math.isnan(share)


def test_the_bracket_that_is_too_wide_clashes_with_the_clearance_not_with_the_ribs():
    """The foot of 31.8 leaves (32 - 31.8) / 2 = 0.1 on both sides of the ribs, asked for are 0.5."""
    asked = next(iter(problems("bracket_stuck").values()))
    # up is free, and below the plate the bracket touches too, from TZ = -39.32 on
    sought = {"lower limit of TX", "upper limit of TX", "lower limit of TZ", "keep-out 'ribs': clearance"}
    search = ClashSearch(asked)
    (clash,), complete = search.smallest(search.solved(asked))
    assert set(clash.names) == sought
    assert clash.proved
    assert complete
    assert search.solves <= 20
    assert_least(search.least_relaxation(named(asked, "keep-out 'ribs': clearance")), 0.4, asked)


# --------------------------------------------------------------------------------------------------------- brute force


def closed_sets(problem: Problem) -> dict[frozenset[str], tuple[str, ...]]:
    """All closed sets of constraints, each with the ones that no other in it includes."""
    own = constraints(problem)
    found = {}
    for size in range(len(own) + 1):
        for chosen in combinations(own, size):
            kept = frozenset(one.name for one in chosen)
            if all(not one.includes or one.includes in kept for one in chosen):
                included = {one.includes for one in chosen}
                found[kept] = tuple(one.name for one in chosen if one.name not in included)
    return found


def smallest_by_brute_force(problem: Problem) -> set[frozenset[str]]:
    """The smallest clashes from a solve of every subset."""
    every = closed_sets(problem)
    feasible = {kept: solve(without(problem, set(names(problem)) - kept)).usable for kept in every}
    minimal = [
        kept for kept, does in feasible.items() if not does and all(feasible[less] for less in every if less < kept)
    ]
    fewest = min(len(every[kept]) for kept in minimal)
    return {frozenset(every[kept]) for kept in minimal if len(every[kept]) == fewest}


@pytest.mark.slow
def test_smallest_clashes_are_those_of_all_subsets():
    looked_at = 0
    sizes = set()
    for seed in range(40):
        asked = random_scene(np.random.default_rng(seed), (0, 2))
        if solve(asked).usable:
            continue
        looked_at += 1
        found = conflicts(asked, deviation=False)
        assert found.complete
        assert sets(found) == smallest_by_brute_force(asked)
        sizes |= {len(clash.names) for clash in found.clashes}
        assert found.solves <= 80
        for own in found.relaxations:
            assert own.cures == solve(without(asked, [own.name])).usable
            if own.cures and math.isfinite(own.by):
                assert solve(relaxed(asked, own.name, own.by)).usable
                assert not solve(relaxed(asked, own.name, own.by * (1 - 1e-6))).usable
        if looked_at == 3:
            break
    assert looked_at == 3
    assert len(sizes) >= 2


def test_smallest_clashes_with_clearances_are_those_of_all_subsets():
    asked = Problem(
        CUBE, box((2, -1, -1), (4, 1, 1)), target=(1, 1), goal="clear", clearance=0.5, motion=X,
        keep_out=[KeepOut(box((-9, -1, -1), (-1.2, 1, 1), "L"), clearance=1.0)],
        limits={"TX": (-5, 3)},
    )  # fmt: skip
    # TX - -0.2 >= 1 and 1 - TX >= 0.5 exclude each other; further left than L is -10.2
    found = conflicts(asked, relax=False)
    assert sets(found) == smallest_by_brute_force(asked)
    for name in ("keep-out 'L': clearance", "clearance"):
        assert solve(relaxed(asked, name, 0.3)).usable
        assert solve(relaxed(asked, name, 0.3 - 1e-5)).status is Status.INFEASIBLE


# ---------------------------------------------------------------------------------------------------------- interface


def test_a_problem_with_a_motion_is_refused_and_points_to_drop():
    with pytest.raises(InputError, match="drop"):
        conflicts(touching_wall())
    with pytest.raises(InputError, match="Problem"):
        conflicts("bracket.toml")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="certify: not a truth value"):
        conflicts(touching_wall(), certify=np.ones(2))  # type: ignore[arg-type]


def test_a_solution_without_a_motion_stands_for_its_problem():
    solution = solve(touching_wall(motion=X, limits={"TX": (-1, 3)}))
    one, two = conflicts(solution), conflicts(solution.problem)
    assert sets(one) == sets(two)
    assert one.solves == two.solves - 1


def test_relaxations_had_lengths_without_their_unit():
    found = conflicts(touching_wall(motion=X, limits={"TX": (-1, 3)}, unit="mm"))
    assert "to relax alone: upper limit of TX: by 1 mm to 4 mm, amount 4 mm" in str(found)


def test_results_are_plain_data():
    found = tight(0)
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert data["clashes"][0]["names"] == list(found.clashes[0].names)
    assert data["relaxations"][0]["by"] == found.relaxations[0].by
    assert data["constraints"] == names(found.problem)
    assert "no motion keeps " in str(found)
    assert named(found.problem, "upper limit of TX").value == 2.0


def test_parts_that_do_not_fit_were_said_to_clash_with_nothing():
    """Three teeth, .005 too wide together: `solve` says that they do not fit, and no constraint is in the way."""
    comb, slots = (Body.from_file(CASES / f"{name}.off", unit="mm") for name in ("comb", "comb_slots"))
    asked = Problem(comb, slots, target=(1, 1), goal="clear", motion=Translation("z"))
    assert solve(asked).status is Status.OUTSIDE_FIT
    found = conflicts(asked)
    assert [(clash.names, clash.status) for clash in found.clashes] == [((), Status.OUTSIDE_FIT)]


STAIRS = Body.from_parts(
    [[*product((-2, 0), (-1, 1), (-1, 0))], [*product((0, 2), (-1, 1), (-1, 1))]], seed=(0, 0, -1), name="stairs"
)
BLOCK = Body.from_parts(
    [[*product((-2, 2), (-1, 1), (1, 2))], [*product((-2, 0), (-1, 1), (0, 1))]], seed=(0, 0, 2), name="block"
)


def test_contacts_that_clash_were_named_without_the_steps_and_sizes_that_do_not_go_together():
    """A block with a step 1 deep on stairs 1 high, as made 1.02 and .98; then with a tread higher by .05."""
    asked = {"nominal": "drawn", "goal": "seat", "contacts": "all", "motion": Z}
    found = conflicts(Problem(BLOCK, STAIRS, tolerance=0.02, requirement="B", **asked), relax=False, deviation=False)
    assert str(found).startswith("do not go together: 1.02 of block between its ")
    assert "0.98 of stairs between its " in str(found)
    sizes = [
        Size("tread", "static", faces={"through": (1, 0, 1)}, tolerance=0.1),
        Size("thick", "movable", faces="+z", tolerance=0.1),  # the top of the block, which meets nothing
    ]
    made = {"tread": 0.05, "thick": 0.02}
    found = conflicts(Problem(BLOCK, STAIRS, sizes=sizes, made=made, **asked), relax=False, deviation=False)
    assert [clash.sizes for clash in found.clashes] == [("tread",)]
    assert ", at the sizes made (proved); with tread as drawn one keeps these" in str(found)
    assert found.to_dict()["clashes"][0]["sizes"] == ["tread"]


def test_a_clash_of_an_assembly_was_told_of_sizes_that_do_not_make_it_alone():
    """A stack of 4 with .2 above it, .1 high, below a cap .15 low: each alone leaves room, and parts overlap by .05."""
    boxes = {"base": ((20, 20, 2), -1), "block": ((10, 10, 4), 2), "cap": ((10, 10, 2), 5.2)}
    parts = [fo.Box(edges, centre=(0, 0, z), name=name) for name, (edges, z) in boxes.items()]
    tall, low = (fo.Size(name, part, faces=[face], tolerance=0.5) for name, part, face in
                 (("tall", "block", "+z"), ("low", "cap", "-z")))  # fmt: skip
    asked = {"motions": {"block": Z}, "sizes": [tall, low], "made": {"tall": 0.1, "low": 0.15}}
    pairs = [("block", "base"), {"parts": ("block", "cap"), "goal": "clear", "clearance": 0.02}]
    found = str(conflicts(fo.Assembly(parts, pairs, **asked), deviation=False))
    words = "no motion keeps contact block - base without parts that overlap, at the sizes made of tall, low (proved)"
    assert words in found


@pytest.mark.parametrize("pair", [("block", "cap"), ("cap", "block")])
def test_a_clearance_that_fixed_heights_leave_is_found_from_the_first_motion(pair, monkeypatch):
    """A block of 4 that stays on its base, below a cap at 4.002: a gap of .002 and no other, where .02 is asked for."""
    boxes = {"base": ((20, 20, 2), -1), "block": ((10, 10, 4), 2), "cap": ((10, 10, 2), 5.002)}
    parts = [fo.Box(edges, centre=(0, 0, z), name=name) for name, (edges, z) in boxes.items()]
    pairs = [("block", "base"), {"parts": pair, "goal": "clear", "clearance": 0.02}]
    scene, asked = fo.Assembly(parts, pairs, motions={"block": Z}), list[Any]()
    monkeypatch.setattr(fitting, "solve", lambda *own, **more: asked.append(own) or solve(*own, **more))
    kept = fitting.largest_clearance(scene, f"contact {pair[0]} - {pair[1]}")
    assert kept.clearance == pytest.approx(0.002, rel=1e-6)
    assert kept.is_largest
    assert len(asked) <= 4  # halving takes some fifteen
    found = conflicts(scene, deviation=False)
    assert [own.by for own in found.relaxations if own.unit] == [pytest.approx(0.018, rel=1e-4)]


def test_pairs_that_clash_are_told_with_both_of_them_and_cures_apart_from_what_cures_nothing():
    names = [("upper limit of TX", f"contact {k}, face on face") for k in "ABC"]
    clashes = [Clash(names=own, proved=True, status=Status.INFEASIBLE) for own in names]
    relaxed = [LeastRelaxation(name="upper limit of TX", cures=True, by=0.08, value=0.28, unit="length")]
    relaxed += [LeastRelaxation(name=own, cures=False) for _, own in names]
    problem = Problem(box((0, 0, 0), (1, 1, 1), "a"), box((2, 0, 0), (3, 1, 1), "b"), target=(1, 1), motion=X)
    told = Conflicts(problem=problem, constraints=(), clashes=tuple(clashes), complete=True,
                     relaxations=tuple(relaxed), solves=0, seconds=0.0)  # fmt: skip
    first, *others = str(told).splitlines()
    pairs = ", nor ".join(f"upper limit of TX and contact {k}{' together' * (k == 'A')}" for k in "ABC")
    assert first == f"no motion keeps {pairs} (proved)"
    assert others[-1] == "to relax alone: none of 3 other constraints cures it"


def test_a_relaxation_went_through_a_bar_without_a_word():
    bar = KeepOut(box((2.5, -3, -3), (3, 3, 3), "bar"))
    it, stop = box((-1, -1, -1), (1, 1, 1), "it"), box((5.5, -1, -1), (7.5, 1, 1), "stop")
    asked = {"target": (1.0, 1.0), "goal": "touch", "motion": X, "limits": {"TX": (0, 1)}}
    (found,) = conflicts(Problem(it, stop, **asked, keep_out=[bar]), deviation=False).relaxations
    assert found.by == pytest.approx(3.5)
    assert found.note == "straight there it goes through bar"
    (found,) = conflicts(Problem(it, stop, **asked), deviation=False).relaxations
    assert found.note == ""


@pytest.mark.slow
def test_sets_that_leave_out_what_all_clashes_share_were_asked_one_by_one() -> None:
    """Of an assembly: 261 questions, 11 s. Each clash is one, and no set less is: all of them are asked here."""
    assembly = load_assemblies(CASES.parents[1] / "problems/assemblies/loop_of_four.toml")[0]
    for name, low in {"left wedge.TX": 0.0, "right wedge.TX": -0.005, "key.TX": 0.0}.items():
        assembly = assembly.with_limits(name, (low, 0.005))
    found = conflicts(assembly, relax=False, deviation=False)
    assert found.solves <= 40
    assert len(found.clashes) == 2
    every = {one.name for one in found.constraints}
    for clash in found.clashes:
        kept = {*clash.names} | {one.includes for one in found.constraints if one.name in clash.names}
        assert clash.proved
        for name in clash.names:
            assert solve(without(assembly, every - kept | {name}), effort="quick").verified


def test_what_lacks_was_told_of_keep_outs_met_first_however_far_that_led():
    """A cube between a wall that it touches and a ramp of 2 degrees that it is .03 too deep in: TX = -.03 / sin 2."""
    angle, short = math.radians(2.0), 0.03
    corners = np.array([(x, y, z) for x in (0, 40) for y in (-20, 20) for z in (0, 20)]) - (20.0, 0.0, 0.0)
    turn = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    ramp = corners @ turn.T  # its underside has the normal -(sin, 0, cos)
    normal, top = -turn[:, 2], np.array(CUBE.vertices)
    deepest = float((top @ -normal).max())
    ramp += (deepest - short) * -normal
    wall, kept = box((-4, -2, -2), (-1, 2, 2), "wall"), KeepOut(Body.convex(ramp, name="ramp"), name="ramp")
    asked = Problem(CUBE, wall, target=(1, 1), goal="clear", motion=X, limits={"TX": (-2, 2)}, keep_out=[kept])
    found = conflicts(asked, deviation=False)
    assert "overlap by 0.03" in found.reason
    assert str(found).startswith(found.reason)
    assert 0.03 / math.sin(angle) == pytest.approx(0.86, abs=1e-3)  # which was said to lack
    assert "0.86" not in found.reason
    assert "keep-out 'ramp': drop it, amount 0 (missed by 0.03 then)" in str(found)


def test_the_least_relaxation_is_told_first_and_what_lacks_is_that():
    """Ribs 32 apart leave a foot of 31.8 a clearance of .1 on both sides, where .5 is required."""
    (asked,) = problems("bracket_stuck").values()
    found = conflicts(asked, deviation=False)
    assert found.reason.count("are 0.1 mm apart, a clearance of 0.5 mm is required") == 2
    first = str(found).partition("to relax alone: ")[2].splitlines()[0]
    assert first.startswith("keep-out 'ribs': clearance: by 0.4 mm to 0.1 mm")


def test_other_goals_were_refused_where_features_were_named():
    """Goals "touch" and "clear" track none."""
    asked = problems("keyway")["A bottom and wall at once"].alternatives[0]
    assert {trial.change for trial in ClashSearch(asked).trials()} >= {'goal "touch"', 'goal "clear"'}


@pytest.mark.slow
def test_what_is_alike_of_many_contacts_is_said_once_and_the_size_as_drawn_that_cures_it() -> None:
    """A comb of five teeth in its slots, the last tooth off: eight flanks were told one by one, and no size."""
    spine = fo.Box((50.0, 10.0, 4.0), centre=(0.0, 0.0, 8.0))
    places = np.linspace(-20.0, 20.0, 5)
    comb = fo.joined(spine, *(fo.Box((4.0, 10.0, 6.0), centre=(x, 0.0, 3.0)) for x in places), name="comb")
    plate = fo.Box((60.0, 10.0, 10.0), centre=(0.0, 0.0, 0.0))
    slots = [fo.Box((4.0, 20.0, 6.0), centre=(x, 0.0, 3.0)) for x in places]
    plate = fo.cut(plate, *slots, name="plate")
    size = fo.Size("last", "movable", faces=[{"through": (18.0, 0.0, 3.0)}, {"through": (22.0, 0.0, 3.0)}], along="x")
    problem = fo.Problem(comb, plate, goal="seat", contacts="all", sizes=[size], made={"last": 0.05},
                         motion=Translation("x") >> Translation("z"), unit="mm")  # fmt: skip
    assert fitting.mending_sizes(problem) == {"last": 0.0}
    found = fo.conflicts(problem, deviation=False)
    lines = str(found).splitlines()
    assert len(found.clashes) >= MANY
    assert len(lines) < 2 + len(found.clashes)
    assert f"to relax alone: none of {len(found.relaxations)} constraints cures it (without it: impossible)" in lines


def test_a_relaxation_that_ends_a_rounding_short_is_told_as_what_it_is() -> None:
    found = LeastRelaxation(name="clearance", cures=True, by=0.0999999, value=0.1, unit="length")
    assert str(found).startswith("clearance: by 0.1 to 0.1")
