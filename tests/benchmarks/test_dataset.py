"""The data set of smallest motions: its exact answers, its scorer, and answers that come from the command line."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcdm_opt_benchmarks import library
from fcdm_opt_benchmarks.references import shifts
from fcdm_opt_benchmarks.shapes import box, random_rotation
from fcdm_opt_benchmarks.stability.motion_bodies import _least_shift as least_of_boxes

FOLDER = Path(__file__).parents[2] / "benchmarks" / "dataset"
SCENES = json.loads((FOLDER / "scenes.json").read_text(encoding="utf-8"))["scenes"]
NAMES = [scene["name"] for scene in SCENES]
MOVED = [scene for scene in SCENES if "motion" in scene["answer"]]
AXES = np.eye(3).tolist()


@pytest.fixture(scope="module")
def score() -> Any:
    sys.path.insert(0, str(FOLDER))
    try:
        import score
    finally:
        sys.path.remove(str(FOLDER))
    return score


def scene(name: str) -> Any:
    return next(own for own in SCENES if own["name"] == name)


# ------------------------------------------------------------------------------------------------------------- the set


def test_small_and_half_as_engineers_draw() -> None:
    assert sum(path.stat().st_size for path in FOLDER.glob("*.*")) < 1.5e6
    assert len(set(NAMES)) == len(NAMES) >= 100
    drawn = sum(own["class"] == "drawn" for own in SCENES)
    assert 0.45 <= drawn / len(SCENES) <= 0.55
    tags = {tag for own in SCENES for tag in own["tags"]}
    assert {"aligned", "flush", "union", "curved", "mesh", "contacts", "sizes", "real"} <= tags


def test_meshes_of_others_carry_their_open_licence_and_come_from_the_files_beside() -> None:
    """The hull of a scene's body has the volume of that of its file."""
    import trimesh
    from scipy.spatial import ConvexHull

    folder = FOLDER.parent / "meshes"
    said = (folder / "README.md").read_text(encoding="utf-8")
    assert all(path.name in said for path in folder.glob("*.stl"))
    real = [own for own in SCENES if "real" in own["tags"]]
    assert real == [own for own in SCENES if "mesh" in own]
    for own in real:
        assert own["mesh"]["licence"] in {"MIT", "Apache-2.0"}
        assert own["mesh"]["from"] in said
    for name, family, role, unit in (
        ("panda_hand.stl", "robot hand on its flange", "movable", 1000.0),
        ("panda_flange.stl", "robot hand on its flange", "static", 1000.0),
        ("tube.stl", "pin in a tube", "static", 1.0),
        ("notched_cube.stl", "block in a notch", "static", 1.0),
    ):
        own = next(own for own in real if own["family"] == family)
        held = ConvexHull(np.vstack([np.array(part) for part in own[role]["parts"]])).volume
        assert held == pytest.approx(trimesh.load_mesh(folder / name).convex_hull.volume * unit**3, rel=1e-5), name


@pytest.mark.sampled(30)
@pytest.mark.parametrize("own", MOVED, ids=lambda own: own["name"])
def test_answers_do_what_is_asked_and_cost_what_is_said(score: Any, own: Any) -> None:
    truth = own["answer"]
    assert score.miss(own, truth["motion"]) <= 1e-9 * score.size(own)
    assert score.amount(own, truth["motion"]) == pytest.approx(truth["amount"], rel=1e-9, abs=1e-12)
    assert truth["lower"] <= truth["amount"]
    assert truth["lower"] >= truth["amount"] * (1 - 2e-3)
    if "amount_squared" in truth:
        assert float(Fraction(truth["amount_squared"])) == pytest.approx(truth["amount"] ** 2, rel=1e-14)


# -------------------------------------------------------------------------------------------------------- exact shifts


