"""Problems: what the arguments mean, and what is refused."""

from __future__ import annotations

import inspect
import json
import math
import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.model.task import Task
from fcdm_opt.motion.motions import Motion, Rotation, Screw, Translation
from fcdm_opt.problem.keys import ARGUMENTS, Arguments, Case
from fcdm_opt.problem.problem import Problem, load_problems
from fcdm_opt.solver import solve

CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
MOVABLE = Body.convex(CUBE, seed=[0, 0, 0], name="cube")

# A gable with its ridge, at x = 1 and y = 1/4, towards the cube; d = (2, 1/4, 0).
GABLE = Body.convex(
    [[1, 0.25, -2], [1, 0.25, 2], [2, -0.75, -2], [2, -0.75, 2], [2, 1.25, -2], [2, 1.25, 2]],
    seed=[2, 0.25, 0],
    name="gable",
)
PLATE = Body.convex(CUBE * [0.5, 4, 4] + [1.25, 0, 0], seed=[1.25, 0, 0], name="plate")


def problem(static: Body = PLATE, **arguments: object) -> Problem:
    given: dict = {"motion": Translation("z") >> Rotation("z"), "target": (1.0, 1.0)}
    if "requirement" in arguments:
        given = {"motion": given["motion"], "tolerance": 0.02}
    return Problem(MOVABLE, static, **{**given, **arguments})


# In direction n = (1, 0): h_1 = 1/2, h_2 = 1, c = 2, so rho_1 / 2 + rho_2 = 2 while the ridge meets the cube's face,
# that is while 1/4 <= rho_1 / 2. Beyond that, the cube's edge meets the lower slope, n = (1, 1): rho_1 + rho_2 = 9/4.
RIDGE = (0.5, 1.75)
BOX = ((0.25, 3.0), (0.25, 3.0))


def test_nominal_by_number_is_the_switching_point_and_a_near_pair_is_the_same_one() -> None:
    numbered = problem(GABLE, nominal=1, box=BOX, requirement="A")
    near = problem(GABLE, nominal=(RIDGE[0] * (1 + 4e-10), RIDGE[1] * (1 - 4e-10)), box=BOX, requirement="A")
    far = problem(GABLE, nominal=(RIDGE[0] * (1 + 4e-8), RIDGE[1]), box=BOX, requirement="A", snap=1e-9)
    np.testing.assert_allclose(numbered.nominal_pair, RIDGE, rtol=1e-14)
    assert near.nominal_pair.tolist() == numbered.nominal_pair.tolist()
    assert near.nominal_contact.index == numbered.nominal_contact.index == 1
    assert (numbered.goal, near.goal, far.goal) == ("beyond", "beyond", "touch")
    assert far.nominal_pair[0] == RIDGE[0] * (1 + 4e-8)


def test_a_pair_inside_a_segment_is_that_segment_and_drawn_is_one_one() -> None:
    inside = problem(nominal=(1.5, 2.0), requirement="A")
    np.testing.assert_allclose(np.cross([*inside.nominal_contact.line], [0.5, 0.25, 1.25]), 0, atol=1e-15)
    assert inside.goal == "seat"  # a face of the cube lies flush on the plate
    drawn = problem()
    assert drawn.nominal_pair.tolist() == [1.0, 1.0]
    assert drawn.nominal_contact is None


@pytest.mark.parametrize(
    ("tolerance", "requirement", "factors"),
    [
        (0.02, "A", (1.02, 1.02)),
        (0.02, "B", (1.02, 0.98)),
        (0.02, "C", (0.98, 1.02)),
        (0.02, "D", (0.98, 0.98)),
        ((0.25, 0.5), "B", (1.25, 0.5)),
        ((0.25, 0.5), "C", (0.75, 1.5)),
        (((0.125, 0.25), (0.5, 0.75)), "A", (1.25, 1.75)),
        (((0.125, 0.25), (0.5, 0.75)), "D", (0.875, 0.5)),
        (((0.125, 0.25), (0.5, 0.75)), "C", (0.875, 1.75)),
        (0, "A", (1, 1)),
    ],
)
def test_target_is_nominal_times_one_plus_tau_times_sign(tolerance: object, requirement: str, factors: tuple) -> None:
    made = problem(nominal=(1.5, 2.0), tolerance=tolerance, requirement=requirement)
    np.testing.assert_allclose(made.target, np.array([1.5, 2.0]) * factors, rtol=1e-15)
    assert made.signs.tolist() == {"A": [1, 1], "B": [1, -1], "C": [-1, 1], "D": [-1, -1]}[requirement]
    assert made.tolerance.shape == (2, 2)


