"""Families of motions: nested ones are never dearer, failing ones are rows, ties and dropped keys are told."""

from __future__ import annotations

import json
import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from ordinary import box, problems

from fcdm_opt.design.whatif.compare import Comparison, FamilyRow, _checked, compare, contained, families
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.primitives import Cylinder
from fcdm_opt.geometry.size import Size
from fcdm_opt.motion.motions import Free, Rotation, Translation
from fcdm_opt.problem.problem import Problem
from fcdm_opt.show.tables import print_comparison

SLACK = 1e-7  # relative: of amounts that stages find by different ways


@cache
def compared(name: str, case: str) -> Comparison:
    return compare(problems(name)[case])


@cache
def boxes(**arguments: Any) -> Problem:
    """A cube .2 deep in a wall on its right, that ends 1.5 above the cube's middle."""
    cube, wall = box((-1, -1, -1), (1, 1, 1)), box((0.8, -4, -4), (3, 4, 1.5))
    return Problem(cube, wall, target=(1.0, 1.0), goal="clear", motion=Translation("x"), **arguments)


CASES = (("example1", "A"), ("example1", "B"), ("example2", "B"), ("example1_touch", "A"), ("example1_touch", "C"))


@pytest.mark.parametrize(("name", "case"), CASES)
def test_a_family_is_never_dearer_than_its_parts(name: str, case: str) -> None:
    rows = {row.name: row for row in compared(name, case).table}
    looked = 0
    for family, parts in contained().items():
        for part in (rows[part] for part in parts if rows[part].usable):
            assert rows[family].usable
            assert rows[family].amount <= part.amount * (1 + SLACK)
            looked += 1
    assert looked >= 5
    assert all(row.note == "" or row.note.startswith("it turns through (0, 0, 0)") for row in rows.values())


@pytest.mark.parametrize(("name", "case"), CASES)
def test_every_family_is_a_row_and_the_cheapest_comes_first(name: str, case: str) -> None:
    found = compared(name, case)
    assert set(families()) <= {row.name for row in found.table}
    assert {row.solution.problem.length for row in found.table if row.solution is not None} == {found.length}
    assert {row.solution.problem.goal for row in found.table if row.solution is not None} == {found.problem.goal}
    amounts = [row.amount for row in found.table if row.usable]
    assert amounts == sorted(amounts)
    assert [row.usable for row in found.table] == sorted((row.usable for row in found.table), reverse=True)
    assert found.best is found.table[0]


def test_parts_of_a_family_make_its_motions() -> None:
    """A motion of each part is one of the whole, of the same amount: Free with its parameters and rotation vector."""
    rng = np.random.default_rng(3)
    one, two = rng.normal(size=3), rng.normal(size=3)
    line = (two - one) / np.linalg.norm(two - one)
    axes = dict(zip("xyz", np.eye(3), strict=True))
    for name, motion in families().items():
        along = line if "seeds" in name else axes.get(name[-1], line)
        q = rng.normal(size=len(motion.parameters))
        kinds = [parameter.kind for parameter in motion.parameters]
        free = np.zeros(6)
        if name == "free" or name == "translations":
            free[: len(q)] = q
        else:
            for kind, x in zip(kinds, q, strict=True):
                free[slice(3) if kind == "translation" else slice(3, 6)] = x * along
        np.testing.assert_allclose(motion.transform(q, one, two), Free().transform(free, one, two), atol=1e-12)
        weights = motion.weights(1.7)
        assert np.linalg.norm(weights * q) == pytest.approx(np.linalg.norm(Free().weights(1.7) * free))


def test_failing_families_and_ties_of_a_closed_form(capsys: pytest.CaptureFixture[str]) -> None:
    found = compare(boxes())
    rows = {row.name: row for row in found.table}
    for name in ("translation x", "translations", "translation and rotation x"):
        assert rows[name].amount == pytest.approx(0.2, abs=1e-9)
    assert rows["translation z"].amount == pytest.approx(2.5, abs=1e-9)
    assert rows["translation y"].amount == pytest.approx(5.0, abs=1e-9)
    assert rows["rotation x"].status == "INFEASIBLE"
    assert not rows["rotation x"].usable
    assert math.isnan(rows["rotation x"].amount)
    assert "translations" in rows["translation x"].tied
    assert "translation x" in rows["translations"].tied
    assert rows["translation z"].tied == ("translation and rotation z",)
    assert rows["rotation x"].tied == ()
    print_comparison(found)
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split()[-1] == "outcome"
    ended = {line.split("  ")[0]: line.strip().split("  ")[-1].strip() for line in lines[3:]}
    assert (ended["translation x"], ended["rotation x"]) == ("verified", "impossible")


def test_turns_about_different_centres_were_listed_as_if_comparable() -> None:
    moved = boxes()
    alike = {"z": Rotation("z"), "free": Translation("x") >> Rotation("z")}
    assert not any("turns through" in row.note for row in compare(moved, alike).table)
    other = {**alike, "pivot": Rotation("z", centre=(0, -2, 0)), "x": Translation("x")}
    noted = {row.name: row.note for row in compare(moved, other).table if "turns through" in row.note}
    assert noted == {"pivot": "it turns through (0, -2, 0), others do not: angles are not to be compared"}


