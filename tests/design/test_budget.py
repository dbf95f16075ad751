"""Budgets: against closed forms with windows, jumps and nested questions, and against brute force."""

from __future__ import annotations

import itertools
import json
import re
from functools import cache
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ordinary import box, problems

import fcdm_opt as fo
from fcdm_opt import pacing
from fcdm_opt.design.stack.stack_up import stack_up
from fcdm_opt.design.whatif import budget as budget_module
from fcdm_opt.design.whatif.budget import SMALLEST, Budget, End, _Point, _Tolerances, budget
from fcdm_opt.design.whatif.fitting import Order, barred_text, order
from fcdm_opt.design.whatif.whatif import whatif
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.primitives import Box, Cylinder, cut
from fcdm_opt.geometry.size import Size
from fcdm_opt.motion.motions import Rotation, Translation
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import Problem
from fcdm_opt.show.tables import print_budgets
from fcdm_opt.solver import solve

NEAR = 3e-9  # of closed forms: the bracket is 1e-9 wide, and amounts are known to 1e-10
X = Translation("x")


@cache
def between_walls(**arguments: Any) -> Problem:
    """A cube on the right wall; static wall faces at 7 and 10, from a seed at 0.

    In C the walls move right by 7 tau and 10 tau and the cube's half-width shrinks by tau: the gaps are 11 tau on the
    right and 1 - 6 tau on the left. The least way to touch is the smaller of them until the left wall hits the cube at
    tau = 1/6, and 6 tau - 1 from there: it rises to 11/17 at tau = 1/17, falls to 0 and rises for good.
    """
    cube = box((8, -1, -1), (10, 1, 1), "cube")
    left = [[x, y, z] for x in (1.0, 7.0) for y in (-4.0, 4.0) for z in (-4.0, 4.0)]
    right = [[x, y, z] for x in (10.0, 13.0) for y in (-4.0, 4.0) for z in (-4.0, 4.0)]
    walls = Body.from_parts([left, right], seed=(0.0, 0.0, 0.0), name="walls")
    return Problem(cube, walls, motion=X, goal="touch", requirement="C", tolerance=0.01, **arguments)


def least(tau: float) -> float:
    return min(11 * tau, abs(1 - 6 * tau)) if tau <= 1 / 6 else 6 * tau - 1


def one(problem: Problem, limit: float | None, letter: str, **arguments: Any) -> Budget:
    return budget(problem, limit, requirements=[letter], **arguments)[letter]


def assert_closed(found: Budget, tau: float, end: End = End.LIMIT) -> None:
    low, high = found.bracket
    assert low == found.tolerance
    assert 0 < high - low <= 1e-9 * high
    assert found.tolerance == pytest.approx(tau, rel=NEAR)
    assert found.end is end
    assert found.above is not None
    assert found.solution is not None
    assert found.solution.usable


# ------------------------------------------------------------------------------------------------------------ windows


def test_the_scene_of_windows_is_what_it_says() -> None:
    for tau in (0.05, 0.15, 0.28):
        assert solve(between_walls().changed(tolerance=tau)).amount == pytest.approx(least(tau), abs=1e-9)


@pytest.mark.parametrize("limit", [0.5, 0.6, 11 / 17 * (1 - 1e-4)])
def test_the_first_crossing_counts_not_the_last(limit: float) -> None:
    """For .5 the window is [.045, .083] and the last crossing at .25; the third is 2e-5 wide, about a kink."""
    found = one(between_walls(), limit, "C", largest=0.3)
    assert_closed(found, limit / 11)
    assert not found.proved
    assert found.spacing > 0
    assert re.search(r"sampled every [\d.]+ % from [\d.]+ %, down to ", found.reason)  # without a unit it was


def test_a_peak_below_the_limit_is_no_crossing() -> None:
    assert_closed(one(between_walls(), 0.66, "C", largest=0.3), 1.66 / 6)


def test_a_window_without_a_motion_ends_it_too() -> None:
    """Limits of the motion in place of one of the amount: the same crossing, where no motion is left."""
    found = one(between_walls().changed(limits={"TX": (-0.5, 0.5)}), None, "C", largest=0.3)
    assert_closed(found, 0.5 / 11, End.NO_MOTION)
    assert found.end_proved
    assert found.amount == pytest.approx(0.5, abs=1e-8)


def test_all_requirements_by_one_word_were_refused() -> None:
    problem = problems("peg_square")["A at the wall"]
    assert list(budget(problem, 0.03, requirements="all", largest=0.001)) == ["A", "B", "C", "D"]


# ----------------------------------------------------------------------------------------- closed forms, brute force