def test_explicit_target_gives_its_own_signs() -> None:
    assert problem(nominal=(1.5, 2.0), target=(1.6, 2.0)).signs.tolist() == [1, 0]
    assert problem(nominal=(1.5, 2.0), target=[1.4, 2.5]).signs.tolist() == [-1, 1]
    assert problem(GABLE, nominal=1, box=BOX, target=(0.4, 2.0), goal="beyond").signs.tolist() == [-1, 1]


def test_weights_limits_and_length_are_resolved_by_parameter() -> None:
    plain = problem()
    assert plain.length == pytest.approx(math.sqrt(3) / 2, rel=1e-15)
    assert plain.weights.tolist() == [1.0, plain.length]
    assert plain.limits.tolist() == [[-math.inf, math.inf]] * 2
    given = problem(length=3.0, weights={"TZ": 7}, limits={"RZ": (0.1, math.inf)})
    assert given.weights.tolist() == [7.0, 3.0]
    assert given.limits.tolist() == [[-math.inf, math.inf], [0.1, math.inf]]
    screw = problem(motion=Screw("seeds", pitch=4.0), length=3.0)
    assert screw.weights.tolist() == [5.0]


def test_goals_that_track_no_nominal_contact_need_no_curve(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_curve(*_: object, **__: object) -> None:
        raise AssertionError("the curve was computed")

    monkeypatch.setattr("fcdm_opt.curve.decision_curve.decision_curve", no_curve)
    for goal in ("touch", "clear"):
        assert problem(goal=goal).goal == goal
    for asked in ({}, {"requirement": "A"}):  # the default depends on the nominal contact
        with pytest.raises(AssertionError, match="the curve was computed"):
            problem(**asked)


def test_the_curve_is_computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    from fcdm_opt.curve import decision_curve as module

    calls, real = [], module.decision_curve
    monkeypatch.setattr(module, "decision_curve", lambda *a, **k: calls.append(k) or real(*a, **k))
    made = problem(GABLE, nominal=1, box=BOX, requirement="A")
    assert made.curve is made.curve
    assert calls == [{"box": BOX}]


def test_resolved_values_are_read_only() -> None:
    made = problem(GABLE, nominal=1, box=BOX, requirement="A")
    for array in (made.target, made.signs, made.nominal_pair, made.weights, made.limits, made.tolerance):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 5.0
    with pytest.raises(AttributeError):
        made.goal = "at"


def test_changed_asks_the_question_anew() -> None:
    beyond = problem(GABLE, nominal=1, box=BOX, requirement="A", limits={"TZ": (-1, 1)}, weights={"RZ": 2.0})
    touch = beyond.changed(goal="touch", tolerance=0.25, motion=beyond.motion)
    assert (beyond.goal, touch.goal) == ("beyond", "touch")
    np.testing.assert_allclose(touch.target, np.array(RIDGE) * 1.25, rtol=1e-14)
    assert touch.limits.tolist() == beyond.limits.tolist()
    assert touch.weights.tolist() == beyond.weights.tolist()


def test_changed_hands_on_the_curve_where_it_stays_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    from fcdm_opt.curve import decision_curve as module

    made = problem(GABLE, nominal=1, box=BOX, requirement="A")
    calls, real = [], module.decision_curve
    monkeypatch.setattr(module, "decision_curve", lambda *a, **k: calls.append(a) or real(*a, **k))
    for asked in ({"tolerance": 0.01}, {"requirement": "B"}, {"nominal": 1}, {"goal": "at"}, {"snap": 0.0}):
        other, anew = made.changed(**asked), Problem(**{**made.request, **asked})
        assert other.curve is made.curve
        assert (other.goal, other.target.tolist()) == (anew.goal, anew.target.tolist())
        assert (str(other.nominal_features), other.nominal) == (str(anew.nominal_features), anew.nominal)
    calls.clear()
    wider = made.changed(box=((0.4, 4.0), (0.4, 4.0)))
    larger = made.changed(static=made.static.scaled(1.01))
    assert wider.curve is not made.curve
    assert larger.curve is not made.curve
    assert calls == [(made.movable, made.static), (made.movable, larger.static)]


BAD = [
    ({"tolerance": -0.1, "requirement": "A"}, "tolerance", "-0.1", "tau_1"),
    ({"tolerance": (0.1, 0.2, 0.3), "requirement": "A"}, "tolerance", "0.3", "tau_1"),
    ({"tolerance": ((0.1, 0.2), 0.3), "requirement": "A"}, "tolerance", "0.3", "tau_1"),
    ({"tolerance": math.nan, "requirement": "A"}, "tolerance", "nan", "tau_1"),
    ({"tolerance": True, "requirement": "A"}, "tolerance", "True", "tau_1"),
    ({"tolerance": 1.0, "requirement": "D"}, "tolerance", "1.0", "below 1"),
    ({"tolerance": None, "requirement": "A"}, "tolerance", "no tolerance", "requirement and tolerance"),
    ({"tolerance": 0.02}, "tolerance", "0.02", "target alone"),
    ({"requirement": "E"}, "requirement", "'E'", '"A"'),
    ({"requirement": "A", "target": (1, 1)}, "requirement", "'A'", "target (rho_1, rho_2)"),
    ({"target": None}, "requirement", "neither", "target (rho_1, rho_2)"),
    ({"target": (1.0, 0.0)}, "target", "0.0", "> 0"),
    ({"target": (1.0, math.inf)}, "target", "inf", "> 0"),
    ({"nominal": 0}, "nominal", "0", '"drawn"'),
    ({"nominal": True}, "nominal", "True", '"drawn"'),
    ({"nominal": "sketched"}, "nominal", "sketched", '"drawn"'),
    ({"nominal": (1.0, -1.0)}, "nominal", "-1.0", '"drawn"'),
    ({"nominal": 2}, "nominal", "2", "no switching point"),
    ({"static": GABLE, "nominal": 2, "box": BOX}, "nominal", "2", "one of 1: 1 at (0.5, 1.75)"),
    ({"goal": "at"}, "nominal", "[1.0, 1.0]", "a pair on the curve"),
    ({"goal": "beyond"}, "nominal", "0.5 apart as drawn", '"touch"'),
    ({"goal": "beyond", "nominal": (1.5, 2.0)}, "goal", "beyond", '"at" or "touch"'),
    ({"static": GABLE, "goal": "beyond", "nominal": 1, "box": BOX, "target": (0.5, 2)}, "target", "0.5", "both scales"),
    ({"goal": "seat"}, "nominal", "[1.0, 1.0]", "a pair on the curve"),
    ({"goal": "touching"}, "goal", "touching", '"touch"'),
    ({"goal": 3}, "goal", "3", '"touch"'),
    ({"pair": "overlap"}, "pair", "overlap", '"clear"'),
    ({"path": "straight"}, "path", "straight", '"coherent"'),
    ({"amount": "way"}, "amount", "unknown amount; found 'way'", '"weighted", "displacement", or a CasADi expression'),
    ({"amount": 3}, "amount", "int", '"weighted"'),
    ({"keep_out": GABLE}, "keep_out", "Body", "a tuple of KeepOut or Body"),
    ({"keep_out": (GABLE, "wall")}, "keep_out[2]", "str", "a KeepOut or a Body"),
    ({"keep_out": [GABLE, PLATE, GABLE]}, "keep_out[3].name", "'gable'", "KeepOut(body, name=...)"),
    ({"resolution": 0}, "resolution.TZ", "0", "> 0"),
    ({"resolution": {"TZ": math.inf}}, "resolution.TZ", "inf", "> 0"),
    ({"resolution": {"TX": 0.1}}, "resolution.TX", "TX", "TZ, RZ"),
    ({"resolution": {}}, "resolution", "{}", "a number > 0"),
    ({"resolution": "fine"}, "resolution", "fine", "TZ, RZ"),
    ({"features": "V1F2"}, "features", "V1F2", "two labels"),
    ({"features": ("V1F2(P1V1; P2V1,V2,V3)",)}, "features", "V1F2", "two labels"),
    ({"features": ("a", "b"), "goal": "touch"}, "features", "touch", '"beyond", "at" or "seat"'),
    ({"features": ("a", "b"), "nominal": (1.5, 2.0)}, "features", "switching points", '"beyond", "at" or "seat"'),
    (
        {"features": ("a", "b"), "static": GABLE, "nominal": 1, "box": BOX, "goal": "at"},
        "features[1]",
        "a",
        "V1F2(P1V6; P2V2,V3,V5)",
    ),
    (
        {"features": ("V1F2(P1V1; P2V2,V3,V5)",) * 2, "static": GABLE, "nominal": 1, "box": BOX, "goal": "at"},
        "features[1]",
        "V1F2",
        "F1E2(P1V5,V6,V7,V8; P2V1,V2)",
    ),
    ({"clearance": 0.1}, "clearance", "0.1", '"clear"'),
    ({"clearance": -0.1, "goal": "clear"}, "clearance", "-0.1", ">= 0"),
    ({"clearance": 0.1, "goal": "touch", "pair": "clear"}, "pair", "clearance 0.1", "clearance = 0"),
    ({"box": ((0.8, 3.0), (3.0, 0.8))}, "box", "(3.0, 0.8)", "low < high"),
    ({"box": ((0.0, 3.0), (0.8, 3.0))}, "box", "0.0", "0 < low"),
    ({"box": (0.8, 3.0)}, "box", "0.8", "low_1"),
    ({"length": 0}, "length", "0", "> 0"),
    ({"snap": -1}, "snap", "-1", ">= 0"),
    ({"weights": {"TZ": 0}}, "weights.TZ", "0", "> 0"),
    ({"weights": {"TY": 1}}, "weights.TY", "TY", "TZ, RZ"),
    ({"weights": [1, 1]}, "weights", "[1, 1]", "TZ, RZ"),
    ({"limits": {"RX": (0, 1)}}, "limits.RX", "RX", "TZ, RZ"),
    ({"limits": {"RZ": (1, 0)}}, "limits.RZ", "(1, 0)", "lower <= upper"),
    ({"limits": {"RZ": (math.nan, 0)}}, "limits.RZ", "nan", "lower <= upper"),
    ({"limits": {"RZ": (math.inf, math.inf)}}, "limits.RZ", "inf", "lower <= upper"),
    ({"limits": {"RZ": 1}}, "limits.RZ", "1", "(lower, upper)"),
    ({"published": (1.0,)}, "published", "(1.0,)", "TZ, RZ"),
    ({"published": (1.0, math.nan)}, "published", "nan", "TZ, RZ"),
    ({"published": (1.0, 10**400)}, "published", "1000", "TZ, RZ"),
    ({"tolerance": 10**400, "target": None, "requirement": "A"}, "tolerance", "1000", "finite"),
    ({"tolerance": (10**5000, 0), "target": None, "requirement": "A"}, "tolerance", "too many digits", "finite"),
    ({"target": (1.0, 10**400)}, "target", "1000", "> 0"),
    ({"nominal": 10**400}, "nominal", "1000", "no switching point"),
    ({"length": 10**400}, "length", "1000", "> 0"),
    ({"limits": {"RZ": (-1, 10**400)}}, "limits.RZ", "1000", "lower <= upper"),
    ({"resolution": 10**400}, "resolution", "1000", "TZ, RZ"),
    ({"name": 7}, "name", "7", "string"),
    ({"motion": "z"}, "motion", "'z'", "Motion"),
    ({"static": "plate"}, "static", "'plate'", "Body"),
    ({"static": MOVABLE, "motion": Screw("seeds", pitch=1.0)}, "motion.Screw.axis", "0.0", "a line"),
]


@pytest.mark.parametrize(("arguments", "key", "found", "allowed"), BAD)
def test_bad_input_names_the_argument_what_was_found_and_what_is_allowed(
    arguments: dict, key: str, found: str, allowed: str
) -> None:
    with pytest.raises(InputError) as caught:
        problem(**arguments)
    assert caught.value.key == key
    text = str(caught.value)
    assert found in text.partition(": ")[2]
    assert allowed in text.partition("allowed: ")[2]


def test_an_argument_that_no_problem_has_is_told_with_the_one_meant() -> None:
    with pytest.raises(InputError, match=r"unknown key 'tolerence', did you mean 'tolerance'\?") as caught:
        problem(tolerence=0.02)
    assert caught.value.key == "tolerence"
    with pytest.raises(TypeError, match="motion"):
        Problem(MOVABLE, PLATE, target=(1.0, 1.0))  # type: ignore[call-arg]


def test_every_key_of_a_case_is_an_argument_an_attribute_and_in_the_docstring() -> None:
    arguments = dict(inspect.signature(Problem).parameters)
    assert arguments.pop("unknown").kind is inspect.Parameter.VAR_KEYWORD
    names = list(arguments)
    assert names[:2] == ["movable", "static"]
    assert {*names} == {*ARGUMENTS}
    for name, key in Arguments.model_fields.items():
        default = arguments[name].default
        assert (default is inspect.Parameter.empty) == key.is_required(), name
        assert key.is_required() or default == (key.default or None if key.default == {} else key.default), name
    assert {*Case.model_fields} < {*names}
    made = problem()
    for name in names:
        assert hasattr(made, name)
        assert name in made.request
        assert re.search(rf"^    (\w+, )*{name}(, \w+)* : ", str(Problem.__doc__), re.M), name


MOTIONS = [
    Translation("z") >> Rotation("z", centre="origin"),
    Translation((0.3, -0.1, 0.7)) >> Rotation((1.0, 2.0, 3.0), centre=(0.1, 0.2, 0.3)) >> Rotation("-x"),
    Screw("seeds", pitch=math.degrees(1.0)),
    Screw(((0.1, 0.2, 0.3), (0.3, -0.1, 0.7)), pitch="free") >> Translation("-y"),
    Screw("seeds", pitch=math.inf) >> Screw("seeds", pitch=-math.inf),
    Screw(((0.1, 0.2, 0.3), (0.3, -0.1, 0.7)), pitch=0.0),
]


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: "+".join(p.name for p in motion.parameters))
def test_plain_data_gives_the_same_problem_bit_for_bit(motion: Motion) -> None:
    names = [parameter.name for parameter in motion.parameters]
    rng = np.random.default_rng(len(names))
    numbers = rng.normal(size=len(names))
    first = Problem(
        MOVABLE,
        GABLE,
        motion=motion,
        nominal=1,
        tolerance=((0.1, 0.02 / 3), (0.3, 0.04)),
        requirement="B",
        box=BOX,
        limits={names[-1]: (-1 / 3, math.inf), names[0]: (-math.inf, 1 / 7)},
        weights={names[-1]: 1 / 7},
        goal="at",
        pair="clear",
        clearance=1 / 3,
        path="free",
        length=1 / 9,
        snap=1e-4,
        name="case",
        published=numbers,
        published_text="in words",
    )
    text = json.dumps(first.to_dict(), allow_nan=False)
    second = Problem.from_dict(json.loads(text))
    assert json.dumps(second.to_dict(), allow_nan=False) == text
    for key in ("target", "signs", "nominal_pair", "weights", "limits", "tolerance"):
        assert getattr(second, key).tobytes() == getattr(first, key).tobytes(), key
    for key in ("goal", "pair", "clearance", "path", "length", "snap", "name", "published", "published_text", "box"):
        assert getattr(second, key) == getattr(first, key), key
    seeds = first.movable.seed, first.static.seed
    pose = [p.motion.transform(numbers, *seeds).tobytes() for p in (first, second)]
    assert pose[0] == pose[1]
    assert [p.movable.name + p.static.name for p in (first, second)] == ["cubegable"] * 2


