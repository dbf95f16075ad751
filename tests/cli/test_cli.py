"""The command line: what it prints, writes and returns; and that importing the package stays light."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import fcdm_opt
from fcdm_opt.cli import app
from fcdm_opt.cli.guarding import BAD_INPUT, NO_MOTION, SOLVED
from fcdm_opt.cli.registry import ROWS
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Certificate, Check, Solution, Status

PROBLEMS = Path(__file__).parents[2] / "problems"
HELP = "import sys; from fcdm_opt.cli import main; sys.argv = ['fcdm-opt', '--help']"
HEAVY = ("numpy", "scipy", "numba", "casadi", "coal", "matplotlib", "pydantic", "rich", "jinja2")

# Two unit cubes two apart along x, seeds in the middle: the gap at (rho_1, rho_2) is 2 - rho_1 / 2 - rho_2 / 2.
CUBES = """
title = "Two cubes (reconstruction)"
note = "a note for the reader"
[bodies.movable]
name = "left"
vertices = [[-0.5, -0.5, -0.5], [0.5, -0.5, -0.5], [-0.5, 0.5, -0.5], [0.5, 0.5, -0.5],
            [-0.5, -0.5, 0.5], [0.5, -0.5, 0.5], [-0.5, 0.5, 0.5], [0.5, 0.5, 0.5]]
[bodies.static]
name = "right"
vertices = [[1.5, -0.5, -0.5], [2.5, -0.5, -0.5], [1.5, 0.5, -0.5], [2.5, 0.5, -0.5],
            [1.5, -0.5, 0.5], [2.5, -0.5, 0.5], [1.5, 0.5, 0.5], [2.5, 0.5, 0.5]]
