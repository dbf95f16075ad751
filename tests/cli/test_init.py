"""`init`: the file that it writes loads and solves, wherever the parts are; `schema`: files are checked by it."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import tomllib
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jsonschema
import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt import load_problems, pacing, solve
from fcdm_opt.cli import app
from fcdm_opt.curve.features import Feature
from fcdm_opt.design.study.schema import DIALECT, KINDS, json_schema
from fcdm_opt.drafting.choice import TOLERANCE, named
from fcdm_opt.drafting.draft import _why_not, draft, short, state_text, widths
from fcdm_opt.drafting.situation import Situation
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.problem.keys import ProblemFile
from fcdm_opt.problem.problem import GOALS, SIGNS

PROBLEMS = Path(__file__).parents[2] / "problems"
MESHES = PROBLEMS / "meshes"
CUBE = "OFF\n8 6 0\n{}\n4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n"


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


def box(path: Path, sides: tuple[float, float, float], middle: tuple[float, float, float], turn: Any = None) -> Path:
    """Write a box as an OFF file."""
    corners = np.array([(x, y, z) for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]) * sides
    corners = corners if turn is None else corners @ np.transpose(turn)
    path.write_text(CUBE.format("\n".join(" ".join(map(repr, row)) for row in (corners + middle).tolist())))
    return path


def drafted(movable: Path, static: Path, folder: Path) -> tuple[str, Path]:
    """Write the draft of two meshes, and return its text and its path."""
    path = folder / "p.toml"
    text = draft(movable, static, file=path).text
    path.write_text(text)
    return text, path


def _table(lines: list[str], k: int) -> int:
    """Return the line in which the table begins that line k stands in."""
    return max((j for j, own in enumerate(lines[:k]) if own.startswith("[")), default=0)


# a cube of side 10 on a table 4 thick, whose seeds are their middles: for sizes (1 + s, 1 + t) the gap changes by
# -5 s - 2 t, so that TZ = 5 s + 2 t - gap brings them together
PLACES = {"touching": 0.0, "apart": 3.0, "overlapping": -1.0}


@pytest.mark.parametrize(("state", "unit"), [*zip(PLACES, [1000.0, 1.0, 1e-5], strict=True)])
def test_a_cube_on_a_table_solves_as_written(tmp_path: Path, state: str, unit: float) -> None:
    gap, away = PLACES[state] * unit, 1e3 * unit  # far from the origin too
    cube = box(tmp_path / "cube.off", (10 * unit,) * 3, (away, 0.0, 5 * unit + gap))
    table = box(tmp_path / "table.off", (40 * unit, 40 * unit, 4 * unit), (away, 0.0, -2 * unit))
    text, path = drafted(cube, table, tmp_path)
    goals = {"touching": "seat", "apart": "touch", "overlapping": "clear"}
    assert "NOT SOLVED" not in text
    for problem in load_problems(path):
        solution = solve(problem)
        s, t = (TOLERANCE * sign for sign in SIGNS[str(problem.requirement)])
        assert problem.goal == goals[state]
        assert solution.usable
        assert solution.parameters == pytest.approx({"TZ": unit * (5 * s + 2 * t) - gap}, abs=1e-8 * unit)


def test_what_is_said_of_the_state_agrees_with_the_closed_form(tmp_path: Path) -> None:
    for state, gap in PLACES.items():
        cube = Body.from_file(box(tmp_path / "cube.off", (10.0,) * 3, (0.0, 0.0, 5 + gap)), unit="mm")
        table = Body.from_file(box(tmp_path / "table.off", (40.0, 40.0, 4.0), (0.0, 0.0, -2.0)), unit="mm")
        found = Situation(cube, table)
        assert (found.state, found.gap) == (state, pytest.approx(gap, abs=1e-12))
        assert found.growth == pytest.approx((7 + gap) / 7)  # 5 rho + 2 rho = 7 + gap
        assert found.normal == pytest.approx([0, 0, -1])
        near = found.nearest
        assert near is not None
        # the foot of the perpendicular from (1, 1) to 5 rho_1 + 2 rho_2 = 7 + gap
        assert near.pair == pytest.approx([1 + 5 * gap / 29, 1 + 2 * gap / 29])


def test_contacts_that_exclude_each_other_were_not_named() -> None:
    """A step 10 and 2 from the seeds along x, 2 % smaller before walls 2 % larger: .4 to one, .08 to the other."""
    step = Body.from_parts([[*product((-4, x), y, (0, 5))] for x, y in ((10, (-4, 0)), (2, (0, 4)))], seed=(0, 0, 0))
    walls = Body.from_parts([[*product((x, 14), y, (0, 5))] for x, y in ((10, (-4, 0)), (2, (0, 4)))], seed=(0, 0, 0))
    motion, given = fo.Translation("x"), {"goal": "seat", "contacts": "all", "tolerance": 0.02, "nominal": "drawn"}
    solution = solve(fo.Problem(step, walls, motion=motion, requirement="C", **given))
    assert not solution.usable
    why = _why_not(solution)
    assert "right face of body, face 2 (facing -x) of body are 0.16 apart" in why
    assert "face 8 (facing +x) of body, left face of body overlap by 0.16" in why


@pytest.mark.parametrize("factor", [10.0, 25.4, 1000.0])
def test_a_part_in_another_unit_than_the_other_is_asked_about(tmp_path: Path, factor: float) -> None:
    """A peg in cm, inches or m beside a plate in mm, of like size: 25.4 was below the ratio that is asked about."""
    peg = box(tmp_path / "peg.off", (10 / factor, 10 / factor, 30 / factor), (0.0, 0.0, 25 / factor))
    plate = box(tmp_path / "plate.off", (24.0, 24.0, 6.0), (0.0, 0.0, -3.0))
    text = " ".join(drafted(peg, plate, tmp_path)[0].replace("#", " ").split())
    assert "is one mesh in another unit (cm beside mm are 10; inches beside mm are 25.4; m beside mm are 1000)?" in text
    alike = box(tmp_path / "alike.off", (10.0, 10.0, 30.0), (0.0, 0.0, 15.0))
    assert "in another unit (cm" not in drafted(alike, plate, tmp_path)[0]


def test_tilted_far_and_unlike_parts_are_told_and_solved(tmp_path: Path) -> None:
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    tilted = box(tmp_path / "tilted.off", (1.0, 1.0, 1.0), (0.0, 0.0, 500.0), turn)
    table = box(tmp_path / "table.off", (190.0, 190.0, 4.0), (0.0, 0.0, -2.0))
    text, path = drafted(tilted, table, tmp_path)
    assert "times as large as the other" in text
    assert "WARNING: the parts are" not in text
    assert all(solve(problem).usable for problem in load_problems(path))
    far = box(tmp_path / "far.off", (1.0, 1.0, 1.0), (0.0, 0.0, 5000.0))
    assert "are both drawn in one frame?" in drafted(far, table, tmp_path)[0]


def test_a_block_in_a_corner_of_three_walls_is_to_touch_them_all(tmp_path: Path) -> None:
    import trimesh

    block = box(tmp_path / "block.off", (2.0, 2.0, 2.0), (1.0, 1.0, 1.0))
    corner = trimesh.creation.box(bounds=[[-1, -1, -1], [5, 5, 5]])
    corner = trimesh.boolean.difference([corner, trimesh.creation.box(bounds=[[0, 0, 0], [6, 6, 6]])])
    corner.export(tmp_path / "corner.stl")
    text, path = drafted(block, tmp_path / "corner.stl", tmp_path)
    assert '\ngoal = "seat"' in text
    assert '\ncontacts = "all"' in text
    seed = float(Body.from_file(tmp_path / "corner.stl", unit="mm").seed[0])
    for problem, (one, two) in zip(load_problems(path), ((1, 1), (1, -1), (-1, 1), (-1, -1)), strict=True):
        # the block's face at 0 moves to 1 - (1 + 0.02 one), the wall there to seed - seed (1 + 0.02 two)
        shift = 0.02 * (one - two * seed)
        assert list(solve(problem).parameters.values()) == pytest.approx([shift] * 3, rel=1e-9)


@pytest.mark.parametrize("play", [0.0, 0.1])
def test_a_case_that_fits_under_no_motion_took_a_contact_from_the_others(tmp_path: Path, play: float) -> None:
    """A plug on floor and wall of its pocket: larger by 2 % in one smaller by 2 % it is wider than that."""
    import trimesh

    plug = box(tmp_path / "plug.off", (12.0, 8.0, 20.0), (6.0, 0.0, 10.0))
    block = trimesh.creation.box(bounds=[[-10, -15, -10], [22 + play, 15, 15]])
    pocket = trimesh.creation.box(bounds=[[0, -5, 0], [12 + play, 5, 30]])
    trimesh.boolean.difference([block, pocket]).export(tmp_path / "socket.off")
    text, path = drafted(plug, tmp_path / "socket.off", tmp_path)
    assert '\ncontacts = "all"' in text or not play
    solved = [solve(problem) for problem in load_problems(path)]
    # the width is 12 (1 +- 0.02), that of the room (12 + play) (1 -+ 0.02)
    fits = [12 * (1 + one) <= (12 + play) * (1 + two) for one, two in product((0.02, -0.02), (0.02, -0.02))]
    assert [own.usable for own in solved] == fits
    if play:
        assert "restore them all in every case but B, in which the parts do not fit" in text
        seed = Body.from_file(tmp_path / "socket.off", unit="mm").seed
        for own, (one, two) in zip(solved, product((1, -1), (1, -1)), strict=True):
            if own.usable:
                least = [0.02 * (one * 6 - two * seed[0]), 0.0, 0.02 * (one * 10 - two * seed[2])]
                assert [*own.parameters.values()] == pytest.approx(least, abs=1e-9)


def test_shoulders_that_are_all_kept_were_said_not_to_be_restored_all(tmp_path: Path) -> None:
    """A tongue in its groove, with a shoulder on either side: both face one way."""
    import trimesh

    def block(*bounds: Any) -> Any:
        return trimesh.creation.box(bounds=bounds)

    rail = block((-25, -40, -20), (25, 40, 0)).difference(block((-6.1, -50, -6.3), (6.1, 50, 10)))
    slide = block((-20, -25, 0), (20, 25, 10)).union(block((-6, -25, -6), (6, 25, 1)))
    for name, mesh in (("rail", rail), ("slide", slide)):
        mesh.export(tmp_path / f"{name}.off")
    text, _ = drafted(tmp_path / "slide.off", tmp_path / "rail.off", tmp_path)
    assert "the parts touch at 2 places, all of which face one way and are to touch again, and along" in text
    assert "no shift restores all of them" not in text


def test_a_drawer_that_fills_its_cabinet_is_seated_on_its_floor(tmp_path: Path) -> None:
    # it cannot stay on all four walls, and "seat" where all their lines meet made a smaller one impossible
    import trimesh

    block = box(tmp_path / "drawer.off", (20.0, 10.0, 8.0), (0.0, 0.0, 6.0))
    hull, room = trimesh.creation.box((24.0, 10.0, 12.0)), trimesh.creation.box((20.0, 12.0, 8.0))
    cabinet = trimesh.boolean.difference([hull, room]).apply_translation([0.0, 0.0, 6.0])
    cabinet.export(tmp_path / "cabinet.stl")
    text, path = drafted(block, tmp_path / "cabinet.stl", tmp_path)
    assert "at 4 places, no shift restores all of them" in text
    found = {problem.requirement: solve(problem) for problem in load_problems(path)}
    # both seeds at height 6, both faces 4 below: the floor goes down by 4 t, the block's bottom by 4 s
    for letter, (s, t) in SIGNS.items():
        if letter != "B":
            assert found[letter].usable
            assert found[letter].parameters["TZ"] == pytest.approx(0.02 * 4 * (s - t), abs=1e-12)
    assert not found["B"].usable  # it does not fit between the walls


def test_parts_in_the_same_place_can_be_taken_apart(tmp_path: Path) -> None:
    cube = box(tmp_path / "cube.off", (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
    text, path = drafted(cube, cube, tmp_path)
    assert "screw" not in text  # the seeds define no axis
    assert all(solve(problem).usable for problem in load_problems(path))


@pytest.mark.parametrize(
    ("movable", "static", "goal"),
    [("keyway_key.off", "keyway_shaft.ply", "seat"), ("bracket.obj", "bracket_plate.stl", "touch")],
)
def test_meshes_that_are_no_boxes_solve_as_written(tmp_path: Path, movable: str, static: str, goal: str) -> None:
    out = tmp_path / "own.toml"
    result = run("init", MESHES / movable, MESHES / static, "--out", out)
    assert result.exit_code == 0
    assert result.stderr.strip().splitlines()[-1] == f"wrote {out}"  # the machine may be busy, which is told
    assert result.stdout.splitlines()[-1] == f"next: fcdm-opt solve {out}"
    (document,) = json.loads(run("solve", out, "--json").stdout)["files"]
    assert [case["usable"] for case in document["cases"]] == [True] * 4
    assert {case["problem"]["case"][0]["goal"] for case in document["cases"]} == {goal}


def test_every_alternative_that_is_offered_is_allowed(tmp_path: Path) -> None:
    """Each commented key, taken in place of the one above it, is a problem that can be read; blocks as a whole."""
    cube = box(tmp_path / "cube.off", (10.0,) * 3, (18.0, 0.0, 8.0))
    table = box(tmp_path / "table.off", (11.0, 40.0, 4.0), (0.0, 0.0, -2.0))
    text, path = drafted(cube, table, tmp_path)
    lines, tried = text.splitlines(), 0
    for k, line in enumerate(lines):
        key = re.match(r"#([a-z_]+) = ", line)
        if key is None or any(own.startswith("#[[") for own in lines[max(0, k - 5) : k]):
            continue
        asked = {line: key.group(1)}
        if key.group(1) == "limits" and lines[k - 1].startswith("#motion"):
            asked[lines[k - 1]] = "motion"
        if any(f'"{goal}"' in line for goal in ("at", "seat")):
            asked[next(own for own in lines if own.startswith("#nominal = ["))] = "nominal"
        if '"beyond"' in line:
            asked[next(own for own in lines if re.match(r"#nominal = \d", own))] = "nominal"
        replaced = re.compile(f"({'|'.join(asked.values())}) = ")
        kept = [
            own[1:] if own in asked and _table(lines, j) == _table(lines, k) else own
            for j, own in enumerate(lines)
            if not (replaced.match(own) and _table(lines, j) == _table(lines, k))
        ]
        path.write_text("\n".join(kept))
        if key.group(1) != "pair":
            load_problems(path)
        tried += 1
    for name in ("keep_out", "size"):
        block = re.search(rf"^#\[\[{name}\]\].*(\n#\w.*)+", text, re.MULTILINE)
        assert block is not None
        ProblemFile.model_validate(tomllib.loads(text.replace(block.group(), block.group().replace("\n#", "\n")[1:])))
    assert tried >= 18
    assert len(lines) <= 125  # they were 170, and of a flange with its holes 227; six sizes are blocks of six


def test_names_of_all_kinds_and_paths_from_the_file(tmp_path: Path) -> None:
    odd = 'it\'s "odd" ü\\n'
    for folder in (tmp_path / odd, tmp_path / "deep" / "er"):
        folder.mkdir(parents=True)
    cube = box(tmp_path / odd / f"~{odd}.off", (1.0, 1.0, 1.0), (0.0, 0.0, 0.5))
    table = box(tmp_path / odd / "tab\tle.off", (4.0, 4.0, 1.0), (0.0, 0.0, -0.5))
    path = tmp_path / "deep" / "er" / "p.toml"
    path.write_text(draft(cube, table, file=path).text)
    assert tomllib.loads(path.read_text())["bodies"]["movable"]["file"] == f"../../{odd}/~{odd}.off"
    assert load_problems(path)[0].movable.name == f"~{odd}"
    beside = tmp_path / odd / "p.toml"
    beside.write_text(draft(cube, table, file=beside).text)
    assert len(load_problems(beside)) == len(SIGNS)  # "~" is no home folder there


def test_nothing_is_overwritten_unless_asked_and_never_a_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    box(tmp_path / "a.off", (1.0, 1.0, 1.0), (0.0, 0.0, 0.5))
    box(tmp_path / "b.off", (4.0, 4.0, 1.0), (0.0, 0.0, -0.5))
    (tmp_path / "a-b.toml").write_text("mine")
    refused = run("init", "a.off", "b.off")
    assert (refused.exit_code, "--force" in refused.stderr) == (2, True)
    assert (tmp_path / "a-b.toml").read_text() == "mine"
    assert run("init", "a.off", "b.off", "--force").exit_code == 0
    assert load_problems("a-b.toml")
    os.link("a.off", "a.toml")
    for out in ("a.toml", "b.off", "."):
        assert run("init", "a.off", "b.off", "--out", out, "--force").exit_code == 2
    assert (tmp_path / "b.off").read_text().startswith("OFF")
    assert run("init", "a.off", "b.off", "--unit", "parsec").exit_code == 2


def test_a_mesh_that_is_no_solid_is_named_and_nothing_is_written(tmp_path: Path) -> None:
    cube = box(tmp_path / "cube.off", (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
    open_ = tmp_path / "open.off"
    open_.write_text(cube.read_text().replace("8 6 0", "8 5 0").replace("4 1 3 7 5\n", ""))
    out = tmp_path / "new" / "p.toml"
    result = run("init", cube, open_, "--out", out)
    assert result.exit_code == 2
    assert f"error: {open_}: body 'open': the surface is not closed" in result.stderr
    assert not out.parent.exists()
    assert run("init", cube, tmp_path / "none.stl", "--out", out).exit_code == 2


def test_a_name_that_looks_like_an_option_or_has_spaces_can_be_solved_as_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was said to do next took "-dash.toml" for options, and the file's own comments "a b.toml" for two files."""
    monkeypatch.chdir(tmp_path)
    box(tmp_path / "-a b.off", (1.0, 1.0, 1.0), (0.0, 0.0, 0.5))
    box(tmp_path / "b.off", (4.0, 4.0, 1.0), (0.0, 0.0, -0.5))
    said = run("init", "--", "-a b.off", "b.off")
    assert said.exit_code == 0
    told = said.stdout.splitlines()[-1].removeprefix("next: ")
    noted = Path("-a b-b.toml").read_text().splitlines()[2].removeprefix("#").split("   the")[0].strip()
    assert shlex.split(told) == shlex.split(noted) == ["fcdm-opt", "solve", "./-a b-b.toml"]
    assert run(*shlex.split(told)[1:]).exit_code == 0


