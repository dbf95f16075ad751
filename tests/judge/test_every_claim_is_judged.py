"""Every field of a solution, changed: refused where it is read, or by the judge; what is told is found out.

Fields of words and times are told and not claimed: they are refused where they are not of their form.
"""

from __future__ import annotations

import copy
import json
from dataclasses import fields, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.errors import InputError
from fcdm_opt.problem.evidence import Evidence

DERIVED = {
    "advice", "reason", "usable", "motion", "keep_out_gaps", "snapped", "gap", "contact_gaps", "open_contacts", "doubt",
}  # fmt: skip


def block(low, high, name, seed="box"):
    corners = [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    return fo.Body.convex(corners, seed=seed, name=name)


@cache
def solution(case: str) -> fo.Solution:
    """A certified solution of each kind, with its derivatives where there are some."""
    if case == "beyond":
        problem = fo.load_problems("problems/example1.toml")[1]
    elif case == "clear":
        floor, wall = block((-3, -3, -1), (3, 3, 0), "floor"), block((1.2, -3, -3), (2, 3, 3), "wall")
        keep_out = fo.KeepOut(wall, clearance=0.05, name="wall")
        motion = fo.Translation("x") >> fo.Translation("z")
        cube = block((-1, -1, 0.1), (1, 1, 2.1), "cube")
        problem = fo.Problem(
            cube, floor, target=(1.02, 1.0), goal="clear", clearance=0.2, motion=motion, keep_out=[keep_out]
        )
    elif case == "touch":
        problem = fo.load_problems("problems/example1_touch.toml")[0]
    elif case == "at rest":
        problem = fo.Problem(
            block((-1, -1, 1), (1, 1, 3), "cube"), block((-3, -3, -1), (3, 3, 0), "floor"),
            target=(1.0, 1.0), goal="clear", clearance=0.5, motion=fo.Translation("z"),
        )  # fmt: skip
    else:
        assert case == "contacts"
        walls = [block((-3, -3, -3), tuple(0.0 if k == axis else 30.0 for k in range(3)), "") for axis in range(3)]
        vertices = [body.vertices for body in walls]
        corner = fo.Body.from_parts(vertices, seed=(6.5, 6.0, 7.0), name="corner")
        cube = block((0, 0, 0), (4, 5, 6), "cube", seed=(1.0, 2.0, 3.0))
        motion = fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z")
        problem = fo.Problem(cube, corner, target=(1.02, 0.99), motion=motion, contacts="all")
    found = fo.solve(problem, certify=True)
    assert found.usable, (case, found, found.certificate and found.certificate.failed)
    return replace(found, derivatives=found.sensitivity)


@cache
def told(case: str) -> dict[str, Any]:
    return json.loads(json.dumps(solution(case).to_dict(), allow_nan=False))


READ = fo.Problem.from_dict


@cache
def problem_of(text: str) -> fo.Problem:
    return READ(json.loads(text))


@pytest.fixture(autouse=True)
def _same_problems(monkeypatch: pytest.MonkeyPatch) -> None:
    """What most changes leave as it is, is read once."""
    monkeypatch.setattr(fo.Problem, "from_dict", lambda data: problem_of(json.dumps(data)))


def refusal(data: Any) -> str:
    """Why plain data are refused: by `from_dict`, or by name of the failed checks; "" where they pass."""
    try:
        read = fo.Solution.from_dict(data)
    except InputError as reason:
        return f"not read: {reason}"
    return ", ".join(check.name for check in fo.verify(read, proof=True).failed)


def test_what_was_found_passes():
    for case in CASES:
        assert refusal(told(case)) == "", case


def scaled(factor):
    def changed(value):
        if isinstance(value, dict):
            return {key: changed(own) for key, own in value.items()}
        if isinstance(value, list):
            return [changed(own) for own in value]
        return value * factor if isinstance(value, float | int) and not isinstance(value, bool) else value

    return changed


def put(path, value):
    """Change one entry, or by a function what is there."""

    def changed(data):
        data, (*way, last) = copy.deepcopy(data), path
        inner = data
        for key in way:
            inner = inner[key]
        inner[last] = value(inner[last]) if callable(value) else value
        return data

    return changed


def of(value):
    return lambda _: value


def without(place):
    def changed(data):
        data = copy.deepcopy(data)
        del data[place]
        return data

    return changed


ALL = ("beyond", "clear", "touch", "contacts")
CASES = (*ALL, "at rest")

# key: (cases, changes)
CHANGES: dict[str, list[tuple[tuple[str, ...], Any]]] = {
    "problem": [
        (ALL, of(None)),
        (ALL, of({})),
        (ALL, put(("case", 0, "motion", 0), {"free": True})),
        (("beyond",), put(("case", 0, "tolerance"), 0.021)),
        (("beyond",), put(("case", 0, "requirement"), "A")),
        (("clear",), put(("case", 0, "clearance"), 0.21)),
        (("clear", "contacts"), put(("case", 0, "target"), [1.03, 1.0])),
        (ALL, put(("bodies", "movable", "vertices", 0, 2), lambda x: x - 0.05)),
        (("clear",), put(("case", 0, "weights"), {"TZ": 2.0})),
        (("clear",), put(("case", 0, "limits"), {"TZ": [0.0, 0.01]})),
    ],
    "status": [
        (ALL, of("ALREADY_SATISFIED")),
        (("clear", "touch", "contacts", "at rest"), of("PAIR_OVERLAPS")),
        (("beyond",), of("SOLVED")),
        *((CASES, of(own)) for own in ("INFEASIBLE", "NOT_FOUND", "NOT_VERIFIED", "LEFT_COHERENT_RANGE", "fine", 5)),
        # OUTSIDE_FIT: whether a motion leaves the fit is not yet asked by the judge
    ],
    "parameters": [
        (ALL, scaled(1.001)), (ALL, scaled(-1.0)), (CASES, of({})), (CASES, of({"XX": 1.0})), (CASES, of(5)),
    ],
    "transform": [
        (CASES, put((0, 3), 0.3)), (CASES, put((0, 0), -1.0)), (CASES, of(None)), (CASES, of([[1.0]])),
        (CASES, put((3, 0), 0.1)), (CASES, put((1, 1), None)),
    ],
    "amount": [(ALL, scaled(1.01)), (ALL, scaled(0.99)), (CASES, of(None)), (CASES, of("inf")), (CASES, of(-1.0))],
    "lower_bound": [
        (ALL, lambda x: x * 1.01), (CASES, of(None)), (CASES, of("inf")), (CASES, of(-1.0)), (CASES, of(7.0)),
        (ALL, lambda x: x * 0.9),  # true, and not what the gap says
    ],
    "rho": [(CASES, scaled(1.01)), (CASES, of([1.0])), (CASES, of(None)), (CASES, put((0,), None))],
    "features": [
        (("beyond", "touch", "contacts"), of([])),
        (("beyond", "contacts"), without(0)),
        (("beyond", "touch", "contacts"), of(["V1F2(P1V1; P2V1,V2,V3)"])),
        (("beyond", "touch", "contacts"), lambda labels: [labels[0], labels[0]]),
        (ALL, of(["nonsense"])),
        (ALL, of(5)),
    ],
    "pair": [(CASES, scaled(1.01)), (CASES, of([1.0])), (CASES, put((1,), None)), (CASES, of("ab"))],
    "pair_gap": [
        (CASES, of(None)), (CASES, of(5.0)), (CASES, of(-5.0)), (CASES, of("inf")),
        (CASES, lambda x: x + 0.01), (CASES, lambda x: x - 0.01),
    ],
    "pair_state": [
        (CASES, lambda own: {"apart": "touching"}.get(own, "apart")), (CASES, of("unknown")), (CASES, of(5)),
    ],
    "evidence": [(("beyond", "clear", "touch"), of({})), (ALL, of("x"))],
    "unique_within": [
        (("beyond", "clear", "touch"), of(1.0)), (CASES, of(None)), (CASES, of(-1.0)),
        (("beyond", "clear", "touch"), of("inf")),
    ],
    "certificate": [
        (CASES, put(("checks", 1, "passed"), False)),
        (CASES, put(("checks", 3, "value"), lambda x: x + 0.1)),
        (CASES, of({"passed": True, "checks": []})),
        (CASES, of({"passed": True, "checks": 3})),
        (CASES, of(None)),  # not `usable` then
    ],
    "sensitivity": [
        (ALL, put(("target", 0), lambda x: (x or 0.0) + 0.1)),
        (ALL, put(("exists",), lambda x: not x)),
        (ALL, put(("clearance",), lambda x: (x or 0.0) + 1.0)),
        (ALL, put(("faces",), {"P1V1": 1.0})),
        (ALL, put(("residual",), 7.0)),
        (ALL, of(5)),
    ],
    "usable": [(CASES, of(False)), (CASES, of("yes"))],
    "gap": [(ALL, lambda x: x + 0.01), (CASES, of(-1.0)), (CASES, of(None))],
    "snapped": [(CASES, of(not None)), (CASES, of(0.5))],
    "contact_gaps": [
        (CASES, of({"x": 1.0})),
        (("beyond", "touch", "contacts"), lambda gaps: {key: x + 0.1 for key, x in gaps.items()}),
    ],
    "open_contacts": [(CASES, of(["x"]))],
    "keep_out_gaps": [(CASES, of({"x": 1.0})), (("clear",), of({})), (("clear",), scaled(2.0))],
    "amount_low": [(CASES, of(1e6)), (CASES, of(-1.0)), (CASES, of(None)), (CASES, of("a")), (ALL, scaled(0.9))],
    "amount_high": [(CASES, of(-1.0)), (CASES, of(None)), (CASES, of("a")), (ALL, scaled(1.1)), (CASES, of("inf"))],
    # told, and not claimed: of their form alone
    "active": [(CASES, of(5)), (CASES, of("one")), (CASES, of([5])), (CASES, of(None))],
    "modelled": [(CASES, of({"variables": -1})), (CASES, of({"variables": "a"})), (CASES, of([5])), (CASES, of(None))],
    "stage": [(CASES, of(5)), (CASES, of(None))],
    "stopped": [(CASES, of(5)), (CASES, of(None))],
    "seconds": [
        (CASES, of({"solve": -1.0})), (CASES, of({"solve": None})), (CASES, of({"solve": "inf"})), (CASES, of(5)),
    ],
}  # fmt: skip
WORDS = {"advice", "reason", "motion", "doubt"}  # not read: told anew by what is read
ROWS = [
    pytest.param(key, case, change, id=f"{key} {number} {case}")
    for key, changes in CHANGES.items()
    for number, (cases, change) in enumerate(changes, 1)
    for case in cases
]


def test_every_field_and_every_key_is_changed_below():
    keys = set(told("beyond"))
    assert keys == set(CHANGES) | WORDS
    assert {item.name for item in fields(fo.Solution)} - {"derivatives"} <= set(CHANGES)
    assert keys - {item.name for item in fields(fo.Solution)} - {"sensitivity"} == DERIVED


@pytest.mark.sampled(31)
@pytest.mark.parametrize(("key", "case", "change"), ROWS)
def test_a_changed_field_is_refused(key, case, change):
    data = copy.deepcopy(told(case))
    changed = change(data[key])
    assert changed != data[key]
    assert refusal({**data, key: changed}) != ""


@pytest.mark.parametrize("key", sorted(WORDS))
def test_words_that_follow_from_the_rest_are_told_anew(key):
    for case in CASES:
        assert fo.Solution.from_dict({**told(case), key: "do not worry"}).to_dict()[key] == told(case)[key]


@pytest.mark.parametrize("key", sorted(set(told("beyond")) - DERIVED - {"unique_within", "stopped"}))
def test_a_missing_field_is_refused(key):
    data = copy.deepcopy(told("beyond"))
    del data[key]
    assert refusal(data) != ""


def changed_evidence(name: str):
    """Changes of one array of evidence."""
    own: Evidence = solution("beyond").evidence
    values = np.array(getattr(own, name))
    yield values[:-1]
    yield np.concatenate([values, values[-1:]])
    yield np.full_like(values, 0)
    yield values.astype(float) * np.nan
    for place in np.random.default_rng(0).integers(0, max(values.size, 1), 4):
        if values.size:
            other = values.copy()
            other.flat[place] = other.flat[place] + (1 if values.dtype.kind == "i" else 0.1)
            yield other


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", [item.name for item in fields(Evidence)])
def test_changed_evidence_is_refused(name):
    found = solution("beyond")
    for values in changed_evidence(name):
        if name == "witnesses" and values.shape == found.evidence.witnesses.shape and np.isfinite(values).all():
            continue  # numbers of a witness that its reason does not use: see `test_checker`
        if np.array_equal(values, getattr(found.evidence, name)):
            continue  # it was 0
        if name == "limits" and values.shape == found.evidence.limits.shape and not np.isnan(values).any():
            continue  # told, and taken from the problem by whoever checks
        forged = replace(found, evidence=replace(found.evidence, **{name: values}))
        assert fo.verify(forged, proof=True).failed, values


def test_a_bound_is_no_more_than_what_its_evidence_shows(ticking):
    """A search that was cut off, with a dictionary that says that its motion is the smallest."""
    found = fo.solve(solution("beyond").problem, certify=True, seconds=5.0)
    assert 0.0 < found.lower_bound < 0.999 * found.amount
    assert found.lower_bound == found.evidence.bound
    assert fo.verify(found, proof=True).passed
    for bound in (found.amount, 1.001 * found.lower_bound):
        forged = replace(found, lower_bound=bound)
        assert "proof: lower bound" in {check.name for check in fo.verify(forged, proof=True).failed}
        assert fo.verify(replace(forged, evidence=None), proof=True).passed  # it is found anew, and to the end


# ------------------------------------------------------------------------------------------------------- assemblies


@cache
def assembled() -> fo.AssemblySolution:
    (assembly, *_) = fo.load_assemblies("problems/assemblies/loop_of_four.toml")
    return fo.solve_assembly(assembly)


def of_parts(factor):
    return lambda own: {part: scaled(factor)(value) for part, value in own.items()}


def first_moved(transforms):
    part = next(iter(transforms))
    T = np.array(transforms[part])
    T[0, 3] += 0.01
    return {**transforms, part: T}


def contact_changed(**change):
    return lambda contacts: (replace(contacts[0], **change), *contacts[1:])


ASSEMBLY_CHANGES: dict[str, list[Any]] = {
    "status": [of(fo.Status.ALREADY_SATISFIED), of(fo.Status.NOT_VERIFIED), of(fo.Status.INFEASIBLE)],
    "parameters": [of({}), of_parts(1.01), lambda own: dict(list(own.items())[1:])],
    "transforms": [of({}), first_moved, lambda own: dict(list(own.items())[1:])],
    "amounts": [of({}), of_parts(1.01), lambda own: {**own, "another": 1.0}],
    "amount": [scaled(1.01), scaled(0.99), of(float("nan"))],
    # without `proof` a bound that is no more than the amount is the solver's word
    "lower_bound": [scaled(1.01), of(float("inf")), of(float("nan")), of(-1.0)],
    "amount_low": [scaled(1.01), of(float("nan")), of(-1.0), scaled(0.9)],
    "amount_high": [scaled(0.99), of(float("nan")), scaled(1.1), of(float("inf"))],
    "contacts": [
        of(()),
        lambda own: own[1:],
        lambda own: (*own[1:], own[0]),
        contact_changed(pair_gap=0.1),
        contact_changed(pair_state="overlapping"),
        contact_changed(transform=np.eye(4)),
        contact_changed(features=()),
        contact_changed(status=fo.Status.PAIR_OVERLAPS),
        contact_changed(rho=np.array([1.1, 1.0])),
    ],
}
# words, times, what `verify` itself makes, and evidence, which it looks at with `proof`
TOLD = {"stages", "stopped", "active", "certificate", "seconds", "evidence"}
ASSEMBLY_ROWS = [(key, number) for key, own in ASSEMBLY_CHANGES.items() for number in range(len(own))]


def test_every_field_of_an_assembly_is_changed_below():
    assert {item.name for item in fields(fo.AssemblySolution)} == set(ASSEMBLY_CHANGES) | TOLD | {"assembly"}


@pytest.mark.parametrize(("key", "number"), ASSEMBLY_ROWS)
def test_a_changed_field_of_an_assembly_is_refused(key, number):
    found = assembled()
    assert fo.verify_assembly(found).passed
    forged = replace(found, **{key: ASSEMBLY_CHANGES[key][number](getattr(found, key))})
    assert fo.verify_assembly(forged).failed


def test_another_assembly_is_refused():
    found, (_, other) = assembled(), fo.load_assemblies("problems/assemblies/loop_of_four.toml")
    assert fo.verify_assembly(replace(found, assembly=other)).failed