[defaults]
target = [1.0, 1.0]
goal = "touch"
motion = [{ translation = "x" }, { translation = "y" }]
"""
REACHABLE = """
[[case]]
name = "close it"
published = [{ translation = 1.2 }, { translation = 0.5 }]
"""
UNREACHABLE = """
[[case]]
name = "too short: a/b"
limits = { TX = [-0.1, 0.1] }
"""


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


def document(text: str) -> Any:
    """Parse JSON strictly: NaN and Infinity are no JSON."""

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} in JSON")

    told = json.loads(text, parse_constant=refuse)
    return told.get("files", told)


@pytest.fixture
def cubes(tmp_path: Path) -> Path:
    path = tmp_path / "cubes.toml"
    path.write_text(CUBES + REACHABLE)
    return path


@pytest.fixture
def short(tmp_path: Path) -> Path:
    path = tmp_path / "short.toml"
    path.write_text(CUBES + UNREACHABLE)
    return path


# ---------------------------------------------------------------------------------------------------------------- curve


def test_curve_prints_the_line_of_two_cubes(cubes: Path) -> None:
    result = run("curve", cubes)
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert lines[0] == "cubes.toml: Two cubes (reconstruction)"
    assert lines[1:3] == ["a note for the reader", ""]
    row = next(line.split() for line in lines if line.lstrip().startswith("S1"))
    assert row[1].startswith("F1F2(P1")
    assert [float(x.rstrip(",")) for x in row[-8:]] == pytest.approx([0.5, 0.5, 2, 1, 3, 3, 1, -1])
    assert "contact in the box [0.8, 3] x [0.8, 3]" in result.stdout


def test_curve_as_json(cubes: Path) -> None:
    result = run("curve", cubes, "--json")
    (file,) = document(result.stdout)
    (curve,) = file["curves"]
    (segment,) = curve["segments"]
    assert (file["title"], curve["cases"], curve["status"]) == ("Two cubes (reconstruction)", ["close it"], "contact")
    assert segment["line"] == pytest.approx([0.5, 0.5, 2.0])
    assert segment["slope"] == pytest.approx(-1.0)
    assert curve["switching_points"] == []


def test_curve_lists_each_pair_of_bodies_once() -> None:
    (file,) = document(run("curve", PROBLEMS / "example1.toml", "--json").stdout)
    (curve,) = file["curves"]
    assert curve["cases"] == ["A", "B", "C", "D"]
    assert [len(curve["segments"]), len(curve["switching_points"])] == [5, 4]
    printed = run("curve", PROBLEMS / "example1.toml").stdout
    assert printed.count("V1F2(P1V6; P2V2,V3,V5)") == 1
    assert "1.273451, 1.214536" in printed


# ---------------------------------------------------------------------------------------------------------------- solve


def test_solve_prints_the_smallest_motion_of_two_cubes(cubes: Path) -> None:
    result = run("solve", cubes)
    assert result.exit_code == 0
    text = result.stdout
    verdict = (
        "close it: move left 1 along +x: then its right face (facing +x) lies on the left face (facing -x) of right"
    )
    assert f"{verdict}; smallest" in " ".join(text.split())
    row = next(line for line in text.splitlines() if line.startswith("close it "))
    assert row.split()[-4:] == ["1", "1", "touching", "yes"]
    assert "TX 1 " in row  # the shift along y does nothing, and is left out
    assert "TY" not in row
    assert "1.3" in row.split()  # published: hypot(1.2, 0.5)
    assert text.splitlines()[-2].startswith("time of 1 case, parts read: ")
    assert '"touch"' not in text  # the column belongs to goal "beyond"


def test_solve_as_json_gives_the_amounts(cubes: Path) -> None:
    (file,) = document(run("solve", cubes, "--json").stdout)
    (case,) = file["cases"]
    assert (case["name"], case["status"], case["usable"]) == ("close it", "SOLVED", True)
    assert case["amount"] == pytest.approx(1.0, rel=1e-9)
    assert case["published_amount"] == pytest.approx(math.hypot(1.2, 0.5))
    assert case["touch_amount"] is None


def test_beside_goal_beyond_stands_the_least_touch_motion(tmp_path: Path) -> None:
    """Moving along the seed line scales the whole curve: both amounts are tau times the seeds' distance."""
    path = tmp_path / "along.toml"
    path.write_text(f"""
        bodies = {json.dumps(str(PROBLEMS / "example1.toml"))}
        [[case]]
        name = "along"
        nominal = 3
        tolerance = 0.02
        requirement = "A"
        goal = "beyond"
        motion = [{{ translation = "x" }}]
        """)
    result = run("solve", path, "--json")
    assert result.exit_code == 0
    ((case,),) = [file["cases"] for file in document(result.stdout)]
    expected = 0.02 * 0.2517
    assert case["parameters"]["TX"] == pytest.approx(-expected, rel=1e-7)
    assert [case["amount"], case["touch_amount"]] == pytest.approx([expected, expected], rel=1e-7)
    printed = run("solve", path).stdout
    row = next(line for line in printed.splitlines() if "along" in line and "beyond" in line)
    assert row.split()[-4:] == ["1.02", "touching", "0.005034", "yes"]
    assert "least" in printed
    assert "A (+,+)" in row


def test_cases_are_chosen_by_name() -> None:
    result = run("solve", PROBLEMS / "example2.toml", "--json", "--case", "B", "--case", "A")
    (file,) = document(result.stdout)
    assert [case["name"] for case in file["cases"]] == ["A", "B"]


def test_piped_tables_are_whole_and_plain(cubes: Path) -> None:
    for command in ("curve", "solve"):
        text = run(command, PROBLEMS / "example1.toml", cubes).stdout
        assert "\x1b" not in text
        assert "…" not in text
        assert max(map(len, text.splitlines())) <= 120


# ----------------------------------------------------------------------------------------------------------- exit codes


def test_a_case_without_motion_is_exit_code_1_and_says_what_to_do(short: Path) -> None:
    result = run("solve", short)
    assert result.exit_code == 1
    assert "Widen the upper limit of TX to 1." in result.stdout
    (file,) = document(run("solve", short, "--json").stdout)
    (case,) = file["cases"]
    assert case["amount"] is None
    assert case["motion"] is None


def test_bad_input_is_exit_code_2_without_traceback(tmp_path: Path, cubes: Path) -> None:
    missing, wrong = tmp_path / "missing.toml", tmp_path / "wrong.toml"
    wrong.write_text(CUBES + REACHABLE + "nominall = 3\n")
    result = run("solve", missing, wrong, cubes)
    assert result.exit_code == 2
    assert "missing.toml" in result.stderr
    line = wrong.read_text().splitlines().index("nominall = 3") + 1
    said = f"wrong.toml:{line}: case[1] 'close it'.nominall: unknown key 'nominall', did you mean 'nominal'?"
    assert said in result.stderr
    assert "Traceback" not in result.stderr
    assert "close it" in result.stdout  # the good file is solved all the same
    files = document(run("solve", missing, cubes, "--json").stdout)
    assert "missing.toml" in files[0]["error"]
    assert files[1]["cases"][0]["usable"]