def test_directions_were_written_with_sixteen_digits() -> None:
    for slope, told in (((-3, 0, 4), (-0.75, 0.0, 1.0)), ((5, 5, 0), (1.0, 1.0, 0.0)), ((-1e-15, -2, 0), "y")):
        assert named(np.array(slope) / np.linalg.norm(slope)) == told
    odd = named(axis := np.array([-math.cos(0.2), math.sin(0.2), 0.0]))
    assert odd == (-1.0, round(math.tan(0.2), 12), 0.0)
    assert np.allclose(odd / np.linalg.norm(odd), axis, rtol=0.0, atol=1e-12)


def test_a_link_to_nothing_was_overwritten_unasked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    box(tmp_path / "a.off", (1.0, 1.0, 1.0), (0.0, 0.0, 0.5))
    Path("link.toml").symlink_to("nothing.toml")
    assert run("init", "a.off", "a.off", "--out", "link.toml").exit_code == 2
    assert Path("link.toml").is_symlink()
    same = run("init", "a.off", "./a.off", "--out", "x.toml")  # a part was made to fit itself without a word
    assert (same.exit_code, "both parts are of the same file" in same.stderr) == (2, True)
    box(tmp_path / "b.off", (1.0, 1.0, 1.0), (0.0, 0.0, 1.5))
    refused = run("init", "a.off", "b.off", "--out", "a.off/x.toml")
    assert (refused.exit_code, "a.off/x.toml: the file cannot be written" in refused.stderr) == (2, True)