def test_what_a_family_does_not_know_is_dropped_and_told() -> None:
    problem = boxes().changed(limits={"TX": (-0.1, 0.1)}, weights={"TX": 2.0}, amount="weighted")
    found = compare(
        problem, {"x": Translation("x"), "z": Translation("z"), "both": Translation("x") >> Translation("z")}
    )
    rows = {row.name: row for row in found.table}
    assert rows["z"].dropped == ("limits.TX", "weights.TX")
    assert rows["x"].dropped == rows["both"].dropped == ()
    assert not rows["x"].usable  # the limit stops it
    assert rows["both"].amount == pytest.approx(2.5, abs=1e-9)
    assert rows["z"].amount == pytest.approx(2.5, abs=1e-9)


def test_a_family_that_the_question_does_not_hold_for_is_a_row() -> None:
    """Seeds in one place define no line between them."""
    cube, wall = box((-1, -1, -1), (1, 1, 1)), box((0.8, -4, -4), (3, 4, 4), seed=(0, 0, 0))
    found = compare(Problem(cube, wall, target=(1.0, 1.0), goal="clear", motion=Translation("x")))
    rows = {row.name: row for row in found.table}
    assert rows["along the seeds"].status == rows["screw along the seeds"].status == "BAD_INPUT"
    assert "the seeds coincide" in rows["screw along the seeds"].note
    assert rows["along the seeds"].solution is None
    assert found.best is not None
    assert found.best.amount == pytest.approx(0.2, abs=1e-9)


def test_a_family_found_dearer_than_its_part_is_told() -> None:
    """Planted: the table of a solver that does worse with more freedom."""
    table = compare(boxes()).table
    cheap = next(row for row in table if row.name == "translation x")
    dear = next(row for row in table if row.name == "translation y")
    planted = [
        row if row.name != "free" else FamilyRow(name="free", motion=Free(), solution=dear.solution) for row in table
    ]
    notes = _checked(planted)
    assert set(notes) == {"free"}
    assert f"{cheap.amount:.6g}" in notes["free"]
    assert _checked(list(table)) == {}


def test_bounds_are_told_where_certified() -> None:
    motions = [Translation("x"), Translation("x") >> Rotation("z")]
    found = compare(boxes(), motions, certify=True)
    for row in found.to_dict()["rows"]:
        assert 0.99 * row["amount"] <= row["lower_bound"] <= row["amount"] * (1 + 1e-9)
    one, two = (next(row for row in found.table if row.motion is motion) for motion in motions)
    assert two.solution is not None
    assert two.solution.lower_bound <= one.amount * (1 + 1e-9)


def test_names_of_motions_given_in_a_sequence() -> None:
    found = compare(boxes(), [Translation("x"), Translation("x"), Rotation("z")])
    assert {row.name for row in found.table} == {"TX", "TX (2)", "RZ"}
    assert found.table[0].tied == (found.table[1].name,)


def test_the_problem_s_own_motion_is_compared_once() -> None:
    assert "as given" not in {row.name for row in compare(boxes()).table}
    own = boxes().changed(motion=Rotation("z", centre=(9.0, 0.0, 0.0)))
    assert "as given" in {row.name for row in compare(own).table}


def test_it_can_be_written_as_json() -> None:
    found = compared("example1", "A")
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert data["best"] == found.table[0].name
    assert data["rows"][-1]["amount"] is None
    assert str(found).startswith(f"cheapest of {len(found.table)} families: {data['best']}, amount")


@pytest.mark.parametrize(
    "motions", ["z", [], {}, ["z"], {"z": 3}, {1: Translation("z")}, 4, np.array(1.0), Translation("z")]
)
def test_bad_motions_are_named(motions: Any) -> None:
    with pytest.raises(InputError, match="motion"):
        compare(boxes(), motions)


def test_only_a_problem_can_be_compared() -> None:
    with pytest.raises(InputError, match="expected a Problem"):
        compare("example1.toml")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="certify: not a truth value"):
        compare(boxes(), [Translation("z")], certify=1)  # type: ignore[arg-type]


def test_a_turn_that_moves_no_contact_ended_with_an_error_of_a_library() -> None:
    """A jaw turned about its contact's normal: no equation changes, and one that is not met excludes all."""
    rod, jaw = Cylinder(5.0, 30.0, base=(0, 0, -15)), box((-15, -6, -7), (-5, 6, 7))
    size = Size("d", "static", faces=["cylinder radius 5"], each=0.5)
    asked = Problem(jaw, rod, sizes=[size], made={"d": -0.05}, goal="at", motion=Translation("x"))
    rows = {row.name: row for row in compare(asked).table}
    assert rows["translation x"].amount == pytest.approx(0.025, rel=1e-9)
    assert math.isnan(rows["rotation x"].amount)