def test_bodies_of_parts_come_back_bit_for_bit() -> None:
    points = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2))]) / 3 + [
        2.0,
        0.0,
        0.0,
    ]
    rows = [[0, 1, 2, 3], [0, 3, 4, 5]]
    ell = Body.from_parts(points, parts=[[*row, *(k + 6 for k in row)] for row in rows], seed=[0.1, 0.2, 0.3], name="L")
    first = problem(ell)
    second = Problem.from_dict(json.loads(json.dumps(first.to_dict())))
    assert first.to_dict()["bodies"]["static"]["parts"][1] == [1, 4, 5, 6, 7, 10, 11, 12]
    assert second.static.faces == first.static.faces
    assert second.static.seed.tobytes() == first.static.seed.tobytes()
    for one, two in zip(first.static.parts, second.static.parts, strict=True):
        assert one.vertices.tobytes() == two.vertices.tobytes()
        assert one.elements == two.elements
        assert one.loops == two.loops


def test_plain_data_with_two_cases_is_refused() -> None:
    data = problem().to_dict()
    data["case"] *= 2
    data["case"][1] = {**data["case"][1], "name": "other"}
    with pytest.raises(InputError, match="more than one case; found 2; allowed: one"):
        Problem.from_dict(data)


# ----------------------------------------------------------------------------- nominal pairs slightly off the curve


