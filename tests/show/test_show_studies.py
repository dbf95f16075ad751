"""Pictures of studies: every amount and every gap is drawn where it belongs, told apart, with its unit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.text import Text
from picture_checks import check_texts

from fcdm_opt.design.study.point import row
from fcdm_opt.design.study.results import StudyResult
from fcdm_opt.show import save
from fcdm_opt.show.album import Album
from fcdm_opt.show.studies import study_figure


def result(axes: dict[str, Any], amounts: Any, *, gap: str = "INFEASIBLE", **own: Any) -> StudyResult:
    """A study with these amounts, nan where there is a gap; None stands for what is drawn."""
    vary = [{"key": [label], "label": label} for label in axes if label not in ("case", "draw")]
    about = {"title": "a study", "axes": axes, "labels": [label for label in axes if label != "draw"], "vary": vary}
    flat = np.asarray(amounts, dtype=float).ravel().tolist()
    answers = {
        f"k{k}": row(f"k{k}", gap)
        if math.isnan(amount)
        else {**row(f"k{k}", "SOLVED"), "usable": True, "amount": amount}
        for k, amount in enumerate(flat)
    }
    points = tuple((key, {}) for key in answers)
    return StudyResult(definition={**about, **own}, study="", version="", points=points, answers=answers)


def lines_of(axes: Any) -> dict[str, np.ndarray]:
    return {line.get_label(): line.get_xydata() for line in axes.lines if not line.get_label().startswith("_")}


def texts(figure: Any) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text) if text.get_visible() and text.get_text()]


TAUS = (0.01, 0.02, 0.03)
AMOUNTS = np.array([[0.1, 0.2, 0.3], [0.2, 0.5, math.nan]])


def by_case() -> StudyResult:
    return result({"case": ["A", "B"], "tolerance": TAUS}, AMOUNTS)


def by_family() -> StudyResult:
    """Three dimensions, the numeric one in the middle."""
    random = np.random.default_rng(3)
    amounts = random.uniform(0.1, 2.0, (2, 4, 7))
    amounts[1, 2, 3] = math.nan
    return result({"case": ["A", "B"], "limits.RZ_deg": [1.0, 10.0, 100.0, 1000.0], "family": list("tuvwxyz")}, amounts)


def field(turned: bool = False) -> StudyResult:
    one, two = ("target[1]", np.linspace(0.9, 1.1, 9).tolist()), ("target[2]", np.linspace(0.95, 1.05, 8).tolist())
    amounts = np.add.outer(np.arange(9.0), 10 * np.arange(8.0))
    amounts[4, 2] = math.nan
    axes = dict([two, one] if turned else [one, two])
    return result(axes, amounts.T if turned else amounts)


def drawn() -> StudyResult:
    amounts = np.append(np.linspace(0.1, 0.39, 30), [math.nan] * 10)
    random = np.random.default_rng(5).permutation(amounts)
    return result({"draw": 40}, random, gap="NOT_FOUND", budget=0.25)


ALL = pytest.mark.parametrize("made", [by_case, by_family, field, drawn])


def test_a_line_a_case_with_its_gaps() -> None:
    figure = study_figure(by_case())
    (axes,) = figure.axes
    drawn = lines_of(axes)
    for case, amounts in zip("AB", AMOUNTS, strict=True):
        np.testing.assert_array_equal(drawn[f"case {case}"], np.column_stack([TAUS, amounts]))
    (gaps,) = [line for line in axes.lines if line.get_marker() == "x"]
    assert list(gaps.get_xdata()) == [0.03]
    one, two = (line for line in axes.lines if line.get_label() in ("case A", "case B"))
    assert one.get_color() != two.get_color()
    assert one.get_linestyle() != two.get_linestyle()  # also told apart in grey
    assert gaps.get_color() == two.get_color()
    told = {"tolerance  (relative; 0.01 = 1 %)", "amount (length units)", "case A", "case B", "impossible", "a study"}
    assert told <= set(texts(figure))
    assert "6 points: 5 solved, 1 impossible" in texts(figure)
    assert axes.get_ylim()[0] == 0.0
    assert axes.get_xscale() == "linear"


def test_a_panel_a_case_where_more_varies() -> None:
    study = by_family()
    figure = study_figure(study)
    amounts = np.array([[found["amount"]] for found in study.rows()], dtype=float).reshape(2, 4, 7)
    for axes, case, own in zip(figure.axes, "AB", amounts, strict=True):
        assert axes.get_title() == f"case {case}"
        drawn = lines_of(axes)
        assert list(drawn) == list("tuvwxyz")
        np.testing.assert_array_equal([line[:, 1] for line in drawn.values()], own.T)
        assert axes.get_xscale() == "log"  # the grid is geometric
        assert axes.get_ylim()[1] >= np.nanmax(amounts)
    styles = {
        (line.get_color(), line.get_linestyle()) for line in figure.axes[0].lines if line.get_label() in "tuvwxyz"
    }
    assert len(styles) == 7
    assert "limits.RZ_deg  (degrees)" in texts(figure)


@pytest.mark.parametrize("turned", [False, True])
def test_two_numeric_axes_make_a_field(turned: bool) -> None:
    figure = study_figure(field(turned))
    axes, bar = figure.axes
    (mesh,) = axes.collections
    expected = np.add.outer(10 * np.arange(8.0), np.arange(9.0))
    drawn = np.ma.filled(mesh.get_array(), math.nan)
    expected[2, 4] = math.nan
    np.testing.assert_array_equal(drawn, expected)  # the longer axis along
    (gap,) = axes.lines
    np.testing.assert_allclose(gap.get_xydata(), [[1.0, 0.95 + 2 / 70]])
    assert (axes.get_xlabel(), axes.get_ylabel()) == tuple(f"target[{k}]  (scale; 1 = as drawn)" for k in (1, 2))
    assert bar.get_ylabel() == "amount (length units)"
    assert "impossible" in texts(figure)


def test_draws_make_a_distribution_with_the_budget() -> None:
    study = drawn()
    figure = study_figure(study)
    (axes,) = figure.axes
    steps = lines_of(axes)["points worked out"]
    for amount in (0.1, 0.2, 0.37, 0.39):
        share = sum((found["amount"] or math.inf) <= amount + 1e-9 for found in study.rows()) / 40
        assert steps[steps[:, 0] <= amount + 1e-9][-1, 1] == pytest.approx(share)
    assert steps[-1, 1] == 0.75  # failures count
    assert study.assembly_yield is not None
    (budget,) = [label for label in lines_of(axes) if label.startswith("budget")]
    assert budget.startswith(f"budget 0.25: {study.assembly_yield.share:.1%} within (")
    assert "40 points: 30 solved, 10 no motion found" in texts(figure)


def test_what_is_no_number_makes_a_distribution_too() -> None:
    figure = study_figure(result({"case": ["A", "B"], "goal": ["at", "touch"]}, [[1.0, 2.0], [3.0, math.nan]]))
    drawn = lines_of(figure.axes[0])
    assert {name: line[-1].tolist() for name, line in drawn.items()} == {"case A": [2.0, 1.0], "case B": [3.0, 0.5]}


@pytest.mark.parametrize("axes", [{"tolerance": TAUS}, {"case": list("AB")}, {}, {"draw": 5}])
def test_a_study_without_any_amount_can_be_drawn(axes: dict[str, Any]) -> None:
    sizes: Sequence[int] = [value if isinstance(value, int) else len(value) for value in axes.values()]
    figure = study_figure(result(axes, np.full(sizes, math.nan), budget=0.1))
    assert any("points:" in text for text in texts(figure))
    figure.draw_without_rendering()


@ALL
def test_no_text_runs_off_the_page_or_into_another(made: Any) -> None:
    check_texts(study_figure(made()))


@pytest.mark.slow
def test_an_album_takes_studies(tmp_path: Path) -> None:
    said: list[str] = []
    album = Album(tmp_path / "album", said.append)
    album.add("sweep", study_figure(by_case()))
    album.add("sweep", study_figure(drawn()))
    names = sorted(path.name for path in (tmp_path / "album").iterdir())
    assert names == [f"sweep{k}.{ending}" for k in ("-2", "") for ending in ("png", "svg")]
    assert len(said) == 2
    first, second = (save(study_figure(by_case()), tmp_path / name)[1].read_bytes() for name in "ab")
    assert first == second
