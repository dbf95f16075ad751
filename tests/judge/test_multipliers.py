"""Bounds of several contacts by multipliers: shown for closed forms, and refused where anything claimed is changed."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import CUBE as UNIT
from scenes import EDGE, LEDGE, PROBE, TABLE
from scenes import box as block
from scipy.optimize import linprog

import fcdm_opt as fo
from fcdm_opt import pacing
from fcdm_opt.judge.multipliers import _Contacts, shows, smallest_by_multipliers
from fcdm_opt.judge.one_contact import OneContact
from fcdm_opt.problem.evidence import Multipliers
from fcdm_opt.problem.solution import Solution

X, Y, Z, RX = fo.Translation("x"), fo.Translation("y"), fo.Translation("z"), fo.Rotation("x")
LOCATING = fo.load_problems(Path(__file__).parents[2] / "problems" / "locating.toml")


def box(*ends: tuple[float, float]) -> list[tuple[float, ...]]:
    return list(product(*ends))


CUBE = fo.Body.convex(box((0, 1), (0, 1), (0, 1)))
CORNER = fo.Body.from_parts([box((-9, 0), (-9, 9), (0, 1)), box((0, 9), (-9, 0), (0, 1))], seed=(-1, -1, 0))
FEET = ((-4, -3, 0.0), (4, -3, 0.5), (4, 3, 0.0), (-4, 3, 0.2))


def corner(**more: Any) -> fo.Problem:
    """A cube in a corner, .015 too large on both sides."""
    given = {"tolerance": 0.01, "requirement": "A", "goal": "at", "contacts": "all", "motion": X >> Y, **more}
    return fo.Problem(CUBE, CORNER, **given)


def lid(**more: Any) -> fo.Problem:
    """A lid on four pointed feet, on pads of other heights each: sizes do not change them alike."""
    feet = [[(x, y, h), *box((x - 0.3, x + 0.3), (y - 0.3, y + 0.3), (2.1, 2.1))[::2]] for x, y, h in FEET]
    pads = [box((x - 1, x + 1), (y - 1, y + 1), (-1, h)) for x, y, h in FEET]
    top = fo.Body.from_parts([box((-5, 5), (-4, 4), (2, 3)), *feet], seed=(0, 0, 2.5))
    given = {"tolerance": 0.02, "requirement": "B", "goal": "at", "contacts": "all", "motion": Z >> RX, **more}
    return fo.Problem(top, fo.Body.from_parts(pads, seed=(0, 0, 0)), **given)


def checked(solution: Solution) -> bool:
    """Whether the judge finds the bound shown, of a solution that has been stored."""
    again = fo.Solution.from_dict(solution.to_dict())
    assert again.to_dict() == solution.to_dict()
    own = [check.passed for check in fo.verify(again, proof=True).checks if check.name.startswith("proof")]
    assert own
    return all(own)


CASES = {
    "shifts": (corner(), np.hypot(0.015, 0.015)),
    "fit": (corner(goal="fit"), np.hypot(0.015, 0.015)),
    "a fit that stays open": (LOCATING[2].changed(motion=X >> Y, published=None), np.hypot(0.04, 0.02)),
    "a turn, flush": (corner(motion=X >> Y >> fo.Rotation("z")), np.hypot(0.015, 0.015)),
    "six parameters": (LOCATING[0], np.sqrt(0.02)),
    "a limit": (corner(motion=X >> Y >> Z, limits={"TZ": (0.01, 1.0)}), np.sqrt(2 * 0.015**2 + 0.01**2)),
}


@pytest.mark.parametrize(("problem", "amount"), CASES.values(), ids=CASES)
def test_a_bound_of_several_contacts_carried_no_evidence(problem: fo.Problem, amount: float) -> None:
    solution = fo.solve(problem, certify=True)
    assert solution.amount == pytest.approx(amount, rel=1e-8)
    assert solution.lower_bound == pytest.approx(amount, rel=1e-8)
    assert isinstance(solution.evidence, Multipliers)
    assert checked(solution)
    assert not shows(replace(solution, lower_bound=1.001 * solution.lower_bound), solution.evidence)


def test_a_wall_that_is_not_listed_bounds_a_shift_all_the_same() -> None:
    solution = fo.solve(corner(contacts=[corner().contacts[0].label], motion=X >> Y >> Z), certify=True)
    assert solution.amount == pytest.approx(np.hypot(0.015, 0.015), rel=1e-8)
    assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-8)
    assert checked(solution)
    assert not checked(replace(solution, lower_bound=1.001 * solution.lower_bound))


@pytest.mark.parametrize(("motion", "boxes"), [(X >> Y >> Z, 1), (Z >> RX, 1000)], ids=["shifts", "a turn"])
def test_more_contacts_than_freedoms_are_impossible_with_proof(motion: Any, boxes: int) -> None:
    """With a turn it was NOT_FOUND: that no motion closes all four feet is shown box by box of all that there are."""
    solution = fo.solve(lid(motion=motion), certify=True)
    assert solution.status is fo.Status.INFEASIBLE
    assert solution.lower_bound == np.inf
    assert len(solution.evidence.boxes) <= boxes
    assert checked(solution)
    # without turning two sizes alike lift all feet alike: there is a motion, and what excludes none must not be passed
    even = fo.solve(lid(motion=motion, requirement=None, tolerance=None, target=(1.0, 1.0)))
    assert even.usable
    assert not checked(replace(solution, problem=even.problem))


def test_multipliers_are_taken_at_their_word_in_nothing() -> None:
    solution = fo.solve(corner(), certify=True)
    own = solution.evidence
    narrower = replace(own, boxes=0.99 * own.boxes)
    elsewhere = replace(own, motions=0.5 * own.motions)
    twice = replace(own, boxes=np.repeat(own.boxes, 2, axis=0), motions=np.repeat(own.motions, 2, axis=0))
    for wrong in (narrower, elsewhere, twice, replace(own, motions=own.motions[:, :1])):
        assert not checked(replace(solution, evidence=wrong))
    larger = corner(tolerance=0.009)  # whose least motion is smaller than the bound
    assert not checked(replace(solution, problem=larger))
    # parts made smaller are shifted to one wall alone for less; made larger they must leave the other all the same
    for letter, same in (("D", False), ("A", True)):
        both = fo.solve(corner(requirement=letter), certify=True)
        one = corner(requirement=letter, contacts=[both.problem.contacts[0].label])
        assert not shows(replace(both, problem=one), both.evidence)
        assert checked(replace(both, problem=one, evidence=None)) == same


def test_a_cube_on_top_of_a_wall_was_taken_to_be_in_its_corner() -> None:
    """What a motion keeps was told from the gap of the parts, which touch elsewhere too: no clash of two was found."""
    half = dict.fromkeys(("TX", "TY"), (0.0, 0.0075))
    found = fo.conflicts(corner(motion=X >> Y >> Z, limits=half), relax=False, deviation=False)
    assert all(len(clash.names) == 2 and clash.names[0].startswith("upper limit") for clash in found.clashes)
    assert len(found.clashes) == 4


@pytest.mark.parametrize("name", ["a turn, flush", "six parameters"])
def test_motions_far_from_their_boxes_show_no_more_than_there_is(name: str) -> None:
    """Each box holds the motion that restores the contacts: nothing proved from afar may exclude it."""
    problem, amount = CASES[name]
    solution, rng = fo.solve(problem), np.random.default_rng(0)
    y = problem.weights * np.array([*solution.parameters.values()])
    moves = problem.weights * rng.uniform(-1.5, 1.5, (60, len(y)))
    low, high = np.tile(y - 1e-4, (60, 1)), np.tile(y + 1e-4, (60, 1))
    contacts = _Contacts(problem, y / problem.weights)
    with np.errstate(all="ignore"):
        shown = contacts.least(low, high, moves, np.inf)[0]
    assert shown.max() <= amount * (1.0 + 1e-9)


# ---------------------------------------------------------------------------------------------------------- one contact

BESIDE = block((1.05, 1.05, -1), (3, 3, 3), "beside")
FREE = {"motion": fo.Free(), "target": (1.01, 1.01)}
ONE = {  # problems with six parameters, and the amount where there is a closed form
    "touch, overlapping": (fo.Problem(PROBE, TABLE, goal="touch", **FREE), 0.015),
    "touch, apart": (fo.Problem(PROBE, TABLE, goal="touch", motion=fo.Free(), target=(0.98, 0.99)), 0.025),
    "clear": (fo.Problem(PROBE, TABLE, goal="clear", clearance=0.1, **FREE), 0.115),
    "clear of a face": (fo.Problem(UNIT, TABLE, goal="clear", clearance=0.02, **FREE), 0.03),
    "at": (fo.Problem(PROBE, TABLE, goal="at", **FREE), 0.015),
    "seat": (fo.Problem(UNIT, TABLE, goal="seat", **FREE), 0.01),
    "edges that cross": (fo.Problem(EDGE, LEDGE, goal="clear", **FREE), None),
    "edges apart": (fo.Problem(UNIT, BESIDE, goal="touch", motion=fo.Free(), target=(1.0, 1.0)), None),
}


@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", ONE)
def test_a_bound_of_six_parameters_carried_no_evidence(name: str) -> None:
    problem, amount = ONE[name]
    solution = fo.solve(problem, certify=True)
    assert solution.amount == pytest.approx(amount or solution.amount, rel=1e-8)
    assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-8)
    own = solution.evidence
    assert isinstance(own, Multipliers)
    assert checked(solution)
    narrower = replace(own, boxes=0.99 * own.boxes)
    twice = replace(own, boxes=np.repeat(own.boxes, 2, axis=0), motions=np.repeat(own.motions, 2, axis=0))
    turned = replace(own, boxes=own.boxes[:, ::-1])
    for wrong in (narrower, twice, turned, replace(own, motions=own.motions[:, :1])):
        assert not shows(replace(solution, evidence=wrong), wrong)
    assert not shows(replace(solution, lower_bound=1.001 * solution.lower_bound), own)
    wider = replace(own, boxes=1.01 * own.boxes)
    assert not shows(replace(solution, lower_bound=1.01 * solution.lower_bound), wider)
    less = 0.5 * problem.target + 0.5  # whose least motion is smaller than the bound
    if problem.target[0] > 1.0:
        assert not shows(replace(solution, problem=problem.changed(target=less, clearance=0.0)), own)


def test_boxes_were_looked_at_long_after_the_time_given(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half a minute where a second was given: neither the seconds of a proof nor those of all came as far."""
    looked: list[int] = []
    bounds = OneContact._bounds

    def counted(*given: Any) -> Any:
        looked.append(1)
        return bounds(*given)

    monkeypatch.setattr(OneContact, "_bounds", counted)
    problem, _ = ONE["edges apart"]
    solution = fo.solve(problem, certify=True, seconds=1e-9)
    with pacing.looking(2):  # the time is over before the first box
        assert pacing.in_time(smallest_by_multipliers, problem, np.array([*solution.parameters.values()]), late=3) == 3
    assert looked == []


