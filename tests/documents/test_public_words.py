"""Public words are types that a checker knows, and arrays in single precision are taken."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

import fcdm_opt as fo

PROGRAM = """
import fcdm_opt as fo
import numpy as np

body = fo.Body.convex(np.eye(4)[:, :3], seed="box")
problem = fo.Problem(body, body, motion=fo.Translation("z") >> fo.Rotation("z", centre="origin"), target=(1.0, 1.0),
                     goal="touch", pair="any", path="free", amount="weighted", unit="mm", nominal="drawn")
solution = fo.solve(problem, effort="quick", model="nlp")
fo.Translation("-x") >> fo.OwnMotion(lambda q: q, [("TX", "translation")])
fo.Body.from_file("peg.stl", unit="cm", file_unit="in", decomposition="exact", seed="vertices")
fo.Study(problem, sampling="random", effort="proved")
fo.budget(problem, 1.0, requirements=["B"])
solution.pair_state == "touching", solution.features[0].kind == "V1F2", problem.goal == "clear"
fo.Problem(body, body, motion=fo.Translation("z"), requirement="A", tolerance=0.02, made="worst", contacts="all")
"""
WRONG = {
    'goal="touch"': 'goal="tuch"',
    'pair="any"': 'pair="anny"',
    'path="free"': 'path="fre"',
    'amount="weighted"': 'amount="weigthed"',
    'unit="mm"': 'unit="mmm"',
    'nominal="drawn"': 'nominal="drwan"',
    'effort="quick"': 'effort="qick"',
    'requirement="A"': 'requirement="E"',
    'made="worst"': 'made="wurst"',
    'contacts="all"': 'contacts="al"',
    'centre="origin"': 'centre="orign"',
    'model="nlp"': 'model="npl"',
    '("-x")': '("-q")',
    '"translation")': '"translaton")',
    'unit="cm"': 'unit="centimetre"',
    'file_unit="in"': 'file_unit="inch"',
    'decomposition="exact"': 'decomposition="exactly"',
    'seed="vertices"': 'seed="vertex"',
    'sampling="random"': 'sampling="randm"',
    'effort="proved"': 'effort="prooved"',
    'requirements=["B"]': 'requirements=["E"]',
    '== "touching"': '== "touch"',
    '== "V1F2"': '== "V1F3"',
    '== "clear"': '== "cleer"',
}


@pytest.mark.slow
def test_a_type_checker_refuses_words_that_there_are_not(tmp_path):
    """All in one run: one line a word, and the program as it should be, of which nothing is said."""
    (tmp_path / "right.py").write_text(PROGRAM)
    for number, (right, wrong) in enumerate(WRONG.items()):
        assert right in PROGRAM
        (tmp_path / f"wrong_{number}.py").write_text(PROGRAM.replace(right, wrong))
    files = [str(path) for path in sorted(tmp_path.glob("*.py"))]
    run = [sys.executable, "-m", "mypy", *files]  # as the project is checked: what is known of it already serves
    said = subprocess.run(run, capture_output=True, text=True, check=False, cwd=Path(__file__).parents[2]).stdout
    errors = {line.split("/")[-1].split(":")[0] for line in said.splitlines() if ": error:" in line}
    assert errors == {f"wrong_{number}.py" for number in range(len(WRONG))}, said


@pytest.mark.parametrize("seed", range(4))
def test_poses_in_single_precision_are_taken(seed):
    """The same as the nearest rotation in full, which is off what was meant by no more than single precision."""
    rng = np.random.default_rng(seed)
    one, two = (fo.Body.convex(rng.normal(size=(8, 3)) + k * np.array([4.0, 0, 0])) for k in (0, 1))
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Turn.random(random_state=seed).as_matrix(), [0.5, 0.25, -0.125]
    single = T.astype(np.float32)
    told = float(fo.decision_curve(one, two, transform=single).gap((1.0, 1.0)))
    assert told == pytest.approx(float(fo.decision_curve(one, two, transform=T).gap((1.0, 1.0))), abs=1e-5)
    batch = fo.decision_curves(one, two, np.array([single, single]))
    assert np.array_equal(batch.transforms[0], batch.transforms[1])
    R = batch.transforms[0][:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
    assert one.moved(single).seed == pytest.approx(one.moved(T).seed, abs=1e-6)


def test_a_pose_of_six_digits_as_logs_have_it_is_the_nearest_one():
    """Of a rotation matrix rounded to six digits the axis and the angle are right to a millionth."""
    body, turn = fo.Box((1, 2, 3)), fo.Rotation("z").transform([0.7], np.zeros(3), np.zeros(3))
    moved = body.moved(turn.round(6).tolist())
    assert np.abs(moved.vertices - body.moved(turn).vertices).max() < 3e-6
    edges = np.linalg.norm(moved.vertices[:, None] - moved.vertices, axis=2)
    assert edges == pytest.approx(np.linalg.norm(body.vertices[:, None] - body.vertices, axis=2), abs=1e-12)
    with pytest.raises(fo.InputError, match="or with six digits"):
        body.moved(turn.round(4))


def test_what_single_precision_does_not_explain_is_refused():
    body = fo.Body.convex(np.eye(4)[:, :3].astype(np.float32))
    for change in (1.001, 0.0, -1.0):
        with pytest.raises(fo.InputError, match="rigid motion"):
            body.moved((np.diag([change, 1.0, 1.0, 1.0])).astype(np.float32))


def test_the_package_lists_its_public_names_alone():
    assert dir(fo) == fo.__all__
    assert not [name for name in dir(fo) if name.startswith("_") and name != "__version__"]


def test_a_unit_is_carried_from_the_bodies_to_the_problem():
    """By all that makes bodies of others too; what contradicts it is refused."""
    one, two = (fo.Body.convex(np.eye(4)[:, :3] + [k, 0, 0], seed="box", name="tip", unit="mm") for k in (0, 1))
    assert repr(one).endswith("extent 1 x 1 x 1 mm)")
    assert one.scaled(1.1).moved(np.eye(4)).unit == fo.as_body(one).unit == "mm"
    asked = {"target": (0.9, 0.9), "goal": "touch", "motion": fo.Translation("x")}
    problem = fo.Problem(one, two, **asked)
    assert problem.unit == "mm"
    assert "motion TX, mm)" in repr(problem)
    again = fo.Problem.from_dict(problem.to_dict())
    assert again.unit == again.static.unit == "mm"
    plain = fo.Body.convex(np.eye(4)[:, :3], name="plain")
    assert fo.Problem(one, plain, **asked).unit == "mm"
    with pytest.raises(fo.InputError, match="different units"):
        fo.Problem(one, two, keep_out=[fo.Body.convex(two.vertices, unit="in")], **asked)
    with pytest.raises(fo.InputError, match="not the unit of the bodies; found 'in'"):
        problem.changed(unit="in")
    with pytest.raises(fo.InputError, match="unknown unit"):
        fo.Body.convex(two.vertices, unit="inch")
    parts = {"one": one, "two": two}
    joined = [{"parts": ("one", "two"), "goal": "touch"}]
    assert fo.Assembly(parts, joined, motions={"one": fo.Translation("x")}).unit == "mm"


def test_a_session_shows_a_line_of_a_result_and_not_its_arrays() -> None:
    """The derivatives of one motion filled screens."""
    block = fo.cut(fo.Box((60, 40, 15), centre=(0, 0, -7.5)), fo.Box((20, 10, 12), centre=(0, 0, -5)), name="block")
    width = fo.Size("width", "movable", faces=["right"], tolerance=0.05)
    key = fo.Box((20, 9.8, 12), centre=(0, 0, -3), name="key")
    problem = fo.Problem(key, block, motion=fo.Translation("x"), goal="clear", sizes=[width], made={"width": 0.04})
    found = fo.solve(problem)
    known = [found, found.sensitivity, found.certificate, fo.contact_times(problem), fo.best_pose(problem)]
    for result in [*known, fo.compare(problem), fo.stack_up(problem), fo.contact_rows(problem)]:
        shown = repr(result)
        assert shown.startswith(f"{type(result).__name__}(")
        assert "\n" not in shown
        assert len(shown) < 400


def test_names_of_other_libraries_are_answered_with_ours() -> None:
    with pytest.raises(AttributeError, match="no attribute 'union'; did you mean 'joined'"):
        fo.union  # noqa: B018
