"""Commands are told of in one place: their row."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import typer
from typer.testing import CliRunner

from fcdm_opt.cli import MODULES, app
from fcdm_opt.cli.registry import ROWS

LOOP = Path(__file__).parents[2] / "problems" / "assemblies" / "loop_of_four.toml"


def test_every_command_has_a_row_and_every_row_a_command() -> None:
    found = {name.removesuffix("_command") for own in MODULES for name in vars(own) if name.endswith("_command")}
    assert found == {name for name, row in ROWS.items() if not row.lent}


def test_a_refusal_left_out_pose_and_stack_where_it_said_what_takes_assemblies() -> None:
    told = CliRunner().invoke(app, ["curve", str(LOOP)])
    assert told.exit_code == 2
    takers = [name for name, row in ROWS.items() if row.assemblies]
    assert {"pose", "stack", "map"} <= {*takers}
    assert f"{', '.join(takers)} take assemblies" in told.stderr


BLOCK = """
[bodies.movable]
vertices = [[1, 0, 0], [2, 0, 0], [1, 1, 0], [2, 1, 0], [1, 0, 1], [2, 0, 1], [1, 1, 1], [2, 1, 1]]
[bodies.static]
vertices = [[0, -1, -1], [1, -1, -1], [0, 2, -1], [1, 2, -1], [0, -1, 2], [1, -1, 2], [0, 2, 2], [1, 2, 2]]
[[size]]
name = "width"
body = "movable"
faces = ["-x"]
tolerance = 0.01
[[case]]
name = "A"
goal = "touch"
made = { width = 0.01 }
motion = [{ translation = "x" }]
"""


@pytest.mark.slow
def test_only_what_solve_writes_had_a_schema(tmp_path: Path) -> None:
    """What is written is taken, and is not where a number is a word."""
    (file := tmp_path / "block.toml").write_text(BLOCK, encoding="utf-8")
    run, example = CliRunner().invoke, str(LOOP.parents[1] / "example1.toml")
    asked = {  # and under which key of a case the answer is
        "map": ("map", [str(file), "--out", str(tmp_path)]),
        "range": ("", [example, "--case", "A"]),
        "whatif": ("drop", [str(file), "--drop"]),
        "pose": ("best_pose", [str(file)]),
        "stack": ("yield", [str(file), "--draws", "1000"]),
    }
    for name, (place, line) in asked.items():
        check = jsonschema.Draft202012Validator(json.loads(run(app, ["schema", "--what", name]).stdout))
        document = json.loads(run(app, [name, *line, "--json"]).stdout)
        check.validate(document)
        (case,) = document["files"][0]["cases"]
        assert "error" not in case, case
        answer = case[place] if place else case
        key = next(key for key, value in answer.items() if isinstance(value, float))
        answer[key] = "much"
        assert not check.is_valid(document), (name, key)


@pytest.mark.slow
def test_what_curve_faces_and_study_write_had_no_schema(tmp_path: Path) -> None:
    (file := tmp_path / "block.toml").write_text(BLOCK, encoding="utf-8")
    (study := tmp_path / "study.toml").write_text(
        'problem = "block.toml"\nvary = [{ key = "made.width", values = [0.0, 0.01] }]\n', encoding="utf-8"
    )
    asked: dict[str, tuple[list[str], Any]] = {  # and where a number stands in the document
        "curve": ([str(file)], lambda told: (told["files"][0]["curves"][0]["segments"][0], "slope")),
        "faces": ([str(file)], lambda told: (told["files"][0]["faces"]["movable"][0], "area")),
        "study": ([str(study), "--out", str(tmp_path / "out")], lambda told: (told["counts"], "SOLVED")),
    }
    for name, (line, place) in asked.items():
        what = "study-result" if name == "study" else name
        schema = json.loads(CliRunner().invoke(app, ["schema", "--what", what]).stdout)
        check = jsonschema.Draft202012Validator(schema)
        check.check_schema(schema)
        document = json.loads(CliRunner().invoke(app, [name, *line, "--json"]).stdout)
        check.validate(document)
        assert document["schema"] == schema["properties"]["schema"]["const"]
        where, key = place(document)
        where[key] = "much"
        assert not check.is_valid(document), name


def test_each_command_with_a_document_has_its_schema_and_a_mistyped_one_is_told_of_all() -> None:
    commands = typer.main.get_command(app)
    with_document = {
        name
        for name in ROWS
        if not ROWS[name].lent
        and "--json" in {opt for own in commands.get_command(None, name).params for opt in own.opts}
    }
    assert with_document == {name for name, row in ROWS.items() if row.answers}
    assert "did you mean 'curve'?" in CliRunner().invoke(app, ["schema", "--what", "curv"]).stderr
    allowed = CliRunner().invoke(app, ["schema", "--what", "x"]).stderr.partition("allowed: ")[2].strip().split(", ")
    names = {"solve": "result", "study": "study-result"}
    assert {*allowed} >= {names.get(name, name) for name in with_document}
    ids = [json.loads(CliRunner().invoke(app, ["schema", "--what", what]).stdout)["$id"] for what in allowed]
    assert len({*ids}) == len(ids) - 1  # "result" is "solve"