def test_what_is_not_looked_at_is_not_denied_and_what_is_deepest_is_said(tmp_path: Path) -> None:
    """Far apart, growth is beyond the scales looked at: 20 rho = 1e4; in a U, what overlaps is a pair of parts."""
    far = box(tmp_path / "far.off", (10.0,) * 3, (1e4, 0.0, 0.0))
    cube = box(tmp_path / "cube.off", (30.0, 30.0, 30.0), (0.0, 0.0, 0.0))
    text, path = drafted(far, cube, tmp_path)
    assert "both made 0.02 to 50 times as large, they never just touch" in text
    assert len(load_problems(path)) == len(SIGNS)
    two = tmp_path / "two.off"  # two boxes beside each other
    left = box(two, (2.0, 2.0, 2.0), (-3.0, 0.0, 0.0)).read_text().splitlines()
    right = box(two, (2.0, 2.0, 2.0), (3.0, 0.0, 0.0)).read_text().splitlines()
    rows = [[4, *(int(v) + 8 for v in row.split()[1:])] for row in right[10:]]
    two.write_text(
        "\n".join(["OFF", "16 12 0", *left[2:10], *right[2:10], *left[10:]])
        + "\n"
        + "\n".join(" ".join(map(str, row)) for row in rows)
    )
    small = box(tmp_path / "small.off", (2.0, 2.0, 2.0), (3.0, 0.0, 1.5))
    assert "overlap by 0.5 mm: no shorter shift takes them apart" in drafted(two, small, tmp_path)[0]