def meet(one: np.ndarray, two: np.ndarray) -> bool:
    """Whether the hulls of points have a point in common."""
    ones = np.repeat(np.eye(2), [len(one), len(two)], axis=0).T
    system = np.vstack([np.hstack([one.T, -two.T]), ones])
    return linprog(np.zeros(len(one) + len(two)), A_eq=system, b_eq=[0, 0, 0, 1, 1]).status == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["touch, apart", "edges that cross", "edges apart"])
def test_multipliers_of_any_motion_exclude_none_that_does(name: str) -> None:
    """Parts that meet as made are to come apart, others to meet: whether they do is told by a linear program."""
    problem, rng = ONE[name][0], np.random.default_rng(1)
    solution = fo.solve(problem, effort="quick")
    y, judge = problem.weights * np.array([*solution.parameters.values()]), OneContact(problem)
    motions = y * rng.uniform(0.8, 1.6, (12, 1)) + rng.normal(scale=0.3 * np.linalg.norm(y), size=(12, 6))
    one, two = (
        body.seed + rho * (body.vertices - body.seed)
        for body, rho in zip((problem.movable, problem.static), problem.target, strict=True)
    )
    poses = [problem.motion.transform(q, problem.movable.seed, problem.static.seed) for q in motions / problem.weights]
    right = np.array([meet(one @ T[:3, :3].T + T[:3, 3], two) for T in poses]) != meet(one, two)
    assert right.sum() > 3
    low, high, amounts = motions[right] - 1e-3, motions[right] + 1e-3, np.linalg.norm(motions[right], axis=1)
    for looked_at in (rng.permutation(motions)[: len(low)], 0.0 * low):
        with np.errstate(all="ignore"):
            shown = judge.least(low, high, looked_at, np.inf)[0]
        assert (shown <= amounts).all()


