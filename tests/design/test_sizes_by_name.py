"""Maps, studies, what-ifs and one pose for all over sizes by name, against closed forms."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.special import ndtr
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.design.compensation.compensation_map import CompensationMap
from fcdm_opt.design.question import Question

PROBLEMS = Path(__file__).parents[2] / "problems"
KEY = PROBLEMS / "slot_and_key.toml"
X = fo.Translation("x")


def box(low: Any, high: Any, name: str = "body") -> fo.Body:
    """An aligned box."""
    return fo.Body.convex(list(product(*zip(low, high, strict=True))), name=name)


def channel(width: float, height: float = 5.0) -> fo.Body:
    """Two walls with a gap of a width between them, about x = 0."""
    half = width / 2
    walls = [list(product(ends, (-height, height), (-5.0, 5.0))) for ends in ((-half - 3, -half), (half, half + 3))]
    return fo.Body.from_parts(walls, seed=(0, 0, 0), name="channel")


def peg_in_channel(**more: Any) -> fo.Problem:
    """A peg with a tolerance on each side, 0.1 off the left wall, 0.05 off the right one."""
    sizes = [
        fo.Size("right side", "movable", faces="+x", tolerance=(-0.02, 0.03)),
        fo.Size("left side", "movable", faces="-x", tolerance=(0.0, 0.01)),
    ]
    peg = box((-9.9, -1, -1), (9.95, 1, 1), "peg")
    return fo.Problem(peg, channel(20.0), **{"sizes": sizes, "motion": X, "goal": "touch", **more})


def run(*arguments: Any) -> tuple[int, str, str]:
    """Run a command."""
    result = CliRunner().invoke(app, [*map(str, arguments)])
    return result.exit_code, result.stdout, result.stderr


# --------------------------------------------------------------------------------------------------------------- maps


@pytest.mark.usefixtures("coarse_maps")
def test_a_map_over_two_sizes_has_the_closed_form() -> None:
    """To touch the nearer wall: min(0.05 - right, 0.1 - left)."""
    found = fo.compensation_map(peg_in_channel(), error=1e-4)
    assert found.over == ("right side", "left side")
    assert found.box.tolist() == [[-0.02, 0.03], [0.0, 0.01]]
    right, left = np.random.default_rng(1).uniform(*found.box.T, (500, 2)).T
    at = found.at(right, left)
    assert (np.abs(at.amount - np.minimum(0.05 - right, 0.1 - left)) <= at.error + 1e-9).all()
    assert at.error.max() <= 1e-4
    again = CompensationMap.from_dict(json.loads(json.dumps(found.to_dict())))
    assert again.over == found.over
    share = fo.assembly_yield(found, sizes=(fo.Uniform(-0.02, 0.03), fo.Uniform(0.0, 0.01)), budget=0.045)
    assert share.interval[0] - 1e-9 <= 0.5 <= share.interval[1] + 1e-9  # right >= 0.005
    assert [own.body for own in share.contributions] == ["right side", "left side"]


@pytest.mark.usefixtures("coarse_maps")
def test_a_map_over_scales_that_was_written_before_is_read() -> None:
    problem = peg_in_channel(sizes=(), tolerance=1e-4, requirement="A")
    data = fo.compensation_map(problem, error=1e-2).to_dict()
    del data["over"]
    assert CompensationMap.from_dict(data).over == ("rho_1", "rho_2")


@pytest.mark.parametrize("over", [(), ("left side", "left side"), ("left side", "depth"), "depth", 3])
def test_a_map_over_what_are_no_sizes_is_refused(over: Any) -> None:
    with pytest.raises(fo.InputError, match="over"):
        fo.compensation_map(peg_in_channel(), over=over)


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_maps")
def test_a_map_of_a_file_with_five_sizes_takes_two_by_name(tmp_path: Path) -> None:
    """Amount 0.125 + slot_depth - key_foot; the depth uniform within 0.05, the foot normal with sigma 0.02 / 3."""
    code, _, said = run("map", KEY, "--case", "as drawn", "--out", tmp_path, "--over", "key_foot,slot")
    assert code == 2
    assert "one to 6 of key_width" in said
    line = ("map", KEY, "--case", "as drawn", "--over", "key_foot,slot_depth", "--budget", 0.15, "--error", 2e-2)
    code, text, _ = run(*line, "--out", tmp_path, "--json")
    assert code == 0
    case = json.loads(text)["files"][0]["cases"][0]
    assert case["map"]["over"] == ["key_foot", "slot_depth"]
    depths = np.linspace(-0.05, 0.05, 200_001)
    share = np.mean(ndtr(3.0) - ndtr(np.clip((depths - 0.025) / (0.02 / 3), -3.0, 3.0)))  # foot >= depth - 0.025
    low, high = case["yield"]["interval"]
    assert low - 1e-6 <= share <= high + 1e-6
    (header,) = [path.read_text().splitlines()[0] for path in tmp_path.glob("*-map.csv")]
    assert "key_foot_1,slot_depth_1" in header


# --------------------------------------------------------------------------------------------- what-ifs and studies


@pytest.mark.slow
def test_a_size_with_a_space_in_its_name_is_set_on_the_command_line(tmp_path: Path) -> None:
    file = tmp_path / "peg.toml"
    file.write_text("""
        [bodies.movable]
        vertices = [[0, 0, 0], [4, 0, 0], [0, 2, 0], [4, 2, 0], [0, 0, 1], [4, 0, 1], [0, 2, 1], [4, 2, 1]]
        [bodies.static]
        vertices = [[5, 0, 0], [6, 0, 0], [5, 2, 0], [6, 2, 0], [5, 0, 1], [6, 0, 1], [5, 2, 1], [6, 2, 1]]
        [[size]]
        name = "peg length"
        body = "movable"
        faces = "+x"
        tolerance = 0.1
        [[size]]
        name = "a.b = [1]"
        body = "static"
        faces = "-x"
        tolerance = 0.2
        [[case]]
        name = "1"
        goal = "touch"
        motion = [{ translation = "x" }]
        made = { "peg length" = 0.05 }
    """)
    for change, amount in (
        ("made.peg length=0.02", 0.98),
        ('made."peg length"=0.03', 0.97),
        ("made.'a.b = [1]' = 0.1", 0.85),
        ("made=worst", 0.7),
        ("made={ 'a.b = [1]' = -0.1 }", 1.1),
    ):
        code, text, said = run("whatif", file, "--set", change, "--json")
        assert code == 0, said
        assert json.loads(text)["files"][0]["cases"][0]["whatif"]["after"]["amount"] == pytest.approx(amount, abs=1e-12)
    both = ("--set", "made=worst", "--set", "size.peg length.tolerance=[0, 0.3]")
    code, text, _ = run("whatif", file, *both, "--json")
    assert json.loads(text)["files"][0]["cases"][0]["whatif"]["after"]["amount"] == pytest.approx(0.5, abs=1e-12)
    for change, word in (
        ("made.peg lenght=0.02", "no such size, did you mean 'peg length'?"),
        ("size.peg lenght.tolerance=0.02", "no such size, did you mean 'peg length'?"),
        ("size.peg length.tolerence=0.02", "did you mean 'tolerance'"),
        ("size[3].tolerance=0.02", "1 to 2"),
        ("size=[]", "one by one"),
        ('made."peg length=0.02', "not a name and a value"),
    ):
        code, _, said = run("whatif", file, "--set", change)
        assert code == 2
        assert word in said


def test_what_if_and_studies_refused_the_sizes_of_a_mesh_that_has_to_be_cut_for_them(tmp_path: Path) -> None:
    """A T of one piece, its shoulders in one plane: the height of one changes, as `solve` had it from the file."""
    foot, stem = (trimesh.creation.box(bounds=ends) for ends in (((-3, 0, 0), (3, 4, 2)), ((-1, 0, 1), (1, 4, 6))))
    trimesh.boolean.union([foot, stem]).export(tmp_path / "tee.off")
    trimesh.creation.box(bounds=((2, 0, 2.5), (5, 4, 4))).export(tmp_path / "bar.off")
    tee = fo.Body.from_file(tmp_path / "tee.off", unit="mm")
    normals, points = tee.face_planes
    up = np.flatnonzero((normals[:, 2] > 0.9) & (points[:, 2] == 2))
    right = next(k for k in up if tee.vertices[tee.faces[k][0] - 1, 0] > 0)
    file = tmp_path / "tee.toml"
    file.write_text(f"""
        [bodies.movable]
        file = "tee.off"
        unit = "mm"
        [bodies.static]
        file = "bar.off"
        unit = "mm"
        [[size]]
        name = "shoulder"
        body = "movable"
        faces = "F{right + 1}"
        tolerance = 0.2
        [[case]]
        name = "1"
        goal = "touch"
        motion = [{{ translation = "z" }}]
        made = {{ shoulder = 0.125 }}
    """)
    (asked,) = Question.read(file)
    assert fo.solve(asked.problem()).amount == pytest.approx(0.375)
    assert fo.solve(asked.changed({"made.shoulder": -0.125}).drawn().problem()).amount == pytest.approx(0.625)


def test_a_study_varies_what_is_made_and_tolerances(tmp_path: Path) -> None:
    """Amount 0.0325 + 0.03 - t: the least gap at rest, sideways, is taken at slot_position = t."""
    file = tmp_path / "study.toml"
    file.write_text(f"""
        problem = "{KEY}"
        cases = ["to a side, at the least gap"]
        [[vary]]
        key = "size.slot_position.tolerance"
        values = [0.01, 0.02]
        [[vary]]
        key = "made"
        values = ["worst", {{ slot_position = 0.005 }}]
    """)
    result = fo.run_study(file, tmp_path / "out", jobs=1)
    amounts = [row["amount"] for row in result.rows()]
    assert amounts == pytest.approx([0.0525, 0.0575, 0.0425, 0.0575], abs=1e-12)


# -------------------------------------------------------------------------------------------------- one pose for all


def near_the_slot(**more: Any) -> fo.Problem:
    """The peg, which may go 1 to either side: gaps 0.05 - right - TX and 0.1 - left + TX."""
    return peg_in_channel(limits={"TX": (-1.0, 1.0)}, **more)


def test_the_pose_with_the_least_worst_gap_has_the_closed_form() -> None:
    """With TX = -0.095 the left gap is within 0.005 of zero, as wide as its tolerance; the right one is further."""
    best = fo.best_pose(near_the_slot())
    assert best.parameters["TX"] == pytest.approx(-0.095, abs=1e-9)
    assert best.worst_gap == pytest.approx(0.005, abs=1e-9)
    assert best.certified
    assert best.lower_bound == pytest.approx(0.005, rel=2e-4)
    assert best.passed
    assert (best.least.names, best.least.sizes_text) == (("right side", "left side"), "left side +0.01")


def test_the_smallest_motion_into_a_window_has_the_closed_form() -> None:
    for window, shift in (((0.05, 0.2), -0.03), ((0.0, 0.2), 0.0), ((0.02, 0.07), 0.0), ((0.05, 0.065), -0.035)):
        best = fo.best_pose(near_the_slot(), clearance=window)
        assert best.status == "inside the window"
        assert best.parameters["TX"] == pytest.approx(shift, abs=1e-7)
        assert best.certified
        assert best.passed
        assert best.lower_bound == pytest.approx(abs(shift), rel=2e-4, abs=1e-7)


def test_a_window_that_no_pose_meets_is_proved_to_be_none() -> None:
    """The least gap is at most 0.055, in the middle."""
    best = fo.best_pose(near_the_slot(), clearance=(0.06, 1.0))
    assert best.status == "no pose"
    assert best.lower_bound == pytest.approx(0.005, rel=2e-4)
    assert best.parameters["TX"] == pytest.approx(-0.035, abs=1e-7)


@pytest.mark.slow
def test_no_pose_on_a_fine_grid_is_better_than_the_best_of_two_shifts() -> None:
    """Hulls in general position, all their faces with tolerances; poses of the grid by stack-ups of their own."""
    rng = np.random.default_rng(3)
    for _ in range(3):
        bodies = [fo.Body.convex(rng.normal(size=(7, 3)) + np.array([2.5 * k, 0, 0])) for k in range(2)]
        sizes = [
            fo.Size(f"{role}{k}", role, faces=f"F{k + 1}", tolerance=0.02)
            for role, body in zip(("movable", "static"), bodies, strict=True)
            for k in range(len(body.faces))
        ]
        limits = {"TX": (-0.5, 0.5), "TY": (-0.3, 0.3)}
        problem = fo.Problem(*bodies, sizes=sizes, motion=X >> fo.Translation("y"), goal="touch", limits=limits)
        best = fo.best_pose(problem)
        assert best.passed
        for x, y in product(np.linspace(-0.5, 0.5, 9), np.linspace(-0.3, 0.3, 7)):
            pose = np.eye(4)
            pose[:2, 3] = x, y
            worst = fo.stack_up(problem, pose=pose).worst()
            assert max(abs(worst.least), abs(worst.largest)) >= best.lower_bound - 1e-9
        here = fo.stack_up(problem, pose=best.transform).worst()
        assert max(abs(here.least), abs(here.largest)) == pytest.approx(best.worst_gap, abs=1e-9)
        assert best.certified


def test_a_turn_makes_a_peg_that_leans_fit() -> None:
    """A square peg turned by 0.1 in a channel 10 wide: straight it has 0.5 to either side, less half its tolerance."""
    c, s = np.cos(0.1), np.sin(0.1)
    corners = np.array(list(product((-4.5, 4.5), (-4.5, 4.5), (-1, 1)))) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    peg = fo.Body.convex(corners, seed=(0, 0, 0))
    faces = [{"through": tuple((corners[list(k)].mean(axis=0)).tolist())} for k in ((0, 1, 2, 3), (4, 5, 6, 7))]
    sizes = [fo.Size("width", "movable", faces=faces, each=0.5, tolerance=(0.0, 0.2))]
    motion, limits = fo.Rotation("z") >> X, {"RZ": (-0.3, 0.3), "TX": (-1, 1)}
    problem = fo.Problem(peg, channel(10.0), sizes=sizes, motion=motion, goal="touch", limits=limits)
    best = fo.best_pose(problem, clearance=(0.4 - 1e-6, 2.0))
    assert best.status == "inside the window"
    assert best.parameters["RZ"] == pytest.approx(-0.1, abs=1e-4)
    assert best.passed
    assert not best.certified


def test_the_least_worst_gap_of_a_key_was_beyond_the_slot_s_wall() -> None:
    """Against the block's outer side, 20 mm away, the position of the slot does not matter: the gaps are less there."""
    best = fo.best_pose(fo.load_problems(KEY)[2])
    least, most = 0.0625 - 0.03, 0.0625 + 0.03 + 0.018 + 0.015
    assert abs(best.parameters["TX"]) == pytest.approx((least + most) / 2.0, abs=1e-9)
    assert best.worst_gap == pytest.approx((most - least) / 2.0, abs=1e-9)
    assert best.certified


