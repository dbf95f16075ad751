"""The commands study, whatif, map and pose: what they print, write and refuse, and their exit codes."""

from __future__ import annotations

import csv
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold
from matplotlib.figure import Figure
from typer.testing import CliRunner

from fcdm_opt import pacing
from fcdm_opt.cli import app
from fcdm_opt.problem.solution import Certificate
from fcdm_opt.show import stacks
from fcdm_opt.show.printing import console

PROBLEMS = Path(__file__).parents[2] / "problems"
STUDY = """
problem = "{problem}"
cases = ["A", "D"]
[[vary]]
key = "tolerance"
values = [0.005, 0.01]
"""


def run(*arguments: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = tmp_path / "study.toml"
    path.write_text(STUDY.format(problem=PROBLEMS / "peg_tapered.toml"))
    return path


def test_a_study_writes_store_table_and_picture_and_is_not_run_twice(study: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    code, text, _ = run("study", study, "--out", out, "--jobs", 1, "--json")
    document = json.loads(text)
    assert code == 0
    assert document["counts"] == {"SOLVED": 4}
    assert {path.name for path in out.iterdir()} >= {"study.sqlite", "study.csv", "study.png", "study.svg"}
    with (out / "study.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    assert float(rows[0]["amount"]) == pytest.approx(5 * 0.005, rel=1e-9)  # of the problem file: 5 (rho_2 - 1)
    stamp = (out / "study.sqlite").stat().st_mtime_ns
    told: list[str] = []
    with pacing.listening(lambda text, *_: told.append(text)):
        assert run("study", study, "--out", tmp_path / "again", "--jobs", 1)[0] == 0
    assert "solving points: judging the motion found" in told  # it was said to be at one point's stage alone
    assert told[-1] == "drawing"
    assert run("study", study, "--out", out, "--jobs", 1)[0] == 0
    assert (out / "study.sqlite").stat().st_mtime_ns == stamp


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ('[[vary]]\nkey = "tolerence"\nvalues = [1]', "did you mean 'tolerance'"),
        ('[[vary]]\nkey = "snap"\ngrid = { from = 0.02, to = 0.01, count = 3 }', "grid.to"),
        ('[[vary]]\nkey = "snap"\ncsv = { file = "sizes.csv", column = "peg" }\n', "row 3"),
    ],
)
def test_a_wrong_study_is_refused_before_anything_is_written(
    study: Path, tmp_path: Path, wrong: str, words: str
) -> None:
    (tmp_path / "sizes.csv").write_text("peg\n0.01\nnan\n")
    count = "count = 5\n" if "csv" in wrong else ""
    study.write_text(count + study.read_text() + wrong)
    code, _, errors = run("study", study, "--out", tmp_path / "out")
    assert code == 2
    assert words in errors
    assert not (tmp_path / "out").exists()


def test_a_study_that_is_not_there_leaves_no_folder(tmp_path: Path) -> None:
    code, _, errors = run("study", tmp_path / "none.toml", "--out", tmp_path / "out")
    assert code == 2
    assert "none.toml" in errors
    assert not (tmp_path / "out").exists()


def test_closed_streams_swallow_what_is_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdout", None)
    console().print("text")
    monkeypatch.undo()
    command = [sys.executable, "-c", "import fcdm_opt.cli as cli, os; cli.app = lambda **_: None; cli.main()\n"
               "raise SystemExit(os.readlink('/proc/self/fd/1') != os.devnull)"]  # fmt: skip
    if os.path.exists("/proc/self/fd"):
        subprocess.run(command, check=True, preexec_fn=lambda: os.close(1))


def test_the_store_of_another_study_is_refused(study: Path, tmp_path: Path) -> None:
    assert run("study", study, "--out", tmp_path / "out", "--jobs", 1)[0] == 0
    study.write_text(study.read_text().replace("0.01]", "0.02]"))
    code, _, errors = run("study", study, "--out", tmp_path / "out", "--jobs", 1)
    assert code == 2
    assert "another study" in errors


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_maps")
def test_a_case_with_a_target_has_a_pose_and_a_map_of_the_box_given(tmp_path: Path) -> None:
    text = (PROBLEMS / "peg_tapered.toml").read_text()
    path = tmp_path / "made.toml"
    text = text[: text.index("[[case]]")].replace("tolerance = 0.01\n", "").replace("meshes", str(PROBLEMS / "meshes"))
    path.write_text(text + '[[case]]\nname = "A"\ntarget = [1.0, 1.0]\n')
    for command in (["pose", path], ["map", path, "--out", tmp_path]):
        code, _, errors = run(*command)
        assert code == 2
        assert "--box LOW1,HIGH1,LOW2,HIGH2" in errors
        more = ("--error", 0.05) if command[0] == "map" else ()
        code, text, _ = run(*command, "--box", "0.99,1.0,1.0,1.01", *more, "--json")
        (case,) = json.loads(text)["files"][0]["cases"]
        assert code == 0
        box = case["map"]["box"] if "map" in case else case["as_drawn"]["box"]
        assert box == [[0.99, 1.0], [1.0, 1.01]]
        code, _, errors = run(*command, "--box", "0.99,1.0,1.0")
        assert code == 2
        assert "--box: not pairs of numbers" in errors
    assert run("pose", path, "--box", "0.9,1,1,1.1", "--sizes", path)[0] == 2


def test_whatif_sets_any_key(tmp_path: Path) -> None:
    code, text, _ = run("whatif", PROBLEMS / "peg_tapered.toml", "--case", "B", "--set", "tolerance=0.02", "--json")
    (case,) = json.loads(text)["files"][0]["cases"]
    assert code == 0
    draft = math.tan(math.radians(5))
    assert case["whatif"]["after"]["amount"] == pytest.approx(10 * 0.04 / draft - 5 * 0.02, rel=1e-9)
    assert case["whatif"]["predicted_amount"] == pytest.approx(case["whatif"]["after"]["amount"], rel=1e-9)  # linear
    code, text, _ = run("whatif", PROBLEMS / "peg_tapered.toml", "--case", "B", "--set", "bodies.static.seed=[0,0,6]")
    assert code == 0
    assert "bodies" not in text


def test_a_budget_of_all_requirements_was_worked_out_anew_for_each() -> None:
    code, text, _ = run("whatif", PROBLEMS / "example1_touch.toml", "--case", "A", "--case", "D", "--budget", 0.01)
    assert code == 0
    assert text.count("requirement") == 1
    assert "as case A: these are of all sizes" in text


@pytest.mark.slow
def test_whatif_tells_budget_conflicts_costs_and_families() -> None:
    code, text, _ = run("whatif", PROBLEMS / "peg_tapered.toml", "--case", "A", "--budget", 0.1, "--compare", "--json")
    (case,) = json.loads(text)["files"][0]["cases"]
    assert code == 0
    assert case["budget"]["requirements"]["A"]["tolerance"] == pytest.approx(0.02, rel=1e-6)  # 5 tau = 0.1
    assert case["compare"]["rows"][0]["amount"] <= 0.05 * (1 + 1e-9)
    code, text, _ = run("whatif", PROBLEMS / "peg_square_tight.toml", "--case", "shift")
    assert code == 0
    four = "lower limit of TX, upper limit of TX, lower limit of TY and upper limit of TY"
    assert f"no motion keeps {four} together (proved)" in " ".join(text.split())
    code, text, _ = run("whatif", PROBLEMS / "peg_square.toml", "--case", "against the lower wall")
    assert code == 0
    assert 'ask for goal "clear"' in text
    assert "outcome" in text


WRONG = (
    "whatif --set tolerance", "whatif --budget much", "whatif --budget -1", "map --error -1", "map --seconds 0",
    "map --budget nan", "map --box 1.02,0.98,1,1", "pose --clearance 3,1", "stack --gap 3,1", "stack --share 0.9",
    "stack --share 2 --cost a=1", "stack --cost a", "stack --slice a,b", "solve --seconds -1", "solve --effort much",
)  # fmt: skip


@pytest.mark.parametrize("line", WRONG)
def test_options_were_refused_late_and_by_the_names_of_arguments(line: str) -> None:
    """A map was made before its budget was looked at; then it was "case 'A'.budget", allowed "or None"."""
    command, option, *values = line.split()
    code, printed, errors = run(command, "no-such-file.toml", option, *values)
    assert (code, printed, errors.startswith(f"error: {option}: ")) == (2, "", True)


def test_options_that_a_file_decides_on_were_named_as_keys_of_it_after_meshes_were_read(tmp_path: Path) -> None:
    code, _, errors = run("stack", PROBLEMS / "slot_and_key.toml", "--of", "a,b")
    assert (code, ": --of: " in errors, "slot_and_key.toml: case" in errors) == (2, True, True)
    text = (PROBLEMS / "keyway.toml").read_text("utf-8")
    (unread := tmp_path / "unread.toml").write_text(text.replace("meshes/", "no-such/"), "utf-8")
    for option, value in (("--over", "much"), ("--box", "0,1,1,1")):
        code, _, errors = run("map", unread, option, value)
        assert (code, errors.startswith(f"error: {option}: ")) == (2, True)


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_maps")
def test_a_map_is_written_and_tells_the_yield(tmp_path: Path) -> None:
    arguments = ("map", PROBLEMS / "peg_tapered.toml", "--case", "A", "--budget", 1.0, "--error", 0.05)
    code, text, _ = run(*arguments, "--out", tmp_path, "--json")
    (case,) = json.loads(text)["files"][0]["cases"]
    names = {path.name for path in tmp_path.iterdir()}
    assert code == 0
    assert names >= {"peg_tapered-A-map.json", "peg_tapered-A-map.csv", "peg_tapered-A-map.png"}
    assert case["map"]["reached"] <= case["map"]["error"]
    assert 0.0 < case["yield"]["share"] < 1.0
    assert case["map"]["certificate"]["passed"]
    assert run("map", PROBLEMS / "example1.toml", "--case", "A", "--out", tmp_path)[0] == 2  # "beyond" jumps
    code, _, said = run(*arguments, "--over", "nothing", "--out", tmp_path / "a.stl")  # which was complained of first
    assert (code, said.count("--over: not one to 6 sizes"), "--out" in said) == (2, 1, False)


def test_a_pose_printed_a_table_before_it_refused() -> None:
    code, printed, said = run("pose", PROBLEMS / "peg_tapered.toml", "--case", "A", "--clearance=-inf,inf")
    assert (code, "a window without ends" in said) == (2, True)
    assert "clearance" not in printed


def test_nothing_led_from_a_pose_that_interferes_to_a_window_of_clearance() -> None:
    code, printed, _ = run("pose", PROBLEMS / "peg_tapered.toml", "--case", "A")
    assert (code, " ".join(printed.split()).count("--clearance 0,inf asks for one without interference")) == (0, 1)
    code, printed, _ = run("pose", PROBLEMS / "peg_tapered.toml", "--case", "A", "--clearance=0,inf")
    assert (code, "--clearance" in printed) == (0, False)


def test_a_pose_was_worked_out_again_for_each_case_of_what_was_made() -> None:
    code, printed, _ = run("pose", PROBLEMS / "assemblies" / "loop_of_four.toml")
    assert (code, printed.count("least worst gap"), printed.count("as case made unlike: ")) == (0, 1, 1)
    assert "e-16" not in printed


def test_a_pose_of_six_contacts_tells_each() -> None:
    """3-2-1: at rest gaps of 3 d + 2 e, 2 d + 2 e, d + 2 e, both within .02; a turn does a little better."""
    code, text, _ = run("pose", PROBLEMS / "locating.toml", "--case", "A", "--json")
    best = json.loads(text)["files"][0]["cases"][0]["best_pose"]
    assert (code, best["certificate"]["passed"], len(best["contacts"])) == (0, True, 6)
    assert 0.09 < best["worst_gap"] <= 0.1


@pytest.mark.slow
def test_an_assembly_has_a_pose_and_stack_ups(tmp_path: Path) -> None:
    """Two blocks on a floor, of which one is thicker by up to .1 and the other by .02 below."""
    path = tmp_path / "tower.toml"
    path.write_text("""
[[part]]
name = "floor"
vertices = [[-2,-2,-1],[2,-2,-1],[-2,2,-1],[2,2,-1],[-2,-2,0],[2,-2,0],[-2,2,0],[2,2,0]]
[[part]]
name = "lower"
vertices = [[-1,-1,0],[1,-1,0],[-1,1,0],[1,1,0],[-1,-1,1],[1,-1,1],[-1,1,1],[1,1,1]]
motion = [{ translation = "z" }]
[[part]]
name = "upper"
vertices = [[-1,-1,1],[1,-1,1],[-1,1,1],[1,1,1],[-1,-1,2],[1,-1,2],[-1,1,2],[1,1,2]]
motion = [{ translation = "z" }]
[[contact]]
parts = ["lower", "floor"]
[[contact]]
parts = ["upper", "lower"]
[[size]]
name = "thick"
body = "lower"
faces = "+z"
tolerance = [0.0, 0.1]
[[size]]
name = "deep"
body = "upper"
faces = "-z"
tolerance = 0.02
[[case]]
name = "as drawn"
""")
    code, text, _ = run("pose", path, "--json")
    best = json.loads(text)["files"][0]["cases"][0]["best_pose"]
    assert code == 0
    assert best["worst_gap"] == pytest.approx(0.07)  # TZ - thick - deep, from TZ - .12 to TZ + .02
    assert best["parameters"]["upper.TZ"] == pytest.approx(0.05)
    code, text, _ = run("pose", path)
    assert (code, "upper TZ 0.05" in text) == (0, True)
    assert run("pose", path, "--box", "0.99,1.01")[0] == 0
    for of, ends in (("upper,lower", (-0.12, 0.02)), ("upper,floor", (1.0, 1.1))):
        code, text, _ = run("stack", path, "--of", of, "--draws", 1000, "--json")
        worst = json.loads(text)["files"][0]["cases"][0]["stack"]["worst"]
        assert code == 0
        assert (worst["least"], worst["largest"]) == pytest.approx(ends)


def test_a_pose_for_all_sizes_is_in_the_middle_of_their_gaps(tmp_path: Path) -> None:
    (tmp_path / "sizes.csv").write_text("peg,hole\n1.0,1.0\n1.01,1.0\n0.99,1.0\n")
    sizes = ("--sizes", tmp_path / "sizes.csv", "--columns", "peg,hole")
    code, text, _ = run("pose", PROBLEMS / "peg_tapered.toml", "--case", "A", *sizes, "--json")
    (case,) = json.loads(text)["files"][0]["cases"]
    assert code == 0
    assert case["as_drawn"]["interference"] == pytest.approx(1 / 3)
    assert run("pose", PROBLEMS / "peg_tapered.toml", "--clearance", "1")[0] == 2
    code, text, _ = run("pose", PROBLEMS / "peg_tapered.toml", "--case", "A", "--clearance=-inf,0.5", *sizes, "--json")
    (case,) = json.loads(text)["files"][0]["cases"]
    assert (code, case["best_pose"]["window"]) == (0, [None, 0.5])


def test_a_pose_for_measured_sizes_by_name_took_columns_and_refused_what_is_below_zero(tmp_path: Path) -> None:
    """A key .0625 from the sides of its slot, and .125 - .09 - .01 from its bottom: as made, and with a foot of .02."""
    names = "slot_depth,operator,key_foot,key_width,slot_width,slot_position"
    (tmp_path / "one.csv").write_text(f"{names}\n-0.09,ann,0.01,0,0,0\n")
    (tmp_path / "two.csv").write_text(f"{names}\n-0.09,ann,0.01,0,0,0\n-0.08,bob,0.02,0,0,0\n")
    for name, ends in (("one", (0.025, 0.025)), ("two", (0.015, 0.035))):
        asked = ("pose", PROBLEMS / "slot_and_key.toml", "--case", "as drawn", "--json", "--sizes")
        code, text, _ = run(*asked, tmp_path / f"{name}.csv")
        (case,) = json.loads(text)["files"][0]["cases"]
        assert code == 0
        assert (case["as_drawn"]["least"]["gap"], case["as_drawn"]["most"]["gap"]) == pytest.approx(ends)


def test_a_case_that_cannot_be_made_ended_what_was_asked_of_others(tmp_path: Path) -> None:
    text = (PROBLEMS / "slot_and_key.toml").read_text().replace('file = "', f'file = "{PROBLEMS.as_posix()}/')
    path = tmp_path / "key.toml"
    path.write_text(text.replace("[[case]]", '[[case]]\nname = "lost"\nmade = { key_width = -20.0 }\n[[case]]', 1))
    code, told, said = run("stack", path, "--case", "as drawn", "--draws", "1000")
    assert (code, said.count("lost")) == (0, 0)
    assert "0.0325" in told
    assert run("faces", path)[0] == 0
    path.write_text(text.replace("[[size]]", '[[size]]\nname = "wrong"\nbody = "static"\nfaces = "F999"\n[[size]]', 1))
    code, told, said = run("faces", path)  # refused, though the names that it lists are what such a size lacks
    assert (code, "F999" in said, "static: body" in told) == (0, True, True)
    path.write_text(text.replace("[[case]]", '[[case]]\nname = "lost"\nmade = { key_width = -20.0 }\n[[case]]', 1))
    assert run("stack", path, "--case", "lost", "--draws", "1000")[0] == 2


def test_faces_of_an_assembly_were_not_listed(tmp_path: Path) -> None:
    """Each part by its name, also where a size names a face that is not there; the base is a box 20 x 8 x 1."""
    text = (PROBLEMS / "assemblies" / "loop_of_four.toml").read_text("utf-8")
    wrong = '[[size]]\nname = "w"\nbody = "key"\nfaces = ["F99"]\ntolerance = 0.1\n\n[[case]]'
    (path := tmp_path / "loop.toml").write_text(text, encoding="utf-8")
    (refused := tmp_path / "refused.toml").write_text(text.replace("[[case]]", wrong, 1), encoding="utf-8")
    for file in (path, refused):
        code, told, said = run("faces", file, "--json")
        (document,) = json.loads(told)["files"]
        assert (code, "F99" in said) == (0, file is refused)
        assert [(part, len(own)) for part, own in document["faces"].items()] == [
            ("base", 6), ("left wedge", 6), ("right wedge", 6), ("key", 7),
        ]  # fmt: skip
        assert [own["area"] for own in document["faces"]["base"]] == pytest.approx([160, 160, 20, 20, 8, 8], rel=1e-12)
    code, told, _ = run("faces", path, "--out", tmp_path)
    assert (code, "body 'left wedge'\n" in told, (tmp_path / "loop-faces.png").exists()) == (0, True, True)


def test_faces_of_a_file_whose_contacts_are_restored_were_refused(tmp_path: Path) -> None:
    mesh = (PROBLEMS / "meshes").as_posix()
    bodies = "".join(f'[bodies.{role}]\nfile = "{mesh}/square_{name}.stl"\nunit = "mm"\nseed = "box"\n\n'
                     for role, name in (("movable", "peg"), ("static", "plate")))  # fmt: skip
    asked = '[defaults]\ngoal = "seat"\ncontacts = "all"\nmotion = [{ translation = "x" }]\n\n[[case]]\nname = "A"\n'
    (path := tmp_path / "mine.toml").write_text(bodies + asked + 'requirement = "A"\ntolerance = 0.01\n')
    code, told, said = run("faces", path)
    assert (code, "body 'square_peg'" in told, said) == (0, True, "")


def test_what_if_of_an_assembly_outside_the_fit_was_an_internal_error(tmp_path: Path) -> None:
    """A pallet 39.8 wide between posts that are 40 apart less .25, on the floor: that nothing fits is an answer."""
    cube = Manifold.cube
    base = cube((80, 20, 5)).translate((-40, -10, -5))
    for x in (-28, 20):
        base += cube((8, 20, 9)).translate((x, -10, -1))
    for name, solid in (("base", base), ("pallet", cube((39.8, 20, 6)).translate((-19.9, -10, 0)))):
        mesh = solid.to_mesh64()
        trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts).export(tmp_path / f"{name}.off")
    text = "".join(
        f'[[part]]\nname = "{own}"\nfile = "{own}.off"\nunit = "mm"\nseed = "box"\n' for own in ("base", "pallet")
    )
    text += 'motion = [{ translation = "x" }, { translation = "z" }]\n[[contact]]\nparts = ["pallet", "base"]\n'
    text += '[[size]]\nname = "post"\nbody = "base"\nfaces = [{ through = [20, 0, 4] }, { through = [28, 0, 4] }]\n'
    text += 'along = "x"\ntolerance = 0.2\n[[case]]\nname = "too far"\nmade = { post = -0.25 }\n'
    (path := tmp_path / "cell.toml").write_text(text)
    code, told, _ = run("whatif", path)
    assert (code, "does not fit: pallet 39.800 mm in base 39.750 mm" in told) == (0, True)


