"""Solutions as plain data: round trips, advice, and what is refused."""

from __future__ import annotations

import json
import math
from dataclasses import FrozenInstanceError, fields, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from cases import CUBE, box_shape

import fcdm_opt as fo
from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError
from fcdm_opt.judge.certificate import verify
from fcdm_opt.motion.motions import Rotation, Translation
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import UNCLAIMED, UNLIMITED, Certificate, Check, Solution, Status
from fcdm_opt.solver import solve

CROSSING = box_shape((3, 3, -1), (5, 7, 1))  # lines rho_1 + rho_2 = 4 and rho_1 + 2 rho_2 = 5, crossing at (3, 1)


def asked(**arguments: Any) -> Problem:
    motion = Translation("x") >> Translation("y")
    given = {"nominal": (3, 1), "motion": motion, "box": ((0.5, 5), (0.5, 5)), **arguments}
    return Problem(CUBE.body("one"), CROSSING.body("two"), **given)


QUESTIONS: dict[str, tuple[Status, dict[str, Any]]] = {
    "solved": (Status.SOLVED, {"tolerance": 0.02, "requirement": "A"}),
    "overlapping": (Status.PAIR_OVERLAPS, {"tolerance": 0.02, "requirement": "B"}),
    "satisfied": (Status.ALREADY_SATISFIED, {"target": (1, 1), "goal": "clear"}),
    "infeasible": (Status.INFEASIBLE, {"target": (1, 1), "goal": "touch", "motion": Translation("z")}),
    "not found": (Status.NOT_FOUND, {"target": (1, 1), "goal": "touch",
                                     "limits": {"TX": (-0.1, 0.1), "TY": (-0.1, 0.1)},
                                     "motion": Translation("x") >> Translation("y") >> Rotation("z") >> Rotation("x")}),
    "turned": (Status.SOLVED, {"target": (2.5, 1), "goal": "touch", "motion": Rotation("z") >> Translation((1, 1, 0))}),
}  # fmt: skip
EVERY_QUESTION = pytest.mark.parametrize("question", QUESTIONS)


@cache
def solution(question: str) -> Solution:
    return solve(asked(**QUESTIONS[question][1]))


def rejected() -> Solution:
    """A motion that the judge rejects."""
    wrong = replace(solution("solved"), rho=np.array([3.0, 1.0]))
    return wrong.with_certificate(verify(wrong), {"verify": 0.0})


def through_json(data: Any) -> Any:
    return json.loads(json.dumps(data, allow_nan=False))


# ------------------------------------------------------------------------------------------------------- round trips


@EVERY_QUESTION
def test_a_solution_survives_json_bit_for_bit(question):
    original = solution(question)
    assert original.status is QUESTIONS[question][0]
    data = original.to_dict()
    again = Solution.from_dict(through_json(data))
    assert again.to_dict() == data
    assert through_json(data) == data
    for key in ("transform", "rho", "pair"):
        one, two = getattr(original, key), getattr(again, key)
        assert (one is None) == (two is None)
        if one is not None:
            np.testing.assert_array_equal(one, two)
            assert not two.flags.writeable
    for key in ("amount", "lower_bound", "pair_gap"):
        np.testing.assert_array_equal(getattr(original, key), getattr(again, key), err_msg=key)
    for key in ("status", "parameters", "features", "pair_state", "active", "modelled", "stage", "seconds", "usable"):
        assert getattr(original, key) == getattr(again, key), key
    assert again.certificate.passed == original.certificate.passed


@EVERY_QUESTION
def test_a_solution_read_back_is_judged_the_same(question):
    original, again = solution(question), Solution.from_dict(through_json(solution(question).to_dict()))
    read = [check for check in verify(again).checks if check.name != "certificate"]  # which only what is read has
    for one, two in zip(verify(original).checks, read, strict=True):
        assert one[:2] == two[:2]
        np.testing.assert_array_equal(one[2:4], two[2:4])


@EVERY_QUESTION
def test_a_solution_read_back_asks_the_same_question(question):
    again = Solution.from_dict(through_json(solution(question).to_dict()))
    assert solve(again.problem).to_dict() | {"seconds": None} == solution(question).to_dict() | {"seconds": None}


def test_every_number_of_a_certificate_survives_even_those_json_lacks():
    checks = tuple(
        Check(f"check {k}", False, value, limit, "note")
        for k, (value, limit) in enumerate([(math.nan, 0.0), (math.inf, 1e-9), (-math.inf, -0.0), (1 / 3, 5e-324)])
    )
    original = replace(solution("solved"), certificate=Certificate(checks))
    again = Solution.from_dict(through_json(original.to_dict()))
    for one, two in zip(checks, again.certificate.checks, strict=True):
        assert (one.name, one.passed, one.note) == (two.name, two.passed, two.note)
        np.testing.assert_array_equal([one.value, one.limit], [two.value, two.limit])


