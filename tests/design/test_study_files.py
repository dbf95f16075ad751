"""Study files: which points they stand for, what makes points equal, and every way to get one wrong."""

from __future__ import annotations

import json
import math
import tracemalloc
from collections.abc import Callable
from itertools import islice, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.design.places import overlap, parse, put, written
from fcdm_opt.design.question import Question
from fcdm_opt.design.study.study import Study
from fcdm_opt.design.study.variables import LONGEST, Formula, grid, shares
from fcdm_opt.errors import InputError

PROBLEMS = Path(__file__).parents[2] / "problems"
BASE = """
[bodies.movable]
seed = [0.0, 0.0, 0.0]
vertices = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 2], [1, -1, 2], [1, 1, 2], [-1, 1, 2]]
[bodies.static]
vertices = [[-3, -3, -1], [3, -3, -1], [3, 3, -1], [-3, 3, -1], [-3, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0]]
[[keep_out]]
name = "rib"
scale = 1.0
vertices = [[4, 0, 0], [5, 0, 0], [4, 1, 0], [4, 0, 1]]
[defaults]
goal = "touch"
motion = [{ translation = "z" }, { rotation = "z", centre = "origin" }]
limits = { TZ = [-1.0, 1.0], RZ_deg = [-10.0, 10.0] }
[[case]]
name = "A"
target = [1.0, 1.0]
[[case]]
name = "B"
tolerance = 0.02
requirement = "B"
published = [{ translation = 0.0 }, { angle_deg = 0.0 }]
"""


ENDLESS: list[Any] = []
ENDLESS.append(ENDLESS)


@pytest.fixture
def study(tmp_path: Path) -> Callable[[str], Study]:
    """Return a function that reads a study of case A of a box on a plate; its text follows the line of the problem."""
    (tmp_path / "base.toml").write_text(BASE, encoding="utf-8")

    def read(text: str, *, cases: str = 'cases = ["A"]') -> Study:
        (tmp_path / "study.toml").write_text(f'problem = "base.toml"\n{cases}\n{text}', encoding="utf-8")
        return Study.read(tmp_path / "study.toml")

    return read


def questions(tmp_path: Path) -> tuple[Question, ...]:
    (tmp_path / "base.toml").write_text(BASE, encoding="utf-8")
    return Question.read(tmp_path / "base.toml")


# ------------------------------------------------------------------------------------------------------------- places

TABLES = {"limits": {"RZ_deg": [-10, 10]}, "target": [1.0, 2.0], "motion": [{"screw": "seeds", "pitch": "free"}]}


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("tolerance", ("tolerance",)),
        ("target[2]", ("target", 1)),
        ("limits.RZ_deg", ("limits", "RZ_deg")),
        ("bodies.movable.vertices[5][3]", ("bodies", "movable", "vertices", 4, 2)),
        ("motion[1].pitch_per_deg", ("motion", 0, "pitch_per_deg")),
        ("made.peg width", ("made", "peg width")),
        ('size."a.b = [1]".tolerance[2]', ("size", "a.b = [1]", "tolerance", 1)),
        ("made.'1 \" pipe'", ("made", '1 " pipe')),
    ],
)
def test_places_read_and_write(text: str, place: tuple) -> None:
    assert parse(text) == place
    assert written(place) == text


@pytest.mark.parametrize(
    "text", ["", ".", "a.", ".a", "a..b", "a[0]", "a[-1]", "a[1", "a[x]", "[1]", "a  b", "a ", 'a"b', "a[1]b", 3]
)
def test_what_is_no_place_is_refused(text: Any) -> None:
    with pytest.raises(InputError, match="not a place"):
        parse(text)