@pytest.mark.slow
def test_pictures_of_a_stack_up_that_the_judge_refused_did_not_say_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    titles = []

    def drawn(*_: object, title: str, **__: object) -> Figure:
        titles.append(title)
        return Figure()

    monkeypatch.setattr(stacks, "stack_figure", drawn)
    asked = "stack", PROBLEMS / "slot_and_key.toml", "--draws", 1000, "--out", tmp_path
    run(*asked)
    assert titles
    assert "NOT VERIFIED" not in "".join(titles)
    titles.clear()
    monkeypatch.setattr(Certificate, "passed", property(lambda _: False))
    run(*asked)
    assert titles
    assert all("NOT VERIFIED" in title for title in titles)
    monkeypatch.setattr(Certificate, "failed", property(lambda own: own.checks[:1]))
    told = run("stack", PROBLEMS / "slot_and_key.toml", "--draws", 1000)[1]
    assert 0 < told.index("NOT VERIFIED") < told.index("worst case, least gap")  # it stood below the tables


RAISED = """
title = "two"
[[part]]
name = "base"
vertices = [[-9, -9, -5], [9, -9, -5], [9, 9, -5], [-9, 9, -5], [-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]
[[part]]
name = "block"
vertices = [[-5, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0], [-5, -5, 8], [5, -5, 8], [5, 5, 8], [-5, 5, 8]]
motion = [{ translation = "z" }]
resolution = 0.25
[[contact]]
parts = ["block", "base"]
[[size]]
name = "foot"
body = "block"
faces = ["-z"]
tolerance = 0.5
[[case]]
name = "long"
made = { foot = 0.3 }
"""


