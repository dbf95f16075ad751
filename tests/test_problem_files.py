"""Problem files: those in `problems/`, and every way to get one wrong."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from fcdm_opt.errors import InputError
from fcdm_opt.motion import Rotation, Screw, Translation
from fcdm_opt.tolerance.files import ProblemFile, load_problems
from fcdm_opt.tolerance.problem import Problem

PROBLEMS = Path(__file__).parent.parent / "problems"
BODIES = """
[bodies.movable]
vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
[bodies.static]
vertices = [[3, 0, 0], [2, 0, 0], [3, 1, 0], [3, 0, 1]]
"""
CASE = """
[[case]]
name = "A"
goal = "touch"
target = [1.0, 1.0]
motion = [{ translation = "z" }, { rotation = "z", centre = "origin" }]
"""


def load(folder: Path, text: str) -> tuple[Problem, ...]:
    (folder / "case.toml").write_text(text, encoding="utf-8")
    return load_problems(folder / "case.toml")


# ----------------------------------------------------------------------------------------------- files of the project


@pytest.mark.parametrize(
    ("name", "nominal", "published"), [("example1", 3, (1.273451, 1.214536)), ("example2", 1, (2.378003, 2.140897))]
)
def test_the_papers_examples_load_at_the_published_switching_point(name: str, nominal: int, published: tuple) -> None:
    beyond, touch = load_problems(PROBLEMS / f"{name}.toml"), load_problems(PROBLEMS / f"{name}_touch.toml")
    for cases, goal in ((beyond, "beyond"), (touch, "touch")):
        assert [problem.name for problem in cases] == ["A", "B", "C", "D"]
        assert [problem.requirement for problem in cases] == ["A", "B", "C", "D"]
        for problem in cases:
            assert (problem.goal, problem.nominal) == (goal, nominal)
            np.testing.assert_allclose(problem.nominal_pair, published, atol=5e-7)
            np.testing.assert_allclose(problem.target, problem.nominal_pair * (1 + 0.02 * problem.signs), rtol=1e-15)
    for one, two in zip(beyond, touch, strict=True):
        assert one.motion == two.motion
        assert one.target.tolist() == two.target.tolist()
        assert two.published is None
    for text in (ProblemFile.read(PROBLEMS / f"{stem}.toml").note for stem in (name, f"{name}_touch")):
        assert "reconstruction" in text.lower()


def test_published_motions_read_as_in_the_tables() -> None:
    words = {
        stem: [problem.motion.describe(problem.published) for problem in load_problems(PROBLEMS / f"{stem}.toml")]
        for stem in ("example1", "example2")
    }
    assert words["example1"] == [
        "Screw -0.0054, -0.0054 deg", "TZ 0.25 + RZ 7.0191 deg", "TZ -0.1178 + RZ -6 deg", "Screw 0.0051, 0.0051 deg",
    ]
    assert words["example2"] == ["TY -0.0337 + RZ 2 deg", "TY -0.0193", "TY 0.0193", "TY 0.0313 + RZ -2 deg"]
    one, two = (load_problems(PROBLEMS / f"{stem}.toml") for stem in ("example1", "example2"))
    assert one[0].motion.steps == (Screw("seeds", pitch=math.degrees(1.0)),)
    assert one[1].motion.steps == (Translation("z"), Rotation("z", centre="origin"))
    assert two[0].motion.steps == (Translation("y"), Rotation("z", centre="origin"))


def test_example_2_keeps_its_parts_and_faces() -> None:
    static = load_problems(PROBLEMS / "example2.toml")[0].static
    assert [len(part.vertices) for part in static.parts] == [8, 8]
    assert len(static.faces) == 8
    assert (1, 2, 3, 4, 5, 6) in static.faces
    assert static.seed.tolist() == [-2.13, 0.0, 0.0]


def test_published_motions_of_the_boxes_meet_their_goals_in_closed_form() -> None:
    """Exact supports of the two boxes along x, without any code of the curve."""
    cases = load_problems(PROBLEMS / "boxes.toml")
    assert len(cases) == 8
    for problem in cases:
        T = problem.motion.transform(problem.published, problem.movable.seed, problem.static.seed)
        rho_1, rho_2 = problem.target
        gap = problem.static.scaled(rho_2).vertices[:, 0].min() - problem.movable.placed_vertices(rho_1, T)[:, 0].max()
        if problem.name == "already clear":
            assert not np.any(problem.published)
            assert gap == pytest.approx(0.5, rel=1e-14)
        else:
            assert gap == pytest.approx(problem.clearance, abs=1e-14), problem.name
        assert np.all(problem.limits[:, 0] <= problem.published)
        assert np.all(problem.published <= problem.limits[:, 1])


@pytest.mark.parametrize("path", sorted(PROBLEMS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_case_of_the_project_comes_back_from_plain_data(path: Path) -> None:
    for problem in load_problems(path):
        text = json.dumps(problem.to_dict(), allow_nan=False)
        again = Problem.from_dict(json.loads(text))
        assert json.dumps(again.to_dict(), allow_nan=False) == text
        assert again.target.tobytes() == problem.target.tobytes()
        assert again.nominal_pair.tobytes() == problem.nominal_pair.tobytes()
        one, two = ([segment.feature for segment in each.curve.segments] for each in (problem, again))
        assert one == two


# ----------------------------------------------------------------------------------------------------- what keys mean


def test_units_stand_in_the_keys(tmp_path: Path) -> None:
    (problem,) = load(
        tmp_path,
        BODIES + CASE + "limits = { TZ = [-1, 2], RZ_deg = [-180, 90] }\nweights = { TZ = 2, RZ_per_deg = 3.0 }\n"
        "published = [{ translation = 1 }, { angle_rad = 0.5 }]\n",
    )
    np.testing.assert_allclose(problem.limits, [[-1, 2], [-math.pi, math.pi / 2]], rtol=1e-15)
    np.testing.assert_allclose(problem.weights, [2, 540 / math.pi], rtol=1e-15)
    assert problem.published == (1.0, 0.5)
    (radians,) = load(tmp_path, BODIES + CASE + 'limits = { RZ_rad = [-0.5, inf] }\nweights = { RZ_per_rad = 3.0 }\n')
    assert radians.limits.tolist() == [[-math.inf, math.inf], [-0.5, math.inf]]
    assert radians.weights.tolist() == [1.0, 3.0]


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        ('{ screw = "seeds", pitch = "free" }', Screw("seeds", pitch="free")),
        ('{ screw = "seeds", pitch = "infinite" }', Screw("seeds", pitch=math.inf)),
        ('{ screw = "seeds", pitch_per_rad = 0 }', Screw("seeds", pitch=0.0)),
        ('{ screw = "seeds", pitch_per_deg = 2 }', Screw("seeds", pitch=360 / math.pi)),
        (
            "{ screw = { point = [1, 2, 3], direction = [0, 3, 4] }, pitch_per_rad = 5 }",
            Screw(((1, 2, 3), (0, 3, 4)), pitch=5),
        ),
        ('{ rotation = "-x", centre = "seed" }', Rotation("-x", centre="seed")),
        ("{ rotation = [0, 3, 4], centre = [1, 2, 3] }", Rotation((0, 3, 4), centre=(1, 2, 3))),
        ("{ translation = [0, 3, 4] }", Translation((0, 3, 4))),
    ],
)
def test_steps(tmp_path: Path, step: str, expected: object) -> None:
    text = CASE.partition("motion")[0] + f"motion = [{step}]\n"
    (problem,) = load(tmp_path, BODIES + text)
    assert problem.motion.steps == (expected,)


def test_a_case_overrides_the_defaults_and_bodies_may_stand_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text(BODIES + '[defaults]\npair = "touch"\n', encoding="utf-8")
    text = (
        'bodies = "other.toml"\n[defaults]\ngoal = "clear"\nclearance = 0.5\ntarget = [2.0, 2.0]\n'
        'motion = [{ translation = "x" }]\n[[case]]\nname = "one"\n[[case]]\nname = "two"\nclearance = 0.25\n'
    )
    one, two = load(tmp_path, text)
    assert (one.clearance, two.clearance, one.pair) == (0.5, 0.25, "any")
    assert one.movable.name == "movable"
    assert one.static.vertices[1].tolist() == [2.0, 0.0, 0.0]


# --------------------------------------------------------------------------------------------------------- bad files

STEP_2 = '{ rotation = "z", centre = "origin" }'
BAD = [
    # what is changed in the good file, into what, the key, what was found, what is allowed
    ("name = ", "nmae = ", "case[1].nmae", "did you mean 'name'?; found 'A'", "published_text, name"),
    ("target = ", "targets = ", "case[1] 'A'.targets", "did you mean 'target'?", "target, box"),
    ('name = "A"\n', "", "case[1].name", "missing key; found 'only goal, target, motion'", "name of the case"),
    ('name = "A"', "name = 3", "case[1].name", "found 3", "text"),
    ("[bodies.static]", "[bodies.statik]", "bodies.statik", "did you mean 'static'?", "movable, static"),
    ("vertices", "vertexes", "bodies.movable.vertexes", "did you mean 'vertices'?", "vertices, parts"),
    ("[[0, 0, 0],", "[[0, 0],", "bodies.movable.vertices[1]", "found [0, 0]", "[[x, y, z], ...]"),
    ("[[0, 0, 0],", '[[0, 0, "0"],', "bodies.movable.vertices[1][3]", "found '0'", "[[x, y, z], ...]"),
    ("[[0, 0, 0],", "[[0, nan, 0],", "bodies.movable.vertices[1][2]", "not finite; found nan", "[[x, y, z], ...]"),
    ("[[0, 0, 0],", "[[0, inf, 0],", "bodies.movable.vertices[1][2]", "not finite; found inf", "[[x, y, z], ...]"),
    ("[[0, 0, 0],", "[", "bodies.movable.body 'movable'", "found 3", ""),
    ("[0, 0, 1]]", '[0, 0, 1]]\nseed = "middle"', "bodies.movable.seed", "found 'middle'", '"centroid"'),
    ("[0, 0, 1]]", "[0, 0, 1]]\nparts = [[1, 2, 3, 4], [1, 2, 3, 5]]", "bodies.movable.parts[2]", "found 5", "1 to 4"),
    ("[0, 0, 1]]", "[0, 0, 1]]\nfaces = [[0, 1, 2]]", "bodies.movable.faces[1][1]", "found 0", "1-based"),
    (', centre = "origin"', "", "case[1] 'A'.motion[2].centre", "missing key", '"seed"'),
    ('centre = "origin"', 'centre = "middle"', "case[1] 'A'.motion[2].centre", "found 'middle'", '"origin"'),
    (
        'centre = "origin"', 'center = "origin"', "case[1] 'A'.motion[2].center", "did you mean 'centre'?",
        "rotation, centre",
    ),
    ('translation = "z"', 'translation = "w"', "case[1] 'A'.motion[1].translation", "found 'w'", '"-x"'),
    (
        'translation = "z"', "translation = [0, 0, 0]", "case[1] 'A'.motion[1].Translation.axis",
        "found (0.0, 0.0, 0.0)", "",
    ),
    (
        '{ translation = "z" }', '{ shift = "z" }', "case[1] 'A'.motion[1]", "found {'shift': 'z'}",
        "{ translation = .. }",
    ),
    (f', {STEP_2}]', "]\nlimits = { RZ_deg = [0, 1] }", "case[1] 'A'.limits.RZ_deg", "no such parameter", "TZ"),
    ('[{ translation = "z" }, ', '["z", ', "case[1] 'A'.motion[1]", "found 'z'", "{ translation = .. }"),
    (f'[{{ translation = "z" }}, {STEP_2}]', "[]", "case[1] 'A'.motion", "found []", "{ translation = .. }"),
    (f'motion = [{{ translation = "z" }}, {STEP_2}]', "", "case[1] 'A'.motion", "missing key", "{ translation = .. }"),
    (STEP_2, '{ screw = "seeds" }', "case[1] 'A'.motion[2]", "found 'none'", "exactly one of pitch_per_deg"),
    (
        STEP_2, '{ screw = "seeds", pitch = "free", pitch_per_deg = 1 }', "case[1] 'A'.motion[2]",
        "pitch, pitch_per_deg", "one of",
    ),
    (STEP_2, '{ screw = "seeds", pitch = 1.0 }', "case[1] 'A'.motion[2].pitch", "found 1.0", '"free"'),
    (
        STEP_2, '{ screw = { point = [0, 0, 0] }, pitch = "free" }', "case[1] 'A'.motion[2].screw.direction",
        "missing", "[x, y, z]",
    ),
    ("target = [1.0, 1.0]", "target = [1.0, true]", "case[1] 'A'.target[2]", "found True", "[rho_1, rho_2]"),
    ("target = [1.0, 1.0]", "target = [1.0]", "case[1] 'A'.target", "found [1.0]", "[rho_1, rho_2]"),
    ("target = [1.0, 1.0]", "target = [1.0, 0.0]", "case[1] 'A'.target", "found (1.0, 0.0)", "> 0"),
    ("target = [1.0, 1.0]", "", "case[1] 'A'.requirement", "found 'neither'", "target (rho_1, rho_2)"),
    ("target = ", 'tolerance = "2 %"\ntarget = ', "case[1] 'A'.tolerance", "found '2 %'", "0.02 is 2 %"),
    ("target = ", "tolerance = nan\ntarget = ", "case[1] 'A'.tolerance", "not finite; found nan", "0.02 is 2 %"),
    ("target = ", "nominal = 1.5\ntarget = ", "case[1] 'A'.nominal", "found 1.5", '"drawn"'),
    ("target = ", "nominal = 9\ntarget = ", "case[1] 'A'.nominal", "found 9", "one of 1: 1 at (1."),
    ("target = ", "clearance = 0.5\ntarget = ", "case[1] 'A'.clearance", "found 0.5", '"clear"'),
    ('goal = "touch"', 'goal = "seat"', "case[1] 'A'.goal", "not available in this version; found 'seat'", '"beyond"'),
    ('goal = "touch"', "goal = 1", "case[1] 'A'.goal", "found 1", '"beyond"'),
    (None, "limits = { RZ = [0, 1] }", "case[1] 'A'.limits.RZ", "unit of the angle is missing", "TZ, RZ_deg, RZ_rad"),
    (
        None, "limits = { RZ_degrees = [0, 1] }", "case[1] 'A'.limits.RZ_degrees", "did you mean 'RZ_deg'?",
        "TZ, RZ_deg, RZ_rad",
    ),
    (None, "limits = { RZ_deg = [0, 1], RZ_rad = [0, 1] }", "case[1] 'A'.limits.RZ_rad", "given twice", "one unit"),
    (None, "limits = { TZ = [1, 0] }", "case[1] 'A'.limits.TZ", "found (1.0, 0.0)", "lower <= upper"),
    (None, "limits = { TZ = [nan, 0] }", "case[1] 'A'.limits.TZ", "found (nan, 0.0)", "lower <= upper"),
    (None, 'limits = { TZ = [0, "1"] }', "case[1] 'A'.limits.TZ[2]", "found '1'", "angles as _deg or _rad"),
    (None, "limits = { TZ = 1 }", "case[1] 'A'.limits.TZ", "found 1", "lower and upper"),
    (
        None, "weights = { RZ = 1 }", "case[1] 'A'.weights.RZ", "unit of the angle is missing",
        "TZ, RZ_per_deg, RZ_per_rad",
    ),
    (None, "weights = { TZ = 0 }", "case[1] 'A'.weights.TZ", "found 0.0", "> 0"),
    (None, "published = [{ translation = 1 }]", "case[1] 'A'.published", "found 1", "2"),
    (
        None, "published = [{ angle_deg = 1 }, { angle_deg = 1 }]", "case[1] 'A'.published[1]",
        "found 'angle_deg'", "translation",
    ),
    (
        None, "published = [{ translation = 1 }, { angle = 1 }]", "case[1] 'A'.published[2].angle", "unknown key",
        "angle_deg",
    ),
    (
        None, "published = [{ translation = 1 }, { angle_deg = 1, angle_rad = 1 }]", "case[1] 'A'.published[2]",
        "fit", "or angle_rad",
    ),
    (None, CASE, "case[2] 'A'.name", "the name is that of case[1]; found 'A'", "no other case"),
    (
        None, '[[case]]\nname = "B"\nmotion = [{ rotation = "x" }]', "case[2] 'B'.motion[1].centre",
        "missing key", '"seed"',
    ),
    (None, '[[case]]\nname = "B"\n[[case]]\nname = "C"', "case[2] 'B'.motion", "missing key", "{ translation = .. }"),
    (None, '[defaults]\nname = "x"', "defaults.name", "unknown key 'name'", "nominal, tolerance"),
    (None, "[default]\nlength = 1.0", "default", "did you mean 'defaults'?", "title, note"),
    (CASE, "", "case", "there is no case", "[[case]]"),
    (BODIES, "", "bodies", "missing key; found 'only case'", "[bodies.movable]"),
    (BODIES, "bodies = 3\n", "bodies", "found 3", "movable, static"),
    (BODIES, 'bodies = "none.toml"\n', "bodies", "none.toml: the file cannot be read", "readable"),
    (BODIES, 'bodies = "case.toml"\n', "bodies", "no bodies of its own; found 'case.toml'", "[bodies.movable]"),
    (BODIES + CASE, "", None, "the file is empty", "[[case]]"),
    ("goal = ", "goal == ", None, "not valid TOML", ""),
]


@pytest.mark.parametrize(("old", "new", "key", "found", "allowed"), BAD)
def test_bad_file(tmp_path: Path, old: str | None, new: str, key: str | None, found: str, allowed: str) -> None:
    good = BODIES + CASE
    load(tmp_path, good)
    text = good + new + "\n" if old is None else good.replace(old, new, 1)
    assert text != good
    with pytest.raises(InputError) as caught:
        load(tmp_path, text if text.strip() else "")
    assert caught.value.key == key
    message = str(caught.value)
    assert message.startswith(str(tmp_path / "case.toml"))
    assert found in message
    assert allowed in message.partition("allowed: ")[2]


def test_a_syntax_error_names_the_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"case\.toml: not valid TOML: .*line 2"):
        load(tmp_path, 'title = "x"\nnote = oops\n')


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(InputError, match="the file cannot be read") as caught:
            load_problems(path)
        assert caught.value.file == path
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text file in UTF-8"):
        load_problems(tmp_path / "binary.toml")


def test_body_errors_of_another_file_name_that_file(tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text(BODIES.replace("[0, 0, 1]]", "[1, 1, 0]]", 1), encoding="utf-8")
    with pytest.raises(InputError, match=r"other\.toml: bodies\.movable.*lie in one plane"):
        load(tmp_path, 'bodies = "other.toml"\n' + CASE)


@pytest.mark.parametrize(
    ("published", "agrees"),
    [
        ("{ translation = -0.0054, angle_deg = -0.0054 }", True),
        ("{ translation = 0.0051, angle_deg = 0.00513 }", True),
        ("{ translation = 0.0051, angle_deg = 0.0053 }", False),
        ("{ translation = 0.0051, angle_deg = -0.0051 }", False),
        ("{ translation = 0.017453, angle_rad = 0.000304612 }", True),
        ("{ translation = 0.017453, angle_rad = 0.000305612 }", False),
        ("{ angle_deg = 0.3 }", True),
    ],
)
def test_a_published_screw_must_agree_with_its_pitch_to_the_digits_given(
    tmp_path: Path, published: str, agrees: bool
) -> None:
    head = BODIES + CASE.partition("motion")[0]
    text = head + f'motion = [{{ screw = "seeds", pitch_per_deg = 1.0 }}]\npublished = [{published}]\n'
    if agrees:
        assert len(load(tmp_path, text)[0].published or ()) == 1
    else:
        place = r"case\[1\] 'A'\.published\[1\]\.translation"
        with pytest.raises(InputError, match=f"{place}: .* do not agree .*to the digits"):
            load(tmp_path, text)


def test_every_key_is_documented() -> None:
    def entries(schema: dict) -> list[dict]:
        return [schema, *schema["$defs"].values()]

    undocumented = [
        f"{entry['title']}.{key}"
        for entry in entries(ProblemFile.model_json_schema())
        for key, item in entry["properties"].items()
        if not item.get("description")
    ]
    assert undocumented == []
