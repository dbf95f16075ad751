"""`init`: the file that it writes loads and solves, wherever the parts are; `schema`: files are checked by it."""

from __future__ import annotations

import json
import os
import re
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from typer.testing import CliRunner

from fcdm_opt import load_problems, solve
from fcdm_opt.cli import app
from fcdm_opt.design.schemas import DIALECT, KINDS, json_schema
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.tolerance.drafting.choice import TOLERANCE
from fcdm_opt.tolerance.drafting.draft import draft
from fcdm_opt.tolerance.drafting.situation import Situation
from fcdm_opt.tolerance.files import ProblemFile
from fcdm_opt.tolerance.problem import SIGNS

PROBLEMS = Path(__file__).parent.parent / "problems"
MESHES = PROBLEMS / "meshes"
CUBE = "OFF\n8 6 0\n{}\n4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n"


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


def box(path: Path, sides: tuple[float, float, float], middle: tuple[float, float, float], turn: Any = None) -> Path:
    """Write a box as an OFF file."""
    corners = np.array([(x, y, z) for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]) * sides
    corners = corners if turn is None else corners @ np.transpose(turn)
    path.write_text(CUBE.format("\n".join(" ".join(map(repr, row)) for row in (corners + middle).tolist())))
    return path


def drafted(movable: Path, static: Path, folder: Path) -> tuple[str, Path]:
    """Write the draft of two meshes, and return its text and its path."""
    path = folder / "p.toml"
    text = draft(movable, static, file=path).text
    path.write_text(text)
    return text, path


# a cube of side 10 on a table 4 thick, whose seeds are their middles: for sizes (1 + s, 1 + t) the gap changes by
# -5 s - 2 t, so that TZ = 5 s + 2 t - gap brings them together
PLACES = {"touching": 0.0, "apart": 3.0, "overlapping": -1.0}


@pytest.mark.parametrize("unit", [1.0, 1000.0, 1e-5])
@pytest.mark.parametrize("state", PLACES)
def test_a_cube_on_a_table_solves_as_written(tmp_path: Path, state: str, unit: float) -> None:
    gap, away = PLACES[state] * unit, 1e3 * unit  # far from the origin too
    cube = box(tmp_path / "cube.off", (10 * unit,) * 3, (away, 0.0, 5 * unit + gap))
    table = box(tmp_path / "table.off", (40 * unit, 40 * unit, 4 * unit), (away, 0.0, -2 * unit))
    text, path = drafted(cube, table, tmp_path)
    goals = {"touching": "seat", "apart": "touch", "overlapping": "clear"}
    assert "NOT SOLVED" not in text
    for problem in load_problems(path):
        solution = solve(problem)
        s, t = (TOLERANCE * sign for sign in SIGNS[str(problem.requirement)])
        assert problem.goal == goals[state]
        assert solution.usable
        assert solution.parameters == pytest.approx({"TZ": unit * (5 * s + 2 * t) - gap}, abs=1e-8 * unit)


def test_what_is_said_of_the_state_agrees_with_the_closed_form(tmp_path: Path) -> None:
    for state, gap in PLACES.items():
        cube = Body.from_file(box(tmp_path / "cube.off", (10.0,) * 3, (0.0, 0.0, 5 + gap)), unit="mm")
        table = Body.from_file(box(tmp_path / "table.off", (40.0, 40.0, 4.0), (0.0, 0.0, -2.0)), unit="mm")
        found = Situation(cube, table)
        assert (found.state, found.gap) == (state, pytest.approx(gap, abs=1e-12))
        assert found.growth == pytest.approx((7 + gap) / 7)  # 5 rho + 2 rho = 7 + gap
        assert found.normal == pytest.approx([0, 0, -1])
        near = found.nearest
        assert near is not None
        # the foot of the perpendicular from (1, 1) to 5 rho_1 + 2 rho_2 = 7 + gap
        assert near.pair == pytest.approx([1 + 5 * gap / 29, 1 + 2 * gap / 29])


def test_tilted_far_and_unlike_parts_are_told_and_solved(tmp_path: Path) -> None:
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    tilted = box(tmp_path / "tilted.off", (1.0, 1.0, 1.0), (0.0, 0.0, 500.0), turn)
    table = box(tmp_path / "table.off", (190.0, 190.0, 4.0), (0.0, 0.0, -2.0))
    text, path = drafted(tilted, table, tmp_path)
    assert "times as large as the other" in text
    assert "WARNING: the parts are" not in text
    assert all(solve(problem).usable for problem in load_problems(path))
    far = box(tmp_path / "far.off", (1.0, 1.0, 1.0), (0.0, 0.0, 5000.0))
    assert "sizes apart" in drafted(far, table, tmp_path)[0]