@pytest.mark.slow
def test_a_motion_that_two_contacts_hold_was_asked_about_in_all_boxes_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two flanks of a V at 90 degrees, .141 and .283 too deep in a rod: 23 s for nothing, as neither holds it alone.

    Shifted straight out of both it goes (.1, .3), further than out of either.
    """
    flanks = [(14.0, 14.0), (14.0, -6.0), (-14.0, -6.0), (-14.0, 14.0), (0.0, 0.0)]
    deep = 0.3 - 5.0 * 2**0.5
    jaw = fo.Prism([(x + 0.1, y + deep) for x, y in flanks], 16, base=(0, 0, -8), name="jaw")
    rod = fo.Cylinder(5.0, 40, base=(0, 0, -20), name="rod")
    asked = fo.Problem(jaw, rod, motion=fo.Free(), goal="clear", target=(1, 1))
    solution = fo.solve(asked, effort="quick")
    assert 0.4 / 2**0.5 < solution.amount < 0.1**0.5
    looked_at = list[int]()

    def counted(self: OneContact, low: np.ndarray, *given: Any, method: Any = OneContact.least) -> Any:
        looked_at.append(len(low))
        return method(self, low, *given)

    monkeypatch.setattr(OneContact, "least", counted)
    assert smallest_by_multipliers(solution.problem, np.array([*solution.parameters.values()])) is None
    assert sum(looked_at) <= 15


def test_a_switching_point_with_six_parameters_is_certified_as_far_as_is_known() -> None:
    """Its sizes follow the motion, so that no contact alone bounds it: `certify` ended with a ValueError."""
    asked = fo.load_problems("problems/example1.toml")[1].changed(motion=fo.Free(), published=None)
    found = fo.solve(asked, certify=True, seconds=2.0)
    assert found.usable
    assert 0.0 <= found.lower_bound <= found.amount