def plate_at(gap: float, seed: float = 0.25) -> Body:
    """A plate beside the cube: gap(rho) = 1/2 + seed + gap - rho_1 / 2 - seed rho_2, with its seed that deep inside."""
    depth = 0.5 + gap
    return Body.convex(CUBE * [0.5, 4, 4] + [depth + 0.25, 0, 0], seed=[depth + seed, 0, 0], name="plate")


@pytest.mark.parametrize("gap", [1e-7, -1e-7, 6e-7])
@pytest.mark.parametrize("goal", ["at", "seat", None])
@pytest.mark.parametrize("nominal", ["drawn", (1.0, 1.0)])
def test_a_nominal_pair_slightly_off_the_curve_is_closed_to_its_nearest_point(
    goal: str | None, gap: float, nominal: object
) -> None:
    made = problem(plate_at(gap), nominal=nominal, goal=goal, requirement="A")
    assert made.goal == (goal or "seat")
    nearest = np.array([1.0, 1.0]) + gap * np.array([0.5, 0.25]) / (0.5**2 + 0.25**2)
    np.testing.assert_allclose(made.nominal_pair, nearest, rtol=1e-15, atol=1e-14)
    np.testing.assert_allclose(made.target, 1.02 * nearest, rtol=1e-14)
    assert made.nominal_contact.feature.label == "F1F2(P1V5,V6,V7,V8; P2V1,V2,V3,V4)"
    assert made.snapped is not None
    assert made.snapped.asked.tolist() == [1.0, 1.0]
    assert made.snapped.pair.tolist() == made.nominal_pair.tolist()
    assert made.snapped.gap == pytest.approx(gap, rel=1e-6)
    assert made.changed(goal="at").snapped.gap == made.snapped.gap
    again = Problem.from_dict(json.loads(json.dumps(made.to_dict())))
    assert again.nominal == made.nominal
    assert again.target.tobytes() == made.target.tobytes()


