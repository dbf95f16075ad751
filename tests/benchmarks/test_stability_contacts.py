"""The hard contacts of the stability map: their truth, the judging, and our own methods on the quick ones."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest
from oracles import ExactCurve, exact_curve

from fcdm_opt.errors import InputError
from fcdm_opt_benchmarks.stability import contacts
from fcdm_opt_benchmarks.stability.case import WRONG_BEYOND, Grade, HardCase
from fcdm_opt_benchmarks.stability.contacts import libraries
from fcdm_opt_benchmarks.stability.contacts.scenes import CUBE, SMALL_CUBE, shifted

MOST = 16  # points of a body that the oracle, all triples of them, is asked about
# what the project's list names -> the family that has it
LISTED = {
    "relative openings of random hulls": "random hulls, slightly opened",
    "size 1 against 1e-3": "size 1 against 1e-3",
    "a 1e-6 gap between boxes": "boxes 1e-6 apart",
    "normals at touch": "normals at touch",
    "thin prisms": "thin prisms",
    "coincident and touching cubes": "the same place",
    "FCL's regression pairs": "FCL's boxes",
    "tilted kissing cubes": "kissing cubes",
    "coal #604": "nearly parallel edges",
    "zero thickness": "no thickness",
    "boxes 2 and 100 at 9e4": "boxes at 9e4",
    "rounded cube": "rounded cubes",
    "zero-length edge": "edges of no length",
    "box resting on boxes": "a box on a box",
    "cubes at 100 m": "cubes at 100 m",
    "24 orientations": "parallel boxes",
    "near-parallel": "turned by 1e-3 to 1e-15",
    "vertex on vertex, collinear edges, equal outlines": "flush contacts",
    "seed on a face, at a vertex, outside": "places of the seeds",
    "d = 0": "seeds at one point",
    "d parallel to a face, through a vertex, an edge": "ways between the seeds",
    "size ratio": "size ratio 1e-8 to 1e8",
    "aspect": "aspect 1e4 to 1e8",
    "offset 1e6": "1e6 from the origin",
    "micrometre and kilometre units": "micrometres, kilometres",
    "hulls with 4 and 1e5 vertices": "4 to 100,000 vertices",
    "many coplanar points": "coplanar points",
    "duplicated and interior points": "repeated and inner points",
    "prisms and pyramids": "prisms and pyramids",
    "three or more features": "three features meet",
    "corner of the scale box": "corner of the scale box",
}


@cache
def quick() -> tuple[HardCase, ...]:
    return tuple(contacts.cases(True, 0))


def answered(name: str, case: HardCase) -> Grade:
    """As the runner does: what raises is flagged."""
    try:
        answer = contacts.METHODS[name](case.data)
    except ModuleNotFoundError as reason:
        pytest.skip(f"not installed: {reason}")
    except Exception as reason:
        answer = {"flag": f"{type(reason).__name__}: {reason}"}
    return contacts.judged(case, json.loads(json.dumps(answer)))


def only(name: str, one: Any = CUBE, two: Any = CUBE, **settings: Any) -> HardCase:
    return contacts._case("test", libraries.HardPair(name, one, two, **settings))


def oracle(case: HardCase) -> ExactCurve:
    one, two = case.data["one"], case.data["two"]
    return exact_curve(
        one["vertices"], one["seed"], two["vertices"], two["seed"],
        parts1=one["parts"], parts2=two["parts"], pose=case.data["transform"],
    )  # fmt: skip


# ----------------------------------------------------------------------------------------------------------- the cases


@pytest.mark.slow
def test_every_item_of_the_list_has_cases() -> None:
    assert {*LISTED.values(), "parts as drawn", "meshes that MuJoCo #3383 says touch"} == set(contacts.FAMILIES)
    assert {case.family for case in quick()} == set(contacts.FAMILIES)


@pytest.mark.slow
def test_cases_are_plain_named_once_and_the_same_again() -> None:
    cases = quick()
    names = [(case.family, case.name) for case in cases]
    assert len(set(names)) == len(names)
    drawn = [json.loads(json.dumps([case.data, case.truth])) for case in cases]
    assert drawn == [[case.data, case.truth] for case in quick()]
    for family, scenes in libraries.FAMILIES.items():
        here, there = (scenes(np.random.default_rng(seed)) for seed in (1, 2))
        assert [scene.name for scene in here] == [scene.name for scene in there], family
        assert len({scene.name for scene in here}) == len(here), family


def test_the_numbers_of_the_list_are_there() -> None:
    """Gaps of FCL's boxes and of the nearly parallel ones, as the list gives them; vertices up to 1e5."""
    rng = np.random.default_rng(0)
    found = [contacts._case("", scene).truth["opening"] for scene in libraries.fcl_boxes(rng)]
    assert found == pytest.approx([1.708e-8, -0.0134086, -0.039153, -0.1665, -0.0842204, 0], rel=1e-3, abs=1e-9)
    near = [contacts._case("", scene).truth["opening"] for scene in libraries.nearly_parallel_edges(rng)]
    assert near == pytest.approx([3.575e-6] * len(near), rel=0.01)
    counts = {len(scene.one["vertices"]) for scene in contacts.geometry.vertex_counts(rng)}
    assert {4, 100_000} <= counts
    scenes = libraries.kissing_cubes(rng)
    assert len(scenes) == 35
    kissing = [contacts._case("", scene).truth for scene in scenes[::3]]
    assert {truth["side"] for truth in kissing} >= {-1, 1}  # rounded, few of them touch
    assert max(abs(truth["opening"]) / truth["sizes"][1] for truth in kissing) < 1e-12