def test_an_unknown_case_is_bad_input(cubes: Path) -> None:
    result = run("solve", cubes, "--case", "open it")
    assert result.exit_code == 2
    assert "'open it'; allowed: close it" in result.stderr
    assert result.stdout == ""


def test_an_unknown_option_is_bad_input(cubes: Path) -> None:
    assert run("solve", cubes, "--no-such-option").exit_code == 2


def _rejecting(monkeypatch: pytest.MonkeyPatch) -> None:
    from fcdm_opt.show import solved

    honest = solved.solve
    verdict = Certificate((Check("planted", False, 1.0, 0.0, "a planted refusal"),))

    def refused(problem: Problem, **_: bool) -> Solution:
        answer = honest(problem)
        status = Status.NOT_VERIFIED if answer.status.found else answer.status
        return replace(answer, certificate=verdict, status=status)

    monkeypatch.setattr(solved, "solve", refused)


def test_a_motion_that_was_not_verified_is_exit_code_3(cubes: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _rejecting(monkeypatch)
    result = run("solve", cubes)
    assert result.exit_code == 3
    assert next(line for line in result.stdout.splitlines() if line.startswith("close it ")).split()[-1] == "no"
    assert "Failed: planted." in result.stdout.replace("\n   ", " ")


def test_the_most_severe_exit_code_wins(
    cubes: Path, short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run("solve", cubes, short).exit_code == 1
    assert run("solve", cubes, short, tmp_path / "missing.toml").exit_code == 2
    _rejecting(monkeypatch)
    assert run("solve", short, cubes).exit_code == 3
    assert run("solve", tmp_path / "missing.toml", cubes).exit_code == 2


@pytest.mark.parametrize(
    ("code", "command"),
    [
        (SOLVED, "schema"),
        (SOLVED, "curve CUBES"),
        (SOLVED, "faces CUBES"),
        (SOLVED, "range CUBES"),  # apart: no contact that could last, but times of contact
        (NO_MOTION, "solve SHORT"),
        (NO_MOTION, "whatif CUBES --set limits.TX=[-0.1,0.1]"),
        (BAD_INPUT, "stack CUBES"),  # no sizes
        (BAD_INPUT, "pose SHORT --clearance many"),
        (BAD_INPUT, "study MISSING --out OUT"),
        *((BAD_INPUT, f"{name} MISSING") for name in ("curve", "solve", "range", "whatif", "faces", "stack", "pose")),
        *((BAD_INPUT, f"{name} MISSING --out OUT") for name in ("report", "map")),
        (BAD_INPUT, "init MISSING MISSING"),
    ],
)
def test_a_command_ends_with_an_exit_code_that_its_page_lists(
    cubes: Path, short: Path, tmp_path: Path, code: int, command: str
) -> None:
    places = {"CUBES": cubes, "SHORT": short, "MISSING": tmp_path / "missing.toml", "OUT": tmp_path / "out"}
    name, *rest = [places.get(word, word) for word in command.split()]
    assert run(name, *rest).exit_code == code
    assert code in ROWS[str(name)].ends


# ------------------------------------------------------------------------------------------------------------- pictures


@pytest.mark.slow
def test_pictures_are_written_under_safe_names(cubes: Path, short: Path, tmp_path: Path) -> None:
    out = tmp_path / "pictures"
    assert run("curve", cubes, "--out", out / "of curves").exit_code == 0
    result = run("solve", cubes, short, "--json", "--out", out)
    document(result.stdout)
    stems = ["cubes-close_it", "short-too_short_a_b"]
    pictures = [f"{stem}-{kind}" for stem in stems for kind in ("curve", "scene")] + [f"{stems[0]}-sensitivities"]
    expected = {f"{picture}.{suffix}" for picture in pictures for suffix in ("png", "svg")}
    assert {path.name for path in out.iterdir() if path.is_file()} == expected
    assert {path.name for path in (out / "of curves").iterdir()} == {
        "cubes-curve.png",
        "cubes-curve.svg",
        "cubes-scene.png",
        "cubes-scene.svg",
    }
    assert "Two cubes (reconstruction): case close it" in (out / "cubes-close_it-curve.svg").read_text()
    assert (out / "cubes-close_it-curve.png").read_bytes().startswith(b"\x89PNG")


# -------------------------------------------------------------------------------------------------- start, public names


def _python(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.parametrize(
    "code",
    [
        "import fcdm_opt",
        "import fcdm_opt; dir(fcdm_opt); from fcdm_opt import InputError",
        "import fcdm_opt.cli",
        f"{HELP}\ntry: main()\nexcept SystemExit: pass",
    ],
)
def test_nothing_heavy_is_imported_before_it_is_needed(code: str) -> None:
    loaded = _python(f"{code}\nimport sys; print(sorted(set({HEAVY!r}) & set(sys.modules)))")
    assert loaded.splitlines()[-1] == "[]"


@pytest.mark.parametrize("command", ["curve", "solve", "range", "report", "whatif", "map", "pose", "stack"])
def test_a_slip_in_the_name_of_a_case_cost_the_loading_of_all_libraries(command: str) -> None:
    heavy = f"print(sorted(set({HEAVY!r}) & set(sys.modules) - {{'pydantic'}}))"  # which typer loads
    asked = [command, str(PROBLEMS / "boxes.toml"), "--case", "close the gab"]
    code = f"import sys\nsys.argv[1:] = {asked!r}\nfrom fcdm_opt.cli import main\ntry: main()\nfinally: {heavy}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "[]\n")
    assert done.stderr.startswith("error: --case: no such case, did you mean 'close the gap'?; found 'close the gab'; ")


def test_every_public_name_is_there() -> None:
    assert set(fcdm_opt.__all__) <= set(dir(fcdm_opt))
    for name in fcdm_opt.__all__:
        value = getattr(fcdm_opt, name)
        other = {"solve_assembly": "solve", "verify_assembly": "verify"}.get(name, name)  # names of earlier versions
        assert name == "__version__" or value.__name__ == other
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = fcdm_opt.no_such_name


def test_the_version_is_the_installed_one() -> None:
    assert fcdm_opt.__version__ == version("fcdm_opt")
    assert run("--version").stdout == f"fcdm-opt {version('fcdm_opt')}\n"


# ------------------------------------------------------------------------------------------------------------- scenes

# Between the cubes stands a rib up to y = -0.25, so that the left one must rise by 0.25 to pass; the other is far away.
RIBS = """
[[keep_out]]
name = "rib"
vertices = [[0.75, -2, -1], [1.0, -2, -1], [0.75, -0.25, -1], [1.0, -0.25, -1],
            [0.75, -2, 1], [1.0, -2, 1], [0.75, -0.25, 1], [1.0, -0.25, 1]]
[[keep_out]]
name = "far"
vertices = [[50, 0, 0], [51, 0, 0], [50, 1, 0], [50, 0, 1]]
"""
SCENE_CASES = """
[[case]]
name = "around"
[[case]]
name = "ignored"
keep_out = []
[[case]]
name = "no way around"
limits = { TY = [-0.1, 0.1], TX = [0.5, 1.1] }
[[case]]
name = "straight"
motion = [{ translation = "x" }]
limits = { TX = [-1, 2] }
"""


@pytest.mark.slow
def test_keep_outs_are_kept_and_shown(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(CUBES + RIBS + SCENE_CASES)
    shown = run("solve", path, "--case", "around", "--case", "ignored", "--out", tmp_path / "pictures")
    assert shown.exit_code == 0
    assert "around: keep-out rib: touching" in shown.stdout
    assert "around: keep-out far: 48.5 clear" in shown.stdout
    assert "ignored: keep-out" not in shown.stdout
    assert (tmp_path / "pictures" / "scene-around-scene.png").exists()
    result = run("solve", path, "--json")
    assert result.exit_code == 1  # two have no motion
    around, ignored, no_way, straight = document(result.stdout)[0]["cases"]
    assert around["parameters"] == pytest.approx({"TX": 1.0, "TY": 0.25}, abs=1e-8)
    assert around["keep_out_gaps"] == pytest.approx({"rib": 0.0, "far": 48.5}, abs=1e-8)
    assert (around["modelled"]["keep_outs_kept"], around["modelled"]["keep_outs_total"]) == (1, 2)
    told = json.loads(result.stdout)
    assert (told["schema"], told["version"]) == ("fcdm_opt solve 1", fcdm_opt.__version__)
    assert [own["problem"]["scene"] for own in (around, ignored)] == [0, 1]  # bodies are there once, not once a case
    assert told["scenes"][0]["keep_out"][0]["name"] == "rib"
    problem = Problem.from_dict({**told["scenes"][0], "case": around["problem"]["case"]})
    assert problem.to_dict()["bodies"] == told["scenes"][0]["bodies"]
    assert ignored["parameters"] == pytest.approx({"TX": 1.0, "TY": 0.0}, abs=1e-8)
    assert ignored["keep_out_gaps"] == {}
    assert no_way["status"] in ("INFEASIBLE", "NOT_FOUND")
    assert straight["status"] == "INFEASIBLE"


def test_a_closed_nominal_pair_and_notes_on_bodies_are_shown(tmp_path: Path) -> None:
    near = CUBES.replace("1.5, ", "0.50000025, ").replace("2.5, ", "1.50000025, ")
    near = near.replace('name = "left"', 'name = "left"\nnotes = ["two holes closed"]')
    path = tmp_path / "near.toml"
    path.write_text(
        near.replace("target = [1.0, 1.0]\n", "").replace('goal = "touch"\n', "")
        + """
[[case]]
name = "A"
goal = "at"
requirement = "A"
tolerance = 0.02
"""
    )
    result = run("solve", path)
    assert result.exit_code == 0
    text = " ".join(result.stdout.split())
    assert "A: nominal (1, 1), where the gap was 2.5e-07, closed to the curve at (1.00000025, 1.00000025)" in text
    assert "left: two holes closed" in text
    (case,) = document(run("solve", path, "--json").stdout)[0]["cases"]
    assert case["snapped"]["gap"] == pytest.approx(2.5e-7, rel=1e-6)


LOST = """
[[size]]
name = "width"
body = "{body}"
faces = ["+x"]
tolerance = 2.0
[[case]]
name = "wide"
made = {{ width = 0.1 }}
[[case]]
name = "lost"
made = {{ width = -1.5 }}
[[case]]
name = "narrow"
made = {{ width = -0.1 }}
"""
BLOCKS = CUBES.partition("[defaults]")[0].replace("[bodies.static]", "motion = [{ translation = 'x' }]\n[[part]]")
BLOCKS = BLOCKS.replace("[bodies.movable]", "[[part]]") + "[[contact]]\nparts = ['left', 'right']\ngoal = 'touch'\n"


@pytest.mark.parametrize(
    "text", [CUBES + LOST.format(body="movable"), BLOCKS + LOST.format(body="left")], ids=["problem", "assembly"]
)
def test_a_case_that_cannot_be_made_cost_the_answers_of_the_others(text: str, tmp_path: Path) -> None:
    """The cube is 1 wide: 1.5 less is no body, .1 more or less leave a gap of .9 or 1.1."""
    path, page = tmp_path / "cubes.toml", tmp_path / "page.html"
    path.write_text(text)
    result = run("solve", path)
    assert result.exit_code == BAD_INPUT
    assert all(f"{x} " in result.stdout for x in ("0.9", "1.1"))
    assert "case[2] 'lost'" in result.stderr
    assert "the body changes its shape at these sizes" in result.stderr
    (told,) = document(run("solve", path, "--json").stdout)
    cases = {own["name"]: own for own in told["cases"]}
    assert "error" not in told
    assert "changes its shape" in cases.pop("lost")["error"]
    assert {name: own["amount"] for name, own in cases.items()} == pytest.approx({"wide": 0.9, "narrow": 1.1})
    result = run("report", path, "--out", page, "--no-certify")
    assert result.exit_code == BAD_INPUT
    assert "0.9" in page.read_text()
    assert "the body changes its shape at these sizes" in page.read_text()
    alone = run("solve", path, "--case", "lost")
    assert (alone.exit_code, alone.stdout) == (BAD_INPUT, "")
    with pytest.raises(fcdm_opt.InputError, match="changes its shape"):
        (fcdm_opt.load_assemblies if "[[part]]" in text else fcdm_opt.load_problems)(path)