@pytest.mark.parametrize(
    ("gap", "arguments"), [(1e-5, {}), (5e-6, {}), (-1e-5, {}), (1e-7, {"snap": 1e-9}), (1e-7, {"snap": 0})]
)
def test_a_larger_gap_is_refused_with_its_size_and_the_nearest_point(gap: float, arguments: dict) -> None:
    near = 1.0 + gap * 0.5 / (0.5**2 + 0.25**2)
    for goal in ("at", "seat"):
        with pytest.raises(InputError) as caught:
            problem(plate_at(gap), goal=goal, **arguments)
        assert caught.value.key == "nominal"
        text = str(caught.value)
        assert f"cube and plate {'overlap by' if gap < 0 else 'are'} {abs(gap):.6g} " in text
        assert ('write goal = "clear"' in text) == (gap > 0)
        assert "from a pose sensed: ask about the parts as drawn, and correct by transform @ inv(sensed)" in text
        nearest = text.partition("nearest to it there, [")[2].partition(",")[0]
        assert float(nearest) == pytest.approx(near, abs=1e-9)
        assert "a larger snap" in text
    assert problem(plate_at(gap), **arguments).goal == "touch"
    wider = problem(plate_at(gap), goal="at", **{**arguments, "snap": 1e-4})
    assert wider.nominal_pair[0] == pytest.approx(near, rel=1e-12)