@pytest.mark.parametrize("number", range(24))
def test_least_shifts_of_unions_of_boxes(number: int) -> None:
    rng = np.random.default_rng(number)
    axes = [[0], [0, 1], [1, 2], [0, 1, 2]][number % 4]
    goal = ("touch", "clear")[number // 4 % 2]
    sides = []
    for k in range(2):
        lows = [rng.integers(-3, 4, 3) + 0.25 * k for _ in range(2)]
        sides.append([(low, low + rng.integers(1, 5, 3)) for low in lows])
    ones, twos = ([shifts.fractions(box(*ends)) for ends in own] for own in sides)
    found = shifts.least_shift(shifts.asked_of(ones, twos, [AXES[k] for k in axes], goal))
    known = least_of_boxes(sides[0], sides[1], axes, goal)
    assert (found is None) == (known is None)
    if found is not None:
        assert float(found.square) == pytest.approx(known**2, rel=1e-12)


def test_depth_and_distance_of_a_cube_and_an_octahedron() -> None:
    cube = shifts.fractions(box((-1, -1, -1), (1, 1, 1)))
    for middle, goal, square in ((2.0, "clear", Fraction(1, 1)), (4.0, "touch", Fraction(1, 1))):
        eight = shifts.fractions([[middle + x, y, z] for x, y, z in (*np.eye(3) * 2, *-np.eye(3) * 2)])
        found = shifts.least_shift(shifts.asked_of([cube], [eight], AXES, goal))
        assert found is not None
        assert found.square == square  # its corner reaches x = middle - 2, the cube's face x = 1
    corner = shifts.fractions([[3 + x, 3 + y, 3 + z] for x, y, z in (*np.eye(3) * 3, *-np.eye(3) * 3)])
    found = shifts.least_shift(shifts.asked_of([cube], [corner], AXES, "touch"))
    assert found is not None
    assert found.square == Fraction(3)  # its face x + y + z = 6 is 3 / sqrt(3) from the corner (1, 1, 1)


def test_two_edges_cross_where_their_common_normal_says() -> None:
    one = shifts.fractions([[-2, 0, 0], [2, 0, 0], [0, 1, -1], [0, -1, -1]])
    two = shifts.fractions([[0, -2, 0.75], [0, 2, 0.75], [1, 0, 2], [-1, 0, 2]])
    found = shifts.least_shift(shifts.asked_of([one], [two], AXES, "touch"))
    assert found is not None
    assert found.q == (0, 0, Fraction(3, 4))


def test_limits_are_kept_and_may_leave_nothing() -> None:
    one, two = (shifts.fractions(box((x, 0, 0), (x + 1, 1, 1))) for x in (0, 3))
    assert shifts.least_shift(shifts.asked_of([one], [two], AXES[:1], "touch", [(-1.0, 1.0)])) is None
    found = shifts.least_shift(shifts.asked_of([one], [two], AXES[:1], "touch", [(2.5, 9.0)]))
    assert found is not None
    assert found.q == (4,)  # past the other box


def test_contact_scale_of_boxes() -> None:
    one, two = box((-1, -1, -1), (1, 1, 1)), box((4, -1, -1), (6, 1, 1))
    assert shifts.contact_scale(one, two, ((0, 0, 0), (5, 0, 0)), 1.5) == Fraction(7, 2)


# ----------------------------------------------------------------------------------------------------------- the scorer


def test_gaps_are_those_of_the_collision_library(score: Any) -> None:
    from fcdm_opt_benchmarks.coal_shapes import CoalHulls

    rng, apart = np.random.default_rng(5), 0
    for _ in range(60):
        P, Q = rng.normal(size=(10, 3)), rng.normal(size=(12, 3)) + rng.normal(size=3) * 2
        known = CoalHulls(P, Q, 1e-12).gap()
        one, two = score.part(P), score.part(Q)
        gap = score.separation(one, two)
        apart += gap > 0
        found = score.distance(one, two) if gap > 0 else gap
        assert found == pytest.approx(known, abs=1e-9)
    assert 10 <= apart <= 50


@pytest.mark.parametrize(
    ("change", "outcome"),
    [
        ({}, "least"),
        ({"motion": [0.0]}, "wrong"),
        ({"motion": [0.55 + 1e-3]}, "wrong"),
        ({"motion": [0.55, 0.0]}, "wrong"),
        ({"motion": [float("nan")]}, "wrong"),
        ({"claim": "none"}, "wrong"),
        ({"claim": "unknown", "lower_bound": 0.56}, "wrong"),
        ({"claim": "unknown"}, "unknown"),
    ],
)
def test_planted_answers_to_boxes_face_to_face(score: Any, change: Any, outcome: str) -> None:
    own = scene("boxes face to face: touch, both smaller, x")
    answer = {"claim": "least", "motion": own["answer"]["motion"], **change}
    assert score.verdict(own, answer).outcome == outcome


def test_a_larger_motion_is_no_least_one(score: Any) -> None:
    own = scene("boxes face to face: clear, both larger, x, y, z")
    twice = [2 * x for x in own["answer"]["motion"]]
    assert score.verdict(own, {"claim": "motion", "motion": twice}).outcome == "larger"
    assert score.verdict(own, {"claim": "least", "motion": twice}).outcome == "wrong"
    assert score.verdict(own, None).outcome == "unknown"


def test_a_smaller_valid_motion_refutes_the_set(score: Any) -> None:
    own = scene("boxes face to face: clear, both larger, x, y, z")
    worse = {**own, "answer": {**own["answer"], "lower": 9.0, "amount": 9.0}}
    said = score.verdict(worse, {"claim": "motion", "motion": own["answer"]["motion"]})
    assert "REFUTED" in said.why


def test_a_rounding_of_a_small_motion_refuted_the_set(score: Any) -> None:
    own = scene("key in a slot, sizes per face: touch, narrow slot, x, y")
    less = [0.0025 * (1 - 1.2e-6), 0.0]
    assert score.miss(own, less) == pytest.approx(3e-9, rel=1e-3)
    assert score.verdict(own, {"claim": "least", "motion": less}).outcome == "near"


def test_a_motion_where_there_is_none(score: Any) -> None:
    own = scene("peg: clear, 1.04 and 1, x, y")
    assert score.verdict(own, {"claim": "none"}).outcome == "least"
    assert score.verdict(own, {"claim": "motion", "motion": [1.0, 1.0]}).outcome == "wrong"


def test_moved_as_a_whole_gaps_stay(score: Any) -> None:
    own = scene("hook and bar: touch, x")
    rng = np.random.default_rng(3)
    R, t = random_rotation(rng), rng.normal(size=3)
    parts = [score.part(part) for role in ("movable", "static") for part in score.made(own, role)[:1]]
    placed = [score.moved(part, R, t) for part in parts]
    assert score.separation(*placed) == pytest.approx(score.separation(*parts), abs=1e-12)
    assert score.distance(*placed) == pytest.approx(score.distance(*parts), abs=1e-12)


def test_the_scorer_knows_of_no_tool() -> None:
    text = (FOLDER / "score.py").read_text(encoding="utf-8")
    assert "fcdm" not in text
    assert "coal" not in text


# ------------------------------------------------------------------------------------------ our own command, by files


@pytest.mark.slow
@pytest.mark.parametrize("only", ["hook and bar: clear", "sizes per face: touch, narrow", "three walls: locate, 0.99"])
def test_our_command_answers_by_files_alone(tmp_path: Path, score: Any, only: str) -> None:
    out = tmp_path / "answers.json"
    script = [sys.executable, str(FOLDER / "answer_fcdm_opt.py"), str(out), "--only", only]
    subprocess.run(script, check=True, stderr=subprocess.PIPE)
    answers = json.loads(out.read_text(encoding="utf-8"))["answers"]
    assert answers.keys() == {name for name in NAMES if only in name}
    assert {score.verdict(scene(name), own).outcome for name, own in answers.items()} == {"least"}


@pytest.mark.parametrize(
    ("status", "passed", "claim"),
    [("OUTSIDE_FIT", True, "least"), ("OUTSIDE_FIT", False, "unknown"), ("NOT_VERIFIED", False, "unknown")],
)
def test_a_motion_out_of_the_fit_is_one_where_the_judge_passes_it(
    monkeypatch: pytest.MonkeyPatch, status: str, passed: bool, claim: str
) -> None:
    """A plate too small for its pins is lifted off them: the set asks where it touches, not whether it stays on."""
    monkeypatch.syspath_prepend(str(FOLDER))
    import answer_fcdm_opt

    case = {"status": status, "usable": False, "certificate": {"passed": passed}, "seconds": {"solve": 1.0}}
    case |= {"lower_bound": 11.975, "gap": 0.0, "parameters": {"TZ": 11.975}}
    assert answer_fcdm_opt.answer(case)["claim"] == claim


def test_the_data_set_is_found_in_an_installed_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing lies beside the package; what is installed so is what `benchmarks/setup.py` names."""
    package = tmp_path / "fcdm_opt_benchmarks"
    shutil.copytree(FOLDER, package / "question_files")
    monkeypatch.setattr(library, "__file__", str(package / "library.py"))
    monkeypatch.delitem(sys.modules, "score", raising=False)
    script = library.dataset_script.__wrapped__("score")
    assert Path(script.__file__) == package / "question_files" / "score.py"
    monkeypatch.delitem(sys.modules, "score", raising=False)
    told = (FOLDER.parent / "setup.py").read_text(encoding="utf-8")
    assert 'DATASET: "dataset"' in told
    assert all(f'"*{path.suffix}"' in told for path in FOLDER.iterdir() if path.suffix not in (".py", ".pyc", ""))

