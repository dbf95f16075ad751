"""Commands are told of in one place: their row."""

import json
from pathlib import Path

import jsonschema
import pytest
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
    assert {*asked, "solve"} == {name for name, row in ROWS.items() if row.answers}
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
