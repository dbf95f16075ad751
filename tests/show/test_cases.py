"""All cases in one table, all requirements at once, and maps as grids for the shop floor."""

from __future__ import annotations

import csv
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.geometry.primitives import Box
from fcdm_opt.show.cards import Card
from fcdm_opt.show.grids import grids, write_grids
from fcdm_opt.show.report.cases import size_rows
from fcdm_opt.show.texts import bound_text, scale_text

PROBLEMS = Path(__file__).parents[2] / "problems"


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


@pytest.mark.slow
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
    assert "Measure the parts" in page.read_text(encoding="utf-8")
    both = problem.changed(motion=problem.motion >> fo.Translation("y"))  # y does nothing for it
    table, page = write_grids(fo.compensation_map(both), both, tmp_path / "both", title="a title")
    assert page.read_text(encoding="utf-8").count("<table") == 1
    assert "0 at all these sizes: TY." in page.read_text(encoding="utf-8")
    assert "TY, mm" in table.read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_maps")
def test_a_grid_by_sizes_showed_deviations_that_nobody_can_measure() -> None:
    """The peg is 2 wide as drawn, the wall's place is none: the first is a measure, the other a deviation."""
    width = fo.Size("width", "movable", faces=("+x", "-x"), each=0.5, tolerance=0.02)
    place = fo.Size("place", "static", faces=("-x", "+x"), along="-x", tolerance=0.01)
    problem = fo.Problem(*peg().bodies, motion=fo.Translation("x"), sizes=(width, place), goal="touch", unit="mm")
    (grid,) = grids(fo.compensation_map(problem), problem, lines=3)
    assert grid.rows == ["1.98 mm (-0.02)", "2 mm (as drawn)", "2.02 mm (+0.02)"]
    assert grid.columns == ["-0.01 mm", "as drawn", "+0.01 mm"]


def test_a_grid_had_a_dash_where_sizes_leave_no_play_at_all(tmp_path: Path) -> None:
    """Two pins of 2, one of them off by p, in slots of 2.1 are to clear: the shift is .05 - p, up to p = .1."""
    centres = (-10.0, 10.0)
    pins = [Box((2, 2, 2), centre=(x, 0, 0)).vertices for x in centres]
    walls = [Box((1, 4, 4), centre=(x + s * 1.55, 0, 0)).vertices for x in centres for s in (-1, 1)]
    right = [{"through": (10.0 + s, 0.0, 0.0)} for s in (-1, 1)]
    place = fo.Size("place", "movable", faces=right, along="x", tolerance=(0.0, 0.12))
    bodies = fo.Body.from_parts(pins, name="pins"), fo.Body.from_parts(walls, name="slots")
    problem = fo.Problem(*bodies, sizes=[place], motion=fo.Translation("x"), goal="clear", unit="mm")
    found = fo.compensation_map(problem, error=1e-3)
    (grid,) = grids(found, problem, lines=7)
    assert grid.between == pytest.approx(0.005, abs=1e-5)  # at .05, half of the -.01 at .06
    page = write_grids(found, problem, tmp_path / "map", title="pins")[1].read_text(encoding="utf-8")
    most = grids(found, problem)[0].between  # at .048 and .054 of 21 lines: a third of -.004
    assert most == pytest.approx(0.004 / 3, abs=1e-5)
    assert f"a value in proportion is off by up to {most:.4g} mm" in page
    *cells, beyond = (row[0] for row in grid.cells)
    assert beyond == "-"
    np.testing.assert_allclose([float(x) for x in cells], [0.0, 0.0, 0.0, -0.01, -0.03, -0.05], atol=1e-6)


def test_a_grid_did_not_know_a_motion_where_two_are_as_small() -> None:
    """A peg with .1 to either wall, shifted by p, is to touch: .1 - |p|, either of both at 0, no value in between."""
    walls = [Box((1, 4, 4), centre=(side * 1.6, 0, 0)).vertices for side in (-1, 1)]
    peg = Box((2, 2, 2), name="peg")
    place = fo.Size("place", "movable", faces=["-x", "+x"], along="x", tolerance=0.05)
    motion = fo.Translation("x")
    problem = fo.Problem(peg, fo.Body.from_parts(walls), sizes=[place], motion=motion, goal="touch", unit="mm")
    (grid,) = grids(fo.compensation_map(problem), problem, lines=3)
    assert [abs(float(row[0])) for row in grid.cells] == pytest.approx([0.05, 0.1, 0.05])
    assert not grid.between