def test_a_value_is_put_on_a_copy_that_shares_the_rest() -> None:
    made = put(TABLES, parse("limits.RZ_deg[2]"), 5)
    assert made["limits"]["RZ_deg"] == [-10, 5]
    assert TABLES["limits"] == {"RZ_deg": [-10, 10]}
    assert made["motion"] is TABLES["motion"]
    assert put(TABLES, parse("weights.TZ"), 2.0)["weights"] == {"TZ": 2.0}
    assert "target" not in put(TABLES, parse("target"), None)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("target[3]", r"target\[3\]: no such item; allowed: 1 to 2"),
        ("limits[1]", "limits: there is no list here"),
        ("target.x", "target: there is no table here"),
        ("motion[1].axis.x[1]", r"motion\[1\].axis.x: an item of it is asked for, and"),
        ("targt[1]", "targt: an item of it is asked for, and the problem does not give it, did you mean 'target'"),
    ],
)
def test_a_way_that_ends_is_named(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        put(TABLES, parse(text), 1.0)


def test_places_overlap_where_one_lies_inside_the_other() -> None:
    places = [parse(text) for text in ("target", "target[1]", "target[2]", "limits.TZ", "limits.RZ", "targets")]
    found = {(i, j) for i, j in product(range(6), repeat=2) if i < j and overlap(places[i], places[j])}
    assert found == {(0, 1), (0, 2)}


# ---------------------------------------------------------------------------------------------------------- questions


@pytest.mark.parametrize("name", ["example1_touch", "peg_square", "keyway", "lid"])
def test_the_questions_of_a_file_are_its_problems(name: str) -> None:
    path = PROBLEMS / f"{name}.toml"
    asked, problems = Question.read(path), fo.load_problems(path)
    assert [question.name for question in asked] == [problem.name for problem in problems]
    for question, problem in zip(asked, problems, strict=True):
        drawn = question.drawn()
        assert '"file"' not in drawn.scene.text
        sent = Question.restored(drawn.scene.text, json.loads(json.dumps(drawn.case)))
        assert sent.scene.key == drawn.scene.key
        expected = problem.to_dict()
        assert sent.problem().to_dict() == expected
        assert Question.of(problem).problem().to_dict() == expected


def test_equal_scenes_are_built_once_and_keep_their_curve(tmp_path: Path) -> None:
    one, two = (question.problem() for question in questions(tmp_path))
    assert one.movable is two.movable
    assert one.keep_out[0].body is two.keep_out[0].body
    curve = one.curve
    del one, two
    moved = questions(tmp_path)[0].changed({"tolerance": 0.03, "requirement": "A"})
    assert moved.problem().curve is curve


def test_another_goal_drops_the_clearance_that_it_does_not_ask_for(tmp_path: Path) -> None:
    (asked, *_) = questions(tmp_path)
    clear = asked.changed({"goal": "clear", "clearance": 0.1})
    assert clear.changed({"made": None}).problem().clearance == 0.1
    assert "clearance" not in clear.changed({"goal": "touch"}).case
    assert clear.changed({"goal": "touch", "pair": "any"}).problem().goal == "touch"
    with pytest.raises(InputError, match="nothing asks for this clearance"):
        clear.changed({"goal": "touch", "clearance": 0.1}).problem()


def test_a_change_drops_what_says_the_same_in_another_way(tmp_path: Path) -> None:
    one, two = questions(tmp_path)
    changed = one.changed({"tolerance": 0.01, "requirement": "D"})
    assert changed.case["requirement"] == "D"
    assert "target" not in changed.case
    back = two.changed({"target": [1.0, 1.1]})
    assert not {"requirement", "tolerance"} & back.case.keys()
    np.testing.assert_allclose(back.problem().target, [1.0, 1.1])
    turned = one.changed({"limits.RZ_rad": [-0.1, 0.1]})
    assert turned.case["limits"] == {"TZ": [-1.0, 1.0], "RZ_rad": [-0.1, 0.1]}
    screw = {"motion": [{"screw": "seeds", "pitch": "free"}], "limits": None}
    pitched = one.changed(screw).changed({"motion[1].pitch_per_deg": 1.0})
    assert pitched.case["motion"] == [{"screw": "seeds", "pitch_per_deg": 1.0}]
    screws = {
        "motion": [{"screw": "seeds", "pitch_per_rad": 1.0}, {"screw": "seeds", "pitch_per_deg": 1.0}],
        "limits": None,
    }
    places = {"motion[1].pitch_per_deg": 0.5, "motion[2].pitch_per_rad": 2.0}
    pitched = one.changed(screws).changed(places)
    assert pitched.case["motion"] == [
        {"screw": "seeds", "pitch_per_deg": 0.5},
        {"screw": "seeds", "pitch_per_rad": 2.0},
    ]
    varied = Study(one.changed(screws), {tuple(places): [(0.5, 2.0), (1.0, 3.0)]})
    assert [point.error for point in varied.points()] == ["", ""]
    both = one.changed({"target": [1.0, 1.0], "tolerance": 0.1, "requirement": "A"})
    with pytest.raises(InputError, match="one of requirement, target and made"):
        both.problem()


def test_the_scene_changes_with_its_own_places_only(tmp_path: Path) -> None:
    base = questions(tmp_path)[0]
    assert base.changed({"goal": "clear", "keep_out": ["rib"]}).scene is base.scene
    raised = base.changed({"bodies.movable.vertices[5][3]": 2.5, "keep_out[1].clearance": 0.1})
    assert raised.scene.key != base.scene.key
    problem = raised.problem()
    assert problem.movable.vertices[4].tolist() == [-1.0, -1.0, 2.5]
    assert problem.keep_out[0].clearance == 0.1
    assert problem.static is base.problem().static
    with pytest.raises(InputError, match="no such body, did you mean 'static'"):
        base.changed({"bodies.statc.seed": "box"})
    with pytest.raises(InputError, match=r"keep_out\[2\]: no such item; allowed: 1 to 1"):
        base.changed({"keep_out[2].clearance": 0.1})


def test_a_body_of_a_mesh_file_is_read_where_a_place_in_it_changes() -> None:
    base = Question.read(PROBLEMS / "peg_square.toml")[0]
    row = base.problem().movable.vertices[2]
    moved = base.changed({"bodies.movable.vertices[3][3]": float(row[2]) + 0.0})
    assert "file" not in moved.scene.tables["bodies.movable"].data
    assert moved.problem().movable.vertices.tolist() == base.problem().movable.vertices.tolist()
    seeded = base.changed({"bodies.movable.seed": [0.25, -0.125, 4.0]})
    assert "file" in seeded.scene.tables["bodies.movable"].data
    assert seeded.problem().movable.seed.tolist() == [0.25, -0.125, 4.0]
    cube = [list(map(float, corner)) for corner in product((-9, 9), (-9, 9), (0, 10))]
    built = base.changed({"bodies.movable.vertices": cube}).scene.built.movable
    assert (built.name, built.seed.tolist(), built.vertices.tolist()) == ("peg", [0.25, -0.125, 5.0], cube)


# ----------------------------------------------------------------------------------------------------------- sampling


def test_grids_are_evenly_spaced_with_both_ends_as_given() -> None:
    assert grid(0.1, 0.5, 5) == pytest.approx((0.1, 0.2, 0.3, 0.4, 0.5), rel=1e-15)
    assert grid(0.1, 0.7, 4)[::3] == (0.1, 0.7)
    made = grid(0.001, 0.1, 7, "log")
    assert made[::6] == (0.001, 0.1)
    np.testing.assert_allclose(np.diff(np.log(made)), math.log(100.0) / 6, rtol=1e-12)
    assert grid(0.3, 0.3, 1) == (0.3,)
    assert len(grid(1.0, 2.0, 2)) == 2


def test_a_latin_hypercube_has_one_point_in_each_stratum() -> None:
    cube = shares("latin hypercube", 500, 3, seed=7)
    assert (np.sort(np.floor(cube * 500), axis=1) == np.arange(500)).all()
    assert np.abs(np.corrcoef(cube)[np.triu_indices(3, 1)]).max() < 0.2
    assert (cube == shares("latin hypercube", 500, 3, seed=7)).all()
    assert not (cube == shares("latin hypercube", 500, 3, seed=8)).any()


def test_random_draws_are_not_stratified() -> None:
    cube = shares("random", 500, 2, seed=7)
    missed = 1.0 - len(np.unique(np.floor(cube[0] * 500))) / 500
    assert missed == pytest.approx(math.exp(-1.0), abs=0.06)  # the share of 500 boxes that 500 balls leave empty
    assert (cube == shares("random", 500, 2, seed=7)).all()


# ------------------------------------------------------------------------------------------------------------- points


def test_points_are_the_product_of_the_listed_values_in_order(study: Callable[..., Study]) -> None:
    made = study(
        """
        [[vary]]
        key = "target[1]"
        label = "rho 1"
        values = [0.9, 1.0, 1.1]
        [[vary]]
        key = ["goal", "clearance"]
        values = [["touch", 0.0], ["clear", 0.5]]
        """
    )
    assert len(made) == 6
    assert made.labels == ("rho 1", "goal, clearance")
    assert made.axes == {"rho 1": (0.9, 1.0, 1.1), "goal, clearance": (("touch", 0.0), ("clear", 0.5))}
    expected = list(product([0.9, 1.0, 1.1], [["touch", 0.0], ["clear", 0.5]]))
    points = list(made.points())
    assert [point.number for point in points] == list(range(6))
    assert [tuple(point.values.values()) for point in points] == expected
    assert len({point.key for point in points}) == 6
    for point, (rho, (goal, clearance)) in zip(points, expected, strict=True):
        problem = point.question.problem()
        assert (problem.target.tolist(), problem.goal, problem.clearance) == ([rho, 1.0], goal, clearance)
    assert made.point(4).key == points[4].key


def test_names_stand_for_the_values_in_the_results(study: Callable[..., Study], tmp_path: Path) -> None:
    made = study(
        """
        [[vary]]
        key = ["motion", "limits"]
        label = "family"
        names = ["TZ", "any"]
        values = [[[{ translation = "z" }], {}], [[{ free = true }], {}]]
        """
    )
    assert made.axes == {"family": ("TZ", "any")}
    assert [point.values for point in made.points()] == [{"family": "TZ"}, {"family": "any"}]
    assert [len(point.question.problem().motion.parameters) for point in made.points()] == [1, 6]
    asked = Study(
        tmp_path / "base.toml", {("motion", "limits"): {"TZ": (fo.Translation("z"), {}), "any": (fo.Free(), {})}}
    )
    assert [point.values["motion, limits"] for point in asked.points()] == ["TZ", "any"] * 2
    turned = [point.question.problem().motion for point in asked.points()]
    assert turned[:2] == [point.question.problem().motion for point in made.points()]


def test_which_keep_outs_count_varies_beside_their_bodies(tmp_path: Path) -> None:
    base = questions(tmp_path)[0]
    made = Study(base, {"keep_out[1].clearance": [0.1, 0.2], "keep_out": [[], ["rib"], None]})
    found = [[own.clearance for own in point.question.problem().keep_out] for point in made.points()]
    assert found == [[], [0.1], [0.1], [], [0.2], [0.2]]


def test_cases_come_first_and_draws_last(study: Callable[..., Study]) -> None:
    text = """
        count = 4
        [[vary]]
        key = "limits.TZ[2]"
        uniform = { low = 2.0, high = 3.0 }
        [[vary]]
        key = "snap"
        grid = { from = 1e-6, to = 1e-4, count = 3, spacing = "log" }
        [[vary]]
        key = "length"
        normal = { mean = 1.0, deviation = 0.1, low = 0.9, high = 1.2 }
        """
    made = study(text, cases="")
    assert made.labels == ("case", "limits.TZ[2]", "snap", "length")
    assert {label: len(axis) for label, axis in made.axes.items()} == {"case": 2, "snap": 3, "draw": 4}
    points = list(made.points())
    assert len(points) == len(made) == 24
    assert [point.values["case"] for point in points] == ["A"] * 12 + ["B"] * 12
    drawn = [(point.values["limits.TZ[2]"], point.values["length"]) for point in points]
    assert drawn == drawn[:4] * 6  # every combination has the same draws
    shift, length = np.array(drawn[:4]).T
    assert sorted(np.floor((shift - 2.0) * 4)) == [0, 1, 2, 3]
    assert ((length >= 0.9) & (length <= 1.2)).all()
    assert all("published" not in point.question.case for point in points)
    one = study(text, cases='cases = ["B"]')
    assert one.labels == made.labels[1:]
    assert [point.key for point in one.points()] == [point.key for point in points[12:]]


def test_rows_of_a_csv_file_are_taken_as_they_are(study: Callable[..., Study], tmp_path: Path) -> None:
    (tmp_path / "sizes.csv").write_text("part,peg,hole\n1,10.1,20.0\n2,9.9,20.2\n3,10.0,19.8\n")
    rows = study(
        """
        [[vary]]
        key = ["target[1]", "target[2]"]
        csv = { file = "sizes.csv", columns = ["peg", "hole"], nominals = [10.0, 20.0] }
        """
    )
    found = [point.question.case["target"] for point in rows.points()]
    np.testing.assert_allclose(found, [[1.01, 1.0], [0.99, 1.01], [1.0, 0.99]], rtol=1e-15)
    drawn = study(
        """
        count = 300
        [[vary]]
        key = "target[1]"
        csv = { file = "sizes.csv", column = "peg", nominal = 10.0 }
        """
    )
    values = np.array([point.values["target[1]"] for point in drawn.points()])
    for size in (0.99, 1.0, 1.01):
        assert np.isclose(values, size, rtol=1e-15).sum() == 100  # a latin hypercube draws each as often


def test_a_study_of_very_many_points_is_not_held_in_memory(study: Callable[..., Study]) -> None:
    made = study(
        """
        [[vary]]
        key = "target[1]"
        grid = { from = 0.9, to = 1.1, count = 100000 }
        [[vary]]
        key = "target[2]"
        grid = { from = 0.9, to = 1.1, count = 100000 }
        """
    )
    assert len(made) == 10**10
    tracemalloc.start()
    last = 0
    for point in islice(made.points(), 3000):
        last = point.number
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert last == 2999
    assert peak < 1e6
    assert made.point(10**10 - 1).question.case["target"] == [1.1, 1.1]


# ------------------------------------------------------------------------------------------------------------- derive


def test_a_tapered_peg_follows_from_its_draft_angle(study: Callable[..., Study]) -> None:
    made = study(
        """
        [parameters]
        draft_deg = 1.0
        height = 2.0
        top = "1 - height * tan(radians(draft_deg))"
        [[vary]]
        key = "parameters.draft_deg"
        values = [0.0, 2.0, 5]
        [derive]
        "bodies.movable" = { name = { text = "peg" }, seed = [0, 0, "height / 2"], vertices = [
            [-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0],
            ["-top", "-top", "height"], ["top", "-top", "height"],
            ["top", "top", "height"], ["-top", "top", "height"]] }
        "target" = ["1 + draft_deg / 100", 1.0]
        """
    )
    keys = set()
    for point in made.points():
        draft = point.values["parameters.draft_deg"]
        problem = point.question.problem()
        top = 1.0 - 2.0 * math.tan(math.radians(draft))
        expected = [[x * r, y * r, z] for z, r in ((0, 1.0), (2, top)) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        assert problem.movable.name == "peg"
        np.testing.assert_allclose(problem.movable.vertices, expected, rtol=1e-15)
        volume, _ = problem.movable.parts[0].volume_and_centroid
        assert volume == pytest.approx(4 * 2 * (1 + top + top * top) / 3, rel=1e-12)
        np.testing.assert_allclose(problem.target, [1 + draft / 100, 1.0], rtol=1e-15)
        keys.add(point.question.scene.key)
    assert len(keys) == 3


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * 3 - 4 / 8", 6.5),
        ("2 ** 3 ** 2", 512.0),
        ("-x ** 2", -9.0),
        ("+x - -1", 4.0),
        (" sin(pi / 6) ", 0.5),
        ("cos(pi) + tan(0) + asin(1) + acos(1) + atan(1)", -1 + 0.75 * math.pi),
        ("sqrt(x + 1) * hypot(3, 4) + hypot(x)", 13.0),
        ("degrees(radians(30)) + min(1, x, 2) + max(1, x) + abs(-x)", 37.0),
        ("1e3 + .5", 1000.5),
    ],
)
def test_expressions_have_the_values_of_arithmetic(text: str, value: float) -> None:
    assert Formula.of(text)({"x": 3.0}) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "x.__class__",
        "(1).__class__.__mro__",
        "__import__('os')",
        "().__class__",
        "'a' * 1000000000",
        "[0] * 100000000",
        "x if x else 1",
        "lambda: 1",
        "x[0]",
        "x < 1",
        "x and 1",
        "not x",
        "x ^ 2",
        "x // 2",
        "x % 2",
        "x @ x",
        "1 << 1000000",
        "True",
        "None",
        "1j",
        "x = 1",
        "(x := 1)",
        "f'{x}'",
        "sin",
        "sin()",
        "sin(1, 2)",
        "sin(x=1)",
        "min(1)",
        "max(*x)",
        "exec(1)",
        "getattr(x, 1)",
        "x(1)",
        "x x",
        "1e400",
        "1e31",
        "9" * 400,
        "x\n+1\n1",
        "(" * 300 + "x" + ")" * 300,
        "-" * 900 + "x",
        "x+" * LONGEST + "x",
        "await x",
        "\0",
    ],
)
def test_anything_but_arithmetic_is_refused(text: str) -> None:
    try:
        expression = Formula.of(text)
    except InputError:
        return
    assert text.startswith("-")  # deep, but arithmetic all the same
    assert expression({"x": 3.0}) == 3.0