def test_a_solution_that_nobody_judged_survives_too():
    original = replace(solution("solved"), certificate=None)
    again = Solution.from_dict(through_json(original.to_dict()))
    assert again.certificate is None
    assert not again.usable


@EVERY_QUESTION
def test_plain_data_tell_status_advice_and_motion(question):
    data = solution(question).to_dict()
    assert data["status"] == QUESTIONS[question][0].name
    status, given = QUESTIONS[question]
    assert data["advice"] == (status.value if "limits" in given else UNLIMITED.get(status, status.value))
    assert data["usable"] is solution(question).usable
    found = QUESTIONS[question][0].found
    assert (data["motion"] is not None) == (data["transform"] is not None) == (data["amount"] is not None) == found
    assert set(data["certificate"]) == {"passed", "checks"}
    assert data["features"] == [feature.label for feature in solution(question).features]
    attributes = {item.name for item in fields(Solution)} - {"derivatives"}
    assert attributes <= set(data)
    assert set(data) - attributes == {
        "advice",
        "reason",
        "doubt",
        "usable",
        "motion",
        "keep_out_gaps",
        "contact_gaps",
        "open_contacts",
        "snapped",
        "gap",
        "sensitivity",
    }


def test_the_motion_is_told_in_lengths_and_degrees():
    data = solution("turned").to_dict()
    turn, shift = solution("turned").parameters.values()
    assert data["motion"] == f"RZ {math.degrees(turn):.6g} deg + T {shift:.6g}"


# ----------------------------------------------------------------------------------------------- statuses and verdicts


def test_every_status_gives_advice_of_its_own():
    assert len({status.value for status in Status}) == len(Status) == 9
    for status in Status:
        assert status.value[0].isupper()
        assert status.value.endswith(".")
        assert ":" in status.value


def test_a_motion_exists_exactly_where_the_status_says_so():
    found = {status for status in Status if status.found}
    assert found == {
        *(Status.SOLVED, Status.ALREADY_SATISFIED, Status.PAIR_OVERLAPS, Status.OUTSIDE_FIT, Status.NOT_VERIFIED)
    }
    for question in QUESTIONS:
        own = solution(question)
        assert own.status.found == (own.transform is not None) == bool(own.parameters) == math.isfinite(own.amount)


def test_a_solution_is_usable_only_with_a_passed_certificate():
    own = solution("solved")
    assert own.usable
    assert not replace(own, certificate=None).usable
    assert not replace(own, certificate=Certificate(())).usable
    assert not replace(own, certificate=Certificate((Check("x", False, 1.0, 0.0, ""),))).usable
    assert not replace(own, status=Status.NOT_FOUND).usable
    assert not solution("infeasible").usable


def test_a_rejected_motion_becomes_not_verified_and_others_keep_their_status():
    assert rejected().status is Status.NOT_VERIFIED
    assert not rejected().usable
    assert rejected().seconds == {"verify": 0.0}
    assert rejected().parameters == solution("solved").parameters
    data = through_json(rejected().to_dict())
    assert Solution.from_dict(data).status is Status.NOT_VERIFIED
    assert not any("_" in status.words or status.words != status.words.lower() for status in Status)
    for status in (Status.INFEASIBLE, Status.NOT_FOUND, Status.LEFT_COHERENT_RANGE):
        other = replace(solution("infeasible"), status=status)
        assert other.with_certificate(verify(other), {}).status is status


def test_a_certificate_passes_only_with_checks_that_all_pass():
    good, bad = Check("good", True, 0.0, 1.0, ""), Check("bad", False, 2.0, 1.0, "")
    assert Certificate((good, good)).passed
    assert not Certificate((good, bad)).passed
    assert not Certificate(()).passed
    assert Certificate((good, bad)).failed == (bad,)
    assert Certificate(()).failed == ()


def test_solutions_do_not_change():
    own = solution("solved")
    with pytest.raises(FrozenInstanceError):
        own.amount = 0.0
    for array in (own.rho, own.transform, own.pair):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