def test_what_sizes_measure_as_drawn() -> None:
    turns = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    ring = np.column_stack([3.0 * np.cos(turns), 3.0 * np.sin(turns)])
    pin = fo.Body.convex([[*point, z] for z in (0.0, 7.0) for point in ring])
    for asked, measure in (
        ({"faces": "cylinder radius 3", "each": 0.5}, 6.0),
        ({"faces": "cylinder radius 3"}, 3.0),
        ({"faces": ("+z", "-z"), "each": (0.25, 0.75)}, 7.0),
        ({"faces": ("+z", "-z"), "each": (0.25, 0.25)}, np.nan),  # half of what it grows by
        ({"faces": ("+z", "-z"), "along": "z"}, np.nan),  # a place
        ({"faces": "+z"}, 7.0),  # from the face across, which stays
        ({"faces": "+z", "each": -1.0}, np.nan),
        ({"faces": "+z", "each": 0.5}, np.nan),
        ({"scale": "z"}, 7.0),
    ):
        found = fo.Size("own", "movable", **asked).dimensions(pin)
        assert [*found.values()] == pytest.approx([measure] * (not np.isnan(measure)))
    ends = (-1, 1, 0, 1), (1, 2, 0, 4), (-2, -1, 0, 4)
    ends = [[*product((a, b), (0, 2), (c, d))] for a, b, c, d in ends]
    floor = fo.Size("depth", "static", faces={"through": (0, 1, 1)}, each=-1.0)
    assert floor.dimensions(fo.Body.from_parts(ends)) == {"face top": 3.0}  # of a slot: from what it is cut into


def test_cases_are_a_frame_and_a_card() -> None:
    answers = fo.solve_all(peg(), requirement="AB", effort="quick")
    frame = answers.to_frame()
    assert list(frame["case"]) == list(answers) == ["A", "B"]
    assert frame["amount"].tolist() == [solution.amount for solution in answers.values()]
    assert list(frame.columns) == ["case", "status", "usable", "amount", "lower_bound", "TX"]  # 22 of a free motion
    assert list(answers.to_frame(full=True).columns) == list(answers.rows()[0])
    card = answers._repr_html_()
    assert all(f">{name}</td>" in card for name in answers)
    assert "2 cases" in card


def test_the_card_of_cases_tells_whole_motions_and_no_bound_above_its_amount() -> None:
    """Chamfers at 45 deg that lie on each other, 1.5 / sqrt(2) from both centres: 1.5 % of a shift in x and in y."""
    chamfered = np.array([(x, y, z) for x, y in ((-1, -1), (1, -1), (1, 0.5), (0.5, 1), (-1, 1)) for z in (-1, 1)])
    name = "a peg whose name is rather long"
    one = fo.Body.convex(chamfered, seed=(0, 0, 0), name=name)
    two = fo.Body.convex(np.array([1.5, 1.5, 0.0]) - chamfered, seed=(1.5, 1.5, 0), name="wall")
    motion = fo.Translation("x") >> fo.Translation("y")
    asked = fo.Problem(one, two, tolerance=0.01, requirement="A", goal="touch", motion=motion, unit="mm", name="peg")
    card = fo.solve_all(asked, requirement="AD", effort="proved")._repr_html_()
    cells = [line.split(">")[-1] for line in card.split("</td>")]
    for sign in "-+":
        assert f"move {name} 0.015 mm along {sign}x and 0.015 mm along {sign}y" in cells
    assert 0.02 * 1.5 / 2**0.5 > 0.02121
    assert cells.count("0.02121") == 4  # both amounts and both bounds


def test_one_bound_was_two_numbers_by_the_time_that_its_proof_had() -> None:
    """.02 proved to 6e-6 and to 3e-5: ".01999, to 3e-05" stood in the report, "0.02, exact" at the terminal."""
    solution = fo.solve(peg())
    within = [replace(solution, amount=0.02, lower_bound=0.02 * (1.0 - gap)) for gap in (6e-6, 3e-5, 2e-4)]
    assert [bound_text(own) for own in within] == ["0.02\nto 1e-04", "0.02\nto 1e-04", "0.01999\nto 2e-04"]