def test_assemblies_tell_where_parts_made_touch_and_what_whole_steps_leave_open(tmp_path: Path) -> None:
    """The range was that of parts as drawn, from 0; every contact was "closed" that steps leave .2 open."""
    (tmp_path / "two.toml").write_text(RAISED)
    told = " ".join(run("range", tmp_path / "two.toml")[1].split())
    assert "overlapping up to block.TZ 0.3, apart beyond" in told
    told = " ".join(run("solve", tmp_path / "two.toml")[1].split())
    assert "every contact is closed" not in told
    assert "open by no more than" in told


def test_the_correction_of_a_sensed_pose_is_that_of_the_docs(tmp_path: Path) -> None:
    """A peg turned by t takes 9.8475 (cos t + sin t) of 10 to each side of its middle, .05 are to stay free."""
    turn, middle = math.radians(0.4), (0.25, -0.125)
    cosine, sine = math.cos(turn), math.sin(turn)
    sensed = np.array([[cosine, -sine, 0, -0.1], [sine, cosine, 0, 0.4], [0, 0, 1, 0], [0, 0, 0, 1]])
    (path := tmp_path / "sensed.stl").touch()
    trimesh.load_mesh(PROBLEMS / "meshes" / "square_peg.stl").apply_transform(sensed).export(path)
    changes = "--set", f"bodies.movable.file={path}", "--set", "bodies.movable.seed=[0.150867, 0.276748, 5]"
    asked = "whatif", PROBLEMS / "peg_square.toml", "--case", "running clearance", *changes
    code, told, _ = run(*asked, "--json")
    (case,) = json.loads(told)["files"][0]["cases"]
    free = 10.0 - 0.05 - 9.8475 * (cosine + sine)
    x = free - (cosine * middle[0] - sine * middle[1] - 0.1)
    y = free - (sine * middle[0] + cosine * middle[1] + 0.4)
    assert code == 0
    assert [*case["whatif"]["after"]["parameters"].values()] == pytest.approx([x, y], abs=1e-5)
    shown = (PROBLEMS.parent / "docs" / "python.md").read_text(encoding="utf-8")
    lines = [line.rstrip() for line in run(*asked)[1].splitlines() if line.startswith(("before", "after"))]
    assert len(lines) == 2
    assert all(line in shown for line in lines)


