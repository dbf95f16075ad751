"""The problems with meshes: each loads, solves to its closed form and is verified; the meshes can be made again."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ordinary import PROBLEMS, problems
from scripts import loaded
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.geometry.files import mesh_formats
from fcdm_opt.problem.problem import GOALS, SIGNS

SOLVED = (
    "peg_square",
    "peg_tapered",
    "peg_hexagon",
    "dovetail",
    "keyway",
    "lid",
    "gears",
    "nut",
    "bracket",
    "locating",
    "slot_and_key",
)
IMPOSSIBLE = ("keyway_jammed", "bracket_stuck")  # and peg_square_tight, on the command line
CLOSED_FORM = 1e-9  # of lengths and angles of order one; a nominal pair given to seven digits costs 3e-11
VOLUMES = {
    "square_plate.stl": 10 * (40**2 - 20**2),
    "square_peg.stl": 26 * 19.5**2,
    "hexagon_plate.off": 10 * 2 * math.sqrt(3) * (16**2 - 10**2),
    "hexagon_peg.ply": 26 * 2 * math.sqrt(3) * 9.75**2,
    "dovetail_rail.obj": 60 * (48 * 8 + 24 * 8),
    "dovetail_slide.obj": 30 * (48 * 16 - 25.5 * 9),
    "keyway_shaft.ply": 60 * (40**2 - 2 * 12**2 - 12.5 * 8),
    "keyway_key.off": 80 * 12**2,
    "lid_box.glb": 40 * 30 * 20 - 36 * 26 * 18,
    "lid.glb": 40 * 30 * 4 + 35 * 25 * 3,
    "nut.off": 10 * 2 * math.sqrt(3) * (16**2 - 10.25**2),
    "nut_key.ply": 70 * 2 * math.sqrt(3) * 10**2,
    "bracket.obj": 24 * (30 * 3 + 6 * 25) / 1000,  # cm
    "bracket_plate.stl": 80 * 40 * 8,
    "bracket_ribs.off": 2 * 4 * 40 * 1.5,
}


def maker() -> Any:
    return loaded(PROBLEMS / "make_meshes.py")


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


# --------------------------------------------------------------------------------------------------------------- meshes


def test_the_meshes_come_out_the_same_again(tmp_path):
    maker().main(tmp_path)
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    kept = {path.name: path.read_bytes() for path in (PROBLEMS / "meshes").iterdir() if path.suffix != ".md"}
    assert made == kept


def test_every_mesh_is_used_and_every_format_but_step_occurs():
    texts = "".join((PROBLEMS / f"{name}.toml").read_text() for name in SOLVED)
    assert all(f'"meshes/{name}"' in texts for name in maker().MESHES)
    assert {Path(name).suffix for name in maker().MESHES} == {".stl", ".obj", ".ply", ".off", ".glb"}
    assert {Path(name).suffix for name in maker().MESHES} <= set(mesh_formats)


@pytest.mark.parametrize("name", VOLUMES)
def test_a_mesh_needs_no_repair_and_has_its_volume(name):
    path = PROBLEMS / "meshes" / name
    vertices, faces, *_ = fo.geometry.files.drawn_mesh(path, unit="mm")
    mesh = fo.geometry.mesh.checked_mesh(vertices, faces)
    assert mesh.volume == pytest.approx(VOLUMES[name], rel=1e-12)
    assert mesh.repairs == ()
    assert fo.Body.from_file(path, unit="mm").deviation == (0.0, 0.0)


# ------------------------------------------------------------------------------------------------------------- problems


def test_every_goal_and_every_requirement_occurs():
    cases = [problem for name in SOLVED for problem in problems(name).values()]
    assert {problem.goal for problem in cases} == set(GOALS)
    assert {problem.requirement for problem in cases} == {None, *SIGNS}


def test_a_flush_nominal_contact_is_seated_by_default():
    problem = problems("lid")["D flush on the rim"]
    assert problem.request["goal"] is None
    assert problem.goal == "seat"


OUTSIDE = ("nut made too small",)  # it no longer goes over the key


@pytest.mark.parametrize("name", SOLVED)
def test_each_case_is_solved_to_its_closed_form_and_verified(name):
    for case, problem in problems(name).items():
        solution = fo.solve(problem)
        assert solution.verified, (case, solution.status)
        assert solution.usable == (case not in OUTSIDE), (case, solution.status)
        assert problem.published is not None, case
        assert list(solution.parameters.values()) == pytest.approx(problem.published, rel=CLOSED_FORM, abs=CLOSED_FORM)
        assert solution.lower_bound <= solution.amount * (1 + CLOSED_FORM)


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_where_no_motion_is_the_right_answer_none_is_found(name):
    for case, problem in problems(name).items():
        solution = fo.solve(problem)
        assert not solution.status.found, (case, solution.parameters)
        assert solution.parameters == {}


def test_a_part_that_fits_is_found_by_the_same_question():
    # the planted counterpart of the test above: just within the hole, just within the room between the ribs
    fits = problems("peg_square_tight")["shift"].changed(target=(10 / 9.75 - 1e-6, 1.0))
    assert fo.solve(fits).usable
    fits = problems("bracket_stuck")["shift within the ribs"].changed(target=(15.5 / 15 - 1e-6, 1.0))
    assert fo.solve(fits).usable


@pytest.mark.parametrize(("name", "code"), [("gears", 0), ("nut", 1), ("peg_square_tight", 1)])
def test_the_exit_code_tells_whether_there_is_a_motion(name, code):
    result = run("solve", PROBLEMS / f"{name}.toml", "--json")
    assert result.exit_code == code
    (document,) = json.loads(result.stdout)["files"]
    assert len(document["cases"]) == len(problems(name))


# ---------------------------------------------------------------------------------------------------------------- gears


def outline(name: str, centre: float, rho: float) -> np.ndarray:
    """Outline of a gear sector in the plane, scaled about its axis."""
    corners = maker().MESHES[name][0].vertices
    corners = corners[: len(corners) // 2, :2] - [centre, 0.0]
    return rho * corners + [centre, 0.0]


def least_turn(driver: np.ndarray, driven: np.ndarray, sense: float) -> float:
    """Least turn > 0 of the driver about the origin that brings a corner of either onto a side of the other."""
    turns = []
    for corners, sides, sign in ((driver, driven, sense), (driven, driver, -sense)):
        for corner in corners:
            radius, angle = np.hypot(*corner), math.atan2(corner[1], corner[0])
            for start, end in zip(sides, np.roll(sides, -1, axis=0), strict=True):
                along = end - start
                normal = np.array([along[1], -along[0]]) / np.hypot(*along)
                reach = math.acos(np.clip(normal @ start / radius, -1.0, 1.0))
                for turn in (reach, -reach):
                    place = math.atan2(normal[1], normal[0]) + turn
                    met = radius * np.array([math.cos(place), math.sin(place)])
                    share = (met - start) @ along / (along @ along)
                    if abs(normal @ (met - start)) < 1e-9 and 0.0 <= share <= 1.0:
                        turns.append(sign * (place - angle) % (2 * math.pi))
    return min(turns)


@pytest.mark.parametrize("case", ["take up the play forward", "take up the play backward", "both made smaller"])
def test_the_gears_turn_as_far_as_the_first_corner_lets_them(case):
    problem = problems("gears")[case]
    assert problem.published is not None
    sense = math.copysign(1.0, problem.published[0])
    driver = outline("gear_driver.obj", 0.0, problem.target[0])
    driven = outline("gear_driven.obj", 80.0, problem.target[1])
    assert sense * least_turn(driver, driven, sense) == pytest.approx(problem.published[0], rel=1e-12)


def test_the_gears_keep_the_room_for_oil():
    problem = problems("gears")["room for oil"]
    assert problem.published is not None
    moved = np.array([problem.published[0], 0.0])
    driver = outline("gear_driver.obj", 0.0, problem.target[0]) + moved
    driven = outline("gear_driven.obj", 80.0, problem.target[1])
    gaps = []
    for corners, sides in ((driver, driven), (driven, driver)):
        for start, end in zip(sides, np.roll(sides, -1, axis=0), strict=True):
            along = end - start
            share = np.clip((corners - start) @ along / (along @ along), 0.0, 1.0)
            gaps.append(np.linalg.norm(corners - start - share[:, None] * along, axis=1).min())
    assert min(gaps) == pytest.approx(problem.clearance, rel=1e-12)