# ----------------------------------------------------------------------------------------------------------- the truth


def test_the_truth_is_the_oracles() -> None:
    """Another exact way: all facets of the Minkowski difference. Sides, distances, depths and contact scales."""
    able = [
        case
        for case in quick()
        if case.truth["side"] is not None and max(len(case.data[key]["vertices"]) for key in ("one", "two")) <= MOST
    ]
    sample = [case for k, case in enumerate(able) if k % 6 == 0 or case.truth["side"] == 0 or case.data["one"]["parts"]]
    assert len(sample) > 40
    assert {case.truth["side"] for case in sample} == {-1, 0, 1}
    for case in sample:
        curve, truth, rho = oracle(case), case.truth, case.data["rho"]
        assert curve.side(rho) == truth["side"], case
        if truth["distance"] is not None:
            assert float(truth["distance"]) == pytest.approx(curve.distance(rho), rel=1e-14)
        if truth["depth"] is not None:
            assert float(truth["depth"]) == pytest.approx(-curve.gap(rho), rel=1e-14)
        if truth["rho2_asked"]:
            found = [float(y) for y in curve.crossings(rho[0], case.data["box"])]
            assert found[:1] == ([] if truth["rho2"] is None else pytest.approx([float(truth["rho2"])], rel=1e-15))
        assert len((truth["rho2"] or "0.").strip("0.").replace(".", "")) <= 30


def test_most_contact_scales_are_asked_for() -> None:
    asked = [case.truth["rho2_asked"] for case in quick()]
    assert np.mean(asked) > 0.9
    assert np.mean([case.truth["rho2"] is not None for case in quick()]) > 0.8


# --------------------------------------------------------------------------------------------------------- the judging


def test_a_known_contact_is_judged_in_every_answer() -> None:
    """Cubes of half width 1/2 that touch along an edge: the direction has no z, and touch is at 1."""
    case = only("edges", SMALL_CUBE, shifted(SMALL_CUBE, (1, 1, 0)))
    right = {"state": 0, "gap": 0.0, "meets": True, "rho2": 1.0, "normal": [0.6, 0.8, 0.0]}
    assert contacts.judged(case, right) == Grade("right", 0.0)
    assert contacts.judged(case, {**right, "normal": [1, 0, 0]}).outcome == "right"  # beside it too
    wrong = {"state": -1, "gap": 1e-5, "rho2": 1.00001, "normal": [0.913, 0.183, 0.365]}
    for key, value in wrong.items():
        verdict = contacts.judged(case, {**right, key: value})
        assert verdict.outcome == "wrong", key
        assert verdict.error is None or key == "state" or verdict.error > WRONG_BEYOND
    for value in (np.nan, np.inf, 1.7976931348623157e308, None, 0.5):
        assert contacts.judged(case, {"rho2": value}).outcome == "wrong"
    for value in (np.nan, -1.7976931348623157e308):
        assert contacts.judged(case, {"gap": value}).outcome == "wrong"
    assert contacts.judged(case, {"flag": "no answer"}) == Grade("flagged", None, "no answer")


@pytest.mark.parametrize("opening", [1e-7, -1e-7, 1e-11, -1e-11])
def test_a_slight_opening_is_asked_of_everybody(opening: float) -> None:
    case = only("slight", CUBE, shifted(CUBE, (3, 0.5, 0.25)), opening=opening)
    side = int(np.sign(opening))
    true = opening * float(case.truth["rho2"])
    for answer in ({"state": side}, {"gap": true}, {"meets": side < 0}, {"overlaps": side < 0}):
        assert contacts.judged(case, answer).outcome == "right"
    for answer in ({"state": 0}, {"state": -side}, {"gap": 0.0}, {"gap": -true}, {"meets": side > 0}):
        assert contacts.judged(case, answer).outcome == "wrong"


