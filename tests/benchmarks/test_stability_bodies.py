"""Hard bodies of the stability map: their truth against closed forms, the judge against planted errors, ours right."""

from __future__ import annotations

import itertools
import json
from functools import cache

import numpy as np
import pytest

from fcdm_opt_benchmarks.shapes import random_rotation
from fcdm_opt_benchmarks.stability import bodies
from fcdm_opt_benchmarks.stability.bodies import METHODS, applies, judged
from fcdm_opt_benchmarks.stability.body_families import (
    SOLIDS,
    TOUCHING,
    blocks,
    exact_counts,
    exact_volume,
    families,
    surface_of,
)
from fcdm_opt_benchmarks.stability.case import HardCase

FAMILIES = 12
OURS_FLAGGED = {  # two triangulations of one face between two solids: refused, see the surface's checks
    "two cubes sharing a face, each with vertices of its own",
    "two cubes sharing a face, each with vertices of its own, turned",
}


@cache
def by_family() -> dict[str, list[HardCase]]:
    return families(0)


@cache
def by_name() -> dict[str, HardCase]:
    return {case.name: case for own in by_family().values() for case in own}


@pytest.mark.slow
def test_the_quick_form_has_a_fifth_of_every_family():
    every, quick = bodies.cases(False, 0), bodies.cases(True, 0)
    assert len({(case.family, case.name) for case in every}) == len(every)
    assert {case.family for case in quick} == {case.family for case in every} == set(by_family())
    assert len(by_family()) == FAMILIES
    assert len(quick) < len(every) / 4
    assert all(case in every for case in quick)
    assert bodies.cases(False, 0) == every
    assert bodies.cases(False, 1) != every
    for case in every:
        assert json.loads(json.dumps([case.data, case.truth], allow_nan=False)) == [case.data, case.truth]
        assert any(applies(name, case) for name in METHODS if name not in bodies.OURS)
        assert all(applies(name, case) for name in bodies.OURS)


# --------------------------------------------------------------------------------------------------------------- truth


@pytest.mark.parametrize(
    ("name", "volume"),
    [
        *{"L": 3, "U": 7, "frame": 8, "cross": 5, "cross in space": 7, "cube less an eighth": 7}.items(),
        *{"cavity": 26, "nested cavity": 99, "cubes apart": 26, "L at 1e6": 3, "L, inverted winding": 3}.items(),
        *{"two cubes sharing an edge": 2, "two cubes sharing a vertex": 2, "cube of side 1e+09": 1e27}.items(),
    ],
)
def test_volumes_in_closed_form(name, volume):
    assert by_name()[name].truth["volume"] == volume


def test_volumes_of_turned_solids_are_those_of_their_floats():
    off = [abs(by_name()[f"{name}, turned"].truth["volume"] / len(own) - 1) for name, own in SOLIDS.items()]
    assert 0 < max(off) < 1e-14


def test_counts_of_hulls_of_integers():
    octahedron = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (0, 0, 0)]
    assert exact_counts(itertools.product(range(3), repeat=3)) == (8, 12, 6)
    assert exact_counts(octahedron) == (6, 12, 8)
    assert exact_counts([*octahedron[:5], (0, 0, 0)]) == (5, 8, 5)
    assert exact_counts([(x, y, x - 3 * y) for x in range(3) for y in range(3)]) is None
    assert exact_counts([(0, 0, 0), (1, 2, 3), (2, 4, 6)]) is None


def test_volumes_of_unions_are_counts_of_cells():
    rng = np.random.default_rng(0)
    for _ in range(8):
        boxes = [np.sort(rng.integers(0, 6, (2, 3)), axis=0) + np.array([[0], [1]]) for _ in range(rng.integers(1, 6))]
        cells = {cell for low, high in boxes for cell in itertools.product(*map(range, low, high))}
        parts = [np.array(list(itertools.product(*zip(low, high, strict=True))), float) for low, high in boxes]
        turn = random_rotation(rng)
        assert bodies.union_volume(parts) == pytest.approx(len(cells), rel=1e-12)
        assert bodies.union_volume([1e-9 * part @ turn.T for part in parts]) == pytest.approx(
            1e-27 * len(cells), rel=1e-9
        )


def test_surfaces_of_blocks_enclose_them():
    for own in (*SOLIDS.values(), *TOUCHING.values(), blocks("#.", ".#")):
        vertices, faces = surface_of(own)
        assert exact_volume(vertices, faces) == len(own)
        sides = [(a, b) for face in faces for a, b in zip(face, [*face[1:], face[0]], strict=True)]
        assert sorted(sides) == sorted((b, a) for a, b in sides)


# --------------------------------------------------------------------------------------------------------------- judge


@pytest.mark.parametrize(
    ("name", "answer", "outcome"),
    [
        ("L", {"volume": 3 * (1 + 1e-7)}, "right"),
        ("L", {"volume": 3 * (1 + 1e-5)}, "wrong"),
        ("L", {"volume": float("nan")}, "wrong"),
        ("L", {"volume": -3.0}, "wrong"),
        ("L", {"volume": 0.0}, "wrong"),
        ("L", {"refused": "not closed"}, "flagged"),
        ("L, open", {"refused": "not closed"}, "right"),
        ("L, open", {"volume": 3.0}, "wrong"),
        ("L, a flat sheet", {"volume": 0.0}, "right"),
        ("grid of 27 points", {"vertices": 8, "faces": 6}, "right"),
        ("grid of 27 points", {"vertices": 8, "faces": 12}, "wrong"),
        ("grid of 27 points", {"vertices": 9}, "wrong"),
        ("grid of 27 points", {"vertices": float("nan"), "edges": 12, "faces": 6}, "wrong"),
        ("boxes overlapping by 1e-07", {"depth": 1e-7}, "right"),
        ("boxes overlapping by 1e-07", {"depth": 0.0}, "wrong"),
        ("boxes apart by 1e-07", {"depth": 0.0}, "right"),
        ("boxes apart by 1e-07", {"depth": 1e-12}, "wrong"),
    ],
)
def test_the_judge(name, answer, outcome):
    assert judged(by_name()[name], answer).outcome == outcome


def test_an_answer_to_another_question_is_none():
    with pytest.raises(KeyError, match="volume"):
        judged(by_name()["L"], {"vertices": 8})


# ------------------------------------------------------------------------------------------------------------- methods


def asked(method: str, case: HardCase) -> str:
    return judged(case, METHODS[method](case.data)).outcome


@pytest.mark.sampled(4)  # `stability --quick` asks some of every family
@pytest.mark.parametrize("number", range(FAMILIES))
def test_ours_are_right(number):
    for case in list(by_family().values())[number][::4]:
        assert asked("our bodies", case) == ("flagged" if case.name in OURS_FLAGGED else "right"), case.name


def test_single_precision_loses_an_overlap_and_double_keeps_it():
    case = by_name()["boxes overlapping by 1e-07"]
    assert [asked(name, case) for name in ("our bodies", "manifold3d", "manifold3d, float32", "trimesh")] == [
        "right", "right", "wrong", "wrong"
    ]  # fmt: skip


def test_rivals_are_right_where_it_is_easy():
    for name in METHODS:
        easy = "grid of 27 points" if name not in bodies.ASKED["volume"] else "two cubes sharing a face"
        if name != "CoACD":
            assert asked(name, by_name()[easy]) == "right", name