@pytest.mark.parametrize("goal", ["touch", "clear"])
@pytest.mark.parametrize("gap", [1e-7, -1e-7, 0.25, -0.25])
def test_touch_and_clear_take_the_nominal_pair_as_base_sizes_only(goal: str, gap: float) -> None:
    made = problem(plate_at(gap), goal=goal, requirement="B")
    assert made.snapped is None
    assert made.nominal_pair.tolist() == [1.0, 1.0]
    assert made.target.tolist() == [1.02, 0.98]
    assert made.nominal_contact is None


def test_a_default_goal_without_a_contact_leaves_the_pair_as_it_is() -> None:
    """The gable's ridge touches the cube's face within `snap`, on a line: neither flush nor a switching point."""
    tip = Body.convex([[0.5 + 1e-7, 0.1, 0.1], [1, 0.5, 0], [1, -0.5, 0.5], [1, -0.5, -0.5]], seed=[0.9, 0, 0])
    made = problem(tip, requirement="A")
    assert made.goal == "touch"
    assert made.snapped is None
    assert made.target.tolist() == [1.02, 1.02]
    assert problem(tip, requirement="A", goal="at").snapped is not None


def test_a_switching_point_within_snap_is_meant_by_goal_beyond() -> None:
    """On the curve or beside it: the paper prints scales to seven digits."""
    for off in ((3e-7, -3e-7), (0.0, 5e-7), (-4e-7, 4e-7 * RIDGE[0] / RIDGE[1] / 2)):
        pair = tuple(x * (1 + e) for x, e in zip(RIDGE, off, strict=True))
        made = problem(GABLE, nominal=pair, box=BOX, requirement="A", goal="beyond")
        assert made.nominal_contact.index == 1
        assert made.nominal_pair.tolist() == problem(GABLE, nominal=1, box=BOX, requirement="A").nominal_pair.tolist()
        assert made.snapped.asked.tolist() == list(pair)
        assert made.nominal == pair
    exact = problem(GABLE, nominal=1, box=BOX, requirement="A")
    assert exact.snapped is None
    far = tuple(x * (1 + 3e-6) for x in RIDGE)
    with pytest.raises(InputError, match="nominal"):
        problem(GABLE, nominal=far, box=BOX, requirement="A", goal="beyond", snap=1e-7)


