"""The report on a study: every point is in it as it was found, and in a browser one walks through them."""

from __future__ import annotations

import base64
import gzip
import json
import math
import re
import sys
from html.parser import HTMLParser
from typing import Any

import pytest
from study_results import TAUS, result

from fcdm_opt.design.study.point import row
from fcdm_opt.errors import InputError
from fcdm_opt.show import rendering
from fcdm_opt.show.report import page as module
from fcdm_opt.show.report.page import study_page

HOSTILE = r"</script><b>bold & 'quoted' $\frac$ $x$"


class Reader(HTMLParser):
    """Text, tags and packed data of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.ids += [value or "" for name, value in attrs if name == "id"]
        assert not [value for name, value in attrs if name in ("src", "href") and (value or "").startswith("http")]

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def read(page: str) -> tuple[Reader, dict[str, Any]]:
    reader = Reader()
    reader.feed(page)
    found = re.search(r'id="packed-figures">([^<]*)<', page)
    assert found is not None
    return reader, json.loads(gzip.decompress(base64.b64decode(found[1])))


def test_every_point_is_there_as_it_was_found() -> None:
    reader, data = read(study_page(result(["A", "B"])))
    rows = [dict(zip(data["columns"], values, strict=True)) for values in data["rows"]]
    assert [(own["case"], own["tolerance"]) for own in rows] == [(name, tau) for name in "AB" for tau in TAUS]
    assert [own["amount"] for own in rows] == [1.0, 2.0, 3.0, 4.0, 11.0, 12.0, 13.0, None]
    assert [own["TZ"] for own in rows][:2] == [-1.0, -2.0]
    assert data["usable"] == [True] * 7 + [False]
    assert data["varied"] == ["case", "tolerance"]
    text = " ".join(reader.text)
    assert "7 solved, 1 impossible" in text
    assert "5" * 64 in text
    assert len(reader.ids) == len(set(reader.ids))


def test_what_is_not_worked_out_yet_is_said() -> None:
    reader, data = read(study_page(result(["A", "B"], pending=3)))
    assert "3 pending" in " ".join(reader.text)
    assert data["usable"][-3:] == [False] * 3


def test_an_error_of_the_program_was_drawn_as_no_usable_motion() -> None:
    """Nor was the reason told, but for who read the table of points."""
    made = result(["A", "B"], pending=1)
    made.answers["0 0.02"] = row("0 0.02", "ERROR", "KeyError: 'rim'")
    made.answers["0 0.03"] = row("0 0.03", "ERROR", "KeyError: 'other'")
    made.answers["0 0.01"] = row("0 0.01", "INFEASIBLE", "Proved impossible")
    reader, data = read(study_page(made))
    told = {"ERROR": "2 without an answer, error: KeyError: 'rim'", "PENDING": "1 without an answer, pending"}
    assert data["unanswered"] == told
    assert set(told.values()) <= set(reader.text)


def test_a_budget_is_told_with_its_yield() -> None:
    reader, data = read(study_page(result(["A", "B"], budget=11.5)))
    text = " ".join(reader.text)
    assert data["budget"] == 11.5
    assert "62.50%" in text  # 5 of 8
    assert "5 of 8" in text


def test_names_cannot_leave_their_place() -> None:
    page = study_page(result([HOSTILE, "B"], title=HOSTILE, note=HOSTILE))
    reader, data = read(page)
    assert "b" not in reader.tags
    assert data["rows"][0][0] == HOSTILE
    assert reader.tags.count("script") == 3


def test_more_points_than_a_chart_holds_are_thinned_out_evenly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_POINTS", 4)
    monkeypatch.setattr(module, "MOST_ROWS", 2)
    reader, data = read(study_page(result(["A", "B"])))
    assert data["numbers"] == [0, 2, 4, 6]
    assert data["of"] == 8
    assert "2 of 8 points, evenly chosen" in " ".join(reader.text)


def test_bounds_are_not_rounded_up() -> None:
    made = result(["A"])
    made.answers["0 0.01"]["lower_bound"] = 0.98765477
    reader, _ = read(study_page(made))
    assert "0.987654" in reader.text


def test_pictures_show_dollar_signs_as_they_are() -> None:
    page = study_page(result(["A", "B"], title="5 $ or 6 $"))
    assert "5 $ or 6 $" in page[page.index("<svg") : page.index("</svg")]


def test_a_missing_plotly_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    rendering.plotly.cache_clear()
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    with pytest.raises(InputError, match=r"in this project's folder, .*install .*-e '\.\[pictures\]'"):
        rendering.plotly()


def test_infinite_values_are_none() -> None:
    made = result(["A"])
    made.answers["0 0.01"]["amount"] = math.inf
    _, data = read(study_page(made))
    assert data["rows"][0][data["columns"].index("amount")] is None
