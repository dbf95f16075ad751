"""Bars of what the amount depends on: their values are those of solving again, their picture says what they mean."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from matplotlib.text import Text
from ordinary import solved
from picture_checks import check_texts, shown

import fcdm_opt as fo
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.show.album import Album
from fcdm_opt.show.sensitivities import STEP, Bar, bars, sensitivities_figure


def named(solution: Solution) -> dict[str, Bar]:
    made = bars(solution.sensitivity, solution.problem)
    assert len({bar.name for bar in made}) == len(made)
    return {bar.name: bar for bar in made}


def test_bars_are_what_solving_again_gives() -> None:
    """The central difference over the bar's own step, of linear and nearly linear answers."""
    solution = solved("bracket", "past the ribs")
    asked, found = solution.problem, named(solution)

    def again(**changes: Any) -> float:
        return fo.solve(asked.changed(**changes)).amount

    for k, name in enumerate(f"overall size of {body.name}" for body in (asked.movable, asked.static)):
        up, down = asked.target.copy(), asked.target.copy()
        up[k] *= 1.0 + STEP
        down[k] *= 1.0 - STEP
        slope = (again(target=tuple(up)) - again(target=tuple(down))) / 2.0
        assert found[name].value == pytest.approx(slope, rel=0.02)
        assert found[name].unit == "+1 %"
    weights = dict(zip(("TX", "TZ"), asked.weights.tolist(), strict=True))
    for name, weight in weights.items():
        up, down = (again(weights={**weights, name: weight * factor}) for factor in (1.0 + STEP, 1.0 - STEP))
        assert found[f"weight of the shift along {name[1].lower()}"].value == pytest.approx((up - down) / 2.0, rel=0.02)


def test_a_tolerance_counts_by_a_hundredth_and_sizes_come_always() -> None:
    found = named(solved("example1", "B"))
    asked = solved("example1", "B").problem
    wider = asked.changed(tolerance=0.02 + 1e-4)
    slope = (fo.solve(wider).amount - solved("example1", "B").amount) / 1e-4
    assert found[f"tolerance + of {asked.movable.name}"].value == pytest.approx(STEP * slope, rel=0.02)
    assert found[f"tolerance + of {asked.movable.name}"].unit == "+0.01"
    assert f"overall size of {asked.static.name}" in found
    assert found[f"overall size of {asked.static.name}"].value == 0.0