def test_a_motion_longer_than_a_cell_stands_whole_in_its_card() -> None:
    told = "; ".join(f"move part {k} 0.1 mm along -x and 0.1 mm along +z" for k in range(3))
    assert f">{told}</td>" in Card("cases", tables=[(("case", "motion"), [("A", told)])]).html


def test_two_pins_had_no_diameter_and_an_axis_no_place() -> None:
    """Pins of 5.96 at x = -41 and 41: one diameter, and where they stand along x or y."""
    pins = [fo.Cylinder(2.98, 14, base=(x, 3, 0)) for x in (-41, 41)]
    case = fo.joined(fo.Box((100, 60, 8), name="case"), *pins)
    both = ["cylinder radius 2.98 no. 1", "cylinder radius 2.98 no. 2"]
    sizes = [
        fo.Size("pin", "static", faces=both, each=0.5, tolerance=0.012),
        fo.Size("spacing", "static", faces=both[1], along="x", tolerance=0.06),
        fo.Size("both along", "static", faces=both, along="x", tolerance=0.06),
        fo.Size("off", "static", faces=both, along="-y", tolerance=0.06),
        fo.Size("not across", "static", faces=[both[1], "+x"], along="x", tolerance=0.06),
    ]
    made = {"pin": 0.01, "spacing": 0.06}
    asked = fo.Problem(fo.Box((1, 1, 1), centre=(0, 0, 40)), case, sizes=sizes, made=made, motion=fo.Translation("z"))
    told = [(row["drawn"], row["made"]) for row in size_rows(asked)]
    assert told == [("5.96", "5.97"), ("at 41", "at 41.06"), *[("\u2013",) * 2], ("at -3", "at -3"), ("\u2013",) * 2]


def rail() -> fo.Body:
    """A rail 25 high on a base 10 high, both from x = 10 to 30 and 0 to 80: floors F3 and F6 beside it."""
    boxes = ((0, 80), (0, 40), (0, 10)), ((10, 30), (0, 40), (10, 25))
    joined = [fo.Box(np.ptp(own, axis=1), centre=np.mean(own, axis=1)) for own in boxes]
    return fo.joined(*joined, name="rail")


def rail_sizes(**tolerance: Any) -> list[fo.Size]:
    faces = {"height": "+z", "right": (70, 20, 10), "left": (5, 20, 10), "foot": "-z"}
    selected = {name: {"through": own} if isinstance(own, tuple) else own for name, own in faces.items()}
    selected["height"] = {"through": (20, 20, 25)}
    return [fo.Size(name, "static", faces=own, tolerance=tolerance.get(name, 0.1)) for name, own in selected.items()]


def on_rail(**arguments: Any) -> fo.Problem:
    block = fo.Box((10, 10, 5), centre=(20, 20, 27.5), name="block")
    given = {"sizes": rail_sizes(), "motion": fo.Translation("z"), "goal": "touch", "unit": "mm", **arguments}
    return fo.Problem(block, rail(), **given)


@pytest.mark.parametrize(
    ("made", "lengths"),
    [
        ({}, {("F3", "F6"): 15.0}),
        ({"height": -0.08}, {("F3", "F6"): 14.92}),
        ({"height": -0.08, "right": 0.03}, {("F3",): 14.92, ("F6",): 14.89}),
        ({"height": -0.08, "right": 0.03, "left": 0.03}, {("F3", "F6"): 14.89}),
        ({"height": 0.01, "foot": 0.05}, {("F3", "F6"): 15.01}),
    ],
)
def test_a_height_as_made_was_told_to_a_face_as_drawn(made: dict[str, float], lengths: dict[Any, float]) -> None:
    """A rail 15 above both floors, of which one is .03 higher as made: 14.89 to that, 14.92 to the other."""
    problem = on_rail(made=made)
    text = ", ".join(f"{x:g} to face{'s' * (len(to) > 1)} {', '.join(to)}" for to, x in lengths.items())
    height = size_rows(problem)[0]
    assert (height["drawn"], sorted(height["made"].split(", "))) == ("15 to faces F3, F6", sorted(text.split(", ")))
    levels = np.unique(np.round(problem.static.vertices[:, 2], 9))
    assert {*np.round(levels[-1] - levels, 9).tolist()} >= {*lengths.values()}