def test_budgets_of_a_peg_at_the_wall() -> None:
    """TX = S - .25 and TY = min(S - .125, 0), S = 10 rho_2 - 9.75 rho_1: .25 + .25 tau in A, .25 - 19.75 tau in B."""
    problem = problems("peg_square")["A at the wall"]
    found = budget(problem, 0.03, requirements="ABC", largest=0.005)
    assert [own.end for own in found.values()] == [End.LARGEST, End.LIMIT, End.LIMIT]
    assert_closed(found["B"], 0.03 / 19.75)
    assert_closed(found["C"], 0.03 / 19.75)
    assert found["A"].bracket == (0.005, 0.005)
    assert found["A"].amount == pytest.approx(0.00125, abs=1e-9)
    assert found.tolerance == min(found["B"].tolerance, found["C"].tolerance)


def test_the_shape_of_a_tolerance_is_kept() -> None:
    """Only the plate is off: S = .25 - 10 tau in B; with the peg off by half of that, .25 - (10 + 4.875) tau."""
    plate = problems("peg_square")["B at the wall"].changed(tolerance=(0.0, 0.03))
    found = budget(plate, 0.03, requirements="B", largest=0.02)
    assert_closed(found["B"], 0.003)
    np.testing.assert_allclose(found["B"].table, [[0, 0], [0.003, 0.003]], rtol=1e-8)
    half = plate.changed(tolerance=((0.01, 0.02), (0.04, 0.0)))
    assert_closed(one(half, 0.03, "B", largest=0.02), 0.03 / 14.875)
    assert_closed(one(half, 0.03, "B", largest=0.02, scale=False), 0.03 / 19.75)


@pytest.mark.sampled(6)
@pytest.mark.parametrize(
    ("name", "case", "limit", "letter"),
    [
        ("example1", "A", 0.004, "A"), ("example1", "A", 0.004, "D"), ("example1", "B", 0.02, "B"),
        ("example1", "C", 0.05, "C"), ("example2", "B", 0.01, "B"), ("example2", "B", 0.01, "C"),
        ("example1_touch", "B", 0.002, "A"), ("example1_touch", "B", 0.002, "B"), ("example1_touch", "B", 0.002, "C"),
        ("example1_touch", "B", 0.002, "D"),
    ],
)  # fmt: skip
def test_budgets_agree_with_brute_force(name: str, case: str, limit: float, letter: str) -> None:
    problem = problems(name)[case]
    found = one(problem, limit, letter, largest=0.02)
    assert 0 < found.tolerance < 0.02
    for tau in np.linspace(0, 1.5 * found.tolerance, 8)[1:]:
        solution = solve(problem.changed(requirement=letter, tolerance=tau))
        assert (solution.usable and solution.amount <= limit) == (tau <= found.tolerance)
    assert found.amount == pytest.approx(limit, rel=1e-7)


# -------------------------------------------------------------------------------------------------- nested questions


def apart(gap: float, **arguments: Any) -> Problem:
    """Two cubes of half-width 1, their walls `gap` apart at rest."""
    other = box((1 + gap, -1, -1), (3 + gap, 1, 1), "other")
    given = {"goal": "clear", "requirement": "A", "tolerance": 0.01, "motion": X, **arguments}
    return Problem(box((-1, -1, -1), (1, 1, 1), "cube"), other, **given)


def test_growing_bodies_are_nested() -> None:
    """Gap g - 2 tau must be c: the least way is c - g + 2 tau."""
    found = one(apart(0.1, clearance=0.15), 0.2, "A")
    assert_closed(found, (0.2 - 0.15 + 0.1) / 2)
    assert found.proved
    assert found.spacing == 0.0
    assert "grow" in found.reason


@pytest.mark.parametrize(("limit", "end", "tolerance"), [(0.2, End.LARGEST, 0.15), (0.049, End.LIMIT, 0.0)])
def test_shrinking_bodies_are_all_good_or_none(limit: float, end: End, tolerance: float) -> None:
    """The least way, c - g - 2 tau, is largest for the smallest tolerance: .05."""
    found = one(apart(0.1, clearance=0.15), limit, "D", largest=0.15)
    assert (found.end, found.tolerance) == (end, tolerance)
    assert found.proved
    assert "shrink" in found.reason


def test_touching_from_afar_is_nested() -> None:
    found = one(apart(0.0, goal="touch"), 0.1, "D")
    assert_closed(found, 0.05)
    assert found.proved


def test_beyond_with_another_motion_may_have_no_budget() -> None:
    found = one(problems("example1")["A"], 0.02, "B")
    assert (found.tolerance, found.end) == (0.0, End.NOT_FOUND)
    assert found.bracket == (0.0, SMALLEST)
    assert found.amount == 0.0
    assert str(found) == "B: only as drawn; above, no motion found"


