"""The rival methods find smallest motions known in closed form, refuse what they cannot express, and are judged."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import CUBE, Shape, box_shape, shape

from fcdm_opt.geometry.bodies import Body
from fcdm_opt.motion.motions import Rotation, Translation
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Status
from fcdm_opt.solver import solve
from fcdm_opt_benchmarks.method import Failure, MotionAnswer
from fcdm_opt_benchmarks.motions import COARSE, FINE, METHODS, RIVALS, USUAL, answered, judged

WIDE = ((0.5, 5.0), (0.5, 5.0))
X = Translation("x")
# 1 <= x <= 3/2, seed in its middle: a body of reach h_1 towards x meets it where rho_1 h_1 + rho_2 / 4 = 5/4
PLATE = box_shape((1, -2, -2), ("1.5", 2, 2))
TIP = shape([("0.5", 0, 0), ("-0.5", 0, 0), (0, "0.5", 0), (0, "-0.5", 0), (0, 0, "0.5"), (0, 0, "-0.5")], (0, 0, 0))
EXACT = 1e-6  # relative: of methods whose answers are brought onto their conditions


def problem(one: Shape, two: Shape, **arguments: Any) -> Problem:
    return Problem(one.body("one"), two.body("two"), **{"box": WIDE, "goal": "touch", "motion": X, **arguments})


GENERAL = [name for name in RIVALS if name not in ("Drake, SNOPT", "SCIP", "codac, proved")]  # see test_outside_rivals
EVERY = pytest.mark.parametrize("name", GENERAL)
EQUATIONS = pytest.mark.parametrize("name", [name for name in GENERAL if name != "grid"])
LOOSE = {"grid": FINE["translation"], "trust-constr": 1e-3}


def check(name: str, asked: Problem, amount: float, slack: float = EXACT) -> None:
    """The rival finds a motion of this amount, which the judge accepts."""
    answer = answered(name, asked)
    assert isinstance(answer, MotionAnswer), answer
    solution = judged(asked, answer.q)
    assert solution.usable, solution.certificate and solution.certificate.failed
    assert solution.amount == pytest.approx(answer.amount, rel=1e-12)
    assert amount * (1 - 1e-8) - 1e-9 <= solution.amount <= amount * (1 + slack) + 1e-9


# ----------------------------------------------------------------------------------------------------- closed forms


@EQUATIONS
def test_a_tip_is_shifted_by_its_gap(name: str) -> None:
    check(name, problem(TIP, PLATE, target=(1.2, 1.1)), 1.25 - 0.6 - 0.275)


@pytest.mark.sampled(3)
@EQUATIONS
def test_an_overlap_is_undone(name: str) -> None:
    check(name, problem(TIP, PLATE, target=(2.2, 1.1)), 1.1 + 0.275 - 1.25)


@EVERY
def test_a_clearance_is_kept(name: str) -> None:
    """A grid of 1e-4 finds the next node, and an interior point method stops inside."""
    asked = problem(TIP, PLATE, goal="clear", clearance=0.05, target=(2.2, 1.1))
    check(name, asked, 0.175, {key: own / 0.1 for key, own in LOOSE.items()}.get(name, EXACT))


@EQUATIONS
def test_two_directions_share_the_way(name: str) -> None:
    """The gap closes along x alone: with a slanted second direction the shortest way mixes both."""
    slanted = Translation((1.0, 1.0, 0.0))
    asked = problem(TIP, PLATE, target=(1.2, 1.1), motion=X >> slanted)
    amount = 0.375 / np.hypot(1.0, np.sqrt(0.5))
    check(name, asked, amount, {"differential evolution": 1e-4, "Nelder-Mead": 1e-4}.get(name, EXACT))


@pytest.mark.parametrize("name", [name for name in GENERAL if name != "coal distance + Newton"])
def test_a_keep_out_asks_for_more_than_the_contact(name: str) -> None:
    """It begins before the plate does: the tip's reach of 1.1 must go back to 0.8."""
    block = KeepOut(box_shape(("0.8", -2, -2), (1, 2, 2)).body("block"))
    asked = problem(TIP, PLATE, goal="clear", target=(2.2, 1.1), keep_out=[block])
    check(name, asked, 0.3, {key: own / 0.1 for key, own in LOOSE.items()}.get(name, EXACT))


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", [name for name in GENERAL if not name.startswith("coal")])
def test_a_switching_point_goes_beyond_its_target(name: str) -> None:
    """By every method and by our own: none is smaller, and those that end on their conditions are as small."""
    rng = np.random.default_rng(4)
    one, two = (Body.convex(rng.normal(size=(8, 3)) + shift) for shift in (np.zeros(3), np.array([3.0, 0.5, 0.2])))
    asked = Problem(one, two, nominal=1, tolerance=0.01, requirement="A",
                    motion=X >> Rotation("z"))  # fmt: skip
    own = solve(asked)
    assert own.usable
    loose = {"grid": 0.5, "trust-constr": 0.01, "differential evolution": 0.01, "Nelder-Mead": 0.01}
    check(name, asked, own.amount, loose.get(name, EXACT))


@pytest.mark.parametrize("name", ["SLSQP", "IPOPT, full model", "coal in the loop"])
def test_a_displacement_is_made_least(name: str) -> None:
    """Turning may help the weighted amount, not the largest displacement: a tip turned is no nearer."""
    motion = X >> Translation("z") >> Rotation("z")
    check(name, problem(TIP, PLATE, target=(1.2, 1.1), motion=motion, amount="displacement"), 0.375)