def test_the_label_of_a_round_face_filled_a_page(tmp_path: Path) -> None:
    turns = [(np.cos(t), np.sin(t)) for t in np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False).tolist()]
    points = [(x, y, z) for z in (0.0, 5.0) for x, y in turns]
    rows = [[*range(63, -1, -1)], [*range(64, 128)], *([k, (k + 1) % 64, (k + 1) % 64 + 64, k + 64] for k in range(64))]
    peg = tmp_path / "peg.off"
    peg.write_text(
        "\n".join(["OFF", "128 66 0", *(" ".join(map(repr, map(float, p))) for p in points)])
        + "\n"
        + "\n".join(" ".join(map(str, [len(row), *row])) for row in rows)
    )
    table = box(tmp_path / "table.off", (4.0, 4.0, 1.0), (0.0, 0.0, -0.5))
    made = draft(peg, table, file=tmp_path / "p.toml")
    assert max(map(len, [*made.text.splitlines(), *made.summary])) <= 200
    assert "touch: bottom face (facing -z) of peg at top face (facing +z) of table" in made.text


def wedge(path: Path, lift: float) -> Path:
    """Write a wedge of 90 degrees, its edge down, that much above a V-block of 90 degrees: float32, as STL has it."""
    corners = [(0, 15 + lift), (10, 25 + lift), (10, 40), (-10, 40), (-10, 25 + lift)]
    return prism(path, corners, [(0, 1, 4), (1, 2, 3), (1, 3, 4)], (5, 35))