@pytest.mark.parametrize(
    ("goal", "limit", "letter"), [("touch", 0.05, "A"), ("clear", 0.04, "D"), ("clear", None, "A")]
)
def test_parts_that_are_not_good_as_drawn_were_good_up_to_0_percent(goal: str, limit: Any, letter: str) -> None:
    """The cube is drawn 0.1 from the wall: 0.1 to touch it, 0.05 to be clear by 0.15."""
    clear = {"clearance": 0.15} if goal == "clear" else {}
    problem = apart(0.1, goal=goal, **clear, limits={"TX": (-0.01, 0.01)} if limit is None else None)
    found = one(problem, limit, letter)
    assert (found.tolerance, found.bracket, found.solution) == (0.0, (0.0, 0.0), None)
    assert np.isnan(found.amount)
    why = End.NO_MOTION if limit is None else End.LIMIT
    assert str(found) == f"{letter}: not even as drawn: {why.value} (proved)"


def asked(problem: Problem, letter: str) -> Order:
    return order(problem.changed(requirement=letter))[0]


def test_what_is_nested_and_what_is_not() -> None:
    clear, touch = apart(0.1), apart(0.0, goal="touch")
    assert [asked(clear, letter).name for letter in "ABCD"] == ["FROM_ZERO", "ANY", "ANY", "ALL_OR_NONE"]
    assert [asked(touch, letter).name for letter in "ABCD"] == ["FROM_ZERO", "ANY", "ANY", "FROM_ZERO"]
    assert asked(apart(0.1, goal="touch"), "A") is Order.ANY  # the gap closes before it is an overlap
    assert asked(clear.changed(tolerance=((0, 0.01), (0, 0.01))), "B") is Order.FROM_ZERO  # only the cube is off
    assert asked(clear.changed(resolution=0.01), "A") is Order.ANY
    assert asked(clear.changed(amount="displacement"), "A") is Order.ANY
    assert asked(touch.changed(limits={"TX": (0.1, 1.0)}), "A") is Order.ANY
    kept = KeepOut(box((5, 5, 5), (6, 6, 6)))
    assert asked(clear.changed(keep_out=(kept,)), "A") is Order.FROM_ZERO
    assert asked(touch.changed(keep_out=(kept,)), "A") is Order.ANY
    aside = box((-1, -1, -1), (1, 1, 1), seed=(0, 0, 5))
    assert asked(clear.changed(movable=aside), "A") is Order.ANY
    beyond = problems("example1")["B"]
    assert {asked(beyond, letter) for letter in "ABCD"} == {Order.FROM_ZERO}
    assert asked(beyond.changed(pair="clear"), "B") is Order.ANY
    assert asked(beyond.changed(goal="at", motion=X >> Translation("y")), "B") is Order.FROM_ZERO
    assert asked(beyond.changed(goal="at", motion=X, limits={"TX": (0.1, 1.0)}, published=None), "B") is Order.ANY
    assert asked(beyond.changed(goal="at"), "B") is Order.ANY


@pytest.mark.parametrize(
    ("problem", "letter"),
    [
        (lambda: apart(0.1, clearance=0.15, motion=X >> Rotation("z")), "A"),
        (lambda: problems("example1_touch")["B"], "A"),
        (lambda: problems("example1_touch")["B"], "D"),
        (lambda: problems("example1")["C"], "C"),
        (lambda: problems("example1")["B"].changed(goal="at", motion=X >> Translation("y")), "B"),
    ],
)
def test_least_amounts_of_nested_questions_only_rise(problem: Any, letter: str) -> None:
    own = problem()
    assert asked(own, letter) is Order.FROM_ZERO
    found = [solve(own.changed(requirement=letter, tolerance=tau)) for tau in np.linspace(0.002, 0.05, 7)]
    amounts = [solution.amount for solution in found if solution.usable]
    assert len(amounts) >= 2
    assert all(solution.usable for solution in found[: len(amounts)])  # and none comes back
    assert np.all(np.diff(amounts) > 0)


# ---------------------------------------------------------------------------------------------------- plain data, input


def test_a_contact_that_is_closed_at_all_sizes_was_not_told() -> None:
    """A peg with play along x stands on the floor of its slot: it touches there, whatever the widths are."""
    floor, left, right = (
        [*product(x, (-5, 5), z)] for x, z in (((-9, 9), (-2, 0)), ((-9, -3), (0, 4)), ((3, 9), (0, 4)))
    )
    slot = Body.from_parts([np.array(own, float) for own in (floor, left, right)], name="slot")
    peg = Body.convex([*product((-2, 2), (-4, 4), (0, 6))], name="peg")
    size = Size("peg", "movable", faces=["+x", "-x"], each=0.5, tolerance=0.1)
    problem = Problem(peg, slot, sizes=[size], motion=Translation("x"), goal="touch", unit="mm")
    found = budget(problem, 0.3, requirements=("worst",), largest=0.2)
    assert found["worst"].permanent == stack_up(problem).standing
    told = 'closed at all these sizes, so that goal "touch" asks for no motion: bottom face of peg'
    assert told in str(found)
    assert found.to_dict()["requirements"]["worst"]["permanent"] == [*found["worst"].permanent]


