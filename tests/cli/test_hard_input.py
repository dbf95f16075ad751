"""Problem files and command lines that once ended in a traceback."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from fcdm_opt.cli import app
from fcdm_opt.cli.common import written
from fcdm_opt.errors import InputError
from fcdm_opt.problem.problem import load_problems

# corner (1, 0, 0) of the movable body, one before the corners at x = 2 of the static one
BODIES = """
[bodies.movable]
vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
[bodies.static]
vertices = [[2, -3, -3], [2, 3, -3], [2, 0, 3], [3, 0, 0]]
[defaults]
goal = "touch"
motion = [{ translation = "x" }]
"""
CASE = '[[case]]\nname = "a"\ntarget = [1.0, 1.0]\n'


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments: str, text: str = BODIES + CASE) -> Any:
    """Run the command in this process on a file p.toml; an error that no one caught is raised."""
    Path("p.toml").write_text(text, encoding="utf-8")
    return CliRunner().invoke(app, list(arguments), catch_exceptions=False)


# -------------------------------------------------------------------------------------------------------------- files


@pytest.mark.parametrize(
    "text",
    [
        BODIES + '[[case]]\nname = "a"\ntarget = [1' + "0" * 5000 + ", 1.0]\n",
        "x = " + "[" * 3000 + "]" * 3000 + "\n" + BODIES + CASE,
        'bodies = "a\\u0000b"\n[[case]]\nname = "a"\ntarget = [1, 1]\nmotion = [{ translation = "x" }]\n',
    ],
    ids=["5000 digits", "3000 brackets", "NUL in a path"],
)
def test_files_that_python_cannot_digest_raised_another_error(here: Path, text: str) -> None:
    (here / "bad.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"bad\.toml"):
        load_problems(here / "bad.toml")


def test_a_byte_order_mark_was_an_invalid_statement(here: Path) -> None:
    """Editors put it there; it says nothing."""
    (here / "bom.toml").write_bytes(b"\xef\xbb\xbf" + (BODIES + CASE).encode())
    (problem,) = load_problems(here / "bom.toml")
    assert problem.name == "a"


def test_a_face_of_two_corners_was_accepted(here: Path) -> None:
    text = (BODIES + CASE).replace("[bodies.static]", "faces = [[1, 4]]\n[bodies.static]")
    (here / "face.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError):
        load_problems(here / "face.toml")


# ------------------------------------------------------------------------------------------------------- command line


@pytest.mark.parametrize("out", ["afile", "afile/x"])
@pytest.mark.parametrize("command", ["solve", "curve"])
def test_a_folder_that_cannot_be_made_ended_in_a_traceback(here: Path, command: str, out: str) -> None:
    (here / "afile").touch()
    result = run(command, "p.toml", "--out", out)
    assert result.exit_code == 2
    assert "afile" in result.stderr
    assert not (here / "afile").read_bytes()


@pytest.mark.parametrize(
    ("line", "allowed"),
    [
        ("solve p.toml --out o.svg", "a folder"),
        ("curve p.toml --out o.PNG", "a folder"),
        ("map p.toml --out o.html", "a folder"),
        ("study p.toml --out o.csv", "a folder"),
        ("solve p.toml --table o.xlsx", ".csv or .txt"),
        ("report p.toml --out o.svg", ".html"),
        ("init a.stl b.stl --out o.svg", ".toml"),
    ],
)
def test_a_name_of_another_kind_of_file_made_a_folder_of_that_name(here: Path, line: str, allowed: str) -> None:
    command, *arguments = line.split()
    result = run(command, *arguments)
    assert result.exit_code == 2
    assert allowed.split()[-1] in result.stderr.partition("allowed: ")[2]
    assert [own.name for own in here.iterdir()] == ["p.toml"]
    assert written()("--out", Path("run.1")) == Path("run.1")  # the name of a folder


@pytest.mark.slow
def test_a_case_name_longer_than_file_names_may_be_lost_the_answer(here: Path) -> None:
    result = run("solve", "p.toml", "--out", "o", "--json", text=BODIES + CASE.replace('"a"', f'"{"L" * 300}"'))
    assert "L" * 300 in json.dumps(json.loads(result.stdout))


@pytest.mark.slow
def test_names_outside_ascii_ended_in_a_traceback_on_ascii_terminals(here: Path) -> None:
    """The whole command, with a standard output that can print ASCII only."""
    (here / "p.toml").write_text(BODIES + CASE.replace('"a"', '"Gr\u00f6\u00dfe"'), encoding="utf-8")
    code = "from fcdm_opt.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, "solve", "p.toml"],
        env={**os.environ, "PYTHONIOENCODING": "ascii:strict"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert "Traceback" not in done.stderr
    assert done.returncode == 0
    assert "Gr" in done.stdout


def test_control_characters_of_a_file_reached_the_terminal(here: Path) -> None:
    result = run("solve", "p.toml", text=BODIES + CASE.replace('"a"', '"a\\u001b[31mred"'))
    assert "red" in result.output  # the name is printed or refused, what it would do to a terminal is not done
    assert "\x1b" not in result.output
