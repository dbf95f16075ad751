"""Solvers of others, where they are installed: closed forms, what they refuse, what is said where they are missing."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import pytest

from fcdm_opt import Body, Free, Problem, Rotation, Translation, load_problems
from fcdm_opt.errors import FcdmError
from fcdm_opt_benchmarks.library import MissingLibraryError, dataset_script, library, rounding_upward
from fcdm_opt_benchmarks.method import Failure, MotionAnswer
from fcdm_opt_benchmarks.motions import METHODS, answered
from fcdm_opt_benchmarks.shapes import box, polygon, prism
from fcdm_opt_benchmarks.stability import contacts, motions, worker
from fcdm_opt_benchmarks.stability.contacts.methods import METHODS as OF_CONTACTS

LIBRARIES = {"Drake, SNOPT": "pydrake", "SCIP": "pyscipopt", "codac, proved": "codac"}
CUBE = Body.convex(box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)), seed="box", name="cube")
PLATE = Body.convex(box((1, -2, -2), (1.5, 2, 2)), seed="box", name="plate")
NEAR = Body.convex(box((0.3, -2, -2), (1.5, 2, 2)), seed="box", name="near")
WIDE = ((0.1, 9.0), (0.1, 9.0))


def needs(module: str) -> None:
    with rounding_upward():
        pytest.importorskip(module)


def problem(static: Body = PLATE, **asked: Any) -> Problem:
    return Problem(CUBE, static, **{"target": (1.0, 1.0), "goal": "touch", "box": WIDE, **asked})


@pytest.mark.parametrize("name", LIBRARIES)
@pytest.mark.parametrize(("static", "goal", "amount"), [(PLATE, "touch", 0.5), (NEAR, "clear", 0.2)])
def test_a_shift_along_x(name: str, static: Body, goal: str, amount: float) -> None:
    needs(LIBRARIES[name])
    found = answered(name, problem(static, goal=goal, motion=Translation("x")))
    assert isinstance(found, MotionAnswer), found
    assert found.amount == pytest.approx(amount, abs=1e-8)


@pytest.mark.parametrize("name", ["Drake, SNOPT", "codac, proved"])
def test_a_turn(name: str) -> None:
    needs(LIBRARIES[name])
    asked = problem(motion=Rotation("z"), target=(1.6, 1.0), length=1.0)
    found = answered(name, asked)
    assert isinstance(found, MotionAnswer), found
    assert found.amount == pytest.approx(0.5 * math.asin((1 / 0.8) ** 2 - 1), abs=1e-7)


@pytest.mark.parametrize("name", ["Drake, SNOPT", "SCIP"])
def test_six_parameters_come_apart_by_a_shift(name: str) -> None:
    needs(LIBRARIES[name])
    found = answered(name, problem(NEAR, goal="clear", motion=Free()))
    assert isinstance(found, MotionAnswer), found
    assert found.amount == pytest.approx(0.2, rel=1e-2)
    assert found.amount >= 0.2 * (1 - 1e-6)


@pytest.mark.parametrize(
    ("name", "asked", "word"),
    [
        ("SCIP", {"motion": Translation("x") >> Rotation("z")}, "shifts, or six parameters"),
        ("codac, proved", {"motion": Free()}, "one parameter only"),
        ("Drake, SNOPT", {"motion": Translation("x"), "goal": "at", "nominal": (2.0, 1.0)}, "features"),
        ("SCIP", {"motion": Free(), "limits": {"TX": (-1, 1)}}, "without limits"),
    ],
)
def test_what_they_cannot_express_they_refuse(name: str, asked: Any, word: str) -> None:
    (method,) = (own for own in METHODS if own.name == name)
    said = method.refuses(problem(**asked))
    assert said is not None
    assert word in said


def test_drake_is_not_asked_about_large_prisms_on_which_it_hung() -> None:
    """Two prisms of 1,000 vertices with parallel faces: a distance of Drake's did not return, nor did `bench`."""
    (method,) = (own for own in METHODS if own.name == "Drake, SNOPT")
    for vertices, asked in ((400, True), (1000, False)):
        rim = polygon(vertices // 2, 0.3)
        static = Body.convex(prism(rim, -0.5, 0.5), seed=[0, 0, 0], name="prism")
        said = method.refuses(problem(static, motion=Translation("x")))
        assert (said is None) is asked, said


def test_several_contacts_at_once_are_asked_of_no_rival() -> None:
    asked = load_problems("problems/locating.toml")[0]
    reasons = {own.name: own.refuses(asked) for own in METHODS if not own.ours}
    assert all(reasons.values()), reasons


def test_a_missing_library_is_named_with_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pydrake", None)
    with pytest.raises(MissingLibraryError, match="pip install drake") as raised:
        library("pydrake")
    assert isinstance(raised.value, FcdmError)
    (method,) = (own for own in METHODS if own.name == "Drake, SNOPT")
    with pytest.raises(MissingLibraryError):
        method.prepare(None, 1)
    reply = worker._reply(lambda data: library("pydrake"), {})
    assert "pip install drake" in reply["missing"]


@pytest.mark.parametrize("name", ["MuJoCo distance", "Drake distance"])
def test_distances_of_hulls_apart_and_overlapping(name: str) -> None:
    pytest.importorskip("mujoco" if "MuJoCo" in name else "pydrake")
    own = [case for case in contacts.cases(True, 1) if case.family == "a box on a box"]
    own = [case for case in own if "lifted" in case.name or "inside" in case.name]
    assert own
    for case in own:
        answer = OF_CONTACTS[name](case.data)
        true = float(case.truth["distance"] or -float(case.truth["depth"]))
        assert answer["gap"] == pytest.approx(true, abs=1e-4)


def test_families_of_the_data_set_ask_its_scenes() -> None:
    path = Path(dataset_script("score").__file__).with_name("scenes.json")
    scenes = {own["name"]: own for own in json.loads(path.read_text(encoding="utf-8"))["scenes"]}
    families = {"several contacts at once", "sizes of faces", "curved meshes", "unions as drawn"}
    own = [case for case in motions.cases(False, 1) if case.family in families]
    assert {case.family for case in own} == families
    assert len(own) >= 30
    for case in own:
        truth = scenes[case.name]["answer"]
        assert case.truth.get("amount") == truth.get("amount")
        assert ("none" in case.truth) == ("none" in truth)


def test_intervals_leave_the_processor_rounding_to_nearest() -> None:
    needs("codac")
    third, tiny = 1.0 / 3.0, 2.0**-60
    answered("codac, proved", problem(motion=Translation("x")))
    assert (1.0 + tiny, third * 3.0) == (1.0, 1.0)


def test_failure_of_a_refused_question_is_said() -> None:
    needs("codac")
    assert isinstance(answered("codac, proved", problem(motion=Free())), Failure)
