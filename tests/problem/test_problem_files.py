"""Problem files: those in `problems/`, and every way to get one wrong."""

from __future__ import annotations

import json
import math
import re
import tomllib
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from fcdm_opt.design.question import Question
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.primitives import Box
from fcdm_opt.geometry.size import Size
from fcdm_opt.motion.motions import Free, Rotation, Screw, Translation
from fcdm_opt.problem.keys import ProblemFile
from fcdm_opt.problem.problem import Problem, load_problems
from fcdm_opt.problem.schema import LARGEST_FILE
from fcdm_opt.problem.syntax import parsed

PROBLEMS = Path(__file__).parents[2] / "problems"
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
        "Screw -0.0054, -0.0054 deg",
        "TZ 0.25 + RZ 7.0191 deg",
        "TZ -0.1178 + RZ -6 deg",
        "Screw 0.0051, 0.0051 deg",
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


@pytest.mark.sampled(3)
@pytest.mark.parametrize("path", sorted(PROBLEMS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_case_of_the_project_comes_back_from_plain_data(path: Path) -> None:
    for number, problem in enumerate(load_problems(path)):
        text = json.dumps(problem.to_dict(), allow_nan=False)
        again = Problem.from_dict(json.loads(text))
        assert json.dumps(again.to_dict(), allow_nan=False) == text
        assert again.target.tobytes() == problem.target.tobytes()
        assert again.nominal_pair.tobytes() == problem.nominal_pair.tobytes()
        if number == 0:  # the others ask of the same bodies
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
    (radians,) = load(tmp_path, BODIES + CASE + "limits = { RZ_rad = [-0.5, inf] }\nweights = { RZ_per_rad = 3.0 }\n")
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
        ("{ free = true }", Free()),
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


def test_a_case_takes_of_defaults_what_its_motion_has(tmp_path: Path) -> None:
    """Limits and steps of other cases' parameters were refused for it."""
    head = '[defaults]\ngoal = "touch"\ntarget = [1.0, 1.0]\nlimits = { TX = [-1, 1], RZ_deg = [-90, 90] }\n'
    head += "resolution = { TX = 0.5, TY = 0.25 }\n"
    cases = (
        ("x", '{ translation = "x" }'),
        ("turn", '{ rotation = "z", centre = "seed" }'),
        ("y", '{ translation = "y" }'),
    )
    text = "".join(f'[[case]]\nname = "{name}"\nmotion = [{motion}]\n' for name, motion in cases)
    x, turn, y = load(tmp_path, BODIES + head + text)
    assert (x.limits.tolist(), x.resolution.tolist()) == ([[-1, 1]], [0.5])
    assert (turn.limits.tolist(), turn.resolution) == ([[-np.pi / 2, np.pi / 2]], None)
    assert (y.limits.tolist(), y.resolution.tolist()) == ([[-np.inf, np.inf]], [0.25])
    read = [question.problem() for question in Question.read(tmp_path / "case.toml")]
    assert [own.to_dict()["case"] for own in read] == [own.to_dict()["case"] for own in (x, turn, y)]
    with pytest.raises(InputError, match=r"defaults\.limits\.TZ: for case\[1\] 'x': no such parameter"):
        load(tmp_path, BODIES + head.replace("TX", "TZ", 1) + text)
    own = text + "limits = { TX = [0, 1] }\n"
    with pytest.raises(InputError, match=r"case\[3\] 'y'\.limits\.TX: no such parameter"):
        load(tmp_path, BODIES + head + own)


def test_a_case_takes_back_all_contacts_of_the_defaults(tmp_path: Path) -> None:
    head = '[defaults]\ngoal = "at"\ntarget = [1.0, 1.0]\ncontacts = "all"\nmotion = [{ translation = "x" }]\n'
    text = '[[case]]\nname = "all"\n[[case]]\nname = "tracked"\ncontacts = []\n'
    corners = [[list(own) for own in product(*ends)] for ends in ([(0, 1)] * 3, [(1, 2), (-1, 2), (-1, 2)])]
    bodies = "".join(
        f"[bodies.{role}]\nvertices = {own}\n" for role, own in zip(("movable", "static"), corners, strict=True)
    )
    every, one = load(tmp_path, bodies + head + text)
    assert every.contacts
    assert not one.contacts
    assert one.request["contacts"] is None


def test_amounts_steps_and_features_read_and_written_are_the_same(tmp_path: Path) -> None:
    head = CASE.partition("motion")[0]
    (six,) = load(
        tmp_path,
        BODIES + head + "motion = [{ free = true }]\n"
        'amount = "displacement"\nresolution = { TX = 0.5, RY_deg = 2 }\n'
        "limits = { RX_deg = [0, 0] }\npublished = [{ translation = [1, 2, 3], angle_deg = [0, 90, 0] }]\n",
    )
    assert (six.motion, six.amount) == (Free(), "displacement")
    assert six.resolution.tolist() == [0.5, 0, 0, 0, math.radians(2), 0]
    assert six.published == (1, 2, 3, 0, math.pi / 2, 0)
    (shift,) = load(tmp_path, f'{BODIES}{head}motion = [{{ translation = "z" }}]\nresolution = 0.25\n')
    assert shift.resolution.tolist() == [0.25]
    for problem in (six, shift):
        text = json.dumps(problem.to_dict(), allow_nan=False)
        again = Problem.from_dict(json.loads(text))
        assert json.dumps(again.to_dict(), allow_nan=False) == text
        assert again.resolution.tolist() == problem.resolution.tolist()


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
        'centre = "origin"',
        'center = "origin"',
        "case[1] 'A'.motion[2].center",
        "did you mean 'centre'?",
        "rotation, centre",
    ),
    ('translation = "z"', 'translation = "w"', "case[1] 'A'.motion[1].translation", "found 'w'", '"-x"'),
    (
        'translation = "z"',
        "translation = [0, 0, 0]",
        "case[1] 'A'.motion[1].Translation.axis",
        "found (0.0, 0.0, 0.0)",
        "",
    ),
    (
        '{ translation = "z" }',
        '{ shift = "z" }',
        "case[1] 'A'.motion[1]",
        "found {'shift': 'z'}",
        "{ translation = .. }",
    ),
    (f", {STEP_2}]", "]\nlimits = { RZ_deg = [0, 1] }", "case[1] 'A'.limits.RZ_deg", "no such parameter", "TZ"),
    ('[{ translation = "z" }, ', '["z", ', "case[1] 'A'.motion[1]", "found 'z'", "{ translation = .. }"),
    (f'[{{ translation = "z" }}, {STEP_2}]', "[]", "case[1] 'A'.motion", "found []", "{ translation = .. }"),
    (f'motion = [{{ translation = "z" }}, {STEP_2}]', "", "case[1] 'A'.motion", "missing key", "{ translation = .. }"),
    (STEP_2, "{ free = false }", "case[1] 'A'.motion[2].free", "found False", "true"),
    (STEP_2, '{ casadi = "f" }', "case[1] 'A'.motion[2].parameters", "only casadi", '[["TZ", "translation"], ...]'),
    (
        STEP_2,
        '{ casadi = "f", parameters = [["TZ", "translation"]] }',
        "case[1] 'A'.motion[2].OwnMotion.text",
        "found",
        "the text of another OwnMotion",
    ),
    ('goal = "touch"', 'amount = "way"', "case[1] 'A'.amount", "found 'way'", '"displacement"'),
    ('goal = "touch"', 'amount = { casadi = "f" }', "case[1] 'A'.amount.casadi", "found", '"displacement"'),
    ('goal = "touch"', "amount = { f = 1 }", "case[1] 'A'.amount.f", "unknown key 'f'", "casadi"),
    ('goal = "touch"', "resolution = 0.1", "case[1] 'A'.resolution", "unit of the angles", "RZ_deg = 0.1"),
    ('goal = "touch"', "resolution = { RZ = 0.1 }", "case[1] 'A'.resolution.RZ", "unit of the angle", "RZ_deg"),
    ('goal = "touch"', "resolution = { TZ = 0 }", "case[1] 'A'.resolution.TZ", "found 0", "> 0"),
    ('goal = "touch"', 'features = ["V1F2"]', "case[1] 'A'.features", "found ['V1F2']", "labels of the two features"),
    (STEP_2, '{ screw = "seeds" }', "case[1] 'A'.motion[2]", "found 'none'", "exactly one of pitch_per_deg"),
    (
        STEP_2,
        '{ screw = "seeds", pitch = "free", pitch_per_deg = 1 }',
        "case[1] 'A'.motion[2]",
        "pitch, pitch_per_deg",
        "one of",
    ),
    (STEP_2, '{ screw = "seeds", pitch = 1.0 }', "case[1] 'A'.motion[2].pitch", "found 1.0", '"free"'),
    (
        STEP_2,
        '{ screw = { point = [0, 0, 0] }, pitch = "free" }',
        "case[1] 'A'.motion[2].screw.direction",
        "missing",
        "[x, y, z]",
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
    ('goal = "touch"', 'goal = "stand"', "case[1] 'A'.goal", "unknown goal; found 'stand'", '"seat"'),
    ('goal = "touch"', "goal = 1", "case[1] 'A'.goal", "found 1", '"beyond"'),
    (None, "limits = { RZ = [0, 1] }", "case[1] 'A'.limits.RZ", "unit of the angle is missing", "TZ, RZ_deg, RZ_rad"),
    (
        None,
        "limits = { RZ_degrees = [0, 1] }",
        "case[1] 'A'.limits.RZ_degrees",
        "did you mean 'RZ_deg'?",
        "TZ, RZ_deg, RZ_rad",
    ),
    (None, "limits = { RZ_deg = [0, 1], RZ_rad = [0, 1] }", "case[1] 'A'.limits.RZ_rad", "given twice", "one unit"),
    (None, "limits = { TZ = [1, 0] }", "case[1] 'A'.limits.TZ", "found (1.0, 0.0)", "lower <= upper"),
    (None, "limits = { TZ = [nan, 0] }", "case[1] 'A'.limits.TZ", "found (nan, 0.0)", "lower <= upper"),
    (None, 'limits = { TZ = [0, "1"] }', "case[1] 'A'.limits.TZ[2]", "found '1'", "angles as _deg or _rad"),
    (None, "limits = { TZ = 1 }", "case[1] 'A'.limits.TZ", "found 1", "lower and upper"),
    (
        None,
        "weights = { RZ = 1 }",
        "case[1] 'A'.weights.RZ",
        "unit of the angle is missing",
        "TZ, RZ_per_deg, RZ_per_rad",
    ),
    (None, "weights = { TZ = 0 }", "case[1] 'A'.weights.TZ", "found 0.0", "> 0"),
    (None, "published = [{ translation = 1 }]", "case[1] 'A'.published", "found 1", "2"),
    (
        None,
        "published = [{ angle_deg = 1 }, { angle_deg = 1 }]",
        "case[1] 'A'.published[1]",
        "found 'angle_deg'",
        "translation",
    ),
    (
        None,
        "published = [{ translation = 1 }, { angle = 1 }]",
        "case[1] 'A'.published[2].angle",
        "unknown key",
        "angle_deg",
    ),
    (
        None,
        "published = [{ translation = 1 }, { angle_deg = 1, angle_rad = 1 }]",
        "case[1] 'A'.published[2]",
        "fit",
        "or angle_rad",
    ),
    (None, CASE, "case[2] 'A'.name", "the name is that of case[1]; found 'A'", "no other case"),
    (
        None,
        '[[case]]\nname = "B"\nmotion = [{ rotation = "x" }]',
        "case[2] 'B'.motion[1].centre",
        "missing key",
        '"seed"',
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
    assert allowed in message.partition("allowed: ")[2] + caught.value.allowed  # not told where it is a long list


def test_a_syntax_error_names_the_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"case\.toml:2: not valid TOML: .*; found 'note = oops'; allowed: "):
        load(tmp_path, 'title = "x"\nnote = oops\n')


def test_one_pair_of_brackets_for_each_of_several_cases_was_refused_without_a_hint(
    tmp_path: Path,
) -> None:
    with pytest.raises(InputError, match=r"\[case\] is given twice; .*; allowed: \[\[case\]\], in two brackets"):
        load(tmp_path, BODIES + '[case]\nname = "A"\n[case]\nname = "B"\n')


def test_a_face_of_a_size_that_is_not_there_was_placed_in_a_case_and_far_ones_listed(
    tmp_path: Path,
) -> None:
    size = '[[size]]\nname = "top"\nbody = "movable"\nfaces = [{ through = [0.2, 0.2, -0.1] }]\n'
    with pytest.raises(InputError) as caught:
        load(tmp_path, size + BODIES + CASE)
    assert caught.value.key == "size 'top'.faces[1]"
    assert "case.toml:4: size 'top'.faces[1]: no face of body" in str(caught.value)
    with pytest.raises(InputError) as caught:
        Size("width", "movable", faces=[{"through": (5.4, 0, 0)}]).offsets(Box((10, 10, 10)))
    assert "(+x, x = 5), " in (caught.value.allowed or "").split("F")[1]


def test_the_line_of_a_table_was_told_for_a_key_of_its_own_and_all_sizes_made_for_one(tmp_path: Path) -> None:
    """What is wrong stands in the line that ends so; a size is known by its name, its number, or both."""
    size = '[[size]]\nname = "top"\nbody = "movable"\nfaces = ["-x"]\neach = 1.0\ntolerance = 0.1\n'
    other = size.replace("top", "side")
    for wrong, key in (
        ("each = [1.0, 2.0]", "size[2].size 'side'.each"),
        ("tolerance = [0.1, -0.1]", "size[2].size 'side'.tolerance"),
        ('faces = ["F99"]', "size 'side'.faces[1]"),
        ('made = { top = 0.1, side = "abc" }', "case[1] 'A'.made.side"),
    ):
        name = wrong.partition(" ")[0]
        made = re.sub(rf"^{name} = .*", f"{wrong}  # WRONG", other, flags=re.MULTILINE)
        text = BODIES + size + made + '[[case]]\nname = "A"\n' + (f"{wrong}  # WRONG\n" if name == "made" else "")
        text += 'goal = "touch"\nmotion = [{ translation = "x" }]\n'
        (line,) = (k for k, own in enumerate(text.splitlines(), 1) if own.endswith("# WRONG"))
        with pytest.raises(InputError) as caught:
            load(tmp_path, text)
        assert caught.value.key == key
        assert f"case.toml:{line}: {key}: " in str(caught.value)
    assert caught.value.found == "abc"


def test_a_key_of_fifty_thousand_levels_is_refused_at_once(tmp_path: Path) -> None:
    """The parser took a minute and more for it; the check is by the text, so that nothing is parsed."""
    for text in ("a." * 50_000 + "b = 1\n", f"[{'a . ' * 50_000}b]\n", "x = { " + "\"a\".'b'." * 50_000 + "c = 1 }\n"):
        with pytest.raises(InputError, match="a key of more than 64 levels") as caught:
            load(tmp_path, 'title = """\nx"""\n\n' + text)
        assert caught.value.line == 4
    words = "a." * 500
    for text in (f'title = "{words}"\n', f"title = '{words}' # {words}\n", f'title = """\n{words}"""\n'):
        assert parsed(text) == tomllib.loads(text)
    deep = "a." * 40 + "b = 1\n"
    assert parsed(deep) == tomllib.loads(deep)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(InputError, match="the file cannot be read") as caught:
            load_problems(path)
        assert caught.value.file == path
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text file in UTF-8"):
        load_problems(tmp_path / "binary.toml")
    with (tmp_path / "large.toml").open("wb") as file:
        file.truncate(LARGEST_FILE + 1)  # nothing but zeros, as a device that has no end
    with pytest.raises(InputError, match=r"large\.toml: the file is too large"):
        load_problems(tmp_path / "large.toml")


def test_body_errors_of_another_file_name_that_file(tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text(BODIES.replace("[0, 0, 1]]", "[1, 1, 0]]", 1), encoding="utf-8")
    with pytest.raises(InputError, match=r"other\.toml(:[0-9]+)?: bodies\.movable.*lie in one plane"):
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


# ------------------------------------------------------------------------------------------------------- bodies by file

TETRAHEDRON = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]


def write_mesh(path: Path, vertices: list, faces: list) -> None:
    """Write an OFF file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = ["OFF", f"{len(vertices)} {len(faces)} 0"]
    lines += [" ".join(map(repr, vertex)) for vertex in vertices]
    lines += [" ".join(map(str, (len(face), *face))) for face in faces]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def in_a_file(text: str, *, role: str = "movable", extra: str = "") -> str:
    """Replace the vertices of one body by a mesh file."""
    vertices = {"movable": "[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]",
                "static": "[[3, 0, 0], [2, 0, 0], [3, 1, 0], [3, 0, 1]]"}[role]  # fmt: skip
    return text.replace(f"vertices = {vertices}", f'file = "meshes/{role}.off"\nunit = "mm"\n{extra}', 1)


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    write_mesh(tmp_path / "meshes" / "movable.off", TETRAHEDRON, FACES)
    write_mesh(tmp_path / "meshes" / "static.off", [[3.0 - x, y, z] for x, y, z in TETRAHEDRON],
               [face[::-1] for face in FACES])  # fmt: skip
    return tmp_path


def test_a_body_given_by_a_file_is_the_one_given_by_its_vertices(meshes: Path) -> None:
    (drawn,) = load(meshes, BODIES + CASE)
    (read,) = load(meshes, in_a_file(in_a_file(BODIES, role="static"), extra='seed = "vertices"\n') + CASE)
    assert read.movable.vertices.tolist() == drawn.movable.vertices.tolist()
    assert read.static.vertices.tolist() == drawn.static.vertices.tolist()
    assert (read.movable.name, read.static.name) == ("movable", "static")  # of the files' stems
    assert read.movable.seed.tolist() == [0.25, 0.25, 0.25]
    np.testing.assert_allclose(read.static.seed, drawn.static.seed, rtol=1e-15)
    text = json.dumps(read.to_dict(), allow_nan=False)
    again = Problem.from_dict(json.loads(text))  # self-contained: no file is needed any more
    assert json.dumps(again.to_dict(), allow_nan=False) == text
    assert again.movable.vertices.tobytes() == read.movable.vertices.tobytes()
    assert again.movable.notes == read.movable.notes


def test_units_of_files_are_converted_and_paths_start_at_the_problem_file(
    meshes: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(meshes.parent)
    (inches,) = load(meshes, in_a_file(BODIES, extra='file_unit = "in"\nname = "wedge"\n') + CASE)
    np.testing.assert_allclose(inches.movable.vertices, 25.4 * np.array(TETRAHEDRON), rtol=1e-15)
    assert inches.movable.name == "wedge"
    # bodies of another file: relative to that one
    (meshes / "sub").mkdir()
    (meshes / "other.toml").write_text(in_a_file(BODIES), encoding="utf-8")
    (borrowed,) = load(meshes / "sub", 'bodies = "../other.toml"\n' + CASE)
    assert borrowed.movable.vertices.tolist() == TETRAHEDRON
    full = in_a_file(BODIES).replace('"meshes/', f'"{meshes / "meshes"}/')
    assert load(meshes / "sub", full + CASE)[0].movable.vertices.tolist() == TETRAHEDRON


def test_a_decomposition_and_its_deviation_survive_plain_data(meshes: Path) -> None:
    outline = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]
    corners = [[x - 8.0, y, z] for z in (0.0, 1.0) for x, y in outline]
    faces = [[5, 4, 3, 2, 1, 0], [6, 7, 8, 9, 10, 11],
             *([k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6] for k in range(6))]  # fmt: skip
    write_mesh(meshes / "meshes" / "movable.off", corners, faces)
    (exact,) = load(meshes, in_a_file(BODIES, extra='decomposition = "exact"\nname = "ell"\n') + CASE)
    assert len(exact.movable.parts) == 2
    assert exact.movable.deviation == (0.0, 0.0)
    assert sum(part.volume_and_centroid[0] for part in exact.movable.parts) == pytest.approx(5.0, rel=1e-12)
    # the same mesh written out
    mesh = f"vertices = {corners}\nfaces = {[[k + 1 for k in face] for face in faces]}\n"
    body = "vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]"
    (inline,) = load(meshes, BODIES.replace(body, mesh + 'decomposition = "exact"\nname = "ell"') + CASE)
    for one, two in zip(exact.movable.parts, inline.movable.parts, strict=True):
        assert one.vertices.tolist() == two.vertices.tolist()
    rough = BODIES.replace(body, body + '\ndeviation = [0.125, 0.25]\nnotes = ["cut by hand", "two holes closed"]')
    (problem,) = load(meshes, rough + CASE)
    assert problem.movable.deviation == (0.125, 0.25)
    assert problem.movable.notes == ("cut by hand", "two holes closed")
    for first in (exact, problem):
        second = Problem.from_dict(json.loads(json.dumps(first.to_dict())))
        assert second.to_dict() == first.to_dict()
        assert (second.movable.deviation, second.movable.notes) == (first.movable.deviation, first.movable.notes)
        assert second.movable.faces == first.movable.faces
        for one, two in zip(first.movable.parts, second.movable.parts, strict=True):
            assert one.vertices.tobytes() == two.vertices.tobytes()
            for kind in "VEF":
                assert list(one.elements[kind]) == list(two.elements[kind])


FILED = in_a_file(BODIES) + CASE
BAD_FILED = [
    ('unit = "mm"\n', "", "bodies.movable.unit", "missing key; found 'only file'", '"um"'),
    ('unit = "mm"', 'unit = "inch"', "bodies.movable.unit", "found 'inch'", '"in"'),
    ('unit = "mm"', "unit = 1", "bodies.movable.unit", "found 1", '"in"'),
    ('unit = "mm"', 'unit = "mm"\nparts = [[1, 2, 3, 4]]', "bodies.movable.parts", "not by both", "decomposition"),
    ('unit = "mm"', 'unit = "mm"\nvertices = [[0, 0, 0]]', "bodies.movable.vertices", "not by both", "decomposition"),
    ('unit = "mm"', 'unit = "mm"\nfaces = [[1, 2, 3]]', "bodies.movable.faces", "found 'file and faces'", "file_unit"),
    ('unit = "mm"', 'unit = "mm"\ndeviation = [0, 0]', "bodies.movable.deviation", "not by both", "file_unit"),
    ('unit = "mm"', 'unit = "mm"\ndeviation = 0', "bodies.movable.deviation", "found 0", "length > 0"),
    ('unit = "mm"', 'unit = "mm"\ndeviation = 0.1', "bodies.movable.file", "deviation: only curved faces", "STEP"),
    (
        'file = "meshes/movable.off"\n',
        "deviation = 0.1\n",
        "bodies.movable.deviation",
        "with file; found 0.1",
        "peg.step",
    ),
    ('unit = "mm"', 'unit = "mm"\nfile_unit = "yd"', "bodies.movable.file_unit", "found 'yd'", "unit of the numbers"),
    ('unit = "mm"', 'unit = "mm"\ndecomposition = "cut"', "bodies.movable.decomposition", "found 'cut'", '"coacd"'),
    ('file = "meshes/movable.off"\n', 'file_unit = "mm"\n', "bodies.movable.file_unit", "with file; found 'mm'", "stl"),
    ('file = "meshes/movable.off"\nunit = "mm"\n', "", "bodies.movable.vertices", "missing key", "file = "),
    ('file = "meshes/movable.off"', "file = 3", "bodies.movable.file", "found 3", "STL"),
    ("meshes/movable.off", "none.off", "bodies.movable.file", "none.off: ", ""),
    ("meshes/movable.off", "case.toml", "bodies.movable.file", "case.toml: ", ".stl"),
]


def refused_after(meshes: Path, good: str, change: tuple[str, str], key: str, found: str, allowed: str) -> None:
    """A file that is read, and with one change refused: naming itself, the key, what was found and what is allowed."""
    load(meshes, good)
    text = good.replace(*change, 1)
    assert text != good
    with pytest.raises(InputError) as caught:
        load(meshes, text)
    assert caught.value.key == key
    message = str(caught.value)
    assert message.startswith(str(meshes / "case.toml"))
    assert found in message
    assert allowed in message.partition("allowed: ")[2] + caught.value.allowed  # not told where it is a long list


@pytest.mark.parametrize(("old", "new", "key", "found", "allowed"), BAD_FILED)
def test_a_bad_entry_of_a_mesh_names_problem_file_and_key(
    meshes: Path, old: str, new: str, key: str, found: str, allowed: str
) -> None:
    refused_after(meshes, FILED, (old, new), key, found, allowed)


def test_only_a_mesh_is_decomposed(meshes: Path) -> None:
    for extra in ("", "parts = [[1, 2, 3, 4]]\nfaces = [[1, 2, 3]]\n"):
        text = BODIES.replace("[bodies.static]", f'[bodies.static]\ndecomposition = "exact"\n{extra}')
        with pytest.raises(InputError, match="only a mesh is cut into parts") as caught:
            load(meshes, text + CASE)
        assert caught.value.key == "bodies.static.decomposition"


def test_a_broken_mesh_names_problem_file_key_and_mesh_file(meshes: Path) -> None:
    write_mesh(meshes / "meshes" / "movable.off", TETRAHEDRON, FACES[:3])  # one side is open
    with pytest.raises(InputError) as caught:
        load(meshes, FILED)
    message = str(caught.value)
    assert message.startswith(f"{meshes / 'case.toml'}:3: bodies.movable.file: ")
    assert str(meshes / "meshes" / "movable.off") in message


def test_bodies_in_different_units_are_refused(meshes: Path) -> None:
    both = in_a_file(in_a_file(BODIES, role="static").replace('"mm"', '"in"\nfile_unit = "mm"'))
    keep_out = '[[keep_out]]\nname = "rib"\nfile = "meshes/static.off"\nunit = "um"\n'
    place = r"bodies\.static\.unit: .*found 'bodies\.static in in, bodies\.movable in mm'"
    with pytest.raises(InputError, match=place):
        load(meshes, both + CASE)
    with pytest.raises(InputError, match=r"keep_out\[1\]\.unit: .*keep_out\[1\] in um, bodies\.movable in mm"):
        load(meshes, in_a_file(BODIES) + CASE + keep_out)
    (problem,) = load(meshes, both.replace('off"\nunit = "mm"', 'off"\nunit = "in"') + CASE)
    assert problem.movable.vertices.tolist() == TETRAHEDRON
    millimetres = [[3.0 - x, y, z] for x, y, z in TETRAHEDRON]
    np.testing.assert_allclose(problem.static.vertices, np.array(millimetres) / 25.4, rtol=1e-15)


def test_plain_data_that_names_a_file_needs_its_full_path(meshes: Path) -> None:
    data = load(meshes, BODIES + CASE)[0].to_dict()
    entry = {"file": "meshes/movable.off", "unit": "mm"}
    with pytest.raises(InputError, match="there is no problem file to start from") as caught:
        Problem.from_dict({**data, "bodies": {**data["bodies"], "movable": entry}})
    assert caught.value.key == "bodies.movable.file"
    entry["file"] = str(meshes / "meshes" / "movable.off")
    made = Problem.from_dict({**data, "bodies": {**data["bodies"], "movable": entry}})
    assert made.movable.vertices.tolist() == TETRAHEDRON


# ------------------------------------------------------------------------------------------------------------ keep-outs

RIB = """
[[keep_out]]
name = "rib"
vertices = [[1, 1, 1], [2, 1, 1], [1, 2, 1], [1, 1, 2]]
scale = [0.9, 1.1]
clearance = 0.125
[[keep_out]]
file = "meshes/static.off"
unit = "mm"
seed = [9, 9, 9]
scale = 2
"""


def test_keep_outs_count_in_every_case_unless_it_chooses(meshes: Path) -> None:
    cases = CASE + "".join(
        CASE.replace('"A"', f'"{name}"') + f"keep_out = {chosen}\n"
        for name, chosen in (("B", "[]"), ("C", '["rib"]'), ("D", '["static", "rib"]'))
    )
    every, none, rib, both = load(meshes, BODIES + RIB + cases)
    assert [[keep_out.name for keep_out in made.keep_out] for made in (every, none, rib, both)] == [
        ["rib", "static"], [], ["rib"], ["static", "rib"],
    ]  # fmt: skip
    assert every.keep_out[0] is rib.keep_out[0]
    first, second = every.keep_out
    assert (first.scale, first.clearance, second.scale, second.clearance) == ((0.9, 1.1), 0.125, 2.0, 0.0)
    assert second.body.seed.tolist() == [9.0, 9.0, 9.0]
    for made in (every, none, both):
        text = json.dumps(made.to_dict(), allow_nan=False)
        assert json.dumps(Problem.from_dict(json.loads(text)).to_dict(), allow_nan=False) == text
    unnamed = RIB.replace('name = "rib"\n', "")
    assert load(meshes, BODIES + unnamed + CASE)[0].keep_out[0].name == "keep-out 1"


BAD_KEEP_OUTS = [
    ("scale = [0.9, 1.1]", "scale = [1.1, 0.9]", "keep_out[1].KeepOut.scale", "found (1.1, 0.9)", "low <= high"),
    ("scale = [0.9, 1.1]", "scale = 0", "keep_out[1].KeepOut.scale", "found 0.0", "> 0"),
    ("scale = [0.9, 1.1]", 'scale = "1"', "keep_out[1].scale", "found '1'", "[low, high]"),
    ("scale = [0.9, 1.1]", "scales = 1", "keep_out[1].scales", "did you mean 'scale'?", "clearance"),
    ("clearance = 0.125", "clearance = -1", "keep_out[1].KeepOut.clearance", "found -1.0", ">= 0"),
    ("clearance = 0.125", "clearance = nan", "keep_out[1].clearance", "not finite", "least gap"),
    ('name = "rib"', 'name = "static"', "keep_out[2].name", "the name is that of keep_out[1]", "no other keep-out"),
    ("[1, 1, 2]]", "[1, 1, 1]]", "keep_out[1].body 'rib'", "plane", ""),
    ('goal = "touch"', 'goal = "touch"\nkeep_out = ["ribs"]', "case[1] 'A'.keep_out[1]", "'rib'?", "rib, static"),
    ('goal = "touch"', 'goal = "touch"\nkeep_out = "rib"', "case[1] 'A'.keep_out", "found 'rib'", "without it all do"),
    ('goal = "touch"', 'goal = "touch"\nkeep_out = ["rib", "rib"]', "case[1] 'A'.keep_out[2].name", "keep_out[1]", ""),
    ('unit = "mm"', "", "keep_out[2].unit", "missing key", '"mm"'),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "key", "found", "allowed"), BAD_KEEP_OUTS)
def test_a_bad_keep_out_names_file_and_key(
    meshes: Path, old: str, new: str, key: str, found: str, allowed: str
) -> None:
    refused_after(meshes, BODIES + RIB + CASE, (old, new), key, found, allowed)


def test_contacts_of_the_defaults_were_refused_by_cases_of_other_goals(tmp_path: Path) -> None:
    """They hold where they apply; of a case itself they are refused."""
    text, path = (PROBLEMS / "locating.toml").read_text(), tmp_path / "p.toml"
    case = '\n[[case]]\nname = "{0}"\nrequirement = "A"\ngoal = "{0}"\n'
    goals = ("touch", "clear", "at")
    path.write_text(text + "".join(map(case.format, goals)))
    contacts = {own.name: own.contacts for own in load_problems(path)}
    assert {name: bool(contacts[name]) for name in goals} == {"touch": False, "clear": False, "at": True}
    path.write_text(text + case.format("clear") + 'contacts = "all"\n')
    with pytest.raises(InputError, match=r"'clear'\.goal: does not go with contacts") as refused:
        load_problems(path)
    assert "changed(" not in str(refused.value)


def test_a_clearance_of_the_defaults_was_refused_by_cases_of_other_goals(tmp_path: Path) -> None:
    """It holds where it means something; of a case itself, or where no case has it, it is refused."""
    text, path = (PROBLEMS / "peg_square.toml").read_text().partition("\n[[case]]")[0], tmp_path / "p.toml"
    text = re.sub(r"(?m)^(goal|pair|clearance) = .*\n", "", text).replace("[defaults]", "[defaults]\nclearance = 0.1")
    text = text.replace('file = "', f'file = "{PROBLEMS}/')
    case = '\n[[case]]\nname = "{0}"\ntarget = [1.0, 1.0]\ngoal = "{0}"\n'
    path.write_text(text + "".join(map(case.format, ("touch", "clear"))))
    assert {own.name: own.clearance for own in load_problems(path)} == {"touch": 0.0, "clear": 0.1}
    path.write_text(text + case.format("touch"))
    with pytest.raises(InputError, match="no case asks for this clearance") as refused:
        load_problems(path)
    assert refused.value.key == "defaults.clearance"
    path.write_text(text + case.format("clear") + case.format("touch") + "clearance = 0.2\n")
    with pytest.raises(InputError, match=r"'touch'\.clearance: nothing asks for this clearance"):
        load_problems(path)


def test_a_tolerance_of_the_defaults_was_refused_by_cases_with_a_target(tmp_path: Path) -> None:
    """It goes with the requirements of other cases; of a case with a target itself it is refused."""
    text, path = (PROBLEMS / "peg_square.toml").read_text().partition("\n[[case]]")[0], tmp_path / "p.toml"
    text = re.sub(r"(?m)^(goal|tolerance) = .*\n", "", text).replace("[defaults]", "[defaults]\ntolerance = 0.02")
    text = text.replace('file = "', f'file = "{PROBLEMS}/')
    case = '\n[[case]]\nname = "{0}"\n{1}\ngoal = "touch"\n'
    asked, own = case.format("own", "target = [1.01, 1.0]"), case.format("A", 'requirement = "A"')
    path.write_text(text + asked + own)
    assert {own.name: own.requirement for own in load_problems(path)} == {"own": None, "A": "A"}
    path.write_text(text + asked + "tolerance = 0.02\n" + own)
    with pytest.raises(InputError, match="a target takes no tolerance"):
        load_problems(path)


def test_a_target_of_the_defaults_was_refused_by_cases_with_a_requirement(tmp_path: Path) -> None:
    """As one requirement of the defaults was by cases with a target: what the case says is asked."""
    text, path = (PROBLEMS / "peg_square.toml").read_text().partition("\n[[case]]")[0], tmp_path / "p.toml"
    text = text.replace('file = "', f'file = "{PROBLEMS}/')
    for default in ("target = [1.01, 1.0]", 'requirement = "B"'):
        given = re.sub(r"(?m)^(goal|tolerance) = .*\n", "", text).replace("[defaults]", f"[defaults]\n{default}")
        path.write_text(
            given + '\n[[case]]\nname = "A"\nrequirement = "A"\ntolerance = 0.02\ngoal = "touch"\n'
            '[[case]]\nname = "own"\ntarget = [1.0, 0.99]\ngoal = "touch"\n'
        )
        sizes = {own.name: (own.requirement, own.target.tolist()) for own in load_problems(path)}
        assert sizes == {"A": ("A", [1.02, 1.02]), "own": (None, [1.0, 0.99])}


def test_what_the_digits_of_a_file_leave_open_was_lost_in_plain_data(tmp_path: Path) -> None:
    """Of an STL in single precision; `whatif` on the command line answered with facets, NOT VERIFIED."""
    import trimesh

    for name, radius in (("pin", 2.98), ("plate", 7.03)):
        trimesh.creation.cylinder(radius, height=3.1, sections=40).export(tmp_path / f"{name}.stl")
    bodies = [Body.from_file(tmp_path / f"{name}.stl", unit="mm") for name in ("pin", "plate")]
    assert all(body.rounding > 0.0 for body in bodies)
    problem = Problem(*bodies, motion=Translation("x"), target=(1, 1), goal="clear")
    again = Problem.from_dict(json.loads(json.dumps(problem.to_dict())))
    assert [body.rounding for body in (again.movable, again.static)] == [body.rounding for body in bodies]