def test_clearances_are_those_of_the_stack_up() -> None:
    problem = near_the_slot()
    told = fo.clearances(problem, pose={"TX": -0.03}, count=20_000)
    assert told.range == pytest.approx((0.05, 0.07), abs=1e-12)
    assert told.interference == 0.0
    assert (told.gaps.min(), told.gaps.max()) == (pytest.approx(0.05, abs=2e-2), pytest.approx(0.07, abs=2e-2))
    assert told.box.tolist() == [[-0.02, 0.03], [0.0, 0.01]]


@pytest.mark.slow
def test_the_pose_command_tells_sizes_by_name() -> None:
    code, text, said = run("pose", KEY, "--case", "to a side, at the least gap", "--clearance", "0.03,0.1")
    assert code == 0, said
    assert "slot_position +0.03" in text
    assert "inside the window" in text


@pytest.mark.parametrize(("motion", "counted"), [("z", True), ("x", False)])
def test_the_pose_command_tells_that_it_counts_closed_contacts_which_the_motion_opens(
    motion: str, counted: bool, tmp_path: Path
) -> None:
    """A block on a floor, .1 before a wall: lifted it is nearer to nothing, so that the floor's gap of 0 is the least.

    The gaps of the pose were 0 to 0, and those "at the best pose" .07 to .13, without a word.
    """
    step = [(-9, -9), (9, -9), (9, 6), (4, 6), (4, 0), (-9, 0)]
    corners = [(x, y, z) for y in (-9, 9) for x, z in step]
    ends = [(0, 1, 4), (0, 4, 5), (1, 2, 3), (1, 3, 4)]
    triangles = [*ends, *((c + 6, b + 6, a + 6) for a, b, c in ends)]
    for k, after in zip(range(6), (1, 2, 3, 4, 5, 0), strict=True):
        triangles += [(after, k, 6 + after), (k, 6 + k, 6 + after)]
    lines = [*("v {} {} {}".format(*own) for own in corners), *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles)]
    (tmp_path / "floor.obj").write_text("\n".join(lines))
    block = [[*own] for own in product((-4.0, 3.9), (-4.0, 4.0), (0.0, 4.0))]
    (tmp_path / "block.toml").write_text(
        f'[bodies.movable]\nname = "block"\nunit = "mm"\nvertices = {block}\n'
        '[bodies.static]\nname = "floor"\nfile = "floor.obj"\nunit = "mm"\n'
        '[[size]]\nname = "place"\nbody = "static"\nfaces = { through = [4.0, 0.0, 2.0] }\ntolerance = 0.03\n'
        f'[[case]]\nname = "lift"\nmade = {{}}\ngoal = "clear"\nmotion = [{{ translation = "{motion}" }}]\n'
    )
    code, text, said = run("pose", tmp_path / "block.toml", "--clearance", "middle")
    assert code == 0, said
    text = " ".join(text.split())
    assert ("counted in the pose, whose motion opens them" in text) == counted, text