def test_a_problem_closed_to_the_curve_is_solved_and_says_so() -> None:
    from fcdm_opt.solver import solve

    shift = Translation("x") >> Translation("y")
    solution = solve(problem(plate_at(1e-7), goal="seat", requirement="A", motion=shift))
    assert solution.usable, solution.certificate
    snapped = solution.to_dict()["snapped"]
    assert snapped["asked"] == [1.0, 1.0]
    assert snapped["gap"] == pytest.approx(1e-7, rel=1e-6)
    # face on face at the target: 0.02 of both nominal half-widths, less nothing of the gap, which the pair has closed
    rho = solution.problem.nominal_pair
    assert solution.parameters["TX"] == pytest.approx(-0.02 * (rho[0] * 0.5 + rho[1] * 0.25), rel=1e-9)
    assert solve(problem(plate_at(0.0), goal="seat", requirement="A", motion=shift)).to_dict()["snapped"] is None


# ---------------------------------------------------------------------------------------- more than two lines that meet

TIP = np.array([[0.5, 0, 0], [-0.5, 0, 0], [0, 0.5, 0], [0, -0.5, 0], [0, 0, 0.5], [0, 0, -0.5]])
PEAK = Body.convex(TIP, seed=[0, 0.05, 0.08], name="peak")  # its vertex 1 meets that of the other at (1, 1)
OTHER_PEAK = Body.convex(
    np.vstack([[0.5, 0, 0], TIP[[0, 2, 3, 4, 5]] * [1, 1.2, 0.9] + np.array([1.0, 0.02, -0.03])]),
    seed=[1, -0.07, 0.04],
    name="other peak",
)