def test_parts_in_the_same_place_can_be_taken_apart(tmp_path: Path) -> None:
    cube = box(tmp_path / "cube.off", (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
    text, path = drafted(cube, cube, tmp_path)
    assert "screw" not in text  # the seeds define no axis
    assert all(solve(problem).usable for problem in load_problems(path))


@pytest.mark.parametrize(
    ("movable", "static", "goal"),
    [("keyway_key.off", "keyway_shaft.ply", "seat"), ("bracket.obj", "bracket_plate.stl", "touch")],
)
def test_meshes_that_are_no_boxes_solve_as_written(tmp_path: Path, movable: str, static: str, goal: str) -> None:
    out = tmp_path / "own.toml"
    result = run("init", MESHES / movable, MESHES / static, "--out", out)
    assert result.exit_code == 0
    assert result.stderr.strip() == f"wrote {out}"
    assert result.stdout.splitlines()[-1] == f"next: fcdm-opt solve {out}"
    (document,) = json.loads(run("solve", out, "--json").stdout)
    assert [case["usable"] for case in document["cases"]] == [True] * 4
    assert {case["problem"]["case"][0]["goal"] for case in document["cases"]} == {goal}


def test_every_alternative_that_is_offered_is_allowed(tmp_path: Path) -> None:
    """Each commented key, taken in place of the one above it, is a problem that can be read; blocks as a whole."""
    cube = box(tmp_path / "cube.off", (10.0,) * 3, (18.0, 0.0, 8.0))
    table = box(tmp_path / "table.off", (11.0, 40.0, 4.0), (0.0, 0.0, -2.0))
    text, path = drafted(cube, table, tmp_path)
    lines, tried = text.splitlines(), 0
    for k, line in enumerate(lines):
        key = re.match(r"#([a-z_]+) = ", line)
        if key is None or any(own.startswith("#[[") for own in lines[max(0, k - 4) : k]):
            continue
        start = max(j for j, own in enumerate(lines[:k]) if own.startswith("[")) if k > 15 else 0
        kept = [own for j, own in enumerate(lines) if not (start <= j < k and own.startswith(f"{key.group(1)} = "))]
        kept[kept.index(line)] = line[1:]
        path.write_text("\n".join(kept))
        if '"at"' in line or '"beyond"' in line:
            path.write_text(path.read_text().replace('nominal = "drawn"', "nominal = 1"))
        if key.group(1) != "pair":
            load_problems(path)
        tried += 1
    block = re.search(r"^#\[\[keep_out\]\](\n#.*)+", text, re.MULTILINE)
    assert block is not None
    ProblemFile.model_validate(tomllib.loads(text.replace(block.group(), block.group().replace("\n#", "\n")[1:])))
    assert tried >= 20


def test_names_of_all_kinds_and_paths_from_the_file(tmp_path: Path) -> None:
    odd = 'it\'s "odd" ü\\n'
    for folder in (tmp_path / odd, tmp_path / "deep" / "er"):
        folder.mkdir(parents=True)
    cube = box(tmp_path / odd / f"~{odd}.off", (1.0, 1.0, 1.0), (0.0, 0.0, 0.5))
    table = box(tmp_path / odd / "tab\tle.off", (4.0, 4.0, 1.0), (0.0, 0.0, -0.5))
    path = tmp_path / "deep" / "er" / "p.toml"
    path.write_text(draft(cube, table, file=path).text)
    assert tomllib.loads(path.read_text())["bodies"]["movable"]["file"] == f"../../{odd}/~{odd}.off"
    assert load_problems(path)[0].movable.name == f"~{odd}"
    beside = tmp_path / odd / "p.toml"
    beside.write_text(draft(cube, table, file=beside).text)
    assert len(load_problems(beside)) == len(SIGNS)  # "~" is no home folder there


def test_nothing_is_overwritten_unless_asked_and_never_a_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    box(tmp_path / "a.off", (1.0, 1.0, 1.0), (0.0, 0.0, 0.5))
    box(tmp_path / "b.off", (4.0, 4.0, 1.0), (0.0, 0.0, -0.5))
    (tmp_path / "a-b.toml").write_text("mine")
    refused = run("init", "a.off", "b.off")
    assert (refused.exit_code, "--force" in refused.stderr) == (2, True)
    assert (tmp_path / "a-b.toml").read_text() == "mine"
    assert run("init", "a.off", "b.off", "--force").exit_code == 0
    assert load_problems("a-b.toml")
    os.link("a.off", "a.toml")
    for out in ("a.toml", "b.off", "."):
        assert run("init", "a.off", "b.off", "--out", out, "--force").exit_code == 2
    assert (tmp_path / "b.off").read_text().startswith("OFF")
    assert run("init", "a.off", "b.off", "--unit", "parsec").exit_code == 2


def test_a_mesh_that_is_no_solid_is_named_and_nothing_is_written(tmp_path: Path) -> None:
    cube = box(tmp_path / "cube.off", (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
    open_ = tmp_path / "open.off"
    open_.write_text(cube.read_text().replace("8 6 0", "8 5 0").replace("4 1 3 7 5\n", ""))
    out = tmp_path / "new" / "p.toml"
    result = run("init", cube, open_, "--out", out)
    assert result.exit_code == 2
    assert f"error: {open_}: body 'open': the surface is not closed" in result.stderr
    assert not out.parent.exists()
    assert run("init", cube, tmp_path / "none.stl", "--out", out).exit_code == 2


# --------------------------------------------------------------------------------------------------------------- schema


@pytest.mark.parametrize("kind", KINDS)
def test_the_schema_is_one_and_takes_all_files_that_are_here(kind: str) -> None:
    schema = json.loads(run("schema", "--what", kind).stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["$schema"] == DIALECT
    assert schema["$id"].startswith("urn:")
    assert schema["title"]
    assert '"null"' not in json.dumps(schema)  # TOML has no such value
    files = sorted((PROBLEMS if kind == "problem" else PROBLEMS / "studies").glob("*.toml"))
    assert len(files) >= 5
    check = jsonschema.Draft202012Validator(schema)
    for file in files:
        data = tomllib.loads(file.read_text())
        check.validate(data)
        assert not check.is_valid({**data, "nominall": 1}), file
        assert not check.is_valid({**data, "title": 1}), file


def test_an_unknown_kind_of_file_is_refused() -> None:
    assert run("schema", "--what", "recipe").exit_code == 2
    with pytest.raises(InputError, match="allowed: problem, study"):
        json_schema("recipe")
