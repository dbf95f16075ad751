"""Maps over one and over three to six sizes, against closed forms."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from itertools import product
from math import comb
from pathlib import Path

import numpy as np
import pytest
from picture_checks import check_texts
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.design.compensation.size_mesh import MeshVertex, SizeMesh
from fcdm_opt.design.compensation.table import Table, nodes_of, volumes
from fcdm_opt.show.grids import grids
from fcdm_opt.show.maps import map_figure, yield_figure

NAMES = ("far", "near", "side")


def before_a_wall(**more: object) -> fo.Problem:
    """A block that touches a wall: what the face towards it and the wall are off opens or closes the gap."""
    block = fo.Body.convex([*product((1.0, 3.0), (0.0, 1.0), (0.0, 1.0))], name="block")
    wall = fo.Body.convex([*product((0.0, 1.0), (-1.0, 2.0), (-1.0, 2.0))], name="wall")
    sizes = [
        fo.Size("far", "movable", faces="-x", tolerance=(-0.02, 0.03)),
        fo.Size("near", "static", faces="+x", tolerance=0.01),
        fo.Size("side", "movable", faces="+y", tolerance=0.01),
    ]
    return fo.Problem(block, wall, sizes=sizes, motion=fo.Translation("x"), goal="touch", unit="mm", **more)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 3])
def test_a_map_over_one_and_over_three_sizes_was_refused(
    count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The amount is |far + near|, and nothing by the side."""
    monkeypatch.setattr("fcdm_opt.design.compensation.refined_mesh.GRID", (0.0, 1.0))
    problem, names = before_a_wall(), NAMES[:count]
    found = fo.compensation_map(problem, over=names, error=1e-3)
    sizes = np.random.default_rng(1).uniform(*found.box.T, (500, count))
    at = found.at(*sizes.T)
    off = sizes[:, : min(count, 2)].sum(axis=1)
    assert (np.abs(at.amount - np.abs(off)) <= at.error).all()
    assert found.reached <= 1e-7
    assert [region.kind for region in found.regions] == ["motion"]
    assert not found.boundaries
    again = fo.CompensationMap.from_dict(json.loads(json.dumps(found.to_dict())))
    assert again.at(*sizes.T).amount.tolist() == at.amount.tolist()
    share = fo.assembly_yield(found, sizes=tuple(fo.Uniform(*ends) for ends in found.box), budget=0.01, count=20_000)
    assert share.share == pytest.approx(np.mean(np.abs(off) <= 0.01), abs=0.07)
    assert [own.body for own in share.contributions] == [*names]
    assert fo.verify(share).passed
    found.to_csv(tmp_path / "map.csv")
    with (tmp_path / "map.csv").open() as file:
        header = next(csv.reader(file))
    assert len(header) == 3 + count * (count + 1) + 2 * comb(count + 2, 2) + 1  # a weight
    figure = map_figure(found, problem)
    assert len(figure.axes) == (1 if count == 1 else comb(count, 2) + 1)
    (grid,) = grids(found, problem, lines=3)
    assert (len(grid.rows), len(grid.columns)) == (3 ** max(count - 1, 1), 1 if count == 1 else 3)


@pytest.mark.slow
def test_names_and_numbers_of_panels_side_by_side_stood_on_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fcdm_opt.design.compensation.refined_mesh.GRID", (0.0, 1.0))
    sizes = [fo.Size(name, "movable", faces=name[-2:], tolerance=(-0.027, 0.04)) for name in
             ("how far the side is off -y", "side +y", "a long name of the bottom -z", "top +z")]  # fmt: skip
    problem = before_a_wall()
    found = fo.compensation_map(problem.changed(sizes=[*problem.sizes[:1], *sizes]), error=1.0)
    figure = map_figure(found, problem)
    assert len(figure.axes) == comb(5, 2) + 1
    check_texts(figure)


def test_the_axes_of_a_flat_map_ran_to_negative_amounts() -> None:
    """A peg that is clear of a wall whatever its side does: no motion, and no amount below 0 on an axis."""
    peg, wall = (fo.Body.convex([*product(ends, (0.0, 1.0), (0.0, 1.0))]) for ends in ((-1.0, 1.0), (2.0, 3.0)))
    size = fo.Size("right", "movable", faces="+x", tolerance=(-0.03, 0.05))
    found = fo.compensation_map(fo.Problem(peg, wall, sizes=[size], motion=fo.Translation("x"), goal="clear"))
    assert map_figure(found).axes[0].get_ylim()[0] == 0.0
    share = fo.assembly_yield(found, sizes=(fo.Uniform(-0.03, 0.05),), budget=0.01, count=1000)
    assert (share.share, share.amounts[0]) == (1.0, 0.0)
    low, high = yield_figure(share).axes[0].get_xlim()
    assert low == 0.0 < share.budget < high