def test_the_least_interference_of_a_round_pin_was_not_proved() -> None:
    """A pin thicker than its bore by .029 at most overlaps by half of that in the middle, and nowhere less."""
    plate = fo.cut(fo.Box((30.0, 30.0, 8.0)), fo.Cylinder(6.0, 20.0, base=(0.0, 0.0, -10.0)), name="plate")
    pin = fo.Cylinder(6.0, 20.0, base=(0.0, 0.0, -10.0), name="pin")
    shank = fo.Size("shank", "movable", faces="cylinder radius 6", each=0.5, tolerance=(0.018, 0.029))
    bore = fo.Size("bore", "static", faces="bore radius 6", each=-0.5, tolerance=(0.0, 0.018))
    motion = fo.Translation("x") >> fo.Translation("z")
    found = fo.best_pose(fo.Problem(pin, plate, sizes=[shank, bore], motion=motion, goal="touch"))
    assert found.value == pytest.approx(0.0145, abs=1e-7)
    assert found.lower_bound == pytest.approx(found.value, abs=1e-7)
    assert found.certified
    assert fo.verify(found, proof=True)


def test_what_takes_limits_for_a_proof_of_shifts_is_said() -> None:
    """A saddle on its vee is as good off it: between limits that keep it there the pose is proved."""
    ridge = fo.Prism([(-10, -10), (10, -10), (0, 0)], 40.0, axis="y", name="ridge")
    around = [(-10, -10), (-12, -10), (-12, 8), (12, 8), (12, -10), (10, -10), (0, 0)]
    saddle = fo.Prism(around, 40.0, axis="y", name="saddle")
    rows = [k for k, n in enumerate(ridge.face_planes[0], 1) if 0.5 < abs(n[0]) < 0.9]
    flanks = [fo.Size(f"flank {k}", "static", faces=f"F{k}", tolerance=(0.0, 0.02)) for k in rows]
    motion = fo.Translation("x") >> fo.Translation("z")
    asked = fo.Problem(saddle, ridge, sizes=flanks, motion=motion, goal="touch")
    found = fo.best_pose(asked)
    assert found.value == pytest.approx(0.01, abs=1e-7)
    assert not found.certified
    assert "no bound proved: that takes limits" in str(found)
    near = fo.best_pose(asked.changed(limits=dict.fromkeys(("TX", "TZ"), (-1.0, 1.0))))
    assert (near.value, near.lower_bound) == pytest.approx((0.01, 0.01), abs=1e-6)
    assert near.certified