@pytest.mark.parametrize(
    "text", ["1 / (x - 3)", "9 ** 9 ** 9 ** 9", "(-8) ** 0.5", "sqrt(-x)", "asin(x)", "1e30 ** 20", "0 ** -1"]
)
def test_an_expression_without_a_value_says_so(text: str) -> None:
    with pytest.raises(InputError, match=r"no (finite )?value"):
        Formula.of(text)({"x": 3.0})


def test_only_the_points_that_make_no_question_are_bad_input(study: Callable[..., Study]) -> None:
    made = study(
        """
        parameters = { x = 1.0 }
        derive = { target = ["1 / x", 1.0] }
        [[vary]]
        key = "parameters.x"
        values = [1, 0, 2]
        """
    )
    good, bad, other = made.points()
    assert (good.error, other.error) == ("", "")
    assert other.question.case["target"] == [0.5, 1.0]
    assert bad.question is None
    assert "derive.'target'[1]: the expression has no value: float division by zero, with x = 0" in bad.error
    assert len({good.key, bad.key, other.key}) == 3


@pytest.mark.parametrize("path", sorted((PROBLEMS / "studies").glob("*.toml")), ids=lambda path: path.stem)
def test_the_studies_of_the_project_make_questions(path: Path) -> None:
    made = Study.read(path)
    for number in (0, len(made) - 1):
        point = made.point(number)
        assert point.error == ""
        assert list(point.values) == list(made.labels)
        assert Question.restored(point.question.scene.text, point.question.case).problem().motion.parameters