# ----------------------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    "key", ["sensitivity", *(item.name for item in fields(Solution) if item.name != "derivatives")]
)
def test_a_missing_key_is_named(key):
    data = solution("solved").to_dict()
    del data[key]
    with pytest.raises(InputError, match=key):
        Solution.from_dict(data)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("status", "DONE"),
        ("status", None),
        ("problem", {}),
        ("problem", None),
        ("parameters", 3),
        ("transform", [[1, 2], [3]]),
        ("transform", "unit"),
        ("amount", "much"),
        ("amount", [1.0]),
        ("rho", {"rho_1": 1}),
        ("rho", ["a", "b"]),
        ("features", ["V1F3"]),
        ("features", 7),
        ("pair", "drawn"),
        ("active", None),
        ("modelled", [1, 2]),
        ("certificate", {"passed": True}),
        ("certificate", {"passed": True, "checks": [{"name": "x"}]}),
        ("seconds", 0.1),
    ],
)
def test_a_wrong_value_is_refused(key, value):
    with pytest.raises(InputError):
        Solution.from_dict(solution("solved").to_dict() | {key: value})


@pytest.mark.parametrize(
    ("key", "value"),
    [("rho", [1.0, 2.0, 3.0]), ("pair", [1.0]), ("pair", None), ("transform", np.eye(3).tolist())],
)
def test_arrays_of_a_wrong_shape_are_refused(key, value):
    with pytest.raises(InputError):
        Solution.from_dict(solution("solved").to_dict() | {key: value})


@pytest.mark.parametrize("data", [None, [], "solution", 3])
def test_what_is_no_mapping_is_refused(data):
    with pytest.raises(InputError):
        Solution.from_dict(data)


def test_features_are_read_back_as_features():
    again = Solution.from_dict(through_json(solution("solved").to_dict()))
    assert all(isinstance(feature, Feature) for feature in again.features)
    assert again.features == solution("solved").features


# ------------------------------------------------------------------------------------- what was printed or told nowhere


def blocks() -> dict[str, Any]:
    """Half a width of each is 1, and they touch: larger by .01 one overlaps by that, by 1 per unit of either scale."""
    return {"a": fo.Box((2, 2, 2), name="a"), "c": fo.Box((2, 6, 6), centre=(2, 0, 0), name="c")}


def test_derivatives_of_an_assembly_were_printed_as_a_raw_dataclass() -> None:
    motions, scales = {"a": Translation("x")}, {"a": 1.01}
    solved = fo.solve(fo.Assembly(parts=blocks(), contacts=[("a", "c")], motions=motions, scales=scales))
    told = str(solved.sensitivity).splitlines()
    assert told == ["derivatives of the amount", "  by scale of a: 1.0", "  by scale of c: 1.0"]


def test_derivatives_of_nothing_had_a_heading_alone() -> None:
    told = str(solution("satisfied").sensitivity)
    assert told == "the amount depends on nothing that is listed, to first order"


def test_a_solution_without_a_bound_was_verified_without_a_word_on_the_smallest() -> None:
    solved = solution("solved")
    assert UNCLAIMED not in str(verify(solved, proof=True))
    unbounded = verify(replace(solved, lower_bound=0.0, evidence=None), proof=True)
    assert unbounded.passed
    assert str(unbounded).endswith(UNCLAIMED)
    assert UNCLAIMED not in str(verify(solution("satisfied"), proof=True))  # of amount 0 nothing is smaller


def test_an_assembly_without_a_fixed_part_is_refused_in_words() -> None:
    every = {part: Translation("x") for part in blocks()}
    for motions, what in ((every, "no part is fixed: each has a motion"), ({}, "no part has a motion")):
        with pytest.raises(InputError, match=what):
            fo.Assembly(parts=blocks(), contacts=[("a", "c")], motions=motions)


def test_plain_data_that_tell_less_than_all_say_so_when_read() -> None:
    asked_again = fo.Problem(*blocks().values(), tolerance=0.02, requirement="A", goal="touch", motion=Translation("x"))
    for found in (asked_again.curve, fo.clearances(asked_again), fo.compare(asked_again, {"x": Translation("x")})):
        with pytest.raises(InputError, match="cannot be read back"):
            type(found).from_dict(through_json(found.to_dict()))


def test_whole_numbers_of_a_certificate_were_read_back_as_others() -> None:
    crate, floor = fo.Box((2, 2, 2), centre=(0, 0, 1)), fo.Box((10, 10, 1), centre=(0, 0, -0.5))
    found = fo.solve(fo.Problem(crate, floor, target=(1.1, 1.0), goal="touch", motion=fo.Translation("z")))
    told = json.dumps(found.to_dict()["certificate"])
    assert json.dumps(fo.Solution.from_dict(json.loads(json.dumps(found.to_dict()))).to_dict()["certificate"]) == told