def test_what_sizes_measure_counts_all_that_moves_either_end() -> None:
    """A pin of 6 and 7 long: both ends off, the length scaled, the diameter by two sizes, and shifted."""
    pin = fo.Cylinder(3.0, 7.0, base=(1.0, 0.0, 0.0))
    named = {
        "length": {"faces": "+z"}, "foot": {"faces": "-z"}, "both": {"faces": ("+z", "-z"), "each": 0.5},
        "long": {"scale": "z"}, "wide": {"faces": "cylinder radius 3", "each": 0.5},
        "radius": {"faces": "cylinder radius 3"}, "place": {"faces": "cylinder radius 3", "along": "x"},
        "oval": {"scale": "x"},
    }  # fmt: skip
    sizes = {name: fo.Size(name, "static", **own) for name, own in named.items()}

    def made(name: str, **off: float) -> dict[str, float]:
        return sizes[name].dimensions(pin, {sizes[own]: x for own, x in off.items()})

    assert made("length", length=0.1) == pytest.approx({"face bottom": 7.1})
    assert made("length", length=0.1, foot=0.02, place=0.5, wide=0.1) == pytest.approx({"face bottom": 7.12})
    assert made("foot", length=0.1, foot=0.02, both=-0.01) == pytest.approx({"face top": 7.11})
    assert made("length", length=0.1, long=0.01) == pytest.approx({"face bottom": 7.07 + 0.1})
    assert made("both", foot=0.02, both=0.01) == pytest.approx({"": 7.03})
    assert made("long", foot=0.02, long=0.01) == pytest.approx({"": 7.07 + 0.02})
    assert made("wide", wide=0.02, radius=0.01, place=0.3, long=0.5) == pytest.approx({"": 6.04})
    assert made("radius", wide=0.02, radius=0.01) == pytest.approx({"": 3.02})
    assert made("oval", oval=0.01) == pytest.approx({"": 6.06})
    assert made("oval", oval=0.01, radius=0.01) == pytest.approx({"": 6.06 + 0.02})
    assert not made("wide", oval=0.01)  # no longer round
    assert sizes["place"].position(pin, {sizes["place"]: 0.3}) == pytest.approx(1.3)
    two = fo.Size("left and right", "static", faces=[{"through": (x, 20, 10)} for x in (5, 70)], each=1.0)
    right = rail_sizes()[1]
    assert two.dimensions(rail()) == {"face bottom": 10.0}
    assert not two.dimensions(rail(), {right: 0.03})  # its own faces part
    scaled = on_rail(sizes=rail_sizes(), made={"foot": 0.05}, target=(1.0, 1.01))
    assert [scaled.dimensions_at(size, {})["face bottom"] for size in scaled.sizes[1:3]] == pytest.approx([10.1505] * 2)


@pytest.mark.usefixtures("coarse_maps")
def test_a_grid_told_a_width_to_a_face_that_moves_in_it(tmp_path: Path) -> None:
    """15 from the floors; over a floor too it is a deviation of the top alone, and with one floor made higher."""
    problem = on_rail(made={"foot": 0.02})
    for over, made, name, first in (
        (["height"], {}, "height to faces F3, F6", "14.9 mm (-0.1)"),
        (["right"], {"foot": 0.02}, "right to face bottom", "9.92 mm (-0.1)"),
        (["height"], {"left": 0.03, "right": 0.03}, "height to faces F3, F6", "14.87 mm (-0.1)"),
        (["height"], {"right": 0.03}, "height of face top", "-0.1 mm"),
        (["height", "right"], {}, "height of face top", "-0.1 mm"),
        (["height", "foot"], {}, "height to faces F3, F6", "14.9 mm (-0.1)"),
    ):
        asked = problem.changed(made=made)
        found = fo.compensation_map(asked, over=over)
        table, page = write_grids(found, asked, tmp_path / "map", title="rail")
        (head, *_), (row, *_), *_ = csv.reader(table.read_text(encoding="utf-8").splitlines())
        assert (head.split(": ")[1].split(" down")[0], row) == (name, first)
        assert name in page.read_text(encoding="utf-8")


def test_scales_are_told_from_what_they_are_not() -> None:
    """ "0.6, 1" stood for targets of which one can be reached and one cannot."""
    scales = [0.5999999, 0.6, 0.6000001, 1.0000003, 1.0 / 3.0, 1.02 * 1.1, 1.0]
    assert [scale_text(own) for own in scales] == [
        "0.5999999", "0.6", "0.6000001", "1.0000003", "0.333333", "1.122", "1"
    ]  # fmt: skip