# --------------------------------------------------------------------------------------------------------------- keys

ARGUMENTS: dict[str, Any] = {
    "vary": {
        "snap": [1e-6, 1e-5],
        "target[1]": fo.Uniform(0.9, 1.1),
        ("goal", "clearance"): [("touch", 0.0), ("clear", 0.5)],
        "parameters.top": [2.5, 3.0],
    },
    "parameters": {"top": 2.0},
    "derive": {"bodies.movable.vertices[5][3]": "top"},
    "count": 3,
    "seed": 5,
    "cases": ["A"],
    "certify": False,
}
AS_A_FILE = """
count = 3
seed = 5
parameters = { top = 2.0 }
derive = { "bodies.movable.vertices[5][3]" = "top" }
[[vary]]
key = "snap"
values = [1e-6, 1e-5]
[[vary]]
key = "target[1]"
uniform = { high = 1.1, low = 0.9 }
[[vary]]
key = ["goal", "clearance"]
values = [["touch", 0.0], ["clear", 0.5]]
[[vary]]
key = "parameters.top"
grid = { from = 2.5, to = 3.0, count = 2 }
"""


def keys(made: Study) -> list[str]:
    return [point.key for point in made.points()]


def test_a_file_and_its_python_form_are_the_same_study(study: Callable[..., Study], tmp_path: Path) -> None:
    read = study(AS_A_FILE)
    made = Study(tmp_path / "base.toml", **ARGUMENTS)
    arrays = {key: np.array(own) if isinstance(own, list) and key != ("goal", "clearance") else own
              for key, own in ARGUMENTS["vary"].items()}  # fmt: skip
    asked = Study(Question.read(tmp_path / "base.toml"), **{**ARGUMENTS, "vary": arrays})
    assert made.key == read.key == asked.key
    assert keys(made) == keys(read) == keys(asked)
    assert len(set(keys(made))) == 24
    assert [point.values for point in made.points()] == [point.values for point in read.points()]
    assert made.labels == read.labels
    assert json.loads(json.dumps(made.to_dict()))["axes"] == json.loads(json.dumps(read.to_dict()))["axes"]


