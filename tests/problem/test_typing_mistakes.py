"""What is answered to slips of the keyboard in a problem file: where it stands, and what was probably meant."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.cli.common import names, opened_files
from fcdm_opt.errors import InputError, closest, name_list
from fcdm_opt.problem.problem import SIGNS, load_problems
from fcdm_opt.problem.schema import known_sizes
from fcdm_opt.problem.syntax import parsed

FILE = """
[bodies.movable]
vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
seed = "centroid"
[bodies.static]
vertices = [[3, 0, 0], [2, 0, 0], [3, 1, 0], [3, 0, 1]]
[defaults]
goal = "touch"
tolerance = 0.02
motion = [{ translation = "x" }]
[[case]]
name = "A"
requirement = "A"
"""


CUBE = fo.Body.convex([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
PROBLEM = fo.Problem(CUBE, CUBE, target=(1, 1), goal="touch", motion=fo.Translation("x"))


def answer(folder: Path, old: str, new: str) -> InputError:
    path = folder / "p.toml"
    path.write_text(FILE)
    assert len(load_problems(path)) == 1
    assert old in FILE
    path.write_text(FILE.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_problems(path)
    assert str(caught.value).startswith(str(path))
    return caught.value


@pytest.mark.parametrize(
    ("old", "new", "key", "meant"),
    [
        ('goal = "touch"', 'goal = "tuch"', "defaults.goal", "touch"),
        ('goal = "touch"', 'path = "fre"', "defaults.path", "free"),
        ('goal = "touch"', 'pair = "claer"', "defaults.pair", "clear"),
        ('goal = "touch"', 'amount = "displacment"', "defaults.amount", "displacement"),
        ('goal = "touch"', 'requirement = "d"', "defaults.requirement", "D"),
        ('requirement = "A"', 'requirement = "a"', "case[1] 'A'.requirement", "A"),
        ("{ translation", "{ translaton", "defaults.motion[1]", "translation"),
        ('translation = "x"', 'translation = "X"', "defaults.motion[1].translation", "x"),
        ('seed = "centroid"', 'seed = "centre"', "bodies.movable.seed", "centroid"),
        ('seed = "centroid"', 'unit = "inch"', "bodies.movable.unit", "in"),
        ('seed = "centroid"', 'unit = "Millimetres"', "bodies.movable.unit", "mm"),
    ],
)
def test_a_misspelt_word_is_told_where_it_stands(tmp_path: Path, old: str, new: str, key: str, meant: str) -> None:
    error = answer(tmp_path, old, new)
    assert error.key == key
    assert f"did you mean '{meant}'?" in error.what


def test_what_is_near_nothing_is_given_no_hint(tmp_path: Path) -> None:
    assert "did you mean" not in str(answer(tmp_path, 'goal = "touch"', 'goal = "quickly"'))
    assert closest("feet", ["m", "mm"]) == ""
    assert closest("TZ_Deg", ["RX", "TZ_deg"]) == ", did you mean 'TZ_deg'?"


@pytest.mark.parametrize("letter", SIGNS)
@pytest.mark.parametrize("given", ["2", "2.0", "[0.02, 2]", "[[0.0, 0.1], [0.1, 2]]"])
def test_a_tolerance_in_percent_passed_where_parts_are_larger(tmp_path: Path, letter: str, given: str) -> None:
    error = answer(
        tmp_path,
        'tolerance = 0.02\nmotion = [{ translation = "x" }]\n[[case]]\nname = "A"\nrequirement = "A"',
        f'tolerance = {given}\nmotion = [{{ translation = "x" }}]\n[[case]]\nname = "A"\nrequirement = "{letter}"',
    )
    assert (error.key, "2 % is 0.02" in error.what) == ("defaults.tolerance", True)


def test_no_share_is_guessed_where_percent_makes_no_sense(tmp_path: Path) -> None:
    assert "1 % is 0.01" in answer(tmp_path, "0.02", "1").what
    for given in ("100", "250"):
        error = answer(tmp_path, "0.02", given)
        assert (error.key, "%" in error.what) == ("defaults.tolerance", False)


def test_a_wrong_default_is_told_in_the_defaults_and_for_which_case(tmp_path: Path) -> None:
    error = answer(tmp_path, "tolerance", "limits = { TX = [1, 0] }\ntolerance")
    assert (error.key, error.what) == ("defaults.limits.TX", "for case[1] 'A': unusable limits")
    error = answer(tmp_path, 'requirement = "A"', 'requirement = "A"\nlimits = { TX = [1, 0] }')
    assert (error.key, error.what) == ("case[1] 'A'.limits.TX", "unusable limits")


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("[a]\ngoal = 1\n# x\ngoal = 2\n", 4, "goal is given twice, before in line 2"),
        (
            "goal = 1\n[a]\n[b]\nx = 1\ny.z = [\n  1,\n]\nx = [\n  { x = 2 },\n]\n",
            8,
            "x is given twice, before in line 4",
        ),
        ("goal = 1\r\ngoal = 2", 2, "goal is given twice, before in line 1"),
        ('"a b" = 1\n"a b" = 2\n', 2, '"a b" is given twice, before in line 1'),
        ("[a.b]\n[b]\n[a.b]\n", 3, "[a.b] is given twice"),
        ("t = 0,02\n", 1, "0,02 is written 0.02, with a decimal point, not a comma"),
        ("\nt = [0,02, 0,01]  # 1,5\n", 2, "0,02 is written 0.02, with a decimal point, not a comma"),
        ("t = { a = -0,5 }\n", 1, "-0,5 is written -0.5, with a decimal point, not a comma"),
    ],
)
def test_what_no_toml_is_was_said_in_the_words_of_its_reader(text: str, line: int, said: str) -> None:
    with pytest.raises(InputError) as caught:
        parsed(text)
    assert caught.value.line == line
    assert str(caught.value).startswith(f"not valid TOML: {said}; found ")


@pytest.mark.parametrize(
    ("text", "line", "found", "allowed"),
    [
        ("\ngoal = touch\n", 2, "goal = touch", '"text" in quotes, a number'),
        ('goal = "touch\nx = 1', 1, 'goal = "touch', "a quote at the end"),
        ("goal = 'touch", 1, "goal = 'touch", "a quote at the end"),
        ("t = [1,2\n\n\n", 1, "t = [1,2", "] after the last"),
        ("t = [1,2]]\n", 1, "t = [1,2]]", "one KEY = VALUE a line"),
        ("t = [[0, 0], [1, 0]\n[bodies.static]\n", 2, "[bodies.static]", "a comma between two items"),
        ("t = 1 # 0,5\nu = = 0\n", 2, "u = = 0", "a number as 0.5"),
        ('t = "0,02" x\n', 1, 't = "0,02" x', "a # before what is none"),
        ("peg width = 1", 1, "peg width = 1", "a key of several words in quotes"),
        ("a = { b = 1,\n c = 2 }\n", 1, "a = { b = 1,", "no comma after the last one"),
        (r'file = "C:\Users\peg.stl"', 1, r'file = "C:\Users\peg.stl"', "the text in single quotes"),
        ("[[case]\n", 1, "[[case]", "[TABLE] or [[TABLE]]"),
        ("t = 0." + "0" * 500 + "1 mm\n", 1, "0" * 57 + "1 mm", "numbers as 0.5"),
        ("a = { b = 1, b = 2 }\n", 1, "a = { b = 1, b = 2 }", ""),
        ("a = 1\na.b = 2\n", 2, "a.b = 2", ""),
    ],
)
def test_what_no_toml_is_was_told_without_its_line_what_stands_there_and_what_may(
    tmp_path: Path, text: str, line: int, found: str, allowed: str
) -> None:
    """The line is that of the text which was written; before it was "p.toml: not valid TOML: ... (at line 2, ...)"."""
    path = tmp_path / "p.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_problems(path)
    assert str(caught.value).startswith(f"{path}:{line}: not valid TOML: ")
    assert (caught.value.line, caught.value.found) == (line, found)
    assert allowed in caught.value.allowed
    assert bool(allowed) == bool(caught.value.allowed)


@pytest.mark.parametrize(
    ("key", "line"),
    [
        ("bodies.movable.seed", 3), ("size[2] 'depth'.tolerance", 9), ("case[2] 'B'.limits.TX", 15),
        ("case 'B'.goal", 14), ("case[2] 'B'.size[2].tolerance", 9),  # which all cases share
        ("case[2] 'B'.Rotation.centre", 14), ("case[1] 'A'", 11), ("nothing", None),
    ],
)  # fmt: skip
def test_a_key_of_a_file_is_named_with_its_line(tmp_path: Path, key: str, line: int | None) -> None:
    """Where it stands, or else the table in which it would."""
    path = tmp_path / "own.toml"
    path.write_text(
        'title = "own"\n[bodies.movable]\nseed = [\n  1, 2, 3]\n[[size]]\nname = "width"\n[[size]]\nname = "depth"\n'
        'tolerance = 0.1\n\n[[case]]\nname = "A"\ngoal = "touch"\n[[case]]\nlimits = { TX = [0, 1] }\nname = "B"\n'
    )
    told = str(InputError("wrong", file=path, key=key))
    assert told == f"{path}{'' if line is None else f':{line}'}: {key}: wrong"


def test_of_thousands_of_names_an_error_lists_the_first() -> None:
    names = [f"F{k}" for k in range(5000)]
    told = str(InputError("no such face", key="faces", found="F9999", allowed=", ".join(names)))
    assert len(told) < 1000
    listed = told.partition("allowed: ")[2]
    assert listed.startswith("F0, F1, F2")
    shown = listed.partition(", ... and ")[0].count(",") + 1
    assert listed.endswith(f", ... and {5000 - shown:,} more")


@pytest.mark.parametrize(
    ("call", "meant"),
    [
        (lambda wrong: fo.solve(None, **wrong("certfy")), "certify"),
        (lambda wrong: fo.conflicts(None, **wrong("certfy")), "certify"),
        (lambda wrong: fo.solve_all([PROBLEM], **wrong("certfy")), "certify"),
        (lambda wrong: fo.Body.from_file("lid.stl", **wrong("units")), "unit"),
        (lambda wrong: fo.Rotation("z", **wrong("center")), "centre"),
        (lambda wrong: fo.KeepOut(None, **wrong("clearence")), "clearance"),
        (lambda wrong: fo.Size("width", "movable", **wrong("tol")), "tolerance"),
        (lambda wrong: fo.Uniform(0.0, **wrong("hihg")), "high"),
        (lambda wrong: fo.Study(PROBLEM, **wrong("samplng")), "sampling"),
    ],
)  # fmt: skip
def test_a_slip_in_an_argument_was_a_bare_type_error(call: Callable[[Any], Any], meant: str) -> None:
    with pytest.raises(InputError, match=rf"unknown argument '\w+', did you mean '{meant}'\?; ") as caught:
        call(lambda name: {name: True})
    assert meant in caught.value.allowed


def test_a_share_in_per_cent_was_refused_without_how_to_write_it(tmp_path: Path) -> None:
    assert "; found '2 %'" in str(told := answer(tmp_path, "tolerance = 0.02", 'tolerance = "2 %"'))
    assert "shape, write 0.02; " in str(told)


def test_what_a_call_lacks_was_a_bare_type_error_and_what_prints_was_everything() -> None:
    with pytest.raises(InputError, match=r'^unit: this argument is missing; allowed: unit="m" or .*unit="mm"'):
        fo.Body.from_file("lid.stl")  # type: ignore[call-arg]
    with pytest.raises(InputError, match="solve_all"):
        fo.solve([PROBLEM, PROBLEM])  # type: ignore[call-overload]
    curve = fo.decision_curve(CUBE, CUBE.moved([[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))
    assert str(curve) == f"{repr(curve)[:-1]}, segments: {len(curve.segments)}, switching points: 0)"
    one = curve.segments[0]
    assert str(one).startswith(f"Segment(1: {one.feature.label}, 0.5 rho_1 + 0.5 rho_2 = 2, from (")
    assert "\n" not in f"{curve}{one}"


def test_every_public_function_names_its_arguments_and_still_goes_to_other_processes() -> None:
    for name in set(fo.__all__) - {"whatif", "solve_all"}:  # they take those of a problem and of `solve`, too
        if isinstance(own := getattr(fo, name), FunctionType):
            with pytest.raises(InputError, match="unknown argument 'nothing'"):
                own(nothing=None)
            assert pickle.loads(pickle.dumps(own)) is own


def test_after_the_key_that_was_meant_all_others_were_listed(tmp_path: Path) -> None:
    told = answer(tmp_path, "tolerance = 0.02", "tolerence = 0.02")
    assert str(told).endswith("unknown key 'tolerence', did you mean 'tolerance'?; found 0.02")
    assert "requirement" in told.allowed  # as data they are all there
    far = answer(tmp_path, "tolerance = 0.02", "wobble = 0.02")
    assert "; allowed: nominal, tolerance, " in str(far)
    with pytest.raises(InputError, match=r"did you mean 'tolerance'\?; found 0.02$"):
        PROBLEM.changed(tolerence=0.02)


def test_a_mesh_file_that_is_not_there_is_told_with_where_it_was_looked_for(tmp_path: Path) -> None:
    """It was "cannot be read: No such file or directory"."""
    path, corners = tmp_path / "p.toml", "vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]"
    (tmp_path / "peg.stl").write_text("")
    path.write_text(FILE.replace(corners, 'file = "pag.stl"\nunit = "mm"'))
    with pytest.raises(InputError) as caught:
        load_problems(path)
    missing = f"{tmp_path / 'pag.stl'}: no such file in {tmp_path}, did you mean 'peg.stl'?"
    assert str(caught.value) == f"{path}:3: bodies.movable.file: the body cannot be taken from its file: {missing}"


def test_numbers_of_arrays_were_told_by_their_type() -> None:
    for found, told in (
        (np.float64(0.0), "0.0"),
        ([np.float64(-1.5e-9), np.int64(2)], "[-1.5e-09, 2]"),
        ({"a": np.float32(0.5)}, "{'a': 0.5}"),
        ("np.float64(1.0)", "'np.float64(1.0)'"),
    ):
        assert str(InputError("wrong", found=found)) == f"wrong; found {told}"


def test_names_with_commas_were_listed_as_if_they_were_two(tmp_path: Path) -> None:
    """Two cases, "a, b" and "c", were "allowed: a, b, c"; what is listed can be typed as an option that takes names."""
    assert name_list(["a, b", "c"]) == '"a, b", c'
    assert names("--over", name_list(["a, b", "c"])) == ["a, b", "c"]
    assert names("--over", "a ,b") == ["a", "b"]
    path = tmp_path / "p.toml"
    head, table, case = FILE.partition("[[case]]")
    path.write_text(head + table + case.replace('"A"', '"peg, short"', 1) + table + case)
    with pytest.raises(InputError, match=r'^--case: no such case; found .x.; allowed: "peg, short", A$'):
        opened_files([path], ["x"], assemblies=False)
    with pytest.raises(InputError, match=r'; allowed: "wide, left", deep$'):
        known_sizes(["x"], "made", ["wide, left", "deep"])


@pytest.mark.parametrize(
    ("old", "new", "key", "told"),
    [
        ("tolerance = 0.02", 'tolerance = "H7"', "defaults.tolerance", "limits of a [[size]], tolerance = [LOWER, "),
        ('[{ translation = "x" }]', '"x"', "defaults.motion", "not a list; found 'x'"),
        ('[{ translation = "x" }]', "[]", "defaults.motion", "too few items; found []"),
        ('{ translation = "x" }', "{ free = false }", "defaults.motion[1].free", "an unusable value; found False"),
        (
            '{ translation = "x" }', '{ translation = "x", rotation = "z" }', "defaults.motion[1]",
            "several steps in one; found {'translation': 'x', 'rotation': 'z'}; allowed: a table each: "
            "{ translation = .. }, { rotation = .. }",
        ),
        ("[defaults]", "[defaults]\nlimits = { TX = 1 }", "defaults.limits.TX", "not a list; found 1"),
        ("[defaults]", "[defaults]\nlimits = [-1, 1]", "defaults.limits", "not a table; found [-1, 1]"),
        ("[defaults]", '[defaults]\nlength = "5 mm"', "defaults.length", "not a number; found '5 mm'"),
        ('name = "A"', "name = 3", "case[1].name", "not text in quotes; found 3"),
        ('seed = "centroid"', 'round = "yes"', "bodies.movable.round", "not true or false; found 'yes'"),
        (
            'name = "A"', 'name = "A"\ngoal = "fit"', "case[1] 'A'.contacts",
            'missing with goal "fit"; allowed: "all", or a list of labels',
        ),
    ],
)  # fmt: skip
def test_slips_were_told_in_words_of_a_library_or_of_something_else(
    tmp_path: Path, old: str, new: str, key: str, told: str
) -> None:
    """ "input should be a valid tuple", "unknown free", "did you mean 'translation'?" of a step that is one."""
    error = answer(tmp_path, old, new)
    assert error.key == key
    assert told in str(error)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("solve p.toml --case", "--case: its value is missing"),
        ("solve p.toml --time abc", "--time: not a number; found 'abc'; see "),
        ("map p.toml --jobs 0", "--jobs: too small a number; found '0'; allowed: >= 1; see "),
        ("stack p.toml --draws 1.5", "--draws: not a whole number; found '1.5'; see "),
        ("map p.toml --over width", "--over: not one to 6 sizes or scales: no 'width'; found ['width']; allowed: "),
        ("map p.toml --over rho_1,rho_1", "--over: not one to 6 sizes or scales: one is given twice; found "),
    ],
)
def test_options_were_refused_in_words_of_a_library_without_what_was_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str, told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("p.toml").write_text(FILE)
    result = CliRunner().invoke(app, line.split())
    assert result.exit_code == 2
    assert result.stderr.startswith(f"error: {told}")


def test_other_words_for_keys_are_known() -> None:
    for word, meant in {"sigma": "deviation", "std": "deviation", "draws": "count", "lhs": "latin hypercube"}.items():
        assert closest(word, ["mean", "deviation", "count", "latin hypercube"]) == f", did you mean '{meant}'?"


def test_an_argument_that_a_method_gives_names_it() -> None:
    """A box has no seed of its own to choose; `with_seed` was not named."""
    with pytest.raises(fo.InputError, match=r"unknown argument 'seed': \.with_seed\(\.\.\.\) of the Body gives it"):
        fo.Box((1, 1, 1), seed=(0, 0, 0))  # type: ignore[call-arg]