def test_budgets_are_plain_data_and_words() -> None:
    found = budget(apart(0.1, clearance=0.15), 0.2, requirements=("A", "D"))
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert list(data["requirements"]) == list(found) == ["A", "D"]
    assert data["requirements"]["A"]["end"] == "LIMIT"
    assert data["tolerance"] == found["A"].tolerance
    assert str(found).splitlines()[0] == "A: up to 7.5 % (proved); above, the least amount exceeds the limit"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"limit": -1.0}, "limit"), ({"limit": float("nan")}, "limit"), ({"requirements": ("E",)}, "requirements"),
        ({"requirements": ()}, "no requirement"), ({"requirements": 5}, "no requirement"),
        ({"largest": 1.0}, "largest"), ({"largest": 0.0}, "largest"),
        ({"accuracy": 0.0}, "accuracy"), ({"scale": 1}, "scale"), ({"problem": "peg"}, "expected a Problem"),
    ],
)  # fmt: skip
def test_bad_input_is_named(arguments: dict[str, Any], said: str) -> None:
    given = {"problem": apart(0.1), "limit": 0.1, **arguments}
    with pytest.raises(InputError, match=said):
        budget(given.pop("problem"), given.pop("limit"), **given)


# -------------------------------------------------------------------------------------------------------------- sizes


@pytest.mark.parametrize(
    ("goal", "corner", "rate", "word"),
    [("touch", "worst", 1.5, "sampled"), ("touch", "loosest", 1.0, "sampled"), ("clear", "worst", 1.5, "proved")],
)
def test_a_budget_of_sizes_is_in_their_lengths(goal: str, corner: str, rate: float, word: str) -> None:
    """A cube on a table: its foot is off by up to tau, the table's top by 0 to tau / 2; their sum is taken back."""
    cube, table = box((-1, -1, 0), (1, 1, 2), "cube"), box((-3, -3, -1), (3, 3, 0), "table")
    foot = Size("foot", "movable", faces="-z", tolerance=(-0.05, 0.05))
    top = Size("top", "static", faces="+z", tolerance=(0.0, 0.025))
    problem = Problem(cube, table, sizes=[foot, top], motion=Translation("z"), goal=goal, unit="mm")
    found = budget(problem, 0.06, requirements=corner)[corner]
    tau = 0.06 / rate
    assert found.tolerance == pytest.approx(tau, rel=NEAR)
    assert found.sizes == ("foot", "top")
    np.testing.assert_allclose(found.table, [[-tau, tau], [0.0, tau / 2]], rtol=1e-8)
    assert found.amount == pytest.approx(0.06, abs=1e-8)
    assert str(found).startswith(
        f"{corner} ({found.corner}): up to {tau:.6g} mm ({word}: foot -{tau:.6g} to +{tau:.6g}, top +0 to "
    )
    assert found.to_dict()["sizes"] == ["foot", "top"]


@pytest.mark.sampled(1)
@pytest.mark.parametrize("as_assembly", [False, True])
def test_two_contacts_are_farthest_off_at_a_corner_that_least_and_largest_gaps_at_rest_missed(
    as_assembly: bool,
) -> None:
    """A cube on a table at a wall: both its faces are short by up to tau, the wall's off by as much: 2 tau, and tau."""
    cube = box((0, 0, 0), (2, 2, 2), "cube")
    walls = [box((-3, -3, -1), (3, 3, 0), "x").vertices, box((-1, -3, 0), (0, 3, 3), "x").vertices]
    corner = Body.from_parts(walls, name="corner")
    inner = [
        f"F{k + 1}" for k, (n, x) in enumerate(zip(*corner.face_planes, strict=True)) if n[0] > 0.9 and abs(x[0]) < 1e-9
    ]
    movable, static = ("cube", "corner") if as_assembly else ("movable", "static")
    sizes = [
        Size("cube", movable, faces=["-x", "-z"], each=[1.0, 1.0], tolerance=(-0.05, 0.0)),
        Size("wall", static, faces=inner, tolerance=0.05),
    ]
    if as_assembly:
        scene: Any = Assembly(
            {"cube": cube, "corner": corner}, [("cube", "corner")], sizes=sizes,
            motions={"cube": Translation("x") >> Translation("z")},
        )  # fmt: skip
    else:
        scene = Problem(cube, corner, sizes=sizes, motion=Translation("x") >> Translation("z"), contacts="all")
    found = budget(scene, 0.05)
    tau = 0.05 / np.sqrt(5.0)
    assert list(found) == ["corners"]
    assert found["corners"].tolerance == pytest.approx(tau, rel=1e-5)
    assert f"at cube {-tau:+.4g}"[:-1] in str(found)