def vee(path: Path) -> Path:
    corners = [(-30, 0), (30, 0), (30, 30), (15, 30), (0, 15), (-15, 30), (-30, 30)]
    return prism(path, corners, [(0, 1, 4), (1, 2, 3), (1, 3, 4), (0, 4, 5), (0, 5, 6)], (0, 40))


def prism(path: Path, corners: Any, cut: Any, ends: tuple[float, float]) -> Path:
    """Write a prism along y, of a polygon in x and z and its triangles, as binary STL."""
    y0, y1 = ([(x, y, z) for x, z in corners] for y in ends)
    sides = [(y0[k - 1], y0[k], y1[k], y1[k - 1]) for k in range(len(corners))]
    faces = [
        *([y0[a], y0[b], y0[c]] for a, b, c in cut),
        *([y1[a], y1[c], y1[b]] for a, b, c in cut),
        *([a, c, b] for a, b, c, _ in sides),
        *([a, d, c] for a, _, c, d in sides),
    ]
    rows = np.zeros(len(faces), dtype=[("n", "<f4", 3), ("t", "<f4", (3, 3)), ("more", "<u2")])
    rows["t"] = faces
    path.write_bytes(bytes(80) + len(faces).to_bytes(4, "little") + rows.tobytes())
    return path


def test_a_wedge_drawn_a_little_above_its_block_is_told_how_to_meet_it(tmp_path: Path) -> None:
    """Its flanks are lift / sqrt(2) from those of the block: moved by that along a normal, one of them touches."""
    lift = 0.05123457  # more digits than single precision keeps: rounding tilts no flank
    block = vee(tmp_path / "block.stl")
    path = tmp_path / "p.toml"
    made = draft(wedge(tmp_path / "wedge.stl", lift), block, file=path)
    said = "\n".join(made.summary)
    told = re.search(r"\(CAD\) by \[(.*)\] mm: the shortest way, (.*) mm along", said)
    assert told is not None
    shift = np.array([float(x) for x in told.group(1).split(",")])
    length = float(told.group(2))
    assert length == pytest.approx(np.linalg.norm(shift), rel=4e-6) == pytest.approx(lift / 2**0.5, rel=1e-4)
    assert np.abs(shift) == pytest.approx([lift / 2, 0.0, lift / 2], rel=1e-4)
    one, two = (Body.from_file(tmp_path / f"{name}.stl", unit="mm") for name in ("wedge", "block"))
    pose = np.eye(4)
    pose[:3, 3] = shift
    assert Situation(one.moved(pose), two).state == "touching"
    # what else the file says: sizes are no places, all five goals, two flanks alike
    assert "other nominal SIZES" in made.text
    (snap,) = re.findall(r"^#snap = (\S+)", made.text, re.MULTILINE)
    path.write_text(made.text.replace("#snap", "snap").replace('goal = "touch"', 'goal = "at"', 1))
    assert load_problems(path)[0].snapped is not None
    moved = np.abs(load_problems(path)[0].snapped.pair - 1.0).max()  # of either size, more than the gap's share
    assert 2 * float(told.group(2)) / two.size < float(snap) == pytest.approx(2 * moved, rel=0.1)
    assert {*re.findall(r'^#? ?goal =? ?"(\w+)"', made.text, re.MULTILINE)} == {*GOALS}
    assert "practically face on face" not in said
    assert said.splitlines()[-1] == "another motion is as small in C, D"
    assert made.text.count("Another motion is as small") == 2
    assert not re.search(r"\de-1\d", made.text)


