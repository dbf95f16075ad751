"""All cases in one table, all requirements at once, and maps as grids for the shop floor."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.show.grids import grids, write_grids

PROBLEMS = Path(__file__).parents[1] / "problems"


def peg() -> fo.Problem:
    """A face at 1 from a centre, on a wall at 1 of a block at (2, 0, 0): the gap is 1 - r1 + 1 - r2."""
    cube = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    one, two = fo.Body.convex(cube, name="peg"), fo.Body.convex(cube + np.array([2.0, 0.0, 0.0]), name="wall")
    motion = fo.Translation("x")
    return fo.Problem(one, two, tolerance=0.01, requirement="A", goal="touch", motion=motion, unit="mm", name="peg")


def test_all_requirements_are_answered_at_once(tmp_path: Path) -> None:
    answers = fo.solve_all(peg(), requirement="all")
    shifts = {"A": -0.02, "B": 0.0, "C": 0.0, "D": 0.02}
    assert list(answers) == list(shifts)
    assert {name: answers[name].parameters["TX"] for name in answers} == pytest.approx(shifts, abs=1e-12)
    assert (
        str(answers).splitlines()[3].startswith("D: move peg 0.02 mm along +x: then its right face (facing +x) lies on")
    )
    assert repr(answers) == "SolvedCases(A, B, C, D: 4 of 4 usable)"
    answers.to_csv(tmp_path / "cases.csv")
    with (tmp_path / "cases.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["case"] for row in rows] == list(shifts)
    assert [float(row["TX"]) for row in rows] == pytest.approx(list(shifts.values()), abs=1e-12)
    assert rows[0]["verdict"] == "move peg 0.02 mm along -x: " + rows[3]["verdict"].partition("+x: ")[2]


def test_requirements_that_are_none_are_refused() -> None:
    for wrong in ("", "E", 3, "all of them"):
        with pytest.raises(fo.InputError, match="requirement"):
            fo.solve_all(peg(), requirement=wrong)
    with pytest.raises(fo.InputError, match="problem"):
        fo.solve_all(3)


def test_solve_writes_one_table_for_all_files(tmp_path: Path) -> None:
    path = tmp_path / "all.csv"
    files = [str(PROBLEMS / f"{stem}.toml") for stem in ("boxes", "nut")]
    result = CliRunner().invoke(app, ["solve", "--effort", "quick", "--table", str(path), *files])
    assert result.stderr.splitlines()[-1] == f"wrote {path}"
    with path.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    asked = [f"{stem}: {p.name}" for stem in ("boxes", "nut") for p in fo.load_problems(PROBLEMS / f"{stem}.toml")]
    assert [row["case"] for row in rows] == asked
    shifted = next(row for row in rows if row["case"] == "nut: shifted against a flat")
    assert float(shifted["TX"]) == pytest.approx(0.25)
    assert shifted["RZ_deg"] == ""


def test_a_grid_says_the_motion_for_both_sizes(tmp_path: Path) -> None:
    """The shift is 2 - r1 - r2: at (+1 %, -0.4 %) it is -0.006."""
    problem = peg()
    found = fo.compensation_map(problem)
    (grid,) = grids(found, problem)
    assert (grid.name, grid.unit) == ("TX", "mm")
    assert grid.rows[-1] == "2.02 mm"  # what is measured; the cube is 2 long
    assert grid.columns[3] == "1.992 mm"
    cells = np.array(grid.cells, dtype=float)
    off = np.linspace(-0.01, 0.01, 11)
    np.testing.assert_allclose(cells, -off[:, None] - off, atol=1e-6)
    table, page = write_grids(found, problem, tmp_path / "peg", title="a title")
    rows = list(csv.reader(table.read_text(encoding="utf-8").splitlines()))
    assert rows[0][0] == "TX, mm: peg, length along x down, wall, length along x across"
    assert rows[11][0] == "2.02 mm"
    assert float(rows[11][4]) == pytest.approx(-0.006)
    assert "Measure both parts" in page.read_text(encoding="utf-8")


def test_cases_are_a_frame_and_a_card() -> None:
    answers = fo.solve_all(peg(), requirement="AB", effort="quick")
    frame = answers.to_frame()
    assert list(frame["case"]) == list(answers) == ["A", "B"]
    assert frame["amount"].tolist() == [solution.amount for solution in answers.values()]
    assert list(frame.columns) == list(answers.rows()[0])
    card = answers._repr_html_()
    assert all(f">{name}</td>" in card for name in answers)
    assert "2 cases" in card