def comb() -> Problem:
    """Two pins of 2 in slots of 2.2, the pins' places off by up to tau each, and the shift along x to be found."""
    boxes = [Box((2, 2, 2), centre=(x, 0, 0)).vertices for x in (-10, 10)]
    walls = [Box((1, 4, 4), centre=(x + s * 1.6, 0, 0)).vertices for x in (-10, 10) for s in (-1, 1)]
    pins, slots = Body.from_parts(boxes, name="pins"), Body.from_parts(walls, name="slots")
    sizes = [
        Size(name, "movable", faces=[{"through": (x - 1, 0, 0)}, {"through": (x + 1, 0, 0)}], along="x", tolerance=0.05)
        for name, x in (("left", -10), ("right", 10))
    ]
    return Problem(pins, slots, sizes=sizes, motion=X, goal="clear", unit="mm")


def test_sizes_that_jam_against_each_other_were_good_at_the_least_gap_at_rest() -> None:
    """One pin at +t and one at -t leave 0.1 - t either side of both: they jam beyond 0.1 (was 0.4, all looked at)."""
    found = budget(comb(), 0.2, largest=0.2)
    assert list(found) == ["corners"]
    assert found["corners"].tolerance == pytest.approx(0.1, rel=1e-5)
    line = str(budget(comb(), 0.2, requirements=["worst"], largest=0.2))
    assert (
        "up to 0.2 mm only where all sizes are off at once, as at each of these corners; sizes that are at no" in line
    )


def bush() -> Problem:
    """A square peg of 2 in a square hole of 2.2 between four walls, which sizes of both move."""
    corners = np.array(list(itertools.product([-1.0, 1.0], repeat=3)))
    walls = [corners * [0.95, 3.0, 1.0] + [2.05 * s, 0.0, 0.0] for s in (-1, 1)]
    walls += [corners * [3.0, 0.95, 1.0] + [0.0, 2.05 * s, 0.0] for s in (-1, 1)]
    peg, plate = Body.convex(corners, name="peg"), Body.from_parts(walls, name="plate", seed=np.zeros(3))
    inner = [f"F{k + 1}" for k, (n, x) in enumerate(zip(*plate.face_planes, strict=True)) if -1.2 < n @ x < -1.0]
    sizes = [
        Size("peg", "movable", faces=["+x", "-x"], each=0.5, tolerance=0.02),
        Size("hole", "static", faces=inner, each=-0.5, tolerance=0.02),
    ]
    return Problem(peg, plate, sizes=sizes, motion=X >> Translation("y"), goal="clear", target=(1, 1), unit="mm")


@pytest.mark.slow
def test_tolerances_whose_parts_lie_in_larger_ones_were_all_looked_at_and_what_ends_them_was_not_said() -> None:
    """Both walls of 2.2 - 2 close at a tolerance of .2: .1 each; what has more play is clear as drawn."""
    found = budget(bush(), None, largest=0.15, accuracy=1e-6)
    worst, loosest = found["worst"], found["loosest"]
    assert worst.tolerance == pytest.approx(0.1, rel=1e-5)
    assert (worst.proved, loosest.proved, loosest.end, loosest.tolerance) == (True, True, End.LARGEST, 0.15)
    assert (worst.points < 24, loosest.points) == (True, 2)
    assert "does not fit: peg" in worst.advice
    assert worst.advice in str(found)