def test_a_rounding_is_asked_only_of_those_who_claim_it() -> None:
    case = only("rounding", CUBE, shifted(CUBE, (3, 0.5, 0.25)), opening=1e-14)
    assert case.truth["side"] == 1
    for answer in ({"state": 1}, {"gap": 0.0}, {"gap": -1e-14}, {"meets": True}, {"meets": False}):
        assert contacts.judged(case, answer).outcome == "right"
    for answer in ({"state": 0}, {"state": -1}, {"gap": -5e-11}):
        assert contacts.judged(case, answer).outcome == "wrong"


def test_bodies_without_inside_may_be_said_to_touch_or_to_overlap() -> None:
    square = {"vertices": [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], "seed": [0, 0, 0], "parts": None}
    across, above = only("across", square, CUBE), only("above", square, shifted(CUBE, (0, 0, 2)))
    assert (across.truth["side"], across.truth["meets"]) == (None, True)
    assert (above.truth["side"], float(above.truth["distance"])) == (1, 1)
    for answer in ({"state": 0}, {"state": -1}, {"meets": True}, {"gap": -1.0}):
        assert contacts.judged(across, answer).outcome == "right"
        assert contacts.judged(above, answer).outcome == "wrong"
    assert answered("decision_curve", above).outcome == "flagged"


# --------------------------------------------------------------------------------------------------------- the methods


def test_planted_methods_are_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is off by 1e-5 once in a while, one that calls every opening a touch, one that raises."""
    sample: Sequence[HardCase] = quick()[::20]

    def slightly_off(data: Any) -> dict[str, Any]:
        answer = contacts.METHODS["exact path"](data)
        if answer["rho2"] is not None and data is sample[3].data:
            answer["rho2"] *= 1 + 1e-5
        return answer

    def silent(data: Any) -> dict[str, Any]:
        raise InputError("refused", key="one")

    planted = {"off": slightly_off, "touch": lambda data: {"state": 0}, "silent": silent}
    for name, method in planted.items():
        monkeypatch.setitem(contacts.METHODS, name, method)
    found = {name: [answered(name, case).outcome for case in sample] for name in planted}
    assert found["off"].count("wrong") == 1
    assert found["touch"] == [
        "right" if case.truth["side"] == 0 or (case.truth["side"] is None and case.truth["meets"]) else "wrong"
        for case in sample
    ]
    assert set(found["silent"]) == {"flagged"}


@pytest.mark.slow
@pytest.mark.parametrize("name", contacts.OURS)
def test_ours_are_never_silently_wrong(name: str) -> None:
    asked = quick() if name == "decision_curve" else quick()[::2]  # two of a family at least, so one of each
    assert {case.family for case in asked} == set(contacts.FAMILIES)
    verdicts = {(case.family, case.name): answered(name, case) for case in asked if contacts.applies(name, case)}
    assert {place: verdict for place, verdict in verdicts.items() if verdict.outcome == "wrong"} == {}
    flagged = {family for (family, _), verdict in verdicts.items() if verdict.outcome == "flagged"}
    assert flagged <= {"no thickness", "corner of the scale box"}
    assert sum(verdict.outcome == "right" for verdict in verdicts.values()) > 0.95 * len(asked)


@pytest.mark.parametrize("name", [name for name in contacts.METHODS if name not in contacts.OURS])
def test_rivals_answer_a_plain_pair(name: str) -> None:
    """Well apart, and overlapping: nobody's harness is broken."""
    cases = [only("apart", CUBE, shifted(CUBE, (3, 0.5, 0.25))), only("deep", CUBE, shifted(CUBE, (1.5, 0.5, 0.25)))]
    for case in cases:
        if contacts.applies(name, case):
            verdict = answered(name, case)
            # coal's own tolerance of 1e-6 is all that the first bisection has
            assert verdict.outcome == "right" or (name == "coal bisection" and verdict.error < 1e-5), verdict


def test_what_a_method_cannot_take_is_not_asked() -> None:
    rows = [*CUBE["vertices"], *shifted(CUBE, (2, 0, 0))["vertices"]]
    bar = {"vertices": rows, "seed": [1, 0, 0], "parts": [list(range(8)), list(range(8, 16))]}
    union = only("a bar", bar, shifted(CUBE, (0, 0, 2)))
    assert (union.truth["side"], union.truth["rho2"]) == (0, "1")
    for name in contacts.OURS:
        assert contacts.applies(name, union)
        assert answered(name, union).outcome == "right"
    for name in ("HiGHS", "Clarabel", "CasADi IPOPT"):
        assert not contacts.applies(name, union)
