"""Questions that once got the answer of a narrower one, without a word: now right, or refused with the reason."""

from __future__ import annotations

import csv
import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner
from voxels import VOXELS, surface_of

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.errors import InputError
from fcdm_opt.show.remarks import not_considered

PROBLEMS = Path(__file__).parents[2] / "problems"
X = fo.Translation("x")


def box(low: Any, high: Any, name: str = "body") -> fo.Body:
    return fo.Body.convex(list(product(*zip(low, high, strict=True))), name=name)


CUBE, WALL, POST = (box((x, 0, 0), (x + 1, 1, 1), name) for x, name in ((3, "cube"), (0, "wall"), (6, "post")))
CORNER = fo.Body.from_parts(
    [list(product(*zip(low, high, strict=True))) for low, high in (((-9, -9, 0), (0, 9, 1)), ((0, -9, 0), (9, 0, 1)))],
    seed=(-1, -1, 0),
    name="corner",
)


def both(**more: Any) -> fo.Problem:
    """A cube in a corner, restored to both of its walls."""
    given = {"tolerance": 0.01, "requirement": "A", "motion": X >> fo.Translation("y"), "goal": "at", "contacts": "all"}
    return fo.Problem(box((0, 0, 0), (1, 1, 1)), CORNER, **{**given, **more})


def touching(**more: Any) -> fo.Problem:
    return fo.Problem(CUBE, WALL, **{"target": (1.0, 1.0), "motion": X, "goal": "touch", **more})


# ---------------------------------------------------------------------------------------------------------- assemblies


def test_the_table_of_an_assembly_was_said_to_be_written_and_was_not(tmp_path: Path) -> None:
    files = sorted((PROBLEMS / "assemblies").glob("*.toml"))
    table = tmp_path / "t.csv"
    found = CliRunner().invoke(app, ["solve", str(files[0]), "--table", str(table), "--json"])
    told = json.loads(found.stdout)["files"][0]["cases"]
    assert f"wrote {table}" in found.stderr
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert [row["case"] for row in rows] == [case["name"] for case in told]
    for row, case in zip(rows, told, strict=True):
        assert row["status"] == case["status"]
        assert float(row["amount"]) == case["amount"]
        for part, parameters in case["parameters"].items():
            for name, value in parameters.items():
                known = row.get(f"{part}.{name}") or np.radians(float(row[f"{part}.{name}_deg"]))
                assert float(known) == pytest.approx(value, rel=1e-12, abs=1e-300)