def test_of_two_motions_as_small_now_one_and_now_the_other_was_taken_for_changes_of_contact(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Amounts on one line need no look between them; and where there is no end of changes they are left, as is said."""
    straight = [_Point(tau, True, SimpleNamespace(amount=2.0 * tau)) for tau in (0.1, 0.15, 0.2)]
    assert straight[0].leads_straight(*straight[1:], None)
    assert not straight[0].leads_straight(*straight[1:], 0.4)  # as near as that it may be passed between them
    bent = straight[1]._replace(solution=SimpleNamespace(amount=0.31))
    assert not straight[0].leads_straight(bent, straight[2], None)
    monkeypatch.setattr(_Point, "like", lambda *_: False)
    monkeypatch.setattr("fcdm_opt.design.whatif.budget.STRAIGHT", -1.0)
    monkeypatch.setattr("fcdm_opt.design.whatif.budget.LOOKS", 1)
    found = one(between_walls(), 2.0, "C", largest=0.2)
    assert found.tolerance == 0.2
    assert found.reason.endswith("on not at these: 64 were looked at by then")


def test_where_time_was_over_there_was_no_budget_at_all() -> None:
    """A peg between walls that close at .1: nothing is known within no time, and it is said for each corner."""
    asked = bush()
    with pacing.within(1e-9, share=1.0):
        found = budget(asked, None, largest=0.15)
    words = [(own.end, own.tolerance, own.proved, own.points) for own in found.values()]
    assert words == [(End.TIME, 0.0, False, 0)] * 2
    assert found["worst"].advice == "the time limit was met"
    assert found["worst"].reason == "the time limit of 1e-09 s was met"
    with pacing.within(1.0):  # what the command has where no time is given
        pacing.begin(1e-9, usual=True)
        assert budget(asked, None, largest=0.15)["worst"].reason == "the usual time limit of 1e-09 s was met"


def test_a_tolerance_at_which_round_parts_come_to_touch_was_one_of_their_facets() -> None:
    """A pin of 10 in a bore of 10.1: the gap of .05 as drawn closes at .1 of each diameter, half of it a side."""
    pin = Cylinder(5.0, 8.0, base=(0, 0, -4), facets=12, name="pin")
    plate = cut(Box((30, 30, 6)), Cylinder(5.05, 20, base=(0, 0, -10), facets=12), name="plate")
    sizes = [
        Size("pin", "movable", faces="cylinder radius 5", each=0.5, tolerance=0.02),
        Size("bore", "static", faces="bore radius 5.05", each=-0.5, tolerance=0.0),
    ]
    asked = Problem(pin, plate, sizes=sizes, motion=X, goal="touch", unit="mm")
    first, last = _Tolerances(asked, "worst", np.array([[-1.0, 1.0], [0.0, 0.0]]), None, 0.2, 1e-9).crossing
    assert 0.1 - 8.0 * asked.contact_slack < first < 0.1 < last < 0.1 + 8.0 * asked.contact_slack


@pytest.mark.slow
def test_the_worst_corner_left_out_the_contact_with_more_gap() -> None:
    """A block with 0.2 and 0.5 to its stops is to have 0.05 to either: 0.7 - 2 t >= 0.1 ends at 0.3 (was 0.4)."""
    stops = Body.from_parts([Box((2, 12, 12), centre=(x, 0, 0)).vertices for x in (-6.2, 6.5)], name="stops")
    sizes = [
        Size(name, "static", faces={"through": (x, 0, 0)}, tolerance=0.1)
        for name, x in (("left", -5.2), ("right", 5.5))
    ]
    block, along = Box((10, 10, 10), name="block"), Translation("x")
    found = budget(
        Problem(block, stops, sizes=sizes, goal="clear", clearance=0.05, motion=along),
        None,
        requirements=["worst", "high"],
    )
    assert found["high"].tolerance == pytest.approx(0.3, abs=1e-8)
    assert found["worst"].tolerance == pytest.approx(0.3, abs=1e-8)
    worst, high, more = str(found).splitlines()
    assert worst.startswith("worst (the sizes with the least gap at rest): up to 0.3 (")
    assert high.startswith("high (all sizes at their largest): up to 0.3 (proved: ")
    assert more.startswith("worst holds for all sizes within: none has more material")
    assert found["worst"].to_dict()["corner"] == "the sizes with the least gap at rest"


@pytest.mark.slow
def test_sizes_of_an_assembly_that_jam_against_each_other_were_good_all_low_and_all_high() -> None:
    """A plate on a post of 20, .1 over another, and five sizes: one post at -t and one at +t jam beyond .05.

    All low, or all high, no gap changes; of 32 combinations the one with the least gap decides.
    """
    floor, plate = Box((40, 10, 2), centre=(0, 0, -1), name="floor"), Box((40, 10, 2), centre=(0, 0, 21), name="plate")
    left = Box((4, 10, 20), centre=(-10, 0, 10), name="left")
    right = Box((4, 10, 19.9), centre=(10, 0, 9.95), name="right")
    sizes = [Size(f"{part} height", part, faces="+z", tolerance=0.02) for part in ("left", "right")]
    sizes += [Size(f"{part} side", part, faces="+y", tolerance=0.02) for part in ("left", "right", "plate")]
    pairs: list[Any] = [("left", "floor"), ("right", "floor"), ("plate", "left")]
    pairs.append({"parts": ("plate", "right"), "goal": "clear"})
    motions = dict.fromkeys(("left", "right", "plate"), Translation("z"))
    scene: Any = Assembly([floor, left, right, plate], pairs, sizes, motions)
    found = budget(scene, 0.2, accuracy=1e-2)
    assert list(found) == ["corners"]
    assert found["corners"].tolerance == pytest.approx(0.05, rel=1e-2)
    assert "left height -0.05" in found["corners"].advice
    limited = budget(scene, 0.03, accuracy=1e-2)["corners"]  # the plate goes down with its post, and nothing else moves
    assert limited.tolerance == pytest.approx(0.03, rel=1e-2)
    assert budget(scene, 0.2, requirements=["low"], accuracy=1e-2)["low"].tolerance > 0.05


@pytest.mark.slow
def test_parts_that_are_not_declared_clear_were_let_overlap_at_corners_of_many_sizes() -> None:
    """A block, a divider and a block in a row, .3 before a stop: their lengths and its place take up 1.1 tau each side.

    So they stand in the stop beyond .3 / 2.2 of their largest tolerance; the rise of the first one's top is the fifth.
    """
    places = {"block A": (0, 30), "divider": (30, 32), "block B": (32, 62)}
    blocks = [Box((b - a, 20, 10), centre=((a + b) / 2, 10, 5), name=part) for part, (a, b) in places.items()]
    floor, stops = Box((90, 40, 8), centre=(30, 10, -4)), [Box((8, 40, 10), centre=(x, 10, 5)) for x in (-4, 66.3)]
    sizes = [Size(part, part, faces="+x", tolerance=t) for part, t in zip(places, (0.05, 0.02, 0.05), strict=True)]
    sizes.append(Size("stop", "base", faces=[{"through": (62.3, 10, 5)}], each=-1.0, tolerance=0.1))
    sizes.append(Size("height", "block A", faces="+z", tolerance=0.03))
    pairs = [("block A", "base"), ("divider", "block A"), ("block B", "divider"), ("block B", "base")]
    motions = dict.fromkeys(places, X)
    scene: Any = Assembly([*blocks, fo.joined(floor, *stops, name="base")], pairs, sizes, motions)
    found = budget(scene, 0.3, accuracy=1e-2)["corners"]
    assert found.tolerance == pytest.approx(0.3 / 2.2, rel=1e-2)
    assert found.end is End.NO_MOTION
    assert found.reason.endswith(f"below {found.tolerance:.6g} at one corner, there at all 32")


def test_the_tolerance_of_a_budget_was_not_told_as_a_share_of_those_given(capsys: pytest.CaptureFixture[str]) -> None:
    """A block that grows by .1 t towards two posts, one of which grows by .05 t: back by .15 t, at most .3."""
    block = fo.Box((10, 10, 10), name="block")
    posts = fo.joined(*(fo.Box((4, 4, 4), centre=(7, y, 0)) for y in (-3, 3)), name="posts")
    post = fo.Size("post", "static", faces={"through": (5, 3, 0)}, tolerance=0.05)
    sizes = [fo.Size("block", "movable", faces="+x", tolerance=0.1), post]
    problem = fo.Problem(block, posts, sizes=sizes, made={"block": 0.1}, goal="clear", motion=fo.Translation("x"))
    found = fo.budget(problem, 0.3)
    assert found["worst"].share_text(sizes) == "2 times their tolerances: "
    print_budgets(found)
    words = " ".join(capsys.readouterr().out.split())
    assert "within 2 times their tolerances: block -0.2 to +0.2, post -0.1 to +0.1" in words
    told = str(fo.solve(problem).sensitivity)  # the post alone that grows holds the block
    assert told.startswith("derivatives of the amount, not by all data: more constraints hold the motion than it takes")


# ------------------------------------------------------------------------- sizes whose tolerance does not include drawn


def insert(width: float, tolerance: tuple[float, float]) -> Problem:
    """A square insert in a window of 20, whose width along x is off."""
    frame = cut(Box((60, 60, 18), unit="mm"), Box((20, 20, 30), unit="mm"), name="frame")
    size = Size("wx", "movable", faces=["+x", "-x"], each=0.5, tolerance=tolerance)
    part = Box((width, width, 18), name="insert", unit="mm")
    return Problem(part, frame, sizes=[size], made="middle", goal="clear", motion=X >> Translation("y"))


@pytest.mark.parametrize(("width", "worst", "loosest"), [(20.0, 0.0, 0.0), (19.9, 0.1, 0.15)])
def test_press_fits_were_good_at_four_times_their_tolerance(width: float, worst: float, loosest: float) -> None:
    """Wider by 2/3 t to t: line to line none goes in, with a play of .1 up to t = .1, and the loosest up to .15."""
    found = budget(insert(width, (0.04, 0.06)), None)
    assert [own.tolerance for own in found.values()] == pytest.approx([worst, loosest], rel=1e-5)
    assert {own.end for own in found.values()} == {End.MISFIT}
    assert (found["worst"].proved, found["loosest"].proved) == (True, False)
    for own in found.values():
        assert own.advice.startswith("does not fit: insert ")


@pytest.mark.parametrize("tolerance", [(-0.06, -0.04), (-0.06, 0.0)])
def test_running_fits_need_no_motion(tolerance: tuple[float, float]) -> None:
    """Narrower than its window of 20 at all sizes, whether drawn is among these or not."""
    found = budget(insert(20.0, tolerance), 0.0)
    assert [(own.tolerance, own.end) for own in found.values()] == [(pytest.approx(0.24), End.LARGEST)] * 2


def test_what_ends_a_budget_was_said_in_other_words_than_of_the_answer() -> None:
    """A pin 2 wide in a slot of 2.2: a clearance of .05 lasts to .1 wider, where `solve` finds that it fits without."""
    pin, slot = Box((2, 2, 2), name="pin", unit="mm"), cut(Box((9, 9, 2), unit="mm"), Box((2.2, 2.2, 4), unit="mm"))
    size = Size("wx", "movable", faces=["+x", "-x"], each=0.5, tolerance=0.02)
    bare = Problem(pin, slot, sizes=[size], goal="clear", motion=X)
    for problem, most, end in (
        (bare.changed(clearance=0.05), 0.1, End.NOT_MET),
        (bare, 0.2, End.MISFIT),
    ):
        found = one(problem, None, "worst", largest=0.3)
        assert found.tolerance == pytest.approx(most, rel=1e-5)
        past = problem.changed(made={"wx": most + 0.01})
        assert found.end is end
        assert barred_text(solve(past)) == end.value
        assert f", {end.value}" in str(whatif(past, made={"wx": most + 0.02}))


def test_what_the_judge_refused_by_rounding_at_the_end_was_said_to_end_it() -> None:
    """Two legs in a pocket with a play of .1 a side and a groove aslant with as much: a pitch of .2 + .1 sqrt(2)."""

    def groove(half: tuple[float, float], z: tuple[float, float]) -> Any:
        axes = np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]) / np.sqrt(2.0)
        corners = product((-half[0], half[0]), (-half[1], half[1]), z)
        return np.array([[16.0, 0.0, 0.0] + a * axes[0] + b * axes[1] + [0.0, 0.0, c] for a, b, c in corners])

    flange, leg = Box((50, 30, 6), centre=(5, 0, 9)).vertices, Box((6, 6, 8), centre=(-8, 0, 2)).vertices
    legs = Body.from_parts([flange, leg, groove((4, 2), (-2, 6))], name="locator", seed=(-8, 0, 2))
    pocket, aslant = Box((6.2, 6.2, 20), centre=(-8, 0, 0)), Body.convex(groove((8, 2.1), (-7, 7)), name="aslant")
    board = cut(Box((80, 50, 9), centre=(0, 0, -1.5)), pocket, aslant, name="board")
    places = [(4, 1, 1), (4, -1, -1), (2, -1, 1), (2, 1, -1)]
    sides = [{"through": (16 + x * far / np.sqrt(2.0), y * far / np.sqrt(2.0), 2)} for far, x, y in places]
    pitch = Size("pitch", "movable", faces=sides, along="x", tolerance=0.3)
    problem = Problem(legs, board, sizes=[pitch], goal="clear", motion=X >> Translation("y"), unit="mm")
    found = one(problem, None, "worst", largest=0.6)
    assert found.tolerance == pytest.approx(0.2 + 0.1 * np.sqrt(2.0), rel=1e-6)
    assert found.end is End.MISFIT
    assert found.advice.startswith("does not fit: locator and board overlap by ")


def test_widths_that_lack_less_than_parts_may_overlap_made_a_search_creep(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where widths alone said that parts do not fit and the judge that they do, each step began another search."""
    asked = list[int]()
    real = budget_module.solve
    monkeypatch.setattr(budget_module, "too_wide", lambda _: True)
    monkeypatch.setattr(budget_module, "solve", lambda *own, **more: asked.append(1) or real(*own, **more))
    plate = fo.cut(fo.Box((30, 30, 8)), fo.Box((6.02, 12, 20)), name="plate")
    pin = fo.Box((6, 6, 20), name="pin")
    walls = [{"through": (x, 0, 0)} for x in (-3.01, 3.01)]
    sizes = [
        fo.Size("pin", "movable", faces=["+x", "-x"], each=0.5, tolerance=(0.004, 0.012)),
        fo.Size("slot", "static", faces=walls, each=-0.5, tolerance=(-0.01, 0.008)),
    ]
    motion = fo.Translation("x") >> fo.Translation("y")
    problem = fo.Problem(pin, plate, goal="clear", motion=motion, sizes=sizes, made="worst")
    assert fo.budget(problem, 0.02)["worst"].tolerance == pytest.approx(0.012 * 0.02 / 0.022, rel=1e-5)
    assert len(asked) < 100
