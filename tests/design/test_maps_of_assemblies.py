"""Maps and yields of assemblies, against closed forms and as judged where all parts are made anew."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import PROBE, SCENES, TABLE, Z
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.design.compensation.compensation_map import CompensationMap
from fcdm_opt.design.distributions import read_columns
from fcdm_opt.show.grids import write_grids
from fcdm_opt.show.maps import map_figure

pytestmark = pytest.mark.usefixtures("coarse_maps")
OVER = ("scales.lower", "scales.upper")
BOX = ((1.005, 1.02), (0.99, 1.02))


def chain(**changes: Any) -> fo.Assembly:
    """A lower part on the floor that takes an upper one along; scales move the tops and bottoms by a half of them."""
    question = SCENES["chain"].ask(0.0)
    return question.changed(scales={}, unit="mm", **changes)


@cache
def found() -> CompensationMap:
    return fo.compensation_map(chain(), over=OVER, box=BOX, error=1e-3)


@cache
def share() -> fo.AssemblyYield:
    sizes = tuple(fo.Uniform(*ends) for ends in BOX)
    return fo.assembly_yield(found(), sizes=sizes, budget=0.012, count=20_000)


def failed(result: fo.AssemblyYield) -> set[str]:
    return {check.name for check in fo.verify(result).failed}


def places(count: int = 200) -> np.ndarray:
    return np.random.default_rng(1).uniform(*np.transpose(BOX), (count, 2))


def test_a_map_of_an_assembly_was_refused() -> None:
    at = found().at(*places().T)
    d, e = places().T - 1.0
    assert (np.abs(at.amount - np.hypot(0.5 * d, 0.5 * (d + e))) <= at.error).all()
    assert found().table.names == ("lower.TZ", "upper.TZ")
    np.testing.assert_allclose(at.parameters, np.transpose([0.5 * d, 0.5 * (d + e)]), atol=1e-8)
    np.testing.assert_allclose(at.transforms["lower"][:, 2, 3], 0.5 * d, atol=1e-8)
    np.testing.assert_allclose(at.transforms["upper"][:, 2, 3], d + 0.5 * e, atol=1e-8)  # it is taken along
    assert found().nominal.tolist() == [1.0, 1.0]
    again = CompensationMap.from_dict(found().to_dict())
    assert again.unit == "mm"
    assert again.at(1.01, 1.0).transforms["upper"].tolist() == found().at(1.01, 1.0).transforms["upper"].tolist()


def test_the_judge_makes_all_parts_of_an_assembly_anew() -> None:
    d, e = places(100_000).T - 1.0
    assert share().share == pytest.approx(np.mean(np.hypot(0.5 * d, 0.5 * (d + e)) <= 0.012), abs=0.01)
    assert [own.body for own in share().contributions] == [*OVER]
    assert not failed(share())
    for column, check in ((0, "amount of the motion"), (1, "gap after the motion"), (2, "gap after the motion")):
        values = np.array(found().table.values)
        values[..., column] += 0.002
        wrong = replace(found(), table=replace(found().table, values=values, weights=()))
        assert check in failed(replace(share(), sizes_map=wrong))


def test_what_a_map_does_not_tell_was_held_against_it() -> None:
    """A map that the time cut off has errors of nan, and its yield was not verified."""
    errors = np.array(found().table.errors)
    errors[::2] = np.nan
    cut_off = replace(found(), table=replace(found().table, errors=errors))
    assert not failed(replace(share(), sizes_map=cut_off))


def test_a_map_over_scales_of_parts_with_sizes_made_was_judged_by_those_drawn() -> None:
    top = fo.Size("top", "static", faces="+z", tolerance=0.05)
    own: dict[str, Any] = {"sizes": [top], "made": {"top": 0.02}, "tolerance": 0.02, "requirement": "A"}
    sizes_map = fo.compensation_map(fo.Problem(PROBE, TABLE, goal="touch", motion=Z, **own), error=1e-3)
    assert not failed(fo.assembly_yield(sizes_map, sizes=(fo.Uniform(0.98, 1.02),) * 2, budget=0.04, count=20_000))


@pytest.mark.slow
def test_a_size_and_a_scale_share_a_map(monkeypatch: pytest.MonkeyPatch) -> None:
    """The lower part's top moves by the size, the upper part's bottom by half of its scale."""
    monkeypatch.setattr("fcdm_opt.design.compensation.refined_mesh.GRID", (0.0, 1.0))  # linear
    question, ends = SCENES["chain, sizes"].ask(0.0), ((0.0, 0.02), (0.99, 1.02))
    both = fo.compensation_map(question, over=("thick", "scales.upper"), box=ends, error=1e-3)
    at = both.at(0.01, 1.01)
    assert at.amount == pytest.approx(0.015, abs=1e-9)
    sizes = fo.Uniform(-0.01, 0.02), fo.Uniform(0.99, 1.02)
    told = fo.assembly_yield(both, sizes=sizes, budget=1.0, count=3000)
    assert told.outside == pytest.approx(1 / 3, abs=0.05)
    with pytest.raises(fo.InputError, match="> 0"):
        fo.assembly_yield(both, sizes=sizes[::-1], budget=1.0)
    with pytest.raises(fo.InputError, match="not positive"):
        fo.compensation_map(question, over=("thick", "scales.upper"), box=(ends[0], (0.0, 1.0)))


def test_measured_deviations_were_refused_where_a_size_came_out_smaller(tmp_path: Path) -> None:
    (tmp_path / "measured.csv").write_text("thick,deep,scale\n0.001,-0.002,-1\n0,0.003,1\n", encoding="utf-8")
    told = read_columns(tmp_path / "measured.csv", ["thick", "deep"], deviations=True)
    assert told.tolist() == [[0.001, -0.002], [0.0, 0.003]]
    with pytest.raises(fo.InputError, match="row 2, column 'deep'"):
        read_columns(tmp_path / "measured.csv", ["deep"])
    line = ["map", "problems/assemblies/loop_of_four.toml", "--out", str(tmp_path), "--over", "key width,scales.key"]
    line += ["--sizes", str(tmp_path / "measured.csv"), "--columns", "deep,scale", "--budget", "1"]
    result = CliRunner().invoke(app, line)
    assert result.exit_code == 2, result.output
    assert "a size is not a positive number" in result.stderr


@pytest.mark.parametrize(
    ("name", "how", "told"),
    [
        ("chain", {"over": ()}, "over.*one to 6 of scales.floor, scales.lower, scales.upper"),
        ("chain", {"over": ("lower", "upper")}, "over.*one to 6 of scales.floor"),
        ("chain", {"over": OVER}, "box"),
        ("chain, sizes", {"over": ("thick", "scales.upper")}, "box"),
        ("chain, sizes", {"over": ("thick", "thick")}, "one to 6 of thick, deep, scales.floor"),
    ],
)
def test_an_assembly_is_not_guessed_at(name: str, how: dict[str, Any], told: str) -> None:
    with pytest.raises(fo.InputError, match=told):
        fo.compensation_map(SCENES[name].ask(0.0), **how)


def test_whole_steps_of_an_assembly_have_no_map() -> None:
    with pytest.raises(fo.InputError, match="whole steps"):
        fo.compensation_map(chain(resolution={"upper": 0.01}), over=OVER, box=BOX)


def test_other_scales_are_asked_as_if_written_anew() -> None:
    scales = {"lower": 1.01, "upper": 0.99}
    again, anew = chain().changed(scales=scales).changed(scales={**scales, "floor": 1.02}), chain().to_dict()
    anew["case"][0]["scales"] = again.to_dict()["case"][0]["scales"]
    told = [fo.solve(own).to_dict() for own in (again, fo.Assembly.from_dict(anew))]
    for own in told:
        own["seconds"] = own["contacts"] = None
    assert told[0] == told[1]
    with pytest.raises(fo.InputError, match=r"scales\.lower"):
        chain().changed(scales={"lower": 0.0})
    with pytest.raises(fo.InputError, match="scales"):
        chain().changed(scales={"shelf": 1.0})


def test_pictures_and_grids_name_the_parts(tmp_path: Path) -> None:
    figure = map_figure(found(), chain())
    words = " ".join(text.get_text() for text in (*figure.texts, *figure.axes[0].texts))
    assert "bottom face of lower" in words
    assert figure.axes[0].get_xlabel() == "scales.lower (1 as drawn)"
    csv, page = write_grids(found(), chain(), tmp_path / "map", title="chain")
    assert csv.read_text(encoding="utf-8").splitlines()[0].startswith('"lower.TZ, mm: lower, length along x down')
    assert "the parts named before a dot" in page.read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_plate_on_two_pins_was_undecided_all_over() -> None:
    """Corners of the box at which both holes meet their pins at once were taken for regions, and bisected for.

    Shifted along y it meets the left pin after what is left of the play there, or the right one after .07.
    """
    tools, holes = ([fo.Cylinder(r, 10, base=(x, y, -2)) for x in (-20, 20)] for r, y in ((4.9, 0.0), (5.0, 0.03)))
    base = fo.joined(fo.Box((80, 40, 8), centre=(0, 0, -4)), *tools, name="base")
    plate = fo.cut(fo.Box((80, 40, 6), centre=(0, 0.03, 3.1)), *holes, name="plate")
    around: Any = (
        {"around": (-20, 0, 3), "axis": "z", "radius": 4.9},
        {"around": (-20, 0.03, 3), "axis": "z", "radius": 5},
    )
    sizes = [fo.Size(part, part, faces=faces, each=0.5, tolerance=0.05)
             for part, faces in zip(("base", "plate"), around, strict=True)]  # fmt: skip
    question = fo.Assembly(
        [base, plate], [{"parts": ["plate", "base"], "goal": "touch"}], sizes, {"plate": fo.Translation("y")}
    )
    told = fo.compensation_map(question, seconds=600.0, budget=100)
    assert told.undecided == 0.0
    assert told.solved < 80
    pin, hole = np.random.default_rng(2).uniform(-0.05, 0.05, (2, 200))
    at = told.at(pin, hole)
    assert (np.abs(at.amount - np.minimum(0.07, 0.07 - (pin + hole) / 2.0)) <= at.error).all()
    assert at.error.max() < 1e-5


@pytest.mark.parametrize("count", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_the_kink_of_the_amount_where_a_motion_changes_its_direction_was_searched_for(count: int) -> None:
    rod = fo.Cylinder(5, 30, base=(0, 0, -15), name="rod", unit="mm")
    jaws = [fo.Box((10, 12, 14), centre=(x, 0, 0), name=name, unit="mm") for x, name in ((-10, "left"), (10, "right"))]
    sizes = [
        fo.Size("diameter", "rod", faces=["cylinder radius 5"], each=0.5, tolerance=0.05),
        fo.Size("left", "left", faces=["+x"], each=1.0, tolerance=0.03),
        fo.Size("right", "right", faces=["-x"], each=1.0, tolerance=0.02),
    ][:count]
    along = fo.Translation("x")
    gripper = fo.Assembly(
        [rod, *jaws],
        motions={"left": along, "right": along},
        contacts=[("left", "rod"), ("right", "rod")],
        weights={"left": 1.0, "right": 2.0},
        sizes=sizes,
    )
    found = fo.compensation_map(gripper)
    made = np.random.default_rng(5).uniform(found.box[:, 0], found.box[:, 1], (500, count))
    d, left, right = (*made.T, np.zeros(500))[:3]
    at = found.at(*made.T)
    np.testing.assert_allclose(at.parameters, np.transpose([-left - d / 2, right + d / 2]), atol=1e-6)
    np.testing.assert_allclose(at.amount, np.hypot(left + d / 2, d + 2.0 * right), atol=1e-6)
    assert found.at(*np.zeros(count)).amount <= 1e-6
    assert found.reached <= 1e-6
    assert found.solved <= {2: 60, 3: 300}[count]
    again = CompensationMap.from_dict(found.to_dict())
    assert again.at(*made.T).amount.tolist() == at.amount.tolist()