def test_a_limit_that_holds_gets_a_bar_with_its_unit() -> None:
    box = fo.Body.convex([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], name="box")
    beside = fo.Body.convex([[x + 3, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], name="beside")
    asked = fo.Problem(
        box, beside, target=(1.0, 1.0), goal="touch", motion=fo.Translation("x") >> fo.Rotation("z"),
        limits={"RZ": (0.0, 0.1)},
    )  # fmt: skip
    found = named(fo.solve(asked))
    wider, nearer = (fo.solve(asked.changed(limits={"RZ": (0.0, 0.1 + step)})).amount for step in (1e-3, -1e-3))
    bar = found["upper limit of the turn about z"]
    assert bar.unit == "+0.5 deg"
    assert bar.value == pytest.approx(math.radians(0.5) * (wider - nearer) / 2e-3, rel=1e-3)
    assert "lower limit of the turn about z" not in found


def test_steps_of_lengths_were_numbers_that_nobody_knows() -> None:
    """1 % of the part, 0.169 mm: now a round number, and of a size with a tolerance half of that."""
    solution = solved("slot_and_key", "low foot, deep slot")
    told = named(solution)
    assert told["front face of key"].unit == "+0.1 mm"
    assert told["front face of key"].value == pytest.approx(-0.1)
    half = told["slot_depth of slot"]  # each 0.05 deeper, as far as its tolerance goes
    assert (half.unit, half.note) == ("+0.05 mm", "sizes by name, each by half its tolerance")
    assert half.value == pytest.approx(0.05)


def test_steps_of_different_kinds_stood_in_one_list() -> None:
    """Overall sizes, sizes by name and faces: each kind has a heading, which ran over the axis with its step."""
    figure = sensitivities_figure(solved("slot_and_key", "low foot, deep slot"))
    figure.canvas.draw()
    axis = figure.axes[0].get_window_extent().x0
    headings = [text for text in shown(figure) if text.get_fontweight() == "bold"]
    assert [" ".join(text.get_text().split()) for text in headings if "weights" not in text.get_text()] == [
        "overall sizes as made, all else as it is", "sizes by name, each by half its tolerance",
        "planes of faces, shifted outwards",
    ]  # fmt: skip
    assert all(text.get_window_extent().x1 < axis for text in headings)
    check_texts(figure, least=12)


def test_without_a_motion_there_are_no_bars_and_the_picture_says_so() -> None:
    asked = solved("example1", "B").problem
    nothing = Solution(problem=asked, status=Status.NOT_FOUND, pair=asked.target)
    assert bars(nothing.sensitivity, asked) == []
    figure = sensitivities_figure(nothing, title="nothing", caption="a caption")
    told = " ".join(text.get_text() for text in shown(figure))
    assert "no derivatives" in told
    assert "no motion was found" in told
    check_texts(figure, least=3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "name"),
    [("example1", "B"), ("example2", "A"), ("bracket", "past the ribs"), ("lid", "A flush on the rim")],
)
def test_the_picture_shows_every_bar_with_its_step(file: str, name: str) -> None:
    solution = solved(file, name)
    figure = sensitivities_figure(solution, title=name, caption="a caption")
    check_texts(figure, least=12)
    (axes,) = figure.axes
    widths = [patch.get_width() for patch in axes.patches]
    made = bars(solution.sensitivity, solution.problem)
    assert set(widths) <= {bar.value for bar in made}
    assert max(map(abs, widths)) == max(abs(bar.value) for bar in made)
    for patch in axes.patches:  # told apart without colour
        assert (patch.get_hatch() is None) == (patch.get_width() >= 0.0)
    told = [text.get_text() for text in figure.findobj(Text)]
    assert {bar.unit for bar in made[:2]} <= set(told)
    assert any(f"({solution.problem.unit or 'length units'})" in text for text in told)
    if not solution.sensitivity.exists:
        assert any(solution.sensitivity.reasons[0][:30] in " ".join(text.split()) for text in told)


def test_what_has_no_derivative_is_said_not_drawn() -> None:
    solution = solved("example2", "A")
    found = replace(solution.sensitivity, length=math.nan, clearance=math.nan)
    made = {bar.name: bar for bar in bars(found, solution.problem)}
    assert math.isnan(made["clearance"].value)


@pytest.mark.slow
def test_an_album_writes_the_sensitivities_of_a_solved_case(tmp_path: Path) -> None:
    said: list[str] = []
    album = Album(tmp_path / "album", said.append)
    album.add_solution("file", "file.toml", solved("bracket", "past the ribs"))
    names = {path.name for path in (tmp_path / "album").iterdir()}
    stem = "file-past_the_ribs"
    assert names == {f"{stem}-{kind}.{end}" for kind in ("curve", "scene", "sensitivities") for end in ("png", "svg")}
    assert not album.failed


def test_facets_of_a_true_round_face_had_bars_of_their_own() -> None:
    """A cell in a V of two walls at 45 degrees is lifted by the root of 2 times what its radius grows by."""
    cell = fo.Cylinder(9.0, 40.0, base=(0.0, 0.0, 0.0), axis="x", name="cell")
    c, s = 9.0 * math.sqrt(2.0), 40.0
    walls = [
        [(x, y, z) for x in (0.0, s) for y, z in ((0.0, -c), (side * 30.0, 30.0 - c), (side * 30.0, -c - 5.0))]
        for side in (-1.0, 1.0)
    ]
    size = fo.Size("diameter", "movable", faces="cylinder radius 9", each=0.5, tolerance=0.1)
    motion = fo.Translation("y") >> fo.Translation("z")
    asked = fo.Problem(
        cell, fo.Body.from_parts(walls), motion=motion, sizes=[size], made={"diameter": 0.1}, goal="at", contacts="all"
    )
    solution = fo.solve(asked)
    made = {bar.name: bar.value for bar in bars(solution.sensitivity, solution.problem)}
    assert made["diameter of cell"] == pytest.approx(0.05 * math.sqrt(2.0))
    assert not [name for name in made if "facet" in name or "cylinder" in name]