def peaks(**arguments: object) -> Problem:
    given: dict = {"nominal": 1, "tolerance": 0.02, "requirement": "A", "motion": Translation("x") >> Translation("y")}
    return Problem(PEAK, OTHER_PEAK, **{**given, **arguments})


def test_where_two_vertices_meet_any_two_lines_may_be_named() -> None:
    usual = peaks()
    np.testing.assert_allclose(usual.nominal_pair, [1, 1], rtol=1e-12)
    with pytest.raises(InputError) as caught:
        peaks(features=("V1F2(P1V1; P2V1,V2,V3)", "V1F2(P1V1; P2V1,V2,V4)"))
    labels = caught.value.allowed.split("; ")
    labels = [f"{one}; {two}" for one, two in zip(labels[::2], labels[1::2], strict=True)]
    assert labels[:2] == [str(feature) for feature in usual.nominal_features]
    assert len(set(labels)) == len(labels) == 4
    lines = {str(line.feature): line.line for line in usual._tight_lines}
    for line in lines.values():  # all meet at the nominal pair
        assert line[:2] @ [1, 1] == pytest.approx(line[2], rel=1e-12)
    for pair in combinations(labels, 2):
        named = peaks(features=pair)
        assert [str(feature) for feature in named.tracked_features] == list(pair)
        task = Task.of(named)
        rho, _, _ = task.tracked_contact(np.zeros(2))
        np.testing.assert_allclose(rho, [1, 1], rtol=1e-12)
        rows = task.tracked_contact(np.zeros(2))[2]
        np.testing.assert_allclose([row.line for row in rows], [lines[label] for label in pair], rtol=1e-12)
        again = Problem.from_dict(json.loads(json.dumps(named.to_dict())))
        assert again.features == named.features


def test_named_features_are_what_the_solution_tracks() -> None:
    usual = solve(peaks())
    assert usual.usable
    again, own = (solve(peaks(features=[str(f) for f in some])) for some in (usual.features, peaks().nominal_features))
    assert again.usable
    assert (again.amount, again.features) == (pytest.approx(usual.amount, rel=1e-7), usual.features)
    assert own.features == peaks().nominal_features
    assert own.amount >= usual.amount * (1 - 1e-9)


def test_the_same_feature_twice_is_refused() -> None:
    label = str(peaks().nominal_features[0])
    with pytest.raises(InputError, match="parallel"):
        peaks(features=(label, label))


@pytest.mark.parametrize("wrong", ["limits = { TQ = [0.0, 1.0] }", 'name = "A"'])
def test_meshes_were_read_before_keys_of_cases_were_looked_at(wrong: str, tmp_path: Path) -> None:
    """A file that is not there would be told first."""
    bodies = "".join(f'[bodies.{role}]\nfile = "none.stl"\nunit = "mm"\n' for role in ("movable", "static"))
    named = "" if wrong.startswith("name") else 'name = "B"\n'
    text = f'{bodies}[defaults]\nmotion = [{{ translation = "z" }}]\n[[case]]\nname = "A"\n[[case]]\n{named}{wrong}\n'
    (tmp_path / "asked.toml").write_text(text, "utf-8")
    with pytest.raises(InputError) as refused:
        load_problems(tmp_path / "asked.toml")
    assert refused.value.key in ("case[2] 'B'.limits.TQ", "case[2] 'A'.name")


def test_problems_that_ask_the_same_are_equal() -> None:
    folder = Path(__file__).parents[2] / "problems"
    for name in ("example1", "peg_square", "bracket", "keyway"):
        for asked in load_problems(folder / f"{name}.toml"):
            again = Problem.from_dict(asked.to_dict())
            assert again == asked
            assert hash(again) == hash(asked)
            assert asked != asked.changed(name="another")
            assert asked != asked.changed(snap=1e-5)
            assert asked != 1