def test_no_table_is_said_to_be_written_where_no_case_was_answered(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text("nothing = 1\n")
    found = CliRunner().invoke(app, ["solve", str(tmp_path / "bad.toml"), "--table", str(tmp_path / "t.csv")])
    assert found.exit_code == 2
    assert "wrote" not in found.stderr
    assert not (tmp_path / "t.csv").exists()


# -------------------------------------------------------------------------------------------------------------- ranges


@pytest.mark.parametrize(("scale", "free"), [(1.0, (-2.0, 2.0)), (1.2, (-2.0, 1.9)), ((0.9, 1.2), (-2.0, 1.9))])
def test_a_range_without_collision_went_through_keep_outs(scale: Any, free: tuple[float, float]) -> None:
    problem = touching(keep_out=(fo.KeepOut(POST, scale),))
    found = fo.contact_times(problem)
    assert found.free == pytest.approx(free, abs=1e-12)
    assert found.keep_outs["post"][1].state == "overlapping"
    assert found.to_dict()["keep_outs"]["post"][1]["low"] == pytest.approx(free[1], abs=1e-12)
    inside = touching(keep_out=(box((3.5, 0, 0), (4.5, 1, 1), "inside"),))
    assert fo.contact_times(inside).free is None
    aside = touching(keep_out=(box((6, 3, 0), (7, 4, 1), "aside"),))
    beyond = fo.contact_times(aside)  # looked at as far as the one aside could be met
    assert beyond.free == (fo.contact_times(touching()).free[0], beyond.searched[1])


def test_a_range_refuses_keep_outs_that_it_cannot_answer_for() -> None:
    name = next(name for name, (cells, *_) in VOXELS.items() if len(cells) > 1)
    hollow = fo.Body.from_mesh(*surface_of(VOXELS[name][0]), decomposition="surface", name="shell")
    with pytest.raises(InputError, match="only the surface is kept, and it has a range of scales"):
        fo.contact_times(touching(keep_out=(fo.KeepOut(hollow, (0.9, 1.1)),)))


def test_what_a_range_cannot_answer_leaves_the_rest_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """As of a keep-out with a clearance where it is not known how fast a motion moves corners."""
    monkeypatch.setattr("fcdm_opt.along.true_overlaps.moving_at_most", lambda *own: lambda *ends: (None, np.inf))
    asked = ["range", str(PROBLEMS / "bracket.toml"), "--case", "A flush above the ribs", "--json"]
    (case,) = json.loads(CliRunner().invoke(app, asked).stdout)["files"][0]["cases"]
    assert case["events"]
    assert "to be kept clear of" in case["contact_times"]["error"]


# ----------------------------------------------------------------------------------------------------- several contacts


def test_coherent_with_several_contacts_was_free_without_a_word() -> None:
    with pytest.raises(InputError, match="the way there is not looked at"):
        both(path="coherent")
    assert both().path == both(path="free").path == "free"
    assert fo.Problem.from_dict(both().to_dict()).path == "free"
    assert touching().path == "coherent"
    old = fo.solve(both()).to_dict()
    old["problem"]["case"][0]["path"] = "coherent"  # as earlier versions wrote it, asked for or not
    assert fo.Solution.from_dict(old).problem.path == "free"


# --------------------------------------------------------------------------------------------------------------- sizes


def test_a_budget_of_sizes_spoke_of_uniform_scales() -> None:
    size = fo.Size("width", "movable", faces="-x", tolerance=0.05)
    found = fo.budget(touching(sizes=[size]), 1.0, requirements=["worst"])["worst"]
    assert found.sizes == ("width",)
    np.testing.assert_allclose(found.table, [[-found.tolerance, found.tolerance]])
    scales = touching(sizes=[size], target=None, tolerance=0.01, requirement="A")
    assert fo.budget(scales, 3.0, requirements="A").tolerance == pytest.approx(0.2)


def test_a_stack_up_passed_over_keep_outs() -> None:
    size = fo.Size("width", "movable", faces="-x", tolerance=0.05)
    stack = fo.stack_up(touching(sizes=[size], keep_out=(POST,)))
    assert stack.keep_out == (POST.name,)
    assert f"keep-outs ({POST.name}) have no part in it" in str(stack)


def test_what_was_left_out_of_a_problem_with_sizes_was_not_true_of_it() -> None:
    """It said that sizes change uniformly, and that one pair of them was solved."""
    size = fo.Size("width", "movable", faces="-x", tolerance=0.05)
    told = " ".join(not_considered(fo.solve(touching(target=None, sizes=[size], made={"width": 0.02}))))
    assert "What can come out different is width: no other" in told
    assert "made width +0.02" in told
    assert "niformly" not in told
    assert "pair of sizes" not in told
    scaled = " ".join(not_considered(fo.solve(touching(sizes=[size], target=(1.01, 1.0)))))
    assert "width, and either part uniformly about its seed" in scaled
    assert "The parts are taken as drawn" in " ".join(not_considered(fo.solve(touching())))
    plain = " ".join(not_considered(fo.solve(touching(target=(1.01, 1.0)))))
    assert "larger or smaller by one factor, about its seed" in plain


# --------------------------------------------------------------------------------------------------------- large meshes


def test_rows_of_a_large_mesh_were_those_of_the_parts_modelled() -> None:
    name = next(name for name, (cells, *_) in VOXELS.items() if len(cells) > 1)
    shell = fo.Body.from_mesh(*surface_of(VOXELS[name][0]), decomposition="surface", name="shell")
    far = shell.vertices[shell.vertices[:, 0].argmax()]
    face = next(f for f in shell.faces if (shell.vertices[np.array(f) - 1, 0] == far[0]).all())
    tip = shell.vertices[np.array(face) - 1].T @ np.array([0.35, 0.3, 0.2, *[0.15 / (len(face) - 3)] * (len(face) - 3)])
    arms = [(0.2, 0, 0), (1.2, 0.1, 0), (1.2, 0, 0.1), (1.3, -0.1, -0.1)]
    needle = fo.Body.convex(tip + np.array(arms), name="needle")
    problem = fo.Problem(needle, shell, target=(1.0, 1.0), motion=X, goal="touch")
    gaps = [float(row(q=[-0.2])["gap"]) for row in fo.contact_rows(problem, within=0.5).contacts]
    assert min(gaps) == pytest.approx(0.0, abs=1e-12)  # the tip is .2 before the face
    found = fo.whatif(problem, target=(1.001, 1.0))  # nan: which parts are modelled was taken for another shape
    assert found.predicted_amount == pytest.approx(found.after.amount, abs=1e-5)


def test_contact_rows_say_in_which_steps_a_machine_moves() -> None:
    assert fo.contact_rows(touching(resolution=0.25)).resolution == pytest.approx([0.25])
    assert fo.contact_rows(touching()).resolution is None


# ------------------------------------------------------------------------------------------------------------ conflicts


def test_nothing_clashes_was_said_where_parts_do_not_fit() -> None:
    """Three teeth, .005 too wide together: `solve` says that they do not fit."""
    cases = Path(__file__).parents[1] / "cases"
    comb, slots = (fo.Body.from_file(cases / name, unit="mm") for name in ("comb.off", "comb_slots.off"))
    problem = fo.Problem(comb, slots, target=(1.0, 1.0), motion=fo.Translation("z"), goal="clear")
    assert fo.solve(problem).status.name == "OUTSIDE_FIT"
    found = fo.conflicts(problem)
    assert [clash.names for clash in found.clashes] == [()]
    assert "none stays in the fit" in str(found)


def test_sizes_of_a_part_from_a_file_were_said_to_be_of_no_body_of_an_assembly(tmp_path: Path) -> None:
    corners = "\n".join(f"{x} {y} {z}" for x in (0, 4) for y in (0, 4) for z in (0, 1))
    faces = ("0 1 3 2", "4 6 7 5", "0 4 5 1", "2 3 7 6", "0 2 6 4", "1 5 7 3")
    listed = "\n".join(f"4 {own}" for own in faces)
    (tmp_path / "plate.off").write_text(f"OFF\n8 6 12\n{corners}\n{listed}\n", "ascii")
    file = tmp_path / "pile.toml"
    file.write_text(
        """
        part = [
            { name = "plate", unit = "mm", file = "plate.off" },
            { name = "lid", unit = "mm", vertices = [[0, 0, 1], [4, 0, 1], [0, 4, 1], [0, 0, 2]], motion = "z" },
        ]
        contact = [{ parts = ["lid", "plate"] }]
        size = [{ name = "height", body = "plate", faces = ["+z"], tolerance = [-0.1, 0.1] }]
        case = [{ name = "high", made = { height = 0.05 } }]
        """.replace('motion = "z"', 'motion = [{ translation = "z" }]'),
        "utf-8",
    )
    found = CliRunner().invoke(app, ["whatif", str(file), "--set", "made.height=0.1", "--json"])
    assert found.exit_code == 0, found.output
    (told,) = json.loads(found.stdout)["files"][0]["cases"]
    assert told["whatif"]["after"]["amount"] == pytest.approx(0.1)
    file.write_text(file.read_text("utf-8").replace("height = 0.05", "height = 0.5"), "utf-8")
    said = CliRunner().invoke(app, ["solve", str(file)]).output  # a slip of a digit was taken without a word
    assert "high: made beyond the tolerance: height +0.5 mm (-0.1 to +0.1)" in said