def test_faces_that_are_parallel_or_meant_to_be_tilted_are_not_said_to_be_nearly_so(tmp_path: Path) -> None:
    table = box(tmp_path / "table.off", (40.0, 40.0, 4.0), (0.0, 0.0, -2.0))
    for angle, nearly in ((0.0, False), (1e-6, True), (1e-3, False)):
        turn = [[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [-np.sin(angle), 0.0, np.cos(angle)]]
        cube = box(tmp_path / "cube.off", (10.0,) * 3, (0.0, 0.0, 8.0), np.array(turn))
        tilt = Situation(*(Body.from_file(own, unit="mm") for own in (cube, table))).tilt
        assert tilt == (pytest.approx(angle, rel=1e-6) if nearly else None)


def test_the_box_shows_the_sizes_made_and_holds_what_is_offered(tmp_path: Path) -> None:
    """It was [0.8, 3] for parts good within 2 %: the pictures were empty."""
    table = box(tmp_path / "table.off", (40.0, 40.0, 4.0), (0.0, 0.0, -2.0))
    boxes = {}
    for gap in (0.0, 0.02, 3.0, 300.0):
        cube = box(tmp_path / "cube.off", (10.0,) * 3, (0.0, 0.0, 5.0 + gap))
        found = Situation(*(Body.from_file(own, unit="mm") for own in (cube, table)))
        boxes[gap] = found.box
        for near in (found.nearest, found.grown):
            assert near is not None
            assert all(low < scale < high for scale, (low, high) in zip(near.pair, found.box, strict=True))
    assert boxes[0.0] == boxes[0.02] == ((0.9, 1.1), (0.9, 1.1))
    assert boxes[300.0][0][1] > 43.8  # 7 rho = 307, both alike


def test_nothing_was_said_while_a_mesh_was_read_for_minutes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    box(tmp_path / "a.off", (1.0, 1.0, 1.0), (0.0, 0.0, 0.5))
    stages: list[str] = []
    with pacing.listening(lambda text, done, total: stages.append(text)):
        draft("a.off", "a.off", file="p.toml")
    reading = "reading a.off and cutting it into convex parts"
    assert stages.count(reading) == 2
    later = stages[stages.index("looking where the parts are: 16 corners") + 1 :]
    assert later[0].startswith('trying goal "clear" with the motion TX')


# --------------------------------------------------------------------------------------------------------------- schema


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "result"])
def test_the_schema_is_one_and_takes_all_files_that_are_here(kind: str) -> None:
    schema = json.loads(run("schema", "--what", kind).stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["$schema"] == DIALECT
    assert schema["$id"].startswith("urn:")
    assert schema["title"]
    assert '"null"' not in json.dumps(schema)  # TOML has no such value
    folder, least = {"problem": ("", 5), "study": ("studies", 5), "assembly": ("assemblies", 1)}[kind]
    files = sorted((PROBLEMS / folder).glob("*.toml"))
    assert len(files) >= least
    check = jsonschema.Draft202012Validator(schema)
    for file in files:
        data = tomllib.loads(file.read_text())
        check.validate(data)
        assert not check.is_valid({**data, "nominall": 1}), file
        assert not check.is_valid({**data, "title": 1}), file


def test_the_schema_of_results_takes_what_solve_writes() -> None:
    schema = json.loads(run("schema", "--what", "result").stdout)
    check = jsonschema.Draft202012Validator(schema)
    check.check_schema(schema)
    files = ["bracket_stuck.toml", "example1.toml", "assemblies/loop_of_four.toml", "none.toml"]
    for told in (files[:2], [*files[2:], "--certify"]):
        asked = (str(PROBLEMS / own) if "." in own else own for own in told)
        document = json.loads(run("solve", "--json", *asked).stdout)
        check.validate(document)
        case = document["files"][0]["cases"][0]
        for name, wrong in (("amount", "much"), ("status", "DONE"), ("certificate", [])):
            kept, case[name] = case[name], wrong
            assert not check.is_valid(document), name
            case[name] = kept


def test_an_unknown_kind_of_file_is_refused() -> None:
    assert run("schema", "--what", "recipe").exit_code == 2
    with pytest.raises(InputError, match="allowed: problem, study"):
        json_schema("recipe")


def test_the_thickness_of_a_flange_was_not_offered_as_a_size() -> None:
    """Distances between faces that do not lie over one another were, since they were larger."""
    blocks = [trimesh.creation.box(bounds=ends) for ends in (((-5, -5, -8), (5, 5, 4)), ((-8, -8, 0), (8, 8, 4)))]
    offered = {what for _, _, what, _ in widths(Body.from_mesh(trimesh.boolean.union(blocks)))}
    distances = ("x", 16), ("y", 16), ("z", 12), ("x", 10), ("y", 10), ("z", 4)
    assert offered == {f"-{axis} and +{axis}, {width} of material," for axis, width in distances}


def test_sizes_across_slanted_faces_were_told_by_numbers_alone() -> None:
    """ "(-0.8536, -0.521, 0) and (0.8536, 0.521, 0)": which faces these are, and their direction to 3 digits."""
    turn, angle = np.eye(4), math.radians(31.4)
    turn[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    bar = fo.Box((10, 6, 4), name="bar").moved(turn)
    long = next(what for _, _, what, _ in widths(bar) if ", 10 of" in what)
    look = r"F\d \(facing -x and -y\)", r"F\d \(facing \+x and \+y\)"
    told = re.fullmatch(r"across the slanted faces (.*) and (F.*), along (.*), 10 of material,", long)
    assert told is not None
    for place, facing in zip(sorted((told[1], told[2]), key=lambda own: "+x" in own), look, strict=True):
        assert re.fullmatch(facing, place)
    assert told[3] == "(0.854, 0.521, 0)"


def test_the_width_of_a_t_slot_was_not_offered_as_a_size() -> None:
    """Its walls are nearer to the block's outsides than to each other: only these distances were."""
    block, *cuts = (
        trimesh.creation.box(bounds=ends)
        for ends in (((-20, -15, 0), (20, 15, 16)), ((-7, -16, 5), (7, 16, 10)), ((-4, -16, 9), (4, 16, 17)))
    )
    sizes = widths(Body.from_mesh(trimesh.boolean.difference([block, *cuts])))
    assert {"+x and -x, 14 of room,", "+x and -x, 8 of room,", "-z and +z, 5 of room,"} <= {own[2] for own in sizes}
    named = [(re.sub(" to |, ", " ", name), f"{what[1]} gap {' '.join(faces)}") for faces, name, what, _ in sizes]
    assert sum(own == expected for own, expected in named) == 3  # "static F3-F10" said nothing to an engineer


def test_of_all_sizes_but_the_first_only_a_line_was_offered(tmp_path: Path) -> None:
    """The # taken away before their lines, all sizes of a block in a channel are sizes of the problem."""
    for name, ends in {"block": [((-4, -9, 0), (4, 9, 6))], "wall": [((-9, -9, -5), (9, 9, 0))]}.items():
        trimesh.boolean.union([trimesh.creation.box(bounds=own) for own in ends]).export(tmp_path / f"{name}.stl")
    run("init", tmp_path / "block.stl", tmp_path / "wall.stl", "--unit", "mm", "--out", tmp_path / "own.toml")
    text = (tmp_path / "own.toml").read_text("utf-8")
    start, end = text.index("#[[size]]"), text.index("#[[keep_out]]")
    offered = text[start:end].count("#[[size]]")
    assert offered == 6  # three widths of either
    assert "another [[size]]" not in text
    opened = re.sub(r"(?m)^#(?=[\[a-z])", "", text[start:end])
    (tmp_path / "own.toml").write_text(text[:start] + opened + text[end:], encoding="utf-8")
    assert len(fo.load_problems(tmp_path / "own.toml")[0].sizes) == offered


def test_one_lip_of_a_t_slot_was_offered_as_a_size_and_the_other_stayed() -> None:
    """Coplanar faces that look one way are made in one go: a size has all of them, and both lips grow with it."""
    ends = ((-20, -15, 0), (20, 15, 16)), ((-7, -16, 5), (7, 16, 10)), ((-4, -16, 9), (4, 16, 17))
    block, *cuts = (trimesh.creation.box(bounds=own) for own in ends)
    slot = Body.from_mesh(trimesh.boolean.difference([block, *cuts]))
    faces, name, _, each = next(own for own in widths(slot) if own[2] == "+z and -z, 6 of material,")
    assert (len(faces), name.count(","), each) == (4, 2, 0.5)
    size = fo.Size(name, body="static", faces=faces, each=each)
    cube = fo.Box((1, 1, 1), centre=(0, 0, 40))
    motion = fo.Translation("z")
    made = fo.Problem(cube, slot, goal="touch", motion=motion, sizes=[size], made={name: 0.5}).static
    # two lips, of 16 x 6 and 13 x 6 before, over a slot 14 wide, 5 high, in a block of 40 x 16: all 30 long
    volume = np.linalg.det(made.face_triangles[0]).sum() / 6.0
    assert volume == pytest.approx(30 * (40 * 16.25 - 14 * 4.75 - 8 * 6.5), rel=1e-12)


def test_a_pin_with_play_in_its_bore_was_to_touch_anywhere(tmp_path: Path) -> None:
    """Between walls the parts made are to go together; a pin before its bore, or beside it, is to meet it."""
    for z, goal in ((0.0, "clear"), (30.0, "touch")):
        pin, block = box(tmp_path / "pin.off", (9.0, 9.0, 30.0), (0.0, 0.0, z)), tmp_path / "block.off"
        hole = trimesh.creation.box(bounds=((-5, -5, -11), (5, 5, 11)))
        trimesh.boolean.difference([trimesh.creation.box((20.0, 20.0, 20.0)), hole]).export(block)
        if z:
            box(block, (20.0, 20.0, 20.0), (0.0, 0.0, 0.0))
        text, path = drafted(pin, block, tmp_path)
        assert f'\ngoal = "{goal}"' in text
        assert {own.requirement for own in load_problems(path) if solve(own).usable} == set(SIGNS)


def test_labels_in_comments_were_cut_in_their_middle() -> None:
    bodies, label = (fo.Box((1, 1, 1)), fo.Box((2, 2, 2))), "E1F2(P1V{},V{}; P2V6,V7,V11,V13)"
    features = [Feature.from_label(label.format(k, k + 1)) for k in range(1, 7)]
    names = list(map(str, features))
    assert short(features[:2], bodies) == " and ".join(names[:2])
    assert short(features, bodies) == " and ".join([*names[:2], "4 more"])  # 2 are 63 signs, 3 are 97
    long = Feature.from_label(f"F1F2(P1{','.join(f'V{k}' for k in range(1, 40))}; P2V1,V2,V3,V4)")
    assert short([long, *features], bodies) == f"{long} and 6 more"


@pytest.mark.sampled(1)
@pytest.mark.parametrize("facets", [16, 30, 48])
def test_what_touches_as_drawn_is_told_of_round_faces_wherever_their_facets_are(facets: int) -> None:
    """A shaft of its hub's size: "the parts touch" was all that was told where facets are turned against each other."""
    bore = fo.Cylinder(15, 60, base=(0, 0, -10), facets=facets)
    hub = fo.cut(fo.Cylinder(25, 40, facets=facets), bore, name="hub")
    shaft = fo.Cylinder(15, 80, base=(0, 0, -20), facets=40, name="shaft")
    words = "the parts touch: bore of radius 15 of hub at cylinder of radius 15 of shaft"
    assert state_text(Situation(hub, shaft), "mm") == words


@pytest.mark.slow
def test_a_round_wall_beside_faces_that_are_none_is_told_with_its_facets(tmp_path: Path) -> None:
    """A bead around the hub is no cylinder: the hub's facets are kept, and its bore was not told to be round."""
    bead = trimesh.creation.torus(20.0, 3.0, major_sections=32, minor_sections=16)
    hub = trimesh.boolean.union([trimesh.creation.cylinder(radius=20.0, height=20.0, sections=32), bead])
    hub = trimesh.boolean.difference([hub, trimesh.creation.cylinder(radius=10.0, height=30.0, sections=24)])
    hub.export(tmp_path / "hub.stl")
    trimesh.creation.cylinder(radius=9.9, height=40.0, sections=24).export(tmp_path / "pin.stl")
    text, path = drafted(tmp_path / "pin.stl", tmp_path / "hub.stl", tmp_path)
    assert "\nround = true  # cylinder radius 9.9 (24 facets): false takes" in text
    assert re.search(r"\n#round = true  # cylinder radius 20 no. 1 \(32 facets\).*: true takes them for round", text)
    line = 'a line "round = true" below the "file" of hub'
    assert line in re.sub(r"\s+", " ", run("faces", path).output)


@pytest.mark.slow
def test_a_taper_tells_how_much_farther_than_its_diameter_a_part_moves(tmp_path: Path) -> None:
    """Radii 8 at z = 0 and 9 at z = 40: tan(half angle) is 1/40, and x of the diameter is 20 x along the axis."""

    def frustum(low: float, high: float) -> Any:
        angles = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
        rings = [
            ((8.0 + z / 40.0) * np.cos(angles), (8.0 + z / 40.0) * np.sin(angles), 0.0 * angles + z)
            for z in (low, high)
        ]
        return trimesh.convex.convex_hull(np.hstack(rings).T)

    frustum(0.0, 40.0).export(tmp_path / "plug.stl")
    block = trimesh.creation.box(bounds=((-15.0, -15.0, 5.0), (15.0, 15.0, 35.0)))
    trimesh.boolean.difference([block, frustum(-1.0, 41.0)]).export(tmp_path / "socket.stl")
    text, _ = drafted(tmp_path / "plug.stl", tmp_path / "socket.stl", tmp_path)
    assert "by x moves it 20 x, x / (2 tan(half angle))" in text


def test_solids_of_one_file_are_told_once(tmp_path: Path) -> None:
    """They stood as a remark on every case, and again among the notes on bodies."""
    one, scene = trimesh.creation.box((1.0, 1.0, 1.0)), trimesh.Scene()
    scene.add_geometry(one, node_name="one")
    scene.add_geometry(one.copy().apply_translation((3.0, 0.0, 0.0)), node_name="two")
    scene.export(tmp_path / "pair.glb")
    _, path = drafted(tmp_path / "pair.glb", box(tmp_path / "plate.off", (10.0, 10.0, 1.0), (0.0, 0.0, -1.0)), tmp_path)
    assert run("solve", path).stdout.count("2 solids in the file") == 1


@pytest.mark.parametrize(("off", "warned"), [(0.0, False), (0.0099, True)])
def test_a_running_fit_was_said_to_nearly_touch(tmp_path: Path, off: float, warned: bool) -> None:
    """A key .01 from either wall is meant so; .0001 from one and .0199 from the other it is not."""
    key = box(tmp_path / "key.off", (9.98, 8, 4), (off, 0, 0))
    outer, inner = trimesh.creation.box((20, 20, 10)), trimesh.creation.box((10, 30, 30))
    trimesh.boolean.difference([outer, inner]).export(slot := tmp_path / "slot.off")
    text, _ = drafted(key, slot, tmp_path)
    assert ("nearly touch" in text) == warned


def test_contacts_in_a_row_are_told_apart() -> None:
    """Each is "A at B", so that "and" between them and within them made one long name."""
    places = ["top of one at bottom of two", "left of one at right of two", "front of one at back of two"]
    seen: Any = SimpleNamespace(state="touching", places=places, gap=0.0, large=False)
    assert state_text(seen, "mm") == f"the parts touch, at 3 places: {'; '.join(places)}"