def test_a_stack_up_of_one_contact_is_asked_by_its_number(tmp_path: Path) -> None:
    code, told, _ = run("stack", PROBLEMS / "slot_and_key.toml", "--case", "as drawn", "--draws", "1000")
    assert (code, "no.  contact" in told) == (0, True)
    code, one, _ = run("stack", PROBLEMS / "slot_and_key.toml", "--case", "as drawn", "--draws", "1000", "--contact", 1)
    assert (code, "no.  contact" in one) == (0, False)
    code, _, said = run("stack", PROBLEMS / "slot_and_key.toml", "--case", "as drawn", "--contact", 99)
    assert (code, "--contact: no such contact" in said) == (2, True)


def test_the_range_of_an_assembly_told_first_what_another_contact_does_not_allow() -> None:
    """Of four contacts each has its own range: together they last as far as the first to end."""
    code, told, _ = run("range", PROBLEMS / "assemblies" / "loop_of_four.toml", "--case", "made unlike")
    first = told.partition("made unlike: ")[2].partition("made unlike: ")[0]
    assert (code, first.startswith("all 4 contacts last at once along ")) == (0, True)
    assert "key - right wedge is the first to end" in " ".join(first.split())


@pytest.mark.parametrize("seconds", [120.0, 1e-6])
def test_a_map_without_any_motion_gave_no_reason_and_exited_with_0(tmp_path: Path, seconds: float) -> None:
    """A slab 2 above a floor moves along x alone; without time nothing is known. There was a table of dashes."""
    corners = [[x, y, z] for z in (0, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    path, parts = tmp_path / "slab.toml", {"slab": [[x, y, z + 3] for x, y, z in corners], "floor": corners}
    tables = [f'[[part]]\nname = "{name}"\nvertices = {own}\n' for name, own in parts.items()]
    path.write_text(
        f'{tables[0]}motion = [{{ translation = "x" }}]\n{tables[1]}[[contact]]\nparts = ["slab", "floor"]\n'
        'goal = "touch"\n[[size]]\nname = "depth"\nbody = "slab"\nfaces = ["-z"]\ntolerance = 0.1\n'
        '[[case]]\nname = "a"\n'
    )
    code, text, _ = run("map", path, "--budget", 1, "--seconds", seconds)
    head, said = "compensation map over depth, [-0.1, 0.1]: ", " ".join(text.split())
    why = "in the middle of them: contact slab - floor cannot be met: at the nearest pose found (TX 0) bottom face of"
    known = f"{head}no size has a motion, {why} slab, top face of floor are 2 apart"
    assert (known if seconds > 1 else f"{head}nothing is known of any size: 85% of the time given, ") in said
    assert (code, "variance" in said, "nan" in said) == (1, False, False)
    read = json.loads(run("map", path, "--seconds", seconds, "--json")[1])["files"][0]["cases"][0]["map"]
    assert bool(read["reason"]) == (seconds > 1)


def test_sizes_made_beyond_their_tolerances_were_taken_without_a_word_by_other_questions(tmp_path: Path) -> None:
    block, table = ([[x, y, z] for x in (-5, 5) for y in (-5, 5) for z in ends] for ends in ((0, 10), (-2.2, -0.2)))
    (file := tmp_path / "block.toml").write_text(f"""
        bodies.movable.vertices = {block}
        bodies.static.vertices = {table}
        [[size]]
        name = "tall"
        body = "movable"
        faces = "-z"
        tolerance = 0.1
        [[case]]
        name = "a"
        made = {{tall = 0.15}}
        goal = "clear"
        motion = [{{translation = "z"}}]
    """)
    for command in ("stack", "pose"):
        _, text, _ = run(command, file)
        assert "made beyond the tolerance: tall +0.15 (-0.1 to +0.1)" in text, command
