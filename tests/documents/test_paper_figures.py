"""The paper's figures, remade: they show what its text says of them, and say that the bodies are reconstructions."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.text import Text
from picture_checks import check_texts, shown
from scripts import loaded

import fcdm_opt as fo
from fcdm_opt.show import GREY
from fcdm_opt.show.lettering import Sheet
from fcdm_opt.show.scene import ShownBodies, draw_scene

SCRIPT = Path(__file__).parents[2] / "problems" / "paper_figures.py"


def script() -> Any:
    return loaded(SCRIPT)


@cache
def figure(name: str) -> Any:
    return script().FIGURES[name]()


def words(name: str) -> list[str]:
    return [text.get_text() for text in shown(figure(name))]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fig3", "fig4", "fig5", "fig6", "fig7"])
def test_texts_keep_apart_and_say_that_the_bodies_are_reconstructions(name: str) -> None:
    check_texts(figure(name), least=10)
    told = " ".join(" ".join(words(name)).split())
    assert "The bodies are reconstructions" in told
    assert f"Fig. {name[-1]}" in told


def test_both_examples_are_shown_in_space() -> None:
    numbers = [text for text in words("fig3") if text.isdigit()]
    assert len(numbers) == 6 + 5 + 5 + 12
    assert {"(a)  Example 1", "(b)  Example 2", "x", "y", "z"} <= set(words("fig3"))


def test_segments_and_switching_points_are_named() -> None:
    told = words("fig4")
    for piece, count in (("S1", 2), ("S3", 2), ("S4", 1), ("S5", 1), ("SW1", 2), ("SW2", 2), ("SW3", 1), ("SW4", 1)):
        assert told.count(piece) == count
    listed = "\n".join(told)
    for line in ("S1  V1F2(P1V6; P2V2,V3,V5)", "SW1  (2.378003, 2.140897)", "V1E2(P1V4; P2V9,V10)"):
        assert line in listed


def test_the_contacts_at_both_switching_points() -> None:
    told = "\n".join(words("fig5"))
    for part in ("SW1 at (2.3780, 2.1409)", "SW2 at (2.8110, 1.1795)", "V1F2(P1V5; P2V4,V5,V10,V11)"):
        assert part in told


@pytest.mark.parametrize(("name", "example", "nominal"), [("fig6", 1, (1.2735, 1.2145)), ("fig7", 2, (2.3780, 2.1409))])
def test_published_motions_meet_each_requirement_and_ours_beside_them(name: str, example: int, nominal: Any) -> None:
    panels = figure(name).axes
    assert [axes.get_title()[:3] for axes in panels] == [f"({k})" for k in range(1, 6)]
    for axes, asked in zip(panels[1:], script().cases(example), strict=True):
        marks = {line.get_marker(): line.get_xydata()[0] for line in axes.lines if line.get_linestyle() == "None"}
        np.testing.assert_allclose(marks["*"], nominal, atol=5e-5)
        np.testing.assert_allclose(marks["D"], marks["*"] * (1.0 + 0.02 * asked.signs), rtol=1e-12)
        for marker in "os":
            beyond = (marks[marker] - marks["D"]) * asked.signs
            assert (beyond >= -2e-5).all(), (asked.name, marker)  # the paper prints four digits
        low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
        assert all(((low < point) & (point < high)).all() for marker, point in marks.items() if marker in "*Dos")
    told = " ".join(" ".join(words(name)).split())
    for asked in script().cases(example):
        assert asked.published_text in told


@pytest.mark.slow
def test_the_script_writes_every_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = {name: figure(name) for name in ("fig3", "fig4")}  # by the script's own, which are replaced then
    monkeypatch.setattr(script(), "FIGURES", {name: lambda own=own: own for name, own in drawn.items()})
    monkeypatch.setattr(sys, "argv", ["paper_figures.py", "--out", str(tmp_path / "paper")])
    script().main()
    written = sorted(path.name for path in (tmp_path / "paper").iterdir())
    assert written == ["fig3.png", "fig3.svg", "fig4.png", "fig4.svg"]
    assert "reconstructions" in (tmp_path / "paper" / "fig4.svg").read_text()
    assert fo.load_problems(SCRIPT.parent / "example1.toml")[0].name == "A"


def test_a_scene_numbers_corners_at_one_scale() -> None:
    """Of a cube seen from a corner seven corners are seen; the eighth is behind it."""
    cube, far = (fo.Body.convex([[x + k, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) for k in (0, 18))
    sheet = Sheet.of(4.0, 3.0)
    shown_pair = ShownBodies.of(cube, far, view=(30.0, -50.0))
    axes = draw_scene(sheet, (0.0, 0.0, 4.0, 3.0), shown_pair)
    script().number_corners(axes, shown_pair)
    numbers = [text for text in sheet.figure.findobj(Text) if text.get_text().isdigit()]
    grey = [text.get_text() for text in numbers if text.get_color() == GREY]
    assert sorted(text.get_text() for text in numbers) == sorted("12345678" * 2)
    assert grey == ["3", "3"]  # (-1, 1, -1), farthest from where x > 0, y < 0, z > 0
    origin, *units = axes.transData.transform([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
    rows = np.array(units) - origin  # of one scale: orthogonal, of equal length
    gram = rows @ rows.T
    np.testing.assert_allclose(gram, gram[0, 0] * np.eye(2), atol=1e-6 * gram[0, 0])