def test_the_motion_jumps_at_a_size_where_another_wall_is_nearer() -> None:
    """A peg between two walls: which of them is nearer is told by the side that is off; motions jump there."""
    peg = fo.Body.convex([*product((-1.0, 1.0), (0.0, 1.0), (0.0, 1.0))], name="peg")
    ends = [((-3.0, -1.1), (-1, 2), (-1, 2)), ((1.1, 3.0), (-1, 2), (-1, 2))]
    walls = fo.Body.from_parts([[*product(*own)] for own in ends], seed=(0, 0, 0), name="walls")
    size = fo.Size("right", "movable", faces="+x", tolerance=(-0.03, 0.05))
    found = fo.compensation_map(fo.Problem(peg, walls, sizes=[size], motion=fo.Translation("x"), goal="touch"))
    (boundary,) = found.boundaries
    assert (boundary.jumps, boundary.points.tolist()) == (True, [[pytest.approx(0.0, abs=1e-9)]])
    at = found.at(np.linspace(-0.029, 0.049, 40))
    assert at.parameters[:, 0] == pytest.approx(np.where(at.amount < 0.1 - 1e-12, at.amount, -0.1), abs=1e-9)
    assert at.amount == pytest.approx(np.minimum(0.1, 0.1 - np.linspace(-0.029, 0.049, 40)), abs=1e-9)


@pytest.mark.parametrize("sizes", [1, 2, 3, 6])
def test_a_box_of_sizes_is_covered_once_and_quadratics_are_found_again(sizes: int) -> None:
    """All simplices of a grid, some of them cut, have the volume of the box; a quadratic is reproduced anywhere."""
    count, rng = 3 if sizes < 4 else 2, np.random.default_rng(sizes)
    places = [np.array(place[::-1], dtype=float) / (count - 1) for place in product(range(count), repeat=sizes)]
    mesh = SizeMesh([MeshVertex(place, {}) for place in places], count)
    corners = np.array([mesh.places(own) for own in mesh.simplices])
    assert volumes(corners).min() > 0.0
    assert volumes(corners).sum() == pytest.approx(1.0)
    linear, square = rng.standard_normal(sizes), rng.standard_normal((sizes, sizes))

    def quadratic(x: np.ndarray) -> np.ndarray:
        return x @ linear + ((x @ square) * x).sum(axis=-1)

    own = Table(
        corners=corners,
        values=quadratic(nodes_of(corners))[..., None],
        errors=np.zeros((len(corners), 2)),
        regions=np.zeros(len(corners), int),
        names=(),
    )
    sampled = rng.random((200, sizes))
    assert own.at(*sampled.T).amount == pytest.approx(quadratic(sampled), abs=1e-12)
    assert np.isnan(own.at(*np.full(sizes, 1.1)).amount)
    with pytest.raises(fo.InputError, match=f"not {sizes} arrays"):
        own.at(*np.zeros(sizes + 1))


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_maps")
def test_the_command_line_takes_one_size_with_its_box_and_what_was_measured(tmp_path: Path) -> None:
    file = Path(__file__).parents[2] / "problems" / "slot_and_key.toml"
    (tmp_path / "measured.csv").write_text("foot\n0.001\n0.002\n", encoding="utf-8")
    line = ["map", str(file), "--case", "as drawn", "--over", "key_foot", "--box=0,0.02", "--budget", "0.1235"]
    line += ["--sizes", str(tmp_path / "measured.csv"), "--columns", "foot", "--out", str(tmp_path), "--json"]
    result = CliRunner().invoke(app, line)
    assert result.exit_code == 0, result.output
    (case,) = json.loads(result.stdout)["files"][0]["cases"]
    assert (case["map"]["over"], case["map"]["box"]) == (["key_foot"], [[0.0, 0.02]])
    assert case["yield"]["share"] == 0.5  # the amount is 0.125 - key_foot
    told = CliRunner().invoke(app, [*line[:6], "--box=0,0.02,1", *line[7:]])
    assert told.exit_code == 2
    assert "not pairs of numbers" in told.stderr


def test_a_yield_without_sizes_was_refused_as_missing_them() -> None:
    """Those of the map's problem are meant: by hand, of two uniform ones w + d >= 0.02 is an eighth."""
    key, wall = (fo.Box((2, 2, 2), centre=(x, 0, 0)) for x in (0.0, 2.1))
    sizes = [
        fo.Size(name, role, faces=face, tolerance=0.02, distribution={"uniform": {}})
        for name, role, face in (("width", "movable", "+x"), ("depth", "static", "-x"))
    ]
    found = fo.compensation_map(fo.Problem(key, wall, sizes=sizes, motion=fo.Translation("x"), goal="touch"))
    assert fo.assembly_yield(found, budget=0.08, count=100_000).share == pytest.approx(0.125, abs=0.005)
    unknown = replace(found, problem=None)
    with pytest.raises(
        fo.InputError, match=r"sizes: not given, and this map knows no problem .* a distribution for each"
    ):
        fo.assembly_yield(unknown, budget=0.08)