def test_studies_of_problems_are_the_studies_of_their_plain_data(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text(BASE, encoding="utf-8")
    problems = fo.load_problems(tmp_path / "base.toml")
    made = Study(problems, {"tolerance": [0.01, 0.02], "requirement": ["B"]})
    assert made.axes["case"] == ("A", "B")
    points = list(made.points())
    assert points[0].key != points[1].key
    # with the target dropped, what is left of A is B but for the name
    assert keys(made)[:2] == keys(made)[2:]
    for point in points:
        assert point.question.problem().request["tolerance"] == point.values["tolerance"]
    moved = Study(
        problems[0], {"motion": [fo.Translation("z"), fo.Translation("z") >> fo.Rotation("z")], "limits": [None]}
    )
    assert [len(point.question.problem().motion.parameters) for point in moved.points()] == [1, 2]


@pytest.mark.parametrize(
    ("other", "same_points"),
    [
        ({"seed": 6}, False),
        ({"sampling": "random"}, False),
        ({"certify": True}, False),
        ({"parameters": {"top": 4.0}}, True),  # it varies: each point has a value of its own
        ({"derive": {"bodies.movable.vertices[5][3]": "top * 10"}}, False),
        ({"derive": {"bodies.movable.vertices[6][3]": "top"}}, False),
        ({"vary": {**ARGUMENTS["vary"], "snap": [1e-7, 1e-5]}}, None),
        ({"vary": {**ARGUMENTS["vary"], "target[1]": fo.Uniform(0.9, 1.2)}}, False),
        ({"time_limit": 5.0}, True),
    ],
)
def test_whatever_matters_is_in_the_keys(tmp_path: Path, other: dict, same_points: bool | None) -> None:
    (tmp_path / "base.toml").write_text(BASE, encoding="utf-8")
    one, two = (Study(tmp_path / "base.toml", **{**ARGUMENTS, **own}) for own in ({}, other))
    assert one.key != two.key
    if same_points is None:
        assert len(set(keys(one)) & set(keys(two))) == 12
    else:
        assert (set(keys(one)) == set(keys(two))) is same_points
        assert same_points or not set(keys(one)) & set(keys(two))


def test_words_for_the_reader_are_in_no_key(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text(BASE, encoding="utf-8")
    one = Study(tmp_path / "base.toml", **ARGUMENTS)
    two = Study(tmp_path / "base.toml", **ARGUMENTS, title="a title", note="a note", budget=0.2)
    assert one.key == two.key
    assert keys(one) == keys(two)


def test_the_order_of_keys_in_a_table_does_not_matter(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text(BASE, encoding="utf-8")
    turned = BASE.replace("TZ = [-1.0, 1.0], RZ_deg = [-10.0, 10.0]", "RZ_deg = [-10.0, 10.0], TZ = [-1.0, 1.0]")
    turned = turned.replace('{ rotation = "z", centre = "origin" }', '{ centre = "origin", rotation = "z" }')
    assert turned != BASE
    (tmp_path / "turned.toml").write_text(turned, encoding="utf-8")
    one, two = (Study(tmp_path / f"{name}.toml", **ARGUMENTS) for name in ("base", "turned"))
    assert one.key == two.key
    assert keys(one) == keys(two)


def test_the_version_of_the_package_is_in_the_keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "base.toml").write_text(BASE, encoding="utf-8")
    one = Study(tmp_path / "base.toml", **ARGUMENTS)
    before = one.key, keys(one)
    monkeypatch.setattr("fcdm_opt.design.study.study.__version__", "0.0.0")
    two = Study(tmp_path / "base.toml", **ARGUMENTS)
    assert two.key != before[0]
    assert not set(keys(two)) & set(before[1])


def test_another_mesh_under_the_same_name_is_another_study(tmp_path: Path) -> None:
    found = []
    for name in ("square_peg.stl", "square_plate.stl"):
        (tmp_path / "body.stl").write_bytes((PROBLEMS / "meshes" / name).read_bytes())
        vary = {"bodies.movable.file": ["body.stl"]}
        made = Study(PROBLEMS / "peg_square.toml", vary, cases=["turned until it jams"], folder=tmp_path)
        size = made.point(0).question.scene.built.movable.size
        assert size == fo.Body.from_file(tmp_path / "body.stl", unit="mm").size
        found.append((made.key, made.point(0).key, made.point(0).question.scene.key, size))
    assert all(one != two for one, two in zip(*found, strict=True))


# ------------------------------------------------------------------------------------------------------------ refusals

WRONG = [
    ('colour = "red"', "unknown key 'colour'"),
    ("[[vary]]\nkey = 3\nvalues = [1]", r"vary\[1\].key"),
    ("[[vary]]\nkey = []\nvalues = [1]", r"vary\[1\].key"),
    ('[[vary]]\nkey = "a..b"\nvalues = [1]', r"vary\[1\].key: not a place"),
    ('[[vary]]\nkey = "tolerence"\nvalues = [0.1]', r"vary\[1\].*unknown key 'tolerence', did you mean 'tolerance'"),
    ('[[vary]]\nkey = "limts.TZ"\nvalues = [[-1, 1]]', "unknown key 'limts', did you mean 'limits'"),
    ('[[vary]]\nkey = "limits.TY"\nvalues = [[-1, 1]]', r"vary\[1\].*no such parameter; found 'TY'; allowed: TZ"),
    ('[[vary]]\nkey = "motion[3].pitch"\nvalues = ["free"]', r"vary\[1\].*motion\[3\]: no such item; allowed: 1 to 2"),
    ('[[vary]]\nkey = "tolerance[1]"\nvalues = [0.1]', r"vary\[1\].*tolerance: an item of it is asked for, and the"),
    ('[[vary]]\nkey = "bodies.movable.vertices[9][1]"\nvalues = [0.1]',
     r"vertices\[9\]: no such item; allowed: 1 to 8"),
    ('[[vary]]\nkey = "bodies.movable.vertces"\nvalues = [[]]', "unknown key 'vertces', did you mean 'vertices'"),
    ('[[vary]]\nkey = "bodies.lid.seed"\nvalues = ["box"]', "no such body"),
    ('[[vary]]\nkey = "name"\nvalues = ["box"]', "does not vary"),
    ('[[vary]]\nkey = "goal"\nvalues = []', r"vary\[1\].values"),
    ('[[vary]]\nkey = "goal"\nvalues = ["touch", 3]', r"vary\[1\].values\[2\]: no problem takes this: goal"),
    ('[[vary]]\nkey = "target[1]"\nvalues = [1.0, "1.0"]',
     r"vary\[1\].values\[2\]: no problem takes this: target\[1\]"),
    ('[[vary]]\nkey = "target[1]"\nvalues = [1.0, inf]', r"vary\[1\].values\[2\]"),
    ('[[vary]]\nkey = "target[1]"\nvalues = [1.0, nan]', r"vary\[1\].values\[2\]: no plain data"),
    ('[[vary]]\nkey = "target[1]"\nvalues = [1979-05-27]', r"vary\[1\].values\[1\]: no plain data"),
    ('[[vary]]\nkey = "motion"\nvalues = [[{ translation = "z" }]]', r"vary: the first point.*limits.RZ_deg: no such"),
    ('[[vary]]\nkey = "motion[1]"\nvalues = [{ translation = "z" }, { turn = 3 }]', r"vary\[1\].values\[2\].*motion"),
    ('[[vary]]\nkey = "motion"\nvalues = [[{ screw = "seeds" }]]', r"vary\[1\].*motion\[1\].*pitch is not given once"),
    ('[[vary]]\nkey = "goal"', "the values are not given once; found 'none'"),
    ('[[vary]]\nkey = "goal"\nvalues = ["at"]\ngrid = { from = 0, to = 1, count = 2 }', "found 'values, grid'"),
    ('[[vary]]\nkey = "snap"\nvalues = [1, 2]\nnames = ["a"]', r"vary\[1\].names: the names do not fit"),
    ('[[vary]]\nkey = "snap"\nvalues = [1, 2]\nnames = ["a", "a"]', r"vary\[1\].names: the names do not fit"),
    ('count = 3\n[[vary]]\nkey = "snap"\nuniform = { low = 1, high = 2 }\nnames = ["a"]', r"vary\[1\].names"),
    ('[[vary]]\nkey = ["snap", "length"]\nvalues = [0.1, 0.2]', r"vary\[1\].values\[1\]: not one value a key"),
    ('[[vary]]\nkey = ["goal", "pair"]\nvalues = ["at", "any"]', r"vary\[1\].values\[1\]: not one value a key"),
    ('[[vary]]\nkey = ["goal", "pair"]\nvalues = [["at", "any"], ["at"]]',
     r"vary\[1\].values\[2\]: not one value a key"),
    ('[[vary]]\nkey = ["goal", "pair"]\ngrid = { from = 0, to = 1, count = 2 }',
     r"vary\[1\].grid: a grid is of one key"),
    ('[[vary]]\nkey = "snap"\ngrid = { from = 1, to = 1, count = 2 }', r"vary\[1\].grid.to: empty range"),
    ('[[vary]]\nkey = "snap"\ngrid = { from = 2, to = 1, count = 2 }', r"vary\[1\].grid.to: empty range"),
    ('[[vary]]\nkey = "snap"\ngrid = { from = 1, to = 2, count = 1 }', r"vary\[1\].grid.count"),
    ('[[vary]]\nkey = "snap"\ngrid = { from = 1, to = 2, count = 0 }', r"vary\[1\].grid.count"),
    ('[[vary]]\nkey = "snap"\ngrid = { from = 1, to = 2, count = 2.0 }', r"vary\[1\].grid.count"),
    ('[[vary]]\nkey = "snap"\ngrid = { from = 1, to = 2, count = 100000000000 }', r"vary\[1\].grid.count: too many"),
    ('[[vary]]\nkey = "snap"\ngrid = { from = 1, to = inf, count = 2 }', r"vary\[1\].grid.to: a number is not finite"),
    ('[[vary]]\nkey = "snap"\ngrid = { from = 1, to = 2 }', r"vary\[1\].grid.count: missing key"),
    ('[[vary]]\nkey = "snap"\ngrid = { from = 1, to = 2, step = 1 }', r"vary\[1\].grid.step: unknown key"),
    ('[[vary]]\nkey = "snap"\ngrid = { from = 0, to = 2, count = 3, spacing = "log" }',
     r"vary\[1\].grid.from: a ratio"),
    ('[[vary]]\nkey = "snap"\ngrid = { from = 1, to = 2, count = 3, spacing = "cubic" }', r"vary\[1\].grid.spacing"),
    ('count = 3\n[[vary]]\nkey = "snap"\nuniform = { low = 1, high = 1 }', r"vary\[1\].uniform: empty range"),
    ('count = 3\n[[vary]]\nkey = "snap"\nuniform = { low = 2, high = 1 }', r"vary\[1\].uniform: empty range"),
    ('count = 3\n[[vary]]\nkey = "snap"\nnormal = { mean = 1, deviation = 0, low = 0, high = 2 }', "normal.deviation"),
    ('count = 3\n[[vary]]\nkey = "snap"\nnormal = { mean = 1, deviation = 1, low = 0 }', r"normal.high: missing key"),
    ('[[vary]]\nkey = "snap"\nuniform = { low = 1, high = 2 }', r"count: how many numbers to draw"),
    ('count = 3\n[[vary]]\nkey = "snap"\nvalues = [1e-6]', "count: nothing is drawn"),
    ('count = 0\n[[vary]]\nkey = "snap"\nuniform = { low = 1, high = 2 }', "count"),
    ('count = 1000000000\n[[vary]]\nkey = "snap"\nuniform = { low = 1, high = 2 }', "count: too many draws"),
    ('count = 3\n[[vary]]\nkey = "goal"\nuniform = { low = 1, high = 2 }', r"vary\[1\]: no problem takes this: goal"),
    ('sampling = "sobol"', "sampling"),
    ("seed = -1", "seed"),
    ("time_limit = 0", "time_limit"),
    ("certify = 1", "certify"),
    ("[yield]\nbudget = -1", "yield.budget"),
    ("[yield]", "yield.budget: missing key"),
    ('[[vary]]\nkey = "snap"\nvalues = [1e-6]\n[[vary]]\nkey = "snap"\nvalues = [1e-5]',
     r"vary\[2\]: a key is given twice"),
    ('[[vary]]\nkey = "target"\nvalues = [[1, 1]]\n[[vary]]\nkey = "target[1]"\nvalues = [1]', "two keys say the same"),
    ('[[vary]]\nkey = "limits.RZ_deg"\nvalues = [[0, 1]]\n[[vary]]\nkey = "limits.RZ_rad"\nvalues = [[0, 1]]',
     "say the same"),
    ('derive = { snap = "1" }\n[[vary]]\nkey = "snap"\nvalues = [1e-6]', "derive.'snap': a key is given twice"),
    ('[[vary]]\nkey = ["target[1]", "requirement", "tolerance"]\nvalues = [[1, "A", 0.1]]',
     "these keys exclude each other"),
    ('[[vary]]\nkey = "bodies.static.seed[1]"\nvalues = [0.1]', "bodies.static.seed: an item of it is asked for"),
    ('[[vary]]\nkey = "keep_out.rib.scale"\nvalues = [1]', r"vary\[1\].*keep-outs are counted"),
    (f'[[vary]]\nkey = "{"a." * 140}a"\nvalues = [1]', r"vary\[1\].key: no problem is that deep"),
    (f'[[vary]]\nkey = "{"a" * 1000}"\nvalues = [1]', r"vary\[1\].key: not a place"),
    ('[[vary]]\nkey = "snap"\ngrid = { from = -1e308, to = 1e308, count = 3 }', r"vary\[1\].grid.from: unusable"),
    ('[[vary]]\nkey = ["target", "tolerance"]\nvalues = [[[1, 1], 0.1]]', "these keys exclude each other"),
    ('[[vary]]\nkey = "snap"\nlabel = "x"\nvalues = [1e-6]\n[[vary]]\nkey = "goal"\nlabel = "x"\nvalues = ["touch"]',
     r"vary\[2\].label: the label is that of vary\[1\]"),
    ('[[vary]]\nkey = "snap"\nlabel = "case"\nvalues = [1e-6]', r"vary\[1\].label"),
    ('parameters = { x = "y" }\nderive = { snap = "x" }', "parameters.x: no such parameter 'y'"),
    ('parameters = { height = 1 }\nderive = { snap = "heigt" }', "derive.'snap': .*did you mean 'height'"),
    ('derive = { snap = "sine(1)" }', "derive.'snap': no such function, did you mean 'sin'"),
    ('derive = { target = [1, "x.real"] }', r"derive.'target'\[2\]: no arithmetic: Attribute"),
    ('derive = { snap = "2 ^ 3" }', "powers are written"),
    ('derive = { snap = "1 / 0" }', "derive.'snap': the expression has no value"),
    ('derive = { snap = "9 ** 9 ** 9 ** 9" }', "derive.'snap': the expression has no value"),
    ('derive = { goal = "touch" }', "derive.'goal': no such parameter 'touch'"),
    ("derive = { bodies = { static = { seed = 3 } } }", 'both bodies at once.*"bodies.static.seed" = ..., in quotes'),
    ('derive = { gaol = { text = "touch" } }', "derive.'gaol': .*unknown key 'gaol', did you mean 'goal'"),
    ('derive = { goal = 3 }', "derive.'goal': no problem takes this"),
    ('derive = { "target[" = 3 }', r"derive.'target\[': not a place"),
    ('derive = { "parameters.x" = 3 }', "a parameter is not derived"),
    ('parameters = { x = 1, y = 2 }\nderive = { snap = "x" }', "parameters.y: nothing uses this parameter"),
    ('parameters = { x = "y", y = "x" }\nderive = { snap = "x" }',
     "parameters: .*circle; found 'x -> y -> x'|'y -> x -> y'"),
    ('parameters = { x = "x" }\nderive = { snap = "x" }', "circle"),
    ('parameters = { x = "y", y = "x" }\nderive = { snap = "x" }', "study.toml:3: parameters: parameters follow"),
    ('parameters = { x = nan }\nderive = { snap = "x" }', "parameters.x"),
    ('parameters = { x = true }\nderive = { snap = "x" }', "parameters.x"),
    ('parameters = { pi = 3 }\nderive = { snap = "pi" }', "parameters.pi: this name has a meaning"),
    ('parameters = { "a-b" = 3 }\nderive = { snap = "1" }', "not a name for a parameter"),
    ('[[vary]]\nkey = "parameters.x"\nvalues = [1]', "parameters.x: no such parameter"),
    ('parameters = { x = "1 + 1" }\nderive = { snap = "x" }\n[[vary]]\nkey = "parameters.x"\nvalues = [1]',
     "follows from others"),
    ('parameters = { x = 1 }\nderive = { snap = "x" }\n[[vary]]\nkey = "parameters.x"\nvalues = ["a"]',
     "parameters.x is no number"),
    ('[[vary]]\nkey = "parameters.x.y"\nvalues = [1]', "not a parameter"),
    ('[[vary]]\nkey = "target[1]"\ncsv = { file = "none.csv", column = "a" }', "none.csv: the file cannot be read"),
    ('[[vary]]\nkey = "target[1]"\ncsv = { file = "bad.csv" }', r"vary\[1\].csv: exactly one of column and columns"),
    ('[[vary]]\nkey = "target[1]"\ncsv = { file = "bad.csv", column = "a", nominals = [1] }',
     "this key goes with columns"),
    ('[[vary]]\nkey = "target[1]"\ncsv = { file = "bad.csv", column = "b" }', "bad.csv: column 'b': no such column"),
    ('[[vary]]\nkey = "target[1]"\ncsv = { file = "bad.csv", column = "a" }', "bad.csv: row 3, column 'a': not a size"),
    ('[[vary]]\nkey = "target[1]"\ncsv = { file = "ragged.csv", column = "a" }', "ragged.csv: row 2, column 'a'"),
    ('[[vary]]\nkey = "target[1]"\ncsv = { file = "empty.csv", column = "a" }', "empty.csv"),
    ('[[vary]]\nkey = ["target[1]", "snap"]\ncsv = { file = "bad.csv", columns = ["a"] }',
     r"vary\[1\].csv.columns: not one"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "said"), WRONG, ids=[said[:60] for _, said in WRONG])
def test_what_is_wrong_is_refused_with_its_place(
    study: Callable[..., Study], tmp_path: Path, text: str, said: str
) -> None:
    (tmp_path / "bad.csv").write_text("a\n1.0\nnan\n")
    (tmp_path / "ragged.csv").write_text("a,b\n1.0\n")
    (tmp_path / "empty.csv").write_text("a\n")
    with pytest.raises(InputError, match=said) as caught:
        study(text)
    assert str(tmp_path) in str(caught.value)


@pytest.mark.parametrize(
    ("cases", "said"),
    [
        ("cases = []", "cases"),
        ('cases = ["a"]', r"cases\[1\]: no such case, did you mean 'A'|cases\[1\]: no such case"),
        ('cases = ["A", "A"]', r"cases\[2\]: given twice"),
        ("cases = 3", "cases"),
    ],
)
def test_cases_that_the_problem_has_not_are_refused(study: Callable[..., Study], cases: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        study("", cases=cases)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "the file is empty"),
        ("title = 3", "missing key|title"),
        ("seed = 1", "problem: missing key"),
        ('problem = "none.toml"', "none.toml: the file cannot be read"),
        ('problem = "study.toml"', "unknown key 'problem'"),
        ("problem = [", "not valid TOML"),
    ],
)
def test_a_file_that_is_no_study_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        Study.read(tmp_path / "study.toml")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"problem": 3}, "problem: nothing to study"),
        ({"parameters": {"x": 10**400}, "derive": {"snap": "x"}}, "parameters.x: wrong"),
        ({"parameters": {"x": 1}, "derive": {"snap": "x"}, "vary": {"parameters.x": [10**400]}}, "x is no number"),
        ({"vary": {"target[1]": [ENDLESS]}}, "nested too deep"),
        ({"budget": 10**400}, "budget: "),
        ({"problem": []}, "problem: nothing to study"),
        ({"problem": ["base.toml"]}, "problem: nothing to study"),
        ({"vary": 3}, "vary: nothing that varies"),
        ({"vary": {"tolerance": 0.1}}, r"vary\['tolerance'\]: no values"),
        ({"vary": {"tolerance": "0.1"}}, r"vary\['tolerance'\]: no values"),
        ({"vary": {"goal": ["touch", object()]}}, r"vary\['goal'\]\[2\]: no plain data"),
        ({"vary": {(): [1]}}, "no key"),
        ({"vary": {3: [1]}}, "not a place"),
        ({"vary": {("snap", "length"): fo.Uniform(1, 2)}, "count": 3}, "numbers are drawn for one key"),
        ({"count": 2.0}, "count"),
        ({"seed": True}, "seed"),
        ({"certify": 1}, "certify"),
        ({"time_limit": -1.0}, "time_limit"),
        ({"budget": math.nan}, "budget"),
        ({"title": 3}, "title"),
        ({"parameters": [1]}, "parameters"),
        ({"derive": {3: 1}}, "derive"),
        ({"vary": {"target[1]": range(1, 2)}, "cases": ["C"]}, r"cases\[1\]"),
    ],
)
def test_python_arguments_are_checked_like_files(tmp_path: Path, arguments: dict, said: str) -> None:
    (tmp_path / "base.toml").write_text(BASE, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        Study(**{"problem": tmp_path / "base.toml", **arguments})


@pytest.mark.parametrize(
    ("read", "text", "kind"),
    [
        (Study.read, "[bodies.movable]", "a problem file, and no study file"),
        (Study.read, "[[part]]", "a file of an assembly, and no study file"),
        (fo.load_problems, "[[vary]]", "a study file, which fcdm-opt study takes, and no problem file"),
    ],
)
def test_a_file_of_another_kind_had_an_unknown_key(tmp_path: Path, read: Any, text: str, kind: str) -> None:
    (tmp_path / "own.toml").write_text(text, "utf-8")
    with pytest.raises(InputError, match=kind):
        read(tmp_path / "own.toml")