def test_the_full_model_is_a_stage_that_agrees_with_the_others() -> None:
    asked = problem(TIP, PLATE, target=(1.2, 1.1), motion=X >> Rotation("z"))
    full, own = solve(asked, model="full"), solve(asked)
    assert full.usable
    assert full.amount == pytest.approx(own.amount, rel=1e-7)
    assert full.modelled["constraints"] > 14
    assert full.modelled["part_pairs_kept"] == full.modelled["part_pairs_total"] == 1


def test_the_full_model_is_forced_only() -> None:
    assert "full" not in solve(problem(TIP, PLATE, target=(1.2, 1.1), motion=X >> Rotation("z"))).stage


# --------------------------------------------------------------------------------------------------------- refusals


AT = {"goal": "at", "nominal": (2.0, 1.0), "target": (2.1, 1.0)}
SEATED = Problem(
    CUBE.body(), CUBE.shifted((2, 0, 0)).body(), motion=X, box=WIDE, goal="seat", nominal=(1.0, 1.0), target=(1.1, 1.0)
)


@pytest.mark.parametrize(
    ("name", "asked", "reason"),
    [
        ("grid", problem(TIP, PLATE, target=(1.2, 1.1)), "meet no equation"),
        ("grid", problem(TIP, PLATE, **AT), "meet no equation"),
        ("coal in the loop", problem(TIP, PLATE, **AT), "does not tell features"),
        ("coal distance + Newton", problem(TIP, PLATE, **AT), "does not tell features"),
        ("coal distance + Newton", problem(TIP, PLATE, target=(1.2, 1.1), limits={"TX": (-1, 1)}), "neither limits"),
        ("IPOPT, full model", SEATED, "no rows for flush contacts"),
    ],
)
def test_a_method_refuses_what_it_cannot_express(name: str, asked: Problem, reason: str) -> None:
    method = next(method for method in METHODS if method.name == name)
    assert reason in (method.refuses(asked) or "")
    assert method.refuses(None) is None
    answer = answered(name, asked)
    assert isinstance(answer, Failure)
    assert reason in answer.reason


# ------------------------------------------------------------------------------------------------------- the settings


def test_every_method_has_settings_of_its_own_and_a_usual_one() -> None:
    assert [method.name for method in METHODS if method.ours] == ["fcdm_opt"]
    assert len({method.name for method in METHODS}) == len(METHODS)
    assert set(USUAL) == {method.name for method in METHODS}
    for method in METHODS:
        assert 2 <= len(method.settings) <= 4
        assert USUAL[method.name] in method.settings


def test_finer_settings_come_nearer() -> None:
    """Of methods that stop short of the least motion, not on it."""
    cases = {"trust-constr": 1e-3, "grid": 1e-2, "coal in the loop": 1e-3, "IPOPT, full model": 1e-3}
    asked = problem(TIP, PLATE, goal="clear", clearance=0.05, target=(2.2, 1.1))
    for method in METHODS:
        if method.name not in cases:
            continue
        errors = []
        for setting in method.settings.values():
            answer = method.prepare(None, setting)([asked.changed()])[0]
            assert isinstance(answer, MotionAnswer)
            errors.append(abs(answer.amount / 0.175 - 1.0))
        assert errors[-1] <= errors[0]
        assert errors[-1] <= cases[method.name]


def test_ours_is_verified_and_certified() -> None:
    asked = problem(TIP, PLATE, target=(1.2, 1.1), motion=X >> Rotation("z"))
    ours = METHODS[0]
    for setting in ours.settings.values():
        answer = ours.prepare(None, setting)([asked.changed()])[0]
        assert isinstance(answer, MotionAnswer)
        assert judged(asked, answer.q).usable
    away = problem(TIP, PLATE, target=(1.2, 1.1), limits={"TX": (-0.1, 0.1)})
    answer = answered("fcdm_opt", away)
    assert isinstance(answer, Failure)
    assert "INFEASIBLE" in answer.reason


# -------------------------------------------------------------------------------------------------------- the judge


@pytest.mark.parametrize("wrong", [0.0, 0.3749, 0.3751, -0.375])
def test_a_wrong_motion_is_not_verified(wrong: float) -> None:
    asked = problem(TIP, PLATE, target=(1.2, 1.1))
    assert judged(asked, [0.375]).usable
    solution = judged(asked, [wrong])
    assert solution.status is Status.NOT_VERIFIED
    assert solution.certificate is not None
    assert {"pair touches", "touching"} & {check.name for check in solution.certificate.failed}


def test_a_motion_beyond_a_limit_is_not_verified() -> None:
    asked = problem(TIP, PLATE, target=(1.2, 1.1), limits={"TX": (-0.1, 0.1)})
    assert [check.name for check in judged(asked, [0.375]).certificate.failed] == ["limits"]


def test_a_grid_is_as_fine_as_the_paper_prints() -> None:
    """Table 1, B: a translation of 0.25 with 7.0191 degrees; C: -0.1178 with -6 degrees."""
    for value, kind, step in ((0.25, "translation", COARSE), (0.1178, "translation", FINE)):
        assert round(value / step[kind]) * step[kind] == pytest.approx(value, abs=1e-12)
    for degrees, step in ((6.0, COARSE), (7.0191, FINE)):
        assert round(np.radians(degrees) / step["rotation"]) * step["rotation"] == pytest.approx(np.radians(degrees))
